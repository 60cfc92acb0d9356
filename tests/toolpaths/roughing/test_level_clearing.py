"""Level-wise clearing: engagement, entries, links, allowance and completeness, judged by an independent meter."""

import functools
import math
from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from clearing_meter import measure_cuts
from scipy import ndimage

from cuspline.kernel import brep
from cuspline.program.program import Kind
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.toolpaths.roughing.level_clearing import ClearingRules, _Job, clear, engagement_of_rad
from cuspline.toolpaths.roughing.level_fields import PlaneGrid
from cuspline.toolpaths.roughing.stock_fields import box_stock, lines_of_moves, points_of_move, stock_after, swept_by_lines
from cuspline.values.errors import ToolpathError

METER_RAD = math.radians(15)    # of the meter: one bin at each end, three nodes' step, one node, on a 50-node radius
RADIUS_MM = 4.0
BOX = cq.Workplane().box(44, 34, 12, centered=False)


def _cut_from_top(shape):
    return BOX.cut(shape)


def _bump():
    profile = cq.Workplane("XZ").moveTo(0, 2).spline([(11, 4), (22, 10), (33, 5), (44, 2)], includeCurrent=True)
    return profile.lineTo(44, 0).lineTo(0, 0).close().extrude(-34)


PARTS = {
    "pocket": lambda: _cut_from_top(cq.Workplane().box(30, 22, 9).translate((22, 17, 11.5))),
    "pocket with islands": lambda: _cut_from_top(
        cq.Workplane().box(40, 30, 8).translate((22, 17, 12))
        .cut(cq.Workplane().circle(3).extrude(20).translate((14, 17, 0)))
        .cut(cq.Workplane().box(4, 6, 40).translate((31, 17, 0)))),
    "open slot": lambda: _cut_from_top(cq.Workplane().box(60, 11, 12).translate((22, 17, 12))),
    "boss": lambda: _cut_from_top(cq.Workplane().box(60, 50, 12).translate((22, 17, 12))
                                  .cut(cq.Workplane().circle(7).extrude(30).translate((22, 17, 0)))),
    "free-form bump": _bump,
    "through hole": lambda: _cut_from_top(cq.Workplane().circle(9).extrude(30).translate((22, 17, -5))),
}


def _mesh(shape):
    mesh = brep.planning_mesh(brep.the_solid(shape.val(), "part"), 0.01)
    return DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)


def _rules(mesh, **changes):
    low, high = (0.0, 0.0, 0.0), (44.0, 34.0, 13.0)
    return replace(ClearingRules(
        mesh=mesh, radius_mm=RADIUS_MM, corner_radius_mm=0.0, allowance_mm=0.3, stepdown_mm=4.0,
        engagement_rad=engagement_of_rad(0.8 * RADIUS_MM, RADIUS_MM), stock_mm=box_stock(low, high),
        stock_min_mm=np.array(low), stock_max_mm=np.array(high), ramp_rad=math.radians(3), clearance_z_mm=18.0,
        feed_mm_per_min=2000.0, ramp_feed_mm_per_min=600.0, rapid_mm_per_min=10000.0), **changes)


@functools.cache
def _roughed(part):
    """Rules and clearing of a part, made once."""
    rules = _rules(_mesh(PARTS[part]()))
    return rules, clear(rules)


def _measured(moves, rules):
    helix_turn_mm = 2 * math.pi * RADIUS_MM * math.tan(rules.ramp_rad)
    return measure_cuts(moves, rules.radius_mm, rules.corner_radius_mm, rules.stock_mm, rules.stock_min_mm,
                        rules.stock_max_mm, rules.radius_mm / 50, 0.02, helix_turn_mm)


def _lowest_gap_mm(moves, rules):
    """Least height of any cutting move over what keeps the allowance."""
    points = [points_of_move(moves, k) for k in np.flatnonzero(moves.kind != Kind.RAPID)]
    ends = np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in points])
    share = np.linspace(0, 1, 9)[:, None, None]
    tips = (ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).reshape(-1, 3)
    a = rules.allowance_mm
    floor = drop_tips_mm(rules.mesh, tips[:, :2], rules.radius_mm + a, rules.corner_radius_mm + a) + a
    return float((tips[:, 2] - floor).min())


def _removable(rules, level):
    """Nodes that the cutter can clear at a level, two nodes kept back; by drop-cutter and disks of pixels alone."""
    grid = PlaneGrid.over(rules.stock_min_mm[:2] - 8.0, rules.stock_max_mm[:2] + 8.0, 0.2)
    a = rules.allowance_mm
    tips = drop_tips_mm(rules.mesh, grid.xy_mm, rules.radius_mm + a + 0.03, rules.corner_radius_mm + a)
    allowed = (tips + a + rules.margin_mm <= level).reshape(grid.ny, grid.nx)
    reach, pad = rules.turn_mm + 0.4, int(rules.radius_mm / 0.2)
    inner = ndimage.distance_transform_edt(np.pad(allowed, pad, constant_values=True)) * 0.2 > reach
    opened = ndimage.distance_transform_edt(~inner) * 0.2 < reach - 0.4
    cleared = ndimage.distance_transform_edt(~opened) * 0.2 < rules.radius_mm - 0.4
    return grid, cleared[pad:-pad, pad:-pad]


