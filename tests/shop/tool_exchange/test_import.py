"""Fusion and FreeCAD libraries read in: measures, units, what is dropped, assumed, skipped, refused."""

import json

import numpy as np
import pytest
from foreign_libraries import HOLDER, freecad_bit, freecad_library, fusion_library, fusion_tool, inch

from cuspline.app import cli
from cuspline.app.catalogue import find_library
from cuspline.shop.cutters import library_from_json
from cuspline.shop.presets import Preset
from cuspline.shop.tool_exchange.importing import import_tools
from cuspline.values.errors import InputError

HOLDERS = [t.holder for t in find_library(None).tools]


def completed(path, **more):
    return import_tools(path, **{"holder": "ER16 collet chuck", "holders": HOLDERS, "stick_out_mm": 45.0, **more})


# Fusion -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["json", "tools"])
def test_a_fusion_tool_keeps_every_measure(tmp_path, suffix):
    tool = import_tools(fusion_library(tmp_path / f"shop.{suffix}", fusion_tool(number=7))).library.tools[0]
    c = tool.cutter
    assert (tool.number, c.type, c.diameter_mm, c.flutes, c.flute_length_mm, c.reach_mm, c.neck_diameter_mm,
            c.shank_diameter_mm, c.overall_length_mm, tool.stick_out_mm) == (7, "flat", 10, 3, 22, 30, 9.2, 10, 80, 45)
    # the holder ends at its gauge line, in the middle of the last segment
    assert tool.length_mm == pytest.approx(105)
    np.testing.assert_allclose(tool.non_cutting_frusta()[-1], (95, 31.5, 105, 34))


@pytest.mark.parametrize("type_, geometry, wanted", [
    ("ball end mill", {}, ("ball", 10, 5, None)),
    ("bull nose end mill", {"RE": 1.5}, ("bull_nose", 10, 1.5, None)),
    ("tapered mill", {"DC": 4.0, "RE": 2.0, "TA": 3.0, "shoulder-diameter": 4.0}, ("tapered_ball", 4, 2, 3.0)),
    ("dovetail mill", {"RE": 0.0, "TA": 8.0, "shoulder-diameter": 3.0}, ("dovetail", 10, 0, 8.0))])
def test_every_type_of_fusion_that_has_a_counterpart_comes_in(tmp_path, type_, geometry, wanted):
    path = fusion_library(tmp_path / "shop.json", fusion_tool(type_, **geometry))
    c = import_tools(path).library.tools[0].cutter
    assert (c.type, c.diameter_mm, c.corner_radius_mm, c.taper_deg) == wanted


def test_a_tapered_bull_nose_keeps_its_flat_its_corner_and_its_side(tmp_path):
    path = fusion_library(tmp_path / "shop.json", fusion_tool("tapered mill", DC=8.0, RE=1.0, TA=5.0))
    p = import_tools(path).library.tools[0].cutter.profile
    assert p.end_mm[0] == pytest.approx((3.0, 0.0))                 # flat of diameter 8 - 2
    r, beta = 3 + np.cos(np.radians(5)), np.radians(5)              # where the corner meets the side
    assert p.start_mm[-1] == pytest.approx((r, 1 - np.sin(beta)))
    assert p.top_radius_mm == pytest.approx(r + (22 - 1 + np.sin(beta)) * np.tan(beta))


def test_inches_become_millimetres_tool_by_tool_and_the_holder_keeps_its_own_unit(tmp_path):
    path = fusion_library(tmp_path / "shop.json", fusion_tool(number=1), inch(fusion_tool(number=2)))
    mm, inches = import_tools(path).library.tools
    assert inches.cutter.diameter_mm == pytest.approx(10, rel=1e-14)
    np.testing.assert_allclose(inches.non_cutting_frusta(), mm.non_cutting_frusta(), rtol=1e-13)


def test_shaft_segments_become_the_neck(tmp_path):
    tool = fusion_tool(**{"shoulder-length": None, "shoulder-diameter": None})
    tool["shaft"] = {"type": "shaft", "segments": [{"height": 8.0, "lower-diameter": 7.0, "upper-diameter": 10.0}]}
    read = import_tools(fusion_library(tmp_path / "shop.json", tool)).library.tools[0]
    np.testing.assert_allclose(read.non_cutting_frusta()[0], (22, 3.5, 30, 5))


