"""The outside judge of findings sees what is there, and what is not."""

import json
import sys
from pathlib import Path

import cadquery as cq
import pytest

from cuspline.kernel import brep

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import brute_force  # noqa: E402

PROGRAM = """G21 G17 G90 G91.1 G94 G54
T1 M6
G43 H1
S9000 M3
G0 X-14 Y-4 Z20
G0 Z5
G1 X14 F800
G1 Y0
G1 X4
G1 Z4.95
G1 X-4
G1 Z5
G1 X-14
G0 Z20
M2
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A block of 20 x 20 x 5 under 2 mm of stock: a flat cutter of 6 mm goes over half of it, 0.05 mm too deep in the middle."""
    path = tmp_path_factory.mktemp("judged")
    brep.write_step(brep.the_solid(cq.Workplane().box(20, 20, 5, centered=(True, True, False))), path / "block.step", "block")
    (path / "setup-1.ngc").write_text(PROGRAM)
    setup = {"wcs_origin_mm": [0, 0, 0], "wcs_x": [1, 0, 0], "wcs_z": [0, 0, 1]}
    finish = {"scallop_mm": 0.02, "profile_tolerance_mm": 0.005, "gouge_mm": 0.01}
    write = lambda name, value: (path / name).write_text(json.dumps(value))
    write("tools.json", {"tools": [{"number": 1, "cutter": {"type": "flat", "diameter_mm": 6.0, "corner_radius_mm": 0.0}}]})
    write("manifest.json", {"job": {"step": "block.step", "finish": finish, "posted": [
        {"setup": setup, "program": "setup-1.ngc", "continued": []}],
        "stock": {"min_mm": [-10, -10, 0], "max_mm": [10, 10, 7]}}})
    write("verify.json", {"findings": [
        {"kind": kind, "amount_mm": amount, "place_mm": place} for kind, amount, place in (
            ("gouge", 0.05, [1.0, 0.5, 5.0]), ("gouge", 0.05, [0, -5, 5]), ("excess", 2.0, [3, 6, 5]),
            ("excess", 1.2, [3, 7, 5]), ("plunge", 1.0, [3, 7, 5]))]})
    return path


def test_each_finding_is_held_against_what_dense_places_of_the_cutter_leave(folder):
    found = brute_force.judged(folder)
    assert [word for *_, word in found] == ["true", "false", "true", "true, other amount"]
    assert found[0][1].missing_mm == pytest.approx(0.05, abs=1e-5) and found[0][1].left_mm == 0.0
    assert found[1][1].missing_mm == found[1][1].left_mm == 0.0
    assert found[2][1].left_nearest_mm == pytest.approx(2.0, abs=1e-5)
