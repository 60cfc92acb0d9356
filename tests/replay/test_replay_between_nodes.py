"""Contacts that no node of the z-map and no end of a move shows: each must turn red, its good twin stay green."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from known_programs import arc, box, feed, program, rapid, tool
from pydantic import ValidationError

from cuspline.app.catalogue import find_machine
from cuspline.design import DEFAULT_MACHINE
from cuspline.program.program import Kind, Plane
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.replay import replay
from cuspline.replay.replay_doubts import cleared, stands_below
from cuspline.replay.replay_kernel import HOLDER
from cuspline.replay.replay_stock import CELL_MM, DEEP_MM, DEPTH_MM, SHARE
from cuspline.replay.scene import HOLDER_CLEARANCE_MM, FinishedDesign, Fixture, FoundStock, Surroundings, ZMap
from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.shop.machines import Machine
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame

LOW, HIGH = (-20.0, -10.0, -20.0), (20.0, 10.0, 0.0)
FIN = 0.2, 0.25           # nodes stand every 0.5 mm


STOCK = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=0.5)


def run(moves, tools, start=(-60, 0, 50), numbers=None, stock=STOCK, design=None, design_error_mm=0.0, **around):
    """`design`: its ClearanceTree."""
    changes = {} if numbers is None else {"tool": numbers}
    return replay(program(start, moves, **changes), tools, stock, around=Surroundings(**around),
                  design=FinishedDesign(tree=design, error_mm=design_error_mm))


def kinds(result):
    return [f.kind for f in result.findings]


def slim(number=2, stick_out=6.0, holder=6.0):
    """A cutter of 2 mm in a holder of 6 mm, 6 mm above its tip."""
    t = tool("flat", 2, number=number, stick_out=stick_out, flute=4.0)
    segments = (HolderSegment(height_mm=40.0, lower_diameter_mm=holder, upper_diameter_mm=holder),)
    return t.model_copy(update={"holder": Holder(name="slim", segments=segments)})


def halves(fin):
    """All stock down to -8 but a fin between two x; flat cutter of 10 mm."""
    moves = []
    for x in (fin[0] - 5, fin[0] - 13, fin[0] - 20, fin[1] + 5, fin[1] + 13, fin[1] + 20):
        moves += [rapid(x, -30, 5), feed(x, -30, -8), feed(x, 30, -8), rapid(x, 30, 5)]
    return moves


TOOLS = {1: tool("flat", 10, stick_out=60.0), 2: slim()}


@pytest.mark.parametrize("fin,wanted", [(FIN, ["rapid_through_stock"]), ((0.2, 0.15), [])], ids=["fin", "no fin"])
def test_a_rapid_through_a_thin_fin_of_stock_is_found(fin, wanted):
    result = run([*halves(fin), rapid(-14, 0, 5), rapid(-14, 0, -4), rapid(14, 0, -4), rapid(14, 0, 5)], TOOLS)
    assert kinds(result) == wanted and result.undecided_lines == ()
    if wanted:
        found = result.findings[0]
        assert abs(found.amount_mm - 4.0) < 1e-6 and found.line == 36 and fin[0] <= found.place_mm[0] <= fin[1]


@pytest.mark.parametrize("fin,wanted", [(FIN, ["holder_contact"]), ((0.2, 0.15), [])], ids=["fin", "no fin"])
def test_a_holder_over_a_thin_fin_of_stock_is_found(fin, wanted):
    """The slim cutter runs at x = 2 beside the fin, 6 mm below its holder's nose: the nose is at -2."""
    moves = [*halves(fin), rapid(2, -30, 5), rapid(2, -30, -8), feed(2, 30, -8)]
    numbers = [1] * (len(moves) - 3) + [2] * 3
    result = run(moves, TOOLS, numbers=numbers)
    assert kinds(result) == wanted
    if wanted:
        assert fin[0] <= result.findings[0].place_mm[0] <= fin[1] and result.findings[0].line == len(moves) + 9
        assert abs(result.findings[0].amount_mm - 2.25) < 0.021       # its far side is 1.25 mm inside the nose


