"""What a propeller designer measures on the finished solid, against the table it was made from.

Points are measured as distances from the faces of the solid as read back; chord, pitch and thickness are
taken from its sections with cylinders, unrolled.
"""

import numpy as np
from OCP.TopAbs import TopAbs_SHELL

from cuspline.design import Figure, SolidReport
from cuspline.designs.propellers.blade import about_x, wrapped
from cuspline.designs.propellers.mesh import extrapolated_volume_mm3, propeller_mesh
from cuspline.designs.propellers.sections import FormAndMeanLine, loop_angle, section_loop
from cuspline.designs.propellers.solid import volume_of_cuts_mm3
from cuspline.designs.propellers.tables import area_under_chords, expanded_area_ratio
from cuspline.kernel import brep
from cuspline.kernel.solids import solid_of
from cuspline.surfaces.projection import ClosestTree
from cuspline.surfaces.rolling_ball import fillet_errors
from cuspline.values import fixed_math as fixed

POINT_MM = 0.002            # table point or definition from the solid
POINT_SIZE_MM = 304.8       # diameter up to which that goes for table points
BALL_MM, ANGLE_DEG = 0.001, 0.01
TURNED_DEG = 1.0            # in the middle of the fillet a micrometre tilts a normal more than at its borders
TESSELLATION_MM = 0.005
VOLUME_SHARE = 1e-5
SHAPE_SHARE = 1e-4          # chord, pitch, thickness of a form: of their value
OFFSETS_SHARE = 1e-3        # thickness of sections by offsets, whose greatest may lie between their stations
ROUNDED = 3.0               # half-thicknesses from a blunt end within which its rounding shows
SIDES = np.linspace(0.15, 2.95, 600)        # loop angles at which thickness is looked for
TIP = 0.999                 # r/R up to which sections are cut
RANDOM_POINTS = 4000
AREA_POINTS = 24            # chords measured on the solid for its expanded area


def solid_report(made, solid, density_g_per_cm3):
    """SolidReport of a propeller.

    Args:
        made: PropellerSolid, what the solid was built from.
        solid: the same as read back from its file; its faces carry their names.
    """
    faces = brep.faces_of(solid)
    volume, center, inertia = brep.mass_properties(solid)
    mesh = propeller_mesh(made, TESSELLATION_MM)
    solid_of(mesh.vertices_mm, mesh.triangles, "the propeller's mesh")         # refuses what is not closed
    by_mesh = extrapolated_volume_mm3(made) - volume_of_cuts_mm3(made.hub, made.cuts)
    blade, rows, measured_ear = blade_figures(made, faces)
    figures = [
        Figure(what="shells", measured=len(brep.explore(solid, TopAbs_SHELL)), wanted=1, allowed=0),
        Figure(what="faces without a name", measured=sum(not f.mark.name for f in faces), wanted=0, allowed=0),
        Figure(what="loosest tolerance", measured=brep.loosest_tolerance_mm(solid), wanted=0, allowed=1e-3, unit="mm"),
        Figure(what="volume, kernel over mesh", measured=volume / by_mesh, wanted=1, allowed=VOLUME_SHARE),
        Figure(what="closed mesh of blades and hub, deviation", measured=mesh.deviation_mm, wanted=0,
               allowed=TESSELLATION_MM, unit="mm"),
        *blade, *fillet_figures(made, faces)]
    mass = volume * density_g_per_cm3 * 1e-6
    return SolidReport(figures=tuple(figures), facts={
        "expanded_area_ratio": round(measured_ear, 6), "volume_mm3": round(volume, 3), "mass_kg": round(mass, 6),
        "density_g_per_cm3": density_g_per_cm3, "centre_mm": [round(float(x), 5) for x in center],
        "inertia_kg_mm2": [[round(float(v), 4) for v in row] for row in inertia * density_g_per_cm3 * 1e-6],
        "tessellation": {"triangles": len(mesh.triangles), "deviation_mm": mesh.deviation_mm}, "sections": rows})


