"""From tip paths to moves: entries, exits, and links that lift no more than they must.

From path to path the tool goes, whichever first is possible:
along the surface where that is short; over the highest thing in between, at feed; or up and across at
the clearance height.  Rapids run at the approach height or above; straight up and down also below it, where rules say
how far from what may stand there.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import MoveWriter
from cuspline.toolpaths.drop.droppers import Dropper
from cuspline.toolpaths.freeform.path_order import ordered_paths, stays_inside
from cuspline.toolpaths.freeform.plane_curves import CurveScale, PlaneCurve
from cuspline.toolpaths.freeform.tip_field import TipField
from cuspline.toolpaths.freeform.tip_merging import merged_rows
from cuspline.toolpaths.freeform.tip_sampling import dense_tips, quarter_length_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.circles import rings_of
from cuspline.values.errors import ToolpathError

LEAD_ANGLE_RAD = math.radians(60)
LEAD_MOVES = 6
LONGEST_DETOUR = 2.0        # a way along the surface may be this much longer than straight in plan
OUTSIDE_RADII = 1.0         # ways this short may leave the region: round a hole, along a ragged border
MARGIN_MM = 0.1             # above what earlier operations left
LEVEL_MM = 1e-9
FOLDS, MOST_FOLDS = 40, 200     # of a ramp to and fro: from the most that may stand, from what does stand there
UNDER, UNDER_SHARES = 16, np.array([0.17, 0.33, 0.5])     # places on circles of these shares of its radius: under a cutter's middle
ALONG = 0.95                # cosine between a pass and the direction that a cutter leads toward
RAMP_SHARE = 0.9            # of the steepest way into stock that the cutter stands


@dataclass(frozen=True, eq=False, kw_only=True)
class TipLinkRules:
    """How a cutter gets from path to path."""

    field: TipField                 # region and dropper of the paths
    stock: Dropper                  # the same cutter; its allowance is all that earlier operations may have left
    clearance_z_mm: float           # rapids across run here
    approach_z_mm: float            # from here down the tool feeds: above all stock that may be left
    feed_mm_per_min: float
    plunge_mm_per_min: float
    tolerance_mm: float             # of links along the surface
    surface_link_mm: float          # longest link along the surface, in plan
    hop_mm: float                   # longest link over what lies between, in plan
    lead_radius_mm: float           # of entry and exit arcs, vertical and tangent
    is_one_way: bool
    steepest_rad: float = math.pi / 2       # that the cutter goes down through stock: not all cut at their centre
    standing: Callable | None = None        # function of places (n, 2) to (n,): the most that stands over the part about there;
                                            # None: as the allowance of `stock` says
    behind_rad: float | None = None     # slope against its pass at which a cutter that leads comes in from behind; None: it ramps
    behind_toward: tuple | None = None      # unit, in plan, that it leads toward however it is fed: only passes that run so are
                                            # entered from behind; None: all
    ramp_above_mm: float = 0.0      # ramps, and ways in from behind, end so high above their path, the rest goes straight down
    bearing: str | None = None      # see ordered_paths
    keeps_order: bool = False       # paths are cut in the order and the direction in which they are given
    heights: Callable | None = None         # function of places (n, 2) to the heights (n,) that stand there; None: not known
    rapids: Dropper | None = None   # the same as `stock` with a rapid's clearance all round: down to there rapids go straight
                                    # up and down; None: to the approach height
    least_z_mm: float = -math.inf   # links along the surface stay above what lies lower: a floor's above what is let into it

    def __post_init__(self):
        if self.approach_z_mm > self.clearance_z_mm:
            raise ToolpathError(f"the approach height {self.approach_z_mm} mm is above the clearance height "
                                f"{self.clearance_z_mm} mm: raise the clearance")


def moves_of_tip_paths(paths, rules):
    """All moves of one operation over tip paths, from and back to the clearance height.

    Args:
        paths: list of TipPath in any order; the first is cut first.
        rules: TipLinkRules.
    Returns:
        Moves in the part frame, straight ones only.
    Raises:
        ToolpathError: no path, or one that lies above the clearance height.
    """
    if not paths:
        raise ToolpathError("no path to cut: the region is empty or smaller than the passes are apart")
    top = max(float(p.tips_mm[:, 2].max()) for p in paths)
    if top > rules.clearance_z_mm:
        raise ToolpathError(f"a path reaches {top:.3f} mm, above the clearance height {rules.clearance_z_mm} mm: "
                            "raise the clearance")
    order = as_cut(paths, rules)
    ways = _surface_ways(order, rules)
    leads_in, leads_out = _leads(order, rules)
    writer = None
    for k, path in enumerate(order):
        into = path.tips_mm[:1] if leads_in[k] is None else leads_in[k]
        if writer is None:
            writer = MoveWriter(np.r_[into[0, :2], rules.clearance_z_mm])
        if k and ways[k - 1] is not None:
            _along(writer, ways[k - 1], rules)
        else:
            if k:
                _along(writer, order[k - 1].tips_mm[-1:] if leads_out[k - 1] is None else leads_out[k - 1], rules)
                _over(writer, into[0], rules)
            else:
                _enter(writer, into[0], rules)
            _along(writer, into, rules)
        _along(writer, path.tips_mm, rules)
    if leads_out[-1] is not None:
        _along(writer, leads_out[-1], rules)
    _retract(writer, rules)
    return writer.moves()


def as_cut(paths, rules):
    """The same TipPaths in the order and the direction in which `moves_of_tip_paths` cuts them."""
    return paths if rules.keeps_order else ordered_paths(
        paths, rules.field, rules.surface_link_mm, rules.is_one_way, rules.bearing)


def _along(writer, tips, rules):
    for tip in tips:
        writer.feed(tip, rules.feed_mm_per_min)


def _retract(writer, rules):
    """Straight up: at feed to the approach height, in rapid to the clearance."""
    x, y, z = writer.here_mm
    if z < (free := _rapid_z_mm(writer.here_mm, rules)):
        writer.feed((x, y, free), rules.feed_mm_per_min)
    writer.rapid((x, y, rules.clearance_z_mm))


def _rapid_z_mm(place, rules):
    """Lowest height of a rapid over a place (3,)."""
    if rules.rapids is None:
        return rules.approach_z_mm
    return min(rules.approach_z_mm, float(rules.rapids.tips_mm(place[None, :2])[0]))


def _enter(writer, first, rules):
    """Down over a point: in rapid to the approach height or nearer, at feed to just above the stock, then plunging."""
    writer.rapid((*first[:2], rules.clearance_z_mm))
    writer.rapid((*first[:2], max(_rapid_z_mm(first, rules), first[2])))
    _sink(writer, first, rules)


def _sink(writer, first, rules):
    """Straight down: at feed through the air above the stock, at the plunge feed through the rest."""
    above = max(float(rules.stock.tips_mm(first[None, :2])[0]) + MARGIN_MM, first[2])
    if above < writer.here_mm[2]:
        writer.feed((*first[:2], above), rules.feed_mm_per_min)
    writer.feed(first, rules.plunge_mm_per_min)


def _over(writer, first, rules):
    """Up, over the highest thing in between, down to the next path; by the clearance height where that is too far."""
    here = writer.here_mm
    distance = float(fixed.length(first[:2] - here[:2]))
    if distance <= rules.hop_mm:
        count = int(np.ceil(distance / quarter_length_mm(rules.stock, rules.tolerance_mm))) + 2
        xy = here[:2] + np.linspace(0.0, 1.0, count)[:, None] * (first[:2] - here[:2])
        top = max(float(rules.stock.tips_mm(xy).max()) + MARGIN_MM, here[2], first[2])
        if top < rules.approach_z_mm:
            writer.feed((*here[:2], top), rules.feed_mm_per_min)
            writer.feed((*first[:2], top), rules.feed_mm_per_min)
            _sink(writer, first, rules)
            return
    _retract(writer, rules)
    _enter(writer, first, rules)


# along the surface ---------------------------------------------------------------------------


def _surface_ways(order, rules):
    """For each two consecutive paths the tips along the surface from one to the next, or None."""
    ways = [None] * (len(order) - 1)
    pairs = [(k, a.tips_mm[-1], b.tips_mm[0]) for k, (a, b) in enumerate(zip(order[:-1], order[1:]))]
    pairs = [(k, a, b) for k, a, b in pairs if _is_short(a, b, rules)]
    lines = [PlaneCurve(xy_mm=np.array([a[:2], b[:2]])) for _, a, b in pairs]
    if not lines:
        return ways
    dropper = rules.field.dropper
    scale = CurveScale.of(lines)
    along, line = scale.stations(quarter_length_mm(dropper, rules.tolerance_mm))
    lost = np.zeros(len(lines), bool)
    lost[line[np.isinf(dropper.tips_mm(scale.at(along)))]] = True
    keep = ~lost[line]
    if not keep.any():
        return ways
    dense = dense_tips(scale, dropper, along[keep], line[keep], rules.tolerance_mm)
    rows = merged_rows(dense, dropper, rules.tolerance_mm, 0.0)
    for piece, run in zip(np.split(dense.tip_mm[rows], np.flatnonzero(np.diff(dense.run[rows])) + 1),
                          np.unique(dense.run)):
        k, a, b = pairs[run]
        piece = np.column_stack([piece[:, :2], np.maximum(piece[:, 2], rules.least_z_mm)])
        if np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() <= LONGEST_DETOUR * fixed.length((b - a)[:2]):
            ways[k] = piece[1:]
    return ways


def _is_short(a, b, rules):
    distance = fixed.length((b - a)[:2])
    if not 1e-6 < distance <= rules.surface_link_mm:
        return False
    return distance <= OUTSIDE_RADII * rules.field.dropper.radius_mm or stays_inside(rules.field, a[:2], b[:2])


# entries and exits ---------------------------------------------------------------------------


def _leads(order, rules):
    """Tangent arcs into and out of each path as tips in the order they are run; None where one would cut.

    A cutter that may not sink so steeply comes down on a ramp along the path instead, where something stands.
    """
    into = [_arc(p.tips_mm[0], p.tips_mm[0] - p.tips_mm[1], rules.lead_radius_mm) for p in order]
    out = [_arc(p.tips_mm[-1], p.tips_mm[-1] - p.tips_mm[-2], rules.lead_radius_mm) for p in order]
    clear = _are_clear(into + out, rules)
    n = len(order)
    entries = [into[k][::-1] if clear[k] else None for k in range(n)]
    if rules.steepest_rad < LEAD_ANGLE_RAD:
        starts = np.array([p.tips_mm[0] for p in order])
        standing = rules.stock.tips_mm(starts[:, :2]) - starts[:, 2]
        if rules.standing is not None:
            standing = np.minimum(standing, rules.standing(starts[:, :2]))
        slope = float(fixed.tan(RAMP_SHARE * rules.steepest_rad))
        under = standing if rules.heights is None else np.minimum(standing, _under_mm(starts, rules))
        off = np.array([0.0, 0.0, rules.ramp_above_mm])
        ramps = [_ramped(p.tips_mm + off, (high, low), slope, lead)
                 for p, high, low, lead in zip(order, standing, under, entries)]
        entries = ramps if rules.behind_rad is None else _from_behind(order, standing, ramps, rules)
    return entries, [out[k] if clear[n + k] else None for k in range(n)]


def _from_behind(order, standing, ramps, rules):
    """Entries that come straight down onto the first tip from behind it; the ramp where that would cut.

    Where a cutter leads, its bottom rises behind the contact: so it may come down by so much more than its ramp.
    """
    ways = []
    for path, high in zip(order, standing):
        ahead, up = _tangent(path.tips_mm[0], path.tips_mm[1])
        length = (max(high, 0.0) + MARGIN_MM) / float(fixed.sin(rules.behind_rad))
        share = np.linspace(1.0, 0.0, LEAD_MOVES + 1)[:, None]
        back = float(fixed.sin(rules.behind_rad)) * up - float(fixed.cos(rules.behind_rad)) * ahead
        ways.append(path.tips_mm[0] + length * share * back + (0.0, 0.0, rules.ramp_above_mm))
    clear = _are_clear(ways, rules)
    leads = [_leads_along(path.tips_mm, rules.behind_toward) for path in order]
    return [way if high > MARGIN_MM and ok else other
            for way, high, ok, other in zip(ways, standing, np.logical_and(clear, leads), ramps)]


def _leads_along(tips_mm, toward):
    """Whether a pass begins along a direction in plan; None: along any."""
    ahead = (tips_mm[1] - tips_mm[0])[:2]
    return toward is None or float((ahead * toward).sum()) > ALONG * float(fixed.length(ahead))


def _tangent(first, second):
    """Unit direction from one tip to the next, and the one square to it that points up most."""
    way = second - first
    level, whole = (max(float(fixed.length(v)), LEVEL_MM) for v in (way[:2], way))
    ahead = way / whole
    return ahead, np.array([-ahead[2] * way[0] / level, -ahead[2] * way[1] / level, level / whole])


def _ramped(tips_mm, standing_mm, slope, otherwise):
    """The ramp down to a path: from above all that may stand there or, where the path is too short for that, from above what
    stands under the cutter's middle, its edge going down beside walls."""
    high, low = standing_mm
    if high <= MARGIN_MM:
        return otherwise
    lower = ramp(tips_mm, low + MARGIN_MM, slope, otherwise, MOST_FOLDS) if low > 0.0 else otherwise
    return ramp(tips_mm, high + MARGIN_MM, slope, lower)


