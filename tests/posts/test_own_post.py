"""A post and a reader in a user's own folder, on the way to a verdict; what is lacking is told."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from known_passes import LENGTHS, ZERO, machine, program
from known_tools import tool
from sabotage_bases import COARSE, rounded_boss_text
from typer.testing import CliRunner
from written_parts import BALL, MILL, boss, written

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.app.cli import app
from cuspline.app.judge import judge
from cuspline.design.job import read_job
from cuspline.posts.readers import fanuc_tools
from cuspline.posts.writers import fanuc
from cuspline.program.program import Kind
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import InputError

MILL_TOML = catalogue.MACHINES / "mill_3axis.toml"
POST = '''"""A control whose comments stand behind a semicolon, alone on their lines."""

from cuspline.posts.writers.linuxcnc import _LinuxCNC
from cuspline.posts.writers.program_files import posted

EXTENSION, READER = "mpf", "semicolon_reader.py"


def comment(text):
    return "; " + text


class Semicolon(_LinuxCNC):
    comment = staticmethod(comment)

    def setting(self, block, comment):
        return block


def post(program, machine):
    return posted(program, machine, Semicolon())
'''
READER = '''"""Reads it back."""

import re

from cuspline.posts.readers.rs274_reader import read_program as read


def read_program(text, **asked):
    return read(re.sub("(?m)^; (.*)$", r"(\\1)", text), **asked)
'''
TABLE = '''
TOOL_TABLE = "tools.txt"


def tool_table(tools, control):
    return "".join(f"{t.number} {t.length_mm}\\n" for t in tools)
'''


@pytest.fixture
def own(tmp_path):
    """(post file, a machine's file that names it)."""
    (tmp_path / "semicolon.py").write_text(POST)
    (tmp_path / "semicolon_reader.py").write_text(READER)
    mill = tmp_path / "own_mill.toml"
    mill.write_text(re.sub('post = "linuxcnc"', 'post = "semicolon.py"', MILL_TOML.read_text()))
    return tmp_path / "semicolon.py", mill


def test_a_machines_file_names_the_post_beside_it_and_its_reader_reads_it_back(own):
    post, toml = own
    mill = machine_from_toml(toml)
    assert mill.control.post == str(post)
    text = catalogue.find_post(mill.control.post).post(program(), mill).text
    assert text.startswith("; ") and "(" not in text
    theirs = catalogue.reader_of(mill)(text, work_offsets=ZERO, tool_lengths=LENGTHS)
    ours = machine("linuxcnc")
    same = catalogue.reader_of(ours)(catalogue.find_post("linuxcnc").post(program(), ours).text, work_offsets=ZERO,
                                     tool_lengths=LENGTHS)
    np.testing.assert_array_equal(theirs.end_mm, same.end_mm)
    assert theirs.operations == same.operations and (theirs.kind == Kind.ARC_CW).any()
    assert catalogue.tool_table_of(mill) == (None, None)
    assert sorted(catalogue.sources_of_post(mill)) == ["semicolon.py", "semicolon_reader.py"]
    assert catalogue.sources_of_post(ours) == {}


def test_programs_of_an_own_post_are_judged_and_stamped_in_its_own_words(own, tmp_path):
    """No tool table is asked of a control that loads none; the stamp is a comment as this control takes it."""
    text = re.sub(r"(?m)^\(([^)]*)\)$", r"; \1", rounded_boss_text())
    folder = written(tmp_path / "boss", boss(), text, [MILL, BALL], 3.0)
    (folder / "tools.tbl").unlink()
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["job"]["machine"]["control"]["post"] = "semicolon.py"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    job = read_job(folder)
    job = job.model_copy(update={"machine": catalogue.with_post(job.machine, str(own[0]))})
    judged = judge(folder, job, options=COARSE)
    assert judged.findings == ()
    recipe._stamp_verdict(folder, job, judged.as_dict(()))
    assert re.search("(?m)^; VERDICT: VERIFIED, GOUGE", (folder / "setup-1.ngc").read_text())
    refused = CliRunner().invoke(app, ["verify", str(folder)])
    assert refused.exit_code == 2 and "semicolon.py: name that file with --post" in refused.stderr


def test_a_stamp_too_long_for_the_control_is_told_short(tmp_path):
    (tmp_path / "setup-1.ngc").write_text(f"({recipe.UNVERIFIED})\nM2\n")
    folder = written(tmp_path / "boss", boss(), rounded_boss_text(), [MILL, BALL], 3.0)
    job = read_job(folder)
    narrow = job.machine.control.model_copy(update={"line_length": 60})
    job = job.model_copy(update={"machine": job.machine.model_copy(update={"control": narrow})})
    numbers = {"ok": True, "findings": [], "gouge_max_mm": 0.001, "cusp_max_mm": 0.01, "error_bound_mm": 0.001,
               "points_checked": 10_000, "unreachable": []}
    recipe._stamp_verdict(tmp_path, job, numbers)
    assert (tmp_path / "setup-1.ngc").read_text() == "(VERDICT: VERIFIED)\nM2\n"


@pytest.mark.parametrize("post, reader, wanted", [
    ("EXTENSION = 'x'\n", READER, "semicolon.py has no READER: the reader of what it writes"),
    (POST.replace("def comment", "def remark"), READER, "cannot be loaded: NameError"),
    (POST.replace("EXTENSION, READER", "EXTENSION, READ"), READER, "has no READER"),
    (POST + TABLE.replace("def tool_table", "def table"), READER, "has no tool_table: a function"),
    (POST + TABLE, READER, "semicolon_reader.py has no read_tool_table"),
    (POST, "read = 1\n", "semicolon_reader.py has no read_program"),
    (POST.replace("semicolon_reader.py", "rs275_reader"), READER, "there is no reader 'rs275_reader'")])
def test_what_a_post_lacks_is_told(own, post, reader, wanted):
    own[0].write_text(post)
    own[0].with_name("semicolon_reader.py").write_text(reader)
    mill = machine("linuxcnc").model_copy(update={"control": machine("linuxcnc").control.model_copy(
        update={"post": str(own[0])})})
    with pytest.raises(InputError, match=re.escape(wanted)):
        catalogue.reader_of(mill)
    assert catalogue.find_machine("mill_3axis").control.post == "linuxcnc"


def test_a_post_that_is_neither_known_nor_a_file_is_refused():
    with pytest.raises(InputError, match="no post 'mine.py' and no such .py file; posts: apt, fanuc, grbl"):
        catalogue.find_post("mine.py")


@pytest.mark.parametrize("name", ["mill_fanuc", "mill_paper_tape"])
def test_fanucs_offsets_are_written_by_a_program_and_read_back(name):
    """Length and radius are the sums of geometry and wear, which some controls number the other way round."""
    control = catalogue.find_machine(name).control
    tools = [tool("flat", 10, number=3), tool("ball", 6.35, number=7)]
    text = fanuc.tool_table(tools, control)
    assert text.startswith("%\nO0001\n") and text.endswith("M30\n%\n")
    for k, swapped in enumerate((text, re.sub(r"L1([0-3])", lambda w: f"L1{int(w[1]) ^ 1}", text))):
        rows = {row.number: row for row in fanuc_tools.read_tool_table(swapped, control)}
        for t in tools:
            assert rows[t.number].values_mm["Z"] == pytest.approx(t.length_mm, abs=control.resolution_mm), k
            assert rows[t.number].values_mm["D"] == pytest.approx(t.cutter.diameter_mm, abs=control.resolution_mm)


def test_the_command_writes_the_table_of_the_machines_control(tmp_path):
    run = lambda *words: CliRunner().invoke(app, ["cutters", "--to", *map(str, words)])
    assert run(tmp_path / "tools.nc", "--machine", "mill_fanuc").exit_code == 0
    assert "G10 L10 P1 R" in (tmp_path / "tools.nc").read_text()
    wrong = run(tmp_path / "tools.tbl", "--machine", "mill_fanuc")
    assert isinstance(wrong.exception, InputError) and "or the control's .nc" in str(wrong.exception)
    assert not Path(tmp_path / "tools.tbl").exists()
