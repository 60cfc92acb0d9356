"""A numbered set read back: its files one after the other, every line in its own file."""

import numpy as np
from known_passes import LENGTHS, ZERO, machine, program

from cuspline.catalogue import reader_of
from cuspline.judge import _in_files
from cuspline.posted import PostedMoves
from cuspline.posts.linuxcnc import post
from cuspline.program import Kind
from cuspline.verification.findings import Finding


def read_set():
    mill = machine(program_store_bytes=1110)
    texts = post(program(), mill).texts
    parts = [reader_of(mill)(t, work_offsets=ZERO, tool_lengths=LENGTHS) for t in texts]
    return texts, parts, PostedMoves.joined(parts, [t.count("\n") for t in texts])


def test_a_set_is_its_files_one_after_the_other():
    texts, parts, whole = read_set()
    assert len(texts) > 2 and len(whole) == sum(len(p) for p in parts)
    assert whole.operations == ("rough", "finish") and whole.ended
    assert [whole.operation_name(k) for k in np.flatnonzero(whole.kind >= Kind.ARC_CW)] == 12 * ["rough"] + 12 * ["finish"]
    lines = "".join(texts).splitlines()
    assert all("G2 " in lines[n - 1] for n in whole.line[whole.kind >= Kind.ARC_CW])
    assert not PostedMoves.joined([*parts[:-1], PostedMoves(**{**parts[-1].__dict__, "ended": False})],
                                  [t.count("\n") for t in texts]).ended


def test_a_finding_names_the_file_and_its_own_line():
    texts, _, whole = read_set()
    parts = {f"setup-1-{k:02d}.ngc": t for k, t in enumerate(texts, 1)}
    at = int(whole.line[np.flatnonzero(whole.kind >= Kind.ARC_CW)[-1]])
    block = "".join(texts).splitlines()[at - 1]
    finding = Finding(kind="excess", amount_mm=0.1, place_mm=None, operation="finish", line=at, setup="setup-1", advice="",
                      block=block)
    found, = _in_files((finding,), parts)
    name, _, said = found.block.partition(": ")
    assert name == list(parts)[-1] and parts[name].splitlines()[found.line - 1] == said == block
    first, = _in_files((Finding(**{**finding.as_dict(), "line": 3, "block": "G17"}),), parts)
    assert (first.line, first.block) == (3, "setup-1-01.ngc: G17")
    assert _in_files((finding,), {"setup-1.ngc": texts[0]}) == (finding,)
