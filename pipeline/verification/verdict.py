"""The verdict on one setup and on the part: both verifiers, their agreement, the replay, all findings."""

from dataclasses import dataclass

import numpy as np
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer

from cuspline import brep, mesh_quality, solids
from cuspline.errors import InputError
from cuspline.simulation.clearance import ClearanceTree
from cuspline.simulation.replay import Replay, ZMap, replay
from cuspline.simulation.stock_solids import StockSolids
from cuspline.simulation.swept import is_height_field, nearest_moves, stock_height_mm, swept_paths
from cuspline.simulation.workpiece import Workpiece
from cuspline.surfaces.projection import ClosestTree
from cuspline.toolpaths.dropcutter import drop_tips_mm
from cuspline.verification.certificate import Certificate, certify, gouges_beyond, part_in_wcs
from cuspline.verification.climbing import Ground
from cuspline.verification.clusters import clusters_of
from cuspline.verification.cusps import Cusps, measured_cusps
from cuspline.verification.excess_proof import ExcessProof, prove_excess
from cuspline.verification.findings import Finding
from cuspline.verification.in_process import PART
from cuspline.verification.kept import NOTHING
from cuspline.verification.reach import REACHABLE, drop_mesh
from cuspline.verification.residuals import (LIMIT_MM, Residuals, default_spacing_mm, reach_of, residuals,
                                             unreachable_places, weighted_percentile)
from cuspline.verification.samples import face_area_mm2, sample_faces
from cuspline.verification.solids import SolidComparison, compare
from cuspline.verification.tessellation import Tessellation, tessellate

COLLISIONS = ("rapid_through_stock", "shank_contact", "holder_contact", "fixture_contact")
TRACING_MM = 1e-7         # length of a traced ray
NOISE_MM = 1e-6           # a tolerance is exceeded only by more than this
PROVEN_SHARE = 1 / 3      # of the allowed gouge: how near to the truth the certificate's bounds come
FINEST_MM = 2e-4          # the finest that they are asked for
MISSED = 5.0              # an area is missing, not just rough, when it stands this many tolerances proud
MISSED_MM2 = 1.0
SEEN_PITCHES = 3.0        # a body narrower than this many pitches may slip through the grid
SOLID_NODES = 120_000     # of the second verifier's grid: some seconds of booleans
REPLAY_NODES = 60_000
DESIGN_PIN_MM = 1e-3      # radius of the pin that feels the design's height at a node


@dataclass(frozen=True, kw_only=True)
class Options:
    """How finely to look; None stands for a value fitted to the part."""

    spacing_mm: float | None = None           # of the sample points
    solid_pitch_mm: float | None = None       # of the grid of the second verifier
    replay_pitch_mm: float | None = None      # of the replay's z-map
    tessellation_mm: float | None = None      # deviation of the design's triangles
    post_rounding_mm: float = 0.0             # stated by the post: half a step of its last decimal
    mesh_checks: bool = False                 # the third view, by pymeshlab where it is installed
    holder_clearance_mm: float = 1.0
    shank_clearance_mm: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupVerdict:
    """Everything found about one setup."""

    setup: str
    finish: object                    # design.Finish
    residuals: Residuals
    solids: SolidComparison
    replay: Replay
    certificate: Certificate
    cusps: Cusps                      # at ridges between passes
    excess_proof: ExcessProof         # that nothing between samples stands higher
    error_bounds_mm: dict             # part -> mm
    numbers: dict                     # verify.json's contract, without findings
    stock: StockSolids                # after all clampings
    mesh: Tessellation                # of the design, part coordinates
    findings: tuple[Finding, ...]

    @property
    def ok(self):
        return not self.findings

    def as_dict(self):
        """For verify.json."""
        collisions = [f.as_dict() for f in self.findings if f.kind in COLLISIONS]
        return {"setup": self.setup, "ok": self.ok, **self.numbers, "error_bounds_mm": self.error_bounds_mm,
                "collisions": collisions, "findings": [f.as_dict() for f in self.findings]}


