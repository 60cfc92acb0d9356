"""Cusp on the common plane of neighbouring contacts, beside closed forms."""

import math

import numpy as np
import pytest

from cuspline.scallop.common_plane import OUTLINE_MM, CommonPlane, close_outline_mm, common_plane_cusp_mm
from cuspline.scallop.common_plane import trace_mm as trace_of_outline_mm
from cuspline.scallop.cusp import Stance, cutter_scallop_mm, effective_radius_mm
from cuspline.scallop.stepover import scallop_for_stepover_mm
from cuspline.shop.cutter_profile import apt_profile
from cuspline.values.errors import PlanError

INCH = 25.4
UP = np.array([0.0, 0.0, 1.0])


def trace_mm(plane, profile, tips_mm, axes):
    return trace_of_outline_mm(plane, close_outline_mm(profile), tips_mm, axes)


def ball(r):
    return apt_profile(2 * r, r, 0, r, 0, 0, 3 * r)


def flat(r):
    return apt_profile(2 * r, 0, r, 0, 0, 0, 3 * r)


def torus(r, corner):
    return apt_profile(2 * r, corner, r - corner, corner, 0, 0, 3 * r)


def leaning(normal, feed, lead=0.0, tilt=0.0):
    """The axis at angles to a normal, tilted toward normal x feed."""
    return (math.cos(tilt) * (math.cos(lead) * normal + math.sin(lead) * feed) + math.sin(tilt) * np.cross(normal, feed))


def tip_at(profile, contact, normal, axis):
    """Where the tip is when the cutter touches there."""
    angle = math.atan2(np.linalg.norm(np.cross(axis, -normal)), float(axis @ -normal))
    far, _ = profile.support(np.array([angle]))
    _, point = profile.support(np.array([angle]))
    r, z = point[0]
    across = -normal - float(axis @ -normal) * axis
    size = np.linalg.norm(across)
    return contact - z * axis - (r * across / size if size > 1e-12 else 0.0)


def straight_pass(profile, contact, axis, before, behind, count=4001):
    """Positions of a pass along X that touches at a contact of the plane z = 0."""
    tip = tip_at(profile, contact, UP, axis)
    x = np.linspace(-before, behind, count)
    return tip + x[:, None] * (1.0, 0.0, 0.0), np.tile(axis, (count, 1))


def cusp_of(profile, step, lead=0.0, tilt=0.0, reach=2.0):
    """On a flat, two passes along X a step apart."""
    contacts = np.array([[0.0, 0.0, 0.0], [0.0, step, 0.0]])
    plane = CommonPlane.of(contacts, np.array([UP, UP]))
    axis = leaning(UP, np.array([1.0, 0.0, 0.0]), lead, tilt)
    return common_plane_cusp_mm(plane, [trace_mm(plane, profile, *straight_pass(profile, c, axis, reach, reach)) for c in contacts])


@pytest.mark.parametrize("axis", [(0.0, 0.0), (0.2, 0.0), (0.1, -0.3)])
def test_a_ball_leaves_what_two_circles_leave_however_it_leans(axis):
    assert cusp_of(ball(12.7), 1.27, *axis, reach=0.5) == pytest.approx(scallop_for_stepover_mm(12.7, 1.27, 0.0)[0], rel=2e-3)


@pytest.mark.parametrize("curvature", [0.05, -0.05])
def test_a_ball_round_a_cylinder_leaves_its_closed_form(curvature):
    """Convex and concave, of radius 20; the contacts' chord is the step."""
    r, step, rho = 6.0, 1.0, 1.0 / abs(curvature)
    half = math.asin(step / (2 * rho))
    side = math.copysign(1.0, curvature)
    normals = np.array([[0.0, -side * math.sin(half), math.cos(half)], [0.0, side * math.sin(half), math.cos(half)]])
    contacts = np.array([[0.0, -step / 2, 0.0], [0.0, step / 2, 0.0]])
    plane = CommonPlane.of(contacts, normals)
    x = np.linspace(-0.5, 0.5, 2001)[:, None] * (1.0, 0.0, 0.0)
    traces = [trace_mm(plane, ball(r), c + r * n - r * UP + x, np.tile(UP, (len(x), 1))) for c, n in zip(contacts, normals)]
    exact = scallop_for_stepover_mm(r, step, curvature)[0]
    assert common_plane_cusp_mm(plane, traces, curvature) == pytest.approx(exact, rel=3e-3)


