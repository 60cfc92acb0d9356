"""Points and derivatives of a face's own surface at many parameters at once.

Planes, cylinders, cones, spheres and tori by their formulas, B-splines by a compiled kernel; every other surface is asked
point by point.  Agrees with OCCT's own evaluation (tests/kernel/test_surface_places.py).
"""

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.gp import gp_Pnt, gp_Vec

from cuspline.kernel.brep import nurbs_of_surface
from cuspline.values import fixed_math as fixed


def surface_points(face, uv):
    """(n, 3) exact points of a face's surface at parameters (n, 2)."""
    return FaceSurface(face).points(uv)


def surface_tangents(face, uv):
    """Exact points and the derivatives along u and v, (n, 3) each."""
    return FaceSurface(face).tangents(uv)


class FaceSurface:
    """A face's own surface, read once for many questions."""

    def __init__(self, face):
        self._surface = BRepAdaptor_Surface(face, False)
        self._is_round = self._surface.GetType() in ROUND
        self._spline = None if self._is_round else _spline_of(self._surface)

    def points(self, uv):
        """(n, 3) exact points at parameters (n, 2)."""
        uv = np.asarray(uv, float).reshape(-1, 2)
        if self._is_round:
            return _round(self._surface, uv)[0]
        if self._spline is not None:
            return self._spline.points(*uv.T)
        p, rows = gp_Pnt(), []
        for u, v in uv.tolist():
            self._surface.D0(u, v, p)
            rows.append(p.Coord())
        return np.array(rows).reshape(-1, 3)

    def tangents(self, uv):
        """Exact points and the derivatives along u and v at parameters (n, 2), (n, 3) each."""
        uv = np.asarray(uv, float).reshape(-1, 2)
        if self._is_round:
            return _round(self._surface, uv)
        if self._spline is not None:
            return tuple(self._spline.derivatives(*uv.T)[:, :3].transpose(1, 0, 2).copy())
        p, a, b, rows = gp_Pnt(), gp_Vec(), gp_Vec(), []
        for u, v in uv.tolist():
            self._surface.D1(u, v, p, a, b)
            rows.append((*p.Coord(), *a.Coord(), *b.Coord()))
        return tuple(np.array(rows).reshape(-1, 3, 3).transpose(1, 0, 2).copy())


def _spline_of(surface):
    """NurbsSurface with the same parameters; None of another kind, or of a periodic one."""
    if surface.GetType() != GeomAbs_SurfaceType.GeomAbs_BSplineSurface:
        return None
    spline = surface.BSpline()
    return None if spline.IsUPeriodic() or spline.IsVPeriodic() else nurbs_of_surface(spline)


def _plane(plane, u, v):
    """Coordinates along the axes, then their derivatives along u and along v."""
    zero, one = np.zeros(len(u)), np.ones(len(u))
    return (u, v, zero), (one, zero, zero), (zero, one, zero)


def _cylinder(cylinder, u, v):
    r, c, s, zero = cylinder.Radius(), fixed.cos(u), fixed.sin(u), np.zeros(len(u))
    return (r * c, r * s, v), (-r * s, r * c, zero), (zero, zero, zero + 1.0)


def _cone(cone, u, v):
    lean, c, s = cone.SemiAngle(), fixed.cos(u), fixed.sin(u)
    r, zero = cone.RefRadius() + v * fixed.sin(lean), np.zeros(len(u))
    return ((r * c, r * s, v * fixed.cos(lean)), (-r * s, r * c, zero),
            (fixed.sin(lean) * c, fixed.sin(lean) * s, zero + fixed.cos(lean)))


def _sphere(sphere, u, v):
    return _turned(0.0, sphere.Radius(), u, v)


def _torus(torus, u, v):
    return _turned(torus.MajorRadius(), torus.MinorRadius(), u, v)


def _turned(far, r, u, v):
    """A circle of radius r whose middle runs round the axis at a distance."""
    c, s, up = fixed.cos(u), fixed.sin(u), fixed.sin(v)
    out, zero = r * fixed.cos(v), np.zeros(len(u))
    return (((far + out) * c, (far + out) * s, r * up), (-(far + out) * s, (far + out) * c, zero),
            (-r * up * c, -r * up * s, out))


ROUND = {GeomAbs_SurfaceType.GeomAbs_Plane: (BRepAdaptor_Surface.Plane, _plane),
         GeomAbs_SurfaceType.GeomAbs_Cylinder: (BRepAdaptor_Surface.Cylinder, _cylinder),
         GeomAbs_SurfaceType.GeomAbs_Cone: (BRepAdaptor_Surface.Cone, _cone),
         GeomAbs_SurfaceType.GeomAbs_Sphere: (BRepAdaptor_Surface.Sphere, _sphere),
         GeomAbs_SurfaceType.GeomAbs_Torus: (BRepAdaptor_Surface.Torus, _torus)}


def _round(surface, uv):
    """Points and both derivatives of a surface with a formula."""
    shape_of, formula = ROUND[surface.GetType()]
    shape = shape_of(surface)
    axes = shape.Position()
    xyz = lambda v: np.array([v.X(), v.Y(), v.Z()])
    x, y, z = xyz(axes.XDirection()), xyz(axes.YDirection()), xyz(axes.Direction())
    points, du, dv = (a[:, None] * x + b[:, None] * y + c[:, None] * z for a, b, c in formula(shape, *uv.T))
    return xyz(axes.Location()) + points, du, dv
