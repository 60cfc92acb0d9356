"""Findings out of a replay: neighbouring moves are merged, each finding says what to do."""

from dataclasses import replace

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay.replay_kernel import LOW, RAPID
from cuspline.replay.replay_loads import of_tools
from cuspline.shop.kinematics import LINEARS
from cuspline.stock.path_pieces import ARC, LEVEL_ARC, pieces_of
from cuspline.values.amounts import counted
from cuspline.values.findings import Finding

NOISE_MM = 1e-6
TRAVEL_MM = 1e-6
RANGE_DEG = 1e-4          # half the last decimal of a rotary word, and a little
MANY = 12                 # runs of one kind in one operation that are still told apart
CONTACTS = (
    ("rapid_through_stock", "lift to the clearance height before this rapid, or make it a feed move"),
    ("shank_contact", "use a longer flute or reach, or a thinner shank, or rough this region before"),
    ("holder_contact", "raise the stick-out by at least this amount, or take a slimmer holder"),
    ("fixture_contact", "move it, lift the path over it, or take a longer tool"),
    ("rapid_too_low", "keep rapids this much higher above the stock, or go there at feed"),
)
DEEP_MM = 0.05            # a cutter's centre meets stock when it goes deeper: ridges between passes are lower
SIDEWAYS_MM = 0.01         # of a slot as deep, that a drill may seem to take sideways
IDLE_NODES = 400           # of the map under an operation that lowers none of them: it cuts air
PLUNGE_RAD = np.radians(45.0)    # a way down from here on is a plunge


def lowest_tips(geometry):
    """(m,) lowest tip of each piece; an arc below its centre hangs lower than its ends only at its lowest point."""
    low, u = np.minimum(geometry[:, 2], geometry[:, 5]), geometry[:, 6].astype(np.int64)
    rows = np.arange(len(geometry))
    bottom = ((geometry[:, 11] != 0) & (geometry[:, 10] < 0) & (geometry[rows, u] <= geometry[:, 7])
              & (geometry[:, 7] <= geometry[rows, 3 + u]))
    return np.where(bottom, geometry[:, 8] - geometry[:, 9], low)


def _summed(depth, goes_on):
    """(n,) depths summed over rows that follow one another, each run's sum at its last row that adds to it."""
    out, total, last = np.zeros(len(depth)), 0.0, -1
    for row in np.flatnonzero(~goes_on | (depth > 0)):
        if not goes_on[row]:
            total, last = 0.0, -1
            continue
        total += depth[row]
        if last >= 0:
            out[last] = 0.0
        out[row], last = total, row
    return out


def in_own_holes(posted, tools):
    """Rows of rapids by which drills come back, straight down, into what they have drilled at the same place."""
    deepest, rows = {}, []
    drills = [n for n, t in tools.items() if t.cutter.drills]
    for row in np.flatnonzero(np.isin(posted.tool, drills)).tolist():
        x, y, z = posted.end_mm[row].tolist()
        if not np.array_equal(posted.start_mm[row, :2], posted.end_mm[row, :2]):
            continue
        key = int(posted.tool[row]), round(x, 6), round(y, 6)
        if posted.kind[row] == Kind.FEED:
            deepest[key] = min(z, deepest.get(key, np.inf))
        elif z < posted.start_mm[row, 2] and z >= deepest.get(key, np.inf):
            rows.append(row)
    return np.array(rows, np.int64)


def _nearest(fixtures, place_mm):
    """The fixture whose box is nearest to a place (3,)."""
    beside = lambda f: np.maximum(np.maximum(np.array(f.min_mm) - place_mm, place_mm - np.array(f.max_mm)), 0.0)
    return min(fixtures, key=lambda f: float((beside(f) ** 2).sum()))


