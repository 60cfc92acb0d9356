"""Tip paths keep their tolerance between the points, end at the border, and need few points."""

import math

import cadquery as cq
import numpy as np
import pytest
from known_droppers import DOME, GraphDropper
from scipy.spatial import cKDTree

from cuspline.kernel import brep
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.toolpaths.freeform import tip_sampling
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_paths import PathRules, tip_paths
from cuspline.toolpaths.freeform.tip_sampling import EDGE_SHARE, quarter_length_mm

TOLERANCE_MM = 0.001
RULES = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.002, bridge_mm=0.0)


def part(work, deflection_mm=0.002):
    solid = brep.the_solid(work)
    return brep.faces_of(solid), brep.planning_mesh(solid, deflection_mm)


@pytest.fixture(scope="module")
def plate():
    """A plate 30 x 20 x 5 with a through hole of 8 and a boss of 6 x 6, 3 high."""
    return part(cq.Workplane().box(30, 20, 5, centered=False).faces(">Z").workplane(origin=(8, 10, 5)).hole(8)
                .faces(">Z").workplane(origin=(22, 10, 5)).rect(6, 6).extrude(3))


@pytest.fixture(scope="module")
def rough_country():
    """A block with a dome, a groove, a sharp ridge and a step, all wanted from above."""
    block = cq.Workplane().box(40, 20, 8, centered=False)
    dome = cq.Workplane().sphere(6).translate((9, 10, 6))
    roof = cq.Workplane("XZ").polyline([(18, 8), (26, 8), (22, 11)]).close().extrude(-20)
    groove = cq.Workplane("XZ").center(31, 8).circle(3).extrude(-20)
    step = cq.Workplane().box(4, 20, 8, centered=False).translate((36, 0, 4))
    return part(block.union(dome).union(roof).cut(groove).cut(step))


def field_of(country, radius, corner, wanted=None, run_over_mm=0.0, pitch_mm=0.5):
    faces, mesh = country
    low, high = mesh.vertices_mm.min(axis=0), mesh.vertices_mm.max(axis=0)
    wanted = range(len(faces)) if wanted is None else wanted
    return tip_field(MeshDropper.of(mesh, radius, corner), wanted, (low[:2], high[:2]), pitch_mm, run_over_mm)


def tops(country):
    return [i for i, f in enumerate(country[0]) if f.kind == "plane" and f.middle.normal[0, 2] > 0.99
            and abs(f.middle.point_mm[0, 2] - 5) < 1e-6]


def gaps_of(path, dropper, spacing_mm):
    """Height of a path over the lowered cutter at dense places, and the horizontal share of each move."""
    starts, moves = path.tips_mm[:-1], np.diff(path.tips_mm, axis=0)
    counts = np.ceil(np.linalg.norm(moves[:, :2], axis=1) / spacing_mm).astype(int) + 2
    rows = np.repeat(np.arange(len(moves)), counts)
    share = np.concatenate([np.linspace(0, 1, c) for c in counts])[:, None]
    spots = starts[rows] + share * moves[rows]
    cosine = np.linalg.norm(moves[:, :2], axis=1) / np.linalg.norm(moves, axis=1)
    return spots[:, 2] - dropper.tips_mm(spots[:, :2]), cosine[rows], spots


def line(start, end):
    return PlaneCurve(xy_mm=np.array([start, end], float))


@pytest.mark.parametrize("radius, corner", [(2.0, 2.0), (3.0, 0.8), (2.0, 0.0)])
@pytest.mark.parametrize("start, end", [((1, 10.3), (39, 10.3)), ((0.5, 2.1), (39.2, 18.4))])
def test_no_gouge_beyond_the_tolerance_between_the_points(rough_country, radius, corner, start, end):
    field = field_of(rough_country, radius, corner)
    paths = tip_paths([line(start, end)], field, RULES)
    assert sum(abs(p.tips_mm[-1, 0] - p.tips_mm[0, 0]) for p in paths) > 0.99 * (end[0] - start[0])
    for path in paths:
        gap, _, _ = gaps_of(path, field.dropper, 0.003)
        assert gap.min() >= -TOLERANCE_MM


