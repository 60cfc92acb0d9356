"""Which cutter: the largest ball that fits the hollows and reaches without its holder touching.

Every candidate is kept with the reason it was taken or left, for plan.json.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.planning.tool_depth import ROUNDING_MM, clear_tips_mm, is_clear_above, missing_stick_out_mm, too_short
from cuspline.shop.cutters import Tool
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm, is_held_above
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import CutterDoesNotFit, PlanError

ROUND = ("ball", "tapered_ball")        # cutters whose corner is their radius
FIT_SHARE = 0.9             # the ball stays this share below the tightest hollow: a full-contact ball chatters
LEFTOVER_POINTS, LEFTOVER_RINGS, LEFTOVER_SPOKES = 600, 5, 12
REST_ROUGHING_SHARE = 0.7   # of the diameter before: a cutter hardly smaller is not worth its change
WORTH_SHARE = 1e-3          # of the area wanted: what a cutter must clean more than another to be worth anything
SAME_MM = 1e-6              # diameters that are the same
LEVEL = 1e-6                # of a unit normal: level ground
TOUCH_MM = 0.03             # a ball that the planning mesh lifts by less than this does touch its point
TOUCHES_NONE = "touches none of the faces without cutting into others"


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One tool that was looked at."""

    tool: Tool
    is_chosen: bool
    reason: str
    is_fitting: bool | None = None              # smaller than the tightest hollow; None: not asked
    missing_stick_out_mm: float | None = None   # 0: holder and shank clear everywhere
    stepover_mm: float | None = None            # narrowest, for the cusp wanted
    estimated_time_s: float | None = None       # cutting alone, on what it reaches
    area_left_mm2: float | None = None          # of the faces wanted

    def as_dict(self):
        numbers = {n: _rounded(getattr(self, n)) for n in ("missing_stick_out_mm", "stepover_mm", "estimated_time_s",
                                                           "area_left_mm2")}
        return {"tool": self.tool.number, "name": self.tool.cutter.name, "type": self.tool.cutter.type,
                "diameter_mm": self.tool.cutter.diameter_mm, "chosen": self.is_chosen, "reason": self.reason,
                "fits": self.is_fitting, **numbers}


def _rounded(value):
    return None if value is None else round(float(value), 4)


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
    less = radius_mm - TOUCH_MM
    reached = (samples.normal[:, 2] > -1e-6) & ~is_held_above(mesh, center[:, :2], less, less, center[:, 2] - less + ROUNDING_MM)
    tip = center - np.array([0.0, 0.0, radius_mm])
    return Reach(tip_mm=tip, is_reached=reached)


def cutter_reach(samples, mesh, cutter):
    """Which points a ball, bull nose or flat cutter can touch without cutting into the part anywhere.

    On level ground every place under its flat counts; the least of what is tried that is free.

    Args:
        samples: surfaces.curvature.FaceSamples.   mesh: DropMesh of the part.   cutter: shop.cutters.Cutter.
    """
    corner, flat = cutter.corner_radius_mm, cutter.radius_mm - cutter.corner_radius_mm
    if flat <= 0.0 or cutter.type in ROUND:
        return ball_reach(samples, mesh, cutter.radius_mm)
    level = np.linalg.norm(samples.normal[:, :2], axis=1)
    aside = samples.normal * np.array([1.0, 1.0, 0.0]) / np.maximum(level, LEVEL)[:, None]
    tip, reached = None, np.zeros(len(level), bool)
    for angle in (None, *np.linspace(0.0, 2 * np.pi, LEFTOVER_SPOKES, endpoint=False).tolist()):
        way = aside if angle is None else np.array([fixed.cos(angle), fixed.sin(angle), 0.0])
        mine = np.where((level > LEVEL)[:, None], aside, way)
        center = samples.point_mm + corner * samples.normal + flat * mine
        less = min(corner, TOUCH_MM)
        held = drop_tips_mm(mesh, center[:, :2], cutter.radius_mm - TOUCH_MM, corner - less) + corner - less
        free = (samples.normal[:, 2] > -1e-6) & (held <= center[:, 2] + (TOUCH_MM if less < TOUCH_MM else 1e-9))
        here = center - np.array([0.0, 0.0, corner])
        tip = here if tip is None else np.where((free & ~reached)[:, None], here, tip)
        reached |= free
    return Reach(tip_mm=tip, is_reached=reached)


