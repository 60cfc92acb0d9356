"""What a ball meets, by brute force: its front as many points, each held against every earlier move in closed form.

A straight move of an upright ball, clear above it, sweeps the points within a radius of the upright half-strip over the way of its
centre; so deep as a point is outside all half-strips, and inside the box, so deep it is in the stock.
"""

import math

import numpy as np
from numba import njit, prange

THIN_MM = 5e-4                  # chips that engagement does not see
SIDE_RAD = math.radians(10.0)   # arcs beside the tip count: on a way down they widen to a whole turn nearer to it
HALVINGS = 5


@njit(cache=True)
def depth_mm(x, y, z, moves, count, radius, box):
    """How deep a place is in a box (6,) after the first moves (n, 6) of centres of a ball; negative outside."""
    best = min(min(x - box[0], box[3] - x), min(min(y - box[1], box[4] - y), min(z - box[2], box[5] - z)))
    for k in range(count):
        m = moves[k]
        wx, wy, rise = m[3] - m[0], m[4] - m[1], m[5] - m[2]
        level = math.sqrt(wx * wx + wy * wy)
        px, py, pz = x - m[0], y - m[1], z - m[2]
        if level < 1e-12:
            aside, below = math.sqrt(px * px + py * py), max(min(0.0, rise) - pz, 0.0)
            best = min(best, math.sqrt(aside * aside + below * below) - radius)
            continue
        u, aside = (px * wx + py * wy) / level, (px * wy - py * wx) / level
        if 0.0 <= u <= level and pz >= rise * u / level:
            within = 0.0
        else:
            share = min(max((u * level + pz * rise) / (level * level + rise * rise), 0.0), 1.0)
            within = math.hypot(u - share * level, pz - share * rise)       # to the lower edge, or to the sides, which go up
            within = min(within, math.hypot(u, max(-pz, 0.0)))
            within = min(within, math.hypot(u - level, max(rise - pz, 0.0)))
        best = min(best, math.sqrt(aside * aside + within * within) - radius)
    return best


@njit(cache=True)
def _ring_rad(p, centre, way, moves, count, radius, box, places):
    """Sum of the arcs in the cut of the ring at a polar angle."""
    level = math.sqrt(way[0] * way[0] + way[1] * way[1])
    cx, cy = (way[0] / level, way[1] / level) if level > 1e-12 else (1.0, 0.0)
    c, s, total = math.cos(p), math.sin(p), 0
    for j in range(places):
        turn = (j + 0.5) * 2 * math.pi / places - math.pi
        ct, st = math.cos(turn), math.sin(turn)
        if s * ct * level - c * way[2] > 0:
            x, y = centre[0] + radius * s * (ct * cx - st * cy), centre[1] + radius * s * (ct * cy + st * cx)
            total += depth_mm(x, y, centre[2] - radius * c, moves, count, radius, box) > THIN_MM
    return total * 2 * math.pi / places


@njit(cache=True)
def _met(centre, way, moves, count, radius, box, polar, places, out):
    """Fills out (3,): lowest, highest, largest sum of the arcs of one ring; lowest NaN: it meets nothing."""
    first, last, beside, near = -1, -1, 0.0, 0.0
    for k in range(len(polar)):
        total = _ring_rad(polar[k], centre, way, moves, count, radius, box, places)
        if total > 0.0:
            first, last = k if first < 0 else first, k
            near = max(near, total)
            if polar[k] >= SIDE_RAD:
                beside = max(beside, total)
    out[0], out[1], out[2] = np.nan, np.nan, beside if beside > 0.0 else near
    if first < 0:
        return
    ends = polar[first], polar[last]
    for k in range(2):                      # the ends lie between two rings: halved out
        within, beyond = ends[k], polar[max(first - 1, 0)] if k == 0 else polar[min(last + 1, len(polar) - 1)]
        for _ in range(HALVINGS):
            middle = 0.5 * (within + beyond)
            if _ring_rad(middle, centre, way, moves, count, radius, box, places) > 0.0:
                within = middle
            else:
                beyond = middle
        out[k] = radius * (1 - math.cos(within))


@njit(cache=True, parallel=True)
def met_all(centres, ways, moves, counts, radius, box, polar, places):
    """(n, 3) of many places, see `met`; moves (n, k, 6) of the centres, counts (n,)."""
    out = np.empty((len(centres), 3))
    for i in prange(len(centres)):
        _met(centres[i], ways[i], moves[i], counts[i], radius, box, polar, places, out[i])
    return out


def met(tips, ways, moves, radius, box, rings=180, places=720):
    """What the front of a ball meets at tips (n, 3) on ways (n, 3) in a box (low, high).

    Args:
        moves: a list of [(start, end), ...] a tip, tips of the straight moves before it.
        rings: polar angles from the tip to the equator.   places: of a turn.
    Returns:
        (n, 3) lowest and highest height in the cut, over the tip, NaN: none; largest sum of the arcs of one ring, rad.
    """
    most = max(len(m) for m in moves)
    all_moves, up = np.zeros((len(tips), most, 6)), np.array([0, 0, radius])
    for k, mine in enumerate(moves):
        for j, (start, end) in enumerate(mine):
            all_moves[k, j] = np.r_[start + up, end + up]
    polar = np.unique(np.r_[np.linspace(0.002, np.pi / 2, rings), SIDE_RAD])
    return met_all(np.asarray(tips) + up, np.asarray(ways, float), all_moves, np.array([len(m) for m in moves]), float(radius),
                   np.array([*box[0], *box[1]], float), polar, places)



def off_by(found, wanted, radius):
    """How far engagement (n, 3) is off brute force (n, 3): shares of the radius, of the radius, of a turn.

    Returns:
        [(lowest, highest, immersion)] of places that both see in the cut, [extent] of those that one of them sees alone.
    """
    seen, there = np.isfinite(found[:, 0]), np.isfinite(wanted[:, 0])
    sizes = np.array([radius, radius, 2 * np.pi])
    alone = np.where(seen, found[:, 1] - found[:, 0], wanted[:, 1] - wanted[:, 0]) / radius
    return ((found - wanted) / sizes)[seen & there].tolist(), alone[seen != there].tolist()
