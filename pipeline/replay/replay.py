"""One program replayed in its true order: the stock's history, and everything that went wrong on the way."""

from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind
from cuspline.replay import head_clearance, replay_checks, replay_design, replay_doubts, replay_kernel
from cuspline.replay.clearance import ClearanceTree, flute_segments, head_frusta
from cuspline.replay.leaning_replay import found_by, known_rows, leans, replay_leaning, upright_runs
from cuspline.replay.replay_loads import loads
from cuspline.replay.replay_result import Replay
from cuspline.replay.replay_stock import LEAF
from cuspline.replay.replay_stops import Standing, stop_findings
from cuspline.replay.scene import FinishedDesign, Fixture, SolidFixture, Surroundings
from cuspline.shop.cutters import POINTED
from cuspline.stock.path_pieces import Z0, Z1, kept_by, pieces_of
from cuspline.stock.swept import CLOSED_UPWARD
from cuspline.stock.tree import least_under, morton_order
from cuspline.values import fixed_math as fixed
from cuspline.values.checkpoints import NOTHING

TOUCH_MM = 1e-4           # what may be missing of a distance: rounding of the post, pieces of arcs
COLUMN_MM, MOST_COLUMNS = 0.05, 100     # of the columns that stand for a cone
ENDLESS_MM = 1e4          # a part that nothing above makes wider goes on upward by this


def replay(posted, tools, stock, *, design=FinishedDesign(), around=Surroundings(), kept=NOTHING):
    """Replays a posted program move by move on a z-map of the stock; one with a tool that leans as leaning_replay.py says.

    Contacts are judged over the whole of every move, not at its ends, nor at the nodes alone.  What is left of the
    stock between the nodes is bounded cell by cell; where a bound does not clear a move the cell is quartered down
    to `replay_stock.CELL_MM` (0.5 um) until it does or a point shows a contact.  A fin of stock thinner than that can
    stay unseen: moves for which this is not excluded are listed in `undecided_lines`, and are findings.

    Args:
        posted: PostedMoves.   tools: dict of tool number -> cutters.Tool.
        stock: scene.FoundStock.   design: scene.FinishedDesign.   around: scene.Surroundings.
        kept: kept.Kept, asked first; NOTHING keeps nothing.
    Raises:
        SimulationError: a feed move with a tool that is not given; a tool on a head whose axis does not lie as that
            holds it; `.rows`.
    """
    if leans(posted, tools):
        runs = [(a, UprightRun.of(posted.between(a, b), tools, found_by(a, posted, tools, stock), design, around, kept))
                for a, b in upright_runs(posted)]
        return replay_leaning(posted, tools, stock, design, around, runs)
    zmap, top, machine, wanted = stock.zmap, stock.highest_mm, around.machine, around.clearances_mm
    highest = max([top, *(f.max_mm[2] for f in around.fixtures)])
    on_heads = _on_heads(posted, tools)
    run = UprightRun.of(posted, tools, stock, design, around, kept)
    events, z, worst, least, unsure = run.events, run.z_mm, run.worst, run.least, run.unsure
    taken = loads(posted, tools, zmap, events, len(run.cells.lowered[0]), run.cells.z_mm, stock.columns)
    if on_heads and stock.left_by_heads is not None:
        events, z = _lowered(events, z, *stock.left_by_heads(zmap.xy_mm))
    standing = _cells_for_heads(posted, on_heads, stock) if on_heads else None
    for tool in on_heads:
        proven, at = head_clearance.put_contacts(worst, posted, tool, around.fixtures, standing, wanted, around.spindle_head)
        if proven < least[1]:
            least[:] = min(least[0], proven), proven, *at
    worst[replay_kernel.LOW, replay_checks.in_own_holes(posted, tools), replay_kernel.AMOUNT] = -np.inf
    report = replay_checks.Reporter(posted, around.setup, around.frame)
    hanging = {t.number: head_clearance.lowest_mm(t) for t in on_heads}
    found = (*report.contacts(worst, around.fixtures), *report.not_proven(unsure), *report.states(top),
             *report.unknown_starts(highest, hanging, machine), *report.travel(machine),
             *report.table(machine, tools, run.script, hanging), *report.end(),
             *report.loads(taken, tools),
             *stop_findings(report, Standing(tools=tools, machine=machine, highest_mm=highest, hanging_mm=hanging,
                                             stock_before=stock.standing_before, within_mm=stock.within_mm)))
    place = None if np.isnan(least[2]) else report.place(least[2:])
    return Replay(zmap=zmap, bottom_mm=float(stock.min_mm[2]), top_mm=top, design_top_mm=design.heights_mm(zmap),
                  event_row=events[0], event_cell=events[1], event_z_mm=events[2], final_z_mm=z,
                  findings=found, idle=tuple(report.idle(taken, [t.number for t in on_heads])),
                  holder_clearance_mm=np.inf if place is None else float(min(least[:2])),
                  holder_place_mm=place, undecided_lines=tuple(posted.line[unsure].tolist()),
                  is_table_checked=machine is not None)


