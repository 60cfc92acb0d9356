"""Solids, faces by what they are, STEP with the same bytes every time."""

import hashlib
import subprocess
import sys

import build123d
import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shell, TopoDS_Solid

from cuspline.design import FacePredicate
from cuspline.kernel import brep
from cuspline.kernel.brep import (
    bounding_box_mm,
    edges_of_faces,
    edges_with_faces,
    explore,
    faces_of,
    planning_mesh,
    read_step,
    select_faces,
    the_solid,
    volume_mm3,
    write_step,
)
from cuspline.values.errors import DesignError, InputError


def box():
    return cq.Workplane("XY").box(30, 20, 10)


def drilled():
    return box().faces(">Z").workplane().hole(6).edges("|Z").edges(">X and >Y").fillet(3)


# one solid --------------------------------------------------------------------------------------------


def test_shapes_of_both_libraries_and_of_the_kernel_are_taken():
    for shape in (box(), box().val(), box().val().wrapped, build123d.Box(30, 20, 10)):
        assert volume_mm3(the_solid(shape)) == pytest.approx(6000)


def test_two_solids_are_refused_with_their_number():
    two = box().add(cq.Workplane("XY").box(1, 1, 1).translate((50, 0, 0))).combine(glue=True)
    with pytest.raises(DesignError, match="the clamp holds 2 solids.*fuse them"):
        the_solid(two, "the clamp")


def test_a_shell_without_a_solid_is_refused():
    with pytest.raises(DesignError, match="0 solids.*close its shell"):
        the_solid(cq.Shell.makeShell(box().faces().vals()[:5]))


def test_an_open_solid_is_refused():
    # a solid made of five of a box's six faces
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in explore(box().val().wrapped, TopAbs_FACE)[:5]:
        builder.Add(shell, face)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    with pytest.raises(DesignError, match="open|valid"):
        the_solid(solid)


def test_an_inside_out_solid_is_refused():
    with pytest.raises(DesignError, match="inside out|valid"):
        the_solid(box().val().wrapped.Reversed())


def test_volume_and_box_are_exact():
    solid = the_solid(cq.Workplane("XY").sphere(10))
    assert volume_mm3(solid) == pytest.approx(4 / 3 * np.pi * 1000, rel=1e-9)
    low, high = bounding_box_mm(solid)
    np.testing.assert_allclose((low, high), (np.full(3, -10), np.full(3, 10)), atol=1e-6)


def test_every_edge_of_a_box_lies_between_two_faces():
    rows = edges_with_faces(the_solid(box()))
    assert len(rows) == 12 and all(len(faces) == 2 for _, faces in rows)


def test_a_seam_is_used_twice_by_its_face_and_an_apex_is_an_edge_on_demand():
    cone = faces_of(the_solid(cq.Workplane(obj=cq.Solid.makeCone(5, 0, 8))))
    side = next(k for k, face in enumerate(cone) if face.kind == "cone")
    uses = [sorted(index for index, _ in use) for use in edges_of_faces(cone)]
    assert sorted(uses) == sorted([[0, 1], [side, side]])       # the base's rim, the seam
    apex = [use for use in edges_of_faces(cone, with_points=True) if BRep_Tool.Degenerated_s(use[0][1])]
    assert [[index for index, _ in use] for use in apex] == [[side]]


# faces by predicates ----------------------------------------------------------------------------------


@pytest.mark.parametrize("conditions, count", [
    ({"kinds": ("plane",)}, 6), ({"kinds": ("cylinder",)}, 2), ({"normal": (0, 0, 1)}, 1),
    ({"normal": (0, 0, 5), "normal_within_deg": 95.0}, 7), ({"center_min_mm": (14.9, -20, -20)}, 1),
    ({"center_max_mm": (20, 20, -4.9)}, 1), ({"area_min_mm2": 500.0}, 2), ({"area_max_mm2": 100.0}, 1),
    ({"kinds": ("cylinder",), "area_min_mm2": 100.0}, 1)])
def test_predicates_choose_faces_by_what_they_are(conditions, count):
    faces = faces_of(the_solid(drilled()))
    assert len(select_faces(faces, FacePredicate(name="these", count=count, **conditions))) == count


@pytest.mark.parametrize("count", [1, 3])
def test_another_number_of_faces_is_an_error_with_name_and_counts(count):
    faces = faces_of(the_solid(drilled()))
    with pytest.raises(DesignError, match=f"'bores' matches 2 of 8 faces, it says {count}.*cylinder"):
        select_faces(faces, FacePredicate(name="bores", count=count, kinds=("cylinder",)))


def test_a_predicate_without_a_condition_is_refused():
    with pytest.raises(ValueError, match="'all' has no condition"):
        FacePredicate(name="all", count=6)


def test_a_predicate_does_not_depend_on_the_order_of_faces():
    faces = faces_of(the_solid(drilled()))
    top = FacePredicate(name="top", count=1, normal=(0, 0, 1))
    assert select_faces(faces, top)[0] is select_faces(faces[::-1], top)[0]


# planning mesh ----------------------------------------------------------------------------------------


def test_the_planning_mesh_keeps_its_deflection_and_the_volume():
    mesh = planning_mesh(the_solid(cq.Workplane("XY").sphere(10)), 0.01)
    deviation = 10 - np.linalg.norm(mesh.vertices_mm[mesh.triangles].mean(axis=1), axis=1)
    assert 0 <= deviation.min() and deviation.max() < 0.03         # OCCT takes up to three times what is asked
    corners = mesh.vertices_mm[mesh.triangles]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * 1000, rel=3e-3)


