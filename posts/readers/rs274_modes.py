"""What a program must have said before a move may rely on it: nobody knows how an aborted program left the control.

A mode is known by the group of the codes that set it (`rs274_codes`).  What differs from control to control stands
in its Rules.
"""

from types import MappingProxyType
from typing import Callable, Mapping, NamedTuple

from cuspline.posts.readers.rs274_arcs import INCH_BOUNDS, MM_BOUNDS
from cuspline.program.program import Kind

# group -> (word to write, what hangs on it)
UNSAID = {
    "distance": ("G90", "whether axis words are places or distances"),
    "work offset": ("G54", "where the zero is"),
    "cutter compensation": ("G40", "whether the path is shifted by a cutter radius"),
    "tool length": ("G43 H", "which tool length is in force"),
    "feed mode": ("G94", "what F means"),
    "plane": ("G17", "the plane of the arc"),
    "arc distance": ("G91.1", "whether I J K are places or distances"),
    "path control": ("G64 P", "how far the control may leave the path"),
    "canned cycle": ("G80", "whether axis words drill"),
    "return level": ("G98", "to which height a canned cycle leads back"),
    "axis offset": ("G92.1", "whether a G92 or G52 shifts the zero"),
    "local zero": ("G52 X0. Y0. Z0.", "whether a G52 shifts the zero"),
}


class Rules(NamedTuple):
    """What one kind of control does in its own way."""

    code_of: Callable               # (letter, number) -> rs274_codes.Code of what it knows
    modes: frozenset                # keys of UNSAID that it has
    takes_own_length: bool          # G43 without H, and H0, take the offset of the tool in the spindle
    moves_z_alone: bool             # G43: what a tool has beside the spindle's axis is made up for by G52
    path_tolerance_mm: float        # before the text says one: inf unbounded, NaN set by the control's parameters
    bounds: tuple = (MM_BOUNDS, INCH_BOUNDS)    # rs274_arcs.ArcBounds in either unit
    words: Mapping = MappingProxyType({})       # in place of those of UNSAID
    actions: Mapping = MappingProxyType({})     # {group of codes: function (controller, name, values)} that it does its own way
    peck_clearance_mm: float = 0.254        # above the last peck, to which G83 comes back by a rapid and G73 goes up
    cycles: frozenset = frozenset()         # names of the canned cycles that it has
    compensation: object = None             # cutter_compensation.Compensation; None: G41 and G42 are not read
    dwell_unit_s: float = 1.0               # of the P of G4 and of G82; X counts seconds
    needs_rigid: bool = False               # G84 and G74 tie the spindle to the feed only behind M29


def relied_on_by_cycle(values):
    """Modes that a canned cycle hangs on; `values` as for `relied_on`."""
    yield from relied_on(Kind.FEED, {**values, "z": 0.0}, False)
    yield from ("plane", "return level")


def relied_on(kind, values, is_machine_move):
    """Modes that a move hangs on.

    Args:
        kind: program.Kind.   values: {letter: value} of its block.   is_machine_move: G53 stands in it.
    """
    if not values.keys().isdisjoint("xyz"):
        yield "distance"
        if not is_machine_move:
            yield from ("work offset", "axis offset", "local zero")
    if not is_machine_move:
        yield "cutter compensation"
        if kind != Kind.RAPID or "z" in values:
            yield "tool length"
    if kind != Kind.RAPID:
        yield from ("feed mode", "path control")
    if kind > Kind.FEED:
        yield "plane"
        if "r" not in values:
            yield "arc distance"
