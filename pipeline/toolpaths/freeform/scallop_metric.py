"""How far apart two passes are, counted in steps of the wanted scallop height.

A cutter resting on the part leaves, a little way w along the surface from its contact, a gap of half of
Q(w, w), Q = (bending of the cutter + bending of the part) at the contact; two passes leave a scallop h
between them when sqrt(Q / 8h) of what lies between is 1.  That is a length in a metric, whichever way the
feed runs.  When the tip moves by dP the contact moves by dS and the normal turns by dn:

    8 h |dP|² = K(dS, dS) + <dS, dn>,       K = bending of the cutter;  ball: <dS, dC> / r,  C = S + r n

    ball on a surface bent by k across: step = sqrt(8 h / (1/r + k)), docs/formulas.md 5 to order h/r

All of it comes from where the cutter rests and what it touches, over a grid of (x, y): nothing is asked
of the surface but contacts.  Where the cutter rolls over an edge the contact stands still and no scallop
can form; where it bridges a hollow the contact jumps and what it jumps over is out of reach.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError

ROLLING_STEP_RADII = 0.5    # over an edge no scallop forms; the centre still goes no farther from pass to pass
TIGHTEST = 50.0             # a hollow within 2 % of the cutter's radius counts as that
JUMP = 3.0                  # a contact that moves this much faster than on both sides of it jumps


@dataclass(frozen=True, kw_only=True)
class Across:
    """A cutter that leans, on the passes of the ball that stands for it."""

    radius_mm: float            # of what it cuts, across its feed
    widest_mm: float            # no step is wider, however flat it cuts


def scallop_metric(contact_mm, normal, step_mm, *, radius_mm, corner_radius_mm=None, scallop_mm, across=None):
    """Metric in which neighbouring passes lie one apart.

    Args:
        contact_mm: (ny, nx, 3) contact over each node of an even grid, y by rows, x by columns; NaN: none.
        normal: (ny, nx, 3) unit normal there, from the contact into the cutter.
        step_mm: grid pitch, the same in x and y.
        radius_mm: cutter radius R.
        corner_radius_mm: rc; None: a ball.
        scallop_mm: scallop height wanted, far below the corner radius.
        across: Across of the cutter that leaves the scallops; None: the one that touches.
    Returns:
        (ny, nx, 3) xx, xy, yy in 1/mm² of the tip's plan (x, y); NaN where there is no contact.  The error
        of a step is of order step_mm² on smooth faces, and of scallop / radius (a ball on a flat: none).
    Raises:
        ToolpathError: a sharp-cornered cutter, whose scallops are no lengths in any metric.
    """
    rc = radius_mm if corner_radius_mm is None else corner_radius_mm
    if not 0.0 < rc <= radius_mm:
        raise ToolpathError(f"a cutter of radius {radius_mm} mm with a corner of {rc} mm leaves no round scallops; "
                            "constant scallop height needs a ball or a bull-nose cutter")
    R, cuts, widest = (radius_mm, rc, ROLLING_STEP_RADII * radius_mm) if across is None else (
        across.radius_mm, across.radius_mm, across.widest_mm)
    if not 0.0 < scallop_mm < 0.2 * cuts:
        raise ToolpathError(f"scallop height {scallop_mm} mm is not small beside the corner radius {cuts} mm")
    steps = [_along(contact_mm, normal, step_mm, axis, radius_mm, rc) for axis in (1, 0)]
    height = 8.0 * scallop_mm * (1.0 - scallop_mm / (2.0 * cuts))
    gap = np.stack([_gap(a, b, normal, R, cuts) for a, b in _pairs(steps)], axis=-1) / height
    tip = np.stack([np.einsum("...k,...k", a[2], b[2]) for a, b in _pairs(steps)], axis=-1)
    return _clipped(gap, tip, 1.0 / widest ** 2, TIGHTEST / (cuts * height))


def contact_jumps(contact_mm, normal, *, radius_mm, corner_radius_mm=None):
    """(ny, nx, 2) bool: the contact jumps from a node to its next in x [0], in y [1]; nothing is cut across.

    Args:
        contact_mm, normal, radius_mm, corner_radius_mm: as for `scallop_metric`.
    """
    rc = radius_mm if corner_radius_mm is None else corner_radius_mm
    out = np.zeros((*contact_mm.shape[:2], 2), bool)
    for k, axis in enumerate((1, 0)):
        moves = _moves(contact_mm, normal, axis, radius_mm, rc)
        np.moveaxis(out[..., k], axis, 0)[:-1] = _jumps(_speed(*moves, rc))
    return out


def _pairs(steps):
    x, y = steps
    return (x, x), (x, y), (y, y)


def _moves(contact, normal, axis, R, rc):
    """Differences of contact, normal and cutter from node to node along one axis, which comes first."""
    s, n = np.moveaxis(contact, axis, 0), np.moveaxis(normal, axis, 0)
    return tuple(np.diff(a, axis=0) for a in (s, n, s + rc * n + (R - rc) * _level(n)))


def _speed(ds, dn, dp, rc):
    """(k, n) how fast contact and corner circle move together, for a unit of the cutter's motion squared."""
    move = np.einsum("...k,...k", dp, dp)
    return np.einsum("...k,...k", ds, ds + rc * dn) / np.where(move > 0, move, np.nan)


