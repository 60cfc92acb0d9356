"""Rest passes: a smaller ball where a larger one was held off by two contacts.

Along a section the smaller ball's chain is compared with the larger ball's: where the larger ball
cannot touch the same contact point, material is left.  On a prismatic part those stretches are cut
by straight strokes along the corner; on any other part in the section planes themselves.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.sections.pass_links import enter, moves_of_passes
from cuspline.toolpaths.sections.profile_passes import planes_across
from cuspline.toolpaths.sections.regions import grouped
from cuspline.toolpaths.sections.section_pieces import CurvePiece, LinePiece
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen, runs_of
from cuspline.values.errors import ToolpathError

HELD_OFF_MM = 5e-4          # the larger ball stays further away than this: not reached
OVERLAP_MM = 0.3            # beyond the stretch, so that both cuts blend
SAMPLE_MM = 0.02


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """A part of a chain that is left: sampled centres, in order, and the exact pieces under them."""

    centers: np.ndarray         # (n, 2)
    contacts: np.ndarray        # (n, 2)
    piece: np.ndarray           # (n,) index of the chain piece each centre lies on
    chain: tuple                # exact pieces cut to the stretch
    owners: tuple

    def __post_init__(self):
        for name in ("centers", "contacts"):
            object.__setattr__(self, name, frozen(getattr(self, name), (None, 2), name))
        object.__setattr__(self, "piece", frozen(self.piece, (len(self.centers),), "piece", int))


def rest_passes(small, large, wanted, box, ridge_mm, rules):
    """Moves of the smaller ball and facts about them.

    Args:
        small, large: ProfilePlanners of the two balls, same section plane, no allowance.
        wanted: face indices to be cut.
        box: (min, max) of the solid.
        ridge_mm: scallop height to choose the step for.
        rules: LinkRules of the smaller ball.
    Returns:
        (Moves, dict of facts).
    Raises:
        ToolpathError: nothing is left for the smaller ball.
    """
    r, k = small.ball_radius_mm, small.plane.across
    step = float(2 * np.sqrt(ridge_mm * (2 * r - ridge_mm)))
    low, high = float(box[0][k]), float(box[1][k])
    if small.centers.general:
        planes = planes_across(low, high, lambda a, b: step)
        moves, count = _in_section_planes(small, large, wanted, box, planes, rules)
    else:
        stretches = left_stretches(small, large, wanted, box, (low + high) / 2)
        moves, count = _along_the_corner(small.plane, stretches, low, high, step, rules)
    return moves, {"stepover_mm": round(step, 6), "ridge_for_step_mm": round(ridge_mm, 6), "passes": count}


def left_stretches(small, large, wanted, box, across):
    """Stretches of the smaller ball's chain over wanted faces that the larger ball leaves, one plane."""
    chain, owners, walls = small.chain(across, *small.extent(*box))
    over, _, _ = large.chain(across, *large.extent(*box))
    columns = [_compared(piece, owner, walls, over, small.ball_radius_mm, large.ball_radius_mm) if owner in wanted
               else None for piece, owner in zip(chain, owners)]
    centers, contacts, left, index = [], [], [], []
    for k, column in enumerate(columns):
        if column is not None:
            centers.append(column[0])
            contacts.append(column[1])
            left.append(column[2])
            index.append(np.full(len(column[0]), k))
    if not centers:
        return []
    centers, contacts, left, index = map(np.concatenate, (centers, contacts, left, index))
    return [_stretch(chain, owners, centers[a:b], contacts[a:b], index[a:b])
            for a, b in _widened_runs(left, centers)]


def _compared(piece, owner, walls, over, small_mm, large_mm):
    """Centres and contacts of the small ball along a piece, and where the large ball is held off."""
    centers, normals = _sampled(piece)
    aside = 0.0
    if normals is None:                     # a wall: the contact lies level with the centre
        wall = next((w for w in walls if w.owner == owner), None)
        if wall is None:
            return None
        normals = np.tile((float(wall.side), 0.0), (len(centers), 1))
        aside = wall.side * 1e-6            # just beside the wall, where only what lies below holds the ball
    contacts = centers - small_mm * normals
    big = contacts + large_mm * normals
    return centers, contacts, _height(over, big[:, 0] + aside) > big[:, 1] + HELD_OFF_MM


def _sampled(piece):
    """Centres and contact normals along a piece, SAMPLE_MM apart; normals None on a vertical line."""
    if isinstance(piece, LinePiece):
        d = piece.end - piece.start
        length = float(fixed.length(d))
        n = max(2, math.ceil(length / SAMPLE_MM) + 1)
        centers = piece.start + np.linspace(0.0, 1.0, n)[:, None] * d
        return centers, None if abs(d[0]) < 1e-9 * length else np.tile((-d[1], d[0]), (n, 1)) / length
    if isinstance(piece, CurvePiece):
        way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(piece.points, axis=0), axis=1))]
        n = max(2, math.ceil(way[-1] / SAMPLE_MM) + 1)
        along = np.interp(np.linspace(0.0, way[-1], n), way, piece.points[:, 0])
        slope = piece.slope_at(along)
        return (np.column_stack([along, piece.up_at(along)]),
                np.column_stack([-slope, np.ones(n)]) / fixed.hypot(1.0, slope)[:, None])
    first, last = (fixed.arctan2(*(p - piece.center)[::-1]) for p in (piece.start, piece.end))
    # over the top angles fall from pi to 0, through the bottom they rise from -pi to 0
    side = 1 if piece.is_over else -1
    first, last = (angle + side * 2 * np.pi if side * angle < -np.pi / 2 else angle for angle in (first, last))
    n = max(2, math.ceil(abs(last - first) * piece.radius / SAMPLE_MM) + 1)
    angles = np.linspace(first, last, n)
    arms = np.column_stack([fixed.cos(angles), fixed.sin(angles)])
    return piece.center + piece.radius * arms, arms if piece.is_over else -arms


