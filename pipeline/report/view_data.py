"""What viewer.js draws of part, paths and stock, packed (packing.py)."""

import math
from dataclasses import replace

import numpy as np

from cuspline.report.facts import findings, operation_rows, operations, unreachable
from cuspline.report.machine_view import machine_scene
from cuspline.report.packing import delta, joined, known, pack_mesh, quantised, text_block
from cuspline.report.wording import number
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

PATH_STEP_MM = 1e-4         # posted coordinates carry at most four decimals: nothing is lost
FEED_STEP = 0.1             # mm/min
REPLAY_STEPS = (8000, 4000, 2000, 1000)     # instants the replay can stop at: the most that keeps MOST_EVENTS
MOST_EVENTS = 1_500_000     # about 4 MB of html
MOST_NODES = 400_000        # of the z-map; above, every 2nd, 3rd ... node is shown, each as simulated
MET = {"depth_mm": ("depth of cut", "mm"), "speed_m_per_min": ("cutting speed", "m/min"),
       "removal_cm3_per_h": ("removal rate", "cm³/h"), "radial_n": ("radial force", "N"), "axial_n": ("axial force", "N")}
LEVELS = 254                # of what the edges meet; 0 stands for what was not looked at
OPERATION_COLOURS = ("#e8710a", "#1a73e8", "#12a05c", "#9334e6", "#00897b", "#c5221f", "#8d6e00", "#d01884")


def scene(bundle):
    """Everything viewer.js needs: (meta dict for JSON, {block name: base64 text})."""
    mesh_meta, mesh_bytes = pack_mesh(bundle.mesh)
    blocks, setups = {"mesh": text_block(mesh_bytes)}, []
    for k, setup in enumerate(bundle.setups):
        path_meta, path_bytes = pack_path(setup.path)
        replay_meta, replay_bytes = pack_replay(setup.replay, setup)
        standing = np.concatenate([setup.stock_edges_mm, *(edges for _, edges in setup.fixtures)])
        blocks |= {f"path-{k}": text_block(path_bytes), f"replay-{k}": text_block(replay_bytes),
                   f"standing-{k}": text_block(joined([standing.ravel().astype(np.float32)]))}
        setups.append({
            "name": setup.name, "program": setup.program_file, "wcs": setup.axes_name,
            "linesBefore": {name: n for (name, _), n in zip(setup.continued, setup.lines_before)},
            "origin": list(map(float, setup.frame.origin_mm)), "rotation": setup.frame.rotation.ravel().tolist(),
            "stockEdges": len(setup.stock_edges_mm), "fixtureEdges": sum(len(edges) for _, edges in setup.fixtures),
            "operations": operation_meta(bundle, setup), "path": path_meta, "replay": replay_meta})
    machine, moving = (None, {}) if bundle.machine is None else machine_scene(bundle.machine, tool_silhouette)
    return {"mesh": mesh_meta, "machine": machine, "box": overall_box(bundle), "setups": setups, "pins": pins(bundle),
            "limitsUm": {"gouge": bundle.finish.gouge_mm * 1000, "scallop": bundle.finish.scallop_mm * 1000}}, blocks | moving


def pack_path(path):
    """(meta, bytes) of a posted path: x, y, z, feed, time as deltas, then operation, rapid flag, line, what the edges meet."""
    points = known(np.asarray(path.points_mm, dtype=float))
    seconds = np.asarray(path.time_s, dtype=float)
    feed = np.nan_to_num(np.asarray(path.feed_mm_per_min, dtype=float))
    raw = joined([*(delta(np.round(points[:, k] / PATH_STEP_MM), np.int32) for k in range(3)),
                  delta(np.round(feed / FEED_STEP), np.int32), delta(np.round(seconds * 1000), np.int32),
                  np.asarray(path.operation, dtype=np.int16), np.asarray(path.is_rapid, dtype=np.uint8),
                  delta(path.line, np.int32), *(_levels(values) for values in path.met.values())])
    cutting = feed[~np.asarray(path.is_rapid, dtype=bool)]
    return {"points": len(points), "stepMm": PATH_STEP_MM, "feedStep": FEED_STEP,
            "feedMax": float(cutting.max()) if len(cutting) else 0.0,
            "met": [dict(zip(("name", "label", "unit", "most"), (name, *MET[name], _most(values))))
                    for name, values in path.met.items()]}, raw


def _most(values):
    return float(np.nanmax(values, initial=0.0))


def _levels(values):
    """(n,) uint8: 0 not looked at, else 1 and so many LEVELS of the most."""
    share = np.nan_to_num(values) / (_most(values) or 1.0)
    return np.where(np.isfinite(values), 1 + np.round(LEVELS * share), 0).astype(np.uint8)


