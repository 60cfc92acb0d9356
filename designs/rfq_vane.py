r"""RFQ vane: from a cell table, or from a few numbers, to the tip that a beam sees.

      z ▲ toward the beam                      side                            front
        │   beam axis  ─ · ─ · ─ · ─ · ─ · ─ · ─ · ─ · ─ · ─ · ─ · ─        ─ · ─ + ─ · ─
        │        matching section   cells, longer and deeper                      a
        │       ____/‾‾‾‾‾\__/‾‾\__/‾‾‾\___/‾‾‾‾\____/‾‾‾‾‾‾‾‾‾          R  /‾‾\
        │      /                                                           /    \ flanks
        │     |                                                      B    |      |
        └─────┴──────────────────────────────────────────────► x          └──────┘ A

x is the table's Z, from the wall where the beam enters; the base stands at z = 0, the beam axis at z = B.
Source: cells, tips and transition by the two-term potential (docs/formulas.md 2); tip and flanks as Crandall and Stovall cut
them, circular in every transverse plane.
"""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from cuspline.design import Companion, Design, Finish, FixtureBox, Parameters, Setup, StockBox
from cuspline.designs.rfq.checks import refuse_contradictions
from cuspline.designs.rfq.setups import WORK_OFFSETS, clampings, markers, predicates, splits
from cuspline.designs.rfq.solid import quadrupole, vane_solid
from cuspline.designs.rfq.table import CellLaw, read_table, table_of_law
from cuspline.designs.rfq.tip_line import LOOKS_A_VANE, TipLaws, fitted_tip, follows_thin_formula, refuse_impossible, tip_line
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.transverse_arcs import TransverseArcs
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

DATA = Path(__file__).parent / "data"
TABLES = {"isodar_32p8": DATA / "rfq_isodar_32p8MHz_cells.csv"}
PANEL_CELLS = 6             # faces are split every so many cells
CLEARED_MM = 20.0           # beyond its stretch a clamping's tools clear so far: room for the finishing ball
LARGEST_BALL_MM = 16.0      # diameter of the largest ball that the tool library may finish with
ROUGH_ALLOWANCE_MM = 0.254  # 10 mil, of the source's rough passes
FLANK_MARGIN_MM = 2.0       # that stay free between the ball that finishes the flanks' foot and the jaws

# what a preset gives in place of the defaults; a parameter that is given stands before it
PRESETS = {
    "isodar_32p8": {"table": "isodar_32p8"},
    # CERN PIXE-RFQ, arXiv:2011.09920 table 1 (frequency, ion, energy, voltage, r0 = rho); its cells are not published:
    # these are reckoned by our law
    "hydrogen_750": {
        "table": "law", "frequency_mhz": 749.48, "ion_mass_amu": 1.007276, "energy_in_mev": 0.020, "voltage_kv": 35.0,
        "r0_mm": 1.439, "rho_mm": 1.439, "modulation_max": 1.1, "cells": 40, "ramp_cells": 40, "matching_cells": 4,
        "thickness_mm": 5.0, "axis_height_mm": 30.0, "entry_aperture_mm": 4.0, "flank_deg": 10.0, "stock_top_mm": 1.0,
        "grip_mm": 8.0, "scallop_mm": 0.003, "profile_tolerance_mm": 0.0008},
}


