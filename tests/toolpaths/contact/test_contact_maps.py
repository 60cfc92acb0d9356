"""The contact map's verdicts on boxes of a cylinder against what its radius says."""

import numpy as np
import pytest

from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.patches import PatchSet
from cuspline.toolpaths.contact.contact_maps import map_proof, map_step

CUTTERS = pytest.mark.parametrize("R, rc", [(4.0, 4.0), (4.0, 1.0), (4.0, 0.0)], ids=["ball", "bull nose", "flat"])


def bent(radius_mm, lean=0.5, half_mm=0.1):
    """A parabolic strip that leans by `lean` along x and has a curvature of 1 / radius_mm along y, ridges positive."""
    x, y = np.meshgrid([-half_mm, 0.0, half_mm], [-half_mm, 0.0, half_mm], indexing="ij")
    rise = np.array([half_mm ** 2, -half_mm ** 2, half_mm ** 2]) / 2     # poles of y² / 2
    z = -lean * x - np.sqrt(1 + lean ** 2) / radius_mm * rise[None, :]
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    return PatchSet.of_surfaces([NurbsSurface(degree_u=2, degree_v=2, knots_u=knots, knots_v=knots,
                                              poles=np.stack([x, y, z, np.ones_like(z)], axis=-1))])


def verdict(patches, R, rc, aside=(0.0, 0.0)):
    """Of the whole patch, with the axis where its middle is touched plus `aside`; and Newton's scratch."""
    o = patches.derivatives(0, np.array([0.5]), np.array([0.5]))[0]
    o[1:3] /= 2
    o[3:] /= 4
    sizes = np.linalg.norm(o, axis=1)
    row = np.zeros(24)
    row[4:9] = sizes[1] + sizes[3], sizes[2] + sizes[5], sizes[3], sizes[4], sizes[5]
    n = np.cross(o[1], o[2])
    length = np.linalg.norm(n)
    sine = (row[6] * row[5] + row[4] * row[8]) / length
    n /= length
    axis = o[0, :2] + rc * n[:2] + (R - rc) * n[:2] / np.hypot(*n[:2]) + aside
    w = np.zeros(12)
    return map_proof(row, o, 1.0, 1.0, 1.0, *n, length, sine, *axis, R, rc, w), w, axis


def narrowest_mm(R, rc):
    """Radius of the hollow in which the cutter just fits, contact leaning by 0.5."""
    level = 0.5 / np.sqrt(1.25)
    return rc + (R - rc) / level


@CUTTERS
def test_a_hollow_narrower_than_the_cutter_is_never_touched(R, rc):
    assert verdict(bent(-0.8 * narrowest_mm(R, rc)), R, rc)[0] == 2


@CUTTERS
def test_a_wider_hollow_and_a_ridge_are_touched_once(R, rc):
    for radius in (-1.5 * narrowest_mm(R, rc), 50.0, 8.0):
        patches = bent(radius)
        answer, w, axis = verdict(patches, R, rc)
        assert answer == 1
        np.testing.assert_allclose(w[:2], 0.0, atol=1e-9)
        assert map_step(patches.coefficients, patches.patch[0], 0.0, 0.0, 1.0, 1.0, 1.0, *axis, R, rc,
                        np.empty((6, 3)), w)


@CUTTERS
def test_an_axis_too_far_aside_touches_elsewhere(R, rc):
    assert verdict(bent(50.0), R, rc, aside=(1.0, 0.0))[0] == 2
    assert verdict(bent(50.0), R, rc, aside=(0.0, -2.0))[0] == 2


@CUTTERS
def test_where_the_hollow_just_fits_nothing_is_claimed(R, rc):
    assert verdict(bent(-1.0001 * narrowest_mm(R, rc)), R, rc)[0] == 0
