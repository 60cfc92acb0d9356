"""The stock after several clampings: what each has cut meets in part coordinates."""

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool
from scipy.spatial.transform import Rotation

from cuspline.design import Setup
from cuspline.stock.shapes import ROUND_MM, BoxShape, CylinderShape, closed_mesh
from cuspline.stock.stock_solids import HELD, StockSolids
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame

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
    out = Workpiece(blank=BoxShape(min_mm=LOW, max_mm=HIGH))
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
    assert Workpiece(blank=BoxShape(min_mm=LOW, max_mm=HIGH)).heights_mm(FROM_X, [[1, 1]]) == pytest.approx([0])


def test_solids_of_all_clampings_have_their_stock_in_common():
    stock = piece((ABOVE, slot_from_above()), (FROM_X, pocket_from_x(9)))
    slot, hole = 20 * 4 * 4.0, np.pi * 4 * 9
    both = 9 * 4 * (np.arccos(0.5) - 0.25 * np.sqrt(3))       # the hole's cap above z = 8
    want = 20 * 16 * 12 - slot - hole + both
    for pitch, off in ((0.2, 0.03), (0.1, 0.015)):
        made = StockSolids(stock, [pitch, pitch])
        assert made.stock(ABOVE).volume() == pytest.approx(want, rel=off)
        assert made.stock(FROM_X).volume() == pytest.approx(made.stock(ABOVE).volume(), rel=1e-9)


# blanks that are no box along the WCS -----------------------------------------------------------

TURN = Rotation.from_euler("xz", (37.0, 45.0), degrees=True).as_matrix()


def turned(shape):
    """A shape as a mesh that lies turned."""
    vertices, triangles = shape.mesh
    return closed_mesh(vertices @ TURN.T, triangles, 0.0, "the turned blank", "MESH")


def turned_frame(of):
    """The frame that sees a turned part as `of` sees it straight."""
    return Frame(rotation=TURN @ of.rotation, origin_mm=of.origin_mm @ TURN.T)


BOTH = ((ABOVE, slot_from_above()), (FROM_X, pocket_from_x(9)))


def test_solids_of_many_clampings_are_not_held_and_are_the_same():
    """Of a few clampings each is made once; of more the heights alone are held, and those of grown cutters never."""
    few, many = (StockSolids(piece(*[(ABOVE, slot_from_above())] * count), [0.5] * count) for count in (2, HELD + 1))
    assert few.field(0) is few.field(0) and few.field(0, 0.1) is not few.field(0, 0.1)
    assert many.field(0) is not many.field(0) and many.field(0).z is many.field(0).z
    assert many.stock(ABOVE).volume() == pytest.approx(few.stock(ABOVE).volume(), abs=1e-6)


@pytest.mark.parametrize("shape", [BoxShape(min_mm=LOW, max_mm=HIGH),
                                   CylinderShape(from_mm=(0, 8, 6), to_mm=(20, 8, 6), radius_mm=6.0)], ids=["box", "cylinder"])
def test_a_turned_part_in_a_turned_setup_is_the_same(shape):
    """Of the box by kernels and by lines through its triangles; of the cylinder both times by lines."""
    straight, lying = Workpiece(blank=shape), Workpiece(blank=turned(shape))
    for f, paths in BOTH:
        straight, lying = straight.after(f, paths), lying.after(turned_frame(f), paths)
    rng = np.random.default_rng(7)
    points, normals = rng.uniform(LOW, HIGH, (400, 3)), rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = points[shape.holds(points)]
    normals = normals[:len(points)]
    one, maker = straight.deviations(points, normals, 30.0)
    other, by = lying.deviations(points @ TURN.T, normals @ TURN.T, 30.0)
    off = 1e-5 if isinstance(shape, BoxShape) else 0.05         # lines at a slant: to surfaces met within 1e-8, to facets
    np.testing.assert_allclose(other, one, atol=off)
    assert np.median(np.abs(other - one)) < (1e-9 if isinstance(shape, BoxShape) else ROUND_MM)
    assert (by == maker)[one < 0].all()
    assert (lying.is_stock(points @ TURN.T) == straight.is_stock(points)).mean() > 0.99
    for f in (ABOVE, FROM_X, BELOW):
        low, high = straight.box_in(f)
        xy = rng.uniform(low[:2], high[:2], (300, 2))
        here, there = straight.heights_mm(f, xy), lying.heights_mm(turned_frame(f), xy)
        np.testing.assert_allclose(there, here, atol=off)


