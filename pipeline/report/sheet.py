"""The setup sheet: what a machinist takes to the machine, one page or two a setup."""

import html
from dataclasses import dataclass

import numpy as np

from cuspline.design.design import by_clamping
from cuspline.report.facts import (
    edge_sets,
    findings,
    measure_rows,
    minimum_z_mm,
    not_checked,
    operation_rows,
    operations,
    verdict,
)
from cuspline.report.wording import DASH, Lengths, duration, file_size, grouped, number, tool_name
from cuspline.values import fixed_math as fixed

NOTICE = ("Simulated only: nothing here says that the program has run on a machine. "
          "Prove it out before you trust it: single block, reduced rapid, hand on feed hold.")
SAME_MM = 1e-6                                  # corners at the same distance from the eye
ON_AXIS_MM = 5e-5                               # nearer, the zero is on an axis as well as a control shows it
AXIS_SHARE = 0.45                               # of the stock's diagonal, that a rotary axis is drawn to either side
DRAWING_WIDTH, DRAWING_HEIGHT = 460.0, 330.0    # of the WCS picture, SVG units
SHORT, RASTER = 2.0, 0.5                        # SVG units: edges shorter than that are drawn on a raster
EYE = np.array([-0.75, -1.3, 0.95])             # the operator's side: front, a little from the left, above


@dataclass(frozen=True, kw_only=True)
class SetupSheet:
    """One setup, ready for the template."""

    name: str
    job: list               # [(what, value)]
    zero: list              # [(what, value)]: WCS, stock, extents
    drawing: str            # SVG text: stock, part, WCS
    tools: list             # [dict of texts]
    operations: list        # [dict of texts]
    checklist: list         # [text]
    units: str              # of its lengths: the control's
    is_solved: bool         # for tools of stated lengths
    files: list             # [(file, SHA-256)]


def setup_sheets(bundle):
    """One SetupSheet a setup, in order."""
    return [_sheet(bundle, setup) for setup in bundle.setups]


def _sheet(bundle, setup):
    rows = [row for row, (s, _, _) in zip(operation_rows(bundle, setup.units), operations(bundle)) if s is setup]
    return SetupSheet(
        name=setup.name, job=job_rows(bundle, setup), zero=zero_rows(bundle, setup), drawing=wcs_drawing(bundle, setup),
        tools=tool_rows(bundle, setup), operations=rows, checklist=checklist(bundle, setup), is_solved=bool(setup.solved_for),
        units=setup.units, files=[(setup.program_file, setup.program_sha256), *setup.continued,
                                  (bundle.step_file, bundle.step_sha256), ("inputs", bundle.inputs_sha256)])


def job_rows(bundle, setup):
    """Part, machine, program, time."""
    plan = next((p for p in bundle.plan.get("setups") or () if p.get("name") == setup.name), {})
    return [("Part", bundle.design), ("Setup", f"{setup.name}, {_which_of(bundle, setup)}"),
            ("Material", bundle.material), ("Machine", setup.machine), ("Control", setup.control),
            ("Program", f"{setup.program_file}, {grouped(setup.program_lines)} lines, {file_size(setup.program_bytes)}"
                        + (f", then {', '.join(name for name, _ in setup.continued)}" if setup.continued else "")),
            ("Units", setup.units), ("Time", duration(plan.get("time_s")))]


def clampings(bundle):
    """[[SetupBundle]]: what is set up once, the positions that its program turns the machine to among it."""
    return by_clamping(bundle.setups, lambda _, setup: setup.is_held_as_before)


def _which_of(bundle, setup):
    """1 of 2, and which position of it where it has several."""
    held = clampings(bundle)
    k, positions = next((k, names) for k, names in enumerate([s.name for s in c] for c in held) if setup.name in names)
    if len(positions) == 1:
        return f"{k + 1} of {len(held)}"
    whole = "one setup" if len(held) == 1 else f"setup {k + 1} of {len(held)}"
    return f"position {positions.index(setup.name) + 1} of {len(positions)} in {whole}"


