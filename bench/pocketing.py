"""Seeded pockets round an island: how well the engagement keeps its limit, time beside plain offset loops and FreeCAD's adaptive
clearing, by the same feed model.

    python bench/pocketing.py FIRST LAST

The loops are contours of the distance to the walls, one stepover apart, from the innermost out, down the innermost one by a
ramp: what a program that offsets its border makes.  They are run at the feed of the clearing, on the same levels; a second time
is that of a feed lowered wherever a tooth would take more than it does at the limit.  FreeCAD's paths are laid out where its module
`area` can be imported (Debian's libfreecad-python3: put the folder of area.so on PYTHONPATH), at the same stepover, and
written as lines and arcs as ours are.
"""

import math
import random
import sys
from pathlib import Path

import cadquery as cq
import contourpy
import numpy as np

try:
    import area
except ImportError:         # FreeCAD is not at hand
    area = None

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/parts")]

from clearing_meter import measure_cuts  # noqa: E402

from cuspline.app import catalogue  # noqa: E402
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox  # noqa: E402
from cuspline.planning import feeds  # noqa: E402
from cuspline.planning.plan import plan_setup  # noqa: E402
from cuspline.planning.strategies.pocket import Pocket  # noqa: E402
from cuspline.program.program import Kind, MoveWriter, Plane  # noqa: E402
from cuspline.toolpaths.roughing.clearing_moves import FIT_MM  # noqa: E402
from cuspline.toolpaths.roughing.path_arcs import lines_and_arcs  # noqa: E402

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
Z, DEPTH, RIM, ALLOWANCE_MM = 12.0, 6.0, 4.0, 0.3
METER_RAD = math.radians(3.0)       # a bin of the meter
PITCH_MM, TOLERANCE_MM = 0.1, 0.02
LOOKED_AT_MM = 1.0          # pieces of the loops whose engagement is measured apart
ADAPTIVE_TOLERANCE = 0.05   # FreeCAD's, of its accuracy


def pocket(seed):
    """(solid, sizes in x and y, corner radius, middle and radius of the island)."""
    say = random.Random(seed)
    size, corner = (say.uniform(48, 64), say.uniform(36, 48)), say.uniform(5.5, 10)
    island = (say.uniform(-6, 6), say.uniform(-2, 2), say.uniform(1.5, 5.0))
    x, y = (s + 2 * RIM for s in size)
    hollow = cq.Workplane("XY", origin=(x / 2, y / 2, Z - DEPTH)).rect(*size).extrude(20).edges("|Z").fillet(corner)
    block = cq.Workplane("XY").box(x, y, Z, centered=False).cut(hollow)
    post = cq.Workplane("XY", origin=(x / 2 + island[0], y / 2 + island[1], 1)).circle(island[2]).extrude(Z - 1)
    return block.union(post), size, corner, island


def cleared(solid, x, y):
    """The PlannedOperation that clears a pocket, and its setup's context."""
    inside = FacePredicate(name="pocket", at_least=1, center_min_mm=(1, 1, 1), center_max_mm=(x - 1, y - 1, Z - 0.1))
    design = Design(name="pocket", description="pocket", parameters=Parameters(), solid=solid.val(), predicates=(inside,),
                    material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=(x, y, Z)),
                    finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                    setups=(Setup(name="setup-1", faces=("pocket",), wcs_in_words="corner", operations=(
                        Pocket(tool="flat 10", finishes=False, allowance_mm=ALLOWANCE_MM),)),))
    plan = plan_setup(design, design.setups[0], MACHINE, SHOP)
    return plan.operations[0], plan.context


def loops(size, corner, island, radius_mm, stepover_mm):
    """[(n, 2)] closed ways of the cutter's middle in a pocket about 0, innermost first."""
    x, y = (np.arange(-s / 2, s / 2 + PITCH_MM, PITCH_MM) for s in size)
    px, py = np.meshgrid(x, y)
    out = [np.maximum(np.abs(p) - s / 2 + corner, 0.0) for p, s in ((px, size[0]), (py, size[1]))]
    flat = np.minimum(np.maximum(np.abs(px) - size[0] / 2 + corner, np.abs(py) - size[1] / 2 + corner), 0.0)
    free = np.minimum(corner - np.hypot(*out) - flat, np.hypot(px - island[0], py - island[1]) - island[2])
    levels = contourpy.contour_generator(x, y, free)
    away = np.arange(radius_mm + ALLOWANCE_MM, free.max(), stepover_mm)[::-1]
    closed = [line for d in away for line in levels.lines(d) if math.dist(line[0], line[-1]) < 1e-9 and len(line) > 8]
    return [sparse(line) for line in closed]


