"""The recipe: the one place that knows all stages, from a design to published files.

Everything is made in a folder beside the outputs and swapped in at the end; a build killed at any
moment leaves the old outputs or the new ones.  What took it long stays in `.<outputs>.kept/` until
a build is published: the next one goes on from there.  A program with a finding that is not accepted
by name is not published: it stays in `<outputs>-rejected/` with its report.
"""

import ctypes
import hashlib
import importlib.metadata
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

import cuspline
from cuspline.app import mending
from cuspline.app.catalogue import FOR_SLOTS, find_library, sources_of_post
from cuspline.app.judge import begun, figures_in_words, post_module, posted_positions, told_in_words
from cuspline.app.outcome import Result
from cuspline.app.report_inputs import report_bundle, shape_of, view_of
from cuspline.app.spare_cutters import first_that_helps
from cuspline.design.design import by_clamping, with_zero_heights
from cuspline.design.job import Job, PostedFile, digest_of, job_line
from cuspline.design.setup_alignment import refixturing_in_words
from cuspline.design.stock import FromFile, settled, stock_in_words
from cuspline.kernel import brep, mesh_quality, solids
from cuspline.kernel.glb import write_glb
from cuspline.kernel.solids import stl_of
from cuspline.planning.by_engagement import follows_engagement, met_by, process_words
from cuspline.planning.copied_plans import copied, with_copies
from cuspline.planning.feeds import TIME_ASSUMPTIONS
from cuspline.planning.plan import clamping_program, plan_setup
from cuspline.planning.preflight import refuse_gaps, refuse_impossible_setups
from cuspline.process.not_checked import not_checked
from cuspline.report.pictures import render_shape
from cuspline.shop.cutters import simulated
from cuspline.shop.materials import material_named
from cuspline.shop.practice import ShopFile
from cuspline.shop.tool_table import dropped_fields
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.amounts import counted
from cuspline.values.checkpoints import kept_beside
from cuspline.values.errors import CamError, CutterDoesNotFit, InputError, PostError
from cuspline.values.findings import Finding
from cuspline.values.input_files import sha256_of
from cuspline.values.interruption import held_off
from cuspline.values.units import MM
from cuspline.verification.in_process import PART
from cuspline.verification.measuring import refuse_unmeasurable
from cuspline.verification.self_crossing import refuse_self_crossing
from cuspline.verification.verdict import Options

STAGES = ("step", "plan", "gcode", "verify", "report")
DRAFT = "draft"               # plan, program and a first look at it, in place of all that follows
DRAFT_OPTIONS = Options(finer=0.5, tessellation_mm=0.01)        # a quarter of the sample points; triangles tell what is in reach
FACES, GAPS = "faces", "gaps"   # what an order's cutters may leave
LEFT = {*mending.TOO_HIGH, "face_not_cut"}      # kinds of findings about what stands
HELD_PLANS = 4                # up to so many hold what they were planned with
UNVERIFIED = "VERDICT: NOT VERIFIED YET"
VERSIONED = ("build123d", "cadquery", "cadquery-ocp", "numpy", "scipy", "numba", "manifold3d", "pymeshlab")


@dataclass(frozen=True, kw_only=True)
class Order:
    """What is to be built."""

    source: object              # catalogue.DesignSource
    design: object              # design.Design
    machine: object
    library: object
    spare: tuple[str, ...] = ()     # names of libraries with smaller cutters: those `for_all` in turn where the one before leaves a
                                    # face; flat ones of all at once for slots and pockets into which the library's do not get
    leaves: str = ""                # FACES or GAPS that are told: smaller cutters were tried and do no better
    shop: ShopFile = ShopFile()     # what the shop decides
    accepted: tuple[str, ...]
    out: Path
    last_stage: str
    revision: str = ""          # of the repository, where whoever builds says it; "" nobody does

    @property
    def smaller(self):
        """The ToolLibrary with the first spare ones beside the design's own tools, the others behind it; None: there are none."""
        library = None
        for name in reversed(self.spare):
            library = self.library_named(name).with_smaller(library)
        return library

    @property
    def for_all(self):
        """Those names that are for more than slots and pockets."""
        return tuple(name for name in self.spare if name != FOR_SLOTS)

    def library_named(self, name):
        """The ToolLibrary of that name with the design's own tools."""
        return find_library(name).with_tools(self.design.tools)


def build(order, say=lambda text: None):
    """Build one design.

    Args:
        order: Order.
        say: called with what is being done.
    Returns:
        Result; its folder is `order.out`, or `order.out`-rejected where findings stand.
    Raises:
        CamError: what is wrong with the input or the plan; nothing is left half-written.
    """
    work = order.out.parent / f".{order.out.name}.part"
    try:
        order.out.parent.mkdir(parents=True, exist_ok=True)
        _restore(order.out)
        _refuse_what_is_not_ours(order.out)
        shutil.rmtree(work, ignore_errors=True)
        work.mkdir()
    except OSError as error:
        raise InputError(f"--out {order.out}: cannot be written ({error.strerror}); name another folder") from None
    try:
        result = _made(order, work, say)
        target = order.out if result.is_ok or order.last_stage == DRAFT else _rejected(order.out)
        with held_off():
            _swap_in(work, target)
            if result.is_ok:
                shutil.rmtree(_rejected(order.out), ignore_errors=True)
                kept_beside(order.out).remove()
        return replace(result, folder=target)
    finally:
        with held_off():
            shutil.rmtree(work, ignore_errors=True)


