"""Speeds and feeds of planned operations by what their edges really meet: constant cutting speed, chips of even thickness.

The planned moves are cut in the stock as it stands; where speed or feed has to change within a move it is parted, its way stays
the same.  A program gets no more than twice its blocks.

    moves ─► parts ─► engagement at places along them ─► S and F of every part ─► parts that are alike joined again
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.planning import feeds
from cuspline.process.chip_loads import chip_shares, full_cut_factor, thin_chip_factor, width_shares
from cuspline.process.cut_of_operations import cuts_of_operations
from cuspline.process.cutting_speed import BANDS, spindle_speeds
from cuspline.process.drives import Drives, deviations_mm
from cuspline.process.earlier_cuts import SEEN
from cuspline.process.engagement import Engagement, Look, engagement
from cuspline.process.forces import forces, limits_of
from cuspline.program.arcs import Arc
from cuspline.program.posted import PostedMoves
from cuspline.program.program import TILT_RAD, Kind, Moves, Plane
from cuspline.replay.scene import FoundStock, ZMap
from cuspline.shop.cutting_forces import force_of

LOOK = Look(apart=0.2, most_places=4000, screened=4, ring_rad=np.radians(15.0), ring_share=1 / 3, round_rad=np.radians(10.0))
BLOCKS = 2.0              # times those planned, at most
STEP_SHARE = 0.125        # of the radius: no part is shorter
FACTORS = np.cumprod([0.1, *[1.1] * 30])         # of feeds: in steps, so that few blocks differ
FACTORS /= FACTORS[np.abs(FACTORS - 1).argmin()]        # one of them is 1
KEPT_SHARE = 0.9          # of what spindle, cutter and drives stand, that feeds keep to
HARD_HRC = 45             # from here on a steel counts as hardened
STOCK_NODES = 15_000      # of the grid over the stock that the setup finds
FULL_FEED = 0.999         # of the operation's largest feed: what runs slower goes down into stock, or in and out


def follows_engagement(plan):
    """A SetupPlan with speeds and feeds of its operations as they wish; operations without a wish stay what they are.

    Args:
        plan: planning.plan.SetupPlan.
    Returns:
        SetupPlan; `facts["process"]` of its operations says what was used, and why not where not.
    """
    machine = plan.context.machine
    wished = [_within_control(o, machine) for o in plan.operations]
    able = {k: why_not(o) for k, o in enumerate(wished) if o.wishes is not None}
    if not able:
        return replace(plan, operations=tuple(wished))
    parted = {k: _parted(o, machine) for k, o in enumerate(wished) if able.get(k) == ""}
    cut = [replace(o, moves=parted[k][0]) if k in parted else o for k, o in enumerate(wished)]
    met = Met.of(plan, cut) if parted else None
    operations = []
    for k, o in enumerate(wished):
        if k in parted:
            o = _followed(plan, k, o, parted[k], met)
        elif k in able:
            o = replace(o, facts={**o.facts, "process": {name: f"not used: {able[k]}" for name in _wished(o)}})
        operations.append(o)
    return replace(plan, operations=tuple(operations))


def why_not(operation):
    """Why speeds and feeds of a PlannedOperation cannot follow what its edges meet; "" where they can."""
    if operation.passes is not None:
        return "its passes are repeated ones, with one feed each"
    if operation.compensated:
        return "the control shifts its contours, whose blocks have one feed each"
    if operation.cycles or operation.tool.head is not None or operation.tool.cutter.type not in SEEN:
        return "what its tool meets is not known"
    return ""


def _within_control(operation, machine):
    """The operation, without the wish for a constant cutting speed where its tool leans and the control keeps the speed then."""
    wishes = operation.wishes
    if wishes is None or not wishes.is_speed_constant or machine.control.changes_speed_at_tip or not _leans(operation):
        return operation
    said = {"cutting_speed": f"not used: its tool leans, and the speed of the spindle does not change under "
                             f"{machine.control.tip_control}"}
    wishes = replace(wishes, is_speed_constant=False) if wishes.is_fed_by_engagement else None
    return replace(operation, wishes=wishes, facts={**operation.facts, "process": said})


def _leans(operation):
    return bool((operation.moves.tilt_rad > TILT_RAD).any())


def met_by(plan):
    """cut_of_operations.OperationCut of a SetupPlan's operations as planned; those that are not looked at are left out."""
    operations = [o for o in plan.operations if o.tool.head is None]
    if not operations:
        return ()
    posted, _ = as_moves(operations)
    tools = {o.tool.number: o.tool.simulated for o in operations}
    return cuts_of_operations(posted, tools, engagement(posted, tools, found_stock(plan.context)))