def test_drills_and_chamfer_mills_come_with_their_points(tmp_path):
    same = {"DC": 6.0, "SFDM": 6.0, "shoulder-length": None, "shoulder-diameter": None}
    path = fusion_library(tmp_path / "shop.json", fusion_tool("drill", 1, SIG=118.0, **same),
                          fusion_tool("spot drill", 2, SIG=90.0, **same),
                          fusion_tool("chamfer mill", 3, TA=45.0, **{**same, "tip-diameter": 1.0}),
                          fusion_tool("drill", 4, **same))
    drill, spot, chamfer = (t.cutter for t in import_tools(path).library.tools)
    assert (drill.type, drill.point_angle_deg) == ("drill", 118.0) and (spot.type, spot.point_angle_deg) == ("spot_drill", 90.0)
    assert chamfer.point_angle_deg == 90.0 and chamfer.point_height_mm == pytest.approx(2.5)
    assert "SIG is missing" in import_tools(path).rows[3].skipped_because
    bit = freecad_bit("Drill", TipAngle="140.00 °", ShankDiameter=None)
    read = completed(freecad_library(tmp_path, bit))
    assert read.library.tools[0].cutter.point_angle_deg == 140.0 and "as thick as the drill" in read.rows[0].assumed[0]


def test_taps_and_thread_mills_come_with_pitch_and_hand(tmp_path):
    same = {"DC": 6.0, "SFDM": 6.0, "shoulder-length": None, "shoulder-diameter": None}
    path = fusion_library(tmp_path / "shop.json", fusion_tool("tap right hand", 1, TP=1.0, **same),
                          fusion_tool("tap left hand", 2, TP=0.75, **same), fusion_tool("tap right hand", 3, **same),
                          fusion_tool("thread mill", 4, **{**same, "shoulder-length": 30.0, "shoulder-diameter": 4.0}))
    read = import_tools(path)
    right, left, mill = (t.cutter for t in read.library.tools)
    assert (right.type, right.pitch_mm, right.hand) == ("tap", 1.0, "right") and (left.pitch_mm, left.hand) == (0.75, "left")
    assert right.neck_diameter_mm == pytest.approx(right.body.diameter_mm)
    assert "chamfer_threads = 3" in " ".join(read.rows[0].assumed)
    assert "TP is missing" in read.rows[2].skipped_because
    assert mill.type == "thread_mill" and mill.neck_diameter_mm == 4.0


def test_face_mills_slot_mills_reamers_and_sinkers_come_as_what_they_are(tmp_path):
    same = {"SFDM": 10.0, "shoulder-length": None, "shoulder-diameter": None}
    necked = {"SFDM": 10.0, "shoulder-length": 30.0, "shoulder-diameter": 8.0}
    path = fusion_library(tmp_path / "shop.json", fusion_tool("face mill", 1, DC=50.0, LCF=6.0, RE=0.8, TA=45.0, **necked),
                          fusion_tool("face mill", 2, DC=50.0, LCF=6.0, **necked),
                          fusion_tool("slot mill", 3, DC=16.0, LCF=4.0, **necked), fusion_tool("reamer", 4, DC=8.0, **same),
                          fusion_tool("counter sink", 5, DC=12.0, SIG=90.0, **same),
                          fusion_tool("counter bore", 6, DC=11.0, **same))
    read = import_tools(path)
    leaning, upright, slot, reamer, sink, bore = (t.cutter for t in read.library.tools)
    assert (leaning.type, leaning.insert_angle_deg, leaning.body.type) == ("face_mill", 45.0, "apt")
    assert leaning.profile.top_radius_mm == pytest.approx(25 + 6)           # 45 degrees out over the height of its inserts
    assert (upright.insert_angle_deg, upright.body.type) == (90.0, "flat")
    assert (slot.type, slot.flute_length_mm, slot.corner_radius_mm) == ("side", 4.0, 0.01) and slot.is_undercutting
    assert reamer.type == "reamer" and (sink.type, sink.point_height_mm) == ("chamfer_mill", pytest.approx(6.0))
    assert bore.has_flat_bottom and "it has no pilot" in read.rows[5].assumed


