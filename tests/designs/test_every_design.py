"""What every design in the catalogue must keep, and what the free-form ones are."""

import pytest
from pydantic import ValidationError

from cuspline.app import catalogue
from cuspline.designs.lopes_surface import LopesSurface
from cuspline.designs.mould_insert import MouldInsert
from cuspline.designs.mould_insert import design as insert_design
from cuspline.kernel import brep
from cuspline.surfaces.curvature import tightest_hollow
from cuspline.values.frames import Frame


def as_solid(name):
    """A design by its default parameters; of a propeller the solid alone, without looking for positions to cut it from."""
    source = catalogue.find_design(name)
    return catalogue.make_design(source, ["blades_cut=none"] if "blades_cut" in source.parameters.model_fields else [])


@pytest.fixture(scope="module", params=catalogue.design_names())
def made(request):
    return as_solid(request.param)


@pytest.fixture(scope="module")
def solid(made):
    return brep.the_solid(made.solid, made.name)


def test_default_solid_is_valid_and_every_predicate_matches(made, solid):
    faces = brep.faces_of(solid)
    for predicate in made.predicates:
        assert brep.select_faces(faces, predicate)


def test_stock_holds_the_part(made, solid):
    low, high = brep.bounding_box_mm(solid)
    around_low, around_high = made.stock.shape.box_in(Frame.shift((0.0, 0.0, 0.0)))
    assert (low > around_low - 1e-3).all() and (high < around_high + 1e-3).all()


def test_the_same_parameters_give_the_same_solid_byte_for_byte(made, solid, tmp_path):
    again = as_solid(made.name)
    for name, body in (("once", solid), ("again", brep.the_solid(again.solid))):
        brep.write_step(body, tmp_path / name, made.name)
    assert (tmp_path / "again").read_bytes() == (tmp_path / "once").read_bytes()


def test_the_published_surface_is_on_top_of_its_plate():
    made = catalogue.make_design(catalogue.find_design("lopes_surface"), [])
    faces = brep.faces_of(brep.the_solid(made.solid))
    index = faces.index(brep.select_faces(faces, made.predicates[0])[0])
    assert tightest_hollow(faces, [index]).radius_mm == pytest.approx(63.66, abs=0.01)
    with pytest.raises(ValidationError):
        LopesSurface(base_mm=1.0)


def test_the_inserts_foot_fillet_is_its_tightest_hollow():
    made = insert_design(MouldInsert(foot_radius_mm=3.5))
    faces = brep.faces_of(brep.the_solid(made.solid))
    wanted = [faces.index(f) for p in made.predicates for f in brep.select_faces(faces, p)]
    assert tightest_hollow(faces, wanted).radius_mm == pytest.approx(3.5, rel=0.02)
    with pytest.raises(ValidationError, match="raise boss_height_mm"):
        MouldInsert(boss_height_mm=6.0)
