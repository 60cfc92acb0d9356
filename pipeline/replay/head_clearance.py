r"""Tools on a right-angle head: what head, arbor and, on rapids, the disc may not meet.

        ┌────────┐ spindle                     boxes go along with the disc's middle; the disc is a cylinder along x
        │  head  ├──┐
        │        ├─▐│▌ disc
        └────────┘ ▐│▌
    ───────────────────── highest stock in each cell of a grid

The stock is taken as the first such tool finds it, bounded from above cell by cell; what the disc itself takes away
later is not counted.  So what is called clear is clear over the whole of every move; a contact may be one with stock
that is gone by then.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Kind, Plane
from cuspline.replay.clearance import head_frusta
from cuspline.replay.replay_kernel import FIXTURE, HOLDER, RAPID, SHANK
from cuspline.values import fixed_math as fixed

TOUCH_MM = 1e-4             # of the disc's radius, that does not count: rounding of the post
LOOKED_MM = 0.25            # moves are asked at points no farther apart; half of it is kept back
PITCH_MM = 0.5              # of the grid of the stock
DISC = "cutter"


@dataclass(frozen=True, kw_only=True)
class Part:
    """A box of the tool, from the disc's middle, in the machine's directions."""

    name: str
    kind: int                   # replay_kernel.SHANK or HOLDER
    min_mm: tuple
    max_mm: tuple


@dataclass(frozen=True, eq=False, kw_only=True)
class Stations:
    """Points of a tool's moves, no farther apart than LOOKED_MM; of the disc's middle."""

    points_mm: np.ndarray       # (n, 3)
    row: np.ndarray             # (n,) of the moves
    is_rapid: np.ndarray        # (n,) bool
    aside: np.ndarray           # (n,) shares of the way that go across and down: a straight rapid's; 1 on arcs
    down: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """How near a part of the tool comes to a fixture."""

    part: str
    fixture: str
    clearance_mm: float         # proven lower bound; negative: they meet
    center_mm: tuple            # of the disc, where it is nearest


def parts_of(tool, spindle_head=()):
    """Part values of a tool on a head: its arbor, the head's boxes, the spindle's own head."""
    toward, parts = np.sign(tool.head.axis[0]), []
    for z0, r0, z1, r1 in tool.non_cutting_frusta():
        ends = toward * (np.array([z0, z1]) - tool.driven_mm)
        wide = max(r0, r1)
        parts.append(Part(name="arbor", kind=SHANK, min_mm=(float(ends.min()), -wide, -wide),
                          max_mm=(float(ends.max()), wide, wide)))
    parts += [Part(name=tool.head.name, kind=HOLDER, min_mm=b.min_mm, max_mm=b.max_mm) for b in tool.head.boxes]
    for z0, r0, z1, r1 in head_frusta(tool, spindle_head):
        wide, x = max(r0, r1), -tool.head.offset_mm
        parts.append(Part(name="spindle housing", kind=HOLDER, min_mm=(x - wide, -wide, z0), max_mm=(x + wide, wide, z1)))
    return tuple(parts)


def lowest_mm(tool):
    """How far disc, head and arbor reach below the disc's middle."""
    return max([tool.cutter.radius_mm, *(-p.min_mm[2] for p in parts_of(tool))])


def stations(start_mm, moves):
    """Stations of moves that begin at start_mm (n, 3); those that begin or end at an unknown place are left out."""
    points, rows, shares = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros((0, 2))]
    for k in np.flatnonzero(np.isfinite(start_mm).all(axis=1) & np.isfinite(moves.end_mm).all(axis=1)):
        mine = _on_a_move(start_mm[k], moves, k)
        points.append(mine)
        rows.append(np.full(len(mine), k))
        way = moves.end_mm[k] - start_mm[k]
        share = np.array([fixed.hypot(*way[:2]), abs(way[2])]) / max(fixed.length(way), 1e-9)
        shares.append(np.tile(share if moves.kind[k] < Kind.ARC_CW else (1.0, 1.0), (len(mine), 1)))
    row, (aside, down) = np.concatenate(rows), np.concatenate(shares).T
    return Stations(points_mm=np.concatenate(points), row=row, is_rapid=moves.kind[row] == Kind.RAPID, aside=aside,
                    down=down)


