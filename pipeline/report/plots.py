"""Plots for report and setup sheet: SVG text, the same bytes for the same numbers."""

import functools
import io
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from cuspline.report.facts import along_setups, candidate_rows, finishing_steps, operations, tools_used
from cuspline.report.view_data import OPERATION_COLOURS
from cuspline.report.wording import number, short, tool_name

GOOD, BAD, INK, BARS = "#1b7f3b", "#c62828", "#1b2330", "#7d93ab"
STYLE = {"svg.hashsalt": "cuspline", "svg.fonttype": "none", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3,
         "axes.spines.top": False, "axes.spines.right": False, "axes.titlesize": 9, "axes.titlelocation": "left",
         "axes.axisbelow": True, "legend.frameon": False, "legend.fontsize": 8,
         # room for labels: to lay them out anew for every plot would draw each one three times
         "figure.subplot.left": 0.13, "figure.subplot.right": 0.965, "figure.subplot.bottom": 0.175, "figure.subplot.top": 0.9}
FT_M, CUBIC_INCH_CM3 = 0.3048, 16.387064
FEED_COLUMNS = 400          # instants drawn of the feed plot: about its pixels


@dataclass(frozen=True)
class Units:
    """What a plot's lengths are in; a thousandth of one is the fine unit.  Lengths are handed over in these."""

    length: str = "mm"
    fine: str = "µm"
    way: str = "m"              # and cutting speed, of which m/min are as many
    volume: str = "cm³"
    of_mm: float = 1.0          # factors
    of_m: float = 1.0
    of_cm3: float = 1.0


UNITS = {"mm": Units(), "inch": Units("inch", "0.001 inch", "ft", "inch³", 1 / 25.4, 1 / FT_M, 1 / CUBIC_INCH_CM3)}


def in_our_style(plot):
    """Runs a plot with our settings on matplotlib's defaults, whatever the user's matplotlibrc says."""
    @functools.wraps(plot)
    def styled(*args):
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(STYLE)
            return plot(*args)
    return styled


def all_plots(bundle):
    """[(name, caption, SVG text)] of every plot the bundle has numbers for, in the units of its machine."""
    units = UNITS[bundle.setups[0].units] if bundle.setups else UNITS["mm"]
    of = lambda values: np.asarray(values, dtype=float) * units.of_mm
    scallop, gouge = bundle.finish.scallop_mm * units.of_mm, bundle.finish.gouge_mm * units.of_mm
    radii, hollow = cutter_radii_mm(bundle)
    radii, hollow = [(name, r * units.of_mm, is_chosen) for name, r, is_chosen in radii], hollow and hollow * units.of_mm
    plots = [("deviation", "How far the simulated stock is from the design",
              deviation_histogram(of(bundle.deviation_samples_mm), scallop, gouge, units)),
             ("curvature", "Which cutter radii fit the concave places of the part",
              curvature_plot(np.asarray(bundle.curvature_per_mm, dtype=float) / units.of_mm, radii, hollow, units)),
             ("cusp-map", "Height of the cusps, from above",
              cusp_map(of(bundle.cusp_place_mm), of(bundle.cusp_height_mm), scallop, of(bundle.part_box_mm), units)),
             ("cusp", "Height of the cusps against the height requested and the formula's",
              cusp_histogram(of(bundle.cusp_height_mm), of(bundle.cusp_formula_mm), scallop, units))]
    plots += [(f"cut-map-{s.name}", f"What transverse arcs leave of the tip, cusps apart: {s.name}, {op.get('name')}",
               cut_map_plot(op["cut_map"], units)) for s, _, op in operations(bundle) if op.get("cut_map")]
    plots += [(f"feed-{s.name}", f"Feed over time, {s.name}", feed_plot(s.path, _names(bundle, s), units))
              for s in bundle.setups if len(s.path.time_s)]
    plots += [(f"process-{name}", f"What the edges meet along the cutting way, {name}", process_plot(along, units))
              for name, along in along_setups(bundle.verify)]
    return plots


def _names(bundle, setup):
    return [str(op.get("name") or f"operation {k + 1}") for s, k, op in operations(bundle) if s is setup]


