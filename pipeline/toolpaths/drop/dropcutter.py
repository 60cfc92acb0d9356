"""Drop-cutter on a triangle mesh: the lowest tip height at which a cutter touches without cutting in.

The geometry of one contact and the search are in drop_kernels.py; here are the tree and the rows of points.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cuspline.toolpaths.contact.contacts import checked_radii_mm
from cuspline.toolpaths.drop.disc_tops import DiscTops
from cuspline.toolpaths.drop.drop_kernels import (
    FACET_A,
    FACET_B,
    FACET_C,
    FACET_ROOT,
    FACET_SLOPE,
    LEAN_X,
    LEAN_Y,
    PLANE_A,
    PLANE_B,
    PLANE_C,
    STACK,
    TOP,
    UPHILL_X,
    UPHILL_Y,
    drop_one,
    first_of,
    holder_above,
)
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, A, B, C, X, Y, Z
from cuspline.values.threads import in_blocks

BOUNDED_ROWS = 2000     # from so many on bounds are worth their making
SERIAL_ROWS = 512       # fewer are done before the other threads have woken
CHUNK_ROWS = 256
LEAF_TRIANGLES = 2      # at most
STEEPEST = 100.0        # slope beyond which a facet's plane is not extrapolated: rounding of 1000 mm stays below 1e-10
NARROWEST_MM = 1e-3     # and the height in plan below which it is not


@dataclass(frozen=True, eq=False, kw_only=True)
class DropMesh:
    """Triangles in the order of a balanced tree of upper planes."""

    corners_mm: np.ndarray      # (m, 3, 3)
    facets: np.ndarray          # (m, 5) plane a, b, c, slope, sqrt(1 + slope²); see triangle_contact
    nodes: np.ndarray           # (k, 12) box, top and upper plane; see node_bound
    original: np.ndarray        # (m,) the rows of the triangles that it was made from

    @cached_property
    def _tops(self):
        return {}

    def tops_under(self, radius_mm):
        """DiscTops of discs of a radius."""
        if radius_mm not in self._tops:
            self._tops[radius_mm] = DiscTops.of_triangles(self.corners_mm, self.nodes[0], radius_mm)
        return self._tops[radius_mm]

    @classmethod
    def from_triangles(cls, vertices_mm, triangles):
        """Build the tree over (m, 3) vertex indices; cost is m log m.

        Raises:
            ToolpathError: there is no triangle, or a corner is not a number.
        """
        corners = np.asarray(vertices_mm, float)[np.asarray(triangles, dtype=np.int64).reshape(-1, 3)]
        if len(corners) == 0:
            raise ToolpathError("drop-cutter: the mesh has no triangle; hand over at least one")
        if not np.isfinite(corners).all():
            rows = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
            raise ToolpathError(f"drop-cutter: {len(rows)} triangles, the first being row {rows[0]}, have corners "
                                "that are not numbers; repair the mesh", rows=rows)
        leaves = 1
        while leaves * LEAF_TRIANGLES < len(corners):
            leaves *= 2
        order = _halved(corners[:, :, :2].mean(axis=1), _sides(corners), leaves)
        corners = np.ascontiguousarray(corners[order])
        return cls(corners_mm=frozen(corners, (None, 3, 3), "corners_mm"),
                   facets=frozen(_facet_planes(corners), (None, 5), "facets"),
                   nodes=frozen(_upper_planes(corners, leaves), (2 * leaves - 1, 12), "nodes"),
                   original=frozen(order, (None,), "original", np.int64))


@dataclass(frozen=True, eq=False, kw_only=True)
class DropContacts:
    """Where a dropped cutter rests; of several contacts one."""

    tip_z_mm: np.ndarray        # (n,) -inf where nothing lies beneath the cutter
    contact_mm: np.ndarray      # (n, 3) on the mesh; nan where nothing
    triangle: np.ndarray        # (n,) row of the triangle as handed to DropMesh; -1 where nothing


def drop_tips_mm(mesh, xy_mm, radius_mm, corner_radius_mm):
    """Lowest safe tip heights.

    Args:
        mesh: DropMesh.
        xy_mm: (n, 2) where the cutter stands; neighbours in the array should be neighbours in space.
        radius_mm: cutter radius R > 0.
        corner_radius_mm: rc, 0 (flat) to R (ball).
    Returns:
        (n,) tip z; -inf where nothing lies beneath the cutter.
    Raises:
        ToolpathError: no such cutter, or a position that is not a number.
    """
    return _drop(mesh, xy_mm, radius_mm, corner_radius_mm, False)[0]


def drop_contacts(mesh, xy_mm, radius_mm, corner_radius_mm):
    """Lowest safe tips with the points that hold the cutter; arguments and failures of drop_tips_mm.

    Returns:
        DropContacts, one row a position.

    >>> mesh = DropMesh.from_triangles([[0, 0, 1], [9, 0, 1], [0, 9, 1]], [[0, 1, 2]])
    >>> rest = drop_contacts(mesh, [[-3.0, 2.0], [2.0, 2.0], [-30.0, 0.0]], 5.0, 5.0)
    >>> rest.tip_z_mm, rest.triangle
    (array([  0.,   1., -inf]), array([ 0,  0, -1]))
    >>> rest.contact_mm[0]
    array([0., 2., 1.])
    """
    tips, contacts, owners = _drop(mesh, xy_mm, radius_mm, corner_radius_mm, True)
    held = owners >= 0
    triangle = np.where(held, mesh.original[np.where(held, owners, 0)], -1)
    return DropContacts(tip_z_mm=frozen(tips, (None,), "tip_z_mm"),
                        contact_mm=frozen(contacts, (None, 3), "contact_mm"),
                        triangle=frozen(triangle, (None,), "triangle", np.int64))


def is_held_above(mesh, xy_mm, radius_mm, corner_radius_mm, height_mm):
    """(n,) bool: the lowest safe tip lies above the height, one or (n,); often far faster than asking for the tip.

    Other arguments and failures of drop_tips_mm.
    """
    xy, R, rc = _checked(xy_mm, radius_mm, corner_radius_mm)
    heights = for_kernel(np.broadcast_to(np.asarray(height_mm, float), len(xy)))
    if len(xy) < BOUNDED_ROWS:
        return _held(mesh, xy, R, rc, heights)
    doubtful = np.flatnonzero(mesh.tops_under(R).over(xy) > heights)        # a flat disc is held no lower than any corner
    held = np.zeros(len(xy), np.bool_)
    held[doubtful] = _held(mesh, for_kernel(xy[doubtful]), R, rc, for_kernel(heights[doubtful]))
    return held


def _held(mesh, xy, R, rc, heights):
    held = np.empty(len(xy), np.bool_)
    in_blocks(_held_rows, len(xy), CHUNK_ROWS, mesh.corners_mm, mesh.facets, mesh.nodes, xy, R, rc, heights, held,
              serial_rows=SERIAL_ROWS)
    return held


def _checked(xy_mm, R, rc):
    """Positions and cutter as the kernels want them."""
    xy = for_kernel(xy_mm).reshape(-1, 2)
    if not np.isfinite(xy).all():
        rows = np.flatnonzero(~np.isfinite(xy).all(axis=1))
        raise ToolpathError(f"drop-cutter: position {rows[0]} is not a number; leave such rows out", rows=rows)
    return xy, *checked_radii_mm(R, rc)


def _drop(mesh, xy_mm, R, rc, wants_contacts):
    """Tips, contacts and rows of the sorted triangles (both empty when not wanted)."""
    xy, R, rc = _checked(xy_mm, R, rc)
    n = len(xy)
    count = n if wants_contacts else 0
    tips, contacts, owners = np.empty(n), np.empty((count, 3)), np.empty(count, np.int64)
    in_blocks(_drop_rows, n, CHUNK_ROWS, mesh.corners_mm, mesh.facets, mesh.nodes, xy, R, rc, tips, contacts, owners,
              serial_rows=SERIAL_ROWS)
    return tips, contacts, owners


@njit(error_model="numpy")
def _drop_rows(corners, facets, nodes, xy, R, rc, tips, contacts, owners, first, end):
    """One row after the other, each search starting from the triangle that held the cutter before."""
    stack, bounds = np.empty(STACK, np.int64), np.empty(STACK)
    last = -1
    for i in range(first, end):
        tips[i], last, tx, ty, tz = drop_one(corners, facets, nodes, xy[i, X], xy[i, Y], R, rc, last, stack, bounds)
        if len(owners) > 0:
            owners[i] = last
            contacts[i, X], contacts[i, Y], contacts[i, Z] = tx, ty, tz


@njit(error_model="numpy")
def _held_rows(corners, facets, nodes, xy, R, rc, z, held, first, end):
    stack = np.empty(STACK, np.int64)
    last = -1
    for i in range(first, end):
        holder = holder_above(corners, facets, nodes, xy[i, X], xy[i, Y], R, rc, z[i], last, stack)
        held[i] = holder >= 0
        last = holder if holder >= 0 else last


@njit(error_model="numpy")
def _sides(corners):
    """(m,) 0 for upper sides, 1 for undersides, 2 for walls: mixed, they have no good upper plane."""
    sides = np.empty(len(corners))
    for k in range(len(corners)):
        a, b, c = corners[k, A], corners[k, B], corners[k, C]
        nz = (b[X] - a[X]) * (c[Y] - a[Y]) - (b[Y] - a[Y]) * (c[X] - a[X])
        wide = max(max(a[X], b[X], c[X]) - min(a[X], b[X], c[X]), max(a[Y], b[Y], c[Y]) - min(a[Y], b[Y], c[Y]))
        sides[k] = 2.0 if abs(nz) < 1e-9 * max(wide * wide, 1e-30) else 1.0 if nz < 0.0 else 0.0
    return sides


@njit(error_model="numpy")
def _halved(centers, side, leaves):
    """(m,) order in which every node's triangles are parted by side, then across their longer extent in plan."""
    m = len(centers)
    order, key = np.arange(m), np.empty(m)
    width = leaves
    while width > 1:
        for leaf in range(0, leaves, width):
            first, last = first_of(leaf, m, leaves), first_of(leaf + width, m, leaves)
            rows = order[first:last]
            low, high, is_mixed = centers[rows[0]].copy(), centers[rows[0]].copy(), False
            for k in rows:
                is_mixed |= side[k] != side[rows[0]]
                for axis in range(2):
                    low[axis], high[axis] = min(low[axis], centers[k, axis]), max(high[axis], centers[k, axis])
            axis = 0 if high[X] - low[X] > high[Y] - low[Y] else 1
            for k in rows:
                key[k] = side[k] if is_mixed else centers[k, axis]
            _part(rows, key, first_of(leaf + width // 2, m, leaves) - first)
        width //= 2
    return order


@njit
def _part(rows, key, count):
    """Reorder rows so that the first `count` have the lowest keys (Hoare's selection)."""
    low, high = 0, len(rows) - 1
    while low < high:
        pivot = key[rows[(low + high) // 2]]
        i, j = low, high
        while i <= j:
            while key[rows[i]] < pivot:
                i += 1
            while key[rows[j]] > pivot:
                j -= 1
            if i <= j:
                rows[i], rows[j] = rows[j], rows[i]
                i += 1
                j -= 1
        if count <= j:
            high = j
        elif count >= i:
            low = i
        else:
            return


@njit(error_model="numpy")
def _facet_planes(corners):
    """Plane a, b, c, slope and sqrt(1 + slope²) of each triangle; slope inf where it is too steep or too narrow."""
    m = len(corners)
    facets = np.full((m, 5), np.inf)
    for k in range(m):
        ax, ay, az = corners[k, A]
        ux, uy, uz = corners[k, B] - corners[k, A]
        vx, vy, vz = corners[k, C] - corners[k, A]
        nz = ux * vy - uy * vx
        longest = math.sqrt(max(ux * ux + uy * uy, vx * vx + vy * vy, (vx - ux) ** 2 + (vy - uy) ** 2))
        if not abs(nz) > NARROWEST_MM * longest:
            continue
        a, b = -(uy * vz - uz * vy) / nz, -(uz * vx - ux * vz) / nz
        slope = math.sqrt(a * a + b * b)
        if slope < STEEPEST:
            facets[k, FACET_A], facets[k, FACET_B], facets[k, FACET_C] = a, b, az - a * ax - b * ay
            facets[k, FACET_SLOPE], facets[k, FACET_ROOT] = slope, math.sqrt(1.0 + slope * slope)
    return facets


@njit(error_model="numpy")
def _upper_planes(corners, leaves):
    """Box, top and a least-squares plane lifted until it lies above, for every node of the tree."""
    nodes = np.empty((2 * leaves - 1, 12))
    m, width, k = len(corners), leaves, 0
    while width >= 1:
        for leaf in range(0, leaves, width):
            _upper_plane(corners, first_of(leaf, m, leaves), first_of(leaf + width, m, leaves), nodes[k])
            k += 1
        width //= 2
    return nodes


@njit(error_model="numpy")
def _upper_plane(corners, first, last, node):
    """Fill one node from the triangles first..last-1; a node without any lies nowhere."""
    node[:] = 0.0
    node[X_LOW], node[X_HIGH], node[Y_LOW], node[Y_HIGH], node[TOP], node[PLANE_C] = (np.inf, -np.inf, np.inf, -np.inf,
                                                                                      -np.inf, -np.inf)
    if first >= last:
        return
    mx = my = mz = 0.0
    for t in range(first, last):
        for v in range(3):
            x, y, z = corners[t, v, X], corners[t, v, Y], corners[t, v, Z]
            node[X_LOW], node[X_HIGH], node[Y_LOW], node[Y_HIGH] = (min(node[X_LOW], x), max(node[X_HIGH], x),
                                                                    min(node[Y_LOW], y), max(node[Y_HIGH], y))
            node[TOP] = max(node[TOP], z)
            mx += x
            my += y
            mz += z
    n = 3.0 * (last - first)
    mx, my, mz = mx / n, my / n, mz / n
    xx = xy = yy = xz = yz = 0.0
    for t in range(first, last):
        for v in range(3):
            x, y, z = corners[t, v, X] - mx, corners[t, v, Y] - my, corners[t, v, Z] - mz
            xx += x * x
            xy += x * y
            yy += y * y
            xz += x * z
            yz += y * z
    ridge = 1e-4 * (xx + yy) + 1e-12
    det = (xx + ridge) * (yy + ridge) - xy * xy
    a = ((yy + ridge) * xz - xy * yz) / det
    b = ((xx + ridge) * yz - xy * xz) / det
    slope = math.sqrt(a * a + b * b)
    if slope > 5.0:                         # a wall: its top says more
        a = b = slope = 0.0
    c = -np.inf
    for t in range(first, last):
        for v in range(3):
            c = max(c, corners[t, v, Z] - a * corners[t, v, X] - b * corners[t, v, Y])
    node[PLANE_A], node[PLANE_B], node[PLANE_C] = a, b, c
    if slope > 1e-12:
        root = math.sqrt(1.0 + slope * slope)
        node[LEAN_X], node[LEAN_Y], node[UPHILL_X], node[UPHILL_Y] = a / root, b / root, a / slope, b / slope
