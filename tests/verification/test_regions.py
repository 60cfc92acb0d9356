"""Region by region: areas add up, a face counts where it is judged, what is out of reach is told with its reason."""

from types import SimpleNamespace

import numpy as np
import pytest

from cuspline.design import Finish
from cuspline.report import facts
from cuspline.verification.regions import regions

FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)


def setup(required, face, deviation_mm, reach):
    """As a verdict on some faces of the solid looks: a sample a square millimetre."""
    samples = SimpleNamespace(weight_mm2=np.ones(len(face)), face=np.array(face))
    found = SimpleNamespace(samples=samples, deviation_mm=np.array(deviation_mm), reach=np.array(reach))
    return SimpleNamespace(finish=FINISH, required=required, residuals=found)


@pytest.fixture(scope="module")
def rows():
    blade = setup((7, 3), [0, 0, 0, 1, 1], [0.004, 0.008, -0.002, 0.011, 0.4], [0, 0, 0, 0, 0])
    hub = setup((5,), [0, 0, 0], [0.001, 0.5, 0.6], [0, 1, 2])
    names = {"face": (7,), "edge": (3,), "hub": (5,), "both": (7, 3), "tip": (9,)}
    return {row["name"]: row for row in regions((blade, hub), names)}


def test_areas_cusps_and_gouges_are_those_of_the_faces_of_the_name(rows):
    assert list(rows) == ["face", "edge", "hub", "both"]          # nobody judges the tip
    face, edge, both = (rows[n] for n in ("face", "edge", "both"))
    assert (face["area_required_mm2"], face["area_reached_mm2"], face["cusp_max_mm"], face["gouge_max_mm"]) == (3, 3, 0.008, 0.002)
    assert (edge["area_required_mm2"], edge["area_reached_mm2"], edge["cusp_max_mm"]) == (2, 1, 0.011)      # 0.4 mm: never finished
    assert both["area_required_mm2"] == 5 and both["area_reached_mm2"] == 4 and both["cusp_max_mm"] == 0.011


def test_what_is_out_of_reach_counts_apart_and_says_why(rows):
    hub = rows["hub"]
    assert (hub["area_reached_mm2"], hub["area_unreachable_mm2"], hub["cusp_max_mm"]) == (1, 2, 0.001)
    assert hub["why"] == "faces downward; too narrow for the smallest ball"


def test_the_report_says_the_same_in_micrometres(rows):
    shown = {row["name"]: row for row in facts.region_rows({"regions": list(rows.values())})}
    assert (shown["edge"]["reached"], shown["edge"]["cusp"], shown["hub"]["unreachable"]) == ("50.0 %", "11.00", "2.0")
    assert shown["face"]["why"] == "–" and shown["hub"]["why"].startswith("faces downward")
