"""Amounts are true depths: the nearest way out of the part, or into it, and no cap without a word."""

from types import SimpleNamespace

import cadquery as cq
import numpy as np
import pytest
from known_programs import feed, program, rapid, raster, tool

from cuspline.design import Finish, Setup, StockBox
from cuspline.kernel import brep
from cuspline.stock.swept import signed_distance_mm, swept_paths
from cuspline.surfaces.projection import ClosestTree
from cuspline.verification import true_depths
from cuspline.verification.verdict import Options, verify_setup

BLOCK = brep.the_solid(cq.Workplane().box(20, 16, 10, centered=False))
TOP = [f for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > 0.5]
SETUP = Setup(name="setup-1", wcs_in_words="corner", faces=("top",))
FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
COARSE = Options(spacing_mm=0.6, solid_pitch_mm=0.4, replay_pitch_mm=0.5, tessellation_mm=0.002)
ZOOMS, BRUTE_MM = 6, 0.005     # of the brute force's grids; how near it and the search come to a corner
FLAT = tool("flat", 10, number=2)


def passes(z):
    return [rapid(-6, -0.3, 14), *raster((-6, 26), np.arange(-0.3, 16.7, 0.6), z), rapid(26, 16, 14)]


def verdict(moves, tools=None, stock=12.0, **changes):
    return verify_setup(program((-6, -0.3, 40), moves, **changes), tools or {1: tool("ball", 10)}, BLOCK, TOP, setup=SETUP,
                        stock=StockBox(min_mm=(0, 0, 0), max_mm=(20, 16, stock)), finish=FINISH, ball_radius_mm=3.0,
                        options=COARSE)


def two_tools(moves, more):
    """The plane's passes with the ball, then more moves with the flat cutter."""
    both = [*moves, rapid(26, 16, 40), *more]
    return both, np.repeat([1, 2], [len(moves) + 1, len(more)])


def brute_depth_mm(moves, tools, numbers, low, high):
    """Deepest place of the block within a box that a program sweeps: grids, finer round the best place, closed-form faces."""
    paths, low, high = swept_paths(program((-6, -0.3, 40), moves, tool=numbers), tools), np.array(low, float), np.array(high, float)
    for _ in range(ZOOMS):
        axes = [np.linspace(a, b, 41) for a, b in zip(low, high)]
        p = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        out = np.minimum(np.min(p, axis=1), np.min(np.array([20, 16, 10]) - p, axis=1))
        out = np.where(signed_distance_mm(paths, p) < 0, out, 0.0)
        best, step = p[out.argmax()], (high - low) / 5
        low, high = best - step, best + step
    return out.max()


@pytest.mark.parametrize("over_mm,deep_mm,true_mm", [(1.16, 1.81, 1.16), (1.81, 1.16, 1.16), (0.4, 3.0, 0.4), (3.2, 2.7, 2.7)])
def test_a_gouge_along_an_edge_is_as_deep_as_the_nearest_way_out(over_mm, deep_mm, true_mm):
    """A flat cutter runs along the block's side, so far over it and so deep: top and side are equally near ways out."""
    x = 20 + 5 - over_mm
    moves, numbers = two_tools(passes(10.0), [rapid(x, -10, 40), feed(x, -10, 10 - deep_mm), feed(x, 30, 10 - deep_mm)])
    tools = {1: tool("ball", 10), 2: FLAT}
    v = verdict(moves, tools=tools, tool=numbers)
    (found,) = [f for f in v.findings if f.kind == "gouge"]
    brute = brute_depth_mm(moves, tools, numbers, (15, 8, 6), (20, 9, 10))
    assert found.amount_mm == pytest.approx(true_mm, abs=1e-4) and abs(found.amount_mm - brute) < 2 * BRUTE_MM
    assert not found.is_at_least and v.as_dict()["gouge_max_mm"] == pytest.approx(found.amount_mm)
    assert v.as_dict()["at_least"] == []


def test_stock_left_far_above_is_told_whole_not_to_the_cap():
    """Nothing is cut: 5 mm stand over the plane, and the answer is no 2.0."""
    v = verdict([rapid(-6, 0, 14), feed(-6, 0, 13.9)], stock=15.0)
    (found,) = [f for f in v.findings if f.kind == "missing_area"]
    assert found.amount_mm == pytest.approx(5.0, abs=1e-4) and "5.000 mm left" in found.advice
    assert v.as_dict()["excess_max_mm"] == pytest.approx(5.0, abs=1e-4)


