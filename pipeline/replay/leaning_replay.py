"""A program with a tool that leans, or turns as it moves, replayed in its clamping's frame.

There are no heights in it: the stock is what no cutter has swept yet (stock/timed.py), and contacts are looked for from the
side of the stock (leaning_contacts.py).  Runs of upright moves that cut are replayed as any upright program is, on the stock
that they find: heights, and bounds between the nodes.  What these leave undecided after a tool has leaned, is taken from here.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.program.program import TILT_RAD, UPRIGHT, Kind, tilt_rad
from cuspline.replay import leaning_loads, replay_checks
from cuspline.replay.clearance import ClearanceTree, ToolMoves, flute_segments, head_frusta
from cuspline.replay.leaning_contacts import History, contacts
from cuspline.replay.replay_kernel import FAR_MM, FIXTURE, HOLDER, LOW, RAPID, SHANK, lowered
from cuspline.replay.replay_result import Replay
from cuspline.replay.replay_stops import Standing, stop_findings
from cuspline.replay.scene import Fixture
from cuspline.stock.outlines import frustum_outline
from cuspline.stock.path_pieces import X0, X1, pieces_of
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import cutting_rows, lowest_moves, shrunk_paths, stock_height_mm, swept_paths
from cuspline.stock.tilted import posed_path
from cuspline.stock.tilted_pieces import AXIS, LENGTH, TIP, WAY
from cuspline.stock.timed import NEVER, first_within, timed_forest
from cuspline.values.compiled import njit
from cuspline.values.errors import SimulationError
from cuspline.values.rows import put

LEAVING_MM = 0.02         # of flutes on a rapid, into the stock, that does not count: it may begin in the cut
RUBBING_MM = 0.01         # of neck and shank: they may follow the flutes into what these have just cut
TOUCH_MM = 1e-4           # of the holder's clearance, that may be missing
STEP_SHARE = 1 / 16       # of the flutes' length: no sub-step is longer
POSES = 9                 # of a move that comes too near, at which its distance is measured
NEAR_MM = 1e-3            # and how closely


def leans(posted, tools):
    """Whether some move is made with an axis that neither stands upright nor lies as the tool's head holds it.

    Raises:
        SimulationError: one of a tool on a head; `.rows`.
    """
    found = False
    for number in np.unique(posted.tool).tolist():
        tool, rows = tools.get(number), np.flatnonzero(posted.tool == number)
        head = None if tool is None else tool.head
        held = UPRIGHT if head is None else head.axis
        tilt = np.maximum(tilt_rad(posted.start_axis[rows], held), tilt_rad(posted.end_axis[rows], held))
        bad = np.flatnonzero(~(tilt <= TILT_RAD))
        if len(bad) and head is not None:
            raise SimulationError(f"line {posted.line[rows[bad[0]]]}: the axis of T{number} leans {np.degrees(tilt[bad[0]]):.3f} "
                                  f"degrees from where its head holds it, and in {len(bad) - 1} more moves: program it as it hangs",
                                  rows=rows[bad])
        found |= bool(len(bad))
    heads = [n for n in np.unique(posted.tool).tolist() if n in tools and tools[n].head is not None]
    if found and heads:
        raise SimulationError(f"T{heads[0]} is on an angle head in a program with a tool that leans: the replay knows "
                              "either, not both: give them programs of their own", rows=np.flatnonzero(posted.tool == heads[0]))
    return found


def known_rows(posted, tools):
    """(n,) bool: moves with a tool that is given, from a known place to a known place.

    Raises:
        SimulationError: a feed move that is none of them; `.rows`.
    """
    known = cutting_rows(posted) & np.isin(posted.tool, list(tools))
    lost = (posted.kind != Kind.RAPID) & ~known
    if lost.any():
        k = int(np.flatnonzero(lost)[0])
        raise SimulationError(f"line {posted.line[k]}: feed move with T{posted.tool[k]} from "
                              f"{posted.start_mm[k]}; the tool is not in the library or the start is unknown",
                              rows=np.flatnonzero(lost))
    return known


def upright_runs(posted):
    """[(first, end)] runs of rows in which no tool leans: the program's first moves, empty perhaps, and later ones that cut."""
    change = np.flatnonzero(np.diff(posted.is_upright)) + 1
    runs = [(a, b) for a, b in zip([0, *change.tolist()], [*change.tolist(), len(posted)]) if posted.is_upright[a]]
    cut = [(a, b) for a, b in runs if a > 0 and (posted.kind[a:b] != Kind.RAPID).any()]
    return [(0, int(np.argmin(posted.is_upright))), *cut]


