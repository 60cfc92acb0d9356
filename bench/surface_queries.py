"""Rates of the surface queries on one bicubic sheet, one thread, CPU seconds; the CAD kernel beside them in the same run."""

import time

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

from cuspline.kernel.brep import Face
from cuspline.surfaces.curvature import tightest_hollow
from cuspline.surfaces.patches import _derive_rows
from cuspline.surfaces.projection import ClosestTree
from cuspline.surfaces.projection_kernels import project_block, refine_rows
from cuspline.toolpaths.contact.forward_offset import _rows

POINTS, KERNEL_POINTS, REPEATS = 40_000, 400, 3
NEAR_MM, START = 0.3, 0.003         # points this far off the sheet; starts this far off in its parameters


def sheet(nu=44, nv=28):
    """A bicubic sheet of 100 x 60 mm with waves and a bump, as brep.Face and as the kernel's surface."""
    x, y = np.meshgrid(np.linspace(0, 100, nu), np.linspace(0, 60, nv), indexing="ij")
    z = 5 * np.sin(2 * np.pi * x / 50) * np.sin(2 * np.pi * y / 40) + 5 * np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 98)
    x, y = x + 0.4 * np.sin(y / 5), y + 0.4 * np.sin(x / 7)
    poles = TColgp_Array2OfPnt(1, nu, 1, nv)
    for i in range(nu):
        for j in range(nv):
            poles.SetValue(i + 1, j + 1, gp_Pnt(x[i, j], y[i, j], z[i, j]))
    (ku, mu), (kv, mv) = _knots(nu), _knots(nv)
    surface = Geom_BSplineSurface(poles, ku, kv, mu, mv, 3, 3)
    return Face(BRepBuilderAPI_MakeFace(surface, 1e-7).Face()), surface


def _knots(count):
    """Knots and multiplicities of a clamped cubic."""
    knots, times = TColStd_Array1OfReal(1, count - 2), TColStd_Array1OfInteger(1, count - 2)
    for k in range(1, count - 1):
        knots.SetValue(k, (k - 1) / (count - 3))
        times.SetValue(k, 4 if k in (1, count - 2) else 1)
    return knots, times


def measure():
    """[(what, number, unit)]."""
    face, surface = sheet()
    tree = ClosestTree.of_faces([face])
    patches, rng = tree.patches, np.random.default_rng(0)
    u, v = rng.uniform(0.02, 0.98, (2, POINTS))
    order = np.lexsort((v, (100 * u).astype(int)))
    shape = face.shape_at(u[order], v[order])
    points = shape.point_mm + rng.uniform(-NEAR_MM, NEAR_MM, (POINTS, 1)) * shape.normal
    return [*_forward(patches), _evaluation(patches, u, v), *_projection(tree, surface, points, u[order], v[order]),
            _hollow(face)]


def _forward(patches):
    grid = np.linspace(0, 1, 1000), np.linspace(0, 1, 2000)
    out = np.empty((1000, 2000, 3))
    for name, radius, corner in (("ball", 6.0, 6.0), ("bull-nose", 5.0, 1.0), ("flat", 5.0, 0.0)):
        rate = out.size / 3 / _seconds(lambda: _rows(patches.arrays, 0, *grid, radius, corner, 0.0, out))
        yield f"forward offset over a grid, {name}", rate / 1e6, "M points / CPU s"


def _evaluation(patches, u, v):
    out, face = np.empty((POINTS, 6, 3)), np.zeros(POINTS, np.int64)
    seconds = _seconds(lambda: _derive_rows(patches.arrays, face, u, v, 0, POINTS, out))
    return "point and derivatives to second order, scattered", POINTS / seconds / 1e6, "M points / CPU s"


def _projection(tree, surface, points, u, v):
    given, answers = (tree.arrays, tree.patches.arrays, tree.trims.arrays), _answers(POINTS)
    anywhere, face = np.full(POINTS, -1), np.zeros(POINTS, np.int64)
    searched = POINTS / _seconds(lambda: project_block(*given, points, anywhere, 0, POINTS, *answers))
    start, foot = np.column_stack([u + START, v - START]), np.empty((POINTS, 3))
    refined = POINTS / _seconds(lambda: refine_rows(tree.patches.arrays, face, points, start.copy(), foot, 0, POINTS))
    theirs, projector = np.empty(KERNEL_POINTS), GeomAPI_ProjectPointOnSurf()
    projector.Init(surface, 0.0, 1.0, 0.0, 1.0)         # samples the surface once, for all points

    def by_the_kernel():
        for k, p in enumerate(points[:KERNEL_POINTS].tolist()):
            projector.Perform(gp_Pnt(*p))
            theirs[k] = projector.LowerDistance()

    kernel = KERNEL_POINTS / _seconds(by_the_kernel)
    yield "projection, GeomAPI_ProjectPointOnSurf", kernel / 1e6, "M points / CPU s"
    yield "projection, whole tree searched", searched / 1e6, "M points / CPU s"
    yield "projection, whole tree searched, against GeomAPI", searched / kernel, "x"
    yield "projection from a start nearby", refined / 1e6, "M points / CPU s"
    yield "projection from a start nearby, against GeomAPI", refined / kernel, "x"
    yield "projection, largest difference from GeomAPI", float(np.abs(answers[0][:KERNEL_POINTS] - theirs).max()), "mm"


def _answers(n):
    return (np.empty(n), np.empty((n, 3)), np.empty(n, np.int64), np.empty((n, 2)), np.empty((n, 3)), np.empty(n, np.bool_))


def _hollow(face):
    return "tightest hollow proven within 1 %", 1e3 * _seconds(lambda: tightest_hollow([face], [0])), "CPU ms"


def _seconds(run):
    """CPU seconds of the best of a few runs, the first (compiling) one not counted."""
    run()
    times = []
    for _ in range(REPEATS):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what:60s} {number:12.4g} {unit}")
