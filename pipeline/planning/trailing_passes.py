r"""Passes back of a cutter that leans one way: where its middle would sink into stock they are turned round.

     <- feed   / axis          `toward` to the right: fed to the left it trails, its bottom goes ahead and down along
              /                the axis as on a ramp of its lead, steeper over a ridge, whose turning adds to that.
        ____ /_                What is higher than its bottom's middle, that does not cut, is in its way.
    ~~~~\__/____~~~~~          Fed to the right the bottom draws away from the stock: no slope is too steep.
"""

from dataclasses import replace
from itertools import chain, count, islice

import numpy as np
from scipy.spatial import cKDTree

from cuspline.program.program import Kind
from cuspline.toolpaths.five_axis.leaning_moves import leaning
from cuspline.toolpaths.freeform.tip_links import as_cut
from cuspline.values import fixed_math as fixed

ROUNDS = 6                  # of turning passes round: one that is turned cuts later what it had cut before
DEEP_MM = 0.03              # of way into stock in one run: the verdict accepts 0.05
BESIDE_SHARE = 0.6          # of the radius: so near beside an earlier contact nothing is left as high as the bottom's middle
LOWER_MM = 0.01             # of the bottom's middle, under the bottom of the cutter when it was near before
CLOSE_SHARE = 0.1           # of the radius: between places of a pass that are looked at
CLOSE_MM = 0.5              # between places of a path that tell which one a contact belongs to
SLOPE_SHARE = 0.98          # of the steepest way that the verdict accepts


def without_plunges(work, runs, link, laid, rules, tool):
    """Runs of TipPaths, those in which the cutter's middle would be sunk into stock turned toward the lean.

    The order stays: in another one, passes would run where what is beside them is not cut yet.

    Args:
        work: PlanningContext.   runs: lists of TipPath.   link: TipLinkRules.
        laid: function of runs and TipLinkRules to Moves of the upright ball.
        rules: LeaningRules of a cutter that leans toward one direction.   tool: Tool.
    Returns:
        runs, the TipLinkRules that lay them so, how many of their paths are turned.
    """
    toward, turned = np.array(work.tool_axis.toward[:2]), set()
    sunk = lambda: sunk_contacts_mm(work, leaning(laid(runs, link), rules), tool)
    places = sunk()
    if not len(places):
        return runs, link, 0
    runs, link = [as_cut(paths, link) if paths else [] for paths in runs], replace(link, keeps_order=True)
    for _ in range(ROUNDS):
        held = {k for k in _holding(runs, places - (0.0, 0.0, rules.radius_mm)) if _trails(_path(runs, k), toward)}
        if not held:
            break
        turned |= held
        numbers = count()
        runs = [[replace(p, tips_mm=p.tips_mm[::-1]) if next(numbers) in held else p for p in paths] for paths in runs]
        places = sunk()
        if not len(places):
            break
    return runs, link, len(turned)


def sunk_contacts_mm(work, found, tool):
    """(k, 3) middles of the ball that stands for a cutter, where it sinks its own middle into stock steeper than it may.

    Args:
        work: PlanningContext.   found: Leaning.   tool: Tool.
    """
    m = found.moves
    axes, way = np.vstack([m.axis[:1], m.axis[:-1]]), m.end_mm - m.starts_mm
    down, length = -(way * axes).sum(axis=1), np.sqrt((way * way).sum(axis=1))
    is_steep = (m.kind != Kind.RAPID) & (down > SLOPE_SHARE * float(fixed.sin(tool.cutter.steepest_rad)) * length) & (length > 0.0)
    radius = tool.cutter.radius_mm
    row, share, parts = _parts(np.flatnonzero(found.is_cut), length, CLOSE_SHARE * radius)
    between = lambda start, end: start + share[:, None] * (end - start)
    middle = between(found.middle_mm[row], found.middle_mm[row + 1])
    tips, axis = between(m.starts_mm[row], m.end_mm[row]), between(axes[row], m.axis[row])
    asked = np.flatnonzero(is_steep[row])
    asked = asked[work.stock_mm(tips[asked, :2]) > tips[asked, 2]]
    asked = asked[~_is_cut_before(asked, tips, axis, middle - found.ball_radius_mm * found.normal[row + 1], BESIDE_SHARE * radius)]
    if not len(asked):
        return np.zeros((0, 3))
    run = np.cumsum(np.diff(asked, prepend=-2) > 1) - 1
    return middle[asked[np.bincount(run, weights=(down[row] / parts)[asked])[run] > DEEP_MM]]


def _is_cut_before(asked, tips, axes, contacts, reach_mm):
    """(k,) bool: of places `asked` of the cutter's way, whether it was near before with its contact, or its bottom, at their tips.

    Args:
        asked: (k,) of the rows of tips, axes and contacts (n, 3) in the order of cutting.
    """
    found = np.zeros(len(asked), bool)
    for places in (contacts, tips):
        known = np.flatnonzero(np.isfinite(places).all(axis=1))
        near = cKDTree(places[known]).query_ball_point(tips[asked], reach_mm)
        count = np.array([len(rows) for rows in near], np.int64)
        k = np.repeat(np.arange(len(asked)), count)
        other = known[np.concatenate([np.zeros(0, np.int64), *near]).astype(np.int64)]
        above = ((tips[asked[k]] - tips[other]) * axes[other]).sum(axis=1)
        found[k[(other < asked[k]) & ((above >= -LOWER_MM) | (places is contacts))]] = True
    return found


def _parts(rows, length_mm, most_mm):
    """(m,) rows repeated for parts no longer than `most_mm`, (m,) where along the move each is in its middle, (m,) how many."""
    count = np.maximum(np.ceil(length_mm[rows] / most_mm).astype(np.int64), 1)
    row, parts = np.repeat(rows, count), np.repeat(count, count)
    return row, (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / parts, parts


def _holding(runs, places_mm):
    """Set of the numbers of paths, counted through all runs, that hold places (k, 3)."""
    spots, owner = [], []
    for number, p in enumerate(chain.from_iterable(runs)):
        at = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(p.tips_mm, axis=0) ** 2).sum(axis=1)))])
        even = np.linspace(0.0, at[-1], int(at[-1] / CLOSE_MM) + 2)
        spots.append(np.column_stack([np.interp(even, at, p.tips_mm[:, k]) for k in range(3)]))
        owner.append(np.full(len(even), number))
    return set(np.concatenate(owner)[cKDTree(np.vstack(spots)).query(places_mm)[1]].tolist())


def _path(runs, number):
    """The path of a number, counted through all runs."""
    return next(islice(chain.from_iterable(runs), number, None))


def _trails(path, toward):
    """Whether a TipPath runs against a direction in plan; a closed one runs both ways, turned round or not."""
    return not path.is_closed and float(((path.tips_mm[-1] - path.tips_mm[0])[:2] * toward).sum()) < 0.0
