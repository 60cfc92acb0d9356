"""First-order drives on the posted path: the source's figures, closed forms, backlash, block rate."""

import tomllib

import numpy as np
import pytest
from known_programs import arc, feed, program, rapid

from cuspline.app import catalogue
from cuspline.app.calibrate import calibration_text, measured_text
from cuspline.app.catalogue import reader_of
from cuspline.planning.feeds import capped_feeds
from cuspline.process.drives import Drives, corner_distance_mm, deviations_mm, following_error_mm, time_constant_s, way_mm
from cuspline.program.program import Kind, MoveWriter, Plane
from cuspline.verification.process_findings import drive_findings

T, FEED = 0.033, 406.4
EQUAL = Drives(time_constants_s=[T] * 3, backlash_mm=[0] * 3)
BEHIND = FEED / 60 * T


def run(moves, drives=EQUAL, feed_mm_per_min=FEED, start=(0, 0, 0)):
    posted = program(start, moves)
    return deviations_mm(program(start, moves, feed_mm_per_min=np.where(posted.feed_mm_per_min > 0, feed_mm_per_min, 0.0)), drives)


def test_the_source_s_figures():
    assert following_error_mm(FEED, T) == pytest.approx(0.2235, abs=5e-5) and corner_distance_mm(FEED, T) == pytest.approx(
        0.1163, abs=5e-5)


def test_a_corner_is_cut_where_the_closed_form_says():
    way = way_mm([(-5, 0, 0), (0, 0, 0), (0, 5, 0)], FEED, EQUAL)
    off = way[:, 0] + way[:, 1]                                # 0 on the bisector
    k = np.flatnonzero((off[:-1] < 0) & (off[1:] >= 0))[-1]
    share = off[k] / (off[k] - off[k + 1])
    place = way[k] + share * (way[k + 1] - way[k])
    assert np.hypot(*place[:2]) == pytest.approx(corner_distance_mm(FEED, T), rel=2e-3)
    assert time_constant_s(np.hypot(*place[:2]), FEED) == pytest.approx(T, rel=0.01)
    assert way[-1] == pytest.approx([0, 5 - BEHIND, 0], abs=1e-6)
    deviation = run([feed(5, 0, 0), feed(5, 5, 0)])
    assert deviation.max() == pytest.approx(BEHIND / np.e, rel=0.02)       # from the nearer leg, where both are as near


def test_straight_ways_are_kept_and_arcs_run_inside():
    assert run([feed(5, 3, 1), rapid(5, 3, 20), rapid(0, 0, 20), feed(-4, 0, 20)]).max() < 1e-9
    radius, rate = 3.0, FEED / 60 * T / 3.0
    inside = run([arc((3, 0, 0), (0, 0, 0), Plane.XY)], start=(3, 0, 0))
    assert inside[0] == pytest.approx(radius * (1 - 1 / np.sqrt(1 + rate ** 2)), rel=0.05)


def test_axes_that_differ_leave_a_slanting_line():
    differ = Drives(time_constants_s=[0.02, 0.04, 0.03], backlash_mm=[0, 0, 0])
    assert run([feed(20, 20, 0)], differ)[0] == pytest.approx(FEED / 60 * 0.02 / 2, rel=0.01)    # V dT sin cos


def test_backlash_shows_where_an_axis_turns_round():
    loose = Drives(time_constants_s=[1e-4] * 3, backlash_mm=[0.0, 0.04, 0.0])
    deviation = run([feed(2, 2, 0), feed(4, 0, 0)], loose)
    assert deviation[1] == pytest.approx(0.04 * np.sqrt(0.5) / 2, rel=0.05)
    assert run([feed(2, 2, 0), feed(4, 4, 0)], loose)[1] < 0.0143


def test_four_times_the_feed_leaves_the_path_four_times_as_far():
    moves = [feed(5, 0, 0), feed(5, 5, 0)]
    assert run(moves, feed_mm_per_min=4 * FEED).max() == pytest.approx(4 * run(moves).max(), rel=0.02)


