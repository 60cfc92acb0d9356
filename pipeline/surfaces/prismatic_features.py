r"""Prismatic features among the faces of a solid: pockets, open pockets, steps, bosses, chamfers.

     ____      ____          floor of a pocket: a plane all round whose outer border walls rise, square to it
         |    |  __          open: walls that face each other, and a side without one; step: neither
         |____| |  | boss    top of a boss: walls fall all round and stand on a plane that looks the same way
                             chamfer: a narrow plane or cone that eases an edge
"""

import math
from dataclasses import dataclass

import numpy as np
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer

from cuspline.kernel.brep import edge_points
from cuspline.surfaces.holes import holes_of
from cuspline.surfaces.inner_corners import edge_pairs, edge_sines

KINDS = ("pocket", "boss", "open pocket", "step", "chamfer")
SQUARE = 1e-6               # of unit normals that are square to each other, or the same
SMOOTH_SINE = 1e-3          # edges flatter than this are none
FACING = -0.5               # cosine between walls that face each other
EASED = (0.3, 0.97)         # cosines between a chamfer and what it lies between
WIDEST_MM = 4.0             # wider strips are faces
NARROW = 0.5                # of its length, that a chamfer's width is no more than
PLACES = 9                  # along an edge


@dataclass(frozen=True, eq=False, kw_only=True)
class Feature:
    """Faces that belong together."""

    kind: str                   # one of KINDS
    faces: tuple[int, ...]      # indices of all, the floor or top first
    axis: np.ndarray            # (3,) unit, out of the floor, the top, the chamfer
    size_mm: float              # depth, height; width of a chamfer


@dataclass(frozen=True, eq=False, kw_only=True)
class Neighbour:
    """A face beyond one edge of another."""

    index: int
    edge: object                # TopoDS_Edge
    sine: float                 # of the turn from face to face: above 0 in a hollow
    cosine: float


def features_of(faces):
    """Features of a solid, in the order of their first faces; holes are left to holes_of.

    Args:
        faces: all brep.Face values.
    """
    around, in_holes = neighbours_of(faces), {k for h in holes_of(faces) for k in (*h.faces, *h.floor)}
    found = []
    for k, face in enumerate(faces):
        if k in in_holes:
            continue
        feature = _on_plane(faces, k, around, in_holes) if face.kind == "plane" else None
        feature = feature or (_chamfer(face, k, around[k]) if face.kind in ("plane", "cone") else None)
        found += [feature] if feature is not None else []
    return tuple(sorted(_without_walls(found), key=lambda f: f.faces[0]))


def _without_walls(found):
    """Features but for those whose floor is a wall of another: pockets before steps, shallow before deep."""
    taken, kept = set(), []
    for feature in sorted(found, key=lambda f: (KINDS.index(f.kind), round(f.size_mm, 6), f.faces[0])):
        if feature.faces[0] not in taken:
            kept.append(feature)
            taken.update(feature.faces)
    return kept


def neighbours_of(faces):
    """[[Neighbour]] of every brep.Face of a solid."""
    around = [[] for _ in faces]
    for pair in edge_pairs(faces):
        sines, cosines, _, _ = edge_sines(faces, pair)
        middle = len(sines) // 2
        for (i, edge), (j, _) in (pair, pair[::-1]):
            if i != j:
                around[i].append(Neighbour(index=j, edge=edge, sine=float(sines[middle]), cosine=float(cosines[middle])))
    return around


def _on_plane(faces, k, around, in_holes):
    """The feature whose floor or top a plane is, or None."""
    outer = _outer_edges(faces[k])
    border = [n for n in around[k] if any(n.edge.IsSame(e) for e in outer)]
    if not border:
        return None
    rising = [n for n in around[k] if n.sine > SMOOTH_SINE and abs(n.cosine) < SQUARE and n.index not in in_holes]
    own = [n for n in border if n in rising]
    axis = faces[k].middle.normal[0]
    if own:
        walls = tuple(dict.fromkeys(n.index for n in rising))
        kind = "pocket" if len(own) == len(border) else "open pocket" if _face_each_other(faces, own) else "step"
        return Feature(kind=kind, faces=(k, *walls), axis=axis, size_mm=_height_mm(faces, k, around, [n.index for n in own]))
    falling = [n for n in border if n.sine < -SMOOTH_SINE and abs(n.cosine) < SQUARE]
    walls = tuple(dict.fromkeys(n.index for n in falling))
    stands = [any(m.sine > SMOOTH_SINE and abs(m.cosine) < SQUARE and faces[m.index].kind == "plane"
                  and float((faces[m.index].middle.normal[0] * axis).sum()) > 1.0 - SQUARE for m in around[w]) for w in walls]
    if walls and len(falling) == len(border) and all(stands):
        return Feature(kind="boss", faces=(k, *walls), axis=axis, size_mm=_height_mm(faces, k, around, walls))
    return None


def _outer_edges(face):
    """TopoDS_Edge values of a face's outer border."""
    explorer, out = TopExp_Explorer(BRepTools.OuterWire_s(face.shape), TopAbs_EDGE), []
    while explorer.More():
        out.append(explorer.Current())
        explorer.Next()
    return out


def _face_each_other(faces, walls):
    normals = np.array([faces[n.index].middle.normal[0] for n in walls])
    return bool(((normals[:, None] * normals[None]).sum(axis=2) < FACING).any())


def _height_mm(faces, k, around, walls):
    """How far walls reach from a plane, along its normal; the highest."""
    middle = faces[k].middle
    places = np.vstack([edge_points(n.edge, PLACES)[0] for w in walls for n in around[w]])
    return float(np.abs(((places - middle.point_mm[0]) * middle.normal[0]).sum(axis=1)).max())


def _chamfer(face, k, around):
    """The chamfer that a face is, or None: it eases an edge between two faces that turn away from it alike."""
    eased = [n for n in around if n.sine < -SMOOTH_SINE and EASED[0] < n.cosine < EASED[1]]
    if len({n.index for n in eased}) < 2:
        return None
    long = max(_length_mm(n.edge) for n in eased)
    width = face.area_mm2 / long
    if width > min(WIDEST_MM, NARROW * long):
        return None
    return Feature(kind="chamfer", faces=(k,), axis=face.middle.normal[0], size_mm=width)


def _length_mm(edge):
    places = edge_points(edge, 4 * PLACES)[0]
    return sum(math.dist(a, b) for a, b in zip(places[:-1].tolist(), places[1:].tolist()))
