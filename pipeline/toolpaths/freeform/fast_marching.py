"""Distance on a grid whose length is measured by a metric that changes from node to node and with direction.

|grad phi|² in the inverse metric = 1.  At every node the inverse metric is written as a sum of three
squares of whole-numbered directions, none weighted negatively (Selling's reduction, so that the stencil
leans with the metric and causality holds however stretched it is):

    M^-1 = sum_k w_k e_k e_k^T      =>      sum_k w_k max(0, phi - phi(x - e_k), phi - phi(x + e_k))² = step²

and the nodes are answered once each in order of distance.  Where the front arrives smoothly the
differences are of second order.

Source: J.-M. Mirebeau, Riemannian fast-marching on Cartesian grids, using Voronoi's first reduction
of quadratic forms, SIAM J. Numer. Anal. 57 (2019).
"""

import math

import numpy as np

from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.rows import X, Y

FAR, TRIAL, DONE = 0, 1, 2
STEP_I, STEP_J = range(2)       # of an offset
SMOOTH = 0.5            # second order where the second difference is below this share of the first
BENT = 0.15             # and below this share of the stencil's own length: not across a seed or a meeting of fronts
MOST_FLIPS = 200        # Selling's reduction needs about as many steps as the metric is stretched


def metric_distance(metric, is_inside, step_mm, start, farthest=np.inf, walls=None):
    """Least length of any way from the seeds to each node, inside the region.

    Args:
        metric: (ny, nx, 3) xx, xy, yy of the metric at each node, 1/mm²; read only where `is_inside`.
        is_inside: (ny, nx) bool, nodes that a way may use.
        step_mm: grid pitch, the same in x and y.
        start: (ny, nx) known distances at the seeds' nodes, inf elsewhere.
        farthest: where the front may stop.
        walls: (ny, nx, 2) bool, no way leads from a node to its next in x [0], in y [1]; None: no walls.
    Returns:
        (ny, nx); inf outside, beyond `farthest` and where no way leads.  On smooth metrics the error
        falls with step_mm²; with step_mm behind places where fronts meet.
    Raises:
        ToolpathError: a metric that is no metric, or no seed inside.
    """
    inside, m = for_kernel(is_inside, np.bool_), for_kernel(metric)
    seeds = np.where(inside, np.asarray(start, float), np.inf)
    xx, xy, yy = m[inside].T
    if not (np.isfinite(m[inside]).all() and (xx > 0).all() and (xx * yy > xy * xy).all()):
        raise ToolpathError("the metric is not positive everywhere inside the region; cut such nodes out of the mask")
    if not np.isfinite(seeds).any():
        raise ToolpathError("no seed is inside the region; move the seed curve onto it")
    shut = _shut(walls, inside)
    weights, offsets = _stencils(m * step_mm ** 2, inside, shut)
    first, users = _users(offsets, inside)
    return _march(weights, offsets, m * step_mm ** 2, first, users, inside, shut, seeds, float(farthest))


def seed_distance(metric, is_inside, x_mm, y_mm, curves, reach=2.5, walls=None):
    """Distances at the nodes next to seed curves, in each node's own metric: where the front starts.

    Args:
        metric, is_inside: as for `metric_distance`.
        x_mm, y_mm: (nx,), (ny,) grid coordinates, evenly spaced.
        curves: list of (m, 2) polylines, mm; one row is a point.
        reach: how many grid pitches around a curve get a value.
        walls: as for `metric_distance`; behind a wall the curve is not seen.
    Returns:
        (ny, nx); inf beyond reach.
    """
    start = np.full(np.shape(is_inside), np.inf)
    m, inside = for_kernel(metric), for_kernel(is_inside, np.bool_)
    x, y, shut = for_kernel(x_mm), for_kernel(y_mm), _shut(walls, inside)
    for curve in curves:
        line = for_kernel(curve).reshape(-1, 2)
        _seed_line(m, inside, shut, x, y, line if len(line) > 1 else np.vstack([line, line]), float(reach), start)
    return start


