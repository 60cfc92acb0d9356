"""The wheel works in an empty folder; `cuspline new` makes a repository whose make and workflow run with it."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

from cuspline.app import cli
from cuspline.app.own_repository import FILES

ROOT = Path(__file__).parents[1]
NOT_SOURCES = shutil.ignore_patterns(".git", ".venv", "outputs", "build", "dist", "__pycache__", "*.egg-info", ".*_cache",
                                     ".hypothesis", "tests", "bench", "docs")
PULL_REQUEST = "github.event_name == 'pull_request'"
# python3 as it is, but for packages: what would be fetched is only looked at
PYTHON = """#!/bin/sh
case "$*" in
    "-m venv .venv") mkdir -p .venv/bin; cp "$0" .venv/bin/python ;;
    *"pip install"*" -r requirements.lock") grep -q -- --hash=sha256: requirements.lock ;;
    *"pip install"*.whl)
        for wheel; do :; done
        [ -f "$wheel" ] && printf '#!/bin/sh\\nexec "%s" -m cuspline "$@"\\n' "$(pwd)/.venv/bin/python" > .venv/bin/cuspline
        chmod +x .venv/bin/cuspline ;;
    *) exec {python} "$@" ;;
esac
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The package, built from a copy of the tree without a network."""
    tree = tmp_path_factory.mktemp("tree") / "cuspline"
    shutil.copytree(ROOT, tree, symlinks=True, ignore=NOT_SOURCES)
    build = "from setuptools import build_meta; print(build_meta.build_wheel('dist'))"
    done = subprocess.run([sys.executable, "-c", build], cwd=tree, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return next((tree / "dist").glob("*.whl"))


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory):
    """Variables of a process that finds the installed wheel, and the kernels that were compiled here in the user's cache."""
    folder = tmp_path_factory.mktemp("installed")
    done = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps",
                           "--no-index", "--no-compile", "--target", str(folder / "site"), str(wheel)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for path in (*(ROOT / "pipeline").rglob("*.kernel"), *(ROOT / "posts").rglob("*.kernel")):
        inside = path.parent.parent.relative_to(ROOT / "pipeline" if "pipeline" in path.parts else ROOT).parts
        cache = folder / "cache/cuspline/kernels" / ".".join(("cuspline", *inside, path.name.split(".")[0]))
        cache.mkdir(parents=True, exist_ok=True)
        (cache / path.name).symlink_to(path)
    return {**os.environ, "PYTHONPATH": str(folder / "site"), "XDG_CACHE_HOME": str(folder / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1"}


def ran(environment, folder, *arguments):
    return subprocess.run([sys.executable, "-m", "cuspline", *arguments], cwd=folder, env=environment, capture_output=True,
                          text=True)


def test_every_file_of_the_tree_is_in_the_wheel(wheel):
    tops = {"pipeline": "cuspline", "designs": "cuspline/designs", "posts": "cuspline/posts"}
    wanted = {f"{package}/{path.relative_to(ROOT / top).as_posix()}" for top, package in tops.items()
              for path in (ROOT / top).rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert {Path(name).suffix for name in wanted} >= {".py", ".toml", ".json", ".csv", ".js", ".html", ".css", ".lock"}
    inside = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert inside == wanted


def test_the_wheel_asks_for_no_package_that_brings_the_other_ocp(wheel):
    archive = zipfile.ZipFile(wheel)
    metadata, = (archive.read(name).decode() for name in archive.namelist() if name.endswith("/METADATA"))
    always = [line for line in metadata.splitlines() if line.startswith("Requires-Dist:") and "extra ==" not in line]
    assert any("cadquery" in line for line in always) and not any("build123d" in line for line in always)


def test_the_installed_package_runs_in_an_empty_folder(environment, tmp_path):
    assert re.fullmatch(r"cuspline \d+\.\d+\.\d+\n", ran(environment, tmp_path, "--version").stdout)
    where = subprocess.run([sys.executable, "-c", "import cuspline; print(cuspline.__file__)"], cwd=tmp_path, env=environment,
                           capture_output=True, text=True).stdout
    assert where.startswith(environment["PYTHONPATH"])
    done = ran(environment, tmp_path, "materials")
    assert "aluminium_6061" in done.stdout, done.stderr


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_the_workflow_of_a_new_repository_runs_with_the_wheel(wheel, environment, tmp_path):
    made = ran(environment, tmp_path, "new", "my-parts")
    assert made.returncode == 0, made.stderr
    repository = tmp_path / "my-parts"
    assert {p.relative_to(repository).as_posix() for p in repository.rglob("*") if p.is_file()} == set(FILES.values())
    assert (repository / "requirements.lock").read_bytes() == (ROOT / "requirements.lock").read_bytes()
    assert (repository / "README.md").read_text().startswith("# my-parts\n")

    tools, variables = tmp_path / "bin", {**environment, "HOME": str(tmp_path), "STAGE": "plan"}
    tools.mkdir()
    (tools / "python3").write_text(PYTHON.replace("{python}", sys.executable))
    (tools / "sudo").write_text("#!/bin/sh\n[ \"$1\" = apt-get ]\n")
    for tool in tools.iterdir():
        tool.chmod(0o755)
    variables["PATH"] = f"{tools}:{os.environ['PATH']}"
    (repository / "vendor").mkdir()
    shutil.copy(wheel, repository / "vendor")

    job, = yaml.safe_load((repository / ".github/workflows/build.yml").read_text())["jobs"].values()
    variables["GITHUB_REF_NAME"] = "v1.0"           # of a tag
    variables["CUSPLINE_REVISION"] = job["env"]["CUSPLINE_REVISION"].replace("${{ github.sha }}", 40 * "a")
    done = []
    for step in job["steps"]:
        if "make release" in step.get("run", ""):           # STAGE stops before the verdict, and only that is released
            (repository / "outputs/trough/verify.json").write_text('{"ok": true}')
        done += [step_done(step, repository, variables)] if step.get("if") != PULL_REQUEST else []
    assert done.count("run") == 4 and "trough" in os.listdir(repository / "outputs")
    assert 40 * "a" in (repository / "outputs/trough/manifest.json").read_text()
    is_released_as_built(repository, wheel)
    assert {"plan.json", "manifest.json", "trough.step"} <= set(os.listdir(repository / "outputs/trough"))
    assert list(Path(environment["PYTHONPATH"]).rglob("*.kernel")) == []
    again = subprocess.run(["make"], cwd=repository, env=variables, capture_output=True, text=True)
    assert (again.returncode, "Nothing to be done" in again.stdout) == (0, True)


def test_what_no_verdict_stands_beside_is_not_released(tmp_path, monkeypatch, capsys):
    """A build to its programs, one to its STEP, and a verdict that is red."""
    monkeypatch.chdir(tmp_path)
    stopped = {"programs": {"plan.json": "{}", "setup-1.ngc": "M2"}, "a-step": {"a.step": ""}}
    for name, files in {"good": {"verify.json": '{"ok": true}'}, "red": {"verify.json": '{"ok": false}'},
                        "solid": {"solid.json": "{}"}, **stopped}.items():
        (folder := tmp_path / "outputs" / name).mkdir(parents=True)
        for file, text in {**files, "manifest.json": "{}"}.items():
            (folder / file).write_text(text)
    assert cli.run(["release", "outputs", "release", "v1"]) == 0
    assert capsys.readouterr().out.splitlines() == ["good: archive", "solid: archive"] + [
        f"{name}: left out, not verified" for name in ("a-step", "programs", "red")]
    assert set(os.listdir(tmp_path / "release")) == {"good-v1.zip", "solid-v1.zip", "SHA256SUMS"}


def is_released_as_built(repository, wheel):
    """What a tag's run leaves is what the release takes, attests and publishes."""
    steps = yaml.safe_load((repository / ".github/workflows/release.yml").read_text())["jobs"]["release"]["steps"]
    taken, attested = (next(s["with"] for s in steps if action in s.get("uses", "")) for action in ("download", "attest"))
    release = repository / taken["path"]
    assert attested["subject-checksums"] == f"{taken['path']}/SHA256SUMS" and f"{taken['path']}/*" in steps[-1]["run"]
    checked = subprocess.run(["sha256sum", "-c", "--strict", "SHA256SUMS"], cwd=release, capture_output=True, text=True)
    assert checked.returncode == 0 and len(checked.stdout.splitlines()) == len(os.listdir(release)) - 1
    assert {"trough-v1.0.zip", "trough-v1.0.step", "SBOM.cdx.json"} <= set(os.listdir(release))
    packages = {c["name"]: c for c in json.loads((release / "SBOM.cdx.json").read_text())["components"]}
    assert packages["cuspline"]["hashes"][0]["content"] == hashlib.sha256(wheel.read_bytes()).hexdigest() and "cadquery" in packages


def test_rejected_parts_of_a_new_repository_are_an_artifact_of_that_name():
    steps = yaml.safe_load((ROOT / "pipeline/app/repository/build.yml").read_text())["jobs"]["parts"]["steps"]
    parts, rejected = (next(s for s in steps if s.get("with", {}).get("name") == name) for name in ("parts", "rejected"))
    assert rejected["with"]["path"] == "outputs/*-rejected/" and "!outputs/*-rejected/**" in parts["with"]["path"]
    assert parts["if"] == rejected["if"] == "${{ !cancelled() }}"           # where make has failed, too


@pytest.mark.parametrize("change, words", [
    ({"outputs": "none"}, "none holds no published part: there is nothing to release"),
    ({"tag": "a b"}, "the tag 'a b' cannot stand in a file's name"),
    ({"assets": "."}, ". is there already: nothing is overwritten")])
def test_what_cannot_be_released_is_refused_in_a_sentence(change, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "outputs/plug").mkdir(parents=True)
    for name in ("manifest", "solid"):
        (tmp_path / f"outputs/plug/{name}.json").write_text("{}")
    given = {"outputs": "outputs", "assets": "release", "tag": "v1", **change}
    assert cli.run(["release", *given.values()]) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "release").exists()


def test_a_release_without_a_lock_has_no_bill_and_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "outputs/plug").mkdir(parents=True)
    for name in ("manifest", "solid"):
        (tmp_path / f"outputs/plug/{name}.json").write_text("{}")
    assert cli.run(["release", "outputs", "release", "v1"]) == 0
    assert "requirements.lock is not there: no bill of materials" in capsys.readouterr().err
    assert set(os.listdir(tmp_path / "release")) == {"plug-v1.zip", "SHA256SUMS"}


@pytest.mark.parametrize("status, more", [(1, ""), (2, "not every part can be compared\n")])
def test_a_pull_request_gets_what_it_changes_as_the_summary(status, more, tmp_path):
    """Without the pull request the parts are built by the same cuspline; the run goes on whatever comes out."""
    assert cli.run(["new", str(tmp_path / "parts")]) == 0
    shutil.copytree(tmp_path / "parts", tmp_path / "old")
    (tmp_path / "old").rename(tmp_path / "parts/base")
    stub = tmp_path / "parts/.venv/bin/cuspline"
    stub.parent.mkdir(parents=True)
    stub.write_text("#!/bin/sh\necho \"$@\"\n[ $1 = build ] && mkdir -p outputs/trough && exec touch outputs/trough/manifest.json\n"
                    f"exit {status}\n")
    stub.chmod(0o755)
    workflow = yaml.safe_load((tmp_path / "parts/.github/workflows/build.yml").read_text())
    assert "workflow_call" in workflow[True]            # YAML takes the key `on` for true
    old, step = [s for s in workflow["jobs"]["parts"]["steps"] if s.get("if") == PULL_REQUEST]
    assert old["with"]["path"] == "base" and "base.sha" in old["with"]["ref"]
    summary = tmp_path / "summary.md"
    done = subprocess.run(["bash", "-eo", "pipefail", "-c", step["run"]], cwd=tmp_path / "parts", capture_output=True, text=True,
                          env={**os.environ, "GITHUB_STEP_SUMMARY": str(summary)})
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "parts/base/outputs/trough/manifest.json").is_file()
    assert summary.read_text() == f"diff base/outputs/trough outputs/trough --markdown\n{more}"


