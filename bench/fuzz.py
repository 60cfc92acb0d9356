"""Fuzzing: mangled inputs of every format through the doors of the command line.

Every input is made from a sound one and a seed, and handed to `cli.run` in a worker of its own with limits of time and
memory.  Right is exit code 0, 1 or 2 with at most one message; a traceback, an internal fault (3), a worker that dies
or hangs, and memory that runs out are failures, told with the seed that makes the same input again:

    python bench/fuzz.py [inputs [seed [format ...]]]     a line a format, failures below them
    python bench/fuzz.py one FORMAT SEED NUMBER           one input, shown, run and answered

Stages stop where planning would begin: what is fuzzed is what reads, checks and refuses.
"""

import contextlib
import gc
import io
import json
import math
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import fuzz_inputs
import fuzz_mangling  # noqa: F401

INPUTS, SEED = 100_000, 12
LONGEST_S = 60.0                # of one input, on a machine that does other work too
ROOM_BYTES = 3 << 29            # that a worker may take beyond what it begins with
POLL_S = 0.05
RIGHT = (0, 1, 2)
TOLD = 10                       # failures that the table shows
DIED, HUNG, NO_MEMORY, FAULT, WORDY = "died", "hung", "no memory", "internal fault", "more than one message"


@dataclass(frozen=True, kw_only=True)
class Failure:
    """An input that was not answered as it must be."""

    format: str
    seed: int
    number: int
    what: str


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a format's inputs."""

    format: str
    inputs: int
    codes: dict                 # exit code -> how often
    accepted: int               # that were read through, to where planning would begin
    slowest_s: float
    peak_bytes: int
    failures: tuple[Failure, ...]


def answered(case, seed, number, folder):
    """(exit code, whether it was read through, what is wrong or "") of one input.

    Args:
        case: fuzz_inputs.Case.   seed, number: make the input.   folder: scratch, emptied by the caller.
    """
    chance = random.Random(f"{seed} {case.name} {number}")
    arguments = case.write(chance, folder)
    said, told = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told), fuzz_inputs.doors(case) as reached:
        from cuspline.app import cli
        code = cli.run([str(a) for a in arguments])
    messages = [line for line in told.getvalue().splitlines() if line.startswith("cuspline: ")]
    fault = ""
    if "not enough memory" in told.getvalue():
        fault = NO_MEMORY
    elif code not in RIGHT or "Traceback" in told.getvalue():
        fault = f"{FAULT}: {told.getvalue().strip()[-300:]}"
    elif not (code == 2) <= len(messages) <= (code == 2) * (len(arguments) if "verify" in arguments else 1):
        fault = f"{WORDY} or none: {told.getvalue().strip()[-300:]}"
    return code, bool(reached) or code == 0, fault


class _Board:
    """What a worker tells while it works, in memory that its parent sees when it has died."""

    def __init__(self, inputs):
        self.begun = multiprocessing.RawArray("d", inputs)      # 0 not yet; then when it was begun
        self.took = multiprocessing.RawArray("d", inputs)       # 0 not answered; then seconds
        self.code = multiprocessing.RawArray("i", inputs)
        self.reached = multiprocessing.RawArray("b", inputs)
        self.peak = multiprocessing.RawValue("d", 0.0)


def fuzzed(case, inputs, seed, longest_s=LONGEST_S):
    """Outcome of a format.

    Args:
        case: fuzz_inputs.Case.   inputs: how many.   seed: of all.   longest_s: that one input may take.
    """
    board, failures, first = _Board(inputs), [], 0
    context = multiprocessing.get_context("fork")
    with tempfile.TemporaryDirectory(prefix="cuspline-fuzz-") as scratch:
        notes = Path(scratch) / "notes.txt"
        notes.touch()
        while first < inputs:
            worker = context.Process(target=_work, args=(case, range(first, inputs), seed, board, scratch, notes))
            worker.start()
            what = _watched(worker, board, first, inputs, longest_s)
            done = next((k for k in range(first, inputs) if not board.took[k]), inputs)
            if what and done < inputs:
                failures.append(Failure(format=case.name, seed=seed, number=done, what=what))
                board.code[done] = -1
            first = done + 1 if what else inputs
        noted = (json.loads(line) for line in notes.read_text().splitlines())
        failures += [Failure(format=case.name, seed=seed, number=n, what=what) for n, what in noted]
    codes = {code: list(board.code).count(code) for code in sorted(set(board.code))}
    return Outcome(format=case.name, inputs=inputs, codes=codes, accepted=sum(board.reached),
                   slowest_s=max(board.took), peak_bytes=int(board.peak.value),
                   failures=tuple(sorted(failures, key=lambda f: f.number)))


