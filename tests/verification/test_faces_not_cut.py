"""A face that the setup names and that no cutter comes near is a finding; what only comes out rounder than drawn is none."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.surfaces.holes import holes_of
from cuspline.verification.faces_not_cut import gaps, point_left_mm
from cuspline.verification.verdict import Options, verify_setup

FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=0.6, solid_pitch_mm=0.2, replay_pitch_mm=0.5, tessellation_mm=0.002)
R, BALL_MM = 5.0, 3.0
BLOCK = cq.Workplane().box(20, 16, 10, centered=False)


def slot(width, depth):
    return BLOCK.cut(cq.Workplane("XY", origin=(-1, 8 - width / 2, 10 - depth)).box(22, width, depth, centered=False))


def verdict(part, faces, below_mm=0.0, radius=R, ys=np.arange(-0.3, 16.7, 0.6), z=10.0):
    """A raster by a ball, over z = 10 unless told otherwise; `faces`: predicate of a normal and a middle."""
    solid = brep.the_solid(part)
    chosen = [f for f in brep.faces_of(solid) if faces(f.middle.normal[0], f.middle.point_mm[0])]
    posted = program((-6, -0.3, 40), [rapid(-6, ys[0], 14), *raster((-6, 26), ys, z), rapid(26, ys[-1], 14)])
    return verify_setup(posted, {1: tool("ball", 2 * radius)}, solid, chosen, finish=FINISH, ball_radius_mm=BALL_MM, options=COARSE,
                        setup=Setup(name="setup-1", wcs_in_words="corner", faces=("top",)),
                        stock=StockBox(min_mm=(0, 0, -below_mm), max_mm=(20, 16, 12)))


def inside(n, p):
    """The top and what lies below it, without the block's own sides."""
    return n[2] > -0.5 and 0.01 < p[0] < 19.99 and 0.01 < p[1] < 15.99


@pytest.mark.parametrize("width, depth", [(4.0, 3.0), (2.0, 0.8)])
def test_a_slot_narrower_than_every_cutter_is_told_with_its_area(width, depth):
    told, = verdict(slot(width, depth), inside).findings
    assert told.kind == "face_not_cut" and told.is_at_least
    assert f"over {20 * width:.0f} mm²" in told.advice and "narrow enough" in told.advice
    assert abs(told.place_mm[1] - 8) < width / 2 + 1e-6 and told.place_mm[2] > 10 - depth - 1e-6


@pytest.mark.parametrize("rise, told", [(2.5, []), (9.0, ["face_not_cut"])])
def test_walls_of_a_narrow_slot_through_the_part_are_told_and_a_low_wall_with_a_round_foot_is_not(rise, told):
    """The foot of a step stays round by the ball that runs along it; into a slot of 2 mm nothing comes."""
    step = BLOCK.cut(cq.Workplane("XY", origin=(-1, 9, 10 - rise)).box(22, 9, 9, centered=False))
    through = BLOCK.cut(cq.Workplane("XY", origin=(4, 7, -1)).box(12, 2, 12, centered=False))
    wall = lambda n, p: abs(n[1]) > 0.5 and 0.1 < p[1] < 15.9
    beside = np.arange(9 + BALL_MM, 19.1, 0.25)
    found = (verdict(step, wall, radius=BALL_MM, ys=beside, z=10 - rise) if rise < 5 else verdict(through, wall)).findings
    assert sorted({f.kind for f in found if f.kind == "face_not_cut"}) == told


def test_a_hole_that_nothing_drills_is_told():
    told, = verdict(BLOCK.cut(cq.Workplane("XY").circle(1.5).extrude(10).translate((10, 8, 0))), inside).findings
    assert told.kind == "face_not_cut" and told.amount_mm >= 2.0


@pytest.mark.parametrize("width, told", [(8.0, ["face_not_cut"] * 2), (15.0, [])])
def test_a_floor_most_of_which_a_ball_leaves_round_is_told(width, told):
    """Passes of the smallest ball as near to sharp upright walls as it comes: 0.6 mm beside its last one it leaves 0.06 mm."""
    ways = np.arange(8 - width / 2 + BALL_MM, 8 + width / 2 - BALL_MM + 1e-9, 0.25)
    floor = lambda n, p: n[2] > 0.5 and p[2] < 7.5
    assert [f.kind for f in verdict(slot(width, 3.0), floor, radius=BALL_MM, ys=ways, z=7.0).findings] == told