def blade_figures(made, faces):
    """What blade 1 of a solid keeps of its table.

    Args:
        made: PropellerSolid.
        faces: brep.Face values of the solid, named.
    Returns:
        [Figure, ...], rows of the sections at the table's radii, expanded area ratio.
    """
    one = [f for f in faces if f.mark.name.startswith("blade 1 ")]
    tree = ClosestTree.of_faces(one)
    rows, area_ratio = sections_at_radii(made, one)
    return [Figure(what="blade from its definition, random points", measured=_random_deviation_mm(made, tree), wanted=0,
                   allowed=POINT_MM, unit="mm"),
            *_table_figures(made, tree), *_section_figures(made, rows),
            Figure(what="expanded area ratio, sections against chord table", measured=area_ratio,
                   wanted=expanded_area_ratio(made.blade.table, _hub_ratio(made)), allowed=1e-4)], rows, area_ratio


def fillet_figures(made, faces):
    """What the fillets of a solid keep of the rolling ball, measured between the places they were built from.

    Args:
        made: PropellerSolid.
        faces: brep.Face values of the solid, named.
    """
    blades = made.blade.table.blades
    errors = [fillet_errors(_surface_of([f for f in faces if f.mark.name == f"fillet {k + 1}"]), made.blade.outward > 0,
                            made.between.turned(about_x(2 * np.pi * k / blades))) for k in range(blades)]
    limit = lambda what, name, allowed, unit: Figure(
        what=f"fillets, {what}", measured=max(getattr(e, name) for e in errors), wanted=0, allowed=allowed, unit=unit)
    return [limit("distance from the ball", "ball_mm", BALL_MM, "mm"),
            limit("normal against the blade's", "blade_angle_deg", ANGLE_DEG, "deg"),
            limit("normal against the hub's", "hub_angle_deg", ANGLE_DEG, "deg"),
            limit("normal against the way to the ball's centre", "ball_angle_deg", TURNED_DEG, "deg"),
            limit("border from the blade's contact", "blade_border_mm", BALL_MM, "mm"),
            limit("border from the hub's contact", "hub_border_mm", BALL_MM, "mm")]


def _surface_of(faces):
    """Function of u, v, (n,) each -> (n, 6, 3): the faces round one loop as one surface on the loop's parameters."""
    def derivatives(u, v):
        found = np.full((len(u), 6, 3), np.nan)
        for face in faces:
            low, high = face.nurbs.domain[:2]
            for turn in (-2 * np.pi, 0.0, 2 * np.pi):
                rows = np.flatnonzero((u + turn >= low) & (u + turn <= high))
                found[rows] = face.nurbs.derivatives(u[rows] + turn, v[rows])
        return found
    return derivatives


def definition_deviation_mm(made):
    """Largest distance of the blade's surface from its definition, at random parameters above the fillet."""
    u, v, wanted = _random_points(made, seed=1)
    return float(np.linalg.norm(made.blade.surface.derivatives(u, v)[:, 0] - wanted, axis=1).max())


def _random_points(made, seed):
    rng, (low, high) = np.random.default_rng(seed), made.blade.surface.domain[:2]
    u = rng.uniform(low, high, RANDOM_POINTS)
    floor = made.fillet.on_blade(u)[:, 0]
    v = floor + (1 - floor) * rng.uniform(0, 1, RANDOM_POINTS)
    return u, v, made.blade.points_mm(u, made.blade.rho_at(v))


def _random_deviation_mm(made, tree):
    _, _, wanted = _random_points(made, seed=2)
    return float(tree.closest_points(wanted).distance_mm.max())


def _hub_ratio(made):
    return float(made.hub.profile(0.0)) / made.blade.table.radius_mm


# points of the table ---------------------------------------------------------------------------


def table_points(table):
    """The table's own points in space, no spline between: [(r/R, x/c (n,), side (n,), points (n, 3)), ...].

    Left out are ends that the edges' rounding changes, and what a bevel or another edge thickness takes away.
    """
    found = []
    for k, rho in enumerate(table.r_R):
        chord = table.chord_D[k] * table.diameter_mm
        if chord <= 0 or rho >= 1:
            continue
        ordinates = _ordinates(table, k, rho)
        if ordinates is None:
            continue
        x, side, s, n = ordinates
        places = wrapped(table, rho * table.radius_mm, table.pitch_D[k] * table.diameter_mm, table.skew_rad[k],
                         table.rake_D[k] * table.diameter_mm, (s - 0.5) * chord, n * chord)
        found.append((float(rho), x, side, places))
    return found


