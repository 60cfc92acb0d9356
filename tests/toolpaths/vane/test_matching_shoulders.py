"""What one arc cannot do in the matching section, as docs/decisions/compact.md tells it."""

import numpy as np
from known_vanes import tip_of

from cuspline.toolpaths.vane.cutter_surface import cut_map


def test_at_slope_3_a_6_mm_ball_leaves_up_to_half_a_millimetre_on_the_shoulders_and_gouges_nothing():
    found = cut_map(tip_of(lambda x: 30.0 + 3 * x), 3.0, 3.0, 0.05)
    middle = found.deviation_mm[len(found.deviation_mm) // 2]       # far from the ends of the tip line
    assert np.abs(middle[[0, -1]]).max() < 1e-9                     # crest and flank are true
    assert middle.min() > -1e-9 and 0.4 < middle.max() < 0.5
