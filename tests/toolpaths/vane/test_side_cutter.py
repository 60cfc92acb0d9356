"""A circular side cutter on a right-angle head: the same passes with a wheel, simulated tilted, and its fixtures."""

import re

import numpy as np
import pytest
from known_passes import ZERO, machine
from known_tools import on_a_head
from known_vanes import BALL_MM, HALF_MM, RIDGE_MM, passes, predicted, steep_tip, wavy_tip

from cuspline.app import catalogue
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.posts.writers.linuxcnc import post
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Operation, Program
from cuspline.replay.head_clearance import PITCH_MM, StockCells, nearest_to_fixtures, put_contacts, stations
from cuspline.replay.replay_kernel import FIXTURE, HOLDER, RAPID
from cuspline.replay.scene import Fixture
from cuspline.shop.cutters import Cutter, HeadBox, Tool
from cuspline.stock.swept import deviations_and_moves, swept_paths
from cuspline.toolpaths.vane.side_cutter import refuse_interference, with_wheel
from cuspline.values.errors import PlanError, ReadError

TOOL = on_a_head()
DISC, DISC_MM = TOOL.cutter, TOOL.cutter.radius_mm
TOOTH_MM = BALL_MM
STOCK = (0.0, -HALF_MM, 0.0), (40.0, HALF_MM, 50.0)


def told(tip, restart_steps=50):
    balls, steps = passes(tip, TOOTH_MM, ball_radius_mm=0.0, restart_steps=restart_steps)
    return with_wheel(balls, TOOL), steps


def read_with_the_head_on(tip):
    """The posted passes as the head drives the disc: its axis along +x, the tip the near face's middle."""
    p, _ = told(tip)
    finish = Operation(name="finish", tool=TOOL, spindle_rpm=800.0, coolant="flood", moves=p.moves(), passes=p)
    program = Program(name="disc", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=60.0,
                      header=("DISC",), operations=(finish,))
    moves = read_program(post(program, machine()).text, work_offsets=ZERO, tool_lengths={7: TOOL.offset_mm})
    return moves.on_head(7, TOOL.head.axis, TOOL.driven_mm)


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
    arcs = [m.kind >= 2 for m in (one, other)]
    radius = [np.linalg.norm((m.end_mm - m.center_mm)[a, 1:], axis=1) for m, a in zip((one, other), arcs)]
    assert np.abs(radius[1] - radius[0] - TOOL.wheel_mm).max() < 1e-9
    assert np.abs(one.center_mm[arcs[0]] - other.center_mm[arcs[1]])[:, 1:].max() < 1e-9


def test_the_disc_goes_up_beside_the_body():
    """Its widest place would pass through the flank over the foot."""
    moves = told(wavy_tip())[0].moves()
    up = np.flatnonzero((moves.kind == 0) & (moves.end_mm[:, 2] > moves.starts_mm[:, 2] + 1.0))
    assert len(up) > 50 and (np.abs(moves.starts_mm[up, 1]) - DISC_MM > HALF_MM + 1.0).all()


def jaws(top):
    return [Fixture(name="moving jaw", min_mm=(-5.0, HALF_MM, -30.0), max_mm=(45.0, HALF_MM + 40.0, top))]


def test_disc_and_head_are_held_against_the_fixture_over_the_whole_path():
    """At the foot the disc's lowest point and the head's underside are known: clearance is the height over the jaw."""
    moves = told(wavy_tip())[0].moves()
    low = moves.end_mm[:, 2].min()
    near = {n.part: n for n in nearest_to_fixtures(stations(moves.starts_mm, moves), TOOL, jaws(-20.0))}
    assert near["cutter"].clearance_mm == pytest.approx(low - DISC_MM + 20.0, abs=0.13)
    assert near["cutter"].clearance_mm <= low - DISC_MM + 20.0
    assert near["head"].clearance_mm == pytest.approx(low - 14.0 + 20.0, abs=0.13)
    refuse_interference(moves, TOOL, jaws(-20.0))


def test_a_jaw_too_high_is_refused_with_part_amount_and_place():
    moves = told(wavy_tip())[0].moves()
    clear = moves.end_mm[:, 2].min() - DISC_MM
    refuse_interference(moves, TOOL, jaws(clear - 1.2))
    said = r"its cutter comes within 0\.\d\d mm of the moving jaw with the cutter's middle at X"
    with pytest.raises(PlanError, match=said):
        refuse_interference(moves, TOOL, jaws(clear - 0.9))
    with pytest.raises(PlanError, match="its head comes within -"):
        refuse_interference(moves, on_a_head(low=-40.0), jaws(clear - 1.2))


