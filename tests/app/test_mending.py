"""What a check finds the build mends, and tells; what cannot be mended is told with its reason."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, tool

from cuspline.app import build as recipe
from cuspline.app import catalogue, mending
from cuspline.app.mending import Wants, _dealt, mended, wants_of
from cuspline.design import Figure, Finish, Setup, SolidReport, StockBox
from cuspline.kernel import brep
from cuspline.planning.clean_up import squarely_touched
from cuspline.planning.context import PlanningContext
from cuspline.program.program import Kind, Moves
from cuspline.verification.reporter import allowed_mm
from cuspline.verification.verdict import Judging, Options, SetupProgram, first_look

DISH = Path(__file__).parents[1] / "parts" / "small_dish.py"
COARSE = Options(spacing_mm=0.25)


@pytest.fixture(scope="module")
def order(tmp_path_factory):
    source = catalogue.find_design(str(DISH))
    design = catalogue.make_design(source, [])
    return recipe.Order(source=source, design=design, machine=catalogue.find_machine(design.machine),
                        library=catalogue.find_library(None), accepted=(), last_stage="gcode",
                        out=tmp_path_factory.mktemp("mending") / "dish")


@pytest.fixture(scope="module")
def plan(order):
    (made,) = recipe._planned(order, lambda text: None)
    return made


def spoilt(plan, share):
    """The plan with the last share of its finishing moves left out; the ball lifts instead."""
    *before, last = plan.operations
    m, n = last.moves, int((1.0 - share) * len(last.moves))
    lift = [*m.end_mm[n - 1, :2], plan.clearance_z_mm]
    moves = Moves(start_mm=m.start_mm, kind=np.r_[m.kind[:n], Kind.RAPID], end_mm=np.vstack([m.end_mm[:n], lift]),
                  center_mm=np.vstack([m.center_mm[:n], [np.nan] * 3]), plane=np.r_[m.plane[:n], m.plane[n - 1]],
                  axis=np.vstack([m.axis[:n], m.axis[n - 1]]), feed_mm_per_min=np.r_[m.feed_mm_per_min[:n], 0.0])
    return replace(plan, operations=(*before, replace(last, moves=moves)))


def looked(order, plan):
    """(Residuals after all, finish, deepest gouge) of a plan's posted moves."""
    solid = brep.the_solid(order.design.solid, "dish")
    tools = {o.tool.number: o.tool for o in plan.operations}
    faces = tuple(brep.select_faces(brep.faces_of(solid), order.design.predicates[0]))
    program = SetupProgram(posted=recipe._as_posted(order, plan), setup=plan.setup, faces=faces)
    look = first_look((program,), solid, Judging(
        tools=tools, stock=order.design.stock, finish=order.design.finish, options=COARSE,
        ball_radius_mm=min(t.cutter.radius_mm for t in order.library.of_type("ball"))))
    ((found, _),), (gouge,) = look.residuals, look.gouges_mm(order.design.finish.gouge_mm)
    return found, order.design.finish, gouge


def test_passes_that_are_missing_are_cut_again_and_told(order, plan):
    bad, finish = spoilt(plan, 0.3), order.design.finish
    wants = wants_of(*looked(order, bad))
    assert len(wants.places_mm) > 50 and wants.left_mm > 2 * allowed_mm(finish)
    (good,), is_changed = mended([bad], [wants], 1, "the verdict")
    assert is_changed and good.operations[-1].name == "clean-up 1"
    assert good.mending[0]["places"] == len(wants.places_mm) and "clean-up passes with T" in good.mending[0]["done"]
    assert wants_of(*looked(order, good)).is_none


def test_a_sound_plan_is_left_alone_and_keeps_its_margin(order, plan):
    wants = wants_of(*looked(order, plan), share=1.0 - mending.MARGIN)
    (same,), is_changed = mended([plan], [wants], 1, "the planner's own check")
    assert wants.is_none and same is plan and not is_changed


