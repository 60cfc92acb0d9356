"""A ball that finishes leaning: planned over a dome, a saddle and a twisted surface, posted for every machine, read back, cut."""

import dataclasses
import re
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import steep_boss
from known_machines import FIVE_AXIS, leaning
from known_tools import tool
from leaning_surface import FORMS, Surface, design

from cuspline.app.catalogue import find_library, find_machine, find_post, reader_of
from cuspline.planning.leaning_finishing import lifted
from cuspline.planning.plan import plan_setup
from cuspline.planning.plating import in_metal
from cuspline.posts.writers import linuxcnc
from cuspline.program.program import Kind, MoveWriter
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.toolpaths.five_axis.leaning_moves import Leaning, upright_again
from cuspline.toolpaths.five_axis.tool_axes import FastestAxis, FixedAxis, LeadTilt
from cuspline.values.errors import PlanError

LIBRARY = find_library(None)
TOOLS = {t.number: t for t in LIBRARY.tools}
NARROW = "mill_head_table_bc"       # its table turns by one and a half turns either way: it rewinds between passes
ALIKE_MM = 0.002            # from machine to machine: each keeps its path tolerance, 2 um, between blocks
LEAN_DEG = 0.05             # the feed is looked at over 2 mm, chords of 20 um between
EVERY_MM = 1.2              # between places looked at


def mill(name):
    """A machine, its zero 60 mm higher than usual: heads that lean come down low."""
    found = find_machine(name)
    x, y, z = found.wcs_origin_mm
    return found.model_copy(update={"wcs_origin_mm": (x, y, z + 60.0)})


@cache
def planned(form):
    """Design and plan, laid for the machine of the narrowest range."""
    part = design(Surface(form=form))
    return part, plan_setup(part, part.setups[0], mill(NARROW), LIBRARY)


@cache
def text_of(form, name):
    return linuxcnc.post(planned(form)[1].program(("LEANING",), "leaning"), mill(name)).text


def read(name, text):
    return reader_of(mill(name))(text, work_offsets={"G54": mill(name).wcs_origin_mm},
                                 tool_lengths={n: t.length_mm for n, t in TOOLS.items()})


@cache
def cut(form, name):
    """(deviations at places of the surface, PostedMoves) of what the text cuts."""
    part, plan = planned(form)
    posted = read(name, text_of(form, name))
    return deviations(part, plan, posted), posted


def deviations(part, plan, posted):
    """(n,) at places of the surface, of what moves leave."""
    left = Workpiece(blank=part.stock.shape).after(part.setups[0].frame, swept_paths(posted, TOOLS))
    s = plan.context.samples
    rows = np.unique(np.round(s.point_mm[:, :2] / EVERY_MM).astype(int), axis=0, return_index=True)[1]
    return left.deviations(s.point_mm[rows], s.normal[rows], 1.0)[0]


@pytest.mark.parametrize("form", FORMS)
def test_the_surface_comes_out_as_asked(form):
    part, plan = planned(form)
    deviation, posted = cut(form, NARROW)
    assert len(deviation) > 400 and posted.remarks == ()
    allowed = part.finish.scallop_mm + part.finish.profile_tolerance_mm
    assert deviation.min() > -part.finish.gouge_mm and 0.05 < deviation.max() < allowed
    facts = plan.operations[-1].facts
    assert facts["tool_axis"] == {"kind": "lead_tilt", "lead_deg": 12.0, "tilt_deg": -15.0}
    assert facts["lean_deg"][1] > 40 and facts["largest_turn_deg"] <= 2.001 and facts["held_at_limit_mm"] == 0.0


@pytest.mark.parametrize("name", [n for n in FIVE_AXIS if n != NARROW])
@pytest.mark.parametrize("form", FORMS)
def test_every_machine_cuts_the_same_surface(form, name):
    one, other = cut(form, NARROW)[0], cut(form, name)[0]
    assert np.abs(one - other).max() < ALIKE_MM


def test_no_lean_lowers_the_ball():
    """Its middle is that of the upright ball, which is gouge-free."""
    _, plan = planned("saddle")
    moves, tool = plan.operations[-1].moves, plan.operations[-1].tool
    upright = upright_again(moves, tool.cutter.radius_mm)
    cutting = upright.kind == Kind.FEED
    dropper = plan.context.dropper_of(tool.cutter, 0.0)
    share = np.linspace(0, 1, 5)[:, None, None]
    places = upright.starts_mm[cutting] + share * (upright.end_mm - upright.starts_mm)[cutting]
    low = places.reshape(-1, 3)[:, 2] - dropper.tips_mm(places.reshape(-1, 3)[:, :2])
    assert low.min() > -plan.context.finish.profile_tolerance_mm


