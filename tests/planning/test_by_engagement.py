"""Constant cutting speed and feeds by engagement, on three grooves and a step: planned, posted, read back, looked at again."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from known_programs import tool

from cuspline.app import catalogue
from cuspline.app.judge import posted_moves
from cuspline.design import Setup, StockBox
from cuspline.planning.by_engagement import follows_engagement, met_by, process_words
from cuspline.planning.context import PlannedOperation, Wishes
from cuspline.planning.feeds import times_s
from cuspline.process.cut_of_operations import cuts_of_operations
from cuspline.process.cutting_speed import contact_radius_mm, effective_radius_mm, rpm_for_speed, spindle_speeds
from cuspline.process.engagement import engagement
from cuspline.program.program import Kind, MoveWriter, Operation, Program
from cuspline.replay.scene import FoundStock
from cuspline.shop.materials import known_materials
from cuspline.shop.practice import Practice, ShopFile
from cuspline.stock.workpiece import Workpiece
from cuspline.verification.in_process import PART

MACHINE = catalogue.find_machine("mill_3axis")
BOX = (-30.0, -30.0, -20.0), (30.0, 30.0, 0.0)
SPEED, FEED = 150.0, 600.0
DEPTHS = 1.0, 5 * (1 - np.sqrt(0.5)), 5.0           # to a radius of 3, 3.5355 and 5 mm
WANTED = 7958, 6752, 4775


@dataclass(frozen=True, eq=False)
class Plan:
    """As much of a SetupPlan as speeds and feeds need."""

    context: object
    operations: tuple


def grooves(feed=FEED, layers=DEPTHS, apart=12.0):
    """Moves of a ball of 10 mm: a groove along x for every depth."""
    w = MoveWriter((-40, -apart, 20))
    for k, depth in enumerate(layers):
        y = (k - 1) * apart
        w.rapid((-40, y, 20))
        w.feed((-40, y, -depth), 0.3 * feed)
        w.feed((40, y, -depth), feed)
        w.rapid((40, y, 20))
    return w.moves()


def planned(moves, has_speed=False, has_feed=False, rpm=4775.0, cutter=None, asked=None, machine=MACHINE, **practice):
    """A plan of one operation that wishes so, of a ball unless another tool is given."""
    wishes = Wishes(feed_mm_per_min=moves.feed_mm_per_min if asked is None else asked, speed_m_per_min=SPEED,
                    is_speed_constant=has_speed, is_fed_by_engagement=has_feed)
    operation = PlannedOperation(name="cut", tool=cutter or tool("ball", 10), rpm=rpm, coolant="off", moves=moves, wishes=wishes,
                                 facts={"time_s": round(float(times_s(moves, machine).sum()), 1)})
    context = SimpleNamespace(machine=machine, practice=Practice(**practice), shop=ShopFile(),
                              design=SimpleNamespace(material="aluminium_6061"), setup=SimpleNamespace(turn=PART),
                              piece=Workpiece(blank=StockBox(min_mm=BOX[0], max_mm=BOX[1]).shape))
    return Plan(context=context, operations=(operation,))


def read_back(plan, machine=MACHINE):
    """(text, PostedMoves) of the plan's operation."""
    o, = plan.operations
    program = Program(name="grooves", setup="setup-1", wcs="G54", wcs_in_words="", clearance_z_mm=20.0, header=(), operations=(
        Operation(name=o.name, tool=o.tool, spindle_rpm=o.rpm, coolant="off", moves=o.moves, rpm_changes=o.rpm_changes),))
    text = catalogue.find_post(machine.control.post).post(program, machine).text
    setup = Setup(name="setup-1", faces=("all",), wcs_in_words="corner")
    return text, posted_moves([text], setup, machine, {1: o.tool})


@pytest.fixture(scope="module")
def constant():
    return follows_engagement(planned(grooves(), has_speed=True))


def test_speeds_are_the_check_numbers():
    spindle = MACHINE.spindle
    radii = [effective_radius_mm(5.0, 1.0), contact_radius_mm(5.0, np.pi / 4), 5.0]
    assert [round(float(rpm_for_speed(SPEED, r, spindle))) for r in radii] == list(WANTED)


@pytest.mark.parametrize("name", ["mill_3axis", "mill_heidenhain", "mill_siemens", "mill_fanuc", "mill_haas", "mill_grbl",
                                  "mill_pmac"])