@dataclass(frozen=True, eq=False, kw_only=True)
class UprightRun:
    """What the kernel found of upright moves, and what it was asked."""

    script: tuple           # see `_script`
    cells: "_Cells"
    events: list            # arrays of row, cell and height
    z_mm: np.ndarray        # (ny, nx) in the end
    worst: np.ndarray       # (5, rows, 4), see `replay_kernel.run`
    least: np.ndarray       # (5,)
    unsure: np.ndarray      # (rows,) bool: a contact is neither shown nor excluded

    @classmethod
    def of(cls, posted, tools, stock, design, around, kept):
        """Arguments as of `replay`."""
        script, cells = _script(posted, tools, around.spindle_head), _cells(stock.heights_mm, stock)
        solids = _solids(design, design.heights_mm(stock.zmap), stock, around.fixtures)
        *events, z, worst, least, unsure = kept.of(_history)(script, len(posted), around.clearances_mm, around.rapid_clearance_mm,
                                                             cells, solids)
        if stock.within_before is not None and unsure.any():
            rows = np.flatnonzero(unsure)
            unsure[replay_doubts.cleared(rows, posted, script, around.clearances_mm, stock)] = False
        return cls(script=script, cells=cells, events=events, z_mm=z, worst=worst, least=least, unsure=unsure)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Cells:
    """The z-map before the first move, as the kernels take it."""

    z_mm: np.ndarray        # (ny, nx) at the nodes
    bound_mm: np.ndarray    # (ly - 1, lx - 1) heights that the cells do not exceed
    sure_mm: np.ndarray     # and such as they reach
    lines_mm: tuple         # x (lx,) and y (ly,) of the grid's lines
    lowered: tuple          # events of row 0: cells that earlier clampings have lowered


@dataclass(frozen=True, eq=False, kw_only=True)
class _Solids:
    """What the tool may not touch beside the stock."""

    boxes: np.ndarray                   # (b, 6) of fixtures
    fixtures: tuple                     # ClearanceTree values
    design: ClearanceTree | None
    allowed_mm: float                   # how deep neck, shank and holder may seem to touch the design


def _cells(z, stock):
    """_Cells of heights at a FoundStock's nodes."""
    top, lines = stock.highest_mm, _lines(stock.zmap, stock.max_mm)
    bound, sure = _before(z, lines, top, stock)
    return _Cells(z_mm=z, bound_mm=bound, sure_mm=sure, lines_mm=lines, lowered=_cut_before(z, top))


def _solids(design, heights, stock, fixtures):
    """_Solids of a FinishedDesign with heights at the nodes, and of fixtures."""
    boxes = [(*f.min_mm, *f.max_mm) for f in fixtures if isinstance(f, Fixture)]
    return _Solids(boxes=np.array(boxes, dtype=float).reshape(-1, 6), fixtures=tuple(
        ClearanceTree.of_triangles(f.vertices_mm, f.triangles) for f in fixtures if isinstance(f, SolidFixture)),
        design=_pins(stock.zmap, heights, float(stock.min_mm[2])) if design.tree is None else design.tree,
        allowed_mm=float(design.error_mm + TOUCH_MM))


def _history(script, moves, wanted, low_mm, cells, solids):
    """(row, cell, height of the events, heights in the end, worst, least, undecided), see `replay_kernel.run`."""
    worst, z = np.full((5, moves, 4), -np.inf), cells.z_mm.copy()
    least = np.array([replay_kernel.FAR_MM, replay_kernel.FAR_MM, np.nan, np.nan, np.nan])
    if solids.design is not None:
        _against_design(solids, script, wanted, worst, least)
    for fixture in solids.fixtures:
        _against_fixture(fixture, script, worst[replay_kernel.FIXTURE])
    events, unsure = replay_kernel.run(*script, wanted, TOUCH_MM, low_mm, solids.boxes, z, cells.bound_mm.copy(), cells.sure_mm,
                                       cells.lines_mm, _past(script[0], script[2], script[4]), worst, least, cells.lowered)
    return *events, z, worst, least, unsure & ~(worst[:replay_kernel.LOW, :, 0] > 0).any(axis=0)


