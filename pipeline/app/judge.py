"""Judging posted files on disk against the STEP: read, simulate, compare.

The only way to a verdict, for `build` and `verify` alike: nothing comes from the internal path.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from cuspline.app.catalogue import coolants_taken, find_post, radii_taken, reader_of, tool_table_of
from cuspline.app.report_inputs import shape_of
from cuspline.app.worn_cutters import WornLook, worn_look, worn_tools
from cuspline.design.design import by_clamping
from cuspline.design.fixtures import placed_fixtures
from cuspline.design.job import read_tools
from cuspline.kernel import brep
from cuspline.program.positions import by_position
from cuspline.program.posted import PostedMoves
from cuspline.replay.machine_bodies import bodies_at
from cuspline.replay.replay_checks import Reporter
from cuspline.replay.scene import Fixture, SolidFixture
from cuspline.shop.cutters import simulated
from cuspline.shop.cutting_forces import force_of
from cuspline.shop.hole_forces import hole_force_of
from cuspline.shop.materials import known_materials
from cuspline.shop.tool_lives import life_of
from cuspline.surfaces.threaded_walls import faces_with_threads, threaded_walls
from cuspline.values.amounts import left_in_words
from cuspline.values.checkpoints import NOTHING
from cuspline.values.errors import InputError, ReadError
from cuspline.values.findings import Finding, axes_upright, located
from cuspline.values.input_files import refuse_irregular, sha256_of
from cuspline.verification.body_clearance import body_findings
from cuspline.verification.drilled_holes import drilled_points
from cuspline.verification.edge_breaks import edge_break_findings
from cuspline.verification.engraving import engraving_findings, raised
from cuspline.verification.feeding import feeding_findings
from cuspline.verification.file_checks import changed_files, changed_job, program_findings, tool_table_findings
from cuspline.verification.in_process import stock_states
from cuspline.verification.measuring import measured, tolerance_findings
from cuspline.verification.regions import regions
from cuspline.verification.self_crossing import refuse_self_crossing
from cuspline.verification.tabs import standing_tabs, tab_findings
from cuspline.verification.text_checks import refuse_what_cannot_be_simulated, text_findings
from cuspline.verification.threads import thread_findings
from cuspline.verification.turning import at_end_of_move, swinging_findings, turning_findings
from cuspline.verification.verdict import FirstLook, Judging, Options, SetupProgram, Verdict, first_look, verify_setups

OF_BODIES = ("idle_operation", "plunge", "overload")       # kinds that say how a cutter takes stock off
DRAFTED_WORST = ("gouge_max_mm", "excess_max_mm", "cusp_max_mm", "cusp_p99_mm")
DRAFTED_SUMS = ("points_checked", "area_required_mm2", "area_reached_mm2", "area_unreachable_mm2")
CLOSER = 2.0                # as fine a look again, where the two verifiers differ: it may be their own resolution


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged:
    """A verdict with what it was reached on."""

    verdict: Verdict
    solid: object                           # TopoDS_Solid out of the STEP file
    programs: tuple[SetupProgram, ...]      # one a setup
    tools: dict                             # number -> Tool
    extra: tuple[Finding, ...]              # about the programs as files
    stock: object                           # a value of design.stock, its file found
    read: tuple["ReadProgram", ...]         # one a setup
    dimensions: tuple = ()                  # measuring.Measured, on the stock after all of them
    names: dict                             # of faces that setups cut -> their numbers in the solid
    tabs: tuple[dict, ...] = ()             # rows of tabs.standing_tabs
    edge_breaks: tuple[dict, ...] = ()      # rows of edge_breaks.edge_break_findings
    worn: WornLook | None = None            # with worn cutters, where contours are shifted by the control

    @property
    def posted(self):
        """One PostedMoves a setup."""
        return tuple(p.posted for p in self.programs)

    def stock_states(self, kept=NOTHING):
        """The stock after every operation, one after the other: in_process.StockState."""
        setups = self.verdict.setups
        finished = None if setups[-1].finish.plating_mm else setups[-1].stock
        return stock_states(self.programs, self.tools, self.stock, [s.solids.pitch_mm for s in setups], kept, finished)

    @property
    def findings(self):
        return self.extra + self.verdict.findings

    def refused(self, accepted):
        """Findings that are not accepted by their kind."""
        return tuple(f for f in self.findings if f.kind not in accepted)

    def passed_over(self, accepted):
        """Findings that are accepted by their kind."""
        return tuple(f for f in self.findings if f.kind in accepted)

    @property
    def figures_in_words(self):
        """Gouge, cusp, the bound of both and what no cutter reaches, in a few words."""
        return told_in_words(self.verdict.as_dict())

    def as_dict(self, accepted):
        """verify.json; every finding says whether it was accepted."""
        numbers = self.verdict.as_dict()
        rows = [f.as_dict() for f in self.findings]
        in_setups = (f for s in numbers["setups"] for name in ("findings", "collisions") for f in s[name])
        for row in (*rows, *numbers["collisions"], *in_setups):
            row["accepted"] = row["kind"] in accepted
        sizes = {"dimensions": [m.as_dict() for m in self.dimensions]} if self.dimensions else {}
        sizes |= {"tabs": list(self.tabs)} if self.tabs else {}
        sizes |= {"edge_breaks": list(self.edge_breaks)} if self.edge_breaks else {}
        sizes |= {} if self.worn is None else {"compensation": self.worn.as_dict()}
        return {**numbers, **sizes, "ok": not self.refused(accepted), "accepted": sorted(accepted), "findings": rows,
                "regions": regions(self.verdict.setups, self.names)}


@dataclass(frozen=True, eq=False, kw_only=True)
class ReadProgram:
    """One clamping's program as the files say it, before anything is simulated."""

    setup: object                       # design.Setup
    texts: dict                         # file name -> text
    posted: PostedMoves
    findings: tuple[Finding, ...]       # that the text alone shows
    whole: PostedMoves                  # the clamping's from beginning to end, in its WCS; indexed positions share it
    position: np.ndarray                # (n,) indexed position that each move of the whole is made in; -1: in none
    is_first: bool = True               # of its files; indexed positions follow in the same


