"""A tool that leans in the cut: a dome finished on a trunnion, built with all proofs; one surface on every five-axis machine.

    python bench/leaning.py FOLDER [dome saddle blade]     whole verdicts on every preset with rotary axes, a table for RESULTS.md;
                                                           builds into FOLDER, what stands there is not built again
    python bench/leaning.py FOLDER cutters                 the dome by what is no ball, on machines of three kinds: the same table
    python bench/leaning.py FOLDER many                    domes of 96 x 72 and 128 x 96 mm in fine passes: what planning and
                                                           judging cost
"""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peers import HERE

from cuspline.app.catalogue import MACHINES, find_library, find_machine, machine_names, reader_of
from cuspline.planning.plan import plan_setup
from cuspline.posts.writers import linuxcnc
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece

PARTS = HERE.parent / "tests" / "parts"
sys.path.append(str(PARTS))         # for leaning_surface
FIRST, *OTHERS = ("mill_head_table_bc", "mill_head_head", "mill_table_table", "mill_head_table", "mill_a_on_b", "mill_trunnion_ac")
HIGHER_MM = 60.0            # than the preset's zero: heads that lean come down low
EVERY_MM = 1.2              # between places looked at
FORMS = ("dome", "saddle", "blade")
CUTTERS = {             # tool, how it leads in degrees, cusp in mm
    "bull nose": ("bull 10 r1", 12, 0.05), "flat": ("flat 10", 12, 0.05), "lens": ("lens", 4, 0.05),
    "tapered ball": ("tapered ball", 20, 0.1)}
OF_CUTTERS_MM = 0.01        # their tolerance
MACHINES_OF_CUTTERS = ("mill_trunnion_ac", "mill_head_table_bc", "mill_head_head")
MANY = {"wide": 3, "scallop_mm": 0.012, "tolerance_mm": 0.003}
MORE = {"wide": 4, "scallop_mm": 0.001, "tolerance_mm": 0.0005}        # planned alone
# where the job is held, mm beside the preset's zero: as it is, heads that lean come down too low, tables are in the way
HELD_MM = {**dict.fromkeys(("mill_head_head", "mill_gantry_5axis", "mill_head_table_bc", "mill_head_table"), (0, 0, 60)),
           "mill_table_table": (0, 110, 70), "mill_a_on_b": (0, 0, 80)}
MORE_MM = {("blade", "mill_head_head"): 5, ("blade", "mill_gantry_5axis"): 5}      # higher still: its corners lie lower


def measure():
    """[(what, number, unit)]."""
    return _built() + [row for form in FORMS for row in _alike(form)]


def _built():
    """The dome through `cuspline build`, as a user would."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        seconds = _cpu_s("build", PARTS / "leaning_surface.py", "--out", out)
        found = json.loads((out / "verify.json").read_text())
    proven = found["setups"][0]["certificate"]["moves"]
    return [("dome, 32 x 24 mm, on a trunnion: the whole build", seconds, "CPU s"), ("findings", len(found["findings"]), ""),
            ("moves proven", sum(proven.values()), ""),
            *((f"{name.replace('_mm', '').replace('_', ' ')}", found[name] * 1e3, "um") for name in (
                "gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "excess_proven_mm"))]


def _machine(name):
    found = find_machine(name)
    x, y, z = found.wcs_origin_mm
    return found.model_copy(update={"wcs_origin_mm": (x, y, z + HIGHER_MM)})


def _alike(form):
    """One plan, posted for every machine, read back and cut: how far what is left differs at the same places."""
    from leaning_surface import Surface, design
    library, part = find_library(None), design(Surface(form=form))
    begin = time.process_time()
    plan = plan_setup(part, part.setups[0], _machine(FIRST), library)
    planned = time.process_time() - begin
    tools = {t.number: t for t in library.tools}
    samples = plan.context.samples
    rows = np.unique(np.round(samples.point_mm[:, :2] / EVERY_MM).astype(int), axis=0, return_index=True)[1]

    def left(name):
        mill = _machine(name)
        text = linuxcnc.post(plan.program(("LEANING",), "leaning"), mill).text
        moves = reader_of(mill)(text, work_offsets={"G54": mill.wcs_origin_mm},
                                tool_lengths={n: t.length_mm for n, t in tools.items()})
        cut = Workpiece(blank=part.stock.shape).after(part.setups[0].frame, swept_paths(moves, tools))
        return cut.deviations(samples.point_mm[rows], samples.normal[rows], 1.0)[0]

    first = left(FIRST)
    worst = max(float(np.abs(left(name) - first).max()) for name in OTHERS)
    return [(f"{form}, {len(rows)} places: largest difference between {FIRST} and five others", worst * 1e3, "um"),
            (f"{form}: to plan it", planned, "CPU s")]


def _held_mm(form, name):
    """(x, y, z) of the job beside the preset's zero."""
    x, y, z = HELD_MM.get(name, (0, 0, 0))
    return x, y, z + MORE_MM.get((form, name), 0)


# whole verdicts --------------------------------------------------------------------------------------


def verdicts(folder, forms):
    """Build every form on every preset with rotary axes, one after the other; rows of a table as they come."""
    _table(folder, [(form, name, ("-p", f"form={form}")) for form in forms for name in machine_names()
                    if find_machine(name).rotaries])


