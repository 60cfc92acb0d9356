"""The ball's centre over swept profiles against closed forms, before rounding and before arc fitting.

Exact means 1e-6 mm: a thousandth of the profile tolerance, and what issue 2 asks to be shown.
"""

import numpy as np
import pytest
from known_parts import JOIN_MM, Drawing, chain_of, largest_gap_mm, swept, up_of

from cuspline.toolpaths.sections.section_pieces import ArcPiece, LinePiece

EXACT_MM = 1e-6
PLANES = pytest.mark.parametrize("plane", ["ZX", "YZ"])
RISES = pytest.mark.parametrize("rise_deg", [0.0, 12.0, -25.0])


def check_against(chain, centers):
    """The chain passes through the centres, (n, 2) along and up."""
    np.testing.assert_allclose(up_of(chain, centers[:, 0]), centers[:, 1], rtol=0, atol=EXACT_MM)


def offset(points, directions, radius, rise_deg, across):
    """Centres in the plane across = c over a profile swept along (across, up) = (cos b, sin b).

    Args:
        points, directions: (n, 2) profile and its direction of rising along.
    Returns:
        (n, 2): S + r n with the sweep length s from  s cos b + r n_across = c.
    """
    b = np.radians(rise_deg)
    x, z = directions.T
    normal = np.column_stack([-z * np.cos(b), -x * np.sin(b), x * np.cos(b)])       # along, across, up
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    rise = (across - radius * normal[:, 1]) * np.tan(b)
    return np.column_stack([points[:, 0] + radius * normal[:, 0], points[:, 1] + rise + radius * normal[:, 2]])


# one element ------------------------------------------------------------------------------------------


@PLANES
@RISES
@pytest.mark.parametrize("slope_deg", [0.0, 30.0, -75.0])
def test_a_line_offsets_to_a_line(plane, rise_deg, slope_deg):
    d, slope = Drawing(plane), np.tan(np.radians(slope_deg))
    first, last = (0.0, 60.0), (12.0, 60.0 + 12.0 * slope)
    chain = chain_of(swept(d, d.closed([d.line(first, last)], first, last, base=-30.0), rise_deg=rise_deg), plane, 2.5)
    along = np.linspace(0.0, 12.0, 33)
    centers = offset(np.column_stack([along, 60.0 + slope * along]), np.tile((1.0, slope), (33, 1)), 2.5, rise_deg, 7.3)
    check_against(chain, centers)


@PLANES
@RISES
def test_a_convex_arc_offsets_to_the_sum_of_radii(plane, rise_deg):
    d, R, r = Drawing(plane), 9.0, 4.0
    points = [(20 + R * np.cos(np.radians(a)), 30 + R * np.sin(np.radians(a))) for a in (140, 30)]
    solid = swept(d, d.closed([d.arc((20, 30), R, 30, 140)], *points), rise_deg=rise_deg)
    angle = np.radians(np.linspace(140, 30, 101))
    profile = np.column_stack([20 + R * np.cos(angle), 30 + R * np.sin(angle)])
    centers = offset(profile, np.column_stack([np.sin(angle), -np.cos(angle)]), r, rise_deg, 7.3)
    chain = chain_of(solid, plane, r)
    check_against(chain, centers)
    if rise_deg == 0:
        np.testing.assert_allclose(np.hypot(*(centers - (20, 30)).T), R + r)
        arc = next(p for p in chain if isinstance(p, ArcPiece) and p.radius == pytest.approx(R + r, abs=EXACT_MM))
        np.testing.assert_allclose(arc.center, (20, 30), atol=EXACT_MM)


def gutter(d, R, half_deg, rise_deg=0.0):
    """A block with a gutter of radius R, opening half_deg to each side of straight down."""
    a = np.radians(half_deg)
    left, right = (20 - R * np.sin(a), 40 - R * np.cos(a)), (20 + R * np.sin(a), 40 - R * np.cos(a))
    edges = [d.line((0, left[1]), left), d.arc((20, 40), R, 270 - half_deg, 270 + half_deg),
             d.line(right, (40, right[1]))]
    return swept(d, d.closed(edges, (0, left[1]), (40, right[1])), rise_deg=rise_deg)


