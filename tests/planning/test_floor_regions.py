"""A level face is finished whole: beside pockets and slots that are let into it, and across them."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.app.catalogue import find_library, find_machine
from cuspline.design import Design, Finish, Parameters, Setup, StockBox
from cuspline.planning.plan import plan_setup
from cuspline.planning.strategies.floor import Floor
from cuspline.program.program import Kind

X, Y, Z, RADIUS_MM = 60.0, 40.0, 12.0, 8.0


def plate(slots):
    body = cq.Workplane().box(X, Y, Z, centered=(True, True, False)).faces(">Z").workplane()
    return body.pushPoints(slots).slot2D(36, 12).cutBlind(-5)


def floor_of(body, size, tool, faces=None, high=Z + 0.3):
    """The PlannedOperation of the top of a plate, or of some faces, the stock so high."""
    x, y = size
    design = Design(name="plate", description="", parameters=Parameters(), solid=body.val(), material="aluminium_6061",
                    stock=StockBox(min_mm=(-x / 2, -y / 2, 0), max_mm=(x / 2, y / 2, high)),
                    predicates={"top": faces or body.faces(">Z")},
                    finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.005, gouge_mm=0.01),
                    setups=(Setup(name="one", faces=("top",), wcs_in_words="middle", operations=(Floor(tool=tool),)),))
    return plan_setup(design, design.setups[0], find_machine(design.machine), find_library(None)).operations[-1]


def test_a_pass_between_two_walls_that_just_leave_it_room_does_not_drop():
    """The middle pass touches the pocket's two ends where they are as far apart as the cutter is wide."""
    body = cq.Workplane().box(40, 20, Z, centered=(True, True, False))
    body = body.cut(cq.Workplane().box(16, 14, 10).edges("|Z").fillet(6.5).translate((-8, 0, Z)))
    moves = floor_of(body, (40, 20), "flat 10").moves
    assert moves.end_mm[:, 2].min() > Z - 1e-6 and len(moves) < 100


def tips_low(made, z):
    """Places (n, 2) along its moves at the feed, no higher than that."""
    ends, starts = made.moves.end_mm, made.moves.starts_mm
    on = (made.moves.kind == Kind.FEED) & (np.maximum(ends[:, 2], starts[:, 2]) < z)
    share = np.linspace(0, 1, 201)[:, None]
    return np.vstack([a + share * (b - a) for a, b in zip(starts[on][:, :2], ends[on][:, :2])])


def places_over(x, y):
    """Places (n, 2) all over a rectangle about the middle, 0.1 mm within it."""
    return np.stack(np.meshgrid(*(np.linspace(-w / 2 + 0.1, w / 2 - 0.1, 80) for w in (x, y))), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("length, turn_deg", [(50.0, 0.0), (53.0, 0.0), (46.0, 10.0)])
def test_the_floor_round_a_block_lies_under_the_flat_up_to_its_walls(length, turn_deg):
    """Beside strips narrower than the cutter's radius it stands off the part; what stands about is passed once round."""
    block = cq.Workplane(origin=(0, 0, Z)).box(length, 20, 6, centered=(True, True, False)).rotate((0, 0, 0), (0, 0, 1), turn_deg)
    body = cq.Workplane().box(X, Y, Z, centered=(True, True, False)).union(block)
    top = body.faces(cq.selectors.BoxSelector((-X, -Y, Z - 0.1), (X, Y, Z + 0.1), boundingbox=True))
    made = floor_of(body, (X, Y), "flat 16", top, Z + 6)
    tips, places = tips_low(made, Z + 0.006), places_over(X, Y)
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    own = np.abs(places @ [[c, -s], [s, c]]) - (length / 2, 10.0)
    nearest = np.array([np.sqrt(((tips - p) ** 2).sum(axis=1).min()) for p in places])
    assert nearest[own.max(axis=1) > 0.02].max() <= RADIUS_MM + 0.01
    assert np.where(own.max(axis=1) > 0, 0.0, nearest)[own.max(axis=1) < -0.01].min() > RADIUS_MM


@pytest.mark.parametrize("wide", [46.0, 40.0])
def test_the_floor_beside_a_rounded_rim_lies_under_the_flat_all_round_a_boss(wide):
    """Strips narrower than the cutter and than its radius: the flat rests on the line where the rounding begins."""
    boss = cq.Workplane(origin=(0, 0, Z)).circle(12).extrude(4)
    body = cq.Workplane().box(X, wide, Z, centered=(True, True, False)).faces(">Z").edges().fillet(2.0).union(boss)
    top = body.faces(cq.selectors.BoxSelector((-X, -wide, Z - 0.1), (X, wide, Z + 0.1), boundingbox=True))
    tips = tips_low(floor_of(body, (X, wide), "flat 16", top, Z + 4), Z + 0.006)
    angle = np.linspace(0, 2 * np.pi, 721)
    foot = 12.05 * np.column_stack([np.cos(angle), np.sin(angle)])
    assert max(np.sqrt(((tips - p) ** 2).sum(axis=1).min()) for p in foot) <= RADIUS_MM + 0.01
    assert np.sqrt((tips ** 2).sum(axis=1).min()) > 12 + RADIUS_MM - 0.01


@pytest.mark.parametrize("slots", [[(0, 0)], [(0, -9), (0, 9)], [(-28, 0)]])
def test_the_top_beside_slots_lies_under_the_flat_everywhere(slots):
    body = plate(slots)
    made = floor_of(body, (X, Y), "flat 16")
    tips, places = tips_low(made, Z + 0.006), places_over(X, Y)
    nearest = np.array([np.sqrt(((tips - p) ** 2).sum(axis=1).min()) for p in places])
    ends_of_slots = [np.clip(places[:, 0], cx - 12, cx + 12) for cx, _ in slots]
    is_top = np.all([np.hypot(places[:, 0] - e, places[:, 1] - cy) > 6.0 for e, (_, cy) in zip(ends_of_slots, slots)], axis=0)
    assert is_top.sum() > 3000 and nearest[is_top].max() <= RADIUS_MM
