"""The verdict on one setup and on the part: both verifiers, their agreement, the replay, all findings."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer

from cuspline.design.design import by_clamping
from cuspline.kernel import brep, mesh_quality, solids
from cuspline.kernel.tessellation import Tessellation, tessellate
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.replay import replay
from cuspline.replay.replay_result import Replay
from cuspline.replay.scene import FinishedDesign, FoundStock, Surroundings, ZMap
from cuspline.stock.stock_solids import StockSolids
from cuspline.stock.swept import is_height_field, lowest_moves, stock_height_mm, swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.surfaces.holes import holes_of
from cuspline.surfaces.projection import ClosestTree
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm
from cuspline.values import fixed_math as fixed
from cuspline.values.checkpoints import NOTHING
from cuspline.values.errors import InputError
from cuspline.values.findings import Finding
from cuspline.values.known import Known
from cuspline.verification.certificate import Certificate, certify, solid_in_wcs
from cuspline.verification.climbing import Ground
from cuspline.verification.cusps import Cusps, SampledStock, measured_cusps
from cuspline.verification.excess_proof import ExcessProof, is_bare, prove_excess
from cuspline.verification.faces_not_cut import faces_not_cut, gaps, point_left_mm
from cuspline.verification.in_process import PART
from cuspline.verification.process_findings import process_of
from cuspline.verification.reach import DOWNWARD, REACHABLE, drop_mesh, upper
from cuspline.verification.reporter import MISSED, NOISE_MM, Reporter, allowed_mm, rounded
from cuspline.verification.residuals import (
    LIMIT_MM,
    Beside,
    Residuals,
    SampledFaces,
    as_columns,
    default_spacing_mm,
    residuals,
    unreachable_places,
    weighted_percentile,
)
from cuspline.verification.samples import face_area_mm2, sample_faces
from cuspline.verification.setup_mismatch import joints
from cuspline.verification.solid_check import Limits, SolidComparison, compare
from cuspline.verification.tabs import said_of_left, with_left
from cuspline.verification.text_checks import increments_mm, path_tolerance_mm
from cuspline.verification.true_depths import FEW, SEARCHED, largest_true_mm, roughly_true_mm

COLLISIONS = ("rapid_through_stock", "shank_contact", "holder_contact", "fixture_contact")
OF_THE_RESULT = ("path_mm", "tracing_mm", "post_rounding_mm", "path_tolerance_mm", "gaps_mm", "increments_mm")   # of gouge and cusp
TRACING_MM = 1e-7         # length of a traced ray
PROVEN_SHARE = 1 / 3      # of the allowed gouge: how near to the truth the certificate's bounds come
FINEST_MM = 2e-4          # the finest that they are asked for
SOLID_NODES = 20_000      # of the second verifier's grid: it holds against the first what no finer grid would show better
REPLAY_NODES = 15_000     # between them bounds over whole cells hold
MESH_TRIANGLES = 500_000  # of the design: on a longer part they lie farther off, and the bounds say so
COARSER = 10.0            # times the deviation: a mesh that tells how many triangles there will be
DESIGN_PIN_MM = 1e-3      # radius of the pin that feels the design's height at a node
PLANNERS = 384            # samples whose true depth the planner's own check asks for
SAME_DECIMALS = 6         # of a cosine: directions that look at a face as squarely


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
    finer: float = 1.0                        # how many times as fine as fitted the sample points and the solids' grid are


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupVerdict:
    """Everything found about one setup."""

    setup: str
    finish: object                    # design.Finish
    required: tuple[int, ...]         # numbers of the solid's faces that it answers for
    residuals: Residuals
    solids: SolidComparison
    replay: Replay
    certificate: Certificate
    cusps: Cusps                      # at ridges between passes
    excess_proof: ExcessProof         # that nothing between samples stands higher
    error_bounds_mm: dict             # part -> mm
    numbers: dict                     # verify.json's contract, without findings
    places: dict                      # name -> (n,) what edges meet, see process_findings.Process
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
        worst = ("gouge_max_mm", "gouge_proven_mm", "excess_max_mm", "cusp_max_mm", "cusp_p99_mm")
        bounded = ("excess_proven_mm", "error_bound_mm")        # None where there is no bound
        summed = ("gouge_volume_mm3", "gouge_volume_bound_mm3", "excess_volume_mm3", "excess_volume_bound_mm3",
                  "points_checked", "area_required_mm2", "area_reached_mm2", "area_unreachable_mm2")
        together = ("unreachable", "collisions", "findings", "cusps", "joints")
        return {"ok": self.ok, **{k: max((p[k] for p in parts), default=0.0) for k in worst},
                **{k: _largest([p[k] for p in parts]) for k in bounded},
                **{k: rounded(sum(p[k] for p in parts)) for k in summed},
                "error_bounds_mm": {k: _largest([p["error_bounds_mm"][k] for p in parts])
                                    for k in parts[0]["error_bounds_mm"]}
                if parts else {},
                "at_least": sorted({name for p in parts for name in p["at_least"]}),
                **{k: [item for p in parts for item in p[k]] for k in together}, "setups": parts}


def _largest(bounds):
    """The largest of bounds; None where one of them is none."""
    return None if None in bounds else max(bounds, default=0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupDraft:
    """What the samples and the replay show of one setup; nothing between the samples is proven."""

    setup: str
    numbers: dict                     # of the contract of verify.json those that the samples tell
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupProgram:
    """One clamping's program, read back from the text."""

    posted: object                    # PostedMoves
    setup: object                     # design.Setup: name and frame
    faces: tuple                      # TopoDS_Face values of the solid (or values with such a `.shape`) that it cuts
    fixtures: tuple = ()              # of scene.Fixture, WCS
    left: tuple = ()                  # of design.tabs.Tab and design.drill_points.DrillPoint, that stay beside the part


