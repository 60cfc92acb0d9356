"""Indexed positions on a part that lies as its markers were measured: the same cuts in the part, posted for how it lies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.app.judge import post_module, posted_positions
from cuspline.design import Marker
from cuspline.design.setup_alignment import refixtured_setups
from cuspline.planning.plan import clamping_program
from cuspline.values.frames import Frame

PART = Path(__file__).parents[1] / "parts" / "indexed_block.py"
PLACES = {"a": (7.0, 7.0, 14.0), "b": (-7.0, 7.0, 14.0), "c": (-7.0, -7.0, 14.0), "d": (7.0, -7.0, 14.0)}
SHIFT_MM, TURN_RAD = (0.3, -0.2, 0.15), np.radians([0.05, -0.03, 0.1])
HELD = {"indexed": True, "clamped_x": (1.0, 0.0, 0.0), "clamped_z": (0.0, 0.0, 1.0),
        "markers": tuple(Marker(name=n, at_mm=at) for n, at in PLACES.items())}
MICROMETRE = 1e-3


def turned(rad):
    """(3, 3) about X, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rad), np.sin(rad)
    return (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ [[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]
            @ [[1, 0, 0], [0, cx, -sx], [0, sx, cx]])


LYING = Frame(rotation=turned(TURN_RAD), origin_mm=SHIFT_MM)         # the part, seen from the zero as it was meant


@pytest.fixture(scope="module")
def planned():
    """(Order, plans) of two positions of one clamping, planned for the part as designed."""
    source = catalogue.find_design(str(PART))
    design = catalogue.make_design(source, [])
    design = replace(design, setups=tuple(s.model_copy(update=HELD) for s in design.setups))
    order = recipe.Order(source=source, design=design, machine=catalogue.find_machine(design.machine), accepted=(),
                         library=catalogue.find_library(None), last_stage="gcode", out=Path("nowhere"))
    return order, recipe._planned(order, lambda text: None)


def posted(order, plans):
    """[PostedMoves] read back from the text, one a position."""
    tools = {o.tool.number: o.tool for p in plans for o in p.operations}
    texts = post_module(order.machine).post(clamping_program(plans, (), "top"), order.machine).texts
    return posted_positions(texts, [p.setup for p in plans], order.machine, tools)


def as_measured(plans, noise_mm=0.0):
    """The same plans with setups as markers say that were measured on the part as it lies."""
    noise = noise_mm * np.random.default_rng(3).normal(size=(len(PLACES), 3))
    measured = dict(zip(PLACES, map(tuple, LYING.out(np.array(list(PLACES.values()))) + noise)))
    setups = refixtured_setups([p.setup for p in plans], {"top": measured})
    return [replace(p, setup=s) for p, s in zip(plans, setups)]


def test_what_was_posted_for_the_part_as_designed_moved_with_the_part_is_what_is_posted_anew(planned):
    """No path is planned again: text to text, each tip within a micrometre of where the rigid motion takes it."""
    order, plans = planned
    anew = as_measured(plans)
    for before, after, old, new in zip(plans, anew, posted(order, plans), posted(order, anew)):
        was, now = (p.end_mm[p.kind != 0] for p in (old, new))
        moved = after.setup.frame.into(before.setup.frame.out(was))
        assert len(was) > 100 and np.abs(moved - now).max() < MICROMETRE
        assert np.linalg.norm(was - now, axis=1).max() > 0.2                # and it is no small motion


def test_noise_of_two_micrometres_at_the_markers_leaves_the_sides_where_they_belong(planned):
    """Cuts as they fall in the part that really lies so: within 10 um by the fit, 0.3 mm off without one."""
    _, plans = planned
    worst = {}
    for name, lying in (("by the fit", as_measured(plans, 0.002)), ("without", plans)):
        worst[name] = max(_off_mm(plan, meant) for plan, meant in zip(lying, plans))
    assert worst["by the fit"] < 0.010 < 0.3 < worst["without"]


def _off_mm(plan, meant):
    """The farthest that a cut in the part lies from where it was meant, by how a setup says that the part lies."""
    ends = np.vstack([o.moves.end_mm for o in meant.operations])
    wanted = meant.setup.turn.out(ends)                                   # part coordinates
    return float(np.linalg.norm(LYING.into(plan.setup.clamped_frame.into(wanted)) - wanted, axis=1).max())