def _on_a_move(start, moves, k):
    """(m, 3) points of one move, both ends among them."""
    end = moves.end_mm[k]
    if moves.kind[k] < Kind.ARC_CW:
        count = max(int(np.ceil(fixed.length(end - start) / LOOKED_MM)), 1)
        return start + np.arange(count + 1)[:, None] / count * (end - start)
    a, b, third = Plane(moves.plane[k]).axes
    center, side = moves.center_mm[k], -1.0 if moves.kind[k] == Kind.ARC_CW else 1.0
    first, last = (fixed.arctan2(p[b] - center[b], p[a] - center[a]) for p in (start, end))
    sweep = (side * (last - first)) % (2 * np.pi) or 2 * np.pi
    radius = fixed.hypot(start[a] - center[a], start[b] - center[b])
    count = max(int(np.ceil(fixed.hypot(radius * sweep, end[third] - start[third]) / LOOKED_MM)), 1)
    share = np.arange(count + 1) / count
    points = np.empty((count + 1, 3))
    points[:, a] = center[a] + radius * fixed.cos(first + side * share * sweep)
    points[:, b] = center[b] + radius * fixed.sin(first + side * share * sweep)
    points[:, third] = start[third] + share * (end[third] - start[third])
    return points


# fixtures --------------------------------------------------------------------------------------


def nearest_to_fixtures(along, tool, fixtures, spindle_head=()):
    """The nearest that disc, arbor and head come to each fixture, over the whole of all moves.

    Args:
        along: Stations.   tool: cutters.Tool on a head.
        fixtures: scene.Fixture values in the same frame; what lies below one counts as part of it.
    Returns:
        list of Nearest, every part against every fixture.
    """
    found = []
    for fixture in fixtures:
        for name, clear in _to_fixture(along, tool, fixture, spindle_head):
            k = int(clear.argmin())
            found.append(Nearest(part=name, fixture=fixture.name, clearance_mm=float(clear[k]),
                                 center_mm=tuple(along.points_mm[k].round(3).tolist())))
    return found


def _to_fixture(along, tool, fixture, spindle_head):
    """(part's name, (n,) clearance of each station, what lies between them allowed for)."""
    low, high = np.array([fixture.min_mm[0], fixture.min_mm[1], -np.inf]), np.asarray(fixture.max_mm, float)
    yield DISC, _disc_mm(along.points_mm, tool, low, high) - LOOKED_MM / 2
    for part in parts_of(tool, spindle_head):
        box = np.array(part.min_mm), np.array(part.max_mm)
        yield part.name, _box_mm(along.points_mm, *box, low, high) - LOOKED_MM / 2


def _disc_mm(centers, tool, low, high):
    """(n,) distance of the disc, a cylinder along x round its middle, from a box."""
    aside = np.maximum(np.maximum(low[0] - centers[:, 0], centers[:, 0] - high[0]) - tool.driven_mm, 0.0)
    over = np.maximum(np.maximum(low[1:] - centers[:, 1:], centers[:, 1:] - high[1:]), 0.0)
    inside = np.maximum(low[1:] - centers[:, 1:], centers[:, 1:] - high[1:]).max(axis=1)
    radial = np.where((over > 0).any(axis=1), np.linalg.norm(over, axis=1), inside) - tool.cutter.radius_mm
    return np.where(aside > 0, fixed.hypot(aside, np.maximum(radial, 0.0)), radial)


def _box_mm(centers, part_low, part_high, low, high):
    """(n,) distance of a box that goes along, from a fixed one; negative: the least way out."""
    gaps = np.maximum(low - (centers + part_high), centers + part_low - high)
    outside = np.linalg.norm(np.maximum(gaps, 0.0), axis=1)
    return np.where((gaps > 0).any(axis=1), outside, gaps.max(axis=1))


# stock -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class StockCells:
    """The highest stock in each cell of a grid over the billet; nothing stands beside it."""

    origin_mm: np.ndarray       # (2,) corner of cell (0, 0)
    heights_mm: np.ndarray      # (nx, ny)
    end_y_mm: float             # of the billet

    @classmethod
    def over(cls, low, high, highest_within_mm):
        """Over a billet from low (3,) to high (3,); `highest_within_mm(xy (n, 2), radius)` bounds its stock."""
        nx, ny = (max(int(np.ceil((b - a) / PITCH_MM)), 1) for a, b in zip(low[:2], high[:2]))
        x, y = (low[k] + PITCH_MM * (np.arange(n) + 0.5) for k, n in enumerate((nx, ny)))
        grid = np.meshgrid(np.minimum(x, high[0]), np.minimum(y, high[1]), indexing="ij")
        xy = np.stack(grid, axis=-1).reshape(-1, 2)
        heights = highest_within_mm(xy, PITCH_MM / np.sqrt(2.0))
        return cls(origin_mm=np.asarray(low[:2], float), end_y_mm=float(high[1]),
                   heights_mm=np.where(heights > low[2], heights, -np.inf).reshape(nx, ny))

    def under_box_mm(self, points_mm, low, high, margin_mm):
        """(n,) highest stock under a box (2,) low to (2,) high from points, grown by a margin all round."""
        low, high = np.asarray(low) - margin_mm, np.asarray(high) + margin_mm
        first = np.floor((points_mm[:, :2] + low - self.origin_mm) / PITCH_MM).astype(int)
        return _pick(_forward_max(self.heights_mm, np.ceil((high - low) / PITCH_MM).astype(int) + 1), first)

    def over_disc_mm(self, points_mm, half_width_mm, radius_mm, aside_mm):
        """(n,) height at which the middle of a disc along x just clears the stock.

        Args:
            points_mm: (n, 3) middles.   half_width_mm, radius_mm: of the disc.
            aside_mm: (n,) how far the middle may stand beside its point.
        """
        reach = half_width_mm + aside_mm.max(initial=0.0)
        wide = _forward_max(self.heights_mm, (int(np.ceil(2 * reach / PITCH_MM)) + 1, 1))
        first = np.floor((points_mm[:, 0] - reach - self.origin_mm[0]) / PITCH_MM).astype(int)
        found = np.full(len(points_mm), -np.inf)
        for j in range(self.heights_mm.shape[1]):                   # rows of cells across, few over a narrow billet
            low = self.origin_mm[1] + j * PITCH_MM
            high = min(low + PITCH_MM, self.end_y_mm)
            beside = np.maximum(np.maximum(low - points_mm[:, 1], points_mm[:, 1] - high) - aside_mm, 0.0)
            under = np.flatnonzero(beside < radius_mm)
            top = _pick(wide, np.column_stack([first[under], np.full(len(under), j)]))
            found[under] = np.maximum(found[under], top + np.sqrt(radius_mm ** 2 - beside[under] ** 2))
        return found


