"""What operations take off and where their edges cut, summed up out of the engagement of their moves; verify.json's "process"."""

from dataclasses import dataclass, fields

import numpy as np

from cuspline.process.cutting_speed import turning_rpm
from cuspline.process.tool_life import change_points, edges_needed
from cuspline.program.program import Kind
from cuspline.values.amounts import counted
from cuspline.values.errors import InputError

DRAWN = 160               # stretches of a program that verify.json tells one by one
NOT_SEEN = ("not checked: the tool is on an angle head, mills threads, reams, is no ball, bull nose, flat cutter or tapered ball, "
            "or drills or taps where no figure is known")


@dataclass(frozen=True, kw_only=True)
class OperationCut:
    """Of one operation."""

    name: str
    tool: int
    way_mm: float                   # of its cutting moves
    share_in_cut: float             # of the way on which the edge meets stock
    tip_share: float                # of the way on which the tip is in the cut
    depth_mm: float                 # largest depth, and the line of its move
    depth_line: int
    immersion_deg: float            # largest sum of the arcs of one ring
    lowest_speed_m_per_min: float   # of the edge in the cut: nearest to the axis,
    highest_speed_m_per_min: float  # and farthest from it
    speeds_m_per_min: tuple[float, float, float]    # at the largest radius in the cut: 5, 50 and 95 % of the way are slower
    rpm: tuple[float, float]        # slowest and fastest in the cut
    minutes_in_cut: float
    removed_mm3: float
    removal_cm3_per_h: float        # on the way in the cut: mean
    removal_most_cm3_per_h: float   # and largest

    def as_dict(self):
        """For verify.json, rounded."""
        tidy = lambda value: round(value, 4) if isinstance(value, float) else value
        return {name: [tidy(v) for v in value] if isinstance(value, tuple) else tidy(value)
                for name, value in self.__dict__.items()}


def cuts_of_operations(posted, tools, found, change_rpm_per_s=None):
    """OperationCut of every operation whose cuts are seen, in the order of the program.

    Args:
        posted: PostedMoves.   tools: {number: cutters.Tool}.   found: engagement.Engagement of them.
        change_rpm_per_s: how fast the spindle changes its speed; None: at once.
    """
    rpm = turned_rpm(posted, change_rpm_per_s)
    return tuple(_cut(posted, tools, found, mine, name, rpm) for name, mine in _by_operation(posted, found))


def turned_rpm(posted, change_rpm_per_s):
    """(n,) mean speed of the spindle on every move.

    Where an operation begins, the tool changes, or the spindle stood still before, it has come to its speed.
    """
    rpm = np.abs(posted.spindle_rpm)
    begins = np.flatnonzero(np.r_[True, (np.diff(posted.operation) != 0) | (np.diff(posted.tool) != 0) | (rpm[:-1] == 0)])
    if change_rpm_per_s is None or not len(rpm):
        return rpm
    length = np.sqrt(((posted.end_mm - posted.start_mm) ** 2).sum(axis=1))          # of arcs the chord: the time is short of it
    times = np.divide(60 * length, posted.feed_mm_per_min, out=np.zeros(len(rpm)), where=posted.feed_mm_per_min > 0)
    parts = np.split(np.arange(len(rpm)), begins[1:])
    return np.concatenate([turning_rpm(rpm[rows], np.nan_to_num(times[rows]), change_rpm_per_s)
                           if np.ptp(rpm[rows]) > 0 else rpm[rows] for rows in parts])


def _by_operation(posted, found):
    """(name, rows of the places (k,)) of every operation with places."""
    numbers = posted.operation[found.row]
    return [(name, np.flatnonzero(numbers == k)) for k, name in enumerate(posted.operations) if (numbers == k).any()]


