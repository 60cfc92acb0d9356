"""Turned blanks, castings, meshes, tilted blocks and fixtures of any form, from the design to the verdict."""

import json
import shutil
import tomllib
from dataclasses import replace
from functools import partial

import cadquery as cq
import numpy as np
import pytest
import stock_parts
from known_programs import program, rapid

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import (
    FixtureCylinder,
    FixtureSolid,
    StockAllowance,
    StockBox,
    StockCylinder,
    StockMesh,
    StockSkin,
    StockSolid,
)
from cuspline.design.job import read_job
from cuspline.design.stock import settled
from cuspline.kernel import brep
from cuspline.kernel.solids import stl_of
from cuspline.planning.plan import plan_setup
from cuspline.planning.preflight import refuse_impossible_setups
from cuspline.replay.replay import replay
from cuspline.replay.scene import FoundStock, Surroundings, ZMap
from cuspline.shop.practice import Practice
from cuspline.stock.shapes import BoxShape
from cuspline.stock.workpiece import Workpiece
from cuspline.values.errors import DesignError, InputError, PlanError
from cuspline.verification.verdict import verify_setup

MACHINE, LIBRARY = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
ROUNDED_MM = 1e-6           # of the numbers of a verdict

CASTING_JOB = """step = "part.step"
material = "aluminium_6061"
stock = { step = "raw.step" }
finish = { scallop_mm = 0.06, profile_tolerance_mm = 0.006, gouge_mm = 0.008 }

[[faces]]
name = "crown"
count = 1
kinds = ["cylinder"]
center_min_mm = [0, 0, 5.5]

[[setups]]
name = "setup-1"
wcs_in_words = "corner of the foot, Z0 on the base"
faces = ["crown"]

[[setups.fixtures]]
name = "stop"
on = "table"
from_mm = [-12, 4, -5]
to_mm = [-12, 4, 12]
diameter_mm = 6
"""


def planned(design, **changes):
    """(SetupPlan, PostedMoves, {number: Tool}) of a design's first setup."""
    plan = plan_setup(design, replace(design, **changes).setups[0], MACHINE, LIBRARY)
    tools = {o.tool.number: o.tool for o in plan.operations}
    return plan, recipe._as_posted(stock_parts.order(design, None), plan), tools


def judged(design, posted, tools, options=stock_parts.COARSE):
    """SetupVerdict of its first setup's program."""
    faces = tuple(f for p in design.predicates for f in brep.select_faces(brep.faces_of(design.solid), p))
    return verify_setup(posted, tools, design.solid, faces, setup=design.setups[0], stock=design.stock,
                        finish=design.finish, ball_radius_mm=0.5, machine=MACHINE, options=options)


def as_a_solid(design):
    return replace(design, solid=brep.the_solid(design.solid))


def test_a_casting_out_of_a_step_file_is_cut_and_judged_wherever_its_folder_lies(tmp_path):
    part, raw = stock_parts.cast()
    for name, shape in (("part", part), ("raw", raw)):
        brep.write_step(brep.the_solid(shape), tmp_path / f"{name}.step", name)
    (tmp_path / "casting.toml").write_text(CASTING_JOB)
    design = catalogue.make_design(catalogue.find_design(str(tmp_path / "casting.toml")), [])
    result = recipe.build(stock_parts.order(design, tmp_path / "out"))
    (tmp_path / "raw.step").unlink()
    folder = tmp_path / "elsewhere" / "out"
    shutil.copytree(result.folder, folder)
    found = judge(folder, read_job(folder), options=stock_parts.COARSE)
    assert found.findings == () and found.verdict.setups[0].error_bounds_mm["stock_mm"] <= 0.01
    numbers = found.verdict.as_dict()
    assert numbers["area_reached_mm2"] == pytest.approx(numbers["area_required_mm2"])
    text, plan = (folder / "setup-1.ngc").read_text(), json.loads((folder / "plan.json").read_text())
    assert "(STOCK aluminium_6061: SOLID casting.stock.step, WITHIN X-4.000 Y0.000 Z0.000 TO X12.000 Y9.000 Z7.900)" in text
    assert plan["stock"]["step"] == "casting.stock.step" and plan["stock"]["max_mm"] == [12, 9, 7.9]
    assert plan["setups"][0]["clearance_z_mm"] == pytest.approx(12 + Practice().clearance_mm, abs=0.01)     # over the stop
    last = list(found.stock_states())[-1]
    volumes = [brep.volume_mm3(brep.the_solid(s)) for s in (part, raw)]
    assert volumes[0] * 0.999 < last.solid.volume() < volumes[1] - 0.9 * (volumes[1] - volumes[0])
    (folder / "casting.stock.step").write_text("damaged")
    with pytest.raises(InputError, match="casting.stock.step is not a readable STEP file"):
        judge(folder, read_job(folder), options=stock_parts.COARSE)


