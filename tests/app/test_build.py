"""What a build leaves on disk: the contract's files, the same bytes again, nothing half-done."""

import hashlib
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from built_parts import NARROW, copied, cuspline, ran, saddle_job

from cuspline.app import catalogue
from cuspline.app import judge as judging
from cuspline.app.judge import judge
from cuspline.design.job import read_job, read_tools
from cuspline.planning.feeds import arc_shape
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind

CHORD_MM = 0.0025
VERIFY_KEYS = {"ok", "gouge_max_mm", "excess_max_mm", "cusp_max_mm", "cusp_p99_mm", "gouge_volume_mm3", "excess_volume_mm3",
               "gouge_volume_bound_mm3", "excess_volume_bound_mm3",
               "error_bound_mm", "points_checked", "area_required_mm2", "area_reached_mm2", "collisions", "findings"}
OPERATION_KEYS = {"name", "tool", "spindle_rpm", "feed_mm_per_min", "time_s", "length_mm", "blocks", "candidates"}
TOOL_KEYS = {"number", "type", "diameter_mm", "corner_radius_mm", "flute_length_mm", "holder"}
MANIFEST_KEYS = {"design", "parameters", "versions", "files", "inputs_sha256", "machine", "job"}


def read(path):
    return json.loads(path.read_text())


def bytes_of(folder):
    """{file name: SHA-256}."""
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()}


@pytest.fixture(scope="module")
def moves(default_part):
    tools = read_tools(default_part)
    return read_program((default_part / "setup-1.ngc").read_text(), tool_lengths={n: t.length_mm for n, t in tools.items()},
                        work_offsets={"G54": read_job(default_part).machine.wcs_origin_mm})


# files ----------------------------------------------------------------------------------------------


def test_the_files_of_the_contract_are_there(default_part):
    names = {p.name for p in default_part.iterdir()}
    assert {"z_profile.step", "z_profile.glb", "z_profile.deviation.ply", "setup-1.ngc", "tools.tbl", "tools.json",
            "plan.json", "verify.json", "tools.dropped.json", "manifest.json",
            *(f"setup-1.stock-{k}.stl" for k in (1, 2, 3, 4))} == names


def test_the_json_files_have_the_keys_of_the_contract(default_part):
    verify, plan, manifest = (read(default_part / f"{n}.json") for n in ("verify", "plan", "manifest"))
    assert VERIFY_KEYS <= verify.keys() and all(VERIFY_KEYS <= s.keys() for s in verify["setups"])
    assert MANIFEST_KEYS <= manifest.keys()
    for operation in plan["setups"][0]["operations"]:
        assert OPERATION_KEYS <= operation.keys() and TOOL_KEYS <= operation["tool"].keys()
    finish = next(o for o in plan["setups"][0]["operations"] if o["name"] == "finish")
    assert any(not c["chosen"] and c["reason"] for c in finish["candidates"])


def test_the_manifest_holds_the_hash_of_every_other_file(default_part):
    found = bytes_of(default_part)
    del found["manifest.json"]
    assert read(default_part / "manifest.json")["files"] == found


# the default part ---------------------------------------------------------------------------------------


def test_the_default_part_keeps_what_the_issue_asks(default_part):
    verify = read(default_part / "verify.json")
    print({k: verify[k] for k in ("gouge_max_mm", "cusp_max_mm", "area_required_mm2", "area_reached_mm2",
                                  "area_unreachable_mm2")})
    assert verify["ok"] and verify["findings"] == [] and verify["collisions"] == []
    assert verify["gouge_max_mm"] <= 0.003 and verify["cusp_max_mm"] <= 0.0105
    assert verify["area_reached_mm2"] == pytest.approx(verify["area_required_mm2"] - verify["area_unreachable_mm2"], abs=0.01)
    assert sum(p["area_mm2"] for p in verify["unreachable"]) == pytest.approx(verify["area_unreachable_mm2"], abs=0.01)
    assert read(default_part / "plan.json")["min_concave_radius_mm"] == pytest.approx(6.0, abs=1e-6)


def finishing_rows(moves):
    names = [i for i, n in enumerate(moves.operations) if n in ("finish", "rest finish")]
    return np.flatnonzero((moves.kind != Kind.RAPID) & np.isin(moves.operation, names))


