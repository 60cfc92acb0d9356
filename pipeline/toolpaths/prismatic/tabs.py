r"""Paths that rise over tabs: where there is room for them along a chain, and the way up, over and down.

       up __________            the cutter's middle is over a tab from its radius before the narrowest part to its radius behind
         |          `-._ down
    -----'   w + 2 r     `----
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.toolpaths.prismatic.contour_moves import follow
from cuspline.toolpaths.prismatic.plan_elements import SNUG_MM
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import PlanError

MORE_MM = 0.2               # beside a tab to the end of its element
ON_ARC = 9                  # places along a tab on an arc


@dataclass(frozen=True, kw_only=True)
class Over:
    """One tab along a chain: lengths along it, and heights."""

    begin_mm: float             # where the cutter goes up
    level_end_mm: float         # to here it stays up
    end_mm: float               # down again; the same as level_end_mm: straight down
    top_mm: float

    def wider(self, by_mm):
        return Over(begin_mm=self.begin_mm - by_mm, level_end_mm=self.level_end_mm + by_mm, end_mm=self.end_mm + by_mm,
                    top_mm=self.top_mm)


def room_for(chain, wanted_mm, level_mm, ramp_mm):
    """Lengths along a chain where tabs begin, each within one element, as near to where they are wanted as there is room.

    Args:
        chain: PlanChain.   wanted_mm: lengths of the tabs' middles.   level_mm: on top.   ramp_mm: down.
    Raises:
        PlanError: there is no room for one of them.
    """
    whole, free, done = level_mm + ramp_mm + 2 * MORE_MM, [], 0.0
    for element in chain.elements:
        if element.length_mm >= whole:
            free.append((done + MORE_MM, done + element.length_mm - whole + MORE_MM))
        done += element.length_mm
    begins = []
    for wanted in wanted_mm:
        places = [min(max(wanted - level_mm / 2, low), high) for low, high in free]
        if not places:
            raise PlanError(f"no straight or round stretch of the contour is {whole:.1f} mm long, as a tab needs: a narrower tab, "
                            "a smaller cutter, or tab_shape = \"square\"")
        begin = min(places, key=lambda p: abs(p + level_mm / 2 - wanted))
        begins.append(begin)
        free = [part for low, high in free for part in ((low, min(high, begin - whole)), (max(low, begin + whole), high))
                if part[1] >= part[0]]
    return sorted(begins)


def follow_over(writer, chain, overs, heights_mm, feeds):
    """Once along a chain, evenly down from one height to another, up and over tabs.

    Args:
        overs: Over values in the order of the chain.   heights_mm: (begin, end).   feeds: (along, straight down).
    """
    (high, low), whole, at = heights_mm, chain.length_mm, 0.0
    z = lambda along: high + (low - high) * along / whole
    for over in overs:
        _stretch(writer, chain, (at, over.begin_mm), (z(at), z(over.begin_mm)), feeds[0])
        top = max(over.top_mm, z(over.begin_mm))
        writer.feed((*writer.here_mm[:2], top), feeds[0])
        _stretch(writer, chain, (over.begin_mm, over.level_end_mm), (top, top), feeds[0])
        _stretch(writer, chain, (over.level_end_mm, over.end_mm), (top, z(over.end_mm)), feeds[0])
        writer.feed((*writer.here_mm[:2], z(over.end_mm)), feeds[1])
        at = over.end_mm
    _stretch(writer, chain, (at, whole), (z(at), z(whole)), feeds[0])


def _stretch(writer, chain, ends_mm, heights_mm, feed):
    elements = stretch_of(chain, *ends_mm)
    if elements:
        follow(writer, elements, heights_mm[1], feed, heights_mm[0])


def stretch_of(chain, low_mm, high_mm):
    """The elements between two lengths along a chain."""
    out, done = [], 0.0
    for element in chain.elements:
        a, b = max(low_mm - done, 0.0), min(high_mm - done, element.length_mm)
        if b - a > SNUG_MM:
            out.append(element.between(a, b))
        done += element.length_mm
    return tuple(out)


def tab_lines(chain, over, radius_mm, foot_mm):
    """{name of a field of design.tabs.Tab: (n, 3)} of one tab beside the path of a cutter's middle."""
    marks = [over.begin_mm, over.level_end_mm, over.end_mm]
    element, _ = chain.place(over.begin_mm + SNUG_MM)
    if element.center is not None:
        marks = sorted({*marks, *np.linspace(over.begin_mm, over.end_mm, ON_ARC).tolist()})
    half = (over.level_end_mm - over.begin_mm) / 2 - radius_mm
    middle = (over.begin_mm + over.level_end_mm) / 2
    rows = lambda along, side, z: np.array([(*_beside(chain, s, side * radius_mm), z(s)) for s in along])
    foot, top = lambda s: foot_mm, lambda s: over.top_mm
    lines = {f"{where}_{what}": rows(marks, side, z) for where, side in (("near", -1.0), ("far", 1.0))
             for what, z in (("top", lambda s: _top(over, s, foot_mm)), ("foot", foot))}
    core = [middle - half, middle + half]
    both = lambda z: np.vstack([rows(core, -1.0, z), rows(core, 1.0, z)])
    return lines | {"core_top": both(top), "core_foot": both(foot)}


def _beside(chain, along_mm, by_mm):
    element, along = chain.place(along_mm)
    return element.at(along) + by_mm * element.left(along)


def _top(over, along_mm, foot_mm):
    if along_mm <= over.level_end_mm:
        return over.top_mm
    return over.top_mm + (foot_mm - over.top_mm) * (along_mm - over.level_end_mm) / (over.end_mm - over.level_end_mm)


def ramp_mm(height_mm, steepest_rad):
    """Length of a way down that is no steeper."""
    return height_mm / float(fixed.tan(min(steepest_rad, math.pi / 4)))
