"""Offsets of lines and arcs in plan against closed forms and against brute force."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cuspline.toolpaths.prismatic.contour_moves import arc_leads, ring
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, PlanElement, chains_of, offset_chain
from cuspline.values.errors import CutterDoesNotFit


def polygon(*corners, bends=()):
    """Elements round corners, material on their right where these run clockwise; `bends`: {side: (center, is_left)}."""
    bends = dict(bends)
    return [PlanElement(start=a, end=b, center=bends.get(k, (None, False))[0], is_left=bends.get(k, (None, False))[1])
            for k, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1]))]


SQUARE = polygon((0, 0), (0, 10), (10, 10), (10, 0))
BAY = polygon((0, 0), (0, 30), (8, 30), (22, 30), (30, 30), (30, 0), bends={2: ((15, 30), True)})     # a half round bay of 14
STAR = polygon((0, 0), (0, 40), (12, 24), (25, 40), (40, 40), (40, 20), (40, 0), bends={5: ((40, 10), False)})
HOUSE = polygon((0, 0), (30, 0), (30, 20), (0, 20))         # run anticlockwise: a pocket


def test_round_a_square_the_path_is_its_sides_and_one_full_turn():
    path = offset_chain(chains_of(SQUARE)[0], 3.0)
    assert path.is_closed and path.length_mm == pytest.approx(40 + 6 * math.pi, abs=1e-12)


def test_in_a_pocket_the_path_is_the_smaller_pocket():
    path = offset_chain(chains_of(HOUSE)[0], 4.0)
    assert path.length_mm == pytest.approx(2 * (22 + 12), abs=1e-12) and len(path.elements) == 4


@pytest.mark.parametrize("elements, away", [(BAY, 5.0), (STAR, 2.5), (SQUARE, 8.0), (HOUSE, 9.0)])
def test_every_place_of_the_path_keeps_the_distance(elements, away):
    chain, = chains_of(elements)
    path = offset_chain(chain, away)
    wall, places = chain.places(0.01), path.places(0.5)
    distance, _ = cKDTree(wall).query(places)
    np.testing.assert_allclose(distance, away, atol=1e-5)
    joints = [(a.end, b.start) for a, b in zip(path.elements, (*path.elements[1:], path.elements[0]))]
    assert max(np.abs(a - b).max() for a, b in joints) == 0.0


@pytest.mark.parametrize("elements, away, why", [(BAY, 7.5, "rounded by 7.000 mm"), (HOUSE, 11.0, "wall")])
def test_a_cutter_too_large_is_refused_with_the_place(elements, away, why):
    with pytest.raises(CutterDoesNotFit, match=why):
        offset_chain(chains_of(elements)[0], away)


def test_chains_are_found_in_any_order_closed_and_open():
    without_bay = [BAY[k] for k in (3, 0, 5, 4, 1)]
    found = [(c.is_closed, len(c.elements)) for c in chains_of(without_bay)]
    assert found == [(False, 5)]
    assert [(c.is_closed, len(c.elements)) for c in chains_of(SQUARE[2:] + SQUARE[:2])] == [(True, 4)]


def test_leads_touch_the_path_and_keep_to_its_left():
    path = PlanChain(elements=ring((0, 0), 20.0), is_closed=True)
    first = path.elements[0]
    leads = arc_leads((first, 0.0), (first, 0.0), 4.0, 4.0)
    arc = leads.way_in[0]
    np.testing.assert_allclose(arc.heading(arc.length_mm), first.heading(0.0), atol=1e-12)
    assert np.hypot(*leads.begin) < 20.0 and np.hypot(*leads.end) < 20.0 and arc.radius_mm == 4.0
    assert arc_leads((ring((0, 0), 3.0)[0], 0.0), (first, 0.0), 4.0, 4.0).way_in[0].radius_mm == pytest.approx(1.5)


def test_a_closed_chain_begun_elsewhere_is_the_same_way():
    path = offset_chain(chains_of(STAR)[0], 2.0)
    again = path.begun_at(0.37 * path.length_mm)
    assert again.length_mm == pytest.approx(path.length_mm, abs=1e-9) and again.is_closed
    np.testing.assert_allclose(again.elements[0].start, again.elements[-1].end, atol=1e-9)
