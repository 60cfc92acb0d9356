"""Axes that clear what is in the way, chosen run by run: one bearing each, turned evenly, within what the rotaries follow.

Stations that no axis clears are left out of the passes, and are listed: their area, and the cutter that would reach them.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from cuspline.replay.clearance_kernels import BOTTOM, BOTTOM_RADIUS, TOP, TOP_RADIUS
from cuspline.shop.rotary_way import shortest_way
from cuspline.toolpaths.five_axis.clear_axes import toward, turned
from cuspline.toolpaths.five_axis.even_turns import even_angles, runs_of_least_turn, runs_of_one_bearing
from cuspline.toolpaths.five_axis.leaning_moves import Stations, Swing, Turn, stations_along
from cuspline.values.amounts import counted
from cuspline.values.errors import PostError, ToolpathError
from cuspline.values.rows import X, Y, Z

SPACING = 0.25              # of the radius, between stations
CHANGE_RAD = 5.0            # of all stations' angles: a change of bearing between them counts as much, for it costs a lift
OPEN_SHARE = 0.2            # of a piece's stations at the most, seen from where it now begins, that nothing clears
IN_PLANE = (0.0, math.pi)   # bearings in the plane of axis and normal
ALL_WAYS = (*IN_PLANE, math.pi / 2, -math.pi / 2, math.pi / 4, -math.pi / 4, 3 * math.pi / 4, -3 * math.pi / 4)
FINER_WAYS = tuple(math.radians(d) for d in range(-165, 180, 15) if d % 45)     # where none of these clears
WINDOWS = (1, 2, 4, 8, 16, 32, 64)      # stations over which a turn is evened out, the narrowest first
STILL_RAD = 1e-4            # a rotary that goes back by less has not turned round
MOST_LOOKED_AT = 24         # of blocked stations, for the cutter that would reach them
LONGER_MM = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0)
SLIMMER = (0.75, 0.5, 0.35, 0.25)
SAME_MM = 1e-9


class Blocked(ToolpathError):
    """No one bearing clears a whole run; `.runs`: which."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RotaryUse:
    """What a run asks of a machine's rotaries at the feed wanted."""

    chain: object               # shop.kinematics.Chain
    clamped: object             # function (n, 3) -> (n, 3): axes as the machine sees them
    feed_mm_per_s: float

    def of(self, axes, along_mm):
        """(largest share of a speed or acceleration limit, reversals of rotaries) of axes (n, 3) at lengths (n,)."""
        try:
            angles = shortest_way(self.chain, self.clamped(axes)).angles
        except PostError:
            return math.inf, 0
        speed, acceleration = self.chain.speed[-angles.shape[1]:], self.chain.acceleration[-angles.shape[1]:]
        seconds = np.maximum(np.diff(along_mm), 1e-9)[:, None] / self.feed_mm_per_s
        rate = np.diff(angles, axis=0) / seconds
        change = np.diff(rate, axis=0) / np.minimum(seconds[1:], seconds[:-1])
        share = max(float((np.abs(rate) / speed).max(initial=0.0)), float((np.abs(change) / acceleration).max(initial=0.0)))
        return share, sum(_reversals(angles[:, k]) for k in range(angles.shape[1]))


def _reversals(angles):
    """How often a rotary turns round.

    >>> _reversals(np.array([0.0, 0.1, 0.1, 0.3, 0.2, 0.4]))
    2
    """
    steps = np.diff(angles)
    way = np.sign(steps[np.abs(steps) > STILL_RAD])
    return int((way[1:] != way[:-1]).sum())


