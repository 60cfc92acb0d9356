"""Machines as TOML files: axes and the order in which they carry each other, bodies, and what the control can take."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from cuspline.shop.kinematics import Chain
from cuspline.values.coolants import BITS
from cuspline.values.input_files import checked, toml_of
from cuspline.values.models import Coordinate, Model, Point, Sparse, one_of
from cuspline.values.units import MM

BED = "bed"                         # stands still, between what moves the part and what moves the tool
UPRIGHT = (0.0, 0.0, 1.0)
ALONG = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": UPRIGHT}
ROTARIES = "ABC"
PLANES = "G43.4", "TCPM"              # tip controls of posts that put indexed positions into a plane whose Z is the tool,
TABLE_PLANES = ("G234",)            # and where only tables turn
MOST_TURNS = 40
M_CODE = r"^M(?:0|[1-9]\d{0,2})$"
NO_COOLANT = ("M0", "M1", "M2", "M3", "M4", "M5", "M6", "M13", "M14", "M19", "M29", "M30", "M97", "M98", "M99")
CHANGE_RPM_PER_S = 1000.0           # of a spindle whose file does not say it: from 0 to 10,000 rpm in ten seconds, which is slow
PARALLEL = 1e-3                     # sine of the angle below which two directions count as one


class LinearAxis(Sparse):
    """One linear axis in machine coordinates: it counts as the tool moves, seen from the part."""

    LEFT_OUT = ("direction", "time_constant_s", "backlash_mm", "increment_mm")
    min_mm: Coordinate
    max_mm: Coordinate
    rapid_mm_per_min: float = Field(gt=0, description="largest axis speed")
    acceleration_mm_per_s2: float = Field(gt=0)
    direction: Point | None = Field(default=None, description="of the tool, seen from the part; left out: along its letter")
    time_constant_s: float | None = Field(default=None, gt=0, le=1, description="first-order lag of its drive, measured by "
                                          "`cuspline calibrate`; where X, Y and Z state it the posted path is checked")
    backlash_mm: float = Field(default=0.0, ge=0, le=1, description="of its screw")
    increment_mm: float = Field(default=0.0, ge=0, le=0.1, description="smallest step it can make; half of it counts as error")

    @model_validator(mode="after")
    def _travel_is_positive(self):
        if self.max_mm <= self.min_mm:
            raise ValueError(f"max_mm {self.max_mm} must exceed min_mm {self.min_mm}")
        return self


class RotaryAxis(Model):
    """One rotary axis: where it is and which way it turns while every axis stands at 0."""

    direction: Point = Field(description="what it carries, table or head, turns right-handed about this, machine coordinates")
    pivot_mm: Point = Field(description="a point of its axis, machine coordinates, where the spindle nose is 0 0 0")
    offset_mm: Point = Field(default=(0.0, 0.0, 0.0), description="measured: how far its axis is from pivot_mm")
    min_deg: float | None = Field(default=None, description="left out with max_deg: it turns without end")
    max_deg: float | None = None
    rapid_deg_per_min: float = Field(gt=0, description="largest axis speed")
    acceleration_deg_per_s2: float = Field(gt=0)

    @model_validator(mode="after")
    def _range_is_positive(self):
        if (self.min_deg is None) != (self.max_deg is None):
            raise ValueError("min_deg and max_deg go together; leave both out for an axis that turns without end")
        if self.min_deg is not None and self.max_deg <= self.min_deg:
            raise ValueError(f"max_deg {self.max_deg} must exceed min_deg {self.min_deg}")
        if self.min_deg is not None and self.max_deg - self.min_deg > 360 * MOST_TURNS:
            raise ValueError(f"a range of more than {MOST_TURNS} turns: leave out min_deg and max_deg")
        if not sum(v * v for v in self.direction) > 0:
            raise ValueError("its direction has no length")
        return self


class Box(Model):
    """A body between two corners, machine coordinates, every axis at 0."""

    TOLD_BY: ClassVar[str] = "low_mm"
    low_mm: Point
    high_mm: Point

    @model_validator(mode="after")
    def _has_size(self):
        if not all(a < b for a, b in zip(self.low_mm, self.high_mm)):
            raise ValueError("high_mm must exceed low_mm in X, Y and Z")
        return self


class Cylinder(Model):
    """A round body from the middle of its foot along its axis."""

    TOLD_BY: ClassVar[str] = "foot_mm"
    foot_mm: Point
    axis: Point = UPRIGHT
    height_mm: float = Field(gt=0)
    diameter_mm: float = Field(gt=0)


class StepBody(Model):
    """A body out of a STEP file, drawn in machine coordinates with every axis at 0."""

    TOLD_BY: ClassVar[str] = "step"
    step: str = Field(description="the file, seen from the machine's")


class Body(Model):
    """Something of the machine that moves with one of its axes: table, trunnion, fixture plate, head."""

    name: str
    link: str = Field(description="axis that it moves with, or \"bed\"")
    colour: Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")] = "#8a9099"
    shape: one_of(Box, Cylinder, StepBody)


class Spindle(Sparse):
    """What it turns, and what it stands; a limit that is left out is not checked."""

    LEFT_OUT = ("power_kw", "torque_n_m", "axial_n", "change_rpm_per_s")
    min_rpm: float = Field(gt=0)
    max_rpm: float = Field(gt=0)
    power_kw: float | None = Field(default=None, gt=0, description="at the tool, without end")
    torque_n_m: float | None = Field(default=None, gt=0, description="the same, at every speed")
    axial_n: float | None = Field(default=None, gt=0, description="force along its axis that its bearings stand")
    change_rpm_per_s: float | None = Field(default=None, gt=0, description="how fast it changes its speed in the cut; left out: "
                                           "taken to be 1000")

    @property
    def turns_faster_rpm_per_s(self):
        """How fast it changes its speed, as stated or taken to be."""
        return CHANGE_RPM_PER_S if self.change_rpm_per_s is None else self.change_rpm_per_s


class Feeding(Model):
    """How a program comes to a control that runs it while it is sent, through a memory of a few blocks."""

    request_on_blocks: int = Field(ge=1, description="fewer behind the running one: more are requested")
    request_off_blocks: int = Field(ge=1, description="more behind it: no more are taken")
    bytes_per_s: float = Field(gt=0, description="that the line carries: 960 at 9600 baud")
    refill_s: float = Field(default=0.0, ge=0, description="from a request to its first byte")

    @model_validator(mode="after")
    def _stops_above_where_it_begins(self):
        if self.request_off_blocks < self.request_on_blocks:
            raise ValueError(f"request_off_blocks {self.request_off_blocks} must not be below request_on_blocks "
                             f"{self.request_on_blocks}")
        return self


class CoolantCodes(Model):
    """M-codes of a machine for one coolant."""

    on: str = Field(pattern=M_CODE, description="such as M88")
    off: str = Field(default="M9", pattern=M_CODE, description="left out: M9")


class Control(Sparse):
    """What the controller accepts."""

    LEFT_OUT = ("sub_programs", "decimals_deg", "tip_control", "block_numbers", "optional_stops", "arc_planes", "canned_cycles",
                "blocks_per_s", "rigid_tapping", "feeding", "arc_centres", "swivel_record", "feed_parameters",
                "program_store_sub_blocks", "coolants")
    post: str = Field(description="name of the post in posts/writers, or its .py file, seen from the machine's")
    units: Literal["mm", "inch"] = "mm"
    decimals_mm: int = Field(default=4, ge=1, le=6)
    decimals_inch: int = Field(default=5, ge=1, le=7)
    decimals_feed: int = Field(default=1, ge=0, le=3)
    decimals_deg: int = Field(default=4, ge=2, le=7, description="of rotary words, which are degrees in either unit")
    tip_control: Literal["M428", "M68", "G43.4", "TRAORI", "G234", "TCPM"] | None = Field(
        default=None, description="tool-centre-point control, by which tilted operations go out as tip and rotary axes: M428 "
        "(and M429, LinuxCNC's remapped words), M68 (the output M68 E3 that they stand for), G43.4 (Fanuc), TRAORI (Siemens), "
        "G234 (Haas), TCPM (Heidenhain); "
        "left out: as joints")
    swivel_record: str | None = Field(
        default=None, pattern=r"^[A-Z][A-Z0-9_]{0,31}$", description="name of the swivel data record by which a Sinumerik's "
        "CYCLE800 takes indexed positions; left out: they go out as other leaning tools do")
    feed_parameters: bool = Field(default=False, description="feeds as R-parameters at the program's head, for the operator to "
                                  "change (Siemens)")
    line_length: int = Field(default=252, ge=40, description="longest block the control takes, characters")
    program_store_bytes: int = Field(gt=0, description="that the program memory holds; a longer program goes out as a numbered set")
    program_store_sub_blocks: int | None = Field(default=None, gt=0, description="that it holds of words (X1.0 Y1.0 is two), where "
                                                 "the control counts these too; left out: bytes alone")
    sub_programs: bool = Field(default=True, description="repeated passes as sub-programs and calls; false: move by move")
    canned_cycles: bool = Field(default=True, description="holes by G81 and its like, or own calls; false: move by move")
    rigid_tapping: bool = Field(default=True, description="it taps with the spindle tied to the feed; false: threads are milled")
    block_numbers: int = Field(default=0, ge=0, le=100, description="step of the N words before blocks; 0: none (Klartext always "
                               "counts its own)")
    arc_planes: tuple[Literal["XY", "ZX", "YZ"], ...] = Field(
        default=("XY", "ZX", "YZ"), description="in which the control runs arcs; others, all where it is empty, go out as lines")
    arc_centres: Literal["IJK", "R"] = Field(default="IJK", description="what an arc states beside its end: its centre, or its "
                                             "radius (arcs of more than 120 degrees in two blocks or more)")
    blocks_per_s: float | None = Field(default=None, gt=0, description="that the control runs; feeds of shorter blocks are lowered "
                                       "to it; left out: not checked")
    feeding: Feeding | None = Field(default=None, description="programs are sent while they run: checked for waits in the cut; "
                                    "left out: the control holds the whole program")
    optional_stops: bool = Field(default=False, description="M1 at the top of the machine before every tool but the first")
    path_tolerance_mm: float = Field(gt=0, description="how far the control may leave the path: half of it "
                                     "goes out as LinuxCNC's G64 P, whose blends take up to twice that; what goes out as Haas's "
                                     "G187 E, Siemens's CTOL, Heidenhain's cycle 32; what is set in a "
                                     "Fanuc control for G64 (corners, smoothing), in Grbl as $12")
    arc_max_radius_mm: float = Field(default=1e4, gt=0, description="flatter arcs go out as lines")
    arc_min_length_mm: float = Field(default=1e-3, gt=0, description="shorter arcs go out as lines")

    coolants: dict[Literal["air", "mist", "flood", "high_pressure"], CoolantCodes] = Field(
        default={}, description="the machine's own M-codes of each coolant; left out: M7 is mist, M8 flood, and there is no other")

    @property
    def changes_speed_at_tip(self):
        """Whether the speed of the spindle changes under its tip control; Klartext's TOOL CALL S ends FUNCTION TCPM."""
        return self.tip_control != "TCPM"

    @model_validator(mode="after")
    def _coolant_codes_say_one_thing(self):
        on = [codes.on for codes in self.coolants.values()]
        twice = [name for name in on if on.count(name) > 1 or any(name == codes.off for codes in self.coolants.values())]
        if twice:
            raise ValueError(f"coolants: {twice[0]} says two things: give every coolant an M-code of its own")
        taken = [word for codes in self.coolants.values() for word in (codes.on, codes.off) if word in NO_COOLANT]
        if taken:
            raise ValueError(f"coolants: {taken[0]} is a word for something else on every control: write the machine's own M-code")
        return self

    @property
    def coolant_codes(self):
        """{M-code: (values.coolants.BITS that it turns on, and off)} of the machine's own; {}: the control's usual ones."""
        own = self.coolants.items()
        ends = {codes.off: sum(BITS[other] for other, its in own if its.off == codes.off) for _, codes in own}
        apart = sum(BITS[name] for name, codes in own if codes.off != "M9")
        off = {word: (0, bits) for word, bits in ends.items() if word != "M9"}
        return {"M9": (0, sum(BITS.values()) - apart), **off, **{codes.on: (BITS[name], 0) for name, codes in own}} if own else {}

    @model_validator(mode="after")
    def _what_is_fed_has_no_sub_programs(self):
        if self.feeding is not None and self.sub_programs:
            raise ValueError("a program that is sent while it runs cannot call sub-programs: write sub_programs = false beside "
                             "feeding")
        return self

    @property
    def decimals(self):
        """Of a length, in the control's units."""
        return self.decimals_mm if self.units == "mm" else self.decimals_inch

    @property
    def resolution_mm(self):
        """One step of the last decimal of a length, mm."""
        return MM[self.units] / 10 ** self.decimals


