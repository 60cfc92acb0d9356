"""Closest points against the CAD kernel's, against brute force, and on parts where they are known."""

import cadquery as cq
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from known_surfaces import bspline, face_of, kinds, random_weights, round_pocket_block, wavy_poles, wedge
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_IN
from OCP.TopoDS import TopoDS_Compound

from cuspline.kernel.brep import Face, faces_of, seen_from, the_solid
from cuspline.surfaces.face_pieces import INSIDE
from cuspline.surfaces.projection import CHUNK, ClosestTree, refined
from cuspline.surfaces.projection_tree import RECTANGLE, TINY_MM
from cuspline.surfaces.round_pieces import RADIUS, least_square
from cuspline.values.errors import PlanError
from cuspline.values.frames import Frame

SAME_MM = 1e-7


def of_the_kernel(faces, points):
    """(n,) distances by BRepExtrema_DistShapeShape."""
    shape, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(shape)
    for face in faces:
        builder.Add(shape, face.shape)
    vertex = lambda p: BRepBuilderAPI_MakeVertex(gp_Pnt(*p.tolist())).Vertex()
    return np.array([BRepExtrema_DistShapeShape(vertex(p), shape).Value() for p in points])


def around(faces, count, seed=0, margin=8.0):
    corners = np.concatenate([(f.nurbs.poles[..., :3] / f.nurbs.poles[..., 3:]).reshape(-1, 3) for f in faces])
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    return np.random.default_rng(seed).uniform(low, high, (count, 3))


def is_consistent(tree, points, found):
    """The answer is a point of the face at (u, v), at the distance given, square to the face unless on an edge."""
    np.testing.assert_allclose(np.linalg.norm(found.point_mm - points, axis=1), found.distance_mm, atol=1e-10)
    on_face = tree.patches.derivatives(found.face, found.u, found.v)[:, 0]
    np.testing.assert_allclose(on_face, found.point_mm, rtol=0, atol=1e-6)      # an edge and its face: their tolerance
    return True


PARTS = {
    "pocket": lambda: round_pocket_block(),
    "drilled": lambda: cq.Workplane("XY").box(40, 30, 12).faces(">Z").workplane().pushPoints([(-8, 3), (9, -2)]).hole(7)
    .faces("<Z").edges().chamfer(1.0),
    "cone, sphere, torus": lambda: cq.Workplane(obj=cq.Solid.makeCone(9, 0, 12)).union(
        cq.Workplane("XY").sphere(6).translate((14, 0, 4))).union(
        cq.Workplane(obj=cq.Solid.makeTorus(8, 2)).translate((-14, 3, 0))).rotate((0, 0, 0), (1, 2, 3), 35),
}


@pytest.mark.parametrize("name", PARTS)
def test_distances_to_parts_are_those_of_the_kernel(name):
    faces = [f for s in cq.Workplane(obj=PARTS[name]().val()).solids().vals() for f in faces_of(the_solid(s))]
    points = around(faces, 150)
    tree = ClosestTree.of_faces(faces)
    found = tree.closest_points(points)
    np.testing.assert_allclose(found.distance_mm, of_the_kernel(faces, points), rtol=0, atol=SAME_MM)
    assert is_consistent(tree, points, found)


@pytest.mark.parametrize("name", sorted(set(kinds()) - {"offset"}))
def test_distances_to_a_face_of_every_kind_are_those_of_the_kernel(name):
    face = kinds()[name]
    points = around([face], 60, seed=1)
    tree = ClosestTree.of_faces([face])
    found = tree.closest_points(points)
    theirs = of_the_kernel([face], points)
    assert (found.distance_mm <= theirs + SAME_MM).all()
    # where the kernel's answer is farther, ours is a point of the face nonetheless: its search had missed it
    assert (np.abs(found.distance_mm - theirs) <= SAME_MM).mean() > 0.95 and is_consistent(tree, points, found)


def pierced_sheet(seed):
    sheet = cq.Face(face_of(bspline(wavy_poles(seed, height=2.0), random_weights(seed))).shape)
    circle = cq.Wire.makeCircle(6, cq.Vector(18, 14, -60), cq.Vector(0, 0, 1))
    bore = cq.Solid.extrudeLinear(circle, [], cq.Vector(0, 0, 120))
    return Face(sheet.cut(bore).Faces()[0].wrapped)


