"""The vane that a posted compact program cuts, simulated, against what the cutter surface says of it."""

import numpy as np
import pytest
from known_passes import LENGTHS, ZERO, machine
from known_vanes import BALL, BALL_MM, RIDGE_MM, passes, predicted, steep_tip, tip_of, vane_program, wavy_tip

from cuspline.app.catalogue import find_machine, find_post, reader_of
from cuspline.posts.restart import restart_points, restarted
from cuspline.program.program import Kind
from cuspline.stock.swept import deviations_and_moves, swept_paths

ROUNDING_MM = 2e-4          # of the text's numbers, four decimals, and of the simulation
STOCK = (0.0, -9.0, 0.0), (40.0, 9.0, 50.0)
MAP_MM = 2e-4               # linear interpolation of the map between its nodes


def samples(tip, margin_mm=1.5, count=3000, seed=11):
    """(points, normals, x, turn) on the arc, away from the vane's ends."""
    rng = np.random.default_rng(seed)
    low, high = tip.range_mm
    x, turn = rng.uniform(low + margin_mm, high - margin_mm, count), rng.uniform(-1, 1, count) * tip.half_arc_rad
    return tip.point_mm(x, turn), tip.normal(x, turn), x, turn


def simulated(texts, mill, points, normals):
    """(n,) deviation of the points after the programs."""
    moves = [reader_of(mill)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in texts]
    each = [deviations_and_moves(swept_paths(m, {BALL.number: BALL}), *STOCK, points, normals, 2.0)[0] for m in moves]
    return np.min(each, axis=0)


@pytest.mark.parametrize("shape", [wavy_tip, steep_tip])
@pytest.mark.parametrize("register_mm", [BALL_MM, BALL_MM - 0.0508])
@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_the_simulated_vane_is_the_computed_one_and_cusps(shape, register_mm, post):
    """What is left lies between the envelope and the envelope with cusps on it; plating is missing from the metal."""
    tip, mill = shape(), machine(post)
    points, normals, x, turn = samples(tip)
    text = find_post(post).post(vane_program(tip, register_mm=register_mm), mill).text
    left, map_mm = simulated([text], mill, points, normals), predicted(tip, register_mm, x, turn)
    inside = np.isfinite(map_mm)
    assert inside.mean() > 0.75
    over = (left - map_mm)[inside]
    assert over.min() > -ROUNDING_MM - MAP_MM
    assert over.max() < RIDGE_MM + ROUNDING_MM + MAP_MM
    assert over.max() > 0.5 * RIDGE_MM          # the cusps are there: the step is no finer than asked
    assert np.ptp(map_mm[inside]) > 3 * (ROUNDING_MM + MAP_MM)          # the map says something
    crest = inside & (np.abs(turn) < 0.02)
    if register_mm < BALL_MM and shape is wavy_tip:
        assert np.abs(map_mm[crest] + 0.0508).max() < 1e-3


def test_a_fault_in_the_passes_shows():
    """A pass left out, a register two hundredths too small, the arc's centre a hundredth too low."""
    tip, mill = wavy_tip(), machine()
    points, normals, x, turn = samples(tip, count=1500)
    map_mm = predicted(tip, BALL_MM, x, turn)
    text = find_post("linuxcnc").post(vane_program(tip), mill).text
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("N2001 "))
    calls = [k for k, line in enumerate(lines) if k > first and " call [" in line]
    label, _, numbers = lines[calls[30]].partition(" call ")
    y, z, c = (float(n) for n in numbers.strip("[]").split("] ["))
    moved = f"{label} call [{y:.4f}] [{z - 0.01:.4f}] [{c - 0.01:.4f}]"
    register = next(k for k, line in reversed(list(enumerate(lines))) if "(TOOL RADIUS OFFSET)" in line)
    number = lambda words: next(line.partition("=")[0] for line in lines if words in line)
    left_out = f"{number('(PLANE, COUNTS ON)')}=[{number('(PLANE, COUNTS ON)')}+{number('(INTERVAL OF THE PLANES)')}]"
    smaller = lines[register].replace("=3 ", "=2.98 ")
    assert smaller != lines[register]
    for k, instead, is_deeper in ((calls[30], left_out, False), (register, smaller, True), (calls[30], moved, True)):
        faulty = "\n".join([*lines[:k], instead, *lines[k + 1:]]) + "\n"
        over = simulated([faulty], mill, points, normals) - map_mm
        over = over[np.isfinite(over)]
        assert over.min() < -0.005 if is_deeper else over.max() > RIDGE_MM + ROUNDING_MM + MAP_MM


