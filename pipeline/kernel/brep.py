"""The door to OCCT: faces and edges of a solid, predicates, tessellation for planning; STEP through step_files.

Shapes come in as CadQuery or build123d objects or bare TopoDS shapes and are used as TopoDS inside.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from io import BytesIO

import numpy as np
from OCP.BinTools import BinTools, BinTools_FormatVersion
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAbs import GeomAbs_CN, GeomAbs_SurfaceType
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.Message import Message
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.ShapeCustom import ShapeCustom
from OCP.TColStd import TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from cuspline.kernel import closure, step_files
from cuspline.kernel.extents import extents_mm
from cuspline.kernel.poles import with_poles
from cuspline.kernel.step_files import FaceMark, MarkedSolid, marks_of
from cuspline.kernel.topology import explore
from cuspline.splines.fitting import fitted
from cuspline.splines.nurbs import NurbsSurface, local_shape
from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.arrays import frozen
from cuspline.values.errors import DesignError
from cuspline.values.models import shortened

read_step, refuse_unreadable, write_step = step_files.read_step, step_files.refuse_unreadable, step_files.write_step

Message.DefaultMessenger_s().ChangePrinters().Clear()     # the kernel would print its statistics on standard output

KINDS = {
    GeomAbs_SurfaceType.GeomAbs_Plane: "plane", GeomAbs_SurfaceType.GeomAbs_Cylinder: "cylinder",
    GeomAbs_SurfaceType.GeomAbs_Cone: "cone", GeomAbs_SurfaceType.GeomAbs_Sphere: "sphere",
    GeomAbs_SurfaceType.GeomAbs_Torus: "torus", GeomAbs_SurfaceType.GeomAbs_BezierSurface: "bezier",
    GeomAbs_SurfaceType.GeomAbs_BSplineSurface: "bspline",
    GeomAbs_SurfaceType.GeomAbs_SurfaceOfRevolution: "revolution",
    GeomAbs_SurfaceType.GeomAbs_SurfaceOfExtrusion: "extrusion",
    GeomAbs_SurfaceType.GeomAbs_OffsetSurface: "offset",
}
POLE_MM, POLE_SHARE = 1e-7, 1e-8      # a border this short is a pole; how far from it normals are sound
LARGEST_TOLERANCE_MM = 1e-3           # looser ones are looked into: a valid solid may hide edges that are open by far more
CLAIMED = 2.0                         # times as loose as its edges are measured to be: a solid to be healed
TOLD_SOLIDS = 6                       # of a file that holds several
OPEN_MM = 0.05                        # no rounding leaves more


def wrapped(shape):
    """The TopoDS shape inside a CadQuery or build123d object, or the shape itself.

    Raises:
        DesignError: it is none of these.
    """
    inner = shape.val() if hasattr(shape, "val") else shape
    inner = getattr(inner, "wrapped", inner)
    if not isinstance(inner, TopoDS_Shape):
        raise DesignError(f"a shape of CadQuery, build123d or OCP goes here, not {shortened(shape)} ({type(shape).__name__})")
    return inner


def the_solid(shape, name="the part"):
    """The one solid of a shape; colours and names of its faces stay with it.

    One that is closed only loosely is given with its vertices and tolerances healed, as far as they can be (closure.py).

    Raises:
        DesignError: none, several, one that the kernel calls invalid, or one that is open.
    """
    solid, marks = _one_solid(shape, name), None
    if getattr(shape, "face_marks", None) is not None:
        marks = marks_of(shape, explore(solid, TopAbs_FACE))
    solid = _valid(solid, name)
    if loosest_tolerance_mm(solid) > LARGEST_TOLERANCE_MM:
        solid = _closed(solid, name)
    return solid if marks is None else MarkedSolid(solid, marks)


def _closed(solid, name):
    """The solid healed.  Raises DesignError where it stays open."""
    if loosest_tolerance_mm(solid) > CLAIMED * closure.widest_gap(solid)[0]:
        solid = closure.healed(solid)
    gap, place = closure.widest_gap(solid)
    if gap > OPEN_MM:
        raise DesignError(f"{name} is open by {gap:.3g} mm along an edge at ({', '.join(f'{x:.3f}' for x in place)}), "
                          f"{OPEN_MM} mm can be a rounding: sew its faces, or build them anew")
    return solid


def widest_gap(solid):
    """(mm, place (3,)) of the widest gap between two faces of a solid; 0 where all tolerances are small."""
    return closure.widest_gap(solid) if loosest_tolerance_mm(solid) > LARGEST_TOLERANCE_MM else (0.0, np.zeros(3))


def _items(shape):
    """All that a Workplane or a list holds, and not its first alone; a shape as a list of one."""
    inside = shape.vals() if hasattr(shape, "vals") else shape
    return inside if isinstance(inside, (list, tuple)) else [inside]


def _one_solid(shape, name):
    """The one solid of a shape, as it is."""
    solids = [s for item in _items(shape) for s in explore(wrapped(item), TopAbs_SOLID)]
    if len(solids) != 1:
        raise DesignError(f"{name} holds {counted(len(solids), 'solid')}, it must be exactly one: "
                          + ("close its shell" if not solids else "fuse them, or build them one by one; a job file names one of "
                             f"them with `solid`: {solids_in_words(solids)}"))
    return TopoDS.Solid_s(solids[0])


def _valid(solid, name):
    """The solid, faces that lost their pole made whole."""
    if not BRepCheck_Analyzer(solid).IsValid():
        solid = with_poles(solid)
    if not BRepCheck_Analyzer(solid).IsValid():
        raise DesignError(f"{name} is not a valid solid (BRepCheck): check for self-intersections and open edges")
    rough = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, rough)      # off by per cents: enough to tell the side, and far faster
    if rough.Mass() <= 0 and volume_mm3(solid) <= 0:
        raise DesignError(f"{name} has no positive volume: its shell is inside out")
    return solid


def chosen_solid(shape, number, name):
    """One solid of a shape that may hold several, by its number from 1; None: the shape as it is.

    Raises:
        DesignError: there is no such.
    """
    if number is None:
        return shape
    solids = explore(wrapped(shape), TopAbs_SOLID)
    if number > len(solids):
        raise DesignError(f"{name} holds {counted(len(solids), 'solid')}, there is no solid {number}: {solids_in_words(solids)}")
    solid = TopoDS.Solid_s(solids[number - 1])
    marks = marks_of(shape, explore(solid, TopAbs_FACE))
    return solid if marks is None else MarkedSolid(solid, marks)


def solids_in_words(solids):
    """Number, size and place of the first of some solids."""
    boxes = [bounding_box_mm(s) for s in solids[:TOLD_SOLIDS]]
    told = lambda row, between: between.join(f"{x:.4g}" for x in row.round(6) + 0.0)
    rows = [f"{k} is {told(high - low, ' x ')} mm at ({told((low + high) / 2, ', ')})" for k, (low, high) in enumerate(boxes, 1)]
    return ", ".join(rows) + (f", and {len(solids) - TOLD_SOLIDS} more" if len(solids) > TOLD_SOLIDS else "")


def storable(solid):
    """The solid as STEP can hold it: a face turned from a closed curve comes back without its pole, as a B-spline with it."""
    if not any(_has_pole_of_closed_curve(f) for f in faces_of(solid)):
        return solid
    made = TopoDS.Solid_s(explore(ShapeCustom.ConvertToBSpline_s(solid, False, True, False, False), TopAbs_SOLID)[0])
    marks = marks_of(solid, explore(solid, TopAbs_FACE))
    return made if marks is None else MarkedSolid(made, marks)


def _has_pole_of_closed_curve(face):
    if face.kind != "revolution" or not face.adaptor.BasisCurve().IsPeriodic():
        return False
    return any(BRep_Tool.Degenerated_s(edge) for edge in _edges_round(face.shape))


def marked(shape, names=(), colors=()):
    """The one solid of a shape made in code, some of its faces named or coloured.

    Args:
        shape: as for `the_solid`.
        names: (name, face) pairs; faces of the shape, of CadQuery, build123d or the kernel.
        colors: ((red, green, blue), face) pairs, sRGB, 0 to 1.
    Raises:
        DesignError: a face that the shape does not have.
    """
    solid = _valid(_one_solid(shape, "the part"), "the part")
    faces = explore(solid, TopAbs_FACE)
    marks = list(marks_of(shape, faces) or [FaceMark() for _ in faces])
    for what, pairs in (("name", names), ("color", colors)):
        for value, face in pairs:
            found = [k for k, f in enumerate(faces) if f.IsSame(wrapped(face))]
            if not found:
                raise DesignError(f"the face to be marked {value!r} is no face of this solid: take it from the "
                                  "finished shape")
            marks[found[0]] = replace(marks[found[0]], **{what: value})
    return MarkedSolid(solid, marks)


@dataclass(frozen=True, eq=False)
class Face:
    """One face with what planning and verification ask of it."""

    shape: object                           # TopoDS_Face
    mark: FaceMark = field(default_factory=FaceMark)

    @cached_property
    def adaptor(self):
        return BRepAdaptor_Surface(self.shape, True)

    @cached_property
    def kind(self):
        return KINDS.get(self.adaptor.GetType(), "other")

    @cached_property
    def is_reversed(self):
        return self.shape.Orientation() == TopAbs_REVERSED

    @cached_property
    def uv_bounds(self):
        """(u low, u high, v low, v high) of the trimmed region."""
        return BRepTools.UVBounds_s(self.shape)

    @cached_property
    def nurbs(self):
        """The face's surface as a rational B-spline (its own parameters, see `nurbs_face`)."""
        return _nurbs_of(self.shape if self.kind == "offset" else self.nurbs_face)

    @cached_property
    def regular_domain(self):
        """The domain of `nurbs`, a hair inside where a border runs together in one point (a pole has no normal)."""
        low, high = np.array(self.nurbs.domain[::2]), np.array(self.nurbs.domain[1::2])
        hair = POLE_SHARE * (high - low)
        corners = self.nurbs.poles[..., :3] / self.nurbs.poles[..., 3:]
        collapsed = lambda row: np.ptp(row, axis=0).max() < POLE_MM
        low = low + hair * (collapsed(corners[0]), collapsed(corners[:, 0]))
        high = high - hair * (collapsed(corners[-1]), collapsed(corners[:, -1]))
        return low[0], high[0], low[1], high[1]

    @cached_property
    def nurbs_face(self):
        """The same face on a B-spline surface; trim tests for `nurbs` parameters use this one."""
        return self.shape if _is_plain_spline(self.shape) else _converted(_Described.of(self.shape))

    @cached_property
    def _classifier(self):
        return BRepTopAdaptor_FClass2d(self.nurbs_face, 1e-9)

    def is_inside(self, u, v):
        """(n,) bool: parameters of `nurbs` inside the trim, its border included."""
        classify = self._classifier.Perform
        keep = (TopAbs_IN, TopAbs_ON)
        return np.array([classify(gp_Pnt2d(a, b), True) in keep for a, b in zip(u.tolist(), v.tolist())], bool)

    def shape_at(self, u, v):
        """LocalShape at parameters of `nurbs`, normal out of the material."""
        return local_shape(self.nurbs.derivatives(np.atleast_1d(u), np.atleast_1d(v)), self.is_reversed)

    @cached_property
    def middle(self):
        """LocalShape at the middle of the trimmed parameter range."""
        u0, u1, v0, v1 = BRepTools.UVBounds_s(self.nurbs_face)
        return self.shape_at((u0 + u1) / 2, (v0 + v1) / 2)

    @cached_property
    def area_mm2(self):
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(self.shape, properties, 1e-6)
        return properties.Mass()