@dataclass(frozen=True, eq=False, kw_only=True)
class Judging:
    """What programs are judged by."""

    tools: dict                       # tool number -> cutters.Tool
    stock: object                     # a value of design.stock, part coordinates
    finish: object                    # design.Finish
    ball_radius_mm: float             # smallest ball of the shop's library
    machine: object = None            # machines.Machine, or None: travel and table are not asked
    material: str = ""                # name of the work material
    force: object = None              # shop.cutting_forces.CuttingForce of it, or None: forces and chatter are not checked
    hole_force: object = None         # shop.hole_forces.HoleForce of it, or None: drills and taps are not checked
    whole_tools: dict | None = None   # number -> Tool as they are, where `tools` are as simulated; None: the same
    life: object = None               # shop.tool_lives.ToolLife of it, or None: edges are not counted
    options: Options = Options()
    kept: object = NOTHING            # kept.Kept, asked first for what takes long; NOTHING keeps nothing
    say: Callable = lambda text: None       # called with what is being done, and how large it is


def verify_setup(posted, tools, solid, faces, *, setup, fixtures=(), **judging):
    """Verdict on a part cut by one program in one clamping; see `verify_setups` and `Judging`."""
    program = SetupProgram(posted=posted, setup=setup, faces=tuple(faces), fixtures=tuple(fixtures))
    return verify_setups((program,), solid, Judging(tools=tools, **judging))[0]


def verify_setups(programs, solid, judging):
    """Verdict on the posted programs of all clampings, in the order in which they are cut.

    Every face is judged after all programs; each program is replayed on the stock that those before it leave, and
    answers for its own gouges on any of the faces.  A part that is plated later is judged as plated: what the cutters
    less a skin of the plating leave is held against its faces (planning/plating.py), which is the metal against faces
    that lie so much deeper.

    Args:
        programs: SetupProgram values.
        solid: TopoDS_Solid, part coordinates.
        judging: Judging.
    Returns:
        one SetupVerdict a program.
    Raises:
        InputError: no faces, or faces of another solid; a plating that is no thinner than the smallest ball.
        SimulationError: a cutter that is no thicker than the plating.
    """
    return first_look(programs, solid, judging).verdicts()


def first_look(programs, solid, judging):
    """The first verifier alone: FirstLook, from which the whole verdict goes on.

    Args, raises: as `verify_setups`.
    """
    part, clampings = _laid_out(programs, solid, judging)
    for c in clampings:
        judging.say(f"{c.name}: {len(c.samples):,} samples against {len(c.program.posted):,} moves, and tops between them")
    found = residuals(part.piece, [c.sampled for c in clampings], part.closest, part.ball_radius_mm,
                      allowed_mm(judging.finish), judging.finish.gouge_mm, judging.kept)
    return FirstLook(part=part, clampings=clampings, judging=judging, residuals=found)


