"""Spindle speed, feed of every block, and the time a program takes.

The feed of a block is the least of: what the cutter takes; half its length per time constant of the
drives (the machine then follows within half a block, docs/formulas.md 4); its length times the blocks that the control
runs in a time, where its file states them; what the axes can run; what their
acceleration allows round an arc.  The time follows from speeds reached under that acceleration.
"""

import math

import numpy as np

from cuspline.program.program import Kind
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit

# LinuxCNC gives the acceleration across an arc half of an axis' limit and what is left along it;
# measured on its motion controller (tests/authorities)
ARC_ACCELERATION_SHARE = 0.5
LEAST_FEED_MM_PER_MIN = 20.0
TIME_ASSUMPTIONS = (
    "trapezoidal speeds within each axis' acceleration, no jerk limit; corners as fast as the path tolerance "
    "allows; rapids along the straight line; where rotary axes turn in the cut and the program is posted, block by block through "
    "the joints; tool changes as the machine file says; no operator, no probing")


def spindle_rpm(cutter, speed_m_per_min, spindle):
    """Speed that gives the cutting speed on the full diameter, within what spindle and cutter allow.

    A ball in a shallow cut runs slower than this at its contact: safe, not fast.
    """
    wanted = speed_m_per_min * 1000.0 / (math.pi * cutter.diameter_mm)
    return float(math.floor(min(round(max(wanted, spindle.min_rpm)), spindle.max_rpm, cutter.max_rpm or math.inf)))


def cutting_feed_mm_per_min(cutter, rpm, feed_per_tooth_share, machine):
    """Feed per tooth times teeth times speed, within the machine's largest feed."""
    wanted = rpm * cutter.flutes * feed_per_tooth_share * cutter.diameter_mm
    return float(round(min(wanted, machine.max_feed_mm_per_min)))


def move_lengths_mm(moves):
    """(n,) length of each move; arcs along their circle."""
    starts = moves.starts_mm
    straight = np.linalg.norm(moves.end_mm - starts, axis=1)
    lengths = straight.copy()
    for k in np.flatnonzero(moves.kind >= Kind.ARC_CW):
        radius, sweep, rise = arc_shape(starts[k], moves.end_mm[k], moves.center_mm[k], moves.plane[k],
                                        moves.kind[k])
        lengths[k] = math.hypot(radius * sweep, rise)
    return lengths


def arc_shape(start, end, center, plane, kind):
    """(radius, sweep in radians > 0, rise along the third axis) of an arc."""
    a, b, c = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    x0, y0, x1, y1 = start[a] - center[a], start[b] - center[b], end[a] - center[a], end[b] - center[b]
    turn = fixed.arctan2(y1, x1) - fixed.arctan2(y0, x0)
    sweep = turn % (2 * math.pi) if kind == Kind.ARC_CCW else -turn % (2 * math.pi)
    return math.hypot(x0, y0), sweep if sweep > 1e-9 else 2 * math.pi, end[c] - start[c]


def capped_feeds(moves, machine):
    """(n,) feed of every move within what the machine follows; 0 on rapids.

    Args:
        moves: Moves with the cutter's feeds.
        machine: Machine.
    """
    lengths = move_lengths_mm(moves)
    by_lag = 60.0 * lengths / (2.0 * machine.time_constant_s)
    feeds = np.minimum(moves.feed_mm_per_min, np.minimum(by_lag, _axis_limit(moves, machine)))
    if machine.control.blocks_per_s is not None:
        feeds = np.minimum(feeds, 60.0 * lengths * machine.control.blocks_per_s)
    arcs = np.flatnonzero(moves.kind >= Kind.ARC_CW)
    for k in arcs:
        radius, _, _ = arc_shape(moves.starts_mm[k], moves.end_mm[k], moves.center_mm[k], moves.plane[k], moves.kind[k])
        feeds[k] = min(feeds[k], 60.0 * math.sqrt(ARC_ACCELERATION_SHARE * _acceleration(machine) * radius))
    floor = np.minimum(moves.feed_mm_per_min, LEAST_FEED_MM_PER_MIN)
    return np.where(moves.kind == Kind.RAPID, 0.0, np.maximum(np.floor(feeds), floor))


