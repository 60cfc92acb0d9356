"""Vane tips in closed form, and the programs that cut them by transverse arcs."""

import numpy as np
from known_tools import tool
from scipy.interpolate import make_interp_spline

from cuspline.program.program import Operation, Program
from cuspline.toolpaths.vane.arc_templates import RegisterValues, templated_passes
from cuspline.toolpaths.vane.circular_tip import CircularTip
from cuspline.toolpaths.vane.cutter_surface import cut_map
from cuspline.toolpaths.vane.transverse_arcs import arc_steps, stretches

BALL_MM, RIDGE_MM, RESOLUTION_MM, HALF_MM, CLEARANCE_MM = 3.0, 0.004, 1e-4, 9.0, 60.0
JOINT_MM = 0.7 * BALL_MM     # beside a joint of sections the neighbour may reach lower than the map says
BALL = tool("ball", 2 * BALL_MM, number=7)


def tip_of(center_z, radius=lambda x: 5.0 + 0 * x, length_mm=40.0, degree=5):
    """CircularTip through functions of x."""
    x = np.linspace(0.0, length_mm, 161)
    center, wide = (make_interp_spline(x, f(x), k=degree) for f in (center_z, radius))
    return CircularTip(degree=degree, knots_mm=center.t, center_poles_mm=center.c, radius_poles_mm=wide.c,
                       flank_half_angle_rad=np.radians(10.0), foot_z_mm=10.0)


def wavy_tip():
    """Slopes up to 0.16, valleys of radius 30 mm and more."""
    return tip_of(lambda x: 40.0 + np.cos(x / 6.0) * 1.0, lambda x: 5.0 + 0.2 * np.sin(x / 9.0))


def steep_tip():
    """Steep at the start as a radial matching section, level behind."""
    return tip_of(lambda x: 40.0 - 12.0 * np.exp(-x / 8.0))


def planes(tip, ball_mm=BALL_MM, ridge_mm=RIDGE_MM):
    """(stretches, ArcSteps)."""
    along = stretches(tip, ball_mm, ridge_mm, RESOLUTION_MM)
    return along, arc_steps(tip, ball_mm, np.concatenate([s.planes for s in along]))


def passes(tip, register_mm=BALL_MM, is_rough=False, ridge_mm=RIDGE_MM, restart_steps=50, **changes):
    """(TemplatedPasses, ArcSteps)."""
    along, steps = planes(tip, ridge_mm=ridge_mm)
    values = RegisterValues(**{
        "flank_rad": tip.flank_half_angle_rad, "tool_radius_mm": register_mm, "ball_radius_mm": BALL_MM, "half_width_mm": HALF_MM,
        "clearance_z_mm": CLEARANCE_MM, "feed_mm_per_min": 800.0, "slow_mm_per_min": 240.0} | changes)
    return templated_passes(along, steps, values, restart_steps=restart_steps, is_rough=is_rough), steps


def vane_program(tip, *, register_mm=BALL_MM, restart_steps=50, ridge_mm=RIDGE_MM):
    """Rough and finish of a tip."""
    told = (("rough passes", passes(tip, BALL_MM + 0.254, True, 0.05, restart_steps=restart_steps)[0]),
            ("finish", passes(tip, register_mm, False, ridge_mm, restart_steps=restart_steps)[0]))
    return Program(name="vane", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=CLEARANCE_MM,
                   header=("VANE",), operations=tuple(
                       Operation(name=name, tool=BALL, spindle_rpm=8000.0, coolant="flood", moves=p.moves(), passes=p)
                       for name, p in told))


def predicted(tip, register_mm, x, turn):
    """(n,) the map's deviation at places of the arc: along its columns, then across; NaN where it is not sure."""
    found = cut_map(tip, BALL_MM, register_mm, 0.1)
    assert not found.is_folded.any()
    place, deviation = found.place_mm[:, :-1], found.deviation_mm[:, :-1]
    around = np.arctan2(place[..., 1], place[..., 2] - tip.center_z_mm(place[..., 0]))
    columns = range(deviation.shape[1])
    known = [np.flatnonzero(np.isfinite(deviation[:, k])) for k in columns]
    # feet may pass each other at a joint
    known = [rows[place[rows, k, 0].argsort()] for k, rows in zip(columns, known)]
    at_x = lambda values: np.column_stack([np.interp(x, place[rows, k, 0], values[rows, k], np.nan, np.nan)
                                           for k, rows in zip(columns, known)])
    turns, left = at_x(around), at_x(deviation)
    out = np.array([np.interp(abs(t), row, d) for t, row, d in zip(turn, turns, left)])
    joints = place[np.flatnonzero(np.diff(found.is_matching)), 0, 0]
    sure = np.isfinite(turns).all(axis=1) & (np.abs(turn) < 0.985 * np.minimum(turns.max(axis=1), tip.half_arc_rad))
    sure &= np.abs(x - joints[0]) > JOINT_MM if len(joints) else True
    return np.where(sure, out, np.nan)
