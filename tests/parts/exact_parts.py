"""Parts for the tests of the exact drop-cutter, and a search for contacts that shares nothing with it."""

import cadquery as cq
import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepLib import BRepLib
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopoDS import TopoDS

from cuspline.kernel import brep


def patch_solid(poles, floor_mm):
    """A closed solid: a bicubic B-spline surface over straight borders in plan, walls and a floor.

    Args:
        poles: (nu, nv, 3), the outermost rows straight in plan, x growing with i and y with j.
    """
    nu, nv = poles.shape[:2]
    surface = _bicubic(poles)
    skirt = poles.copy()
    skirt[..., 2] = floor_mm
    sewing = BRepBuilderAPI_Sewing(1e-6)
    sewing.Add(BRepBuilderAPI_MakeFace(surface, 1e-9).Face())
    for rows in (poles[0], poles[-1], poles[:, 0], poles[:, -1]):
        wall = np.stack([rows, rows * (1, 1, 0) + (0, 0, floor_mm)])
        sewing.Add(BRepBuilderAPI_MakeFace(_ruled(wall), 1e-9).Face())
    corners = BRepBuilderAPI_MakePolygon()
    for i, j in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
        corners.Add(gp_Pnt(*poles[i, j, :2].tolist(), floor_mm))
    corners.Close()
    sewing.Add(BRepBuilderAPI_MakeFace(corners.Wire(), True).Face())
    sewing.Perform()
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(sewing.SewedShape())).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid


def _clamped(count, degree):
    values = np.linspace(0, 1, count - degree + 1)
    knots, multiplicities = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
    for k, v in enumerate(values.tolist()):
        knots.SetValue(k + 1, v)
        multiplicities.SetValue(k + 1, degree + 1 if k in (0, len(values) - 1) else 1)
    return knots, multiplicities


def _surface(poles, degree_u, degree_v):
    net = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    for i in range(poles.shape[0]):
        for j in range(poles.shape[1]):
            net.SetValue(i + 1, j + 1, gp_Pnt(*poles[i, j].tolist()))
    ku, mu = _clamped(poles.shape[0], degree_u)
    kv, mv = _clamped(poles.shape[1], degree_v)
    return Geom_BSplineSurface(net, ku, kv, mu, mv, degree_u, degree_v)


def _bicubic(poles):
    return _surface(poles, 3, 3)


def _ruled(wall):
    return _surface(wall, 1, 3)


def random_poles(seed, count=(7, 6), size_mm=(30.0, 24.0), height_mm=2.5, shift_mm=0.9):
    """(nu, nv, 3) poles of a hilly surface that is no graph of its parameters; borders straight in plan."""
    rng = np.random.default_rng(seed)
    greville = lambda n: np.convolve(np.concatenate([np.zeros(3), np.linspace(0, 1, n - 2), np.ones(3)])[1:-1],
                                     np.ones(3) / 3, "valid")
    u, v = np.meshgrid(greville(count[0]), greville(count[1]), indexing="ij")
    poles = np.stack([u * size_mm[0], v * size_mm[1], rng.normal(0, height_mm, u.shape)], axis=-1)
    poles[1:-1, 1:-1, :2] += rng.uniform(-shift_mm, shift_mm, (count[0] - 2, count[1] - 2, 2))
    return poles


