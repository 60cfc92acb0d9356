"""Whole programs of a plate of holes, a thread, a ledge and a chamfer from two sides, spoilt: told by name, place and amount."""

import json
import re
import shutil
from pathlib import Path

import pytest
from built_parts import built_once

from cuspline.app.judge import judge
from cuspline.design.job import read_job
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "two_sided_plate.py"
COARSE = Options(spacing_mm=3.0, solid_pitch_mm=4.0, replay_pitch_mm=0.8, tessellation_mm=0.02)
FIRST, SECOND = "setup-1.ngc", "setup-2.ngc"
BLIND = "G0 X7 Y9\nG0 Z17\nG17\nG98 G81 X7 Y9 Z3.9081 R13 F525.0\nG80\n"
BELOW = "G98 G81 X42 Y19 Z4.9081 R13 F525.0\nG80\n"
DRILL = '"name": "drill 5 mm",\n    "type": "drill",\n    "diameter_mm": {}'
CONTOUR = "G3 X0 Y27 I2 J0 F2683.0\nG1 X52 F4583.0\nG3 X54 Y29 I0 J2 F2683.0\n"
CHAMFER = ("G0 X-12.0725 Y22.545\nG0 Z17\nG0 Z13\nG1 Z10.4275 F1375.0\nG17\nG3 X-10 Y20.4725 I2.0725 J0 F2731.0\n"
           "G1 X0 F4584.0\nX52\nX62\nG3 X64.0725 Y22.545 I0 J2.0725 F2731.0\n")
CHAMFER_LOW = CHAMFER.replace("Z10.4275", "Z9.8").replace("Y20.4725", "Y21.1").replace("Y22.545", "Y23.1725")    # and farther out
SIDES = ((FIRST, CONTOUR, CONTOUR.replace("Y27", "Y11").replace("Y29", "Y13")), (FIRST, "G0 X-2 Y29\n", "G0 X-2 Y13\n"),
         (FIRST, BLIND, ""), (SECOND, BELOW, BELOW + BLIND))


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "two_sided_plate", PART, "--stage", "gcode")


def findings(plate, folder, *changes):
    """Of the plate's folder copied, with (file, old, new) changed there."""
    shutil.copytree(plate, folder)
    for name, old, new in changes:
        text = (folder / name).read_text()
        assert text.count(old) == 1, (name, old)
        (folder / name).write_text(text.replace(old, new))
    return judge(folder, read_job(folder), options=COARSE).findings


def told(found, kind, near, within_mm=3.5):
    """Largest amount of one kind whose place is so near in plan to another; None: there is none."""
    return max((f.amount_mm for f in found if f.kind == kind and max(abs(f.place_mm[k] - near[k]) for k in (0, 1)) < within_mm),
               default=None)


def test_the_plan_counts_the_tool_changes_that_are_posted(plate):
    """Ten seconds each on this machine; the ledge's three passes share one cutter."""
    for setup in json.loads((plate / "plan.json").read_text())["setups"]:
        text, operations = (plate / f"{setup['name']}.ngc").read_text(), setup["operations"]
        posted = len(re.findall(r"^T\d+ M6$", text, re.MULTILINE))
        assert setup["tool_changes"] == posted <= len(operations)
        assert setup["time_s"] == pytest.approx(sum(o["time_s"] for o in operations) + 10 * posted, abs=0.06)
    assert len(operations) == 1 == posted


HOLES = (                   # all in one program: none is near to another
    (FIRST, BLIND, BLIND.replace("Z3.9081", "Z3.8581")),                                            # 0.05 mm too deep
    ("tools.json", *(DRILL.format(d) for d in (5.0, 5.5))), ("tools.tbl", "D5.000000 ", "D5.500000 "),  # M6x0.5's, not M6's
    (FIRST, "S870 M3", "S870 M4"),                                                                  # left-hand
    (FIRST, "G98 G83 X18 Y9 Z-0.955 R13 Q3 F525.0\nG80\n", "G1 Z-0.955 F525.0\nG0 Z17\n"),         # no peck, no retract
    (FIRST, CHAMFER, CHAMFER_LOW))                                                                  # tip below the ledge


FOUND = {("gouge", 7): 0.05, ("deep_hole", 18): 17.955, ("thread_hole", 29): 5.5 - 5.153, ("thread_hand", 29): 0.0,
         ("gouge", 29): 0.25}


def test_what_is_wrong_about_holes_threads_and_a_chamfer_is_told_by_name_and_nothing_else(plate, tmp_path):
    found = findings(plate, tmp_path / "holes", *HOLES)
    for (kind, x), amount in FOUND.items():
        assert told(found, kind, (x, 9)) == pytest.approx(amount, abs=4e-3), (kind, x, found)
    low = [f for f in found if f.operation == "chamfer"]
    assert [(f.kind, f.amount_mm) for f in low] == [("gouge", pytest.approx(0.2, abs=1e-3))] and len(found) == len(FOUND) + 1
    assert low[0].place_mm[2] == pytest.approx(10.0, abs=1e-3)          # the ledge, not the cone's own chamfer


def test_a_contour_on_the_wrong_side_and_a_hole_drilled_from_the_wrong_setup_are_told(plate, tmp_path):
    found = findings(plate, tmp_path / "sides", *SIDES)
    walls = [f.amount_mm for f in found if f.kind == "gouge" and f.operation == "pocket walls"]
    assert walls and walls == len(walls) * [pytest.approx(2.0, abs=1e-3)]
    assert told(found, "missing_area", (7, 9)) == pytest.approx(3.0, abs=0.01)
    assert told(found, "gouge", (7, 19)) > 2.0          # turned over, the hole comes out there
