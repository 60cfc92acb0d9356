"""Points and tangents of all faces at once are OCCT's, whatever the surface."""

import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert
from OCP.gp import (
    gp_Ax1,
    gp_Ax3,
    gp_Cone,
    gp_Cylinder,
    gp_Dir,
    gp_Pln,
    gp_Pnt,
    gp_Sphere,
    gp_Torus,
    gp_Trsf,
    gp_Vec,
)
from OCP.TopAbs import TopAbs_FACE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from cuspline.kernel.surface_places import surface_points, surface_tangents
from cuspline.kernel.topology import explore

AXES, LEFT = (gp_Ax3(gp_Pnt(1.0, -2.0, 3.0), gp_Dir(0.2, 0.5, 0.8), gp_Dir(1.0, 0.1, -0.3)) for _ in range(2))
LEFT.YReverse()                 # a left-handed frame, as mirrored solids have
ROUNDING = 1e-12                # of millimetres and of derivatives of some tens


def faces():
    make = lambda surface, *bounds: BRepBuilderAPI_MakeFace(surface, *bounds).Face()
    cone = make(gp_Cone(AXES, 0.4, 3.0), 0.1, 2.0, -1.0, 4.0)
    found = {"plane": make(gp_Pln(AXES), -1.0, 4.0, 0.0, 2.0), "cylinder": make(gp_Cylinder(AXES, 3.0), 0.1, 2.0, -1.0, 4.0),
             "cone": cone, "sphere": make(gp_Sphere(AXES, 5.0), 0.1, 2.0, -1.0, 1.2),
             "torus": make(gp_Torus(AXES, 6.0, 2.0), 0.1, 2.0, -1.0, 4.0),
             "left-handed": make(gp_Cylinder(LEFT, 3.0), 0.1, 2.0, -1.0, 4.0)}
    spline, = explore(BRepBuilderAPI_NurbsConvert(cone, True).Shape(), TopAbs_FACE)
    turn = gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(0.0, 1.0, 0.0), gp_Dir(1.0, 1.0, 0.0)), 0.7)
    return {**found, "B-spline": spline, "moved": found["torus"].Moved(TopLoc_Location(turn)),
            "moved B-spline": spline.Moved(TopLoc_Location(turn))}


@pytest.mark.parametrize("kind", faces())
def test_points_and_tangents_are_the_kernels(kind):
    face = TopoDS.Face_s(faces()[kind])
    adaptor = BRepAdaptor_Surface(face, True)
    low, high = ((adaptor.FirstUParameter(), adaptor.FirstVParameter()), (adaptor.LastUParameter(), adaptor.LastVParameter()))
    uv = np.random.default_rng(3).uniform(low, high, (50, 2))
    p, a, b, wanted = gp_Pnt(), gp_Vec(), gp_Vec(), []
    for u, v in uv.tolist():
        adaptor.D1(u, v, p, a, b)
        wanted.append([p.Coord(), a.Coord(), b.Coord()])
    wanted = np.array(wanted).transpose(1, 0, 2)
    assert np.abs(surface_points(face, uv) - wanted[0]).max() < ROUNDING
    assert np.abs(np.array(surface_tangents(face, uv)) - wanted).max() < ROUNDING
    assert surface_points(face, uv[:0]).shape == (0, 3)
