"""The whole LinuxCNC controller without display: how a machine really drives a program, each joint on its own.

A run has its own process, IPC, network and mount namespaces and an unprivileged user, so runs go side
by side and nothing outlives them.  Under the virtual clock (virtual_clock.c) it takes seconds.
"""

import json
import math
import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cuspline.posts.readers.rs274_reader import read_program

from .deviation import deviation_mm, path_of
from .interpreter import SYSTEM_PYTHON, write_parameters, write_tool_table

HERE = Path(__file__).parent
SERVO_PERIOD_S = 0.001
NOBODY = "65534"
LONGEST_RUN_S = 6 * 3600.0      # of the controller's time
LONGEST_WAIT_S = 600.0          # of real time
ENDLESS_DEG = ENDLESS_MM = 1e6
SAMPLER_ROWS = 32768            # 32 s of servo cycles
NEEDED = ("/usr/bin/milltask", "/usr/bin/io", "/usr/bin/linuxcncsvr", "/usr/bin/halcmd", "/usr/bin/rtapi_app")


@dataclass(frozen=True, eq=False, kw_only=True)
class ControllerRun:
    """What the controller did with a program; one row a servo cycle."""

    position_mm: np.ndarray     # (n, 3) spindle nose, machine coordinates
    turned_deg: np.ndarray      # (n, r) rotaries, from the part to the tool
    line: np.ndarray            # (n,) program line the motion belonged to
    is_finished: bool           # the program came to its end without an error
    errors: tuple[str, ...]
    moving_s: float             # cycles in which an axis moved
    program_s: float            # first to last of them: dwells and tool changes too
    wall_s: float


@dataclass(frozen=True, eq=False, kw_only=True)
class DrivenPath(ControllerRun):
    """A run beside the path it was to follow."""

    distance_mm: np.ndarray     # (n,) of each servo sample to the programmed path
    deviation_mm: float         # largest distance of a servo sample to the programmed path
    deviation_line: int         # where
    end_gap_mm: float           # last sample to the last programmed place


def missing():
    """Why no controller can be run here; "" when it can."""
    if not all(os.access(path, os.X_OK) for path in NEEDED):
        return "LinuxCNC's controller is not installed (run .ci/install_linuxcnc.sh)"
    for tool in ("gcc", "unshare", "setpriv"):
        if not shutil.which(tool):
            return f"{tool} is missing, which running LinuxCNC's controller needs"
    probe = subprocess.run([*_isolation(), "/bin/true"], capture_output=True, text=True)
    return "" if probe.returncode == 0 else f"no namespaces for LinuxCNC's controller: {probe.stderr.strip()}"


def run_on_controller(program_path, tools, machine):
    """Drive a program on a simulated machine and compare with the path that our reader reads.

    Args:
        tools: {number: tool length, mm}.
        machine: cuspline.shop.machines.Machine; G54 lies at its wcs_origin_mm.
    Returns:
        DrivenPath.
    Raises:
        ReadError: our reader refuses the program.
    """
    offsets = {"G54": machine.wcs_origin_mm}
    moves = read_program(Path(program_path).read_text(), work_offsets=offsets, tool_lengths=tools)
    run = drive(program_path, tool_lengths=tools, work_offsets=offsets, machine=machine)
    path = path_of(moves, home_mm(machine))
    distance_mm = deviation_mm(run.position_mm, run.line, path, near_mm=machine.control.path_tolerance_mm)
    worst = int(np.argmax(distance_mm)) if len(distance_mm) else -1
    return DrivenPath(**run.__dict__, distance_mm=distance_mm, deviation_mm=float(distance_mm[worst]) if worst >= 0 else math.inf,
                      deviation_line=int(run.line[worst]) if worst >= 0 else 0,
                      end_gap_mm=float(np.linalg.norm(run.position_mm[-1] - path.end_mm[-1])))


def home_mm(machine):
    """Where the simulated machine stands after homing: top of Z, X and Y in the middle."""
    return np.array([(machine.x.min_mm + machine.x.max_mm) / 2, (machine.y.min_mm + machine.y.max_mm) / 2,
                     machine.z.max_mm])


