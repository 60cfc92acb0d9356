r"""Dimensions measured on the simulated stock: what a coordinate measuring machine would say of it.

         .  .  .          each point lies on the exact face; from it the stock is met along the normal, as exactly as by the first
       .  axis  .         verifier; a circle or plane is fitted through what was met, and all that was met is held against the
         .  .  .          limits, not the fit alone
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.kernel import brep
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.findings import Finding
from cuspline.verification.chamfer_widths import chamfer_strip
from cuspline.verification.reporter import rounded
from cuspline.verification.samples import sample_faces

LIMIT_MM = 2.0              # what is off by more is off by so much
POINTS = 250                # on a feature, about
EDGE_MM = 0.5               # nearer to a face's border nothing is probed, where it is wide enough
SAME_MM = 1e-4              # axes and radii that are one
PARALLEL = 1e-6
SHORT_SHARE = 0.2           # of the radius: on shorter cylinders the axis' direction is not looked for


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One dimension of one feature, mm."""

    name: str
    kind: str
    place_mm: tuple[float, float, float]
    nominal_mm: float
    lower_mm: float
    upper_mm: float
    least_mm: float
    most_mm: float
    fitted_mm: float
    points: int
    rounding_mm: float          # of the post: so much beyond a limit is none

    @property
    def beyond_mm(self):
        """How far it is out of its limits; 0: it is within."""
        beyond = max(self.lower_mm - self.least_mm, self.most_mm - self.upper_mm)
        return beyond if beyond > self.rounding_mm else 0.0

    def as_dict(self):
        """For verify.json."""
        size = {n: rounded(getattr(self, n)) for n in ("nominal_mm", "lower_mm", "upper_mm", "least_mm", "most_mm", "fitted_mm")}
        return {"name": self.name, "kind": self.kind, "place_mm": [rounded(v) for v in self.place_mm], **size,
                "points": self.points, "ok": self.beyond_mm == 0.0}


def measured(dimensions, piece, solid, predicates, rounding_mm):
    """Measured values of all dimensions.

    Args:
        dimensions: design.dimensions values.   piece: stock.workpiece.Workpiece after all setups.
        solid: TopoDS_Solid, part coordinates.   predicates: design.FacePredicate values.   rounding_mm: of the posted text.
    Returns:
        tuple of Measured, in the order of dimensions and faces.
    Raises:
        DesignError: faces that have no such dimension.
    """
    faces = brep.faces_of(solid) if dimensions else ()
    return tuple(m for d in dimensions for m in _MEASURED[d.kind](d, _Probe(piece, faces, predicates, 2.0 * rounding_mm)))


def refuse_unmeasurable(dimensions, solid, predicates):
    """Raises DesignError where `measured` would, before anything is planned."""
    probe = _Probe(None, brep.faces_of(solid) if dimensions else (), predicates, 0.0)
    for dimension in dimensions:
        if dimension.kind == "distance":
            _, drawn, _, _ = _levels(dimension, probe)
            _limits_mm(dimension, drawn)
            continue
        if dimension.kind == "chamfer":
            for index in brep.indices_of(probe.faces, probe.chosen(dimension.faces)):
                _limits_mm(dimension, chamfer_strip(probe.faces, index, dimension.title).leg_mm)
            continue
        for (_, _, radius), _ in _about_axes(dimension, probe):
            _limits_mm(dimension, 2 * radius)


def _limits_mm(dimension, drawn_mm):
    """(lower, upper) size; DesignError: its class is not known for that size."""
    if dimension.kind == "position":
        return 0.0, dimension.zone_mm
    try:
        return dimension.limits_mm(drawn_mm)
    except ValueError as error:
        raise DesignError(f"{dimension.title}: {error}") from None