def _made(order, work, say):
    """All stages up to the last one wanted, into the work folder."""
    design = order.design
    say(f"{design.name}: STEP")
    solid = brep.the_solid(design.solid, f"design {design.name}")
    design = replace(design, stock=settled(design.stock, solid, order.shop.practice))
    if order.machine.supports_z_mm is not None:
        design = with_zero_heights(design)
    order = replace(order, design=design)
    if design.setups and order.last_stage != "step":
        refuse_impossible_setups(design, solid, order.machine, order.library)
        refuse_unmeasurable(design.dimensions, solid, design.predicates)
    step = work / f"{design.name}.step"
    brep.write_step(brep.storable(solid), step, design.name)
    design = _with_files(design, work)
    order = replace(order, design=design)
    inputs = inputs_hash(order, step)
    # from here on every stage sees what a reader of the file sees
    solid = brep.the_solid(brep.read_step(step), step.name)
    design = replace(design, solid=solid)
    order = replace(order, design=design)
    for companion in design.companions:
        name = f"{design.name}.{companion.name}"
        brep.write_step(companion.make(), work / f"{name}.step", name)
    shape = shape_of(solid, has_thin_edges=not design.setups)
    refuse_self_crossing(solid, shape, f"design {design.name}: the solid in {step.name}")
    if design.setups:
        refuse_gaps(design, solid)
    write_glb(work / f"{design.name}.glb", design.name, shape.vertices_mm, shape.normals, shape.triangles)
    if order.last_stage == "step":
        return _finished(order, work, inputs, None)
    if not design.setups:
        return _measured(order, work, inputs, shape, say)
    off, _ = _measured_solid(order, work, say)
    return _with_cutters(order, work, step, shape, off, say)


def _with_cutters(order, work, step, shape, off, say):
    """All stages of a design with setups behind its solid, by the order's cutters; where these do not get everywhere, again with
    smaller ones beside them.  These are given up where something is wrong with what they make: if they were taken for a gap
    alone, whatever that is; for a face, if it is more than what they too leave of it.

    Args:
        step: file of the solid, in the work folder.   shape, off: as for `_programmed`.
    """
    before = []             # orders to go back to, the last first: where a face was left, then where a gap was
    while True:
        there, smaller = set(work.iterdir()), ()
        try:
            result = _programmed(order, work, inputs_hash(order, step), shape, off, say)
            if result.is_ok or not before or before[-1].leaves == FACES and {f.kind for f in result.findings} <= LEFT:
                return result
        except (CamError, _FaceLeft) as left:
            smaller = left.spare if isinstance(left, _FaceLeft) else ()
            if isinstance(left, CutterDoesNotFit) and order.for_all:
                smaller = order.spare
            if not smaller and not before:
                raise
            if isinstance(left, _FaceLeft):
                before.append(replace(order, leaves=left.what))
        _leave_only(work, there)
        if smaller:
            say(f"{order.design.name}: the cutters do not get everywhere; planned again with smaller ones beside them")
            order = replace(order, library=order.library_named(smaller[0]), spare=smaller[1:])
        else:
            say(f"{order.design.name}: smaller cutters do no better; planned again without them, what is left listed")
            order = before.pop()


class _FaceLeft(Exception):
    """Of what a setup names something is not cut, and there are spare cutters."""

    def __init__(self, what, spare):
        """what: FACES, most of one; GAPS beside what is cut.   spare: names of the libraries from the first on that gets there."""
        super().__init__(what)
        self.what, self.spare = what, spare


def _programmed(order, work, inputs, shape, off, say):
    """All stages of a design with setups behind its solid, whose files are in the work folder.

    Args:
        inputs: SHA-256 of what decides the outputs.   shape: of the solid.   off: findings about it.
    Raises:
        CutterDoesNotFit, _FaceLeft: the order's cutters are too few.
    """
    design, kept = order.design, kept_beside(order.out)
    plans = _planned(order, say)
    trial = _Trial(order=order, work=work, inputs=inputs, kept=kept, tell=lambda text: say(f"{design.name}: {text}"))
    if order.last_stage == DRAFT:
        return trial.drafted(plans, off)
    if order.last_stage == "plan":
        trial.write_plan(trial.planned(plans), trial.planned_cuts)
        return _finished(order, work, inputs, None, off)
    if order.last_stage == "gcode":
        plans, job, _ = trial.checked(plans)
        trial.write_plan(plans, trial.planned_cuts)
        return _finished(order, work, inputs, job, off)
    job, judged = trial.judged(*trial.checked(plans))
    verify = {**judged.as_dict(order.accepted), "stock": _stock_files(work, job, judged, say, kept)}
    _stamp_verdict(work, job, verify)
    _write_json(work / "verify.json", verify)
    say(f"{design.name}: stock coloured by its deviation")
    left_out = _coloured_stock(work / f"{design.name}.deviation.ply", judged, design.finish)
    if order.last_stage == "report":
        say(f"{design.name}: report")
        from cuspline.report.page import write_report  # matplotlib: a third of a second that other stages need not wait
        bundle = report_bundle(order, work, job, judged, verify, view_of(design.solid, shape), inputs)
        _, without = write_report(bundle, work)
        left_out = "; ".join(words for words in (left_out, without) if words)
    result = _finished(order, work, inputs, job, (*off, *judged.refused(order.accepted)), left_out)
    return replace(result, figures=judged.figures_in_words, accepted=judged.passed_over(order.accepted))