def test_a_gouge_has_its_setup_planned_again_to_a_tighter_tolerance(order, plan):
    (again,), is_changed = mended([plan], [Wants(places_mm=np.zeros((0, 3)), left_mm=0.0, gouge_mm=0.01)], 1, "the verdict")
    finest = lambda p: p.operations[-1].facts["segment_tolerance_mm"]
    assert is_changed and finest(again) < 0.7 * finest(plan)
    assert "planned again to a tolerance of 0.0018 mm" in again.mending[0]["done"]


def test_a_place_that_no_ball_touches_is_told(order, plan):
    under = np.array([[7.0, 5.0, 0.0]])             # on the base, which looks down
    (same,), is_changed = mended([plan], [Wants(places_mm=under, left_mm=1.0, gouge_mm=0.0)], 1, "the verdict")
    assert not is_changed and same.operations is plan.operations
    assert "no ball of the library touches these places" in same.mending[0]["done"]


def test_places_are_dealt_to_the_position_that_touches_them_most_squarely(order):
    """One face, judged with the first of three positions: what its normals lean towards decides, not who was told."""
    top, lean = order.design.setups[0], np.radians(35.0)
    leaning = lambda way: (way * float(np.sin(lean)), 0.0, float(np.cos(lean)))
    setups = [top, *(Setup(name=name, faces=top.faces, indexed=True, clamped_x=top.wcs_x, clamped_z=top.wcs_z,
                           wcs_in_words=top.wcs_in_words, wcs_x=(0, 1, 0), wcs_z=leaning(way))
                     for name, way in (("left", -1), ("right", 1)))]
    plans = [SimpleNamespace(setup=s, operations=(), is_mended=True,
                             context=PlanningContext(order.design, s, order.machine, order.library)) for s in setups]
    closest = plans[0].context.closest
    places = np.array([[x, y, 9.0] for x in np.linspace(1, 13, 25) for y in (1.0, 5.0, 9.0)])
    foot = closest.closest_points(places)
    mine = np.isin(foot.face, plans[0].context.wanted) & ~foot.is_edge
    told = Wants(places_mm=foot.point_mm[mine], left_mm=0.1, gouge_mm=0.0)
    nothing = Wants(places_mm=np.zeros((0, 3)), left_mm=0.03, gouge_mm=0.0)
    dealt = _dealt(plans, [told, nothing, nothing])
    assert sum(len(w.places_mm) for w in dealt) == mine.sum() and all(len(w.places_mm) for w in dealt)
    axes = np.array([s.wcs_z for s in setups])
    for k, want in enumerate(dealt):
        square = closest.closest_points(want.places_mm).normal @ axes.T
        for j in range(3):
            squarer = want.places_mm[square[:, j] > square[:, k] + 1e-9]
            touches = squarely_touched(plans[j].context, (), setups[j].turn.into(squarer), 0.1) > 0.0
            assert len(squarer) < 0.2 * len(square) and not touches.any()


def test_a_round_that_did_not_help_is_the_last(plan):
    """The same depth again after the setup was planned again: nothing more is tried."""
    deep = Wants(places_mm=np.zeros((0, 3)), left_mm=0.0, gouge_mm=0.01)
    before = {"found_by": "the verdict", "places": 0, "highest_mm": None, "gouge_mm": 0.01, "done": "planned again"}
    (same,), is_changed = mended([replace(plan, mending=(before,))], [deep], 2, "the verdict")
    assert not is_changed and same.mending[-1]["done"] == "nothing: the round before did not help"


def test_the_build_mends_what_the_verdict_finds(order, plan, monkeypatch):
    """Planned with passes missing and without the planner's own check: the verdict sends the places back."""
    monkeypatch.setattr(recipe, "plan_setup", lambda *args: spoilt(plan, 0.3))
    monkeypatch.setattr(mending, "OWN_ROUNDS", 0)
    monkeypatch.setattr(recipe, "Options", lambda: Options(spacing_mm=0.25, solid_pitch_mm=0.2))
    result = recipe.build(replace(order, last_stage="verify"))
    assert result.is_ok
    told = json.loads((result.folder / "plan.json").read_text())["setups"][0]
    assert [m["found_by"] for m in told["mending"]] == ["the verdict"] and told["operations"][-1]["name"] == "clean-up 1"