class RfqVane(Parameters):
    """One vane of an RFQ; lengths along it are the table's Z."""

    preset: Literal["isodar_32p8", "hydrogen_750"] = Field(default="isodar_32p8", description="whose defaults")
    table: str = Field(default="isodar_32p8", description="cells: a table's name, 'law', or a CSV or PARMTEQM file")
    vane: Literal["x", "y"] = Field(default="x", description="x begins the first cell at its narrowest, y at its widest")
    law: Literal["two_term", "eight_term"] = Field(default="two_term", description="potential that the tip follows")
    matcher: Literal["thin", "equipotential"] = Field(
        default="thin", description="matching section: thin-vane formula (as PARMTEQM prints it; a table with other apertures is "
        "followed), or its equipotential where that has a root, the thin-vane formula nearer to the wall")
    rho_mm: float = Field(default=7.2885, gt=0.1, le=30, description="transverse radius of the tip")
    rho_follows_r0: bool = Field(default=False, description="let the radius follow each cell's r0 instead, in the ratio it has "
                                 "to r0_mm")
    flank_deg: float = Field(default=10.0, ge=2, le=40, description="flanks from the vertical, wider away from the beam")
    thickness_mm: float = Field(default=20.0, gt=1, le=120, description="A, of the body")
    axis_height_mm: float = Field(default=100.0, gt=5, le=400, description="B, beam axis above the base")
    entry_aperture_mm: float = Field(default=41.1, gt=1, le=200, description="the vane begins where its matching section has "
                                     "opened to this; nearer to the wall nothing stands")
    from_mm: float = Field(default=0.0, ge=0, description="cut the vane to the table's Z from here")
    to_mm: float = Field(default=1e5, gt=0, description="to here")
    frequency_mhz: float = Field(default=32.8, gt=1, le=3000, description="of the RF: table's units, computed cells")
    ion_mass_amu: float = Field(default=2.0, gt=0.5, le=300, description="of the ion")
    ion_charge: float = Field(default=1.0, ge=1, le=100, description="of the ion, for computed cells")
    energy_in_mev: float = Field(default=0.015, gt=0, le=10, description="computed cells: energy of the ion as it enters")
    voltage_kv: float = Field(default=22.0, gt=0, le=500, description="computed cells: between vanes")
    r0_mm: float = Field(default=9.718, gt=0.2, le=60, description="middle aperture, of computed cells and for rho_follows_r0")
    modulation_max: float = Field(default=1.7, ge=1, le=4, description="computed cells: m at the end of the ramp")
    cells: int = Field(default=50, ge=1, le=1000, description="computed cells: modulated ones")
    ramp_cells: int = Field(default=40, ge=1, le=1000, description="computed cells: over so many m and the phase rise")
    matching_cells: int = Field(default=4, ge=0, le=12, description="computed cells: of the matching section")
    phase_deg: float = Field(default=-30.0, ge=-90, le=-10, description="computed cells: synchronous phase behind the ramp")
    ball_mm: float = Field(default=0.0, ge=0, le=100, description="diameter of the finishing ball, or twice the corner radius of a "
                           "side-and-face cutter; 0: the largest that fits")
    strategy: Literal["sections", "transverse_arcs"] = Field(
        default="sections", description="passes on the offset of the true surface, or as the vane's controller lays them: an "
        "arc in each transverse plane, as sub-programs and three numbers a step")
    cutter: Literal["ball", "side"] = Field(default="ball", description="transverse_arcs: a ball, or a side-and-face cutter on an "
                                            "angle head; it needs room above the jaws")
    rest: Literal["none", "sections"] = Field(default="none", description="transverse_arcs: where arcs leave more than the finish "
                                              "allows, nothing more, or a ball along sections")
    allowance_mm: float = Field(default=0.0, ge=0, le=5, description="transverse_arcs: left by the rough passes; 0: 0.254, 10 mil")
    plating_mm: float = Field(default=0.0, ge=0, le=1, description="plated on later: the metal is cut and judged so much below")
    passes: Literal["zig-zag", "one-way"] = Field(default="zig-zag", description="finishing passes to and fro, or all one way")
    bed_travel_mm: float = Field(default=1400.0, ge=20, le=1e4, description="longest stretch that is cut in one "
                                 "setup, roughing goes 20 mm beyond; a longer vane is shifted along the bed")
    overlap_mm: float = Field(default=10.0, gt=0, le=200, description="cut by both of two neighbouring setups")
    stock_top_mm: float = Field(default=1.5, ge=0, le=20, description="stock above the highest crest")
    grip_mm: float = Field(default=25.0, ge=1, le=200, description="height of the jaws above the base")
    scallop_mm: float = Field(default=0.005, ge=0.001, le=0.1, description="largest cusp left")
    profile_tolerance_mm: float = Field(default=0.001, ge=0.0002, le=0.02, description="path against true surface")
    gouge_mm: float = Field(default=0.0025, ge=0.0005, le=0.02, description="deepest accepted cut below the surface")
    material: str = Field(default="copper_ofhc", description="work material, a name of `materials`")

    @model_validator(mode="before")
    @classmethod
    def _preset_gives_the_defaults(cls, given):
        return {**PRESETS.get(given.get("preset", "isodar_32p8"), {}), **given}


