"""What Auto makes of pockets, slots, outlines and holes with dimensions, and that it says what it could not."""

from pathlib import Path

import cadquery as cq
import numpy as np
import pytest

from cuspline.app import catalogue
from cuspline.design import Design, Diameter, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.auto import Auto
from cuspline.values.errors import CutterDoesNotFit

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
USERS = Path(__file__).resolve().parents[2] / "bench" / "users_parts"
X, Y, Z = 62.0, 30.0, 6.0


def block():
    return cq.Workplane("XY").box(X, Y, Z, centered=False)


def pocket(at, size, corner, depth=1.5):
    return cq.Workplane("XY", origin=(*at, Z - depth)).rect(*size).extrude(9).edges("|Z").fillet(corner)


def hole(at, diameter):
    return cq.Workplane("XY", origin=(*at, -1)).circle(diameter / 2).extrude(20)


def planned(solid, margin=0.3, shop=SHOP, stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z)), **says):
    """SetupPlan of all faces of a block but its base, by Auto; a margin of -1 takes its sides and its top."""
    inner = FacePredicate(name="all", at_least=1, center_min_mm=(margin, margin, 0.3), normal=(0, 0, 1), normal_within_deg=91.0,
                          center_max_mm=(X - margin, Y - margin, Z - margin))
    bored = FacePredicate(name="bored", count=1, kinds=("cylinder",), area_min_mm2=18.8 * Z, area_max_mm2=18.95 * Z)
    design = Design(name="block", description="block", parameters=Parameters(), solid=solid.val(),
                    predicates=(inner, *([bored] if says else [])), material="aluminium_6061",
                    stock=stock,
                    finish=Finish(scallop_mm=0.3, profile_tolerance_mm=0.03, gouge_mm=0.03),
                    setups=(Setup(name="setup-1", faces=("all",), operations=(Auto(),), wcs_in_words="corner"),), **says)
    return plan_setup(design, design.setups[0], MACHINE, shop)


def facts(plan):
    return {o.name: o.facts for o in plan.operations}


@pytest.fixture(scope="module")
def plan():
    """A pocket, a slot that is closed at both ends, a hole in H7 whose reamer the library has."""
    slot = cq.Workplane("XY", origin=(16, 8, Z - 1.5)).slot2D(24, 10.6).extrude(9)
    solid = block().cut(pocket((46, 15), (22, 20), 6.0)).cut(slot).cut(hole((10, 22), 6.006))
    return planned(solid, dimensions=(Diameter(faces="bored", fit="H7", nominal_mm=6.0),))


def test_pockets_slots_and_close_holes_have_operations_of_their_own(plan):
    names = [o.name for o in plan.operations]
    assert names == ["ream drill", "ream", "slot", "slot walls rough", "slot walls", "pocket rough", "pocket floor", "pocket walls"]
    assert all("instead_of" not in f for f in facts(plan).values())


def test_a_hole_without_close_limits_is_drilled():
    made = planned(block().cut(hole((10, 22), 6.006)), dimensions=(Diameter(faces="bored", lower_mm=-0.1, upper_mm=0.1),))
    assert [o.name for o in made.operations] == ["drill"]


def test_what_no_drill_makes_is_bored_and_says_so():
    said = facts(planned(block().cut(hole((16, 15), 16.0))))
    assert list(said) == ["bore rough", "bore"] and "drill: no drill makes the hole of diameter 16 mm" in said["bore"]["instead_of"]


def test_a_hole_that_nothing_makes_within_its_limits_is_refused_with_what_was_tried():
    with pytest.raises(CutterDoesNotFit, match="reamer 6 H7 does not come within 6.016 to 6.026 mm"):
        planned(block().cut(hole((40, 15), 6.006)), dimensions=(Diameter(faces="bored", lower_mm=0.01, upper_mm=0.02),))


