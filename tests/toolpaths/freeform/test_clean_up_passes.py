"""What paths leave is what two balls side by side leave, and a touch-up asks only where that is too much."""

import cadquery as cq
import numpy as np
import pytest
from known_droppers import Graph, GraphDropper

from cuspline.kernel.brep import faces_of, the_solid
from cuspline.toolpaths.drop.exact_dropper import ExactDropper
from cuspline.toolpaths.freeform.clean_up_passes import is_left, region_left
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_paths import TipPath
from cuspline.toolpaths.roughing.stock_fields import swept_by_lines

LEVEL = Graph(lambda x, y: 0 * x, lambda x, y: (0 * x, 0 * x))


def plane_field(radius_mm, pitch_mm):
    return tip_field(GraphDropper(LEVEL, radius_mm, 5.0), [0], ((-5, -5), (5, 5)), pitch_mm)


def lines(field, step_mm):
    """Straight paths along x, `step_mm` apart, on the plane z = 0."""
    y = np.arange(field.y_mm[0], field.y_mm[-1] + step_mm, step_mm)
    x = field.x_mm[[0, -1]]
    return [TipPath(tips_mm=[(x[0], c, 0.0), (x[1], c, 0.0)], is_closed=False, curve=k) for k, c in enumerate(y)]


def swept(paths):
    """What a ball of 3 mm sweeps along paths, as the functions asked take it."""
    return [swept_by_lines([p.tips_mm for p in paths], 3.0, 3.0)]


def test_between_two_passes_the_cusp_is_the_closed_form():
    field, r, step = plane_field(radius_mm=3.0, pitch_mm=0.05), 3.0, 0.6
    paths = lines(field, step)
    y = field.contact_mm[..., 1] - field.y_mm[0]
    off = np.abs((y + step / 2) % step - step / 2)
    inner = field.is_inside & (np.abs(field.contact_mm[..., 0]) < 4)
    inner &= np.abs(field.contact_mm[..., 1]) < 4
    true = (r - np.sqrt(r ** 2 - off ** 2))[inner]
    for height in (0.0005, 0.005, 0.0149):
        left, sure = is_left(field, swept(paths), height)[inner], np.abs(true - height) > 1e-9
        assert (left[sure] == (true[sure] > height)).all() and left.any() and not left.all()


def test_a_missing_pass_is_found_where_it_is_missing_and_nowhere_else():
    field, step = plane_field(radius_mm=3.0, pitch_mm=0.05), 0.4
    paths = lines(field, step)
    gone = len(paths) // 2
    height = 3.0 - np.sqrt(9.0 - 0.2 ** 2)
    assert region_left(field, swept(paths), 1.2 * height, 0.1) is None
    found = region_left(field, swept(paths[:gone] + paths[gone + 1:]), 1.2 * height, 0.1)
    middle = paths[gone].tips_mm[0, 1]
    y = found.node_xy_mm[found.is_inside][:, 1]
    assert np.abs(y - middle).max() < step and found.is_inside.any()


def test_a_large_ball_leaves_its_own_radius_in_a_corner_to_a_small_one():
    """Floor and wall under 90 degrees: a ball of 4 along the corner leaves 4 - sqrt(16 - (4 - x)²) at x off it."""
    part = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (30, 15), (20, 15), (20, 5), (0, 5)]).close().extrude(-10)
    faces = faces_of(the_solid(part))
    floor = [i for i, f in enumerate(faces) if f.middle.normal[0, 2] > 0.9 and abs(f.middle.point_mm[0, 2] - 5) < 1e-6]
    small = tip_field(ExactDropper.of_faces(faces, 1.0, 1.0), floor, ((0, 0), (20, 10)), 0.125)
    large = swept_by_lines([np.array([(x, -4.0, 5.0), (x, 14.0, 5.0)]) for x in np.arange(0.0, 16.01, 0.25)], 4.0, 4.0)
    x, y = small.node_xy_mm[..., 0], small.node_xy_mm[..., 1]
    # the last node speaks for the ground up to the wall
    row = small.is_inside & (np.abs(y - 5) < 3) & (x > 16.2) & (x < 18.7)
    true = 4 - np.sqrt(16 - (x[row] - 16) ** 2)
    for height in (0.02, 0.3, 0.7):
        left, sure = is_left(small, [large], height)[row], np.abs(true - height) > 1e-9
        assert (left[sure] == (true[sure] > height)).all() and left.any() and not left.all()
    rest = region_left(small, [large], 0.01, 0.5)
    reached = x[rest.is_inside & (np.abs(y - 5) < 3)].min()
    assert reached == pytest.approx(16 + np.sqrt(16 - 3.99 ** 2) - 0.5, abs=0.15)