def table_of(p):
    """CellTable that the parameters name, its columns held against each other and the ion."""
    if p.table == "law":
        return table_of_law(CellLaw(
            frequency_mhz=p.frequency_mhz, mass_amu=p.ion_mass_amu, charge=p.ion_charge, energy_mev=p.energy_in_mev,
            voltage_kv=p.voltage_kv, r0_mm=p.r0_mm, modulation_max=p.modulation_max, cells=p.cells,
            ramp_cells=p.ramp_cells, matching_cells=p.matching_cells, phase_deg=p.phase_deg))
    table = read_table(TABLES.get(p.table, p.table))
    refuse_contradictions(table, p.ion_mass_amu, p.ion_charge, p.frequency_mhz)
    return table


def line_of(p, vane=None):
    """TipLine of a vane, by default the parameters' own."""
    radius_of = (lambda r0: p.rho_mm * r0 / p.r0_mm) if p.rho_follows_r0 else (lambda r0: p.rho_mm)
    return tip_line(table_of(p), TipLaws(law=p.law, matcher=p.matcher, radius_of=radius_of), vane=vane or p.vane,
                    entry_aperture_mm=p.entry_aperture_mm, from_mm=p.from_mm, to_mm=p.to_mm)


def tip_of(p, line):
    """CircularTip of a line, in part coordinates."""
    return fitted_tip(line, p.axis_height_mm, np.radians(p.flank_deg), p.thickness_mm / 2)


def solid_of(p, line, tip, spans=()):
    """TopoDS solid of a vane; its faces end where clampings do."""
    return vane_solid(tip, p.thickness_mm / 2, splits([s.start_mm for s in line.segments][1::PANEL_CELLS], spans))


def assembly(p):
    """TopoDS compound of all four vanes round the beam, which runs along +z."""
    lines = [line_of(p, vane) for vane in "xy"]
    return quadrupole(*(solid_of(p, line, tip_of(p, line)) for line in lines), p.axis_height_mm)


def design(p: RfqVane) -> Design:
    """The vane, ready to be planned: tip and flanks are finished, sides and base finished before."""
    line, other = line_of(p), line_of(p, "y" if p.vane == "x" else "x")
    refuse_impossible(line, other, p.thickness_mm / 2, p.flank_deg, p.axis_height_mm)
    tip = tip_of(p, line)
    _refuse_ball(p, line, tip)
    _refuse_jaws(p, line, tip)
    half, (start, end) = p.thickness_mm / 2, tip.range_mm
    spans = clampings(start, end, p.bed_travel_mm, p.overlap_mm)
    top = float(tip.crest_z_mm(np.linspace(start, end, LOOKS_A_VANE)).max())
    return Design(
        name="rfq_vane", description=_description(p, line), parameters=p, solid=solid_of(p, line, tip, spans), guides=(tip,),
        predicates=predicates(spans),
        material=p.material, machine="mill_long_bed",
        stock=StockBox(min_mm=(start, -half, 0.0), max_mm=(end, half, top + p.stock_top_mm)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.profile_tolerance_mm, gouge_mm=p.gouge_mm,
                      plating_mm=p.plating_mm),
        setups=tuple(_setup(p, spans, k) for k in range(len(spans))),
        where=lambda place_mm: line.cell_at(place_mm[0]),
        companions=(Companion(name="quadrupole", make=lambda: assembly(p)),))


def _setup(p, spans, k):
    """One clamping."""
    first, start = spans[k][0], spans[0][0]
    zero = (f"X0 {first - start:.3f} mm from the end where the beam enters, found by the markers" if k else
            "X0 at the end where the beam enters")
    return Setup(
        name=f"setup-{k + 1}", wcs=WORK_OFFSETS[k], faces=(predicates(spans)[k].name,),
        operations=(_operation(p),), wcs_origin_mm=(first, 0.0, 0.0), fixtures=_jaws(p, start, spans[-1][1]),
        reach_x_mm=(spans[k][0] - CLEARED_MM, spans[k][1] + CLEARED_MM) if len(spans) > 1 else None,
        markers=markers(spans[k], p.thickness_mm / 2, p.grip_mm),
        wcs_in_words=f"{zero}, Y0 in the mid-plane, Z0 on the base")


