"""Kernels: functions compiled by numba, kept on disk for as long as nothing that they are made of has changed.

Numba's own cache looks at the file of a kernel; a kernel also hangs on kernels and constants of other files.  Here the
name of the compiled file says all of it: byte code and constants of the function and of everything that it calls, types
of the arguments, processor.  What has not changed is found again after any edit, what has is compiled anew, and several
processes may compile at the same time.
"""

import fcntl
import gc
import hashlib
import os
import pickle
import sys
import time
import types as python_types
import uuid
from contextlib import contextmanager, nullcontext
from functools import cached_property
from pathlib import Path

import numba
import numpy as np
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps

from cuspline.values.kernel_folders import KernelLocator, folder_of
from cuspline.values.kernel_parts import PartCacheImpl, PartCompiler
from cuspline.values.known_calls import KnownCalls

SUFFIX = ".kernel"
LETTERS = 20            # of a checksum in hexadecimal
OPTIONS = {"nopython": True, "boundscheck": None, "nogil": True, "no_cfunc_wrapper": True}
COLLECTED_AFTER = 100_000, 50, 100      # objects; Python's own figures cost a compiler a seventh of its time
PATIENCE_S, LOOK_S = 120.0, 0.02        # waiting for another process that compiles the same; how often to look
KNOWN_CALLS = KnownCalls()
_TEXTS = {}             # id of a kernel -> the kernel, what it says, the kernels that it names
LIBRARIES = {"numpy", "numba", "math", "cmath", "operator"}        # numba knows them itself


def njit(function=None, **options):
    """As numba.njit, kept on disk, callable from several threads at once.

    A constant handed to another kernel counts as any value of its type: numba would compile that kernel once more for
    each constant.
    """
    if function is None:
        return lambda function: njit(function, **options)
    return Kernel(py_func=function, targetoptions={**OPTIONS, **options})


def elementwise(function):
    """A function of numbers as a kernel; called from Python it takes arrays too, broadcast, as NumPy's ufuncs do.

    >>> @elementwise
    ... def double(x):
    ...     return 2.0 * x
    >>> double(1), double([[1, 2]])
    (np.float64(2.0), array([[2., 4.]]))
    """
    return Elementwise(py_func=function, targetoptions={**OPTIONS, "error_model": "numpy"})


class CompiledOnce(CPUDispatcher):
    """Compiled once for each combination of types, by one of all processes."""

    def compile(self, sig):
        with global_compiler_lock:
            if tuple(getattr(sig, "args", sig)) in self.overloads:
                return super().compile(sig)
            if type(self._cache) is NullCache:      # at first use: what it calls may stand below it in the file
                self._cache = self._kept_at() if is_kept(self.py_func) else NotKept()
            with self._cache.turn(sig, self.targetctx), _rare_collections(), KNOWN_CALLS.within(self.typingctx):
                return super().compile(sig)


class Kernel(CompiledOnce):
    """A function compiled for each combination of types that it is called with: here as Python calls it."""

    def _kept_at(self):
        return KernelCache(self)

    @cached_property
    def part(self):
        """The same as other kernels call it."""
        return Part(self)

    def add_overload(self, cres):
        super().add_overload(cres)
        for environment in cres._find_referenced_environments():        # those of the parts
            cres.codegen.set_env(environment.env_name, environment)

    @property
    def is_compiling(self):
        return super().is_compiling or self.part.is_compiling

    def get_call_template(self, args, kws):
        return self.part.get_call_template([self._as_handed_over(a) for a in args],
                                           {name: self._as_handed_over(a) for name, a in kws.items()})

    def get_overload(self, sig):
        return self.part.get_overload(sig)

    @staticmethod
    def _as_handed_over(argument):
        """The type of an argument in another kernel's call."""
        return types.unliteral(argument)


class Part(CompiledOnce):
    """A kernel as other kernels call it, see kernel_parts.py."""

    def __init__(self, kernel):
        super().__init__(py_func=kernel.py_func, targetoptions=kernel.targetoptions, pipeline_class=PartCompiler)
        self.kernel = kernel

    def _kept_at(self):
        return PartCache(self.kernel)

    def add_overload(self, cres):
        self.overloads[tuple(cres.signature.args)] = cres


class Elementwise(Kernel):
    """See `elementwise`."""

    def __call__(self, *values):
        if all(isinstance(value, (float, int)) for value in values):
            return np.float64(super().__call__(*map(float, values)))
        arrays = [np.array(a) for a in np.broadcast_arrays(*(np.asarray(value, float) for value in values))]
        out = np.empty(arrays[0].shape)
        self._over_rows(*(a.reshape(-1) for a in arrays), out.reshape(-1))
        return out if out.ndim else out[()]

    @cached_property
    def _over_rows(self):
        """The kernel that calls this one for each row of flat arrays."""
        one = self
        if self.py_func.__code__.co_argcount == 1:
            def rows(x, out):
                for k in range(len(out)):
                    out[k] = one(x[k])
        else:
            def rows(x, y, out):
                for k in range(len(out)):
                    out[k] = one(x[k], y[k])
        rows.__qualname__ = f"{self.py_func.__qualname__}.rows"
        rows.__module__ = self.py_func.__module__
        return njit(rows)

    @staticmethod
    def _as_handed_over(argument):
        return types.float64 if isinstance(argument, types.Number) else argument


