"""Moves over tip paths: nothing is gouged on the way, rapids stay high, lifts are few."""

import dataclasses

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.program.program import Kind
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.toolpaths.freeform.parallel_passes import parallel_curves
from cuspline.toolpaths.freeform.path_order import ordered_paths
from cuspline.toolpaths.freeform.plane_curves import PlaneCurve
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_links import MOST_FOLDS, TipLinkRules, moves_of_tip_paths, ramp
from cuspline.toolpaths.freeform.tip_paths import PathRules, TipPath, tip_paths
from cuspline.values.errors import ToolpathError

RADIUS_MM, TOLERANCE_MM, STOCK_MM = 1.5, 0.001, 0.3
CLEARANCE_MM, APPROACH_MM = 20.0, 12.0
RULES = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.002, bridge_mm=0.0)


def part(work):
    solid = brep.the_solid(work)
    return brep.faces_of(solid), brep.planning_mesh(solid, 0.005)


@pytest.fixture(scope="module")
def plain():
    return part(cq.Workplane().box(24, 16, 5, centered=False))


@pytest.fixture(scope="module")
def island():
    """A plate with a boss of 6 x 6, 4 high, amid it and a hole of 5."""
    return part(cq.Workplane().box(30, 20, 5, centered=False).faces(">Z").workplane(origin=(18, 10, 5)).rect(6, 6)
                .extrude(4).faces("<Z").workplane(origin=(7, 10, 0)).hole(5))


def field_of(country, z=5.0):
    faces, mesh = country
    wanted = [i for i, f in enumerate(faces) if f.kind == "plane" and f.middle.normal[0, 2] > 0.99
              and abs(f.middle.point_mm[0, 2] - z) < 1e-6]
    low, high = mesh.vertices_mm.min(axis=0), mesh.vertices_mm.max(axis=0)
    return tip_field(MeshDropper.of(mesh, RADIUS_MM, RADIUS_MM), wanted, (low[:2], high[:2]), 0.25)


def rules_of(country, field, **changes):
    stock = MeshDropper.of(country[1], RADIUS_MM, RADIUS_MM, STOCK_MM)
    return TipLinkRules(**{**dict(
        field=field, stock=stock, clearance_z_mm=CLEARANCE_MM, approach_z_mm=APPROACH_MM, feed_mm_per_min=900.0,
        plunge_mm_per_min=300.0, tolerance_mm=TOLERANCE_MM, surface_link_mm=3.0, hop_mm=12.0, lead_radius_mm=1.0,
        is_one_way=False), **changes})


def lines_on(field, angle=0.0, scallop_mm=0.02):
    return tip_paths(parallel_curves(field, angle, scallop_mm), field, RULES)


def lifts(moves):
    """How often the tool leaves its work for the clearance height."""
    z = np.r_[moves.start_mm[2], moves.end_mm[:, 2]]
    return int(((z[:-1] < CLEARANCE_MM) & (z[1:] == CLEARANCE_MM)).sum())


def sampled(moves, rows, spacing_mm=0.02):
    starts, d = moves.starts_mm[rows], (moves.end_mm - moves.starts_mm)[rows]
    count = np.ceil(np.linalg.norm(d[:, :2], axis=1) / spacing_mm).astype(int) + 2
    which = np.repeat(np.arange(len(d)), count)
    share = np.concatenate([np.linspace(0, 1, c) for c in count])[:, None]
    return starts[which] + share * d[which]


