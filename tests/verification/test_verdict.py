"""The verdict turns as it must: known-good, known-bad, and both verifiers against each other."""

import dataclasses
import json

import cadquery as cq
import numba
import numpy as np
import pytest
from known_programs import arc, feed, program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep, mesh_quality, solids
from cuspline.program.program import Plane
from cuspline.stock.stock_solids import upright_walls
from cuspline.values.errors import InputError
from cuspline.values.threads import set_thread_count
from cuspline.verification import residuals
from cuspline.verification.climbing import Tops
from cuspline.verification.reporter import Reporter
from cuspline.verification.verdict import Judging, Options, SetupProgram, Verdict, verify_setup, verify_setups

BLOCK = brep.the_solid(cq.Workplane().box(20, 16, 10, centered=False))
FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=0.6, solid_pitch_mm=0.2, replay_pitch_mm=0.5, tessellation_mm=0.002)
R, STEP = 5.0, 0.6                                           # cusp 0.0090 mm


def upward(solid):
    return [f for f in brep.faces_of(solid) if f.middle.normal[0, 2] > 0.5]


def passes(z, skip=(99, 99), step=STEP):
    ys = np.arange(-0.3, 16.7, step)
    moves = raster((-6, 26), [y for y in ys if not skip[0] < y < skip[1]], z)
    return [rapid(-6, -0.3, 14), *moves, rapid(26, 16, 14)]


def verdict(moves=None, z=10.0, solid=BLOCK, faces=None, stock=((0, 0, 0), (20, 16, 12)), tools=None, origin=(0, 0, 0),
            ball=3.0, options=COARSE, say=lambda text: None, **changes):
    posted = program((-6, -0.3, 40), moves or passes(z), **changes)
    setup = Setup(name="setup-1", wcs_in_words="corner", faces=("top",), wcs_origin_mm=origin)
    return verify_setup(posted, tools or {1: tool("ball", 2 * R)}, solid, faces or upward(solid), setup=setup,
                        stock=StockBox(min_mm=stock[0], max_mm=stock[1]), finish=FINISH, ball_radius_mm=ball,
                        options=options, say=say)


def kinds(result):
    return {f.kind for f in result.findings}


def test_a_good_plane_is_verified_with_its_exact_cusp():
    v = verdict()
    d = v.as_dict()
    cusp = R - np.sqrt(R**2 - STEP**2 / 4)
    assert d["ok"] and d["findings"] == [] and d["collisions"] == []
    assert d["gouge_max_mm"] < 1e-6 and cusp - 3e-4 < d["cusp_max_mm"] <= cusp + 1e-6
    assert abs(d["area_required_mm2"] - 320) < 1e-3 and abs(d["area_reached_mm2"] - 320) < 1e-3
    mean = STEP**2 / (24 * R)                               # of the cusp's parabola
    assert abs(d["excess_volume_mm3"] - 320 * mean) < d["excess_volume_bound_mm3"] < 0.1 * 320 * mean
    assert d["gouge_volume_mm3"] <= d["gouge_volume_bound_mm3"] < 1e-3
    assert d["verifiers"]["compared_area_mm2"] > 100
    json.dumps(Verdict(setups=(v,)).as_dict())


RHO = 20.0                                                   # of the trough


def along_the_trough(deep_mm=0.0):
    """Arcs across a trough of radius RHO about the line x = 10, z = 30, zig-zag at the step."""
    side, drop = (RHO - R + deep_mm) * np.array([np.sin(np.radians(40)), np.cos(np.radians(40))])
    ends, moves = [(10 - side, 30 - R - drop), (10 + side, 30 - R - drop)], []
    for k, y in enumerate(np.arange(-0.3, 16.7, STEP)):
        (x, z), (x1, z1) = ends[::1 if k % 2 == 0 else -1]
        moves += [feed(x, y, z), arc((x1, y, z1), (10, y, 30 - R), Plane.ZX, clockwise=k % 2 == 0)]
    return [rapid(*moves[0][1][:2], 24), *moves, rapid(moves[-1][1][0], 16, 24)]


