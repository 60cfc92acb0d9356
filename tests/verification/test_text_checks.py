"""What the text alone shows; tests/app/test_sabotages.py has the faults in whole programs."""

import numpy as np
import pytest
from known_tools import tool

from cuspline.app.catalogue import find_machine
from cuspline.design import Finish, Setup, StockBox
from cuspline.planning.feeds import spindle_rpm
from cuspline.posts.readers.fanuc_reader import read_program as read_fanuc
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.shop.materials import known_materials
from cuspline.values.errors import ReadError
from cuspline.verification.text_checks import (
    CHIP_FACTOR,
    FAR,
    path_tolerance_mm,
    refuse_what_cannot_be_simulated,
    text_findings,
)

MILL, SETUP = find_machine("mill_3axis"), Setup(name="setup-1", wcs_in_words="corner", faces=("top",))
FINISH = Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003)
STOCK = StockBox(min_mm=(0, 0, 0), max_mm=(60, 24, 14))
BALL = tool("ball", 6.0)
HEAD = "G21\nG17 G90 G91.1 G94 G40 G49 G80 G92.1\nG64 P0.001 Q0\nG54\nT1 M6\nG43 H1\n"


def posted(blocks):
    return read_program(HEAD + blocks + "\nM2\n", work_offsets={"G54": MILL.wcs_origin_mm},
                        tool_lengths={1: BALL.length_mm})


def found(blocks, a_tool=BALL, machine=MILL, finish=FINISH):
    """[(kind, amount, line)]"""
    rows = text_findings(posted(blocks), {1: a_tool}, setup=SETUP, machine=machine, finish=finish,
                         material=known_materials()["aluminium_6061"])
    return [(f.kind, f.amount_mm if f.amount is None else f.amount, f.line) for f in rows]


def fast(rpm):
    """The ball with a largest speed."""
    return BALL.model_copy(update={"cutter": BALL.cutter.model_copy(update={"max_rpm": rpm})})


def test_a_cutters_largest_speed_is_asked_of_the_text_and_kept_by_the_plan():
    blocks = "S9000 M3\nG0 X0 Y0\nZ5\nG1 X9 F500"
    assert found(blocks) == [] and found(blocks, fast(9000)) == []
    assert found(blocks, fast(8999)) == [("spindle_out_of_range", 9000.0, 7)]
    assert spindle_rpm(fast(8999.5).cutter, 450, MILL.spindle) == 8999 < spindle_rpm(BALL.cutter, 450, MILL.spindle)


def test_a_feed_that_the_post_has_rounded_up_is_no_finding():
    """197 inches a minute, with no decimals, are 5003.8 mm; 5000 are 196.85."""
    control = MILL.control.model_copy(update={"units": "inch", "decimals_feed": 0})
    inch = MILL.model_copy(update={"max_feed_mm_per_min": 5000.0, "control": control})
    blocks = "S18000 M3\nG0 X0 Y0\nZ5\nG20\nG1 X2 F{}"
    assert found(blocks.format(197), fast(18000), inch) == [("chip_load", pytest.approx(197 * 25.4 / 36000, abs=1e-6), 11)]
    assert "feed_out_of_range" in [kind for kind, _, _ in found(blocks.format(198), machine=inch)]


@pytest.mark.parametrize("way, feed", [("X90", 600.0), ("X90 Y90", 600 * 2**0.5), ("X90 Y90 Z95", 600 * 3**0.5)])
def test_an_axis_may_run_as_fast_as_it_can_along_every_move(way, feed):
    """All axes at 600: along a diagonal the tool is faster than each of them."""
    axis = MILL.x.model_copy(update={"rapid_mm_per_min": 600.0})
    slow = MILL.model_copy(update={"x": axis, "y": axis, "z": MILL.z.model_copy(update={"rapid_mm_per_min": 600.0})})
    blocks = "S9000 M3\nG0 X0 Y0\nZ5\nG1 {} F{:.4f}"
    assert found(blocks.format(way, feed * 0.9999), machine=slow) == []
    ((kind, amount, line),) = found(blocks.format(way, feed * 1.0001), machine=slow)
    assert (kind, line) == ("feed_out_of_range", 10) and amount == pytest.approx(feed * 1.0001, rel=1e-6)


