"""RFQ vanes: tables, potentials and tips against the 58-cell table's known values; the B-rep against the tip line.

Values in tests/designs/rfq/ were computed apart from this project's code (roots by brentq; headers say from what).
"""

import csv
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from OCP.TopAbs import TopAbs_SOLID

from cuspline.app import catalogue
from cuspline.designs.rfq.checks import refuse_contradictions
from cuspline.designs.rfq.eight_term import EightTerm
from cuspline.designs.rfq.potential import TwoTerm, equipotential_matcher_mm, thin_matcher_mm, transition_length_mm
from cuspline.designs.rfq.table import half_wave_mm, read_table
from cuspline.designs.rfq.tip_line import Segment, TipLine, fitted_tip
from cuspline.designs.rfq_vane import TABLES, RfqVane, assembly, design, line_of, table_of
from cuspline.kernel import brep
from cuspline.planning.plan import plan_setup
from cuspline.planning.section_finishing import _plane_step
from cuspline.surfaces.curvature import sample_faces, tightest_hollow
from cuspline.surfaces.sections import SectionPlane
from cuspline.values.errors import CamError, CutterDoesNotFit, DesignError, InputError

VALUES = Path(__file__).parent / "rfq"
TABLE = read_table(TABLES["isodar_32p8"])
CELLS = {c.number: c for c in TABLE.of_kind("accelerating")}


def rows_of(name):
    with (VALUES / name).open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def two_term(number):
    c = CELLS[number]
    return TwoTerm(aperture_mm=c.aperture_mm, modulation=c.modulation, length_mm=c.length_mm)


# the table ------------------------------------------------------------------------------------------


def test_the_table_is_read_whole():
    assert [len(TABLE.of_kind(k)) for k in ("matching", "accelerating", "transition", "straight", "fringe")] == [
        4, 51, 1, 1, 1]
    assert sum(c.length_mm for c in TABLE.cells) == pytest.approx(1323.13, abs=0.01)      # "RFQ length" of the program
    refuse_contradictions(TABLE, 2.0, 1.0, 32.8)


def test_r0_of_the_table_is_constant():
    """0.05 % as a scatter; the extremes lie 0.11 % apart (9.708 to 9.719 mm)."""
    r0 = np.array([two_term(n).r0_mm for n in CELLS])
    assert r0.std() / r0.mean() < 5e-4
    assert r0.min() == pytest.approx(9.708, abs=5e-4) and r0.max() == pytest.approx(9.719, abs=5e-4)


def parmteqm_text(cells=CELLS):
    """The table in PARMTEQM's layout, as its program prints it: a heading, one line a cell, the heading again."""
    lines = TABLES["isodar_32p8"].read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    heading = " Cell    V     Wsyn  Sig0T  Sig0L   A10     Phi     a      m       B       L        Z      A0     RFdef"
    lines = ["Parmteqm 3.09, revision date 4-7-2009", "IN4: a line of input", "RFQ parameters for each cell",
             "Number of cells = 58", heading]
    for row in rows:
        number, letter = (row["cell"][:-1], row["cell"][-1]) if row["cell"][-1].isalpha() else (row["cell"], " ")
        values = [v for k, v in row.items() if k != "cell" and v]
        if number == "0":
            values.insert(2, "0.0")     # PARMTEQM prints its zeros
            values.insert(2, "0.0")
        if letter == "F":
            values.insert(1, "0.1")     # a phase advance that the CSV leaves out
        lines.append(f"{number:>4}{letter} " + "  ".join(values))
    return "\n".join([*lines, heading, "A letter next to the cell number above indicates:", ""])


def test_parmteqm_text_gives_the_same_cells(tmp_path):
    path = tmp_path / "PARMTEQOUT.TXT"
    path.write_text(parmteqm_text())
    for cell, known in zip(read_table(path).cells, TABLE.cells, strict=True):
        assert (cell.number, cell.kind) == (known.number, known.kind)
        for name in ("aperture_mm", "modulation", "length_mm", "energy_mev", "end_mm"):
            assert getattr(cell, name) == pytest.approx(getattr(known, name), abs=1e-9), (cell.number, name)


