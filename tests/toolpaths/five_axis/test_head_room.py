"""A fork or a ram over a part in an indexed position: never told free where it is not, and free where there is room."""

import numpy as np
import pytest

from cuspline.stock.shapes import BoxShape
from cuspline.toolpaths.five_axis.head_room import PITCH_MM, HeadRoom
from cuspline.values.frames import Frame

KEEP_MM = 1.5
SLAB = BoxShape(min_mm=(-100.0, -60.0, 200.0), max_mm=(100.0, 60.0, 240.0)).mesh     # hangs 200 over the gauge line
TOWER = BoxShape(min_mm=(0.0, 0.0, 0.0), max_mm=(40.0, 40.0, 300.0)).mesh
ROUGH_MM = 4 * PITCH_MM     # beside the tower, within which nothing is promised


def room(way):
    """Both as they lie in a frame along `way`, and that frame."""
    frame = Frame.along(np.array(way) / np.linalg.norm(way))
    out = lambda mesh: (frame.out(mesh[0]), mesh[1])
    return HeadRoom(frame.rotation[:, 2], out(TOWER), out(SLAB), KEEP_MM), frame


@pytest.mark.parametrize("way", [(0, 0, 1), (1, 2, 3), (-1, 0.2, 0)])
def test_a_slab_over_a_tower_is_free_above_it_and_beside_it(way):
    found, frame = room(way)
    free = lambda *gauge: found.is_free(frame.out(np.array([gauge], float)))
    assert free(20, 20, 100 + KEEP_MM + 0.01) and not free(20, 20, 100 + KEEP_MM - 0.01)
    for side in (-100 - ROUGH_MM, 140 + ROUGH_MM):
        assert free(side, 20, 0) and not free(np.clip(side, -100 - KEEP_MM / 2, 140 + KEEP_MM / 2), 20, 0)
    assert free(20, 100 + ROUGH_MM, -500) and not free(20, 100 + KEEP_MM / 2, -500)


def test_what_is_told_free_is_free_at_every_place():
    """Seeded places of the gauge point; boxes square to the tool keep clear in closed form."""
    found, frame = room((2, -1, 2))
    rng = np.random.default_rng(1)
    places = rng.uniform((-180, -140, 50), (220, 180, 150), (2000, 3))
    beside = np.maximum(np.abs(places[:, :2] - 20) - (20 + 100, 20 + 60), 0.0)      # of the slab from the tower, in plan
    is_free = (np.sqrt((beside ** 2).sum(axis=1)) >= KEEP_MM) & (beside.max(axis=1) > 0) | (places[:, 2] >= 100 + KEEP_MM)
    told = np.array([found.is_free(frame.out(p[None])) for p in places])
    assert not (told & ~is_free).any()
    rough = beside.max(axis=1) < ROUGH_MM
    assert (told | rough | ~is_free).all() and 200 < told.sum() < 1800
    assert found.is_free(frame.out(places[told])) and not found.is_free(frame.out(places))
