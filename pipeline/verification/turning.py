"""What turns past the tool: on the way from one indexed position to the next, and all along a program whose tool leans.

Seen from the part the tool swings round it, seen from a trunnion it moves past that.  On the way between positions the blank as
it comes stands for the stock: what has been cut is inside it; the stock of a program whose tool leans is the replay's.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from cuspline.design.fixtures import placed_fixtures
from cuspline.program.program import Kind
from cuspline.replay.clearance import ClearanceTree, ToolMoves, tool_segments
from cuspline.replay.machine_bodies import into_link, mesh_of, rotary_links, together
from cuspline.replay.replay_checks import TRAVEL_MM, Reporter

UNKNOWN = "rotary axes turn while nobody knows where X, Y and Z stand: retract by G53 before"
MEETS = "the tool meets the machine while the rotary axes turn: retract farther before them, or move the part on its table"
NEAR = "the tool comes too near while the rotary axes turn: retract farther before them, or go round"


def turning_findings(positions, setups, job, tools):
    """Findings of what leads from one indexed position to the next.

    Args:
        positions: program.positions.Positions.   setups: design.Setup of each, the first holds the part.
        job: Job.   tools: {number: Tool}.
    Returns:
        [tuple of Finding] a position: of the moves that lead to it, one a kind, where they come nearest.
    """
    moves, held, machine = positions.turning, setups[0], job.machine
    report, found = Reporter(moves, held.name, held.frame), [[] for _ in setups]
    for finding in report.travel(machine):
        found[positions.leads_to[finding.row]].append(finding)
    known = np.isfinite(moves.start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1)
    at_top = moves.machine_end_mm[:, 2] >= machine.tool_change_height_mm - TRAVEL_MM       # where it all begins
    for row in np.flatnonzero(~known & ~at_top & (moves.tool > 0)):
        found[positions.leads_to[row]].append(report.finding("unknown_start", row, 0.0, moves.end_mm[row], UNKNOWN))
    rows = np.flatnonzero(known & (moves.kind == Kind.RAPID) & np.isin(moves.tool, list(tools)))
    if not len(rows):
        return _without_rows(found, moves)
    way = _Way(moves, positions.turning_from_deg, rows, machine)
    fixed_to_part = together([_blank(held, job), *(f.mesh for f in placed_fixtures(held, held.frame))])
    judge = partial(_near, report=report, tools=tools, machine=machine)
    near = [*judge(way.seen_from(None), fixed_to_part, told=("rapid_through_stock", NEAR))]
    near += _past_bodies(way, rotary_links(machine), judge)
    for (position, _), finding in _worst(near, lambda row, f: (positions.leads_to[row], f.kind)).items():
        found[position].append(finding)
    return _without_rows(found, moves)


def _without_rows(found, moves):
    """[tuple of Finding] a position, with the axes at the ends of their moves, whose rows are none of a position's own."""
    return [tuple(at_end_of_move(f, moves) for f in of_position) for of_position in found]


def at_end_of_move(finding, moves):
    """A finding with the axes as they stand at the end of its move; what it is handed to counts other rows."""
    axes = moves.machine_end_mm[finding.row]
    return replace(finding, row=-1, machine_mm=tuple(axes.round(6).tolist()) if np.isfinite(axes).all() else None)


def swinging_findings(moves, setup, job, tools):
    """Findings of all moves of a program whose tool leans, past what of the machine does not turn with the part.

    Args:
        moves: PostedMoves of the clamping.   setup: design.Setup.   job: Job.   tools: {number: Tool}.
    Returns:
        tuple of Finding, one an operation, where it comes nearest.
    """
    machine, turned = job.machine, moves.rotary_deg
    known = np.isfinite(moves.start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1)
    from_deg = np.vstack([np.full((1, turned.shape[1]), np.nan), turned])[:-1]
    sure = np.isfinite(from_deg).all(axis=1) & np.isfinite(turned).all(axis=1)
    rows = np.flatnonzero(known & sure & np.isin(moves.tool, list(tools)))
    if not len(rows) or not np.ptp(turned[rows], axis=0).any():
        return ()
    judge = partial(_near, report=Reporter(moves, setup.name, setup.frame), tools=tools, machine=machine)
    near = _past_bodies(_Way(moves, from_deg, rows, machine), rotary_links(machine)[1:], judge)
    return tuple(_worst(near, lambda row, f: int(moves.operation[row])).values())


def _past_bodies(way, links, judge):
    """(row, Finding) of every move that comes too near to a body on one of some links."""
    near = []
    for link in links:
        bodies = [mesh_of(b) for b in way.machine.bodies if b.link == link]
        if bodies:
            near += judge(way.seen_from(link), together(bodies), told=("fixture_contact", MEETS))
    return near


def _worst(near, key_of):
    """{key: the Finding with the largest amount}."""
    worst = {}
    for row, finding in near:
        key = key_of(row, finding)
        if key not in worst or finding.amount_mm > worst[key].amount_mm:
            worst[key] = finding
    return worst


class _Way:
    """Moves that turn the part or the head."""

    def __init__(self, moves, from_deg, rows, machine):
        self.moves, self.rows, self.machine = moves, rows, machine
        self.angles = np.radians(from_deg[rows]), np.radians(moves.rotary_deg[rows])

    def seen_from(self, link):
        """(rows, ToolMoves): from the clamping's WCS, or from a link of the machine; its blocks are short."""
        m, rows = self.moves, self.rows
        tips, axes = (m.start_mm[rows], m.end_mm[rows]), (m.start_axis[rows], m.end_axis[rows])
        if link is not None:
            zero = np.array(self.machine.wcs_origin_mm)
            tips = [into_link(self.machine, link, q, p + zero) for p, q in zip(tips, self.angles)]
            axes = [into_link(self.machine, link, q, a, is_direction=True) for a, q in zip(axes, self.angles)]
        return rows, ToolMoves(start_tips_mm=tips[0], end_tips_mm=tips[1], start_axes=axes[0], end_axes=axes[1])


def _near(way, obstacle, *, told, report, tools, machine):
    """(row, Finding) of every move that comes too near; told: the finding's kind and advice."""
    (rows, moves), (kind, advice) = way, told
    tree, margin = ClearanceTree.of_triangles(*obstacle), machine.rapid_clearance_mm
    numbers = report.posted.tool[rows]
    for number in np.unique(numbers).tolist():
        mine = np.flatnonzero(numbers == number)
        own = moves.only(mine)
        clear = tree.certified_clearance(tool_segments(tools[number], machine.spindle_head), own, margin)
        for k in np.flatnonzero(~clear.is_clear):
            row = rows[mine[k]]
            yield row, report.finding(kind, row, margin - clear.clearance_mm[k], report.posted.end_mm[row], advice)


def _blank(held, job):
    vertices, triangles = job.stock.shape.mesh
    return held.frame.into(vertices), triangles
