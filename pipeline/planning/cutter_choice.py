"""Which cutter: the largest ball that fits the hollows and reaches without its holder touching.

Every candidate is kept with the reason it was taken or left, for plan.json.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.arrays import frozen
from cuspline.cutters import Tool
from cuspline.errors import CutterDoesNotFit, PlanError
from cuspline.program import Kind
from cuspline.toolpaths.dropcutter import drop_tips_mm

FIT_SHARE = 0.9             # the ball stays this share below the tightest hollow: a full-contact ball chatters
HOLDER_CLEARANCE_MM = 1.0
SHANK_CLEARANCE_MM = 0.05
LEFTOVER_POINTS, LEFTOVER_RINGS, LEFTOVER_SPOKES = 600, 5, 12
TOUCH_MM = 0.03             # a ball that the planning mesh lifts by less than this does touch its point


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One tool that was looked at."""

    tool: Tool
    is_chosen: bool
    reason: str

    def as_dict(self):
        return {"tool": self.tool.number, "name": self.tool.cutter.name, "type": self.tool.cutter.type,
                "diameter_mm": self.tool.cutter.diameter_mm, "chosen": self.is_chosen, "reason": self.reason}


@dataclass(frozen=True, eq=False, kw_only=True)
class Reach:
    """Which sample points a ball touches, from where."""

    tip_mm: np.ndarray          # (n, 3) tip when the ball touches each point
    is_reached: np.ndarray      # (n,) bool: nothing else holds the ball off there

    def __post_init__(self):
        object.__setattr__(self, "tip_mm", frozen(self.tip_mm, (None, 3), "tip_mm"))
        object.__setattr__(self, "is_reached", frozen(self.is_reached, (len(self.tip_mm),), "is_reached", bool))


def ball_reach(samples, mesh, radius_mm):
    """Which points a ball can touch without cutting into the part anywhere.

    Args:
        samples: surfaces.curvature.FaceSamples.
        mesh: DropMesh of the part.
        radius_mm: ball radius.
    """
    center = samples.point_mm + radius_mm * samples.normal
    held = drop_tips_mm(mesh, center[:, :2], radius_mm - TOUCH_MM, radius_mm - TOUCH_MM) + radius_mm - TOUCH_MM
    reached = (samples.normal[:, 2] > -1e-6) & (held <= center[:, 2] + 1e-9)
    tip = center - np.array([0.0, 0.0, radius_mm])
    return Reach(tip_mm=tip, is_reached=reached)


def missing_stick_out_mm(tool, tips_mm, mesh, stock_mm):
    """How much deeper the holder and shank would have to clear; 0 where everything is clear.

    Args:
        tool: Tool.
        tips_mm: (n, 3) tip positions it must reach.
        mesh: DropMesh of the part.
        stock_mm: thickness of the material that may still stand on the part.
    """
    worst = 0.0
    for z0, r0, _, r1 in tool.non_cutting_frusta():
        is_holder = z0 >= tool.stick_out_mm - 1e-9
        clearance = stock_mm + (HOLDER_CLEARANCE_MM if is_holder else SHANK_CLEARANCE_MM)
        if max(r0, r1) + clearance <= tool.cutter.radius_mm:
            continue
        below = drop_tips_mm(mesh, tips_mm[:, :2], max(r0, r1) + clearance, 0.0)
        worst = max(worst, float((below + clearance - (tips_mm[:, 2] + z0)).max()))
    return worst