def process_words(operation, met, material=None):
    """What plan.json says of the process of a PlannedOperation: what was used, and why not where not; advice with its reason.

    Args:
        met: row of verify.json's "process"; None: its edges were not looked at.   material: shop.materials.Material.
    """
    said = dict(operation.facts.get("process", {}))
    for name, key in (("cutting_speed", "constant_speed"), ("feed", "feed_by_engagement")):
        said.setdefault(name, f"not used: neither operation nor shop sets {key}")
    share = None if met is None else met["tip_share"]
    if isinstance(said["cutting_speed"], dict) and met is not None:
        said["cutting_speed"] = {**said["cutting_speed"], "came_out_m_per_min": met["speeds_m_per_min"]}
    return {"process": {**said, "tip_share": share, "tip": _tip_in_words(operation, share),
                        **_coolant_advice(operation, material)}}


def _coolant_advice(operation, material):
    """Coolant on edges that enter and leave a hardened steel with every turn; nothing where there is nothing to say."""
    if material is None or (material.hardness_hrc or 0) < HARD_HRC or operation.coolant == "off":
        return {}
    return {"advice": f"{operation.coolant} in {material.name}, {material.hardness_hrc:g} HRC: milling is an interrupted cut, and "
            "edges that are cooled between two cuts chip; air or nothing keeps them longer (L. Xu, University of Florida 1996)"}


def _tip_in_words(operation, share):
    """How the tip is kept out of the cut, and why not where not."""
    if share is None:
        return "not looked at: " + (why_not(operation) or "its edges meet nothing that is seen")
    if operation.tool.cutter.type != "ball":
        return "of no concern: the cutter's bottom is flat"
    if share == 0:
        return "out of the cut"
    bearing, orders = operation.facts.get("bearing"), operation.facts.get("orders", {})
    why = f"passes run {bearing}" if bearing in ("step-up", "uphill") else "passes as laid: " + (
        "; ".join(f"{name} {_order_in_words(row)}" for name, row in orders.items() if "times_as_long" in row)
        or "step-up and uphill are orders of patterns (`bearing`), a leaning axis is one of five-axis machines")
    return f"in the cut on {100 * share:.1f} % of the way; {why}"


def _order_in_words(row):
    """Why passes do not run in an order: a row of tip_orders' facts."""
    return row.get("why_not") or (f"has it in the cut on {100 * row['tip_share']:.1f} %, "
                                  f"{100 * (row['times_as_long'] - 1):.0f} % longer, which frees too little")


def _wished(operation):
    """Names of what an operation wishes, as plan.json has them."""
    wishes = operation.wishes
    return [name for name, is_so in (("cutting_speed", wishes.is_speed_constant), ("feed", wishes.is_fed_by_engagement)) if is_so]


@dataclass(frozen=True, eq=False, kw_only=True)
class Met:
    """What the edges of a setup's operations meet."""

    posted: PostedMoves         # of all operations
    first: tuple[int, ...]      # row with which each begins, and the end
    found: Engagement
    tools: dict                 # number -> Tool
    chip: np.ndarray            # (n,) see chip_loads.chip_shares
    width: np.ndarray           # (n,) see chip_loads.width_shares

    @classmethod
    def of(cls, plan, operations, look=LOOK):
        """Of a SetupPlan's operations, on the stock that it finds."""
        posted, first = as_moves(operations)
        tools = {o.tool.number: o.tool.simulated for o in operations}
        found = engagement(posted, tools, found_stock(plan.context), look)
        return cls(posted=posted, first=first, found=found, tools=tools, chip=chip_shares(posted, tools, found),
                   width=width_shares(posted, tools, found))


def as_moves(operations):
    """PostedMoves of planned operations as they would be run, and the row with which each begins, and the end."""
    first = np.cumsum([0, *(len(o.moves) for o in operations)])
    column = lambda name: np.concatenate([getattr(o.moves, name) for o in operations])
    each = lambda value: np.concatenate([np.full(len(o.moves), value(k, o)) for k, o in enumerate(operations)])
    moves = PostedMoves(
        kind=column("kind"), start_mm=column("starts_mm"), end_mm=column("end_mm"), center_mm=column("center_mm"),
        plane=column("plane"), turns=np.zeros(first[-1]), feed_mm_per_min=column("feed_mm_per_min"),
        spindle_rpm=np.concatenate([_rpm_of(o) for o in operations]), tool=each(lambda k, o: o.tool.number),
        length_offset_on=np.ones(first[-1], bool), machine_end_mm=np.full((first[-1], 3), np.nan), line=np.arange(first[-1]),
        operation=each(lambda k, o: k), operations=tuple(o.name for o in operations), ended=True,
        start_axis=np.concatenate([np.vstack([o.moves.axis[:1], o.moves.axis])[:-1] for o in operations]), end_axis=column("axis"))
    return moves, tuple(first.tolist())


