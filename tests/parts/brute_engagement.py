"""What a ball meets, by brute force: earlier moves as many balls standing still, the front of the ball as many points."""

import numpy as np

STILL = 120             # balls along a move; between them ridges stay that are lower than THIN of the radius
THIN = 5e-4
NEAREST_RAD = np.radians(9.99)      # to the tip that arcs are compared: on a way down they widen to a full turn there


def stock_height(xy, moves, radius, top):
    """Height over places (n, 2) after straight moves ((3,), (3,)) of an upright ball; the tool is clear above it."""
    height = np.full(len(xy), float(top))
    for start, end in moves:
        share = np.linspace(0, 1, STILL)[:, None]
        tips = np.asarray(start) + share * (np.asarray(end) - start)
        square = (xy[:, :1] - tips[:, 0]) ** 2 + (xy[:, 1:] - tips[:, 1]) ** 2
        over = tips[:, 2] + radius - np.sqrt(np.maximum(radius ** 2 - square, 0.0))
        height = np.minimum(height, np.where(square <= radius ** 2, over, np.inf).min(axis=1))
    return height


def met(tip, direction, moves, radius, box, rings=130, places=181):
    """(lowest, highest, widest arc) of the front of a ball at a tip in a box (low, high) cut by moves; None: it meets nothing."""
    polar = np.linspace(0.002, np.pi / 2, rings)[:, None]
    turn = np.linspace(-np.pi, np.pi, places)[None]
    level = np.hypot(*direction[:2])
    ex = np.array([direction[0], direction[1]]) / level
    across, height = radius * np.sin(polar) * np.ones_like(turn), radius * (1 - np.cos(polar)) * np.ones_like(turn)
    x = tip[0] + across * (np.cos(turn) * ex[0] - np.sin(turn) * ex[1])
    y = tip[1] + across * (np.cos(turn) * ex[1] + np.sin(turn) * ex[0])
    z = tip[2] + height
    goes_on = np.sin(polar) * np.cos(turn) * level - np.cos(polar) * direction[2] > 0
    low, high = box
    within = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1]) & (z > low[2])
    asked, cut = goes_on & within, np.zeros(x.shape, bool)
    cut[asked] = z[asked] < stock_height(np.column_stack([x[asked], y[asked]]), moves, radius, high[2]) - THIN * radius
    if not cut.any():
        return None
    longest = 0
    for row in cut[cut.any(axis=1) & (polar[:, 0] > NEAREST_RAD)]:
        edges = np.flatnonzero(np.diff(np.r_[False, row, False].astype(int)))
        longest = max(longest, (edges[1::2] - edges[::2]).max())
    return height[cut].min(), height[cut].max(), longest * 2 * np.pi / (places - 1)


def widest_arc(arcs, ring_rad):
    """Of a place's rings on a ball, so far apart, those that `met` compares; 0: none."""
    wide = arcs[round(10 * np.pi / 180 / ring_rad):]
    wide = wide[np.isfinite(wide[:, 0])]
    return (wide[:, 1] - wide[:, 0]).max(initial=0.0)
