"""Finding designs, machines, tool libraries and posts, by name or by file.

A design is a Python file with one function `design(parameters) -> Design` whose argument is
annotated with its parameter model.  A job file (TOML) does the same for a plain STEP file.
"""

import importlib
import importlib.util
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib.machinery import SourceFileLoader
from pathlib import Path

from pydantic import Field, ValidationError

import cuspline.designs
import cuspline.posts
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockAllowance
from cuspline.design.dimensions import Dimension
from cuspline.design.fixtures import fixtures_beside
from cuspline.design.stock import Stock
from cuspline.shop.cutters import library_from_json
from cuspline.shop.machines import machine_from_toml
from cuspline.shop.practice import shop_file
from cuspline.shop.threads import Thread
from cuspline.values.errors import CamError, DesignError, InputError
from cuspline.values.input_files import checked, refuse_irregular, sha256_of, toml_of
from cuspline.values.models import Model, complaints, name_fault

DESIGNS = Path(cuspline.designs.__file__).parent
POSTS = Path(cuspline.posts.__file__).parent
MACHINES, LIBRARIES, WRITERS, READERS = POSTS / "machines", POSTS / "tools", POSTS / "writers", POSTS / "readers"
DEFAULT_LIBRARY = "tools"
SMALLER = {"small_mills": DEFAULT_LIBRARY, "small_balls": "small_mills",      # smaller cutters, and the library they stand beside
           "fine_mills": "small_balls"}
FOR_SLOTS = "fine_mills"    # the last of them: for slots and pockets alone, never for all of a part
SHOP = "shop."              # of a parameter that is the shop's, not the design's
OF_A_POST = {
    "EXTENSION": (str, "the ending of its files, such as \"ngc\""),
    "READER": (str, "the reader of what it writes: a module of posts/readers, or a .py file beside the post"),
    "comment": (Callable, "a function text -> the line that the control passes over"),
    "post": (Callable, "a function (program, machine) -> words.Posted")}
OF_A_TOOL_TABLE = {
    "TOOL_TABLE": (str, "the file name of the tool table that the control loads"),
    "tool_table": (Callable, "a function (tools, control) -> the text of the file TOOL_TABLE")}
OF_A_READER = {
    "read_program": (Callable, "a function (text, *, work_offsets, tool_lengths) -> PostedMoves")}
OF_A_READER_OF_TOOLS = {
    "read_tool_table": (Callable, "a function (text, control) -> [PostedTool], for the post names a tool table")}
DESIGN_FILES = (".py", ".toml")
MESHES = (".stl", ".obj", ".ply", ".3mf", ".amf", ".off", ".glb", ".gltf")


@dataclass(frozen=True, kw_only=True)
class DesignSource:
    """A design that can be made from parameters."""

    name: str
    path: Path
    parameters: type[Parameters]
    make: Callable

    def design(self, assignments):
        """Make the Design from ["name=value", ...], or from {name: value}; what is not named keeps its default.

        Raises:
            InputError: an unknown parameter, or a value that the model refuses; names it.
        """
        return self.make(self.validated(assignments))

    def validated(self, assignments):
        """The parameter model's value."""
        if isinstance(assignments, Mapping):
            return checked(self.parameters, dict(assignments), f"design {self.name}")
        given = [_assignment(a) for a in assignments]
        names = [name for name, _ in given]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise InputError(f"design {self.name}: parameter {twice[0]} is given twice; keep one")
        return checked(self.parameters, dict(given), f"design {self.name}")


def _assignment(text):
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise InputError(f"parameter {text!r} is not of the form name=value")
    return name.strip(), value.strip()


def design_names():
    """Names of the designs in designs/."""
    return sorted(p.stem for p in DESIGNS.glob("*.py") if not p.stem.startswith("_"))


def machine_names():
    return sorted(p.stem for p in MACHINES.glob("*.toml"))