def choose_ball(library, samples, hollow_radius_mm, mesh, stock_mm, work=None):
    """The finishing ball and all candidates.

    Args:
        library: ToolLibrary.
        samples: surfaces.curvature.FaceSamples.
        hollow_radius_mm: the tightest hollow.
        mesh: DropMesh of the part.
        stock_mm: thickness of what may still stand on it.
        work: FinishingWork; with it the candidates say their step and time.
    Returns:
        (Tool, tuple of Candidate, Reach of the chosen ball).
    Raises:
        CutterDoesNotFit: no ball of the library fits; the message lists each with its reason.
    """
    chosen, candidates, reach = None, [], None
    for tool in library.of_type("ball"):
        mine = ball_reach(samples, mesh, tool.cutter.radius_mm)
        missing = missing_stick_out_mm(tool, mine.tip_mm[mine.is_reached], mesh, stock_mm)
        too_large = _why_not(tool, hollow_radius_mm)
        if chosen is not None:
            reason = f"a larger ball fits: T{chosen.number}"
        elif too_large:
            reason = too_large
        elif missing > 0:
            reason = too_short(tool, missing)
        elif not mine.is_reached.any():
            reason = TOUCHES_NONE
        else:
            chosen, reach, reason = tool, mine, (
                f"largest that fits: radius {tool.cutter.radius_mm:.3f} mm, minimum concave radius {hollow_radius_mm:.3f} mm"
                if np.isfinite(hollow_radius_mm) else "largest of the library; nothing to cut is concave")
        candidates.append(Candidate(
            tool=tool, is_chosen=chosen is tool, reason=reason, is_fitting=too_large is None,
            missing_stick_out_mm=missing, area_left_mm2=samples.area_mm2[~mine.is_reached].sum(),
            **({} if work is None else work.figures(tool, samples, mine.is_reached))))
    if chosen is None:
        raise CutterDoesNotFit("no ball of the library can finish this part: " + "; ".join(
            f"T{c.tool.number} {c.tool.cutter.name}: {c.reason}" for c in candidates)
            + ". Add a smaller or longer ball to the file of --cutters")
    return chosen, tuple(candidates), reach


def choose_cutter(title, tools, samples, hollow_radius_mm, look, work, worth_share=WORTH_SHARE):
    """The cutter that is through an operation's faces first, of those that leave least of them, and all candidates.

    Args:
        title: of the operation, for messages.   tools: Tool values, largest first.
        samples: surfaces.curvature.FaceSamples of the faces.
        hollow_radius_mm: the tightest concave place that must hold the corner; inf: tighter ones are left to other tools.
        look: function of a Tool to ((n,) bool: which samples it reaches, the stick-out that it lacks, mm; 0: all is clear).
        work: FinishingWork.   worth_share: of the area, that a cutter must reach more than a faster one.
    Returns:
        (Tool, tuple of Candidate, (n,) bool: which samples it reaches).
    Raises:
        CutterDoesNotFit: none fits; lists each with its reason.
    """
    looked = []
    for tool in tools:
        is_reached, missing = look(tool)
        too_large = reason = _why_not(tool, hollow_radius_mm)
        if not reason and not missing and not is_reached.any():
            reason = TOUCHES_NONE
        elif not reason and missing > 0:
            reason = too_short(tool, missing)
        looked.append((Candidate(
            tool=tool, is_chosen=False, reason=reason or "", is_fitting=too_large is None, missing_stick_out_mm=missing,
            area_left_mm2=samples.area_mm2[~is_reached].sum(), **work.figures(tool, samples, is_reached)), is_reached))
    fitting = [(c, reached) for c, reached in looked if not c.reason]
    if not fitting:
        raise CutterDoesNotFit(f"{title}: no tool that it may use fits: " + "; ".join(
            f"T{c.tool.number} {c.tool.cutter.name}: {c.reason}" for c, _ in looked)
            + ". Add a smaller or longer one to the file of --cutters, or request another")
    enough_mm2 = min(c.area_left_mm2 for c, _ in fitting) + worth_share * samples.area_mm2.sum()
    best, reached = min((f for f in fitting if f[0].area_left_mm2 <= enough_mm2), key=lambda f: f[0].estimated_time_s)
    return best.tool, tuple(_compared(c, best, enough_mm2, len(looked)) for c, _ in looked), reached


def _compared(candidate, best, enough_mm2, count):
    """The same beside the one that was taken."""
    if candidate is best:
        return replace(candidate, is_chosen=True, reason="the only one that it may use" if count == 1 else
                       "fastest of those that leave least")
    if candidate.reason:
        return candidate
    if candidate.area_left_mm2 > enough_mm2:
        return replace(candidate, reason=f"leaves {candidate.area_left_mm2 - best.area_left_mm2:.1f} mm² more than "
                                         f"T{best.tool.number}")
    return replace(candidate, reason=f"no faster than T{best.tool.number}")


