"""Holes of a solid: what they are, where, how deep; fillets, grooves and bosses are none."""

import math

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.surfaces.holes import holes_of
from cuspline.surfaces.prismatic_features import features_of

BLOCK = cq.Workplane("XY").box(60, 40, 12, centered=False)


def top(x, y):
    return cq.Workplane("XY", origin=(0, 0, 12)).pushPoints([(x, y)])


def found(part):
    return holes_of(brep.faces_of(brep.the_solid(part.val())))


def cut(x, y, *rows):
    """A body of revolution about an upright axis: rows of (radius, height), from below."""
    points = [(0.0, rows[0][1]), *rows, (0.0, rows[-1][1])]
    return cq.Workplane("XZ").polyline(points).close().revolve(360, (0, 0, 0), (0, 1, 0)).translate((x, y, 0))


def test_a_plate_of_many_holes_gives_each_with_its_measures():
    part = (BLOCK.cut(cut(10, 10, (3, -1), (3, 13))).cut(cut(30, 10, (4, 5), (4, 13)))
            .cut(cut(50, 10, (2.5, -1), (2.5, 8), (4.5, 8), (4.5, 13))).cut(cut(10, 30, (2, -1), (2, 9), (6, 13)))
            .edges("|Z and (>X or <X)").fillet(3.0))
    by_kind = {h.kind: h for h in found(part)}
    assert set(by_kind) == {"through", "blind", "stepped through", "countersunk through"}
    through, blind, stepped, sunk = (by_kind[k] for k in ("through", "blind", "stepped through", "countersunk through"))
    assert 2 * through.bore.low_radius_mm == pytest.approx(6) and through.depth_mm == pytest.approx(12)
    np.testing.assert_allclose(blind.mouth_mm, (30, 10, 12), atol=1e-9)
    assert blind.depth_mm == pytest.approx(7) and len(blind.floor) == 1 and blind.point_angle_deg is None
    assert [round(w.low_radius_mm, 6) for w in stepped.walls] == [2.5, 4.5] and stepped.axis[2] == 1
    assert sunk.walls[-1].kind == "cone" and sunk.walls[-1].high_radius_mm == pytest.approx(5.0)


def test_a_drilled_point_has_its_angle_and_is_where_the_tip_stops():
    rise = 3 / math.tan(math.radians(59))
    hole, = found(BLOCK.cut(cq.Workplane("XZ").polyline([(0, 4), (3, 4 + rise), (3, 20), (0, 20)]).close()
                            .revolve(360, (0, 0, 0), (0, 1, 0)).translate((20, 20, 0))))
    assert hole.kind == "blind" and hole.point_angle_deg == pytest.approx(118)
    wall = hole.walls[-1]
    at = lambda angle: hole.point_mm[2] + hole.lowest_tip_mm(wall, 3.0, 1 / math.tan(math.radians(angle / 2)))
    assert at(118) == pytest.approx(4)                      # the same point
    assert at(90) == pytest.approx(4)                       # a sharper one stands on the cone's own point


def test_a_flat_bottom_holds_the_tip_off_and_a_ledge_what_overlaps_it():
    blind, = found(BLOCK.cut(cut(30, 10, (4, 5), (4, 13))))
    assert blind.point_mm[2] + blind.lowest_tip_mm(blind.walls[0], 4.0, 0.5) == pytest.approx(5)
    stepped, = found(BLOCK.cut(cut(30, 10, (2, -1), (2, 8), (4, 8), (4, 13))))
    assert stepped.point_mm[2] + stepped.lowest_tip_mm(stepped.walls[1], 4.0, 0.5) == pytest.approx(8 - 2 * 0.5)


def test_a_hole_turned_with_its_part_is_the_same_hole():
    part = BLOCK.cut(cut(30, 10, (4, 5), (4, 13)))
    turned = part.rotate((0, 0, 0), (1, 2, 3), 77.0)
    one, other = found(part)[0], found(turned)[0]
    assert other.kind == one.kind and other.depth_mm == pytest.approx(one.depth_mm)
    mouth = cq.Vertex.makeVertex(*one.mouth_mm).rotate((0, 0, 0), (1, 2, 3), 77.0).toTuple()
    np.testing.assert_allclose(other.mouth_mm, mouth, atol=1e-9)


@pytest.mark.parametrize("part", [
    BLOCK.edges("|Z").fillet(4.0), BLOCK.union(cut(30, 20, (5, 10), (5, 20))),
    BLOCK.faces(">Z").workplane().slot2D(20, 6).cutThruAll(),
    cq.Workplane("XY").sphere(9.0)], ids=["rounded edges", "a boss", "a slot", "a ball"])
def test_what_does_not_go_all_round_from_outside_is_no_hole(part):
    assert found(part) == ()


def test_two_walls_of_a_fork_are_two_holes():
    fork = cq.Workplane("XY").box(30, 30, 20).cut(cq.Workplane("XY").box(40, 40, 8)).union(
        cq.Workplane("XY").box(30, 4, 20).translate((0, 13, 0))).cut(cq.Workplane("XY").circle(4).extrude(60, both=True))
    assert [(h.kind, round(h.depth_mm, 6)) for h in found(fork)] == [("through", 6.0)] * 2


def ring(inner, outer, low):
    return cq.Workplane("XY", origin=(20, 20, low)).circle(outer).circle(inner).extrude(20)


def test_a_groove_round_an_island_is_a_pocket_and_no_hole():
    part = BLOCK.cut(ring(5.0, 9.0, 8.0))
    assert found(part) == ()
    solid = brep.faces_of(brep.the_solid(part.val()))
    pocket, = (f for f in features_of(solid) if f.kind == "pocket")
    assert len(pocket.faces) == 3 and pocket.size_mm == pytest.approx(4.0)