def _with_files(design, work):
    """The design, the files of its stock and fixtures copied beside its outputs: later stages see the copies."""
    setups = tuple(s.model_copy(update={"fixtures": tuple(
        f.written(work, f"{s.name}.fixture-{k}") for k, f in enumerate(s.fixtures, start=1))}) for s in design.setups)
    return replace(design, stock=design.stock.written(work, f"{design.name}.stock"), setups=setups)


def _measured(order, work, inputs, shape, say):
    """A design without setups: its solid as read back from STEP is measured, nothing is planned."""
    refused, count = _measured_solid(order, work, say)
    say(f"{order.design.name}: pictures")
    left_out = render_shape(shape, work)
    told = (f"solid {'CHECKED' if not refused else 'REJECTED'}, {count} figures kept; no setup, so nothing is planned or posted")
    return replace(_finished(order, work, inputs, None, refused, left_out), told=told)


def _measured_solid(order, work, say):
    """solid.json and drawings of a design that is measured: (findings that are not accepted, "k of n")."""
    design = order.design
    if design.measure is None:
        return (), ""
    say(f"{design.name}: solid read back from STEP and measured")
    report = design.measure(design.solid)
    off = tuple(f for f in report.figures if not f.is_kept)
    findings = tuple(Finding(
        kind="solid_off", amount_mm=abs(f.measured - f.wanted), place_mm=None, operation="", line=0, setup="",
        advice=f"{f.what}: {f.measured:.6g} {f.unit} measured, {f.wanted:.6g} wanted, "
               f"{f.allowed:.2g} allowed") for f in off)
    refused = tuple(f for f in findings if f.kind not in order.accepted)
    _write_json(work / "solid.json", {
        "design": design.name, "ok": not refused, "units": "mm", "accepted": list(order.accepted),
        "figures": [{**asdict(f), "ok": f.is_kept} for f in report.figures], **report.facts})
    if design.draw is not None:
        design.draw(work)
    return refused, f"{len(report.figures) - len(off)} of {len(report.figures)}"


def _planned(order, say):
    """SetupPlan of every setup; each begins with the stock that the programs before it leave, as they are posted.

    Of copies that is asked only where one that is planned for itself comes after them.
    """
    design, plans, cut, library = order.design, [], 0, order.library.with_smaller(order.smaller)
    piece = Workpiece(blank=design.stock.shape)
    for setup in design.setups:
        if setup.planned_as is not None:
            plans.append(copied(next(p for p in plans if p.setup.name == setup.planned_as), setup))
            continue
        while cut < len(plans):
            say(f"{design.name}: stock after {plans[cut].setup.name}")
            piece, cut = _cut_by(order, piece, plans[cut]), cut + 1
        say(f"{design.name}: plan {setup.name}")
        plans.append(plan_setup(design, setup, order.machine, library, piece, order.shop))
        _let_go(plans)
    idle = {plan.setup.name for plan in plans if not plan.operations and is_cut_by_others(plan, plans)}
    for name in sorted(idle):
        say(f"{design.name}: {name} is left out: other positions have cut all of its faces that it could")
    return [plan for plan in plans if plan.setup.name not in idle]


def is_cut_by_others(plan, plans):
    """Whether a plan is of an indexed position, not the first, whose faces others of its clamping cut, so that they are judged."""
    held = next(held for held in by_clamping(plans) if any(p is plan for p in held))
    others = {name for p in held if p is not plan and p.operations for name in p.setup.faces}
    return held[0] is not plan and set(plan.setup.faces) <= others


def _let_go(plans):
    """Of many plans none holds what is large and made again in seconds: of a propeller it was 200 MB each."""
    for plan in plans if len(plans) > HELD_PLANS else ():
        plan.context.let_go()


def _cut_by(order, piece, plan):
    """What a plan leaves of a Workpiece, as it is posted."""
    tools = {o.tool.number: o.tool for o in plan.operations}
    return piece.after(plan.setup.frame, swept_paths(_as_posted(order, plan), simulated(tools)))


