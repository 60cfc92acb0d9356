r"""Dimples for a measuring ball: fed square to the part's face, whatever way the tool stands, so that the seat is the ball's own.

        n  axis           middle m, foot f on the part, n from f to m
        | /
       (m)     ___ skin   the seat ends |m - f| - r above the part: more than the part's tolerances,
    ____f_____________    and less than stands there
"""

import numpy as np

from cuspline.planning.tool_depth import CLEARANCES_MM
from cuspline.program.program import Moves, MoveWriter
from cuspline.toolpaths.five_axis.clear_axes import AxisSearch
from cuspline.values.errors import PlanError

LEAST_MM = 0.1              # a shallower seat does not hold a ball
LOOK_RADII = 4.0            # of the ball: how thick what stands over the part may be


def dimples(work):
    """The operation: ([PlannedOperation], (n,) bool: no samples, for no face is finished).

    Args:
        work: PlanningContext of an operation with the fields of strategies.dimples.Dimples.
    Raises:
        PlanError: a marker that no setup has; one whose seat would reach the part, or stands in the air; one that the tool cannot
            come to from this setup's direction.
    """
    operation, tool = work.operation, work.tools("ball")[-1 if work.operation.wish is None else 0]
    places = _places(work)
    radius = tool.cutter.radius_mm
    foot = work.closest.closest_points(places)
    normals = (places - foot.point_mm) / np.maximum(foot.distance_mm, 1e-9)[:, None]
    above = foot.distance_mm - radius
    standing, _ = work.piece.deviations(work.setup.turn.out(foot.point_mm), work.setup.turn.turn_out(normals), LOOK_RADII * radius)
    depths = standing - above
    say = lambda k, what: PlanError(f"{work.setup.name}, {operation.title}: marker {operation.markers[k]} at "
                                    f"{work.in_part(places[k])} {what}")
    keep = work.finish.gouge_mm + work.finish.profile_tolerance_mm
    for k, (up, deep) in enumerate(zip(above.tolist(), depths.tolist())):
        if up < keep:
            raise say(k, f"would be cut to {up:.3f} mm above the part by T{tool.number} {tool.cutter.name}: put it "
                         f"{radius + keep - foot.distance_mm[k]:.3f} mm farther out, or take a smaller ball")
        if deep < LEAST_MM:
            raise say(k, f"would be {max(deep, 0.0):.3f} mm deep, {LEAST_MM:g} at least: {standing[k]:.3f} mm stand on the part "
                         f"there; put it {LEAST_MM - deep:.3f} mm farther in, or leave more skin")
    search = AxisSearch.of_tool(work.clearance_tree, tool, keep_mm=CLEARANCES_MM)
    is_clear = search.is_clear(places, np.broadcast_to((0.0, 0.0, 1.0), places.shape))
    if not is_clear.all():
        raise say(int(np.argmin(is_clear)), f"cannot be reached by T{tool.number} {tool.cutter.name} from this direction: its "
                                            "shank or holder would meet the part; move it, or take a longer tool")
    rpm, feed = work.speeds(tool, is_rough=False)
    out = depths + work.practice.approach_mm
    moves = Moves.joined([_one(work, tip, n, far, feed) for tip, n, far in zip(places - (0.0, 0.0, radius), normals, out)])
    facts = {"markers": list(operation.markers), "depth_mm": depths.round(4).tolist(), "candidates": []}
    return [work.measured(operation.title, tool, rpm, moves, facts)], np.zeros(len(work.samples.area_mm2), bool)


def _places(work):
    """(n, 3) of the operation's markers, as the part lies in this setup."""
    known = {m.name: m.at_mm for s in work.design.setups for m in s.markers}
    if missing := [name for name in work.operation.markers if name not in known]:
        raise PlanError(f"{work.setup.name}, {work.operation.title}: no setup has a marker {missing[0]!r}; there are "
                        f"{', '.join(sorted(known)) or 'none'}")
    return work.setup.turn.into(np.array([known[name] for name in work.operation.markers]))


def _one(work, tip_mm, normal, far_mm, feed):
    """Down beside its place, square in, square out, up."""
    begin = tip_mm + far_mm * normal
    writer = MoveWriter((*begin[:2], work.clearance_z_mm))
    writer.rapid(begin)
    writer.feed(tip_mm, work.practice.plunge_share * feed)
    writer.feed(begin, feed)
    writer.rapid((*begin[:2], work.clearance_z_mm))
    return writer.moves()
