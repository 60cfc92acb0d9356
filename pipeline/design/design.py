"""A Design: the B-rep with what must be known to cut it. The truth is the B-rep."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Callable, Literal

import numpy as np
from pydantic import Field, ValidationError, model_serializer, model_validator

from cuspline.design import given
from cuspline.design.fixtures import Fixture
from cuspline.design.operations import AnyOperation
from cuspline.design.stock import Standing, StockAllowance
from cuspline.shop.cutters import Tool
from cuspline.shop.threads import Thread
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.frames import Frame
from cuspline.values.known import Known
from cuspline.values.models import SEVERAL, FileName, Model, Names, Point, complaints, name_fault, shortened

UNIT = 1e-9               # how exact unit vectors must be
COARSEST_MM = 5.0         # nobody finishes a part more coarsely
DEFAULT_MACHINE = "mill_3axis"
HEIGHT_DECIMALS = 6         # of a zero's height in mm: what is less is rounding of a turned frame


class Parameters(Model):
    """Base of every design's parameter model: frozen, ranges checked, units in the names."""


Direction = tuple[float, float, float]
Share = Annotated[float, Field(ge=0, le=1)]


class FacePredicate(Model):
    """Chooses faces of a B-rep by what they are, never by index.  All given conditions must hold.

    A face's normal is taken at the middle of its parameter range, out of the material.
    """

    name: str = Field(description="what the chosen faces are called")
    count: int | None = Field(default=None, ge=1, description="how many faces it must match, no more, no fewer")
    at_least: int | None = Field(default=None, ge=1, description="in place of count: no fewer than that")
    kinds: Annotated[tuple[Literal["plane", "cylinder", "cone", "sphere", "torus", "extrusion", "revolution", "bezier", "bspline",
                                   "offset", "other"], ...], SEVERAL] | None = None
    normal: tuple[float, float, float] | None = Field(default=None, description="direction that the normal is close to")
    normal_within_deg: float = Field(default=1.0, ge=0, le=180)
    center_min_mm: tuple[float, float, float] | None = Field(default=None,
                                                             description="corner of a box round the face's middle")
    center_max_mm: tuple[float, float, float] | None = None
    area_min_mm2: float | None = Field(default=None, ge=0)
    area_max_mm2: float | None = Field(default=None, gt=0)
    face_name: str | None = Field(default=None, min_length=1, description="name of the face in the STEP file")
    color: tuple[Share, Share, Share] | None = Field(default=None, description="sRGB of the face or its body, 0 to 1")
    color_within: float = Field(default=0.02, ge=0, le=1, description="how far each part of the colour may be off")

    @model_validator(mode="after")
    def _says_something(self):
        if not any(v is not None for v in (self.kinds, self.normal, self.center_min_mm, self.center_max_mm,
                                           self.area_min_mm2, self.area_max_mm2, self.face_name, self.color)):
            raise ValueError(f"predicate {self.name!r} has no condition: it would match every face")
        if (self.count is None) == (self.at_least is None):
            raise ValueError(f"predicate {self.name!r} says how many faces it is to match: state "
                             + ("count=N or at_least=1" if self.count is None else "one of count and at_least"))
        return self

    @model_serializer(mode="wrap")
    def _only_what_it_says(self, dump):
        row = dump(self)
        unsaid = [k for k in ("count", "at_least", "face_name", "color") if row[k] is None]
        return {k: v for k, v in row.items() if k not in unsaid and (k != "color_within" or row["color"] is not None)}

    def is_met_by(self, number):
        """Whether it may match so many faces."""
        return number == self.count if self.at_least is None else number >= self.at_least


