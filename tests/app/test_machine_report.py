"""The machine as the report is handed it: bodies out of STEP files, three axes with bodies, arcs, positions that share names."""

from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, tool

from cuspline.app import machine_report
from cuspline.app.catalogue import find_machine
from cuspline.app.report_inputs import _broken_down, drawn_setup
from cuspline.design import Setup
from cuspline.program.program import Plane
from cuspline.shop.machines import Machine, StepBody

MILL = find_machine("mill_3axis")
COLUMN = {"name": "column", "link": "bed", "shape": {"low_mm": [0, 400, -500], "high_mm": [100, 500, 0]}}
WITH_COLUMN = Machine.model_validate({**MILL.model_dump(), "bodies": [COLUMN]})
SETUP = Setup(name="setup-1", wcs_in_words="", faces=("a",))
PLAN = {"setups": [{"name": "setup-1", "operations": [{"name": "finish", "tool": {"number": 1, "diameter_mm": 6.0}}]}]}


def view(machine, moves, plan=PLAN):
    read = SimpleNamespace(setup=SETUP, whole=moves, position=np.zeros(len(moves), int))
    judged = SimpleNamespace(read=(read,), tools={1: tool("ball", 6)})
    drawn = [drawn_setup(moves, SETUP, plan, machine)]
    return machine_report.machine_view(SimpleNamespace(machine=machine), judged, drawn, plan, _broken_down), drawn[0]


def moves_on(machine, length_mm=95.0):
    made = [rapid(0, 0, 50), feed(0, 0, 5), arc((20, 0, 5), (10, 0, 5), Plane.XY), feed(40, 0, 5)]
    ends = np.array([m[1] for m in made], float)
    return program((0, 0, 60), made, machine_end_mm=ends + machine.wcs_origin_mm + (0, 0, length_mm))


def test_three_axes_without_bodies_have_no_machine_to_show():
    assert view(MILL, moves_on(MILL))[0] is None


def test_three_axes_with_a_body_move_as_the_path_does():
    """Every pose's tip, arcs as they are drawn, is a point of the path, at its time and in its line."""
    found, drawn = view(WITH_COLUMN, moves_on(WITH_COLUMN))
    motion, = found.motions
    tips = motion.place.into(motion.joints + found.tools[1].tip_mm)
    path = drawn.path
    assert len(tips) == len(path.points_mm) - 1 > 20                # the path begins with where it comes from
    assert np.abs(tips - path.points_mm[1:]).max() < 1e-9 and np.abs(motion.time_s - path.time_s[1:]).max() < 1e-9
    assert (motion.line == path.line[1:]).all() and (motion.operation == path.operation[1:]).all()


def test_operations_are_counted_as_in_the_plan_of_their_own_setup():
    """Positions of one program share the names of their operations: the reader counts them over all of it."""
    moves = program((0, 0, 9), [feed(1, 0, 0), feed(2, 0, 0)], operation=[1, 0], operations=("finish", "rough"))
    plan = {"setups": [{"name": "setup-1", "operations": [{"name": "rough", "tool": {"number": 1}},
                                                         {"name": "Finish", "tool": {"number": 1}}]}]}
    assert drawn_setup(moves, SETUP, plan, MILL).path.operation.tolist() == [-1, 0, 1]


def test_a_body_out_of_a_step_file_has_no_more_facets_than_allowed(tmp_path, monkeypatch):
    path = tmp_path / "ball.step"
    cq.exporters.export(cq.Workplane().sphere(80.0), str(path))
    fine = machine_report._drawn(StepBody(step=str(path)))
    monkeypatch.setattr(machine_report, "MOST_TRIANGLES", len(fine.triangles) // 2)
    coarse = machine_report._drawn(StepBody(step=str(path)))
    assert len(coarse.triangles) <= len(fine.triangles) // 2
    assert np.linalg.norm(fine.vertices_mm, axis=1) == pytest.approx(80.0) and np.isnan(fine.deviation_mm).all()
