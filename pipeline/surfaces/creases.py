"""Creases within a face: knots at which its spline is only continuous, and the normal turns at once.

A cutter rests on one that stands proud as it rests on an edge.
"""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools

from cuspline.values import fixed_math as fixed

PLACES = 120            # along a crease that are looked at
HAIR = 1e-9             # of the face's parameters, to either side
PROUD_RAD = 1e-6        # a normal that turns by less is smooth: a ball of 10 mm touches beside it, 1e-8 mm away
TRIM_HALVINGS = 40


@dataclass(frozen=True, eq=False, kw_only=True)
class Crease:
    """One knot of one face, looked at in places along it."""

    axis: int               # 0: along v at a knot of u; 1: the other way round
    knot: float
    along: np.ndarray       # (n,) the other parameter
    is_inside: np.ndarray   # (n,) within the face's borders; of a smooth one nowhere
    turn_rad: np.ndarray    # (n,) of the normal, positive in a hollow
    point_mm: np.ndarray    # (n, 3)
    step_mm: np.ndarray     # (n,) length that each place stands for

    @property
    def is_proud(self):
        """Whether it stands out of the face somewhere."""
        return bool((self.is_inside & (self.turn_rad < -PROUD_RAD)).any())


def creases_of(face):
    """Crease values of a `brep.Face`, smooth ones included: arcs written as splines have such knots too."""
    surface = face.nurbs
    for axis, (knots, degree) in enumerate(((surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v))):
        values, counts = np.unique(knots, return_counts=True)
        for knot in values[1:-1][counts[1:-1] >= degree]:
            yield _crease(face, axis, float(knot), values[-1] - values[0])


def _crease(face, axis, knot, span):
    low, high = _range(face, axis)
    along = low + (np.arange(PLACES) + 0.5) / PLACES * (high - low)
    across = np.full_like(along, knot)
    at = lambda shift: (across + shift, along) if axis == 0 else (along, across + shift)
    before, after = face.shape_at(*at(-HAIR * span)), face.nurbs.derivatives(*at(HAIR * span))
    normal_after = face.shape_at(*at(HAIR * span)).normal
    into = after[:, 1 + axis] / np.maximum(np.linalg.norm(after[:, 1 + axis], axis=1), 1e-300)[:, None]
    rises = np.einsum("ij,ij->i", before.normal, into)
    turn = fixed.arctan2(np.linalg.norm(np.cross(before.normal, normal_after), axis=1),
                         np.einsum("ij,ij->i", before.normal, normal_after))
    is_sharp = bool((turn > PROUD_RAD).any())
    return Crease(axis=axis, knot=knot, along=along,
                  is_inside=face.is_inside(*at(0.0)) if is_sharp else np.zeros(PLACES, bool),
                  turn_rad=np.where(rises > 0, turn, -turn), point_mm=before.point_mm,
                  step_mm=np.linalg.norm(after[:, 2 - axis], axis=1) * (high - low) / PLACES)


def _range(face, axis):
    """(low, high) of the parameter along a crease."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.nurbs_face)
    return (v0, v1) if axis == 0 else (u0, u1)


def proud_curves(face):
    """[(kernel's curve, first, last)] along the creases of a face that stand proud, within its borders."""
    found = []
    for crease in creases_of(face):
        if crease.is_proud:
            surface = BRep_Tool.Surface_s(face.nurbs_face)
            curve = surface.UIso(crease.knot) if crease.axis == 0 else surface.VIso(crease.knot)
            found += [(curve, first, last) for first, last in _within(face, crease)]
    return found


def _within(face, crease):
    """[(first, last)] stretches of a crease within the face's borders."""
    low, high = _range(face, crease.axis)
    inside, stretches, begun = crease.is_inside, [], None
    at = lambda t: face.is_inside(*((np.array([crease.knot]), np.array([t])) if crease.axis == 0
                                    else (np.array([t]), np.array([crease.knot]))))[0]

    def border(outer, inner):
        for _ in range(TRIM_HALVINGS):
            middle = (outer + inner) / 2
            outer, inner = (outer, middle) if at(middle) else (middle, inner)
        return inner

    along = crease.along
    for k in range(len(along)):
        if inside[k] and begun is None:
            begun = low if k == 0 and at(low) else border(low if k == 0 else along[k - 1], along[k])
        if begun is not None and (k + 1 == len(along) or not inside[k + 1]) and inside[k]:
            is_last = k + 1 == len(along)
            stretches.append((begun, high if is_last and at(high) else border(high if is_last else along[k + 1], along[k])))
            begun = None
    return stretches
