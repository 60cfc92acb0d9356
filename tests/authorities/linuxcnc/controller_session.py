"""Runs under the system's Python as the first process of its own namespaces: one program on LinuxCNC.

Argument: the job, a JSON file written by controller.py.  Brings the controller up step by step, as
LinuxCNC's own start script does but without its lock file and its kill-by-name, runs the program in
AUTO and writes two files: `samples`, rows of doubles (x, y, z of the spindle nose, program line) one a
servo cycle, and `verdict`, JSON {finished, errors}.
"""

import array
import ctypes
import json
import os
import signal
import subprocess
import sys
import threading
import time

PARENT_DEATH_SIGNAL = 1     # prctl; setpriv's change of user has cleared what unshare asked for
START_S = 30                # longest wait for any step of the start, real time
DRAIN_S = 0.05              # virtual time between two readings of the sampler, which holds 30 s
IDLE_POLLS = 3              # the interpreter is idle for a moment at every M0 too

with open(sys.argv[1]) as file:
    job = json.load(file)
os.chdir(job["folder"])
ctypes.CDLL(None).prctl(PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
log = open("log", "a")


def finish(finished, errors):
    """Write the verdict and go; as this is process 1, the kernel ends all others of the namespace."""
    with open("verdict.part", "w") as file:
        json.dump({"finished": finished, "errors": errors}, file)
    os.rename("verdict.part", "verdict")
    os._exit(0)


def run(*command):
    """One step of the start."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=START_S)
    if done.returncode:
        finish(False, [f"start of the controller: {' '.join(command)} returned {done.returncode}"])


def bring_up():
    """All of the controller's processes, in the order in which they need each other."""
    run("linuxcncsvr", "-ini", job["ini"])
    run("halcmd", "loadusr", "-Wn", "iocontrol", "io", "-ini", job["ini"])
    run("halcmd", "loadrt", "tpmod")
    run("halcmd", "loadrt", "homemod")
    run("halcmd", "-i", job["ini"], "-f", job["hal"])
    task = subprocess.Popen(["halcmd", "loadusr", "-Wn", "inihal", "milltask", "-ini", job["ini"]],
                            stdin=subprocess.DEVNULL, stdout=log, stderr=log)
    run("halcmd", "start")
    if task.wait(timeout=START_S):
        finish(False, ["milltask did not start"])


bring_up()
import hal  # noqa: E402  both attach to the shared memory made above
import linuxcnc  # noqa: E402


class Operator:
    """Who stands at the machine: presses its buttons and reads its messages."""

    def __init__(self):
        self.status, self.command, self.messages = connected_status(), linuxcnc.command(), linuxcnc.error_channel()
        self.errors = []

    def look(self):
        """Read status and messages; True while nothing is wrong."""
        self.status.poll()
        message = self.messages.poll()
        while message:
            if message[0] in (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR):
                self.errors.append(" ".join(message[1].split()))
            message = self.messages.poll()
        return not self.errors

    def wait(self, what, claim):
        """Wait until the claim about the status is true."""
        give_up = time.monotonic() + START_S
        while not claim(self.status):
            if not self.look() or time.monotonic() > give_up:
                finish(False, self.errors or [f"the controller did not come to: {what}"])
            time.sleep(0.005)
            self.status.poll()

    def switch_on(self):
        """Emergency stop off, power on, all joints homed, AUTO, the program loaded."""
        self.command.state(linuxcnc.STATE_ESTOP_RESET)
        self.command.wait_complete()
        self.command.state(linuxcnc.STATE_ON)
        self.wait("power on", lambda s: s.task_state == linuxcnc.STATE_ON)
        self.command.mode(linuxcnc.MODE_MANUAL)
        self.command.wait_complete()
        self.command.home(-1)
        self.wait("homed", lambda s: all(s.homed[:s.joints]))
        self.command.mode(linuxcnc.MODE_AUTO)
        self.command.wait_complete()
        self.command.program_open(job["program"])
        self.wait("program loaded", lambda s: s.file == job["program"])

    def run_program(self):
        """True when the program came to its end."""
        give_up = time.monotonic() + job["longest_s"]
        has_begun, idle = False, 0
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        while idle < IDLE_POLLS:
            if not self.look() or self.status.task_state != linuxcnc.STATE_ON:
                return False
            if time.monotonic() > give_up:
                self.errors.append(f"not finished after {job['longest_s']:g} s of the controller's time")
                return False
            has_begun = has_begun or self.status.interp_state != linuxcnc.INTERP_IDLE
            idle = idle + 1 if has_begun and is_at_rest(self.status) else 0
            if self.status.interp_state == linuxcnc.INTERP_PAUSED and self.status.inpos:
                self.command.auto(linuxcnc.AUTO_RESUME)         # M0, M1
            time.sleep(0.02)
        return self.status.exec_state != linuxcnc.EXEC_ERROR


def is_at_rest(status):
    return (status.interp_state == linuxcnc.INTERP_IDLE and status.exec_state == linuxcnc.EXEC_DONE
            and status.queue == 0 and status.inpos)


def connected_status():
    """The status channel, once the task has written something into it."""
    give_up = time.monotonic() + START_S
    while time.monotonic() < give_up:
        try:
            status = linuxcnc.stat()
            status.poll()
            if status.axis_mask and status.joints:
                return status
        except linuxcnc.error:
            pass
        time.sleep(0.02)
    finish(False, ["the controller gives no status"])


class Recorder:
    """Empties the sampler into a file until told to stop; counts cycles that were lost."""

    def __init__(self):
        component = hal.component("recorder")
        self.stream = hal.stream(component, hal.sampler_base, job["sample_types"])
        component.ready()
        while self.stream.readable:         # what stands there from before homing
            self.stream.read()
        self.is_wanted, self.lost, self.previous = True, 0, None
        self.thread = threading.Thread(target=self.loop, daemon=True)
        self.thread.start()

    def loop(self):
        with open("samples", "wb") as file:
            is_last = False
            while not is_last:
                is_last, rows = not self.is_wanted, array.array("d")
                while self.stream.readable:
                    rows.extend(self.stream.read())
                    number = self.stream.sampleno
                    self.lost += 0 if self.previous is None else number - self.previous - 1
                    self.previous = number
                rows.tofile(file)
                time.sleep(DRAIN_S)

    def stop(self):
        """After one last reading; waits asleep, for a wait on a lock would hold the clock."""
        self.is_wanted = False
        while self.thread.is_alive():
            time.sleep(DRAIN_S)


operator = Operator()
operator.switch_on()
recorder = Recorder()
clock = ctypes.CDLL(job["clock"]) if job["clock"] else None
if clock:
    clock.virtual_clock_start()
is_finished = operator.run_program()
recorder.stop()
if clock:
    clock.virtual_clock_stop()
operator.look()
if recorder.lost:
    operator.errors.append(f"{recorder.lost} servo samples were lost")
finish(is_finished and not operator.errors, operator.errors)
