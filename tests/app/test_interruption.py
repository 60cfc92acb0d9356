"""Ctrl-C at any moment ends with one line, exit code 130 and nothing left behind; a full disk with a sentence and 2."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time

import pytest
from built_parts import saddle_job

from cuspline.app import build, cli
from cuspline.kernel import brep
from cuspline.values import interruption

SAID = ["cuspline: interrupted, nothing half-written is left"]
PRESS = "os.kill(os.getpid(), signal.SIGINT)"
MINE = f"""import os, signal
import cadquery as cq
from cuspline.design import *


def press_and_go_on():
    try:
        {PRESS}
    except BaseException:
        pass


def press_and_fail():
    try:
        {PRESS}
    except BaseException:
        raise SystemError("a binding returned a result with an exception set") from None


def press_while_a_kernel_is_compiled():
    from numba import njit, types
    from numba.extending import overload

    def width(x):
        pass

    @overload(width)
    def _width(x):
        {PRESS}
        return lambda x: x + 1
    njit(lambda x: width(x))(1.0)


%s


def design(p: Parameters):
    %s
    box = cq.Workplane().box(10, 10, 10).val()
    return Design(name="mine", description="", parameters=p, solid=box, material="aluminium_6061",
                  predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1)),),
                  stock=StockBox(min_mm=(-5, -5, -5), max_mm=(5, 5, 6)),
                  finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003),
                  setups=(Setup(name="setup-1", faces=("top",), wcs_in_words=""),))
"""


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """main() with arguments -> (exit code, its messages, what stands in the folder of the outputs)."""
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def call(*arguments, out=tmp_path / "outputs" / "part"):
        monkeypatch.setattr("sys.argv", ["cuspline", *map(str, arguments), "--out", str(out)])
        with pytest.raises(SystemExit) as done:
            cli.main()
        said = capsys.readouterr().err.splitlines()
        there = sorted(p.name for p in out.parent.iterdir()) if out.parent.exists() else []
        return done.value.code, [line for line in said if not line.startswith("  ")], there
    yield call
    signal.signal(signal.SIGINT, before)
    interruption._Asked.is_asked = False


def press():
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("at_import, in_the_function", [
    (PRESS, "pass"), ("", PRESS), ("", "press_and_go_on()"), ("", "press_and_fail()"),
    ("", "press_while_a_kernel_is_compiled()"), ("press_and_fail()", "pass")],
    ids=["while a design is imported", "while it is made", "swallowed", "turned into another error", "in a compiler",
         "an import that fails of it"])
def test_ctrl_c_in_a_design(run, tmp_path, at_import, in_the_function):
    (tmp_path / "mine.py").write_text(MINE % (at_import, in_the_function))
    assert run("build", tmp_path / "mine.py", "--stage", "step") == (130, SAID, [])


@pytest.mark.parametrize("where, name", [(brep, "the_solid"), (brep, "write_step"), (build, "shape_of"), (build, "write_glb"),
                                         (build, "sha256_of"), (build, "_write_json"), (brep, "read_step")])
def test_ctrl_c_before_and_behind_each_step_of_a_build(run, tmp_path, monkeypatch, where, name):
    job, step = saddle_job(tmp_path), getattr(where, name)
    for moments in (("before",), ("behind",)):
        def pressed(*arguments, **named):
            if "before" in moments:
                press()
            made = step(*arguments, **named)
            press()
            return made
        with monkeypatch.context() as change:
            change.setattr(where, name, pressed)
            assert run("build", job, "--stage", "step") == (130, SAID, [])


def test_ctrl_c_while_folders_are_exchanged_waits_until_they_are(run, tmp_path, monkeypatch):
    job, swap = saddle_job(tmp_path), build._swap_in

    def pressed(*folders):
        press()
        swap(*folders)
    monkeypatch.setattr(build, "_swap_in", pressed)
    assert run("build", job, "--stage", "step") == (130, SAID, ["part"])
    assert (tmp_path / "outputs/part/manifest.json").is_file()


def test_a_second_ctrl_c_does_not_stop_the_tidying_up(run, tmp_path, monkeypatch):
    job, remove, write = saddle_job(tmp_path), build.shutil.rmtree, brep.write_step

    def pressed_again(*arguments, **named):
        press()
        remove(*arguments, **named)

    def pressed(*arguments):
        write(*arguments)
        monkeypatch.setattr(build.shutil, "rmtree", pressed_again)
        press()
    monkeypatch.setattr(brep, "write_step", pressed)
    assert run("build", job, "--stage", "step") == (130, SAID, [])


def test_ctrl_c_while_a_step_file_is_read_in_a_child(tmp_path, run, monkeypatch):
    job, begun = saddle_job(tmp_path), time.monotonic()
    from cuspline.kernel import step_files
    monkeypatch.setattr(step_files, "_try_to_read", lambda path: time.sleep(60))
    monkeypatch.setattr(step_files.time, "sleep", lambda seconds: press())
    assert run("build", job, "--stage", "step") == (130, SAID, [])
    assert time.monotonic() - begun < 30


@pytest.mark.parametrize("module", ["typer", "cuspline.app.cli", "cuspline.app.catalogue", "numpy"])
def test_ctrl_c_while_modules_are_imported(module):
    code = ("import os, signal, sys\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
            "class Finder:\n def find_spec(self, name, *_):\n"
            f"  if name == {module!r}: sys.meta_path.remove(self); {PRESS}\n"
            "from cuspline.app.entry import main\nsys.meta_path.insert(0, Finder())\nsys.argv = ['cuspline', 'machines']\nmain()")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (130, "", SAID)


# a full disk ----------------------------------------------------------------------------------------------


def in_a_child(work):
    """(exit code, standard error) of a function in a child process."""
    to_read, to_write = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(to_write, 2)
        sys.stderr = open(2, "w", buffering=1, closefd=False)
        os._exit(work())
    os.close(to_write)
    with open(to_read) as file:
        said = file.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), said


@pytest.mark.parametrize("room", [0, 500, 5000, 12000])
def test_a_disk_that_fills_up_at_any_write(tmp_path, room):
    """A limit on every file's size stands for the disk: the system refuses further bytes in the same way."""
    job, out = saddle_job(tmp_path), tmp_path / "outputs" / "part"

    def work():
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
        return cli.run(["build", str(job), "--stage", "step", "--out", str(out)])
    code, said = in_a_child(work)
    messages = [line for line in said.splitlines() if line.startswith("cuspline: ")]
    assert code == 2 and len(messages) == 1 and "make room on that disk" in messages[0], said
    assert list(out.parent.iterdir()) == []


@pytest.mark.parametrize("where, name", [(build, "write_glb"), (build, "_write_json"), (brep, "write_step"), (build, "_swap_in")])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
def test_what_the_system_refuses_is_told_with_its_mending(run, tmp_path, monkeypatch, where, name, number):
    def refused(*arguments, **named):
        raise OSError(number, os.strerror(number), "somewhere.step")
    job = saddle_job(tmp_path)
    monkeypatch.setattr(where, name, refused)
    code, said, there = run("build", job, "--stage", "step")
    assert (code, len(said), there) == (2, 1, [])
    assert os.strerror(number) in said[0] and "somewhere.step" in said[0]


def test_standard_output_on_a_full_disk():
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-c", "from cuspline.app.entry import main; main()", "machines"], stdout=full,
                              stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and done.stderr.startswith("cuspline: No space left"), done.stderr
