"""Contacts of tools that lean and turn, in the true order of the moves: against brute force, and in closed form."""

import numpy as np
import pytest
from known_machines import leaning
from known_programs import feed, program, rapid, tool
from known_tilted import machine
from known_tools import TAKES_ALL

from cuspline.program.program import Kind
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.leaning_replay import LEAVING_MM, RUBBING_MM
from cuspline.replay.replay import replay
from cuspline.replay.scene import FinishedDesign, Fixture, FoundStock, SolidFixture, Surroundings
from cuspline.stock.shapes import BoxShape

LOW, HIGH = (0.0, 0.0, 0.0), (16.0, 12.0, 8.0)
STOCK = FoundStock(min_mm=LOW, max_mm=HIGH, pitch_mm=1.0)
SHORT = tool("ball", 6, flute=6.0, neck=5.0, stick_out=24.0)
TOUCHES = {"shank_contact": RUBBING_MM, "holder_contact": 1e-3, "rapid_through_stock": LEAVING_MM}
NO_CLEARANCE = Surroundings(holder_clearance_mm=0.0)


def leaned(start, moves, axes, **changes):
    """PostedMoves whose axes at the ends are `axes` (n + 1, 3)."""
    axes = np.asarray(axes, float)
    return program(start, moves, start_axis=axes[:-1], end_axis=axes[1:], **changes)


def found(posted, a_tool=SHORT, around=NO_CLEARANCE, design=FinishedDesign()):
    result = replay(posted, {1: a_tool}, STOCK, design=design, around=around)
    kinds = {}
    for f in result.findings:
        kinds.setdefault(f.kind, []).append(f)
    return kinds, result


def frustum_distance(r, z, z0, r0, z1, r1):
    """Signed distance in the half plane, by the corners of the polygon: independent of the kernels."""
    corners = np.array([(0.0, z0), (r0, z0), (r1, z1), (0.0, z1)])
    p, worst, near = np.stack([r, z], axis=-1), np.full(r.shape, -np.inf), np.full(r.shape, np.inf)
    for a, b in zip(corners[:-1], corners[1:]):
        e = b - a
        t = np.clip(((p - a) * e).sum(axis=-1) / (e * e).sum(), 0, 1)
        near = np.minimum(near, np.linalg.norm(p - a - t[..., None] * e, axis=-1))
        worst = np.maximum(worst, ((p - a) * (e[1], -e[0])).sum(axis=-1) / np.linalg.norm(e))
    return np.where(worst > 0, near, worst)


def ball_distance(r, z, radius, flutes):
    """Of a ball cutter with flutes so long."""
    sphere, column = np.hypot(r, z - radius) - radius, frustum_distance(r, z, radius, radius, flutes, radius)
    return np.minimum(sphere, column)


def brute_contacts(posted, a_tool, points, steps):
    """{kind: deepest contact}, places and poses sampled: each pose of each move in turn, the stock as it stands then."""
    stands, deepest = np.ones(len(points), bool), {"shank_contact": 0.0, "holder_contact": 0.0, "rapid_through_stock": 0.0}
    frusta = a_tool.non_cutting_frusta()
    for k in range(len(posted)):
        for t in np.linspace(0, 1, steps):
            a, b = posted.start_axis[k], posted.end_axis[k]
            whole = np.arccos(np.clip(a @ b, -1, 1))
            axis = a if whole < 1e-9 else (np.sin((1 - t) * whole) * a + np.sin(t * whole) * b) / np.sin(whole)
            off = points - posted.start_mm[k] - t * (posted.end_mm - posted.start_mm)[k]
            z = off @ axis
            r = np.linalg.norm(off - z[:, None] * axis, axis=1)
            for z0, r0, z1, r1 in frusta:
                kind = "holder_contact" if z0 >= a_tool.stick_out_mm - 1e-9 else "shank_contact"
                depth = -frustum_distance(r, z, z0, r0, z1, r1)[stands]
                deepest[kind] = max(deepest[kind], depth.max(initial=0.0))
            d = ball_distance(r, z, a_tool.cutter.radius_mm, a_tool.cutter.flute_length_mm)
            if posted.kind[k] == Kind.RAPID:
                deepest["rapid_through_stock"] = max(deepest["rapid_through_stock"], (-d[stands]).max(initial=0.0))
            stands &= d > 0
    return deepest