@dataclass(frozen=True)
class _Described:
    """A face by all that the kernel keeps of it, bit for bit: one read from a file once more is the same."""

    checksum: bytes
    shape: TopoDS_Shape = field(compare=False)

    @classmethod
    def of(cls, shape):
        kept = BytesIO()
        BinTools.Write_s(shape, kept, False, False, BinTools_FormatVersion.BinTools_FormatVersion_CURRENT)
        return cls(sha256(kept.getvalue()).digest(), shape)


@lru_cache(maxsize=1024)
def _converted(face):
    """The face on a B-spline surface: its borders are approximated anew, which takes long where it is round."""
    shape = BRepBuilderAPI_NurbsConvert(face.shape, True).Shape()
    return TopoDS.Face_s(explore(shape, TopAbs_FACE)[0])


def _is_plain_spline(face):
    """Whether a face lies on a B-spline surface as it is: neither moved nor periodic (converting it would take long)."""
    here = TopLoc_Location()
    surface = BRep_Tool.Surface_s(face, here)
    return (here.IsIdentity() and isinstance(surface, Geom_BSplineSurface)
            and not (surface.IsUPeriodic() or surface.IsVPeriodic()))


def seen_from(solid, frame):
    """A solid as it lies in a frame, its faces in the same order; itself where the frame is the part's own."""
    if np.array_equal(frame.rotation, np.eye(3)) and not frame.origin_mm.any():
        return solid
    motion, (a, b, c) = gp_Trsf(), np.column_stack([frame.rotation.T, frame.into(np.zeros((1, 3)))[0]]).tolist()
    motion.SetValues(*a, *b, *c)
    return TopoDS.Solid_s(BRepBuilderAPI_Transform(solid, motion, True).Shape())