def choose_ball(library, samples, hollow_radius_mm, mesh, stock_mm):
    """The finishing ball and all candidates.

    Returns:
        (Tool, tuple of Candidate, Reach of the chosen ball).
    Raises:
        CutterDoesNotFit: no ball of the library fits; the message lists each with its reason.
    """
    chosen, candidates, reach = None, [], None
    for tool in library.of_type("ball"):
        if chosen is not None:
            candidates.append(Candidate(tool=tool, is_chosen=False, reason=f"a larger ball fits: T{chosen.number}"))
            continue
        reason = _why_not(tool, hollow_radius_mm)
        if reason is None:
            reach = ball_reach(samples, mesh, tool.cutter.radius_mm)
            missing = missing_stick_out_mm(tool, reach.tip_mm[reach.is_reached], mesh, stock_mm)
            if missing > 0:
                reason = (f"holder or shank would touch the part: stick-out {tool.stick_out_mm:.1f} mm is "
                          f"{missing:.2f} mm short")
        if reason is None:
            chosen, reason = tool, (f"largest that fits: radius {tool.cutter.radius_mm:.3f} mm in a hollow of "
                                    f"{hollow_radius_mm:.3f} mm" if np.isfinite(hollow_radius_mm)
                                    else "largest of the library; nothing to cut is hollow")
        candidates.append(Candidate(tool=tool, is_chosen=chosen is tool, reason=reason))
    if chosen is None:
        raise CutterDoesNotFit("no ball of the library can finish this part: " + "; ".join(
            f"T{c.tool.number} {c.tool.cutter.name}: {c.reason}" for c in candidates)
            + ". Add a smaller or longer ball to the tool library")
    return chosen, tuple(candidates), reach


def _why_not(tool, hollow_radius_mm):
    limit = FIT_SHARE * hollow_radius_mm
    if tool.cutter.radius_mm > limit:
        return (f"ball radius {tool.cutter.radius_mm:.3f} mm exceeds {FIT_SHARE} x the tightest hollow of "
                f"{hollow_radius_mm:.3f} mm")
    return None


def choose_rest_ball(library, samples, reach, mesh, largest_radius_mm, stock_mm):
    """The smallest ball that reaches points which the finishing ball does not.

    Returns:
        (Tool or None, tuple of Candidate, (n,) bool points it adds).
    """
    left = ~reach.is_reached & (samples.normal[:, 2] > -1e-6)
    candidates, chosen, adds = [], None, np.zeros(len(left), bool)
    if not left.any():
        return None, (), adds
    for tool in reversed([t for t in library.of_type("ball") if t.cutter.radius_mm < largest_radius_mm]):
        if chosen is not None:
            candidates.append(Candidate(tool=tool, is_chosen=False, reason=f"a smaller ball leaves less: T{chosen.number}"))
            continue
        mine = ball_reach(samples, mesh, tool.cutter.radius_mm)
        new = left & mine.is_reached
        if not new.any():
            candidates.append(Candidate(tool=tool, is_chosen=False, reason="reaches nothing more"))
            continue
        missing = missing_stick_out_mm(tool, mine.tip_mm[new], mesh, stock_mm)
        if missing > 0:
            candidates.append(Candidate(tool=tool, is_chosen=False,
                                        reason=f"holder or shank would touch: stick-out {missing:.2f} mm short"))
            continue
        chosen, adds = tool, new
        candidates.append(Candidate(tool=tool, is_chosen=True, reason=(
            f"smallest ball of the library: reaches {samples.area_mm2[new].sum():.1f} mm² more")))
    return chosen, tuple(candidates), adds


def choose_roughing(library, mesh, samples, stock_min_mm, stock_max_mm, allowance_mm):
    """The roughing cutter: the largest flat or bull nose whose holder clears, that leaves least at the part.

    Returns:
        (Tool, tuple of Candidate).
    Raises:
        PlanError: the library has no flat or bull-nose cutter whose holder clears.
    """
    rows = []
    for tool in library.of_type("flat", "bull_nose"):
        tips = _tip_heights(tool, mesh, stock_min_mm, stock_max_mm, allowance_mm)
        missing = missing_stick_out_mm(tool, tips, mesh, 0.0)
        left = leftover_mm(tool, mesh, samples, allowance_mm, leftover_rows(samples))
        rows.append((tool, missing, float(np.percentile(left, 95))))
    usable = [r for r in rows if r[1] <= 0]
    if not usable:
        raise PlanError("no flat or bull-nose cutter of the library can rough this part: " + "; ".join(
            f"T{t.number} {t.cutter.name}: holder {m:.2f} mm short" for t, m, _ in rows)
            + ". Lengthen a stick-out or add a cutter")
    # a cutter half as wide takes about four times as long: it must leave clearly less to be worth it
    best = min(usable, key=lambda r: (r[2] + allowance_mm) / r[0].cutter.diameter_mm)
    reason = {True: "holder {1:.2f} mm short", False: "leaves at most {2:.2f} mm on 95 % of the faces"}
    return best[0], tuple(Candidate(tool=r[0], is_chosen=r is best, reason=reason[r[1] > 0].format(*r)) for r in rows)