def read_programs(folder, job, tools):
    """Every program of a folder read back, with what its text alone shows.

    Args:
        folder: with the programs.   job: Job.   tools: {number: Tool}.
    Yields:
        ReadProgram.
    Raises:
        InputError: a file is missing.  ReadError: a program that no machine of this kind would take, or that goes so
            far that it cannot be simulated.
    """
    for held in by_clamping(job.posted):
        texts = {name: _text(Path(folder) / name) for name in held[0].files}
        parts = [_read(name, text, held[0].setup, job, tools) for name, text in texts.items()]
        moves = joined_files(parts, texts.values(), tools)
        found = text_findings(moves, tools, setup=held[0].setup, machine=job.machine, finish=job.finish,
                              material=job.cutting_data or known_materials().get(job.material))
        found = (*found, *feeding_findings(moves, texts.values(), job.machine, held[0].setup.name))
        setups = [item.setup for item in held]
        if len(held) == 1 and not held[0].setup.indexed:
            position = np.zeros(len(moves), np.int64)
            near, = body_findings(moves, position, setups, job, tools)
            swinging = swinging_findings(moves, held[0].setup, job, tools)
            yield ReadProgram(setup=held[0].setup, texts=texts, posted=moves, findings=(*found, *near, *swinging), whole=moves,
                              position=position)
            continue
        try:
            split = _by_position(moves, setups)
        except ReadError as error:
            raise ReadError(f"{', '.join(texts)}: {error}", rows=error.rows) from None
        found = [at_end_of_move(f, moves) if f.row >= 0 else f for f in found]      # no rows of the first position's own
        turning = turning_findings(split, setups, job, tools)
        near = body_findings(moves, split.position, setups, job, tools)
        for k, (item, own) in enumerate(zip(held, split.moves)):
            yield ReadProgram(setup=item.setup, texts=texts, posted=own, is_first=k == 0, whole=moves, position=split.position,
                              findings=(*(found if k == 0 else ()), *turning[k], *near[k]))