def test_a_cylinder_has_its_own_heights_and_volume():
    bar = Workpiece(blank=CylinderShape(from_mm=(0, 8, 6), to_mm=(20, 8, 6), radius_mm=6.0))
    y = np.array([2.1, 5.0, 8.0, 13.9])
    np.testing.assert_allclose(bar.heights_mm(ABOVE, np.column_stack([np.full(4, 3.0), y])), 6 + np.sqrt(36 - (y - 8) ** 2),
                               atol=1e-6)
    assert bar.standing_mm(ABOVE, [[3, 1.9], [-0.1, 8], [3, 8]]) == pytest.approx([-np.inf, -np.inf, 12], abs=1e-6)
    cut = bar.after(ABOVE, slot_from_above(10.0))
    assert cut.heights_mm(ABOVE, [[3, 8], [3, 3]]) == pytest.approx([10, 6 + np.sqrt(11)], abs=1e-6)
    want = 20 * (np.pi * 36 - (36 * np.arcsin(2 / 6) + 2 * np.sqrt(32) - 4 * 4.0))       # a strip 4 wide, above z = 10
    assert StockSolids(cut, [0.05]).stock(ABOVE).volume() == pytest.approx(want, rel=2e-3)


def overhang():
    """A block 20 x 16 x 12 with a cave from y = 16: air at 4 < z < 8, y > 6."""
    profile = np.array([(0, 0), (16, 0), (16, 4), (6, 4), (6, 8), (16, 8), (16, 12), (0, 12)], float)
    n = len(profile)
    ends = [np.column_stack([np.full(n, x), profile]) for x in (0.0, 20.0)]
    k, nxt = np.arange(n), np.roll(np.arange(n), -1)
    caps = np.array([(0, 1, 3), (1, 2, 3), (0, 3, 4), (0, 4, 7), (4, 5, 7), (5, 6, 7)])
    sides = np.vstack([np.column_stack([k, nxt, nxt + n]), np.column_stack([k, nxt + n, k + n])])
    return closed_mesh(np.vstack(ends), np.vstack([caps[:, ::-1], caps + n, sides]), 0.0, "the casting", "MESH")


def test_a_casting_that_hangs_over_is_known_below_its_top():
    casting = Workpiece(blank=overhang())
    assert casting.heights_mm(ABOVE, [[5, 10], [5, 3]]) == pytest.approx([12, 12])
    slot = casting.after(ABOVE, slot_from_above(7.0, y=10.0))       # through the roof, into the cave
    assert slot.heights_mm(ABOVE, [[5, 10], [5, 3], [5, 14]]) == pytest.approx([4, 12, 12], abs=1e-6)
    assert (slot.highest_within_mm(ABOVE, np.array([[5.0, 10.0]]), 0.5) >= 4).all()
    points, up = np.array([[5, 3, 8.0], [5, 10, 3], [5, 14, 9]]), np.tile((0, 0, 1.0), (3, 1))
    np.testing.assert_allclose(slot.deviations(points, up, 30.0)[0], [4, 1, 3], atol=1e-6)
    assert slot.is_stock(np.array([[5, 10, 6.0], [5, 14, 6], [5, 3, 6], [5, 10, 3]])).tolist() == [False, False, True, True]
    assert StockSolids(slot, [0.1]).stock(ABOVE).volume() == pytest.approx(20 * (16 * 12 - 40 - 16), rel=5e-3)


def test_a_point_beside_the_stock_counts_as_cut_as_deep_as_the_stock_is_away():
    piece = Workpiece(blank=overhang()).after(ABOVE, slot_from_above(11.0, y=3.0))
    points, up = np.array([[5, 14, 6.0], [5, 14, 14], [5, 3, 14]]), np.tile((0, 0, 1.0), (3, 1))
    np.testing.assert_allclose(piece.deviations(points, up, 30.0)[0], [-2, -2, -3], atol=1e-6)
    np.testing.assert_allclose(piece.deviations(points, up, 1.5)[0], [-1.5] * 3, atol=1e-6)


@pytest.mark.parametrize("beside_mm, deviation_mm", [(1.3e-4, 0.0), (9e-4, 0.0), (0.05, -2.0)])
def test_a_corner_that_stands_out_of_the_stock_by_the_kernels_own_tolerance_is_no_cut(beside_mm, deviation_mm):
    points, up = np.array([[3.0, LOW[1] - beside_mm, HIGH[2]]]), np.array([[0.0, 0.0, 1.0]])
    found = piece((ABOVE, slot_from_above())).deviations(points, up, 2.0)[0]
    np.testing.assert_allclose(found, deviation_mm, atol=1e-9)


