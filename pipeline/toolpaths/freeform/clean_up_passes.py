"""What planned paths leave is measured, and where it is too much more passes are laid.

No rule for steps sees everything: fronts that meet, rims of hollows too tight for the ball, ends of passes.
The cutter's swept bottom over the planned paths tells the height that is really left at every contact.
"""

import numpy as np

from cuspline.values import fixed_math as fixed

JUMP = 4.0                  # grid pitches: contacts farther apart do not follow each other
NEWTON_STEPS = 4            # along the normal: the height above is only near to the way along it
SETTLED_MM = 1e-7           # a step this small is the last
RUN_ON = 0.8                # of the step from node to node


def is_left(field, swept, most_mm):
    """(nx, ny) bool: cutters leave more than `most_mm` along the normal at the contacts of a field's region.

    A few steps along the normal follow it to the height that the cutters' bottoms come to.  Where a cutter has been out there
    already less is left: most places ask for no more than that.

    Args:
        field: TipField of a cutter that reaches every contact of interest.
        swept: stock_fields.Lowest or AnyHeights in the order of the cuts, at least one.
    """
    left = np.zeros(field.is_inside.shape, bool)
    for nodes, contacts in _places(field):
        normal, stands = field.normal[nodes], np.arange(len(contacts))
        for lowest in reversed(swept):
            out = contacts[stands] + most_mm * normal[stands]
            stands = stands[~lowest.is_below(out[:, :2], out[:, 2])]
        nodes = tuple(axis[stands] for axis in nodes)
        left[nodes] |= _left_mm(contacts[stands], normal[stands], swept) > most_mm
    return left


def _left_mm(contacts, normal, swept):
    """(n,) left along the normals at contacts (n, 3); infinite where no cutter comes."""
    rise, off = np.maximum(normal[:, 2], 0.0), np.zeros(len(contacts))
    known, live = np.ones(len(off), bool), np.arange(len(off))
    for _ in range(NEWTON_STEPS):
        at = contacts[live] + off[live, None] * normal[live]
        bottom = swept[-1](at[:, :2])
        for lowest in swept[-2::-1]:            # what was cut before is seldom lower
            bottom = lowest(at[:, :2], bottom)
        before, known[live] = off[live], np.isfinite(bottom)
        off[live] = np.where(known[live], np.maximum(before + (bottom - at[:, 2]) * rise[live], 0.0), before)
        live = live[~known[live] | (np.abs(off[live] - before) > SETTLED_MM)]
    return np.where(known, off, np.inf)


def _places(field):
    """Nodes of the region, as indices, with the contacts (n, 3) that speak for them: their own, and those that run on."""
    inside = field.is_inside & np.isfinite(field.tip_z_mm)
    yield np.nonzero(inside), field.contact_mm[inside]
    for axis in (0, 1):
        for way in (1, -1):
            beyond, ends = _run_on(field, inside, axis, way)
            yield np.nonzero(ends), beyond[ends]


def _run_on(field, inside, axis, way):
    """Contacts run on to where the next node's would lie, and the nodes behind which no such node follows.

    There the region ends or the contact jumps over a hollow: the ground in between belongs to the pass before.
    """
    shifted = lambda grid, k: np.roll(grid, k * way, axis=axis)
    step = field.contact_mm - shifted(field.contact_mm, 1)
    close = fixed.lengths(np.nan_to_num(step, nan=np.inf)) < JUMP * field.pitch_mm
    behind = inside & shifted(inside, 1) & close
    follows = shifted(close, -1) & shifted(inside, -1)
    return field.contact_mm + RUN_ON * np.nan_to_num(step), behind & ~follows


def region_left(field, swept, most_mm, margin_mm, is_done=None):
    """The part of a region where cutters leave more than `most_mm`, grown by a margin in plan; None: nowhere.

    `swept`: as for `is_left`; none: no cutter of this direction came.   `is_done`: function of contacts and normals (n, 3) to
    (n,) bool, what other directions have finished; None: nothing.
    """
    seeds = is_left(field, swept, most_mm) if swept else field.is_inside & np.isfinite(field.tip_z_mm)
    if is_done is not None and seeds.any():
        seeds[seeds] = ~is_done(field.contact_mm[seeds], field.normal[seeds])
    return field.narrowed(seeds, margin_mm) if seeds.any() else None
