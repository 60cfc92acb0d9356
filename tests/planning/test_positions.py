"""Which directions see what of a part: areas in closed form, and each place that counts as seen tried by itself."""

import json
from dataclasses import replace

import cadquery as cq
import numpy as np
import pytest
from built_parts import ran

from cuspline.app.catalogue import find_library, find_machine
from cuspline.design import FixtureBox, Setup
from cuspline.kernel import brep
from cuspline.planning.positions import AS_IT_LIES, Held, directions, positions, turnable, ways_with_room
from cuspline.replay.machine_bodies import beside_the_spindle, turned_to
from cuspline.values.errors import CutterDoesNotFit
from cuspline.values.frames import Frame

SIDE_MM = 20.0
CUBE = cq.Workplane().box(SIDE_MM, SIDE_MM, SIDE_MM)
LIBRARY = find_library(None)


def seen(part, **how):
    solid = brep.the_solid(part)
    return positions(solid, list(range(len(brep.faces_of(solid)))), LIBRARY, **how)


def test_each_side_of_a_cube_wants_a_position_of_its_own():
    found = seen(CUBE, steepest_deg=30)
    assert len(found.positions) == 6 and found.left_mm2 == pytest.approx(0, abs=1e-6)
    assert [p.adds_mm2 for p in found.positions] == pytest.approx([SIDE_MM ** 2] * 6, rel=0.1)     # some places stand for all
    assert sum(p.adds_mm2 for p in found.positions) == pytest.approx(6 * SIDE_MM ** 2)
    normals = np.array([p.direction for p in found.positions])
    assert sorted(np.abs(normals).argmax(axis=1)) == [0, 0, 1, 1, 2, 2]
    assert np.abs(normals).max(axis=1).min() > np.cos(np.radians(30))
    assert found.positions[0].tool.cutter.diameter_mm == max(t.cutter.diameter_mm for t in LIBRARY.of_type("ball"))


def test_a_leaning_tool_sees_two_sides_or_three():
    assert len(seen(CUBE, steepest_deg=60).positions) <= 3


def test_what_no_ball_fits_into_is_left_with_its_area():
    width, depth = 3.0, 6.0                     # the smallest ball is of 4 mm
    slot = CUBE.faces(">Z").workplane().rect(SIDE_MM, width).cutBlind(-depth)
    found = seen(slot, steepest_deg=30)
    assert found.left_mm2 == pytest.approx(SIDE_MM * (width + 2 * depth), rel=0.1)
    assert abs(found.left_at_mm[1]) <= width / 2 + 1e-6 and found.left_at_mm[2] > SIDE_MM / 2 - depth - 1e-6


def test_where_the_holder_would_touch_a_place_is_not_seen():
    deep = cq.Workplane().box(60, 60, 60).faces(">Z").workplane().rect(24, 24).cutBlind(-55)     # the longest sticks out 55
    floor = next(k for k, f in enumerate(brep.faces_of(brep.the_solid(deep)))
                 if f.middle.normal[0, 2] > 0.9 and abs(f.middle.point_mm[0, 2] + 25) < 1)
    found = positions(brep.the_solid(deep), [floor], LIBRARY, steepest_deg=30, standing_mm=0.5)
    assert found.positions == () and found.left_mm2 == pytest.approx(24 * 24)


ON_TABLE = Held.on(find_machine("mill_a_on_b"), Frame.of_axes(np.zeros(3), (1, 0, 0), (0, 0, 1)))


def along(*way):
    """The part on the table, seen from one direction."""
    return replace(ON_TABLE, ways=np.array([way], float))


def test_where_the_spindle_would_meet_the_part_is_not_seen():
    """The spindle begins 155 mm above the tip of the longest ball, 90 mm round its axis: a tower of 170 mm stands in its way."""
    plate = cq.Workplane().box(20, 20, 10, centered=(True, True, False))
    for height, is_in_the_way in ((140.0, False), (170.0, True)):
        part = plate.union(cq.Workplane().center(50, 0).box(100, 10, 5, centered=(True, True, False))).union(
            cq.Workplane().center(100, 0).box(10, 10, height, centered=(True, True, False)))
        solid = brep.the_solid(part)
        floor = [k for k, f in enumerate(brep.faces_of(solid)) if abs(f.middle.point_mm[0, 2] - 10) < 1e-6]
        assert len(positions(solid, floor, LIBRARY, ways=np.array([[0.0, 0.0, 1.0]]), steepest_deg=30).positions) == 1
        reached = positions(solid, floor, LIBRARY, ways=along(0, 0, 1), steepest_deg=30)
        near = 100 - 5 - 90 - 1         # of the tower's side: nearer to it the tool does not come down
        assert reached.left_mm2 / SIDE_MM ** 2 == pytest.approx((10 - near) / SIDE_MM if is_in_the_way else 0.0, abs=0.05)


