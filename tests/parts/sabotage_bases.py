"""Small programs in every dialect, each as a folder that `cuspline verify` takes, to be spoilt on purpose.

A plate with a boss, cut in LinuxCNC's and Fanuc's words, in mm and inch, move by move and by sub-programs; the same
plate faced from below in a second clamping; arches of templated passes, as one file and as a set.  The arches have no
solid: only what their text shows is asked.
"""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import known_passes
import numpy as np
from written_parts import BALL, MILL, boss, boss_operations, operation, program_text, write_tools

from cuspline.app import catalogue
from cuspline.app.judge import judge, judge_text, lines_of, posted_moves
from cuspline.design import FacePredicate, Setup, StockBox
from cuspline.design.job import Job, PostedFile, Published, digest_of, job_line, read_job, read_published, read_tools
from cuspline.kernel import brep
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.pass_templates import Call, Go, PassTemplate, Quantity, Register, Restart, TemplatedPasses, terms
from cuspline.program.program import Kind, MoveWriter, Operation, Program
from cuspline.shop.cutters import Tool
from cuspline.verification.verdict import Options

COARSE = Options(spacing_mm=3.0, solid_pitch_mm=3.0, replay_pitch_mm=1.0, tessellation_mm=0.02)
CLEAR_MM, NEAR_MM, FAR_MM = 30.0, -4.0, 64.0
STEP_MM = 0.4
LONGER = BALL.model_copy(update={"stick_out_mm": 50.0})     # no two tools are equally long
ROUND_THE_BOSS = ("X38", "Y23", "X24", "Y9")
ROUND_ITS_CORNERS = ("X38", "Y20", "G3 X35 Y23 I-3 J0", "G1 X27", "G3 X24 Y20 I0 J-3", "G1 Y9")
STORE_BYTES = 1800          # of the control that takes the arches as a set


@dataclass(frozen=True, eq=False, kw_only=True)
class Base:
    """One job that is well."""

    name: str
    folder: Path
    has_solid: bool

    @cached_property
    def job(self):
        return read_job(self.folder)

    @cached_property
    def tools(self):
        return read_tools(self.folder)

    @cached_property
    def published(self):
        """What a manifest would say of the files and the job."""
        job = read_published(self.folder).job
        return Published(files={p.name: hashlib.sha256(p.read_bytes()).hexdigest()
                                for p in sorted(self.folder.iterdir()) if p.name != "manifest.json"},
                         job=job, job_fields={name: digest_of(value) for name, value in job.items()})

    @cached_property
    def programs(self):
        """Sheet of every file."""
        return tuple(Sheet(base=self, name=name, setup=item.setup) for item in self.job.posted for name in item.files)

    def judged(self, folder, is_text_only):
        """Findings of a spoilt copy."""
        job, published = read_job(folder), replace(self.published, job=read_published(folder).job)
        if is_text_only:
            return judge_text(folder, job, published=published)
        return judge(folder, job, options=COARSE, published=published).findings


@dataclass(frozen=True, eq=False, kw_only=True)
class Sheet:
    """One file of a base, as lines and as moves."""

    base: Base
    name: str
    setup: Setup

    @cached_property
    def text(self):
        return (self.base.folder / self.name).read_text()

    @cached_property
    def lines(self):
        return lines_of(self.text)

    def line(self, number):
        """A line by its number, from 1."""
        return self.lines[number - 1]

    @cached_property
    def moves(self):
        return posted_moves((self.text,), self.setup, self.base.job.machine, self.base.tools)

    @property
    def machine(self):
        return self.base.job.machine

    @property
    def is_fanuc(self):
        return self.machine.control.post == "fanuc"

    @property
    def unit_mm(self):
        return 1.0 if self.machine.control.units == "mm" else 25.4

    def length(self, mm, decimals=6):
        """A length as this control reads it."""
        text = f"{mm / self.unit_mm:.{decimals}f}".rstrip("0")
        return text if self.is_fanuc else text.rstrip(".")

    def with_line(self, number, *new):
        """The text with one line replaced."""
        return self.with_lines({number: new})

    def with_lines(self, changes):
        """The text with lines replaced, {number from 1: lines}."""
        lines = [line for k, old in enumerate(self.lines, 1) for line in changes.get(k, (old,))]
        return "\n".join(lines) + "\n"


