"""Drilled holes as canned cycles: what the posts write, the readers make the planned moves of.

Accept new gold files with   CUSPLINE_ACCEPT_GOLD=1 pytest tests/posts/test_drilling_cycles.py
"""

import importlib
import os
from pathlib import Path

import numpy as np
import pytest
from known_tools import tool

import cuspline.posts
from cuspline.program.drilling import CLEARANCE_MM, DrillCycle, drilled, shortest_way
from cuspline.program.program import Kind, MoveWriter, Operation, Plane, Program
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import ReadError, ToolpathError

MACHINES = Path(cuspline.posts.__file__).parent / "machines"
LEVEL, FEED, T = 20.0, 240.0, tool("flat", 6, number=3)
KINDS = {"drill": {}, "dwell": {"dwell_s": 0.25}, "peck": {"peck_mm": 2.5}, "chip_break": {"peck_mm": 3.0}, "ream": {}}


def hole(kind, x, y, bottom=-5.0, retract=3.0, **more):
    return DrillCycle(kind=kind, xy_mm=(x, y), bottom_z_mm=bottom, retract_z_mm=retract, feed_mm_per_min=FEED, first=0, end=0,
                      **{**KINDS.get(kind, {}), **more})


def operation(holes, name="drill"):
    moves, cycles = drilled(holes, LEVEL, FEED)
    return Operation(name=name, tool=T, spindle_rpm=3000.0, coolant="flood", moves=moves, cycles=cycles)


def posted(machine, *operations, **control):
    """(text, PostedMoves)."""
    machine = machine_from_toml(MACHINES / f"{machine}.toml")
    machine = machine.model_copy(update={"control": machine.control.model_copy(update=control)})
    writer = importlib.import_module(f"cuspline.posts.writers.{machine.control.post}")
    program = Program(name="plate", setup="setup-1", wcs="G54", wcs_in_words="corner", operations=operations,
                      clearance_z_mm=LEVEL, header=("PLATE",))
    text = writer.post(program, machine).text
    return text, read(text, machine)


def read(text, machine="mill_3axis"):
    machine = machine_from_toml(MACHINES / f"{machine}.toml") if isinstance(machine, str) else machine
    writer = importlib.import_module(f"cuspline.posts.writers.{machine.control.post}")
    reader = importlib.import_module(f"cuspline.posts.readers.{writer.READER}")
    return reader.read_program(text, work_offsets={"G54": machine.wcs_origin_mm}, tool_lengths={3: T.length_mm})


def ways(kinds, ends):
    """Kinds and places of moves that lead somewhere, in one sequence."""
    out = []
    for kind, end in zip(np.asarray(kinds).tolist(), np.round(ends, 3).tolist()):
        if not out or out[-1][1] != end:
            out.append((int(kind), end))
    return out


def of_text(moves):
    first = int(np.flatnonzero(np.abs(moves.end_mm[:, 2] - LEVEL) < 1e-3)[0])       # above the first hole
    rows = slice(first, len(moves) - 1)             # the last goes to the top of the machine
    return ways(moves.kind[rows], moves.end_mm[rows])


def of_plan(planned):
    moves = planned.moves
    return ways([Kind.RAPID, *moves.kind], np.vstack([moves.start_mm, moves.end_mm]))


