"""Curves in plan that a cutter follows, all of an operation on one common length scale."""

from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

APART_MM = 1.0              # between the ends of two curves on the common scale
SAME_POINT_MM = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaneCurve:
    """A polyline in plan; a closed one does not repeat its first point."""

    xy_mm: np.ndarray           # (m, 2)
    is_closed: bool = False

    def __post_init__(self):
        object.__setattr__(self, "xy_mm", frozen(self.xy_mm, (None, 2), "xy_mm"))

    @property
    def line_mm(self):
        """(m or m + 1, 2) with the first point repeated where closed."""
        return np.vstack([self.xy_mm, self.xy_mm[:1]]) if self.is_closed else self.xy_mm

    def opened_at(self, place_mm):
        """The same closed curve as an open one that begins and ends at a length along it."""
        ring = self.line_mm
        along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))]
        cut = np.array([np.interp(place_mm, along, ring[:, k]) for k in (0, 1)])
        after, before = ring[along > place_mm], ring[:-1][along[:-1] < place_mm]
        return PlaneCurve(xy_mm=np.vstack([cut, after, before[1:], cut] if len(before) else [cut, after[:-1], cut]))


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveScale:
    """Curves laid end to end, each a stretch of one length scale; closed ones return to their start."""

    along_mm: np.ndarray        # (m,) rising; stretches of different curves lie APART_MM apart
    points_mm: np.ndarray       # (m, 2)
    curve: np.ndarray           # (m,) index of the curve of each point

    @classmethod
    def of(cls, curves):
        """PlaneCurve values laid end to end in their order.

        Raises:
            ToolpathError: a curve without length.
        """
        rows, along, owner, base = [], [], [], 0.0
        for k, c in enumerate(curves):
            p = c.line_mm
            step = np.linalg.norm(np.diff(p, axis=0), axis=1)
            keep = np.r_[True, step > SAME_POINT_MM]
            if keep.sum() < 2:
                raise ToolpathError(f"curve {k} has no length: a pass needs two different points", rows=[k])
            p = p[keep]
            length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]
            rows.append(p)
            along.append(base + length)
            owner.append(np.full(len(p), k))
            base += length[-1] + APART_MM
        return cls(along_mm=frozen(np.concatenate(along), (None,), "along_mm"),
                   points_mm=frozen(np.vstack(rows), (None, 2), "points_mm"),
                   curve=frozen(np.concatenate(owner), (None,), "curve", int))

    def at(self, along_mm):
        """(n, 2) points at lengths on the scale."""
        return np.column_stack([np.interp(along_mm, self.along_mm, self.points_mm[:, k]) for k in (0, 1)])

    def stations(self, spacing_mm):
        """(lengths (n,), curve (n,)): every point of the polylines and others between, no further apart than asked."""
        step = np.diff(self.along_mm)
        parts = np.where(np.diff(self.curve) == 0, np.maximum(np.ceil(step / spacing_mm - 1e-9), 1), 1).astype(int)
        first = np.repeat(np.arange(len(step)), parts)
        number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        along = self.along_mm[first] + number / parts[first] * step[first]
        return np.r_[along, self.along_mm[-1]], np.r_[self.curve[first], self.curve[-1]]
