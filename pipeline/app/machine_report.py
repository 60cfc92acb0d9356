"""The machine as the report shows it moving: bodies as they are drawn, joints of every program over its time."""

from dataclasses import dataclass

import numpy as np

from cuspline.design.design import by_clamping
from cuspline.kernel import brep
from cuspline.program.positions import led_to
from cuspline.program.program import Kind
from cuspline.report.bundle import FaceMesh
from cuspline.report.machine_view import MachineBody, MachineTool, MachineView, Motion
from cuspline.report.view_mesh import tessellate_for_view
from cuspline.shop.machines import StepBody
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame

DRAWN_SHARE = 1 / 500           # of a body's size: how far its facets may be off
MOST_TRIANGLES = 20_000         # of one body; above, its facets are drawn coarser
COARSER = 3.0
LEAST_TURN_RAD, MOST_TURN_RAD = 0.3, 1.5    # between facets, from a fine body to the coarsest


@dataclass(frozen=True, eq=False, kw_only=True)
class Drawn:
    """The moves of a setup as the report draws them."""

    posted: object              # PostedMoves; operations counted as plan.json counts those of the setup
    path: object                # bundle.PathPoints
    last_point: np.ndarray      # (n,) of the path, of every move


def machine_view(job, judged, drawn, plan, broken_down):
    """MachineView of a build; None where a machine has neither rotary axes nor bodies.

    Args:
        job: Job.   judged: judge.Judged.   drawn: (Drawn) of every setup.   plan: plan.json as written.
        broken_down: function (PostedMoves, row) to the (n, 3) points that an arc is drawn by.
    """
    machine = job.machine
    if not machine.rotaries and not machine.bodies:
        return None
    documents = {op["tool"]["number"]: op["tool"] for s in plan["setups"] for op in s["operations"]}
    chain, first, motions = machine.kinematics, 0, []
    for held in by_clamping(judged.read):
        rows = tuple(range(first, first + len(held)))
        motions.append(_motion(held, rows, [drawn[k] for k in rows], machine, broken_down))
        first += len(held)
    return MachineView(
        name=machine.name, chain=chain, order=machine.chain, upward=machine.upward, motions=tuple(motions),
        bodies=tuple(MachineBody(name=b.name, link=b.link, colour=b.colour, shape=_drawn(b.shape)) for b in machine.bodies),
        tools={number: MachineTool(tip_mm=_tip(tool, chain.spindle), tool=documents.get(number, {}))
               for number, tool in judged.tools.items()})


def _drawn(shape):
    """A body's shape; what comes out of a STEP file as facets, no more than MOST_TRIANGLES of them."""
    if not isinstance(shape, StepBody):
        return shape
    solid = brep.the_solid(brep.read_step(shape.step), shape.step)
    low, high = brep.bounding_box_mm(solid)
    off, turn = DRAWN_SHARE * fixed.length(np.subtract(high, low)), LEAST_TURN_RAD
    mesh = tessellate_for_view(solid, off, angle_rad=turn)
    while len(mesh.triangles) > MOST_TRIANGLES and turn < MOST_TURN_RAD:
        off, turn = COARSER * off, min(COARSER * turn, MOST_TURN_RAD)
        mesh = tessellate_for_view(solid, off, angle_rad=turn)
    return FaceMesh(vertices_mm=mesh.vertices_mm, normals=mesh.normals, triangles=mesh.triangles, edges_mm=(),
                    deviation_mm=np.full(len(mesh.vertices_mm), np.nan))


def _tip(tool, spindle):
    """(3,) of a tool's tip, seen from the spindle nose."""
    if tool.head is None:
        return tuple(-tool.length_mm * spindle)
    return tuple(-np.array(tool.offset_mm) - tool.driven_mm * np.array(tool.head.axis))


def _motion(held, rows, drawn, machine, broken_down):
    """Motion of one clamping's program.

    Args:
        held: judge.ReadProgram of each of its positions.   rows: the report's numbers of them.   drawn: Drawn of them.
    """
    whole, position = held[0].whole, held[0].position
    counts, nose = _broken(whole, broken_down)
    setup = led_to(position)
    own, takes = _own_times(whole, position, setup, drawn, machine.kinematics)
    operation = np.full(len(whole), -1)
    for k, seen in enumerate(drawn):
        operation[position == k] = seen.posted.operation
    share = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + 1) / np.repeat(counts, counts)
    begins = lambda ends, lasts: np.repeat(ends - lasts, counts) + np.repeat(lasts, counts) * share
    each, frame, zero = lambda values: np.repeat(values, counts, axis=0), held[0].setup.clamped_frame, machine.zero_mm(
        held[0].setup.zero_height_mm)
    lasts = np.where(position >= 0, takes, 0.0)
    return Motion(
        setups=rows, place=Frame(rotation=frame.rotation.T, origin_mm=zero + frame.into(np.zeros((1, 3)))[0]),
        joints=np.column_stack([nose, each(whole.rotary_deg)]), time_s=begins(np.cumsum(takes), takes), own_s=begins(own, lasts),
        setup=each(np.array(rows)[setup]), line=each(whole.line), tool=each(whole.tool),
        operation=each(operation), feed_mm_per_min=each(whole.feed_mm_per_min),
        is_rapid=each(whole.kind == Kind.RAPID))


def _broken(whole, broken_down):
    """((n,) poses of each move, (sum, 3) spindle noses at their ends): arcs as they are drawn."""
    counts, ways = np.ones(len(whole), np.int64), {}
    for k in np.flatnonzero(whole.kind >= Kind.ARC_CW).tolist():
        ways[k] = broken_down(whole, k) + (whole.machine_end_mm[k] - whole.end_mm[k])
        counts[k] = len(ways[k])
    nose, ends = np.repeat(whole.machine_end_mm, counts, axis=0), np.cumsum(counts)
    for k, way in ways.items():
        nose[ends[k] - counts[k]:ends[k]] = way
    return counts, nose


def _own_times(whole, position, setup, drawn, chain):
    """((n,) time in its setup's own path at the end of each move, (n,) seconds that each takes)."""
    own, takes = np.zeros(len(whole)), _turning_s(whole, chain)
    for k, seen in enumerate(drawn):
        mine, near = np.flatnonzero(position == k), np.flatnonzero(setup == k)
        ends = seen.path.time_s[seen.last_point]
        takes[mine] = np.diff(ends, prepend=0.0)
        own[near] = np.append(0.0, ends)[np.searchsorted(mine, near, side="right")]
    return own, takes


def _turning_s(whole, chain):
    """(n,) seconds of each move as a rapid of the joint that takes longest; a place not yet known takes none."""
    joints = np.column_stack([whole.machine_end_mm, np.radians(whole.rotary_deg)])
    way = np.abs(np.nan_to_num(np.diff(joints, axis=0, prepend=joints[:1])))
    return (way / chain.speed).max(axis=1)
