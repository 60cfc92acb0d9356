"""Bad input: exit code 2, one clear message that names the thing, no traceback, nothing written."""

import json
import os
import signal

import pytest
from built_parts import cuspline, saddle_job

from cuspline.app import catalogue, cli

LONGEST_S = 20            # a refusal takes no longer, on a loaded machine
DESIGN = "from cuspline.designs.z_profile import *\n"


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    """main() with arguments -> (exit code, standard error, what was written)."""
    def call(*arguments, out=True):
        folder = tmp_path / "outputs" / "part"
        monkeypatch.setattr("sys.argv", ["cuspline", *map(str, arguments), *(["--out", str(folder)] if out else [])])
        with pytest.raises(SystemExit) as done:
            cli.main()
        said = capsys.readouterr()
        written = list(folder.parent.rglob("*")) if folder.parent.exists() else []
        return done.value.code, said.err, said.out, written
    return call


def assert_refused(result, *wanted):
    """Exit code 2, one message that names all that is wanted, nothing written."""
    code, err, out, written = result
    messages = [line for line in err.splitlines() if not line.startswith("  ")]       # progress is indented
    assert code == 2, err
    assert len(messages) == 1 and messages[0].startswith("cuspline: "), err
    assert "Traceback" not in err + out and out == ""
    missing = [w for w in wanted if str(w) not in messages[0]]
    assert not missing, f"{messages[0]!r} does not name {missing}"
    assert written == []


