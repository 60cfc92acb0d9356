"""A ball's moves with the axis turned about its middle: what stays, what turns where, and how far the middle leaves its line."""

import dataclasses

import numpy as np
import pytest

from cuspline.program.program import Kind, MoveWriter, Plane
from cuspline.toolpaths.five_axis.leaning_moves import (
    Ground,
    LeaningRules,
    angles_between,
    leaning,
    on_great_circle,
    upright_again,
)
from cuspline.toolpaths.five_axis.tool_axes import FixedAxis, LeadTilt
from cuspline.values.errors import ToolpathError

RADIUS, TOP, BULGE, FINE = 4.0, 30.0, 0.002, 0.0003     # FINE: turns below 1.5 degrees, which the largest turn does not cap
HUMP = 15.0                 # radius of a cylinder along Y


class Hump(Ground):
    """A cylinder of radius HUMP along Y, its highest line at z = 0."""

    def normals(self, middles_mm):
        arm = middles_mm * (1, 0, 1) + (0, 0, HUMP)
        return arm / np.linalg.norm(arm, axis=1)[:, None]

    def is_touched(self, middles_mm):
        return np.linalg.norm(middles_mm * (1, 0, 1) + (0, 0, HUMP), axis=1) < HUMP + RADIUS + 0.01


class Roof(Ground):
    """Two planes that meet in a hollow at x = 0: the contact jumps from one to the other."""

    def normals(self, middles_mm):
        return np.where(middles_mm[:, :1] < 0, [[0.6, 0, 0.8]], [[-0.6, 0, 0.8]])

    def is_touched(self, middles_mm):
        return middles_mm[:, 2] < RADIUS + 5


def rules(axis=LeadTilt(lead_deg=10, tilt_deg=-20), ground=Hump(), **changed):
    return LeaningRules(**{"tool_axis": axis, "ground": ground, "radius_mm": RADIUS, "bulge_mm": BULGE, **changed})


def over_the_hump(y, w=None):
    """Across the hump in chords of half a micrometre, from and to the top."""
    angles = np.linspace(-0.5, 0.5, 121)
    middle = (HUMP + RADIUS) * np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)]) + (0, y, -HUMP - RADIUS)
    w = w or MoveWriter((*middle[0, :2], TOP))
    w.rapid((*middle[0, :2], TOP))
    for tip in middle:
        w.feed(tip, 1000)
    w.rapid((*middle[-1, :2], TOP))
    return w


def middles(moves):
    return moves.end_mm + RADIUS * moves.axis


def test_the_middle_runs_where_it_ran_and_the_angles_are_as_asked():
    upright = over_the_hump(3.0).moves()
    found = leaning(upright, rules())
    m = found.moves
    ways = np.linalg.norm(np.diff(middles(m), axis=0), axis=1).sum(), np.linalg.norm(np.diff(upright.end_mm, axis=0), axis=1).sum()
    assert ways[0] == pytest.approx(ways[1], abs=1e-9)
    again = upright_again(m, RADIUS)
    assert all(np.linalg.norm(again.end_mm - tip, axis=1).min() < 1e-12 for tip in upright.end_mm)
    n = Hump().normals(middles(m)[found.is_cut])
    a, right = m.axis[found.is_cut], np.array([0.0, -1.0, 0.0])             # of a feed along +X
    assert (a @ right) == pytest.approx(np.full(len(a), np.sin(np.radians(-20))), abs=1e-6)
    lead = np.degrees(np.arctan2((a * np.cross(n, right)).sum(axis=1), (a * n).sum(axis=1)))
    assert np.abs(lead - 10)[5:-5].max() < 1e-3 and np.abs(lead - 10).max() < 2      # at the ends the feed looks one way only


def test_between_two_rows_the_middle_leaves_its_line_by_no_more_than_allowed_and_away_from_the_material():
    """A coarse way over the hump; rows are even, so the bound is not wasted either."""
    w = MoveWriter((-10, 0, TOP))
    angles = np.radians([-25, -12, 0, 12, 25])
    for k in angles:
        w.feed(((HUMP + RADIUS) * np.sin(k), 0, (HUMP + RADIUS) * (np.cos(k) - 1)), 500)
    w.rapid((*w.here_mm[:2], TOP))
    loose = Hump()
    loose.is_touched = lambda middle: middle[:, 2] < RADIUS + 5
    found = leaning(w.moves(), rules(LeadTilt(), loose, bulge_mm=FINE))
    m, cut = found.moves, np.flatnonzero(found.is_cut)
    share = np.linspace(0, 1, 21)[:, None]
    worst = 0.0
    for k in cut:
        tips = m.end_mm[k - 1] + share * (m.end_mm[k] - m.end_mm[k - 1])
        axes = on_great_circle(np.tile(m.axis[k - 1], (21, 1)), np.tile(m.axis[k], (21, 1)), share[:, 0])
        line = middles(m)[k - 1] + share * (middles(m)[k] - middles(m)[k - 1])
        off = tips + RADIUS * axes - line
        worst = max(worst, np.linalg.norm(off, axis=1).max())
        assert (off * axes).sum(axis=1).min() > -1e-12
    assert 0.5 * FINE < worst <= FINE * 1.001 and len(cut) > 10


