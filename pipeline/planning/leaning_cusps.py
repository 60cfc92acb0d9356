"""The cusps that passes of a leaning cutter leave, on the common planes of neighbouring contacts, from its positions as they are.

At contacts taken evenly of all, the nearest contact to the right of the feed is the neighbour, where its pass runs along or
against this one.  Both passes' traces follow from tips and axes as far before and behind as the cutter's ring reaches into
their plane.  Where a pass runs beyond the faces, or turns, nothing is measured.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.scallop.common_plane import CommonPlane, close_outline_mm, common_plane_cusp_mm, trace_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError

LOOKED_AT = 160             # contacts
APART_SHARE = 0.02          # of the step, between places of a pass
ASIDE_SHARE = 0.05          # of the step, that a neighbour may lie before or behind
NEAREST_SHARE, FARTHEST_SHARE = 0.3, 1.8        # of the step, that it lies to the right
REACH_RADII = 0.6           # of a pass, before and behind a contact
BESIDE = 0.95               # cosine of the angle between passes that run beside each other
BEYOND_MM = 1e-3            # off where the contact would have the tip: beyond an edge
SMALL = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class _Places:
    """Places of all passes, close together, one pass after the other."""

    tip_mm: np.ndarray          # (n, 3)
    axis: np.ndarray            # (n, 3)
    contact_mm: np.ndarray      # (n, 3)
    normal: np.ndarray          # (n, 3)
    run: np.ndarray             # (n,) of moves in the cut
    along_mm: np.ndarray        # (n,) from where it begins
    feed: np.ndarray            # (n, 3) unit; 0 where a run begins and ends, or its contact stands

    @classmethod
    def of(cls, found, corner, apart_mm):
        """Of a Leaning, its CornerContact, those beyond the faces left out."""
        m, axes = found.moves, np.vstack([found.moves.axis[:1], found.moves.axis])
        columns = [np.vstack([m.start_mm, m.end_mm]), axes, found.middle_mm - found.ball_radius_mm * found.normal, found.normal]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], found.is_cut, [False]]).astype(int))).reshape(-1, 2)
        parts = []
        for number, (first, end) in enumerate(edges):
            own = [c[first:end + 1] for c in columns]
            at = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(own[2], axis=0) ** 2).sum(axis=1)))])
            even = np.linspace(0.0, at[-1], max(math.ceil(at[-1] / apart_mm), 1) + 1)
            between = [np.column_stack([np.interp(even, at, c[:, k]) for k in range(3)]) for c in own]
            parts.append([*between, np.full(len(even), number), even])
        tip, axis, contact, normal, run, along = (np.concatenate(column) for column in zip(*parts))
        unit = lambda v: v / np.maximum(np.sqrt((v * v).sum(axis=1)), SMALL)[:, None]
        axis, normal, feed = unit(axis), unit(normal), np.zeros_like(contact)
        feed[1:-1] = unit(contact[2:] - contact[:-2]) * ((run[2:] == run[:-2]) & (along[2:] > along[:-2]))[:, None]
        off = tip - contact - found.ball_radius_mm * normal - corner.tips_off(normal, axis)
        feed[(off * off).sum(axis=1) > BEYOND_MM ** 2] = 0.0
        return cls(tip_mm=tip, axis=axis, contact_mm=contact, normal=normal, run=run, along_mm=along, feed=feed)

    def near(self, place, reach_mm):
        """Tips and axes of a pass round one of its places."""
        rows = np.flatnonzero((self.run == self.run[place]) & (np.abs(self.along_mm - self.along_mm[place]) <= reach_mm))
        return self.tip_mm[rows], self.axis[rows]


def cusps_mm(found, corner, cutter, step_mm):
    """Cusps between neighbouring passes.

    Args:
        found: five_axis.leaning_moves.Leaning.   corner: its CornerContact.   cutter: shop.cutters.Cutter.
        step_mm: about how far passes lie apart.
    Returns:
        (k,) mm, (k, 3) the contacts to the right of which they stand; none where no pass has a neighbour.
    """
    places = _Places.of(found, corner, APART_SHARE * step_mm)
    tree, outline, reach = cKDTree(places.contact_mm), close_outline_mm(cutter.profile), REACH_RADII * cutter.radius_mm
    known = np.flatnonzero((places.feed != 0.0).any(axis=1))
    looked = known[np.unique(np.linspace(0, len(known) - 1, LOOKED_AT).astype(int))] if len(known) else known
    pairs = [(a, b) for a in looked if (b := _beside(a, places, tree, step_mm)) is not None]
    found_mm, contacts = [], []
    for a, b in pairs:
        normals, ends = places.normal[[a, b]], places.contact_mm[[a, b]]
        try:
            plane = CommonPlane.of(ends, normals)
        except PlanError:
            continue
        bend = float(fixed.matmul(normals[1] - normals[0], plane.along) / plane.width_mm)
        traces = [trace_mm(plane, outline, *places.near(row, reach)) for row in (a, b)]
        found_mm.append(common_plane_cusp_mm(plane, traces, bend))
        contacts.append(ends[0])
    return np.array(found_mm), np.array(contacts).reshape(-1, 3)


def _beside(row, places, tree, step_mm):
    """The contact of the neighbouring pass to the right; None: there is none."""
    rows = np.array(tree.query_ball_point(places.contact_mm[row], FARTHEST_SHARE * step_mm))
    way, feed = places.contact_mm[rows] - places.contact_mm[row], places.feed[row]
    aside = fixed.matmul(way, np.cross(feed, places.normal[row]))
    fits = (aside > NEAREST_SHARE * step_mm) & (np.abs(fixed.matmul(way, feed)) < ASIDE_SHARE * step_mm) & (
        np.abs(fixed.matmul(places.feed[rows], feed)) > BESIDE)
    return None if not fits.any() else int(rows[fits][np.argmin(aside[fits])])