def test_posted_words_follow_the_radius_in_the_cut(constant, name):
    """The speed at the largest radius in the cut, as read back and as a spindle comes to it, is within 5 % of what was asked."""
    machine = catalogue.find_machine(name)
    _, posted = read_back(constant, machine)
    inside = (posted.kind == Kind.FEED) & (posted.start_mm[:, 0] < 0) & (posted.end_mm[:, 0] > 0)
    assert posted.spindle_rpm[inside] == pytest.approx(WANTED, rel=0.035)
    if name == "mill_3axis":
        met = engagement(posted, {1: tool("ball", 10)}, FoundStock(min_mm=BOX[0], max_mm=BOX[1], pitch_mm=1.0))
        cut, = cuts_of_operations(posted, {1: tool("ball", 10)}, met, 1000.0)
        assert cut.speeds_m_per_min[1:] == pytest.approx([SPEED] * 2, rel=0.05)


def test_blocks_are_no_more_than_twice_as_many(constant):
    plain, _ = read_back(planned(grooves()))
    text, _ = read_back(constant)
    assert len(text.splitlines()) <= 2 * len(plain.splitlines())
    said = constant.operations[0].facts["process"]["cutting_speed"]
    assert said["speed_m_per_min"] == SPEED and "assumed" in said and said["changes"] >= 2


def test_a_spindle_is_asked_for_no_more_than_it_follows():
    wanted = np.repeat([2000.0, 8000.0, 2000.0], 20)
    rpm = spindle_speeds(wanted, np.full(60, 0.1), 1000.0)
    assert rpm.max() < 8000 and (rpm <= wanted * 1.03).all()
    assert spindle_speeds(wanted, np.full(60, 10.0), 1000.0).max() == 8000
    assert (np.diff(spindle_speeds(np.r_[wanted[:1], np.full(5, np.nan), wanted[:1]], np.ones(7), 1.0)) == 0).all()


def test_a_groove_is_fed_half_as_fast_and_a_thin_cut_faster_within_the_limit():
    flat = tool("flat", 10)
    w = MoveWriter((-40, 0, 20))
    for y in (0.0, 0.2):                                                # a groove, then 0.2 mm off its side
        w.rapid((-40, y, 20))
        w.feed((-40, y, -1), FEED)
        w.feed((40, y, -1), FEED)
        w.rapid((40, y, 20))
    plan = follows_engagement(planned(w.moves(), has_feed=True, cutter=flat))
    _, posted = read_back(plan)
    inner = (posted.kind == Kind.FEED) & (posted.start_mm[:, 0] < 0) & (posted.end_mm[:, 0] > 0)
    in_groove = inner & (posted.end_mm[:, 1] < 0.1)
    assert set(posted.feed_mm_per_min[in_groove]) <= {279.0, 307.0} and in_groove.any()         # a step of 1.1 below 300
    thin = posted.feed_mm_per_min[inner & (posted.end_mm[:, 1] > 0.1)]
    assert thin.max() == np.floor(FEED * 1.1 ** 4) and thin.max() <= 1.5 * FEED
    said = plan.operations[0].facts["process"]
    assert said["saved_s"] == pytest.approx(said["time_before_s"] - plan.operations[0].facts["time_s"], abs=0.11)
    assert said["feed"]["share_slower"] > 0.2 and said["feed"]["share_faster"] > 0.2


def test_a_spindle_that_stands_little_is_fed_less():
    weak = MACHINE.model_copy(update={"spindle": MACHINE.spindle.model_copy(update={"torque_n_m": 0.12})})
    free, held = (follows_engagement(planned(grooves(layers=(4.0,)), has_feed=True, machine=m)).operations[0]
                  for m in (MACHINE, weak))
    inside = lambda o: o.moves.feed_mm_per_min[(o.moves.kind == Kind.FEED) & (o.moves.starts_mm[:, 0] < 0)
                                               & (o.moves.end_mm[:, 0] > 0)]
    assert inside(held).max() < inside(free).max()


def test_what_cannot_follow_says_why_and_what_wishes_nothing_stays():
    plan = planned(grooves())
    assert follows_engagement(plan).operations[0].moves.feed_mm_per_min.tolist() == grooves().feed_mm_per_min.tolist()
    drill = planned(grooves(), has_speed=True, cutter=tool("ball", 10).model_copy(update={"head": object()}))
    said = process_words(follows_engagement(drill).operations[0], None)["process"]
    assert said["cutting_speed"] == "not used: what its tool meets is not known" and said["feed"].startswith("not used: neither")
    row, = met_by(plan)
    words = process_words(plan.operations[0], row.as_dict())["process"]
    assert words["tip_share"] > 0.5 and "in the cut on" in words["tip"]


