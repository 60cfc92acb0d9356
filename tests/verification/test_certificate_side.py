"""The certificate of a side-and-face cutter whose axis leans: closed forms, brute force, cutters inside the part."""

from dataclasses import replace

import numpy as np
import pytest
from exact_parts import patch_solid, random_poles
from known_programs import arc, feed, program, rapid
from known_surfaces import wedge
from known_tools import on_a_head
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from cuspline.kernel import brep
from cuspline.program.program import Plane
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.gouge.move_depths import DEEP_SHARE, move_depths
from cuspline.verification.certificate import certify
from cuspline.verification.certificate_side import SideViews, frame_along

TOLERANCE_MM = 1e-3
TOOL = on_a_head()                  # R 25, teeth R3, 6 mm wide
R, RC, WIDE = 25.0, 3.0, 6.0
ALONG_X = (1.0, 0.0, 0.0)


def bounds(posted, solid, axis=ALONG_X, tolerance_mm=TOLERANCE_MM):
    axes = np.tile(axis, (len(posted), 1))
    return certify(replace(posted, start_axis=axes, end_axis=axes), {7: TOOL}, ExactPart.of_solid(solid), solid=solid,
                   tolerance_mm=tolerance_mm)


def is_close(bound, true):
    """Not below the truth, and no farther above it than promised."""
    slack = np.maximum(TOLERANCE_MM, DEEP_SHARE * true)
    return (bound >= true - 1e-9).all() and (bound <= true + slack + 2e-5).all()


def depth_of(points, R, rc, wide):
    """(...,) depth of points (..., 3) in the cutter's frame, as seen from its tip."""
    e = np.hypot(points[..., 0], points[..., 1]) - (R - rc)
    f = np.maximum(rc - points[..., 2], points[..., 2] - (wide - rc))
    return rc - np.where((e > 0) & (f > 0), np.hypot(e, f), np.maximum(e, f))


@pytest.mark.parametrize("into", [0.3, 0.008, 0.0, -1e-6])
def test_a_disc_that_rolls_round_a_rod_cuts_as_deep_as_its_arc_is_too_low(into):
    """The rod lies along the cutter's axis: all its faces stand upright as the cutter sees them."""
    rod = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(-20, 0, 0), gp_Dir(1, 0, 0)), 10.0, 40.0).Solid()
    far = 10.0 + R - into
    quarter = lambda *end: arc(end, (np.nan, 0, 0), Plane.YZ, True)
    posted = program((0, -far, 0), [quarter(0, 0, far), quarter(0, far, 0)], tool_number=7)
    found = bounds(posted, rod)
    assert found.is_complete and is_close(found.bound_mm, np.full(2, max(into, 0.0)))


def test_a_disc_over_a_sphere_cuts_with_the_rim_that_is_nearest():
    """Along its axis from the top the rim's core is as far from the sphere's middle as a right triangle says."""
    ball = BRepPrimAPI_MakeSphere(10.0).Solid()
    middle, low = np.array([-2.0, -0.4, 0.0, 1.0, 4.0]), 34.95
    moves = [m for x in middle for m in (rapid(x - WIDE / 2, -9, 60), rapid(x - WIDE / 2, -9, low), feed(x - WIDE / 2, 9, low))]
    found = bounds(program((0, 0, 60), moves, tool_number=7), ball).bound_mm[2::3]
    assert is_close(found, np.maximum(RC + 10.0 - np.hypot(middle, low - R + RC), 0.0))


def test_a_disc_all_inside_a_block_is_as_deep_as_it_is_thick():
    block = BRepPrimAPI_MakeBox(200.0, 200.0, 200.0).Solid()
    inside = program((100, 100, 100), [feed(110, 100, 100)], tool_number=7)
    assert bounds(inside, block).bound_mm[0] == pytest.approx(RC, abs=1e-9)
    through = program((100, 100, 300), [feed(100, 100, 100), feed(110, 100, 100), rapid(100, 100, 300)], tool_number=7)
    assert bounds(through, block).bound_mm == pytest.approx(np.full(3, RC), abs=1e-4)


@pytest.mark.parametrize("axis, R, rc, wide", [(ALONG_X, 6.0, 1.5, 3.0), ((0.0, -1.0, 0.0), 5.0, 0.6, 4.0),
                                               ((0.6, 0.0, 0.8), 6.0, 1.5, 3.0)])