def file(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return tmp_path / name


# designs and parameters -----------------------------------------------------------------------------


def test_a_missing_design_file(run, tmp_path):
    assert_refused(run("build", tmp_path / "nothing.py"), "nothing.py", "z_profile")


def test_an_unknown_design(run):
    assert_refused(run("build", "zprofile"), "zprofile", "z_profile")


@pytest.mark.parametrize("text, wanted", [
    ("def design(:\n", "SyntaxError"),
    ("import no_such_module_here\n", "no_such_module_here"),
    ("x = 1\n", "design(parameters)"),
    ("def design(p):\n    return None\n", "Parameters"),
], ids=["syntax", "import", "no design", "no parameter model"])
def test_a_design_file_that_cannot_be_used(run, tmp_path, text, wanted):
    assert_refused(run("build", file(tmp_path, "mine.py", text)), "mine.py", wanted)


def test_a_design_function_that_raises(run, tmp_path):
    path = file(tmp_path, "mine.py", "from cuspline.design import Parameters\n\n\ndef design(p: Parameters):\n    1 / 0\n")
    assert_refused(run("build", path), "mine", "ZeroDivisionError")


def test_a_design_function_that_gives_no_design(run, tmp_path):
    path = file(tmp_path, "mine.py", "from cuspline.design import Parameters\n\n\ndef design(p: Parameters):\n    return 3\n")
    assert_refused(run("build", path), "mine", "Design")


@pytest.mark.parametrize("assignment, wanted", [
    ("lenght_mm=120", "lenght_mm"), ("length_mm=-3", "length_mm"), ("length_mm=1e9", "length_mm"),
    ("length_mm=long", "length_mm"), ("length_mm=nan", "length_mm"), ("length_mm", "name=value"),
    ("section_plane=XY", "section_plane"), ("material=cheese", "cheese"), ("slope_length_mm=20", "height_mm")])
def test_a_parameter_that_cannot_be(run, assignment, wanted):
    assert_refused(run("build", "z_profile", "-p", assignment), wanted)


# machines, posts, tools ---------------------------------------------------------------------------------


def test_an_unknown_machine(run):
    assert_refused(run("build", "z_profile", "--machine", "lathe"), "lathe", "mill_3axis")


def test_a_broken_machine_file(run, tmp_path):
    assert_refused(run("build", "z_profile", "--machine", file(tmp_path, "m.toml", "name = = 3\n")), "m.toml", "TOML")


def test_a_machine_file_without_an_axis(run, tmp_path):
    text = (catalogue.POSTS / "machines" / "mill_3axis.toml").read_text().replace("[z]", "[w]")
    assert_refused(run("build", "z_profile", "--machine", file(tmp_path, "m.toml", text)), "m.toml", "z")


def test_an_unknown_post(run):
    assert_refused(run("build", "z_profile", "--post", "okuma"), "okuma", "linuxcnc")


def library(tmp_path, change):
    value = json.loads((catalogue.POSTS / "tools" / "tools.json").read_text())
    change(value["tools"])
    return file(tmp_path, "mine.json", json.dumps(value))


def test_a_negative_diameter(run, tmp_path):
    path = library(tmp_path, lambda tools: tools[0]["cutter"].update(diameter_mm=-16))
    assert_refused(run("build", "z_profile", "--cutters", path), "mine.json", "diameter_mm")


def test_a_tool_number_used_twice(run, tmp_path):
    path = library(tmp_path, lambda tools: tools[1].update(number=tools[0]["number"]))
    assert_refused(run("build", "z_profile", "--cutters", path), "mine.json", "1")


@pytest.mark.parametrize("text", ["{", "[]", '{"tools": []}', '{"tools": 3}'])
def test_a_library_that_is_none(run, tmp_path, text):
    assert_refused(run("build", "z_profile", "--cutters", file(tmp_path, "mine.json", text)), "mine.json")


def test_a_missing_library(run, tmp_path):
    assert_refused(run("build", "z_profile", "--cutters", tmp_path / "no.json"), "no.json")


# names that become files, numbers that are none, keys that are not there ---------------------------------


@pytest.mark.parametrize("name", ["../../evil", "/tmp/evil", "..", "a/b", ".hidden", "", "x" * 65, "a\\nb", "-p"])
def test_a_name_of_a_setup_that_would_leave_the_folder(run, tmp_path, name):
    job = saddle_job(tmp_path)
    job.write_text(job.read_text().replace('name = "setup-1"', f'name = "{name}"'))
    before = sorted(p.name for p in tmp_path.parent.rglob("*evil*"))
    assert_refused(run("build", job), "saddle.toml", "setups.0.name", "A-Z")
    assert sorted(p.name for p in tmp_path.parent.rglob("*evil*")) == before


NAMED = """import cadquery as cq
from cuspline.design import *


class P(Parameters):
    name: str = "mine"
    setup: str = "setup-1"
    companion: str = "whole"


def design(p: P):
    box = cq.Workplane().box(10, 10, 10).val()
    return Design(name=p.name, description="", parameters=p, solid=box, material="aluminium_6061",
                  predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1)),),
                  stock=StockBox(min_mm=(-5, -5, -5), max_mm=(5, 5, 6)),
                  finish=Finish(scallop_mm=0.01, profile_tolerance_mm=0.002, gouge_mm=0.003),
                  setups=(Setup(name="setup-1", faces=("top",), wcs_in_words=""),
                          Setup(name=p.setup, faces=("top",), wcs_in_words="")),
                  companions=(Companion(name=p.companion, make=lambda: box),))
"""


@pytest.mark.parametrize("assignment, wanted", [
    ("name=../../evil", "name a file"), ("setup=../../evil", "file"), ("companion=../../evil", "name a file"),
    ("setup=setup-1", "two are called setup setup-1")])
def test_names_of_a_design_its_setups_and_companions_that_cannot_be_files(run, tmp_path, assignment, wanted):
    path = file(tmp_path, "mine.py", NAMED)
    assert_refused(run("build", path, "-p", "setup=two", "-p", assignment) if "setup" not in assignment else
                   run("build", path, "-p", assignment), wanted)
    assert not list(tmp_path.parent.rglob("*evil*"))


def test_a_job_whose_own_name_cannot_be_a_files(run, tmp_path):
    job = saddle_job(tmp_path)
    assert_refused(run("build", job.rename(tmp_path / "sad'dle.toml")), "sad'dle", "name a file")


@pytest.mark.parametrize("changes, wanted", [
    ({"scallop_mm": "nan"}, ("finish.scallop_mm", "finite")), ({"scallop_mm": "1e9"}, ("finish.scallop_mm", "5")),
    ({"max_mm": "[30, inf, 9]"}, ("stock.max_mm.1", "finite")), ({"max_mm": "[30, 1e300, 9]"}, ("stock.max_mm.1",)),
    ({"center_max_mm": "[nan, 6, 7.5]"}, ("faces.0.center_max_mm.0", "finite"))])
def test_numbers_that_are_none_or_beyond_all_measure(run, tmp_path, changes, wanted):
    assert_refused(run("build", saddle_job(tmp_path, **changes)), "saddle.toml", *wanted)


def test_nan_in_a_library_and_infinity_in_a_machine(run, tmp_path):
    path = library(tmp_path, lambda tools: tools[0].update(stick_out_mm=float("nan")))
    assert_refused(run("build", "z_profile", "--cutters", path), "mine.json", "tools.0.stick_out_mm", "finite")
    text = (catalogue.POSTS / "machines" / "mill_3axis.toml").read_text()
    text = text.replace("max_feed_mm_per_min = ", "max_feed_mm_per_min = inf #")
    assert_refused(run("build", "z_profile", "--machine", file(tmp_path, "m.toml", text)), "max_feed_mm_per_min", "finite")


def test_a_misspelt_key_is_named_with_the_nearest_right_one(run, tmp_path):
    job = saddle_job(tmp_path)
    job.write_text(job.read_text().replace("scallop_mm", "scalop_mm").replace("wcs_in_words", "wcs_in_word"))
    assert_refused(run("build", job), "finish.scalop_mm", "did you mean scallop_mm?", "finish.scallop_mm: it is missing",
                   "setups.0.wcs_in_word", "did you mean wcs_in_words?")
    assert_refused(run("build", "z_profile", "-p", "widht_mm=3", "-p", "slope_deg=nan"), "did you mean width_mm?",
                   "slope_deg")


@pytest.mark.parametrize("content, wanted", [
    (b"", "empty"), (b" \n\n", "empty"), (b"\x80\x81\xff\x00", "UTF-8"), ("name = 1".encode("utf-16"), "UTF-16"),
    (b"\x00\x01\x02", "null"), ("# \u00e4".encode("latin-1"), "line 1: byte 0xe4"), (b"a = " + b"[" * 5000, "deep"),
    (b"a = " + b"9" * 5000, "TOML"), (b"x" * (33 << 20), "larger than 32 MiB")],
    ids=["empty", "blank", "binary", "utf-16", "null", "latin-1", "deep", "long number", "huge"])
@pytest.mark.parametrize("what", ["job", "machine", "library"])
def test_files_that_are_no_text_of_their_kind(run, tmp_path, content, wanted, what):
    name = {"job": "j.toml", "machine": "m.toml", "library": "l.json"}[what]
    (tmp_path / name).write_bytes(content)
    result = run(*{"job": ("build", tmp_path / name), "machine": ("build", "z_profile", "--machine", tmp_path / name),
                   "library": ("build", "z_profile", "--cutters", tmp_path / name)}[what])
    is_told = wanted if what != "library" or wanted not in ("TOML", "deep") else "JSON"
    assert_refused(result, name, is_told)


@pytest.fixture
def pipe(tmp_path):
    """A pipe into which nobody writes, under a name; whoever opens it is woken up."""
    def woken(*_):
        raise AssertionError("a pipe was opened")

    before = signal.signal(signal.SIGALRM, woken)
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)

    def made(name):
        os.mkfifo(tmp_path / name)
        return tmp_path / name
    yield made
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name, words", [
    ("mine.py", ("build", "{}")), ("mine.toml", ("build", "{}")), ("mine.step", ("build", "{}")),
    ("mill.toml", ("build", "z_profile", "--machine", "{}")), ("tools.json", ("build", "z_profile", "--cutters", "{}")),
    ("rows.csv", ("build", "z_profile", "--measured", "{}")), ("cells.csv", ("build", "rfq_vane", "-p", "table={}")),
    ("radii.csv", ("build", "propeller", "-p", "radii_csv={}", "-p", "offsets_csv={}"))])
