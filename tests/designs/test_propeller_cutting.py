"""How a propeller is laid out to be cut: every blade from the same directions, turned with it, none of them towards the table."""

from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from cuspline.app.catalogue import find_design, find_library, make_design
from cuspline.design.setup_alignment import far_errors_mm
from cuspline.designs.propellers import cutting
from cuspline.designs.propellers.blade import about_x
from cuspline.kernel import brep
from cuspline.planning import positions as planning_positions
from cuspline.surfaces.curvature import sample_faces
from cuspline.surfaces.projection import ClosestTree
from cuspline.values.errors import DesignError

SMALL = ["diameter_mm=100", "bore_mm=8",
         *(f"fillet_{part}_mm={r}" for part, r in (("leading_edge", 2), ("trailing_edge", 2), ("face", 3), ("back", 3)))]
FEW = np.array([(0.612, 0.612, 0.5), (-0.612, -0.612, 0.5), (0.0, 0.0, 1.0), (-0.9, 0.3, 0.3)])
FEW = FEW / np.linalg.norm(FEW, axis=1)[:, None]


@pytest.fixture(scope="module")
def whole():
    """The 4119 of 100 mm with all blades to be cut; a few directions to choose from."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planning_positions, "directions", lambda apart_deg=20.0: FEW)
        patch.setattr(cutting, "PLACES", 300)
        patch.setattr(cutting, "CLOSER", (300, 60.0))
        patch.setattr(cutting, "LEFT_SHARE", 0.1)           # four directions leave more than a build may
        return make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=all"])


@contextmanager
def two_ways():
    """No search for positions: every clamping takes the first two directions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cutting, "_ways", lambda *of, **_: [FEW[:2]] * len(of[-1]))
        yield


def test_blades_are_cut_from_directions_turned_with_them(whole):
    ways = np.array([s.wcs_z for s in whole.setups]).reshape(3, -1, 3)
    assert ways.shape[1] >= 2
    for k in (1, 2):
        assert ways[k] == pytest.approx(ways[0] @ about_x(2 * np.pi * k / 3).T, abs=1e-11)
    assert [s.name for s in whole.setups[:2]] == ["blade-1-1", "blade-1-2"] and whole.setups[-1].name.startswith("blade-3-")
    assert all(f"blade {s.name[6]} face" in s.faces and f"fillet {s.name[6]}" in s.faces for s in whole.setups)
    assert whole.description.endswith("; 3 of 3 blades cut with their fillets, all else stays as cast")
    assert all(s.indexed and s.clamped_x == (1, 0, 0) and s.clamped_z == (0, 0, 1) for s in whole.setups)


def test_the_other_blades_take_the_moves_of_the_first_seen_from_the_same_side(whole):
    """Part to setup of blade 1 is that of blade k with the propeller turned: what is planned once is cut on all."""
    count = len(whole.setups) // 3
    assert [s.planned_as for s in whole.setups] == [*count * [None], *2 * [s.name for s in whole.setups[:count]]]
    for k in (1, 2):
        for first, other in zip(whole.setups, whole.setups[count * k:]):
            turned = about_x(2 * np.pi * k / 3) @ first.turn.rotation
            assert other.turn.rotation == pytest.approx(turned, abs=1e-10) and other.operations == first.operations


@pytest.mark.parametrize("count", [3, 4, 5, 6, 7, 9])
def test_blades_are_taken_apart_and_each_once(count):
    apart, around = cutting.blade_order(count, "apart"), cutting.blade_order(count, "around")
    assert sorted(apart) == around == list(range(count)) and apart[0] == 0
    in_turn = [min((b - a) % count, (a - b) % count) for a, b in zip(apart, apart[1:])]
    assert min(in_turn) > 1 or count < 5


@pytest.mark.parametrize("fillets_mm, numbers", [
    ((8.0, 4.0), (16, 6)), ((3.0, 2.0), (6, 4)), ((20.0, 20.0), (16,)), ((1.0, 1.0), (4,))])
def test_a_position_has_the_largest_ball_for_the_blade_and_one_that_fits_the_fillet(fillets_mm, numbers):
    wide, tight = fillets_mm
    p = SimpleNamespace(fillet_face_mm=wide, fillet_back_mm=wide, fillet_leading_edge_mm=tight, fillet_trailing_edge_mm=tight)
    balls = cutting._balls(p)
    assert tuple(b.cutter.diameter_mm for b in balls) == numbers
    first, later = cutting._operations(balls, True), cutting._operations(balls, False)
    assert [o.kind for o in first] == ["parallel", "rest"][:len(numbers)] and {o.kind for o in later} == {"rest"}
    assert [o.tool for o in first] == [o.tool for o in later] == [b.number for b in balls]