def _as_posted(order, plan):
    """PostedMoves of a plan: posted as text and read back; of an indexed position without those before it in its clamping."""
    tools = {o.tool.number: o.tool for o in plan.operations}
    texts = post_module(order.machine).post(clamping_program([plan], (), plan.setup.name), order.machine).texts
    return posted_positions(texts, [plan.setup], order.machine, tools)[-1]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Trial:
    """Plans on trial: posted into the work folder, looked at there as files, mended, posted again."""

    order: Order
    work: Path
    inputs: str
    kept: object
    tell: Callable
    known: dict = field(default_factory=dict)       # plans -> what `as_run` has made of them
    joint_s: dict = field(default_factory=dict)     # (setup, operation) -> seconds through the joints, of the last program

    def as_run(self, plan):
        """The SetupPlan with speeds and feeds by what its edges meet, worked out once."""
        if id(plan) not in self.known:
            self.known[id(plan)] = plan, follows_engagement(plan)
        return self.known[id(plan)][1]

    def write_plan(self, plans, cuts=None):
        """plan.json.   cuts: function of the plans as run -> what the edges of each meet, one list of rows a plan."""
        plans = [self.as_run(plan) for plan in plans]
        document = plan_document(self.order, plans, None if cuts is None else cuts(plans), self.joint_s)
        _write_json(self.work / "plan.json", document)

    @staticmethod
    def planned_cuts(plans):
        """What the edges of plans meet, as they are planned: the programs are not judged."""
        return [[cut.as_dict() for cut in met_by(plan)] for plan in plans]

    def posted(self, plans, instead_of=None):
        """plan.json, programs and tools on disk; Job.  What was made of other plans is let go."""
        _let_go(plans)
        for key in self.known.keys() - {id(plan) for plan in plans}:
            del self.known[key]
        for name in instead_of.program_names if instead_of else ():
            (self.work / name).unlink()
        self.tell(f"post for {self.order.machine.name}")
        job, joint_s = _posted(self.order, [self.as_run(plan) for plan in plans], self.work, self.inputs)
        self.joint_s.clear()
        self.joint_s.update(joint_s)
        self.write_plan(plans)
        return job

    def begun(self, job):
        """The first part of the verdict."""
        return begun(self.work, job, self.tell, Options(), self.kept)

    def checked(self, plans):
        """The plans, mended where the posted moves leave or take more than the finish allows, a margin kept.

        Returns:
            plans, their Job, and its verdict as far as it has begun; None: not begun.
        """
        own = [p for p in plans if p.setup.planned_as is None]      # what is wrong with a copy is wrong with what it is copied from
        job, first, finish = self.posted(own), None, self.order.design.finish
        for number in range(1, mending.OWN_ROUNDS + 1 if any(p.is_mended for p in own) else 1):
            first = self.begun(job)
            if number == 1 and self.order.spare and "face_not_cut" not in self.order.accepted:
                self._ask_for_smaller(own, first.first)
            share = 1.0 - mending.MARGIN
            deep = first.first.gouges_mm(share * finish.gouge_mm)
            wants = [mending.wants_of(found, finish, mm, share) for (found, _), mm in zip(first.first.residuals, deep)]
            own, is_changed = self._mended(own, wants, number, "the planner's own check")
            if not is_changed:
                wants = [mending.wants_between(proof, finish) for proof in first.first.proofs]
                own, is_changed = self._mended(own, wants, number, "the planner's own proof between samples")
            if not is_changed:
                break
            self.tell(f"planned again, round {number} of the planner's own check")
            first = None                # large: let go before the next is made
            job = self.posted(own, instead_of=job)
        if len(own) == len(plans):
            return own, job, first
        first, by_name = None, {p.setup.name: p for p in own}
        plans = with_copies([by_name.get(p.setup.name, p) for p in plans])
        return plans, self.posted(plans, instead_of=job), None

    def _ask_for_smaller(self, plans, look):
        """
        Raises:
            _FaceLeft: what the plans leave, by verdict.FirstLook, one of the spare libraries gets to.
        """
        order = self.order
        for what, left in ((FACES, lambda: look.faces_left), (GAPS, lambda: look.gaps_left)):
            if order.leaves in (what, FACES) or not any(places := left()):
                continue
            helping = first_that_helps([order.library_named(name) for name in order.for_all], order.library, plans, places)
            if helping is not None:
                raise _FaceLeft(what, order.spare[helping:])

    def _mended(self, plans, wants, number, by):
        """`mending.mended`, which takes minutes of many positions: told where there is something to mend."""
        if not all(want.is_none for want in wants):
            self.tell(f"correcting what {by} found, round {number}")
        return mending.mended(plans, wants, number, by)

    def planned(self, plans):
        """The plans as `checked`; of the programs that it took nothing stays."""
        before = set(self.work.iterdir())
        plans, _, _ = self.checked(plans)
        _leave_only(self.work, before)
        return plans

    def drafted(self, plans, off):
        """Result of a first look at what the plans come to, as they are; `off`: findings about the solid."""
        job = self.posted(plans)
        found = begun(self.work, job, self.tell, DRAFT_OPTIONS).drafted()
        document = found.as_dict()
        _write_json(self.work / "draft.json", document)
        _stamp(self.work, job, draft_in_words(document).upper(), "DRAFT, NOTHING PROVEN: NOT FOR THE MACHINE")
        refused = (f for f in found.findings if f.kind not in self.order.accepted)
        return replace(_finished(self.order, self.work, self.inputs, job, (*off, *refused)),
                       figures=draft_in_words(document))

    def judged(self, plans, job, first):
        """(Job, Judged) of what is posted, mended and judged again while that helps; arguments as `checked` returns."""
        for number in range(1, mending.ROUNDS + 2):
            judged = (first or self.begun(job)).judged()
            if number > mending.ROUNDS:
                break
            wants = [mending.wants_of_verdict(v, self.order.accepted) for v in judged.verdict.setups]
            plans, is_mended = self._mended(plans, wants, number, "the verdict")
            if not is_mended:
                break
            self.tell(f"corrected, round {number} of {mending.ROUNDS}")
            first = judged = None       # large: let go before the next are made
            job = self.posted(plans, instead_of=job)
        self.write_plan(plans, lambda held: [v.numbers["process"]["operations"] for v in judged.verdict.setups])
        return job, replace(judged, verdict=mending.with_reasons(judged.verdict, plans),
                            extra=(*judged.extra, *(f for plan in plans for f in plan.idle)))


