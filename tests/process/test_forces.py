"""Forces out of what the edge meets: closed forms of a groove, the source's order of cuts, a beam, limits."""

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.app import catalogue
from cuspline.process.engagement import Look, engagement
from cuspline.process.forces import CARBIDE_N_PER_MM2, CORE_SHARE, bending_mm_per_n, forces
from cuspline.replay.scene import FoundStock
from cuspline.shop.cutting_forces import known_forces
from cuspline.values.frames import Frame
from cuspline.verification.process_findings import limit_findings

H13 = known_forces()["steel_h13_48hrc"]
BLOCK = FoundStock(min_mm=(-30, -30, -20), max_mm=(30, 30, 0), pitch_mm=1.0)
ALONG = np.sin(np.radians(70)) * 4000


@pytest.fixture(scope="module")
def groove():
    """A flat cutter in the full, 2 mm deep: (posted, tools, engagement)."""
    posted, tools = program((-40, 0, -2), [feed(40, 0, -2)]), {1: tool("flat", 10)}
    return posted, tools, engagement(posted, tools, BLOCK, Look.finer(2))


def test_a_groove_takes_the_torque_and_power_of_the_closed_form(groove):
    posted, tools, met = groove
    found = forces(posted, tools, met, H13)
    mine = np.abs(met.tip_mm[:, 0]) < 20
    per_tooth = 500 / (8000 * 2)
    torque = ALONG * per_tooth * 2 * 5 / 1000           # one tooth of two, straight ahead
    assert found.torque_n_m[mine] == pytest.approx(torque, rel=0.02)
    assert found.power_kw[mine] == pytest.approx(ALONG * 10 * 2 * 500 / 60 / 1e6, rel=0.02)
    assert found.radial_n[mine] == pytest.approx(4000 * per_tooth * 2, rel=0.02) and found.axial_n[mine].max() < 0.1


def test_the_axial_force_falls_from_plane_to_step_up_to_inclined():
    """The source's ranking: r 5.41, layer 1, step 0.5, 25 degrees; a ball leaning in its feed is an upright one going uphill."""
    r, t, step, slope = 5.41, 1.0, 0.5, np.radians(25)
    tools, found = {1: tool("ball", 2 * r, flute=20)}, {}
    for name, turn in (("plane", 0.0), ("step-up", slope), ("inclined", slope)):
        low, high = (-16.0, -16.0, -16.0), (16.0, 16.0, 16.0)
        zmap = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.5).zmap
        top = (zmap.xy_mm[:, 0] * np.tan(turn) + t / np.cos(turn)).reshape(zmap.shape).clip(-16, 16)
        stock = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.5, top_mm=top)
        up, out = np.array([np.cos(turn), 0, np.sin(turn)]), np.array([-np.sin(turn), 0, np.cos(turn)])
        across = np.array([0, 1.0, 0])
        along, aside = (up, across) if name == "inclined" else (across, up)
        begin = out * r - np.array([0, 0, r]) - 14 * along
        second = begin + step * aside
        moves = [feed(*(begin + 28 * along)), rapid(0, 0, 60), rapid(*second[:2], 60), rapid(*second), feed(*(second + 28 * along))]
        posted = program(begin, moves)
        met = engagement(posted, tools, stock, Look.finer(2))
        mine = (met.row == 4) & (np.abs(met.tip_mm @ along - (out * r - np.array([0, 0, r])) @ along) < 4)
        found[name] = forces(posted, tools, met, H13).axial_n[mine].mean()
    assert found["plane"] > found["step-up"] > found["inclined"] > 0


def test_a_bar_bends_as_a_beam():
    plain = tool("flat", 10, flute=20, neck=10, stick_out=45)
    flutes = 20 ** 3 / (3 * CARBIDE_N_PER_MM2 * np.pi * (CORE_SHARE * 10) ** 4 / 64)
    rest = (45 ** 3 - 20 ** 3) / (3 * CARBIDE_N_PER_MM2 * np.pi * 10 ** 4 / 64)
    assert bending_mm_per_n(plain) == pytest.approx(flutes + rest, rel=1e-12)


def test_a_limit_that_is_stated_is_held(groove):
    posted, tools, met = groove
    loads, mill = forces(posted, tools, met, H13), catalogue.find_machine("mill_3axis")
    look = lambda machine, own: limit_findings(posted, own, machine, met, loads, ("setup-1", Frame.shift((0.0, 0.0, 0.0))))
    assert look(mill, tools) == ()
    power = float(loads.power_kw.max())
    limited = lambda share: mill.model_copy(update={"spindle": mill.spindle.model_copy(update={"power_kw": share * power})})
    assert look(limited(1.01), tools) == ()
    finding, = look(limited(0.99), tools)
    assert (finding.kind, finding.line, finding.unit) == ("process_limit", 10, "kW")
    assert finding.amount == pytest.approx(power, abs=1e-3)
    weak = tools[1].model_copy(update={"cutter": tools[1].cutter.model_copy(update={"bending_n": 100.0})})
    assert "force across the axis" in look(mill, {1: weak})[0].advice
    assert limit_findings(posted, {1: weak}, mill, met, None, ("setup-1", None)) == ()


def test_what_is_left_out_stays_out_of_machines_and_tools_as_written():
    mill = catalogue.find_machine("mill_3axis")
    assert set(mill.model_dump()["spindle"]) == {"min_rpm", "max_rpm"}
    assert "bending_n" not in tool("flat", 10).model_dump()["cutter"]
