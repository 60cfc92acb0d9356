"""Bodies of the machine that X, Y, Z or a head carry: kept apart from part, fixtures and tables, between two blocks too."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_machines import FIVE_AXIS, random_joints
from known_programs import arc, program, rapid
from known_tools import tool

from cuspline.app.catalogue import find_machine, reader_of
from cuspline.design import FixtureBox, Setup, StockBox
from cuspline.design.design import clamped
from cuspline.program.program import Plane
from cuspline.replay.clearance import ClearanceTree
from cuspline.shop.machines import Machine
from cuspline.stock.shapes import BoxShape, CylinderShape
from cuspline.verification import body_clearance as bodies
from cuspline.verification import body_kernels as kernels

BALL = tool("ball", 6, number=7)
TRUNNION = find_machine("mill_trunnion_ac")
UNMOVED = np.vstack([np.eye(3), np.zeros(3)])
ON = lambda at: np.vstack([np.eye(3), at]).astype(float)


def box(low, high):
    return bodies.pieces_of(*BoxShape(min_mm=low, max_mm=high).mesh)


def turn_of(axis, degrees):
    """(3, 3) right-handed."""
    u, a = np.array(axis, float) / np.linalg.norm(axis), np.radians(degrees)
    cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross


@pytest.mark.parametrize("at, distance", [((20, 5, 5), 9.0), ((13, 14, 5), np.sqrt(8)), ((-4, -6, -9), np.sqrt(61)),
                                          ((5, 5, 5), 0.0), ((11, 5, 5), 0.0)])
def test_boxes_are_as_far_apart_as_their_sides_edges_and_corners(at, distance):
    low, found = kernels.distance(box((-1, -2, -3), (1, 2, 3)), box((0, 0, 0), (10, 10, 10)), ON(at), 0.0, np.inf, 1.0)
    assert found == pytest.approx(distance, abs=1e-9) and low <= distance
    assert distance == 0 or low > 0.95 * distance - 1e-3


def test_a_turned_cylinder_beside_a_box_is_as_far_as_the_other_search_finds_it():
    """Convex corners here, a revolved segment and triangles there: two ways to one distance, the facets' sagitta apart."""
    rng = np.random.default_rng(5)
    drawn = CylinderShape(from_mm=np.zeros(3), to_mm=np.array([0.0, 0.0, 40.0]), radius_mm=12.0)
    cylinder, block = bodies.pieces_of(*drawn.mesh), BoxShape(min_mm=(-20, -30, -10), max_mm=(20, 30, 10))
    tree, segment = ClearanceTree.of_triangles(*block.mesh), np.array([[0.0, 12.0, 40.0, 12.0, 0.0]])
    for _ in range(40):
        rotation, way = turn_of(rng.normal(size=3), rng.uniform(0, 180)), rng.normal(size=3)
        at = rng.uniform(60, 120) * way / np.linalg.norm(way)
        low, found = kernels.distance(cylinder, bodies.pieces_of(*block.mesh), np.vstack([rotation, at]), 0.0, np.inf, 1.0)
        other = tree.distances_mm(segment, at[None], rotation[:, 2][None], 1e-4)[0]
        assert low <= other + 1e-3 and found >= other - 0.003       # the mesh stands 0.002 outside the cylinder
        assert found == 0.0 or found - low <= 0.05 * found + 1e-3