def post_names():
    """Names of the posts in posts/writers/: the modules that have a function `post`."""
    return sorted(p.stem for p in WRITERS.glob("*.py") if re.search(r"^def post\(", p.read_text(), re.MULTILINE))


def find_design(name_or_file):
    """A DesignSource by name, by Python file, or by job file (TOML for a STEP part).

    Raises:
        InputError: there is none, or the file cannot be used; says why.
    """
    if name_or_file in design_names():
        return _from_module(importlib.import_module(f"cuspline.designs.{name_or_file}"), DESIGNS / f"{name_or_file}.py")
    path = Path(name_or_file)
    refuse_irregular(path, "design")
    if not path.is_file():
        raise InputError(f"there is no design {name_or_file!r} and no such file; designs: {', '.join(design_names())}")
    if path.suffix in DESIGN_FILES and (fault := name_fault(path.stem)):
        raise InputError(f"design file {path}: {fault}; its outputs are called by it")
    if path.suffix == ".py":
        return _from_module(_loaded(path), path)
    if path.suffix == ".toml":
        return _from_job(path)
    if path.suffix.lower() in (".step", ".stp"):
        from cuspline.kernel import brep
        brep.refuse_unreadable(path)
        brep.read_step(path)
        raise InputError(f"{path} is a STEP part: write a job file (TOML) that names it with its faces, finish, "
                         "stock and setups, and build that")
    _refuse_mesh(path)
    raise InputError(f"{path}: a design is a .py file, or a .toml job for a STEP part")


def _refuse_mesh(path):
    """Raises InputError for a file of triangles: offsets, curvature and verdict are those of exact surfaces."""
    if path.suffix.lower() in MESHES:
        raise InputError(f"{path} is a mesh: triangles have no curvature to choose cutters and passes by; export the "
                         "part as STEP from the program that made it, or model its faces anew; a mesh may be the stock: "
                         'stock = { stl = "blank.stl" }')


class _AsItStands(SourceFileLoader):
    """Compiles a file anew each time: Python takes byte code for fresh where size and whole second of the file are the same."""

    def get_code(self, fullname):
        return self.source_to_code(self.get_data(self.path), self.path)


def _loaded(path, what="design file"):
    """A user's module, by path."""
    spec = importlib.util.spec_from_file_location(path.stem, path, loader=_AsItStands(path.stem, str(path)))
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except CamError:
        raise
    except Exception as error:      # anything that a user's file may raise while it is imported
        raise InputError(f"{what} {path} cannot be loaded: {type(error).__name__}: {error}") from error
    return module


def _from_module(module, path):
    make = getattr(module, "design", None)
    if not callable(make):
        raise InputError(f"{path} has no function `design(parameters) -> Design`")
    hints = inspect.get_annotations(make, eval_str=True)
    models = [h for n, h in hints.items() if n != "return" and inspect.isclass(h) and issubclass(h, Parameters)]
    if len(models) != 1:
        raise InputError(f"{path}: annotate the argument of `design` with its parameter model "
                         "(a subclass of cuspline.design.Parameters)")
    return DesignSource(name=path.stem, path=path, parameters=models[0], make=make)


class JobFile(Model):
    """A job file: a STEP part and what must be known to cut it."""

    step: str = Field(description="STEP file, relative to the job file")
    solid: int | None = Field(default=None, ge=1, description="which solid of the file, from 1; left out: the only one")
    description: str = ""
    material: str
    stock: Stock = StockAllowance()
    finish: Finish
    faces: tuple[FacePredicate, ...] = Field(min_length=1)
    setups: tuple[Setup, ...] = Field(min_length=1)
    threads: dict[str, Thread] = Field(default={}, description="of holes, by the names of their faces")
    dimensions: tuple[Dimension, ...] = Field(default=(), description="sizes and positions with their limits")


class _NoParameters(Parameters):
    """A job has no parameters: the STEP file is what it is."""


