r"""What every cutting move meets: the stretch of the edge in the cut, how far round, how much it takes, measured on the stock.

At places along the way (a share of the cutter's radius apart where it is short, else evenly, and where a rough look says that most
is taken) rings round the cutter's axis are followed over its front, from one side of the feed to the other:

       feed ▲            a ring leaves out what is surely clear: its next place is as far on as the stock is away, or as the
          ╱‾‾‾╲          cut goes on.  Where that changes sign the edge enters or leaves the cut.
         │  ·  │
          ╲___╱          rings lie close together along the edge; the lowest and the highest in the cut are halved out.

Chips thinner than THIN_MM are not seen, nor what lies between two rings or between two places.
"""

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from cuspline.process.earlier_cuts import (
    CutPieces,
    cut_off_distance,
    found_depth,
    found_for_kernel,
    radii_mm,
    seen_tools,
    swept_depth,
)
from cuspline.program.program import Kind
from cuspline.stock import tree
from cuspline.stock.path_pieces import X0, X1
from cuspline.stock.tilted_kernels import WAITING
from cuspline.stock.tilted_pieces import AXIS_WAY, LENGTH, WAY
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.compiled import njit
from cuspline.values.rows import FROM, TO, put
from cuspline.values.threads import in_blocks

BEHIND = 0.1              # of the radius: what the cutter has swept on its last way is not taken for an earlier cut
TURN_COSINE = 0.985       # of the angle between two moves, 10 degrees: from there on the end of the first is looked at
END_RAD = np.radians(1.0)           # and where the end of the cut is looked for, which may be a point,
BESIDE_RAD = np.radians(20.0)       # so far beside the nearest arc
THIN_MM = 5e-4            # chips
HALVINGS = 6              # of the distance of two rings,
CLEAR = 0.2               # of a ring's radius: how much farther is clear is not asked, the next step is no longer
CROSSINGS = 3             # halvings of the step in which a ring enters or leaves the cut
LOOKED_AT = 32            # at so many places of a ring at most
NARROWER = 3              # halvings of a step in which an arc that is narrower is looked for
TIP_SHARE = 0.05          # of the radius: as near to its axis a ball does not cut but rub
POINT_MM = 1e-9           # a ring with a smaller radius is a point
CORNER_MM, SAME = 1e-9, 1e-6    # beside a corner of the edge; sines that are the same
CHUNK = 64                # places looked at one after the other
IS_ARC, BEGINS, ENDS, AT_R, AT_Z = range(5)     # columns of an edge's parts: whether an arc, its stretch, first point or middle
WAY_R, WAY_Z = ANGLE, BEND = range(5, 7)        # direction of a line; first angle and radius of an arc
RADIUS, HEIGHT, OUT, UP, WIDTH, ALONG = range(6)                # of a ring: its radius and height, the normal there, width, place
FIRST, LAST = range(2)                                          # of an arc in the cut: its ends
ROUND, FORWARD, BEGIN, END, ARC = range(5)              # of a ring in the cut: length and integral of the cosine of all its arcs;
                                                        # where the first begins and the last ends; ends of one arc after another
ARCS = 3                  # of a ring at most: of more the widest
RING = ARC + 2 * ARCS     # columns
SIDE = float(fixed.sin(math.radians(10.0))) * (1 - 1e-9)        # of the radius: nearer to its axis the cutter's arcs do not count
                          # as its immersion: on the least way down they widen to a whole turn
CLOSER = 3                # times the rings beside the most immersed one are looked at, each time half as far from it
LOWEST, HIGHEST, WIDEST, RATE = range(4)                        # of a place: lengths along the edge, see Engagement
TIP_X, TIP_Y, TIP_Z, LEVEL, RISE = range(5)                     # of a place: tip; feed (unit) across the axis and along it,
AHEAD, ASIDE, ALONG_AXIS = range(5, 14, 3)                      # unit vectors: feed's part across the axis, left of it, axis


@dataclass(frozen=True, kw_only=True)
class Look:
    """How closely to look."""

    apart: float = 0.5              # of the cutter's radius, between two places
    most_places: int = 500          # of a program: a longer way has them farther apart
    screened: int = 4_000           # places of a longer way that are looked at roughly first, a quarter of them where it turns;
    closer: int = 8                 # of each operation so many with the deepest and so many with the largest cuts are looked at
    ring_rad: float = math.radians(10.0)    # between rings on a round edge
    ring_share: float = 1 / 6       # of the radius, between rings on a straight one
    round_rad: float = math.radians(6.0)    # the shortest step along a ring
    only_tip: bool = False          # only whether the tip is in the cut: nothing above the lowest place in the cut is looked at

    @classmethod
    def finer(cls, by):
        """So many times as fine as usual."""
        return cls(apart=cls.apart / by, ring_rad=cls.ring_rad / by, ring_share=cls.ring_share / by, round_rad=cls.round_rad / by)


