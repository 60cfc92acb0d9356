"""Which balls finish a part together: the fastest chain, largest first, each smaller one only where it is needed.

A ball counts as reaching a point where it touches it without cutting in anywhere, where the hollow is wider than the
ball by the share that keeps it from chattering, and where its holder and shank are clear.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.planning.cutter_choice import FIT_SHARE, LEVEL, ROUND, WORTH_SHARE, Candidate, ball_reach
from cuspline.planning.tool_depth import missing_stick_outs_mm, too_short
from cuspline.scallop.stepover import stepover_for_scallop_mm
from cuspline.shop.cutters import Tool
from cuspline.values.arrays import frozen
from cuspline.values.errors import CutterDoesNotFit


@dataclass(frozen=True, kw_only=True)
class FinishingWork:
    """What a finish asks of a cutter: from it follow its step and its time."""

    scallop_mm: float
    feed_of: object             # function Tool -> cutting feed, mm/min
    change_s: float             # one more tool, its approach included

    def seconds(self, tool, samples, rows):
        """Time to cut over sample rows at the step that each allows."""
        step = self.steps_mm(tool, samples, rows)
        return float((samples.area_mm2[rows] / step).sum() / self.feed_of(tool) * 60.0)

    def steps_mm(self, tool, samples, rows):
        """(k,) stepover at sample rows: of the corner's circle; under a cutter's flat of all of it.

        A sharp corner leaves stairs: of height h, square to a slope of angle a, they are h / (sin a cos a) apart.
        """
        cutter = tool.cutter
        corner = cutter.radius_mm if cutter.type in ROUND else cutter.corner_radius_mm
        upward, bend = samples.normal[rows][:, 2], samples.across_per_mm[rows]
        across = np.sqrt(np.maximum(1.0 - upward * upward, 0.0))
        if corner > 0.0:
            steps = stepover_for_scallop_mm(corner, self.scallop_mm, np.maximum(bend, -FIT_SHARE / corner))
        else:
            steps = self.scallop_mm / np.maximum(across * np.abs(upward), self.scallop_mm / cutter.radius_mm)
        return np.where(across < LEVEL, np.maximum(steps, 2 * (cutter.radius_mm - corner)), steps)

    def figures(self, tool, samples, rows):
        """Step and time for a Candidate."""
        if not rows.any():
            return {}
        return {"stepover_mm": float(self.steps_mm(tool, samples, rows).min()),
                "estimated_time_s": self.seconds(tool, samples, rows)}


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainLink:
    """One ball of the chain and what it is for."""

    tool: Tool
    adds: np.ndarray            # (n,) bool sample rows that no larger ball of the chain reaches
    area_added_mm2: float
    area_left_mm2: float        # that is still left after it
    estimated_time_s: float

    def __post_init__(self):
        object.__setattr__(self, "adds", frozen(self.adds, (None,), "adds", bool))


def choose_finishing(library, samples, mesh, stock_mm, work):
    """The balls that finish the faces in the least time, largest first.

    All chains of the library's balls are compared that leave no more than the whole library must leave (and a share
    WORTH_SHARE of the area): cutting time of what each adds, and a tool change each.

    Args:
        library: ToolLibrary.
        samples: surfaces.curvature.FaceSamples of the faces wanted.
        mesh: DropMesh of the part.
        stock_mm: thickness of what may still stand on the part.
        work: FinishingWork.
    Returns:
        (tuple of ChainLink, tuple of Candidate, (n,) bool: rows that the chain reaches).
    Raises:
        CutterDoesNotFit: no ball reaches anything; the message lists each with its reason.
    """
    tools = library.of_type("ball")
    reached, missing = zip(*(_clear_reach(t, samples, mesh, stock_mm) for t in tools)) if tools else ((), ())
    if not any(r.any() for r in reached):
        raise CutterDoesNotFit(f"no ball of the library reaches any of the faces wanted: {_why_none(tools, missing)}")
    chain = _fastest(tools, reached, samples, work)
    links, done = [], np.zeros(len(samples.area_mm2), bool)
    for k in chain:
        adds = reached[k] & ~done
        done = done | reached[k]
        links.append(ChainLink(tool=tools[k], adds=adds, area_added_mm2=float(samples.area_mm2[adds].sum()),
                               area_left_mm2=float(samples.area_mm2[~done].sum()),
                               estimated_time_s=work.seconds(tools[k], samples, adds)))
    return tuple(links), _table(tools, reached, missing, links, samples, work), done


def _why_none(tools, missing):
    """Why no ball reaches anything, and what its reader can do.

    Args:
        tools: Tools.   missing: of each the stick-out that it lacks where it would fit, mm; 0: it fits nowhere.
    """
    if not tools:
        return "it has none. Add balls to the file of --cutters"
    reasons = "; ".join(f"T{t.number} {t.cutter.name}: " + (too_short(t, m) if m > 0 else "gets in nowhere")
                        for t, m in zip(tools, missing))
    if any(missing):
        return f"{reasons}. Add a smaller or longer ball to the file of --cutters"
    smallest = min(t.cutter.radius_mm for t in tools)
    return (f"{reasons}: the gaps beside these faces are narrower than the smallest, radius {smallest:.3f} mm. Add a smaller "
            "ball to the file of --cutters, or leave these faces out of `faces`")


def _clear_reach(tool, samples, mesh, stock_mm):
    """Rows that a ball reaches with everything clear, and the stick-out that is missing for the rest."""
    reach = ball_reach(samples, mesh, tool.cutter.radius_mm)
    fits = reach.is_reached & (samples.hollow_per_mm * tool.cutter.radius_mm >= -FIT_SHARE)
    missing = np.zeros(len(fits))
    missing[fits] = missing_stick_outs_mm(tool, reach.tip_mm[fits], mesh, stock_mm)
    return fits & (missing <= 0), float(missing.max(initial=0.0))


def _fastest(tools, reached, samples, work):
    """Indices of the fastest chain, by dynamic programming over its last ball.

    Balls come largest first; a smaller one reaches what a larger one does, but for its shorter holder, so a chain's
    rows are taken as those of all its balls together.
    """
    area = samples.area_mm2
    target = area[np.logical_or.reduce(reached)].sum() - WORTH_SHARE * area.sum()
    best = {}       # last ball -> [(seconds, chain, rows)]: chains none of which is slower and reaches less
    for k, tool in enumerate(tools):
        found = []
        for seconds, chain, rows in [(0.0, (), np.zeros(len(area), bool))] + [c for s in best.values() for c in s]:
            adds = reached[k] & ~rows
            if area[adds].sum() > WORTH_SHARE * area.sum():
                seconds = seconds + work.seconds(tool, samples, adds) + work.change_s
                found.append((seconds, (*chain, k), rows | reached[k]))
        best[k] = _undominated(found, area)
    chains = [c for row in best.values() for c in row]
    target = min(target, max(area[c[2]].sum() for c in chains))
    return min((c for c in chains if area[c[2]].sum() >= target), key=lambda c: (c[0], len(c[1]), c[1]))[1]


def _undominated(chains, area):
    kept, most = [], -1.0
    for chain in sorted(chains, key=lambda c: (c[0], len(c[1]), c[1])):
        covered = area[chain[2]].sum()
        if covered > most + 1e-9:
            kept.append(chain)
            most = covered
    return kept


def _table(tools, reached, missing, links, samples, work):
    chosen = {link.tool.number: link for link in links}
    hollow = float(samples.hollow_per_mm.min(initial=0.0))
    rows = []
    for tool, rows_reached, short in zip(tools, reached, missing):
        link = chosen.get(tool.number)
        if link is not None:
            reason = f"adds {link.area_added_mm2:.1f} mm², leaves {link.area_left_mm2:.1f} mm²"
        elif not rows_reached.any():
            reason = f"clears nowhere: {too_short(tool, short)}" if short else "fits nowhere"
        else:
            reason = "the chain is not faster with it"
        rows.append(Candidate(tool=tool, is_chosen=link is not None, reason=reason, missing_stick_out_mm=short,
                              is_fitting=bool(hollow * tool.cutter.radius_mm >= -FIT_SHARE),
                              area_left_mm2=float(samples.area_mm2[~rows_reached].sum()),
                              **work.figures(tool, samples, rows_reached)))
    return tuple(rows)
