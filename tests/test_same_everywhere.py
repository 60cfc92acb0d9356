"""The same bytes on every processor: nothing that is chosen at run time by its vector units is asked for a number.

One test reads the code for calls that are; the others build designs in processes whose NumPy, BLAS and compiler
are told to be those of other processors, and compare every published byte; and programs with those that were recorded.

Accept programs that are meant to be others with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/test_same_everywhere.py -k recorded
"""

import ast
import hashlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DISPATCHED = {"tan", "exp", "exp2", "expm1", "log", "log10", "log2", "log1p", "arctan", "arctan2", "arcsin", "arccos", "cbrt",
              "tanh", "sinh", "cosh", "hypot", "sin", "cos", "power", "float_power", "sinc", "logaddexp", "angle"}
BLAS = {"dot", "inner", "vdot", "matmul", "tensordot", "kron", "vander", "polyfit", "polyval", "roots", "cov", "corrcoef",
        "convolve", "correlate"}
IN_LIBM = {"sin", "cos", "tan", "exp", "exp2", "log", "log2", "log10", "log1p", "expm1", "atan", "atan2", "asin", "acos",
           "pow", "sinh", "cosh", "tanh", "cbrt"}
ASKING_LAPACK = {"splu", "spsolve", "make_interp_spline", "make_lsq_spline", "CubicSpline", "gaussian_filter", "iv", "ivp",
                 "leggauss", "curve_fit", "least_squares"}
ALLOWED = {
    "pipeline/toolpaths/freeform/scallop_field.py": {"@"},      # SciPy's sparse products: plain loops
    "pipeline/stock/tree.py": {"**"},          # whole numbers
}


def dotted(node):
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def is_whole_power(node, in_kernel):
    """A square, a power of a whole number, or in compiled code a whole power: products, not the library's power."""
    base, exponent = (node.left, node.right) if isinstance(node, ast.BinOp) else (None, node.value)
    whole = lambda n: isinstance(n, ast.Constant) and isinstance(n.value, int) or (
        isinstance(n, ast.UnaryOp) and whole(n.operand))
    return whole(exponent) and (in_kernel or exponent.value == 2) or base is not None and whole(base)


def asked(tree):
    """(line, what) of everything whose bits depend on the processor."""
    kernels = {inner for f in ast.walk(tree) if isinstance(f, ast.FunctionDef)
               and any("njit" in ast.dump(d) for d in f.decorator_list) for inner in ast.walk(f)}
    for node in ast.walk(tree):
        if isinstance(node, (ast.BinOp, ast.AugAssign)):
            if isinstance(node.op, ast.MatMult):
                yield node.lineno, "@"
            elif isinstance(node.op, ast.Pow) and not is_whole_power(node, node in kernels):
                yield node.lineno, "**"
        elif isinstance(node, ast.Attribute):
            owner, _, name = dotted(node).rpartition(".")
            if owner in ("np", "numpy") and name in DISPATCHED | BLAS or owner == "math" and name in IN_LIBM:
                yield node.lineno, f"{owner}.{name}"
            elif owner == "np.linalg" and name != "norm":
                yield node.lineno, f"{owner}.{name}"
        elif isinstance(node, ast.Call):
            name, given = dotted(node.func), {k.arg: k.value for k in node.keywords}
            short = name.rpartition(".")[2]
            if name.endswith("linalg.norm") and "axis" not in given:
                yield node.lineno, "norm of a vector"           # a BLAS dot product; fixed_math.length
            elif short in ("argsort", "argpartition") and "kind" not in given:
                yield node.lineno, f"{short} without kind=\"stable\""       # equal values in the vector units' order
            elif short == "einsum" and "optimize" in given:
                yield node.lineno, "einsum, optimized"
            elif short in ASKING_LAPACK and not name.startswith("fixed."):
                yield node.lineno, short


def test_code_asks_nothing_that_depends_on_the_processor():
    wrong = []
    for path in sorted(p for folder in ("pipeline", "posts", "designs") for p in (ROOT / folder).rglob("*.py")):
        name = str(path.relative_to(ROOT))
        if name != "pipeline/values/fixed_math.py":
            wrong += [f"{name}:{line}: {what}" for line, what in asked(ast.parse(path.read_text()))
                      if what not in ALLOWED.get(name, ())]
    assert not wrong, "use cuspline.values.fixed_math: " + "; ".join(wrong)


def test_the_reading_finds_what_it_is_for():
    bad = ("a @ b", "np.arctan2(a, b)", "np.dot(a, b)", "x ** 0.5", "np.linalg.norm(a)", "np.linalg.solve(a, b)", "math.sin(x)",
           "np.argsort(a)", "np.einsum('i,i', a, b, optimize=True)", "np.power(a, 2)", "a ** n", "interpolate.splu(a)")
    good = ("fixed.matmul(a, b)", "x ** 2", "2 ** n", "np.linalg.norm(a, axis=1)", "np.argsort(a, kind='stable')",
            "np.sqrt(a)", "math.sqrt(x)", "np.einsum('i,i', a, b)", "fixed.least_squares(a, b)")
    assert [t for t in bad if not list(asked(ast.parse(t)))] == [] and [t for t in good if list(asked(ast.parse(t)))] == []


