"""The tool libraries that come along: what belongs together is there, and names say the sizes."""

import re
from fractions import Fraction

import pytest

from cuspline.app import catalogue
from cuspline.shop.threads import thread_form

LIBRARIES = {name: catalogue.find_library(name) for name in catalogue.library_names()}
INCH = [(tool.cutter, name) for tool in LIBRARIES["inch_mills"].tools if (name := re.search(r"(\S+) in\b", tool.cutter.name))]


def test_there_are_libraries_in_millimetres_and_in_inches():
    assert {"tools", "small_mills", "small_balls", "fine_mills", "inch_mills"} <= set(LIBRARIES)


def test_each_library_of_smaller_cutters_has_what_the_one_before_has():
    """A design that names no library is planned again by the next of them where it must be."""
    tools = [LIBRARIES[name].tools for name in ("tools", *catalogue.SMALLER)]
    for fewer, more in zip(tools, tools[1:]):
        assert {t.number: t for t in fewer}.items() < {t.number: t for t in more}.items()
        assert [t.number for t in more] == sorted(t.number for t in more)


@pytest.mark.parametrize("name", LIBRARIES)
def test_every_tap_has_a_drill_within_the_limits_of_its_thread(name):
    drills = [t.cutter.diameter_mm for t in LIBRARIES[name].of_type("drill")]
    taps = LIBRARIES[name].of_type("tap")
    assert taps
    for tap in taps:
        form = thread_form(tap.cutter.name.removeprefix("tap "))
        least, largest = form.minor_mm
        assert any(least <= d <= largest for d in drills), tap.cutter.name
        assert (tap.cutter.diameter_mm, tap.cutter.pitch_mm) == pytest.approx((form.nominal_mm, form.pitch_mm), abs=1e-6)


@pytest.mark.parametrize("name", LIBRARIES)
def test_every_reamer_has_a_drill_under_its_size(name):
    drills = [t.cutter.diameter_mm for t in LIBRARIES[name].of_type("drill")]
    for reamer in LIBRARIES[name].of_type("reamer"):
        assert any(0.1 < reamer.cutter.diameter_mm - d < 0.45 for d in drills), reamer.cutter.name


@pytest.mark.parametrize("cutter, found", INCH, ids=[cutter.name for cutter, _ in INCH])
def test_a_size_in_inches_is_what_the_name_says(cutter, found):
    slack_in = 0.0002 if cutter.type == "reamer" else 0.0          # made that much larger, as reamers for dowels are
    assert cutter.diameter_mm / 25.4 == pytest.approx(float(Fraction(found[1])) + slack_in, abs=1e-6)
