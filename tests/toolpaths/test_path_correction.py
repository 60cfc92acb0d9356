"""Corrected paths gouge no more, keep what was clean, and say what was done."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.errors import ToolpathError
from cuspline.toolpaths.exact_drop import ExactPart
from cuspline.toolpaths.path_correction import corrected_path
from cuspline.toolpaths.path_gouges import path_gouges

TOLERANCE_MM = 0.01
PATH = np.array([[-15.0, 0, 2.001], [-8, 0, 2.001], [8, 0, 2.001], [15, 0, 2.001]])


@pytest.fixture(scope="module")
def post():
    plate = cq.Workplane("XY").box(40, 40, 2, centered=(True, True, False))
    return ExactPart.of_solid(plate.faces(">Z").workplane().circle(1).extrude(3).val().wrapped)


@pytest.mark.parametrize("how", ["lift", "trim", "leave out"])
def test_a_corrected_path_is_clean(post, how):
    for R, rc in ((3.0, 3.0), (3.0, 1.0), (3.0, 0.0)):
        done = corrected_path(post, PATH, R, rc, TOLERANCE_MM, how)
        assert done.depth_mm[1] == pytest.approx(2.999, abs=0.011)
        assert done.is_changed[1] and (done.depth_mm[[0, 2]] <= TOLERANCE_MM).all()
        for run in done.runs:
            assert (path_gouges(post, run[:-1], run[1:], R, rc, TOLERANCE_MM)[0] <= TOLERANCE_MM + 1e-6).all()


def test_a_trimmed_move_stops_where_the_flat_cutter_meets_the_post(post):
    first, last = corrected_path(post, PATH, 3.0, 0.0, TOLERANCE_MM, "trim").runs
    assert first[-1, 0] == pytest.approx(-4.0, abs=0.005) and last[0, 0] == pytest.approx(4.0, abs=0.005)
    assert first[-1, 0] <= -4.0 and last[0, 0] >= 4.0


def test_leaving_out_keeps_the_other_moves_as_they_were(post):
    runs = corrected_path(post, PATH, 3.0, 3.0, TOLERANCE_MM, "leave out").runs
    np.testing.assert_array_equal(np.vstack(runs), PATH)


def test_a_clean_path_stays_as_it_is(post):
    done = corrected_path(post, PATH + (0, 0, 5), 3.0, 3.0, TOLERANCE_MM, "lift")
    np.testing.assert_array_equal(done.runs[0], PATH + (0, 0, 5))
    assert not done.is_changed.any()


def test_a_path_is_lifted_by_no_more_than_its_depth_and_the_tolerance(post):
    lowered = np.array([[-12.0, 9, 2], [-6, 9, 2], [6, 9, 2], [12, 9, 2]]) - (0, 0, 0.3)
    for R, rc in ((3.0, 3.0), (3.0, 1.0), (3.0, 0.0)):
        done = corrected_path(post, lowered, R, rc, TOLERANCE_MM, "lift")
        assert (done.lift_mm >= 0.3 - 1e-9).all() and (done.lift_mm <= 0.3 + TOLERANCE_MM).all()


def test_another_way_or_a_single_point_is_refused(post):
    for path, how in ((PATH, "push"), (PATH[:1], "lift")):
        with pytest.raises(ToolpathError):
            corrected_path(post, path, 3.0, 3.0, TOLERANCE_MM, how)
