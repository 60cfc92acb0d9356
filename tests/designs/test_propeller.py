"""Propellers: the table on the solid, the family, refusals that are true, files that others can read."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from scipy.interpolate import BSpline

from cuspline.app import build, catalogue
from cuspline.designs import propeller
from cuspline.designs.propeller import Propeller
from cuspline.designs.propellers import blade, root, tables
from cuspline.designs.propellers.blade import blade_of, loop_angles, radial_laws
from cuspline.designs.propellers.checks import (
    _nearest_on_blade_mm,
    blade_figures,
    definition_deviation_mm,
    fillet_figures,
    section_on_solid,
    solid_report,
    table_points,
)
from cuspline.designs.propellers.design import FILLETS, blade_over
from cuspline.designs.propellers.mesh import extrapolated_volume_mm3, propeller_mesh
from cuspline.designs.propellers.root import (
    balls_round_root,
    curved_hub,
    fitting,
    obstacle,
    radius_round_root,
    rolled_round_root,
    straight_hub,
)
from cuspline.designs.propellers.sections import (
    DATA,
    TrailingEdge,
    form_and_mean_line,
    loop_angle,
    naca66_a08,
    section_loop,
)
from cuspline.designs.propellers.solid import HubCuts, _tools, propeller_solid, volume_of_cuts_mm3
from cuspline.kernel import brep
from cuspline.kernel.shells import ShellBuilder, Side, plane_across_x, plane_curve, spline_curve
from cuspline.kernel.solids import solid_of
from cuspline.splines.nurbs import local_shape
from cuspline.surfaces.folds import folds_of
from cuspline.surfaces.rolling_ball import envelope_room, fillet_of, rolled
from cuspline.surfaces.trims import TrimSet
from cuspline.values.errors import DesignError, InputError


def own_screw(*main, hub_ratio=0.2, **form):
    """By MainDimensions one after the other, and what else a BladeForm says."""
    return tables.own_propeller(tables.MainDimensions(*main), hub_ratio, tables.BladeForm(**form))


def b_screw(*main, **more):
    return tables.b_series(tables.MainDimensions(*main), **more)


def made_of(table, hub_ratio=0.2, radii=(4.0, 8.0, 4.0, 8.0), cuts=HubCuts(), length=0.46):
    size = table.diameter_mm
    hub = straight_hub(-length * size / 2, length * size / 2, hub_ratio * size / 2)
    return propeller_solid(blade_over(table, hub), hub, radius_round_root(*(r * size / 300 for r in radii)), cuts)


@pytest.fixture(scope="module")
def dtmb():
    return made_of(tables.dtmb_4119(), radii=(3.0, 8.0, 4.0, 12.0), cuts=HubCuts(bore_mm=25.4, key_width_mm=6.0,
                                                                              key_depth_mm=3.0))


@pytest.fixture(scope="module")
def dtmb_file(dtmb, tmp_path_factory):
    path = tmp_path_factory.mktemp("propeller") / "dtmb.step"
    brep.write_step(dtmb.solid, path, "dtmb")
    return path


@pytest.fixture(scope="module")
def dtmb_read(dtmb_file):
    return brep.the_solid(brep.read_step(dtmb_file))


@pytest.fixture(scope="module")
def dtmb_whole_mm3(dtmb):
    """Volume of the solid before its hub is cut."""
    return extrapolated_volume_mm3(dtmb)


# DTMB 4119 -----------------------------------------------------------------------------------------------


def test_dtmb_4119_keeps_every_figure_as_read_back_from_its_file(dtmb, dtmb_read):
    """Points of the table within 2 µm at all radii, area ratio, pitch, thickness, fillet, volume, mesh."""
    report = solid_report(dtmb, dtmb_read, 7.6)
    print({f.what: f.measured for f in report.figures})
    assert [f for f in report.figures if not f.is_kept] == []
    points = [f for f in report.figures if f.what.startswith("table points")]
    assert len(points) >= 9 and all(f.measured <= 0.002 for f in points)
    assert 0.604 <= report.facts["expanded_area_ratio"] <= 0.607
    assert sum(f.what.startswith("fillets, ") and f.measured <= 1e-3 for f in report.figures) >= 5
    assert report.facts["centre_mm"][1] == pytest.approx(0, abs=1e-3)
    inertia = np.array(report.facts["inertia_kg_mm2"])
    assert inertia[0, 0] > 1.2 * inertia[1, 1] and inertia[1, 1] == pytest.approx(inertia[2, 2], rel=2e-3)


def test_a_solid_of_another_thickness_is_told(dtmb, dtmb_read):
    table = tables.dtmb_4119()
    thicker = replace(table, thickness_D=table.thickness_D * 1.002)
    other = replace(dtmb, blade=blade_over(thicker, dtmb.hub))
    figures, _, _ = blade_figures(other, brep.faces_of(dtmb_read))
    broken = [f.what for f in figures if not f.is_kept]
    assert any(w.startswith("table points on the solid") for w in broken) and any("thickness" in w for w in broken)
    assert any("random points" in w for w in broken)


def test_a_bevel_of_the_trailing_edge_does_not_change_the_pitch():
    made = made_of(tables.dtmb_4119(edge=TrailingEdge(kind="anti-singing")))
    figures, _, _ = blade_figures(made, brep.faces_of(made.solid))
    assert [f for f in figures if not f.is_kept] == [] and any(f.what.startswith("pitch") for f in figures)


def test_every_face_has_its_name(dtmb):
    names = [f.mark.name for f in brep.faces_of(dtmb.solid)]
    for k in (1, 2, 3):
        assert [names.count(f"blade {k} {part}")
                for part in ("face", "back", "leading edge", "trailing edge", "tip")] == [1, 1, 1, 1, 4]
        assert names.count(f"fillet {k}") == 4
    assert names.count("hub") == 3 and names.count("bore") >= 1 and names.count("keyway") == 3
    assert names.count("hub fore end") == names.count("hub aft end") == 1


def test_the_back_looks_upstream_and_the_leading_edge_leads(dtmb):
    faces = {f.mark.name: f for f in brep.faces_of(dtmb.solid)}
    assert faces["blade 1 back"].middle.normal[0, 0] < -0.5 and faces["blade 1 face"].middle.normal[0, 0] > 0.5
    # right-handed: seen from aft, z up, y to the right, it turns clockwise: blade 1 moves towards +y
    leading, trailing = (faces[f"blade 1 {edge} edge"].middle.point_mm[0, 1] for edge in ("leading", "trailing"))
    assert leading > 10 > trailing


def entities(text):
    return {int(k): body for k, body in re.findall(r"#(\d+)=(.*?);(?=#|ENDSEC)", re.sub(r"\s+", "", text))}


def test_the_step_file_holds_the_blade_for_a_reader_that_is_not_the_kernel(dtmb, dtmb_file):
    """Parsed as text, evaluated by scipy, compared with the definition."""
    found = entities(dtmb_file.read_text().split("DATA;")[1])
    face = next(b for b in found.values() if b.startswith("ADVANCED_FACE('blade1back'"))
    spline = found[int(re.findall(r"#(\d+)", face)[-1])]
    head, poles, tail = re.match(r"B_SPLINE_SURFACE_WITH_KNOTS\('',(\d+,\d+),\((\(.*?\))\),(\..*)\)$", spline).groups()
    ku, kv = map(int, head.split(","))
    coordinates = lambda k: [float(x) for x in re.search(r"\(([^()]*)\)\)$", found[k])[1].split(",")]
    grid = np.array([[coordinates(int(k)) for k in re.findall(r"#(\d+)", row)] for row in re.findall(
        r"\(([^()]*)\)", poles)])
    mu, mv, tu, tv = (np.array([float(x) for x in row.split(",")]) for row in re.findall(r"\(([^()]*)\)", tail))
    tu, tv = np.repeat(tu, mu.astype(int)), np.repeat(tv, mv.astype(int))
    u, v = np.random.default_rng(7).uniform((0.4, 0.3), (2.7, 0.8), (300, 2)).T
    bu, bv = (BSpline.design_matrix(x, t, k).toarray() for x, t, k in ((u, tu, ku), (v, tv, kv)))
    places = np.einsum("ni,nj,ijc->nc", bu, bv, grid)
    wanted = dtmb.blade.points_mm(u, dtmb.blade.rho_at(v))
    assert np.linalg.norm(places - wanted, axis=1).max() < 5e-4


def test_the_mesh_is_closed_and_its_error_is_of_second_order(dtmb, dtmb_whole_mm3):
    mesh = propeller_mesh(dtmb, 0.02)
    assert mesh.deviation_mm <= 0.02
    assert solid_of(mesh.vertices_mm, mesh.triangles).volume() == pytest.approx(dtmb_whole_mm3, rel=1e-4)
    assert brep.volume_mm3(dtmb.solid) == pytest.approx(dtmb_whole_mm3 - volume_of_cuts_mm3(dtmb.hub, dtmb.cuts),
                                                        rel=1e-5)


@pytest.mark.parametrize("deviation_mm", [0.013, 0.005, 0.0021])
def test_a_mesh_gets_finer_till_it_is_as_near_as_was_asked(dtmb, deviation_mm):
    """In the middle of a cell what it bulges along both its sides adds up: each small enough alone is not enough."""
    assert propeller_mesh(dtmb, deviation_mm).deviation_mm <= deviation_mm


# sections ------------------------------------------------------------------------------------------------


def curvature_along(shape, edge, sigma, thickness=0.1, camber=0.02):
    s, n = section_loop(shape, edge, sigma, np.full(len(sigma), 0.5), np.full(len(sigma), thickness),
                        np.full(len(sigma), camber))
    d = lambda a: np.gradient(a, sigma, edge_order=2)
    return (d(s) * d(d(n)) - d(n) * d(d(s))) / np.hypot(d(s), d(n)) ** 3


def extremes(values, least):
    """Turns of a curve that rise or fall by more than `least`."""
    kept, direction, turns = values[0], 0, 0
    for value in values:
        if direction >= 0 and value < kept - least or direction <= 0 and value > kept + least:
            turns += direction != 0
            direction, kept = (-1 if value < kept else 1), value
        elif (value - kept) * direction > 0:
            kept = value
    return turns


def test_the_nose_has_the_tabulated_radius():
    sigma = np.linspace(-0.02, 0.02, 401)
    for thickness in (0.2, 0.05):
        curvature = abs(curvature_along(naca66_a08(), TrailingEdge(), sigma, thickness, 0.0)[200])
        assert 1 / curvature == pytest.approx(0.448 * thickness ** 2, rel=1e-3)


def test_curvature_does_not_ripple_along_a_section():
    """Between the edges it turns by less than 8 % of its range; what turns there are, the table's four figures make."""
    sigma = np.linspace(0.5, 2.55, 3001)
    curvature = curvature_along(naca66_a08(), TrailingEdge(), sigma, camber=0.0)
    assert extremes(curvature, 0.08 * np.ptp(curvature)) == 0 and extremes(curvature, 0.04 * np.ptp(curvature)) <= 2
    # a spline through the rounded ordinates ripples more
    x, half, camber, slope = naca66_a08().ordinates
    stiff = curvature_along(form_and_mean_line(x, half, camber, slope, 0.448, rounding=0.0), TrailingEdge(), sigma,
                            camber=0.0)
    roughness = lambda c: np.abs(np.diff(c, 2)).sum()
    assert roughness(curvature) < 0.75 * roughness(stiff)


