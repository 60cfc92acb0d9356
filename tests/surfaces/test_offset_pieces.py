"""Moved pieces stay within their parallelograms and what these may be off; the rest shrinks with the square."""

import numpy as np
import pytest

from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.offset_pieces import offset_of_piece
from cuspline.surfaces.patches import PatchSet

BY_MM = 0.3


def wavy(is_rational):
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.linspace(0, 9, 6), np.linspace(0, 7, 5), indexing="ij")
    w = rng.uniform(0.8, 1.3, x.shape) if is_rational else np.ones(x.shape)
    poles = np.stack([x * w, y * w, rng.uniform(-1, 1, x.shape) * w, w], axis=-1)
    return NurbsSurface(degree_u=3, degree_v=2, knots_u=[0, 0, 0, 0, 1, 2, 3, 3, 3, 3],
                        knots_v=[0, 0, 0, 1, 2, 3, 3, 3], poles=poles)


def offset(patches, patch, box):
    out = np.empty(13)
    offset_of_piece(patches.coefficients, patches.patch[patch], patches.sign[0], BY_MM, box, np.empty((4, 4, 4)), out)
    return out


@pytest.mark.parametrize("is_rational", [False, True])
@pytest.mark.parametrize("is_reversed", [False, True])
def test_every_point_is_within_the_rest(is_rational, is_reversed):
    surface, rng = wavy(is_rational), np.random.default_rng(1)
    patches = PatchSet.of_surfaces([surface], [is_reversed])
    for patch in range(len(patches.patch)):
        low, half = rng.uniform(-1, 0.7, 2), rng.uniform(0.01, 0.15, 2)
        box = np.array([low[0], low[0] + 2 * half[0], low[1], low[1] + 2 * half[1]])
        out = offset(patches, patch, box)
        s, t = rng.uniform(-1, 1, (2, 400))
        span = patches.span[patch]
        u = (span[0] + span[1] + (low[0] + half[0] * (1 + s)) * (span[1] - span[0])) / 2
        v = (span[2] + span[3] + (low[1] + half[1] * (1 + t)) * (span[3] - span[2])) / 2
        d = patches.derivatives(0, u, v)
        n = np.cross(d[:, 1], d[:, 2]) * (-1 if is_reversed else 1)
        true = d[:, 0] + BY_MM * n / np.linalg.norm(n, axis=1)[:, None]
        off = np.linalg.norm(true - (out[:3] + out[9:12] + s[:, None] * out[3:6] + t[:, None] * out[6:9]), axis=1).max()
        assert off <= out[12] < 20 * off + 1e-6


def test_half_the_piece_has_a_quarter_of_the_rest():
    patches = PatchSet.of_surfaces([wavy(True)])
    rests = [offset(patches, 4, np.array([-h, h, -h, h]))[12] for h in (0.04, 0.02, 0.01)]
    assert rests[1] / rests[0] == pytest.approx(0.25, abs=0.02) and rests[2] / rests[1] == pytest.approx(0.25, abs=0.01)


def test_nothing_bounds_a_piece_with_a_pole():
    surface = wavy(False)
    poles = surface.poles.copy()
    poles[0] = poles[0, 0]
    fan = NurbsSurface(degree_u=3, degree_v=2, knots_u=surface.knots_u, knots_v=surface.knots_v, poles=poles)
    patches = PatchSet.of_surfaces([fan])
    assert offset(patches, 0, np.array([-1, -0.9, -1, 1.0]))[12] == np.inf
    assert offset(patches, 0, np.array([-0.6, -0.59, -0.1, 0.1]))[12] < 1