def _ordinates(table, k, rho):
    """x/c, side, distance along and ordinate across the nose-tail line, shares of the chord; None: none there."""
    shape, thick = table.shape, table.thickness_D[k] / table.chord_D[k]
    if isinstance(shape, FormAndMeanLine):
        x, half, camber, slope = shape.ordinates
        slope = np.nan_to_num(slope) * table.camber_c[k]
        root = np.sqrt(1 + slope ** 2)
        lift, mean = half * thick, camber * table.camber_c[k]
        back = (x - lift * slope / root, mean + lift / root)
        face = (x + lift * slope / root, mean - lift / root)
        ends = 0.0, lift[-1]
    else:
        radii, xs, faces, backs = shape.ordinates
        row = np.flatnonzero(np.abs(radii - rho) < 1e-9)
        if not len(row):
            return None
        x, low, high = xs[row[0]], faces[row[0]] * thick, backs[row[0]] * thick
        back, face, ends = (x, high), (x, low), ((high[0] - low[0]) / 2, (high[-1] - low[-1]) / 2)
    edge = table.edge
    tail = 2 * edge.bevel_chord_share if edge.kind == "anti-singing" else 0.0
    tail = 1.0 if edge.thickness_share is not None else tail
    keep = (x >= ROUNDED * ends[0]) & (1 - x >= max(ROUNDED * ends[1], tail)) & (x < 1)
    both = np.r_[x[keep], x[keep]]
    side = np.repeat([1.0, -1.0], keep.sum())
    return both, side, np.r_[back[0][keep], face[0][keep]], np.r_[back[1][keep], face[1][keep]]


def _table_figures(made, tree):
    """Per radius the farthest of the table's points from the solid; inside the fillet, from the blade under it.

    Tables are rounded shares: what that leaves open grows with the propeller; so does what is allowed, from
    POINT_SIZE_MM on.
    """
    table, figures = made.blade.table, []
    for rho, x, side, places in table_points(table):
        allowed = POINT_MM * max(1.0, table.diameter_mm / POINT_SIZE_MM)
        sigma = loop_angle(x, side, table.edge)
        stands = made.blade.v_at(rho) > made.fillet.on_blade(_wrapped_angle(made, sigma))[:, 0]
        free = float(tree.closest_points(places[stands]).distance_mm.max(initial=0.0))
        if stands.any():
            figures.append(Figure(what=f"table points on the solid at r/R {rho:g} ({stands.sum()} of {len(x)})",
                                  measured=free, wanted=0, allowed=allowed, unit="mm"))
        if not stands.all():
            under = _nearest_on_blade_mm(made, sigma[~stands], rho, places[~stands])
            figures.append(Figure(what=f"table points on the blade under the fillet at r/R {rho:g}", measured=under,
                                  wanted=0, allowed=allowed, unit="mm"))
    return figures


def _wrapped_angle(made, sigma):
    low = made.blade.surface.domain[0]
    return low + np.mod(sigma - low, 2 * np.pi)


def _nearest_on_blade_mm(made, sigma, rho, places):
    """Largest distance of points from the blade's surface, by Newton steps from where they should be."""
    u, v = _wrapped_angle(made, sigma), np.full(len(sigma), float(made.blade.v_at(rho)))
    for _ in range(12):
        d = made.blade.surface.derivatives(u, v)
        gap, su, sv = places - d[:, 0], d[:, 1], d[:, 2]
        dot = lambda a, b: np.einsum("ij,ij->i", a, b)
        e, f, g, p, q = dot(su, su), dot(su, sv), dot(sv, sv), dot(gap, su), dot(gap, sv)
        det = e * g - f * f
        u, v = u + (g * p - f * q) / det, v + (e * q - f * p) / det
    return float(np.linalg.norm(places - made.blade.surface.derivatives(u, v)[:, 0], axis=1).max())


# sections with cylinders -----------------------------------------------------------------------


