"""Operations as values: what they accept, how they are written in job files, and one part cut by eight of them."""

import json
from dataclasses import replace

import pytest
from built_parts import ran
from eight_operations import JOB, Block, design, solid
from pydantic import ValidationError

from cuspline.app.catalogue import find_design, find_library, find_machine, find_shop
from cuspline.design import Finish, Setup
from cuspline.design.operations import ToolWish, registered
from cuspline.kernel import brep
from cuspline.planning.context import PlanningContext
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.floor import Floor
from cuspline.planning.strategies.parallel import Parallel
from cuspline.shop.practice import Practice
from cuspline.values.errors import InputError, PlanError

MACHINE, LIBRARY = find_machine("mill_3axis"), find_library(None)
EXPLICIT = {"auto", "boundary", "constant_scallop", "facing", "floor", "parallel", "rest", "rough", "sections", "spiral",
            "transverse_arcs", "waterline"}


def test_every_strategy_is_found_by_standing_in_its_folder_and_has_a_picture():
    assert EXPLICIT <= set(registered())
    for kind in EXPLICIT:
        assert registered()[kind].picture.strip() and registered()[kind].__doc__
        for name, field in registered()[kind].model_fields.items():
            assert field.description or name == "section_plane", f"{kind}.{name}"


def test_the_command_lists_each_with_its_parameters(capsys):
    from cuspline.app import cli
    assert cli.run(["strategies", "--json"]) == 0
    rows = {r["kind"]: r for r in json.loads(capsys.readouterr().out)}
    assert EXPLICIT <= set(rows)
    stepover = next(p for p in rows["parallel"]["parameters"] if p["name"] == "stepover_mm")
    assert stepover["unit"] == "mm" and "100" in stepover["range"]


@pytest.mark.parametrize("wish, numbers", [
    (5, [5]), ("T5", [5]), ("flat 16", [1]), ("bull 10 r1", [4]), ("bull nose 16", [2]), ("ball <= 8", [8, 9, 10]),
    ("ball > 12", [5]), ("flat", [1, 3]), ("ball 7", [])])
def test_a_tool_is_asked_for_by_number_size_or_rule(wish, numbers):
    assert [t.number for t in LIBRARY.tools if ToolWish.of(wish).allows(t)] == numbers


@pytest.mark.parametrize("wish", ["spade 3", "ball ten", "ball <", "", "flat 16 mm"])
def test_a_wish_that_is_not_understood_is_refused_with_examples(wish):
    with pytest.raises(ValidationError, match="bull 12 r2"):
        Parallel(tool=wish)


@pytest.mark.parametrize("table, said", [
    ({"kind": "turn"}, "no operation of kind 'turn'; there are auto"),
    ({"kind": "parallel", "stepover": 1}, "parallel: stepover: there is no such key; did you mean stepover_mm"),
    ({"kind": "rough", "stepdown_mm": -1}, "rough: stepdown_mm"), ({}, "no operation of kind None")])
def test_a_wrong_table_of_a_job_file_is_refused_by_name(table, said):
    with pytest.raises(ValidationError, match=said):
        Setup(name="a", wcs_in_words="", faces=("top",), operations=(table,))


def test_the_job_file_says_the_same_as_the_python_file(tmp_path):
    brep.write_step(brep.the_solid(solid(), "block"), tmp_path / "block.step", "block")
    (tmp_path / "block.toml").write_text(JOB)
    job, part = find_design(str(tmp_path / "block.toml")).design([]), design(Block())
    assert job.setups == part.setups and job.predicates == part.predicates
    assert (job.finish, job.stock, job.material) == (part.finish, part.stock, part.material)


@pytest.fixture(scope="module")
def context():
    part = design(Block())
    return PlanningContext(part, part.setups[0], MACHINE, LIBRARY)


def test_each_operation_sees_its_own_faces_and_finish(context):
    part = context.design
    work = context.of(part.setups[0].operations[5], ())
    assert work.finish.scallop_mm == 0.04 and part.finish.scallop_mm == 0.05
    assert set(work.wanted) < set(context.wanted) and len(work.samples.area_mm2) < len(context.samples.area_mm2)


@pytest.mark.parametrize("tolerance_mm, semi_mm", [(0.01, 0.05), (0.05, 0.1)])
def test_a_semi_finish_may_leave_more_than_its_paths_tolerance(tolerance_mm, semi_mm):
    part = design(Block())
    loose = replace(part, finish=Finish(scallop_mm=0.5, profile_tolerance_mm=tolerance_mm, gouge_mm=0.05))
    assert PlanningContext(loose, loose.setups[0], MACHINE, LIBRARY).semi_scallop_mm == semi_mm


@pytest.mark.parametrize("operation, error, said", [
    (Parallel(scallop_mm=0.1), PlanError, "scallop_mm 0.1 is looser than the design's 0.05"),
    (Parallel(tool_axis=(0, 1, 0)), PlanError, "give the operation to a setup that is turned so"),
    (Parallel(tool="ball 7"), PlanError, "has no ball 7 that this operation can use; there are T1 flat 16 mm"),
    (Parallel(tool="flat 10", faces=("top",)), PlanError, "has a sharp corner"),
    (Floor(tool="bull 10 r1", faces=("wall",)), PlanError, "floor: none of the faces .* is a level plane")])
def test_what_an_operation_cannot_do_is_refused_by_name(context, operation, error, said):
    with pytest.raises(error, match=said):
        operation.plan(context.of(operation, ()))


def test_what_the_shop_decides_goes_before_the_default_and_after_the_operation(tmp_path):
    (tmp_path / "shop.toml").write_text('[practice]\nclearance_mm = 8\nramp_deg = 2\n')
    shop, rest = find_shop(tmp_path / "shop.toml", ["shop.clearance_mm=12", "width_mm=3"])
    assert rest == ["width_mm=3"] and (shop.practice.clearance_mm, shop.practice.ramp_deg) == (12.0, 2.0)
    assert shop.practice.lead_radius_mm == Practice().lead_radius_mm
    part = design(Block())
    setup = part.setups[0].model_copy(update={"operations": (Auto(clearance_mm=20.0), Auto())})
    assert PlanningContext(part, setup, MACHINE, LIBRARY, shop=shop).clearance_z_mm == 13.0 + 20.0
    with pytest.raises(InputError, match="clearence_mm: there is no such key; did you mean clearance_mm"):
        find_shop(None, ["shop.clearence_mm=1"])


def test_eight_operations_in_two_setups_cut_the_part(tmp_path):
    brep.write_step(brep.the_solid(solid(), "block"), tmp_path / "block.step", "block")
    (tmp_path / "block.toml").write_text(JOB)
    done = ran("build", tmp_path / "block.toml", "--out", tmp_path / "out", "--stage", "verify")
    assert done.returncode == 0, done.stdout + done.stderr
    plan = json.loads((tmp_path / "out" / "plan.json").read_text())
    first = plan["setups"][0]
    names = [o["name"] for o in first["operations"]]
    assert names[:8] == ["facing", "rough", "floor", "waterline", "parallel", "constant scallop", "rest", "rest fine"]
    assert [row["kind"] for row in first["listed"]] == [
        "facing", "rough", "floor", "waterline", "parallel", "constant_scallop", "rest", "rest"]
    for row in first["listed"]:
        assert row["area_left_mm2"] == pytest.approx(row["area_wanted_mm2"] - row["area_reached_mm2"], abs=2e-3)
        assert row["programmed"] and (row["why"] or row["area_left_mm2"] < 1e-3)
