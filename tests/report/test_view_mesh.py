"""Tessellation for pictures, against closed forms."""

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt
from OCP.TopoDS import TopoDS_Compound

from cuspline.report.view_mesh import tessellate_for_view
from cuspline.values.errors import DesignError


def signed_volume(mesh):
    a, b, c = (mesh.vertices_mm[mesh.triangles[:, k]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def longest_edge(mesh):
    corner = mesh.vertices_mm[mesh.triangles]
    return np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max()


@pytest.mark.parametrize("longest_edge_mm", [None, 1.5])
def test_a_box_is_exact(longest_edge_mm):
    mesh = tessellate_for_view(BRepPrimAPI_MakeBox(10.0, 20.0, 5.0).Shape(), 0.01, longest_edge_mm)
    assert signed_volume(mesh) == pytest.approx(1000.0, abs=1e-9)       # also: outward everywhere, no gap
    assert len(mesh.edges_mm) == 12 and sorted(set(mesh.face_index)) == list(range(6))
    assert np.allclose(np.abs(mesh.normals).max(axis=1), 1.0)


def test_facets_are_divided_until_none_is_long():
    mesh = tessellate_for_view(BRepPrimAPI_MakeSphere(8.0).Shape(), 0.05, 0.7)
    assert longest_edge(mesh) <= 0.7


def test_vertices_and_normals_are_the_sphere_s_own():
    mesh = tessellate_for_view(BRepPrimAPI_MakeSphere(gp_Pnt(1, 2, 3), 8.0).Shape(), 0.05, 0.7)
    out = mesh.vertices_mm - (1, 2, 3)
    assert np.abs(np.linalg.norm(out, axis=1) - 8.0).max() < 1e-9
    assert np.abs(mesh.normals - out / 8.0).max() < 1e-6


def test_halving_the_edges_quarters_the_volume_error():
    coarse, fine = (4 / 3 * np.pi * 8**3 - signed_volume(tessellate_for_view(BRepPrimAPI_MakeSphere(8.0).Shape(), 1.0, edge))
                    for edge in (0.8, 0.4))
    assert 3.5 < coarse / fine < 4.5


def test_no_vertex_is_shared_between_faces():
    mesh = tessellate_for_view(BRepPrimAPI_MakeBox(1.0, 1.0, 1.0).Shape(), 0.01)
    assert len(mesh.vertices_mm) == 24 and (np.ptp(mesh.face_index[mesh.triangles], axis=1) == 0).all()


def test_nothing_to_draw_is_an_error():
    from OCP.BRep import BRep_Builder
    empty = TopoDS_Compound()
    BRep_Builder().MakeCompound(empty)
    with pytest.raises(DesignError, match="no face"):
        tessellate_for_view(empty, 0.1)
