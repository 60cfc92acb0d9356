"""No point of a face is farther from its samples than the spacing; weights add up."""

import cadquery as cq
import numpy as np
import pytest
from known_surfaces import bspline, face_of, kinds, random_weights, round_pocket_block, wavy_poles
from scipy.spatial import cKDTree

from cuspline.kernel.brep import Face, faces_of, the_solid
from cuspline.surfaces.sampling import samples_of_faces


def thin_wedge():
    """A cylinder's side cut to a sliver that runs out to nothing."""
    cone = cq.Workplane("XY").circle(10).extrude(20)
    wedge = cq.Workplane("XZ").polyline([(-12, 10), (12, 10), (12, 10.4)]).close().extrude(24, both=True)
    return faces_of(the_solid(cone.intersect(wedge)))


def pierced():
    sheet = cq.Face(face_of(bspline(wavy_poles(3, height=2.0), random_weights(3))).shape)
    circle = cq.Wire.makeCircle(6, cq.Vector(18, 14, -60), cq.Vector(0, 0, 1))
    bore = cq.Solid.extrudeLinear(circle, [], cq.Vector(0, 0, 120))
    return [Face(sheet.cut(bore).Faces()[0].wrapped)]


FACES = {
    "every kind": lambda: [f for k, f in kinds().items() if k != "offset"],
    "pocket": lambda: faces_of(the_solid(round_pocket_block())),
    "sphere with poles": lambda: faces_of(the_solid(cq.Workplane("XY").sphere(11))),
    "cone with its apex": lambda: faces_of(the_solid(cq.Workplane(obj=cq.Solid.makeCone(9, 0, 12)))),
    "sliver": thin_wedge, "pierced sheet": pierced,
}


@pytest.mark.parametrize("spacing_mm", [1.5, 0.6])
@pytest.mark.parametrize("name", FACES)
def test_no_point_of_a_face_is_farther_than_the_spacing(name, spacing_mm):
    faces = FACES[name]()
    samples = samples_of_faces(faces, spacing_mm)
    rng = np.random.default_rng(0)
    for k, face in enumerate(faces):
        mine = samples.face == k
        assert mine.any()
        u0, u1, v0, v1 = face.nurbs.domain
        u, v = rng.uniform(0, 1, (2, 1500))
        u, v = u0 + u * (u1 - u0), v0 + v * (v1 - v0)
        keep = face.is_inside(u, v)
        if keep.any():
            points = face.nurbs.derivatives(u[keep], v[keep])[:, 0]
            assert cKDTree(samples.point_mm[mine]).query(points)[0].max() <= spacing_mm
        assert samples.area_mm2[mine].sum() == pytest.approx(face.area_mm2, rel=1e-9)


def test_samples_lie_on_their_faces_with_their_normals():
    faces = FACES["pocket"]()
    s = samples_of_faces(faces, 1.0)
    for k, face in enumerate(faces):
        mine = s.face == k
        shape = face.shape_at(s.u[mine], s.v[mine])
        np.testing.assert_allclose(s.point_mm[mine], shape.point_mm, atol=1e-11)
        np.testing.assert_allclose(s.normal[mine], shape.normal, atol=1e-9)


def test_weights_integrate_over_a_trimmed_plane():
    # second moment about its middle of a plate of 40 x 30 with a hole of radius 8
    plate = cq.Workplane("XY").rect(40, 30).circle(8).extrude(5)
    top = [f for f in faces_of(the_solid(plate)) if f.kind == "plane" and f.middle.normal[0, 2] > 0.9]
    s = samples_of_faces(top, 0.4)
    exact = 40 ** 3 * 30 / 12 - np.pi * 8 ** 4 / 4
    assert s.area_mm2 @ s.point_mm[:, 0] ** 2 == pytest.approx(exact, rel=2e-3)


def test_half_the_spacing_takes_about_four_times_the_points():
    faces = FACES["pierced sheet"]()
    coarse, fine = (len(samples_of_faces(faces, h)) for h in (0.8, 0.2))
    assert 8 < fine / coarse < 32
