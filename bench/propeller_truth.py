"""Random propellers and tables: every one a true solid, or refused with a radius that works.

Usage: make bench ARGS=propeller_truth, or python bench/propeller_truth.py [rows.jsonl [cases]] to go on with a run.

What judges knows nothing of rolling balls: the surfaces' own facets, of two densities, must not cross, Su x Sv must not
change its sign, rays must find the material once; every FULL-th, and every one whose facets cross, is also written as
STEP, read back and asked as every build asks, on the exact surfaces.  Of a refusal the radius it names is tried: all
radii scaled so must be accepted, and true.
"""

import json
import os
import re
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

PROPELLERS, TABLES, SEED = 300, 100, 4119
FULL = 8                    # every so many of the accepted ones go through a STEP file
DENSITIES = ({"along": 1, "up": 12, "across": 5, "tip": 4, "hub": 5}, {"along": 2, "up": 30, "across": 12, "tip": 8,
                                                                       "hub": 14})
EDGES = ("round", "square", "anti-singing")


def drawn(number):
    """(kind, table, hub, law) of a number: the first PROPELLERS by parameters, the others by tables of columns."""
    import numpy as np

    from cuspline.designs.propellers import tables
    from cuspline.designs.propellers.root import radius_round_root, straight_hub
    from cuspline.designs.propellers.sections import TrailingEdge, naca66_a08
    draw = np.random.default_rng([SEED, number])
    blades, size = int(draw.integers(3, 8)), float(np.exp(draw.uniform(np.log(80), np.log(1200))))
    hand, edge = bool(draw.integers(2)), TrailingEdge(kind=EDGES[draw.integers(3)])
    ratio = float(draw.uniform(0.15, 0.35))
    area, pitch = float(draw.uniform(0.3, 0.14 * blades + 0.15)), float(draw.uniform(0.5, 1.6))
    own = lambda blades, area: tables.own_propeller(tables.MainDimensions(blades, area, pitch, size, hand), ratio, tables.BladeForm(
        skew_deg=float(draw.uniform(-20, 75)), rake_deg=float(draw.uniform(-15, 20)),
        root_pitch_share=float(draw.uniform(0.7, 1.15)), thickness_scale=float(draw.uniform(0.6, 1.6)),
        camber_share=float(draw.uniform(0, 0.05)), edge=edge))
    if number >= PROPELLERS:
        kind, base = "table", own(blades, area)
        r, wave = base.r_R, draw.normal(size=3)
        skew = np.degrees(base.skew_rad) + 8 * wave[0] * np.sin(3 * r) + 3 * wave[1] * np.cos(5 * r)
        rounded = lambda values: np.round(values, 4)
        pitches = base.pitch_D * (1 + 0.05 * wave[2] * np.sin(4 * r))
        columns = {"r_R": r, "c_D": rounded(base.chord_D), "P_D": rounded(pitches),
                   "skew_deg": rounded(skew), "rake_D": rounded(base.rake_D), "t0_D": rounded(base.thickness_D),
                   "f0_c": rounded(base.camber_c)}
        table = tables._from_columns("drawn", columns, blades, size, hand, naca66_a08(), edge)
    elif number % 5 < 2:
        kind = "B-series"
        main = tables.MainDimensions(blades, max(area, 0.35), pitch, size, hand)
        table = tables.b_series(main, float(draw.uniform(-10, 20)), edge=edge)
    elif number % 5 < 4:
        kind, table = "own", own(blades, area)
    else:
        kind, table = "DTMB 4119", tables.dtmb_4119(size, hand, edge)
    length = size * draw.uniform(0.3, 0.6)
    hub = straight_hub(-length * 0.52, length * 0.48, ratio * size / 2, float(np.radians(draw.uniform(-6, 6))))
    radii = size * np.exp(draw.uniform(np.log(0.005), np.log(0.03), 4))
    return kind, table, hub, radius_round_root(*radii.tolist())