@dataclass(frozen=True, eq=False, kw_only=True)
class FirstLook:
    """What the first verifier finds of programs."""

    part: object                      # _Part
    clampings: list                   # _Clamping, one a program
    judging: Judging
    residuals: list                   # (Residuals of its faces after all, of all faces after it alone), one a program

    def verdicts(self):
        """The other verifiers' look at the same; one SetupVerdict a program."""
        finished_mm = MISSED * allowed_mm(self.judging.finish)
        steps = joints([c.name for c in self.clampings], [own for _, own in self.residuals],
                       [len(found.samples) for found, _ in self.residuals], finished_mm=finished_mm,
                       fade_mm=float(np.sqrt(2.0 * self.part.largest_radius_mm * finished_mm)))
        return tuple(_judged(self.part, c, found, own, self.judging, joined, proof)
                     for c, (found, own), joined, proof in zip(self.clampings, self.residuals, steps, self.proofs))

    @cached_property
    def proofs(self):
        """ExcessProof of every program: what stands between the samples."""
        return tuple(_excess_proof(self.part, c, found, self.judging.say) for c, (found, _) in zip(self.clampings, self.residuals))

    @property
    def faces_left(self):
        """Of every program what is not cut of faces that its setup names and that look up at its tools, most of each:
        [(points (n, 3), normals (n, 3)) of a connected place, part coordinates]."""
        return [_places(found, [group for group in _not_cut(self.part, c, found, self.judging.tools)
                                if (found.reach[group] != DOWNWARD).any()])
                for c, (found, _) in zip(self.clampings, self.residuals)]

    @property
    def gaps_left(self):
        """The same of gaps beside what is cut."""
        return [_places(found, _gaps(self.part, c, found)) for c, (found, _) in zip(self.clampings, self.residuals)]

    def gouges_mm(self, limit_mm):
        """Deepest gouge of every program, [mm]: what its samples show; where that is beyond a limit, along the nearest way of some.

        A sample's ray runs on beside an edge as thin as the cut: 0.0002 mm off a razor's edge looked 2 mm deep.  There all rays
        are as long and their search takes minutes: the verdict's, not this one's.
        """
        found = []
        for c, (after_all, own) in zip(self.clampings, self.residuals):
            true_mm = lambda residuals, rows, is_of_all: _true_mm(self.part, c, after_all, residuals, rows, True, PLANNERS)
            found.append(_largest_mm(own, own.deviation_mm < -limit_mm, own.deviation_mm < 0, true_mm)[0])
        return found

    def drafts(self):
        """What this look and the replay show by themselves; one SetupDraft a program."""
        return tuple(_drafted(self.part, c, found, own, self.judging) for c, (found, own) in zip(self.clampings, self.residuals))


class _LookedAt:
    """What is worked out of a solid alone, once, however often programs are judged against it."""

    def __init__(self, solid):
        self.solid, self.faces, self._made = solid, brep.faces_of(solid), Known()

    def triangles(self, within_mm):
        """Tessellation of it."""
        return self._made.once(("triangles", within_mm), lambda: tessellate(self.solid, within_mm))

    def affordable_mm(self, deviation_mm):
        """The deviation asked, or what keeps to MESH_TRIANGLES: their number goes with its inverse."""
        expected = COARSER * len(self.triangles(COARSER * deviation_mm).triangles)
        return deviation_mm * max(1.0, expected / MESH_TRIANGLES)

    def drops(self, program, within_mm):
        """DropMesh of these triangles, and of what is to be left beside the part, in a program's WCS."""
        frame, left = program.setup.frame, program.left

        def made():
            mesh = self.triangles(within_mm)
            up = upper(frame.into(mesh.vertices_mm), mesh.triangles)
            corners, triangles = with_left(mesh.vertices_mm, up, left)
            return drop_mesh(frame.into(corners), triangles)

        return self._made.once(("drops", within_mm, frame.rotation.tobytes(), frame.origin_mm.tobytes(), repr(left)), made)

    @property
    def closest(self):
        """ClosestTree of it."""
        return self._made.once("closest", lambda: ClosestTree.of_faces(self.faces))

    def samples(self, chosen, spacing_mm):
        """Samples of some faces, by their numbers."""
        return self._made.once(("samples", tuple(chosen), spacing_mm),
                               lambda: sample_faces([self.faces[i] for i in chosen], spacing_mm))

    def ground(self, chosen):
        """Ground of some faces."""
        return self._made.once(("ground", tuple(chosen)), lambda: Ground.of_faces([self.faces[i] for i in chosen]))

    def area_mm2(self, chosen):
        """Of some faces."""
        return sum(self._made.once(("area", i), lambda i=i: face_area_mm2(self.faces[i].shape)) for i in sorted(chosen))


@lru_cache(maxsize=1)
def _looked_at(solid):
    """_LookedAt of a TopoDS solid; that of the one before is let go."""
    return _LookedAt(solid)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Part:
    """What all clampings share."""

    solid: object                     # TopoDS_Solid, part coordinates
    finish: object
    ball_radius_mm: float
    piece: Workpiece                  # after all clampings, as plated
    metal: Workpiece                  # the same before it is plated
    made: StockSolids                 # the same as solids
    mesh: Tessellation                # of the design
    closest: ClosestTree | None       # of the design, where cutters undercut or lean

    @cached_property
    def surface(self):
        """ClosestTree of the whole part."""
        return _looked_at(self.solid).closest

    @cached_property
    def gap_mm(self):
        """How far faces lie apart along their edges, where that is more than rounding."""
        return brep.widest_gap(self.solid)[0]

    @cached_property
    def path_error_mm(self):
        return max((p.error_mm for c in self.piece.cuts for p in c.paths), default=0.0)

    @cached_property
    def largest_radius_mm(self):
        """Of the cutters: so round is what the last pass beside a border leaves."""
        return max((p.tool.cutter.radius_mm for c in self.piece.cuts for p in c.paths), default=0.0)

    @cached_property
    def mesh_faults(self):
        return mesh_quality.mesh_faults(self.mesh.vertices_mm, self.mesh.triangles)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Clamping:
    """One clamping as it is judged."""

    number: int
    program: SetupProgram
    options: Options                  # every None replaced
    required: list                    # numbers of the solid's faces that it cuts
    before: Workpiece                 # the stock that it finds, of metal
    sampled: SampledFaces             # its faces

    @property
    def name(self):
        return self.program.setup.name

    @property
    def samples(self):
        return self.sampled.samples

    @property
    def drops(self):
        return self.sampled.drops


