"""Lines and arcs along dense polylines: few, and within the tolerance of every point."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.roughing.path_arcs import lines_and_arcs

TOLERANCE_MM = 0.015


def _curve(t):
    """A line, a left quarter circle of radius 5 and a wavy end."""
    angle = np.linspace(0, math.pi / 2, 60)
    line = np.column_stack([np.linspace(-10, 0, 80), np.zeros(80)])
    arc = np.column_stack([5 * np.sin(angle), 5 - 5 * np.cos(angle)])
    s = np.linspace(0, 6, t)
    wave = np.column_stack([5 + np.sin(s), 5 + s])
    return np.vstack([line, arc[1:], wave[1:]])


def _gap_mm(points, first, row):
    """Largest distance of the points of one element from it."""
    last, turn, center = int(row[0]), row[1], row[2:4]
    part = points[first:last + 1]
    if turn:
        radius = np.linalg.norm(part[0] - center)
        return np.abs(np.linalg.norm(part - center, axis=1) - radius).max()
    along = (part[-1] - part[0]) / np.linalg.norm(part[-1] - part[0])
    rel = part - part[0]
    return np.abs(rel[:, 0] * along[1] - rel[:, 1] * along[0]).max()


def test_every_point_lies_within_the_tolerance_of_its_element_and_none_is_left_out():
    points = _curve(300)
    elements, first = lines_and_arcs(points, TOLERANCE_MM), 0
    for row in elements:
        assert row[0] > first and _gap_mm(points, first, row) <= TOLERANCE_MM + 1e-12
        first = int(row[0])
    assert first == len(points) - 1
    assert len(elements) < 12


@pytest.mark.parametrize("sign", [1, -1])
def test_a_circle_becomes_arcs_of_its_radius_that_turn_its_way(sign):
    angle = np.linspace(0, 5.5, 400)
    points = np.column_stack([7 * np.cos(angle), sign * 7 * np.sin(angle)])
    elements = lines_and_arcs(points, TOLERANCE_MM)
    assert (elements[:, 1] == sign).all()
    assert np.abs(elements[:, 2:4]).max() < 1e-9


def test_a_straight_polyline_is_one_line_and_a_corner_is_kept():
    x = np.linspace(0, 9, 50)
    corner = np.vstack([np.column_stack([x, 0 * x]), np.column_stack([0 * x[1:] + 9, x[1:]])])
    elements = lines_and_arcs(corner, TOLERANCE_MM)
    assert elements[:, :2].tolist() == [[49, 0], [98, 0]]


def test_a_path_that_turns_back_on_itself_is_not_shortened():
    x = np.r_[np.linspace(0, 5, 20), np.linspace(5, 2, 20)[1:]]
    elements = lines_and_arcs(np.column_stack([x, 0 * x]), TOLERANCE_MM)
    assert 19 in elements[:, 0]