def test_an_extension_takes_the_tool_and_stands_in_its_holder():
    ball = find_library(None).of_type("ball")[0]
    longer = cutting.extended(ball, 80.0)
    assert cutting.extended(ball, 0.0) is ball and longer.number == ball.number + cutting.EXTENDED
    assert longer.length_mm == ball.length_mm + 80.0 and longer.stick_out_mm == ball.stick_out_mm
    shank, (z0, r0, z1, r1) = ball.cutter.shank_diameter_mm / 2, longer.non_cutting_frusta()[-len(ball.holder.segments) - 1]
    assert (z0, z1) == (ball.stick_out_mm, ball.stick_out_mm + 80.0)
    assert r0 == shank + 4.0 and np.degrees(np.arctan((r1 - r0) / 80.0)) == pytest.approx(3.0, abs=0.01)


def test_a_stranger_s_table_is_laid_out_to_be_cut_with_default_settings(tmp_path):
    """Columns over the radius, as somebody wrote them down: positions of every blade come of it."""
    (tmp_path / "mine.csv").write_text(
        "r_R,c_D,P_D,skew_deg,rake_D,t0_D,f0_c\n0.2,0.20,1.00,0,0,0.040,0.02\n0.4,0.26,1.02,2,0,0.030,0.025\n"
        "0.6,0.29,1.05,6,0,0.020,0.025\n0.8,0.27,1.03,12,0,0.012,0.022\n0.95,0.16,1.00,18,0,0.007,0.02\n"
        "1.0,0.02,1.0,20,0,0.004,0.0\n")
    with two_ways():
        made = make_design(find_design("propeller"), [f"radii_csv={tmp_path / 'mine.csv'}", "blades=3", "blades_cut=all"])
    assert [s.name for s in made.setups] == [f"blade-{k}-{j}" for k in (1, 2, 3) for j in (1, 2)]
    assert made.machine == cutting.MACHINE
    assert made.description.endswith("3 of 3 blades cut with their fillets, all else stays as cast")


def test_the_first_two_directions_see_both_sides(whole):
    ways = np.array([s.wcs_z for s in whole.setups])
    faces = brep.faces_of(brep.the_solid(whole.solid))
    for side in ("face", "back"):
        mine = brep.indices_of(faces, brep.named_faces(faces, whole.predicates, (f"blade 1 {side}",)))
        normals = sample_faces(faces, mine, across_axis=2).normal
        best = (normals @ ways[:2].T).max(axis=1)
        assert np.percentile(best, 5) > np.cos(np.radians(cutting.CUT_DEG))


def test_a_blade_that_no_direction_sees_is_refused_with_what_would_help():
    """One direction, that looks at the face alone: the back is left, and the message says how much, where and why."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planning_positions, "directions", lambda apart_deg=20.0: FEW[:1])
        patch.setattr(cutting, "PLACES", 300)
        patch.setattr(cutting, "CLOSER", (300, 60.0))
        with pytest.raises(DesignError, match=r"no direction sees \d+\.\d of \d+ mm2 of blade 1, about X.* balls of 6 and 4 mm in "
                                              r"extensions of 80 mm and a skin of 0.6 mm: another blade.* change extension_mm"):
            make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=one"])


def test_a_hub_that_reaches_the_table_is_refused():
    with two_ways():
        with pytest.raises(DesignError, match="the hub begins 20.0 mm before the propeller's centre, .* enlarge arbor_mm"):
            make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=one", "arbor_mm=15"])


# flipped: one side up, then the other ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def flipped():
    """The 4119 of 100 mm, all blades, as the large ones are cut."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planning_positions, "directions", lambda apart_deg=20.0: FEW)
        patch.setattr(cutting, "PLACES", 300)
        patch.setattr(cutting, "CLOSER", (300, 60.0))
        patch.setattr(cutting, "LEFT_SHARE", 0.1)           # four directions leave more than a build may
        return make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=all", "sides=flipped"])


@pytest.mark.parametrize("diameter_mm, sides, is_so", [
    (609.6, "auto", False), (609.7, "auto", True), (762.0, "together", False), (100.0, "flipped", True)])
def test_propellers_above_24_in_are_flipped_unless_told_otherwise(diameter_mm, sides, is_so):
    assert cutting.is_flipped(SimpleNamespace(diameter_mm=diameter_mm), SimpleNamespace(sides=sides)) == is_so


