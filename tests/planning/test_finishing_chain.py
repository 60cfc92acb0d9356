"""Several balls for one part: the fastest chain by brute force, what each adds and leaves, and its numbers."""

from itertools import combinations
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from known_tools import tool

from cuspline.kernel.brep import faces_of, planning_mesh, the_solid
from cuspline.planning.cutter_choice import choose_ball, choose_cutter, cutter_reach
from cuspline.planning.finishing_chain import WORTH_SHARE, FinishingWork, _clear_reach, choose_finishing
from cuspline.planning.tool_depth import (
    HOLDER_CLEARANCE_MM,
    SHANK_CLEARANCE_MM,
    missing_stick_out_mm,
    missing_stick_outs_mm,
)
from cuspline.shop.cutters import ToolLibrary
from cuspline.surfaces.curvature import sample_faces
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.values.errors import CutterDoesNotFit

BALLS = (16, 10, 8, 6, 4, 2)
SHOP = ToolLibrary(tools=tuple(tool("ball", d, number=k) for k, d in enumerate(BALLS, 1)))


def work(change_s=60.0):
    return FinishingWork(scallop_mm=0.01, feed_of=lambda t: 100.0 * t.cutter.diameter_mm, change_s=change_s)


@pytest.fixture(scope="module")
def grooved():
    """A plate with grooves of radius 9, 4.6 and 1.5 mm: samples of its upper faces, and its mesh."""
    plate = cq.Workplane("XY").box(90, 30, 12, centered=False)
    for x, r in ((15, 9.0), (40, 4.6), (60, 1.5)):
        plate = plate.cut(cq.Workplane("XZ").center(x, 12).circle(r).extrude(-30))
    solid = the_solid(plate)
    faces = faces_of(solid)
    wanted = [k for k, f in enumerate(faces) if f.kind == "cylinder" or f.middle.normal[0, 2] > 0.9]
    mesh = planning_mesh(solid, 0.01)
    return sample_faces(faces, wanted, 0), DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)


def brute_fastest(samples, mesh, change_s):
    """(seconds, tool numbers) of the best of all subsets of the library that clean as much as it can."""
    tools = SHOP.of_type("ball")
    reached = [_clear_reach(t, samples, mesh, 0.0)[0] for t in tools]
    area = samples.area_mm2
    most = area[np.logical_or.reduce(reached)].sum() - WORTH_SHARE * area.sum()
    best = []
    for size in range(1, len(tools) + 1):
        for chain in combinations(range(len(tools)), size):
            done, seconds = np.zeros(len(area), bool), 0.0
            for k in chain:
                adds = reached[k] & ~done
                seconds += work(change_s).seconds(tools[k], samples, adds) + change_s
                done |= reached[k]
            if area[done].sum() >= most:
                best.append((seconds, tuple(tools[k].number for k in chain)))
    return min(best)


@pytest.mark.parametrize("change_s", [0.5, 20.0, 60.0, 600.0, 1e6])
def test_the_chain_is_the_fastest_of_all_subsets(grooved, change_s):
    samples, mesh = grooved
    links, _, _ = choose_finishing(SHOP, samples, mesh, 0.0, work(change_s))
    seconds = sum(link.estimated_time_s + change_s for link in links)
    wanted, numbers = brute_fastest(samples, mesh, change_s)
    assert seconds == pytest.approx(wanted, rel=2e-3)          # balls that add under a thousandth are left out
    assert set(link.tool.number for link in links) <= set(numbers)


def test_many_balls_where_changing_is_quick_and_one_where_it_is_dear(grooved):
    quick, dear = (choose_finishing(SHOP, *grooved, 0.0, work(s))[0] for s in (1.0, 1e6))
    assert len(quick) >= 3 and len(dear) == 1
    assert dear[0].tool.cutter.diameter_mm == 2                # the only one that enters the groove of radius 1.5


def test_each_ball_is_smaller_and_adds_what_no_larger_one_reached(grooved):
    samples, mesh = grooved
    links, _, reached = choose_finishing(SHOP, samples, mesh, 0.0, work(1.0))
    diameters = [link.tool.cutter.diameter_mm for link in links]
    assert diameters == sorted(diameters, reverse=True)
    assert (np.sum([link.adds for link in links], axis=0) == reached).all()         # every row once
    left = samples.area_mm2.sum()
    for link in links:
        left -= link.area_added_mm2
        assert link.area_added_mm2 > 0 and link.area_left_mm2 == pytest.approx(left)


