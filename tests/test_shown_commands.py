"""Every command that a page shows is run, on a small part in a folder of its own; what is not stands in a short, argued list.

Builds stop at the stage `step` (a whole one is tests/app/test_build.py's), designs of the package are asked for their parameters
alone (their own tests build them), and lines for make go through `make --dry-run`, which reads PARAMS and finds the target.
"""

import json
import re
import shlex
import shutil
import socket
import subprocess
import threading
from functools import partial
from pathlib import Path

import known_passes
import pytest
from built_parts import ran, saddle_job
from foreign_libraries import fusion_library, fusion_tool
from shown_commands import PAGES, ROOT, commands_shown
from small_program import BALL, FLAT, finishing, operation, program, roughing

import cuspline
from cuspline.app import catalogue, sweep, sweep_workers
from cuspline.app import judge as judging
from cuspline.verification.verdict import Options

COARSE = Options(spacing_mm=0.5, solid_pitch_mm=0.5, replay_pitch_mm=0.5, tessellation_mm=0.01)
PART = Path(__file__).parent / "parts/shown_part.py"
NOT_RUN = {
    "positions part.step": "looks at every face from everywhere: tests/planning/test_positions.py",
    "positions part.step --machine mill_trunnion_ac": "as above",
    "watch part.py": "serves a page until it is ended: tests/app/test_watch.py runs it",
    "pip install cuspline-0.1.0-py3-none-any.whl": "tests/test_package.py installs the wheel into an empty folder",
    "cd my-parts && make": "tests/test_package.py runs the Makefile of a new repository",
}
BEHIND = {"build": ("--stage", "step"), "sweep": ("--stage", "step", "--sample", "2", "--workers", "1")}
RED = {"diff": (0, 1), "verify": (0, 1)}            # 1 is an answer too
ALIKE = {**dict.fromkeys(("trough.py", "cradle.py", "plate.py", "parts/trough.py"), "part.py"),
         "outputs/part": "outputs/a"}               # what pages call one and the same small part
COMMANDS = sorted({" ".join(shlex.quote(ALIKE.get(w, w)) for w in words)
                   for name in PAGES for words, has_arguments in commands_shown(name)
                   if has_arguments and not words[0].startswith("-")})
OF_A_NEW_REPOSITORY = {"setup", "trough", "verify", "release"}


def lines_shown():
    """Lines of blocks, and lines for make within a text, that are no `cuspline` command, without their comment."""
    for name in PAGES:
        text = re.sub(r"```(?:python|py|toml)\n.*?```", "", (ROOT / name).read_text(), flags=re.S)
        for line in re.findall(r"^    ((?:make|pip|cd|git|python3?|bash|docker|podman)\b.*)$|`(make [^`]*)`", text, re.M):
            yield "".join(line).partition(" #")[0].strip()


