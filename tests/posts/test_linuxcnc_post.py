"""What the LinuxCNC post writes: whole programs against gold files, read back, and its own rules.

Accept new gold files with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/posts/test_linuxcnc_post.py
and review their diff like code.
"""

import dataclasses
import importlib
import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from small_program import BALL, CLEARANCE_MM, FLAT, changed, circle_point, finishing, one, operation, program, roughing

import cuspline.posts
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.posts.writers.linuxcnc import post
from cuspline.program.program import Kind, Moves, MoveWriter, Plane
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import PostError

GOLD = Path(__file__).parent.parent / "gold"
MACHINES = {unit: machine_from_toml(Path(cuspline.posts.__file__).parent / "machines" / f"mill_3axis{suffix}.toml")
            for unit, suffix in (("mm", ""), ("inch", "_inch"))}
ROUNDING_MM = {"mm": 0.5e-4 * 1.0001, "inch": 0.5e-6 * 25.4 * 1.0001}      # half of the last decimal
UNITS = pytest.mark.parametrize("unit", MACHINES)


def read(text):
    return read_program(text, work_offsets={"G54": (0, 0, 0), "G55": (0, 0, 0)}, tool_lengths={3: 100, 7: 120})


def blocks(text):
    """Lines that are not comments."""
    return [line for line in text.splitlines() if not line.startswith("(")]


# whole programs ---------------------------------------------------------------------------------------


@UNITS
def test_the_whole_text_is_the_accepted_one(unit):
    text, path = post(program(), MACHINES[unit]).text, GOLD / f"small_program_{unit}.ngc"
    if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
        path.write_text(text)
    assert path.is_file(), "no gold file: accept one, see the top of this file"
    assert text == path.read_text()


@UNITS
def test_reading_back_gives_the_same_moves_within_the_rounding(unit):
    moves = read(post(program(), MACHINES[unit]).text)
    for index, planned in enumerate((roughing(), finishing())):
        rows = np.flatnonzero(moves.operation == index)
        cut = rows[np.isin(moves.kind[rows], (Kind.FEED, Kind.ARC_CW, Kind.ARC_CCW))]
        ends, kinds, planes, centers = planned.end_mm, planned.kind, planned.plane, planned.center_mm
        if index == 0:      # the full circle goes out as two halves
            k = len(ends) - 2
            half = 2 * centers[k] - ends[k]
            half[2] = ends[k, 2]
            ends, kinds, planes, centers = (np.insert(a, k, v, axis=0) for a, v in (
                (ends, half), (kinds, kinds[k]), (planes, planes[k]), (centers, centers[k])))
        keep = kinds != Kind.RAPID
        np.testing.assert_array_equal(moves.kind[cut], kinds[keep])
        np.testing.assert_allclose(moves.end_mm[cut], ends[keep], rtol=0, atol=ROUNDING_MM[unit])
        for row, plane, center in zip(cut, planes[keep], centers[keep]):
            if moves.kind[row] >= Kind.ARC_CW:
                a, b, _ = Plane(plane).axes
                assert moves.plane[row] == plane
                np.testing.assert_allclose(moves.center_mm[row, [a, b]], center[[a, b]], atol=2 * ROUNDING_MM[unit])


@UNITS
def test_reading_back_gives_feeds_tools_speeds_and_names(unit):
    moves = read(post(program(), MACHINES[unit]).text)
    assert moves.operations == ("rough", "finish")
    for index, (number, rpm, planned) in enumerate(((3, 8000, roughing()), (7, 12000, finishing()))):
        cut = (moves.operation == index) & (moves.kind != Kind.RAPID)
        assert set(moves.tool[cut]) == {number} and set(moves.spindle_rpm[cut]) == {rpm}
        assert moves.length_offset_on[cut].all()
        wanted = set(planned.feed_mm_per_min[planned.kind != Kind.RAPID])
        step = 0.1 * (1 if unit == "mm" else 25.4)
        assert all(min(abs(f - w) for w in wanted) <= step / 2 + 1e-9 for f in moves.feed_mm_per_min[cut])


def test_posting_twice_gives_the_same_text():
    assert post(program(), MACHINES["mm"]) == post(program(), MACHINES["mm"])


# the state of the control -----------------------------------------------------------------------------