def _work(case, numbers, seed, board, scratch, notes):
    """In the worker: one input after the other, each in an empty folder."""
    gc.freeze()             # what the parent holds stays as it is: looking through it would copy all of it
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)        # kernels of C++ may print
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    begin = _resident_bytes()
    limit = _virtual_bytes() + ROOM_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(scratch)
    for k in numbers:
        folder = Path(scratch) / "input"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        board.begun[k] = time.monotonic()
        code, reached, fault = answered(case, seed, k, folder)
        board.code[k], board.reached[k] = code, reached
        board.took[k] = max(time.monotonic() - board.begun[k], 1e-9)
        board.peak.value = max(board.peak.value, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - begin)
        if fault:
            with open(notes, "a") as file:
                file.write(json.dumps([k, fault]) + "\n")


def _watched(worker, board, first, inputs, longest_s):
    """Wait for a worker; "" or what has ended it before its time."""
    while worker.is_alive():
        worker.join(POLL_S)
        busy = next((k for k in range(first, inputs) if not board.took[k]), None)
        first = inputs if busy is None else busy
        if busy is not None and board.begun[busy] and time.monotonic() - board.begun[busy] > longest_s:
            worker.kill()
            worker.join()
            return f"{HUNG}: longer than {longest_s:g} s"
    return "" if worker.exitcode == 0 else f"{DIED}: exit code {worker.exitcode}"


def _resident_bytes():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _virtual_bytes():
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def warm(cases):
    """Answer one input a format in this process: what is imported here, no worker imports anew."""
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            answered(case, SEED, 0, Path(folder))


def all_outcomes(inputs, seed, say=lambda text: None, only=()):
    """Outcome of every format, or only of some, the inputs shared out by the weights of all."""
    with fuzz_inputs.sound_files() as files:
        cases = fuzz_inputs.cases(files)
        whole = sum(c.weight for c in cases)
        rows, cases = [], [c for c in cases if not only or c.name in only]
        warm(cases)
        for case in cases:
            rows.append(fuzzed(case, math.ceil(inputs * case.weight / whole), seed))
            say(line_of(rows[-1]))
        return rows


def line_of(row):
    """One format in words."""
    codes = ", ".join(f"{code}: {n}" for code, n in row.codes.items())
    return (f"{row.format}: {row.inputs} inputs, exit codes {codes}; {row.accepted} read through; slowest "
            f"{row.slowest_s:.2f} s, {row.peak_bytes / 2**20:.0f} MiB more; {len(row.failures)} failures")


def measure():
    """(what, number, unit) rows for RESULTS.md."""
    rows = all_outcomes(INPUTS, SEED, lambda text: print(f"  {text}", flush=True))
    table = [("inputs of all formats, seed 12", sum(r.inputs for r in rows), "")]
    for r in rows:
        table += [(f"{r.format}: inputs", r.inputs, ""), (f"{r.format}: refused (exit code 2)", r.codes.get(2, 0), ""),
                  (f"{r.format}: read through", r.accepted, ""), (f"{r.format}: slowest", r.slowest_s, "s")]
    count = lambda word: sum(f.what.startswith(word) for r in rows for f in r.failures)
    return table + [("tracebacks and internal faults", count(FAULT), ""), ("workers that died", count(DIED), ""),
                    ("hangs", count(HUNG), ""), ("memory run out", count(NO_MEMORY), ""),
                    ("more than one message, or none", count(WORDY), ""),
                    ("most memory beyond the start", max(r.peak_bytes for r in rows) / 2**20, "MiB")]


def main(arguments):
    if arguments[:1] == ["one"]:
        _, name, seed, number = arguments
        with fuzz_inputs.sound_files() as files, tempfile.TemporaryDirectory() as folder:
            case = next(c for c in fuzz_inputs.cases(files) if c.name == name)
            print("arguments:", case.write(random.Random(f"{seed} {name} {number}"), Path(folder)))
            for path in sorted(Path(folder).iterdir()):
                print(f"--- {path.name}\n{path.read_bytes()[:4000]!r}" if path.is_file() else f"--- {path.name}/")
            shutil.rmtree(folder)
            Path(folder).mkdir()
            print(answered(case, int(seed), int(number), Path(folder)))
        return
    rows = all_outcomes(int(arguments[0]) if arguments else INPUTS, int(arguments[1]) if arguments[1:] else SEED,
                        lambda text: print(text, flush=True), arguments[2:])
    for f in [f for r in rows for f in r.failures][:TOLD * len(rows)]:
        print(f"FAILED {f.format} {f.seed} {f.number}: {f.what}")


if __name__ == "__main__":
    main(sys.argv[1:])