def _under_mm(tips_mm, rules):
    """(n,) by which what stands under the middle of a cutter, half as wide as it is, rises above its tips (n, 3)."""
    spots = np.vstack([np.zeros((1, 2)), rings_of(rules.field.dropper.radius_mm * UNDER_SHARES, UNDER).reshape(-1, 2)])
    there = (tips_mm[:, None, :2] + spots).reshape(-1, 2)
    return rules.heights(there).reshape(len(tips_mm), -1).max(axis=1) - tips_mm[:, 2]


def ramp(tips_mm, height_mm, slope, otherwise=None, most_folds=FOLDS):
    """(m, 3) tips that come down from a height above a path (n, 3) to its first tip, to and fro along the path.

    `slope` is rise over way in plan.  Where the path is too short for it, with so many folds at the most: `otherwise`.
    """
    run = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(tips_mm[:, :2], axis=0) ** 2).sum(axis=1)))])
    whole, way = run[-1], height_mm / slope
    if way > most_folds * whole:
        return otherwise
    folds = np.arange(math.ceil(way / whole)) * whole
    back = np.unique(np.concatenate([(f + (run if k % 2 == 0 else whole - run)) for k, f in enumerate(folds)]))
    back = np.append(back[back < way], way)
    at = np.abs((back + whole) % (2 * whole) - whole)
    along = np.column_stack([np.interp(at, run, tips_mm[:, k]) for k in range(3)])
    return (along + np.column_stack([0 * back, 0 * back, slope * back]))[::-1]


