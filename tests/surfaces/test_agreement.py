"""Every kind of face, moved and reversed: point, normal, curvatures and their directions as the CAD kernel has them."""

import numpy as np
import pytest
from known_surfaces import kinds
from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.gp import gp_Dir, gp_Pnt, gp_Vec

from cuspline.splines.nurbs import principal_directions
from cuspline.surfaces.patches import PatchSet

POINT_MM, NORMAL = 1e-9, 1e-9
KINDS = kinds()


def xyz(p):
    return np.array([p.X(), p.Y(), p.Z()])


def own_parameters(surface, point):
    """Parameters of the face's original surface for a point on it: the kernel's projection, two Newton steps on top."""
    foot = GeomAPI_ProjectPointOnSurf(gp_Pnt(*point), surface)
    u, v = foot.LowerDistanceParameters()
    p, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
    for _ in range(2):
        surface.D2(u, v, p, *vectors)
        su, sv = xyz(vectors[0]), xyz(vectors[1])
        step = np.linalg.lstsq(np.column_stack([su, sv]), point - xyz(p), rcond=None)[0]
        u, v = u + step[0], v + step[1]
    return u, v


def inner(face, count=25):
    u0, u1, v0, v1 = face.nurbs.domain
    t = np.random.default_rng(5).uniform(0.03, 0.97, (2, count))
    return u0 + t[0] * (u1 - u0), v0 + t[1] * (v1 - v0)


@pytest.mark.parametrize("name", KINDS)
def test_faces_are_of_the_kind_they_stand_for(name):
    assert KINDS[name].kind == name
    assert KINDS[name].is_reversed == (list(KINDS).index(name) % 2 == 1)


@pytest.mark.parametrize("name", KINDS)
def test_point_normal_and_curvatures_are_those_of_the_original_surface(name):
    face = KINDS[name]
    surface = BRep_Tool.Surface_s(face.shape)
    u, v = inner(face)
    derivatives = PatchSet.of_faces([face]).derivatives(0, u, v)
    shape, flip = face.shape_at(u, v), -1.0 if face.is_reversed else 1.0
    hollow, other = principal_directions(derivatives, face.is_reversed)
    for k in range(len(u)):
        a, b = own_parameters(surface, shape.point_mm[k])
        props = GeomLProp_SLProps(surface, a, b, 2, 1e-12)
        assert np.abs(xyz(props.Value()) - derivatives[k, 0]).max() < POINT_MM
        assert np.abs(xyz(props.Value()) - shape.point_mm[k]).max() < POINT_MM
        assert np.abs(flip * xyz(props.Normal()) - shape.normal[k]).max() < NORMAL
        # the kernel counts curvature positive towards its own normal; ours is positive on a ridge
        theirs = sorted(-flip * np.array([props.MinCurvature(), props.MaxCurvature()]))
        mine = shape.curvature_low_per_mm[k], shape.curvature_high_per_mm[k]
        # equal roots keep half their digits
        apart = abs(theirs[1] - theirs[0])
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-9 if apart > 1e-3 else 1e-7)
        products = hollow[k] @ shape.normal[k], other[k] @ shape.normal[k], hollow[k] @ other[k]
        assert np.abs(products).max() < 1e-12
        if apart > 1e-3:
            most, least = gp_Dir(), gp_Dir()
            props.CurvatureDirections(most, least)
            theirs_hollow = most if flip > 0 else least     # towards the outward normal is hollow
            assert abs(abs(xyz(theirs_hollow) @ hollow[k]) - 1.0) < 1e-9


@pytest.mark.parametrize("name", KINDS)
def test_curvature_along_a_principal_direction_is_the_principal_curvature(name):
    face = KINDS[name]
    u, v = inner(face)
    d = face.nurbs.derivatives(u, v)
    shape = face.shape_at(u, v)
    for direction, curvature in zip(principal_directions(d, face.is_reversed),
                                    (shape.curvature_low_per_mm, shape.curvature_high_per_mm)):
        for k in range(len(u)):
            a, b = np.linalg.lstsq(d[k, 1:3].T, direction[k], rcond=None)[0]
            bend = a * a * d[k, 3] + 2 * a * b * d[k, 4] + b * b * d[k, 5]
            assert -bend @ shape.normal[k] == pytest.approx(curvature[k], abs=1e-7)
