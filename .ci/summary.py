"""Verdict tables in Markdown, out of outputs/*/verify.json and solid.json; standard library only."""

import json
import sys
from pathlib import Path

COLUMNS = (("gouge, mm", "gouge_max_mm", "{:.4f}"), ("cusp, mm", "cusp_max_mm", "{:.4f}"),
           ("error bound, mm", "error_bound_mm", "{:.5f}"), ("points", "points_checked", "{:,}"))


def table(outputs):
    """Lines of the tables: parts that were cut, then bare solids, one a row; findings below."""
    cut, solids = _parts(outputs), _solids(outputs)
    if not cut and not solids:
        return ["no part has a verdict: outputs/ holds no verify.json and no solid.json"]
    return cut + ([""] if cut and solids else []) + solids


def _parts(outputs):
    """Rows of the parts that were cut, and their findings."""
    lines = ["| part | verdict | " + " | ".join(c[0] for c in COLUMNS) + " | reached, mm² | findings |",
             "|---|---|" + "---|" * (len(COLUMNS) + 2)]
    findings = []
    for name, verdict in _documents(outputs, "verify.json"):
        numbers = ["unknown" if verdict[key] is None else form.format(verdict[key]) for _, key, form in COLUMNS]
        reached = f"{verdict['area_reached_mm2']:.1f} of {verdict['area_required_mm2']:.1f}"
        lines.append(f"| {name} | {_word(verdict, 'verified')} | {' | '.join(numbers)} | {reached} | "
                     f"{len(verdict['findings'])} |")
        findings += [f"- {name}, {f['setup']}: {f['kind']} {f['amount_mm']:.4f} mm: {f['advice']}"
                     for f in verdict["findings"]]
    return _with(lines, findings)


def _solids(outputs):
    """Rows of the solids that nothing is cut from yet, and the figures that they do not keep."""
    lines, off = ["| solid | verdict | figures kept | mass, kg |", "|---|---|---|---|"], []
    for name, solid in _documents(outputs, "solid.json"):
        kept = sum(f["ok"] for f in solid["figures"])
        mass = f"{solid['mass_kg']:.3f}" if "mass_kg" in solid else "–"
        lines.append(f"| {name} | {_word(solid, 'checked')} | {kept} of {len(solid['figures'])} | {mass} |")
        off += [f"- {name}: {f['what']}: {f['measured']:.6g} {f['unit']} measured, {f['wanted']:.6g} wanted, "
                f"{f['allowed']:.2g} allowed" for f in solid["figures"] if not f["ok"]]
    return _with(lines, off)


def _documents(outputs, name):
    """(folder's name, document) of every file of that name."""
    return [(path.parent.name, json.loads(path.read_text(encoding="utf-8")))
            for path in sorted(Path(outputs).glob(f"*/{name}"))]


def _word(verdict, good):
    accepted = f", accepted: {', '.join(verdict['accepted'])}" if verdict.get("accepted") else ""
    return (good if verdict["ok"] else "**rejected**") + accepted


def _with(lines, below):
    """The table with lines below it; nothing where it has no rows."""
    if len(lines) == 2:
        return []
    return lines + ([""] + below if below else [])


if __name__ == "__main__":
    print("\n".join(table(Path(sys.argv[1] if len(sys.argv) > 1 else "outputs"))))
