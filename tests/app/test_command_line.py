"""What the command line lists and says, without building anything."""

import json
import os
import subprocess
import sys
from importlib import metadata

import pytest

from cuspline.app import catalogue, cli
from cuspline.shop.materials import known_materials
from cuspline.values.finding_kinds import KINDS


def test_the_version_is_the_package_s(capsys):
    assert cli.run(["--version"]) == 0
    assert capsys.readouterr().out == f"cuspline {metadata.version('cuspline')}\n"


def test_a_bare_command_shows_the_help(capsys):
    assert cli.run([]) == 0
    assert capsys.readouterr().out.startswith("Usage: cuspline [OPTIONS] COMMAND")


def test_materials_are_listed_with_units_and_sources(capsys):
    assert cli.run(["materials"]) == 0
    words = capsys.readouterr().out
    for material in known_materials().values():
        assert f"\n{material.name}: " in f"\n{words}" and material.source in words
    assert "cutting speed 270 m/min roughing" in words and "(0.08 mm at 10 mm)" in words


def test_materials_as_json_hold_every_value(capsys):
    assert cli.run(["materials", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == [m.model_dump(mode="json") for m in known_materials().values()]


def test_a_shop_s_own_materials_are_listed_too(tmp_path, capsys):
    steel = {**known_materials()["steel_h13_48hrc"].model_dump(mode="json"), "name": "steel_c45", "source": "our own tests"}
    rows = "\n".join(f"{name} = {json.dumps(value)}" for name, value in steel.items())
    (tmp_path / "shop.toml").write_text(f"[[materials]]\n{rows}\n")
    assert cli.run(["materials", str(tmp_path / "shop.toml"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[-1] == steel


def test_faces_of_a_part_are_listed_with_predicates_for_it(tmp_path, capsys):
    import cadquery as cq

    from cuspline.design import FacePredicate
    from cuspline.kernel import brep
    solid = brep.the_solid(cq.Workplane("XY").box(10, 8, 6).faces(">Z").workplane().hole(3))
    brep.write_step(solid, tmp_path / "block.step", "block")
    assert cli.run(["faces", str(tmp_path / "block.step"), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [r["number"] for r in rows] == list(range(1, 8)) and sum(r["kind"] == "cylinder" for r in rows) == 1
    wall, = (r["hole"] for r in rows if r["hole"])
    assert wall == {"kind": "through", "diameter_mm": 3.0, "depth_mm": 6.0, "mouth_mm": [0.0, 0.0, 3.0], "axis": [0.0, 0.0, 1.0],
                    "angle_deg": None}
    for row, face in zip(rows, brep.faces_of(solid)):
        predicate = eval(row["python"], {"FacePredicate": FacePredicate})
        assert [f.area_mm2 for f in brep.select_faces(brep.faces_of(solid), predicate)] == [face.area_mm2]
    assert cli.run(["faces", str(tmp_path / "block.step"), "--toml"]) == 0
    assert capsys.readouterr().out.count("  [[faces]]\n") == 7


def test_findings_are_listed_with_their_meaning(capsys):
    assert cli.run(["findings"]) == 0
    assert capsys.readouterr().out == "".join(f"{name}: {kind.meaning}\n" for name, kind in KINDS.items())


def test_one_finding_is_shown_with_example_and_fix(capsys):
    assert cli.run(["findings", "plunge"]) == 0
    words = capsys.readouterr().out
    assert KINDS["plunge"].example in words and KINDS["plunge"].fix in words


@pytest.mark.parametrize("arguments", [["findings", "gauge"], ["build", "z_profile", "--accept", "gauge"]])
def test_a_kind_of_finding_that_there_is_not_is_refused_with_the_nearest(arguments, capsys):
    assert cli.run(arguments) == 2
    assert "'gauge': there is no such name; did you mean gouge?" in capsys.readouterr().err


def test_whoever_closes_the_pipe_gets_no_internal_error():
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-c", "from cuspline.app.entry import main; main()", "findings"],
                          stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stderr) == (2, "cuspline: whoever read the output has closed it\n")


@pytest.mark.parametrize("name", ["designs", "machines", "cutters", "materials", "posts", "strategies", "shop", "findings"])
def test_every_list_is_told_in_words_and_as_json(name, capsys):
    assert cli.run([name]) == 0
    words = capsys.readouterr().out
    assert cli.run([name, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    first = rows[0].get("name") or rows[0].get("kind") or rows[0]["cutter"]["name"]
    assert rows and first in words


def test_a_design_saved_twice_within_a_second_is_read_as_it_stands(tmp_path):
    """Same size, same second: Python would take the byte code of the first for that of the second."""
    text = ("from cuspline.design import Parameters\n\n\nclass P(Parameters):\n    size_mm: float = {}\n\n\n"
            "def design(p: P):\n    return p\n")
    path = tmp_path / "part.py"
    found = []
    for size in ("1.0", "2.0"):
        path.write_text(text.format(size))
        os.utime(path, (1e9, 1e9))
        found.append(catalogue.find_design(str(path)).parameters().size_mm)
    assert found == [1.0, 2.0]
