"""Posted moves broken into the pieces that the kernels understand: straight lines and short arcs.

A piece is a row of twelve numbers, cutter tip in the WCS, mm:

    X0 Y0 Z0, X1 Y1 Z1          both ends (arcs: ordered so that u grows; level arcs: counter-clockwise)
    IN_YZ                       arcs: 0 when the horizontal axis u of their plane is x (G18), 1 when it is y (G19)
    CENTER_U, CENTER_V, RADIUS  arcs: v is z; level arcs: u is x, v is y
    SIDE                        arcs: +1 above their centre, -1 below it
    FORM                        LINE; ARC in a vertical plane; LEVEL_ARC at one height

Arcs of a ball in a vertical plane can stay arcs, and those of every upright cutter at one height (`kept_by`).  No piece of them is
longer than ARC_ANGLE_RAD or leads past a quarter of its circle.  All others become chords.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import SimulationError

SAGITTA_MM = 2e-5         # chords of arcs that cannot stay arcs; also half the radius step of a spiral's pieces
ARC_ANGLE_RAD = np.pi / 12    # longest arc piece: keeps the bounding planes of the tree tight
LEVEL_SAGITTA_MM = 0.05   # of one at one height: the replay looks at its chord first, the tool larger by so much
QUARTER = np.pi / 2
X0, Y0, Z0, X1, Y1, Z1, IN_YZ, CENTER_U, CENTER_V, RADIUS, SIDE, FORM = range(12)
LINE, ARC, LEVEL_ARC = 0.0, 1.0, 2.0
MOST_PARTS = 4096         # of one straight move: longer ones lead out of every machine, and need no tight boxes
MOST_CHORDS = 1_000_000   # of one arc: more are turns on the spot, or a slip of the pen


@dataclass(frozen=True, eq=False, kw_only=True)
class Pieces:
    """Pieces in the order in which they are cut, and how far they may lie off the posted path."""

    geometry: np.ndarray      # (m, 12)
    row: np.ndarray           # (m,) row of PostedMoves
    error_mm: float           # largest distance between a piece and the posted arc

    def __post_init__(self):
        object.__setattr__(self, "geometry", frozen(self.geometry, (None, 12), "geometry", is_handed_over=True))
        object.__setattr__(self, "row", frozen(self.row, (len(self.geometry),), "row", np.int64))

    def __len__(self):
        return len(self.row)


def kept_by(cutter):
    """Forms besides LINE that an upright cutter's pieces can have, see `pieces_of`."""
    return (ARC, LEVEL_ARC) if cutter.type == "ball" else (LEVEL_ARC,)


def pieces_of(posted, rows, kept=(), longest_mm=np.inf, deepest_mm=np.inf):
    """Pieces of the given moves, in order.

    Args:
        posted: PostedMoves.
        rows: (k,) rows with known start and end, growing.
        kept: forms besides LINE that may come out: ARC, LEVEL_ARC.  All other arcs become chords.
        longest_mm: lines and arcs are split so that no piece is longer, seen from above.
        deepest_mm: lines are split so that no piece drops by more.
    Raises:
        SimulationError: an arc without a radius, or with ends of clearly different radius.
    """
    rows = np.asarray(rows, dtype=np.int64)
    is_line = (posted.kind[rows] == Kind.RAPID) | (posted.kind[rows] == Kind.FEED)
    if is_line.all():
        geometry, row, error = _lines(posted.start_mm[rows], posted.end_mm[rows], rows, longest_mm, deepest_mm)
        return Pieces(geometry=geometry, row=row, error_mm=error)
    arcs = Arcs(posted, rows[~is_line])
    exact = np.isin(np.where(arcs.plane == Plane.XY, LEVEL_ARC, ARC), kept) & (np.abs(arcs.rise) < 1e-9)
    parts = [_lines(posted.start_mm[rows[is_line]], posted.end_mm[rows[is_line]], rows[is_line],
                    longest_mm, deepest_mm),
             _chords(arcs.only(~exact), longest_mm, deepest_mm),
             _quarters(arcs.only(exact), longest_mm)]
    geometry, row = (np.concatenate(column) for column in list(zip(*parts))[:2])
    order = np.argsort(row, kind="stable")
    return Pieces(geometry=geometry[order], row=row[order], error_mm=max(p[2] for p in parts))