def _laid_out(programs, solid, judging):
    """_Part, and a _Clamping of each program."""
    finish, ball_radius_mm, options, say = judging.finish, judging.ball_radius_mm, judging.options, judging.say
    looked = _looked_at(solid)
    exact = looked.faces
    named = [_indices(solid, [getattr(f, "shape", f) for f in p.faces]) for p in programs]
    beside_of = _positions_beside(programs)
    required = judged_once(named, [p.setup.frame.rotation[:, 2] for p in programs], beside_of, exact)
    if ball_radius_mm <= finish.plating_mm:
        raise InputError(f"plating_mm {finish.plating_mm:g} is no thinner than the smallest ball, of radius "
                         f"{ball_radius_mm:g} mm: correct it")
    piece = metal = Workpiece(blank=judging.stock.shape)
    before, fitted = [], []
    for k, program in enumerate(programs):
        say(f"{program.setup.name}: index over {len(program.posted):,} moves")
        before.append(metal)
        area_mm2 = looked.area_mm2(set().union(*(named[j] for j in (k, *beside_of[k]))))
        fitted.append(_fitted(options, area_mm2, *metal.box_in(program.setup.frame), finish))
        paths = swept_paths(program.posted, judging.tools)
        metal = metal.after(program.setup.frame, paths)
        piece = piece.after(program.setup.frame, _as_plated(paths, finish))
    finest = min(o.tessellation_mm for o in fitted)
    if options.tessellation_mm is None:
        finest = looked.affordable_mm(finest)
    say(f"triangles of the design within {finest:.4f} mm")
    mesh = looked.triangles(finest)
    say(f"samples of the faces, {len(mesh.triangles):,} triangles for their reach")
    drops = [looked.drops(p, finest) for p in programs]
    holes = [_holes(solid, p, judging.tools) for p in programs]
    beside = lambda k: tuple(Beside(cut=piece.cuts[j], drops=drops[j], holes=holes[j], cuts_too=np.isin(required[k], named[j]))
                             for j in beside_of[k] if set(required[k]) & set(named[j]))
    clampings = [_Clamping(number=k, program=p, options=o, required=chosen, before=found,
                           sampled=SampledFaces(samples=looked.samples(chosen, o.spacing_mm), spacing_mm=o.spacing_mm,
                                                ground=looked.ground(chosen),
                                                feeds=p.setup.frame.turn_out(np.nan_to_num(p.posted.end_mm - p.posted.start_mm)),
                                                drops=drops[k], holes=holes[k], beside=beside(k)))
                 for k, (p, o, chosen, found) in enumerate(zip(programs, fitted, required, before))]
    upright = all(is_height_field(c.paths) for c in piece.cuts)
    made = StockSolids(piece, [o.solid_pitch_mm for o in fitted], mesh.vertices_mm, mesh.triangles,
                       judging.kept.of(stock_height_mm))
    return _Part(solid=solid, finish=finish, ball_radius_mm=ball_radius_mm - finish.plating_mm, piece=piece,
                 metal=metal, made=made, mesh=mesh,
                 closest=None if upright else looked.closest), clampings


def _holes(solid, program, tools):
    """Hole values of the part in a program's WCS; none where it takes no drill."""
    used = set(program.posted.tool.tolist())
    if not any(n in used and t.cutter.drills for n, t in tools.items()):
        return ()
    return holes_of(brep.faces_of(solid_in_wcs(solid, program.setup.frame)))


def judged_once(named, axes, beside, faces):
    """Which faces each program answers for: one that several positions of a clamping cut is judged by that
    which looks at its middle most squarely.

    A position that is best for none keeps the one that it sees most squarely: each has something to answer for.

    Args:
        named: [[index]] of the solid's faces, one list a program.   axes: (3,) of each program's tool, unit, part coordinates.
        beside: [[number]] of the other programs in the clamping of each.   faces: brep.Face of the solid.
    Returns:
        [[index]], each sorted as it was.
    """
    square = lambda i, j: round(float(fixed.matmul(faces[i].middle.normal[0], axes[j])), SAME_DECIMALS)
    best = lambda i, among: max((j for j in among if i in named[j]), key=lambda j: (square(i, j), -j))
    own = [[i for i in mine if best(i, (k, *beside[k])) == k] for k, mine in enumerate(named)]
    return [some or [max(mine, key=lambda i: (square(i, k), -i))] for k, (some, mine) in enumerate(zip(own, named))]


