"""What is planned for one setup, cut again in another from which the part looks the same: a propeller's next blade.

Moves lie as the part does in its setup, so they are those of the setup that was planned; program, simulation and verdict
take the copy as any other.  What a check finds wrong in a copy is mended in what it was copied from, and copied again.
"""

from dataclasses import replace

import numpy as np

from cuspline.kernel import brep
from cuspline.values.errors import PlanError

SAME_MM = 1e-5              # between faces that are the same but for the turn


def copied(plan, setup):
    """The SetupPlan of a setup whose `planned_as` names that of another.

    Args:
        plan: SetupPlan of the setup that is named.   setup: design.Setup.
    Raises:
        PlanError: its faces do not lie as those of the other.
    """
    _refuse_another_look(plan, setup)
    placed = lambda place_mm: tuple(setup.turn.out(plan.setup.turn.into(np.array([place_mm])))[0].tolist())
    return replace(plan, setup=setup, hollow=replace(plan.hollow, place_mm=placed(plan.hollow.place_mm)),
                   inner_edges=tuple(replace(e, place_mm=placed(e.place_mm)) for e in plan.inner_edges))


def with_copies(plans):
    """The same SetupPlans, the copies among them made again of what they are copied from."""
    own = {p.setup.name: p for p in plans}
    return [copied(own[p.setup.planned_as], p.setup) if p.setup.planned_as else p for p in plans]


def _refuse_another_look(plan, setup):
    """The middle of every face must lie on a face of the other setup: what is wrong elsewhere the verdict finds."""
    context = plan.context
    faces = brep.faces_of(brep.the_solid(context.design.solid, setup.name))
    mine = brep.named_faces(faces, context.design.predicates, setup.faces)
    wanted = tuple(brep.indices_of(faces, brep.named_faces(faces, context.design.predicates, plan.setup.faces)))
    middles = setup.turn.into(np.vstack([f.middle.point_mm for f in mine]))
    off_mm = float(context.closest_of(wanted).closest_points(middles).distance_mm.max()) if len(mine) == len(wanted) else np.inf
    if off_mm > SAME_MM:
        raise PlanError(f"{setup.name} is to be cut as {plan.setup.name} is, but from there its faces "
                        + (f"lie {off_mm:.4f} mm elsewhere" if np.isfinite(off_mm) else f"are {len(mine)}, not {len(wanted)}")
                        + ": correct its wcs_x and wcs_z, its faces, or leave planned_as out")
