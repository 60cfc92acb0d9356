"""Propellers by name: published tables with their sources, a family by own parameters, tables from files."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cuspline.designs.propellers.blade import PropellerTable, radial_laws
from cuspline.designs.propellers.entries import refuse_bad_entries
from cuspline.designs.propellers.sections import (
    DATA,
    TrailingEdge,
    b_series_offsets,
    naca66_a08,
    offset_shapes,
    sections_of,
    table,
)
from cuspline.splines.fairing import fair_spline
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

DTMB_4119_MM = 304.8                # 12 in
B_SERIES_HUB = {3: 0.180}           # hub / propeller diameter; of all others 0.167
OTHER_HUB = 0.167
LAW_POINTS = 64                     # of the integral of a chord law
COLUMNS = ("r_R", "c_D", "P_D", "skew_deg", "rake_D")


@dataclass(frozen=True)
class MainDimensions:
    """What a propeller is called by."""

    blades: int
    area_ratio: float           # expanded blade area / disc area
    pitch_ratio: float          # pitch / diameter
    diameter_mm: float
    is_right_handed: bool = True


@dataclass(frozen=True, kw_only=True)
class BladeForm:
    """How the blades of a propeller of one's own are formed."""

    skew_deg: float = 0.0           # of the tip against the root, towards the trailing edge; square of the way from the hub
    rake_deg: float = 0.0           # of the generator line, downstream
    root_pitch_share: float = 1.0   # pitch at the hub over that from 0.7 R outward
    thickness_scale: float = 1.0    # on the thickness of the B-series
    camber_share: float = 0.02      # greatest camber / chord at 0.7 R; over the radius as on DTMB 4119
    sections_csv: str | None = None     # thickness form and mean line of one's own, see `sections.sections_of`
    edge: TrailingEdge = TrailingEdge()


def dtmb_4119(diameter_mm=DTMB_4119_MM, is_right_handed=True, edge=TrailingEdge()):
    """The table of DTMB propeller 4119; source: data/propeller_dtmb4119.csv."""
    return _from_columns("DTMB 4119", table(DATA / "propeller_dtmb4119.csv"), 3, diameter_mm, is_right_handed,
                         naca66_a08(), edge)


def b_series(main, rake_deg=15.0, edge_share=0.08, edge=TrailingEdge()):
    """The table of a Wageningen B-screw.

    The generator line stands at the table's distance from the leading edge; inside the tip, where the chord
    vanishes, its distance from the middle of the chord goes on smoothly, so that the tip is round.

    Args:
        main: MainDimensions of 3 to 7 blades; the pitch is the nominal one, 4-bladed ones have less at the root.
        rake_deg: of the generator line, downstream.
        edge_share: thickness of both edges before they are rounded, share of the section's greatest.
    """
    blades = main.blades
    if blades not in range(3, 8):
        raise DesignError(f"the B-series has 3 to 7 blades, not {blades}: its tables end there")
    plan, tag = table(DATA / "propeller_bseries_planform.csv"), "Z3" if blades == 3 else "Z4to7"
    r = plan["r_R"]
    chord = plan[f"K_{tag}"] * main.area_ratio / blades
    pitch = main.pitch_ratio * (plan["pitch_factor_Z4"] if blades == 4 else np.ones(len(r)))
    behind = (0.5 - plan[f"a_c_{tag}"]) * chord                 # middle of the chord from the generator line, of D
    phi = fixed.arctan(pitch / (np.pi * r))
    skew = np.where(r < 1, behind * fixed.cos(phi) / (r / 2), np.nan)
    # behind * sin(phi) is the rake that this skew brings with it: only the generator line's own is told
    radii, x_c, face, back = b_series_offsets(blades, edge_share)
    return PropellerTable(
        name=f"B{blades}-{100 * main.area_ratio:.0f}", blades=blades, diameter_mm=main.diameter_mm,
        is_right_handed=main.is_right_handed,
        r_R=r, chord_D=chord, pitch_D=pitch, skew_rad=skew, rake_D=fixed.tan(np.radians(rake_deg)) * r / 2,
        thickness_D=plan["Ar"] - plan["Br"] * blades, camber_c=np.zeros(len(r)),
        shape=offset_shapes(radii, x_c, face, back, np.ones(len(radii))), edge=edge)


def own_propeller(main, hub_ratio, form=BladeForm()):
    """The table of a propeller by a few parameters.

    Outline of the B-series about its middle line, scaled to the area ratio between hub and tip; thickness of the
    B-series; modified NACA 66 sections on the a = 0.8 mean line, or those of a file.

    Args:
        main: MainDimensions of 3 to 9 blades; the area counts outside the hub, the pitch from 0.7 R outward.
        hub_ratio: hub diameter over propeller diameter.
        form: BladeForm.
    """
    plan, dtmb = table(DATA / "propeller_bseries_planform.csv"), table(DATA / "propeller_dtmb4119.csv")
    r = plan["r_R"]
    out = np.clip((r - hub_ratio) / (1 - hub_ratio), -0.2, 1)
    camber = np.interp(r, dtmb["r_R"], dtmb["f0_c"])
    camber *= form.camber_share / np.interp(0.7, r, camber)
    unload = np.clip((0.7 - r) / (0.7 - hub_ratio), 0, 1.2) ** 2
    made = PropellerTable(
        name=f"{main.blades}-bladed", blades=main.blades, diameter_mm=main.diameter_mm,
        is_right_handed=main.is_right_handed, r_R=r, chord_D=plan["K_Z4to7"] * main.area_ratio / main.blades,
        pitch_D=main.pitch_ratio * (1 - (1 - form.root_pitch_share) * unload),
        skew_rad=np.radians(form.skew_deg) * np.sign(out) * out ** 2, rake_D=fixed.tan(np.radians(form.rake_deg)) * r / 2,
        thickness_D=form.thickness_scale * (plan["Ar"] - plan["Br"] * min(main.blades, 7)), camber_c=camber,
        shape=_sections(form.sections_csv), edge=form.edge)
    return replace(made, chord_D=made.chord_D * main.area_ratio / expanded_area_ratio(made, hub_ratio))