def test_a_flat_cutter_leading_by_five_degrees():
    """Its rim, an ellipse of half axes 10 and 10 sin 5 deg: a step of 4 mm leaves 0.017609."""
    assert cusp_of(flat(10.0), 4.0, lead=math.radians(5.0)) == pytest.approx(0.017609, abs=2e-6)


@pytest.mark.parametrize("lead, radius, step", [(5, 9.7148, 0.17632), (10, 4.8914, 0.12511), (20, 2.4987, 0.08942)])
def test_a_torus_leaves_what_its_effective_radius_does(lead, radius, step):
    """R 0.875 in, insert 0.031 in: the steps for 0.0004 in; a circle of that radius is 0.3 % flatter there than the ellipse."""
    profile, angle = torus(0.875 * INCH, 0.031 * INCH), math.radians(lead)
    assert effective_radius_mm(0.875, 0.031, angle) == pytest.approx(radius, abs=5e-5)
    cusp = cusp_of(profile, step * INCH, lead=angle, reach=0.5)
    assert cusp == pytest.approx(0.0004 * INCH, rel=4e-3)
    assert cusp == pytest.approx(cutter_scallop_mm(profile, step * INCH, 0.0, Stance(lead_rad=angle))[0], abs=OUTLINE_MM)


@pytest.mark.parametrize("tilt", [2.0, 10.0, 30.0])
def test_a_flat_cutter_tilted_across_leaves_triangles(tilt):
    """h = s sin t cos t, as long as the flat is wider than the step."""
    t = math.radians(tilt)
    assert cusp_of(flat(10.0), 1.5, tilt=t, reach=1.0) == pytest.approx(1.5 * math.sin(t) * math.cos(t), rel=3e-3)


def test_passes_that_lean_differently_are_measured_as_they_run():
    """One leads by 5, its neighbour by 20 degrees: the cusp lies between those of two alike, as two unlike ellipses cross."""
    profile, step = flat(10.0), 3.0
    contacts = np.array([[0.0, 0.0, 0.0], [0.0, step, 0.0]])
    plane = CommonPlane.of(contacts, np.array([UP, UP]))
    traces = [trace_mm(plane, profile, *straight_pass(profile, c, leaning(UP, np.array([1.0, 0, 0]), math.radians(d)), 2.0, 2.0))
              for c, d in zip(contacts, (5.0, 20.0))]
    low = lambda d, y: 10.0 * math.sin(math.radians(d)) * (1.0 - math.sqrt(1.0 - (y / 10.0) ** 2))
    y = np.linspace(0.0, step, 20001)
    exact = max(min(low(5.0, v), low(20.0, step - v)) for v in y)
    assert common_plane_cusp_mm(plane, traces) == pytest.approx(exact, rel=2e-3)


def test_an_axis_that_turns_in_the_cut_leaves_no_more_than_its_steepest_and_no_less_than_its_flattest():
    profile, step = torus(10.0, 1.0), 2.0
    contacts = np.array([[0.0, 0.0, 0.0], [0.0, step, 0.0]])
    plane = CommonPlane.of(contacts, np.array([UP, UP]))
    x = np.linspace(-1.0, 1.0, 2001)
    lead = math.radians(10.0) + 0.1 * x
    axes = np.array([leaning(UP, np.array([1.0, 0, 0]), a) for a in lead])
    traces = [trace_mm(plane, profile, np.array([tip_at(profile, c + (u, 0, 0), UP, a) for u, a in zip(x, axes)]), axes)
              for c in contacts]
    alike = [cutter_scallop_mm(profile, step, 0.0, Stance(lead_rad=a))[0] for a in (lead[0], lead[-1])]
    assert alike[0] <= common_plane_cusp_mm(plane, traces) <= alike[1]


def test_no_common_plane_is_refused():
    with pytest.raises(PlanError, match="no common plane"):
        CommonPlane.of(np.array([[0, 0, 0], [0, 0, 0.0]]), np.array([UP, UP]))
    with pytest.raises(PlanError, match="no common plane"):
        CommonPlane.of(np.array([[0, 0, 0], [0, 1, 0.0]]), np.array([UP, -UP]))