def test_arc_faces_are_cut_by_arcs(moves):
    """Convex arc x < 33.26, z > 15; concave arc 33.7 < x < 39.54: the ball's centre turns about the same axes."""
    low = np.minimum(moves.start_mm, moves.end_mm)[:, 0]
    high = np.maximum(moves.start_mm, moves.end_mm)[:, 0]
    finish = finishing_rows(moves)
    over = [k for k in finish if (low[k] >= -1e-3 and high[k] <= 38.2) or (low[k] >= 38.5 and high[k] <= 39.55)]
    sweeping = [k for k in over if abs(moves.end_mm[k, 1] - moves.start_mm[k, 1]) < 1e-6]
    arcs = sum(length_mm(moves, k) for k in sweeping if moves.kind[k] >= Kind.ARC_CW)
    total = sum(length_mm(moves, k) for k in sweeping)
    print(f"{arcs:.1f} of {total:.1f} mm over arc faces are G2/G3: {arcs / total:.4f}")
    assert total > 1000 and arcs / total >= 0.9


def length_mm(moves, k):
    if moves.kind[k] < Kind.ARC_CW:
        return float(np.linalg.norm(moves.end_mm[k] - moves.start_mm[k]))
    radius, sweep, _ = shape(moves, k)
    return radius * sweep


def shape(moves, k):
    return arc_shape(moves.start_mm[k], moves.end_mm[k], moves.center_mm[k], moves.plane[k], moves.kind[k])


def test_finishing_has_a_tenth_of_the_blocks_of_chords(moves):
    """A chord over the angle 2 acos(1 - 0.0025 / R) stands 0.0025 mm off its arc."""
    chords = 0
    rows = finishing_rows(moves)
    for k in rows:
        if moves.kind[k] < Kind.ARC_CW:
            chords += 1
        else:
            radius, sweep, _ = shape(moves, k)
            chords += int(np.ceil(sweep / (2 * np.arccos(1 - CHORD_MM / radius))))
    print(f"{len(rows)} blocks, {chords} as chords of {CHORD_MM} mm: ratio {chords / len(rows):.2f}")
    assert len(rows) <= chords / 10


# the same again -----------------------------------------------------------------------------------------