def _operation(p):
    """What cuts the vane, as its parameters ask for it.

    Raises:
        DesignError: a side cutter along sections.
    """
    if p.strategy == "transverse_arcs":
        return TransverseArcs(passes=p.passes, allowance_mm=p.allowance_mm or ROUGH_ALLOWANCE_MM, cutter=p.cutter,
                              ball_mm=p.ball_mm or None, rest=p.rest)
    if p.cutter == "side":
        raise DesignError("cutter side: a side-and-face cutter runs transverse_arcs, not sections: give strategy=transverse_arcs")
    if p.allowance_mm:
        raise DesignError(f"allowance_mm {p.allowance_mm:g} is what the rough passes of transverse_arcs leave, and sections have "
                          "none: leave it out, or say what roughing leaves by -p shop.rough_allowance_mm")
    return Auto(strategy="sections", section_plane="YZ", passes=p.passes, tool=f"ball {p.ball_mm!r}" if p.ball_mm else None)


def _refuse_jaws(p, line, tip):
    """A ball that finishes the flanks down to their foot stands lower than it touches, beside the body, over the jaws.

    Its tip is lower than the contact by R (1 - n_z), n_z = sin f / sqrt(1 + y'^2 sin^2 f), f the flanks' angle from the
    vertical and y' the crest's slope along the vane: most where a vane opens steeply towards the wall.
    """
    x = np.linspace(*tip.range_mm, LOOKS_A_VANE)
    slopes = np.abs(np.diff(tip.crest_z_mm(x)) / np.diff(x))
    steep, sine = int(slopes.argmax()), fixed.sin(np.radians(p.flank_deg))
    hollow = min(radius for radius, _ in tip.tightest_hollows())
    radius = p.ball_mm / 2 if p.ball_mm else min(LARGEST_BALL_MM / 2, hollow)
    drop = 0.0 if p.cutter == "side" else radius * (1 - sine / np.sqrt(1 + (slopes[steep] * sine) ** 2))
    lowest = tip.foot_z_mm - drop
    if lowest < p.grip_mm + FLANK_MARGIN_MM:
        ball = f", a ball of {2 * radius:g} mm that finishes them to {lowest:.2f} mm" if drop else ""
        raise DesignError(f"the flanks come down to {tip.foot_z_mm:.2f} mm above the base{ball}; the jaws reach up to "
                          f"{p.grip_mm:g} mm and need {FLANK_MARGIN_MM:g} mm less than that (steepest at "
                          f"{line.cell_at(x[steep])}): raise axis_height_mm or flank_deg, lower grip_mm, thickness_mm, "
                          "entry_aperture_mm or ball_mm")


def _refuse_ball(p, line, tip):
    """A ball that is asked for must be smaller than every hollow."""
    if not p.ball_mm:
        return
    (crest, at_crest), (side, at_side) = tip.tightest_hollows()
    radius, place, where = min((crest, at_crest, "on its crest"), (side, at_side, "on its sides"), key=lambda h: h[0])
    if p.ball_mm / 2 >= radius:
        raise DesignError(f"{line.cell_at(place[0])}: a ball of radius {p.ball_mm / 2:g} mm is too big for the valley "
                          f"of {radius:.2f} mm {where}, at Z {place[0]:.2f} mm: lower ball_mm")


def _description(p, line):
    blend, where = line.largest_blend()
    law = p.law.replace("_", "-")
    said = (f"RFQ {p.vane} vane, {p.table}: {law} tip from Z {line.from_mm:.3f} to {line.to_mm:.3f} mm, cells "
            f"blended by at most {blend * 1e3:.0f} um ({where})")
    if line.cell_at(line.from_mm) == "matching section":
        said += (", matching section on its equipotential, by the thin-vane formula where that has no root"
                 if p.matcher == "equipotential" else ", thin-vane matching section"
                 if follows_thin_formula(table_of(p)) else ", matching section through the table's apertures")
    return said


def _jaws(p, start, end):
    """The jaws grip the body's sides along the whole vane."""
    half = p.thickness_mm / 2
    return tuple(FixtureBox(name=name, min_mm=(start, low, -30.0), max_mm=(end, high, p.grip_mm))
                 for name, low, high in (("fixed jaw", -half - 40.0, -half), ("moving jaw", half, half + 40.0)))
