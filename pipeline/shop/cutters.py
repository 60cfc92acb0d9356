r"""Cutters, holders and the shop's library: validated, every length with its unit.

    z                    ┌──────┐
    │                    │holder│   holder segments, from the nose upward
    │                    └┐    ┌┘ ← stick_out_mm
    │                     │shank│   shank_diameter_mm
    │                     └┐  ┌┘  ← reach_mm
    │                      │neck│   neck_diameter_mm
    │                      ├──┤   ← flute_length_mm
    └─── 0                 \__/     tip; corner_radius_mm
"""

import math
from typing import Literal

import numpy as np
from pydantic import Field, PrivateAttr, model_serializer, model_validator

from cuspline.shop.cutter_profile import apt_profile, lens_profile, point_profile, side_profile, tangent_corner
from cuspline.shop.presets import Preset
from cuspline.shop.threads import MINOR_SHARE
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import InputError
from cuspline.values.input_files import checked, json_of
from cuspline.values.models import Model, complaints
from cuspline.values.units import in_mm

WIDTH_MM = 1e-9             # lengths that are the same


class HolderSegment(Model):
    """A cone frustum of a holder or of a cutter's shaft, stacked upward."""

    height_mm: float = Field(gt=0, description="length along the axis")
    lower_diameter_mm: float = Field(gt=0)
    upper_diameter_mm: float = Field(gt=0)


class Holder(Model):
    """A tool holder: revolved segments from its nose upward."""

    name: str
    segments: tuple[HolderSegment, ...] = Field(min_length=1)


# what says the shape of each type beside diameter, corner radius and flute length
SHAPE_FIELDS = {"ball": (), "bull_nose": (), "flat": (), "dovetail": ("taper_deg",), "tapered_ball": ("taper_deg",),
                "lens": ("tip_radius_mm",), "side": (),
                "apt": ("taper_deg", "tip_angle_deg", "corner_center_radius_mm", "corner_center_height_mm"),
                "drill": ("point_angle_deg",), "spot_drill": ("point_angle_deg",),
                "chamfer_mill": ("point_angle_deg", "tip_diameter_mm"),
                "tap": ("pitch_mm", "hand", "chamfer_threads"), "thread_mill": (), "reamer": (),
                "face_mill": ("insert_angle_deg",)}
ALL_SHAPE_FIELDS = tuple(dict.fromkeys(name for names in SHAPE_FIELDS.values() for name in names))
OPTIONAL = (*ALL_SHAPE_FIELDS, "shaft_segments", "max_rpm", "is_centre_cutting", "ramp_deg", "slot_depth_mm", "plunge_mm_per_tooth",
            "bending_n", "unpecked_mm")
FLAT_DEG = 179.0            # from here on a drill's bottom is flat
DRILLS = ("drill", "spot_drill")                    # types that cut along their axis alone
POINTED = (*DRILLS, "chamfer_mill")                 # types that end in a cone
THREADING = ("tap", "thread_mill")                   # types whose teeth leave a thread, simulated without them
WITHOUT_CORNER = (*POINTED, *THREADING, "reamer")
SLICE_MM = 0.5              # of a cone's radius: so much wider than it a cylinder may be that holds a slice
CENTRE_CUTTING = ("ball", "tapered_ball", "lens", *DRILLS)  # types whose teeth meet in the middle, where a library does not say
RAMP_DEG = 10.0             # of a cutter that does not cut at its centre: three times the ramp that is planned
SLOT_SHARE = 0.5            # of the diameter: docs/decisions/physical_state.md
PLUNGE_SHARE = 0.012        # of the diameter a tooth: half more than the largest feed of `planning.materials`
UNPECKED_SHARE = 4.0        # the same of a drill's way at the feed before it comes up: docs/decisions/holes.md
DRILL_SHARE = 0.02          # the same of drills: half more than their largest