@pytest.mark.parametrize("is_one_way", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_no_move_gouges_and_no_rapid_runs_below_the_approach_height(island, angle, is_one_way):
    field = field_of(island)
    rules = rules_of(island, field, is_one_way=is_one_way)
    moves = moves_of_tip_paths(lines_on(field, angle), rules)
    cutting = moves.kind == Kind.FEED
    tips = sampled(moves, np.flatnonzero(cutting))
    assert (tips[:, 2] - field.dropper.tips_mm(tips[:, :2])).min() >= -TOLERANCE_MM
    assert min(moves.starts_mm[~cutting, 2].min(), moves.end_mm[~cutting, 2].min()) >= APPROACH_MM
    assert moves.start_mm[2] == CLEARANCE_MM == moves.end_mm[-1, 2]
    across = np.abs(moves.end_mm - moves.starts_mm)[:, :2].max(axis=1) > 0
    assert (moves.end_mm[~cutting & across, 2] == CLEARANCE_MM).all()


def test_rapids_that_know_what_may_stand_go_as_near_as_their_clearance(island):
    """Straight up and down alone, the gap kept on all sides; feeds in the air are shorter."""
    field, gap = field_of(island), 0.7
    one_way = {"is_one_way": True, "hop_mm": 0.5, "surface_link_mm": 0.0}
    plain = moves_of_tip_paths(lines_on(field), rules_of(island, field, **one_way))
    rules = rules_of(island, field, **one_way, rapids=MeshDropper.of(island[1], RADIUS_MM, RADIUS_MM, STOCK_MM + gap))
    moves = moves_of_tip_paths(lines_on(field), rules)
    rapid = moves.kind == Kind.RAPID
    low = rapid & (np.minimum(moves.starts_mm[:, 2], moves.end_mm[:, 2]) < APPROACH_MM)
    assert low.sum() > 20 and (moves.starts_mm[low, :2] == moves.end_mm[low, :2]).all()
    nearest = np.minimum(moves.starts_mm[low, 2], moves.end_mm[low, 2]) - rules.rapids.tips_mm(moves.end_mm[low, :2])
    assert np.abs(nearest).min() < 1e-9 and nearest.min() > -1e-9
    air = lambda m: np.abs(np.diff(np.r_[m.start_mm[2], m.end_mm[:, 2]]))[m.kind == Kind.FEED].sum()
    assert air(moves) < 0.6 * air(plain)


def test_a_plain_face_is_cut_to_and_fro_without_a_lift(plain):
    field = field_of(plain)
    paths = lines_on(field)
    moves = moves_of_tip_paths(paths, rules_of(plain, field))
    assert lifts(moves) == 1 and len(paths) > 20
    cut = np.abs(moves.end_mm - moves.starts_mm)[(moves.kind == Kind.FEED) & (moves.end_mm[:, 2] == 5.0)]
    assert abs(cut[:, 0].sum() - 24 * len(paths)) < 0.5
    assert len(cut) <= 2 * len(paths) + 1                       # a line and a link each


def test_around_an_island_the_tool_lifts_seldom(island):
    field = field_of(island)
    paths = lines_on(field)
    moves = moves_of_tip_paths(paths, rules_of(island, field))
    assert len(paths) > 50 and lifts(moves) <= 4


def test_one_way_passes_all_run_in_their_own_direction(plain):
    field = field_of(plain)
    moves = moves_of_tip_paths(lines_on(field), rules_of(plain, field, is_one_way=True))
    d = moves.end_mm - moves.starts_mm
    on_face = (moves.kind == Kind.FEED) & (moves.starts_mm[:, 2] == 5.0) & (moves.end_mm[:, 2] == 5.0)
    assert (d[on_face, 0] > 23.9).all() and on_face.sum() > 20


def test_every_path_is_cut_once_from_end_to_end(island):
    field = field_of(island)
    paths = lines_on(field)
    order = ordered_paths(paths, field, 3.0, False)
    key = lambda p: tuple(sorted(map(tuple, p.tips_mm[[0, -1]])))
    assert sorted(map(key, order)) == sorted(map(key, paths))


def test_bearings_put_the_lowest_pass_first_or_the_lower_end():
    """Four passes up a slope, laid from the top: step-up and uphill; none is lost, none is cut twice."""
    paths = [TipPath(tips_mm=np.array([(0, y, y + 0.4), (10, y, y + 0.4 * (-1) ** y)]), is_closed=False, curve=y)
             for y in (3, 2, 1, 0)]
    up = ordered_paths(paths, None, 0.0, False, "step-up")
    assert [p.curve for p in up] == [0, 1, 2, 3]
    assert all(np.linalg.norm(a.tips_mm[-1, :2] - b.tips_mm[0, :2]) < 1.1 for a, b in zip(up, up[1:]))        # to and fro
    assert [p.tips_mm[0, 0] for p in ordered_paths(paths, None, 0.0, True, "step-up")] == [0.0] * 4
    uphill = ordered_paths(paths, None, 0.0, False, "uphill")
    assert len(uphill) == 4 and all(p.tips_mm[0, 2] <= p.tips_mm[-1, 2] for p in uphill)


def test_a_link_over_the_island_clears_what_roughing_left_on_it(island):
    """From one side of the boss to the other: up over its stock, across, down, without the clearance height."""
    field = field_of(island)
    paths = [TipPath(tips_mm=np.array([(13, 10, 5), (13.4, 10, 5)]), is_closed=False, curve=0),
             TipPath(tips_mm=np.array([(22.6, 10, 5), (23, 10, 5)]), is_closed=False, curve=1)]
    moves = moves_of_tip_paths(paths, rules_of(island, field, lead_radius_mm=0.0))
    assert lifts(moves) == 1
    over = sampled(moves, np.flatnonzero((moves.kind == Kind.FEED) & (moves.end_mm[:, 0] > 13.5)
                                         & (moves.starts_mm[:, 0] < 22.5)))
    assert over[:, 2].min() > 9 + STOCK_MM and over[:, 2].max() < 9 + STOCK_MM + 0.2


def test_closed_paths_are_entered_where_they_lie_nearest(plain):
    field = field_of(plain)
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.column_stack([np.cos(t), np.sin(t)])
    rings = [PlaneCurve(xy_mm=(12, 8) + r * circle, is_closed=True) for r in (5, 5.5, 6)]
    moves = moves_of_tip_paths(tip_paths(rings, field, RULES), rules_of(plain, field, is_one_way=True))
    assert lifts(moves) == 1


def test_entries_and_exits_are_tangent(plain):
    field = field_of(plain)
    path = TipPath(tips_mm=np.array([(5, 8, 5), (15, 8, 5)]), is_closed=False, curve=0)
    moves = moves_of_tip_paths([path], rules_of(plain, field))
    row = int(np.flatnonzero(np.abs(moves.end_mm - path.tips_mm[0]).max(axis=1) < 1e-9)[0])
    for move in (moves.end_mm - moves.starts_mm)[[row, row + 2]]:
        assert move[0] > 0 and abs(move[2]) / move[0] < np.tan(np.radians(6))
    assert not (moves.feed_mm_per_min == 300.0).any()           # the arc itself goes down into the stock


def test_the_tool_plunges_slowly_through_stock_and_only_there(plain):
    field = field_of(plain)
    path = TipPath(tips_mm=np.array([(5, 8, 5), (15, 8, 5)]), is_closed=False, curve=0)
    moves = moves_of_tip_paths([path], rules_of(plain, field, lead_radius_mm=0.0))
    (row,) = np.flatnonzero(moves.feed_mm_per_min == 300.0)
    assert np.abs(moves.starts_mm[row] - (5, 8, 5 + STOCK_MM + 0.1)).max() < 1e-9
    assert np.abs(moves.end_mm[row] - (5, 8, 5)).max() < 1e-9


def test_a_clearance_below_the_part_is_refused(plain):
    field = field_of(plain)
    with pytest.raises(ToolpathError, match="clearance"):
        moves_of_tip_paths(lines_on(field), rules_of(plain, field, clearance_z_mm=4.0, approach_z_mm=3.0))


def test_an_empty_operation_is_refused(plain):
    with pytest.raises(ToolpathError, match="no path"):
        moves_of_tip_paths([], rules_of(plain, field_of(plain)))


def test_a_cutter_that_does_not_cut_at_its_centre_comes_down_on_a_ramp(plain):
    """3 degrees through what stands, however short the passes; above it as steeply as the others."""
    field, steepest = field_of(plain), np.radians(3.0)
    moves = moves_of_tip_paths(lines_on(field), rules_of(plain, field, steepest_rad=steepest, surface_link_mm=0.0, hop_mm=0.0))
    starts, down = moves.starts_mm, moves.starts_mm[:, 2] - moves.end_mm[:, 2]
    in_stock = (moves.end_mm[:, 2] < 5.0 + STOCK_MM - 1e-9) & (down > 1e-9)
    way = np.linalg.norm((moves.end_mm - starts)[in_stock, :2], axis=1)
    assert in_stock.sum() > 20 and (np.arctan2(down[in_stock], way) <= steepest).all()


def test_a_path_too_short_for_all_that_may_stand_is_entered_from_what_does_stand_there(plain):
    """What earlier cutters may have left is their worst anywhere, 6 mm here; 0.3 mm stand: a ramp from there, no arc."""
    field, steepest = field_of(plain), np.radians(3.0)
    path = TipPath(tips_mm=np.array([(10.0, 8, 5), (10.3, 8, 5)]), is_closed=False, curve=0)
    rules = {"steepest_rad": steepest, "stock": MeshDropper.of(plain[1], RADIUS_MM, RADIUS_MM, 6.0)}
    steep = []
    for heights in (None, lambda xy: np.full(len(xy), 5.3)):
        moves = moves_of_tip_paths([path], rules_of(plain, field, heights=heights, **rules))
        down = moves.starts_mm[:, 2] - moves.end_mm[:, 2]
        way = np.linalg.norm((moves.end_mm - moves.starts_mm)[:, :2], axis=1)
        low = (moves.end_mm[:, 2] < 5.3 - 1e-9) & (down > 1e-9)
        steep.append(float(np.arctan2(down[low], way[low]).max()))
    assert steep[0] > 2 * steepest and steep[1] <= steepest


def test_a_ramp_runs_to_and_fro_over_its_path():
    path = np.array([(0.0, 0, 1), (3, 0, 1), (3, 4, 2)])                  # 7 long in plan
    tips = ramp(path, 1.0, 0.04)                                           # 25 long: three whole folds and 4 more
    assert tips[-1] == pytest.approx(path[0]) and tips[0] == pytest.approx((3, 0, 2.0))
    way = np.linalg.norm(np.diff(tips[:, :2], axis=0), axis=1)
    assert way.sum() == pytest.approx(25.0) and ramp(path, 1.0, 0.001) is None
    short = ramp(np.array([(0.0, 0, 1), (0.05, 0, 1)]), 0.44, 0.158, None, MOST_FOLDS)     # a twentieth of a millimetre long
    assert len(short) > 55 and (-np.diff(short[:, 2]) <= 0.158 * 0.05 + 1e-12).all() and short[0, 2] == pytest.approx(1.44)
    on_path = np.where(tips[:, 0] < 3 - 1e-9, 1.0, 1.0 + tips[:, 1] / 4)
    assert tips[:, 2] - on_path == pytest.approx(0.04 * (25.0 - np.concatenate([[0], np.cumsum(way)])))


def test_a_ramp_is_no_longer_than_what_stands_round_its_entry_asks(plain):
    """The allowance is the most that stands anywhere: where nothing does, nothing is ramped."""
    field, steepest = field_of(plain), np.radians(3.0)
    rules = dict(steepest_rad=steepest, surface_link_mm=0.0, hop_mm=0.0)
    length = lambda **more: float(np.linalg.norm(
        (m := moves_of_tip_paths(lines_on(field), rules_of(plain, field, **rules, **more))).end_mm - m.starts_mm, axis=1)[
            m.kind == 1].sum())
    none, half = length(standing=lambda xy: np.zeros(len(xy))), length(standing=lambda xy: np.full(len(xy), STOCK_MM / 2))
    assert none < half < length() and length(standing=lambda xy: np.full(len(xy), 9.0)) == length()


def test_a_cutter_that_leads_comes_straight_down_onto_its_pass_from_behind(plain):
    """Along the pass' own direction at the slope given, however long what stands makes it."""
    field, slope = field_of(plain), np.radians(20.0)
    moves = moves_of_tip_paths(lines_on(field), rules_of(
        plain, field, steepest_rad=np.radians(10.0), surface_link_mm=0.0, hop_mm=0.0, is_one_way=True, behind_rad=slope))
    way = moves.end_mm - moves.starts_mm
    down = (moves.kind == 1) & (way[:, 2] < -1e-9) & (np.linalg.norm(way[:, :2], axis=1) > 1e-6) & (moves.end_mm[:, 2] > 5.0 - 1e-9)
    found = np.degrees(np.arctan2(-way[down, 2], np.linalg.norm(way[down, :2], axis=1)))
    assert down.sum() >= 6 and np.abs(found - 20.0).max() < 1e-6 and (way[down, 0] > 0).all()


def test_a_cutter_that_leads_toward_one_side_comes_from_behind_where_it_is_fed_there_alone(plain):
    """Fed the other way it trails: it comes down on a ramp along its pass, whose last stretch runs toward that side."""
    field, slope = field_of(plain), np.radians(20.0)
    moves = moves_of_tip_paths(lines_on(field), rules_of(
        plain, field, steepest_rad=np.radians(10.0), surface_link_mm=0.0, hop_mm=0.0, behind_rad=slope, behind_toward=(1.0, 0.0)))
    way = moves.end_mm - moves.starts_mm
    level = np.linalg.norm(way[:, :2], axis=1)
    down = (moves.kind == 1) & (way[:, 2] < -1e-9) & (level > 1e-6) & (moves.end_mm[:, 2] > 5.0 - 1e-9)
    steep = down & (way[:, 2] < -level * np.tan(np.radians(10.0)))
    cut = (moves.kind == 1) & (np.abs(way[:, 2]) < 1e-9) & (level > 1.0)
    assert steep.sum() >= 6 and (way[steep, 0] > 0).all()
    assert (way[cut, 0] > 0).any() and (way[cut, 0] < 0).any() and (down & ~steep).any()
    last = np.flatnonzero(down & ~steep & np.roll(cut & (way[:, 0] < 0), -1))
    assert len(last) and (way[last, 0] > 0).all()


def test_paths_that_keep_their_order_are_cut_as_they_are_given(plain):
    field = field_of(plain)
    given = [dataclasses.replace(p, tips_mm=p.tips_mm[::-1]) for p in lines_on(field)[::-1]]
    moves = moves_of_tip_paths(given, rules_of(plain, field, surface_link_mm=0.0, keeps_order=True))
    firsts = [int(np.flatnonzero(np.abs(moves.end_mm - p.tips_mm[0]).max(axis=1) < 1e-9)[0]) for p in given]
    lasts = [int(np.flatnonzero(np.abs(moves.end_mm - p.tips_mm[-1]).max(axis=1) < 1e-9)[0]) for p in given]
    assert len(given) > 3 and all(a < b for a, b in zip(firsts, lasts)) and sorted(firsts) == firsts
