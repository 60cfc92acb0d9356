"""Cutter compensation as posted: LinuxCNC's interpreter runs beside the contour as the reader does."""

import pytest
from compensated_plate import MACHINES, posted, program

from cuspline.posts.writers.linuxcnc import tool_table

from .linuxcnc.comparison import assert_same_moves

pytestmark = pytest.mark.linuxcnc


@pytest.mark.parametrize("worn_mm", [0.0, 0.1])
def test_the_interpreter_runs_beside_the_contour_as_it_is_read(tmp_path, worn_mm):
    machine, tool = MACHINES["linuxcnc"], program().operations[-1].tool
    worn = tool.model_copy(update={"cutter": tool.cutter.model_copy(update={"diameter_mm": tool.cutter.diameter_mm - 2 * worn_mm})})
    (tmp_path / "plate.ngc").write_text(posted("linuxcnc"))
    (tmp_path / "tools.tbl").write_text(tool_table([worn], machine.control))
    read = assert_same_moves(tmp_path / "plate.ngc", tmp_path / "tools.tbl", machine.wcs_origin_mm)
    assert (read.radius_register == tool.number).sum() > 15