def sparse(line):
    """A closed line (n, 2) by the fewest of its places that keep within TOLERANCE_MM: a machine does not stop at each of many."""
    kept, first = [0], 0
    for k in range(2, len(line)):
        way = line[k] - line[first]
        off = np.abs(way[0] * (line[first:k, 1] - line[first, 1]) - way[1] * (line[first:k, 0] - line[first, 0]))
        if off.max() > TOLERANCE_MM * max(math.hypot(*way), 1e-9) or math.hypot(*way) < PITCH_MM:
            first = k - 1
            kept.append(first)
    return line[[*kept, len(line) - 1]]


def by_loops(ways, heights_mm, ramp_rad, feed, clear_mm):
    """Moves along the loops on each level: down the first by a ramp, then from loop to loop at the feed."""
    writer = MoveWriter((*ways[0][0], clear_mm))
    for high, low in zip(heights_mm[:-1], heights_mm[1:]):
        writer.rapid((*ways[0][0], clear_mm))
        writer.rapid((*ways[0][0], high + 1.0))
        writer.feed((*ways[0][0], high), feed)
        z = high
        while z > low + 1e-9:
            for a, b in zip(ways[0][:-1], ways[0][1:]):
                z = max(low, z - math.dist(a, b) * math.tan(ramp_rad))
                writer.feed((*b, z), feed)
        for way in ways:
            begin = int(np.hypot(*(way[:-1] - writer.here_mm[:2]).T).argmin())
            for place in np.vstack([way[begin:-1], way[:begin + 1]]):
                writer.feed((*place, low), feed)
        writer.rapid((*writer.here_mm[:2], clear_mm))
    return writer.moves()


def adaptive(size, corner, island, tool, stepover_mm):
    """(helix centre, start, [(is cut, is clear, (n, 2) places)]) of FreeCAD's adaptive clearing, about 0."""
    job = area.Adaptive2d()
    job.toolDiameter, job.stepOverFactor = tool.cutter.diameter_mm, stepover_mm / tool.cutter.diameter_mm
    job.tolerance, job.stockToLeave, job.finishingProfile = ADAPTIVE_TOLERANCE, ALLOWANCE_MM, False
    job.opType = area.AdaptiveOperationType.ClearingInside
    turn = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    outline = corner * ring + np.sign(np.round(ring, 9)) * (np.array(size) / 2 - corner)
    borders = [outline.tolist(), (island[2] * ring + island[:2]).tolist()]
    found = job.Execute([borders[0]], borders, lambda paths: False)
    kinds = area.AdaptiveMotionType
    return [(one.HelixCenterPoint, one.StartPoint, [
        (int(kind) == int(kinds.Cutting), int(kind) != int(kinds.LinkNotClear), np.array(places))
        for kind, places in one.AdaptivePaths if len(places)]) for one in found]


def by_adaptive(regions, middle, heights_mm, rules):
    """Moves of FreeCAD's regions on each level: down by a helix, cuts by lines and arcs, links on the level or above by rapids."""
    ramp_rad, ramp_feed, feed, clear_mm = rules
    writer = MoveWriter((*middle, clear_mm))
    up = lambda xy, down: [writer.rapid((*writer.here_mm[:2], clear_mm)), writer.rapid((*xy, clear_mm)), writer.rapid((*xy, down))]
    for high, low in zip(heights_mm[:-1], heights_mm[1:]):
        for center, start, paths in regions:
            (x, y), first = np.array(center) + middle, np.array(start) + middle
            radius = max(math.dist(first, (x, y)), 0.1)
            up((x + radius, y), high + 1.0)
            writer.feed((x + radius, y, high + 0.5), ramp_feed)
            halves = 2 * math.ceil((high + 0.5 - low) / (2 * math.pi * radius * math.tan(ramp_rad)))
            for k in range(1, halves + 3):
                z = max(low, high + 0.5 - (high + 0.5 - low) * k / halves)
                writer.arc((x + (radius if k % 2 == 0 else -radius), y, z), (x, y, z), Plane.XY, False, ramp_feed)
            writer.feed((*first, low), feed)
            for is_cut, is_clear, places in paths:
                if is_cut:
                    _cut_along(writer, places + middle, low, feed)
                elif is_clear:
                    for place in places + middle:
                        writer.rapid((*place, low))
                else:
                    up(places[-1] + middle, low)
    writer.rapid((*writer.here_mm[:2], clear_mm))
    return writer.moves()


def _cut_along(writer, places, low, feed):
    path = np.vstack([writer.here_mm[:2], places])
    path = np.ascontiguousarray(path[np.r_[True, np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-6]])
    for row, turn, cx, cy in lines_and_arcs(path, FIT_MM) if len(path) > 1 else ():
        end = (*path[int(row)], low)
        if turn == 0:
            writer.feed(end, feed)
        else:
            writer.arc(end, (cx, cy, low), Plane.XY, turn < 0, feed)


