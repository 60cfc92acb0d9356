"""Boxes of shapes are tight, whatever their faces are written as."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert

from cuspline.kernel.extents import extents_mm


def dished(radius, x):
    block = cq.Workplane().box(24, 18, 8).translate((0, 0, -4))
    return block.cut(cq.Workplane("XY").sphere(radius).translate((x, 0, radius - 2.5)))


def domed():
    plate = cq.Workplane().box(24, 18, 4).translate((0, 0, -2))
    return plate.union(cq.Workplane("XY").sphere(7).translate((3.0, 1.0, -2.0)).intersect(cq.Workplane().box(60, 60, 60)
                                                                                         .translate((0, 0, 29))))


@pytest.mark.parametrize("body, low, high", [
    (dished(14.0, -5.0), (-12, -9, -8), (12, 9, 0)), (dished(30.0, 4.0), (-12, -9, -8), (12, 9, 0)),
    (domed(), (-12, -9, -4), (12, 9, 5))], ids=["dish", "shallow dish", "dome"])
def test_faces_written_as_splines_reach_no_farther_than_they_do(body, low, high):
    for shape in (body.val().wrapped, BRepBuilderAPI_NurbsConvert(body.val().wrapped, True).Shape()):
        found = extents_mm(shape)
        np.testing.assert_allclose(found, (low, high), atol=5e-6)      # the kernel boxes edges written as splines 1e-6 mm wide
        assert (found[0] <= np.array(low) + 1e-7).all() and (found[1] >= np.array(high) - 1e-7).all()


def test_an_offset_surface_without_a_normal_at_its_pole_has_an_extent():
    """Inside a shelled box whose foot is as round as its corners."""
    box = cq.Workplane().box(27, 20, 7).edges("|Z").fillet(5.5).faces("<Z").edges().fillet(3.5)
    shell = box.faces(">Z").shell(-3.0).val().wrapped
    np.testing.assert_allclose(extents_mm(shell), ((-13.5, -10, -3.5), (13.5, 10, 3.5)), atol=1e-6)
