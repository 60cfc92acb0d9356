"""Indexed positions from the design to the verdict: one program, several faces, one clamping."""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.app.build import Order, build, is_cut_by_others
from cuspline.app.judge import judge, judge_text
from cuspline.app.machine_report import machine_view
from cuspline.app.report_inputs import drawn_setup
from cuspline.design import Marker, Setup
from cuspline.design.job import read_job
from cuspline.kernel import brep
from cuspline.values.errors import DesignError, PlanError, ReadError
from cuspline.verification.verdict import Options, _positions_beside, judged_once

PART = Path(__file__).parents[1] / "parts" / "indexed_block.py"
COARSE = Options(spacing_mm=0.5, solid_pitch_mm=0.5, replay_pitch_mm=0.5, tessellation_mm=0.01)


def order(folder, machine="mill_trunnion_ac"):
    source = catalogue.find_design(str(PART))
    return Order(source=source, design=catalogue.make_design(source, []), accepted=(), out=folder,
                 machine=catalogue.find_machine(machine), library=catalogue.find_library(None), last_stage="gcode")


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Output folder of the part with two positions, posted; not to be edited."""
    return build(order(tmp_path_factory.mktemp("indexed") / "block")).folder


@pytest.fixture(scope="module")
def judged(block):
    """The same, judged coarsely."""
    return judge(block, read_job(block), options=COARSE)


def test_the_machine_that_the_report_shows_moves_the_tip_along_the_path(block, judged):
    """Joints of the program at each point's time, through the machine's kinematics, against the path drawn in the part."""
    job = read_job(block)
    plan = json.loads((block / "plan.json").read_text())
    drawn = [drawn_setup(moves, item.setup, plan, job.machine) for item, moves in zip(job.posted, judged.posted)]
    view = machine_view(job, judged, drawn, plan, None)
    assert [(b.name, b.link) for b in view.bodies] == [("trunnion", "A"), ("table", "C"), ("head", "Z")]
    motion, = view.motions
    assert motion.setups == (0, 1) and (np.diff(motion.time_s) >= 0).all()
    for k, seen in enumerate(drawn):
        mine = np.flatnonzero((motion.setup == k) & (motion.operation >= 0) & (motion.own_s > 0))
        joints = np.hstack([motion.joints[mine, :3], np.radians(motion.joints[mine, 3:])])
        tips = motion.place.into(view.chain.forward(joints, -view.tools[motion.tool[mine[0]]].tip_mm[2])[0])
        path = np.column_stack([np.interp(motion.own_s[mine], seen.path.time_s, seen.path.points_mm[:, a]) for a in range(3)])
        assert len(mine) > 100 and np.abs(tips - path).max() < 2e-4         # rounded words of both
        assert (motion.operation[mine] == 0).all() and set(motion.line[mine]) <= set(seen.path.line)
    swing = motion.joints[(motion.setup == 1) & (motion.operation < 0)]
    assert np.abs(np.diff(swing[:, 4])).max() < 1.0 and swing[-1, 4] == pytest.approx(-90)


def test_one_program_cuts_both_faces(block, judged):
    assert [p.name for p in block.glob("*.ngc")] == ["top.ngc"]
    text = (block / "top.ngc").read_text()
    assert "(POSITION FRONT: TOOL ALONG X0.000 Y-1.000 Z0.000 OF THE WCS)" in text and "G53 G0 A-90\n" in text
    verify = judged.as_dict(())
    assert verify["ok"], verify["findings"]
    assert [s["setup"] for s in verify["setups"]] == ["top", "front"]
    for setup in verify["setups"]:
        assert setup["gouge_max_mm"] <= 0.01 and 0.02 < setup["cusp_max_mm"] <= 0.06
        assert setup["area_reached_mm2"] == pytest.approx(setup["area_required_mm2"], rel=1e-3)
    for setup, region in zip(verify["setups"], verify["regions"], strict=True):     # a face each, by its name
        assert region["name"] == setup["setup"] and bool(region["why"]) == (region["area_unreachable_mm2"] > 0)
        for figure in ("area_required_mm2", "area_reached_mm2", "area_unreachable_mm2", "cusp_max_mm", "cusp_p99_mm"):
            assert region[figure] == pytest.approx(setup[figure], abs=1e-5)


def spoilt(block, folder, change):
    """A copy of the outputs with the program changed, judged."""
    folder.mkdir()
    for path in block.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    text = (block / "top.ngc").read_text()
    assert change(text) != text
    (folder / "top.ngc").write_text(change(text))
    return judge(folder, read_job(folder), options=COARSE)


def test_the_wrong_sign_of_a_is_refused(block, tmp_path):
    with pytest.raises(ReadError, match="top.ngc.*cutting move with its tool axis along"):
        spoilt(block, tmp_path / "out", lambda text: text.replace("A-90", "A90"))


def test_a_cut_too_deep_in_a_turned_position_is_a_gouge_there(block, tmp_path):
    """The last operation a tenth of a millimetre deeper: in a table that turns, Z is along the tool in every position."""
    def deeper(text):
        lines = text.splitlines()
        begin = max(k for k, line in enumerate(lines) if line.startswith("(OPERATION"))
        lower = lambda word: f"Z{float(word[1]) - 0.1:.4f}"
        return "\n".join(line if k < begin or line.startswith(("(", "G53")) else re.sub(r"Z(-?[\d.]+)", lower, line)
                         for k, line in enumerate(lines)) + "\n"
    judged = spoilt(block, tmp_path / "out", deeper)
    gouges = [f for f in judged.findings if f.kind == "gouge"]
    assert {f.setup for f in gouges} == {"front"} and max(f.amount_mm for f in gouges) == pytest.approx(0.1, abs=0.012)
    assert all(f.place_mm[1] < -4 for f in gouges)              # on the front, part coordinates
    machine, tool = read_job(block).machine, next(iter(judged.tools.values()))
    for f in gouges:                        # with the axes as they are told, and A at -90, the tip stands at the place
        tip, _ = machine.kinematics.forward([[*f.machine_mm, 0.0, np.radians(-90)]], tool.length_mm)
        assert np.abs(tip[0] - machine.wcs_origin_mm - f.place_mm).max() < 1e-5


def test_programs_are_judged_on_a_part_that_lies_otherwise_than_they_were_posted_for(block):
    """0.05 mm higher, 0.03 nearer to the front and turned a little, the rotary axes as posted: so deep it is cut there.

    The hollows are caps of a sphere of 16 mm, 1 mm deep: deepest where the rim leans towards the way it is off.
    """
    corners = {f"{x}{y}": (7.0 * x, 7.0 * y, 14.0) for x in (-1, 1) for y in (-1, 1)}
    job, turn = read_job(block), np.radians(0.05)
    markers = tuple(Marker(name=name, at_mm=at) for name, at in corners.items())
    marked = job.model_copy(update={"posted": tuple(
        p.model_copy(update={"setup": p.setup.model_copy(update={"markers": markers})}) for p in job.posted)})
    lies = {name: (x - turn * y, y + turn * x - 0.03, z + 0.05) for name, (x, y, z) in corners.items()}
    placed = marked.placed({"top": lies})
    front = placed.posted[1].setup
    assert np.degrees(np.arccos(-front.wcs_z[1])) == pytest.approx(0.05, abs=1e-6)       # seen from the part
    found = judge(block, placed, options=COARSE)
    rim = np.arccos(15.0 / 16.0)
    for setup, down, aside in (("top", 0.05, 0.03), ("front", 0.03, 0.05)):
        deepest = max(f.amount_mm for f in found.findings if f.kind == "gouge" and f.setup == setup)
        assert deepest == pytest.approx(down * np.cos(rim) + aside * np.sin(rim), abs=0.008)


SWING = "G53 G0 A-90\n"


def text_findings(block, folder, change):
    """What the text alone shows of a copy of the outputs with the program changed."""
    folder.mkdir()
    for name in ("top.ngc", "manifest.json", "tools.json", "tools.tbl", "indexed_block.step"):
        (folder / name).write_bytes((block / name).read_bytes())
    text = (block / "top.ngc").read_text()
    (folder / "top.ngc").write_text(change(text))
    line = text[:text.index(SWING)].count("\n") + 1
    return judge_text(folder, read_job(folder)), line


def test_what_the_text_shows_of_a_later_position_is_told_by_its_line(block, tmp_path):
    """A spindle faster than the machine has, in the last operation: a row that the first position has not."""
    def faster(text):
        at = text.rindex("(OPERATION")
        return text[:at] + re.sub(r"S\d+ M3", "S99999 M3", text[at:], count=1)
    found, _ = text_findings(block, tmp_path / "out", faster)
    assert [(f.kind, f.block) for f in found] == [("spindle_out_of_range", "S99999 M3")]
    assert found[0].machine_mm is not None


def test_the_text_alone_shows_nothing_of_a_good_program(block, tmp_path):
    assert text_findings(block, tmp_path / "out", lambda text: text)[0] == ()


@pytest.mark.parametrize("way, said", [
    ("G53 G0 A30.1\n", "A stands at 30.1000 degrees, its range is -120 .. 30 degrees"),
    ("G53 G0 A-120.1\n", "A stands at -120.1000 degrees, its range is -120 .. 30 degrees"),
    ("G53 G0 X310 A-45\n", "X leaves its travel -300 .. 300 mm")])
def test_between_two_positions_an_axis_beyond_its_range_is_found_by_its_line(block, tmp_path, way, said):
    found, line = text_findings(block, tmp_path / "out", lambda text: text.replace(SWING, way + SWING))
    assert [(f.kind, f.line, f.setup, f.block) for f in found] == [("travel_exceeded", line, "top", way.strip())]
    assert said in found[0].advice


@pytest.mark.parametrize("change", [
    pytest.param(lambda text: text.replace("A-90", f"A{-90 / 25.4:.5f}"), id="rotary words divided as inches are"),
    pytest.param(lambda text: text.replace("A-90", f"A{-90 * 25.4:.5f}"), id="rotary words multiplied as inches are"),
    pytest.param(lambda text: text.replace("A-90", "A-90.1"), id="a tenth of a degree too far"),
    pytest.param(lambda text: re.sub(r"^(X\S+ Z\S+)( F\S+)?$", r"\1 C5\2", text, count=1, flags=re.MULTILINE),
                 id="the table turned on its pole in the cut"),
    pytest.param(lambda text: text.replace(SWING, ""), id="not turned at all")])
def test_a_position_that_is_not_the_one_planned_is_refused_by_its_line(block, tmp_path, change):
    with pytest.raises(ReadError, match=r"top.ngc: .*(none of the positions that follow|never points the tool along"
                                        "|a cutting move that turns rotary axes under G94)"):
        text_findings(block, tmp_path / "out", change)


def test_a_pivot_off_by_a_tenth_of_a_millimetre_is_a_gouge_of_as_much(block):
    """The machine's table turns about an axis 0.1 mm beside the one that the program was solved for.

    Turned by 90 degrees the part lies 0.1 mm too high and as much aside: along the normal of the hollow, 20 degrees steep at its
    border, 0.1 (cos + sin).
    """
    job = read_job(block)
    a = job.machine.a.model_copy(update={"offset_mm": (0.0, 0.1, 0.0)})
    off = job.model_copy(update={"machine": job.machine.model_copy(update={"a": a})})
    judged = judge(block, off, options=COARSE)
    gouges = [f for f in judged.findings if f.kind == "gouge"]
    steep = np.arcsin(np.sqrt(2 * 16 - 1) / 16)
    assert {f.setup for f in gouges} == {"front"}
    assert max(f.amount_mm for f in gouges) == pytest.approx(0.1 * (np.cos(steep) + np.sin(steep)), abs=0.01)   # its own gouge_mm


def test_a_centre_of_b_off_by_0_05_mm_that_nobody_has_told_is_a_gouge_of_as_much(tmp_path):
    """On the machine that propellers are cut on: B turned by 90 degrees shifts the part by what its axis is off, along the tool.

    The wall of the hollow is 20 degrees steep at its border: 0.05 (cos + sin) along its normal.
    """
    first = order(tmp_path / "out", "mill_a_on_b")
    folder = build(replace(first, design=right_alone(catalogue.make_design(first.source, ["sides=3"])))).folder
    job = read_job(folder)
    assert judge(folder, job, options=COARSE).as_dict(())["ok"]
    b = job.machine.b.model_copy(update={"offset_mm": (-0.05, 0.0, 0.0)})
    off = job.model_copy(update={"machine": job.machine.model_copy(update={"b": b})})
    gouge = max(f.amount_mm for f in judge(folder, off, options=COARSE).findings if f.kind == "gouge")
    steep = np.arcsin(np.sqrt(2 * 16 - 1) / 16)
    assert gouge == pytest.approx(0.05 * (np.cos(steep) + np.sin(steep)), abs=0.01)


def right_alone(design):
    """The block, the hollow in its right side alone cut: the one position of a clamping that holds it upright."""
    own = {"clamped_x": (1.0, 0.0, 0.0), "clamped_z": (0.0, 0.0, 1.0)}
    return replace(design, setups=(design.setups[2].model_copy(update=own),))


def test_the_machine_of_the_part_must_turn_it(tmp_path):
    with pytest.raises(PlanError, match="front is an indexed position, and mill_3axis has no rotary axes: take a machine that has"):
        build(order(tmp_path / "out", "mill_3axis"))


def test_a_clamping_may_begin_with_a_position_that_says_how_the_part_is_held(tmp_path):
    """The front alone, held as for the top: the same cuts on the same machine axes, judged in its own frame."""
    both = order(tmp_path / "out")
    folder = build(replace(both, design=replace(both.design, setups=both.design.setups[1:]))).folder
    text = (folder / "front.ngc").read_text()
    assert "G53 G0 C0 A-90\n" in text and "(POSITION FRONT: TOOL ALONG X0.000 Y-1.000 Z0.000 OF THE WCS)" in text
    assert "(STOCK aluminium_6061: X-7.000 Y-7.000 Z0.000 TO X7.000 Y7.000 Z14.000)" in text
    verify = judge(folder, read_job(folder), options=COARSE).as_dict(())
    assert verify["ok"] and [s["setup"] for s in verify["setups"]] == ["front"] and verify["gouge_max_mm"] <= 0.01
    with pytest.raises(ValueError, match="state clamped_x and clamped_z, or neither"):
        Setup(name="half", faces=("a",), wcs_in_words="", indexed=True, clamped_x=(1, 0, 0))
    with pytest.raises(ValueError, match="clamped_x .* and clamped_z .* must be unit vectors square to each other"):
        Setup(name="askew", faces=("a",), wcs_in_words="", indexed=True, clamped_x=(1, 0, 0), clamped_z=(1, 0, 0))


@pytest.mark.parametrize("machine, word", [
    ("mill_haas_5axis", "G254"), ("mill_heidenhain_5axis", "PLANE SPATIAL SPA+90 SPB+0 SPC+0"),
    ("mill_siemens_5axis", 'CYCLE800(0,"TC1",0,39,0,0,0,0,90,0,0,0,0,-1,0)')])
def test_a_position_is_verified_on_other_controls(machine, word, tmp_path):
    """The front alone, from the design to the verdict on the posted text."""
    first = order(tmp_path / "out", machine)
    folder = build(replace(first, design=replace(first.design, setups=first.design.setups[1:]))).folder
    program, = (p for p in folder.glob("front.*") if p.suffix in (".nc", ".h", ".mpf"))
    assert word in program.read_text()
    verify = judge(folder, read_job(folder), options=COARSE).as_dict(())
    assert verify["ok"] and verify["findings"] == [] and 0.02 < verify["cusp_max_mm"] <= 0.06


def test_a_face_that_several_positions_cut_is_judged_by_the_one_that_looks_at_it_most_squarely():
    faces = brep.faces_of(brep.the_solid(cq.Workplane().box(4, 4, 4)))
    all_six = list(range(6))
    held = Setup(name="top", faces=("a",), wcs_in_words="")
    as_held = {"indexed": True, "clamped_x": (1, 0, 0), "clamped_z": (0, 0, 1)}
    turned = [held.model_copy(update={**as_held, "name": name, "wcs_z": z, "wcs_x": x}) for name, z, x in (
        ("front", (0, -1, 0), (1, 0, 0)), ("right", (1, 0, 0), (0, 1, 0)), ("under", (0, 0, -1), (1, 0, 0)))]
    over = held.model_copy(update={"name": "over", "wcs_z": (0, 0, -1)})            # another clamping
    setups = (held, *turned, over)
    beside = _positions_beside([SimpleNamespace(setup=s) for s in setups])
    assert beside == [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2], []]
    kept = judged_once([all_six, all_six, all_six, [4], all_six], [s.frame.rotation[:, 2] for s in setups], beside, faces)
    looks = lambda i: tuple(np.round(faces[i].middle.normal[0]).astype(int).tolist())
    assert {looks(i) for i in kept[1]} == {(0, -1, 0)} and {looks(i) for i in kept[2]} == {(1, 0, 0)}
    assert {looks(i) for i in kept[0]} == {(0, 0, 1), (0, 1, 0), (-1, 0, 0)} | ({(0, 0, -1)} if looks(4) != (0, 0, -1) else set())
    assert kept[3] == [4] and kept[4] == all_six            # each has something to answer for; clampings do not share
    leaning = [held, turned[1], held.model_copy(update={**as_held, "name": "leans", "wcs_z": (0.6, 0, 0.8), "wcs_x": (0, 1, 0)})]
    kept = judged_once(3 * [all_six], [s.frame.rotation[:, 2] for s in leaning], [[1, 2], [0, 2], [0, 1]], faces)
    assert [looks(i) for i in kept[2]] == [(0, 0, 1)] and sorted(kept[0] + kept[1]) == all_six      # best for none: one is enough


def test_a_design_whose_first_setup_is_a_position_is_refused():
    design = order(Path("out")).design
    with pytest.raises(DesignError, match="front is an indexed position, and no setup before it holds the part"):
        replace(design, setups=(design.setups[1].model_copy(update={"clamped_x": None, "clamped_z": None}),))
    top = design.setups[0]
    again = top.model_copy(update={"name": "again", "indexed": True})
    with pytest.raises(DesignError, match="again points the tool as top does"):
        replace(design, setups=(top, again))
    assert json.loads(top.model_dump_json()).get("indexed") is None


def test_a_position_that_finds_nothing_left_is_left_out_where_others_cut_its_faces_and_only_there():
    front = catalogue.make_design(catalogue.find_design(str(PART)), []).setups[-1]
    planned = lambda faces, *operations: SimpleNamespace(operations=operations, setup=front.model_copy(update={"faces": faces}))
    first, idle, other = planned(("blade", "edge"), "rough"), planned(("blade",)), planned(("tip",))
    assert is_cut_by_others(idle, [first, idle, other])
    assert not is_cut_by_others(other, [first, idle, other])
    assert not is_cut_by_others(idle, [idle, planned(("blade",), "rest")])