def test_another_process_with_one_thread_writes_the_same_bytes(default_part, tmp_path):
    done = cuspline("build", "z_profile", "-p", NARROW, "--stage", "gcode", "--out",
                    tmp_path / "again", env={"NUMBA_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    ours, theirs = bytes_of(default_part), bytes_of(tmp_path / "again")
    for name in ("z_profile.step", "z_profile.glb", "tools.tbl", "tools.json", "plan.json"):
        assert ours[name] == theirs[name], name
    one, other = ((f / "setup-1.ngc").read_text().splitlines() for f in (default_part, tmp_path / "again"))
    differing = [(a, b) for a, b in zip(one, other, strict=True) if a != b]
    assert len(differing) == 1 and differing[0][0].startswith("(VERDICT: VERIFIED")


def test_two_verified_builds_in_two_folders_are_byte_identical(saddle, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    job = saddle_job(tmp_path / "elsewhere")
    done = cuspline("build", job, "--stage", "verify", "--out", tmp_path / "out", env={"NUMBA_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr
    assert bytes_of(saddle) == bytes_of(tmp_path / "out")


# a STEP part with a job file ----------------------------------------------------------------------------


def test_a_job_for_a_step_part_is_verified_like_a_design(saddle):
    verify = read(saddle / "verify.json")
    assert verify["ok"] and verify["gouge_max_mm"] <= 0.006 and 0.01 < verify["cusp_max_mm"] <= 0.054
    assert verify["area_required_mm2"] == pytest.approx(16 * arc_length_mm(30, 4), rel=1e-6)


def arc_length_mm(chord, rise):
    radius = (chord ** 2 / 4 + rise ** 2) / (2 * rise)
    return 2 * radius * np.arcsin(chord / 2 / radius)


def test_verify_finds_the_same_numbers_again(saddle, tmp_path, monkeypatch):
    folder, found = copied(saddle, tmp_path / "moved"), []
    before = bytes_of(folder)
    monkeypatch.setattr(judging, "judge", lambda *given, **named: found.append(judge(*given, **named)) or found[-1])
    done = ran("verify", folder)
    assert done.returncode == 0 and "VERIFIED" in done.stdout, done.stderr
    (judged,), published = found, read(saddle / "verify.json")
    files = published.pop("stock")
    assert json.loads(json.dumps(judged.as_dict(()))) == published
    states = [state.as_dict() for state in judged.stock_states()]
    assert states == [{k: v for k, v in row.items() if k != "sha256"} for row in files]
    assert bytes_of(folder) == before


def test_verify_turns_red_after_one_digit(saddle, tmp_path):
    folder = copied(saddle, tmp_path / "touched")
    lines = (folder / "setup-1.ngc").read_text().splitlines()
    moves = read_program("\n".join(lines), work_offsets={"G54": read_job(folder).machine.wcs_origin_mm},
                         tool_lengths={n: t.length_mm for n, t in read_tools(folder).items()})
    k = int(max(finishing_rows(moves), key=lambda k: length_mm(moves, k)))
    middle = (moves.start_mm[k] + moves.end_mm[k]) / 2
    lines.insert(int(moves.line[k]), f"G1 X{middle[0]:.3f} Y{middle[1]:.3f} Z{7.5:.3f}\nX{moves.end_mm[k, 0]:.4f} "
                                     f"Y{moves.end_mm[k, 1]:.4f} Z{moves.end_mm[k, 2]:.4f}")
    (folder / "setup-1.ngc").write_text("\n".join(lines) + "\n")
    done = ran("verify", folder)
    assert done.returncode == 1 and "gouge" in done.stdout and "Traceback" not in done.stderr


# findings and killed builds -----------------------------------------------------------------------------


def test_a_build_with_findings_is_not_published_unless_accepted(saddle, tmp_path):
    out = copied(saddle, tmp_path / "out")
    before = bytes_of(out)
    job, small = saddle_job(tmp_path), tmp_path / "small.toml"
    text = (catalogue.POSTS / "machines" / "mill_3axis.toml").read_text()
    small.write_text(text.replace("program_store_bytes = 4000000", "program_store_bytes = 1000"))
    order = ("build", job, "--machine", small, "--stage", "verify", "--out", out)
    done = ran(*order)
    assert done.returncode == 1 and "REJECTED" in done.stdout and "program_too_long" in done.stdout
    assert bytes_of(out) == before
    rejected = read(tmp_path / "out-rejected" / "verify.json")
    assert not rejected["ok"] and {f["kind"] for f in rejected["findings"]} == {"program_too_long"}
    posted = sorted((tmp_path / "out-rejected").glob("setup-1*.ngc"))            # split as far as it can be
    assert posted and all("(VERDICT: REJECTED" in p.read_text() for p in posted)

    done = ran(*order, "--accept", "program_too_long")
    assert done.returncode == 0, done.stdout
    verify, texts = read(out / "verify.json"), [p.read_text() for p in sorted(out.glob("setup-1*.ngc"))]
    assert verify["accepted"] == ["program_too_long"] and verify["findings"] != []
    assert texts and "(ACCEPTED BY NAME: program_too_long)" in texts[0]
    assert not (tmp_path / "out-rejected").exists()


def test_a_build_killed_at_any_moment_leaves_the_old_outputs(saddle, tmp_path):
    out, job = copied(saddle, tmp_path / "out"), saddle_job(tmp_path)
    before = bytes_of(out)
    for delay_s, sign in ((0.5, signal.SIGKILL), (2.5, signal.SIGTERM), (4.5, signal.SIGKILL)):
        process = subprocess.Popen([sys.executable, "-c", "from cuspline.app.cli import main; main()", "build", str(job),
                                    "--stage", "verify", "--out", str(out)], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        time.sleep(delay_s)
        process.send_signal(sign)
        process.wait()
        assert bytes_of(out) == before
    done = ran("build", job, "--stage", "step", "--out", out)
    assert done.returncode == 0
    assert {p.name for p in out.iterdir()} == {"saddle.step", "saddle.glb", "manifest.json"}
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


INTERRUPTIBLE = ("import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
                 "from cuspline.app.cli import main; main()")       # a shell's background job inherits an ignored SIGINT


def test_a_build_interrupted_while_it_verifies_ends_with_one_line_and_code_130(saddle, tmp_path):
    out, job = copied(saddle, tmp_path / "out"), saddle_job(tmp_path)
    before, there = bytes_of(out), {p.name for p in tmp_path.iterdir()}
    process = subprocess.Popen([sys.executable, "-c", INTERRUPTIBLE, "build", str(job), "--stage", "verify", "--out", str(out)],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    said = next(line for line in process.stderr if " samples against " in line)
    assert (tmp_path / ".out.part").exists() and said.startswith("  saddle: setup-1: ")
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    spoken = [line for line in stderr.splitlines() if not line.startswith("  saddle: ")]
    assert (process.returncode, stdout, spoken) == (130, "", ["cuspline: interrupted, nothing half-written is left"])
    left = {p.name for p in tmp_path.iterdir()} - {".out.kept"}         # answers that the next build goes on from
    assert bytes_of(out) == before and left == there


def test_the_command_line_is_imported_without_kernels_and_cad():
    heavy = ("OCP", "cadquery", "build123d", "numba", "matplotlib")
    code = f"import sys, cuspline.app.cli; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr
