"""The certificate of posted programs: known-bad lines are found, good ones keep to the bound, nothing is silent."""

from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from brute_depth import depth_of
from exact_parts import patch_solid, random_poles
from known_programs import arc, feed, program, rapid, tool

from cuspline.design.job import read_job, read_tools
from cuspline.kernel import brep
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Plane
from cuspline.shop.cutters import Cutter
from cuspline.surfaces.trims import CHORD_MM
from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_tips_mm
from cuspline.values.errors import SimulationError
from cuspline.values.frames import Frame
from cuspline.verification.certificate import certify, gouges_beyond, solid_in_wcs
from cuspline.verification.certificate_chords import chords_of

RADIUS_MM = 4.0
TOLERANCE_MM = 2e-3
BALL = {1: tool("ball", 2 * RADIUS_MM)}


@pytest.fixture(scope="module")
def hills():
    return patch_solid(random_poles(5, height_mm=1.0), -8.0)


@pytest.fixture(scope="module")
def hilly_part(hills):
    return ExactPart.of_solid(hills)


def zigzag(part, rows, columns):
    """(rows * columns, 3) tips of a ball over the hills, row by row to and fro."""
    x, y = np.meshgrid(np.linspace(2, 28, columns), np.linspace(2, 22, rows))
    x[1::2] = x[1::2, ::-1]
    xy = np.column_stack([x.ravel(), y.ravel()])
    return np.column_stack([xy, drop_tips_mm(part, xy, RADIUS_MM, RADIUS_MM)])


def posted_tips(tips, **changes):
    """PostedMoves of feeds through tips."""
    n = len(tips) - 1
    nothing = np.zeros(n)
    columns = {"kind": np.ones(n), "start_mm": tips[:-1], "end_mm": tips[1:], "center_mm": np.full((n, 3), np.nan),
               "plane": nothing, "turns": nothing, "feed_mm_per_min": nothing + 500, "spindle_rpm": nothing + 8000,
               "tool": nothing + 1, "length_offset_on": nothing == 0, "machine_end_mm": tips[1:],
               "line": np.arange(n) + 10, "operation": nothing, "operations": ("finish",), "ended": True}
    return PostedMoves(**{**columns, **changes})


def test_one_wrong_line_among_a_hundred_thousand_is_found(hills, hilly_part):
    tips = zigzag(hilly_part, 317, 317)
    good = certify(posted_tips(tips), BALL, hilly_part, tolerance_mm=TOLERANCE_MM)
    assert len(good.row) == 317 * 317 - 1 > 100_000 and good.is_complete
    assert good.proven_mm <= TOLERANCE_MM and not gouges_beyond(good, TOLERANCE_MM)
    # a coarse sampling, and a move down in a valley that no sample sees
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 31), np.linspace(0, 1, 25)))
    top = max(brep.faces_of(hills), key=lambda f: f.middle.point_mm[0, 2])
    samples = top.nurbs.derivatives(u, v)[:, 0]
    middle = (tips[:-1] + tips[1:]) / 2
    aside = np.array([np.hypot(*(samples[:, :2] - m[:2]).T).min() for m in middle[::97]])
    row = 97 * int(np.where(aside > 0.55, -middle[::97, 2], -np.inf).argmax())
    start, end = tips[:-1].copy(), tips[1:].copy()
    start[row, 2] -= 0.008
    end[row, 2] -= 0.008
    for t in (0.0, 0.5, 1.0):
        assert depth_of(samples - start[row] - t * (end[row] - start[row]), RADIUS_MM, RADIUS_MM).max() < 0.0
    bad = certify(posted_tips(tips, start_mm=start, end_mm=end), BALL, hilly_part, tolerance_mm=TOLERANCE_MM)
    (found,) = gouges_beyond(bad, TOLERANCE_MM)
    assert found.row == row and 0.006 < found.depth_mm <= 0.008 + TOLERANCE_MM
    assert np.hypot(*(np.array(found.place_mm) - middle[row])[:2]) < RADIUS_MM
    tip = start[row] + found.share * (end[row] - start[row])
    assert depth_of(np.array(found.place_mm) - tip, RADIUS_MM, RADIUS_MM) >= found.depth_mm - TOLERANCE_MM


def test_a_mirrored_program_and_a_wrong_tool_table_are_found(hilly_part):
    tips = zigzag(hilly_part, 12, 150)
    mirrored = certify(posted_tips(tips * (-1, 1, 1) + (30, 0, 0)), BALL, hilly_part, tolerance_mm=TOLERANCE_MM)
    assert len(gouges_beyond(mirrored, 0.1)) > 300
    radius = RADIUS_MM + 0.02
    cutter = BALL[1].cutter.model_copy(update={"diameter_mm": 2 * radius, "corner_radius_mm": radius})
    larger = certify(posted_tips(tips), {1: BALL[1].model_copy(update={"cutter": cutter})}, hilly_part,
                     tolerance_mm=TOLERANCE_MM)
    growth = larger.bound_mm - certify(posted_tips(tips), BALL, hilly_part, tolerance_mm=TOLERANCE_MM).bound_mm
    assert len(gouges_beyond(larger, TOLERANCE_MM)) > 10            # only where it is steep: the tip stays where it was
    assert TOLERANCE_MM < growth.max() <= 0.02 + TOLERANCE_MM and growth.min() >= -TOLERANCE_MM