@pytest.mark.parametrize("deep_mm", [0.0, 0.0007])
def test_volumes_are_what_is_cut_and_not_the_facets(deep_mm):
    """A trough's triangles stand above its arc: cut exactly, the solids alone show a gouge all over."""
    rim = 30 - np.sqrt(300)
    profile = cq.Workplane("XZ").lineTo(20, 0).lineTo(20, rim).threePointArc((10, 10), (0, rim)).close().extrude(-16)
    solid = brep.the_solid(profile)
    trough = [f for f in brep.faces_of(solid) if f.kind == "cylinder"]
    v = verdict(along_the_trough(deep_mm), solid=solid, faces=trough, stock=((0, 0, 0), (20, 16, 13)),
                options=dataclasses.replace(COARSE, tessellation_mm=0.01))
    y = np.linspace(-STEP / 2, STEP / 2, 20_001)
    d = R - deep_mm - np.sqrt(R**2 - y**2)                  # left over the step: the ball's centre runs on an exact arc
    ring = lambda left: 16 * np.pi / 3 * float((RHO * left - left**2 / 2).mean())
    facets = (solids.solid_of(v.mesh.vertices_mm, v.mesh.triangles) - v.stock.field(0).solid).volume()
    assert facets > 0.15                                    # mm3, of a surface that is cut exactly
    for name, wanted in (("gouge", -ring(np.minimum(d, 0))), ("excess", ring(np.maximum(d, 0)))):
        bound = v.numbers[f"{name}_volume_bound_mm3"]
        assert abs(v.numbers[f"{name}_volume_mm3"] - wanted) <= bound <= 0.2 * wanted + 1e-3, (wanted, v.numbers)


def test_a_layer_left_out_and_a_slot_too_deep_are_counted_with_their_whole_volume():
    """1 mm left over a fourth of the block, and a slot of the cutter's section: bodies beyond tolerance."""
    left = verdict([m for m in passes(10.0) if m[1][1] < 12.0], stock=((0, 0, 0), (20, 16, 11)))
    edge = max(m[1][1] for m in passes(10.0) if m[1][1] < 12.0)
    foot = np.sqrt(R**2 - (R - 1.0)**2)                     # the last pass has a round side
    side = foot * R - (R**2 * np.arcsin(foot / R) + foot * (R - 1.0)) / 2
    wanted = 20 * ((16 - edge - foot) * 1.0 + side + edge * STEP**2 / (24 * R))
    n = left.numbers
    assert abs(n["excess_volume_mm3"] - wanted) < n["excess_volume_bound_mm3"] < 0.1 * wanted, (wanted, n)
    deep = verdict([*passes(10.0), feed(-6, 8, 14), feed(-6, 8, 9.0), feed(26, 8, 9.0), rapid(26, 8, 14)]).numbers
    slot = 20 * (R**2 * np.arccos((R - 1) / R) - (R - 1) * foot)
    assert abs(deep["gouge_volume_mm3"] - slot) < deep["gouge_volume_bound_mm3"] < 0.1 * slot, (slot, deep)


def test_a_pass_between_the_nodes_of_the_replay_is_not_idle_where_less_stands_after_it():
    """The last 2 um of a ridge, 3 mm of it, after a long way through air; the same pass over what is cut is idle."""
    cusp, moves = R - np.sqrt(R**2 - STEP**2 / 4), passes(10.0)

    def again(z):
        touch = [rapid(26, 26, 14), rapid(6, 26, 14), feed(6, 6.0, 12.5), feed(6, 6.0, z), feed(9, 6.0, z), feed(9, 6.0, 12.5),
                 feed(9, 26, 12.5), feed(-20, 26, 12.5), rapid(-20, 26, 14)]
        operation = np.repeat([0, 1], [len(moves), len(touch)])
        found = verdict([*moves, *touch], operation=operation, operations=("first", "again")).findings
        return [f.operation for f in found if f.kind == "idle_operation"]

    assert again(10.0 + cusp - 0.002) == [] and again(10.0 + cusp + 0.002) == ["again"]


