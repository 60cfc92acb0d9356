r"""Roughing in levels: rows that follow the part at an allowance, never deeper than one stepdown.

Over each row the cutter may go down to its drop height on the part grown by the allowance.  On
level k a row runs at max(level, drop height) wherever the level above has not already reached that:
a straight floor where there is depth, the part's own shape where there is not.  Entries come from
outside the stock where they can, else down a ramp along the row.

    stock ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
    level 1 ──────────\       /────      \ / follow the drop height
    level 2 ───────────\     /─────
    part   ▂▃▅▇█▇▅▃▂
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.errors import ToolpathError
from cuspline.program import MoveWriter
from cuspline.toolpaths.dropcutter import drop_tips_mm
from cuspline.toolpaths.regions import grouped

ROW_SPACING_MM = 0.25       # along a row: drop heights are taken here and joined straight
DROP_MARGIN_MM = 0.04       # over the planning mesh's deviation and the sag between two drop heights
LEAST_CUT_MM = 0.02         # thinner remains are not worth a pass
JUMP_MM, JUMP_HALVINGS = 0.5, 4     # drop heights that differ by more stand at a wall, found to 0.02 mm
WALL_END_SHARE = 0.3        # a row that ends this deep in its level ends at a wall, not on a slope
LINK_SAMPLES = 9
LEAST_ROW_MM = 0.3          # rows are not put closer than this, however steep the part is across them
SIMPLIFY_MM = 0.05          # a row may lie this much above its drop heights: longer blocks, higher feed


@dataclass(frozen=True, eq=False, kw_only=True)
class RoughingRules:
    """What the levels and rows are laid out from; lengths in the part frame."""

    mesh: object                    # DropMesh of the part
    radius_mm: float
    corner_radius_mm: float
    allowance_mm: float
    stepdown_mm: float
    stepover_mm: float
    stock_min_mm: np.ndarray
    stock_max_mm: np.ndarray
    along: int                      # axis index of the rows
    ramp_rad: float
    lead_mm: float                  # how far outside the stock a row begins
    clearance_z_mm: float
    feed_mm_per_min: float
    slot_feed_mm_per_min: float     # where the cutter is engaged on its full width
    plunge_mm_per_min: float


@dataclass(frozen=True, eq=False, kw_only=True)
class _Row:
    """One row: positions along it and how deep the tip may go."""

    across: float
    along: np.ndarray
    floor: np.ndarray


def rough(rules):
    """All moves of a level-wise clearing of the stock box.

    Returns:
        Moves in the part frame, from and back to the clearance plane.
    Raises:
        ToolpathError: there is nothing to remove.
    """
    rows = _rows(rules)
    levels = _levels(rules, min(r.floor.min() for r in rows))
    writer = None
    for top, level in zip(levels[:-1], levels[1:]):
        for region in _regions(rows, top, rules):
            paths = [_path(row, stretch, level, rules) for row, stretch in region]
            if writer is None:
                writer = MoveWriter(np.r_[paths[0][0, :2], rules.clearance_z_mm])
            for k, path in enumerate(paths):
                _cut(writer, path[::1 if k % 2 == 0 else -1], top, k == 0, rules)
            for side in (0, -1):
                _clean_wall(writer, [path[side] for path in paths], top, level, rules)
    if writer is None:
        raise ToolpathError("roughing found nothing to remove: the stock lies within the allowance of the part; "
                            "leave the operation out")
    writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])
    return writer.moves()


def _rows(rules):
    """Rows from one side of the stock to the other with the cutter's drop heights.

    Between two rows whose floors differ by more than a stepdown more rows are put, down to
    LEAST_ROW_MM: a wall that runs along the rows is then cleared to its foot.
    """
    low, high = rules.stock_min_mm[1 - rules.along], rules.stock_max_mm[1 - rules.along]
    count = max(2, math.ceil((high - low) / rules.stepover_mm) + 1)
    rows = [_row(rules, across) for across in np.linspace(low, high, count)]
    k = 0
    while k + 1 < len(rows):
        here, there = rows[k], rows[k + 1]
        apart = np.abs(here.floor - np.interp(here.along, there.along, there.floor)).max()
        if apart > rules.stepdown_mm and there.across - here.across > 2 * LEAST_ROW_MM:
            rows.insert(k + 1, _row(rules, (here.across + there.across) / 2))
        else:
            k += 1
    return rows


def _row(rules, across):
    """One row and how deep the cutter may go along it."""
    a = rules.along
    reach = rules.radius_mm + rules.lead_mm
    low, high = rules.stock_min_mm, rules.stock_max_mm
    along = np.linspace(low[a] - reach, high[a] + reach,
                        math.ceil((high[a] - low[a] + 2 * reach) / ROW_SPACING_MM) + 1)
    tips = _drop_heights(rules, _on_row(rules, along, across))
    for _ in range(JUMP_HALVINGS):          # a wall across the row: close in on where the cutter clears it
        jumps = np.flatnonzero(np.abs(np.diff(tips)) > JUMP_MM)
        middles = (along[jumps] + along[jumps + 1]) / 2
        along = np.insert(along, jumps + 1, middles)
        tips = np.insert(tips, jumps + 1, _drop_heights(rules, _on_row(rules, middles, across)))
    floor = _between(tips)
    return _Row(across=float(across), along=along, floor=_level_outside(floor, along, low[a], high[a]))


def _on_row(rules, along, across):
    """(n, 2) positions in XY of a row's coordinates."""
    xy = np.empty((len(along), 2))
    xy[:, rules.along], xy[:, 1 - rules.along] = along, across
    return xy