def test_radial_laws_do_not_ripple():
    laws, rho = radial_laws(tables.dtmb_4119(), 0.19), np.linspace(0.2, 1.0, 2001)
    for law in (laws.chord, laws.pitch, laws.thickness):
        second = law.derivative(2)(rho)
        assert extremes(second, 0.1 * np.ptp(second)) <= 4


@pytest.mark.parametrize("kind", ["round", "square", "anti-singing"])
def test_the_trailing_edge_ends_as_asked(kind):
    """Thickness 0.0666 of the greatest by the table, measured where the rounding has ended; and the end's own shape."""
    shape, edge, thickness = naca66_a08(), TrailingEdge(kind=kind), 0.1
    tail = 0.0666 * thickness / 2
    sigma = np.pi - np.linspace(0.0, 0.9, 40001)
    back, face = (section_loop(shape, edge, s * sigma, np.full(len(sigma), 0.5), np.full(len(sigma), thickness),
                               np.zeros(len(sigma))) for s in (1, -1))
    apart = back[1] - face[1]
    if kind == "anti-singing":
        row = np.argmin(np.abs(1 - back[0] - 3 * tail))
        assert apart[row] < 0.85 * 2 * thickness * shape.half(2 * np.arcsin(np.sqrt(back[0][row:row + 1])), 0.5)[0]
        assert np.abs(face[1][row] + apart[row] / 2) > 0            # the bevel is on the back alone
        assert -face[1][row] == pytest.approx(thickness * shape.half(2 * np.arcsin(np.sqrt(face[0][row:row + 1])),
                                                                     0.5)[0], rel=1e-3)
        return
    row = np.argmin(np.abs(1 - back[0] - 3 * tail))
    assert apart[row] == pytest.approx(2 * thickness * shape.half(2 * np.arcsin(np.sqrt(back[0][row:row + 1])),
                                                                  0.5)[0], rel=1e-3)
    half_way = back[1][np.argmin(np.abs(1 - back[0] - 0.1 * tail))] / tail
    assert half_way > 0.6 if kind == "square" else half_way == pytest.approx(np.sqrt(1 - 0.9 ** 2), abs=0.03)