ROUGHLY = Look(ring_rad=math.radians(30.0), ring_share=1.0, round_rad=math.radians(25.0))       # at places that are screened


@dataclass(frozen=True, eq=False, kw_only=True)
class Engagement:
    """What the cutter meets at places along a program's cutting moves; one row a place, in the order of cutting."""

    row: np.ndarray             # (n,) row of PostedMoves
    way_mm: np.ndarray          # (n,) length of cutting way that the place stands for; 0: it was looked at for what it may take
    tip_mm: np.ndarray          # (n, 3) WCS
    lowest_mm: np.ndarray       # (n,) height over the tip from which on the edge cuts; NaN: it cuts air
    highest_mm: np.ndarray      # (n,) up to which
    lowest_radius_mm: np.ndarray    # (n,) distance from the axis there
    highest_radius_mm: np.ndarray   # (n,)
    immersion_rad: np.ndarray   # (n,) largest sum of the arcs of one ring, of those beside the tip where there are such
    area_mm2: np.ndarray        # (n,) volume removed a length of way
    arcs: np.ndarray            # (n, rings, ARCS, 2) ends of each ring's arcs, from the feed against the clock; NaN: none
    unseen: tuple[int, ...]     # numbers of the tools whose cuts are not looked at
    ends_mm: np.ndarray         # (n, 2) lengths along the edge from the tip between which it cuts
    feed: np.ndarray            # (n, 3) unit direction of the feed as the tool sees it: ahead, 0, along its axis
    look: Look                  # how closely it was looked

    def __post_init__(self):
        n = len(self.row)
        wide = {"tip_mm": (n, 3), "feed": (n, 3), "ends_mm": (n, 2)}
        for name in (f.name for f in fields(self) if f.name not in ("arcs", "unseen", "look")):
            dtype = np.int64 if name == "row" else float
            object.__setattr__(self, name, frozen(getattr(self, name), wide.get(name, (n,)), name, dtype))
        object.__setattr__(self, "arcs", frozen(self.arcs, (n, None, ARCS, 2), "arcs", is_handed_over=True))

    def of(self, rows):
        """Some of the places (k,)."""
        return replace(self, **{f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name not in ("unseen", "look")})

    @property
    def cuts(self):
        """(n,) bool: the edge meets stock."""
        return np.isfinite(self.lowest_mm)

    @property
    def depth_mm(self):
        """(n,) a_m: stretch of the edge in the cut on its way round, along the axis; never less than at one moment."""
        return np.nan_to_num(self.highest_mm - self.lowest_mm)

    def has_tip(self, radius_mm):
        """(n,) bool: the edge cuts nearer to the axis than TIP_SHARE of a radius, scalar or (n,)."""
        return self.cuts & (self.lowest_radius_mm <= TIP_SHARE * np.asarray(radius_mm))


def engagement(posted, tools, stock, look=Look()):
    """Engagement of a program's cutting moves from the stock as it stands before each of them.

    Seen are balls, bull noses, flat cutters and tapered balls, leaning or not; what tools on angle heads take off is not known
    here, and counts as standing.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool}.   stock: scene.FoundStock.
        look: Look.
    """
    cut = CutPieces.of(posted, tools)
    way = _Way.of(posted, tools, cut, look)
    cutters, found = {n: tools[n].cutter for n in np.unique(cut.tool[way.length_mm > 0]).tolist()}, found_for_kernel(stock)
    edges = {number: edge_of(cutter, look) for number, cutter in cutters.items()}
    even, others = way.marks(), way.candidates()
    if len(others[0]) > look.most_places // 4:
        rough = {number: edge_of(cutter, ROUGHLY) for number, cutter in cutters.items()}
        amounts = _screened_at(_Places.at(way, cut, *others), cut, rough, found)
        worst = _largest(amounts, way.operation[others[0]], look.closer)
        others = others[0][worst], others[1][worst]
    piece, at = (np.concatenate(both) for both in zip(even, others))
    order = np.lexsort((at, piece))
    places = _Places.at(way, cut, piece[order], at[order])
    stands_for = way.stands_for_mm(piece, np.arange(len(piece)) < len(even[0]))[order]
    arcs, out, radii = _seen(places, cut, edges, found, look)
    used = {int(t) for t in np.unique(posted.tool[posted.kind != Kind.RAPID])}
    heights = _heights(places, cut, edges, out[:, :WIDEST])
    return Engagement(row=places.row, way_mm=stands_for, tip_mm=places.state[:, :3], lowest_mm=heights[:, 0],
                      highest_mm=heights[:, 1], lowest_radius_mm=radii[:, 0], highest_radius_mm=radii[:, 1],
                      immersion_rad=np.nan_to_num(out[:, WIDEST]), area_mm2=np.nan_to_num(out[:, RATE]),
                      arcs=arcs[..., ARC:].reshape(*arcs.shape[:2], ARCS, 2).copy(), feed=places.feed, look=look,
                      ends_mm=out[:, :WIDEST], unseen=tuple(sorted(used - set(seen_tools(tools)))))