def _rpm_of(operation):
    """(n,) spindle speed of every move."""
    firsts, speeds = zip((0, operation.rpm), *operation.rpm_changes)
    return np.repeat(np.array(speeds, float), np.diff([*firsts, len(operation.moves)]))


def found_stock(context):
    """scene.FoundStock that a setup's first move finds, in the frame of its moves."""
    piece, frame = context.piece, context.setup.turn
    low, high = piece.box_in(frame)
    pitch = float(np.clip(np.sqrt(np.prod((high - low)[:2]) / STOCK_NODES), 0.1, 1.0))
    zmap = ZMap.over(low, high, pitch)
    tops = None if piece.fills_box_in(frame) else piece.heights_mm(frame, zmap.xy_mm).reshape(zmap.shape)
    return FoundStock(min_mm=low, max_mm=high, pitch_mm=pitch, top_mm=tops)


# one operation -----------------------------------------------------------------------------------


def _followed(plan, number, operation, parted, met):
    """The PlannedOperation with the speeds and feeds that it wishes."""
    (moves, origin), wishes, machine = parted, operation.wishes, plan.context.machine
    begin, end = met.first[number], met.first[number + 1]
    mine = np.flatnonzero((met.found.row >= begin) & (met.found.row < end))
    if not met.found.cuts[mine].any():
        why = {name: "not used: its edges meet nothing" for name in _wished(operation)}
        return replace(operation, facts={**operation.facts, "process": why})
    along = _Along.of(moves, met.found.row[mine] - begin)
    rpm, feed, said = np.full(len(moves), operation.rpm), wishes.feed_mm_per_min[origin], dict(operation.facts.get("process", {}))
    if wishes.is_speed_constant:
        rpm, said["cutting_speed"] = _speeds(
            operation, along, np.nan_to_num(met.found.highest_radius_mm[mine]), moves.with_feed(feed), origin, machine)
        feed = feed * (rpm / operation.rpm)
    if wishes.is_fed_by_engagement:
        is_full = wishes.feed_mm_per_min[origin] >= FULL_FEED * wishes.feed_mm_per_min.max()
        factor = _feed_factors(plan, feed, is_full, along, met, mine)
        feed, said["feed"] = feed * factor, _feed_in_words(factor, along, moves)
    feed = np.minimum(feed, machine.max_feed_mm_per_min)
    moves, rpm = _joined(moves.with_feed(feed), rpm, origin)
    moves = moves.with_feed(feeds.capped_feeds(moves, machine))
    if wishes.is_fed_by_engagement:
        moves = moves.with_feed(_kept_to_path(moves, operation, machine))
    return _with(operation, moves, rpm, said, machine)


def _with(operation, moves, rpm, said, machine):
    """The operation with other moves and speeds, and what plan.json says of it."""
    before, after = operation.facts["time_s"], round(float(feeds.times_s(moves, machine).sum()), 1)
    said = {**said, "time_before_s": before, "saved_s": round(before - after, 1), "blocks_before": len(operation.moves)}
    changes = np.flatnonzero(np.r_[False, rpm[1:] != rpm[:-1]])
    return replace(operation, moves=moves, rpm=float(rpm[0]), rpm_changes=tuple((int(k), float(rpm[k])) for k in changes),
                   facts={**operation.facts, "time_s": after, "moves": len(moves),
                          "arcs": int((moves.kind >= Kind.ARC_CW).sum()), "process": said})