def test_a_square_end_and_the_loop_angles_go_together():
    for kind in ("round", "square"):
        angles = loop_angles(naca66_a08(), TrailingEdge(kind=kind), 1.0)
        assert (np.diff(angles) > 1e-3).all() and angles[-1] < angles[0] + 2 * np.pi


# the family ----------------------------------------------------------------------------------------------


def assert_sound(made):
    """The gates of every solid; `propeller_solid` itself refuses what BRepCheck or tolerances speak against: its volume."""
    assert brep.loosest_tolerance_mm(made.solid) <= 1e-3
    volume_mm3 = brep.volume_mm3(made.solid)
    assert volume_mm3 == pytest.approx(extrapolated_volume_mm3(made), rel=1e-5)
    assert definition_deviation_mm(made) <= 0.002
    assert [f for f in fillet_figures(made, brep.faces_of(made.solid)) if not f.is_kept] == []


def summed_mm3(solid):
    """Volume by the kernel's plain sums: not the true one, but the same of the same faces."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid, properties)
    return properties.Mass()


def assert_sound_as_read_back(made, path):
    """What comes back from a STEP file is the same solid of the same volume, whose blade keeps its table."""
    brep.write_step(made.solid, path, "propeller")
    read = brep.the_solid(brep.read_step(path))
    faces = brep.faces_of(read)
    assert len(TrimSet.of_faces(faces).face) == len(brep.faces_of(made.solid))
    assert summed_mm3(read) == pytest.approx(summed_mm3(made.solid), rel=1e-9)
    assert [f for f in blade_figures(made, faces)[0] if not f.is_kept] == []


@pytest.mark.parametrize("make, ratio, radii", [
    (lambda: b_screw(4, 0.55, 1.0, 250.0), 0.167, (2.0, 8.0, 2.0, 8.0)),
    (lambda: b_screw(5, 0.75, 0.8, 1000.0, False, edge=TrailingEdge(kind="square")), 0.167,
     (4.0, 2.0, 4.0, 8.0)),
    (lambda: own_screw(5, 0.7, 1.1, 300.0, skew_deg=72.0, edge=TrailingEdge(kind="anti-singing")), 0.2,
     (4.0, 4.0, 4.0, 4.0)),
    (lambda: own_screw(6, 0.7, 0.8, 100.0, skew_deg=36.0), 0.2, (2.0, 8.0, 2.0, 8.0)),
    (lambda: b_screw(7, 0.85, 1.4, 1000.0), 0.18, (3.0, 6.0, 3.0, 6.0))],
    ids=["B4-55", "B5-75 left-handed square", "5 blades skew 72 anti-singing", "6 blades skew 36, 100 mm",
         "B7-85, 1 m"])
def test_the_family_is_sound(make, ratio, radii, tmp_path):
    made = made_of(make(), ratio, radii)
    assert_sound(made)
    assert_sound_as_read_back(made, tmp_path / "propeller.step")


@pytest.mark.parametrize("blades, area", [(4, 0.55), (5, 0.75), (3, 0.5), (7, 0.85)])
def test_b_screws_have_the_area_of_their_name(blades, area):
    """The tip, where the table leaves the outline open, too."""
    ratio = tables.expanded_area_ratio(b_screw(blades, area, 1.0, 250.0), 0.167)
    assert ratio == pytest.approx(area, rel=0.01)


def test_a_left_handed_propeller_is_the_mirror_image():
    right, left = (blade_of(tables.dtmb_4119(is_right_handed=hand), 0.19) for hand in (True, False))
    u, v = np.random.default_rng(2).uniform((-2.8, 0.0), (3.3, 1.0), (200, 2)).T
    a, b = (blade.surface.derivatives(u, v)[:, 0] for blade in (right, left))
    assert np.abs(a * [1, -1, 1] - b).max() < 1e-9


def test_skew_brings_its_rake_with_it():
    """The generator line moves along the helix of the nose-tail line: x by skew times pitch / 2 pi."""
    plain, skewed = (own_screw(5, 0.7, 1.1, 300.0, skew_deg=s) for s in (0.0, 36.0))
    a, b = (blade_of(t, 0.19) for t in (plain, skewed))
    rho = np.array([0.9])
    skew = b.laws.skew(rho)[0]
    assert skew == pytest.approx(np.radians(36.0) * (0.7 / 0.8) ** 2, rel=1e-6)
    move = (b.points_mm(np.array([0.0]), rho) - a.points_mm(np.array([0.0]), rho))[0]
    assert move[0] == pytest.approx(skew * 1.1 * 300 / (2 * np.pi), rel=1e-9) and move[0] > 0


def test_offsets_measured_from_a_propeller_give_it_back(tmp_path):
    """Reverse engineering: face and back of DTMB 4119 as plain offsets."""
    table = tables.dtmb_4119()
    columns = ["r_R,c_D,P_D,skew_deg,rake_D,f0_c"] + [f"{r},{c},{p},0,0,0" for r, c, p in zip(
        table.r_R, table.chord_D, table.pitch_D)]
    (tmp_path / "radii.csv").write_text("\n".join(columns))
    x = (1 - np.cos(np.linspace(0, np.pi, 40))) / 2
    rows, sigma = ["r_R,x_c,face_c,back_c"], np.linspace(0.0, np.pi - 1e-9, 4001)
    laws = radial_laws(table, 0.2)
    for rho in table.r_R[:-1]:
        at = np.full(len(sigma), rho)
        sides = [section_loop(table.shape, table.edge, s * sigma, at, laws.thickness_share(at), laws.camber_share(at))
                 for s in (-1, 1)]
        low, high = (np.interp(x, s, n) for s, n in sides)
        low[-1], high[-1] = np.array([-1, 1]) * 0.0333 * laws.thickness_share(np.array([rho]))
        rows += [f"{rho},{a},{b},{c}" for a, b, c in zip(x, low, high)]
    (tmp_path / "offsets.csv").write_text("\n".join(rows))
    again = tables.from_files(tmp_path / "radii.csv", table.diameter_mm, 3, offsets_csv=tmp_path / "offsets.csv")
    a, b = (blade_of(t, 0.2) for t in (table, again))
    u, rho = np.repeat([-2.0, -1.2, 1.2, 2.0], 5), np.tile([0.3, 0.45, 0.6, 0.75, 0.9], 4)
    d = a.surface.derivatives(u, a.v_at(rho))
    off = np.einsum("ij,ij->i", b.points_mm(u, rho) - d[:, 0], local_shape(d).normal)
    assert np.abs(off).max() < 0.05           # chordwise shift of stations and offsets to four figures


# sections of one's own -----------------------------------------------------------------------------------

NACA66 = DATA / "propeller_naca66mod_a08.csv"


def own_sections(tmp_path, change=lambda text: text, name="sections.csv"):
    text = "".join(line for line in NACA66.read_text().splitlines(keepends=True) if not line.startswith("#"))
    (tmp_path / name).write_text(change(text))
    return tmp_path / name


def loop_points(made, radii=(0.3, 0.7, 0.95)):
    """(n, 2) points of sections of a PropellerTable, mm, at radii all round."""
    sigma = np.linspace(-np.pi, np.pi, 301)
    found = []
    for rho in radii:
        thickness, camber = (np.interp(rho, made.r_R, v) for v in (made.thickness_D / np.maximum(made.chord_D, 1e-9),
                                                                   made.camber_c))
        xy = section_loop(made.shape, made.edge, sigma, np.full(301, rho), np.full(301, thickness), np.full(301, camber))
        found.append(np.column_stack(xy) * np.interp(rho, made.r_R, made.chord_D) * made.diameter_mm)
    return np.vstack(found)


def test_the_built_in_sections_given_as_a_file_give_dtmb_4119(tmp_path):
    radii = DATA / "propeller_dtmb4119.csv"
    own = tables.from_files(radii, 304.8, 3, sections_csv=own_sections(tmp_path))
    known = tables.dtmb_4119()
    assert np.abs(loop_points(own) - loop_points(known)).max() < 1e-9
    bare = own_sections(tmp_path, lambda text: "\n".join(",".join(row.split(",")[:3]) for row in text.splitlines()), "bare.csv")
    bare = tables.from_files(radii, 304.8, 3, sections_csv=bare)
    off = np.abs(loop_points(bare) - loop_points(known)).max()
    assert 1e-6 < off < 0.1                     # mm of 100 mm chord: neither slopes nor the nose's radius were told


def test_another_thickness_form_makes_another_blade(tmp_path):
    """An elliptic nose of four times the radius, by the parameter that the command line takes."""
    def rounder(text):
        rows = [row.split(",") for row in text.splitlines()]
        for row in rows[2:12]:
            row[1] = f"{min(0.5, 1.5 * float(row[1])):.4f}"
        rows[1][4] = f"{0.448 * 2.25:.4f}"
        return "\n".join(map(",".join, rows))

    path = own_sections(tmp_path, rounder)
    p = Propeller(sections_csv=str(path), blades=4, skew_deg=0.0)
    assert p.sections_csv and not p.offsets_csv
    own = own_screw(4, 0.7, 1.1, 300.0, sections_csv=path)
    known = own_screw(4, 0.7, 1.1, 300.0)
    assert np.ptp(loop_points(own)[:, 1]) > np.ptp(loop_points(known)[:, 1]) - 0.1
    assert np.abs(loop_points(own) - loop_points(known)).max() > 0.5
    with pytest.raises(ValueError, match="both say what sections look like"):
        Propeller(sections_csv="a.csv", offsets_csv="b.csv", radii_csv="c.csv")


@pytest.mark.parametrize("change, wanted", [
    (lambda t: t.replace("half_thickness_t0", "thickness"), "no column half_thickness_t0"),
    (lambda t: t.replace("\n0.1,0.2907,", "\n0.1,,"), "row 8: half_thickness_t0 is empty"),
    (lambda t: t.replace("\n0.1,", "\n0.06,"), "row 8: x_c 0.06: stations must rise"),
    (lambda t: t.replace("\n1,0.0333", "\n1,0"), "row 26: half_thickness_t0 0: it is 0 at the nose and above 0"),
    (lambda t: t.replace("\n0.45,0.5,", "\n0.45,1.0,"), "row 15: half_thickness_t0 1 is the greatest, it must be 0.5"),
    (lambda t: t.replace("0.9992991001", "9.9992991001"), "row 16: camber_f0 9.9993 is the greatest, it must be 1"),
    (lambda t: t.replace("0,0,0,,", "0,0,0.1,,"), "row 1: camber_f0 must be 0 at both ends"),
    (lambda t: t.replace("-0.8844771306", "-88.44771306"), "row 19: camber_slope_f0"),
    (lambda t: t.replace("0.448", "-0.448"), "row 1: nose_radius -0.448 must be above 0")])
def test_sections_that_cannot_be_meant_are_refused_with_their_row(change, wanted, tmp_path):
    with pytest.raises(DesignError, match=re.escape(wanted)):
        own_screw(4, 0.7, 1.1, 300.0, sections_csv=own_sections(tmp_path, change))


def test_a_tip_with_a_chord_is_closed_on_its_cylinder():
    table = tables.dtmb_4119()
    chord = table.chord_D.copy()
    chord[-1] = 0.15
    made = made_of(replace(table, chord_D=chord, thickness_D=np.r_[table.thickness_D[:-1], 0.006]))
    tips = [f for f in brep.faces_of(made.solid) if f.mark.name == "blade 1 tip"]
    assert [f.kind for f in tips] == ["cylinder"]
    mesh = propeller_mesh(made, 0.1)
    assert solid_of(mesh.vertices_mm, mesh.triangles).volume() == pytest.approx(mesh.volume_mm3, rel=1e-9)
    assert_sound(made)


def test_a_curved_hub_with_taper_bore_and_bolts():
    table = tables.dtmb_4119()
    x = np.linspace(-70, 70, 9)
    hub = curved_hub(x, 0.1 * table.diameter_mm - 6 * (x / 70) ** 2)
    cuts = HubCuts(bore_mm=18.0, bore_half_angle_rad=0.03, bolts=6, bolt_mm=3.0, bolt_circle_mm=38.0)
    made = propeller_solid(blade_over(table, hub), hub, radius_round_root(4, 8, 4, 8), cuts)
    assert brep.volume_mm3(made.solid) == pytest.approx(
        extrapolated_volume_mm3(made) - volume_of_cuts_mm3(hub, cuts), rel=1e-5)
    assert [f.mark.name for f in brep.faces_of(made.solid)].count("bolt hole") == 6


# refusals ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make, length, radii, wanted", [
    (lambda: tables.dtmb_4119(), 0.33, (4.0, 8.0, 12.0, 8.0), "hub's aft end"),
    (lambda: tables.dtmb_4119(), 0.33, (12.0, 8.0, 4.0, 8.0), "hub's fore end"),
    (lambda: own_screw(7, 0.8, 1.1, 300.0), 0.46, (4.0, 12.0, 4.0, 12.0), "next blade")],
    ids=["aft end", "fore end", "neighbour"])
def test_a_radius_that_does_not_fit_is_named_with_the_one_that_does(make, length, radii, wanted):
    table = make()
    with pytest.raises(DesignError) as told:
        made_of(table, radii=radii, length=length)
    message = str(told.value)
    assert "blade 1" in message and wanted in message and ("edge" in message or "% of the chord" in message), message
    asked, fits = (float(re.search(pattern, message)[1]) for pattern in (r"radius ([\d.]+) mm",
                                                                         r"fits there is ([\d.]+) mm"))
    assert 0.1 * asked < fits < asked
    size = table.diameter_mm
    hub = straight_hub(-length * size / 2, length * size / 2, 0.1 * size)
    blade, law = blade_over(table, hub), radius_round_root(*(r * size / 300 for r in radii))
    u = balls_round_root(blade)
    for share, is_fitting in ((0.995 * fits / asked, True), (1.02 * fits / asked, False)):
        rolling = rolled(blade.surface, 1.0, hub, law.scaled(share), u, (0.0, 0.6))
        assert (obstacle(blade, hub, rolling) is None) is is_fitting


def five_blades(hand, trailing_edge_mm):
    """Blade, hub and law of a five-bladed B-screw of 250 mm; above 3.37 mm no ball rolls round its trailing edge."""
    table = b_screw(5, 0.75, 1.0, 250.0, hand)
    hub = straight_hub(-55.0, 45.0, 0.167 * 125.0)
    return blade_over(table, hub), hub, radius_round_root(4.0, 8.0, trailing_edge_mm, 8.0)


@pytest.mark.parametrize("hand", [True, False], ids=["right", "left"])
def test_a_ball_that_turns_tighter_than_its_radius_is_refused_with_the_largest_that_does_not(hand):
    with pytest.raises(DesignError, match="at the trailing edge.*its surface turns over") as told:
        rolled_round_root(*five_blades(hand, 4.0))
    fits = float(re.search(r"or ([\d.]+) mm at the trailing edge alone", str(told.value))[1])
    assert 3.2 < fits < 3.5
    blade, hub, law = five_blades(hand, fits)
    room = envelope_room(rolled_round_root(blade, hub, law), 2 * np.pi)
    assert 0 < room.min() < 0.01                        # hardly any is left: the next larger one is refused
    with pytest.raises(DesignError, match="turns over"):
        rolled_round_root(*five_blades(hand, fits + 0.05))


def test_a_radius_left_to_the_design_is_as_large_as_fits_and_the_others_stay():
    blade, hub, law = five_blades(True, 4.0)
    assert np.array_equal(fitting(blade, hub, five_blades(True, 2.0)[2]).radius_mm, (2.0, 8.0, 4.0, 8.0))
    found = fitting(blade, hub, law)
    assert 0.9 * 3.37 < found.radius_mm[0] < 3.37 and found.radius_mm[1:].tolist() == [8.0, 4.0, 8.0]
    rolled_round_root(blade, hub, found)


def test_only_fillets_of_which_none_was_stated_give_way():
    small = {"diameter_mm": 60.0}
    made = propeller.design(Propeller(**small))
    radii = {name: getattr(made.parameters, name) for name in FILLETS}
    assert radii["fillet_trailing_edge_mm"] < 2.0 and radii["fillet_face_mm"] == 2 * radii["fillet_trailing_edge_mm"]
    with pytest.raises(DesignError, match="the largest radius that fits there"):
        propeller.design(Propeller(fillet_face_mm=8.0, **small))


@pytest.mark.parametrize("hand, trailing_edge_mm", [(True, 4.0), (False, 3.5)], ids=["right", "left, hardly"])
def test_an_overturned_fillet_is_found_on_the_solid_as_read_back(hand, trailing_edge_mm, tmp_path, monkeypatch):
    """Built in spite of the refusal: faces' normals, figures of the fillet and the general check all tell."""
    monkeypatch.setattr(root, "obstacle", lambda *_: None)
    made = propeller_solid(*five_blades(hand, trailing_edge_mm))
    brep.write_step(made.solid, tmp_path / "bad.step", "bad")
    read = brep.the_solid(brep.read_step(tmp_path / "bad.step"))      # BRepCheck finds nothing wrong
    faces = brep.faces_of(read)
    assert {f.mark.name for f in faces if len(folds_of(f))} == {f"fillet {k}" for k in range(1, 6)}
    figures = {f.what: f for f in fillet_figures(made, faces)}
    turned = figures["fillets, normal against the way to the ball's centre"]
    assert not turned.is_kept and turned.measured > 90


