"""How well a solid is closed: the gaps between its faces as measured, and vertices put where their edges meet.

A tolerance in a file is a claim, often a loose one.  What counts is how far two faces are apart along the edge that
they share, each followed by its own curve.  A vertex beside its edges, as programs leave it that round their files, is
no gap: it is put back, its edges begin and end there, and all tolerances are measured anew.
"""

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepLib import BRepLib
from OCP.gp import gp_Pnt, gp_Vec
from OCP.ShapeFix import ShapeFix_Edge, ShapeFix_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_VERTEX
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from cuspline.kernel.topology import explore
from cuspline.values import fixed_math as fixed

TIGHTEST_MM = 1e-7          # the kernel's own confusion
LOOKS = 49                  # places along an edge at which its faces are compared
VERTEX_MM = (1e-7, 1e-5, 1e-4, 5e-4)     # how far round a vertex its edges may cross: the least with which the solid is valid
STEPS = 6                   # of Newton's search for the place on a curve next to a point
PULL = 1e-3                 # of the ends as they are, on a vertex that its edges leave free to slide


def widest_gap(solid):
    """(mm, place (3,)) of the largest distance between two faces along an edge they share, each followed by its own curve."""
    sides, edges = {}, TopTools_IndexedMapOfShape()
    for face in explore(solid, TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face_s(face), False)
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            if not BRep_Tool.Degenerated_s(edge):
                sides.setdefault(edges.Add(edge), []).append(_along(edge, TopoDS.Face_s(face), surface))
            explorer.Next()
    widest, place = 0.0, np.zeros(3)
    for first, *others in sides.values():
        for other in others:
            apart = np.sqrt(((first - other) ** 2).sum(axis=1))
            if apart.max() > widest:
                widest, place = float(apart.max()), first[apart.argmax()]
    return widest, place


def _along(edge, face, surface):
    """(LOOKS, 3) points of a face along an edge, by the edge's curve in the face's parameters."""
    curve, out, point = BRepAdaptor_Curve2d(edge, face), np.empty((LOOKS, 3)), gp_Pnt()
    for k, t in enumerate(np.linspace(curve.FirstParameter(), curve.LastParameter(), LOOKS).tolist()):
        place = curve.Value(t)
        surface.D0(place.X(), place.Y(), point)
        out[k] = point.Coord()
    return out


def healed(solid):
    """A copy whose vertices lie where their edges meet and whose tolerances are measured; itself where that fails."""
    copy = TopoDS.Solid_s(BRepBuilderAPI_Copy(solid, True, False).Shape())
    edges = [e for e in map(TopoDS.Edge_s, explore(copy, TopAbs_EDGE)) if not BRep_Tool.Degenerated_s(e)]
    places = _meeting_places(edges)
    ShapeFix_ShapeTolerance().SetTolerance(copy, TIGHTEST_MM)
    for vertex, point in places.values():
        BRep_Builder().UpdateVertex(vertex, gp_Pnt(*point.tolist()), TIGHTEST_MM)
    for edge in edges:
        _retrim(edge, places)
    for face in map(TopoDS.Face_s, explore(copy, TopAbs_FACE)):
        _renew_short_curves(face)
    BRepLib.SameParameter_s(copy, TIGHTEST_MM, True)
    BRepLib.UpdateTolerances_s(copy, False)
    for least in VERTEX_MM:
        ShapeFix_ShapeTolerance().LimitTolerance(copy, least, 0.0, TopAbs_VERTEX)
        if BRepCheck_Analyzer(copy).IsValid():
            return copy
    return solid


def _meeting_places(edges):
    """{vertex's key: (vertex, (3,) the point nearest to the curves of the edges that end there)}."""
    ends = {}
    for edge in edges:
        curve = BRepAdaptor_Curve(edge)
        for vertex, t in ((TopExp.FirstVertex_s(edge), curve.FirstParameter()), (TopExp.LastVertex_s(edge), curve.LastParameter())):
            ends.setdefault(vertex.TShape(), (TopoDS.Vertex_s(vertex.Oriented(TopAbs_FORWARD)), []))[1].append(_at(curve, t))
    return {key: (vertex, _nearest_to_lines(rows)) for key, (vertex, rows) in ends.items()}


def _nearest_to_lines(rows):
    """(3,) point with the least sum of squared distances from the lines (point, direction); free ways stay in the middle."""
    points = np.array([p for p, _ in rows])
    ways = np.array([d / fixed.length(d) for _, d in rows])
    across = np.eye(3) - ways[:, :, None] * ways[:, None, :] + PULL * np.eye(3)
    return fixed.solve(across.sum(axis=0), (across * points[:, None, :]).sum(axis=(0, 2)))


def _retrim(edge, places):
    """Let an edge begin and end where its vertices lie, as far as its curves go."""
    first, last = TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)
    if first.IsSame(last):
        return
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    adaptor = BRepAdaptor_Curve(edge)
    low, high = adaptor.FirstParameter(), adaptor.LastParameter()
    is_endless = curve.IsPeriodic() or curve.FirstParameter() < -1e99
    span = (-np.inf, np.inf) if is_endless else (low, high)
    t = [float(np.clip(_foot(adaptor, places[v.TShape()][1], start), *span)) for v, start in ((first, low), (last, high))]
    if t[0] < t[1]:
        BRep_Builder().Range(edge, *t)


def _renew_short_curves(face):
    """Project anew the edges whose curve in the face's parameters is shorter than they are now."""
    for edge in map(TopoDS.Edge_s, explore(face, TopAbs_EDGE)):
        if BRep_Tool.Degenerated_s(edge) or BRep_Tool.IsClosed_s(edge, face):
            continue
        flat = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
        low, high = BRep_Tool.Range_s(edge)
        if not flat.IsPeriodic() and (flat.FirstParameter() > low or flat.LastParameter() < high):
            ShapeFix_Edge().FixRemovePCurve(edge, face)
            ShapeFix_Edge().FixAddPCurve(edge, face, False)


def _foot(curve, point, t):
    """Parameter of the place on a curve next to a point, from one nearby."""
    for _ in range(STEPS):
        here, way = _at(curve, t)
        t += float(((point - here) * way).sum() / (way * way).sum())
    return t


def _at(curve, t):
    point, way = gp_Pnt(), gp_Vec()
    curve.D1(float(t), point, way)
    return np.array(point.Coord()), np.array(way.Coord())
