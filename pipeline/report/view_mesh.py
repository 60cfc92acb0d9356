"""Tessellation for pictures: one patch of vertices per B-rep face, the surface's own normals, the edges.

Vertices are never shared between faces: a shared vertex smears the shading over a sharp edge.
"""

from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepLib import BRepLib_ToolTriangulatedShape
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GCPnts import GCPnts_TangentialDeflection
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from cuspline.errors import DesignError

ANGLE_RAD = 0.15        # largest turn between neighbouring facets: 42 facets round a full circle


class ViewMesh(NamedTuple):
    """What is drawn of a solid, part coordinates."""

    vertices_mm: np.ndarray                 # (n, 3)
    normals: np.ndarray                     # (n, 3) unit, out of the material
    triangles: np.ndarray                   # (m, 3) counter-clockwise seen from the air
    edges_mm: tuple[np.ndarray, ...]        # B-rep edges as polylines (k, 3)
    face_index: np.ndarray                  # (n,) which face, in OCP's own order, a vertex lies on


def tessellate_for_view(solid, deflection_mm):
    """Facets and edges of a solid as a picture needs them.

    Args:
        solid: OCP TopoDS_Shape, millimetres; it is not changed (the mesh goes onto a copy).
        deflection_mm: largest distance between facet and surface, scalar > 0.
    Returns:
        ViewMesh.
    Raises:
        DesignError: the shape has no face, or a face could not be tessellated.
    """
    # copied without its mesh: a mesh left by someone else would be reused whatever its deflection
    shape = BRepBuilderAPI_Copy(solid, False, False).Shape()
    BRepMesh_IncrementalMesh(shape, deflection_mm, False, ANGLE_RAD, False)
    patches = [_face_patch(TopoDS.Face_s(f), row) for row, f in enumerate(_parts_of(shape, TopAbs_FACE))]
    if not patches:
        raise DesignError("the shape has no face: there is nothing to draw")
    counts = [len(vertices) for vertices, _, _ in patches]
    offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return ViewMesh(
        vertices_mm=np.vstack([vertices for vertices, _, _ in patches]),
        normals=np.vstack([normals for _, normals, _ in patches]),
        triangles=np.vstack([triangles + o for (_, _, triangles), o in zip(patches, offsets)]),
        edges_mm=tuple(_edge_polyline(e, deflection_mm) for e in map(TopoDS.Edge_s, _parts_of(shape, TopAbs_EDGE))
                       if not BRep_Tool.Degenerated_s(e)),
        face_index=np.repeat(np.arange(len(patches)), counts))


def _parts_of(shape, kind):
    """Every face or edge once, in OCP's own order."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


def _face_patch(face, row):
    """(vertices, normals, triangles) of one face, turned so that normals leave the material."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        raise DesignError(f"face {row} could not be tessellated; check the solid with OCP's BRepCheck_Analyzer",
                          rows=[row])
    BRepLib_ToolTriangulatedShape.ComputeNormals_s(face, mesh)
    move = location.Transformation()
    nodes = [mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1)]
    directions = [mesh.Normal(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1)]
    vertices = np.array([(p.X(), p.Y(), p.Z()) for p in nodes])
    normals = np.array([(d.X(), d.Y(), d.Z()) for d in directions])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    if face.Orientation() == TopAbs_REVERSED:
        return vertices, -normals, triangles[:, ::-1]
    return vertices, normals, triangles


def _edge_polyline(edge, deflection_mm):
    """(k, 3) points along an edge."""
    points = GCPnts_TangentialDeflection(BRepAdaptor_Curve(edge), ANGLE_RAD, deflection_mm)
    return np.array([(p.X(), p.Y(), p.Z()) for p in map(points.Value, range(1, points.NbPoints() + 1))])