def test_a_holder_beside_a_wall_is_cleared_between_the_nodes():
    """The wall of stock at 0.2 stands 1.05 mm beside the holder; the cell that holds it reaches to 0.5."""
    moves = [*halves((0.2, 15.0))[:12], rapid(-4.0, -30, 5), rapid(-4.0, -30, -8), feed(-4.0, 30, -8)]
    holders = {side: run(moves, {1: TOOLS[1], 2: slim(holder=2 * (4.2 - side))}, numbers=[1] * 12 + [2] * 3)
               for side in (1.05, 0.95)}
    assert kinds(holders[1.05]) == [] and holders[1.05].undecided_lines == ()
    assert 1.0 <= holders[1.05].holder_clearance_mm <= 1.05 + 1e-9
    assert kinds(holders[0.95]) == ["holder_contact"] and abs(holders[0.95].findings[0].amount_mm - 0.05) < 0.03


def test_a_fin_below_the_smallest_cell_is_found_or_listed():
    for shift in np.linspace(0, CELL_MM, 7):
        fin = 0.2 + shift, 0.2 + shift + CELL_MM / 4
        result = run([*halves(fin), rapid(-14, 0, 5), rapid(-14, 0, -4), rapid(14, 0, -4)], TOOLS)
        assert kinds(result) == ["clearance_not_proven" if result.undecided_lines == (36,) else "rapid_through_stock"]


def test_order_of_operations_decides_between_nodes_too():
    """The fin is cut away before the rapid, or after it."""
    fin, across = [rapid(0.22, -30, 5), feed(0.22, -30, -8), feed(0.22, 30, -8), rapid(0.22, 30, 5)], \
        [rapid(-14, 0, 5), rapid(-14, 0, -4), rapid(14, 0, -4), rapid(14, 0, 5)]
    assert kinds(run([*halves(FIN), *fin, *across], TOOLS)) == []
    assert kinds(run([*halves(FIN), *across, *fin], TOOLS)) == ["rapid_through_stock"]


@pytest.mark.parametrize("width", [0.05, 0.001])
def test_a_thin_fin_of_the_design_between_nodes_is_found(width):
    fin = ClearanceTree.of_triangles(*box((0.2, -9, -20), (0.2 + width, 9, 3)))
    over = [rapid(-60, 0, 20), feed(-60, 0, -2), feed(60, 0, -2)]
    short, long = tool("ball", 6, stick_out=4.9, flute=4.0), tool("ball", 6, stick_out=30.0)
    assert kinds(run(over, {1: long}, design=fin)) == []
    assert kinds(run(over, {1: short}, design=fin))[-1] == "holder_contact"


def test_a_holder_too_long_in_the_middle_of_a_move_only():
    """Over a pillar of the design 3 mm high; the ends of the move stand 60 mm beside it; 0.3 mm are missing."""
    pillar = ClearanceTree.of_triangles(*box((-1, 14, -20), (1, 16, 3)))
    over = [rapid(-60, 0, 20), rapid(-60, 0, 0.5), feed(60, 0, 0.5)]
    good = run(over, {1: tool("ball", 6, stick_out=3.51, flute=3.0)}, design=pillar)
    bad = run(over, {1: tool("ball", 6, stick_out=3.2, flute=3.0)}, design=pillar)
    assert kinds(good) == [] and 1.009 - 2e-3 < good.holder_clearance_mm <= 1.01 + 1e-9
    found = bad.findings[0]
    assert kinds(bad) == ["holder_contact"] and abs(found.amount_mm - 0.3) < 1.1e-3 and found.line == 12
    assert -1 <= found.place_mm[0] <= 1 and found.advice


