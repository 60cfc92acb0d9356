"""`cuspline verify` says all it knows: figures, what was accepted, files that changed; it goes on after a refusal."""

import functools
import hashlib
import json
import os
import re
import signal
import sys

import pytest
from built_parts import copied
from sabotage_bases import COARSE, bases
from troublesome_parts import bow_tie

from cuspline.app import cli
from cuspline.app import judge as judging
from cuspline.design.job import digest_of, job_line, read_job, read_published
from cuspline.kernel import brep
from cuspline.verification.file_checks import changed_job

GOUGE_MM = 0.05
JOB_LINE = re.compile("JOB SHA-256 [0-9a-f]+")


@pytest.fixture(scope="module")
def boss(tmp_path_factory):
    """A base with the manifest of a published folder."""
    base = bases(tmp_path_factory.mktemp("bases"))["boss-mm"]
    published(base.folder)
    return base


def published(folder, change=lambda job: None):
    """Have a folder say that it was published with this job, changed by change(job), and these files."""
    path, program = folder / "manifest.json", folder / "setup-1.ngc"
    job = json.loads(path.read_text())["job"]
    change(job)
    program.write_text(JOB_LINE.sub(job_line(digest_of(job)), program.read_text()))
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir() if p != path}
    path.write_text(json.dumps({"files": files, "job": job, "job_sha256": {k: digest_of(v) for k, v in job.items()}}))


def in_manifest(folder, change):
    """Edit a folder's manifest and nothing else: change(manifest)."""
    manifest = json.loads((folder / "manifest.json").read_text())
    change(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.fixture
def verify(monkeypatch, capsys):
    """`cuspline verify ...` -> (exit code, standard output, messages), looked at coarsely."""
    monkeypatch.setattr(judging, "judge", functools.partial(judging.judge, options=COARSE))

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["cuspline", "verify", *map(str, arguments)])
        with pytest.raises(SystemExit) as done:
            cli.main()
        said = capsys.readouterr()
        return done.value.code, said.out, [line for line in said.err.splitlines() if not line.startswith("  ")]
    return call


def edited(base, folder, change):
    """A copy whose program is changed: change(text) -> text."""
    copied(base.folder, folder)
    (folder / "setup-1.ngc").write_text(change((base.folder / "setup-1.ngc").read_text()))
    return folder


def sunk(text):
    """The strip's passes GOUGE_MM too deep."""
    begin = text.index("(OPERATION 2")
    return text[:begin] + re.sub(r"\bZ6\b", f"Z{6 - GOUGE_MM:g}", text[begin:])


def test_verified_says_gouge_cusp_and_bound(boss, verify):
    code, out, _ = verify(boss.folder)
    assert code == 0 and re.match(r"boss: VERIFIED, gouge 0\.00\d\d, cusp 0\.0\d{3}, error bound 0\.00105 mm \(", out)


def test_a_changed_program_is_judged_and_named(boss, verify, tmp_path):
    code, out, _ = verify(edited(boss, tmp_path / "a", lambda text: text + "(BY HAND)\n"))
    assert code == 1 and "REJECTED, 1 finding," in out
    assert "changed_file: setup-1.ngc is not the file that was published" in out
    code, out, _ = verify(edited(boss, tmp_path / "b", sunk))
    assert code == 1 and "changed_file" in out and f"gouge {GOUGE_MM:.4f} mm" in out


def test_a_kind_accepted_for_this_time_is_told(boss, verify, tmp_path):
    folder = edited(boss, tmp_path / "a", lambda text: text + "(BY HAND)\n")
    code, out, _ = verify(folder, "--accept", "changed_file")
    assert code == 0 and "VERIFIED with 1 accepted finding, gouge" in out and "  accepted: changed_file: setup-1.ngc" in out


def test_what_the_manifest_accepts_is_told(boss, verify, tmp_path):
    folder = edited(boss, tmp_path / "a", sunk)
    published(folder, lambda job: job.update(accepted=["gouge"]))
    code, out, _ = verify(folder)
    assert code == 0 and "boss: VERIFIED with " in out and f"accepted: gouge {GOUGE_MM:.4f} mm" in out


def loosened(manifest):
    manifest["job"]["finish"]["gouge_mm"] = 2 * GOUGE_MM


def loosened_with_its_hash(manifest):
    loosened(manifest)
    manifest["job_sha256"]["finish"] = digest_of(manifest["job"]["finish"])


def loosened_without_any_hash(manifest):
    loosened(manifest)
    del manifest["job_sha256"]


@pytest.mark.parametrize("change, words", [
    (loosened, "what its job says of finish is not what was published"),
    (loosened_with_its_hash, "its job is not the one that setup-1.ngc was posted for"),
    (loosened_without_any_hash, "its job is not the one that setup-1.ngc was posted for"),
    (lambda manifest: manifest["job"].update(material="aluminium_7075"), "what its job says of material"),
    (lambda manifest: manifest["job"].pop("accepted"), "what its job says of accepted")])
