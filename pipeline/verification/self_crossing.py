"""Whether a solid crosses itself, asked of the B-rep as it was read back; BRepCheck does not look for that.

Three questions, none of which knows how the solid was built:
- does the surface of any face turn over (folds: Su x Sv changes sign)?
- do any two places of the border cross?  Facets that cross are only a hint, because facets of thin edges do so where
  the surfaces do not: the exact surfaces must meet there in one point, inside both faces, at an angle.
- do rays find the material on the inner side of the faces alone, once?
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_IN, TopAbs_VERTEX
from OCP.TopoDS import TopoDS

from cuspline.kernel import brep
from cuspline.kernel.surface_places import FaceSurface
from cuspline.stock.tree import halved_order
from cuspline.surfaces.folds import folds_of
from cuspline.values.errors import DesignError
from cuspline.verification.crossing_kernels import LEAF, boxes_of, crossing_pairs, enclosures, levels_over, tree_over

PAIRS = 20000           # of crossing facets looked for at most
LOOKED_AT = 240         # of them, spread over all, on the exact surfaces
STEPS = 14              # of Newton's way to a common point
TOGETHER_MM = 1e-6      # how near two surfaces must come to be in one point
APART_MM = 0.01         # along a face, two places nearer than this are one
LEAST_SINE = 0.01       # of the angle between surfaces that cross; below, they touch
BORDER_MM = 1e-3        # from a common border: closer, they may meet
RAYS = 24               # places from which rays are sent, on either side
ASIDE = 1e-6            # of a facet's size: how far beside it they start
TRIM = 1e-9             # of the kernel's parameters
WAYS = np.array([[0.5377, 0.6229, 0.5682], [-0.8513, 0.3119, 0.4219], [0.1297, -0.7603, 0.6364]])   # of the rays


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """One place where a solid crosses itself."""

    what: str                               # in words, the faces' names in it
    place_mm: tuple[float, float, float]


def self_crossings(solid, mesh):
    """Where a solid crosses itself, one Crossing a face or pair of faces.

    Args:
        solid: as read back from its file.
        mesh: its facets: vertices_mm (n, 3), the same to the bit where faces join; uv (n, 2) and face_index (n,) of
            each vertex; triangles (m, 3) counter-clockwise seen from outside.
    """
    faces = brep.faces_of(solid)
    names = [f"face {k + 1} ({f.kind})" if not f.mark.name else f"{f.mark.name!r}" for k, f in enumerate(faces)]
    found = []
    for face, name in zip(faces, names):
        places = folds_of(face)
        if len(places):
            found.append(Crossing(what=f"the surface of {name} turns over", place_mm=_middle(places)))
    return (*found, *_crossing_faces(faces, names, mesh), *_wrongly_enclosed(names, mesh))


def refuse_self_crossing(solid, mesh, name):
    """Raise DesignError where a solid crosses itself; says where."""
    found = self_crossings(solid, mesh)
    if found:
        told = "; ".join(f"{c.what} at ({', '.join(f'{x:.3f}' for x in c.place_mm)})" for c in found[:4])
        more = f", and {len(found) - 4} more" if len(found) > 4 else ""
        raise DesignError(f"{name} crosses itself, it bounds no solid: {told}{more}; change the shape there, most "
                          "often a radius too large for the place, or a wall too thin")


def _middle(places):
    """The place that lies nearest to the middle of all."""
    row = np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1))
    return tuple(float(x) for x in places[row].round(4))


# faces that cross ------------------------------------------------------------------------------


def _crossing_faces(faces, names, mesh):
    triangles, corners, ids = _in_order(mesh)
    boxes = boxes_of(corners)
    pairs, places = crossing_pairs(corners, ids, boxes, tree_over(boxes, levels_over(len(corners))), PAIRS)
    rows = np.unique(np.linspace(0, len(pairs) - 1, min(len(pairs), LOOKED_AT)).astype(int)) if len(pairs) else []
    at, surface_of = {}, cache(lambda k: FaceSurface(faces[k].shape))
    for (i, j), place in zip(pairs[rows], places[rows]):
        key = tuple(sorted(int(mesh.face_index[triangles[k, 0]]) for k in (i, j)))
        if len(at.get(key, ())) < 3:
            met = _common_point(faces, surface_of, mesh, triangles[[i, j]], place)
            if met is not None:
                at.setdefault(key, []).append(met)
    say = lambda a, b: f"{names[a]} crosses itself" if a == b else f"{names[a]} and {names[b]} cross"
    return [Crossing(what=say(*key), place_mm=_middle(np.array(met))) for key, met in sorted(at.items())]


def _in_order(mesh):
    """Triangles (m, 3) in the order of the tree over them, their corners (m, 3, 3), and ids of their places (m, 3)."""
    points = np.asarray(mesh.vertices_mm)
    order = np.lexsort(points.T)
    new = np.r_[True, (points[order][1:] != points[order][:-1]).any(axis=1)]
    same = np.empty(len(points), np.int64)
    same[order] = np.cumsum(new) - 1
    ids = same[mesh.triangles]
    whole = (ids[:, 0] != ids[:, 1]) & (ids[:, 1] != ids[:, 2]) & (ids[:, 2] != ids[:, 0])
    triangles = mesh.triangles[whole]
    along = halved_order(points[triangles].mean(axis=1), LEAF)
    triangles = triangles[along]
    return triangles, np.ascontiguousarray(points[triangles]), np.ascontiguousarray(same[triangles])


def _common_point(faces, surface_of, mesh, two, place):
    """(3,) point in which the exact surfaces of two facets cross, near a place of both; None: they do not."""
    owner = [int(mesh.face_index[t[0]]) for t in two]
    shapes, surfaces = [faces[k].shape for k in owner], [surface_of(k) for k in owner]
    uv = [_parameters_at(mesh, t, place) for t in two]
    for _ in range(STEPS):
        (p, pu, pv), (q, qu, qv) = ([a[0] for a in s.tangents(at)] for s, at in zip(surfaces, uv))
        gap = p - q
        if _dot(gap, gap) < TOGETHER_MM ** 2 / 100:
            break
        sizes = [max(float(np.sqrt(_dot(t, t))), 1e-9) for t in (pu, pv, qu, qv)]
        ways = np.stack([pu / sizes[0], pv / sizes[1], -qu / sizes[2], -qv / sizes[3]], axis=1)
        step = -_dot(ways.T, _solved(_dot(ways[:, None], ways[None]) + 1e-12 * np.eye(3), gap)) / sizes
        uv = [uv[0] + step[:2], uv[1] + step[2:]]
    if not _dot(gap, gap) < TOGETHER_MM ** 2 or not all(_is_inside(s, at) for s, at in zip(shapes, uv)):
        return None
    normals = [np.cross(pu, pv), np.cross(qu, qv)]
    turned = np.cross(*normals)
    if not _dot(turned, turned) > LEAST_SINE ** 2 * _dot(normals[0], normals[0]) * _dot(normals[1], normals[1]):
        return None
    if owner[0] == owner[1]:
        way = surfaces[0].points(np.linspace(*uv, 9))
        return p if np.linalg.norm(np.diff(way, axis=0), axis=1).sum() > APART_MM else None
    return None if _is_at_common_border(*shapes, p) else p


def _parameters_at(mesh, triangle, place):
    """(2,) parameters of a facet at a place of it."""
    a, b, c = mesh.vertices_mm[triangle]
    e, f, g = b - a, c - a, place - a
    ee, ef, ff, eg, fg = _dot(e, e), _dot(e, f), _dot(f, f), _dot(e, g), _dot(f, g)
    det = ee * ff - ef * ef
    s, t = ((ff * eg - ef * fg) / det, (ee * fg - ef * eg) / det) if det > 0 else (1 / 3, 1 / 3)
    u, v, w = mesh.uv[triangle]
    return u + s * (v - u) + t * (w - u)


def _solved(a, b):
    """Solution of three equations by Cramer's rule."""
    x, y, z = np.cross(a[1], a[2]), np.cross(a[2], a[0]), np.cross(a[0], a[1])
    return (x * b[0] + y * b[1] + z * b[2]) / _dot(a[0], x)