def met(moves, tool, limit_rad, box):
    """(share of the steered way within 5 % of the limit, most of it in degrees, its length in mm, (n,) of each move)."""
    x, y = box
    stock = lambda xy: np.where(((xy >= 0) & (xy <= (x, y))).all(axis=1), Z, -1.0)
    found = measure_cuts(moves, tool.cutter.radius_mm, 0.0, stock, (-1, -1, 0), (x + 1, y + 1, Z), PITCH_MM, 0.05, 0.5)
    ramp = moves.feed_mm_per_min == moves.feed_mm_per_min[moves.kind == Kind.FEED][0]
    steered = (found.engaged_rad > 0) & (found.fall_rad == 0) & ~(ramp if ramp.mean() < 0.5 else np.zeros(len(ramp), bool))
    way = feeds.move_lengths_mm(moves)
    within = way[steered & (found.engaged_rad <= 1.05 * limit_rad + METER_RAD)].sum() / way[steered].sum()
    return within, math.degrees(found.engaged_rad[steered].max()), way[steered].sum(), found.engaged_rad


def in_pieces(moves):
    """The same straight moves in pieces of at most LOOKED_AT_MM."""
    writer = MoveWriter(moves.start_mm)
    for start, end, kind, feed in zip(moves.starts_mm, moves.end_mm, moves.kind, moves.feed_mm_per_min):
        for share in np.linspace(0, 1, max(1, math.ceil(math.dist(start, end) / LOOKED_AT_MM)) + 1)[1:]:
            place = start + share * (end - start)
            writer.rapid(place) if kind == Kind.RAPID else writer.feed(place, feed)
    return writer.moves()


def longer_by_s(moves, tool, limit_rad, box):
    """What the loops take more where the feed is lowered until a tooth takes no more than at the limit."""
    pieces = in_pieces(moves)
    *_, engaged = met(pieces, tool, limit_rad, box)
    factor = np.maximum((1 - np.cos(np.minimum(engaged, np.pi))) / (1 - math.cos(1.05 * limit_rad + METER_RAD)), 1.0)
    cutting = pieces.kind != Kind.RAPID
    return float((60 * feeds.move_lengths_mm(pieces) / np.maximum(pieces.feed_mm_per_min, 1) * (factor - 1))[cutting].sum())


def row(seed):
    """One line of the table."""
    solid, size, corner, island = pocket(seed)
    box = tuple(s + 2 * RIM for s in size)
    ours, work = cleared(solid, *box)
    tool, limit = ours.tool, math.radians(ours.facts["engagement_deg"])
    _, feed = work.speeds(tool, is_rough=True)
    low, middle = Z - DEPTH + ALLOWANCE_MM, np.array(box) / 2
    levels, ramp = np.linspace(Z, low, ours.facts["levels"] + 1).tolist(), math.radians(work.practice.ramp_deg)
    capped = lambda moves: moves.with_feed(feeds.capped_feeds(moves, work.machine))
    ways = [w + middle for w in loops(size, corner, island, tool.cutter.radius_mm, ours.facts["stepover_mm"])]
    theirs = by_loops(ways, levels, ramp, feed, work.clearance_z_mm)
    minutes = lambda moves: feeds.times_s(moves, work.machine).sum() / 60
    held = minutes(capped(theirs)) + longer_by_s(theirs, tool, limit, box) / 60
    cells, others = [], [ours.moves, capped(theirs)]
    if area is not None:
        rules = (ramp, work.practice.plunge_share * feed, feed, work.clearance_z_mm)
        regions = adaptive(size, corner, island, tool, ours.facts["stepover_mm"])
        others.append(capped(by_adaptive(regions, middle, levels, rules)))
    for k, moves in enumerate(others):
        share, most, way, _ = met(moves, tool, limit, box)
        more = f" | {held:.2f}" if k == 1 else ""
        cells.append(f"{minutes(moves):.2f}{more} | {100 * share:.2f} | {most:.0f} | {way:.0f}")
    deep = f"{ours.facts['stepdown_mm']:.1f} x {ours.facts['stepover_mm']:.2f}"
    return f"| {seed} | {size[0]:.0f} x {size[1]:.0f} | {deep} | {math.degrees(limit):.1f} | {' | '.join(cells)} |"


def main(first, last):
    cells = "within 5 %, % of the way | most, deg | steered way, mm"
    peers = f" | FreeCAD: min | {cells}" if area is not None else ""
    head = f"| seed | pocket, mm | deep x wide, mm | limit, deg | min | {cells} | loops: min | held to the limit | {cells}{peers} |"
    print(f"{head}\n|{'---|' * (head.count('|') - 1)}", flush=True)
    for seed in range(first, last + 1):
        print(row(seed), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
