"""What the edge meets, against brute force on random moves of a ball: python bench/engagement.py [moves]; a thousand in minutes."""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "parts"))
from brute_engagement import met, widest_arc  # noqa: E402
from known_programs import feed, program, tool  # noqa: E402

from cuspline.process.engagement import Look, engagement  # noqa: E402
from cuspline.replay.scene import FoundStock  # noqa: E402

RADIUS, IN_PROGRAM = 3.0, 7
LOW, HIGH = (-8.0, -8.0, -10.0), (8.0, 8.0, 0.0)
LOOK = Look(apart=1.0, ring_rad=np.radians(2.5), round_rad=np.radians(1.0))


def compared(rng, off, missed):
    """One program of random moves: each looked at in one place."""
    ends = rng.uniform((-7, -7, -2.5), (7, 7, -0.3), (IN_PROGRAM + 1, 3))
    ways = list(zip(ends[:-1], ends[1:]))
    stock = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=1.0)
    found = engagement(program(ends[0], [feed(*end) for end in ends[1:]]), {1: tool("ball", 2 * RADIUS)}, stock, LOOK)
    for row, (start, end) in enumerate(ways):
        mine = np.flatnonzero(found.row == row)
        if not len(mine):
            continue
        k = mine[len(mine) // 2]
        tip, way = found.tip_mm[k], (end - start) / np.linalg.norm(end - start)
        if np.linalg.norm(tip - start) < 0.4:
            continue
        wanted = met(tip, way, [*ways[:row], (start, tip - 0.1 * RADIUS * way)], RADIUS, (LOW, HIGH), rings=180, places=361)
        if wanted is None or not found.cuts[k]:
            missed.append(0.0 if wanted is None else (wanted[1] - wanted[0]) / RADIUS)
        else:
            off.append(((found.lowest_mm[k] - wanted[0]) / RADIUS, (found.highest_mm[k] - wanted[1]) / RADIUS,
                        (widest_arc(found.arcs[k], LOOK.ring_rad) - wanted[2]) / (2 * np.pi)))


def main(moves):
    rng, off, missed, began = np.random.default_rng(1), [], [], time.time()
    while len(off) + len(missed) < moves:
        compared(rng, off, missed)
    size = np.abs(off)
    print(f"{len(off):,} places in the cut, {len(missed):,} that one of both calls clear, by {max(missed, default=0):.4f} of the "
          f"radius at most; {time.time() - began:.0f} s")
    for name, column in zip(("lowest, of the radius", "highest, of the radius", "widest arc, of a turn"), size.T):
        share = ", ".join(f"{q:.0%} {np.quantile(column, q):.5f}" for q in (0.5, 0.9, 0.95, 0.99))
        print(f"{name:24s} {share}, largest {column.max():.5f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000)
