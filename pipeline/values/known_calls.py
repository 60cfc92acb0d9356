"""What numba has found out about a call is kept for the next one alike.

For every `a + b` and `a[k]` numba asks dozens of templates anew which of them fits, in every kernel and in every round of
its search for types: nine of ten questions have been answered before.
"""

from contextlib import contextmanager

from numba.core import types
from numba.core.targetconfig import ConfigStack


class KnownCalls:
    """Signatures of calls of numba's own functions, by function, types of the arguments, and flags of the compiler."""

    def __init__(self):
        self._by_flags = []             # of (flags, {(function, arguments, named arguments): signature})
        self._flags, self._known = None, {}

    @contextmanager
    def within(self, typing_context):
        """A block in which a typing context is asked for each kind of call once."""
        if "_resolve_user_function_type" in vars(typing_context):       # a kernel within a kernel
            yield
            return
        ask = typing_context._resolve_user_function_type

        def asked_once(function, args, kws, literals=None):
            if type(function) is not types.Function:
                return ask(function, args, kws, literals)
            known, call = self._known_now(), (function, tuple(args), tuple(kws.items()))
            if call not in known:
                known[call] = ask(function, args, kws, literals)
            return known[call]

        typing_context._resolve_user_function_type = asked_once
        try:
            yield
        finally:
            del typing_context._resolve_user_function_type

    def _known_now(self):
        """Calls under the flags of what is being compiled; comparing flags is slow, they change with the function only."""
        flags = ConfigStack.top_or_none()
        if flags is None or flags is not self._flags:
            found = next((known for other, known in self._by_flags if other == flags), None)
            if found is None:
                found = {}
                self._by_flags.append((None if flags is None else flags.copy(), found))
            self._flags, self._known = flags, found
        return self._known