def _arc(tip, heading, radius_mm):
    """(LEAD_MOVES + 1, 3) tips that leave a tip in a direction and bend upward; None for vertical directions."""
    level = float(fixed.length(heading[:2]))
    if level < 1e-9 or radius_mm <= 0.0:
        return None
    ahead = heading / fixed.length(heading)
    up = np.array([-ahead[2] * heading[0] / level, -ahead[2] * heading[1] / level, level / fixed.length(heading)])
    angle = np.linspace(0.0, LEAD_ANGLE_RAD, LEAD_MOVES + 1)[:, None]
    return tip + radius_mm * (fixed.sin(angle) * ahead + (1.0 - fixed.cos(angle)) * up)


def _are_clear(arcs, rules):
    """List of bool: no place along an arc lies below the lowered cutter."""
    there = [k for k, a in enumerate(arcs) if a is not None]
    clear = [False] * len(arcs)
    if not there:
        return clear
    share = np.linspace(0.0, 1.0, 9)[:, None]
    spots = [np.vstack([a + share * (b - a) for a, b in zip(arcs[k][:-1], arcs[k][1:])]) for k in there]
    count = len(spots[0])
    gap = np.vstack(spots)[:, 2] - rules.field.dropper.tips_mm(np.vstack(spots)[:, :2])
    for k, gaps in zip(there, gap.reshape(-1, count)):
        clear[k] = bool((gaps >= -rules.tolerance_mm).all())
    return clear