def test_a_point_in_a_wall_of_the_casting_lies_in_it():
    """Lines along a wall meet its triangles or not, as rounding has it: a hair beside, both ways, is asked too."""
    piece = Workpiece(blank=overhang()).after(ABOVE, slot_from_above(11.0, y=3.0))
    points = np.array([[x, y, 12.0] for x in (0, 20, 7) for y in (0, 16)])
    np.testing.assert_allclose(piece.deviations(points, np.tile((0, 0, 1.0), (6, 1)), 30.0)[0], 0, atol=1e-6)


@pytest.mark.parametrize("shape", [overhang(), CylinderShape(from_mm=(0, 8, 6), to_mm=(20, 8, 6), radius_mm=6.0),
                                   BoxShape(min_mm=LOW, max_mm=HIGH)], ids=["casting", "cylinder", "box"])
def test_no_stock_of_any_form_is_higher_than_its_bound(shape):
    askew = Frame(rotation=TURN, origin_mm=(1.0, 2.0, 3.0))
    stock, rng = Workpiece(blank=shape).after(ABOVE, slot_from_above(7.0)), np.random.default_rng(4)
    low, high = stock.box_in(askew)
    xy = rng.uniform(low[:2], high[:2], (200, 2))
    for radius in (0.4, 0.02):
        bound = stock.highest_within_mm(askew, xy, radius)
        angle, way = rng.uniform(0, 2 * np.pi, (20, 200)), radius * np.sqrt(rng.uniform(0, 1, (20, 200)))
        beside = xy + np.stack([way * np.cos(angle), way * np.sin(angle)], axis=-1)
        heights = stock.heights_mm(askew, beside.reshape(-1, 2)).reshape(20, 200)
        assert (heights.max(axis=0) <= bound + 1e-6).all()
        assert np.mean(bound > heights.max(axis=0) + 4 * radius) < 0.3


ASKEW = frame((4, -3, 6), (0.6, 0.8, 0), (0.64, -0.48, 0.6))


@pytest.mark.parametrize("seen_from", [ABOVE, FROM_X, BELOW, ASKEW], ids=["above", "from x", "below", "askew"])
def test_cells_hold_all_stock_and_little_more(seen_from):
    stock = piece((ABOVE, slot_from_above(2.0)), (FROM_X, pocket_from_x(25)), (BELOW, slot_from_above(-4.0, 4.0)))
    rng = np.random.default_rng(7)
    low, high = stock.box_in(seen_from)
    xy = rng.uniform(low[:2], high[:2], (500, 2))
    exact, bound = stock.heights_mm(seen_from, xy), stock.bounds_mm(seen_from, xy, stock.blank.tops_mm(seen_from, xy))
    assert (bound >= exact - 1e-6).all()
    cell = 2 * np.sqrt(3.0) * stock.cells.least_half_mm
    beside = (xy + 2 * cell * np.array(list(np.ndindex(3, 3)))[:, None] - 2 * cell).clip(low[:2], high[:2])
    near = stock.heights_mm(seen_from, beside.reshape(-1, 2)).reshape(9, -1).max(axis=0)
    assert np.mean(bound > near + 3 * cell) < 0.01          # beside walls a cell's top is that of the wall
    points = rng.uniform(LOW, HIGH, (100, 3))
    away = np.abs(points[:, None] - stock.cells.middle_mm) - stock.cells.half_mm[:, None]
    held = (away <= 1e-9).all(axis=2).any(axis=1)
    assert held[stock.is_stock(points)].all()
    assert not held[stock.cut_distance_mm(points) < -cell].any()


def test_cells_of_what_is_gone_are_gone():
    gone = Workpiece(blank=BoxShape(min_mm=LOW, max_mm=LOW + 1.5)).after(ABOVE, swept_paths(
        program((-9, 1, 30), [rapid(-9, 1, -5), feed(25, 1, -5), rapid(25, 1, 30)]), FLAT))
    assert len(gone.cells.half_mm) == 0
    assert gone.bounds_mm(ASKEW, [[0, 0], [5, 5]], np.full(2, 20.0)) == pytest.approx([ASKEW.box_into(LOW, LOW + 1.5)[0][2]] * 2)