def table_text(change=lambda rows: None, unit="cm"):
    rows = [dict(cell=c.number, a=c.aperture_mm / 10, m=c.modulation, L=c.length_mm / 10, Z=c.end_mm / 10,
                 Wsyn=c.energy_mev) for c in CELLS.values()][25:35]
    shift = rows[0]["Z"] - rows[0]["L"]
    for row in rows:
        row["Z"] -= shift
    change(rows)
    lines = [f"cell,a[{unit}],m[-],L[{unit}],Z[{unit}],Wsyn[MeV]"]
    return "\n".join(lines + [",".join(str(r[k]) for k in ("cell", "a", "m", "L", "Z", "Wsyn")) for r in rows]) + "\n"


def refusal_of(tmp_path, text, **parameters):
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(CamError) as refused:
        catalogue.make_design(catalogue.find_design("rfq_vane"),
                              [f"table={path}", *(f"{k}={v}" for k, v in parameters.items())])
    return str(refused.value)


def test_a_cut_table_makes_a_vane(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(table_text())
    made = design(RfqVane(table=str(path)))
    assert made.guides[0].range_mm == pytest.approx((0.0, sum(CELLS[n].length_mm for n in range(30, 40))))


@pytest.mark.parametrize("change, unit, said", [
    (lambda rows: rows[3].update(L=rows[3]["L"] + 0.3), "cm", ("cell 33", "overlaps cell 32")),
    (lambda rows: rows[3].update(Z=rows[3]["Z"] - 0.4), "cm", ("cell 33", "overlaps cell 32")),
    (lambda rows: rows[3].update(L=-1.0), "cm", ("cell 33", "length")),
    (lambda rows: rows.pop(4), "cm", ("cell 35", "follows cell 33")),
    (lambda rows: rows[2].update(m=0.9), "cm", ("cell 32", "modulation")),
    (lambda rows: rows[2].update(a="wide"), "cm", ("cell 32", "'wide'")),
    (lambda rows: None, "mm", ("cell 30", "10 times too small")),
    (lambda rows: None, "furlong", ("furlong", "unit")),
    (lambda rows: rows[5].update(m=9.0), "cm", ("cell 35", "crosses itself")),
])
def test_impossible_tables_are_refused_with_the_cell(tmp_path, change, unit, said):
    words = refusal_of(tmp_path, table_text(change, unit))
    assert all(s in words for s in said), words


# columns against each other ----------------------------------------------------------------------------


def whole_table(change=lambda rows: None, keep=None):
    """The 58-cell table's text with rows changed, by the cell's name; `keep`: only these columns."""
    lines = [line for line in TABLES["isodar_32p8"].read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    columns = [c for c in rows[0] if keep is None or c.split("[")[0] in keep]
    change({row["cell"]: row for row in rows})
    return "\n".join([",".join(columns), *(",".join(r[c] for c in columns) for r in rows)]) + "\n"


def table_from(tmp_path, text, **parameters):
    path = tmp_path / "table.csv"
    path.write_text(text)
    return table_of(RfqVane(table=str(path), **parameters))


def refused(tmp_path, text, **parameters):
    with pytest.raises(InputError) as error:
        table_from(tmp_path, text, **parameters)
    return str(error.value)


@pytest.mark.parametrize("parameters, said", [
    ({"frequency_mhz": 43.0}, ("43 MHz", "32.9", "frequency_mhz")), ({"frequency_mhz": 22.6}, ("22.6 MHz",)),
    ({"ion_mass_amu": 2.58}, ("2.58 amu", "2.02")), ({"ion_charge": 2}, ("column B", "charge 2"))])
def test_another_ion_or_frequency_than_the_tables_is_refused(tmp_path, parameters, said):
    words = refused(tmp_path, whole_table(), **parameters)
    assert all(s in words for s in said), words


@pytest.mark.parametrize("cell, column, factor, said", [
    ("20", "a[cm]", 1.28, ("cell 20", "column B", "r0", "correct column a")),
    ("20", "a[cm]", 1.04, ("cell 20", "column B says 10.3693")),
    ("2R", "a[cm]", 1.05, ("cell 2", "column B says 3.6931")),
    ("40", "L[cm]", 1.03, ("cell 40", "overlaps", "correct L or Z")),
    ("40", "Wsyn[MeV]", 1.1, ("cell 40", "column Wsyn rises")),
    ("45", "m[-]", 1.3, ("cell 45", "column A10 says 0.24731")),
    ("45", "B[-]", 0.9, ("cell 45", "column B says 9.4")),
    ("30", "V[kV]", 2.0, ("cell 30", "V = 44 kV")),
])
def test_a_value_that_the_other_columns_deny_is_named_with_both_values(tmp_path, cell, column, factor, said):
    def change(rows):
        rows[cell][column] = f"{float(rows[cell][column]) * factor:.4f}"
    words = refused(tmp_path, whole_table(change))
    assert all(s in words for s in said), words


def test_the_table_without_its_other_columns_is_taken_and_one_aperture_off_still_refused(tmp_path):
    few = ("cell", "a", "m", "L")
    assert len(table_from(tmp_path, whole_table(keep=few)).cells) == 58
    words = refused(tmp_path, whole_table(lambda rows: rows["20"].update({"a[cm]": "1.2"}), few))
    assert "cell 20" in words and "r0" in words and "at most 5%" in words


def test_entry_cells_that_lost_their_mark_are_refused_with_the_mark(tmp_path):
    text = whole_table().replace("\n1R,", "\n1,").replace("\n2R,", "\n2,").replace("\n3R,", "\n3,").replace("\n4R,", "\n4,")
    assert "mark it: 1R" in refused(tmp_path, text)


def test_a_matching_section_goes_through_the_tables_own_apertures(tmp_path):
    """r0 / sin^0.5: the thin-vane formula lies up to 25 mm off it."""
    wanted = {f"{k}R": 9.718 / np.sin(np.pi * k / 8) ** 0.5 for k in (1, 2, 3)}

    def change(rows):
        for name, a in wanted.items():
            old = float(rows[name]["a[cm]"])
            rows[name].update({"a[cm]": f"{a / 10:.4f}", "B[-]": f"{float(rows[name]['B[-]']) * (10 * old / a) ** 2:.4f}"})
    path = tmp_path / "slow.csv"
    path.write_text(whole_table(change))
    line = line_of(RfqVane(table=str(path), to_mm=60.0))
    ends = 18.339 * np.arange(1, 4)
    # the table's last digit is 1 um
    assert line.aperture_mm(ends) == pytest.approx(list(wanted.values()), abs=0.6e-3)
    between = np.linspace(8.0, 58.0, 40)
    assert line.aperture_mm(between) == pytest.approx(9.718 / np.sin(np.pi * between / 4 / 36.678) ** 0.5, abs=5e-3)
    assert line.aperture_mm(np.array([line.from_mm]))[0] == pytest.approx(41.1, abs=1e-6)
    tip = fitted_tip(line, 100.0, np.radians(10.0), 10.0)
    assert 100.0 - tip.crest_z_mm(ends) == pytest.approx(list(wanted.values()), abs=1e-3)


def test_a_matching_section_that_widens_towards_the_beam_is_refused_with_the_cell(tmp_path):
    text = whole_table(lambda rows: rows["3R"].update({"a[cm]": "1.7"}), ("cell", "a", "m", "L"))
    path = tmp_path / "table.csv"
    path.write_text(text)
    with pytest.raises(DesignError, match="cell 3: its aperture 17.0000 mm is not below the 16.3440 mm of matching cell 2"):
        line_of(RfqVane(table=str(path)))


def test_all_faults_of_a_table_are_told_at_once_with_their_cells(tmp_path):
    def change(rows):
        rows["7"].update({"a[cm]": "nan"})
        rows["9"].update({"m[-]": "inf", "L[cm]": "long"})
    words = refused(tmp_path, whole_table(change))
    assert all(s in words for s in ("cell 7: column a holds 'nan'", "cell 9: column L holds 'long', a number is needed, "
                                    "column m holds 'inf'")), words


def test_a_byte_order_mark_is_no_part_of_a_table(tmp_path):
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xef\xbb\xbf" + TABLES["isodar_32p8"].read_bytes())
    assert read_table(path).cells == TABLE.cells


def test_other_units_of_voltage_and_energy_are_taken_and_unknown_ones_refused(tmp_path):
    text = whole_table()
    in_kev = "\n".join(",".join([r[0], r[1], str(float(r[2]) * 1e3) if r[2] else "", *r[3:]]) for r in (
        line.split(",") for line in text.splitlines()[1:]))
    header = text.splitlines()[0].replace("Wsyn[MeV]", "Wsyn[keV]")
    assert table_from(tmp_path, f"{header}\n{in_kev}\n").cells[30].energy_mev == pytest.approx(TABLE.cells[30].energy_mev)
    assert "'TeV'" in refused(tmp_path, text.replace("Wsyn[MeV]", "Wsyn[TeV]"))


@pytest.mark.parametrize("parameters", [{"axis_height_mm": 92.0, "from_mm": 0.0, "to_mm": 40.0}, {"grip_mm": 34.0, "to_mm": 40.0}])
def test_jaws_that_the_finishing_ball_would_meet_are_refused(parameters):
    """The flanks' foot stays above them by more than 2 mm; the ball of 16 mm reaches 6.8 mm lower than its contact."""
    with pytest.raises(DesignError, match="a ball of 16 mm that finishes them.*steepest at matching section"):
        design(RfqVane(**parameters))


def test_millimetres_called_centimetres_are_refused(tmp_path):
    def in_mm(rows):
        for row in rows:
            row.update(a=row["a"] * 10, L=row["L"] * 10, Z=row["Z"] * 10)
    assert "10 times too large" in refusal_of(tmp_path, table_text(in_mm))
    path = tmp_path / "mm.csv"
    path.write_text(table_text(in_mm, unit="mm"))
    assert read_table(path).cells[0].aperture_mm == pytest.approx(CELLS[30].aperture_mm)


def test_a_file_that_is_not_there_is_refused():
    with pytest.raises(InputError, match="does not exist"):
        table_of(RfqVane(table="/nowhere/table.csv"))


def test_vanes_that_meet_are_refused(tmp_path):
    assert "run into each other" in refusal_of(tmp_path, table_text(), rho_mm=28, thickness_mm=80, axis_height_mm=300)
    assert "wider than the body" in refusal_of(tmp_path, table_text(), rho_mm=12)


def test_a_cutter_too_big_for_a_valley_is_refused_with_the_cell():
    with pytest.raises(DesignError, match=r"cell 35.*30\.34 mm.*ball_mm"):
        design(RfqVane(ball_mm=62.0))


# tips -----------------------------------------------------------------------------------------------


def test_tip_lines_agree_with_known_values():
    for row in rows_of("rfq_tip_profile_samples.csv"):
        cell, z = two_term(int(row["cell"])), [10 * float(row["z[cm]"])]
        assert cell.tip_mm(z, 1)[0] == pytest.approx(10 * float(row["x_tip[cm]"]), abs=1e-6)
        assert cell.tip_mm(z, -1)[0] == pytest.approx(10 * float(row["y_tip[cm]"]), abs=1e-6)


def test_the_smallest_valley_is_that_of_cell_36():
    radii = {n: two_term(n).valley_radius_mm for n in CELLS}
    tightest = min(radii, key=radii.get)
    assert tightest == 36 and radii[36] == pytest.approx(30.81254, abs=1e-5)
    # two ways: the closed form and differences of the tip line
    cell, h = two_term(36), 1e-3
    z = cell.length_mm + h * np.array([-1.0, 0.0, 1.0])
    assert h * h / abs(np.dot(cell.tip_mm(z, 1), [1, -2, 1])) == pytest.approx(radii[36], rel=1e-5)


def test_matcher_apertures():
    matching = TABLE.of_kind("matching")
    length, r0 = sum(c.length_mm for c in matching), matching[-1].aperture_mm
    ends = np.cumsum([c.length_mm for c in matching])
    assert np.abs(thin_matcher_mm(ends, length, r0) - [c.aperture_mm for c in matching]).max() < 1e-3   # printed so
    rows = rows_of("rfq_rms_profile.csv")
    z = np.array([10 * float(r["z[cm]"]) for r in rows])
    exact = equipotential_matcher_mm(z, 73.355461, 9.718)
    for row, mine, thin in zip(rows, exact, thin_matcher_mm(z, 73.355461, 9.718)):
        assert thin == pytest.approx(10 * float(row["a_thin[cm]"]), abs=1e-6)
        if row["a_exact[cm]"]:
            assert mine == pytest.approx(10 * float(row["a_exact[cm]"]), abs=1e-6)
        else:
            assert np.isnan(mine)


def test_the_transition_cell_is_as_long_as_the_tables():
    """PARMTEQM: 33.84 mm; the last a and m have four digits."""
    last = CELLS[55]
    assert transition_length_mm(last.aperture_mm, last.modulation, 9.718) == pytest.approx(33.84, rel=1e-3)


def test_cells_are_half_the_way_of_the_ion():
    """Within 3 %: the table gives the energy at a cell's end."""
    for cell in CELLS.values():
        assert half_wave_mm(cell.energy_mev, 2.0, 32.8) == pytest.approx(cell.length_mm, rel=0.03)


def test_ball_centres_agree_with_known_values():
    """The offset of the built tip, cell 45 of the y vane, tip radius 0.75 r0, ball radius 6 mm."""
    cell = two_term(45)
    line = TipLine(segments=(Segment(name="cell 45", start_mm=0.0, length_mm=cell.length_mm, radius_mm=7.286325,
                                     aperture_mm=lambda z: cell.tip_mm(z, -1), spans=16),),
                   from_mm=0.0, to_mm=cell.length_mm)
    tip = fitted_tip(line, 50.0, np.radians(2.0), 9.0)
    rows = rows_of("rfq_ball_cl_samples.csv")
    value = lambda name: np.array([float(r[name]) for r in rows])
    x, turn = value("z_L") * cell.length_mm, np.radians(value("alpha[deg]"))
    as_table = lambda v: np.column_stack([v[:, 1], -v[:, 2], v[:, 0]])      # beam at y = 0 there, at z = 50 here
    point, normal = tip.point_mm(x, turn), tip.normal(x, turn)
    center = as_table(point + 6.0 * normal) + [0.0, 50.0, 0.0]
    assert np.abs(center - np.column_stack([value(f"C{c}[mm]") for c in "xyz"])).max() < 1e-6
    assert np.abs(as_table(normal) - np.column_stack([value(f"n{c}") for c in "xyz"])).max() < 1e-7


def test_in_mid_cell_the_built_tip_is_the_cells_own():
    line = line_of(RfqVane())
    middles = np.array([s.start_mm + s.length_mm / 2 for s in line.segments[1:]])
    assert np.abs(line.aperture_mm(middles) - line.own_aperture_mm(middles)).max() < 1e-12
    bound, where = line.largest_blend()
    x = np.linspace(line.from_mm, line.to_mm, 20001)
    assert np.abs(line.aperture_mm(x) - line.own_aperture_mm(x)).max() <= bound + 1e-12
    assert bound < 0.11 and where == "cell 49"       # half of the step between cells 49 and 50, that differ most


def test_joints_are_smooth_to_the_second_derivative():
    line = line_of(RfqVane())
    joints, h = np.array([s.start_mm for s in line.segments[1:]]), 1e-3
    f = lambda k: line.aperture_mm(joints + k * h)
    assert np.abs(f(1e-6) - f(-1e-6)).max() < 1e-8
    bends = [(f(s * 2) - 2 * f(s * 1) + f(s * 1e-9)) / h ** 2 for s in (1, -1)]
    assert np.abs(bends[0] - bends[1]).max() < 1e-3     # of 0.03 per mm; third derivative times the step


def test_x_and_y_vanes_swap_their_roles_from_cell_to_cell():
    x, y = (line_of(RfqVane(vane=v)) for v in "xy")
    for segment in x.segments[3:20]:
        middle = segment.start_mm + segment.length_mm / 2 + 1e-9
        assert x.own_aperture_mm([middle]) == pytest.approx(y.own_aperture_mm([middle]), abs=1e-4)
    first = x.segments[1]
    assert x.own_aperture_mm([first.start_mm])[0] == pytest.approx(CELLS[5].aperture_mm, abs=1e-9)
    assert y.own_aperture_mm([first.start_mm])[0] == pytest.approx(CELLS[5].aperture_mm * CELLS[5].modulation, abs=1e-9)


# the eight-term law -----------------------------------------------------------------------------------


def test_fitted_multipoles_are_those_that_parmteqm_prints():
    """With tips of radius r0 its A01 and A10 come out for every cell, with 0.75 r0 they do not: the table's rho."""
    cells, off = list(CELLS.values()), {}
    for share in (0.75, 1.0):
        fits = [EightTerm.fitted(two_term(c.number), share * two_term(c.number).r0_mm).terms() for c in cells]
        off[share] = np.array([(f["A01"] / c.a01 - 1, f["A10"] / c.a10 - 1) for f, c in zip(fits, cells)])
    assert len(cells) == 51
    assert np.abs(off[1.0]).max(axis=0) == pytest.approx([0.0106, 0.0361], abs=1e-4)
    assert np.abs(off[0.75]).max(axis=0) == pytest.approx([0.0264, 0.1298], abs=1e-4)
    assert np.abs(off[0.75][:, 0]).min() > 0.01


@pytest.mark.parametrize("number", [10, 36, 50])
def test_the_eight_term_tip_lies_on_its_potential(number):
    two = two_term(number)
    cell = EightTerm.fitted(two, two.r0_mm)
    z = np.linspace(0.0, cell.length_mm, 33)
    tip, beside = cell.tip_mm(z, 1), cell.tip_mm(z, -1)
    assert np.abs(cell.potential(tip, 0 * z, z) - cell.level(z)).max() < 1e-12
    assert np.abs(cell.potential(0 * z, beside, z) + cell.level(cell.length_mm - z)).max() < 1e-12
    assert tip[[0, -1]] == pytest.approx([two.aperture_mm, two.aperture_mm * two.modulation], abs=1e-9)
    assert np.abs(cell.level(z) - 1.0).max() < 0.01
    assert 0 < np.abs(tip - two.tip_mm(z, 1)).max() < 0.02      # micrometres: arcs of one radius are nearly two-term


# the solid --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole():
    p = RfqVane()
    return line_of(p), design(p)


def test_the_brep_lies_on_the_analytic_tip(whole):
    """0.2 um over the whole length, against the blended exact roots, at random places of every tip face."""
    line, made = whole
    rng = np.random.default_rng(5)
    faces = [f for f in brep.faces_of(brep.the_solid(made.solid)) if f.kind == "bspline"]
    arcs = [f for f in faces if f.nurbs.degree_v == 2]
    assert len(arcs) == 10 and len(faces) == 30
    off = flank = 0.0
    for face in faces:
        u0, u1, v0, v1 = face.nurbs.domain
        u, v = rng.uniform(u0, u1, 3000), rng.uniform(v0, v1, 3000)
        x, y, z = face.shape_at(u, v).point_mm.T
        assert np.abs(x - u).max() < 1e-9
        r, R = line.aperture_mm(x), line.radius_mm(x)
        if face in arcs:
            off = max(off, np.abs(np.hypot(y, z - (100.0 - r - R)) - R).max())
        else:       # distance from the line that leaves the tangency at 10 degrees
            a = np.radians(10.0)
            flank = max(flank, np.abs(np.abs(y) * np.cos(a) + (z - (100.0 - r - R)) * np.sin(a) - R).max())
    assert off < 2e-4 and flank < 2e-4


def test_what_is_left_is_the_fit_of_the_spline(whole):
    """Far closer than asked: 0.0075 um of tip line, radius to rounding; 200 000 places are 7 um apart."""
    line, made = whole
    x = np.linspace(*made.guides[0].range_mm, 200_001)
    off = np.abs(made.guides[0].crest_z_mm(x) - (100.0 - line.aperture_mm(x))).max()
    assert off == pytest.approx(7.5e-6, abs=2e-7)
    assert np.abs(made.guides[0].radius_mm(x) - line.radius_mm(x)).max() < 1e-11


def test_sections_are_circles_to_rounding(whole):
    """Exact, not fitted: centre and radius are the spline's own."""
    _, made = whole
    face = next(f for f in brep.faces_of(brep.the_solid(made.solid)) if f.kind == "bspline" and f.nurbs.degree_v == 2)
    u0, u1, _, _ = face.nurbs.domain
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(u0, u1, 40), np.linspace(0, 1, 25)))
    x, y, z = face.shape_at(u, v).point_mm.T
    assert np.abs(np.hypot(y, z - made.guides[0].center_z_mm(x)) - made.guides[0].radius_mm(x)).max() < 1e-11


