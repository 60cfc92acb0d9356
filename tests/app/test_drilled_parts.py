"""A plate with drilled holes from file to verdict, and what happens when its program drills something else."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from built_parts import ran

from cuspline.app.judge import judge, judge_text
from cuspline.design.job import read_job
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PARTS = Path(__file__).parent.parent / "parts"
COARSE = Options(spacing_mm=1.5, solid_pitch_mm=2.0, replay_pitch_mm=0.5, tessellation_mm=0.01)
JOB = """step = "plate.step"
material = "aluminium_6061"
stock = { min_mm = [0, 0, 0], max_mm = [60, 40, 12] }
finish = { scallop_mm = 0.03, profile_tolerance_mm = 0.005, gouge_mm = 0.006 }

[[faces]]
name = "holes"
count = 4
kinds = ["cylinder"]

[[setups]]
name = "setup-1"
faces = ["holes"]
wcs_in_words = "X0 Y0 lower left corner, Z0 on the base"

[[setups.operations]]
kind = "drill"
cycle = "peck"
peck_mm = 4
stays_low = true
"""


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """The plate as CadQuery gives it, built and verified."""
    folder = tmp_path_factory.mktemp("plate") / "out"
    done = ran("build", PARTS / "drilled_plate.py", "--out", folder, "--stage", "verify")
    assert done.returncode == 0 and "VERIFIED" in done.stdout, done.stdout + done.stderr
    return folder


def test_the_holes_are_made_as_they_are_drawn(plate):
    import json
    verdict = json.loads((plate / "verify.json").read_text())
    assert verdict["gouge_max_mm"] < 1e-6 and verdict["excess_max_mm"] < 1e-6
    assert verdict["gouge_proven_mm"] < 0.003 and verdict["area_unreachable_mm2"] < 0.01 * verdict["area_required_mm2"]
    text = (plate / "setup-1.ngc").read_text()
    assert text.count("G98 G81") == 3 and "Z5 R13" in text        # the point of the blind hole: 12 - 7


def test_a_step_file_with_a_job_is_drilled_on_a_fanuc_control(plate, tmp_path):
    shutil.copy(plate / "drilled_plate.step", tmp_path / "plate.step")
    (tmp_path / "plate.toml").write_text(JOB)
    done = ran("build", tmp_path / "plate.toml", "--machine", "mill_fanuc", "--out", tmp_path / "out", "--stage", "verify")
    assert done.returncode == 0 and "VERIFIED" in done.stdout, done.stdout + done.stderr
    assert re.search(r"G99 G83 X[\d.]+ Y[\d.]+ Z-\d.* Q4\. F", (tmp_path / "out" / "setup-1.nc").read_text())


def judged(plate, tmp_path, change=None, job=None):
    """Findings of a plate with a changed program."""
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    if change is not None:
        path = folder / "setup-1.ngc"
        before = path.read_text()
        path.write_text(change(before))
        assert path.read_text() != before
    return judge(folder, job or read_job(folder), options=COARSE).findings


def test_as_posted_there_is_nothing_to_be_said(plate, tmp_path):
    assert judged(plate, tmp_path) == ()


BLIND = "G98 G81 X50 Y30 Z5 R13"
SPOILT = {
    "deeper, beside and left out": (
        (BLIND, BLIND.replace("Z5", "Z4.95")), ("G98 G81 X10 Y30", "G98 G81 X10.1 Y30"), ("X50 Y10\n", "")),
    "too shallow, and from below the stock's top": ((BLIND, BLIND.replace("Z5", "Z5.2")), ("Z-1.4099 R13", "Z-1.4099 R11")),
    "no peck, but a rapid to the bottom": (
        (BLIND, "G0 Z13\nG1 Z10\nG0 Z8\nG1 Z5\nG0 Z17\n" + BLIND), ("R13 F525.0", "R13 F2200.0")),
    "sideways": ((BLIND, "G1 Z9\nX49.9\nX50\nG0 Z17\n" + BLIND),),
}
STEEP = np.sin(np.radians(70))          # of the point's side
FOUND = {"deeper, beside and left out": {("gouge", 50): 0.05 * STEEP, ("gouge", 10): 0.1, ("missing_area", 50): 3.0},
         "too shallow, and from below the stock's top": {("missing_area", 50): 0.2 * STEEP, ("rapid_through_stock", 10): 1.0},
         "no peck, but a rapid to the bottom": {("rapid_through_stock", 50): 2.0, ("chip_load", 10): 2200 / 5836 / 2},
         "sideways": {("overload", 50): None, ("gouge", 50): 0.1}}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_program_is_found_with_its_place_and_amount(plate, tmp_path, name):
    def spoil(text):
        for old, new in SPOILT[name]:
            assert old in text
            text = text.replace(old, new)
        return text

    found = judged(plate, tmp_path, spoil)
    for (kind, near), amount in FOUND[name].items():
        here = [f.amount_mm for f in found if f.kind == kind and abs(f.place_mm[0] - near) < 6]
        assert here and (amount is None or max(here) == pytest.approx(amount, rel=0.07, abs=0.003)), (kind, near, found)


def test_a_hole_drilled_deeper_than_four_diameters_without_a_peck_is_found(plate, tmp_path):
    folder = shutil.copytree(plate, tmp_path / "deep")
    text = (folder / "setup-1.ngc").read_text()
    assert "G98 G81 X10 Y30 Z-1.4099 R13" in text
    (folder / "setup-1.ngc").write_text(text.replace("G98 G81 X10 Y30 Z-1.4099 R13", "G0 Z30\nG98 G81 X10 Y30 Z-1.4099 R19"))
    found = [f for f in judge_text(folder, read_job(folder)) if f.kind == "deep_hole"]
    assert [f.amount_mm for f in found] == [pytest.approx(19 + 1.4099)] and found[0].place_mm[:2] == (10, 30)


def test_a_hole_drilled_from_the_wrong_side_is_found(plate, tmp_path):
    job = read_job(plate)
    over = job.posted[0].setup.model_copy(update={"wcs_z": (0.0, 0.0, -1.0), "wcs_origin_mm": (0.0, 40.0, 12.0)})
    job = job.model_copy(update={"posted": (job.posted[0].model_copy(update={"setup": over}),)})
    assert max(f.amount_mm for f in judged(plate, tmp_path, job=job) if f.kind == "gouge") > 0.5


# what the planner refuses --------------------------------------------------------------------------------


def planned(**changes):
    """The plate planned with another operation, setup or part."""
    import drilled_plate

    from cuspline.app import catalogue
    from cuspline.planning.plan import plan_setup
    design = drilled_plate.design(drilled_plate.Plate())
    operation = changes.pop("operation", design.setups[0].operations[0])
    setup = design.setups[0].model_copy(update={"operations": (operation,), **changes})
    return plan_setup(design, setup, catalogue.find_machine("mill_3axis"), changes.get("library", catalogue.find_library(None)))


@pytest.fixture
def drill():
    sys.path.insert(0, str(PARTS))
    from cuspline.planning.strategies.drill import Drill
    yield Drill
    sys.path.remove(str(PARTS))


@pytest.mark.parametrize("fields, changes, why", [
    ({"faces": ("holes",), "tool": "drill 4.2"}, {}, r"no drill makes the hole of diameter 6 mm at \(10.000, 10.000, 12"),
    ({"faces": ("point",)}, {}, "no wall of a hole"),
    ({"faces": ("holes",)}, {"wcs_z": (0.0, 0.0, -1.0)}, "opens downward"),
    ({"faces": ("holes",)}, {"wcs_z": (0.0, -0.6, 0.8)}, "leans 36.870 degrees"),
    ({"faces": ("holes",), "break_through_mm": 40.0}, {}, "too short for the hole"),
])
def test_what_no_drill_can_do_is_refused(drill, fields, changes, why):
    with pytest.raises(CamError, match=why):
        planned(operation=drill(**fields), **changes)


def test_pecks_and_dwells_belong_to_their_cycles(drill):
    for fields in ({"cycle": "drill", "peck_mm": 1}, {"dwell_s": 1}, {"cycle": "tap"}):
        with pytest.raises(ValueError):
            drill(**fields)