def test_a_rapid_through_the_part_is_found(hilly_part):
    posted = program((-9, 12, 20), [rapid(-9, 12, -2), rapid(40, 12, -2), rapid(40, 12, 20), rapid(-9, 12, 20)])
    certificate = certify(posted, BALL, hilly_part, tolerance_mm=TOLERANCE_MM)
    assert [g.row for g in gouges_beyond(certificate, TOLERANCE_MM)] == [1]
    assert certificate.bound_mm[1] > 1.0 and certificate.moves_proven == {"rapids": 4, "feeds": 0, "arcs": 0}


@pytest.mark.parametrize("low, deep", [(0.0, 0.0), (0.008, 0.008)])
def test_arcs_are_proven_with_what_their_chords_lose(low, deep):
    above = cq.Workplane().box(40, 80, 20, centered=(True, True, False))
    log = cq.Workplane("XZ").circle(10).extrude(-30).intersect(above)
    plate = cq.Workplane().box(60, 80, 2, centered=(True, True, False)).translate((0, 0, -2))
    part = ExactPart.of_solid(log.union(plate).val().wrapped)
    top = 10.0 - low
    posted = program((0.0, 10, top), [arc((14 * np.sin(1.0), 10, 14 * np.cos(1.0) - RADIUS_MM - low),
                                          (0, 10, -RADIUS_MM - low), Plane.ZX)])
    certificate = certify(posted, BALL, part, tolerance_mm=TOLERANCE_MM)
    bound = certificate.bound_mm[0]
    assert certificate.sagitta_mm == pytest.approx(TOLERANCE_MM / 10)
    assert deep <= bound <= deep + TOLERANCE_MM


@pytest.mark.parametrize("kind, corner", [("ball", None), ("bull_nose", 1.0), ("flat", None)])
def test_a_helix_round_a_post_touches_it_without_a_gouge(kind, corner):
    post = ExactPart.of_solid(cq.Workplane().circle(6).extrude(12).val().wrapped)
    mill, ring = {1: tool(kind, 2 * RADIUS_MM, corner)}, 6 + RADIUS_MM
    for into, expected in ((0.0, 0.0), (0.01, 0.01)):
        posted = program((ring - into, 0, 9.0), [arc((ring - into, 0, 3.0), (0, 0, 9.0), Plane.XY)])
        bound = certify(posted, mill, post, tolerance_mm=TOLERANCE_MM).bound_mm[0]
        assert expected - 1e-9 <= bound <= expected + TOLERANCE_MM


@pytest.mark.parametrize("start", [(1.0, 1.0), (1.0, 0.0), (-1.0, 1.0)])
def test_a_post_in_the_way_of_a_circle_is_found_wherever_the_circle_begins(start):
    """Of the part only what lies under the moves is looked at: a circle goes farther than its ends."""
    ground = cq.Workplane().box(100, 100, 2, centered=(True, True, False)).translate((0, 0, -2))
    part = ExactPart.of_solid(ground.union(cq.Workplane().center(-40, 0).circle(2).extrude(8)).val().wrapped)
    begin = (*(40 * np.array(start) / np.hypot(*start)), 5.0)
    bound = certify(program(begin, [arc(begin, (0, 0, 5.0), Plane.XY)]), BALL, part, tolerance_mm=TOLERANCE_MM).bound_mm[0]
    assert bound == pytest.approx(3.0, abs=0.07)            # a fiftieth of the gouge


def test_chords_stay_on_their_arcs():
    rng = np.random.default_rng(2)
    chords = chords_of(program((0.0, 10.0, 0.0), [arc((10.0, 0, 3.0), (0, 0, 0), Plane.XY)]), [0], 1e-3)
    angle = np.pi / 2 * (1 + 3 * rng.uniform(size=500))             # from (0, 10) on to (10, 0), counter-clockwise
    share = (angle - np.pi / 2) / (1.5 * np.pi)
    true = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), 3 * share])
    k = np.searchsorted(chords.share[:, 0], share, side="right") - 1
    local = (share - chords.share[k, 0]) / np.diff(chords.share[k], axis=1)[:, 0]
    on_chord = chords.start_mm[k] + local[:, None] * (chords.end_mm - chords.start_mm)[k]
    off = np.linalg.norm(true - on_chord, axis=1)
    assert 0.5e-3 < off.max() and (off <= chords.off_mm[k]).all() and chords.off_mm.max() <= 1e-3
    with pytest.raises(SimulationError, match="radius"):
        chords_of(program((0.0, 10.0, 0.0), [arc((9.0, 0, 3.0), (0, 0, 0), Plane.XY)]), [0], 1e-3)


