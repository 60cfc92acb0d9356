"""A plate with drilled holes from file to verdict, and what happens when its program drills something else."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from built_parts import ran

from cuspline.app.judge import judge
from cuspline.design.job import read_job
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PARTS = Path(__file__).parent.parent / "parts"
COARSE = Options(spacing_mm=1.0, solid_pitch_mm=2.0, replay_pitch_mm=0.5, tessellation_mm=0.01)
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
    """Findings of a plate with a changed program, as (kind, amount)."""
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    if change is not None:
        path = folder / "setup-1.ngc"
        before = path.read_text()
        path.write_text(change(before))
        assert path.read_text() != before
    found = judge(folder, job or read_job(folder), options=COARSE).findings
    return {kind: max(f.amount_mm for f in found if f.kind == kind) for kind in {f.kind for f in found}}


def put(old, new):
    return lambda text: text.replace(old, new)


def test_as_posted_there_is_nothing_to_be_said(plate, tmp_path):
    assert judged(plate, tmp_path) == {}


BLIND = "G98 G81 X50 Y30 Z5 R13"
SPOILT = {
    "a hole 0.05 mm too deep": (put(BLIND, BLIND.replace("Z5", "Z4.95")), "gouge", 0.05 * np.sin(np.radians(70))),
    "a hole 0.2 mm too shallow": (put(BLIND, BLIND.replace("Z5", "Z5.2")), "missing_area", 0.2 * np.sin(np.radians(70))),
    "a hole 0.1 mm beside its place": (put("G98 G81 X10 Y30", "G98 G81 X10.1 Y30"), "gouge", 0.1),
    "a hole that is left out": (put("X50 Y10\n", ""), "missing_area", None),
    "an R plane within the stock": (put("Z5 R13", "Z5 R11"), "rapid_through_stock", 1.0),
    "a rapid to the bottom in place of a peck": (put(BLIND, "G0 Z13\nG1 Z10\nG0 Z8\nG1 Z5\nG0 Z17\nG98 G81 X50 Y30 Z5 R13"),
                                                 "rapid_through_stock", 2.0),
    "a drill fed sideways": (put(BLIND, "G1 Z9\nX49.9\nX50\nG0 Z17\n" + BLIND), "overload", None),
    "a drill fed four times too fast": (put("R13 F525.0", "R13 F2200.0"), "chip_load", None),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_program_is_found(plate, tmp_path, name):
    change, kind, amount = SPOILT[name]
    found = judged(plate, tmp_path, change)
    assert kind in found, found
    assert amount is None or found[kind] == pytest.approx(amount, rel=0.05, abs=0.003)


def test_a_hole_drilled_from_the_wrong_side_is_found(plate, tmp_path):
    job = read_job(plate)
    over = job.posted[0].setup.model_copy(update={"wcs_z": (0.0, 0.0, -1.0), "wcs_origin_mm": (0.0, 40.0, 12.0)})
    job = job.model_copy(update={"posted": (job.posted[0].model_copy(update={"setup": over}),)})
    assert judged(plate, tmp_path, job=job)["gouge"] > 0.5


def test_a_thicker_drill_than_the_holes_is_found(plate, tmp_path):
    import json
    folder = shutil.copytree(plate, tmp_path / "thick")
    document = json.loads((folder / "tools.json").read_text())
    for tool in document["tools"]:
        tool["cutter"]["diameter_mm"] += 0.1
    (folder / "tools.json").write_text(json.dumps(document))
    assert max(f.amount_mm for f in judge(folder, read_job(folder), options=COARSE).findings if f.kind == "gouge") == pytest.approx(
        0.05, rel=0.05)


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
