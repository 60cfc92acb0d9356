"""Faces chosen by colour and by name: through STEP, out of assemblies of others, and from designs in code."""

import cadquery as cq
import numpy as np
import pytest
from built_parts import saddle_job
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from pydantic import ValidationError

from cuspline.app.catalogue import find_design, make_design
from cuspline.design import FacePredicate
from cuspline.kernel.brep import explore, faces_of, marked, read_step, select_faces, the_solid, volume_mm3, write_step
from cuspline.values.errors import DesignError

RED, STEEL = (1.0, 0.0, 0.0), (0.5, 0.55, 0.6)


def block():
    return cq.Workplane("XY").box(30, 20, 10).edges("|Z").fillet(2)


@pytest.fixture(scope="module")
def seat():
    """A block whose top is called seat and is red, and whose bottom is grey."""
    body = block()
    return marked(body, names=[("seat", body.faces(">Z").val())],
                  colors=[(RED, body.faces(">Z").val()), (STEEL, body.faces("<Z").val())])


def chosen(solid, **conditions):
    return select_faces(faces_of(solid), FacePredicate(**{"name": "these", "count": 1, **conditions}))


# exploring ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [TopAbs_FACE, TopAbs_EDGE, TopAbs_VERTEX])
def test_sub_shapes_come_in_the_order_in_which_the_kernel_first_meets_them(kind):
    shape = block().faces(">Z").workplane().hole(4).val().wrapped
    first, explorer = [], TopExp_Explorer(shape, kind)
    while explorer.More():
        if not any(explorer.Current().IsSame(f) for f in first):
            first.append(explorer.Current())
        explorer.Next()
    found = explore(shape, kind)
    assert len(found) == len(first)
    assert all(a.IsEqual(b) for a, b in zip(found, first))      # the same place and orientation too


# marks in code --------------------------------------------------------------------------------------------


def test_a_marked_face_is_chosen_by_its_name_and_by_its_colour(seat):
    by_name, by_color = chosen(seat, face_name="seat")[0], chosen(seat, color=RED)[0]
    assert by_name.shape.IsSame(by_color.shape)
    assert by_name.middle.normal[0] == pytest.approx((0, 0, 1))
    assert chosen(seat, color=STEEL)[0].middle.normal[0] == pytest.approx((0, 0, -1))


def test_a_colour_matches_within_what_is_allowed(seat):
    near = tuple(c + 0.015 for c in STEEL)
    assert len(chosen(seat, color=near)) == 1
    with pytest.raises(DesignError, match=r"matches 0 of 10 faces.*colours in the part: \(0.5, 0.55, 0.6\)"):
        chosen(seat, color=near, color_within=0.01)


def test_conditions_hold_together(seat):
    with pytest.raises(DesignError, match="matches 0 of 10 faces, it says 1"):
        chosen(seat, face_name="seat", normal=(0, 0, -1))


def test_a_name_that_no_face_has_is_refused_with_those_there_are(seat):
    with pytest.raises(DesignError, match="names in the part: seat"):
        chosen(seat, face_name="seta")
    with pytest.raises(DesignError, match="names in the part: none"):
        chosen(the_solid(block()), face_name="seat")


def test_a_face_of_another_shape_cannot_be_marked():
    with pytest.raises(DesignError, match="'seat' is no face of this solid"):
        marked(block(), names=[("seat", cq.Workplane("XY").box(1, 1, 1).faces(">Z").val())])


def test_marking_changes_nothing_else(seat):
    assert volume_mm3(seat) == pytest.approx(volume_mm3(the_solid(block())), rel=1e-12)
    assert the_solid(seat).face_marks == seat.face_marks
    assert not hasattr(the_solid(block()), "face_marks")


# STEP -------------------------------------------------------------------------------------------------------


def test_names_and_colours_go_through_step(seat, tmp_path):
    write_step(seat, tmp_path / "a.step", "plate")
    again = the_solid(read_step(tmp_path / "a.step"), "plate")
    marks = {m for m in again.face_marks if m.name or m.color}
    assert {m.name for m in marks} == {"seat", ""}
    np.testing.assert_allclose(sorted(m.color for m in marks), [STEEL, RED], atol=1e-6)
    assert chosen(again, face_name="seat", color=RED)[0].middle.normal[0] == pytest.approx((0, 0, 1))
    assert chosen(again, color=STEEL)[0].middle.normal[0] == pytest.approx((0, 0, -1))


