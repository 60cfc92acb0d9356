r"""The rest of a posted program from any retract on, for a ball of another measured diameter: edges or cutter were changed.

    folder ─► reader ─► moves from a line on ─► tips moved along the part's normals ─► post ─► text, read back, compared

A ball of radius r stands with its middle c at a distance d from the part.  A ball that is smaller by q and is to leave the same
stands with its middle at the distance d - q, and its tip

    tip' = tip + q (z - n)          n: from the part's nearest place to c

so a joint of both has no step.  Rapids stay, arcs keep their middles.  In a concave corner, where the ball touches two faces, the
nearest of them counts: the other is left higher by q or less.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.app import catalogue, translation
from cuspline.app.judge import read_programs
from cuspline.design.job import read_job, read_tools
from cuspline.kernel import brep
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, Plane
from cuspline.surfaces.projection import ClosestTree
from cuspline.values.errors import InputError

MOST_SHARE = 0.02         # of the diameter: a ball that differs by more wants a plan of its own
HEIGHT_MM = 1e-6
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Reposted:
    """The rest of a program."""

    texts: tuple[str, ...]
    moved_mm: float             # the farthest that a tip was moved
    moves: PostedMoves          # as they were meant


def restart_rows(moves):
    """Rows at which a program can be begun again: a rapid leaves from the height at which its operation is highest."""
    known = np.isfinite(moves.start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1) & (moves.tool > 0)
    able, z = known & (moves.kind == Kind.RAPID) & (moves.operation >= 0), moves.start_mm[:, 2]
    high = np.full(len(moves), np.inf)
    for k in np.unique(moves.operation[able]).tolist():
        mine = able & (moves.operation == k)
        high[moves.operation == k] = z[mine].max() - HEIGHT_MM
    cuts_after = np.cumsum((moves.kind != Kind.RAPID)[::-1])[::-1] > 0
    return np.flatnonzero(able & (z >= high) & cuts_after)


def lines_of(moves, rows):
    """Line of the program of each row; of what a sub-program holds, the line that calls it."""
    return np.where(moves.call_line[rows] > 0, moves.call_line[rows], moves.line[rows])


def for_diameter(moves, number, ball, measured_mm, closest):
    """PostedMoves of a ball as they are for another diameter, so that it leaves the same.

    Args:
        moves: PostedMoves, WCS.   number: of the tool.   ball: its shop.cutters.Cutter, as planned.   measured_mm: diameter.
        closest: function of points (n, 3) WCS to the part's nearest places (n, 3).
    Raises:
        InputError: it is no ball, leans, or differs by more than MOST_SHARE.
    """
    if ball.type != "ball":
        raise InputError(f"T{number} is no ball: for another diameter plan the part again with it (--cutters)")
    if not abs(measured_mm - ball.diameter_mm) <= MOST_SHARE * ball.diameter_mm:
        raise InputError(f"T{number}: a diameter of {measured_mm:g} mm, planned is {ball.diameter_mm:g} mm: more than "
                         f"{MOST_SHARE:.0%} apart; plan the part again with it (--cutters)")
    rows = np.flatnonzero((moves.tool == number) & (moves.kind != Kind.RAPID))
    if not moves.is_upright[rows].all():
        raise InputError(f"T{number} leans: plan the part again with its diameter (--cutters)")
    smaller = (ball.diameter_mm - measured_mm) / 2
    end, center = moves.end_mm.copy(), moves.center_mm.copy()
    middle = end[rows] + ball.radius_mm * UP
    way = middle - closest(middle)
    away = way / np.maximum(np.sqrt((way * way).sum(axis=1)), 1e-12)[:, None]
    end[rows] += smaller * (UP - away)
    center[moves.plane != Plane.XY] += smaller * UP
    start = moves.start_mm.copy()
    follows = np.flatnonzero((moves.start_mm[1:] == moves.end_mm[:-1]).all(axis=1)) + 1
    start[follows] = end[follows - 1]
    return replace(moves, start_mm=start, end_mm=end, center_mm=center)


def restart_lines(folder, setup=None):
    """{operation: lines at which a folder's program can be begun again in it}; arguments as for `reposted`."""
    read = _program(tuple(read_programs(folder, read_job(folder).beside(folder), read_tools(folder))), setup)
    rows, lines = restart_rows(read.posted), {}
    for row, line in zip(rows.tolist(), lines_of(read.posted, rows).tolist()):
        name = f"{read.posted.operation_name(row)}, T{read.posted.tool[row]}"
        lines.setdefault(name, {})[line] = None
    return {name: list(found) for name, found in lines.items()}


def reposted(folder, line, number=None, diameter_mm=None, setup=None):
    """The rest of a folder's program, from a line on.

    Args:
        folder: of outputs.   line: it begins at the last restart point that is not behind it.
        number, diameter_mm: a ball of the program, and its diameter as measured; None: all tools are as planned.
        setup: its name; None: the folder has one.
    Returns:
        Reposted.
    Raises:
        InputError: there is no such setup or tool, no restart point, or what cannot be posted again; says what there is.
        ReadError, PostError: as for `translation.translated`.
    """
    job, tools = read_job(folder).beside(folder), read_tools(folder)
    read = _program(tuple(read_programs(folder, job, tools)), setup)
    moves, points = read.posted, restart_rows(read.posted)
    if read.setup.indexed or not moves.is_upright.all():
        raise InputError(f"{read.setup.name}: its tool leans, or it is an indexed position: such a program is posted again whole")
    rows = points[lines_of(moves, points) <= line]
    if not len(rows):
        raise InputError(f"line {line} is before the first restart point of {read.setup.name}, "
                         f"which is line {int(lines_of(moves, points)[0])}" if len(points) else f"{read.setup.name} has no retract")
    rest = moves.between(int(rows[-1]), len(moves))
    was = rest
    if diameter_mm is not None:
        if number not in tools or not (rest.tool == number).any():
            raise InputError(f"T{number} cuts nothing from there on; there are "
                             + ", ".join(f"T{n}" for n in np.unique(rest.tool).tolist()))
        frame, solid = read.setup.frame, brep.the_solid(brep.read_step(folder / job.step), job.step)
        tree = ClosestTree.of_faces(brep.faces_of(solid))
        rest = for_diameter(rest, number, tools[number].cutter, diameter_mm,
                            lambda p: frame.into(tree.closest_points(frame.out(p)).point_mm))
    name = f"{job.design} {read.setup.name} FROM LINE {int(lines_of(moves, rows)[-1])}"
    program = translation.program_of(rest, name, job.machine.control.post, tools)
    head = (f"{name}", *((f"T{number} MEASURED D{diameter_mm:g}",) if diameter_mm is not None else ()),
            "NOT SIMULATED: PROVE IT OUT ABOVE THE WORK FIRST")
    texts = catalogue.find_post(job.machine.control.post).post(replace(program, header=head), job.machine).texts
    translation.refuse_other_moves(rest, texts, job.machine, tools)
    return Reposted(texts=texts, moves=rest, moved_mm=float(np.sqrt(((rest.end_mm - was.end_mm) ** 2).sum(axis=1)).max()))


def _program(programs, name):
    found = [p for p in programs if name in (None, p.setup.name)]
    if len(found) != 1:
        there = ", ".join(p.setup.name for p in programs)
        raise InputError(f"setup {name} is not in the folder; there are {there}" if name else f"name the setup, one of {there}")
    return found[0]
