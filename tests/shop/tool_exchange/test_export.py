"""Libraries written for Fusion and FreeCAD and read in again: the same tools with their presets, in the formats' own words."""

import json
import zipfile

import pytest

from cuspline.app import cli
from cuspline.app.catalogue import find_library
from cuspline.shop.cutters import Chatter, Cutter, library_from_json
from cuspline.shop.presets import Preset
from cuspline.shop.tool_exchange.exporting import exported
from cuspline.shop.tool_exchange.foreign import OWN
from cuspline.shop.tool_exchange.importing import import_tools
from cuspline.values.errors import InputError

SHOP = find_library(None)
NO_SHAPE = {"side", "dovetail"}         # kinds that FreeCAD has no shape for, beside face mills whose inserts lean


def presets_of(tool):
    """Three of a tool: all fields, speed alone, coolant and notes alone."""
    return (Preset(name="Al rough", material="aluminium_6061", use="rough", spindle_rpm=9000 + tool.number, feed_per_tooth_mm=0.05,
                   plunge_share=0.3, ramp_deg=2.5, stepdown_mm=1.7, stepover_mm=3.3, coolant="flood", notes="as cut in May"),
            Preset(name="slow", cutting_speed_m_per_min=37.7, feed_per_tooth_mm=0.013),
            Preset(name="dry", use="pocket", coolant="off"))


TOOLS = tuple(t.model_copy(update={"presets": presets_of(t)}) for t in SHOP.tools)


def written(folder, tools, name):
    made = exported(tools, folder / name)
    for file, content in made.files.items():
        (folder / file).write_bytes(content)
    return made


@pytest.mark.parametrize("name", ["shop.tools", "shop.fusion.json", "shop.fctl"])
def test_every_tool_is_the_same_with_its_presets_when_it_is_read_in_again(tmp_path, name):
    made = written(tmp_path, TOOLS, name)
    again = {t.number: t for t in import_tools(tmp_path / name).library.tools}
    left = {t.number for t in TOOLS if name.endswith(".fctl") and (t.cutter.type in NO_SHAPE or t.cutter.insert_angle_deg == 45)}
    assert len(made.left_out) == len(left) and len(left) == (5 if name.endswith(".fctl") else 0)
    assert again == {t.number: t for t in TOOLS if t.number not in left}


@pytest.mark.parametrize("kind", sorted({t.cutter.type for t in SHOP.tools} - {"side"}))
def test_fusions_own_words_say_all_of_a_plain_tool(tmp_path, kind):
    """What Fusion itself would read: nothing stands under our key but what a few tools have beyond its words."""
    plain = [t.model_copy(update={"presets": (Preset(name="Al", material="aluminium_6061", spindle_rpm=8000, feed_per_tooth_mm=0.04,
                                                     coolant="mist"),)}) for t in SHOP.of_type(kind)]
    made = written(tmp_path, plain, "shop.fusion.json")
    assert {k: set(v) for k, v in made.beyond.items()} == (
        {"T81": {"cutter"}, "T82": {"cutter"}} if kind == "reamer" else {})
    row = json.loads((tmp_path / "shop.fusion.json").read_text())["data"][0]
    preset, c = row["start-values"]["presets"][0], row["geometry"]
    feed = preset["v_f_plunge"] if kind in ("drill", "spot_drill", "reamer") else preset["v_f"]
    assert feed == pytest.approx(8000 * 0.04 * c["NOF"]) and preset["v_c"] == pytest.approx(3.141592653589793 * c["DC"] * 8)
    assert preset["tool-coolant"] == "mist" and preset["material"]["query"] == "aluminium_6061"


def test_what_a_format_cannot_say_stands_under_one_key_and_comes_back(tmp_path):
    odd = SHOP.number(3).model_copy(update={"chatter": Chatter(least_real_mm_per_n=-1e-4)})
    odd = odd.model_copy(update={"cutter": odd.cutter.model_copy(update={"ramp_deg": 3.0, "max_rpm": 12000.0})})
    made = written(tmp_path, [odd], "shop.fusion.json")
    assert made.beyond == {"T3": {"cutter": {"ramp_deg": 3.0, "max_rpm": 12000.0},
                                  "chatter": {"least_real_mm_per_n": -1e-4, "modes": None}}}
    assert import_tools(tmp_path / "shop.fusion.json").library.tools == (odd,)
    document = json.loads((tmp_path / "shop.fusion.json").read_text())
    document["data"][0][OWN] = {"cutter": {"ramp_deg": "steep"}}
    (tmp_path / "shop.fusion.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match="no tool can be imported: flat 10 mm: .*ramp_deg"):
        import_tools(tmp_path / "shop.fusion.json")


def test_a_cutter_that_no_format_has_is_left_out_by_name(tmp_path):
    lens = Cutter(name="lens", type="lens", diameter_mm=10, corner_radius_mm=1, tip_radius_mm=40, flutes=2, flute_length_mm=12,
                  neck_diameter_mm=9, reach_mm=30, shank_diameter_mm=10, overall_length_mm=80)
    tools = [SHOP.number(3), SHOP.number(1).model_copy(update={"cutter": lens})]
    assert exported(tools, tmp_path / "a.tools").left_out == (("T1 lens", "Fusion has no kind for a cutter of type lens"),)
    with pytest.raises(InputError, match="no tool has a counterpart there: T1 lens: FreeCAD has no shape"):
        exported(tools[1:], tmp_path / "a.fctl")


@pytest.mark.parametrize("name, files", [("mine.tools", {"mine.tools"}), ("mine.fctl", {"mine.fctl", "mine-T1.fctb"})])
def test_the_command_writes_the_files_and_what_was_left_out_and_twice_the_same_bytes(tmp_path, monkeypatch, capsys, name, files):
    (tmp_path / "own.json").write_text(json.dumps({"tools": [TOOLS[0].model_dump(mode="json")]}))
    kept = []
    for _ in range(2):
        assert cli.run(["cutters", str(tmp_path / "own.json"), "--to", str(tmp_path / name)]) == 0
        kept.append({f: (tmp_path / f).read_bytes() for f in files})
    assert kept[0] == kept[1] and f"{name} and mine.dropped.json written" in capsys.readouterr().err
    assert json.loads((tmp_path / "mine.dropped.json").read_text())["export"]["left_out"] == {}
    assert import_tools(tmp_path / name).library == library_from_json(tmp_path / "own.json")
    assert not name.endswith(".tools") or zipfile.ZipFile(tmp_path / name).namelist() == ["tools.json"]