def test_every_stage_is_told_with_its_size():
    said, moves = [], passes(10.0)
    v = verdict(moves, say=said.append)
    count = f"{len(moves):,} moves"
    stages = ("index over " + count, "triangles of the design within 0.0020 mm", "samples of the faces, 12 triangles",
              f"{v.numbers['points_checked']:,} samples against {count}", "proof of what stands between the samples",
              f"replay of {count} on a grid of 0.500 mm", "what the edges meet on " + count, "certificate of " + count,
              "cusps beside ", "solids on a grid of 0.200 mm")
    assert len(said) == len(stages) and all(stage in text for stage, text in zip(stages, said)), said


@pytest.mark.parametrize("depth,found", [(0.5, set()), (2.0, {"gouge"})])
def test_gouge_of_half_and_twice_the_tolerance(depth, found):
    v = verdict(z=10.0 - depth * FINISH.gouge_mm)
    assert kinds(v) == found
    assert abs(v.as_dict()["gouge_max_mm"] - depth * FINISH.gouge_mm) < 1e-6


def test_one_deep_pass_is_placed_by_line_and_operation():
    moves = passes(10.0)
    k = next(i for i, m in enumerate(moves) if m[1][1] > 8)
    moves[k] = feed(*moves[k][1][:2], 9.98)
    moves[k + 1] = feed(*moves[k + 1][1][:2], 9.98)
    v = verdict(moves)
    (found,) = [f for f in v.findings if f.kind == "gouge"]
    assert abs(found.amount_mm - 0.02) < 1e-5 and found.operation == "finish"
    assert abs(found.line - (10 + k + 1)) <= 1 and abs(found.place_mm[1] - moves[k][1][1]) < 0.3
    assert any(b.kind == "gouge" for b in v.solids.bodies) and kinds(v) == {"gouge"}


def test_a_gouge_narrower_than_the_samples_is_placed_with_its_depth():
    """A plunge of 4 um leaves a dimple of 0.2 mm radius; samples lie up to 0.6 mm apart."""
    moves = [*passes(10.0), rapid(5.37, 8.05, 14), feed(5.37, 8.05, 9.996), rapid(5.37, 8.05, 14)]
    (found,) = verdict(moves).findings
    assert found.kind == "gouge" and found.amount_mm == pytest.approx(0.004, abs=1e-6)
    assert np.hypot(found.place_mm[0] - 5.37, found.place_mm[1] - 8.05) < 0.01
    assert found.line in (10 + len(moves) - 2, 10 + len(moves) - 1)


def test_the_largest_cusp_is_exact_and_cusps_agree_with_the_formula():
    v = verdict()
    cusp = R - np.sqrt(R**2 - STEP**2 / 4)
    assert v.numbers["cusp_max_mm"] == pytest.approx(cusp, abs=1e-6)
    (row,) = v.as_dict()["cusps"]
    assert row["operation"] == "finish" and row["wanted_mm"] == FINISH.scallop_mm and row["ridges"] > 500
    assert row["share_within_10_percent"] == 1.0 and row["step_mm"]["p50"] == pytest.approx(STEP, abs=1e-6)
    assert cusp <= v.as_dict()["excess_proven_mm"] <= 1.02 * cusp + 2e-4 and v.excess_proof.is_complete
    assert v.numbers["sampling"]["spacing_mm"] == COARSE.spacing_mm and v.numbers["sampling"]["cells"] > 0
    assert Verdict(setups=(v,)).as_dict()["excess_proven_mm"] == v.numbers["excess_proven_mm"]


