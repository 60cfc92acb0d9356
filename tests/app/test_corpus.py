"""What a stranger hands in: the corpus of bench/corpus.py, one case in ten here; and what holds nothing that can be cut."""

import sys
from pathlib import Path

import cadquery as cq
import pytest

from cuspline.app import cli
from cuspline.design import StockBox
from cuspline.kernel import brep

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))

import corpus  # noqa: E402
import corpus_parts  # noqa: E402

HERE = ("loft_through_ellipses", "tray", "step_closed_within_hundredths", "revolved")


def test_there_are_two_hundred_cases_and_each_has_a_name_of_its_own():
    names = [corpus_parts.case_name(*case) for case in corpus.cases()]
    assert len(names) >= 200 and len(set(names)) == len(names)


def test_the_same_case_is_the_same_part():
    one, other = (corpus_parts.piece_of("bosses", 2) for _ in range(2))
    assert one.finish == other.finish and isinstance(one.stock, StockBox) and one.stock == other.stock
    assert brep.volume_mm3(brep.the_solid(one.solid)) == brep.volume_mm3(brep.the_solid(other.solid))


def built(path, folder, stage="step"):
    return cli.run(["build", str(path), "--out", str(folder / "out"), "--stage", stage])


@pytest.mark.parametrize("name", HERE)
def test_a_part_of_the_corpus_becomes_a_solid_that_every_stage_can_read(name, tmp_path):
    assert built(corpus_parts.write_case(name, 0, "parallel", tmp_path), tmp_path) == 0


@pytest.mark.parametrize("name,strategy", [("terraces", ""), ("revolved", "spiral"), ("holes_in_a_plate", "")])
def test_a_part_of_the_corpus_is_verified_at_the_first_try(name, strategy, tmp_path):
    assert built(corpus_parts.write_case(name, 0, strategy, tmp_path), tmp_path, "verify") == 0


def test_a_job_names_one_solid_of_several(tmp_path, capsys):
    assert built(corpus_parts.write_case("one_solid_of_two", 0, "parallel", tmp_path), tmp_path) == 0
    solid = brep.the_solid(brep.read_step(tmp_path / "out/one_solid_of_two-0-parallel.step"))
    assert brep.bounding_box_mm(solid)[1][0] < 30           # the screw stands at X60
    job = next(tmp_path.glob("*.toml"))
    job.write_text(job.read_text().replace("solid = 1", "solid = 3"))
    assert built(job, tmp_path) == 2
    assert "holds 2 solids, there is no solid 3: 1 is " in capsys.readouterr().err


def test_several_solids_are_listed_and_the_key_is_named(tmp_path, capsys):
    assert built(corpus_parts.write_case("two_solids", 0, "parallel", tmp_path), tmp_path) == 2
    told = capsys.readouterr().err
    assert "holds 2 solids" in told and "a job file names one of them with `solid`: 1 is " in told and "2 is 4 x 4 x 12 mm" in told


def test_surfaces_without_a_solid_are_refused_with_what_to_do(tmp_path, capsys):
    assert built(corpus_parts.write_case("open_shell", 0, "parallel", tmp_path), tmp_path) == 2
    assert "holds no solid, its surfaces (" in (told := capsys.readouterr().err) and "sew them to a closed solid" in told


def test_a_mesh_is_refused_with_what_to_do(tmp_path, capsys):
    path = tmp_path / "part.stl"
    cq.exporters.export(cq.Workplane().box(5, 5, 5), str(path))
    assert built(path, tmp_path) == 2
    assert "is a mesh" in (told := capsys.readouterr().err) and "export the part as STEP" in told
    job = corpus_parts.write_case("step_in_inches", 0, "parallel", tmp_path)
    job.write_text(job.read_text().replace("step_in_inches-0-parallel.step", "part.stl"))
    assert built(job, tmp_path) == 2 and "is a mesh" in capsys.readouterr().err