@pytest.mark.parametrize("radius, corner", [(2.0, 2.0), (3.0, 0.8)])
def test_no_air_beyond_the_tolerance_but_at_steps(rough_country, radius, corner):
    """Air is measured to the true tip curve, sampled so densely that its own chords do not matter."""
    field = field_of(rough_country, radius, corner)
    start, end = np.array([1, 10.3]), np.array([39, 10.3])
    for path in tip_paths([line(start, end)], field, RULES):
        _, _, spots = gaps_of(path, field.dropper, 0.01)
        x = np.linspace(path.tips_mm[0, 0], path.tips_mm[-1, 0], 400_000)
        z = field.dropper.tips_mm(np.column_stack([x, np.full(len(x), 10.3)]))
        jump = np.abs(np.diff(z)) > 2e-3
        extra = [np.column_stack([np.full(200, x[k]), np.linspace(z[k], z[k + 1], 200)]) for k in np.flatnonzero(jump)]
        curve = np.vstack([np.column_stack([x, z]), *extra])
        assert cKDTree(curve).query(spots[:, [0, 2]])[0].max() < TOLERANCE_MM * 1.1


def test_a_level_run_needs_two_points(plate):
    field = field_of(plate, 2.0, 2.0, tops(plate))
    (path,) = tip_paths([line((1, 2.2), (29, 2.2))], field, RULES)
    assert np.abs(path.tips_mm - [(1, 2.2, 5), (29, 2.2, 5)]).max() < 1e-9


def test_a_path_over_an_edge_needs_no_more_points_than_the_segment_rule(plate):
    """Rolling over a sharp edge is an arc of the ball's radius: moves of 2 sqrt(2 r e) are the longest that keep e."""
    faces, mesh = plate
    field = field_of(plate, 2.0, 2.0, run_over_mm=10.0)
    (path,) = tip_paths([line((-1.2, 2.2), (15, 2.2))], field, RULES)
    angle = math.asin(1.2 / 2.0)
    longest = 2 * math.sqrt(2 * 2.0 * EDGE_SHARE * TOLERANCE_MM)
    assert len(path.tips_mm) - 2 <= 1.5 * 2.0 * angle / longest + 1
    assert path.tips_mm[-1, 0] == 15


def test_paths_end_at_the_border_of_the_region(plate):
    """At y = 10 the hole leaves x from 4 to 12, the boss 19 - 2 to 25 + 2, the plate's ends 0 and 30."""
    field = field_of(plate, 2.0, 2.0, tops(plate))
    paths = tip_paths([line((-3, 10), (33, 10))], field, RULES)
    ends = np.array([p.tips_mm[[0, -1], 0] for p in paths])
    assert np.abs(ends - [(0, 4), (12, 17), (27, 30)]).max() < 5e-3
    assert np.abs(np.vstack([p.tips_mm for p in paths])[:, 2] - 5).max() < 1e-9


def test_short_gaps_are_bridged_at_the_height_of_what_lies_below(plate):
    field = field_of(plate, 2.0, 2.0, tops(plate))
    over_hole = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.002, bridge_mm=9.0)
    first, second = tip_paths([line((-3, 10), (33, 10))], field, over_hole)
    assert len(first.tips_mm) == 4 and np.abs(first.tips_mm[:, 2] - 5).max() < 1e-9     # straight over the hole
    over_boss = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.002, bridge_mm=17.0)
    (path,) = tip_paths([line((-3, 10), (33, 10))], field, over_boss)
    gap, _, _ = gaps_of(path, field.dropper, 0.003)
    assert gap.min() > -TOLERANCE_MM and abs(path.tips_mm[:, 2].max() - 8) < TOLERANCE_MM