def test_a_pocket_that_no_flat_cutter_fits_is_left_to_balls_and_they_say_why():
    made = planned(block().cut(pocket((46, 15), (12, 12), 4.5, 0.8)).cut(pocket((16, 15), (20, 18), 6.0)))
    said = facts(made)
    assert {"pocket rough", "pocket floor", "pocket walls"} <= set(said) and "instead_of" not in said["pocket walls"]
    others = [f for n, f in said.items() if "pocket" not in n]
    assert others and all("pocket: its walls are rounded by 4.500 mm, and no flat cutter" in f["instead_of"] for f in others)


def test_into_what_no_usual_flat_cutter_gets_a_smaller_one_goes_and_only_there():
    """Corners of 4.5 mm and a slot of 7.1 mm: 6 mm both; the other pocket is made as if there were no smaller ones."""
    wide = block().cut(pocket((16, 18), (20, 18), 6.0))
    tight = cq.Workplane("XY", origin=(16, 4.5, Z - 1.5)).slot2D(24, 7.1).extrude(9)
    both = SHOP.with_smaller(catalogue.find_library("small_mills"))
    alone, made = planned(wide), planned(wide.cut(pocket((46, 15), (12, 12), 4.5, 0.8)).cut(tight), shop=both)
    usual = {t.number for t in SHOP.tools}
    wall_tools = [o.tool.cutter.diameter_mm for o in made.operations if o.name in ("pocket walls", "slot walls")]
    assert sorted(wall_tools) == [6.0, 6.0, 10.0] and not any(o.tool.cutter.type == "ball" for o in made.operations)
    assert all("instead_of" in o.facts for o in made.operations if o.tool.number not in usual)
    assert [o.tool.number for o in alone.operations] == [o.tool.number for o in made.operations if "instead_of" not in o.facts]
    assert made.context.given is both and both.smaller.number(12).cutter.diameter_mm == 6.0
    assert planned(wide, shop=both).operations[-1].moves.end_mm.tolist() == alone.operations[-1].moves.end_mm.tolist()


def test_an_outline_is_contoured_and_a_level_top_is_swept_by_a_flat_cutter():
    made = planned(block().edges("|Z").fillet(5.0), margin=-1.0)
    names = [o.name for o in made.operations]
    assert names[-1] == "contour" and not any(o.tool.cutter.type == "ball" for o in made.operations)


@pytest.mark.parametrize("part", ["plate", "flange", "insert"])
def test_parts_as_users_bring_them_are_the_same_in_both_libraries_and_in_their_job_file(part, tmp_path):
    source = catalogue.find_design(str(USERS / f"{part}.py"))
    one, other = (catalogue.make_design(source, {"library": name}) for name in ("cadquery", "build123d"))
    solids = [brep.the_solid(d.solid, part) for d in (one, other)]
    sizes = [sum(f.area_mm2 for f in brep.faces_of(s)) for s in solids]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-5)
    for solid in solids:
        faces = brep.faces_of(solid)
        assert all(brep.named_faces(faces, one.predicates, (p.name,)) for p in one.predicates)
    brep.write_step(solids[1], tmp_path / f"{part}.step", part)
    job = tmp_path / f"{part}.toml"
    job.write_text((USERS / job.name).read_text())
    read = catalogue.make_design(catalogue.find_design(str(job)), {})
    for name in ("predicates", "setups", "stock", "finish", "material", "threads", "dimensions"):
        assert getattr(read, name) == getattr(one, name), name


def test_an_outline_and_a_window_that_no_one_cutter_fits_have_a_contour_each():
    """One of 6 mm would just not go into the corners of the window, which a smaller one does."""
    window = cq.Workplane("XY", origin=(31, 15, -1)).rect(20, 7).extrude(20).edges("|Z").fillet(3.0)
    plan = planned(block().cut(window), margin=-1, shop=catalogue.find_library("small_mills"))
    contours = [o.tool.cutter.diameter_mm for o in plan.operations if o.name == "contour"]
    assert len(contours) == 2 and contours[1] < 6.0
    assert "rounded by 3.000" in plan.operations[-1].facts["instead_of"] and not any(
        o.tool.cutter.type == "ball" for o in plan.operations)