def test_no_ball_works_in_a_hollow_that_it_would_chatter_in(grooved):
    samples, mesh = grooved
    for link in choose_finishing(SHOP, samples, mesh, 0.0, work(1.0))[0]:
        hollows = -1 / np.minimum(samples.hollow_per_mm[link.adds], -1e-12)
        assert link.tool.cutter.radius_mm <= 0.9 * hollows.min() + 1e-9


def test_every_candidate_says_its_numbers(grooved):
    samples, mesh = grooved
    links, candidates, reached = choose_finishing(SHOP, samples, mesh, 0.0, work(1.0))
    assert [c.tool.number for c in candidates] == [1, 2, 3, 4, 5, 6]
    assert {c.tool.number for c in candidates if c.is_chosen} == {link.tool.number for link in links}
    left = [c.area_left_mm2 for c in candidates]
    assert left == sorted(left, reverse=True) and left[-1] == pytest.approx(samples.area_mm2[~reached].sum())
    # narrowest on the flat or over the lips: never wider than on the flat
    for c in candidates:
        r = c.tool.cutter.radius_mm
        assert 0 < c.stepover_mm <= 2 * np.sqrt(0.01 * (2 * r - 0.01)) + 1e-9 and c.estimated_time_s > 0
    assert [c.is_fitting for c in candidates] == [False] * 5 + [True]
    row = candidates[0].as_dict()
    assert row["fits"] is False and row["area_left_mm2"] == round(left[0], 4) and row["missing_stick_out_mm"] == 0.0


def test_a_ball_whose_holder_touches_is_left_out_with_what_is_missing(grooved):
    samples, mesh = grooved
    short = tool("ball", 2, number=9).model_copy(update={"stick_out_mm": 20.0})
    cutter = short.cutter.model_copy(update={"flute_length_mm": 2.0, "reach_mm": 3.0})
    short = short.model_copy(update={"cutter": cutter})
    library = ToolLibrary(tools=(*SHOP.tools[:5], short))
    links, candidates, _ = choose_finishing(library, samples, mesh, 12.0, work(1.0))
    last = next(c for c in candidates if c.tool.number == 9)
    assert 9 not in [link.tool.number for link in links] and last.missing_stick_out_mm > 0
    assert not last.is_chosen


def test_a_library_without_a_ball_is_refused(grooved):
    flat = ToolLibrary(tools=(tool("flat", 10),))
    with pytest.raises(CutterDoesNotFit, match="no ball of the library reaches.*it has none"):
        choose_finishing(flat, *grooved, 0.0, work())


def test_gaps_too_narrow_for_every_ball_are_called_so_and_no_stick_out_is_blamed():
    block = cq.Workplane("XY").box(30, 20, 8, centered=False)
    slot = the_solid(block.cut(cq.Workplane("XY").box(20, 1.5, 3).translate((15, 10, 8))))
    faces, mesh = faces_of(slot), planning_mesh(slot, 0.01)
    floor = [k for k, f in enumerate(faces) if abs(f.middle.point_mm[0, 2] - 6.5) < 1e-6]
    assert len(floor) == 1
    samples = sample_faces(faces, floor, 0)
    with pytest.raises(CutterDoesNotFit, match=r"T6 .* gets in nowhere.*narrower than the smallest, radius 1\.000 mm") as error:
        choose_finishing(SHOP, samples, DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles), 0.0, work())
    assert "stick-out" not in str(error.value)


def test_one_ball_for_all_keeps_its_choice_and_now_says_its_numbers(grooved):
    samples, mesh = grooved
    chosen, candidates, reach = choose_ball(SHOP, samples, 1.5, mesh, 0.0, work())
    assert chosen.cutter.diameter_mm == 2 and [c.is_chosen for c in candidates] == [False] * 5 + [True]
    assert candidates[-1].area_left_mm2 == pytest.approx(samples.area_mm2[~reach.is_reached].sum())
    assert all(c.stepover_mm is not None and c.missing_stick_out_mm == 0 for c in candidates)
    bare = choose_ball(SHOP, samples, 1.5, mesh, 0.0)[1]
    assert [c.reason for c in bare] == [c.reason for c in candidates] and bare[0].stepover_mm is None