@dataclass(frozen=True, eq=False, kw_only=True)
class Verdict:
    """The part: all setups together."""

    setups: tuple[SetupVerdict, ...]

    @property
    def ok(self):
        return all(s.ok for s in self.setups)

    @property
    def findings(self):
        return tuple(f for s in self.setups for f in s.findings)

    def as_dict(self):
        """verify.json: the totals, then every setup."""
        parts = [s.as_dict() for s in self.setups]
        proven = [p["excess_proven_mm"] for p in parts]
        worst = ("gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "cusp_max_mm", "cusp_p99_mm", "error_bound_mm")
        summed = ("gouge_volume_mm3", "excess_volume_mm3", "points_checked", "area_required_mm2", "area_reached_mm2",
                  "area_unreachable_mm2")
        together = ("unreachable", "collisions", "findings", "cusps")
        return {"ok": self.ok, **{k: max((p[k] for p in parts), default=0.0) for k in worst},
                "excess_proven_mm": None if None in proven else max(proven, default=0.0),
                **{k: _rounded(sum(p[k] for p in parts)) for k in summed},
                "error_bounds_mm": {k: max(p["error_bounds_mm"][k] for p in parts) for k in parts[0]["error_bounds_mm"]}
                if parts else {},
                **{k: [item for p in parts for item in p[k]] for k in together}, "setups": parts}


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupProgram:
    """One clamping's program, read back from the text."""

    posted: object                    # PostedMoves
    setup: object                     # design.Setup: name and frame
    faces: tuple                      # TopoDS_Face values of the solid (or values with such a `.shape`) that it cuts
    fixtures: tuple = ()              # of replay.Fixture, WCS


def verify_setup(posted, tools, solid, faces, *, setup, fixtures=(), **asked):
    """Verdict on a part cut by one program in one clamping; see `verify_setups`."""
    program = SetupProgram(posted=posted, setup=setup, faces=tuple(faces), fixtures=tuple(fixtures))
    return verify_setups((program,), tools, solid, **asked)[0]


def verify_setups(programs, tools, solid, *, stock, finish, ball_radius_mm, machine=None, options=Options(),
                  kept=NOTHING, say=lambda text: None):
    """Verdict on the posted programs of all clampings, in the order in which they are cut.

    Every face is judged after all programs; each program is replayed on the stock that those before it leave, and
    answers for its own gouges on any of the faces.

    Args:
        programs: SetupProgram values.
        tools: dict of tool number -> cutters.Tool.
        solid: TopoDS_Solid, part coordinates.
        stock: design.StockBox, part coordinates.
        finish: design.Finish.   ball_radius_mm: smallest ball of the shop's library.
        machine: machines.Machine or None.
        say: called with what is being done, and how large it is.
    Returns:
        one SetupVerdict a program.
    Raises:
        InputError: no faces, or faces of another solid.   SimulationError: a billet that stands askew in a WCS.
    """
    shapes = [[getattr(f, "shape", f) for f in p.faces] for p in programs]
    required = [_indices(solid, faces) for faces in shapes]
    piece = Workpiece(min_mm=stock.min_mm, max_mm=stock.max_mm)
    before, fitted = [], []
    for program, faces in zip(programs, shapes):
        say(f"{program.setup.name}: index over {len(program.posted):,} moves")
        before.append(piece)
        fitted.append(_fitted(options, faces, *piece.box_in(program.setup.frame), finish))
        piece = piece.after(program.setup.frame, swept_paths(program.posted, tools))
    finest = min(o.tessellation_mm for o in fitted)
    say(f"triangles of the design within {finest:.4f} mm")
    mesh = tessellate(solid, finest)
    say(f"samples of the faces, {len(mesh.triangles):,} triangles for their reach")
    drops = [drop_mesh(c.frame.into(mesh.vertices_mm), mesh.triangles) for c in piece.cuts]
    samples = [sample_faces(faces, o.spacing_mm) for faces, o in zip(shapes, fitted)]
    exact = brep.faces_of(solid)
    feeds = [p.setup.frame.turn_out(_directions(p.posted)) for p in programs]
    grounds = [Ground.of_faces([exact[i] for i in chosen]) for chosen in required]
    for program, mine in zip(programs, samples):
        say(f"{program.setup.name}: {len(mine):,} samples against {len(program.posted):,} moves, and tops between them")
    closest = None if all(is_height_field(c.paths) for c in piece.cuts) else ClosestTree.of_faces(exact)
    judged = residuals(piece, samples, grounds, feeds, drops, closest, ball_radius_mm, [o.spacing_mm for o in fitted],
                       kept)
    made = StockSolids(piece, [o.solid_pitch_mm for o in fitted], mesh.vertices_mm, mesh.triangles, kept.of(stock_height_mm))
    verdicts = []
    for k, (program, (found, own)) in enumerate(zip(programs, judged)):
        moves = f"{len(program.posted):,} moves"
        say(f"{program.setup.name}: replay of {moves} on a grid of {fitted[k].replay_pitch_mm:.3f} mm")
        history = _replayed(program, tools, before[k], mesh, drops[k], machine, finish, fitted[k])
        say(f"{program.setup.name}: certificate of {moves}")
        proven = certify(program.posted, tools, part_in_wcs(solid, program.setup.frame),
                         tolerance_mm=max(PROVEN_SHARE * finish.gouge_mm, FINEST_MM))
        say(f"{program.setup.name}: cusps beside {len(samples[k]):,} samples")
        cusps = _cusps(piece, k, program, found, grounds[k], feeds[k], required[k], finish, len(samples[k]))
        say(f"{program.setup.name}: proof of what stands between the samples")
        proof = _excess_proof(piece, k, found, grounds[k], drops[k], closest, finish, ball_radius_mm)
        say(f"{program.setup.name}: solids on a grid of {fitted[k].solid_pitch_mm:.3f} mm"
            + (", third view" if options.mesh_checks else ""))
        verdicts.append(_judged(program, found, own, history, proven, made, k, mesh, drops[k], required[k], finish,
                                fitted[k], ball_radius_mm, cusps, proof))
    return tuple(verdicts)


def _cusps(piece, k, program, found, ground, feeds, required, finish, count):
    """Cusps beside the first `count` samples, the ones that are no tops, where clamping k finished the face."""
    row, d = found.row[:count], found.deviation_mm[:count]
    fair = found.is_reachable[:count] & found.is_own[:count] & (row >= 0) & (d <= _allowed(finish) * MISSED)
    return measured_cusps(ground, found.samples.first(count), np.where(fair, d, -np.inf),
                          np.where((row >= 0)[:, None], feeds[row], 0.0), piece.cuts[k], program.posted,
                          piece.cut_distance_mm, lambda p, n: piece.deviations(p, n, LIMIT_MM)[0], found.spacing_mm, required)


def _judged(program, found, own, history, proven, made, k, mesh, drops, required, finish, options, ball_radius_mm,
            cusps, proof):
    """SetupVerdict of clamping k."""
    path_error = max((p.error_mm for c in made.piece.cuts for p in c.paths), default=0.0)
    solid_view = compare(made, k, mesh, drops, required, found, own, excess_mm=_allowed(finish), gouge_mm=finish.gouge_mm,
                         path_error_mm=path_error, ball_radius_mm=ball_radius_mm)
    bounds = {"path_mm": path_error, "tracing_mm": TRACING_MM, "post_rounding_mm": options.post_rounding_mm,
              "tessellation_mm": mesh.deviation_mm, "zmap_mm": solid_view.volumes.zmap_mm}
    bounds = {name: _rounded(v, 9) for name, v in bounds.items()}
    report = _Reporter(program, finish, found, own)
    checks, doubts = _mesh_checks(made, mesh, found, program, bounds) if options.mesh_checks else ({}, ())
    findings = (*history.findings, *report.gouges(), *report.unseen_gouges(proven),
                *report.excess(), *report.unseen_excess(proof, made.piece.cuts[k]),
                *report.disagreements(solid_view, options.solid_pitch_mm, bounds), *doubts)
    return SetupVerdict(setup=program.setup.name, finish=finish, residuals=found, solids=solid_view, replay=history,
                        certificate=proven, cusps=cusps, excess_proof=proof, error_bounds_mm=bounds, findings=findings,
                        stock=made, mesh=mesh,
                        numbers={**_numbers(found, solid_view, finish, bounds, history),
                                 **_between_samples(proof, found, options),
                                 "cusps": cusps.as_rows(finish.scallop_mm), "mesh": _tidy(checks),
                                 "gouge_proven_mm": _rounded(proven.proven_mm), "certificate": _tidy(proven.as_dict())})


def _between_samples(proof, found, options):
    """verify.json's numbers of what stands between the samples."""
    return {"excess_proven_mm": _rounded(proof.height_mm) if np.isfinite(proof.height_mm) else None,
            "sampling": {"spacing_mm": _rounded(options.spacing_mm), "tops": int(found.is_top.sum()), **proof.as_dict()}}


def _mesh_checks(made, mesh, found, program, bounds):
    """What `mesh_quality` says of the design's triangles and of the stock against them, and findings."""
    if not mesh_quality.is_installed():
        return {"left_out": mesh_quality.LEFT_OUT}, ()
    stock, triangles = solids.mesh_of(made.stock(PART))
    view = mesh_quality.third_view(stock, triangles, mesh, found, program.setup.frame.rotation[:, 2])
    size = float(np.linalg.norm(np.ptp(stock, axis=0)))
    allowed, findings = mesh_quality.compared(view, program.setup.name, tessellation_mm=mesh.deviation_mm,
                                              path_mm=bounds["path_mm"], zmap_mm=bounds["zmap_mm"], size_mm=size)
    return {"design": mesh_quality.mesh_faults(mesh.vertices_mm, mesh.triangles), "hausdorff": view,
            "resolution_mm": mesh_quality.RESOLUTION * size, "bounds_mm": allowed}, findings


def _excess_proof(piece, k, found, ground, drop, closest, finish, ball_radius_mm):
    """That no place of clamping k's faces stands higher than the highest that was found and is allowed."""
    own, d = piece.cuts[k], found.deviation_mm
    others = [c for c in piece.cuts if c is not own]
    fine = found.is_reachable & (d <= _allowed(finish) + NOISE_MM)
    reach = lambda p, n: reach_of(p, n, own, drop, closest, ball_radius_mm) == REACHABLE
    return prove_excess(ground, [own, *others], d[fine].max(initial=0.0), _allowed(finish),
                        lambda p, n: piece.deviations(p, n, LIMIT_MM)[0], reach)


def _directions(posted):
    """(n, 3) from start to end of each move, WCS; zero where either is not known."""
    return np.nan_to_num(posted.end_mm - posted.start_mm)


def _runs(moves):
    """Moves that follow one another, as lists in order of their rows."""
    found = []
    for move in sorted(moves, key=lambda m: m.row):
        if found and move.row == found[-1][-1].row + 1:
            found[-1].append(move)
        else:
            found.append([move])
    return found


def _allowed(finish):
    """Largest deviation that a finished point may show."""
    return finish.scallop_mm + finish.profile_tolerance_mm


def _rounded(value, decimals=6):
    return value if isinstance(value, int) else round(float(value), decimals)


def _indices(solid, faces):
    """Positions of faces in the solid's own order."""
    order, explorer = [], TopExp_Explorer(solid, TopAbs_FACE)
    while explorer.More():
        order.append(explorer.Current())
        explorer.Next()
    found = [k for f in faces for k, other in enumerate(order) if other.IsSame(f)]
    if not faces or len(found) != len(faces):
        raise InputError(f"{len(faces)} faces are to be verified, {len(found)} of them belong to the solid: "
                         "give the faces of this very solid")
    return found


def _fitted(options, faces, low, high, finish):
    """Options with every None replaced."""
    plan = float(np.prod((high - low)[:2]))
    fit = {"spacing_mm": default_spacing_mm(sum(face_area_mm2(f) for f in faces)),
           "solid_pitch_mm": float(np.clip(np.sqrt(plan / SOLID_NODES), 0.05, 1.0)),
           "replay_pitch_mm": float(np.clip(np.sqrt(plan / REPLAY_NODES), 0.1, 1.0)),
           "tessellation_mm": float(np.clip(finish.profile_tolerance_mm, 0.002, 0.01))}
    return Options(**{**options.__dict__, **{k: v for k, v in fit.items() if getattr(options, k) is None}})


def _replayed(program, tools, before, mesh, drops, machine, finish, options):
    """The program replayed on the stock that it finds."""
    frame = program.setup.frame
    low, high = before.box_in(frame)
    zmap = ZMap.over(low, high, options.replay_pitch_mm)
    design = drop_tips_mm(drops, zmap.xy_mm, DESIGN_PIN_MM, 0.0)
    design = np.where(np.isfinite(design), design, np.nan).reshape(zmap.ny, zmap.nx)
    return replay(program.posted, tools, stock_min=low, stock_max=high, pitch_mm=options.replay_pitch_mm,
                  stock_top_mm=before.heights_mm(frame, zmap.xy_mm).reshape(zmap.ny, zmap.nx) if before.cuts else None,
                  design_top_mm=design, design=ClearanceTree.of_triangles(frame.into(mesh.vertices_mm), mesh.triangles),
                  design_error_mm=mesh.deviation_mm + finish.gouge_mm, fixtures=program.fixtures, machine=machine,
                  frame=frame, setup=program.setup.name, holder_clearance_mm=options.holder_clearance_mm,
                  shank_clearance_mm=options.shank_clearance_mm)


def _numbers(found, solid_view, finish, bounds, history):
    """verify.json's numbers of one setup."""
    d, fair = found.deviation_mm, found.is_reachable
    finished = fair & (d <= MISSED * _allowed(finish))
    area = found.area_mm2
    clearance, held = history.holder_clearance_mm, solid_view.volumes
    numbers = {
        "gouge_max_mm": max(0.0, -d.min(initial=0.0)), "excess_max_mm": max(0.0, d[fair].max(initial=0.0)),
        "cusp_max_mm": max(0.0, d[finished].max(initial=0.0)),
        "cusp_p99_mm": max(0.0, weighted_percentile(d[finished], found.samples.weight_mm2[finished], 0.99)),
        "gouge_volume_mm3": solid_view.gouge_volume_mm3, "excess_volume_mm3": solid_view.excess_volume_mm3,
        "error_bound_mm": bounds["path_mm"] + bounds["tracing_mm"] + bounds["post_rounding_mm"],
        "points_checked": int((~found.is_top).sum()), "area_required_mm2": area(slice(None)),
        "area_reached_mm2": area(fair & (d <= _allowed(finish) + NOISE_MM)), "area_unreachable_mm2": area(~fair),
        "unreachable": unreachable_places(found),
        "holder_clearance_mm": clearance if np.isfinite(clearance) else None,
        "clearance_not_proven_lines": [int(line) for line in history.undecided_lines],
        "verifiers": {
            "compared_area_mm2": held.area_mm2, "bound_mm3": held.bound_mm3, "net_bound_mm3": held.net_bound_mm3,
            "excess_mm3": list(held.excess_mm3), "gouge_mm3": list(held.gouge_mm3), "net_mm3": list(held.net_mm3),
            "bodies_beyond_tolerance": len(solid_view.bodies), "grid_artefacts": solid_view.artefacts}}
    return _tidy(numbers)


def _tidy(value):
    """Numbers rounded to 1e-6 throughout."""
    if isinstance(value, dict):
        return {k: _tidy(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_tidy(v) for v in value]
    return _rounded(value) if isinstance(value, float) else value


class _Reporter:
    """Findings of both verifiers."""

    def __init__(self, program, finish, found, own):
        self.posted, self.setup, self.frame = program.posted, program.setup.name, program.setup.frame
        self.finish, self.found, self.own = finish, found, own

    def _finding(self, kind, found, sample, amount, advice):
        row = int(found.row[sample])
        place = found.samples.points_mm[sample].round(6)
        return Finding(kind=kind, amount_mm=_rounded(amount), place_mm=tuple(place.tolist()),
                       operation=self.posted.operation_name(row) if row >= 0 else "",
                       line=int(self.posted.line[row]) if row >= 0 else 0, setup=self.setup, advice=advice)

    def gouges(self):
        """One finding a connected gouge deeper than the finish allows."""
        d = self.own.deviation_mm
        for group in self.own.groups(d < -self.finish.gouge_mm - NOISE_MM):
            worst = group[d[group].argmin()]
            yield self._finding("gouge", self.own, worst, -d[worst],
                                f"the cutter goes {-d[worst]:.4f} mm below the surface, {self.finish.gouge_mm:g} mm are "
                                f"allowed, over {self.own.area_mm2(group):.2f} mm2: tighten the segment tolerance, "
                                "take a smaller cutter here, or mend the offset of this pass")

    def unseen_gouges(self, proven):
        """Moves that are not proven to keep to what the finish allows, where no sample tells of them."""
        d, points = self.own.deviation_mm, self.own.samples.points_mm
        told = self.frame.into(points[d < -self.finish.gouge_mm - NOISE_MM])
        for moves in _runs(gouges_beyond(proven, self.finish.gouge_mm)):
            worst = max(moves, key=lambda m: m.depth_mm)
            if len(told) and np.linalg.norm(told - worst.place_mm, axis=1).min() <= 2 * self.own.spacing_mm:
                continue
            place = self.frame.out(np.array([worst.place_mm]))[0].round(6)
            yield Finding(kind="gouge", amount_mm=_rounded(worst.depth_mm), place_mm=tuple(place.tolist()),
                          operation=self.posted.operation_name(worst.row), line=int(self.posted.line[worst.row]),
                          setup=self.setup, advice=f"between the sample points this move may go {worst.depth_mm:.4f} mm "
                          f"into the part, {self.finish.gouge_mm:g} mm are allowed; {len(moves)} moves from line "
                          f"{self.posted.line[moves[0].row]}: lift them, or tighten the segment tolerance")

    def excess(self):
        """One finding a connected area that a ball could finish and that was left proud."""
        d, allowed = self.found.deviation_mm, _allowed(self.finish)
        for group in self.found.groups(self.found.is_reachable & (d > allowed + NOISE_MM)):
            worst, area = group[d[group].argmax()], self.found.area_mm2(group)
            missed = np.median(d[group]) > MISSED * allowed and area >= MISSED_MM2
            advice = (f"{area:.1f} mm2 were never finished: add a pass here, or a smaller cutter" if missed else
                      f"{d[worst]:.4f} mm are left over {area:.2f} mm2, {allowed:.4f} mm are allowed: "
                      "reduce the step, or take a smaller cutter here")
            yield self._finding("missing_area" if missed else "excess", self.found, worst, d[worst], advice)

    def unseen_excess(self, proof, cut):
        """One finding a connected group of places that only the proof has found to stand too high."""
        allowed = _allowed(self.finish)
        told = self.found.samples.points_mm[self.found.is_reachable & (self.found.deviation_mm > allowed + NOISE_MM)]
        for group in clusters_of(np.vstack([told, proof.higher_mm]), 2 * self.found.spacing_mm):
            if group.min() < len(told):
                continue
            worst = group[proof.amount_mm[group - len(told)].argmax()] - len(told)
            place = proof.higher_mm[[worst]]
            row = int(nearest_moves(cut.paths, cut.frame.into(place))[1][0])
            yield Finding(kind="excess", amount_mm=_rounded(proof.amount_mm[worst]), setup=self.setup,
                          place_mm=tuple(place[0].round(6).tolist()),
                          operation=self.posted.operation_name(row) if row >= 0 else "",
                          line=int(self.posted.line[row]) if row >= 0 else 0,
                          advice=f"{proof.amount_mm[worst]:.4f} mm are left between the sample points, "
                          f"{allowed:.4f} mm are allowed: reduce the step, or take a smaller cutter here")

    def disagreements(self, view, pitch_mm, bounds):
        """The second verifier must see what the first sees, and the other way round."""
        yield from self._volume_disagreements(view.volumes)
        yield from self._unseen_by_residuals(view, bounds)
        yield from self._unseen_by_solids(view, pitch_mm, bounds)

    def _volume_disagreements(self, held):
        for name, (first, second), bound in (("excess", held.excess_mm3, held.bound_mm3), ("gouge", held.gouge_mm3, held.bound_mm3),
                                             ("excess less gouge", held.net_mm3, held.net_bound_mm3)):
            if abs(first - second) > bound:
                yield Finding(kind="verifiers_disagree", amount_mm=_rounded(abs(first - second) / held.area_mm2), place_mm=None,
                              operation="", line=0, setup=self.setup, advice=f"{name}: residuals add up to {first:.6f} mm3, "
                              f"solids to {second:.6f} mm3, more than {bound:.6f} mm3 apart over {held.area_mm2:.0f} mm2: "
                              "report this as a fault of cuspline")

    def _unseen_by_residuals(self, view, bounds):
        slack = bounds["tessellation_mm"] + bounds["path_mm"] + NOISE_MM
        for body in view.bodies:
            found = self._seen_in(body.kind)
            d, fair = found.deviation_mm[body.samples], found.is_reachable[body.samples]
            seen = ((d > _allowed(self.finish) - slack) | ~fair if body.kind == "excess"
                    else d < -self.finish.gouge_mm + slack)
            if not seen.any():
                yield Finding(kind="verifiers_disagree", amount_mm=_rounded(body.depth_mm), place_mm=body.place_mm,
                              operation="", line=0, setup=self.setup,
                              advice=f"the solids show a body of {body.kind}, {body.volume_mm3:.6f} mm3, "
                              f"{body.depth_mm:.4f} mm deep, that no sample point shows: reduce spacing_mm")

    def _seen_in(self, kind):
        """Residuals that a body of that kind must show in."""
        return self.found if kind == "excess" else self.own

    def _unseen_by_solids(self, view, pitch_mm, bounds):
        slack = bounds["tessellation_mm"] + bounds["path_mm"] + 3 * bounds["zmap_mm"]
        for kind in ("excess", "gouge"):
            found = self._seen_in(kind)
            d, samples = found.deviation_mm, found.samples
            beyond = (found.is_reachable & (d > _allowed(self.finish) + slack) if kind == "excess"
                      else d < -self.finish.gouge_mm - slack)
            seen = np.zeros(len(d), dtype=bool)
            for body in view.bodies:
                if body.kind == kind:
                    seen |= ((samples.points_mm > np.array(body.min_mm) - found.spacing_mm).all(axis=1)
                             & (samples.points_mm < np.array(body.max_mm) + found.spacing_mm).all(axis=1))
            up = samples.normals @ self.frame.rotation[:, 2]
            for group in found.groups(beyond & (up > 0.5)):
                wide = np.ptp(self.frame.into(samples.points_mm[group])[:, :2], axis=0).min() > SEEN_PITCHES * pitch_mm
                if wide and not seen[group].any():
                    worst = group[np.abs(d[group]).argmax()]
                    yield self._finding("verifiers_disagree", found, worst, abs(d[worst]),
                                        f"sample points show {kind} of {d[worst]:.4f} mm that the solids do not "
                                        "show: reduce solid_pitch_mm")
