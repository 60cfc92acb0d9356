"""Programs on LinuxCNC's whole controller: the machine follows the path that our reader reads."""

import numpy as np
import pytest

from cuspline.app.catalogue import find_machine
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.shop.machines import Control, LinearAxis, Machine, Spindle

from .linuxcnc.controller import run_on_controller
from .linuxcnc.deviation import deviation_mm, path_of, segments_of

TOOLS = {5: 120.0}
HEADER = "G21 G17 G90 G54 G64 P{tolerance}\nT5 M6\nG43 H5\nS8000 M3\nG53 G0 Z0\nG0 X0 Y0\nG0 Z5\nG1 Z0 F6000\n"
CORNERS_AND_ARCS = """X40
Y40
X0
Y0
G2 I20
G18 G3 X30 Z0 I15 K20
G19 G2 Y10 Z8 R12
G17 G3 X22 Y2 I-4 J-4 Z2 P2
"""
END = "G53 G0 Z0\nM5\nM2\n"
SERVO_S = 0.001


@pytest.fixture(scope="module")
def mill():
    def axis(lower, upper):
        return LinearAxis(min_mm=lower, max_mm=upper, rapid_mm_per_min=12000, acceleration_mm_per_s2=1000)
    return Machine(
        name="test mill", description="", x=axis(-300, 300), y=axis(-300, 300), z=axis(-400, 0),
        spindle=Spindle(min_rpm=100, max_rpm=12000), time_constant_s=0.05, max_feed_mm_per_min=6000, tool_change_s=5,
        table_z_mm=-400, wcs_origin_mm=(10, 20, -350),
        control=Control(post="linuxcnc", program_store_bytes=10**9, path_tolerance_mm=0.01))


@pytest.fixture
def drive(mill, tmp_path):
    def run(text):
        (tmp_path / "program.ngc").write_text(text)
        return run_on_controller(tmp_path / "program.ngc", TOOLS, mill)
    return run


@pytest.mark.controller
@pytest.mark.parametrize("tolerance_mm", [0.1, 0.01, 0.001])
def test_the_machine_stays_within_the_tolerance_of_g64(drive, tolerance_mm):
    run = drive(HEADER.format(tolerance=tolerance_mm) + CORNERS_AND_ARCS + END)
    assert run.is_finished and run.errors == ()
    assert 0.3 * tolerance_mm < run.deviation_mm <= tolerance_mm     # it uses it, and no more
    assert run.end_gap_mm < 1e-9


@pytest.mark.controller
@pytest.mark.parametrize("p_mm, is_left_by_more", [(0.001, True), (0.0005, True), (0.0002, True), (0.01, False)])
def test_finishing_passes_are_left_by_more_than_p_and_no_more_than_the_reader_counts(tmp_path, p_mm, is_left_by_more):
    """Arcs with square corners to the next pass, then a wave in short lines, on the default machine."""
    machine, path = find_machine("mill_3axis"), tmp_path / "program.ngc"
    there, back = ("G18 G2 X0 Z42.1 I-38.2456 K-8.1293 F2292", "G18 G3 X38.2456 Z11.1293 I0 K-39.1 F2292")
    passes = [line for k in range(6) for line in (f"G1 X38.2456 Y{k + 0.3333} Z11.1293 F1212", there, f"G1 Y{k + 1}", back)]
    x = np.arange(38, 8, -1.0)
    wave = [f"G1 X{x:.4f} Z{z:.4f} F2500" for x, z in zip(x, 11 + 2 * np.cos(x / 4))]
    text = "\n".join([HEADER.format(tolerance=f"{p_mm:.4f} Q0") + "Z50", *passes, *wave, END])
    path.write_text(text)
    run = run_on_controller(path, TOOLS, machine)
    assert run.is_finished and run.errors == ()
    counted = read_program(text, work_offsets={}, tool_lengths=TOOLS).path_tolerance_mm[-1]
    assert run.deviation_mm <= counted
    assert not is_left_by_more or run.deviation_mm > p_mm