def _from_job(path):
    job = checked(JobFile, toml_of(path, "job file"), f"job file {path}")

    def make(parameters):
        from cuspline.kernel import brep
        step = path.parent / job.step
        _refuse_mesh(step)
        brep.refuse_unreadable(step)
        return Design(name=path.stem, description=job.description or f"STEP part {job.step}", parameters=parameters,
                      solid=brep.chosen_solid(brep.read_step(step), job.solid, job.step), predicates=job.faces,
                      material=job.material,
                      stock=job.stock, finish=job.finish, setups=job.setups, threads=job.threads,
                      dimensions=job.dimensions)

    return DesignSource(name=path.stem, path=path, parameters=_NoParameters, make=make)


def find_machine(name_or_file):
    """A Machine by name or by TOML file.

    Raises:
        InputError: there is none, or its file is wrong.
    """
    if name_or_file in machine_names():
        return machine_from_toml(MACHINES / f"{name_or_file}.toml")
    refuse_irregular(name_or_file, "machine file")
    if not Path(name_or_file).is_file():
        raise InputError(f"there is no machine {name_or_file!r} and no such file; "
                         f"machines: {', '.join(machine_names())}")
    return machine_from_toml(name_or_file)


def find_library(path):
    """The tool library of a file, or of that name among those that come with cuspline; None: the first of these."""
    name = DEFAULT_LIBRARY if path is None else str(path)
    if name not in library_names():
        return library_from_json(path)
    own = library_from_json(LIBRARIES / f"{name}.json")
    return find_library(SMALLER[name]).with_tools(own.tools) if name in SMALLER else own


def library_names():
    """Names of the tool libraries that come with cuspline."""
    return sorted(p.stem for p in LIBRARIES.glob("*.json"))


def find_shop(path, assignments):
    """(ShopFile, the assignments that are not the shop's): values `shop.name=value` go before the file's."""
    given, others = assigned_to(SHOP, assignments)
    return shop_file(path, given), others


def assigned_to(prefix, assignments):
    """([("name", "value"), ...] of assignments that begin with a prefix, those that do not)."""
    own = [_assignment(a) for a in assignments if a.startswith(prefix)]
    return [(name.removeprefix(prefix), value) for name, value in own], [a for a in assignments if not a.startswith(prefix)]


def find_post(name_or_file):
    """The post module of that name, or in that Python file: all of OF_A_POST, and TOOL_TABLE None where it names none.

    Raises:
        InputError: there is none, or it lacks something.
    """
    if name_or_file in post_names():
        return importlib.import_module(f"cuspline.posts.writers.{name_or_file}")
    path = Path(name_or_file)
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"there is no post {name_or_file!r} and no such .py file; posts: {', '.join(post_names())}")
    post = _loaded(path, "post file")
    post.TOOL_TABLE = getattr(post, "TOOL_TABLE", None)
    wanted = {**OF_A_POST, **(OF_A_TOOL_TABLE if post.TOOL_TABLE is not None else {})}
    _refuse_lacking(post, path, wanted)
    return post


def _refuse_lacking(module, path, wanted):
    """
    Raises:
        InputError: a module lacks something of {name: what it is}, or has something else by that name.
    """
    for name, (kind, what) in wanted.items():
        if not isinstance(getattr(module, name, None), kind):
            raise InputError(f"{path} has no {name}: {what}")


def with_post(machine, post):
    """The machine with another post, by name or file; None: as it is.

    Raises:
        InputError: see `find_post`.
    """
    if post is None:
        return machine
    find_post(post)
    return machine.model_copy(update={"control": machine.control.model_copy(update={"post": post})})