def test_lead_and_tilt_are_those_of_the_surface():
    """Measured at the ball's contacts by the surface's own normals, well inside its edges."""
    _, plan = planned("blade")
    moves, radius = plan.operations[-1].moves, plan.operations[-1].tool.cutter.radius_mm
    middle = moves.end_mm + radius * moves.axis
    foot = plan.context.closest_of(tuple(plan.context.wanted)).closest_points(middle)
    travel = np.abs(np.diff(middle, axis=0, prepend=middle[:1]))
    inside = (np.abs(foot.point_mm[:, :2]) < (11, 9)).all(axis=1) & (np.abs(foot.distance_mm - radius) < 0.01) & (
        moves.kind == Kind.FEED) & (travel[:, 1] < 1e-6) & (travel[:, 0] > 0.02)
    n, a = foot.normal[inside], moves.axis[inside]
    way = np.sign(np.diff(middle[:, 0], prepend=0.0))[inside]
    ahead = np.column_stack([way, 0 * way, -way * n[:, 0] / n[:, 2]])          # in the pass' plane, on the surface
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    tilt = np.degrees(np.arcsin((a * np.cross(ahead, n)).sum(axis=1)))
    lead = np.degrees(np.arctan2((a * ahead).sum(axis=1), (a * n).sum(axis=1)))
    assert inside.sum() > 40 and np.abs(tilt + 15).max() < LEAN_DEG and np.abs(lead - 12).max() < LEAN_DEG


def test_a_table_that_would_wind_up_goes_back_between_the_passes():
    part, plan = planned("dome")
    assert plan.operations[-1].facts["links"] == "lifted: the rotaries go back between passes"
    text, posted = text_of("dome", NARROW), cut("dome", NARROW)[1]
    angles = [float(c) for c in re.findall(r" C(-?[\d.]+)", text)]
    assert max(map(abs, angles)) <= 540
    lines = text.splitlines()
    back = [k for k, line in enumerate(lines) if line.startswith("G53 G0") and "C" in line][3:]
    assert back and all(lines[k - 1] == "G53 G0 Z0" for k in back)
    turning = (np.abs(np.diff(posted.rotary_deg, axis=0, prepend=posted.rotary_deg[:1])) > 20).any(axis=1)
    assert (posted.kind[turning] == Kind.RAPID).all()
    free = plan_setup(part, part.setups[0], mill("mill_trunnion_ac"), LIBRARY)
    assert free.operations[-1].facts["links"] == "zig-zag"


def test_only_lead_and_tilt_keep_a_corner_on_the_faces():
    part = planned("dome")[0]
    setup = with_axis(part, FixedAxis(direction=(0.2, 0.0, 1.0)))
    bull = setup.operations[1].model_copy(update={"tool": "bull 10 r1"})
    with pytest.raises(PlanError, match="has no bull nose 10 r1|only a lead_tilt axis"):
        plan_setup(part, setup.model_copy(update={"operations": (setup.operations[0], bull)}), mill("mill_trunnion_ac"), LIBRARY)


@cache
def planned_bull():
    """A saddle finished by a bull nose that leads by 15 degrees, one way; cusps of 0.2 mm."""
    part = design(Surface(form="saddle", tool="bull 10 r1", lead_deg=15.0, tilt_deg=0.0, passes="one-way", scallop_mm=0.12))
    return part, plan_setup(part, part.setups[0], mill(NARROW), LIBRARY)


@cache
def cut_by_bull(name):
    """Deviations at places of the saddle, of what the bull nose's text cuts on a machine."""
    part, plan = planned_bull()
    posted = read(name, linuxcnc.post(plan.program(("LEANING",), "leaning"), mill(name)).text)
    return deviations(part, plan, posted)


def test_a_leaning_bull_nose_leaves_the_cusps_that_its_step_was_chosen_for_and_gouges_nothing():
    part, plan = planned_bull()
    deviation, facts = cut_by_bull(NARROW), plan.operations[-1].facts
    assert len(deviation) > 400 and deviation.min() > -part.finish.gouge_mm
    common = facts["common_plane"]
    assert 0.08 < common["cusp_mm"] <= facts["ridge_for_step_mm"] == 0.1 and common["looked_at"] > 50
    assert np.percentile(deviation, 99.5) < 1.05 * common["cusp_mm"] + part.finish.profile_tolerance_mm
    assert deviation.max() < part.finish.scallop_mm + part.finish.profile_tolerance_mm


