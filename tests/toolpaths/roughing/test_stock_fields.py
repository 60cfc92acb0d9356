"""What moves leave of the stock, against the cutter put down at many places along them."""

import math

import numpy as np
import pytest

from cuspline.program.program import MoveWriter, Plane
from cuspline.toolpaths.roughing.stock_fields import box_stock, lines_of_moves, points_of_move, stock_after, swept_by_lines

RADIUS_MM = 3.0


def _moves():
    writer = MoveWriter((2.0, 2.0, 12.0))
    writer.feed((2.0, 2.0, 7.0), 500.0)
    writer.feed((12.0, 4.0, 6.0), 500.0)
    writer.arc((12.0, 12.0, 6.0), (12.0, 8.0, 6.0), Plane.XY, False, 500.0)
    writer.feed((4.0, 12.0, 8.0), 500.0)
    return writer.moves()


def _bottom(d, corner):
    """Height of the cutter's bottom over its tip at a distance from the axis."""
    e = np.maximum(d - (RADIUS_MM - corner), 0.0)
    return np.where(d <= RADIUS_MM, corner - np.sqrt(np.maximum(corner ** 2 - e ** 2, 0.0)), np.inf)


@pytest.mark.parametrize("corner", [1.0, RADIUS_MM])
def test_the_stock_left_is_what_the_cutter_put_down_along_the_path_leaves(corner):
    moves, height = _moves(), box_stock((0, 0, 0), (20, 16, 10))
    xy = np.random.default_rng(2).uniform((-1, -1), (21, 17), (300, 2))
    left = stock_after(moves, RADIUS_MM, corner, height)(xy)
    slow = height(xy)
    for k in range(len(moves)):
        points = points_of_move(moves, k)
        for a, b in zip(points, points[1:]):
            for p in np.linspace(a, b, max(2, math.ceil(np.linalg.norm(b - a) / 0.01))):
                slow = np.minimum(slow, p[2] + _bottom(np.linalg.norm(xy - p[:2], axis=1), corner))
    told = np.isfinite(slow)
    assert np.array_equal(told, np.isfinite(left))
    assert (left[told] <= slow[told] + 2e-3).all()      # samples leave more than the sweep, chords 1e-3 mm
    assert np.percentile(slow[told] - left[told], 95) < 5e-3
    assert (slow < height(xy) - 0.5)[told].sum() > 50


def test_beside_the_box_there_is_no_stock_before_or_after():
    left = stock_after(_moves(), RADIUS_MM, 0.0, box_stock((0, 0, 0), (20, 16, 10)))
    assert left(np.array([[30.0, 5.0]]))[0] == -np.inf


def test_asked_where_it_is_lower_the_swept_height_is_the_lower_of_both():
    swept = swept_by_lines(lines_of_moves(_moves()), RADIUS_MM, 1.0)
    rng = np.random.default_rng(4)
    xy, other = rng.uniform((-1, -1), (21, 17), (400, 2)), rng.uniform(5, 12, 400)
    whole = swept(xy)
    assert np.isinf(whole).any() and (whole < other).any() and (other < whole).any()
    assert np.array_equal(swept(xy, other), np.minimum(whole, other))
