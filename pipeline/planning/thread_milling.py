r"""Threads milled by one tooth: in by an arc, round and round by helices of the pitch, out by an arc.

     |  |  mouth          climb cutting: anticlockwise, upward of a right-hand thread, downward of a left-hand one
     |<<|                 radially in passes of equal chips: the last one comes to the thread's width, a third of the class'
     |<<|  depth          tolerance above its least
     |  |
"""

import math

import numpy as np

from cuspline.planning.drilling import SAME_MM
from cuspline.planning.tapping import threads_of
from cuspline.planning.tool_depth import missing_stick_out_mm
from cuspline.program.program import Moves, MoveWriter, Plane
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import CutterDoesNotFit

AIM_SHARE = 1 / 3           # of the pitch diameter's tolerance, above its least
ROOM_MM = 0.1               # between the tooth and the wall, while it stands in the middle
NECK_MM = 0.02              # between the neck and the wall
LEAD_TURNS = 0.25           # of the helix that an arc in or out stands for
ABOVE_MM = 1.0              # of rapids over the wall's foot: the drill's point may have left something below
CHIP_PITCH_MM = 1.0         # of a pass: coarser threads take more


def milled_threads(work):
    """The operations of a thread mill operation: ([PlannedOperation], (n,) bool of the samples on its walls).

    Args:
        work: PlanningContext of an operation with the fields of strategies.thread_mill.ThreadMill.
    Raises:
        PlanError, CutterDoesNotFit: a hole without a thread, no thread mill that fits, a hole too shallow for it.
    """
    threads, by_tool = threads_of(work), {}
    for bore, one in threads:
        tool = _mill_for(work, bore, one)
        by_tool.setdefault(tool.number, (tool, []))[1].append((bore, one))
    made = [_operation(work, tool, mine, len(by_tool)) for tool, mine in by_tool.values()]
    return made, np.isin(work.samples.face, [i for bore, _ in threads for i in bore.wall.faces])


def path_radius_mm(form, cutter):
    """Of the tool's middle on the last pass."""
    return (form.nominal_mm + AIM_SHARE * form.pitch_tolerance_mm - cutter.diameter_mm) / 2


def _mill_for(work, bore, one):
    """The largest thread mill with room in the hole for itself and its neck, and long enough."""
    why = []
    for tool in work.tools("thread_mill"):
        cutter, form = tool.cutter, one.thread.form
        tooth = (cutter.diameter_mm - cutter.neck_diameter_mm) / 2
        low = _lowest_mm(bore, one, cutter)
        missing = max(bore.high_z_mm - low - cutter.reach_mm,
                      missing_stick_out_mm(tool, np.array([[*bore.xy_mm, low]]), work.mesh, 0.0))
        if cutter.radius_mm > bore.radius_mm - ROOM_MM:
            why.append(f"T{tool.number} is too large")
        elif path_radius_mm(form, cutter) + cutter.neck_diameter_mm / 2 > bore.radius_mm - NECK_MM:
            why.append(f"T{tool.number} stands out {tooth:.3f} mm beyond its neck, too little for this pitch")
        elif low < _least_mm(work, bore, one, cutter) - SAME_MM:
            why.append(f"T{tool.number} would go {_least_mm(work, bore, one, cutter) - low:.3f} mm too deep")
        elif missing > SAME_MM:
            why.append(f"T{tool.number} is {missing:.3f} mm too short")
        else:
            return tool
    raise CutterDoesNotFit(f"{work.operation.title}: no thread mill cuts the thread {one.in_words}, {one.depth_mm:.3f} mm deep "
                           f"({'; '.join(why)}): add one to the file of --cutters, deepen the hole, or tap it")


def _lowest_mm(bore, one, cutter):
    """The lowest tip: of the full thread's end, and of an arc beyond it."""
    return bore.high_z_mm - one.depth_mm - cutter.chamfer_mm - LEAD_TURNS * one.thread.form.pitch_mm


def _least_mm(work, bore, one, cutter):
    """How far down the tool may come: to the end of a blind wall, of an open one to the part below."""
    if not one.is_open:
        return bore.low_z_mm
    turn = np.linspace(0.0, 2 * math.pi, 12, endpoint=False)
    places = np.array(bore.xy_mm) + path_radius_mm(one.thread.form, cutter) * np.column_stack([fixed.cos(turn), fixed.sin(turn)])
    below = float(drop_tips_mm(work.mesh, places, cutter.neck_diameter_mm / 2, 0.0).max())
    return below if below < bore.low_z_mm else bore.low_z_mm


def _operation(work, tool, mine, number):
    """The PlannedOperation of one thread mill; `mine`: (Bore, ThreadedWall)."""
    rpm, feed = work.speeds(tool, is_rough=False)
    name = work.operation.title if number == 1 else f"{work.operation.title} T{tool.number}"
    moves = [_one(work, tool, bore, one, feed) for bore, one in mine]
    facts = {"holes": len(mine), "threads": sorted({one.thread.in_words for _, one in mine}), "climb": True,
             "passes": max(len(_radii(work, bore, one, tool.cutter)) for bore, one in mine),
             "path_radius_mm": sorted({round(path_radius_mm(one.thread.form, tool.cutter), 6) for _, one in mine}),
             "depth_mm": round(max(one.depth_mm for _, one in mine), 6), "candidates": []}
    return work.measured(name, tool, rpm, Moves.joined(moves), facts)


def _radii(work, bore, one, cutter):
    """Radii of the paths, outward, each with a chip as large: the groove's section grows with the square of its depth."""
    last, first = path_radius_mm(one.thread.form, cutter), bore.radius_mm - cutter.radius_mm
    count = work.operation.passes or math.ceil(one.thread.form.pitch_mm / CHIP_PITCH_MM - 1e-9)
    return [first + (last - first) * math.sqrt(k / count) for k in range(1, count + 1)]


def _one(work, tool, bore, one, feed):
    """Moves of one thread, from the clearance to the clearance."""
    form, sign, cutter = one.thread.form, one.thread.sign, tool.cutter
    middle, clear = np.array(bore.xy_mm), work.clearance_z_mm
    low = bore.high_z_mm - one.depth_mm - cutter.chamfer_mm
    turns = math.ceil(one.depth_mm / form.pitch_mm + 0.5)
    begin = low if sign > 0 else low + turns * form.pitch_mm
    lead = LEAD_TURNS * sign * form.pitch_mm
    writer = MoveWriter((*middle, clear))
    for radius in _radii(work, bore, one, cutter):
        slow = feed * radius / (radius + cutter.radius_mm)
        writer.rapid((*middle, min(max(begin - lead, bore.low_z_mm + ABOVE_MM), clear)))
        writer.feed((*middle, min(begin - lead, clear)), slow)
        _half(writer, middle, middle + (radius, 0.0), begin, slow)
        for k in range(1, 2 * turns + 1):
            side = -radius if k % 2 else radius
            _half(writer, None, middle + (side, 0.0), begin + sign * k * form.pitch_mm / 2, slow, middle)
        _half(writer, middle + (radius, 0.0), middle, float(writer.here_mm[2]) + lead, slow)
    writer.rapid((*middle, clear))
    return writer.moves()


def _half(writer, start, end, z_mm, feed, center=None):
    """Half a circle anticlockwise to a place at a height; its middle is half way, where none is given."""
    center = (start + end) / 2 if center is None else center
    writer.arc((*end, z_mm), (*center, writer.here_mm[2]), Plane.XY, False, feed)
