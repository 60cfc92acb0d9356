"""Every fault put into a part's posted program, its tools or its clamping turns the verdict as it must.

What is on disk is spoilt, nothing else; the verdict comes from the judge that `cuspline verify` asks.
"""

import json
import re
import shutil
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
import written_parts
from built_parts import copied
from troublesome_parts import two_sided
from written_parts import BALL, BOSS_MM, MILL, STRIP_XS_MM, boss_operations, program_text, tapered, write_tools, written

from cuspline.app import build as recipe
from cuspline.app import catalogue, cli
from cuspline.app import judge as judging
from cuspline.app.judge import judge
from cuspline.design import Finish
from cuspline.design.job import read_job, read_tools
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind
from cuspline.values.checkpoints import kept_beside
from cuspline.values.errors import ReadError
from cuspline.verification.verdict import Options

SURFACE = Options(spacing_mm=3.0, solid_pitch_mm=1.5, replay_pitch_mm=1.0)       # sees every fault below that it is asked for
HISTORY = Options(spacing_mm=12.0, solid_pitch_mm=4.0, replay_pitch_mm=0.5, tessellation_mm=0.02)    # only the replay is asked
HOLDER_WANTED_MM = 1.0
CLOSE_MM = 0.01            # how near to the wanted clearance the holder is brought
GOUGE_MM = 0.003           # of the default part
ROUNDING_MM = 2e-4         # posted decimals, and sample points that lie beside the middle of the groove
REFUSED = "refused"


@dataclass(frozen=True, eq=False, kw_only=True)
class Program:
    """The posted text with the moves read from it."""

    lines: list
    moves: object

    def replaced(self, first, last, new):
        """Text with lines first to last (numbers from 1) replaced."""
        return "\n".join([*self.lines[:first - 1], *new, *self.lines[last:]]) + "\n"

    def index_of(self, start, after=0):
        """Number of the first line that starts so."""
        return next(k for k, line in enumerate(self.lines[after:], after + 1) if line.startswith(start))

    def operation(self, name):
        return self.moves.operations.index(name)


@pytest.fixture(scope="module")
def program(default_part):
    text = (default_part / "setup-1.ngc").read_text()
    moves = read_program(text, work_offsets={"G54": read_job(default_part).machine.wcs_origin_mm},
                         tool_lengths={n: t.length_mm for n, t in read_tools(default_part).items()})
    return Program(lines=text.splitlines(), moves=moves)


def level_finishing_block(program):
    """(row, line) of a block over the level floor, in the middle of the part, far from where two balls cut."""
    m = program.moves
    flat = (m.kind == Kind.FEED) & (m.operation == program.operation("finish"))
    flat &= (np.abs(m.end_mm - m.start_mm)[:, 1:].max(axis=1) == 0) & (np.abs(m.end_mm[:, 2] - m.end_mm[flat, 2].min()) < 1e-9)
    flat &= np.abs(m.end_mm - m.start_mm)[:, 0] > 10
    row = int(np.flatnonzero(flat)[np.argmin(np.abs(m.end_mm[flat, 1] - 8.0))])
    return row, int(m.line[row])


def sunk(program, depth_mm):
    """One finishing block run deeper."""
    row, line = level_finishing_block(program)
    z = program.moves.end_mm[row, 2]
    return program.replaced(line, line, [f"G1 Z{z - depth_mm:.4f}", program.lines[line - 1], f"G1 Z{z:.4f}"])


def without_two_passes(program):
    """There and back left out: the step before each pass is a block with Y alone."""
    _, line = level_finishing_block(program)
    steps = [k for k, text in enumerate(program.lines, 1) if re.fullmatch(r"(G1 )?Y[\d.]+( F[\d.]+)?", text) and k > line]
    return program.replaced(steps[0], steps[2] - 1, [])


def without_operation(program, name):
    begin = program.index_of(f"(OPERATION {program.operation(name) + 1}:")
    end = program.index_of(f"(OPERATION {program.operation(name) + 2}:")
    return program.replaced(begin, end - 1, [])


