r"""How deep a ball is in the cut, from where to where its edge cuts: closed forms (docs/formulas.md 10).

Parallel straight passes on a plane, one layer of even thickness.  Seen along the feed, the layer level:

         previous pass     this pass            layer  t   thickness of the removed layer
              ___╲________ ╱‾‾‾‾‾‾              step   a_s from pass to pass along the plane
                  ╲  cut  ╱                     angle  psi of the plane against the level; > 0: the pass before is the
                   ╲_____╱                      higher one (step-down), < 0: it is the lower one (step-up)

Heights are over the ball's tip, along the tool's axis.  Lengths mm, angles rad; arrays go with arrays.
"""

import math

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit

STEEP_RAD = np.pi / 4     # from here on another branch of the limits holds
SCANNED = 256             # parts of the range in which the first crossing is looked for
HALVINGS = 60
BALL, RADIAL, AXIAL, COSINE = range(4)        # columns of what is solved: r, a_r, a_a, |cos phi|


def layer_radius_mm(radius_mm, layer_mm):
    """r_t: half the width of the groove that a ball cuts into a layer.

    >>> float(layer_radius_mm(10.0, 4.0))
    8.0
    """
    return np.sqrt(np.maximum(2 * radius_mm * layer_mm - layer_mm * np.asarray(layer_mm, float), 0.0))


def outer_boundary_mm(radius_mm, layer_mm, psi_rad):
    """a_o: height at which the outer border of the layer is cut.

    Args:
        psi_rad: path increment angle; negative: step-up.
    >>> float(outer_boundary_mm(10.0, 4.0, np.radians(-30.0)).round(4))
    8.8038
    """
    cosine, sine = fixed.cos(psi_rad), fixed.sin(psi_rad)
    return radius_mm * (1 - cosine) + layer_mm * cosine - layer_radius_mm(radius_mm, layer_mm) * sine


def relieving_layer_mm(radius_mm, psi_rad):
    """t_o: a thinner layer leaves the tip out of the cut in step-down."""
    return radius_mm * (1 - fixed.cos(psi_rad))


def relieving_step_mm(radius_mm, psi_rad):
    """a_d: a shorter step leaves the tip out of the cut in step-up.

    >>> float(relieving_step_mm(5.0, np.radians(-30.0)).round(6))
    5.0
    """
    psi = np.abs(np.asarray(psi_rad, float))
    return np.where(psi < STEEP_RAD, 2 * radius_mm * fixed.sin(psi), np.sqrt(2.0) * radius_mm)


def relieving_radial_step_mm(radius_mm, psi_rad):
    """a_c: the same limit, of the step seen from above."""
    psi = np.abs(np.asarray(psi_rad, float))
    return np.where(psi < STEEP_RAD, radius_mm * fixed.sin(2 * psi), radius_mm)


def largest_depth_mm(radius_mm, layer_mm, step_mm, psi_rad):
    """a_m as the source has it: the longest stretch of the edge in the cut at one moment, from above where it is not exact.

    Args:
        radius_mm, layer_mm, step_mm: r, t <= r and a_s.   psi_rad: path increment angle, -90 to 90 degrees.
    Returns:
        mm along the axis; at 90 degrees r + t, the shank above the ball included.
    Source: docs/formulas.md 10.

    >>> largest_depth_mm(10.0, np.array([8.0, 4.0, 1.0]), 2.0, np.radians(30.0)).round(4)
    array([4.369 , 2.3397, 2.3134])
    >>> float(largest_depth_mm(10.0, 4.0, 3.0, np.radians(-30.0)).round(4))
    8.2141
    """
    r, t, step, psi = np.broadcast_arrays(*(np.asarray(v, float) for v in (radius_mm, layer_mm, step_mm, psi_rad)))
    cosine, sine, r_t = fixed.cos(psi), fixed.sin(np.abs(psi)), layer_radius_mm(r, t)
    lift = r * (1 - cosine)
    down = np.where(t > 2 * r * sine * sine, r - (r - t) * cosine - (r_t - step) * sine,
                    np.where(t > lift, lift + step * sine, (step + r_t) * sine - t * cosine))
    below = np.where(step < relieving_step_mm(r, psi), np.maximum(lift - step * sine / 2, 0.0), 0.0)
    up = lift + t * cosine + r_t * sine - below
    return np.where(psi == 0, t, np.where(psi >= np.pi / 2, r + t, np.where(psi > 0, down, up)))