class Machine(Sparse):
    """A mill with X, Y, Z and up to two rotary axes in any order; the spindle along Z while the rotaries stand at 0.

    Z is the spindle's direction on a horizontal machine too; `upward` says which way up is.
    """

    LEFT_OUT = ("supports_z_mm", "a", "b", "c", "chain", "spindle_direction", "upward", "bodies")
    name: str
    description: str
    x: LinearAxis
    y: LinearAxis
    z: LinearAxis
    spindle: Spindle
    time_constant_s: float = Field(gt=0, description="first-order lag of the axis drives")
    max_feed_mm_per_min: float = Field(gt=0)
    tool_change_s: float = Field(ge=0)
    table_z_mm: Coordinate = Field(description="table top, machine coordinates")
    wcs_origin_mm: Point = Field(
        description="where G54 is expected, machine coordinates of the spindle nose")
    supports_z_mm: Coordinate | None = Field(
        default=None, description="what the stock stands on, parallels or a wasteboard, machine coordinates: where the stock "
        "reaches below a setup's zero, the zero is expected so much higher; left out: where wcs_origin_mm says, whatever the part")
    tool_change_z_mm: float | None = Field(
        default=None, description="lowest spindle nose at which a tool is changed, machine coordinates; left out: where "
        "G53 Z0 and G28 lead, or the top of the travel where that is lower")
    stop_clearance_mm: float = Field(
        default=25.0, ge=0, description="tip above stock and fixtures where the program stops or ends below the tool change")
    rapid_clearance_mm: float = Field(
        default=0.5, ge=0, description="least height of a rapid above the stock; straight up it may leave the cut")
    spindle_head: tuple[tuple[float, float], ...] = Field(
        default=(), description="(height_mm, diameter_mm) of cylinders above the holder's top, from below, that must not touch")
    control: Control
    a: RotaryAxis | None = None
    b: RotaryAxis | None = None
    c: RotaryAxis | None = None
    chain: tuple[str, ...] = Field(
        default=("X", "Y", BED, "Z"),
        description="axes from the part to the tool; what stands before \"bed\" moves the part, what stands behind it the tool")
    spindle_direction: Point = Field(default=UPRIGHT, description="from the tip to the holder, every axis at 0")
    upward: Literal["X", "Y", "Z"] = Field(default="Z", description="the axis along which up is: Y on a horizontal machine")
    bodies: tuple[Body, ...] = Field(default=(), description="what is drawn and may not be run into")

    @model_validator(mode="after")
    def _chain_holds_every_axis(self):
        wanted = sorted(["X", "Y", "Z", BED, *(letter for letter in ROTARIES if getattr(self, letter.lower()))])
        if sorted(self.chain) != wanted:
            raise ValueError(f"chain must hold each of {', '.join(wanted)} once, from the part to the tool; it holds "
                             f"{', '.join(self.chain) or 'nothing'}")
        if self.rotaries and self.supports_z_mm is not None:
            raise ValueError("supports_z_mm is for machines without rotary axes: on one that turns the part, say where the zero "
                             "is by wcs_origin_mm alone")
        if len(self.rotaries) > 2:
            raise ValueError("three rotary axes: a machine has at most two that move together")
        unknown = [f"{body.name} moves with {body.link}" for body in self.bodies if body.link not in self.chain]
        if unknown:
            raise ValueError(f"body {unknown[0]}, which is not in the chain {', '.join(self.chain)}")
        return self

    @model_validator(mode="after")
    def _axes_span_what_they_should(self):
        directions = {letter: np.array(self.direction_of(letter)) for letter in (*"XYZ", *self.rotaries)}
        for letter, d in directions.items():
            if not (d * d).sum() > 0:
                raise ValueError(f"{letter.lower()}.direction has no length")
            directions[letter] = d / np.sqrt((d * d).sum())
        if abs((np.cross(directions["X"], directions["Y"]) * directions["Z"]).sum()) < PARALLEL:
            raise ValueError("X, Y and Z move in one plane: correct a direction")
        spindle = np.array(self.spindle_direction)
        if not (spindle * spindle).sum() > 0:
            raise ValueError("spindle_direction has no length")
        if not self.rotaries and self.spindle_direction != UPRIGHT:
            raise ValueError("without rotary axes the spindle points along Z: leave spindle_direction out")
        if len(self.rotaries) == 2:
            first, second = self.rotaries
            if _sine(directions[first], directions[second]) < PARALLEL:
                raise ValueError(f"{first} and {second} turn about parallel axes and lean the tool in one plane only: correct a "
                                 "direction")
            if _sine(directions[second], spindle) < PARALLEL:
                raise ValueError(f"{second} turns about the tool's own axis and never leans it: correct its direction, or the "
                                 "order of the chain")
        return self

    @model_validator(mode="after")
    def _head_has_size(self):
        if any(not size > 0 for segment in self.spindle_head for size in segment):
            raise ValueError("every segment of spindle_head has a height and a diameter above 0")
        return self

    @property
    def axes(self):
        return (self.x, self.y, self.z)

    def zero_mm(self, height_mm=None):
        """(3,) where a setup's zero is expected, machine coordinates; `height_mm`: of it over what the stock lies on."""
        x, y, z = self.wcs_origin_mm
        return (x, y, z) if self.supports_z_mm is None or height_mm is None else (x, y, max(z, self.supports_z_mm + height_mm))

    @property
    def rotaries(self):
        """Letters of the rotary axes from the part to the tool."""
        return tuple(letter for letter in self.chain if letter in ROTARIES)

    @property
    def is_along_z_turned(self):
        """Whether in indexed positions the tool is along a Z of the control's, of a plane or of the joints' words.

        There it taps, and the control runs beside contours (G41).
        """
        control = self.control
        if control.tip_control in PLANES or control.swivel_record is not None:
            return True
        turned = self.chain[:self.chain.index(BED)]
        return control.tip_control in (None, *TABLE_PLANES) and all(letter in turned for letter in self.rotaries)

    def direction_of(self, letter):
        """Of an axis, as its file says it, or along its letter."""
        return getattr(self, letter.lower()).direction or ALONG[letter]

    @property
    def kinematics(self):
        """kinematics.Chain: joints to the tool in the part and back."""
        letters = (*"XYZ", *self.rotaries)
        turning = [getattr(self, letter.lower()) for letter in self.rotaries]
        direction = np.array([self.direction_of(letter) for letter in letters], float)
        spindle = np.array(self.spindle_direction, float)
        carried = [letter for letter in self.chain if letter != BED]
        column = lambda of_linear, of_rotary: np.array([*map(of_linear, self.axes), *map(of_rotary, turning)], float)
        radians = lambda degrees, beyond: beyond if degrees is None else np.radians(degrees)
        return Chain(
            letters=letters, order=[letters.index(letter) for letter in carried], bed=self.chain.index(BED),
            direction=direction / np.sqrt((direction ** 2).sum(axis=1))[:, None],
            pivot_mm=np.vstack([np.zeros((3, 3)), *(np.add(r.pivot_mm, r.offset_mm) for r in turning)]),
            spindle=spindle / np.sqrt((spindle ** 2).sum()),
            low=column(lambda a: a.min_mm, lambda r: radians(r.min_deg, -np.inf)),
            high=column(lambda a: a.max_mm, lambda r: radians(r.max_deg, np.inf)),
            speed=column(lambda a: a.rapid_mm_per_min / 60, lambda r: np.radians(r.rapid_deg_per_min) / 60),
            acceleration=column(lambda a: a.acceleration_mm_per_s2, lambda r: np.radians(r.acceleration_deg_per_s2)))

    @property
    def tool_change_height_mm(self):
        """Lowest spindle nose at a tool change, machine coordinates."""
        if self.tool_change_z_mm is not None:
            return self.tool_change_z_mm
        return min(self.z.max_mm, max(self.z.min_mm, 0.0))


def machine_from_toml(path):
    """Read a machine file.

    Raises:
        InputError: missing, broken TOML, or values out of range; names every key that is wrong.
    """
    machine = checked(Machine, toml_of(path, "machine file"), f"machine file {path}")
    beside, changed = Path(path).parent, {}
    if machine.control.post.endswith(".py"):
        changed["control"] = machine.control.model_copy(update={"post": str(beside / machine.control.post)})
    if any(isinstance(body.shape, StepBody) for body in machine.bodies):
        changed["bodies"] = tuple(_with_file(body, beside) for body in machine.bodies)
    return machine.model_copy(update=changed) if changed else machine


def _with_file(body, folder):
    """A body whose STEP file is seen from where we are."""
    if not isinstance(body.shape, StepBody):
        return body
    return body.model_copy(update={"shape": StepBody(step=str(folder / body.shape.step))})


def _sine(u, v):
    """Of the angle between two directions."""
    across = np.cross(u, v)
    return np.sqrt((across ** 2).sum() / ((u ** 2).sum() * (v ** 2).sum()))