def random_program(seed):
    rng = np.random.default_rng(seed)
    places = rng.uniform((0, 0, 1), (16, 12, 12), (7, 3))
    axes = leaning(rng.uniform(0, 55, 8), rng.uniform(0, 360, 8))
    moves = [(rapid if rng.uniform() < 0.25 else feed)(*p) for p in places]
    return leaned((8.0, 6.0, 25.0), moves, axes)


@pytest.mark.parametrize("seed", (1, 2))
def test_no_contact_that_brute_force_finds_is_missed_and_none_is_made_up(seed):
    posted = random_program(seed)
    kinds, _ = found(posted)
    told = {kind: max(kinds.get(kind, ()), key=lambda f: f.amount_mm, default=None) for kind in TOUCHES}
    points = np.random.default_rng(100 + seed).uniform(LOW, HIGH, (1500, 3))
    sampled = brute_contacts(posted, SHORT, points, 40)
    for kind, touch in TOUCHES.items():
        most = 0.0 if told[kind] is None else told[kind].amount_mm
        assert sampled[kind] <= most + touch, kind
        if most > 0:                                    # the place that is told, seen by brute force
            there = brute_contacts(posted, SHORT, np.array([told[kind].place_mm]), 1000)
            assert there[kind] == pytest.approx(most, abs=0.02) or kind == "rapid_through_stock", kind
            assert there[kind] > 0, kind


def across(z, tilt, count=9):
    """A pass along x at a height, the tool leaning along y by a tilt."""
    x = np.linspace(-5.0, 21.0, count)
    axis = leaning(tilt, 90.0)
    moves = [rapid(-5, 6, 30), rapid(-5, 6, z), *(feed(v, 6, z) for v in x[1:]), rapid(21, 6, 40)]
    return leaned((-5, 6, 40), moves, np.tile(axis, (len(moves) + 1, 1)))


def test_a_neck_over_flutes_that_reach_out_of_the_slot_is_clear_and_one_in_the_slot_is_not():
    """The axis leans by 20 degrees; the neck begins 6 mm along it, and its lower side lies 2.5 sin 20 lower."""
    lowest = lambda z: z + 6.0 * np.cos(np.radians(20)) - 2.5 * np.sin(np.radians(20))
    assert lowest(3.4) > 8.0 > lowest(3.0)
    assert set(found(across(3.4, 20.0))[0]) == set() and set(found(across(3.0, 20.0))[0]) == {"shank_contact"}


def test_where_the_neck_meets_stock_first_is_told_by_line_and_how_deep():
    """The axis turns toward the stock in one block of a pass beside it: by how much is known at the place that is told."""
    tilts = [0.0, 0.0, 0.0, -40.0, 0.0, 0.0]
    axes = np.vstack([leaning(abs(t), 90.0 if t >= 0 else 270.0) for t in tilts])
    moves = [rapid(8, 15.2, 4), feed(9, 15.2, 4), feed(10, 15.2, 4), feed(11, 15.2, 4), feed(12, 15.2, 4)]
    posted = leaned((8, 15.2, 40), moves, axes)
    kinds, _ = found(posted)
    assert [f.line in (12, 13) for f in kinds["shank_contact"]] == [True]        # it is reached by the one, left by the other
    place = np.array([kinds["shank_contact"][0].place_mm])
    deepest = brute_contacts(posted, SHORT, place, 1000)["shank_contact"]
    assert kinds["shank_contact"][0].amount_mm == pytest.approx(deepest, abs=0.01)


def test_a_rapid_may_begin_in_the_cut_but_not_go_through_stock():
    assert set(found(across(3.4, 15.0))[0]) == set()
    axis = leaning(15.0, 90.0)
    bad = leaned((-5, 6, 40), [rapid(-5, 6, 30), rapid(-5, 6, 3.4), rapid(4, 6, 3.4), feed(12, 6, 3.4), feed(21, 6, 3.4),
                               rapid(21, 6, 40)], np.tile(axis, (7, 1)))
    told = found(bad)[0]["rapid_through_stock"]
    assert [f.line for f in told] == [12] and told[0].amount_mm == pytest.approx(3.0, abs=0.1)       # the ball's own radius


