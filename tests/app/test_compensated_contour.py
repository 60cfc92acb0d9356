"""A contour that the control runs beside, judged as posted: at the nominal radius, worn, and with what must be found."""

import re
import shutil
from pathlib import Path

import pytest
from built_parts import built_once

from cuspline.app.judge import begun, judge
from cuspline.app.worn_cutters import worn_look, worn_tools
from cuspline.design.job import read_job, read_tools
from cuspline.values.errors import ReadError
from cuspline.verification.verdict import Options

PARTS = Path(__file__).parent.parent / "parts"
COARSE = Options(spacing_mm=2.0, solid_pitch_mm=1.5, replay_pitch_mm=0.7, tessellation_mm=0.01)


@pytest.fixture(scope="module", params=["compensated_boss", "compensated_turned"])
def boss(request, tmp_path_factory):
    """Output folder of the block, posted; not to be edited.  The second is cut from its side, in an indexed position."""
    return built_once(tmp_path_factory, request.param, PARTS / f"{request.param}.py", "--stage", "gcode")


def only_program(boss):
    """Name of its only program."""
    path, = boss.glob("*.ngc")
    return path.name


def spoilt(boss, tmp_path, name, change):
    """The verdict on its files with one of them changed."""
    folder = shutil.copytree(boss, tmp_path / "spoilt")
    before = (folder / name).read_text()
    (folder / name).write_text(change(before))
    assert (folder / name).read_text() != before
    return judge(folder, read_job(folder), options=COARSE)


def test_the_wall_is_the_same_with_a_worn_cutter_and_its_radius_in_the_register(boss):
    judged = judge(boss, read_job(boss), options=COARSE)
    assert judged.findings == ()
    worn = judged.as_dict(())["compensation"]
    radius, = worn["radii_mm"].values()
    tool, = (t for t in read_tools(boss).values() if f"D{t.number}" in worn["radii_mm"])
    assert radius == pytest.approx(tool.cutter.radius_mm - 0.1) and read_job(boss).worn_mm == {"contour": 0.1}
    assert worn["gouge_max_mm"] < 0.001 and worn["excess_max_mm"] < 0.001


def test_a_register_that_is_not_the_tool_s_is_found(boss, tmp_path):
    table = lambda text: re.sub(r" D([\d.]+) ", lambda m: f" D{float(m[1]) + 0.1:.6f} ", text)
    assert [f.kind for f in spoilt(boss, tmp_path, "tools.tbl", table).findings] == ["wrong_tool_table"]


def test_a_contour_on_its_other_side_is_found(boss, tmp_path):
    with pytest.raises(ReadError, match=r"an inner arc of 6.000 mm, and 8.000 mm in D1"):
        spoilt(boss, tmp_path, only_program(boss), lambda text: text.replace("G41", "G42"))


def test_a_worn_cutter_whose_register_stays_as_it_was_leaves_stock_and_is_found(boss):
    read = begun(boss, read_job(boss), options=COARSE)
    worn = worn_tools(read.programs, read.tools, read.job.worn_mm)
    look = worn_look(read.programs, lambda tools: [p.posted for p in read.programs], worn, read.solid, read.first.judging, set())
    assert {f.kind for f in look.findings} <= {"missing_area", "excess"}
    assert max(f.amount_mm for f in look.findings) == pytest.approx(0.1, abs=0.01)
    assert "with a worn cutter" in look.findings[0].advice