def pack_replay(replay, setup):
    """(meta, bytes) of the stock's every change, in so many instants of the program's time.

    An event belongs to a whole move; within the move it is shown when the cutter passes its node.
    Of several events of one node in one instant the last remains: the height after it is the same.
    """
    replay, stride = thinned(replay)
    share = event_times(replay, setup)
    for steps in REPLAY_STEPS:
        instant, cell, z = _last_in_each_instant(share, steps, replay)
        if len(cell) <= MOST_EVENTS:
            break
    height = replay.top_mm - replay.bottom_mm
    top = np.asarray(replay.design_top_mm, dtype=float).ravel()
    design = quantised(np.nan_to_num(top, nan=replay.bottom_mm), replay.bottom_mm, height)
    raw = joined([delta(instant, np.uint16), delta(cell, np.int32),
                  quantised(z, replay.bottom_mm, height).astype(np.uint16),
                  delta(design, np.uint16), np.isfinite(top).astype(np.uint8)])
    return {"nx": int(replay.nx), "ny": int(replay.ny), "originMm": list(map(float, replay.origin_mm)),
            "pitchMm": float(replay.pitch_mm), "bottomMm": float(replay.bottom_mm), "topMm": float(replay.top_mm),
            "events": len(cell), "instants": steps, "stride": stride}, raw


