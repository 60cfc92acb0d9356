"""Moves, tools, machines and frames: what they hold and what they refuse."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_tools import tool
from pydantic import ValidationError

import cuspline.posts
from cuspline.program.program import Kind, Moves, MoveWriter, Plane
from cuspline.shop.cutters import Cutter, ToolLibrary, library_from_json
from cuspline.shop.machines import machine_from_toml
from cuspline.values.errors import InputError, ToolpathError
from cuspline.values.frames import Frame

POSTS = Path(cuspline.posts.__file__).parent


def two_feeds():
    w = MoveWriter((0, 0, 10))
    w.feed((0, 0, 0), 100)
    w.feed((5, 0, 0), 200)
    return w.moves()


# moves ------------------------------------------------------------------------------------------------


def test_each_move_starts_where_the_one_before_ends():
    moves = two_feeds()
    np.testing.assert_array_equal(moves.starts_mm, [(0, 0, 10), (0, 0, 0)])


def test_a_move_to_where_the_tool_stands_is_left_out():
    w = MoveWriter((1, 2, 3))
    w.feed((1, 2, 3), 100)
    w.rapid((1, 2, 3 + 1e-12))
    assert len(w.moves()) == 0


def test_joined_runs_are_linked_by_a_rapid():
    joined = Moves.joined([two_feeds(), two_feeds()])
    assert joined.kind.tolist() == [Kind.FEED, Kind.FEED, Kind.RAPID, Kind.FEED, Kind.FEED]
    np.testing.assert_array_equal(joined.end_mm[2], (0, 0, 10))
    leaning = replace(two_feeds(), axis=np.full((2, 3), (0.6, 0.0, 0.8)))
    np.testing.assert_array_equal(Moves.joined([two_feeds(), leaning]).axis[2], (0.6, 0.0, 0.8))
    with pytest.raises(ToolpathError, match="came out empty"):
        Moves.joined([])


def test_a_cut_without_feed_and_a_move_to_nowhere_are_refused_with_their_rows():
    moves = two_feeds()
    with pytest.raises(ToolpathError, match="1 cutting moves have no feed, first at row 1") as error:
        moves.with_feed([100, 0])
    assert error.value.rows.tolist() == [1]
    w = MoveWriter((0, 0, 0))
    w.feed((np.inf, 0, 0), 100)
    with pytest.raises(ToolpathError, match="no end point"):
        w.moves()


def test_moves_are_copies_that_cannot_be_written():
    given = np.array([100.0, 200.0])
    moves = two_feeds().with_feed(given)
    given[0] = 7
    assert moves.feed_mm_per_min[0] == 100
    with pytest.raises(ValueError):
        moves.end_mm[0, 0] = 1


def test_axes_of_every_plane_are_right_handed():
    unit = np.eye(3)
    for plane in Plane:
        a, b, c = plane.axes
        np.testing.assert_array_equal(np.cross(unit[a], unit[b]), unit[c])


# tools ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad, message", [
    ({"diameter_mm": -3.0}, "diameter_mm"), ({"corner_radius_mm": 2.0}, "a ball cutter of diameter 6.0 mm has"),
    ({"type": "bull_nose"}, "0 < corner_radius_mm < diameter/2"), ({"neck_diameter_mm": 7.0}, "neck_diameter_mm"),
    ({"flute_length_mm": 40.0}, "flute_length <= reach"), ({"colour": "red"}, "colour")])
def test_a_cutter_that_cannot_be_is_refused_by_its_field(bad, message):
    good = tool("ball", 6.0).cutter.model_dump()
    with pytest.raises(ValidationError, match=message):
        Cutter(**{**good, **bad})


def test_what_must_never_touch_reaches_from_the_flutes_to_the_gauge_line():
    t = tool("ball", 6)
    frusta = t.non_cutting_frusta()
    assert frusta[0, 0] == t.cutter.flute_length_mm and frusta[-1, 2] == t.length_mm == 95
    np.testing.assert_array_equal(frusta[1:, 0], frusta[:-1, 2])        # no gap
    np.testing.assert_array_equal(frusta[:, 1], (2.7, 3, 20))


def test_the_library_sorts_by_size_and_refuses_a_number_used_twice():
    library = ToolLibrary(tools=(tool("ball", 6, number=1), tool("ball", 10, number=2), tool("flat", 8, number=3)))
    assert [t.number for t in library.of_type("ball")] == [2, 1]
    with pytest.raises(InputError, match="T9 is not in the library; it holds T1, T2, T3"):
        library.number(9)
    with pytest.raises(ValidationError, match=r"tool numbers used twice: \[1\]"):
        ToolLibrary(tools=(tool("ball", 6), tool("flat", 8)))


def test_the_shops_library_is_valid_and_a_broken_one_names_file_and_key(tmp_path):
    shop = library_from_json(POSTS / "tools" / "tools.json")
    assert len(shop.tools) > 5
    with pytest.raises(InputError, match="does not exist"):
        library_from_json(tmp_path / "none.json")
    broken = json.loads((POSTS / "tools" / "tools.json").read_text())
    broken["tools"][2]["cutter"]["diameter_mm"] = -1
    (tmp_path / "tools.json").write_text(json.dumps(broken))
    with pytest.raises(InputError, match=r"tools.json: tools.2.cutter.diameter_mm: .*\(given: -1\)"):
        library_from_json(tmp_path / "tools.json")
    (tmp_path / "tools.json").write_text("{")
    with pytest.raises(InputError, match="tools.json"):
        library_from_json(tmp_path / "tools.json")


# machines ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("old, new, message", [
    ("max_mm = 0", "max_mm = -700", "x: .*max_mm -700.0 must exceed min_mm -600.0"),
    ("time_constant_s = 0.033", "time_constant_s = 0", "time_constant_s"),
    ("line_length = 252", "line_lenght = 252", "control.line_lenght"),
    ("[spindle]", "[spindle", "not valid TOML"), ('units = "mm"', 'units = "cm"', "control.units")])
def test_a_machine_file_with_a_fault_is_refused_by_its_key(tmp_path, old, new, message):
    text = (POSTS / "machines" / "mill_3axis.toml").read_text()
    assert old in text
    (tmp_path / "m.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=f"m.toml.*{message}"):
        machine_from_toml(tmp_path / "m.toml")


def test_the_shops_machines_are_valid_and_differ_in_units_alone():
    mm, inch = (machine_from_toml(POSTS / "machines" / f"mill_3axis{s}.toml") for s in ("", "_inch"))
    assert (mm.control.units, inch.control.units) == ("mm", "inch")
    assert mm.axes == inch.axes
    with pytest.raises(InputError, match="does not exist"):
        machine_from_toml(POSTS / "machines" / "none.toml")


# frames -----------------------------------------------------------------------------------------------


def test_a_frame_goes_out_and_back_and_keeps_lengths():
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    frame = Frame(rotation=turn * np.sign(np.linalg.det(turn)), origin_mm=(3, -4, 5))
    points = np.random.default_rng(3).normal(size=(20, 3)) * 50
    np.testing.assert_allclose(frame.into(frame.out(points)), points, atol=1e-12)
    np.testing.assert_allclose(frame.turn_into(frame.turn_out(points)), points, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(frame.turn_out(points), axis=1), np.linalg.norm(points, axis=1))
    np.testing.assert_allclose(frame.out(np.zeros((1, 3)))[0], (3, -4, 5))


def test_a_mirror_and_a_stretch_are_no_frames():
    with pytest.raises(ValueError, match="mirrors"):
        Frame(rotation=np.diag((1, 1, -1)), origin_mm=(0, 0, 0))
    with pytest.raises(ValueError, match="orthonormal"):
        Frame(rotation=np.diag((1, 1, 2)), origin_mm=(0, 0, 0))