def _height(chain, along):
    """Height of an envelope chain over along coordinates."""
    up = np.full(len(along), -np.inf)
    for piece in chain:
        if piece.span[1] - piece.span[0] > 1e-12:
            inside = (along >= piece.span[0] - 1e-9) & (along <= piece.span[1] + 1e-9)
            up[inside] = np.maximum(up[inside], piece.up_at(np.clip(along[inside], *piece.span)))
    return up


def _widened_runs(left, centers):
    """Index ranges of what is left, OVERLAP_MM longer at both ends, merged where they meet."""
    apart = np.linalg.norm(np.diff(centers, axis=0), axis=1)
    apart[apart > 2 * SAMPLE_MM] = 1e6      # pieces between that are not wanted: never bridged
    way = np.r_[0.0, np.cumsum(apart)]
    wide = np.zeros(len(left), bool)
    for first, behind in runs_of(left):
        wide |= (way >= way[first] - OVERLAP_MM) & (way <= way[behind - 1] + OVERLAP_MM)
    gaps = np.flatnonzero(apart > 1e5) + 1
    runs = []
    for a, b in runs_of(wide):
        cuts = np.r_[a, gaps[(gaps > a) & (gaps < b)], b]
        runs += [(c, d) for c, d in zip(cuts[:-1], cuts[1:]) if d - c > 1]
    return runs


def _stretch(chain, owners, centers, contacts, index):
    pieces, names = [], []
    for k in np.unique(index):
        mine = centers[index == k]
        if len(mine) < 2:
            continue
        low, high = mine[0], mine[-1]
        pieces.append(LinePiece(start=low, end=high, owner=owners[k]) if abs(high[0] - low[0]) < 1e-9
                      else chain[k].cut(low[0], high[0]))
        names.append(owners[k])
    return Stretch(centers=centers, contacts=contacts, piece=index, chain=tuple(pieces), owners=tuple(names))


# strokes along the corner of a prismatic part ------------------------------------------------


def _along_the_corner(plane, stretches, low, high, step, rules):
    """Straight strokes across all section planes, a step apart on the surface."""
    parts = [_strokes(plane, s, low, high, step, rules) for s in stretches]
    if not parts:
        raise ToolpathError("rest finish: the larger ball leaves nothing that the smaller one reaches")
    return Moves.joined([p for p, _ in parts]), sum(n for _, n in parts)


def _strokes(plane, stretch, low, high, step, rules):
    rows = _stroke_rows(stretch, step)
    down = np.array([0.0, -rules.ball_radius_mm])
    first = plane.lift(stretch.centers[rows[0]] + down, low)[0]
    writer = MoveWriter(np.r_[first[:2], rules.clearance_z_mm])
    enter(writer, first, rules)
    side = low
    for before, row in zip(np.r_[rows[0], rows[:-1]], rows):
        for k in _way(stretch, before, row):
            writer.feed(plane.lift(stretch.centers[k] + down, side)[0], rules.feed_mm_per_min)
        side = high if side == low else low
        writer.feed(plane.lift(stretch.centers[row] + down, side)[0], rules.feed_mm_per_min)
    writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])
    return writer.moves(), len(rows)


def _stroke_rows(stretch, step):
    """Rows of the strokes: contacts no further apart than a step, corners of the chain always."""
    apart = np.linalg.norm(np.diff(stretch.contacts, axis=0), axis=1)
    apart[np.diff(stretch.piece) != 0] = 0.0        # the contact jumps at a corner, the ball does not
    way = np.r_[0.0, np.cumsum(apart)]
    borders = np.r_[0, np.flatnonzero(np.diff(stretch.piece)) + 1, len(way) - 1]
    rows = []
    for a, b in zip(borders[:-1], borders[1:]):
        n = max(1, int(np.ceil((way[b] - way[a]) / step - 1e-9)))
        rows.append(a + np.searchsorted(way[a:b + 1], np.linspace(way[a], way[b], n + 1)))
    return np.unique(np.clip(np.concatenate(rows), 0, len(way) - 1))


def _way(stretch, before, row):
    """Rows to pass through from one stroke to the next: its end, and all between where the chain is curved."""
    straight = all(isinstance(p, LinePiece) for p in stretch.chain)
    return [row] if straight else range(before, row + 1)


# stretches in the section planes of any other part ---------------------------------------------


def _in_section_planes(small, large, wanted, box, planes, rules):
    """Stretches of neighbouring planes that overlap are cut one after the other."""
    layers = ([(across, s) for s in left_stretches(small, large, wanted, box, across)] for across in planes)
    groups = grouped(layers, lambda a, b: _overlap(a[1], b[1]))
    if not groups:
        raise ToolpathError("rest finish: the larger ball leaves nothing that the smaller one reaches")
    parts = [moves_of_passes([small.fitted_pass(across, list(s.chain), list(s.owners)) for across, s in group],
                             small.plane, rules) for group in groups]
    return Moves.joined(parts), sum(len(g) for g in groups)


def _overlap(a, b):
    """Two stretches lie over a common along range."""
    return a.centers[0, 0] <= b.centers[-1, 0] and b.centers[0, 0] <= a.centers[-1, 0]
