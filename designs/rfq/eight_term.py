"""The eight-term potential of a cell with circular tips, and the tip line that goes with it.

    2U/V = A01 (r/r0)² cos 2θ + A03 (r/r0)⁶ cos 6θ + [A10 I0(kr) + A12 I4(kr) cos 4θ] cos kz
         + [A21 I2(2kr) cos 2θ + A23 I6(2kr) cos 6θ] cos 2kz + [A30 I0(3kr) + A32 I4(3kr) cos 4θ] cos 3kz

The coefficients are fitted to 2U/V = 1 on the circular arcs along the two-term tip; the vane beside it follows by
symmetry (a quarter turn and z to L - z change every term's sign).  The tip line is where the fitted potential is level
in the vane's mid-plane.  One round: the terms of higher harmonics follow nearly any line they are fitted to, so more
rounds would creep by a micrometre each and settle nothing.  At the ends of a cell the tip stands at a and m a, as in
the table: what the fit misses there is taken out as one more term in cos kz.
Source: docs/formulas.md 2; PARMTEQM prints A01 (its A0), A03 (A1) and A10 of circular tips, from tables of its own.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.roots import rising_roots

ARC_RAD = np.radians(30.0)      # of the arc to either side of the crest, that the fit asks for
ALONG, ROUND = 25, 9            # places of the fit along the cell and round half the arc
NAMES = ("A01", "A03", "A10", "A12", "A21", "A23", "A30", "A32")
# (order of the Bessel function or of r, harmonic along, harmonic round) of each term
ORDERS = ((2, 0, 2), (6, 0, 6), (0, 1, 0), (4, 1, 4), (2, 2, 2), (6, 2, 6), (0, 3, 0), (4, 3, 4))


@dataclass(frozen=True, eq=False, kw_only=True)
class EightTerm:
    """One cell's potential and tips."""

    aperture_mm: float
    modulation: float
    length_mm: float
    r0_mm: float
    coefficients: np.ndarray    # (8,) in the order of NAMES

    def __post_init__(self):
        object.__setattr__(self, "coefficients", frozen(self.coefficients, (8,), "coefficients"))

    @classmethod
    def fitted(cls, two_term, rho_mm):
        """The potential of circular tips of radius rho along the two-term tips of the same a, m and L."""
        given = {"aperture_mm": two_term.aperture_mm, "modulation": two_term.modulation,
                 "length_mm": two_term.length_mm, "r0_mm": two_term.r0_mm}
        z = (np.arange(ALONG) + 0.5) / ALONG * two_term.length_mm
        return cls(coefficients=_fit(given, z, two_term.tip_mm(z, 1), rho_mm), **given)

    @property
    def wave_per_mm(self):
        """k = pi / L."""
        return np.pi / self.length_mm

    def terms(self):
        """{name: value} of the coefficients."""
        return dict(zip(NAMES, self.coefficients.tolist()))

    def potential(self, x_mm, y_mm, z_mm):
        """(n,) 2U/V at places across (x, y) and along (z) the beam; the vane at y = 0, x > 0 stands at +1."""
        r, theta = fixed.hypot(x_mm, y_mm), fixed.arctan2(y_mm, x_mm)
        return fixed.matmul(_terms(r, theta, z_mm, self.wave_per_mm, self.r0_mm), self.coefficients)

    def level(self, z_mm):
        """(n,) value of the potential that the tip line keeps to."""
        ends = self.potential(np.array([1.0, self.modulation]) * self.aperture_mm, np.zeros(2),
                              np.array([0.0, self.length_mm]))
        return ends.mean() + (ends[0] - ends[1]) / 2 * fixed.cos(self.wave_per_mm * np.asarray(z_mm, float))

    def tip_mm(self, z_mm, sign):
        """(n,) distance of a tip from the axis; `sign` +1: of the vane that begins at a, -1: at m a."""
        z = np.asarray(z_mm, float)
        z = z if sign > 0 else self.length_mm - z
        k, r0, level = self.wave_per_mm, self.r0_mm, self.level(z)
        value = lambda r: fixed.matmul(_terms(r, 0.0 * r, z, k, r0), self.coefficients) - level
        slope = lambda r: fixed.matmul(_slopes(r, z, k, r0), self.coefficients)
        reach = 1e-6 * self.aperture_mm
        return rising_roots(value, slope, np.full_like(z, self.aperture_mm - reach),
                            np.full_like(z, self.aperture_mm * self.modulation + reach))


def _fit(given, z, r, rho):
    """(8,) coefficients by least squares on the arcs."""
    turn = np.linspace(0.0, ARC_RAD, ROUND)
    x = ((r + rho)[:, None] - rho * fixed.cos(turn)).ravel()
    y = np.broadcast_to(rho * fixed.sin(turn), (len(r), ROUND)).ravel()
    rows = _terms(fixed.hypot(x, y), fixed.arctan2(y, x), np.repeat(z, ROUND), np.pi / given["length_mm"], given["r0_mm"])
    scale = np.abs(rows).max(axis=0)        # the terms differ by orders of magnitude
    return fixed.least_squares(rows / scale, np.ones((len(rows), 1)))[:, 0] / scale


def _terms(r, theta, z, k, r0):
    """(n, 8) the terms without their coefficients."""
    columns = [(fixed.power(r / r0, n) if not h else fixed.bessel_i(n, h * k * r) * fixed.cos(h * k * z)) * fixed.cos(t * theta)
               for n, h, t in ORDERS]
    return np.stack(columns, axis=-1)


def _slopes(r, z, k, r0):
    """(n, 8) derivatives of the terms by r in the mid-plane."""
    columns = [n * fixed.power(r / r0, n - 1) / r0 if not h else h * k * fixed.bessel_i_slope(n, h * k * r) * fixed.cos(h * k * z)
               for n, h, _ in ORDERS]
    return np.stack(columns, axis=-1)
