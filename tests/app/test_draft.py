"""`cuspline build --draft`: a first look at what the program would cut; beside the outputs, never among them."""

import json

import pytest
from built_parts import copied, ran, saddle_job

from cuspline.app import catalogue
from cuspline.app.build import DRAFT_OPTIONS
from cuspline.app.judge import begun
from cuspline.design.job import read_job

SAME_MM = 0.01


def draft_of(folder, *arguments, **changes):
    """(exit code, what was said, draft.json or None) of a draft beside `out`."""
    done = ran("build", saddle_job(folder, **changes), "--draft", "--out", folder / "out", *arguments)
    path = folder / "out-draft" / "draft.json"
    return done, json.loads(path.read_text()) if path.is_file() else None


def test_a_draft_tells_what_the_verdict_tells_and_touches_nothing_published(saddle, tmp_path):
    out = copied(saddle, tmp_path / "out")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    done, found = draft_of(tmp_path)
    verify = json.loads((saddle / "verify.json").read_text())
    assert done.returncode == 0 and "Draft, nothing proven: gouge" in done.stdout and found["ok"] and found["draft"]
    for name in ("gouge_max_mm", "excess_max_mm", "cusp_max_mm"):
        assert found[name] == pytest.approx(verify[name], abs=SAME_MM)
    assert found["area_required_mm2"] == pytest.approx(verify["area_required_mm2"], abs=0.01)
    assert 0 < found["points_checked"] < 0.5 * verify["points_checked"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    text = (tmp_path / "out-draft" / "setup-1.ngc").read_text()
    assert "(DRAFT, NOTHING PROVEN: GOUGE" in text and "VERDICT" not in text
    assert not (tmp_path / "out-draft" / "verify.json").exists()


def test_a_draft_finds_what_is_wrong_with_program_and_tools_and_stays_in_its_own_folder(tmp_path):
    machine = tmp_path / "small.toml"
    text = (catalogue.POSTS / "machines" / "mill_3axis.toml").read_text()
    machine.write_text(text.replace("program_store_bytes = 4000000", "program_store_bytes = 1000"))
    done, found = draft_of(tmp_path, "--machine", machine)
    assert done.returncode == 1 and {f["kind"] for f in found["findings"]} == {"program_too_long"} and not found["ok"]
    folder = tmp_path / "out-draft"
    assert not (tmp_path / "out-draft-rejected").exists()
    tools = json.loads((folder / "tools.json").read_text())
    for cutter in (tool["cutter"] for tool in tools["tools"] if tool["cutter"]["type"] == "ball"):
        cutter["diameter_mm"] += 0.1
        cutter["corner_radius_mm"] += 0.05
    (folder / "tools.json").write_text(json.dumps(tools))
    kinds = {f.kind for f in begun(folder, read_job(folder), options=DRAFT_OPTIONS).drafted().findings}
    assert "gouge" in kinds


@pytest.mark.parametrize("arguments, words", [
    (("--stage", "gcode"), "--draft with --stage gcode"),
    ((), "no setup"),
])
def test_a_draft_that_cannot_be_is_refused(tmp_path, arguments, words):
    name = "propeller" if not arguments else saddle_job(tmp_path)
    done = ran("build", name, "--draft", "--out", tmp_path / "out", *arguments)
    assert done.returncode == 2 and words in done.stderr and not (tmp_path / "out-draft").exists()


@pytest.mark.parametrize("stated, code", [("3f70b92a", 0), ("two words", 2)])
def test_a_stated_revision_stands_in_header_and_manifest(tmp_path, monkeypatch, stated, code):
    monkeypatch.setenv("CUSPLINE_REVISION", stated)
    done = ran("build", saddle_job(tmp_path), "--stage", "gcode", "--out", tmp_path / "out")
    assert done.returncode == code
    if code:
        assert "CUSPLINE_REVISION 'two words'" in done.stderr
        return
    assert f"(REVISION {stated})" in (tmp_path / "out" / "setup-1.ngc").read_text()
    assert json.loads((tmp_path / "out" / "manifest.json").read_text())["revision"] == stated
