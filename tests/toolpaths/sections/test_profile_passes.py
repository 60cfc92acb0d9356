"""Section passes, the planes they run in, and the moves they become."""

import math

import cadquery as cq
import numpy as np
import pytest
from known_parts import LARGEST_RADIUS_MM, TOLERANCE_MM, Drawing, planner, swept

from cuspline.designs.z_profile import ZProfile, design
from cuspline.kernel.brep import bounding_box_mm, planning_mesh, the_solid
from cuspline.program.program import Kind, Plane
from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_tips_mm
from cuspline.toolpaths.sections.pass_links import LinkRules, moves_of_passes
from cuspline.toolpaths.sections.profile_passes import planes_across, reversed_element

MESH_MM = 0.01          # deflection of the planning mesh; OCCT takes up to three times that


def passes_of(solid, plane, radius, acrosses, allowance=0.0):
    p = planner(solid, plane, radius, allowance)
    wanted = {i for i, f in enumerate(p.centers.faces) if f.middle.normal[0, 2] > -1e-6}
    return p, [p.section_passes(c, *p.extent(*bounding_box_mm(solid)), wanted)[0] for c in acrosses]


def flat_arch(d, radius=3e4, width=200.0):
    """A block whose top is an arc flatter than the control takes."""
    half = math.degrees(math.asin(width / 2 / radius))
    left = (0.0, 20 + radius * math.cos(math.radians(half)) - radius)
    return swept(d, d.closed([d.arc((width / 2, 20 - radius), radius, 90 - half, 90 + half)], left, (width, left[1])))


@pytest.mark.parametrize("plane", ["ZX", "YZ"])
def test_an_arc_too_flat_for_the_control_becomes_chords_within_the_tolerance(plane):
    solid = flat_arch(Drawing(plane))
    _, (section,) = passes_of(solid, plane, 5.0, [7.0])
    top = [e for e in section.elements if e.radius > LARGEST_RADIUS_MM and 0 < (e.start[0] + e.end[0]) / 2 < 200]
    assert all(e.center is None for e in top) and len(top) >= 3
    for e in top:
        length = math.dist(e.start, e.end)
        assert length ** 2 / (8 * 3e4) < TOLERANCE_MM
        middle = np.add(e.start, e.end) / 2 + (0, 5.0)
        assert abs(math.dist(middle, (100, 20 - 3e4)) - (3e4 + 5)) < TOLERANCE_MM


def test_the_programmed_point_is_the_south_pole():
    solid = swept(Drawing(), Drawing().closed([Drawing().line((0, 20), (30, 20))], (0, 20), (30, 20)))
    p = planner(solid, "ZX", 4.0)
    section = p.section_passes(7.0, *p.extent(*bounding_box_mm(solid)), {0, 1, 2, 3, 4, 5})[0]
    level = [e for e in section.elements if abs(e.start[1] - e.end[1]) < 1e-9 and e.end[0] - e.start[0] > 29]
    assert level[0].start[1] == pytest.approx(20.0, abs=1e-9)


def test_an_allowance_lifts_the_pass_off_the_part_by_it():
    solid = the_solid(design(ZProfile()).solid)
    _, (exact,) = passes_of(solid, "ZX", 5.0, [40.0])
    _, (off,) = passes_of(solid, "ZX", 5.0, [40.0], allowance=0.3)
    for section, offset in ((exact, 5.0), (off, 5.3)):
        radii = np.array([e.radius for e in section.elements if e.center is not None])
        for wanted in (34 + offset, 6 - offset, offset):
            assert np.abs(radii - wanted).min() < 1e-9


def test_a_pass_run_backward_is_the_same_geometry():
    _, (section,) = passes_of(the_solid(design(ZProfile()).solid), "ZX", 5.0, [40.0])
    for e in section.elements:
        back = reversed_element(e)
        assert (back.start, back.end, back.center, back.radius) == (e.end, e.start, e.center, e.radius)
        assert reversed_element(back) == e


def test_arc_faces_leave_as_arcs_and_the_default_part_takes_few_blocks():
    _, (section,) = passes_of(the_solid(design(ZProfile()).solid), "ZX", 5.0, [40.0])
    radii = [e.radius for e in section.elements if e.center is not None]
    assert any(r == pytest.approx(39.0, abs=1e-9) for r in radii)          # convex 34 + 5
    assert any(r == pytest.approx(1.0, abs=1e-9) for r in radii)           # concave 6 - 5
    assert any(r == pytest.approx(5.0, abs=1e-9) for r in radii)           # the step's corner
    assert len(section.elements) <= 20


# planes -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [0.3, 0.7, 100.0])
def test_planes_reach_from_end_to_end_no_further_apart_than_allowed(step):
    planes = planes_across(-3.0, 17.0, lambda low, high: step)
    assert planes[0] == -3.0 and planes[-1] == 17.0
    steps = np.diff(planes)
    assert steps.max() <= step + 1e-12 and len(planes) == math.ceil(20 / step) + 1
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)      # evened out


def test_planes_lie_closer_where_they_must():
    allowed = lambda low, high: 0.2 if high > 10 else 1.0
    planes = np.array(planes_across(0.0, 20.0, allowed))
    steps = np.diff(planes)
    assert steps[planes[1:] > 10 + 1e-9].max() <= 0.2 + 1e-12 and steps[0] > 0.5


def test_one_plane_where_there_is_no_width():
    assert planes_across(5.0, 5.0, lambda low, high: 1.0) == [5.0]


# moves ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["ZX", "YZ"])
def block(request):
    d = design(ZProfile(section_plane=request.param, width_mm=20))
    solid = the_solid(d.solid)
    mesh = planning_mesh(solid, MESH_MM)
    return request.param, solid, DropMesh.from_triangles(mesh.vertices_mm, mesh.triangles)