def test_a_pipe_in_place_of_a_file_is_refused_before_it_is_opened(run, pipe, name, words):
    path = pipe(name)
    assert_refused(run(*(w.format(path) for w in words)), name, "is a pipe or a device, not a regular file")


@pytest.mark.parametrize("words", [("cutters", "{}"), ("cutters", "--import", "{}"), ("restart", "{}")])
def test_a_pipe_where_no_part_is_built_is_refused_too(run, pipe, words):
    path = pipe("shop.json")
    assert_refused(run(*(w.format(path) for w in words), out=False), "shop.json", "is a pipe or a device")


def test_a_device_without_an_end_is_refused(run):
    assert_refused(run("build", "rfq_vane", "-p", "table=/dev/zero"), "/dev/zero is a pipe or a device")


def test_folders_in_place_of_files(run, tmp_path):
    (tmp_path / "f.toml").mkdir()
    for arguments in (("build", tmp_path / "f.toml"), ("build", "z_profile", "--machine", tmp_path / "f.toml"),
                      ("build", "z_profile", "--cutters", tmp_path / "f.toml"),
                      ("build", "z_profile", "--measured", tmp_path / "f.toml")):
        assert_refused(run(*arguments), "f.toml")
    assert_refused(run("restart", tmp_path / "f.toml", out=False), "f.toml", "folder")


