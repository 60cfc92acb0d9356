"""What planned paths leave is measured, and where it is too much more passes are laid.

No rule for steps sees everything: fronts that meet, rims of hollows too tight for the ball, ends of passes.
The cutter's swept bottom over the planned paths tells the height that is really left at every contact.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from cuspline.toolpaths.dropcutter import DropMesh, drop_tips_mm

JUMP = 4.0                  # grid pitches: contacts farther apart do not follow each other
NEWTON_STEPS = 4            # along the normal: the height above is only near to the way along it
RUN_ON = 0.8                # of the step from node to node
LONGEST_MM = 4.0            # chords are split for the tree: long ones have loose bounds


@dataclass(frozen=True, eq=False, kw_only=True)
class Cut:
    """Tips that a cutter runs through, and the cutter."""

    lines: tuple                # of (k, 3) polylines of tips
    radius_mm: float
    corner_radius_mm: float

    @classmethod
    def of_paths(cls, paths, dropper):
        """TipPath values cut by the true cutter of a dropper."""
        return cls(lines=tuple(p.tips_mm for p in paths), radius_mm=dropper.radius_mm,
                   corner_radius_mm=dropper.corner_radius_mm)

    def surface_mm(self):
        """Function (n, 2) -> (n,) lowest height that the cutter's bottom comes to over places; inf where it never does."""
        chords = np.concatenate([_chords(line) for line in self.lines]) * np.array([1.0, 1.0, -1.0])
        path = DropMesh.from_triangles(chords[:, [0, 1, 1]].reshape(-1, 3), np.arange(3 * len(chords)).reshape(-1, 3))
        return lambda xy: -drop_tips_mm(path, np.ascontiguousarray(xy), self.radius_mm, self.corner_radius_mm)


def left_by_mm(field, cuts):
    """(nx, ny) material along the normal that cuts leave at the contacts of a field; NaN outside its region.

    The cutter's bottom stands p(d) above its tip: the lowest of z + p(d) over the paths is minus the drop of
    the same cutter onto the paths turned upside down.  A few steps along the normal follow it to that height.

    Args:
        field: TipField of a cutter that reaches every contact of interest.
        cuts: Cut values, at least one; infinite where none of them comes.
    """
    inside = field.is_inside & np.isfinite(field.tip_z_mm)
    surfaces = [cut.surface_mm() for cut in cuts]
    def over(contacts, mask):
        points, normal = contacts[mask], field.normal[mask]
        rise, off = np.maximum(normal[:, 2], 0.0), np.zeros(mask.sum())
        for _ in range(NEWTON_STEPS):
            at = points + off[:, None] * normal
            bottom = np.min([surface(at[:, :2]) for surface in surfaces], axis=0)
            known = np.isfinite(bottom)
            off[known] = np.maximum(off[known] + (bottom[known] - at[known, 2]) * rise[known], 0.0)
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


def _chords(tips):
    """(m, 2, 3) straight pieces of a path, none longer than LONGEST_MM."""
    starts, ends = tips[:-1], tips[1:]
    counts = np.maximum(np.ceil(np.linalg.norm(ends - starts, axis=1) / LONGEST_MM), 1).astype(int)
    row = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    at = lambda k: starts[row] + (k / counts[row])[:, None] * (ends - starts)[row]
    return np.stack([at(number), at(number + 1)], axis=1)


def region_left(field, cuts, most_mm, margin_mm):
    """The part of a region where cuts leave more than `most_mm`, grown by a margin in plan; None: nowhere."""
    with np.errstate(invalid="ignore"):
        seeds = left_by_mm(field, cuts) > most_mm
    if not seeds.any():
        return None
    away = distance_transform_edt(~seeds) * field.pitch_mm - margin_mm
    return replace(field, rest_mm=np.maximum(away, field.rest_mm), is_inside=field.is_inside & (away <= 0.0))
