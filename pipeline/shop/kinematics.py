"""A machine as a kinematic chain: joints to the tool in the part, and back.

    part -- C -- A -- Y -- [bed] -- X -- Z -- spindle -- tool tip
            \\________________/       \\____/
             move the part            move the tool

Everything is said in machine coordinates at the zero pose, all joints 0: the spindle nose is then the origin.  The part's
frame is fixed to whatever carries the part and falls together with machine coordinates at the zero pose.  A linear axis
counts as the tool moves, seen from the part; a rotary turns what it carries, table or head, right-handed about its direction.

With rotaries 1 and 2 (from the part) about u1 and u2 and the spindle a at rest, an axis v is reached by
w = R2(t2) a and v = R1(t1) w: w lies on two cones, so there are two branches, mirrored at the plane of u1 and u2:

    w.u1 = v.u1, w.u2 = a.u2:      m along e1 = u2 - (u1.u2) u1 (made unit), +h or -h along e2 = u1 x e1
    t1 = azimuth of v about u1 - (+-) psi,  psi = angle of (m, h);     t2 = -(+-) chi - chi0

At the pole v = +-u1 rotary 1 is free: it keeps the angle it has.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import PostError
from cuspline.values.frames import Frame
from cuspline.values.rows import X, Y, Z

POLE_RAD = 1e-10        # an axis this close to a pole stands on it: a tenth of what inverse kinematics may be off
MISS_RAD = 1e-9         # an axis reached this closely is reached
FLAT = 1e-3             # of the volume that X, Y and Z span: below, they lie in one plane
LIMIT_SLACK = 1e-9      # mm, rad: rounding beyond a limit
FULL = 2 * np.pi
LINEARS = 3             # columns of joints that are lengths
FIRST, SECOND = 3, 4    # columns of the rotaries, from the part
PHI, PSI, CHI, ALONG, ACROSS = range(5)     # columns of what `_bearings` finds


class Links(NamedTuple):
    """The chain as kernels read it; one row a joint, columns of joints: X Y Z, then rotaries from the part to the tool."""

    order: np.ndarray       # (m,) joints from the part to the tool
    is_rotary: np.ndarray   # (m,)
    direction: np.ndarray   # (m, 3) unit, turned over for what moves the part
    pivot: np.ndarray       # (m, 3) a point of each rotary's axis
    spindle: np.ndarray     # (3,) unit, tip to holder, at the zero pose


class Wrist(NamedTuple):
    """What the rotaries alone do to the tool's axis."""

    count: int
    u1: np.ndarray          # (3,) the direction of rotary 1
    e1: np.ndarray          # (3,) unit, square to u1: toward rotary 2; of a single rotary any
    e2: np.ndarray          # (3,) u1 x e1
    g: float                # u1 . u2
    c2: float               # u2 . spindle
    side: float             # sine of the angle between u1 and u2
    zero: float             # what angle 0 counts: chi0 of two rotaries, psi of one


