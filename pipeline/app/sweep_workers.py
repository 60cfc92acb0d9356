"""Variants handed out to processes: here, or on a cluster of dask.distributed; a process that dies has its variant built again."""

import math
import os
import signal
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing import connection, get_context

from cuspline.app.sweep import FAULT, built
from cuspline.values import interruption
from cuspline.values.errors import InputError

TRIES = 3                       # of one variant, whose process died
STILLBORN = 20                  # processes that may die one after the other while they import
ANSWER_S = 10                   # a scheduler is waited for
LOOK_S = 0.2                    # how often Ctrl-C is looked for
DIED = "its process was ended {tries} times, by signal or for want of memory"


def in_processes(variants, count, threads):
    """Rows as they are done: an iterator of (Variant, row).

    Args:
        variants: sweep.Variant values.   count: processes.   threads: of each.
    """
    pool = _Pool(threads=threads, needs=type(variants[0].request).__module__)
    try:
        for _ in range(min(count, len(variants))):
            pool.begin()
        yield from pool.run(list(variants))
    finally:
        pool.end()


@dataclass(eq=False)
class _Pool:
    """Processes that stay; each holds at most one variant."""

    threads: int
    needs: str                                          # the module that a process imports before it takes a variant
    workers: dict = field(default_factory=dict)         # connection -> process
    beginning: set = field(default_factory=set)         # connections of those that are importing
    stillborn: int = 0                                  # how many have died so, one after the other
    held: dict = field(default_factory=dict)            # connection -> variant
    tries: dict = field(default_factory=dict)           # variant's number -> how often its process has died

    def begin(self):
        """One process more."""
        context = get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, self.threads, self.needs), daemon=True)
        process.start()
        there.close()
        self.workers[here] = process
        self.beginning.add(here)

    def run(self, waiting):
        """(Variant, row) of all, in the order in which they are done.

        Raises:
            InputError: no process comes to its work.
        """
        waiting = waiting[::-1]
        while waiting or self.held:
            for idle in [c for c in self.workers if c not in self.held and c not in self.beginning]:
                if waiting:
                    self._hand_out(idle, waiting)
            for ready in connection.wait([*self.held, *self.beginning], LOOK_S):
                if ready in self.beginning:
                    self._begun(ready)
                else:
                    yield from self._taken(ready, waiting)
            interruption.stop_if_asked()

    def _begun(self, worker):
        """A process is ready, or has died before it was: that is no variant's fault."""
        self.beginning.discard(worker)
        try:
            worker.recv()
            self.stillborn = 0
        except (EOFError, OSError):
            self.stillborn += 1
            if self.stillborn >= STILLBORN:
                raise InputError(f"{STILLBORN} processes of the sweep have ended one after the other before they began: look for "
                                 "want of memory, or take fewer --workers") from None
            self._replace(worker)

    def _hand_out(self, worker, waiting):
        variant = waiting.pop()
        self.held[worker] = variant
        try:
            worker.send(variant)
        except OSError:                         # it has died while it had nothing to do
            waiting.append(self.held.pop(worker))
            self._replace(worker)

    def _taken(self, worker, waiting):
        """The row that a process has sent; of one that has died its variant goes back, or its row says so."""
        variant = self.held.pop(worker)
        try:
            yield variant, worker.recv()
        except (EOFError, OSError):
            self._replace(worker)
            self.tries[variant.number] = self.tries.get(variant.number, 0) + 1
            if self.tries[variant.number] < TRIES:
                waiting.insert(0, variant)          # behind all others
            else:
                yield variant, variant.failed(FAULT, DIED.format(tries=TRIES))

    def _replace(self, worker):
        self.workers.pop(worker).join()
        worker.close()
        self.begin()

    def end(self):
        """No process is left."""
        for worker, process in self.workers.items():
            process.terminate()
        for worker, process in self.workers.items():
            process.join()
            worker.close()


def _work(pipe, threads, needs):
    """In a process: import what builds need, then build what comes until nothing more does.  Ctrl-C is its parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["NUMBA_NUM_THREADS"] = str(threads)      # read when the first kernel is imported, which is later
    import_module(needs)
    pipe.send("ready")
    while True:
        try:
            variant = pipe.recv()
        except EOFError:
            return
        pipe.send(built(variant))


def on_cluster(variants, address):
    """The same on the workers of a dask.distributed scheduler; they see the folders by the same paths as this process.

    Raises:
        InputError: dask.distributed is not installed, no scheduler answers, or it has gone in the middle.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("--scheduler needs dask.distributed: pip install distributed, here and on the workers; without it "
                         "the sweep runs in processes of this machine") from None
    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: no scheduler answers ({type(error).__name__}): start one with "
                         "`dask scheduler`, and workers with `dask worker`") from None
    with client:
        sent = {client.submit(built, v, key=f"cuspline-{v.inputs_sha256}-{v.number}", retries=TRIES, pure=False): v
                for v in variants}
        for done in as_completed(sent):
            if done.status == "cancelled":          # nobody but a lost scheduler cancels
                raise InputError(f"--scheduler {address}: the scheduler has gone; what is built stands: start it again, then "
                                 "the same sweep, which goes on from there")
            variant = sent[done]
            yield variant, done.result() if done.status == "finished" else variant.failed(FAULT, DIED.format(tries=TRIES))
            interruption.stop_if_asked()


def shares(workers):
    """(processes, threads of each) on this machine."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = workers or cores
    return count, max(1, math.floor(cores / count))
