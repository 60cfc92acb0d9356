"""The machine in motion: blocks over which its bodies are proven clear a CPU second, and what its view costs a report."""

import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import cuspline.posts
from cuspline.design import Setup, StockBox
from cuspline.design.design import clamped
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind
from cuspline.report.machine_view import Motion, pack_motion
from cuspline.report.packing import text_block
from cuspline.shop.machines import machine_from_toml
from cuspline.values.frames import Frame
from cuspline.verification.body_clearance import body_findings

MACHINES = Path(cuspline.posts.__file__).parent / "machines"
NAMES = ("mill_head_head", "mill_table_table", "mill_head_table", "mill_a_on_b", "mill_trunnion_ac", "mill_head_table_bc")
BLOCKS = 200_000
STOCK = StockBox(min_mm=(-60, -60, 0), max_mm=(60, 60, 40))


def measure():
    """[(what, number, unit)]."""
    return [row for name in NAMES for row in _proven(name)] + _shown()


def _joints(machine):
    """(BLOCKS, m) of passes 200 mm above the zero while the rotaries lean the tool by a few degrees, in every direction."""
    way = np.linspace(0, 400 * np.pi, BLOCKS)
    out = np.array(machine.wcs_origin_mm) + np.column_stack([60 * np.sin(way), way / 20 - 30, 200 + 3 * np.cos(3 * way)])
    return np.column_stack([out, 10 + 8 * np.sin(way), 10 + 8 * np.cos(way)])


def _moves(machine):
    """PostedMoves that run these joints; no tool is in the spindle."""
    joints, n = _joints(machine), BLOCKS
    tips = joints[:, :3] - machine.wcs_origin_mm
    return PostedMoves(
        kind=np.full(n, Kind.FEED), start_mm=np.vstack([tips[:1], tips[:-1]]), end_mm=tips, center_mm=np.full((n, 3), np.nan),
        plane=np.zeros(n), turns=np.zeros(n), feed_mm_per_min=np.full(n, 900.0), spindle_rpm=np.full(n, 9000.0),
        tool=np.zeros(n), length_offset_on=np.ones(n, bool), machine_end_mm=joints[:, :3], line=np.arange(n) + 1,
        operation=np.zeros(n), operations=("finish",), ended=True, rotary_deg=joints[:, 3:])


def _proven(name):
    machine = machine_from_toml(MACHINES / f"{name}.toml")
    setups = clamped((Setup(name="setup-1", wcs_in_words="", faces=("a",)),))
    moves, job = _moves(machine), SimpleNamespace(machine=machine, stock=STOCK)
    for _ in range(2):                      # the first call compiles
        start = time.process_time()
        found = body_findings(moves, np.zeros(BLOCKS, int), setups, job, {})[0]
        seconds = time.process_time() - start
    return [(f"{name}: blocks in which all its bodies are judged", BLOCKS / seconds, "blocks per CPU s"),
            (f"{name}: bodies found too near", len(found), "pairs")]


def _shown():
    """Of a program of 200,000 blocks: how large its joints are in the page, and how long they take to pack."""
    machine, n = machine_from_toml(MACHINES / "mill_trunnion_ac.toml"), BLOCKS
    noise = np.random.default_rng(0).normal(0, 0.002, (n, 5))
    motion = Motion(
        setups=(0,), place=Frame.shift((0, 0, 0)), joints=np.round(_joints(machine) + noise, 4), time_s=0.04 * np.arange(n),
        own_s=0.04 * np.arange(n), setup=np.zeros(n, int), line=np.arange(n), tool=np.ones(n, int), operation=np.zeros(n, int),
        feed_mm_per_min=np.full(n, 900.0), is_rapid=np.zeros(n, bool))
    start = time.process_time()
    text = text_block(pack_motion(motion)[1])
    return [("joints of 200 000 blocks in the report", len(text) / 1e6, "MB"),
            ("to pack them", time.process_time() - start, "CPU s")]
