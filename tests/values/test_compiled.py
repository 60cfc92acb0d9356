"""Kernels are compiled once, and anew when anything that they are made of has changed."""

import importlib.util
import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba.core import config, types
from numba.core.registry import cpu_target

from cuspline.values import compiled, kernel_folders
from cuspline.values.compiled import fingerprint, njit

CALLED = """
from cuspline.values.compiled import njit
STEP = 2.0


@njit
def inner(x):
    return x + STEP
"""
CALLING = """
import numpy as np
from cuspline.values.compiled import njit
import {0}
from {0} import inner


@njit
def outer(x):
    \"\"\"Says what.\"\"\"
    return {0}.inner(x) * np.sqrt(4.0)


@njit
def beside(x):
    return x - 1.0
"""

RAISING = """
import math
from cuspline.values.compiled import njit


@njit
def root(x):
    if x < 0.0:
        raise ValueError("no root of less than nothing")
    return math.sqrt(x)
"""
RAISED = """
from cuspline.values.compiled import njit
from {0} import root


@njit
def roots(x, out):
    for k in range(len(x)):
        out[k] = root(x[k])


@njit
def factorial(n):
    if n < 2:
        return 1
    return n * factorial(n - 1)


@njit
def choices(n, k):
    return factorial(n) // (factorial(k) * factorial(n - k))
"""


@pytest.fixture
def read(tmp_path, monkeypatch):
    """read(called=..., calling=...): the calling module of two files, as a new process would import it."""
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def load(called=CALLED, calling=CALLING):
        for name, text in (("called_kernels", called), ("calling_kernels", calling.format("called_kernels"))):
            (tmp_path / f"{name}.py").write_text(text)
            spec = importlib.util.spec_from_file_location(name, tmp_path / f"{name}.py")
            module = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, name, module)
            spec.loader.exec_module(module)
        return module
    return load


@pytest.fixture(autouse=True)
def nowhere_else(monkeypatch):
    """Kernels are kept where they are without NUMBA_CACHE_DIR."""
    monkeypatch.setattr(config, "CACHE_DIR", "")


def was_compiled(kernel, *arguments):
    """Whether a call compiled (and did not find compiled code on disk)."""
    kernel(*arguments)
    return bool(kernel.stats.cache_misses)


def test_what_was_compiled_is_found_again(read):
    assert read().outer(1.0) == 6.0
    assert [was_compiled(read().outer, x) for x in (1.0, np.float64(2.0), 3)] == [False, False, True]


@pytest.mark.parametrize("before,after,result", [("STEP = 2.0", "STEP = 3.0", 8.0), ("x + STEP", "x - STEP", -2.0)])
def test_a_changed_constant_or_line_of_another_file_compiles_what_hangs_on_it(before, after, result, read):
    read().outer(1.0), read().beside(1.0)
    changed = read(called=CALLED.replace(before, after))
    assert was_compiled(changed.outer, 1.0) and changed.outer(1.0) == result
    assert not was_compiled(changed.beside, 1.0)


@pytest.mark.parametrize("before,after", [("Says what.", "Says more."), ("x - 1.0", "x - 2.0"), ("import np", "\n\n\nimport np"),
                                          ("@njit\ndef outer", "# a comment\n@njit\ndef outer")])
def test_an_edit_beside_a_kernel_leaves_it(before, after, read):
    read().outer(1.0)
    assert not was_compiled(read(calling=CALLING.replace(before, after)).outer, 1.0)


def test_only_the_files_of_the_sources_as_they_are_stay(read, tmp_path):
    read().outer(1.0), read().beside(1.0)
    before = set(tmp_path.rglob("*.kernel"))
    read(calling=CALLING.replace("np.sqrt(4.0)", "np.sqrt(9.0)")).outer(1.0)
    after = set(tmp_path.rglob("*.kernel"))
    assert len(before) == len(after) == 3 and len(before & after) == 2


def test_a_spoilt_file_of_compiled_code_is_compiled_anew(read, tmp_path):
    read().outer(1.0)
    for path in tmp_path.rglob("*.kernel"):
        path.write_bytes(path.read_bytes()[:100])
    assert was_compiled(read().outer, 1.0) and not was_compiled(read().outer, 1.0)


def test_a_kernel_that_only_kernels_call_is_compiled_for_them_alone(read):
    outer = read().outer
    assert outer(1.0) == 6.0
    inner = sys.modules["called_kernels"].inner
    assert len(inner.part.signatures) == 1 and not inner.signatures and not outer.part.signatures
    assert inner(1.0) == 3.0 and len(inner.signatures) == 1


def test_what_a_kernel_within_a_kernel_refuses_comes_through_compiled_or_found_again(read):
    for _ in range(2):
        kernels, out = read(RAISING, RAISED), np.zeros(2)
        kernels.roots(np.array([4.0, 9.0]), out)
        assert out.tolist() == [2.0, 3.0]
        with pytest.raises(ValueError, match="no root of less than nothing"):
            kernels.roots(np.array([4.0, -9.0]), out)


