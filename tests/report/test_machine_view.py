"""The machine as the viewer moves it, packed and unpacked."""

import numpy as np
from packed_blocks import Reader

from cuspline.report import machine_view, packing
from cuspline.report.machine_view import Motion
from cuspline.report.view_data import scene
from cuspline.values.frames import Frame


def motion(joints, **columns):
    """One whose poses follow each other by a second, each in a line of its own."""
    n = len(joints)
    return Motion(**{"setups": (0,), "place": Frame.shift((0, 0, 0)), "joints": np.asarray(joints, float),
                     "time_s": np.arange(n) * 1.0, "own_s": np.arange(n) * 1.0, "setup": np.zeros(n, int),
                     "line": np.arange(n), "tool": np.ones(n, int), "operation": np.zeros(n, int),
                     "feed_mm_per_min": np.full(n, 600.0), "is_rapid": np.zeros(n, bool), **columns})


def unpacked(meta, raw, letters):
    reader, n = Reader(raw), meta["poses"]
    joints = np.column_stack([reader.take_delta(np.int32, n) for _ in range(letters)]) * meta["step"]
    seconds, own = (reader.take_delta(np.int32, n) / 1000 for _ in range(2))
    return joints, seconds, own, reader.take_delta(np.int32, n)


def test_joints_come_back_as_posted():
    rng = np.random.default_rng(2)
    joints = rng.uniform(-400, 400, (300, 5))
    meta, raw = machine_view.pack_motion(motion(joints))
    back, seconds, own, line = unpacked(meta, raw, 5)
    assert np.abs(back - joints).max() <= 0.5001 * machine_view.JOINT_STEP
    assert seconds.tolist() == own.tolist() == line.tolist() == list(range(300))


def test_equal_steps_of_one_block_are_one():
    """A reader cuts a swing into a thousand moves: two poses are enough, and the poses about a corner stay."""
    swing = np.column_stack([np.zeros((1001, 3)), np.linspace(0, -90, 1001)])
    back = swing[::-1] + (0, 0, 5, 0)
    lines = np.repeat([7, 8], 1001)
    assert machine_view.needed(motion(np.vstack([swing, back]), line=lines)).tolist() == [0, 1000, 1001, 2001]


def test_a_place_not_yet_said_is_the_next_one():
    assert packing.known(np.array([[np.nan, 1.0], [2.0, np.nan]])).tolist() == [[2, 1], [2, 1]]


def test_two_hundred_thousand_moves_take_a_few_megabytes():
    """Passes over a curved face on five axes: the text in the page stays below what the stock's changes may take."""
    n = 200_000
    way = np.linspace(0, 400 * np.pi, n)
    joints = np.column_stack([60 * np.sin(way), way / 10, 3 * np.cos(3 * way), 20 * np.sin(way), way])
    _, raw = machine_view.pack_motion(motion(np.round(joints, 4), time_s=0.04 * np.arange(n), own_s=0.04 * np.arange(n)))
    assert len(packing.text_block(raw)) < 4.5e6


def test_the_scene_names_chain_bodies_and_tools(machine_bundle):
    meta, blocks = scene(machine_bundle)
    found = meta["machine"]
    assert found["order"] == ["C", "A", "bed", "Y", "X", "Z"] and found["letters"] == ["X", "Y", "Z", "C", "A"]
    assert [b["name"] for b in found["bodies"]] == ["trunnion", "table", "head", "rock"]
    assert {"motion-0", "body-3"} <= blocks.keys() and found["tools"].keys() == {"1", "2"}
    assert found["motions"][0]["setups"] == [0, 1]


def test_a_report_without_machine_says_so(sample_bundle):
    meta, blocks = scene(sample_bundle)
    assert meta["machine"] is None and not any(name.startswith(("motion", "body")) for name in blocks)