@PLANES
@RISES
def test_a_concave_arc_offsets_to_the_difference_of_radii(plane, rise_deg):
    d, R, r = Drawing(plane), 9.0, 4.0
    chain = chain_of(gutter(d, R, 60, rise_deg), plane, r)
    angle = np.radians(np.linspace(215, 325, 101))        # inside its ends, where corners hold the ball
    profile = np.column_stack([20 + R * np.cos(angle), 40 + R * np.sin(angle)])
    centers = offset(profile, np.column_stack([-np.sin(angle), np.cos(angle)]), r, rise_deg, 7.3)
    check_against(chain, centers)


@PLANES
def test_a_ball_larger_than_the_gutter_rests_on_its_corners(plane):
    d, R, r = Drawing(plane), 5.0, 6.0
    chain = chain_of(gutter(d, R, 90), plane, r)
    assert not any(isinstance(p, ArcPiece) and p.radius < R for p in chain), "the concave arc must vanish"
    assert up_of(chain, 20.0)[0] == pytest.approx(40 + np.sqrt(r * r - R * R), abs=EXACT_MM)


@PLANES
@RISES
def test_a_convex_ellipse_offsets_to_its_parallel_curve(plane, rise_deg):
    d, a, b, r = Drawing(plane), 14.0, 6.0, 3.0
    t = np.radians(np.linspace(165, 20, 201))
    profile = np.column_stack([20 + a * np.cos(t), 30 + b * np.sin(t)])
    edge = d.ellipse((20, 30), a, b, 20, 165)
    solid = swept(d, d.closed([edge], tuple(profile[0]), tuple(profile[-1])), rise_deg=rise_deg)
    centers = offset(profile, np.column_stack([a * np.sin(t), -b * np.cos(t)]), r, rise_deg, 7.3)
    check_against(chain_of(solid, plane, r), centers)


def trough(d, a, b, rise_deg=0.0):
    """A block with a trough of half an ellipse, axes a along and b down."""
    edges = [d.line((0, 40), (20 - a, 40)), d.ellipse((20, 40), a, b, 180, 360), d.line((20 + a, 40), (40, 40))]
    return swept(d, d.closed(edges, (0, 40), (40, 40)), rise_deg=rise_deg)


def in_trough(a, b, r, t):
    """Centres of a ball in the trough; t from straight down, rising along."""
    q = np.sqrt((np.sin(t) / a) ** 2 + (np.cos(t) / b) ** 2)
    return np.column_stack([20 + np.sin(t) * (a - r / (a * q)), 40 - np.cos(t) * (b - r / (b * q))])


@PLANES
def test_a_concave_ellipse_offsets_to_its_parallel_curve(plane):
    d, a, b, r = Drawing(plane), 10.0, 9.0, 4.0          # tightest: b²/a = 8.1 at the ends
    check_against(chain_of(trough(d, a, b), plane, r), in_trough(a, b, r, np.radians(np.linspace(-80, 80, 161))))


@PLANES
@pytest.mark.parametrize("rise_deg", [0.0, 12.0])
def test_the_swallow_tail_of_a_narrow_ellipse_vanishes(plane, rise_deg):
    # tightest radius a²/b = 3.6 < r: the offset crosses itself on the axis of symmetry, and beyond
    # the crossing it runs over the evolute's cusps; the crossing has a closed form
    d, a, b, r = Drawing(plane), 6.0, 10.0, 4.5
    chain = chain_of(trough(d, a, b, rise_deg), plane, r)
    if rise_deg == 0:
        crossing = np.arcsin(np.sqrt((r * r / a ** 4 - 1 / b ** 2) / (1 / a ** 2 - 1 / b ** 2)))
        lowest = 40 - np.cos(crossing) * (b - a * a / b)
        t = np.linspace(crossing, np.radians(85), 101)
        check_against(chain, in_trough(a, b, r, t))
        check_against(chain, in_trough(a, b, r, -t))
        assert up_of(chain, 20.0)[0] == pytest.approx(lowest, abs=EXACT_MM)
        assert up_of(chain, np.linspace(0, 40, 4001)).min() == pytest.approx(lowest, abs=EXACT_MM)
    joints = [p.end for p in chain[:-1] if abs(p.end[0] - 20) < 1]
    assert len(joints) == 1, "one kink and nothing of the tail"
    assert joints[0][0] == pytest.approx(20.0, abs=EXACT_MM)
    assert largest_gap_mm(chain) < JOIN_MM