def test_room_of_the_envelope_is_what_the_fillets_own_surface_says():
    """An even ball: Su x Sv over Sv and the motion of the ball's centre, least over the arc."""
    blade, hub, _ = five_blades(True, 3.0)
    rolling = rolled_round_root(blade, hub, radius_round_root(3.0, 3.0, 3.0, 3.0))
    fillet, across = fillet_of(rolling, 2 * np.pi), np.linspace(0.0, 1.0, 65)
    d = fillet.surface.derivatives(np.repeat(rolling.u, 65), np.tile(across, len(rolling.u)))
    square = np.linalg.norm(np.cross(d[:, 1], d[:, 2]), axis=1) / np.linalg.norm(d[:, 2], axis=1)
    own = (square.reshape(-1, 65) / np.linalg.norm(rolling.motion_mm, axis=1)[:, None]).min(axis=1)
    room = envelope_room(rolling, 2 * np.pi)
    assert room == pytest.approx(own, abs=4e-3)         # C'' by a spline through the balls' motions
    assert room.min() == pytest.approx(own.min(), abs=1e-3)


def test_roots_that_collide_without_any_fillet_are_refused():
    with pytest.raises(DesignError, match="no radius fits|too little of the hub"):
        made_of(own_screw(9, 1.2, 1.1, 300.0, hub_ratio=0.13, thickness_scale=2.0), 0.13, (1.0, 1.0, 1.0, 1.0))


