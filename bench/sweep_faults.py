"""Sweeps whose processes are killed: the same rows, byte for byte, as from one process; and what a sweep costs.

    python bench/sweep_faults.py            all of it, some minutes; tables for RESULTS.md
    python bench/sweep_faults.py local      one part of it: speed, local, cluster or rows

64 variants of the block with a trough, to the stage `step`.  Only processes that the sweep or this file has started are killed.
How busy processes are is asked of the kernel (schedstat: on a core, and waiting for one), so that other work on the machine
does not count: a process that waits for a core would run on an idle machine.
"""

import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from peers import HERE

from cuspline.app import sweep, sweep_workers
from cuspline.app.request import Request

PART = HERE.parent / "pipeline/app/repository/trough.py"
AXES = ("depth_mm=1:4:8", "length_mm=20:34:8")
KILLS, SEED, ROUNDS = 10, 19, 6
ADDRESS = "tcp://127.0.0.1:{port}"
COMMAND = Path(sys.executable).with_name("cuspline")


def main(wanted):
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        if wanted in ("", "rows"):
            rows(folder)
        alone = one_process(folder) if wanted != "rows" else None
        if wanted in ("", "speed"):
            speed(folder)
        if wanted in ("", "local"):
            local(folder, alone)
        if wanted in ("", "cluster"):
            cluster(folder, alone)


def variants(out):
    return sweep.variants(Request(design=PART, stage="step"), AXES, None, out)


def one_process(folder):
    """The table that this process comes to alone, every variant after the other."""
    begin = time.perf_counter()
    text = sweep.csv_text([sweep.built(v) for v in variants(folder / "alone")])
    print(f"one process: {text.count(chr(10)) - 1} rows in {time.perf_counter() - begin:.0f} s", flush=True)
    return text


# speed -------------------------------------------------------------------------------------------


def speed(folder):
    """Variants a second of processes that never wait for a core, two against one: the best of several rounds, in turn."""
    tries = [{count: rate(folder / f"speed-{count}-{k}", count) for count in (1, 2)} for k in range(ROUNDS)]
    found = {count: max(t[count] for t in tries) for count in (1, 2)}          # the least disturbed
    for count, (per_s, wall_s, busy) in found.items():
        print(f"{count} worker(s): {wall_s:.0f} s, busy {busy:.1%} of it, {per_s:.3f} variants/s were no other work there",
              flush=True)
    print(f"two against one: {found[2][0] / found[1][0]:.2f}", flush=True)


def rate(out, count):
    """(variants a second that a machine without other work would make, seconds of the clock, share that workers had work).

    From when each process has built two, and imported what it needs, to where one begins to have nothing to do.
    """
    pool = sweep_workers._Pool(threads=1, needs="cuspline.app.request")
    try:
        for _ in range(count):
            pool.begin()
        while pool.beginning:
            pool._begun(next(iter(pool.beginning)))
        work = variants(out)
        first, last = 2 * count, len(work) - count + 1
        for done, _ in enumerate(pool.run(list(work)), 1):
            if done == first:
                begin, before = time.perf_counter(), wanted_s(pool)
            if done == last:
                break
        wall, (on, waited) = time.perf_counter() - begin, (b - a for a, b in zip(before, wanted_s(pool)))
    finally:
        pool.end()
    # a worker that waits for a core would be on it, were no other work there
    return (last - first) / (wall - waited / count), wall, (on + waited) / (wall * count)


def wanted_s(pool):
    """(seconds on a core, seconds in wait of one) of all threads of the workers."""
    rows = [p.read_text().split() for w in pool.workers.values() for p in Path(f"/proc/{w.pid}/task").glob("*/schedstat")]
    return tuple(sum(int(r[k]) for r in rows) / 1e9 for k in (0, 1))


# what is killed ----------------------------------------------------------------------------------


