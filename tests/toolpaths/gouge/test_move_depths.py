"""Proven depths of moves: closed forms, brute force, and what must stay clean beside walls."""

import cadquery as cq
import numba
import numpy as np
import pytest
from brute_depth import BruteDepth, depth_of
from exact_parts import machined_block, patch_solid, random_poles
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere

from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm
from cuspline.toolpaths.gouge.depth_tree import DepthTree
from cuspline.toolpaths.gouge.move_depths import DEEP_SHARE, move_depths
from cuspline.values.errors import ToolpathError

CUTTERS = pytest.mark.parametrize("R, rc", [(4.0, 4.0), (4.0, 1.0), (3.0, 0.0)], ids=["ball", "bull nose", "flat"])
TOLERANCE_MM = 1e-3


def tree_of(solid, tolerance_mm=TOLERANCE_MM):
    return DepthTree.of_part(ExactPart.of_solid(solid), tolerance_mm)


def is_close(bound, true, tolerance_mm):
    """Not below the truth, and no farther above it than promised."""
    slack = np.where(bound > tolerance_mm, np.maximum(tolerance_mm / 2, DEEP_SHARE * true), tolerance_mm)
    return (bound >= true - 1e-9).all() and (bound <= true + slack + 2e-5).all()


@pytest.fixture(scope="module")
def block():
    return BRepPrimAPI_MakeBox(20.0, 16.0, 5.0).Solid()


def test_a_chord_over_a_sphere_cuts_as_deep_as_its_sag():
    half = np.array([2.0, 1.0, 0.5, 0.05])
    z = np.sqrt(14.0 ** 2 - half ** 2) - 4.0
    start, end = (np.column_stack([s * half, 0 * half, z]) for s in (-1, 1))
    bound, share, place = move_depths(tree_of(BRepPrimAPI_MakeSphere(10.0).Solid()), start, end, 4.0, 4.0, TOLERANCE_MM)
    assert is_close(bound, 14.0 - np.sqrt(14.0 ** 2 - half ** 2), TOLERANCE_MM)
    np.testing.assert_allclose(share[:3], 0.5, atol=0.1)
    np.testing.assert_allclose(place[0], (0, 0, 10), atol=0.3)


@CUTTERS
@pytest.mark.parametrize("into", [0.1, 0.008, 0.0, -1e-6])
def test_beside_an_upright_wall_the_depth_is_measured_sideways(block, R, rc, into):
    a = np.radians(31.0)
    turn = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    turned = cq.Workplane(obj=cq.Shape.cast(block)).rotate((0, 0, 0), (0, 0, 1), 31.0).val().wrapped
    start = np.array([[-R - 1, -R + into, 0.2], [3.0, -R + into, -3.0], [-R + into, 8.0, 9.0]]) @ turn
    end = np.array([[25.0, -R + into, 0.2], [9.0, -R + into, 0.1], [-R + into, 8.0, -1.0]]) @ turn
    bound = move_depths(tree_of(turned), start, end, R, rc, TOLERANCE_MM)[0]
    assert is_close(bound, np.full(3, max(into, 0.0)), TOLERANCE_MM)


@CUTTERS
def test_pressed_into_a_level_face_the_depth_is_measured_down(block, R, rc):
    start, end = [[5.0, 8, 4.97], [10.0, 8, 9.0], [-9.0, -9, 5.0]], [[15.0, 9, 4.97], [10.0, 8, 4.5], [29.0, 25, 5.0]]
    bound, share, place = move_depths(tree_of(block), start, end, R, rc, TOLERANCE_MM)
    assert is_close(bound, np.array([0.03, 0.5, 0.0]), TOLERANCE_MM)
    assert share[1] == 1.0 and place[1, 2] == pytest.approx(5.0)


@CUTTERS
def test_a_post_between_two_clean_points_is_found(R, rc):
    plate = cq.Workplane("XY").box(40, 40, 2, centered=(True, True, False))
    post = plate.faces(">Z").workplane().circle(0.2).extrude(3)
    bound, share, place = move_depths(tree_of(post.val().wrapped), [[-12.0, 0, 2.001]], [[12.0, 0, 2.001]], R, rc, 0.01)
    assert 2.7 < bound[0] < 3.1
    assert np.hypot(*place[0, :2]) < 0.2 + 1e-9 and place[0, 2] == pytest.approx(5.0)
    assert abs(24 * share[0] - 12) < R


