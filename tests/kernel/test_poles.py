"""Domes and dishes turned from arcs whose centres are off the axis, through STEP as CadQuery writes it, and back."""

import cadquery as cq
import pytest
from OCP.BRepCheck import BRepCheck_Analyzer

from cuspline.kernel import brep, step_files


def turned(end_mm, middle, radius=11.5):
    """A round block of height 8 under a dome (or a dish) with its apex at a height."""
    profile = cq.Workplane("XZ").moveTo(0, -8).lineTo(radius, -8).lineTo(radius, 0).threePointArc(middle, (0, end_mm))
    return profile.close().revolve(360, (0, 0), (0, 1))


SHAPES = {"dome": turned(4.0, (8.05, 2.2)), "dish": turned(-3.0, (7.0, -2.4)),
          "dome below": turned(4.0, (8.05, 2.2)).rotate((0, 0, 0), (1, 0, 0), 180),
          "dome aside": turned(4.0, (8.05, 2.2)).rotate((0, 0, 0), (1, 2, 0), 35).translate((30, -7, 4)),
          "two poles": cq.Workplane("XZ").moveTo(0, -5).threePointArc((9, -3), (11, 0)).threePointArc((8, 3.5), (0, 5)).close()
          .revolve(360, (0, 0), (0, 1))}


@pytest.mark.parametrize("name", SHAPES)
def test_a_pole_that_the_reader_drops_is_put_back(tmp_path, name):
    file = tmp_path / "turned.step"
    cq.exporters.export(SHAPES[name], str(file))
    shape = step_files.read_step(file)
    solid = brep.the_solid(shape)
    assert BRepCheck_Analyzer(brep.wrapped(solid)).IsValid()
    assert cq.Shape(brep.wrapped(solid)).Volume() == pytest.approx(SHAPES[name].val().Volume(), rel=1e-9)
    back = brep.storable(solid)
    assert cq.Shape(brep.wrapped(back)).Volume() == pytest.approx(SHAPES[name].val().Volume(), rel=1e-6)


def test_a_face_keeps_its_name_when_its_pole_is_put_back(tmp_path):
    part = SHAPES["dome"]
    dome = max(part.faces().vals(), key=lambda f: f.Center().z)
    step_files.write_step(brep.marked(part, names=[("dome", dome)]), tmp_path / "named.step", "named")
    solid = brep.the_solid(step_files.read_step(tmp_path / "named.step"))
    assert [m.name for m in solid.face_marks].count("dome") == 1