def _drop_heights(rules, xy):
    """(n,) lowest tips that keep the allowance, never below the stock."""
    grown_r, grown_c = rules.radius_mm + rules.allowance_mm, rules.corner_radius_mm + rules.allowance_mm
    tips = drop_tips_mm(rules.mesh, xy, grown_r, grown_c) + rules.allowance_mm + DROP_MARGIN_MM
    return np.maximum(tips, rules.stock_min_mm[2])


def _level_outside(floor, along, low, high):
    """Beside the stock the cutter keeps the height at its edge instead of rolling down over the part."""
    first, last = np.searchsorted(along, [low, high])
    floor = floor.copy()
    floor[:first], floor[last:] = floor[first], floor[last - 1]
    return floor


def _between(tips):
    """Raise each height to its neighbours': straight moves between them then stay above every step.

    A wall passed between two positions shows up in one of them.
    """
    padded = np.r_[tips[:1], tips, tips[-1:]]
    return np.maximum(np.maximum(padded[:-2], padded[2:]), tips)


def _levels(rules, lowest):
    """Heights from the top of the stock down to the lowest floor, evenly, one stepdown at most."""
    top = rules.stock_max_mm[2]
    count = max(1, math.ceil((top - lowest) / rules.stepdown_mm - 1e-9))
    return np.linspace(top, lowest, count + 1)


def _regions(rows, top, rules):
    """Stretches of neighbouring rows that overlap, row by row: each list is cleared in one go."""
    return grouped(([(row, stretch) for stretch in _stretches(row, top, rules)] for row in rows), _overlap)


def _overlap(a, b):
    """Two stretches, each with its row, lie beside each other."""
    (low_a, high_a), (low_b, high_b) = ((row.along[s[0]], row.along[s[1] - 1]) for row, s in (a, b))
    return low_a < high_b and low_b < high_a


def _stretches(row, top, rules):
    """Index ranges of the row where this level has something to take."""
    takes = row.floor < top - LEAST_CUT_MM
    inside = (row.along >= rules.stock_min_mm[rules.along] - rules.radius_mm) & \
             (row.along <= rules.stock_max_mm[rules.along] + rules.radius_mm)
    edges = np.flatnonzero(np.diff(np.r_[False, takes, False].astype(int)))
    found = []
    for first, last in zip(edges[::2], edges[1::2]):
        if inside[first:last].any():
            found.append((first, last))
    return found


def _path(row, stretch, level, rules):
    """(n, 3) tip positions over one stretch, points on straight lines left out."""
    first, last = stretch
    path = np.empty((last - first, 3))
    path[:, rules.along], path[:, 1 - rules.along] = row.along[first:last], row.across
    path[:, 2] = np.maximum(level, row.floor[first:last])
    return path[_kept(path[:, rules.along], path[:, 2])]


