r"""Holes among the faces of a solid: through, blind, stepped, countersunk.

    \        /    a countersink, a cone        the walls of one hole share an axis and follow one another
     |      |     a counterbore                along it; each goes all round, and its material lies outside
     |_    _|
       |  |       the bore
       |__|       a bottom: flat, a cone, or none
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen

SAME_MM = 1e-4            # axes, ends and radii that are the same
PARALLEL = 1e-7           # of unit vectors
ROUND_RAD = 1e-3          # what may be missing of a wall's full turn
BESIDE = 1e-3             # of a wall's radius: how near to it a floor is looked for
AROUND = 8                # places
POINT_MM = 1e-3           # a cone narrower than this ends in its point


@dataclass(frozen=True, kw_only=True)
class Wall:
    """One cylinder or cone of a hole, seen along the hole's axis, which points out of its mouth."""

    kind: str                       # "cylinder" or "cone"
    low_mm: float                   # where it begins along the axis, from the axis' point
    high_mm: float
    low_radius_mm: float
    high_radius_mm: float
    faces: tuple[int, ...]          # indices of the faces it is made of


@dataclass(frozen=True, eq=False, kw_only=True)
class Hole:
    """A hole; lengths in millimetres, in the frame of its faces."""

    point_mm: np.ndarray            # (3,) on the axis
    axis: np.ndarray                # (3,) unit, out of the mouth; of a through hole towards its wider end
    walls: tuple[Wall, ...]         # from the bottom to the mouth
    is_through: bool
    floor: tuple[int, ...] = field(default=())      # faces of a flat bottom

    def __post_init__(self):
        for name in ("point_mm", "axis"):
            object.__setattr__(self, name, frozen(getattr(self, name), (3,), name))

    def turned_up(self):
        """A through hole seen from its other end."""
        walls = tuple(replace(w, low_mm=-w.high_mm, high_mm=-w.low_mm, low_radius_mm=w.high_radius_mm,
                              high_radius_mm=w.low_radius_mm) for w in reversed(self.walls))
        return replace(self, axis=-self.axis, walls=walls)

    @property
    def faces(self):
        """Indices of all its faces but flat ones."""
        return tuple(i for w in self.walls for i in w.faces)

    @property
    def bore(self):
        """Its narrowest cylinder; None: it has cones alone."""
        return min((w for w in self.walls if w.kind == "cylinder"), key=lambda w: w.low_radius_mm, default=None)

    @property
    def depth_mm(self):
        """From its mouth to its lowest place."""
        return self.walls[-1].high_mm - self.walls[0].low_mm

    @property
    def mouth_mm(self):
        """(3,) middle of its mouth."""
        return self.point_mm + self.walls[-1].high_mm * self.axis

    @property
    def point_angle_deg(self):
        """Of the cone that it ends in, from side to side; None: it ends otherwise."""
        end = self.walls[0]
        if end.kind != "cone" or end.low_radius_mm > POINT_MM:
            return None
        return cone_angle_deg(end)

    @property
    def kind(self):
        """"through", "blind", or either with "stepped" or "countersunk" before it.

        >>> bore = Wall(kind="cylinder", low_mm=0, high_mm=5, low_radius_mm=2, high_radius_mm=2, faces=(0,))
        >>> Hole(point_mm=(0, 0, 0), axis=(0, 0, 1), walls=(bore,), is_through=True).kind
        'through'
        """
        inner = self.walls if self.point_angle_deg is None else self.walls[1:]
        words = ["countersunk"] if any(w.kind == "cone" for w in inner) else []
        words += ["stepped"] if sum(w.kind == "cylinder" for w in inner) > 1 else []
        return " ".join([*words, "through" if self.is_through else "blind"])

    def lowest_tip_mm(self, wall, radius_mm, slope):
        """How far down a drill's tip comes before its point cuts what lies below a wall, along the axis.

        Args:
            wall: one of its cylinders.   radius_mm: of the drill, near to the wall's.   slope: rise of its point, mm a mm.
        Returns:
            height along the axis; -inf where nothing lies below.
        """
        inner = radius_mm - SAME_MM - abs(radius_mm - wall.low_radius_mm)
        return max((z - r * slope for r, z in self.corners_mm() if z < wall.high_mm - SAME_MM and r < inner), default=-math.inf)

    def corners_mm(self):
        """[(radius, height along the axis)] of its outline, a flat bottom's middle included."""
        rows = [row for w in self.walls for row in ((w.low_radius_mm, w.low_mm), (w.high_radius_mm, w.high_mm))]
        return [*rows, (0.0, self.walls[0].low_mm)] if self.floor else rows


