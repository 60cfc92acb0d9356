"""Rigid motions between part, setup (WCS) and machine coordinates."""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A right-handed rigid motion: x_outer = rotation @ x_inner + origin_mm."""

    rotation: np.ndarray      # (3, 3), det +1
    origin_mm: np.ndarray     # (3,) the inner origin, seen from outside

    def __post_init__(self):
        object.__setattr__(self, "rotation", frozen(self.rotation, (3, 3), "rotation"))
        object.__setattr__(self, "origin_mm", frozen(self.origin_mm, (3,), "origin_mm"))
        if not np.allclose(fixed.matmul(self.rotation, self.rotation.T), np.eye(3), atol=1e-9):
            raise ValueError("rotation is not orthonormal")
        if fixed.determinant(self.rotation) < 0:
            raise ValueError("rotation mirrors: its determinant is -1")

    @classmethod
    def shift(cls, origin_mm):
        """A pure translation."""
        return cls(rotation=np.eye(3), origin_mm=origin_mm)

    @classmethod
    def of_axes(cls, origin_mm, x, z):
        """Where the inner origin lies, and where the inner X and Z point, seen from outside; both of length 1, square."""
        x, z = np.asarray(x, float), np.asarray(z, float)
        return cls(rotation=np.column_stack([x, np.cross(z, x), z]), origin_mm=origin_mm)

    @classmethod
    def along(cls, axis):
        """About the origin, the inner Z along a direction (3,) of length 1, the inner X square to a main axis."""
        axis = np.asarray(axis, float)
        x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        return cls.of_axes(np.zeros(3), x / fixed.length(x), axis)

    def seen_from(self, other):
        """The same motion as seen from another frame, both given from one outside."""
        return Frame(rotation=fixed.matmul(other.rotation.T, self.rotation), origin_mm=other.into(self.origin_mm[None])[0])

    def out(self, points_mm):
        """(n, 3) inner coordinates → (n, 3) outer coordinates."""
        return fixed.matmul(np.asarray(points_mm), self.rotation.T) + self.origin_mm

    def into(self, points_mm):
        """(n, 3) outer coordinates → (n, 3) inner coordinates."""
        return fixed.matmul(np.asarray(points_mm) - self.origin_mm, self.rotation)

    def box_into(self, low_mm, high_mm):
        """(3,) low and (3,) high corner of the smallest inner box that holds an outer one."""
        inner = self.into(box_corners(low_mm, high_mm))
        return inner.min(axis=0), inner.max(axis=0)

    def turn_out(self, directions):
        """(n, 3) inner directions → (n, 3) outer directions."""
        return fixed.matmul(np.asarray(directions), self.rotation.T)

    def turn_into(self, directions):
        """(n, 3) outer directions → (n, 3) inner directions."""
        return fixed.matmul(np.asarray(directions), self.rotation)


def box_corners(low_mm, high_mm):
    """(8, 3) of a box between two opposite ones, (3,) each."""
    return np.where([[k >> a & 1 for a in range(3)] for k in range(8)], high_mm, low_mm)