def _cut(posted, tools, found, mine, name, turned):
    row = found.row[mine]
    tool = int(posted.tool[row[0]])
    way, cuts = found.way_mm[mine], found.cuts[mine]
    feed, rpm = posted.feed_mm_per_min[row], turned[row]
    speed = lambda radius: 2 * np.pi * np.nan_to_num(radius[mine]) * rpm / 1000
    total, within = _sum(way), _sum(way[cuts])
    volume = _sum(way * found.area_mm2[mine])
    minutes = _sum(np.divide(way, feed, out=np.zeros(len(way)), where=cuts & (feed > 0)))
    share = lambda part: part / total if total > 0 else 0.0
    deepest = int(found.depth_mm[mine].argmax())
    return OperationCut(
        name=name, tool=tool, way_mm=total, share_in_cut=share(within),
        tip_share=share(_sum(way[found.has_tip(tools[tool].cutter.radius_mm)[mine]])),
        depth_mm=float(found.depth_mm[mine][deepest]), depth_line=int(posted.line[row[deepest]]),
        immersion_deg=float(np.degrees(found.immersion_rad[mine].max())),
        lowest_speed_m_per_min=float(speed(found.lowest_radius_mm)[cuts].min(initial=np.inf)) if cuts.any() else 0.0,
        highest_speed_m_per_min=float(speed(found.highest_radius_mm)[cuts].max(initial=0.0)),
        speeds_m_per_min=_shared_out(speed(found.highest_radius_mm)[cuts], way[cuts]),
        rpm=(float(rpm[cuts].min()), float(rpm[cuts].max())) if cuts.any() else (0.0, 0.0),
        minutes_in_cut=minutes, removed_mm3=volume, removal_cm3_per_h=0.06 * volume / minutes if minutes > 0 else 0.0,
        removal_most_cm3_per_h=float((0.06 * found.area_mm2[mine] * feed).max()))


def _shared_out(values, way):
    """Values that 5, 50 and 95 % of a way are below; 0 of no way."""
    order = np.argsort(values, kind="stable")
    so_far = np.cumsum(way[order])
    if not len(so_far) or so_far[-1] <= 0:
        return 0.0, 0.0, 0.0
    at = np.searchsorted(so_far, so_far[-1] * np.array([0.05, 0.5, 0.95])).clip(max=len(order) - 1)
    return tuple(values[order[at]].tolist())


def _sum(values):
    """One after the other: the same on every processor."""
    return float(np.cumsum(values)[-1]) if len(values) else 0.0


def edge_changes(posted, found, life):
    """What a setup's tools wear: {"T3": {...}}, or words where nothing is known of the material.

    Edges are changed before the first line of a stretch between two rapids.

    Args:
        life: shop.tool_lives.ToolLife, or None.
    """
    if life is None:
        return "not checked: no tool life is known of the material"
    feed = posted.feed_mm_per_min[found.row]
    minutes = np.divide(found.way_mm, feed, out=np.zeros(len(feed)), where=found.cuts & (feed > 0))
    stretch, out = np.cumsum(posted.kind == Kind.RAPID)[found.row], {}
    for tool in np.unique(posted.tool[found.row]).tolist():
        mine = np.flatnonzero(posted.tool[found.row] == tool)
        _, first, which = np.unique(stretch[mine], return_index=True, return_inverse=True)
        times = np.bincount(which, weights=minutes[mine])
        out[f"T{tool}"] = {"minutes_in_cut": round(_sum(times), 4), "life_min": life.life_min,
                           "sets_of_edges": edges_needed(_sum(times), life.life_min),
                           **_changes(posted, found, mine[first], times, life)}
    return out


def _changes(posted, found, first, times, life):
    """Lines before which edges are changed, or why that cannot be."""
    try:
        return {"change_before_lines": posted.line[found.row[first[change_points(times.tolist(), life.life_min)]]].tolist()}
    except InputError as error:
        return {"change_before_lines": [], "too_long": str(error)}


def not_seen(posted, found, blind=()):
    """Names of operations whose cuts are not looked at; `blind`: numbers of tools that are not looked at either."""
    cutting = posted.kind != Kind.RAPID
    rows = np.isin(posted.tool, (*found.unseen, *blind)) & cutting & (posted.operation >= 0)
    return [posted.operations[k] for k in np.unique(posted.operation[rows]).tolist()]


