"""Tessellation for pictures: one patch of vertices per B-rep face, the surface's own normals, the edges.

Vertices are never shared between faces: a shared vertex smears the shading over a sharp edge.
"""

from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepLib import BRepLib_ToolTriangulatedShape
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GCPnts import GCPnts_TangentialDeflection
from OCP.GeomAbs import GeomAbs_Plane
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from cuspline.kernel.topology import explore
from cuspline.values.errors import DesignError

ANGLE_RAD = 0.15        # largest turn between neighbouring facets: 42 facets round a full circle


class ViewMesh(NamedTuple):
    """What is drawn of a solid, part coordinates."""

    vertices_mm: np.ndarray                 # (n, 3)
    normals: np.ndarray                     # (n, 3) unit, out of the material
    triangles: np.ndarray                   # (m, 3) counter-clockwise seen from the air
    edges_mm: tuple[np.ndarray, ...]        # B-rep edges as polylines (k, 3)
    face_index: np.ndarray                  # (n,) which face, in OCP's own order, a vertex lies on
    uv: np.ndarray                          # (n, 2) parameters of a vertex on its face


def tessellate_for_view(solid, deflection_mm, longest_edge_mm=None, angle_rad=ANGLE_RAD):
    """Facets and edges of a solid as a picture needs them.

    Args:
        solid: OCP TopoDS_Shape, millimetres; it is not changed (the mesh goes onto a copy).
        deflection_mm: largest distance between facet and surface, scalar > 0.
        longest_edge_mm: facets are divided until no edge is longer; a map of deviations needs
            vertices on flat faces too. None: facets as large as the deflection allows.
        angle_rad: largest turn between neighbouring facets.
    Returns:
        ViewMesh; its vertices and normals are the exact surface's.
    Raises:
        DesignError: the shape has no face, or a face could not be tessellated.
    """
    # copied without its mesh: a mesh left by someone else would be reused whatever its deflection
    shape = BRepBuilderAPI_Copy(solid, False, False).Shape()
    BRepMesh_IncrementalMesh(shape, deflection_mm, False, angle_rad, False)
    patches = [_face_patch(TopoDS.Face_s(f), row) for row, f in enumerate(explore(shape, TopAbs_FACE))]
    if not patches:
        raise DesignError("the shape has no face: there is nothing to draw")
    mesh = _joined(patches, tuple(_edge_polyline(e, deflection_mm) for e in map(TopoDS.Edge_s, explore(shape, TopAbs_EDGE))
                                  if not BRep_Tool.Degenerated_s(e)))
    return mesh if longest_edge_mm is None else divided(mesh, solid, longest_edge_mm)


def divided(mesh, solid, longest_edge_mm):
    """The ViewMesh of a solid, its facets divided until no edge is longer: see `tessellate_for_view`."""
    faces = [TopoDS.Face_s(f) for f in explore(solid, TopAbs_FACE)]
    first = np.searchsorted(mesh.face_index, np.arange(len(faces) + 1))
    face_of = mesh.face_index[mesh.triangles[:, 0]]
    patches = [_divided(BRepAdaptor_Surface(face), mesh.vertices_mm[i:j], mesh.normals[i:j], mesh.triangles[face_of == k] - i,
                        mesh.uv[i:j], longest_edge_mm) for k, (face, i, j) in enumerate(zip(faces, first, first[1:]))]
    return _joined(patches, mesh.edges_mm)


def _joined(patches, edges_mm):
    """ViewMesh of (vertices, normals, triangles, parameters) of each face."""
    counts = [len(vertices) for vertices, *_ in patches]
    offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return ViewMesh(
        vertices_mm=np.vstack([vertices for vertices, *_ in patches]),
        normals=np.vstack([normals for _, normals, *_ in patches]),
        triangles=np.vstack([triangles + o for (_, _, triangles, _), o in zip(patches, offsets)]),
        edges_mm=edges_mm, face_index=np.repeat(np.arange(len(patches)), counts), uv=np.vstack([uv for *_, uv in patches]))


