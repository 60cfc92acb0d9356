"""What changed between two programs, in plan, as SVG: moves that are gone, moves that are new, the rest behind them."""

import numpy as np

from cuspline.program.move_changes import points_along
from cuspline.program.program import Kind

WIDTH_PX, MARGIN = 900.0, 0.06          # of the drawing; of its longer side, round it
CHORDS = 200                            # pieces that the longer side is long, arcs in chords
LAYERS = (("new", "rest", "#c4c9d0", 0.6), ("old", "gone", "#d1242f", 1.6), ("new", "come", "#1a7f37", 1.6))
CAPTION = {"gone": "gone", "come": "new", "rest": "unchanged"}


def picture(comparisons):
    """SVG (text) of the programs that differ, one below the other; "" where none does.

    Args:
        comparisons: comparison.ProgramComparison values.
    """
    drawn = [_drawing(p) for p in comparisons if p.changes.changes]
    if not drawn:
        return ""
    height = sum(h for _, h in drawn)
    parts, top = [], 0.0
    for inner, h in drawn:
        parts.append(f'<g transform="translate(0 {top:.1f})">{inner}</g>')
        top += h
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH_PX:.0f} {height:.1f}" font-family="sans-serif" '
            f'font-size="15"><rect width="100%" height="100%" fill="white"/>{"".join(parts)}</svg>\n')


def _drawing(program):
    """(SVG of one setup, its height in pixels); X to the right, Y up, as seen from the spindle."""
    rows = {"gone": program.changes.old_rows, "come": program.changes.new_rows,
            "rest": np.setdiff1d(np.arange(len(program.new)), program.changes.new_rows)}
    low, high = _box(program)
    size = np.maximum(high - low, 1e-3)
    margin = MARGIN * size.max()
    scale = WIDTH_PX / (size[0] + 2 * margin) if size[0] >= 0.3 * size[1] else 0.3 * WIDTH_PX / (size[0] + 2 * margin)
    place = lambda p: ((p[:, :2] - low + margin) * scale * (1, -1) + (0, (size[1] + 2 * margin) * scale))
    lines = []
    for side, layer, color, width in LAYERS:
        way = _path(getattr(program, side), rows[layer], size.max() / CHORDS, place)
        if way:
            lines.append(f'<path class="{layer}" d="{way}" fill="none" stroke="{color}" stroke-width="{width}"/>')
    height = float((size[1] + 2 * margin) * scale)
    words = "".join(f'<tspan fill="{color}" dx="14">{CAPTION[layer]}</tspan>' for _, layer, color, _ in LAYERS)
    box = f"X {low[0]:.1f} to {high[0]:.1f}, Y {low[1]:.1f} to {high[1]:.1f} mm"
    return (f'<g transform="translate(0 26)">{"".join(lines)}</g><text x="8" y="19">{program.setup}, {box}:{words}</text>',
            height + 30)


def _box(program):
    """((2,), (2,)) what the cutting moves of both span in plan."""
    ends = np.vstack([m.end_mm[m.kind != Kind.RAPID, :2] for m in (program.old, program.new)])
    return ends.min(axis=0), ends.max(axis=0)


def _path(moves, rows, every_mm, place):
    """Path data of some cutting moves, one begun anew where it does not go on."""
    words, before = [], None
    for row in rows.tolist():
        if moves.kind[row] == Kind.RAPID or not np.isfinite(moves.start_mm[row]).all():
            continue
        points = points_along(moves, row, every_mm) if moves.kind[row] > Kind.FEED else np.stack(
            [moves.start_mm[row], moves.end_mm[row]])
        drawn = place(points)
        if before != row - 1:
            words.append("M{:.1f} {:.1f}".format(*drawn[0]))
        words += ["L{:.1f} {:.1f}".format(*p) for p in drawn[1:]]
        before = row
    return "".join(words)