def test_a_hollow_of_the_hub_that_is_tighter_than_the_ball_is_refused():
    table, x = tables.dtmb_4119(), np.linspace(-80, 80, 161)
    hub = curved_hub(x, 30.0 - 4.0 * np.exp(-((x - 48) / 4) ** 2))
    with pytest.raises(DesignError, match="concave profile of the hub"):
        rolled_round_root(blade_over(table, hub), hub, radius_round_root(8, 8, 8, 8))


@pytest.mark.parametrize("text, wanted", [
    ("r_R,c_D,P_D,skew_deg\n0.2,0.3,1.1,0\n1,0,1,0\n", "rake_D"),
    ("r_R,c_D,P_D,skew_deg,rake_D,t0_D,f0_c\n0.2,0.3,x,0,0,0.06,0\n1,0,1,0,0,0,0\n", "'x' is no number"),
    ("r_R,c_D,P_D,skew_deg,rake_D,t0_D,f0_c\n0.2,0.3,1,0,0,0.06,0\n0.9,0.2,1,0,0,0.01,0\n", "end at 1")],
    ids=["column", "number", "tip"])
def test_a_wrong_table_is_refused_by_name(text, wanted, tmp_path):
    (tmp_path / "mine.csv").write_text(text)
    with pytest.raises(DesignError, match=wanted):
        tables.from_files(tmp_path / "mine.csv", 300.0, 3)


