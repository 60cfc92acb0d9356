"""Findings of the process: cuts against what spindle and cutter stand."""

import numpy as np

from cuspline.process.forces import limits_of
from cuspline.values.findings import Finding


def limit_findings(posted, tools, machine, met, loads, around):
    """Cuts that take more than machine and tool state; one Finding an operation and limit, at its worst place.

    Args:
        met: engagement.Engagement.   loads: forces.Forces at its places, or None.
        around: (setup's name, its frame).
    """
    if loads is None:
        return ()
    found, (setup, frame) = [], around
    operations = posted.operation[met.row]
    for number, tool in tools.items():
        for what, unit, name, limit, where in limits_of(machine, tool):
            for operation in np.unique(operations[posted.tool[met.row] == number]).tolist():
                mine = np.flatnonzero((operations == operation) & (posted.tool[met.row] == number))
                worst = mine[getattr(loads, name)[mine].argmax()]
                amount, row = float(getattr(loads, name)[worst]), int(met.row[worst])
                if amount > limit:
                    found.append(Finding(
                        kind="process_limit", amount_mm=0.0, amount=round(amount, 3), unit=unit, row=row, setup=setup,
                        place_mm=tuple(round(float(v), 6) for v in frame.out(met.tip_mm[worst][None])[0]),
                        operation=posted.operation_name(row), line=int(posted.line[row]),
                        advice=f"{what} up to {amount:.4g} {unit}, where {where} states {limit:g} {unit}: take a smaller stepdown, "
                               "stepover or feed per tooth"))
    return tuple(found)