def cone_angle_deg(wall):
    """Angle of a cone's Wall from side to side."""
    rise = wall.high_mm - wall.low_mm
    return math.degrees(2 * fixed.arctan2(abs(wall.high_radius_mm - wall.low_radius_mm), rise))


def holes_of(faces):
    """The holes of a solid, in the order of their faces.

    Args:
        faces: all brep.Face values of it.
    Returns:
        tuple of Hole.  Grooves, round pockets with an island, fillets and bosses are none: walls of a hole go all round, with
        the material outside.
    """
    walls = [_Bare.of(k, face) for k, face in enumerate(faces) if face.kind in ("cylinder", "cone")]
    groups = []
    for wall in (w for w in walls if w is not None):
        for group in groups:
            if group[0].shares_axis(wall):
                group.append(wall.seen_as(group[0]))
                break
        else:
            groups.append([wall])
    found = [hole for group in groups for run in _runs(_whole(group)) for hole in _holes(run, group[0], faces)]
    return tuple(sorted(found, key=lambda h: min(h.faces)))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Bare:
    """A hollow cylinder's or cone's face about its axis."""

    index: int
    kind: str
    point_mm: np.ndarray
    axis: np.ndarray
    ends: tuple             # ((height, radius), (height, radius)), rising
    turn_rad: float

    @classmethod
    def of(cls, index, face):
        """None where the material lies inside."""
        surface = face.adaptor.Cylinder() if face.kind == "cylinder" else face.adaptor.Cone()
        position = surface.Axis()
        point, axis = (np.array([p.X(), p.Y(), p.Z()]) for p in (position.Location(), position.Direction()))
        u0, u1, v0, v1 = face.uv_bounds
        ends = []
        for v in (v0, v1):
            p = face.adaptor.Value((u0 + u1) / 2, v)
            way = np.array([p.X(), p.Y(), p.Z()]) - point
            high = float((way * axis).sum())
            ends.append((high, float(fixed.length(way - high * axis))))
        here = face.middle.point_mm[0] - point
        out = here - (here * axis).sum() * axis
        if not (face.middle.normal[0] * out).sum() < 0:
            return None
        return cls(index=index, kind=face.kind, point_mm=point, axis=axis, ends=tuple(sorted(ends)), turn_rad=u1 - u0)

    def shares_axis(self, other):
        across = np.cross(self.axis, other.axis)
        way = other.point_mm - self.point_mm
        off = way - (way * self.axis).sum() * self.axis
        return (across * across).sum() < PARALLEL ** 2 and (off * off).sum() < SAME_MM ** 2

    def seen_as(self, first):
        """The same with another's point and direction of the axis."""
        shift = float(((self.point_mm - first.point_mm) * first.axis).sum())
        sign = 1.0 if (self.axis * first.axis).sum() > 0 else -1.0
        ends = tuple(sorted((shift + sign * h, r) for h, r in self.ends))
        return _Bare(index=self.index, kind=self.kind, point_mm=first.point_mm, axis=first.axis, ends=ends, turn_rad=self.turn_rad)

    def is_like(self, other):
        """Whether both are parts of one wall that goes round."""
        return self.kind == other.kind and all(abs(a - b) < SAME_MM for p, q in zip(self.ends, other.ends) for a, b in zip(p, q))


def _whole(group):
    """[(height, radius, height, radius, kind, faces)] of the walls that go all round, rising."""
    out, left = [], list(group)
    while left:
        same = [w for w in left if w.is_like(left[0])]
        left = [w for w in left if w not in same]
        if sum(w.turn_rad for w in same) > 2 * math.pi - ROUND_RAD:
            (low, r_low), (high, r_high) = same[0].ends
            out.append((low, r_low, high, r_high, same[0].kind, tuple(w.index for w in same)))
    return sorted(out)