@PLANES
@RISES
def test_a_parabola_offsets_to_its_parallel_curve(plane, rise_deg):
    # z = 20 + (x - 20)²/20 as a Bézier curve: exact; tightest radius 10 at its vertex
    d, r = Drawing(plane), 6.0
    first, last = (5.0, 20 + 225 / 20), (35.0, 20 + 225 / 20)
    solid = swept(d, d.closed([d.bezier(first, (20.0, 20 - 225 / 20), last)], first, last), rise_deg=rise_deg)
    x = np.linspace(8, 32, 201)
    centers = offset(np.column_stack([x, 20 + (x - 20) ** 2 / 20]), np.column_stack([np.ones(201), (x - 20) / 10]),
                     r, rise_deg, 7.3)
    check_against(chain_of(solid, plane, r), centers)


# steps and corners -----------------------------------------------------------------------------------


def step(d, height):
    """Floor at 10, a wall at along = 15, the top above it."""
    edges = [d.line((0, 10), (15, 10)), d.line((15, 10), (15, 10 + height)), d.line((15, 10 + height), (30, 10 + height))]
    return swept(d, d.closed(edges, (0, 10), (30, 10 + height)))


@PLANES
def test_a_step_gives_floor_wall_corner_arc_and_top(plane):
    r, height = 3.0, 8.0
    chain = chain_of(step(Drawing(plane), height), plane, r)
    wall = next(k for k, p in enumerate(chain) if p.span[1] - p.span[0] < 1e-9)
    floor, line, corner, top = chain[wall - 1:wall + 3]
    np.testing.assert_allclose(floor.end, (15 - r, 10 + r), atol=EXACT_MM)       # the kink at the foot
    np.testing.assert_allclose((line.start, line.end), ((15 - r, 10 + r), (15 - r, 10 + height)), atol=EXACT_MM)
    assert isinstance(corner, ArcPiece) and corner.radius == pytest.approx(r, abs=EXACT_MM)
    np.testing.assert_allclose(corner.center, (15, 10 + height), atol=EXACT_MM)
    np.testing.assert_allclose((corner.start, corner.end), ((15 - r, 10 + height), (15, 10 + height + r)), atol=EXACT_MM)
    assert isinstance(top, LinePiece)
    assert largest_gap_mm(chain) < JOIN_MM


@PLANES
def test_a_wall_lower_than_the_ball_is_rolled_over_without_a_vertical_line(plane):
    r, height = 5.0, 2.0
    chain = chain_of(step(Drawing(plane), height), plane, r)
    assert all(p.span[1] - p.span[0] > 1e-9 for p in chain)
    foot = 15 - np.sqrt(r * r - (r - height) ** 2)
    kink = next(p for p in chain if isinstance(p, ArcPiece) and abs(p.center[0] - 15) < 1e-9)
    np.testing.assert_allclose(kink.start, (foot, 10 + r), atol=EXACT_MM)


@PLANES
def test_a_wall_that_leans_back_holds_the_ball_by_its_top_corner(plane):
    d, r = Drawing(plane), 3.0       # undercut: the wall's foot lies behind its top
    edges = [d.line((0, 10), (17, 10)), d.line((17, 10), (15, 18)), d.line((15, 18), (30, 18))]
    chain = chain_of(swept(d, d.closed(edges, (0, 10), (30, 18))), plane, r)
    assert up_of(chain, 15 - r - 1e-3)[0] == pytest.approx(10 + r, abs=EXACT_MM)
    along = np.linspace(15 - r + 1e-3, 15, 50)
    np.testing.assert_allclose(up_of(chain, along), 18 + np.sqrt(r * r - (along - 15) ** 2), atol=EXACT_MM)