def _positions_beside(programs):
    """[[number]] of the other programs in the clamping of each."""
    together = by_clamping(list(enumerate(programs)), lambda before, item: item[1].setup.is_held_as(before[1].setup))
    return [[j for j, _ in held if j != k] for held in together for k, _ in held]


def _as_plated(paths, finish):
    """SweptPaths of the cutters less a skin of the plating; where there is none, the same."""
    return tuple(p.grown(-finish.plating_mm) for p in paths) if finish.plating_mm else paths


def _judged(part, c, found, own, judging, joined, proof):
    """SetupVerdict of clamping c.

    `found` are the residuals of its faces, `own` those of all faces after it alone; `joined`: its joints with earlier ones;
    `proof`: its ExcessProof.
    """
    finish, tools, machine = part.finish, judging.tools, judging.machine
    kept, say, moves = judging.kept, judging.say, f"{len(c.program.posted):,} moves"
    say(f"{c.name}: replay of {moves} on a grid of {c.options.replay_pitch_mm:.3f} mm")
    stock = _found_stock(part, c, tools)
    history = _replayed(part, c, judging, stock)
    say(f"{c.name}: what the edges meet on {moves}")
    process = process_of(c.program.posted, judging, stock, found.row[found.is_own], (c.name, c.program.setup.frame))
    say(f"{c.name}: certificate of {moves}")
    solid = solid_in_wcs(part.solid, c.program.setup.frame)
    proven = certify(c.program.posted, tools, None, solid=solid, kept=kept, skin_mm=finish.plating_mm,
                     tolerance_mm=max(PROVEN_SHARE * finish.gouge_mm, FINEST_MM))
    say(f"{c.name}: cusps beside {len(c.samples):,} samples")
    cusps = _cusps(part, c, found)
    say(f"{c.name}: solids on a grid of {c.options.solid_pitch_mm:.3f} mm" + (", third view" if c.options.mesh_checks else ""))
    columns = as_columns(found, part.piece, allowed_mm(finish))
    view = compare(part.made, c.number, part, c.drops, c.required, (columns, own), Limits(
        excess_mm=allowed_mm(finish), gouge_mm=finish.gouge_mm, path_error_mm=part.path_error_mm,
        surface_error_mm=part.mesh.deviation_mm, ball_radius_mm=part.ball_radius_mm))
    bounds = {"path_mm": part.path_error_mm, "tracing_mm": TRACING_MM, "post_rounding_mm": c.options.post_rounding_mm,
              "path_tolerance_mm": path_tolerance_mm(c.program.posted, machine),
              "tessellation_mm": part.mesh.deviation_mm, "zmap_mm": view.volumes.zmap_mm,
              **({"stock_mm": part.piece.blank.error_mm} if part.piece.blank.error_mm else {}),
              **({"gaps_mm": part.gap_mm} if part.gap_mm else {}),
              **({"increments_mm": steps_mm} if (steps_mm := increments_mm(machine)) else {})}
    bounds = {name: rounded(v, 9) if np.isfinite(v) else None for name, v in bounds.items()}
    true_mm = _once(partial(_true_mm, part, c, found))
    report = Reporter(c.program, finish, found, own, true_mm, columns)
    checks, doubts = _mesh_checks(part, c, found, bounds) if c.options.mesh_checks else ({}, ())
    findings = (*history.findings, *_idle(part, c, own, history, tools), *process.findings, *report.gouges(),
                *report.unseen_gouges(proven), *report.excess(), *report.not_cut(_not_cut(part, c, found, tools)),
                *report.unseen_excess(proof, part.piece.cuts[c.number]), *report.unproven(proven, proof),
                *report.disagreements(view, c.options.solid_pitch_mm, bounds), *doubts)
    radius_of = lambda row: tools[int(c.program.posted.tool[row])].cutter.radius_mm
    left = unreachable_places(found, c.program.setup.frame.rotation[:, 2], radius_of)
    numbers = _numbers(found, view, finish, bounds, history, true_mm)       # after the findings: these search as deep as is allowed
    numbers["unreachable"] = _tidy(said_of_left(left, c.program.left, part.ball_radius_mm))
    return SetupVerdict(setup=c.name, finish=finish, required=tuple(c.required), residuals=found, solids=view, replay=history,
                        certificate=proven, cusps=cusps, excess_proof=proof, error_bounds_mm=bounds, findings=findings,
                        stock=part.made, mesh=part.mesh, places=process.places,
                        numbers={**numbers,
                                 **_between_samples(proof, found, c.options),
                                 "joints": _tidy(joined), "cusps": cusps.as_rows(finish.scallop_mm), "mesh": _tidy(checks),
                                 "gouge_proven_mm": rounded(proven.proven_mm), "certificate": _tidy(proven.as_dict()),
                                 "process": process.document})