class Arcs:
    """Arcs in their own plane: start and end angle, radii at both, rise along the third axis."""

    def __init__(self, posted, rows):
        self.row, self.plane, self.turns = rows, posted.plane[rows], posted.turns[rows]
        axes = np.array([Plane(p).axes for p in range(3)])[self.plane].reshape(-1, 3)
        pick = lambda points: np.take_along_axis(points[rows], axes, axis=1)
        start, end, center = pick(posted.start_mm), pick(posted.end_mm), pick(posted.center_mm)
        self.axes, self.center = axes, center[:, :2]
        self.level, self.rise = start[:, 2], end[:, 2] - start[:, 2]
        d0, d1 = start[:, :2] - self.center, end[:, :2] - self.center
        self.radius0, self.radius1 = fixed.hypot(*d0.T), fixed.hypot(*d1.T)
        self._refuse_bad_radii(posted)
        self.angle0 = fixed.arctan2(d0[:, 1], d0[:, 0])
        clockwise = posted.kind[rows] == Kind.ARC_CW
        swept = np.where(clockwise, -1.0, 1.0) * (fixed.arctan2(d1[:, 1], d1[:, 0]) - self.angle0)
        swept = np.where(np.all(start[:, :2] == end[:, :2], axis=1), 0.0, swept) % (2 * np.pi)
        swept = np.where(swept == 0.0, 2 * np.pi, swept) + 2 * np.pi * self.turns
        self.angle1 = self.angle0 + np.where(clockwise, -swept, swept)

    def _refuse_bad_radii(self, posted):
        gap = np.abs(self.radius1 - self.radius0)
        bad = ~((self.radius0 > 1e-9) & (self.radius1 > 1e-9) & (gap < 0.05))
        if bad.any():
            k = int(np.flatnonzero(bad)[0])
            raise SimulationError(
                f"line {posted.line[self.row[k]]}: arc radius {self.radius0[k]:.4f} mm at its start, "
                f"{self.radius1[k]:.4f} mm at its end; give a centre that fits both", rows=self.row[bad])

    def only(self, mask):
        """The same with the chosen arcs alone."""
        chosen = object.__new__(Arcs)
        chosen.__dict__.update({name: value[mask] for name, value in self.__dict__.items()})
        return chosen

    def __len__(self):
        return len(self.row)

    def points(self, arc, angle):
        """(n, 3) tips of arc number `arc` (n,) at `angle` (n,): a spiral between both radii."""
        share = (angle - self.angle0[arc]) / (self.angle1 - self.angle0)[arc]
        radius = self.radius0[arc] + share * (self.radius1 - self.radius0)[arc]
        local = np.column_stack([self.center[arc, 0] + radius * fixed.cos(angle),
                                 self.center[arc, 1] + radius * fixed.sin(angle),
                                 self.level[arc] + share * self.rise[arc]])
        out = np.empty_like(local)
        np.put_along_axis(out, self.axes[arc], local, axis=1)
        return out


