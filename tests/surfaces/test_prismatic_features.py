"""Pockets, steps, bosses and chamfers found among the faces of solids, wherever these point."""

import cadquery as cq
import pytest
from auto_plate import plate as chamfered_plate
from pocket_plate import plate as pocket_plate

from cuspline.app.face_list import face_rows
from cuspline.kernel import brep
from cuspline.surfaces.prismatic_features import features_of


def found(solid, *kinds):
    """[(kind, size)] of a solid's features of some kinds."""
    rows = [(f.kind, round(f.size_mm, 3)) for f in features_of(brep.faces_of(brep.the_solid(solid.val())))]
    return sorted(r for r in rows if not kinds or r[0] in kinds)


@pytest.mark.parametrize("turned", [False, True])
def test_pockets_nested_open_and_with_an_island_are_found(turned):
    solid = pocket_plate().rotate((0, 0, 0), (1, 2, 3), 40) if turned else pocket_plate()
    assert found(solid) == [("boss", 3.0), ("open pocket", 4.0), ("open pocket", 5.0), ("pocket", 3.0), ("pocket", 3.0),
                            ("pocket", 4.0)]


def test_a_step_is_no_pocket_and_a_block_alone_is_nothing():
    block = cq.Workplane("XY").box(30, 20, 10, centered=False)
    assert found(block) == []
    assert found(block.cut(cq.Workplane("XY", origin=(0, 0, 6)).rect(20, 90).extrude(9))) == [("step", 4.0)]


def test_chamfers_are_found_and_holes_are_none_of_these():
    assert {kind for kind, _ in found(chamfered_plate())} == {"chamfer"}
    assert all(abs(size - 0.6 * 2 ** 0.5) < 0.06 for _, size in found(chamfered_plate()))


def test_the_list_of_faces_names_them_so_that_a_pocket_is_one_selection():
    rows = face_rows(brep.the_solid(pocket_plate().val()))
    floors = [r["feature"] for r in rows if r["feature"] and r["feature"]["is_floor"]]
    assert sorted(f["name"] for f in floors) == ["boss 1", "open pocket 1", "open pocket 2", "pocket 1", "pocket 2", "pocket 3"]
    walls = [r for r in rows if r["feature"] and r["feature"]["name"] == "pocket 1"]
    assert len(walls) > 2 and all("name='pocket 1'" in r["python"] for r in walls)