def _face_patch(face, row):
    """(vertices, normals, triangles, parameters) of one face, turned so that normals leave the material."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        raise DesignError(f"face {row} could not be tessellated; check the solid with OCP's BRepCheck_Analyzer",
                          rows=[row])
    BRepLib_ToolTriangulatedShape.ComputeNormals_s(face, mesh)
    move, nodes = location.Transformation(), range(1, mesh.NbNodes() + 1)
    vertices = np.array([_triple(mesh.Node(i).Transformed(move)) for i in nodes])
    normals = np.array([_triple(mesh.Normal(i).Transformed(move)) for i in nodes])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    uv = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, nodes)])
    if face.Orientation() == TopAbs_REVERSED:
        return vertices, -normals, triangles[:, ::-1], uv
    return vertices, normals, triangles, uv


def _triple(vector):
    return vector.X(), vector.Y(), vector.Z()


def _divided(surface, vertices, normals, triangles, uv, longest_edge_mm):
    """Facets of one face divided at the middle (in u, v) of every edge that is too long, until none is.

    The length alone decides, so both facets at an edge divide it alike and no gap opens.
    """
    for _ in range(16):                     # each round halves the edges: 16 go from 1 m below 0.02 mm
        sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        keys, side_edge = np.unique(sides[:, 0] * len(vertices) + sides[:, 1], return_inverse=True)
        edges = np.column_stack([keys // len(vertices), keys % len(vertices)])
        length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        is_long = length > longest_edge_mm
        if not is_long.any():
            break
        middle_uv = uv[edges[is_long]].mean(axis=1)
        points, directions = _middles(surface, middle_uv, vertices[edges[is_long]], normals[edges[is_long]])
        middle = np.full(len(edges), -1)
        middle[is_long] = len(vertices) + np.arange(is_long.sum())
        vertices, normals = np.vstack([vertices, points]), np.vstack([normals, directions])
        uv = np.vstack([uv, middle_uv])
        triangles = _split(triangles, middle[side_edge.reshape(-1, 3)])
    return vertices, normals, triangles, uv


def _split(triangles, middle):
    """Triangles divided at the middles of their sides (m, 3), -1: a side that stays whole.

    Every triangle is turned so that its sides are divided in the order first, then second.
    """
    count = (middle >= 0).sum(axis=1)
    # one long side goes first; with two, the whole side goes last
    first = np.where(count == 1, (middle >= 0).argmax(axis=1), np.where(count == 2, ((middle < 0).argmax(axis=1) + 1) % 3, 0))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T
    rows = lambda wanted, *corners: np.column_stack(corners)[count == wanted]
    return np.vstack([
        triangles[count == 0],
        rows(1, a, ab, c), rows(1, ab, b, c),
        rows(2, ab, b, bc), rows(2, a, ab, bc), rows(2, a, bc, c),
        rows(3, a, ab, ca), rows(3, ab, b, bc), rows(3, ca, bc, c), rows(3, ab, bc, ca)])


def _middles(surface, uv, ends, normals):
    """Points and unit normals of the surface half-way along edges (n, 2, 3)."""
    if surface.GetType() == GeomAbs_Plane:
        return ends.mean(axis=1), normals[:, 0]             # exact, and a hundred times faster
    return _on_surface(surface, uv, normals.sum(axis=1))


def _on_surface(surface, uv, about):
    """Points and unit normals of the surface at (n, 2) parameters, on the side of `about` (n, 3)."""
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    points, normals = np.empty((len(uv), 3)), np.empty((len(uv), 3))
    for row, (u, v) in enumerate(uv):
        surface.D1(u, v, point, along_u, along_v)
        points[row], normals[row] = _triple(point), _triple(along_u.Crossed(along_v))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-12, normals, about)      # a pole has no normal of its own
    normals *= np.where(np.einsum("ij,ij->i", normals, about) < 0, -1.0, 1.0)[:, None]
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _edge_polyline(edge, deflection_mm):
    """(k, 3) points along an edge."""
    points = GCPnts_TangentialDeflection(BRepAdaptor_Curve(edge), ANGLE_RAD, deflection_mm)
    return np.array([_triple(p) for p in map(points.Value, range(1, points.NbPoints() + 1))])
