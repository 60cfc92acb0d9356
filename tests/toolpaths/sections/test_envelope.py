"""The ball's centre over random profiles against brute force, and its sameness under rigid motions."""

import cadquery as cq
import numpy as np
import pytest
from known_parts import JOIN_MM, TOLERANCE_MM, Drawing, chain_of, largest_gap_mm, planner, swept, up_of

from cuspline.kernel.brep import bounding_box_mm, the_solid
from cuspline.toolpaths.sections.envelope import upper_envelope
from cuspline.toolpaths.sections.section_pieces import ArcPiece, LinePiece, half_circle

SEEDS = pytest.mark.parametrize("seed", range(6))
SPACING_MM = 2e-3       # of the brute force's contact points


def random_profile(drawing, seed):
    """Lines, arcs, Bézier curves and vertical steps in random order; edges from left to right."""
    rng = np.random.default_rng(seed)
    here, edges = (0.0, rng.uniform(15, 25)), []
    inner = rng.permutation(["line", "arc", "bezier", "step", "line", "arc", "bezier", "step"])
    for kind in ["line", *inner, "line"]:       # a step at either end would double back on the block's side
        run, up = rng.uniform(3, 9), rng.uniform(6, 34)
        if kind == "step":
            there = (here[0], up)
            edges.append(drawing.line(here, there))
        elif kind == "line":
            there = (here[0] + run, up)
            edges.append(drawing.line(here, there))
        elif kind == "arc":
            there = (here[0] + run, here[1])
            bow = rng.uniform(-0.4, 0.4) * run
            edges.append(cq.Edge.makeThreePointArc(drawing.at(*here), drawing.at(here[0] + run / 2, here[1] + bow),
                                                   drawing.at(*there)))
        else:
            there = (here[0] + run, up)
            inner = [(here[0] + share * run, rng.uniform(5, 35)) for share in (0.3, 0.7)]
            edges.append(drawing.bezier(here, *inner, there))
        here = there
    return edges, here


def random_solid(seed, plane="ZX", width=5.0):
    d = Drawing(plane)
    edges, last = random_profile(d, seed)
    first = edges[0].startPoint()
    return swept(d, d.closed(edges, (0.0, first.z), last), width), edges


def brute_force(edges, radius, along):
    """(n,) largest height at which the ball touches one of densely sampled points of the edges."""
    points = np.vstack([np.array([(p.x, p.z) for p in e.positions(np.linspace(0, 1, int(e.Length() / SPACING_MM) + 2))])
                        for e in edges])
    points = points[np.argsort(points[:, 0], kind="stable")]
    first, last = np.searchsorted(points[:, 0], along - radius), np.searchsorted(points[:, 0], along + radius)
    return np.array([(points[a:b, 1] + np.sqrt(radius ** 2 - (points[a:b, 0] - x) ** 2)).max()
                     for x, a, b in zip(along, first, last)])


@SEEDS
def test_the_envelope_is_the_highest_contact(seed):
    radius = (1.2, 3.0, 7.0)[seed % 3]
    solid, edges = random_solid(seed)
    chain = chain_of(solid, "ZX", radius, 2.5)
    assert largest_gap_mm(chain) < JOIN_MM
    low, high = chain[0].start[0] + radius, chain[-1].end[0] - radius
    along = np.linspace(low, high, 300)
    ours, brute = up_of(chain, along), brute_force(edges, radius, along)
    assert (ours > brute - 1e-9).all(), "the ball would cut in"
    slope = np.abs(np.gradient(ours, along))
    gentle = np.convolve(slope, np.ones(3), "same") < 2
    # a contact that lies half a spacing beside the samples is missed by (spacing/2)² (1/r + curvature) / 2
    np.testing.assert_allclose(ours[gentle], brute[gentle], rtol=0, atol=4e-6)


@SEEDS
def test_a_fitted_pass_stays_within_the_tolerance_of_the_envelope(seed):
    radius = (1.2, 3.0, 7.0)[seed % 3]
    solid, _ = random_solid(seed)
    p = planner(solid, "ZX", radius)
    chain, owners, _ = p.chain(2.5, *p.extent(*bounding_box_mm(solid)))
    fitted = p.fitted_pass(2.5, chain, owners)
    points = np.vstack([_points_on(e) for e in fitted.elements]) + (0.0, radius)
    curve = np.vstack([_chain_points(q) for q in chain])
    distance = np.array([np.abs(curve - q).min() for q in points])      # a first guess only picks the neighbourhood
    assert distance.max() < 0.05
    exact = np.array([_distance(q, curve) for q in points])
    assert exact.max() < TOLERANCE_MM
    for a, b in zip(fitted.elements, fitted.elements[1:]):
        assert a.end == b.start
    assert len(fitted.owners) == len(fitted.elements)


def _points_on(e, count=9):
    share = np.linspace(0, 1, count)[:, None]
    s, t = np.array(e.start), np.array(e.end)
    if e.center is None:
        return s + share * (t - s)
    c = np.array(e.center)
    a0, a1 = (np.arctan2(*(p - c)[::-1]) for p in (s, t))
    turn = (a1 - a0) % (2 * np.pi) if e.is_left else -((a0 - a1) % (2 * np.pi))
    return c + e.radius * np.column_stack([np.cos(a0 + share[:, 0] * turn), np.sin(a0 + share[:, 0] * turn)])


