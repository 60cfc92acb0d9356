"""Cell tables of RFQs: a CSV with units in its header, PARMTEQM's output text, or cells reckoned from a law.

What a row can be wrong in by itself is looked at here, and cells that overlap; what columns say of each other in
_rfq_checks.  Every refusal names the cell.
"""

import re
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np
from scipy.constants import c as LIGHT_M_PER_S
from scipy.constants import physical_constants

from cuspline.designs.rfq.potential import aperture_of_r0_mm, thin_matcher_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError, InputError
from cuspline.values.input_files import csv_rows, text_of
from cuspline.values.models import shortened

AMU_MEV = physical_constants["atomic mass constant energy equivalent in MeV"][0]
UNIT_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
LENGTHS = ("a", "L", "Z")
# units of the other columns, as factors on the first of each
UNITS = {"V": {"kV": 1.0, "V": 1e-3, "MV": 1e3}, "Wsyn": {"MeV": 1.0, "keV": 1e-3, "eV": 1e-6}, "Phi": {"deg": 1.0}}
LARGEST = 1e9                   # of any value
MOST_CELLS = 5000               # no RFQ has so many
TOLD_FAULTS = 6                 # that a message names
KINDS = {"": "accelerating", "R": "matching", "T": "transition", "M": "straight", "F": "fringe"}
ORDER = ("matching", "accelerating", "transition", "straight", "fringe")      # in which they follow the beam
PLACE_ROUNDING_MM, PLACE_SHARE = 0.11, 0.006    # PARMTEQM prints Z to 0.01 cm: of a cell of some centimetres that much
# columns of PARMTEQM's table behind the cell's number
PARMTEQM_COLUMNS = ("V", "Wsyn", "Sig0T", "Sig0L", "A10", "Phi", "a", "m", "B", "L", "Z", "A0", "RFdef", "Oct", "A1")


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of an RFQ."""

    number: int
    kind: str                   # a value of KINDS
    aperture_mm: float          # a, the smallest distance of a tip from the axis; in a matching cell that at its end
    modulation: float           # m
    length_mm: float            # L
    energy_mev: float | None = None     # of the synchronous particle at its end
    voltage_kv: float | None = None     # between vanes
    phase_deg: float | None = None      # synchronous
    focusing: float | None = None       # B
    end_mm: float | None = None         # Z as the table says it, from the wall where the beam enters
    a10: float | None = None            # acceleration term as the table says it (circular tips' multipole)
    a01: float | None = None            # quadrupole term, likewise


@dataclass(frozen=True, kw_only=True)
class CellTable:
    """The cells of one RFQ in the order of the beam, the first one at the wall where the beam enters."""

    name: str
    cells: tuple[Cell, ...]
    halves: dict = field(default_factory=dict)      # column -> half a unit of its last printed digit, mm, MeV, ...

    def half(self, column):
        """How far a column's values may be off by having been printed; 0 where that is not known."""
        return self.halves.get(column, 0.0)

    def __post_init__(self):
        kinds = [c.kind for c in self.cells]
        if "accelerating" not in kinds:
            raise InputError(f"{self.name}: there is no accelerating cell in the table")
        for before, cell in zip(self.cells, self.cells[1:]):
            if ORDER.index(cell.kind) < ORDER.index(before.kind):
                raise InputError(f"{self.name}, cell {cell.number}: a cell of kind {cell.kind} cannot follow one of "
                                 f"kind {before.kind}; the order is {', '.join(ORDER)}")

    def of_kind(self, kind):
        """Tuple of the cells of one kind."""
        return tuple(c for c in self.cells if c.kind == kind)


def read_table(path):
    """A CellTable from a CSV or from PARMTEQM's output text, told apart by what stands in it.

    Args:
        path: file.  A CSV has a header row whose names carry units, as `a[cm]`, and the columns cell, a, m, L at
            least; Z and Wsyn are checked where they stand.  Rows may begin with #.
    Raises:
        InputError: missing file, no table in it, a value that cannot be; names the cell.
    """
    path = Path(path)
    text = text_of(path, "cell table")
    rows = _parmteqm_rows(path.name, text) if _is_parmteqm(text) else _csv_rows(path.name, text)
    if len(rows) > MOST_CELLS:
        raise InputError(f"{path.name}: it has {len(rows)} rows, and no RFQ more than {MOST_CELLS} cells")
    cells, faults = [], []
    for row in rows:
        try:
            cells.append(_cell(row))
        except InputError as error:
            faults.append(str(error))
    if faults:
        more = f"; and {len(faults) - TOLD_FAULTS} more" if len(faults) > TOLD_FAULTS else ""
        raise InputError(f"{path.name}, " + "; ".join(faults[:TOLD_FAULTS]) + more)
    _refuse_gaps(path.name, cells)
    return CellTable(name=path.name, cells=tuple(c for c in cells if c.length_mm > 0), halves=_halves(rows))