def test_a_rapid_closer_over_the_stock_than_the_machine_asks_for_is_told():
    mill = machine("mill_trunnion_ac")
    lowest = 3.0 - 3.0 * np.cos(np.radians(15))                 # of a ball that leans, below its tip
    for gap, missing in ((mill.rapid_clearance_mm - 0.1, 0.1), (mill.rapid_clearance_mm + 0.1, 0.0)):
        z = 8.0 + lowest + gap
        posted = leaned((-9, 6, 40), [rapid(-9, 6, z), rapid(25, 6, z), rapid(25, 6, 40)], np.tile(leaning(15, 90), (4, 1)))
        told = found(posted, around=Surroundings(machine=mill))[0].get("rapid_too_low", ())
        assert [f.line for f in told] == [11] * bool(missing)
        assert sum(f.amount_mm for f in told) == pytest.approx(missing, abs=0.02)


def test_holder_and_fixtures_are_held_against_every_pose_between_blocks():
    """The axis swings over by 50 degrees between two blocks: at neither end is the holder near the clamp."""
    clamp = BoxShape(min_mm=(30.0, 4.0, 0.0), max_mm=(34.0, 8.0, 20.0))
    box = Fixture(name="clamp", min_mm=(30.0, 4.0, 0.0), max_mm=(34.0, 8.0, 20.0))
    swing = leaned((8, 6, 40), [rapid(8, 6, 10), rapid(8, 6, 10.1)], np.vstack([leaning(0, 0), leaning(0, 0), leaning(80, 0)]))
    for fixture in (box, SolidFixture("clamp", *clamp.mesh)):
        kinds, _ = found(swing, around=Surroundings(fixtures=(fixture,)))
        assert [f.line for f in kinds["fixture_contact"]] == [11]


def test_the_holder_is_told_how_much_is_missing_to_the_design():
    top = BoxShape(min_mm=(0, 0, 0), max_mm=(16, 12, 6.0)).mesh
    design = FinishedDesign(tree=ClearanceTree.of_triangles(*top))
    lean = leaning(70.0, 0.0)
    posted = leaned((-21, 6, 60), [rapid(-21, 6, 9.5), feed(-20, 6, 9.5)], np.tile(lean, (3, 1)))
    tip = np.array([-20.0, 6.0, 9.5])
    lowest = tip[2] + 24.0 * np.cos(np.radians(70)) - 20.0 * np.sin(np.radians(70))
    assert lowest < 6.0
    kinds, result = found(posted, around=Surroundings(), design=design)
    assert kinds["holder_contact"] and result.holder_clearance_mm < 1.0


def test_the_heights_in_the_end_are_those_that_the_cutter_leaves():
    _, result = found(across(3.4, 0.0))
    under = result.final_z_mm[6]                                # y = 6
    assert under == pytest.approx(np.full(len(under), 3.4), abs=1e-6)
    leant = found(across(3.4, 15.0))[1]
    middle = 3.4 + 3.0 * np.cos(np.radians(15))                # of the ball; it stands aside by 3 sin 15
    assert leant.final_z_mm[6] == pytest.approx(middle - np.sqrt(9.0 - (3.0 * np.sin(np.radians(15))) ** 2), abs=1e-6)
    assert len(leant.event_row) and (np.diff(leant.event_row) >= 0).all()


def test_an_operation_that_takes_nothing_is_idle():
    once = across(3.4, 15.0)
    twice = leaned((-5, 6, 40), 2 * [rapid(-5, 6, 30), rapid(-5, 6, 3.4), *(feed(x, 6, 3.4) for x in np.linspace(-5, 21, 9)[1:]),
                                     rapid(21, 6, 40)], np.tile(leaning(15.0, 90.0), (23, 1)),
                   operation=np.repeat([0, 1], 11), operations=("first", "again"))
    assert found(once)[1].idle == () and [f.operation for f in found(twice)[1].idle] == ["again"]