@in_our_style
def deviation_histogram(deviation_mm, scallop_mm, gouge_mm, units=UNITS["mm"]):
    """Histogram of all judged residuals with the accepted band; both ends collect what lies beyond.

    Args:
        deviation_mm: (n,) residuals, positive where material is left; NaN: not judged.
        scallop_mm: largest cusp asked for, scalar > 0.
        gouge_mm: deepest gouge accepted, scalar > 0.
    Returns:
        SVG text.
    """
    found = np.asarray(deviation_mm, dtype=float)
    microns = found[np.isfinite(found)] * 1000
    if not len(microns):
        return _nothing("no residual was judged")
    low = -1000 * gouge_mm - max(0.5 * 1000 * gouge_mm, 0.25 * 1000 * scallop_mm)
    low, high = min(low, np.percentile(microns, 0.1)), max(1500 * scallop_mm, np.percentile(microns, 99.9))
    figure, axes = _figure()
    _bars(axes, microns, np.linspace(low, high, 81))
    _logarithmic(axes.yaxis)
    axes.axvspan(-1000 * gouge_mm, 1000 * scallop_mm, color=GOOD, alpha=0.10, lw=0)
    for limit, name in ((-1000 * gouge_mm, "gouge"), (1000 * scallop_mm, "cusp")):
        axes.axvline(limit, color=GOOD, lw=1.2)
        axes.text(limit, 1.01, f"{name} {limit:+.4g}".replace("-", "−"), color=GOOD, fontsize=8, ha="center",
                  transform=axes.get_xaxis_transform())
    beyond = int((microns < -1000 * gouge_mm).sum()), int((microns > 1000 * scallop_mm).sum())
    axes.set_xlabel(f"deviation [{units.fine}], below 0 gouged   (n = {len(microns)}; below the band {beyond[0]}, above "
                    f"{beyond[1]})")
    axes.set_ylabel("points")
    return _svg(figure)


@in_our_style
def cusp_map(place_mm, height_mm, wanted_mm, box_mm, units=UNITS["mm"]):
    """Measured cusps from above, coloured by height: the wanted one is the middle of the scale.

    Args:
        place_mm: (n, 3) part coordinates.   height_mm: (n,).
        wanted_mm: scalar > 0.   box_mm: the part's (min, max).
    Returns:
        SVG text; the dots are a picture in it.
    """
    if not len(height_mm):
        return _nothing("no ridge between passes of a ball was measured")
    (x0, y0, _), (x1, y1, _) = box_mm
    figure, axes = _figure()
    order = np.argsort(height_mm, kind="stable")
    dots = axes.scatter(*np.asarray(place_mm)[order, :2].T, c=np.asarray(height_mm)[order] * 1000, s=3, lw=0,
                        cmap="viridis", vmin=0, vmax=1200 * wanted_mm, rasterized=True)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel=f"X [{units.length}]", ylabel=f"Y [{units.length}]", aspect="equal")
    axes.grid(False)
    bar = figure.colorbar(dots, ax=axes, label=f"cusp [{units.fine}]")
    bar.ax.axhline(1000 * wanted_mm, color=BAD, lw=1.5)
    return _svg(figure)


@in_our_style
def cusp_histogram(height_mm, formula_mm, wanted_mm, units=UNITS["mm"]):
    """Histogram of measured cusps, the formula's as a line over it, the wanted height marked.

    Args:
        height_mm, formula_mm: (n,).   wanted_mm: scalar > 0.
    Returns:
        SVG text.
    """
    if not len(height_mm):
        return _nothing("no ridge between passes of a ball was measured")
    high = 1000 * max(1.2 * wanted_mm, float(np.quantile(height_mm, 0.999)))
    edges = np.linspace(0, high, 81)
    figure, axes = _figure()
    _bars(axes, 1000 * np.asarray(height_mm), edges, label="measured")
    axes.hist((1000 * np.asarray(formula_mm)).clip(0, high), edges, histtype="step", color=INK, lw=1,
              label="formula at the local step")
    axes.axvline(1000 * wanted_mm, color=GOOD, lw=1.4)
    axes.text(1000 * wanted_mm, 1.01, f"requested {1000 * wanted_mm:.4g}", color=GOOD, fontsize=8, ha="center",
              transform=axes.get_xaxis_transform())
    _logarithmic(axes.yaxis)
    axes.legend(loc="upper left")
    axes.set_xlabel(f"cusp [{units.fine}]   (n = {len(height_mm)})")
    axes.set_ylabel("ridges")
    return _svg(figure)