@pytest.mark.controller
def test_a_stroke_takes_the_time_of_its_trapezoid(drive):
    """length / speed + speed / acceleration for each straight move between two stops."""
    run = drive(HEADER.format(tolerance=0.01) + "G61.1\nX100\nG4 P0.5\nX0\nG4 P0.5\n" + END)
    on_line = run.line == HEADER.count("\n") + 2
    moving = np.any(np.diff(run.position_mm, axis=0, prepend=run.position_mm[:1]), axis=1)
    assert (on_line & moving).sum() * SERVO_S == pytest.approx(100 / 100 + 100 / 1000, abs=0.01)
    assert run.program_s - run.moving_s == pytest.approx(1.0, abs=0.1)     # the two dwells


@pytest.mark.controller
def test_two_runs_are_the_same_to_the_last_bit(drive):
    one, other = (drive(HEADER.format(tolerance=0.01) + CORNERS_AND_ARCS + END) for _ in range(2))
    moving = [run.position_mm[np.r_[True, np.any(np.diff(run.position_mm, axis=0), axis=1)]] for run in (one, other)]
    assert np.array_equal(*moving)


@pytest.mark.controller
def test_travel_beyond_a_limit_is_an_error_of_the_controller(drive):
    run = drive(HEADER.format(tolerance=0.01) + "X400\n" + END)
    assert not run.is_finished
    assert "exceed X's positive limit" in " ".join(run.errors)


@pytest.mark.controller
def test_sub_programs_and_stops_are_driven_to_the_end(drive):
    run = drive(HEADER.format(tolerance=0.01) + "M0\no1 sub\nG1 X#1 Y[#1/2]\nX[#1+5]\no1 endsub\no1 call [10]\nM1\n"
                "o1 call [30]\n" + END)
    assert run.is_finished
    assert run.deviation_mm <= 0.01


# the measure itself -----------------------------------------------------------------------------------

@pytest.fixture
def path():
    text = "G21\nG0 X0 Y0 Z0\nG1 X40 F100\nG3 X40 Y40 J20\nG18 G2 X40 Z10 K5\nG17 G3 X40 Y40 Z30 J-20 P3\nM2"
    moves = read_program(text, work_offsets={"G54": (1, 2, 3)}, tool_lengths={})
    return path_of(moves, np.array([1.0, 2.0, 103.0]))


def test_points_of_the_path_do_not_deviate(path):
    s = np.linspace(0, 1, 101)[:, None]
    turn = np.pi * s - np.pi / 2
    helix = 6 * np.pi * s + np.pi / 2
    pieces = [np.hstack([40 * s, 0 * s, 0 * s]),
              np.hstack([40 + 20 * np.cos(turn), 20 + 20 * np.sin(turn), 0 * s]),
              np.hstack([40 + 5 * np.sin(np.pi * s), 40 + 0 * s, 5 - 5 * np.cos(np.pi * s)]),
              np.hstack([40 + 20 * np.cos(helix), 20 + 20 * np.sin(helix), 10 + 20 * s])]
    line = np.repeat([3, 4, 5, 6], len(s))
    assert deviation_mm(np.vstack(pieces) + (1, 2, 3), line, path).max() < 1e-12


def test_points_beside_the_path_deviate_by_their_distance(path):
    beside = np.array([[20, 0.01, 0], [60.02, 20, 0], [40, 43, 10], [-0.5, 0, 0], [40, 40 - 0.03, 30.0]]) + (1, 2, 3)
    expected = [0.01, 0.02, 3.0, 0.5, 0.03]
    assert deviation_mm(beside, np.array([3, 4, 5, 3, 6]), path) == pytest.approx(expected, abs=1e-4)


def test_lines_that_come_again_are_followed_forwards():
    path_line = np.array([3, 7, 8, 7, 8, 9])
    samples = np.array([3, 3, 7, 8, 5, 7, 8, 8, 9, 0])
    assert segments_of(samples, path_line).tolist() == [0, 0, 1, 2, 2, 3, 4, 4, 5, 5]