def choose_side_cutter(library, hollow_radius_mm, asked_mm=None):
    """The disc on a right-angle head with the largest teeth that fit the tightest hollow, and all candidates.

    `asked_mm`: diameter that the teeth's rounding must have; None: any.

    Returns:
        (Tool, tuple of Candidate).
    Raises:
        CutterDoesNotFit: the library has none, or none fits; lists each with its reason.
    """
    chosen, candidates = None, []
    for tool in sorted((t for t in library.of_type("side") if t.head is not None),
                       key=lambda t: (-t.cutter.corner_radius_mm, -t.cutter.diameter_mm, t.number)):
        too_large = _why_not(tool, hollow_radius_mm)
        if asked_mm is not None and abs(2 * tool.cutter.corner_radius_mm - asked_mm) > SAME_MM:
            reason = f"its teeth are {2 * tool.cutter.corner_radius_mm:g} mm wide, {asked_mm:g} mm are requested"
        elif chosen is not None:
            reason = f"larger teeth fit: T{chosen.number}"
        elif too_large:
            reason = too_large
        else:
            chosen, reason = tool, f"largest teeth that fit: {tool.cutter.corner_radius_mm:.3f} mm"
        candidates.append(Candidate(tool=tool, is_chosen=chosen is tool, reason=reason, is_fitting=too_large is None))
    if chosen is None:
        listed = "; ".join(f"T{c.tool.number} {c.tool.cutter.name}: {c.reason}" for c in candidates)
        raise CutterDoesNotFit("no side-and-face cutter on an angle head can finish this part: "
                               f"{listed or 'the tool library has none'}. Add one to the file of --cutters")
    return chosen, tuple(candidates)


