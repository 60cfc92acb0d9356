"""What a monitor is to expect, and a shop's own cutting forces and tool lives."""

import json

import pytest
from known_programs import tool

from cuspline.app.monitor import expected
from cuspline.shop.cutting_forces import force_of, known_forces
from cuspline.shop.practice import ShopFile, shop_file
from cuspline.shop.tool_lives import life_of
from cuspline.values.errors import InputError

OWN = ('[[forces]]\nmaterial = "brass_c360"\nforce_n_per_mm2 = 700\nedge_n_per_mm = 5\nforce_angle_deg = 65\nsource = "our own"\n'
       '[[lives]]\nmaterial = "brass_c360"\nlife_min = 300\ntime_factor = 1\nsource = "our own"\n')


def test_teeth_strike_in_bands_round_their_frequency(tmp_path):
    row = {"name": "finish", "tool": 1, "rpm": [3000.0, 6000.0], "radial_n": 12.0, "removal_cm3_per_h": 4.0}
    (tmp_path / "tools.json").write_text(json.dumps({"tools": [tool("ball", 6).model_dump(mode="json")]}))
    (tmp_path / "verify.json").write_text(json.dumps({"setups": [{"setup": "setup-1", "process": {"operations": [row]}}]}))
    found, = expected(tmp_path)["setups"][0]["operations"]
    assert found["teeth_bands"][0] == {"harmonic": 1, "low_hz": 95.0, "high_hz": 210.0}        # two teeth: 100 to 200 Hz
    assert found["largest"] == {"radial_n": 12.0, "axial_n": None, "torque_n_m": None, "power_kw": None}


def test_a_folder_without_a_verdict_says_so(tmp_path):
    (tmp_path / "tools.json").write_text(json.dumps({"tools": [tool("ball", 6).model_dump(mode="json")]}))
    with pytest.raises(InputError, match="--stage verify"):
        expected(tmp_path)


def test_a_shops_own_figures_go_before_and_change_no_other_shop(tmp_path):
    (tmp_path / "shop.toml").write_text(OWN)
    own = shop_file(tmp_path / "shop.toml")
    assert force_of("brass_c360", own.forces).source == life_of("brass_c360", own.lives).source == "our own"
    assert force_of("brass_c360") is None and force_of("steel_h13_48hrc", own.forces) is known_forces()["steel_h13_48hrc"]
    assert not {"forces", "lives"} & set(ShopFile().model_dump()) and "constant_speed" not in ShopFile().model_dump()["practice"]