@pytest.fixture(scope="module", params=PARTS)
def cleared(request):
    rules, clearing = _roughed(request.param)
    return rules, clearing, _measured(clearing.moves, rules)


def test_engagement_stays_within_its_bound(cleared):
    rules, clearing, measured = cleared
    assert clearing.largest_engagement_rad <= rules.engagement_rad + 1e-9
    level_moves = measured.engaged_rad[measured.fall_rad == 0]
    assert np.mean(level_moves <= rules.engagement_rad + METER_RAD) >= 0.99
    # where a pass turns sharply at a wall, single steps of it come out higher; a slot would be 180 degrees
    assert measured.largest_level_engagement_rad <= rules.engagement_rad + METER_RAD + math.radians(10)


def test_the_cutter_enters_no_steeper_than_the_ramp_and_never_straight_down(cleared):
    rules, _, measured = cleared
    assert measured.steepest_fall_rad <= rules.ramp_rad + 1e-6


def test_no_rapid_meets_the_stock(cleared):
    assert cleared[2].deepest_rapid_mm == 0.0


def test_the_allowance_is_kept_everywhere_along_the_path(cleared):
    rules, clearing, _ = cleared
    assert _lowest_gap_mm(clearing.moves, rules) >= -1e-6


def test_everything_within_reach_is_removed(cleared):
    rules, clearing, _ = cleared
    left = stock_after(clearing.moves, rules.radius_mm, 0.0, rules.stock_mm)
    assert clearing.left_mm3 <= 5e-4 * clearing.removed_mm3
    for level in clearing.levels_mm:
        grid, removable = _removable(rules, level)
        assert removable.any()
        # fins thinner than the planner's nodes may stay: a node in ten thousand
        assert np.mean(grid.sampled(left)[removable] > level + 1e-3) <= 1e-4


def test_a_floor_is_cut_to_its_allowance():
    rules, clearing = _roughed("pocket")
    assert min(clearing.levels_mm) == pytest.approx(7.0 + rules.allowance_mm + rules.margin_mm, abs=1e-5)


def test_levels_lie_no_farther_apart_than_the_stepdown():
    rules, clearing = _roughed("free-form bump")
    levels = np.array([rules.stock_max_mm[2], *clearing.levels_mm])
    assert (-np.diff(levels) <= rules.stepdown_mm + 1e-9).all()


def test_fine_levels_take_the_steps_off_a_slope():
    rules, coarse = _roughed("free-form bump")
    assert coarse.removed_mm3 < clear(replace(rules, fine_step_mm=2.0)).removed_mm3


def test_a_bull_nose_keeps_the_allowance_too():
    rules = _rules(_mesh(PARTS["free-form bump"]()), corner_radius_mm=1.0, stepdown_mm=3.0)
    clearing = clear(rules)
    assert _lowest_gap_mm(clearing.moves, rules) >= -1e-6
    assert _measured(clearing.moves, rules).deepest_rapid_mm == 0.0


def test_a_ball_is_refused():
    with pytest.raises(ToolpathError, match="corner radius"):
        clear(_rules(_mesh(BOX), corner_radius_mm=RADIUS_MM))


def test_rest_roughing_cuts_only_where_the_large_cutter_left_material():
    rules, first = _roughed("pocket")
    left = stock_after(first.moves, rules.radius_mm, 0.0, rules.stock_mm)
    small = replace(rules, radius_mm=1.5, stock_mm=left, threshold_mm=0.2, stepdown_mm=3.0)
    rest = clear(small)
    assert 0 < rest.removed_mm3 < 0.03 * first.removed_mm3
    cutting = rest.moves.end_mm[(rest.moves.kind != Kind.RAPID)][:, :2]
    corners = np.array([(x, y) for x in (7, 37) for y in (6, 28)])
    far = np.linalg.norm(cutting[:, None] - corners, axis=2).min(axis=1)
    assert far.max() < 12.0
    assert _measured(rest.moves, small).deepest_rapid_mm == 0.0


def test_a_ball_led_as_a_flat_cutter_comes_down_by_rapid_no_lower_than_over_the_ridges_that_it_leaves():
    rules = _rules(_mesh(PARTS["pocket"]()), radius_mm=6.0, stepdown_mm=3.0, ridge_mm=6.0, engagement_rad=math.pi / 2)
    moves = clear(rules).moves
    lines = lines_of_moves(moves)
    down = [k for k in range(1, len(moves)) if moves.kind[k] == Kind.RAPID and moves.end_mm[k, 2] < moves.end_mm[k - 1, 2]]
    assert len(down) > 3
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    disc = np.vstack([r * np.column_stack([np.cos(turn), np.sin(turn)]) for r in np.linspace(0.1, 6.0, 30)])
    for k in down:
        under = moves.end_mm[k, :2] + disc
        stands = swept_by_lines(lines[:k], 6.0, 6.0)(under, rules.stock_mm(under))
        bottom = moves.end_mm[k, 2] + 6.0 - np.sqrt(np.maximum(36.0 - (disc ** 2).sum(axis=1), 0.0))
        assert (bottom - stands).min() >= 0.95      # the approach of 1 mm, less what stands between the planner's nodes