@UNITS
def test_units_come_first_and_alone_on_their_line(unit):
    lines = blocks(post(program(), MACHINES[unit]).text)
    assert lines[0] == {"mm": "G21", "inch": "G20"}[unit]
    assert not any(re.search(r"G2[01]\b", line) for line in lines[1:])


@UNITS
def test_the_path_tolerance_always_stands_with_g64(unit):
    for tolerance in (0.001, 0.05, 1e-5):
        text = post(program(), changed(MACHINES[unit], path_tolerance_mm=tolerance)).text
        (line,) = [line for line in blocks(text) if "G64" in line]
        value = float(re.fullmatch(r"G64 P(\S+) Q0", line).group(1)) * (25.4 if unit == "inch" else 1)
        assert value == pytest.approx(tolerance / 2, rel=0.2) and value > 0     # the control takes twice what it is given


def test_spindle_length_offset_and_wcs_are_set_before_anything_moves_down():
    lines = blocks(post(program(), MACHINES["mm"]).text)
    for at, line in enumerate(lines):
        if re.match(r"G0 Z", line):
            before = lines[:at]
            assert "G55" in before and any(re.fullmatch(r"S\d+ M3", b) for b in before)
            changes = [k for k, b in enumerate(before) if b.endswith("M6")]
            assert re.match(r"G43 H\d", lines[changes[-1] + 1]), "the length offset follows the tool change"
            spindle = max(k for k, b in enumerate(before) if " M3" in b)
            assert spindle > changes[-1], "M6 stops the spindle"
            break
    else:
        pytest.fail("nothing moves down")


def test_tools_change_at_the_top_with_the_spindle_stopped():
    lines = blocks(post(program(), MACHINES["mm"]).text)
    for at, line in enumerate(lines):
        if line.endswith("M6"):
            assert lines[at - 3:at] == ["M5", "M9", "G53 G0 Z0"]


def test_a_second_operation_with_the_same_tool_changes_nothing_but_the_speed():
    both = program(operation("rough", FLAT, roughing()), operation("again", FLAT, finishing(), 5000))
    text = post(both, MACHINES["mm"]).text
    assert text.count("M6") == 1 and "S5000 M3" in text and read(text).operations == ("rough", "again")


def test_no_rapid_moves_across_and_down_at_once():
    moves = read(post(program(), MACHINES["mm"]).text)
    for row in np.flatnonzero(moves.kind == Kind.RAPID):
        d = moves.end_mm[row] - moves.start_mm[row]
        assert not (d[2] < 0 and np.abs(d[:2]).max() > 0), moves.line[row]


def test_it_ends_stopped_dry_and_at_the_top():
    assert blocks(post(program(), MACHINES["mm"]).text)[-4:] == ["M5", "M9", "G53 G0 Z0", "M2"]


# lines ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", [50, 80, 252])
def test_every_line_is_shorter_than_the_control_takes(length):
    header = ("x" * 1000, "short", "", "é and (brackets) and\na line break\tand a tab")
    text = post(program(header=header), changed(MACHINES["mm"], line_length=length)).text
    assert max(map(len, text.splitlines())) < length
    assert text.isascii()
    comments = [line for line in text.splitlines() if line.startswith("(")]
    assert all(re.fullmatch(r"\([^()]*\)", line) for line in comments)
    assert "".join(c[1:-1] for c in comments).count("x") >= 1000
    read(text)


def test_a_block_that_cannot_be_shortened_is_refused_with_its_length():
    long = one(("feed", (-123.4567, -123.4567, -23.4567), 1234.5))
    with pytest.raises(PostError, match=r"line \d+ has 4\d characters, mill_3axis takes fewer than 40"):
        post(long, changed(MACHINES["mm"], line_length=40))


def test_numbers_have_no_exponent_no_minus_zero_and_no_trailing_zeros():
    text = post(one(("feed", (1e-9, -1e-9, 1e-5), 100), ("feed", (-4e-5, 100, 12.5), 100)), MACHINES["mm"]).text
    numbers = [w for line in blocks(text) for w in re.findall(r"[XYZIJK]([-\d.eE]+)", line)]
    assert all(re.fullmatch(r"-?\d+(\.\d*[1-9])?", n) and n != "-0" for n in numbers), numbers


# arcs -------------------------------------------------------------------------------------------------


