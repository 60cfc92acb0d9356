"""Judging posted files on disk against the STEP: read, simulate, compare.

The only way to a verdict, for `build` and `verify` alike: nothing comes from the internal path.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cuspline import brep
from cuspline.catalogue import find_post, reader_of
from cuspline.errors import InputError
from cuspline.job import read_tools
from cuspline.posted import PostedMoves
from cuspline.simulation.replay import Fixture
from cuspline.verification.findings import Finding, located
from cuspline.verification.in_process import stock_states
from cuspline.verification.kept import NOTHING
from cuspline.verification.verdict import Options, SetupProgram, Verdict, verify_setups


@dataclass(frozen=True, eq=False, kw_only=True)
class Judged:
    """A verdict with what it was reached on."""

    verdict: Verdict
    solid: object                           # TopoDS_Solid out of the STEP file
    programs: tuple[SetupProgram, ...]      # one a setup
    tools: dict                             # number -> Tool
    extra: tuple[Finding, ...]              # about the programs as files

    @property
    def posted(self):
        """One PostedMoves a setup."""
        return tuple(p.posted for p in self.programs)

    def stock_states(self, job, kept=NOTHING):
        """The stock after every operation, one after the other: in_process.StockState."""
        return stock_states(self.programs, self.tools, job.stock, [s.solids.pitch_mm for s in self.verdict.setups],
                            kept)

    @property
    def findings(self):
        return self.extra + self.verdict.findings

    def refused(self, accepted):
        """Findings that are not accepted by their kind."""
        return tuple(f for f in self.findings if f.kind not in accepted)

    def as_dict(self, accepted):
        """verify.json."""
        numbers = self.verdict.as_dict()
        return {**numbers, "ok": not self.refused(accepted), "accepted": sorted(accepted),
                "findings": [f.as_dict() for f in self.findings]}


def judge(folder, job, say=lambda text: None, options=Options(), kept=NOTHING):
    """Verdict on the files of a folder.

    Args:
        folder: with the STEP file, the programs and tools.json.
        job: Job.
        say: called with what is being done.
        options: how finely to look; the post's rounding is put in here.
        kept: kept.Kept of a run before that was interrupted.
    Raises:
        InputError: a file is missing.  ReadError: a program that no machine of this kind would take.
    """
    folder = Path(folder)
    tools = read_tools(folder)
    solid = brep.the_solid(brep.read_step(folder / job.step), job.step)
    faces = brep.faces_of(solid)
    programs, extra, texts = [], [], []
    offsets = {n: t.offset_mm for n, t in tools.items()}
    for item in job.posted:
        say(f"{item.setup.name}: read {', '.join(item.files)}")
        parts = {name: _text(folder / name) for name in item.files}
        moves = posted_moves(tuple(parts.values()), item.setup, job.machine, tools)
        texts.append(parts)
        wanted = tuple(f for p in job.predicates if p.name in item.setup.faces for f in brep.select_faces(faces, p))
        programs.append(SetupProgram(posted=moves, setup=item.setup, faces=wanted, fixtures=_fixtures(item.setup)))
        extra += [f for name, text in parts.items() for f in _file_findings(item, name, text, job.machine)]
    options = replace(options, mesh_checks=True, post_rounding_mm=_half_decimal_mm(job.machine.control))
    setups = verify_setups(programs, tools, solid, stock=job.stock, finish=job.finish, machine=job.machine,
                           ball_radius_mm=job.smallest_ball_radius_mm, options=options, say=say,
                           kept=kept)
    zero = job.machine.wcs_origin_mm
    place = lambda v, p, parts: _in_files(
        located(v.findings, p.posted, "".join(parts.values()), p.setup.frame, zero, offsets), parts)
    setups = tuple(replace(v, findings=place(v, p, parts)) for v, p, parts in zip(setups, programs, texts))
    return Judged(verdict=Verdict(setups=setups), solid=solid, programs=tuple(programs), tools=tools,
                  extra=tuple(extra))


def posted_moves(texts, setup, machine, tools):
    """PostedMoves of a program's texts, run one after the other, on a machine that knows tools and the setup's zero.

    Tools on heads are seen as they hang: their axis turned, their tip where it is while their middle is driven.
    """
    read = reader_of(machine)
    parts = [read(text, work_offsets={setup.wcs: machine.wcs_origin_mm},
                  tool_lengths={n: t.offset_mm for n, t in tools.items()}) for text in texts]
    moves = PostedMoves.joined(parts, [text.count("\n") for text in texts])
    for number, tool in tools.items():
        if tool.head is not None:
            moves = moves.on_head(number, tool.head.axis, tool.driven_mm)
    return moves


def _in_files(findings, parts):
    """The same with the lines of a set counted in their own files, which the block's text then names."""
    if len(parts) == 1:
        return findings
    ends = np.cumsum([text.count("\n") for text in parts.values()])
    placed = []
    for f in findings:
        k = int(np.searchsorted(ends, f.line))
        if 0 < f.line and k < len(ends):
            first = int(ends[k - 1]) if k else 0
            f = replace(f, line=f.line - first, block=f"{list(parts)[k]}: {f.block}")
        placed.append(f)
    return tuple(placed)


def _fixtures(setup):
    """The setup's fixtures in its WCS."""
    corners = [(f.name, setup.frame.box_into(f.min_mm, f.max_mm)) for f in setup.fixtures]
    return tuple(Fixture(name=name, min_mm=tuple(c[0].tolist()), max_mm=tuple(c[1].tolist())) for name, c in corners)


def _text(path):
    try:
        return path.read_text(encoding="ascii")
    except FileNotFoundError:
        raise InputError(f"program {path} does not exist") from None
    except UnicodeDecodeError:
        raise InputError(f"program {path} holds characters that are not ASCII") from None


def _half_decimal_mm(control):
    """Largest error of a rounded word."""
    if control.units == "mm":
        return 0.5 / 10 ** control.decimals_mm
    return 25.4 * 0.5 / 10 ** control.decimals_inch


def _file_findings(item, name, text, machine):
    """A program larger than the control's store."""
    size, room = len(text.encode()), machine.control.program_store_bytes
    if size > room:
        yield Finding(kind="program_too_long", amount_mm=0.0, place_mm=None, operation="", line=0,
                      setup=item.setup.name, advice=f"{name} has {size} bytes, the store of {machine.name} "
                      f"holds {room}: raise the scallop height, or feed it through the control's buffer")


def post_module(machine):
    """The post that a machine names."""
    return find_post(machine.control.post)