def judge_text(folder, job, published=None):
    """What a folder's programs and tool table show without STEP and simulation: seconds for the longest program.

    Args:
        folder, job, published: as for `judge`.
    Returns:
        tuple of Finding.
    Raises:
        InputError, ReadError: see `read_programs`.
    """
    tools, job = read_tools(folder), job.beside(folder)
    found = _file_findings(folder, job, tools, published)
    for program in read_programs(folder, job, tools):
        report = Reporter(program.posted, program.setup.name, program.setup.frame)
        top_mm = job.stock.shape.box_in(program.setup.frame)[1][2]
        own = (*program.findings, *report.travel(job.machine), *report.states(top_mm), *report.end())
        found += [*_program_findings(program, job.machine), *_placed(own, program, job.machine, tools)]
    return tuple(found)


def judge(folder, job, say=lambda text: None, options=Options(), kept=NOTHING, published=None):
    """Judged: the verdict on the files of a folder, `begun` to its end.

    Args, raises: as there.
    """
    return begun(folder, job, say, options, kept, published).judged()


def begun(folder, job, say=lambda text: None, options=Options(), kept=NOTHING, published=None):
    """A folder's files as far as the first verifier sees them.

    Args:
        folder: with the STEP file, the programs, tools.json and the control's tool table.
        job: Job.
        say: called with what is being done.
        options: how finely to look; the post's rounding is put in here.
        kept: kept.Kept of a run before that was interrupted.
        published: job.Published of what the files must be; None: they are not published yet, and who builds them has
            asked the solid whether it crosses itself.
    Returns:
        Begun.
    Raises:
        InputError: a file is missing.  ReadError: see `read_programs`.  DesignError: the STEP's solid crosses itself.
    """
    folder = Path(folder)
    tools, job = read_tools(folder), job.beside(folder)
    extra, broken = _file_findings(folder, job, tools, published), []
    say(f"read {', '.join(job.program_names)}")
    read = tuple(read_programs(folder, job, tools))
    solid = _solid_in(folder / job.step)
    if published is not None:
        refuse_self_crossing(solid, shape_of(solid), f"the solid in {job.step}")
    faces, programs = brep.faces_of(solid), []
    threaded = threaded_walls(faces, faces_with_threads(faces, job.threads, job.predicates)) if job.threads else ()
    for program in read:
        setup = program.setup
        wanted = tuple(brep.named_faces(faces, job.predicates, setup.faces))
        grooves, breaks = (tuple(e for e in told if e.setup == setup.name) for told in (job.engravings, job.edge_breaks))
        extra += engraving_findings(program.posted, setup, grooves, tools)
        table, found = edge_break_findings(program.posted, setup, breaks, faces, tools, job.finish.gouge_mm)
        broken, extra = [*broken, *table], [*extra, *found]
        rises = (*((e.operation, e.depth_mm) for e in grooves), *((e.operation, e.high_mm) for e in breaks))
        posted = raised(program.posted, rises) if rises else program.posted
        programs.append(SetupProgram(posted=posted, setup=setup, faces=wanted,
                                     fixtures=(*_fixtures(setup), *_bodies(program, job.machine)),
                                     left=(*(t for t in job.tabs if t.setup == setup.name),
                                           *drilled_points(posted, setup.frame, faces, tools, threaded))))
        extra += _program_findings(program, job.machine)
    tops = [job.stock.shape.box_in(p.setup.frame)[1][2] for p in programs]
    threads = thread_findings(programs, solid, job.threads, job.predicates, tools, tops)
    read = tuple(replace(p, findings=(*p.findings, *own)) for p, own in zip(read, threads))
    options = replace(options, mesh_checks=True, post_rounding_mm=_half_decimal_mm(job.machine.control))
    judging = Judging(tools=simulated(tools), stock=job.stock, finish=job.finish, machine=job.machine, options=options, say=say,
                      material=job.material, force=job.force or force_of(job.material), life=job.life or life_of(job.material),
                      hole_force=job.hole_force or hole_force_of(job.material), whole_tools=tools,
                      ball_radius_mm=job.smallest_ball_radius_mm, kept=kept)
    return Begun(folder=folder, job=job, solid=solid, read=read, programs=tuple(programs), extra=tuple(extra),
                 first=first_look(programs, solid, judging), tools=tools, broken=tuple(broken))