def _kept(along, up):
    """Rows that a polyline needs to stay above the heights and within SIMPLIFY_MM of them."""
    kept, last = [0], 0
    low, high = -np.inf, np.inf
    for k in range(1, len(along)):
        run = along[k] - along[last]
        slope = (up[k] - up[last]) / run
        if not low <= slope <= high:
            kept.append(k - 1)
            last = k - 1
            run = along[k] - along[last]
            slope = (up[k] - up[last]) / run
            low, high = -np.inf, np.inf
        # the line from `last` must pass every point so far at or above it
        low = max(low, slope)
        high = min(high, slope + SIMPLIFY_MM / run)
    kept.append(len(along) - 1)
    return np.unique(kept)


def _cut(writer, path, top, is_slot, rules):
    """Go to one end of the stretch, down to its start, and along it."""
    feed = rules.slot_feed_mm_per_min if is_slot else rules.feed_mm_per_min
    start = path[0]
    if not is_slot and _links_straight(writer, start, rules):
        writer.feed(start, feed)
    else:
        writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])
        writer.rapid(np.r_[start[:2], rules.clearance_z_mm])
        if _is_outside(start, rules):
            writer.rapid(np.r_[start[:2], top + 1.0])
            writer.feed(start, rules.plunge_mm_per_min)
        else:
            _ramp(writer, path, top, rules)
    for point in path[1:]:
        writer.feed(point, feed)


def _clean_wall(writer, ends, top, level, rules):
    """Along the ends of a region's rows where they stop at a wall: the round cutter leaves ridges between them.

    Both ends of each stroke have been cut before, so the cutter may go straight down there.
    """
    deep = level + WALL_END_SHARE * (top - level)
    for here, there in zip(ends[:-1], ends[1:]):
        if max(here[2], there[2]) > deep or _is_outside(here, rules) or _is_outside(there, rules):
            continue
        if not _is_clear(here, there, rules):
            continue
        if np.abs(writer.here_mm - here).max() > 1e-9:
            if not (writer.here_mm[2] < rules.clearance_z_mm - 1e-6 and _links_straight(writer, here, rules)):
                writer.rapid(np.r_[writer.here_mm[:2], rules.clearance_z_mm])
                writer.rapid(np.r_[here[:2], rules.clearance_z_mm])
                writer.rapid(np.r_[here[:2], top + 1.0])
            writer.feed(here, rules.plunge_mm_per_min)
        writer.feed(there, rules.feed_mm_per_min)


def _is_outside(point, rules):
    """The cutter stands clear of the stock box."""
    r = rules.radius_mm
    return bool((point[:2] <= rules.stock_min_mm[:2] - r).any() or (point[:2] >= rules.stock_max_mm[:2] + r).any())


def _links_straight(writer, start, rules):
    """The next row of the region begins near enough, and the straight way there keeps the allowance."""
    here = writer.here_mm
    if here[2] > rules.clearance_z_mm - 1e-6 or np.linalg.norm(start[:2] - here[:2]) > 2 * rules.stepover_mm:
        return False
    return _is_clear(here, start, rules)


def _is_clear(here, there, rules):
    """The straight way keeps the allowance."""
    way = here + np.linspace(0.0, 1.0, LINK_SAMPLES)[:, None] * (there - here)
    return bool((way[:, 2] >= _drop_heights(rules, way[:, :2]) - DROP_MARGIN_MM).all())


def _ramp(writer, path, top, rules):
    """Down to the start of the path in strokes along it, no steeper than the ramp angle."""
    start, a = path[0], rules.along
    depth = top - start[2]
    writer.rapid(np.r_[start[:2], top + 1.0])
    writer.feed(np.r_[start[:2], max(top, start[2])], rules.plunge_mm_per_min)
    if depth <= 0:
        return
    # the strokes stay over the leading part of the path that lies no higher than its start
    level = path[:, 2] <= start[2] + 1e-9
    reach = abs(path[np.argmin(level) - 1 if not level.all() else len(path) - 1, a] - start[a])
    stroke = min(reach, 4 * rules.radius_mm)
    if stroke < 0.5:
        writer.feed(start, rules.plunge_mm_per_min * 0.3)
        return
    strokes = max(2, 2 * math.ceil(depth / (2 * stroke * math.tan(rules.ramp_rad))))
    sign = np.sign(path[-1, a] - start[a])
    for k in range(1, strokes + 1):
        point = start.copy()
        point[2] = top - depth * k / strokes
        point[a] += sign * stroke * (k % 2)
        writer.feed(point, rules.plunge_mm_per_min)
