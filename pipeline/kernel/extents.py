"""How far a shape reaches along x, y and z: the kernel's box, made tight where a trimmed spline's is loose.

The kernel boxes a face that is no plane, cylinder, cone, sphere or torus by the whole rectangle of its parameters, trimmed or
not: a dish written as a spline may seem to reach far out of its block.  Such a face reaches its farthest on its edges, or at
a place inside its borders, which is looked for on a grid that closes in.
"""

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_UndefinedValue
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_OUT
from OCP.TopoDS import TopoDS

from cuspline.kernel.topology import explore

SURE = (GeomAbs_SurfaceType.GeomAbs_Plane, GeomAbs_SurfaceType.GeomAbs_Cylinder, GeomAbs_SurfaceType.GeomAbs_Cone,
        GeomAbs_SurfaceType.GeomAbs_Sphere, GeomAbs_SurfaceType.GeomAbs_Torus)
LOOSE_MM = 1e-4             # a side of the kernel's box that is off by less stays
TRIM_MM = 1e-7
NODES, FINE_NODES = 25, 7   # of the first grid along each side, and of those that close in
CLOSER, ROUNDS = 0.4, 18


def extents_mm(shape):
    """(min (3,), max (3,)), tight to the geometry."""
    low, high = _box([shape])
    loose = [TopoDS.Face_s(f) for f in explore(shape, TopAbs_FACE)
             if BRepAdaptor_Surface(TopoDS.Face_s(f)).GetType() not in SURE]
    if not loose:
        return low, high
    sure = [f for f in explore(shape, TopAbs_FACE) if not any(f.IsSame(g) for g in loose)]
    inner_low, inner_high = _box([*sure, *explore(shape, TopAbs_EDGE)])
    if (low > inner_low - LOOSE_MM).all() and (high < inner_high + LOOSE_MM).all():
        return low, high
    lows, highs = np.array([_box([f]) for f in loose]).transpose(1, 0, 2)
    return (-_sides(-low, -inner_low, loose, -lows, -1.0), _sides(high, inner_high, loose, highs, 1.0))


def _sides(kernels, least, faces, reach, sign):
    """Three upper sides of a box: the kernel's, or where faces inside their borders come to, if that is clearly less.

    Args:
        kernels: (3,) the kernel's.   least: (3,) what is surely reached.   faces: those that may be boxed loosely.
        reach: (len(faces), 3) the kernel's of each of them.   sign: -1 where the shape is looked at mirrored.
    """
    sides = kernels.copy()
    for axis in np.flatnonzero(kernels > least + LOOSE_MM):
        tops = [_highest(f, axis, sign) for f, far in zip(faces, reach[:, axis]) if far > least[axis] + LOOSE_MM]
        tight = max([least[axis], *tops])
        sides[axis] = tight if tight < kernels[axis] - LOOSE_MM else kernels[axis]
    return sides


def _box(shapes):
    box = Bnd_Box()
    for shape in shapes:
        try:
            BRepBndLib.AddOptimal_s(shape, box, False, False)
        except Geom_UndefinedValue:             # an offset surface has no normal at its pole
            BRepBndLib.Add_s(shape, box, False)
    box.SetGap(0.0)
    return tuple(np.array([p.X(), p.Y(), p.Z()]) for p in (box.CornerMin(), box.CornerMax()))


def _highest(face, axis, sign):
    """How far a face reaches within its borders along an axis."""
    surface, inside = BRepAdaptor_Surface(face), BRepTopAdaptor_FClass2d(face, TRIM_MM)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    best, at, half, nodes = -np.inf, ((u0 + u1) / 2, (v0 + v1) / 2), ((u1 - u0) / 2, (v1 - v0) / 2), NODES
    for _ in range(ROUNDS):
        middle = at
        for u in np.clip(np.linspace(middle[0] - half[0], middle[0] + half[0], nodes), u0, u1):
            for v in np.clip(np.linspace(middle[1] - half[1], middle[1] + half[1], nodes), v0, v1):
                height = sign * surface.Value(u, v).Coord(int(axis) + 1)
                if height > best and inside.Perform(gp_Pnt2d(u, v)) != TopAbs_OUT:
                    best, at = height, (u, v)
        closer = 2.0 / (nodes - 1) if nodes == NODES else CLOSER
        half, nodes = (half[0] * closer, half[1] * closer), FINE_NODES
    return best
