"""A short vane end to end: planned, posted, read back, simulated, compared; and what is written beside it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from built_parts import copied

from cuspline.app import catalogue
from cuspline.app.build import Order, build
from cuspline.app.judge import judge, posted_moves, read_tools
from cuspline.design.job import read_job
from cuspline.designs.rfq_vane import RfqVane, table_of
from cuspline.kernel import brep
from cuspline.replay.replay import replay
from cuspline.replay.scene import FoundStock, Surroundings
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.values.errors import DesignError, PlanError
from cuspline.verification.certificate import certify, gouges_beyond
from cuspline.verification.verdict import Options


def made(folder, *parameters, stage="verify"):
    """(Design, output folder) of a part of the vane."""
    source = catalogue.find_design("rfq_vane")
    given = {"scallop_mm": "0.012", "axis_height_mm": "70", "grip_mm": "15"} | dict(p.split("=") for p in parameters)
    design = catalogue.make_design(source, [f"{name}={value}" for name, value in given.items()])
    result = build(Order(source=source, design=design, accepted=(), out=folder,
                         machine=catalogue.find_machine(design.machine), library=catalogue.find_library(None),
                         last_stage=stage))
    assert result.findings == ()
    return design, result.folder


@pytest.fixture(scope="module")
def vane(tmp_path_factory):
    """6 mm round the joint of cells 49 and 50, whose tips differ most."""
    return made(tmp_path_factory.mktemp("vane") / "out", "from_mm=997", "to_mm=1003")


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
    assert 997 <= x <= 1003 and y == 0 and z == pytest.approx(float(design.guides[0].crest_z_mm([x])[0]), abs=1e-3)


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


def test_a_vane_longer_than_the_bed_shows_no_step_at_the_joint_unless_it_is_clamped_wrong(tmp_path):
    """Two clampings; the second is then judged on a vane that lies 10 um lower than the program was posted for."""
    design, folder = made(tmp_path / "out", "from_mm=990", "to_mm=1016", "bed_travel_mm=20", "overlap_mm=9",
                          stage="gcode")
    job, coarse = read_job(folder), Options(spacing_mm=0.5, solid_pitch_mm=0.8, replay_pitch_mm=0.8)
    joint, = judge(folder, job, options=coarse).as_dict(())["joints"]
    assert (joint["setup"], joint["with"]) == ("setup-2", "setup-1") and joint["area_mm2"] > 100
    assert abs(joint["step_mean_mm"]) < 0.001 and abs(joint["step_max_mm"]) < 0.004
    second = design.setups[1]
    seen = second.frame.into(np.array([m.at_mm for m in second.markers])) - (0.0, 0.0, 0.010)
    lower = {"setup-2": {m.name: tuple(p) for m, p in zip(second.markers, seen)}}
    wrong, = judge(folder, job.placed(lower), options=coarse).as_dict(())["joints"]
    assert wrong["step_max_mm"] == pytest.approx(0.010, abs=0.003)              # at the crest, all of it
    assert 0.003 < wrong["step_mean_mm"] - joint["step_mean_mm"] < 0.006        # little along the flanks


def test_a_clamping_clears_no_farther_than_it_reaches(tmp_path):
    design, folder = made(tmp_path / "out", "from_mm=985", "to_mm=1010", "bed_travel_mm=20", "overlap_mm=8",
                          "scallop_mm=0.05", stage="gcode")
    assert len(design.setups) > 1
    job = read_job(folder)
    for setup, (low, high) in zip(design.setups, [s.reach_x_mm for s in design.setups]):
        moves = posted_moves(((folder / f"{setup.name}.ngc").read_text(),), setup, job.machine, read_tools(folder))
        x = setup.frame.out(moves.end_mm[np.isfinite(moves.end_mm).all(axis=1)])[:, 0]
        assert x.min() > low - 1e-3 and x.max() < high + 1e-3 and high - low < 60


PROTONS = {"table": "law", "ion_mass_amu": 1.007276, "energy_in_mev": 0.05, "cells": 60, "ramp_cells": 60, "grip_mm": 8}


@pytest.mark.parametrize("frequency_mhz, first_mm, stretch_mm, shape", [
    (80, 19.344, (457, 460), {"r0_mm": 9.0, "rho_mm": 6.75, "thickness_mm": 16, "axis_height_mm": 60, "voltage_kv": 80}),
    (200, 7.737, (215, 218), {"r0_mm": 4.5, "rho_mm": 3.375, "thickness_mm": 12, "axis_height_mm": 40, "voltage_kv": 60}),
    (440, 3.517, (104, 107), {"r0_mm": 2.2, "rho_mm": 1.65, "thickness_mm": 8, "axis_height_mm": 36, "voltage_kv": 50})])
def test_vanes_of_protons_by_law_are_verified(tmp_path, frequency_mhz, first_mm, stretch_mm, shape):
    """Round the tightest valley of each: half a way of 50 keV in a period is the first cell, the ball fits the valley."""
    given = {**PROTONS, **shape, "frequency_mhz": frequency_mhz, "entry_aperture_mm": 4 * shape["r0_mm"],
             "from_mm": stretch_mm[0], "to_mm": stretch_mm[1]}
    design, folder = made(tmp_path / "out", *(f"{name}={value}" for name, value in given.items()), stage="gcode")
    # published to a micrometre, by m v^2 / 2; the relativistic speed is 3/4 E / (m c^2) = 4.0e-5 less
    assert table_of(design.parameters).cells[0].length_mm == pytest.approx(first_mm * (1 - 4.0e-5), abs=6e-4)
    plan = json.loads((folder / "plan.json").read_text())
    ball = plan["setups"][0]["operations"][-1]["tool"]
    assert ball["type"] == "ball" and ball["diameter_mm"] < 2 * plan["tip"]["crest_concave_radius_mm"]
    coarse = Options(spacing_mm=0.25, solid_pitch_mm=0.4, replay_pitch_mm=0.5)
    verify = judge(folder, read_job(folder), options=coarse).as_dict(())
    assert verify["ok"] and verify["area_reached_mm2"] == pytest.approx(verify["area_required_mm2"])


def test_an_aperture_too_wide_for_a_frequency_is_refused_with_the_cell_and_what_to_lower():
    with pytest.raises(DesignError, match="lower r0_mm 9.718: at 440 MHz the first cells are 3.517 mm long"):
        table_of(RfqVane(**PROTONS, frequency_mhz=440))


def test_steep_cells_are_finished_by_arcs_and_sections_where_arcs_leave_too_much(tmp_path):
    """3 mm of a steep cell at 5 um: without the sections 17 um are left beside the mid-plane."""
    design, folder = made(tmp_path / "out", "from_mm=1014", "to_mm=1017", "ball_mm=6", "scallop_mm=0.005",
                          "strategy=transverse_arcs", "rest=sections", stage="gcode")
    operations = json.loads((folder / "plan.json").read_text())["setups"][0]["operations"]
    assert [o["name"] for o in operations][-2:] == ["finish", "rest finish"]
    assert operations[-2]["cut_map"]["general"]["highest_mm"] > 0.01
    coarse = Options(spacing_mm=0.25, solid_pitch_mm=0.4, replay_pitch_mm=0.5)
    verify = judge(folder, read_job(folder), options=coarse).as_dict(())
    assert verify["ok"] and verify["gouge_max_mm"] < 0.001 and verify["excess_proven_mm"] <= 0.005


@pytest.fixture(scope="module")
def side_cut(tmp_path_factory):
    """Posted for a side cutter on its head; not to be edited."""
    return made(tmp_path_factory.mktemp("side") / "out", "from_mm=150", "to_mm=154", "axis_height_mm=100",
                "strategy=transverse_arcs", "cutter=side", stage="gcode")[1]


def test_a_vane_is_cut_by_a_side_cutter_on_its_head(side_cut):
    """Nearly level cells: what arcs leave beside the mid-plane is nothing there, and the disc keeps the finish."""
    folder = side_cut
    finish = json.loads((folder / "plan.json").read_text())["setups"][0]["operations"][-1]
    assert finish["tool"]["type"] == "side" and finish["head"] == "right-angle head" and finish["wheel_mm"] == 27.0
    assert "X-62.000000 Z150.000000 D60.000000" in (folder / "tools.tbl").read_text()
    assert "ON RIGHT-ANGLE HEAD" in (folder / "setup-1.ngc").read_text()
    coarse = Options(spacing_mm=0.25, solid_pitch_mm=0.4, replay_pitch_mm=0.5)
    judged = judge(folder, read_job(folder), options=coarse)
    verify = judged.as_dict(())
    replay = judged.verdict.setups[0].replay            # the disc lowers its nodes too; heights on steep flanks
    over = replay.final_z_mm - replay.design_top_mm
    assert -0.01 < np.nanmin(over) and np.nanmax(over) < 0.1 and (np.diff(replay.event_row) >= 0).all()
    assert judged.verdict.setups[0].findings == () and verify["setups"][0]["holder_clearance_mm"] == pytest.approx(1.0)
    assert verify["gouge_max_mm"] < 0.001 and 0.008 < verify["cusp_max_mm"] < 0.0125
    assert verify["area_reached_mm2"] == pytest.approx(verify["area_required_mm2"])
    # the proofs know the disc: nothing is left out but the moves before the first known place, and they are near the truth
    proof = verify["setups"][0]["sampling"]
    assert proof["not_covered"] == [] and max(proof["unproven_mm2"].values()) == 0
    assert verify["excess_max_mm"] <= verify["excess_proven_mm"] < 1.05 * verify["excess_max_mm"]
    assert verify["gouge_max_mm"] <= verify["gouge_proven_mm"] < 0.001
    assert verify["setups"][0]["certificate"]["not_covered"] == {"the program does not say where the move begins or ends": 2}
    # 2 um into the metal
    job, tools = read_job(folder), read_tools(folder)
    setup = job.posted[0].setup
    moves = posted_moves(((folder / "setup-1.ngc").read_text(),), setup, job.machine, tools)
    low = {name: getattr(moves, name) - (0.0, 0.0, 0.002) for name in ("start_mm", "end_mm", "center_mm")}
    solid = brep.seen_from(brep.the_solid(brep.read_step(folder / job.step)), setup.frame)
    here, there = (certify(m, tools, ExactPart.of_solid(solid), solid=solid, tolerance_mm=4e-4)
                   for m in (moves, replace(moves, **low)))
    assert gouges_beyond(here, 0.001) == () and 0.002 <= there.proven_mm < 0.0025
    assert {moves.kind[g.row] >= 2 for g in gouges_beyond(there, 0.001)} == {True}


def test_a_disc_that_would_meet_the_jaws_is_refused(tmp_path):
    with pytest.raises(PlanError, match="its cutter comes within -.* mm of the .* jaw with the cutter's middle at"):
        made(tmp_path / "out", "from_mm=150", "to_mm=154", "axis_height_mm=100", "strategy=transverse_arcs",
             "cutter=side", "grip_mm=50", stage="gcode")


def test_a_head_that_the_machine_has_lower_than_the_program_knew_is_found(side_cut, tmp_path):
    """The posted program of a small head, judged with one that hangs into the vane."""
    folder = copied(side_cut, tmp_path / "out")
    tools = json.loads((folder / "tools.json").read_text())
    rows = tools["tools"] if isinstance(tools, dict) else tools
    disc = next(t for t in rows if "head" in t)
    disc["head"]["boxes"][0].update(min_mm=[-28.0, -12.0, -45.0], max_mm=[-1.0, 12.0, 70.0])
    (folder / "tools.json").write_text(json.dumps(tools))
    judged = judge(folder, read_job(folder), options=Options(spacing_mm=0.5, solid_pitch_mm=0.8, replay_pitch_mm=0.5))
    assert "holder_contact" in {f.kind for f in judged.verdict.setups[0].findings}


def test_a_disc_below_the_machines_table_is_found(tmp_path):
    _, folder = made(tmp_path / "out", "from_mm=150", "to_mm=152", "axis_height_mm=100", "strategy=transverse_arcs",
                     "cutter=side", stage="gcode")
    job = read_job(folder)
    tools = read_tools(folder)
    lowest = min(float(line.split("Z")[1].split()[0]) for line in (folder / "setup-1.ngc").read_text().splitlines()
                 if "TIP EXTENTS" in line) - 30.0
    depth = []
    for above in (1.0, -2.0):
        machine = job.machine.model_copy(update={"table_z_mm": job.machine.wcs_origin_mm[2] + lowest - above})
        moves = posted_moves(((folder / "setup-1.ngc").read_text(),), job.posted[0].setup, machine, tools)
        found = replay(moves, tools, FoundStock(min_mm=(0.0, -10.0, 0.0), max_mm=(2.0, 10.0, 92.0), pitch_mm=0.5,
                                                within_before=lambda row: lambda xy, radius: np.zeros(len(xy))),
                       around=Surroundings(machine=machine))
        depth.append([f.amount_mm for f in found.findings if "table" in f.advice])
    assert depth[0] == [] and max(depth[1]) == pytest.approx(2.0, abs=0.01)


def test_where_a_vane_opens_steeply_sections_take_what_arcs_cannot_reach_with_the_jaws_clear(tmp_path):
    """The first 30 mm: whole strokes there lead ball and holder into jaws and stock."""
    design, folder = made(tmp_path / "out", "to_mm=30", "axis_height_mm=100", "grip_mm=25", "strategy=transverse_arcs",
                          "rest=sections", stage="gcode")
    operations = json.loads((folder / "plan.json").read_text())["setups"][0]["operations"]
    assert [o["name"] for o in operations] == ["rough", "rough passes", "finish", "rest semi-finish", "rest finish"]
    coarse = Options(spacing_mm=0.25, solid_pitch_mm=0.4, replay_pitch_mm=0.5)
    verify = judge(folder, read_job(folder), options=coarse).as_dict(())
    assert verify["ok"] and verify["excess_proven_mm"] <= 0.013
    assert verify["area_reached_mm2"] == pytest.approx(verify["area_required_mm2"])
