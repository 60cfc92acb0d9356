"""Clean-up where no other pass comes by: a hollow as round as the ball, which stands in it at one place only."""

from dataclasses import replace
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from known_programs import program, raster, tool

from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, FixtureCylinder, Parameters, Setup, StockBox, StockSkin
from cuspline.design.stock import settled
from cuspline.kernel import brep
from cuspline.planning.clean_up import _chained, _fall_together, clean_up, squarely_touched
from cuspline.planning.context import HELD_BY_MM, MADE_AGAIN, PlanningContext
from cuspline.planning.standing_skin import PATCH_MM, StandingSkin, halved_until
from cuspline.planning.strategies.rest import Rest
from cuspline.planning.tool_depth import HOLDER_CLEARANCE_MM, SHANK_CLEARANCE_MM, is_clear_above
from cuspline.shop.practice import Practice
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm

RADIUS_MM = 4.0
HIGH_MM, LONG_MM = 10.0, 16.0
AMONG_OTHERS = {"indexed": True, "clamped_x": (1, 0, 0), "clamped_z": (0, 0, 1), "operations": (Rest(leave_steep=True),)}
ASKED = Finish(scallop_mm=0.01, profile_tolerance_mm=0.0025, gouge_mm=0.003)


@pytest.fixture(scope="module")
def context():
    """A block with a groove along X, of the same radius as the ball that is to cut it."""
    groove = cq.Workplane("YZ").center(0, HIGH_MM + 1.0).circle(RADIUS_MM).extrude(LONG_MM)
    block = cq.Workplane().box(LONG_MM, 16, HIGH_MM, centered=(False, True, False)).cut(groove)
    setup = Setup(name="top", faces=("groove",), wcs_in_words="middle of the left edge, on the base")
    design = Design(name="grooved", description="block with a groove", parameters=Parameters(), solid=block.val(), setups=(setup,),
                    predicates=(FacePredicate(name="groove", count=1, kinds=("cylinder",)),), material="aluminium_6061",
                    stock=StockBox(min_mm=(0, -8, 0), max_mm=(LONG_MM, 8, HIGH_MM)), finish=ASKED)
    return PlanningContext(design, setup, catalogue.find_machine(design.machine), catalogue.find_library(None))


def left_mm(moves, places_mm):
    """(n,) distance of places from a ball that goes along moves, brute force."""
    ends = np.vstack([moves.start_mm, moves.end_mm]) + (0, 0, RADIUS_MM)
    start, way = ends[:-1], np.diff(ends, axis=0)
    share = ((places_mm[:, None] - start) * way).sum(axis=2) / np.maximum((way * way).sum(axis=1), 1e-12)
    on_way = start + np.clip(share, 0.0, 1.0)[..., None] * way
    return np.linalg.norm(on_way - places_mm[:, None], axis=2).min(axis=1) - RADIUS_MM


def test_a_groove_as_round_as_the_ball_is_cut_by_a_pass_along_its_middle(context):
    """No step aside helps there: beside its middle the ball stands on the rims."""
    ball = next(t for t in context.library.of_type("ball") if t.cutter.radius_mm == RADIUS_MM)
    around, along = (a.ravel() for a in np.meshgrid(np.radians(np.linspace(-60, 60, 25)), np.linspace(5.0, 9.0, 33)))
    places = np.column_stack([along, RADIUS_MM * np.sin(around), HIGH_MM + 1.0 - RADIUS_MM * np.cos(around)])
    (added,), touched = clean_up(context, [SimpleNamespace(tool=ball)], places, 0.1, 1)
    assert added.tool is ball and touched.all()
    left = left_mm(added.moves, places)
    assert left.max() < 0.3 * ASKED.scallop_mm and left.min() > -ASKED.gouge_mm
    assert len(added.moves) < 200


