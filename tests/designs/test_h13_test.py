"""The source's test of hardened steel, built with all proofs: its depths, radii and the order of its axial forces."""

import json

import numpy as np
import pytest

import cuspline

RADIUS, RPM, SIMULATED_MM = 5.41, 5000, 0.005 * 5.41        # half a percent of the radius


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return cuspline.build("h13_test", out=tmp_path_factory.mktemp("h13") / "out", stage="verify")


def rows(built):
    document = json.loads((built.folder / "verify.json").read_text())
    return {row["name"]: row for row in document["setups"][0]["process"]["operations"]}


def test_the_source_s_test_is_cut_as_drawn(built):
    assert built.is_verified and built.findings == ()
    assert all("S5000 M3" in text and "F1270" in text for text in built.program.values())


def test_what_nobody_has_stated_is_said_to_be_not_checked_in_plan_and_header(built):
    wanted = ["chatter of T99", "drives", "edge life"]
    assert json.loads((built.folder / "plan.json").read_text())["setups"][0]["not_checked"] == wanted
    assert "(NOT CHECKED: CHATTER OF T99; DRIVES; EDGE LIFE)" in built.program["setup-1"]


def test_the_axial_force_falls_from_plane_to_step_up_to_inclined_as_the_source_measured(built):
    axial = [rows(built)[name]["axial_mean_n"] for name in ("plane", "step-up", "inclined")]
    assert axial == sorted(axial, reverse=True) and axial[1] < 0.7 * axial[0]


def test_depths_and_the_lowest_radius_in_the_cut_are_the_closed_forms(built):
    lowest = lambda row: row["lowest_speed_m_per_min"] * 1000 / (2 * np.pi * RPM)
    for name, depth_mm, radius_mm in (("step-up", 2.3363, 2.057), ("inclined", 2.2307, 2.286)):
        row = rows(built)[name]
        assert row["depth_mm"] == pytest.approx(depth_mm, abs=SIMULATED_MM) and row["tip_share"] == 0.0
        assert lowest(row) == pytest.approx(radius_mm, abs=0.03)
    assert rows(built)["plane"]["tip_share"] > 0.7 and lowest(rows(built)["plane"]) < 0.05 * RADIUS