def test_a_turned_blank_is_cut_and_judged():
    design = as_a_solid(stock_parts.turned_blank())
    plan, posted, tools = planned(design)
    found = judged(design, posted, tools)
    assert found.findings == ()
    assert found.numbers["area_reached_mm2"] == pytest.approx(found.numbers["area_required_mm2"])
    assert plan.clearance_z_mm == pytest.approx(8.7 + Practice().clearance_mm)


@pytest.mark.parametrize("part", ["about_z", "on_its_side"])
def test_a_tilted_setup_is_the_turned_part_in_a_straight_one(part):
    """Turned by 45 degrees about Z, on its side by 37 about X: the same program, the same cut, the same verdict."""
    tilted = as_a_solid(getattr(stock_parts, part)())
    straight = stock_parts.lying_turned(tilted)
    turn, (one, other) = tilted.setups[0].turn, [planned(d)[1:] for d in (tilted, straight)]
    assert len(one[0]) == len(other[0])
    np.testing.assert_allclose(other[0].end_mm, one[0].end_mm, atol=1e-6)
    np.testing.assert_allclose(np.nan_to_num(other[0].center_mm), np.nan_to_num(one[0].center_mm), atol=1e-6)
    here, there = (judged(d, *program) for d, program in ((tilted, one), (straight, other)))
    assert here.findings == there.findings == ()
    samples = here.residuals.samples            # at the stock's own walls a line along a normal may leave it at once
    points, normals = samples.points_mm[~samples.is_border], samples.normals[~samples.is_border]
    left = [v.stock.piece.deviations(*at, 2.0)[0] for v, at in (
        (here, (points, normals)), (there, (turn.into(points), turn.turn_into(normals))))]
    np.testing.assert_allclose(left[1], left[0], atol=1e-6)
    for name in ("gouge_max_mm", "excess_max_mm", "cusp_max_mm", "area_required_mm2", "area_reached_mm2"):
        assert there.numbers[name] == pytest.approx(here.numbers[name], abs=2 * ROUNDED_MM), name
    volumes = [v.stock.stock(recipe.PART).volume() for v in (here, there)]
    assert volumes[1] == pytest.approx(volumes[0], rel=2e-3)                  # two grids


SLOPE = np.tan(np.radians(37.0))


@pytest.mark.parametrize("part, stock, edge_mm, top_mm", [
    ("about_z", StockCylinder(from_mm=(0, 4, 4), to_mm=(12, 4, 4), diameter_mm=14), 8.0, 4 + np.sqrt(33)),
    ("on_its_side", None, 8.0, 7.3 * np.cos(np.radians(37)) - SLOPE * (8.0 - 7.3 * np.sin(np.radians(37))))],
    ids=["lying bar", "tilted block"])
def test_a_rapid_is_held_against_the_stock_that_is_there_and_not_against_the_box_round_it(part, stock, edge_mm, top_mm):
    """Along X beside the highest place; the cutter's side runs over `edge_mm`, where the stock stands `top_mm` high."""
    design = getattr(stock_parts, part)()
    frame, piece = recipe.PART if stock else design.setups[0].frame, Workpiece(blank=(stock or design.stock).shape)
    (low, high), pitch = piece.box_in(frame), 0.1
    assert high[2] > top_mm + 1
    zmap, tool = ZMap.over(low, high, pitch), next(iter(LIBRARY.of_type("flat")))
    y, far = edge_mm + tool.cutter.radius_mm, tool.cutter.radius_mm + 20
    for over, want in ((0.6, []), (-0.3, ["rapid_through_stock"])):
        posted = program((far, y, 60), [rapid(far, y, top_mm + over), rapid(-far, y, top_mm + over), rapid(-far, y, 60)],
                         tool_number=tool.number)
        before = FoundStock(min_mm=low, max_mm=high, pitch_mm=pitch, within_mm=partial(piece.highest_within_mm, frame),
                            top_mm=piece.heights_mm(frame, zmap.xy_mm).reshape(zmap.shape))
        found = replay(posted, {tool.number: tool}, before, around=Surroundings(machine=MACHINE)).findings
        found = [f for f in found if f.kind.startswith("rapid")]
        assert [f.kind for f in found] == want
        assert all(0.3 - pitch * SLOPE - 1e-3 <= f.amount_mm <= 0.3 + 1e-6 for f in found)         # at a node