def _shut(walls, inside):
    return for_kernel(np.zeros((*inside.shape, 2)) if walls is None else walls, np.bool_)


@njit(error_model="numpy")
def _seed_line(metric, inside, shut, x, y, line, reach, start):
    """Least distance of each near node to the segments of one polyline, at most what stands there already."""
    ny, nx = inside.shape
    step = x[1] - x[0]
    for s in range(len(line) - 1):
        ax, ay = line[s]
        ux, uy = line[s + 1, X] - ax, line[s + 1, Y] - ay
        j0 = max(int(math.floor((min(ax, ax + ux) - x[0]) / step - reach)), 0)
        j1 = min(int(math.ceil((max(ax, ax + ux) - x[0]) / step + reach)), nx - 1)
        i0 = max(int(math.floor((min(ay, ay + uy) - y[0]) / step - reach)), 0)
        i1 = min(int(math.ceil((max(ay, ay + uy) - y[0]) / step + reach)), ny - 1)
        uu = ux * ux + uy * uy
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                if not inside[i, j]:
                    continue
                vx, vy = x[j] - ax, y[i] - ay
                t = min(max((vx * ux + vy * uy) / uu, 0.0), 1.0) if uu > 0 else 0.0
                if (vx - t * ux) ** 2 + (vy - t * uy) ** 2 > (reach * step) ** 2:
                    continue
                mxx, mxy, myy = metric[i, j]
                muu = mxx * ux * ux + 2 * mxy * ux * uy + myy * uy * uy
                mvu = mxx * vx * ux + mxy * (vx * uy + vy * ux) + myy * vy * uy
                t = min(max(mvu / muu, 0.0), 1.0) if muu > 0 else 0.0
                wx, wy = vx - t * ux, vy - t * uy
                if not _sees(inside, shut, i, j, int(round(-wy / step)), int(round(-wx / step))):
                    continue
                d = math.sqrt(max(mxx * wx * wx + 2 * mxy * wx * wy + myy * wy * wy, 0.0))
                start[i, j] = min(start[i, j], d)


@njit(error_model="numpy")
def _selling(xx, xy, yy):
    """Weights (3,) and whole-numbered directions (3, 2) with sum w e e^T = the matrix (xx, xy; xy, yy)."""
    b = np.array([[1, 0], [0, 1], [-1, -1]])
    w = np.empty(3)
    for _ in range(MOST_FLIPS):
        flipped = False
        for k in range(3):
            p, q = (k + 1) % 3, (k + 2) % 3
            w[k] = -(xx * b[p, X] * b[q, X] + xy * (b[p, X] * b[q, Y] + b[p, Y] * b[q, X]) + yy * b[p, Y] * b[q, Y])
            if w[k] < -1e-12 * (xx + yy):
                px, py, qx, qy = b[p, X], b[p, Y], b[q, X], b[q, Y]
                b[p, X], b[p, Y] = -px, -py
                b[q, X], b[q, Y] = qx, qy
                b[k, X], b[k, Y] = px - qx, py - qy
                flipped = True
                break
        if not flipped:
            break
    e = np.empty((3, 2), np.int64)
    for k in range(3):
        e[k, X], e[k, Y] = -b[k, Y], b[k, X]
        w[k] = max(w[k], 0.0)
    return w, e


@njit(error_model="numpy")
def _sees(inside, shut, i, j, di, dj):
    """Whether the straight way to another node stays on nodes inside and meets no wall."""
    ny, nx = inside.shape
    if i + di < 0 or i + di >= ny or j + dj < 0 or j + dj >= nx:
        return False
    steps = max(abs(di), abs(dj))
    p, q = i, j
    for s in range(1, steps + 1):
        a, b = i + int(round(s * di / steps)), j + int(round(s * dj / steps))
        if not inside[a, b]:
            return False
        left, low = min(q, b), min(p, a)
        along_x_first = (b != q and shut[p, left, X]) or (a != p and shut[low, b, Y])
        along_y_first = (a != p and shut[low, q, Y]) or (b != q and shut[a, left, X])
        if along_x_first and along_y_first:
            return False
        p, q = a, b
    return True


