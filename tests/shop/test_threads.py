"""Thread tables beside figures that stand elsewhere: limits of sizes as ISO 965-2 and ASME B1.1 print them."""

import math

import pytest

from cuspline.shop.cutters import Cutter
from cuspline.shop.threads import COARSE_MM, FINE_MM, UNIFIED_IN, Thread, thread_form

# size: minor diameter least and largest, pitch diameter least and largest, of 6H: ISO 965-2, limits of internal threads
ISO_965_2 = {"M3": (2.459, 2.599, 2.675, 2.775), "M5": (4.134, 4.334, 4.480, 4.605), "M6": (4.917, 5.153, 5.350, 5.500),
             "M8": (6.647, 6.912, 7.188, 7.348), "M10": (8.376, 8.676, 9.026, 9.206), "M12": (10.106, 10.441, 10.863, 11.063),
             "M16": (13.835, 14.210, 14.701, 14.913), "M24": (20.752, 21.252, 22.051, 22.316)}
# the same of class 2B, inches: ASME B1.1, limits of size of the standard series
ASME_B1_1 = {"1/4-20 UNC": (0.196, 0.207, 0.2175, 0.2224), "3/8-16 UNC": (0.307, 0.321, 0.3344, 0.3401),
             "1/2-13 UNC": (0.417, 0.434, 0.4500, 0.4565), "1/4-28 UNF": (0.211, 0.220, 0.2268, 0.2311)}


@pytest.mark.parametrize("size", ISO_965_2)
def test_metric_limits_are_those_of_the_standard(size):
    form = thread_form(size)
    assert (*form.minor_mm, *form.pitch_diameter_mm) == pytest.approx(ISO_965_2[size], abs=6e-4)


@pytest.mark.parametrize("size", ASME_B1_1)
def test_unified_limits_are_those_of_the_standard(size):
    form = thread_form(size)
    inches = [v / 25.4 for v in (*form.minor_mm, *form.pitch_diameter_mm)]
    assert inches == pytest.approx(ASME_B1_1[size], abs=6e-4)           # minor diameters are printed to a thousandth


def every_metric_size():
    return [(d, p) for d, coarse in COARSE_MM.items() for p in (coarse, *FINE_MM.get(d, ()))]


@pytest.mark.parametrize("d, p", every_metric_size())
def test_tolerances_are_near_the_formulas_that_they_are_rounded_from(d, p):
    """ISO 965-1: 1.32 times 90 P^0.4 d^0.1, d the range's middle; 230 P^0.7, below P 1 433 P - 190 P^1.22; um."""
    form = thread_form(f"M{d:g}x{p:g}")
    bounds = (0.99, 1.4, 2.8, 5.6, 11.2, 22.4, 45.0)
    low, high = next((a, b) for a, b in zip(bounds, bounds[1:]) if d <= b)
    pitch_um = 1.32 * 90 * p ** 0.4 * math.sqrt(low * high) ** 0.1
    minor_um = 230 * p ** 0.7 if p >= 1 else 433 * p - 190 * p ** 1.22
    assert 1000 * form.pitch_tolerance_mm == pytest.approx(pitch_um, rel=0.08)
    assert 1000 * form.minor_tolerance_mm == pytest.approx(minor_um, rel=0.04)


def test_the_tap_drill_is_within_the_limits_of_the_hole():
    for size in [*(f"M{d:g}x{p:g}" for d, p in every_metric_size())]:
        least, largest = thread_form(size).minor_mm
        assert least < thread_form(size).tap_drill_mm < largest, size


def test_sizes_that_there_are_not_are_refused():
    for size, why in (("M6x2", "pitches 1, 0.75"), ("M9", "no nominal diameter"), ("1/4-24", "1/4-20 UNC or 1/4-28 UNF"),
                      ("1/4-20 UNF", "1/4-20 UNC"), ("W 1/4", "is not known")):
        with pytest.raises(ValueError, match=why):
            Thread(size=size)
    assert all(thread_form(f"{name}-{coarse} UNC").pitch_mm > thread_form(f"{name}-{fine}").pitch_mm
               for name, (_, coarse, fine) in UNIFIED_IN.items())


SAME = {"corner_radius_mm": 0, "flutes": 3, "flute_length_mm": 15, "reach_mm": 30, "shank_diameter_mm": 6, "overall_length_mm": 80}


def test_a_tap_is_simulated_as_its_core_and_a_thread_mill_as_its_neck():
    tap = Cutter(name="tap", type="tap", diameter_mm=6, pitch_mm=1, hand="right", chamfer_threads=2.5, neck_diameter_mm=4.5, **SAME)
    assert tap.body.type == "flat" and tap.body.diameter_mm == pytest.approx(thread_form("M6").minor_mm[0], abs=1e-4)
    assert tap.chamfer_mm == 2.5 and tap.profile.largest_radius_mm == pytest.approx(tap.body.radius_mm)
    mill = Cutter(name="mill", type="thread_mill", diameter_mm=4.5, neck_diameter_mm=2.9, **{**SAME, "flute_length_mm": 1})
    assert mill.body.diameter_mm == 2.9 and mill.chamfer_mm == 0.5 and mill.threads and not mill.body.threads
    assert Cutter.model_validate(tap.model_dump()) == tap


@pytest.mark.parametrize("wrong", [{"pitch_mm": 4.0}, {"hand": None}, {"type": "thread_mill", "pitch_mm": None, "hand": None,
                                                                     "chamfer_threads": None, "neck_diameter_mm": 6.0}])
def test_taps_and_thread_mills_that_cannot_be_are_refused(wrong):
    with pytest.raises(ValueError):
        Cutter(**{"name": "tap", "type": "tap", "diameter_mm": 6, "pitch_mm": 1, "hand": "right", "chamfer_threads": 2.5,
                  "neck_diameter_mm": 4.5, **SAME, **wrong})
