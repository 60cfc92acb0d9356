"""Parts built once a test session, by the command line, into a folder that all workers share."""

import fcntl
import io
import os
import shutil
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from cuspline.app import cli

NARROW = "width_mm=16"          # of the default part: a fifth of the passes, all kinds of moves and faces
SADDLE_JOB = """step = "saddle.step"
description = "saddle out of a STEP file"
material = "aluminium_6061"

[stock]
min_mm = [0, 0, 0]
max_mm = [30, 16, 13]

[finish]
scallop_mm = 0.05
profile_tolerance_mm = 0.004
gouge_mm = 0.006

[[faces]]
name = "saddle"
count = 1
center_min_mm = [10, 5, 7]
center_max_mm = [20, 11, 12.5]

[[setups]]
name = "setup-1"
wcs_in_words = "corner of the block, Z0 on its base"
faces = ["saddle"]
"""


def cuspline(*arguments, env=(), timeout=300):
    """Run the command line in its own process."""
    return subprocess.run([sys.executable, "-c", "from cuspline.app.cli import main; main()", *map(str, arguments)],
                          capture_output=True, text=True, timeout=timeout, env={**os.environ, **dict(env)})


def ran(*arguments):
    """Run the command line in this process, where all that it imports is at hand already; as `cuspline` gives it."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = cli.run([str(a) for a in arguments])
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def saddle_job(folder, **changes):
    """Write saddle.step and saddle.toml into a folder.

    Args:
        changes: line of the job -> line in its place, keyed by the first word.
    Returns:
        Path of the job file.
    """
    import cadquery as cq

    from cuspline.kernel import brep
    body = cq.Workplane("XZ").lineTo(30, 0).lineTo(30, 12).threePointArc((15, 8), (0, 12)).close().extrude(-16)
    brep.write_step(brep.the_solid(body.val(), "saddle"), Path(folder) / "saddle.step", "saddle")
    lines = [f"{line.split(' ')[0]} = {changes[line.split(' ')[0]]}" if line.split(" ")[0] in changes else line
             for line in SADDLE_JOB.splitlines()]
    job = Path(folder) / "saddle.toml"
    job.write_text("\n".join(lines) + "\n")
    return job


def built_once(tmp_path_factory, name, *arguments):
    """Output folder of `cuspline build ...`, made by the first worker that asks."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder = shared / f"built-{name}"
    with open(shared / f"{name}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            done = ran("build", *arguments, "--out", folder)
            assert done.returncode == 0, done.stderr + done.stdout
    return folder


def copied(folder, target):
    """A copy that may be spoilt."""
    shutil.copytree(folder, target)
    return target