def test_the_table_that_holds_the_part_is_in_the_way_from_behind():
    """The face of the rotary table of mill_a_on_b stands 280 mm before the zero of its clamping, square to X."""
    solid = brep.the_solid(CUBE)
    seen_from = lambda x: positions(solid, range(6), LIBRARY, ways=along(x, 0, 0), steepest_deg=30)
    assert seen_from(1.0).positions[0].sees_mm2 == pytest.approx(SIDE_MM ** 2, rel=0.1)
    assert seen_from(-1.0).positions == ()


def test_of_directions_the_first_that_has_room_for_tool_head_and_table_is_taken():
    """A ball on a cube: from below the cube is in the way, from behind the table is, and a wall beside it where it leans."""
    solid, ball = brep.the_solid(CUBE), LIBRARY.of_type("ball")[-1]
    middles = np.array([[0.0, 0.0, SIDE_MM / 2 + ball.cutter.radius_mm]])
    through, behind, leaning, square = ((0, 0, -1), (-1, 0, 0), (0.6, 0, 0.8), (0, 0, 1))
    asked = [(middles, [np.array(way, float) for way in ways])
             for ways in ((through, behind, leaning, square), (square,), (through,))]
    first, only, none = ways_with_room(asked, ON_TABLE, ball, brep.planning_mesh(solid, 0.01), 0.0)
    assert first.tolist() == list(leaning) and only.tolist() == list(square) and none is None
    held = replace(ON_TABLE, fixtures=(FixtureBox(name="wall", min_mm=(40, -99, -99), max_mm=(300, 99, 100)),))
    assert ways_with_room(asked[:1], held, ball, brep.planning_mesh(solid, 0.01), 0.0)[0].tolist() == list(square)


def test_balls_and_the_tools_over_them_keep_a_millimetre_from_fixtures():
    """A stop beside the top, half a millimetre off the cube and 15 mm higher: a ball's middle comes no nearer than radius and 1."""
    stop = FixtureBox(name="stop", min_mm=(SIDE_MM / 2 + 0.5, -SIDE_MM, -SIDE_MM), max_mm=(60.0, SIDE_MM, SIDE_MM / 2 + 15.0))
    solid = brep.the_solid(CUBE)
    top = [k for k, f in enumerate(brep.faces_of(solid)) if f.middle.normal[0, 2] > 0.9]
    for ball in LIBRARY.of_type("ball"):
        alone = LIBRARY.model_copy(update={"tools": (ball,)})
        free, beside = (positions(solid, top, alone, ways=replace(along(0, 0, 1), fixtures=held), steepest_deg=30)
                        for held in ((), (stop,)))
        assert free.left_mm2 == pytest.approx(0.0, abs=1e-9)
        assert beside.left_mm2 == pytest.approx((ball.cutter.radius_mm + 0.5) * SIDE_MM, rel=0.1)


def test_what_directions_leave_is_looked_at_more_closely():
    """A roof of 30 degrees, seen within 6: between the rings of 20 degrees nobody looks at it, of 10 one does."""
    roof = cq.Workplane("XZ").polyline([(-20, -20), (20, -20), (20, 0), (-20, 40 * np.tan(np.radians(30)))]).close().extrude(40)
    solid = brep.the_solid(roof)
    normal = np.array([0.5, 0.0, np.sqrt(0.75)])
    slope = next(k for k, f in enumerate(brep.faces_of(solid)) if f.middle.normal[0] @ normal > 0.999)
    meshed = brep.planning_mesh(solid, 0.01)
    once, again = (positions(solid, [slope], LIBRARY, ways=ON_TABLE, steepest_deg=6.0, finely=(300, meshed, closer))
                   for closer in (None, (300, 6.0)))
    area = 40 * 40 / np.cos(np.radians(30))
    assert once.positions == () and once.left_mm2 == pytest.approx(area)
    one, = again.positions
    assert one.direction @ normal > np.cos(np.radians(6)) and one.held is ON_TABLE
    assert again.left_mm2 == pytest.approx(0, abs=1e-9) and one.adds_mm2 == pytest.approx(area)