def _along(contact, normal, step_mm, axis, R, rc):
    """How contact, normal and cutter move per mm along one axis, each (ny, nx, 3); never across a jump."""
    ds, dn, dp = _moves(contact, normal, axis, R, rc)
    speed = _speed(ds, dn, dp, rc)
    usable = np.isfinite(speed) & ~_jumps(speed)
    before = np.concatenate([np.zeros_like(usable[:1]), usable])
    after = np.concatenate([usable, np.zeros_like(usable[:1])])
    alone = ~(before | after)           # no clean neighbour: what there is
    before |= alone & np.concatenate([np.zeros_like(usable[:1]), np.isfinite(speed)])
    after |= alone & np.concatenate([np.isfinite(speed), np.zeros_like(usable[:1])])
    count = (before.astype(float) + after)[..., None]
    out = []
    for d in (ds, dn, dp):
        lead = np.where(before[..., None], np.concatenate([np.zeros_like(d[:1]), d]), 0.0)
        lag = np.where(after[..., None], np.concatenate([d, np.zeros_like(d[:1])]), 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            out.append(np.moveaxis((lead + lag) / count / step_mm, 0, axis))
    return out


def _level(normal):
    """Unit level part of normals, zero where they stand upright."""
    flat = normal * (1.0, 1.0, 0.0)
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    return np.divide(flat, length, out=np.zeros_like(flat), where=length > 1e-9)


def _jumps(speed):
    """(k, n) bool: grid steps over which the contact moves far more than over the steps on both sides."""
    known = np.where(np.isfinite(speed), speed, 0.0)
    ends = np.zeros_like(known[:1])
    beside = np.maximum(np.concatenate([ends, known[:-1]]), np.concatenate([known[1:], ends]))
    return known > JUMP * np.maximum(beside, 1.0)


def _gap(a, b, normal, R, rc):
    """K(dS, dS') + <dS, dn'>, made symmetric, for two directions' (dS, dn, dP)."""
    ds, dn = a[0], a[1]
    es, en = b[0], b[1]
    part = 0.5 * (np.einsum("...k,...k", ds, en) + np.einsum("...k,...k", es, dn))
    cutter = np.einsum("...k,...k", ds, es) / rc
    if rc == R:
        return cutter + part
    sin = np.linalg.norm(normal[..., :2], axis=-1)
    level = _level(normal)
    round_ = np.stack([-level[..., 1], level[..., 0], level[..., 2]], axis=-1)
    bend = sin / (R - rc + rc * sin) - 1.0 / rc
    return cutter + part + bend * np.einsum("...k,...k", ds, round_) * np.einsum("...k,...k", es, round_)


def _clipped(gap, tip, least, most):
    """The metric with its lengths per mm of tip path kept between two bounds (squared, 1/mm²)."""
    a, b, c = np.moveaxis(tip, -1, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        l11 = np.sqrt(a)                        # tip = L L^T;  gap = L A L^T
        l21 = b / l11
        l22 = np.sqrt(np.maximum(c - l21 * l21, 1e-12))
        p, q, s = np.moveaxis(gap, -1, 0)
        axx = p / (l11 * l11)
        axy = (q - l21 * l11 * axx) / (l11 * l22)
        ayy = (s - 2 * l21 * l22 * axy - l21 * l21 * axx) / (l22 * l22)
        mean, half = 0.5 * (axx + ayy), fixed.hypot(0.5 * (axx - ayy), axy)
        low, high = (np.clip(v, least, most) for v in (mean - half, mean + half))
        turn = np.where(half > 0, (high - low) / np.maximum(2 * half, 1e-300), 0.0)
        middle = 0.5 * (low + high) - turn * mean
        bxx, bxy, byy = middle + turn * axx, turn * axy, middle + turn * ayy
        xx = bxx * l11 * l11
        xy = l11 * (bxx * l21 + bxy * l22)
        yy = bxx * l21 * l21 + 2 * bxy * l21 * l22 + byy * l22 * l22
    return np.stack([xx, xy, yy], axis=-1)