def _drafted(part, c, found, own, judging):
    """SetupDraft of clamping c; residuals as for `_judged`."""
    judging.say(f"{c.name}: replay of {len(c.program.posted):,} moves on a grid of {c.options.replay_pitch_mm:.3f} mm")
    history = _replayed(part, c, judging, _found_stock(part, c, judging.tools))
    true_mm = _once(partial(_true_mm, part, c, found))
    report = Reporter(c.program, part.finish, found, own, true_mm, as_columns(found, part.piece, allowed_mm(part.finish)))
    return SetupDraft(setup=c.name, numbers=_tidy(_on_faces(found, part.finish, true_mm)),
                      findings=(*history.findings, *_idle(part, c, own, history, judging.tools), *report.gouges(),
                                *report.excess(), *report.not_cut(_not_cut(part, c, found, judging.tools))))


def _not_cut(part, c, found, tools):
    """Groups of samples on clamping c's faces most of which is not cut, see faces_not_cut."""
    faces, used = _looked_at(part.solid).faces, set(c.program.posted.tool.tolist())
    left = point_left_mm(c.sampled.holes, [t.cutter for n, t in tools.items() if n in used and t.cutter.drills])
    return faces_not_cut(found, [faces[i] for i in c.required], part.ball_radius_mm, part.finish,
                         {k: left[i] for k, i in enumerate(c.required) if i in left}, c.program.setup.frame.rotation[:, 2],
                         part.piece.cut_distance_mm)


def _places(found, groups):
    return [(found.samples.points_mm[group], found.samples.normals[group]) for group in groups]


def _gaps(part, c, found):
    """See faces_not_cut.gaps, of clamping c's faces."""
    faces = _looked_at(part.solid).faces
    return gaps(found, [faces[i] for i in c.required], part.ball_radius_mm, part.finish, c.program.setup.frame.rotation[:, 2])


def _idle(part, c, own, history, tools):
    """The replay's findings of operations that take nothing off, but for those that leave less at some sample.

    The replay sees no less than its grid and its planes do; a pass over one place takes micrometres between them.
    """
    return tuple(f for f in history.idle if not _leaves_less(part, c, own, f.row, tools))


def _leaves_less(part, c, own, row, tools):
    """Whether more would stand at some sample without the operation that a move of clamping c belongs to."""
    posted, piece = c.program.posted, part.piece
    of = posted.operation == posted.operation[row]
    mine = np.flatnonzero((own.row >= 0) & of[own.row])
    if not len(mine):
        return False
    paths = _as_plated(swept_paths(posted.without(of), tools), part.finish)
    cuts = tuple(replace(cut, paths=paths) if k == c.number else cut for k, cut in enumerate(piece.cuts))
    asked = own.samples.points_mm[mine], own.samples.normals[mine], LIMIT_MM
    without, all_of_it = (w.deviations(*asked)[0] for w in (replace(piece, cuts=cuts), piece))
    return bool((without > all_of_it + NOISE_MM).any())


def _cusps(part, c, found):
    """Cusps beside the samples that are no tops, where clamping c finished the face."""
    count, piece = len(c.samples), part.piece
    row, d = found.row[:count], found.deviation_mm[:count]
    fair = found.is_reachable[:count] & found.is_own[:count] & (row >= 0) & (d <= allowed_mm(part.finish) * MISSED)
    sampled = SampledStock(ground=c.sampled.ground, samples=found.samples.first(count), spacing_mm=found.spacing_mm,
                           height_mm=np.where(fair, d, -np.inf),
                           feed=np.where((row >= 0)[:, None], c.sampled.feeds[row], 0.0))
    return measured_cusps(sampled, piece.cuts[c.number], c.program.posted, piece.heights(1.0),
                          lambda p, n: piece.deviations(p, n, LIMIT_MM)[0], c.required)


def _between_samples(proof, found, options):
    """verify.json's numbers of what stands between the samples."""
    return {"excess_proven_mm": rounded(proof.height_mm) if np.isfinite(proof.height_mm) else None,
            "sampling": {"spacing_mm": rounded(options.spacing_mm), "tops": int(found.is_top.sum()), **proof.as_dict()}}


def _mesh_checks(part, c, found, bounds):
    """What `mesh_quality` says of the design's triangles and of the stock against them, and findings."""
    if not mesh_quality.is_installed():
        return {"left_out": mesh_quality.LEFT_OUT}, ()
    stock = solids.mesh_of(part.made.stock(PART))
    view = mesh_quality.third_view(stock, part.mesh, found, c.program.setup.frame.rotation[:, 2],
                                   allowed_mm(part.finish), part.piece.cut_distance_mm, is_met=len(part.piece.cuts) > 1)
    size = float(fixed.length(np.ptp(stock[0], axis=0)))
    allowed, findings = mesh_quality.compared(view, c.name, tessellation_mm=part.mesh.deviation_mm,
                                              path_mm=bounds["path_mm"], zmap_mm=bounds["zmap_mm"], size_mm=size)
    return {"design": part.mesh_faults, "hausdorff": view, "resolution_mm": mesh_quality.RESOLUTION * size,
            "bounds_mm": allowed}, findings