def zero_rows(bundle, setup):
    """Where the zero is, how large the stock, how far the tool goes, all in WCS."""
    lengths = Lengths(setup.units)
    axis = lambda box, k: f"{lengths.decimal(box[0][k])} … {lengths.decimal(box[1][k])}"
    spans = lambda box: "   ".join(f"{name} {axis(box, k)}" for k, name in enumerate("XYZ"))
    lies = [("Part sits, as measured", setup.lies_in_words)] if setup.lies_in_words else []
    held = [("Held by", ", ".join(name for name, _ in setup.fixtures))] if setup.fixtures else []
    turned = [("Rotary axes", setup.turned_in_words)] if setup.turned_in_words else []
    swings = [("Program turns", setup.swings_in_words)] if setup.swings_in_words and not turned else []
    high = [] if setup.zero_height_mm is None else [
        ("Travels checked with", f"the zero {lengths.short(setup.zero_height_mm)} {setup.units} above what the stock stands on")]
    return [("Zero", f"{setup.wcs}: {setup.wcs_in_words}"), *high, *turned, *swings, ("Stock", stock_size(setup)), *held,
            (f"Stock in {setup.axes_name if turned else 'WCS'}", spans(setup.stock_box_mm)), ("Tip goes", spans(setup.extents_mm)),
            ("Finished part", lengths.box_size(bundle.part_box_mm)), *lies,
            *((f"Axis {axis[0]}", _axis_in_words(setup, axis, lengths)) for axis in setup.rotaries),
            *((f"Marker {name}", _place(place, lengths) + _elsewhere(setup, name, lengths)) for name, place in setup.markers),
            *((f"Marker {name}, for later", _place(place, lengths) + _elsewhere(setup, name, lengths))
              for name, place in setup.marked_for_later)]


def _axis_in_words(setup, axis, lengths):
    """Where a rotary axis that carries the part runs in the WCS of what holds it while all rotaries stand at 0, and its angle."""
    held, (letter, degrees, line) = setup.as_it_stands, axis
    at, along = held.into(line[:1])[0], held.turn_into(line[1:])[0]
    along = along / fixed.length(along)
    nearest = at - (at * along).sum() * along + 0.0                               # to the zero
    way = next((f"{'-' if along[k] < 0 else ''}{'XYZ'[k]}" for k in range(3) if abs(along[k]) > 1 - SAME_MM), None)
    way = f"along {way}" if way else "along " + " ".join(f"{name}{x:.4f}" for name, x in zip("XYZ", along))
    through = "through the zero" if fixed.length(nearest) < ON_AXIS_MM else f"through {_place(nearest, lengths)}"
    return f"{way} of {setup.wcs}, {through}" + ("" if degrees is None else f"; here {letter}{degrees:g} degrees")


def _elsewhere(setup, name, lengths):
    """Where a marker is in the WCS of another clamping."""
    if name not in setup.markers_elsewhere:
        return ""
    other, place = setup.markers_elsewhere[name]
    return f"; in {other} {_place(place, lengths)}"


def stock_size(setup):
    """The stock in words: its size, and what it is where it is no box along the WCS."""
    size = Lengths(setup.units).box_size(setup.stock_box_mm)
    return f"{setup.stock_in_words}{'' if setup.units == 'mm' else ' (mm)'}, within {size}" if setup.stock_in_words else size


def _place(place_mm, lengths):
    return "   ".join(f"{axis} {lengths.decimal(x)}" for axis, x in zip("XYZ", place_mm))


def tool_rows(bundle, setup):
    """One dict of texts per tool of a setup, in order of first use."""
    used = {}
    for s, k, op in operations(bundle):
        if s is setup:
            used.setdefault(tool_name(op.get("tool")), []).append((k, op))
    return [_tool_row(setup, uses) for uses in used.values()]


