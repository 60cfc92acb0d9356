"""A part clamped anew: its markers, measured in the new clamping, tell where it lies.

The rigid motion from the markers' nominal places to the measured ones is the setup's frame; paths are planned and
posted for it, the part is not moved.  It serves a part turned over as well as a long one shifted along the bed.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.design import Refixturing
from cuspline.values import fixed_math as fixed
from cuspline.values.amounts import counted
from cuspline.values.arrays import frozen
from cuspline.values.errors import InputError
from cuspline.values.frames import Frame
from cuspline.values.input_files import csv_rows, text_of
from cuspline.values.models import FAR_MM, shortened

COLUMNS = ("setup", "marker", "x_mm", "y_mm", "z_mm")
LEAST_MARKERS = 3
ARM_LIMITS = 50.0         # markers closer to one line than so many limits leave the turn about it open
TURN_LIMIT_DEG = 5.0      # a part that lies further askew has its markers mixed up, or a sign is wrong


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """Where a part lies, by least squares."""

    frame: Frame                # WCS seen from the part
    residual_mm: np.ndarray     # (n,) distance of each marker from where the fit puts it

    def __post_init__(self):
        object.__setattr__(self, "residual_mm", frozen(self.residual_mm, (None,), "residual_mm"))


def fitted_frame(nominal_mm, measured_mm):
    """The rigid motion that brings measured markers closest to their nominal places.

    Args:
        nominal_mm: (n, 3) in the part.   measured_mm: (n, 3) in the WCS, the same markers.
    Returns:
        Fit; no scaling, no mirroring.
    Source: W. Kabsch, Acta Cryst. A32 (1976) 922: singular values of the covariance.

    >>> square = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]])
    >>> fitted_frame(square, square - (1.0, 2.0, 3.0)).frame.origin_mm.round(9)
    array([1., 2., 3.])
    """
    nominal, measured = np.asarray(nominal_mm, float), np.asarray(measured_mm, float)
    here, there = measured.mean(axis=0), nominal.mean(axis=0)
    u, _, v = fixed.singular_values(fixed.matmul((measured - here).T, nominal - there))
    right_handed = lambda a: np.column_stack([a[:, 0], a[:, 1], np.cross(a[:, 0], a[:, 1])])     # no mirroring
    rotation = fixed.matmul(right_handed(v), right_handed(u).T)
    frame = Frame(rotation=rotation, origin_mm=there - fixed.matmul(rotation, here))
    return Fit(frame=frame, residual_mm=np.linalg.norm(frame.out(measured) - nominal, axis=1))


def refixtured(setup, measured_mm):
    """The setup as the part really lies.

    Args:
        setup: design.Setup with markers.
        measured_mm: marker name -> (x, y, z) as measured in the setup's WCS.
    Returns:
        Setup with the fitted frame, and what the fit came to.
    Raises:
        InputError: a marker not known or not measured, too few, in one line, mirrored, or further off than the
            setup's `marker_limit_mm`.
    """
    nominal_mm, found_mm = _paired(setup, measured_mm)
    limit = setup.marker_limit_mm
    if _arm_mm(nominal_mm) < ARM_LIMITS * limit:
        raise InputError(f"{setup.name}: its markers are in one line within {_arm_mm(nominal_mm):.3f} mm: the turn "
                         f"about it stays open; measure one that is at least {2 * ARM_LIMITS * limit:g} mm beside it")
    fit, names = fitted_frame(nominal_mm, found_mm), [m.name for m in setup.markers]
    worst = int(fit.residual_mm.argmax())
    if fit.residual_mm[worst] > limit:
        raise InputError(f"{setup.name}: marker {names[worst]} is {fit.residual_mm[worst]:.4f} mm from where the "
                         f"others put it, more than {limit:g} mm: {_advice(setup, nominal_mm, found_mm)}")
    turn_deg = np.degrees(_turn_rad(fixed.matmul(setup.frame.rotation.T, fit.frame.rotation)))
    if np.abs(turn_deg).max() > TURN_LIMIT_DEG:
        raise InputError(f"{setup.name}: by its markers the part is {np.abs(turn_deg).max():.3f} degrees off its "
                         f"setup as designed, more than {TURN_LIMIT_DEG:g}: markers are mixed up, or a sign is "
                         "wrong")
    rotation = fit.frame.rotation
    return setup.model_copy(update={
        "wcs_origin_mm": tuple(fit.frame.origin_mm.tolist()), "wcs_x": tuple(rotation[:, 0].tolist()),
        "wcs_z": tuple(rotation[:, 2].tolist()),
        "refixturing": Refixturing(
            turn_deg=tuple(turn_deg.round(9).tolist()),
            shift_mm=tuple((setup.frame.into(fit.frame.origin_mm[None])[0]).round(9).tolist()),
            residual_mm={n: round(float(r), 9) for n, r in zip(names, fit.residual_mm)})})


def refixtured_setups(setups, measured):
    """Every setup as the part lies in it.

    Args:
        setups: of design.Setup.   measured: {setup name: {marker name: (x, y, z)}}; setups not named stay as designed.
    Raises:
        InputError: as `refixtured`, or a setup that is not there.
    """
    if any(s.indexed for s in setups) and measured:
        raise InputError("measured markers with indexed positions are not taken up yet: clamp by the zero, or cut the positions as "
                         "setups of their own")
    unknown = sorted(set(measured) - {s.name for s in setups})
    if unknown:
        raise InputError(f"markers measured in {unknown[0]!r}, but there is no such setup; there are "
                         + ", ".join(s.name for s in setups))
    return tuple(refixtured(s, measured[s.name]) if s.name in measured else s for s in setups)


def refixturing_in_words(found):
    """A design.Refixturing in one line."""
    axes = lambda values, digits: " ".join(f"{axis}{value:.{digits}f}" for axis, value in zip("XYZ", values))
    return (f"ZERO SHIFTED {axes(found.shift_mm, 4)} MM, TURNED {axes(found.turn_deg, 5)} DEG, "
            f"MARKERS WITHIN {max(found.residual_mm.values()):.4f} MM")


def read_measured(path):
    """Measured markers from a CSV file with the columns setup, marker, x_mm, y_mm, z_mm; lines with # are comments.

    Returns:
        {setup: {marker: (x, y, z)}}, mm in the setup's WCS.
    Raises:
        InputError: what is wrong, with the line.
    """
    rows = [(n, [c.strip() for c in row]) for n, row in csv_rows(text_of(path, "measured markers", may_be_empty=True),
                                                                 f"measured markers {path}")]
    if not rows or tuple(rows[0][1]) != COLUMNS:
        raise InputError(f"measured markers {path}: the first line must name the columns {','.join(COLUMNS)}")
    measured = {}
    for number, row in rows[1:]:
        place = _place(path, number, row)
        if row[1] in measured.setdefault(row[0], {}):
            raise InputError(f"measured markers {path}, line {number}: {row[1]} of {row[0]} is there twice; keep one")
        measured[row[0]][row[1]] = place
    return measured


def _place(path, number, row):
    try:
        place = tuple(float(c) for c in row[2:])
    except ValueError:
        place = ()
    if len(row) != len(COLUMNS) or len(place) != 3 or not all(abs(c) <= FAR_MM for c in place):
        raise InputError(f"measured markers {path}, line {number}: {shortened(','.join(row))} is not {','.join(COLUMNS)} "
                         "with three numbers in mm")
    return place


def _paired(setup, measured_mm):
    """(n, 3) nominal and (n, 3) measured places in one order."""
    names = [m.name for m in setup.markers]
    if len(names) < LEAST_MARKERS:
        raise InputError(f"{setup.name}: it has {counted(len(names), 'marker')}; a fit needs {LEAST_MARKERS} that are not in one "
                         "line: name them in the setup's markers")
    odd = sorted(set(measured_mm) ^ set(names))
    if odd:
        what = "is no marker of it" if odd[0] in measured_mm else "is not measured"
        raise InputError(f"{setup.name}: {odd[0]} {what}; its markers are {', '.join(names)}")
    return np.array([m.at_mm for m in setup.markers], float), np.array([measured_mm[n] for n in names], float)


def _arm_mm(points_mm):
    """Root mean square distance of points from the line that lies closest to them."""
    return float(fixed.singular_values(points_mm - points_mm.mean(axis=0))[1][1] / np.sqrt(len(points_mm)))


def _advice(setup, nominal_mm, found_mm):
    """Whether the measured places fit once one axis is mirrored, or once they are millimetres."""
    changes = [(np.where(np.arange(3) == axis, -1.0, 1.0),
                f"with the sign of {name} changed all would fit: they are mirrored") for axis, name in enumerate("XYZ")]
    changes += [(25.4, "they look like inches; give millimetres"),
                (10.0, "they look like centimetres; give millimetres")]
    fits = [(fitted_frame(nominal_mm, found_mm * factor), words) for factor, words in changes]
    near = [(np.trace(fixed.matmul(setup.frame.rotation.T, fit.frame.rotation)), words) for fit, words in fits
            if fit.residual_mm.max() <= setup.marker_limit_mm]
    return max(near)[1] if near else "measure it again, and look whether the right markers were touched"


def _turn_rad(rotation):
    """(3,) turns about X, then Y, then Z that make a rotation up."""
    return np.array([fixed.arctan2(rotation[2, 1], rotation[2, 2]), -fixed.arcsin(np.clip(rotation[2, 0], -1, 1)),
                     fixed.arctan2(rotation[1, 0], rotation[0, 0])])
