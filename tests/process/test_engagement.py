"""What the edge meets on the stock as it stands: closed forms, brute force, and what must be seen."""

from dataclasses import replace

import numpy as np
import pytest
from brute_engagement import met, off_by
from known_programs import arc, feed, program, rapid, tool

from cuspline.process.ball_depths import edge_in_cut_mm, edge_radius_mm, inclined_depth_mm, transition_depth_mm
from cuspline.process.cut_of_operations import met_at_places, process_document, turned_rpm
from cuspline.process.engagement import Look, engagement
from cuspline.program.program import Plane
from cuspline.replay.scene import FoundStock

BOX = (-30.0, -30.0, -20.0), (30.0, 30.0, 0.0)
BLOCK = FoundStock(min_mm=BOX[0], max_mm=BOX[1], pitch_mm=1.0)
FULL = 5e-3               # of the radius: what the simulation may be off


def looked(moves, tools=None, start=(-40, 0, -1), stock=BLOCK, look=Look()):
    posted = program(start, moves)
    return engagement(posted, tools or {1: tool("ball", 10)}, stock, look)


def inner(found, row, axis=0, within=5.0):
    return (found.row == row) & (np.abs(found.tip_mm[:, axis]) < within)


def on_slope(r, t, step, psi_deg):
    """Engagement of the second of two passes on a slope that rises along x, fed along y, the layer as given as found."""
    psi, side = np.radians(abs(psi_deg)), np.sign(psi_deg)
    up, out = np.array([np.cos(psi), 0, np.sin(psi)]), np.array([-np.sin(psi), 0, np.cos(psi)])
    low, high = (-25.0, -12.0, -25.0), (25.0, 12.0, 25.0)
    zmap = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.5).zmap
    top = (zmap.xy_mm[:, 0] * np.tan(psi) + t / np.cos(psi)).reshape(zmap.shape).clip(-25, 25)
    stock = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.5, top_mm=top)
    (ax, _, az), (bx, _, bz) = (out * r - up * side * step * k - np.array([0, 0, r]) for k in (0, 1))
    moves = [feed(ax, 30, az), rapid(ax, 30, 60), rapid(bx, 30, 60), rapid(bx, -30, 60), rapid(bx, -30, bz), feed(bx, 30, bz)]
    found = looked(moves, {1: tool("ball", 2 * r)}, (ax, -30, az), stock, Look(apart=0.2))
    return found, inner(found, 5, axis=1, within=3.0)


@pytest.mark.parametrize("r, t, step, psi_deg", [(10, 4, 2, 30), (10, 8, 2, 30), (10, 1, 2, 30), (10, 4, 3, -30),
                                                 (5.41, 1, 0.5, 25), (5.41, 1, 0.5, -25)])
def test_passes_on_a_slope_meet_what_the_closed_forms_say(r, t, step, psi_deg):
    found, mine = on_slope(r, t, step, psi_deg)
    low, high = map(float, edge_in_cut_mm(r, t, step, np.radians(psi_deg)))
    assert mine.sum() > 1
    assert found.lowest_mm[mine] == pytest.approx(low, abs=FULL * r) and found.highest_mm[mine] == pytest.approx(high, abs=FULL * r)
    wanted = edge_radius_mm(r, [found.lowest_mm[mine], found.highest_mm[mine]])
    assert np.array([found.lowest_radius_mm[mine], found.highest_radius_mm[mine]]) == pytest.approx(wanted, abs=1e-9)


def test_a_groove_in_the_full():
    found = looked([feed(40, 0, -1)])
    mine = inner(found, 0)
    assert found.lowest_mm[mine] == pytest.approx(0) and found.highest_mm[mine] == pytest.approx(1, abs=FULL * 5)
    assert np.degrees(found.immersion_rad[mine]) == pytest.approx(180, abs=1)
    area = 25 * np.arccos(0.8) - 4 * 3
    assert found.area_mm2[mine] == pytest.approx(area, rel=0.025)
    fine = looked([feed(40, 0, -1)], look=Look.finer(4))
    assert fine.area_mm2[inner(fine, 0)] == pytest.approx(area, rel=0.005)
    assert found.way_mm.sum() == pytest.approx(80) and not found.cuts[np.abs(found.tip_mm[:, 0]) > 36].any()


def test_a_way_once_gone_meets_nothing_and_a_finer_step_meets_less():
    found = looked([feed(40, 0, -1), feed(-40, 0, -1), feed(-40, 1, -1), feed(40, 1, -1)])
    assert not found.cuts[inner(found, 1)].any() and found.cuts[inner(found, 3)].all()
    assert found.area_mm2[inner(found, 3)] == pytest.approx(1.0, rel=0.05)  # a strip a step wide and the layer deep
    fine = looked([feed(40, 0, -1), feed(40, 1, -1), feed(-40, 1, -1)], look=Look.finer(5))
    assert fine.area_mm2[inner(fine, 2)] == pytest.approx(1.0, rel=0.015)


