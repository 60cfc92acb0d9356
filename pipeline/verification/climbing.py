"""The tops of ridges and the bottoms of gouges, which no sample hits: climbed to from samples, on the exact faces.

Samples lie beside the ridges that passes leave:

        .  x    .        x  sample
       / \\    / \\       .  what is looked for
      x   \\__/   x

Every small cell's most extreme sample is a start.  Starts walk on the surface in compass steps that halve wherever
no step gains, first across the pass beside them, the most promising ones then in all directions; between compass
directions the best one is searched for, so that a sharp ridge is followed though no compass step stays on it.

The search finds every top that has a start on its own hill: on a high ridge at least one for every cell along it; and it
places a top to CLOSE_MM across and along.  That nothing stands higher is not for it to say: excess_proof.py proves it.
Gouges may be narrower still: they are looked for below every posted end, too.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from cuspline.splines.nurbs import local_shape
from cuspline.stock.extremes import no_hints
from cuspline.surfaces.patches import PatchSet
from cuspline.surfaces.projection import refined
from cuspline.surfaces.trims import TrimSet
from cuspline.values import fixed_math as fixed
from cuspline.verification.samples import in_parameters

CLOSE_MM = 3e-4           # last step: 0.03 um of height on flanks of one in ten
CELL = 0.5                # cells of starts, in spacings: on a ridge a start every half spacing
FIRST = 0.25              # first step, in spacings: the mean distance of samples
ACROSS_ROUNDS = 5         # halvings of the first walk
PROMISING = 400           # starts that go all the way, beside the best of every wide cell
WIDE = 6.0                # of these, in spacings
FEW = 4000                # starts of the first walk, beside the best of every cell of NARROW spacings
NARROW = 2.0              # of these, in spacings
LONGEST = 60              # rounds
COMPASS = np.pi / 4 * np.arange(8)
BETWEEN = np.pi / 36 * np.array([-4, -3, -2, -1, 1, 2, 3, 4])     # looked at around the best of these
FLAT = 1e-4               # a rise of less than this, per step, is level
RIM_MM = 0.01             # a top closer than this to the border is one of the rim
GRID = 24                 # places a side, of a face, by which a sample's parameters are found
LEAST_GRID = 6            # of every patch of it


@dataclass(frozen=True, eq=False, kw_only=True)
class Ground:
    """Exact faces to walk on."""

    patches: PatchSet
    trims: TrimSet
    domains: np.ndarray       # (f, 4) u low, u high, v low, v high

    @classmethod
    def of_faces(cls, faces):
        """Of brep.Face values; they are numbered in their order, as `sample_faces` does."""
        patches = PatchSet.of_faces(faces)
        return cls(patches=patches, trims=TrimSet.of_faces(faces),
                   domains=np.array([patches.domain(k) for k in range(len(faces))]).reshape(-1, 4))

    def parameters(self, points_mm, face):
        """u (n,), v (n,) of points on faces, and whether they were found (n,)."""
        u, v, found = np.zeros(len(face)), np.zeros(len(face)), np.zeros(len(face), bool)
        for number in np.unique(face):
            rows = np.flatnonzero(face == number)
            u[rows], v[rows] = self._nearest_of_grid(number, points_mm[rows])
        u, v, feet = refined(self.patches, face, u, v, points_mm)
        found = np.linalg.norm(feet - points_mm, axis=1) < CLOSE_MM
        return u, v, found

    def _nearest_of_grid(self, face, points_mm):
        if face not in self._grids:
            self._grids[face] = self._grid(face)
        tree, u, v = self._grids[face]
        near = tree.query(points_mm)[1]
        return u[near], v[near]

    @cached_property
    def _grids(self):
        return {}

    def _grid(self, face):
        """(cKDTree of places all over a face, their u (n,), v (n,))."""
        first, nu, nv = self.patches.face[face, :3]
        u0, u1, v0, v1 = self.patches.span[first:first + nu * nv].T
        across, along = ((np.arange(k) + 0.5) / k for k in (max(GRID // n, LEAST_GRID) for n in (nu, nv)))
        u = (u0[:, None, None] + (u1 - u0)[:, None, None] * across[:, None] + 0 * along).ravel()
        v = (v0[:, None, None] + (v1 - v0)[:, None, None] * along + 0 * across[:, None]).ravel()
        return cKDTree(self.patches.derivatives(face, u, v)[:, 0]), u, v

    def stepped(self, face, u, v, step_mm):
        """Parameters after tangent steps (n, 3), and whether they are still on the face."""
        d = self.patches.derivatives(face, u, v)
        low_u, high_u, low_v, high_v = self.domains[face].T
        du, dv = in_parameters(step_mm, d[:, 1], d[:, 2]).T
        u2, v2 = u + du, v + dv
        inside = (u2 >= low_u) & (u2 <= high_u) & (v2 >= low_v) & (v2 <= high_v)
        u2, v2 = np.clip(u2, low_u, high_u), np.clip(v2, low_v, high_v)
        return u2, v2, inside & self.trims.is_inside(face, u2, v2)

    def places(self, face, u, v):
        """LocalShape (n,), normals out of the material."""
        shape = local_shape(self.patches.derivatives(face, u, v))
        sign, low, high = self.patches.sign[face], shape.curvature_low_per_mm, shape.curvature_high_per_mm
        return replace(shape, normal=shape.normal * sign[:, None], curvature_low_per_mm=np.where(sign > 0, low, -high),
                       curvature_high_per_mm=np.where(sign > 0, high, -low))

    def is_at_rim(self, face, u, v):
        """(n,) bool: a step of RIM_MM in one of four directions leaves the face."""
        d = self.patches.derivatives(face, u, v)
        first = unit(d[:, 1])
        second = np.cross(unit(np.cross(d[:, 1], d[:, 2])), first)
        steps = [side * RIM_MM * way for way in (first, second) for side in (-1, 1)]
        return ~np.all([self.stepped(face, u, v, step)[2] for step in steps], axis=0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Tops:
    """Where walks ended, one row each."""

    face: np.ndarray          # (n,)
    u: np.ndarray             # (n,)
    v: np.ndarray             # (n,)
    height_mm: np.ndarray     # (n,) by the function that was climbed

    def only(self, rows):
        """The chosen ones."""
        return Tops(face=self.face[rows], u=self.u[rows], v=self.v[rows], height_mm=self.height_mm[rows])


def hill_rows(points_mm, face, heights_mm, cell_mm):
    """Rows of the highest sample in every cell that holds a hill: the higher half of each face's samples above 0."""
    least = np.zeros(face.max(initial=-1) + 1)
    for number in np.unique(face):
        mine = heights_mm[(face == number) & (heights_mm > 0)]
        least[number] = np.median(mine) if len(mine) else 0.0
    rows = np.flatnonzero((heights_mm > 0) & (heights_mm >= least[face]))
    cells = np.column_stack([np.floor(points_mm[rows] / cell_mm).astype(np.int64), face[rows]])
    order = np.lexsort((rows, -heights_mm[rows], *cells.T))
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(cells[order], axis=0) != 0).any(axis=1)
    return rows[order[first]]


