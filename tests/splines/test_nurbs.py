"""Our evaluation of faces against OCCT's own, which knows nothing of ours."""

import cadquery as cq
import numpy as np
import pytest
from known_parts import Drawing, swept
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec

from cuspline.kernel.brep import faces_of, the_solid

POINT_MM, NORMAL = 1e-9, 1e-9           # a ten-thousandth of what sections promise


def wavy_loft():
    d, e = Drawing("ZX", 0.0), Drawing("ZX", 30.0)
    wires = [k.closed([k.bezier((0, 20), (8, 32), (14, 8), (25, h))], (0, 20), (25, h)) for k, h in ((d, 18), (e, 26))]
    return the_solid(cq.Solid.makeLoft(wires, True))


def extruded():
    d = Drawing()
    return swept(d, d.closed([d.ellipse((10, 20), 9, 5, 20, 160)],
                             (10 + 9 * np.cos(np.radians(160)), 20 + 5 * np.sin(np.radians(160))),
                             (10 + 9 * np.cos(np.radians(20)), 20 + 5 * np.sin(np.radians(20)))), rise_deg=10)


def across_the_seam():
    """A bar of which only the part round the seam of its cylinder is left."""
    return cq.Workplane("XY").circle(10).extrude(20).intersect(cq.Workplane("XY").box(8, 12, 60).translate((9, 1, 0)))


PARTS = {
    "plane": lambda: cq.Workplane("XY").box(10, 20, 30).rotate((0, 0, 0), (1, 2, 3), 40),
    "cylinder": lambda: cq.Workplane("XY").circle(7).extrude(20).rotate((0, 0, 0), (1, 1, 0), 30),
    "cone": lambda: cq.Workplane(obj=cq.Solid.makeCone(9, 4, 12)).rotate((0, 0, 0), (0, 1, 0), 25),
    "sphere": lambda: cq.Workplane("XY").sphere(11),
    "torus": lambda: cq.Workplane(obj=cq.Solid.makeTorus(16, 5)),
    "extrusion": extruded, "bspline": wavy_loft, "cylinder across the seam": across_the_seam,
}


def occt(face, u, v):
    """(n, 6, 3) S, Su, Sv, Suu, Suv, Svv by Geom_Surface.D2 of the face's B-spline surface."""
    surface = BRep_Tool.Surface_s(face.nurbs_face)
    out = np.empty((len(u), 6, 3))
    p, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
    su, sv, suu, svv, suv = vectors
    for k in range(len(u)):
        surface.D2(u[k], v[k], p, su, sv, suu, svv, suv)
        out[k] = [(a.X(), a.Y(), a.Z()) for a in (p, su, sv, suu, suv, svv)]
    return out


def inner_parameters(face, count=60):
    u0, u1, v0, v1 = face.regular_domain
    u, v = np.random.default_rng(3).uniform(0.001, 0.999, (2, count))
    return u0 + u * (u1 - u0), v0 + v * (v1 - v0)


@pytest.mark.parametrize("name", PARTS)
def test_points_and_derivatives_are_those_of_the_kernel(name):
    for face in faces_of(the_solid(PARTS[name]())):
        u, v = inner_parameters(face)
        ours, theirs = face.nurbs.derivatives(u, v), occt(face, u, v)
        scale = np.abs(theirs).max(axis=(0, 2), keepdims=True).clip(1.0)
        np.testing.assert_allclose(ours[:, 0], theirs[:, 0], rtol=0, atol=POINT_MM)
        np.testing.assert_allclose(ours / scale, theirs / scale, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", PARTS)
def test_points_lie_on_the_original_surface_with_its_outward_normal(name):
    from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
    for face in faces_of(the_solid(PARTS[name]())):
        u, v = inner_parameters(face, 20)
        shape = face.shape_at(u, v)
        original = BRep_Tool.Surface_s(face.shape)
        for point, normal in zip(shape.point_mm, shape.normal):
            foot = GeomAPI_ProjectPointOnSurf(gp_Pnt(*point), original)
            assert foot.LowerDistance() < POINT_MM
            p, su, sv = gp_Pnt(), gp_Vec(), gp_Vec()
            original.D1(*foot.LowerDistanceParameters(), p, su, sv)
            theirs = np.cross((su.X(), su.Y(), su.Z()), (sv.X(), sv.Y(), sv.Z()))
            theirs *= (-1 if face.is_reversed else 1) / np.linalg.norm(theirs)
            # a projected foot is good to about 1e-8 of a parameter
            np.testing.assert_allclose(normal, theirs, atol=1e-7)


@pytest.mark.parametrize("name", PARTS)
def test_the_normal_points_out_of_the_material(name):
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.TopAbs import TopAbs_IN, TopAbs_OUT
    solid = the_solid(PARTS[name]())
    classifier = BRepClass3d_SolidClassifier(solid)
    for face in faces_of(solid):
        point, normal = face.middle.point_mm[0], face.middle.normal[0]
        for side, state in ((1e-3, TopAbs_OUT), (-1e-3, TopAbs_IN)):
            classifier.Perform(gp_Pnt(*(point + side * normal)), 1e-7)
            assert classifier.State() == state, face.kind


def test_closed_forms_of_principal_curvatures():
    cases = (("sphere", 1 / 11, 1 / 11), ("cylinder", 0.0, 1 / 7), ("plane", 0.0, 0.0))
    for kind, low, high in cases:
        face = next(f for f in faces_of(the_solid(PARTS[kind]())) if f.kind == kind)
        shape = face.shape_at(*inner_parameters(face))
        np.testing.assert_allclose(shape.curvature_low_per_mm, low, atol=1e-9)
        np.testing.assert_allclose(shape.curvature_high_per_mm, high, atol=1e-9)


def test_a_torus_is_hollow_inside_and_a_ridge_outside():
    face = faces_of(the_solid(PARTS["torus"]()))[0]
    shape = face.shape_at(*inner_parameters(face, 300))
    rho = np.hypot(*shape.point_mm[:, :2].T)
    around = (rho - 16) / 5 / rho           # cosine of the tube angle over rho; negative: hollow
    np.testing.assert_allclose(shape.curvature_low_per_mm, np.minimum(around, 1 / 5), atol=1e-9)
    np.testing.assert_allclose(shape.curvature_high_per_mm, np.maximum(around, 1 / 5), atol=1e-9)


def test_many_rows_in_parallel_equal_few_rows_one_by_one():
    face = max(faces_of(wavy_loft()), key=lambda f: f.nurbs.poles.shape[0])
    u, v = inner_parameters(face, 5000)
    together = face.nurbs.derivatives(u, v)
    np.testing.assert_array_equal(together[:100], face.nurbs.derivatives(u[:100], v[:100]))


def test_at_a_pole_the_regular_domain_still_has_a_normal():
    for face in faces_of(the_solid(PARTS["sphere"]())):
        u0, u1, v0, v1 = face.regular_domain
        shape = face.shape_at(np.linspace(u0, u1, 9), np.full(9, v1))
        np.testing.assert_allclose(shape.normal, np.tile((0, 0, 1), (9, 1)), atol=1e-6)
        assert shape.is_regular.all()
