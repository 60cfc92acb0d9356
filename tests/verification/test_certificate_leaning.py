"""The certificate's bounds for cutters with a point: moves of one hole taken together say the same as each alone."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.replay.clearance import ToolMoves, flute_segments
from cuspline.shop.cutters import Cutter
from cuspline.verification import certificate_leaning
from cuspline.verification.certificate_leaning import LeaningViews

DRILL = Cutter(name="drill 6", type="drill", diameter_mm=6.0, corner_radius_mm=0.0, flutes=2, flute_length_mm=40.0,
               neck_diameter_mm=6.0, reach_mm=40.0, shank_diameter_mm=6.0, overall_length_mm=80.0, point_angle_deg=118.0)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def views():
    block = cq.Workplane().box(20, 12, 8, centered=(True, True, False))
    plate = block.faces(">Z").workplane().pushPoints([(-5, 0), (5, 0)]).hole(6.0)
    return LeaningViews(solid=brep.the_solid(plate.val()), thickness_mm=0.001, tolerance_mm=0.002)


def pecks(x_mm, depths_mm):
    """Down to each depth below the plate's top and up again."""
    heights = np.concatenate([[13.0], *[(8.0 - d, 13.0) for d in depths_mm]])
    tips = np.column_stack([np.full(len(heights), x_mm), np.zeros(len(heights)), heights])
    axes = np.tile(UP, (len(tips) - 1, 1))
    return ToolMoves(start_tips_mm=tips[:-1], end_tips_mm=tips[1:], start_axes=axes, end_axes=axes)


def joined(*parts):
    return ToolMoves(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in vars(parts[0])})


@pytest.mark.parametrize("x_mm, is_clear", [(5.0, True), (5.03, False)])
def test_pecks_of_one_hole_are_proven_together_as_each_alone(views, monkeypatch, x_mm, is_clear):
    moves = joined(pecks(-5.0, (3.0, 6.0, 9.0, 11.0)), pecks(x_mm, (4.0, 11.0)))
    segments = flute_segments(DRILL)
    asked = []
    certified = certificate_leaning.ClearanceTree.certified_clearance
    monkeypatch.setattr(certificate_leaning.ClearanceTree, "certified_clearance",
                        lambda self, s, some, *rest, **named: asked.append(len(some.start_tips_mm)) or certified(
                            self, s, some, *rest, **named))
    depth, _ = views._cones(segments, moves, 0.0)
    assert asked[0] == 2 and (len(asked) == 1) == is_clear
    monkeypatch.setattr(certificate_leaning, "_plunges", lambda moves: (moves.only(slice(0)), np.full(len(moves.start_axes), -1)))
    alone, _ = views._cones(segments, moves, 0.0)
    np.testing.assert_array_equal(depth, alone)
    assert (depth[-4:].max() > 0.02) != is_clear and depth[:8].max() < 0.002


def test_a_move_that_is_not_along_the_axis_is_part_of_no_plunge():
    aside = ToolMoves(start_tips_mm=np.array([[0, 0, 9.0], [0, 0, 9.0]]), end_tips_mm=np.array([[0, 0, 2.0], [0.01, 0, 2.0]]),
                      start_axes=np.array([UP, UP]), end_axes=np.array([UP, UP]))
    plunges, of_plunge = certificate_leaning._plunges(aside)
    assert of_plunge.tolist() == [0, -1] and plunges.end_tips_mm.tolist() == [[0, 0, 2.0]]
