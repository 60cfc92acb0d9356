"""First verifier: exact deviations along the design's normals at sample points."""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.simulation.swept import deviations_and_moves, signed_distance_mm
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
    row: np.ndarray               # (n,) row of PostedMoves nearest to the sample; -1 none
    spacing_mm: float

    def __post_init__(self):
        n = len(self.samples)
        for name, dtype in (("deviation_mm", float), ("reach", np.int64), ("row", np.int64)):
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


def residuals(paths, stock_min, stock_max, samples, frame, mesh, ball_radius_mm, spacing_mm):
    """Deviations and reach of all samples.

    Args:
        paths: tuple of SweptPath, WCS.   stock_min, stock_max: (3,) billet, WCS.
        samples: Samples, part coordinates.   frame: the WCS seen from the part.
        mesh: DropMesh of the design, WCS.   ball_radius_mm: smallest ball of the shop.
    """
    points, normals = frame.into(samples.points_mm), frame.turn_into(samples.normals)
    deviation, row = deviations_and_moves(paths, stock_min, stock_max, points, normals, LIMIT_MM)
    # an edge has no one normal: along its face's a hair taken off the face beside it would look as deep as that is
    # high.  There a gouge counts as far as the point lies from the nearest material.
    rim = np.flatnonzero(samples.is_border & (deviation < 0))
    deviation[rim] = np.maximum(deviation[rim], np.minimum(signed_distance_mm(paths, points[rim]), 0.0))
    return Residuals(samples=samples, deviation_mm=deviation, row=row, spacing_mm=spacing_mm,
                     reach=why_unreachable(mesh, points, normals, ball_radius_mm))


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
