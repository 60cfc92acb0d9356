"""Samples lie exactly on the B-rep, meshes are closed and within their deviation, volumes are closed forms."""

from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from manifold3d import Manifold, OpType
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from cuspline.kernel import brep, solids, tessellation
from cuspline.kernel.tessellation import tessellate
from cuspline.surfaces.projection import ClosestTree
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values.clusters import clusters_of
from cuspline.values.errors import DesignError, SimulationError
from cuspline.values.frames import Frame
from cuspline.verification.reach import drop_mesh, upper
from cuspline.verification.samples import INSIDE_MM, sample_faces
from cuspline.verification.solid_check import _Seen, outlines

BLOCK = brep.the_solid(cq.Workplane().box(30, 20, 10, centered=False).faces(">Z").workplane(centerOption="CenterOfMass").hole(6, 4)
                       .edges("|Z").edges("not %CIRCLE").fillet(2))
SHAPES = {
    "sphere": (cq.Solid.makeSphere(10, angleDegrees1=-90, angleDegrees2=90), 4 / 3 * np.pi * 1000),
    "cone": (cq.Solid.makeCone(5, 0, 10), np.pi * 25 * 10 / 3),
    "torus": (cq.Solid.makeTorus(10, 3), 2 * np.pi**2 * 10 * 9),
    "cylinder": (cq.Solid.makeCylinder(5, 12), np.pi * 25 * 12),
}


@pytest.mark.parametrize("name", SHAPES)
def test_tessellation_is_closed_and_as_close_as_it_says(name):
    shape, volume = SHAPES[name]
    solid = brep.the_solid(shape)
    mesh = tessellate(solid, 0.01)
    have = solids.solid_of(mesh.vertices_mm, mesh.triangles).volume()
    area = sum(f.area_mm2 for f in brep.faces_of(solid))
    assert mesh.deviation_mm <= 0.01 and -area * 0.01 < have - volume < 0


@pytest.mark.parametrize("name", SHAPES)
def test_samples_are_on_the_surface_with_outward_normals_and_cover_it(name):
    faces = brep.faces_of(brep.the_solid(SHAPES[name][0]))
    s = sample_faces(faces, 0.5)
    area = sum(f.area_mm2 for f in faces)
    assert abs(s.weight_mm2.sum() / area - 1) < 1e-9
    x, y, z = s.points_mm.T
    rho = np.hypot(x, y)
    curved = s.face == 0
    inside = {"sphere": np.linalg.norm(s.points_mm, axis=1) - 10, "cone": (rho - 5 * (1 - z / 10)),
              "torus": np.hypot(rho - 10, z) - 3, "cylinder": rho - 5}[name]
    assert np.abs(inside[curved]).max() < 1e-9
    flux = (s.weight_mm2 * np.einsum("nc,nc->n", s.points_mm, s.normals)).sum() / 3      # divergence theorem
    assert abs(flux / SHAPES[name][1] - 1) < 2e-3
    heavy = s.weight_mm2[curved & ~s.is_border]
    assert heavy.max() < 0.5 * 0.5


def test_no_place_is_farther_from_a_sample_than_the_spacing():
    top = [f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > 0.9 and f.area_mm2 > 100]
    s = sample_faces(top, 0.8)
    rng = np.random.default_rng(0)
    p = np.column_stack([rng.uniform((2, 2), (28, 18), (4000, 2)), np.full(4000, 10.0)])
    p = p[np.hypot(p[:, 0] - 15, p[:, 1] - 10) > 3]
    assert cKDTree(s.points_mm).query(p)[0].max() < 0.8


