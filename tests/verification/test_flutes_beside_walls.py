"""A wall higher than the flutes that finish it, roughed a little short of it by longer ones: what stays there is told."""

import cadquery as cq
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.shop.cutters import Cutter, Tool
from cuspline.verification.verdict import Options, verify_setup

WALL_Y, FLOOR_Z, TOP_Z, R, LEFT = 8.0, 2.0, 12.0, 4.0, 0.08
PART = brep.the_solid(cq.Workplane().box(20, 16, TOP_Z, centered=False).cut(
    cq.Workplane("XY", origin=(-1, WALL_Y, FLOOR_Z)).box(22, 9, 20, centered=False)))
FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=0.6, solid_pitch_mm=0.2, replay_pitch_mm=0.5, tessellation_mm=0.002)


def flat(number, flutes_mm):
    """A flat cutter of 8 mm whose neck is 0.15 mm thinner all round."""
    cutter = Cutter(name=f"flat {number}", type="flat", diameter_mm=2 * R, corner_radius_mm=0.0, flutes=2, reach_mm=40.0,
                    flute_length_mm=flutes_mm, neck_diameter_mm=2 * R - 0.3, shank_diameter_mm=2 * R, overall_length_mm=90.0)
    return Tool(number=number, cutter=cutter, holder=tool("ball", 6).holder, stick_out_mm=50.0)


def along(y, z):
    return [rapid(-6, y, 20), rapid(-6, y, z), feed(26, y, z), rapid(26, y, 20)]


def verdict(levels):
    """Down to the floor and LEFT short of the wall by flutes of 20 mm, then along the wall by flutes of 6 mm at several heights."""
    rough = [along(y, z) for z in (10, 8, 6, 4, FLOOR_Z) for y in (16.0, WALL_Y + R + LEFT)]
    fine = [along(WALL_Y + R, z) for z in levels]
    posted = program((-6, 16, 40), sum(rough + fine, []), tool=[1] * 4 * len(rough) + [2] * 4 * len(fine))
    faces = [f for f in brep.faces_of(PART)
             if abs(f.middle.point_mm[0, 1] - WALL_Y) < 1e-6 or abs(f.middle.point_mm[0, 2] - FLOOR_Z) < 1e-6]
    return verify_setup(posted, {1: flat(1, 20.0), 2: flat(2, 6.0)}, PART, faces, ball_radius_mm=3.0, options=COARSE, finish=FINISH,
                        setup=Setup(name="setup-1", wcs_in_words="corner", faces=("wall", "floor")),
                        stock=StockBox(min_mm=(0, 0, 0), max_mm=(20, 16, TOP_Z)))


def test_what_hangs_beside_the_neck_is_told_and_the_verifiers_agree():
    told, = verdict([FLOOR_Z]).findings
    assert told.kind == "missing_area" and told.amount_mm == pytest.approx(LEFT, abs=1e-6)
    assert "flutes that end below" in told.advice and told.place_mm[2] > FLOOR_Z + 6.0
    assert "80" in told.advice


@pytest.mark.parametrize("levels", [[7.0, FLOOR_Z], [FLOOR_Z, 7.0]])
def test_in_steps_no_deeper_than_the_flutes_the_wall_is_finished(levels):
    found = verdict(levels)
    assert found.findings == () and found.as_dict()["ok"]