def test_a_machine_turns_no_farther_than_it_can():
    mill, ways = find_machine("mill_trunnion_ac"), directions()
    able = turnable(ways, mill.kinematics, None)
    assert 0 < len(able) < len(ways) and (able[:, 2] > -0.9).all()
    np.testing.assert_allclose(np.sqrt((ways ** 2).sum(axis=1)), 1)
    found = seen(CUBE, steepest_deg=30, ways=turnable(directions(), mill.kinematics, None))
    assert len(found.positions) == 5 and found.left_mm2 == pytest.approx(SIDE_MM ** 2, rel=0.1)
    assert found.left_at_mm[2] == pytest.approx(-SIDE_MM / 2)


def test_a_library_without_balls_sees_nothing():
    flats = LIBRARY.model_copy(update={"tools": tuple(t for t in LIBRARY.tools if t.cutter.type == "flat")})
    solid = brep.the_solid(CUBE)
    with pytest.raises(CutterDoesNotFit, match="no ball"):
        positions(solid, [0], flats)


def test_the_command_prints_what_a_setup_takes(tmp_path):
    cube = str(tmp_path / "cube.step")
    cq.exporters.export(CUBE, cube)
    told = ran("positions", cube, "--steepest", "30", "--machine", "mill_trunnion_ac", "--json")
    *rows, left = json.loads(told.stdout)
    for row in rows:
        Setup(name=f"position-{row['number']}", faces=("all",), wcs_in_words="", wcs_z=row["wcs_z"], wcs_x=row["wcs_x"])
    assert told.returncode == 0 and len(rows) == 5 and left["left_mm2"] > 0 and left["at_mm"][2] == -10
    refused = ran("positions", cube, "--faces", "top")
    assert refused.returncode == 2 and "faces of a STEP file have no predicates" in refused.stderr


GANTRY = find_machine("mill_gantry_5axis")
AXIS_MM, RAM_MM = 180.0, 920.0          # from the gauge line to where A and B meet, and to the ram's middle, at the zero pose


@pytest.mark.parametrize("way", [(0, 0, 1), (0.6, 0, 0.8), (0.3, -0.5, 0.8)])
def test_fork_and_ram_stand_where_the_rotaries_carry_them(way):
    """A and B meet in the fork's middle, 180 mm behind the gauge line; the ram stays upright over that point."""
    held = Held.on(GANTRY, Frame.of_axes((5, 6, 7), (0, 0, 1), (1, 0, 0)))
    seen = held.frame.turn_out(np.array([way]) / np.linalg.norm(way))[0]
    vertices, triangles = beside_the_spindle(GANTRY, turned_to(GANTRY, held.frame, seen), held.frame)
    upright = held.frame.rotation[:, 2]
    ram, fork = vertices[:8], vertices[8:]
    assert ram.mean(axis=0) == pytest.approx(AXIS_MM * seen + (RAM_MM - AXIS_MM) * upright, abs=1e-9)
    assert (fork.min(axis=0) + fork.max(axis=0)) / 2 == pytest.approx(AXIS_MM * seen, abs=0.2)
    assert triangles.max() == len(vertices) - 1
    assert beside_the_spindle(find_machine("mill_a_on_b"), np.zeros(2), held.frame) is None


def test_where_the_fork_would_meet_the_part_is_not_seen():
    """The fork reaches 170 mm to each side, the spindle 70: a tower 120 mm beside a plate is in its way once it is so high."""
    tool = max(LIBRARY.of_type("ball"), key=lambda t: t.length_mm)
    alone, low, under_fork = LIBRARY.model_copy(update={"tools": (tool,)}), SIDE_MM / 4, SIDE_MM / 2 + tool.length_mm + 70.0
    held = replace(Held.on(GANTRY, AS_IT_LIES), ways=np.array([[0.0, 0.0, 1.0]]))
    tall = under_fork + 10
    for beside, height, is_in_the_way in ((120, under_fork - 30, False), (120, tall, True), (220, tall, False)):
        plinth = cq.Workplane().center(beside / 2, 0).box(beside + 20, 10, low, centered=(True, True, False))
        tower = cq.Workplane().center(beside + 10, 0).box(20, 10, height, centered=(True, True, False))
        solid = brep.the_solid(CUBE.union(plinth).union(tower))
        top = [k for k, f in enumerate(brep.faces_of(solid)) if abs(f.middle.point_mm[0, 2] - SIDE_MM / 2) < 1e-6]
        found = positions(solid, top, alone, ways=held, steepest_deg=30)
        assert (found.left_mm2 > 0) == is_in_the_way
