"""From curves in plan to tip paths: exact tips, as few as the tolerance allows, cut to the region.

Between its points a path is straight and lies nowhere lower than the tolerance below the lowered cutter.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.toolpaths.freeform.plane_curves import CurveScale
from cuspline.toolpaths.freeform.tip_merging import merged_rows
from cuspline.toolpaths.freeform.tip_sampling import BULGE_SHARE, dense_tips, quarter_length_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

BORDER_MM = 1e-5            # how exactly a path ends at the border of the region
RUN_PITCHES = 0.5           # of the grid: runs longer than this are found, corners of the region for example
SHORTEST_MM = 1e-3          # runs shorter than this are left out


@dataclass(frozen=True, eq=False, kw_only=True)
class TipPath:
    """One pass: straight moves from tip to tip, part frame; a closed one ends where it begins."""

    tips_mm: np.ndarray         # (k, 3)
    is_closed: bool
    curve: int                  # index of the plane curve it follows

    def __post_init__(self):
        object.__setattr__(self, "tips_mm", frozen(self.tips_mm, (None, 3), "tips_mm"))

    @property
    def length_mm(self):
        return float(np.linalg.norm(np.diff(self.tips_mm, axis=0), axis=1).sum())


@dataclass(frozen=True, kw_only=True)
class PathRules:
    """How closely paths follow the part."""

    tolerance_mm: float         # largest gouge (vertical) and largest air (square to the move) of the path
    lateral_mm: float           # how far a move may leave its curve in plan
    bridge_mm: float            # gaps in the region are crossed when the way over them is no longer

    def __post_init__(self):
        if not (self.tolerance_mm > 0 and self.lateral_mm >= 0 and self.bridge_mm >= 0):
            raise ToolpathError(f"a path needs a tolerance above zero, lateral and bridge lengths not below it; given: "
                                f"{self.tolerance_mm}, {self.lateral_mm} and {self.bridge_mm} mm")


def tip_paths(curves, field, rules):
    """Tip paths along plane curves, inside the region.

    Args:
        curves: sequence of PlaneCurve.
        field: TipField.
        rules: PathRules.
    Returns:
        list of TipPath in the order of the curves, along each curve in its direction.
    """
    quarter = quarter_length_mm(field.dropper, rules.tolerance_mm)
    curves = _opened(list(curves), field, 4 * quarter)
    if not curves:
        return []
    scale = CurveScale.of(curves)
    along, curve = scale.stations(4 * quarter)
    along, run, curve_of_run = _runs(scale, along, curve, field)
    if not len(along):
        return []
    dense = dense_tips(scale, field.dropper, along, run, rules.tolerance_mm)
    if not len(dense.run):
        return []
    rows = merged_rows(dense, field.dropper, rules.tolerance_mm, rules.lateral_mm)
    run = dense.run[rows]
    first = np.flatnonzero(np.diff(run, prepend=-1))
    return _bridged(np.split(dense.tip_mm[rows], first[1:]), curve_of_run[run[first]], curves, field.dropper, quarter, rules)


def _inside(scale, along, field):
    xy = scale.at(along)
    return field.holds(xy, field.dropper.contacts(xy))


def _opened(curves, field, spacing):
    """Closed curves that leave the region begin outside it."""
    rings = [k for k, c in enumerate(curves) if c.is_closed]
    if not rings:
        return curves
    scale = CurveScale.of([curves[k] for k in rings])
    along, curve = scale.stations(spacing)
    outside = ~_inside(scale, along, field)
    first = np.full(len(rings), -1)
    rows = np.flatnonzero(outside)[::-1]
    first[curve[rows]] = rows
    starts = scale.along_mm[np.searchsorted(scale.curve, np.arange(len(rings)))]
    out = list(curves)
    for k, row in enumerate(first):
        if row >= 0:
            out[rings[k]] = curves[rings[k]].opened_at(along[row] - starts[k])
    return out


def _runs(scale, along, curve, field):
    """Stations inside the region with exact ends: (along (n,), run (n,), curve of each run)."""
    inside = _inside(scale, along, field)
    along, curve, inside = _with_short_runs(scale, along, curve, inside, field)
    pair = np.flatnonzero((np.diff(curve) == 0) & (np.diff(inside.astype(int)) != 0))
    held, lost = (np.where(inside[pair] == side, along[pair], along[pair + 1]) for side in (True, False))
    while len(pair) and np.abs(held - lost).max() > BORDER_MM:
        middle = (held + lost) / 2
        ok = _inside(scale, middle, field)
        held, lost = np.where(ok, middle, held), np.where(ok, lost, middle)
    s, c = np.concatenate([along[inside], held]), np.concatenate([curve[inside], curve[pair]])
    edge = np.concatenate([np.zeros(inside.sum(), bool), np.ones(len(pair), bool)])
    order = np.lexsort((s, c))
    s, c, edge = s[order], c[order], edge[order]
    lost = np.sort(lost)
    # two stations belong to different runs when a curve's end or a place outside lies between them
    between = np.searchsorted(lost, s[1:]) - np.searchsorted(lost, s[:-1])
    run = np.cumsum(np.r_[True, (np.diff(c) != 0) | (between > 0)][:len(s)]) - 1
    length = np.zeros(run[-1] + 1 if len(run) else 0)
    np.add.at(length, run[1:], np.where(np.diff(run) == 0, np.diff(s), 0.0))
    keep = length[run] > SHORTEST_MM if len(run) else np.zeros(0, bool)
    s, c, run = s[keep], c[keep], run[keep]
    _, first, run = np.unique(run, return_index=True, return_inverse=True)
    return s, run, c[first]


def _with_short_runs(scale, along, curve, inside, field):
    """Stations, curves and flags with more stations where two lie outside and the grid sees the region between."""
    gap = np.flatnonzero((np.diff(curve) == 0) & ~inside[1:] & ~inside[:-1])
    parts = np.maximum(np.ceil(np.diff(along)[gap] / (RUN_PITCHES * field.pitch_mm)).astype(int), 2) - 1
    pair = np.repeat(gap, parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts) + 1
    more = along[pair] + number / (np.repeat(parts, parts) + 1) * (along[pair + 1] - along[pair])
    seen = field.is_near(scale.at(more))
    more, owner = more[seen], curve[pair[seen]]
    order = np.argsort(np.r_[along, more], kind="stable")
    return (np.r_[along, more][order], np.r_[curve, owner][order], np.r_[inside, _inside(scale, more, field)][order])


def _bridged(pieces, curve_of_piece, curves, dropper, quarter, rules):
    """Paths, those of one curve joined over short gaps."""
    paths, growing = [], []
    for k, piece in enumerate(pieces):
        growing.append(piece)
        same = k + 1 < len(pieces) and curve_of_piece[k + 1] == curve_of_piece[k]
        over = _over(piece[-1], pieces[k + 1][0], dropper, quarter, rules) if same else None
        if over is not None:
            growing.append(over)
            continue
        curve = int(curve_of_piece[k])
        paths.append(TipPath(tips_mm=np.vstack(growing), is_closed=curves[curve].is_closed, curve=curve))
        growing = []
    return paths


def _over(start, end, dropper, quarter, rules):
    """Points over a gap: straight in plan, at the height of all there is below; None where that is too far."""
    gap = float(fixed.length((end - start)[:2]))
    if gap >= rules.bridge_mm:
        return None
    share = np.linspace(0.0, 1.0, max(3, int(np.ceil(gap / quarter)) + 1))[1:-1, None]
    below = dropper.tips_mm(start[:2] + share * (end - start)[:2]).max()
    ends = max(start[2], end[2])
    top = ends if below <= ends + 1e-9 else below + BULGE_SHARE * rules.tolerance_mm
    if gap + 2 * top - start[2] - end[2] > rules.bridge_mm:
        return None
    rows = np.array([(*start[:2], top), (*end[:2], top)])
    return rows[[top > start[2], top > end[2]]]