def bases(folder):
    """All bases, made in a folder."""
    folder = Path(folder)
    made = [_boss(folder / "boss-mm", "mill_3axis"), _boss(folder / "boss-inch", "mill_3axis_inch"),
            _boss(folder / "boss-calls", "mill_3axis", has_calls=True),
            _boss(folder / "boss-inch-calls", "mill_3axis_inch", has_calls=True),
            _boss(folder / "boss-fanuc", "mill_fanuc"), _boss(folder / "boss-macro", "mill_fanuc", has_calls=True),
            _boss(folder / "boss-two-clampings", "mill_3axis", has_second=True),
            *(_arches(folder / f"arches-{post}-{units}", known_passes.machine(post, units, line_length=length))
              for post, length in (("linuxcnc", 252), ("fanuc", 128)) for units in ("mm", "inch")),
            _arches(folder / "arches-tape-set", catalogue.find_machine("mill_paper_tape"), store_bytes=STORE_BYTES)]
    return {base.name: base for base in made}


def _write(folder, job, texts, tools, solid=None):
    folder.mkdir(parents=True)
    document = job.model_dump(mode="json")
    for name, text in texts.items():
        head, comments = text[:text.index("(")], text[text.index("("):]
        (folder / name).write_text(f"{head}({job_line(digest_of(document))})\n{comments}")
    if solid is not None:
        brep.write_step(solid, folder / job.step, job.design)
    write_tools(folder, [t.model_dump(mode="json") for t in tools], job.machine.control)
    (folder / "manifest.json").write_text(json.dumps({"job": document}))
    return Base(name=folder.name, folder=folder, has_solid=solid is not None)


# the boss -----------------------------------------------------------------------------------------------


def rounded_boss_text():
    """The boss by hand, with true arcs round two of its corners."""
    clear, strip = boss_operations()
    first = next(k for k in range(len(clear)) if tuple(clear[k:k + len(ROUND_THE_BOSS)]) == ROUND_THE_BOSS)
    clear = [*clear[:first], *ROUND_ITS_CORNERS, *clear[first + len(ROUND_THE_BOSS):]]
    return program_text(clear, strip)


def _boss(folder, machine_name, has_calls=False, has_second=False):
    design, machine = boss(), catalogue.find_machine(machine_name)
    text = rounded_boss_text()
    posted = (PostedFile(setup=design.setups[0], program="setup-1.ngc"),)
    texts, predicates, stock = {"setup-1.ngc": text}, design.predicates, design.stock
    if has_second:
        setup = Setup(name="setup-2", wcs="G55", wcs_in_words="corner, turned over", faces=("base",),
                      wcs_origin_mm=(0, 24, 0), wcs_z=(0, 0, -1))
        predicates += (FacePredicate(name="base", count=1, center_min_mm=(0, 0, -0.1), center_max_mm=(60, 24, 0.1)),)
        stock = StockBox(min_mm=(0, 0, -1), max_mm=stock.max_mm)
        posted += (PostedFile(setup=setup, program="setup-2.ngc"),)
        texts["setup-2.ngc"] = _facing_text()
    if machine_name != "mill_3axis" or has_calls:
        program = _program(text, design.setups[0], has_calls)
        texts = {"setup-1.ngc": catalogue.find_post(machine.control.post).post(program, machine).text}
    job = Job(design="boss", step="boss.step", material=design.material, predicates=predicates, stock=stock,
              finish=design.finish, machine=machine, posted=posted, smallest_ball_radius_mm=3.0)
    return _write(folder, job, texts, (MILL, LONGER), design.solid)


def _facing_text():
    """Passes over the plate's underside, one millimetre of stock on it."""
    blocks = ["G0 X-4 Y-1", "G0 Z3", "G1 Z0 F900"]
    for k, y in enumerate(range(-1, 26, 5)):
        blocks += [f"Y{y}", f"X{(64, -4)[k % 2]}"]
    return program_text(operation(1, "FACE", 1, blocks)).replace("G54", "G55")