def without_lines(program, pattern):
    return "\n".join(line for line in program.lines if not re.fullmatch(pattern, line)) + "\n"


def words(program, change):
    """All words outside comments changed: change(letter, number text) -> word."""
    out = []
    for line in program.lines:
        out.append(line if line.startswith("(") or "G53" in line else
                   re.sub(r"([A-Z])(-?[\d.]+)", lambda w: change(w[1], w[2]), line))
    return "\n".join(out) + "\n"


def negated(letters):
    return lambda letter, number: f"{letter}{-float(number):.4f}" if letter in letters else letter + number


def mirrored(letter, number):
    """X the other way round, as a whole: arcs turn the other way too."""
    if letter == "G" and number in ("2", "3"):
        return "G" + {"2": "3", "3": "2"}[number]
    return negated("XI")(letter, number)


def without_retract_across(program):
    """The rapid up is gone before a rapid that crosses the part."""
    m = program.moves
    up = [k for k in range(len(m) - 1) if m.kind[k] == m.kind[k + 1] == Kind.RAPID
          and m.operation[k] == m.operation[k + 1] == program.operation("rough")
          and m.start_mm[k, 2] < 30 and abs(m.end_mm[k + 1, 0] - m.start_mm[k, 0]) > 20
          and abs(m.end_mm[k + 1, 1] - m.start_mm[k, 1]) > 2]
    line = int(m.line[up[0]])
    return program.replaced(line, line + 1, ["G0 " + program.lines[line].removeprefix("G0 ")])


def without_retract_before_tool_change(program):
    """Neither the lift to clearance nor the one to the top of the machine."""
    change = program.index_of("(OPERATION 4")
    top = program.index_of("G53 G0 Z0", change)
    lift = max(k for k in range(1, change) if program.lines[k - 1].startswith("G0 Z"))
    gone = {lift, top}
    lower = program.index_of("G0 Z", top)
    gone |= {lower}
    return "\n".join(line for k, line in enumerate(program.lines, 1) if k not in gone) + "\n"


def cut_off(program):
    return "\n".join(program.lines[:-1]) + "\n"


def cut_off_inside_a_line(program):
    _, line = level_finishing_block(program)
    return "\n".join(program.lines[:line]) + "\nX5"


def wrong_digit(program):
    """The floor's height with one digit wrong, 0.02 mm too low, in one line."""
    row, line = level_finishing_block(program)
    z = program.moves.end_mm[row, 2]
    before = next(k for k in range(line - 1, 0, -1) if f"Z{z:.4f}".rstrip("0") in program.lines[k - 1])
    wrong = program.lines[before - 1].replace(f"Z{z:.4f}".rstrip("0"), f"Z{z - 0.02:.4f}")
    return program.replaced(before, before, [wrong])


def wrong_digit_in_x(program):
    """The foot of the wall one millimetre too far: the arc over its top no longer fits."""
    m = program.moves
    row, line = level_finishing_block(program)
    x = max(m.start_mm[row, 0], m.end_mm[row, 0])
    wall = next(k for k in range(line, len(program.lines)) if f"X{x:.4f}".rstrip("0") in program.lines[k - 1])
    wrong = program.lines[wall - 1].replace(f"X{x:.4f}".rstrip("0"), f"X{x + 1:.4f}")
    return program.replaced(wall, wall, [wrong])


def arcs_turned(program):
    """All arcs of the finishing passes the other way round."""
    first = program.index_of(f"(OPERATION {program.operation('finish') + 1}:")
    turned = [re.sub(r"\bG([23])\b", lambda w: {"2": "G3", "3": "G2"}[w[1]], line) for line in program.lines[first:]]
    return program.replaced(first + 1, len(program.lines), turned)


