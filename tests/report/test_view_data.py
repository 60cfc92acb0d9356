"""Packed data, decoded here as viewer.js decodes it."""

import base64
import gzip
from dataclasses import replace

import numpy as np
import pytest
from packed_blocks import Reader

from cuspline.report import packing, view_data
from cuspline.report.bundle import PathPoints, StockReplay
from cuspline.values.frames import Frame


def replayed(meta, raw, until):
    """The z-map after all events up to an instant."""
    reader, count = Reader(raw), meta["events"]
    instant, cell = reader.take_delta(np.uint16, count), reader.take_delta(np.int32, count)
    z = meta["bottomMm"] + reader.take(np.uint16, count) * (meta["topMm"] - meta["bottomMm"]) / 65535
    height = np.full(meta["nx"] * meta["ny"], meta["topMm"])
    for c, value in zip(cell[instant <= until], z[instant <= until]):
        assert value <= height[c] + 1e-9
        height[c] = value
    return height


def test_blocks_carry_no_date():
    text = packing.text_block(b"abc" * 99)
    assert text == packing.text_block(b"abc" * 99)
    raw = base64.b64decode(text)
    assert raw[4:8] == bytes(4) and gzip.decompress(raw) == b"abc" * 99


def test_path_comes_back_as_posted(sample_bundle):
    path = sample_bundle.setups[0].path
    meta, raw = view_data.pack_path(path)
    reader, n = Reader(raw), meta["points"]
    back = np.column_stack([reader.take_delta(np.int32, n) for _ in range(3)]) * meta["stepMm"]
    assert np.abs(back - path.points_mm).max() <= 0.5001 * view_data.PATH_STEP_MM
    assert np.allclose(reader.take_delta(np.int32, n) * meta["feedStep"], path.feed_mm_per_min, atol=0.051)
    assert np.allclose(reader.take_delta(np.int32, n) / 1000, path.time_s, atol=0.00051)
    assert (reader.take(np.int16, n) == path.operation).all() and (reader.take(np.uint8, n) == path.is_rapid).all()
    assert (reader.take_delta(np.int32, n) == path.line).all()