def test_a_run_shorter_than_the_stations_is_found(plate):
    """Across the plate's corner, 0.14 mm off it: a run of 0.28 mm between stations 1.1 mm apart."""
    faces, mesh = plate
    field = tip_field(MeshDropper.of(mesh, 2.0, 2.0), tops(plate), ((0, 0), (30, 20)), 0.25)
    rules = PathRules(tolerance_mm=0.02, lateral_mm=0.0, bridge_mm=0.0)
    assert 4 * quarter_length_mm(field.dropper, rules.tolerance_mm) > 1.1
    for start in (0.0, 0.2, 0.4, 0.6, 0.8):
        (path,) = tip_paths([line((-3 - start, 3.2 + start), (3, -2.8))], field, rules)
        assert np.abs(np.sort(path.tips_mm[:, 0]) - (0.0, 0.2)).max() < 1e-4


def ring(center, radius, count):
    t = np.arange(count) * 2 * math.pi / count
    return PlaneCurve(xy_mm=center + radius * np.column_stack([np.cos(t), np.sin(t)]), is_closed=True)


def test_a_closed_curve_inside_the_region_stays_closed(plate):
    field = field_of(plate, 1.0, 1.0, tops(plate))
    (path,) = tip_paths([ring((8, 10), 5.0, 200)], field, RULES)
    assert path.is_closed and np.array_equal(path.tips_mm[0], path.tips_mm[-1])
    off = np.linalg.norm(path.tips_mm[:, :2] - (8, 10), axis=1)
    assert off.max() < 5.0 + 1e-9 and len(path.tips_mm) < 200


def test_a_closed_curve_that_leaves_the_region_falls_into_open_runs(plate):
    """A ring of 8 about (21, 1) leaves the plate below y = 0 and keeps off the boss above."""
    field = field_of(plate, 1.0, 1.0, tops(plate))
    paths = tip_paths([ring((21, 1), 8.0, 300)], field, RULES)
    assert len(paths) == 2 and not any(p.is_closed for p in paths)
    ends = np.vstack([p.tips_mm[[0, -1]] for p in paths])
    assert (np.abs(ends[:, 1]) < 1e-3).sum() == 2


@pytest.mark.parametrize("radius, corner", [(2.0, 2.0), (3.0, 0.8)])
def test_moves_that_cut_the_curve_s_corners_keep_the_tolerance_too(rough_country, radius, corner):
    field = field_of(rough_country, radius, corner)
    rules = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.02, bridge_mm=0.0)
    curve = ring((12, 10), 7.3, 400)
    paths = tip_paths([curve], field, rules)
    assert len(paths) == 1 and paths[0].is_closed
    gap, _, spots = gaps_of(paths[0], field.dropper, 0.003)
    assert gap.min() >= -TOLERANCE_MM
    off = np.linalg.norm(spots[:, :2] - (12, 10), axis=1)
    assert 7.3 - 0.021 < off.min() and off.max() < 7.3 + 1e-9


def test_a_quarter_of_the_tolerance_takes_twice_the_points():
    field = tip_field(GraphDropper(DOME, 3.0, 8.0), [0], ((-8, -8), (8, 8)), 0.5)
    counts = [len(tip_paths([line((-9, 0.3), (9, 0.3))], field,
                            PathRules(tolerance_mm=t, lateral_mm=0.01, bridge_mm=0.0))[0].tips_mm) - 1
              for t in (0.004, 0.001)]
    assert 1.8 < counts[1] / counts[0] < 2.2


def test_a_station_with_nothing_beneath_it_ends_its_run_and_a_run_of_one_is_none():
    """Where a ball just grazes a wall its contact comes and goes with the last bit: a program had a move to minus infinity."""
    tips = np.array([-np.inf, 1.0, 2.0, -np.inf, 3.0, 4.0, 5.0])
    assert tip_sampling._held(tips, np.array([0, 0, 0, 1, 1, 2, 2])).tolist() == [False, True, True, False, False, True, True]