def children(pid):
    """Processes that a process has started, by the kernel's list."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, rest = path.read_text().split(" (", 1)
            if int(rest.rsplit(")", 1)[1].split()[1]) == pid and b"spawn_main" in (path.parent / "cmdline").read_bytes():
                found.append(int(number))
        except (OSError, ValueError):
            continue
    return found


def kill_at_random(process, workers, kills):
    """`kill -9` of one of workers() at random moments while a process runs; how many there were."""
    chance, done = random.Random(SEED), 0
    while done < kills and process.poll() is None:
        time.sleep(chance.uniform(1.0, 4.0))
        there = workers()
        if there:
            try:
                os.kill(chance.choice(there), signal.SIGKILL)
                done += 1
            except ProcessLookupError:
                continue
    return done


def sweep_command(out, *more):
    axes = [word for axis in AXES for word in ("-p", axis)]
    return subprocess.Popen([COMMAND, "sweep", PART, *axes, "--stage", "step", "--out", out, *more],
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def same(out, alone):
    text = (out / "sweep.csv").read_text()
    return f"{text.count(chr(10)) - 1} rows, " + ("the same bytes" if text == alone else "OTHER BYTES")


def local(folder, alone):
    """Workers killed; the sweep itself killed, then run again."""
    out = folder / "local"
    process = sweep_command(out, "--workers", "2")
    kills = kill_at_random(process, lambda: children(process.pid), KILLS)
    process.communicate()
    print(f"{kills} workers killed: {same(out, alone)}", flush=True)
    out = folder / "ended"
    process = sweep_command(out, "--workers", "2")
    wait_for_rows(out, 20)
    process.kill()
    process.communicate()
    again = sweep_command(out, "--workers", "2")
    told = again.communicate()[0].splitlines()[0]
    print(f"the sweep killed, run again: {told}; {same(out, alone)}", flush=True)


def wait_for_rows(out, count, keep=lambda: None):
    while len(list(out.glob("rows/*.json"))) < count:
        keep()
        time.sleep(0.05)


def cluster(folder, alone):
    """A scheduler and two workers of dask.distributed: workers killed, the scheduler killed, the sweep run again."""
    out, port = folder / "cluster", 18786
    address = ADDRESS.format(port=port)
    there = Cluster(address, port, folder)
    try:
        there.begin()
        process = sweep_command(out, "--scheduler", address)
        kills = kill_at_random(process, there.workers, KILLS // 2)
        wait_for_rows(out, 32, there.workers)
        there.scheduler.kill()
        told = process.communicate()[0].splitlines()[-1]
        print(f"{kills} workers of a cluster killed, then its scheduler: exit {process.returncode}: {told}", flush=True)
        there.end()
        there.begin()
        process = sweep_command(out, "--scheduler", address)
        kills = kill_at_random(process, there.workers, KILLS - KILLS // 2)
        told = process.communicate()[0].splitlines()[0]
        print(f"again, {kills} workers killed: {told}; {same(out, alone)}", flush=True)
    finally:
        there.end()


class Cluster:
    """A scheduler and two workers, each with a nanny that starts it again, and is started again itself where it has given up."""

    def __init__(self, address, port, folder):
        self.address, self.port, self.folder = address, port, folder
        self.scheduler, self.nannies = None, []

    def begin(self):
        self.scheduler = dask("scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard")
        while True:
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                break
            except OSError:
                time.sleep(0.2)
        self.nannies = [self._worker(), self._worker()]

    def _worker(self):
        return dask("worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard",
                    "--local-directory", str(self.folder / "dask"))

    def workers(self):
        """Processes that work, or are about to."""
        self.nannies = [n if n.poll() is None else self._worker() for n in self.nannies]
        return [p for n in self.nannies for p in children(n.pid)]

    def end(self):
        for process in (*self.nannies, self.scheduler):
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
        self.nannies = []


def dask(*words):
    return subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]], stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


# bookkeeping -------------------------------------------------------------------------------------


def rows(folder):
    """1000 builds that take no time: what is left is bookkeeping."""
    sys.path.insert(0, str(HERE.parent / "tests/parts"))
    from sweep_stubs import StubRequest

    from cuspline.app.sweep_run import Sweep
    out, made = folder / "rows", []
    for number, values in enumerate(sweep.grid(("a=4:9:40", "b=5:9:25"))):
        name = sweep.folder_name(values)
        request = StubRequest(parameters=tuple(f"{n}={v}" for n, v in values), out=out / "variants" / name)
        made.append(sweep.Variant(number=number, values=values, request=request, inputs_sha256="x",
                                  row_file=out / "rows" / f"{name}.json"))
    stub = Sweep(request=None, texts=(), sample=None, out=out)
    object.__setattr__(stub, "_checked", lambda: made)
    begin = time.process_time()
    stub.run(2, None, lambda line: None)
    spent = time.process_time() - begin
    print(f"bookkeeping of {len(made)} builds: {spent:.1f} s of the sweep's own process, {1000 * spent / len(made):.1f} ms each",
          flush=True)
    shutil.rmtree(out)


if __name__ == "__main__":
    main((sys.argv[1:] or [""])[0])
