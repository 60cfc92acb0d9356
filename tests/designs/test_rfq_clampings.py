"""A vane longer than the bed: as few clampings as reach it, faces that end where they do, a joint between each two."""

import numpy as np
import pytest

from cuspline.app.catalogue import find_design, make_design
from cuspline.designs.rfq.setups import clampings, predicates, splits
from cuspline.kernel import brep
from cuspline.values.errors import DesignError


@pytest.mark.parametrize("length, travel, overlap", [(1310.0, 500.0, 10.0), (1310.0, 660.0, 10.0), (90.0, 50.0, 10.0)])
def test_clampings_reach_everything_and_overlap(length, travel, overlap):
    spans = clampings(13.0, 13.0 + length, travel, overlap)
    assert spans[0][0] == 13.0 and spans[-1][1] == 13.0 + length
    assert all(b - a <= travel + 1e-9 for a, b in spans)
    assert [b[0] for b in spans[1:]] == pytest.approx([a[1] - overlap for a in spans[:-1]])
    fewer = len(spans) - 1
    assert fewer * travel - (fewer - 1) * overlap < length


def test_a_vane_that_the_bed_reaches_has_one_clamping():
    assert clampings(0.0, 500.0, 500.0, 10.0) == [(0.0, 500.0)]


def test_clampings_that_gain_nothing_are_refused():
    with pytest.raises(DesignError, match="twice overlap_mm"):
        clampings(0.0, 500.0, 40.0, 20.0)
    with pytest.raises(DesignError, match="7 setups of 100 mm, and there are 6 work offsets"):
        clampings(0.0, 640.0, 100.0, 10.0)


def test_faces_end_where_clampings_do():
    assert splits([10.0, 20.0, 29.5, 40.0], [(0.0, 30.0), (25.0, 60.0)]) == [10.0, 20.0, 25.0, 30.0, 40.0]


def test_each_clamping_cuts_its_faces_and_neighbours_share_the_overlap():
    made = make_design(find_design("rfq_vane"), ["from_mm=300", "to_mm=420", "bed_travel_mm=70", "overlap_mm=8"])
    faces = brep.faces_of(brep.the_solid(made.solid, "vane"))
    chosen = [brep.select_faces(faces, p) for p in made.predicates]
    assert len(made.setups) == len(chosen) == 2
    for setup, mine in zip(made.setups, chosen):
        boxes = [brep.bounding_box_mm(f.shape) for f in mine]
        first, last = min(low[0] for low, _ in boxes), max(high[0] for _, high in boxes)
        assert first == pytest.approx(setup.wcs_origin_mm[0], abs=1e-6)
        assert last - first == pytest.approx(64.0, abs=1e-3) and len(setup.markers) == 4
        assert np.ptp([m.at_mm[0] for m in setup.markers]) == pytest.approx(0.8 * 64, abs=1e-3)
    shared = [f for f in chosen[0] if any(f is g for g in chosen[1])]
    assert len(shared) == 3                                         # tip and two flanks of the overlap
    tip = [f for p in predicates([(0.0, 1e4)]) for f in brep.select_faces(faces, p)]
    assert len(tip) == len(chosen[0]) + len(chosen[1]) - 3