def test_coolant_in_hardened_steel_is_advised_against():
    operation, hard = planned(grooves()).operations[0], known_materials()["steel_h13_48hrc"]
    wet = replace(operation, coolant="flood")
    assert "chip" in process_words(wet, None, hard)["process"]["advice"]
    assert "advice" not in process_words(operation, None, hard)["process"]
    assert "advice" not in process_words(wet, None, known_materials()["aluminium_6061"])["process"]


# leaning tools -----------------------------------------------------------------------------------


TRUNNION = catalogue.find_machine("mill_trunnion_ac")
LEAN_RAD = np.radians(25.0)


def leaning_grooves(layers=(1.0, 3.0), parts=20):
    """Moves of a ball of 10 mm that leans by 25 degrees along x: a groove for every depth, in short blocks."""
    axis = np.array([np.sin(LEAN_RAD), 0.0, np.cos(LEAN_RAD)])
    tip = lambda x, y, depth: (np.array([x, y, 5.0 - depth]) - 5.0 * axis)             # the ball's lowest place at the depth
    w = MoveWriter(tip(-40, -12, -20))
    for k, depth in enumerate(layers):
        w.rapid(tip(-40, 14 * k - 12, -20))
        w.feed(tip(-40, 14 * k - 12, depth), 0.3 * FEED)
        for x in np.linspace(-40, 40, parts + 1)[1:]:
            w.feed(tip(x, 14 * k - 12, depth), FEED)
        w.rapid(tip(40, 14 * k - 12, -20))
    return replace(w.moves(), axis=np.tile(axis, (len(w), 1)))


def inside(moves, y):
    return (moves.kind == Kind.FEED) & (np.abs(moves.starts_mm[:, 0]) < 25) & (np.abs(moves.end_mm[:, 0]) < 25) & (
        np.abs(moves.end_mm[:, 1] - y) < 1)


def test_a_leaning_ball_keeps_its_cutting_speed_too():
    """Its edge cuts up to where the surface of the stock meets it: at 25 degrees plus the angle of the cut's end."""
    depths = np.array([1.0, 3.0])
    o, = follows_engagement(planned(leaning_grooves(depths), has_speed=True, rpm=4775.0, machine=TRUNNION)).operations
    ends = np.arccos(1 - depths / 5.0)                          # of the arc in the cut, from straight down
    radius = 5.0 * np.sin(np.minimum(ends + LEAN_RAD, np.pi / 2))   # on the side to which it leans away
    wanted = SPEED * 1000 / (2 * np.pi * radius)
    rpm = np.repeat([o.rpm, *(rpm for _, rpm in o.rpm_changes)], np.diff([0, *(k for k, _ in o.rpm_changes), len(o.moves)]))
    for y, n in zip((-12, 2), wanted):
        assert rpm[inside(o.moves, y)] == pytest.approx(n, rel=0.05)
    assert len(o.moves) == len(leaning_grooves(depths)) and (o.moves.end_mm == leaning_grooves(depths).end_mm).all()


def test_a_leaning_ball_is_fed_by_what_it_meets():
    full = 2 * np.sqrt(25.0 - 4.0) / 10                         # width of a groove 3 mm deep as a share of the diameter
    o, = follows_engagement(planned(leaning_grooves((0.02, 3.0)), has_feed=True, machine=TRUNNION)).operations
    thin, wide = (o.moves.feed_mm_per_min[inside(o.moves, y)] for y in (-12, 2))
    assert (thin == np.floor(FEED * 1.1 ** 4)).all()
    seen = wide / FEED * full / 0.5                             # steps of 1.1; rings 15 degrees apart miss up to an eighth
    assert (seen > 1 / 1.1).all() and (seen < 1 / 0.87).all()


def test_under_tcpm_feeds_follow_and_the_speed_stays():
    machine = catalogue.find_machine("mill_heidenhain_5axis")
    o, = follows_engagement(planned(leaning_grooves(), has_speed=True, has_feed=True, machine=machine)).operations
    assert not o.rpm_changes and "factor" in o.facts["process"]["feed"]
    assert o.facts["process"]["cutting_speed"].endswith("the speed of the spindle does not change under TCPM")
    o, = follows_engagement(planned(leaning_grooves(), has_speed=True, machine=machine)).operations
    assert "feed" not in o.facts["process"] and o.facts["process"]["cutting_speed"].startswith("not used")