def _solid_in(path):
    """TopoDS_Solid of a STEP file: the same value as long as its bytes are the same, so that what it was looked at for stays known.

    Raises:
        InputError, DesignError: see `kernel.brep.read_step`, `the_solid`.
    """
    return _solid_of(path, sha256_of(path) if path.is_file() else "")      # where there is none, whoever reads it says so


@lru_cache(maxsize=1)
def _solid_of(path, digest):
    return brep.the_solid(brep.read_step(path), path.name)


@dataclass(frozen=True, eq=False, kw_only=True)
class Begun:
    """The files of a folder read, simulated and seen by the first verifier."""

    folder: Path                            # with the files
    job: object                             # Job
    solid: object                           # TopoDS_Solid out of the STEP file
    read: tuple[ReadProgram, ...]           # one a setup
    programs: tuple[SetupProgram, ...]      # one a setup
    extra: tuple[Finding, ...]              # about the programs as files
    first: FirstLook
    tools: dict                             # number -> Tool, as they are
    broken: tuple[dict, ...] = ()           # rows of edge_breaks.edge_break_findings

    def judged(self):
        """Judged: the verdict, once all verifiers have looked."""
        judging = self.first.judging
        options, setups = judging.options, self.first.verdicts()
        differ = [f"{v.setup}: {f.advice}" for v in setups for f in v.findings if f.kind == "verifiers_disagree"]
        if differ and options.solid_pitch_mm is None and "verifiers_disagree" not in self.job.accepted:
            judging.say(f"the two verifiers differ, both look closer ({differ[0]})")
            closer = replace(options, finer=CLOSER * options.finer)
            setups = verify_setups(self.programs, self.solid, replace(judging, options=closer))
        setups = tuple(replace(v, findings=self._placed(v.findings, p)) for v, p in zip(setups, self.read))
        sizes = measured(self.job.dimensions, self.first.part.piece, self.solid, self.job.predicates, options.post_rounding_mm)
        worn = self._worn({f.kind for v in setups for f in v.findings})
        tabs = standing_tabs(self.job.tabs, self.first.part.piece, [p.setup.name for p in self.programs])
        extra = (*self.extra, *tolerance_findings(sizes, self.read[-1].setup.name), *(worn.findings if worn else ()),
                 *tab_findings(tabs))
        return Judged(verdict=Verdict(setups=setups), solid=self.solid, programs=self.programs, tools=judging.tools,
                      extra=extra, stock=self.job.stock, read=self.read, dimensions=sizes, names=self._names,
                      worn=worn, tabs=tabs, edge_breaks=self.broken)

    def _worn(self, kinds):
        """WornLook where the control shifts contours, None where it shifts none; `kinds`: of finding that there are anyway."""
        worn = worn_tools(self.programs, self.tools, self.job.worn_mm)
        if not worn:
            return None
        again = lambda tools: [p.posted for p in read_programs(self.folder, self.job, self.tools | tools)]
        return worn_look(self.programs, again, worn, self.solid, self.first.judging, kinds)

    def drafted(self):
        """Drafted: what the first verifier and the replay show, nothing proven."""
        drafts = self.first.drafts()
        return Drafted(setups=drafts, findings=(
            *self.extra, *(f for d, p in zip(drafts, self.read) for f in self._placed(d.findings, p))))

    @property
    def _names(self):
        """{name: numbers of its faces in the solid} of all that setups cut."""
        faces, used = brep.faces_of(self.solid), {name for p in self.programs for name in p.setup.faces}
        return {p.name: tuple(brep.indices_of(faces, brep.select_faces(faces, p))) for p in self.job.predicates if p.name in used}

    def _placed(self, findings, program):
        """Of one program, those that the text alone shows before."""
        engraved = {e.operation.lower() for e in (*self.job.engravings, *self.job.edge_breaks) if e.setup == program.setup.name}
        mine = (*program.findings, *_cutting(findings, program.posted, self.tools, engraved))
        return _placed(mine, program, self.job.machine, self.tools)


