"""Verdicts on what tapered balls, dovetails and tilted cutters leave."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.shop.cutters import Cutter
from cuspline.verification.verdict import Options, verify_setup

FINISH = Finish(scallop_mm=0.02, profile_tolerance_mm=0.004, gouge_mm=0.004)
SETUP = Setup(name="setup-1", wcs_in_words="corner", faces=("cut",))
COARSE = Options(spacing_mm=0.5, solid_pitch_mm=0.2, replay_pitch_mm=0.5, tessellation_mm=0.002)


def shaped(type_, diameter, corner, **shape):
    """A tool of that type, its neck thin enough for slots."""
    plain = tool("flat", diameter, flute=6.0, neck=0.5 * diameter)
    cutter = Cutter(**{**plain.cutter.model_dump(), "type": type_, "corner_radius_mm": corner, **shape})
    return plain.model_copy(update={"cutter": cutter})


def judged(solid, faces, stock, moves, a_tool, start, **changes):
    return verify_setup(program(start, moves, **changes), {1: a_tool}, solid, faces, setup=SETUP, finish=FINISH,
                        stock=StockBox(min_mm=stock[0], max_mm=stock[1]), ball_radius_mm=1.0, options=COARSE)


def test_a_tapered_ball_cuts_a_plane_as_a_ball_does():
    block = brep.the_solid(cq.Workplane().box(8, 6, 4, centered=False))
    top = [f for f in brep.faces_of(block) if f.middle.normal[0, 2] > 0.5]
    moves = [rapid(-4, -0.2, 6), *raster((-4, 12), np.arange(-0.2, 6.4, 0.5), 4.0), rapid(12, 6, 8)]
    ball = shaped("tapered_ball", 4.0, 2.0, taper_deg=5.0)
    v = judged(block, top, ((0, 0, 0), (8, 6, 4.5)), moves, ball, (-4, -0.2, 20))
    cusp = 2.0 - np.sqrt(4.0 - 0.0625)
    assert v.ok, [f.advice for f in v.findings]
    assert cusp - 4e-4 < v.numbers["cusp_max_mm"] <= cusp + 1e-6 and v.numbers["gouge_max_mm"] < 1e-6
    assert list(v.numbers["certificate"]["not_covered"].values()) == [len(moves)]
    proven = v.numbers["sampling"]
    assert cusp <= v.numbers["excess_proven_mm"] <= 1.02 * cusp + 2e-4
    assert proven["unproven_mm2"]["inside"] == 0 and proven["not_covered"] == []


def dovetail_slot(depth=3.0, wide=6.0, taper_deg=10.0):
    """A block with the slot that a sharp dovetail leaves along X."""
    lean = depth * np.tan(np.radians(taper_deg))
    half = wide / 2
    profile = cq.Workplane("YZ").polyline([(-half, 0), (half, 0), (half - lean, depth), (lean - half, depth)]).close().extrude(12)
    block = cq.Workplane().box(12, 14, 8, centered=(False, True, False)).translate((0, 0, -5))
    return brep.the_solid(block.cut(profile))


def test_a_dovetail_cuts_its_slot_and_a_deeper_one_is_a_gouge():
    solid = dovetail_slot()
    slot = [f for f in brep.faces_of(solid) if abs(f.middle.point_mm[0, 1]) < 3.1 and -0.1 < f.middle.point_mm[0, 2] < 2.9]
    assert len(slot) == 3
    cutter = shaped("dovetail", 6.0, 0.0, taper_deg=10.0, flute_length_mm=3.0)
    stock = ((0, -7, -5), (12, 7, 3))
    along = lambda z: [rapid(-5, 0, z), feed(17, 0, z), rapid(17, 0, 12)]
    good = judged(solid, slot, stock, along(0.0), cutter, (-5, 0, 30))
    assert {f.kind for f in good.findings} == set(), [f.advice for f in good.findings]
    # beside the sharp corners of 80 degrees no ball of 1 mm fits, but this cutter has made them
    assert good.numbers["area_unreachable_mm2"] == 0.0
    assert good.numbers["area_reached_mm2"] == pytest.approx(12 * (6 + 6 / np.cos(np.radians(10))), rel=1e-6)
    assert abs(good.residuals.deviation_mm).max() < 1e-6
    bad = judged(solid, slot, stock, along(-0.05), cutter, (-5, 0, 30))
    deepest = max(f.amount_mm for f in bad.findings if f.kind == "gouge")
    assert deepest == pytest.approx(0.05, abs=1e-6)