@dataclass(frozen=True, eq=False, kw_only=True)
class _Along:
    """Moves and places on them by the cutting way so far."""

    begins_mm: np.ndarray       # (n,) of moves
    ends_mm: np.ndarray         # (n,)
    place_mm: np.ndarray        # (k,) of places, growing

    @classmethod
    def of(cls, moves, rows):
        """`rows` (k,) of the places, growing; those of one move are evenly along it."""
        length = np.where(moves.kind == Kind.RAPID, 0.0, feeds.move_lengths_mm(moves))
        ends = np.cumsum(length)
        count = np.bincount(rows, minlength=len(moves))
        within = np.arange(len(rows)) - (np.cumsum(count) - count)[rows]
        return cls(begins_mm=ends - length, ends_mm=ends,
                   place_mm=(ends - length)[rows] + (within + 0.5) / np.maximum(count, 1)[rows] * length[rows])

    def within(self, values):
        """(n,) the largest value on each move, along straight lines between the places (k,) whose value is not 0; NaN in air."""
        cuts = np.flatnonzero(values > 0)
        at = lambda way: np.interp(way, self.place_mm[cuts], values[cuts])
        own = np.zeros(len(self.ends_mm))
        np.maximum.at(own, np.searchsorted(self.ends_mm, self.place_mm[cuts], side="left").clip(max=len(own) - 1), values[cuts])
        found = np.maximum(own, np.maximum(at(self.begins_mm), at(self.ends_mm)))
        return np.where(self.most((values > 0).astype(float)) > 0, found, np.nan)

    def most(self, values):
        """(n,) the largest value of the places (k,) on each move and of the nearest on both sides."""
        first = np.maximum(np.searchsorted(self.place_mm, self.begins_mm, side="left") - 1, 0)
        last = np.minimum(np.searchsorted(self.place_mm, self.ends_mm, side="right"), len(values) - 1)
        both = np.column_stack([first, last + 1]).ravel()
        return np.maximum.reduceat(np.r_[values, -np.inf], both)[::2]

    def share(self, rows, of):
        """What rows (n,) bool take of the way of moves (n,) bool."""
        length = self.ends_mm - self.begins_mm
        part, whole = (float(np.cumsum(np.where(some, length, 0.0))[-1]) for some in (rows & of, of))
        return round(part / whole, 4) if whole > 0 else 0.0


def _speeds(operation, along, at_places, moves, origin, machine):
    """(n,) spindle speed of parts, and what plan.json says of it.

    Args:
        at_places: (k,) largest radius in the cut at places along the parts; 0 in air.
        moves: the parts with their feeds.   origin: (n,) the move that each is of.
    """
    speed, cutter, spindle = operation.wishes.speed_m_per_min, operation.tool.cutter, machine.spindle
    highest = float(np.floor(min(spindle.max_rpm, cutter.max_rpm or np.inf)))
    radius = along.within(at_places)
    wanted = speed * 1000 / (2 * np.pi * np.maximum(radius, 1e-9))
    times = feeds.times_s(moves, machine)
    for band in BANDS:
        rpm = spindle_speeds(np.clip(wanted, spindle.min_rpm, highest), times, spindle.turns_faster_rpm_per_s, band)
        rpm = rpm.clip(np.ceil(spindle.min_rpm), highest)
        _, joined = _joined(moves, rpm, origin)
        if len(joined) + (np.diff(joined) != 0).sum() <= BLOCKS * (origin[-1] + 1):
            break
    said = {"used": f"constant: {speed:g} m/min at the largest radius in the cut", "speed_m_per_min": round(speed, 3),
            "rpm": [float(rpm.min()), float(rpm.max())], "changes": int((np.diff(rpm) != 0).sum()), "band": band,
            "change_rpm_per_s": spindle.turns_faster_rpm_per_s,
            "share_at_fastest": along.share(wanted > highest, np.isfinite(wanted))}
    if spindle.change_rpm_per_s is None:
        said["assumed"] = "change_rpm_per_s, which the machine's file does not state"
    return rpm, said


def _feed_factors(plan, feed, is_full, along, met, mine):
    """(n,) what feeds (n,) of parts are multiplied with; what does not run in the full feed (n,) bool goes no faster."""
    thin = thin_chip_factor(along.most(met.chip[mine]), plan.context.practice.feed_most)
    factor = thin * full_cut_factor(along.most(met.width[mine]))
    factor = np.where(is_full, factor, np.minimum(factor, 1.0))
    factor = np.minimum(factor, -along.most(-_stood(plan, met, mine, feed.max())))
    return FACTORS[np.maximum(np.searchsorted(FACTORS, factor * (1 + 1e-12), side="right") - 1, 0)]


