"""Makefile, lock, CI, workflow and README do what they say."""

import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

from cuspline.app import build, catalogue, cli
from cuspline.design import Design
from cuspline.kernel import brep

ROOT = Path(__file__).parents[1]
MAKEFILE = (ROOT / "Makefile").read_text()
README = (ROOT / "README.md").read_text()
HOSTS = ["py" + "pi.org", "python" + "hosted.org", "crates" + ".io", "npm" + "js.org", "npm" + "js.com",
         "proxy.go" + "lang.org", "repo1.ma" + "ven.org", "deb." + "debian.org"]
NO_HOST = re.compile(r"://|(?<![\w.])--?[a-z-]*(index|links)")
needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def project_files():
    """Files under version control; without git, everything that is not made."""
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, text=True)
    if listed.returncode == 0:
        return [p for p in (ROOT / name for name in listed.stdout.split("\0") if name) if p.is_file()]
    made = {".git", ".venv", "outputs", "build", "__pycache__", ".pytest_cache", ".hypothesis"}
    return [p for p in ROOT.rglob("*") if p.is_file() and not made & set(p.relative_to(ROOT).parts)]


def make(folder, *arguments):
    return subprocess.run(["make", "-C", str(folder), *arguments], capture_output=True, text=True)


# lock ------------------------------------------------------------------------------------------


def test_the_lock_names_no_host_and_hashes_every_package():
    lock = (ROOT / "requirements.lock").read_text()
    assert not NO_HOST.search(re.sub(r"--hash=", "", lock))
    entries = re.split(r"\n(?=\S)", lock.strip())
    assert len(entries) > 50
    assert [e.split()[0] for e in entries if "==" not in e.split()[0] or "--hash=sha256:" not in e] == []


def test_the_lock_holds_what_set_up_needs_and_one_ocp():
    pins = {line.split("==")[0] for line in (ROOT / "requirements.lock").read_text().splitlines() if "==" in line}
    assert {"uv", "setuptools", "pytest", "cadquery-ocp"} <= pins
    assert "cadquery-ocp-novtk" not in pins
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wanted = project["project"]["dependencies"] + project["dependency-groups"]["dev"]
    assert {re.match(r"[\w-]+", w)[0] for w in wanted} <= pins


def test_no_file_names_a_registry_host_or_a_folder_beside_the_project():
    words = [*HOSTS, "../" + "shared"]
    found = []
    for path in project_files():
        text = path.read_bytes().decode("utf-8", "replace")
        found += [f"{path.relative_to(ROOT)}: {word}" for word in words if word in text]
    assert found == []


# help, README, workflow ------------------------------------------------------------------------


@needs_make
def test_help_lists_every_target_and_every_design():
    phony = set(re.search(r"^\.PHONY: (.*)$", MAKEFILE, re.M)[1].split()) - {"FORCE", "$(DESIGNS)"}
    listed = set(re.findall(r"^  make (\S+)", make(ROOT, "help").stdout, re.M))
    assert listed == phony | set(catalogue.design_names())


def test_readme_starts_with_make_and_make_test():
    assert re.search(r"^    make  .*\n    make test", README, re.M).start() < 900


def test_every_command_of_the_readme_exists():
    commands = {c.name or c.callback.__name__ for c in cli.app.registered_commands}
    targets = set(re.search(r"^\.PHONY: (.*)$", MAKEFILE, re.M)[1].split()) | set(catalogue.design_names())
    named = set(re.findall(r"(?:`|bin/)cuspline ([a-z]+)", README))
    assert {"build", "verify", "designs", "doctor", "warm"} <= named <= commands
    made = set(re.findall(r"(?:`|^    )make ([a-z_0-9]+)", README, re.M))
    assert {"test", "help", "step"} <= made <= targets


def test_every_option_of_the_readme_exists():
    source = (ROOT / "pipeline/app/cli.py").read_text()
    for option in re.findall(r"`[^`]*?--([a-z]+)", README):
        assert re.search(rf'\b{option}: Annotated|"--{option}"', source), option


