"""What kernels take in of the kernels that they call: code that nothing else ever calls.

Numba makes of every kernel what Python needs to call it, and machine code at once.  Of a kernel that only kernels call
neither is ever used: its code goes into that of its callers.  Here it stays as it is before machine code, and whoever
calls it links it in.
"""

from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering

from cuspline.values.kernel_folders import KernelLocator


class Place:
    """Stands for a part where numba asks for the function that Python calls."""


class PartLibrary(JITCodeLibrary):
    """Code for other code to link in; it never becomes machine code by itself."""

    def _finalize_final_module(self):
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    @classmethod
    def read(cls, codegen, name, bitcode):
        """What `serialize_using_bitcode` gave."""
        library = cls(codegen, name)
        library._final_module = binding.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Numba's own, without what Python needs to call the result."""

    _name = "part_lowering"

    def run_pass(self, state):
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        # only from here on: types under other flags would be found out once more
        state.flags.no_compile = state.flags.no_cpython_wrapper = True
        super().run_pass(state)
        made = state["cr"]._replace(cfunc=Place())
        state.targetctx.insert_user_function(made.cfunc, made.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = made
        return True


class PartCompiler(CompilerBase):
    """Numba's own, with PartLowering."""

    def define_pipelines(self):
        made, stages = PassManager("part"), DefaultPassBuilder
        for stage in (stages.define_untyped_pipeline, stages.define_typed_pipeline, stages.define_nopython_lowering_pipeline):
            made.passes += [(PartLowering if one is NativeLowering else one, what) for one, what in stage(self.state).passes]
        made.finalize()
        return [made]


class PartCacheImpl(CompileResultCacheImpl):
    """Parts on their way to disk and back."""

    _locator_classes = [KernelLocator]

    def reduce(self, cres):
        cres.fndesc.typemap = cres.fndesc.calltypes = None              # as numba itself: not to be pickled
        return {"library": cres.library.serialize_using_bitcode(), "environments": cres._find_referenced_environments(),
                **{name: getattr(cres, name) for name in ("fndesc", "environment", "signature", "reload_init")}}

    def rebuild(self, target_context, payload):
        for initialise in payload["reload_init"]:
            initialise()
        name, _, bitcode = payload["library"]
        return CompileResult(
            typing_context=target_context.typing_context, target_context=target_context, entry_point=Place(), typing_error=None,
            type_annotation="", signature=payload["signature"], objectmode=False, lifted=(), fndesc=payload["fndesc"],
            library=PartLibrary.read(target_context.codegen(), name, bitcode), call_helper=None,
            environment=payload["environment"], metadata=None, reload_init=payload["reload_init"],
            referenced_envs=payload["environments"])
