"""The source's test of hardened steel, computed: python bench/h13_test.py.

H13 of 48 HRC, a ball of 10.82 mm with 2 edges, 5000 rpm, 1270 mm/min, step 0.5 mm, layers of 0.25 to 1.25 mm, on a plane and on a
slope of 25 degrees: step-up, and the ball inclined in its feed.  Forces are means over the second pass.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "parts"))
from known_programs import feed, program, rapid, tool  # noqa: E402

from cuspline.process.engagement import Look, engagement  # noqa: E402
from cuspline.process.forces import forces  # noqa: E402
from cuspline.replay.scene import FoundStock  # noqa: E402
from cuspline.shop.cutting_forces import known_forces  # noqa: E402

RADIUS, STEP, SLOPE, RPM, FEED = 5.41, 0.5, np.radians(25), 5000.0, 1270.0
LAYERS = 0.25, 0.5, 0.75, 1.0, 1.25
WAYS = {"plane": (0.0, False), "step-up": (SLOPE, False), "inclined": (SLOPE, True)}
LOW, HIGH = (-16.0,) * 3, (16.0,) * 3


def met_in(layer_mm, turn, is_inclined):
    """(axial N, radial N, depth mm, lowest radius mm) of the second of two passes: means, and the largest depth."""
    zmap = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=0.5).zmap
    top = (zmap.xy_mm[:, 0] * np.tan(turn) + layer_mm / np.cos(turn)).reshape(zmap.shape).clip(-16, 16)
    stock = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=0.5, top_mm=top)
    up, out = np.array([np.cos(turn), 0, np.sin(turn)]), np.array([-np.sin(turn), 0, np.cos(turn)])
    across, stands = np.array([0, 1.0, 0]), out * RADIUS - np.array([0, 0, RADIUS])
    along, aside = (up, across) if is_inclined else (across, up)
    begin = stands - 14 * along
    second = begin + STEP * aside
    moves = [feed(*(begin + 28 * along)), rapid(0, 0, 60), rapid(*second[:2], 60), rapid(*second), feed(*(second + 28 * along))]
    posted = program(begin, moves, spindle_rpm=np.full(5, RPM), feed_mm_per_min=np.array([FEED, 0, 0, 0, FEED]))
    tools = {1: tool("ball", 2 * RADIUS, flute=20)}
    met = engagement(posted, tools, stock, Look.finer(2))
    mine = (met.row == 4) & (np.abs((met.tip_mm - stands) @ along) < 4)
    loads = forces(posted, tools, met, known_forces()["steel_h13_48hrc"])
    return (loads.axial_n[mine].mean(), loads.radial_n[mine].mean(), float(met.depth_mm[mine].max()),
            float(met.lowest_radius_mm[mine].min()))


def table():
    """{way: rows (layers, 4)}."""
    return {name: np.array([met_in(layer, *way) for layer in LAYERS]) for name, way in WAYS.items()}


def main():
    print("layer mm          " + "".join(f"{layer:>9.2f}" for layer in LAYERS))
    for name, rows in table().items():
        for column, what in enumerate(("axial N", "across N", "depth mm", "radius mm")):
            print(f"{name:10s}{what:>9s}" + "".join(f"{value:9.2f}" for value in rows[:, column]))


if __name__ == "__main__":
    main()
