"""A cell table against itself: every column that stands in it says something of the others.

    length     L = beta lambda / 2 (1 + dPhi / 180 deg), beta at the mean of the energies before and behind the cell
    focusing   B = A0 q V lambda^2 / (m c^2 r0^2), r0 in the middle of the cell, of a, m and L
    energy     Wsyn rises by q (pi / 4) A10 V cos Phi
    A10        of circular tips, as printed, beside the two-term one of a, m and L
    r0         neighbouring cells have nearly the same

What may differ is what the columns' last digits leave open, and a share for what the formulas leave out.  The shares
are two to four times what the 58-cell table of PARMTEQM in data/ differs by.
"""

import numpy as np

from cuspline.designs.rfq.potential import TwoTerm
from cuspline.designs.rfq.table import AMU_MEV, LIGHT_M_PER_S, half_wave_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError, InputError

LENGTH_SHARE, LENGTH_WITHOUT_PHASE = 0.02, 0.05     # the table's own cells: 0.011 and 0.024
FOCUS_SHARE, FOCUS_WITHOUT_A0 = 0.01, 0.05          # 0.0025 and 0.0075; other tips' A0 lies within 5 % of 1
ENERGY_SHARE, ENERGY_WITHOUT_A10 = 0.05, 0.20       # 0.02 and 0.12
LEAST_A10, MOST_A10 = 0.70, 1.15                    # printed over two-term: 0.83 to 0.99
R0_SHARE = 0.05                                     # between neighbours: 0.002
UNIT_SHARE = 0.5                # a length so far off tenfold or a tenth is one in another unit
TOLD_CELLS = 4                  # that a message names


def refuse_contradictions(table, mass_amu, charge, frequency_mhz):
    """
    Args:
        table: CellTable.   mass_amu, charge, frequency_mhz: of the ion and the RF, as the design has them.
    Raises:
        InputError: columns contradict each other or the parameters; names cells, columns and both values.
    """
    faults, ratios = [], []
    for before, cell in zip([None, *table.cells], table.cells):
        if cell.kind == "accelerating":
            fault, ratio = _length_fault(table, before, cell, mass_amu, frequency_mhz)
            faults += fault
            ratios += ratio
            faults += _energy_fault(table, before, cell, charge)
            faults += _a10_fault(table, cell)
        faults += _focus_fault(table, cell, mass_amu, charge, frequency_mhz)
    faults += _r0_faults(table)
    if faults:
        more = f"; and {len(faults) - TOLD_CELLS} more" if len(faults) > TOLD_CELLS else ""
        raise InputError(f"{table.name}, " + "; ".join(faults[:TOLD_CELLS]) + more
                         + _common_cause(ratios, mass_amu, frequency_mhz))


def _two_term(cell):
    """The cell's two-term potential; None where it has none, which the tip line tells."""
    try:
        return TwoTerm(aperture_mm=cell.aperture_mm, modulation=cell.modulation, length_mm=cell.length_mm)
    except DesignError:
        return None


def _r0_mm(cell):
    """r0 in the middle of a cell; None where there is none."""
    if cell.kind == "fringe":
        return None
    if cell.kind != "accelerating":
        return cell.aperture_mm
    made = _two_term(cell)
    return None if made is None else float(made.r0_mm)


def _length_fault(table, before, cell, mass_amu, frequency_mhz):
    """([what is wrong], [length over the expected one])."""
    if cell.energy_mev is None:
        return [], []
    energies = [c.energy_mev for c in (before, cell) if c is not None and c.energy_mev is not None]
    energy = sum(energies) / len(energies)
    has_phases = before is not None and None not in (before.phase_deg, cell.phase_deg) and len(energies) == 2
    turn = (cell.phase_deg - before.phase_deg) / 180 if has_phases else 0.0
    wanted = float(half_wave_mm(energy, mass_amu, frequency_mhz)) * (1 + turn)
    share = LENGTH_SHARE if has_phases else LENGTH_WITHOUT_PHASE
    share += table.half("Wsyn") / (2 * energy) + table.half("L") / cell.length_mm + table.half("Phi") / 90
    ratio = cell.length_mm / wanted
    if abs(ratio - 1) <= share:
        return [], [ratio]
    unit = next((f"; the table's lengths look 10 times {word}: its header may say cm for mm, or mm for cm"
                 for word, f in (("too large", 10.0), ("too small", 0.1)) if abs(ratio / f - 1) <= UNIT_SHARE), "")
    return [f"cell {cell.number}: column L says {cell.length_mm:.4g} mm, but by Wsyn = {energy:.5g} MeV {mass_amu:g} amu "
            f"go {wanted:.4g} mm in half a period of {frequency_mhz:g} MHz{unit}"], [ratio]


