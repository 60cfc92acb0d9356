"""Chamfers as the lines and arcs of their lower edges in plan: flat strips and cones that lean by one angle all along."""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.kernel.brep import bounding_box_mm, edge_points, edges_of_faces
from cuspline.toolpaths.prismatic.plan_elements import PlanElement
from cuspline.toolpaths.prismatic.upright_walls import arcs_of_turn
from cuspline.values import fixed_math as fixed

PLACES = 9                  # along each edge
SAME_MM = 1e-5              # heights that are the same
LEVEL_SINE = 1e-9           # of a cone's axis to Z


@dataclass(frozen=True, eq=False, kw_only=True)
class ChamferEdge:
    """One element of a chamfer's lower edge, material on its right."""

    element: PlanElement
    low_mm: float
    high_mm: float
    lean_rad: float             # of the face to Z
    face: int


def chamfer_edges(face, index):
    """ChamferEdge values of one brep.Face; () where it is no plane with a level lower edge and no cone about Z, seen from above."""
    normal = face.middle.normal[0]
    lean = float(fixed.arcsin(min(abs(float(normal[2])), 1.0)))
    if face.kind not in ("plane", "cone") or normal[2] <= SAME_MM or lean > math.pi / 2 - SAME_MM:
        return ()
    low, high = (float(corner[2]) for corner in bounding_box_mm(face.shape))
    elements = _line(face, low) if face.kind == "plane" else _arcs(face, low)
    return tuple(ChamferEdge(element=e, low_mm=low, high_mm=high, lean_rad=lean, face=index) for e in elements)


def _line(face, low):
    normal = face.middle.normal[0, :2]
    way = np.array([normal[1], -normal[0]]) / fixed.length(normal)
    places = np.vstack([edge_points(edge, PLACES)[0] for (_, edge), *_ in edges_of_faces([face])])
    places = places[places[:, 2] < low + SAME_MM, :2]
    along = places[:, 0] * way[0] + places[:, 1] * way[1]
    if np.ptp(along) < SAME_MM:
        return ()
    return (PlanElement(start=places[along.argmin()], end=places[along.argmax()]),)


def _arcs(face, low):
    axis = face.adaptor.Cone().Axis()
    if math.hypot(axis.Direction().X(), axis.Direction().Y()) > LEVEL_SINE:
        return ()
    u0, u1, v0, v1 = face.uv_bounds
    v = min((v0, v1), key=lambda v: face.adaptor.Value(u0, v).Z())
    if abs(face.adaptor.Value(u0, v).Z() - low) > SAME_MM:
        return ()
    center = np.array([axis.Location().X(), axis.Location().Y()])
    return arcs_of_turn(face, center, (u0, u1), v)
