"""Deviations along normals, where the stock is a shape and not a box along the WCS: lines through the shape meet cuts.

Along a line the kernels know what is cut in endless material; the shape adds where material begins and ends:

    stock end        point          begins  ends        -normal -->
    ────┤░░░░░░░░░░░░░░●░░░░░        │░░░░░░░│          ahead = 0 where the point lies beside the stock
        └──── ahead ───┘└── ends ────────────┘
"""

from dataclasses import dataclass

import numpy as np

from cuspline.stock.tracing import CLOSE_MM

BESIDE_MM = 1e-6          # a line that runs so near beside the material, in a wall of it, counts as one in it


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """The material of a shape at points, along lines through them; of several stretches the one that counts."""

    ahead_mm: np.ndarray      # (n,) along +normal to where it ends; 0 where the point lies beside it
    begins_mm: np.ndarray     # (n,) along -normal to where it begins: 0 where the point lies in it, inf: nowhere
    ends_mm: np.ndarray       # (n,) along -normal to where it ends then

    @classmethod
    def of(cls, shape, points_mm, normals):
        """Of points on a part's surface, material behind them; what lies beside the shape by a hair lies in it."""
        out = cls._straight(shape, points_mm, normals)
        beside = np.flatnonzero(out.begins_mm > 0)
        for aside in _sideways(normals[beside], shape.error_mm + BESIDE_MM):
            still = np.flatnonzero(out.begins_mm[beside] > 0)
            rows = beside[still]
            near = cls._straight(shape, points_mm[rows] + aside[still], normals[rows])
            found = near.begins_mm == 0
            for name in ("ahead_mm", "begins_mm", "ends_mm"):
                getattr(out, name)[rows[found]] = getattr(near, name)[found]
        return out

    @classmethod
    def _straight(cls, shape, points_mm, normals):
        spans, spare = shape.along(points_mm, normals), max(CLOSE_MM, shape.error_mm)
        first, last = spans[..., 0], spans[..., 1]
        has_it = (first < 0) & (last > -spare)
        is_behind = has_it | (last < 0)                 # growing: the last one that is behind is the nearest
        nearest = spans.shape[1] - 1 - is_behind[:, ::-1].argmax(axis=1)
        rows = np.arange(len(spans))
        inside, any_behind = has_it[rows, nearest], is_behind.any(axis=1)
        last, first = last[rows, nearest], first[rows, nearest]
        return cls(ahead_mm=np.where(inside, np.maximum(last, 0.0), 0.0),
                   begins_mm=np.where(inside, 0.0, np.where(any_behind, -last, np.inf)),
                   ends_mm=np.where(any_behind, -first, np.inf))

    def cut(self, free_mm, limit_mm, free_at):
        """Deviations (n,) that cuts leave in it, from those in endless material.

        Args:
            free_mm: (n,) in endless material.   limit_mm: longest of all.
            free_at: function of rows and how far along -normal to deviations there, in endless material.
        """
        depth = np.maximum(-free_mm, 0.0)
        again = np.flatnonzero((self.begins_mm > depth) & (self.begins_mm < limit_mm))
        if len(again):
            depth = np.maximum(depth, np.where(self.begins_mm < limit_mm, self.begins_mm, 0.0))
            depth[again] += np.maximum(-free_at(again, self.begins_mm[again]), 0.0)
        depth = np.where(self.begins_mm < limit_mm, np.minimum(depth, np.maximum(self.ends_mm, self.begins_mm)), limit_mm)
        is_left = (free_mm >= 0) & (self.begins_mm == 0)
        return np.where(is_left, np.minimum(free_mm, self.ahead_mm), -np.minimum(depth, limit_mm))


def _sideways(normals, by_mm):
    """Eight steps (n, 3) to the sides of normals (n, 3), one after the other: one of them leads into an edge's wedge."""
    least = np.abs(normals).argmin(axis=1)
    across = np.cross(normals, np.eye(3)[least])
    across = by_mm * across / np.sqrt(np.einsum("nc,nc->n", across, across))[:, None]
    along = np.cross(normals, across)
    return [across, -across, along, -along, across + along, across - along, along - across, -across - along]