def test_a_surface_that_the_drives_leave_is_a_finding_and_a_slower_feed_none():
    mill = catalogue.find_machine("mill_3axis")
    mill = mill.model_copy(update={axis: getattr(mill, axis).model_copy(update={"time_constant_s": T}) for axis in "xyz"})
    moves, limit = [feed(5, 0, 0), feed(5, 5, 0), feed(9, 9, 0)], mill.control.path_tolerance_mm
    slow = 0.9 * limit / (corner_distance_mm(1.0, T) * np.sqrt(0.5))
    at = lambda f, rows: drive_findings(program((0, 0, 0), moves, feed_mm_per_min=np.full(3, f)), mill, np.array(rows), "setup-1")
    assert at(slow, [0, 1, 2])[0] == ()
    (finding,), document = at(4 * slow, [0, 1, 2])
    assert finding.kind == "following_error" and finding.line in (10, 11) and finding.amount_mm > limit
    assert document["deviation_mm"] == finding.amount_mm
    assert document["following_error_mm"] == pytest.approx(4 * slow / 60 * T, abs=1e-6)
    assert at(4 * slow, [-1])[0] == ()                         # a corner that leaves no surface may be cut
    unknown = drive_findings(program((0, 0, 0), moves), catalogue.find_machine("mill_3axis"), np.arange(3), "")
    assert unknown[0] == () and unknown[1].startswith("not checked")


def test_the_control_s_block_rate_caps_the_feed():
    mill = catalogue.find_machine("mill_3axis")
    mill = mill.model_copy(update={"time_constant_s": 1e-4})
    w = MoveWriter((0, 0, 0))
    for k in range(1, 4):
        w.feed((0.05 * k, 0, 0), 5000)
    slow = mill.model_copy(update={"control": mill.control.model_copy(update={"blocks_per_s": 800})})
    assert capped_feeds(w.moves(), mill).tolist() == [5000] * 3
    assert capped_feeds(w.moves(), slow) == pytest.approx([2400] * 3, abs=1)


def test_a_machine_that_states_no_drives_has_none_to_check():
    mill = catalogue.find_machine("mill_3axis")
    assert Drives.of(mill) is None and Drives.of(None) is None
    stated = mill.model_copy(update={axis: getattr(mill, axis).model_copy(update={"time_constant_s": T}) for axis in "xyz"})
    assert Drives.of(stated).time_constants_s.tolist() == [T] * 3
    assert "time_constant_s" not in mill.model_dump()["x"] and "blocks_per_s" not in mill.model_dump()["control"]


def test_calibration_s_round_trip():
    """The posted L is read back, run by drives of a known time constant, and the corner that they cut shows it again."""
    mill, library = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
    text = calibration_text(mill, library.tools[0], 1500.0)
    posted = reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm}, tool_lengths={
        t.number: t.offset_mm for t in library.tools})
    legs = np.flatnonzero((posted.kind == Kind.FEED) & (posted.start_mm[:, 2] == posted.end_mm[:, 2]))
    assert posted.feed_mm_per_min[legs].tolist() == [1500.0] * 2
    way = way_mm(np.vstack([posted.start_mm[legs[:1]], posted.end_mm[legs]]), 1500.0, EQUAL)
    corner = posted.end_mm[legs[0]]
    off = (way - corner)[:, 0] + (way - corner)[:, 1]
    k = np.flatnonzero((off[:-1] < 0) & (off[1:] >= 0))[-1]
    at = way[k] + off[k] / (off[k] - off[k + 1]) * (way[k + 1] - way[k])
    measured = float(np.hypot(*(at - corner)[:2]))
    stated = tomllib.loads(measured_text(measured, 1500.0))
    assert [stated[axis]["time_constant_s"] for axis in "xyz"] == pytest.approx([T] * 3, rel=0.01)
