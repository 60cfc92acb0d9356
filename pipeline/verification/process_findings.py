"""What the edges meet, and findings of it: cuts against what spindle and cutter stand, chatter, drives against the posted path."""

from dataclasses import dataclass

import numpy as np

from cuspline.process.chatter import limits_mm
from cuspline.process.cut_of_operations import edge_changes, met_at_places, process_document, turned_rpm, with_holes
from cuspline.process.drives import Drives, deviations_mm, following_error_mm
from cuspline.process.engagement import engagement
from cuspline.process.forces import forces, limits_of
from cuspline.process.hole_forces import hole_loads
from cuspline.program.program import Kind
from cuspline.values.amounts import counted
from cuspline.values.findings import Finding

NAME, MOST = 2, 3          # of a row of forces.limits_of: field that it limits, by how much


@dataclass(frozen=True, eq=False, kw_only=True)
class Process:
    """Of one program."""

    findings: tuple[Finding, ...]
    document: dict              # verify.json's "process"
    places: dict                # name -> (n,), see cut_of_operations.met_at_places


def process_of(posted, judging, stock, rows, around):
    """The Process of a program.

    Args:
        posted: PostedMoves.   judging: verdict.Judging: its tools, machine and material.   stock: scene.FoundStock.
        rows: of the moves that leave the surface, see `drive_findings`.   around: (setup's name, its frame).
    """
    tools, machine, name = judging.tools, judging.machine, judging.material
    met, material = engagement(posted, tools, stock), judging.force
    loads = None if material is None else forces(posted, tools, met, material)
    source = f"no cutting force is known of {name or 'the material'}" if material is None else material.source
    shaken, chatter = chatter_findings(posted, tools, met, material, around)
    strays, drives = drive_findings(posted, machine, rows, around[0])
    change = None if machine is None else machine.spindle.turns_faster_rpm_per_s
    places = met_at_places(posted, met, turned_rpm(posted, change), loads)
    whole = tools if judging.whole_tools is None else judging.whole_tools
    holes = hole_loads(posted, whole, judging.hole_force)
    blind = tuple(n for n, tool in whole.items() if tool.cutter.threads)
    document = with_holes(process_document(posted, tools, met, places, loads, source, change), posted, met, holes, blind)
    found = (*limit_findings(posted, tools, machine, met, loads, around), *hole_findings(posted, whole, machine, holes, around))
    return Process(places=places, findings=(*found, *shaken, *strays),
                   document={**document, "chatter": chatter, "drives": drives, "edges": edge_changes(posted, met, judging.life)})


def limit_findings(posted, tools, machine, met, loads, around):
    """Cuts that take more than machine and tool state; one Finding an operation and limit, at its worst place.

    Args:
        met: engagement.Engagement.   loads: forces.Forces at its places, or None.
        around: (setup's name, its frame).
    """
    if loads is None:
        return ()
    found, operations = [], posted.operation[met.row]
    for number, tool in tools.items():
        for limit in limits_of(machine, tool):
            for operation in np.unique(operations[posted.tool[met.row] == number]).tolist():
                mine = np.flatnonzero((operations == operation) & (posted.tool[met.row] == number))
                of_cut = getattr(loads, limit[NAME])
                worst = mine[of_cut[mine].argmax()]
                if of_cut[worst] > limit[MOST]:
                    found.append(_beyond(limit, float(of_cut[worst]), posted, int(met.row[worst]), met.tip_mm[worst], around,
                                         "take a smaller stepdown, stepover or feed per tooth"))
    return tuple(found)


def hole_findings(posted, tools, machine, holes, around):
    """Drills and taps that take more than machine and tool state; one Finding an operation and limit.

    Args:
        tools: {number: Tool} as they are.   holes: hole_forces.HoleLoad.   around: (setup's name, its frame).
    """
    found = []
    for load in holes:
        for limit in limits_of(machine, tools[load.tool]):
            amount = getattr(load, limit[NAME], None)
            if amount is not None and amount > limit[MOST]:
                found.append(_beyond(limit, amount, posted, load.row, posted.end_mm[load.row], around, "mill the thread"
                                     if load.does == "tap" else "take a lower feed, or drill a smaller hole first"))
    return tuple(found)


