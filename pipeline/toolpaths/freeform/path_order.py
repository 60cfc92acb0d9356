"""In which order and from which end paths are cut: the nearest next, sooner one that is reached without lifting."""

from dataclasses import replace

import numpy as np

NEAREST = 8                 # paths looked at before one is chosen
LOOKS = 17                  # places along a straight way that are asked whether they lie in the region
LIFT_MM = 40.0              # a lift counts as so much way


def ordered_paths(paths, field, link_mm, is_one_way, bearing=None):
    """The same paths in the order they are cut, turned to run from where the tool enters.

    Args:
        paths: list of TipPath; the first is cut first.
        field: TipField, for the region.
        link_mm: longest way along the surface from path to path, in plan.
        is_one_way: paths keep their direction; closed ones begin anywhere all the same.
        bearing: "step-up": the lowest path first, as they lie one above the other; "uphill": open paths run from their lower
            end; None: the nearest next.
    Returns:
        list of TipPath.
    """
    if not paths:
        return []
    if bearing == "step-up":
        return _one_above_the_other(paths, is_one_way)
    if bearing == "uphill":
        paths, is_one_way = [_uphill(p) for p in paths], True
    spot, owner, row = _entries(paths, is_one_way)
    open_ = np.ones(len(owner), bool)
    out = [paths[0]]
    open_[owner == 0] = False
    while open_.any():
        k = _next(out[-1].tips_mm[-1, :2], spot, owner, open_, field, link_mm)
        open_[owner == owner[k]] = False
        out.append(_entered(paths[owner[k]], row[k]))
    return out


def _one_above_the_other(paths, is_one_way):
    """Paths by their mean height, each entered where the one before ends, as near as it may be."""
    heights = [float(np.cumsum(p.tips_mm[:, 2])[-1] / len(p.tips_mm)) for p in paths]
    out = []
    for k in np.argsort(np.round(heights, 6), kind="stable").tolist():
        if out:
            spot, _, row = _entries([paths[k]], is_one_way)
            out.append(_entered(paths[k], row[np.linalg.norm(spot - out[-1].tips_mm[-1, :2], axis=1).argmin()]))
        else:
            out.append(paths[k])
    return out


def _uphill(path):
    """The path begun at its lower end; closed ones stay."""
    t = path.tips_mm
    return path if path.is_closed or t[-1, 2] >= t[0, 2] else replace(path, tips_mm=t[::-1])


def _entries(paths, is_one_way):
    """Where paths may be entered: plan points (n, 2), path (n,), row of its tips (n,)."""
    spot, owner, row = [], [], []
    for k, p in enumerate(paths):
        last = len(p.tips_mm) - 1
        rows = np.arange(last) if p.is_closed else np.array([0] if is_one_way else [0, last])
        spot.append(p.tips_mm[rows, :2])
        owner.append(np.full(len(rows), k))
        row.append(rows)
    return np.vstack(spot), np.concatenate(owner), np.concatenate(row)


def _entered(path, row):
    """The path begun at a row: closed ones turned round to it, open ones reversed at their last."""
    t = path.tips_mm
    if path.is_closed:
        return replace(path, tips_mm=np.vstack([t[row:-1], t[:row + 1]]))
    return path if row == 0 else replace(path, tips_mm=t[::-1])


def _next(here, spot, owner, open_, field, link_mm):
    """Index of the cheapest entry among the nearest few."""
    rows = np.flatnonzero(open_)
    distance = np.linalg.norm(spot[rows] - here, axis=1)
    near = np.argsort(distance, kind="stable")[:NEAREST]
    near = near[np.lexsort((rows[near], np.round(distance[near], 9)))]
    cost = [distance[k] + (0.0 if distance[k] <= link_mm and stays_inside(field, here, spot[rows[k]]) else LIFT_MM)
            for k in near]
    return rows[near[int(np.argmin(cost))]]


def stays_inside(field, start_xy, end_xy):
    """The straight way lies in the region, as far as the grid tells (its next node counts)."""
    xy = start_xy + np.linspace(0.0, 1.0, LOOKS)[:, None] * (end_xy - start_xy)
    return bool(field.is_near(xy).all())
