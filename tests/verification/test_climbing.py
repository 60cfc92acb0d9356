"""Tops between samples are found to 0.1 um, whatever cutter leaves them and however short they are."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, raster, tool

from cuspline.kernel import brep
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame
from cuspline.verification.climbing import Ground, bottoms_of, tops_of
from cuspline.verification.samples import sample_faces

R, STEP, SPACING = 5.0, 0.6, 0.6
FINE_MM = 1e-4
BLOCK = brep.the_solid(cq.Workplane().box(12, 9, 10, centered=False))
TOP = [f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > 0.5]
YS = -0.3 + STEP * np.arange(17)
CUSP = R - np.sqrt(R**2 - STEP**2 / 4)


def found(moves, tools, faces=TOP, spacing=SPACING, sign=1):
    """(points, heights) of the tops, the highest sample and the workpiece."""
    posted = program((-6, -0.3, 40), moves)
    blank = BoxShape(min_mm=(0, 0, 0), max_mm=(12, 9, 12))
    piece = Workpiece(blank=blank).after(Frame.shift((0, 0, 0)), swept_paths(posted, {1: tools}))
    s = sample_faces(faces, spacing)
    heights, rows = (a[0] for a in piece.deviations_of_cuts(s.points_mm, s.normals, 2.0))
    way = (posted.end_mm - posted.start_mm)[rows]
    ground = Ground.of_faces(faces)
    tops = tops_of(ground, s.points_mm, s.face, sign * heights, way, piece.heights(sign), spacing)
    places = ground.places(tops.face, tops.u, tops.v)
    exact = piece.deviations(places.point_mm, places.normal, 2.0)[0]
    return places.point_mm, sign * exact, (sign * heights).max(), piece


def raster_at(ys, z=10.0):
    return [rapid(-6, -0.3, 14), *raster((-6, 18), ys, z), rapid(18, 9, 14)]


def straight(y, *pieces):
    """A pass along x that is lifted off between given places."""
    moves = [rapid(-6, y, 14), feed(-6, y, 10)]
    for a, b in pieces:
        moves += [feed(a, y, 10), rapid(a, y, 14), rapid(b, y, 14), feed(b, y, 10)]
    return [*moves, feed(18, y, 10), rapid(18, y, 14)]


@pytest.mark.parametrize("cutter,radius", [(tool("ball", 10), 5.0), (tool("ball", 6), 3.0), (tool("bull_nose", 10, 2.0), None)])
def test_the_cusp_of_even_passes_is_exact(cutter, radius):
    step = STEP if radius else 2 * (3.0 + 0.2)      # flat of 3 mm radius, the corner then rises over 0.2 mm
    ys = -0.3 + step * np.arange(17)
    cusp = radius - np.sqrt(radius**2 - step**2 / 4) if radius else 2 - np.sqrt(4 - 0.2**2)
    _, heights, sampled, _ = found(raster_at(ys), cutter)
    assert abs(heights.max() - cusp) < (1e-7 if radius else 1e-6) and sampled < cusp - 1e-6


def test_one_ridge_higher_than_all_the_others_is_found():
    step = np.sqrt(4 * (2 * R * (CUSP + 0.003) - (CUSP + 0.003)**2))
    ys = np.concatenate([YS[:8], YS[7] + step + STEP * np.arange(9)])
    points, heights, _, _ = found(raster_at(ys), tool("ball", 10))
    best = heights.argmax()
    assert abs(heights[best] - CUSP - 0.003) < FINE_MM and abs(points[best, 1] - YS[7] - step / 2) < 0.01


@pytest.mark.parametrize("at", [3.1, 6.07, 8.93])
def test_a_stretch_of_a_pass_missing_over_0_3_mm_is_found(at):
    moves = [m for k, y in enumerate(YS) for m in straight(y, *([(at, at + 0.3)] if k == 7 else []))]
    points, heights, _, _ = found(moves, tool("ball", 10))
    aside = (STEP**2 - 0.15**2) / (2 * STEP)                       # as far from both ends as from the next pass
    best = heights.argmax()
    assert abs(heights[best] - R + np.sqrt(R**2 - (STEP - aside)**2)) < FINE_MM
    assert abs(points[best, 0] - at - 0.15) < 0.01 and abs(abs(points[best, 1] - YS[7]) - aside) < 0.01


def test_the_bottom_of_a_gouge_that_no_sample_sees_is_found():
    at, deep = 5.37, 0.004                                         # a dimple of 0.2 mm radius
    moves = [*raster_at(YS), rapid(at, 4.0, 14), feed(at, 4.0, 10 - deep), rapid(at, 4.0, 14)]
    _, none, sampled, piece = found(moves, tool("ball", 10), sign=-1)
    assert sampled <= 0 and not len(none)
    s, ground = sample_faces(TOP, SPACING), Ground.of_faces(TOP)
    tips = np.array([m[1] for m in moves])
    below = bottoms_of(ground, s.points_mm, s.normals, s.face, [(tips, np.array([0, 0, 1.0]), 0.0, R)],
                       piece.heights(-1), SPACING)
    best = below.height_mm.argmax()
    place = ground.places(below.face, below.u, below.v).point_mm[best]
    assert abs(below.height_mm[best] - deep) < 1e-7 and np.hypot(*(place[:2] - (at, 4.0))) < 0.002


def test_no_place_of_a_dense_grid_is_higher_than_what_was_found():
    rng = np.random.default_rng(3)
    ys = np.cumsum(rng.uniform(0.4, 0.8, 22)) - 1
    moves = [m for k, y in enumerate(ys)
             for m in straight(y, *([tuple(rng.uniform(2, 9) + np.array((0, 0.4)))] if k % 3 == 0 else []))]
    _, heights, _, piece = found(moves, tool("ball", 10))
    x, y = np.meshgrid(np.arange(0.05, 12, 0.05), np.arange(0.05, 9, 0.03))
    grid = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 10.0)])
    dense = piece.cut_distance_mm(grid).max()
    assert dense <= heights.max() + FINE_MM


def test_a_sphere_cut_in_rings_shows_the_cusp_of_the_formula():
    from cuspline.scallop.stepover import scallop_for_stepover_mm
    dome = brep.the_solid(cq.Workplane().sphere(12).intersect(cq.Workplane().box(16, 16, 12, centered=(True, True, False))))
    faces = [f for f in brep.faces_of(dome) if f.kind == "sphere"]
    turn, moves = 0.6 / 12, [rapid(0, 0, 20)]
    polar = turn * np.arange(12)
    for angle in polar:                     # polygons so fine that their chords do not count
        rings = np.linspace(0, 2 * np.pi, 1 if angle == 0 else 720)
        tips = np.column_stack([17 * np.sin(angle) * np.cos(rings), 17 * np.sin(angle) * np.sin(rings),
                                np.full(len(rings), 17 * np.cos(angle) - R)])
        moves += [feed(*tip) for tip in tips]
    posted = program((0, 0, 40), moves)
    blank = BoxShape(min_mm=(-8, -8, 0), max_mm=(8, 8, 13))
    piece = Workpiece(blank=blank).after(Frame.shift((0, 0, 0)), swept_paths(posted, {1: tool("ball", 10)}))
    s = sample_faces(faces, SPACING)
    near = np.arccos(np.clip(s.points_mm[:, 2] / 12, -1, 1)) < polar[-2]
    heights, rows = (a[0] for a in piece.deviations_of_cuts(s.points_mm, s.normals, 2.0))
    ground = Ground.of_faces(faces)
    tops = tops_of(ground, s.points_mm, s.face, np.where(near, heights, -np.inf), (posted.end_mm - posted.start_mm)[rows],
                   piece.heights(1), SPACING)
    places = ground.places(tops.face, tops.u, tops.v)
    inner = np.arccos(np.clip(places.point_mm[:, 2] / 12, -1, 1)) < polar[-2]
    exact = piece.deviations(places.point_mm, places.normal, 2.0)[0][inner]
    chord = 2 * 12 * np.sin(turn / 2)
    assert abs(np.median(exact) - scallop_for_stepover_mm(R, chord, 1 / 12)[0]) < FINE_MM
