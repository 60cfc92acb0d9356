"""A seeded share of the fuzzer's inputs: every one is read through or refused in a sentence; the fuzzer itself finds faults."""

import os
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
import fuzz  # noqa: E402
import fuzz_inputs  # noqa: E402

INPUTS, SEED = 2000, 3
FORMATS = ("job", "machine", "library", "fusion", "freecad", "markers", "cells", "parmteqm", "blades", "linuxcnc", "fanuc",
           "translate", "restart", "manifest", "tools", "step", "parameters", "options")
pytestmark = pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")


@pytest.fixture(scope="module")
def cases():
    with fuzz_inputs.sound_files() as files:
        found = fuzz_inputs.cases(files)
        fuzz.warm(found)
        yield {c.name: c for c in found}


def test_every_format_is_fuzzed(cases):
    assert tuple(cases) == FORMATS


@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_inputs_are_read_through_or_refused_in_a_sentence(cases, name):
    share = cases[name].weight / sum(c.weight for c in cases.values())
    found = fuzz.fuzzed(cases[name], round(INPUTS * share), SEED)
    assert found.failures == ()
    assert set(found.codes) <= set(fuzz.RIGHT) and sum(found.codes.values()) == found.inputs


def one(write):
    """A format whose inputs a function writes; its number is in the file's name."""
    return fuzz_inputs.Case(name="one", weight=1.0, write=write)


def test_the_same_seed_makes_the_same_input(cases, tmp_path):
    import random
    for name in ("job", "library", "linuxcnc", "parameters", "options"):
        made = []
        for _ in range(2):
            folder = tmp_path / "input"
            folder.mkdir()
            arguments = cases[name].write(random.Random(f"{SEED} {name} 7"), folder)
            made.append((list(map(str, arguments)), {p.name: p.read_bytes() for p in sorted(folder.iterdir())}))
            fuzz.shutil.rmtree(folder)
        assert made[0] == made[1], name


@pytest.mark.parametrize("fault, wanted", [
    (lambda: time.sleep(60), fuzz.HUNG), (lambda: os.kill(os.getpid(), 9), fuzz.DIED), (lambda: 1 / 0, fuzz.FAULT),
    (lambda: bytearray(1 << 33), fuzz.NO_MEMORY), (lambda: print("cuspline: a second one", file=sys.stderr), fuzz.WORDY)])
def test_the_fuzzer_tells_what_hangs_dies_fails_and_takes_all_memory(cases, monkeypatch, fault, wanted):
    from cuspline.app import cli
    is_third = iter([False, False, True, False, False])

    def command(arguments, **_):
        if next(is_third):
            fault()
        return 0
    monkeypatch.setattr(cli, "_command", lambda: type("Command", (), {"main": staticmethod(command)}))
    found = fuzz.fuzzed(one(lambda chance, folder: ("machines",)), 5, SEED, longest_s=5.0)
    assert [(f.number, f.what.startswith(wanted)) for f in found.failures] == [(2, True)], found