def _seen(places, cut, edges, found, look):
    """arcs (n, rings, RING), ways (n, 4) and radii (n, 2) of places, see the columns above; NaN: not in the cut."""
    n, rings = len(places.row), max((len(e[1]) for e in edges.values()), default=0)
    arcs, out, radii = np.full((n, rings, RING), np.nan), np.full((n, 4), np.nan), np.zeros((n, 2))
    for number, (parts, ring) in edges.items():
        mine = np.flatnonzero(cut.tool[places.piece] == number)
        some, ways = np.full((len(mine), len(ring), RING), np.nan), np.full((len(mine), 4), np.nan)
        in_blocks(_looked_at, len(mine), CHUNK, *places.of_rows(mine), cut.world, found, (parts, ring), look.round_rad,
                  look.only_tip, some, ways)
        arcs[mine, :len(ring)], out[mine] = some, ways
        radii[mine] = _radii(parts, ways[:, :WIDEST])
    return arcs, out, radii


def _screened_at(places, cut, edges, found):
    """(n, 2) stretch of the edge in the cut and volume removed a length of way, roughly."""
    out = np.zeros((len(places.row), 2))
    for number, (_, rings) in edges.items():
        mine = np.flatnonzero(cut.tool[places.piece] == number)
        some = np.zeros((len(mine), 2))
        in_blocks(_screened, len(mine), CHUNK, *places.of_rows(mine), cut.world, found, rings, ROUGHLY.round_rad, some)
        out[mine] = some
    return out


def _largest(amounts, operation, count):
    """Rows, ascending, of so many largest of each column (n, k) in each operation (n,)."""
    rows = [mine[np.argsort(-amounts[mine, column], kind="stable")[:count]]
            for mine in (np.flatnonzero(operation == k) for k in np.unique(operation)) for column in range(amounts.shape[1])]
    return np.unique(np.concatenate(rows))


