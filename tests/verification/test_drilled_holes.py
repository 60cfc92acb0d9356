"""What a drill's point leaves at a level bottom: granted where the posted text drills that hole to its bottom, nowhere else."""

from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest

from cuspline.app.catalogue import find_library
from cuspline.kernel import brep
from cuspline.program.program import Kind
from cuspline.values.frames import Frame
from cuspline.verification.drilled_holes import drilled_points

SHOP = find_library(None)
DRILL, FLAT_DRILL, MILL = 35, 47, 3             # 5 mm, 10 mm, an end mill
TOOLS = {n: SHOP.number(n) for n in (DRILL, FLAT_DRILL, MILL, 36)}


@pytest.fixture(scope="module")
def faces():
    """Of 5 mm, 16 and 8 mm deep, and of 10 mm with level bottoms, one of 5 mm that goes through."""
    block = cq.Workplane("XY").box(40, 20, 20, centered=False)
    for x, low, radius in ((10, 4, 2.5), (17, 12, 2.5), (25, 4, 5.0), (35, -1, 2.5)):
        block = block.cut(cq.Workplane("XY", origin=(x, 10, low)).circle(radius).extrude(30))
    return brep.faces_of(brep.the_solid(block.val()))


def posted(tool, *ends):
    return SimpleNamespace(tool=np.full(len(ends), tool), kind=np.full(len(ends), Kind.FEED), end_mm=np.array(ends, float))


def points(faces, *moves, frame=Frame.shift((0, 0, 0))):
    return drilled_points(posted(*moves), frame, faces, TOOLS)


def test_a_hole_that_is_drilled_to_its_bottom_keeps_the_drills_point(faces):
    point, = points(faces, DRILL, (10, 10, 9), (10, 10, 4.0))
    assert point.foot_mm == pytest.approx((10, 10, 4)) and point.radius_mm == pytest.approx(2.5)
    corners, triangles = point.triangles()
    r = np.hypot(*(corners[1:, :2] - (10, 10)).T)
    assert (r >= 2.5).all() and corners[1:, 2] == pytest.approx(4 + point.height_mm) and triangles.max() == len(corners) - 1


@pytest.mark.parametrize("tool, end", [(DRILL, (10, 10, 4.1)), (DRILL, (17, 10, 12)),
                                       (DRILL, (10.1, 10, 4)), (36, (10, 10, 4)), (MILL, (10, 10, 4)),
                                       (FLAT_DRILL, (25, 10, 4)), (DRILL, (25, 10, 4)), (DRILL, (35, 10, -2))])
def test_nothing_is_granted_to_what_is_not_drilled_to_its_bottom(faces, tool, end):
    """Not to its bottom, a shallow hole, beside it, of
    another diameter, by a mill, by a flat drill, in a wider hole, in one that goes through."""
    assert points(faces, tool, end) == ()


def test_a_hole_that_looks_another_way_in_the_setup_is_not_drilled_there(faces):
    turned = Frame.of_axes((0, 0, 0), (1, 0, 0), (0, 0, -1))
    assert points(faces, DRILL, tuple(turned.into(np.array([[10.0, 10, 4]]))[0]), frame=turned) == ()
