"""A plate cut by contours alone, from design to verdict; contours on the wrong side; what no contour can do."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest
from built_parts import ran

from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design.job import read_job
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.contour import Contour
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "contoured_plate.py"
COARSE = Options(spacing_mm=1.0, solid_pitch_mm=1.0, replay_pitch_mm=0.5, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    folder = tmp_path_factory.mktemp("contoured") / "out"
    done = ran("build", PART, "--out", folder, "--stage", "gcode")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def judged(folder, tmp_path, change=None):
    """Verdict on a plate with a changed program."""
    folder = shutil.copytree(folder, tmp_path / "changed")
    if change is not None:
        path = folder / "setup-1.ngc"
        before = path.read_text()
        path.write_text(change(before))
        assert path.read_text() != before
    return judge(folder, read_job(folder), options=COARSE)


def test_walls_come_out_within_their_tolerance_and_nothing_stays(plate, tmp_path):
    verdict = judged(plate, tmp_path).verdict
    assert verdict.findings == ()
    plan = json.loads((plate / "plan.json").read_text())
    rough, finish = plan["setups"][0]["operations"]
    assert rough["name"] == "contour rough" and finish["chains"] == 2 and finish["spring_passes"] == 1
    assert re.search(r"^G2 ", (plate / "setup-1.ngc").read_text(), re.M)


LEFT = re.compile(r"(G2 X-5 Y5 [^\n]*\n)G1 Y([\d.]+)[^\n]*\n")          # up along the left wall
RIGHT = re.compile(r"(G2 X49 Y36 [^\n]*\n)G1 Y6\n")                        # down along the right one


def test_a_wall_cut_on_the_wrong_side_and_one_left_too_thick_are_found(plate, tmp_path):
    def spoil(text):
        rough, finish = text.split("(OPERATION 2")
        assert len(LEFT.findall(finish)) == len(RIGHT.findall(finish)) == 2
        finish = LEFT.sub(r"\1G1 X5 F1000\nY\2\nX-5\n", finish)
        return rough + "(OPERATION 2" + RIGHT.sub(r"\1G1 X49.2\nY6\nX49\n", finish)

    found = judged(plate, tmp_path, spoil).findings
    gouge = [f for f in found if f.kind == "gouge" and f.place_mm[0] < 10.5]
    assert max(f.amount_mm for f in gouge) >= 2.99       # through the web, to the window
    left = [f for f in found if f.kind in ("excess", "missing_area") and f.place_mm[0] > 43.5]
    assert max(f.amount_mm for f in left) == pytest.approx(0.2, abs=0.01)


def planned(operation=None, **changes):
    """SetupPlan of the plate."""
    sys.path.insert(0, str(PART.parent))
    import contoured_plate
    sys.path.remove(str(PART.parent))
    design = contoured_plate.design(contoured_plate.Parameters())
    setup = design.setups[0].model_copy(update={"operations": (operation,), **changes} if operation else changes)
    return plan_setup(design, setup, catalogue.find_machine("mill_3axis"), catalogue.find_library(None))


def test_the_cutter_climbs(plate):
    finish = (plate / "setup-1.ngc").read_text().split("(OPERATION 2")[1]
    assert float(LEFT.search(finish)[2]) > 5.0              # up along the left wall: the material is on the right


@pytest.mark.parametrize("operation, changes, why", [
    (Contour(faces=("walls",), tool="flat 16"), {}, "rounded by 6.000 mm"),
    (Contour(faces=("walls",), tool="flat 10"), {"wcs_z": (0.0, -1.0, 0.0), "wcs_x": (1.0, 0.0, 0.0)}, "does not stand along"),
])
def test_what_no_contour_can_do_is_refused(operation, changes, why):
    with pytest.raises(CamError, match=why):
        planned(operation, **changes)