def test_more_samples_than_are_asked_say_at_least(monkeypatch):
    monkeypatch.setattr("cuspline.verification.true_depths.MOST", 64)
    monkeypatch.setattr("cuspline.verification.true_depths.BATCH", 32)
    v = verdict([rapid(-6, 0, 14), feed(-6, 0, 13.9)], stock=15.0)
    (found,) = [f for f in v.findings if f.kind == "missing_area"]
    assert found.is_at_least and "at least 5.000 mm" in found.advice and v.as_dict()["at_least"] == ["excess_max_mm"]


@pytest.mark.parametrize("seed", range(4))
def test_a_round_gouge_in_a_corner_agrees_with_brute_force(seed):
    """A ball put down beside the block's corner."""
    rng = np.random.default_rng(seed)
    tip = np.array([20.0, 16.0, 10.0]) + rng.uniform((-2.0, -2.0, -3.0), (2.5, 2.5, -0.5))
    moves, numbers = two_tools(passes(10.0), [rapid(*tip[:2], 40), feed(*tip), rapid(*tip[:2], 40)])
    tools = {1: tool("ball", 10), 2: tool("ball", 6, number=2)}
    found = [f.amount_mm for f in verdict(moves, tools=tools, tool=numbers).findings if f.kind == "gouge"]
    brute = brute_depth_mm(moves, tools, numbers, (14, 10, 4), (20, 16, 10))
    assert max(found, default=0.0) == pytest.approx(brute, abs=2 * BRUTE_MM)


def test_rays_that_cannot_be_among_the_best_are_not_followed_and_change_nothing(monkeypatch):
    """Rays into the block and out of it: the best are those of a search that looks everywhere, place and amount to the bit."""
    rng, tree, asked = np.random.default_rng(3), ClosestTree.of_faces(brep.faces_of(BLOCK)), []
    points, ways = rng.uniform((0, 0, 9), (20, 16, 11), (60, 3)), rng.normal(size=(60, 3)) * (1, 1, 3)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    length = rng.uniform(0.1, 6.0, 60)
    closest = SimpleNamespace(signed_distances_mm=lambda p: asked.append(len(p)) or tree.signed_distances_mm(p))
    for sign in (1.0, -1.0):
        found, count = true_depths._along(points, ways, length, sign, closest, [0.5]), sum(asked)
        with monkeypatch.context() as everywhere:
            everywhere.setattr(true_depths, "_least_of_best", lambda known, top: -np.inf)
            whole = true_depths._along(points, ways, length, sign, closest, [])
        best = np.argsort(-whole[0], kind="stable")[:true_depths.STARTS]
        assert [f[best].tolist() for f in found] == [w[best].tolist() for w in whole]
        assert np.argsort(-found[0], kind="stable")[:true_depths.STARTS].tolist() == best.tolist()
        assert count < 0.5 * (sum(asked) - count)
        asked.clear()


def test_of_many_gouges_some_are_searched_and_the_others_say_at_least(monkeypatch):
    """Six dents of a ball, 0.2 to 0.7 mm deep: one is followed to the last, and the deepest of all is."""
    monkeypatch.setattr("cuspline.verification.verdict.SEARCHED", 1)
    deep = {float(x): 0.2 + 0.1 * k for k, x in enumerate(np.linspace(2.0, 18.0, 6))}
    dents = [m for x, d in deep.items() for m in (rapid(x, 8.0, 40), feed(x, 8.0, 10 - d), rapid(x, 8.0, 40))]
    moves, numbers = two_tools(passes(10.0), dents)
    v = verdict(moves, tools={1: tool("ball", 10), 2: tool("ball", 1, number=2)}, tool=numbers)
    found = [f for f in v.findings if f.kind == "gouge"]
    assert len(found) == 6 and sum(f.is_at_least for f in found) == 5
    for f in found:
        true_mm = deep[min(deep, key=lambda x: abs(x - f.place_mm[0]))]
        assert 0.8 * true_mm < f.amount_mm < true_mm + 1e-4
        assert f.is_at_least or f.amount_mm == pytest.approx(true_mm, abs=1e-4)
    numbers = v.as_dict()
    assert numbers["gouge_max_mm"] == pytest.approx(0.7, abs=1e-4) and numbers["at_least"] == []
