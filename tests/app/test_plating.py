"""Metal that is plated later: cut and judged so much below the drawing, whatever cuts it."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_programs import feed, program, tool
from scipy.spatial import cKDTree

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Finish, Setup
from cuspline.design.job import read_job
from cuspline.kernel import brep
from cuspline.planning.plating import TYPES, library_within_skin, within_skin
from cuspline.planning.strategies.auto import Auto
from cuspline.stock.swept import deviation_mm, stock_height_mm, swept_paths
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.values.errors import DesignError, InputError, PlanError
from cuspline.verification.certificate import certify, solid_in_wcs
from cuspline.verification.reach import REACHABLE
from cuspline.verification.verdict import Judging, Options, SetupProgram, first_look, verify_setups

SOURCE_MM = 0.0508          # 2 mil of plating
DISH = Path(__file__).parents[1] / "parts" / "small_dish.py"
COARSE = Options(spacing_mm=0.25, solid_pitch_mm=0.4, replay_pitch_mm=0.5)


def built(folder, design, source):
    """The folder of a design posted with what comes with cuspline."""
    made = recipe.build(recipe.Order(source=source, design=design, accepted=(), out=folder, last_stage="gcode",
                                     machine=catalogue.find_machine(design.machine), library=catalogue.find_library(None)))
    assert made.findings == ()
    return folder


def off_by(folder, register_mm):
    """The finish's tool radius register changed in the text; the findings' kinds and the two amounts."""
    path = folder / "setup-1.ngc"
    whole = path.read_text()
    rows = re.findall(r"#101=([\d.]+)", whole)
    assert float(rows[-1]) == pytest.approx(8.0 - SOURCE_MM)
    path.write_text(whole.replace(f"#101={rows[-1]}", f"#101={float(rows[-1]) + register_mm:.4f}"))
    judged = judge(folder, read_job(folder), options=COARSE)
    path.write_text(whole)
    numbers = judged.as_dict(())
    return {f.kind for f in judged.findings}, numbers["gouge_max_mm"], numbers["excess_max_mm"]


def test_the_sources_plating_is_verified_against_the_metal_and_a_register_off_by_ten_micrometres_is_red(tmp_path):
    """Crandall and Stovall's register: the finish's is smaller than the ball by the plating; +-0.0025 mm is kept."""
    source = catalogue.find_design("rfq_vane")
    design = catalogue.make_design(source, [
        "from_mm=150", "to_mm=152", "strategy=transverse_arcs", f"plating_mm={SOURCE_MM}", "scallop_mm=0.012", "axis_height_mm=70",
        "grip_mm=15"])
    assert design.finish.gouge_mm == 0.0025 and design.finish.plating_mm == SOURCE_MM
    folder = built(tmp_path / "vane", design, source)
    assert f"(PLATED ON LATER {SOURCE_MM:g}: THE METAL IS CUT SO MUCH BELOW" in (folder / "setup-1.ngc").read_text()
    assert off_by(folder, 0.0)[0] == set()
    kinds, gouge, excess = off_by(folder, -0.010)
    assert "gouge" in kinds and gouge == pytest.approx(0.010, abs=2e-4)
    kinds, gouge, excess = off_by(folder, 0.010)
    assert "excess" in kinds and excess == pytest.approx(0.020, abs=2e-3) and gouge < 1e-4


@pytest.mark.parametrize("strategy", ["sections", "constant_scallop"])
def test_every_strategy_cuts_the_metal_so_much_below_the_drawing(strategy, tmp_path):
    """Asked twice: as the verdict does, and of the metal with whole cutters at points that lie so much deeper."""
    source = catalogue.find_design(str(DISH))
    plain = catalogue.make_design(source, [])
    setup = plain.setups[0].model_copy(update={"operations": (Auto(strategy=strategy),)})
    design = replace(plain, setups=(setup,), finish=plain.finish.model_copy(update={"plating_mm": SOURCE_MM}))
    order = recipe.Order(source=source, design=design, accepted=(), out=tmp_path / "dish", last_stage="gcode",
                         machine=catalogue.find_machine(design.machine), library=catalogue.find_library(None))
    plan, = recipe._planned(order, lambda text: None)
    tools = {o.tool.number: o.tool for o in plan.operations}
    assert all(t in order.library.tools for t in tools.values())
    posted, solid = recipe._as_posted(order, plan), brep.the_solid(design.solid, "dish")
    faces = tuple(brep.select_faces(brep.faces_of(solid), design.predicates[0]))
    program = SetupProgram(posted=posted, setup=plan.setup, faces=faces)
    (found, _), = first_look((program,), solid, Judging(tools=tools, stock=design.stock, finish=design.finish,
                                                          ball_radius_mm=2.0, options=COARSE)).residuals
    good = found.reach == REACHABLE
    allowed = design.finish.scallop_mm + design.finish.profile_tolerance_mm
    assert found.deviation_mm.min() > -design.finish.gouge_mm and found.deviation_mm[good].max() < allowed
    s = found.samples
    low, high = np.array(design.stock.min_mm) + 0.1, np.array(design.stock.max_mm) - 0.1      # deeper points stay in the stock
    # beside an outer edge the metal's faces end before the drawing's do
    inner = good & (cKDTree(s.points_mm[s.is_border]).query(s.points_mm)[0] > 4 * SOURCE_MM)
    inner &= ((s.points_mm > low) & (s.points_mm < high)).all(axis=1)
    metal = deviation_mm(swept_paths(posted, tools), design.stock.min_mm, design.stock.max_mm,
                         s.points_mm[inner] - SOURCE_MM * s.normals[inner], s.normals[inner], 2.0)
    assert -design.finish.gouge_mm < metal.min() and metal.max() < allowed
    # cusps of the smaller ball are steeper: by the plating over the radius, and never lower
    assert (metal - found.deviation_mm[inner]).max() < 2e-6
    assert (found.deviation_mm[inner] - metal).max() < 2 * SOURCE_MM / 2.0 * allowed + 1e-4


@pytest.mark.parametrize("kind, corner", [("ball", None), ("bull_nose", 1.0), ("bull_nose", 0.03), ("flat", None)])
def test_a_tool_less_its_skin_sweeps_what_the_whole_one_sweeps_less_that_skin(kind, corner):
    moves = [feed(-8, 1, 3), feed(9, 2, -1), feed(9, -4, -2)]
    whole = tool(kind, 8.0, corner)
    lifted = [(k, tuple(np.add(e, (0, 0, SOURCE_MM))), c, p) for k, e, c, p in moves]
    one, = swept_paths(program((0, 0, 5), moves), {1: whole})
    other, = swept_paths(program((0, 0, 5 + SOURCE_MM), lifted), {1: within_skin(whole, SOURCE_MM)})
    one = one.grown(-SOURCE_MM)
    assert (one.flat_radius_mm, one.corner_radius_mm) == pytest.approx((other.flat_radius_mm, other.corner_radius_mm), abs=1e-12)
    xy = np.random.default_rng(1).uniform(-12, 12, (2000, 2))
    heights = [stock_height_mm((path,), xy, 5.0) for path in (one, other)]
    assert (heights[0] < 5.0).sum() > 500 and np.abs(heights[0] - heights[1]).max() < 1e-9


def test_the_certificate_leaves_the_skin_out():
    block = brep.the_solid(brep.the_solid(_block(), "block"))
    posted = program((0, 5, 20), [feed(0, 5, 10 - SOURCE_MM - 0.002), feed(20, 5, 10 - SOURCE_MM - 0.002)])
    part = ExactPart.of_solid(solid_in_wcs(block, Setup(name="s", wcs_in_words="", faces=("top",)).frame))
    bound = lambda **asked: certify(posted, {1: tool("ball", 6.0)}, part, tolerance_mm=5e-4, **asked).proven_mm
    assert bound(skin_mm=SOURCE_MM) == pytest.approx(0.002, abs=5e-4)
    assert bound() == pytest.approx(SOURCE_MM + 0.002, abs=2e-3)


def _block():
    import cadquery as cq
    return cq.Workplane().box(20, 10, 10, centered=False)


def test_a_plating_that_no_cutter_has_is_refused():
    library = catalogue.find_library(None)
    assert {t.cutter.type for t in library_within_skin(library, SOURCE_MM).tools} <= set(TYPES)
    with pytest.raises(PlanError, match="no cutter of the library is more than twice as wide"):
        library_within_skin(library, 40.0)
    finish = Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003, plating_mm=0.9)
    with pytest.raises(InputError, match="plating_mm 0.9 is no thinner than the smallest ball, of radius 0.5 mm"):
        verify_setups((), brep.the_solid(_block()), Judging(tools={}, stock=None, finish=finish, ball_radius_mm=0.5))


def test_a_plating_of_nothing_leaves_no_trace_and_an_allowance_that_sections_cannot_leave_is_refused():
    finish = Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003)
    assert "plating_mm" not in finish.model_dump()
    assert finish.model_copy(update={"plating_mm": 0.1}).model_dump()["plating_mm"] == 0.1
    with pytest.raises(DesignError, match="allowance_mm 0.3 is what the rough passes of transverse_arcs leave"):
        catalogue.make_design(catalogue.find_design("rfq_vane"), ["allowance_mm=0.3", "from_mm=150", "to_mm=152"])
