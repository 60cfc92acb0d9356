"""`cuspline diff`: what differs between two folders of outputs, and nothing else."""

import json
import re
import shutil
from xml.etree import ElementTree

import pytest
from built_parts import ran

FILES = ("manifest.json", "plan.json", "verify.json", "tools.json", "setup-1.ngc")


@pytest.fixture
def revision(default_part, tmp_path):
    """revision(name=function of its text, ...): the part again, some of its files changed."""
    def made(**changes):
        folder = tmp_path / "new"
        folder.mkdir()
        for name in FILES:
            shutil.copy(default_part / name, folder)
        for stem, change in changes.items():
            path = next(folder / name for name in FILES if name.startswith(stem.replace("_", "-")))
            path.write_text(change(path.read_text()))
        return folder
    return made


def document(old, new, code):
    done = ran("diff", old, new, "--json")
    assert done.returncode == code, done.stderr
    return json.loads(done.stdout)


def edited(change):
    """A JSON text with a change made to its document."""
    def spoil(text):
        value = json.loads(text)
        change(value)
        return json.dumps(value)
    return spoil


def shifted_pass(text):
    """The program with the last pass of its last operation 0.05 mm too high."""
    *_, word = re.finditer(r"\nZ([\d.]+) F", text)
    return text[:word.start(1)] + f"{float(word[1]) + 0.05:.4f}" + text[word.end(1):]


def test_a_folder_is_the_same_as_itself(default_part, revision):
    done = ran("diff", default_part, revision())
    assert (done.returncode, done.stdout.splitlines()[1:]) == (0, ["the same"])


def test_revisions_that_differ_in_one_pass_are_said_to_differ_in_just_that(default_part, revision):
    new = revision(setup=shifted_pass)
    found = document(default_part, new, 1)
    program, = found["programs"]
    change, = program["changes"]
    last = re.findall(r"\(OPERATION \d+: ([^,]*),", (new / "setup-1.ngc").read_text())[-1].lower()
    assert found["changes"] == [] and program["other_feed_or_speed"] == {} and change["operation"] == last
    assert change["kind"] == "moved" and 0 < change["added"] <= 20 < program["moves"][0] / 50
    assert change["apart_mm"] == pytest.approx(0.05, abs=0.002)
    said = ran("diff", default_part, new).stdout.splitlines()
    assert said[1] == "programs:" and len(said) == 4 and "moved, paths up to 0.0" in said[2]
    assert said[3] == "the same: design, parameters, versions, part, verdict, findings, plan, tools, stock"


def test_a_comment_and_numbers_written_otherwise_are_no_difference(default_part, revision):
    new = revision(setup=lambda text: text.replace("\nM2", "\n(THE END)\nM2").replace("G0 Z0", "G0 Z0.000"))
    assert (new / "setup-1.ngc").read_text() != (default_part / "setup-1.ngc").read_text()
    assert document(default_part, new, 0)["same"]


def test_parameters_figures_tools_times_and_findings_are_told_with_both_values(default_part, revision):
    finding = {"kind": "gouge", "amount_mm": 0.02, "place_mm": [1, 2, 3], "operation": "finish", "line": 9, "setup": "setup-1",
               "advice": "take a smaller cutter"}
    new = revision(
        manifest=edited(lambda m: m["parameters"].update(width_mm=17.0)),
        verify=edited(lambda v: (v.update(cusp_max_mm=0.5, ok=False), v["findings"].append(finding),
                                 v["stock"][0].update(volume_mm3=1.0))),
        plan=edited(lambda p: (p["setups"][0].update(time_s=1.0), p["setups"][0]["operations"].pop())),
        tools=edited(lambda t: t["tools"][0]["holder"].update(name="another")))
    found = {(c["section"], c["what"]): (c["old"], c["new"]) for c in document(default_part, new, 1)["changes"]}
    assert found["parameters", "width_mm"] == (16.0, 17.0) and found["verdict", "ok"] == (True, False)
    assert found["verdict", "cusp_max_mm"][1] == 0.5 and found["plan", "setup-1 time_s"][1] == 1.0
    assert [new for (section, _), (_, new) in found.items() if section == "tools"] == ["another"]
    assert [new for (section, _), (_, new) in found.items() if section == "stock"] == [1.0]
    assert found["findings", "gouge in finish of setup-1"] == (None, "0.0200 mm: take a smaller cutter")
    gone = [what for (section, what), (_, new) in found.items() if section == "plan" and new is None]
    assert len(gone) == 1, gone


def test_a_pull_request_gets_a_list_and_a_picture(default_part, revision, tmp_path):
    new, picture = revision(setup=shifted_pass), tmp_path / "plan.svg"
    done = ran("diff", default_part, new, "--markdown", "--picture", picture)
    assert done.returncode == 1 and done.stdout.startswith("### new: what changed\n\n**programs**\n\n- setup-1, ")
    assert f"![changed moves in plan]({picture})" in done.stdout
    layers = [e.get("class") for e in ElementTree.parse(picture).iter() if e.get("class")]
    assert layers == ["rest", "gone", "come"]


@pytest.mark.parametrize("changes, words", [
    ({"setup": lambda text: text.replace("\nM2", "\nG999\nM2")}, "setup-1.ngc: line"),
    ({"manifest": lambda text: text.replace('"post": "linuxcnc"', '"post": "own.py"')}, "does not choose which code is run"),
    ({"verify": lambda text: text[:100]}, "verify.json")])
def test_what_cannot_be_compared_is_refused_in_a_sentence(changes, words, default_part, revision):
    done = ran("diff", default_part, revision(**changes))
    assert (done.returncode, done.stdout) == (2, "") and words in done.stderr and done.stderr.count("\n") == 1


def test_a_folder_without_outputs_is_refused(default_part, tmp_path):
    assert "it has no manifest.json" in ran("diff", default_part, tmp_path).stderr


def test_another_solid_is_said_with_its_volume_and_what_was_measured_of_it(tmp_path):
    """Volumes by closed form: boxes."""
    (tmp_path / "plug.py").write_text(PLUG)
    for name, side in (("old", 10), ("new", 11)):
        done = ran("build", tmp_path / "plug.py", "-p", f"side_mm={side}", "--stage", "step", "--out", tmp_path / name)
        assert done.returncode == 0, done.stderr
        measured = {"mass_kg": 0.0027, "figures": [{"what": "side", "measured": side}]}
        (tmp_path / name / "solid.json").write_text(json.dumps(measured))
    changes = document(tmp_path / "old", tmp_path / "new", 1)["changes"]
    found = {(c["section"], c["what"]): (c["old"], c["new"]) for c in changes}
    assert found == {("parameters", "side_mm"): (10.0, 11.0), ("part", "volume mm³"): (1000.0, 1331.0), ("part", "side"): (10, 11),
                     ("part", "X to mm"): (10.0, 11.0), ("part", "Y to mm"): (10.0, 11.0), ("part", "Z to mm"): (10.0, 11.0)}


PLUG = """import cadquery as cq
from cuspline.design import *


class P(Parameters):
    side_mm: float = 10.0


def design(p: P):
    return Design(name="plug", description="", parameters=p, solid=cq.Workplane().box(*3 * [p.side_mm], centered=False).val(),
                  material="aluminium_6061", setups=(), predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1)),),
                  stock=StockBox(min_mm=(0, 0, 0), max_mm=(12, 12, 12)),
                  finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003),
                  measure=lambda solid: SolidReport(figures=(), facts={}))
"""