def example(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.S)[1]


@pytest.fixture(scope="module")
def readme_part(tmp_path_factory):
    folder = tmp_path_factory.mktemp("readme")
    (folder / "trough.py").write_text(example("python"))
    return folder, catalogue.make_design(catalogue.find_design(str(folder / "trough.py")), ["depth_mm=8"])


def test_the_part_of_the_readme_is_a_design(readme_part):
    _, design = readme_part
    assert isinstance(design, Design) and design.parameters.depth_mm == 8.0
    solid = brep.the_solid(design.solid)
    assert [len(brep.select_faces(brep.faces_of(solid), p)) for p in design.predicates] == [1]


def test_the_solid_of_the_readme_is_the_same_from_build123d(readme_part):
    _, design = readme_part
    names = {}
    exec(re.findall(r"```python\n(.*?)```", README, re.S)[1], names)
    solid, other = brep.the_solid(design.solid), brep.the_solid(names["block"](design.parameters, 25.0))
    assert brep.volume_mm3(other) == pytest.approx(brep.volume_mm3(solid), rel=1e-9)
    assert [len(brep.select_faces(brep.faces_of(other), p)) for p in design.predicates] == [1]


def test_the_job_file_of_the_readme_is_a_design(readme_part):
    folder, design = readme_part
    brep.write_step(brep.the_solid(design.solid), folder / "trough.step", "trough")
    (folder / "trough.toml").write_text(example("toml"))
    job = catalogue.make_design(catalogue.find_design(str(folder / "trough.toml")), [])
    solid = brep.the_solid(job.solid)
    assert [len(brep.select_faces(brep.faces_of(solid), p)) for p in job.predicates] == [1]
    assert (job.setups, job.material) == (design.setups, design.material)


def test_every_file_named_in_the_architecture_exists():
    text = (ROOT / "docs/architecture.md").read_text()
    beside, missing = "", []
    for name in re.findall(r"`([\w./*]+(?:\.py|/|\.toml|\.json|\.sh))`", text):
        # in a list only the first name carries its folder
        found = [base / name for base in (ROOT, ROOT / "pipeline", ROOT / "pipeline" / beside)
                 if any(base.glob(name.rstrip("/")))]
        missing += [] if found else [name]
        beside = name.rsplit("/", 1)[0] if "/" in name else beside
    assert missing == []


def test_links_of_the_documents_lead_somewhere():
    for document in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for link in re.findall(r"\]\((?!https?:)([^)#]+)", document.read_text()):
            assert (document.parent / link).exists(), f"{document.name}: {link}"


def test_ci_is_one_executable_script_that_the_workflow_runs():
    script, workflow = ROOT / ".ci/run", (ROOT / ".github/workflows/build.yml").read_text()
    assert os.access(script, os.X_OK) and script.read_text().startswith("#!/bin/bash\n")
    assert "\nexec </dev/null\n" in script.read_text()
    for command in ("make test", "\nmake -j", "make -q", ".ci/install_linuxcnc.sh"):
        assert command in script.read_text()
    assert "bash .ci/run" in workflow and "archive: false" in workflow
    assert "permissions:\n  contents: read\n" in workflow
    for path in re.findall(r"(?:bash|python3|sh) (\.ci/\S+)", workflow + script.read_text()):
        assert (ROOT / path).is_file(), path


# verdict table ---------------------------------------------------------------------------------