def test_excess_that_no_sample_and_no_climb_sees_is_found_by_the_proof(monkeypatch):
    """Half a millimetre of one pass is missing: 12.4 um are left on a spot of some hundredths, 12 um are allowed."""
    y = -0.3 + 14 * STEP
    moves = passes(10.0)
    at = next(k for k, m in enumerate(moves) if abs(m[1][1] - y) < 1e-9 and abs(moves[k - 1][1][1] - y) < 1e-9)
    x0, x1 = sorted((moves[at - 1][1][0], moves[at][1][0]))
    lift = [feed(8.1, y, 10), rapid(8.1, y, 14), rapid(8.6, y, 14), feed(8.6, y, 10)]
    moves[at:at] = lift if moves[at][1][0] == x1 else lift[::-1]
    monkeypatch.setattr(residuals, "tops_of", lambda ground, *_: Tops(face=np.zeros(0, int), u=np.zeros(0), v=np.zeros(0),
                                                                      height_mm=np.zeros(0)))
    v = verdict(moves)
    found = [f for f in v.findings if f.kind == "excess"]
    aside = (STEP**2 - 0.25**2) / (2 * STEP)
    highest = R - np.sqrt(R**2 - (STEP - aside)**2)
    assert len(found) in (1, 2) and v.numbers["excess_max_mm"] < 0.0115          # one on either side of the pass
    for f in found:
        assert 0.012 < f.amount_mm <= highest and f.operation == "finish"
        assert abs(f.place_mm[0] - 8.35) < 0.1 and abs(abs(f.place_mm[1] - y) - aside) < 0.1
    assert 0 < v.numbers["sampling"]["unproven_mm2"]["excess"] < 0.01


def test_the_third_view_agrees_or_is_left_out(monkeypatch):
    checked = dataclasses.replace(COARSE, mesh_checks=True)
    if mesh_quality.is_installed():
        v = verdict(options=checked)
        mesh, cusp = v.numbers["mesh"], R - np.sqrt(R**2 - STEP**2 / 4)
        assert v.ok and mesh["design"]["open_edges"] == 0
        assert cusp / 2 < mesh["hausdorff"]["stock_to_design"]["max_mm"] < cusp + mesh["bounds_mm"]["max_mm"]
    monkeypatch.setattr(mesh_quality, "is_installed", lambda: False)
    v = verdict(options=checked)
    assert v.ok and "not installed" in v.numbers["mesh"]["left_out"]


def test_missing_pass_and_missing_area_are_told_apart():
    assert kinds(verdict(passes(10.0, skip=(7.8, 8.2)))) == {"excess"}
    v = verdict(passes(10.0, skip=(5, 12)))
    assert kinds(v) == {"missing_area"}
    d = v.as_dict()
    assert d["area_reached_mm2"] < 250 and d["excess_max_mm"] > 0.5


def test_too_wide_a_step_is_excess_that_both_verifiers_see():
    v = verdict(passes(10.0, step=0.9))
    assert kinds(v) == {"excess"} and len(v.solids.bodies) > 5


def test_missing_retract_turns_into_a_rapid_through_stock():
    moves = passes(10.0)
    v = verdict([*moves[:-1], rapid(26, 8, 10.5), rapid(-6, 8, 10.5)])
    assert kinds(v) == set()                                # over finished stock: nothing is in the way
    v = verdict([rapid(-6, 8, 14), rapid(-6, 8, 10.5), rapid(26, 8, 10.5), rapid(26, 8, 14), *moves])
    assert kinds(v) == {"rapid_through_stock"}
    assert v.as_dict()["collisions"][0]["kind"] == "rapid_through_stock"


def test_program_in_inches_is_far_off():
    small = [(kind, tuple(np.array(end) / 25.4), center, plane) for kind, end, center, plane in passes(10.0)]
    assert "gouge" in kinds(verdict(small))


def test_wrong_sign_of_the_wcs_is_found():
    shifted = [(k, (e[0] - 10, e[1] - 8, e[2] - 10), c, p) for k, e, c, p in passes(10.0)]
    assert kinds(verdict(shifted, origin=(10, 8, 10))) == set()
    assert kinds(verdict(shifted, origin=(-10, 8, 10))) & {"gouge", "missing_area"}