@pytest.mark.parametrize("missing", [0.04, 0.3, 2.5, 5.5])
def test_deep_contacts_are_told_within_a_share_and_small_ones_exactly(missing):
    """A wide holder over a thin pillar of the design: it is as deep in as it is too low, until its side is nearer."""
    pillar = ClearanceTree.of_triangles(*box((-1, 14, -20), (1, 16, 20)))
    over = [rapid(-60, 0, 30), rapid(-60, 0, 0.5), feed(60, 0, 0.5)]
    found = run(over, {1: tool("ball", 6, stick_out=19.5 - missing, flute=3.0)}, design=pillar,
                shank_clearance_mm=-50.0).findings
    amount = max(f.amount_mm for f in found if f.kind == "holder_contact") - HOLDER_CLEARANCE_MM
    assert missing - max(1e-3, SHARE * (missing + HOLDER_CLEARANCE_MM)) <= amount <= missing + 1e-9
    assert missing > DEEP_MM or amount >= missing - 1e-3


@pytest.mark.parametrize("top,share", [(2.97, 0.0), (6.0, SHARE)])
def test_a_move_in_pieces_is_told_as_the_same_moves_one_by_one(top, share):
    """A half circle past three pillars of the design, the second 0.02, the third 1 mm higher; over a ramp of stock."""
    posts = [box((x - 1, 19, -20), (x + 1, 21, top + more))[0] for x, more in ((-12, 0.0), (0, 0.02), (12, 1.0))]
    triangles = np.vstack([np.array(box((0, 0, 0), (1, 1, 1))[1]) + 8 * k for k in range(3)])
    design, ramp = ClearanceTree.of_triangles(np.vstack(posts), triangles), np.linspace(-3, 0, 81) + np.zeros((41, 1))
    tools, angles = {1: tool("flat", 6, stick_out=3.5, flute=3.0)}, np.linspace(np.pi, 0, 181)
    for z, options in ((0.0, {"design": design}), (-top, {"stock": replace(STOCK, top_mm=ramp)})):
        turn = np.column_stack([20 * np.cos(angles), 20 * np.sin(angles), np.full(181, z)]).round(12)
        amounts = []
        for ends in (turn[-1:], turn[1:]):
            moves = [rapid(*turn[0]), *(arc(tuple(end), (0, 0, z), Plane.XY, clockwise=True) for end in ends)]
            found = run(moves, tools, shank_clearance_mm=-50.0, **options).findings
            amounts.append(max(f.amount_mm for f in found if f.kind == "holder_contact"))
        assert amounts[0] == pytest.approx(amounts[1], rel=share, abs=1e-3 if "design" in options else DEPTH_MM)


def test_deviation_of_the_design_is_no_contact():
    wall = ClearanceTree.of_triangles(*box((3.0, -9, -40), (5, 9, 30)))
    beside = [rapid(0.004, -60, 20), rapid(0.004, -60, 1), feed(0.004, 60, 1)]
    straight = {1: tool("flat", 6, neck=6.0, flute=4.0, stick_out=80.0)}
    assert kinds(run(beside, straight, design=wall, design_error_mm=0.005)) == []
    assert kinds(run(beside, straight, design=wall, design_error_mm=0.002)) == ["shank_contact"]


def test_a_straight_shank_may_slide_along_the_walls_it_has_cut():
    """Slots and an arc, level by level, deeper than the flutes are long; the shank is as wide as the cutter."""
    moves = [rapid(-30, 0.2, 5)]
    for z in (-3.5, -7, -10.5):
        moves += [rapid(-30, 0.2, z), feed(0, 0.2, z), arc((10, 10.2, z), (0, 10.2, z), Plane.XY),
                  feed(10, 30, z), rapid(10, 30, 5), rapid(-30, 0.2, 5)]
    result = run(moves, {1: tool("flat", 6, neck=6.0, flute=4.0, stick_out=60.0)})
    assert kinds(result) == [] and result.undecided_lines == ()
    wide = run(moves, {1: tool("flat", 6, neck=6.0, flute=3.0, stick_out=60.0)})
    assert kinds(wide) == ["shank_contact"] * len(wide.findings) and wide.findings