def test_a_disc_that_cannot_be_is_refused():
    with pytest.raises(ValueError, match="both|side-and-face cutter has"):
        Cutter(**{**DISC.model_dump(), "corner_radius_mm": 4.0})
    flat = Cutter(**{**DISC.model_dump(), "corner_radius_mm": 2.0})
    with pytest.raises(ValueError, match="gouges wherever the surface slopes"):
        Tool(**{**TOOL.model_dump(), "cutter": flat})
    with pytest.raises(ValueError, match="a larger max_mm"):
        HeadBox(min_mm=(0, 0, 0), max_mm=(1, 1, 0))


def test_fanuc_sends_the_machine_to_the_same_places_with_a_shifted_zero():
    """G43 moves Z alone there: G52 takes the head's offset, and is taken back before the program ends."""
    p, _ = told(wavy_tip())
    finish = Operation(name="finish", tool=TOOL, spindle_rpm=800.0, coolant="flood", moves=p.moves(), passes=p)
    planned = Program(name="disc", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=60.0, header=("DISC",),
                      operations=(finish,))
    texts = {name: catalogue.find_post(name).post(planned, machine(name)).text for name in ("linuxcnc", "fanuc")}
    moves = {name: catalogue.reader_of(machine(name))(text, work_offsets=ZERO, tool_lengths={7: TOOL.offset_mm})
             for name, text in texts.items()}
    shifts = re.findall("G52 X(.*) Y0. Z0.", texts["fanuc"])
    assert shifts == ["0.", "60.", "0."]
    cut = {name: m.kind != 0 for name, m in moves.items()}
    assert cut["fanuc"].sum() == cut["linuxcnc"].sum() > 500
    for column in ("machine_end_mm", "end_mm"):
        one, other = (getattr(moves[name], column)[cut[name]] for name in ("linuxcnc", "fanuc"))
        assert np.abs(one - other).max() < 1e-9
    assert moves["fanuc"].remarks == ()
    # without the shift the disc runs beside its place by the head's offset, and the reader says so
    gone = texts["fanuc"].replace("G52 X60. Y0. Z0.\n", "")
    off = catalogue.reader_of(machine("fanuc"))(gone, work_offsets=ZERO, tool_lengths={7: TOOL.offset_mm})
    assert np.abs((off.end_mm - moves["fanuc"].end_mm)[off.kind != 0] - (-60.0, 0.0, 0.0)).max() < 1e-9
    with pytest.raises(ReadError, match="G52 that shifts the zero"):
        catalogue.reader_of(machine("fanuc"))(texts["fanuc"].replace("X60.", "X59."), work_offsets=ZERO,
                                              tool_lengths={7: TOOL.offset_mm})


def test_the_tool_tables_x_goes_into_the_machines_coordinates_and_not_into_the_parts():
    moves = read_with_the_head_on(wavy_tip())
    cutting = moves.kind != 0
    driven = (moves.end_mm + TOOL.driven_mm * np.array(TOOL.head.axis))[cutting]
    assert TOOL.offset_mm == (60.0, 0.0, 150.0)
    assert np.abs(moves.machine_end_mm[cutting] - driven - TOOL.offset_mm - ZERO["G55"]).max() < 1e-9


# the stock ---------------------------------------------------------------------------------------------


def stepped_stock(xy, radius):
    """20 mm high for x < 20, 30 mm from there on."""
    return np.where(xy[:, 0] + radius < 20.0, 20.0, 30.0)


def cells():
    return StockCells.over(np.zeros(3), np.array([40.0, 18.0, 50.0]), stepped_stock)