# what cannot be ------------------------------------------------------------------------------------


def refused(stock):
    """What preflight says of the crowned block with a stock."""
    design = replace(stock_parts.about_z(), stock=stock)
    refuse_impossible_setups(design, brep.the_solid(design.solid), MACHINE, LIBRARY)


def write_stl(path, shape):
    path.write_bytes(stl_of(shape.solid))
    return path.name


def test_a_stock_lower_than_the_part_is_refused_whatever_it_is(tmp_path):
    """The part is 7 high, 12 long, 9 wide."""
    short = cq.Workplane("XY").box(12, 9, 6.5, centered=False)
    cave = cq.Workplane("XY").box(14, 11, 9, centered=False).translate((-1, -1, -1)).cut(
        cq.Workplane("XY").box(3, 3, 3).translate((6, 4.5, 6.5)))
    mesh = StockMesh(stl=write_stl(tmp_path / "low.stl", BoxShape(min_mm=(0, 0, 0), max_mm=(12, 9, 6.75)))).beside(tmp_path)
    for stock, words in (
            (StockBox(min_mm=(0, 0, 0), max_mm=(12, 9, 6.5)), "the part reaches Z 0.000 .. 7.000 mm, its stock only 0 .. 6.5"),
            (StockCylinder(from_mm=(-1, 4.5, 3.5), to_mm=(13, 4.5, 3.5), diameter_mm=11), r"0.20\d mm out of its stock "
             r"\(cylinder d11 x 14\)"),
            (StockSolid(solid=short), "0.500 mm out of its stock"), (mesh, r"0.250 mm out of its stock \(mesh low.stl\)"),
            (StockSolid(solid=cave), r"out of its stock \(solid made in code\).*enlarge the stock")):
        with pytest.raises(PlanError, match=words):
            refused(stock)
    refused(StockCylinder(from_mm=(-1, 4.5, 3.5), to_mm=(13, 4.5, 3.5), diameter_mm=11.5))
    refused(StockSolid(solid=cq.Workplane("XY").box(12, 9, 7, centered=False)))


def test_files_that_hold_no_closed_body_are_refused_in_a_sentence(tmp_path):
    block = BoxShape(min_mm=(0, 0, 0), max_mm=(5, 5, 5))
    whole = stl_of(block.solid)
    (tmp_path / "open.stl").write_bytes(whole[:80] + np.uint32(11).tobytes() + whole[84:-50])
    (tmp_path / "cut.stl").write_bytes(whole[:-10])
    (tmp_path / "words.stl").write_text("solid nothing\nvertex 1 2 x\n")
    (tmp_path / "words.step").write_text("no step")
    surface = cq.Workplane("XY").rect(5, 5).extrude(2).faces(">Z").val()
    cq.exporters.export(cq.Workplane(obj=surface), str(tmp_path / "face.step"))
    for stock, error, words in (
            (StockMesh(stl="none.stl"), InputError, "STL file .*none.stl does not exist"),
            (StockMesh(stl="cut.stl"), InputError, "cut.stl is not a readable STL file: export it anew"),
            (StockMesh(stl="words.stl"), InputError, "words.stl is not a readable STL file"),
            (StockMesh(stl="open.stl"), DesignError, "open.stl is no closed solid: it is open, 3 sides of its 11 triangles"),
            (StockSolid(step="none.step"), InputError, "STEP file .*none.step does not exist"),
            (StockSolid(step="words.step"), InputError, "words.step is not a readable STEP file"),
            (StockSolid(step="face.step"), InputError, "face.step holds no solid"),
            (FixtureSolid(name="clamp", step="none.step"), InputError, "none.step does not exist")):
        with pytest.raises(error, match=words):
            stock.beside(tmp_path).shape
    with pytest.raises(ValueError, match="name the solid's file as `step`"):
        StockSolid()


def test_an_stl_file_is_the_same_as_text_and_as_bytes(tmp_path):
    block = BoxShape(min_mm=(0, 0, 0), max_mm=(5, 4, 3))
    write_stl(tmp_path / "bytes.stl", block)
    corners = block.mesh[0][block.mesh[1]]
    (tmp_path / "text.stl").write_text("solid block\n" + "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join("vertex {:e} {:e} {:e}\n".format(*p) for p in t) + "endloop\nendfacet\n"
        for t in corners) + "endsolid\n")
    shapes = [StockMesh(stl=name).beside(tmp_path).shape for name in ("bytes.stl", "text.stl")]
    assert [s.solid.volume() for s in shapes] == [pytest.approx(60)] * 2 and all(len(s.mesh[0]) == 8 for s in shapes)


# a skin round the part ----------------------------------------------------------------------------