@PLANES
def test_a_vee_holds_the_ball_between_its_flanks(plane):
    d, r = Drawing(plane), 3.0
    edges = [d.line((0, 30), (20, 10)), d.line((20, 10), (40, 30))]
    chain = chain_of(swept(d, d.closed(edges, (0, 30), (40, 30))), plane, r)
    assert up_of(chain, 20.0)[0] == pytest.approx(10 + r * np.sqrt(2), abs=EXACT_MM)


# round bars: arcs of more than half a turn ------------------------------------------------------------


@PLANES
def test_a_round_bar_lying_across_is_rolled_over(plane):
    d, R, r = Drawing(plane), 8.0, 3.0
    import cadquery as cq
    solid = swept(d, cq.Wire.assembleEdges([d.arc((20, 30), R, 0, 180), d.arc((20, 30), R, 180, 360)]))
    full = swept(d, cq.Wire.assembleEdges([cq.Edge.makeCircle(R, d.at(20, 30), d.direction(1, 0).cross(d.direction(0, 1)))]))
    along = np.linspace(20 - R - r + 0.01, 20 + R + r - 0.01, 101)
    exact = 30 + np.sqrt((R + r) ** 2 - (along - 20) ** 2)
    for part in (solid, full):
        np.testing.assert_allclose(up_of(chain_of(part, plane, r), along), exact, atol=EXACT_MM)


@PLANES
def test_a_bar_on_a_keel_is_rolled_over(plane):
    # the arc runs over more than half a turn: both its ends lie below the equator
    import cadquery as cq
    d, R, r = Drawing(plane), 8.0, 3.0
    c = np.cos(np.radians(50)), -np.sin(np.radians(50))
    ends = (20 + R * c[0], 30 + R * c[1]), (20 - R * c[0], 30 + R * c[1])
    edges = [d.arc((20, 30), R, -50, 230), d.line(ends[1], (ends[1][0], 10)),
             d.line((ends[1][0], 10), (ends[0][0], 10)), d.line((ends[0][0], 10), ends[0])]
    chain = chain_of(swept(d, cq.Wire.assembleEdges(edges)), plane, r)
    along = np.linspace(20 - R - r + 0.01, 20 + R + r - 0.01, 101)
    np.testing.assert_allclose(up_of(chain, along), 30 + np.sqrt((R + r) ** 2 - (along - 20) ** 2), atol=EXACT_MM)


@PLANES
def test_a_flat_on_a_bar_lets_the_ball_down(plane):
    # the arc runs round below: both its ends lie above the equator, its middle does not
    import cadquery as cq
    d, R, r = Drawing(plane), 8.0, 3.0
    half, up = R * np.cos(np.radians(30)), 30 + R * np.sin(np.radians(30))
    edges = [d.arc((20, 30), R, 150, 390), d.line((20 + half, up), (20 - half, up))]
    chain = chain_of(swept(d, cq.Wire.assembleEdges(edges)), plane, r)
    along = np.linspace(20 - half, 20 + half, 51)
    np.testing.assert_allclose(up_of(chain, along), up + r, atol=EXACT_MM)
    along = np.linspace(20 + (R + r) * np.cos(np.radians(29)), 20 + R + r - 0.01, 51)
    np.testing.assert_allclose(up_of(chain, along), 30 + np.sqrt((R + r) ** 2 - (along - 20) ** 2), atol=EXACT_MM)


@PLANES
def test_a_keyhole_lets_a_small_ball_down_to_its_bottom(plane):
    # a hollow arc of more than half a turn, open at the top
    d, R, r = Drawing(plane), 8.0, 2.0
    c, s = np.cos(np.radians(50)), np.sin(np.radians(50))
    left, right = (20 - R * c, 30 + R * s), (20 + R * c, 30 + R * s)
    edges = [d.line((0, left[1]), left), d.arc((20, 30), R, 130, 410), d.line(right, (40, right[1]))]
    chain = chain_of(swept(d, d.closed(edges, (0, left[1]), (40, right[1]))), plane, r)
    along = np.linspace(20 - (R * c - r) + 0.01, 20 + R * c - r - 0.01, 51)
    np.testing.assert_allclose(up_of(chain, along), 30 - np.sqrt((R - r) ** 2 - (along - 20) ** 2), atol=EXACT_MM)