def test_a_leaning_bull_nose_cuts_the_same_on_another_type_of_machine():
    assert np.abs(cut_by_bull(NARROW) - cut_by_bull("mill_head_head")).max() < ALIKE_MM


def test_cutters_and_inclinations_are_compared_in_one_table():
    """Flat enough at 3 degrees to gouge the hollow; what fits is faster the less it leans, and faster than any ball."""
    rows = planned_bull()[1].operations[-1].facts["compared"]
    mine = {r["lead_deg"]: r for r in rows if r["name"] == "bull nose 10 mm R1"}
    assert not mine[3.0]["fits"] and "into the part" in mine[3.0]["reason"] and mine[15.0]["fits"] and mine[30.0]["fits"]
    assert mine[15.0]["estimated_time_s"] < mine[30.0]["estimated_time_s"]
    assert mine[15.0]["radius_across_mm"] == pytest.approx(1 + 4 / np.sin(np.radians(15)), abs=1e-4)
    balls = [r for r in rows if r["type"] == "ball" and r["diameter_mm"] <= 10]
    assert balls and min(r["estimated_time_s"] for r in balls) > 2 * mine[15.0]["estimated_time_s"]


def test_the_fastest_cutter_and_lead_that_can_be_planned_are_taken_from_the_table():
    """Nothing is named; what is faster in the table and fits is named with why it was not taken."""
    part = planned_bull()[0]
    finish = part.setups[0].operations[1].model_copy(update={"tool": None, "tool_axis": FastestAxis(leads_deg=(3.0, 15.0))})
    made = plan_setup(part, part.setups[0].model_copy(update={"operations": (finish,)}), mill(NARROW), LIBRARY).operations[-1]
    lead = made.facts["tool_axis"]["lead_deg"]
    mine, = (r for r in made.facts["compared"] if r["tool"] == made.tool.number and r["lead_deg"] == lead)
    faster = [r for r in made.facts["compared"] if r["fits"] and r["estimated_time_s"] < mine["estimated_time_s"]
              and r["lead_deg"] in (3.0, 15.0)]
    assert mine["fits"] and made.tool.cutter.type in ("bull_nose", "flat")
    refused = {(w.split()[0], float(w.split()[3])) for w in made.facts["not_taken"]}
    assert {(f"T{r['tool']}", r["lead_deg"]) for r in faster} <= refused


def test_a_barrel_goes_round_a_wall_in_steps_as_wide_as_its_arc_allows():
    """On a straight wall the step is the chord of its arc that leaves the cusp; a ball's is that of its own radius."""
    part, tools = steep_boss.design(steep_boss.Boss()), (*LIBRARY.tools, steep_boss.barrel())
    plan = plan_setup(part, part.setups[0], mill("mill_trunnion_ac"), LIBRARY.model_copy(update={"tools": tools}))
    facts, moves = plan.operations[-1].facts, plan.operations[-1].moves
    chord = 2.0 * np.sqrt(2.0 * steep_boss.ARC_MM * facts["ridge_for_step_mm"])
    wall = np.hypot(steep_boss.TALL_MM, 3.5)
    assert wall / chord < facts["levels"] < wall / chord + 3.0
    lean = np.degrees(np.arccos(moves.axis[moves.kind == Kind.FEED, 2]))
    from_wall = 15.0 - np.degrees(np.arctan(3.5 / steep_boss.TALL_MM))
    assert from_wall - 0.2 < lean.min() and lean.max() < from_wall + 0.5


def with_axis(part, axis):
    """The part's setup, its finish along another axis."""
    rough, finish = part.setups[0].operations
    return part.setups[0].model_copy(update={"operations": (rough, finish.model_copy(update={"tool_axis": axis}))})


def test_a_holder_that_leans_into_the_part_is_refused_with_the_place():
    part = planned("dome")[0]
    with pytest.raises(PlanError, match=r"finish: with its axis so .* mm are left between .* and the part .* at \[.*lean"):
        plan_setup(part, with_axis(part, LeadTilt(tilt_deg=70.0)), mill("mill_trunnion_ac"), LIBRARY)


