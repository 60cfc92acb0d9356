"""T-slots and dovetail slots: made by cutters of their form, and what their programs must not do."""

import re
import shutil
from pathlib import Path

import pytest
import undercut_block
from built_parts import built_once

from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Parameters
from cuspline.design.job import read_job
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.slot import Slot
from cuspline.planning.strategies.t_slot import TSlot
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "undercut_block.py"
COARSE = Options(spacing_mm=2.0, solid_pitch_mm=1.0, replay_pitch_mm=0.7, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    """Output folder of the block, posted; not to be edited."""
    return built_once(tmp_path_factory, "undercut_block", PART, "--stage", "gcode")


def test_both_slots_are_made_and_verified(block):
    judged = judge(block, read_job(block), options=COARSE)
    assert judged.findings == ()
    numbers = judged.as_dict(())
    # all but the cutters' corners of 0.1 and 0.2 mm
    assert numbers["area_unreachable_mm2"] < 0.08 * numbers["area_required_mm2"]
    assert numbers["area_reached_mm2"] == pytest.approx(numbers["area_required_mm2"] - numbers["area_unreachable_mm2"])
    text = (block / "setup-1.ngc").read_text()
    assert "T92 T-SLOT CUTTER" in text and "T93 DOVETAIL CUTTER" in text


def spoilt(block, tmp_path, changes, name="setup-1.ngc"):
    """Kinds of findings, with their largest amounts, of the block with words of one operation changed."""
    folder = shutil.copytree(block, tmp_path / "spoilt")
    text = (folder / name).read_text()
    for number, old, new in changes:
        parts = re.split(r"(?=\(OPERATION )", text)
        assert old in parts[number], parts[number]
        parts[number] = parts[number].replace(old, new)
        text = "".join(parts)
    (folder / name).write_text(text)
    amounts = {}
    for f in judge(folder, read_job(folder), options=COARSE).findings:
        amounts[f.kind] = max(amounts.get(f.kind, 0.0), f.amount_mm)
    return amounts


def test_a_t_slot_run_too_high_and_a_dovetail_too_far_aside_are_found(block, tmp_path):
    found = spoilt(block, tmp_path, [(2, "G1 Z6 ", "G1 Z6.15 "), (5, "X55.5", "X55.6")])
    assert found["gouge"] == pytest.approx(0.15, abs=0.01) and found["excess"] == pytest.approx(0.15, abs=0.005)


def test_a_t_slot_that_is_left_out_is_missing_area(block, tmp_path):
    found = spoilt(block, tmp_path, [(2, "G1 Z6 ", "G1 Z30 ")])
    assert "missing_area" in found


def test_a_neck_too_thick_for_the_slot_s_meets_the_part(block, tmp_path):
    folder = shutil.copytree(block, tmp_path / "thick")
    tools = folder / "tools.json"
    before = tools.read_text()
    after = re.sub(r'("name": "T-slot cutter.*?"neck_diameter_mm": )7(\.0)?', r"\g<1>11", before, flags=re.S)
    assert after != before
    tools.write_text(after)
    assert "shank_contact" in {f.kind for f in judge(folder, read_job(folder), options=COARSE).findings}


@pytest.mark.parametrize("operations, why", [
    ((TSlot(faces=("t",)),), "stock stands in the neck"),
    ((Slot(faces=("t neck",)), TSlot(faces=("t",), tool="dovetail 16")), "no side that this operation can use|dovetail"),
    ((TSlot(faces=("t neck",)),), "it has no floor"),
])
def test_what_cannot_be_cut_is_refused(operations, why):
    design = undercut_block.design(Parameters())
    with pytest.raises(CamError, match=why):
        plan_setup(design, design.setups[0].model_copy(update={"operations": operations}), catalogue.find_machine("mill_3axis"),
                   catalogue.find_library(None))