def test_a_panel_in_inches_is_made_with_tools_in_inches():
    """Corners of 1/10 in, which 3/16 in comes into, and holes of 0.156 in, which is a drill of 5/32 in."""
    panel = block().cut(window((20, 15), (18, 12), 2.54)).cut(hole((45, 8), 0.156 * 25.4)).cut(hole((45, 22), 0.156 * 25.4))
    plan = planned(panel, shop=catalogue.find_library("inch_mills"))
    tools = {o.name: o.tool.cutter.name for o in plan.operations}
    assert (tools["drill"], tools["contour"]) == ("drill 5/32 in", "flat 3/16 in") and tools["rough"].startswith("flat 3/")
    assert plan.area_reached_mm2 == pytest.approx(plan.area_required_mm2)


def test_a_top_that_is_flush_with_the_stock_is_not_cut():
    """Of stock that stands out to the sides alone, a floor's passes over it would be idle; 0.2 mm above it they are not."""
    stock = lambda more: StockBox(min_mm=(-3, -3, 0), max_mm=(X + 3, Y + 3, Z + more))
    names = lambda more: [o.name for o in planned(block().cut(hole((10, 22), 8.0)), margin=-1, stock=stock(more)).operations]
    assert names(0.0) == ["drill", "rough", "contour"] and "floor" in names(0.2)


def window(at, size, corner):
    cut = cq.Workplane("XY", origin=(*at, -1)).rect(*size).extrude(20)
    return cut.edges("|Z").fillet(corner) if corner else cut


def test_a_window_with_corners_tighter_than_any_cutter_is_cut_as_far_as_a_flat_one_comes():
    """Its tightest corner says nothing of the room in its middle: 10 mm go down by a helix in 15."""
    plan = planned(block().cut(window((30, 15), (15, 15), 0.5)))
    assert [(o.name, o.tool.cutter.name) for o in plan.operations] == [("rough", "flat 10 mm"), ("waterline", "flat 10 mm")]
    assert plan.operations[1].moves.end_mm[:, 2].min() == pytest.approx(-0.01)          # below a wall that stands on nothing
    assert facts(plan)["rough"]["given_up_mm3"] == 0.0 and 0.0 < plan.area_reached_mm2 < plan.area_required_mm2


def test_between_walls_where_no_flat_cutter_comes_in_a_ball_clears_and_finishes():
    plan = planned(block().cut(window((30, 15), (24, 5.6), 0.0)))
    assert [(o.name, o.tool.cutter.name) for o in plan.operations] == [("rest rough", "ball 4 mm long neck"),
                                                                      ("waterline", "ball 4 mm long neck")]
    assert "touches none of the faces" in facts(plan)["waterline"]["instead_of"]
    assert plan.area_reached_mm2 > 0.5 * plan.area_required_mm2


def test_why_says_one_reason_of_each_operation_that_was_tried():
    from cuspline.planning.feature_choice import Featured  # behind Auto, which it is a part of
    refused = [((k,), f"drill: no drill makes the hole at {k}") for k in range(3)] + [((0, 1), "bore: T15 is too large")]
    made = Featured().with_refused(refused)
    assert made.why([0, 1, 2]) == "drill: no drill makes the hole at 0; bore: T15 is too large; and 2 more reasons"
    assert made.why([2]) == "drill: no drill makes the hole at 2" and made.why([5]) == ""


def test_a_slot_hardly_wider_than_its_cutter_has_no_walls_to_be_roughed():
    """0.1 mm stay beside a cutter of 3 mm in a slot of 3.2, less than finishing takes: a helix between them took nothing."""
    slot = cq.Workplane("XY", origin=(30, 15, Z - 3)).slot2D(14, 3.2).extrude(9)
    made = [o.name for o in planned(block().cut(slot), shop=catalogue.find_library("small_mills")).operations]
    assert made == ["slot", "slot walls"]


