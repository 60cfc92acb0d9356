"""Contours that the control runs beside where the tool leans and stands: in a plane of its own, or where the part has turned."""

import re
from functools import cache

import numpy as np
import pytest
from compensated_plate import OTHER, RADIUS, TOOL, WORN, away_mm, turned_contour
from compensated_plate import program as upright
from known_tilted import ROUNDING_MM, machine, program
from positioned_mills import CONTROLS, ON_MACHINES, leaning_frame, mill

from cuspline.app import catalogue
from cuspline.program.program import Kind
from cuspline.values.errors import PostError, ReadError

HEIGHT_MM = -5.0
PLANNED = upright().operations[0]
CORNERS_BY_LINES = ("fanuc", "fanuc, joints", "haas")
ON = {"heidenhain": ("RL", "R0"), **dict.fromkeys(("linuxcnc", "fanuc", "fanuc, joints", "haas"), ("G41 D3", "G40")),
      "siemens": ("G41", "G40")}
STEP_MM = 0.2
OFF_MM = 2e-4               # four decimals of words, and chords in place of arcs as they are read


@cache
def text_of(control, name):
    m = mill(control, name)
    return catalogue.find_post(m.control.post).post(program(turned_contour()), m).text


def read(control, name, text=None, radius_mm=RADIUS):
    """PostedMoves with a radius in the tool's register; that of T4 is 4 mm."""
    m = mill(control, name)
    return catalogue.reader_of(m)(text or text_of(control, name), work_offsets={"G54": m.wcs_origin_mm}, chain=m.kinematics,
                                  tool_lengths={t.number: t.length_mm for t in (TOOL, OTHER)}, tool_radii={3: radius_mm, 4: 4.0})


def middle(posted):
    """(n, 3) places of the cutter beside the contour, hardly STEP_MM apart, the ways in and out left out, in the position."""
    rows, frame = np.flatnonzero(posted.radius_register == 3)[1:-1], leaning_frame()
    ways = posted.end_mm[rows] - posted.start_mm[rows]
    counts = np.ceil(np.linalg.norm(ways, axis=1) / STEP_MM).astype(int)
    shares = [np.arange(1, n + 1)[:, None] / n for n in counts]
    assert (posted.kind[rows] == Kind.FEED).all() and np.abs(posted.feed_mm_per_min[rows] / 600.0 - 1.0).max() < 1e-4
    assert np.abs(frame.turn_into(posted.end_axis[rows]) - (0, 0, 1)).max() < 1e-5
    return frame.into(np.vstack([a + share * way for a, way, share in zip(posted.start_mm[rows], ways, shares)]))


@pytest.mark.parametrize("control, name", ON_MACHINES)
def test_at_the_nominal_radius_the_middle_of_the_cutter_is_where_it_was_planned(control, name):
    posted = read(control, name)
    places, planned = middle(posted), PLANNED.moves.end_mm[2:-2]
    assert np.abs(places[:, 2] - HEIGHT_MM).max() < ROUNDING_MM and not posted.remarks and posted.ended
    if control not in CORNERS_BY_LINES:
        assert max(np.linalg.norm(places - p, axis=1).min() for p in planned) < OFF_MM
    away = away_mm(places[:, :2])
    assert away.min() > RADIUS - OFF_MM and (np.abs(away - RADIUS) < OFF_MM).mean() > 0.4


@pytest.mark.parametrize("control, name", ON_MACHINES)
def test_a_worn_cutter_comes_nearer_to_the_wall_by_what_it_lacks(control, name):
    away = away_mm(middle(read(control, name, radius_mm=RADIUS - WORN))[:, :2])
    assert abs(away.min() - (RADIUS - WORN)) < OFF_MM and (np.abs(away - RADIUS + WORN) < OFF_MM).mean() > 0.4


