"""Parts with what troubles path planners, cut end to end: planned, posted, read back, simulated, compared."""

import json

import cadquery as cq
import pytest
from troublesome_parts import PARTS, design_of

from cuspline import brep, catalogue
from cuspline.build import Order, build
from cuspline.errors import DesignError

STRATEGIES = {"knife_edge": "parallel", "pole_and_apex": "constant_scallop", "closed_face": "boundary",
              "slivers": "parallel", "hole_and_islands": "constant_scallop"}


@pytest.mark.parametrize("name", list(PARTS))
def test_the_posted_program_cuts_the_part(name, tmp_path):
    order = Order(source=None, design=design_of(name, STRATEGIES[name]), accepted=(), out=tmp_path / name,
                  machine=catalogue.find_machine("mill_3axis"), library=catalogue.find_library(None), last_stage="verify")
    result = build(order)
    verify = json.loads((result.folder / "verify.json").read_text())
    assert result.findings == () and verify["ok"]
    assert verify["gouge_max_mm"] <= 0.004 and verify["cusp_max_mm"] <= 0.033
    # what is not reached is listed with its reason, and there is nothing else
    assert verify["area_required_mm2"] == pytest.approx(verify["area_reached_mm2"] + verify["area_unreachable_mm2"], abs=0.02)


def test_several_solids_and_an_open_shell_are_refused_by_name():
    two = cq.Workplane().box(4, 4, 4).union(cq.Workplane().box(4, 4, 4).translate((9, 0, 0)))
    with pytest.raises(DesignError, match="bracket holds 2 solids, it must be exactly one"):
        brep.the_solid(two, "bracket")
    shell = cq.Shell.makeShell([f for f in cq.Workplane().box(4, 4, 4).faces().vals()][:5])
    with pytest.raises(DesignError, match="bracket holds 0 solids, it must be exactly one: close its shell"):
        brep.the_solid(shell, "bracket")