def from_files(radii_csv, diameter_mm, blades, is_right_handed=True, offsets_csv=None, sections_csv=None,
               edge=TrailingEdge()):
    """A propeller by tables on disk.

    Args:
        radii_csv: columns r_R, c_D, P_D, skew_deg, rake_D, t0_D or t0_c, and f0_c; the last row r_R = 1.
        offsets_csv: columns r_R, x_c, face_c, back_c: ordinates of face and back from the nose-tail line at stations
            from 0 to 1, shares of the chord; in place of t0 and f0.
        sections_csv: in place of that, one thickness form and mean line for all radii, see `sections.sections_of`.
            None of both: modified NACA 66 on the a = 0.8 mean line.
    """
    columns, name = table(radii_csv), Path(radii_csv).stem
    if offsets_csv is None:
        return _from_columns(name, columns, blades, diameter_mm, is_right_handed, _sections(sections_csv), edge)
    rows = table(offsets_csv)
    _require(offsets_csv, rows, ("r_R", "x_c", "face_c", "back_c"))
    refuse_bad_entries(Path(offsets_csv).name, rows, diameter_mm, has_tip=False)
    radii = np.unique(rows["r_R"])
    per = [np.flatnonzero(rows["r_R"] == r) for r in radii]
    per = [k[np.argsort(rows["x_c"][k], kind="stable")] for k in per]
    for r, k in zip(radii, per):
        x = rows["x_c"][k]
        if len(x) < 6 or x[0] != 0 or x[-1] != 1 or (np.diff(x) <= 0).any():
            raise DesignError(f"propeller table {offsets_csv}, r/R = {r:g}: stations x_c must run from 0 to 1, "
                              f"each once, at least 6; there are {len(x)}")
    face, back = ([rows[c][k] for k in per] for c in ("face_c", "back_c"))
    thick = np.array([(b - f).max() for f, b in zip(face, back)])
    if (thick <= 0).any():
        raise DesignError(f"propeller table {offsets_csv}, r/R = {radii[np.argmax(thick <= 0)]:g}: the back must "
                          "be above the face")
    shape = offset_shapes(radii, [rows["x_c"][k] for k in per], face, back, thick)
    law = fair_spline(radii, thick, bending=2)
    columns = {**columns, "t0_c": law(np.clip(columns["r_R"], radii[0], radii[-1])),
               "f0_c": np.zeros(len(columns["r_R"]))}
    columns.pop("t0_D", None)
    return _from_columns(name, columns, blades, diameter_mm, is_right_handed, shape, edge)


def _sections(sections_csv):
    return naca66_a08() if sections_csv is None else sections_of(sections_csv)


def _from_columns(name, columns, blades, diameter_mm, is_right_handed, shape, edge):
    is_in_radians = "skew_rad" in columns and "skew_deg" not in columns
    if is_in_radians:
        columns = {**columns, "skew_deg": np.degrees(columns["skew_rad"])}
    _require(name, columns, (*COLUMNS, "f0_c"))
    if "t0_D" not in columns and "t0_c" not in columns:
        raise DesignError(f"propeller table {name} has neither t0_D nor t0_c: the greatest thickness is missing")
    refuse_bad_entries(name, columns, diameter_mm, may_be_radians=not is_in_radians)
    thickness = columns["t0_D"] if "t0_D" in columns else columns["t0_c"] * columns["c_D"]
    return PropellerTable(
        name=name, blades=blades, diameter_mm=diameter_mm, is_right_handed=is_right_handed, r_R=columns["r_R"],
        chord_D=columns["c_D"], pitch_D=columns["P_D"], skew_rad=np.radians(columns["skew_deg"]),
        rake_D=columns["rake_D"], thickness_D=thickness, camber_c=columns["f0_c"], shape=shape, edge=edge)


def _require(name, columns, wanted):
    missing = [c for c in wanted if c not in columns]
    if missing:
        raise DesignError(f"propeller table {name} has no column {', '.join(missing)}; it has {', '.join(columns)}")


def expanded_area_ratio(made, hub_ratio):
    """Expanded blade area outside the hub over the disc's area, by the chord law through a PropellerTable."""
    return area_under_chords(made, hub_ratio, radial_laws(made, hub_ratio).chord_mm, LAW_POINTS)


def area_under_chords(made, hub_ratio, chord_mm, points):
    """Z times the integral of chords from hub to tip over the disc's area, by Gauss points over sqrt(1 - r/R).

    Args:
        made: PropellerTable.
        hub_ratio: hub diameter over propeller diameter.
        chord_mm: function r/R (n,) -> chord (n,).
        points: how many chords are asked for.
    """
    nodes, weights = fixed.gauss_points(points)
    end = np.sqrt(1 - hub_ratio)
    w = end * (1 + nodes) / 2
    chord = chord_mm(1 - w * w) / made.diameter_mm
    return float(made.blades * np.sum(weights * end / 2 * chord * 2 * w) * 0.5 / (np.pi / 4))