# five blades, 36 degrees of skew, thick at the root, in shares to three and four figures
SKEWED = """r_R,c_D,P_D,skew_deg,rake_D,t0_D,f0_c
0.2,0.174,1.455,0.0,0,0.0434,0.0430
0.25,0.202,1.444,2.328,0,0.0396,0.0395
0.3,0.229,1.433,4.655,0,0.0358,0.0370
0.4,0.275,1.412,9.363,0,0.0294,0.0344
0.5,0.312,1.361,13.948,0,0.0240,0.0305
0.6,0.337,1.285,18.378,0,0.0191,0.0247
0.7,0.347,1.200,22.747,0,0.0146,0.0199
0.8,0.334,1.112,27.145,0,0.0105,0.0161
0.9,0.280,1.027,31.575,0,0.0067,0.0134
0.95,0.210,0.985,33.788,0,0.0048,0.0140
1.0,0,0.942,,0,0,0.0134
"""


def changed(column, change):
    """The table with one column's fields changed by a function of row and value."""
    head, *rows = (line.split(",") for line in SKEWED.strip().splitlines())
    k = head.index(column)
    for n, row in enumerate(rows, 1):
        row[k] = row[k] and str(change(n, float(row[k])))
    return "\n".join(",".join(row) for row in [head, *rows]) + "\n"


