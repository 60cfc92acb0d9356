"""What Grbl and Haas share with RS-274: LinuxCNC makes the moves that their own readers read.

Words that LinuxCNC has not (G187, O-numbers) become blank lines; whether Grbl and Haas mean the same by the others is not shown.
"""

import re

import numpy as np
import pytest
from random_programs import LENGTHS, WCS, random_program

from cuspline.app import catalogue

from .linuxcnc.comparison import differences
from .linuxcnc.interpreter import interpret

pytestmark = pytest.mark.linuxcnc

ZERO = {WCS: (-101.5, -20.25, -300.125)}
FOREIGN = {"grbl": r"$^", "haas": r"(?m)^(O\d+|G187.*)$"}
NOT_ASKED = {"grbl": {"tool"}, "haas": set()}          # T alone changes no tool for LinuxCNC


@pytest.mark.parametrize("name", FOREIGN)
def test_linuxcnc_makes_the_moves_that_the_reader_reads(name, tmp_path):
    machine, path = catalogue.find_machine(f"mill_{name}"), tmp_path / "program.ngc"
    compared = 0
    for seed in range(3):
        for text in catalogue.find_post(name).post(random_program(seed), machine).texts:
            moves = catalogue.reader_of(machine)(text, work_offsets=ZERO, tool_lengths=LENGTHS)
            path.write_text(re.sub(FOREIGN[name], "", text))
            truth = interpret(path, tool_lengths=LENGTHS, work_offsets=ZERO)
            assert truth.error == "" and truth.ended and len(moves) == len(truth.kind)
            for column, difference, allowed in differences(moves, truth):
                assert column in NOT_ASKED[name] or not (np.asarray(difference) > allowed).any(), column
            compared += len(moves)
    assert compared > 60