def test_bounds_are_no_lower_and_hardly_higher_than_dense_samples(axis, R, rc, wide):
    rng, axis = np.random.default_rng(7), np.array(axis)
    solid = patch_solid(random_poles(3), -8.0)
    top = max(brep.faces_of(solid), key=lambda f: f.middle.point_mm[0, 2])
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, 150), np.linspace(0, 1, 120)))
    points, frame, times = top.nurbs.derivatives(u, v)[:, 0], frame_along(axis), np.linspace(0, 1, 3)
    start, end = [], []
    for depth in (0.3, 0.02, 0.02, 0.0, -0.05):
        a = rng.uniform((9, 9, 0), (21, 15, 0))
        way = rng.normal(0, 1, 3) * (1, 1, 0.1)
        deepest = lambda z: max(depth_of(frame.into(points - a - t * way - (0, 0, z)), R, rc, wide).max() for t in times)
        z = 30.0                                    # down onto the hills, never past the first contact
        for _ in range(25):
            z -= depth - deepest(z)
        start.append(a + (0, 0, z))
        end.append(a + way + (0, 0, z))
    start, end = np.array(start), np.array(end)
    cutter = TOOL.cutter.model_copy(update={"diameter_mm": 2 * R, "corner_radius_mm": rc, "flute_length_mm": wide})
    views = SideViews(solid=solid, axis=tuple(axis.tolist()), thickness_mm=TOLERANCE_MM)
    bound, share, place = views.depths(start, end, cutter, 0.0, TOLERANCE_MM, move_depths)
    seen = lambda points, tips: depth_of(frame.into(points - tips), R, rc, wide)
    sampled = np.array([max(seen(points, a + t * (b - a)).max() for t in times) for a, b in zip(start, end)])
    found = seen(place, start + share[:, None] * (end - start))
    assert (bound >= sampled - 1e-9).all() and (sampled[:3] > 0.01).all()
    assert is_close(bound, np.fmax(np.maximum(sampled, 0.0), found))


def test_a_disc_whose_axis_turns_is_listed():
    posted = program((0, 0, 90), [feed(1, 0, 90), feed(2, 0, 90)], tool_number=7)
    axes = np.array([ALONG_X, ALONG_X]), np.array([ALONG_X, (0.0, 0.0, 1.0)])
    block = BRepPrimAPI_MakeBox(9.0, 9.0, 9.0).Solid()
    found = certify(replace(posted, start_axis=axes[0], end_axis=axes[1]), {7: TOOL}, ExactPart.of_solid(block), solid=block,
                    tolerance_mm=TOLERANCE_MM)
    assert found.row.tolist() == [0] and "turns" in found.uncovered[0][1]


def balls_about_an_edge(angle_deg, at_deg, far_mm, radius_mm, way_mm=(0.0, 0.03, 0.0)):
    """Bounds of balls whose centres start so far from the edge of a wedge, at angles as its own, and run along it."""
    views = SideViews(solid=brep.the_solid(wedge(angle_deg)), axis=(0.0, 0.0, 1.0), thickness_mm=TOLERANCE_MM)
    at = np.radians(np.atleast_1d(at_deg))
    start = far_mm * np.column_stack([np.cos(at), 0 * at, np.sin(at)])
    return views.of_ball(start, start + way_mm, radius_mm, TOLERANCE_MM, move_depths)[0]


@pytest.mark.parametrize("angle_deg", [20, 60, 85])
def test_a_ball_on_an_edge_sharper_than_square_cuts_as_deep_as_the_edge_is_in_it(angle_deg):
    """Its centre stands over the edge, behind the plane of one face or the other."""
    at = np.linspace(angle_deg + 92, 268, 9)
    for into in (0.0, 0.05):
        bound = balls_about_an_edge(angle_deg, at, 4.0 - into, 4.0)
        assert is_close(bound, np.full(9, into))


@pytest.mark.parametrize("angle_deg", [275, 300, 340])
def test_a_ball_all_inside_beside_a_notch_counts_as_deep_as_it_is(angle_deg):
    """Nearest to the notch's edge, in front of the plane of one of its faces."""
    at = np.linspace(92, angle_deg - 92, 9)
    assert balls_about_an_edge(angle_deg, at, 4.0, 2.0) == pytest.approx(np.full(9, 2.0), abs=1e-9)