def _tip_heights(tool, mesh, low, high, allowance_mm, spacing_mm=2.0):
    """(n, 3) where the cutter may go deepest, on a grid over the stock."""
    xs = np.arange(low[0] - tool.cutter.radius_mm, high[0] + tool.cutter.radius_mm, spacing_mm)
    ys = np.arange(low[1], high[1] + 1e-9, spacing_mm)
    xy = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    tips = drop_tips_mm(mesh, xy, tool.cutter.radius_mm + allowance_mm,
                        tool.cutter.corner_radius_mm + allowance_mm) + allowance_mm
    return np.column_stack([xy, np.maximum(tips, low[2])])


def leftover_mm(tool, mesh, samples, allowance_mm, rows):
    """(k,) material that the cutter must leave at sample rows, along their normals.

    The lowest tip that still covers the point is looked for over positions around it.
    """
    R, rc = tool.cutter.radius_mm, tool.cutter.corner_radius_mm
    points, normals = samples.point_mm[rows], samples.normal[rows]
    lowest = np.full(len(points), np.inf)
    for ring in np.linspace(0.0, 1.0, LEFTOVER_RINGS):
        d = ring * (R - 1e-6)
        bottom = rc - np.sqrt(max(rc * rc - max(d - (R - rc), 0.0) ** 2, 0.0))
        for angle in np.linspace(0, 2 * np.pi, LEFTOVER_SPOKES if ring else 1, endpoint=False):
            xy = points[:, :2] + d * np.array([np.cos(angle), np.sin(angle)])
            tips = drop_tips_mm(mesh, xy, R + allowance_mm, rc + allowance_mm) + allowance_mm
            lowest = np.minimum(lowest, tips + bottom)
    return np.maximum(lowest - points[:, 2], 0.0) * np.abs(normals[:, 2])


def leftover_rows(samples):
    """Evenly chosen sample rows, enough to judge what a cutter leaves."""
    return np.linspace(0, len(samples.point_mm) - 1, min(LEFTOVER_POINTS, len(samples.point_mm))).astype(int)


def left_by_moves_mm(moves, tool, samples, rows, spacing_mm=0.5):
    """(k,) material that planned straight moves leave above sample rows, along their normals.

    The path is taken at points `spacing_mm` apart: good to 0.02 mm for judging what to do next.
    """
    R, rc = tool.cutter.radius_mm, tool.cutter.corner_radius_mm
    points, normals = samples.point_mm[rows], samples.normal[rows]
    lowest = np.full(len(points), np.inf)
    cutting = np.flatnonzero(moves.kind != Kind.RAPID)
    starts, ends = moves.starts_mm[cutting], moves.end_mm[cutting]
    counts = np.maximum(1, np.ceil(np.linalg.norm(ends - starts, axis=1) / spacing_mm)).astype(int)
    move = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + 1) / counts[move]
    tips = starts[move] + share[:, None] * (ends[move] - starts[move])
    for k, near in enumerate(cKDTree(tips[:, :2]).query_ball_point(points[:, :2], R)):
        if near:
            d = np.linalg.norm(tips[near, :2] - points[k, :2], axis=1)
            over = np.minimum(np.maximum(d - (R - rc), 0.0), rc)
            lowest[k] = (tips[near, 2] + rc - np.sqrt(rc * rc - over * over)).min()
    return np.maximum(lowest - points[:, 2], 0.0) * np.abs(normals[:, 2])