# what no plan could mend ---------------------------------------------------------------------------------


@pytest.mark.parametrize("low, high, wanted", [
    ("[-1, 0, 0]", "[30, 16, 5]", ("Z", "its stock only", "enlarge")),
    ("[5, 0, 0]", "[30, 16, 30]", ("X", "its stock only")),
    ("[0, 0, 0]", "[900, 16, 30]", ("setup-1", "stock", "X", "travel is -600 .. 0")),
    ("[0, 0, 0]", "[30, 16, 900]", ("setup-1", "stock", "Z", "travel"))],
    ids=["lower than the part", "narrower", "beyond X", "beyond Z"])
def test_a_stock_that_cannot_be_is_told_before_planning(run, tmp_path, monkeypatch, low, high, wanted):
    from cuspline.app import build
    monkeypatch.setattr(build, "plan_setup", lambda *_: pytest.fail("it was planned"))
    assert_refused(run("build", saddle_job(tmp_path, min_mm=low, max_mm=high)), *wanted)


# STEP parts ---------------------------------------------------------------------------------------------


def test_a_step_without_a_solid(run, tmp_path):
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Pln
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
    job = saddle_job(tmp_path)
    writer = STEPControl_Writer()
    writer.Transfer(BRepBuilderAPI_MakeFace(gp_Pln(), 0, 10, 0, 10).Face(), STEPControl_AsIs)
    writer.Write(str(tmp_path / "saddle.step"))
    assert_refused(run("build", job), "saddle", "solid")


def test_a_step_with_several_solids(run, tmp_path):
    import cadquery as cq
    job = saddle_job(tmp_path)
    two = cq.Workplane("XY").box(5, 5, 5).add(cq.Workplane("XY").box(5, 5, 5).translate((20, 0, 0)))
    cq.exporters.export(two, str(tmp_path / "saddle.step"))
    assert_refused(run("build", job), "saddle", "2 solids", "fuse")


def test_a_step_with_an_open_shell(run, tmp_path):
    import cadquery as cq
    job = saddle_job(tmp_path)
    shell = cq.Shell.makeShell(cq.Workplane("XY").box(5, 5, 5).faces().vals()[:5])
    cq.exporters.export(cq.Workplane(obj=shell), str(tmp_path / "saddle.step"))
    assert_refused(run("build", job), "saddle.step", "no solid", "shell")


@pytest.mark.parametrize("text", ["", "this is no STEP file\n"])
def test_a_step_that_cannot_be_read(run, tmp_path, text):
    job = saddle_job(tmp_path)
    (tmp_path / "saddle.step").write_text(text)
    assert_refused(run("build", job), "saddle.step")


def test_a_missing_step(run, tmp_path):
    job = saddle_job(tmp_path)
    (tmp_path / "saddle.step").unlink()
    assert_refused(run("build", job), "saddle.step")


