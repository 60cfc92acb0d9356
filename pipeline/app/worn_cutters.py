"""Programs whose contours the control shifts, judged once more with a worn cutter and its radius, as measured, in the register.

With the register set to what the cutter measures the wall is where it was: the programs are read and cut again with the
smallest radius that their operations allow, and the walls are looked at by the first verifier.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.values.findings import Finding
from cuspline.verification.verdict import first_look

WORN = 100_000              # added to the number of a tool while it cuts a shifted contour worn: the library ends below
OF_WALLS = ("gouge", "excess", "missing_area")


@dataclass(frozen=True, eq=False, kw_only=True)
class WornLook:
    """What the first verifier sees with worn cutters."""

    radii_mm: dict                      # tool number -> radius in its register
    numbers: tuple[dict, ...]           # of the contract, one a setup
    findings: tuple[Finding, ...]

    def as_dict(self):
        """For verify.json."""
        return {"radii_mm": {f"D{n}": round(r, 6) for n, r in self.radii_mm.items()},
                **{k: max(n[k] for n in self.numbers) for k in ("gouge_max_mm", "excess_max_mm")}}


def worn_tools(programs, tools, worn_mm):
    """{number: Tool} of the tools that cut shifted contours, worn as far as their operations allow.

    Args:
        programs: verdict.SetupProgram values.   tools: {number: cutters.Tool}.   worn_mm: {name of an operation: mm}.
    """
    worn = {}
    for posted in (program.posted for program in programs):
        for row in np.flatnonzero(posted.radius_register > 0).tolist():
            number, by = int(posted.tool[row]), worn_mm.get(posted.operation_name(row), 0.0)
            if by > 0 and number in tools:
                worn[number] = max(by, worn.get(number, 0.0))
    return {n: _worn(tools[n], by) for n, by in worn.items()}


def _worn(tool, by_mm):
    """A tool whose cutter is thinner by so much on its radius."""
    c = tool.cutter
    thin = c.diameter_mm - 2 * by_mm
    return tool.model_copy(update={"cutter": c.model_copy(update={
        "diameter_mm": thin, "neck_diameter_mm": min(thin, c.neck_diameter_mm)})})


def worn_look(programs, posted_of, worn, solid, judging, found):
    """WornLook at programs.

    Args:
        programs: verdict.SetupProgram values.   posted_of: function {number: Tool} -> [PostedMoves], the programs read with these.
        worn: {number: Tool}.   solid: see verdict.   judging: verdict.Judging with the cutters as they are.
        found: kinds of finding that the programs have anyway.
    """
    judging.say(f"once more with {', '.join(f'D{n} at {t.cutter.radius_mm:g} mm' for n, t in worn.items())}")
    again = [replace(p, posted=replace(moves, tool=np.where(moves.radius_register > 0, moves.tool + WORN, moves.tool)))
             for p, moves in zip(programs, posted_of(worn))]
    tools = judging.tools | {n + WORN: t.simulated for n, t in worn.items()}
    drafts = first_look(again, solid, replace(judging, tools=tools)).drafts()
    said = ", ".join(f"{t.cutter.radius_mm:g} mm in D{n}" for n, t in worn.items())
    wrong = [replace(f, advice=f"with a worn cutter, and its radius of {said}: {f.advice}")
             for d in drafts for f in d.findings if f.kind in OF_WALLS and f.kind not in found]
    return WornLook(radii_mm={n: t.cutter.radius_mm for n, t in worn.items()}, numbers=tuple(d.numbers for d in drafts),
                    findings=tuple(wrong))