def test_trimmed_borders_are_respected_and_followed():
    top = [f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > 0.9 and f.area_mm2 > 100]
    s = sample_faces(top, 0.5)
    to_hole = np.hypot(s.points_mm[:, 0] - 15, s.points_mm[:, 1] - 10) - 3
    assert to_hole.min() > 0.99 * INSIDE_MM
    rim = to_hole[s.is_border]
    assert abs(rim.min() - INSIDE_MM) < 1e-6 and (rim < 2 * INSIDE_MM).sum() >= 6 * np.pi / 0.5
    left = s.points_mm[s.is_border, 0]
    assert abs(left.min() - INSIDE_MM) < 1e-9


def test_samples_are_the_same_every_time():
    faces = brep.faces_of(BLOCK)
    a, b = sample_faces(faces, 1.0), sample_faces(faces, 1.0)
    assert (a.points_mm == b.points_mm).all() and (a.weight_mm2 == b.weight_mm2).all()


def test_height_field_has_the_volume_under_it():
    xs, ys = np.linspace(0, 4, 9), np.linspace(0, 3, 7)
    z = 1 + 0.25 * xs[None, :] + 0.5 * ys[:, None]
    assert abs(solids.height_field(xs, ys, z, 0.0).volume() - 12 * (1 + 0.5 + 0.75)) < 1e-9
    through = np.where((xs[None, :] > 1) & (xs[None, :] < 3) & (ys[:, None] > -1), -5.0, 2.0)
    assert abs(solids.height_field(xs, ys, through, 0.0).volume() - 2 * 3 * 2 * (1 + 0.25)) < 0.01


@pytest.mark.parametrize("rows, columns, low, high", [
    (slice(5, 12), slice(8, 30), 1.0, 4.0), (slice(0, 8), slice(0, 41), 1.0, 4.0), (slice(0, 21), slice(0, 41), -1.0, 5.0),
    (slice(6, 10), slice(0, 12), -1.0, -1.0)], ids=["inside", "along borders", "everywhere", "through a side"])
def test_what_lies_over_a_field_taken_off_leaves_the_field(rows, columns, low, high):
    """To the last triangle's rounding; no hair stays standing along the billet's sides."""
    xs, ys, z = np.linspace(0, 20, 41), np.linspace(0, 10, 21), np.full((21, 41), 5.0)
    z[rows, columns] = np.random.default_rng(1).uniform(low, high, z[rows, columns].shape)
    field = solids.height_field(xs, ys, z, 0.0)
    left = solids.less(solids.box((0, 0, 0), (20, 10, 5)), [solids.over_field(xs, ys, z, 0.0, 5.0)])
    assert abs((field - left).volume()) < 1e-12 and abs((left - field).volume()) < 1e-12
    assert len(solids.bodies_of(left, 0.0)) == len(solids.bodies_of(field, 0.0))


def test_over_a_field_that_nothing_has_lowered_lies_nothing():
    assert solids.over_field(np.linspace(0, 2, 3), np.linspace(0, 1, 2), np.full((2, 3), 5.0), 0.0, 5.0) is None


def test_bodies_are_told_apart():
    pair = solids.prism_over([np.array([(0, 0), (1, 0), (1, 1), (0, 1)]),
                              np.array([(5, 0), (7, 0), (7, 1), (5, 1)])], 0.0, 2.0)
    found = solids.bodies_of(pair, 1e-6)
    assert [round(b.volume_mm3, 9) for b in found] == [4.0, 2.0]


def test_bodies_are_those_of_the_kernel():
    """Two ways: components of the mesh, and manifold3d's own decomposition, which takes the square of their number."""
    rng = np.random.default_rng(3)
    balls = [Manifold.sphere(r, 16).translate(tuple(p)) for r, p in zip(rng.uniform(0.1, 0.6, 60),
                                                                      rng.uniform(1e3, 1e3 + 8, (60, 3)))]
    solid = Manifold.batch_boolean(balls, OpType.Add) - Manifold.cube((4.0, 4.0, 4.0)).translate((1002, 1002, 1002))
    found = solids.bodies_of(solid, 1e-6)
    known = sorted((p for p in solid.decompose() if p.volume() > 1e-6), key=lambda p: -p.volume())
    assert len(found) == len(known) > 30
    for body, piece in zip(found, known):
        assert body.volume_mm3 == pytest.approx(piece.volume(), abs=1e-9)
        assert body.area_mm2 == pytest.approx(piece.surface_area(), abs=1e-9)
        assert len(body.vertices_mm) == piece.num_vert()


