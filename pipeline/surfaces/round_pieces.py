r"""Pieces of cylinders and cones, stretches of circles: their nearest place to a point, in closed form.

    axis  :        seen along the axis a piece is a sector between two directions; the nearest direction is the point's own
       .  :  |     where that lies between them, else the nearer end.  In that half plane the piece is a straight line, and the
     q    :  |     nearest place on it a foot or an end.  Near the axis, where all pieces are as near, none need be searched.
"""

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_Circle

from cuspline.surfaces.enclosures import S_HIGH, S_LOW, T_HIGH, T_LOW
from cuspline.surfaces.patches import U_HIGH, U_LOW, V_HIGH, V_LOW
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y, Z

# columns: a point of the axis, its direction, the middle's direction out of it, the radius there and how it grows along the axis,
# from which height to which, both ends' directions as their shares along the middle's and square to it
ORIGIN, AXIS, OUT, RADIUS, SLOPE, LOW, HIGH, FIRST_OUT, FIRST_ASIDE, LAST_OUT, LAST_ASIDE = 0, 3, 6, 9, 10, 11, 12, 13, 14, 15, 16
WIDTH = 17
SAME_MM = 1e-9          # corners that lie on one circle, or one straight line of the piece
NARROW_MM = 1e-6        # nearer to its apex a cone has no direction
TWO = np.array([0, 1])


def none(count):
    """(count, 17) rows of pieces that are not round: their radius is 0."""
    return np.zeros((count, WIDTH))


def of_face(face, patches, index, patch, box):
    """(n, 17) rows of pieces of a brep.Face.

    Args:
        patches: PatchSet.   index: of the face.   patch: (n,) of its patches.   box: (n, 4) local rectangles.
    """
    if face.kind not in ("cylinder", "cone") or not len(patch):
        return none(len(patch))
    surface = face.adaptor.Cylinder() if face.kind == "cylinder" else face.adaptor.Cone()
    position, span = surface.Axis(), patches.span[patch]
    s, t = box[:, [S_LOW, S_LOW, S_HIGH, S_HIGH]], box[:, [T_LOW, T_HIGH, T_LOW, T_HIGH]]
    u = (span[:, [U_LOW]] + span[:, [U_HIGH]] + s * (span[:, [U_HIGH]] - span[:, [U_LOW]])) / 2
    v = (span[:, [V_LOW]] + span[:, [V_HIGH]] + t * (span[:, [V_HIGH]] - span[:, [V_LOW]])) / 2
    corners = patches.derivatives(index, u.ravel(), v.ravel())[:, 0].reshape(-1, 4, 3)
    return _rows(_vector(position.Location()), _vector(position.Direction()), corners)


def of_edge(edge, powers, box):
    """(n, 17) rows of stretches of one span of an edge.   powers: (degree + 1, 4) of its curve.   box: (n, 4)."""
    curve = BRepAdaptor_Curve(edge)
    if curve.GetType() != GeomAbs_Circle:
        return none(len(box))
    position, s = curve.Circle().Axis(), box[:, [S_LOW, S_HIGH]]
    sums = np.zeros((len(box), 2, 4))
    for row in powers[::-1]:
        sums = sums * s[..., None] + row
    ends = sums[..., :3] / sums[..., 3:]
    return _rows(_vector(position.Location()), _vector(position.Direction()), ends[:, [0, 0, 1, 1]])


def _vector(p):
    return np.array([p.X(), p.Y(), p.Z()])