def walked(ground, tops, heights, first_mm, along=None, last_mm=CLOSE_MM):
    """Tops after a walk uphill.

    Args:
        ground: Ground.   tops: where to start.
        heights: extremes.CutHeight or AnyHeight.
        first_mm: first step, scalar > 0.   last_mm: steps shorter than this are not taken.
        along: (n, 3) directions in which alone to walk, to and fro; None: every direction.
    """
    face, u, v, height = tops.face, tops.u.copy(), tops.v.copy(), tops.height_mm.copy()
    step, live, hints = np.full(len(u), float(first_mm)), np.arange(len(u)), no_hints(len(u))
    for turn in range(LONGEST):
        live = live[step[live] >= last_mm]
        if not len(live):
            break
        compass = np.pi * np.arange(2) if along is not None else COMPASS + 0.1 * turn
        stays, way = live, np.zeros(len(live))
        for angles in (compass,) if along is not None else (compass, BETWEEN):
            frame = _frame(ground, face[stays], u[stays], v[stays], None if along is None else along[stays])
            place, near = (face[stays], u[stays], v[stays]), hints[stays]
            least = height[stays] + FLAT * step[stays]
            found, way = _best_step(ground, (heights, near), place, (step[stays], least), frame, way[:, None] + angles)
            hints[stays] = near
            gains = found[2] > least
            up = stays[gains]
            u[up], v[up], height[up] = (a[gains] for a in found)
            stays, way = stays[~gains], way[~gains]
        step[stays] /= 2
    return Tops(face=face, u=u, v=v, height_mm=height)


def _frame(ground, face, u, v, along):
    """Two unit tangents (n, 3), square to each other, the first one `along` where that is given."""
    d = ground.patches.derivatives(face, u, v)
    first, normal = unit(d[:, 1]), unit(np.cross(d[:, 1], d[:, 2]))
    if along is not None:
        first = unit(along - np.einsum("nc,nc->n", along, normal)[:, None] * normal)
    return first, np.cross(normal, first)


def _best_step(ground, heights, place, steps, frame, angles):
    """(u, v, height) of the highest of several places at a step's distance, see `AnyHeight.highest`; its angle.

    Args:
        heights: CutHeight or AnyHeight, and its hints.   place: face, u, v (n,).
        steps: their lengths, and what is a gain (n,).   frame: `_frame`.   angles: (n, k) from the first tangent.
    """
    (n, k), (step_mm, least_mm), (heights, hints) = angles.shape, steps, heights
    each = lambda a: np.repeat(a, k, axis=0)
    way = fixed.cos(angles).reshape(-1, 1) * each(frame[0]) + fixed.sin(angles).reshape(-1, 1) * each(frame[1])
    face, *uv = (each(a) for a in place)
    u, v, inside = ground.stepped(face, *uv, each(step_mm)[:, None] * way)
    points = ground.patches.derivatives(face, u, v)[:, 0].reshape(n, k, 3)
    height, which = heights.highest(points, inside.reshape(n, k), least_mm, hints)
    best = np.arange(n) * k + which
    return (u[best], v[best], height), angles.ravel()[best]