def test_one_side_is_cut_after_the_other(flipped):
    """All of the back's setups first; from above alone, and every blade of a side by the same directions turned with it."""
    sides = [s.name.split("-")[0] for s in flipped.setups]
    assert sides == sorted(sides) and set(sides) == {"back", "face"} and flipped.machine == cutting.GANTRY
    assert flipped.description.endswith("; 3 of 3 blades cut with their fillets, all else stays as cast; flipped between its sides")
    for side, up in cutting.SIDES:
        mine = [s for s in flipped.setups if s.name.startswith(f"{side}-blade-")]
        other, = {"back", "face"} - {side}
        assert all({f"blade {s.name[-3]} {part}" for part in (side, "tip", "leading edge")} < set(s.faces) for s in mine)
        assert not any(f"blade {s.name[-3]} {other}" in s.faces for s in mine)
        assert {s.clamped_z for s in mine} == {up} and {s.planned_as for s in mine if "-1-" not in s.name} <= {
            s.name for s in mine if s.planned_as is None}
        count = len(mine) // 3
        for first, other in zip(mine[:count], mine[count:2 * count]):
            assert about_x(2 * np.pi / 3) @ first.wcs_z == pytest.approx(other.wcs_z, abs=1e-10)


def test_dimples_of_the_first_side_are_the_markers_of_the_second(flipped):
    """In the hub's skin, between the blades; their fit tells every tip to a few times what one measurement is off."""
    cuts = [s for s in flipped.setups if s.operations[0].kind == "dimples"]
    markers = {m.name: np.array(m.at_mm) for s in flipped.setups for m in s.markers}
    assert all(s.name.startswith("back-markers") for s in cuts) and not any(s.markers for s in flipped.setups if "back" in s.name)
    assert sorted(n for s in cuts for n in s.operations[0].markers) == sorted(markers) and len(markers) == 6
    places = np.array(list(markers.values()))
    ball = next(t for t in flipped.tools if t.number == cuts[0].operations[0].tool).cutter.radius_mm
    closest = ClosestTree.of_faces(brep.faces_of(brep.the_solid(flipped.solid)))
    assert closest.closest_points(places).distance_mm == pytest.approx(ball + 0.4 * 0.6, abs=2e-3)      # 0.6 of the skin deep
    tips = np.array([about_x(2 * np.pi * k / 3) @ (0.0, 0.0, 50.0) for k in range(3)])
    assert far_errors_mm(places, tips, 0.002).max() < 0.006


def test_posts_stand_under_every_blade_and_touch_none(flipped):
    closest = ClosestTree.of_faces(brep.faces_of(brep.the_solid(flipped.solid)))
    for setup, down in ((flipped.setups[0], 1.0), (flipped.setups[-1], -1.0)):
        posts = [f for f in setup.fixtures if f.name.startswith("post")]
        assert len(posts) == 3
        for post in posts:
            (foot, *at), top = post.from_mm, np.array(post.to_mm)
            around = np.linspace(0, 2 * np.pi, 24)[:, None]
            rim = top + post.diameter_mm / 2 * (np.cos(around) * (0, 1, 0) + np.sin(around) * (0, 0, 1))
            away = closest.closest_points(np.vstack([top, rim])).distance_mm
            assert 0.6 < away.min() < 3.0 and down * (foot - top[0]) > 50.0 and np.hypot(*at) == pytest.approx(35.0, abs=1e-3)


def test_a_skin_too_thin_for_dimples_is_refused():
    with pytest.raises(DesignError, match="a skin of 0.2 mm is too thin for dimples .* take skin_mm 0.25 or more"):
        make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=one", "sides=flipped", "skin_mm=0.2"])


# the hub -----------------------------------------------------------------------------------------------------


def test_a_blade_s_sector_of_the_hub_is_the_one_round_its_root():
    with two_ways():
        made = make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=all", "hub_cut=true"])
        with pytest.raises(DesignError, match="hub_cut: the propeller is flipped, .* take sides=together"):
            make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=one", "hub_cut=true", "sides=flipped"])
    assert "blades cut with their fillets and hub, all else" in made.description
    faces = brep.faces_of(brep.the_solid(made.solid))
    for k in (1, 2, 3):
        sector, = brep.named_faces(faces, made.predicates, (f"hub {k}",))
        fillet = brep.named_faces(faces, made.predicates, (f"fillet {k}",))
        places = [sample_faces(faces, [faces.index(f)], across_axis=2).point_mm for f in (sector, *fillet)]
        middle = np.vstack(places[1:]).mean(axis=0)
        assert sector.mark.name == "hub" and np.linalg.norm(places[0].mean(axis=0) - middle) < 10.0
        assert all(f"hub {k}" in s.faces for s in made.setups if s.name.startswith(f"blade-{k}-"))