def only(row, value):
    return lambda n, x: value if n == row else x


@pytest.mark.parametrize("column, change, wanted", [
    ("c_D", lambda n, x: 300 * x, "row 7, r/R = 0.7: c_D 104.1 is no chord over diameter.*millimetres .divide by the "
                                  "diameter, 300 mm"),
    ("c_D", lambda n, x: 300 / 25.4 * x, "inches .divide by the diameter, 11.811 in"),
    ("P_D", lambda n, x: 300 * x, "row 1, r/R = 0.2: P_D 436.5 is no pitch over diameter.*millimetres"),
    ("f0_c", lambda n, x: 100 * x, "row 1, r/R = 0.2: f0_c 4.3 is no greatest camber over chord.*percent .divide"),
    ("t0_D", lambda n, x: 100 * x, "t0_D 4.34 is no greatest thickness over diameter.*percent"),
    ("rake_D", lambda n, x: 12.0, "rake_D 12 is no rake over diameter.*millimetres"),
    ("r_R", lambda n, x: 150 * x, "r_R 150 is no radius over the tip's radius.*divide by the radius, 150 mm"),
    ("skew_deg", lambda n, x: np.radians(x), "row 10, r/R = 0.95: skew_deg 0.58.*radians .33.8 degrees.*skew_rad"),
    ("c_D", only(3, "inf"), "row 3, column c_D: 'inf' is no value"),
    ("P_D", only(3, "nan"), "row 3, column P_D: 'nan' is no value"),
    ("t0_D", only(4, ""), "row 4, r/R = 0.4: t0_D is empty: give the greatest thickness over diameter"),
    ("c_D", only(11, ""), "row 11, r/R = 1: c_D is empty"),
    ("skew_deg", only(5, 54.0), "row 5, r/R = 0.5: skew_deg 54 makes a kink.*13.87"),
    ("skew_deg", lambda n, x: x + 40 * (n > 5), "row ., r/R = 0..: skew_deg .* makes a kink"),
    ("P_D", only(6, 1.9), "row 6, r/R = 0.6: P_D 1.9 makes a kink")])
def test_an_entry_that_cannot_be_meant_is_told_with_row_unit_and_mend(column, change, wanted, tmp_path):
    (tmp_path / "mine.csv").write_text(changed(column, change))
    with pytest.raises(DesignError, match=wanted):
        tables.from_files(tmp_path / "mine.csv", 300.0, 5)


def test_a_table_may_have_a_byte_order_mark_and_skew_in_radians(tmp_path):
    (tmp_path / "plain.csv").write_text(SKEWED)
    (tmp_path / "other.csv").write_text(changed("skew_deg", lambda n, x: np.radians(x)).replace("skew_deg", "skew_rad"),
                                        encoding="utf-8-sig")
    plain, other = (tables.from_files(tmp_path / f"{n}.csv", 300.0, 5) for n in ("plain", "other"))
    assert np.nan_to_num(other.skew_rad) == pytest.approx(np.nan_to_num(plain.skew_rad), abs=1e-12)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="is written in UTF-16: save it as UTF-8"):
        tables.from_files(tmp_path / "binary.csv", 300.0, 5)


