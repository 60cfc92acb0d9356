r"""Where the tool's axis points along a pass: strategies as values, each a function of place, normal and feed.

         n  axis                   lead: from the normal n toward the feed, the holder goes ahead of the tip;
         |lead/                          below 0 it trails
         |   /                     tilt: from there to the right of the feed, seen from the air; below 0 to the left
         |  /
    _____|_/______-> feed          right = feed x n,  axis = cos tilt (cos lead n + sin lead feed) + sin tilt right

Each is registered by its `kind` as it is imported; a job file says `tool_axis = { kind = "lead_tilt", lead_deg = 10 }`.
Places and directions of a value are part coordinates; `seen_from` gives the same value in the frame that is planned in.
"""

import math
from abc import abstractmethod
from typing import Annotated, ClassVar, Literal, Union

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, SerializeAsAny, Tag, model_serializer

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError
from cuspline.values.models import KIND, Model, Point, by_kind

LEANING = ("ball", "bull_nose", "flat", "tapered_ball", "lens", "apt")     # types that a LeadTilt leans
LOST = 1e-6                 # a direction shorter than this, of what it was made of, points nowhere


def _with_a_length(direction):
    if not sum(v * v for v in direction) > 0:
        raise ValueError("a direction without a length")
    return direction


Direction = Annotated[Point, AfterValidator(_with_a_length)]
Lead = Annotated[float, Field(gt=-90, lt=90)]
REGISTERED: dict[str, type["ToolAxis"]] = {}


class ToolAxis(Model):
    """A strategy for the tool's axis; `limit_deg` keeps it near the setup's Z."""

    kind: ClassVar[str] = ""
    limit_deg: float | None = Field(default=None, gt=0, le=170, description="the axis leans no farther from the setup's Z: what "
                                    "would is brought back to that, straight toward Z; left out: any way")
    smooth_deg: float | None = Field(default=None, gt=0, le=60, description="a ball's axis may leave its strategy by so much "
                                     "where the rotaries would not follow at full feed; left out: the feed is lowered there")

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs):
        super().__pydantic_init_subclass__(**kwargs)
        if cls.kind:
            REGISTERED[cls.kind] = cls

    @model_serializer(mode="wrap")
    def _with_its_kind(self, dump):
        return {"kind": self.kind, **{key: value for key, value in dump(self).items() if value is not None}}

    def axes(self, places_mm, normals, feeds):
        """Axes at places along passes.

        Args:
            places_mm: (n, 3) of the tool's axis line: a ball's middle, of other cutters the contact.
            normals: (n, 3) unit, out of the material, at the contacts.
            feeds: (n, 3) directions of travel, of any length.
        Returns:
            (n, 3) unit, tip to holder.
        Raises:
            ToolpathError: places where the strategy gives no direction; `.rows`.
        """
        places, normals, feeds = (frozen(a, (None, 3), name) for a, name in (
            (places_mm, "places_mm"), (normals, "normals"), (feeds, "feeds")))
        found = self.unlimited(places, normals, feeds)
        if self.limit_deg is not None:
            found = limited(found, math.radians(self.limit_deg))
        lost = np.flatnonzero(~np.isfinite(found).all(axis=1))
        if len(lost):
            raise ToolpathError(f"tool axis {self.kind}: {len(lost)} of {len(places)} places have none, the first at "
                                f"{np.round(places[lost[0]], 3).tolist()}: {self.pole()}", rows=lost)
        return found

    @abstractmethod
    def unlimited(self, places, normals, feeds):
        """The same without limits; NaN where it points nowhere."""

    @abstractmethod
    def pole(self):
        """Where it points nowhere, and what helps."""

    @abstractmethod
    def seen_from(self, frame):
        """The same value, its places and directions as seen from a frame."""


