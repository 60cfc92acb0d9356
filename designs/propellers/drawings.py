"""Drawings of a propeller as its designer knows them: outlines projected, from the side and expanded; sections."""

import numpy as np
from matplotlib.figure import Figure

from cuspline.designs.propellers.blade import about_x
from cuspline.designs.propellers.sections import section_loop
from cuspline.report.plots import in_our_style
from cuspline.values import fixed_math as fixed

HIGH = 300          # points along an outline
LOOP = np.linspace(-np.pi, np.pi, 801)
INK, PALE = "#1b2330", "#7d93ab"


@in_our_style       # the writing too: names inside an SVG are salted by the style
def draw_propeller(made, folder):
    """Writes outlines.svg and sections.svg into a folder; the same bytes for the same propeller."""
    for name, plot in (("outlines", outlines), ("sections", sections)):
        plot(made).savefig(folder / f"{name}.svg", format="svg", metadata={"Date": None, "Creator": None})


def outlines(made):
    """Figure: the propeller seen from aft, its edges from the side with the hub, and a blade's expanded outline."""
    table, blade = made.blade.table, made.blade
    figure = Figure(figsize=(12, 4.6), layout="constrained")
    aft, side, expanded = figure.subplots(1, 3)
    least = float(made.hub.profile(0.0)) / table.radius_mm
    rho = blade.rho_at(np.linspace(float(blade.v_at(least)), 1.0, HIGH))
    r = rho * table.radius_mm
    points = blade.points_mm(*(g.ravel() for g in np.meshgrid(LOOP[::4], rho, indexing="ij"))).reshape(-1, HIGH, 3)
    turn = np.unwrap(fixed.arctan2(table.hand * points[..., 1], points[..., 2]), axis=0)
    edges = [points[len(points) // 2], points[0]]
    for k in range(table.blades):
        a, style = 2 * np.pi * k / table.blades, {"color": PALE if k else INK, "linewidth": 0.6 if k else 1.2}
        for widest in (turn.min(axis=0), turn.max(axis=0)):
            aft.plot(table.hand * r * fixed.sin(widest + a), r * fixed.cos(widest + a), **style)
        for edge in edges:
            line = fixed.matmul(edge, about_x(a).T)
            side.plot(line[:, 0], line[:, 2], **style)
    x = np.linspace(*made.hub.ends_mm, 100)
    radius = made.hub.profile(x)
    round_hub = np.linspace(0, 2 * np.pi, 200)
    aft.plot(radius.max() * fixed.cos(round_hub), radius.max() * fixed.sin(round_hub), color=INK, linewidth=0.8)
    side.plot(np.r_[x[0], x, x[-1], x[-1], x[::-1], x[0]], np.r_[0, radius, 0, 0, -radius[::-1], 0], color=INK,
              linewidth=0.8)
    chord, pitch = blade.laws.chord_mm(rho), blade.laws.pitch_mm(rho)
    middle = blade.laws.skew(rho) * fixed.hypot(r, pitch / (2 * np.pi))      # along the helix from the generator line
    expanded.plot(middle - chord / 2, r, color=INK, label="leading edge")
    expanded.plot(middle + chord / 2, r, color=PALE, label="trailing edge")
    expanded.plot(middle, r, color=PALE, linestyle=":", label="middle of the chord")
    expanded.legend()
    for axes, title, xlabel in ((aft, "From aft", "y, mm"), (side, "From the side", "x downstream, mm"),
                                (expanded, "Expanded outline", "from the generator line, mm")):
        axes.set_aspect("equal")
        axes.set_title(title)
        axes.set_xlabel(xlabel)
        axes.set_ylabel("r, mm" if axes is expanded else "z, mm")
    figure.suptitle(f"{table.name}, {table.blades} blades, D {table.diameter_mm:g} mm, "
                    f"{'right' if table.is_right_handed else 'left'}-handed")
    return figure


def sections(made):
    """Figure: sections at the table's radii, nose to the left, back up, at the pitch line."""
    table, laws = made.blade.table, made.blade.laws
    inside = [float(r) for r in table.r_R if r < 1]
    figure = Figure(figsize=(9, 1.1 * len(inside)), layout="constrained")
    widest = max(float(laws.chord_mm(np.array([r]))[0]) for r in inside)
    for axes, rho in zip(figure.subplots(len(inside), 1), inside[::-1]):
        at = np.full(len(LOOP), rho)
        chord = laws.chord_mm(at)
        s, n = section_loop(table.shape, table.edge, LOOP, at, laws.thickness_share(at), laws.camber_share(at))
        axes.fill((s - 0.5) * chord, n * chord, facecolor="#dfe5ec", edgecolor=INK, linewidth=0.8)
        axes.set_aspect("equal")
        axes.set_xlim(-0.52 * widest, 0.52 * widest)
        axes.set_title(f"r/R {rho:g}: chord {chord[0]:.2f}, pitch {laws.pitch_mm(at)[0]:.2f}, "
                       f"greatest thickness {laws.thickness_share(at)[0] * chord[0]:.3f} mm")
    return figure
