"""Gathers what the report shows out of the stages' values."""

import hashlib
import json
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from cuspline.app.machine_report import Drawn, machine_view
from cuspline.design.fixtures import placed_fixtures
from cuspline.design.setup_alignment import refixturing_in_words
from cuspline.kernel import brep
from cuspline.planning.feeds import times_s
from cuspline.program.program import Kind, Moves, Plane
from cuspline.report.bundle import FaceMesh, PathPoints, ReportBundle, SetupBundle, StockReplay
from cuspline.report.view_mesh import divided, tessellate_for_view
from cuspline.stock.shapes import HERE as PART
from cuspline.surfaces.curvature import sample_faces
from cuspline.values import fixed_math as fixed
from cuspline.values.input_files import sha256_of
from cuspline.values.units import MM

VIEW_DEFLECTION_MM = 0.02
BARE_DEFLECTION_MM, THIN_EDGE_RAD = 0.05, 0.6     # normals are the surface's own: facets this coarse look round
VIEW_EDGE_MM = 2.0          # the deviation map is drawn from vertex to vertex
DRAWN_SAGITTA_MM = 0.02
WORST_WITHIN_MM = 1.0
VERTICES = 4096             # of the view, whose nearby samples are looked up at once


def view_of(solid, shape):
    """Mesh for pictures and the viewer, fine enough for the deviation map; `shape`: the solid's `shape_of`."""
    return divided(shape, solid, VIEW_EDGE_MM)


def shape_of(solid, has_thin_edges=False):
    """Mesh of the bare shape, for the glTF.

    Args:
        has_thin_edges: thin round edges all over, as blades have: facets turn further there, or there were millions.
    """
    if has_thin_edges:
        return tessellate_for_view(solid, BARE_DEFLECTION_MM, angle_rad=THIN_EDGE_RAD)
    return tessellate_for_view(solid, VIEW_DEFLECTION_MM)


def report_bundle(order, work, job, judged, verify, view, inputs_sha256):
    """ReportBundle of one build.

    Args:
        order: build.Order.
        work: folder with the files.
        job: Job.
        judged: judge.Judged.
        verify: the document as written; plan.json is read.
        view: view_mesh.ViewMesh.
        inputs_sha256: hash of the inputs.
    """
    design = order.design
    faces = brep.faces_of(judged.solid)
    wanted = {name for s in design.setups for name in s.faces}
    indices = brep.indices_of(faces, brep.named_faces(faces, design.predicates, wanted))
    samples = sample_faces(faces, indices, 1)
    step = work / job.step
    low, high = brep.bounding_box_mm(judged.solid)
    residuals = [s.residuals for s in judged.verdict.setups]
    plan = json.loads((work / "plan.json").read_text())
    posted = job.beside(work).posted
    drawn = [drawn_setup(moves, item.setup, plan, job.machine, v.places)
             for item, moves, v in zip(posted, judged.posted, judged.verdict.setups)]
    return ReportBundle(
        design=design.name, description=design.description, parameters=design.parameters.model_dump(mode="json"),
        material=design.material, finish=design.finish, inputs_sha256=inputs_sha256, revision=order.revision, step_file=job.step,
        step_sha256=sha256_of(step), part_box_mm=(_triple(low), _triple(high)), verify=verify,
        plan=plan, machine=machine_view(job, judged, drawn, plan, _broken_down),
        mesh=FaceMesh(vertices_mm=view.vertices_mm, normals=view.normals, triangles=view.triangles,
                      deviation_mm=_view_deviation(judged, view, indices), edges_mm=tuple(view.edges_mm)),
        deviation_samples_mm=np.concatenate([r.deviation_mm[r.is_reachable & (r.samples.weight_mm2 > 0)] for r in residuals]),
        curvature_per_mm=np.maximum(-samples.hollow_per_mm, 0.0),
        **{f"cusp_{name}": np.concatenate([getattr(s.cusps, column) for s in judged.verdict.setups])
           for name, column in (("place_mm", "point_mm"), ("height_mm", "height_mm"), ("formula_mm", "formula_mm"))},
        setups=tuple(_setup_bundle(work, judged, k, item, seen, job) for k, (item, seen) in enumerate(zip(posted, drawn))))


def drawn_setup(moves, setup, plan, machine, places=None):
    """Drawn of a setup: operations counted as in its own plan, while positions of one program share their names."""
    names = [op["name"].split(",")[0].strip().lower() for s in plan["setups"] if s["name"] == setup.name
             for op in s["operations"]]
    number = np.array([names.index(name) if name in names else k for k, name in enumerate(moves.operations)] + [-1])
    moves = replace(moves, operation=number[moves.operation])
    path, last = drawn_path(moves, setup.frame, machine, places)
    return Drawn(posted=moves, path=path, last_point=last)