def unit(a):
    """Rows of length 1; zero stays zero."""
    return a / np.linalg.norm(a, axis=1, keepdims=True).clip(1e-300)


def tops_of(ground, points_mm, face, heights_mm, feeds, heights, spacing_mm):
    """Tops of the hills that samples (n,) stand on.

    Args:
        ground: Ground.   points_mm: (n, 3).   face: (n,).
        heights_mm: (n,) at the samples; -inf: no start.
        feeds: (n, 3) direction of the pass beside each; zero: not known.
        heights: extremes.CutHeight or AnyHeight.
        spacing_mm: of the samples.
    Returns:
        Tops, more than one of a hill perhaps.
    """
    rows = hill_rows(points_mm, face, heights_mm, CELL * spacing_mm)
    rows = rows[_best_of(points_mm[rows], face[rows], heights_mm[rows], NARROW * spacing_mm, FEW)]
    u, v, found = ground.parameters(points_mm[rows], face[rows])
    rows, u, v = rows[found], u[found], v[found]
    begin = Tops(face=face[rows], u=u, v=v, height_mm=heights_mm[rows])
    normal = ground.places(begin.face, u, v).normal
    first = FIRST * spacing_mm
    across = walked(ground, begin, heights, first, along=np.cross(feeds[rows], normal),
                    last_mm=first / 2 ** (ACROSS_ROUNDS - 1))
    best = _best_of(points_mm[rows], across.face, across.height_mm, WIDE * spacing_mm, PROMISING)
    return walked(ground, across.only(best), heights, first / 2)


def _best_of(points_mm, face, heights_mm, cell_mm, count):
    """Rows of the `count` highest and of the highest of each face in every cell, growing."""
    best = np.argsort(-heights_mm, kind="stable")
    cells = np.column_stack([np.floor(points_mm[best] / cell_mm).astype(np.int64), face[best]])
    return np.union1d(best[:count], best[np.unique(cells, axis=0, return_index=True)[1]])


def bottoms_of(ground, samples_mm, normals, face, centers, depths, spacing_mm):
    """Bottoms of the gouges that cutters standing over a face have made, however narrow.

    Args:
        ground: Ground.   samples_mm, normals: (n, 3).   face: (n,).
        centers: [(tips (m, 3), tool axes (m, 3) or (3,), flat radius, corner radius)], one a tool.
        depths: extremes.CutHeight or AnyHeight, positive below the face; a start is as deep as its own cutter stands.
        spacing_mm: of the samples.
    Returns:
        Tops whose heights are depths.
    """
    tree, rows, over, reach = cKDTree(samples_mm), [], [], []
    low, high = samples_mm.min(axis=0, initial=np.inf), samples_mm.max(axis=0, initial=-np.inf)
    for tips, axes, flat, corner in centers:
        axes, far = np.broadcast_to(axes, tips.shape), flat + corner + spacing_mm
        middles = tips + corner * axes
        about = ((middles >= low - far) & (middles <= high + far)).all(axis=1)
        tips, axes = tips[about], axes[about]
        near = tree.query(middles[about], distance_upper_bound=far)[1]
        there = np.flatnonzero(near < len(samples_mm))
        axis, normal = axes[there], normals[near[there]]
        rows.append(near[there])
        over.append(tips[there] + corner * axis - flat * unit(normal - (normal * axis).sum(axis=1)[:, None] * axis))
        reach.append(np.full(len(there), corner))
    rows, over, reach = (np.concatenate(column) for column in zip((np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)),
                                                                  *zip(rows, over, reach)))
    seen, back = np.unique(rows, return_inverse=True)
    u, v, found = ground.parameters(samples_mm[seen], face[seen])
    u, v, at = refined(ground.patches, face[rows], u[back], v[back], over)
    good = np.flatnonzero(found[back] & ground.trims.is_inside(face[rows], u, v))
    way = over[good] - at[good]
    depth = reach[good] - np.copysign(np.linalg.norm(way, axis=1), np.einsum("ij,ij->i", way, normals[rows[good]]))
    deepest = np.argsort(-depth, kind="stable")
    cell = np.unique(np.floor(at[good[deepest]] / spacing_mm).astype(np.int64), axis=0, return_index=True)[1]
    chosen = deepest[np.union1d(np.arange(min(PROMISING, len(deepest))), np.sort(cell)[:PROMISING])]
    chosen = chosen[depth[chosen] > 0]
    begin = Tops(face=face[rows[good[chosen]]], u=u[good[chosen]], v=v[good[chosen]], height_mm=depth[chosen])
    return walked(ground, begin, depths, FIRST * spacing_mm)