def _lowered(events, z, height_mm, row):
    """Events and final heights, with one more event at each node that tools on heads leave lower, where they did."""
    lower = np.flatnonzero(height_mm < z.ravel())
    by = np.full(z.size, np.iinfo(np.int64).max)
    by[lower] = row[lower]
    kept = (events[0] < by[events[1]]) | (events[2] < height_mm[events[1]])
    parts = zip((e[kept] for e in events), (row[lower], lower, height_mm[lower]))
    joined = [np.concatenate([a, b]).astype(a.dtype) for a, b in parts]
    order = np.argsort(joined[0], kind="stable")
    return [e[order] for e in joined], np.minimum(z, height_mm.reshape(z.shape))


def _cut_before(z, top):
    """Events of row 0, as the kernel takes them: cells that earlier clampings have lowered."""
    cells = np.flatnonzero(z.ravel() < top)
    return np.zeros(len(cells), np.int32), cells.astype(np.int32), z.ravel()[cells]


def _lines(zmap, stock_max):
    """x and y of the grid's lines: through the nodes, and the stock's far side where no node stands on it."""
    lines = []
    for origin, count, end in zip(zmap.origin_mm, (zmap.nx, zmap.ny), stock_max):
        at = origin + zmap.pitch_mm * np.arange(count)
        lines.append(np.append(at, end) if end - at[-1] > 1e-9 or count == 1 else at)
    return tuple(lines)


def _before(z, lines, top, stock):
    """What is known of each cell before the first move: a height it does not exceed, and one that it surely reaches."""
    wide = np.pad(z, [(0, len(lines[1]) - len(z)), (0, len(lines[0]) - z.shape[1])], mode="edge")
    corners = np.array([wide[:-1, :-1], wide[1:, :-1], wide[:-1, 1:], wide[1:, 1:]])
    bounds = np.full(corners.shape[1:], top)
    j, i = np.nonzero((corners < top).any(axis=0))
    if stock.within_mm is not None and len(j):
        middle, half = (np.column_stack([(s * a[k + 1] + a[k]) / 2 for k, a in zip((i, j), lines)]) for s in (1, -1))
        share = (2 * np.arange(stock.parts) + 1) / stock.parts - 1
        places = [middle + np.abs(half) * (a, b) for a in share for b in share]
        radius = float(fixed.hypot(*half.T).max()) / stock.parts
        found = stock.within_mm(np.concatenate(places), radius).reshape(stock.parts ** 2, -1).max(axis=0)
        bounds[j, i] = np.maximum(found, corners[:, j, i].max(axis=0)).clip(max=top)
    return bounds, corners.min(axis=0)


def _past(geometry, cutter, cutters):
    """All pieces as the kernels search them: (forest, order of each, least order under each node)."""
    trees, parts, first = [], [], [0, 0]
    for k in range(len(cutters)):
        rows = np.flatnonzero(cutter == k)
        g = geometry[rows]
        middle = np.column_stack([g[:, 0] + g[:, 3], g[:, 1] + g[:, 4], 2 * np.minimum(g[:, 2], g[:, 5])]) / 2
        rows = rows[morton_order(middle)]
        nodes, leaves = _boxes(geometry[rows])
        trees.append((*first, len(rows), leaves))
        parts.append((geometry[rows], nodes, rows, least_under(rows, leaves, LEAF)))
        first = [first[0] + len(nodes), first[1] + len(rows)]
    empty = (np.zeros((0, 12)), np.zeros((0, 5)), np.zeros(0, np.int64), np.zeros(0, np.int64))
    pieces, nodes, orders, firsts = (np.concatenate(column) for column in zip(empty, *parts))
    return (pieces, nodes, np.array(trees, np.int64).reshape(-1, 4), cutters), orders, firsts