def _excess_proof(part, c, found, say):
    """That no place of clamping c's faces stands higher than the highest that was found and is allowed."""
    say(f"{c.name}: proof of what stands between the samples")
    own, d, allowed = part.piece.cuts[c.number], found.deviation_mm, allowed_mm(part.finish)
    cuts = [cut for cut in sorted(part.piece.cuts, key=lambda cut: cut is not own) if cut.paths]
    if not cuts:
        return ExcessProof.of_nothing(rounded(c.samples.weight_mm2.sum()))
    fine = found.is_reachable & (d <= allowed + NOISE_MM)
    reach = lambda p, n, face: c.sampled.reach(own, p, n, face, part.closest, part.ball_radius_mm) == REACHABLE
    faces = _looked_at(part.solid).faces
    bare = is_bare([faces[i] for i in c.required], part.piece.blank, allowed) & (part.finish.plating_mm == 0)
    return prove_excess(c.sampled.ground, cuts, d[fine].max(initial=0.0), allowed,
                        lambda p, n: part.piece.deviations(p, n, LIMIT_MM)[0], reach, bare=bare)


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


def _fitted(options, area_mm2, low, high, finish):
    """Options with every None replaced; the area is that of all faces of the clamping."""
    plan = float(np.prod((high - low)[:2]))
    fit = {"spacing_mm": default_spacing_mm(area_mm2) / options.finer,
           "solid_pitch_mm": float(np.clip(np.sqrt(plan / SOLID_NODES), 0.05, 1.0)) / options.finer,
           "replay_pitch_mm": float(np.clip(np.sqrt(plan / REPLAY_NODES), 0.1, 1.0)),
           "tessellation_mm": float(np.clip(finish.profile_tolerance_mm, 0.002, 0.01))}
    return Options(**{**options.__dict__, **{k: v for k, v in fit.items() if getattr(options, k) is None}})


def _replayed(part, c, judging, stock):
    """The program replayed on the FoundStock that it finds."""
    program, options, mesh, frame = c.program, c.options, part.mesh, c.program.setup.frame
    top = drop_tips_mm(c.drops, stock.zmap.xy_mm, DESIGN_PIN_MM, 0.0)
    design = FinishedDesign(top_mm=np.where(np.isfinite(top), top, np.nan).reshape(stock.zmap.shape),
                            tree=ClearanceTree.of_triangles(frame.into(mesh.vertices_mm), mesh.triangles),
                            error_mm=mesh.deviation_mm + part.finish.gouge_mm + part.finish.plating_mm)
    around = Surroundings(machine=judging.machine, fixtures=program.fixtures, frame=frame, setup=c.name,
                          holder_clearance_mm=options.holder_clearance_mm, shank_clearance_mm=options.shank_clearance_mm)
    return replay(program.posted, judging.tools, stock, design=design, around=around, kept=judging.kept)


def _found_stock(part, c, tools):
    """FoundStock of clamping c."""
    before, frame = c.before, c.program.setup.frame
    low, high = before.box_in(frame)
    zmap = ZMap.over(low, high, c.options.replay_pitch_mm)
    return FoundStock(min_mm=low, max_mm=high, pitch_mm=c.options.replay_pitch_mm,
                      top_mm=None if before.fills_box_in(frame) else before.heights_mm(frame, zmap.xy_mm).reshape(zmap.shape),
                      within_mm=partial(before.highest_within_mm, frame),
                      parts=FoundStock.parts if before.is_cut_along(frame) else 1,      # cubes are no finer than cells
                      within_before=lambda row: _within_before(c, tools, row),
                      standing_before=lambda row: partial(_stock_before(c, tools, row).standing_mm, frame),
                      is_stock=lambda points: before.is_stock(frame.out(points)),
                      is_free_within=lambda points, radius: before.is_free_within(frame.out(points), radius, frame),
                      left_by_heads=lambda xy: _left_by_heads(part, c, high, low, xy),
                      columns=None if before.blank.fills_box_in(frame) else before.blank.columns(frame, zmap.xy_mm))


def _true_mm(part, c, found, residuals, rows, is_brief, few=FEW):
    """True amount of a group of samples of clamping c: (amount, row, whether it may be more); in brief of `few`."""
    piece, far = part.piece, part.piece.blank.size_mm
    left = piece if residuals is found else Workpiece(blank=piece.blank, cuts=(piece.cuts[c.number],))
    is_proud = residuals.deviation_mm[rows[0]] > 0
    belongs = lambda p: left.is_stock(p) if is_proud else left.cut_distance_mm(p) < 0
    asked = residuals.samples, residuals.deviation_mm, rows, lambda p, n: left.deviations(p, n, far)[0], part.surface
    return roughly_true_mm(*asked, few) if is_brief else largest_true_mm(*asked, belongs, residuals.spacing_mm)