def _chain_points(piece, spacing=2e-3):
    if piece.span[1] - piece.span[0] < 1e-9:
        n = max(2, int(abs(piece.end[1] - piece.start[1]) / spacing))
        return np.column_stack([np.full(n, piece.start[0]), np.linspace(piece.start[1], piece.end[1], n)])
    along = np.linspace(*piece.span, max(2, int((piece.span[1] - piece.span[0]) / spacing)))
    return np.column_stack([along, piece.up_at(along)])


def _distance(point, curve):
    """Distance of a point from a polyline."""
    a, b = curve[:-1], curve[1:]
    near = np.flatnonzero(np.abs(a - point).max(axis=1) < 1.0)
    a, d = a[near], (b - a)[near]
    share = np.clip(((point - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-30), 0, 1)
    return np.linalg.norm(a + share[:, None] * d - point, axis=1).min()


# rigid motions ----------------------------------------------------------------------------------------


def turned(solid, drop=(0, 0, 0)):
    """Turned by 90 degrees about z: x becomes y, y becomes -x."""
    return the_solid(cq.Solid(solid).rotate((0, 0, 0), (0, 0, 1), 90).translate(drop))


@SEEDS
def test_turning_part_and_plane_together_gives_the_same_chain(seed):
    solid, _ = random_solid(seed)
    p = chain_of(solid, "ZX", 3.0, 2.5)
    q = chain_of(turned(solid), "YZ", 3.0, -2.5)
    assert [type(a) for a in p] == [type(b) for b in q]
    for a, b in zip(p, q):
        np.testing.assert_allclose(np.r_[a.start, a.end], np.r_[b.start, b.end], atol=1e-7)


@SEEDS
def test_shifting_the_part_shifts_the_chain(seed):
    solid, _ = random_solid(seed)
    shift = np.array([13.7, -4.1, 8.3])
    p = chain_of(solid, "ZX", 3.0, 2.5)
    q = chain_of(the_solid(cq.Solid(solid).translate(tuple(shift))), "ZX", 3.0, 2.5 + shift[1])
    assert [type(a) for a in p] == [type(b) for b in q]
    for a, b in zip(p, q):
        np.testing.assert_allclose(np.r_[a.start, a.end] + np.tile(shift[[0, 2]], 2), np.r_[b.start, b.end], atol=1e-6)


@SEEDS
def test_mirroring_the_part_mirrors_the_heights(seed):
    solid, _ = random_solid(seed)
    p = chain_of(solid, "ZX", 3.0, 2.5)
    q = chain_of(the_solid(cq.Solid(solid).mirror("YZ")), "ZX", 3.0, 2.5)
    along = np.linspace(p[0].start[0] + 0.1, p[-1].end[0] - 0.1, 500)
    walls = np.array([a.start[0] for a in p if a.span[1] - a.span[0] < 1e-9])
    along = along[np.abs(along[:, None] - walls).min(axis=1) > 1e-3] if len(walls) else along
    np.testing.assert_allclose(up_of(q, -along), up_of(p, along), atol=1e-5)     # steep: 1e-7 along is more up


def test_planning_twice_gives_identical_passes():
    solid, _ = random_solid(3)
    first, second = (planner(solid, "ZX", 3.0) for _ in range(2))
    box = bounding_box_mm(solid)
    faces = set(range(len(first.centers.faces)))
    a, b = (p.section_passes(2.5, *p.extent(*box), faces)[0] for p in (first, second))
    assert a.elements == b.elements and a.owners == b.owners


# the envelope alone -----------------------------------------------------------------------------------


def test_two_half_circles_cross_where_they_are_equally_high():
    chain = upper_envelope([half_circle((0, 0), 5.0, -1), half_circle((6, 0), 5.0, -1)], -4, 10)
    assert len(chain) == 2
    np.testing.assert_allclose(chain[0].end, (3, 4), atol=1e-9)
    np.testing.assert_allclose(chain[1].start, (3, 4), atol=1e-9)


def test_of_coinciding_pieces_the_line_is_kept():
    line = LinePiece(start=np.array([0.0, 5.0]), end=np.array([4.0, 5.0]), owner=7)
    flat = ArcPiece(center=np.array([2.0, -1e7]), radius=1e7 + 5, start=np.array([0.0, 5.0]), end=np.array([4.0, 5.0]),
                    is_over=True, owner=8)
    (kept,) = upper_envelope([flat, line], 0, 4)
    assert kept is not flat and kept.owner == 7


def test_a_corner_that_two_elements_share_gives_one_arc():
    noise = 1e-15
    (kept,) = upper_envelope([half_circle((0, 0), 5.0, -1), half_circle((noise, -noise), 5.0, -1)], -4, 4)
    np.testing.assert_allclose((kept.start, kept.end), ((-4, 3), (4, 3)), atol=1e-9)


def test_nothing_beneath_the_ball_is_an_error_with_its_place():
    from cuspline.values.errors import ToolpathError
    with pytest.raises(ToolpathError, match="nothing to rest on at 5"):
        upper_envelope([half_circle((0, 0), 5.0, -1)], -4, 10)
