"""Cutter compensation as posted: LinuxCNC's interpreter runs beside the contour as the reader does."""

import re

import known_tilted
import numpy as np
import pytest
from compensated_plate import MACHINES, RADIUS, TOOL, WORN, posted, program, turned_contour
from positioned_mills import TURNING_THE_PART, mill

from cuspline.app.catalogue import reader_of
from cuspline.posts.writers import linuxcnc
from cuspline.posts.writers.linuxcnc import tool_table
from cuspline.program.program import Kind

from .linuxcnc.comparison import assert_same_moves
from .linuxcnc.interpreter import interpret

pytestmark = pytest.mark.linuxcnc


@pytest.mark.parametrize("worn_mm", [0.0, 0.1])
def test_the_interpreter_runs_beside_the_contour_as_it_is_read(tmp_path, worn_mm):
    machine, tool = MACHINES["linuxcnc"], program().operations[-1].tool
    worn = tool.model_copy(update={"cutter": tool.cutter.model_copy(update={"diameter_mm": tool.cutter.diameter_mm - 2 * worn_mm})})
    (tmp_path / "plate.ngc").write_text(posted("linuxcnc"))
    (tmp_path / "tools.tbl").write_text(tool_table([worn], machine.control))
    read = assert_same_moves(tmp_path / "plate.ngc", tmp_path / "tools.tbl", machine.wcs_origin_mm)
    assert (read.radius_register == tool.number).sum() > 15


@pytest.mark.parametrize("radius_mm", [RADIUS, RADIUS - WORN])
@pytest.mark.parametrize("name", TURNING_THE_PART)
def test_the_interpreter_runs_beside_it_where_the_part_has_turned(tmp_path, name, radius_mm):
    """Ends in machine coordinates, move by move; the bare interpreter knows no rotary axes, none of which turns in the cut."""
    held, path = mill("linuxcnc", name), tmp_path / "plate.ngc"
    text = linuxcnc.post(known_tilted.program(turned_contour()), held).text
    path.write_text(re.sub(r"(?m)^G53 G0 [ABC].*$", "", text))
    known = {"work_offsets": {"G54": held.wcs_origin_mm}, "tool_lengths": {TOOL.number: TOOL.length_mm},
             "tool_radii": {TOOL.number: radius_mm}}
    truth = interpret(path, **known)
    read = reader_of(held)(text, chain=held.kinematics, **known)
    cuts = np.flatnonzero(truth.kind != Kind.RAPID)
    assert truth.error == "" and truth.ended and (truth.kind[cuts] > Kind.FEED).sum() > 5
    for k in cuts.tolist():
        mine = read.machine_end_mm[read.line == truth.line[k]]
        assert np.linalg.norm(mine - truth.machine_end_mm[k], axis=1).min() < 1e-9