def chorded(geometry):
    """Pieces (k, 12) with arcs broken into chords whose sagitta stays below SAGITTA_MM, and the row (k,) of `geometry` of each."""
    is_arc, m = geometry[:, FORM] != LINE, np.arange(len(geometry))
    u = np.where(geometry[:, IN_YZ] == 0, X0, Y0)
    v = np.where(geometry[:, FORM] == LEVEL_ARC, Y0, Z0)
    centre_u, centre_v, radius = geometry[:, CENTER_U], geometry[:, CENTER_V], np.where(is_arc, geometry[:, RADIUS], 1.0)
    first, last = (fixed.arctan2(geometry[m, end + v] - centre_v, geometry[m, end + u] - centre_u) for end in (X0, X1))
    turn = np.where(is_arc, (last - first + np.pi) % (2 * np.pi) - np.pi, 0.0)
    counts = part_counts(np.abs(turn), 2 * fixed.arccos(1 - np.minimum(SAGITTA_MM / radius, 0.5)))
    whole, part = repeated_parts(counts)
    own, of = geometry[whole], counts[whole]

    def tips(k):
        angle = first[whole] + k / of * turn[whole]
        between, n = own[:, :X1].copy(), np.arange(len(own))
        between[n, u[whole]] = centre_u[whole] + radius[whole] * fixed.cos(angle)
        between[n, v[whole]] = centre_v[whole] + radius[whole] * fixed.sin(angle)
        return np.where((k == 0)[:, None], own[:, :X1], np.where((k == of)[:, None], own[:, X1:IN_YZ], between))
    return np.column_stack([tips(part), tips(part + 1), np.zeros((len(whole), 6))]), whole


def middles(geometry):
    """(k, 3) middles of lines and level arcs (k, 12)."""
    middle, is_level = (geometry[:, :X1] + geometry[:, X1:IN_YZ]) / 2, geometry[:, FORM] == LEVEL_ARC
    arcs = geometry[is_level]
    out = middle[is_level, :Z0] - arcs[:, CENTER_U:RADIUS]
    middle[is_level, :Z0] = arcs[:, CENTER_U:RADIUS] + out * (arcs[:, RADIUS] / fixed.hypot(*out.T))[:, None]
    return middle


def repeated_parts(counts):
    """(index of the whole, index of the part) for `counts` parts of each whole."""
    whole = np.repeat(np.arange(len(counts)), counts)
    part = np.arange(len(whole)) - np.repeat(np.cumsum(counts) - counts, counts)
    return whole, part


def part_counts(extent, longest):
    """(n,) whole number of parts, at least 1, so that none is longer."""
    return np.maximum(1, np.ceil(extent / longest - 1e-9)).astype(np.int64)


def _refuse_endless(counts, row):
    if counts.max(initial=0) > MOST_CHORDS:
        bad = np.flatnonzero(counts > MOST_CHORDS)
        raise SimulationError(f"an arc needs {counts[bad[0]]:,} straight pieces, more than {MOST_CHORDS:,}: give it fewer turns "
                              "(P), or a radius that the machine can run", rows=row[bad])


def _lines(start, end, row, longest_mm, deepest_mm):
    counts = np.maximum(part_counts(fixed.hypot(*(end - start)[:, :2].T), longest_mm),
                        part_counts(np.maximum(start[:, 2] - end[:, 2], 0.0), deepest_mm)).clip(max=MOST_PARTS)
    if counts.max(initial=1) == 1:
        return np.concatenate([start, end, np.zeros((len(start), 6))], axis=1), row, 0.0
    whole, part = repeated_parts(counts)
    step = (end - start)[whole] / counts[whole, None]
    geometry = np.zeros((len(whole), 12))
    geometry[:, :3] = start[whole] + part[:, None] * step
    last = part == counts[whole] - 1
    geometry[:, 3:6] = np.where(last[:, None], end[whole], start[whole] + (part + 1)[:, None] * step)
    return geometry, row[whole], 0.0


def _chords(arcs, longest_mm, deepest_mm):
    """Arcs as chords whose sagitta stays below SAGITTA_MM; their ends lie on the arc."""
    if not len(arcs):
        return np.zeros((0, 12)), np.zeros(0, np.int64), 0.0
    radius = np.maximum(arcs.radius0, arcs.radius1)
    widest = 2 * fixed.arccos(1 - np.minimum(SAGITTA_MM / radius, 0.5))
    counts = part_counts(np.abs(arcs.angle1 - arcs.angle0), widest)
    _refuse_endless(counts, arcs.row)
    whole, part = repeated_parts(counts)
    at = lambda k: arcs.points(whole, arcs.angle0[whole] + k / counts[whole] * (arcs.angle1 - arcs.angle0)[whole])
    geometry, piece, _ = _lines(at(part), at(part + 1), arcs.row[whole], longest_mm, deepest_mm)
    return geometry, piece, SAGITTA_MM