# name -> (text, what the verdict must say, how finely it is asked)
FAULTS = {
    "two finishing passes missing": (without_two_passes, "excess", SURFACE),
    "finishing operation missing": (lambda p: without_operation(p, "finish"), "missing_area", SURFACE),
    "wrong digit in a height": (wrong_digit, "gouge", SURFACE),
    "wrong digit in X": (wrong_digit_in_x, REFUSED, HISTORY),
    "finishing broken off and ended": (lambda p: cut_off_inside_a_line(p) + "\nM2\n", "missing_area", SURFACE),
    "cut off inside a finishing line": (cut_off_inside_a_line, REFUSED, HISTORY),
    "mirrored in X": (lambda p: words(p, mirrored), "missing_area", SURFACE),
    "inch for mm": (lambda p: without_lines(p, "G21").replace("\nG17 G90", "\nG20\nG17 G90", 1), "travel_exceeded", HISTORY),
    "G17 for G18": (lambda p: "\n".join(re.sub(r"\bG18\b", "G17", line) for line in p.lines) + "\n", REFUSED, HISTORY),
    "sign of X words wrong": (lambda p: words(p, negated("X")), REFUSED, HISTORY),
    "sign of arc centres wrong": (lambda p: words(p, negated("IK")), REFUSED, HISTORY),
    "arcs the other way round": (arcs_turned, "gouge", HISTORY),
    "sign of Y words wrong": (lambda p: words(p, negated("Y")), REFUSED, HISTORY),
    "another work offset": (lambda p: "\n".join("G55" if x == "G54" else x for x in p.lines) + "\n", "unknown_start", HISTORY),
    "retract missing before a rapid across": (without_retract_across, "rapid_through_stock", HISTORY),
    "retract missing before a tool change": (without_retract_before_tool_change, "rapid_through_stock", HISTORY),
    "spindle never started": (lambda p: "\n".join(re.sub(r" M3$", "", x) for x in p.lines) + "\n", "no_spindle", HISTORY),
    "no tool length offset": (lambda p: without_lines(p, r"G43 H\d+"), "no_length_offset", HISTORY),
    "cut off before M2": (cut_off, REFUSED, HISTORY),
    "feed word gone": (lambda p: "\n".join(re.sub(r" F[\d.]+", "", x) for x in p.lines) + "\n", REFUSED, HISTORY),
    "letter O for a nought": (lambda p: "\n".join(p.lines[:-1]).replace(" Y0\n", " YO\n", 1) + "\nM2\n", REFUSED, HISTORY),
}


# asking ------------------------------------------------------------------------------------------


def judged(*arguments, **spoilt):
    """Judged value of a spoilt copy."""
    return looked_at(*arguments, **spoilt).judged()


def looked_at(default_part, tmp_path, options, *, text=None, tools=None, machine=None):
    """judge.Begun of a spoilt copy."""
    folder = copied(default_part, tmp_path / f"spoilt-{len(list(tmp_path.iterdir()))}")
    if text is not None:
        (folder / "setup-1.ngc").write_text(text)
    if tools is not None:
        write_tools(folder, tools)
    job = read_job(folder)
    return judging.begun(folder, job.model_copy(update={"machine": machine}) if machine else job, options=options)


def verdict(*arguments, **spoilt):
    """Kinds of what samples and the replay find, all of it findings of the verdict, which proves much more and takes twice as
    long; {REFUSED} where no controller would take the program."""
    try:
        findings = looked_at(*arguments, **spoilt).drafted().findings
    except ReadError as error:
        print(f"refused: {error}")
        return {REFUSED}
    for f in findings[:12]:
        print(f.kind, f.amount_mm, f.place_mm, f.operation, f.line, f.advice)
    return {f.kind for f in findings}


def tools_of(default_part):
    """tools.json as {number: dict}."""
    return {t["number"]: t for t in json.loads((default_part / "tools.json").read_text())["tools"]}


# the program ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [SURFACE, HISTORY], ids=["surface", "history"])
def test_the_program_as_it_is_has_no_finding(default_part, tmp_path, options):
    assert judged(default_part, tmp_path, options).findings == ()