def test_a_named_face_that_looks_away_is_told_where_stock_stands_on_it():
    below = lambda n, p: abs(n[2]) > 0.5
    told, = verdict(BLOCK, below, below_mm=1.0).findings
    assert told.kind == "face_not_cut" and told.amount_mm == pytest.approx(1.0) and "faces away from the tool" in told.advice
    assert verdict(BLOCK, below).findings == ()


def test_a_hollow_that_comes_out_rounder_than_drawn_is_listed_and_no_finding():
    """A groove of R2 in the top, 0.3 mm deep, and balls of 3 mm at the least: what stays is less than the radius."""
    groove = BLOCK.cut(cq.Workplane("YZ", origin=(-1, 8, 11.7)).circle(2.0).extrude(22))
    found = verdict(groove, inside)
    assert found.findings == () and sum(row["area_mm2"] for row in found.as_dict()["unreachable"]) > 20


def test_a_flat_bottom_may_keep_the_point_of_the_drill_that_made_its_hole():
    """Blind holes of 6 and 8 mm drawn with flat bottoms, a drill of 6 mm in the program: 3 mm over tan(70 degrees) stay."""
    block = BLOCK.faces(">Z").workplane(origin=(5, 8, 10)).hole(6.0, 5.0).faces(">Z").workplane(origin=(14, 8, 10)).hole(8.0, 5.0)
    faces = brep.faces_of(brep.the_solid(block))
    drill = tool("ball", 6).cutter.model_copy(update={"type": "drill", "corner_radius_mm": 0.0, "point_angle_deg": 140.0})
    (bottom, left), = point_left_mm(holes_of(faces), [drill]).items()
    assert left == pytest.approx(3.0 / np.tan(np.radians(70)))
    assert faces[bottom].middle.point_mm[0] == pytest.approx((5, 8, 5), abs=0.1) and faces[bottom].kind == "plane"
    assert point_left_mm(holes_of(faces), []) == {}


@pytest.mark.parametrize("width, is_gap", [(2.0, True), (6.8, False), (0.0, False)])
def test_a_gap_in_a_step_is_known_from_a_foot_beside_what_was_not_cut(width, is_gap):
    """A floor that is cut in front of a step, into which a gap runs 8 mm deep: balls of 3 mm have room in it or not."""
    before = BLOCK.cut(cq.Workplane("XY", origin=(0, 0, 7)).box(20, 6, 9, centered=False))
    part = before.cut(cq.Workplane("XY", origin=(10 - width / 2, 5, 7)).box(width, 9, 9, centered=False)) if width else before
    floor = lambda n, p: n[2] > 0.5 and p[2] < 7.5
    found = verdict(part, floor, radius=BALL_MM, ys=np.arange(-0.3, 2.8, 0.3), z=7.0).residuals
    faces = [f for f in brep.faces_of(brep.the_solid(part)) if floor(f.middle.normal[0], f.middle.point_mm[0])]
    assert len(faces) == 1 and bool(gaps(found, faces, BALL_MM, FINISH, np.array([0, 0, 1.0]))) is is_gap


@pytest.mark.parametrize("width, is_gap", [(2.6, True), (6.4, False)])
def test_a_keyway_that_no_cutter_enters_is_a_gap_and_no_inner_corner(width, is_gap):
    """A groove across a slot's wall, 1.5 mm deep, none of it farther from what is cut than the radius of the balls of 3 mm; beside
    it what stays in the slot's own corners."""
    part = slot(8.0, 3.0).cut(cq.Workplane("XY", origin=(8, 11, 7)).box(width, 2.5, 9, centered=(True, False, False)))
    wall = lambda n, p: abs(n[2]) < 0.5 and 4 < p[1] < 13.6 and p[2] > 7
    found = verdict(part, wall, radius=BALL_MM, ys=np.arange(4 + BALL_MM, 12 - BALL_MM + 1e-9, 0.25), z=7.0)
    faces = [f for f in brep.faces_of(brep.the_solid(part)) if wall(f.middle.normal[0], f.middle.point_mm[0])]
    assert bool(gaps(found.residuals, faces, BALL_MM, FINISH, np.array([0, 0, 1.0]))) is is_gap
    keyway = [row for row in found.as_dict()["unreachable"] if row["max_mm"][1] > 12.5 and row["area_mm2"] > 1.0]
    assert not is_gap or (keyway and all("stays_radius_mm" not in row for row in keyway))
