"""First verifier: exact deviations along the design's normals at sample points."""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.simulation.swept import signed_distance_mm
from cuspline.verification.reach import REACHABLE, REASONS, why_unreachable
from cuspline.verification.clusters import clusters_of
from cuspline.verification.samples import Samples

LIMIT_MM = 2.0            # deviations are capped here: far more than any tolerance
PER_SPACING2 = 17.0       # samples on a square of one spacing
TARGET = 200_000          # samples wanted on one setup


@dataclass(frozen=True, eq=False, kw_only=True)
class Residuals:
    """What the stock leaves at each sample, part coordinates."""

    samples: Samples
    deviation_mm: np.ndarray      # (n,) positive left, negative gouged
    reach: np.ndarray             # (n,) REACHABLE, or why not
    row: np.ndarray               # (n,) row of the clamping's PostedMoves nearest to the sample; -1 none
    is_own: np.ndarray            # (n,) bool: this clamping's moves made the deviation, no other's
    spacing_mm: float

    def __post_init__(self):
        n = len(self.samples)
        for name, dtype in (("deviation_mm", float), ("reach", np.int64), ("row", np.int64), ("is_own", bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), (n,), name, dtype))

    @property
    def is_reachable(self):
        return self.reach == REACHABLE

    def area_mm2(self, mask):
        """Area that the chosen samples stand for."""
        return float(self.samples.weight_mm2[mask].sum())

    def groups(self, mask):
        """Index arrays of connected groups of the chosen samples."""
        chosen = np.flatnonzero(mask)
        return [chosen[g] for g in clusters_of(self.samples.points_mm[chosen], 2 * self.spacing_mm)]


def default_spacing_mm(area_mm2):
    """Sample spacing that gives about TARGET samples, between 0.1 and 1 mm."""
    return float(np.clip(np.sqrt(PER_SPACING2 * area_mm2 / TARGET), 0.1, 1.0))


def residuals(piece, parts, drops, ball_radius_mm, spacings_mm):
    """Deviations and reach of all samples, clamping by clamping.

    Args:
        piece: workpiece.Workpiece after all clampings.
        parts: one Samples a clamping, of the faces that it cuts; part coordinates.
        drops: one DropMesh of the design a clamping, in its WCS.   ball_radius_mm: smallest ball of the shop.
        spacings_mm: of each clamping's samples.
    Returns:
        list of (Residuals of its faces after all clampings, Residuals of all faces after it alone).
    """
    together = Samples.joined(parts)
    points, normals = together.points_mm, together.normals
    each, rows = piece.deviations_of_cuts(points, normals, LIMIT_MM)
    final, maker = piece.deviations(points, normals, LIMIT_MM, each)
    depth = [_at_rims(d, together, c.paths, c.frame) for d, c in zip(each, piece.cuts)]
    final = np.where(together.is_border, np.maximum(final, np.min(depth, axis=0)), final) if len(piece.cuts) > 1 else depth[0]
    ends, found = np.cumsum([0] + [len(p) for p in parts]), []
    for k, (mine, cut, drop) in enumerate(zip(parts, piece.cuts, drops)):
        here = slice(ends[k], ends[k + 1])
        reach = why_unreachable(drop, cut.frame.into(mine.points_mm), cut.frame.turn_into(mine.normals), ball_radius_mm)
        after_all = Residuals(samples=mine, deviation_mm=final[here], row=rows[k, here], is_own=maker[here] == k, reach=reach,
                              spacing_mm=spacings_mm[k])
        alone = Residuals(samples=together, deviation_mm=depth[k], row=rows[k], is_own=np.ones(len(together), bool),
                          reach=np.full(len(together), REACHABLE), spacing_mm=spacings_mm[k])
        found.append((after_all, alone))
    return found


def _at_rims(deviation, samples, paths, frame):
    """Deviations with gouges at the faces' rims measured another way.

    An edge has no one normal: along its face's a hair taken off the face beside it would look as deep as that is high.
    There a gouge counts as far as the point lies from the nearest material.
    """
    out = deviation.copy()
    rim = np.flatnonzero(samples.is_border & (out < 0))
    out[rim] = np.maximum(out[rim], np.minimum(signed_distance_mm(paths, frame.into(samples.points_mm[rim])), 0.0))
    return out


def weighted_percentile(values, weights, share):
    """Smallest value below which at least `share` of the weight lies; 0 without weight."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    if not len(total) or total[-1] <= 0:
        return 0.0
    return float(values[order][np.searchsorted(total, share * total[-1])])


def unreachable_places(found):
    """Where no ball can go: area, box (part coordinates) and reason of each connected group, largest first."""
    places = []
    for reason in (1, 2):
        for group in found.groups(found.reach == reason):
            points = found.samples.points_mm[group]
            middle = points[((points - points.mean(axis=0)) ** 2).sum(axis=1).argmin()]
            places.append({"place_mm": middle.round(6).tolist(), "area_mm2": round(float(found.samples.weight_mm2[group].sum()), 6),
                           "min_mm": points.min(axis=0).round(6).tolist(),
                           "max_mm": points.max(axis=0).round(6).tolist(),
                           "reason": REASONS[reason],
                           "largest_deviation_mm": round(float(found.deviation_mm[group].max()), 6)})
    return sorted(places, key=lambda p: (-p["area_mm2"], p["min_mm"]))