def drive(program_path, *, tool_lengths, work_offsets, machine, spindle=None):
    """Run a program on the controller.

    Args:
        spindle: spindles.Spindle, whose kinematics the program switches on by M68 E3; None: joints alone.
    Returns:
        ControllerRun; errors of the controller stand in it.
    Raises:
        RuntimeError: the simulator itself did not work.
    """
    with tempfile.TemporaryDirectory(prefix="controller.") as folder:
        folder = Path(folder)
        _write_job(folder, program_path, tool_lengths, work_offsets, machine, spindle)
        begin = time.monotonic()
        _run_session(folder)
        verdict = json.loads((folder / "verdict").read_text())
        samples = folder / "samples"
        columns = 4 + len(machine.rotaries)
        table = np.fromfile(samples).reshape(-1, columns) if samples.exists() else np.empty((0, columns))
        if spindle:         # its joints are X Y Z and the rotaries by the alphabet
            table = table[:, [0, 1, 2, *(3 + sorted(machine.rotaries).index(c) for c in machine.rotaries), columns - 1]]
    return _run_from(table, verdict, time.monotonic() - begin)


def _run_from(table, verdict, wall_s):
    moving = np.flatnonzero(np.any(np.diff(table[:, :-1], axis=0), axis=1))
    span = int(moving[-1] + 1 - moving[0]) if len(moving) else 0
    return ControllerRun(
        position_mm=table[:, :3], turned_deg=table[:, 3:-1], line=table[:, -1].astype(int), is_finished=verdict["finished"],
        errors=tuple(verdict["errors"]), moving_s=len(moving) * SERVO_PERIOD_S, program_s=span * SERVO_PERIOD_S,
        wall_s=wall_s)


# the configuration ----------------------------------------------------------------------------------

def _write_job(folder, program_path, tool_lengths, work_offsets, machine, spindle):
    shutil.copy(program_path, folder / "program.ngc")
    shutil.copy(HERE / "controller_session.py", folder)
    (folder / "sim.ini").write_text(_ini(folder, machine, spindle))
    (folder / "sim.hal").write_text(_hal(3 + len(machine.rotaries), spindle))
    write_tool_table(folder / "tool.tbl", tool_lengths)
    write_parameters(folder / "sim.var", work_offsets)
    job = {"folder": str(folder), "ini": str(folder / "sim.ini"), "hal": str(folder / "sim.hal"),
           "program": str(folder / "program.ngc"), "sample_types": "f" * (3 + len(machine.rotaries)) + "s",
           "longest_s": LONGEST_RUN_S,
           "clock": str(_virtual_clock(folder))}
    (folder / "job").write_text(json.dumps(job))


def _virtual_clock(folder):
    library = folder / "virtual_clock.so"
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", str(HERE / "virtual_clock.c"), "-o", str(library),
                    "-ldl", "-lpthread"], check=True, capture_output=True)
    return library


def _ini(folder, machine, spindle):
    """The machine as LinuxCNC wants it; COMM_TIMEOUT so long that a busy computer aborts nothing."""
    rotaries = sorted(machine.rotaries) if spindle else machine.rotaries
    kinematics = f"{spindle.module}{spindle.first}" if spindle else f"trivkins coordinates={''.join(('X', 'Y', 'Z', *rotaries))}"
    diagonal_mm_per_s = math.hypot(*(axis.rapid_mm_per_min / 60 for axis in machine.axes))
    diagonal_mm_per_s2 = math.hypot(*(axis.acceleration_mm_per_s2 for axis in machine.axes))
    return f"""[EMC]
VERSION = 1.1
MACHINE = {machine.name.replace(" ", "-")}
[DISPLAY]
DISPLAY = none
PROGRAM_PREFIX = {folder}
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = {folder}/sim.var
RS274NGC_STARTUP_CODE = G21 G17 G90 G94 G40 G49 G80 G54
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 3600
SERVO_PERIOD = {SERVO_PERIOD_S * 1e9:.0f}
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.02
TOOL_TABLE = {folder}/tool.tbl
[KINS]
KINEMATICS = {kinematics}
JOINTS = {3 + len(machine.rotaries)}
[TRAJ]
COORDINATES = {" ".join(("X", "Y", "Z", *rotaries))}
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = {diagonal_mm_per_s}
MAX_LINEAR_VELOCITY = {diagonal_mm_per_s}
DEFAULT_LINEAR_ACCELERATION = {diagonal_mm_per_s2}
MAX_LINEAR_ACCELERATION = {diagonal_mm_per_s2}
""" + "".join(_axis_ini(*row, ENDLESS_MM if spindle else 0.0)
               for row in zip("XYZ", range(3), machine.axes, home_mm(machine))) + "".join(
        _rotary_ini(letter, 3 + k, getattr(machine, letter.lower())) for k, letter in enumerate(rotaries))


def _axis_ini(letter, joint, axis, home, more):
    """`more`: how far the tip may go beyond the joint's travel."""
    return _joint_ini(letter, joint, "LINEAR", home, (axis.min_mm, axis.max_mm), axis.rapid_mm_per_min / 60,
                      axis.acceleration_mm_per_s2, more)