@dataclass(frozen=True, eq=False, kw_only=True)
class _Windows:
    """values[i + before] belongs to the cell i; farther out the outermost values go on."""

    values: np.ndarray
    before: tuple


def _forward_max(heights, size):
    """_Windows: the highest of the `size` cells from a cell on, along both axes."""
    for axis, n in enumerate(size):
        room = [(n, n) if k == axis else (0, 0) for k in range(2)]
        padded = np.pad(heights, room, constant_values=-np.inf)
        heights = np.lib.stride_tricks.sliding_window_view(padded, n, axis=axis).max(axis=-1)
    return _Windows(values=heights, before=tuple(size))


def _pick(windows, cell):
    i, j = (np.clip(cell[:, k] + windows.before[k], 0, windows.values.shape[k] - 1) for k in range(2))
    return windows.values[i, j]


# a program -------------------------------------------------------------------------------------


def put_contacts(worst, posted, tool, fixtures, cells, wanted_mm, spindle_head=()):
    """Contacts of one tool on a head, over the whole of its moves.

    Args:
        worst: (4, rows, 4) by kind and row: amount, place; contacts deeper than what is there are written in.
        posted: PostedMoves with the tool as it hangs.   tool: cutters.Tool on a head.
        fixtures: scene.Fixture values, WCS.   cells: StockCells, WCS.
        wanted_mm: (3,) distance to the stock by kind: rapids, shank, holder.
    Returns:
        (proven distance of the head from the stock, at most the one wanted; place (3,)): inf, None without a move.
    """
    driven = posted.on_head(tool.number, tool.head.axis, -tool.driven_mm)       # from the tip back to the middle
    along = stations(np.where((posted.tool == tool.number)[:, None], driven.start_mm, np.nan), driven)
    points, half = along.points_mm, LOOKED_MM / 2
    if not len(points):
        return np.inf, None
    for fixture in fixtures:
        for _, clear in _to_fixture(along, tool, fixture, spindle_head):
            _put(worst[FIXTURE], along, -clear)
    rapid = np.flatnonzero(along.is_rapid)
    if len(rapid):
        lowest = cells.over_disc_mm(points[rapid], tool.driven_mm, tool.cutter.radius_mm - TOUCH_MM,
                                    half * along.aside[rapid])
        _put(worst[RAPID], along, lowest - points[rapid, 2] + half * along.down[rapid], rapid)
    nearest, place = np.inf, None
    for part in parts_of(tool, spindle_head):
        wanted = wanted_mm[part.kind]
        stock = cells.under_box_mm(points, part.min_mm[:2], part.max_mm[:2], wanted + half)
        gap = points[:, 2] + part.min_mm[2] - stock - half
        _put(worst[part.kind], along, wanted - gap)
        k = int(gap.argmin())
        if part.kind == HOLDER and min(gap[k], wanted) < nearest:
            nearest, place = float(min(gap[k], wanted)), points[k]
    return nearest, place


def _put(table, along, amount, which=slice(None)):
    """Write amounts (n,) of stations into the rows of a table (rows, 4) where they are the largest and above 0."""
    row, points = along.row[which], along.points_mm[which]
    some = np.flatnonzero(amount > np.maximum(table[row, 0], 0.0))
    some = some[np.argsort(amount[some], kind="stable")]            # the last one written stays
    table[row[some]] = np.column_stack([amount[some], points[some]])