@dataclass(frozen=True, eq=False, kw_only=True)
class Drafted:
    """A first look at programs."""

    setups: tuple                           # verdict.SetupDraft, one a setup
    findings: tuple[Finding, ...]

    def as_dict(self):
        """draft.json: the contract's numbers as far as samples tell them, and the findings."""
        numbers = [d.numbers for d in self.setups]
        return {"draft": True, "ok": not self.findings,
                **{k: max((n[k] for n in numbers), default=0.0) for k in DRAFTED_WORST},
                **{k: round(sum(n[k] for n in numbers), 6) for k in DRAFTED_SUMS},
                "findings": [f.as_dict() for f in self.findings],
                "setups": [{"setup": d.setup, **d.numbers} for d in self.setups]}


def _cutting(findings, posted, tools, engraved):
    """Findings without what is said of taps, thread mills and what is raised as if they cut so: verification.threads,
    verification.engraving and verification.edge_breaks look at them.   engraved: names of operations."""
    last = lambda row: np.flatnonzero(posted.operation == posted.operation[row])[-1]        # the first still has the tool before
    is_other = lambda f: ((number := int(posted.tool[last(f.row)])) in tools and tools[number].cutter.threads
                          or posted.operation_name(f.row) in engraved)
    return tuple(f for f in findings if f.kind not in OF_BODIES or f.row < 0 or not is_other(f))


def _file_findings(folder, job, tools, published):
    """Of what lies in the folder against what was published, and of the tool table."""
    changed = () if published is None else (*changed_files(folder, published), *changed_job(folder, job, published))
    return [*changed, *tool_table_findings(folder, tools, *tool_table_of(job.machine))]


def _program_findings(program, machine):
    """Of all files of a program."""
    if not program.is_first:
        return []
    return [finding for name, text in program.texts.items()
            for finding in program_findings(name, text, program.setup.name, machine)]


def _placed(findings, program, machine, tools):
    """Findings with the axes at their places and their lines as they stand in their files."""
    lines = [line for text in program.texts.values() for line in lines_of(text)]
    return _in_files(located(findings, program.posted, lines, _axes_at(program, machine, tools)), program.texts)


def _axes_at(program, machine, tools):
    """For `located`: the axes of a machine, turned as its rotaries stand on the line; before they were named, at 0."""
    posted, setup, chain = program.posted, program.setup, machine.kinematics
    if not machine.rotaries:
        offsets = {n: t.offset_mm for n, t in tools.items()}
        return axes_upright(posted, setup.frame, machine.zero_mm(setup.zero_height_mm), offsets)

    def at(row, place_mm):
        tip = setup.clamped_frame.into(place_mm[None]) + np.array(machine.zero_mm(setup.zero_height_mm))
        tool = tools.get(int(posted.tool[row])) if posted.length_offset_on[row] else None
        turned = np.radians(np.nan_to_num(posted.rotary_deg[row]))
        return chain.placed(tip, turned, 0.0 if tool is None else tool.length_mm)[0, :3]
    return at


def posted_moves(texts, setup, machine, tools):
    """PostedMoves of a program's texts, run one after the other, on a machine that knows tools and the setup's zero.

    Tools on heads are seen as they hang: their axis turned, their tip where it is while their middle is driven.
    """
    return joined_files([moves_of_file(text, setup, machine, tools) for text in texts], texts, tools)


def posted_positions(texts, setups, machine, tools):
    """[PostedMoves] of a clamping's program, one a position; `setups`: what holds the part, then indexed positions."""
    moves = posted_moves(texts, setups[0], machine, tools)
    if len(setups) == 1 and not setups[0].indexed:
        return [moves]
    return list(_by_position(moves, setups).moves)


def _by_position(moves, setups):
    """program.positions.Positions of a clamping's moves."""
    return by_position(moves, [s.frame for s in setups], setups[0].clamped_frame)


def moves_of_file(text, setup, machine, tools):
    """PostedMoves of one file, heads left out."""
    read = reader_of(machine)
    zero = machine.zero_mm(setup.zero_height_mm)
    return read(text, work_offsets={setup.wcs: zero}, tool_lengths={n: t.offset_mm for n, t in tools.items()},
                **radii_taken(read, tools), **coolants_taken(read, machine))