def _rotary_ini(letter, joint, axis):
    limits = (-ENDLESS_DEG, ENDLESS_DEG) if axis.min_deg is None else (axis.min_deg, axis.max_deg)
    return _joint_ini(letter, joint, "ANGULAR", 0.0, limits, axis.rapid_deg_per_min / 60, axis.acceleration_deg_per_s2)


def _joint_ini(letter, joint, type_, home, span, speed, acceleration, more=0.0):
    limits = lambda more: f"""MIN_LIMIT = {span[0] - more}
MAX_LIMIT = {span[1] + more}
MAX_VELOCITY = {speed}
MAX_ACCELERATION = {acceleration}
"""
    return f"""[AXIS_{letter}]
{limits(more)}[JOINT_{joint}]
TYPE = {type_}
{limits(0.0)}HOME = {home}
HOME_OFFSET = {home}
HOME_SEARCH_VEL = 0
HOME_LATCH_VEL = 0
HOME_SEQUENCE = 0
FERROR = 10
MIN_FERROR = 10
"""


def _hal(joints, spindle):
    """Ideal motors and tool changer; the sampler reads joints and line every servo cycle."""
    lines = ["loadrt [KINS]KINEMATICS",
             "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS",
             f"loadrt sampler depth={SAMPLER_ROWS} cfg={'f' * joints}s",
             "addf motion-command-handler servo-thread", "addf motion-controller servo-thread",
             "addf sampler.0 servo-thread",
             *(f"net motor-{k} joint.{k}.motor-pos-cmd => joint.{k}.motor-pos-fb" for k in range(joints)),
             # not the motor's position, which counts from where homing found it
             *(f"net joint-{k} joint.{k}.pos-cmd => sampler.0.pin.{k}" for k in range(joints)),
             f"net line motion.program-line => sampler.0.pin.{joints}",
             "net enabled iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in",
             "net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared",
             "net change iocontrol.0.tool-change => iocontrol.0.tool-changed"]
    return "\n".join([*lines, *(_switch_hal(spindle) if spindle else ())]) + "\n"


def _switch_hal(spindle):
    """The module's points, the tool's length, and what switches it on."""
    pins = {name: value for name, value in spindle.pins(0.0)[0].items() if name != "switch"}
    return [*(f"setp {spindle.module}.{name} {value!r}" for name, value in pins.items()),
            f"net tool-length motion.tooloffset.z => {spindle.module}.{spindle.length_pin}",
            "net kinematics motion.analog-out-03 => motion.switchkins-type"]


# the processes --------------------------------------------------------------------------------------

def _isolation():
    """Own namespaces, and an ordinary user that stays one: rtapi_app may be setuid root."""
    spaces = ["--fork", "--pid", "--kill-child=KILL", "--mount-proc", "--ipc", "--net", "--mount"]
    if os.geteuid():
        return ["unshare", "--user", "--map-current-user", *spaces, "setpriv", "--no-new-privs"]
    return ["unshare", *spaces, "setpriv", "--reuid", NOBODY, "--regid", NOBODY, "--clear-groups", "--no-new-privs"]


def _run_session(folder):
    environment = {
        "HOME": folder, "TMPDIR": folder, "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C", "USER": "cnc",
        "LINUXCNC_HOME": "/usr", "HAL_RTMOD_DIR": "/usr/lib/linuxcnc/modules", "RTAPI_FIFO_PATH": folder / "rtapi",
        "INI_FILE_NAME": folder / "sim.ini", "LINUXCNC_NCFILES_DIR": folder,
        "LD_PRELOAD": folder / "virtual_clock.so", "VIRTUAL_CLOCK_FILE": folder / "clock"}
    command = [*_isolation(), "env", "-i", *(f"{name}={value}" for name, value in environment.items()),
               SYSTEM_PYTHON, str(folder / "controller_session.py"), str(folder / "job")]
    _give_to_nobody(folder)
    with open(folder / "outer", "w") as log:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        try:
            process.wait(LONGEST_WAIT_S)
        except subprocess.TimeoutExpired:
            pass
        finally:
            process.kill()          # unshare takes its whole namespace with it
            process.wait()
    if not (folder / "verdict").exists():
        raise RuntimeError("LinuxCNC's controller gave no verdict:\n" + _last_words(folder))


def _give_to_nobody(folder):
    if os.geteuid() == 0:
        for path in (folder, *folder.iterdir()):
            os.chown(path, int(NOBODY), int(NOBODY))


def _last_words(folder):
    logs = [folder / name for name in ("outer", "log") if (folder / name).exists()]
    return "\n".join(log.read_text(errors="replace")[-2000:] for log in logs)
