"""LinuxCNC's five-axis kinematics modules, called one by one without its controller (kinematics_host.c)."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

MODULES = Path("/usr/lib/linuxcnc/modules")
HOST = Path(__file__).parent / "kinematics_host.c"
X, Y, Z, A, B, C = range(6)         # columns of a pose


def missing():
    """Why no module can be called here; "" when one can."""
    if not os.access(MODULES / "xyzac-trt-kins.so", os.R_OK):
        return "LinuxCNC's kinematics modules are not installed (run .ci/install_linuxcnc.sh)"
    return "" if shutil.which("gcc") else "gcc is missing, which calling LinuxCNC's kinematics modules needs"


def built_host(folder):
    """The program that calls a module, in a folder."""
    out = Path(folder) / "kinematics_host"
    subprocess.run(["gcc", "-O2", "-rdynamic", str(HOST), "-o", str(out), "-ldl", "-lm"], check=True, capture_output=True)
    return out


def joints_of(host, module, pins, poses):
    """(n, 9) joints of poses (n, 9): X Y Z in mm, A B C in degrees, U V W."""
    return _asked(host, module, pins, "i", poses)


def poses_of(host, module, pins, joints):
    """(n, 9) poses of joints (n, 9)."""
    return _asked(host, module, pins, "f", joints)


def _asked(host, module, pins, what, rows):
    lines = "".join(f"{what} {' '.join(repr(float(v)) for v in row)}\n" for row in rows)
    command = [str(host), str(MODULES / f"{module}.so"), *(f"{name}={value!r}" for name, value in pins.items())]
    run = subprocess.run(command, input=lines, capture_output=True, text=True, timeout=60)
    if run.returncode:
        raise RuntimeError(f"{module}: {run.stderr.strip() or run.returncode}")
    return np.array([[float(v) for v in line.split()] for line in run.stdout.splitlines()])
