"""The free-form surface of Lopes de Andrade et al. against figures computed apart from this code."""

import numpy as np
import pytest

from cuspline.designs._freeform_surface import curve_points_mm, freeform_face
from cuspline.kernel.brep import Face
from cuspline.surfaces.patches import PatchSet

BALL_RADIUS_MM = 10.0
# lengths of the curves S + 10 N at constant v (along u) and constant u (along v), mm.  Computed by a separate script
# from the published points alone: cubics by solving the 4 x 4 Vandermonde system at chord-length parameters,
# S(u, v) = (2v² - 3v + 1) c1 + (4v - 4v²) c2 + (2v² - v) c3, N from its analytic derivatives, adaptive quadrature.
ALONG_U_MM = {0.0: 327.0680792, 1 / 3: 319.9828141, 2 / 3: 319.9828141, 1.0: 327.0680792}
ALONG_V_MM = {0.0: 112.5444972, 1 / 6: 112.2381086, 1 / 3: 105.1670977, 1 / 2: 92.35865010, 2 / 3: 78.80605838,
              5 / 6: 70.11398849, 1.0: 69.69685438}
AREA_MM2 = 32189.47


@pytest.fixture(scope="module")
def face():
    return Face(freeform_face())


def gauss(count):
    x, weight = np.polynomial.legendre.leggauss(count)
    return (x + 1) / 2, weight / 2


def test_the_patch_passes_through_the_published_points(face):
    for v, points in zip((0.0, 0.5, 1.0), curve_points_mm()):
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        u = np.r_[0.0, np.cumsum(chords)] / chords.sum()
        np.testing.assert_allclose(face.nurbs.derivatives(u, np.full(4, v))[:, 0], points, rtol=0, atol=1e-10)


def test_it_is_one_polynomial_patch_that_looks_up(face):
    patches = PatchSet.of_faces([face])
    assert face.kind == "bezier" and patches.patch[:, 2:].tolist() == [[3, 2, 0]]
    assert face.middle.normal[0, 2] > 0.9


def test_its_area_is_the_known_one(face):
    x, w = gauss(24)
    u, v = (a.ravel() for a in np.meshgrid(x, x, indexing="ij"))
    d = face.nurbs.derivatives(u, v)
    area = (np.linalg.norm(np.cross(d[:, 1], d[:, 2]), axis=1) * np.outer(w, w).ravel()).sum()
    assert area == pytest.approx(AREA_MM2, rel=1e-6)


def offset_points(face, u, v):
    shape = face.shape_at(u, v)
    return shape.point_mm + BALL_RADIUS_MM * shape.normal


@pytest.mark.parametrize("direction, fixed, length_mm", [("u", k, x) for k, x in ALONG_U_MM.items()]
                         + [("v", k, x) for k, x in ALONG_V_MM.items()])
def test_offset_curves_are_as_long_as_known(face, direction, fixed, length_mm):
    t = np.linspace(0.0, 1.0, 1001)
    points = offset_points(face, *((t, np.full(1001, fixed)) if direction == "u" else (np.full(1001, fixed), t)))
    fine, coarse = (np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (points, points[::2]))
    assert (4 * fine - coarse) / 3 == pytest.approx(length_mm, rel=1e-6)       # Richardson: chords err by their square
