"""What verification discovers: values that add up, each one something to act on."""

from dataclasses import asdict, dataclass, replace

import numpy as np

KINDS = ("gouge", "excess", "missing_area", "rapid_through_stock", "holder_contact", "shank_contact",
         "fixture_contact", "travel_exceeded", "no_spindle", "no_length_offset", "unknown_start", "not_ended",
         "program_too_long", "verifiers_disagree", "clearance_not_proven", "solid_off",
         "tool_change_low",
         "stop_low",
         "ends_in_cut",
         "rapid_too_low",
         "plunge",
         "overload")


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
    is_at_least: bool = False                       # the search for the amount ended before all was looked at

    def as_dict(self):
        """For verify.json."""
        return asdict(self)


def located(findings, posted, text, frame, wcs_origin_mm, tool_offsets_mm):
    """Findings of one program with the machine's axes at their places, and the text of their lines.

    The axes are given as the control shows them in machine coordinates while the tip of the tool that the line cuts
    with stands at the place: part, through the setup's frame into the WCS, through the offset that is in force on that line.

    Args:
        findings: Finding values.
        posted: PostedMoves.   text: the program.
        frame: the WCS seen from the part.
        wcs_origin_mm: (3,) of the machine, for lines that leave an axis unknown.
        tool_offsets_mm: {tool number: offset (x, y, z)}.
    """
    blocks = text.splitlines()
    return tuple(_located(f, posted, blocks, frame, wcs_origin_mm, tool_offsets_mm) for f in findings)


def _located(finding, posted, blocks, frame, wcs_origin_mm, tool_offsets_mm):
    block = blocks[finding.line - 1].strip() if 0 < finding.line <= len(blocks) else ""
    rows = np.flatnonzero(posted.line == finding.line) if finding.line else np.zeros(0, int)
    if finding.place_mm is None or not len(rows):
        return replace(finding, block=block)
    offset = _offset_mm(posted, rows[-1], wcs_origin_mm, tool_offsets_mm)
    axes = frame.into(np.array([finding.place_mm]))[0] + offset
    return replace(finding, block=block, machine_mm=tuple(float(x) for x in axes.round(6)))


def _offset_mm(posted, row, wcs_origin_mm, tool_offsets_mm):
    """(3,) machine minus WCS coordinates on a line: as read back, else as the machine expects it."""
    read = posted.machine_end_mm[row] - posted.end_mm[row]
    number = int(posted.tool[row]) if posted.length_offset_on[row] else None
    tool = tool_offsets_mm.get(number, (0.0, 0.0, 0.0))
    return np.where(np.isfinite(read), read, np.asarray(wcs_origin_mm, float) + tool)