# other processors -------------------------------------------------------------------------------

DISH = Path(__file__).parent / "parts" / "small_dish.py"
BUILDS = {
    "dish": (str(DISH), "--stage", "gcode"),
    "vane": ("rfq_vane", "-p", "preset=hydrogen_750", "-p", "to_mm=6", "-p", "scallop_mm=0.03", "--stage", "gcode"),
    "propeller": ("dtmb_4119", "-p", "blades_cut=none", "--stage", "step"),
}
RECORDED_TOO = {
    "z_profile": ("z_profile", "-p", "width_mm=10", "-p", "scallop_mm=0.3", "-p", "profile_tolerance_mm=0.02", "-p",
                  "gouge_mm=0.05", "--stage", "gcode"),
    "arcs": (*BUILDS["vane"][:-2], "-p", "strategy=transverse_arcs", "--stage", "gcode"),
    "hard steel": ("h13_test", "-p", "stepover_mm=0.8", "--stage", "gcode"),
    "threads": (str(DISH.with_name("threaded_plate.py")), "--stage", "gcode"),
}
RECORD = Path(__file__).parent / "gold" / "programs.json"
ONE_THREAD = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
OLDEST = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR", **ONE_THREAD}
SETTINGS = {
    "one of 2013, kernels for another": {
        "OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
        "NUMBA_CPU_NAME": "x86-64-v2", "NUMBA_CPU_FEATURES": "", "NUMBA_OPT": "1"},
}
ALL_IN_ONE = """
import json, sys
from cuspline.app.cli import app
for order in json.loads(sys.argv[1]):
    try:
        app(order, standalone_mode=True)
    except SystemExit as end:
        if end.code:
            raise
"""
on_x86 = pytest.mark.skipif(platform.machine() != "x86_64", reason="the settings are those of x86-64")


def published(folder, builds, settings):
    """{build: {file: SHA-256}} of builds in a process of their own."""
    orders = [["build", *arguments, "--out", str(folder / name)] for name, arguments in builds.items()]
    run = subprocess.run([sys.executable, "-c", ALL_IN_ONE, json.dumps(orders)], capture_output=True, text=True, cwd=ROOT,
                         env={**os.environ, "PYTHONWARNINGS": "ignore", **settings})
    assert run.returncode == 0, run.stdout + run.stderr
    return hashes(folder, builds)


def hashes(folder, builds):
    """{build: {file: SHA-256}} of what is in a folder."""
    return {name: {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted((folder / name).iterdir())}
            for name in builds}


@pytest.fixture(scope="module")
def folder_here(tmp_path_factory):
    """Outputs of BUILDS in this folder, and of one more that is only held against the record."""
    folder = tmp_path_factory.mktemp("here")
    published(folder, {**BUILDS, **RECORDED_TOO}, {})
    return folder


@pytest.fixture(scope="module")
def here(folder_here):
    return hashes(folder_here, BUILDS)


def test_programs_and_solids_are_byte_for_byte_those_that_were_recorded(folder_here):
    """But for the line that names the inputs: a parameter that a strategy has got since stands there with its default.

    Whoever changes programs on purpose looks at them, and accepts them: see the top of this file.
    """
    lines = {path.relative_to(folder_here): path.read_bytes().splitlines(keepends=True)
             for path in sorted([*folder_here.glob("*/*.ngc"), *folder_here.glob("*/*.step")])}
    assert {name.parts[0] for name in lines if name.suffix == ".ngc"} == {*BUILDS, *RECORDED_TOO} - {"propeller"}
    assert {name.parts[0] for name in lines if name.suffix == ".step"} == {*BUILDS, *RECORDED_TOO}
    found = {str(name): hashlib.sha256(b"".join(x for x in text if not x.startswith(b"(INPUTS SHA-256 "))).hexdigest()
             for name, text in lines.items()}
    if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
        RECORD.write_text(json.dumps(found, indent=1) + "\n")
    assert found == json.loads(RECORD.read_text())


@on_x86
@pytest.mark.parametrize("setting", SETTINGS)
def test_another_processor_publishes_the_same_bytes(setting, here, tmp_path):
    assert published(tmp_path, BUILDS, SETTINGS[setting]) == here


@on_x86
def test_the_oldest_processor_gives_the_same_verdict_byte_for_byte(here, tmp_path):
    """All stages of one part beside the others' own: verdict, report and pictures' numbers too."""
    whole = {"dish": (str(DISH),)}
    assert published(tmp_path / "there", {**BUILDS, **whole}, OLDEST) == {**here, **published(tmp_path / "here", whole, {})}
