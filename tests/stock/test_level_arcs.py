"""Lines that stand for arcs at one height, against the arcs themselves."""

import numpy as np

from cuspline.stock.height_kernels import piece_height
from cuspline.stock.level_arcs import MOST_WAYS, chord_room, chords_within, level_cover, level_sagitta
from cuspline.stock.path_pieces import ARC_ANGLE_RAD, LEVEL_ARC, LEVEL_SAGITTA_MM, RADIUS, SAGITTA_MM

CENTER = np.array([2.0, -1.0])


def level_arcs(rng, count):
    """Rows of pieces as they come out of path_pieces, within a quarter of their circle."""
    for _ in range(count):
        r = rng.choice([0.3, 2.0, 5.0, 60.0])
        turn = rng.uniform(0.001, min(ARC_ANGLE_RAD, 2 * np.arccos(1 - LEVEL_SAGITTA_MM / r)))
        at = rng.integers(4) * np.pi / 2 + rng.uniform(0, np.pi / 2 - turn)
        ends = CENTER + r * np.array([np.cos([at, at + turn]), np.sin([at, at + turn])]).T
        yield np.array([*ends[0], -3.0, *ends[1], -3.0, 0, *CENTER, r, 0, LEVEL_ARC])


def test_no_place_of_a_rectangle_keeps_more_than_its_cover_and_few_covers_are_given_up():
    rng, spare, covered = np.random.default_rng(1), np.zeros(12), []
    for n, g in enumerate(level_arcs(rng, 1500)):
        a, rc = [(0.0, 3.0), (2.0, 1.0), (3.0, 0.0)][n % 3]
        x, y = (g[:2] + g[3:5]) / 2 + rng.normal(0, 2.0, 2)
        hx, hy = rng.choice([0.01, 0.1, 0.3], 2)
        cover = level_cover(x, y, hx, hy, g, a, rc, spare)
        over = [piece_height(px, py, g, a, rc) for px in np.linspace(x - hx, x + hx, 7) for py in np.linspace(y - hy, y + hy, 7)]
        assert cover >= max(over) - 1e-9
        if np.isfinite(max(over)):
            covered.append(np.isfinite(cover))
    assert np.mean(covered) > 0.98


def test_chords_of_a_level_arc_keep_within_the_sagitta_and_lie_on_it():
    rng, corners = np.random.default_rng(2), chord_room()
    for g in level_arcs(rng, 200):
        count = chords_within(g, corners)
        assert level_sagitta(g) <= LEVEL_SAGITTA_MM + 1e-9 and count <= MOST_WAYS
        away = corners[:count + 1] - CENTER
        assert np.abs(np.hypot(*away.T) - g[RADIUS]).max() < 1e-12 * (1 + g[RADIUS])
        middle = (corners[:count] + corners[1:count + 1]) / 2 - CENTER
        assert (g[RADIUS] - np.hypot(*middle.T)).max() <= SAGITTA_MM * 1.0001
        assert (corners[0] == g[:2]).all() and (corners[count] == g[3:5]).all()
