"""Waterline loops against circles, squares and hyperbolas that are known."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.toolpaths.freeform.waterline import DropHeights, mesh_waterlines, waterlines
from cuspline.values.errors import ToolpathError

CUTTERS = pytest.mark.parametrize("R, rc", [(3.0, 3.0), (3.0, 0.8), (3.0, 0.0)], ids=["ball", "bull nose", "flat"])
ROUND = 3000            # facets of a turned mesh: 15 mm (1 - cos(pi / 3000)) = 8e-6 mm
POINT_MM = 1e-4


def turned(profile, center=(0.0, 0.0)):
    """Closed mesh of (rho, z) points turned round an upright axis; rho 0 at both ends."""
    angle = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
    rings = [np.column_stack([center[0] + rho * np.cos(angle), center[1] + rho * np.sin(angle), np.full(ROUND, z)])
             for rho, z in profile]
    i, j = np.arange(ROUND), (np.arange(ROUND) + 1) % ROUND
    bands = [np.vstack([np.column_stack([i, j, j + ROUND]), np.column_stack([i, j + ROUND, i + ROUND])]) + k * ROUND
             for k in range(len(profile) - 1)]
    return np.vstack(rings), np.vstack(bands)


def together(*parts):
    shift = np.cumsum([0] + [len(v) for v, _ in parts])
    return DropMesh.from_triangles(np.vstack([v for v, _ in parts]),
                                   np.vstack([t + s for (_, t), s in zip(parts, shift)]))


def box(low, high):
    x, y, z = np.stack([low, high], axis=-1)
    vertices = np.array([(a, b, c) for a in x for b in y for c in z], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def signed_area(xy):
    """Positive when the loop runs anticlockwise."""
    return 0.5 * (xy[:, 0] * np.roll(xy[:, 1], -1) - np.roll(xy[:, 0], -1) * xy[:, 1]).sum()


def boss(radius, top, center=(0.0, 0.0)):
    return turned([(0, 0), (radius, 0), (radius, top), (0, top)], center)


@CUTTERS
def test_round_a_cone_the_loop_is_a_circle_with_the_material_on_its_right(R, rc):
    mesh = together(turned([(0, 0), (20, 0), (0, 20)]))
    loops = mesh_waterlines(mesh, [12.0, 15.0, 8.0], R, rc, pitch_mm=1.0, chord_mm=0.01)
    assert [loop.height_mm for loop in loops] == [15.0, 12.0, 8.0]
    for loop in loops:
        assert loop.is_closed and signed_area(loop.tip_mm) < 0
        radius = 20 - loop.height_mm + (R - rc) + rc * (math.sqrt(2) - 1)
        assert np.abs(np.hypot(*loop.tip_mm[:, :2].T) - radius).max() < POINT_MM


@CUTTERS
@pytest.mark.parametrize("pitch_mm", [0.37, 1.0])
def test_along_an_upright_wall_the_loop_stands_off_by_the_radius(R, rc, pitch_mm):
    loops = mesh_waterlines(together(boss(6.0, 10.0)), [2.0, 6.9], R, rc, pitch_mm=pitch_mm, chord_mm=0.02)
    assert len(loops) == 2
    for loop in loops:
        rho = np.hypot(*loop.tip_mm[:, :2].T)
        assert np.abs(rho - (6 + R)).max() < POINT_MM
        chord = np.hypot(*(loop.tip_mm - np.roll(loop.tip_mm, 1, axis=0))[:, :2].T)
        assert loop.is_closed and chord.max() < pitch_mm * 1.5


@pytest.mark.parametrize("z", [-2.0, 3.0, 6.5])
def test_round_a_sphere_the_loop_is_a_circle(z):
    ball, sphere = 4.0, 9.0

    def tips_at(xy):
        left = (ball + sphere) ** 2 - (xy ** 2).sum(axis=1)
        return np.where(left > 0, np.sqrt(np.maximum(left, 0)) - ball, -np.inf)

    loop, = waterlines(DropHeights(tips_at=tips_at), z, (-15, -16), (15, 14), pitch_mm=0.8, chord_mm=0.005)
    radius = math.sqrt((ball + sphere) ** 2 - (z + ball) ** 2)
    assert np.abs(np.hypot(*loop.tip_mm[:, :2].T) - radius).max() < 1.01e-5
    assert (tips_at(loop.tip_mm[:, :2]) <= z).all()
    assert loop.is_closed


@CUTTERS
def test_in_a_square_pocket_the_loop_is_a_smaller_square_run_anticlockwise(R, rc):
    frame = [box((-20, -20, 0), (20, -10, 8)), box((-20, 10, 0), (20, 20, 8)), box((-20, -10, 0), (-10, 10, 8)),
             box((10, -10, 0), (20, 10, 8)), box((-10, -10, 0), (10, 10, 1))]
    loops = mesh_waterlines(together(*frame), [2.0], R, rc, pitch_mm=0.7, chord_mm=0.01)
    inner, = (loop for loop in loops if np.abs(loop.tip_mm[:, :2]).max() < 15)
    assert len(loops) == 2 and inner.is_closed and signed_area(inner.tip_mm) > 0
    assert np.abs(np.abs(inner.tip_mm[:, :2]).max(axis=1) - (10 - R)).max() < POINT_MM
    outer, = (loop for loop in loops if loop is not inner)
    corner = np.maximum(np.abs(outer.tip_mm[:, :2]) - 20, 0)
    assert np.abs(np.hypot(*corner.T) - R).max() < POINT_MM and signed_area(outer.tip_mm) < 0


@pytest.mark.parametrize("apart, count", [(19.0, 2), (18.1, 2), (17.9, 1)])
def test_two_bosses_have_one_loop_each_until_the_cutter_no_longer_fits_between(apart, count):
    part = together(boss(6.0, 10.0, (-apart / 2, 0.05)), boss(6.0, 10.0, (apart / 2, 0.05)))
    loops = mesh_waterlines(part, [4.0], 3.0, 0.0, pitch_mm=0.09, chord_mm=0.05)
    assert len(loops) == count
    for loop in loops:
        to_axis = np.min([np.hypot(loop.tip_mm[:, 0] - c, loop.tip_mm[:, 1] - 0.05) for c in (-apart / 2, apart / 2)],
                         axis=0)
        assert np.abs(to_axis - 9).max() < POINT_MM


@pytest.mark.parametrize("z", [0.3, 1e-4, -1e-4, -0.3])
def test_near_a_saddle_the_two_branches_stay_apart(z):
    loops = waterlines(DropHeights(tips_at=lambda xy: xy[:, 0] * xy[:, 1]), z, (-5.3, -5), (5, 5.2), pitch_mm=0.71, chord_mm=0.01)
    assert len(loops) == 2
    for loop in loops:
        x, y = loop.tip_mm[:, :2].T
        assert not loop.is_closed
        assert len(set(np.sign(x))) == 1 and len(set(np.sign(y))) == 1      # one branch of the hyperbola
        assert np.abs(x * y - z).max() < 1e-4
        a, b = loop.tip_mm[:-1, :2], loop.tip_mm[1:, :2]
        to_right = np.column_stack([b[:, 1] - a[:, 1], a[:, 0] - b[:, 0]])
        probe = 0.5 * (a + b) + 0.02 * to_right / np.hypot(*to_right.T)[:, None]
        assert (probe.prod(axis=1) > z).mean() > 0.9                       # but where the chord is nearly as short


def test_chords_stray_no_further_than_asked_and_their_number_grows_with_the_root():
    def count(chord_mm):
        loop, = waterlines(DropHeights(tips_at=lambda xy: 20 - np.hypot(*xy.T)), 8.0, (-13, -13.2), (13.1, 13), pitch_mm=4.0,
                           chord_mm=chord_mm)
        xy = loop.tip_mm[:, :2]
        middle = 0.5 * (xy + np.roll(xy, 1, axis=0))
        assert 0 < (12 - np.hypot(*middle.T)).max() < chord_mm + 1e-4
        return len(xy)

    few, more, many = (count(c) for c in (0.04, 0.01, 0.0025))
    assert 1.6 < more / few < 2.4 and 1.6 < many / more < 2.4


def test_sharp_corners_are_followed_to_the_chord():
    # the drop height of an upright prism with a square section: a jump at its sides
    def tips_at(xy):
        return np.where(np.abs(xy).max(axis=1) < 3.3, 10.0, -np.inf)

    loop, = waterlines(DropHeights(tips_at=tips_at), 5.0, (-5, -5.1), (5.2, 5), pitch_mm=1.0, chord_mm=0.003)
    assert np.abs(np.abs(loop.tip_mm[:, :2]).max(axis=1) - 3.3).max() < 1e-4
    assert all(np.hypot(*(loop.tip_mm[:, :2] - c).T).min() < 0.02 for c in ((3.3, 3.3), (-3.3, 3.3), (3.3, -3.3)))


@CUTTERS
def test_on_a_wild_mesh_every_point_is_free_and_material_lies_beside_it(R, rc):
    rng = np.random.default_rng(4)
    triangles = rng.uniform(-15, 15, (60, 1, 3)) * (1, 1, 0.2) + rng.normal(0, 4, (60, 3, 3))
    mesh = DropMesh.from_triangles(triangles.reshape(-1, 3), np.arange(180).reshape(-1, 3))
    loops = mesh_waterlines(mesh, [0.0, 3.0], R, rc, pitch_mm=0.8, chord_mm=0.02)
    xy = np.vstack([loop.tip_mm for loop in loops])
    assert len(xy) > 300 and all(loop.is_closed for loop in loops)
    assert (drop_tips_mm(mesh, xy[:, :2], R, rc) <= xy[:, 2]).all()
    around = [xy[:, :2] + POINT_MM * np.array([math.cos(a), math.sin(a)]) for a in np.linspace(0, 2 * np.pi, 16)]
    beside = np.max([drop_tips_mm(mesh, p, R, rc) for p in around], axis=0)
    assert (beside > xy[:, 2]).all()


def test_above_the_part_there_is_no_loop():
    assert mesh_waterlines(together(boss(6.0, 10.0)), [10.5], 3.0, 0.0, pitch_mm=1.0, chord_mm=0.1) == ()


@pytest.mark.parametrize("change", [{"pitch_mm": 0.0}, {"chord_mm": -1.0}, {"tolerance_mm": 2.0}, {"pitch_mm": np.nan}])
def test_sizes_that_make_no_sense_are_refused(change):
    with pytest.raises(ToolpathError, match="waterline"):
        waterlines(DropHeights(tips_at=lambda xy: xy[:, 0]), 0.0, (0, 0), (1, 1), **{"pitch_mm": 0.1, "chord_mm": 0.1, **change})


def test_lines_are_fine_where_they_are_wanted_and_left_rough_elsewhere():
    """A dome's line, wanted beyond x = 2: there the same points as of the whole, elsewhere no chord was looked at."""
    dome = lambda xy: 20 - np.hypot(*xy.T)
    line = lambda near_at: waterlines(DropHeights(tips_at=dome, near_at=near_at), 8.0, (-13, -13.2), (13.1, 13), pitch_mm=1.0,
                                      chord_mm=0.001)[0].tip_mm
    whole, part = line(None), line(lambda xy, z, within_mm: xy[:, 0] + within_mm >= 2.0)
    wanted = lambda tips: tips[tips[:, 0] >= 2.0]
    assert {tuple(p) for p in wanted(whole)} == {tuple(p) for p in wanted(part)}
    assert (part[:, 0] < -2.0).sum() < 0.3 * (whole[:, 0] < -2.0).sum()