def test_a_step_file_alone_asks_for_a_job(run, tmp_path):
    saddle_job(tmp_path)
    assert_refused(run("build", tmp_path / "saddle.step"), "saddle.step", "job")


@pytest.mark.parametrize("changes, wanted", [
    ({"center_max_mm": "[11, 6, 7.5]"}, ("saddle", "0", "1")),
    ({"center_min_mm": "[-1, -1, -1]", "center_max_mm": "[40, 40, 40]"}, ("saddle", "6", "1")),
    ({"count": "0"}, ("saddle.toml", "count")),
    ({"faces": '["sadle"]'}, ("sadle",)),
    ({"scallop_mm": "-0.05"}, ("saddle.toml", "scallop_mm")),
    ({"material": '"cheese"'}, ("cheese",)),
    ({"max_mm": "[30, 16, -1]"}, ("saddle.toml", "stock")),
    ({"wcs_in_words": "corner of the block"}, ("saddle.toml", "TOML")),
], ids=["matches nothing", "matches more", "count", "unknown face", "scallop", "material", "stock", "broken"])
def test_a_job_that_cannot_be(run, tmp_path, changes, wanted):
    assert_refused(run("build", saddle_job(tmp_path, **changes)), *wanted)


def test_of_a_setup_with_a_wrong_operation_the_operation_alone_is_told(run, tmp_path):
    job = saddle_job(tmp_path)
    job.write_text(job.read_text() + 'operations = [{ kind = "watrline" }]\n')
    done = run("build", job)
    assert_refused(done, "setups.0.operations.0", "watrline")
    assert "at least 1 item" not in done[1]


@pytest.mark.parametrize("share", [0.2, 0.6, 0.97])
def test_a_step_that_was_cut_off(run, tmp_path, share):
    job = saddle_job(tmp_path)
    content = (tmp_path / "saddle.step").read_bytes()
    (tmp_path / "saddle.step").write_bytes(content[:int(share * len(content))])
    assert_refused(run("build", job), "saddle.step")


# options and folders ------------------------------------------------------------------------------------


def test_an_unknown_stage(run):
    assert_refused(run("build", "z_profile", "--stage", "gerber"), "gerber", "gcode")


def test_accepting_what_is_no_kind_of_finding(run):
    assert_refused(run("build", "z_profile", "--accept", "everything"), "everything", "gouge")


def test_an_unknown_option(run):
    assert_refused(run("build", "z_profile", "--colour", "red"), "--colour")


def test_a_folder_where_nothing_can_be_written(run, tmp_path):
    blocked = file(tmp_path, "blocked", "a file, no folder")
    result = run("build", "z_profile", "--out", blocked / "part", out=False)
    assert_refused(result, "blocked")
    assert blocked.read_text() == "a file, no folder"


def test_an_output_folder_that_is_a_file(run, tmp_path):
    blocked = file(tmp_path, "part", "a file, no folder")
    assert_refused(run("build", "z_profile", "--stage", "step", "--out", blocked, out=False), "part")
    assert blocked.read_text() == "a file, no folder"
    assert [p.name for p in tmp_path.iterdir()] == ["part"]


def test_an_output_folder_with_something_else_in_it(run, tmp_path):
    own = file(tmp_path, "thesis.txt", "years of work")
    assert_refused(run("build", "z_profile", "--stage", "step", "--out", tmp_path, out=False), tmp_path, "manifest.json")
    assert own.read_text() == "years of work" and [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_verifying_a_folder_without_a_manifest(run, tmp_path):
    assert_refused(run("verify", tmp_path, out=False), "manifest.json", "cuspline build")


def test_verifying_what_does_not_exist(run, tmp_path):
    assert_refused(run("verify", tmp_path / "nowhere", out=False), "nowhere")


def test_no_command_at_all_shows_the_help():
    done = cuspline()
    assert "Usage" in done.stdout + done.stderr and "Traceback" not in done.stderr


def test_the_message_is_the_same_in_a_process_of_its_own(tmp_path):
    done = cuspline("build", "z_profile", "-p", "length_mm=-3", "--out", tmp_path / "part")
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1 and "length_mm" in done.stderr
    assert list(tmp_path.iterdir()) == []
