"""Operations: what a setup is cut by, one after the other, each a frozen value that plans itself.

A strategy is a subclass with a `kind`, in one file of `planning/strategies`; it is registered as it is imported.  Where
a value is silent the design's speaks, then the shop's, then the material's.
"""

import re
from importlib import import_module
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, SerializeAsAny, field_validator, model_serializer

from cuspline.values.coolants import Coolant
from cuspline.values.models import Model, Names, Point, by_kind

TYPES = {"ball": "ball", "flat": "flat", "bull": "bull_nose", "bull nose": "bull_nose", "bull_nose": "bull_nose",
         "tapered ball": "tapered_ball", "tapered_ball": "tapered_ball", "drill": "drill", "spot drill": "spot_drill",
         "spot_drill": "spot_drill", "chamfer mill": "chamfer_mill", "chamfer_mill": "chamfer_mill", "tap": "tap",
         "thread mill": "thread_mill", "thread_mill": "thread_mill", "reamer": "reamer",
         "face mill": "face_mill", "face_mill": "face_mill", "side": "side", "dovetail": "dovetail"}
WISH = re.compile(r"(?P<type>[a-z_ ]+?)\s*(?:(?P<rule><=|>=|<|>)?\s*(?P<diameter>\d+(?:\.\d+)?))?"
                  r"(?:\s+r\s*(?P<corner>\d+(?:\.\d+)?))?")
SAME_MM = 1e-6              # measures that are the same
_REGISTERED = {}            # kind -> class, of what is imported


def registered():
    """{kind: class} of all strategies: they stand floors above, and are looked up as somebody wants them."""
    import_module("cuspline.planning.every_strategy")
    return _REGISTERED


def understood(*fields):
    """Validator of fields that name a tool."""
    def check(wish):
        if isinstance(wish, str):
            ToolWish.of(wish)
        return wish
    return field_validator(*fields)(check)


class Operation(Model):
    """What every operation says."""

    kind: ClassVar[str] = ""
    picture: ClassVar[str] = ""         # for `cuspline strategies`
    is_mended: ClassVar[bool] = True    # what a check finds too high after it gets clean-up passes
    why_not_mended: ClassVar[str] = "clean-up passes do not go with it"     # where it gets none

    name: str | None = Field(default=None, min_length=1, max_length=40, pattern=r"^[A-Za-z0-9 ._+-]+$",
                             description="what program, report and findings call it; left out: its kind")
    faces: Names | None = Field(default=None, description="names of the faces it cuts; left out: the setup's")
    tool: int | str | None = Field(
        default=None, description='a tool by number (5), by type and size ("flat 16", "bull 12 r2") or by a rule ("ball <= 10"); '
        "left out: chosen by the faces' curvature")
    spindle_rpm: float | None = Field(default=None, gt=0, description="left out: from the material's cutting speed")
    feed_mm_per_min: float | None = Field(default=None, gt=0, description="left out: from the material's feed a tooth")
    feed_per_tooth_mm: float | None = Field(default=None, gt=0, le=10, description="left out: the material's share of the "
                                            "diameter; feed_mm_per_min goes before it")
    preset: str | None = Field(default=None, min_length=1, max_length=200, description="name of a tool's preset of speeds and "
                               "feeds; left out: the one for the job's material, if there is one")
    cutting_speed_m_per_min: float | None = Field(default=None, gt=0, le=2000, description="left out: the material's; on the full "
                                                  "diameter, with constant_speed where the edge cuts; spindle_rpm goes before it")
    constant_speed: bool | None = Field(default=None, description="S words keep the cutting speed where the edge cuts; left out: "
                                        "the shop's")
    feed_by_engagement: bool | None = Field(default=None, description="feeds keep the thickness of chips on the stock as it "
                                            "stands; left out: the shop's")
    coolant: Coolant | None = Field(default=None, description="left out: the preset's, else the material's; air and high_pressure "
                                    "by the M-codes of the machine's file")
    clearance_mm: float | None = Field(default=None, gt=0, le=500, description="rapids of the setup run at least so far above "
                                       "stock and fixtures; left out: the shop's")
    tool_axis: Point | None = Field(default=None, description="unit vector towards the spindle, part coordinates; left out: the "
                                    "setup's Z")

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs):
        super().__pydantic_init_subclass__(**kwargs)
        if "kind" in cls.__dict__:
            _REGISTERED[cls.kind] = cls

    _tool_is_understood = understood("tool")

    @model_serializer(mode="wrap")
    def _with_its_kind(self, dump):
        return {"kind": self.kind, **{key: value for key, value in dump(self).items() if value is not None}}

    @property
    def may_be_idle(self):
        """Whether it is no fault that nothing is left for it to cut."""
        return False

    @property
    def title(self):
        """What program and report call it."""
        return self.name or self.kind.replace("_", " ")

    @property
    def wish(self):
        """ToolWish, or None."""
        return None if self.tool is None else ToolWish.of(self.tool)

    def plan(self, work):
        """The operation as it is cut.

        Args:
            work: planning.context.PlanningContext of this operation, with the stock that really stands.
        Returns:
            (list of PlannedOperation, (n,) bool: which of `work.samples` are reached).
        Raises:
            PlanError, CutterDoesNotFit, ToolpathError: what cannot be done, where, and how to mend it.
        """
        raise NotImplementedError