def test_a_union_in_the_plane_is_the_same_in_any_portions(monkeypatch):
    rng = np.random.default_rng(4)
    corners = rng.uniform(0, 50, (400, 1, 2)) * [1.0, 0.1] + rng.uniform(-1.5, 1.5, (400, 3, 2))
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    corners = corners[e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0] > 1e-3]
    volumes = []
    for size in (10, 10_000):
        monkeypatch.setattr(solids, "POLYGONS_AT_ONCE", size)
        volumes.append(solids.prism_over(list(corners), 0.0, 2.0).volume())
    assert volumes[0] == pytest.approx(volumes[1], abs=1e-5) and volumes[0] > 100


def test_outlines_bound_the_same_place_as_all_their_triangles():
    """Two plates that touch in a corner, one of them with a hole; the outer loops run round one way, the hole's the other."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(9.0), np.arange(9.0)))
    cells = [(i, j) for i in range(8) for j in range(8) if (i < 4) == (j < 4) and (i, j) != (1, 2)]
    triangles = np.array([t for i, j in cells for a in [9 * j + i] for t in ((a, a + 1, a + 10), (a, a + 10, a + 9))])
    points = np.column_stack([x, y])
    loops = [points[loop] for loop in outlines(triangles)]
    whole, outline = solids.prism_over(list(points[triangles]), 0.0, 2.0), solids.prism_within(loops, 0.0, 2.0)
    assert outline.volume() == pytest.approx(2.0 * len(cells), abs=1e-9)
    assert (whole - outline).volume() == pytest.approx(0.0, abs=1e-9)
    assert sum(len(loop) for loop in loops) == 16 + 16 + 4 and outlines(triangles[:0]) == []


def test_a_place_on_the_top_beside_a_hole_is_not_deep():
    """The nearest samples are those of the hole's wall: along their normal such a place would lie as far off as it lies beside."""
    faces = brep.faces_of(BLOCK)
    wall = [f for f in faces if f.kind == "cylinder"]
    seen = _Seen(SimpleNamespace(samples=sample_faces([f.shape for f in wall], 0.5)), Frame.shift((0.0, 0.0, 0.0)),
                 SimpleNamespace(surface=ClosestTree.of_faces(faces)))
    turn = np.linspace(0.1, 6.2, 9)
    beside = lambda r, z: np.column_stack([15 + r * np.cos(turn), 10 + r * np.sin(turn), np.full(9, z)])
    deepest = lambda places: seen.deepest(places, seen.at_most(places)[1])[0]
    assert deepest(beside(3.03, 10.0)) < 1e-9
    assert deepest(beside(3.03, 8.0)) == pytest.approx(0.03, rel=0.1)    # in the metal of the wall; normals 10 degrees off


def test_what_leans_over_a_face_but_stands_on_another_does_not_count_there():
    """Of places off a hole's wall and off the top beside it only those count whose nearest face is one that is cut."""
    faces = brep.faces_of(BLOCK)
    wall = [k for k, f in enumerate(faces) if f.kind == "cylinder"]
    seen = _Seen(SimpleNamespace(samples=sample_faces([faces[k].shape for k in wall], 0.5)), Frame.shift((0.0, 0.0, 0.0)),
                 SimpleNamespace(surface=ClosestTree.of_faces(faces)), wall)
    off_wall, off_top = np.array([[15 + 2.8, 10.0, 8.0]]), np.array([[15 + 3.5, 10.0, 10.3]])
    assert seen.any_counts(off_wall) and not seen.any_counts(off_top) and not seen.any_counts(off_top[:0])
    far = np.array([0.5])
    assert seen.deepest(off_wall, far)[0] == pytest.approx(0.2, rel=1e-6) and seen.deepest(off_top, far)[0] == -1.0
    assert seen.deepest(np.vstack([off_top, off_wall]), np.array([0.5, 0.5]))[1] == 1
    everywhere = _Seen(seen.found, seen.frame, seen.part)
    assert everywhere.any_counts(off_top) and everywhere.deepest(off_top, far)[0] == pytest.approx(0.3, rel=1e-6)