def faces_of(solid):
    """All faces of a solid, with what is marked on them."""
    faces = explore(solid, TopAbs_FACE)
    marks = marks_of(solid, faces) or [FaceMark()] * len(faces)
    return [Face(TopoDS.Face_s(f), mark) for f, mark in zip(faces, marks)]


def edges_of_faces(faces, with_points=False):
    """Every edge of Face values once, with all its uses.

    Args:
        faces: Face values.
        with_points: edges that have shrunk to a point (the apex of a cone) count too.
    Returns:
        [[(face index, TopoDS_Edge as it runs round that face), ...]] in the order met; a seam has two uses by its face.
    """
    table, uses = TopTools_IndexedMapOfShape(), []
    for index, face in enumerate(faces):
        for edge in _edges_round(face.shape):
            number = table.Add(edge)
            if number > len(uses):
                uses.append([])
            uses[number - 1].append((index, edge))
    return [use for use in uses if with_points or not BRep_Tool.Degenerated_s(use[0][1])]


def edges_with_faces(solid):
    """[(TopoDS_Edge, [TopoDS_Face, ...])] of all edges that are not degenerate."""
    faces = faces_of(solid)
    return [(use[0][1], [faces[index].shape for index, _ in use]) for use in edges_of_faces(faces)]


def _edges_round(face):
    """TopoDS_Edge values in the direction of a face's wires; a seam comes twice, once a side."""
    explorer = TopExp_Explorer(face, TopAbs_EDGE)
    while explorer.More():
        yield TopoDS.Edge_s(explorer.Current())
        explorer.Next()


