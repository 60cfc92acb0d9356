"""Programs that are sent while they run: when a control waits for blocks, against an event by event walk and closed forms."""

import re

import numpy as np
import pytest
import small_program
from pydantic import ValidationError

from cuspline.app import catalogue
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.process.feeding import waits_s
from cuspline.shop.machines import Control, Feeding
from cuspline.verification.feeding import feeding_findings
from cuspline.verification.text_checks import increments_mm

LINE = Feeding(request_on_blocks=4, request_off_blocks=8, bytes_per_s=100.0, refill_s=0.25)


def walked(lasts_s, bytes_of, feeding):
    """The same, one event after the other: a clock, a memory, a line."""
    n, clock, runs, held, wait = len(lasts_s), 0.0, 0, min(feeding.request_off_blocks + 1, len(lasts_s)), [0.0] * len(lasts_s)
    ends, due, is_taking = lasts_s[0], None, False
    while runs < n - 1:
        behind = held - 1 - runs
        if not is_taking and behind < feeding.request_on_blocks and held < n:
            is_taking, due = True, clock + feeding.refill_s + bytes_of[held] / feeding.bytes_per_s
        if due is None or behind > 0 and ends <= due:           # the next block begins, if it is there
            if behind == 0:
                raise AssertionError("nothing comes and nothing is there")
            clock = max(clock, ends)
            runs += 1
            wait[runs] = clock - ends
            ends = clock + lasts_s[runs]
            continue
        clock, held = due, held + 1
        due = None
        if held < n and held - 1 - runs - (ends <= clock and held - 1 > runs) <= feeding.request_off_blocks:
            due = clock + bytes_of[held] / feeding.bytes_per_s
        else:
            is_taking = False
    return wait


@pytest.mark.parametrize("seed", range(12))
def test_waits_are_those_of_a_walk_through_all_events(seed):
    rng = np.random.default_rng(seed)
    on = int(rng.integers(1, 6))
    feeding = Feeding(request_on_blocks=on, request_off_blocks=on + int(rng.integers(0, 6)), bytes_per_s=100.0,
                      refill_s=float(rng.choice([0.0, 0.3])))
    lasts, sizes = rng.uniform(0.05, 0.5, 200), rng.integers(10, 50, 200)
    found = waits_s(lasts, sizes, feeding)
    assert found == pytest.approx(walked(lasts.tolist(), sizes.tolist(), feeding), abs=1e-9)
    assert (found > 0).any()


@pytest.mark.parametrize("lasts_s, is_late", [(0.26, False), (0.24, True)])
def test_what_stands_by_must_last_until_the_first_block_of_a_request_comes(lasts_s, is_late):
    """Four blocks last as long as 0.25 s to the first byte and three quarters of a second on the line; later ones come in time."""
    sizes = np.full(60, 10)
    sizes[9:] = 75
    feeding = LINE.model_copy(update={"request_off_blocks": 8, "bytes_per_s": 100.0})
    first = waits_s(np.full(60, lasts_s), sizes, feeding)[:10]
    assert (first[9] > 0) == is_late


def test_a_line_that_carries_less_than_the_control_runs_sets_the_pace():
    wait = waits_s(np.full(400, 0.1), np.full(400, 20), LINE)       # 0.2 s a block on the line
    assert wait[-50:] == pytest.approx(np.full(50, 0.1))
    assert waits_s(np.full(400, 0.1), np.full(400, 9), LINE).max() == 0.0


# in a program -----------------------------------------------------------------------------------

PROGRAM = "\n".join(["G21 G90 G17 G40 G49 G54 G64 P0.001", "T1 M6", "G43 H1 S5000 M3", "G0 X0 Y0 Z5", "G1 Z0 F{feed}",
                     *(f"G1 X{0.05 * k:.4f} Y{0.0001 * (k % 7):.4f}" for k in range(1, 300)), "G0 Z5", "M2"]) + "\n"


def machine(feeding):
    mill = catalogue.find_machine("mill_3axis")
    return mill.model_copy(update={"control": Control(**{**mill.control.model_dump(), "sub_programs": False, "feeding": feeding})})


def found(feed, feeding):
    text = PROGRAM.format(feed=feed)
    moves = read_program(text, work_offsets={"G54": (0.0, 0.0, 0.0)}, tool_lengths={1: 50.0})
    return feeding_findings(moves, [text], machine(feeding), "setup-1"), text


def test_short_blocks_at_a_high_feed_starve_a_slow_line_with_the_line_that_waits_and_a_feed_that_does_not():
    slow = Feeding(request_on_blocks=20, request_off_blocks=60, bytes_per_s=960, refill_s=0.05)
    (late,), text = found(2000, slow)
    assert (late.kind, late.setup, late.unit) == ("late_blocks", "setup-1", "s") and late.amount > 1
    assert text.splitlines()[late.line - 1].startswith("G1 X")
    kept = int(late.advice.partition("about F")[2].split()[0])
    assert 50 < kept < 200                                  # 0.05 mm in 18 or so bytes at 960 a second: 160 mm/min
    assert found(0.9 * kept, slow)[0] == ()


@pytest.mark.parametrize("name", ["haas", "grbl", "siemens", "heidenhain", "pmac"])
def test_a_slow_line_starves_every_control_at_a_line_of_its_own_text(name):
    short = small_program.one(("feed", (0.0, 0.0, 0.0), 300),
                              *(("feed", (0.05 * k, 0.003 * (k % 7), 0.0), 2000) for k in range(1, 200)))
    slow = Feeding(request_on_blocks=20, request_off_blocks=60, bytes_per_s=960, refill_s=0.05)
    mill = small_program.changed(catalogue.find_machine(f"mill_{name}"), feeding=slow, sub_programs=False)
    text = catalogue.find_post(name).post(short, mill).text
    moves = catalogue.reader_of(mill)(text, work_offsets={"G55": (0.0, 0.0, 0.0)},
                                      tool_lengths={o.tool.number: o.tool.length_mm for o in short.operations})
    late, = feeding_findings(moves, [text], mill, "setup-1")
    assert late.kind == "late_blocks" and late.operation == "cut" and late.amount > 1
    assert re.search(r"X[+-]?\d", text.splitlines()[late.line - 1])
    fast = small_program.changed(mill, feeding=slow.model_copy(update={"bytes_per_s": 100_000, "refill_s": 0.0}))
    assert feeding_findings(moves, [text], fast, "setup-1") == ()


def test_nothing_is_said_of_a_fast_line_or_of_a_control_that_holds_the_program():
    assert found(2000, Feeding(request_on_blocks=20, request_off_blocks=60, bytes_per_s=100_000))[0] == ()
    assert found(2000, None)[0] == ()


def test_a_memory_that_cannot_be_and_sub_programs_beside_it_are_refused():
    with pytest.raises(ValidationError, match="must not be below"):
        Feeding(request_on_blocks=9, request_off_blocks=8, bytes_per_s=960)
    with pytest.raises(ValidationError, match="sub_programs = false"):
        Control(**{**catalogue.find_machine("mill_3axis").control.model_dump(), "feeding": LINE})


def test_half_of_every_axis_step_counts_as_error():
    mill = catalogue.find_machine("mill_3axis")
    stepped = mill.model_copy(update={k: getattr(mill, k).model_copy(update={"increment_mm": 0.00127}) for k in "xyz"})
    assert increments_mm(mill) == 0.0 == increments_mm(None)
    assert increments_mm(stepped) == pytest.approx(0.000635 * 3 ** 0.5)