def _number(text):
    """A text's number, None where it is none or beyond all measure."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None


def _halves(rows):
    """{column: half a unit of its last digit}; programs that print drop zeros, so the column's finest counts."""
    found = {}
    for row in rows:
        scale = {**dict.fromkeys(LENGTHS, UNIT_MM[row["_unit"]]), **row["_scales"]}
        for column, text in row.items():
            value = None if column == "cell" or column.startswith("_") else _number(text or "")
            if value is not None:
                half = float(Decimal(5).scaleb(Decimal(f"{value:.12g}").as_tuple().exponent - 1)) * scale.get(column, 1.0)
                found[column] = min(found.get(column, half), half)
    return found


def _is_parmteqm(text):
    return text.lstrip().lower().startswith("parmteqm") or "RFQ parameters for each cell" in text


# PARMTEQM ------------------------------------------------------------------------------------------


def _parmteqm_rows(name, text):
    """[{column: text}] between the two headings of PARMTEQM's table; lengths in cm."""
    blocks = re.split(r"^ *Cell +V +Wsyn.*$", text, flags=re.MULTILINE)
    if len(blocks) < 2:
        raise InputError(f"{name}: PARMTEQM's table is not there (a line 'Cell  V  Wsyn ...' begins it)")
    rows = []
    for line in blocks[1].splitlines():
        found = re.match(r" *(\d+)([A-Z]?) +(.*)$", line)
        if not found:
            continue
        number, letter, values = int(found[1]), found[2], found[3].split()
        row = {"cell": f"{number}{letter}", "_unit": "cm", "_scales": {}}
        if letter == "F":                           # V, phase advance, A10, m, L, Z: it has no aperture
            row |= dict(zip(("V", "m", "L", "Z"), (values[0], *values[-3:])))
        else:
            row |= dict(zip(PARMTEQM_COLUMNS, values))
        rows.append(row)
    if not rows:
        raise InputError(f"{name}: PARMTEQM's table holds no cells")
    return rows


# CSV -----------------------------------------------------------------------------------------------


def _csv_rows(name, text):
    """[{column without unit: text}] of a CSV; `_unit` is that of a, L and Z."""
    (_, header), *rest = csv_rows(text, name) or [(0, [])]
    columns = [re.match(r"([^\[]*)(?:\[(.*)\])?$", h.strip()) for h in header]
    names = [c[1].strip() if c else "" for c in columns]
    units = {c[1].strip(): c[2] for c in columns if c}
    twice = sorted({n for n in names if n and names.count(n) > 1})
    if twice:
        raise InputError(f"{name}: the table has two columns {twice[0]!r}; keep one")
    missing = [c for c in ("cell", "a", "m", "L") if c not in names]
    if missing:
        raise InputError(f"{name}: the table has no column {missing[0]!r}; it needs cell, a, m and L, with units as "
                         "a[cm] or a[mm]")
    given = {units[c] for c in LENGTHS if c in units}
    if len(given) != 1 or None in given or not given <= set(UNIT_MM):
        raise InputError(f"{name}: the columns a, L and Z must all carry one unit, one of {', '.join(UNIT_MM)}, as in "
                         f"a[cm]; the header says {', '.join(sorted(map(str, given)))}")
    scales = {}
    for column, known in UNITS.items():
        if units.get(column) not in (None, *known):
            raise InputError(f"{name}: column {column} is in {units[column]!r}; it can be in {', '.join(known)}")
        scales[column] = known.get(units.get(column), 1.0)
    for line, values in rest:
        if len(values) > len(names) and any(v.strip() for v in values[len(names):]):
            raise InputError(f"{name}, line {line}: it has {len(values)} fields, the header names {len(names)} columns")
    return [{**dict(zip(names, values)), "_unit": next(iter(given)), "_scales": scales} for _, values in rest]


# cells ---------------------------------------------------------------------------------------------


def _cell(row):
    """The Cell of a row.

    Raises:
        InputError: begins with the cell; every fault of the row is in it.
    """
    found = re.fullmatch(r"([0-9]{1,6})([A-Z]?)", (row["cell"] or "").strip())
    if not found or found[2] not in KINDS:
        raise InputError(f"{shortened(row['cell'])} is no cell: a number, and behind it nothing or one of "
                         + ", ".join(k for k in KINDS if k))
    faults = []
    cell, kind = int(found[1]), KINDS[found[2]]

    def value(column, is_needed=False):
        text = (row.get(column) or "").strip()
        if not text and not is_needed:
            return None
        number = _number(text)
        if number is None:
            faults.append(f"column {column} holds {shortened(text)}, a number is needed")
        return number

    scale = UNIT_MM[row["_unit"]]
    length = value("L", cell > 0) or 0.0
    aperture = value("a", cell > 0 and kind != "fringe")
    modulation = value("m", kind == "accelerating" and cell > 0) or 1.0
    end = value("Z")
    scaled = {c: None if (v := value(c)) is None else v * row["_scales"].get(c, 1.0) for c in ("Wsyn", "V", "Phi")}
    more = {"a10": value("A10"), "a01": value("A0"), "focusing": value("B")}
    if not faults and cell > 0 and length <= 0:
        faults.append(f"its length is {length:g}, it must be above 0")
    if aperture is not None and aperture <= 0:
        faults.append(f"its aperture is {aperture:g}, it must be above 0")
    if modulation < 1:
        faults.append(f"its modulation is {modulation:g}, it is 1 or above")
    if scaled["Wsyn"] is not None and scaled["Wsyn"] <= 0:
        faults.append(f"its energy Wsyn is {scaled['Wsyn']:g} MeV, it must be above 0")
    if faults:
        raise InputError(f"cell {cell}: " + ", ".join(faults))
    return Cell(number=cell, kind=kind, aperture_mm=(aperture or 0.0) * scale, modulation=modulation,
                length_mm=length * scale, energy_mev=scaled["Wsyn"], voltage_kv=scaled["V"], phase_deg=scaled["Phi"],
                end_mm=None if end is None else end * scale, **more)