def _beyond(limit, amount, posted, row, place_mm, around, advice):
    """The Finding about a limit, a row of forces.limits_of, that a move goes beyond at a place (3,) in its setup."""
    (what, unit, _, most, where), (setup, frame) = limit, around
    return Finding(
        kind="process_limit", amount_mm=0.0, amount=round(amount, 3), unit=unit, row=row, setup=setup,
        place_mm=tuple(round(float(v), 6) for v in frame.out(place_mm[None])[0]), operation=posted.operation_name(row),
        line=int(posted.line[row]), advice=f"{what} up to {amount:.4g} {unit}, where {where} states {most:g} {unit}: {advice}")


def chatter_findings(posted, tools, met, material, around):
    """Cuts deeper than a tool stands without chatter; one Finding an operation, at its deepest place.

    Args:
        material: shop.cutting_forces.CuttingForce, or None.   around: (setup's name, its frame).
    Returns:
        findings; what verify.json says of it.
    """
    limits, found, (setup, frame) = limits_mm(tools, material), [], around
    operations, depth = posted.operation[met.row], met.depth_mm
    for number, limit in limits.items():
        for operation in np.unique(operations[posted.tool[met.row] == number]).tolist():
            mine = np.flatnonzero((operations == operation) & (posted.tool[met.row] == number))
            worst = mine[depth[mine].argmax()]
            row = int(met.row[worst])
            if depth[worst] > limit:
                lines = np.unique(posted.line[met.row[mine[depth[mine] > limit]]])
                found.append(Finding(
                    kind="chatter", amount_mm=round(float(depth[worst]), 6), row=row, setup=setup,
                    place_mm=tuple(round(float(v), 6) for v in frame.out(met.tip_mm[worst][None])[0]),
                    operation=posted.operation_name(row), line=int(posted.line[row]),
                    advice=f"the edge is in the cut over {depth[worst]:.3f} mm, T{number} begins to chatter at {limit:.3f} mm: "
                           f"take a smaller stepdown, or begin the slope from above ({counted(len(lines), 'line')})"))
    unknown = sorted({int(t) for t in np.unique(posted.tool[met.row])} - set(limits))
    words = {"limit_mm": {f"T{n}": round(limit, 6) for n, limit in sorted(limits.items())}}
    return tuple(found), {**words, **({"not_checked": [f"T{n}" for n in unknown]} if unknown else {})}


def drive_findings(posted, machine, rows, setup):
    """Moves that leave the final surface, and from which the drives stray farther than the machine's control may.

    Args:
        rows: of the moves that leave the surface; -1 is none.
    Returns:
        one Finding an operation, at its worst move; what verify.json says of it.
    """
    drives = Drives.of(machine)
    if drives is None:
        return (), "not checked: the machine's file states no time_constant_s of X, Y and Z, or the machine has rotary axes"
    limit, found = machine.control.path_tolerance_mm, []
    surface = np.zeros(len(posted), bool)
    surface[rows[rows >= 0]] = True
    surface &= posted.kind != Kind.RAPID
    off = np.where(surface, deviations_mm(posted, drives), 0.0)
    for operation in np.unique(posted.operation[surface]).tolist():
        row = int(np.where(posted.operation == operation, off, 0.0).argmax())
        if off[row] > limit:
            kept = posted.feed_mm_per_min[row] * limit / off[row]
            found.append(Finding(
                kind="following_error", amount_mm=round(float(off[row]), 6), place_mm=None, row=row, setup=setup,
                operation=posted.operation_name(row), line=int(posted.line[row]),
                advice=f"the drives stray from the path by more than the {limit:g} mm that the control may: F{kept:.0f} keeps "
                       "to it here"))
    lag = following_error_mm(float(posted.feed_mm_per_min[surface].max(initial=0.0)), float(drives.time_constants_s.max()))
    return tuple(found), {"deviation_mm": round(float(off.max(initial=0.0)), 6), "allowed_mm": limit,
                          "line": int(posted.line[off.argmax()]) if len(off) else 0, "following_error_mm": round(lag, 6)}