def test_a_gouge_of_half_the_tolerance_is_seen_and_accepted(default_part, program, tmp_path):
    found = judged(default_part, tmp_path, SURFACE, text=sunk(program, 0.5 * GOUGE_MM))
    assert found.findings == ()
    row, _ = level_finishing_block(program)
    samples, d = found.verdict.setups[0].residuals.samples, found.verdict.setups[0].residuals.deviation_mm
    block = np.sort([program.moves.start_mm[row], program.moves.end_mm[row]], axis=0)
    under = ((samples.points_mm > block[0] - 0.2) & (samples.points_mm < block[1] + 0.2)).all(axis=1)
    assert d[under].min() == pytest.approx(-0.5 * GOUGE_MM, abs=ROUNDING_MM)


def test_a_gouge_of_twice_the_tolerance_names_place_operation_and_line(default_part, program, tmp_path):
    found, = judged(default_part, tmp_path, SURFACE, text=sunk(program, 2 * GOUGE_MM)).findings
    row, line = level_finishing_block(program)
    start, end = program.moves.start_mm[row], program.moves.end_mm[row]
    assert (found.kind, found.operation, found.setup) == ("gouge", "finish", "setup-1")
    assert found.amount_mm == pytest.approx(2 * GOUGE_MM, abs=ROUNDING_MM)
    assert line <= found.line <= line + 2           # sinking, the block itself, rising
    assert min(start[0], end[0]) - 0.2 <= found.place_mm[0] <= max(start[0], end[0]) + 0.2
    assert np.abs(np.array(found.place_mm[1:]) - start[1:]).max() < 0.2


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_the_program_turns_the_verdict(default_part, program, tmp_path, name):
    spoil, wanted, options = FAULTS[name]
    text = spoil(program)
    assert text != "\n".join(program.lines) + "\n"
    assert wanted in verdict(default_part, tmp_path, options, text=text)


# the tools and the machine ---------------------------------------------------------------------------


@pytest.mark.parametrize("diameter_mm, wanted", [(10.2, "gouge"), (9.8, "excess")])
def test_a_tool_table_with_a_wrong_radius_turns_the_verdict(default_part, tmp_path, diameter_mm, wanted):
    tools = tools_of(default_part)
    tools[7]["cutter"] |= {"diameter_mm": diameter_mm, "corner_radius_mm": diameter_mm / 2}
    assert wanted in verdict(default_part, tmp_path, SURFACE, tools=list(tools.values()))


def test_a_work_offset_of_the_wrong_sign_leaves_the_travel(default_part, tmp_path):
    machine = read_job(default_part).machine
    x, y, z = machine.wcs_origin_mm
    wrong = machine.model_copy(update={"wcs_origin_mm": (-x, y, z)})
    assert "travel_exceeded" in verdict(default_part, tmp_path, HISTORY, machine=wrong)


def test_a_holder_one_millimetre_too_long_turns_the_verdict(default_part, tmp_path):
    """The stick-out is shortened until just the clearance wanted is left, and then by 1 mm more."""
    def asked(number, shorter_mm):
        tools = tools_of(default_part)
        tools[number]["stick_out_mm"] -= shorter_mm
        found = judged(default_part, tmp_path, HISTORY, tools=list(tools.values()))
        return found.verdict.setups[0].numbers["holder_clearance_mm"], found.findings

    least, _ = asked(7, 0.0)
    number = next(n for n in tools_of(default_part) if asked(n, 1.0)[0] < least - 0.5)
    shorter, clearance = 0.0, least
    for _ in range(6):                  # secant steps: the least distance may change its place on the way
        shorter += clearance - HOLDER_WANTED_MM - CLOSE_MM / 2
        clearance, findings = asked(number, shorter)
        if abs(clearance - HOLDER_WANTED_MM) <= CLOSE_MM:
            break
    print(f"T{number}: clearance {least} mm, {shorter:.4f} mm shorter {clearance} mm")
    assert HOLDER_WANTED_MM <= clearance <= HOLDER_WANTED_MM + CLOSE_MM and findings == ()
    _, findings = asked(number, shorter + 1.0)
    assert {f.kind for f in findings} == {"holder_contact"}
    assert max(f.amount_mm for f in findings) == pytest.approx(1.0, abs=2 * CLOSE_MM)


