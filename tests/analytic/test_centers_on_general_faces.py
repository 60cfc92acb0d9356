"""The ball touches beside the section plane: centres over faces that are not prismatic, in closed form."""

import cadquery as cq
import numpy as np
import pytest
from known_parts import JOIN_MM, Drawing, chain_of, largest_gap_mm, up_of
from scipy.optimize import brentq

from cuspline.kernel.brep import the_solid

EXACT_MM = 1e-6         # a thousandth of the profile tolerance
PLANES = pytest.mark.parametrize("plane", ["ZX", "YZ"])


def block(width=60.0, height=10.0):
    """A block round the origin, its top at z = 0."""
    return cq.Workplane("XY").box(width, width, height, centered=(True, True, False)).translate((0, 0, -height))


def check(solid, plane, radius, across, along, exact):
    chain = chain_of(the_solid(solid), plane, radius, across)
    np.testing.assert_allclose(up_of(chain, along), exact, rtol=0, atol=EXACT_MM)
    assert largest_gap_mm(chain) < JOIN_MM


@PLANES
@pytest.mark.parametrize("across", [0.0, 3.1, -11.0, 14.9])
def test_over_a_dome_the_centre_runs_on_the_larger_sphere(plane, across):
    R, r, low = 20.0, 5.0, -8.0
    dome = block().union(cq.Workplane("XY").sphere(R).translate((0, 0, low)))
    reach = np.sqrt((R + r) ** 2 - (r - low) ** 2 - across ** 2)     # where the block's top takes over
    along = np.linspace(-reach, reach, 101)
    check(dome, plane, r, across, along, low + np.sqrt((R + r) ** 2 - along ** 2 - across ** 2))


@PLANES
@pytest.mark.parametrize("across", [0.0, 3.1, -7.0])
def test_in_a_bowl_the_centre_runs_on_the_smaller_sphere(plane, across):
    R, r, high = 20.0, 5.0, 8.0
    bowl = block(height=30.0).cut(cq.Workplane("XY").sphere(R).translate((0, 0, high)))
    reach = 0.999 * np.sqrt(((R - r) * np.sqrt(1 - (high / R) ** 2)) ** 2 - across ** 2)     # contact at the rim
    along = np.linspace(-reach, reach, 101)
    check(bowl, plane, r, across, along, high - np.sqrt((R - r) ** 2 - along ** 2 - across ** 2))


@PLANES
@pytest.mark.parametrize("across", [0.0, 4.0, -9.5])
def test_over_a_cone_the_centre_runs_on_the_offset_cone(plane, across):
    # frustum: radius 20 at z = 0, 5 at z = 15, 45 degrees: centre at z = 20 - rho + r sqrt(2)
    r = 3.0
    cone = block().union(cq.Workplane(obj=cq.Solid.makeCone(20, 5, 15)))
    inner, outer = 5 + r / np.sqrt(2), 20 + r / np.sqrt(2) - r * np.sqrt(2)
    along = np.linspace(0, outer, 400)
    along = np.r_[-along[::-1], along]
    rho = np.hypot(along, across)
    along, rho = along[(rho > inner + 1e-6) & (rho < outer)], rho[(rho > inner + 1e-6) & (rho < outer)]
    check(cone, plane, r, across, along, 20 - rho + r * np.sqrt(2))


