r"""Cutter compensation as controls run it: a programmed contour moved aside by the radius in a register.

                   arc corners: about the corner (LinuxCNC, G450, Klartext)
      A .--.       intersection: A along its tangent, B back along its own, until they meet; where the contour turns by more
       /    \ B    than 90 degrees, each goes on by the radius and a line joins them (Fanuc)
    __/__    \
         |    |    inner corners: both sides end where they cross
    part |    |

The first block leads from where the tool stands to beside the contour, the last one, with G40, away from beside it.
Places in the plane are complex numbers, mm.
"""

import cmath
from math import pi, sqrt, tau
from typing import NamedTuple

from cuspline.posts.readers.rs274_blocks import refusal
from cuspline.posts.readers.rs274_expressions import Complaint

LEAD_RAD = 0.01             # by which a lead may turn at the contour: words are rounded
LEAST_MM = 1e-6             # of a radius
LINUXCNC_TANGENT_RAD = 0.05     # TOLERANCE_CONCAVE_CORNER of its interpreter


class Compensation(NamedTuple):
    """What one kind of control does in its own way."""

    joins_by_arcs: bool                 # at outer corners; else straight lines go on until they meet
    needs_register: bool                # D must be said; else it is the radius of the tool in the spindle
    tangent_rad: float = 1e-3           # turns up to it are none
    enters_beside_own: bool = False     # the first block ends square to itself, not square to the block behind


class Shifted(NamedTuple):
    """Compensation in force."""

    side: float                 # +1 G41, the cutter on the left; -1 G42
    radius_mm: float
    register: int
    line: int                   # of G41 or G42


class Element(NamedTuple):
    """One block of a contour in the plane, with what it says beside."""

    start: complex
    end: complex
    z: tuple                    # of its start and end
    feed: float                 # 0: a rapid
    block: object               # rs274_blocks.Block that says it
    center: complex | None = None
    turn: float = 0.0           # +1 anticlockwise, -1 clockwise

    def heading(self, place):
        """Unit direction of its way at one of its places."""
        way = self.end - self.start if self.center is None else 1j * self.turn * (place - self.center)
        return way / _length(way)

    @property
    def length_mm(self):
        """Of its way in the plane."""
        return abs(self.end - self.start) if self.center is None else abs(self.start - self.center) * (self.sweep(self.end) or tau)

    def sweep(self, place):
        """Angle from an arc's start to a place on its circle, 0 to a whole turn."""
        return cmath.phase((place - self.center) / (self.start - self.center)) * self.turn % tau


def beside(elements, shifted, how):
    """The moves of a contour beside which the cutter runs.

    Args:
        elements: Elements, the first of them the straight way in.   shifted: Shifted.   how: Compensation.
    Returns:
        list of Element: the cutter's middle, to where it stands beside the end of the last.
    Raises:
        ReadError: a way in that does not touch the contour, an arc or a corner too tight for the radius; `.rows` holds the line.
    """
    first, *rest = elements
    if not rest:
        raise _at(first, "compensation that begins and ends with one block", "write the contour between G41 and G40")
    _check_lead(first, rest[0], first.end, "way in", shifted.radius_mm)
    moved = [_moved(e, shifted) for e in rest]
    corner = first.end + _aside(first.heading(first.end) if how.enters_beside_own else rest[0].heading(rest[0].start), shifted)
    out = [first._replace(end=corner)]
    for k, (element, mine) in enumerate(zip(rest, moved)):
        before = first if k == 0 else rest[k - 1]
        joints, begin = _joined(out[-1], before, element, mine, shifted, how)
        out[-1] = out[-1]._replace(end=joints[0].start if joints else begin)
        out += [*joints, mine._replace(start=begin)]
    return out


def check_way_out(last, element, radius_mm):
    """The straight block with G40 goes on as the contour ends.

    Raises:
        ReadError: it does not, or is no longer than the radius.
    """
    _check_lead(element, last, element.start, "way out", radius_mm)