def _leave_only(work, paths):
    """Take away all files of a folder but some."""
    for path in set(work.iterdir()) - paths:
        path.unlink()


def _coloured_stock(path, judged, finish):
    """Write the simulated stock, coloured by its deviation; "" or why it is left out."""
    if not mesh_quality.is_installed():
        return mesh_quality.LEFT_OUT
    last = judged.verdict.setups[-1]
    vertices, triangles = solids.mesh_of(last.stock.stock(PART))
    off = mesh_quality.signed_distances_mm(vertices, last.mesh.vertices_mm, last.mesh.triangles)
    mesh_quality.write_coloured_ply(path, vertices, triangles, off, 1.5 * max(finish.scallop_mm, finish.gouge_mm))
    return ""


def _finished(order, work, inputs, job, findings=(), left_out=""):
    """Write the manifest, the last file of all."""
    files = {p.name: sha256_of(p) for p in sorted(work.iterdir())}
    asked = None if job is None else job.model_dump(mode="json")
    manifest = {
        "design": order.design.name, "stage": order.last_stage, "inputs_sha256": inputs,
        **({"revision": order.revision} if order.revision else {}),
        "parameters": order.design.parameters.model_dump(mode="json"), "machine": order.machine.name,
        "accepted": list(order.accepted), "left_out": left_out,
        "versions": {"cuspline": cuspline.__version__, **{n: _version(n) for n in VERSIONED}},
        "files": files, "job": asked, "job_sha256": {name: digest_of(value) for name, value in (asked or {}).items()}}
    _write_json(work / "manifest.json", manifest)
    return Result(folder=work, is_ok=not findings, findings=tuple(findings), left_out=left_out)


# plan and program ------------------------------------------------------------------------------


def plan_document(order, plans, cuts=None, joint_s=None):
    """plan.json: per operation cutter, step, feeds, time, and the candidates rejected.

    Args:
        joint_s: {(setup, operation): seconds through the joints} of the posted program, where rotaries turn in the cut.
        cuts: what the edges of each plan's operations meet, rows of verify.json's "process"; None: not known yet.
    """
    setups = []
    for plan, changes, met in zip(plans, tool_changes(plans), [()] * len(plans) if cuts is None else cuts):
        rows = {row["name"]: row for row in met}
        operations = [_operation_document(o, (joint_s or {}).get((plan.setup.name, o.name)))
                      | process_words(o, rows.get(o.name), plan.context.material) for o in plan.operations]
        lies = plan.setup.refixturing
        setups.append({"name": plan.setup.name, "operations": operations,
                       "listed": [a.as_dict() for a in plan.accounts], "wcs": plan.setup.wcs,
                       "not_checked": list(_not_checked(order, [plan])),
                       "refixturing": None if lies is None else lies.model_dump(mode="json"),
                       "time_s": round(sum(o["time_s"] for o in operations) + order.machine.tool_change_s * changes, 1),
                       "tool_changes": changes,
                       "time_assumptions": TIME_ASSUMPTIONS, "clearance_z_mm": plan.clearance_z_mm,
                       "area_required_mm2": round(plan.area_required_mm2, 3),
                       "area_reached_mm2": round(plan.area_reached_mm2, 3),
                       "mending": list(plan.mending),
                       "inner_edges": [{"place_mm": [round(x, 4) for x in e.place_mm],
                                        "opening_deg": round(e.opening_deg, 3), "length_mm": round(e.length_mm, 3),
                                        "radius_mm": plan.radius_left_mm(e),
                                        "reason": "two faces meet in an inner edge without a fillet: no ball cleans it"}
                                       for e in plan.inner_edges]})
    hollow = min((p.hollow for p in plans), key=lambda h: h.radius_mm)
    return {"design": order.design.name, "machine": order.machine.name, "material": order.design.material,
            "units": "mm", "min_concave_radius_mm": _finite(hollow.radius_mm),
            "min_concave_radius_place_mm": [round(x, 4) for x in hollow.place_mm],
            **{g.name: g.facts(order.design.where) for g in order.design.guides},
            "stock": _stock_document(order.design.stock), "setups": setups,
            **({"not_needed": idle} if (idle := _not_needed(order, plans)) else {})}