@njit(error_model="numpy")
def _stencils(metric, inside, shut):
    """Per node three weights, and six offsets (di, dj) as whole numbers; an offset that is blocked is (0, 0)."""
    ny, nx = inside.shape
    weights = np.zeros((ny, nx, 3))
    offsets = np.zeros((ny, nx, 6, 2), np.int16)
    for i in range(ny):
        for j in range(nx):
            if not inside[i, j]:
                continue
            xx, xy, yy = metric[i, j]
            det = xx * yy - xy * xy
            w, e = _selling(yy / det, -xy / det, xx / det)
            for k in range(3):
                weights[i, j, k] = w[k]
                if w[k] == 0.0:
                    continue
                for side in range(2):
                    sign = 1 - 2 * side
                    di, dj = sign * e[k, Y], sign * e[k, X]
                    if _sees(inside, shut, i, j, di, dj):
                        offsets[i, j, 2 * k + side, STEP_I], offsets[i, j, 2 * k + side, STEP_J] = di, dj
    return weights, offsets


@njit(error_model="numpy")
def _users(offsets, inside):
    """For every node the nodes whose answer hangs on it: first row (n + 1,) into a list; the 8 neighbours are known."""
    ny, nx = inside.shape
    first = np.zeros(ny * nx + 1, np.int64)
    for turn in range(2):
        if turn == 1:
            for k in range(ny * nx):
                first[k + 1] += first[k]
            users = np.empty(first[ny * nx], np.int32)
            fill = first.copy()
        for i in range(ny):
            for j in range(nx):
                for k in range(6):
                    di, dj = offsets[i, j, k]
                    if di == 0 and dj == 0:
                        continue
                    target = (i + di) * nx + j + dj
                    if turn == 0:
                        first[target + 1] += 1
                    else:
                        users[fill[target]] = i * nx + j
                        fill[target] += 1
    return first, users


@njit(error_model="numpy")
def _solve(w, v):
    """Largest root u of sum w_k max(0, u - v_k)² = 1 over the terms that count (w_k > 0)."""
    order = np.argsort(v, kind="stable")
    a = b = c = 0.0
    u = np.inf
    for k in order:
        if w[k] <= 0.0 or not math.isfinite(v[k]):
            continue
        if v[k] >= u:
            break
        a, b, c = a + w[k], b + w[k] * v[k], c + w[k] * v[k] * v[k]
        root = b * b - a * (c - 1.0)
        if root < 0.0:
            break
        u = (b + math.sqrt(root)) / a
    return u