def test_retraced_and_lifted_rapids_are_no_contact():
    dome = [rapid(-15, 0, 5), feed(-15, 0, -3), arc((15, 0, -3), (0, 0, -40.0), Plane.ZX)]
    hollow = [rapid(-9, 2, 5), feed(-9, 2, -3), arc((9, 2, -3), (0, 2, 20.0), Plane.ZX, clockwise=True), rapid(9, 2, 5)]
    slope = [rapid(-30, 5, 5), feed(-30, 5, -3), feed(15, 5, -6.3), rapid(-30, 5, -3), rapid(-30, 5, 5)]
    for cutter in (tool("ball", 6), tool("bull_nose", 6, 1.0), tool("flat", 6)):
        result = run([*dome, rapid(15, 0, 5), *hollow, *slope], {1: cutter})
        assert kinds(result) == [] and result.undecided_lines == ()


def ringed_bore(left_mm, levels):
    """A bore of 10 mm, 10 deep, bored but for a ring on its wall by a flat cutter of 6, then once round at each level."""
    around = lambda r, z, fall=0.0: [arc((-r, 0, z - fall / 2), (0, 0, 0), Plane.XY), arc((r, 0, z - fall), (0, 0, 0), Plane.XY)]
    near, wall = 2.0 - left_mm, 2.0
    moves = [rapid(near, 0, 5), feed(near, 0, 0), *(m for k in range(10) for m in around(near, -k, 1.0)), *around(near, -10)]
    for z in levels:
        moves += [feed(0, 0, moves[-1][1][2]), rapid(0, 0, 5), feed(0, 0, z), arc((wall, 0, z), (1.0, 0, 0), Plane.XY),
                  *around(wall, z)]
    return moves


@pytest.mark.parametrize("neck, left, wanted", [(5.8, 0.3, 0.2), (5.7, 0.3, 0.15), (5.7, 0.1, None), (5.2, 0.3, None)])
def test_a_thinner_neck_meets_what_its_flutes_are_too_short_to_take(neck, left, wanted):
    """The flutes of 4 mm at 10 mm: their shadow in the height field takes the ring above them, they do not.  In the arcs'
    pieces, in chords, and along a wall; down by levels nothing is met."""
    cutter = {1: tool("flat", 6, neck=neck, flute=4.0, stick_out=60.0)}
    at_once = ringed_bore(left, [-10.0])
    turned = np.linspace(0.0, 2 * np.pi, 91)[1:]
    wall = [rapid(-30, 13 - left, 5), feed(-30, 13 - left, -10)]
    long, short = ([*wall, *(feed(x, 13 - left, -10) for x in ends)] for ends in ([30.0], np.arange(-29.9, 30.0, 0.1)))
    for moves in (at_once, at_once[:-2] + [feed(2 * np.cos(a), 2 * np.sin(a), -10) for a in turned], long, short):
        found = run(moves, cutter).findings
        assert {f.kind for f in found} == ({"shank_contact"} if wanted else set())
        assert not wanted or max(f.amount_mm for f in found) == pytest.approx(wanted, rel=0.05)
    by_levels = ringed_bore(left, [-3.5, -7.0, -10.0])
    assert kinds(run(by_levels, cutter)) == []


def test_a_shank_retraces_a_slot_over_other_corner_points():
    """The lower pass has other points on the same way; 0.0005 mm aside its shank rubs, 0.005 mm aside it touches."""
    upper = [rapid(-30, 1, 5), feed(-30, 1, -4.5), feed(-5, 1, -4.5), feed(25, 11, -4.5), rapid(25, 11, 5),
             rapid(-30, 1, 5)]
    for aside, wanted in ((0.0, []), (0.0005, []), (0.005, ["shank_contact"])):
        x = np.array([-30, -20, -5, 4, 25])
        lower = [feed(a, 1 + aside + max(0, a + 5) / 3, -9.0) for a in x]
        back = [feed(a, 1 + aside + max(0, a + 5) / 3, -9.0) for a in (10, -5, -11, -30)]
        result = run([*upper, *lower, *back], {1: tool("flat", 6, neck=6.0, flute=5.0, stick_out=60.0)})
        assert kinds(result)[:1] == wanted and (wanted or result.undecided_lines == ())


