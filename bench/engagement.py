"""What the edge meets, against brute force on random moves of a ball: python bench/engagement.py [moves]; minutes."""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "parts"))
from brute_engagement import met, off_by  # noqa: E402
from known_programs import feed, program, tool  # noqa: E402

from cuspline.process.engagement import Look, engagement  # noqa: E402
from cuspline.replay.scene import FoundStock  # noqa: E402

RADIUS, IN_PROGRAM, BEHIND, TOGETHER = 3.0, 7, 0.1, 1_000
BOX = (-8.0, -8.0, -10.0), (8.0, 8.0, 0.0)
STOCK = FoundStock(min_mm=BOX[0], max_mm=BOX[1], pitch_mm=1.0)
LOOKS = {"fine": Look(apart=1.0, ring_rad=np.radians(2.5), round_rad=np.radians(1.0)), "as builds look": Look(apart=1.0)}


def random_places(rng, look):
    """[(found, tip, way, moves before it)] of one program of random moves: each looked at in one place, `found` as `met` has it."""
    ends = rng.uniform((-7, -7, -2.5), (7, 7, -0.3), (IN_PROGRAM + 1, 3))
    ways = list(zip(ends[:-1], ends[1:]))
    found = engagement(program(ends[0], [feed(*end) for end in ends[1:]]), {1: tool("ball", 2 * RADIUS)}, STOCK, look)
    for row, (start, end) in enumerate(ways):
        mine = np.flatnonzero(found.row == row)
        if not len(mine):
            continue
        k, way = mine[len(mine) // 2], (end - start) / np.linalg.norm(end - start)
        if np.linalg.norm(found.tip_mm[k] - start) < 0.4:
            continue
        yield ((found.lowest_mm[k], found.highest_mm[k], found.immersion_rad[k]), found.tip_mm[k], way,
               [*ways[:row], (start, found.tip_mm[k] - BEHIND * RADIUS * way)])


def main(moves):
    for name, look in LOOKS.items():
        rng, off, missed, began = np.random.default_rng(1), [], [], time.process_time()
        while len(off) + len(missed) < moves:
            places = []
            while len(places) < TOGETHER:
                places += random_places(rng, look)
            found, tips, ways, before = zip(*places)
            here, gone = off_by(np.array(found), met(tips, ways, before, RADIUS, BOX, rings=360), RADIUS)
            off, missed = [*off, *here], [*missed, *gone]
        print(f"{name}: {len(off):,} places in the cut, {len(missed):,} that one of both calls clear, by "
              f"{max(missed, default=0):.4f} of the radius at most; {time.process_time() - began:.0f} CPU s")
        for what, column in zip(("lowest, of the radius", "highest, of the radius", "immersion, of a turn"), np.abs(off).T):
            share = ", ".join(f"{q:.1%} {np.quantile(column, q):.5f}" for q in (0.5, 0.95, 0.99, 0.999))
            print(f"{what:24s} {share}, largest {column.max():.5f}; {(column > 0.01).sum()} beyond 1 %")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