def edge_in_cut_mm(radius_mm, layer_mm, step_mm, psi_rad):
    """(lowest, highest) height at which the edge cuts on its way round: exact, of all that one pass removes.

    Args:
        radius_mm, layer_mm, step_mm: r, t <= r and a_s; a step of 0: the first pass, nothing is cut beside it.
        psi_rad: path increment angle between -90 and 90 degrees.
    Source: the corners of the removed cross-section and the tip; brute force over it agrees (tests/process).

    >>> np.round(edge_in_cut_mm(10.0, 4.0, 2.0, np.radians(30.0)), 4)
    array([0.    , 1.8832])
    """
    r, t, step, psi = np.broadcast_arrays(*(np.asarray(v, float) for v in (radius_mm, layer_mm, step_mm, psi_rad)))
    sine, cosine, side = fixed.sin(np.abs(psi)), fixed.cos(psi), np.where(psi < 0, -1.0, 1.0)
    height = lambda along, up: r + along * sine + (up - r) * cosine
    r_t = layer_radius_mm(r, t)
    is_beside = (step > 0) & (step < 2 * r_t)                   # the groove of the pass before is met
    outer = height(-side * r_t, t)
    cusp = np.where(is_beside, height(side * step / 2, r - np.sqrt(np.maximum(r * r - step * step / 4, 0.0))), outer)
    inner = height(side * np.where(is_beside, step - r_t, r_t), t)
    has_tip = (t >= r * (1 - cosine)) & (~is_beside | (psi >= 0) | (step >= 2 * r * sine))
    lowest = np.where(has_tip, 0.0, np.minimum(np.minimum(outer, inner), cusp))
    return lowest, np.maximum(np.maximum(outer, inner), cusp)


def edge_radius_mm(radius_mm, height_mm):
    """Distance from the axis of a ball's edge at a height over its tip; above the ball its shank.

    >>> lowest, highest = edge_in_cut_mm(5.41, 1.0, 0.5, np.radians(-25.0))
    >>> float(edge_radius_mm(5.41, lowest).round(3))
    2.057
    """
    below = np.maximum(radius_mm - np.asarray(height_mm, float), 0.0)
    return np.sqrt(np.maximum(radius_mm * radius_mm - below * below, 0.0))


def edge_speed_m_per_min(edge_radius_mm, rpm):
    """Cutting speed at a distance from the axis.

    >>> float(edge_speed_m_per_min(5.0, 4775.0).round(1))
    150.0
    """
    return 2 * np.pi * np.asarray(edge_radius_mm, float) * rpm / 1000.0


def inclined_depth_mm(radius_mm, layer_mm, lean_rad):
    """a_m of a ball that leans in the direction of its feed, the shank above the ball included.

    >>> inclined_depth_mm(np.array([4.0, 5.41]), 1.0, np.radians([68.0, 25.0])).round(4)
    array([3.3904, 2.2307])
    """
    cosine, sine = fixed.cos(lean_rad), fixed.sin(lean_rad)
    on_ball = layer_mm * cosine + layer_radius_mm(radius_mm, layer_mm) * sine
    return np.where(layer_mm <= radius_mm * (1 - sine), on_ball, (layer_mm + radius_mm * sine * (1 - sine)) / cosine)


def inclined_lowest_radius_mm(radius_mm, lean_rad):
    """Distance from the axis at which a leaning ball touches the plane below it: it cuts no nearer to its tip."""
    return radius_mm * fixed.sin(lean_rad)


def transition_depth_mm(radius_mm, layer_mm, slope_rad):
    """a_m where a pass on a level plane meets a slope whose layer is as thick: more than on either.

    >>> float(transition_depth_mm(4.0, 1.0, np.radians(68.0)).round(3))
    5.892
    """
    return radius_mm + (layer_mm - radius_mm * (1 - fixed.sin(slope_rad))) / fixed.cos(slope_rad)


