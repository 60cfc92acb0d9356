"""Shapes that stand in a setup: lines through them, boxes and heights round them, and meshes that bound no solid."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cuspline.kernel import solids
from cuspline.stock.shapes import ROUND_MM, BoxShape, CylinderShape, MeshShape, closed_mesh
from cuspline.values.errors import DesignError
from cuspline.values.frames import Frame

BLOCK = BoxShape(min_mm=(0, 0, 0), max_mm=(20, 16, 12))
BAR = CylinderShape(from_mm=(1, 2, 3), to_mm=(1 + 8, 2 + 8, 3 + 4), radius_mm=5.0)      # 12 long, along (2, 2, 1) / 3
ASKEW = Frame(rotation=Rotation.from_euler("xyz", (37, 11, 45), degrees=True).as_matrix(), origin_mm=(1, 2, 3))
RNG = np.random.default_rng(1)


def as_mesh(shape):
    return closed_mesh(*shape.mesh, 0.0, "the mesh", "MESH")


def lines(count=2000, about=(5.0, 6.0, 5.0)):
    directions = RNG.normal(size=(count, 3))
    return np.array(about) + RNG.uniform(-8, 8, (count, 3)), directions / np.linalg.norm(directions, axis=1)[:, None]


def lengths(spans):
    """(n,) of one stretch each; 0 where there is none."""
    return np.diff(np.where(np.isfinite(spans), spans, 0.0), axis=1)[:, 0]


@pytest.mark.parametrize("shape, off", [(BLOCK, 0.0), (BAR, ROUND_MM)], ids=["box", "cylinder"])
def test_a_line_runs_through_a_mesh_as_through_the_shape_itself(shape, off):
    origins, directions = lines()
    one, other = shape.along(origins, directions)[:, 0], as_mesh(shape).along(origins, directions)[:, 0]
    met = np.isfinite(one[:, 0]) & np.isfinite(other[:, 0])
    assert met.sum() > 500 and (np.isfinite(one[:, 0]) != np.isfinite(other[:, 0])).sum() <= 5       # facets stand out
    deep = met & (lengths(one) > 2.0)
    np.testing.assert_allclose(other[deep], one[deep], atol=1e-6 + 20 * off)


def test_a_line_through_corners_and_along_walls_passes_in_and_out():
    """Every line of a lattice through all corners, sides and faces of a block: parallel to an axis, and diagonal."""
    mesh, steps = as_mesh(BLOCK), [np.linspace(0, top, 5) for top in (20.0, 16.0, 12.0)]
    for axis in range(3):
        across = np.array(np.meshgrid(*[s for k, s in enumerate(steps) if k != axis], indexing="ij")).reshape(2, -1).T
        spans = mesh.along(np.insert(across, axis, -7.3, axis=1), np.tile(np.eye(3)[axis], (len(across), 1)))
        length = lengths(spans[:, 0])
        inner = ((across > 0) & (across < np.delete((20.0, 16.0, 12.0), axis))).all(axis=1)
        np.testing.assert_allclose(length[inner], BLOCK.max_mm[axis], atol=1e-9)
        assert set(length.round(6)) <= {0.0, BLOCK.max_mm[axis]} and np.isinf(spans[:, 1:]).all()
    corners = mesh.mesh[0]
    way = corners[7] - corners[0]
    assert mesh.along(corners[:1] - 0.5 * way, way[None] / np.linalg.norm(way))[0, 0] == pytest.approx(
        np.array((0.5, 1.5)) * np.linalg.norm(way), abs=1e-6)


def test_what_hangs_over_a_hollow_is_two_stretches():
    low, high = BoxShape(min_mm=(0, 0, 0), max_mm=(9, 9, 2)), BoxShape(min_mm=(0, 0, 5), max_mm=(9, 9, 7))
    post = BoxShape(min_mm=(0, 0, 1), max_mm=(2, 9, 6))
    both = solids.united([s.solid for s in (low, high, post)])
    mesh = closed_mesh(*solids.mesh_of(both), 0.0, "the casting", "MESH")
    spans = mesh.along(np.array([[5.0, 5, -3], [1, 5, -3]]), np.tile((0.0, 0, 1), (2, 1)))
    assert spans[0, :2].tolist() == [[3, 5], [8, 10]] and spans[1, 0].tolist() == [3, 10] and np.isinf(spans[1, 1]).all()
    assert mesh.holds(np.array([[5.0, 5, 1], [5, 5, 3], [1, 5, 3]])).tolist() == [True, False, True]
    assert mesh.solid.volume() == pytest.approx(9 * 9 * 4 + 2 * 9 * 3)


@pytest.mark.parametrize("shape", [BLOCK, BAR], ids=["box", "cylinder"])
def test_the_box_round_a_shape_holds_it_and_no_smaller_one_does(shape):
    low, high = shape.box_in(ASKEW)
    seen = ASKEW.into(shape.mesh[0])
    assert (seen.min(axis=0) >= low - 2 * ROUND_MM).all() and (seen.max(axis=0) <= high + 2 * ROUND_MM).all()
    np.testing.assert_allclose([seen.min(axis=0), seen.max(axis=0)], [low, high], atol=4 * ROUND_MM)


def test_only_a_box_along_the_frame_fills_the_box_round_it():
    quarter = Frame(rotation=Rotation.from_euler("z", 90, degrees=True).as_matrix(), origin_mm=(0, 0, 0))
    assert BLOCK.fills_box_in(quarter) and not BLOCK.fills_box_in(ASKEW)
    assert not as_mesh(BLOCK).fills_box_in(quarter) and not BAR.fills_box_in(quarter)


def test_a_cylinder_has_its_volume_and_its_mesh_holds_all_of_it():
    want = np.pi * 25 * 12
    assert want < BAR.solid.volume() < want * (1 + 4 * ROUND_MM / 5)
    angle = RNG.uniform(0, 2 * np.pi, 500)
    across = np.linalg.svd(BAR.axis[None])[2][1:]
    rim = BAR.from_mm + 5.0 * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])
    spans = as_mesh(BAR).along(rim, np.tile(BAR.axis, (500, 1)))
    np.testing.assert_allclose(spans[:, 0], np.tile((0.0, 12.0), (500, 1)), atol=1e-9)


@pytest.mark.parametrize("shape", [BLOCK, BAR, as_mesh(BLOCK)], ids=["box", "cylinder", "mesh"])
def test_heights_within_a_radius_are_bounds(shape):
    low, high = shape.box_in(ASKEW)
    xy = RNG.uniform(low[:2] - 2, high[:2] + 2, (200, 2))
    for radius in (0.01, 0.5):
        angle, way = RNG.uniform(0, 2 * np.pi, (40, 200)), radius * np.sqrt(RNG.uniform(0, 1, (40, 200)))
        beside = xy + np.stack([way * np.cos(angle), way * np.sin(angle)], axis=-1)
        highest = shape.tops_mm(ASKEW, beside.reshape(-1, 2)).reshape(40, 200).max(axis=0)
        bound = shape.tops_within_mm(ASKEW, xy, radius)
        assert (highest <= bound + 1e-6).all()
        stands = np.isfinite(highest)
        assert np.median(bound[stands] - highest[stands]) < 2 * radius + 2 * ROUND_MM


@pytest.mark.parametrize("frame", [ASKEW, Frame.of_axes(np.zeros(3), (0.0, 0.6, 0.8), (0.0, 0.8, -0.6))], ids=["askew", "turned"])
def test_tops_of_a_mesh_are_those_of_its_columns(frame):
    mesh = as_mesh(BAR)
    low, high = mesh.box_in(frame)
    xy = RNG.uniform(low[:2] - 2, high[:2] + 2, (2000, 2))
    tops = mesh.columns(frame, xy)[..., 1]
    highest = np.where(np.isfinite(tops), tops, -np.inf).max(axis=1)
    np.testing.assert_allclose(mesh.tops_mm(frame, xy), highest, atol=1e-6)
    assert 200 < np.isfinite(highest).sum() < 1990


def test_facets_turned_out_of_upright_by_rounding_have_no_tops():
    """A block turned about X by what cosines round to: its sides look up by 1e-17, and their planes say anything."""
    mesh = as_mesh(BLOCK)
    for degrees in range(0, 360, 90):
        turn = np.radians(degrees)
        c, s = np.cos(turn), np.sin(turn)
        frame = Frame(rotation=np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]), origin_mm=np.zeros(3))
        low, high = mesh.box_in(frame)
        xy = RNG.uniform(low[:2], high[:2], (500, 2))
        np.testing.assert_allclose(mesh.tops_mm(frame, xy), high[2], atol=1e-6)


def test_meshes_that_bound_no_solid_are_refused_in_a_sentence():
    vertices, triangles = BLOCK.mesh
    for some, words in ((triangles[1:], "open, 3 sides of its 11 triangles have no neighbour"),
                        (triangles[:, ::-1], "inside out"),
                        (np.vstack([triangles, triangles[:1]]), "more than two at a side, or are turned")):
        with pytest.raises(DesignError, match=f"the casting is no closed solid: .*{words}"):
            closed_mesh(vertices, some, 0.0, "the casting", "MESH")


def test_edges_to_draw_are_those_at_which_a_shape_turns():
    assert len(BLOCK.edges_mm) == len(as_mesh(BLOCK).edges_mm) == 12
    ends = np.array([a for a, _ in BAR.edges_mm])
    away = np.abs((ends - BAR.from_mm) @ BAR.axis)
    assert set(away.round(6)) == {0.0, 12.0} and isinstance(as_mesh(BAR), MeshShape)
