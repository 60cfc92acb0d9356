"""Kernels: functions compiled by numba, kept on disk for as long as nothing that they are made of has changed.

Numba's own cache looks at the file of a kernel; a kernel also hangs on kernels and constants of other files.  Here the
name of the compiled file says all of it: byte code and constants of the function and of everything that it calls, types
of the arguments, processor.  What has not changed is found again after any edit, what has is compiled anew, and several
processes may compile at the same time.
"""

import gc
import hashlib
import os
import pickle
import sys
import types as python_types
import uuid
from pathlib import Path

import numba
import numpy as np
from numba.core import types
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps
from numba.np.ufunc.dufunc import DUFunc

SUFFIX = ".kernel"
LETTERS = 20            # of a checksum in hexadecimal
COLLECTED_AFTER = 100_000, 50, 100      # objects; a compiler makes many: looking for dead ones took a seventh of its time
LIBRARIES = {"numpy", "numba", "math", "cmath", "operator"}        # numba knows them itself


def njit(function=None, **options):
    """As numba.njit, kept on disk, callable from several threads at once.

    A constant handed to another kernel counts as any value of its type: numba would compile that kernel once more for
    each constant.
    """
    if function is None:
        return lambda function: njit(function, **options)
    given = {"nopython": True, "boundscheck": None, "nogil": True, "no_cfunc_wrapper": True, **options}
    given.pop("cache", None)
    return Kernel(py_func=function, targetoptions=given)


class Kernel(CPUDispatcher):
    """A function compiled for each combination of types that it is called with."""

    def compile(self, sig):
        if not isinstance(self._cache, KernelCache):        # at first use: what it calls may stand below it in the file
            self._cache = KernelCache(self)
        before = gc.get_threshold()
        gc.set_threshold(*COLLECTED_AFTER)
        try:
            return super().compile(sig)
        finally:
            gc.set_threshold(*before)

    def get_call_template(self, args, kws):
        return super().get_call_template([types.unliteral(a) for a in args],
                                         {name: types.unliteral(a) for name, a in kws.items()})


class KernelCache(FunctionCache):
    """What numba asks for compiled code, and hands it to."""

    def __init__(self, kernel):
        super().__init__(kernel.py_func)
        name = self._impl.filename_base.rpartition("-")[0]
        self._cache_file = KernelFiles(Path(self._cache_path), name, fingerprint(kernel))

    def _index_key(self, sig, codegen):
        return repr((sig, list(_fields(sig)), codegen.magic_tuple()))


def _fields(sig):
    """Names of the fields of all named tuples among types: numba knows them by their places alone."""
    for one in sig if isinstance(sig, tuple) else sig.args:
        if isinstance(one, types.BaseNamedTuple):
            yield one.fields
        yield from _fields(tuple(getattr(one, "types", ())))


class KernelFiles:
    """The compiled files of one kernel: <kernel>.<checksum of its sources>.<checksum of the types>.kernel."""

    def __init__(self, folder, name, sources):
        self.folder, self.name, self.sources = folder, name, sources

    def load(self, key):
        """What `save` was given, or None."""
        try:
            return pickle.loads(self._path(key).read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):         # not there, or cut off
            return None

    def save(self, key, data):
        """Write a file and remove those of other sources.  Where there is no room for it the next process compiles anew."""
        path = self._path(key)
        beside = path.with_suffix(f".{uuid.uuid4().hex[:LETTERS]}")
        try:
            beside.write_bytes(dumps(data))
            os.replace(beside, path)
            for other in self.folder.glob(f"{self.name}.*{SUFFIX}"):
                if not other.name.startswith(f"{self.name}.{self.sources}."):
                    other.unlink(missing_ok=True)
        except OSError:
            beside.unlink(missing_ok=True)

    def flush(self):
        """Remove the files of this kernel."""
        for path in self.folder.glob(f"{self.name}.*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def _path(self, key):
        return self.folder / f"{self.name}.{self.sources}.{_checksum(key)}{SUFFIX}"


# what compiled code is made of -----------------------------------------------------------------


def fingerprint(kernel):
    """Checksum of a kernel, of all kernels and constants that it can reach, of Python's and numba's versions."""
    reached, waiting = {}, [kernel]
    while waiting:
        one = waiting.pop()
        if id(one) not in reached:
            reached[id(one)], needs = _own_text(one)
            waiting += needs
    return _checksum("\n".join([sys.version, numba.__version__, *sorted(reached.values())]))


def _own_text(kernel, known={}):
    """What a kernel says itself, and the kernels that it names; kept, as functions do not change."""
    if id(kernel) not in known:
        function = kernel.py_func if isinstance(kernel, Dispatcher) else kernel._dispatcher.py_func
        texts, needs = [function.__module__, function.__qualname__, repr(function.__defaults__)], []
        texts.append(repr(sorted(kernel.targetoptions.items())) if isinstance(kernel, Dispatcher) else "")
        names = set()
        _read(function.__code__, function.__doc__, texts, names)
        for name in sorted(names & function.__globals__.keys()):
            _describe(name, function.__globals__[name], names, texts, needs)
        known[id(kernel)] = kernel, "\n".join(texts), needs
    return known[id(kernel)][1:]


def _read(code, doc, texts, names):
    """Byte code, constants and names of a code object and of those within it, but for its docstring."""
    texts += [code.co_code.hex(), repr((code.co_varnames, code.co_freevars, code.co_names))]
    names.update(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, python_types.CodeType):
            _read(constant, None, texts, names)
        elif doc is None or constant != doc:
            texts.append(_constant(constant))


def _describe(name, value, names, texts, needs):
    """A global name of a kernel: another kernel into needs, anything else into texts."""
    if isinstance(value, (Dispatcher, DUFunc)):
        needs.append(value)
    elif isinstance(value, python_types.ModuleType):
        if value.__name__.partition(".")[0] not in LIBRARIES:
            for inner in sorted(names & vars(value).keys()):
                _describe(f"{name}.{inner}", vars(value)[inner], names, texts, needs)
    elif isinstance(value, type):
        texts.append(f"{name} = {value.__module__}.{value.__qualname__}{getattr(value, '_fields', '')}")
    elif callable(value):
        texts.append(f"{name} = {getattr(value, '__module__', '')}.{value.__name__}")
    else:
        texts.append(f"{name} = {_constant(value)}")


def _constant(value):
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {_checksum(value.tobytes())}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}{getattr(value, '_fields', '')}({', '.join(map(_constant, value))})"
    if isinstance(value, frozenset):
        return repr(sorted(map(_constant, value)))
    if value is None or value is ... or isinstance(value, (bool, int, float, complex, str, bytes, np.generic, slice)):
        return repr(value)
    raise TypeError(f"a kernel takes no constant of type {type(value).__name__}")


def _checksum(text):
    return hashlib.sha256(text if isinstance(text, bytes) else text.encode()).hexdigest()[:LETTERS]
