"""Chatter, cutting speed, tool life: the sources' numbers, and that a program's deepest place is found."""

import numpy as np
import pytest
from known_programs import feed, program, rapid, tool

from cuspline.app import catalogue
from cuspline.process.chatter import best_speeds, depths_at, least_real_mm_per_n, limit_depth_mm, limits_mm, stability_lobes
from cuspline.process.cut_of_operations import edge_changes
from cuspline.process.cutting_speed import contact_radius_mm, effective_radius_mm, followed_rpm, rpm_for_speed
from cuspline.process.engagement import Look, engagement
from cuspline.process.tool_life import change_points, edges_needed, machining_time_h
from cuspline.replay.scene import FoundStock
from cuspline.shop.cutters import Chatter
from cuspline.shop.cutting_forces import known_forces
from cuspline.shop.tool_lives import known_lives
from cuspline.values.errors import InputError
from cuspline.values.frames import Frame
from cuspline.verification.process_findings import chatter_findings

H13 = known_forces()["steel_h13_48hrc"]
HOME = ("setup-1", Frame.shift((0.0, 0.0, 0.0)))


def yielding(limit_mm, **ball):
    """A ball whose limit in H13 is that."""
    plain = tool("ball", **ball)
    direction = np.cos(np.radians(70))
    least = -1 / (2 * plain.cutter.flutes / 2 * 4000 * direction * limit_mm)
    return plain.model_copy(update={"chatter": Chatter(least_real_mm_per_n=least)})


def test_the_limits_of_the_source():
    assert limit_depth_mm(-9.127e-5, 4000, 0.342, 0.5) == pytest.approx(8.009, abs=5e-4)
    assert limit_depth_mm(-9.037e-3, 4000, 0.342, 1.0) == pytest.approx(0.04044, abs=5e-6)
    assert limits_mm({1: yielding(3.5, diameter=8), 2: tool("ball", 8)}, H13) == pytest.approx({1: 3.5})
    assert limits_mm({1: yielding(3.5, diameter=8)}, None) == {}


def test_modes_add_up():
    stiffness, damping = 2e4, 0.03
    one = -1 / (4 * stiffness * damping * (1 + damping))
    assert least_real_mm_per_n([(900.0, stiffness, damping)]) == pytest.approx(one, rel=1e-3)
    assert least_real_mm_per_n([(900.0, stiffness, damping), (900.0, stiffness, damping)]) == pytest.approx(2 * one, rel=1e-3)
    with pytest.raises(ValueError, match="either least_real_mm_per_n or modes"):
        Chatter()


def test_exactly_the_transition_from_plane_to_slope_is_found_with_its_line():
    """Limit 3.5: plane 1.0, slope 3.39, the corner between them 5.9."""
    r, slope = 4.0, np.radians(68)
    low, high = (-20.0, -15.0, -10.0), (20.0, 15.0, 60.0)
    zmap = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.25).zmap
    surface = np.maximum(1.0, np.tan(slope) * (zmap.xy_mm[:, 0] - r * np.tan(slope / 2)) + 1 / np.cos(slope))
    stock = FoundStock(min_mm=low, max_mm=high, pitch_mm=0.25, top_mm=surface.reshape(zmap.shape).clip(-10, 60))
    foot, up = np.array([0.0, 0, 0]), np.array([np.cos(slope), 0, np.sin(slope)])
    moves = [feed(-12, 0, 0), feed(*foot), feed(*(foot + 6 * up)), feed(*(foot + 12 * up))]
    ball = yielding(3.5, diameter=8, flute=20)
    posted = program((-30, 0, 0), moves, operation=np.array([0, 1, 2, 3]), operations=("plane", "corner", "foot", "slope"))
    met = engagement(posted, {1: ball}, stock, Look.finer(2))
    found, document = chatter_findings(posted, {1: ball}, met, H13, HOME)
    assert {f.operation for f in found} <= {"corner", "foot"} and found[0].line == 11
    assert found[0].kind == "chatter" and found[0].amount_mm == pytest.approx(5.892, abs=0.08)
    assert document["limit_mm"] == {"T1": pytest.approx(3.5)} and "not_checked" not in document
    assert chatter_findings(posted, {1: tool("ball", 8, flute=20)}, met, H13, HOME) == ((), {"limit_mm": {}, "not_checked": ["T1"]})