class Finish(Model):
    """How well the part must be cut."""

    scallop_mm: float = Field(gt=0, le=COARSEST_MM, description="largest cusp left between passes")
    profile_tolerance_mm: float = Field(gt=0, le=COARSEST_MM,
                                        description="largest deviation of a path from the true curve")
    gouge_mm: float = Field(gt=0, le=COARSEST_MM, description="deepest cut below the surface that is accepted")
    plating_mm: float = Field(default=0.0, ge=0, le=1, description="plated on later: the metal is cut so much below the faces, and "
                              "judged there")

    @model_serializer(mode="wrap")
    def _without_plating_it_has_not(self, dump):
        return {k: v for k, v in dump(self).items() if (k, v) != ("plating_mm", 0.0)}


class Marker(Model):
    """A place on the part that can be touched in a clamping: a ball's centre, a dowel, a corner."""

    name: str = Field(min_length=1)
    at_mm: Point = Field(description="part coordinates")


class Refixturing(Model):
    """How the part lies by its measured markers, against the clamping as designed (`pipeline/design/setup_alignment.py`)."""

    turn_deg: tuple[float, float, float] = Field(description="of the WCS about X, then Y, then Z")
    shift_mm: tuple[float, float, float] = Field(description="of the WCS's zero, along its axes as designed")
    residual_mm: dict[str, float] = Field(description="each marker's distance from where the fit puts it")
    far_error_mm: float | None = Field(default=None, description="how well the place that is cut farthest from the markers "
                                       "is known, root mean square; None: no place was looked at")


class Setup(Model):
    """One setup: how the part is held, where the work coordinate system sits on it, and what cuts which faces."""

    name: FileName
    wcs: Literal["G54", "G55", "G56", "G57", "G58", "G59"] = "G54"
    wcs_in_words: str
    wcs_origin_mm: Point = (0.0, 0.0, 0.0)     # in part coordinates
    wcs_x: tuple[float, float, float] = Field(default=(1.0, 0.0, 0.0), description="direction of the WCS's X, part coordinates")
    wcs_z: tuple[float, float, float] = Field(default=(0.0, 0.0, 1.0), description="direction of its Z, towards the spindle")
    faces: Names = Field(description="names of the predicates whose faces are cut, and judged after the setup")
    operations: Annotated[tuple[AnyOperation, ...], SEVERAL] = Field(
        default=(), description="what cuts them, in this order; none: `Auto`, all chosen by curvature")
    planned_as: FileName | None = Field(default=None, description="name of an earlier setup from which the part looks the same, "
                                        "as a propeller's next blade does: its moves are cut here too; None: planned for itself")
    reach_x_mm: tuple[float, float] | None = Field(default=None, description="x of the part as it sits, along wcs_x: "
                                                   "between these roughing tools stay; None: they clear all")
    fixtures: Annotated[tuple[Fixture, ...], SEVERAL] = Field(default=(), description="what holds the part: jaws, clamps, posts")
    markers: Annotated[tuple[Marker, ...], SEVERAL] = Field(default=(), description="what is measured to find how the part sits")
    marker_limit_mm: float = Field(default=0.02, gt=0, description="how far a measured marker may be from the rigid part")
    marker_error_mm: float = Field(default=0.002, gt=0, description="of one measured coordinate of a marker, root mean square")
    far_limit_mm: float = Field(default=0.010, gt=0, description="how uncertain what is cut far from the markers may be")
    zero_height_mm: float | None = Field(default=None, ge=0, description="of the zero above what the stock stands on, where the "
                                         "machine says how high that is; left out: as far as the stock reaches below the zero")
    refixturing: Refixturing | None = Field(default=None, description="what measured markers came to; None: as designed")
    indexed: bool = Field(default=False, description="an indexed position (3+2): the rotary axes turn the part to it as "
                          "the setup before holds it, in the same program; zero, fixtures and markers are that setup's")
    clamped_x: Direction | None = Field(default=None, description="of an indexed position that begins a setup of its own: "
                                        "direction of the work coordinate system's X as the part is held, part coordinates; of "
                                        "others filled in")
    clamped_z: Direction | None = Field(default=None, description="the same of its Z")

    @model_serializer(mode="wrap")
    def _without_what_it_has_not(self, dump):
        unsaid = () if self.indexed else ("indexed", "clamped_x", "clamped_z")
        as_ever = [n for n in ("marker_error_mm", "far_limit_mm", "planned_as", "zero_height_mm")
                   if getattr(self, n) == type(self).model_fields[n].default]
        return {k: v for k, v in dump(self).items() if k not in (*unsaid, *as_ever)}

    @model_validator(mode="after")
    def _axes_make_a_frame(self):
        if (self.clamped_x is None) != (self.clamped_z is None):
            raise ValueError(f"setup {self.name!r}: state clamped_x and clamped_z, or neither")
        for name in ("wcs", "clamped"):
            x, z = getattr(self, f"{name}_x"), getattr(self, f"{name}_z")
            if x is not None and not _are_square(np.array(x), np.array(z)):
                raise ValueError(f"setup {self.name!r}: {name}_x {x} and {name}_z {z} must be unit vectors square to each other")
        return self

    @property
    def frame(self):
        """WCS seen from the part."""
        return Frame(rotation=self.turn.rotation, origin_mm=self.wcs_origin_mm)

    @property
    def turn(self):
        """The WCS's directions alone, its zero left where the part's is."""
        return Frame.of_axes(np.zeros(3), self.wcs_x, self.wcs_z)

    @property
    def clamped_frame(self):
        """WCS of the program, seen from the part: of an indexed position that of the setup that holds it."""
        if not self.indexed:
            return self.frame
        return Frame.of_axes(self.wcs_origin_mm, self.clamped_x, self.clamped_z)

    def is_held_as(self, before):
        """Whether it is an indexed position in the clamping of the setup before it."""
        own, others = (self.clamped_x, self.clamped_z), (before.clamped_x, before.clamped_z)
        held = others if before.indexed else (before.wcs_x, before.wcs_z)
        return self.indexed and own in (held, (None, None))

    def held_as(self, base):
        """An indexed position in the clamping of a setup before it.

        Raises:
            DesignError: it says what that setup says for it.
        """
        said = [name for name in ("fixtures", "markers", "wcs", "wcs_origin_mm", "refixturing")
                if getattr(self, name) not in (type(self).model_fields[name].default, getattr(base, name))]
        if said:
            raise DesignError(f"setup {self.name} is an indexed position held as {base.name} is, whose {said[0]} holds for it: "
                              f"leave {said[0]} out, or indexed")
        return self.model_copy(update={"wcs": base.wcs, "wcs_origin_mm": base.wcs_origin_mm, "fixtures": base.fixtures,
                                       "markers": base.markers, "refixturing": base.refixturing,
                                       "clamped_x": base.clamped_x if base.indexed else base.wcs_x,
                                       "clamped_z": base.clamped_z if base.indexed else base.wcs_z})