# parts with programs written by hand, and clampings -----------------------------------------------------

TURNED = Options(spacing_mm=1.0, solid_pitch_mm=0.5, replay_pitch_mm=1.0)
COARSE = Finish(scallop_mm=0.12, profile_tolerance_mm=0.01, gouge_mm=0.03)      # for the part that is planned here
DIG_MM = 0.05
WRONG_LINE_MM = 0.02
LONG = {"line_mm": 0.68, "repeats": 60}


@dataclass(frozen=True, eq=False, kw_only=True)
class Whole:
    """A part in its folder."""

    design: object
    folder: object
    options: Options

    @property
    def text(self):
        return (self.folder / "setup-1.ngc").read_text()


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Whole values by name; not to be edited."""
    base = tmp_path_factory.mktemp("whole")
    boss, drafted, turned = written_parts.boss(), written_parts.drafted(), replace(two_sided(), finish=COARSE)
    recipe.build(recipe.Order(source=None, design=turned, accepted=(), out=base / "turned", last_stage="gcode",
                              machine=catalogue.find_machine("mill_3axis"), library=catalogue.find_library(None)))
    folders = {"boss": written(base / "boss", boss, program_text(*boss_operations()), (MILL, BALL), 3.0),
               "drafted": written(base / "drafted", drafted, written_parts.drafted_text(), (tapered(5.0),), 2.0),
               "turned": base / "turned"}
    designs, options = {"boss": boss, "drafted": drafted, "turned": turned}, {"turned": TURNED}
    return {name: Whole(design=designs[name], folder=folder, options=options.get(name, SURFACE))
            for name, folder in folders.items()}


def with_radius(number, by_mm):
    """Tools whose one cutter is said to be larger."""
    def change(tools):
        cutter = tools[number]["cutter"]
        cutter["diameter_mm"] += 2 * by_mm
        cutter["corner_radius_mm"] += by_mm if cutter["corner_radius_mm"] else 0.0
    return {"tools": change}


def with_taper(taper_deg):
    return {"tools": lambda tools: tools[3]["cutter"].update(taper_deg=taper_deg)}


def with_stick_out(number, stick_out_mm):
    return {"tools": lambda tools: tools[number].update(stick_out_mm=stick_out_mm)}


def with_setup(**changes):
    """The last clamping is another than the program is for."""
    return {"setup": changes}


def with_text(*operations):
    return {"text": program_text(*operations)}


def y_mirrored(operations):
    """Y the other way round about the middle of the plate."""
    turn = lambda block: re.sub(r"Y(-?[\d.]+)", lambda w: f"Y{24 - float(w[1]):g}", block)
    return [[turn(block) for block in blocks] for blocks in operations]


def swapped(operations):
    return [[re.sub(r"^\(OPERATION .", f"(OPERATION {k}", block) for block in blocks]
            for k, blocks in enumerate(operations[::-1], 1)]


def stopped(operations):
    """The second operation's spindle is not started."""
    return [operations[0], [block for block in operations[1] if not block.endswith("M3")]]


JAW = {"name": "jaw", "min_mm": (-8.0, 0.0, 0.0), "max_mm": (-1.0, 24.0, 9.0)}

