"""Tool axes that clear what is in the way: 20 000 contacts on the floor of a channel between two bent walls, one thread.

A ball of 8 mm, 45 mm out of a holder of 40 mm; the walls are 54 and 50 mm tall, so that the holder is in the way everywhere.
Each contact is looked at along its standard direction, then both ways in the plane square to that of axis and normal, up to 60
degrees; `over both angles` looks at 36 bearings.
"""

import math
import sys
import time
from pathlib import Path

import numpy as np

from cuspline.toolpaths.five_axis.clear_axes import ways_of
from cuspline.values.threads import set_thread_count

sys.path[:0] = [str(Path(__file__).parents[1] / "tests" / part) for part in ("parts", "toolpaths/five_axis")]

COUNT, OVER_BOTH = 20_000, 200


def measure():
    """[(what, number, unit)]."""
    from test_clear_axes import MOST_RAD, contacts, searched
    set_thread_count(1)
    search, (middles, axes, normals) = searched(), contacts(COUNT, seed=1)
    search.is_clear(middles[:8], axes[:8])                  # kernels are compiled, or read
    search.angles_rad(middles[:8], axes[:8], ways_of(axes[:8], normals[:8], np.zeros(8)), 0.1)
    begin = time.process_time()
    in_way = ~search.is_clear(middles, axes)
    best = np.where(in_way, np.inf, 0.0)
    for bearing in (math.pi / 2, -math.pi / 2):
        ways = ways_of(axes[in_way], normals[in_way], np.full(in_way.sum(), bearing))
        best[in_way] = np.minimum(best[in_way], search.angles_rad(middles[in_way], axes[in_way], ways, MOST_RAD))
    plane_s = time.process_time() - begin
    rows = np.flatnonzero(in_way)[:OVER_BOTH]
    begin = time.process_time()
    both, _ = search.over_both_rad(middles[rows], axes[rows], normals[rows], MOST_RAD)
    return [("contacts", COUNT, ""), ("of them in the way along the standard direction", int(in_way.sum()), ""),
            ("cleared in the plane", int(np.isfinite(best[in_way]).sum()), ""),
            ("in the plane, a contact", round(1e6 * plane_s / COUNT), "CPU us"),
            ("over both angles, a contact that is in the way", round(1e6 * (time.process_time() - begin) / len(rows)), "CPU us"),
            ("cleared over both angles", round(float(np.isfinite(both).mean()), 3), "share")]


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what:60s} {number:12.4g} {unit}")