@in_our_style
def cut_map_plot(found, units=UNITS["mm"]):
    """Deviation of the envelope of transverse arcs from a vane tip, along the vane and round its arc, extremes named.

    Args:
        found: plan.json's `cut_map`.
    Returns:
        SVG text; the map is a picture in it.
    """
    x, fine = np.array(found["x_mm"], float) * units.of_mm, 1000 * units.of_mm
    rows = np.array(found["deviation_mm"], float) * fine
    turns = np.linspace(0, found["half_arc_deg"], rows.shape[1] - 1)
    both = np.column_stack([rows[:, -1:], rows[:, -2:0:-1], rows[:, :-1], rows[:, -1:]])
    step = turns[1]
    around = np.concatenate([[-turns[-1] - step], -turns[:0:-1], turns, [turns[-1] + step]])
    general = found.get("general") or found["matching"]
    limit = fine * max(abs(general["lowest_mm"]), abs(general["highest_mm"]), 1e-6)
    figure, axes = _figure()
    mesh = axes.pcolormesh(x, around, np.ma.masked_invalid(both.T), cmap="RdBu_r", vmin=-limit, vmax=limit,
                           shading="nearest", rasterized=True)
    axes.grid(False)
    axes.set(xlabel=f"X [{units.length}]", ylabel="round the tip [deg], flanks outermost")
    figure.colorbar(mesh, ax=axes, label=f"left [{units.fine}]", extend="both")
    said = [f"{name} {fine * found[name]['lowest_mm']:+.1f} … {fine * found[name]['highest_mm']:+.1f} {units.fine}"
            for name in ("general", "matching") if name in found]
    axes.set_title("; ".join(said))
    return _svg(figure)


@in_our_style
def curvature_plot(curvature_per_mm, radii_mm, hollow_mm, units=UNITS["mm"]):
    """Radii of the part's hollows against the cutters' radii: a cutter fits what lies right of its line.

    Args:
        curvature_per_mm: (n,) largest concave curvature, > 0 in a hollow.
        radii_mm: [(name, radius_mm, is_chosen)] of the finishing cutters looked at.
        hollow_mm: tightest hollow of what is cut, or None.
    Returns:
        SVG text.
    """
    curvature = np.asarray(curvature_per_mm, dtype=float)
    curvature = curvature[np.isfinite(curvature)]
    radius = 1 / curvature[curvature > 1e-4]          # flatter than R 10 m counts as flat
    if not len(radius) and not radii_mm:
        return _nothing("nothing concave, and no cutter to compare with")
    everything = np.concatenate([radius, [r for _, r, _ in radii_mm], [hollow_mm] if hollow_mm else []])
    low, high = everything.min() / 1.4, min(max(everything.max() * 1.4, everything.min() * 4), 2000.0)
    figure, axes = _figure()
    _logarithmic(axes.xaxis)
    _bars(axes, radius, np.geomspace(low, high, 61))
    for row, (name, value, is_chosen) in enumerate(radii_mm):
        axes.axvline(value, color=GOOD if is_chosen else INK, lw=1.8 if is_chosen else 0.8, ls="-" if is_chosen else ":")
        axes.text(value, 0.97 - 0.085 * (row % 10), f" {name}", color=GOOD if is_chosen else INK, fontsize=8, va="top",
                  fontweight="bold" if is_chosen else "normal", transform=axes.get_xaxis_transform())
    if hollow_mm:
        axes.axvline(hollow_mm, color=BAD, lw=1)
        axes.text(hollow_mm, 1.01, f"tightest R {short(hollow_mm)}", color=BAD, fontsize=8, ha="center",
                  transform=axes.get_xaxis_transform())
    flat = 1 - len(radius) / len(curvature) if len(curvature) else 0.0
    axes.set_xlabel(f"concave radius [{units.length}]   ({100 * flat:.0f} % of the points are flat or convex)")
    axes.set_ylabel("points")
    return _svg(figure)


def cutter_radii_mm(bundle):
    """([(name, radius_mm, is_chosen)] of finishing cutters, smallest first, tightest hollow in mm or None)."""
    finishing = {name for name, _ in finishing_steps(bundle)}
    radii = {}
    for row in candidate_rows(bundle):
        diameter = number(row["diameter"].removesuffix(" mm"))
        if row["operation"] in finishing and diameter:
            radii[row["tool"]] = (row["tool"], diameter / 2, row["chosen"] or radii.get(row["tool"], (0, 0, False))[2])
    for tool, names in tools_used(bundle):
        if finishing & set(names) and number(tool.get("diameter_mm")):
            radii[tool_name(tool)] = (tool_name(tool), tool["diameter_mm"] / 2, True)
    return sorted(radii.values(), key=lambda r: r[1]), number(bundle.plan.get("min_concave_radius_mm"))


