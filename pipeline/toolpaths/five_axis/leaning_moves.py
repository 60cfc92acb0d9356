r"""A ball's upright moves with the axis turned about the ball's middle: it touches what it touched before, and no more.

        upright          leaning             middle = upright tip + r ez
          | |             / /                tip = middle - r axis
          |o|            /o/
           v             v

The middle runs where it ran, so no lean makes the ball gouge; shank and holder are the caller's to look at.  Between two rows
the tip runs straight and the axis on the great circle: the middle then leaves its line, away from the material, by at most
r turn^2 / 8.  Rows are put in until that is within a share of the tolerance, and no turn above MOST_TURN_RAD.

Where the ball touches nothing (entries, links, rapids) the axis stands as at the pass before, and turns in the highest move
to what the next pass begins with: in the rapid across, where there is one.  Where it has to turn at feed, or the contact jumps
within a pass, it turns in steps of as many rows as in the cut.

A `Swing` turns the axis further, to clear what is in the way.  Then the ways into the part and out of it run along the axis:
a tool that is clear at the end of a pass stays clear when it is drawn out lengthwise, unless it is narrower above.

A cutter that touches with its corner (corner_contact.py) comes and goes along its axis too, and runs on the passes of the ball
that stands for it: its tip goes where normal and axis say, and over an outer edge of the faces it runs straight on, for a flat
bottom that rolled over would cut the edge.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from cuspline.program.program import Kind, Moves, Plane
from cuspline.toolpaths.five_axis.clear_axes import square, toward, turned, zero_ways
from cuspline.toolpaths.five_axis.corner_contact import CornerContact
from cuspline.toolpaths.five_axis.tool_axes import ToolAxis, limited
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import ToolpathError

MOST_TURN_RAD = math.radians(2.0)       # of the axis, from row to row in the cut
FEED_REACH = 0.25           # of the radius: the feed at a place is the way from so far before to so far behind
SAME_MM = 1e-6              # of plan: a way straight up
SHORTEST_MM = 0.01          # rows nearer to each other are put in only where the axis jumps: it turns there on the spot
ROUNDED = 1e-9              # of a count of steps
SAME_RAD = 1e-9             # of what counts as brought back to the limit
ALONG = 0.02                # sine of the angle to the normal below which a feed says nothing: the one before holds
LEAST_FEED_SHARE = 0.01     # where the tip stands while the middle runs
STEADY_RAD_PER_MM = 1e-9    # of a turn: rounding
FLATTEST = 0.1              # of an axis' z: a tool that lies flatter is drawn out straight up


class Ground(ABC):
    """What a ball runs on, asked by its middle (n, 3)."""

    @abstractmethod
    def is_touched(self, middles_mm):
        """(n,) bool: the ball is in the cut there."""

    @abstractmethod
    def normals(self, middles_mm):
        """(n, 3) unit, out of the material, by which the axis leans."""

    def beyond_mm(self, middles_mm, normals):
        """(n,) how far the ball has sunk along these normals where it rolls over an outer edge; 0: it does not."""
        return np.zeros(len(middles_mm))


@dataclass(frozen=True, eq=False, kw_only=True)
class Stations:
    """Places along one run over the part."""

    along_mm: np.ndarray        # (n,) from its beginning
    middle_mm: np.ndarray       # (n, 3) of the ball
    normal: np.ndarray          # (n, 3) unit
    feed: np.ndarray            # (n, 3) of any length
    axis: np.ndarray            # (n, 3) unit, the standard direction

    @cached_property
    def zero(self):
        """(n, 3) ways of bearing 0, see clear_axes.zero_ways."""
        return zero_ways(self.axis, self.normal)

    def of(self, rows):
        """Some of them, by indices or (n,) bool."""
        return Stations(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @classmethod
    def joined(cls, several):
        """Those of several runs, one after the other."""
        return cls(**{f.name: np.concatenate([getattr(s, f.name) for s in several]) for f in fields(cls)})


@dataclass(frozen=True, eq=False, kw_only=True)
class Turn:
    """How far the axis of one run turns from its standard direction: toward one bearing, by angles at lengths along it."""

    along_mm: np.ndarray        # (k,) rising
    angle_rad: np.ndarray       # (k,) evenly between
    zero: np.ndarray            # (k, 3) ways of bearing 0 there
    bearing_rad: float

    def turned(self, stations):
        """(n, 3) axes of Stations."""
        at = lambda values: np.interp(stations.along_mm, self.along_mm, values)
        zero = square(stations.axis, np.column_stack([at(column) for column in self.zero.T]))
        angles = at(self.angle_rad)
        return turned(stations.axis, toward(stations.axis, zero, np.full(len(angles), self.bearing_rad)), angles)

    @property
    def corners_mm(self):
        """Lengths at which it turns faster or slower than before."""
        slope = np.diff(self.angle_rad) / np.diff(self.along_mm)
        return self.along_mm[1:-1][np.abs(np.diff(slope)) > STEADY_RAD_PER_MM]


class Swing(ABC):
    """What turns the axes of runs from the strategy's."""

    spacing_mm: float           # of the stations that it wants
    draws_out: bool = True      # ways into the part and out of it run along the axis

    @abstractmethod
    def turns(self, runs):
        """[Turn] of [Stations]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeaningRules:
    """What turns the axis of a ball."""

    tool_axis: ToolAxis         # in the frame of the moves
    ground: Ground
    radius_mm: float
    bulge_mm: float             # how far the ball's middle may leave its line between two rows
    swing: Swing | None = None
    corner: CornerContact | None = None     # what the ball stands for; None: for itself

    @property
    def arm_mm(self):
        """From the contact to the tip, about."""
        return self.radius_mm if self.corner is None else self.corner.radius_mm

    @property
    def most_turn_rad(self):
        """From row to row."""
        return min(math.sqrt(8.0 * self.bulge_mm / self.arm_mm), MOST_TURN_RAD)

    def tips_off(self, middles, normals, axes):
        """(n, 3) from the ball's middle to the tip."""
        if self.corner is None:
            return -(self.radius_mm * axes)
        return self.corner.tips_off(normals, axes) + self.ground.beyond_mm(middles, normals)[:, None] * normals

    def turns(self, axes, off):
        """(n - 1,) from row to row, of the axis or of the way from contact to tip."""
        turned = _turns(axes)
        if self.corner is None:
            return turned
        moved = np.diff(off, axis=0)
        return np.maximum(turned, np.sqrt((moved * moved).sum(axis=1)) / self.arm_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class Leaning:
    """Moves whose axis turns, and what is said of them."""

    moves: Moves
    is_cut: np.ndarray          # (n,) bool: the ball is on the part from end to end
    is_held: np.ndarray         # (n,) bool: the axis would lean beyond its limit
    middle_mm: np.ndarray       # (n + 1, 3) of the ball, at the start and the ends of moves
    normal: np.ndarray          # (n + 1, 3) by which the axis leans there; NaN off the part
    ball_radius_mm: float
    turns: tuple = ()           # Turn of every run, where a Swing turns it

    def __post_init__(self):
        for name in ("is_cut", "is_held"):
            object.__setattr__(self, name, frozen(getattr(self, name), (len(self.moves),), name, bool))
        for name in ("middle_mm", "normal"):
            object.__setattr__(self, name, frozen(getattr(self, name), (len(self.moves) + 1, 3), name))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Rows:
    """Places of a ball's middle one after the other; row 0 is where it all begins."""

    middle: np.ndarray          # (n, 3)
    move: np.ndarray            # (n,) upright move that leads to it; row 0: -1
    axis: np.ndarray            # (n, 3) NaN off the part
    normal: np.ndarray          # (n, 3) the same
    off: np.ndarray             # (n, 3) from the middle to the tip, the same
    is_held: np.ndarray         # (n,)

    @classmethod
    def joined(cls, several):
        """Those of several, one after the other."""
        return cls(**{f.name: np.concatenate([getattr(p, f.name) for p in several]) for f in fields(cls)})


def leaning(moves, rules):
    """Turn the axis along upright moves of a ball.

    Args:
        moves: program.Moves, straight ones, upright.   rules: LeaningRules.
    Returns:
        Leaning; tips that run at the feeds given, slower where the ball's middle runs faster than the tip.
    Raises:
        ToolpathError: an arc, no move on the part, a place where the strategy gives no direction.
    """
    if (moves.kind >= Kind.ARC_CW).any():
        raise ToolpathError("an arc with a turning axis: chords first")
    middles = np.vstack([moves.start_mm, moves.end_mm]) + (0.0, 0.0, rules.radius_mm)
    on_part = rules.ground.is_touched(middles)
    cuts = (moves.kind == Kind.FEED) & on_part[1:] & on_part[:-1]
    if not cuts.any():
        raise ToolpathError("no move touches the part: the axis has nothing to turn by")
    found, turns = _with_axes(middles, cuts, rules)
    rows = _held_off_the_part(found, along_axis=rules.corner is not None or (
        rules.swing is not None and rules.swing.draws_out), is_stepwise=rules.corner is not None)
    return _assembled(moves, _turned_evenly(rows, moves.kind == Kind.FEED, rules), cuts, turns, rules)


def stations_along(tips_mm, rules, spacing_mm):
    """Where an upright ball is along runs over the part, and which way its axis would point.

    Args:
        tips_mm: [(k, 3)] of the upright ball.   rules: LeaningRules.   spacing_mm: between stations.
    Returns:
        [Stations].
    """
    passes = [_Pass(tips + (0.0, 0.0, rules.radius_mm), rules) for tips in tips_mm]
    return _standing([p.evenly(spacing_mm) for p in passes], passes, rules) if passes else []


def _with_axes(middles, cuts, rules):
    """(_Rows of all moves, those of every pass close enough together; Turn of every pass)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], cuts, [False]]).astype(int))).reshape(-1, 2)
    passes = [_Pass(middles[first:end + 1], rules) for first, end in edges]
    if rules.swing is not None:
        _swing(passes, rules)
    pieces, done = [], 0
    for (first, end), found in zip(edges, _refined(passes, rules)):
        pieces += [_without_axes(middles, done, first), replace(found, move=first + found.move)]
        done = end + 1
    pieces.append(_without_axes(middles, done, len(middles)))
    return _Rows.joined(pieces), tuple(p.turn for p in passes if p.turn is not None)


def _without_axes(middles, first, end):
    """_Rows of places off the part."""
    n = end - first
    nowhere = np.full((n, 3), np.nan)
    return _Rows(middle=middles[first:end], move=np.arange(first, end) - 1, axis=nowhere, normal=nowhere, off=nowhere,
                 is_held=np.zeros(n, bool))


class _Pass:
    """A ball's middle along one pass, by its length."""

    def __init__(self, middles, rules):
        self.middles = middles
        self.at = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(middles, axis=0) ** 2).sum(axis=1)))])
        self.reach = FEED_REACH * rules.arm_mm
        self.turn = None

    def evenly(self, spacing_mm):
        """(n,) lengths along it, so far apart or a little less."""
        return np.linspace(0.0, self.at[-1], max(math.ceil(self.at[-1] / spacing_mm), 1) + 1)

    def places(self, at):
        """(n, 3) after lengths (n,)."""
        return np.column_stack([np.interp(at, self.at, self.middles[:, k]) for k in range(3)])

    def feeds(self, at):
        """(n, 3) from so far before to so far behind, no farther than the pass reaches."""
        return self.places(np.minimum(at + self.reach, self.at[-1])) - self.places(np.maximum(at - self.reach, 0.0))