def test_inner_corner_is_unreachable_and_listed():
    step = brep.the_solid(cq.Workplane("XZ").polyline([(0, 0), (20, 0), (20, 10), (12, 10), (12, 5), (0, 5)]).close()
                          .extrude(-12))
    faces = [f for f in brep.faces_of(step) if f.middle.normal[0, 2] > 0.5 or abs(f.middle.point_mm[0, 0] - 12) < 1e-6]
    moves = [rapid(-6, -1, 16)]
    for y in np.arange(-0.3, 12.6, STEP):                    # floor, then rolling over the corner (12, 10)
        moves += [rapid(-6, y, 16), feed(-6, y, 5), feed(7, y, 5), arc((12, y, 10), (12, y, 5), Plane.ZX),
                  feed(26, y, 10), rapid(26, y, 16)]
    d = verdict(moves, solid=step, faces=faces, stock=((0, 0, 0), (20, 12, 11)), ball=R,
                tools={1: tool("ball", 2 * R, flute=15.0)}).as_dict()
    assert d["ok"], d["findings"]
    places = d["unreachable"]
    assert len(places) == 1 and "narrow" in places[0]["reason"]
    assert abs(d["area_unreachable_mm2"] - 2 * 5 * 12) < 4
    assert np.allclose(places[0]["min_mm"], (7, 0, 5), atol=0.6) and np.allclose(places[0]["max_mm"], (12, 12, 10), atol=0.6)


def test_turning_part_and_program_changes_no_number():
    turn = lambda p: (-p[1], p[0], p[2])
    solid = brep.the_solid(cq.Workplane(obj=cq.Shape.cast(BLOCK)).rotate((0, 0, 0), (0, 0, 1), 90))
    moves = passes(9.999)
    turned = [(k, turn(e), turn(c), p) for k, e, c, p in moves]
    a = verdict(moves).as_dict()
    posted = program(turn((-6, -0.3, 40)), turned)
    setup = Setup(name="setup-1", wcs_in_words="corner", faces=("top",))
    b = verify_setup(posted, {1: tool("ball", 2 * R)}, solid, upward(solid), setup=setup, finish=FINISH, ball_radius_mm=3.0,
                     stock=StockBox(min_mm=(-16, 0, 0), max_mm=(0, 20, 12)), options=COARSE).as_dict()
    assert a["ok"] and b["ok"] and abs(a["gouge_max_mm"] - b["gouge_max_mm"]) < 1e-6
    assert abs(a["cusp_max_mm"] - b["cusp_max_mm"]) < 1e-4          # samples fall elsewhere
    assert abs(a["excess_volume_mm3"] - b["excess_volume_mm3"]) < 0.05


def test_same_inputs_give_the_same_numbers_on_any_number_of_threads():
    set_thread_count(1)
    try:
        one = json.dumps(verdict().as_dict())
    finally:
        set_thread_count(numba.config.NUMBA_NUM_THREADS)
    assert json.dumps(verdict().as_dict()) == one


def test_totals_add_up_over_setups():
    good, bad = verdict(), verdict(z=9.99)
    total = Verdict(setups=(good, bad)).as_dict()
    assert not total["ok"] and total["gouge_max_mm"] == pytest.approx(0.01, abs=1e-6)
    assert total["points_checked"] == 2 * good.as_dict()["points_checked"] and len(total["setups"]) == 2


def test_a_blind_verifier_is_a_finding():
    """A body that no sample shows, and volumes that differ, must not pass in silence."""
    v = verdict(z=9.98)
    blind = dataclasses.replace(v.residuals, deviation_mm=np.zeros(len(v.residuals.samples)))
    setup = Setup(name="setup-1", wcs_in_words="corner", faces=("top",))
    cut = SetupProgram(posted=program((-6, -0.3, 40), passes(9.98)), setup=setup, faces=())
    report = Reporter(cut, FINISH, blind, blind, None, blind)
    found = list(report.disagreements(v.solids, 0.2, v.error_bounds_mm))
    assert {f.kind for f in found} == {"verifiers_disagree"}
    quiet = dataclasses.replace(v.solids, bodies=(), volumes=dataclasses.replace(v.solids.volumes, gouge_mm3=(0.0, 0.0)))
    report = Reporter(cut, FINISH, v.residuals, v.residuals, None, v.residuals)
    assert [f.kind for f in report.disagreements(quiet, 0.2, v.error_bounds_mm)] == ["verifiers_disagree"]


