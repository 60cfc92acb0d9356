"""Waterlines cut to where the cutter touches what is wanted: passes round walls, at constant height."""

import numpy as np

from cuspline.toolpaths.freeform.plane_curves import CurveScale, PlaneCurve
from cuspline.toolpaths.freeform.tip_paths import TipPath
from cuspline.values.arrays import runs_of

SHORTEST_SHARE = 0.5        # of the spacing: shorter runs are left out


def wall_paths(waterlines, touches, spacing_mm):
    """Paths along waterlines, from the top.

    Args:
        waterlines: sequence of waterline.Waterline.
        touches: function tips (n, 3) -> (n,) bool: the cutter there touches a face wanted.
        spacing_mm: how closely that is asked along the lines; runs end that exactly.
    Returns:
        list of TipPath; a loop that is wanted all round is closed.
    """
    lines = [line for line in waterlines if len(line.tip_mm) > 1]
    if not lines:
        return []
    scale = CurveScale.of([PlaneCurve(xy_mm=line.tip_mm[:, :2], is_closed=line.is_closed) for line in lines])
    along, curve = scale.stations(spacing_mm)
    heights = np.array([line.height_mm for line in lines])
    tips = np.column_stack([scale.at(along), heights[curve]])
    wanted = touches(tips)
    corner = np.isin(along, scale.along_mm)
    paths = []
    for k, line in enumerate(lines):
        mine = slice(*np.searchsorted(curve, [k, k + 1]))
        paths += _paths_of(tips[mine], wanted[mine], corner[mine], line.is_closed, k, SHORTEST_SHARE * spacing_mm)
    return paths


def _paths_of(tips, wanted, corner, is_closed, curve, shortest_mm):
    """Runs of wanted stations of one line; of the stations between its own points only the ends of runs stay."""
    if wanted.all():
        return [TipPath(tips_mm=tips[corner], is_closed=is_closed, curve=curve)]
    if not wanted.any():
        return []
    if is_closed:               # its last station is its first: begin behind an unwanted one
        first = int(np.argmin(wanted[:-1]))
        tips, wanted, corner = (np.concatenate([a[first:-1], a[:first + 1]]) for a in (tips, wanted, corner))
    paths = []
    for low, high in runs_of(wanted):
        keep = corner[low:high].copy()
        keep[[0, -1]] = True
        path = TipPath(tips_mm=tips[low:high][keep], is_closed=False, curve=curve)
        if high - low > 1 and path.length_mm > shortest_mm:
            paths.append(path)
    return paths