def _view_deviation(judged, view, indices):
    """(n,) the worst deviation within WORST_WITHIN_MM of each vertex on the faces that are cut; NaN elsewhere.

    The view is coarser than the cusps: a value at the vertex alone would show a pattern of its own.
    """
    deviation = np.full(len(view.vertices_mm), np.nan)
    rows = np.flatnonzero(np.isin(view.face_index, indices))
    looked = [s.residuals for s in judged.verdict.setups]
    points, found, weight, is_reachable = (np.concatenate(of) for of in zip(*(
        (r.samples.points_mm, r.deviation_mm, r.samples.weight_mm2, r.is_reachable) for r in looked)))
    counts = is_reachable | (weight > 0.0)      # along a wall's normal, from its very foot, a film on the floor looks like a wall
    tree, found = cKDTree(points[counts]), found[counts]
    for some in np.array_split(rows, len(rows) // VERTICES + 1):            # samples near all of them at once are gigabytes
        deviation[some] = _worst_near(tree, found, view.vertices_mm[some])
    return deviation


def _worst_near(tree, values, places_mm):
    """(n,) the value (of the points of a cKDTree) that is largest in size within WORST_WITHIN_MM of places; NaN: none is there."""
    near = tree.query_ball_point(places_mm, WORST_WITHIN_MM)
    count = np.array([len(n) for n in near], np.int64)
    some, worst = count > 0, np.full(len(places_mm), np.nan)
    values = values[np.fromiter(chain.from_iterable(near), np.int64, count.sum())]
    first = np.cumsum(count[some]) - count[some]
    if len(first):
        high, low = np.maximum.reduceat(values, first), np.minimum.reduceat(values, first)
        worst[some] = np.where(high >= -low, high, low)
    return worst


def _setup_bundle(work, judged, k, item, drawn, job):
    machine, solved = job.machine, {p.program for p in job.posted if p.setup.indexed}
    is_held_as_before = k > 0 and item.setup.is_held_as(job.posted[k - 1].setup)
    posted, row_of = drawn.posted, drawn.last_point
    text, *more = ((work / name).read_bytes() for name in item.files)
    known = np.isfinite(posted.end_mm).all(axis=1)
    ends = posted.end_mm[known]
    stock = judged.stock.shape
    low, high = stock.box_in(item.setup.frame)
    replay = judged.verdict.setups[k].replay
    zero = item.setup.turn.into(item.setup.frame.origin_mm[None])[0]      # the replay stands in the setup's directions
    origin, lift = np.array(replay.zmap.origin_mm) + zero[:2], zero[2]
    lies = item.setup.refixturing
    return SetupBundle(
        zero_height_mm=None if machine.supports_z_mm is None else item.setup.zero_height_mm,
        markers=_markers(item.setup.markers, item.setup), held_frame=item.setup.clamped_frame if item.setup.indexed else None,
        marked_for_later=_markers({m.name: m for later in job.posted[k + 1:] for m in later.setup.markers}.values(), item.setup)
        if not item.setup.markers else (),
        markers_elsewhere=_elsewhere(k, [p.setup for p in job.posted]), rotaries=_rotaries(posted, item.setup, machine),
        lies_in_words="" if lies is None else refixturing_in_words(lies).lower(),
        turned_in_words=_turned_in_words(posted, item.setup, machine, is_held_as_before), is_held_as_before=is_held_as_before,
        swings_in_words=_swings_in_words(judged.read[k].whole, machine),
        solved_for=_axes_in_words(
            "XYZ", np.array(machine.wcs_origin_mm) / MM[machine.control.units]) if item.program in solved else "",
        name=item.setup.name, program_file=item.program, program_sha256=hashlib.sha256(text).hexdigest(),
        program_lines=text.count(b"\n"), program_bytes=len(text), continued=tuple(
            (name, hashlib.sha256(t).hexdigest()) for name, t in zip(item.continued, more)), machine=machine.name,
        lines_before=tuple(np.cumsum([t.count(b"\n") for t in (text, *more)])[:-1].tolist()),
        control=Path(machine.control.post).stem, units=machine.control.units, wcs=item.setup.wcs,
        wcs_in_words=item.setup.wcs_in_words, frame=item.setup.frame, operation_first_lines=_first_lines(posted),
        stock_box_mm=(_triple(low), _triple(high)), stock_edges_mm=_edges(stock.edges_mm),
        stock_in_words="" if stock.fills_box_in(item.setup.frame) else stock.in_words().lower(),
        fixtures=tuple((f.name, _edges(f.edges_mm)) for f in placed_fixtures(item.setup, PART)),
        extents_mm=(_triple(ends.min(axis=0)), _triple(ends.max(axis=0))), path=drawn.path,
        replay=StockReplay(
            origin_mm=(float(origin[0]), float(origin[1])), pitch_mm=replay.zmap.pitch_mm, nx=replay.zmap.nx,
            ny=replay.zmap.ny, bottom_mm=replay.bottom_mm + lift, top_mm=replay.top_mm + lift,
            design_top_mm=replay.design_top_mm + lift, event_move=row_of[replay.event_row],
            event_cell=replay.event_cell, event_z_mm=replay.event_z_mm + lift if lift else replay.event_z_mm))


def _markers(markers, setup):
    """((name, (x, y, z) in the WCS of what holds the part), ...)."""
    return tuple((m.name, _triple(setup.clamped_frame.into(np.array([m.at_mm]))[0])) for m in markers)


def _elsewhere(k, setups):
    """{name: (setup, (x, y, z) in the WCS of what holds the part there)} of the markers that setup k's sheet names: where those
    of a later clamping are touched, and where its own are in the clamping before."""
    mine = setups[k]
    others = [s for s in (setups[:k][::-1] if mine.markers else setups[k + 1:]) if not s.is_held_as(mine)]
    found = {}
    for other in others:
        for name, place in _markers((mine if mine.markers else other).markers, other):
            found.setdefault(name, (other.name, place))
    return found


def _rotaries(posted, setup, machine):
    """((letter, degrees or None, (2, 3) point and direction, part coordinates), ...) of the rotary axes that carry the part."""
    held, found = setup.clamped_frame, []
    for k, letter in enumerate(machine.rotaries):
        if letter not in machine.chain[:machine.chain.index("bed")]:
            continue
        axis = getattr(machine, letter.lower())
        pivot = np.array(axis.pivot_mm) + axis.offset_mm - machine.wcs_origin_mm
        stands = posted.rotary_deg[-1, k] if setup.indexed and len(posted) else np.nan
        found.append((letter, round(float(stands), 4) if np.isfinite(stands) else None,
                      np.vstack([held.out(pivot[None]), held.turn_out(np.array([axis.direction], float))])))
    return tuple(found)


def _turned_in_words(posted, setup, machine, is_held_as_before):
    """Of an indexed position: its rotary axes, and the tool's direction in the WCS."""
    if not setup.indexed:
        return ""
    along = setup.clamped_frame.turn_into(np.array([setup.wcs_z]))[0]
    return (f"{_axes_in_words(machine.rotaries, posted.rotary_deg[-1])} degrees, tool along {_axes_in_words('XYZ', along)} of "
            f"{setup.wcs}" + ("; held as before" if is_held_as_before else ""))


def _swings_in_words(whole, machine):
    """How far rotary axes go in a program, by letter: A -90 ... 0; "" where none leaves 0."""
    known = whole.rotary_deg[np.isfinite(whole.rotary_deg).all(axis=1)]
    if not known.any():
        return ""
    ends = zip(machine.rotaries, known.min(axis=0), known.max(axis=0))
    return ", ".join(f"{letter} {low:g} … {high:g}" if low < high else f"{letter} {low:g}" for letter, low, high in sorted(
        (letter, round(float(a), 4) + 0.0, round(float(b), 4) + 0.0) for letter, a, b in ends)) + " degrees"


def _axes_in_words(letters, values):
    """Letters with their values, as a control lists them.

    >>> _axes_in_words("XYZ", (0.0, -1.0, -0.0)), _axes_in_words("CA", (30.0, -90.0))
    ('X0 Y-1 Z0', 'A-90 C30')
    """
    return " ".join(f"{letter}{round(float(v), 4) + 0.0:g}" for letter, v in sorted(zip(letters, values)))


def _edges(edges_mm):
    """(k, 2, 3)"""
    return np.array(edges_mm, float).reshape(-1, 2, 3)


def drawn_path(posted, frame, machine, places=None):
    """(PathPoints in part coordinates, (n,) last point row of every posted move).

    Moves whose start or end is not known are left out of the drawing.   places: {name: (k,)} of SetupVerdict.
    """
    known = np.isfinite(posted.start_mm).all(axis=1) & np.isfinite(posted.end_mm).all(axis=1)
    rows = np.flatnonzero(known)
    seconds, arcs = _seconds(posted, rows, machine), np.flatnonzero(posted.kind[rows] >= Kind.ARC_CW)
    ways = [_broken_down(posted, k) for k in rows[arcs]]
    counts = np.ones(len(rows), int)
    counts[arcs] = [len(way) for way in ways]
    ends = np.cumsum(counts)
    points, each = np.repeat(posted.end_mm[rows], counts, axis=0), lambda values: np.repeat(values[rows], counts)
    for k, way in zip(arcs, ways):
        points[ends[k] - counts[k]:ends[k]] = way
    share = (np.arange(counts.sum()) - np.repeat(ends - counts, counts) + 1) / np.repeat(counts, counts)
    begin = np.concatenate([[0.0], np.cumsum(seconds)[:-1]])[:len(rows)]
    row_of = np.zeros(len(posted), np.int32)
    row_of[rows] = ends
    return PathPoints(points_mm=frame.out(np.vstack([posted.start_mm[rows[:1]], points])),
                      is_rapid=np.r_[True, each(posted.kind) == Kind.RAPID],
                      feed_mm_per_min=np.r_[0.0, each(posted.feed_mm_per_min)], operation=np.r_[-1, each(posted.operation)],
                      time_s=np.r_[0.0, np.repeat(begin, counts) + np.repeat(seconds, counts) * share],
                      line=np.r_[0, each(posted.line)],
                      met={name: np.r_[np.nan, each(values)] for name, values in met_on_moves(posted, places or {}).items()},
                      ), np.maximum.accumulate(row_of)


def met_on_moves(posted, places):
    """{name: (n,)} the most that edges meet on every move; NaN on rapids, and in operations that were not looked at.

    A move between those that were looked at takes the values of the nearest one of its operation.

    Args:
        places: {name: (k,)}, "row" of the move that each place lies on.
    """
    row = places.get("row", np.zeros(0, np.int64))
    if not len(row):
        return {}
    order = np.argsort(row, kind="stable")
    looked, first = np.unique(row[order], return_index=True)
    moves, of = np.arange(len(posted)), posted.operation
    after = np.searchsorted(looked, moves).clip(max=len(looked) - 1)
    before = np.maximum(after - 1, 0)
    is_mine = [of[looked[k]] == of for k in (before, after)]
    is_before = is_mine[0] & (~is_mine[1] | (moves - looked[before] < looked[after] - moves))
    nearest, is_known = np.where(is_before, before, after), (is_mine[0] | is_mine[1]) & (posted.kind != Kind.RAPID)
    return {name: np.where(is_known, np.maximum.reduceat(values[order], first)[nearest], np.nan)
            for name, values in places.items() if name != "row"}


def _seconds(posted, rows, machine):
    """(k,) duration of the known moves by the feed model."""
    moves = Moves(start_mm=posted.start_mm[rows[0]], kind=posted.kind[rows], end_mm=posted.end_mm[rows],
                  center_mm=posted.center_mm[rows], plane=posted.plane[rows],
                  axis=np.tile((0.0, 0.0, 1.0), (len(rows), 1)), feed_mm_per_min=posted.feed_mm_per_min[rows])
    return times_s(moves, machine)


def _broken_down(posted, k):
    """(n, 3) points after the start of an arc."""
    a, b, c = Plane(posted.plane[k]).axes
    start, end, center = posted.start_mm[k], posted.end_mm[k], posted.center_mm[k]
    x0, y0 = start[a] - center[a], start[b] - center[b]
    r = fixed.hypot(x0, y0)
    turn = fixed.arctan2(end[b] - center[b], end[a] - center[a]) - fixed.arctan2(y0, x0)
    full = 2 * np.pi
    sweep = turn % full if posted.kind[k] == Kind.ARC_CCW else -(-turn % full)
    if abs(sweep) < 1e-9:
        sweep = full if posted.kind[k] == Kind.ARC_CCW else -full
    sweep += np.sign(sweep) * full * posted.turns[k]
    n = max(1, int(np.ceil(abs(sweep) / (2 * fixed.arccos(max(1 - DRAWN_SAGITTA_MM / r, 0.0))))))
    share = np.arange(1, n + 1) / n
    angle = fixed.arctan2(y0, x0) + sweep * share
    way = np.empty((n, 3))
    way[:, a], way[:, b] = center[a] + r * fixed.cos(angle), center[b] + r * fixed.sin(angle)
    way[:, c] = start[c] + share * (end[c] - start[c])
    way[-1] = end
    return way


def _first_lines(posted):
    """Line of the text where each operation's first move stands."""
    return tuple(int(posted.line[np.argmax(posted.operation == k)]) if (posted.operation == k).any() else 0
                 for k in range(len(posted.operations)))


def _triple(point):
    return tuple(round(float(x), 6) for x in point)
