"""Along the foot of upright walls the program's own flat cutters are what must fit, not the shop's smallest ball."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.verification.verdict import Options, verify_setup

SIZE, FLOOR, WALL_Y, R = (20, 16, 10), 6.0, 6.0, 3.0
FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=0.5, solid_pitch_mm=0.5, replay_pitch_mm=0.5, tessellation_mm=0.002)
TOOLS = {1: tool("flat", 2 * R)}
LEDGE = brep.the_solid(cq.Workplane().box(*SIZE, centered=False).cut(
    cq.Workplane(origin=(-1, WALL_Y, FLOOR)).box(30, 30, 9, centered=False)))
POCKET = brep.the_solid(cq.Workplane().box(*SIZE, centered=False).cut(
    cq.Workplane(origin=(10, 8, 5 + FLOOR)).box(14, 10, 10)))


def judged(solid, moves, ball_radius_mm=2.5):
    """SetupVerdict of its floor and walls above FLOOR less 0.1 that face inward."""
    faces = [f for f in brep.faces_of(solid) if f.middle.point_mm[0, 2] >= FLOOR and f.middle.point_mm[0, 2] < SIZE[2]
             and not np.isclose(f.middle.point_mm[0, :2], 0).any() and not np.isclose(f.middle.point_mm[0, :2], SIZE[:2]).any()]
    setup = Setup(name="setup-1", faces=("cut",), wcs_in_words="corner")
    return verify_setup(program((-6, 30, 40), moves), TOOLS, solid, faces, setup=setup, finish=FINISH, options=COARSE,
                        stock=StockBox(min_mm=(0, 0, 0), max_mm=SIZE), ball_radius_mm=ball_radius_mm)


def ledge_passes(stop_mm=0.0, wall_z=FLOOR):
    """The floor, line by line down to `stop_mm` before the wall, then along the wall at a height."""
    rows = [20.0, 17.0, 14.0, 11.0, WALL_Y + R + stop_mm]
    along = [rapid(-6, WALL_Y + R, 14), feed(-6, WALL_Y + R, wall_z), feed(26, WALL_Y + R, wall_z), rapid(26, WALL_Y + R, 14)]
    return [rapid(-6, 20, 14), *raster((-6, 26), rows, FLOOR), rapid(26, rows[-1], 14), *along]


def pocket_passes():
    """Once round a pocket of 14 x 10 mm, then its middle."""
    a, b, c, d = 3 + R, 17 - R, 3 + R, 13 - R
    ring = [(a, c), (b, c), (b, d), (a, d), (a, c), (a + 4, 8), (b - 2, 8)]
    return [rapid(a, c, 14), *(feed(x, y, FLOOR) for x, y in ring), rapid(b - 2, 8, 14)]


@pytest.fixture(scope="module")
def good():
    return judged(LEDGE, ledge_passes())


def test_floor_and_wall_that_meet_are_reached_to_the_last_square(good):
    d = good.as_dict()
    assert not good.findings and d["area_unreachable_mm2"] == 0.0 and not d["unreachable"]
    assert d["area_reached_mm2"] == pytest.approx(20 * 10 + 20 * 4, abs=1e-3) and d["excess_max_mm"] < 1e-6


def test_a_floor_that_stops_one_millimetre_before_its_wall_is_excess():
    found = judged(LEDGE, ledge_passes(stop_mm=1.0, wall_z=FLOOR + 1.0)).findings
    assert {f.kind for f in found} <= {"excess", "missing_area"} and found
    assert max(f.amount_mm for f in found) == pytest.approx(1.0, abs=0.02)       # at samples, less than one spacing from the wall
    assert any("let its floor pass run up to the wall" in f.advice for f in found)
    assert all(WALL_Y <= f.place_mm[1] <= WALL_Y + 1.0 + 1e-6 for f in found)


def test_a_wall_pass_a_tenth_too_high_is_excess_at_the_foot():
    found = judged(LEDGE, ledge_passes(stop_mm=0.5, wall_z=FLOOR + 0.1)).findings
    assert found and max(f.amount_mm for f in found) == pytest.approx(0.1, abs=0.01)


def test_sharp_inner_corners_stay_and_are_listed_with_the_radius_of_the_cutter():
    v = judged(POCKET, pocket_passes(), ball_radius_mm=3.5)
    left = v.as_dict()["unreachable"]
    assert not v.findings and len(left) == 4 and {row["stays_radius_mm"] for row in left} == {R}
    outer = [np.where(np.array(row["place_mm"]) < (10, 8, 8), row["min_mm"], row["max_mm"])[:2] for row in left]
    corners = {tuple(xy.round().astype(int).tolist()) for xy in outer}
    assert corners == {(3, 3), (17, 3), (17, 13), (3, 13)}
    # of the floor 4 times r2 (1 - pi / 4), of the walls 8 times r times the height: all but what runs out
    assert v.as_dict()["area_unreachable_mm2"] < 4 * R * R * (1 - np.pi / 4) + 8 * R * 4
