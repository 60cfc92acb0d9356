"""Verdict table in Markdown, out of outputs/*/verify.json; standard library only."""

import json
import sys
from pathlib import Path

COLUMNS = (("gouge, mm", "gouge_max_mm", "{:.4f}"), ("cusp, mm", "cusp_max_mm", "{:.4f}"),
           ("error bound, mm", "error_bound_mm", "{:.5f}"), ("points", "points_checked", "{:,}"))


def table(outputs):
    """Lines of the table: one design a row, the findings below."""
    lines = ["| part | verdict | " + " | ".join(c[0] for c in COLUMNS) + " | reached, mm² | findings |",
             "|---|---|" + "---|" * (len(COLUMNS) + 2)]
    findings = []
    for path in sorted(outputs.glob("*/verify.json")):
        verdict = json.loads(path.read_text(encoding="utf-8"))
        numbers = ["unknown" if verdict[key] is None else form.format(verdict[key]) for _, key, form in COLUMNS]
        reached = f"{verdict['area_reached_mm2']:.1f} of {verdict['area_required_mm2']:.1f}"
        accepted = f", accepted: {', '.join(verdict['accepted'])}" if verdict.get("accepted") else ""
        word = ("verified" if verdict["ok"] else "**rejected**") + accepted
        lines.append(f"| {path.parent.name} | {word} | {' | '.join(numbers)} | {reached} | {len(verdict['findings'])} |")
        findings += [f"- {path.parent.name}, {f['setup']}: {f['kind']} {f['amount_mm']:.4f} mm: {f['advice']}"
                     for f in verdict["findings"]]
    if len(lines) == 2:
        return ["no part has a verdict: outputs/ holds no verify.json"]
    return lines + ([""] + findings if findings else [])


if __name__ == "__main__":
    print("\n".join(table(Path(sys.argv[1] if len(sys.argv) > 1 else "outputs"))))
