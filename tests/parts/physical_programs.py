"""Two small posted programs that a shop would run, in both dialects, and their replay: what physical sabotages are put into."""

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from cuspline.app import catalogue
from cuspline.app.judge import posted_moves
from cuspline.design import Setup
from cuspline.design.job import read_job, read_tools
from cuspline.program.program import Kind, MoveWriter, Operation, Plane, Program
from cuspline.replay.replay import replay
from cuspline.replay.scene import Fixture, FoundStock, Surroundings
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.values.frames import Frame
from cuspline.verification.verdict import REPLAY_NODES

LOW_MM, HIGH_MM = (0.0, 0.0, 0.0), (60.0, 30.0, 20.0)
PITCH_MM = np.sqrt(HIGH_MM[0] * HIGH_MM[1] / REPLAY_NODES)       # as the verdict looks at this billet
CLEARANCE_MM = 5.0
HOME = Frame.shift((0.0, 0.0, 0.0))
MACHINES = {"linuxcnc": "mill_3axis", "fanuc": "mill_fanuc"}
SETUP = Setup(name="setup-1", faces=("top",), wcs_in_words="corner of the billet, Z0 on its base")

SLOT_SHARE = 0.3        # of the diameter: what the tools of these programs take


@dataclass(frozen=True, eq=False, kw_only=True)
class Base:
    """A posted program with all that it is judged against."""

    name: str
    dialect: str              # linuxcnc, fanuc
    text: str
    machine: object           # machines.Machine
    tools: dict               # {number: cutters.Tool}
    setup: object = SETUP     # design.Setup
    low_mm: tuple = LOW_MM    # billet, WCS
    high_mm: tuple = HIGH_MM
    clearance_mm: float = HIGH_MM[2] + CLEARANCE_MM

    @cached_property
    def moves(self):
        """PostedMoves of the text."""
        return posted_moves((self.text,), self.setup, self.machine, self.tools)

    @cached_property
    def lines(self):
        return self.text.splitlines()


def bases():
    """All four."""
    return [_posted(name, operations, dialect) for name, operations in (("terrace", _terrace()), ("trough", _trough()))
            for dialect in MACHINES]


def findings(base, text, pitch_mm=PITCH_MM, fixtures=()):
    """What the replay tells of a text in place of the base's own."""
    moves = posted_moves((text,), base.setup, base.machine, base.tools)
    billet = Workpiece(blank=BoxShape(min_mm=base.low_mm, max_mm=base.high_mm))
    before = lambda row: billet.after(HOME, swept_paths(moves.first(row), base.tools))
    stock = FoundStock(min_mm=base.low_mm, max_mm=base.high_mm, pitch_mm=pitch_mm,
                       within_before=lambda row: partial(before(row).highest_within_mm, HOME),
                       standing_before=lambda row: partial(before(row).standing_mm, HOME))
    around = Surroundings(machine=base.machine, fixtures=tuple(Fixture(**f) for f in fixtures), frame=HOME)
    return replay(moves, base.tools, stock, around=around).findings


def _posted(name, operations, dialect):
    machine = catalogue.find_machine(MACHINES[dialect])
    program = Program(name=name, setup="setup-1", wcs="G54", wcs_in_words=SETUP.wcs_in_words, operations=operations,
                      clearance_z_mm=HIGH_MM[2] + CLEARANCE_MM, header=(name.upper(),))
    (text,) = catalogue.find_post(dialect).post(program, machine).texts
    return Base(name=name, dialect=dialect, text=text, machine=machine, tools={o.tool.number: o.tool for o in operations})


def _tool(number):
    tool = catalogue.find_library(None).number(number)
    cutter = tool.cutter.model_copy(update={"slot_depth_mm": SLOT_SHARE * tool.cutter.diameter_mm})
    return tool.model_copy(update={"cutter": cutter})


def _lane(writer, points, feed):
    """In from above beside the billet, along the points, and up."""
    first = np.array(points[0], float)
    top = HIGH_MM[2] + CLEARANCE_MM
    writer.rapid((*first[:2], top))
    writer.rapid((*first[:2], HIGH_MM[2] + 1.0))
    writer.feed(first, feed / 3)
    for point in points[1:]:
        writer.feed(point, feed)
    writer.rapid((*writer.here_mm[:2], top))


def _operation(name, number, writer, rpm):
    return Operation(name=name, tool=_tool(number), spindle_rpm=rpm, coolant="flood", moves=writer.moves())


def _terrace():
    """A flat cutter clears a terrace in levels, a ball goes over it."""
    rough = MoveWriter((-12.0, -2.0, HIGH_MM[2] + CLEARANCE_MM))
    for z in (18.6, 17.2, 15.8):
        for y in (-2.0, 2.5, 7.0, 11.5):
            _lane(rough, [(-12.0, y, z), (72.0, y, z)], 1500)
    finish = MoveWriter((-6.0, 0.0, HIGH_MM[2] + CLEARANCE_MM))
    for y in np.arange(0.0, 12.1, 1.2):
        _lane(finish, [(-6.0, y, 15.5), (66.0, y, 15.5)], 1200)
    return _operation("rough", 3, rough, 8000.0), _operation("finish", 9, finish, 12000.0)


def _trough():
    """A bull nose clears a trough from both ends of the billet, a ball runs arcs along it."""
    rough = MoveWriter((-12.0, 13.0, HIGH_MM[2] + CLEARANCE_MM))
    for z in (18.8, 17.6, 16.4):
        for y in (13.0, 17.0):
            _lane(rough, [(-12.0, y, z), (72.0, y, z)], 1400)
    finish = MoveWriter((-6.0, 11.0, HIGH_MM[2] + CLEARANCE_MM))
    for y in np.arange(11.0, 19.1, 1.0):
        finish.rapid((-6.0, y, HIGH_MM[2] + CLEARANCE_MM))
        finish.rapid((-6.0, y, HIGH_MM[2] + 1.0))
        finish.feed((-6.0, y, 16.3), 400)
        finish.feed((20.0, y, 16.3), 1200)
        finish.arc((40.0, y, 16.3), (30.0, y, 16.3 + 40.0), Plane.ZX, True, 1200)
        finish.feed((66.0, y, 16.3), 1200)
        finish.rapid((66.0, y, HIGH_MM[2] + CLEARANCE_MM))
    return _operation("rough", 4, rough, 8000.0), _operation("finish", 9, finish, 12000.0)


def base_of(folder, setup=0):
    """The posted program of one setup of a built design as a Base; only for setups whose WCS is the part's own frame."""
    job, tools = read_job(folder), read_tools(folder)
    item = job.posted[setup]
    moves = posted_moves(tuple((Path(folder) / name).read_text() for name in item.files), item.setup, job.machine, tools)
    low, high = item.setup.frame.box_into(job.stock.min_mm, job.stock.max_mm)
    rapids = moves.end_mm[(moves.kind == Kind.RAPID) & np.isfinite(moves.end_mm).all(axis=1)]
    levels, counts = np.unique(rapids[:, 2].round(6), return_counts=True)
    above = levels > high[2]
    return Base(name=job.design, dialect=job.machine.control.post, text=(Path(folder) / item.program).read_text(),
                machine=job.machine, tools=tools, setup=item.setup, low_mm=tuple(low.tolist()), high_mm=tuple(high.tolist()),
                clearance_mm=float(levels[above][counts[above].argmax()]))
