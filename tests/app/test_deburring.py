"""Edges broken though the solid has them sharp: the faces are judged as if they were, the break by its width."""

import json
import re
import shutil
from pathlib import Path

import cadquery as cq
import deburred_plate
import pytest
from built_parts import built_once

from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Parameters
from cuspline.design.job import read_job
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.deburr import Deburr
from cuspline.toolpaths.prismatic.sharp_edges import sharp_edges
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "deburred_plate.py"
COARSE = Options(spacing_mm=2.0, solid_pitch_mm=1.0, replay_pitch_mm=0.5, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "deburred_plate", PART, "--stage", "gcode")


def test_a_part_whose_sharp_edges_are_broken_is_verified_and_says_how_wide(plate):
    judged = judge(plate, read_job(plate), options=COARSE)
    assert judged.findings == ()
    row, = judged.as_dict(())["edge_breaks"]
    assert row["ok"] and row["places"] > 700
    assert (row["least_mm"], row["most_mm"]) == (pytest.approx(0.2, abs=5e-4), pytest.approx(0.2, abs=5e-4))


def test_what_stands_in_the_way_stays_sharp_and_is_listed(plate):
    """The boss 1 mm beside the rim: the cutter's own radius over it, on either side."""
    operation, = json.loads((plate / "plan.json").read_text())["setups"][0]["operations"]
    left, = operation["edges_left"]
    assert left["place_mm"] == [30.0, 0.0, 8.0] and left["length_mm"] == pytest.approx(9.75, abs=0.6) and "beside" in left["why"]


def spoilt(plate, folder, change):
    """Kinds of findings, with the largest amount of each, of the program with its deburring changed."""
    folder = shutil.copytree(plate, folder)
    program = folder / "setup-1.ngc"
    head, deburr = program.read_text().split("(OPERATION 1")
    program.write_text(f"{head}(OPERATION 1{change(deburr)}")
    amounts = {}
    for f in judge(folder, read_job(folder), options=COARSE).findings:
        amounts[f.kind] = max(f.amount_mm, amounts.get(f.kind, 0.0))
    return amounts


def lower(by_mm):
    return lambda text: re.sub(r"G1 Z6\.8", f"G1 Z{6.8 - by_mm:g}", text)


def without_the_hole(text):
    """The last run, from over the hole on."""
    rest, _ = text.rsplit("Z9\n", 1)
    return rest + "M5\nM9\nG53 G0 Z0\nM2\n"


@pytest.mark.parametrize("change, wanted", [
    (lower(0.05), {"edge_break_width": 0.05, "gouge": 0.05}), (lower(-0.05), {"edge_break_width": 0.05}),
    (without_the_hole, {"edge_break_missing": 0.2}),
    (lambda text: re.sub(r"G1 X35\.\d+", "G1 X34.6", text), {"gouge": 0.07})],
    ids=["too deep", "too shallow", "a run left out", "into the boss"])
def test_a_break_that_is_not_what_is_stated_is_found(plate, tmp_path, change, wanted):
    found = spoilt(plate, tmp_path / "spoilt", change)
    assert wanted.keys() <= found.keys(), found
    assert {kind: found[kind] for kind in wanted} == {k: pytest.approx(v, abs=0.3 * v) for k, v in wanted.items()}


def test_only_level_edges_over_upright_walls_are_broken_and_each_other_says_why():
    """A block with a slanting side and a chamfer: of its top's four edges two are sharp and upright."""
    block = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (26, 8), (1, 8), (0, 7)]).close().extrude(-12)
    faces = brep.faces_of(brep.the_solid(block))
    top = [k for k, f in enumerate(faces) if f.middle.normal[0, 2] > 0.999]
    sharp, left = sharp_edges(faces, top, 1e-3)
    assert sorted(round(e.length_mm, 6) for e in sharp) == [25.0, 25.0] and {e.z_mm for e in sharp} == {8.0}
    assert [e.why for e in left] == ["one of its faces looks down: give it to a setup from the other side"]


def test_a_face_without_an_edge_to_break_is_refused():
    design = deburred_plate.design(Parameters(), Deburr(faces=("floor",)))
    with pytest.raises(CamError, match="no sharp edge is broken: floor have none between a level face and an upright wall"):
        plan_setup(design, design.setups[0], catalogue.find_machine("mill_3axis"), catalogue.find_library(None))