class BruteDrop:
    """Tips by dense sampling of every face and edge and repeated zooming in on the best samples."""

    def __init__(self, solid, cells=160, edge_points=4000):
        self.faces, self.edges = brep.faces_of(solid), [e for e, _ in brep.edges_with_faces(solid)]
        self.samples = []
        for face in self.faces:
            u0, u1, v0, v1 = face.nurbs.domain
            u, v = np.meshgrid(np.linspace(u0, u1, cells), np.linspace(v0, v1, cells), indexing="ij")
            u, v = u.ravel(), v.ravel()
            keep = face.is_inside(u, v)
            u, v = u[keep], v[keep]
            step = (u1 - u0) / (cells - 1), (v1 - v0) / (cells - 1)
            self.samples.append((u, v, face.nurbs.derivatives(u, v)[:, 0], step))
        self.lines = [brep.edge_points(e, edge_points)[0] for e in self.edges]

    def tip(self, x, y, R, rc):
        best = -np.inf
        for face, (u, v, points, step) in zip(self.faces, self.samples):
            f = asked(points, x, y, R, rc)
            for k in self._starts(u, v, f, step, best):
                best = max(best, self._zoom(face, u[k], v[k], step, x, y, R, rc))
        for edge, points in zip(self.edges, self.lines):
            f = asked(points, x, y, R, rc)
            best = max(best, f.max(), self._zoom_edge(edge, len(points), f, best, x, y, R, rc))
        return best

    @staticmethod
    def _starts(u, v, f, step, best, count=5):
        order = np.argsort(-f)[:400]
        chosen = []
        for k in order[np.isfinite(f[order])]:
            if all(abs(u[k] - u[c]) > 4 * step[0] or abs(v[k] - v[c]) > 4 * step[1] for c in chosen):
                chosen.append(k)
            if len(chosen) == count:
                break
        return chosen

    @staticmethod
    def _zoom(face, u, v, step, x, y, R, rc):
        u0, u1, v0, v1 = face.nurbs.domain
        hu, hv = 1.6 * step[0], 1.6 * step[1]
        g = np.linspace(-1, 1, 13)
        top = -np.inf
        for _ in range(34):
            uu, vv = np.meshgrid(np.clip(u + hu * g, u0, u1), np.clip(v + hv * g, v0, v1), indexing="ij")
            uu, vv = uu.ravel(), vv.ravel()
            f = asked(face.nurbs.derivatives(uu, vv)[:, 0], x, y, R, rc)
            k = f.argmax()
            if f[k] > -np.inf:
                u, v, top = uu[k], vv[k], f[k]
            hu, hv = 0.6 * hu, 0.6 * hv
        return top if top > -np.inf and face.is_inside(np.array([u]), np.array([v]))[0] else -np.inf

    @staticmethod
    def _zoom_edge(edge, count, f, best, x, y, R, rc):
        if not np.isfinite(f).any():
            return -np.inf
        curve = BRepAdaptor_Curve(edge)
        t0, t1 = curve.FirstParameter(), curve.LastParameter()
        top = -np.inf
        peaks = np.flatnonzero((f >= np.r_[-np.inf, f[:-1]]) & (f >= np.r_[f[1:], -np.inf]) & np.isfinite(f))
        peaks = peaks[np.argsort(-f[peaks])][:3]
        for k in peaks:
            if f[k] < best - 0.05:
                continue
            t, h = t0 + (t1 - t0) * k / (count - 1), 1.5 * (t1 - t0) / (count - 1)
            for _ in range(22):
                tt = np.clip(np.linspace(t - h, t + h, 11), t0, t1)
                p = np.array([[q.X(), q.Y(), q.Z()] for q in (curve.Value(a) for a in tt.tolist())])
                g = asked(p, x, y, R, rc)
                t, h = tt[g.argmax()], 0.4 * h
                top = max(top, g.max())
        return top


def asked(points, x, y, R, rc):
    """(n,) tip heights that points ask for."""
    d = np.hypot(points[:, 0] - x, points[:, 1] - y)
    e = np.maximum(d - (R - rc), 0.0)
    return np.where(d <= R, points[:, 2] - (rc - np.sqrt(np.maximum(rc * rc - e * e, 0.0))), -np.inf)


def machined_block():
    """A block with islands, pockets, fillets, a through hole, sphere, cone, torus, knife edge and steep walls."""
    block = cq.Workplane("XY").box(60, 50, 12, centered=(True, True, False))
    block = block.faces(">Z").workplane().center(-18, 12).hole(9)
    boss = cq.Workplane("XY").workplane(offset=12).center(14, 12).circle(7).extrude(5)
    block = block.union(boss).edges(cq.selectors.BoxSelector((6, 4, 11.9), (22, 20, 12.1))).fillet(2.0)
    block = block.edges(cq.selectors.BoxSelector((6, 4, 16.9), (22, 20, 17.1))).fillet(1.5)
    cone = cq.Solid.makeCone(6, 1.5, 7, pnt=cq.Vector(-18, -12, 12), dir=cq.Vector(0, 0, -1))
    block = block.cut(cq.Workplane(obj=cone))
    pocket = cq.Workplane("XY").workplane(offset=12).center(4, -12).rect(16, 10).extrude(-5, taper=8)
    block = block.cut(pocket)
    dome = cq.Workplane("XY").sphere(6).translate((22, -14, 12))
    ring = cq.Workplane(obj=cq.Solid.makeTorus(8, 2, pnt=cq.Vector(-18, 12, 12)))
    knife = cq.Workplane("XZ").polyline([(-4, 12), (0, 16.5), (2, 12)]).close().extrude(8).translate((-4, 24, 0))
    return block.union(dome).union(ring).union(knife).val().wrapped
