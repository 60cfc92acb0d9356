"""Passes of a cutter that leans one way however it is fed: where its middle would sink into stock, they are turned round."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from known_tools import tool

from cuspline.planning.trailing_passes import sunk_contacts_mm, without_plunges
from cuspline.program.program import MoveWriter
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.toolpaths.five_axis.leaning_moves import Ground, LeaningRules, leaning
from cuspline.toolpaths.five_axis.tool_axes import LeadTilt
from cuspline.toolpaths.freeform.tip_paths import TipPath

LEAD_DEG, STEEPEST_DEG = 8.0, 5.0
BULL = tool("bull_nose", 16, 2.0, number=2)
BULL = BULL.model_copy(update={"cutter": BULL.cutter.model_copy(update={"ramp_deg": STEEPEST_DEG})})
AXIS = LeadTilt(lead_deg=LEAD_DEG, toward=(1.0, 0.0, 0.0))
BOTTOM_MM = 6.0 * np.sin(np.radians(LEAD_DEG)) + 2.0 * (1.0 - np.cos(np.radians(LEAD_DEG)))     # of its middle, over the contact


@dataclass(frozen=True)
class Level(Ground):
    """A floor at height 0."""

    def is_touched(self, middles_mm):
        return middles_mm[:, 2] < 2.001

    def normals(self, middles_mm):
        return np.tile((0.0, 0.0, 1.0), (len(middles_mm), 1))

    def beyond_mm(self, middles_mm, normals):
        return np.zeros(len(middles_mm))


RULES = LeaningRules(tool_axis=AXIS, radius_mm=2.0, bulge_mm=1e-4, ground=Level(), corner=CornerContact.of(
    BULL.cutter, np.radians(LEAD_DEG), 0.0))


@dataclass(frozen=True)
class Link:
    """As much of TipLinkRules as is asked: passes are given in their order."""

    keeps_order: bool = True


def laid(runs, link=None):
    """Passes one after the other, each from and to 20 mm above the floor."""
    writer = MoveWriter((-50.0, 0.0, 20.0))
    for path in runs[0]:
        writer.rapid((*path.tips_mm[0, :2], 20.0))
        for tip in path.tips_mm:
            writer.feed(tip, 1000.0)
        writer.feed((*path.tips_mm[-1, :2], 20.0), 1000.0)
    return writer.moves()


def passes(*ys):
    """To and fro along x, the first ahead."""
    return [[TipPath(tips_mm=np.array([(0.0, y, 0.0), (40.0, y, 0.0)])[::1 if k % 2 == 0 else -1], is_closed=False, curve=k)
             for k, y in enumerate(ys)]]


def work(standing_mm):
    return SimpleNamespace(tool_axis=AXIS, stock_mm=lambda xy: np.full(len(xy), standing_mm))


def directions(runs):
    return [bool(p.tips_mm[-1, 0] > p.tips_mm[0, 0]) for p in runs[0]]


@pytest.mark.parametrize("above_mm, sinks", [(-0.01, False), (0.01, True)])
def test_a_pass_back_sinks_the_middle_into_what_is_higher_than_it(above_mm, sinks):
    found = leaning(laid(passes(0.0, 30.0)), RULES)
    sunk = sunk_contacts_mm(work(BOTTOM_MM + above_mm), found, BULL)
    assert bool(len(sunk)) == sinks and (not sinks or np.abs(sunk[:, 1] - 30.0).max() < 1e-6)


def test_beside_a_pass_that_is_cut_nothing_is_left_so_high():
    found = leaning(laid(passes(0.0, 2.0, 4.0)), RULES)
    assert not len(sunk_contacts_mm(work(BOTTOM_MM + 1.0), found, BULL))


def test_only_passes_that_would_sink_are_turned_round_and_the_order_stays():
    link = Link()
    runs, kept, count = without_plunges(work(BOTTOM_MM + 1.0), passes(0.0, 30.0, 60.0, 62.0), link, laid, RULES, BULL)
    assert directions(runs) == [True, True, True, False] and count == 1 and kept.keeps_order
    assert [p.tips_mm[0, 1] for p in runs[0]] == [0.0, 30.0, 60.0, 62.0]
    runs, kept, count = without_plunges(work(0.0), passes(0.0, 30.0), link, laid, RULES, BULL)
    assert directions(runs) == [True, False] and count == 0 and kept is link