def _tool_row(setup, uses):
    tool = uses[0][1].get("tool")
    tool = tool if isinstance(tool, dict) else {"name": str(tool or DASH)}
    holder, lengths = tool.get("holder"), Lengths(setup.units)
    short = lengths.short
    depths = [z for z in (minimum_z_mm(setup, k) for k, _ in uses) if z is not None]
    seconds = [number(op.get("time_s")) for _, op in uses]
    return {"number": f"T{tool['number']}" if "number" in tool else DASH, "name": str(tool.get("name", DASH)),
            "type": str(tool.get("type", DASH)).replace("_", " "), "diameter": short(tool.get("diameter_mm")),
            "corner": short(tool.get("corner_radius_mm")), "flute": short(tool.get("flute_length_mm")),
            "stick_out": short(tool.get("stick_out_mm")), "length": short(_length_mm(tool)),
            "holder": _holder_in_words(holder) + _head_in_words(tool, lengths),
            "minimum_z": lengths.decimal(min(depths) if depths else None),
            "operations": ", ".join(str(op.get("name", DASH)) for _, op in uses),
            "time": duration(sum(seconds) if None not in seconds else None)}


def _length_mm(tool):
    """From the gauge line to the tip, or to the middle of a disc on a head; None: not known."""
    head, holder, stick_out = tool.get("head"), tool.get("holder"), number(tool.get("stick_out_mm"))
    if head:
        return number(head.get("length_mm"))
    if stick_out is None or not isinstance(holder, dict):
        return None
    return stick_out + sum(segment["height_mm"] for segment in holder.get("segments") or ())


def _holder_in_words(holder):
    return str(holder.get("name", DASH)) if isinstance(holder, dict) else str(holder or DASH)


def _head_in_words(tool, lengths):
    head = tool.get("head")
    return "" if not head else (f", on {head['name']}: cutter toward {head['cutter_points']}, its middle "
                                f"{lengths.short(head['offset_mm'])} {lengths.units} beside the spindle in X, "
                                f"{lengths.short(head['length_mm'])} {lengths.units} below it")


def checklist(bundle, setup):
    """What to tick off before cycle start, with this job's own numbers."""
    if setup.is_held_as_before:
        return _position_checklist(bundle, setup)
    lengths = Lengths(setup.units)
    where = "clear of every cut in all positions" if setup.swings_in_words else "below every cut"
    lines = [f"Stock is {bundle.material}, {stock_size(setup)}, clamped {where} "
             f"(lowest tip {'here ' if setup.swings_in_words else ''}Z {lengths.decimal(setup.extents_mm[0][2])})",
             f"{setup.wcs} set: {setup.wcs_in_words}; compared with the picture"]
    if setup.solved_for:
        lines.append(f"{setup.wcs} stands at machine {setup.solved_for}, and tools are as long as stated under Length: the "
                     "program is solved for nothing else")
    if setup.swings_in_words:
        lines.append(f"Turned by hand over {setup.swings_in_words} with the longest tool at the top: nothing meets hoses, cables, "
                     "clamps or doors")
    if setup.markers:
        lines.append("Markers " + ", ".join(name for name, _ in setup.markers) + " touched, and found where this sheet "
                     "puts them; if not, program posted anew with --measured")
    lines += [f"{row['number']} {row['name']} measured, length in the tool table, stick-out {row['stick_out']} {setup.units}, "
              f"holder {row['holder']}" for row in tool_rows(bundle, setup)]
    lines += [f"{words}; the rest for a ball that measures otherwise: cuspline repost"
              for words in edge_sets(bundle.verify, setup.name) if "changed before" in words]
    if unknown := not_checked(bundle.plan, setup.name):
        lines.append(f"Not checked, for nobody has stated the figures: {'; '.join(unknown)}")
    return lines + [
        f"Control reads {setup.units} and the loaded program is {setup.program_file}, "
        f"SHA-256 begins {setup.program_sha256[:16]}",
        f"Nothing stands in the way up to Z {lengths.decimal(setup.extents_mm[1][2])}",
        "First run: single block, rapids reduced, air cut above the stock"]