class Cutter(Model):
    """An end mill of revolution about the tool axis; z = 0 at the tip.

    `diameter_mm` is the trade's: over the flutes; of a tapered ball the ball's; of a dovetail, a face mill and an
    APT shape across where the bottom and side lines cross. A face mill's flutes are as long as its inserts cut deep.
    """

    name: str
    type: Literal["ball", "bull_nose", "flat", "dovetail", "tapered_ball", "lens", "side", "apt", "drill", "spot_drill",
                  "chamfer_mill", "tap", "thread_mill", "reamer", "face_mill"]
    diameter_mm: float = Field(gt=0)
    corner_radius_mm: float = Field(ge=0, description="0 flat, diameter/2 ball")
    flutes: int = Field(ge=1, le=100)
    flute_length_mm: float = Field(gt=0)
    neck_diameter_mm: float = Field(gt=0)
    reach_mm: float = Field(gt=0, description="tip to where the neck ends and the shank begins")
    shank_diameter_mm: float = Field(gt=0)
    overall_length_mm: float = Field(gt=0)
    taper_deg: float | None = Field(default=None, gt=-90, lt=90, description="side to axis; dovetail: how far it leans in")
    tip_angle_deg: float | None = Field(default=None, ge=0, lt=90, description="rise of the bottom from the tip (APT alpha)")
    corner_center_radius_mm: float | None = Field(default=None, description="APT e")
    corner_center_height_mm: float | None = Field(default=None, description="APT f")
    tip_radius_mm: float | None = Field(default=None, gt=0, description="lens: the large radius of its bottom")
    point_angle_deg: float | None = Field(default=None, gt=10, le=180, description="of the cone at the tip, from side to side; "
                                          "180: a drill with a flat bottom, for counterbores")
    tip_diameter_mm: float | None = Field(default=None, ge=0, description="chamfer mill: of the flat below its cone; 0: a point")
    insert_angle_deg: float | None = Field(default=None, ge=10, le=90, description="of a face mill: from the face it leaves to "
                                           "the edge of its inserts; 90: upright walls")
    shaft_segments: tuple[HolderSegment, ...] | None = Field(
        default=None, min_length=1, description="a neck that is no cylinder: from the flutes' end to the reach")
    max_rpm: float | None = Field(default=None, gt=0, description="largest speed that its maker or its holder allows")
    is_centre_cutting: bool | None = Field(default=None, description="its teeth meet in the middle; left out: balls alone")
    ramp_deg: float | None = Field(
        default=None, gt=0, le=90, description=f"steepest way into stock; left out: {RAMP_DEG:g}, centre-cutting 90")
    slot_depth_mm: float | None = Field(
        default=None, gt=0, description=f"deepest slot of its full width; left out: {SLOT_SHARE:g} of the diameter")
    plunge_mm_per_tooth: float | None = Field(
        default=None, gt=0, description=f"of a centre-cutting cutter; left out: {PLUNGE_SHARE:g} of the diameter")
    bending_n: float | None = Field(default=None, gt=0, description="force across its axis that it stands; left out: not checked")
    unpecked_mm: float | None = Field(default=None, gt=0, description="of a drill: farthest way down at the feed before it comes "
                                      f"up; left out: {UNPECKED_SHARE:g} diameters")

    pitch_mm: float | None = Field(default=None, gt=0, le=20, description="of a tap: from thread to thread")
    hand: Literal["right", "left"] | None = Field(default=None, description="of a tap")
    chamfer_threads: float | None = Field(default=None, ge=0, le=20, description="of a tap: threads of its chamfer, that leave no "
                                          "full thread")

    @model_validator(mode="after")
    def _shape_is_consistent(self):
        self._says_its_shape()
        half = self.diameter_mm / 2
        wanted = {"ball": half, "tapered_ball": half, "flat": 0.0, **dict.fromkeys(WITHOUT_CORNER, 0.0)}.get(self.type)
        if wanted is not None and abs(self.corner_radius_mm - wanted) > 1e-9:
            raise ValueError(f"a {self.type} cutter of diameter {self.diameter_mm} mm has corner_radius_mm {wanted}")
        if self.type == "face_mill" and self.corner_radius_mm >= half:
            raise ValueError("a face_mill has corner_radius_mm < diameter/2")
        if self.type == "bull_nose" and not 0 < self.corner_radius_mm < half:
            raise ValueError("a bull_nose cutter has 0 < corner_radius_mm < diameter/2")
        corner = 0.0 if self.type in ("lens", "apt") else self.corner_radius_mm     # the profile checks theirs
        if not corner <= self.flute_length_mm <= self.reach_mm < self.overall_length_mm:
            raise ValueError("lengths must satisfy corner radius <= flute_length <= reach < overall_length")
        profile = self.profile
        widest = profile.top_radius_mm if profile.is_undercutting else profile.largest_radius_mm
        if self.shaft_segments is None and self.neck_diameter_mm > 2 * widest + 1e-9:
            is_plain = self.taper_deg is None and self.type != "face_mill"
            raise ValueError("neck_diameter_mm must not exceed diameter_mm" if is_plain else
                             f"neck_diameter_mm must not exceed the {2 * widest:.6g} mm of the flutes below it")
        self._shaft_joins()
        return self

    def _shaft_joins(self):
        if self.shaft_segments is None:
            return
        length = sum(s.height_mm for s in self.shaft_segments)
        if abs(self.flute_length_mm + length - self.reach_mm) > 1e-6:
            raise ValueError(f"shaft_segments are {length:.6g} mm high, from flute_length_mm to reach_mm it is "
                             f"{self.reach_mm - self.flute_length_mm:.6g} mm")
        if abs(self.shaft_segments[0].lower_diameter_mm - self.neck_diameter_mm) > 1e-6:
            raise ValueError("shaft_segments begin with neck_diameter_mm")

    def _says_its_shape(self):
        needed = SHAPE_FIELDS[self.type]
        for name in ALL_SHAPE_FIELDS:
            if (getattr(self, name) is None) == (name in needed):
                raise ValueError(f"a {self.type} cutter {'needs' if name in needed else 'has no'} {name}")
        if self.type in ("dovetail", "tapered_ball") and self.taper_deg <= 0:
            raise ValueError(f"a {self.type} cutter has taper_deg > 0")
        if self.type == "chamfer_mill" and self.tip_diameter_mm >= self.diameter_mm:
            raise ValueError("a chamfer_mill has tip_diameter_mm below diameter_mm")
        if self.type == "tap" and self.pitch_mm >= self.diameter_mm / 2:
            raise ValueError("a tap has pitch_mm below half of its diameter_mm")
        if self.type == "thread_mill" and self.neck_diameter_mm >= self.diameter_mm:
            raise ValueError("a thread_mill has neck_diameter_mm below diameter_mm: its tooth stands out beyond the neck")
        if self.type in POINTED and self.point_height_mm > self.flute_length_mm:
            raise ValueError(f"the cone of the point is {self.point_height_mm:.6g} mm high, flute_length_mm must be no less")

    @model_serializer(mode="wrap")
    def _without_what_it_has_not(self, dump):
        row = dump(self)
        return {k: v for k, v in row.items() if v is not None or k not in OPTIONAL}

    @property
    def radius_mm(self):
        return self.diameter_mm / 2

    @property
    def plunges(self):
        """Whether it cuts at its centre."""
        return self.type in CENTRE_CUTTING if self.is_centre_cutting is None else self.is_centre_cutting

    @property
    def steepest_rad(self):
        """Steepest way into stock."""
        usual = 90.0 if self.plunges else RAMP_DEG
        return float(np.radians(usual if self.ramp_deg is None else self.ramp_deg))

    @property
    def deepest_slot_mm(self):
        """Deepest slot of its full width; narrower cuts may be deeper in proportion."""
        return SLOT_SHARE * self.diameter_mm if self.slot_depth_mm is None else self.slot_depth_mm

    @property
    def longest_peck_mm(self):
        """Farthest way down at the feed before chips must be let out; inf of what is no drill."""
        if self.type != "drill":
            return float("inf")
        return UNPECKED_SHARE * self.diameter_mm if self.unpecked_mm is None else self.unpecked_mm

    @property
    def largest_plunge_mm(self):
        """Largest feed a tooth straight down."""
        share = DRILL_SHARE if self.type in DRILLS else PLUNGE_SHARE
        return share * self.diameter_mm if self.plunge_mm_per_tooth is None else self.plunge_mm_per_tooth

    @property
    def drills(self):
        """Whether it cuts along its axis alone."""
        return self.type in DRILLS

    @property
    def has_flat_bottom(self):
        """Whether it is a drill whose point is none: it leaves what a flat cutter leaves."""
        return self.type in DRILLS and self.point_angle_deg > FLAT_DEG

    @property
    def threads(self):
        """Whether its teeth leave a thread, which is judged by itself and simulated as the plain wall it had."""
        return self.type in THREADING

    @property
    def body(self):
        """What is simulated of it: itself; of a tap its core, of a thread mill its neck down to the tip, as a flat cutter; a
        reamer as a drill with a flat bottom; a face mill as a flat or bull nose cutter where its inserts stand upright, else as an
        APT shape whose side leans out.

        A tap's core is as wide as the minor diameter of its thread: it touches no wall of a hole within limits.
        """
        if self.type == "reamer":
            return self.model_copy(update={"type": "drill", "point_angle_deg": 180.0})
        if self.type == "face_mill":
            return self.model_copy(update={"insert_angle_deg": None, **self._as_face_mill_cuts()})
        if not self.threads:
            return self
        wide = self.diameter_mm - MINOR_SHARE * self.pitch_mm if self.type == "tap" else self.neck_diameter_mm
        return self.model_copy(update={
            "type": "flat", "diameter_mm": wide, "neck_diameter_mm": min(wide, self.neck_diameter_mm),
            **dict.fromkeys(SHAPE_FIELDS["tap"])})

    def _as_face_mill_cuts(self):
        """Type and shape of what is simulated of a face mill."""
        if self.insert_angle_deg == 90.0:
            return {"type": "bull_nose" if self.corner_radius_mm > 0 else "flat"}
        _, _, e, f, alpha, beta, _ = self.apt
        return {"type": "apt", "taper_deg": 90.0 - self.insert_angle_deg, "tip_angle_deg": alpha, "corner_center_radius_mm": e,
                "corner_center_height_mm": f}

    @property
    def chamfer_mm(self):
        """Height of a tap's chamfer above its tip; of a thread mill the middle of its tooth; 0 of others."""
        if self.type == "thread_mill":
            return self.flute_length_mm / 2
        return self.chamfer_threads * self.pitch_mm if self.type == "tap" else 0.0

    @property
    def point_height_mm(self):
        """Height of the cone at the tip; 0 of cutters without one."""
        if self.type not in POINTED:
            return 0.0
        return (self.radius_mm - self.point_flat_mm) / self.cone_slope

    @property
    def point_flat_mm(self):
        """Radius of the flat at the point of a pointed cutter; 0 where it is sharp."""
        return (self.tip_diameter_mm or 0.0) / 2

    @property
    def cone_slope(self):
        """By how much the cone of a pointed cutter is wider, in radius, a mm higher."""
        return float(fixed.tan(np.radians(self.point_angle_deg) / 2))

    def cone_radius_mm(self, high_mm):
        """Of the cone of a pointed cutter, so high above its tip; it goes on beyond the point's height."""
        return self.point_flat_mm + high_mm * self.cone_slope

    def groove_width_mm(self, depth_mm):
        """Width, in a level face, of the groove of a ball or a pointed cutter; None: its point is less high, or it has none."""
        if self.type == "ball":
            return 2 * math.sqrt(depth_mm * (2 * self.radius_mm - depth_mm)) if depth_mm <= self.radius_mm else None
        if self.type not in POINTED or depth_mm > self.point_height_mm:
            return None
        return 2 * self.cone_radius_mm(depth_mm)

    @property
    def apt(self):
        """APT's (d, r, e, f, alpha, beta, h), mm and radians; beta < 0 leans inward.

        Raises:
            InputError: a lens cutter, whose bottom is no straight line; a side cutter, whose two rims are round; a chamfer mill,
                which has three lines.
        """
        if self.type in ("lens", "side", "chamfer_mill", "reamer", *THREADING):
            raise InputError(f"{self.name}: a {self.type} cutter has no seven-parameter form")
        d, r = self.diameter_mm, self.corner_radius_mm
        alpha, beta = np.radians(self.tip_angle_deg or 0.0), np.radians(self.taper_deg or 0.0)
        if self.type == "apt":
            return d, r, self.corner_center_radius_mm, self.corner_center_height_mm, alpha, beta, self.flute_length_mm
        if self.type in DRILLS:
            return d, 0.0, d / 2, self.point_height_mm, np.pi / 2 - np.radians(self.point_angle_deg) / 2, 0.0, self.flute_length_mm
        if self.type == "tapered_ball":
            return 2 * r * (1 - fixed.sin(beta)) / fixed.cos(beta), r, 0.0, r, 0.0, beta, self.flute_length_mm
        beta = -beta if self.type == "dovetail" else beta
        beta = np.radians(90.0 - self.insert_angle_deg) if self.type == "face_mill" else beta
        return d, r, *tangent_corner(d, r, alpha, beta), alpha, beta, self.flute_length_mm

    @property
    def profile(self):
        """CutterProfile of the cutting part.

        Raises:
            ValueError: the measures do not go together.
        """
        if self.type == "side":
            return side_profile(self.diameter_mm, self.corner_radius_mm, self.flute_length_mm)
        if self.threads or self.type == "reamer":
            return self.body.profile
        if self.type in POINTED:
            return point_profile(self.diameter_mm, self.tip_diameter_mm or 0.0, self.point_height_mm, self.flute_length_mm)
        if self.type == "lens":
            return lens_profile(self.diameter_mm, self.tip_radius_mm, self.corner_radius_mm, self.flute_length_mm)
        return apt_profile(*self.apt)

    @property
    def largest_radius_mm(self):
        """Radius of the widest place of the flutes; a tapered ball is wider than its ball."""
        return self.profile.largest_radius_mm

    @property
    def is_undercutting(self):
        return self.profile.is_undercutting


