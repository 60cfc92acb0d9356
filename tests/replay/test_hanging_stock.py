"""A casting with a cave: what is air below its roof is no chip, and no depth of a plunge."""

from functools import partial

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.kernel import solids
from cuspline.replay.replay import replay
from cuspline.replay.scene import FoundStock, ZMap
from cuspline.stock.shapes import HERE, BoxShape, closed_mesh
from cuspline.stock.workpiece import Workpiece

ROOF = BoxShape(min_mm=(-20, -10, -3), max_mm=(20, 10, 0))
FLOOR = BoxShape(min_mm=(-20, -10, -20), max_mm=(20, 10, -12))
WALL = BoxShape(min_mm=(-20, 6, -13), max_mm=(20, 10, -2))
CAVE = closed_mesh(*solids.mesh_of(solids.united([s.solid for s in (ROOF, FLOOR, WALL)])), 0.0, "the casting", "MESH")
BLOCK = BoxShape(min_mm=(-20, -10, -20), max_mm=(20, 10, 0))
HOLE = [rapid(0, -4, 5), feed(0, -4, -11), rapid(0, -4, 5)]
SLOT = [rapid(-30, -4, 5), rapid(-30, -4, -8), feed(30, -4, -8), rapid(30, -4, 5)]


def run(shape, moves, **limits):
    piece, (low, high) = Workpiece(blank=shape), shape.box_in(HERE)
    zmap = ZMap.over(low, high, 0.25)
    cutter = tool("flat", 4, flute=25.0, limits={"slot_depth_mm": 1000.0, "ramp_deg": 90.0, "plunge_mm_per_tooth": 100.0, **limits})
    stock = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.25, top_mm=piece.heights_mm(HERE, zmap.xy_mm).reshape(zmap.shape),
                       within_mm=partial(piece.highest_within_mm, HERE), columns=shape.columns(HERE, zmap.xy_mm))
    found = replay(program((moves[0][1][0], -4, 50), moves), {1: cutter}, stock).findings
    return [(f.kind, round(f.amount_mm, 3)) for f in found]


@pytest.mark.parametrize("shape, depth", [(CAVE, 3.0), (BLOCK, 11.0)], ids=["casting", "block"])
def test_a_plunge_is_as_deep_as_the_material_it_goes_through(shape, depth):
    assert run(shape, HOLE, ramp_deg=5.0) == [("plunge", depth)]
    assert run(shape, HOLE) == []


def test_a_slot_through_a_roof_is_as_heavy_as_the_roof_is_thick():
    assert run(CAVE, SLOT, slot_depth_mm=4.0) == []
    (kind, amount), = run(CAVE, SLOT, slot_depth_mm=2.5)
    assert kind == "overload" and amount == pytest.approx(3.0, rel=0.15)         # nodes, and the ends of the way
    (kind, amount), = run(BLOCK, SLOT, slot_depth_mm=4.0)
    assert kind == "overload" and amount == pytest.approx(8.0, rel=0.15)


def test_a_rapid_into_the_roof_meets_it_and_one_that_stays_above_does_not():
    over = [rapid(-30, -4, 5), rapid(-30, -4, 0.1), rapid(30, -4, 0.1), rapid(30, -4, 5), feed(30, -4, 5)]
    assert run(CAVE, over) == []
    assert [k for k, _ in run(CAVE, [*SLOT[:2], rapid(30, -4, -8), feed(30, -4, 5)])] == ["rapid_through_stock"]


def test_columns_are_the_stretches_of_a_node():
    columns = CAVE.columns(HERE, np.array([[0.0, -4.0], [0.0, 8.0], [25.0, 0.0]]))
    assert columns[0, :2].tolist() == [[-20, -12], [-3, 0]] and columns[1, 0].tolist() == [-20, 0] and np.isinf(columns[2]).all()