@dataclass(frozen=True, eq=False, kw_only=True)
class Chain:
    """A machine's joints; lengths mm, angles rad, speeds a second."""

    letters: tuple[str, ...]    # of the m joints: X Y Z, then the rotaries from the part to the tool
    order: np.ndarray           # (m,) columns from the part to the tool
    bed: int                    # how many of these move the part
    direction: np.ndarray       # (m, 3) as the machine's file says, made unit
    pivot_mm: np.ndarray        # (m, 3) zero for linear axes
    spindle: np.ndarray         # (3,) unit
    low: np.ndarray             # (m,) -inf where a rotary is endless
    high: np.ndarray            # (m,)
    speed: np.ndarray           # (m,)
    acceleration: np.ndarray    # (m,)

    def __post_init__(self):
        m = len(self.letters)
        for name, shape, dtype in (("order", (m,), np.int64), ("direction", (m, 3), float), ("pivot_mm", (m, 3), float),
                                   ("spindle", (3,), float), ("low", (m,), float), ("high", (m,), float),
                                   ("speed", (m,), float), ("acceleration", (m,), float)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    @property
    def rotaries(self):
        """Letters of the rotaries, from the part to the tool."""
        return self.letters[LINEARS:]

    @property
    def turned(self):
        """(m,) letters of the joints that move the part, the others move the tool."""
        return tuple(self.letters[k] for k in self.order[:self.bed])

    @property
    def links(self):
        """Links: the chain for kernels."""
        is_rotary = np.arange(len(self.letters)) >= LINEARS
        moves_part = np.isin(np.arange(len(self.letters)), self.order[:self.bed])
        seen = np.where((is_rotary & moves_part)[:, None], -self.direction, self.direction)
        return Links(for_kernel(self.order, np.int64), for_kernel(is_rotary, np.bool_), for_kernel(seen),
                     for_kernel(self.pivot_mm), for_kernel(self.spindle))

    @property
    def wrist(self):
        """Wrist: the rotaries for kernels."""
        links, count = self.links, len(self.rotaries)
        if count == 0:
            return Wrist(0, *np.eye(3)[[2, 0, 1]], 0.0, 0.0, 1.0, 0.0)
        u1 = links.direction[FIRST]
        u2 = links.direction[SECOND] if count == 2 else _any_across(u1)
        g = (u1 * u2).sum()
        e1 = _unit(u2 - g * u1)
        e2, c2 = np.cross(u1, e1), (u2 * self.spindle).sum()
        side = np.sqrt((np.cross(u1, u2) ** 2).sum())
        if count == 1:
            return Wrist(1, u1, e1, e2, g, c2, side, fixed.arctan2((self.spindle * e2).sum(), (self.spindle * e1).sum()))
        f1 = _unit(u1 - g * u2)
        zero = fixed.arctan2((self.spindle * np.cross(u2, f1)).sum(), (self.spindle * f1).sum())
        return Wrist(2, u1, e1, e2, g, c2, side, zero)

    def forward(self, joints, length_mm=0.0):
        """Where the tool stands in the part's frame.

        Args:
            joints: (n, m).   length_mm: from the spindle nose to the tip, scalar or (n,).
        Returns:
            (n, 3) tips, (n, 3) unit axes from the tip to the holder.
        """
        joints = self._joints(joints)
        return _forward(self.links, joints, _lengths(length_mm, len(joints)))

    def linear_axes(self, angles):
        """Frame whose X, Y and Z point where the linear axes lead, seen from the part, at (r,) angles of the rotaries.

        Raises:
            PostError: the linear axes are not square to each other.
        """
        steps = np.vstack([np.zeros(3), np.eye(3)])
        tips = self.forward(np.hstack([steps, np.tile(angles, (len(steps), 1))]))[0]
        try:
            return Frame(rotation=(tips[1:] - tips[0]).T, origin_mm=np.zeros(3))
        except ValueError:
            raise PostError("X, Y and Z of this machine are not square to each other: its control moves the zero with the table "
                            "only where they are") from None

    def off_z(self, angles):
        """How far the unit axis of the tool is from the linear Z, the most of its coordinates, at (r,) angles of the rotaries: 0
        where only the part has turned.

        Raises:
            PostError: see `linear_axes`.
        """
        z, axis = self.linear_axes(angles).rotation[:, 2], self.forward([[0.0, 0.0, 0.0, *angles]])[1][0]
        return float(np.abs(z - axis).max())

    def branches(self, axes, rows=None):
        """Every way to hold the tool along axes, but for whole turns.

        Args:
            axes: (n, 3) from the tip to the holder, in the part's frame.
            rows: (n,) what the rows are called in messages; left out: counted from 0.
        Returns:
            (n, 2, rotaries) angles in -pi .. pi; both rows are the same where the machine has fewer than two rotaries, and
            at a pole, where rotary 1 is free, they differ in what it does; (n,) bool whether the axis stands on a pole.
        Raises:
            PostError: the rotaries cannot lean the tool so; `.rows`.
        """
        axes = unit_rows(axes)
        wrist = self.wrist
        bearings, across, miss = _bearings(wrist, self.links, axes)
        self._refuse_missed(miss, called(rows, len(axes)))
        return _angles(wrist, bearings), (across <= POLE_RAD) & (wrist.count > 0)

    def placed(self, tips_mm, angles, length_mm=0.0):
        """Joints at which tips stand where they should while the rotaries stand at angles.

        Args:
            tips_mm: (n, 3) in the part's frame.   angles: (n, rotaries).   length_mm: scalar or (n,).
        Returns:
            (n, m) joints.
        Raises:
            PostError: a rotary between linear axes has turned them into one plane; `.rows`.
        """
        tips_mm = for_kernel(np.reshape(tips_mm, (-1, 3)))
        angles = for_kernel(np.reshape(angles, (len(tips_mm), len(self.rotaries))))
        joints, volume = _placed(self.links, tips_mm, angles, _lengths(length_mm, len(tips_mm)))
        bad = np.flatnonzero(~(np.abs(volume) > FLAT))
        if len(bad):
            raise PostError(f"row {bad[0]}: with the rotaries so, X, Y and Z move in one plane and cannot reach this place; "
                            "lean the tool another way", rows=bad)
        return joints

    def inverse(self, tips_mm, axes, length_mm=0.0):
        """Both branches of joints for each pose, but for whole turns of the rotaries.

        Returns:
            (n, 2, m) joints.
        Raises:
            PostError: see `branches`.
        """
        angles, _ = self.branches(axes)
        return np.stack([self.placed(tips_mm, angles[:, k], length_mm) for k in range(2)], axis=1)

    def refuse_beyond_limits(self, joints, rows=None):
        """Joints beyond a travel or a rotary's range.

        Args:
            joints: (n, m).   rows: (n,) what the rows are called in the message; left out: counted from 0.
        Raises:
            PostError: the first by row, axis and value; `.rows` has all.
        """
        low, high = joints < self.low - LIMIT_SLACK, joints > self.high + LIMIT_SLACK
        bad = np.flatnonzero((low | high).any(axis=1))
        if not len(bad):
            return
        names = called(rows, len(joints))
        k = int(np.flatnonzero((low | high)[bad[0]])[0])
        limit = self.low[k] if low[bad[0], k] else self.high[k]
        raise PostError(f"row {names[bad[0]]}: {self.letters[k]} would stand at {self.in_words(k, joints[bad[0], k])}, its limit "
                        f"is {self.in_words(k, limit)}{and_others(bad)}; shift or turn the part, or lean the tool another way",
                        rows=names[bad])

    def in_words(self, column, value):
        """A joint's value for a person.

        >>> Chain.in_words(None, 3, np.pi / 2), Chain.in_words(None, 0, 12.5)
        ('90.0000 degrees', '12.5000 mm')
        """
        return f"{np.degrees(value):.4f} degrees" if column >= LINEARS else f"{value:.4f} mm"

    def _joints(self, joints):
        return for_kernel(np.reshape(joints, (-1, len(self.letters))))

    def _refuse_missed(self, miss_rad, names):
        bad = np.flatnonzero(~(miss_rad <= MISS_RAD))
        if len(bad):
            rotaries = " and ".join(self.rotaries) or "(there are none)"
            raise PostError(f"row {names[bad[0]]}: the rotaries {rotaries} cannot hold the tool along this axis, they miss it by "
                            f"{np.degrees(miss_rad[bad[0]]):.6f} degrees{and_others(bad)}; lean the tool another way, or take "
                            "another machine", rows=names[bad])


def called(rows, count):
    """(count,) what rows are called: as they are given, or counted from 0."""
    return np.arange(count) if rows is None else np.asarray(rows)


def and_others(rows):
    """What a message that names the first of some rows says of the others.

    >>> and_others([4]), and_others([4, 7, 9])
    ('', ', and so in 2 other rows')
    """
    return f", and so in {len(rows) - 1} other rows" if len(rows) > 1 else ""


def unit_rows(vectors):
    """(n, 3) vectors made unit.

    Raises:
        PostError: one has no length.
    """
    vectors = np.reshape(np.asarray(vectors, float), (-1, 3))
    length = np.sqrt((vectors * vectors).sum(axis=1))
    bad = np.flatnonzero(~((length > 0) & np.isfinite(length)))
    if len(bad):
        raise PostError(f"row {bad[0]}: a tool axis of length {length[bad[0]]:g}: give a direction", rows=bad)
    return for_kernel(vectors / length[:, None])


def _unit(v):
    return v / np.sqrt((v * v).sum())


def _any_across(u):
    """A unit vector square to another."""
    return _unit(np.cross(u, np.eye(3)[np.argmin(np.abs(u))]))


def _lengths(length_mm, n):
    return for_kernel(np.broadcast_to(np.asarray(length_mm, float), (n,)))


# kernels -------------------------------------------------------------------------------------


@njit(inline="always")
def turned(x, y, z, u, s, c):
    """A vector turned about the unit vector u by the angle of sine s and cosine c."""
    along = (u[X] * x + u[Y] * y + u[Z] * z) * (1.0 - c)
    return (x * c + (u[Y] * z - u[Z] * y) * s + u[X] * along,
            y * c + (u[Z] * x - u[X] * z) * s + u[Y] * along,
            z * c + (u[X] * y - u[Y] * x) * s + u[Z] * along)


@njit(inline="always")
def dot(u, v):
    return u[X] * v[X] + u[Y] * v[Y] + u[Z] * v[Z]


@njit
def tip_and_axis(links, joints, length):
    """(x, y, z, i, j, k) of one pose, joints (m,)."""
    x, y, z = -length * links.spindle[X], -length * links.spindle[Y], -length * links.spindle[Z]
    i, j, k = links.spindle[X], links.spindle[Y], links.spindle[Z]
    for n in range(len(links.order) - 1, -1, -1):
        c = links.order[n]
        u, p = links.direction[c], links.pivot[c]
        if links.is_rotary[c]:
            sine, cosine = fixed.sin(joints[c]), fixed.cos(joints[c])
            x, y, z = turned(x - p[X], y - p[Y], z - p[Z], u, sine, cosine)
            x, y, z = x + p[X], y + p[Y], z + p[Z]
            i, j, k = turned(i, j, k, u, sine, cosine)
        else:
            x, y, z = x + joints[c] * u[X], y + joints[c] * u[Y], z + joints[c] * u[Z]
    return x, y, z, i, j, k


@njit
def _forward(links, joints, lengths):
    tips, axes = np.empty((len(joints), 3)), np.empty((len(joints), 3))
    for n in range(len(joints)):
        tips[n, X], tips[n, Y], tips[n, Z], axes[n, X], axes[n, Y], axes[n, Z] = tip_and_axis(links, joints[n], lengths[n])
    return tips, axes


@njit
def bearings_of(wrist, v, out):
    """PHI .. ACROSS of one axis into out (5,); beyond both cones h is 0."""
    along, toward, beside = dot(v, wrist.u1), dot(v, wrist.e1), dot(v, wrist.e2)
    across = np.sqrt(toward * toward + beside * beside)
    out[ALONG], out[ACROSS] = along, across
    out[PHI] = fixed.arctan2(beside, toward)
    if wrist.count < 2:
        out[PSI], out[CHI] = wrist.zero, 0.0
        return
    m = (wrist.c2 - wrist.g * along) / wrist.side
    h2 = (across - m) * (across + m)
    h = np.sqrt(h2) if h2 > 0.0 else 0.0
    out[PSI] = fixed.arctan2(h, m)
    out[CHI] = fixed.arctan2(h, (along - wrist.g * wrist.c2) / wrist.side)


@njit
def put_angles(wrist, bearings, sign, out):
    """The rotaries' angles of one branch (sign +1 or -1), not wrapped, into out (rotaries,)."""
    if wrist.count == 1:
        out[FIRST - LINEARS] = bearings[PHI] - bearings[PSI]
    elif wrist.count == 2:
        out[FIRST - LINEARS] = bearings[PHI] - sign * bearings[PSI]
        out[SECOND - LINEARS] = -sign * bearings[CHI] - wrist.zero


@njit(inline="always")
def wrapped(angle):
    """The same angle in -pi .. pi."""
    return angle - FULL * np.rint(angle / FULL)


@njit
def _bearings(wrist, links, axes):
    n = len(axes)
    out, across, miss = np.empty((n, 5)), np.empty(n), np.empty(n)
    joints = np.zeros(len(links.order))
    for r in range(n):
        bearings_of(wrist, axes[r], out[r])
        across[r] = out[r, ACROSS]
        put_angles(wrist, out[r], 1.0, joints[LINEARS:])
        _, _, _, i, j, k = tip_and_axis(links, joints, 0.0)
        x, y, z = i - axes[r, X], j - axes[r, Y], k - axes[r, Z]
        miss[r] = 2.0 * fixed.arcsin(min(0.5 * np.sqrt(x * x + y * y + z * z), 1.0))
    return out, across, miss


@njit
def _angles(wrist, bearings):
    out = np.empty((len(bearings), 2, wrist.count))
    for r in range(len(bearings)):
        for side in range(2):
            put_angles(wrist, bearings[r], 1.0 - 2.0 * side, out[r, side])
            for k in range(wrist.count):
                out[r, side, k] = wrapped(out[r, side, k])
    return out


@njit
def place(links, tip, joints, length, columns):
    """Fill joints X Y Z so that the tip stands at `tip`, the rotaries' angles being in joints (m,); columns: (3, 3) scratch.

    Returns the volume that the directions of X, Y and Z span, 1 where they are square.
    """
    for c in range(LINEARS):
        joints[c] = 0.0
    x, y, z, _, _, _ = tip_and_axis(links, joints, length)
    for c in range(LINEARS):
        put_turned_direction(links, joints, c, columns[c])
    a, b, d = columns[X], columns[Y], columns[Z]
    x, y, z = tip[X] - x, tip[Y] - y, tip[Z] - z
    bd, da, ab = cross(b, d), cross(d, a), cross(a, b)
    volume = a[X] * bd[X] + a[Y] * bd[Y] + a[Z] * bd[Z]
    joints[X] = (x * bd[X] + y * bd[Y] + z * bd[Z]) / volume
    joints[Y] = (x * da[X] + y * da[Y] + z * da[Z]) / volume
    joints[Z] = (x * ab[X] + y * ab[Y] + z * ab[Z]) / volume
    return volume


@njit(inline="always")
def cross(u, v):
    return u[Y] * v[Z] - u[Z] * v[Y], u[Z] * v[X] - u[X] * v[Z], u[X] * v[Y] - u[Y] * v[X]


@njit
def put_turned_direction(links, joints, c, out):
    """Direction of joint c in the part's frame: turned by the rotaries between the part and it."""
    x, y, z = links.direction[c, X], links.direction[c, Y], links.direction[c, Z]
    is_nearer = False
    for n in range(len(links.order) - 1, -1, -1):
        k = links.order[n]
        if is_nearer and links.is_rotary[k]:
            x, y, z = turned(x, y, z, links.direction[k], fixed.sin(joints[k]), fixed.cos(joints[k]))
        is_nearer = is_nearer or k == c
    out[X], out[Y], out[Z] = x, y, z


@njit
def _placed(links, tips, angles, lengths):
    out, columns, volume = np.empty((len(tips), len(links.order))), np.empty((3, 3)), np.empty(len(tips))
    for n in range(len(tips)):
        for k in range(angles.shape[1]):
            out[n, LINEARS + k] = angles[n, k]
        volume[n] = place(links, tips[n], out[n], lengths[n], columns)
    return out, volume