def test_a_body_that_is_not_convex_is_its_triangles():
    """A post between the cheeks of a yoke: 5 mm from each, and in the middle of its hull."""
    yoke = bodies._tree(np.vstack([BoxShape(min_mm=low, max_mm=high).mesh[0] for low, high in (
        ((0, 0, 0), (40, 10, 5)), ((0, 0, 5), (5, 10, 30)), ((35, 0, 5), (40, 10, 30)))]), 8 * np.arange(4))
    post = box((10, 2, 10), (30, 8, 60))
    assert kernels.distance(post, yoke, UNMOVED, 0.0, np.inf, 1.0)[1] == pytest.approx(5.0)
    vertices, triangles = BoxShape(min_mm=(0, 0, 0), max_mm=(1, 1, 1)).mesh
    dented = np.vstack([vertices, [[0.5, 0.5, 0.5]]])
    assert len(bodies.pieces_of(vertices, triangles).first) == 2
    notched = np.vstack([triangles[2:], [[0, 2, 8], [2, 3, 8], [3, 1, 8], [1, 0, 8]]])
    assert len(bodies.pieces_of(dented, notched).first) == len(notched) + 1


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_what_is_at_the_nose_goes_where_the_kinematics_put_it(name):
    machine = find_machine(name)
    between, out = bodies._between(machine, bodies.TOOL, bodies.PART), np.empty((4, 3))
    joints = random_joints(machine.kinematics, 20, seed=6)
    tips, axes = machine.kinematics.forward(joints, 90.0)
    for q, tip, axis in zip(joints, tips, axes):
        kernels.pose(between, q, out)
        assert np.abs(out[:3] @ (-90.0 * machine.kinematics.spindle) + out[3] - tip).max() < 1e-9
        assert np.abs(out[:3] @ machine.kinematics.spindle - axis).max() < 1e-12


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_no_point_goes_farther_than_the_bound(name):
    machine, rng = find_machine(name), np.random.default_rng(9)
    between, out = bodies._between(machine, bodies.TOOL, bodies.PART), np.empty((2, 4, 3))
    points = rng.normal(size=(60, 3))
    points = 80 * points / np.linalg.norm(points, axis=1)[:, None] + (5, 9, 100)
    starts = random_joints(machine.kinematics, 20, seed=7)
    ends = starts + rng.uniform(-1, 1, starts.shape) * np.where(np.arange(starts.shape[1]) < 3, 30.0, 0.6)
    for a, b in zip(starts, ends):
        for share, m in zip((0.0, 1.0), out):
            kernels.pose(between, a + share * (b - a), m)
        way = np.linalg.norm((points @ out[1, :3].T + out[1, 3]) - (points @ out[0, :3].T + out[0, 3]), axis=1).max()
        bound = kernels.motion(between, a, b, np.array([5.0, 9.0, 100.0, 80.0]))
        assert way <= bound + 1e-9 and bound < 6 * way + 60


def findings(text, *, fixtures=(), stock=((-30, -30, 0), (30, 30, 200)),
             machine=TRUNNION, head="G53 G0 X80 Y0\nG53 G0 C0 A-30\n"):
    """body_findings of a program of one clamping."""
    setups = clamped((Setup(name="top", wcs_in_words="", faces=("a",), fixtures=fixtures),))
    moves = reader_of(machine)(BEGINS + head + text + "M2\n", work_offsets={"G54": machine.wcs_origin_mm},
                               tool_lengths={7: BALL.length_mm})
    job = SimpleNamespace(machine=machine, stock=StockBox(min_mm=stock[0], max_mm=stock[1]))
    return bodies.body_findings(moves, np.zeros(len(moves), int), setups, job, {7: BALL})[0]


BEGINS = "G21\nG17 G90 G94\nG64 P0.001\nG54\nT7 M6\nG43 H7\nG53 G0 Z0\n"
DOWN = "G53 G0 Z{}\n"
SWING = "G53 G0 A30\n"


def test_a_head_above_the_swinging_part_is_clear():
    """The part's upper edge rises to 247.85 below the zero; the head ends 60 above the nose."""
    assert findings(DOWN.format(-306.0) + SWING) == ()


def test_a_head_that_meets_the_swinging_part_only_between_two_blocks_is_found():
    """At both ends of the swing the edge stands 12 mm lower than in the middle of it: 5 mm below the head, at 255."""
    found, = findings(DOWN.format(-315.0) + SWING)
    assert found.kind == "holder_contact" and found.line == 11 and found.row == -1
    assert "the machine's head and the blank are in each other" in found.advice
    depth = np.hypot(30, 200) - (450 - 255)
    assert found.amount_mm == pytest.approx(1.0 + depth, abs=0.05)      # 33 poses look at 60 degrees; a millimetre is wanted
    assert findings(DOWN.format(-315.0)) == ()