def found_by(row, posted, tools, stock):
    """FoundStock that a row finds: what the moves before it have cut is gone from a FoundStock, as far as heights say that."""
    if row == 0:
        return stock
    paths, top, bottom = swept_paths(posted.first(row), tools), stock.highest_mm, float(stock.min_mm[2])
    left = stock_height_mm(paths, stock.zmap.xy_mm, top, bottom_mm=bottom).reshape(stock.zmap.shape)

    def within_mm(xy, radius):
        before = np.full(len(xy), top) if stock.within_mm is None else stock.within_mm(xy, radius)
        return np.minimum(before, stock_height_mm(shrunk_paths(paths, radius), xy, top, bottom_mm=bottom))

    within_before = None if stock.within_before is None else lambda k: stock.within_before(row + k)
    return replace(stock, top_mm=np.minimum(stock.heights_mm, left), within_mm=within_mm, parts=1, within_before=within_before)


def replay_leaning(posted, tools, stock, design, around, runs):
    """As `replay.replay`, of a program of which some tool leans.

    Args:
        runs: [(first row, replay.UprightRun)] of `upright_runs`; the moves of the first are asked nothing else.
    Raises:
        SimulationError: see `known_rows`; a cutter whose body is not convex, an axis that turns half round in a move.
    """
    known, zmap, machine, top = known_rows(posted, tools), stock.zmap, around.machine, stock.highest_mm
    upright = len(runs[0][1].unsure)
    script = _Script.of(posted, tools, known, upright)
    history = _history(script, stock)
    worst = np.full((5, len(posted), 4), -np.inf)
    unsure = np.zeros(len(posted), bool)
    nearest = _against_stock(worst, unsure, script, history, around)
    least, place = _against_design(worst, script, design, around)
    _against_fixtures(worst, script, around)
    for first, run in runs:
        decided = first + np.flatnonzero(~run.unsure if first else np.ones(len(run.unsure), bool))
        worst[:, decided], unsure[decided] = run.worst[:, decided - first], run.unsure[decided - first]
    if nearest < least:
        least, place = nearest, None
    events, z = _final(posted, tools, stock)
    taken = leaning_loads.loads(posted, script, history)
    highest = max([top, *(f.max_mm[2] for f in around.fixtures)])
    report = replay_checks.Reporter(posted, around.setup, around.frame)
    for _, run in runs:
        if not np.isnan(run.least[2]) and run.least[:2].min() < least:
            least, place = float(run.least[:2].min()), report.place(run.least[2:])
    geometry = pieces_of(posted, np.flatnonzero(known & posted.is_upright))
    found = (*report.contacts(worst, around.fixtures),
             *report.not_proven(unsure & ~(worst[:LOW, :, 0] > 0).any(axis=0)), *report.states(top),
             *report.unknown_starts(highest, {}, machine), *report.travel(machine),
             *report.table(machine, tools, (geometry.geometry, geometry.row), {}), *report.end(), *report.loads(taken, tools),
             *stop_findings(report, Standing(tools=tools, machine=machine, highest_mm=highest, hanging_mm={},
                                             stock_before=stock.standing_before, within_mm=stock.within_mm)))
    return Replay(zmap=zmap, bottom_mm=float(stock.min_mm[2]), top_mm=top, design_top_mm=design.heights_mm(zmap),
                  event_row=events[0], event_cell=events[1], event_z_mm=events[2], final_z_mm=z, findings=found,
                  idle=tuple(report.idle(taken, [])),
                  holder_clearance_mm=least, holder_place_mm=place,
                  undecided_lines=tuple(posted.line[unsure].tolist()), is_table_checked=machine is not None)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Script:
    """All known moves as sub-steps of each tool."""

    paths: tuple                # PosedPath of each tool's flutes
    numbers: tuple              # (m,) of each path's sub-steps in the order of the program
    rows: np.ndarray            # (k,) row of PostedMoves of each number
    is_rapid: np.ndarray        # (n,) of PostedMoves
    first: int                  # row from which on parts are held against the stock

    @classmethod
    def of(cls, posted, tools, known, first):
        """A tool goes down by short steps: the neck enters what the flutes have cut before."""
        names = sorted({int(n) for n in posted.tool[known]})
        paths = tuple(posed_path(posted, np.flatnonzero(known & (posted.tool == n)), tools[n],
                                 longest_mm=STEP_SHARE * tools[n].cutter.flute_length_mm) for n in names)
        row = np.concatenate([np.zeros(0, np.int64), *(p.row for p in paths)])
        order = np.lexsort((np.concatenate([np.zeros(0, np.int64), *(p.step for p in paths)]), row))
        number = np.empty(len(row), np.int64)
        number[order] = np.arange(len(row))
        ends = np.cumsum([len(p.row) for p in paths])[:-1]
        return cls(paths=paths, numbers=tuple(np.split(number, ends)) if paths else (), rows=row[order],
                   is_rapid=posted.kind == Kind.RAPID, first=first)

    def flutes(self):
        """Timed forest of all that cuts."""
        return timed_forest(self.paths, self.numbers)

    def part(self, frusta_of):
        """Timed forest of the frusta (k, 4) that `frusta_of(tool)` names, from the first row on."""
        asked = [(p, n, np.flatnonzero(p.row >= self.first)) for p, n in zip(self.paths, self.numbers)]
        made = [(p.of_body(frustum_outline(*row), some), n[some]) for p, n, some in asked if len(some) for row in frusta_of(p.tool)]
        return timed_forest([p for p, _ in made], [n for _, n in made])

    def rapids(self, change=lambda geometry: geometry):
        """Timed forest of the flutes on rapids, along changed sub-steps (m, 14)."""
        made = []
        for p, n in zip(self.paths, self.numbers):
            chosen = np.flatnonzero(self.is_rapid[p.row] & (p.row >= self.first))
            if len(chosen):
                changed = p.geometry.copy()
                changed[chosen] = change(p.geometry[chosen])
                made.append((replace(p, geometry=changed).of_body(p.outline, chosen), n[chosen]))
        return timed_forest([p for p, _ in made], [n for _, n in made])

    def moves_of(self, k, chosen=slice(None)):
        """(rows, ToolMoves) of the k-th tool in the order of cutting."""
        p = self.paths[k]
        order = np.argsort(p.step, kind="stable")[chosen]
        return p.row[order], ToolMoves.of_substeps(p.geometry[order])