class Clearing(Operation):
    """What operations say that take the stock away in levels."""

    allowance_mm: float | None = Field(default=None, ge=0, le=20, description="material to leave; left out: the shop's")
    stepdown_mm: float | None = Field(default=None, gt=0, le=100, description="left out: the material's share of the diameter")
    stepover_mm: float | None = Field(default=None, gt=0, le=200, description="largest radial depth of cut; left out: the shop's")
    ramp_deg: float | None = Field(default=None, gt=0, lt=45, description="of the way down into stock; left out: the shop's")


class Finishing(Operation):
    """What operations say that cut faces to their finish."""

    scallop_mm: float | None = Field(default=None, gt=0, le=5, description="largest cusp; left out: the design's, never more")
    profile_tolerance_mm: float | None = Field(default=None, gt=0, le=5, description="left out: the design's, never more")
    gouge_mm: float | None = Field(default=None, gt=0, le=5, description="left out: the design's, never more")
    allowance_mm: float = Field(default=0.0, ge=0, le=20, description="material to leave for a later operation")
    stepover_mm: float | None = Field(default=None, gt=0, le=100, description="largest; left out: what the cusp allows")
    passes: Literal["zig-zag", "one-way"] = Field(default="zig-zag", description="to and fro, or all one way")
    lead_radius_mm: float | None = Field(default=None, ge=0, le=50, description="of the arcs in and out; left out: the shop's")
    steep_deg: float = Field(default=90.0, ge=20, le=90, description="walls steeper than this get waterline passes; 90: none do")

    @property
    def waterline_deg(self):
        """Steeper faces get waterline passes; 90: none do."""
        return self.steep_deg

    @property
    def steepest_deg(self):
        """Steeper faces are left to others."""
        return 90.0


class ToolWish(Model):
    """Which tools of a library an operation may take."""

    number: int | None = None
    type: str | None = None
    rule: Literal["", "<=", ">=", "<", ">"] = ""
    diameter_mm: float | None = None
    corner_radius_mm: float | None = None

    @classmethod
    def of(cls, wish):
        """From a number or a text.

        Raises:
            ValueError: it is not understood.

        >>> ToolWish.of("ball <= 10").diameter_mm, ToolWish.of("bull 12 r2").corner_radius_mm
        (10.0, 2.0)
        """
        if isinstance(wish, int):
            return cls(number=wish)
        text = " ".join(wish.lower().split())
        if number := re.fullmatch(r"t?(\d{1,5})", text):
            return cls(number=int(number[1]))
        found = WISH.fullmatch(text)
        if not found or found["type"].strip() not in TYPES:
            raise ValueError(f"tool {wish!r} is not understood: give a number (5), a type and diameter (flat 16, bull 12 r2) "
                             f"or a rule (ball <= 10); types: {', '.join(sorted(name for name in TYPES if '_' not in name))}")
        return cls(type=TYPES[found["type"].strip()], rule=found["rule"] or "",
                   diameter_mm=float(found["diameter"]) if found["diameter"] else None,
                   corner_radius_mm=float(found["corner"]) if found["corner"] else None)

    def allows(self, tool):
        """Whether a shop.cutters.Tool is one of them."""
        if self.number is not None:
            return tool.number == self.number
        d, c = tool.cutter.diameter_mm, tool.cutter
        size = self.diameter_mm is None or {
            "": abs(d - self.diameter_mm) < SAME_MM, "<=": d < self.diameter_mm + SAME_MM,
            ">=": d > self.diameter_mm - SAME_MM, "<": d < self.diameter_mm - SAME_MM,
            ">": d > self.diameter_mm + SAME_MM}[self.rule]
        corner = self.corner_radius_mm is None or abs(c.corner_radius_mm - self.corner_radius_mm) < SAME_MM
        return c.type == self.type and size and corner

    @property
    def in_words(self):
        """For messages.

        >>> ToolWish.of("ball <= 10").in_words, ToolWish.of(5).in_words
        ('ball <= 10', 'T5')
        """
        if self.number is not None:
            return f"T{self.number}"
        corner = "" if self.corner_radius_mm is None else f" r{self.corner_radius_mm:g}"
        size = "" if self.diameter_mm is None else f" {self.rule} {self.diameter_mm:g}".replace("  ", " ")
        return f"{self.type.replace('_', ' ')}{size}{corner}"


def operation_of(value):
    """An Operation out of a job file's table, by its `kind`; an Operation stays what it is.

    Raises:
        ValueError: there is no such kind, or something in it is wrong.
    """
    return by_kind(value, registered(), "operation")


AnyOperation = Annotated[SerializeAsAny[Operation], BeforeValidator(operation_of)]