def as_thread(value, name):
    """A Thread as it is, or by its size.

    Raises:
        DesignError: it is neither.
    """
    if isinstance(value, Thread):
        return value
    try:
        return Thread(size=value)
    except ValidationError as error:
        raise DesignError(f"thread of {name}: {complaints(error)}") from None


def _are_square(x, z):
    """Whether vectors (3,) are units, square to each other."""
    return abs(fixed.matmul(x, x) - 1) < UNIT and abs(fixed.matmul(z, z) - 1) < UNIT and abs(fixed.matmul(x, z)) < UNIT


def clamped(setups):
    """Setups, indexed positions held as what begins their clamping.

    Raises:
        DesignError: the first does not say how the part is held; two positions after one another point the tool the same way.
    """
    held, base = [], None
    for setup in setups:
        goes_on = base is not None and setup.is_held_as(held[-1])
        if setup.indexed and not goes_on and None in (setup.clamped_x, setup.clamped_z):
            raise DesignError(f"setup {setup.name} is an indexed position, and no setup before it holds the part: leave "
                              "indexed out, or state clamped_x and clamped_z, how the part is held")
        if goes_on and held[-1].wcs_z == setup.wcs_z:
            raise DesignError(f"setup {setup.name} points the tool as {held[-1].name} does: let one of them have both's "
                              "operations")
        base = base if goes_on else setup
        held.append(setup.held_as(base) if goes_on else setup)
    return tuple(held)