class HeadBox(Model):
    """A box that a head's body stays in; from the middle of the cutter's flutes, in the machine's directions."""

    min_mm: tuple[float, float, float]
    max_mm: tuple[float, float, float]

    @model_validator(mode="after")
    def _has_a_size(self):
        if not all(a < b for a, b in zip(self.min_mm, self.max_mm)):
            raise ValueError(f"an angle head's box reaches from min_mm {self.min_mm} up to a larger max_mm, not {self.max_mm}")
        return self


class RightAngleHead(Model):
    """Hangs from the spindle and turns a side cutter about an axis along the machine's X.

        spindle ║      offset_mm: X of the disc's middle, seen from the spindle's axis
              ┌─╨──┐   length_mm: gauge line down to that middle
              │    ├──┐
              └────┤ ▐│▌ the disc; the program drives its middle
                   └─▐│▌   z ▲ ► x
    """

    name: str
    cutter_points: Literal["+X", "-X"] = Field(description="from the head to the cutter's free face")
    offset_mm: float
    length_mm: float = Field(gt=0)
    boxes: tuple[HeadBox, ...] = Field(min_length=1, description="its body")

    @property
    def axis(self):
        """(3,) unit, from the disc's free face towards the head."""
        return (-1.0, 0.0, 0.0) if self.cutter_points == "+X" else (1.0, 0.0, 0.0)