def _quarters(arcs, longest_mm):
    """Arcs at one height, or in vertical planes, as circular pieces within one quarter of their circle each."""
    if not len(arcs):
        return np.zeros((0, 12)), np.zeros(0, np.int64), 0.0
    low, high = np.minimum(arcs.angle0, arcs.angle1), np.maximum(arcs.angle0, arcs.angle1)
    first, last = np.floor(low / QUARTER) + 1, np.ceil(high / QUARTER) - 1
    quarters = np.maximum(last - first + 1, 0).astype(np.int64) + 1
    _refuse_endless(quarters, arcs.row)
    whole, part = repeated_parts(quarters)
    start = np.where(part == 0, low[whole], (first[whole] + part - 1) * QUARTER)
    stop = np.minimum((first[whole] + part) * QUARTER, high[whole])
    per_rad = np.abs((arcs.radius1 - arcs.radius0) / (arcs.angle1 - arcs.angle0))[whole]
    width = stop - start
    counts = np.maximum(part_counts(width, ARC_ANGLE_RAD), part_counts(width * arcs.radius0[whole], longest_mm))
    counts = np.maximum(counts, part_counts(width * per_rad, 2 * SAGITTA_MM))
    bent = part_counts(width, 2 * fixed.arccos(1 - np.minimum(LEVEL_SAGITTA_MM / arcs.radius0[whole], 0.5)))
    counts = np.maximum(counts, np.where(arcs.plane[whole] == Plane.XY, bent, 1))
    _refuse_endless(np.bincount(whole, counts).astype(np.int64), arcs.row)
    parent, k = repeated_parts(counts)
    a0 = start[parent] + k * width[parent] / counts[parent]
    a1 = start[parent] + (k + 1) * width[parent] / counts[parent]
    error = float((width * per_rad / counts).max()) / 2
    return _arc_rows(arcs, whole[parent], a0, a1), arcs.row[whole[parent]], error


def _arc_rows(arcs, arc, a0, a1):
    """Rows of arc pieces between two angles, with the mean radius of the spiral there."""
    share = ((a0 + a1) / 2 - arcs.angle0[arc]) / (arcs.angle1 - arcs.angle0)[arc]
    radius = arcs.radius0[arc] + share * (arcs.radius1 - arcs.radius0)[arc]
    is_zx, is_xy = arcs.plane[arc] == Plane.ZX, arcs.plane[arc] == Plane.XY
    u_of = lambda a: np.where(is_zx, fixed.sin(a), fixed.cos(a))
    v_of = lambda a: np.where(is_zx, fixed.cos(a), fixed.sin(a))
    center_u = np.where(is_zx, arcs.center[arc, 1], arcs.center[arc, 0])
    center_v = np.where(is_zx, arcs.center[arc, 0], arcs.center[arc, 1])
    swap = (u_of(a0) > u_of(a1)) & ~is_xy
    a0, a1 = np.where(swap, a1, a0), np.where(swap, a0, a1)
    geometry = np.zeros((len(arc), 12))
    for end, a in ((X0, a0), (X1, a1)):
        u, v = center_u + radius * u_of(a), center_v + radius * v_of(a)
        geometry[:, end] = np.where(is_zx | is_xy, u, arcs.level[arc])
        geometry[:, end + 1] = np.where(is_xy, v, np.where(is_zx, arcs.level[arc], u))
        geometry[:, end + 2] = np.where(is_xy, arcs.level[arc], v)
    geometry[:, IN_YZ] = arcs.plane[arc] == Plane.YZ
    geometry[:, CENTER_U], geometry[:, CENTER_V], geometry[:, RADIUS] = center_u, center_v, radius
    geometry[:, SIDE] = np.where(is_xy, 0.0, np.where(v_of((a0 + a1) / 2) > 0, 1.0, -1.0))
    geometry[:, FORM] = np.where(is_xy, LEVEL_ARC, ARC)
    return geometry