def _not_needed(order, plans):
    """Names of the design's setups that no plan is of: see `is_cut_by_others`."""
    names = {plan.setup.name for plan in plans}
    return [setup.name for setup in order.design.setups if setup.name not in names]


def tool_changes(plans):
    """[how many tool changes the program posts for a plan]: none where the tool of the operation before it is still in, be it of
    another indexed position of the same clamping."""
    counts = []
    for held in by_clamping(plans):
        inside = None
        for plan in held:
            numbers = [inside, *(o.tool.number for o in plan.operations)]
            counts.append(sum(a != b for a, b in zip(numbers, numbers[1:])))
            inside = numbers[-1]
    return counts


def _stock_document(stock):
    """What the part is cut from, part coordinates."""
    low, high = (corner.round(6).tolist() for corner in stock.shape.box_in(PART))
    return {"kind": stock_in_words(stock) or "BOX", "min_mm": low, "max_mm": high, **stock.model_dump(mode="json"),
            "deviation_mm": stock.shape.error_mm}


def _operation_document(o, joint_s=None):
    cutter, times = o.tool.cutter, {} if joint_s is None else {"time_s": round(joint_s, 1), "time_through": "joints"}
    cutting = o.moves.feed_mm_per_min[o.moves.feed_mm_per_min > 0]
    return {"name": o.name,
            "tool": {"number": o.tool.number, **cutter.model_dump(mode="json"), "stick_out_mm": o.tool.stick_out_mm,
                     "holder": o.tool.holder.model_dump(mode="json"),
                     "head": None if o.tool.head is None else o.tool.head.model_dump(mode="json")},
            "spindle_rpm": o.rpm, "coolant": o.coolant,
            "feed_mm_per_min": [float(cutting.min()), float(cutting.max())], "blocks": len(o.moves), **o.facts, **times}


def _posted(order, plans, work, inputs):
    """Post every setup, write the tools; Job, and {(setup, operation): seconds} where rotaries turn in the cut."""
    post = post_module(order.machine)
    tools = {o.tool.number: o.tool for p in plans for o in p.operations}
    if post.TOOL_TABLE is not None:
        (work / post.TOOL_TABLE).write_text(post.tool_table(tools.values(), order.machine.control))
        _write_json(work / "tools.dropped.json", dropped_fields(tools.values(), order.machine.control))
    _write_json(work / "tools.json", {"tools": [tools[n].model_dump(mode="json") for n in sorted(tools)]})
    posted, written, joint_s = [], {}, {}
    for held in by_clamping(plans):
        held_by = held[0].setup.name
        program = clamping_program(held, _header(order, held, inputs), f"{order.design.name} {held_by}")
        made = post.post(program, order.machine)
        texts, of = made.texts, [(plan.setup.name, o.name) for plan in held for o in plan.operations]
        joint_s |= {of[number - 1]: seconds for number, seconds in getattr(made, "joint_s", {}).items()}
        names = [f"{held_by}.{post.EXTENSION}"] if len(texts) == 1 else [
            f"{held_by}-{k:02d}.{post.EXTENSION}" for k in range(1, len(texts) + 1)]
        written |= zip(names, texts)
        posted += [PostedFile(setup=plan.setup.model_copy(update={"operations": ()}), program=names[0],
                              continued=tuple(names[1:])) for plan in held]
    balls = [t.cutter.radius_mm for t in order.library.of_type("ball")]
    job = Job(design=order.design.name, step=f"{order.design.name}.step", material=order.design.material,
              predicates=order.design.predicates, stock=order.design.stock, finish=order.design.finish,
              cutting_data=material_named(order.design.material, order.shop.materials),
              machine=order.machine, posted=tuple(posted), smallest_ball_radius_mm=min(balls),
              accepted=order.accepted, threads=order.design.threads, dimensions=order.design.dimensions,
              tabs=tuple(tab for p in plans for o in p.operations for tab in o.tabs),
              engravings=tuple(o.engraving for p in plans for o in p.operations if o.engraving is not None),
              edge_breaks=tuple(o.edge_break for p in plans for o in p.operations if o.edge_break is not None),
              worn_mm={o.name.lower(): c.worn_mm for p in plans for o in p.operations for c in o.compensated},
              force=next((f for f in order.shop.forces if f.material == order.design.material), None),
              life=next((t for t in order.shop.lives if t.material == order.design.material), None),
              hole_force=next((f for f in order.shop.hole_forces if f.material == order.design.material), None))
    line = job_line(digest_of(job.model_dump(mode="json")))
    for name, text in written.items():
        (work / name).write_text(text.replace(post.comment(job_line("")), post.comment(line)))
    return job, joint_s


