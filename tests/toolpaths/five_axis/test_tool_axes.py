"""Strategies for the tool's axis against closed forms, at their poles, and as tables of a job file."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from cuspline.planning.strategies.parallel import Parallel
from cuspline.toolpaths.five_axis.tool_axes import (
    REGISTERED,
    AlongLine,
    BetweenGuides,
    ClearingAxis,
    FastestAxis,
    FixedAxis,
    Guide,
    LeadTilt,
    ThroughPoint,
    limited,
)
from cuspline.values.errors import ToolpathError
from cuspline.values.frames import Frame

ROUNDING = 1e-13            # of unit vectors
X, Y, Z = np.eye(3)
EVERY = (LeadTilt(lead_deg=12, tilt_deg=-25), LeadTilt(lead_deg=12, toward=(1, 0.5, 0)),
         FastestAxis(leads_deg=(7,)), FixedAxis(direction=(1, 2, 3)), ThroughPoint(point_mm=(1, -2, -50)),
         AlongLine(point_mm=(1, 2, -30), direction=(1, 0.2, 0.1)),
         BetweenGuides(guides=(Guide(place_mm=(0, 0, 0), direction=(0, 0, 1)), Guide(place_mm=(9, 0, 0), direction=(1, 0, 1)))),
         ClearingAxis(around=LeadTilt(lead_deg=5), up_to_deg=40))


def surface(count=200, seed=3):
    """Places, unit normals and feeds that lie nowhere along them."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return rng.uniform(-10, 10, (count, 3)), normals, np.cross(normals, rng.normal(size=(count, 3))) + 0.3 * normals


def one(strategy, normal=Z, feed=X, place=(0, 0, 0)):
    return strategy.axes([place], [normal], [feed])[0]


def test_lead_is_ahead_and_tilt_is_to_the_right():
    assert one(LeadTilt(lead_deg=30)) == pytest.approx((0.5, 0, math.sqrt(0.75)))
    assert one(LeadTilt(tilt_deg=30)) == pytest.approx((0, -0.5, math.sqrt(0.75)))          # right of +X, seen from +Z
    assert one(LeadTilt(lead_deg=30), feed=-X) == pytest.approx((-0.5, 0, math.sqrt(0.75)))
    assert one(LeadTilt(lead_deg=10, tilt_deg=-5), normal=X, feed=Y) == pytest.approx(
        (math.cos(math.radians(10)) * math.cos(math.radians(5)), math.sin(math.radians(10)) * math.cos(math.radians(5)),
         math.sin(math.radians(5))))


def test_counted_toward_a_direction_passes_back_lean_as_passes_out():
    axis = LeadTilt(lead_deg=30, tilt_deg=20, toward=(0, 2, 0))
    assert one(axis).tolist() == one(axis, feed=-X).tolist()
    assert one(axis) == pytest.approx(one(LeadTilt(lead_deg=30, tilt_deg=20), feed=Y))


@given(st.floats(-89, 89), st.floats(-89, 89))
def test_lead_and_tilt_are_measured_again_on_any_surface(lead, tilt):
    places, n, f = surface(20)
    a = LeadTilt(lead_deg=lead, tilt_deg=tilt).axes(places, n, f)
    ahead = f - (f * n).sum(axis=1)[:, None] * n
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    assert np.abs(np.linalg.norm(a, axis=1) - 1).max() < ROUNDING
    assert (a * np.cross(ahead, n)).sum(axis=1) == pytest.approx(np.full(20, math.sin(math.radians(tilt))), abs=1e-12)
    in_plane = np.degrees(np.arctan2((a * ahead).sum(axis=1), (a * n).sum(axis=1)))
    assert in_plane == pytest.approx(np.full(20, lead), abs=1e-9)


def test_through_a_point_the_axis_line_meets_it():
    places, n, f = surface()
    for holder, sign in (("away", 1), ("towards", -1)):
        a = ThroughPoint(point_mm=(1, 2, -30), holder=holder).axes(places, n, f)
        arm = places - (1, 2, -30)
        assert np.linalg.norm(np.cross(arm, a), axis=1).max() < 1e-12 and (sign * (arm * a).sum(axis=1) > 0).all()


def test_along_a_line_the_axis_line_meets_it_squarely():
    places, n, f = surface()
    line = AlongLine(point_mm=(0, 1, -25), direction=(2, 0, 0))
    a = line.axes(places, n, f)
    arm = places - (0, 1, -25)
    assert np.abs(a[:, 0]).max() < ROUNDING and np.abs(np.cross(arm, a)[:, 0]).max() < 1e-12
    turned_over = line.model_copy(update={"direction": (-1, 0, 0)}).axes(places, n, f)
    assert np.abs(turned_over - a).max() < ROUNDING


