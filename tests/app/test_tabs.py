"""Tabs: left where they are stated, told as wanted left; one that is cut, and stock left without being asked for, are red."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import pytest
import tabbed_plate
from built_parts import built_once
from pydantic import ValidationError

from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Parameters
from cuspline.design.job import read_job
from cuspline.kernel import brep
from cuspline.planning.plan import SetupPlan, plan_setup
from cuspline.planning.strategies.contour import Contour
from cuspline.surfaces.inner_corners import inner_edges
from cuspline.values.errors import CamError
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "tabbed_plate.py"
COARSE = Options(spacing_mm=1.5, solid_pitch_mm=1.0, replay_pitch_mm=0.5, tessellation_mm=0.01)
MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "tabbed_plate", PART, "--stage", "gcode")


def planned(sheet=tabbed_plate.SHEET, **fields):
    """SetupPlan of the plate with another contour."""
    design = tabbed_plate.design(Parameters(), Contour(**{"tool": "flat 10", **fields}), sheet)
    return plan_setup(design, design.setups[0], MACHINE, SHOP)


def test_tabs_stand_and_are_no_excess(plate):
    judged = judge(plate, read_job(plate), options=COARSE)
    assert judged.findings == ()
    document = judged.as_dict(())
    assert [(t["width_mm"], t["height_mm"], t["standing_mm"], t["ok"]) for t in document["tabs"]] == [(3.0, 1.0, 1.0, True)] * 2
    assert {row["reason"] for row in document["unreachable"]} == {"a tab is left here"}
    assert (plate / "setup-1.ngc").read_text().count("\nZ1 ") > 4


def test_in_an_indexed_position_they_stand_too(tmp_path_factory):
    folder = built_once(tmp_path_factory, "tabbed_turned", PART.with_name("tabbed_turned.py"), "--stage", "gcode")
    judged = judge(folder, read_job(folder), options=COARSE)
    assert judged.findings == ()
    tabs = judged.as_dict(())["tabs"]
    assert [(t["setup"], t["height_mm"], t["standing_mm"], t["ok"]) for t in tabs] == [("side", 1.0, 1.0, True)] * 2
    assert [t["place_mm"][1] for t in tabs] == [0.0, 0.0] and {t["place_mm"][0] for t in tabs} == {-5.0, 53.0}


def test_a_tab_that_is_cut_is_found_with_what_stands_of_it(plate, tmp_path):
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    text = (folder / "setup-1.ngc").read_text()
    head, finish = text.split("(OPERATION 2")
    assert finish.count("\nZ1 ") == 2
    (folder / "setup-1.ngc").write_text(head + "(OPERATION 2" + finish.replace("\nZ1 ", "\nZ0.4 ", 1))
    found = judge(folder, read_job(folder), options=COARSE).findings
    cut, = [f for f in found if f.kind == "tab_cut"]
    assert cut.amount_mm == pytest.approx(0.6, abs=0.12) and "0.4" in cut.advice


def test_stock_that_no_tab_is_stated_for_is_missing_area(plate):
    job = read_job(plate)
    found = judge(plate, job.model_copy(update={"tabs": job.tabs[:1]}), options=COARSE).findings
    here = [f for f in found if f.kind in ("missing_area", "excess")]
    assert here and all(abs(f.place_mm[0] - job.tabs[1].place_mm[0]) < 15 for f in here)


def test_the_program_says_what_a_corner_keeps(plate):
    document = json.loads((plate / "plan.json").read_text())
    assert document["setups"][0]["operations"][-1]["tabs"][0]["width_mm"] == 3.0
    pocket = cq.Workplane().box(30, 30, 8).cut(cq.Workplane(origin=(0, 0, 0)).rect(14, 14).extrude(9))
    faces = brep.faces_of(brep.the_solid(pocket))
    flat = SimpleNamespace(tool=SimpleNamespace(cutter=SimpleNamespace(type="flat", radius_mm=5.0, corner_radius_mm=0.0)))
    plan = SimpleNamespace(operations=[flat], context=SimpleNamespace(faces=faces))
    left = [SetupPlan.radius_left_mm(plan, e) for e in inner_edges(faces, set(range(len(faces))))]
    assert sorted(left) == [0.0] * 4 + [5.0] * 4              # at the foot, and up the corners


def test_stated_places_are_kept_to_where_there_is_room():
    places = ((20.0, 0.0), (18.0, tabbed_plate.Y))
    tabs = planned(tab_places=places, tab_width_mm=2.0, tab_height_mm=0.8).operations[-1].tabs
    assert len(tabs) == 2 and {t.height_mm for t in tabs} == {0.8}
    for x, y in places:
        assert min(abs(t.place_mm[0] - x) + abs(abs(t.place_mm[1] - y) - 5.0) for t in tabs) < 0.01


def test_square_tabs_are_shorter_where_the_cutter_may_plunge():
    cutting = [t.model_copy(update={"cutter": t.cutter.model_copy(update={"is_centre_cutting": True})}) for t in SHOP.tools]
    design = tabbed_plate.design(Parameters(), Contour(tool="flat 10", tabs=2, tab_shape="square"))
    plan = plan_setup(design, design.setups[0], MACHINE, SHOP.model_copy(update={"tools": tuple(cutting)}))
    moves = plan.operations[-1].moves
    down = moves.starts_mm[:, 2] - moves.end_mm[:, 2]
    flat = abs(moves.end_mm - moves.starts_mm)[:, :2].max(axis=1)
    assert (down[(flat > 1e-9) & (moves.kind != 0)] < 1e-9).all()
    assert (abs(down[flat < 1e-9] - 1.0) < 1e-9).sum() == 2         # behind both tabs


@pytest.mark.parametrize("fields, sheet, why", [
    ({"tabs": 2, "tab_shape": "square"}, 14.0, "does not cut at its centre"),
    ({"tabs": 2}, 8.0, "no stock stands across the cutter's way of 10 mm and behind it"),
    ({"tabs": 2, "tab_width_mm": 40.0}, 14.0, "no straight or round stretch"),
    ({"tabs": 9}, 14.0, "no straight or round stretch"),
])
def test_what_cannot_be_left_is_refused(fields, sheet, why):
    with pytest.raises(CamError, match=why):
        planned(sheet, **fields)


@pytest.mark.parametrize("fields, why", [
    ({"tab_width_mm": 3.0}, "go with tabs"), ({"tabs": 2, "tab_places": ((0.0, 0.0),)}, "state one of them"),
    ({"tabs": 2, "compensation": "control"}, "leave out compensation"),
    ({"tabs": 2, "finish_passes": 2}, "leave out compensation"), ({"tabs": 0}, "greater than")])
def test_fields_that_do_not_go_together_are_refused(fields, why):
    with pytest.raises(ValidationError, match=re.escape(why)):
        Contour(**fields)