def _shank(tool):
    """(k, 4) frusta of neck and shank."""
    frusta = tool.non_cutting_frusta()
    return frusta[frusta[:, 0] < tool.stick_out_mm - 1e-9]


def _holder(tool, spindle_head):
    """(k, 4) frusta of the holder and of the spindle's head over it."""
    frusta = tool.non_cutting_frusta()
    return np.array([*frusta[frusta[:, 0] >= tool.stick_out_mm - 1e-9], *head_frusta(tool, spindle_head)]).reshape(-1, 4)


def _history(script, stock):
    low, high = np.array(stock.min_mm, float), np.array(stock.max_mm, float)
    holds = lambda p: ((p >= low) & (p <= high)).all(axis=1)
    beside = lambda p, radius: ((p < low - radius) | (p > high + radius)).any(axis=1)
    return History(cut=script.flutes(), rows=script.rows, low_mm=low, high_mm=high, is_stock=stock.is_stock or holds,
                   is_free_within=stock.is_free_within or beside)


def _against_stock(worst, unsure, script, history, around):
    """Contacts of all parts with stock; returns how near the holder comes to any, proven: inf beyond FAR_MM."""
    wanted = around.clearances_mm
    holder = script.part(lambda t: _holder(t, around.spindle_head))
    low_mm = around.rapid_clearance_mm
    asked = [(RAPID, script.rapids(), 0.0, LEAVING_MM), (SHANK, script.part(_shank), wanted[SHANK], RUBBING_MM),
             (HOLDER, holder, wanted[HOLDER], TOUCH_MM)]
    if low_mm > 0:
        asked.append((LOW, script.rapids(lambda g: _lowered(g, low_mm)), 0.0, LEAVING_MM))
    nearest = wanted[HOLDER]
    for kind, part, distance, touch in asked:
        found = contacts(part, distance, touch, history, cuts=kind in (RAPID, LOW))
        _put(worst[kind], found.row, found.amount_mm, found.place_mm)
        if kind != LOW:
            unsure[found.unsure] = True
        if kind == HOLDER:
            nearest = min(nearest, distance - found.amount_mm.max(initial=0.0))
    if nearest == wanted[HOLDER] and _is_far(holder, history):
        return np.inf
    return float(nearest)


def _is_far(part, history):
    """Whether a part keeps FAR_MM from all stock."""
    middle = (history.low_mm + history.high_mm) / 2
    radius = np.sqrt(((history.high_mm - middle) ** 2).sum())
    return bool(first_within(middle[None], np.array([radius + FAR_MM]), part, np.array([NEVER]))[0] == NEVER)


def _lowered(geometry, by_mm):
    """Sub-steps of rapids lowered by the height that they are to keep; where one leads up, it may begin in the cut."""
    out = geometry.copy()
    _lower(out, by_mm)
    out[:, LENGTH] = np.sqrt((out[:, WAY:AXIS] ** 2).sum(axis=1))
    return out