def tolerance_findings(found, setup):
    """A Finding of each Measured that is out of its limits; `setup`: name of the last."""
    return tuple(Finding(
        kind="out_of_tolerance", amount_mm=rounded(m.beyond_mm), place_mm=m.place_mm, operation="", line=0, setup=setup,
        advice=f"{m.name}: {m.least_mm:.4f} to {m.most_mm:.4f} mm on the simulated stock, {m.lower_mm:.4f} to {m.upper_mm:.4f} are "
        "allowed: finish it by a cutter or reamer of that size, draw the solid at the middle of the limits, or loosen them")
        for m in found if m.beyond_mm > 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Touched:
    """Points on faces and what the stock leaves there."""

    points_mm: np.ndarray       # (n, 3)
    normals: np.ndarray         # (n, 3) unit, out of the material
    deviation_mm: np.ndarray    # (n,) positive left


class _Probe:
    """The stock and the part's faces."""

    def __init__(self, piece, faces, predicates, rounding_mm):
        self.piece, self.faces, self.predicates, self.rounding_mm = piece, faces, predicates, rounding_mm

    def chosen(self, name):
        return brep.named_faces(self.faces, self.predicates, [name])

    def touched(self, faces):
        """_Touched of some brep.Face values, apart from their borders."""
        area = sum(f.area_mm2 for f in faces)
        samples = sample_faces(faces, 2.0 * math.sqrt(area / POINTS))
        inner = ~samples.is_border
        away, _ = cKDTree(samples.points_mm[samples.is_border]).query(samples.points_mm)
        wide = inner & (away > EDGE_MM)
        chosen = wide if wide.any() else inner
        points, normals = samples.points_mm[chosen], samples.normals[chosen]
        return _Touched(points_mm=points, normals=normals, deviation_mm=self.piece.deviations(points, normals, LIMIT_MM)[0])


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cylinder:
    """A cylinder of the design and what was met of it."""

    point_mm: np.ndarray        # (3,) on its axis, at the middle of its height
    axis: np.ndarray            # (3,) unit
    radius_mm: float
    turn_rad: np.ndarray        # (n,) about the axis
    along_mm: np.ndarray        # (n,) from the point
    found_mm: np.ndarray        # (n,) radius met

    def fitted(self):
        """((k,) the axis' offset by cosine and sine, at the middle and per mm, then the radius): least squares."""
        c, s = fixed.cos(self.turn_rad), fixed.sin(self.turn_rad)
        columns = [c, s]
        if np.ptp(self.along_mm) > SHORT_SHARE * self.radius_mm:
            columns += [c * self.along_mm, s * self.along_mm]
        answer = fixed.least_squares(np.column_stack([*columns, np.ones(len(c))]), self.found_mm[:, None])[:, 0]
        return answer, np.column_stack(columns)


def _about_axes(dimension, probe):
    """[((point (3,), direction (3,), radius), [brep.Face])] of the faces, those about one axis with one radius together."""
    groups = []
    for face in probe.chosen(dimension.faces):
        if face.kind != "cylinder":
            raise DesignError(f"{dimension.title}: the faces {dimension.faces!r} have a {face.kind} among them, and a "
                              f"{dimension.kind} is measured on cylinders: choose them alone")
        surface = face.adaptor.Cylinder()
        position = surface.Axis()
        p, d = (np.array([v.X(), v.Y(), v.Z()]) for v in (position.Location(), position.Direction()))
        group = next((g for g in groups if _is_about(g[0], (p, d, surface.Radius()))), None)
        if group is None:
            groups.append(((p, d, surface.Radius()), [face]))
        else:
            group[1].append(face)
    return groups


def _cylinders(dimension, probe):
    """_Cylinder values of the faces."""
    return [_touched_cylinder(probe, *group) for group in _about_axes(dimension, probe)]


def _is_about(a, b):
    way = b[0] - a[0]
    off = way - float((way * a[1]).sum()) * a[1]
    return abs(float((a[1] * b[1]).sum())) > 1.0 - PARALLEL and fixed.length(off) < SAME_MM and abs(a[2] - b[2]) < SAME_MM


def _touched_cylinder(probe, axis, faces):
    point, way, radius = axis
    met = probe.touched(faces)
    from_axis = met.points_mm - point
    along = fixed.matmul(from_axis, way)
    middle = (along.min() + along.max()) / 2
    across = from_axis - along[:, None] * way
    aside = np.cross(way, (0.0, 0.0, 1.0) if abs(way[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside = aside / fixed.length(aside)
    outward = np.where((across * met.normals).sum(axis=1) > 0, 1.0, -1.0)
    return _Cylinder(point_mm=point + middle * way, axis=way, radius_mm=radius, along_mm=along - middle,
                     turn_rad=fixed.arctan2(fixed.matmul(across, np.cross(way, aside)), fixed.matmul(across, aside)),
                     found_mm=radius + outward * met.deviation_mm)


def _diameters(dimension, probe):
    for cylinder in _cylinders(dimension, probe):
        answer, columns = cylinder.fitted()
        about = cylinder.found_mm - fixed.matmul(columns, answer[:-1])
        low, high = _limits_mm(dimension, 2 * cylinder.radius_mm)
        yield Measured(**_feature(dimension, probe, cylinder.point_mm, 2 * cylinder.radius_mm), lower_mm=low, upper_mm=high,
                       fitted_mm=float(2 * answer[-1]), points=len(about), **_spread(2 * about))


def _positions(dimension, probe):
    for cylinder in _cylinders(dimension, probe):
        answer, _ = cylinder.fitted()
        heights = [0.0] if len(answer) == 3 else [float(cylinder.along_mm.min()), float(cylinder.along_mm.max())]
        at = lambda h: answer[:2] + (answer[2:4] * h if len(answer) > 3 else 0.0)
        zones = np.array([2 * float(fixed.length(at(h))) for h in heights])
        yield Measured(**_feature(dimension, probe, cylinder.point_mm, 0.0), lower_mm=0.0, upper_mm=dimension.zone_mm,
                       fitted_mm=float(zones.max()), points=len(cylinder.found_mm), **_spread(zones))


def _levels(dimension, probe):
    """(the faces of both levels, distance drawn, 1 where the first lies higher along its normal else -1, cosine of their normals).

    Raises:
        DesignError: they are not two levels of planes parallel to each other.
    """
    sides = []
    for name in (dimension.faces, dimension.from_faces):
        faces = probe.chosen(name)
        if any(f.kind != "plane" for f in faces):
            raise DesignError(f"{dimension.title}: the faces {name!r} are not all planes: a distance is measured between planes")
        sides.append((faces, faces[0].middle))
    normal, other = (m.normal[0] for _, m in sides)
    turned = float((normal * other).sum())
    heights = [np.array([float((f.middle.point_mm[0] * normal).sum()) for f in faces]) for faces, _ in sides]
    if abs(turned) < 1.0 - PARALLEL or any(np.ptp(h) > SAME_MM for h in heights):
        raise DesignError(f"{dimension.title}: {dimension.faces!r} and {dimension.from_faces!r} are not two levels parallel to "
                          "each other: choose faces that are")
    sign = 1.0 if heights[0][0] > heights[1][0] else -1.0
    return [faces for faces, _ in sides], abs(float(heights[0][0] - heights[1][0])), sign, turned


def _distances(dimension, probe):
    sides, drawn, sign, turned = _levels(dimension, probe)
    far, near = (probe.touched(faces) for faces in sides)
    a, b = sign * far.deviation_mm, sign * np.sign(turned) * near.deviation_mm
    spread = drawn + np.array([a.min() - b.max(), a.max() - b.min()])
    low, high = _limits_mm(dimension, drawn)
    yield Measured(**_feature(dimension, probe, sides[0][0].middle.point_mm[0], drawn), lower_mm=low, upper_mm=high,
                   fitted_mm=drawn + float(a.mean() - b.mean()), points=len(a) + len(b), **_spread(spread))


def _chamfers(dimension, probe):
    """Each chamfer's longer leg by what the stock leaves on its strip."""
    for index in brep.indices_of(probe.faces, probe.chosen(dimension.faces)):
        strip = chamfer_strip(probe.faces, index, dimension.title)
        met = probe.touched([probe.faces[index]])
        legs = strip.leg_mm - strip.per_mm * met.deviation_mm
        low, high = _limits_mm(dimension, strip.leg_mm)
        yield Measured(**_feature(dimension, probe, strip.place_mm, strip.leg_mm), lower_mm=low, upper_mm=high,
                       fitted_mm=float(legs.mean()), points=len(legs), **_spread(legs))


def _feature(dimension, probe, place_mm, drawn_mm):
    """What a Measured says of the feature; `drawn_mm`: the design's own size."""
    return {"name": dimension.title, "kind": dimension.kind, "place_mm": tuple(np.round(place_mm, 6).tolist()),
            "nominal_mm": getattr(dimension, "nominal_mm", None) or drawn_mm, "rounding_mm": probe.rounding_mm}


def _spread(values_mm):
    return {"least_mm": float(values_mm.min()), "most_mm": float(values_mm.max())}


_MEASURED = {"diameter": _diameters, "position": _positions, "distance": _distances, "chamfer": _chamfers}