class Reporter:
    """Makes findings of one program; places in part coordinates."""

    def __init__(self, posted, setup, frame):
        self.posted, self.setup, self.frame = posted, setup, frame
        self.is_rapid = posted.kind == Kind.RAPID

    def place(self, point_mm):
        """A WCS point in part coordinates, rounded to 1e-6 mm; None where it is not known."""
        if not np.isfinite(point_mm).all():
            return None
        return tuple(float(v) for v in np.round(self.frame.out(np.asarray(point_mm)[None])[0], 6))

    def finding(self, kind, row, amount_mm, place_mm, advice):
        """One finding at one row of the program."""
        return Finding(kind=kind, amount_mm=round(float(amount_mm), 6), place_mm=self.place(place_mm),
                       operation=self.posted.operation_name(row), line=int(self.posted.line[row]),
                       setup=self.setup, advice=advice, row=int(row))

    def runs(self, flagged, relevant):
        """Row groups: flagged rows of one operation without an unflagged relevant row between them."""
        rows = np.flatnonzero(flagged | relevant)
        groups, last = [], None
        for row in rows:
            key = int(self.posted.operation[row]) if flagged[row] else None
            if key is not None and key == last:
                groups[-1].append(int(row))
            elif key is not None:
                groups.append([int(row)])
            last = key
        return groups

    def merged(self, kind, amount, places, relevant, advice):
        """One finding a run, at its worst row; amounts above 0 count.

        An operation with more than MANY runs of one kind gets one finding for all of them.
        """
        found = []
        for group in self._gathered(self.runs(amount > 0, relevant)):
            row = max(group, key=lambda r: (amount[r], -r))
            first, last = self.posted.line[group[0]], self.posted.line[group[-1]]
            text = advice if len(group) == 1 else f"{advice} ({len(group)} moves, lines {first} to {last})"
            found.append(self.finding(kind, row, amount[row], places[row], text))
        return found

    def _gathered(self, groups):
        """The runs, those of an operation that has too many of them put together."""
        by_operation = {}
        for group in groups:
            by_operation.setdefault(int(self.posted.operation[group[0]]), []).append(group)
        for runs in by_operation.values():
            yield from ([sum(runs, [])] if len(runs) > MANY else runs)

    def contacts(self, worst, fixtures=()):
        """Findings of worst (5, rows, 4): rapid, shank, holder, fixture, rapid too low; `fixtures`: of scene.Surroundings."""
        everything = np.ones(len(self.posted), dtype=bool)
        worst[LOW, worst[RAPID, :, 0] > NOISE_MM, 0] = 0.0          # it meets the stock: that is told
        for (kind, advice), table in zip(CONTACTS, worst):
            amount = np.where(table[:, 0] > NOISE_MM, table[:, 0], 0.0)
            relevant = self.is_rapid if kind.startswith("rapid") else everything
            for found in self.merged(kind, amount, table[:, 1:], relevant, advice):
                if kind == "fixture_contact" and fixtures:
                    found = replace(found, advice=f"{_nearest(fixtures, table[found.row, 1:]).name}: {found.advice}")
                yield found

    def not_proven(self, is_unsure):
        """Moves of which neither a contact with the stock nor its absence is shown."""
        for group in self._gathered(self.runs(is_unsure, np.ones(len(self.posted), dtype=bool))):
            yield self.finding("clearance_not_proven", group[0], 0.0, self.posted.end_mm[group[0]],
                               "keep neck, shank and holder farther from the stock here, a rapid higher above it: a "
                               f"longer reach, a thinner shank, a wider slot ({counted(len(group), 'move')})")

    def states(self, top_mm):
        """Spindle and tool length offset: both on whenever the tool feeds, the offset below the stock top too."""
        posted, feeds = self.posted, ~self.is_rapid
        low = np.fmin(posted.start_mm[:, 2], posted.end_mm[:, 2]) < top_mm
        turns = np.where(posted.pitch_mm < 0, -posted.spindle_rpm, posted.spindle_rpm) > 0     # a left-hand tap turns backwards
        for kind, wrong, relevant, advice in (
                ("no_spindle", feeds & ~turns, feeds, "start the spindle (M3 S) before this move"),
                ("no_length_offset", (feeds | low) & ~posted.length_offset_on, feeds | low,
                 "switch the tool length offset on (G43 H) before this move")):
            for group in self._gathered(self.runs(wrong, relevant)):
                yield self.finding(kind, group[0], 0.0, posted.end_mm[group[0]],
                                   advice + (f" ({len(group)} moves)" if len(group) > 1 else ""))

    def loads(self, found, tools):
        """Chips heavier than a cutter takes, and its centre sunk into stock; `found`: replay_loads.Loads."""
        posted, feeds = self.posted, ~self.is_rapid
        limit = of_tools(posted, tools, lambda c: c.deepest_slot_mm)
        drills = of_tools(posted, tools, lambda c: c.drills) > 0
        straight = (np.abs(posted.start_mm - posted.end_mm)[:, :2] <= NOISE_MM).all(axis=1)     # joints turned back are rounded
        sideways = feeds & drills & ~straight & (found.slot_mm > SIDEWAYS_MM)
        yield from self.merged("overload", np.where(sideways, found.slot_mm, 0.0), posted.end_mm, feeds,
                                "a drill is fed sideways through stock: it cuts along its axis alone; go up before going across")
        over = feeds & (limit > 0) & (found.sure_mm > limit) & ~drills
        yield from self.merged("overload", np.where(over, found.slot_mm, 0.0), posted.end_mm, feeds,
                                "the chips are as heavy as a slot of the cutter's full width and this depth, more than its "
                                "slot_depth_mm: rough here before, or take less at a time")
        steepest = of_tools(posted, tools, lambda c: c.steepest_rad)
        per_tooth = posted.feed_mm_per_min * found.fall / np.maximum(
            np.abs(posted.spindle_rpm) * of_tools(posted, tools, lambda c: c.flutes), 1.0)
        is_fast = (found.slope_rad > PLUNGE_RAD) & (per_tooth > of_tools(posted, tools, lambda c: c.largest_plunge_mm))
        steep = feeds & (found.slope_rad > 0) & ((found.slope_rad > steepest) | is_fast)
        depth = _summed(np.where(steep, found.plunge_mm, 0.0), steep | self.is_rapid)
        yield from self.merged("plunge", np.where(depth > DEEP_MM, depth, 0.0), posted.end_mm, feeds,
                                "the cutter's centre is sunk so deep into stock, steeper or faster than its ramp_deg and "
                                "plunge_mm_per_tooth allow: enter by a ramp, a helix or from outside")

    def idle(self, found, on_heads):
        """Operations that take nothing off the stock.

        Those too small for the map's nodes are not asked, nor those of `on_heads`, tool numbers: what a disc on a
        right-angle head takes is known of its last pass only.
        """
        posted = self.posted
        of_heads = posted.operation[np.isin(posted.tool, on_heads)]
        for number in np.setdiff1d(posted.operation[posted.operation >= 0], of_heads):
            rows = np.flatnonzero(posted.operation == number)
            if not found.takes[rows].any() and found.nodes[rows].sum() > IDLE_NODES:
                yield self.finding("idle_operation", rows[0], 0.0, posted.end_mm[rows[-1]],
                                   "it takes nothing off the stock that stands: leave it out, or look why its tool does not "
                                   "come down to the part")

    def unknown_starts(self, highest_mm, hanging_mm, machine=None):
        """Moves from or to an unknown place must stay above stock and fixtures all the way.

        `hanging_mm`: {number: how far a tool reaches below the place that is called its tip}, of those that do.
        `machine`: machines.Machine, asked for where its tools are changed.
        """
        posted = self.posted
        known = np.isfinite(posted.start_mm).all(axis=1) & np.isfinite(posted.end_mm).all(axis=1)
        low = np.fmin(posted.start_mm[:, 2], posted.end_mm[:, 2])      # NaN only if both are unknown
        low = low - np.array([hanging_mm.get(n, 0.0) for n in posted.tool.tolist()])
        unsafe = ~known & (posted.tool > 0) & ~(low >= highest_mm)
        if machine is not None and posted.rotary_deg.shape[1]:      # they turn first of all, at the tool change: no tip is known
            unsafe &= ~(posted.machine_end_mm[:, 2] >= machine.tool_change_height_mm - TRAVEL_MM)
        for group in self._gathered(self.runs(unsafe, ~known)):
            depth = highest_mm - low[group[0]]
            yield self.finding("unknown_start", group[0], depth if np.isfinite(depth) else 0.0,
                               posted.end_mm[group[0]],
                               f"retract to Z {highest_mm:.3f} or higher before the tool moves from a place "
                               "that the program has not stated")

    def travel(self, machine):
        """Machine coordinates against the axes' travels, between the ends of arcs too."""
        if machine is None:
            return
        low, high = self._machine_extremes()
        for k, (name, axis) in enumerate(zip("XYZ", machine.axes)):
            over = np.maximum(axis.min_mm - low[:, k], high[:, k] - axis.max_mm)
            amount = np.where(over > TRAVEL_MM, over, 0.0)
            yield from self.merged(
                "travel_exceeded", amount, self.posted.end_mm, np.ones(len(over), dtype=bool),
                f"{name} leaves its travel {axis.min_mm:g} .. {axis.max_mm:g} mm: move the part on the table or "
                "take another tool length")
        if self.posted.rotary_deg.shape[1]:
            yield from self._turning(machine)

    def _turning(self, machine):
        """Rotary axes against their ranges; a range in degrees has no millimetres."""
        chain, everything = machine.kinematics, np.ones(len(self.posted), dtype=bool)
        for k, letter in enumerate(machine.rotaries):
            low, high = np.degrees([chain.low[LINEARS + k], chain.high[LINEARS + k]])
            turned = self.posted.rotary_deg[:, k]
            over = np.nan_to_num(np.fmax(low - turned, turned - high), neginf=0.0)
            for group in self._gathered(self.runs(over > RANGE_DEG, everything)):
                worst = max(group, key=lambda r: (over[r], -r))
                yield self.finding("travel_exceeded", worst, 0.0, self.posted.end_mm[worst],
                                   f"{letter} stands at {turned[worst]:.4f} degrees, its range is {low:g} .. {high:g} degrees: "
                                   "turn the part, or lean the tool another way")

    def table(self, machine, tools, script, hanging_mm):
        """Tips, and what hangs lower, against the machine's table, all along the way; it reaches as far as the axes.

        Where rotary axes are off 0 the table lies elsewhere: there it is a body of the machine (replay/machine_bodies.py).
        """
        if machine is None:
            return
        geometry, row = script[:2]
        posted, low = self.posted, np.full(len(self.posted), np.inf)
        np.minimum.at(low, row, lowest_tips(geometry))
        length = np.array([tools[n].length_mm if n in tools else np.nan for n in posted.tool.tolist()])
        above = low + posted.machine_end_mm[:, 2] - posted.end_mm[:, 2] - length - machine.table_z_mm
        lowest = self._machine_extremes()[0][:, 2] if hanging_mm else None
        for number, hangs in hanging_mm.items():
            mine = posted.tool == number
            above[mine] = lowest[mine] - length[mine] - hangs - machine.table_z_mm
            low[mine] = posted.end_mm[mine, 2] - hangs
        depth = np.nan_to_num(-above, nan=0.0, posinf=0.0, neginf=0.0)
        depth[(posted.rotary_deg != 0).any(axis=1)] = 0.0
        places = np.column_stack([posted.end_mm[:, :2], low])
        yield from self.merged("fixture_contact", np.where(depth > NOISE_MM, depth, 0.0), places,
                                np.ones(len(posted), dtype=bool),
                                "the tip goes below the machine's table: mount the part higher, or lift the path")

    def _machine_extremes(self):
        """(n, 3) lowest and highest machine coordinates of each move."""
        posted = self.posted
        low, high = posted.machine_end_mm.copy(), posted.machine_end_mm.copy()
        arcs = np.flatnonzero(~self.is_rapid & (posted.kind != Kind.FEED))
        if not len(arcs):
            return low, high
        shift = posted.machine_end_mm - posted.end_mm
        pieces = pieces_of(posted, arcs, (ARC, LEVEL_ARC))
        for k in (0, 3):
            points = pieces.geometry[:, k:k + 3] + shift[pieces.row]
            np.minimum.at(low, pieces.row, points)
            np.maximum.at(high, pieces.row, points)
        return low, high

    def end(self):
        """The program must say that it ends."""
        if not self.posted.ended and len(self.posted):
            yield self.finding("not_ended", len(self.posted) - 1, 0.0, self.posted.end_mm[-1],
                               "end the program with M2 or M30")
        elif not self.posted.ended:
            yield Finding(kind="not_ended", amount_mm=0.0, place_mm=None, operation="", line=0, setup=self.setup,
                          advice="the program is empty; end it with M2 or M30")