def test_a_drill_may_go_so_far_down_before_it_comes_up():
    """Four diameters at the feed, or what its library says; moves that follow one another count together."""
    cutter = BALL.cutter.model_copy(update={"type": "drill", "point_angle_deg": 118.0, "corner_radius_mm": 0.0})
    drill = BALL.model_copy(update={"cutter": cutter})
    cooled = drill.model_copy(update={"cutter": cutter.model_copy(update={"unpecked_mm": 30.0})})
    blocks = "S1000 M3\nG0 X0 Y0\nZ5\nG1 Z-10 F50\nZ{}\nG0 Z5"
    assert found(blocks.format(-19), drill) == [] and found(blocks.format(-24), cooled) == []
    assert found(blocks.format(-19.1), drill) == [("deep_hole", pytest.approx(24.1), 11)]
    assert found(blocks.format("-10\nG0 Z-9\nG1 Z-30"), drill) == [] and found(blocks.format(-24)) == []


def test_the_feed_per_tooth_has_a_limit_that_goes_with_the_diameter():
    limit = CHIP_FACTOR * known_materials()["aluminium_6061"].feed_per_tooth_share * 6.0        # mm per tooth; two teeth
    blocks = "S1000 M3\nG0 X0 Y0\nZ5\nG1 X9 F{:.4f}"
    assert found(blocks.format(limit * 2000 * 0.9999)) == []
    ((kind, amount, line),) = found(blocks.format(limit * 2000 * 1.001))
    assert (kind, line) == ("chip_load", 10) and amount == pytest.approx(limit * 1.001, abs=1e-6)


def test_a_path_tolerance_as_wide_as_the_allowed_gouge_is_no_finding_and_a_wider_one_is():
    cut = "S9000 M3\nG0 X0 Y0\nZ5\nG1 X9 F500"
    assert found("G64 P0.0015 Q0\n" + cut) == []
    assert found("G64 P0.00155 Q0\n" + cut) == [("path_tolerance", 0.0031, 11)]
    assert path_tolerance_mm(posted("G64 P0.5 Q0\nG0 X0 Y0\nZ5\nG64 P0.002 Q0\nG1 X9 F500"),
                             MILL) == pytest.approx(0.004)


def test_what_fanucs_control_does_at_corners_is_what_the_machine_states():
    fanuc = find_machine("mill_fanuc")
    text = "%\nO1\nG21 G17 G90 G94 G40 G80 G54 {}\nG0 X0. Y0. Z0.\nG1 X9. F100.\nM30\n%\n"
    moves = {mode: read_fanuc(text.format(mode), work_offsets={}, tool_lengths={}) for mode in ("G64", "", "G61")}
    assert path_tolerance_mm(moves["G64"], fanuc) == path_tolerance_mm(moves[""],
                                                                       fanuc) == fanuc.control.path_tolerance_mm
    assert path_tolerance_mm(moves["G61"], fanuc) == 0 and path_tolerance_mm(moves["G64"], None) == np.inf


@pytest.mark.parametrize("blocks, words", [
    ("(NOTHING)", "no move"), (f"G0 X{600 * (FAR + 2):g}", "line 7: X7200 mm is"),
    ("G0 Z-1000000000", r"line 7: Z-1e\+09 mm is"), ("T0 M6\nG0 X0 Y0 Z0\nG1 X1 F9",
                                                     "line 9: a cutting move, but no tool"),
    ("G0 X0 Y0\nZ5\nG2 X1 Y0 I0.5 J1000000 F100", r"line 9: an arc of radius 1e\+06 mm")])
def test_what_cannot_be_simulated_is_refused_with_its_line(blocks, words):
    with pytest.raises(ReadError, match=words):
        refuse_what_cannot_be_simulated(posted(blocks), {1: BALL}, SETUP, MILL, STOCK)


def test_what_only_leaves_the_travel_can_be_simulated():
    refuse_what_cannot_be_simulated(posted(f"G0 X{600 * (FAR - 1):g} Y0\nZ5"), {1: BALL}, SETUP, MILL, STOCK)