def test_a_corner_of_plane_and_slope_is_deeper_than_both():
    """At the end of the level pass, for a moment: plane 1, slope 3.39, between them 5.892."""
    r, slope = 4.0, np.radians(68)
    low, high = (-20.0, -15.0, -10.0), (20.0, 15.0, 60.0)
    zmap = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.25).zmap
    foot = r * np.tan(slope / 2)                             # the ball rests on plane and slope where its centre stands at x = 0
    surface = np.maximum(1.0, np.tan(slope) * (zmap.xy_mm[:, 0] - foot) + 1 / np.cos(slope))
    stock = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.25, top_mm=surface.reshape(zmap.shape).clip(-10, 60))
    up = np.array([np.cos(slope), 0, np.sin(slope)]) * 12
    found = looked([feed(0, 0, 0), feed(up[0], 0, up[2])], {1: tool("ball", 2 * r, flute=20)}, (-30, 0, 0), stock, Look.finer(2))
    corner = np.flatnonzero(found.row == 0)[-1]
    assert found.tip_mm[corner] == pytest.approx([0, 0, 0])
    assert found.highest_mm[corner] == pytest.approx(float(transition_depth_mm(r, 1.0, slope)), abs=0.02 * r)
    assert found.highest_mm[inner(found, 0, within=12) & (found.tip_mm[:, 0] < -9)] == pytest.approx(1, abs=FULL * r)
    on = np.flatnonzero(found.row == 1)[-2]                 # uphill the ball cuts with its side: from the contact on the slope
    assert found.depth_mm[on] == pytest.approx(float(inclined_depth_mm(r, 1.0, slope)), abs=0.03 * r)
    assert found.lowest_mm[on] == pytest.approx(r * (1 - np.cos(slope)), abs=0.03 * r)


def test_flat_cutters_helices_and_plunges():
    flat = {1: tool("flat", 10)}
    found = looked([feed(40, 0, -3)], flat, (-40, 0, -3))
    mine = inner(found, 0)
    assert found.highest_mm[mine] == pytest.approx(3, abs=FULL * 5) and found.area_mm2[mine] == pytest.approx(30, rel=0.02)
    side = looked([feed(-40, 2.5, -3), feed(40, 2.5, -3)], flat, (-40, -40, -3), FoundStock(min_mm=(-30, 0, -20), max_mm=(
        30, 30, 0), pitch_mm=1.0))
    assert np.degrees(side.immersion_rad[inner(side, 1)]) == pytest.approx(180 - np.degrees(np.arccos(0.5)), abs=2)
    down = looked([feed(0, 0, -4)], flat, (0, 0, 10))
    deep = down.tip_mm[:, 2] < -1
    assert down.area_mm2[deep] == pytest.approx(np.pi * 25, rel=0.02)
    around = looked([arc((5, 0, -2), (0, 0, 0), Plane.XY)], flat, (5, 0, 0))
    assert around.cuts.any() and around.way_mm.sum() == pytest.approx(np.hypot(10 * np.pi, 2), rel=1e-3)


def test_brute_force_over_random_moves_agrees():
    """Ends within 1 % of the radius, the arcs of a ring together within 1 % of a turn; bench/engagement.py has ten thousand."""
    rng, r, places = np.random.default_rng(5), 3.0, []
    box = (-8.0, -8.0, -10.0), (8.0, 8.0, 0.0)
    stock = FoundStock(min_mm=box[0], max_mm=box[1], pitch_mm=1.0)
    for _ in range(8):
        ends = rng.uniform((-7, -7, -2.5), (7, 7, -0.3), (8, 3))
        ways = list(zip(ends[:-1], ends[1:]))
        found = looked([feed(*end) for end in ends[1:]], {1: tool("ball", 2 * r)}, ends[0], stock, Look(
            apart=1.0, ring_rad=np.radians(2.5), round_rad=np.radians(1.0)))
        for k in np.flatnonzero(np.diff(found.row, prepend=-1) == 0):
            (start, end), tip = ways[found.row[k]], found.tip_mm[k]
            way = (end - start) / np.linalg.norm(end - start)
            if np.linalg.norm(tip - start) > 0.4 and np.linalg.norm(tip - end) > 1e-6:
                places.append(((found.lowest_mm[k], found.highest_mm[k], found.immersion_rad[k]), tip, way,
                               [*ways[:found.row[k]], (start, tip - 0.1 * r * way)]))
    seen, tips, directions, before = zip(*places)
    off, alone = off_by(np.array(seen), met(tips, directions, before, r, box), r)
    assert len(off) > 40 and max(alone, default=0.0) < 0.01
    assert np.abs(off).max() < 0.01 + 1 / 360          # brute force looks at every half degree


def leaning(middles, axes, r, kinds=None):
    """PostedMoves of a ball whose middle runs through places (n, 3) with axes (n - 1, 3), each still along its move."""
    posted = program((0, 0, 0), [feed(0, 0, 0)] * (len(middles) - 1) if kinds is None else kinds)
    a, b = (np.asarray(middles, float)[part] - r * np.asarray(axes, float) for part in (slice(None, -1), slice(1, None)))
    return replace(posted, start_mm=a, end_mm=b, start_axis=np.array(axes, float), end_axis=np.array(axes, float))