@pytest.mark.parametrize("seed", [1, 2])
def test_over_a_hole_the_nearest_point_lies_on_its_border(seed):
    face = pierced_sheet(seed)
    tree = ClosestTree.of_faces([face])
    points = np.random.default_rng(0).uniform((13, 9, -8), (23, 19, 8), (60, 3))
    found = tree.closest_points(points)
    np.testing.assert_allclose(found.distance_mm, of_the_kernel([face], points), rtol=0, atol=SAME_MM)
    assert found.is_edge.mean() > 0.5 and is_consistent(tree, points, found)


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2 ** 32 - 1))
@example(seed=189)      # weights that no piece as wide as the face can tell from 0
def test_no_sample_of_a_random_sheet_is_nearer_than_the_answer(seed):
    face = face_of(bspline(wavy_poles(seed), random_weights(seed)))
    tree = ClosestTree.of_faces([face])
    t = np.linspace(0, 1, 160)
    u, v = (a.ravel() for a in np.meshgrid(t, t, indexing="ij"))
    samples = face.nurbs.derivatives(u, v)[:, 0]
    points = around([face], 12, seed % 1000, margin=15.0)
    found = tree.closest_points(points)
    nearest = np.array([np.linalg.norm(samples - p, axis=1).min() for p in points])
    assert (found.distance_mm <= nearest + 1e-9).all()
    # one sample is never farther from the foot than a cell: the answer is no lower than it can be
    np.testing.assert_allclose(found.distance_mm, nearest, atol=1.0)
    assert is_consistent(tree, points, found)


def test_points_on_the_face_come_back_as_they_are():
    face = kinds()["bspline"]
    u, v = np.random.default_rng(0).uniform(0.01, 0.99, (2, 500))
    shape = face.shape_at(u, v)
    found = ClosestTree.of_faces([face]).closest_points(shape.point_mm)
    assert found.distance_mm.max() < 1e-12
    np.testing.assert_allclose(np.column_stack([found.u, found.v]), np.column_stack([u, v]), atol=1e-9)
    np.testing.assert_allclose(found.normal, shape.normal, atol=1e-8)