# STEP -------------------------------------------------------------------------------------------------

WRITE = """
import cadquery as cq, sys
from pathlib import Path
from cuspline.kernel.brep import the_solid, write_step
part = cq.Workplane("XY").box(30, 20, 10).faces(">Z").workplane().hole(6).edges("|Z").edges(">X and >Y").fillet(3)
write_step(the_solid(part), Path(sys.argv[1]), "plate")
"""


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_step_has_the_same_bytes_twice_and_in_another_process(tmp_path):
    solid = the_solid(drilled())
    for name in ("a.step", "b.step"):
        write_step(solid, tmp_path / name, "plate")
        write_step(the_solid(box()), tmp_path / "other.step", "other")      # the kernel counts what it writes
    subprocess.run([sys.executable, "-c", WRITE, str(tmp_path / "c.step")], check=True, timeout=60)
    assert digest(tmp_path / "a.step") == digest(tmp_path / "b.step") == digest(tmp_path / "c.step")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.step", "b.step", "c.step", "other.step"]


def test_step_says_its_name_and_units_and_no_clock(tmp_path):
    write_step(the_solid(drilled()), tmp_path / "a.step", "plate")
    text = (tmp_path / "a.step").read_text()
    assert "FILE_NAME('plate','2000-01-01T00:00:00'" in text and "PRODUCT('plate','plate'" in text
    assert "SI_UNIT(.MILLI.,.METRE.)" in text


def test_step_reads_back_alike_in_cadquery_build123d_and_here(tmp_path):
    path = tmp_path / "a.step"
    solid = the_solid(drilled())
    write_step(solid, path, "plate")
    volumes = [volume_mm3(the_solid(cq.importers.importStep(str(path)))),
               volume_mm3(the_solid(build123d.import_step(str(path)))), volume_mm3(the_solid(read_step(path)))]
    assert volumes == pytest.approx([volume_mm3(solid)] * 3, rel=1e-9)
    assert len(cq.importers.importStep(str(path)).solids().vals()) == 1
    assert len(build123d.import_step(str(path)).solids()) == 1


def test_step_files_that_cannot_be_used_are_refused_with_the_reason(tmp_path):
    with pytest.raises(InputError, match="nowhere.step does not exist"):
        read_step(tmp_path / "nowhere.step")
    (tmp_path / "broken.step").write_text("ISO-10303-21; this is no STEP file")
    with pytest.raises(InputError, match="not a readable STEP file"):
        read_step(tmp_path / "broken.step")
    cq.exporters.export(cq.Workplane(obj=box().faces(">Z").val()), str(tmp_path / "face.step"))
    with pytest.raises(InputError, match="holds no solid"):
        read_step(tmp_path / "face.step")


def test_a_loft_of_ellipses_read_from_step_is_no_division_by_zero(tmp_path):
    """A closed polynomial surface: the weights that the CAD kernel gives of it may be no numbers."""
    solid = (cq.Workplane().ellipse(9, 7).workplane(offset=2).ellipse(7, 5).workplane(offset=2).ellipse(4, 3).loft())
    brep.write_step(brep.the_solid(solid), tmp_path / "loft.step", "loft")
    faces = brep.faces_of(brep.the_solid(brep.read_step(tmp_path / "loft.step")))
    side = next(f for f in faces if f.kind == "bspline")
    assert np.isfinite(side.nurbs.poles).all() and (side.nurbs.poles[..., 3] == 1).all()
    u0, u1, v0, v1 = side.uv_bounds
    exact = side.adaptor.Value(0.3 * u0 + 0.7 * u1, 0.4 * v0 + 0.6 * v1).Coord()
    assert side.shape_at(0.3 * u0 + 0.7 * u1, 0.4 * v0 + 0.6 * v1).point_mm[0] == pytest.approx(exact, abs=1e-9)


def test_an_arc_turned_round_an_axis_that_it_crosses_survives_a_step_file(tmp_path):
    """The arc's circle goes on beyond the axis: a face turned from it loses its pole on its way through STEP."""
    profile = cq.Workplane("XZ").moveTo(0, -8).lineTo(11, -8).lineTo(11, 0).threePointArc((7.7, 1.9), (0, 3.5)).close()
    solid = brep.the_solid(profile.revolve(360, (0, 0), (0, 1)))
    brep.write_step(brep.storable(solid), tmp_path / "dome.step", "dome")
    again = brep.the_solid(brep.read_step(tmp_path / "dome.step"))
    assert sorted(f.kind for f in brep.faces_of(again)) == ["bspline", "cylinder", "plane"]
    assert brep.volume_mm3(again) == pytest.approx(brep.volume_mm3(solid), rel=1e-5)      # as it is integrated


@pytest.mark.parametrize("count", [1, 2])
def test_a_closed_shell_written_without_its_solid_is_one(tmp_path, count):
    shells = [s.Shells()[0] for s in (cq.Workplane().box(9, 7, 5).val(), cq.Workplane().sphere(3).translate((30, 0, 0)).val())]
    cq.exporters.export(cq.Workplane(obj=cq.Compound.makeCompound(shells[:count])), str(tmp_path / "shell.step"))
    shape = brep.read_step(tmp_path / "shell.step")
    assert len(brep.explore(shape, TopAbs_SOLID)) == count
    if count == 1:
        assert brep.volume_mm3(brep.the_solid(shape)) == pytest.approx(9 * 7 * 5)