def test_the_spindle_speed_of_a_constant_cutting_speed():
    spindle = catalogue.find_machine("mill_3axis").spindle.model_copy(update={"max_rpm": 20000})
    radii = [effective_radius_mm(5.0, 1.0), contact_radius_mm(5.0, np.radians(45)), effective_radius_mm(5.0, 7.0)]
    assert rpm_for_speed(150, np.array(radii, float), spindle) == pytest.approx([7958, 6752, 4775], abs=1)
    assert rpm_for_speed(150, 0.1, spindle) == 20000
    followed = followed_rpm([5000, 8000, 8000, 4000], [0.0, 0.1, 0.1, 0.1], 10_000)
    assert followed.tolist() == [5000, 6000, 5000, 4000]


def test_lives_and_sets_of_edges():
    lives = [known_lives()[name] for name in ("steel_17_4ph", "titanium_6al4v", "inconel_718")]
    hours = [machining_time_h(1.0, t.time_factor) for t in lives]
    assert hours == [5, 7, 10] and [edges_needed(60 * h, t.life_min) for h, t in zip(hours, lives)] == [1, 2, 15]
    assert change_points([10, 10, 10, 15, 5], 25) == [2, 4] and change_points([], 5) == []
    with pytest.raises(InputError, match="stretch 2 takes 30.0 minutes"):
        change_points([1, 30], 25)


def test_edges_are_changed_before_a_stretch_that_would_outlive_them():
    stock = FoundStock(min_mm=(-30, -30, -20), max_mm=(30, 30, 0), pitch_mm=1.0)
    moves = [step for y in (-20, -10, 0, 10) for step in (rapid(-40, y, 5), rapid(-40, y, -1), feed(40, y, -1), rapid(40, y, 5))]
    posted = program((-40, -20, 5), moves, feed_mm_per_min=np.where([m[0] == 0 for m in moves], 0.0, 1.0))
    found = engagement(posted, {1: tool("ball", 10)}, stock)
    life = known_lives()["inconel_718"].model_copy(update={"life_min": 130.0})
    edges = edge_changes(posted, found, life)["T1"]
    assert edges["minutes_in_cut"] == pytest.approx(240, rel=0.1) and edges["sets_of_edges"] == 2
    assert edges["change_before_lines"] == [posted.line[10]]
    assert edge_changes(posted, found, None).startswith("not checked")
    assert "stretch 1" in edge_changes(posted, found, life.model_copy(update={"life_min": 10.0}))["T1"]["too_long"]


def test_lobes_stand_on_the_limit_and_open_where_teeth_strike_with_the_mode():
    mode = (800.0, 2e4, 0.03)
    shaken = tool("ball", 10).model_copy(update={"chatter": Chatter(modes=(mode,))})
    always, spindle = limits_mm({1: shaken}, H13)[1], catalogue.find_machine("mill_3axis").spindle
    lobes = stability_lobes([mode], 2, lambda real: limit_depth_mm(real, 4000, np.cos(np.radians(70)), 1.0))
    depth = depths_at(lobes, np.linspace(2000, 18000, 800))
    assert depth.min() == pytest.approx(always, rel=0.01) and (depth > 0.999 * always).all()
    found = best_speeds(shaken, H13, spindle)
    assert found[0][0] == pytest.approx(60 * 800 / 2 / 2, rel=0.04) and found[0][1] > 3 * always    # 24,000 is beyond the spindle
    assert found[1][0] == pytest.approx(60 * 800 / 2 / 3, rel=0.04) or abs(found[1][0] / found[0][0] - 1) > 0.04


def test_a_lobe_is_where_the_regenerated_wave_neither_grows_nor_dies():
    """Closed form of one mode: on the border b, 1 + 2 b n_a K mu G (1 - e^(-i w T)) = 0 at the chatter frequency."""
    own, stiffness, damping = 800.0, 2e4, 0.03
    lobes = stability_lobes([(own, stiffness, damping)], 2, lambda real: -1 / (2 * real))
    frequency = np.sort(np.concatenate([np.linspace(own / 2, 2 * own, 400), own * (1 + np.linspace(0, 6 * damping, 200))]))
    r = frequency / own
    g = 1 / stiffness / (1 - r * r + 2j * damping * r)
    for k in (0, 3):
        rows = np.flatnonzero(np.isfinite(lobes[k, :, 1]))[::40]
        delay = 60 / lobes[k, rows, 0] / 2
        left = 1 + lobes[k, rows, 1] * g[rows] * (1 - np.exp(-2j * np.pi * frequency[rows] * delay))
        assert np.abs(left).max() < 1e-6
