"""Canned cycles G81, G82, G83, G73 and G85 as a control runs them: what stays in force, and the moves of one hole.

    across at the height where the tool stands, down to R by a rapid, then
    G81 G82     down to Z at the feed; G82 stands still there for P
    G83         by Q at a time, each time up to R and by a rapid back to a little above where it was
    G73         by Q at a time, each time up by a little
    G85         down to Z and up to R, both at the feed
    G84 G74     down to Z and back to R by the pitch F / S, the spindle tied to the feed: right-hand, left-hand
    and up by a rapid: under G98 to where the tool stood when the first cycle began, under G99 to R
"""

from typing import NamedTuple

from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.program.program import Kind

NEEDED = {"G81": "", "G82": "p", "G83": "q", "G73": "q", "G84": "", "G74": "", "G85": ""}      # letters beside Z and R
TAPS = {"G84": 1.0, "G74": -1.0}            # which way the spindle turns on the way down
EVERY = frozenset(NEEDED)
CYCLES = EVERY - TAPS.keys()                # that controls have alike
LEVELS = ("G98", "G99")
MOST_PECKS = 10_000


class Cycle(NamedTuple):
    """A canned cycle in force."""

    name: str
    level: float        # Z where the tool stood when the first of a chain began, tip in the WCS
    context: tuple      # what must not change while it is in force
    z: float = 0.0      # mm
    r: float = 0.0
    q: float = 0.0
    p: float = 0.0      # as written


def begun(name, before, here_z, context):
    """The Cycle of a block with its code, or one that goes on: `before` is the cycle in force, None for none.

    Raises:
        Complaint: something changed that a chain of cycles depends on.
    """
    if before is not None and before.context != context:
        raise Complaint("units, tool, zero, tool length or G98 G99 changed while a canned cycle is in force", "write G80 before")
    if before is not None and before.name == name:
        return before
    return Cycle(name=name, level=here_z if before is None else before.level, context=context)


def with_words(cycle, is_new, values, end_z, r):
    """The cycle with the words of one block.

    Args:
        is_new: it has been in force in no block before.   values: {letter: value} of the block.
        end_z, r: what its Z and R words come to, mm; None where they are missing.
    Raises:
        Complaint: a word that is missing, or makes no sense.
    """
    if values.keys().isdisjoint("xyz"):
        raise Complaint(f"{cycle.name} without X, Y or Z", "name the hole's place")
    for letter in ("z", "r", *NEEDED[cycle.name]):
        if is_new and letter not in values:
            raise Complaint(f"{cycle.name} without {letter.upper()}", f"write {letter.upper()} in its first block")
    if values.get("p", 0.0) < 0:
        raise Complaint("a dwell below zero", "write P with the time")
    made = cycle._replace(**{name: v for name, v in (("z", end_z), ("r", r), ("p", values.get("p"))) if v is not None})
    if not made.z < made.r:
        raise Complaint(f"{cycle.name} whose R is not above its Z", "R is where it begins to feed down, Z the bottom")
    return made


def way_of(cycle, here, place_xy, is_low, clearance_mm):
    """The moves of one hole.

    Args:
        here: (x, y, z) where the tool stands.   place_xy: of the hole.   is_low: G99.
        clearance_mm: that the control keeps above the last peck.
    Yields:
        (program.Kind, (x, y, z)).
    Raises:
        Complaint: the tool stands below R, or there are more pecks than a hole has.
    """
    if here[2] < cycle.r:
        raise Complaint(f"{cycle.name} begins below its R plane", "go up to R or higher by G0 before")
    if cycle.q and (cycle.r - cycle.z) / cycle.q > MOST_PECKS:
        raise Complaint(f"{cycle.name} with more than {MOST_PECKS} pecks in a hole", "write a larger Q")
    at = lambda z: (*place_xy, z)
    yield Kind.RAPID, at(here[2])
    if here[2] != cycle.r:
        yield Kind.RAPID, at(cycle.r)
    depth = cycle.r - cycle.q
    while cycle.q and depth > cycle.z:
        yield Kind.FEED, at(depth)
        if cycle.name == "G83":
            yield Kind.RAPID, at(cycle.r)
        yield Kind.RAPID, at(depth + clearance_mm)
        depth -= cycle.q
    yield Kind.FEED, at(cycle.z)
    if cycle.name in TAPS or cycle.name == "G85":
        yield Kind.FEED, at(cycle.r)
    yield Kind.RAPID, at(cycle.r if is_low else max(cycle.level, cycle.r))