def test_faces_of_another_solid_are_refused():
    other = brep.the_solid(cq.Workplane().box(20, 16, 10, centered=False))
    with pytest.raises(InputError, match="very solid"):
        verdict(faces=upward(other))


def test_walls_are_found_in_the_mesh():
    from cuspline.kernel.tessellation import tessellate
    mesh = tessellate(BLOCK, 0.01)
    xs, ys = upright_walls(mesh.vertices_mm, mesh.triangles)
    assert np.allclose(xs, [0, 20]) and np.allclose(ys, [0, 16])


# several clampings -------------------------------------------------------------------------------------

TURNED = Setup(name="setup-2", wcs_in_words="far corner", faces=("bottom",), wcs_origin_mm=(0, 16, 0), wcs_z=(0, 0, -1))


UPRIGHT = Setup(name="setup-1", wcs_in_words="corner", faces=("top",))
DOWNWARD = tuple(f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] < -0.5)


def clampings(*steps):
    """Verdict on the block after (moves, setup, faces) one after the other; the billet stands 2 mm beyond both sides."""
    programs = [SetupProgram(posted=program((-6, -0.3, 40), moves), setup=setup, faces=faces) for moves, setup, faces in steps]
    return Verdict(setups=verify_setups(programs, BLOCK, Judging(
        tools={1: tool("ball", 2 * R)}, stock=StockBox(min_mm=(0, 0, -2), max_mm=(20, 16, 12)), finish=FINISH,
        ball_radius_mm=3.0, options=COARSE)))


def two_clampings(below):
    """The block's top cut from above, then its bottom in the turned part."""
    return clampings((passes(10.0), UPRIGHT, tuple(upward(BLOCK))), (passes(below), TURNED, DOWNWARD))


def test_a_block_cut_from_both_sides_is_verified():
    v = two_clampings(below=0.0)
    assert v.ok and len(v.setups) == 2
    one, other = (s.numbers for s in v.setups)
    cusp = R - np.sqrt(R**2 - STEP**2 / 4)
    assert other["cusp_max_mm"] == pytest.approx(one["cusp_max_mm"], abs=2e-4) and cusp - 3e-4 < one["cusp_max_mm"] <= cusp + 1e-6
    assert abs(one["excess_volume_mm3"] - other["excess_volume_mm3"]) < one["excess_volume_bound_mm3"]
    assert min(one["verifiers"]["compared_area_mm2"], other["verifiers"]["compared_area_mm2"]) > 100


def test_a_clamping_answers_for_gouges_on_faces_of_another():
    """The second program goes through the part: the top that the first has finished is gone."""
    v = two_clampings(below=-11.0)
    first, second = v.setups
    assert {f.setup for f in v.findings if f.kind == "gouge"} == {"setup-2"}
    assert "verifiers_disagree" not in {f.kind for f in v.findings}
    # the block is 10 high
    assert first.numbers["gouge_max_mm"] == second.numbers["gouge_max_mm"] == pytest.approx(5.0, abs=1e-4)
    assert first.numbers["gouge_volume_mm3"] == 0 and second.numbers["gouge_volume_mm3"] == pytest.approx(3200, rel=1e-3)


def test_what_one_clamping_leaves_another_may_take():
    top, gap = tuple(upward(BLOCK)), (5.0, 9.0)
    strip = [rapid(-6, 4.5, 14), *raster((-6, 26), np.arange(4.5, 9.6, STEP), 10.0), rapid(26, 9.3, 14)]
    left = clampings((passes(10.0, skip=gap), UPRIGHT, top))
    assert kinds(left) == {"missing_area"}
    again = UPRIGHT.model_copy(update={"name": "setup-2"})
    assert clampings((passes(10.0, skip=gap), UPRIGHT, top), (strip, again, top)).ok


def test_the_second_clamping_is_replayed_on_what_the_first_has_left():
    v = two_clampings(below=0.0)
    assert v.setups[1].replay.final_z_mm.max() < 0.01
    assert v.setups[0].replay.final_z_mm.min() > 9.99
