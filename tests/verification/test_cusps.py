"""Cusps as cut agree with the formula for the step that the posted passes have, on flats, ridges and hollows."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, raster, tool

from cuspline.kernel import brep
from cuspline.program.program import Plane
from cuspline.scallop.stepover import scallop_for_stepover_mm
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame
from cuspline.verification.climbing import Ground
from cuspline.verification.cusps import SampledStock, centers_mm, measured_cusps
from cuspline.verification.samples import sample_faces

R, SPACING, FINE_MM = 5.0, 0.5, 1e-4


def measured(faces, moves, high):
    """Cusps of faces cut by a ball, and the heights of the samples."""
    posted = program((-6, -3, 40), moves)
    blank = BoxShape(min_mm=(0, -8, 0), max_mm=high)
    piece = Workpiece(blank=blank).after(Frame.shift((0, 0, 0)), swept_paths(posted, {1: tool("ball", 2 * R)}))
    s = sample_faces(faces, SPACING)
    height, row = (a[0] for a in piece.deviations_of_cuts(s.points_mm, s.normals, 2.0))
    feeds = (posted.end_mm - posted.start_mm)[row]
    sampled = SampledStock(ground=Ground.of_faces(faces), samples=s, spacing_mm=SPACING, feed=feeds,
                           height_mm=np.where(height < 0.05, height, -np.inf))
    return measured_cusps(sampled, piece.cuts[0], posted, piece.heights(1.0), lambda p, n: piece.deviations(p, n, 2.0)[0], [7])


def test_uneven_steps_are_measured_one_by_one():
    steps = np.array([0.4, 0.7, 0.5, 0.6] * 5)
    ys = np.concatenate([[-0.2], -0.2 + np.cumsum(steps)])
    top = [f for f in brep.faces_of(brep.the_solid(cq.Workplane().box(12, 9, 10, centered=False))) if f.middle.normal[0, 2] > 0.5]
    cusps = measured(top, [rapid(-6, -3, 14), *raster((-6, 18), ys, 10.0)], (12, 9, 12))
    gap = np.searchsorted(ys, cusps.point_mm[:, 1])
    assert np.abs(cusps.step_mm - (ys[gap] - ys[gap - 1])).max() < 1e-3
    assert np.abs(cusps.point_mm[:, 1] - (ys[gap] + ys[gap - 1]) / 2).max() < 2e-3
    assert np.abs(cusps.height_mm - cusps.formula_mm).max() < FINE_MM
    (row,) = cusps.as_rows(0.01)
    assert row["face"] == 7 and row["operation"] == "finish" and row["share_within_10_percent"] == 1.0
    assert row["measured_mm"]["max"] == pytest.approx(R - np.sqrt(R**2 - 0.35**2), abs=1e-5)


@pytest.mark.parametrize("side,rho", [(1, 20.0), (-1, 20.0)])
def test_curvature_across_counts(side, rho):
    """Passes along x over a ridge or a hollow of radius rho whose axis lies along x."""
    plate = cq.Workplane().box(12, 16, 10, centered=(False, True, False))
    round_ = cq.Workplane("YZ").center(0, 10 - side * rho).circle(rho).extrude(12)
    solid = brep.the_solid(plate.intersect(round_) if side > 0 else plate.cut(round_.translate((0, 0, -1.0))))
    faces = [f for f in brep.faces_of(solid) if f.kind == "cylinder"]
    axis_z = 10 - rho if side > 0 else 9 + rho
    turn = np.linspace(-0.3, 0.3, 31)
    moves = [rapid(-6, -6, 30)]
    for a in turn:
        y, z = (rho + side * R) * np.sin(a), axis_z + side * (rho + side * R) * np.cos(a) - R
        moves += [feed(-6, y, z), feed(18, y, z), rapid(18, y, 30), rapid(-6, y, 30)]
    cusps = measured(faces, moves, (12, 16, 12))
    chord = 2 * rho * np.sin((turn[1] - turn[0]) / 2)
    inner = np.abs(cusps.point_mm[:, 1]) < rho * np.sin(0.25)
    wanted = scallop_for_stepover_mm(R, chord, side / rho)[0]
    assert inner.sum() > 100 and np.abs(cusps.step_mm[inner] - chord).max() < 1e-3
    assert np.abs(cusps.formula_mm[inner] - wanted).max() < FINE_MM / 5
    assert np.abs(cusps.height_mm[inner] - wanted).max() < FINE_MM


def test_centres_stand_on_lines_and_arcs_nearest_to_a_point():
    moves = [feed(10, 0, 5), arc((0, 0, 5), (5, 0, 5), Plane.ZX)]
    posted = program((0, 0, 5), moves)
    found = centers_mm(posted, np.array([0, 1]), np.array([[3.0, 2, 1], [5.0, 1, 40]]), np.array([2.0, 2.0]))
    assert np.allclose(found[0], (3, 0, 7)) and np.allclose(found[1], (5, 0, 12))