def _check_lead(lead, contour, place, name, radius_mm):
    if lead.center is not None:
        raise _at(lead, f"an arc as the {name} of cutter compensation", "write G1")
    if abs(lead.end - lead.start) <= radius_mm:
        raise _at(lead, f"a {name} of {abs(lead.end - lead.start):.3f} mm is no longer than the radius of {radius_mm:.3f} mm "
                  "in the register", "write a longer one, or correct the register")
    if abs(cmath.phase(lead.heading(place) / contour.heading(place))) > LEAD_RAD:
        raise _at(lead, f"a {name} that does not touch the contour: controls differ in where they go then",
                  "write a straight line along the contour's tangent")


def _at(element, what, advice):
    return refusal(Complaint(what, advice), element.block)


def _aside(heading, shifted):
    return 1j * shifted.side * shifted.radius_mm * heading


def _moved(element, shifted):
    """An element beside itself, its corners not yet looked at."""
    start, end = (p + _aside(element.heading(p), shifted) for p in (element.start, element.end))
    if element.center is not None and element.turn * shifted.side > 0:
        inner = abs(element.start - element.center)
        if inner <= shifted.radius_mm + LEAST_MM:
            raise _at(element, f"an inner arc of {inner:.3f} mm, and {shifted.radius_mm:.3f} mm in D{shifted.register}",
                      "take a smaller cutter")
    return element._replace(start=start, end=end)


def _joined(here, before, element, mine, shifted, how):
    """(Elements between two that are moved, where the second begins).

    Args:
        here: the last move so far, moved.   before, element: the two as programmed.   mine: the second, moved.
    """
    corner = element.start
    turn = shifted.side * cmath.phase(element.heading(corner) / before.heading(before.end))
    if abs(turn) <= how.tangent_rad:
        return [], here.end
    if turn > 0:
        return [], _crossing(here, mine, element)
    common = {"z": (element.z[0], element.z[0]), "feed": element.feed, "block": element.block}
    if how.joins_by_arcs:
        return [Element(here.end, mine.start, center=corner, turn=-shifted.side, **common)], mine.start
    a, b = before.heading(before.end), element.heading(corner)
    q = b / a
    ahead = shifted.radius_mm * (abs(q.imag) / (1.0 + q.real) if turn > -pi / 2 else 1.0)     # the tangent of half the turn
    places = [here.end, here.end + ahead * a, mine.start - ahead * b, mine.start]
    return [Element(p, q, **common) for p, q in zip(places, places[1:]) if abs(q - p) > LEAST_MM], mine.start


def _crossing(a, b, element):
    """Where two moved elements cross, next to their corner.

    Raises:
        ReadError: not before the end of either: the cutter does not fit.
    """
    middle = (a.end + b.start) / 2
    found = [p for p in _crossings(a, b) if _is_on(a, p) and _is_on(b, p)]
    if not found:
        raise _at(element, "an inner corner that the cutter by the radius in the register does not reach",
                  "take a smaller cutter, or correct the register")
    return min(found, key=lambda p: abs(p - middle))


def _is_on(element, place):
    if element.center is None:
        along = ((place - element.start) / element.heading(place)).real
        return -LEAST_MM < along < abs(element.end - element.start) + LEAST_MM
    return element.sweep(place) < (element.sweep(element.end) or tau) + LEAST_MM or element.sweep(place) > tau - LEAST_MM


def _crossings(a, b):
    """Places where the whole lines or circles of two elements cross."""
    if a.center is None and b.center is None:
        d, e = a.heading(a.start), b.heading(b.start)
        across = (d.conjugate() * e).imag
        return [a.start + d * ((b.start - a.start).conjugate() * e).imag / across]
    if a.center is not None and b.center is not None:
        r, s, way = _length(a.start - a.center), _length(b.start - b.center), b.center - a.center
        far = _length(way)
        along = (r * r + far * far - s * s) / (2 * far) if far else r + 1.0
        if abs(along) > r:
            return []
        return [a.center + way / far * complex(along, side * sqrt(r * r - along * along)) for side in (1.0, -1.0)]
    line, arc = (a, b) if a.center is None else (b, a)
    d, radius = line.heading(line.start), _length(arc.start - arc.center)
    foot = line.start + d * ((arc.center - line.start) / d).real
    away = _length(foot - arc.center)
    half = radius * radius - away * away
    return [foot + side * d * sqrt(half) for side in (1.0, -1.0)] if half >= 0 else []


def _length(way):
    return sqrt(way.real * way.real + way.imag * way.imag)