def _runs(walls):
    """Walls that follow one another along the axis, apart from others."""
    runs = []
    for wall in walls:
        if runs and abs(wall[0] - runs[-1][-1][2]) < SAME_MM:
            runs[-1].append(wall)
        else:
            runs.append([wall])
    return runs


def _holes(run, first, faces):
    """The Hole of a run of walls, () where both ends are closed, or one by a floor that something else stands on."""
    if any(_is_groove(run[k], end, first, faces, sign) for k, end, sign in ((0, 0, 1.0), (-1, 2, -1.0))):
        return ()
    low, high = (_is_closed(run[k], end, first, faces, sign) for k, end, sign in ((0, 0, 1.0), (-1, 2, -1.0)))
    if low is not None and high is not None:
        return ()
    turned = high is not None or (low is None and run[0][1] > run[-1][3] + SAME_MM) or (
        low is None and high is None and abs(run[0][1] - run[-1][3]) <= SAME_MM and _points_down(first.axis))
    sign = -1.0 if turned else 1.0
    walls = [Wall(kind=kind, low_mm=a, high_mm=b, low_radius_mm=p, high_radius_mm=q, faces=indices)
             for a, p, b, q, kind, indices in (
                 ((-h, r, -l, s, kind, i) for l, s, h, r, kind, i in reversed(run)) if turned else run)]
    floor = (high if turned else low)
    return (Hole(point_mm=first.point_mm, axis=sign * first.axis + 0.0, walls=tuple(walls), is_through=floor is None,
                 floor=floor or ()),)


def _points_down(axis):
    """Whether the largest part of a direction is negative: of a plain through hole either end is its mouth."""
    return bool(axis[np.abs(axis).argmax()] < 0)


def _is_closed(wall, end, first, faces, sign):
    """() where a cone ends in its point, faces of a flat bottom, or None: open."""
    height, radius = wall[end], wall[end + 1]
    if radius < POINT_MM:
        return ()
    place = first.point_mm + height * first.axis
    flat = tuple(k for k, f in enumerate(faces) if f.kind == "plane" and _is_across(f, place, sign * first.axis))
    return flat or None


def _is_groove(wall, end, first, faces, sign):
    """Whether a floor lies all along the wall's end, but not in its middle."""
    height, radius = wall[end], wall[end + 1]
    if radius < POINT_MM:
        return False
    middle, out = first.point_mm + height * first.axis, sign * first.axis
    flat = [f for f in faces if f.kind == "plane" and (f.middle.normal[0] * out).sum() > 1.0 - PARALLEL
            and abs(((middle - f.middle.point_mm[0]) * out).sum()) <= SAME_MM]
    if not flat or any(_is_across(f, middle, out) for f in flat):
        return False
    return all(_on_level(flat, middle, out, radius))


def ends_on_level(hole, wall):
    """Whether a wall is the lowest of a blind hole with a level bottom."""
    return bool(hole.floor) and wall == hole.walls[0]


def _on_level(flat, middle, out, radius_mm):
    """[bool] for places just within a wall: whether one of some planes, that looks along `out`, lies there."""
    u = np.cross(out, np.eye(3)[np.abs(out).argmin()])
    u, v = u / fixed.length(u), np.cross(out, u / fixed.length(u))
    return [any(_is_across(f, middle + (1.0 - BESIDE) * radius_mm * (fixed.cos(t) * u + fixed.sin(t) * v), out) for f in flat)
            for t in 2 * math.pi * (np.arange(AROUND) + 0.5) / AROUND]


def _is_across(face, place, out):
    """Whether a plane's face holds a place and looks along `out`."""
    middle = face.middle
    if (middle.normal[0] * out).sum() < 1.0 - PARALLEL or abs(((place - middle.point_mm[0]) * out).sum()) > SAME_MM:
        return False
    position = face.adaptor.Plane().Position()
    way = place - np.array([position.Location().X(), position.Location().Y(), position.Location().Z()])
    u, v = (np.array([(way * (d.X(), d.Y(), d.Z())).sum()]) for d in (position.XDirection(), position.YDirection()))
    return bool(face.is_inside(u, v)[0])
