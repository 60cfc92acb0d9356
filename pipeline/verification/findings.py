"""What verification discovers: values that add up, each one something to act on."""

from dataclasses import asdict, dataclass, replace

import numpy as np

KINDS = {
    "gouge": "the cutter goes deeper into the part than the finish allows",
    "excess": "more is left than cusp and tolerance allow, where a ball could reach",
    "missing_area": "a region that a ball could reach was never finished",
    "rapid_through_stock": "a rapid goes through material",
    "holder_contact": "holder or spindle head come too near to stock or part",
    "shank_contact": "neck or shank touch stock or part",
    "fixture_contact": "the tool touches a fixture or the machine's table",
    "travel_exceeded": "an axis is sent beyond its travel",
    "no_spindle": "a feed move while the spindle stands, or turns backwards",
    "no_length_offset": "a move near the stock without a tool length offset",
    "wrong_length_offset": "the length offset in force is not that of the tool in the spindle",
    "wrong_work_offset": "a move in another work coordinate system than the setup's",
    "unknown_start": "a move relies on a place or a mode that the program has not stated",
    "path_tolerance": "the text lets the control leave the path farther than the finish allows",
    "spindle_out_of_range": "a spindle speed that machine or cutter do not allow",
    "feed_out_of_range": "a feed that the machine does not run",
    "chip_load": "a feed per tooth far beyond what the material takes",
    "not_ended": "the program does not say that it ends",
    "program_too_long": "the file is larger than the control's store",
    "line_too_long": "a line is longer than the control takes",
    "wrong_tool_table": "the control's tool table does not hold the tools that were judged",
    "changed_file": "a file, or the job in the manifest, is not the one that was published",
    "verifiers_disagree": "the two verifiers differ by more than their error bounds",
    "clearance_not_proven": "a contact is neither shown nor excluded",
    "solid_off": "a solid does not keep what its design asks of it",
    "tool_change_low": "a tool is changed too near to stock or part",
    "stop_low": "the program stops, for good or for a while, with the tool too near",
    "ends_in_cut": "the program ends, or the spindle is switched, in the cut",
    "rapid_too_low": "a rapid passes too close over stock",
    "plunge": "a cutter goes down into stock more steeply or faster than it can",
    "overload": "a cutter takes heavier chips than it stands",
}


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing wrong with a posted program.

    `kind` is one of KINDS.
    """

    kind: str
    amount_mm: float                                # how much; 0 where a length makes no sense
    place_mm: tuple[float, float, float] | None     # part coordinates
    operation: str                                  # "" where it belongs to none
    line: int                                       # line of the posted text; 0 unknown
    setup: str
    advice: str                                     # one sentence: how to mend it
    machine_mm: tuple[float, float, float] | None = None    # what the axes show with the tip at the place; None unknown
    block: str = ""                                 # text of that line
    call_line: int = 0                              # line that called the sub-program in which `line` stands; 0 none
    amount: float | None = None                     # how much, where it is no length
    unit: str = ""                                  # of `amount`
    row: int = -1                                   # of the posted move; -1 not known
    is_at_least: bool = False                       # the search for the amount ended before all was looked at

    def as_dict(self):
        """For verify.json."""
        return {name: value for name, value in asdict(self).items() if name != "row"}

    @property
    def size_in_words(self):
        """The amount with its unit; "" where there is none."""
        if self.amount is not None:
            return f"{self.amount:g} {self.unit}"
        return f"{self.amount_mm:.4f} mm" if self.amount_mm else ""


def located(findings, posted, blocks, frame, wcs_origin_mm, tool_offsets_mm):
    """Findings of one program with the machine's axes at their places, the text and the calls of their lines.

    The axes are given as the control shows them in machine coordinates while the tip of the tool that the line cuts
    with stands at the place: part, through the setup's frame into the WCS, through the offset that is in force on that line.

    Args:
        findings: Finding values.
        posted: PostedMoves.   blocks: the program's lines.
        frame: the WCS seen from the part.
        wcs_origin_mm: (3,) of the machine, for lines that leave an axis unknown.
        tool_offsets_mm: {tool number: offset (x, y, z)}.
    """
    return tuple(_located(f, posted, blocks, frame, wcs_origin_mm, tool_offsets_mm) for f in findings)


def _located(finding, posted, blocks, frame, wcs_origin_mm, tool_offsets_mm):
    block = blocks[finding.line - 1].strip() if 0 < finding.line <= len(blocks) else ""
    rows = np.flatnonzero(posted.line == finding.line) if finding.line and finding.row < 0 else [finding.row]
    if not len(rows) or rows[-1] < 0:
        return replace(finding, block=block)
    row = rows[-1]
    finding = replace(finding, block=block, call_line=int(posted.call_line[row]))
    if finding.place_mm is None:
        return finding
    axes = frame.into(np.array([finding.place_mm]))[0] + _offset_mm(posted, row, wcs_origin_mm, tool_offsets_mm)
    return replace(finding, machine_mm=tuple(float(x) for x in axes.round(6)))


def _offset_mm(posted, row, wcs_origin_mm, tool_offsets_mm):
    """(3,) machine minus WCS coordinates on a line: as read back, else as the machine expects it."""
    read = posted.machine_end_mm[row] - posted.end_mm[row]
    number = int(posted.tool[row]) if posted.length_offset_on[row] else None
    tool = tool_offsets_mm.get(number, (0.0, 0.0, 0.0))
    return np.where(np.isfinite(read), read, np.asarray(wcs_origin_mm, float) + tool)