def _program(text, setup, has_calls):
    """The hand-written program as a Program."""
    moves = read_program(text, work_offsets={}, tool_lengths={t.number: t.length_mm for t in (MILL, LONGER)})
    operations = [Operation(name=name, tool=tool, spindle_rpm=8000.0, coolant="off", moves=_moves(moves, k))
                  for k, (name, tool) in enumerate(zip(moves.operations, (MILL, LONGER)))]
    if has_calls:
        passes = strips()
        operations[1] = Operation(name="finish", tool=LONGER, spindle_rpm=8000.0, coolant="off", moves=passes.moves(),
                                  passes=passes)
    return Program(name="boss", setup=setup.name, wcs=setup.wcs, wcs_in_words="corner", clearance_z_mm=CLEAR_MM,
                   header=("BOSS",), operations=tuple(operations))


def _moves(read, number):
    """Moves of one operation of a text, from above its first place on."""
    rows = np.flatnonzero((read.operation == number) & np.isfinite(read.start_mm).all(axis=1))
    writer = MoveWriter((*read.start_mm[rows[0], :2], CLEAR_MM))
    for row in rows:
        if read.kind[row] == Kind.RAPID:
            writer.rapid(read.end_mm[row])
        elif read.kind[row] == Kind.FEED:
            writer.feed(read.end_mm[row], read.feed_mm_per_min[row])
        else:
            writer.arc(read.end_mm[row], read.center_mm[row], int(read.plane[row]), read.kind[row] == Kind.ARC_CW,
                       read.feed_mm_per_min[row])
    if writer.here_mm[2] < CLEAR_MM:
        writer.rapid((*writer.here_mm[:2], CLEAR_MM))
    return writer.moves()


def strips():
    """The boss's finishing as calls: there at one y, back at the next."""
    there, back, near, far, floor, clear, feed = terms("there back near far floor clear feed")
    body = (Go(Kind.RAPID, z=clear), Go(Kind.RAPID, x=near, y=there), Go(Kind.FEED, z=floor, feed=feed),
            Go(Kind.FEED, x=far, feed=feed),
            Go(Kind.FEED, y=back, feed=feed), Go(Kind.FEED, x=near, feed=feed), Go(Kind.RAPID, z=clear))
    template = PassTemplate(name="strip", arguments=(Quantity("there", axis=1), Quantity("back", axis=1)), body=body)
    registers = (Register(Quantity("near", axis=0), NEAR_MM), Register(Quantity("far", axis=0), FAR_MM),
                 Register(Quantity("floor", axis=2), 6.0), Register(Quantity("clear", axis=2), CLEAR_MM),
                 Register(Quantity("feed", "mm/min"), 900.0))
    ys = np.round(np.arange(-0.3, 6.4, STEP_MM), 3).tolist()
    calls = tuple(Call("strip", pair) for pair in zip(ys[::2], [*ys[1::2], ys[-1]]))
    return TemplatedPasses(start_mm=(NEAR_MM, ys[0], CLEAR_MM), registers=registers, templates=(template,),
                           items=(Restart(1, ()), *calls))


# arches -------------------------------------------------------------------------------------------------


def _arches(folder, machine, store_bytes=None):
    if store_bytes is not None:
        machine = machine.model_copy(update={"control": machine.control.model_copy(
            update={"program_store_bytes": store_bytes})})
    program = known_passes.program()
    post = catalogue.find_post(machine.control.post)
    texts = post.post(program, machine).texts
    names = [f"setup-2-{k:02d}.{post.EXTENSION}" for k in range(1, len(texts) + 1)]
    setup = Setup(name="setup-2", wcs="G55", wcs_in_words="corner", faces=("arches",))
    job = Job(design="arches", step="arches.step", material="aluminium_6061", finish=boss().finish, machine=machine,
              predicates=(FacePredicate(name="arches", count=1, kinds=("plane",)),),
              stock=StockBox(min_mm=(-5, -30, 0), max_mm=(20, 30, 20)), smallest_ball_radius_mm=3.0,
              posted=(PostedFile(setup=setup, program=names[0], continued=tuple(names[1:])),))
    tools = [_as_long(t, known_passes.LENGTHS[t.number]) for t in (known_passes.OTHER, known_passes.BALL)]
    return _write(folder, job, dict(zip(names, texts)), tools)


def _as_long(tool, length_mm):
    """The tool with a holder that makes it so long."""
    segment = tool.holder.segments[0]
    holder = tool.holder.model_copy(update={"segments": (segment.model_copy(
        update={"height_mm": length_mm - tool.stick_out_mm}),)})
    return Tool.model_validate(tool.model_copy(update={"holder": holder}).model_dump())