def slotting_depth_mm(radius_mm, axial_step_mm, phi_rad):
    """a_e of a ball that goes down by a step in its own groove, the shank above the ball included.

    Args:
        phi_rad: of the edge about the axis, from the side of the groove; feed at 90 degrees.
    >>> slotting_depth_mm(5.0, 1.0, np.radians([90.0, 0.0])).round(6)
    array([1., 6.])
    """
    phi = np.asarray(phi_rad, float)
    sine = np.abs(fixed.sin(phi))
    free = 1 / np.maximum(sine * sine, 1e-18)
    on_ball = radius_mm + axial_step_mm * free - np.sqrt(np.maximum(
        radius_mm * radius_mm + axial_step_mm ** 2 * (free * free - free), 0.0))
    return np.where(sine > axial_step_mm / radius_mm, on_ball, axial_step_mm + (1 - sine) * radius_mm)


def slotting_angle_rad(radius_mm, axial_step_mm):
    """phi_r: nearer to the groove's side than this the shank cuts too.

    >>> float(np.degrees(slotting_angle_rad(10.0, 5.0)).round(6))
    30.0
    """
    return fixed.arcsin(axial_step_mm / radius_mm)


def level_depth_mm(radius_mm, layer_mm, step_mm, phi_rad):
    """a_e on a level plane (psi = 0); past the critical angle all of the layer.

    Args:
        phi_rad: of the edge about the axis, from the side of the pass before: 90 degrees along the feed, 180 at the new side.
    >>> level_depth_mm(10.0, 1.0, 2.0, np.radians([90.0, 120.0, 180.0])).round(4)
    array([0.202 , 0.8348, 1.    ])
    """
    cosine = np.abs(fixed.cos(phi_rad))
    u = step_mm / np.maximum(1 - cosine, 1e-12)
    is_before = u < layer_radius_mm(radius_mm, layer_mm)
    depth = radius_mm - np.sqrt(np.maximum(radius_mm * radius_mm - u * u, 0.0))
    return np.where(is_before, depth, layer_mm)


def instant_depth_mm(radius_mm, radial_step_mm, axial_step_mm, phi_rad):
    """a_e: height at which the edge of the ball crosses the surface that the pass before has left.

    Args:
        radial_step_mm, axial_step_mm: a_r >= 0 and a_a; a_a < 0: step-up.
        phi_rad: of the edge about the axis, 90 (along the feed) to 180 degrees (away from the pass before).
    Returns:
        the lowest root in (0, r] of (u |cos phi| + a_r)² + (a_e - r - a_a)² = r² with u² = 2 r a_e - a_e²; NaN: the edge
        crosses it nowhere on the ball.

    >>> float(instant_depth_mm(5.0, 0.0, 1.0, np.radians(90.0)).round(6))        # a groove made deeper by 1 mm
    1.0
    """
    given = np.broadcast_arrays(radius_mm, radial_step_mm, axial_step_mm, np.abs(fixed.cos(phi_rad)))
    out = np.empty(given[0].shape)
    _cross(np.column_stack([v.ravel() for v in given]).astype(float), out.reshape(-1))
    return out


@njit
def _cross(rows, out):
    for k in range(len(rows)):
        out[k] = _first_crossing(rows[k])


@njit
def _first_crossing(row):
    """The lowest crossing; low on the ball, where it is flat, the parts of the range are short."""
    low, at_low, high = 0.0, _beyond_before(0.0, row), -1.0
    for k in range(1, SCANNED + 1):
        place = row[BALL] * (k / SCANNED) * (k / SCANNED)
        here = _beyond_before(place, row)
        if (here <= 0.0) != (at_low <= 0.0):
            high = place
            break
        low, at_low = place, here
    if high < 0.0:
        return math.nan
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if (_beyond_before(middle, row) <= 0.0) == (at_low <= 0.0):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@njit
def _beyond_before(depth_mm, row):
    """How far a place of the edge is outside the pass before: difference of squares, mm²."""
    across = math.sqrt(max(2 * row[BALL] * depth_mm - depth_mm * depth_mm, 0.0)) * row[COSINE] + row[RADIAL]
    up = depth_mm - row[BALL] - row[AXIAL]
    return across * across + up * up - row[BALL] * row[BALL]
