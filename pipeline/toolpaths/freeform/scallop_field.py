"""A level function whose lines lie one step apart within a few per cent everywhere, without kinks.

Distances keep their steps exactly one and pay with creases where fronts meet.  A scallop goes with the square
of its step: a few per cent of room for every step is enough to bend the fronts so that they do not meet.

    to find: phi with LEAST <= |grad phi| <= MOST in the metric; what cannot be is spread as least squares:
    repeat: slope + dual -> nearest slope in the band (z);  phi whose slopes come nearest to z - dual

Left alone that would also wrinkle: zigzags of even steps where straight ones are too wide.  So it sets out
from sketches on a coarser grid whose slopes are averaged before they are brought into the band.

Every turn is one solve with the same sparse matrix.  Any start will do; which one decides the way passes run.

Source: alternating direction method of multipliers; S. Boyd et al., Foundations and Trends in Machine Learning
3 (2011), section 5.1, on the constraint set of slopes.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse

from cuspline.toolpaths.freeform.grid_cholesky import Factors
from cuspline.values import fixed_math as fixed

LEAST, MOST = 0.97, 1.025       # steps per step: scallops of 1.063 to 0.952 of the height
NODES_A_STEP = 2.3              # of the grid that slopes are taken on: lines bend gently
TURNS, SKETCH_TURNS = 240, 60
FOLLOWED = 2                    # sketches that are carried on to the end
NONE_LEFT = 1e-4                # share of the area out of the band at which to stop
LOOK_EVERY = 20
STARTS_DEG = (0.0, 45.0, 90.0, 135.0)
WEDGE = 0.05                    # steps off by more than this ask for pieces of their own,
DEARER = 4.0                    # which cost so many times their length: lifts
PIN = 1e-9                      # of the matrix' diagonal: holds the height of every separate part


def even_levels(ground, starts=()):
    """(ny, nx) level function, 0 at its least, with steps as even as the region allows; inf outside.

    Args:
        ground: Ground.
        starts: (ny, nx) level functions to begin from beside straight ones; the one with the shortest passes, gaps
            counted, is followed.
    """
    pitch = _typical_step_mm(ground) / NODES_A_STEP
    rough = _Slopes.of(ground, max(1, round(2 * pitch / ground.step_mm)))
    sketches = [_relaxed(rough, rough.smoothed(s, SKETCH_TURNS), SKETCH_TURNS) for s in _starts(rough, ground, starts)]
    fine = _Slopes.of(ground, max(1, round(pitch / ground.step_mm)))
    order = np.argsort([rough.to_cut_mm(phi) for phi in sketches], kind="stable")[:FOLLOWED]
    tries = [_relaxed(fine, fine.taken(ground, rough.on_ground(ground, sketches[k])), TURNS) for k in order]
    phi = fine.on_ground(ground, tries[int(np.argmin([fine.to_cut_mm(phi) for phi in tries]))])
    return np.where(ground.is_open, phi - phi[ground.is_inside].min(), np.inf)


def steps_of(ground, phi):
    """Steps per step, (m,) |grad phi| in the metric on triangles of the grid, and the share of each in area."""
    slopes = _Slopes.of(ground, 1)
    return slopes.steps(slopes.taken(ground, phi)), slopes.weight / slopes.weight.sum()


def _typical_step_mm(ground):
    xx, xy, yy = ground.metric[ground.is_inside].T
    return float(fixed.power(np.median(xx * yy - xy * xy), -0.25))


def _starts(slopes, ground, given):
    """Straight levels one typical step apart in several directions, and the given ones."""
    step = _typical_step_mm(ground)
    ways = ((fixed.cos(a), fixed.sin(a)) for a in np.radians(STARTS_DEG))
    return [fixed.matmul(slopes.xy_mm, np.array(way)) / step for way in ways] + [slopes.taken(ground, phi) for phi in given]


def _relaxed(slopes, phi, turns):
    """(n,) level function after some turns of the method."""
    ux = uy = 0.0
    for turn in range(turns):
        ex, ey = slopes.along_x @ phi, slopes.along_y @ phi
        if turn % LOOK_EVERY == 0 and slopes.out_of_band(fixed.hypot(ex, ey)) < NONE_LEFT:
            break
        px, py = ex + ux, ey + uy
        long = fixed.hypot(px, py)
        share = np.clip(long, LEAST, MOST) / np.maximum(long, 1e-12)
        ux, uy = (1.0 - share) * px, (1.0 - share) * py
        phi = slopes.with_slopes(share * px - ux, share * py - uy)
    return phi


@dataclass(frozen=True, eq=False, kw_only=True)
class _Slopes:
    """Slopes on the triangles of a coarser grid over a region, four to a cell, measured by the metric."""

    every: int              # nodes of the ground from node to node
    shape: tuple            # (ny, nx) of the coarser grid
    used: np.ndarray        # (n,) flat indices of its nodes that count
    xy_mm: np.ndarray       # (n, 2)
    along_x: sparse.csr_matrix      # (m, n) slope of a triangle along one way of length one in the metric
    along_y: sparse.csr_matrix      # (m, n) along the way square to it
    back: tuple             # (n, m) both turned over
    weight: np.ndarray      # (m,) area in the metric
    plan: tuple             # (m, 3) inverse metric's root, to come back to plan; (m,) area in plan
    averages: tuple         # (n, m), (m, n) from triangles to the mean at nodes, and back
    factors: Factors        # of the matrix of squared slopes

    @classmethod
    def of(cls, ground, every):
        ny, nx = (-(-(n - 1) // every) + 1 for n in ground.is_inside.shape)
        rows, cols = (np.minimum(np.arange(n) * every, m - 1) for n, m in zip((ny, nx), ground.is_inside.shape))
        near = ndimage.distance_transform_edt(~ground.is_open, return_distances=False, return_indices=True)
        metric = ground.metric[tuple(near[:, rows[:, None], cols])].reshape(-1, 3)
        cells = _cells_with(ground.is_inside, every, (ny, nx))
        a = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1))[cells]
        b, c, d = a + 1, a + nx, a + nx + 1
        corners = np.vstack([np.column_stack(t) for t in ((a, b, c), (b, a, d), (c, d, a), (d, c, b))])
        sign = np.repeat([(1, 1), (-1, 1), (1, -1), (-1, -1)], len(a), axis=0)
        used, local = np.unique(corners, return_inverse=True)
        local, step = local.reshape(corners.shape), every * ground.step_mm
        gx, gy = (_differences(local, k + 1, sign[:, k] / step, len(used)) for k in (0, 1))
        xx, xy, yy = metric[corners].mean(axis=1).T
        det = xx * yy - xy * xy
        l11 = np.sqrt(yy / det)                         # M^-1 = L^T L
        l12, l22 = -xy / det / l11, np.sqrt(1.0 / yy)
        ex, ey = (sparse.diags(l11) @ gx + sparse.diags(l12) @ gy).tocsr(), (sparse.diags(l22) @ gy).tocsr()
        weight = np.sqrt(det) * step ** 2 / 4
        matrix = ex.T @ sparse.diags(weight) @ ex + ey.T @ sparse.diags(weight) @ ey
        matrix = (matrix + PIN * matrix.diagonal().mean() * sparse.identity(len(used))).tocsc()
        factors = Factors.of(matrix, np.column_stack([used // nx, used % nx]))
        touch = sparse.csr_matrix((np.ones(local.size), (np.repeat(np.arange(len(local)), 3), local.ravel())), ex.shape)
        averages = ((sparse.diags(1.0 / np.asarray(touch.sum(axis=0)).ravel()) @ touch.T).tocsr(), touch / 3.0)
        xy_mm = np.column_stack([ground.x_mm[0] + step * (used % nx), ground.y_mm[0] + step * (used // nx)])
        return cls(every=every, shape=(ny, nx), used=used, xy_mm=xy_mm, along_x=ex, along_y=ey, back=(ex.T, ey.T), weight=weight,
                   plan=(l11, l12, l22, step ** 2 / 4), averages=averages, factors=factors)

    def steps(self, phi):
        return fixed.hypot(self.along_x @ phi, self.along_y @ phi)

    def out_of_band(self, steps):
        """Share of the area whose steps are too wide or too narrow."""
        off = (steps < LEAST - 0.01) | (steps > MOST + 0.01)
        return float(self.weight[off].sum() / self.weight.sum())

    def with_slopes(self, ex, ey):
        """(n,) level function whose slopes come nearest to the given ones."""
        return self.factors.solve(self.back[0] @ (self.weight * ex) + self.back[1] @ (self.weight * ey))

    def averaged(self, phi):
        """(m,), (m,) slopes averaged over a step or so."""
        to_nodes, to_triangles = self.averages
        average = lambda v: to_triangles @ (to_nodes @ v)
        return tuple(average(average(along @ phi)) for along in (self.along_x, self.along_y))

    def smoothed(self, phi, turns):
        """(n,) level function after turns toward slopes in the band with bends and wrinkles averaged away."""
        for _ in range(turns):
            ex, ey = self.averaged(phi)
            long = fixed.hypot(ex, ey)
            share = np.clip(long, LEAST, MOST) / np.maximum(long, 1e-12)
            phi = self.with_slopes(share * ex, share * ey)
        return phi

    def to_cut_mm(self, phi):
        """Length in plan of the level lines, and of pieces where steps are far from even or lines kink."""
        l11, l12, l22, area = self.plan
        ex, ey = self.along_x @ phi, self.along_y @ phi
        gy = ey / l22
        gx = (ex - l12 * gy) / l11
        off = (np.abs(fixed.hypot(ex, ey) - 1.0) > WEDGE) | (fixed.hypot(*self.averaged(phi)) < 1.0 - WEDGE)
        return float(fixed.hypot(gx, gy).sum() * area + DEARER * (np.sqrt(self.weight / area)[off] * area).sum())

    def taken(self, ground, phi):
        """(n,) values of a function on the ground's nodes; where there are none, of the nearest that has one."""
        known = np.isfinite(phi)
        near = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
        filled = phi[near[0], near[1]]
        rows, cols = self.used // self.shape[1] * self.every, self.used % self.shape[1] * self.every
        return filled[np.minimum(rows, filled.shape[0] - 1), np.minimum(cols, filled.shape[1] - 1)]

    def on_ground(self, ground, phi):
        """(ny, nx) values on the ground's nodes, linear between; beyond the used nodes the nearest's."""
        grid = np.full(self.shape[0] * self.shape[1], np.nan)
        grid[self.used] = phi
        grid = grid.reshape(self.shape)
        near = ndimage.distance_transform_edt(np.isnan(grid), return_distances=False, return_indices=True)
        at = np.meshgrid(*(np.arange(n) / self.every for n in ground.is_inside.shape), indexing="ij")
        return ndimage.map_coordinates(grid[near[0], near[1]], at, order=1, mode="nearest")


def _cells_with(is_inside, every, shape):
    """(ny - 1, nx - 1) coarser cells that hold or border on a node of the region."""
    wide = ndimage.binary_dilation(is_inside, np.ones((3, 3), bool))
    ny, nx = shape[0] - 1, shape[1] - 1
    framed = np.zeros((ny * every + 1, nx * every + 1), bool)
    framed[:wide.shape[0], :wide.shape[1]] = wide
    return framed[:-1, :-1].reshape(ny, every, nx, every).any(axis=(1, 3))


def _differences(corners, other, scale, count):
    """(m, n) matrix of (value at another corner - value at the first) times a scale."""
    rows = np.arange(len(corners))
    return sparse.csr_matrix((np.concatenate([-scale, scale]), (np.r_[rows, rows],
                              np.r_[corners[:, 0], corners[:, other]])), (len(corners), count))
