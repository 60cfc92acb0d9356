"""Constant cutting speed with a ball: the spindle speed that the radius of the edge in the cut needs (docs/formulas.md 12)."""

import numpy as np

from cuspline.values import fixed_math as fixed


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