def test_a_small_holder_in_a_wider_slot_still_keeps_its_distance():
    """Floor at -8 in a slot of 10 mm; the slim holder of 6 mm runs in it 0.6 mm above the floor."""
    slot = [rapid(-30, 0.2, 5), feed(-30, 0.2, -8), feed(30, 0.2, -8), rapid(30, 0.2, 5)]
    deeper = [rapid(-30, 0.2, 5), rapid(-30, 0.2, -13.4), feed(30, 0.2, -13.4)]
    found = run([*slot, *deeper], TOOLS, numbers=[1] * 4 + [2] * 3).findings
    assert {f.kind: f.amount_mm for f in found}["holder_contact"] == pytest.approx(0.4, abs=1e-3)


def test_a_fixture_between_the_points_of_an_arc_is_found():
    """A half circle of radius 25 over y = 25; a thin post stands at its top."""
    moves = [rapid(-25, 0, 5), arc((25, 0, 5), (0, 0, 5), Plane.XY, clockwise=True)]
    post = {y: [Fixture(name="post", min_mm=(-0.1, y, -20), max_mm=(0.1, y + 0.1, 30))] for y in (27.9, 28.1)}
    assert kinds(run(moves, {1: tool("flat", 6, stick_out=60.0)}, fixtures=post[28.1])) == []
    found = run(moves, {1: tool("flat", 6, stick_out=60.0)}, fixtures=post[27.9]).findings
    assert [f.kind for f in found] == ["fixture_contact"] and abs(found[0].amount_mm - 0.1) < 1e-3


def machine(table, head=()):
    axis = SimpleNamespace(min_mm=-500.0, max_mm=500.0)
    return SimpleNamespace(axes=(axis,) * 3, table_z_mm=table, rapid_clearance_mm=0.0, spindle_head=head)


def test_the_table_is_met_by_the_lowest_tip():
    """The spindle nose stands the tool's length, 60 + 50 mm, above the tip."""
    moves = [rapid(-30, 0, 5), feed(-30, 0, -3), feed(30, 0, -3), rapid(30, 0, 5)]
    nose = {"machine_end_mm": np.array([m[1] for m in moves]) + [0, 0, 110.0]}
    posted = program((-30, 0, 50), moves, **nose)
    tools = {1: tool("flat", 6, stick_out=60.0)}
    assert kinds(replay(posted, tools, STOCK, around=Surroundings(machine=machine(-3.0)))) == []
    low = replay(posted, tools, STOCK, around=Surroundings(machine=machine(-2.8)))
    assert kinds(low) == ["fixture_contact"] and abs(low.findings[0].amount_mm - 0.2) < 1e-9 and low.is_table_checked
    assert not replay(posted, tools, STOCK).is_table_checked


def test_a_spindle_head_wider_than_the_holder_is_held_against_fixtures():
    wall = [Fixture(name="wall", min_mm=(-30, 45, -20), max_mm=(30, 60, 110))]
    moves = [rapid(-30, 0, 5), feed(-30, 0, -3), feed(30, 0, -3), rapid(30, 0, 5)]
    tools = {1: tool("flat", 6, stick_out=60.0)}
    assert kinds(run(moves, tools, fixtures=wall, machine=machine(-500.0))) == []
    assert kinds(run(moves, tools, fixtures=wall, machine=machine(-500.0, ((80.0, 100.0),)))) == ["fixture_contact"]


def test_a_machine_states_its_spindle_head():
    plain = find_machine(DEFAULT_MACHINE)
    given = {**plain.model_dump(), "spindle_head": [[80.0, 160.0]]}
    assert plain.spindle_head == () and Machine.model_validate(given).spindle_head == ((80.0, 160.0),)
    with pytest.raises(ValidationError, match="above 0"):
        Machine.model_validate({**given, "spindle_head": [[80.0, 0.0]]})