def test_a_tool_keeps_clear_of_the_skin_of_a_casting_on_faces_that_its_setup_does_not_cut(context):
    """In the groove the neck, thinner than the ball, begins 0.5 mm under the top of the block: that stays as cast."""
    skin = settled(StockSkin(skin_mm=0.9), brep.the_solid(context.design.solid), Practice())
    work = PlanningContext(replace(context.design, stock=skin), context.setup, context.machine, context.library)
    roughed = Practice().rough_allowance_mm
    (_, on_part, _), (_, beside, _) = work.beside_tools
    assert [standing for _, standing, _ in context.beside_tools] == [on_part] == [roughed] and beside == skin.thickest_mm >= 0.9
    ball = next(t for t in work.library.of_type("ball") if t.cutter.radius_mm == RADIUS_MM)
    tip = np.array([[8.0, 0.0, HIGH_MM - 0.5 - ball.non_cutting_frusta()[0, 0]]])
    assert context.missing_mm(ball, tip) == [0.0]
    assert work.missing_mm(ball, tip) == pytest.approx([0.5 + SHANK_CLEARANCE_MM + beside], abs=1e-9)
    assert work.missing_mm(ball, tip, 0.2) == pytest.approx([0.5 + SHANK_CLEARANCE_MM + beside + 0.2], abs=1e-9)


def test_a_casting_s_skin_stands_no_more_where_an_earlier_setup_has_cut(context):
    """The top is milled where y is above 1, by a flat cutter of 2 mm: beside the groove and before it as cast, behind it clean."""
    skin = settled(StockSkin(skin_mm=0.9), brep.the_solid(context.design.solid), Practice())
    cut = program((-9, -9, 40), raster((-5.0, LONG_MM + 5.0), [2.0 + k for k in range(10)], HIGH_MM))
    piece = Workpiece(blank=skin.shape).after(context.setup.frame, swept_paths(cut, {1: tool("flat", 2)}))
    work = PlanningContext(replace(context.design, stock=skin), context.setup, context.machine, context.library, piece)
    _, (as_cast, _, _) = work.beside_tools
    middles, level = as_cast.corners_mm.mean(axis=1), np.ptp(as_cast.corners_mm[:, :, 2], axis=1) < 1e-9
    top = middles[level & (middles[:, 2] > HIGH_MM - 1e-9)]
    assert len(top) and top[:, 1].max() < 1.0 + PATCH_MM and (top[:, 1] < -RADIUS_MM + PATCH_MM).any()
    assert as_cast.corners_mm[:, :, 2].min() == pytest.approx(0.0, abs=1e-9)            # the base is


def test_faces_that_no_position_cuts_are_not_asked_whether_their_skin_still_stands(context):
    """The same cut takes the skin off the top, which no setup names: in a position among others it counts as cast."""
    skin = settled(StockSkin(skin_mm=0.9), brep.the_solid(context.design.solid), Practice())
    cut = program((-9, -9, 40), raster((-5.0, LONG_MM + 5.0), [2.0 + k for k in range(10)], HIGH_MM))
    piece = Workpiece(blank=skin.shape).after(context.setup.frame, swept_paths(cut, {1: tool("flat", 2)}))
    position = context.setup.model_copy(update=AMONG_OTHERS)
    design = replace(context.design, stock=skin, setups=(position,))
    work = PlanningContext(design, position, catalogue.find_machine("mill_a_on_b"), context.library, piece)
    _, (as_cast, _, _), _ = work.beside_tools
    middles, level = as_cast.corners_mm.mean(axis=1), np.ptp(as_cast.corners_mm[:, :, 2], axis=1) < 1e-9
    top = middles[level & (middles[:, 2] > HIGH_MM - 1e-9)]
    assert top[:, 1].max() > RADIUS_MM and top[:, 1].min() < -RADIUS_MM


def test_triangles_are_halved_to_no_more_than_a_length_and_cover_the_same():
    """Those without area are left out, the others keep theirs and the way they look."""
    whole = np.random.default_rng(5).normal(scale=20.0, size=(40, 3, 3))
    whole[7, 2] = whole[7, :2].mean(axis=0)
    small = halved_until(whole, PATCH_MM)
    areas = lambda c: np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    assert np.linalg.norm(np.roll(small, 1, axis=1) - small, axis=2).max() <= PATCH_MM
    assert areas(small).sum(axis=0) == pytest.approx(areas(whole).sum(axis=0), abs=1e-8)
    assert np.linalg.norm(areas(small), axis=1).sum() == pytest.approx(np.linalg.norm(areas(whole), axis=1).sum())


