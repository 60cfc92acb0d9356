"""Parts with what troubles path planners, cut end to end: planned, posted, read back, simulated, compared."""

import hashlib
import json

import cadquery as cq
import pytest
from troublesome_parts import FINISH, PARTS, design_of, two_sided

from cuspline.app import build as build_stages
from cuspline.app import catalogue
from cuspline.app.build import Order, build
from cuspline.app.outcome import Result
from cuspline.app.request import Request
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.kernel import brep
from cuspline.values.errors import CutterDoesNotFit, DesignError, PlanError
from cuspline.values.findings import Finding

STRATEGIES = {"knife_edge": "parallel", "pole_and_apex": "constant_scallop", "closed_face": "boundary",
              "slivers": "parallel", "hole_and_islands": "constant_scallop"}
LARGEST_CUSP_MM = FINISH.scallop_mm + FINISH.profile_tolerance_mm


def built(design, folder):
    """(Result, verify.json, plan.json) of a build to the verdict."""
    result = build(Order(source=None, design=design, accepted=(), out=folder, machine=catalogue.find_machine("mill_3axis"),
                         library=catalogue.find_library(None), last_stage="verify"))
    return (result, *(json.loads((result.folder / f"{name}.json").read_text()) for name in ("verify", "plan")))


@pytest.mark.parametrize("name", list(PARTS))
def test_the_posted_program_cuts_the_part(name, tmp_path):
    result, verify, _ = built(design_of(name, STRATEGIES[name]), tmp_path / name)
    assert result.findings == () and verify["ok"]
    assert verify["gouge_max_mm"] <= FINISH.gouge_mm and verify["cusp_max_mm"] <= LARGEST_CUSP_MM
    # what is not reached is listed with its reason, and there is nothing else
    assert verify["area_required_mm2"] == pytest.approx(verify["area_reached_mm2"] + verify["area_unreachable_mm2"], abs=0.02)


def test_a_part_cut_from_both_sides(tmp_path):
    """The second clamping's roughing begins with what the first has left, and the stock after every operation is kept."""
    result, verify, plan = built(two_sided(), tmp_path / "two_sided")
    assert result.findings == () and verify["ok"] and len(verify["setups"]) == 2
    assert all(0.5 * FINISH.scallop_mm < s["cusp_max_mm"] <= LARGEST_CUSP_MM and s["gouge_max_mm"] <= FINISH.gouge_mm
               for s in verify["setups"])
    volumes = [row["volume_mm3"] for row in verify["stock"]]
    assert volumes == sorted(volumes, reverse=True) and volumes[0] < 30 * 20 * 9
    for row in verify["stock"]:
        assert hashlib.sha256((result.folder / row["file"]).read_bytes()).hexdigest() == row["sha256"]
    # places in plan.json are the part's: the bottom's hollow is below
    tops = [s["operations"][-1]["min_concave_place_mm"][2] for s in plan["setups"]]
    assert tops[0] > 0 > tops[1]


def test_where_no_cutters_are_named_smaller_ones_than_the_usual_are_taken_for_a_gap_that_these_do_not_enter(tmp_path):
    """A groove of 3.4 mm with a round foot: the usual balls begin at 4 mm, the library of the smallest at 2."""
    block = cq.Workplane().box(14, 10, 6).cut(cq.Workplane().box(20, 3.4, 4).edges("|X").fillet(1.2).translate((0, 0, 3)))
    groove = FacePredicate(name="groove", at_least=3, center_min_mm=(-6.9, -4.9, 0.9), center_max_mm=(6.9, 4.9, 2.9))
    design = Design(name="groove", description="groove", parameters=Parameters(), solid=block, predicates=(groove,),
                    material="aluminium_6061", stock=StockBox(min_mm=(-7, -5, -3), max_mm=(7, 5, 3)),
                    finish=Finish(scallop_mm=0.08, profile_tolerance_mm=0.01, gouge_mm=0.01),
                    setups=(Setup(name="setup-1", faces=("groove",), wcs_in_words="middle"),))
    told = []
    _, result = Request(design=design, stage="plan", out=tmp_path / "groove").built(told.append)
    operations = json.loads((result.folder / "plan.json").read_text())["setups"][0]["operations"]
    assert {o["tool"]["name"] for o in operations} == {"ball 2 mm"}
    assert sum("planned again with smaller ones" in line for line in told) == 2     # not by flat ones for slots alone
    with pytest.raises(CutterDoesNotFit, match="narrower than the smallest, radius 2.000 mm"):
        Request(design=design, stage="plan", cutters="tools", out=tmp_path / "groove").built()


