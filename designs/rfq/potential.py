r"""Potentials of an RFQ and the tip lines that they give: distance r(z) of a vane's crest from the beam axis.

    vane x begins a cell (z = 0) at its narrowest, r = a, and ends it at r = m a; vane y the other way round.
    X (r/a)² + s A10 I0(k r) cos k z = 1,   s = +1 for the vane that begins at a, -1 for the other

Lengths in mm, z from the beginning of a cell.  Source: docs/formulas.md 2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.roots import rising_roots

MATCHING_ROOT = 0.38    # of the matching section's length: closer to the wall its equipotential has no root


@dataclass(frozen=True, kw_only=True)
class TwoTerm:
    """The two-term potential of one cell."""

    aperture_mm: float      # a
    modulation: float       # m
    length_mm: float        # L

    def __post_init__(self):
        if self.quadrupole <= 0:
            raise DesignError(f"a = {self.aperture_mm:.4f} mm, m = {self.modulation:g} and L = {self.length_mm:.4f} mm "
                              f"leave no quadrupole (X = {self.quadrupole:.4g}): the modulation is too strong for so "
                              "short a cell")
        if self._rises(self.aperture_mm * self.modulation) <= 0:
            raise DesignError(f"the tip crosses itself: at m a = {self.aperture_mm * self.modulation:.4f} mm its line "
                              f"turns back (L = {self.length_mm:.4f} mm): lower the modulation {self.modulation:g}, or "
                              "lengthen the cell")

    @property
    def wave_per_mm(self):
        """k = pi / L."""
        return np.pi / self.length_mm

    @property
    def acceleration(self):
        """A10."""
        k, a, m = self.wave_per_mm, self.aperture_mm, self.modulation
        return (m * m - 1.0) / (m * m * fixed.bessel_i(0, k * a) + fixed.bessel_i(0, m * k * a))

    @property
    def quadrupole(self):
        """X."""
        return 1.0 - self.acceleration * fixed.bessel_i(0, self.wave_per_mm * self.aperture_mm)

    @property
    def r0_mm(self):
        """Distance of both tips from the axis in the middle of the cell."""
        return self.aperture_mm / np.sqrt(self.quadrupole)

    def _rises(self, r):
        """Derivative of the vane's equation by r where cos kz is -1: it must rise."""
        k = self.wave_per_mm
        return 2 * self.quadrupole * r / self.aperture_mm ** 2 - self.acceleration * k * fixed.bessel_i(1, k * r)

    def tip_mm(self, z_mm, sign):
        """(n,) distance of a tip from the axis.

        Args:
            z_mm: (n,) from the beginning of the cell.
            sign: +1 the vane that begins at a, -1 the one that begins at m a.
        """
        z = np.asarray(z_mm, float)
        k, X, a = self.wave_per_mm, self.quadrupole, self.aperture_mm
        wave = sign * self.acceleration * fixed.cos(k * z)
        value = lambda r: X * (r / a) ** 2 + wave * fixed.bessel_i(0, k * r) - 1.0
        slope = lambda r: 2 * X * r / a ** 2 + wave * k * fixed.bessel_i(1, k * r)
        low, high = a * (1 - 1e-9), a * self.modulation * (1 + 1e-9)
        return rising_roots(value, slope, np.full_like(z, low), np.full_like(z, high))

    @property
    def valley_radius_mm(self):
        """Longitudinal radius of the tip line where it is farthest from the beam: the limit of the cutter's radius."""
        k, A, r = self.wave_per_mm, self.acceleration, self.aperture_mm * self.modulation
        return self._rises(r) / (A * k * k * fixed.bessel_i(0, k * r)) if A > 0 else np.inf


def aperture_of_r0_mm(r0_mm, modulation, length_mm):
    """(a, A10) of the two-term cell whose tips stand r0 from the axis in its middle."""
    if modulation == 1.0:
        return r0_mm, 0.0
    X = lambda a: 1.0 - (modulation ** 2 - 1.0) / (modulation ** 2 + fixed.bessel_i(0, modulation * np.pi * a / length_mm)
                                                   / fixed.bessel_i(0, np.pi * a / length_mm))
    a = brentq(lambda a: a / np.sqrt(X(a)) - r0_mm, 1e-3 * r0_mm, r0_mm, xtol=1e-14)
    cell = TwoTerm(aperture_mm=a, modulation=modulation, length_mm=length_mm)
    return a, cell.acceleration


# ends of the vanes --------------------------------------------------------------------------------------