def quarter(plane=Plane.ZX, radius=20.0, shift=(0.123456, 0.654321, 0.333333)):
    """A quarter of a circle from the clearance height, whose numbers need rounding."""
    center = np.array(shift) + (0, 0, CLEARANCE_MM)
    start = circle_point(plane, center, radius, 17)
    return one(("arc", circle_point(plane, center, radius, 107), center, plane, False, 500),
               start=(*start[:2], max(start[2], CLEARANCE_MM))) if start[2] >= CLEARANCE_MM else one(
        ("feed", start, 400), ("arc", circle_point(plane, center, radius, 107), center, plane, False, 500),
        start=(*start[:2], CLEARANCE_MM))


@pytest.mark.parametrize("plane", Plane)
@UNITS
def test_arcs_stay_arcs(plane, unit):
    posted = post(quarter(plane), MACHINES[unit])
    assert posted.arcs_as_lines == 0
    assert ("G17", "G18", "G19")[plane] in posted.text and "G3 " in posted.text


@pytest.mark.parametrize("plane", Plane)
def test_an_arc_whose_rounded_radii_disagree_goes_out_as_chords_within_the_path_tolerance(plane):
    posted = post(quarter(plane), changed(MACHINES["mm"], decimals_mm=2))
    moves = read(posted.text)
    assert posted.arcs_as_lines == 1 and not (moves.kind >= Kind.ARC_CW).any()
    a, b, _ = plane.axes
    center = np.array((0.123456, 0.654321, 0.333333 + CLEARANCE_MM))
    cut = np.flatnonzero(moves.feed_mm_per_min == 500)
    assert len(cut) > 10
    middles = (moves.start_mm[cut] + moves.end_mm[cut]) / 2
    off = np.abs(np.hypot(middles[:, a] - center[a], middles[:, b] - center[b]) - 20)
    assert off.max() < 0.001 + 0.005 * math.sqrt(2)         # path tolerance and rounding to 0.01 mm


def test_an_arc_flatter_than_the_control_takes_goes_out_as_chords():
    radius, length = 2e4, 60.0
    turn = length / radius
    center = np.array([0, 0, CLEARANCE_MM + radius])
    end = center + radius * np.array([math.sin(turn), 0, -math.cos(turn)])
    posted = post(one(("arc", end, center, Plane.ZX, True, 500), start=(0, 0, CLEARANCE_MM)), MACHINES["mm"])
    moves = read(posted.text)
    assert posted.arcs_as_lines == 1
    xs = moves.end_mm[np.flatnonzero(moves.feed_mm_per_min == 500), 0]
    # the chord of an arc deviates by s²/8R
    assert np.diff(np.r_[0, np.abs(xs)]).max() ** 2 / (8 * radius) < 0.0011


@pytest.mark.parametrize("is_clockwise", [True, False])
@pytest.mark.parametrize("gap_deg", [0.0, 1e-4, 0.3])
def test_full_and_nearly_full_circles_run_all_round(gap_deg, is_clockwise):
    center = np.array([3.3333333, 4.4444444, CLEARANCE_MM])
    start = circle_point(Plane.XY, center, 5, 40)
    end = circle_point(Plane.XY, center, 5, 40 + (gap_deg if is_clockwise else -gap_deg))
    moves = read(post(one(("arc", end, center, Plane.XY, is_clockwise, 500), start=tuple(start)), MACHINES["mm"]).text)
    arcs = np.flatnonzero(moves.kind >= Kind.ARC_CW)
    turned = 0.0
    for k in arcs:
        s, e, c = moves.start_mm[k], moves.end_mm[k], moves.center_mm[k]
        turn = math.atan2(*(e - c)[[1, 0]]) - math.atan2(*(s - c)[[1, 0]])
        turned += (-turn if is_clockwise else turn) % (2 * math.pi)
    assert math.degrees(turned) == pytest.approx(360 - gap_deg, abs=0.01)


def test_an_arc_too_short_to_write_is_never_a_full_circle():
    center = np.array([0, 5, CLEARANCE_MM])
    posted = post(one(("arc", circle_point(Plane.XY, center, 5, -90 + 1e-4), center, Plane.XY, False, 500)), MACHINES["mm"])
    assert not (read(posted.text).kind >= Kind.ARC_CW).any()


