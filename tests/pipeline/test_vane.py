"""A short vane end to end: planned, posted, read back, simulated, compared; and what is written beside it."""

import json

import numpy as np
import pytest

from cuspline import brep, catalogue
from cuspline.build import Order, build


@pytest.fixture(scope="module")
def vane(tmp_path_factory):
    """(Design, output folder): 6 mm round the joint of cells 49 and 50, whose tips differ most."""
    source = catalogue.find_design("rfq_vane")
    design = catalogue.make_design(source, ["from_mm=997", "to_mm=1003", "scallop_mm=0.012", "axis_height_mm=70",
                                            "grip_mm=15"])
    folder = tmp_path_factory.mktemp("vane") / "out"
    result = build(Order(source=source, design=design, accepted=(), out=folder,
                         machine=catalogue.find_machine(design.machine), library=catalogue.find_library(None),
                         last_stage="verify"))
    assert result.findings == ()
    return design, result.folder


def test_the_posted_program_cuts_the_tip(vane):
    verify = json.loads((vane[1] / "verify.json").read_text())
    assert verify["ok"] and verify["gouge_max_mm"] <= 0.0025 and 0.004 < verify["cusp_max_mm"] <= 0.012
    assert verify["excess_proven_mm"] <= 0.0122 and verify["gouge_proven_mm"] <= 0.0025
    assert verify["area_reached_mm2"] == pytest.approx(verify["area_required_mm2"])


def test_the_hollows_of_crest_and_sides_are_told_with_their_places(vane):
    design, folder = vane
    plan = json.loads((folder / "plan.json").read_text())
    crest, sides = plan["tip"]["crest_concave_radius_mm"], plan["tip"]["sides_concave_radius_mm"]
    assert crest == pytest.approx(plan["min_concave_radius_mm"], rel=0.01) and sides > crest
    assert plan["tip"]["crest_concave_where"] in ("cell 49", "cell 50")
    x, y, z = plan["tip"]["crest_concave_place_mm"]
    assert 997 <= x <= 1003 and y == 0 and z == pytest.approx(float(design.tip.crest_z_mm([x])[0]), abs=1e-3)


def test_passes_lie_in_transverse_planes_and_are_tangent_arcs(vane):
    operation = json.loads((vane[1] / "plan.json").read_text())["setups"][0]["operations"][-1]
    assert operation["section_plane"] == "YZ" and operation["arcs"] > 2 * operation["passes"]
    text = (vane[1] / "setup-1.ngc").read_text()
    assert "G19" in text


def test_the_quadrupole_is_written_beside_the_vane(vane):
    design, folder = vane
    path = folder / "rfq_vane.quadrupole.step"
    manifest = json.loads((folder / "manifest.json").read_text())
    assert path.name in manifest["files"] and manifest["machine"] == "mill_long_bed"
    with pytest.raises(brep.DesignError, match="4 solids"):
        brep.the_solid(brep.read_step(path))
    assert np.ptp(brep.bounding_box_mm(design.solid), axis=0)[0] == pytest.approx(6.0, abs=1e-3)