def test_a_thick_skewed_table_is_held_at_all_radii(tmp_path):
    """Its points were 2.6 and 3.6 um off near the root: the mean line's slope, along which thickness is laid off, and
    the surface between its places near the root."""
    (tmp_path / "mine.csv").write_text(SKEWED)
    for size, allowed in ((250.0, 0.001), (300.0, 0.001)):
        table = tables.from_files(tmp_path / "mine.csv", size, 5)
        blade = blade_of(table, 0.19)
        for rho, x, side, places in table_points(table):
            off = _nearest_on_blade_mm(SimpleNamespace(blade=blade), loop_angle(x, side, table.edge), rho, places)
            assert off < allowed, (size, rho, off)


def test_a_blade_too_thin_for_its_surface_names_radius_and_parameter(monkeypatch):
    monkeypatch.setattr(blade, "REFINEMENTS", (1.0,))
    edge = TrailingEdge(kind="anti-singing", thickness_share=0.02, bevel_leaves=0.2)
    with pytest.raises(DesignError, match=r"0.00070 mm are allowed, at r/R = 0\.2\d\d, 9\d\.\d+ % of the chord: the "
                                          r"section there is 4\.\d+ mm thick on a chord of .*bevel_chord_share, now 0.06"):
        blade_of(own_screw(5, 0.7, 1.1, 300.0, thickness_scale=0.5, edge=edge), 0.19)
    monkeypatch.setattr(blade, "FIT_MM", 1e-7)
    with pytest.raises(DesignError, match="trailing edge is too thin for it; raise trailing_edge|smooth them there"):
        blade_of(own_screw(5, 0.7, 1.1, 300.0), 0.19)


def test_cuts_that_break_through_the_hub_are_refused():
    hub = straight_hub(-60.0, 60.0, 30.0)
    for cuts, wanted in ((HubCuts(bore_mm=59.0), "bore"),
                         (HubCuts(bore_mm=50.0, key_width_mm=10.0, key_depth_mm=5.0), "keyway"),
                         (HubCuts(bolts=4, bolt_circle_mm=40.0), "of no diameter"),
                         (HubCuts(bore_mm=20.0, bolts=4, bolt_mm=6.0, bolt_circle_mm=24.0), "run into the bore")):
        with pytest.raises(DesignError, match=wanted):
            _tools(hub, cuts, "test")


def test_without_a_bore_its_taper_takes_nothing_away():
    hub, cuts = straight_hub(-60.0, 60.0, 30.0), HubCuts(bore_half_angle_rad=0.05)
    assert volume_of_cuts_mm3(hub, cuts) == 0 and _tools(hub, cuts, "test") == []


def test_a_shell_that_is_not_closed_is_refused():
    builder = ShellBuilder()
    corners = [builder.vertex(p) for p in ((0, 0, 0), (0, 1, 0), (0, 0, 1))]
    line = lambda a, b: BSpline([0.0, 0.0, 1.0, 1.0], np.array([a, b], float), 1)
    ends = ((0, 0), (1, 0), (0, 1), (0, 0))
    sides = [Side(edge=builder.edge(spline_curve(line((0, *a), (0, *b))), 0, 1, corners[k], corners[(k + 1) % 3]),
                  curve=plane_curve(line(a, b))) for k, (a, b) in enumerate(zip(ends, ends[1:]))]
    builder.face("lonely", plane_across_x(0.0), [sides])
    with pytest.raises(DesignError, match="is on 1 face .lonely."):
        builder.solid()


# a design without setups ---------------------------------------------------------------------------------


def test_the_build_ends_with_a_measured_solid(tmp_path):
    source = catalogue.find_design("dtmb_4119")
    order = build.Order(source=source, design=catalogue.make_design(source, ["diameter_mm=120", "bore_mm=0", "blades_cut=none", *(
        f"fillet_{where}_mm=2" for where in ("leading_edge", "face", "trailing_edge", "back"))]),
        machine=catalogue.find_machine("mill_3axis"), library=catalogue.find_library(None), accepted=(),
        out=tmp_path / "out", last_stage="report")
    result = build.build(order)
    told = json.loads((tmp_path / "out/solid.json").read_text())
    assert result.is_ok and "nothing is planned" in result.told and told["ok"]
    assert {"outlines.svg", "sections.svg", "dtmb_4119.step", "dtmb_4119.glb", "manifest.json"} <= {
        p.name for p in (tmp_path / "out").iterdir()}
    assert len(told["figures"]) > 30 and all(f["ok"] for f in told["figures"])


def test_table_points_are_the_tables_own(dtmb):
    """One of them by hand: r/R 0.7, x/c 0.5, back."""
    rho, x, side, places = next(row for row in table_points(dtmb.blade.table) if row[0] == 0.7)
    row = np.flatnonzero((x == 0.5) & (side > 0))[0]
    chord, pitch, r = 0.4622 * 304.8, 1.084 * 304.8, 0.7 * 152.4
    slope = 0.09129429258 * 0.02003
    lift = 0.4962 * 0.05418 * chord / np.hypot(1, slope)
    xi, n = -lift * slope, 0.9992991001 * 0.02003 * chord + lift
    phi = np.arctan(pitch / (2 * np.pi * r))
    assert places[row, 0] == pytest.approx(xi * np.sin(phi) - n * np.cos(phi), abs=1e-9)
    turn = (xi * np.cos(phi) + n * np.sin(phi)) / r
    assert places[row, 1:] == pytest.approx([-r * np.sin(turn), r * np.cos(turn)], abs=1e-9)
    one = [f for f in brep.faces_of(dtmb.solid) if f.mark.name.startswith("blade 1 ")]
    assert section_on_solid(dtmb, one, 0.7, np.array([0.0, 1.0, np.pi])).shape == (3, 2)