def test_what_the_samples_do_not_see_the_proof_sends_back_before_the_verdict(order, plan, monkeypatch):
    """Planned with passes missing, and every sample content: the places come from the proof between them."""
    monkeypatch.setattr(recipe, "plan_setup", lambda *args: spoilt(plan, 0.3))
    monkeypatch.setattr(mending, "wants_of", lambda *args, **kwargs: Wants(places_mm=np.zeros((0, 3)), left_mm=0.0, gouge_mm=0.0))
    monkeypatch.setattr(recipe, "Options", lambda: Options(spacing_mm=0.25, solid_pitch_mm=0.2))
    result = recipe.build(replace(order, last_stage="verify", out=order.out.with_name("between")))
    told = json.loads((result.folder / "plan.json").read_text())["setups"][0]
    assert result.is_ok and {m["found_by"] for m in told["mending"]} == {"the planner's own proof between samples"}


def test_what_could_not_be_mended_is_told_with_what_was_tried(order, plan, monkeypatch):
    monkeypatch.setattr(recipe, "plan_setup", lambda *args: spoilt(plan, 0.3))
    monkeypatch.setattr(mending, "OWN_ROUNDS", 0)
    monkeypatch.setattr(recipe, "Options", lambda: Options(spacing_mm=0.25, solid_pitch_mm=0.2))
    monkeypatch.setattr(mending, "clean_up", lambda shop, operations, places, *rest: ([], np.zeros(len(places), bool)))
    result = recipe.build(replace(order, last_stage="verify", out=order.out.with_name("stays")))
    assert not result.is_ok and {f.kind for f in result.findings} <= {"missing_area", "excess"}
    assert all("tried: nothing: no pass of T" in f.advice for f in result.findings)


def test_a_solid_that_is_off_its_figures_is_refused_though_it_could_be_cut(order, tmp_path):
    off = Figure(what="length", measured=10.1, wanted=10.0, allowed=0.05, unit="mm")
    design = replace(order.design, measure=lambda solid: SolidReport(figures=(off,), facts={}))
    made = recipe.build(replace(order, design=design, last_stage="plan", out=tmp_path / "dish"))
    assert made.folder.name == "dish-rejected" and [f.kind for f in made.findings] == ["solid_off"]
    assert not json.loads((made.folder / "solid.json").read_text())["ok"]


def test_a_hair_off_a_razor_s_edge_is_no_deep_gouge():
    """A rib 0.002 mm thick is cut away from one side: along the normal of its top nothing is met for more than a millimetre, but
    nowhere did the cutter go more than 0.0025 mm past its skin."""
    thick = 0.002
    body = cq.Workplane().box(10, 6, 2, centered=(True, True, False)).union(
        cq.Workplane().box(thick, 6, 4, centered=(True, True, False)).translate((0, 0, 2))).val()
    solid = brep.the_solid(body, "rib")
    top = tuple(f for f in brep.faces_of(solid) if f.middle.point_mm[0, 2] > 5.9)
    passes = [move for z in np.arange(2.0, 6.01, 0.05)
              for move in (feed(-0.9985, -4, z), feed(-0.9985, 4, z), feed(-3, 4, z), feed(-3, -4, z))]
    cut = SetupProgram(posted=program((-3, -4, 8), passes), faces=top, setup=Setup(name="one", faces=("top",), wcs_in_words="base"))
    look = first_look((cut,), solid, Judging(
        tools={1: tool("ball", 2.0)}, stock=StockBox(min_mm=(-5, -3, 0), max_mm=(5, 3, 6.5)), ball_radius_mm=1.0,
        finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.001, gouge_mm=0.003), options=COARSE))
    (_, own), = look.residuals
    gouge, = look.gouges_mm(0.003)
    assert (own.deviation_mm.min(), gouge) == pytest.approx((-0.0025, 0.0025), abs=1e-6)    # its rim to what stands behind