def _refuse_gaps(name, cells):
    """Cells must follow each other: by their numbers, and where the table says where they end, in place."""
    end = 0.0
    for before, cell in zip([None, *cells], cells):
        if before is not None and cell.number != before.number + 1:
            raise InputError(f"{name}, cell {cell.number}: it follows cell {before.number}; they are numbered one "
                             "by one")
        if cell.end_mm is not None and cell.length_mm > 0:
            begins = cell.end_mm - cell.length_mm
            if abs(begins - end) > max(PLACE_ROUNDING_MM, PLACE_SHARE * cell.length_mm):
                what = "overlaps" if begins < end else "leaves a gap behind"
                raise InputError(
                    f"{name}, cell {cell.number}: it {what} cell {cell.number - 1}: it is {cell.length_mm:.3f} mm long "
                    f"and ends at {cell.end_mm:.3f} mm, so it begins at {begins:.3f} mm, but the cell before ends at "
                    f"{end:.3f} mm; correct L or Z")
        end = cell.end_mm if cell.end_mm is not None else end + cell.length_mm


def half_wave_mm(energy_mev, mass_amu, frequency_mhz):
    """Way of a particle in half an RF period: beta lambda / 2, relativistic."""
    rest = mass_amu * AMU_MEV
    gamma = 1.0 + energy_mev / rest
    return np.sqrt(1.0 - 1.0 / gamma ** 2) * LIGHT_M_PER_S / (2.0 * frequency_mhz * 1e6) * 1e3


# a law ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class CellLaw:
    """What an RFQ's cells are reckoned from where there is no table."""

    frequency_mhz: float
    mass_amu: float
    charge: float
    energy_mev: float           # of the ion as it enters
    voltage_kv: float           # between vanes
    r0_mm: float
    modulation_max: float
    cells: int                  # accelerating ones
    ramp_cells: int             # over which modulation and phase rise
    matching_cells: int
    phase_deg: float            # synchronous phase behind the ramp; it begins at -90


def table_of_law(law, name="law"):
    """Cells along which a synchronous particle is carried: m from 1 and the phase from -90 degrees rise evenly.

    Energy gain of a cell: q (pi/4) A10 V cos(phase); length: half the way of the particle in a period.  The aperture
    follows from r0, m and L.
    Source: Crandall, Stokes and Wangler's two-term potential (docs/formulas.md 2); the rise is ours.
    """
    energy, cells = law.energy_mev, []
    length = half_wave_mm(energy, law.mass_amu, law.frequency_mhz)
    for k in range(law.matching_cells):
        share = (k + 1) / law.matching_cells
        cells.append(Cell(number=k + 1, kind="matching", modulation=1.0, length_mm=float(length), energy_mev=energy,
                          aperture_mm=float(thin_matcher_mm(share, 1.0, law.r0_mm))))
    for k in range(law.cells):
        number, rise = law.matching_cells + k + 1, min((k + 1) / law.ramp_cells, 1.0)
        m = 1.0 + (law.modulation_max - 1.0) * rise
        phase = np.radians(-90.0 + (law.phase_deg + 90.0) * rise)
        length = float(half_wave_mm(energy, law.mass_amu, law.frequency_mhz))
        try:
            a, a10 = aperture_of_r0_mm(law.r0_mm, m, length)
        except DesignError as error:
            raise DesignError(f"{name}, cell {number}: {error}; or lower r0_mm {law.r0_mm:g}: at {law.frequency_mhz:g} MHz "
                              f"the first cells are {half_wave_mm(law.energy_mev, law.mass_amu, law.frequency_mhz):.3f} mm "
                              "long") from None
        energy += law.charge * np.pi / 4 * a10 * law.voltage_kv * 1e-3 * fixed.cos(phase)
        cells.append(Cell(number=number, kind="accelerating", aperture_mm=float(a), modulation=float(m),
                          length_mm=length, energy_mev=float(energy), a10=float(a10)))
    return CellTable(name=name, cells=tuple(cells))