class Chatter(Model):
    """How a tool in its holder and spindle yields at its tip, as measured by a hammer test: one figure, or modes."""

    least_real_mm_per_n: float | None = Field(default=None, lt=0, description="min Re G, across the axis")
    modes: tuple[tuple[float, float, float], ...] | None = Field(
        default=None, min_length=1, description="frequency_hz, stiffness_n_per_mm, damping ratio of each")

    @model_validator(mode="after")
    def _says_one(self):
        if (self.least_real_mm_per_n is None) == (self.modes is None):
            raise ValueError("it has either least_real_mm_per_n or modes")
        if any(not (f > 0 and k > 0 and 0 < z < 1) for f, k, z in self.modes or ()):
            raise ValueError("modes have a frequency and a stiffness above 0 and a damping ratio between 0 and 1")
        return self


class Tool(Model):
    """A cutter in its holder, as it stands in the magazine."""

    number: int = Field(ge=1, le=99999)
    cutter: Cutter
    holder: Holder
    stick_out_mm: float = Field(gt=0, description="tip to holder nose")
    head: RightAngleHead | None = Field(default=None, description="that the holder sits in, in place of the spindle")
    chatter: Chatter | None = Field(default=None, description="as measured; left out: depths are not checked against chatter")
    presets: tuple[Preset, ...] | None = Field(default=None, description="speeds and feeds that the shop found for it; left out: "
                                               "the material's")

    @model_validator(mode="after")
    def _stick_out_is_possible(self):
        if not self.cutter.flute_length_mm <= self.stick_out_mm < self.cutter.overall_length_mm:
            raise ValueError("stick_out_mm must be between flute_length_mm and overall_length_mm")
        return self

    @model_validator(mode="after")
    def _head_takes_the_cutter(self):
        c = self.cutter
        if self.head is None:
            return self
        if c.type != "side" or abs(c.flute_length_mm - 2 * c.corner_radius_mm) > WIDTH_MM:
            raise ValueError(f"an angle head takes a side-and-face cutter with full teeth, whose corner_radius_mm is "
                             "half its flute_length_mm: a flat between the teeth gouges wherever the surface slopes; "
                             f"T{self.number} has a {c.type} cutter of {c.flute_length_mm:g} mm and "
                             f"{c.corner_radius_mm:g} mm")
        if self.head.length_mm <= c.radius_mm:
            raise ValueError(f"the head's length_mm {self.head.length_mm:g} does not reach beyond the cutter's radius")
        return self

    @model_serializer(mode="wrap")
    def _without_a_head_it_has_not(self, dump):
        row = dump(self)
        return {k: v for k, v in row.items() if v is not None or k not in ("head", "chatter", "presets")}

    @property
    def simulated(self):
        """The same with its cutter's `body`."""
        return self if self.cutter.body is self.cutter else self.model_copy(update={"cutter": self.cutter.body})

    @property
    def wheel_mm(self):
        """Radius of the circle on which the middles of a side cutter's teeth run."""
        return self.cutter.radius_mm - self.cutter.corner_radius_mm

    @property
    def offset_mm(self):
        """(x, y, z) tool offset: gauge line on the spindle's axis, seen from the point that the program drives."""
        return (0.0 if self.head is None else -self.head.offset_mm, 0.0, self.length_mm)

    @property
    def driven_mm(self):
        """Height of the point that the program drives above the tip, along the cutter's own axis."""
        return 0.0 if self.head is None else self.cutter.flute_length_mm / 2

    def non_cutting_frusta(self):
        """(k, 4) frusta (z0_mm, radius0_mm, z1_mm, radius1_mm) above the tip that must never touch.

        Neck and shank as far as they leave the holder, then the holder's segments.
        """
        rows = [row for row in map(self._as_far_as_it_leaves_the_holder, self._shaft()) if row is not None]
        return np.array(rows + _stacked(self.stick_out_mm, self.holder.segments))

    def _shaft(self):
        """Frusta from the flutes' end to the cutter's own, inside the holder too."""
        c = self.cutter
        rows = [(c.flute_length_mm, c.neck_diameter_mm / 2, c.reach_mm, c.neck_diameter_mm / 2)]
        if c.shaft_segments is not None:
            rows = _stacked(c.flute_length_mm, c.shaft_segments)
        return [*rows, (rows[-1][2], c.shank_diameter_mm / 2, c.overall_length_mm, c.shank_diameter_mm / 2)]

    def _as_far_as_it_leaves_the_holder(self, row):
        z0, r0, z1, r1 = row
        end = min(z1, self.stick_out_mm)
        if end <= z0:
            return None
        return z0, r0, end, r1 if end == z1 else r0 + (r1 - r0) * (end - z0) / (z1 - z0)

    @property
    def length_mm(self):
        """Tool length offset: holder gauge line (top of its last segment) to tip; a head's to the disc's middle."""
        if self.head is not None:
            return self.head.length_mm
        return self.stick_out_mm + sum(s.height_mm for s in self.holder.segments)