def edge_points(edge, count):
    """Points and unit tangents along an edge at equal parameter steps: (count, 3) each."""
    curve = BRepAdaptor_Curve(edge)
    points, tangents = np.empty((count, 3)), np.empty((count, 3))
    p, d = gp_Pnt(), gp_Vec()
    for i, t in enumerate(np.linspace(curve.FirstParameter(), curve.LastParameter(), count).tolist()):
        curve.D1(t, p, d)
        points[i], tangents[i] = (p.X(), p.Y(), p.Z()), (d.X(), d.Y(), d.Z())
    return points, tangents / np.linalg.norm(tangents, axis=1)[:, None]


def border_curves(face):
    """Border curves of a face in its surface's parameters, each in the direction of its wire.

    Returns:
        list of (at, knots): at(t (n,)) -> (n, 2) parameters u, v; knots between which the curve is smooth,
        falling where the wire runs against the curve.  A seam comes twice, once a side.
    """
    curves = []
    for edge in _edges_round(face):
        curve = BRepAdaptor_Curve2d(edge, face)
        knots = TColStd_Array1OfReal(1, curve.NbIntervals(GeomAbs_CN) + 1)
        curve.Intervals(knots, GeomAbs_CN)
        knots = np.array([knots.Value(k) for k in range(1, knots.Length() + 1)])
        curves.append((_at_parameters(curve), knots[::-1] if edge.Orientation() == TopAbs_REVERSED else knots))
    return curves


