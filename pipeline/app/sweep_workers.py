"""Variants handed out to processes: here, or on a cluster of dask.distributed; a process that dies has its variant built again."""

import math
import os
import signal
from dataclasses import dataclass, field
from multiprocessing import connection, get_context

from cuspline.app.sweep import FAULT, built
from cuspline.values import interruption
from cuspline.values.errors import InputError

TRIES = 3                       # of one variant, whose process died
LOOK_S = 0.2                    # how often Ctrl-C is looked for
DIED = "its process was ended {tries} times, by signal or for want of memory"


def in_processes(variants, count, threads):
    """Rows as they are done: an iterator of (Variant, row).

    Args:
        variants: sweep.Variant values.   count: processes.   threads: of each.
    """
    pool = _Pool(threads=threads)
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
    workers: dict = field(default_factory=dict)         # connection -> process
    held: dict = field(default_factory=dict)            # connection -> variant
    tries: dict = field(default_factory=dict)           # variant's number -> how often its process has died

    def begin(self):
        """One process more."""
        context = get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there, self.threads), daemon=True)
        process.start()
        there.close()
        self.workers[here] = process

    def run(self, waiting):
        """(Variant, row) of all, in the order in which they are done."""
        waiting = waiting[::-1]
        while waiting or self.held:
            for idle in [c for c in self.workers if c not in self.held]:
                if waiting:
                    self._hand_out(idle, waiting)
            for ready in connection.wait(list(self.held), LOOK_S):
                yield from self._taken(ready, waiting)
            interruption.stop_if_asked()

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
                waiting.append(variant)
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


def _work(pipe, threads):
    """In a process: build what comes until nothing more does.  Ctrl-C is its parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["NUMBA_NUM_THREADS"] = str(threads)      # read when the first kernel is imported, which is later
    while True:
        try:
            variant = pipe.recv()
        except EOFError:
            return
        pipe.send(built(variant))


def on_cluster(variants, address):
    """The same on the workers of a dask.distributed scheduler; they see the folders by the same paths as this process.

    Raises:
        InputError: dask.distributed is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("--scheduler needs dask.distributed: pip install distributed, here and on the workers; without it "
                         "the sweep runs in processes of this machine") from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: no scheduler answers ({type(error).__name__}): start one with "
                         "`dask scheduler`, and workers with `dask worker`") from None
    with client:
        sent = {client.submit(built, v, key=f"cuspline-{v.inputs_sha256}-{v.number}", retries=TRIES, pure=False): v
                for v in variants}
        for done in as_completed(sent):
            variant = sent[done]
            yield variant, done.result() if done.status == "finished" else variant.failed(FAULT, DIED.format(tries=TRIES))
            interruption.stop_if_asked()


def shares(workers):
    """(processes, threads of each) on this machine."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = workers or cores
    return count, max(1, math.floor(cores / count))