@pytest.mark.parametrize("post", ["linuxcnc", "fanuc"])
def test_a_restart_gives_the_same_vane(post):
    """Cut up to a restart point, then begun there again from the top of the machine."""
    tip, mill = steep_tip(), machine(post)
    points, normals, _, _ = samples(tip, count=800)
    text = find_post(post).post(vane_program(tip, restart_steps=20), mill).text
    whole = simulated([text], mill, points, normals)
    finish = [p for p in restart_points(text) if p > 2000]
    assert len(finish) > 5
    for point in (finish[1], finish[len(finish) // 2], finish[-2]):
        start = text.index(f"N{point} ")
        main_end = text.index("M30", start) if post == "fanuc" else text.index("M2\n", start)
        before = text[:start] + text[main_end:]
        again = restarted(text, point)
        both = simulated([before, again], mill, points, normals)
        assert np.abs(both - whole).max() < 1e-9
        assert (simulated([before], mill, points, normals) > whole + 0.01).any()        # the rest was needed


def test_the_set_of_a_small_store_cuts_the_same_vane():
    tip = wavy_tip()
    points, normals, _, _ = samples(tip, count=800)
    whole = find_post("fanuc").post(vane_program(tip, restart_steps=20), machine("fanuc"))
    parts = find_post("fanuc").post(vane_program(tip, restart_steps=20), machine("fanuc", program_store_bytes=6000))
    assert len(parts.texts) > 1
    one = simulated([whole.text], machine("fanuc"), points, normals)
    assert np.abs(simulated(parts.texts, machine("fanuc"), points, normals) - one).max() < 1e-9


# paper tape -------------------------------------------------------------------------------------------

TAPE_CHARACTERS_PER_INCH, STEP_INCHES, REEL_FEET = 10, 3.7, 800


def test_a_reel_of_tape_holds_the_steps_that_the_source_says():
    """800 ft at 3.7 in a step are 2594 steps; a step of ours is shorter, and the sub-programs stand behind."""
    tape = find_machine("mill_paper_tape")
    assert tape.control.program_store_bytes == REEL_FEET * 12 * TAPE_CHARACTERS_PER_INCH
    assert int(REEL_FEET * 12 / STEP_INCHES) == 2594
    tip = tip_of(lambda x: 40.0 + 0.5 * np.cos(x / 6.0), length_mm=400.0)
    told, steps = passes(tip, ridge_mm=0.0009)
    program = vane_program(tip, ridge_mm=0.0009)
    assert len(steps) > 2700
    posted = find_post("fanuc").post(program, tape)
    finish = [t for t in posted.texts if "(OPERATION 2: FINISH" in t]
    calls = [sum(line.startswith("G65") for line in t.splitlines()) for t in posted.texts]
    lengths = [len(line) + 1 for line in finish[0].splitlines() if line.startswith("G65") and line.count(".") == 3]
    assert np.mean(lengths) <= STEP_INCHES * TAPE_CHARACTERS_PER_INCH
    assert max(calls) >= 2594 - 60 and len(posted.texts) == 2
    assert all(len(t) <= tape.control.program_store_bytes for t in posted.texts)
    moves = [reader_of(tape)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in posted.texts]
    assert sum((m.kind >= Kind.ARC_CW).sum() for m in moves) == sum(
        (o.moves.kind >= Kind.ARC_CW).sum() for o in program.operations)
