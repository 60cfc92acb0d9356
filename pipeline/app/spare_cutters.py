"""Which library of smaller cutters gets to what the cutters of a plan leave: the planner's own first look says what that is.

To plan with a library takes tens of seconds; whether one of its cutters gets to a place, milliseconds.
"""

import numpy as np

from cuspline.planning.cutter_choice import cutter_reach
from cuspline.planning.level_finishing import UPRIGHT
from cuspline.surfaces.curvature import FaceSamples

ENOUGH = 0.02               # of a connected place, that one cutter gets to: with balls so small less of it counts as left
ASKED = 2000                # samples of one place, about
ASKED_OF = "flat", "bull_nose", "ball", "drill"
ROUND_MM = 0.05             # a drill larger by this does not go in where a drill makes the wall


def first_that_helps(libraries, had, plans, left):
    """Index of the first library with a cutter that gets to enough of a place that is left; None: there is none.

    Args:
        libraries: ToolLibrary values, each with the tools of the one before.   had: the ToolLibrary of the plans.
        plans: SetupPlan values.
        left: of every plan [(points (n, 3) mm, normals (n, 3)) of a place, part coordinates].
    """
    numbers = {t.number for t in had.tools}
    for k, library in enumerate(libraries):
        new = [t for t in library.tools if t.number not in numbers and t.cutter.type in ASKED_OF]
        if any(_gets_there(plan.context, new, *place) for plan, places in zip(plans, left) for place in places):
            return k
        numbers |= {t.number for t in library.tools}
    return None


def _gets_there(work, tools, points_mm, normals):
    """Whether one of some Tools gets to enough of a place, its neck and holder clear."""
    every = slice(None, None, max(1, len(points_mm) // ASKED))
    samples = _samples(work.setup.turn.into(points_mm[every]), work.setup.turn.turn_into(normals[every]))
    for tool in tools:
        reach = cutter_reach(samples, work.mesh, tool.cutter)
        touched = reach.is_reached & _is_driven(samples, work.mesh, tool.cutter)
        clear = work.missing_mm(tool, reach.tip_mm[touched]) <= 0.0 if touched.any() else np.zeros(0)
        if np.sum(clear) >= ENOUGH * len(touched):
            return True
    return False


def _is_driven(samples, mesh, cutter):
    """(n,) bool: places that a cutter makes where it touches them; a drill only walls between which a larger one does not go."""
    if cutter.type != "drill":
        return np.ones(len(samples.normal), bool)
    larger = cutter.model_copy(update={"diameter_mm": cutter.diameter_mm + 2 * ROUND_MM})
    return (np.abs(samples.normal[:, 2]) < UPRIGHT) & ~cutter_reach(samples, mesh, larger).is_reached


def _samples(points_mm, normals):
    nothing = np.zeros(len(points_mm))
    return FaceSamples(point_mm=points_mm, normal=normals, hollow_per_mm=nothing, across_per_mm=nothing, area_mm2=nothing,
                       face=nothing.astype(int))