def test_what_cannot_be_proven_is_listed(hilly_part):
    moves = [rapid(0, 0, 20)] + [feed(k, 0, 20) for k in range(5)]
    lost = np.full((6, 3), 20.0)
    lost[0, 0] = np.nan
    lens = tool("ball", 6.0).model_copy(update={"cutter": tool("ball", 6.0).cutter.model_copy(update={"type": "lens"})})
    posted = program((0, 0, 20), moves, tool=[1, 1, 2, 0, 3, 1], start_mm=lost)
    axes = np.tile([0.0, 0.0, 1.0], (6, 1))
    axes[5] = (0.6, 0.0, 0.8)
    tilted = replace(posted, start_axis=axes, end_axis=axes)
    certificate = certify(tilted, {**BALL, 3: lens}, hilly_part, tolerance_mm=TOLERANCE_MM)
    assert certificate.row.tolist() == [1] and not certificate.is_complete
    assert [row for row, _ in certificate.uncovered] == [0, 2, 3, 4, 5]
    for (_, reason), word in zip(certificate.uncovered, ("begins", "T2", "no tool", "lens", "tilted")):
        assert word in reason
    some = certify(posted, BALL, hilly_part, tolerance_mm=TOLERANCE_MM, rows=[5, 1])
    assert some.row.tolist() == [1, 5] and some.proven_mm == 0.0


@pytest.mark.parametrize("shape, depth_mm", [
    (dict(type="lens", corner_radius_mm=1, tip_radius_mm=40.0), 0.05),
    (dict(type="apt", corner_radius_mm=30.0, tip_angle_deg=20.0, taper_deg=0.0, corner_center_radius_mm=-25.0,
          corner_center_height_mm=16.0), 0.05 * np.cos(np.radians(20.0)))], ids=["lens", "barrel"])
def test_an_upright_lens_and_barrel_are_proven_as_deep_as_their_tip_is_in_a_level_face(shape, depth_mm):
    """Of a barrel the nearest of its surface is its bottom, a cone of 20 degrees.  Clear of the face: what borders are known to."""
    block = cq.Workplane().box(40, 40, 10, centered=(True, True, False)).translate((0, 0, -10)).val()
    cutter = Cutter(name="t", flutes=2, flute_length_mm=24.0, neck_diameter_mm=4.0, reach_mm=30.0, shank_diameter_mm=10.0,
                    overall_length_mm=80.0, diameter_mm=10, **shape)
    tools = {1: tool("ball", 10.0).model_copy(update={"cutter": cutter})}
    posted = program((0, 0, 20), [feed(-5, 0, 0.5), feed(5, 0, 0.5), feed(5, 0, -0.05), feed(-5, 0, -0.05)])
    certificate = certify(posted, tools, None, solid=brep.the_solid(block), tolerance_mm=TOLERANCE_MM)
    assert certificate.is_complete and (certificate.bound_mm[:2] <= CHORD_MM).all()
    assert (depth_mm - 1e-9 <= certificate.bound_mm[2:]).all() and (certificate.bound_mm[2:] <= depth_mm + TOLERANCE_MM).all()


def test_the_part_turned_into_the_wcs_is_proven_alike(hills, hilly_part):
    a = np.radians(30.0)
    frame = Frame(rotation=[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]], origin_mm=[5.0, -3, 2])
    tips = zigzag(hilly_part, 4, 60)
    tips[40:60, 2] -= 0.02
    here = certify(posted_tips(tips), BALL, hilly_part, tolerance_mm=TOLERANCE_MM)
    there = certify(posted_tips(frame.into(tips)), BALL, ExactPart.of_solid(solid_in_wcs(hills, frame)), tolerance_mm=TOLERANCE_MM)
    np.testing.assert_allclose(here.bound_mm, there.bound_mm, rtol=0, atol=TOLERANCE_MM)
    deep = [sorted(g.row for g in gouges_beyond(c, 0.01)) for c in (here, there)]
    assert deep[0] == deep[1] and len(deep[0]) >= 19


def test_a_posted_part_beside_its_upright_wall_is_proven(default_part):
    job, tools = read_job(default_part), read_tools(default_part)
    item = job.posted[0]
    posted = read_program((default_part / item.program).read_text(),
                          work_offsets={item.setup.wcs: job.machine.wcs_origin_mm},
                          tool_lengths={n: t.length_mm for n, t in tools.items()})
    part = ExactPart.of_solid(solid_in_wcs(brep.read_step(default_part / job.step), item.setup.frame))
    certificate = certify(posted, tools, part, tolerance_mm=1e-3)
    assert certificate.proven_mm <= job.finish.gouge_mm
    assert all(row < 3 for row, _ in certificate.uncovered)         # the way to the first known place
    lower = replace(posted, start_mm=posted.start_mm - (0, 0, 0.01), end_mm=posted.end_mm - (0, 0, 0.01),
                    center_mm=posted.center_mm - (0, 0, 0.01))
    assert 0.008 < certify(lower, tools, part, tolerance_mm=1e-3).proven_mm < 0.014