def ci(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / f".ci/{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def summary_of(outputs):
    return ci("summary").table(outputs)


def test_the_verdict_table_shows_rejected_parts_with_their_findings(tmp_path):
    numbers = {"gouge_max_mm": 0.02, "cusp_max_mm": 0.009, "error_bound_mm": 7e-5, "points_checked": 1000,
               "area_required_mm2": 10.0, "area_reached_mm2": 9.5}
    finding = {"kind": "gouge", "amount_mm": 0.02, "setup": "setup-1", "advice": "take a smaller cutter"}
    for name, findings in (("good", []), ("bad-rejected", [finding])):
        (tmp_path / name).mkdir()
        verdict = {"ok": not findings, "accepted": [], "findings": findings, **numbers}
        (tmp_path / name / "verify.json").write_text(json.dumps(verdict))
    lines = summary_of(tmp_path)
    assert "| good | verified | 0.0200 | 0.0090 | 0.00007 | 1,000 | 9.5 of 10.0 | 0 |" in lines
    assert any(line.startswith("| bad-rejected | **rejected** |") for line in lines)
    assert "- bad-rejected, setup-1: gouge 0.0200 mm: take a smaller cutter" in lines


def test_the_verdict_table_says_when_there_is_nothing(tmp_path):
    assert summary_of(tmp_path) == ["no part has a verdict: outputs/ holds no verify.json and no solid.json"]


# a release, out of what builds really leave ------------------------------------------------------

PLUG = """import cadquery as cq
from cuspline.kernel import brep
from cuspline.design import *


class P(Parameters):
    wanted_mm3: float = 1000.0


def design(p: P):
    box = cq.Workplane().box(10, 10, 10).val()
    figure = lambda solid: Figure(what="volume", measured=brep.volume_mm3(solid), wanted=p.wanted_mm3, allowed=0.1, unit="mm3")
    return Design(name="plug", description="", parameters=p, solid=box, material="aluminium_6061", setups=(),
                  predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1)),),
                  stock=StockBox(min_mm=(-5, -5, -5), max_mm=(5, 5, 6)),
                  finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003),
                  measure=lambda solid: SolidReport(figures=(figure(solid),), facts={"mass_kg": 0.0027}))
"""


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """A bare solid that was checked and one that was rejected, both built; beside them a part with a report."""
    folder = tmp_path_factory.mktemp("release")
    (folder / "plug.py").write_text(PLUG)
    made = folder / "outputs"
    with pytest.MonkeyPatch.context() as change:
        change.setattr(build, "render_shape", lambda shape, out: "")
        assert cli.run(["build", str(folder / "plug.py"), "--out", str(made / "plug")]) == 0
        assert cli.run(["build", str(folder / "plug.py"), "--out", str(made / "bad"), "-p", "wanted_mm3=1001"]) == 1
    shutil.copytree(made / "plug", made / "cut")
    (made / "cut/report.html").write_text("<html>")
    (made / "cut/plug.step").rename(made / "cut/cut.step")
    (made / "cut/manifest.json").write_text("{}")           # of another name's files
    shutil.copytree(made / "cut", made / "worse-rejected")
    shutil.copytree(made / "cut", made / "early-draft")
    (made / ".made").mkdir()
    return made


def test_a_release_holds_every_published_part_with_what_it_has(outputs, tmp_path):
    assets = tmp_path / "assets"
    said = subprocess.run(["python3", ROOT / ".ci/release.py", "assets", outputs, assets, "v1.2"], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    assert said.stdout.splitlines() == ["cut: archive, cut.step, report.html", "plug: archive, plug.step",
                                        "bad-rejected: left out", "worse-rejected: left out", "early-draft: left out"]
    assert {p.name for p in assets.iterdir()} == {
        "SHA256SUMS", "SBOM.cdx.json", "cut-v1.2.zip", "cut-v1.2.step", "cut-v1.2.html", "plug-v1.2.zip", "plug-v1.2.step"}
    with zipfile.ZipFile(assets / "plug-v1.2.zip") as archive:
        assert {"plug/plug.step", "plug/solid.json", "plug/manifest.json"} <= set(archive.namelist())
    checked = subprocess.run(["sha256sum", "-c", "--strict", "SHA256SUMS"], cwd=assets, capture_output=True, text=True)
    assert checked.returncode == 0 and len(checked.stdout.splitlines()) == 6
    packages = {c["name"]: c for c in json.loads((assets / "SBOM.cdx.json").read_text())["components"]}
    assert packages["numpy"]["purl"].startswith("pkg:pypi/numpy@") and all(c["hashes"] for c in packages.values())
    assert len(packages) == len(set(re.findall(r"^[a-z0-9][a-z0-9._-]*(?===)", (ROOT / "requirements.lock").read_text(),
                                             re.M | re.I)))


def test_a_release_of_what_a_build_really_writes_holds_it_byte_for_byte(default_part, tmp_path):
    shutil.copytree(default_part, tmp_path / "outputs/z_profile")
    done = subprocess.run(["python3", ROOT / ".ci/release.py", "assets", tmp_path / "outputs", tmp_path / "assets", "v1"],
                          capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "z_profile: archive, z_profile.step\n", done.stderr
    with zipfile.ZipFile(tmp_path / "assets/z_profile-v1.zip") as archive:
        held = {n: archive.read(n) for n in archive.namelist() if not n.endswith("/")}
    written = {f"z_profile/{p.relative_to(default_part)}": p.read_bytes() for p in default_part.rglob("*") if p.is_file()}
    assert held == written and (tmp_path / "assets/z_profile-v1.step").read_bytes() == written["z_profile/z_profile.step"]
    manifest = json.loads(held["z_profile/manifest.json"])
    assert all(hashlib.sha256(held[f"z_profile/{name}"]).hexdigest() == sha for name, sha in manifest["files"].items())


def test_reports_of_a_release_are_those_of_published_parts(outputs):
    said = subprocess.run(["python3", ROOT / ".ci/release.py", "parts", outputs], capture_output=True, text=True)
    assert json.loads(said.stdout) == ["cut"]


def test_a_file_that_was_edited_after_its_build_is_not_released(outputs, tmp_path):
    shutil.copytree(outputs / "plug", tmp_path / "outputs/plug")
    run = lambda: subprocess.run(["python3", ROOT / ".ci/release.py", "assets", tmp_path / "outputs", tmp_path / "assets", "v1"],
                                 capture_output=True, text=True)
    with open(tmp_path / "outputs/plug/plug.step", "a") as step:
        step.write("\n")
    assert run().returncode == 1 and "plug.step: not as manifest.json has it" in run().stderr
    assert not (tmp_path / "assets").exists()
    shutil.copy(outputs / "plug/plug.step", tmp_path / "outputs/plug/plug.step")
    assert run().returncode == 0


def test_nothing_to_release_is_an_error(tmp_path):
    done = subprocess.run(["python3", ROOT / ".ci/release.py", "assets", tmp_path, tmp_path / "a", "v1"], capture_output=True,
                          text=True)
    assert done.returncode == 1 and "no published part" in done.stderr


def test_bare_solids_stand_in_the_summary(outputs):
    lines = summary_of(outputs)
    assert "| plug | checked | 1 of 1 | 0.003 |" in lines and "| bad-rejected | **rejected** | 0 of 1 | 0.003 |" in lines
    assert "- bad-rejected: volume: 1000 mm3 measured, 1001 wanted, 0.1 allowed" in lines


def test_the_workflow_sends_rejected_parts_into_an_artifact_of_that_name():
    workflow = (ROOT / ".github/workflows/build.yml").read_text()
    assert re.search(r"name: rejected\n +path: outputs/\*-rejected/\n +if-no-files-found: ignore", workflow)
    assert "!outputs/*-rejected/**" in workflow and "python3 .ci/release.py assets outputs assets" in workflow
    release = workflow[workflow.index("\n  release:"):]
    assert release.index("actions/checkout@") < release.index(".ci/release.py")


def test_a_pull_request_gets_what_it_changes_as_the_summary(tmp_path):
    """Both checkouts are made; where nothing can be compared the summary says so, and the run goes on."""
    steps = yaml.safe_load((ROOT / ".github/workflows/build.yml").read_text())["jobs"]["build"]["steps"]
    old, step = [s for s in steps if s.get("if") == "github.event_name == 'pull_request'"]
    assert old["with"]["path"] == "base" and "base.sha" in old["with"]["ref"]
    assert steps.index(old) > [s.get("run") for s in steps].index("bash .ci/run")         # the suite has not seen it
    (tmp_path / "make").write_text('#!/bin/sh\necho "make $@"\nexit 2\n')
    (tmp_path / "make").chmod(0o755)
    done = subprocess.run(["sh", "-e", "-c", step["run"]], cwd=tmp_path, capture_output=True, text=True, env={
        **os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "GITHUB_STEP_SUMMARY": str(tmp_path / "summary")})
    assert done.returncode == 0 and done.stdout.startswith("make -C base\nnot every part is published")
    assert (tmp_path / "summary").read_text() == "make diff BASE=base\nnot every part can be compared\n"


@pytest.mark.parametrize("status, code", [(0, 0), (1, 0), (2, 2)])
def test_make_diff_fails_only_where_nothing_can_be_compared(shop, status, code):
    (shop / ".venv/bin/cuspline").write_text(f"#!/bin/sh\necho \"$@\"\nexit {status}\n")
    done = make(shop, "diff", "BASE=../old")
    assert done.returncode == code and "diff ../old/outputs/plate outputs/plate --markdown\n" in done.stdout
    assert ("outputs/vane --markdown" in done.stdout) == (code == 0)


WORKFLOWS = [ROOT / ".github/workflows/build.yml", ROOT / "pipeline/app/repository/build.yml",
             ROOT / "pipeline/app/repository/release.yml"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_action_of_a_workflow_is_pinned_by_its_commit(path):
    """A tag may be moved to other code; the version stands behind, for who reads it.  The same action is the same everywhere."""
    text = path.read_text()
    used = [step["uses"] for job in yaml.safe_load(text)["jobs"].values() for step in job.get("steps", ())
            if "uses" in step]
    assert used and [u for u in used if not re.fullmatch(r"actions/[a-z-]+@[0-9a-f]{40}", u)] == []
    assert text.count("uses: actions/") == len(used) == len(re.findall(r"uses: \S+ +# v\d+\.\d+\.\d+\n", text))
    everywhere = {u for p in WORKFLOWS for u in re.findall(r"uses: (actions/\S+)", p.read_text())}
    assert len({u.split("@")[0] for u in everywhere}) == len(everywhere)


# what make builds again, and what it leaves alone ----------------------------------------------

STUB = """#!/bin/sh
echo "$@" >> calls
while [ $# -gt 0 ]; do [ "$1" = --out ] && out=$2; line="$line $1"; shift; done
[ -f fails ] && exit 1
mkdir -p "$out"
echo "$line" > "$out/manifest.json"
"""


@pytest.fixture
def shop(tmp_path):
    """The real Makefile beside two designs, in an environment whose cuspline only writes manifests."""
    files = {"Makefile": MAKEFILE, "requirements.lock": "", "pyproject.toml": "", "designs/__init__.py": "",
             "designs/plate.py": "", "designs/vane.py": "", "designs/data/cells.csv": "", "posts/machines/mill.toml": "",
             "pipeline/app/build.py": "", "pipeline/report/style.css": "", ".venv/bin/cuspline": STUB, ".venv/bin/python": STUB}
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        os.utime(path, (1e9, 1e9))
        path.chmod(0o755)
    (tmp_path / ".venv/.environment").write_text(f"{tmp_path.resolve()}\n")
    for stamp in (".project", ".kernels"):
        (tmp_path / ".venv" / stamp).touch()
    return tmp_path


def built(shop, *arguments, ok=True):
    """Output folders that a make has built."""
    (shop / "calls").write_text("")
    done = make(shop, *arguments)
    assert (done.returncode == 0) is ok, done.stderr
    return sorted(re.findall(r"^build .*--out outputs/(\S+)", (shop / "calls").read_text(), re.M))


@needs_make
def test_a_second_make_does_nothing(shop):
    assert built(shop, "-j2") == ["plate", "vane"]
    assert built(shop) == []
    assert make(shop, "-q").returncode == 0


@needs_make
@pytest.mark.parametrize("source, stale", [
    ("designs/vane.py", ["vane"]), ("designs/data/cells.csv", ["plate", "vane"]), ("posts/machines/mill.toml", ["plate", "vane"]),
    ("pipeline/report/style.css", ["plate", "vane"]), ("pipeline/app/build.py", ["plate", "vane"])])
def test_a_changed_source_builds_what_depends_on_it(shop, source, stale):
    built(shop)
    (shop / source).touch()
    assert built(shop) == stale
    assert built(shop) == []


@needs_make
def test_a_failed_build_keeps_the_old_files_and_is_tried_again(shop):
    built(shop)
    old = (shop / "outputs/vane/manifest.json").read_bytes()
    (shop / "designs/vane.py").touch()
    (shop / "fails").touch()
    assert built(shop, ok=False) == ["vane"] == built(shop, ok=False)
    assert (shop / "outputs/vane/manifest.json").read_bytes() == old
    (shop / "fails").unlink()
    assert built(shop) == ["vane"]


@needs_make
def test_a_folder_built_by_hand_with_other_parameters_is_built_again(shop):
    built(shop)
    (shop / "outputs/plate/manifest.json").write_text("other parameters")
    assert built(shop) == ["plate"]
    shutil.rmtree(shop / "outputs/plate")
    assert built(shop) == ["plate"]


@needs_make
def test_params_go_to_a_folder_of_their_own(shop):
    built(shop)
    assert built(shop, "plate", "PARAMS=width_mm=30 length_mm=-2.5") == ["plate-length_mm=-2.5-width_mm=30"]
    assert "--params width_mm=30 length_mm=-2.5 --out" in (shop / "calls").read_text()
    assert built(shop, "plate", "PARAMS=length_mm=-2.5 width_mm=30") == []
    assert built(shop) == []
    assert built(shop, "PARAMS=width_mm=30", ok=False) == []


@needs_make
@pytest.mark.parametrize("params", [
    'table="my cells.csv" vane=y', "table='my cells.csv'", 'note="it\'s; a $HOME `id` % #1"', "table=a/b.csv",
    'x="a b"', 'x="b a"'])
def test_values_with_spaces_and_quotes_reach_the_command_as_they_are(shop, params):
    folders = built(shop, "plate", "PARAMS=" + params)
    assert f"--params {params} --out" in (shop / "calls").read_text()
    assert len(folders) == 1 and re.fullmatch(r"plate-[\w.=+,-]+-\d+", folders[0]), folders
    assert built(shop, "plate", "PARAMS=" + params) == []


@needs_make
def test_two_sets_of_odd_values_never_share_a_folder(shop):
    assert len({*built(shop, "plate", 'PARAMS=x="a b"'), *built(shop, "plate", 'PARAMS=x="b a"'),
                *built(shop, "plate", "PARAMS=x=a/b"), *built(shop, "plate", "PARAMS=x=a_b")}) == 4


@needs_make
def test_step_overwrites_no_published_part(shop):
    built(shop)
    assert built(shop, "step") == ["plate-step", "vane-step"]
    assert "--stage step" in (shop / "calls").read_text()
    assert built(shop, "all", "step") == []


@needs_make
def test_a_moved_or_broken_environment_is_made_anew(shop):
    assert "set-up" not in make(shop, "-n").stdout
    (shop / ".venv/.environment").write_text("/somewhere/else\n")
    assert "rm -rf .venv" in make(shop, "-n").stdout
    (shop / ".venv/.environment").write_text(f"{shop.resolve()}\n")
    (shop / ".venv/.project").touch()
    (shop / ".venv/.kernels").touch()
    assert "set-up" not in make(shop, "-n").stdout
    (shop / ".venv/bin/python").unlink()
    assert "rm -rf .venv" in make(shop, "-n").stdout