def _at_parameters(curve):
    def at(t):
        points = [curve.Value(x) for x in t.tolist()]
        return np.array([(p.X(), p.Y()) for p in points])
    return at


def _offset_nurbs(surface, bounds):
    """An offset surface is no B-spline; the kernel's own conversion is off by micrometres.

    Only the part within `bounds` (u low, u high, v low, v high): beyond its face it may turn over, as a fillet's does.
    """
    adaptor, p, breaks = GeomAdaptor_Surface(surface, *bounds), gp_Pnt(), []
    for direction in "UV":
        knots = TColStd_Array1OfReal(1, getattr(adaptor, f"Nb{direction}Intervals")(GeomAbs_CN) + 1)
        getattr(adaptor, f"{direction}Intervals")(knots, GeomAbs_CN)
        breaks.append(np.array([knots.Value(k) for k in range(1, knots.Length() + 1)]))

    def points_at(u, v):
        out = np.empty((len(u), 3))
        for k, (a, b) in enumerate(zip(u.tolist(), v.tolist())):
            surface.D0(a, b, p)
            out[k] = p.X(), p.Y(), p.Z()
        return out

    return fitted(points_at, *breaks)


def _nurbs_of(face):
    surface = BRep_Tool.Surface_s(face)
    if GeomAdaptor_Surface(surface).GetType() == GeomAbs_SurfaceType.GeomAbs_OffsetSurface:
        return _offset_nurbs(surface, BRepTools.UVBounds_s(face))
    return nurbs_of_surface(GeomConvert.SurfaceToBSplineSurface_s(surface))


def nurbs_of_surface(surface):
    """NurbsSurface of a Geom_BSplineSurface; a periodic one is cut open where its parameters begin."""
    for direction in "UV":
        if getattr(surface, f"Is{direction}Periodic")():
            getattr(surface, f"Set{direction}NotPeriodic")()
    nu, nv = surface.NbUPoles(), surface.NbVPoles()
    is_rational = surface.IsURational() or surface.IsVRational()       # the weights of others may be no numbers at all
    poles = np.empty((nu, nv, 4))
    for i in range(nu):
        for j in range(nv):
            p, w = surface.Pole(i + 1, j + 1), surface.Weight(i + 1, j + 1) if is_rational else 1.0
            poles[i, j] = p.X() * w, p.Y() * w, p.Z() * w, w
    flat = lambda d, n: np.repeat(
        [getattr(surface, f"{d}Knot")(k) for k in range(1, n + 1)],
        [getattr(surface, f"{d}Multiplicity")(k) for k in range(1, n + 1)])
    return NurbsSurface(degree_u=surface.UDegree(), degree_v=surface.VDegree(),
                        knots_u=flat("U", surface.NbUKnots()), knots_v=flat("V", surface.NbVKnots()), poles=poles)


def select_faces(faces, predicate):
    """The faces that a FacePredicate describes.

    Raises:
        DesignError: it matches another number of faces than it says.
    """
    found = [f for f in faces if matches(f, predicate)]
    if not predicate.is_met_by(len(found)):
        wanted = predicate.count if predicate.at_least is None else f"at least {predicate.at_least}"
        raise DesignError(
            f"face predicate {predicate.name!r} matches {len(found)} of {len(faces)} faces, it says {wanted}: "
            f"change its conditions or its count ({', '.join(sorted({f.kind for f in found})) or 'no'} faces matched"
            f"{_marks_there_are(faces, predicate)})")
    return found


def named_faces(faces, predicates, names):
    """The faces of the predicates of some names, predicate by predicate.

    Raises:
        DesignError: see `select_faces`.
    """
    return [f for p in predicates if p.name in names for f in select_faces(faces, p)]