def _focus_fault(table, cell, mass_amu, charge, frequency_mhz):
    r0 = _r0_mm(cell)
    if None in (r0, cell.focusing, cell.voltage_kv):
        return []
    wave_m = LIGHT_M_PER_S / (frequency_mhz * 1e6)
    a01 = 1.0 if cell.a01 is None else cell.a01
    wanted = a01 * charge * cell.voltage_kv * 1e-3 * wave_m ** 2 / (mass_amu * AMU_MEV * (r0 * 1e-3) ** 2)
    share = FOCUS_WITHOUT_A0 if cell.a01 is None else FOCUS_SHARE
    allowed = share * wanted + table.half("B") + wanted * (
        2 * table.half("a") / cell.aperture_mm + table.half("V") / max(cell.voltage_kv, 1e-9))
    if abs(cell.focusing - wanted) <= allowed:
        return []
    return [f"cell {cell.number}: column B says {cell.focusing:.4f}, but by V = {cell.voltage_kv:g} kV and the aperture "
            f"a = {cell.aperture_mm:.4f} mm (r0 {r0:.4f} mm) it is {wanted:.4f} for {mass_amu:g} amu, charge "
            f"{charge:g}, {frequency_mhz:g} MHz"]


def _energy_fault(table, before, cell, charge):
    made = _two_term(cell)
    if made is None or before is None or None in (before.energy_mev, cell.energy_mev, cell.phase_deg, cell.voltage_kv):
        return []
    phase = cell.phase_deg if before.phase_deg is None else (cell.phase_deg + before.phase_deg) / 2
    a10 = made.acceleration if cell.a10 is None else cell.a10
    wanted = float(charge * np.pi / 4 * a10 * cell.voltage_kv * 1e-3 * fixed.cos(np.radians(phase)))
    gained = cell.energy_mev - before.energy_mev
    share = ENERGY_WITHOUT_A10 if cell.a10 is None else ENERGY_SHARE
    if abs(gained - wanted) <= share * abs(wanted) + 2 * table.half("Wsyn") + 1e-12:
        return []
    return [f"cell {cell.number}: column Wsyn rises by {gained:.5f} MeV, but A10 = {a10:.5g}, V = {cell.voltage_kv:g} kV "
            f"and Phi = {phase:.2f} deg give {wanted:.5f} MeV"]


def _a10_fault(table, cell):
    made = _two_term(cell)
    if made is None or cell.a10 is None:
        return []
    own = float(made.acceleration)
    # A10 grows as m^2 - 1: half a unit of m's last digit is this much of it
    open_ = table.half("A10") + own * table.half("m") / max(cell.modulation - 1, table.half("m"), 1e-9)
    if LEAST_A10 * own - open_ <= cell.a10 <= MOST_A10 * own + open_:
        return []
    return [f"cell {cell.number}: column A10 says {cell.a10:.5g}, but a = {cell.aperture_mm:.4f} mm, m = "
            f"{cell.modulation:g} and L = {cell.length_mm:.4f} mm give {own:.5g}"]


def _r0_faults(table):
    """Neighbours whose tips stand at quite different distances in mid-cell; inside the matching section they do."""
    rows = [(c, r0) for c in table.cells if (r0 := _r0_mm(c)) is not None]
    for (before, was), (cell, now) in zip(rows, rows[1:]):
        if cell.kind != "matching" and abs(now / was - 1) > R0_SHARE:
            mark = (f"; if cell {before.number} belongs to the matching section, mark it: {before.number}R"
                    if was > now and before.modulation == 1.0 else "")
            yield (f"cell {cell.number}: by a = {cell.aperture_mm:.4f} mm and m = {cell.modulation:g} its r0 is "
                   f"{now:.4f} mm, that of cell {before.number} {was:.4f} mm: neighbours differ by at most "
                   f"{R0_SHARE:.0%}; correct column a{mark}")


def _common_cause(ratios, mass_amu, frequency_mhz):
    """What would mend all lengths at once, where all are off alike."""
    if len(ratios) < 2 or any(abs(r / ratios[0] - 1) > LENGTH_WITHOUT_PHASE for r in ratios):
        return ": correct the columns"
    ratio = sum(ratios) / len(ratios)
    if abs(ratio - 1) <= LENGTH_SHARE:
        return ": correct the columns, or frequency_mhz, ion_mass_amu and ion_charge if they are another machine's"
    return (f": all lengths are off alike; {frequency_mhz / ratio:.4g} MHz or {mass_amu / ratio ** 2:.4g} amu would agree: "
            "correct frequency_mhz or ion_mass_amu, or the unit of column L")
