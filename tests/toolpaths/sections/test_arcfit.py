"""Fewest tangent arcs: deviation, tangents, ends, and how their number grows with the tolerance."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.sections.arcfit import fit_arcs, line_between
from cuspline.values.errors import ToolpathError

LARGEST_RADIUS_MM = 1e4
# an arc leaves its own tolerance between two of the measured points by less than the safety kept back
CURVES = {}


def curve(function):
    CURVES[function.__name__] = function
    return function


def sampled(x, y, dx, dy):
    return np.column_stack([x, y]), np.unwrap(np.arctan2(dy, dx))


@curve
def ellipse(n=6000):
    t = np.linspace(np.radians(170), np.radians(10), n)
    return sampled(20 * np.cos(t), 8 * np.sin(t), 20 * np.sin(t), -8 * np.cos(t))


@curve
def parabola(n=6000):
    x = np.linspace(-15, 25, n)
    return sampled(x, x * x / 40, np.ones(n), x / 20)


@curve
def sine(n=6000):
    x = np.linspace(0, 50, n)
    return sampled(x, 3 * np.sin(x / 4), np.ones(n), 0.75 * np.cos(x / 4))


@curve
def spiral(n=6000):
    t = np.linspace(0, 1.4, n)         # curvature grows evenly
    turn = t * t
    step = np.r_[0, np.diff(t)] * 20
    middle = np.r_[0, (turn[1:] + turn[:-1]) / 2]
    return np.column_stack([np.cumsum(step * np.cos(middle)), np.cumsum(step * np.sin(middle))]), turn


def headings(e):
    """Direction at start and end of an element."""
    if e.center is None:
        angle = math.atan2(e.end[1] - e.start[1], e.end[0] - e.start[0])
        return angle, angle
    turn = math.pi / 2 if e.is_left else -math.pi / 2
    return tuple(math.atan2(p[1] - e.center[1], p[0] - e.center[0]) + turn for p in (e.start, e.end))


def angle_between(a, b):
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


def deviations(elements, points):
    """(n,) distance of each curve point from the element that covers it."""
    rows = [int(np.argmin(np.linalg.norm(points - e.start, axis=1))) for e in elements] + [len(points) - 1]
    out = np.zeros(len(points))
    for e, first, last in zip(elements, rows, rows[1:]):
        p = points[first:last + 1]
        if e.center is None:
            d = np.subtract(e.end, e.start) / np.linalg.norm(np.subtract(e.end, e.start))
            out[first:last + 1] = np.abs((p - e.start) @ (-d[1], d[0]))
        else:
            out[first:last + 1] = np.abs(np.linalg.norm(p - e.center, axis=1) - e.radius)
    return out


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("tolerance", [0.05, 0.0024, 0.0005])
def test_arcs_stay_within_the_tolerance_everywhere(name, tolerance):
    points, angles = CURVES[name]()
    elements = fit_arcs(points, angles, tolerance, LARGEST_RADIUS_MM)
    assert deviations(elements, points).max() <= tolerance


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("tolerance", [0.05, 0.0024, 0.0005])
def test_arcs_join_tangentially_and_meet_both_ends(name, tolerance):
    points, angles = CURVES[name]()
    elements = fit_arcs(points, angles, tolerance, LARGEST_RADIUS_MM)
    assert elements[0].start == tuple(points[0]) and elements[-1].end == tuple(points[-1])
    joints = [angle_between(headings(a)[1], headings(b)[0]) for a, b in zip(elements, elements[1:])]
    assert all(a.end == b.start for a, b in zip(elements, elements[1:]))
    # by construction; the last joint of a closing biarc is one of the sampled points: 2e-3 rad
    assert max(joints, default=0.0) < 1e-7
    assert angle_between(headings(elements[0])[0], angles[0]) < 1e-7
    assert angle_between(headings(elements[-1])[1], angles[-1]) < 3e-3


@pytest.mark.parametrize("name", CURVES)
def test_the_number_of_arcs_grows_with_the_cube_root_of_the_tolerance(name):
    points, angles = CURVES[name](20000)
    tolerances = np.array([0.03, 0.003, 0.0003])
    counts = [len(fit_arcs(points, angles, t, LARGEST_RADIUS_MM)) for t in tolerances]
    # N ~ L (k' / tolerance)^(1/3) for arcs; polygons would need the square root
    order = -np.polyfit(np.log(tolerances), np.log(counts), 1)[0]
    assert 0.2 < order < 0.42, counts


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize("tolerance", [0.01, 0.0024])
def test_there_are_never_more_arcs_than_greedy_biarcs_with_exact_tangents_take(name, tolerance):
    # compared with: biarcs of equal tangent lengths between curve points, each as long as it can be
    points, angles = CURVES[name]()
    assert len(fit_arcs(points, angles, tolerance, LARGEST_RADIUS_MM)) <= greedy_biarcs(points, angles, tolerance)


def greedy_biarcs(points, angles, tolerance):
    """Arcs that a chain of longest biarcs needs."""
    first, count = 0, 0
    while first < len(points) - 1:
        low, high = first + 1, len(points) - 1
        while low < high:
            middle = (low + high + 1) // 2
            if biarc_deviation(points, angles, first, middle) <= tolerance:
                low = middle
            else:
                high = middle - 1
        first, count = low, count + 2
    return count


def biarc_deviation(points, angles, first, last):
    p, q = points[first], points[last]
    t, u = (np.array([np.cos(a), np.sin(a)]) for a in (angles[first], angles[last]))
    v, w = q - p, t + u
    a, b, c = 2 * (1 - t @ u), 2 * (v @ w), -(v @ v)        # a d² + b d + c = 0 for equal tangent lengths
    d = -c / b if abs(a) < 1e-12 else (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
    joint = (p + q + d * (t - u)) / 2
    rows = np.unique(np.linspace(first, last, 60).astype(int))
    split = points[rows] @ (q - p) < joint @ (q - p)
    return max(_off(points[rows[split]], p, t, joint), _off(points[rows[~split]], q, u, joint))


def _off(points, at, tangent, through):
    normal = np.array([-tangent[1], tangent[0]])
    lean = 2 * normal @ (through - at)
    if len(points) == 0:
        return 0.0
    if abs(lean) < 1e-12:
        return np.abs((points - at) @ normal).max()
    radius = (through - at) @ (through - at) / lean
    return np.abs(np.linalg.norm(points - at - radius * normal, axis=1) - abs(radius)).max()


def test_straight_points_give_one_line():
    x = np.linspace(0, 30, 500)
    elements = fit_arcs(np.column_stack([x, 0.3 * x]), np.full(500, math.atan(0.3)), 0.0024, LARGEST_RADIUS_MM)
    assert elements == [line_between((0, 0), (30, 0.3 * 30))]


def test_an_arc_gives_one_arc_with_its_own_centre():
    t = np.linspace(2.6, 0.4, 2000)
    points, angles = sampled(5 + 12 * np.cos(t), 3 + 12 * np.sin(t), np.sin(t), -np.cos(t))
    (element,) = fit_arcs(points, angles, 0.0024, LARGEST_RADIUS_MM)
    np.testing.assert_allclose(element.center, (5, 3), atol=1e-9)
    assert element.radius == pytest.approx(12) and not element.is_left


def test_a_break_in_the_curvature_is_a_joint():
    # an arc of radius 10 that goes over into one of radius 4 tangentially: two elements, joined there
    t, u = np.linspace(math.pi / 2 + 1, math.pi / 2, 700), np.linspace(math.pi / 2, 0.3, 700)[1:]
    points, angles = sampled(np.r_[10 * np.cos(t), 4 * np.cos(u)], np.r_[10 * np.sin(t), 6 + 4 * np.sin(u)],
                             np.r_[np.sin(t), np.sin(u)], np.r_[-np.cos(t), -np.cos(u)])
    elements = fit_arcs(points, angles, 0.001, LARGEST_RADIUS_MM, breaks=[699])
    assert [e.radius for e in elements] == pytest.approx([10, 4], abs=1e-6)
    np.testing.assert_allclose(elements[0].end, (0, 10), atol=1e-9)


def test_flatter_arcs_than_the_largest_radius_are_lines():
    t = np.linspace(math.pi / 2 + 5e-5, math.pi / 2 - 5e-5, 500)
    points, angles = sampled(2e5 * np.cos(t), 2e5 * (np.sin(t) - 1), np.sin(t), -np.cos(t))
    elements = fit_arcs(points, angles, 0.0024, LARGEST_RADIUS_MM)
    assert all(e.center is None for e in elements)
    assert deviations(elements, points).max() < 0.0024


@pytest.mark.parametrize("name", CURVES)
def test_the_tightest_tolerance_that_a_design_may_ask_for_is_kept(name):
    points, angles = CURVES[name](20000)        # 0.0002 mm less the rounding kept back
    assert deviations(fit_arcs(points, angles, 1e-4, LARGEST_RADIUS_MM), points).max() <= 1e-4


def test_a_tolerance_that_the_joints_cannot_keep_is_refused():
    points, angles = CURVES["sine"](20000)
    with pytest.raises(ToolpathError, match="a tolerance that 220 candidate ends of arcs cannot keep"):
        fit_arcs(points, angles, 1e-5, LARGEST_RADIUS_MM)


def test_a_kink_inside_a_curve_is_refused_with_its_place():
    x = np.linspace(0, 10, 400)
    points = np.column_stack([x, np.abs(x - 5)])
    with pytest.raises(ToolpathError, match="near .0.000, 5.000. within 0.001 mm: a kink"):
        fit_arcs(points, np.where(x < 5, -math.pi / 4, math.pi / 4), 0.001, LARGEST_RADIUS_MM)
