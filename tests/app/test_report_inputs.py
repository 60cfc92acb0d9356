"""What the report's path is coloured by; what the setup sheet says of markers and rotary axes."""

from types import SimpleNamespace

import numpy as np
import pytest
from known_programs import feed, program, rapid

from cuspline.app.catalogue import find_machine
from cuspline.app.report_inputs import _elsewhere, _rotaries, _view_deviation, met_on_moves
from cuspline.design import Marker, Setup


def test_a_move_takes_the_most_of_its_own_places_else_those_of_the_nearest_of_its_operation():
    rng = np.random.default_rng(3)
    moves = [rapid(k, 0, 0) if k % 7 == 0 else feed(k, 0, 0) for k in range(60)]
    operation = np.repeat([0, 1, 2], 20)
    posted = program((0, 0, 5), moves, operation=operation, operations=("a", "b", "c"))
    rows = rng.choice([k for k in range(40) if k % 7], 25)          # nothing of the last operation is looked at
    depth = rng.uniform(0, 3, 25)
    found = met_on_moves(posted, {"row": rows, "depth_mm": depth})["depth_mm"]
    for k in range(60):
        mine = [j for j in rows if operation[j] == operation[k]]
        if k % 7 == 0 or not mine:
            assert np.isnan(found[k])
            continue
        away = min(abs(j - k) for j in mine)
        assert found[k] in [depth[rows == j].max() for j in mine if abs(j - k) == away]
    assert met_on_moves(posted, {}) == {}


def test_the_view_takes_the_worst_nearby_but_of_what_weighs_nothing_and_nothing_reaches():
    """Along a wall's normal the very foot of it, beside a film on the floor, stands 2 mm out; what a cutter left does count."""
    samples = SimpleNamespace(points_mm=np.array([(0, 0, 0), (0.5, 0, 0), (5, 0, 0), (5.5, 0, 0), (20, 0, 0.0)]),
                              weight_mm2=np.array([0, 0.2, 0.2, 0, 0.0]))
    looked = SimpleNamespace(samples=samples, deviation_mm=np.array([2.0, 0.005, -0.004, 0.003, 1.0]),
                             is_reachable=np.array([False, True, False, True, False]))
    judged = SimpleNamespace(verdict=SimpleNamespace(setups=[SimpleNamespace(residuals=looked)]))
    view = SimpleNamespace(vertices_mm=np.array([(0.1, 0, 0), (5.2, 0, 0), (20, 0, 0), (0.1, 0, 0.0)]),
                           face_index=np.array([3, 3, 3, 4]))
    np.testing.assert_array_equal(_view_deviation(judged, view, [3]), [0.005, -0.004, np.nan, np.nan])


def turned_over(name, z, **changes):
    """A clamping with its zero 30 mm up the part's X, Z along X or against it."""
    return Setup(**{"name": name, "faces": ("a",), "wcs_in_words": "", "indexed": True, "clamped_x": (0.0, 0.0, 1.0),
                    "clamped_z": (z, 0.0, 0.0), "wcs_origin_mm": (30.0, 0.0, 0.0), "wcs_x": (0.0, 1.0, 0.0),
                    "wcs_z": (0.0, 0.0, 1.0), **changes})


def test_markers_are_stated_in_both_clampings():
    """Cut in the first, touched once the part is turned over: the sheets of both say where they are in the other."""
    marker = Marker(name="m", at_mm=(35.0, 2.0, 3.0))
    setups = [turned_over("back", -1.0), turned_over("face", 1.0, markers=(marker,))]
    assert _elsewhere(0, setups) == {"m": ("face", (3.0, -2.0, 5.0))}
    assert _elsewhere(1, setups) == {"m": ("back", (3.0, 2.0, -5.0))}


def test_the_axes_that_carry_the_part_are_where_the_machine_has_them():
    """A and B of the mill for propellers meet in the zero; one that is off by 0.05 mm passes beside it."""
    mill, held = find_machine("mill_a_on_b"), turned_over("back", 1.0)
    off = mill.model_copy(update={"b": mill.b.model_copy(update={"offset_mm": (0.05, 0.0, 0.0)})})
    posted = program((0, 0, 5), [rapid(1, 0, 0)])
    posted = type(posted)(**{**vars(posted), "rotary_deg": np.array([[-30.0, 12.5]])})
    for machine, beside in ((mill, 0.0), (off, 0.05)):
        (a, angle_a, line_a), (b, angle_b, line_b) = _rotaries(posted, held, machine)
        assert (a, angle_a, b, angle_b) == ("A", -30.0, "B", 12.5)
        frame = held.clamped_frame
        assert frame.into(line_a[:1])[0] == pytest.approx((0, 0, 0)) and frame.turn_into(line_a[1:])[0] == pytest.approx((1, 0, 0))
        assert frame.into(line_b[:1])[0] == pytest.approx((beside, 0, 0))
        assert frame.turn_into(line_b[1:])[0] == pytest.approx((0, 1, 0))
    assert _rotaries(posted, held, find_machine("mill_gantry_5axis")) == ()             # its head turns