class ToolInSpindle(Tool):
    """A tool with what stands round the spindle above it, which keeps clear of everything as its holder does."""

    around: tuple[tuple[float, float, float, float], ...] = Field(exclude=True, description="(z0, radius0, z1, radius1) above "
                                                                  "the gauge line")

    def non_cutting_frusta(self):
        above = [(z0 + self.length_mm, r0, z1 + self.length_mm, r1) for z0, r0, z1, r1 in self.around]
        return np.vstack([super().non_cutting_frusta(), above])


def _stacked(z, segments):
    """[(z0, radius0, z1, radius1), ...] of HolderSegments from a height upward."""
    rows = []
    for s in segments:
        rows.append((z, s.lower_diameter_mm / 2, z + s.height_mm, s.upper_diameter_mm / 2))
        z += s.height_mm
    return rows


def cylinders_of(z0_mm, radius0_mm, z1_mm, radius1_mm):
    """[(z, radius)] of cylinders from there upward that hold a frustum, each as wide as a slice's upper end.

    One that narrows upward stands in the shadow of its lower end.

    >>> cylinders_of(10.0, 3.0, 18.0, 4.0), cylinders_of(10.0, 3.0, 18.0, 2.0)
    ([(10.0, 3.5), (14.0, 4.0)], [(10.0, 3.0)])
    """
    return [(z, max(radius0_mm, wide)) for z, _, _, wide in slices_of(z0_mm, radius0_mm, z1_mm, radius1_mm)]