def test_the_tightest_hollow_is_proven_on_the_brep(whole):
    _, made = whole
    faces = brep.faces_of(brep.the_solid(made.solid))
    wanted = [k for k, f in enumerate(faces) if f.kind == "bspline"]
    hollow = tightest_hollow(faces, wanted)
    (crest, place), (side, _) = made.guides[0].tightest_hollows()
    assert hollow.proven_mm <= crest <= hollow.radius_mm * 1.01 and hollow.radius_mm == pytest.approx(crest, rel=0.01)
    assert hollow.place_mm[0] == pytest.approx(place[0], abs=1.0) and abs(hollow.place_mm[1]) < 0.5
    assert side > crest


def test_a_radius_that_follows_r0_is_built_too():
    p = RfqVane(rho_follows_r0=True, from_mm=950, to_mm=1020)
    line, made = line_of(p), design(p)
    x = np.linspace(*made.guides[0].range_mm, 2001)
    assert np.ptp(made.guides[0].radius_mm(x)) > 5e-4 and np.abs(made.guides[0].radius_mm(x) - line.radius_mm(x)).max() < 2e-4
    brep.the_solid(made.solid)


def test_the_quadrupole_leaves_the_beam_free(whole):
    p = RfqVane(from_mm=960, to_mm=1010)
    shape = assembly(p)
    low, high = brep.bounding_box_mm(shape)
    assert low == pytest.approx([-100, -100, 960], abs=1e-3) and high == pytest.approx([100, 100, 1010], abs=1e-3)
    solids = [brep.the_solid(s) for s in brep.explore(shape, TopAbs_SOLID)]
    boxes = [brep.bounding_box_mm(s) for s in solids]
    assert len(solids) == 4
    x = np.linspace(960, 1010, 4001)
    for vane, axis in (("x", 0), ("y", 1)):
        aperture = line_of(RfqVane(vane=vane)).aperture_mm(x).min()
        closest = min(b[0][axis] for b in boxes if b[0][axis] > 0)
        assert closest == pytest.approx(aperture, abs=2e-3)     # bounding boxes are a little wide