# part, what is spoilt, kind that must be found, name of the program that answers for it
WHOLE_FAULTS = {
    "tool table: mill larger": ("boss", with_radius(1, 0.02), "gouge", "setup-1"),
    "tool table: mill smaller": ("boss", with_radius(1, -0.02), "excess", "setup-1"),
    "tool table: taper larger": ("drafted", with_taper(5.2), "gouge", "setup-1"),
    "tool table: taper smaller": ("drafted", with_taper(4.8), "excess", "setup-1"),
    "holder too long": ("boss", with_stick_out(2, 6.5), "holder_contact", "setup-1"),
    "program mirrored in Y": ("boss", with_text(*y_mirrored(boss_operations())), "gouge", "setup-1"),
    "part turned half round in its clamping": (
        "boss", with_setup(wcs_x=(-1.0, 0.0, 0.0), wcs_origin_mm=(60.0, 24.0, 0.0)), "gouge", "setup-1"),
    "zero too low": ("boss", with_setup(wcs_origin_mm=(0.0, 0.0, -DIG_MM)), "gouge", "setup-1"),
    "zero aside in X": ("boss", with_setup(wcs_origin_mm=(DIG_MM, 0.0, 0.0)), "gouge", "setup-1"),
    "operations in the wrong order": ("boss", with_text(*swapped(boss_operations())), "shank_contact", "setup-1"),
    "spindle off in one operation": ("boss", with_text(*stopped(boss_operations())), "no_spindle", "setup-1"),
    "a jaw in the way": ("boss", with_setup(fixtures=(JAW,)), "fixture_contact", "setup-1"),
    "second clamping not turned over": (
        "turned", with_setup(wcs_z=(0.0, 0.0, 1.0), wcs_origin_mm=(0.0, 0.0, 4.0)), "gouge", "setup-2"),
}


