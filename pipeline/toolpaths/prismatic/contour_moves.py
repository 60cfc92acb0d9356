r"""Moves along chains in plan: down by a helix, in and out by arcs that touch the path.

                 ___                 lead-in and lead-out: arcs about one centre on the air's side,
        in  \   / . \   / out        as high above the path as room is free
    _________\_/_____\_/________     path, material below
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Plane
from cuspline.toolpaths.prismatic.plan_elements import PlanElement
from cuspline.values import fixed_math as fixed

SNUG_SHARE = 0.5            # of a hollow arc's radius, that a lead within it takes


@dataclass(frozen=True, eq=False, kw_only=True)
class Leads:
    """Ways onto a path and off it, at one height."""

    way_in: tuple[PlanElement, ...]
    way_out: tuple[PlanElement, ...]

    @property
    def begin(self):
        """(2,) where the cutter comes down."""
        return self.way_in[0].start

    @property
    def end(self):
        return self.way_out[-1].end

    @property
    def elements(self):
        return (*self.way_in, *self.way_out)


def arc_leads(first, last, radius_mm, high_mm):
    """Leads onto the start of an element and off the end of another.

    Args:
        first, last: (PlanElement, length along it) where the path is met, and left.
        radius_mm: of the arcs; in a hollow arc of the path no more than half of its radius.
        high_mm: of the arcs' far ends above the path, at most their radius.
    """
    return Leads(way_in=_arc(*first, radius_mm, high_mm, -1.0), way_out=_arc(*last, radius_mm, high_mm, 1.0))


def _arc(element, along_mm, radius_mm, high_mm, way):
    """One arc: before the place (way -1) or behind it (+1); nothing where its radius is zero."""
    if element.is_left:
        radius_mm = min(radius_mm, SNUG_SHARE * element.radius_mm)
    if radius_mm <= 0:
        return (PlanElement(start=element.at(along_mm), end=element.at(along_mm)),)
    place, left, ahead = element.at(along_mm), element.left(along_mm), element.heading(along_mm)
    high = min(high_mm, radius_mm)
    aside = math.sqrt(radius_mm ** 2 - (radius_mm - high) ** 2)
    far, center = place + high * left + way * aside * ahead, place + radius_mm * left
    ends = (far, place) if way < 0 else (place, far)
    return (PlanElement(start=ends[0], end=ends[1], center=center, is_left=True),)


def lengthened(chain, by_mm):
    """An open chain's elements with straight ways of a length before and behind."""
    first, last = chain.elements[0], chain.elements[-1]
    begin = first.start - by_mm * first.heading(0.0)
    end = last.end + by_mm * last.heading(last.length_mm)
    return (PlanElement(start=begin, end=first.start), *chain.elements, PlanElement(start=last.end, end=end))


def follow(writer, elements, low_mm, feed_mm_per_min, high_mm=None):
    """Writes elements one after the other; from a height evenly down to another where both are given."""
    whole = sum(e.length_mm for e in elements)
    high_mm, done = low_mm if high_mm is None else high_mm, 0.0
    for e in elements:
        done += e.length_mm
        z = high_mm + (low_mm - high_mm) * min(done / whole, 1.0) if whole > 0 else low_mm
        if e.center is None:
            writer.feed((*e.end, z), feed_mm_per_min)
        elif e.length_mm > 0:
            writer.arc((*e.end, z), (*e.center, writer.here_mm[2]), Plane.XY, not e.is_left, feed_mm_per_min)


def helix(writer, chain, heights_mm, turn_mm, feeds):
    """Round and round a closed chain, evenly down, and once round at the bottom.

    Args:
        heights_mm: (top, bottom).   turn_mm: deepest of one turn.   feeds: (on the way down, at the bottom).
    """
    top, bottom = heights_mm
    turns = max(1, math.ceil((top - bottom) / turn_mm - 1e-9))
    for k in range(turns):
        follow(writer, chain.elements, top + (bottom - top) * (k + 1) / turns, feeds[0], top + (bottom - top) * k / turns)
    follow(writer, chain.elements, bottom, feeds[1])


def ring(center, radius_mm, from_rad=0.0):
    """Elements of a circle run anticlockwise: two halves."""
    center = np.asarray(center, float)
    out = radius_mm * np.array([fixed.cos(from_rad), fixed.sin(from_rad)])
    return (PlanElement(start=center + out, end=center - out, center=center, is_left=True),
            PlanElement(start=center - out, end=center + out, center=center, is_left=True))