@in_our_style
def feed_plot(path, names, units=UNITS["mm"]):
    """Feed of every operation over the program's time; a band where it changes faster than is drawn.

    Args:
        path: PathPoints of one setup.
        names: operation names, in the order of path.operation.
    Returns:
        SVG text.
    """
    minutes, feed = np.asarray(path.time_s, dtype=float) / 60, np.asarray(path.feed_mm_per_min, dtype=float) * units.of_mm
    cutting, operation = ~np.asarray(path.is_rapid, dtype=bool), np.asarray(path.operation)
    if not cutting.any() or minutes[-1] <= 0:
        return _nothing("no cutting move")
    figure, axes = _figure()
    for k in np.unique(operation[cutting]):
        middle, low, high = _feed_band(minutes, feed, cutting & (operation == k), minutes[-1])
        colour = OPERATION_COLOURS[k % len(OPERATION_COLOURS)]
        axes.fill_between(middle, low, high, color=colour, alpha=0.25, lw=0, step="mid")
        axes.step(middle, high, where="mid", color=colour, lw=1.2,
                  label=names[k] if 0 <= k < len(names) else f"operation {k + 1}" if k >= 0 else "no operation")
    axes.set_xlim(0, minutes[-1])
    axes.set_ylim(0, feed[cutting].max() * 1.18)
    axes.legend(loc="upper right", ncols=4)
    axes.set_xlabel("time [min]")
    axes.set_ylabel(f"feed [{units.length}/min]")
    return _svg(figure)


@in_our_style
def process_plot(along, units=UNITS["mm"]):
    """Depth, cutting speed, removal rate and, where it is known, force over the cutting way; colours are the operations'.

    Args:
        along: verify.json's `process.along`.
    Returns:
        SVG text.
    """
    known = (("depth_mm", f"depth [{units.length}]", units.of_mm), ("speed_m_per_min", f"speed [{units.way}/min]", units.of_m),
             ("removal_cm3_per_h", f"removal [{units.volume}/h]", units.of_cm3), ("radial_n", "force [N]", 1.0))
    rows = [row for row in known if row[0] in along]
    way, operation = np.array(along["way_m"], float) * units.of_m, np.array(along["operation"], int)
    figure, begin = Figure(figsize=(7.2, 1.15 * len(rows) + 0.6)), np.r_[0.0, way[:-1]]
    for k, (name, label, factor) in enumerate(rows, 1):
        axes = figure.add_subplot(len(rows), 1, k)
        for number_ in np.unique(operation).tolist():
            mine = operation == number_
            axes.add_collection(PolyCollection(_columns(begin[mine], way[mine], factor * np.array(along[name], float)[mine]), lw=0,
                                               facecolor=OPERATION_COLOURS[number_ % len(OPERATION_COLOURS)]))
        axes.set(xlim=(0, way[-1]), ylabel=label)
        axes.yaxis.label.set_fontsize(7)
        axes.set_ylim(bottom=0)
        axes.tick_params(labelbottom=k == len(rows), labelsize=7)
    axes.set_xlabel(f"cutting way [{units.way}]")
    return _svg(figure)


def _feed_band(minutes, feed, is_mine, end):
    """(time, lowest, highest) feed per column of the plot; NaN where the operation does not cut."""
    first = np.floor(np.r_[minutes[0], minutes[:-1]][is_mine] / end * FEED_COLUMNS).clip(0, FEED_COLUMNS - 1).astype(int)
    last = np.floor(minutes[is_mine] / end * FEED_COLUMNS).clip(0, FEED_COLUMNS - 1).astype(int)
    low, high = np.full(FEED_COLUMNS, np.inf), np.full(FEED_COLUMNS, -np.inf)
    for ends in (first, last):
        np.minimum.at(low, ends, feed[is_mine])
        np.maximum.at(high, ends, feed[is_mine])
    for a, b, value in zip(first, last, feed[is_mine]):
        if b - a > 1:                                    # a long move covers the columns between its ends
            low[a:b], high[a:b] = np.minimum(low[a:b], value), np.maximum(high[a:b], value)
    seen = np.isfinite(low)
    middle = (np.arange(FEED_COLUMNS) + 0.5) / FEED_COLUMNS * end
    return middle, np.where(seen, low, np.nan), np.where(seen, high, np.nan)


def _bars(axes, values, edges, label=None):
    """Histogram as one outline: a patch for every bar takes most of the time of a plot; both ends collect what lies beyond."""
    axes.hist(values.clip(edges[0], edges[-1]), edges, histtype="stepfilled", color=BARS, label=label)


def _logarithmic(axis):
    """A logarithmic axis that names its powers of ten as numbers."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda value, _: "")


def _columns(begin, end, height):
    """(n, 4, 2) corners of columns from 0 up to a height."""
    corners = ((begin, 0 * height), (begin, height), (end, height), (end, 0 * height))
    return np.stack([np.column_stack(corner) for corner in corners], axis=1)


def _figure():
    figure = Figure(figsize=(6.4, 2.9))
    return figure, figure.subplots()


def _nothing(sentence):
    figure = Figure(figsize=(6.4, 1.0))
    figure.text(0.5, 0.5, sentence, ha="center", va="center")
    return _svg(figure)


def _svg(figure):
    """SVG text with neither date nor version in it."""
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()