def thinned(replay):
    """(replay on every stride-th node each way, stride): the shown nodes keep their simulated heights."""
    stride = int(np.ceil(np.sqrt(replay.nx * replay.ny / MOST_NODES)))
    if stride <= 1:
        return replay, 1
    cell = np.asarray(replay.event_cell, dtype=np.int64)
    i, j = cell % replay.nx, cell // replay.nx
    kept = (i % stride == 0) & (j % stride == 0)
    nx, ny = -(-replay.nx // stride), -(-replay.ny // stride)
    return replace(replay, pitch_mm=replay.pitch_mm * stride, nx=nx, ny=ny,
                   design_top_mm=np.asarray(replay.design_top_mm)[::stride, ::stride],
                   event_move=np.asarray(replay.event_move)[kept], event_z_mm=np.asarray(replay.event_z_mm)[kept],
                   event_cell=(j[kept] // stride) * nx + i[kept] // stride), stride


def _last_in_each_instant(share, steps, replay):
    """(instant, cell, height) in order of time, one row per cell and instant."""
    last = _is_last(share, steps, for_kernel(replay.event_cell, np.int32), int(replay.nx * replay.ny))
    cell, z = np.asarray(replay.event_cell[last], dtype=np.int64), np.asarray(replay.event_z_mm[last], dtype=float)
    instant = np.ceil(share[last] * steps).astype(np.int64)
    order = np.lexsort((cell, instant))
    return instant[order], cell[order], z[order]


@njit
def _is_last(share, steps, cells, nodes):
    """(e,) bool: the last event of its node in its instant; a node's events follow each other in time, each a lower one."""
    last, before, at = np.zeros(len(cells), np.bool_), np.full(nodes, -1), np.full(nodes, -1)
    for e in range(len(cells)):
        instant, cell = int(math.ceil(share[e] * steps)), cells[e]
        if at[cell] == instant:
            last[before[cell]] = False
        last[e], before[cell], at[cell] = True, e, instant
    return last


def event_times(replay, setup):
    """(e,) share 0..1 of the program's time at which the cutter passes each event's node."""
    seconds = np.asarray(setup.path.time_s, dtype=float)
    if not len(replay.event_move) or seconds[-1] <= 0:
        return np.zeros(len(replay.event_move))
    points = fixed.matmul(known(np.asarray(setup.path.points_mm, dtype=float)), setup.frame.rotation)   # x_replay = Rᵀ x_part
    return _times(for_kernel(replay.event_move, np.int32), for_kernel(replay.event_cell, np.int32), replay.nx,
                  float(replay.pitch_mm), for_kernel(replay.origin_mm), points, seconds)


@njit
def _times(reached, cells, nx, pitch_mm, origin_mm, points, seconds):
    share = np.empty(len(cells))
    for e in range(len(cells)):
        now = reached[e]
        before = max(now - 1, 0)
        x, y = (cells[e] % nx) * pitch_mm + origin_mm[X], (cells[e] // nx) * pitch_mm + origin_mm[Y]
        dx, dy = points[now, X] - points[before, X], points[now, Y] - points[before, Y]
        along = ((x - points[before, X]) * dx + (y - points[before, Y]) * dy) / max(dx * dx + dy * dy, 1e-12)
        passed = seconds[before] + min(max(along, 0.0), 1.0) * (seconds[now] - seconds[before])
        share[e] = min(max(passed / seconds[-1], 0.0), 1.0)
    return share


def operation_meta(bundle, setup):
    """Per operation of a setup: name, colour, times, and the cutter as it is drawn."""
    own = [op for s, _, op in operations(bundle) if s is setup]
    rows = [row for (s, _, _), row in zip(operations(bundle), operation_rows(bundle)) if s is setup]
    return [{"name": row["name"], "tool": row["tool"], "time": row["time"],
             "colour": OPERATION_COLOURS[k % len(OPERATION_COLOURS)],
             "startSeconds": operation_start_s(setup.path, k), "silhouette": tool_silhouette(op.get("tool"))}
            for k, (op, row) in enumerate(zip(own, rows))]


def operation_start_s(path, operation):
    """When the first point of an operation is left for; -1 when it has none."""
    rows = np.flatnonzero(np.asarray(path.operation) == operation)
    return float(path.time_s[max(rows[0] - 1, 0)]) if len(rows) else -1.0


def tool_silhouette(tool):
    """Outlines to be turned about the axis: [{"part", "outline": [[radius, height], ...]}], from the tip up.

    Only what plan.json says is drawn: without a diameter there is no cutter, without holder
    segments no holder.  On a right-angle head each part says its axis, and the head's boxes follow: [{"part", "box"}].
    """
    tool = tool if isinstance(tool, dict) else {}
    radius = (number(tool.get("diameter_mm")) or 0.0) / 2
    if not radius:
        return []
    flute = number(tool.get("flute_length_mm")) or 3 * radius
    stick_out = max(number(tool.get("stick_out_mm")) or flute, flute)
    shank = (number(tool.get("shank_diameter_mm")) or 2 * radius) / 2
    corner = {"ball": radius, "flat": 0.0}.get(tool.get("type"), number(tool.get("corner_radius_mm")) or 0.0)
    parts = [{"part": "flutes", "outline": _tip_outline(radius, corner) + [[radius, flute]]}]
    if stick_out > flute:
        parts.append({"part": "shank", "outline": [[radius, flute], [shank, flute], [shank, stick_out]]})
    holder = tool.get("holder")
    segments = holder.get("segments") or () if isinstance(holder, dict) else ()
    outline, z = [[0.0, stick_out]], stick_out
    for segment in segments:
        outline += [[segment["lower_diameter_mm"] / 2, z], [segment["upper_diameter_mm"] / 2, z + segment["height_mm"]]]
        z += segment["height_mm"]
    parts += [{"part": "holder", "outline": outline + [[0.0, z]]}] if segments else []
    return _on_head(parts, tool["head"], flute) if tool.get("head") else parts


def _on_head(parts, head, flute):
    """Parts of a disc with their axis, and the boxes of its head as seen from the tip."""
    toward = -1.0 if head["cutter_points"] == "+X" else 1.0
    middle = np.array([toward * flute / 2, 0.0, 0.0])
    boxes = [{"part": "holder", "box": [(middle + box[end]).tolist() for end in ("min_mm", "max_mm")]}
             for box in head["boxes"]]
    return [{**part, "toward": toward} for part in parts] + boxes


def _tip_outline(radius, corner):
    """From the axis along the bottom and round the corner, [[radius, height], ...]."""
    turn = np.linspace(0, np.pi / 2, 13 if corner else 1)
    arc = np.column_stack([radius - corner + corner * fixed.sin(turn), corner - corner * fixed.cos(turn)])
    return ([] if radius == corner else [[0.0, 0.0]]) + arc.round(6).tolist()


def pins(bundle):
    """Numbered places: findings, then what is unreachable."""
    found = [{"label": str(k + 1), "kind": "accepted" if row.is_accepted else "finding", **row.spot,
              "title": f"{row.kind} {row.amount}"}
             for k, row in enumerate(findings(bundle.verify)) if row.place_mm]
    left = [{"label": f"U{k + 1}", "kind": "unreachable", "place": list(spot), "title": f"{what}, {area}"}
            for k, (what, area, _, spot) in enumerate(unreachable(bundle)) if spot]
    return found + left


def overall_box(bundle):
    """[[min], [max]] round part and stock, part coordinates: what the camera looks at."""
    corners = [np.asarray(bundle.part_box_mm, dtype=float)]
    for setup in bundle.setups:
        low, high = np.asarray(setup.stock_box_mm, dtype=float)
        grid = np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        corners.append(setup.frame.out(grid))
    points = np.vstack(corners)
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
