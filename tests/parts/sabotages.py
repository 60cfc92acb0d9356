"""The registry of sabotages and harmless edits, and how one of them is judged.

To add a kind of sabotage, write a function beside its like and put `@sabotage(...)` over it:

    @sabotage(needs_solid=True)
    def rapid_through_the_stock(sheet, rng):
        ...
        return Spoilt(text, Expected(kind="rapid_through_stock", lines=(41, 41), amount=2.0, within=0.05))

It gets a Sheet (one file of a base, as lines and as moves) and a random generator, and returns a Spoilt, or None where
the sheet has nothing that could be spoilt so.  A harmless edit is the same with `@harmless`; it returns the text.
Modules that hold such functions are named in MODULES.
"""

import importlib
import json
import re
import shutil
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cuspline.app.judge import posted_moves
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind
from cuspline.values.errors import InputError, ReadError

REFUSED = "refused"
MODULES = ("sabotages_of_text", "sabotages_of_files", "sabotages_of_geometry", "harmless_edits")
ALWAYS_SAID = "changed_file"        # of every edited file
AGREED = ("same moves", "both refuse", "only the reader refuses")
METRE_MM = 1000.0
SABOTAGES, HARMLESS = {}, {}


@dataclass(frozen=True, kw_only=True)
class Expected:
    """What must be said of a sabotage."""

    kind: str                                   # of finding, or REFUSED
    lines: tuple[int, int] | None = None        # first and last that may be named; None: it belongs to no line
    calls: tuple[int, int] | None = None        # lines of the call that may be named beside it
    amount: float | None = None                 # None: there is no size that means anything
    within: float = 1e-6                        # of the amount
    words: str = ""                             # that the advice must hold


def refused_at(line, words=""):
    """Expected where a line is to be refused."""
    return Expected(kind=REFUSED, lines=(line, line), words=words)


@dataclass(frozen=True, eq=False, kw_only=True)
class Spoilt:
    """A file with its fault."""

    content: str | bytes | None                 # of the sheet's file, or of `name`; None: it is gone
    expected: Expected
    name: str = ""                              # another file than the sheet's
    more: dict = field(default_factory=dict)    # other files that go with it: name -> content

    def files(self, sheet):
        """{name: content} of all that is changed."""
        return {self.name or sheet.name: self.content, **self.more}


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """One sabotage of one sheet, or one harmless edit: then nothing is expected."""

    what: str
    sheet: object
    files: dict
    expected: Expected | None
    needs_solid: bool

    def __str__(self):
        return f"{self.what} in {self.sheet.base.name}/{self.sheet.name}"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a case went."""

    is_found: bool          # something was said
    is_kind: bool
    is_line: bool
    is_amount: bool
    told: str               # what was said

    @property
    def is_right(self):
        return self.is_found and self.is_kind and self.is_line and self.is_amount


def sabotage(*, needs_solid=False, times=1):
    """Register a sabotage; `times`: how many different ones of it are wanted in each sheet."""
    return lambda spoil: SABOTAGES.setdefault(spoil.__name__, (spoil, needs_solid, times))[0]


def harmless(edit):
    """Register a harmless edit."""
    return HARMLESS.setdefault(edit.__name__, edit)


def cases(bases, seed=0):
    """All sabotages of all sheets; the same for the same seed."""
    _load()
    for what, (spoil, needs_solid, times) in SABOTAGES.items():
        for sheet in _sheets(bases):
            if needs_solid and not sheet.base.has_solid:
                continue
            for k in range(times):
                spoilt = spoil(sheet, _random(seed, what, sheet, k))
                if spoilt is not None and spoilt.expected is not None:
                    yield Case(what=what, sheet=sheet, files=spoilt.files(sheet), expected=spoilt.expected,
                               needs_solid=needs_solid)


def harmless_cases(bases, seed=0):
    """All harmless edits of all sheets."""
    _load()
    for what, edit in HARMLESS.items():
        for sheet in _sheets(bases):
            edited = edit(sheet, _random(seed, what, sheet, 0))
            if edited is not None and edited != sheet.text:
                files = edited if isinstance(edited, dict) else {sheet.name: edited}
                yield Case(what=what, sheet=sheet, files=files, expected=None, needs_solid=False)


def _load():
    for name in MODULES:
        importlib.import_module(name)


def _sheets(bases):
    return [sheet for base in bases.values() for sheet in base.programs]


def _random(seed, what, sheet, k):
    return np.random.default_rng([seed, zlib.crc32(f"{what} {sheet.base.name} {sheet.name}".encode()), k])


def outcome(case, folder):
    """Judge a case in a folder of its own."""
    folder = Path(folder)
    shutil.copytree(case.sheet.base.folder, folder)
    for name, content in case.files.items():
        _put(folder / name, content)
    try:
        found = case.sheet.base.judged(folder, not case.needs_solid)
    except (ReadError, InputError) as error:
        return _refused(case.expected, error)
    if case.expected is None or case.expected.kind != ALWAYS_SAID:
        found = [f for f in found if f.kind != ALWAYS_SAID]
    told = "; ".join(f"{f.kind} {f.size_in_words} line {f.line} call {f.call_line}: {f.advice}" for f in found)
    if case.expected is None:
        told += "" if _cuts_the_same(case, folder) else " it cuts along another path"
        return Outcome(is_found=bool(told), is_kind=not found, is_line=True, is_amount=True, told=told)
    return _compared(case.expected, found, told)


def _cuts_the_same(case, folder):
    """The cutting moves of a harmless edit are those of the sheet, to the digits of an inch."""
    sheet = case.sheet
    text = (folder / sheet.name).read_bytes().decode("ascii")
    ends = [m.end_mm[m.kind != Kind.RAPID] for m in (
        sheet.moves, posted_moves((text,), sheet.setup, sheet.machine, sheet.base.tools))]
    return ends[0].shape == ends[1].shape and np.abs(ends[0] - ends[1]).max(initial=0.0) < 1e-9


def _put(path, content):
    if content is None:
        path.unlink()
    elif isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_bytes(content.encode("ascii"))


def changed_manifest(sheet, change):
    """The base's manifest with its job changed: change(job dict)."""
    manifest = json.loads((sheet.base.folder / "manifest.json").read_text())
    change(manifest["job"])
    return json.dumps(manifest)


