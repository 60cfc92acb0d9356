"""Watertight triangles of a B-rep solid with a measured deviation.

OCCT's mesher misses the asked deflection up to threefold, so the deviation is measured against
the exact surfaces and the mesh refined until it holds.  Faces are welded along their common
edges by topology, never by distance.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.IMeshTools import IMeshTools_Parameters
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from cuspline.kernel.surface_places import surface_points, surface_tangents
from cuspline.values.arrays import frozen
from cuspline.values.errors import DesignError

ANGLE_RAD = 0.35          # largest turn of the normal along a triangle's side
POINT_MM = 1e-7           # a surface whose derivative is shorter has shrunk to a point there
SIDES = 0.49             # of the deviation, that sides inside a face may stray: no more than the mesher leaves
INSIDE = 4.0              # times the deflection of edges is asked for inside faces: halving sides is cheaper than meshing
ROUNDS = 4                # refinements before giving up
HALVINGS = 14             # of a side inside a face


@dataclass(frozen=True, eq=False, kw_only=True)
class FaceTriangles:
    """One face's triangles on its own parameters."""

    face: object              # TopoDS_Face that was meshed (a copy)
    uv: np.ndarray            # (n, 2)
    points_mm: np.ndarray     # (n, 3)
    triangles: np.ndarray     # (m, 3), counter-clockwise seen from outside the material


@dataclass(frozen=True, eq=False, kw_only=True)
class Tessellation:
    """A closed mesh of a solid and how far the B-rep's surfaces lie off it."""

    vertices_mm: np.ndarray   # (n, 3)
    triangles: np.ndarray     # (m, 3)
    face: np.ndarray          # (m,) face of each triangle, in the order of the solid's faces
    deviation_mm: float       # measured


def tessellate(solid, deviation_mm):
    """Closed mesh of a solid whose measured deviation is at most `deviation_mm`.

    Raises:
        DesignError: the mesher cannot reach it.
    """
    asked = 0.7 * deviation_mm
    for _ in range(ROUNDS):
        copy = BRepBuilderAPI_Copy(solid, True, False).Shape()
        faces = [_refined(f, SIDES * deviation_mm) for f in mesh_faces(copy, asked, INSIDE * asked)]
        measured = max(_deviation_mm(f) for f in faces)
        if measured <= deviation_mm:
            return _welded(faces, measured)
        asked *= max(0.35, 0.8 * deviation_mm / measured)
    raise DesignError(f"the mesher leaves {measured:.6f} mm where {deviation_mm:.6f} mm are requested: "
                      "heal the surface in the CAD program, or allow more in `finish`: the triangles follow its tolerances")


def mesh_faces(shape, deflection_mm, inside_mm=None, angle_rad=ANGLE_RAD):
    """FaceTriangles of every face of a shape, in order; the shape keeps the mesh (give a copy).

    Args:
        deflection_mm: asked for along edges.   inside_mm: and inside faces; None: the same.
    Raises:
        DesignError: a face without triangles.
    """
    asked = IMeshTools_Parameters()
    asked.Deflection, asked.DeflectionInterior = deflection_mm, deflection_mm if inside_mm is None else inside_mm
    asked.Angle, asked.Relative, asked.InParallel = angle_rad, False, False
    BRepMesh_IncrementalMesh(shape, asked)
    explorer, found = TopExp_Explorer(shape, TopAbs_FACE), []
    while explorer.More():
        found.append(_triangles_of(TopoDS.Face_s(explorer.Current()), len(found)))
        explorer.Next()
    return found


def _refined(part, side_mm):
    """Sides inside a face halved on the exact surface until each strays from it by less than `side_mm` in its middle.

    The mesher may leave long sides across a ruled face however finely it is asked.  Sides on the face's border,
    shared with the next face, stay.
    """
    if BRepAdaptor_Surface(part.face, False).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane:
        return part
    uv, points, triangles, free = part.uv, part.points_mm, part.triangles, free_parameters(part)
    fresh = np.ones(len(triangles), bool)
    for _ in range(HALVINGS):
        corner = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        sides, index, count = np.unique(corner.min(axis=1) * len(uv) + corner.max(axis=1), return_inverse=True,
                                        return_counts=True)
        index, is_fresh = index.reshape(-1, 3), np.zeros(len(sides), bool)
        is_fresh[index[fresh]] = True
        look = np.flatnonzero((count == 2) & is_fresh)
        a, b = sides[look] // len(uv), sides[look] % len(uv)
        ua, ub = np.where(free[a], uv[b], uv[a]), np.where(free[b], uv[a], uv[b])
        middle = (ua + ub) / 2
        exact, chord = surface_points(part.face, middle), points[b] - points[a]
        off = exact - (points[a] + points[b]) / 2
        along = np.einsum("ij,ij->i", off, chord) / np.maximum(np.einsum("ij,ij->i", chord, chord), 1e-300)
        far = np.linalg.norm(off - along[:, None] * chord, axis=1) > side_mm
        if not far.any():
            break
        node = np.full(len(sides), -1)
        node[look[far]] = len(uv) + np.arange(far.sum())
        uv, points = np.vstack([uv, middle[far]]), np.vstack([points, exact[far]])
        free = np.vstack([free, np.zeros((far.sum(), 2), bool)])
        triangles, fresh = _split(triangles, node[index])
    return FaceTriangles(face=part.face, uv=frozen(uv, (None, 2), "uv"), points_mm=frozen(points, (None, 3), "points_mm"),
                         triangles=frozen(triangles, (None, 3), "triangles", np.int64))


