"""Clearance of whole tools to triangles: closed forms, brute force, and moves whose ends tell nothing."""

import numpy as np
import pytest
from known_programs import box, tool

from cuspline.replay.clearance import ClearanceTree, ToolMoves, flute_segments, lever_mm, tool_segments
from cuspline.values.errors import SimulationError

UP = np.array([0.0, 0.0, 1.0])
BAR = np.array([[12.0, 5.0, 45.0, 5.0, 0.0], [45.0, 20.0, 100.0, 20.0, 0.0]])
SHAPES = np.array([[0.0, 2.0, 6.0, 4.0, 0.0], [6.0, 4.0, 20.0, 1.0, 0.0], [3.0, 1.0, 3.0, 1.0, 2.0]])


def moves(start_tips, end_tips, start_axes, end_axes):
    return ToolMoves(start_tips_mm=start_tips, end_tips_mm=end_tips, start_axes=start_axes, end_axes=end_axes)


def sheet(seed, count=14, size=30.0):
    """A rough height field of triangles."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-size, size, count), np.linspace(-size, size, count), indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), rng.uniform(-3, 3, count * count)])
    k = np.arange(count * count).reshape(count, count)
    a, b, c, d = (q.ravel() for q in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def random_poses(seed, count, height=(-18.0, 4.0)):
    rng = np.random.default_rng(seed)
    tips = np.column_stack([rng.uniform(-15, 15, (count, 2)), rng.uniform(*height, count)])
    axes = np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)), np.ones(count)])
    return tips, axes / np.linalg.norm(axes, axis=1, keepdims=True)


def points_on(vertices, triangles, steps=40):
    """Points all over each triangle, at most 1/steps of its sides apart."""
    i, j = np.meshgrid(np.arange(steps + 1), np.arange(steps + 1), indexing="ij")
    keep = i + j <= steps
    share = np.column_stack([i[keep], j[keep], steps - i[keep] - j[keep]]) / steps
    return np.einsum("kc,tcd->tkd", share, vertices[triangles]).reshape(-1, 3)


def outline_distance(rho, z, row):
    """Signed distance to a grown frustum from its definition: four sides and the inside."""
    z0, r0, z1, r1, grow = row
    corners = np.array([(0.0, z0), (r0, z0), (r1, z1), (0.0, z1)])
    p, best = np.column_stack([rho, z]), np.full(len(rho), np.inf)
    for a, b in zip(corners[:-1], corners[1:]):
        t = np.clip((p - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
        best = np.minimum(best, np.linalg.norm(p - a - t[:, None] * (b - a), axis=1))
    inside = (z > z0) & (z < z1)
    inside[inside] &= rho[inside] < r0 + (r1 - r0) * (z[inside] - z0) / (z1 - z0)
    return np.where(inside, -best, best) - grow


def sampled_distance(points, tip, axis, segments):
    away = points - tip
    z = away @ axis
    rho = np.linalg.norm(away - z[:, None] * axis, axis=1)
    return min(outline_distance(rho, z, row).min() for row in segments)


def turned(start, end, share):
    """Unit vectors evenly along the great circle."""
    angle = np.arccos(np.clip(start @ end, -1, 1))
    if angle < 1e-12:
        return np.repeat(start[None], len(share), axis=0)
    return (np.sin((1 - share) * angle)[:, None] * start + np.sin(share * angle)[:, None] * end) / np.sin(angle)


@pytest.mark.parametrize("tip,axis,distance", [
    ((0, 0, 10), (0, 0, 1), 22.0),                      # the shank's end above the plate: 12 higher than the tip
    ((0, 0, -15), (0, 0, 1), -3.0),
    ((0, 0, 30), (-1, 0, 0), 10.0),                      # lying: the holder's radius 20
    ((30, 0, -60), (0, 0, 1), 0.0)])
def test_distances_to_a_plate_have_closed_forms(tip, axis, distance):
    tree = ClearanceTree.of_triangles(*box((-50, -50, -10), (10, 50, 0)))
    found = tree.distances_mm(BAR, [tip], [axis], 1e-6)[0]
    assert distance - 1.1e-6 <= found <= distance + 1e-12


@pytest.mark.parametrize("segments", [BAR, SHAPES], ids=["bar", "cones and a torus"])
def test_distances_agree_with_dense_points_and_never_lie_above(segments):
    """40 points a side on triangles of 4.6 mm: no point of them is farther than 0.08 mm from one."""
    mesh = sheet(1)
    tips, axes = random_poses(2, 12)
    found = ClearanceTree.of_triangles(*mesh).distances_mm(segments, tips, axes, 1e-3)
    dense = np.array([sampled_distance(points_on(*mesh), t, a, segments) for t, a in zip(tips, axes)])
    assert (found <= dense + 1e-9).all() and (found >= dense - 0.08).all()
    assert (np.sign(found) < 0).any() and (np.sign(found) > 0).any()


def test_tolerance_bounds_what_a_distance_lies_too_low():
    mesh = sheet(3)
    tips, axes = random_poses(4, 60)
    tree = ClearanceTree.of_triangles(*mesh)
    fine = tree.distances_mm(BAR, tips, axes, 1e-7)
    for tolerance in (1e-1, 1e-2, 1e-4):
        coarse = tree.distances_mm(BAR, tips, axes, tolerance)
        assert (coarse <= fine + 2e-7).all() and (coarse >= fine - tolerance - 2e-7).all()


def test_turning_tool_and_part_together_changes_nothing():
    vertices, triangles = sheet(5)
    tips, axes = random_poses(6, 30)
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    shift = np.array([5.0, -7.0, 11.0])
    here = ClearanceTree.of_triangles(vertices, triangles).distances_mm(BAR, tips, axes, 1e-5)
    there = ClearanceTree.of_triangles(vertices @ turn.T + shift, triangles)
    assert np.abs(there.distances_mm(BAR, tips @ turn.T + shift, axes @ turn.T, 1e-5) - here).max() < 2.1e-5


@pytest.mark.parametrize("turning", [False, True], ids=["straight", "turning"])
def test_proven_clearance_of_moves_is_never_above_any_pose_on_the_way(turning):
    mesh = sheet(8)
    tree = ClearanceTree.of_triangles(*mesh)
    tips, axes = random_poses(9, 31, (-12.0, 8.0))
    axes = axes if turning else np.repeat(axes[:1], 31, axis=0)
    found = tree.certified_clearance(BAR, moves(tips[:-1], tips[1:], axes[:-1], axes[1:]), 1.0, 6.0)
    share = np.linspace(0, 1, 401)
    for k in range(30):
        way = tips[k] + share[:, None] * (tips[k + 1] - tips[k])
        least = tree.distances_mm(BAR, way, turned(axes[k], axes[k + 1], share), 1e-5).min()
        if found.is_clear[k]:
            assert 1.0 <= found.clearance_mm[k] <= least + 2e-5
        else:
            assert least < 1.0 + 0.05           # 400 steps of at most 0.2 mm pass by the nearest place
    assert found.is_clear.any() and not found.is_clear.all()


def test_a_turning_move_with_clear_ends_hits_in_its_middle():
    """A post of 0.4 mm at x = 0: the tool leans to one side of it, then to the other, its tip standing still."""
    post = ClearanceTree.of_triangles(*box((-0.2, -0.2, 60), (0.2, 0.2, 90)))
    lean = np.array([[np.sin(a), 0.0, np.cos(a)] for a in (-0.6, 0.6)])
    tip = np.zeros((1, 3))
    assert (post.distances_mm(BAR, np.zeros((2, 3)), lean, 1e-4) > 1.0).all()
    found = post.certified_clearance(BAR, moves(tip, tip, lean[:1], lean[1:]), 1.0)
    assert not found.is_clear[0] and found.clearance_mm[0] < 1.0 and abs(found.place_mm[0, 0]) <= 0.2 + 1e-9
    high = post.certified_clearance(BAR, moves(tip - [0, 0, 50], tip - [0, 0, 50], lean[:1], lean[1:]), 1.0)
    assert high.is_clear[0]


def test_a_tilted_straight_move_over_a_fin_is_found_between_its_ends():
    fin = ClearanceTree.of_triangles(*box((-0.01, -20, 0), (0.01, 20, 16)))
    axis = np.array([[0.0, 0.6, 0.8]])
    start, end = np.array([[-40.0, 0, 2]]), np.array([[40.0, 0, 2]])
    assert not fin.certified_clearance(BAR, moves(start, end, axis, axis), 0.5).is_clear[0]
    assert fin.certified_clearance(BAR, moves(start + [0, 0, 30], end + [0, 0, 30], axis, axis), 0.5).is_clear[0]


def test_margin_decides_to_the_tolerance():
    """A holder 2 mm above a plate, all along."""
    plate = ClearanceTree.of_triangles(*box((-90, -90, -5), (90, 90, 0)))
    move = moves(np.array([[-30.0, 0, -43]]), np.array([[30.0, 0, -43]]), UP[None], UP[None])
    holder = BAR[1:]
    assert plate.certified_clearance(holder, move, 1.998).is_clear[0]
    assert not plate.certified_clearance(holder, move, 2.002).is_clear[0]


def test_segments_of_a_cutter_enclose_its_outline_and_no_more():
    for kind, corner in (("ball", None), ("flat", None), ("bull_nose", 1.5)):
        cutter = tool(kind, 10, corner).cutter
        outline, segments = cutter.profile.points(1e-4), flute_segments(cutter)
        d = np.array([outline_distance(outline[:, 0], outline[:, 1], s) for s in segments]).min(axis=0)
        assert d.max() < 1e-9 and d.min() > -2e-4


def test_spindle_head_stands_on_the_holder():
    t = tool("ball", 6)
    rows = tool_segments(t, spindle_head=((100.0, 120.0), (50.0, 200.0)))
    assert rows[-2:, :4].tolist() == [[95.0, 60.0, 195.0, 60.0], [195.0, 100.0, 245.0, 100.0]]
    assert abs(lever_mm(rows) - np.hypot(245.0, 100.0)) < 1e-9
    assert (tool_segments(t, with_flutes=False)[:, 0] >= 20.0).all()


@pytest.mark.parametrize("change", [
    {"segments": np.array([[5.0, 1.0, 4.0, 1.0, 0.0]])}, {"axes": [(0, 0, 2.0)]}, {"tolerance_mm": 0.0}])
def test_wrong_input_is_refused(change):
    tree = ClearanceTree.of_triangles(*box((0, 0, 0), (1, 1, 1)))
    given = {"segments": BAR, "tips_mm": [(0, 0, 5.0)], "axes": [(0, 0, 1.0)], "tolerance_mm": 1e-3, **change}
    with pytest.raises(SimulationError):
        tree.distances_mm(**given)


def test_half_a_turn_has_no_way_and_is_refused():
    tree = ClearanceTree.of_triangles(*box((0, 0, 0), (1, 1, 1)))
    with pytest.raises(SimulationError):
        tree.certified_clearance(BAR, moves([(0, 0, 5.0)], [(0, 0, 5.0)], [(0, 0, 1.0)], [(0, 0, -1.0)]), 1.0)


def test_no_triangles_are_refused():
    with pytest.raises(SimulationError):
        ClearanceTree.of_triangles(np.zeros((0, 3)), np.zeros((0, 3), int))
