"""Propeller solids over the whole family: every one valid to the gates, or refused by name.

Usage: make bench ARGS=propeller, or python bench/propeller.py.
"""

import itertools
import multiprocessing
import os
import pathlib
import tempfile
import time
from collections import Counter

RADII = {       # of the fillet at leading edge, face, trailing edge, back; mm for a diameter of 300 mm
    "even": (4.0, 4.0, 4.0, 4.0), "thin at the edges 1:4": (2.0, 8.0, 2.0, 8.0),
    "thin on the face 1:4": (4.0, 2.0, 4.0, 8.0), "large 1:4": (6.0, 12.0, 3.0, 12.0)}
STRIDE = 101        # of the order of the cases, which mixes the families: a run cut short tells of all
EDGES = ("round", "square", "anti-singing")
VOLUME_SHARE, DEVIATION_MM, TOLERANCE_MM = 1e-5, 2e-3, 1e-3
REASONS = (("next blade", "neighbouring blades"), ("fore end", "hub end"), ("aft end", "hub end"), ("hollow", "hollow"),
           ("blade before", "neighbouring blades"), ("own blade", "own blade"),
           ("wedged", "acute root"), ("crosses itself", "acute root"), ("faster", "law too steep"),
           ("leave too little of the hub", "neighbouring blades"))