def spoilt(whole, folder, text=None, tools=None, setup=None):
    """A copy of a part with other text, tools or last clamping, on disk."""
    copied(whole.folder, folder)
    if text is not None:
        (folder / "setup-1.ngc").write_text(text)
    if tools is not None:
        numbered = tools_of(folder)
        tools(numbered)
        write_tools(folder, list(numbered.values()))
    if setup is not None:
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["job"]["posted"][-1]["setup"] |= setup
        (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def verified(folder, options, monkeypatch):
    """(exit code of `cuspline verify`, Judged) of a folder, looked at as finely as asked."""
    found = []

    def asked(*arguments, **named):
        found.append(judge(*arguments, **{**named, "options": options}))
        return found[-1]

    monkeypatch.setattr(judging, "judge", asked)
    monkeypatch.setattr(sys, "argv", ["cuspline", "verify", str(folder)])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    for f in found[0].findings[:12]:
        print(f.kind, f.amount_mm, f.place_mm, f.operation, f.line, f.advice)
    return ended.value.code, found[0]


def built(whole, folder, found, out, monkeypatch):
    """recipe.Result of a build that comes to just these files and this verdict."""
    def post(order, plans, work, inputs):
        for path in folder.iterdir():
            if path.suffix in (".ngc", ".json", ".tbl") and path.name != "manifest.json":
                shutil.copy(path, work)
        for path in work.glob("*.ngc"):
            path.write_text(re.sub(r"\(VERDICT: [^)]*\)", f"({recipe.UNVERIFIED})", path.read_text()))
        return read_job(folder), {}

    monkeypatch.setattr(recipe, "_planned", lambda order, say: ())
    monkeypatch.setattr(recipe, "plan_document", lambda order, plans, cuts=None, joint_s=None: {})
    monkeypatch.setattr(recipe, "_posted", post)
    monkeypatch.setattr(recipe._Trial, "judged", lambda trial, plans, job, first: (job, found))
    monkeypatch.setattr(recipe, "_coloured_stock", lambda *arguments: "")
    return recipe.build(recipe.Order(
        source=None, design=whole.design, accepted=(), out=out, last_stage="verify",
        machine=catalogue.find_machine("mill_3axis"), library=catalogue.find_library(None)))


@pytest.mark.parametrize("name", ["boss", "drafted"])         # test_troublesome_parts has the other
def test_a_whole_part_as_it_is_is_verified_and_published(parts, tmp_path, monkeypatch, name):
    whole = parts[name]
    code, found = verified(whole.folder, whole.options, monkeypatch)
    assert (code, found.findings) == (0, ())
    result = built(whole, whole.folder, found, tmp_path / "out", monkeypatch)
    assert not kept_beside(tmp_path / "out").folder.exists()
    assert result.is_ok and "(VERDICT: VERIFIED" in (tmp_path / "out" / "setup-1.ngc").read_text()


@pytest.mark.parametrize("name", WHOLE_FAULTS)
def test_a_fault_is_found_ends_with_exit_code_1_and_is_not_published(parts, tmp_path, monkeypatch, name):
    part, change, wanted, setup = WHOLE_FAULTS[name]
    folder = spoilt(parts[part], tmp_path / "spoilt", **change)
    code, found = verified(folder, parts[part].options, monkeypatch)
    assert code == cli.FINDINGS and (wanted, setup) in {(f.kind, f.setup) for f in found.findings}
    result = built(parts[part], folder, found, tmp_path / "out", monkeypatch)
    assert not result.is_ok and not (tmp_path / "out").exists() and kept_beside(tmp_path / "out").folder.exists()
    assert "(VERDICT: REJECTED" in (tmp_path / "out-rejected" / "setup-1.ngc").read_text()


def test_a_holder_that_touches_only_between_the_ends_of_moves_is_found(parts, tmp_path, monkeypatch):
    """The ball's passes begin and end where a holder of radius 20 is clear of the boss, and pass it in between."""
    ends, near = np.array(STRIP_XS_MM), BALL.holder.segments[0].lower_diameter_mm / 2
    assert (np.abs(ends[:, None] - BOSS_MM[:, 0]).min(axis=1) > near + HOLDER_WANTED_MM).all()
    _, found = verified(spoilt(parts["boss"], tmp_path / "s", **with_stick_out(2, 6.5)), SURFACE, monkeypatch)
    assert {(f.kind, f.operation) for f in found.findings} == {("holder_contact", "finish")}
    moves = found.posted[0]
    for f in found.findings:
        x = moves.end_mm[moves.line == f.line, 0]
        assert f.amount_mm == pytest.approx(HOLDER_WANTED_MM - 0.5, abs=1e-3) and np.isin(x, STRIP_XS_MM).all()
        assert STRIP_XS_MM[0] < f.place_mm[0] < STRIP_XS_MM[1]


def test_one_wrong_line_in_a_hundred_thousand_is_found_with_its_line(parts, tmp_path, monkeypatch):
    """One end of one short line among 60 repeated finishings is 0.02 mm too low, between the samples."""
    lines = program_text(*boss_operations(**LONG)).splitlines()
    assert len(lines) > 100_000
    steps = [k for k, line in enumerate(lines) if line.startswith("X")]
    wrong = steps[int(0.62 * len(steps)) + 40]
    while not 5 < float(lines[wrong][1:]) < 20:
        wrong += 1
    lines[wrong] += f" Z{6 - WRONG_LINE_MM:g}"
    lines[wrong + 1] += " Z6"
    folder = spoilt(parts["boss"], tmp_path / "long", text="\n".join(lines) + "\n")
    code, found = verified(folder, SURFACE, monkeypatch)
    (gouge,) = found.findings
    assert code == cli.FINDINGS and (gouge.kind, gouge.operation) == ("gouge", "finish")
    assert gouge.line in (wrong + 1, wrong + 2)               # numbers begin at 1; the tip goes down and up again
    assert gouge.amount_mm == pytest.approx(WRONG_LINE_MM, abs=1e-3)
    assert gouge.place_mm[0] == pytest.approx(float(lines[wrong].split()[0][1:]), abs=0.5)
    # no sample of the surface sees it: what climbs below the ends of moves, or the certificate, must
    own = found.verdict.setups[0].residuals
    assert own.deviation_mm[~own.is_top].min() > -own.spacing_mm * 1e-3