def _header(order, held, inputs):
    """Comment lines that tell the operator what this is; `held`: the plans of one clamping."""
    design, setup, machine = order.design, held[0].setup, order.machine
    low, high = design.stock.shape.box_in(setup.clamped_frame)
    program = clamping_program(held, (), setup.name)
    ends = np.vstack([o.moves.end_mm for o in program.operations])
    is_inch, inch_mm = machine.control.units == "inch", MM["inch"]
    length = lambda mm: f"{mm / inch_mm:.4f}" if is_inch else f"{mm:.3f}"
    size = lambda mm: f"{mm / inch_mm:.4f}".rstrip("0").rstrip(".") if is_inch else f"{mm:g}"
    fine = lambda mm: f"{mm / inch_mm:.6f}".rstrip("0").rstrip(".") if is_inch else f"{mm}"
    show = lambda p: " ".join(f"{axis}{length(value)}" for axis, value in zip("XYZ", p))
    lines = [f"{design.name.upper()} {setup.name.upper()}, CUSPLINE {cuspline.__version__}", design.description,
             UNVERIFIED, "SIMULATED ONLY: PROVE IT OUT ABOVE THE WORK FIRST",
             f"INPUTS SHA-256 {inputs[:32]}", *([f"REVISION {order.revision}"] if order.revision else []), job_line(""),
             f"MACHINE {machine.name}, UNITS {machine.control.units.upper()}; LENGTHS IN THIS HEADER IN "
             + ("INCHES, BUT FOR PARAMETERS AND WHAT SAYS MM" if is_inch else "MM"),
             f"{setup.wcs}: {setup.wcs_in_words}",
             f"STOCK {design.material}: {_stock_in_words(design.stock, is_inch)}{show(low)} TO {show(high)}",
             f"TIP EXTENTS {show(ends.min(axis=0))} TO {show(ends.max(axis=0))}",
             f"RAPIDS ACROSS AT Z{length(program.clearance_z_mm)}",
             f"SCALLOP {fine(design.finish.scallop_mm)} PROFILE TOLERANCE {fine(design.finish.profile_tolerance_mm)} "
             f"GOUGE {fine(design.finish.gouge_mm)} PATH TOLERANCE {fine(machine.control.path_tolerance_mm)}"]
    if design.finish.plating_mm:
        lines.append(f"PLATED ON LATER {size(design.finish.plating_mm)}: THE METAL IS CUT SO MUCH BELOW THE DRAWING, AND JUDGED "
                     "THERE")
    for name, value in design.parameters.model_dump(mode="json").items():
        lines.append(f"PARAMETER {name} = {value}")
    seen = set()
    for o in (o for plan in held for o in plan.operations):
        if o.tool.number not in seen:
            seen.add(o.tool.number)
            lines.append(f"T{o.tool.number} {o.tool.cutter.name}, D{size(o.tool.cutter.diameter_mm)} "
                         f"R{size(o.tool.cutter.corner_radius_mm)}, STICK-OUT {size(o.tool.stick_out_mm)}, "
                         f"{o.tool.holder.name}, LENGTH {size(o.tool.length_mm)}{_head_in_words(o.tool.head, size)}")
    way = lambda plan: " ".join(f"{axis}{value:.3f}" for axis, value in zip(
        "XYZ", setup.clamped_frame.turn_into(np.array([plan.setup.wcs_z]))[0]))
    lines += [f"POSITION {plan.setup.name.upper()}: TOOL ALONG {way(plan)} OF THE WCS"
              for plan in held if len(held) > 1 or setup.indexed]
    lines += [f"MARKER {m.name} {show(setup.clamped_frame.into(np.array([m.at_mm]))[0])}" for m in setup.markers]
    if setup.refixturing is not None:
        lines.append(f"PART SITS AS MEASURED: {refixturing_in_words(setup.refixturing)}")
    if unknown := _not_checked(order, held):
        lines.append(f"NOT CHECKED: {'; '.join(unknown).upper()}")
    if order.accepted:
        lines.append(f"ACCEPTED BY NAME: {', '.join(order.accepted)}")
    return lines


def _not_checked(order, plans):
    """Words of process.not_checked of the operations of plans."""
    return not_checked(order.machine, [o.tool for plan in plans for o in plan.operations], order.design.material, order.shop)


def _stock_in_words(stock, is_inch):
    """What stands before its corners in the header: of a plain box nothing."""
    words = stock_in_words(stock) + (" MM" if is_inch else "")
    return f"{words}, WITHIN " if stock_in_words(stock) else ""


def _head_in_words(head, size):
    """What the operator must know of a tool's head; nothing where it has none."""
    return "" if head is None else (f", ON {head.name.upper()}, CUTTER TOWARD {head.cutter_points}, "
                                    f"{size(head.offset_mm)} BESIDE THE SPINDLE IN X; X Y Z ARE THE CUTTER'S MIDDLE")