def test_the_stick_out_missing_is_what_the_holder_let_down_at_every_tip_shows(grooved):
    samples, mesh = grooved
    short = tool("ball", 4).model_copy(update={"stick_out_mm": 8.0})
    tips = samples.point_mm[::5] - (0.0, 0.0, 4.0)
    worst = np.zeros(len(tips))
    for z0, r0, _, r1 in short.non_cutting_frusta():
        clear = HOLDER_CLEARANCE_MM if z0 >= short.stick_out_mm - 1e-9 else SHANK_CLEARANCE_MM
        if max(r0, r1) + clear > short.cutter.radius_mm:
            worst = np.maximum(worst, drop_tips_mm(mesh, tips[:, :2], max(r0, r1) + clear, 0.0) + clear - (tips[:, 2] + z0))
    assert 0 < (worst > 0).sum() < len(worst)
    assert np.array_equal(missing_stick_outs_mm(short, tips, mesh, 0.0), worst)
    assert missing_stick_out_mm(short, tips, mesh, 0.0) == worst.max()


def as_they_stand(samples, mesh):
    """What tools reach upright, and the stick-out that they lack there."""
    def look(one):
        reach = cutter_reach(samples, mesh, one.cutter)
        return reach.is_reached, missing_stick_out_mm(one, reach.tip_mm[reach.is_reached], mesh, 0.0)
    return look


BULLS = tuple(tool("bull_nose", d, r, number=k) for k, (d, r) in enumerate(((16, 1.0), (12, 3.0), (6, 2.5)), 1))


@pytest.mark.parametrize("slope_deg, wanted", [(0.0, 1), (25.0, 2)])
def test_of_bull_noses_a_wide_flat_is_fastest_on_a_floor_and_a_large_corner_on_a_slope(slope_deg, wanted):
    low = 30 - 60 * np.tan(np.radians(slope_deg))
    solid = the_solid(cq.Workplane("XZ").polyline([(0, 0), (60, 0), (60, 30), (0, low)]).close().extrude(-40))
    faces = faces_of(solid)
    top = [k for k, f in enumerate(faces) if f.middle.normal[0, 2] > 0.5]
    samples, mesh = sample_faces(faces, top, 0), planning_mesh(solid, 0.01)
    drops = DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)
    even = FinishingWork(scallop_mm=0.01, feed_of=lambda t: 1000.0, change_s=60.0)
    chosen, candidates, reached = choose_cutter("parallel", BULLS, samples, np.inf, as_they_stand(samples, drops), even)
    assert chosen.number == wanted and reached.all()
    assert chosen.number == min(candidates, key=lambda c: c.estimated_time_s).tool.number
    # by hand: on the floor a pass covers the flat, on the slope the chord of the corner's circle
    steps = [2 * np.sqrt(2 * t.cutter.corner_radius_mm * 0.01 - 1e-4) for t in BULLS]
    if not slope_deg:
        steps = [max(s, t.cutter.diameter_mm - 2 * t.cutter.corner_radius_mm) for s, t in zip(steps, BULLS)]
    assert [c.stepover_mm for c in candidates] == pytest.approx(steps)
    assert [c.estimated_time_s for c in candidates] == pytest.approx([samples.area_mm2.sum() / s / 1000 * 60 for s in steps])
    assert [c.is_chosen for c in candidates] == [c.tool.number == wanted for c in candidates]


def test_a_cutter_that_leaves_more_is_not_taken_for_its_speed(grooved):
    """Into the groove of radius 4.6 only the ball of 4 reaches, though others are through with the rest sooner."""
    samples, mesh = grooved
    balls = tuple(t for t in SHOP.tools if t.cutter.diameter_mm in (10, 4))
    chosen, candidates, _ = choose_cutter("rest", balls, samples, np.inf, as_they_stand(samples, mesh), work())
    assert chosen.cutter.diameter_mm == 4 and candidates[-1].reason == "fastest of those that leave least"
    assert candidates[0].reason.startswith("leaves ") and candidates[0].reason.endswith("mm² more than T5")


def test_stairs_of_a_flat_cutter_stand_as_high_as_the_cusp_wanted():
    """Steps of h / (sin a cos a) along a slope: the corner between two of them stands h over the slope, square to it."""
    angle, mill = np.radians(30.0), tool("flat", 10)
    normal = np.array([[np.sin(angle), 0.0, np.cos(angle)]])
    sample = SimpleNamespace(normal=normal, across_per_mm=np.zeros(1), area_mm2=np.ones(1))
    step = work().steps_mm(mill, sample, np.array([True]))[0]
    rise, run = step * np.sin(angle), step * np.cos(angle)
    assert rise * run / step == pytest.approx(0.01)         # the height of a right-angled triangle over its long side