def test_proven_clearance_does_not_depend_on_the_pitch():
    """A slot with sloping bottom under a holder: the coarse map proves nearly what the fine one attains."""
    moves = [rapid(-30, 0.3, 5), feed(-30, 0.3, -3), feed(30, 0.3, -12)]
    tools = {1: tool("ball", 6, stick_out=14.0, flute=12.0)}
    found = [replay(program((-30, 0, 50), moves), tools, replace(STOCK, pitch_mm=pitch)) for pitch in (0.1, 0.37, 1.3)]
    clearance = [r.holder_clearance_mm for r in found]
    assert max(clearance) - min(clearance) < 0.02 and all(kinds(r) == [] for r in found)


def test_a_step_left_by_an_earlier_clamping_is_no_contact_that_is_sure():
    """Stock 8 mm lower from x = 0.5 on; where the step stands between the nodes at 0 and 0.5 nobody knows."""
    top = np.zeros((41, 81))
    top[:, 41:] = -8.0
    before = replace(STOCK, top_mm=top, within_mm=lambda xy, radius: np.where(xy[:, 0] < 0.3 + radius, 0.0, -8.0))
    down = lambda x: [rapid(x, 0, 5), rapid(x, 0, -4), rapid(x, 0, 5)]
    slot = {1: TOOLS[1]}
    assert kinds(run(down(5.6), slot, stock=before)) == []
    assert kinds(run(down(4.9), slot, stock=before)) == ["rapid_through_stock"]
    between = run(down(5.2), slot, stock=before)
    assert kinds(between) == ["clearance_not_proven"] and between.undecided_lines == (11,)
    known = replace(before, within_before=lambda row: before.within_mm)
    assert kinds(run(down(5.35), slot, stock=before)) == ["clearance_not_proven"]
    assert kinds(run(down(5.35), slot, stock=known)) == []
    assert kinds(run(down(5.29), slot, stock=known)) == ["clearance_not_proven"]


def test_a_way_is_clear_where_all_stock_beside_it_stands_below():
    """Stock to 0, higher in a disc of 2 mm round (3, 4); brute force over a fine grid says the same."""
    stock = FoundStock(min_mm=(-10.0, -10.0, -5.0), max_mm=(10.0, 10.0, 3.0), pitch_mm=0.5)
    within = lambda xy, radius: np.where(np.hypot(*(xy - (3.0, 4.0)).T) <= 2.0 + radius, 3.0, 0.0)
    grid = np.stack(np.meshgrid(*[np.linspace(-10, 10, 401)] * 2), axis=-1).reshape(-1, 2)
    rng, found = np.random.default_rng(6), []
    for _ in range(60):
        ends, radius = rng.uniform(-14, 14, (2, 2)), rng.uniform(0.5, 4.0)
        way = ends[1] - ends[0]
        share = np.clip((grid - ends[0]) @ way / (way @ way), 0, 1)
        near = np.linalg.norm(grid - ends[0] - share[:, None] * way, axis=1)
        found.append((stands_below(ends[None], np.array([1.0]), radius, within, stock),
                      within(grid[near <= radius + 0.05], 0.0).max(initial=0.0) < 1.0,
                      within(grid[near <= radius - 0.05], 0.0).max(initial=0.0) < 1.0))
        assert not stands_below(ends[None], np.array([-0.5]), radius, within, stock) or not (near <= radius - 0.05).any()
    assert all(surely <= clear for clear, surely, _ in found) and all(clear <= maybe for clear, _, maybe in found)
    assert 10 < sum(clear for clear, _, _ in found) < 50


