"""A foreign tool library made into ours, with a report of every tool: what was dropped, assumed, skipped."""

from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError

from cuspline.shop.cutters import Cutter, Holder, Tool, ToolLibrary
from cuspline.shop.tool_exchange.freecad import freecad_tools
from cuspline.shop.tool_exchange.fusion import fusion_holders, fusion_tools
from cuspline.values.amounts import counted
from cuspline.values.errors import InputError
from cuspline.values.input_files import refuse_irregular
from cuspline.values.models import complaints

OVERALL_MM, SHANK_MM, HOLDER_MM = (20.0, 600.0), (1.5, 130.0), (3.0, 300.0)   # what stands in mill spindles
READERS = {".json": fusion_tools, ".tools": fusion_tools, ".fctb": freecad_tools, ".fctl": freecad_tools}


@dataclass(frozen=True, kw_only=True)
class ImportedTool:
    """What became of one tool of the foreign file."""

    number: int | None
    name: str
    foreign_type: str
    unit: str
    tool: Tool | None                   # None: skipped
    dropped: tuple[str, ...]
    assumed: tuple[str, ...]
    skipped_because: str

    def as_dict(self):
        return {"number": self.number, "name": self.name, "foreign_type": self.foreign_type, "unit": self.unit,
                "imported_as": None if self.tool is None else self.tool.cutter.type, "dropped": list(self.dropped),
                "assumed": list(self.assumed), "skipped_because": self.skipped_because}


@dataclass(frozen=True, kw_only=True)
class Import:
    """A foreign library, read."""

    source: str
    rows: tuple[ImportedTool, ...]

    @property
    def library(self):
        """ToolLibrary of the tools that were not skipped.

        Raises:
            InputError: two of them have the same number.
        """
        try:
            return ToolLibrary(tools=[r.tool for r in self.rows if r.tool is not None])
        except ValidationError as error:
            raise InputError(f"{self.source}: {complaints(error)}: give every tool its own number there, or "
                             "import with --renumber") from None

    def as_dict(self):
        return {"source": self.source, "tools": [r.as_dict() for r in self.rows]}


def import_tools(path, *, holder=None, holders=(), stick_out_mm=None, is_renumbered=False):
    """Read a Fusion (.json, .tools) or FreeCAD (.fctb, .fctl) tool library.

    Args:
        path: the file.
        holder: name of a Holder for the tools that come without one.
        holders: Holders to find it in, beside those of the file itself.
        stick_out_mm: stick-out for the tools that come without one.
        is_renumbered: number the tools 1, 2, ... in the order of the file.
    Returns:
        Import.
    Raises:
        InputError: no such library; tools without holder, stick-out or number, all of them named; measures that can
            only be in another unit than they say; nothing that could be imported.
    """
    path = Path(path)
    if path.suffix not in READERS:
        raise InputError(f"{path}: a tool library to import is one of {', '.join(READERS)}")
    refuse_irregular(path, "tool library")
    if not path.is_file():
        raise InputError(f"tool library {path} does not exist")
    foreign = READERS[path.suffix](path)
    fallback = None if holder is None else _named(holder, {h.name: h for h in holders} | _own_holders(path))
    if is_renumbered:
        foreign = [replace(f, number=k, assumed=(*f.assumed, f"number = {k} (renumbered, was {f.number})"))
                   for k, f in enumerate(foreign, 1)]
    completed = [_completed(f, fallback, stick_out_mm) for f in foreign]
    _refuse_incomplete(path, completed)
    rows = tuple(_made(f) for f in completed)
    if not any(r.tool for r in rows):
        raise InputError(f"{path}: no tool can be imported: " + "; ".join(
            f"{r.name}: {r.skipped_because}" for r in rows[:5]))
    _refuse_implausible(path, rows)
    return Import(source=path.name, rows=rows)


def _own_holders(path):
    return fusion_holders(path) if READERS[path.suffix] is fusion_tools else {}


def _named(name, holders):
    if name not in holders:
        raise InputError(f"there is no holder {name!r}; there are {', '.join(sorted(holders)) or 'none'}")
    return holders[name]


def _completed(foreign, holder, stick_out_mm):
    """The tool with what the caller gives in place of what the file does not say."""
    if foreign.skipped_because:
        return foreign
    assumed = list(foreign.assumed)
    if foreign.holder is None and holder is not None:
        assumed.append(f"holder = {holder.name}, as requested")
    if foreign.stick_out_mm is None and stick_out_mm is not None:
        assumed.append(f"stick_out_mm = {stick_out_mm:g}, as requested")
    return replace(foreign, holder=foreign.holder or holder, assumed=tuple(assumed),
                   stick_out_mm=stick_out_mm if foreign.stick_out_mm is None else foreign.stick_out_mm)


def _refuse_incomplete(path, tools):
    """Nobody knows how far these tools stand out, or of what, or where in the magazine."""
    for field, what, way in (("holder", "holder", "--holder NAME"), ("stick_out_mm", "stick-out", "--stick-out MM"),
                             ("number", "number", "--renumber")):
        lacking = [f.name for f in tools if not f.skipped_because and getattr(f, field) is None]
        if lacking:
            raise InputError(f"{path}: {counted(len(lacking), 'tool')} without a {what} ({', '.join(lacking[:5])}"
                             f"{', ...' if len(lacking) > 5 else ''}): it is never guessed; write it into the file, "
                             f"or give it with {way}")


def _made(foreign):
    kept = {k: getattr(foreign, k) for k in ("number", "name", "foreign_type", "unit", "dropped", "assumed")}
    reason, tool = foreign.skipped_because, None
    if not reason:
        try:
            tool = _tool_of(foreign)
        except ValidationError as error:
            reason = complaints(error)
    return ImportedTool(**kept, tool=tool, skipped_because=reason)


def _tool_of(foreign):
    return Tool(number=foreign.number, cutter=Cutter(name=foreign.name, **foreign.cutter),
                holder=Holder.model_validate(foreign.holder), stick_out_mm=foreign.stick_out_mm, presets=foreign.presets or None,
                **foreign.more)


def made_of(foreign):
    """The Tool that a ForeignTool is by itself; None: it lacks something, or is none."""
    try:
        return None if foreign.skipped_because else _tool_of(foreign)
    except ValidationError:
        return None


def _refuse_implausible(path, rows):
    """Inches tagged as millimetres, or the other way round: every length is 25.4 times off."""
    for row in rows:
        for what, length, (low, high) in _lengths(row):
            if not low <= length <= high:
                other = "inches" if length < low else "millimetres"
                raise InputError(
                    f"{path}: {row.name}: {what} is {length:.4g} mm, outside {low:g} .. {high:g} mm: its unit says "
                    f"{row.unit!r}, but the numbers look like {other}; correct the unit in the file")


def _lengths(row):
    """(what, mm, (least, most)) of what tells a unit."""
    if row.tool is None:
        return
    cutter, segments = row.tool.cutter, row.tool.holder.segments
    yield "overall length", cutter.overall_length_mm, OVERALL_MM
    yield "shank diameter", cutter.shank_diameter_mm, SHANK_MM
    yield "widest holder diameter", max(max(s.lower_diameter_mm, s.upper_diameter_mm) for s in segments), HOLDER_MM
    yield "holder height", sum(s.height_mm for s in segments), HOLDER_MM
