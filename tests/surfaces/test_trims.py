"""The trim test against the kernel's own classifier, point by point."""

import cadquery as cq
import numpy as np
import pytest

from cuspline.kernel import brep
from cuspline.surfaces import trims
from cuspline.surfaces.trims import SERIAL_ROWS, TrimSet
from cuspline.values.errors import DesignError


def _parts():
    block = cq.Workplane().box(40, 30, 10).edges("|Z").fillet(4).faces(">Z").workplane().hole(8)
    spline = cq.Workplane().spline([(0, 0), (10, 6), (22, -3), (30, 5)]).lineTo(30, -12).lineTo(0, -12).close()
    spline = spline.extrude(9)
    return {
        "block with hole and fillets": block.faces(">Z").edges().fillet(1),
        "sphere with boss": cq.Workplane().sphere(10).union(cq.Workplane().circle(4).extrude(15)),
        "cone in a ring": cq.Workplane("XZ").moveTo(4, 0).lineTo(9, 0).lineTo(6, 7).close().revolve()
        .translate((0, 0, 1)),
        "torus cut across": cq.Workplane("XZ").moveTo(10, 0).circle(3).revolve().cut(cq.Workplane().box(9, 60, 4)),
        "spline wall with a drilled side": spline.cut(
            cq.Workplane("XZ").center(15, 4).circle(2).extrude(40, both=True)),
        "loft": cq.Workplane().rect(20, 14).workplane(offset=10).circle(5).loft(),
    }


@pytest.mark.parametrize("name", list(_parts()))
def test_inside_is_what_the_kernel_says(name):
    faces, rng = brep.faces_of(brep.the_solid(_parts()[name])), np.random.default_rng(2)
    sets = TrimSet.of_faces(faces)
    for k, face in enumerate(faces):
        u0, u1, v0, v1 = face.nurbs.domain
        u, v = rng.uniform(u0, u1, 400), rng.uniform(v0, v1, 400)
        differ = np.flatnonzero(sets.is_inside(k, u, v) != face.is_inside(u, v))
        for row in differ:      # only a hair from the border may the two differ
            d = face.nurbs.derivatives(u[row:row + 1], v[row:row + 1])[0]
            near = u[row] + np.array([-1, 1, 0, 0]) * 2e-5 / max(np.linalg.norm(d[1]), 1e-9), \
                v[row] + np.array([0, 0, -1, 1]) * 2e-5 / max(np.linalg.norm(d[2]), 1e-9)
            assert len(set(face.is_inside(*near).tolist())) == 2


def test_many_points_at_once_are_the_same_answers():
    faces = brep.faces_of(brep.the_solid(_parts()["block with hole and fillets"]))
    sets, top = TrimSet.of_faces(faces), max(range(len(faces)), key=lambda k: faces[k].middle.point_mm[0, 2])
    u0, u1, v0, v1 = faces[top].nurbs.domain
    rng = np.random.default_rng(3)
    u, v = rng.uniform(u0, u1, SERIAL_ROWS + 10), rng.uniform(v0, v1, SERIAL_ROWS + 10)
    few = np.concatenate([sets.is_inside(top, a, b) for a, b in zip(np.array_split(u, 40), np.array_split(v, 40))])
    assert np.array_equal(sets.is_inside(top, u, v), few)


def test_whole_faces_hold_their_border_too():
    faces = brep.faces_of(brep.the_solid(cq.Workplane().sphere(5)))
    u0, u1, v0, v1 = faces[0].nurbs.domain
    assert TrimSet.of_faces(faces).is_inside(0, np.array([u0, u1, u0]), np.array([v0, v1, v1])).all()


def test_a_border_may_meet_a_pole_anywhere(monkeypatch):
    """A reader that projects a border to the surface finds any longitude at a pole; the face is the same."""
    octant = cq.Workplane().sphere(5).intersect(cq.Workplane().box(9, 9, 9, centered=False))
    face, = (f for f in brep.faces_of(brep.the_solid(octant)) if f.kind == "sphere")
    u, v = np.random.default_rng(5).uniform(face.nurbs.domain[::2], face.nurbs.domain[1::2], (500, 2)).T
    wanted, whole = TrimSet.of_faces([face]).is_inside(0, u, v), brep.border_curves
    pole = face.nurbs.domain[3]

    def astray(at):
        def moved(t):
            points = at(t)
            points[np.abs(points[:, 1] - pole) < 1e-9, 0] += 0.3
            return points
        return moved

    monkeypatch.setattr(trims.brep, "border_curves", lambda face: [
        (astray(at) if np.ptp(at(np.array(knots))[:, 1]) > 0.1 else at, knots) for at, knots in whole(face)])
    assert np.array_equal(TrimSet.of_faces([face]).is_inside(0, u, v), wanted)
    monkeypatch.setattr(trims, "POLE_SHARE", 1.0)
    with pytest.raises(DesignError, match="does not close"):
        TrimSet.of_faces([face])


def test_border_that_does_not_close_is_refused_by_name(monkeypatch):
    faces = brep.faces_of(brep.the_solid(cq.Workplane().box(4, 4, 4)))
    whole = brep.border_curves
    monkeypatch.setattr(trims.brep, "border_curves", lambda face: whole(face)[:-1])
    with pytest.raises(DesignError, match="face 0 .plane.: its border does not close"):
        TrimSet.of_faces(faces)