def test_a_caller_compiled_anew_takes_in_what_is_found_on_disk(read):
    read(RAISING, RAISED).roots(np.ones(1), np.zeros(1))
    changed = read(RAISING, RAISED.replace("out[k] = root", "out[k] = 2.0 * root"))
    out = np.zeros(1)
    changed.roots(np.array([4.0]), out)
    assert out.tolist() == [4.0] and not sys.modules["called_kernels"].root.part.stats.cache_misses
    with pytest.raises(ValueError, match="no root"):
        changed.roots(np.array([-1.0]), out)


def test_a_kernel_may_call_itself(read):
    for _ in range(2):
        kernels = read(RAISING, RAISED)
        assert kernels.choices(5, 2) == 10 and kernels.factorial(5) == 120


def test_numba_is_asked_once_for_calls_that_are_alike(monkeypatch):
    monkeypatch.setattr(compiled.KernelFiles, "load", lambda self, key: None)
    asked, known = [], compiled.KnownCalls()
    monkeypatch.setattr(compiled, "KNOWN_CALLS", known)
    typing_context = cpu_target.typing_context
    ask = typing_context._resolve_user_function_type
    monkeypatch.setattr(type(typing_context), "_resolve_user_function_type",
                        lambda self, function, args, kws, literals=None: asked.append((function, tuple(args))) or ask(
                            function, args, kws, literals))

    @njit
    def kernel(x, y):
        return (x + y) * (x + x) * (y + y) + (x + y)

    assert kernel(1.0, 2.0) == 27.0 and kernel(1, 2) == 27
    again = [call for call in asked if asked.count(call) > 1 and type(call[0]) is types.Function]
    assert len(asked) >= 4 and again == []


def test_fields_of_a_named_tuple_that_change_places_are_another_type():
    @njit
    def first(pair):
        return pair.a

    for fields in (("a", "b"), ("b", "a")):
        pair = NamedTuple("Pair", [(name, float) for name in fields])(1.0, 2.0)
        assert first(pair) == pair.a


def test_a_constant_is_one_argument_like_any_other(monkeypatch):
    monkeypatch.setattr(compiled.KernelFiles, "load", lambda self, key: None)

    @njit
    def inner(x, k):
        return x + k

    @njit
    def outer(x, k):
        return inner(x, 1) + inner(x, 2) + inner(x, k)
    assert outer(0.0, 3) == 6.0 and len(inner.part.signatures) == 1


def test_a_constant_that_cannot_be_told_apart_is_refused():
    names = {"njit": njit, "odd": object(), "__name__": "odd"}
    exec("@njit\ndef kernel():\n    return odd", names)
    with pytest.raises(TypeError, match="constant of type object"):
        fingerprint(names["kernel"])


def test_the_checksum_of_a_kernel_does_not_depend_on_the_process():
    """Sets of words are in another order in every process."""
    assert compiled._constant(frozenset({"b", "a", "c"})) == "[\"'a'\", \"'b'\", \"'c'\"]"


# where compiled code is kept ---------------------------------------------------------------------

OWN = """
from cuspline.values.compiled import njit


@njit
def own(x):
    return x + 3.0
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """installed(environment, text): the kernel of a package installed into an environment, as a new process would import it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def load(environment, text=OWN):
        folder = tmp_path / environment / "package"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "own_kernels.py").write_text(text)
        monkeypatch.setattr(kernel_folders, "PACKAGE", folder)
        spec = importlib.util.spec_from_file_location("own_kernels", folder / "own_kernels.py")
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "own_kernels", module)
        spec.loader.exec_module(module)
        return module.own
    return load


def test_what_one_environment_has_compiled_is_found_in_the_next(installed, tmp_path):
    assert was_compiled(installed("first"), 1.0) and not was_compiled(installed("second"), 1.0)
    assert [p.parent for p in tmp_path.rglob("*.kernel")] == [tmp_path / "cache/cuspline/kernels/own_kernels"]


def test_environments_of_other_versions_do_not_remove_each_other_s_code(installed, tmp_path):
    texts = [OWN.replace("3.0", f"{k}.0") for k in range(kernel_folders.SHARED + 2)]
    for text in texts[:2]:
        installed("first", text)(1.0)
    assert not was_compiled(installed("first", texts[0]), 1.0) and not was_compiled(installed("first", texts[1]), 1.0)
    for text in texts:
        installed("first", text)(1.0)
    assert len(list(tmp_path.rglob("*.kernel"))) == kernel_folders.SHARED


def test_a_checkout_that_cannot_be_written_uses_the_user_s_cache_and_without_one_nothing_is_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    source = tmp_path / "sources/own_kernels.py"
    source.parent.mkdir()
    source.write_text(OWN)
    assert kernel_folders.folder_of("own", source) == (source.parent / "__pycache__", kernel_folders.OF_ITS_OWN)
    source = tmp_path / "a file/own_kernels.py"
    source.parent.write_text("where no folder can be made")
    assert kernel_folders.folder_of("own", source) == (tmp_path / "cache/cuspline/kernels/own", kernel_folders.SHARED)
    monkeypatch.setenv("XDG_CACHE_HOME", str(source.parent))
    assert kernel_folders.folder_of("own", source) == (None, kernel_folders.SHARED)