# places along the way ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class _Way:
    """The way of the cutters of a program, piece by piece; a share is a length over the cutter's radius."""

    way: np.ndarray         # (m, 3) of each piece
    length_mm: np.ndarray   # (m,) of those that cut; of rapids 0
    radius_mm: np.ndarray   # (m,)
    corner_mm: np.ndarray   # (m,) height over the tip of the middle of the cutter's round
    operation: np.ndarray   # (m,)
    ends: np.ndarray        # (m,) shares to the end of each piece
    ends_mm: np.ndarray     # (m,)
    run: np.ndarray         # (m,) number of the stretch of one tool, without rapids and what is not seen
    turns: np.ndarray       # (k,) pieces at whose end the path turns
    look: Look

    @classmethod
    def of(cls, posted, tools, cut, look):
        row, way = cut.row, cut.way_mm
        feeds = (posted.kind[row] != Kind.RAPID) & np.isin(cut.tool, seen_tools(tools))
        length = np.where(feeds, np.sqrt((way * way).sum(axis=1)), 0.0)
        radius = radii_mm(cut.tool, tools)
        run = np.cumsum(np.r_[True, (np.diff(cut.tool) != 0) | (np.diff(feeds.astype(int)) != 0) | (np.diff(row) > 1)])
        corner = radii_mm(cut.tool, tools, "corner_radius_mm")
        return cls(way=way, length_mm=length, radius_mm=radius, corner_mm=corner, operation=posted.operation[row], run=run,
                   look=look, ends=np.cumsum(length / np.maximum(radius, 1e-9)), ends_mm=np.cumsum(length),
                   turns=_turning(way, length, row, run, look.screened // 4))

    @property
    def share(self):
        """(m,)"""
        return self.length_mm / np.maximum(self.radius_mm, 1e-9)

    def marks(self):
        """(piece, share of it) of places evenly along the way, each in the middle of its stretch."""
        return self._even(self.look.most_places)

    def candidates(self):
        """(piece, share of it) of places between them that may take more: at turns, and evenly where the way is long."""
        total = self.ends[-1] if len(self.ends) else 0.0
        far = total > self.look.apart * self.look.most_places
        piece, at = self._even(self.look.screened - self.look.screened // 4) if far else (self.turns[:0], np.zeros(0))
        return np.concatenate([piece, self.turns]), np.concatenate([at, np.ones(len(self.turns))])

    def _even(self, most):
        total = self.ends[-1] if len(self.ends) else 0.0
        count = int(np.ceil(total / max(self.look.apart, total / most) - 1e-9)) if total > 0 else 0
        marks = (np.arange(count) + 0.5) * (total / max(count, 1))
        piece = np.searchsorted(self.ends, marks, side="left").clip(max=max(len(self.ends) - 1, 0))
        return piece, np.clip(1 - (self.ends[piece] - marks) / np.maximum(self.share[piece], 1e-300), 0.0, 1.0)

    def stands_for_mm(self, piece, is_even):
        """(n,) of places at pieces (n,): even ones share out the way of their operation, as others do where there are none."""
        operation, count = self.operation[piece] + 1, int(self.operation.max(initial=-1)) + 2
        even = np.where(is_even, self.radius_mm[piece], 0.0)
        alone = np.bincount(operation, weights=even, minlength=count)[operation] == 0
        even = np.where(alone, 1.0, even)
        whole = np.bincount(self.operation + 1, weights=self.length_mm, minlength=count)
        return even * (whole / np.maximum(np.bincount(operation, weights=even, minlength=count), 1e-300))[operation]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Places:
    """Where the cutter is looked at."""

    row: np.ndarray         # (n,)
    piece: np.ndarray       # (n,) of CutPieces
    state: np.ndarray       # (n, 14) see the columns above
    before: np.ndarray      # (n,) number of the first piece that does not count as an earlier cut
    behind: np.ndarray      # (n, 14) the piece that ends behind the cutter, cut off there,
    tree: np.ndarray        # (n,) and its tree, see CutPieces; -1: there is none

    @property
    def feed(self):
        """(n, 3) as Engagement has it."""
        return np.column_stack([self.state[:, LEVEL], np.zeros(len(self.state)), self.state[:, RISE]])

    @classmethod
    def at(cls, along, cut, piece, at):
        """At shares (n,) of pieces (n,) of a _Way."""
        mm, length = along.ends_mm, along.length_mm
        tip, axis = cut.start_mm[piece] + at[:, None] * along.way[piece], cut.axis[piece] + at[:, None] * cut.turn[piece]
        back = mm[piece] - (1 - at) * length[piece] - BEHIND * along.radius_mm[piece]
        before = np.maximum(np.searchsorted(mm, back, side="right"), np.searchsorted(along.run, along.run[piece]))
        kept = np.clip(back - (mm - length)[before], 0.0, length[before])
        part = np.divide(kept, length[before], out=np.zeros(len(kept)), where=length[before] > 0)[:, None]
        behind, is_posed = cut.geometry[before].copy(), cut.tree[before] < -1
        ends = behind[:, X0:X1] + part * along.way[before]
        behind[~is_posed, X1:X1 + 3] = ends[~is_posed]
        for columns in (slice(WAY, WAY + 3), slice(AXIS_WAY, AXIS_WAY + 3), slice(LENGTH, LENGTH + 2)):
            behind[is_posed, columns] *= part[is_posed]
        feed = along.way[piece] + along.corner_mm[piece, None] * cut.turn[piece]
        return cls(row=cut.row[piece], piece=piece, before=before, behind=behind, tree=np.where(kept > 0, cut.tree[before], -1),
                   state=np.column_stack([tip, *_seen_by_tool(feed, axis)]))

    def of_rows(self, rows):
        """state, before, behind and its tree of some, for the kernels."""
        return self.state[rows], self.before[rows], self.behind[rows], self.tree[rows]


def _seen_by_tool(feed, axis):
    """Shares of a feed across and along an axis (n,), and unit vectors (n, 3) ahead, to the left and along the axis.

    feed: (n, 3) of the middle of the cutter's round, any length.   axis: (n, 3) any length.
    """
    axis = axis / np.sqrt((axis * axis).sum(axis=1))[:, None]
    size = np.sqrt((feed * feed).sum(axis=1))
    feed = feed / np.where(size > 0, size, 1.0)[:, None]
    rise = (feed * axis).sum(axis=1)
    ahead = feed - rise[:, None] * axis
    level = np.sqrt((ahead * ahead).sum(axis=1))
    other = np.eye(3)[np.where(np.abs(axis[:, 0]) < 0.9, 0, 1)]         # straight along the axis any way is ahead
    other = other - (other * axis).sum(axis=1)[:, None] * axis
    ahead = np.where(level[:, None] > 1e-9, ahead, other)
    ahead = ahead / np.sqrt((ahead * ahead).sum(axis=1))[:, None]
    return level, rise, ahead, np.cross(axis, ahead), axis


def _turning(way, length, row, run, most):
    """Pieces at whose end the path turns by more than TURN_COSINE, within one run; where there are more, the sharpest turns."""
    unit = way / np.where(length > 0, length, 1.0)[:, None]
    cosine = (unit[:-1] * unit[1:]).sum(axis=1)
    turns = np.flatnonzero((cosine < TURN_COSINE) & (run[:-1] == run[1:]) & (row[:-1] != row[1:])
                           & (length[:-1] > 0) & (length[1:] > 0))
    return turns[np.argsort(cosine[turns], kind="stable")[:most]]


# the edge ---------------------------------------------------------------------------------------


def edge_of(cutter, look=Look()):
    """(parts, rings) of a cutter's edge, see the columns above; from the tip up to where its flutes end."""
    profile, parts, begins = cutter.profile, [], 0.0
    for start, end, centre, rho, (first, last) in zip(profile.start_mm, profile.end_mm, profile.center_mm, profile.arc_radius_mm,
                                                      profile.arc_angles_rad):
        size = rho * (last - first) if rho > 0 else float(fixed.hypot(*(end - start)))
        if rho > 0:
            parts.append((1.0, begins, begins + size, *centre, first, rho))
        else:
            parts.append((0.0, begins, begins + size, *start, *((end - start) / size)))
        begins += size
    parts = np.array(parts)
    steps = [look.ring_rad * p[BEND] if p[IS_ARC] else look.ring_share * cutter.radius_mm for p in parts]
    along, joint = [], np.empty((2, 4))
    for part, step in zip(parts, steps):
        _edge_at(part[BEGINS], parts, joint[0])             # of the part below; and of this one:
        _edge_at(part[BEGINS] + CORNER_MM, parts, joint[1])
        if along and abs(joint[1, UP] - joint[0, UP]) > SAME:     # a corner: it cuts with both sides' normals
            along.append([part[BEGINS]])
        count = max(1, int(np.ceil((part[ENDS] - part[BEGINS]) / step - 1e-9)))
        along.append(part[BEGINS] + CORNER_MM * bool(along) + (part[ENDS] - part[BEGINS]) * np.arange(count) / count)
    along = np.concatenate([*along, [begins]])
    rings, place = np.empty((len(along), 6)), np.empty(4)
    for k, u in enumerate(along.tolist()):
        _edge_at(u, parts, place)
        rings[k, :4], rings[k, ALONG] = place, u
    wide = np.diff(along)
    rings[:, WIDTH] = (np.r_[wide, 0.0] + np.r_[0.0, wide]) / 2
    return parts, rings


@njit
def _edge_at(u, parts, place):
    """Radius, height and outward normal of the edge at a length from the tip."""
    k = 0
    while k < len(parts) - 1 and u > parts[k, ENDS]:
        k += 1
    s = u - parts[k, BEGINS]
    if parts[k, IS_ARC] != 0.0:
        rho = parts[k, BEND]
        turn = parts[k, ANGLE] + s / rho
        out, up = fixed.cos(turn), fixed.sin(turn)
        place[RADIUS], place[HEIGHT], place[OUT], place[UP] = parts[k, AT_R] + rho * out, parts[k, AT_Z] + rho * up, out, up
    else:
        place[RADIUS], place[HEIGHT] = parts[k, AT_R] + s * parts[k, WAY_R], parts[k, AT_Z] + s * parts[k, WAY_Z]
        place[OUT], place[UP] = parts[k, WAY_Z], -parts[k, WAY_R]


def _radii(parts, along):
    """(n, 2) radius of the edge at lengths from the tip (n, 2)."""
    return _at(parts, along, RADIUS)


@njit
def _at(parts, along, column):
    """A column of `_edge_at` at lengths (n, 2) along the edge; NaN where they are."""
    out, place = np.full(along.shape, np.nan), np.empty(4)
    for i in range(len(along)):
        for j in range(along.shape[1]):
            if math.isfinite(along[i, j]):
                _edge_at(along[i, j], parts, place)
                out[i, j] = place[column]
    return out


def _heights(places, cut, edges, along):
    """(n, 2) height of the edge at lengths from the tip."""
    out = np.full(along.shape, np.nan)
    for number, (parts, _) in edges.items():
        mine = np.flatnonzero(cut.tool[places.piece] == number)
        out[mine] = _at(parts, along[mine], HEIGHT)
    return out


# rings ------------------------------------------------------------------------------------------


@njit
def _looked_at(state, before, behind, trees, world, found, edge, shortest, only_tip, arcs, ways, first, last):
    """Fills in arcs (n, rings, RING) and ways (n, 4) of places first..last-1; see `Look.only_tip`."""
    (stack, bounds), waiting = tree.work(), np.empty((WAITING, 6))
    parts, rings = edge
    place, arc, was, everywhere = np.empty(4), np.empty(RING), np.zeros(RING), np.array([-math.pi, math.pi])
    for k in range(first, last):
        here = state[k], before[k], behind[k], trees[k], world, found, waiting
        lowest, highest, rate = -1, -1, 0.0
        was[ROUND] = 0.0
        for j in range(len(rings)):
            put(place, rings[j, :4])
            _round(here, place, shortest, everywhere, arc, stack, bounds)
            if arc[ROUND] > 0.0 and was[ROUND] > 0.0:
                rate += _taken(state[k], parts, rings[j - 1, ALONG], was, rings[j, ALONG], arc)
            put(was, arc)
            if arc[ROUND] <= 0.0:
                continue
            lowest = j if lowest < 0 else lowest
            highest = j
            put(arcs[k, j], arc)
            if only_tip:
                break
        if lowest < 0:
            continue
        ways[k, LOWEST], below = _end_of(here, edge, lowest, -1, arcs[k, lowest], stack, bounds)
        if only_tip:
            continue
        ways[k, HIGHEST], above = _end_of(here, edge, highest, 1, arcs[k, highest], stack, bounds)
        ways[k, WIDEST], ways[k, RATE] = _immersed(here, edge, arcs[k], stack, bounds), rate + below + above


@njit
def _immersed(here, edge, arcs, stack, bounds):
    """Largest sum of the arcs of one ring beside the tip, arcs (rings, RING) being known; near the tip where there is none.

    Between two rings it may be larger: beside the largest it is looked for, CLOSER times, half as far away each time.
    """
    parts, rings = edge
    first, at = _most_immersed(rings, arcs, SIDE * rings[len(rings) - 1, RADIUS])
    if at < 0:
        first, at = _most_immersed(rings, arcs, POINT_MM)           # the tip itself has no arc
    if at < 0:
        return 0.0
    place, arc, everywhere = np.empty(4), np.empty(RING), np.array([-math.pi, math.pi])
    low, high = rings[max(at - 1, first), ALONG], rings[min(at + 1, len(rings) - 1), ALONG]
    middle, most = rings[at, ALONG], arcs[at, ROUND]
    for _ in range(CLOSER):
        below, above = 0.5 * (low + middle), 0.5 * (middle + high)
        begin, centre, end = below, middle, above
        for u in (below, above):
            if abs(u - middle) < CORNER_MM:
                continue
            _edge_at(u, parts, place)
            _round(here, place, END_RAD, everywhere, arc, stack, bounds)
            if arc[ROUND] > most:
                most, centre = arc[ROUND], u
                begin, end = (low, middle) if u < middle else (middle, high)
        low, middle, high = begin, centre, end
    return most


@njit
def _most_immersed(rings, arcs, least_mm):
    """(the first ring with at least that radius, the one of those whose arcs are longest, -1: none is in the cut)."""
    first, at = -1, -1
    for j in range(len(rings)):
        if rings[j, RADIUS] >= least_mm:
            first = j if first < 0 else first
            if arcs[j, ROUND] > 0.0 and (at < 0 or arcs[j, ROUND] > arcs[at, ROUND]):
                at = j
    return first, at


@njit
def _screened(state, before, behind, trees, world, found, rings, shortest, out, first, last):
    """Fills in out (n, 2) of places first..last-1: stretch of the edge in the cut, volume removed a length of level way."""
    (stack, bounds), waiting = tree.work(), np.empty((WAITING, 6))
    place, arc, everywhere = np.empty(4), np.empty(RING), np.array([-math.pi, math.pi])
    for k in range(first, last):
        here, lowest = (state[k], before[k], behind[k], trees[k], world, found, waiting), -1
        for j in range(len(rings)):
            put(place, rings[j, :4])
            _round(here, place, shortest, everywhere, arc, stack, bounds)
            if arc[ROUND] > 0.0:
                lowest = j if lowest < 0 else lowest
                out[k, 0] = rings[j, ALONG] - rings[lowest, ALONG] + rings[j, WIDTH]
                out[k, 1] += rings[j, WIDTH] * rings[j, RADIUS] * arc[FORWARD]


@njit
def _taken(state, parts, begin, at_begin, end, at_end):
    """Volume taken between two lengths along the edge, a length of way, out of what is in the cut at both."""
    low, middle, high = np.empty(4), np.empty(4), np.empty(4)
    _edge_at(begin, parts, low)
    _edge_at(0.5 * (begin + end), parts, middle)
    _edge_at(end, parts, high)
    level = state[LEVEL]
    side = (end - begin) / 6 * (low[RADIUS] * low[OUT] + 4 * middle[RADIUS] * middle[OUT] + high[RADIUS] * high[OUT])
    bottom = 0.5 * (high[RADIUS] * high[RADIUS] - low[RADIUS] * low[RADIUS])
    return (level * side * 0.5 * (at_begin[FORWARD] + at_end[FORWARD])
            - state[RISE] * bottom * 0.5 * (at_begin[ROUND] + at_end[ROUND]))


@njit
def _end_of(here, edge, ring, side, known, stack, bounds):
    """Length from the tip at which the cut ends beyond a ring, below or above it, and what is taken between, a length of way."""
    (parts, rings), (state, _, _, _, _, _, _) = edge, here
    other, place, arc, last = ring + side, np.empty(4), np.empty(RING), known.copy()
    if other < 0 or other >= len(rings):
        return rings[ring, ALONG], 0.0
    within, beyond, taken, halved = rings[ring, ALONG], rings[other, ALONG], 0.0, 0
    middle = beyond                                     # it was looked at with longer steps: is it clear?
    while halved < HALVINGS:
        _edge_at(middle, parts, place)
        window = np.array([last[BEGIN] - BESIDE_RAD, last[END] + BESIDE_RAD])
        step = max(END_RAD, (window[TO] - window[FROM]) / LOOKED_AT)
        peak = _round(here, place, step, window, arc, stack, bounds)
        if arc[ROUND] <= 0.0 and peak == peak:          # narrower than a step?
            _narrow(here, place, peak, step, arc, stack, bounds)
        if arc[ROUND] > 0.0:
            taken += side * _taken(state, parts, within, last, middle, arc)
            within = middle
            put(last, arc)
            if middle == beyond:
                other += side
                if other < 0 or other >= len(rings):
                    return within, taken
                beyond = middle = rings[other, ALONG]
                continue
        else:
            beyond = middle
        halved += 1
        middle = 0.5 * (within + beyond)
    end = 0.5 * (within + beyond)
    arc[ROUND], arc[FORWARD] = 0.75 * last[ROUND], 0.75 * last[FORWARD]     # it narrows to a point, or ends at once
    return end, taken + side * _taken(state, parts, within, arc, end, arc)


@njit
def _round(here, place, shortest, window, arc, stack, bounds):
    """Follows one ring over the front of the cutter, by steps no shorter than that; `arc` takes what is in the cut.

    Args:
        window: (2,) only from there to there.
    Returns:
        the angle of those looked at that lies deepest in the stock; NaN: none is looked at.
    """
    state, _, _, _, _, _, _ = here
    level = state[LEVEL]
    arc[:] = math.nan
    arc[ROUND], arc[FORWARD] = 0.0, 0.0
    forward, rise = place[OUT] * level, place[UP] * state[RISE]
    if forward + rise < 1e-9 and place[RADIUS] >= POINT_MM:         # nothing of it goes on: a level bottom slides
        return math.nan
    half = math.pi
    if rise < forward:
        half = fixed.arccos(min(max(-rise / max(forward, 1e-300), -1.0), 1.0))
    turn, end_of_way = max(-half, window[FROM]), min(half, window[TO])
    hint, start, was, at_was = -1, math.nan, 0.0, 0.0
    if place[RADIUS] < POINT_MM:
        up = place[HEIGHT]
        depth, _ = _depth(state[TIP_X] + up * state[ALONG_AXIS], state[TIP_Y] + up * state[ALONG_AXIS + 1],
                          state[TIP_Z] + up * state[ALONG_AXIS + 2], 0.0, here, -1, stack, bounds)
        if depth > THIN_MM:
            arc[ROUND], arc[FORWARD], arc[BEGIN], arc[END] = 2 * half, 2 * fixed.sin(half), -half, half
            _keep(arc, -half, half)
        return math.nan
    is_first, deepest, peak = True, -math.inf, math.nan
    while True:
        over, hint = _over(here, place, turn, hint, stack, bounds)
        if over > deepest:
            deepest, peak = over, turn
        crossing = turn
        if not is_first and (over > 0.0) != (at_was > 0.0):
            crossing, hint = _crossing(here, place, was, at_was, turn, over, hint, stack, bounds)
        if over > 0.0 and math.isnan(start):
            start = crossing
        if not math.isnan(start) and (over <= 0.0 or turn >= end_of_way):
            end = turn if over > 0.0 else crossing
            arc[BEGIN], arc[END] = start if math.isnan(arc[BEGIN]) else arc[BEGIN], end
            arc[ROUND] += end - start
            arc[FORWARD] += fixed.sin(end) - fixed.sin(start)
            _keep(arc, start, end)
            start = math.nan
        if turn >= end_of_way:
            return peak
        was, at_was, is_first = turn, over, False
        turn = min(turn + max(abs(over) / place[RADIUS], shortest), end_of_way)


@njit
def _narrow(here, place, peak, step, arc, stack, bounds):
    """Follows a ring where it is deepest within a step of an angle, if it is in the cut there; else leaves `arc` as it is."""
    half, at_peak = 0.5 * step, -math.inf
    for _ in range(NARROWER):
        for turn in (peak - half, peak + half):
            over, _ = _over(here, place, turn, -1, stack, bounds)
            if over > at_peak:
                at_peak, at = over, turn
        middle, _ = _over(here, place, peak, -1, stack, bounds)
        if at_peak > middle:
            peak = at
        if max(at_peak, middle) > 0.0:
            _round(here, place, half / LOOKED_AT, np.array([peak - step, peak + step]), arc, stack, bounds)
            return
        half, at_peak = 0.5 * half, -math.inf


@njit
def _keep(arc, start, end):
    """Among the ARCS widest of a ring."""
    least, at = end - start, -1
    for k in range(ARC, RING, 2):
        if math.isnan(arc[k]):
            arc[k], arc[k + 1] = start, end
            return
        if arc[k + 1] - arc[k] < least:
            least, at = arc[k + 1] - arc[k], k
    if at >= 0:
        arc[at], arc[at + 1] = start, end


@njit
def _crossing(here, place, was, at_was, turn, at_turn, hint, stack, bounds):
    """Where between two places of a ring the edge enters or leaves the cut: halved, then along a straight line."""
    for _ in range(CROSSINGS):
        middle = 0.5 * (was + turn)
        over, hint = _over(here, place, middle, hint, stack, bounds)
        if (over > 0.0) == (at_was > 0.0):
            was, at_was = middle, over
        else:
            turn, at_turn = middle, over
    return was + (turn - was) * at_was / (at_was - at_turn), hint


@njit
def _over(here, place, turn, hint, stack, bounds):
    """How much deeper than a chip that is not seen a place of a ring is in the stock, and the piece that is nearest."""
    state, _, _, _, _, _, _ = here
    c, s = fixed.cos(turn), fixed.sin(turn)
    ahead, aside, up = place[RADIUS] * c, place[RADIUS] * s, place[HEIGHT]
    x = state[TIP_X] + ahead * state[AHEAD] + aside * state[ASIDE] + up * state[ALONG_AXIS]
    y = state[TIP_Y] + ahead * state[AHEAD + 1] + aside * state[ASIDE + 1] + up * state[ALONG_AXIS + 1]
    z = state[TIP_Z] + ahead * state[AHEAD + 2] + aside * state[ASIDE + 2] + up * state[ALONG_AXIS + 2]
    depth, hint = _depth(x, y, z, -CLEAR * place[RADIUS], here, hint, stack, bounds)
    return depth - THIN_MM, hint


@njit
def _depth(px, py, pz, enough, here, hint, stack, bounds):
    """How deep a place is in the stock in front of the cutter, and the piece that is nearest; see `swept_depth`."""
    _, before, behind, which, world, found, waiting = here
    best = found_depth(px, py, pz, found)
    if best <= 0.0:
        return best, hint
    if which != -1:
        best = min(best, cut_off_distance(px, py, pz, behind, which, best, world, waiting))
    depth, piece = swept_depth(px, py, pz, before, best, enough, world, hint, stack, bounds, waiting)
    return depth, piece if piece >= 0 else hint