def test_what_each_setup_leaves_of_the_skin_is_what_all_cuts_together_leave_at_any_place(context):
    """Three setups that overlap: each triangle is asked at one place, of the last cut alone."""
    solid, least = brep.the_solid(context.design.solid), 0.3
    skin = settled(StockSkin(skin_mm=0.9), solid, Practice())
    corners = context.triangles.vertices_mm[context.triangles.triangles]
    standing, pieces = StandingSkin(corners, least), [Workpiece(blank=skin.shape)]
    for k, (low, high) in enumerate(((-9, -6), (-7, 6), (3, 9))):
        cut = program((-9, -9, 40), raster((-5.0 + 3 * k, LONG_MM + 4.0 - 3 * k), np.arange(low, high, 1.5), HIGH_MM + 0.1 * k))
        pieces.append(pieces[-1].after(context.setup.frame, swept_paths(cut, {1: tool("flat", 2)})))
    small = halved_until(corners, PATCH_MM)
    normals = np.cross(small[:, 1] - small[:, 0], small[:, 2] - small[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    middles, found = small.mean(axis=1), []
    for piece in pieces:
        at = middles, *(0.9 * small[:, k] + 0.1 * middles for k in range(3))
        found.append(np.any([piece.deviations(p, normals, 0.45)[0] > least for p in at], axis=0))
    assert [len(standing.corners_on(piece)) for piece in pieces] == [int(f.sum()) for f in found]
    assert all(np.array_equal(standing.corners_on(piece), small[f]) for piece, f in zip(pieces, found))
    assert found[0].all() and (np.diff(np.sum(found, axis=1)) < 0).all()


@pytest.mark.parametrize("x_mm, is_over_it", [(-200.0, True), (-180.0, False)])
def test_the_spindle_keeps_clear_of_the_table_that_stands_beside_an_indexed_position(context, x_mm, is_over_it):
    """Table of mill_a_on_b: 160 mm round X, its face 280 mm before zero; spindle: 90 mm round its axis, 40 above the nose."""
    beside = context.setup.model_copy(update=AMONG_OTHERS)
    mill = catalogue.find_machine("mill_a_on_b")
    works = [PlanningContext(replace(context.design, setups=(s,)), s, mill, context.library) for s in (beside, context.setup)]
    ball = next(t for t in works[0].library.of_type("ball") if t.cutter.radius_mm == RADIUS_MM)
    tip = np.array([[x_mm, 0.0, HIGH_MM]])
    lower = 160.0 + HOLDER_CLEARANCE_MM + HELD_BY_MM - (HIGH_MM + ball.length_mm + 40.0)
    assert lower > 0 and works[1].missing_mm(ball, tip) == [0.0]
    assert works[0].missing_mm(ball, tip) == pytest.approx([lower if is_over_it else 0.0], abs=0.02)


def test_a_cutter_stays_a_millimetre_off_the_fixtures_of_an_indexed_position(context):
    """A post 4 mm over the top: beside it the ball's side, over it the ball's tip, as far as a sphere that is 1 mm larger goes."""
    post = FixtureCylinder(name="post", from_mm=(8.0, 0.0, 0.0), to_mm=(8.0, 0.0, HIGH_MM + 4.0), diameter_mm=4.0)
    beside = context.setup.model_copy(update={**AMONG_OTHERS, "fixtures": (post,)})
    mill = catalogue.find_machine("mill_a_on_b")
    work = PlanningContext(replace(context.design, setups=(beside,)), beside, mill, context.library)
    ball = next(t for t in work.library.of_type("ball") if t.cutter.radius_mm == RADIUS_MM)
    grown = RADIUS_MM + HOLDER_CLEARANCE_MM + HELD_BY_MM
    off = np.array([0.0, 1.0, 3.0, 5.0, 6.9, 7.1])             # of the ball's axis from the post's
    over = np.sqrt(np.maximum(grown ** 2 - np.maximum(off - 2.0, 0.0) ** 2, 0.0)) - RADIUS_MM
    tips = np.column_stack([8.0 + off, 0 * off, np.full(6, HIGH_MM + 2.0)])
    assert work.missing_mm(ball, tips) == pytest.approx(np.where(off < 7.0, np.maximum(2.0 + over, 0.0), 0.0), abs=0.02)


@pytest.mark.parametrize("out_mm, is_touched", [(0.0, True), (0.004, True), (0.012, False)])
def test_a_rim_that_leans_over_its_wall_may_hold_the_ball_off_by_half_the_cusp(out_mm, is_touched):
    """A wall 8 mm high under a rim of 1 mm that stands out from it."""
    body = cq.Workplane().box(20, 20, 4, centered=(False, True, False)).union(
        cq.Workplane(origin=(-4, 0, 0)).box(8, 20, 12, centered=(True, True, False))).union(
        cq.Workplane(origin=(-4, 0, 12)).box(8 + 2 * out_mm, 20, 1, centered=(True, True, False)))
    setup = Setup(name="top", faces=("wall",), wcs_in_words="")
    design = Design(name="rimmed", description="wall under a rim", parameters=Parameters(), solid=body.val(), setups=(setup,),
                    predicates={"wall": body.faces(cq.selectors.NearestToPointSelector((0, 0, 8)))}, material="aluminium_6061",
                    stock=StockBox(min_mm=(-9, -10, 0), max_mm=(20, 10, 13)), finish=ASKED)
    work = PlanningContext(design, setup, catalogue.find_machine(design.machine), catalogue.find_library(None))
    ball = next(t for t in work.library.of_type("ball") if t.cutter.radius_mm == RADIUS_MM)
    squarely = squarely_touched(work, [SimpleNamespace(tool=ball)], np.array([[0.0, y, 9.0] for y in (-2.0, 0.0, 2.0)]), 0.05)
    assert np.isfinite(squarely).tolist() == 3 * [is_touched]


def test_only_middles_that_crowd_are_joined():
    """Level places under their balls are as far apart as the balls; those across a groove are not."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    level = np.column_stack([x, y, 0 * x])
    assert not _fall_together(level, level + (0, 0, RADIUS_MM)).any()
    turn = np.radians(15.0 * y)
    bent = np.column_stack([x, RADIUS_MM * np.sin(turn), -RADIUS_MM * np.cos(turn)])
    assert _fall_together(bent, np.column_stack([x, 0 * x, 0 * x])).all()
    assert not _fall_together(level[:1], level[:1]).any()
    rows = _chained(np.array([[3.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [9.0, 0, 0]]), 1.5)
    assert sorted(len(row) for row in rows) == [2, 4] and np.abs(np.diff(max(rows, key=len)[:, 0])).max() == 1.0


def test_middles_one_above_another_have_one_pass_that_leads_somewhere():
    """In the upright end of a slot as round as the ball: a line from one to the next had no length in plan."""
    rows = _chained(np.array([[3.0, 1.0, 0.0], [3.0, 1.0, 0.5], [3.0, 1.0, 1.0], [9.0, 0.0, 0.0]]), 1.5)
    assert len(rows) == 2 and all(np.linalg.norm(np.diff(row[:, :2], axis=0), axis=1).min() > 0.1 for row in rows)



def test_what_a_context_lets_go_of_is_made_again_as_it_was(context):
    """What is large goes, for an operation's own context too; drops on it are the same to the last bit."""
    whole, own = context, context.of(context.operation, ())
    xy = np.random.default_rng(4).uniform((2, -6), (LONG_MM - 2, 6), (50, 2))
    asked = lambda: (own.dropper(1.5, 1.5, 0.0).contacts(xy).tip_z_mm, drop_tips_mm(own.mesh, xy, 1.5, 1.5),
                     own.geometry[0].coefficients)
    before, mesh = asked(), own.mesh
    assert own.mesh is mesh is whole.mesh
    whole.let_go()
    assert not set(MADE_AGAIN) & set(own._shared) and own.mesh is not mesh
    assert all(np.array_equal(a, b) for a, b in zip(before, asked()))


def test_whether_a_tool_clears_the_whole_part_is_as_its_exact_box_says(context, monkeypatch):
    """Asked of the box only where that decides: within a tenth of a millimetre above the highest triangle."""
    tool = next(t for t in context.library.of_type("ball"))
    asked, exact = [], context.box[1][2]
    monkeypatch.setattr(PlanningContext, "box", property(lambda self: asked.append(self) or (None, (0.0, 0.0, exact))))
    level = next(z for z in np.arange(-60.0, 20.0, 0.01) if is_clear_above(tool, z, exact, 0.3))
    for off in (-20.0, -0.2, -0.02, 0.0, 0.05, 0.2, 20.0):
        assert context._is_clear_above_all(tool, level + off, 0.3) == is_clear_above(tool, level + off, exact, 0.3)
    assert len(asked) == 2          # at 0 and 0.05