@pytest.mark.parametrize("solid, low, high", [(machined_block(), (-32, -27), (32, 27)),
                                              (patch_solid(random_poles(3), -8.0), (-2, -2), (32, 26))],
                         ids=["trimmed block", "free-form patch"])
def test_bounds_are_no_lower_and_hardly_higher_than_brute_force(solid, low, high):
    rng, part = np.random.default_rng(7), ExactPart.of_solid(solid)
    brute = BruteDepth(solid, cells=80, edge_points=1000)
    trees = {t: DepthTree.of_part(part, t) for t in (5e-3, 1e-3)}
    for R, rc in ((4.0, 4.0), (4.0, 1.0), (3.0, 0.0), (1.0, 1.0)):
        xy = rng.uniform(low, high, (6, 2))
        xy = np.stack([xy, xy + rng.normal(0, 1, (6, 2)) * rng.choice([0.1, 0.5, 2, 8], (6, 1))])
        z = np.stack([drop_tips_mm(part, p, R, rc) for p in xy])
        z = np.where(np.isfinite(z), z, -5.0) + rng.choice([0, -0.002, -0.02, 0.01, -0.3], 6)
        start, end = np.concatenate([xy, z[..., None]], axis=-1)
        brutal = np.array([brute.deepest(a, b, R, rc) for a, b in zip(start, end)])
        for tolerance_mm, tree in trees.items():
            bound, share, place = move_depths(tree, start, end, R, rc, tolerance_mm)
            found = depth_of(place - start - share[:, None] * (end - start), R, rc)
            true = np.fmax(brutal, found)               # what was found is a depth that is there
            assert (bound >= brutal - 1e-9).all()
            assert is_close(bound, true, tolerance_mm), (R, rc, bound, true)


@CUTTERS
def test_moves_proven_together_and_alone_agree(R, rc):
    solid = patch_solid(random_poles(5), -8.0)
    part = ExactPart.of_solid(solid)
    tree, t = DepthTree.of_part(part, TOLERANCE_MM), np.linspace(2, 28, 2001)
    xy = np.column_stack([t, 12 + 8 * np.sin(t / 3)])
    tips = np.column_stack([xy, drop_tips_mm(part, xy, R, rc)])
    tips[700:730, 2] -= 0.01
    together = move_depths(tree, tips[:-1], tips[1:], R, rc, TOLERANCE_MM)[0]
    order = np.random.default_rng(1).permutation(2000)
    alone = np.empty(2000)
    alone[order] = move_depths(tree, tips[1:][order], tips[:-1][order], R, rc, TOLERANCE_MM)[0]
    assert (np.abs(together - alone) <= TOLERANCE_MM).all()
    deep = together > 0.004
    assert deep[700:729].all() and not deep[:699].any() and not deep[731:].any()


def test_one_thread_and_two_prove_the_same():
    part = ExactPart.of_solid(patch_solid(random_poles(5), -8.0))
    tree, x = DepthTree.of_part(part, TOLERANCE_MM), np.linspace(2, 28, 4000)
    xy = np.column_stack([x, np.full(4000, 12.0)])
    tips = np.column_stack([xy, drop_tips_mm(part, xy, 4.0, 4.0)])
    before, bounds = numba.get_num_threads(), []
    for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
        numba.set_num_threads(threads)
        bounds.append(move_depths(tree, tips[:-1], tips[1:], 4.0, 4.0, TOLERANCE_MM)[0])
    numba.set_num_threads(before)
    np.testing.assert_array_equal(*bounds)


def test_moves_far_above_are_clean_to_the_last_digit(block):
    start, end = [[-9.0, -9, 30], [1, 1, 6]], [[90.0, 40, 30], [1, 1, 6]]
    bound, _, place = move_depths(tree_of(block), start, end, 4.0, 1.0, 0.01)
    assert (bound == 0.0).all() and np.isnan(place).all()


def test_a_tolerance_finer_than_the_borders_is_refused(block):
    with pytest.raises(ToolpathError, match="finer"):
        move_depths(tree_of(block), np.zeros((1, 3)), np.ones((1, 3)), 3.0, 3.0, 1e-5)
