"""Moves out of every machine cost neither memory nor time, and are told."""

import tracemalloc

import numpy as np
import pytest
from physical_programs import bases, findings

from cuspline.values.errors import SimulationError

BASE = next(b for b in bases() if b.dialect == "linuxcnc" and b.name == "terrace")
LARGEST_BYTES = 300e6     # the replay of the part itself takes a tenth


def with_blocks(*blocks):
    """The program with blocks behind its first cut."""
    line = next(k for k, text in enumerate(BASE.lines, 1) if text.startswith("X72"))
    return "\n".join([*BASE.lines[:line], *blocks, *BASE.lines[line:]]) + "\n"


@pytest.mark.parametrize("blocks", [("G0 X1000000000", "G0 X72"), ("G1 X1000000000", "G1 X72"), ("G1 Z-1000000000", "G1 Z18.6"),
                                    ("G0 Z1000000000", "G0 Z25"), ("G1 X1000000000 Y1000000000 Z1000000000", "G1 X72 Y-2 Z18.6")])
def test_a_move_of_a_thousand_kilometres_is_told_within_bounded_memory(blocks):
    tracemalloc.start()
    told = findings(BASE, with_blocks(*blocks))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert "travel_exceeded" in {f.kind for f in told} and most < LARGEST_BYTES
    assert all(np.isfinite(f.amount_mm) for f in told)


def test_an_arc_of_a_hundred_thousand_turns_is_refused_with_its_line():
    with pytest.raises(SimulationError, match="fewer turns"):
        findings(BASE, with_blocks("G2 X72 I5 J0 P100000"))