@njit(error_model="numpy")
def _answer(i, j, weights, offsets, metric, inside, shut, phi, state):
    """Distance at a node from the neighbours that are done."""
    ny, nx = inside.shape
    w, v, side = np.zeros(3), np.full(3, np.inf), np.zeros(3, np.int64)
    is_blocked = False
    for k in range(3):
        if weights[i, j, k] <= 0.0:
            continue
        w[k] = weights[i, j, k]
        for s in range(2):
            di, dj = offsets[i, j, 2 * k + s]
            if di == 0 and dj == 0:
                is_blocked = True
            elif state[i + di, j + dj] == DONE and phi[i + di, j + dj] < v[k]:
                v[k], side[k] = phi[i + di, j + dj], 2 * k + s
    u = _solve(w, v)
    if math.isfinite(u):
        w2, v2, any2 = w.copy(), v.copy(), False
        for k in range(3):
            if w[k] <= 0.0 or not v[k] < u:
                continue
            di, dj = offsets[i, j, side[k]]
            p, q = i + 2 * di, j + 2 * dj
            if p < 0 or p >= ny or q < 0 or q >= nx or state[p, q] != DONE:
                continue
            if not _sees(inside, shut, i + di, j + dj, di, dj):
                continue
            xx, xy, yy = metric[i, j]
            bend, reach = abs(u - 2 * v[k] + phi[p, q]), math.sqrt(xx * dj * dj + 2 * xy * di * dj + yy * di * di)
            if phi[p, q] <= v[k] and bend <= SMOOTH * (u - v[k]) and bend <= BENT * reach:
                w2[k], v2[k], any2 = 2.25 * w[k], (4 * v[k] - phi[p, q]) / 3, True
        if any2:
            second = _solve(w2, v2)
            u = second if second >= v.min() else u
    if is_blocked:                  # beside a border: the ways straight along the grid as well
        xx, xy, yy = metric[i, j]
        for di in range(-1, 2):
            for dj in range(-1, 2):
                p, q = i + di, j + dj
                if 0 <= p < ny and 0 <= q < nx and state[p, q] == DONE and _sees(inside, shut, i, j, di, dj):
                    u = min(u, phi[p, q] + math.sqrt(xx * dj * dj + 2 * xy * di * dj + yy * di * di))
    return u


@njit(error_model="numpy")
def _march(weights, offsets, metric, first, users, inside, shut, start, farthest):
    """All nodes in order of distance, nearest first."""
    ny, nx = inside.shape
    phi, state = start.copy(), np.zeros((ny, nx), np.int8)
    heap, place = np.empty(ny * nx, np.int64), np.full(ny * nx, -1, np.int64)
    flat, count = phi.ravel(), 0
    fixed = np.isfinite(start)
    for n in range(ny * nx):
        if math.isfinite(flat[n]):
            heap[count], place[n] = n, count
            count += 1
            _rise(heap, place, flat, count - 1)
    while count > 0:
        n = heap[0]
        count -= 1
        heap[0] = heap[count]
        place[heap[0]] = 0
        place[n] = -1
        _sink(heap, place, flat, 0, count)
        i, j = n // nx, n % nx
        if flat[n] > farthest:
            break
        state[i, j] = DONE
        for k in range(first[n], first[n + 1] + 8):
            if k < first[n + 1]:
                m = users[k]
                p, q = m // nx, m % nx
            else:
                around = k - first[n + 1]
                around += 1 if around >= 4 else 0
                p, q = i + around // 3 - 1, j + around % 3 - 1
                if p < 0 or p >= ny or q < 0 or q >= nx or not inside[p, q]:
                    continue
                m = p * nx + q
            if state[p, q] == DONE or fixed[p, q]:
                continue
            u = _answer(p, q, weights, offsets, metric, inside, shut, phi, state)
            if u < flat[m] or (state[p, q] == TRIAL and u != flat[m] and math.isfinite(u)):
                flat[m] = u
                state[p, q] = TRIAL
                if place[m] < 0:
                    heap[count], place[m] = m, count
                    count += 1
                _rise(heap, place, flat, place[m])
                _sink(heap, place, flat, place[m], count)
    for i in range(ny):
        for j in range(nx):
            if state[i, j] != DONE:
                phi[i, j] = np.inf
    return phi


@njit(error_model="numpy")
def _rise(heap, place, value, k):
    n = heap[k]
    while k > 0:
        up = (k - 1) // 2
        if value[heap[up]] <= value[n]:
            break
        heap[k] = heap[up]
        place[heap[k]] = k
        k = up
    heap[k], place[n] = n, k


@njit(error_model="numpy")
def _sink(heap, place, value, k, count):
    if count == 0:
        return
    n = heap[k]
    while True:
        down = 2 * k + 1
        if down >= count:
            break
        if down + 1 < count and value[heap[down + 1]] < value[heap[down]]:
            down += 1
        if value[heap[down]] >= value[n]:
            break
        heap[k] = heap[down]
        place[heap[k]] = k
        k = down
    heap[k], place[n] = n, k