def step_done(step, repository, variables):
    """One step of a workflow, here: its commands, or what it uses as far as that can be seen."""
    if "run" in step:
        done = subprocess.run(["bash", "-eo", "pipefail", "-c", step["run"]], cwd=repository, env=variables, capture_output=True,
                              text=True)
        assert done.returncode == 0, f"{step['name']}: {done.stdout}{done.stderr}"
        return "run"
    action = step["uses"].split("@")[0]
    if action == "actions/upload-artifact" and step["with"]["if-no-files-found"] == "error":
        assert any((repository / step["with"]["path"]).iterdir())
    assert action.startswith("actions/")
    return action


def test_the_container_needs_no_more_than_it_is_given(tmp_path):
    """Its `make setup` runs where nothing but what it copies is; its packages are those of the workflow, and make."""
    assert cli.run(["new", str(tmp_path / "parts")]) == 0
    recipe = (tmp_path / "parts/Containerfile").read_text()
    workflow = (tmp_path / "parts/.github/workflows/build.yml").read_text()
    packages = lambda text: set(re.search(r"--no-install-recommends (.*)", text)[1].split())
    assert packages(recipe) == packages(workflow) | {"make"} and "{" not in recipe
    inside, tools = tmp_path / "inside", tmp_path / "bin"
    (inside / "vendor").mkdir(parents=True)
    (inside / "vendor/cuspline-1-py3-none-any.whl").touch()
    for name in re.search(r"^COPY (.*) \./$", recipe, re.M)[1].split():
        shutil.copy(tmp_path / "parts" / name, inside)
    tools.mkdir()
    (tools / "python3").write_text(PYTHON.replace("{python}", sys.executable))
    (tools / "python3").chmod(0o755)
    command = re.search(r"^RUN (make .*)$", recipe, re.M)[1]
    done = subprocess.run(command.split(), cwd=inside, capture_output=True, text=True,
                          env={**os.environ, "PATH": f"{tools}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)})
    assert (inside / ".venv/bin/cuspline").is_file() and done.returncode == 0, done.stderr


def test_make_without_the_wheel_says_what_is_missing(tmp_path):
    assert cli.run(["new", str(tmp_path / "parts")]) == 0
    done = subprocess.run(["make", "setup"], cwd=tmp_path / "parts", capture_output=True, text=True)
    assert done.returncode == 2 and "put the wheel of cuspline into vendor/ first" in done.stderr


@pytest.mark.parametrize("status, code", [(0, 0), (1, 0), (2, 2)])
def test_make_diff_of_a_new_repository_fails_only_where_nothing_can_be_compared(status, code, tmp_path):
    assert cli.run(["new", str(tmp_path / "parts")]) == 0
    (tmp_path / "stub").write_text(f"#!/bin/sh\necho \"$@\"\nexit {status}\n")
    (tmp_path / "stub").chmod(0o755)
    done = subprocess.run(["make", "diff", "BASE=../old", f"CUSPLINE={tmp_path}/stub"], cwd=tmp_path / "parts", capture_output=True,
                          text=True)
    assert (done.returncode, done.stdout) == (code, "diff ../old/outputs/trough outputs/trough --markdown\n")


def test_a_new_repository_overwrites_nothing(tmp_path, capsys):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/mine.txt").write_text("mine")
    assert cli.run(["new", str(tmp_path / "parts")]) == 2
    assert "exists and is not empty: nothing is overwritten; name a new folder" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["parts"] and os.listdir(tmp_path / "parts") == ["mine.txt"]
    assert cli.run(["new", str(tmp_path / "a*b")]) == 2 and "choose another name" in capsys.readouterr().err
    (tmp_path / "parts/mine.txt").unlink()
    assert cli.run(["new", str(tmp_path / "parts")]) == 0