def _refined(passes, rules):
    """[_Rows] of passes, `move` counted within each, rows put in where the axis turns too far."""
    stations = [_Stations(p, p.at, np.arange(len(p.at)) - 1) for p in passes]
    axes = _axes([s.along for s in stations], passes, rules)
    if rules.swing is not None:
        stations, axes = _put_in([p.turn.corners_mm for p in passes], stations, axes, passes, rules)
    while True:
        more = [s.between(rules.turns(a, off), rules.most_turn_rad) for s, (a, _, off, _) in zip(stations, axes)]
        if not any(len(m) for m in more):
            break
        stations, axes = _put_in(more, stations, axes, passes, rules)
    return [s.rows(*a) for s, a in zip(stations, axes)]


def _put_in(more, stations, axes, passes, rules):
    """(stations, axes) with rows at further lengths."""
    extra = _axes(more, passes, rules)
    merged = [s.with_more(m, a, e) for s, m, a, e in zip(stations, more, axes, extra)]
    return [s for s, _ in merged], [a for _, a in merged]


class _Stations:
    """Rows of one pass: lengths along it and the move that leads to each."""

    def __init__(self, pass_, along, move):
        self.pass_, self.along, self.move = pass_, along, move

    def between(self, turns, most_rad):
        """Lengths to put in, of turns (n - 1,) from row to row: none where rows are SHORTEST_MM apart."""
        parts = np.ceil(turns / most_rad - ROUNDED).astype(int)
        room = np.maximum((np.diff(self.along) / SHORTEST_MM).astype(int), 1)
        parts = np.minimum(np.maximum(parts, 1), room)
        row = np.repeat(np.arange(len(parts)), parts - 1)
        step = np.arange(len(row)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
        return self.along[row] + step / parts[row] * np.diff(self.along)[row]

    def with_more(self, more, axes, extra):
        """(_Stations, columns of `_axes`) with rows put in."""
        order = np.argsort(np.concatenate([self.along, more]), kind="stable")
        led = np.concatenate([self.move, self.move[np.searchsorted(self.along, more)]])[order]
        both = tuple(np.concatenate([a, e])[order] for a, e in zip(axes, extra))
        return _Stations(self.pass_, np.concatenate([self.along, more])[order], led), both

    def rows(self, axes, normals, off, is_held):
        """_Rows of them."""
        return _Rows(middle=self.pass_.places(self.along), move=self.move, axis=axes, normal=normals, off=off, is_held=is_held)


def _swing(passes, rules):
    """Give every pass its Turn."""
    for pass_, turn in zip(passes, rules.swing.turns(_standing([p.evenly(rules.swing.spacing_mm) for p in passes], passes, rules))):
        pass_.turn = turn


def _standing(along, passes, rules):
    """[Stations] at lengths along passes, all asked at once; the axes as the strategy has them, without its limit."""
    places = np.vstack([p.places(a) for p, a in zip(passes, along)])
    feeds = np.vstack([p.feeds(a) for p, a in zip(passes, along)])
    normals = rules.ground.normals(places)
    feeds = _off_normals(feeds, normals)
    axes = rules.tool_axis.model_copy(update={"limit_deg": None}).axes(places, normals, feeds)
    ends = np.cumsum([len(a) for a in along])
    return [Stations(along_mm=a, middle_mm=places[e - len(a):e], normal=normals[e - len(a):e], feed=feeds[e - len(a):e],
                     axis=axes[e - len(a):e]) for e, a in zip(ends, along)]


def _axes(along, passes, rules):
    """[(axes, normals, ways from middle to tip, is_held)] at lengths along passes."""
    found = []
    for pass_, stations in zip(passes, _standing(along, passes, rules)):
        free = stations.axis if pass_.turn is None else pass_.turn.turned(stations)
        axes, is_held = free, np.zeros(len(free), bool)
        if rules.tool_axis.limit_deg is not None:
            axes = limited(free, math.radians(rules.tool_axis.limit_deg))
            is_held = np.sqrt(((axes - free) ** 2).sum(axis=1)) > SAME_RAD
        found.append((axes, stations.normal, rules.tips_off(stations.middle_mm, stations.normal, axes), is_held))
    return found


def _off_normals(feeds, normals):
    """Feeds; one along its normal is replaced by the last that was not, or the next."""
    across = np.cross(feeds, normals)
    size = np.sqrt((feeds * feeds).sum(axis=1))
    good = np.sqrt((across * across).sum(axis=1)) > ALONG * np.maximum(size, 1e-12)
    if good.all() or not good.any():
        return feeds
    last = np.maximum.accumulate(np.where(good, np.arange(len(good)), -1))
    return feeds[np.where(last < 0, np.flatnonzero(good)[0], last)]


def _turns(axes):
    """(n - 1,) angle from row to row."""
    return angles_between(axes[:-1], axes[1:])


def angles_between(a, b):
    """(n,) of unit vectors, exact for small ones."""
    across = np.cross(a, b)
    return fixed.arctan2(np.sqrt((across * across).sum(axis=1)), (a * b).sum(axis=1))


def on_great_circle(a, b, share):
    """(n, 3) unit vectors after shares (n,) of the way from a to b; a where they are the same."""
    whole = angles_between(a, b)
    sine = np.maximum(fixed.sin(whole), 1e-12)
    found = (fixed.sin((1.0 - share) * whole) / sine)[:, None] * a + (fixed.sin(share * whole) / sine)[:, None] * b
    return np.where((whole > 1e-9)[:, None], found, a)


def _held_off_the_part(rows, along_axis, is_stepwise=False):
    """_Rows with all their axes: off the part as at the pass before, from the highest move on as at the next.

    along_axis: the ways up and down follow the axis; is_stepwise: those straight up and down alone, what leads sideways into the
    part stays as steep as it is.
    """
    like = np.arange(len(rows.axis))
    at = np.flatnonzero(np.isfinite(rows.axis[:, 0]))
    like[:at[0]], like[at[-1] + 1:] = at[0], at[-1]
    for before, after in zip(at[:-1], at[1:]):
        if after == before + 1:
            continue
        gap = np.arange(before + 1, after + 1)          # rows whose move is off the part
        low = np.minimum(rows.middle[gap, 2], rows.middle[gap - 1, 2])
        across = np.sqrt(((rows.middle[gap, :2] - rows.middle[gap - 1, :2]) ** 2).sum(axis=1))
        turning = gap[np.lexsort((-across, -low))[0]]
        like[before + 1:turning], like[turning:after] = before, after
    axes = rows.axis[like]
    middle = rows.middle
    if along_axis:
        middle = _drawn_out(middle, axes, like, _climbed(middle, at) if is_stepwise else None)
    return replace(rows, axis=axes, middle=middle, off=rows.off[like])


def _climbed(middle, at):
    """(n,) how far rows off the part stand above what leads sideways from them to the part: straight ways up alone count.

    at: rows on the part.
    """
    step = np.diff(middle, axis=0)
    straight = np.where((step[:, :2] ** 2).sum(axis=1) < SAME_MM ** 2, step[:, 2], 0.0)
    height = np.concatenate([[0.0], np.cumsum(straight)])
    before = at[np.maximum(np.searchsorted(at, np.arange(len(height)), side="right") - 1, 0)]
    after = at[np.minimum(np.searchsorted(at, np.arange(len(height))), len(at) - 1)]
    return height - height[before], height - height[after]


def _drawn_out(middle, axes, like, climbed=None):
    """(n, 3) middles moved across as their axes lean, by how much higher they stand than the rows `like` (n,) on the part."""
    rise = np.maximum(middle[:, 2] - middle[like, 2], 0.0)
    if climbed is not None:
        rise = np.maximum(np.where(like <= np.arange(len(like)), *climbed), 0.0)
    slope = np.where(axes[:, 2:] > FLATTEST, axes / np.maximum(axes[:, 2:], FLATTEST), 0.0) * (1.0, 1.0, 0.0)
    return middle + rise[:, None] * slope


def _turned_evenly(rows, is_feed, rules):
    """_Rows, those put in that a link at feed needs to turn its axis in steps.   is_feed: (m,) of the upright moves."""
    turns = rules.turns(rows.axis, rows.off)
    parts = np.where(is_feed[rows.move[1:]], np.ceil(turns / rules.most_turn_rad - ROUNDED), 1.0).astype(int)
    parts = np.maximum(parts, 1)
    row = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts) + 1) / parts[row]
    whole = (share == 1.0)[:, None]
    between = lambda column: np.where(whole, column[row + 1], column[row] + share[:, None] * (column[row + 1] - column[row]))
    axis = np.where(whole, rows.axis[row + 1], on_great_circle(rows.axis[row], rows.axis[row + 1], share))
    off = -(rules.radius_mm * axis) if rules.corner is None else between(rows.off)
    first = lambda column, rest: np.concatenate([column[:1], rest])
    return _Rows(middle=first(rows.middle, between(rows.middle)), move=first(rows.move, rows.move[row + 1]),
                 axis=first(rows.axis, axis), normal=first(rows.normal, between(rows.normal)),
                 off=first(rows.off, off), is_held=first(rows.is_held, rows.is_held[row + 1]))


