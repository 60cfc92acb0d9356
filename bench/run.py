"""Every measurement, ours beside its peers', into the marked parts of bench/RESULTS.md.

Usage: python bench/run.py [section ...]; without one all that is there.  Sections: drop, and the modules of OTHERS.

Peers live in an environment of their own, .bench-venv (see peers.py); one that cannot be installed is left out.
CPU seconds against CPU seconds, one thread each, best of two or three; compilers do not count.
"""

import importlib
import os
import platform
import re
import sys
from importlib.metadata import version
from pathlib import Path

import drop_speed
import numpy as np
import workload
from peers import HERE, peer_python

RESULTS = HERE / "RESULTS.md"
# each with measure() -> (what, number, unit) rows, or table() -> lines
OTHERS = ("exact_drop", "certificate", "simulation", "five_axis", "kinematics", "machine_bodies", "leaning", "clearance",
          "clearing_axes", "surface_queries", "scallop", "memory", "propeller", "propeller_truth", "sabotage", "fuzz")
PACKAGES = ("numpy", "numba", "llvmlite", "cadquery-ocp", "cadquery")


def machine():
    """One line on processor, memory and system."""
    model, memory = platform.processor() or platform.machine(), ""
    if Path("/proc/cpuinfo").exists():
        model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())[1]
        kib = int(re.search(r"MemTotal: *(\d+)", Path("/proc/meminfo").read_text())[1])
        memory = f", {kib / 2**20:.0f} GiB"
    return f"{os.cpu_count()} cores, {model}{memory}; {platform.system()}, Python {platform.python_version()}"


def own_versions():
    return "cuspline on " + ", ".join(f"{p} {version(p)}" for p in PACKAGES)


def figure(number):
    """Three figures that count; large numbers with thin groups."""
    if not np.isfinite(number):
        return "–"
    if abs(number) >= 1000:
        return f"{float(f'{number:.3g}'):,.0f}".replace(",", " ")
    return f"{number:.3g}"


def ratio_table(ratios):
    lines = ["| what | cuspline | opencamlib | ratio | goal | tips below, above opencamlib's, mm |",
             "|---|---|---|---|---|---|"]
    for r in ratios:
        goal = f"≥ {r.goal:.0f}×" if np.isfinite(r.goal) else ""
        difference = f"{r.below_mm:.1e}, {r.above_mm:.1e}" if np.isfinite(r.below_mm) else "–"
        times = figure(r.ratio) + ("×" if np.isfinite(r.ratio) else "")
        lines.append(f"| {r.what} | {figure(r.own)} {r.unit} | {figure(r.peer)} | {times} | {goal} | {difference} |")
    return lines


def plain_table(rows):
    return ["| what | measured |", "|---|---|"] + [f"| {what} | {figure(number)} {unit} |" for what, number, unit in rows]


def other_section(name):
    """The table of a measuring module, titled by its docstring."""
    module = importlib.import_module(name)
    table = module.table() if hasattr(module, "table") else plain_table(module.measure())
    title = module.__doc__.strip().splitlines()[0].rstrip(".")
    return [f"## {title}", "", f"Machine: {machine()}. {own_versions()}.", "", *table]


def drop_section():
    """Drop-cutter and waterline beside opencamlib, threads, memory, growth."""
    python, held = peer_python()
    pins = sorted(pin.replace("==", " ") for pin in held)
    peer = python if any(pin.startswith("opencamlib") for pin in held) else None
    ratios, meshes = [], {}
    for deviation, points in drop_speed.PEER_POINTS.items():
        *mesh, measured = meshes[deviation] = workload.patch_mesh(deviation)
        label = f"patch at {measured * 1e3:.1f} µm ({len(mesh[1])} triangles)"
        print(label, flush=True)
        rows, own, other = drop_speed.drop_ratios(peer, mesh, label, drop_speed.DROP_GOALS[deviation], points)
        ratios += rows
    memory = drop_speed.memory_rows(own, other)
    for deviation, points in drop_speed.PEER_POINTS.items():
        *mesh, measured = workload.part_mesh(workload.trimmed_part(), deviation)
        label = f"trimmed part at {measured * 1e3:.1f} µm ({len(mesh[1])} triangles)"
        print(label, flush=True)
        ratios += drop_speed.drop_ratios(peer, mesh, label, np.nan, points)[0]
    print("waterline, threads, growth", flush=True)
    ratios += drop_speed.waterline_ratios(peer, meshes[0.020])
    plain = drop_speed.two_thread_rows(meshes[0.005]) + memory + drop_speed.growth_rows(meshes[0.020])
    return ["## Drop-cutter and waterline on meshes, beside opencamlib", "",
            f"Machine: {machine()}. {own_versions()}; peers: {', '.join(pins) or 'none could be installed'}.", "",
            "Rates are per CPU second of one thread. The mesh's deviation is measured along the normal. Where our tips "
            "lie above opencamlib's, the mesh has a point there that opencamlib's cutter cuts into.", "",
            *ratio_table(ratios), "", *plain_table(plain)]


def with_section(text, name, lines):
    """The text with the part between the section's marks replaced, or with the section at its end."""
    begin, end = (f"<!-- make bench, {name}: {mark} -->" for mark in ("begin", "end"))
    block = "\n".join([begin, "", *lines, "", end])
    if begin in text:
        return text[:text.index(begin)] + block + text[text.index(end) + len(end):]
    return f"{text.rstrip()}\n\n{block}\n"


def main(wanted):
    there = ["drop", *(name for name in OTHERS if (HERE / f"{name}.py").exists())]
    if unknown := set(wanted) - set(there):
        sys.exit(f"nothing measures {', '.join(sorted(unknown))}; there are {', '.join(there)}")
    for name in wanted or there:
        print(name, flush=True)
        lines = drop_section() if name == "drop" else other_section(name)
        RESULTS.write_text(with_section(RESULTS.read_text(), name, lines))
    print(f"written to {os.path.relpath(RESULTS)}")


if __name__ == "__main__":
    main(sys.argv[1:])
