"""Entries of a propeller's table held against what such columns can be: units, gaps, kinks, each told with its row.

Every column has a span that holds for any propeller; beyond it a unit was mistaken, and the message names the one
that the values would make sense in.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.values.errors import DesignError

RADIANS_DEG = 1.0           # a greatest skew below this, not 0, is in radians: no propeller has so little
KEPT_DEG = 0.02             # below that it is none


@dataclass(frozen=True, kw_only=True)
class Column:
    """What a column holds."""

    meaning: str
    least: float
    most: float
    usual: tuple[float, float]      # between which its greatest size lies on propellers: to guess the unit by
    kink: float                     # how far an inner value may lie off the line of its neighbours
    whole: str                      # what it is a share of; "" for none


COLUMNS = {
    "r_R": Column(meaning="radius over the tip's radius", least=0.05, most=1.0, usual=(1.0, 1.0), kink=np.inf,
                  whole="radius"),
    "c_D": Column(meaning="chord over diameter", least=0.0, most=1.5, usual=(0.04, 1.5), kink=0.12, whole="diameter"),
    "P_D": Column(meaning="pitch over diameter", least=0.1, most=4.0, usual=(0.3, 3.0), kink=0.25, whole="diameter"),
    "skew_deg": Column(meaning="skew in degrees", least=-180.0, most=180.0, usual=(1.0, 150.0), kink=10.0, whole=""),
    "rake_D": Column(meaning="rake over diameter", least=-0.6, most=0.6, usual=(0.001, 0.6), kink=0.05,
                     whole="diameter"),
    "t0_D": Column(meaning="greatest thickness over diameter", least=0.0, most=0.2, usual=(0.005, 0.2), kink=0.02,
                   whole="diameter"),
    "t0_c": Column(meaning="greatest thickness over chord", least=0.0, most=0.8, usual=(0.02, 0.8), kink=0.2,
                   whole="chord"),
    "f0_c": Column(meaning="greatest camber over chord", least=-0.3, most=0.3, usual=(0.002, 0.2), kink=0.05,
                   whole="chord"),
    "x_c": Column(meaning="station over chord", least=0.0, most=1.0, usual=(1.0, 1.0), kink=np.inf, whole="chord"),
    "face_c": Column(meaning="ordinate of the face over chord", least=-0.8, most=0.8, usual=(0.005, 0.5), kink=np.inf,
                     whole="chord"),
    "back_c": Column(meaning="ordinate of the back over chord", least=-0.8, most=0.8, usual=(0.01, 0.5), kink=np.inf,
                     whole="chord")}
AT_THE_TIP = ("r_R", "c_D")         # have no gap there either


def refuse_bad_entries(name, columns, diameter_mm, has_tip=True, may_be_radians=True):
    """Raise DesignError at the first entry that cannot be meant: empty, in another unit, or off its neighbours' line.

    Args:
        name: of the table.
        columns: {column: (n,) values}, NaN where a field is empty; columns not in COLUMNS are left alone.
        diameter_mm: of the propeller.
        has_tip: the last row is the tip's, where most columns may be empty.
        may_be_radians: a very small skew is taken for radians.
    """
    for column in columns:
        if column in COLUMNS:
            _refuse_gaps(name, columns, column, has_tip)
            _refuse_units(name, columns, column, diameter_mm)
    if may_be_radians and "skew_deg" in columns:
        _refuse_radians(name, columns)
    for column in [c for c in columns if c in COLUMNS] if has_tip else ():
        _refuse_kinks(name, columns, column)


def _place(name, columns, row):
    at = f", r/R = {columns['r_R'][row]:g}" if "r_R" in columns and np.isfinite(columns["r_R"][row]) else ""
    return f"propeller table {name}, row {row + 1}{at}"


def _refuse_gaps(name, columns, column, has_tip):
    inner = columns[column][:-1] if has_tip and column not in AT_THE_TIP else columns[column]
    if np.isnan(inner).any():
        row = int(np.argmax(np.isnan(inner)))
        only = "; only the tip's row may have gaps" if has_tip and row + 1 < len(columns[column]) else ""
        raise DesignError(f"{_place(name, columns, row)}: {column} is empty: give the {COLUMNS[column].meaning}{only}")


def _refuse_units(name, columns, column, diameter_mm):
    values, known = columns[column], COLUMNS[column]
    size = np.nan_to_num(np.abs(values))
    told = np.nan_to_num(values, nan=known.least)
    off = told - np.clip(told, known.least, known.most)
    if off.any():
        row = int(np.argmax(np.abs(off)))
        raise DesignError(f"{_place(name, columns, row)}: {column} {values[row]:g} is no {known.meaning}, which is "
                          f"between {known.least:g} and {known.most:g}{_unit_in_words(column, size, diameter_mm)}")


def _refuse_radians(name, columns):
    values = columns["skew_deg"]
    size = np.nan_to_num(np.abs(values))
    if KEPT_DEG < size.max() < RADIANS_DEG:
        row = int(size.argmax())
        raise DesignError(f"{_place(name, columns, row)}: skew_deg {values[row]:g} is the greatest: less than "
                          f"{RADIANS_DEG:g} degree looks like radians ({np.degrees(values[row]):.1f} degrees); multiply "
                          "the column by 57.29578, or name it skew_rad")


def _unit_in_words(column, size, diameter_mm):
    """The units in which a column's greatest value would make sense, and what to do."""
    known, most = COLUMNS[column], float(size.max())
    low, high = known.usual
    fits = lambda factor: 0.999 * low <= most / factor <= 1.001 * high
    lengths = {"diameter": diameter_mm, "radius": diameter_mm / 2}
    told = []
    if known.whole in lengths and fits(lengths[known.whole]):
        told.append(f"millimetres (divide by the {known.whole}, {lengths[known.whole]:g} mm)")
    if known.whole in lengths and fits(lengths[known.whole] / 25.4):
        told.append(f"inches (divide by the {known.whole}, {lengths[known.whole] / 25.4:.5g} in)")
    if known.whole and fits(100.0):
        told.append("percent (divide by 100)")
    if known.whole == "chord" and not told:
        told.append("a length (divide by the chord)")
    return f": these look like {' or '.join(told)}" if told else ": check the entry"


def _refuse_kinks(name, columns, column):
    """An inner value far off the line between its neighbours; the chord's last rows round the tip off."""
    r, values = columns["r_R"], columns[column]
    rows = np.flatnonzero(np.isfinite(values) & ((r < 1) | (column not in ("c_D", "t0_D", "t0_c"))))
    if len(rows) < 3:
        return
    r, v = r[rows], values[rows]
    share = (r[1:-1] - r[:-2]) / (r[2:] - r[:-2])
    line = v[:-2] + share * (v[2:] - v[:-2])
    off = np.abs(v[1:-1] - line)
    k = int(off.argmax())
    if off[k] > COLUMNS[column].kink:
        raise DesignError(f"{_place(name, columns, rows[k + 1])}: {column} {v[k + 1]:g} makes a kink: the rows before "
                          f"and behind it ({v[k]:g}, {v[k + 2]:g}) are on a line through {line[k]:.4g} there, "
                          f"{COLUMNS[column].kink:g} off it is the most a fair blade takes; correct the entry or its "
                          "neighbours, or give radii between them")