def test_a_skin_round_a_ball_and_a_block_is_as_thick_as_stated_everywhere(tmp_path):
    """Volumes in closed form; distances of the skin's corners from the part are the thickness, or more at outer edges."""
    ball = settled(StockSkin(skin_mm=1.0), brep.the_solid(cq.Workplane().sphere(8).val()), Practice())
    block = settled(StockSkin(skin_mm=1.0), brep.the_solid(cq.Workplane().box(10, 8, 6).val()), Practice())
    assert ball.shape.solid.volume() == pytest.approx(4 / 3 * np.pi * 9 ** 3, rel=0.02)
    assert block.shape.solid.volume() == pytest.approx(12 * 10 * 8, rel=0.005)
    away = np.linalg.norm(ball.shape.mesh[0], axis=1)
    assert away.min() >= 9.0 and away.max() <= 9.3
    kept = ball.written(tmp_path, "skin")
    assert kept.model_dump() == {"stl": "skin.stl"} and kept.shape.solid.volume() == pytest.approx(ball.shape.solid.volume())


def test_a_skin_that_meets_itself_in_a_slot_is_refused():
    slotted = cq.Workplane().box(20, 20, 10).faces(">Z").workplane().rect(1.5, 30).cutBlind(-5)
    with pytest.raises(DesignError, match="a skin of 1 mm round the part meets itself at X.* make it thinner"):
        settled(StockSkin(skin_mm=1.0), brep.the_solid(slotted.val()), Practice())
    assert settled(StockSkin(skin_mm=0.5), brep.the_solid(slotted.val()), Practice())


# as it is told ------------------------------------------------------------------------------------


def test_a_design_without_a_stock_gets_the_box_round_it_and_the_shops_allowance():
    design = replace(stock_parts.about_z(), stock=StockAllowance())
    part = brep.the_solid(design.solid)
    assert settled(design.stock, part, Practice()).model_dump() == {
        "min_mm": (-2, -2, -2), "max_mm": (14, 11, 9), "allowance_mm": 2.0}
    assert settled(design.stock, part, Practice(stock_allowance_mm=3)).max_mm == (15, 12, 10)
    assert settled(StockAllowance(allowance_mm=0.5), part, Practice()).min_mm == (-0.5, -0.5, -0.5)
    assert settled(stock_parts.about_z().stock, part, Practice()) is not None
    assert recipe._stock_document(settled(design.stock, part, Practice())) == {
        "kind": "BOX ROUND THE PART AND 2", "min_mm": [-2, -2, -2], "max_mm": [14, 11, 9], "allowance_mm": 2, "deviation_mm": 0}


@pytest.mark.parametrize("given, kind", [
    ("{ min_mm = [0, 0, 0], max_mm = [1, 2, 3] }", "StockBox"), ('{ step = "raw.step" }', "StockSolid"),
    ("{ from_mm = [0, 0, 0], to_mm = [0, 0, 9], diameter_mm = 20 }", "StockCylinder"), ('{ stl = "raw.stl" }', "StockMesh"),
    ("{ allowance_mm = 1.5 }", "StockAllowance"), ("{ skin_mm = 0.8 }", "StockSkin")])
def test_a_job_file_says_what_its_stock_is_by_what_it_says_of_it(given, kind):
    job = catalogue.JobFile.model_validate({**tomllib.loads(CASTING_JOB), "stock": tomllib.loads(f"a = {given}")["a"]})
    assert type(job.stock).__name__ == kind
    assert type(catalogue.JobFile.model_validate(job.model_dump()).stock).__name__ == kind
    assert isinstance(job.setups[0].fixtures[0], FixtureCylinder)


@pytest.mark.parametrize("given, words", [
    ("{ diameter_mm = 20, to_mm = [0, 0, 9] }", "stock.from_mm: it is missing"),
    ("{ diameter_mm = 20, to_mm = [0, 0, 9], from_mm = [0, 0, 9] }", "stock: a cylinder has two ends"),
    ('{ step = "raw.step", radius_mm = 3 }', "stock.radius_mm: there is no such key"),
    ("{ min_mm = [0, 0, 0], max_m = [1, 1, 1] }", "stock.max_m: there is no such key; did you mean max_mm?"),
    ("{ }", "stock.min_mm: it is missing")])
def test_a_stock_that_is_told_wrongly_is_refused_by_its_key(tmp_path, given, words):
    (tmp_path / "job.toml").write_text(CASTING_JOB.replace('{ step = "raw.step" }', given))
    with pytest.raises(InputError, match=words):
        catalogue.find_design(str(tmp_path / "job.toml"))