@pytest.mark.parametrize("is_refused", [True, False])
def test_smaller_cutters_that_were_taken_for_a_gap_alone_are_given_up_where_something_is_wrong_with_them(
        is_refused, tmp_path, monkeypatch):
    """The stages are stood in for: what is tried one after the other, each time after the files of the time before are gone."""
    tried, told = [], []

    def programmed(order, work, *_):
        assert not (work / "plan.json").exists()
        (work / "plan.json").write_text("{}")
        tried.append(order)
        if order.for_all and not order.leaves:
            raise build_stages._FaceLeft(build_stages.GAPS, order.spare)
        if is_refused and not order.leaves:
            raise PlanError("the smallest breaks")
        return Result(folder=work, is_ok=bool(order.leaves), findings=())

    monkeypatch.setattr(build_stages, "_programmed", programmed)
    _, result = Request(design=two_sided(), stage="plan", out=tmp_path / "part").built(told.append)
    usual, *_, smallest, again = tried
    assert len(tried) == 4 and result.is_ok and usual.for_all and not smallest.for_all and not usual.leaves
    assert (again.library, again.spare, again.leaves) == (tried[1].library, tried[1].spare, build_stages.GAPS)
    assert [line.split("planned again ")[1].split(",")[0] for line in told if "planned again" in line] == [
        "with smaller ones beside them"] * 2 + ["without them"]


def finding_of(kind):
    return Finding(kind=kind, amount_mm=1.0, place_mm=None, operation="", line=0, setup="", advice="")


@pytest.mark.parametrize("kinds, is_kept", [(("excess", "face_not_cut"), True), (("excess", "shank_contact"), False)])
def test_smaller_cutters_that_were_taken_for_a_face_are_given_up_where_more_is_wrong_than_what_they_leave(
        kinds, is_kept, tmp_path, monkeypatch):
    tried = []

    def programmed(order, work, *_):
        tried.append(order)
        if order.for_all and not order.leaves:
            raise build_stages._FaceLeft(build_stages.FACES, order.spare)
        kept = ("face_not_cut",) if order.leaves else kinds
        return Result(folder=work, is_ok=False, findings=tuple(map(finding_of, kept)))

    monkeypatch.setattr(build_stages, "_programmed", programmed)
    _, result = Request(design=two_sided(), stage="plan", out=tmp_path / "part").built()
    assert [f.kind for f in result.findings] == (list(kinds) if is_kept else ["face_not_cut"])
    assert tried[-1].leaves == ("" if is_kept else build_stages.FACES)


def test_where_smaller_cutters_cut_a_face_and_leave_a_gap_these_are_gone_back_to(tmp_path, monkeypatch):
    """The last cutters break; the gap was left by those before them, the face by the usual ones."""
    tried = []

    def programmed(order, work, *_):
        tried.append(order)
        left = [build_stages.FACES, build_stages.GAPS]
        if order.for_all and not order.leaves:
            raise build_stages._FaceLeft(left[len(tried) - 1], order.spare)
        return Result(folder=work, is_ok=bool(order.leaves), findings=(finding_of("overload"),))

    monkeypatch.setattr(build_stages, "_programmed", programmed)
    _, result = Request(design=two_sided(), stage="plan", out=tmp_path / "part").built()
    assert result.is_ok and (tried[-1].library, tried[-1].leaves) == (tried[1].library, build_stages.GAPS)


def test_several_solids_and_an_open_shell_are_refused_by_name():
    two = cq.Workplane().box(4, 4, 4).union(cq.Workplane().box(4, 4, 4).translate((9, 0, 0)))
    with pytest.raises(DesignError, match="bracket holds 2 solids, it must be exactly one"):
        brep.the_solid(two, "bracket")
    shell = cq.Shell.makeShell([f for f in cq.Workplane().box(4, 4, 4).faces().vals()][:5])
    with pytest.raises(DesignError, match="bracket holds 0 solids, it must be exactly one: close its shell"):
        brep.the_solid(shell, "bracket")