def test_of_one_block_of_joints_the_middle_is_seen():
    head, blank = (next(s for s in solids if s.name == name) for solids, name in (
        ([bodies._solid_of(b, "fixture_contact") for b in TRUNNION.bodies], "head"),
        (bodies._clamped(clamped((Setup(name="top", wcs_in_words="", faces=("a",)),))[0], SimpleNamespace(
            machine=TRUNNION, stock=StockBox(min_mm=(-30, -30, 0), max_mm=(30, 30, 200)))), "the blank")))
    between = bodies._between(TRUNNION, "Z", bodies.PART)
    ends = np.array([[80.0, 0, -315, 0, np.radians(a)] for a in (-30, 30)])
    for q0, q1, is_clear in ((ends[0], ends[1], False), (ends[0], ends[0], True), (ends[1], ends[1], True)):
        found = np.ones(1, bool)
        kernels.over_blocks(head.pieces, blank.pieces, between, q0[None], q1[None], 1.0, 100.0, 1e-3, found)
        assert found[0] == is_clear


def test_a_head_into_a_clamp_and_into_the_table_is_found_by_both_names():
    clamp = FixtureBox(name="post", min_mm=(60, -10, 0), max_mm=(80, 10, 190))
    found = findings(DOWN.format(-325.0) + "G53 G0 A0\n", fixtures=(clamp,), stock=((-5, -5, 0), (5, 5, 10)))
    assert [(f.kind, f.line) for f in found] == [("fixture_contact", 11)] and "head and post" in found[0].advice
    low = Machine.model_validate({**TRUNNION.model_dump(), "z": {**TRUNNION.z.model_dump(), "min_mm": -700}})
    found = findings("G53 G0 X120 A0\n" + DOWN.format(-560.0), stock=((-5, -5, 0), (5, 5, 10)), machine=low)
    assert [("head and table" in f.advice, f.line) for f in found] == [(True, 11)]
    assert found[0].amount_mm == pytest.approx(1.0 - (-500 + 490), abs=1e-6)


def test_the_tool_is_held_against_a_body_that_a_linear_axis_carries():
    """Seen from the part this machine's bed moves along X; on it stands a column, which only the tool comes near."""
    mill = find_machine("mill_head_table")
    column = {"name": "column", "link": "bed", "shape": {"low_mm": [300, -50, -700], "high_mm": [340, 50, -300]}}
    made = Machine.model_validate({**mill.model_dump(), "bodies": [column]})
    assert made.kinematics.turned == ("C", "Y") and "bed" not in bodies.rotary_links(made)
    lengthways = "G53 G0 B0 C0\nG53 G0 X0 Y0\nG53 G0 Z-250\nG53 G0 X{}\nG53 G0 Y80\n"
    assert findings(lengthways.format(250), machine=made, head="") == ()
    found, = findings(lengthways.format(285), machine=made, head="")
    assert found.kind == "fixture_contact" and found.line == 11 and "tool T7 and column" in found.advice


def test_arcs_are_judged_along_their_way():
    """Half a circle of 50 mm about a post 40 mm off its ends' line: both ends are clear, its top is not."""
    moves = program((-50, 0, 10), [rapid(-50, 0, 10), arc((50, 0, 10), (0, 0, 10), Plane.XY, clockwise=True)],
                    machine_end_mm=np.array([[-50.0, 0, 10], [50, 0, 10]]))
    blocks = bodies.Blocks.of(moves, np.zeros(2, int))
    assert len(blocks.row) > 30 and set(blocks.row) == {1}
    middle = blocks.ends[len(blocks.ends) // 2 - 1]
    assert np.linalg.norm(blocks.ends[:, :2], axis=1) == pytest.approx(50.0) and middle[1] == pytest.approx(50, abs=0.2)
    assert (blocks.starts[1:] == blocks.ends[:-1]).all() and blocks.starts[0].tolist() == [-50, 0, 10]


def test_a_machine_without_bodies_has_nothing_to_say():
    assert findings(DOWN.format(-315.0) + SWING, machine=TRUNNION.model_copy(update={"bodies": ()})) == ()


def scattered(count, seed):
    """kernels.Pieces of triangles all about, and their corners (count, 3, 3)."""
    place, size = np.random.default_rng(seed), np.random.default_rng(seed + 1)
    corners = place.uniform(-60, 60, (count, 1, 3)) + size.normal(size=(count, 3, 3))
    return bodies.pieces_of(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)), corners


