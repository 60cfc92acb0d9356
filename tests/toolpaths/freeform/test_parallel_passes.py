"""Parallel passes: no scallop higher than asked, and not many lines more than that takes."""

import math

import cadquery as cq
import numpy as np
import pytest
from known_droppers import DOME, GRAPHS, PLANE, GraphDropper
from known_tools import tool

from cuspline.kernel import brep
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind
from cuspline.stock.swept import deviation_mm, swept_paths
from cuspline.toolpaths.drop.droppers import MeshDropper
from cuspline.toolpaths.freeform.parallel_passes import Bearing, allowed_steps_mm, parallel_curves
from cuspline.toolpaths.freeform.tip_field import tip_field
from cuspline.toolpaths.freeform.tip_paths import PathRules, tip_paths

WITHIN_MM, RADIUS_MM, SCALLOP_MM, TOLERANCE_MM = 5.0, 3.0, 0.01, 0.0005
RULES = PathRules(tolerance_mm=TOLERANCE_MM, lateral_mm=0.0, bridge_mm=0.0)


def field_of(graph, pitch_mm=0.1):
    box = ((-WITHIN_MM, -WITHIN_MM), (WITHIN_MM, WITHIN_MM))
    return tip_field(GraphDropper(graph, RADIUS_MM, WITHIN_MM), [0], box, pitch_mm)


def posted_of(paths):
    """Each path cut alone: rapid over its start, down, along, up."""
    rows = []
    for p in paths:
        top = np.array([0.0, 0.0, 50.0])
        lift = lambda q: np.r_[q[:2], 50.0]
        rows += [(Kind.RAPID, lift(p.tips_mm[0])), *((Kind.FEED, q) for q in p.tips_mm)]
        rows += [(Kind.FEED, lift(p.tips_mm[-1]))]
    kind, end = np.array([k for k, _ in rows]), np.array([q for _, q in rows])
    n = len(rows)
    return PostedMoves(
        kind=kind, start_mm=np.vstack([top, end])[:-1], end_mm=end, center_mm=np.full((n, 3), np.nan),
        plane=np.zeros(n), turns=np.zeros(n), feed_mm_per_min=np.where(kind == Kind.RAPID, 0.0, 500.0),
        spindle_rpm=np.full(n, 8000.0),
        tool=np.ones(n), length_offset_on=np.ones(n, bool), machine_end_mm=end, line=np.arange(n),
        operation=np.zeros(n), operations=("finish",), ended=True)


def deviations_of(paths, graph, count=60_000):
    """Simulated deviation along the normals at random points of the wanted face, its border included."""
    cut = swept_paths(posted_of(paths), {1: tool("ball", 2 * RADIUS_MM)})
    xy = np.random.default_rng(5).uniform(-WITHIN_MM, WITHIN_MM, (count, 2))
    points = np.column_stack([xy, graph.height(*xy.T)])
    low, high = np.array([-40.0, -40.0, -60.0]), np.array([40.0, 40.0, 49.0])
    return deviation_mm(cut, low, high, points, graph.normal(xy), 1.0)


@pytest.mark.parametrize("angle_deg", [0.0, 90.0, 37.0, -68.0])
@pytest.mark.parametrize("name", GRAPHS)
def test_no_scallop_is_higher_than_asked(name, angle_deg):
    """The path may be high by its tolerance; the scallop on top of it keeps the rest, up to borders and corners."""
    graph = GRAPHS[name]
    field = field_of(graph)
    paths = tip_paths(parallel_curves(field, math.radians(angle_deg), SCALLOP_MM), field, RULES)
    left = deviations_of(paths, graph)
    assert left.min() > -TOLERANCE_MM
    assert left.max() < 1.01 * SCALLOP_MM + TOLERANCE_MM
    assert left.max() > 0.8 * SCALLOP_MM


@pytest.mark.parametrize("angle_deg", [0.0, 4.0, 30.0, 90.0])
def test_the_walls_of_a_sharp_valley_are_clean_as_far_down_as_the_ball_goes(angle_deg):
    """Walls of 45 degrees that meet under x = 10: above the ball's lowest contacts no scallop is higher than asked."""
    outline = [(0, 0), (20, 0), (20, 14), (10, 4), (0, 14)]
    solid = brep.the_solid(cq.Workplane("XZ").polyline(outline).close().extrude(-12))
    faces, mesh = brep.faces_of(solid), brep.planning_mesh(solid, 0.01)
    wanted = [i for i, f in enumerate(faces) if f.middle.normal[0, 2] > 0.5]
    field = tip_field(MeshDropper.of(mesh, RADIUS_MM, RADIUS_MM), wanted, ((0, 0), (20, 12)), 0.1, 0.5)
    paths = tip_paths(parallel_curves(field, math.radians(angle_deg), SCALLOP_MM), field, RULES)
    rng = np.random.default_rng(6)
    off = rng.uniform(RADIUS_MM / math.sqrt(2) + 1e-3, 10.0, 40_000)        # in plan, from the valley
    side, y = rng.choice([-1.0, 1.0], len(off)), rng.uniform(0, 12, len(off))
    points = np.column_stack([10 + side * off, y, 4 + off])
    normals = np.column_stack([-side, 0 * side, np.ones(len(off))]) / math.sqrt(2)
    cut = swept_paths(posted_of(paths), {1: tool("ball", 2 * RADIUS_MM)})
    left = deviation_mm(cut, np.array([-9.0, -9, -9]), np.array([29.0, 29, 49]), points, normals, 1.0)
    assert left.min() > -TOLERANCE_MM and left.max() < 1.01 * SCALLOP_MM + TOLERANCE_MM


def test_lines_on_a_slope_lie_apart_as_the_scallop_relation_says():
    """Across the surface 2 sqrt(2 r h - h²); lines along the contour see the whole slope, lines up it none."""
    field = field_of(PLANE, 0.25)
    s = 2 * math.sqrt(2 * RADIUS_MM * SCALLOP_MM - SCALLOP_MM ** 2)
    uphill = math.atan2(0.7, 0.3)
    inner = field.beyond_mm == 0
    inner[(np.abs(field.contact_mm[..., :2]) > 4).any(axis=2)] = False
    for angle, slope in ((uphill, 0.0), (uphill + math.pi / 2, math.hypot(0.3, 0.7))):
        steps = allowed_steps_mm(field, Bearing(angle_rad=angle), SCALLOP_MM)[inner]
        assert np.abs(steps / (s / math.sqrt(1 + slope ** 2)) - 1).max() < 1e-3


def test_the_first_and_the_last_line_run_along_the_border():
    field = field_of(PLANE, 0.25)
    curves = parallel_curves(field, 0.0, SCALLOP_MM)
    contacts = field.dropper.contacts(np.array([curves[0].xy_mm.mean(axis=0), curves[-1].xy_mm.mean(axis=0)]))
    assert np.abs(contacts.contact_mm[:, 1] - (-WITHIN_MM, WITHIN_MM)).max() < 1e-3


def test_lines_turn_with_the_bearing_on_a_dome():
    field = field_of(DOME, 0.25)
    counts = [len(parallel_curves(field, angle, SCALLOP_MM)) for angle in (0.0, math.pi / 2, math.pi, -math.pi / 2)]
    assert len(set(counts)) == 1
