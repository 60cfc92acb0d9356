"""`cuspline diff`: two folders of outputs compared: parameters, figures, tools, operations, findings, programs by their moves."""

from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from cuspline.app.documents import Figures
from cuspline.app.judge import joined_files, lines_of, moves_of_file
from cuspline.app.outputs import read_outputs
from cuspline.design.job import read_job, read_tools
from cuspline.program.move_changes import ProgramChanges, program_changes
from cuspline.program.posted import PostedMoves
from cuspline.values.errors import InputError, ReadError
from cuspline.values.input_files import json_of

SECTIONS = ("design", "parameters", "versions", "part", "verdict", "findings", "plan", "tools", "stock", "programs")
RUN_WITH = ("time_s", "length_mm", "blocks", "spindle_rpm", "feed_mm_per_min", "stepover_mm")      # of an operation
VOLUME_DIGITS = 4
WHERE = 2               # digits of a finding's place, that must agree for it to be the same finding
FIGURES = tuple(name for name, field in Figures.model_fields.items() if name not in ("collisions", "findings"))


@dataclass(frozen=True, kw_only=True)
class Change:
    """One thing that differs; None: it is not there."""

    section: str            # of SECTIONS
    what: str
    old: object
    new: object


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramComparison:
    """The programs of one setup."""

    setup: str
    old: PostedMoves
    new: PostedMoves
    changes: ProgramChanges
    old_files: tuple            # (file name, its first line among all) of a set
    new_files: tuple

    @property
    def is_same(self):
        return not self.changes.changes and not self.changes.refed


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison:
    """Two folders of outputs side by side."""

    old: Path
    new: Path
    changes: tuple[Change, ...]
    programs: tuple[ProgramComparison, ...]

    @property
    def is_same(self):
        return not self.changes and all(p.is_same for p in self.programs)

    def of(self, section):
        return [c for c in self.changes if c.section == section]


def compared(old, new):
    """Comparison of two folders.

    Raises:
        InputError: one of them is no folder of outputs.  ReadError: a program in it cannot be read.
    """
    old, new = Path(old), Path(new)
    a, b = read_outputs(old), read_outputs(new)
    programs, others = _programs(a, b)
    changes = [*_changes("design", {n: getattr(a.manifest, n) for n in ("design", "machine", "stage", "accepted")},
                         {n: getattr(b.manifest, n) for n in ("design", "machine", "stage", "accepted")}),
               *_changes("parameters", a.manifest.parameters, b.manifest.parameters),
               *_changes("versions", a.manifest.versions, b.manifest.versions),
               *_part(a, b), *_verdict(a, b), *_findings(a, b), *_operations(a, b),
               *_changes("tools", _tools(a), _tools(b)), *others]
    return Comparison(old=old, new=new, changes=tuple(changes), programs=tuple(programs))


def _changes(section, old, new):
    """Change of every key whose values differ."""
    return [Change(section=section, what=name, old=old.get(name), new=new.get(name)) for name in dict.fromkeys((*old, *new))
            if old.get(name) != new.get(name)]


def _part(a, b):
    """What differs of the part itself, and of solid.json where it was measured."""
    step = [outputs.manifest.files.get(outputs.step.name) for outputs in (a, b)]
    solids = _changes("part", _solid(a), _solid(b)) if step[0] != step[1] else []
    return [*solids, *_changes("part", _measured(a), _measured(b))]


def _solid(outputs):
    """{what: value} of the STEP file's solid."""
    from cuspline.kernel import brep
    solid = brep.the_solid(brep.read_step(outputs.step), outputs.step.name)
    low, high = brep.bounding_box_mm(solid)
    return {"volume mm³": round(brep.volume_mm3(solid), VOLUME_DIGITS), "faces": len(brep.faces_of(solid)),
            **{f"{axis} {end} mm": round(float(value), WHERE + 2) for end, corner in (("from", low), ("to", high))
               for axis, value in zip("XYZ", corner)}}


def _measured(outputs):
    """{what: figure} of solid.json."""
    path = outputs.folder / "solid.json"
    if not path.is_file():
        return {}
    document = json_of(path, "solid.json")
    facts = {key: value for key, value in document.items() if isinstance(value, (int, float, str))}
    return facts | {f["what"]: f["measured"] for f in document["figures"]}


def _verdict(a, b):
    """Figures and volumes of stock that differ; one Change where only one of the two has a verdict."""
    if a.verdict is None or b.verdict is None:
        word = lambda outputs: None if outputs.verdict is None else "VERIFIED" if outputs.verdict.ok else "REJECTED"
        return _changes("verdict", {"verdict": word(a)}, {"verdict": word(b)})
    return [*_changes("verdict", _figures(a), _figures(b)), *_changes("stock", _volumes(a), _volumes(b))]


def _figures(outputs):
    """{name: figure} in total, and of every setup where there are several."""
    parts = {"": outputs.verdict} | ({s.setup: s for s in outputs.verdict.setups} if len(outputs.verdict.setups) > 1 else {})
    return {f"{setup} {name}".strip(): getattr(figures, name) for setup, figures in parts.items() for name in FIGURES}