@pytest.mark.parametrize("r, t, lean_deg", [(5.41, 1.0, 25.0), (4.0, 1.0, 30.0), (5.0, 0.5, 15.0)])
def test_an_inclined_ball_meets_what_the_closed_forms_say(r, t, lean_deg):
    """Its axis leans ahead: the edge cuts from the contact on, the tip stays out."""
    lean = np.radians(lean_deg)
    posted = leaning([(-40, 0, r - t), (40, 0, r - t)], [(np.sin(lean), 0, np.cos(lean))], r)
    found = engagement(posted, {1: tool("ball", 2 * r)}, BLOCK)
    mine = np.abs(found.tip_mm[:, 0]) < 10
    assert found.unseen == () and mine.sum() > 3 and not found.has_tip(r)[mine].any()
    assert found.depth_mm[mine] == pytest.approx(float(inclined_depth_mm(r, t, lean)), abs=FULL * r)
    assert found.lowest_radius_mm[mine] == pytest.approx(r * np.sin(lean), abs=FULL * r)
    area = r * r * np.arccos(1 - t / r) - (r - t) * np.sqrt(2 * r * t - t * t)
    assert found.area_mm2[mine] == pytest.approx(area, rel=0.09)           # rings ten degrees apart
    fine = engagement(posted, {1: tool("ball", 2 * r)}, BLOCK, Look.finer(5))
    assert fine.area_mm2[np.abs(fine.tip_mm[:, 0]) < 10] == pytest.approx(area, rel=0.02)


def test_what_leaning_balls_have_cut_is_gone_for_those_that_come_after():
    """The same way of the ball's middle, leaning, upright, leaning another way, then a fresh one beside it."""
    lean = np.radians(20)
    axes = [(np.sin(lean), 0, np.cos(lean)), (0, 0, 1), (0, np.sin(lean), np.cos(lean)), (0, 0, 1), (0, np.sin(lean), np.cos(lean))]
    middles = [(-25, 0, 4), (25, 0, 4), (-25, 0, 4), (25, 0, 4), (25, 1, 4), (-25, 1, 4)]
    found = engagement(leaning(middles, axes, 5.0), {1: tool("ball", 10)}, BLOCK, replace(Look.finer(3), apart=0.2))
    inside = np.abs(found.tip_mm[:, 0]) < 15
    cut = lambda row: found.cuts[inside & (found.row == row)]
    assert cut(0).all() and len(cut(1)) and not cut(1).any() and len(cut(2)) and not cut(2).any() and cut(4).all()
    strip = found.area_mm2[inside & (found.row == 4)]
    assert strip == pytest.approx(1.0, rel=0.03)            # a stepover wide and the layer deep, whichever way it leans


def test_the_document_says_what_operations_take_and_what_is_not_looked_at():
    posted = program((-40, 0, -1), [feed(40, 0, -1), rapid(40, 0, 20), rapid(0, 15, 20), feed(0, 15, -3)],
                     operation=np.array([0, 0, 1, 1]), operations=("groove", "holes"), tool=np.array([1, 1, 2, 2]))
    drill = tool("ball", 4, number=2)
    drill = drill.model_copy(update={"cutter": drill.cutter.model_copy(update={"type": "drill", "point_angle_deg": 118.0})})
    found = engagement(posted, {1: tool("ball", 10), 2: drill}, BLOCK)
    document = process_document(posted, {1: tool("ball", 10), 2: drill}, found, met_at_places(posted, found, posted.spindle_rpm))
    groove, = document["operations"]
    volume = 60 * (25 * np.arccos(0.8) - 12)
    assert groove["name"] == "groove" and groove["removed_mm3"] == pytest.approx(volume, rel=0.06)
    assert groove["tip_share"] == pytest.approx(0.75, abs=0.08) and groove["depth_mm"] == pytest.approx(1, abs=0.03)
    assert groove["removal_most_cm3_per_h"] == pytest.approx(0.06 * 500 * volume / 60, rel=0.03) and groove["depth_line"] == 10
    assert groove["highest_speed_m_per_min"] == pytest.approx(2 * np.pi * 3 * 8, rel=0.01)
    assert groove["lowest_speed_m_per_min"] < 0.01
    assert document["not_checked"].startswith("1 operation: holes.")


def test_a_spindle_that_stood_still_has_come_to_its_speed():
    """Rotary axes turn before M3: what follows is no ramp from 0."""
    posted = program((0, 0, 50), [rapid(0, 0, 50), rapid(0, 0, 2), feed(10, 0, 2)], spindle_rpm=np.array([0.0, 8000.0, 8000.0]))
    assert turned_rpm(posted, 1000.0).tolist() == [0.0, 8000.0, 8000.0]
