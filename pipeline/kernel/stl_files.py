"""STL files: triangles of a mesh in, each place once, binary or text; out as binary; millimetres."""

import re
from pathlib import Path

import numpy as np

from cuspline.values.errors import InputError

LARGEST_BYTES = 256 << 20
HEAD_BYTES, ROW = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
CORNER = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path):
    """(vertices (v, 3), triangles (t, 3)) of an STL file; triangles that have shrunk to a line are left out.

    Raises:
        InputError: it is missing, too large, or no STL file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"STL file {path} does not exist")
    if path.stat().st_size > LARGEST_BYTES:
        raise InputError(f"STL file {path} is larger than {LARGEST_BYTES >> 20} MiB: reduce the mesh")
    corners = _corners(path.read_bytes())
    if corners is None or not len(corners) or not np.isfinite(corners).all():
        raise InputError(f"{path} is not a readable STL file: export it anew")
    vertices, rows = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    triangles = rows.reshape(-1, 3)
    a, b, c = triangles.T
    return vertices, triangles[(a != b) & (b != c) & (c != a)]


def _corners(content):
    """(t, 3, 3) corners; None where the bytes are no STL."""
    if len(content) >= HEAD_BYTES:
        count = int(np.frombuffer(content[80:HEAD_BYTES], "<u4")[0])
        if len(content) == HEAD_BYTES + count * ROW.itemsize:
            return np.frombuffer(content[HEAD_BYTES:], ROW)["corners"].astype(float)
    found = CORNER.findall(content) if content.lstrip().startswith(b"solid") else []
    try:
        return np.array(found, dtype="S32").astype(float).reshape(-1, 3, 3) if found else None
    except ValueError:
        return None


def stl_of_corners(corners_mm):
    """Binary STL (bytes) of triangles (t, 3, 3)."""
    normal = np.cross(corners_mm[:, 1] - corners_mm[:, 0], corners_mm[:, 2] - corners_mm[:, 0])
    rows = np.zeros(len(corners_mm), ROW)
    rows["normal"] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    rows["corners"] = corners_mm
    return b"binary STL, millimetres".ljust(80) + np.uint32(len(rows)).astype("<u4").tobytes() + rows.tobytes()


def face_of_stl(path):
    """TopoDS_Face that is the triangles of an STL file and no more: something for a viewer to show.

    Raises:
        InputError: it is no STL file.
    """
    from OCP.BRep import BRep_Builder
    from OCP.RWStl import RWStl
    from OCP.TopoDS import TopoDS_Face
    triangles, face = RWStl.ReadFile_s(str(path)), TopoDS_Face()
    if triangles is None or not triangles.NbTriangles():
        raise InputError(f"{path} is not a readable STL file: build the part again")
    BRep_Builder().MakeFace(face, triangles)
    return face
