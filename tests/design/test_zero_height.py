"""Where a setup's zero stands on a machine that says what the stock lies on: as much higher as the stock reaches below it."""

import cadquery as cq
import numpy as np
import pytest
from known_programs import tool
from pydantic import ValidationError

from cuspline.app.catalogue import find_machine
from cuspline.app.judge import moves_of_file
from cuspline.design import Design, Finish, Parameters, Setup, StockBox
from cuspline.design.design import with_zero_heights
from cuspline.shop.machines import Machine

HIGH = 24.0
ON_BASE = {"wcs_origin_mm": (0, 0, -HIGH)}
TURNED_OVER = {"wcs_origin_mm": (0, 0, -HIGH), "wcs_z": (0, 0, -1)}
ON_SIDE = {"wcs_origin_mm": (0, -10, 0), "wcs_x": (1, 0, 0), "wcs_z": (0, -1, 0)}


def heights(**setup):
    solid = cq.Workplane("XY").box(30, 20, HIGH, centered=(True, True, False)).translate((0, 0, -HIGH))
    design = Design(name="block", description="", parameters=Parameters(), solid=solid.val(), predicates={"all": solid.faces()},
                    material="aluminium_6061", stock=StockBox(min_mm=(-15, -10, -HIGH), max_mm=(15, 10, 0)),
                    finish=Finish(scallop_mm=0.02, profile_tolerance_mm=0.005, gouge_mm=0.01),
                    setups=(Setup(name="one", faces=("all",), wcs_in_words="", **setup),))
    return with_zero_heights(design).setups[0].zero_height_mm


@pytest.mark.parametrize("setup, wanted", [({}, HIGH), (ON_BASE, None), (TURNED_OVER, HIGH), (ON_SIDE, 20.0),
                                           ({"zero_height_mm": 54.0}, 54.0), ({**ON_BASE, "zero_height_mm": 3.0}, 3.0)])
def test_it_is_as_high_as_the_stock_reaches_below_it_where_nothing_is_said(setup, wanted):
    assert heights(**setup) == wanted


def test_the_zero_stands_so_high_on_what_the_machine_names_or_where_it_was_measured_if_that_is_higher():
    mill = find_machine("mill_heidenhain")
    x, y, z = mill.wcs_origin_mm
    assert mill.zero_mm() == (x, y, z) and mill.zero_mm(HIGH) == (x, y, mill.supports_z_mm + HIGH)
    measured = mill.model_copy(update={"wcs_origin_mm": (x, y, z + 100)})
    assert measured.zero_mm(HIGH) == (x, y, z + 100)
    silent = mill.model_copy(update={"supports_z_mm": None})
    assert silent.zero_mm(HIGH) == (x, y, z)


def test_the_program_is_read_with_the_zero_there():
    mill, cutter = find_machine("mill_3axis"), {1: tool("flat", 6)}
    text = "G21 G90 G17 G54\nT1 M6\nG43 H1\nS5000 M3\nG0 X0 Y0\nG0 Z5\nG1 Z-3 F200\nM5\nG53 G0 Z0\nM2\n"
    setup = Setup(name="one", faces=("all",), wcs_in_words="")
    low, high = (moves_of_file(text, setup.model_copy(update={"zero_height_mm": height}), mill, cutter).machine_end_mm[:, 2]
                 for height in (None, HIGH))
    assert np.nanmin(low) == pytest.approx(mill.wcs_origin_mm[2] - 3 + cutter[1].length_mm)
    assert np.nanmin(high) == pytest.approx(np.nanmin(low) + HIGH) and np.nanmax(high) == np.nanmax(low) == 0.0


def test_a_machine_that_turns_the_part_says_where_its_zero_is():
    turning = find_machine("mill_trunnion_ac").model_dump(mode="json")
    with pytest.raises(ValidationError, match="supports_z_mm is for machines without rotary axes"):
        Machine(**{**turning, "supports_z_mm": -450.0})