def test_ways_asked_together_are_clear_if_each_of_them_is():
    """Random ways at random heights over a disc that stands higher: together they say what they say one by one."""
    stock = FoundStock(min_mm=(-10.0, -10.0, -5.0), max_mm=(10.0, 10.0, 3.0), pitch_mm=0.5)
    within = lambda xy, radius: np.where(np.hypot(*(xy - (3.0, 4.0)).T) <= 2.0 + radius, 3.0, 0.0)
    rng, found = np.random.default_rng(8), []
    for _ in range(60):
        ways, floors = rng.uniform(-14, 14, (3, 1, 2)) + rng.normal(0, 3, (3, 2, 2)), rng.choice([1.0, 1.0, 4.0], 3)
        alone = [stands_below(ways[k:k + 1], floors[k:k + 1], 4.0, within, stock) for k in range(3)]
        found.append((stands_below(ways, floors, 4.0, within, stock), all(alone)))
    assert all(together == alone for together, alone in found) and 10 < sum(alone for _, alone in found) < 50


@pytest.mark.parametrize("fin,wanted", [(FIN, ["clearance_not_proven"]), ((0.4, 0.0), [])], ids=["fin", "no fin"])
def test_a_fin_that_an_earlier_clamping_leaves_between_the_nodes_is_not_overlooked(fin, wanted):
    here = Frame.shift((0.0, 0.0, 0.0))
    piece = Workpiece(blank=BoxShape(min_mm=LOW, max_mm=HIGH)).after(here, swept_paths(program((-60, 0, 50), halves(fin)), TOOLS))
    nodes = ZMap.over(LOW, HIGH, 0.5)
    heights = piece.heights_mm(here, nodes.xy_mm).reshape(nodes.ny, nodes.nx)
    assert heights.max() < -7.9 or fin != FIN             # no node shows it
    across = [rapid(-14, 0, 5), rapid(-14, 0, -4), rapid(14, 0, -4), rapid(14, 0, 5)]
    within = lambda xy, radius: piece.highest_within_mm(here, xy, radius)
    before = replace(STOCK, top_mm=heights, within_mm=within)
    assert kinds(run(across, TOOLS, stock=before)) == wanted
    assert kinds(run(across, TOOLS, stock=replace(before, within_before=lambda row: within))) == wanted


def test_clearance_over_a_floor_is_the_gap_to_the_floor():
    """The whole top is milled to -2 first; then the nose of the slim holder runs 1.5 mm above it."""
    moves = [m for y in np.arange(-15, 16, 5.0)
             for m in (rapid(-60, y, 5), feed(-60, y, -2), feed(60, y, -2), rapid(60, y, 5))]
    moves += [rapid(-60, 0.3, 5), rapid(-60, 0.3, -6.5), feed(60, 0.3, -6.5)]
    result = run(moves, {1: TOOLS[1], 2: slim()}, numbers=[1] * (len(moves) - 3) + [2] * 3)
    assert kinds(result) == ["shank_contact"] and abs(result.findings[0].amount_mm - 0.5) < 1e-9
    assert abs(result.holder_clearance_mm - 1.5) < 1e-9


def test_a_slim_extension_beside_a_wall_is_looked_at_as_the_cone_that_it_is():
    """14 mm at its nose, 22.4 mm 80 mm higher: of a wall 9 mm off it is clear if that ends 5 mm above the nose, not 40."""
    posted = SimpleNamespace(kind=np.array([Kind.FEED]), start_mm=np.zeros((1, 3)), end_mm=np.array([[4.0, 0.0, 0.0]]))
    nose = 40.0
    script = None, np.array([0]), np.array([0]), None, None, [[nose, 7.0, nose + 80.0, 11.2, 0.0]], [(0, HOLDER)]

    def is_clear(top_mm):
        wall = lambda xy, within: np.where(np.abs(xy[:, 1]) + within > 9.0, top_mm, -np.inf)
        stock = SimpleNamespace(min_mm=np.array([-20.0, -20.0, 0.0]), max_mm=np.array([20.0, 20.0, top_mm]),
                                within_before=lambda row: wall)
        return cleared([0], posted, script, (0.0, 0.0, 1.0), stock) == [0]

    assert is_clear(nose + 5.0) and not is_clear(nose + 40.0)
    bare = 80.0 / 4.2 - 1.0         # above the nose: there it is 8 mm wide, a millimetre higher than the wall's top may be
    assert is_clear(nose + bare - 0.6) and not is_clear(nose + bare + 0.1)