def test_freecad_chamfers_vbits_taps_thread_mills_and_reamers_come_with_their_measures(tmp_path):
    bits = (freecad_bit("Chamfer", CuttingEdgeAngle="90.0000 °", TipDiameter="2.0000 mm", CuttingEdgeHeight="4.0000 mm"),
            freecad_bit("V-Bit", CuttingEdgeAngle="60.0000 °", TipDiameter="0.1000 mm", CuttingEdgeHeight="1.0000 mm"),
            freecad_bit("Tap", Diameter="8 mm", Pitch="1.25 mm", CuttingEdgeLength="24 mm", CuttingEdgeHeight=None),
            freecad_bit("ThreadMill", Diameter="5.00 mm", NeckDiameter="3.00 mm", NeckLength="20.00 mm", Crest="0.10 mm",
                        CuttingEdgeHeight=None), freecad_bit("Reamer", Diameter="8 mm"))
    read = completed(freecad_library(tmp_path, *bits))
    chamfer, v, tap, mill, reamer = (t.cutter for t in read.library.tools)
    assert (chamfer.point_angle_deg, chamfer.tip_diameter_mm, chamfer.point_height_mm) == (90.0, 2.0, pytest.approx(4.0))
    said = [" ".join(row.assumed) for row in read.rows]
    assert v.diameter_mm == pytest.approx(0.1 + 2 * np.tan(np.radians(30))) and "where its edge ends" in said[1]
    assert (tap.pitch_mm, tap.hand, tap.flute_length_mm) == (1.25, "right", 24.0) and "hand = right" in said[2]
    assert mill.flute_length_mm == pytest.approx(0.1 + 2 * np.tan(np.radians(30))) and mill.reach_mm == 20.0
    assert reamer.type == "reamer"


@pytest.mark.parametrize("kind", sorted({t.cutter.type for t in find_library(None).tools}))
def test_every_kind_of_the_library_is_written_and_read_again_without_loss(tmp_path, kind):
    tools = find_library(None).of_type(kind)
    path = tmp_path / "kind.json"
    path.write_text(json.dumps({"tools": [t.model_dump(mode="json") for t in tools]}))
    again = library_from_json(path).of_type(kind)
    assert again == tools and all(t.simulated.cutter.profile.volume_mm3 > 0 for t in again)


def test_everything_dropped_or_assumed_is_listed(tmp_path):
    tool = fusion_tool(NOF=None, **{"shoulder-diameter": None})
    row = import_tools(fusion_library(tmp_path / "shop.json", tool)).rows[0]
    assert set(row.dropped) == {"BMC", "expressions", "geometry.CSP", "geometry.HAND", "geometry.assemblyGaugeLength",
                                "guid", "holder.vendor", "post-process.live", "vendor"}
    assert row.tool.presets == (Preset(name="preset 1", spindle_rpm=9000),)
    assert [a.split(" (")[0] for a in row.assumed] == ["flutes = 1, for the slowest feed", "neck_diameter_mm = 10"]


@pytest.mark.parametrize("tool, reason", [
    (fusion_tool("lollipop mill", 2), "type 'lollipop mill' has no counterpart"),
    (fusion_tool("form mill", 2), "type 'form mill'"), (fusion_tool(number=2, unit="furlongs"), "unit is 'furlongs'"),
    (fusion_tool(number=2, DC=None), "geometry.DC is missing"), (fusion_tool(number=2, DC=-3.0), "geometry.DC is -3.0"),
    (fusion_tool("bull nose end mill", 2, RE=6.0), "0 < corner_radius_mm < diameter/2"),
    (fusion_tool(number=2, RE=1.0), "it is a bull nose"), (fusion_tool(number=2, LB=90.0), "stick_out_mm must be")])
def test_what_has_no_counterpart_is_skipped_with_its_reason(tmp_path, tool, reason):
    done = import_tools(fusion_library(tmp_path / "shop.json", fusion_tool(number=1), tool))
    assert [t.number for t in done.library.tools] == [1]
    assert reason in done.rows[1].skipped_because


def test_a_library_of_nothing_but_strangers_is_refused(tmp_path):
    path = fusion_library(tmp_path / "shop.json", fusion_tool("form mill"))
    with pytest.raises(InputError, match="no tool can be imported: form mill 1: type 'form mill'"):
        import_tools(path)


@pytest.mark.parametrize("tool, message", [
    (fusion_tool(holder=None), "1 tool without a holder .flat end mill 1.*--holder NAME"),
    (fusion_tool(LB=None), "1 tool without a stick-out.*--stick-out MM"),
    (fusion_tool(number=0), "1 tool without a number.*--renumber")])
