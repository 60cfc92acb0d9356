"""Contours planned round outlines and windows, and chamfers: exact distances, ways down, what is refused."""

import cadquery as cq
import compensated_turned
import numpy as np
import pytest
from scipy.spatial import cKDTree

from cuspline.app import catalogue
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.chamfer import Chamfer
from cuspline.planning.strategies.contour import Contour
from cuspline.program.arcs import Arc
from cuspline.program.program import Kind, Plane
from cuspline.values.errors import CamError

MACHINE, SHOP = catalogue.find_machine("mill_3axis"), catalogue.find_library(None)
X, Y, Z = 44.0, 36.0, 6.0
WALLS = {"center_min_mm": (-1, -1, 1), "center_max_mm": (X + 1, Y + 1, Z - 1)}


def plate():
    """Outline of lines, arcs and a spline, a window rounded in its corners."""
    outline = cq.Workplane("XY").lineTo(X - 6, 0).radiusArc((X, 6), -6).lineTo(X, Y)
    outline = outline.spline([(X / 2, Y - 3), (0, Y)], includeCurrent=True)
    window = cq.Workplane("XY", origin=(X / 2, 16, -1)).rect(24, 18).extrude(20).edges("|Z").fillet(6.0)
    return outline.lineTo(0, 5).lineTo(5, 0).close().extrude(Z).cut(window)


def planned(solid, operation, faces=None, stock=2.0, **setup):
    """SetupPlan of a part with one operation."""
    design = Design(name="plate", description="plate", parameters=Parameters(), solid=solid.val(),
                    predicates=(FacePredicate(name="walls", at_least=1, **(faces or WALLS)),), material="aluminium_6061",
                    stock=StockBox(min_mm=(-stock, -stock, 0), max_mm=(X + stock, Y + stock, Z)),
                    finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.01),
                    setups=(Setup(name="setup-1", faces=("walls",), operations=(operation,), wcs_in_words="corner", **setup),))
    return plan_setup(design, design.setups[0], MACHINE, SHOP)


@pytest.fixture(scope="module")
def round_plate():
    return planned(plate(), Contour(spring_passes=1))


def at_foot(moves):
    """(n, 2) places along the feeds that run at Z0."""
    starts, places = moves.starts_mm, []
    for k in np.flatnonzero((moves.kind != Kind.RAPID) & (moves.end_mm[:, 2] < 1e-9) & (starts[:, 2] < 1e-9)).tolist():
        share = np.linspace(0.0, 1.0, 40)[:, None]
        if moves.kind[k] == Kind.FEED:
            places.append((starts[k] + share * (moves.end_mm[k] - starts[k]))[:, :2])
        else:
            arc = Arc(starts[k], moves.end_mm[k], moves.center_mm[k], Plane.XY, moves.kind[k])
            places.append(np.array([arc.at(s)[:2] for s in share[:, 0]]))
    return np.vstack(places)


def test_the_cutter_keeps_its_radius_from_every_wall(round_plate):
    edges = [edge for (_, edge), *_ in brep.edges_of_faces(round_plate.context.faces)]
    walls = cKDTree(np.vstack([brep.edge_points(edge, 4000)[0][:, :2] for edge in edges]))
    rough, finish = round_plate.operations
    radius = finish.tool.cutter.radius_mm
    away, _ = walls.query(at_foot(finish.moves))
    assert away.min() > radius - 0.004 - 1e-5           # arcs along the spline: 0.4 of the path tolerance
    on_path = away < radius + 0.004 + 1e-5              # the rest are arcs in and out
    assert on_path.mean() > 0.9
    away, _ = walls.query(at_foot(rough.moves))
    assert abs(away.min() - radius - 0.3) < 0.005 and away.max() < radius + 0.305


def test_it_climbs_outside_and_inside(round_plate):
    moves = round_plate.operations[1].moves
    level = (moves.kind == Kind.FEED) & (np.abs(moves.starts_mm[:, 2]) < 1e-9)
    starts, ends, radius = moves.starts_mm[level], moves.end_mm[level], round_plate.operations[1].tool.cutter.radius_mm
    along = lambda x: (np.abs(starts[:, 0] - x) < 1e-6) & (np.abs(ends[:, 0] - x) < 1e-6)
    assert (ends[along(-radius), 1] > starts[along(-radius), 1]).all() and along(-radius).sum() == 2       # two rounds
    window = along(10 + radius)
    assert (ends[window, 1] < starts[window, 1]).all() and window.sum() == 2