def by_cutters(folder):
    """The dome by every one of CUTTERS, one way, without tilt."""
    _table(folder, [(what, name, (
        "-p", f"tool={tool}", "-p", f"lead_deg={lead}", "-p", "tilt_deg=0", "-p", "passes=one-way", "-p", f"scallop_mm={cusp}",
        "-p", f"tolerance_mm={OF_CUTTERS_MM}")) for what, (tool, lead, cusp) in CUTTERS.items() for name in MACHINES_OF_CUTTERS])


def _table(folder, wanted):
    """Rows of (what, machine, parameters)."""
    print("| form | machine | held beside zero, mm | verdict | CPU s | gouge, proven mm | excess, proven mm | moves proven |",
          "|---|---|---|---|---|---|---|---|", sep="\n", flush=True)
    for what, name, parameters in wanted:
        row = folder / f"{what.replace(' ', '-')}-{name}.json"
        if not row.is_file():
            row.write_text(json.dumps(_verdict(row.with_suffix(""), _held_mm(what, name), name, parameters)))
        print(_as_row(what, name, json.loads(row.read_text())), flush=True)


def _verdict(out, held_mm, name, parameters):
    mill, text = out.with_suffix(".toml"), (MACHINES / f"{name}.toml").read_text()
    zero = [a + b for a, b in zip(find_machine(name).wcs_origin_mm, held_mm)]
    mill.write_text(re.sub(r"(?m)^wcs_origin_mm = \S.*?\]", f"wcs_origin_mm = {zero}", text))
    begin = os.times()
    done = subprocess.run([Path(sys.executable).with_name("cuspline"), "build", PARTS / "leaning_surface.py", *parameters,
                           "-p", f"machine={mill}", "--stage", "verify", "--out", out], capture_output=True, text=True)
    end, made = os.times(), next((p for p in (out, out.with_name(f"{out.name}-rejected")) if (p / "verify.json").is_file()), None)
    cost = {"cpu_s": end.children_user + end.children_system - begin.children_user - begin.children_system}
    if made is None:
        return {**cost, "why": done.stderr.strip().splitlines()[-1:]}
    found = json.loads((made / "verify.json").read_text())
    return {**cost, "ok": found["ok"], "findings": [f"{f['kind']} {f['amount_mm']:.3f}" for f in found["findings"]],
            "moves": sum(found["setups"][0]["certificate"]["moves"].values()),
            **{k: found[k] for k in ("gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "excess_proven_mm")}}


def _as_row(form, name, row):
    held = " ".join(f"{v:g}" for v in _held_mm(form, name))
    if "ok" not in row:
        return f"| {form} | {name} | {held} | none: {' '.join(row['why'])} | {row['cpu_s']:.0f} | – | – | – |"
    word = "VERIFIED" if row["ok"] else "rejected: " + "; ".join(row["findings"][:3])
    return (f"| {form} | {name} | {held} | {word} | {row['cpu_s']:.0f} | {row['gouge_max_mm']:.4f}, "
            f"{row['gouge_proven_mm']:.4f} | {row['excess_max_mm']:.4f}, {row['excess_proven_mm']:.4f} | {row['moves']:,} |")


# many contacts ---------------------------------------------------------------------------------------


def many(folder):
    """Print contacts, posted moves and CPU seconds of a large dome; built into FOLDER unless it stands there."""
    for settings in (MANY, MORE):
        print("{:,} moves of the finish planned in {:.1f} CPU s".format(*_planned(settings)), flush=True)
    out = folder / "many"
    if not out.exists():
        parameters = [word for pair in MANY.items() for word in ("-p", "{}={}".format(*pair))]
        _cpu_s("build", PARTS / "leaning_surface.py", *parameters, "--stage", "verify", "--out", out)
    setup, = json.loads((out / "verify.json").read_text())["setups"]
    finish = json.loads((out / "plan.json").read_text())["setups"][0]["operations"][-1]
    print(f"{finish['moves']:,} moves of the finish planned; {sum(setup['certificate']['moves'].values()):,} posted in all,",
          f"judged by `cuspline verify` in {_cpu_s('verify', out):.1f} CPU s")


def _planned(settings):
    """(moves of the finish, CPU seconds) of the dome planned in this process."""
    from leaning_surface import Surface, design
    part, library = design(Surface(**settings)), find_library(None)
    begin = time.process_time()
    plan = plan_setup(part, part.setups[0], find_machine(part.machine), library)
    return len(plan.operations[-1].moves), time.process_time() - begin


def _cpu_s(*words):
    """CPU seconds of a cuspline command."""
    begin = os.times()
    subprocess.run([Path(sys.executable).with_name("cuspline"), *words], check=True, capture_output=True)
    end = os.times()
    return end.children_user + end.children_system - begin.children_user - begin.children_system


if __name__ == "__main__":
    Path(sys.argv[1]).mkdir(parents=True, exist_ok=True)
    into, others = Path(sys.argv[1]).resolve(), {"many": many, "cutters": by_cutters}
    if sys.argv[2:] and sys.argv[2] in others:
        others[sys.argv[2]](into)
    else:
        verdicts(into, sys.argv[2:] or FORMS)