def _findings(a, b):
    """Findings of one that the other has not; alike are those of one kind at one place of one operation."""
    name = lambda f: (f.kind, f.setup, f.operation, f.place_mm and tuple(round(x, WHERE) for x in f.place_mm))
    counts = [Counter(map(name, outputs.findings)) for outputs in (a, b)]
    for outputs, missing, is_new in ((a, counts[0] - counts[1], False), (b, counts[1] - counts[0], True)):
        for f in outputs.findings:
            if missing[name(f)] > 0:
                missing[name(f)] -= 1
                words = f"{f.amount_mm:.4f} mm: {f.advice}"
                yield Change(section="findings", what=f"{f.kind}{f' in {f.operation}' if f.operation else ''} of {f.setup}",
                             old=None if is_new else words, new=words if is_new else None)


def _operations(a, b):
    """What differs between the plans; of an operation that one of them has not only that."""
    old, new = _plan(a), _plan(b)
    alone = tuple(f"{name} " for name in {*old} ^ {*new} if name.rpartition(" ")[2] not in RUN_WITH)
    return [c for c in _changes("plan", old, new) if not c.what.startswith(alone) or not alone]


def _plan(outputs):
    """{what: value}: times, operations with their tools, and what they run with."""
    if outputs.plan is None:
        return {}
    found = {"min_concave_radius_mm": outputs.plan.min_concave_radius_mm, "time_s": outputs.time_s}
    for setup in outputs.plan.setups:
        found[f"{setup.name} time_s"] = setup.time_s
        for name, o in _told_apart(setup.operations):
            found[f"{setup.name} {name}"] = f"T{o.tool.number} {o.tool.name}"
            found |= {f"{setup.name} {name} {key}": getattr(o, key) for key in RUN_WITH}
    return found


def _told_apart(operations):
    """(name, operation); the second of a name is called name (2)."""
    seen = Counter()
    for o in operations:
        seen[o.name] += 1
        yield (o.name if seen[o.name] == 1 else f"{o.name} ({seen[o.name]})"), o


def _tools(outputs):
    """{"T5 diameter_mm": value} of every tool that is used."""
    path = outputs.folder / "tools.json"
    rows = json_of(path, "tools")["tools"] if path.is_file() else ()
    return {f"T{row['number']} {key}": value for row in rows for key, value in _flat(row) if key != "number"}


def _flat(row, before=""):
    for key, value in row.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield before + key, value


def _volumes(outputs):
    """{operation: mm³ of stock after it}."""
    return {f"after {s.setup} {s.operation} mm³": s.volume_mm3 for s in outputs.stocks}


# programs --------------------------------------------------------------------------------------


def _programs(a, b):
    """(ProgramComparison of setups that both have, Change of programs that one has)."""
    changes = [c for c in _changes("programs", {s: " ".join(n) for s, n in a.programs.items()},
                                   {s: " ".join(n) for s, n in b.programs.items()}) if c.old is None or c.new is None]
    both = [setup for setup in a.programs if setup in b.programs]
    old, new = (_moves(outputs, both) for outputs in (a, b))
    return [_compared(setup, (a, old[setup]), (b, new[setup])) for setup in both], changes


def _compared(setup, old, new):
    """ProgramComparison of a setup's (Outputs, PostedMoves)."""
    files = [_files([(name, outputs.texts[name]) for name in outputs.programs[setup]]) for outputs, _ in (old, new)]
    return ProgramComparison(setup=setup, old=old[1], new=new[1], changes=program_changes(old[1], new[1]), old_files=files[0],
                             new_files=files[1])


def _moves(outputs, setups):
    """{setup: PostedMoves} by the reader of the machine that the programs were posted for."""
    if not setups:
        return {}
    job, tools = read_job(outputs.folder), read_tools(outputs.folder)
    if job.machine.control.post.endswith(".py"):
        raise InputError(f"{outputs.folder}: its programs were written by the post {job.machine.control.post}: a folder of outputs "
                         "does not choose which code is run, so these programs are not compared")
    read = {p.setup.name: partial(moves_of_file, setup=p.setup, machine=job.machine, tools=tools) for p in job.posted}
    return {name: _read(outputs, outputs.programs[name], read[name], tools) for name in setups}


def _read(outputs, names, read, tools):
    """PostedMoves of a set of files; `read`: of the text of one."""
    parts = []
    for name in names:
        try:
            parts.append(read(outputs.texts[name]))
        except ReadError as error:
            raise ReadError(f"{outputs.folder / name}: {error}", rows=error.rows) from None
    return joined_files(parts, [outputs.texts[name] for name in names], tools)


def _files(texts):
    """(name, lines before it) of the files (name, text) of a set."""
    before = np.cumsum([0, *(len(lines_of(text)) for _, text in texts)])
    return tuple((name, int(k)) for (name, _), k in zip(texts, before))