class ClearingSwing(Swing):
    """Turns of runs by the smallest angles that clear them."""

    def __init__(self, search, axis, use, open_share=0.0):
        """
        Args:
            search: AxisSearch.   axis: tool_axes.ClearingAxis.   use: RotaryUse.
            open_share: of a run's stations that may be bridged by their neighbours' angles; the proof of the moves decides.
        """
        self.search, self.axis, self.use, self.open_share = search, axis, use, open_share
        self.spacing_mm, self.most_rad = SPACING * search.radius_mm, math.radians(axis.up_to_deg)

    def least_rad(self, stations, bearings, most_rad):
        """(n, b) smallest clearing angles of Stations toward bearings, up to `most_rad`; inf: none."""
        is_clear = self.search.is_clear(stations.middle_mm, stations.axis)
        least, in_way = np.zeros((len(is_clear), len(bearings))), ~is_clear
        for k, bearing in enumerate(bearings):
            ways = toward(stations.axis, stations.zero, np.full(len(is_clear), bearing))
            least[in_way, k] = self.search.angles_rad(stations.middle_mm[in_way], stations.axis[in_way], ways[in_way], most_rad)
        return least

    def bearings_of(self, stations, is_thorough=True):
        """(bearings, (n, b) least angles); across the plane, where that is allowed, no farther than the plane alone asks for.

        is_thorough: the finer bearings too where nothing else clears.
        """
        least = self.least_rad(stations, IN_PLANE, self.most_rad)
        farthest = least.max(axis=0).min()
        if not self.axis.both_angles or farthest == 0.0:
            return IN_PLANE, least
        wider = lambda least, ways: np.hstack([least, self.least_rad(stations, ways, min(farthest, self.most_rad))])
        least = wider(least, ALL_WAYS[len(IN_PLANE):])
        if not is_thorough or np.isfinite(least).any(axis=1).all():
            return ALL_WAYS, least
        return (*ALL_WAYS, *FINER_WAYS), wider(least, FINER_WAYS)

    def turns(self, runs):
        found = [self._turn(stations) for stations in runs]
        if any(turn is None for turn in found):
            blocked = [k for k, turn in enumerate(found) if turn is None]
            raise Blocked(f"no tool axis clears {counted(len(blocked), 'run')} from end to end", rows=np.array(blocked))
        return found

    def _turn(self, stations):
        """Turn of a run; None: none clears all of it."""
        bearings, least = self.bearings_of(stations, is_thorough=self.open_share > 0.0)
        is_open = np.isinf(least)
        fewest = is_open.sum(axis=0).min()
        if fewest > self.open_share * len(least):
            return None
        best = np.flatnonzero(is_open.sum(axis=0) == fewest)
        bearing = best[np.argmin(np.where(is_open, 0.0, least)[:, best].max(axis=0))]
        known = ~is_open[:, bearing]
        angles = np.interp(stations.along_mm, stations.along_mm[known], least[known, bearing])
        even = self._even(stations, angles, bearings[bearing])
        return Turn(along_mm=stations.along_mm, angle_rad=even, zero=stations.zero, bearing_rad=bearings[bearing])

    def _even(self, stations, least, bearing):
        """(n,) angles, clear everywhere, within what the rotaries follow at the feed or as near to it as they come."""
        if not least.any():
            return least
        best, best_share = least, math.inf
        was_clear = self.search.is_clear(stations.middle_mm, self.axes(stations, least, bearing))
        for window in WINDOWS:
            if window > len(least):
                break
            angles = np.minimum(even_angles(least, window), np.maximum(self.most_rad, least))
            axes = self.axes(stations, angles, bearing)
            if (was_clear & ~self.search.is_clear(stations.middle_mm, axes)).any():
                continue
            share, _ = self.use.of(axes, stations.along_mm)
            if share < best_share:
                best, best_share = angles, share
            if share <= 1.0:
                break
        return best

    def axes(self, stations, angles, bearing):
        """(n, 3) axes of Stations turned toward one bearing."""
        return turned(stations.axis, toward(stations.axis, stations.zero, np.full(len(angles), bearing)), angles)


@dataclass(frozen=True, eq=False, kw_only=True)
class Split:
    """Passes as far as some axis clears them, and what was left out."""

    paths: list                 # of lists of TipPath
    contact_mm: np.ndarray      # (n, 3) of all stations
    is_blocked: np.ndarray      # (n,) bool
    blocked: object             # Stations of them, one after the other; None: nothing


def looked_at(runs, swing, rules):
    """What clears the stations of passes.

    Args:
        runs: lists of TipPath.   swing: ClearingSwing.   rules: LeaningRules without a swing.
    Returns:
        [(TipPaths, their Stations, their least angles (n, b))] of every run, b the same for all.
    """
    found = []
    for paths in runs:
        stations = stations_along([p.tips_mm for p in paths], rules, swing.spacing_mm)
        found.append((paths, stations, [_of_all_ways(swing.bearings_of(s)[1]) for s in stations]))
    return found


def _of_all_ways(least):
    """(n, every bearing) of angles toward the first of them: a station that is clear as it stands is so toward all, others are
    not known to be."""
    other = np.where((least == 0.0).any(axis=1), 0.0, np.inf)[:, None]
    return np.hstack([least, np.broadcast_to(other, (len(least), len(ALL_WAYS) + len(FINER_WAYS) - least.shape[1]))])


def split(looked, rules, goes_on=False):
    """Cut passes where no axis, or no one axis' bearing, clears them.

    Args:
        looked: of `looked_at`.   rules: LeaningRules.
        goes_on: one bearing may go on from pass to pass; then each run of the Split has one.
    Returns:
        Split.
    """
    kept, contacts, is_blocked, left = [], [], [], []
    for paths, stations, least in looked:
        ends = np.cumsum([0, *(len(s.along_mm) for s in stations)])
        stretches = runs_of_least_turn(np.vstack(least), CHANGE_RAD) if goes_on and paths else [
            (first + begin, last + begin, k) for rows, begin in zip(least, ends) for first, last, k in runs_of_one_bearing(rows)]
        blocked, groups = np.ones(ends[-1], bool), []
        for first, last, _ in stretches:
            blocked[first:last + 1] = False
            groups.append(_pieces(paths, stations, ends, first, last))
        kept += [g for g in groups if g] if goes_on else [[piece for g in groups for piece in g]]
        is_blocked.append(blocked)
        for of_path, begin in zip(stations, ends):
            mine = blocked[begin:begin + len(of_path.along_mm)]
            contacts.append(of_path.middle_mm - rules.radius_mm * of_path.normal)
            if mine.any():
                left.append(of_path.of(mine))
    return Split(paths=kept, contact_mm=np.vstack(contacts), is_blocked=np.concatenate(is_blocked),
                 blocked=Stations.joined(left) if left else None)