def _split(triangles, middle):
    """Triangles with a new node (or -1) on each side cut into two, three or four; and which of them are new."""
    # turned until a side with a node comes first, and of two or three the one without comes last
    has, turn = middle >= 0, np.zeros(len(triangles), int)
    for k in (2, 1, 0):
        turn[has[:, k] & ~has[:, k - 1]] = k
    order = (turn[:, None] + np.arange(3)) % 3
    t, m = np.take_along_axis(triangles, order, 1), np.take_along_axis(middle, order, 1)
    (a, b, c), (p, q, r), count = t.T, m.T, has.sum(axis=1)
    rows = lambda k, *corners: np.stack([corner[count == k] for corner in corners], axis=1)
    new = [rows(1, a, p, c), rows(1, p, b, c), rows(2, p, b, q), rows(2, a, p, q), rows(2, a, q, c),
           rows(3, a, p, r), rows(3, p, b, q), rows(3, r, q, c), rows(3, p, q, r)]
    joined = np.concatenate([triangles[count == 0], *new])
    return joined, np.arange(len(joined)) >= (count == 0).sum()


def _triangles_of(face, number):
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        raise DesignError(f"face {number} cannot be meshed: heal the solid", rows=[number])
    move, count = location.Transformation(), range(1, mesh.NbNodes() + 1)
    points = [mesh.Node(i).Transformed(move) for i in count]
    uv = [mesh.UVNode(i) for i in count]
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    if face.Orientation() == TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return FaceTriangles(face=face, uv=frozen([(p.X(), p.Y()) for p in uv], (None, 2), "uv"),
                         points_mm=frozen([(p.X(), p.Y(), p.Z()) for p in points], (None, 3), "points_mm"),
                         triangles=frozen(triangles, (None, 3), "triangles", np.int64))


def free_parameters(part):
    """(n, 2) bool: parameters that have no meaning at a node, u at the tip of a cone and the like."""
    explorer, has_point = TopExp_Explorer(part.face, TopAbs_EDGE), False
    while explorer.More() and not has_point:
        has_point = BRep_Tool.Degenerated_s(TopoDS.Edge_s(explorer.Current()))
        explorer.Next()
    if not has_point:
        return np.zeros(part.uv.shape, dtype=bool)
    _, du, dv = surface_tangents(part.face, part.uv)
    return np.column_stack([np.linalg.norm(d, axis=1) < POINT_MM for d in (du, dv)])


def corner_parameters(part):
    """(m, 3, 2) parameters at the corners of each triangle; a free one takes the mean of the other corners."""
    uv, free = part.uv[part.triangles].copy(), free_parameters(part)[part.triangles]
    others = (uv.sum(axis=1, keepdims=True) - uv) / 2
    return np.where(free, others, uv)


def _deviation_mm(part):
    """Largest distance of exact surface points (middles of sides and triangles) from their triangle's plane."""
    if BRepAdaptor_Surface(part.face, False).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane:
        return 0.0
    corners, uv = part.points_mm[part.triangles], corner_parameters(part)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    keep = length > 1e-12
    worst = 0.0
    for weights in ((1 / 3, 1 / 3, 1 / 3), (0.5, 0.5, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5)):
        exact = surface_points(part.face, np.einsum("k,mkc->mc", weights, uv[keep]))
        off = np.einsum("mc,mc->m", exact - corners[keep, 0], normal[keep]) / length[keep]
        worst = max(worst, float(np.abs(off).max(initial=0.0)))
    return worst


def _welded(faces, measured):
    base = np.cumsum([0] + [len(f.uv) for f in faces])
    parent = np.arange(base[-1])
    edges = TopTools_IndexedMapOfShape()
    chains = {}
    for k, part in enumerate(faces):
        for key, nodes, is_point in _edge_nodes(part, edges):
            nodes = nodes + base[k]
            other = np.full(len(nodes), nodes[0]) if is_point else chains.setdefault(key, nodes)
            if len(other) != len(nodes):
                raise DesignError(f"an edge of face {k} is meshed differently on its two sides", rows=[k])
            for a, b in zip(nodes, other):
                parent[_root(parent, a)] = _root(parent, b)
    root = np.array([_root(parent, i) for i in range(len(parent))])
    used, index = np.unique(root, return_inverse=True)
    triangles = np.concatenate([index[f.triangles + b] for f, b in zip(faces, base)])
    owner = np.repeat(np.arange(len(faces)), [len(f.triangles) for f in faces])
    whole = ((triangles[:, 0] != triangles[:, 1]) & (triangles[:, 1] != triangles[:, 2])
             & (triangles[:, 2] != triangles[:, 0]))
    points = np.concatenate([f.points_mm for f in faces])[used]
    return Tessellation(vertices_mm=frozen(points, (None, 3), "vertices_mm"),
                        triangles=frozen(triangles[whole], (None, 3), "triangles", np.int64),
                        face=frozen(owner[whole], (None,), "face", np.int64), deviation_mm=measured)


def _edge_nodes(part, edges):
    """(edge number, node indices along it, whether it is a single point) of a face's edges; seams come twice."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(part.face, location)
    explorer = TopExp_Explorer(part.face, TopAbs_EDGE)
    while explorer.More():
        edge = TopoDS.Edge_s(explorer.Current())
        polygon = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, location)
        if polygon is not None:
            nodes = np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)]) - 1
            yield edges.Add(edge), nodes, BRep_Tool.Degenerated_s(edge)
        explorer.Next()


def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i
