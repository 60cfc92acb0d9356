"""The peers' own environment, .bench-venv, and jobs run as child processes: arrays in, arrays and seconds out."""

import json
import os
import re
import subprocess
import sys
import venv
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
ENVIRONMENT = HERE.parent / ".bench-venv"
PINS = ("numpy==2.4.6", "opencamlib==2023.1.11", "meshlib==3.1.4.297", "coal==3.0.3")


def peak_mb():
    """Largest memory this process has held so far (Linux); getrusage would hand down that of the parent."""
    return int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1]) / 1024


def peer_python():
    """Python of the peers' environment, made where it is missing, and the set of pins that it holds."""
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        try:
            venv.create(ENVIRONMENT, with_pip=True, clear=True)
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"no environment for the peers, their rows are left out: {error}", file=sys.stderr)
            return python, set()
    return python, {pin for pin in PINS if _holds(python, pin) or _install(python, pin)}


def _holds(python, pin):
    name, wanted = pin.split("==")
    asked = subprocess.run([python, "-c", f"from importlib.metadata import version; print(version('{name}'))"],
                           capture_output=True, text=True)
    return asked.stdout.strip() == wanted


def _install(python, pin):
    done = subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", pin],
                          capture_output=True, text=True)
    if done.returncode:
        print(f"{pin} cannot be installed here; its rows are left out: {done.stderr.strip().splitlines()[-1:]}",
              file=sys.stderr)
    return done.returncode == 0


def run_job(python, script, folder, mesh, tasks, threads=1, repeats=3):
    """Results of one script on one mesh; arrays that tasks name are already in the folder."""
    np.save(folder / "vertices.npy", mesh[0])
    np.save(folder / "triangles.npy", mesh[1])
    (folder / "job.json").write_text(json.dumps({"threads": threads, "repeats": repeats, "tasks": tasks}))
    threads_of = {name: str(threads) for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    subprocess.run([python, HERE / f"{script}_job.py", folder], check=True, env={**os.environ, **threads_of})
    return json.loads((folder / f"results {script}.json").read_text())