@PLANES
@pytest.mark.parametrize("turn_deg, tilt_deg", [(30, 0), (65, 0), (40, 20), (90, 15)])
def test_over_an_oblique_bar_the_centre_runs_on_the_larger_cylinder(plane, turn_deg, tilt_deg):
    R, r, across = 6.0, 4.0, 2.3
    bar = cq.Solid.makeCylinder(R, 80, cq.Vector(-40, 0, 0), cq.Vector(1, 0, 0))
    bar = bar.rotate((0, 0, 0), (0, 1, 0), -tilt_deg).rotate((0, 0, 0), (0, 0, 1), turn_deg)
    t, b = np.radians(turn_deg), np.radians(tilt_deg)
    axis = np.array([np.cos(b) * np.cos(t), np.cos(b) * np.sin(t), np.sin(b)])
    k = 0 if plane == "ZX" else 1
    along = np.linspace(-4, 4, 81)
    exact = []
    for a in along:
        p = np.empty(3)
        p[k], p[1 - k], p[2] = a, across, 0.0
        # |p + z e_z|² - (axis . (p + z e_z))² = (R + r)², its upper root
        A, B, C = 1 - axis[2] ** 2, -(axis @ p) * axis[2], p @ p - (axis @ p) ** 2 - (R + r) ** 2
        exact.append((-B + np.sqrt(B * B - A * C)) / A if B * B > A * C else np.nan)
    exact = np.array(exact)
    keep = np.isfinite(exact)
    assert keep.sum() > 20
    check(bar, plane, r, across, along[keep], exact[keep])


@PLANES
@pytest.mark.parametrize("across", [0.0, 5.0, 13.0])
def test_over_a_ring_the_centre_runs_on_the_thicker_torus(plane, across):
    A, a, r = 16.0, 4.0, 3.0
    ring = block().union(cq.Workplane(obj=cq.Solid.makeTorus(A, a)))
    along = np.linspace(-30, 30, 1201)
    rho = np.hypot(along, across)
    free = np.abs(rho - A) < np.sqrt((a + r) ** 2 - r ** 2) - 1e-3          # above the block's top
    along, rho = along[free], rho[free]
    check(ring, plane, r, across, along, np.sqrt((a + r) ** 2 - (rho - A) ** 2))


@PLANES
@pytest.mark.parametrize("across", [0.0, 5.0])
def test_in_a_fillet_round_a_boss_the_centre_runs_on_the_thinner_torus(plane, across):
    boss, fillet, r = 8.0, 5.0, 3.0
    part = block().faces(">Z").workplane().circle(boss).extrude(12)
    part = part.edges(cq.selectors.BoxSelector((-9, -9, -0.1), (9, 9, 0.1))).fillet(fillet)
    A = boss + fillet
    along = np.linspace(-A, A, 801)
    rho = np.hypot(along, across)
    inside = (rho > boss + r + 1e-3) & (rho < A)
    along, rho = along[inside], rho[inside]
    check(part, plane, r, across, along, fillet - np.sqrt((fillet - r) ** 2 - (A - rho) ** 2))


@PLANES
@pytest.mark.parametrize("width_across", [4.0, 11.0])
def test_over_a_loft_the_centre_solves_the_ruled_surface(plane, width_across):
    # z = h(t) (1 - 0.2 v) at across = 40 v: heights of an ellipse arc scaled to 0.8 at the far end
    a, b, r, width = 15.0, 10.0, 4.0, 40.0

    def wire(scale, across):
        d = Drawing(plane, across)
        ends = [(20 + a * np.cos(t), scale * (20 + b * np.sin(t))) for t in np.radians((150, 30))]
        return d.closed([d.ellipse((20, scale * 20), a, scale * b, 30, 150)], *ends)

    loft = cq.Solid.makeLoft([wire(1.0, 0.0), wire(0.8, width)], True)
    centers = []
    for t in np.radians(np.linspace(148, 32, 81)):
        h, dx, dh = 20 + b * np.sin(t), a * np.sin(t), -b * np.cos(t)

        def contact(v):
            s = 1 - 0.2 * v
            n = np.array([-dh * s, dx * 0.2 * h / width, dx])       # grad of z - h(x) s(v)
            n /= np.linalg.norm(n)
            return np.array([20 + a * np.cos(t), width * v, h * s]) + r * n

        v = brentq(lambda v: contact(v)[1] - width_across, -0.3, 1.3, xtol=1e-14)
        if 0.0 <= v <= 1.0:
            centers.append(contact(v)[[0, 2]])
    centers = np.array(centers)
    assert len(centers) > 60
    check(loft, plane, r, width_across, centers[:, 0], centers[:, 1])
