"""Faces that somebody points at, in CadQuery or build123d: their predicates match them alone, after STEP too."""

import tomllib

import build123d as bd
import cadquery as cq
import pytest

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup
from cuspline.design.face_selection import in_python, in_toml, predicate_for, predicates_of
from cuspline.kernel import brep
from cuspline.values.errors import DesignError


@pytest.fixture(scope="module")
def block():
    """Four equal holes in a block: their walls differ by place alone."""
    return cq.Workplane("XY").box(30, 20, 8).faces(">Z").workplane().rect(20, 10, forConstruction=True).vertices().hole(4)


def matched(solid, predicates):
    faces = brep.faces_of(brep.the_solid(solid))
    return [k for k, f in enumerate(faces) if any(brep.matches(f, p) for p in predicates)]


def test_every_face_of_a_part_has_a_predicate_of_its_own(block, tmp_path):
    solid = brep.the_solid(block)
    brep.write_step(solid, tmp_path / "block.step", "block")
    again = brep.the_solid(brep.read_step(tmp_path / "block.step"))
    faces, read = brep.faces_of(solid), brep.faces_of(again)
    for k in range(len(faces)):
        predicate = predicate_for(faces, k, "this")
        (only,) = brep.select_faces(read, predicate)
        assert abs(only.middle.point_mm - faces[k].middle.point_mm).max() < 1e-6


def test_a_workplane_is_handed_over_as_it_is(block):
    top = predicates_of(block, {"top": block.faces(">Z")})
    assert [p.name for p in top] == ["top"] and top[0].kinds == ("plane",) and top[0].normal == (0.0, 0.0, 1.0)
    holes = predicates_of(block, {"holes": block.faces("%CYLINDER")})
    assert len(holes) == 4 and {p.name for p in holes} == {"holes"}
    assert matched(block, holes) == [k for k, f in enumerate(brep.faces_of(brep.the_solid(block))) if f.kind == "cylinder"]


def test_a_shape_list_is_handed_over_as_it_is():
    part = bd.Box(20, 20, 10) - bd.Pos(0, 0, 5) * bd.Sphere(6)
    bowl = part.faces().filter_by(bd.GeomType.SPHERE)
    design = Design(name="bowl", description="a bowl", parameters=Parameters(), solid=part, material="aluminium_6061",
                    predicates={"bowl": bowl, "top": part.faces().sort_by(bd.Axis.Z)[-1],
                                "base": FacePredicate(name="", count=1, normal=(0, 0, -1))},
                    finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.004, gouge_mm=0.005),
                    setups=(Setup(name="setup-1", faces=("bowl", "top"), wcs_in_words="middle"),))
    assert [p.name for p in design.predicates] == ["bowl", "top", "base"] and design.predicates[0].kinds == ("sphere",)


def test_a_face_of_another_part_is_refused(block):
    with pytest.raises(DesignError, match="is no face of the part.*select on the finished shape"):
        predicates_of(block, {"other": cq.Workplane("XY").box(5, 5, 5).faces(">Z")})
    with pytest.raises(DesignError, match="'none': the selection holds no face"):
        predicates_of(block, {"none": []})


def test_what_is_pasted_is_the_same_predicate(block):
    faces = brep.faces_of(brep.the_solid(block))
    for k in (0, len(faces) - 1):
        predicate = predicate_for(faces, k, "face 1")
        assert eval(in_python(predicate)) == predicate
        assert FacePredicate(**tomllib.loads(in_toml(predicate))["faces"][0]) == predicate
