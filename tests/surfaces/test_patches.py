"""The power form is the same surface as the B-spline it came from."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.patches import SERIAL_ROWS, PatchSet


@pytest.fixture(scope="module")
def faces():
    block = cq.Workplane().box(40, 30, 10).edges("|Z").fillet(4).faces(">Z").workplane().hole(8)
    block = block.faces(">Z").edges().fillet(1).union(cq.Workplane().sphere(6).translate((12, 8, 6)))
    return brep.faces_of(brep.the_solid(block))


def test_patches_of_every_face_agree_with_its_spline(faces):
    patches, rng = PatchSet.of_faces(faces), np.random.default_rng(0)
    assert {f.kind for f in faces} >= {"plane", "cylinder", "torus", "sphere"}
    for k, face in enumerate(faces):
        u, v = (rng.uniform(a, b, 200) for a, b in np.reshape(patches.domain(k), (2, 2)))
        there, here = face.nurbs.derivatives(u, v), patches.derivatives(k, u, v)
        scale = 1.0 + np.abs(there).max(axis=(0, 2))[None, :, None]
        assert np.abs((here - there) / scale).max() < 1e-13


def test_normal_sign_follows_the_face(faces):
    patches = PatchSet.of_faces(faces)
    for k, face in enumerate(faces):
        u0, u1, v0, v1 = patches.domain(k)
        d = patches.derivatives(k, np.array([(u0 + u1) / 2]), np.array([(v0 + v1) / 2]))[0]
        normal = patches.sign[k] * np.cross(d[1], d[2])
        wanted = face.shape_at((u0 + u1) / 2, (v0 + v1) / 2).normal[0]
        assert normal @ wanted > (1 - 1e-12) * np.linalg.norm(normal)


def test_high_degree_and_uneven_knots_keep_their_digits():
    rng = np.random.default_rng(1)
    knots = np.r_[[0.0] * 12, 0.001, 0.3, 0.3, 7.0, [9.0] * 12]
    poles = np.concatenate([rng.uniform(-500, 500, (16, 16, 3)), np.ones((16, 16, 1))], axis=2)
    poles *= rng.uniform(0.5, 2.0, (16, 16, 1))
    surface = NurbsSurface(degree_u=11, degree_v=11, knots_u=knots, knots_v=knots, poles=poles)
    u, v = rng.uniform(0, 9, (2, SERIAL_ROWS + 500))
    here = PatchSet.of_surfaces([surface]).derivatives(0, u, v)
    assert np.abs(here[:, 0] - surface.derivatives(u, v)[:, 0]).max() < 1e-9


def test_parameters_outside_the_domain_are_taken_at_its_border(faces):
    patches = PatchSet.of_faces(faces)
    u0, u1, v0, v1 = patches.domain(0)
    outside = patches.derivatives(0, np.array([u0 - 3, u1 + 3]), np.array([v1 + 1, v0 - 1]))
    border = patches.derivatives(0, np.array([u0, u1]), np.array([v1, v0]))
    assert np.array_equal(outside, border)