def section_on_solid(made, faces, rho, sigma):
    """Where the blade's faces meet the cylinder of radius r, unrolled.

    Args:
        faces: brep.Face values of blade 1.
        rho: r/R.
        sigma: (n,) loop angles.
    Returns:
        (n, 2) arc length r Theta and axial X, mm.
    """
    table, r = made.blade.table, rho * made.blade.table.radius_mm
    u, v = _wrapped_angle(made, np.asarray(sigma, float)), np.full(len(sigma), float(made.blade.v_at(rho)))
    places = np.full((len(u), 3), np.nan)
    for face in faces:
        u0, u1, v0, v1 = face.nurbs.domain
        rows = np.flatnonzero((u >= u0) & (u <= u1) & (v0 <= v[0] <= v1))
        if not len(rows):
            continue
        at = v[rows]
        for _ in range(8):
            d = face.nurbs.derivatives(u[rows], at)
            size = fixed.hypot(d[:, 0, 1], d[:, 0, 2])
            at = at - (size - r) / ((d[:, 0, 1] * d[:, 2, 1] + d[:, 0, 2] * d[:, 2, 2]) / size)
        places[rows] = face.nurbs.derivatives(u[rows], at)[:, 0]
    turn = np.unwrap(fixed.arctan2(table.hand * places[:, 1], places[:, 2]))
    return np.stack([r * turn, places[:, 0]], axis=1)


def _measured_section(made, faces, rho):
    """(chord, pitch, thickness) mm at a radius of the solid."""
    sides = section_on_solid(made, faces, rho, np.r_[0.0, SIDES, np.pi, -SIDES[::-1]])
    nose, back, tail, face = sides[0], sides[1:len(SIDES) + 1], sides[len(SIDES) + 1], sides[len(SIDES) + 2:][::-1]
    turn = 2 * np.pi * rho * made.blade.table.radius_mm
    face = face + np.array([turn, 0.0]) * np.round((back[0] - face[0])[0] / turn)
    along, axial = tail - nose
    tilt, stretch = _ends_off_the_line(made, rho)
    thickness = np.linalg.norm(back - face, axis=1).max()
    pitch = turn * fixed.tan(fixed.arctan2(axial, along) + tilt)
    return float(fixed.hypot(along, axial) / stretch), float(pitch), float(thickness)


def _ends_off_the_line(made, rho):
    """Turn of the line from nose to tail off the pitch line, rad (a bevel lowers the tail); how much longer it is."""
    laws, at = made.blade.laws, np.full(2, rho)
    _, n = section_loop(laws.table.shape, laws.table.edge, np.array([0.0, np.pi]), at, laws.thickness_share(at),
                        laws.camber_share(at))
    rise = n[1] - n[0]
    return float(fixed.arctan(rise)), float(fixed.hypot(1.0, rise))


def sections_at_radii(made, faces):
    """([row a radius of the table that stands free of the fillet], expanded area ratio measured)."""
    table = made.blade.table
    lowest = float(made.blade.rho_at(made.fillet.on_blade(np.linspace(*made.blade.surface.domain[:2], 400)).max()))
    rows = []
    for k, rho in enumerate(table.r_R):
        if lowest < rho < TIP and table.chord_D[k] > 0:
            chord, pitch, thickness = _measured_section(made, faces, rho)
            rows.append({"r_R": float(rho), "chord_mm": chord,
                         "chord_table_mm": float(table.chord_D[k] * table.diameter_mm),
                         "pitch_mm": pitch, "pitch_table_mm": float(table.pitch_D[k] * table.diameter_mm),
                         "thickness_mm": thickness,
                         "thickness_table_mm": float(table.thickness_D[k] * table.diameter_mm)})
    return rows, _measured_area_ratio(made, faces, lowest)


def _measured_area_ratio(made, faces, lowest):
    """Expanded area ratio by measured chords; under the fillet and at the very tip by the blade's own law."""
    measured = lambda radii: np.array([
        _measured_section(made, faces, rho)[0] if lowest < rho < TIP else law
        for rho, law in zip(radii, made.blade.laws.chord_mm(radii).tolist())])
    return area_under_chords(made.blade.table, _hub_ratio(made), measured, AREA_POINTS)


def _section_figures(made, rows):
    known = made.blade.table.edge.thickness_share is None and made.blade.table.edge.kind != "anti-singing"
    is_form = isinstance(made.blade.table.shape, FormAndMeanLine)
    shares = {"chord": SHAPE_SHARE, "pitch": SHAPE_SHARE} | (
        {"thickness": SHAPE_SHARE if is_form else OFFSETS_SHARE} if known else {})
    return [Figure(what=f"{name} at r/R {row['r_R']:g}", measured=row[f"{name}_mm"], wanted=row[f"{name}_table_mm"],
                   allowed=max(share * row[f"{name}_table_mm"], 2 * POINT_MM), unit="mm")
            for row in rows for name, share in shares.items()]