def _acceleration(machine):
    return min(a.acceleration_mm_per_s2 for a in machine.axes)


def _axis_limit(moves, machine):
    """(n,) path speed at which the first axis reaches its own limit, mm/min."""
    d = moves.end_mm - moves.starts_mm
    length = np.maximum(np.linalg.norm(d, axis=1), 1e-12)
    share = np.abs(d) / length[:, None]
    share[moves.kind >= Kind.ARC_CW] = 1.0
    rapid = np.array([a.rapid_mm_per_min for a in machine.axes])
    return (rapid / np.maximum(share, 1e-12)).min(axis=1)


def times_s(moves, machine):
    """(n,) seconds each move takes under TIME_ASSUMPTIONS."""
    lengths = move_lengths_mm(moves)
    speed = np.where(moves.kind == Kind.RAPID, _axis_limit(moves, machine), moves.feed_mm_per_min) / 60.0
    heads, tails = _directions(moves)
    cosine = np.clip((tails[:-1] * heads[1:]).sum(axis=1), -1.0, 1.0)
    a = _acceleration(machine)
    corner = np.r_[0.0, _corner_speed(cosine, a, machine.control.path_tolerance_mm), 0.0]
    stops = np.flatnonzero(np.diff((moves.kind == Kind.RAPID).astype(int))) + 1
    corner[stops] = 0.0
    return _ramped(lengths, np.maximum(speed, 1e-6), corner, a)


def _directions(moves):
    """Unit directions at the start and at the end of every move."""
    starts, ends = moves.starts_mm, moves.end_mm
    d = ends - starts
    heads = d / np.maximum(np.linalg.norm(d, axis=1), 1e-12)[:, None]
    tails = heads.copy()
    for k in np.flatnonzero(moves.kind >= Kind.ARC_CW):
        a, b, _ = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[moves.plane[k]]
        turn = 1.0 if moves.kind[k] == Kind.ARC_CCW else -1.0
        for at, out in ((starts[k], heads), (ends[k], tails)):
            x, y = at[a] - moves.center_mm[k, a], at[b] - moves.center_mm[k, b]
            r = math.hypot(x, y)
            out[k] = 0.0
            out[k, a], out[k, b] = -turn * y / r, turn * x / r
    return heads, tails


def _corner_speed(cosine, acceleration, tolerance_mm):
    """Speed through a corner rounded within the path tolerance; unlimited where it is tangent."""
    half = np.sqrt(np.maximum((1.0 + cosine) / 2.0, 1e-12))        # cosine of half the turn
    radius = tolerance_mm * half / np.maximum(1.0 - half, 1e-15)
    return np.where(cosine > 1.0 - 1e-7, 1e9, np.sqrt(acceleration * radius))


@njit
def _ramped(lengths, speed, corner, a):
    """Backward and forward pass over corner speeds, then a trapezoid for each move."""
    n = len(lengths)
    v = np.empty(n + 1)
    v[0], v[n] = 0.0, 0.0
    for k in range(1, n):
        v[k] = min(corner[k], min(speed[k - 1], speed[k]))
    for k in range(n - 1, -1, -1):
        v[k] = min(v[k], math.sqrt(v[k + 1] ** 2 + 2.0 * a * lengths[k]))
    out = np.empty(n)
    for k in range(n):
        v[k + 1] = min(v[k + 1], math.sqrt(v[k] ** 2 + 2.0 * a * lengths[k]))
        peak = min(speed[k], math.sqrt((v[k] ** 2 + v[k + 1] ** 2) / 2.0 + a * lengths[k]))
        ramp = (2.0 * peak ** 2 - v[k] ** 2 - v[k + 1] ** 2) / (2.0 * a)
        out[k] = (2.0 * peak - v[k] - v[k + 1]) / a + max(lengths[k] - ramp, 0.0) / max(peak, 1e-9)
    return out