def test_holder_stick_out_and_number_are_asked_for_and_never_guessed(tmp_path, tool, message):
    path = fusion_library(tmp_path / "shop.json", tool)
    with pytest.raises(InputError, match=message):
        import_tools(path)
    row = completed(path, is_renumbered=True).rows[0]
    assert row.tool is not None and any("as requested" in a or "renumbered" in a for a in row.assumed)


def test_what_the_file_says_goes_before_what_the_caller_gives(tmp_path):
    tool = completed(fusion_library(tmp_path / "shop.json", fusion_tool(LB=40.0))).library.tools[0]
    assert (tool.stick_out_mm, tool.holder.name) == (40, "ER16")


def test_an_unknown_holder_is_refused_with_those_there_are(tmp_path):
    with pytest.raises(InputError, match="no holder 'HSK'; there are ER16 collet chuck, ER25 collet chuck"):
        completed(fusion_library(tmp_path / "shop.json", fusion_tool(holder=None)), holder="HSK")


def test_a_holder_that_stands_in_the_library_by_itself_can_be_named(tmp_path):
    path = fusion_library(tmp_path / "shop.json", fusion_tool(holder=None), {**HOLDER, "description": "shrink"})
    assert completed(path, holder="shrink").library.tools[0].holder.name == "shrink"


def test_numbers_used_twice_are_refused_and_renumbered_when_asked(tmp_path):
    path = fusion_library(tmp_path / "shop.json", fusion_tool(), fusion_tool("ball end mill"))
    with pytest.raises(InputError, match=r"used twice: \[1\].*--renumber"):
        import_tools(path).library
    assert [t.number for t in import_tools(path, is_renumbered=True).library.tools] == [1, 2]


def test_inches_tagged_as_millimetres_and_the_reverse_are_refused(tmp_path):
    small = {**inch(fusion_tool()), "unit": "millimeters"}
    with pytest.raises(InputError, match="overall length is 3.15 mm.*says 'millimeters'.*look like inches"):
        import_tools(fusion_library(tmp_path / "small.json", small))
    large = {**fusion_tool(), "unit": "inches"}
    with pytest.raises(InputError, match="overall length is 2032 mm.*says 'inches'.*look like millimetres"):
        import_tools(fusion_library(tmp_path / "large.json", large))


@pytest.mark.parametrize("text", ["", "[]", '{"data": 3}', '{"data": [{}]}'])
def test_a_file_that_is_no_library_is_refused_by_name(tmp_path, text):
    (tmp_path / "mine.json").write_text(text)
    with pytest.raises(InputError, match="mine.json is (no Fusion tool library|empty)"):
        import_tools(tmp_path / "mine.json")


# FreeCAD ------------------------------------------------------------------------------------------------


def test_a_freecad_library_comes_in_with_numbers_units_and_what_it_lacks(tmp_path):
    path = freecad_library(tmp_path, freecad_bit(), freecad_bit("Ballend", Diameter='0.25 "', ShankDiameter="0.25 in"),
                           freecad_bit("Bullnose", FlatRadius="4.0000 mm", Flutes=None))
    with pytest.raises(InputError, match="3 tools without a holder"):
        import_tools(path)
    done = completed(path)
    flat, ball, bull = done.library.tools
    assert [(t.number, t.cutter.type) for t in done.library.tools] == [(10, "flat"), (11, "ball"), (12, "bull_nose")]
    assert ball.cutter.diameter_mm == pytest.approx(6.35) and bull.cutter.corner_radius_mm == pytest.approx(1.0)
    assert flat.cutter.flutes == 3 and bull.cutter.flutes == 1
    assert any("flutes = 1" in a for a in done.rows[2].assumed)
    assert done.rows[0].dropped == ("attribute",) and done.rows[0].tool.presets is None and done.rows[1].unit == '", in, mm'


def test_a_tapered_ball_nose_has_half_the_included_angle(tmp_path):
    bit = freecad_bit("TaperedBallNose", Diameter="2 mm", TaperAngle="6 °", TaperDiameter="6 mm", ShankDiameter="6 mm")
    row = completed(freecad_library(tmp_path, bit)).rows[0]
    assert row.tool.cutter.taper_deg == 3 and any("TaperDiameter" in a for a in row.assumed)


