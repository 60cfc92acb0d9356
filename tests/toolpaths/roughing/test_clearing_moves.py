"""Which way between two passes is taken: on the level, or up, across and down."""

from types import SimpleNamespace

import numpy as np
import pytest

from cuspline.toolpaths.roughing.clearing_moves import APPROACH_MM, ClearingWriter

FEED, RAMP, RAPID, CLEAR, LEVEL = 2000.0, 600.0, 10_000.0, 20.0, 10.0


def writer(lift_s):
    return ClearingWriter(SimpleNamespace(feed_mm_per_min=FEED, ramp_feed_mm_per_min=RAMP, rapid_mm_per_min=RAPID,
                                          clearance_z_mm=CLEAR, lift_s=lift_s))


@pytest.mark.parametrize("lift_s", [0.0, 0.3])
def test_a_way_on_the_level_is_kept_until_it_takes_longer_than_the_lift_with_its_starts_and_stops(lift_s):
    lift = 2 * (CLEAR - LEVEL) / RAPID + APPROACH_MM / RAMP + lift_s / 60
    even_mm = lift / (1 / FEED - 1 / RAPID)             # straight ways as long as this take the same either way
    for way_mm, is_far in ((0.99 * even_mm, False), (1.01 * even_mm, True)):
        assert writer(lift_s).is_far(np.array([(0.0, 0.0), (way_mm, 0.0)]), LEVEL) == is_far
    assert writer(lift_s).longest_way_mm(LEVEL) == pytest.approx(even_mm)