def _refused(expected, error):
    is_kind = expected is not None and expected.kind == REFUSED
    lines = expected.lines if is_kind else None
    is_line = lines is None or (len(error.rows) == 1 and lines[0] <= int(error.rows[0]) <= lines[1])
    calls = expected.calls if is_kind else None
    is_line &= calls is None or (re.findall(r"called in line (\d+)", str(error)) or ["0"])[0] in map(
        str, range(calls[0], calls[1] + 1))
    is_amount = not is_kind or expected.words in str(error)
    return Outcome(is_found=True, is_kind=is_kind, is_line=is_line, is_amount=is_amount, told=f"refused: {error}")


def _compared(expected, found, told):
    """The finding of the kind that fits best."""
    mine = [f for f in found if f.kind == expected.kind]
    lined = [f for f in mine if (expected.lines is None or expected.lines[0] <= f.line <= expected.lines[1])
             and (expected.calls is None or expected.calls[0] <= f.call_line <= expected.calls[1])]
    size = lambda f: f.amount_mm if f.amount is None else f.amount
    sized = [f for f in lined if (expected.amount is None or abs(size(f) - expected.amount) <= expected.within)
             and expected.words in f.advice]
    return Outcome(is_found=bool(found), is_kind=bool(mine), is_line=bool(lined), is_amount=bool(sized), told=told)


def is_linuxcnc_text(case):
    """What the case changes is a program of LinuxCNC's."""
    return not case.sheet.is_fanuc and isinstance(case.files.get(case.sheet.name), (str, bytes))


def authority(case, folder, comparison):
    """How LinuxCNC's interpreter and the reader see a LinuxCNC text of a case.

    Args:
        comparison: the module tests.authorities.linuxcnc.comparison.
    Returns:
        one of AGREED, or in words how they differ.
    """
    sheet, content = case.sheet, case.files.get(case.sheet.name)
    data = content if isinstance(content, bytes) else content.encode("ascii")
    path = Path(folder) / "program.ngc"
    path.write_bytes(data)
    offsets = {sheet.setup.wcs: sheet.machine.wcs_origin_mm}
    lengths = {n: t.offset_mm for n, t in sheet.base.tools.items()}
    truth = comparison.interpret(path, tool_lengths=lengths, work_offsets=offsets)
    try:
        moves = read_program(data.decode("ascii"), work_offsets=offsets, tool_lengths=lengths)
    except (ReadError, UnicodeDecodeError):
        return "both refuse" if truth.error else "only the reader refuses"
    if truth.error:
        return f"only LinuxCNC refuses: {truth.error}"
    if len(moves) != len(truth.kind):
        return f"{len(moves)} moves, LinuxCNC makes {len(truth.kind)}"
    # twelve digits are left of a metre
    digits = 1.0 + np.abs(np.nan_to_num(truth.machine_end_mm)).max(initial=0.0) / METRE_MM
    far = [name for name, difference, allowed in comparison.differences(moves, truth)
           if (difference > allowed * digits).any()]
    return f"{', '.join(far)} differ" if far else "same moves"
