"""Vane tips in closed form, and the programs that cut them by transverse arcs."""

import numpy as np
from known_tools import tool
from scipy.interpolate import make_interp_spline

from cuspline.program import Operation, Program
from cuspline.surfaces.circular_tip import CircularTip
from cuspline.toolpaths.arc_templates import templated_passes
from cuspline.toolpaths.transverse_arcs import arc_steps, stretches

BALL_MM, RIDGE_MM, RESOLUTION_MM, HALF_MM, CLEARANCE_MM = 3.0, 0.004, 1e-4, 9.0, 60.0
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


def passes(tip, register_mm=BALL_MM, is_rough=False, ridge_mm=RIDGE_MM, **changes):
    """(TemplatedPasses, ArcSteps)."""
    along, steps = planes(tip, ridge_mm=ridge_mm)
    asked = {"flank_rad": tip.flank_half_angle_rad, "register_mm": register_mm, "ball_radius_mm": BALL_MM,
             "half_width_mm": HALF_MM, "clearance_z_mm": CLEARANCE_MM,
             "feed_mm_per_min": 800.0, "slow_mm_per_min": 240.0, "restart_steps": 50,
             "is_rough": is_rough} | changes
    return templated_passes(along, steps, **asked), steps


def vane_program(tip, *, register_mm=BALL_MM, restart_steps=50, ridge_mm=RIDGE_MM):
    """Rough and finish of a tip."""
    told = (("rough passes", passes(tip, BALL_MM + 0.254, True, 0.05, restart_steps=restart_steps)[0]),
            ("finish", passes(tip, register_mm, False, ridge_mm, restart_steps=restart_steps)[0]))
    return Program(name="vane", setup="setup-1", wcs="G55", wcs_in_words="end", clearance_z_mm=CLEARANCE_MM,
                   header=("VANE",), operations=tuple(
                       Operation(name=name, tool=BALL, spindle_rpm=8000.0, coolant="flood", moves=p.moves(), passes=p)
                       for name, p in told))
