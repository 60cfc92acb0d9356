"""Engravings: the faces are judged as if there were none, the grooves by place, depth and width."""

import re
import shutil
from pathlib import Path

import engraved_plate
import numpy as np
import pytest
from built_parts import built_once
from pydantic import ValidationError

from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Parameters
from cuspline.design.job import read_job, read_tools
from cuspline.kernel.lettering import text_outlines, usual_font
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.engrave import Engrave
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "engraved_plate.py"
COARSE = Options(spacing_mm=2.0, solid_pitch_mm=1.0, replay_pitch_mm=0.5, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "engraved_plate", PART, "--stage", "gcode")


def test_an_engraved_part_is_verified_though_its_solid_has_no_groove(plate):
    job = read_job(plate)
    assert judge(plate, job, options=COARSE).findings == ()
    back, mark = job.engravings
    assert (back.depth_mm, mark.depth_mm) == (0.15, 0.2) and len(mark.lines) == 3          # A has two outlines, 7 one
    assert back.width_mm == pytest.approx(2 * (2.0 ** 2 - 1.85 ** 2) ** 0.5) and mark.width_mm == pytest.approx(
        0.2 + 0.4 * 3 ** -0.5)
    assert {z for line in mark.lines for _, _, z in line} == {engraved_plate.Z - 0.2}


def shifted(text, number, change):
    """A program with the words of one operation's feeds changed by a function of (letter, number)."""
    parts = re.split(r"(?=\(OPERATION )", text)
    lines = parts[number].split("\n")
    for k, line in enumerate(lines):
        if line.startswith(("G1", "X", "Y", "Z")) and k > 8:
            lines[k] = re.sub(r"([XYZ])(-?[\d.]+)", lambda m: f"{m[1]}{change(m[1], float(m[2])):.4f}", line)
    parts[number] = "\n".join(lines)
    return "".join(parts)


MARK = 3
SPOILT = {
    "too deep": (lambda letter, v: v - 0.05 if letter == "Z" and v < 6 else v, {"engraving_depth": 0.05, "gouge": 0.05}),
    "too shallow": (lambda letter, v: v + 0.05 if letter == "Z" and v < 6 else v, {"engraving_depth": 0.05}),
    "beside its line": (lambda letter, v: v + 0.1 if letter == "X" else v, {"engraving_beside": 0.1}),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_groove_that_is_not_what_is_stated_is_found(plate, tmp_path, name):
    change, wanted = SPOILT[name]
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    program = folder / "setup-1.ngc"
    program.write_text(shifted(program.read_text(), MARK, change))
    found = judge(folder, read_job(folder), options=COARSE).findings
    amounts = {}
    for f in found:
        amounts[f.kind] = max(f.amount_mm, amounts.get(f.kind, 0.0))
    assert wanted.keys() <= amounts.keys(), amounts
    kind = "engraving_depth" if "too" in name else "engraving_beside"
    assert amounts[kind] == pytest.approx(wanted[kind], abs=0.005)


def test_letters_that_are_left_out_and_a_cutter_of_another_angle_are_found(plate, tmp_path):
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    program, tools = folder / "setup-1.ngc", folder / "tools.json"
    text = program.read_text()
    head, mark = text.split("(OPERATION 3")
    lines = mark.split("\n")
    ups = [k for k, line in enumerate(lines) if line == "G0 Z11"]           # down for the first line, and behind each of the three
    assert len(ups) == 4
    program.write_text(head + "(OPERATION 3" + "\n".join(lines[:ups[2]] + lines[ups[3]:]))
    number = next(n for n, t in read_tools(folder).items() if t.cutter.type == "chamfer_mill")
    assert number == 91
    tools.write_text(re.sub(r'"point_angle_deg": 60(\.0)?', '"point_angle_deg": 90', tools.read_text(), count=1))
    kinds = {f.kind for f in judge(folder, read_job(folder), options=COARSE).findings}
    assert {"engraving_missing", "engraving_width"} <= kinds


@pytest.mark.parametrize("fields, why", [
    ({"lines": (((30.0, 3.0), (33.0, 3.0)),)}, "beside its faces"), ({"text": "A", "at": (0.0, 0.0)}, "beside its faces"),
    ({"text": "A", "at": (14.0, 5.0), "tool": "ball 4", "depth_mm": 3.0}, "no cutter engraves 3 mm deep"),
    ({"text": "A漢", "at": (14.0, 5.0)}, "letters that DejaVu Sans has not: '漢'"),
    ({"text": "A", "at": (14.0, 5.0), "font_path": "none.ttf"}, "none.ttf is no font that can be read")])
def test_what_cannot_be_engraved_is_refused(fields, why):
    design = engraved_plate.design(Parameters())
    operation = Engrave(**{"faces": ("level",), "depth_mm": 0.2, **fields})
    with pytest.raises(CamError, match=why):
        plan_setup(design, design.setups[0].model_copy(update={"operations": (operation,)}), catalogue.find_machine("mill_3axis"),
                   catalogue.find_library(None))


@pytest.mark.parametrize("fields, why", [
    ({}, "state one of"), ({"text": "A", "borders_of": "level"}, "state one of"),
    ({"borders_of": "level", "at": (0.0, 0.0)}, "go with text"), ({"lines": (((0.0, 0.0),),)}, "two places")])
def test_fields_that_do_not_go_together_are_refused(fields, why):
    with pytest.raises(ValidationError, match=why):
        Engrave(depth_mm=0.2, **fields)


def test_two_engravings_of_one_name_are_refused():
    design = engraved_plate.design(Parameters())
    both = tuple(Engrave(faces=("level",), depth_mm=0.2, lines=(((x, 3.0), (x, 6.0)),)) for x in (14.0, 18.0))
    with pytest.raises(CamError, match="give both a name of their own"):
        plan_setup(design, design.setups[0].model_copy(update={"operations": both}), catalogue.find_machine("mill_3axis"),
                   catalogue.find_library(None))


def test_letters_are_the_same_wherever_no_font_is_given():
    """By the font that comes with a dependency, whatever the system has: the A of DejaVu Sans, in units of its file."""
    assert usual_font().is_file() and usual_font().name == "DejaVuSans.ttf"
    lines, name = text_outlines("A7", 5.0, 0.01)
    assert name == "DejaVu Sans" and [len(line) for line in lines] == [9, 4, 8]
    units = lines[0] / (5.0 / 2048)
    assert np.abs(units - units.round()).max() < 0.01 and lines[0][0] == pytest.approx((1.43066406, 3.64501953))
