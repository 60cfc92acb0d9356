"""The stock after several clampings: what each has cut meets in part coordinates."""

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.design import Setup
from cuspline.stock.stock_solids import StockSolids
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.errors import SimulationError

LOW, HIGH = np.array((0.0, 0.0, 0.0)), np.array((20.0, 16.0, 12.0))
FLAT = {1: tool("flat", 4.0)}


def frame(origin=(0, 0, 0), x=(1, 0, 0), z=(0, 0, 1)):
    return Setup(name="s", wcs_in_words="", faces=("f",), wcs_origin_mm=origin, wcs_x=x, wcs_z=z).frame


ABOVE = frame()
FROM_X = frame((20, 0, 0), (0, 1, 0), (1, 0, 0))         # its Z is the part's +X, its X the part's +Y, its Y the part's +Z
BELOW = frame((0, 16, 0), (1, 0, 0), (0, 0, -1))


def slot_from_above(z=8.0, y=8.0):
    """A slot 4 wide along X, everything above z."""
    return swept_paths(program((-5, y, 30), [rapid(-5, y, z), feed(25, y, z), rapid(25, y, 30)]), FLAT)


def pocket_from_x(depth, x=8.0, y=7.0):
    """A hole of radius 2 about (y = x, z = y) of the part, `depth` deep from x = 20."""
    return swept_paths(program((x, y, 30), [rapid(x, y, 5), feed(x, y, -depth), rapid(x, y, 30)]), FLAT)


def piece(*cuts):
    out = Workpiece(min_mm=LOW, max_mm=HIGH)
    for f, paths in cuts:
        out = out.after(f, paths)
    return out


def test_a_frame_is_what_its_axes_say():
    np.testing.assert_allclose(FROM_X.out(np.array([[1.0, 2.0, 3.0]])), [[23, 1, 2]])
    np.testing.assert_allclose(BELOW.out(np.array([[1.0, 2.0, 3.0]])), [[1, 14, -3]])
    with pytest.raises(ValueError, match="square"):
        frame(x=(1, 0, 0), z=(0.6, 0, 0.8))


def test_material_is_what_no_clamping_has_taken():
    stock = piece((ABOVE, slot_from_above()), (FROM_X, pocket_from_x(9)))
    points = np.array([[5, 8, 9.0], [15, 8, 7], [5, 8, 7], [15, 8, 11], [15, 2, 7]])
    distance = stock.cut_distance_mm(points)
    assert (np.sign(distance) == [-1, -1, 1, -1, 1]).all()
    np.testing.assert_allclose(distance[2], 1.0, atol=1e-9)
    assert stock.after(ABOVE, ()).cut_distance_mm(points) == pytest.approx(distance)


@pytest.mark.parametrize("seen_from", [ABOVE, FROM_X, BELOW], ids=["above", "from x", "below"])
def test_no_stock_within_a_radius_is_higher_than_its_bound(seen_from):
    stock, rng = piece((ABOVE, slot_from_above(-1.0)), (FROM_X, pocket_from_x(25))), np.random.default_rng(4)
    low, high = stock.box_in(seen_from)
    xy = rng.uniform(low[:2], high[:2], (400, 2))
    for radius in (0.4, 0.02, 3.0):                 # of the last one nothing is left of the cutter of radius 2
        bound = stock.highest_within_mm(seen_from, xy, radius)
        angle, way = rng.uniform(0, 2 * np.pi, (30, 400)), radius * np.sqrt(rng.uniform(0, 1, (30, 400)))
        beside = xy + np.stack([way * np.cos(angle), way * np.sin(angle)], axis=-1)
        heights = stock.heights_mm(seen_from, beside.clip(low[:2], high[:2]).reshape(-1, 2)).reshape(30, 400)
        assert (heights.max(axis=0) <= bound + 1e-6).all()
        assert np.mean(bound > heights.max(axis=0) + 2 * radius) < (0.4 * radius if radius < 2 else 1.1)


def test_a_gouge_is_followed_from_one_clamping_into_another():
    stock = piece((ABOVE, slot_from_above()), (FROM_X, pocket_from_x(9)))
    points, up = np.array([[15, 8, 12.0], [5, 8, 12], [15, 8, 6], [15, 2, 12]]), np.tile((0, 0, 1.0), (4, 1))
    each, _ = stock.deviations_of_cuts(points, up, 30.0)
    np.testing.assert_allclose(each[0, :2], -4, atol=1e-6)
    deviation, maker = stock.deviations(points, up, 30.0)
    # down to 8 by the slot, and the hole about z = 7 goes on from 9 to 5; a point in the hole: to its floor
    np.testing.assert_allclose(deviation, [-7, -4, -1, 0], atol=1e-6)
    assert maker[:3].tolist() == [0, 0, 1]
    reverse, _ = piece((FROM_X, pocket_from_x(9)), (ABOVE, slot_from_above())).deviations(points, up, 30.0)
    np.testing.assert_allclose(reverse, deviation, atol=1e-6)


def test_stock_that_is_left_ends_at_the_nearest_cut():
    stock = piece((ABOVE, slot_from_above(10.0)), (BELOW, slot_from_above(-4.0)))
    point = np.array([[5, 8, 6.0], [5, 8, 6.0]])
    deviation, maker = stock.deviations(point, np.array([[0, 0, 1.0], [0, 0, -1]]), 30.0)
    np.testing.assert_allclose(deviation, [4, 2], atol=1e-6)
    assert maker.tolist() == [0, 1]


def test_heights_are_seen_from_any_side():
    stock = piece((ABOVE, slot_from_above()))
    assert stock.heights_mm(ABOVE, [[5, 8], [5, 1]]) == pytest.approx([8, 12])
    assert piece((frame((0, 0, 3)), slot_from_above(5.0))).heights_mm(ABOVE, [[5, 8]]) == pytest.approx([8])
    assert stock.heights_mm(FROM_X, [[8, 11], [8, 4], [1, 11]]) == pytest.approx([-20, 0, 0])
    assert stock.heights_mm(BELOW, [[5, 8], [5, 1]]) == pytest.approx([0, 0])
    through = piece((ABOVE, slot_from_above(-1.0)))
    assert through.heights_mm(BELOW, [[5, 8], [5, 1]]) == pytest.approx([-12, 0], abs=1e-6)
    assert Workpiece(min_mm=LOW, max_mm=HIGH).heights_mm(FROM_X, [[1, 1]]) == pytest.approx([0])


def test_solids_of_all_clampings_have_their_stock_in_common():
    stock = piece((ABOVE, slot_from_above()), (FROM_X, pocket_from_x(9)))
    slot, hole = 20 * 4 * 4.0, np.pi * 4 * 9
    both = 9 * 4 * (np.arccos(0.5) - 0.25 * np.sqrt(3))       # the hole's cap above z = 8
    want = 20 * 16 * 12 - slot - hole + both
    for pitch, off in ((0.2, 0.03), (0.05, 0.008)):
        made = StockSolids(stock, [pitch, pitch])
        assert made.stock(ABOVE).volume() == pytest.approx(want, rel=off)
        assert made.stock(FROM_X).volume() == pytest.approx(made.stock(ABOVE).volume(), rel=1e-9)


def test_a_billet_that_stands_askew_is_refused():
    with pytest.raises(SimulationError, match="not parallel"):
        piece((frame(x=(0, 1, 0), z=(0.6, 0, 0.8)), ())).deviations(LOW[None], np.array([[0, 0, 1.0]]), 1.0)
