"""What planned paths leave is measured, and where it is too much more passes are laid.

No rule for steps sees everything: fronts that meet, rims of hollows too tight for the ball, ends of passes.
The cutter's swept bottom over the planned paths tells the height that is really left at every contact.
"""

import numpy as np

JUMP = 4.0                  # grid pitches: contacts farther apart do not follow each other
NEWTON_STEPS = 4            # along the normal: the height above is only near to the way along it
SETTLED_MM = 1e-7           # a step this small is the last
RUN_ON = 0.8                # of the step from node to node


def left_by_mm(field, swept):
    """(nx, ny) material along the normal that cutters leave at the contacts of a field; NaN outside its region.

    A few steps along the normal follow it to the height that the cutters' bottoms come to.

    Args:
        field: TipField of a cutter that reaches every contact of interest.
        swept: height fields of what cutters swept (stock_fields) in the order of the cuts, at least one; infinite where
            none of them comes.
    """
    inside = field.is_inside & np.isfinite(field.tip_z_mm)
    def over(contacts, mask):
        points, normal = contacts[mask], field.normal[mask]
        rise, off = np.maximum(normal[:, 2], 0.0), np.zeros(mask.sum())
        known, live = np.ones(len(off), bool), np.arange(len(off))
        for _ in range(NEWTON_STEPS):
            at = points[live] + off[live, None] * normal[live]
            bottom = swept[-1](at[:, :2])
            for surface in swept[-2::-1]:           # what was cut before is seldom lower
                bottom = surface(at[:, :2], bottom)
            before, known[live] = off[live], np.isfinite(bottom)
            off[live] = np.where(known[live], np.maximum(before + (bottom - at[:, 2]) * rise[live], 0.0), before)
            live = live[~known[live] | (np.abs(off[live] - before) > SETTLED_MM)]
        return np.where(known, off, np.inf)

    left = np.full(inside.shape, np.nan)
    left[inside] = over(field.contact_mm, inside)
    for axis in (0, 1):
        for way in (1, -1):
            beyond, ends = _run_on(field, inside, axis, way)
            left[ends] = np.maximum(left[ends], over(beyond, ends))
    return left


def _run_on(field, inside, axis, way):
    """Contacts run on to where the next node's would lie, and the nodes behind which no such node follows.

    There the region ends or the contact jumps over a hollow: the ground in between belongs to the pass before.
    """
    shifted = lambda grid, k: np.roll(grid, k * way, axis=axis)
    step = field.contact_mm - shifted(field.contact_mm, 1)
    close = np.linalg.norm(np.nan_to_num(step, nan=np.inf), axis=-1) < JUMP * field.pitch_mm
    behind = inside & shifted(inside, 1) & close
    follows = shifted(close, -1) & shifted(inside, -1)
    return field.contact_mm + RUN_ON * np.nan_to_num(step), behind & ~follows


def region_left(field, swept, most_mm, margin_mm, is_done=None):
    """The part of a region where cutters leave more than `most_mm`, grown by a margin in plan; None: nowhere.

    `swept`: see `left_by_mm`; none: no cutter of this direction came.   `is_done`: function of contacts and normals (n, 3) to
    (n,) bool, what other directions have finished; None: nothing.
    """
    with np.errstate(invalid="ignore"):
        seeds = left_by_mm(field, swept) > most_mm if swept else field.is_inside & np.isfinite(field.tip_z_mm)
    if is_done is not None and seeds.any():
        seeds[seeds] = ~is_done(field.contact_mm[seeds], field.normal[seeds])
    return field.narrowed(seeds, margin_mm) if seeds.any() else None