def test_a_job_that_is_not_the_published_one_is_named(boss, tmp_path, change, words):
    folder = edited(boss, tmp_path / "a", lambda text: text)
    assert not list(changed_job(folder, read_job(folder), read_published(folder)))
    in_manifest(folder, change)
    (found,) = changed_job(folder, read_job(folder), read_published(folder))
    assert found.kind == "changed_file" and found.advice.startswith("manifest.json: ") and words in found.advice


def test_a_program_that_has_lost_the_hash_of_its_job_does_not_hide_a_changed_one(boss, tmp_path):
    folder = edited(boss, tmp_path / "a", lambda text: JOB_LINE.sub("BY HAND", text))
    in_manifest(folder, loosened_with_its_hash)
    (found,) = changed_job(folder, read_job(folder), read_published(folder))
    assert "manifest.json: its job is not the one that setup-1.ngc" in found.advice


def test_what_a_changed_manifest_accepts_does_not_count(boss, verify, tmp_path):
    folder = edited(boss, tmp_path / "a", sunk)
    in_manifest(folder, lambda manifest: manifest["job"].update(accepted=["gouge", "changed_file"]))
    code, out, _ = verify(folder)
    assert code == 1 and "changed_file: manifest.json: what its job says of accepted" in out and "\n  gouge" in out
    assert verify(folder, "--accept", "changed_file", "--accept", "gouge")[0] == 0


@pytest.mark.parametrize("name", ["manifest.json", "tools.json", "tools.tbl", "setup-1.ngc", "boss.step"])
def test_a_pipe_among_the_files_is_refused(boss, verify, tmp_path, name):
    folder = edited(boss, tmp_path / "a", lambda text: text)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    signal.alarm(20)            # instead of waiting for ever
    code, _, (message,) = verify(folder)
    signal.alarm(0)
    assert code == 2 and f"{name} is a pipe or a device, not a regular file" in message


def test_a_step_file_whose_solid_crosses_itself_is_refused(boss, verify, tmp_path):
    folder = edited(boss, tmp_path / "a", lambda text: text)
    brep.write_step(bow_tie(low_mm=6), folder / boss.job.step, "boss")
    code, _, (message,) = verify(folder)
    assert code == 2 and "the solid in boss.step crosses itself" in message


def test_it_goes_on_after_a_refusal_and_ends_with_the_worst(boss, verify, tmp_path):
    changed = edited(boss, tmp_path / "changed", lambda text: text + "(BY HAND)\n")
    (tmp_path / "nothing").mkdir()
    code, out, messages = verify(tmp_path / "nothing", changed, boss.folder)
    assert code == 2 and len(messages) == 1 and "nothing" in messages[0]
    assert out.count("REJECTED") == out.count("VERIFIED") == 1


@pytest.mark.parametrize("change, words", [
    (lambda text: text.replace("G0 X-4 Y-1", "G0 X1000000000 Y-1", 1), ("setup-1.ngc", "line 14", "X1e+09 mm",
                                                                        "beyond")),
    (lambda text: "G21\nG17 G90 G94 G40 G49\nG64 P0.001\nG54\nM2\n", ("setup-1.ngc", "no move"))])
def test_what_cannot_be_simulated_is_refused_at_once(boss, verify, tmp_path, change, words):
    code, _, (message,) = verify(edited(boss, tmp_path / "far", change))
    assert code == 2 and all(word in message for word in words)


def test_one_program_of_a_folder_is_held_against_its_own_files_only(boss, verify, tmp_path):
    folder = edited(boss, tmp_path / "a", lambda text: text)
    in_manifest(folder, lambda manifest: manifest["files"].update({"report.html": "0" * 64}))
    assert verify(folder / "setup-1.ngc")[0] == 0
    assert "report.html was published and is missing" in verify(folder)[1]


def test_every_finding_of_verify_json_says_whether_it_was_accepted(boss, tmp_path):
    folder = edited(boss, tmp_path / "a", sunk)
    job = boss.job
    verify = judging.judge(folder, job, options=COARSE).as_dict(("gouge",))
    assert verify["ok"] and verify["findings"] and all(f["accepted"] for f in verify["findings"])
    assert all(f["accepted"] for setup in verify["setups"] for f in setup["findings"])


def test_the_bound_is_none_where_the_text_sets_no_path_tolerance(boss, tmp_path):
    folder = edited(boss, tmp_path / "a", lambda text: text.replace("G64 P0.0005 Q0\n", ""))
    found = judging.judge(folder, boss.job, options=COARSE)
    assert found.as_dict(())["error_bound_mm"] is None and "bound unknown" in found.figures_in_words
    wide = edited(boss, tmp_path / "b", lambda text: text.replace("G64 P0.0005 Q0", "G64 P0.5"))
    assert judging.judge(wide, boss.job, options=COARSE).as_dict(())["error_bound_mm"] == pytest.approx(1.5, abs=1e-4)
