"""A part clamped anew: its markers, measured in the new clamping, tell where it lies.

The rigid motion from the markers' nominal places to the measured ones is the setup's frame; paths are planned and
posted for it, the part is not moved.  It serves a part turned over as well as a long one shifted along the bed.
Indexed positions follow their clamping: the rotary axes lean by what the part does, and their paths stay what they are.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cuspline.design import Refixturing
from cuspline.design.design import by_clamping
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


def far_errors_mm(nominal_mm, places_mm, error_mm):
    """How far places of a part lie from where the fit of its markers puts them, root mean square.

    Args:
        nominal_mm: (n, 3) markers, not in one line.   places_mm: (m, 3) places of the part.
        error_mm: of one measured coordinate of a marker, root mean square.
    Returns:
        (m,) mm.
    Source: J. M. Fitzpatrick, J. B. West, C. R. Maurer, IEEE Trans. Med. Imaging 17 (1998) 694:
    TRE² = FLE²/N · (1 + ⅓ Σ d²/f²); d: of the place from the markers' principal axes, f: of the markers.

    >>> square = np.array([[100.0, 100, 0], [-100, 100, 0], [-100, -100, 0], [100, -100, 0]])
    >>> far_errors_mm(square, np.array([[381.0, 0, 0], [0, 0, 0]]), 0.002).round(5)
    array([0.00498, 0.00173])
    """
    nominal, places = np.asarray(nominal_mm, float), np.asarray(places_mm, float)
    middle = nominal.mean(axis=0)
    axes = fixed.singular_values(nominal - middle)[2]
    from_axes2 = lambda p: ((p - middle) ** 2).sum(axis=1)[:, None] - fixed.matmul(p - middle, axes) ** 2
    share = (from_axes2(places) / from_axes2(nominal).mean(axis=0)).sum(axis=1)
    return np.sqrt(3.0 * error_mm ** 2 / len(nominal) * (1.0 + share / 3.0))


def refixtured(setup, measured_mm, places_mm=()):
    """The setup as the part really lies.

    Args:
        setup: design.Setup with markers.
        measured_mm: marker name -> (x, y, z) as measured in the setup's WCS.
        places_mm: (k, 3) places of the part that it cuts, the farthest of them: how well they are known is told.
    Returns:
        Setup with the fitted frame, and what the fit came to.
    Raises:
        InputError: a marker not known or not measured, too few, in one line, mirrored, or further off than the
            setup's `marker_limit_mm`; places so far from the markers that their `far_limit_mm` is not kept.
    """
    designed = setup.clamped_frame
    nominal_mm, found_mm = _paired(setup, measured_mm)
    limit = setup.marker_limit_mm
    if _arm_mm(nominal_mm) < ARM_LIMITS * limit:
        raise InputError(f"{setup.name}: its markers are in one line within {_arm_mm(nominal_mm):.3f} mm: the turn "
                         f"about it stays open; measure one that is at least {2 * ARM_LIMITS * limit:g} mm beside it")
    fit, names = fitted_frame(nominal_mm, found_mm), [m.name for m in setup.markers]
    if fit.residual_mm.max() > limit:
        wrong, off_mm = _wrong_marker(nominal_mm, found_mm, limit) or (int(fit.residual_mm.argmax()), fit.residual_mm.max())
        raise InputError(f"{setup.name}: marker {names[wrong]} is {off_mm:.4f} mm from where the "
                         f"others put it, more than {limit:g} mm: {_advice(setup, nominal_mm, found_mm)}")
    turn_deg = np.degrees(_turn_rad(fixed.matmul(designed.rotation.T, fit.frame.rotation)))
    if np.abs(turn_deg).max() > TURN_LIMIT_DEG:
        raise InputError(f"{setup.name}: by its markers the part is {np.abs(turn_deg).max():.3f} degrees off its "
                         f"setup as designed, more than {TURN_LIMIT_DEG:g}: markers are mixed up, or a sign is "
                         "wrong")
    rotation, lies = fit.frame.rotation, "clamped" if setup.indexed else "wcs"
    return setup.model_copy(update={
        "wcs_origin_mm": tuple(fit.frame.origin_mm.tolist()), f"{lies}_x": tuple(rotation[:, 0].tolist()),
        f"{lies}_z": tuple(rotation[:, 2].tolist()),
        "refixturing": Refixturing(
            turn_deg=tuple(turn_deg.round(9).tolist()),
            shift_mm=tuple((designed.into(fit.frame.origin_mm[None])[0]).round(9).tolist()),
            residual_mm={n: round(float(r), 9) for n, r in zip(names, fit.residual_mm)},
            far_error_mm=_far_error_mm(setup, nominal_mm, fit.residual_mm, places_mm))})


def _far_error_mm(setup, nominal_mm, residual_mm, places_mm):
    """Of the worst of places (k, 3), from the stated error of a coordinate or what the residuals show, whichever is more; None
    where there is no place.

    Raises:
        InputError: it is more than the setup's `far_limit_mm`.
    """
    if not len(places_mm):
        return None
    count = len(residual_mm)
    shown_mm = np.sqrt((residual_mm ** 2).sum() / (3 * count - 6))      # six of 3 n figures went into the fit
    error_mm = max(setup.marker_error_mm, float(shown_mm))
    errors_mm = far_errors_mm(nominal_mm, places_mm, error_mm)
    worst = int(errors_mm.argmax())
    if errors_mm[worst] > setup.far_limit_mm:
        place = " ".join(f"{axis}{x:.1f}" for axis, x in zip("XYZ", places_mm[worst]))
        raise InputError(f"{setup.name}: markers known to {error_mm:.4f} mm a coordinate leave the part at {place} uncertain by "
                         f"{errors_mm[worst]:.4f} mm, more than {setup.far_limit_mm:g} mm: touch markers farther apart, nearer to "
                         "what is cut there, or more of them; or raise far_limit_mm")
    return round(float(errors_mm[worst]), 9)


def refixtured_setups(setups, measured, places_of=lambda setups: ()):
    """Every setup as the part lies in it; indexed positions as the setup that begins their clamping.

    Args:
        setups: of design.Setup.   measured: {setup name: {marker name: (x, y, z)}}; setups not named stay as designed.
        places_of: function of the setups of one clamping -> (k, 3) places of the part that they cut, the farthest of them.
    Raises:
        InputError: as `refixtured`, a setup that is not there, or one that does not begin its clamping.
    """
    unknown = sorted(set(measured) - {s.name for s in setups})
    if unknown:
        raise InputError(f"markers measured in {unknown[0]!r}, but there is no such setup; there are "
                         + ", ".join(s.name for s in setups))
    found = []
    for held in by_clamping(setups, lambda before, setup: setup.is_held_as(before)):
        if within := [s.name for s in held[1:] if s.name in measured]:
            raise InputError(f"markers measured in {within[0]}, an indexed position held as {held[0].name} is: measure "
                             f"them once, and write {held[0].name}")
        name = held[0].name
        found += _refixtured_clamping(held, measured[name], places_of(held)) if name in measured else held
    return tuple(found)


def _refixtured_clamping(held, measured_mm, places_mm):
    """[Setup]: of what holds the part, then of the indexed positions in its clamping."""
    base = refixtured(held[0], measured_mm, places_mm)
    own = {"wcs_origin_mm": base.wcs_origin_mm, "refixturing": base.refixturing,
           "clamped_x": base.clamped_x if base.indexed else base.wcs_x,
           "clamped_z": base.clamped_z if base.indexed else base.wcs_z}
    return [base, *(s.model_copy(update=own) for s in held[1:])]


def refixturing_in_words(found):
    """A design.Refixturing in one line."""
    axes = lambda values, digits: " ".join(f"{axis}{value:.{digits}f}" for axis, value in zip("XYZ", values))
    far = "" if found.far_error_mm is None else f", FARTHEST PLACE KNOWN TO {found.far_error_mm:.4f} MM"
    return (f"ZERO SHIFTED {axes(found.shift_mm, 4)} MM, TURNED {axes(found.turn_deg, 5)} DEG, "
            f"MARKERS WITHIN {max(found.residual_mm.values()):.4f} MM{far}")


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


def _wrong_marker(nominal_mm, found_mm, limit_mm):
    """(index, mm from where the others put it) of the one marker without which all others fit; None where there is no such one.

    Least squares share an error of one marker out among all: the largest residual may be another's.
    """
    found = []
    for k in range(len(nominal_mm)) if len(nominal_mm) > LEAST_MARKERS else ():
        others = np.delete(nominal_mm, k, axis=0)
        fit = fitted_frame(others, np.delete(found_mm, k, axis=0))
        if fit.residual_mm.max() <= limit_mm and _arm_mm(others) >= ARM_LIMITS * limit_mm:
            found.append((k, float(fixed.length(fit.frame.out(found_mm[k:k + 1])[0] - nominal_mm[k]))))
    return found[0] if len(found) == 1 else None


def _swapped(setup, nominal_mm, found_mm):
    """Names of two markers that are changed over: with them changed back all fit; () where there are none."""
    names = [m.name for m in setup.markers]
    for j, k in combinations(range(len(names)), 2):
        back = found_mm.copy()
        back[[j, k]] = found_mm[[k, j]]
        if fitted_frame(nominal_mm, back).residual_mm.max() <= setup.marker_limit_mm:
            return names[j], names[k]
    return ()


def _advice(setup, nominal_mm, found_mm):
    """Whether the measured places fit once two are changed over, one axis is mirrored, or once they are millimetres; or whether
    one marker alone is wrong."""
    if swapped := _swapped(setup, nominal_mm, found_mm):
        return f"with {' and '.join(swapped)} changed over all would fit: they are swapped"
    changes = [(np.where(np.arange(3) == axis, -1.0, 1.0),
                f"with the sign of {name} changed all would fit: they are mirrored") for axis, name in enumerate("XYZ")]
    changes += [(25.4, "they look like inches; give millimetres"),
                (10.0, "they look like centimetres; give millimetres")]
    fits = [(fitted_frame(nominal_mm, found_mm * factor), words) for factor, words in changes]
    near = [(np.trace(fixed.matmul(setup.clamped_frame.rotation.T, fit.frame.rotation)), words) for fit, words in fits
            if fit.residual_mm.max() <= setup.marker_limit_mm]
    if near:
        return max(near)[1]
    if len(nominal_mm) == LEAST_MARKERS:
        return ("of three markers nobody can say which is wrong: measure all again, look whether the right ones were touched, and "
                "name a fourth")
    return ("measure it again, and look whether the right markers were touched"
            + ("; all others fit" if _wrong_marker(nominal_mm, found_mm, setup.marker_limit_mm) else ""))


def _turn_rad(rotation):
    """(3,) turns about X, then Y, then Z that make a rotation up."""
    return np.array([fixed.arctan2(rotation[2, 1], rotation[2, 2]), -fixed.arcsin(np.clip(rotation[2, 0], -1, 1)),
                     fixed.arctan2(rotation[1, 0], rotation[0, 0])])