def test_what_the_edges_meet_comes_back_within_half_a_level(sample_bundle):
    path = sample_bundle.setups[0].path
    meta, raw = view_data.pack_path(path)
    column, = meta["met"]
    levels = np.frombuffer(raw, np.uint8)[4 * (-len(path.line) // 4):][:len(path.line)].astype(float)
    assert (column["name"], column["label"], column["unit"]) == ("depth_mm", "depth of cut", "mm")
    assert ((levels == 0) == np.isnan(path.met["depth_mm"])).all()
    back = (levels - 1) / view_data.LEVELS * column["most"]
    np.testing.assert_allclose(back[levels > 0], path.met["depth_mm"][levels > 0], atol=0.51 * column["most"] / view_data.LEVELS)


def test_unknown_coordinates_take_the_next_known_ones():
    points = np.array([[np.nan, 1, np.nan], [2, np.nan, np.nan], [3, 4, np.nan]])
    assert packing.known(points).tolist() == [[2, 1, 0], [2, 4, 0], [3, 4, 0]]
    assert np.isnan(points).any()           # the input stays as it was


def test_replay_ends_at_the_simulated_stock(sample_bundle):
    setup = sample_bundle.setups[0]
    replay = setup.replay
    wanted = np.full(replay.nx * replay.ny, replay.top_mm)
    wanted[replay.event_cell] = replay.event_z_mm        # in order of time: the last stays
    meta, raw = view_data.pack_replay(replay, setup)
    step = (replay.top_mm - replay.bottom_mm) / 65535
    assert np.abs(replayed(meta, raw, meta["instants"]) - wanted).max() <= 0.51 * step


def test_replay_never_shows_a_cut_before_it_was_made(sample_bundle):
    setup = sample_bundle.setups[0]
    meta, raw = view_data.pack_replay(setup.replay, setup)
    until = meta["instants"] // 3
    shown = replayed(meta, raw, until)
    seconds = setup.path.time_s[-1] * until / meta["instants"]
    done = setup.path.time_s[setup.replay.event_move - 1] <= seconds    # its move had at least begun
    reached = np.full(len(shown), setup.replay.top_mm)
    reached[setup.replay.event_cell[done]] = setup.replay.event_z_mm[done]
    assert (shown >= reached - 1e-3).all() and (shown < setup.replay.top_mm).any()


def test_a_thinned_replay_shows_simulated_heights(sample_bundle, monkeypatch):
    setup = sample_bundle.setups[0]
    full = replayed(*view_data.pack_replay(setup.replay, setup), 8000).reshape(setup.replay.ny, setup.replay.nx)
    monkeypatch.setattr(view_data, "MOST_NODES", 1200)
    meta, raw = view_data.pack_replay(setup.replay, setup)
    assert meta["stride"] == 3 and meta["pitchMm"] == 1.5
    assert (replayed(meta, raw, meta["instants"]).reshape(meta["ny"], meta["nx"]) == full[::3, ::3]).all()


def test_many_events_make_fewer_instants(sample_bundle, monkeypatch):
    setup = sample_bundle.setups[0]
    monkeypatch.setattr(view_data, "MOST_EVENTS", 50_000)
    meta, raw = view_data.pack_replay(setup.replay, setup)
    monkeypatch.undo()
    fine, fine_raw = view_data.pack_replay(setup.replay, setup)
    assert meta["instants"] < 8000 and meta["events"] <= 50_000
    assert (replayed(meta, raw, meta["instants"]) == replayed(fine, fine_raw, fine["instants"])).all()


def test_a_long_move_cuts_as_the_cutter_passes(sample_bundle):
    path = PathPoints(points_mm=[[0, 0, 0], [100, 0, 0]], is_rapid=[False, False], feed_mm_per_min=[600, 600],
                      operation=[0, 0], time_s=[0, 10.0], line=[0, 1])
    replay = StockReplay(origin_mm=(0.0, 0.0), pitch_mm=10.0, nx=11, ny=1, bottom_mm=-5.0, top_mm=1.0,
                         design_top_mm=np.full((1, 11), -1.0), event_move=np.ones(11, int), event_cell=np.arange(11),
                         event_z_mm=np.zeros(11))
    setup = replace(sample_bundle.setups[0], path=path, replay=replay, frame=Frame.shift((0, 0, 0)))
    assert view_data.event_times(replay, setup) == pytest.approx(np.arange(11) / 10)


def test_a_setup_that_is_turned_replays_in_its_own_axes(sample_bundle):
    """Turning part and setup together changes no instant."""
    setup = sample_bundle.setups[0]
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    turned = replace(setup, path=replace(setup.path, points_mm=setup.path.points_mm @ turn.T),
                     frame=Frame(rotation=turn, origin_mm=(0, 0, 0)))
    assert (view_data.event_times(setup.replay, setup) == view_data.event_times(setup.replay, turned)).all()


def test_mesh_keeps_what_was_not_judged(sample_bundle):
    mesh = sample_bundle.mesh
    meta, raw = packing.pack_mesh(mesh)
    reader, n = Reader(raw), meta["vertices"]
    back = np.column_stack([reader.take_delta(np.uint16, n) for _ in range(3)]) / 65535 * meta["size"] + meta["low"]
    assert np.abs(back - mesh.vertices_mm).max() < 0.001
    folded = [reader.take_delta(np.int16, n) for _ in range(2)]
    steps = reader.take(np.int16, n)
    assert ((steps == meta["notJudged"]) == np.isnan(mesh.deviation_mm)).all()
    assert (reader.take_delta(np.int32, 3 * meta["triangles"]) == np.ravel(mesh.triangles)).all()
    u, v = np.array(folded) / 32767
    z = 1 - abs(u) - abs(v)
    normal = np.column_stack([u - np.copysign(np.maximum(-z, 0), u), v - np.copysign(np.maximum(-z, 0), v), z])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", normal, mesh.normals).min() > 0.99999


def test_a_silhouette_draws_only_what_is_known():
    assert view_data.tool_silhouette(None) == view_data.tool_silhouette({"name": "?"}) == []
    parts = view_data.tool_silhouette({"type": "bull_nose", "diameter_mm": 10, "corner_radius_mm": 2})
    assert [p["part"] for p in parts] == ["flutes"] and parts[0]["outline"][:2] == [[0.0, 0.0], [3.0, 0.0]]
    ball = view_data.tool_silhouette({"type": "ball", "diameter_mm": 10})[0]["outline"]
    assert ball[0] == [0.0, 0.0] and ball[-2] == [5.0, 5.0]


def test_a_disc_on_a_head_lies_along_x_with_the_head_behind_it():
    """Seen from the tip: the disc points toward +X, so its head lies toward -X from the middle 3 mm behind the tip."""
    disc = {"type": "side", "diameter_mm": 60, "corner_radius_mm": 3, "flute_length_mm": 6, "head": {
        "cutter_points": "+X", "boxes": [{"min_mm": [-28, -12, -14], "max_mm": [-11, 12, 70]}]}}
    *turned, box = view_data.tool_silhouette(disc)
    assert [p["toward"] for p in turned] == [-1.0] * len(turned)
    assert box == {"part": "holder", "box": [[-31.0, -12.0, -14.0], [-14.0, 12.0, 70.0]]}


def test_octahedral_holds_the_poles():
    assert packing.octahedral([[0, 0, 1], [1, 0, 0]]).tolist() == [[0, 0], [32767, 0]]
    assert np.abs(packing.octahedral([[0, 0, -1]])).tolist() == [[32767, 32767]]


@pytest.mark.parametrize("field", ["points_mm", "time_s"])
def test_packing_does_not_edit_its_input(sample_bundle, field):
    setup = sample_bundle.setups[0]
    before = np.array(getattr(setup.path, field))
    view_data.scene(sample_bundle)
    assert (np.asarray(getattr(setup.path, field)) == before).all()