def _assembled(moves, rows, cuts, turns, rules):
    """Leaning of rows with all their axes."""
    axes, tips = rows.axis, rows.middle + rows.off
    move, n = rows.move[1:], len(rows.move) - 1
    run = np.sqrt((np.diff(tips, axis=0) ** 2).sum(axis=1))
    of_middle = np.sqrt((np.diff(rows.middle, axis=0) ** 2).sum(axis=1))
    share = np.clip(run / np.maximum(of_middle, 1e-12), LEAST_FEED_SHARE, 1.0)
    turned = Moves(start_mm=tips[0], kind=moves.kind[move], end_mm=tips[1:], center_mm=np.full((n, 3), np.nan),
                   plane=np.full(n, Plane.XY), axis=axes[1:], feed_mm_per_min=moves.feed_mm_per_min[move] * share)
    return Leaning(moves=turned, is_cut=cuts[move], is_held=rows.is_held[1:], turns=turns, middle_mm=rows.middle,
                   normal=rows.normal, ball_radius_mm=rules.radius_mm)


def upright_again(moves, radius_mm):
    """Moves of a ball as they would run with the axis along Z: the same for all that asks for its lowest places."""
    axes = np.vstack([moves.axis[:1], moves.axis])
    ends = np.vstack([moves.start_mm, moves.end_mm]) + radius_mm * (axes - (0.0, 0.0, 1.0))
    return Moves(start_mm=ends[0], kind=moves.kind, end_mm=ends[1:], center_mm=moves.center_mm, plane=moves.plane,
                 axis=np.tile((0.0, 0.0, 1.0), (len(moves), 1)), feed_mm_per_min=moves.feed_mm_per_min)