class LeadTilt(ToolAxis):
    """At angles to the normal: lead along the feed, the holder ahead; tilt across it, to the right.

    With `toward` both are counted from that direction instead of the feed's: passes to and fro lean the same way, and links
    between them turn nothing.  Pole: a feed, or `toward`, along the normal has no direction on the surface.
    """

    kind = "lead_tilt"
    lead_deg: float = Field(default=0.0, gt=-90, lt=90, description="from the normal toward the feed, the holder ahead of the tip; "
                            "below 0 it trails")
    tilt_deg: float = Field(default=0.0, gt=-90, lt=90, description="from there to the right of the feed, seen from the air; below "
                            "0 to the left")
    toward: Direction | None = Field(default=None, description="lead and tilt count from this direction along the surface, part "
                                     "coordinates; left out: from the feed's, so that every pass back leans the other way")

    def unlimited(self, places, normals, feeds):
        lead, tilt = math.radians(self.lead_deg), math.radians(self.tilt_deg)
        feeds = feeds if self.toward is None else np.tile(np.array(self.toward), (len(normals), 1))
        ahead = _unit(feeds - _dot(feeds, normals) * normals, np.sqrt(_dot(feeds, feeds)))
        in_plane = fixed.cos(lead) * normals + fixed.sin(lead) * ahead
        return fixed.cos(tilt) * in_plane + fixed.sin(tilt) * np.cross(ahead, normals)

    def pole(self):
        if self.toward is not None:
            return "`toward` runs along the normal there; give it a direction along the faces"
        return "the feed runs along the normal there; plan such a wall by waterlines, or with a fixed axis"

    def seen_from(self, frame):
        return self if self.toward is None else self.model_copy(update={"toward": _turned(frame, self.toward)})


class FastestAxis(ToolAxis):
    """Lead and cutter as the comparison of all that the library has says: the fastest that fits and that plans.

    Pole: as of LeadTilt.
    """

    kind = "fastest"
    leads_deg: tuple[Lead, ...] = Field(default=(3.0, 5.0, 8.0, 12.0, 20.0, 30.0), min_length=1,
                                        description="leads that are compared")
    tilt_deg: float = Field(default=0.0, gt=-90, lt=90, description="as of lead_tilt")
    toward: Direction | None = Field(default=None, description="as of lead_tilt")

    def leading(self, lead_deg):
        """LeadTilt of one lead."""
        return LeadTilt(lead_deg=lead_deg, tilt_deg=self.tilt_deg, toward=self.toward, limit_deg=self.limit_deg)

    def unlimited(self, places, normals, feeds):
        return self.leading(self.leads_deg[0]).unlimited(places, normals, feeds)

    def pole(self):
        return self.leading(self.leads_deg[0]).pole()

    seen_from = LeadTilt.seen_from


class FixedAxis(ToolAxis):
    """One direction everywhere.  No pole."""

    kind = "fixed"
    direction: Direction = Field(description="from the tip to the holder, part coordinates")

    def unlimited(self, places, normals, feeds):
        return np.tile(_unit(np.array([self.direction]), 1.0), (len(places), 1))

    def pole(self):
        return "its direction is the setup's Z turned over; give it another"

    def seen_from(self, frame):
        return self.model_copy(update={"direction": _turned(frame, self.direction)})


class ThroughPoint(ToolAxis):
    """The axis' line goes through one point: over a dome from its middle, into a cavity through its mouth.

    Pole: the point itself.
    """

    kind = "through_point"
    point_mm: Point = Field(description="part coordinates")
    holder: Literal["towards", "away"] = Field(default="away", description="of the point: away from one inside the part, towards "
                                               "one in the air above it")

    def unlimited(self, places, normals, feeds):
        return _unit(_side(self.holder) * (places - np.array(self.point_mm)), 1.0)

    def pole(self):
        return "these are its point; move the point away from the cut"

    def seen_from(self, frame):
        return self.model_copy(update={"point_mm": _moved(frame, self.point_mm)})


class AlongLine(ToolAxis):
    """The axis' line meets a line squarely: round a shaft, along a blade or a slot.

    Pole: the line itself.
    """

    kind = "along_line"
    point_mm: Point = Field(description="any of the line, part coordinates")
    direction: Direction = Field(description="of the line, part coordinates; which way does not matter")
    holder: Literal["towards", "away"] = Field(default="away", description="of the line: away from one inside the part, towards "
                                               "one in the air above it")

    def unlimited(self, places, normals, feeds):
        arm, along = places - np.array(self.point_mm), _unit(np.array([self.direction]), 1.0)
        return _unit(_side(self.holder) * (arm - _dot(arm, along) * along), 1.0)

    def pole(self):
        return "these are on its line; move the line away from the cut"

    def seen_from(self, frame):
        return self.model_copy(update={"point_mm": _moved(frame, self.point_mm), "direction": _turned(frame, self.direction)})


class Guide(Model):
    """The axis at one place."""

    place_mm: Point = Field(description="part coordinates")
    direction: Direction = Field(description="of the axis there, from the tip to the holder")