def test_a_pass_over_a_single_place_is_seen_to_take_its_few_micrometres():
    """Shorter than the distance of the planes that are looked at, at the end of a long feed down through what is cut."""
    axis = leaning(15.0, 90.0)[0]

    def again(z):
        down = [np.array([8.0, 6.0, z]) + height * axis for height in np.linspace(30, 0, 12)]
        moves = [rapid(-5, 6, 30), rapid(-5, 6, 3.4), feed(21, 6, 3.4), rapid(21, 6, 40), rapid(*down[0]),
                 *(feed(*place) for place in down[1:]), feed(8.3, 6, z)]
        posted = leaned((-5, 6, 40), moves, np.tile(leaning(15.0, 90.0), (len(moves) + 1, 1)),
                        operation=np.repeat([0, 1], [4, len(moves) - 4]), operations=("first", "again"))
        return [f.operation for f in found(posted)[1].idle]

    assert again(3.397) == [] and again(3.4) == ["again"]


def test_chips_heavier_than_the_cutter_takes_are_told():
    """A slot of a ball's full width, 4.6 mm deep: its area over the diameter is known."""
    light, heavy = (tool("ball", 6, flute=6.0, neck=5.0, stick_out=24.0, limits={**TAKES_ALL, "slot_depth_mm": depth})
                    for depth in (4.5, 2.5))
    posted = across(3.4, 15.0)
    assert "overload" not in found(posted, light)[0]
    told = found(posted, heavy)[0]["overload"]
    area = np.pi * 9 / 2 + 6 * (8 - 3.4 - 3 * np.cos(np.radians(15))) / np.cos(np.radians(15))
    assert told[0].amount_mm == pytest.approx(area / 6, rel=0.1)


def between_leaning_passes(z):
    """A leaning pass along x, an upright rapid across the same stock at a height, a feed beside it, a leaning pass again."""
    lean, up = leaning(15.0, 90.0)[0], np.array([0.0, 0, 1])
    passing = lambda y: [rapid(-5, y, 30), rapid(-5, y, 6.5), feed(21, y, 6.5), rapid(21, y, 30)]
    moves = [*passing(2), rapid(21, 6, 30), rapid(21, 6, z), rapid(-5, 6, z), feed(-6, 6, z), rapid(-6, 6, 30), *passing(10)]
    axes = [lean] * 5 + [up] * 5 + [lean] * 4
    return leaned((-5, 2, 40), moves, axes)


def test_an_upright_rapid_between_leaning_passes_is_looked_at_as_finely_as_in_an_upright_program():
    """A hundredth of a millimetre, less than a leaning rapid may begin in the cut by."""
    assert 0.01 < LEAVING_MM
    told = found(between_leaning_passes(7.99))[0]["rapid_through_stock"]
    assert [f.line for f in told] == [16] and told[0].amount_mm == pytest.approx(0.01, abs=1e-6)
    assert set(found(between_leaning_passes(8.001))[0]) == set()


def test_what_leaning_passes_have_cut_is_no_stock_for_the_upright_moves_after_them():
    """The ball leans along its way: two passes leave a slot with upright sides and a ridge, whose height is known."""
    lean, up = leaning(15.0, 0.0)[0], np.array([0.0, 0, 1])
    ridge = 3.4 + 3.0 * np.cos(np.radians(15)) - np.sqrt(9.0 - 0.25 ** 2)
    passing = lambda y: [rapid(-5, y, 30), rapid(-5, y, 3.4), feed(21, y, 3.4), rapid(21, y, 30)]
    moves = [*passing(5.75), *passing(6.25), rapid(24, 6, 30)]
    for gap in (0.005, -0.01):
        back = [rapid(24, 6, ridge + gap), rapid(-8, 6, ridge + gap), feed(-9, 6, ridge + gap), rapid(-9, 6, 30)]
        told = found(leaned((-5, 6, 40), [*moves, *back], [lean] * 9 + [up] * 5))[0]
        assert set(told) == ({"rapid_through_stock"} if gap < 0 else set())
        assert gap > 0 or told["rapid_through_stock"][0].amount_mm == pytest.approx(-gap, abs=1e-3)