def indices_of(faces, some):
    """Where some of the faces stand among them all, growing."""
    return [k for k, face in enumerate(faces) if any(face is one for one in some)]


def _marks_there_are(faces, predicate):
    """The names or colours that a predicate could have meant."""
    if predicate.face_name is not None:
        return f"; names in the part: {', '.join(sorted({f.mark.name for f in faces if f.mark.name})) or 'none'}"
    if predicate.color is not None:
        found = sorted({f.mark.color for f in faces if f.mark.color})
        return f"; colours in the part: {', '.join(map(str, found)) or 'none'}"
    return ""


def matches(face, predicate):
    """Whether a Face is one that a FacePredicate describes."""
    if predicate.face_name is not None and face.mark.name != predicate.face_name:
        return False
    if predicate.color is not None and (face.mark.color is None or max(
            abs(a - b) for a, b in zip(face.mark.color, predicate.color)) > predicate.color_within):
        return False
    middle = face.middle
    center, normal = middle.point_mm[0], middle.normal[0]
    if predicate.kinds is not None and face.kind not in predicate.kinds:
        return False
    if predicate.normal is not None:
        wanted = np.asarray(predicate.normal) / fixed.length(predicate.normal)
        if np.degrees(fixed.arccos(np.clip(fixed.matmul(normal, wanted), -1, 1))) > predicate.normal_within_deg:
            return False
    if predicate.center_min_mm is not None and (center < predicate.center_min_mm).any():
        return False
    if predicate.center_max_mm is not None and (center > predicate.center_max_mm).any():
        return False
    if predicate.area_min_mm2 is not None and face.area_mm2 < predicate.area_min_mm2:
        return False
    return predicate.area_max_mm2 is None or face.area_mm2 <= predicate.area_max_mm2


def volume_mm3(solid):
    """Volume by adaptive integration (the kernel's default is wrong by per cents on wavy faces)."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties, 1e-6)
    return properties.Mass()


def mass_properties(solid):
    """(volume mm³, centre (3,) mm, inertia (3, 3) mm⁵ about the centre), of unit density, by adaptive integration."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties, 1e-6)
    center, matrix = properties.CentreOfMass(), properties.MatrixOfInertia()
    return (properties.Mass(), np.array([center.X(), center.Y(), center.Z()]),
            np.array([[matrix.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)]))


def loosest_tolerance_mm(solid):
    """The largest tolerance of any face, edge or vertex."""
    return ShapeAnalysis_ShapeTolerance().Tolerance(solid, 1)


def bounding_box_mm(shape):
    """(min (3,), max (3,)), tight to the geometry."""
    return extents_mm(shape)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanningMesh:
    """Triangles good enough to plan roughing and clearance on; finishing never rests on them."""

    vertices_mm: np.ndarray         # (n, 3)
    triangles: np.ndarray           # (m, 3)
    face_of_triangle: np.ndarray    # (m,) index into faces_of(solid)


def planning_mesh(solid, deflection_mm):
    """Tessellate a copy of the solid (OCCT may exceed the asked deflection up to threefold)."""
    BRepTools.Clean_s(solid)
    BRepMesh_IncrementalMesh(solid, deflection_mm, False, 0.35, False)      # by threads, a forked process would wait for ever
    vertices, triangles, owners, base = [], [], [], 0
    for index, face in enumerate(explore(solid, TopAbs_FACE)):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face_s(face), location)
        move = location.Transformation()
        points = [mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1)]
        vertices += [(p.X(), p.Y(), p.Z()) for p in points]
        triangles += [[base + k - 1 for k in mesh.Triangle(i).Get()] for i in range(1, mesh.NbTriangles() + 1)]
        owners += [index] * mesh.NbTriangles()
        base = len(vertices)
    BRepTools.Clean_s(solid)
    return PlanningMesh(vertices_mm=frozen(vertices, (None, 3), "vertices_mm"),
                        triangles=frozen(triangles, (None, 3), "triangles", np.int64),
                        face_of_triangle=frozen(owners, (len(triangles),), "face_of_triangle", np.int64))