@contextmanager
def _rare_collections():
    """A compiler makes objects by the million, and nearly all of them stay: looking for dead ones finds few."""
    before = gc.get_threshold()
    gc.set_threshold(*COLLECTED_AFTER)
    try:
        yield
    finally:
        gc.set_threshold(*before)


class NotKept(NullCache):
    """For a function without a file, as in a doctest, and where nothing can be written."""

    def turn(self, sig, target_context):
        return nullcontext()


def is_kept(function):
    """Whether the compiled code of a function can be kept."""
    file = function.__code__.co_filename
    return Path(file).exists() and folder_of(function.__module__, file)[0] is not None


class KernelCacheImpl(CompileResultCacheImpl):
    """Kernels on their way to disk and back."""

    _locator_classes = [KernelLocator]


class KernelCache(FunctionCache):
    """What numba asks for compiled code, and hands it to."""

    _impl_class, suffix = KernelCacheImpl, ""

    def __init__(self, kernel):
        super().__init__(kernel.py_func)
        name = self._impl.filename_base.rpartition("-")[0] + self.suffix
        _, states = folder_of(kernel.py_func.__module__, kernel.py_func.__code__.co_filename)
        self._cache_file = KernelFiles(Path(self._cache_path), name, fingerprint(kernel), states)

    def _index_key(self, sig, codegen):
        return repr((sig, list(_fields(sig)), codegen.magic_tuple()))

    def turn(self, sig, target_context):
        """A block in which no other process compiles the same."""
        return self._cache_file.turn(self._index_key(sig, target_context.codegen()))


class PartCache(KernelCache):
    """The same for parts."""

    _impl_class, suffix = PartCacheImpl, "-part"


def _fields(sig):
    """Names of the fields of all named tuples among types: numba knows them by their places alone."""
    for one in sig if isinstance(sig, tuple) else sig.args:
        if isinstance(one, types.BaseNamedTuple):
            yield one.fields
        yield from _fields(tuple(getattr(one, "types", ())))


class KernelFiles:
    """The compiled files of one kernel: <kernel>.<checksum of its sources>.<checksum of the types>.kernel."""

    def __init__(self, folder, name, sources, states=1):
        self.folder, self.name, self.sources, self.states = folder, name, sources, states

    def load(self, key):
        """What `save` was given, or None."""
        try:
            return pickle.loads(self._path(key).read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):         # not there, or cut off
            return None

    def save(self, key, data):
        """Write a file, remove those of the oldest sources.  Where there is no room for it the next process compiles anew."""
        path = self._path(key)
        beside = path.with_suffix(f".{uuid.uuid4().hex[:LETTERS]}")
        try:
            beside.write_bytes(dumps(data))
            os.replace(beside, path)
            self._remove_oldest()
        except OSError:
            beside.unlink(missing_ok=True)

    def _remove_oldest(self):
        """Leave the files of as many states of the sources as may stay, the present one among them."""
        of_others = {}
        for path in self._files():
            sources = path.name.split(".")[-3]
            if sources != self.sources:
                of_others.setdefault(sources, []).append(path)
        if len(of_others) < self.states:
            return
        newest_first = sorted(of_others.values(), key=lambda files: max(_written_ns(f) for f in files), reverse=True)
        for files in newest_first[self.states - 1:]:
            for path in files:
                path.unlink(missing_ok=True)

    @contextmanager
    def turn(self, key):
        """A block for which another process that has begun to compile this is waited for.

        Kernels need each other in one direction: two processes never wait for each other.
        """
        path = self._path(key)
        try:
            lock = None if path.exists() else open(path.with_suffix(".lock"), "w")
        except OSError:                     # nothing can be kept here
            lock = None
        if lock is None:
            yield
            return
        with lock:
            until = time.monotonic() + PATIENCE_S
            while not _is_mine(lock) and time.monotonic() < until:
                time.sleep(LOOK_S)
            try:
                yield
            finally:
                Path(lock.name).unlink(missing_ok=True)

    def flush(self):
        """Remove the files of this kernel."""
        for path in self._files():
            path.unlink(missing_ok=True)

    def _files(self):
        """Those of this kernel, not of one within it (`one.rows`)."""
        return [path for path in self.folder.glob(f"{self.name}.*{SUFFIX}")
                if path.name.count(".") == self.name.count(".") + 3]

    def _path(self, key):
        return self.folder / f"{self.name}.{self.sources}.{_checksum(key)}{SUFFIX}"


def _written_ns(path):
    """When a file was written; 0: another process has removed it."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _is_mine(lock):
    """Whether an open file is locked by this process now, and by no other."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


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


def _own_text(kernel):
    """What a kernel says itself, and the kernels that it names; kept, as functions do not change."""
    if id(kernel) not in _TEXTS:
        function, names, needs = kernel.py_func, set(), []
        texts = [function.__module__, function.__qualname__, repr(function.__defaults__),
                 repr(sorted(kernel.targetoptions.items()))]
        _read(function.__code__, function.__doc__, texts, names)
        outer = {name: cell.cell_contents for name, cell in zip(function.__code__.co_freevars, function.__closure__ or ())}
        for name in sorted(names & function.__globals__.keys() | outer.keys()):
            _describe(name, outer.get(name, function.__globals__.get(name)), names, texts, needs)
        _TEXTS[id(kernel)] = kernel, "\n".join(texts), needs
    return _TEXTS[id(kernel)][1:]


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
    if isinstance(value, Dispatcher):
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
