"""A circular side cutter on a right-angle head: the same passes with a wheel, simulated tilted, and its fixtures."""

import numpy as np
import pytest
from known_passes import LENGTHS, ZERO, machine
from known_vanes import BALL_MM, HALF_MM, RIDGE_MM, passes, predicted, steep_tip, wavy_tip

from cuspline.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.errors import PlanError
from cuspline.posted import PostedMoves
from cuspline.posts.linuxcnc import post
from cuspline.posts.rs274_reader import read_program
from cuspline.program import Operation, Program
from cuspline.simulation.swept import deviations_and_moves, swept_paths
from cuspline.toolpaths.side_cutter import SideCutter, nearest_to_fixtures, refuse_interference, with_wheel

TOOTH_MM, DISC_MM = BALL_MM, 25.0
HEAD = (((5.0, -12.0, -14.0), (60.0, 12.0, 120.0)),)
CUTTER = SideCutter(disc_radius_mm=DISC_MM, tooth_radius_mm=TOOTH_MM, width_mm=2 * TOOTH_MM, head_boxes_mm=HEAD)
TOOL = Tool(number=7, stick_out_mm=20, holder=Holder(name="arbor", segments=(
    HolderSegment(height_mm=30, lower_diameter_mm=20, upper_diameter_mm=20),)), cutter=Cutter(
        name="side cutter 50 R3", type="side", diameter_mm=2 * DISC_MM, corner_radius_mm=TOOTH_MM, flutes=12,
        flute_length_mm=2 * TOOTH_MM, neck_diameter_mm=16, reach_mm=15, shank_diameter_mm=16, overall_length_mm=30))
STOCK = (0.0, -HALF_MM, 0.0), (40.0, HALF_MM, 50.0)


def told(tip, restart_steps=50):
    balls, steps = passes(tip, TOOTH_MM, ball_radius_mm=0.0, restart_steps=restart_steps)
    return with_wheel(balls, CUTTER), steps


def read_with_the_head_on(tip):
    """The posted passes as the head drives the disc: its axis along +x, the tip the near face's middle."""
    p, _ = told(tip)
    finish = Operation(name="finish", tool=TOOL, spindle_rpm=800.0, coolant="flood", moves=p.moves(), passes=p)
    program = Program(name="disc", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=60.0,
                      header=("DISC",), operations=(finish,))
    moves = read_program(post(program, machine()).text, work_offsets=ZERO, tool_lengths=LENGTHS)
    axis = np.tile((1.0, 0.0, 0.0), (len(moves), 1))
    face = np.array([TOOTH_MM, 0.0, 0.0])
    return PostedMoves(**{**moves.__dict__, "start_axis": axis, "end_axis": axis, "start_mm": moves.start_mm - face,
                          "end_mm": moves.end_mm - face, "center_mm": moves.center_mm - face})


@pytest.mark.parametrize("shape", [wavy_tip, steep_tip])
def test_the_disc_leaves_what_a_ball_of_its_teeth_would_leave(shape):
    """In the transverse plane the wheel only spreads the teeth's centres along the arc's own normals."""
    tip, rng = shape(), np.random.default_rng(4)
    x, turn = rng.uniform(4.0, 36.0, 400), rng.uniform(-1, 1, 400) * 0.9
    if shape is steep_tip:
        x = rng.uniform(17.0, 36.0, 400)
    left, _ = deviations_and_moves(swept_paths(read_with_the_head_on(tip), {7: TOOL}), *STOCK, tip.point_mm(x, turn),
                                   tip.normal(x, turn), 2.0)
    over = left - predicted(tip, TOOTH_MM, x, turn)
    assert np.isfinite(over).all()
    assert over.min() > -3e-4
    assert 0.5 * RIDGE_MM < over.max() < RIDGE_MM + 3e-4


def test_the_centre_runs_on_arcs_wider_by_the_wheel():
    balls, _ = passes(wavy_tip(), TOOTH_MM, ball_radius_mm=0.0)
    one, other = balls.moves(), told(wavy_tip())[0].moves()
    arcs = one.kind >= 2
    radius = [np.linalg.norm((m.end_mm - m.center_mm)[arcs, 1:], axis=1) for m in (one, other)]
    assert np.abs(radius[1] - radius[0] - CUTTER.wheel_mm).max() < 1e-9
    assert np.abs(one.center_mm[arcs] - other.center_mm[arcs])[:, 1:].max() < 1e-9


JAW_Y = (HALF_MM, HALF_MM + 40.0)


def jaws(top):
    return [("moving jaw", (-5.0, JAW_Y[0], -30.0), (45.0, JAW_Y[1], top))]


def test_disc_and_head_are_held_against_the_fixture_over_the_whole_path():
    """At the foot the disc's lowest point and the head's underside are known: clearance is the height over the jaw."""
    moves = told(wavy_tip())[0].moves()
    low = moves.end_mm[:, 2].min()
    near = {n.part: n for n in nearest_to_fixtures(moves, CUTTER, jaws(-20.0))}
    assert near["disc"].clearance_mm == pytest.approx(low - DISC_MM + 20.0, abs=0.13)
    assert near["disc"].clearance_mm <= low - DISC_MM + 20.0
    assert near["head part 1"].clearance_mm == pytest.approx(low - 14.0 + 20.0, abs=0.13)
    refuse_interference(moves, CUTTER, jaws(-20.0))


def test_a_jaw_too_high_is_refused_with_part_amount_and_place():
    moves = told(wavy_tip())[0].moves()
    clear = moves.end_mm[:, 2].min() - DISC_MM
    refuse_interference(moves, CUTTER, jaws(clear - 1.2))
    said = r"its disc comes within 0\.\d\d mm of the moving jaw with the disc's middle at X"
    with pytest.raises(PlanError, match=said):
        refuse_interference(moves, CUTTER, jaws(clear - 0.9))
    wide = SideCutter(disc_radius_mm=DISC_MM, tooth_radius_mm=TOOTH_MM, width_mm=2 * TOOTH_MM,
                      head_boxes_mm=(((5.0, -12.0, -40.0), (60.0, 12.0, 120.0)),))
    with pytest.raises(PlanError, match="its head part 1 comes within -"):
        refuse_interference(moves, wide, jaws(clear - 1.2))


def test_a_disc_that_cannot_be_is_refused():
    with pytest.raises(PlanError, match="teeth of radius 5 mm do not go on a disc"):
        SideCutter(disc_radius_mm=25.0, tooth_radius_mm=5.0, width_mm=6.0, head_boxes_mm=())
    with pytest.raises(PlanError, match="leaves a flat"):
        SideCutter(disc_radius_mm=25.0, tooth_radius_mm=2.0, width_mm=6.0, head_boxes_mm=())
    with pytest.raises(ValueError, match="both|side cutter has"):
        Cutter(**{**TOOL.cutter.model_dump(), "corner_radius_mm": 4.0})
