"""The house: every floor imports from below only, no two folders need each other, readers do not know writers."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
FLOORS = ({"values"}, {"splines", "scallop", "shop"}, {"kernel", "program"}, {"posts"}, {"surfaces", "stock"},
          {"design", "replay"}, {"toolpaths", "process"}, {"planning", "verification"}, {"report"}, {"app"}, {"designs"})
CATALOGUE = ("cuspline.app.catalogue", "cuspline.designs")      # finds designs by name
RANK = {name: rank for rank, floor in enumerate(FLOORS) for name in floor}
MOST_BARE = 250         # numbers that index something in kernels: the first place of a stack, the second side of a shape


@cache
def modules():
    """{dotted name: path} of all that is imported as `cuspline`."""
    tops = {"pipeline": "cuspline", "designs": "cuspline.designs", "posts": "cuspline.posts"}
    return {".".join([package, *path.relative_to(ROOT / top).with_suffix("").parts]): path
            for top, package in tops.items() for path in sorted((ROOT / top).rglob("*.py"))
            if path.name not in ("__init__.py", "__main__.py")}


@cache
def imports():
    """Tuple of (module, what it imports), wherever in the file the import stands."""
    return tuple(_imports())


def _imports():
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text())):
            for dotted in _dotted(node):
                for target in (dotted, dotted.rpartition(".")[0]):
                    if target.startswith("cuspline.") and target != name:
                        yield name, target
                        break


def _dotted(node):
    if isinstance(node, ast.ImportFrom) and node.module:
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else []


def folder(name):
    """The folder of a module: a floor, or a room of toolpaths."""
    parts = name.split(".")
    return ".".join(parts[1:3]) if parts[1] == "toolpaths" else parts[1]


def arguments(function):
    """How many arguments a function takes by name."""
    a = function.args
    return len(a.posonlyargs + a.args + a.kwonlyargs)


def is_kernel(function):
    return any("njit" in ast.unparse(decorator) for decorator in function.decorator_list)


def has_number(index):
    """Whether an index, or one of several, is a whole number written out."""
    return any(isinstance(one, ast.Constant) and isinstance(one.value, int)
               for one in (index.elts if isinstance(index, ast.Tuple) else [index]))


def test_every_module_stands_on_a_floor():
    assert {name.split(".")[1] for name in modules()} == set(RANK)


def test_no_floor_imports_from_above():
    assert [pair for pair in imports() if RANK[pair[0].split(".")[1]] < RANK[pair[1].split(".")[1]] and pair != CATALOGUE] == []


def test_folders_of_one_floor_are_in_no_knot():
    needs = {(folder(a), folder(b)) for a, b in imports()
             if folder(a) != folder(b) and (b in modules() or b.rpartition(".")[0] in modules())}
    beyond = set(needs)
    while more := {(a, d) for a, b in beyond for c, d in needs if b == c} - beyond:
        beyond |= more
    assert [pair for pair in sorted(beyond) if pair[0] == pair[1]
            or pair[::-1] in beyond and "designs" not in pair] == []


def test_posts_know_programs_and_values_only_and_readers_know_no_writer():
    of_posts = [(a, b) for a, b in imports() if a.startswith("cuspline.posts.")]
    assert {b.split(".")[1] for _, b in of_posts} <= {"posts", "program", "values"}
    assert [pair for pair in of_posts if ".readers." in pair[0] and ".writers" in pair[1]] == []
    assert [pair for pair in of_posts if ".writers." in pair[0] and ".readers" in pair[1]] == []


def test_the_import_name_is_a_folder_for_editors_and_type_checkers():
    assert (ROOT / "cuspline").resolve() == ROOT / "pipeline"
    assert [(ROOT / "pipeline" / name).resolve() for name in ("designs", "posts")] == [ROOT / "designs", ROOT / "posts"]


def test_hardly_a_function_takes_more_than_seven_arguments():
    """What belongs together is a value with a name; kernels take what numba knows, commands their options."""
    long = [f"{name}.{f.name}" for name, path in modules().items() for f in ast.walk(ast.parse(path.read_text()))
            if isinstance(f, ast.FunctionDef) and not is_kernel(f) and arguments(f) > 7]
    assert len(long) <= 5, long


def test_columns_that_kernels_read_have_names():
    """`row[NORMAL]` can be read, `row[3]` cannot."""
    bare = [f"{name}.{kernel.name}: {ast.unparse(part)}" for name, path in modules().items()
            for kernel in ast.walk(ast.parse(path.read_text())) if isinstance(kernel, ast.FunctionDef) and is_kernel(kernel)
            for part in ast.walk(kernel) if isinstance(part, ast.Subscript) and has_number(part.slice)]
    assert len(bare) <= MOST_BARE, bare


def test_every_module_of_planning_can_be_imported_first():
    """Strategies know the modules that plan for them and are known by them: whichever comes first, nothing runs in a circle."""
    first = [name for name in modules() if name.startswith("cuspline.planning.")]
    code = (f"import sys, importlib\nfor name in {first!r}:\n"
            "    for known in [m for m in sys.modules if m.startswith('cuspline.planning')]:\n        del sys.modules[known]\n"
            "    importlib.import_module(name)\n")
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
