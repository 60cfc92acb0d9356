"""What verification discovers: values that add up, each one something to act on."""

from dataclasses import asdict, dataclass, replace

import numpy as np

from cuspline.values.amounts import length


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing wrong with a posted program.

    `kind` is one of finding_kinds.KINDS.
    """

    kind: str
    amount_mm: float                                # how much; 0 where a length makes no sense
    place_mm: tuple[float, float, float] | None     # part coordinates
    operation: str                                  # "" where it belongs to none
    line: int                                       # line of the posted text; 0 unknown
    setup: str
    advice: str                                     # one sentence: how to fix it
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
        return length(self.amount_mm) if self.amount_mm else ""


def located(findings, posted, blocks, axes_at):
    """Findings of one program with the machine's axes at their places, the text and the calls of their lines.

    The axes are given as the control shows them in machine coordinates while the tip of the tool that the line cuts
    with stands at the place.

    Args:
        findings: Finding values.
        posted: PostedMoves.   blocks: the program's lines.
        axes_at: function (row, place in part coordinates) to X, Y and Z (3,), as `axes_upright` makes one.
    """
    return tuple(_located(f, posted, blocks, axes_at) for f in findings)


def _located(finding, posted, blocks, axes_at):
    block = blocks[finding.line - 1].strip() if 0 < finding.line <= len(blocks) else ""
    rows = np.flatnonzero(posted.line == finding.line) if finding.line and finding.row < 0 else [finding.row]
    if not len(rows) or rows[-1] < 0:
        return replace(finding, block=block)
    row = rows[-1]
    finding = replace(finding, block=block, call_line=int(posted.call_line[row]))
    if finding.place_mm is None:
        return finding
    axes = axes_at(row, np.array(finding.place_mm))
    return replace(finding, machine_mm=tuple(float(x) for x in axes.round(6)))


def axes_upright(posted, frame, wcs_origin_mm, tool_offsets_mm):
    """For `located`, where no rotary axis turns: part, through the setup's frame into the WCS, through the offsets in force.

    Args:
        posted: PostedMoves.   frame: the WCS seen from the part.
        wcs_origin_mm: (3,) of the machine, for lines that leave an axis unknown.
        tool_offsets_mm: {tool number: offset (x, y, z)}.
    """
    return lambda row, place_mm: frame.into(place_mm[None])[0] + _offset_mm(posted, row, wcs_origin_mm, tool_offsets_mm)


def _offset_mm(posted, row, wcs_origin_mm, tool_offsets_mm):
    """(3,) machine minus WCS coordinates on a line: as read back, else as the machine expects it."""
    read = posted.machine_end_mm[row] - posted.end_mm[row]
    number = int(posted.tool[row]) if posted.length_offset_on[row] else None
    tool = tool_offsets_mm.get(number, (0.0, 0.0, 0.0))
    return np.where(np.isfinite(read), read, np.asarray(wcs_origin_mm, float) + tool)
