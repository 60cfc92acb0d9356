"""Regions of a cutter over wanted faces, and what a larger cutter leaves."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.values.errors import ToolpathError

PITCH_MM = 0.25


def part(work):
    solid = brep.the_solid(work)
    return brep.faces_of(solid), brep.planning_mesh(solid, 0.005)


@pytest.fixture(scope="module")
def plate():
    """A plate 30 x 20 x 5 with a through hole of 8 and a boss of 6 x 6, 3 high."""
    return part(cq.Workplane().box(30, 20, 5, centered=False).faces(">Z").workplane(origin=(8, 10, 5)).hole(8)
                .faces(">Z").workplane(origin=(22, 10, 5)).rect(6, 6).extrude(3))


def floor_of(faces, z):
    return [i for i, f in enumerate(faces) if f.kind == "plane" and abs(f.middle.point_mm[0, 2] - z) < 1e-6
            and f.middle.normal[0, 2] > 0.99]


def test_the_region_over_a_plane_leaves_out_hole_island_and_outside(plate):
    faces, mesh = plate
    field = tip_field(MeshDropper.of(mesh, 1.5, 1.5), floor_of(faces, 5.0), ((0, 0), (30, 20)), PITCH_MM)
    x, y = field.node_xy_mm[..., 0], field.node_xy_mm[..., 1]
    beside_boss = np.hypot(np.maximum(np.abs(x - 22) - 3, 0), np.maximum(np.abs(y - 10) - 3, 0)) > 1.5 + 1e-6
    on_plate = (x > 1e-6) & (x < 30 - 1e-6) & (y > 1e-6) & (y < 20 - 1e-6)
    wanted = on_plate & beside_boss & (np.hypot(x - 8, y - 10) > 4 + 1e-6)
    border = np.abs(np.hypot(x - 8, y - 10) - 4) < 0.02
    assert (field.is_inside == wanted)[~border & ~(np.abs(x * (x - 30) * y * (y - 20)) < 1e-6)].all()
    assert np.abs(field.tip_z_mm[field.is_inside] - 5.0).max() < 1e-9


def test_the_cutter_runs_over_outer_edges_as_far_as_asked(plate):
    faces, mesh = plate
    field = tip_field(MeshDropper.of(mesh, 1.5, 1.5), floor_of(faces, 5.0), ((0, 0), (30, 20)), PITCH_MM, 0.5)
    beyond = field.node_xy_mm[field.is_inside, 0].min()
    assert -0.5 - 1e-9 <= beyond <= -0.5 + PITCH_MM
    xy = np.array([[-0.2, 3.0], [-0.4, 3.0], [-0.6, 3.0], [-1.0, 3.0]])
    assert field.holds(xy, field.dropper.contacts(xy)).tolist() == [True, True, False, False]


def test_a_region_is_narrowed_to_the_neighbourhood_of_its_seeds(plate):
    faces, mesh = plate
    field = tip_field(MeshDropper.of(mesh, 1.5, 1.5), floor_of(faces, 5.0), ((0, 0), (30, 20)), PITCH_MM)
    x = field.node_xy_mm[..., 0]
    near = field.narrowed(x < 3.0, 2.0)
    twice = near.narrowed(x > 4.0, 0.5)
    for narrowed, low, high in ((near, -np.inf, 5.0), (twice, 3.5, 5.0)):
        wanted = field.is_inside & (x > low - PITCH_MM) & (x < high)
        assert (narrowed.is_inside <= wanted).all() and narrowed.is_inside[wanted].mean() > 0.8
        assert (narrowed.is_inside == (field.is_inside & (narrowed.rest_mm <= 0.0))).all()


def test_a_ridge_between_two_wanted_faces_belongs_to_the_region():
    faces, mesh = part(cq.Workplane("XZ").polyline([(0, 0), (20, 0), (20, 4), (10, 10), (0, 4)]).close().extrude(-12))
    roof = [i for i, f in enumerate(faces) if f.middle.normal[0, 2] > 0.5]
    field = tip_field(MeshDropper.of(mesh, 2.0, 2.0), roof, ((0, 0), (20, 12)), PITCH_MM)
    ridge = (np.abs(field.node_xy_mm[..., 0] - 10) < 0.9) & (np.abs(field.node_xy_mm[..., 1] - 6) < 5)
    assert field.is_edge[ridge].all() and field.is_inside[ridge].all()


def test_faces_that_no_cutter_touches_from_above_are_refused(plate):
    faces, mesh = plate
    below = [i for i, f in enumerate(faces) if f.middle.normal[0, 2] < -0.99]
    with pytest.raises(ToolpathError, match="touches none"):
        tip_field(MeshDropper.of(mesh, 1.5, 1.5), below, ((0, 0), (30, 20)), PITCH_MM)