def slices_of(z0_mm, radius0_mm, z1_mm, radius1_mm):
    """[(z, radius, z, radius)] of frusta that a frustum is cut into, from its lower end upward, none wider by more than SLICE_MM.

    >>> slices_of(10.0, 3.0, 18.0, 4.0)
    [(10.0, 3.0, 14.0, 3.5), (14.0, 3.5, 18.0, 4.0)]
    """
    count = max(1, math.ceil((radius1_mm - radius0_mm) / SLICE_MM))
    ends = [(z0_mm + (z1_mm - z0_mm) * k / count, radius0_mm + (radius1_mm - radius0_mm) * k / count) for k in range(count + 1)]
    return [(*low, *high) for low, high in zip(ends, ends[1:])]


class ToolLibrary(Model):
    """The shop's tools."""

    tools: tuple[Tool, ...] = Field(min_length=1)
    _smaller: object = PrivateAttr(default=None)

    @property
    def smaller(self):
        """ToolLibrary of the same tools and smaller ones, for slots and pockets that these do not get into; None: there is none."""
        return self._smaller

    @property
    def all_smaller(self):
        """(ToolLibrary, ...) that one, what it has itself for smaller places, and so on."""
        return () if self._smaller is None else (self._smaller, *self._smaller.all_smaller)

    def with_smaller(self, library):
        """The same tools, with that one at hand for what they do not get into; None: with none."""
        mine = self.model_copy()
        mine._smaller = library
        return mine

    @model_validator(mode="after")
    def _numbers_are_unique(self):
        numbers = [t.number for t in self.tools]
        twice = sorted({n for n in numbers if numbers.count(n) > 1})
        if twice:
            raise ValueError(f"tool numbers used twice: {twice}")
        return self

    def with_tools(self, tools):
        """The library with more tools, those of its own numbers in place of its own, by their numbers."""
        numbers = {t.number for t in tools}
        joined = sorted([*(t for t in self.tools if t.number not in numbers), *tools], key=lambda t: t.number)
        return self.model_copy(update={"tools": tuple(joined)}) if tools else self

    def in_spindle(self, around):
        """The same tools in a spindle, those of angle heads as they are.

        Args:
            around: ((z0, r0, z1, r1), ...) above the gauge line; none: the library itself.
        """
        if not around:
            return self
        tools = tuple(t if t.head else ToolInSpindle.model_construct(**dict(t), around=around) for t in self.tools)
        return self.model_copy(update={"tools": tools})

    def of_type(self, *types):
        """Tools of the given cutter types, largest diameter first."""
        found = [t for t in self.tools if t.cutter.type in types]
        return sorted(found, key=lambda t: (-t.cutter.diameter_mm, t.number))

    def number(self, number):
        """The tool with that number.

        Raises:
            InputError: there is none.
        """
        for t in self.tools:
            if t.number == number:
                return t
        raise InputError(f"tool T{number} is not in the library; it holds "
                         + ", ".join(f"T{t.number}" for t in self.tools))


def simulated(tools):
    """{number: Tool} with what is simulated of each."""
    return {n: t.simulated for n, t in tools.items()}


def library_from_json(path):
    """Read a tool library file; a tool may give its lengths in its own `unit`, see tool_units.

    Raises:
        InputError: missing, broken or inconsistent; names the tool and every key that is wrong.
    """
    document = json_of(path, "tool library")
    try:
        in_millimetres = in_mm(document)
    except (ValueError, OverflowError, RecursionError) as error:
        raise InputError(f"tool library {path}: {complaints(error)}") from None
    return checked(ToolLibrary, in_millimetres, f"tool library {path}")
