"""An edge sharper than the cut is deep: what is taken off counts as deep as the cutter goes, not as the air behind it."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.verification.verdict import Judging, Options, SetupProgram, verify_setups

HALF_RAD = np.radians(1.0)          # of the knife: 1 mm from its edge it is 0.035 mm thick
LONG_MM, WIDE_MM, RADIUS_MM, STEP_MM = 20.0, 16.0, 5.0, 0.3
FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
THICK_MM = LONG_MM * np.tan(HALF_RAD)
KNIFE = brep.the_solid(cq.Workplane("XZ").polyline([(0, 0), (LONG_MM, -THICK_MM), (LONG_MM, THICK_MM)]).close().extrude(-WIDE_MM))
SIDES = 1.0, -1.0                   # above, below


def normal(side):
    return np.array([-np.sin(HALF_RAD), 0.0, side * np.cos(HALF_RAD)])


def ground_from(side, deep_mm):
    """SetupProgram: one of the knife's sides in passes along it, so much too deep."""
    ys = np.arange(-0.3, WIDE_MM + 0.3, STEP_MM)
    posted = program((-6, -0.3, 40), [rapid(-6, -0.3, 9), *raster((-6, 26), ys if side > 0 else -ys, -deep_mm), rapid(26, 16, 9)])
    along = np.array([np.cos(HALF_RAD), 0.0, side * np.sin(HALF_RAD)])
    setup = Setup(name=f"side {side:+g}", wcs_in_words="edge", faces=("side",), wcs_x=tuple(along.tolist()),
                  wcs_z=tuple(normal(side).tolist()))
    faces = [f for f in brep.faces_of(KNIFE) if f.middle.normal[0] @ normal(side) > 0.9999]
    return SetupProgram(posted=posted, setup=setup, faces=tuple(faces))


def knife(*deep_mm):
    """SetupVerdicts of both sides."""
    judging = Judging(tools={1: tool("ball", 2 * RADIUS_MM)}, finish=FINISH, ball_radius_mm=3.0,
                      stock=StockBox(min_mm=(-1, 0, -1), max_mm=(LONG_MM, WIDE_MM, 1)),
                      options=Options(spacing_mm=0.25, solid_pitch_mm=0.2, replay_pitch_mm=0.5, tessellation_mm=0.002))
    return verify_setups([ground_from(side, deep) for side, deep in zip(SIDES, deep_mm)], KNIFE, judging)


def test_a_razors_edge_is_cut_no_deeper_than_the_cutter_goes():
    """Both sides 0.002 mm too deep: the edge goes back by 0.11 mm, and nothing stands behind it on 6 mm; 0.003 mm are allowed."""
    found = knife(0.002, 0.002)
    assert [f.kind for v in found for f in v.findings] == []
    assert [v.numbers["gouge_max_mm"] for v in found] == pytest.approx([0.002, 0.002], abs=1e-5)


@pytest.mark.parametrize("deep_mm", [(0.0045, 0.002), (0.002, 0.0045)])
def test_a_side_cut_deeper_than_allowed_is_a_gouge_of_that_side(deep_mm):
    found = knife(*deep_mm)
    for v, deep in zip(found, deep_mm):
        gouges = [f.amount_mm for f in v.findings if f.kind == "gouge"]
        assert gouges == pytest.approx([deep] * (deep > FINISH.gouge_mm), abs=2e-4)
