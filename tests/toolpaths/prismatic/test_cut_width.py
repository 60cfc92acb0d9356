"""How wide a cut in hollows and round corners is: closed forms, and the area that a disc sweeps off a ring, counted."""

import math

import numpy as np
import pytest

from cuspline.toolpaths.prismatic.contour_moves import ring
from cuspline.toolpaths.prismatic.cut_width import widest_cut_mm
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, PlanElement

CUTTER_R, LEFT = 1.19, 0.3


def slot(half_length, radius):
    """Way of a cutter's middle round a slot with round ends, anticlockwise."""
    a, b = half_length, radius
    return PlanChain(is_closed=True, elements=(
        PlanElement(start=(-a, -b), end=(a, -b)), PlanElement(start=(a, -b), end=(a, b), center=(a, 0), is_left=True),
        PlanElement(start=(a, b), end=(-a, b)), PlanElement(start=(-a, b), end=(-a, -b), center=(-a, 0), is_left=True)))


def test_round_a_hole_the_cut_is_the_ring_over_the_way():
    for path_r in (0.05, 0.4, 5.0, 400.0):
        path, wall = PlanChain(elements=ring((3.0, 4.0), path_r), is_closed=True), path_r + CUTTER_R
        wide = widest_cut_mm(path, CUTTER_R, LEFT, CUTTER_R)
        assert wide == pytest.approx((wall**2 - (wall - LEFT)**2) / (2 * path_r), rel=1e-12)
    assert wide == pytest.approx(LEFT, rel=4e-3)


def test_round_a_stud_it_is_less():
    right = PlanChain(elements=ring((0.0, 0.0), 5.0), is_closed=True).reversed()
    stud = 5.0 - CUTTER_R
    assert widest_cut_mm(right, CUTTER_R, LEFT, CUTTER_R) == pytest.approx(((stud + LEFT)**2 - stud**2) / 10.0, rel=1e-12)


@pytest.mark.parametrize("path_r", [0.1, 0.4, 3.0])
def test_in_the_end_of_a_slot_it_is_what_a_disc_sweeps_off(path_r):
    """Counted: the nodes of the ring that the cutter first covers on the half diameter of way about the end's middle."""
    path, wall = slot(6.0, path_r), path_r + CUTTER_R
    grid = np.stack(np.meshgrid(np.arange(4.0, 6.0 + wall, 0.01), np.arange(-wall, wall, 0.01)), -1).reshape(-1, 2)
    aside = np.where(grid[:, 0] > 6.0, np.hypot(grid[:, 0] - 6.0, grid[:, 1]), abs(grid[:, 1]))
    stands = grid[(aside < wall) & (aside > wall - LEFT)]
    end, way = math.pi * path_r, np.linspace(0.0, 12.0 + math.pi * path_r + 2.0, 3000)
    middle = np.array([element.at(along) for element, along in map(path.place, way)])
    near = np.linalg.norm(stands[:, None] - middle[None, ::4], axis=-1) < CUTTER_R
    first = np.where(near.any(axis=1), way[::4][near.argmax(axis=1)], np.inf)
    widest = max(np.count_nonzero((first >= s) & (first < s + CUTTER_R)) for s in np.arange(10.0, 12.0 + end, 0.02))
    assert widest_cut_mm(path, CUTTER_R, LEFT, CUTTER_R) == pytest.approx(widest * 1e-4 / CUTTER_R, rel=0.12)


def test_a_line_takes_the_ring_s_thickness_and_an_open_way_does_not_close():
    line = PlanElement(start=(0, 0), end=(9, 0))
    bend = PlanElement(start=(9, 0), end=(9, 2), center=(9, 1), is_left=True)
    assert widest_cut_mm(PlanChain(elements=(line,), is_closed=False), CUTTER_R, LEFT, 2.0) == pytest.approx(LEFT, rel=1e-12)
    at_end = widest_cut_mm(PlanChain(elements=(line, bend), is_closed=False), CUTTER_R, LEFT, 8.0)
    hollow = math.pi * ((1 + CUTTER_R)**2 - (1 + CUTTER_R - LEFT)**2) / 2
    assert at_end == pytest.approx((hollow + LEFT * (8.0 - math.pi)) / 8.0, rel=1e-12)