@pytest.mark.parametrize("bit, reason", [
    (freecad_bit("Dovetail", CuttingEdgeAngle="60 °"), "does not say whether"), (freecad_bit("Probe"), "'probe'"),
    (freecad_bit(Diameter=None), "parameter.Diameter is None"), (freecad_bit(Diameter="10 °"), "it must be positive"),
    (freecad_bit("TaperedBallNose", TaperAngle="20 °", TaperDiameter="11 mm"), "the taper reaches")])
def test_a_bit_that_cannot_be_told_is_skipped_with_its_reason(tmp_path, bit, reason):
    done = completed(freecad_library(tmp_path, freecad_bit(), bit))
    assert len(done.library.tools) == 1 and reason in done.rows[1].skipped_because


def test_one_bit_alone_needs_a_number(tmp_path):
    freecad_library(tmp_path, freecad_bit())
    with pytest.raises(InputError, match="without a number"):
        completed(tmp_path / "bit0.fctb")
    assert completed(tmp_path / "bit0.fctb", is_renumbered=True).library.tools[0].number == 1


def test_a_measure_without_a_unit_is_listed_as_assumed(tmp_path):
    row = completed(freecad_library(tmp_path, freecad_bit(Diameter=10.0))).rows[0]
    assert "Diameter in mm (10.0 has no unit)" in row.assumed


def test_a_missing_bit_is_named(tmp_path):
    path = freecad_library(tmp_path, freecad_bit())
    (tmp_path / "bit0.fctb").unlink()
    with pytest.raises(InputError, match="shop.fctl names the bit 'bit0.fctb'"):
        completed(path)


# the command --------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch, capsys):
    def call(*arguments):
        monkeypatch.setattr("sys.argv", ["cuspline", "cutters", *map(str, arguments)])
        with pytest.raises(SystemExit) as done:
            cli.main()
        said = capsys.readouterr()
        return done.value.code or 0, said.out, said.err
    return call


def test_what_was_imported_reads_back_as_the_same_library_with_its_report_beside_it(run, tmp_path):
    path = fusion_library(tmp_path / "shop.tools", fusion_tool(), fusion_tool("tapered mill", 2, DC=8.0, RE=1.0, TA=5.0),
                          inch(fusion_tool("ball end mill", 3)), fusion_tool("form mill", 4))
    code, _, err = run("--import", path, "--to", tmp_path / "mine.json")
    assert code == 0 and "3 of 4 tools imported" in err and "skipped: type 'form mill'" in err and "dropped: BMC" in err
    assert library_from_json(tmp_path / "mine.json") == import_tools(path).library
    report = json.loads((tmp_path / "mine.dropped.json").read_text())["import"]
    assert report["source"] == "shop.tools"
    assert [t["imported_as"] for t in report["tools"]] == ["flat", "apt", "ball", None]
    assert "geometry.HAND" in report["tools"][0]["dropped"]


def test_a_tool_table_lists_beside_it_all_that_it_cannot_hold(run, tmp_path):
    code, _, _ = run("--to", tmp_path / "tool.tbl", "--machine", "mill_3axis_inch")
    lines = (tmp_path / "tool.tbl").read_text().splitlines()
    shop = find_library(None)
    assert code == 0 and len(lines) == len(shop.tools)
    assert f"Z{shop.tools[0].length_mm / 25.4:.6f} D{16 / 25.4:.6f} ;flat 16 mm" in lines[0]
    beside = json.loads((tmp_path / "tool.dropped.json").read_text())["export"]
    dropped = beside["dropped"]["T1"]
    assert beside["unit_of_the_table"] == "inch" and dropped["cutter.flute_length_mm"] == 36
    assert dropped["stick_out_mm"] == 55 and dropped["holder.segments.0.height_mm"] == 4
    assert not {"number", "cutter.diameter_mm"} & set(dropped)


@pytest.mark.parametrize("arguments, wanted", [
    (("--to", "tools.xls"), "tools.xls"), (("--import", "no.json"), "no.json does not exist"),
    (("--import", "shop.csv"), "shop.csv"), (("--to", "nowhere/tools.json"), "nowhere")])
def test_files_that_cannot_be_are_refused(run, tmp_path, monkeypatch, arguments, wanted):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*arguments)
    assert code == 2 and out == "" and wanted in err and list(tmp_path.iterdir()) == []
