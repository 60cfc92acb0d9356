"""Solids that are closed loosely: what is only said to be open is healed, what is open is measured, and refused beyond a share."""

import sys
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS

from cuspline.design import Finish
from cuspline.kernel import brep, closure
from cuspline.planning.preflight import refuse_gaps
from cuspline.values.errors import DesignError

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import corpus_step  # noqa: E402

COARSE = Finish(scallop_mm=0.08, profile_tolerance_mm=0.006, gouge_mm=0.008)
FINE = Finish(scallop_mm=0.002, profile_tolerance_mm=0.001, gouge_mm=0.001)


def dished():
    """A block with a dish over its side: planes, a sphere, circles that end in corners."""
    return cq.Workplane().box(22, 16, 8).cut(cq.Workplane().sphere(12).translate((-5, 0, 13)))


def leaning_pocket():
    """A pocket with leaning walls and a round foot, whose faces the CAD kernel joins to some micrometres."""
    tool = cq.Workplane().rect(20, 14).extrude(-4, taper=15).edges("not #Z").edges("not(|X or |Y)").fillet(5)
    return cq.Workplane().box(28, 22, 12, centered=(True, True, False)).translate((0, 0, -12)).cut(
        tool.faces("<Z").edges().fillet(2.5))


def corners(solid):
    return np.array([cq.Vertex(v).toTuple() for v in brep.explore(solid, TopAbs_VERTEX)])


@pytest.mark.parametrize("by_mm", [0.0014, 0.028])
def test_vertices_beside_their_edges_are_put_back(by_mm, tmp_path):
    plain, path = brep.the_solid(dished()), tmp_path / "shaken.step"
    corpus_step.shaken(plain, path, by_mm=by_mm, seed=3)
    read = TopoDS.Solid_s(brep.explore(brep.read_step(path), brep.TopAbs_SOLID)[0])
    assert brep.loosest_tolerance_mm(read) > 0.9 * by_mm
    healed = brep.the_solid(read)
    # the second order of a vertex's distance, and what a corner of curves that touch leaves free
    assert brep.loosest_tolerance_mm(healed) < 2e-4 and brep.widest_gap(healed)[0] < 1e-4
    block = [p for p in corners(plain) if np.abs(np.abs(p) - (11, 8, 4)).max() < 1e-6]
    apart = np.linalg.norm(corners(healed)[:, None] - block, axis=2).min(axis=0)
    assert len(block) == 8 and apart.max() < 1e-4
    assert brep.volume_mm3(healed) == pytest.approx(brep.volume_mm3(plain), rel=3e-6)      # as it is integrated


def test_marks_stay_on_the_faces_of_a_healed_solid(tmp_path):
    path = tmp_path / "marked.step"
    solid = brep.the_solid(dished())
    sphere = next(f for f in brep.faces_of(solid) if f.kind == "sphere")
    corpus_step.shaken(brep.marked(solid, names=[("dish", sphere.shape)]), path, by_mm=0.01, seed=1)
    named = [f for f in brep.faces_of(brep.the_solid(brep.read_step(path))) if f.mark.name == "dish"]
    assert [f.kind for f in named] == ["sphere"]


def test_a_gap_is_measured_and_held_against_the_finish():
    solid = brep.the_solid(leaning_pocket())
    gap, place = brep.widest_gap(solid)
    assert 0.001 < gap < 0.02 and abs(place[2]) <= 4 + 1e-6
    refuse_gaps(SimpleNamespace(name="part", finish=COARSE), solid)
    with pytest.raises(DesignError, match=r"two faces are 0\.00\d+ mm apart along their edge at .* scallop_mm of at least 0\."):
        refuse_gaps(SimpleNamespace(name="part", finish=FINE), solid)
    assert brep.widest_gap(brep.the_solid(dished())) == (0.0, pytest.approx(np.zeros(3)))


def test_an_open_solid_is_refused_with_the_place(monkeypatch):
    monkeypatch.setattr(closure, "widest_gap", lambda solid: (0.4, np.array([1.0, 2.0, 3.0])))
    with pytest.raises(DesignError, match=r"is open by 0.4 mm along an edge at \(1.000, 2.000, 3.000\).*: sew its faces"):
        brep.the_solid(leaning_pocket())


def test_an_offset_surface_is_held_where_its_face_is():
    """The corner of a shelled box is the offset of a torus that turns over beyond the face."""
    box = cq.Workplane().box(26, 19, 8).edges("|Z").fillet(6).faces("<Z").edges().fillet(4)
    solid = brep.the_solid(box.faces(">Z").shell(-3))
    offsets = [f for f in brep.faces_of(solid) if f.kind == "offset"]
    assert offsets and len(brep.explore(solid, TopAbs_FACE)) > len(offsets)
    for face in offsets:
        u0, u1, v0, v1 = face.uv_bounds
        u, v = (g.ravel() for g in np.meshgrid(np.linspace(u0, u1, 5), np.linspace(v0, v1, 5)))
        exact = np.array([face.adaptor.Value(a, b).Coord() for a, b in zip(u, v)])
        assert np.abs(face.shape_at(u, v).point_mm - exact).max() < 1e-9
