"""Seeded pockets round an island: how well the engagement keeps its limit, time beside plain offset loops by the same feed model.

    python bench/pocketing.py FIRST LAST

The loops are contours of the distance to the walls, one stepover apart, from the innermost out, down the innermost one by a
ramp: what a program that offsets its border makes.  They are run at the feed of the clearing, on the same levels.
"""

import math
import random
import sys
from pathlib import Path

import cadquery as cq
import contourpy
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/parts")]

from clearing_meter import measure_cuts  # noqa: E402

from cuspline.app import catalogue  # noqa: E402
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox  # noqa: E402
from cuspline.planning import feeds  # noqa: E402
from cuspline.planning.plan import plan_setup  # noqa: E402
from cuspline.planning.strategies.pocket import Pocket  # noqa: E402
from cuspline.program.program import Kind, MoveWriter  # noqa: E402

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
Z, DEPTH, RIM, ALLOWANCE_MM = 12.0, 6.0, 4.0, 0.3
METER_RAD = math.radians(3.0)       # a bin of the meter
PITCH_MM, TOLERANCE_MM = 0.1, 0.02


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


def met(moves, tool, limit_rad, box):
    """(share of the steered way within 5 % of the limit, largest engagement of it in degrees, its length in mm)."""
    x, y = box
    stock = lambda xy: np.where(((xy >= 0) & (xy <= (x, y))).all(axis=1), Z, -1.0)
    found = measure_cuts(moves, tool.cutter.radius_mm, 0.0, stock, (-1, -1, 0), (x + 1, y + 1, Z), PITCH_MM, 0.05, 0.5)
    ramp = moves.feed_mm_per_min == moves.feed_mm_per_min[moves.kind == Kind.FEED][0]
    steered = (found.engaged_rad > 0) & (found.fall_rad == 0) & ~(ramp if ramp.mean() < 0.5 else np.zeros(len(ramp), bool))
    way = feeds.move_lengths_mm(moves)
    within = way[steered & (found.engaged_rad <= 1.05 * limit_rad + METER_RAD)].sum() / way[steered].sum()
    return within, math.degrees(found.engaged_rad[steered].max()), way[steered].sum()


def row(seed):
    """One line of the table."""
    solid, size, corner, island = pocket(seed)
    box = tuple(s + 2 * RIM for s in size)
    ours, work = cleared(solid, *box)
    tool, limit = ours.tool, math.radians(ours.facts["engagement_deg"])
    _, feed = work.speeds(tool, is_rough=True)
    low = Z - DEPTH + ALLOWANCE_MM
    levels = np.linspace(Z, low, ours.facts["levels"] + 1).tolist()
    ways = [w + np.array(box) / 2 for w in loops(size, corner, island, tool.cutter.radius_mm, ours.facts["stepover_mm"])]
    theirs = by_loops(ways, levels, math.radians(work.practice.ramp_deg), feed, work.clearance_z_mm)
    theirs = theirs.with_feed(feeds.capped_feeds(theirs, work.machine))
    cells = []
    for moves in (ours.moves, theirs):
        share, most, way = met(moves, tool, limit, box)
        cells.append(f"{feeds.times_s(moves, work.machine).sum() / 60:.2f} | {100 * share:.2f} | {most:.0f} | {way:.0f}")
    return f"| {seed} | {size[0]:.0f} x {size[1]:.0f} | {math.degrees(limit):.1f} | {' | '.join(cells)} |"


def main(first, last):
    both = "min | within 5 %, % of the way | most, deg | steered way, mm"
    print(f"| seed | pocket, mm | limit, deg | {both} | loops: {both} |\n|{'---|' * 11}", flush=True)
    for seed in range(first, last + 1):
        print(row(seed), flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