def by_clamping(items, goes_on=lambda before, item: item.setup.is_held_as(before.setup)):
    """[[item]]: that of what holds the part first, then of the indexed positions in its clamping.

    Args:
        items: values with a `setup`, or others.
        goes_on: function of one and that before it, whether it is an indexed position in the same clamping.
    """
    held = []
    for item in items:
        if held and goes_on(held[-1][-1], item):
            held[-1].append(item)
        else:
            held.append([item])
    return held


def with_zero_heights(design):
    """The Design, each Setup's `zero_height_mm` filled in: mm from the stock's lowest place up to the zero, where above 0."""
    return replace(design, setups=tuple(_with_zero_height(s, design.stock.shape) for s in design.setups))


def _with_zero_height(setup, shape):
    if setup.indexed or setup.zero_height_mm is not None:
        return setup
    height = round(-float(shape.box_in(setup.frame)[0][2]), HEIGHT_DECIMALS)
    return setup.model_copy(update={"zero_height_mm": height}) if height > 0 else setup


@dataclass(frozen=True, kw_only=True)
class Companion:
    """A shape that is written beside the part and is not cut: an assembly it belongs to."""

    name: str                   # its file is <design>.<name>.step
    make: Callable              # function () -> TopoDS shape, millimetres; called when the file is written


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One figure measured on a solid beside what it should be."""

    what: str
    measured: float
    wanted: float
    allowed: float              # largest difference
    unit: str = ""

    @property
    def is_kept(self):
        """Whether it is near enough; what is no number is not."""
        return bool(abs(self.measured - self.wanted) <= self.allowed)


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidReport:
    """What was measured on a solid as it stands in its STEP file."""

    figures: tuple[Figure, ...]
    facts: dict                 # what is only told: mass, centre, ...; as it goes into solid.json


@dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """A part ready to be planned; or, without setups, one whose solid alone is checked."""

    name: str
    description: str
    parameters: Parameters
    solid: object                           # OCP TopoDS_Solid, millimetres
    # a dict on the way in: {name: FacePredicate, or faces selected in CadQuery or build123d}
    predicates: tuple[FacePredicate, ...] | dict[str, Any]
    material: str                           # a name in planning/materials
    finish: Finish
    setups: tuple[Setup, ...]
    threads: dict = field(default_factory=dict)     # {name of faces: shop.threads.Thread, or its size}: holes that get one
    dimensions: tuple = ()                  # values of design.dimensions: sizes and positions with their limits
    stock: object = StockAllowance()        # a value of design.stock; left out: the box round the part and an allowance
    tools: tuple[Tool, ...] = ()            # as this part wants them held: beside the library's, or in place of its own
    guides: tuple = ()                      # values that strategies ask for by their type, see `guide_of`
    machine: str = DEFAULT_MACHINE          # what it is made for where no other is asked for: a name in posts/
    companions: tuple[Companion, ...] = ()
    measure: Callable | None = None         # function (solid read back from its STEP file) -> SolidReport
    draw: Callable | None = None            # function (folder): writes drawings
    where: Callable = lambda place_mm: ""   # (3,) part coordinates -> a name for people: the cell of a vane

    def __post_init__(self):
        for name, value in self._settled():
            object.__setattr__(self, name, value)
        self._refuse_names()
        if isinstance(self.predicates, dict):
            from cuspline.design.face_selection import predicates_of  # the CAD kernel: not for who lists designs
            object.__setattr__(self, "predicates", predicates_of(self.solid, self.predicates))
        if not self.setups and self.measure is None:
            raise DesignError(f"design {self.name} has no setup and nothing to measure its solid by: "
                              "give it one of them")
        kinds = [type(g) for g in self.guides]
        if twice := [k.__name__ for k in kinds if kinds.count(k) > 1]:
            raise DesignError(f"design {self.name}: two guides are of type {twice[0]}; a strategy takes up one: leave one out")
        object.__setattr__(self, "setups", clamped(self.setups))
        known = {p.name for p in self.predicates}
        for setup in self.setups:
            for who, faces in ((setup.name, setup.faces), *((f"{setup.name}, {o.title}", o.faces or ()) for o in setup.operations)):
                if missing := [f for f in faces if f not in known]:
                    raise DesignError(f"design {self.name}, {who}: faces {missing} are named by no predicate; "
                                      f"there are {sorted(known)}")
        self._refuse_copies()
        object.__setattr__(self, "threads", {name: as_thread(t, name) for name, t in self.threads.items()})
        if missing := sorted(set(self.threads) - known):
            raise DesignError(f"design {self.name}: threads of {missing[0]!r}, a name of no predicate; there are {sorted(known)}")
        for dimension in self.dimensions:
            named = {dimension.faces, getattr(dimension, "from_faces", dimension.faces)}
            if missing := sorted(named - known):
                raise DesignError(f"design {self.name}, {dimension.title}: {missing[0]!r} is a name of no predicate; there are "
                                  f"{sorted(known)}")

    def _settled(self):
        """(name, value) of what is handed over in other forms than it is kept in; see given.py."""
        what = f"design {self.name}, {{}}".format
        one = lambda name, value, kind, needs=None: (name, given.one(value, kind, what(name), needs))
        yield one("parameters", self.parameters, Parameters, "the value of its parameter model that the function is handed")
        yield one("material", self.material, str, "a name of `cuspline materials`")
        yield one("finish", self.finish, Finish)
        yield one("stock", StockAllowance() if self.stock is None else self.stock, Standing,
                  "a StockBox, StockCylinder, StockSolid, StockMesh, StockAllowance or StockSkin")
        yield one("threads", {} if self.threads is None else self.threads, dict, "a dict {name of faces: Thread}")
        kinds = {"setups": Setup, "tools": Tool, "companions": Companion, "dimensions": Model}
        if not isinstance(self.predicates, dict):
            kinds["predicates"] = FacePredicate
        for name, kind in kinds.items():
            yield name, given.several(getattr(self, name), kind, what(name))

    def _refuse_copies(self):
        """A setup cut as one that was not planned before, or by other operations."""
        planned = {}
        for setup in self.setups:
            if setup.planned_as is None:
                planned[setup.name] = setup
            elif setup.planned_as not in planned:
                raise DesignError(f"design {self.name}, {setup.name}: planned_as {setup.planned_as} names no setup before it that "
                                  f"is planned for itself; there are {sorted(planned) or 'none'}")
            elif setup.operations not in ((), planned[setup.planned_as].operations):
                raise DesignError(f"design {self.name}, {setup.name}: it is planned as {setup.planned_as}, and lists other "
                                  "operations: leave them out, or planned_as")

    @cached_property
    def _known(self):
        return Known()

    def once(self, name, make):
        """What all setups share of the part: `make`() when it is first asked for, part coordinates."""
        return self._known.once(name, make)

    def guide_of(self, kind):
        """The guide of a type, or None: what a strategy must know of the part beyond its faces, part coordinates.

        A guide has a `name` and `facts(where)`, what plan.json says of it; `where` names a place (3,) for people.
        """
        return next((g for g in self.guides if isinstance(g, kind)), None)

    def _refuse_names(self):
        """Names become files: of the design, its setups, its companions; no two the same."""
        for what, names in (("its name", [self.name]), ("setup", [s.name for s in self.setups]),
                            ("companion", [c.name for c in self.companions])):
            for k, name in enumerate(names):
                if fault := name_fault(name):
                    raise DesignError(f"design {shortened(self.name)}, {what}: {fault}")
                if name in names[:k]:
                    raise DesignError(f"design {self.name}: two are called {what} {name}; their files would be one: "
                                      "give each its own name")