@pytest.mark.parametrize("control, name", ON_MACHINES)
def test_arcs_go_out_as_arcs_and_nothing_states_times_beside_the_contour(control, name):
    on, off = ON[control]
    lines = text_of(control, name).splitlines()
    begin = next(k for k, line in enumerate(lines) if re.search(rf"\b{on}\b", line) and "(" not in line)
    end = next(k for k in range(begin, len(lines)) if re.search(rf"\b{off}\b", lines[k]))
    beside = lines[begin:end + 1]
    arcs = sum(bool(re.search(r"\b(G2|G3|DR[+-])", line)) for line in beside)
    assert arcs == (PLANNED.compensated[0].contour.kind > Kind.FEED).sum() and not any("G93" in line for line in beside)


BAD = {     # what is done to the text: (controls, pattern, what stands in its place, what the reader says)
    "D of another radius": (("linuxcnc", "fanuc", "haas"), r"G41 D3", "G41 D4", None),
    "G42 for G41": (tuple(CONTROLS), r"G41|RL", lambda m: {"G41": "G42", "RL": "RR"}[m[0]], "does not reach|inner arc"),
    "missing G40": (tuple(CONTROLS), r"(?s)((?:G41|RL)(?= |\n).*?)(G40|R0)", r"\1", "write G40 before"),
    "times of blocks": (("linuxcnc", "fanuc, joints"), r"G94\n(?=(?:G17\n)?G41)", "", "G41 with G93"),
    "a plane that is not there": (("fanuc",), r"(?s)G68.2.*?G53.1\n", "", None),
    "a rotary axis that turns": (("linuxcnc",), r"(G41.*\n)", r"\1G0 X0 A10\n", "rotary axis that turns"),
}


@pytest.mark.parametrize("bad, control", [(bad, control) for bad, (controls, *_) in BAD.items() for control in controls])
def test_known_bad_words_are_found(bad, control):
    _, pattern, other, why = BAD[bad]
    text = text_of(control, "mill_trunnion_ac")
    spoilt = re.sub(pattern, other, text, count=1)
    assert spoilt != text
    if bad == "D of another radius":
        remark, = read(control, "mill_trunnion_ac", spoilt).remarks
        assert remark.kind == "wrong_radius_offset" and remark.amount_mm == pytest.approx(1.0)
        return
    if why is None:
        places = middle(read(control, "mill_trunnion_ac", spoilt))
        assert away_mm(places[:, :2]).min() < 0.5 * RADIUS
        return
    if bad == "G42 for G41":
        try:
            away = away_mm(middle(read(control, "mill_trunnion_ac", spoilt))[:, :2])
        except ReadError as error:
            assert re.search(why, str(error))
        else:
            assert away.min() < 0.5 * RADIUS                # through the part: a gouge
        return
    with pytest.raises(ReadError, match=why) as error:
        read(control, "mill_trunnion_ac", spoilt)
    assert error.value.rows[0] > 5


@pytest.mark.parametrize("control, name, tip, why", [
    ("linuxcnc", "mill_head_head", None, "the tool is not along it"), ("fanuc, joints", "mill_head_table_bc", None, "not along it"),
    ("linuxcnc", "mill_trunnion_ac", "M428", "does not go with M428"), ("haas", "mill_head_head", "G234", "G254")])
def test_where_no_z_of_the_control_is_along_the_tool_it_is_refused_in_one_sentence(control, name, tip, why):
    m = mill(control, name)
    m = m.model_copy(update={"control": m.control.model_copy(update={"tip_control": tip})})
    assert not m.is_along_z_turned
    with pytest.raises(PostError, match=f"operation contour: .*{why}"):
        catalogue.find_post(m.control.post).post(program(turned_contour()), m)


def test_a_head_that_leans_as_joints_is_refused_by_the_reader_too():
    m = machine("mill_head_head")
    text = "G21 G17 G90 G94 G40 G49 G80 G92.1 G91.1\nG64 P0.01\nG54\nT3 M6\nG43 H3\nG0 X0 Y0 Z0 {}\nG41 D3 G1 X20 F100\nG1 X40\nM2"
    letters = " ".join(f"{letter}{angle}" for letter, angle in zip(m.rotaries, (0, 20)))
    with pytest.raises(ReadError, match="a tool that is not along Z"):
        catalogue.reader_of(m)(text.format(letters), work_offsets={"G54": m.wcs_origin_mm}, chain=m.kinematics,
                               tool_lengths={3: TOOL.length_mm}, tool_radii={3: RADIUS})