def vee():
    """A vee of 3.2 mm across the whole block, as one cut away."""
    return cq.Workplane("YZ", origin=(-1, 15, 0)).polyline([(-4.95, Z + 0.05), (0, Z - 4.9), (4.95, Z + 0.05)]).close().extrude(70)


def drafted():
    return cq.Workplane("XY", origin=(31, 15, Z + 0.01)).rect(36, 20).extrude(-3.21, taper=20)


@pytest.mark.parametrize("above, length", [(vee(), 70), (drafted(), 20)])
def test_a_slot_sunk_under_walls_that_lean_waits_until_these_are_shaped(above, length):
    """In a gap as wide as itself the cutter's shank would go through what stands over the slot."""
    slot = cq.Workplane("XY", origin=(31, 15, Z - 5.2)).slot2D(length, 3.4).extrude(2)
    both = SHOP.with_smaller(catalogue.find_library("small_mills"))
    made = planned(block().cut(above).cut(slot), shop=both)
    names, tools = [o.name for o in made.operations], [o.tool.cutter for o in made.operations]
    first = next(k for k, name in enumerate(names) if name.startswith(("slot", "pocket")))
    assert all(n.startswith(("slot", "pocket")) and c.diameter_mm == 3.0 for n, c in zip(names[first:], tools[first:]))
    assert any(c.type == "ball" for c in tools[:first]) and not any(c.diameter_mm == 3.0 for c in tools[:first])


def test_an_open_slot_in_the_top_waits_for_nothing():
    slot = cq.Workplane("XY", origin=(31, 15, Z - 2)).rect(90, 3.4).extrude(9)
    both = SHOP.with_smaller(catalogue.find_library("small_mills"))
    stock = StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z + 1))
    assert planned(block().cut(slot), shop=both, stock=stock).operations[0].name == "slot"


def test_a_groove_of_two_and_a_half_is_cut_by_the_finest_flat_cutters_at_once():
    groove = cq.Workplane("XY", origin=(31, 15, Z - 1.5)).rect(40, 22).extrude(9).edges("|Z").fillet(6).cut(
        cq.Workplane("XY", origin=(31, 15, Z - 1.5)).rect(35, 17).extrude(9).edges("|Z").fillet(3.5))
    shop = SHOP.with_smaller(catalogue.find_library("small_mills").with_smaller(catalogue.find_library("fine_mills")))
    made = planned(block().cut(groove), shop=shop)
    assert {o.tool.cutter.name for o in made.operations} == {"flat 2 mm"} and made.operations[-1].name == "pocket walls"


def test_fine_cutters_leave_their_finishing_pass_less_and_take_it_no_deeper_than_a_slot_of_theirs():
    """A groove of 2.5 mm, 1.5 deep, under 1 mm of stock: from the stock's top, where wider cutters begin at the wall's."""
    groove = cq.Workplane("XY", origin=(31, 15, Z - 1.5)).rect(40, 22).extrude(9).edges("|Z").fillet(6).cut(
        cq.Workplane("XY", origin=(31, 15, Z - 1.5)).rect(35, 17).extrude(9).edges("|Z").fillet(3.5))
    shop = SHOP.with_smaller(catalogue.find_library("fine_mills"))
    made = planned(block().cut(groove), shop=shop, stock=StockBox(min_mm=(0, 0, 0), max_mm=(X, Y, Z + 1)))
    walls = next(o for o in made.operations if o.name == "pocket walls" and o.tool.cutter.name == "flat 2 mm")
    assert walls.facts["finish_allowance_mm"] == pytest.approx(0.3 * 2 / 3)
    depths = -np.diff([Z + 1, *walls.facts["heights_mm"]])
    assert walls.facts["heights_mm"][-1] == Z - 1.5 and depths.max() <= walls.tool.cutter.deepest_slot_mm < 1.5