def untrue(made):
    """What speaks against a PropellerSolid's surfaces, in words; "": nothing."""
    import numpy as np

    from cuspline.designs.propellers.mesh import _meshed
    from cuspline.verification import crossing_kernels as kernels
    from cuspline.verification.self_crossing import WAYS, _in_order
    surface = made.fillet.surface
    u, v = (g.ravel() for g in np.meshgrid(_fine(surface.knots_u, 6), np.linspace(0, 1, 41), indexing="ij"))
    d = surface.derivatives(u, v)
    square = np.cross(d[:, 1], d[:, 2]).reshape(-1, 41, 3)
    for a, b in ((square[1:], square[:-1]), (square[:, 1:], square[:, :-1])):
        if (np.einsum("...k,...k->...", a, b) <= 0).any():
            return "the fillet turns over"
    for density in DENSITIES:
        mesh, _ = _meshed(made, density)
        names, owner = mesh.names, np.zeros(len(mesh.vertices_mm), int)
        triangles, corners, ids = _in_order(_Facets(mesh.vertices_mm, mesh.triangles, owner))
        of = {tuple(t): f for t, f in zip(mesh.triangles.tolist(), mesh.face.tolist())}
        boxes = kernels.boxes_of(corners)
        pairs, places = kernels.crossing_pairs(corners, ids, boxes, kernels.tree_over(
            boxes, kernels.levels_over(len(corners))), 5000)
        found = Counter(tuple(sorted(names[of[tuple(triangles[k].tolist())]] for k in pair)) for pair in pairs)
        found.pop(("hub", "hub"), None)             # its facets are laid between root and border, however they run
        if not found:
            break
    if found:
        return "facets cross: " + ", ".join(f"{a} and {b} ({n})" for (a, b), n in found.most_common(3))
    corners = np.ascontiguousarray(mesh.vertices_mm[mesh.triangles])
    size = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = np.argsort(-np.linalg.norm(size, axis=1))
    rows = rows[[names[mesh.face[k]] != "hub" for k in rows]]     # where its facets lie double, a ray finds both
    rows = rows[::max(len(rows) // 12, 1)][:8]
    aside = 1e-6 * size[rows] / np.sqrt(np.linalg.norm(size[rows], axis=1))[:, None]
    for side, wanted in ((1, 0), (-1, 1)):
        counts = [kernels.enclosures(corners[rows].mean(axis=1) + side * aside, way, corners) for way in WAYS]
        if (np.median(counts, axis=0) != wanted).any():
            return "rays find the material otherwise than once"
    return ""


class _Facets:
    def __init__(self, vertices, triangles, owner):
        self.vertices_mm, self.triangles, self.face_index = vertices, triangles, owner


def _fine(knots, count):
    import numpy as np
    at = np.unique(knots)
    return (at[:-1, None] + np.diff(at)[:, None] * (np.arange(count) + 0.5) / count).ravel()


def surfaces_of(table, hub, law):
    """PropellerSolid without its solid: the surfaces alone."""
    from cuspline.designs.propellers.design import blade_over
    from cuspline.designs.propellers.root import half_way_line
    from cuspline.designs.propellers.solid import HubCuts, PropellerSolid, _rolled_fillet
    blade = blade_over(table, hub)
    fillet, between = _rolled_fillet(blade, hub, law)
    line, _ = half_way_line(hub, fillet.rolling, table.blades)
    return PropellerSolid(solid=None, blade=blade, hub=hub, fillet=fillet, between=between, half_way=line,
                          cuts=HubCuts())


def untrue_as_read_back(made, law):
    """What the general check and the fillet's figures say of the solid as read back from STEP; "": nothing."""
    from cuspline.app.report_inputs import shape_of
    from cuspline.designs.propellers.checks import fillet_figures
    from cuspline.designs.propellers.solid import propeller_solid
    from cuspline.kernel import brep
    from cuspline.verification.self_crossing import self_crossings
    solid = propeller_solid(made.blade, made.hub, law).solid
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "propeller.step"
        brep.write_step(solid, path, "propeller")
        read = brep.the_solid(brep.read_step(path), path.name)
    told = [c.what for c in self_crossings(read, shape_of(read, has_thin_edges=True))]
    return "; ".join(told + [f.what for f in fillet_figures(made, brep.faces_of(read)) if not f.is_kept])


def judged(made, law, is_full):
    """(what speaks against it, whether it went through a STEP file): facets that cross are looked into there."""
    what = untrue(made)
    if is_full and not what or what.startswith("facets cross"):
        return untrue_as_read_back(made, law), True
    return what, False


def tried(number):
    """{number, kind, outcome, what, full, seconds}."""
    from cuspline.values.errors import CamError
    start, (kind, table, hub, law), full = time.process_time(), drawn(number), False
    try:
        made = surfaces_of(table, hub, law)
        what, full = judged(made, law, number % FULL == 0)
        outcome = "false" if what else "true"
    except CamError as error:
        outcome, what = _refusal(str(error), table, hub, law)
    return {"number": number, "kind": kind, "outcome": outcome, "what": what, "full": full,
            "seconds": round(time.process_time() - start, 2)}


def _refusal(message, table, hub, law):
    """(outcome, words) of a refusal: the radius it names must be accepted and true."""
    from cuspline.values.errors import CamError
    asked, fits = (re.search(p, message) for p in (r"radius ([\d.]+) mm", r"fits there is ([\d.]+) mm"))
    if fits is None:
        return ("refused: no radius fits" if "no radius fits" in message else "refused: table or blade"), message
    try:
        law = law.scaled(0.9995 * float(fits[1]) / float(asked[1]))
        left, _ = judged(surfaces_of(table, hub, law), law, False)
    except CamError as error:
        return "refused with a radius that does not work", f"{message} -- then: {error}"
    if left:
        return "refused with a radius that is not true", f"{message} -- then: {left}"
    reason = re.search(r"mm (.*?);", message)[1]
    return "refused with a radius that works", re.sub(r"[-\d.]+ ?", "", reason)


def run(path, cases=PROPELLERS + TABLES):
    """Rows of all cases, those on file not again; a run cut short goes on where it was."""
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    known = {r["number"] for r in rows}
    mixed = [k * 157 % (PROPELLERS + TABLES) for k in range(PROPELLERS + TABLES)]
    with path.open("a") as file:
        for number in [n for n in mixed[:cases] if n not in known]:
            rows.append(tried(number))
            print(json.dumps(rows[-1]), file=file, flush=True)
    return rows


def measure(path=None):
    """(what, number, unit) rows."""
    if path is None:
        with tempfile.TemporaryDirectory() as folder:
            return table_of(run(Path(folder) / "rows.jsonl"))
    return table_of(run(path))


def table_of(rows):
    propellers = [r for r in rows if r["number"] < PROPELLERS]
    found = [(f"random propellers tried (of {PROPELLERS}), seed {SEED}", len(propellers), ""),
             (f"random tables tried (of {TABLES})", len(rows) - len(propellers), ""),
             ("accepted, found true", sum(r["outcome"] == "true" for r in rows), ""),
             ("of these through a STEP file and the build's own check", sum(r["full"] for r in rows), ""),
             ("accepted, not true", sum(r["outcome"] == "false" for r in rows), "")]
    found += [(name, count, "") for name, count in sorted(Counter(
        r["outcome"] for r in rows if r["outcome"].startswith("refused")).items())]
    return found + [("CPU seconds a case, mean", sum(r["seconds"] for r in rows) / max(len(rows), 1), "s")]


if __name__ == "__main__":
    args = sys.argv[1:]
    if args:
        run(Path(args[0]), *map(int, args[1:2]))
    for what, count, unit in measure(Path(args[0]) if args and len(args) == 1 else None) if len(args) < 2 else table_of(
            run(Path(args[0]), int(args[1]))):
        print(f"{what}: {count:.4g} {unit}".strip())