def process_document(posted, tools, found, places, loads=None, source="", change_rpm_per_s=None):
    """verify.json's "process" of one setup.

    Args:
        places: see `met_at_places`.
        loads: forces.Forces at the places of `found`; None: they are not known.
        source: where the material's figures come from, or why there are none.
        change_rpm_per_s: see `cuts_of_operations`.
    Returns:
        {"operations": [...], "forces": words, "not_checked": words where something is not looked at}.
    """
    rows = []
    for cut, (_, mine) in zip(cuts_of_operations(posted, tools, found, change_rpm_per_s), _by_operation(posted, found)):
        rows.append({**cut.as_dict(), **({} if loads is None else _largest(loads, mine) | _usual(loads, found, mine))})
    words = _not_checked(not_seen(posted, found))
    return {"operations": rows, "along": along_program(posted, found, places),
            "forces": source if loads is not None else f"not checked: {source}", **words}


def _not_checked(names):
    return {"not_checked": f"{counted(len(names), 'operation')}: {', '.join(names)}. {NOT_SEEN}"} if names else {}


def with_holes(document, posted, found, holes, blind):
    """verify.json's "process" with "holes", what drills and taps take; their operations are not said to be unseen.

    Args:
        document: see `process_document`.   holes: hole_forces.HoleLoad of operations that drill or tap.
        blind: numbers of tools whose simulated body says nothing of what they meet: taps, thread mills.
    """
    bored = {load.name for load in holes}
    names = [name for name in not_seen(posted, found, blind) if name not in bored]
    seen = [row for row in document["operations"] if row["name"] not in bored and row["name"] not in names]
    kept = {key: value for key, value in document.items() if key != "not_checked"}
    drilled = {"holes": [load.as_dict(int(posted.line[load.row])) for load in holes]} if holes else {}
    return {**kept, "operations": seen, **drilled, **_not_checked(names)}


def along_program(posted, found, places):
    """The largest of what edges meet on up to DRAWN stretches of a program, for plots.

    Args:
        places: see `met_at_places`.
    Returns:
        {name: list of numbers}, one a stretch; forces stand in it where they are known.
    """
    even = np.flatnonzero(found.way_mm > 0)
    if not len(even):
        return {}
    begins = np.unique(np.arange(DRAWN) * len(even) // DRAWN)
    most = lambda values: [round(v, 4) for v in np.maximum.reduceat(values, begins).tolist()]
    columns = {"way_m": np.cumsum(found.way_mm[even]) / 1000, "operation": posted.operation[found.row[even]].astype(float),
               **{name: values[even] for name, values in places.items() if name != "row"}}
    return {name: most(values) for name, values in columns.items()}


def met_at_places(posted, found, rpm, loads=None):
    """What edges meet at every place of a program that is looked at; forces stand in it where they are known.

    Args:
        rpm: (m,) of moves, see `turned_rpm`.   loads: as for `process_document`.
    Returns:
        {name: (n,)}; "row": of PostedMoves.
    """
    row = found.row
    columns = {"row": row, "depth_mm": found.depth_mm,
               "speed_m_per_min": np.nan_to_num(2 * np.pi * found.highest_radius_mm) * rpm[row] / 1000,
               "removal_cm3_per_h": 0.06 * found.area_mm2 * posted.feed_mm_per_min[row]}
    return columns if loads is None else columns | {"radial_n": loads.radial_n, "axial_n": loads.axial_n}


def _usual(loads, found, mine):
    """Means of the forces across and along the axis over an operation's way in the cut."""
    way = found.way_mm[mine] * found.cuts[mine]
    total = max(_sum(way), 1e-9)
    return {f"{name}_mean_n": round(_sum(way * getattr(loads, f"{name}_n")[mine]) / total, 6) for name in ("radial", "axial")}


def _largest(loads, mine):
    """The largest of each force over an operation's places."""
    return {f.name: round(float(getattr(loads, f.name)[mine].max(initial=0.0)), 6) for f in fields(loads)}