def _position_checklist(bundle, setup):
    """Of a position that the program turns to by itself."""
    held = next(c for c in clampings(bundle) if setup in c)
    before = held[held.index(setup) - 1].name
    first = next((line for line in setup.operation_first_lines if line), 0)
    line, turned = f"Before line {first} the" if first else "The", setup.turned_in_words.split(" degrees")[0]
    return [f"Nothing is set up anew: {setup.program_file} goes on from {before}, the part held as it is",
            f"{line} program turns to {turned}: hand on feed hold, reduced rapid, until the tool stands above the work again"]


def sheet_verdict(bundle):
    """(Verdict, accepted finding rows, open finding rows, the numbers behind it)."""
    rows = findings(bundle.verify)
    return (verdict(bundle.verify), [r for r in rows if r.is_accepted], [r for r in rows if not r.is_accepted],
            [(name, values[0]) for name, values in measure_rows(bundle)[1][:4]])


def wcs_drawing(bundle, setup):
    """SVG text: stock, fixtures, the part's edges in it, markers, and the WCS where the operator must find it; as it all stands
    on the machine, the clamping's Z up."""
    look = _projector(bundle, setup)
    low, high = np.asarray(setup.stock_box_mm, dtype=float)
    lines = [_polyline(look(edge), "part") for edge in bundle.mesh.edges_mm]
    lines += [_polyline(look(edge), "fixture") for _, edges in setup.fixtures for edge in edges]
    away = fixed.matmul(setup.as_it_stands.turn_into(setup.stock_edges_mm.reshape(-1, 3)), EYE).reshape(-1, 2)
    far = (away <= away.min(initial=np.inf) + SAME_MM).any(axis=1)
    drawn = look(setup.stock_edges_mm.reshape(-1, 3)).reshape(-1, 2, 2)
    lines += [_polyline(edge, style) for style, edges in (("hidden", drawn[far]), ("stock", drawn[~far]))
              for edge in seen_once(edges)]
    lines += [] if setup.is_held_as_before else _dimensions(look, setup, low, high)       # they stand on the first sheet
    lines += [mark for axis in setup.rotaries for mark in _axis_line(look, axis, AXIS_SHARE * float(fixed.length(high - low)))]
    lines += [mark for name, place in (*setup.markers, *setup.marked_for_later)
              for mark in _marked(look(setup.as_it_stands.out(np.array([place])))[0], name)]
    lines += _triad(look, setup, float(fixed.length(high - low)))
    style = (".part{stroke:#6b7785;stroke-width:.7}.fixture{stroke:#33669e;stroke-width:.7}.stock{stroke:#a8620c;stroke-width:1.3}"
             ".axis{stroke:#00796b;stroke-width:1;stroke-dasharray:12 3 2 3}.marker{fill:#fff;stroke:#7b1fa2;stroke-width:1.4}"
             ".hidden{stroke:#a8620c;stroke-width:.8;stroke-dasharray:4 3}polyline{fill:none}"
             "text{font:12px sans-serif;fill:#1b2330;paint-order:stroke;stroke:#fff;stroke-width:3px}")
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {DRAWING_WIDTH:g} {DRAWING_HEIGHT:g}" role="img">'
            f"<style>{style}</style>{''.join(lines)}</svg>")


def seen_once(edges):
    """Edges of a drawing, those that would lie on each other once: a casting's mesh has ten thousands.

    Args:
        edges: (n, 2, 2) ends in the drawing, SVG units.
    Returns:
        (k, 2, 2): long ones as they are, then short ones, their ends on the raster.
    """
    is_short = np.sqrt((np.diff(edges, axis=1)[:, 0] ** 2).sum(axis=1)) < SHORT
    snapped = np.round(edges[is_short] / RASTER) * RASTER
    snapped = np.where((snapped[:, 0] > snapped[:, 1]).any(axis=1)[:, None, None], snapped[:, ::-1], snapped)
    snapped = np.unique(snapped[(snapped[:, 0] != snapped[:, 1]).any(axis=1)], axis=0)
    return np.concatenate([edges[~is_short], snapped])