def test_off_the_part_the_axis_stands_and_turns_in_the_rapid_across():
    w = over_the_hump(0.0)
    back = over_the_hump(2.0, w).moves()
    found = leaning(back, rules())
    m = found.moves
    turn = angles_between(np.vstack([m.axis[:1], m.axis[:-1]]), m.axis)
    off = ~found.is_cut & (turn > 1e-9)
    assert off.sum() == 1 and m.kind[off][0] == Kind.RAPID
    k = int(np.flatnonzero(off)[0])
    assert upright_again(m, RADIUS).end_mm[k - 1:k + 1, 2] == pytest.approx([TOP, TOP])
    assert m.start_mm == pytest.approx(back.start_mm + RADIUS * (np.array([0, 0, 1]) - m.axis[0]))


def test_where_the_contact_jumps_the_axis_turns_on_the_spot_in_steps():
    w = MoveWriter((-5, 0, TOP))
    for x, z in ((-5, 4), (0, 0), (5, 4)):
        w.feed((x, 0, z), 500)
    w.rapid((5, 0, TOP))
    found = leaning(w.moves(), rules(LeadTilt(), Roof()))
    m = found.moves
    turn = angles_between(m.axis[:-1], m.axis[1:])
    assert turn.max() <= rules().most_turn_rad * 1.001 and turn.sum() == pytest.approx(2 * np.arcsin(0.6), abs=1e-9)
    spot = middles(m)[1:][turn > 1e-9]
    assert np.abs(spot[:, 0]).max() < 0.02


def test_the_limit_counts_what_it_brought_back():
    found = leaning(over_the_hump(0.0).moves(), rules(LeadTilt(limit_deg=20.0)))
    lean = np.degrees(np.arccos(found.moves.axis[:, 2]))
    assert lean.max() == pytest.approx(20.0) and 0.15 < found.is_held[found.is_cut].mean() < 0.5      # the hump leans to 28.6


def test_a_ball_that_rolls_while_its_tip_stands_is_not_hurried():
    """Along the normal of a hump the tip runs slower than the ball's middle: it keeps the middle to its feed."""
    m = leaning(over_the_hump(0.0).moves(), rules(LeadTilt())).moves
    cut = m.feed_mm_per_min[m.kind == Kind.FEED][5:-5]
    assert cut == pytest.approx(np.full(len(cut), 1000 * HUMP / (HUMP + RADIUS)), rel=1e-3)


def test_a_fixed_axis_shifts_every_tip_alike():
    upright = over_the_hump(1.0).moves()
    m = leaning(upright, rules(FixedAxis(direction=(0.6, 0, 0.8)))).moves
    assert len(m) == len(upright) and np.abs(m.end_mm - upright.end_mm - RADIUS * np.array([-0.6, 0, 0.2])).max() < 1e-12
    assert m.feed_mm_per_min == pytest.approx(upright.feed_mm_per_min)


def test_what_cannot_lean_is_refused():
    w = MoveWriter((0, 0, TOP))
    w.rapid((0, 0, TOP - 1))
    with pytest.raises(ToolpathError, match="no move touches the part"):
        leaning(w.moves(), rules())
    w.arc((10, 0, TOP - 1), (5, 0, TOP - 1), Plane.XY, True, 100)
    with pytest.raises(ToolpathError, match="an arc with a turning axis"):
        leaning(w.moves(), rules())


def test_nothing_given_is_changed():
    upright = over_the_hump(0.0).moves()
    before = {f.name: np.array(getattr(upright, f.name)) for f in dataclasses.fields(upright)}
    leaning(upright, rules())
    assert all(np.array_equal(before[name], getattr(upright, name), equal_nan=True) for name in before)


def test_a_hop_at_feed_turns_in_steps_in_its_highest_move():
    """Over the hump and back on the next line, lifted at feed between: the lead turns over by 2 x 10 degrees and the hump's own."""
    there, back = (over_the_hump(y).moves().end_mm[:-1] for y in (0.0, 2.0))
    w = MoveWriter((*there[0, :2], TOP))
    for tip in (*there, there[-1] + (0, 0, 5), back[-1] + (0, 0, 5), *back[::-1]):
        w.feed(tip, 1000)
    w.rapid((*w.here_mm[:2], TOP))
    found = leaning(w.moves(), rules(LeadTilt(lead_deg=10)))
    m = found.moves
    turn = angles_between(np.vstack([m.axis[:1], m.axis[:-1]]), m.axis)
    assert turn.max() <= rules().most_turn_rad * 1.001
    hop = ~found.is_cut & (turn > 1e-9)
    assert np.degrees(turn[hop].sum()) == pytest.approx(20.0, abs=1.0) and hop.sum() >= 8
    assert upright_again(m, RADIUS).end_mm[hop, 2] == pytest.approx(np.full(hop.sum(), there[-1, 2] + 5))