def test_a_long_piece_among_many_small_ones_is_as_far_as_piece_by_piece():
    """The sphere round a spindle holds everything: what is left out for its own distance to the others' spheres changes nothing."""
    spindle = bodies.pieces_of(*CylinderShape(from_mm=np.zeros(3), to_mm=np.array([0.0, 0.0, 90.0]), radius_mm=8.0).mesh)
    small, corners = scattered(300, 4)
    rng = np.random.default_rng(6)
    for _ in range(6):
        seen = np.vstack([turn_of(rng.normal(size=3), rng.uniform(0, 180)), rng.uniform(-70, 70, 3)])
        each = [kernels.piece_distance(spindle, 0, small, k, seen, 1.0)[1] for k in range(len(corners))]
        low, found = kernels.distance(spindle, small, seen, 1.0, np.inf, 1.0)
        assert found == pytest.approx(min(each), rel=0.05, abs=1e-3) and low <= min(each) + 1e-9
        low, found = kernels.distance(spindle, small, seen, 1.0, np.inf, 0.6)
        assert low <= min(each) + 1e-9 and (min(each) >= 1.0) == (found >= 1.0)
        assert min(each) < 1.0 or low > 1.0


def test_of_many_blocks_in_a_casting_some_are_looked_at_and_said_to_be_so():
    position = np.repeat([0, 1, 3], [100, 10, 24])
    some = bodies._some_of(np.arange(1000, 1134), position)
    counts = [((some >= low) & (some < high)).sum() for low, high in ((1000, 1100), (1100, 1110), (1110, 1134))]
    assert counts == [8, 5, 8] and some[0] == 1000
    assert len(bodies._some_of(np.zeros(0, np.int64), np.zeros(0, np.int64))) == 0


def test_how_deep_a_long_piece_is_in_many_small_ones_is_told_by_some_of_them():
    """A slab of 5000 small cubes' corners: by every third of them it is as deep as by all, to the spacing of what is left out."""
    spindle = bodies.pieces_of(*CylinderShape(from_mm=np.zeros(3), to_mm=np.array([0.0, 0.0, 90.0]), radius_mm=8.0).mesh)
    corners = np.random.default_rng(2).uniform((-20, -20, -1), (20, 20, 1), (5000, 1, 3)) + 0.1 * np.eye(3)
    slab = bodies.pieces_of(corners.reshape(-1, 3), np.arange(15000).reshape(-1, 3))
    deep = kernels.overlap(spindle, slab, ON((0, 0, -0.5)), bodies.OUTWARD)
    assert 1.3 < deep < 1.7             # the slab's top is 1 above its middle, the spindle's face 0.5 below it, cubes' corners 0.1


def test_spheres_of_a_tree_hold_all_corners_below_them():
    rng = np.random.default_rng(4)
    corners = rng.uniform(-9, 9, (5, 1, 3)) + rng.normal(0, 1, (5, 3, 3))
    points, first, nodes, leaves = bodies._tree(corners.reshape(-1, 3), 3 * np.arange(6))
    assert leaves == 8 and sorted(map(tuple, points)) == sorted(map(tuple, corners.reshape(-1, 3)))
    for k in range(5):
        node = leaves - 1 + k
        while True:
            far = np.linalg.norm(points[first[k]:first[k + 1]] - nodes[node, :3], axis=1)
            assert (far <= nodes[node, 3] + 1e-12).all()
            if node == 0:
                break
            node = (node - 1) // 2
    assert (nodes[leaves - 1 + 5:, 3] < 0).all()