def test_the_small_vane_is_reckoned_from_its_parameters():
    p = RfqVane(preset="hydrogen_750")
    cells = table_of(p).of_kind("accelerating")
    assert len(cells) == 40 and p.rho_mm == 1.439
    assert cells[0].length_mm == pytest.approx(half_wave_mm(0.020, 1.007276, 749.48), rel=1e-12)
    r0 = [TwoTerm(aperture_mm=c.aperture_mm, modulation=c.modulation, length_mm=c.length_mm).r0_mm for c in cells]
    assert np.abs(np.array(r0) - 1.439).max() < 1e-9
    assert all(b.energy_mev > a.energy_mev for a, b in zip(cells[1:], cells[2:]))
    assert RfqVane(preset="hydrogen_750", rho_mm=1.2).rho_mm == 1.2
    brep.the_solid(design(p).solid)


def test_a_shop_without_a_ball_for_the_valley_is_told_the_cell():
    made = design(RfqVane(preset="hydrogen_750", from_mm=50, to_mm=55))
    machine, library = catalogue.find_machine(made.machine), catalogue.find_library(None)
    large = library.model_copy(update={"tools": tuple(t for t in library.tools if t.cutter.diameter_mm > 5)})
    with pytest.raises(CutterDoesNotFit, match=r"^cell 4\d: no ball of the library"):
        plan_setup(made, made.setups[0], machine, large)


def test_planes_are_as_far_apart_as_the_cusp_allows_however_long_the_vane(whole):
    """Curvature is sampled 3 to 5 mm apart on a long face; between samples the step is theirs, not the vane's least."""
    _, made = whole
    faces = brep.faces_of(brep.the_solid(made.solid))
    samples = sample_faces(faces, [k for k, f in enumerate(faces) if f.kind == "bspline"], 0)
    step_at = _plane_step(SimpleNamespace(samples=samples, plane=SectionPlane.named("YZ")), 8.0, 0.004)
    flat = 2 * np.sqrt(2 * 8.0 * 0.004)     # 0.506 mm
    straight = step_at(1285.0, 1285.5)      # the last cell's tip is level
    assert straight == pytest.approx(flat, rel=1e-3)
    places = np.arange(110.0, 1300.0, 7.3)
    steps = np.array([step_at(x, x + 0.4) for x in places])
    assert steps.min() > 0.4 and steps.max() <= flat * 1.0001
    assert step_at(20.0, 20.2) < 0.2        # steep at the matching section's opening
