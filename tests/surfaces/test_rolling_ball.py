"""A ball rolled round a post on a shaft, in closed form; with a changing radius no ball cuts into the fillet."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from cuspline.splines.closed_splines import periodic_spline
from cuspline.splines.nurbs import NurbsSurface
from cuspline.surfaces.rolling_ball import Revolved, fillet_errors, fillet_of, rolled

POST_MM, SHAFT_MM, TOP_MM = 5.0, 20.0, 60.0


def shaft(slope=0.0):
    return Revolved(profile=BSpline(np.repeat([-50.0, 50.0], 4), SHAFT_MM + slope * np.linspace(-50, 50, 4), 3),
                    half_angle_rad=float(np.arctan(slope)))


def post(count=240):
    """A round post along Z, u its angle, v from 0 to 1 up from the shaft's axis; within 1e-9 mm."""
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ring = periodic_spline(t, POST_MM * np.column_stack([np.cos(t), np.sin(t)]), 2 * np.pi)
    poles = np.zeros((len(ring.c), 4, 4))
    poles[..., :2], poles[..., 2], poles[..., 3] = ring.c[:, None], TOP_MM * np.linspace(0, 1, 4), 1.0
    return NurbsSurface(degree_u=5, degree_v=3, knots_u=ring.t, knots_v=np.repeat([0.0, 1.0], 4), poles=poles)


def even(radius):
    return lambda u: (np.full(len(u), radius), np.zeros(len(u)))


def changing(u):
    return 3.0 + 1.5 * np.cos(u), -1.5 * np.sin(u)


def test_the_ball_round_a_post_is_where_geometry_says():
    """Centre at a + r from the post's axis and R + r from the shaft's."""
    r, u = 3.0, np.linspace(0, 2 * np.pi, 90, endpoint=False)
    balls = rolled(post(), 1.0, shaft(), even(r), u, (0.1, 0.95))
    wanted = np.column_stack([(POST_MM + r) * np.cos(u), (POST_MM + r) * np.sin(u),
                              np.sqrt((SHAFT_MM + r) ** 2 - ((POST_MM + r) * np.sin(u)) ** 2)])
    assert np.abs(balls.center_mm - wanted).max() < 1e-8
    assert np.abs(np.hypot(balls.foot_mm[:, 1], balls.foot_mm[:, 2]) - SHAFT_MM).max() < 1e-10
    along = (np.roll(wanted, -1, 0) - np.roll(wanted, 1, 0)) / (2 * (u[1] - u[0]))
    assert np.abs(balls.motion_mm - along).max() < 0.02         # differences of second order


@pytest.mark.parametrize("law", [even(3.0), changing], ids=["even", "changing"])
@pytest.mark.parametrize("slope", [0.0, 0.15], ids=["cylinder", "cone"])
def test_the_fillet_is_tangent_to_both_and_rolls_truly(law, slope):
    u = np.linspace(0, 2 * np.pi, 240, endpoint=False)
    blade, hub = post(), shaft(slope)
    fillet = fillet_of(rolled(blade, 1.0, hub, law, u, (0.1, 0.95)), 2 * np.pi)
    errors = fillet_errors(fillet.surface.derivatives, True, rolled(blade, 1.0, hub, law, u + 0.5 * u[1], (0.1, 0.95)))
    assert errors.ball_mm < 1e-6 and errors.blade_angle_deg < 1e-4 and errors.hub_angle_deg < 1e-4
    assert errors.blade_border_mm < 1e-6 and errors.hub_border_mm < 1e-6


def test_no_ball_of_a_changing_radius_cuts_into_the_fillet():
    """The fillet is the balls' envelope; arcs through the balls' own centres would be cut into by their neighbours."""
    u = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    balls = rolled(post(), 1.0, shaft(), changing, u, (0.1, 0.95))
    fillet = fillet_of(balls, 2 * np.pi)
    place, across = (g.ravel() for g in np.meshgrid(np.linspace(0.3, 2.8, 40), np.linspace(0, 1, 9), indexing="ij"))
    points = fillet.surface.derivatives(place, across)[:, 0]
    clear = lambda p: (np.linalg.norm(p[:, None] - balls.center_mm, axis=2) - balls.radius_mm).min(axis=1)
    assert clear(points).min() > -1e-6          # entered by none
    assert clear(points).max() < 3e-4           # touched by one, as near as 720 balls tell
    r, _ = changing(place)
    own = rolled(post(), 1.0, shaft(), changing, place, (0.1, 0.95))
    a, b = own.contact_mm - own.center_mm, own.foot_mm - own.center_mm
    middle = a + b
    great = own.center_mm + middle / np.linalg.norm(middle, axis=1)[:, None] * r[:, None]
    assert clear(great).min() < -2e-3


def test_halving_the_spacing_divides_the_error_by_thirty():
    errors = []
    for count in (40, 80):
        u = np.linspace(0, 2 * np.pi, count, endpoint=False)
        fillet = fillet_of(rolled(post(), 1.0, shaft(), changing, u, (0.1, 0.95)), 2 * np.pi)
        between = rolled(post(), 1.0, shaft(), changing, u + 0.5 * u[1], (0.1, 0.95))
        errors.append(fillet_errors(fillet.surface.derivatives, True, between).ball_mm)
    assert errors[0] / errors[1] > 30


def test_a_ball_that_finds_no_place_says_so():
    balls = rolled(post(), 1.0, shaft(), even(60.0), np.array([0.0, np.pi / 2]), (0.1, 0.95))
    assert np.isnan(balls.v[0]) and np.isnan(balls.center_mm[0]).all()
    assert balls.center_mm[1, 2] == pytest.approx(np.sqrt((SHAFT_MM + 60) ** 2 - (POST_MM + 60) ** 2), abs=1e-7)