def _projector(bundle, setup):
    """A function (n, 3) part coordinates → (n, 2) places in the drawing, stock, part and fixtures filling it."""
    back = EYE / fixed.length(EYE)
    right = np.cross((0, 0, 1), back) / fixed.length(np.cross((0, 0, 1), back))
    axes = np.column_stack([right, -np.cross(back, right)])                # SVG's y runs down
    grid = lambda box: np.array([[box[i][0], box[j][1], box[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    places = [setup.frame.out(grid(setup.stock_box_mm)), grid(bundle.part_box_mm), *(e.reshape(-1, 3) for _, e in setup.fixtures)]
    seen = lambda points: fixed.matmul(setup.as_it_stands.turn_into(points), axes)
    flat = seen(np.vstack(places))
    low, size = flat.min(axis=0), np.ptp(flat, axis=0)
    margin = np.array([62.0, 44.0])                                        # for the triad and the dimensions
    scale = ((np.array([DRAWING_WIDTH, DRAWING_HEIGHT]) - 2 * margin) / np.maximum(size, 1e-9)).min()
    shift = (np.array([DRAWING_WIDTH, DRAWING_HEIGHT]) - scale * size) / 2
    return lambda points: (seen(np.atleast_2d(points)) - low) * scale + shift


def _axis_line(look, axis, half_mm):
    """A rotary axis: a chain line through the part, its letter and angle at the end that it turns right-handed about."""
    letter, degrees, (at, along) = axis
    along = along / fixed.length(along)
    ends = look(np.vstack([at - half_mm * along, at + half_mm * along]))
    return [_polyline(ends, "axis"), _text(ends[1] + (6, 4), letter if degrees is None else f"{letter}{degrees:g}°")]


def _marked(point, name):
    """A marker: a ring and its name."""
    return [f'<circle class="marker" cx="{point[0]:.1f}" cy="{point[1]:.1f}" r="3"/>', _text(point + (5, -4), name)]


def _polyline(points, style):
    return f'<polyline class="{style}" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}"/>'


def _text(point, words, attributes=""):
    return f'<text x="{point[0]:.1f}" y="{point[1]:.1f}" {attributes}>{html.escape(words)}</text>'


def _dimensions(look, setup, low, high):
    """Stock sizes at the middle of its front and left edges, outside."""
    at = lambda x, y, z: look(setup.frame.out(np.array([[x, y, z]])))[0]
    middle, short = (low + high) / 2, Lengths(setup.units).short
    return [_text(at(middle[0], low[1], low[2]) + (6, 18), f"X {short(high[0] - low[0])}"),
            _text(at(low[0], middle[1], low[2]) + (-10, 16), f"Y {short(high[1] - low[1])}", 'text-anchor="end"'),
            _text(at(high[0], low[1], middle[2]) + (8, 6), f"Z {short(high[2] - low[2])}")]


def _triad(look, setup, diagonal):
    """Three arrows at the WCS zero, and its name."""
    parts, length = [], 0.20 * diagonal
    zero = look(setup.frame.out(np.zeros((1, 3))))[0]
    for name, colour, direction in zip("XYZ", ("#c62828", "#1b7f3b", "#1a56c4"), np.eye(3)):
        tip = look(setup.frame.out(length * direction[None]))[0]
        along = (tip - zero) / max(fixed.length(tip - zero), 1e-9)
        across = np.array([-along[1], along[0]])
        barbs = np.array([tip, tip - 9 * along + 3.5 * across, tip - 9 * along - 3.5 * across])
        parts.append(f'<line x1="{zero[0]:.1f}" y1="{zero[1]:.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}" '
                     f'stroke="{colour}" stroke-width="2.4"/>'
                     f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in barbs)}" fill="{colour}"/>')
        parts.append(_text(tip + 9 * along + (-4, 4), name, f'style="fill:{colour};font-weight:bold"'))
    parts.append(f'<circle cx="{zero[0]:.1f}" cy="{zero[1]:.1f}" r="4" fill="#fff" stroke="#1b2330" stroke-width="1.5"/>')
    return parts + [_text(zero + (8, 17), setup.axes_name, 'style="font-weight:bold"')]
