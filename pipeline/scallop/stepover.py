"""Stepover, scallop height and segment length: the exact relations (docs/formulas.md 4 and docs/formulas.md 5)."""

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.errors import CutterDoesNotFit

FLAT_PER_MM = 1e-9          # flatter than a radius of a thousand kilometres


def stepover_for_scallop_mm(radius_mm, scallop_mm, curvature_per_mm):
    """Widest stepover at which a ball cutter leaves scallops of the given height.

    Args:
        radius_mm: ball radius, scalar > 0.
        scallop_mm: scallop height wanted, scalar > 0, far below the radius.
        curvature_per_mm: (n,) normal curvature across the feed at each CC point;
            positive on a ridge, zero on a flat, negative in a hollow.
    Returns:
        (n,) chord between neighbouring CC points, mm.
    Raises:
        CutterDoesNotFit: a hollow is tighter than the ball; `.rows` lists where.
    Source: two equal circles rolled on a third; flat: s = 2 sqrt(2 r h - h²).

    >>> stepover_for_scallop_mm(3.0, 0.01, np.array([0.0, 0.1, -0.1])).round(3)
    array([0.489, 0.429, 0.585])
    """
    k = np.atleast_1d(np.asarray(curvature_per_mm, float))
    tight = np.flatnonzero(k * radius_mm <= -1.0)
    if len(tight):
        raise CutterDoesNotFit(f"ball radius {radius_mm:.3f} mm, but {counted(len(tight), 'point')} where the surface is "
                               f"concave with radius {-1 / k[tight].min():.3f} mm; choose a smaller ball", rows=tight)
    # 1 - cos(half angle) in a form that keeps its digits on nearly flat surfaces
    rho, side = 1.0 / np.maximum(np.abs(k), FLAT_PER_MM), np.where(k < 0, -1.0, 1.0)
    versine = scallop_mm * (2 * radius_mm - scallop_mm) / (
        2 * (rho + side * radius_mm) * (rho + side * scallop_mm))
    versine = np.minimum(versine, 1.0)      # a ball that nearly fills the groove: across its whole width
    return 2 * rho * np.sqrt(versine * (2 - versine))


def scallop_for_stepover_mm(radius_mm, stepover_mm, curvature_per_mm):
    """(n,) scallop heights that a ball leaves at a given stepover, one or (n,): the inverse of `stepover_for_scallop_mm`.

    >>> scallop_for_stepover_mm(12.7, 1.27, 0.0).round(6)       # r = 0.5 in, s = 0.05 in: 0.000625 in
    array([0.015885])
    """
    k = np.atleast_1d(np.asarray(curvature_per_mm, float))
    rho, side = 1.0 / np.maximum(np.abs(k), FLAT_PER_MM), np.where(k < 0, -1.0, 1.0)
    half = fixed.arcsin(np.minimum(stepover_mm / (2 * rho), 1.0))
    reach = np.sqrt(np.maximum(radius_mm ** 2 - ((rho + side * radius_mm) * fixed.sin(half)) ** 2, 0.0))
    return radius_mm * fixed.cos(half) - side * 2 * rho * fixed.sin(half / 2) ** 2 - reach


def segment_length_mm(surface_radius_mm, cutter_radius_mm, deviation_mm):
    """Chord of the cutter-centre path that keeps the deviation, on a surface line of given radius.

    Args:
        surface_radius_mm: positive in a hollow, negative on a ridge (the source's sign).
        cutter_radius_mm: ball radius.
        deviation_mm: chord error allowed.
    Raises:
        CutterDoesNotFit: the hollow is tighter than the ball.
    Source: s = 2 |rho - r| sqrt(E (2 - E)), E = deviation / |rho - r| (docs/formulas.md 4).

    >>> round(segment_length_mm(10.0, 6.0, 0.0025), 6), round(segment_length_mm(-10.0, 6.0, 0.0025), 6)
    (0.282799, 0.565663)
    """
    path_radius = abs(surface_radius_mm - cutter_radius_mm)
    if 0 < surface_radius_mm <= cutter_radius_mm:
        raise CutterDoesNotFit(f"ball radius {cutter_radius_mm} mm where the surface is concave with radius "
                               f"{surface_radius_mm} mm; choose a smaller ball")
    share = min(deviation_mm / path_radius, 1.0)
    return 2 * path_radius * float(np.sqrt(share * (2 - share)))
