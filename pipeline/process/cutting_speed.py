"""Constant cutting speed: the spindle speed that the radius of the edge in the cut needs (docs/formulas.md 12)."""

import numpy as np

from cuspline.values import fixed_math as fixed

BANDS = 1.03, 1.05, 1.08, 1.12, 1.2, 1.5, 2.0     # so much beside it an S word may stand for; the first that needs few enough words


def effective_radius_mm(radius_mm, depth_mm):
    """Distance from the axis of the highest place of a ball's edge in a cut of a depth over its tip; at most the radius.

    >>> float(effective_radius_mm(5.0, 1.0))
    3.0
    """
    over = np.maximum(radius_mm - np.asarray(depth_mm, float), 0.0)
    return np.sqrt(np.maximum(radius_mm * radius_mm - over * over, 0.0))


def contact_radius_mm(radius_mm, contact_rad):
    """The same of a ball that touches a surface sloping by an angle."""
    return radius_mm * fixed.sin(contact_rad)


def rpm_for_speed(speed_m_per_min, effective_radius_mm, spindle):
    """Spindle speed that gives a cutting speed at a radius, within what the spindle turns.

    Args:
        effective_radius_mm: scalar or (n,), > 0.   spindle: machines.Spindle.
    """
    wanted = speed_m_per_min * 1000 / (2 * np.pi * np.maximum(np.asarray(effective_radius_mm, float), 1e-9))
    return np.clip(wanted, spindle.min_rpm, spindle.max_rpm)


def followed_rpm(rpm, times_s, change_rpm_per_s):
    """(n,) speeds no higher than those wanted that a spindle follows: it changes by so much in a second.

    Args:
        rpm: (n,) wanted on moves one after the other.   times_s: (n,) their durations.
    """
    out = np.array(rpm, float)
    step = change_rpm_per_s * np.asarray(times_s, float)
    for k in range(1, len(out)):
        out[k] = min(out[k], out[k - 1] + step[k])
    for k in range(len(out) - 2, -1, -1):
        out[k] = min(out[k], out[k + 1] + step[k])
    return out


def speed_runs(wanted_rpm, band=BANDS[0]):
    """Spindle speeds that change as seldom as they may: every one within a band of what is wanted all along its run.

    Args:
        wanted_rpm: (n,) on stretches one after the other; NaN: any will do.   band: factor, > 1.
    Returns:
        (first stretch of each run (k,), rpm (k,)), whole numbers; k is 0 where nothing is wanted.

    >>> speed_runs(np.array([np.nan, 1000.0, 1030.0, np.nan, 2000.0]))
    ([0, 4], [1015, 2000])
    """
    firsts, speeds, low, high, begin = [], [], 0.0, np.inf, 0
    for k, rpm in enumerate(np.asarray(wanted_rpm, float).tolist()):
        if not rpm > 0:
            continue
        if max(low, rpm / band) > min(high, rpm * band):
            firsts.append(begin)
            speeds.append(round(float(np.sqrt(low * high))))
            low, high, begin = 0.0, np.inf, k
        low, high = max(low, rpm / band), min(high, rpm * band)
    if high < np.inf:
        firsts.append(begin)
        speeds.append(round(float(np.sqrt(low * high))))
    return firsts, speeds


def spindle_speeds(wanted_rpm, times_s, change_rpm_per_s, band=BANDS[0]):
    """(n,) whole speeds near those wanted that a spindle follows, changed as seldom as that allows.

    Args:
        wanted_rpm: (n,) on stretches one after the other, some of them numbers; NaN: any will do.   times_s: (n,).
    """
    wanted_rpm = np.asarray(wanted_rpm, float)
    known = np.flatnonzero(np.isfinite(wanted_rpm))
    lasting = wanted_rpm[known[np.maximum(np.searchsorted(known, np.arange(len(wanted_rpm)), side="right") - 1, 0)]]
    rpm = followed_rpm(lasting, times_s, change_rpm_per_s)
    firsts, speeds = speed_runs(np.where(np.isfinite(wanted_rpm), rpm, np.nan), band)
    return np.repeat(np.array(speeds, float), np.diff([0, *firsts[1:], len(rpm)]))


def turning_rpm(commanded_rpm, times_s, change_rpm_per_s):
    """(n,) mean speed of a spindle on moves one after the other: it begins to change with the move that says so.

    >>> turning_rpm(np.array([1000.0, 2000.0, 2000.0]), np.array([1.0, 1.0, 1.0]), 500.0).tolist()
    [1000.0, 1250.0, 1750.0]
    """
    out = np.array(commanded_rpm, float)
    now = float(out[0]) if len(out) else 0.0
    for k, (wanted, seconds) in enumerate(zip(out.tolist(), np.asarray(times_s, float).tolist())):
        if wanted == now:
            continue
        way, most = wanted - now, change_rpm_per_s * seconds
        if abs(way) >= most:
            after = now + np.sign(way) * most
            out[k] = (now + after) / 2
        else:
            out[k], after = wanted - way * abs(way) / (2 * most), wanted
        now = float(after)
    return out