@pytest.mark.parametrize("stays_low", [False, True], ids=["G98", "G99"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("machine", ["mill_3axis", "mill_3axis_inch", "mill_fanuc", "mill_haas"])
def test_what_is_read_is_what_was_planned(machine, kind, stays_low):
    holes = [hole(kind, 10, 10, stays_low=stays_low), hole(kind, 30, 10, stays_low=stays_low),
             hole(kind, 30, 25, bottom=-7.5, stays_low=stays_low)]
    planned = operation(holes)
    text, moves = posted(machine, planned)
    assert text.count("G80") == 2 and ("G99" in text) == stays_low       # one in the header
    clearance = 0.254 - CLEARANCE_MM                                    # which is the control's own
    want, got = of_plan(planned), of_text(moves)
    assert len(got) == len(want)
    for (a, p), (b, q) in zip(got, want):
        assert a == b
        step = clearance if b == Kind.RAPID and p[2] not in (LEVEL, 3.0) else 0.0
        np.testing.assert_allclose(p, np.add(q, (0, 0, step)), atol=2e-3)
    assert (moves.feed_mm_per_min[moves.kind == Kind.FEED] == pytest.approx(FEED, rel=0.01))


@pytest.mark.parametrize("machine", ["mill_3axis", "mill_fanuc", "mill_haas"])
def test_without_canned_cycles_the_same_holes_go_out_move_by_move(machine):
    planned = operation([hole("peck", 10, 10), hole("peck", 30, 10)])
    text, moves = posted(machine, planned, canned_cycles=False)
    assert not {"G81", "G83", "G98"} & set(text.split())
    assert of_text(moves) == of_plan(planned)
    dwelt, _ = posted(machine, operation([hole("dwell", 10, 10)]), canned_cycles=False)
    lines = dwelt.split("\n")
    k = next(k for k, line in enumerate(lines) if line.endswith("G4 P250" if machine == "mill_fanuc" else "G4 P0.250"))
    assert "Z-5" in lines[k - 1] and "G0" in lines[k + 1]


@pytest.mark.parametrize("machine", ["mill_siemens", "mill_heidenhain", "mill_grbl", "mill_pmac"])
def test_controls_without_cycles_drill_move_by_move(machine):
    planned = operation([hole("peck", 10, 10), hole("chip_break", 30, 10)])
    _, moves = posted(machine, planned, canned_cycles=False)
    assert of_text(moves) == of_plan(planned)
    _, moves = posted(machine, operation([hole("dwell", 10, 10)]), canned_cycles=False)
    stop, = (s for s in moves.stops if s.word == "G4")
    assert stop.seconds == 0.25 and moves.end_mm[stop.row - 1, 2] == moves.end_mm[:, 2].min() and moves.kind[stop.row] == Kind.RAPID


OWN_CYCLES = ("mill_siemens", "mill_heidenhain")


def fed_by(machine, planned):
    """(n, 3) ends of strokes at the feed: those of the plan, but that pecks count from a millimetre under R where a control's own
    cycles do, divide the depth evenly on a Sinumerik, and break chips at the feed there."""
    if machine not in OWN_CYCLES:
        return planned.moves.end_mm[planned.moves.kind != Kind.RAPID]
    ends = []
    for c in planned.cycles:
        surface, heights = c.retract_z_mm - 1.0, []
        count = int(np.ceil((surface - c.bottom_z_mm) / c.peck_mm - 1e-9)) if c.peck_mm else 1
        stroke = (surface - c.bottom_z_mm) / count if machine == "mill_siemens" else c.peck_mm
        for k in range(1, count):
            heights += [surface - k * stroke]
            heights += [surface - k * stroke + CLEARANCE_MM] if (machine, c.kind) == ("mill_siemens", "chip_break") else []
        heights += [c.bottom_z_mm, *([c.retract_z_mm] if c.kind == "ream" else [])]
        ends += [(*c.xy_mm, z) for z in heights]
    return np.array(ends)


def random_holes(rng):
    """One to six, of any kind, depth, R plane, peck and dwell; those that stay low share their R plane."""
    stays_low, retract, holes = bool(rng.integers(2)), float(rng.uniform(1, 6)), []
    for k in rng.integers(len(KINDS), size=rng.integers(1, 7)):
        kind = list(KINDS)[k]
        more = {"dwell": {"dwell_s": float(rng.integers(100, 2000)) / 1000}, "drill": {}, "ream": {}}.get(
            kind, {"peck_mm": float(rng.uniform(1, 4))})
        holes.append(hole(kind, *rng.uniform(-80, 80, 2).tolist(), bottom=float(rng.uniform(-12, -1)), stays_low=stays_low,
                          retract=retract if stays_low else float(rng.uniform(1, 6)), **more))
    return holes


@pytest.mark.parametrize("unit", ["mm", "inch"])
@pytest.mark.parametrize("machine", ["mill_3axis", "mill_fanuc", "mill_haas", "mill_siemens", "mill_heidenhain", "mill_grbl",
                                     "mill_pmac", "mill_apt"])
def test_fifty_random_programs_of_holes_read_back_as_they_were_meant(machine, unit):
    """Every stroke at the feed ends where it was planned, within half the last digit; every dwell stands at its bottom."""
    for seed in range(50):
        planned = operation(random_holes(np.random.default_rng(seed)))
        _, moves = posted(machine, planned, units=unit, decimals_inch=6, decimals_mm=4)
        control = machine_from_toml(MACHINES / f"{machine}.toml").control.model_copy(update={
            "units": unit, "decimals_inch": 6, "decimals_mm": 4})
        wanted = fed_by(machine, planned)
        feeds = np.flatnonzero(moves.kind != Kind.RAPID)
        assert len(feeds) == len(wanted), seed
        off = np.abs(moves.end_mm[feeds] - wanted)
        # pecks are counted down from R by Q, each rounded by itself, on a Sinumerik upward
        step, pecks = (2.5 if machine in OWN_CYCLES else 0.5) * control.resolution_mm, any(c.peck_mm for c in planned.cycles)
        digits = step * (2 + np.arange(len(wanted)) if pecks else 1)
        assert (off <= np.reshape(digits, (-1, 1)) * (1 + 1e-6)).all() and moves.remarks == (), (seed, off.max())
        dwells = [(s.row - 1, s.seconds) for s in moves.stops if s.word == "G4"]
        bottoms = [(int(np.flatnonzero(np.abs(moves.end_mm[feeds] - (*c.xy_mm, c.bottom_z_mm)).max(axis=1) < 2e-3)[0]), c.dwell_s)
                   for c in planned.cycles if c.dwell_s]
        found = [(int(np.searchsorted(feeds, row)), seconds) for row, seconds in dwells]
        assert found == [(k, pytest.approx(s)) for k, s in bottoms]


@pytest.mark.parametrize("machine, pitch_mm", [("mill_3axis", 0.0), ("mill_3axis_inch", 0.0), ("mill_fanuc", 0.0),
                                               ("mill_siemens", 0.0), ("mill_fanuc", 1.0), ("mill_haas", 1.0)])
def test_holes_after_an_arc_that_stands_upright_are_made_along_z(machine, pitch_mm):
    path = MoveWriter((0.0, 0.0, LEVEL))
    path.feed((0.0, 0.0, 10.0), FEED)
    path.arc((10.0, 0.0, 10.0), (5.0, 0.0, 10.0), Plane.ZX, True, FEED)
    path.rapid((10.0, 0.0, LEVEL))
    profile = Operation(name="profile", tool=T, spindle_rpm=FEED, coolant="flood", moves=path.moves())
    moves, cycles = drilled([hole("tap" if pitch_mm else "drill", 10, 10, pitch_mm=pitch_mm)], LEVEL, FEED)
    holes = Operation(name="holes", tool=T, spindle_rpm=FEED, coolant="flood", moves=moves, cycles=cycles)
    text, read_back = posted(machine, profile, holes)
    assert "G18" in text
    assert (np.abs(read_back.end_mm - (10, 10, -5)).max(axis=1) < 2e-3).sum() == 1


def test_text_names_what_changes_and_nothing_else():
    text, _ = posted("mill_fanuc", operation([hole("peck", 10, 10), hole("peck", 30, 10), hole("peck", 30, 25, bottom=-7.5)]))
    lines = text.split("\n")
    k = next(i for i, line in enumerate(lines) if "G83" in line)
    assert lines[k:k + 4] == ["G98 G83 X10. Y10. Z-5. R3. Q2.5 F240.0", "X30. Y10.", "X30. Y25. Z-7.5", "G80"]


def test_operations_before_and_after_find_the_state_that_they_wrote():
    planned = operation([hole("drill", 10, 10), hole("chip_break", 30, 10), hole("chip_break", 5, 5, retract=4.0)])
    text, moves = posted("mill_3axis", planned, operation([hole("dwell", 3, 4), hole("drill", 5, 6)], name="again"))
    assert moves.operations == ("drill", "again")
    bottoms = moves.end_mm[moves.kind == Kind.FEED]
    assert {tuple(b) for b in bottoms[:, :2].tolist()} == {(10, 10), (30, 10), (5, 5), (3, 4), (5, 6)}
    assert text.count("G80") == 3


WORDS = {
    "mill_siemens": {
        "drill": ["F240.0", "CYCLE81(20,2,1,-5)"], "dwell": ["F240.0", "CYCLE82(20,2,1,-5,,0.250)"],
        "peck": ["F240.0", "CYCLE83(20,2,1,-5,,,2.3334,0,,,1,1,,,,,0.5)"],
        "chip_break": ["F240.0", "CYCLE83(20,2,1,-5,,,2.3334,0,,,1,0,,,0.5)"], "ream": ["CYCLE85(20,2,1,-5,,,240.0,240.0)"]},
    "mill_heidenhain": {
        "drill": ["CYCL DEF 200 DRILLING ~", "  Q200=+1 ;SET-UP CLEARANCE ~", "  Q201=-7 ;DEPTH ~",
                  "  Q206=240.0 ;FEED RATE FOR PLUNGING ~", "  Q202=+7 ;PLUNGING DEPTH ~", "  Q210=0 ;DWELL TIME AT TOP ~",
                  "  Q203=+2 ;SURFACE COORDINATE ~", "  Q204=+18 ;2ND SET-UP CLEARANCE ~", "  Q211=0.000 ;DWELL TIME AT DEPTH ~",
                  "  Q395=0 ;DEPTH REFERENCE", "CYCL CALL"],
        "chip_break": ["CYCL DEF 203 UNIVERSAL DRILLING ~"], "ream": ["CYCL DEF 201 REAMING ~"]}}


@pytest.mark.parametrize("machine, kind", [(m, k) for m, kinds in WORDS.items() for k in kinds])
def test_controls_with_calls_of_their_own_get_them_where_the_tool_stands(machine, kind):
    text, moves = posted(machine, operation([hole(kind, 10, 10), hole(kind, 30, 10)]))
    lines = [line if line.startswith("  ") else line.lstrip("0123456789 ") for line in text.split("\n")]
    k = lines.index(WORDS[machine][kind][0])
    assert lines[k:k + len(WORDS[machine][kind])] == WORDS[machine][kind]
    assert sum("CYCLE8" in line or "CYCL CALL" in line for line in lines) == 2 and text.count("CYCL DEF 20") <= 1
    bottoms = moves.end_mm[(moves.kind == Kind.FEED) & (moves.end_mm[:, 2] == -5)]
    assert bottoms[:, :2].tolist() == [[10, 10], [30, 10]] and moves.remarks == ()
    assert moves.end_mm[-2].tolist() == [30, 10, LEVEL]


@pytest.mark.parametrize("machine, ending", [("mill_siemens", "mpf"), ("mill_heidenhain", "h")])
def test_all_kinds_of_holes_go_out_as_the_gold_program_has_them(machine, ending):
    holes = [hole(kind, 10.0 + 7 * k, 10 + k, bottom=-5.0 - k) for k, kind in enumerate(KINDS)]
    text, _ = posted(machine, operation([*holes, hole("drill", 60, 30, stays_low=True), hole("drill", 70, 30, stays_low=True)]))
    path = Path(__file__).parent.parent / f"gold/holes_{machine.removeprefix('mill_')}.{ending}"
    if os.environ.get("CUSPLINE_ACCEPT_GOLD"):
        path.write_text(text)
    assert path.read_text() == text


SPOILT = [
    ("mill_siemens", "peck", "2.3334", "2.4", "divide the depth evenly"),
    ("mill_siemens", "peck", "2.3334", "", "without its first depth"),
    ("mill_siemens", "peck", ",0,,,1,1", ",0.5,,,1,1", "with DAM"),
    ("mill_siemens", "peck", ",1,1,", ",0.5,1,", "another feed"),
    ("mill_siemens", "peck", ",,,,,0.5", "", "without DIS1"),
    ("mill_siemens", "drill", "20,2,1,-5", "20,2,1,5", "one over the other"),
    ("mill_siemens", "drill", "20,2,1,-5", "2,2,1,-5", "one over the other"),
    ("mill_siemens", "drill", "20,2,1,-5", "40,30,1,-5", "below RFP"),
    ("mill_siemens", "drill", "20,2,1,-5", "20,2", "without one of DP"),
    ("mill_siemens", "drill", "F240.0\n", "", "no feed is set"),
    ("mill_siemens", "drill", "CYCLE81", "MCALL CYCLE81", "no word that this reader knows|beside other words"),
    ("mill_siemens", "drill", "CYCLE81", "CYCLE86", "no word that this reader knows"),
    ("mill_siemens", "dwell", "0.250", "-3", "turns of the spindle"),
    ("mill_siemens", "ream", ",,240.0,240.0", "", "without FFR"),
    ("mill_heidenhain", "drill", "Q201=-7", "Q201=+7", "makes no sense"),
    ("mill_heidenhain", "drill", "Q210=0", "Q210=1", "stands still at the top"),
    ("mill_heidenhain", "drill", "  Q211=0.000 ;DWELL TIME AT DEPTH ~\n", "", "without all of its parameters"),
    ("mill_heidenhain", "drill", "Q395=0", "Q395=1", "counts to the full diameter"),
    ("mill_heidenhain", "drill", "Q203=+2", "Q203=+40", "below its set-up"),
    ("mill_heidenhain", "drill", "CYCL DEF 200", "CYCL DEF 208", "cycle 208"),
    ("mill_heidenhain", "chip_break", "Q213=3", "Q213=1", "comes up between"),
    ("mill_heidenhain", "drill", "Q202=+7", "Q202=+0", "with strokes of 0")]


PECKING = {"Q200": 1, "Q201": -12, "Q206": 240, "Q202": 5, "Q203": 2, "Q204": 18, "Q212": 0, "Q205": 0, "Q258": 0.5, "Q259": 0.5,
           "Q257": 0, "Q256": 0.2, "Q211": 0, "Q379": 0, "Q253": 750, "Q208": 99999, "Q395": 0}


def pecking(**q):
    """Text of a hole by cycle 205 in place of 200; None: the parameter is left out."""
    text, _ = posted("mill_heidenhain", operation([hole("drill", 10, 10)]))
    rows = " ~\n".join(f"  {name}={value:+g} ;" for name, value in (PECKING | q).items() if value is not None)
    begin, end = text.index("CYCL DEF 200"), text.index("DEPTH REFERENCE") + len("DEPTH REFERENCE")
    return f"{text[:begin]}CYCL DEF 205 UNIVERSAL PECKING ~\n{rows}{text[end:]}"


OLDER, UP = {"Q208": None, "Q395": None}, [(3, 0)]
WAYS = {        # what is said: (parameters, heights of the tip and feeds from the first cut on to the last way up)
    "even strokes": ({}, [(-3, 240), *UP, (-2.5, 0), (-8, 240), *UP, (-7.5, 0), (-10, 240), (20, 0)]),
    "an older control's": (OLDER, [(-3, 240), *UP, (-2.5, 0), (-8, 240), *UP, (-7.5, 0), (-10, 240), (20, 0)]),
    "lessening strokes": ({"Q212": 2, "Q205": 2}, [(-3, 240), *UP, (-2.5, 0), (-6, 240), *UP, (-5.5, 0), (-8, 240), *UP, (-7.5, 0),
                                                   (-10, 240), (20, 0)]),
    "chips broken alone": ({"Q202": 12, "Q257": 5}, [(-3, 240), (-2.8, 0), (-8, 240), (-7.8, 0), (-10, 240), (20, 0)]),
    "chips broken between": ({"Q202": 8, "Q257": 4}, [(-2, 240), (-1.8, 0), (-6, 240), *UP, (-5.5, 0), (-10, 240), (20, 0)]),
    "up at a feed": ({"Q202": 6, "Q208": 900}, [(-4, 240), (3, 900), (-3.5, 0), (-10, 240), (3, 900), (20, 0)])}


@pytest.mark.parametrize("said", WAYS)
def test_cycle_205_goes_as_its_parameters_say(said):
    q, way = WAYS[said]
    moves = read(pecking(**q), "mill_heidenhain")
    first = int(np.flatnonzero(moves.kind == Kind.FEED)[0])
    made = [(round(float(z), 9), float(f)) for z, f in zip(moves.end_mm[first:, 2], moves.feed_mm_per_min[first:])][:len(way)]
    assert made == way and moves.remarks == () and (moves.end_mm[first:first + len(way), :2] == 10).all()


@pytest.mark.parametrize("q, why", [
    ({"Q379": 2}, "begins in a hole"), ({"Q259": 0.2}, "changes, or is none"), ({"Q258": 0, "Q259": 0}, "changes, or is none"),
    ({"Q212": 1}, "to nothing"), ({"Q257": 3}, "no multiple of Q257"), ({"Q257": 5, "Q256": 0}, "breaks of chips are none"),
    ({"Q395": 1}, "counts to the full diameter"), ({"Q212": -1}, "below 0"), ({"Q202": 0}, "with strokes of 0"),
    ({"Q253": None}, "without all of its parameters"), ({"Q208": None}, "without all of its parameters")])
def test_a_cycle_205_that_may_go_in_more_than_one_way_is_refused(q, why):
    with pytest.raises(ReadError, match=why):
        read(pecking(**q), "mill_heidenhain")


@pytest.mark.parametrize("machine, kind, old, new, why", SPOILT)
def test_a_call_that_is_half_said_is_refused(machine, kind, old, new, why):
    text, _ = posted(machine, operation([hole(kind, 10, 10), hole(kind, 30, 10)]))
    assert old in text
    with pytest.raises(ReadError, match=why):
        read(text.replace(old, new, 1), machine)


def test_a_hole_shallower_than_the_set_up_clearance_goes_out_move_by_move():
    planned = operation([hole("drill", 10, 10, bottom=2.3, retract=3.0)])
    for machine in OWN_CYCLES:
        text, moves = posted(machine, planned)
        assert "CYCLE81" not in text and "CYCL CALL" not in text and of_text(moves) == of_plan(planned)


HEAD = "G21 G17 G90 G94 G40 G49 G80 G91.1\nG92.1\nG64 P0.01\nG54\nT3 M6\nG43 H3\nS900 M3\nG0 X0 Y0\nZ20\nF100\n"


@pytest.mark.parametrize("text, why", [
    ("G81 X1 Z-1", "without R"), ("G81 X1 R3", "without Z"), ("G83 X1 Z-1 R3", "without Q"), ("G82 X1 Z-1 R3", "without P"),
    ("G81 X1 Z4 R3", "R is not above its Z"), ("G81 X1 Z-1 R25", "below its R plane"), ("G83 X1 Z-1 R3 Q0", "peck of nothing"),
    ("G91 G81 X1 Z-1 R-3", "G91"), ("G18 G81 X1 Y1 Z-1 R3", "ZX plane"), ("G81 X1 Z-1 R3\nG99 X2", "while a canned cycle"),
    ("G83 X1 Z-1 R3 Q0.0001", "pecks in a hole"), ("G81 X1 Z-1 R3\nG20\nX1", "while a canned cycle"),
    ("G84 X1 Z-1 R3", "unknown word G84")])
def test_a_cycle_that_is_half_said_is_refused(text, why):
    with pytest.raises(ReadError, match=why):
        read(f"{HEAD}G98\n{text}\nM2\n")


def test_a_return_level_that_nobody_has_said_is_remarked():
    remarks = lambda text: [r.advice for r in read(f"{HEAD}{text}\nG80\nM2\n").remarks]
    assert "G98 is missing" in remarks("G81 X1 Z-1 R3")[0] and not remarks("G98 G81 X1 Z-1 R3")


def test_cycles_that_make_no_sense_are_none():
    for wrong in ({"retract": -6.0}, {"peck_mm": 1.0}, {"dwell_s": 1.0}):
        with pytest.raises(ToolpathError):
            hole("drill", 0, 0, **wrong)
    with pytest.raises(ToolpathError, match="1000 pecks"):
        hole("peck", 0, 0, peck_mm=0.001)


def test_the_way_is_as_short_as_the_shortest_of_all():
    from itertools import permutations
    rng = np.random.default_rng(5)
    for _ in range(5):
        xy = rng.uniform(0, 100, (7, 2))
        length = lambda order: np.linalg.norm(np.diff(xy[list(order)], axis=0), axis=1).sum()
        found = shortest_way(xy)
        assert sorted(found.tolist()) == list(range(7))
        best = min(length((found[0], *rest)) for rest in permutations(sorted(set(range(7)) - {int(found[0])})))
        assert length(found) <= 1.1 * best