@njit
def _lower(geometry, by_mm):
    """The same in place, but for LENGTH."""
    line, low = np.empty(12), np.empty(12)
    for g in geometry:
        put(line, g[TIP:WAY])
        for k in range(3):
            line[X1 + k] = g[TIP + k] + g[WAY + k]
        lowered(line, by_mm, low)
        for k in range(3):
            g[TIP + k], g[WAY + k] = low[X0 + k], low[X1 + k] - low[X0 + k]


def _put(table, row, amount, place):
    """Write amounts (c,) with their places into the rows of a table (rows, 4) where they are the largest."""
    some = np.flatnonzero(amount > np.maximum(table[row, 0], 0.0))
    some = some[np.argsort(amount[some], kind="stable")]
    table[row[some], 0], table[row[some], 1:] = amount[some], place[some]


def _against_design(worst, script, design, around):
    """Neck, shank and holder against the finished design; how near the holder comes to it, and where."""
    least, place = np.inf, None
    if design.tree is None:
        return least, place
    allowed = design.error_mm + TOUCH_MM
    for k, path in enumerate(script.paths):
        rows, moves = script.moves_of(k)
        for kind, frusta in ((SHANK, _shank(path.tool)), (HOLDER, _holder(path.tool, around.spindle_head))):
            if not len(frusta):
                continue
            margin = around.clearances_mm[kind] - allowed
            clear = _kept_clear(worst[kind], design.tree, _segments(frusta), (rows, moves), margin, allowed)
            nearest = int(clear.clearance_mm.argmin()) if len(rows) else None
            if kind == HOLDER and nearest is not None and np.isfinite(clear.place_mm[nearest]).all() \
                    and clear.clearance_mm[nearest] < least:
                least, place = float(clear.clearance_mm[nearest]), tuple(clear.place_mm[nearest].tolist())
    return least, place


def _against_fixtures(worst, script, around):
    """All of every tool against fixtures, on feeds and rapids; flutes may touch them."""
    for fixture in around.fixtures:
        mesh = (BoxShape(min_mm=fixture.min_mm, max_mm=fixture.max_mm).mesh if isinstance(fixture, Fixture)
                else (fixture.vertices_mm, fixture.triangles))
        tree = ClearanceTree.of_triangles(*mesh)
        for k, path in enumerate(script.paths):
            rest = np.vstack([_shank(path.tool), _holder(path.tool, around.spindle_head)])
            _kept_clear(worst[FIXTURE], tree, flute_segments(path.tool.cutter), script.moves_of(k), -TOUCH_MM, 0.0)
            _kept_clear(worst[FIXTURE], tree, _segments(rest), script.moves_of(k), 0.0, 0.0)


def _segments(frusta):
    """(k, 5) segments of frusta (k, 4)."""
    return np.column_stack([frusta, np.zeros(len(frusta))])


def _kept_clear(table, tree, segments, way, margin, allowed):
    """MoveClearance of moves; what is missing of the margin, and of what was `allowed` of it, goes into the table."""
    rows, moves = way
    clear = tree.certified_clearance(segments, moves, margin)
    near = np.flatnonzero(~clear.is_clear)
    if len(near):
        share = np.linspace(0.0, 1.0, POSES)[None, :, None]
        between = lambda a, b: (a[near, None] + share * (b - a)[near, None]).reshape(-1, 3)
        axes = between(moves.start_axes, moves.end_axes)
        found = tree.distances_mm(segments, between(moves.start_tips_mm, moves.end_tips_mm),
                                  axes / np.sqrt((axes * axes).sum(axis=1))[:, None], NEAR_MM).reshape(-1, POSES)
        _put(table, rows[near], margin + allowed - np.minimum(found.min(axis=1), clear.clearance_mm[near]),
             clear.place_mm[near])
    return clear


def _final(posted, tools, stock):
    """Events of the z-map, one a node that is lowered, and the heights in the end."""
    zmap, before = stock.zmap, stock.heights_mm
    z, row = lowest_moves(swept_paths(posted, tools), zmap.xy_mm, stock.highest_mm, bottom_mm=float(stock.min_mm[2]))
    cells = np.flatnonzero((z < before.ravel()) & (row >= 0))
    first = np.flatnonzero(before.ravel() < stock.highest_mm)
    order = cells[np.argsort(row[cells], kind="stable")]
    events = (np.concatenate([np.zeros(len(first), np.int64), row[order]]), np.concatenate([first, order]),
              np.concatenate([before.ravel()[first], z[order]]))
    return events, np.minimum(before, z.reshape(before.shape))