def _boxes(geometry):
    """(2 leaves - 1, 5) rectangle and lowest tip of each node of a binary tree, and the number of leaves."""
    leaves = 1 << max(0, (-(-len(geometry) // LEAF) - 1).bit_length())
    xs, ys, low = geometry[:, [0, 3]], geometry[:, [1, 4]], replay_checks.lowest_tips(geometry)
    least = [least_under(c, leaves, LEAF) for c in (xs.min(axis=1), -xs.max(axis=1), ys.min(axis=1), -ys.max(axis=1), low)]
    return np.column_stack(least) * [1, -1, 1, -1, 1], leaves


def _pins(zmap, heights, bottom):
    """Thin pins as high as the design at its nodes; None where it is not known."""
    known = np.isfinite(heights).ravel()
    if not known.any():
        return None
    xy, top = zmap.xy_mm[known], heights.ravel()[known]
    n = len(top)
    ends = np.vstack([np.column_stack([xy, top]), np.column_stack([xy, np.minimum(top, bottom)])])
    return ClearanceTree.of_triangles(ends, np.column_stack([np.arange(n), np.arange(n) + n, np.arange(n) + n]))


def _against_design(solids, script, wanted, worst, least):
    """Shank and holder of every cutter against the design: `worst` takes contacts, `least` the holder's distance."""
    geometry, row, cutter, _, _, parts, kinds = script
    for k in np.unique(cutter):
        mine = cutter == k
        lines, of = replay_kernel.chords(geometry[mine])
        rows = row[mine][of]
        for kind in (replay_kernel.SHANK, replay_kernel.HOLDER):
            segments = parts[(kinds[:, 0] == k) & (kinds[:, 1] == kind)]
            if not len(segments):
                continue
            is_holder = kind == replay_kernel.HOLDER
            proven, got, spot = replay_design.sweep(
                solids.design.arrays, lines, rows, np.ascontiguousarray(segments), wanted[kind] - solids.allowed_mm,
                least[1] if is_holder else -np.inf, replay_design.TOLERANCE_MM, worst[kind])
            if is_holder and got < least[1]:
                least[1:] = got, *spot
            if is_holder:
                least[0] = min(least[0], proven)
    worst[:, :, 0] += solids.allowed_mm             # where there is none, -inf stays


def _against_fixture(fixture, script, worst):
    """All that stands above the tips of every cutter, flutes included, against a fixture's triangles."""
    geometry, row, cutter, _, _, parts, kinds = script
    for k in np.unique(cutter):
        mine = cutter == k
        lines, of = replay_kernel.chords(geometry[mine])
        rows = row[mine][of]
        for is_flute in (True, False):
            segments = parts[(kinds[:, 0] == k) & ((kinds[:, 1] == replay_kernel.RAPID) == is_flute)]
            if len(segments):           # flutes come thinner by what they may touch
                replay_design.sweep(fixture.arrays, lines, rows, np.ascontiguousarray(segments),
                                    TOUCH_MM if is_flute else 0.0, -np.inf, replay_design.TOLERANCE_MM, worst)


def _on_heads(posted, tools):
    """The tools on right-angle heads that the program takes."""
    return [t for n, t in sorted(tools.items()) if t.head is not None and (posted.tool == n).any()]


def _cells_for_heads(posted, on_heads, stock):
    """StockCells of the stock that the first tool on a head finds; the whole billet where nobody knows."""
    first = int(np.isin(posted.tool, [t.number for t in on_heads]).argmax())
    found = ((lambda xy, radius: np.full(len(xy), stock.max_mm[2])) if stock.within_before is None else
             stock.within_before(first))
    return head_clearance.StockCells.over(stock.min_mm, stock.max_mm, found)


def _script(posted, tools, spindle_head):
    """Pieces of all known moves of upright tools in order, with their cutters and the parts above these."""
    known = known_rows(posted, tools)
    numbers = sorted(n for n in {int(n) for n in posted.tool[known]} if tools[n].head is None)
    pieces = [_pieces(posted, np.flatnonzero(known & (posted.tool == n)), tools[n]) for n in numbers]
    columns = [columns_in(tools[n].cutter) for n in numbers]
    stack = lambda arrays, empty: np.concatenate([empty, *arrays])
    first = np.concatenate([[0], np.cumsum([len(c) - 1 for c in columns])]).astype(np.int64) + len(numbers) - 1
    geometry = stack([_in_columns(p.geometry, c[:, 2]) for p, c in zip(pieces, columns)], np.zeros((0, 12)))
    row = stack([np.repeat(p.row, len(c)) for p, c in zip(pieces, columns)], np.zeros(0, np.int64))
    cutter = stack([np.tile([k, *range(first[k] + 1, first[k] + len(c))], len(p)) for k, (p, c) in enumerate(zip(pieces, columns))],
                   np.zeros(0, np.int64))
    order = np.argsort(row, kind="stable")
    cutters = np.concatenate([np.zeros((0, 2)), *(c[:1, :2] for c in columns), *(c[1:, :2] for c in columns)])
    rows = [(k, *part) for k, n in enumerate(numbers) for part in
            (*_flutes(tools[n].cutter), *_parts(tools[n], spindle_head), *_above_flutes(tools[n].cutter))]
    parts = np.array(rows, dtype=float).reshape(-1, 7)
    return (geometry[order], row[order], cutter[order], posted.kind[row[order]] == Kind.RAPID, cutters,
            np.ascontiguousarray(parts[:, 2:]), np.ascontiguousarray(parts[:, :2].astype(np.int64)))


def columns_in(cutter):
    """(k, 3) flat radius, corner radius and lift of plain columns, open upward, in the cutter's body: together they leave no
    less stock than it.  The first stands on its tip; a cone is a stair of COLUMN_MM.
    """
    bottom = [(*surely_cut(cutter), 0.0)]
    if cutter.type not in POINTED:
        return np.array(bottom)
    tip, high = (cutter.tip_diameter_mm or 0.0) / 2, cutter.point_height_mm
    share = np.linspace(0.0, 1.0, min(int(np.ceil(high / COLUMN_MM)), MOST_COLUMNS) + 1)[1:]
    return np.array(bottom + [(tip + s * (cutter.radius_mm - tip), 0.0, s * high) for s in share.tolist()])


def _in_columns(geometry, lifts_mm):
    """(m k, 12) each piece once a column, one after the other, its tip lifted."""
    out = np.repeat(geometry, len(lifts_mm), axis=0)
    for z in (Z0, Z1):
        out[:, z] += np.tile(lifts_mm, len(geometry))
    return out


def _pieces(posted, rows, tool):
    """A plunge is cut in steps of half a flute length: the neck enters what the flutes have cut before."""
    return pieces_of(posted, rows, kept_by(tool.cutter), deepest_mm=tool.cutter.flute_length_mm / 2)


def surely_cut(cutter):
    """(flat radius, corner radius) of a plain column, open upward, in the cutter's body: it leaves no less stock, mm."""
    if cutter.type in CLOSED_UPWARD:
        return cutter.radius_mm - cutter.corner_radius_mm, cutter.corner_radius_mm
    profile = cutter.profile
    if cutter.type == "tapered_ball":
        return 0.0, cutter.corner_radius_mm
    if cutter.type == "lens":
        return 0.0, profile.top_radius_mm
    has_flat_bottom = profile.end_mm[0, 1] == 0.0
    return (float(profile.end_mm[:, 0].min()) if has_flat_bottom else 0.0), 0.0


def _flutes(cutter):
    """(kind, z0, r0, z1, r1, grow) of the whole cutting part, its surface TOUCH_MM farther in."""
    if cutter.type in CLOSED_UPWARD:
        yield _thin_flutes(cutter.radius_mm - cutter.corner_radius_mm, cutter.corner_radius_mm)
        return
    if cutter.type in POINTED:          # as what it surely cuts: so it keeps clear of what it has cut itself
        for radius, _, lift in columns_in(cutter)[1:].tolist():
            yield replay_kernel.RAPID, lift + TOUCH_MM, max(radius - TOUCH_MM, 0.0), ENDLESS_MM, max(radius - TOUCH_MM, 0.0), 0.0
        return
    for z0, r0, z1, r1, grow in flute_segments(cutter):
        yield replay_kernel.RAPID, z0 + TOUCH_MM, max(r0 - TOUCH_MM, 0.0), z1, max(r1 - TOUCH_MM, 0.0), grow


def _thin_flutes(a, rc):
    """(kind, z0, r0, z1, r1, grow) of flutes whose surface lies TOUCH_MM farther in."""
    thin = max(rc - TOUCH_MM, 0.0)
    a -= TOUCH_MM - (rc - thin)
    return replay_kernel.RAPID, TOUCH_MM + thin, a, ENDLESS_MM, a, thin


def _parts(tool, spindle_head):
    """(kind, z0, r0, z1, r1, grow) of neck, shank, holder and spindle head; what does not widen goes on upward."""
    frusta = [(z0 >= tool.stick_out_mm - 1e-9, z0, r0, z1, r1) for z0, r0, z1, r1 in
              [*tool.non_cutting_frusta(), *head_frusta(tool, spindle_head)]]
    for is_holder, z0, r0, z1, r1 in frusta:
        kind = replay_kernel.HOLDER if is_holder else replay_kernel.SHANK
        yield (kind, z0, r0, z1, r1, 0.0) if r1 > r0 else (kind, z0, r0, ENDLESS_MM, r0, 0.0)


def _above_flutes(cutter):
    """(kind, z0, r0, z1, r1, grow) of a neck no wider than its flutes: what it meets where they have not come."""
    radius = cutter.neck_diameter_mm / 2
    if cutter.type in CLOSED_UPWARD and cutter.flute_length_mm < cutter.reach_mm:
        yield replay_kernel.UNCUT, cutter.flute_length_mm, radius, ENDLESS_MM, radius, 0.0
