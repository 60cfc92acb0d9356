"""Arrays as kernels see them while somebody else holds them.

Numba counts who holds an array: a kernel that is handed one and has loops or several ends counts up as it begins and
down as it ends, by locked instructions, which in short kernels are a sixth of the time.  A borrowed array has no count.
It must not outlive its owner: it is for what a kernel was handed itself, and hands on.
"""

from llvmlite import ir
from numba.extending import intrinsic


@intrinsic
def borrowed(typing_context, array):
    """The same array without its count."""
    def codegen(context, builder, signature, args):
        view = context.make_array(signature.args[0])(context, builder, args[0])
        view.meminfo = ir.Constant(view.meminfo.type, None)
        return view._getvalue()
    return array(array), codegen
