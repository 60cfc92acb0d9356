"""Prismatic parts as somebody writes them who knows the README alone, by `Auto` and the library small_mills or another
(LIBRARIES): built with all proofs.

    python bench/strangers.py [PART ...]
"""

import importlib.util
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests/parts"), str(ROOT / "bench")]

from built_parts import ran  # noqa: E402
from users_parts import HEAD, told  # noqa: E402

from cuspline.kernel import brep  # noqa: E402

HERE = Path(__file__).parent / "strangers"
PARTS = ("bracket", "housing", "manifold", "oring_cover", "hub", "two_sides", "slanted", "l_pocket", "clamp", "indexed",
         "valve_cover", "motor_mount", "electrode", "keyboard", "gear", "heat_sink", "bearing_block", "camera_mount", "inch_plate",
         "cf40", "trunnion_valve", "fillet_lid", "wing_rib", "hull_half", "fan_disc", "ribbed_cavity",
         "sensor_plate", "knuckle", "duct")
PLATES = ("gland_flange", "phone_holder", "bearing_seat", "mould_core", "optic_mount", "stamp", "nameplate", "raised_u",
          "ring_wheel", "saddle_block")
LABS = ("pole_tip", "waveguide", "half_cell", "rudder", "bulb", "bottle_mould", "lens_insert", "chevron", "watch_bridge",
        "big_plate")
SHOPS = ("cold_plate", "tee_mould", "lens_array", "star_knob", "vee_block", "cam", "isogrid", "airfoil_block", "mouse",
         "pin_electrode", "slotted_disc", "scoop", "engraved", "keyed_cover", "drafted_slot", "cavity_slot", "sunk_recess")
FAMILIES = {**dict.fromkeys(PLATES, "plates.py"), **dict.fromkeys(LABS, "labs.py"), **dict.fromkeys(SHOPS, "shops.py")}
LIBRARIES = {"inch_plate": ("--cutters", "inch_mills"),
             **dict.fromkeys(("electrode", "keyboard", "gear", *FAMILIES), ())}      # none is named
JOBS = ("clamp", "gear")    # STEP with a job file


def source_of(part, folder):
    """What `cuspline build` is given; of a job file its STEP is written beside it."""
    if part in FAMILIES:
        return HERE / FAMILIES[part], "-p", f"part={part}"
    if part not in JOBS:
        return (HERE / f"{part}.py",)
    spec = importlib.util.spec_from_file_location(part, HERE / f"{part}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    brep.write_step(brep.the_solid(module.solid(), part), folder / f"{part}.step", part)
    (folder / f"{part}.toml").write_text((HERE / f"{part}.toml").read_text())
    return (folder / f"{part}.toml",)


def form_of(part):
    if part in JOBS:
        return "job"
    return "build123d" if "build123d" in source_of(part, HERE)[0].read_text() else "cadquery"


def main(parts):
    print("\n".join(HEAD), flush=True)
    for part in parts:
        with tempfile.TemporaryDirectory() as scratch:
            scratch, begin = Path(scratch), time.process_time()
            library = LIBRARIES.get(part, ("--cutters", "small_mills"))
            done = ran("build", *source_of(part, scratch), *library, "--out", scratch / "out", "--stage", "verify")
            print(told(part, form_of(part), done, scratch / "out", time.process_time() - begin), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or (*PARTS, *FAMILIES))