def _rows(point, axis, corners):
    """Rows of pieces by their corners (n, 4, 3): both ends of one side, then of the other; of neither kind: radius 0."""
    way = corners - point
    high = fixed.matmul(way, axis)
    out = way - high[..., None] * axis
    radius = np.sqrt((out * out).sum(axis=2))
    # whichever parameter runs round: sides are straight lines of the piece, or circles
    rise = lambda i, j: np.abs(high[:, i] - high[:, j])
    turned = rise(0, 1) + rise(2, 3) + SAME_MM < rise(0, 2) + rise(1, 3)
    order = np.where(turned[:, None], [0, 2, 1, 3], [0, 1, 2, 3])
    rows = np.arange(len(corners))[:, None]
    high, radius, out = high[rows, order], radius[rows, order], out[rows, order]
    wide = radius[:, TWO].argmax(axis=1)
    first, last = (_units(out[rows[:, 0], wide + k], radius[rows[:, 0], wide + k]) for k in (0, 2))
    middle = _units(first + last, np.sqrt(((first + last) ** 2).sum(axis=1)))
    aside = np.cross(axis, middle)
    a, b = ((d * aside).sum(axis=1) for d in (first, last))
    swap = (a > b)[:, None]
    first, last = np.where(swap, last, first), np.where(swap, first, last)
    low, far = high.min(axis=1), high.max(axis=1)
    slope = np.divide(radius[:, 1] - radius[:, 0], high[:, 1] - high[:, 0], out=np.zeros(len(high)), where=far - low > SAME_MM)
    is_round = ((np.abs(high[:, TWO] - high[:, TWO + 2]).max(axis=1) < SAME_MM) & (np.abs(radius[:, TWO] - radius[:, TWO + 2]).max(
        axis=1) < SAME_MM) & (radius.min(axis=1) > NARROW_MM) & ((first * last).sum(axis=1) > 0.0))
    share = lambda d, way: (d * way).sum(axis=1)
    made = np.column_stack([np.broadcast_to(point, middle.shape), np.broadcast_to(axis, middle.shape), middle,
                            radius[:, 0] - slope * high[:, 0], slope, low, far, share(first, middle), share(first, aside),
                            share(last, middle), share(last, aside)])
    made[~is_round] = 0.0
    return made


def _units(vectors, length):
    """(n, 3) of length one; as they are where they have none."""
    return np.divide(vectors, np.reshape(length, (-1, 1)), out=np.zeros_like(vectors), where=np.reshape(length, (-1, 1)) > 0.0)


@njit(error_model="numpy")
def least_square(row, q, foot):
    """Square of the distance from a point (3,) to a piece, its nearest place into foot (3,).   row: (17,) of it."""
    x, y, z = q[X] - row[ORIGIN + X], q[Y] - row[ORIGIN + Y], q[Z] - row[ORIGIN + Z]
    ax, ay, az = row[AXIS + X], row[AXIS + Y], row[AXIS + Z]
    ox, oy, oz = row[OUT + X], row[OUT + Y], row[OUT + Z]
    bx, by, bz = ay * oz - az * oy, az * ox - ax * oz, ax * oy - ay * ox
    high, out, aside = x * ax + y * ay + z * az, x * ox + y * oy + z * oz, x * bx + y * by + z * bz
    away = np.sqrt(out * out + aside * aside)
    c, s, near = 1.0, 0.0, 0.0
    if away > 0.0:
        c, s, near = out / away, aside / away, away
    if (row[FIRST_OUT] * aside - row[FIRST_ASIDE] * out < 0.0 or row[LAST_OUT] * aside - row[LAST_ASIDE] * out > 0.0
            or away == 0.0):
        first, last = row[FIRST_OUT] * out + row[FIRST_ASIDE] * aside, row[LAST_OUT] * out + row[LAST_ASIDE] * aside
        c, s, near = row[LAST_OUT], row[LAST_ASIDE], last
        if first > last:
            c, s, near = row[FIRST_OUT], row[FIRST_ASIDE], first
    slope = row[SLOPE]
    at = min(max((high + slope * (near - row[RADIUS])) / (1.0 + slope * slope), row[LOW]), row[HIGH])
    radius = row[RADIUS] + slope * at
    dout, daside, dhigh = radius * c - out, radius * s - aside, at - high
    foot[X] = q[X] + dout * ox + daside * bx + dhigh * ax
    foot[Y] = q[Y] + dout * oy + daside * by + dhigh * ay
    foot[Z] = q[Z] + dout * oz + daside * bz + dhigh * az
    return dout * dout + daside * daside + dhigh * dhigh
