"""Five-axis programs and machine files that are wrong, each refused or found by name.

Elsewhere: a pivot 0.1 mm off (test_leaning_verdict.py), a table that winds up (test_turning.py, test_five_axis_post.py), a
head that meets the swinging part between two blocks (test_body_clearance.py), G43.4 missing or with the wrong H
(test_fanuc_five_axis.py).
"""

import re
from functools import cache

import numpy as np
import pytest
import tilted_dome as dome
from known_machines import leaning
from known_tilted import CLEARANCE_MM, off_lines, operation, read, text_of
from pydantic import ValidationError

from cuspline.program.program import Kind, MoveWriter
from cuspline.replay.replay import replay
from cuspline.replay.scene import FoundStock, Surroundings
from cuspline.verification.verdict import Judging, Options, SetupProgram, first_look

SOLID = dome.solid()
OPTIONS = Options(spacing_mm=0.8, solid_pitch_mm=0.4, replay_pitch_mm=0.5, tessellation_mm=0.005)
JUDGING = Judging(tools=dome.TOOLS, stock=dome.STOCK, finish=dome.FINISH, ball_radius_mm=1.0, options=OPTIONS)


@cache
def good_text():
    return dome.text_of(dome.trunnion(), dome.finishing(1.0))


def changed(**axes):
    """The trunnion with other values of its rotaries."""
    mill = dome.trunnion().model_dump()
    return type(dome.trunnion()).model_validate({**mill, **{name: mill[name] | values for name, values in axes.items()}})


def deepest_mm(text):
    """How deep the leaning ball cuts into the dome, as posted."""
    program = SetupProgram(posted=dome.read(dome.trunnion(), text), setup=dome.SETUP, faces=tuple(dome.dome_of(SOLID)))
    return -float(first_look([program], SOLID, JUDGING).residuals[0][1].deviation_mm.min())


def travels(mill, text):
    """[(line, amount, advice)] of joints beyond their ranges."""
    stock = FoundStock(min_mm=dome.STOCK.min_mm, max_mm=dome.STOCK.max_mm, pitch_mm=0.5)
    found = replay(dome.read(mill, text), dome.TOOLS, stock, around=Surroundings(machine=mill))
    return [(f.line, f.amount_mm, f.advice) for f in found.findings if f.kind == "travel_exceeded"]


def test_the_good_program_gouges_nothing_and_keeps_to_its_travels():
    assert deepest_mm(good_text()) < dome.FINISH.gouge_mm and travels(dome.trunnion(), good_text()) == []


def test_limits_inverted_are_refused():
    with pytest.raises(ValidationError, match="max_deg -120.0 must exceed min_deg 30.0"):
        changed(a={"min_deg": 30.0, "max_deg": -120.0})


def test_parallel_rotaries_are_refused():
    with pytest.raises(ValidationError, match="C and A turn about parallel axes"):
        changed(a={"direction": (0.0, 0.0, 1.0)})


def test_a_program_with_the_wrong_sign_of_a_gouges():
    mirrored = dome.text_of(changed(a={"direction": (-1.0, 0.0, 0.0), "min_deg": -30.0, "max_deg": 120.0}), dome.finishing(1.0))
    assert deepest_mm(mirrored) > 0.05


def test_rotary_words_scaled_as_lengths_gouge():
    """A post that divides degrees by 25.4 as if they were lengths."""
    begins = good_text().index("OPERATION 2")
    scaled = re.sub(r"\b([AC])(-?[\d.]+)", lambda w: f"{w[1]}{float(w[2]) / 25.4:.5f}", good_text()[begins:])
    assert deepest_mm(good_text()[:begins] + scaled) > 0.05


def test_a_rotary_a_tenth_of_a_degree_over_its_range_is_found_by_its_line():
    least = min((float(a), k) for k, line in enumerate(good_text().splitlines(), 1) for a in re.findall(r"\bA(-[\d.]+)", line))
    (line, _, advice), *_ = travels(changed(a={"min_deg": round(least[0] + 0.1, 5)}), good_text())
    assert line == least[1] and f"A stands at {least[0]:.4f} degrees, its range is {least[0] + 0.1:.4f} .. 30 degrees" in advice


@cache
def over_the_pole():
    """(machine whose A leans one way alone, moves that lean from one side of the pole to the other, their text)."""
    w = MoveWriter((20, 0, CLEARANCE_MM))
    for x in (20, 25, 30):
        w.feed((x, 0, 0), 500)
    w.rapid((30, 0, CLEARANCE_MM))
    moves = w.moves()
    moves = type(moves)(**{**moves.__dict__, "axis": leaning([8, 8, -8, -8], 0.0)})
    mill = changed(a={"min_deg": -120.0, "max_deg": 0.0})
    return mill, moves, text_of(mill, operation("finish", moves))


def off_line_mm(mill, moves, text):
    posted = read(mill, text)
    cut = np.flatnonzero((posted.kind == Kind.FEED) & (np.abs(posted.end_mm[:, 2]) < 20))
    return off_lines(posted.end_mm[cut], moves.starts_mm, moves.end_mm).max()


def test_an_axis_through_the_pole_turns_the_table_on_the_spot():
    mill, moves, text = over_the_pole()
    turns = np.array([float(c) for c in re.findall(r"\bC(-?[\d.]+)", text)])
    assert np.ptp(turns) > 179 and off_line_mm(mill, moves, text) < mill.control.path_tolerance_mm


def test_a_program_that_goes_through_the_pole_without_turning_on_the_spot_leaves_its_line():
    """What a post without poles would write: from one side to the other in one block."""
    mill, moves, text = over_the_pole()
    lines = text.splitlines()
    cut = [k for k, line in enumerate(lines) if lines.index("G93") < k < lines.index("G94")]
    turning = [k for k in cut if re.search(r"\bC-?[\d.]", lines[k])]
    spoilt = "\n".join(line for k, line in enumerate(lines) if k not in range(turning[0] - 3, turning[-1])) + "\n"
    assert off_line_mm(mill, moves, spoilt) > 1.0
