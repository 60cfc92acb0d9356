"""The way from one indexed position to the next: the whole tool against stock, fixtures and what turns with them.

Seen from the part the tool swings round it.  The blank as it comes stands for the stock: what has been cut is inside it.
"""

import numpy as np

from cuspline.design.fixtures import placed_fixtures
from cuspline.program.program import Kind
from cuspline.replay.clearance import ClearanceTree, ToolMoves, tool_segments
from cuspline.replay.replay_checks import Reporter

UNKNOWN = "rotary axes turn while nobody knows where X, Y and Z stand: retract by G53 before"
NEAR = "the tool comes too near while the rotary axes turn: retract farther before them, or go round"


def turning_findings(positions, setups, job, tools):
    """Findings of what leads from one indexed position to the next.

    Args:
        positions: program.positions.Positions.   setups: design.Setup of each, the first holds the part.
        job: Job.   tools: {number: Tool}.
    Returns:
        [tuple of Finding] a position: of the moves that lead to it.
    """
    moves, held = positions.turning, setups[0]
    report, found = Reporter(moves, held.name, held.frame), [[] for _ in setups]
    around = ClearanceTree.of_triangles(*_obstacles(held, job))
    known = np.isfinite(moves.start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1)
    for row in np.flatnonzero(~known & (moves.tool > 0)):
        found[positions.leads_to[row]].append(report.finding("unknown_start", row, 0.0, moves.end_mm[row], UNKNOWN))
    margin = job.machine.rapid_clearance_mm
    for number in np.unique(moves.tool[known & (moves.tool > 0)]).tolist():
        rows = np.flatnonzero(known & (moves.tool == number) & (moves.kind == Kind.RAPID))
        if number not in tools or not len(rows):
            continue
        way = ToolMoves(start_tips_mm=moves.start_mm[rows], end_tips_mm=moves.end_mm[rows], start_axes=moves.start_axis[rows],
                        end_axes=moves.end_axis[rows])
        clear = around.certified_clearance(tool_segments(tools[number], job.machine.spindle_head), way, margin)
        for k in np.flatnonzero(~clear.is_clear):
            place = clear.place_mm[k] if np.isfinite(clear.place_mm[k]).all() else moves.end_mm[rows[k]]
            found[positions.leads_to[rows[k]]].append(report.finding(
                "rapid_through_stock", rows[k], margin - clear.clearance_mm[k], place, NEAR))
    return [tuple(f) for f in found]


def _obstacles(held, job):
    """(v, 3) vertices in the WCS and (t, 3) triangles of the blank and all fixtures."""
    vertices, triangles = job.stock.shape.mesh
    meshes = [(held.frame.into(vertices), triangles), *(f.mesh for f in placed_fixtures(held, held.frame))]
    first = np.cumsum([0, *(len(v) for v, _ in meshes)])
    return np.vstack([v for v, _ in meshes]), np.vstack([t + n for (_, t), n in zip(meshes, first)])
