"""The verdict region by region: of the faces that a design calls one name, what is reached, left and gouged."""

import numpy as np

from cuspline.verification.reach import FINISHABLE, REASONS
from cuspline.verification.reporter import MISSED, NOISE_MM, allowed_mm, rounded
from cuspline.verification.residuals import weighted_percentile


def regions(setups, names):
    """One dict a name for verify.json, in the order of the names; regions that nobody judges are left out.

    Args:
        setups: verdict.SetupVerdict values: a face is judged by one of them after all have cut.
        names: {name: numbers of faces in the solid's order}.
    """
    weight, deviation, reach, face = (np.concatenate(columns) for columns in zip(*(_columns(s) for s in setups)))
    finish = setups[0].finish
    chosen = {name: np.flatnonzero(np.isin(face, list(numbers))) for name, numbers in names.items()}
    return [_region(name, weight[rows], deviation[rows], reach[rows], finish) for name, rows in chosen.items() if len(rows)]


def _columns(setup):
    """(area, deviation, reach, number of its face) (n,) each of a setup's samples."""
    found = setup.residuals
    return found.samples.weight_mm2, found.deviation_mm, found.reach, np.array(setup.required)[found.samples.face]


def _region(name, weight, deviation, reach, finish):
    fair = np.isin(reach, FINISHABLE)
    finished = fair & (deviation <= MISSED * allowed_mm(finish))
    cut = fair & (deviation <= allowed_mm(finish) + NOISE_MM)
    off = sorted({REASONS[r] for r in reach[~fair].tolist()})
    return {"name": name, "area_required_mm2": rounded(weight.sum()), "area_reached_mm2": rounded(weight[cut].sum()),
            "area_unreachable_mm2": rounded(weight[~fair].sum()), "why": "; ".join(off),
            "cusp_max_mm": rounded(deviation[finished].max(initial=0.0)),
            "cusp_p99_mm": rounded(max(0.0, weighted_percentile(deviation[finished], weight[finished], 0.99))),
            "gouge_max_mm": rounded(max(0.0, -deviation.min(initial=0.0)))}