def thin_matcher_mm(z_mm, length_mm, r0_mm):
    """(n,) aperture of the radial matching section by the thin-vane formula r0 / sin^1.5(pi z / 2 L), z > 0."""
    return r0_mm / fixed.power(fixed.sin(np.pi * np.asarray(z_mm, float) / (2 * length_mm)), 1.5)


def equipotential_matcher_mm(z_mm, length_mm, r0_mm):
    """(n,) aperture of the radial matching section on its equipotential; NaN where it has no root.

    A [I2(kr) sin kz - I2(3kr) sin(3kz) / 27] = 1 with k = pi / 2L, A such that it is r0 at z = L.
    """
    k, z = np.pi / (2 * length_mm), np.atleast_1d(np.asarray(z_mm, float))
    part = lambda r, z: fixed.bessel_i(2, k * r) * fixed.sin(k * z) - fixed.bessel_i(2, 3 * k * r) * fixed.sin(3 * k * z) / 27.0
    level = part(r0_mm, length_mm)
    out = np.full(len(z), np.nan)
    for i, at in enumerate(z):
        r = np.linspace(0.5 * r0_mm, 6.0 * length_mm, 4000)
        above = np.flatnonzero(part(r, at) > level)
        if len(above) and above[0] > 0:
            out[i] = brentq(lambda q: part(q, at) - level, r[above[0] - 1], r[above[0]], xtol=1e-13)
    return out


@dataclass(frozen=True, kw_only=True)
class Transition:
    """A transition cell: from the last modulated cell's a and m a to straight tips at r0, with a third harmonic.

    (r/r0)² + s [A10 I0(kr) cos kz + A30 I0(3kr) cos 3kz] = 1, k = pi / 2L.
    """

    aperture_mm: float
    modulation: float
    r0_mm: float
    length_mm: float

    @property
    def wave_per_mm(self):
        return np.pi / (2 * self.length_mm)

    @property
    def terms(self):
        """(A10, A30): both tips begin at the last cell's own ends."""
        k, a, b = self.wave_per_mm, self.aperture_mm, self.aperture_mm * self.modulation
        rows = np.array([[fixed.bessel_i(0, k * r), fixed.bessel_i(0, 3 * k * r)] for r in (a, b)])
        return fixed.solve(rows, [1 - (a / self.r0_mm) ** 2, (b / self.r0_mm) ** 2 - 1])

    def tip_mm(self, z_mm, sign):
        """(n,) distance of a tip from the axis; `sign` +1: the vane that begins at a."""
        z, k, (A10, A30) = np.asarray(z_mm, float), self.wave_per_mm, self.terms
        first, third = sign * A10 * fixed.cos(k * z), sign * A30 * fixed.cos(3 * k * z)
        value = lambda r: (r / self.r0_mm) ** 2 + first * fixed.bessel_i(0, k * r) + third * fixed.bessel_i(0, 3 * k * r) - 1.0
        slope = lambda r: (2 * r / self.r0_mm ** 2 + k * first * fixed.bessel_i(1, k * r)
                           + 3 * k * third * fixed.bessel_i(1, 3 * k * r))
        reach = 1e-6 * self.aperture_mm
        return rising_roots(value, slope, np.full_like(z, self.aperture_mm - reach),
                            np.full_like(z, self.aperture_mm * self.modulation + reach))


def transition_length_mm(aperture_mm, modulation, r0_mm):
    """Length at which a transition cell's tips end level: A30/A10 = I0(k r0) / (3 I0(3 k r0)).

    Raises:
        DesignError: there is none.
    Source: docs/formulas.md 2; a check of the tables' own lengths, which the vane keeps.
    """
    a, b = aperture_mm, aperture_mm * modulation

    def miss(k):
        share = fixed.bessel_i(0, k * r0_mm) / (3 * fixed.bessel_i(0, 3 * k * r0_mm))
        part = lambda r: fixed.bessel_i(0, k * r) + share * fixed.bessel_i(0, 3 * k * r)
        return part(b) / part(a) + ((b / r0_mm) ** 2 - 1) / ((a / r0_mm) ** 2 - 1)

    k = np.linspace(0.02, 6.0, 600) / r0_mm
    values = miss(k)
    rise = np.flatnonzero((values[:-1] < 0) != (values[1:] < 0))
    if not len(rise):
        raise DesignError(f"no transition cell leads from a = {a:.4f} mm and m a = {b:.4f} mm to r0 = {r0_mm:.4f} mm")
    return np.pi / (2 * brentq(miss, k[rise[0]], k[rise[0] + 1], xtol=1e-15))