@UNITS
@pytest.mark.parametrize("seed", range(5))
def test_random_arcs_and_lines_read_back_within_the_rounding(unit, seed):
    rng = np.random.default_rng(seed)
    w = MoveWriter((0, 0, 200.0))
    for _ in range(60):
        plane = Plane(int(rng.integers(3)))
        if rng.random() < 0.5:
            w.feed(rng.uniform(-100, 100, 3), 800)
            continue
        radius, first, turn = rng.uniform(0.5, 80), rng.uniform(0, 360), rng.uniform(2, 340)
        center = w.here_mm - circle_point(plane, (0, 0, 0), radius, first)
        is_clockwise = bool(rng.random() < 0.5)
        end = circle_point(plane, center, radius, first - turn if is_clockwise else first + turn)
        end[plane.axes[2]] = w.here_mm[plane.axes[2]] + (rng.uniform(-3, 3) if rng.random() < 0.3 else 0)
        w.arc(end, center, plane, is_clockwise, 800)
    w.rapid((*w.here_mm[:2], 200.0))
    planned = w.moves()
    posted = post(program(operation("cut", FLAT, planned)), MACHINES[unit])
    moves = read(posted.text)
    assert posted.arcs_as_lines == 0
    cut = np.flatnonzero(moves.feed_mm_per_min > 0)
    keep = planned.kind != Kind.RAPID
    np.testing.assert_array_equal(moves.kind[cut], planned.kind[keep])
    np.testing.assert_allclose(moves.end_mm[cut], planned.end_mm[keep], rtol=0, atol=ROUNDING_MM[unit])
    assert posted.largest_rounding_mm <= math.sqrt(3) * ROUNDING_MM[unit]


# what it refuses --------------------------------------------------------------------------------------


@pytest.mark.parametrize("rpm", [50.0, 18001.0])
def test_a_spindle_speed_outside_the_machines_range_is_refused(rpm):
    with pytest.raises(PostError, match=f"operation rough: {rpm:.0f} rpm, the spindle of mill_3axis runs 100 to 18000 rpm"):
        post(program(operation("rough", FLAT, roughing(), rpm)), MACHINES["mm"])


def test_an_operation_that_starts_or_ends_below_clearance_is_refused():
    low = MoveWriter((0, 0, 5.0))
    low.feed((10, 0, CLEARANCE_MM), 100)
    with pytest.raises(PostError, match="starts at Z5.000, below the clearance height Z30.000"):
        post(program(operation("cut", FLAT, low.moves())), MACHINES["mm"])
    low = MoveWriter((0, 0, CLEARANCE_MM))
    low.feed((10, 0, 5.0), 100)
    with pytest.raises(PostError, match="ends at Z5.000, below the clearance height Z30.000"):
        post(program(operation("cut", FLAT, low.moves())), MACHINES["mm"])


@UNITS
def test_a_feed_that_rounds_to_nothing_is_refused(unit):
    with pytest.raises(PostError, match="a feed of 0.04 mm/min is nothing with 1 decimals"):
        post(one(("feed", (1, 0, 0), 0.04)), MACHINES[unit])


@pytest.mark.parametrize("module", ["linuxcnc", "fanuc"])
def test_a_tilted_axis_is_refused_by_row_and_angle(module):
    planned = finishing()
    axis = planned.axis.copy()
    axis[2] = (0.0, math.sin(math.radians(30)), math.cos(math.radians(30)))
    leaning = dataclasses.replace(planned, axis=axis)
    with pytest.raises(PostError, match="operation finish: the tool axis leans 30.000 degrees .* in move 2, and in 0") as e:
        importlib.import_module(f"cuspline.posts.writers.{module}").post(program(operation("finish", BALL, leaning)),
                                                                         MACHINES["mm"])
    assert list(e.value.rows) == [2]


def test_posting_leaves_the_program_alone():
    planned = roughing()
    before = {name: np.array(value) for name, value in planned.__dict__.items()}
    post(program(operation("rough", FLAT, planned)), MACHINES["mm"])
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(planned, name), value)
    assert isinstance(planned, Moves)


def test_mist_ends_flood_before_it_begins():
    """M7 and M8 may be on at once."""
    both = program(operation("rough", FLAT, roughing()), operation("again", FLAT, finishing(), coolant="mist"))
    lines = blocks(post(both, MACHINES["mm"]).text)
    assert lines[lines.index("M7") - 1] == "M9"
    assert set(read("\n".join(lines)).coolant[-5:-1]) == {1}