def held_to(machine, gouge_mm):
    """The machine with a path tolerance of no more than a gouge that is allowed, where its post states it in every program.

    It stays a step of the last decimal at least: no control can be told less.
    """
    control = machine.control
    held_mm = max(gouge_mm, control.resolution_mm)
    if control.path_tolerance_mm <= held_mm or not getattr(find_post(control.post), "STATES_TOLERANCE", False):
        return machine
    return machine.model_copy(update={"control": control.model_copy(update={"path_tolerance_mm": held_mm})})


def make_design(source, assignments):
    """The Design of a source; whatever its function raises becomes an error that names the design."""
    try:
        made = source.design(assignments)
    except CamError:
        raise
    except ValidationError as error:
        raise DesignError(f"design {source.name}: {complaints(error)}") from None
    except Exception as error:      # the CAD kernel raises what it likes
        raise DesignError(f"design {source.name} could not be built: {type(error).__name__}: {error}") from error
    if not isinstance(made, Design):
        raise DesignError(f"design {source.name}: its function `design` returned {type(made).__name__}, "
                          "it must return a cuspline.design.Design")
    folder = source.path.parent
    return replace(made, stock=made.stock.beside(folder), setups=tuple(fixtures_beside(s, folder) for s in made.setups))


def reader_of(machine):
    """The function that reads what a machine's post writes: (text, *, work_offsets, tool_lengths) -> PostedMoves.

    It is found by the reader that the post names; nothing else of the post is asked.
    Raises:
        InputError: the machine has rotary axes, and the reader does not take `chain`.
    """
    read = _reader_module(machine).read_program
    if not machine.rotaries:
        return read
    if "chain" not in inspect.signature(read).parameters:
        raise InputError(f"{machine.name} has the rotary axes {' and '.join(machine.rotaries)}, and the reader "
                         f"{read.__module__} knows none: choose another post, or give its read_program an argument `chain`")
    return partial(read, chain=machine.kinematics)


def radii_taken(read, tools):
    """{"tool_radii": {number: radius in its D register, mm}} for a reader that takes it; {} for others.

    Args:
        read: function of `reader_of`.   tools: {number: cutters.Tool}.
    """
    takes = "tool_radii" in inspect.signature(read).parameters
    return {"tool_radii": {n: t.cutter.radius_mm for n, t in tools.items()}} if takes else {}


def coolants_taken(read, machine):
    """{"coolants": {"M88": (bits on, bits off)}} of a machine's own M-codes, for a reader that takes it; {} for others.

    Args:
        read: function of `reader_of`.   machine: machines.Machine.
    """
    own = machine.control.coolant_codes
    return {"coolants": own} if own and "coolants" in inspect.signature(read).parameters else {}


def tool_table_of(machine):
    """(file name, function text -> [posted.PostedTool]) of the tool table that a machine's control loads; (None, None)."""
    name = find_post(machine.control.post).TOOL_TABLE
    if name is None:
        return None, None
    return name, partial(_reader_module(machine).read_tool_table, control=machine.control)


def sources_of_post(machine):
    """{file name: SHA-256} of a post and a reader that are files; nothing of those that come with cuspline."""
    post, reader = find_post(machine.control.post), _reader_module(machine)
    files = [Path(m.__file__) for m in (post, reader) if POSTS not in Path(m.__file__).parents]
    return {f.name: sha256_of(f) for f in files}


def _reader_module(machine):
    """The module that a machine's post names: one of posts/readers, or a Python file beside the post's own."""
    post = find_post(machine.control.post)
    if not post.READER.endswith(".py"):
        if not (READERS / f"{post.READER}.py").is_file():
            raise InputError(f"{post.__file__}: there is no reader {post.READER!r}; name one of posts/readers, or a .py file "
                             "beside the post")
        return importlib.import_module(f"cuspline.posts.readers.{post.READER}")
    path = Path(post.__file__).parent / post.READER
    reader = _loaded(path, "reader file")
    _refuse_lacking(reader, path, {**OF_A_READER, **(OF_A_READER_OF_TOOLS if post.TOOL_TABLE is not None else {})})
    return reader