def test_outside_corners_and_edges_of_a_box_are_answered():
    box = faces_of(the_solid(cq.Workplane("XY").box(10, 20, 30)))
    found = ClosestTree.of_faces(box).closest_points([[8, 14, 19], [8, 14, 0], [8, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(found.distance_mm, [np.sqrt(41), 5, 3, 4], atol=1e-12)
    np.testing.assert_allclose(found.point_mm[:3], [[5, 10, 15], [5, 10, 0], [5, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(found.normal[2:], [[1, 0, 0], [1, 0, 0]], atol=1e-12)


def test_at_the_middle_of_a_sphere_every_point_is_as_near():
    ball = faces_of(the_solid(cq.Workplane("XY").sphere(11)))
    found = ClosestTree.of_faces(ball).closest_points([[0, 0, 0], [0, 0, 30], [0, 0, -3.0]])
    np.testing.assert_allclose(found.distance_mm, [11, 19, 8], atol=1e-9)


def test_signed_distances_are_negative_inside():
    box = faces_of(the_solid(cq.Workplane("XY").box(10, 20, 30)))
    found = ClosestTree.of_faces(box).signed_distances_mm(np.array([[8, 14, 19], [8, 0, 0], [4, 0, 0], [1, 9.5, 0.0]]))
    np.testing.assert_allclose(found, [np.sqrt(41), 3, -1, -0.5], atol=1e-12)


def test_one_face_alone_can_be_asked_for():
    box = faces_of(the_solid(cq.Workplane("XY").box(10, 20, 30)))
    tree, point = ClosestTree.of_faces(box), [[1.0, 2.0, 3.0]]
    for k in range(6):
        alone = ClosestTree.of_faces([box[k]]).closest_points(point)
        asked = tree.closest_points(point, face=k)
        assert asked.face[0] == k and asked.distance_mm[0] == pytest.approx(alone.distance_mm[0], abs=1e-12)


def test_closest_points_turn_with_the_part():
    part = round_pocket_block()
    turned = part.rotate((1, 2, 3), (4, 1, 7), 77)
    points = np.random.default_rng(0).uniform(-25, 25, (200, 3))
    there = np.array([cq.Vertex.makeVertex(*p).rotate(cq.Vector(1, 2, 3), cq.Vector(4, 1, 7), 77).toTuple()
                      for p in points.tolist()])
    a, b = (ClosestTree.of_faces(faces_of(the_solid(p))) for p in (part, turned))
    np.testing.assert_allclose(a.closest_points(points).distance_mm, b.closest_points(there).distance_mm, atol=1e-9)


def test_a_tree_seen_from_another_frame_answers_as_one_made_there():
    """Distances, places, normals and faces of a part turned away, and of the tree of the part that was not."""
    frame = Frame(rotation=Frame.along(np.array([2.0, -1.0, 2.0]) / 3.0).rotation, origin_mm=np.array([3.0, -7.0, 11.0]))
    part = the_solid(round_pocket_block())
    seen, made = ClosestTree.of_faces(faces_of(part)).seen_from(frame), ClosestTree.of_faces(faces_of(seen_from(part, frame)))
    points = frame.into(np.random.default_rng(1).uniform(-25, 25, (300, 3)))
    a, b = seen.closest_points(points), made.closest_points(points)
    np.testing.assert_allclose(a.distance_mm, b.distance_mm, atol=1e-9)
    np.testing.assert_allclose(seen.signed_distances_mm(points), made.signed_distances_mm(points), atol=1e-9)
    square = [np.abs(((points - c.point_mm) * c.normal).sum(axis=1)) > c.distance_mm - 1e-6 for c in (a, b)]
    inside = square[0] & square[1] & (np.linalg.norm(a.point_mm - b.point_mm, axis=1) < 1e-6)     # on a border either face is right
    assert inside.sum() > 100 and (a.face == b.face)[inside].all()
    np.testing.assert_allclose(a.normal[inside], b.normal[inside], atol=1e-6)


def test_at_a_pole_no_piece_is_smaller_than_can_be_told_and_distances_stay():
    """A spline's dome whose rows all end in its top: each octave of size has as many pieces.  A dense grid is no nearer."""
    poles = wavy_poles(2, height=0.5)
    poles[0] = poles[0].mean(axis=0)                    # one border shrinks to a point
    face = face_of(bspline(poles))
    tree = ClosestTree.of_faces([face])
    assert np.ptp(tree.boxes.reshape(-1, 2, 3), axis=1).max(axis=1).min() > 0.1 * TINY_MM
    points = poles[0, 0] + np.random.default_rng(5).normal(0, 1.0, (60, 3))
    (u0, u1), (v0, v1) = ((k[0], k[-1]) for k in (face.nurbs.knots_u, face.nurbs.knots_v))
    u, v = (a.ravel() for a in np.meshgrid(u0 + (u1 - u0) * np.linspace(0, 1, 400) ** 3, np.linspace(v0, v1, 200)))
    dense = tree.patches.derivatives(np.zeros(len(u), int), u, v)[:, 0]
    nearest = np.linalg.norm(dense[None] - points[:, None], axis=2).min(axis=1)
    found = tree.closest_points(points).distance_mm
    assert (found <= nearest + 1e-9).all() and (nearest - found < 0.01).all()


def test_many_rows_in_parallel_equal_few():
    tree = ClosestTree.of_faces([kinds()["bspline"]])
    points = around([kinds()["bspline"]], 4 * CHUNK + 1)
    many, few = tree.closest_points(points), tree.closest_points(points[:300])
    np.testing.assert_allclose(many.distance_mm[:300], few.distance_mm, atol=1e-12)


def test_from_a_start_nearby_newton_alone_finds_the_foot():
    face = face_of(bspline(wavy_poles(3, (20, 16), (100, 60), 0.5, 0.2)))
    tree = ClosestTree.of_faces([face])
    u, v = np.random.default_rng(0).uniform(0.02, 0.98, (2, 3000))
    shape = face.shape_at(u, v)
    points = shape.point_mm + 0.3 * shape.normal
    near_u, near_v, feet = refined(tree.patches, 0, u + 0.004, v - 0.004, points)
    np.testing.assert_allclose(feet, shape.point_mm, atol=1e-9)
    np.testing.assert_allclose(np.column_stack([near_u, near_v]), np.column_stack([u, v]), atol=1e-9)


def test_no_faces_are_refused():
    with pytest.raises(PlanError, match="at least one face"):
        ClosestTree.of_faces([])


def bored_and_countersunk():
    """A block with a bore, and a cone in its top."""
    block = cq.Workplane("XY").box(30, 24, 12, centered=False).cut(cq.Workplane("XY", origin=(8, 8, -1)).circle(3).extrude(20))
    cone = cq.Workplane(obj=cq.Solid.makeCone(1, 5, 6, pnt=cq.Vector(20, 14, 6), dir=cq.Vector(0, 0, 1)))
    return block.cut(cone)


@pytest.mark.parametrize("aside_mm", [0.0, 1e-9, 1e-5, 1e-3, 0.05, 1.0])
def test_near_the_axis_of_a_bore_and_a_cone_distances_are_those_of_the_closed_form(aside_mm):
    faces = faces_of(the_solid(bored_and_countersunk().val()))
    tree, turns = ClosestTree.of_faces(faces), np.random.default_rng(3).uniform(0, 2 * np.pi, 40)
    out = aside_mm * np.column_stack([np.cos(turns), np.sin(turns)])
    high = np.linspace(3.1, 8.9, 40)
    bore = tree.closest_points(np.column_stack([out + (8, 8), high]))
    np.testing.assert_allclose(bore.distance_mm, 3.0 - aside_mm, rtol=0, atol=1e-11)
    assert not bore.is_edge.any() and is_consistent(tree, np.column_stack([out + (8, 8), high]), bore)
    above = tree.closest_points(np.column_stack([out + (8, 8), high + 9.5]))        # beside the mouth's edge
    np.testing.assert_allclose(above.distance_mm, np.hypot(3.0 - aside_mm, np.maximum(high - 2.5, 0.0)), rtol=0, atol=1e-9)
    level = np.linspace(8.0, 11.0, 40)
    cone = tree.closest_points(np.column_stack([out + (20, 14), level]))
    slope = 4.0 / 6.0
    reach = (1.0 + slope * (level - 6.0) - aside_mm) / np.hypot(1.0, slope)         # square to the generatrix
    foot_mm = (level - 6.0) - reach * slope / np.hypot(1.0, slope)                  # its foot, over the cone's narrow end
    np.testing.assert_allclose(cone.distance_mm[foot_mm > 0.0], reach[foot_mm > 0.0], rtol=0, atol=1e-11)
    assert (foot_mm > 0.0).sum() > 10


def test_the_nearest_place_of_a_round_piece_is_that_of_brute_force():
    tree = ClosestTree.of_faces(faces_of(the_solid(bored_and_countersunk().rotate((0, 0, 0), (1, 2, 3), 35).val())))
    pieces = np.flatnonzero((tree.round[:, RADIUS] > 0.0) & (tree.rows[:, 2] == INSIDE))
    dice, foot, share = np.random.default_rng(1), np.empty(3), np.linspace(-1.0, 1.0, 101)
    for k in dice.choice(pieces, 25, replace=False):
        span, box = tree.patches.span[tree.rows[k, 1]], tree.geometry[k, RECTANGLE:RECTANGLE + 4]
        s, t = np.meshgrid((box[0] + box[1] + share * (box[1] - box[0])) / 2, (box[2] + box[3] + share * (box[3] - box[2])) / 2)
        u, v = ((span[c] + span[c + 1] + a.ravel() * (span[c + 1] - span[c])) / 2 for c, a in ((0, s), (2, t)))
        places = tree.patches.derivatives(tree.rows[k, 0], u, v)[:, 0]
        for q in tree.geometry[k, :3] + dice.uniform(-6, 6, (8, 3)):
            found = least_square(tree.round[k], q, foot) ** 0.5
            brute = np.linalg.norm(places - q, axis=1).min()
            assert found <= brute + 1e-10 and brute - found < 5e-3 and np.linalg.norm(foot - q) == pytest.approx(found, abs=1e-12)
            assert np.linalg.norm(places - foot, axis=1).min() < 0.1


@pytest.mark.parametrize("angle_deg", [12, 30, 60, 90, 120, 240, 300, 330, 348])
def test_beside_an_edge_of_any_angle_the_sign_is_that_of_the_side(angle_deg):
    at, far = np.linspace(0, 360, 241)[:-1] + 0.7, 4.0
    points = np.column_stack([far * np.cos(np.radians(at)), np.linspace(-5, 5, 240), far * np.sin(np.radians(at))])
    tree = ClosestTree.of_faces(faces_of(the_solid(wedge(angle_deg))))
    np.testing.assert_array_equal(tree.signed_distances_mm(points) < 0, at < angle_deg)
    np.testing.assert_array_equal(np.abs(tree.signed_distances_mm(points)), tree.closest_points(points).distance_mm)


def spire():
    """A pyramid whose corners are all sharper than square, in a block that has the same cut out of its base."""
    base = cq.Workplane().rect(6, 4).workplane(offset=15.0).rect(0.02, 0.02).loft(combine=True).val()
    block = cq.Workplane().box(30, 30, 20, centered=(True, True, False)).val()
    return cq.Workplane(obj=block.cut(base).fuse(base.moved(cq.Location(cq.Vector(0, 0, 20)))))


EDGED = {"pocket": PARTS["pocket"], "drilled": PARTS["drilled"], "spire": spire,
         "needle": lambda: cq.Workplane(obj=cq.Solid.makeCone(2, 0, 12)).rotate((0, 0, 0), (1, 2, 3), 35)}


@pytest.mark.parametrize("name", EDGED)
def test_signs_round_edges_and_corners_are_those_of_the_kernels_classifier(name):
    solid = the_solid(EDGED[name]())
    faces, rng = faces_of(solid), np.random.default_rng(4)
    tree = ClosestTree.of_faces(faces)
    corners = np.unique(np.array([cq.Vertex(v.wrapped).toTuple() for v in cq.Shape(solid).Vertices()]).round(9), axis=0)
    points = np.concatenate([around(faces, 60, seed=5, margin=2.0)] + [
        at + size * rng.normal(size=(30, 3)) for size in (0.03, 1.0) for at in corners[:8]])
    near = tree.closest_points(points)
    points = points[near.distance_mm > 1e-3]
    classifier = BRepClass3d_SolidClassifier(solid)

    def is_inside(p):
        classifier.Perform(gp_Pnt(*p.tolist()), 1e-7)
        return classifier.State() == TopAbs_IN

    np.testing.assert_array_equal(tree.signed_distances_mm(points) < 0, [is_inside(p) for p in points])
    assert near.is_edge.sum() >= 10


def test_signs_about_random_splinters_are_those_of_barycentric_coordinates():
    rng, wrong, asked = np.random.default_rng(1), 0, 0
    for n in range(12):
        corners = rng.uniform(-5, 5, (4, 3))
        corners[3] = corners[:3].mean(axis=0) + 0.5 * rng.normal(size=3)      # flat, with sharp edges and sharper corners
        rows = (0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)
        wires = [cq.Wire.makePolygon([cq.Vector(*corners[i]) for i in row], close=True) for row in rows]
        solid = cq.Solid.makeSolid(cq.Shell.makeShell([cq.Face.makeFromWires(w) for w in wires]))
        is_void = n % 3 == 0
        part = cq.Workplane().box(40, 40, 40).cut(cq.Workplane(obj=solid)) if is_void else cq.Workplane(obj=solid)
        tree = ClosestTree.of_faces(faces_of(the_solid(part)))
        points = np.concatenate([c + size * rng.normal(size=(100, 3)) for c in corners for size in (0.05, 1.0, 3.0)])
        ones = lambda rows: np.vstack([rows.T, np.ones(len(rows))])
        is_inside = (np.linalg.solve(ones(corners), ones(points)) > 0).all(axis=0) != is_void
        counts = tree.closest_points(points).distance_mm > 1e-3
        wrong += int(((tree.signed_distances_mm(points) < 0) != is_inside)[counts].sum())
        asked += int(counts.sum())
    assert asked > 10_000 and wrong == 0