def test_finishing_passes_take_equal_shares_and_spring_passes_follow_the_last():
    left = {"center_min_mm": (-1, 5, 1), "center_max_mm": (1, Y + 1, Z - 1)}
    contour = Contour(tool="flat 10", finish_allowance_mm=0.6, finish_passes=3, spring_passes=1)
    finish = planned(plate(), contour, left).operations[-1]
    along = (np.abs(finish.moves.end_mm[:, 1] - Y) < 1e-9) & (np.abs(finish.moves.starts_mm[:, 1] - 5) < 1e-9)
    np.testing.assert_allclose(finish.moves.end_mm[along, 0], [-5.4, -5.2, -5.0, -5.0], atol=1e-9)


def test_roughing_comes_down_by_a_helix(round_plate):
    moves = round_plate.operations[0].moves
    down = moves.starts_mm[:, 2] - moves.end_mm[:, 2]
    inside = (moves.kind != Kind.RAPID) & (moves.starts_mm[:, 2] < Z - 1e-9)
    flat = np.hypot(*(moves.end_mm - moves.starts_mm)[:, :2].T)
    assert (down[inside] <= flat[inside] * np.tan(np.radians(3.0)) + 1e-9).all()


def test_an_open_chain_begins_and_ends_beside_the_stock():
    left = {"center_min_mm": (-1, 5, 1), "center_max_mm": (1, Y + 1, Z - 1)}
    finish = planned(plate(), Contour(tool="flat 10"), left).operations[-1]
    low = finish.moves.end_mm[np.abs(finish.moves.end_mm[:, 2]) < 1e-9]
    np.testing.assert_allclose(low, [(-7, 3, 0), (-5, 5, 0), (-5, Y, 0), (-7, Y + 2, 0)], atol=1e-9)


def test_an_open_chain_within_stock_comes_down_by_a_ramp_and_the_finish_where_that_has_cut():
    """Stock 60 mm all round: no place beside it; 3 degrees along 31 mm to and fro."""
    left = {"center_min_mm": (-1, 5, 1), "center_max_mm": (1, Y + 1, Z - 1)}
    rough, finish = planned(plate(), Contour(tool="flat 10"), left, stock=60.0).operations
    moves = rough.moves
    feeding = moves.kind != Kind.RAPID
    down = (moves.starts_mm[:, 2] - moves.end_mm[:, 2])[feeding]
    flat = np.hypot(*(moves.end_mm - moves.starts_mm)[feeding, :2].T)
    assert (down[1:] <= flat[1:] * np.tan(np.radians(3.0)) + 1e-9).all() and moves.end_mm[:, 2].min() == 0
    assert set(moves.end_mm[feeding, 0].round(9)) == {-5.3}                 # finish_allowance_mm beside the wall
    low = finish.moves.end_mm[np.abs(finish.moves.end_mm[:, 2]) < 1e-9]
    np.testing.assert_allclose(low, [(-5.3, 5, 0), (-5, 5, 0), (-5, Y, 0), (-5.3, Y, 0)], atol=1e-9)


CHAMFERED = {"center_min_mm": (-1, -1, Z - 0.9), "center_max_mm": (X + 1, Y + 1, Z - 0.1)}


@pytest.mark.parametrize("solid, operation, faces, setup, why", [
    (plate(), Contour(tool="flat 16"), WALLS, {}, r"rounded by 6.000 mm"),
    (plate(), Contour(), {"kinds": ("plane",), "normal": (0, 0, 1)}, {}, "does not stand along"),
    (plate().faces(">Z").edges("|X").chamfer(0.8), Chamfer(faces=("walls",)), WALLS, {}, "is no chamfer"),
    (plate().faces(">Z").edges("|X").chamfer(0.5, 0.8), Chamfer(), CHAMFERED, {}, "T52 has 90 degrees"),
    (cq.Workplane("XY").box(X, Y, 4.5, centered=False).union(cq.Workplane("XY", origin=(20, 18, 4.0)).rect(20, 16).extrude(2.0))
     .faces(">Z").edges().chamfer(0.8), Chamfer(tip_below_mm=2.5), CHAMFERED, {}, "cut what is beside or below"),
])
def test_what_cannot_be_done_is_refused(solid, operation, faces, setup, why):
    with pytest.raises(CamError, match=why):
        planned(solid, operation, faces, **setup)


def test_where_no_z_is_along_the_tool_no_contour_is_compensated():
    design = compensated_turned.design(Parameters())
    with pytest.raises(CamError, match="contour: mill_head_head does not compensate in an indexed position, .* leave"):
        plan_setup(design, design.setups[0], catalogue.find_machine("mill_head_head"), SHOP)
