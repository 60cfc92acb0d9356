"""Physical states that no shop would run, put into a posted program, and edits that harm nobody.

A sabotage is a function (base, rng) -> Spoilt; a harmless edit (base, rng) -> text.  `base` is a `physical_programs.Base`,
or anything with its attributes: text, lines, moves, tools, machine, dialect, low_mm, high_mm, clearance_mm.  What is told
must hold one finding of the expected kind and line, and amount where one is given; what follows from it may be told too.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from cuspline.program.program import Kind, Plane

AMOUNT_MM = 2e-3          # post's decimals, touches, sampling of the oracle's paths
TOUCHED_MM = 0.1          # how high a steep wall touches a ball hangs on how finely both look
STEP_MM = 0.02            # between the oracle's tips along a move


@dataclass(frozen=True, kw_only=True)
class Spoilt:
    """A spoilt text, and what must be told of it."""

    text: str
    kind: str
    line: int | None = None           # None: wherever it begins
    amount_mm: float | None = None    # None: not known beforehand
    within_mm: float = AMOUNT_MM

    def is_told(self, findings):
        """Whether one of the findings is the expected one."""
        return any(f.kind == self.kind and self.line in (None, f.line) and
                   (self.amount_mm is None or abs(f.amount_mm - self.amount_mm) <= self.within_mm) for f in findings)


# places in the text -----------------------------------------------------------------------------------

def _with(base, line, new, gone=0):
    """Text with blocks put in behind a line (numbers from 1), `gone` lines after it left out."""
    return "\n".join([*base.lines[:line], *new, *base.lines[line + gone:]]) + "\n"


def _lines_like(base, pattern):
    return [k for k, text in enumerate(base.lines, 1) if re.search(pattern, text) and not text.startswith("(")]


def _retract(base):
    """Pattern of the block that goes to the top of the machine."""
    return r"^G53 G0 Z" if base.dialect == "linuxcnc" else r"^G91 G28 Z"


def _word(letter, value):
    return f"{letter}{value:.3f}"


def _row_of(base, line):
    """Last move made by a line or before it."""
    return int(np.flatnonzero(base.moves.line <= line)[-1])


def _own_lines(base):
    """{line: row} of moves whose line makes no other move."""
    lines, rows, counts = np.unique(base.moves.line, return_index=True, return_counts=True)
    return {int(k): int(row) for k, row, n in zip(lines, rows, counts) if n == 1}


def _raw_place(base, rng):
    """(line behind which the first tool stands over raw stock at the clearance height, its moves' row)."""
    own = _own_lines(base)
    feeds = np.flatnonzero(base.moves.kind != Kind.RAPID)
    for line, row in sorted(own.items()):
        z = base.moves.end_mm[row, 2]
        if row < feeds[0] and abs(z - base.clearance_mm) < 1e-6 and re.match(r"G[0123]\b", base.lines[line]):
            return line, row
    raise AssertionError("the program has no block at the clearance height before its first cut")


def _excursion(base, rng, blocks, at=None):
    """Text with blocks run from the clearance height over a place of raw stock; line of the first of them."""
    line, row = _raw_place(base, rng)
    low, high = np.array(base.low_mm), np.array(base.high_mm)
    radius = base.tools[int(base.moves.tool[row])].cutter.radius_mm
    x, y = rng.uniform(low[:2] + radius + 1, high[:2] - radius - 1) if at is None else at
    here = base.moves.end_mm[row]
    up = f"G0 {_word('Z', base.clearance_mm)}"
    new = [f"G0 {_word('X', x)} {_word('Y', y)}", *blocks(x, y), up, f"G0 {_word('X', here[0])} {_word('Y', here[1])}"]
    return _with(base, line, new), line + 2


def _tool_of_raw(base):
    _, row = _raw_place(base, None)
    return base.tools[int(base.moves.tool[row])].cutter


# the oracle: what stands under a tool, from nothing but sampled tips -----------------------------------

def _tips(moves, row):
    """(n, 3) tips along one move."""
    start, end, center = moves.start_mm[row], moves.end_mm[row], moves.center_mm[row]
    if moves.kind[row] < Kind.ARC_CW:
        count = int(np.linalg.norm(end - start) / STEP_MM) + 2
        return start + np.linspace(0, 1, count)[:, None] * (end - start)
    i, j, k = Plane(int(moves.plane[row])).axes
    a0, a1 = (np.arctan2(p[j] - center[j], p[i] - center[i]) for p in (start, end))
    turn = (a1 - a0) % (2 * np.pi) if moves.kind[row] == Kind.ARC_CCW else -((a0 - a1) % (2 * np.pi))
    radius = np.hypot(start[i] - center[i], start[j] - center[j])
    share = np.linspace(0, 1, int(abs(turn) * radius / STEP_MM) + 2)
    out = np.empty((len(share), 3))
    out[:, i], out[:, j] = center[i] + radius * np.cos(a0 + share * turn), center[j] + radius * np.sin(a0 + share * turn)
    out[:, k] = start[k] + share * (end[k] - start[k])
    return out


def _bottom(cutter, d):
    """Height of a cutter's bottom over its tip at distances from the axis; inf beyond it."""
    corner = cutter.corner_radius_mm
    out = np.clip(d - (cutter.radius_mm - corner), 0.0, corner)
    return np.where(d <= cutter.radius_mm, corner - np.sqrt(corner ** 2 - out ** 2), np.inf)


def depth_touched_mm(base, row):
    """How far the tool reaches, after a move, below the highest stock within 0.01 mm of it; -inf: it touches none."""
    moves, cutter = base.moves, base.tools[int(base.moves.tool[row])].cutter
    tip, r = moves.end_mm[row], cutter.radius_mm
    rings = np.concatenate([np.linspace(0, r, 20), [r + 0.01]])
    turn = 2 * np.pi * (np.arange(64) / 64)
    xy = (tip[:2] + rings[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])).reshape(-1, 2)
    inside = ((xy >= np.array(base.low_mm)[:2]) & (xy <= np.array(base.high_mm)[:2])).all(axis=1)
    height = np.where(inside, base.high_mm[2], -np.inf)
    for k in range(row + 1):
        number = int(moves.tool[k])
        ends = np.array([moves.start_mm[k], moves.end_mm[k]])
        is_above = moves.kind[k] < Kind.ARC_CW and ends[:, 2].min() > base.high_mm[2]
        if number not in base.tools or not np.isfinite(ends).all() or is_above:
            continue
        mine = base.tools[number].cutter
        tips = _tips(moves, k)
        near = np.abs(tips[:, :2] - tip[:2]).max(axis=1) <= r + mine.radius_mm + 0.1
        for part in np.array_split(tips[near], max(1, int(near.sum()) // 2000)):
            if len(part):
                d = np.hypot(*(xy[:, None] - part[None, :, :2]).transpose(2, 0, 1))
                height = np.minimum(height, (part[:, 2] + _bottom(mine, d)).min(axis=1))
    below = np.repeat(np.append(_bottom(cutter, rings[:-1]), cutter.corner_radius_mm), 64)
    touches = height > tip[2] + below - 0.01
    return max(float(height[touches].max() - tip[2]), 0.0) if touches.any() else -np.inf


def _in_the_cut(base, rng, least_mm=0.3):
    """(line, row, depth) of a feed move at whose end the flutes touch stock."""
    own = _own_lines(base)
    rows = [(line, row) for line, row in own.items() if base.moves.kind[row] != Kind.RAPID and row + 1 < len(base.moves)
            and base.moves.end_mm[row, 2] < base.high_mm[2] - least_mm
            and (np.abs(base.moves.end_mm[row, :2] - (np.array(base.low_mm) + base.high_mm)[:2] / 2)
                 < (np.array(base.high_mm) - base.low_mm)[:2] / 2).all()]
    for pick in rng.permutation(len(rows)):
        depth = depth_touched_mm(base, rows[pick][1])
        if depth >= least_mm:
            return *rows[pick], depth
    return None


def _cut_short(base, rng):
    """A lane halved, so that the program has a block that ends within the stock: (base, line, row, depth)."""
    own = _own_lines(base)
    found = _in_the_cut(base, rng)
    if found is not None:
        return base, *found
    moves, middle = base.moves, (np.array(base.low_mm) + base.high_mm) / 2
    rows = [(line, row) for line, row in own.items() if moves.kind[row] == Kind.FEED
            and abs(moves.end_mm[row, 0] - moves.start_mm[row, 0]) > 20 and moves.end_mm[row, 2] < base.high_mm[2] - 0.3
            and base.low_mm[1] < moves.end_mm[row, 1] < base.high_mm[1]]
    line, row = rows[int(rng.integers(len(rows)))]
    x = middle[0] + rng.uniform(-0.3, 0.3) * (base.high_mm[0] - base.low_mm[0])
    word = re.search(r"X(-?[\d.]+)", base.lines[line - 1])[0]
    block = base.lines[line - 1].replace(word, _word("X", x))
    halved = replace(base, text=_with(base, line - 1, [block, f"G1 {word}"], gone=1))
    row = _own_lines(halved)[line]
    return halved, line, row, depth_touched_mm(halved, row)


# sabotages ---------------------------------------------------------------------------------------------

def tool_change_near_the_work(base, rng):
    """The retract before a tool change goes to some height above the work, not to the top of the machine."""
    change = _lines_like(base, r"\bM6\b")[1]
    retract = max(k for k in _lines_like(base, _retract(base)) if k < change)
    tip = base.high_mm[2] + rng.uniform(5, 60)
    row = _row_of(base, retract - 1)
    length = base.tools[int(base.moves.tool[row])].length_mm
    text = _with(base, retract - 1, [f"G90 G0 {_word('Z', tip)}"], gone=1)
    nose = float(f"{tip:.3f}") + length + base.machine.wcs_origin_mm[2]
    return Spoilt(text=text, kind="tool_change_low", line=change, amount_mm=base.machine.tool_change_height_mm - nose)


def tool_change_without_a_retract(base, rng):
    """The retract before the first tool change is missing: nobody knows where the spindle stands."""
    change, retract = _lines_like(base, r"\bM6\b")[0], _lines_like(base, _retract(base))[0]
    return Spoilt(text=_with(base, retract - 1, [], gone=1), kind="tool_change_low", line=change - 1, amount_mm=0.0)


def stop_at_the_clearance_height(base, rng):
    """M0 or M1 with the tool a few millimetres above the stock."""
    own = _own_lines(base)
    lines = [line for line, row in own.items() if base.moves.kind[row] == Kind.RAPID and np.isfinite(base.moves.end_mm[row]).all()
             and abs(base.moves.end_mm[row, 2] - base.clearance_mm) < 1e-6]
    line = lines[int(rng.integers(len(lines)))]
    return Spoilt(text=_with(base, line, [rng.choice(["M0", "M1"])]), kind="stop_low", line=line + 1,
                  amount_mm=base.machine.stop_clearance_mm - (base.clearance_mm - base.high_mm[2]))


def stop_in_the_cut(base, rng):
    """M0 or M1 between two blocks of a cut."""
    base, line, row, _ = _cut_short(base, rng)
    return Spoilt(text=_with(base, line, [rng.choice(["M0", "M1"])]), kind="stop_low", line=line + 1,
                  amount_mm=base.machine.stop_clearance_mm + base.high_mm[2] - base.moves.end_mm[row, 2])


def end_near_the_work(base, rng):
    """The program ends a few millimetres above the work."""
    end, retract = _lines_like(base, r"^M(2|30)$")[-1], _lines_like(base, _retract(base))[-1]
    above = rng.uniform(5.0, 20.0)
    text = _with(base, retract - 1, [f"G90 G0 {_word('Z', base.high_mm[2] + above)}"], gone=1)
    return Spoilt(text=text, kind="stop_low", line=end, amount_mm=base.machine.stop_clearance_mm - above)


def end_in_the_cut(base, rng):
    """Everything behind a block of a cut is gone but the end of the program."""
    base, line, _, depth = _cut_short(base, rng)
    end = _lines_like(base, r"^M(2|30)$")[-1]
    text = _with(base, line, [base.lines[end - 1]], gone=end - line)
    return Spoilt(text=text, kind="ends_in_cut", line=line + 1, amount_mm=depth, within_mm=TOUCHED_MM)


def spindle_stopped_in_the_cut(base, rng):
    """M5 between two blocks of a cut; it runs again before the next one."""
    base, line, _, depth = _cut_short(base, rng)
    return Spoilt(text=_with(base, line, ["M5", "M3"]), kind="no_spindle", line=line + 1, amount_mm=depth, within_mm=TOUCHED_MM)


def spindle_reversed_in_the_cut(base, rng):
    """M4 in place of M3 between two blocks of a cut, and back."""
    base, line, _, depth = _cut_short(base, rng)
    return Spoilt(text=_with(base, line, ["M4", "M3"]), kind="no_spindle", line=line + 1, amount_mm=depth, within_mm=TOUCHED_MM)


def rapid_over_raw_stock(base, rng):
    """A rapid across raw stock at less than the clearance of rapids; every third at 0.00 mm."""
    over = 0.0 if rng.random() < 1 / 3 else float(f"{rng.uniform(0.01, base.machine.rapid_clearance_mm - 0.01):.3f}")
    way = lambda x, y: [f"G0 {_word('Z', base.high_mm[2] + over)}", f"G0 {_word('X', (base.low_mm[0] + base.high_mm[0]) / 2)}"]
    text, line = _excursion(base, rng, way)
    return Spoilt(text=text, kind="rapid_too_low", line=line, amount_mm=base.machine.rapid_clearance_mm - over)


def rapid_into_raw_stock(base, rng):
    """A rapid straight down into raw stock."""
    depth = rng.uniform(0.05, 3.0)
    text, line = _excursion(base, rng, lambda x, y: [f"G0 {_word('Z', base.high_mm[2] - depth)}"])
    return Spoilt(text=text, kind="rapid_through_stock", line=line, amount_mm=depth)


def plunge_into_solid(base, rng):
    """A flat or bull-nose cutter that does not cut at its centre goes straight down into solid at 2750 mm/min."""
    depth = rng.uniform(0.3, 0.25 * _tool_of_raw(base).diameter_mm)
    z = base.high_mm[2]
    text, line = _excursion(base, rng, lambda x, y: [f"G0 {_word('Z', z + 1)}", f"G1 {_word('Z', z - depth)} F2750."])
    return Spoilt(text=text, kind="plunge", line=line + 1, amount_mm=depth)


def ramp_too_steep(base, rng):
    """The same on a slope of 15 to 60 degrees."""
    depth, slope = rng.uniform(0.8, 2.0), np.radians(rng.uniform(15, 60))
    z, middle = base.high_mm[2], (base.low_mm[0] + base.high_mm[0]) / 2
    inward = lambda x: np.copysign(depth / np.tan(slope), middle - x)
    text, line = _excursion(base, rng, lambda x, y: [
        f"G0 {_word('Z', z + 1)}", f"G1 {_word('Z', z)} F500.",
        f"G1 {_word('X', x + inward(x))} {_word('Z', z - depth)}"])
    return Spoilt(text=text, kind="plunge", line=line + 2, amount_mm=depth)


def slot_too_deep(base, rng):
    """A slot of full width, deeper than the cutter takes and still within its flutes."""
    cutter = _tool_of_raw(base)
    depth = rng.uniform(0.45 * cutter.diameter_mm, min(0.9 * cutter.flute_length_mm, base.high_mm[2] - base.low_mm[2] - 2))
    y = rng.uniform(base.low_mm[1] + cutter.diameter_mm, base.high_mm[1] - cutter.diameter_mm)
    x0, x1 = base.low_mm[0] - cutter.radius_mm - 2, base.high_mm[0] + cutter.radius_mm + 2
    text, line = _excursion(base, rng, lambda x, y: [
        f"G1 {_word('Z', base.high_mm[2] - depth)} F500.", f"G1 {_word('X', x1)} F800."], at=(x0, y))
    # a corner leaves a little; the replay's nodes add up to one strip
    return Spoilt(text=text, kind="overload", line=line + 1, amount_mm=depth, within_mm=0.12 * depth)


def without_roughing(base, rng):
    """The operations of all flat and bull-nose cutters are gone: a ball meets the full stock."""
    starts = [k for k, text in enumerate(base.lines, 1) if text.startswith("(OPERATION")]
    number = {k: int(re.search(r", T(\d+)", base.lines[k - 1])[1]) for k in starts}
    first = next(k for k in starts if base.tools[number[k]].cutter.type == "ball")
    return Spoilt(text=_with(base, starts[0] - 1, [], gone=first - starts[0]), kind="overload")


SABOTAGES = (tool_change_near_the_work, tool_change_without_a_retract, stop_at_the_clearance_height, stop_in_the_cut,
             end_near_the_work, end_in_the_cut, spindle_stopped_in_the_cut, spindle_reversed_in_the_cut, rapid_over_raw_stock,
             rapid_into_raw_stock, plunge_into_solid, ramp_too_steep, slot_too_deep, without_roughing)


# harmless edits ----------------------------------------------------------------------------------------

def slower_feed(base, rng):
    share = rng.uniform(0.2, 0.9)
    return _words_changed(base, "F", lambda f: f"{f * share:.1f}")


def higher_clearance(base, rng):
    lift = rng.uniform(1, 15)
    return _words_changed(base, "Z", lambda z: f"{z + lift:.3f}" if abs(z - base.clearance_mm) < 1e-6 else None)


def higher_approach(base, rng):
    """Rapids end half a millimetre farther above the stock."""
    return _words_changed(base, "Z", lambda z: f"{z + 0.5:.3f}" if base.high_mm[2] < z < base.clearance_mm - 0.6 else None)


def retract_twice_before_a_tool_change(base, rng):
    """Up to the clearance of stops first, then to the top of the machine."""
    line = _lines_like(base, _retract(base))[1]
    return _with(base, line - 1, [f"G90 G0 {_word('Z', base.high_mm[2] + rng.uniform(30, 60))}"])


def stop_at_the_top(base, rng):
    """M1 with the spindle at the top of the machine."""
    return _with(base, _lines_like(base, _retract(base))[1], ["M1"])


def stop_high_above(base, rng):
    """M0 far above the work."""
    line, row = _raw_place(base, rng)
    up = base.high_mm[2] + base.machine.stop_clearance_mm + rng.uniform(0.1, 40)
    return _with(base, line, [f"G0 {_word('Z', up)}", "M0", f"G0 {_word('Z', base.clearance_mm)}"])


def tool_change_twice(base, rng):
    """The same tool once more, at the top of the machine."""
    line = _lines_like(base, r"\bM6\b")[1]
    return _with(base, line, [base.lines[line - 1]])


def spindle_stopped_in_the_air(base, rng):
    """At the clearance height, and on again."""
    line, _ = _raw_place(base, rng)
    return _with(base, line, ["M5", "M3"])


def dwell_and_coolant(base, rng):
    line, _ = _raw_place(base, rng)
    return _with(base, line, ["G4 P0.5" if base.dialect == "linuxcnc" else "G4 P500", "M9", "M8"])


def comments(base, rng):
    lines = [line for k in base.lines for line in ((k,) if k.startswith(("%", "O", "(")) else (k, "(NOTE)"))]
    return "\n".join(lines) + "\n"


def shallow_slot(base, rng):
    """Full width, a share of what the cutter takes."""
    cutter, depth = _tool_of_raw(base), rng.uniform(0.05, 0.25) * _tool_of_raw(base).diameter_mm
    x0, x1 = base.low_mm[0] - cutter.radius_mm - 2, base.high_mm[0] + cutter.radius_mm + 2
    return _excursion(base, rng, lambda x, y: [
        f"G1 {_word('Z', base.high_mm[2] - depth)} F500.", f"G1 {_word('X', x1)} F800."],
        at=(x0, rng.uniform(base.low_mm[1], base.high_mm[1])))[0]


def ramp_as_planned(base, rng):
    """Into solid at 3 degrees."""
    z, (x0, x1) = base.high_mm[2], (base.low_mm[0] + 8, base.high_mm[0] - 8)
    fall = (x1 - x0) * np.tan(np.radians(rng.uniform(1, 3)))
    return _excursion(base, rng, lambda x, y: [
        f"G0 {_word('Z', z + 1)}", f"G1 {_word('Z', z)} F500.", f"G1 {_word('X', x1)} {_word('Z', z - min(fall, 1.5))}",
        f"G1 {_word('X', x0)}"], at=(x0, rng.uniform(base.low_mm[1] + 5, base.high_mm[1] - 5)))[0]


def rapid_just_high_enough(base, rng):
    """Across raw stock, a little more than the clearance of rapids above it."""
    over = base.machine.rapid_clearance_mm + rng.uniform(0.01, 0.5)
    return _excursion(base, rng, lambda x, y: [
        f"G0 {_word('Z', base.high_mm[2] + over)}", f"G0 {_word('X', (base.low_mm[0] + base.high_mm[0]) / 2)}"])[0]


def touch_at_feed(base, rng):
    """Down onto raw stock at feed, and straight up in rapid."""
    z = base.high_mm[2]
    return _excursion(base, rng, lambda x, y: [f"G0 {_word('Z', z + 1)}", f"G1 {_word('Z', z)} F100."])[0]


def plunge_where_it_is_cut(base, rng):
    """A slot in from outside, then straight down into it again at feed."""
    cutter, z = _tool_of_raw(base), base.high_mm[2]
    x0, x1, depth = base.low_mm[0] - cutter.radius_mm - 2, base.high_mm[0] - 15, 0.1 * cutter.diameter_mm
    return _excursion(base, rng, lambda x, y: [
        f"G1 {_word('Z', z - depth)} F500.", f"G1 {_word('X', x1)} F800.", f"G0 {_word('Z', z + 1)}",
        f"G1 {_word('Z', z - depth)} F300."], at=(x0, rng.uniform(base.low_mm[1] + 6, base.high_mm[1] - 6)))[0]


def end_high_above(base, rng):
    """The program ends high above the work, below the top of the machine."""
    retract = _lines_like(base, _retract(base))[-1]
    up = base.high_mm[2] + base.machine.stop_clearance_mm + rng.uniform(1, 60)
    return _with(base, retract - 1, [f"G90 G0 {_word('Z', up)}"], gone=1)


HARMLESS = (slower_feed, higher_clearance, higher_approach, retract_twice_before_a_tool_change, stop_at_the_top, stop_high_above,
            tool_change_twice, spindle_stopped_in_the_air, dwell_and_coolant, comments, shallow_slot, ramp_as_planned,
            rapid_just_high_enough, touch_at_feed, plunge_where_it_is_cut, end_high_above)


def _words_changed(base, letter, change):
    """All words of a letter outside comments and machine coordinates; change(value) -> text, or None to leave it."""
    def word(found):
        new = change(float(found[1]))
        return found[0] if new is None else letter + new
    return "\n".join(line if line.startswith("(") or re.match(r"G53|G91", line) else re.sub(letter + r"(-?[\d.]+)", word, line)
                     for line in base.lines) + "\n"