def _stock_files(work, job, judged, say, kept):
    """Write the stock after every operation; what verify.json says of it."""
    rows = []
    for state in judged.stock_states(kept):
        say(f"{job.design}: stock after {state.setup} {state.operation}")
        (work / state.file).write_bytes(stl_of(state.solid))
        rows.append({**state.as_dict(), "sha256": sha256_of(work / state.file)})
    return rows


def _stamp_verdict(work, job, verify):
    """Put the verdict into each program's header, in place of the line that says there is none yet."""
    verdict, passed = "VERIFIED" if verify["ok"] else "REJECTED", sum(f["accepted"] for f in verify["findings"])
    short = f"VERDICT: {verdict}" + (f" WITH {counted(passed, 'accepted finding').upper()}" if passed else "")
    checked = f"{counted(verify['points_checked'], 'point')} checked"
    _stamp(work, job, *(f"{short}, {figures(verify)}, {checked}".upper() for figures in (told_in_words, figures_in_words)), short)


def draft_in_words(found):
    """What a draft's numbers come to, in a few words; `found`: draft.json.

    >>> draft_in_words({"gouge_max_mm": 0.0022, "cusp_max_mm": 0.0096, "points_checked": 1200})
    'draft, nothing proven: gouge 0.0022, cusp 0.0096 mm at 1,200 points'
    """
    return (f"draft, nothing proven: gouge {found['gouge_max_mm']:.4f}, cusp {found['cusp_max_mm']:.4f} mm at "
            f"{counted(found['points_checked'], 'point')}")


def _stamp(work, job, *words):
    """Put words into each program's header where it says that there is no verdict; the first that the control's lines hold, or
    the last."""
    comment = post_module(job.machine).comment
    line = next((c for c in map(comment, words) if len(c) < job.machine.control.line_length), comment(words[-1]))
    for name in job.program_names:
        path = work / name
        text = path.read_text()
        if text.count(comment(UNVERIFIED)) != 1:
            raise PostError(f"{name}: the header has lost its verdict line")
        path.write_text(text.replace(comment(UNVERIFIED), line))


# files -----------------------------------------------------------------------------------------


def inputs_hash(order, step):
    """SHA-256 over everything that decides the outputs: the solid itself and all that is asked of it."""
    design = order.design
    asked = {"name": design.name, "parameters": design.parameters.model_dump(mode="json"), "material": design.material,
             "predicates": [p.model_dump(mode="json") for p in design.predicates],
             "stock": design.stock.model_dump(mode="json"), "finish": design.finish.model_dump(mode="json"),
             "setups": [s.model_dump(mode="json") for s in design.setups],
             "machine": order.machine.model_dump(mode="json"), "library": order.library.model_dump(mode="json"),
             "spare": order.spare,
             "shop": order.shop.model_dump(mode="json", exclude={"practice": {"stock_allowance_mm"}}),     # the stock has it
             "accepted": order.accepted, "version": cuspline.__version__, **sources_of_post(order.machine)}
    files = [item.path.read_bytes() for item in (design.stock, *(f for s in design.setups for f in s.fixtures))
             if isinstance(item, FromFile)]
    return hashlib.sha256(b"".join([step.read_bytes(), json.dumps(asked, sort_keys=True).encode(), *files])).hexdigest()


def _version(name):
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _write_json(path, value):
    path.write_text(json.dumps(value, indent=1, allow_nan=False) + "\n")


def _finite(value):
    return round(float(value), 6) if np.isfinite(value) else None


def _rejected(out):
    return out.parent / f"{out.name}-rejected"


def _old(out):
    return out.parent / f".{out.name}.old"


def _restore(out):
    """Finish what a killed build has left: the old outputs come back where the new ones are missing."""
    if _old(out).exists():
        if out.exists():
            shutil.rmtree(_old(out), ignore_errors=True)
        else:
            _old(out).rename(out)


def _refuse_what_is_not_ours(out):
    """The outputs replace the whole folder: it must be an earlier output, or hold nothing."""
    is_ours = not out.exists() or (out.is_dir() and ((out / "manifest.json").exists() or not any(out.iterdir())))
    if not is_ours:
        raise InputError(f"--out {out} exists and is no earlier output (it has no manifest.json): "
                         "it would be replaced whole; name another folder")


def _swap_in(work, target):
    """Exchange two folders in one step where the system can, else in two renames."""
    if not target.exists():
        work.rename(target)
        return
    if not _exchanged(work, target):
        old = _old(target)
        shutil.rmtree(old, ignore_errors=True)
        target.rename(old)
        work.rename(target)
        shutil.rmtree(old, ignore_errors=True)


def _exchanged(a, b):
    """Linux exchanges two names atomically (renameat2 with RENAME_EXCHANGE)."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (OSError, AttributeError):
        return False
    here, exchange = -100, 2
    return rename(here, os.fsencode(a), here, os.fsencode(b), exchange) == 0