def test_what_cannot_turn_is_refused_by_name():
    part = planned("dome")[0]
    with pytest.raises(PlanError, match="finish: its tool axis turns, and mill_3axis has no rotary axes"):
        plan_setup(part, part.setups[0], find_machine("mill_3axis"), LIBRARY)
    setup = with_axis(part, LeadTilt())
    bull = setup.operations[1].model_copy(update={"tool": "bull 10 r1"})
    with pytest.raises(PlanError, match="finish on mill_trunnion_ac: row .*: A would stand at .* or give it a limit_deg"):
        plan_setup(part, with_axis(part, LeadTilt(tilt_deg=85.0)), mill("mill_trunnion_ac"), LIBRARY)
    with pytest.raises(PlanError, match="bull nose 10 mm R1: .* leans by 0 degrees .*: give it a lead_deg of 1 or more"):
        plan_setup(part, setup.model_copy(update={"operations": (setup.operations[0], bull)}), mill("mill_trunnion_ac"), LIBRARY)


def test_beside_indexed_positions_nothing_turns_in_the_cut():
    """One program of both: its reader would take the leaning moves for wrong rotary words."""
    part = planned("dome")[0]
    alone = part.setups[0].model_copy(update={"operations": part.setups[0].operations[1:]})
    side = alone.model_copy(update={"name": "side", "indexed": True, "wcs_z": (0.0, -1.0, 0.0)})
    both = dataclasses.replace(part, setups=(alone, side))
    with pytest.raises(PlanError, match=r"its tool axis turns, and the part is held so for indexed positions as well \(side\)"):
        plan_setup(both, alone, mill("mill_trunnion_ac"), LIBRARY)
    with pytest.raises(PlanError, match="finish: its tool axis turns in an indexed position, which holds it still"):
        plan_setup(both, both.setups[1], mill("mill_trunnion_ac"), LIBRARY)


@pytest.mark.parametrize("post, word", [("linuxcnc", "M428"), ("fanuc", "G43.4"), ("fanuc", None), ("haas", "G234"), ("haas", None),
                                        ("heidenhain", "TCPM")])
def test_however_it_is_posted_it_cuts_the_same_surface(post, word):
    """Tip control and other controllers, on the trunnion."""
    part, plan = planned("blade")
    machine = mill("mill_trunnion_ac")
    other = machine.model_copy(update={"control": machine.control.model_copy(update={"post": post, "tip_control": word})})
    posted = reader_of(other)(find_post(post).post(plan.program(("LEANING",), "leaning"), other).text,
                              work_offsets={"G54": other.wcs_origin_mm}, tool_lengths={n: t.length_mm for n, t in TOOLS.items()})
    assert posted.remarks == ()
    assert np.abs(deviations(part, plan, posted) - cut("blade", NARROW)[0]).max() < ALIKE_MM


def test_a_leaning_ball_below_the_plating_keeps_its_middle():
    """The whole cutter's tip is deeper along its axis, not straight down."""
    planned_ = planned("dome")[1].operations[-1]
    whole = in_metal(planned_, LIBRARY, 0.05)
    radius = planned_.tool.cutter.radius_mm
    middle = planned_.moves.end_mm + (radius - 0.05) * planned_.moves.axis
    assert np.abs(whole.moves.end_mm + radius * whole.moves.axis - middle).max() < 1e-12


def test_above_the_work_a_leaning_holder_stays_as_high_as_the_ball():
    """A ball 40 mm out of a wide holder, on its side: what hangs below the ball lifts the rapids, the cut stays where it is."""
    wide = tool("ball", 8, number=1)
    w = MoveWriter((0, 0, 20))
    for z in (12, 5, 5.5):
        w.feed((z, 0, z), 100)
    w.rapid((5.5, 0, 20))
    axes = leaning(np.full(len(w), 80.0), 0.0)
    about = 4.0 * (np.array([0, 0, 1.0]) - axes)        # from the upright tip to the leaning one
    flat = dataclasses.replace(w.moves(), axis=axes, start_mm=(0, 0, 20) + about[0], end_mm=w.moves().end_mm + about)
    work = SimpleNamespace(machine=mill(NARROW), clearance_z_mm=20.0, clearance_mm=10.0, practice=SimpleNamespace(approach_mm=2.0))
    middles = np.vstack([flat.start_mm, flat.end_mm]) + 4.0 * np.vstack([axes[:1], axes])
    high = lifted(work, Leaning(moves=flat, is_cut=np.zeros(4, bool), is_held=np.zeros(4, bool), middle_mm=middles,
                                normal=np.full((5, 3), np.nan), ball_radius_mm=4.0), wide)
    rise = high.end_mm[:, 2] - flat.end_mm[:, 2]
    s, c = np.sin(np.radians(80)), np.cos(np.radians(80))
    below = 20 * s - (45 - 4) * c - 4                   # of the holder's edge, the ball's own lowest place taken off
    assert rise == pytest.approx([below, 0, 0, below]) and below > 5