def test_between_guides_it_is_each_guides_own_and_half_way_the_mean():
    guides = BetweenGuides(guides=(Guide(place_mm=(0, 0, 0), direction=(0, 0, 2)), Guide(place_mm=(10, 0, 0), direction=(3, 0, 0))))
    a = guides.axes([(0, 0, 0), (10, 0, 0), (5, 3, 0), (1e6, 0, 0)], np.tile(Z, (4, 1)), np.tile(X, (4, 1)))
    half = math.sqrt(0.5)
    assert a == pytest.approx(np.array([Z, X, (half, 0, half), (half, 0, half)]), abs=2e-5)
    one_fifth = one(guides, place=(2, 0, 0))        # weights 1/4 and 1/64
    assert one_fifth[0] / one_fifth[2] == pytest.approx(1 / 16)


@pytest.mark.parametrize("strategy", EVERY, ids=lambda s: s.kind)
def test_it_turns_and_moves_with_the_part(strategy):
    places, n, f = surface()
    s, c = math.sin(0.7), math.cos(0.7)
    frame = Frame(rotation=np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
                  origin_mm=(5, -3, 2))
    seen = strategy.seen_from(frame).axes(frame.into(places), frame.turn_into(n), frame.turn_into(f))
    assert np.abs(frame.turn_out(seen) - strategy.axes(places, n, f)).max() < 1e-12


@pytest.mark.parametrize("strategy", EVERY, ids=lambda s: s.kind)
def test_the_limit_holds_and_touches_nothing_within_it(strategy):
    places, n, f = surface()
    free = strategy.axes(places, n, f)
    held = strategy.model_copy(update={"limit_deg": 40.0}).axes(places, n, f)
    within = free[:, 2] >= math.cos(math.radians(40))
    assert (held[within] == free[within]).all()
    assert held[~within, 2] == pytest.approx(math.cos(math.radians(40))) and np.abs(np.cross(held, free)[:, 2]).max() < 1e-12


@pytest.mark.parametrize("strategy, given_, said", [
    (LeadTilt(lead_deg=5), {"feed": Z}, "lead_tilt: 1 of 1 places have none.* the feed runs along the normal"),
    (ThroughPoint(point_mm=(1, 2, 3)), {"place": (1, 2, 3)}, "these are its point"),
    (AlongLine(point_mm=(0, 0, 0), direction=(0, 0, 1)), {"place": (0, 0, 7)}, "these are on its line"),
    (FixedAxis(direction=(0, 0, -1), limit_deg=30), {}, "the setup's Z turned over"),
    (BetweenGuides(guides=(Guide(place_mm=(1, 0, 0), direction=X), Guide(place_mm=(-1, 0, 0), direction=-X))), {}, "cancel out")])
def test_at_a_pole_it_refuses_by_row(strategy, given_, said):
    with pytest.raises(ToolpathError, match=said) as refused:
        one(strategy, **given_)
    assert refused.value.rows.tolist() == [0]


def test_limited_is_a_doctest_and_keeps_the_azimuth():
    assert limited(np.array([[0.0, -1.0, 0.0]]), math.radians(60))[0] == pytest.approx((0, -math.sqrt(0.75), 0.5))


def test_a_job_file_says_the_same():
    written = {"kind": "lead_tilt", "lead_deg": 10, "limit_deg": 60}
    assert Parallel(tool_axis=written).tool_axis == LeadTilt(lead_deg=10, limit_deg=60)
    assert Parallel(tool_axis=[0, 0, 1]).tool_axis == (0, 0, 1)
    for strategy in EVERY:
        operation = Parallel(tool_axis=strategy)
        again = Parallel.model_validate({k: v for k, v in operation.model_dump(mode="json").items() if k != "kind"})
        assert again == operation and operation.model_dump(mode="json")["tool_axis"]["kind"] == strategy.kind
    assert set(REGISTERED) == {s.kind for s in EVERY}


@pytest.mark.parametrize("table, said", [
    ({"kind": "leed"}, "no tool axis of kind 'leed'; there are along_line, between_guides"),
    ({"kind": "lead_tilt", "lead": 3}, "lead_tilt: lead: there is no such key; did you mean lead_deg"),
    ({"kind": "lead_tilt", "tilt_deg": 95}, "tilt_deg"), ({"kind": "fixed", "direction": [0, 0, 0]}, "without a length"),
    ([0, 1], "tool_axis")])
def test_a_wrong_table_is_refused_by_name(table, said):
    with pytest.raises(ValidationError, match=said):
        Parallel(tool_axis=table)