def test_the_deepest_of_many_places_is_that_of_all_but_few_are_asked():
    """A plug in a blind hole: deepest where its wall and its floor are as far; the faces are asked for some of its places."""
    faces, asked = brep.faces_of(BLOCK), []
    surface = ClosestTree.of_faces(faces)
    counted = SimpleNamespace(closest_points=lambda p: (asked.append(len(p)), surface.closest_points(p))[1])
    wall = [f.shape for f in faces if f.kind == "cylinder"]
    seen = _Seen(SimpleNamespace(samples=sample_faces(wall, 0.5)), Frame.shift((0.0, 0.0, 0.0)), SimpleNamespace(surface=counted))
    rng = np.random.default_rng(2)
    radius, turn = 2.9 * np.sqrt(rng.uniform(0.001, 1.0, 3000)), rng.uniform(0, 6.28, 3000)
    places = np.column_stack([15 + radius * np.cos(turn), 10 + radius * np.sin(turn), rng.uniform(6.2, 9.8, 3000)])
    at_most = seen.at_most(places)[1]
    depth, row = seen.deepest(places, at_most)
    everywhere = np.minimum(at_most, surface.closest_points(places).distance_mm)
    assert depth == everywhere.max() and row == everywhere.argmax() and depth > 1.5
    assert sum(asked) < 1000


def test_what_comes_from_above_rests_on_the_triangles_that_do_not_look_down():
    """Half of a solid's triangles answer as all do, from six sides: balls, flat cutters and a pin."""
    solid = cq.Workplane().box(20, 14, 8).faces(">Z").workplane().sphere(6).faces("<Z").workplane().hole(5).edges("|Z").fillet(2)
    mesh, rng = tessellate(solid.val().wrapped, 0.05), np.random.default_rng(2)
    for axis in np.vstack([np.eye(3), -np.eye(3)]):
        vertices = Frame.of_axes((0, 0, 0), np.roll(axis, 1), axis).into(mesh.vertices_mm)
        some = upper(vertices, mesh.triangles)
        assert len(some) < len(mesh.triangles)
        half, whole = drop_mesh(vertices, some), drop_mesh(vertices, mesh.triangles)
        xy = rng.uniform(vertices.min(axis=0)[:2] - 4, vertices.max(axis=0)[:2] + 4, (3000, 2))
        for radii in ((3.0, 3.0), (3.0, 0.0), (3.0, 1.0), (0.001, 0.0)):
            assert_allclose(drop_tips_mm(half, xy, *radii), drop_tips_mm(whole, xy, *radii), atol=1e-12, rtol=0)   # edges of both


def test_an_open_mesh_is_refused():
    with pytest.raises(SimulationError, match="watertight"):
        solids.solid_of([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 2, 1), (0, 1, 3), (1, 2, 3)])


def test_a_deviation_out_of_reach_is_refused(monkeypatch):
    monkeypatch.setattr(tessellation, "_deviation_mm", lambda part: 0.5)
    with pytest.raises(DesignError, match="mesher"):
        tessellation.tessellate(BLOCK, 0.1)


def test_clusters_are_connected_groups():
    points = np.array([(0, 0, 0), (5, 0, 0), (0.4, 0, 0), (5.3, 0.2, 0), (0.9, 0, 0)])
    assert [sorted(g.tolist()) for g in clusters_of(points, 0.5)] == [[0, 2, 4], [1, 3]]