def test_the_stock_under_a_box_and_a_disc_is_bounded_from_above_and_hardly_more():
    rng, stock = np.random.default_rng(8), cells()
    points = rng.uniform((-30.0, -40.0, 0.0), (70.0, 60.0, 0.0), (4000, 3))
    xy = points[:, :2]
    covered = lambda low, high: (xy + high >= (0.0, 0.0)).all(axis=1) & (xy + low <= (40.0, 18.0)).all(axis=1)
    low, high = np.array([-3.0, -4.0]), np.array([6.0, 5.0])
    step = lambda m: np.where(points[:, 0] + high[0] + m >= 20.0, 30.0, 20.0)
    true = lambda m: np.where(covered(low - m, high + m), step(m), -np.inf)
    found = stock.under_box_mm(points, low, high, 0.0)
    assert (found >= true(0.0)).all() and (found <= true(2 * PITCH_MM)).all()
    lifts = lambda m: [np.where(reached, height + np.sqrt(np.maximum((10.0 + m) ** 2 - dy ** 2, 0.0)), -np.inf)
                       for dy in [np.maximum(np.maximum(-points[:, 1], points[:, 1] - 18.0), 0.0)]
                       for first, last, height in ((0.0, 20.0, 20.0), (20.0, 40.0, 30.0))
                       for along in [(points[:, 0] + 3.0 + m >= first) & (points[:, 0] - 3.0 - m <= last)]
                       for reached in [(dy <= 10.0 + m) & along]]
    found = stock.over_disc_mm(points, 3.0, 10.0, np.zeros(len(points)))
    lowest, highest = (np.max(lifts(m), axis=0) for m in (0.0, 2 * PITCH_MM))
    assert (found >= lowest - 1e-9).all() and (found <= highest + 1e-9).all()


def contacts(moves, fixtures=(), tool=TOOL):
    worst = np.full((4, len(moves), 4), -np.inf)
    nearest, place = put_contacts(worst, moves, tool, fixtures, cells(), np.array([0.0, 0.0, 1.0]))
    return worst, nearest, place


def hung(kind, start, end):
    """One move of the disc's middle."""
    back = TOOL.driven_mm * np.array(TOOL.head.axis)
    one = lambda v: np.array([v], float)
    return PostedMoves(kind=[kind], start_mm=one(start) - back, end_mm=one(end) - back, center_mm=one((np.nan,) * 3),
                       plane=[0], turns=[0], feed_mm_per_min=[0 if kind == 0 else 100], spindle_rpm=[500], tool=[7],
                       length_offset_on=[True], machine_end_mm=one(end), line=[3], operation=[-1], operations=(),
                       ended=True, start_axis=[TOOL.head.axis], end_axis=[TOOL.head.axis])


def test_a_rapid_of_the_disc_through_stock_and_a_head_over_it_are_found_with_their_depths():
    """The disc, 25 mm, over stock 20 mm high; the head beyond x + 12 stands over the step to 30 mm."""
    worst, nearest, _ = contacts(hung(0, (5.0, 9.0, 60.0), (5.0, 9.0, 46.0)))
    assert worst[RAPID, 0, 0] == -np.inf and worst[HOLDER, 0, 0] == -np.inf and nearest == pytest.approx(1.0)
    worst, _, _ = contacts(hung(0, (5.0, 9.0, 60.0), (5.0, 9.0, 44.0)))
    assert worst[RAPID, 0, 0] == pytest.approx(1.0, abs=0.15) and worst[RAPID, 0, 3] == 44.0
    worst, nearest, place = contacts(hung(1, (5.0, 9.0, 60.0), (5.0, 9.0, 43.0)))
    assert worst[RAPID, 0, 0] == -np.inf                                    # it cuts
    assert worst[HOLDER, 0, 0] == pytest.approx(1.0 - (43.0 - 14.0 - 30.0), abs=0.2)
    assert nearest == pytest.approx(-1.0, abs=0.2) and place[2] == 43.0


def test_a_rapid_straight_up_beside_the_stock_is_clear_by_any_hair():
    """The disc reaches to 0.01 mm from the side at y = 18, then 0.01 mm into it."""
    up = lambda y: contacts(hung(0, (5.0, y, 15.0), (5.0, y, 60.0)))[0][RAPID, 0, 0]
    assert up(18.0 + DISC_MM + 0.01) == -np.inf and up(18.0 + DISC_MM - 0.01) > 0


def test_a_jaw_in_the_way_is_found_in_the_posted_program():
    clear, _, _ = contacts(hung(1, (20.0, 40.0, 30.0), (20.0, 40.0, 10.0)), jaws(-15.5))
    hit, _, _ = contacts(hung(1, (20.0, 40.0, 30.0), (20.0, 40.0, 5.0)), jaws(-15.5))
    assert clear[FIXTURE, 0, 0] == -np.inf and hit[FIXTURE, 0, 0] == pytest.approx(4.5, abs=0.2)