def _stood(plan, met, mine, full_mm_per_min):
    """(k,) factor of the full feed at which places reach KEPT_SHARE of what spindle and cutter stand; inf where it is not known."""
    material, stands = force_of(plan.context.design.material, plan.context.shop.forces), np.full(len(mine), np.inf)
    limits = limits_of(plan.context.machine, met.tools[int(met.posted.tool[met.found.row[mine[0]]])])
    if material is None or not limits:
        return stands
    at = lambda feed: forces(replace(met.posted, feed_mm_per_min=np.full(len(met.posted), feed)), met.tools,
                             met.found.of(mine), material)
    once, twice = at(full_mm_per_min), at(2 * full_mm_per_min)          # forces go up along a straight line
    for _, _, name, limit, _ in limits:
        one, slope = getattr(once, name), np.maximum(getattr(twice, name) - getattr(once, name), 1e-12)
        stands = np.minimum(stands, (KEPT_SHARE * limit - one + slope) / slope)
    return stands


def _kept_to_path(moves, operation, machine):
    """(n,) feeds, lowered where the drives would leave the path by more than the control may; as planned, or more."""
    drives = Drives.of(machine)
    if drives is None:
        return moves.feed_mm_per_min
    off = deviations_mm(as_moves([replace(operation, moves=moves)])[0], drives)
    share = KEPT_SHARE * machine.control.path_tolerance_mm / np.maximum(off, 1e-12)
    feed, before = moves.feed_mm_per_min, operation.moves.feed_mm_per_min.max()
    return np.where(share < 1, np.minimum(feed, np.maximum(np.floor(feed * share), np.minimum(feed, before))), feed)


def _feed_in_words(factor, along, moves):
    """What plan.json says of feeds."""
    cuts = moves.kind != Kind.RAPID
    return {"used": "chips as thick as the feed per tooth where they would be thinner, slower where the cut is wide",
            "factor": [round(float(factor[cuts].min()), 4), round(float(factor[cuts].max()), 4)],
            "share_faster": along.share(factor > 1, cuts), "share_slower": along.share(factor < 1, cuts)}


# parts ---------------------------------------------------------------------------------------------


def _parted(operation, machine):
    """Moves in parts, BLOCKS times as many at most, and the move (n,) that each is of; what does not cut stays whole.

    Those of a tool that leans stay as they are: they are short, and what the axis does within one is the control's.
    """
    moves = operation.moves
    if _leans(operation):
        return moves, np.arange(len(moves))
    length = np.where(moves.kind == Kind.RAPID, 0.0, feeds.move_lengths_mm(moves))
    lag_mm = 2 * machine.time_constant_s * moves.feed_mm_per_min.max() / 60          # shorter blocks would be slower
    step = max(STEP_SHARE * operation.tool.cutter.radius_mm, lag_mm)
    while np.maximum(np.ceil(length / step), 1).sum() > BLOCKS * len(moves):
        step *= 1.25
    counts = np.maximum(np.ceil(length / step - 1e-9), 1).astype(np.int64)
    origin, first = np.repeat(np.arange(len(moves)), counts), np.cumsum(counts) - counts
    end, starts = moves.end_mm[origin], moves.starts_mm
    for k in np.flatnonzero(counts > 1).tolist():
        share = np.arange(1, counts[k]) / counts[k]
        end[first[k]:first[k] + counts[k] - 1] = _within(moves, starts[k], k, share)
    return _rows(moves, origin, end), origin


def _within(moves, start_mm, row, share):
    """(k, 3) points of a move after shares (k,) of its way."""
    if moves.kind[row] < Kind.ARC_CW:
        return start_mm + share[:, None] * (moves.end_mm[row] - start_mm)
    arc = Arc(start_mm, moves.end_mm[row], moves.center_mm[row], Plane(moves.plane[row]), moves.kind[row])
    return np.array([arc.at(part) for part in share.tolist()])


def _rows(moves, rows, end_mm):
    """Some rows of Moves, with ends (n, 3)."""
    return Moves(start_mm=moves.start_mm, end_mm=end_mm, **{name: getattr(moves, name)[rows] for name in (
        "kind", "center_mm", "plane", "axis", "feed_mm_per_min")})


def _joined(moves, rpm, origin):
    """Parts of one move with one speed and feed joined again: (Moves, (n,) rpm)."""
    same = ((origin[1:] == origin[:-1]) & (rpm[1:] == rpm[:-1])
            & (moves.feed_mm_per_min[1:] == moves.feed_mm_per_min[:-1]))
    kept = np.flatnonzero(np.r_[~same, True])
    return _rows(moves, kept, moves.end_mm[kept]), rpm[kept]