def parameter_sets():
    """[(family, keywords for `made`)]: at least 100."""
    sets = []
    for n, (blades, area, pitch) in enumerate(itertools.product(range(3, 8), (0.45, 0.55, 0.75, 0.95),
                                                                (0.6, 1.0, 1.4))):
        sets.append(("B-series", dict(kind="b", blades=blades, area_ratio=area, pitch_ratio=pitch, number=n,
                                      diameter_mm=(100.0, 250.0, 1000.0)[n % 3])))
    for n, (blades, skew, size) in enumerate(itertools.product(range(3, 8), (0.0, 36.0, 72.0), (100.0, 300.0, 1000.0))):
        sets.append((f"own, skew {skew:.0f} deg", dict(kind="own", blades=blades, skew_deg=skew, diameter_mm=size,
                                                       number=n, area_ratio=(0.5, 0.7, 0.85)[n % 3],
                                                       pitch_ratio=(0.8, 1.1, 1.5)[n // 3 % 3])))
    sets += [("DTMB 4119", dict(kind="4119", diameter_mm=size, number=n))
             for n, size in enumerate((100.0, 304.8, 1000.0) * 2)]
    return sets


def made(*, kind, diameter_mm, number, radii, blades=3, area_ratio=0.5, pitch_ratio=1.0, skew_deg=0.0):
    """PropellerSolid of one set and one law; hand, edge, taper and rake change with its number."""
    import numpy as np

    from cuspline.designs.propellers import tables
    from cuspline.designs.propellers.design import blade_over
    from cuspline.designs.propellers.root import radius_round_root, straight_hub
    from cuspline.designs.propellers.sections import TrailingEdge
    from cuspline.designs.propellers.solid import propeller_solid

    edge, hand = TrailingEdge(kind=EDGES[number % 3]), number % 2 == 0
    rake, taper = (0.0, 10.0, -5.0)[number // 2 % 3], np.radians((0.0, 3.0, -3.0)[number // 3 % 3])
    main = tables.MainDimensions(blades, area_ratio, pitch_ratio, diameter_mm, hand)
    if kind == "b":
        table = tables.b_series(main, edge=edge)
        ratio = tables.B_SERIES_HUB.get(blades, tables.OTHER_HUB)
    elif kind == "own":
        ratio = 0.2
        table = tables.own_propeller(main, ratio, tables.BladeForm(skew_deg=skew_deg, rake_deg=rake, root_pitch_share=0.9,
                                                                   edge=edge))
    else:
        table, ratio = tables.dtmb_4119(diameter_mm, hand, edge), 0.2
    scale = diameter_mm / 300
    hub = straight_hub(-0.24 * diameter_mm, 0.22 * diameter_mm, ratio * diameter_mm / 2, float(taper))
    return propeller_solid(blade_over(table, hub), hub, radius_round_root(*(r * scale for r in radii)))


def judged(solid):
    """{gate: measured} of a PropellerSolid, as built and as read back from STEP, and the gates that it breaks."""
    from OCP.TopAbs import TopAbs_SHELL

    from cuspline.designs.propellers.checks import blade_figures, definition_deviation_mm, fillet_figures
    from cuspline.designs.propellers.mesh import extrapolated_volume_mm3
    from cuspline.kernel import brep
    from cuspline.surfaces.trims import TrimSet
    volume, read = brep.volume_mm3(solid.solid), _read_back(solid.solid)
    faces = brep.faces_of(read)
    TrimSet.of_faces(faces)                     # refuses a border that does not close
    figures = fillet_figures(solid, faces) + blade_figures(solid, faces)[0]
    found = {"tolerance": max(brep.loosest_tolerance_mm(s) for s in (solid.solid, read)),
             "volume": abs(volume / extrapolated_volume_mm3(solid) - 1),
             "volume as read back": abs(brep.volume_mm3(read) / volume - 1),
             "definition": definition_deviation_mm(solid),
             "shells": max(len(brep.explore(s, TopAbs_SHELL)) for s in (solid.solid, read)),
             "faces without a name": sum(not f.mark.name for f in faces)}
    limits = {"tolerance": TOLERANCE_MM, "volume": VOLUME_SHARE, "volume as read back": VOLUME_SHARE,
              "definition": DEVIATION_MM, "shells": 1, "faces without a name": 0}
    broken = [name for name, limit in limits.items() if not found[name] <= limit]
    for f in figures:
        what = f.what.split(" at r/R")[0]
        off = abs(f.measured - f.wanted)
        found[what] = max(found.get(what, 0.0), off / f.wanted if f.wanted else off)
    return found, broken + [f.what for f in figures if not f.is_kept]


def _read_back(solid):
    """The solid as it comes back from a STEP file."""
    from cuspline.kernel import brep
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "propeller.step"
        brep.write_step(solid, path, "propeller")
        return brep.the_solid(brep.read_step(path), path.name)


def tried(case):
    """One row of the grid: (family, law, outcome, what, measured, seconds)."""
    from cuspline.values.errors import DesignError
    (family, given), law = case
    start = time.process_time()
    try:
        found, broken = judged(made(**given, radii=RADII[law]))
        outcome, what = ("failed", ", ".join(broken)) if broken else ("valid", "")
    except DesignError as error:
        found, what = {}, str(error)
        reason = next((name for words, name in REASONS if words in what), "")
        outcome = f"refused: {reason}" if reason else "failed"
    return family, law, outcome, f"{given}: {what}" if what else "", found, time.process_time() - start


def run_grid(workers=2, say=print):
    """All rows; every process keeps to one thread."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    cases = [(s, law) for s in parameter_sets() for law in RADII]
    cases = [cases[k * STRIDE % len(cases)] for k in range(len(cases))]
    rows = []
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for k, row in enumerate(pool.imap(tried, cases), 1):
            rows.append(row)
            say(f"{k}/{len(cases)} {row[0]}, {row[1]}: {row[2]} {row[3]}", flush=True)
    return rows


def measure():
    """(what, number, unit) rows."""
    rows = run_grid()
    found = [("sets of parameters, each with 4 laws of the fillet's radius", len(parameter_sets()), ""),
             ("solids asked for", len(rows), ""), ("valid to every gate", sum(r[2] == "valid" for r in rows), ""),
             ("refused by name", sum(r[2].startswith("refused") for r in rows), ""),
             ("neither", sum(r[2] == "failed" for r in rows), "")]
    for reason, count in sorted(Counter(r[2] for r in rows if r[2].startswith("refused")).items()):
        found.append((reason, count, ""))
    for name in dict.fromkeys(r[0] for r in rows):
        mine = [r for r in rows if r[0] == name]
        found.append((f"{name}: valid of {len(mine)}", sum(r[2] == "valid" for r in mine), ""))
    for name in RADII:
        mine = [r for r in rows if r[1] == name]
        found.append((f"fillet {name}: valid of {len(mine)}", sum(r[2] == "valid" for r in mine), ""))
    valid = [r[4] for r in rows if r[2] == "valid"]
    plain = {"volume", "volume as read back", "chord", "pitch", "thickness", "shells", "faces without a name",
             "expanded area ratio, sections against chord table"}
    titles = {"tolerance": "loosest tolerance", "volume": "kernel's volume against the mesh's, relative",
              "volume as read back": "volume as read back, relative", "definition": "blade from its definition",
              **{name: f"{name}, relative" for name in ("chord", "pitch", "thickness")}}
    for name in dict.fromkeys(name for row in valid for name in row):
        unit = "" if name in plain else "deg" if "normal" in name else "mm"
        found.append((f"worst of all: {titles.get(name, name)}", max(v.get(name, 0.0) for v in valid), unit))
    found.append(("CPU seconds a solid with its checks, mean", sum(r[5] for r in rows) / len(rows), "s"))
    return found


if __name__ == "__main__":
    for what, number, unit in measure():
        print(f"{what}: {number:.4g} {unit}".strip())