def rules_for(mesh, **changes):
    return LinkRules(**{**dict(mesh=mesh, ball_radius_mm=5.0, allowance_mm=0.0, lead_radius_mm=2.0, clearance_z_mm=50.0,
                               approach_z_mm=45.0, feed_mm_per_min=1000.0, plunge_mm_per_min=300.0, is_one_way=False),
                        **changes})


def cut(block, **changes):
    plane, solid, mesh = block
    p, sections = passes_of(solid, plane, 5.0, np.linspace(0, 20, 6))
    return moves_of_passes(sections, p.plane, rules_for(mesh, **changes)), mesh


def sampled(moves, row, count=25):
    start, end, center = moves.starts_mm[row], moves.end_mm[row], moves.center_mm[row]
    share = np.linspace(0, 1, count)
    if moves.kind[row] < Kind.ARC_CW:
        return start + share[:, None] * (end - start)
    a, b, c = Plane(int(moves.plane[row])).axes
    first, last = (math.atan2(p[b] - center[b], p[a] - center[a]) for p in (start, end))
    turn = (last - first) % (2 * math.pi) if moves.kind[row] == Kind.ARC_CCW else -((first - last) % (2 * math.pi))
    radius, points = math.hypot(start[a] - center[a], start[b] - center[b]), np.empty((count, 3))
    points[:, a] = center[a] + radius * np.cos(first + share * turn)
    points[:, b] = center[b] + radius * np.sin(first + share * turn)
    points[:, c] = start[c] + share * (end[c] - start[c])
    return points


@pytest.mark.parametrize("is_one_way", [False, True])
def test_no_move_of_an_operation_cuts_into_the_part(block, is_one_way):
    moves, mesh = cut(block, is_one_way=is_one_way)
    tips = np.vstack([sampled(moves, k) for k in range(len(moves))])
    # beside an upright wall 1e-7 mm along is any height: a ball smaller by the mesh's deviation must be clear
    assert (drop_tips_mm(mesh, tips[:, :2], 4.97, 4.97) - tips[:, 2]).max() < 3 * MESH_MM


@pytest.mark.parametrize("is_one_way", [False, True])
def test_rapids_run_at_clearance_or_straight_up_and_down_above_the_approach(block, is_one_way):
    moves, _ = cut(block, is_one_way=is_one_way)
    for row in np.flatnonzero(moves.kind == Kind.RAPID):
        start, end = moves.starts_mm[row], moves.end_mm[row]
        if np.abs(end[:2] - start[:2]).max() > 1e-9:
            assert min(start[2], end[2]) >= 50.0 - 1e-9
        elif end[2] < start[2]:
            assert end[2] >= 45.0 - 1e-9
    assert moves.start_mm[2] == 50.0 and moves.end_mm[-1, 2] == 50.0


def test_one_way_passes_all_run_the_same_way_and_zig_zag_passes_alternate(block):
    plane = block[0]
    along = 0 if plane == "ZX" else 1
    for is_one_way in (True, False):
        moves, _ = cut(block, is_one_way=is_one_way)
        ways = []
        for across in np.linspace(0, 20, 6):
            rows = np.flatnonzero((moves.kind != Kind.RAPID) & (np.abs(moves.end_mm[:, 1 - along] - across) < 1e-9)
                                  & (np.abs(moves.starts_mm[:, 1 - along] - across) < 1e-9))
            ways.append(np.sign((moves.end_mm[rows, along] - moves.starts_mm[rows, along]).sum()))
        assert ways == ([1] * 6 if is_one_way else [1, -1] * 3)


def test_arcs_of_moves_lie_in_the_section_plane_with_equal_radii(block):
    moves, _ = cut(block)
    arcs = np.flatnonzero(moves.kind >= Kind.ARC_CW)
    assert len(arcs) > 20 and set(moves.plane[arcs]) == {Plane.ZX if block[0] == "ZX" else Plane.YZ}
    for k in arcs:
        a, b, _ = Plane(int(moves.plane[k])).axes
        start, end = moves.starts_mm[k], moves.end_mm[k]
        radii = [math.hypot(p[a] - moves.center_mm[k, a], p[b] - moves.center_mm[k, b]) for p in (start, end)]
        # a joint may lie MERGE_MM (1e-5) beside the exact end of an arc
        assert radii[0] == pytest.approx(radii[1], abs=2e-5)


def test_moves_are_the_same_twice(block):
    first, second = (cut(block)[0] for _ in range(2))
    for name in ("kind", "end_mm", "center_mm", "plane", "feed_mm_per_min"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def test_over_a_hole_wider_than_the_ball_the_pass_splits_and_over_a_narrow_one_it_goes_on():
    for hole_mm, expected in ((16.0, 2), (3.0, 1)):
        solid = the_solid(cq.Workplane().box(60, 20, 12, centered=False).faces(">Z").workplane(
            centerOption="CenterOfMass").hole(hole_mm))
        p = planner(solid, "ZX", 5.0)
        top = {i for i, f in enumerate(p.centers.faces) if f.middle.normal[0, 2] > 0.9}
        found = p.section_passes(10.0, *p.extent(*bounding_box_mm(solid)), top)
        assert len(found) == expected
        # each pass ends where the ball touches the rim of the hole from above, and nowhere dips into it
        assert all(min(e.start[1], e.end[1]) > 12.0 - 5.0 for section in found for e in section.elements)
        if expected == 2:
            assert found[0].end[0] == pytest.approx(30 - hole_mm / 2, abs=1e-6)
            assert found[1].start[0] == pytest.approx(30 + hole_mm / 2, abs=1e-6)