def _why_not(tool, hollow_radius_mm):
    limit = FIT_SHARE * hollow_radius_mm
    if tool.cutter.corner_radius_mm > limit:
        name = "ball" if tool.cutter.type == "ball" else "tooth"
        return (f"{name} radius {tool.cutter.corner_radius_mm:.3f} mm exceeds {FIT_SHARE} x the minimum concave radius "
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
            reason = f"a smaller ball leaves less: T{chosen.number}"
            candidates.append(Candidate(tool=tool, is_chosen=False, reason=reason))
            continue
        mine = ball_reach(samples, mesh, tool.cutter.radius_mm)
        new = left & mine.is_reached
        still = samples.area_mm2[~(reach.is_reached | mine.is_reached)].sum()
        if not new.any():
            candidates.append(Candidate(tool=tool, is_chosen=False, area_left_mm2=still, reason="reaches nothing more"))
            continue
        missing = missing_stick_out_mm(tool, mine.tip_mm[new], mesh, stock_mm)
        if missing > 0:
            candidates.append(Candidate(tool=tool, is_chosen=False, missing_stick_out_mm=missing, area_left_mm2=still,
                                        reason=too_short(tool, missing)))
            continue
        chosen, adds = tool, new
        candidates.append(Candidate(tool=tool, is_chosen=True, missing_stick_out_mm=0.0, area_left_mm2=still, reason=(
            f"smallest ball of the library: reaches {samples.area_mm2[new].sum():.1f} mm² more")))
    return chosen, tuple(candidates), adds


@dataclass(frozen=True, kw_only=True)
class RoughingTool:
    """What speaks for and against one roughing cutter."""

    tool: Tool
    missing_stick_out_mm: float     # 0: its holder clears; else it goes only as deep as that allows
    leaves_mm: float                # on 95 % of the faces, its allowance included

    def candidate(self, chosen):
        """For plan.json."""
        short, reason = self.missing_stick_out_mm > 0, f"leaves at most {self.leaves_mm:.2f} mm on 95 % of the faces"
        if short:
            reason = too_short(self.tool, self.missing_stick_out_mm)
            reason = f"goes as deep as it may, all are short: {reason}" if self is chosen else reason
        return Candidate(tool=self.tool, is_chosen=self is chosen, reason=reason,
                         missing_stick_out_mm=self.missing_stick_out_mm)


def roughing_tools(library, mesh, samples, stock_min_mm, stock_max_mm, allowance_mm):
    """All flat and bull-nose cutters of the library as RoughingTool, largest first."""
    found = []
    for tool in library.of_type("flat", "bull_nose"):
        missing = missing_when_roughing_mm(tool, mesh, stock_min_mm, stock_max_mm, allowance_mm)
        left = leftover_mm(tool, mesh, samples, allowance_mm, leftover_rows(samples), is_short=missing > 0)
        found.append(RoughingTool(tool=tool, missing_stick_out_mm=missing, leaves_mm=float(np.percentile(left, 95))))
    return tuple(found)


def missing_when_roughing_mm(tool, mesh, stock_min_mm, stock_max_mm, allowance_mm):
    """Stick-out that a cutter lacks to go as deep everywhere as part and stock let it; 0 where it lacks none."""
    top_mm = float(mesh.corners_mm[..., 2].max())
    if is_clear_above(tool, float(stock_min_mm[2]), top_mm, 0.0):
        return 0.0
    return missing_stick_out_mm(tool, _tip_heights(tool, mesh, stock_min_mm, stock_max_mm, allowance_mm), mesh, 0.0)


def choose_roughing(tools, allowance_mm):
    """The roughing cutter: the largest flat or bull nose whose holder clears, that leaves least at the part.

    Args:
        tools: from `roughing_tools`.
    Returns:
        (RoughingTool, tuple of Candidate); one that goes only as deep as its holder allows where no holder clears.
    Raises:
        PlanError: there is none at all.
    """
    if not tools:
        raise PlanError("the tool library has no flat or bull-nose cutter, and roughing takes one: add one to the file of "
                        "--cutters")
    # a cutter half as wide takes about four times as long: it must leave clearly less to be worth it
    best = min(_clearest(tools), key=lambda t: (t.leaves_mm + allowance_mm) / t.tool.cutter.diameter_mm)
    return best, tuple(t.candidate(best) for t in tools)


def choose_rest_roughing(tools, first, left_mm):
    """The largest smaller cutter that takes at least half of what the first one really left.

    Args:
        tools: from `roughing_tools`.   first: the RoughingTool that went before.
        left_mm: what it left on the faces.
    Returns:
        (RoughingTool or None, tuple of Candidate).
    """
    smaller = [t for t in _clearest(tools) if t.tool.cutter.diameter_mm <= REST_ROUGHING_SHARE * first.tool.cutter.diameter_mm
               and first.leaves_mm - t.leaves_mm >= left_mm / 2]
    best = max(smaller, key=lambda t: t.tool.cutter.diameter_mm, default=None)
    return best, tuple(t.candidate(best) for t in tools if t is not first)


def _clearest(tools):
    """The RoughingTool values whose holders clear; all where none does."""
    return [t for t in tools if t.missing_stick_out_mm == 0] or tools


def _tip_heights(tool, mesh, low, high, allowance_mm, spacing_mm=2.0):
    """(n, 3) where the cutter may go deepest, on a grid over the stock."""
    xs = np.arange(low[0] - tool.cutter.radius_mm, high[0] + tool.cutter.radius_mm, spacing_mm)
    ys = np.arange(low[1], high[1] + 1e-9, spacing_mm)
    xy = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    tips = drop_tips_mm(mesh, xy, tool.cutter.radius_mm + allowance_mm,
                        tool.cutter.corner_radius_mm + allowance_mm) + allowance_mm
    return np.column_stack([xy, np.maximum(tips, low[2])])


def leftover_mm(tool, mesh, samples, allowance_mm, rows, is_short=False):
    """(k,) material that the cutter must leave at sample rows, along their normals.

    The lowest tip that still covers the point is looked for over positions around it; of a tool that `is_short`, as its
    holder lets it come.
    """
    R, rc = tool.cutter.radius_mm, tool.cutter.corner_radius_mm
    points, normals = samples.point_mm[rows], samples.normal[rows]
    lowest = np.full(len(points), np.inf)
    for ring in np.linspace(0.0, 1.0, LEFTOVER_RINGS):
        d = ring * (R - 1e-6)
        bottom = rc - np.sqrt(max(rc * rc - max(d - (R - rc), 0.0) ** 2, 0.0))
        for angle in np.linspace(0, 2 * np.pi, LEFTOVER_SPOKES if ring else 1, endpoint=False):
            xy = points[:, :2] + d * np.array([fixed.cos(angle), fixed.sin(angle)])
            cutter = R + allowance_mm, rc + allowance_mm
            lower = ~is_held_above(mesh, xy, *cutter, lowest - bottom - allowance_mm - ROUNDING_MM)
            tips = drop_tips_mm(mesh, xy[lower], *cutter) + allowance_mm
            if is_short:
                tips = np.maximum(tips, clear_tips_mm(tool, mesh, xy[lower], 0.0))
            lowest[lower] = np.minimum(lowest[lower], tips + bottom)
    return np.maximum(lowest - points[:, 2], 0.0) * np.abs(normals[:, 2])


def leftover_rows(samples, is_wanted=None):
    """Evenly chosen sample rows, enough to judge what a cutter leaves; is_wanted: (n,) bool, of these alone."""
    rows = np.arange(len(samples.point_mm)) if is_wanted is None else np.flatnonzero(is_wanted)
    return rows[np.linspace(0, len(rows) - 1, min(LEFTOVER_POINTS, len(rows))).astype(int)]