LINES = sorted(set(lines_shown()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the pages speak of: a part by many names, as STEP, with a job file, markers, tools, a machine, outputs."""
    base = tmp_path_factory.mktemp("shown")
    shutil.copy(PART, base / "part.py")
    assert ran("build", base / "part.py", "--stage", "verify", "--out", base / "outputs/a").returncode == 0
    shutil.copytree(base / "outputs/a", base / "outputs/b")
    shutil.copy(base / "outputs/a/part.step", base / "part.step")
    shutil.copy(base / "outputs/a/setup-1.ngc", base / "a.ngc")
    saddle_job(base).rename(base / "trough.toml")
    shutil.copy(ROOT / "posts/machines/mill_3axis.toml", base / "my_mill.toml")
    (base / "measured.csv").write_text("setup,marker,x_mm,y_mm,z_mm\n"
                                       "setup-1,one,0,0,0\nsetup-1,two,24.001,0,0\nsetup-1,three,0,4,0\n")
    fusion_library(base / "shop.json", fusion_tool(DC=6.0, LCF=20.0, OAL=60.0, SFDM=6.0))
    fusion_library(base / "shop.tools", fusion_tool(DC=6.0, LCF=20.0, OAL=60.0, SFDM=6.0))
    return base


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_shown_does_what_it_says(command, folder, monkeypatch):
    words = shlex.split(command)
    if command in NOT_RUN:
        pytest.skip(NOT_RUN[command])
    monkeypatch.chdir(folder)
    monkeypatch.setattr(judging, "judge", partial(judging.judge, options=COARSE))
    monkeypatch.setattr(sweep_workers, "in_processes", lambda variants, count, threads: ((v, sweep.built(v)) for v in variants))
    if words[0] == "build" and words[1] in catalogue.design_names():
        given = dict(w.split("=") for k, w in enumerate(words) if words[k - 1] == "-p")
        catalogue.find_design(words[1]).parameters.model_validate(given)
        return
    words = BEFORE.get(words[0], lambda folder, words: words)(folder, words)
    done = ran(*words, *(() if "--draft" in words else BEHIND.get(words[0], ())))
    assert done.returncode in RED.get(words[0], (0,)) and "Traceback" not in done.stderr, done.stderr + done.stdout


@pytest.mark.parametrize("line", LINES)
def test_a_line_shown_is_one_that_make_takes(line, tmp_path):
    if line in NOT_RUN:
        pytest.skip(NOT_RUN[line])
    words, place = shlex.split(line), ROOT
    if OF_A_NEW_REPOSITORY & set(words):
        place = tmp_path / "mine"
        assert ran("new", place).returncode == 0
    done = subprocess.run(["make", "--dry-run", *words[1:]], cwd=place, capture_output=True, text=True)
    assert words[0] == "make" and done.returncode == 0, done.stderr


def test_what_is_not_run_is_shown_somewhere():
    assert NOT_RUN.keys() <= {*COMMANDS, *LINES}


# what a command needs before ------------------------------------------------------------------------


def _with_a_program(folder, words):
    """`restart`: a program of three operations, or one with restart points among its passes, in the words of its name's end."""
    extension = Path(words[1]).suffix[1:]
    post = next(name for name in catalogue.post_names() if catalogue.find_post(name).EXTENSION == extension)
    machine = catalogue.find_machine({"linuxcnc": "mill_3axis"}.get(post, f"mill_{post}"))
    told = program(operation("rough", FLAT, roughing()), operation("finish", BALL, finishing()),
                   operation("last", FLAT, finishing()))
    if words[2].startswith("N"):
        machine, told = known_passes.machine(), known_passes.program()
    (folder / words[1]).write_text(catalogue.find_post(post).post(told, machine).text)
    return words


def _with_a_control(folder, words):
    """`send`: to a control of this machine instead of the one that is shown."""
    shutil.copy(folder / "a.ngc", folder / words[1])
    server = socket.create_server(("127.0.0.1", 0))

    def taken():
        with server, server.accept()[0] as link:
            while link.recv(4096):
                pass
    threading.Thread(target=taken, daemon=True).start()
    return [f"tcp://127.0.0.1:{server.getsockname()[1]}" if w.startswith("tcp://") else w for w in words]


def _with_modes(folder, words):
    """`lobes`: the shown tool with a mode."""
    library = json.loads((ROOT / "posts/tools/tools.json").read_text())
    for tool in library["tools"]:
        if tool["number"] == 5:
            tool["chatter"] = {"modes": [[800.0, 10000.0, 0.03]]}
    (folder / "t.json").write_text(json.dumps(library))
    return words


def _of_these_outputs(folder, words):
    """`repost`: a line and a ball that these outputs have."""
    line = ran("repost", words[1]).stdout.split()[-1]
    tools = json.loads((folder / words[1] / "tools.json").read_text())["tools"]
    ball = next(t for t in tools if t["cutter"]["type"] == "ball")
    return [words[0], words[1], line, "--tool", ball["number"], "--diameter", ball["cutter"]["diameter_mm"] - 0.014, *words[7:]]


def _afresh(folder, words):
    """`new`: where nothing is yet; and cutters --to, which overwrites nothing."""
    for word in words[1:]:
        if (folder / word).is_dir():
            shutil.rmtree(folder / word)
        elif word == "tools.json":
            (folder / word).unlink(missing_ok=True)
    return words


BEFORE = {"restart": _with_a_program, "send": _with_a_control, "lobes": _with_modes, "repost": _of_these_outputs, "new": _afresh,
          "cutters": _afresh}


# blocks of Python --------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", ["README.md", "docs/guides/python.md"])
def test_blocks_of_python_run_one_after_the_other(page, folder, monkeypatch, capsys):
    """A whole build is the one that the folder holds; its parameters are taken, its solid built."""
    whole = cuspline.build

    def built(design, *, stage="report", out="outputs/shown", **given):
        done = whole(design, stage="step" if stage == "report" else stage, out=out, **given)
        return cuspline.outputs("outputs/a") if stage == "report" else done
    monkeypatch.chdir(folder)
    monkeypatch.setattr(cuspline, "build", built)
    for name, target in (("trough.py", "part.py"), ("outputs/part", "outputs/a"), ("outputs/trough", "outputs/a")):
        shutil.rmtree(folder / name, ignore_errors=True)            # that a command before may have left
        if not (folder / name).exists():
            (folder / name).symlink_to(folder / target)
    blocks, scope = re.findall(r"```py\n(.*?)```", (ROOT / page).read_text(), re.S), {}
    for block in blocks:
        exec(compile(block, page, "exec"), scope)
    assert blocks and (page == "README.md" or "depth_mm" in capsys.readouterr().out)