def _once(true_mm):
    """The same function of residuals and rows, run once for each: findings and numbers ask for the same groups.

    After SEARCHED samples it is brief, but where the largest of all is asked for.
    """
    known, searched = {}, []

    def asked(residuals, rows, is_of_all=False):
        key = id(residuals), rows.tobytes()
        if key not in known:
            known[key] = true_mm(residuals, rows, is_brief=sum(searched) >= SEARCHED and not is_of_all)
            searched.append(len(rows))
        return known[key]
    return asked


def _largest_mm(found, is_beyond, is_side, true_mm):
    """(largest true amount of the samples of one side, whether it may be more): what is beyond tolerance is followed."""
    size = np.abs(found.deviation_mm)
    amount, more = size[is_side & ~is_beyond].max(initial=0.0), False
    if (is_side & is_beyond).any():
        true, _, more = true_mm(found, np.flatnonzero(is_side & is_beyond), is_of_all=True)
        amount = max(amount, true)
    return float(amount), more


def _on_faces(found, finish, true_mm):
    """verify.json's numbers of one setup that its samples tell."""
    d, fair = found.deviation_mm, found.is_reachable
    gouge, excess = (_largest_mm(found, np.abs(d) > allowed + NOISE_MM, side, true_mm) for allowed, side in (
        (finish.gouge_mm, d < 0), (allowed_mm(finish), fair & (d > 0))))
    finished = fair & (d <= MISSED * allowed_mm(finish))
    area = found.area_mm2
    return {
        "gouge_max_mm": gouge[0], "excess_max_mm": excess[0],
        "at_least": [name for name, (_, more) in (("gouge_max_mm", gouge), ("excess_max_mm", excess)) if more],
        **({"plating_mm": finish.plating_mm} if finish.plating_mm else {}),
        "cusp_max_mm": max(0.0, d[finished].max(initial=0.0)),
        "cusp_p99_mm": max(0.0, weighted_percentile(d[finished], found.samples.weight_mm2[finished], 0.99)),
        "points_checked": int((~found.is_top).sum()), "area_required_mm2": area(slice(None)),
        "area_reached_mm2": area(fair & (d <= allowed_mm(finish) + NOISE_MM)), "area_unreachable_mm2": area(~fair)}


def _numbers(found, solid_view, finish, bounds, history, true_mm):
    """verify.json's numbers of one setup."""
    clearance, held = history.holder_clearance_mm, solid_view.volumes
    return _tidy({
        **_on_faces(found, finish, true_mm),
        "gouge_volume_mm3": solid_view.gouge.mm3, "gouge_volume_bound_mm3": solid_view.gouge.bound_mm3,
        "excess_volume_mm3": solid_view.excess.mm3, "excess_volume_bound_mm3": solid_view.excess.bound_mm3,
        "error_bound_mm": _sum([bounds[k] for k in OF_THE_RESULT if k in bounds]),
        "holder_clearance_mm": clearance if np.isfinite(clearance) else None,
        "clearance_not_proven_lines": [int(line) for line in history.undecided_lines],
        "verifiers": {
            "compared_area_mm2": held.area_mm2, "bound_mm3": held.bound_mm3, "net_bound_mm3": held.net_bound_mm3,
            "excess_mm3": list(held.excess_mm3), "gouge_mm3": list(held.gouge_mm3), "net_mm3": list(held.net_mm3),
            "bodies_beyond_tolerance": len(solid_view.bodies), "grid_artefacts": solid_view.artefacts}})


def _sum(bounds):
    """Of bounds; None where one of them is none."""
    return None if None in bounds else sum(bounds)


def _tidy(value):
    """Numbers rounded to 1e-6 throughout."""
    if isinstance(value, dict):
        return {k: _tidy(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_tidy(v) for v in value]
    return rounded(value) if isinstance(value, float) else value


def _within_before(c, tools, row):
    """Function (places, radius) -> heights that no stock so near exceeds before one move of a clamping; WCS."""
    frame = c.program.setup.frame
    return partial(_stock_before(c, tools, row).highest_within_mm, frame)


def _stock_before(c, tools, row):
    """Workpiece before one move of a clamping."""
    return c.before.after(c.program.setup.frame, swept_paths(c.program.posted.first(row), tools))


def _left_by_heads(part, c, high, low, xy_mm):
    """Heights that a clamping's tools on heads alone leave at places (n, 2), and the rows that left them; WCS."""
    paths = [p for p in part.metal.cuts[c.number].paths if p.tool.head is not None]
    return lowest_moves(paths, xy_mm, float(high[2]), bottom_mm=float(low[2]))