def test_the_cutter_keeps_out_of_boxes():
    rules = _rules(_mesh(PARTS["boss"]()))
    jaw = ((0.0, -30.0, 0.0), (44.0, 0.0, 9.0))
    moves = clear(replace(rules, keep_out=(jaw,), keep_out_mm=1.0)).moves
    low = (moves.end_mm[:, 2] < 10.0) & (moves.end_mm[:, 0] > 0) & (moves.end_mm[:, 0] < 44)
    assert moves.end_mm[low, 1].min() >= RADIUS_MM + 1.0 - 0.01


def test_paths_are_the_same_every_time():
    rules, clearing = _roughed("pocket")
    assert np.array_equal(clear(rules).moves.end_mm, clearing.moves.end_mm)


def test_nothing_to_remove_is_refused():
    with pytest.raises(ToolpathError, match="nothing to remove"):
        clear(_rules(_mesh(BOX), stock_mm=box_stock((0, 0, 0), (44, 34, 12.1)), stock_max_mm=np.array([44, 34, 12.1])))


@pytest.mark.parametrize("changes, words", [
    ({"engagement_rad": 3.0}, "engagement"),
    ({"ramp_rad": 1.0}, "ramp"), ({"clearance_z_mm": 10.0}, "clearance plane")])
def test_bounds_that_cannot_be_used_are_refused(changes, words):
    with pytest.raises(ToolpathError, match=words):
        clear(_rules(_mesh(BOX), **changes))


def test_a_place_is_free_at_a_level_where_the_lowest_tip_is_no_higher():
    fixture = DropMesh.from_triangles([[30.0, 20.0, 9.0], [40.0, 20.0, 9.0], [30.0, 30.0, 9.0]], [[0, 1, 2]])
    job = _Job(_rules(_mesh(PARTS["pocket with islands"]()), keep_clear=(fixture,), keep_out_mm=1.0,
                      keep_out=((np.array([0.0, 0.0, 0.0]), np.array([5.0, 9.0, 7.0])),),
                      lowest_mm=lambda at: 12.0 - 0.2 * at[:, 0]))             # a holder that a wall at the left keeps up
    xy = np.random.default_rng(6).uniform((-4, -4), (48, 38), (3000, 2))
    tips = job.tip_mm(xy)
    for level in (4.3, 8.0, 9.5, 10.0, 12.3):
        assert np.array_equal(job.is_free_at(xy, level), tips <= level)


def test_a_hole_is_entered_at_each_level_from_the_level_before():
    """Hardly wider than the cutter: its walls stand within the grid's rim of it, and helices ran down from the top each time."""
    hole = _cut_from_top(cq.Workplane().circle(RADIUS_MM + 1.0).extrude(30).translate((22, 17, -5)))
    made = clear(_rules(_mesh(hole), stepdown_mm=2.0))
    moves, levels = made.moves, len(made.levels_mm)
    helix = (moves.kind >= Kind.ARC_CW) & (moves.end_mm[:, 2] < moves.starts_mm[:, 2] - 1e-9)
    fallen = (moves.starts_mm - moves.end_mm)[helix, 2].sum()
    assert levels > 6 and 13.0 - 1e-6 <= fallen <= 13.0 + 0.5 * levels + 1e-6        # each begins half a millimetre over the stock


def test_where_the_neck_comes_by_deeper_no_more_is_left_as_too_thin_than_the_neck_is_slimmer():
    """A rest cutter leaves 0.4 mm; its neck is 0.35 mm slimmer and follows 5 mm above the tip: the last 5 mm may keep more."""
    slot = BOX.cut(cq.Workplane().box(60, 8.5, 20).translate((22, 17, 11)))
    high = np.array((44.0, 34.0, 12.0))
    job = _Job(_rules(_mesh(slot), radius_mm=2.0, threshold_mm=0.4, stock_max_mm=high, stock_mm=box_stock((0.0, 0.0, 0.0), high),
                      flutes_mm=5.0, relief_mm=0.35))
    lowest = job.forced[-1]
    inside = job._inside(8.0)
    beside_neck = inside * job.grid.pitch_mm > -(2.0 - 0.35)
    for above, is_all in ((12.0, True), (lowest + 5.1, True), (lowest + 4.9, False)):
        ground = job._ground(job._material(8.0), inside, 0.0, above)
        assert ground._in_reach[beside_neck].all() == is_all