def test_a_marked_step_has_the_same_bytes_twice_and_after_reading_it_back(seat, tmp_path):
    for name, solid in (("a", seat), ("b", seat)):
        write_step(solid, tmp_path / f"{name}.step", "plate")
    text = (tmp_path / "a.step").read_bytes()
    assert text == (tmp_path / "b.step").read_bytes()
    assert b"PRODUCT('plate','plate'" in text and b"ADVANCED_FACE('seat'" in text and b"2000-01-01" in text
    once = tmp_path / "once.step"
    write_step(the_solid(read_step(tmp_path / "a.step")), once, "plate")
    write_step(the_solid(read_step(once)), tmp_path / "twice.step", "plate")
    assert once.read_bytes() == (tmp_path / "twice.step").read_bytes()


def test_a_step_without_marks_reads_as_a_bare_shape(tmp_path):
    write_step(the_solid(block()), tmp_path / "a.step", "plate")
    assert not hasattr(read_step(tmp_path / "a.step"), "face_marks")
    assert b"COLOUR" not in (tmp_path / "a.step").read_bytes()


def test_colours_of_another_programs_assembly_stay_with_moved_bodies(tmp_path):
    # CadQuery's own exporter: a body placed in an assembly, its top of another colour than the body
    body = block().val()
    assembly = cq.Assembly(name="fixture")
    assembly.add(body, name="plate", loc=cq.Location((100, 50, 7), (0, 0, 1), 30), color=cq.Color(*STEEL, 1, srgb=True))
    top = cq.Workplane(obj=body).faces(">Z").val()
    assembly.objects["plate"].addSubshape(top, name="seat", color=cq.Color(*RED, 1, srgb=True))
    assembly.export(str(tmp_path / "a.step"))
    solid = the_solid(read_step(tmp_path / "a.step"))
    assert chosen(solid, color=RED)[0].middle.point_mm[0] == pytest.approx((100, 50, 12))
    assert len(chosen(solid, color=STEEL, count=9)) == 9           # what has no colour of its own has the body's


# counts -----------------------------------------------------------------------------------------------------


def test_at_least_takes_more_and_refuses_fewer():
    faces = faces_of(the_solid(block()))
    rounds = {"name": "rounds", "kinds": ("cylinder",)}
    assert len(select_faces(faces, FacePredicate(at_least=1, **rounds))) == 4
    with pytest.raises(DesignError, match="matches 4 of 10 faces, it says at least 5"):
        select_faces(faces, FacePredicate(at_least=5, **rounds))


@pytest.mark.parametrize("counts, said", [({}, "state count=N or at_least=1"),
                                          ({"count": 1, "at_least": 1}, "state one of count and at_least")])
def test_a_predicate_says_one_count(counts, said):
    with pytest.raises(ValidationError, match=said):
        FacePredicate(name="top", normal=(0, 0, 1), **counts)


def test_a_colour_beyond_white_is_refused():
    with pytest.raises(ValidationError, match="color"):
        FacePredicate(name="top", count=1, color=(255, 0, 0))


def test_a_predicate_is_written_with_what_it_says_and_reads_back():
    for predicate in (FacePredicate(name="top", count=1, normal=(0, 0, 1)),
                      FacePredicate(name="red", at_least=2, color=RED, color_within=0.1),
                      FacePredicate(name="seat", count=1, face_name="seat")):
        row = predicate.model_dump(mode="json")
        assert FacePredicate.model_validate(row) == predicate
        assert ("color_within" in row) == (predicate.color is not None)


# jobs -------------------------------------------------------------------------------------------------------


def test_a_job_chooses_by_name_and_colour_and_so_does_the_verdict_on_the_written_step(tmp_path):
    job = saddle_job(tmp_path)
    body = the_solid(read_step(tmp_path / "saddle.step"))
    hollow = next(f for f in faces_of(body) if f.kind == "cylinder")
    named = marked(body, names=[("saddle", hollow.shape)], colors=[(RED, hollow.shape)])
    write_step(named, tmp_path / "saddle.step", "saddle")
    text = "\n".join(line for line in job.read_text().splitlines() if not line.startswith("center_"))
    job.write_text(text.replace("count = 1", 'count = 1\nface_name = "saddle"\ncolor = [1.0, 0.0, 0.0]'))
    design = make_design(find_design(str(job)), [])
    write_step(the_solid(design.solid), tmp_path / "posted.step", "saddle")
    for shape in (design.solid, read_step(tmp_path / "posted.step")):
        found = select_faces(faces_of(the_solid(shape)), design.predicates[0])
        assert [f.kind for f in found] == ["cylinder"]