def _dot(a, b):
    return np.einsum("...k,...k->...", a, b)


def _is_inside(face, uv):
    return BRepTopAdaptor_FClass2d(face, TRIM).Perform(gp_Pnt2d(float(uv[0]), float(uv[1])), False) == TopAbs_IN


def _is_at_common_border(a, b, point):
    """Whether two faces have an edge or a vertex in common near a point."""
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*map(float, point))).Vertex()
    for kind, cast in ((TopAbs_EDGE, TopoDS.Edge_s), (TopAbs_VERTEX, TopoDS.Vertex_s)):
        own = brep.explore(a, kind)
        for other in brep.explore(b, kind):
            if any(other.IsSame(o) for o in own):
                near = BORDER_MM + 4 * BRep_Tool.Tolerance_s(cast(other))
                if BRepExtrema_DistShapeShape(vertex, other).Value() < near:
                    return True
    return False


# rays ------------------------------------------------------------------------------------------


def _wrongly_enclosed(names, mesh):
    """From large facets, rays of either side must find: outside no material, inside one layer of it."""
    corners = mesh.vertices_mm[mesh.triangles]
    square = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.sqrt(np.einsum("ij,ij->i", square, square))
    owner = mesh.face_index[mesh.triangles[:, 0]]
    order = np.argsort(-size, kind="stable")
    rows = order[np.sort(np.unique(owner[order], return_index=True)[1])][:RAYS]       # the largest of each face
    rows = rows[size[rows] > 0]
    aside = ASIDE * square[rows] / np.sqrt(size[rows])[:, None]
    middle = corners[rows].mean(axis=1)
    corners = np.ascontiguousarray(corners)
    out, within = (_enclosures(middle + s * aside, corners, wanted) for s, wanted in ((1, 0), (-1, 1)))
    return [Crossing(what=f"beside {names[owner[row]]} there is material {int(a)} times outside and {int(b)} times "
                          "inside", place_mm=tuple(float(x) for x in place.round(4)))
            for row, place, a, b in zip(rows, middle, out, within) if (a, b) != (0, 1)]


def _enclosures(points, corners, wanted):
    """(n,) how often points are enclosed; where it is not as wanted, what most of three rays say."""
    count = enclosures(points, WAYS[0], corners)
    rows = np.flatnonzero(count != wanted)
    others = [enclosures(points[rows], way, corners) for way in WAYS[1:]]
    count[rows] = np.median([count[rows], *others], axis=0)
    return count
