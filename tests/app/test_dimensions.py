"""Dimensions with limits, judged on the simulated stock: a sound part passes, a hole too wide and a floor too deep do not."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from built_parts import built_once
from pydantic import ValidationError
from toleranced_plate import BORE_MM, REAMED_MM, design

from cuspline.app.judge import begun, judge
from cuspline.design import Diameter, Distance, Parameters
from cuspline.design.job import read_job
from cuspline.kernel import brep
from cuspline.values.errors import DesignError
from cuspline.verification.measuring import measured, refuse_unmeasurable, tolerance_findings
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "toleranced_plate.py"
COARSE = Options(spacing_mm=2.0, solid_pitch_mm=1.5, replay_pitch_mm=0.7, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "toleranced_plate", PART, "--stage", "gcode")


def test_a_part_within_its_limits_is_measured_to_the_micrometre(plate):
    job = read_job(plate)
    read = begun(plate, job, options=COARSE)
    rows = {m.name: m for m in measured(job.dimensions, read.first.part.piece, read.solid, job.predicates, 5e-5)}
    assert len(rows) == 5 and tolerance_findings(rows.values(), "setup-1") == ()
    bore, depth = rows["bore H7"], rows["depth"]
    assert (bore.lower_mm, bore.upper_mm) == (14.0, 14.018)
    assert abs(bore.fitted_mm - BORE_MM) < 1e-3 and bore.most_mm - bore.least_mm < 2e-3
    assert abs(depth.least_mm - 2.0) < 1e-3 and abs(depth.most_mm - 2.0) < 1e-3
    assert rows["position of bore"].most_mm < 2e-3 and abs(rows["reamed H7"].fitted_mm - REAMED_MM) < 1e-3
    assert "G98 G85 X56 Y15 Z-0.5 R7" in (plate / "setup-1.ngc").read_text()


def test_a_bore_of_the_wrong_place_and_a_floor_too_deep_are_out_of_tolerance(plate, tmp_path):
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    program = folder / "setup-1.ngc"
    lines, operation = program.read_text().splitlines(keepends=True), ""
    for k, line in enumerate(lines):
        operation = line if line.startswith("(OPERATION") else operation
        if "POCKET FLOOR" in operation:
            lines[k] = line.replace(" Z4 ", " Z3.98 ")
        if "BORE," in operation and line.startswith(("G", "X")) and "X" in line:
            lines[k] = moved(line, 0.02)
    program.write_text("".join(lines))
    found = judge(folder, read_job(folder), options=COARSE)
    beyond = {f.advice.split(":")[0]: f.amount_mm for f in found.findings if f.kind == "out_of_tolerance"}
    assert beyond["depth"] == pytest.approx(0.01, abs=1e-3)
    assert 0.015 < beyond["position of bore"] < 0.025 and "width" not in beyond
    assert {row["name"] for row in found.as_dict(())["dimensions"] if not row["ok"]} == set(beyond)


def moved(line, by_mm):
    """A block with its X so much farther."""
    words = line.split()
    return " ".join(f"X{float(w[1:]) + by_mm:.4f}" if w.startswith("X") else w for w in words) + "\n"


@pytest.mark.parametrize("said, why", [
    ({"fit": "H7", "lower_mm": 0.0, "upper_mm": 0.1}, "state fit"), ({}, "state fit"), ({"lower_mm": 0.1}, "state fit"),
    ({"lower_mm": 0.1, "upper_mm": 0.1}, "is not below"), ({"fit": "H99"}, "not known")])
def test_limits_that_say_nothing_or_too_much_are_refused(said, why):
    with pytest.raises(ValidationError, match=why):
        Diameter(faces="bore", **said)


@pytest.mark.parametrize("dimension, why", [
    (Diameter(faces="pocket", fit="H7"), "have a plane among them|have a cylinder among them"),
    (Distance(faces="floor", from_faces="left", fit="js9"), "are not two levels parallel"),
    (Distance(faces="floor", from_faces="bore", fit="js9"), "are not all planes")])
def test_what_cannot_be_measured_is_refused_before_anything_is_planned(dimension, why):
    part = design(Parameters())
    with pytest.raises(DesignError, match=why):
        refuse_unmeasurable((dimension,), brep.the_solid(part.solid), part.predicates)


def test_a_dimension_of_faces_that_nobody_names_is_refused():
    with pytest.raises(DesignError, match="is a name of no predicate"):
        replace(design(Parameters()), dimensions=(Distance(faces="floor", from_faces="roof", fit="js9"),))