def _pieces(paths, stations, ends, first, last):
    """[TipPath] of passes between two of their stations, counted from pass to pass."""
    found = []
    for path, of_path, begin in zip(paths, stations, ends):
        low, high = max(first - begin, 0), min(last - begin, len(of_path.along_mm) - 1)
        if high > low:
            found.append(_piece(path, of_path.along_mm[low], of_path.along_mm[high]))
    return found


def _piece(path, start_mm, end_mm):
    """TipPath of one between two lengths."""
    tips = path.tips_mm
    at = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(tips, axis=0) ** 2).sum(axis=1)))])
    if start_mm <= 0.0 and end_mm >= at[-1]:
        return path
    inner = at[(at > start_mm) & (at < end_mm)]
    lengths = np.concatenate([[start_mm], inner, [end_mm]])
    found = np.column_stack([np.interp(lengths, at, tips[:, k]) for k in (X, Y, Z)])
    return replace(path, tips_mm=found, is_closed=False)


def clearing_facts(turns, left=None):
    """For plan.json: how far and over what length the axis turns from its standard direction, and what nothing clears."""
    most = max((float(t.angle_rad.max()) for t in turns), default=0.0)
    length = sum(float((np.diff(t.along_mm) * (np.maximum(t.angle_rad[1:], t.angle_rad[:-1]) > 0.0)).sum()) for t in turns)
    facts = {"largest_deg": round(math.degrees(most), 3), "turned_mm": round(length, 3)}
    if left is not None:
        facts |= {"left_mm2": round(left.area_mm2, 3), "why": left.why, "reached_by": None if left.reaching is None else {
            "diameter_mm": left.reaching[0], "stick_out_mm": left.reaching[1]}}
    return facts


def reaching_cutter(swing, blocked, tool):
    """The ball that would reach blocked stations: as thick and longer, or slimmer and longer.

    Args:
        swing: ClearingSwing of the tool.   blocked: Stations.   tool: Tool.
    Returns:
        (diameter_mm, stick_out_mm), None: none that was tried does.
    """
    some = np.unique(np.linspace(0, len(blocked.along_mm) - 1, MOST_LOOKED_AT).astype(int))
    for slimmer in (1.0, *SLIMMER):
        looked = _about(blocked.of(some), slimmer, swing)
        for longer in (0.0, *LONGER_MM):
            _, least = _changed(swing, slimmer, longer, tool).bearings_of(looked)
            if np.isfinite(least).any(axis=1).all():
                return round(slimmer * tool.cutter.diameter_mm, 3), round(tool.stick_out_mm + longer, 3)
    return None


def in_words(reaching):
    """What would reach them.

    >>> in_words((4.0, 55.0))
    'a ball of 4 mm that sticks out 55 mm would reach it'
    """
    if reaching is None:
        return "nor does a longer or slimmer ball; leave these faces out, or cut them from another side"
    return f"a ball of {reaching[0]:g} mm that sticks out {reaching[1]:g} mm would reach it"


def _about(stations, slimmer, swing):
    """Stations of a ball that touches at the same places."""
    radius = swing.search.radius_mm
    return replace(stations, middle_mm=stations.middle_mm - (1.0 - slimmer) * radius * stations.normal)


def _changed(swing, slimmer, longer_mm, tool):
    """ClearingSwing of a tool whose cutter is slimmer, and whose shank is longer between cutter and holder."""
    search = swing.search
    changed = lambda segments: _stretched(segments, slimmer, longer_mm, tool.stick_out_mm, search.radius_mm)
    return ClearingSwing(replace(search, segments=changed(search.segments), beside_segments=changed(search.beside_segments),
                                 radius_mm=slimmer * search.radius_mm), swing.axis, swing.use)


def _stretched(segments, slimmer, longer_mm, stick_out_mm, radius_mm):
    """(k, 5) segments of a tool so changed."""
    found = np.array(segments)
    is_cutter = found[:, BOTTOM] < stick_out_mm - SAME_MM
    found[is_cutter, BOTTOM_RADIUS] *= slimmer
    found[is_cutter, TOP_RADIUS] *= slimmer
    meets = is_cutter & (np.abs(found[:, TOP] - stick_out_mm) <= SAME_MM)
    found[meets, TOP] += longer_mm
    found[~is_cutter, BOTTOM] += longer_mm
    found[~is_cutter, TOP] += longer_mm
    found[:, [BOTTOM, TOP]] -= (1.0 - slimmer) * radius_mm * is_cutter[:, None]
    return found