def _read(name, text, setup, job, tools):
    """The same, of a file that can be simulated; what is refused is named with the file."""
    try:
        moves = moves_of_file(text, setup, job.machine, tools)
        refuse_what_cannot_be_simulated(moves, tools, setup, job.machine, job.stock)
    except ReadError as error:
        raise ReadError(f"{name}: {error}", rows=error.rows) from None
    return moves


def joined_files(parts, texts, tools):
    """PostedMoves of files run one after the other, tools on heads as they hang."""
    moves = PostedMoves.joined(parts, [len(lines_of(text)) for text in texts])
    for number, tool in tools.items():
        if tool.head is not None:
            moves = moves.on_head(number, tool.head.axis, tool.driven_mm)
    return moves


def figures_in_words(numbers):
    """Gouge, cusp and the bound of both out of verify.json.

    >>> figures_in_words({"gouge_max_mm": 0.0022, "cusp_max_mm": 0.0096, "error_bound_mm": None})
    'gouge 0.0022, cusp 0.0096, error bound unknown'
    """
    bound = numbers["error_bound_mm"]
    return (f"gouge {numbers['gouge_max_mm']:.4f}, cusp {numbers['cusp_max_mm']:.4f}, error bound "
            + ("unknown" if bound is None else f"{bound:.5f} mm"))


def told_in_words(numbers):
    """The same, and what no cutter reaches."""
    return figures_in_words(numbers) + "".join(f", {told}" for told in left_in_words(numbers["unreachable"]))


def lines_of(text):
    """The lines of a program as the control counts them: each ends with a line feed, the last one perhaps not.

    >>> lines_of("G21\\nM2\\n"), lines_of("G21\\rG0 X1\\nM2")
    (['G21', 'M2'], ['G21\\rG0 X1', 'M2'])
    """
    lines = text.split("\n")
    return lines[:-1] if lines[-1] == "" else lines


def _in_files(findings, parts):
    """The same with the lines of a set counted in their own files, which the block's text then names."""
    if len(parts) == 1:
        return findings
    ends = np.cumsum([len(lines_of(text)) for text in parts.values()])
    placed = []
    for f in findings:
        k = int(np.searchsorted(ends, f.line))
        if 0 < f.line and k < len(ends):
            first = int(ends[k - 1]) if k else 0
            f = replace(f, line=f.line - first, call_line=max(f.call_line - first, 0),
                        block=f"{list(parts)[k]}: {f.block}")
        placed.append(f)
    return tuple(placed)


def _fixtures(setup):
    """The setup's fixtures in its WCS, as the replay takes them."""
    return tuple(_fixture(f) for f in placed_fixtures(setup, setup.frame))


def _bodies(program, machine):
    """What of the machine stands still beside the part: in an indexed position all that turns, else what turns with it."""
    turned = program.posted.rotary_deg[np.isfinite(program.posted.rotary_deg).all(axis=1)]
    if not turned.size:
        return ()
    found = bodies_at(machine, turned[-1], program.setup.frame, program.setup.clamped_frame)
    with_it = {b.name for b in machine.bodies if b.link == machine.chain[0]}
    return tuple(f for f in found if f.name in with_it) if np.ptp(turned, axis=0).any() else found


def _fixture(placed):
    if not placed.is_box:
        return SolidFixture(placed.name, *placed.mesh)
    low, high = placed.box_mm
    return Fixture(name=placed.name, min_mm=tuple(low.tolist()), max_mm=tuple(high.tolist()))


def _text(path):
    """The bytes of a program as text, nothing translated: line ends are the control's business."""
    refuse_irregular(path, "program")
    try:
        return path.read_bytes().decode("ascii")
    except FileNotFoundError:
        raise InputError(f"program {path} does not exist") from None
    except OSError as error:
        raise InputError(f"program {path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        line = path.read_bytes()[:error.start].count(b"\n") + 1
        raise InputError(f"program {path}, line {line}: a character that is not ASCII, which controls read in "
                         "different ways: write it in ASCII", rows=[line]) from None


def _half_decimal_mm(control):
    """Largest error of a rounded word."""
    if control.units == "mm":
        return 0.5 / 10 ** control.decimals_mm
    return 25.4 * 0.5 / 10 ** control.decimals_inch


def post_module(machine):
    """The post that a machine names."""
    return find_post(machine.control.post)
