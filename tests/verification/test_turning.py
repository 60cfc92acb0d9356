"""Between two indexed positions: bodies of the machine against its kinematics, and swings that meet stock, fixture or trunnion."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_machines import chain_of, random_joints
from known_tools import tool

from cuspline.app.catalogue import find_machine, reader_of
from cuspline.design import FixtureBox, Setup, StockBox
from cuspline.design.design import clamped
from cuspline.program.positions import by_position
from cuspline.replay.machine_bodies import bodies_at, from_link, into_link, rotary_links
from cuspline.verification.turning import turning_findings

BALL = tool("ball", 6, number=7)
TRUNNION = find_machine("mill_trunnion_ac")


@pytest.mark.parametrize("name, link", [("mill_trunnion_ac", "bed"), ("mill_trunnion_ac", "A"), ("mill_a_on_b", "B")])
def test_points_of_a_link_go_to_the_part_and_back(name, link):
    mill = find_machine(name)
    rng = np.random.default_rng(3)
    points, angles = rng.uniform(-200, 200, (50, 3)), rng.uniform(-2, 2, (50, 2))
    there = from_link(mill, link, angles, points)
    assert np.abs(into_link(mill, link, angles, there) - points).max() < 1e-9
    assert np.abs(there - points).max() > 10


def test_a_point_of_the_bed_is_where_the_kinematics_put_a_tip_that_stands_there():
    """X, Y and Z of this machine move the tool: its tip stands still beside the bed while the rotaries turn the part."""
    chain = chain_of("mill_trunnion_ac")
    joints = random_joints(chain, 50, seed=4)
    tips, _ = chain.forward(joints, 80.0)
    standing = joints[:, :3] - (0.0, 0.0, 80.0)
    assert np.abs(from_link(TRUNNION, "bed", joints[:, 3:], standing) - tips).max() < 1e-9


def test_links_that_a_linear_axis_carries_past_the_part_are_left_out():
    known = {"mill_trunnion_ac": ("C", "A", "bed"), "mill_table_table": ("B", "A"), "mill_head_table": ("C",), "mill_3axis": ()}
    assert {name: rotary_links(find_machine(name)) for name in known} == known


def test_the_table_lies_under_the_part_in_one_position_and_beside_it_in_another():
    held = clamped(positions())
    boxes = {}
    for setup, angle in zip(held, (0.0, -90.0)):
        table = next(b for b in bodies_at(TRUNNION, (0.0, angle) if TRUNNION.rotaries == ("C", "A") else (angle, 0.0), setup.frame,
                                          setup.clamped_frame) if b.name == "table")
        boxes[setup.name] = table.min_mm, table.max_mm
    low, high = boxes["top"]
    assert high[2] == pytest.approx(-40.0) and low[2] == pytest.approx(-80.0)          # 40 mm below the zero, and 40 high
    low, high = boxes["front"]
    assert high[2] == pytest.approx(125.0, abs=0.05) and high[1] == pytest.approx(-40.0)     # stands upright, as high as its radius


def positions(**changes):
    return (Setup(name="top", wcs_in_words="", faces=("a",), **changes),
            Setup(name="front", wcs_in_words="", faces=("a",), wcs_z=(0.0, -1.0, 0.0), indexed=True))


def found(change=lambda text: text, fixtures=(), machine=TRUNNION):
    """Findings of the swing of a small program of two positions on a block of 60 x 60 x 40."""
    setups = clamped(positions(fixtures=fixtures))
    text = change("""G21
G17 G90 G94
G64 P0.001
G54
T7 M6
G43 H7
G53 G0 Z0
G53 G0 C0 A0
S5000 M3
G0 X0 Y0
G0 Z60
G1 Z39 F500
G0 Z60
G53 G0 Z0
G53 G0 A-90
G0 X0 Y20
G0 Z60
G1 Z29 F500
G0 Z60
G53 G0 Z0
M2
""")
    moves = reader_of(machine)(text, work_offsets={"G54": TRUNNION.wcs_origin_mm}, tool_lengths={7: BALL.length_mm})
    job = SimpleNamespace(machine=machine, stock=StockBox(min_mm=(-30, -30, 0), max_mm=(30, 30, 40)))
    return turning_findings(by_position(moves, [s.frame for s in setups], setups[0].clamped_frame), setups, job, {7: BALL})


def test_a_swing_at_the_top_is_clear():
    assert found() == [(), ()]


def test_a_table_that_is_wound_up_turn_after_turn_is_found_where_its_range_ends():
    """Its hoses allow a turn and a half.

    While the tool stays upright the turns are the first position's; the swing goes on from them.
    """
    c = TRUNNION.c.model_copy(update={"min_deg": -540.0, "max_deg": 540.0})
    hoses = TRUNNION.model_copy(update={"c": c})
    wound = lambda turns: lambda text: text.replace("G53 G0 A-90", "".join(
        f"G53 G0 C{360 * k}\n" for k in range(1, turns + 1)) + "G53 G0 A-90")
    assert found(wound(1), machine=hoses) == [(), ()]
    (), (finding,) = found(wound(2), machine=hoses)
    assert (finding.kind, finding.line, finding.row) == ("travel_exceeded", 17, -1)
    assert "C stands at 720.0000 degrees, its range is -540 .. 540 degrees" in finding.advice
    assert finding.machine_mm == (0.0, 0.0, 0.0)
    assert found(wound(2)) == [(), ()]              # the preset's own table turns without end


def test_a_swing_beside_the_part_is_found_and_told_of_the_position_that_it_leads_to():
    before, there = found(lambda text: text.replace("G0 Z60\nG53 G0 Z0\nG53 G0 A-90", "G0 Z45\nG53 G0 A-90"))
    assert before == () and {f.kind for f in there} >= {"rapid_through_stock"}
    assert all("while the rotary axes turn" in f.advice for f in there)


def test_a_swing_into_a_clamp_is_found():
    clamp = FixtureBox(name="clamp", min_mm=(-10, -60, 0), max_mm=(10, -40, 120))
    raised = lambda text: text.replace("G0 Z60\nG53 G0 Z0\nG53 G0 A-90", "G0 Z110\nG53 G0 A-90")
    assert found(raised, fixtures=(clamp,))[1] and not found(raised)[1]


def test_a_swing_into_the_trunnion_is_found_though_the_part_is_clear():
    """The tool stands low beside the part, past the edge of the table; the trunnion's plate comes up at it."""
    aside = "G0 Z60\nG0 X180 Y-110\nG0 Z0\nG53 G0 A-60\nG53 G0 Z0\nG53 G0 A-90"
    low = lambda text: text.replace("G0 Z60\nG53 G0 Z0\nG53 G0 A-90", aside)
    assert {f.kind for f in found(low)[1]} == {"fixture_contact"}
    assert not any(found(lambda text: low(text).replace("Y-110", "Y-230"))[1])
