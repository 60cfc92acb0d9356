"""The source's test of hardened steel beside its ranking: the design h13_test built for every layer: python bench/h13_test.py."""

import json
import sys
import tempfile
from pathlib import Path

import cuspline

LAYERS = 0.25, 0.5, 0.75, 1.0, 1.25
RANKING = "plane", "step-up", "inclined"            # of the measured axial force, most first: figure 3.10
COLUMNS = (("mean axial N", "axial_mean_n"), ("largest axial N", "axial_n"), ("mean across N", "radial_mean_n"),
           ("largest depth mm", "depth_mm"), ("lowest speed m/min", "lowest_speed_m_per_min"), ("tip in the cut", "tip_share"))


def measured(layer_mm, folder):
    """{operation: row of verify.json's process}, and whether the build is verified."""
    built = cuspline.build("h13_test", out=Path(folder) / f"layer-{layer_mm}", stage="verify", layer_mm=layer_mm)
    document = json.loads((built.folder / "verify.json").read_text())
    return {row["name"]: row for row in document["setups"][0]["process"]["operations"]}, document["ok"]


def main():
    with tempfile.TemporaryDirectory() as folder:
        rows, verified = zip(*(measured(layer, folder) for layer in LAYERS))
    print("layer mm".ljust(32) + "".join(f"{layer:>9.2f}" for layer in LAYERS))
    print("verified".ljust(32) + "".join(f"{str(is_ok):>9s}" for is_ok in verified))
    for name in RANKING:
        for what, key in COLUMNS:
            print(f"{name:10s}{what:22s}" + "".join(f"{row[name][key]:9.2f}" for row in rows))
    orders = [tuple(sorted(row, key=lambda name: -row[name]["axial_mean_n"])) for row in rows]
    agree = [order == RANKING for order in orders]
    print("axial force in the source's order".ljust(32) + "".join(f"{str(is_so):>9s}" for is_so in agree))
    return 0 if all(agree) and all(verified) else 1


if __name__ == "__main__":
    sys.exit(main())