class BetweenGuides(ToolAxis):
    """Between directions given at places: the mean of them all, weighted by one over the distance squared.

    At a guide's place it is the guide's own; far from all of them the plain mean.  Pole: directions that cancel out.
    """

    kind = "between_guides"
    guides: tuple[Guide, ...] = Field(min_length=1, description="places with the direction of the axis there")

    def unlimited(self, places, normals, feeds):
        directions = _unit(np.array([g.direction for g in self.guides]), 1.0)
        arm = places[:, None] - np.array([g.place_mm for g in self.guides])
        square = (arm * arm).sum(axis=2)
        nearest = square.min(axis=1)
        weight = np.where(nearest[:, None] > 0.0, nearest[:, None] / np.maximum(square, 1e-300), square == 0.0)
        return _unit(np.einsum("ng,gk->nk", weight, directions), weight.sum(axis=1)[:, None])

    def pole(self):
        return "its guides cancel out there; add a guide between them"

    def seen_from(self, frame):
        return self.model_copy(update={"guides": tuple(
            Guide(place_mm=_moved(frame, g.place_mm), direction=_turned(frame, g.direction)) for g in self.guides)})


def axis_of(value):
    """A ToolAxis out of a job file's table, by its `kind`; anything else stays what it is.

    Raises:
        ValueError: there is no such kind, or something in it is wrong.
    """
    return by_kind(value, REGISTERED, "tool axis")


class ClearingAxis(ToolAxis):
    """A standard direction, turned as little as clears what is in the way of flutes, shank, holder and spindle head.

    Where the standard direction is clear it stands; else the axis turns in the plane of that direction and the normal, either
    way, or where the two coincide across X; `both_angles`: any other way too, where less of it clears.
    Contacts that nothing clears are not cut.
    """

    kind = "clearing"
    around: Annotated[SerializeAsAny[ToolAxis], BeforeValidator(axis_of)] = Field(
        default=LeadTilt(), description="the standard direction, another tool axis")
    up_to_deg: float = Field(default=60.0, gt=0, le=120, description="the axis turns no farther from the standard direction")
    both_angles: bool = Field(default=True, description="turn it across the plane of standard direction and normal too")

    def unlimited(self, places, normals, feeds):
        return self.around.axes(places, normals, feeds)

    def pole(self):
        return self.around.pole()

    def seen_from(self, frame):
        return self.model_copy(update={"around": self.around.seen_from(frame)})


AnyAxis = Annotated[
    Union[Annotated[SerializeAsAny[ToolAxis], Tag(KIND + "ToolAxis")], Annotated[Point, Tag(KIND + "Point")]],
    Discriminator(lambda value: KIND + ("ToolAxis" if isinstance(value, ToolAxis) else "Point")), BeforeValidator(axis_of)]


def limited(axes, most_rad):
    """Axes that lean farther from Z brought back, straight toward Z.

    Args:
        axes: (n, 3) unit.   most_rad: 0 .. pi.
    Returns:
        (n, 3) unit; NaN where one points along -Z, from which every way is as short.

    >>> limited(np.array([[0.8, 0.0, 0.6], [0.0, 0.6, 0.8]]), np.radians(45)).round(3)
    array([[0.707, 0.   , 0.707],
           [0.   , 0.6  , 0.8  ]])
    """
    level = axes * (1.0, 1.0, 0.0)
    at_limit = fixed.sin(most_rad) * _unit(level, 1.0) + fixed.cos(most_rad) * np.array([0.0, 0.0, 1.0])
    return np.where((axes[:, 2] >= fixed.cos(most_rad))[:, None], axes, at_limit)


def _dot(a, b):
    """(n, 1)."""
    return (a * b).sum(axis=1)[:, None]


def _unit(vectors, size):
    """(n, 3) of length 1; NaN where one is shorter than LOST of its size, scalar or (n, 1)."""
    length = np.sqrt((vectors * vectors).sum(axis=1))[:, None]
    return np.where(length > LOST * size, vectors / np.maximum(length, 1e-300), np.nan)


def _side(holder):
    return 1.0 if holder == "away" else -1.0


def _moved(frame, point):
    return tuple(frame.into(np.array([point]))[0].tolist())


def _turned(frame, direction):
    return tuple(frame.turn_into(np.array([direction]))[0].tolist())
