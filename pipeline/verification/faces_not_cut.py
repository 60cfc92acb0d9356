"""Faces that a setup names and most of which is not cut: no cutter of the shop gets there."""

import numpy as np

from cuspline.verification.reporter import MISSED, MISSED_MM2, allowed_mm
from cuspline.verification.residuals import LIMIT_MM

ROUND, OTHER = 0.95, 0.5    # most of a face's area: of fillets and hollows, and of others


def faces_not_cut(found, faces, ball_radius_mm, finish):
    """What is not cut of such faces, in connected groups: [(k,) index into the samples].

    A fillet or an inner corner that comes out rounder than drawn is none: there a cutter went along both faces beside
    it, and what it leaves is less than its radius.

    Args:
        found: residuals.Residuals of the faces after all setups.   faces: brep.Face values that its samples speak of.
        ball_radius_mm: smallest ball of the shop.   finish: design.Finish.
    """
    samples, d = found.samples, found.deviation_mm
    missed = np.zeros(len(samples), bool)
    for k, face in enumerate(faces):
        rows = np.flatnonzero((samples.face == k) & ~found.is_top)
        area = samples.weight_mm2[rows]
        if area.sum() < MISSED_MM2:
            continue
        is_round = -face.middle.curvature_low_per_mm[0] * ball_radius_mm >= 1.0
        stands, share = (min(ball_radius_mm, LIMIT_MM), ROUND) if is_round else (MISSED * allowed_mm(finish), OTHER)
        left = ~found.is_reachable[rows] & (d[rows] >= stands)
        missed[rows[left]] = area[left].sum() >= share * area.sum()
    return found.groups(missed)
