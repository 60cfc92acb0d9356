r"""Lines and arcs in plan, chains of them, and their exact offsets.

    chain       material on the right of the way: a cutter on the left climbs
    offset      a line moves, an arc changes its radius; a corner that sticks out is rounded by an
                arc about it, at one that points inward both sides end where they meet

        ___      outside corner        |  /
       /   \                           | /   inner corner: cut back to the crossing
      |  .__|_                         |/____
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import frozen
from cuspline.values.errors import CutterDoesNotFit

SAME_MM = 1e-4              # ends that are one place
SNUG_MM = 1e-7              # offset ends that need no joint
SHORT_MM = 0.005            # a joint so short is a chord: 4e-7 mm from its arc at a radius of 8 mm
TURN_RAD = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanElement:
    """A straight line, or an arc of less than a full turn, in plan."""

    start: np.ndarray               # (2,)
    end: np.ndarray                 # (2,)
    center: np.ndarray | None = None
    is_left: bool = False           # the arc turns left, anticlockwise

    def __post_init__(self):
        for name in ("start", "end", "center"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, frozen(getattr(self, name), (2,), name))

    @property
    def side(self):
        return 1.0 if self.is_left else -1.0

    @property
    def radius_mm(self):
        """Of an arc; inf of a line."""
        return math.inf if self.center is None else float(fixed.length(self.start - self.center))

    @property
    def sweep_rad(self):
        """Turn of an arc, above zero."""
        return self._turned_to(self.end)

    def _turned_to(self, place):
        a, b = self.start - self.center, place - self.center
        turn = self.side * (fixed.arctan2(b[1], b[0]) - fixed.arctan2(a[1], a[0])) % (2 * math.pi)
        return 0.0 if turn > 2 * math.pi - TURN_RAD else float(turn)

    @property
    def length_mm(self):
        return float(fixed.length(self.end - self.start)) if self.center is None else self.radius_mm * self.sweep_rad

    def at(self, along_mm):
        """(2,) place so far along it."""
        if self.center is None:
            return self.start + self.heading(0.0) * along_mm
        angle = self.side * along_mm / self.radius_mm
        c, s = fixed.cos(angle), fixed.sin(angle)
        x, y = self.start - self.center
        return self.center + np.array([c * x - s * y, s * x + c * y])

    def heading(self, along_mm):
        """(2,) unit direction of the way so far along it."""
        if self.center is None:
            way = self.end - self.start
            return way / fixed.length(way)
        out = (self.at(along_mm) - self.center) / self.radius_mm
        return self.side * np.array([-out[1], out[0]])

    def left(self, along_mm):
        """(2,) unit direction to the left of the way, out of the material."""
        d = self.heading(along_mm)
        return np.array([-d[1], d[0]])

    def between(self, low_mm, high_mm):
        """The part of it from one length along it to another."""
        whole = self.length_mm
        start, end = self.start if low_mm <= 0 else self.at(low_mm), self.end if high_mm >= whole else self.at(high_mm)
        return PlanElement(start=start, end=end, center=self.center, is_left=self.is_left)

    def moved_left(self, by_mm):
        """The same at a distance to the left.

        Raises:
            CutterDoesNotFit: it turns left with a radius no larger than that.
        """
        if self.center is None:
            by = by_mm * self.left(0.0)
            return PlanElement(start=self.start + by, end=self.end + by)
        radius = self.radius_mm - self.side * by_mm
        if radius < SAME_MM:
            raise _too_tight(self.at(self.length_mm / 2), by_mm, f"is rounded by {self.radius_mm:.3f} mm")
        share = radius / self.radius_mm
        start, end = (self.center + share * (place - self.center) for place in (self.start, self.end))
        return PlanElement(start=start, end=end, center=self.center, is_left=self.is_left)


def _too_tight(place, by_mm, why):
    return CutterDoesNotFit(f"the wall at ({place[0]:.3f}, {place[1]:.3f}) {why}, the cutter's middle is to keep {by_mm:.3f} mm "
                            "from it: choose a smaller one")


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanChain:
    """Elements one after the other, each from the end of the one before."""

    elements: tuple[PlanElement, ...]
    is_closed: bool

    @property
    def length_mm(self):
        return sum(e.length_mm for e in self.elements)

    def place(self, along_mm):
        """(element, length along it) so far along the chain."""
        for element in self.elements:
            if along_mm <= element.length_mm:
                return element, along_mm
            along_mm -= element.length_mm
        return self.elements[-1], self.elements[-1].length_mm

    def reversed(self):
        """The same from its end to its beginning, the material on its left then."""
        back = [PlanElement(start=e.end, end=e.start, center=e.center, is_left=not e.is_left) for e in reversed(self.elements)]
        return PlanChain(elements=tuple(back), is_closed=self.is_closed)

    def starts_mm(self):
        """Lengths along the chain of its elements' middles: lines first, then the longest."""
        ends = np.cumsum([e.length_mm for e in self.elements])
        order = sorted((e.center is not None, -e.length_mm, end - e.length_mm / 2) for e, end in zip(self.elements, ends.tolist()))
        return [along for _, _, along in order]

    def begun_at(self, along_mm):
        """The same closed chain, begun so far along it."""
        before, after, done = [], [], 0.0
        for element in self.elements:
            length = element.length_mm
            cut = min(max(along_mm - done, 0.0), length)
            if cut > SNUG_MM:
                before.append(element.between(0.0, cut))
            if length - cut > SNUG_MM:
                after.append(element.between(cut, length))
            done += length
        return PlanChain(elements=(*after, *before), is_closed=True)

    def nearest(self, place):
        """Length along the chain of its nearest place to a place (2,)."""
        best, done = (math.inf, 0.0), 0.0
        for element in self.elements:
            length = element.length_mm
            if element.center is None:
                along = float(((place - element.start) * element.heading(0.0)).sum())
            else:
                along = element._turned_to(np.asarray(place, float)) * element.radius_mm
            for s in (0.0, length, *([along] if 0 < along < length else [])):
                away = float(fixed.length(element.at(s) - place))
                best = min(best, (away, done + s))
            done += length
        return best[1]

    def places(self, spacing_mm):
        """(n, 2) places along it, no farther apart than that, corners included."""
        out = [self.elements[0].start[None]]
        for e in self.elements:
            count = max(1, math.ceil(e.length_mm / spacing_mm))
            out.append(np.array([e.at(e.length_mm * k / count) for k in range(1, count + 1)]))
        return np.vstack(out)


def chains_of(elements):
    """Chains of elements that follow one another, in any order.

    Args:
        elements: PlanElement values, material on their right.
    Returns:
        list of PlanChain, closed ones as they are met, begun with their first element in the given order.
    """
    starts = np.array([e.start for e in elements])
    follow = [_nearest_row(starts, e.end) for e in elements]
    led_to = {k for k in follow if k is not None}
    left, chains = set(range(len(elements))), []
    for first in [k for k in range(len(elements)) if k not in led_to] + list(range(len(elements))):
        if first not in left:
            continue
        rows, k = [], first
        while k is not None and k in left:
            left.discard(k)
            rows.append(k)
            k = follow[k]
        chains.append(PlanChain(elements=tuple(elements[row] for row in rows), is_closed=k == first))
    return chains


def _nearest_row(places, place):
    away = np.sqrt(((places - place) ** 2).sum(axis=1))
    row = int(away.argmin())
    return row if away[row] < SAME_MM else None


def offset_chain(chain, by_mm):
    """A chain moved to its left.

    Args:
        chain: PlanChain.   by_mm: > 0.
    Returns:
        PlanChain of lines and arcs, exact: its places are by_mm from the chain where nothing else is nearer.
    Raises:
        CutterDoesNotFit: an arc is too tight, or an element is so short between two inner corners that nothing is left of it.
    """
    moved = [e.moved_left(by_mm) for e in chain.elements]
    n = len(moved)
    starts, ends, joints = [0.0] * n, [e.length_mm for e in moved], [None] * n
    for k in range(n if chain.is_closed else n - 1):
        a, b = moved[k], moved[(k + 1) % n]
        if fixed.length(a.end - b.start) < SNUG_MM:
            continue
        corner, is_chord = chain.elements[k].end, fixed.length(a.end - b.start) < SHORT_MM
        if not is_chord and _turns_left(chain.elements[k], chain.elements[(k + 1) % n]):
            ends[k], starts[(k + 1) % n] = _crossing(a, b, by_mm)
        else:
            joints[k] = PlanElement(start=a.end, end=b.start, center=None if is_chord else corner)
    out = []
    for k, element in enumerate(moved):
        if ends[k] - starts[k] < SNUG_MM:
            raise _too_tight(chain.elements[k].at(chain.elements[k].length_mm / 2), by_mm,
                             f"is {chain.elements[k].length_mm:.3f} mm long between its neighbours")
        out += [element.between(starts[k], ends[k]), *([joints[k]] if joints[k] is not None else [])]
    return PlanChain(elements=tuple(_joined(out, chain.is_closed)), is_closed=chain.is_closed)


def _joined(elements, is_closed):
    """The same, each beginning exactly where the one before ends."""
    ends = [e.end for e in elements]
    return [e if k == 0 and not is_closed else PlanElement(start=ends[k - 1], end=e.end, center=e.center, is_left=e.is_left)
            for k, e in enumerate(elements)]


def _turns_left(a, b):
    d, e = a.heading(a.length_mm), b.heading(0.0)
    return d[0] * e[1] - d[1] * e[0] > 0


def _crossing(a, b, by_mm):
    """(length along a, length along b) where two moved elements cross, next to their corner."""
    middle = 0.5 * (a.end + b.start)
    best = None
    for place in crossings(a, b):
        along = [_along(e, place) for e in (a, b)]
        if None not in along:
            away = float(fixed.length(place - middle))
            best = min(best or (math.inf,), (away, *along))
    if best is None:
        raise _too_tight(middle, by_mm, "ends in an inner corner that leaves no room")
    return best[1], best[2]


def _along(element, place):
    """Length along an element to a place on it; None: it is beyond its ends."""
    if element.center is None:
        along = float(((place - element.start) * element.heading(0.0)).sum())
    else:
        along = element._turned_to(place) * element.radius_mm
    return along if -SNUG_MM < along < element.length_mm + SNUG_MM else None


def crossings(a, b):
    """Places where the whole lines or circles of two elements cross."""
    if a.center is None and b.center is None:
        d, e = a.heading(0.0), b.heading(0.0)
        cross = d[0] * e[1] - d[1] * e[0]
        way = b.start - a.start
        return [a.start + d * float(way[0] * e[1] - way[1] * e[0]) / cross] if abs(cross) > TURN_RAD else []
    if a.center is None:
        return _on_circle(a, b)
    if b.center is None:
        return _on_circle(b, a)
    return _of_circles(a.center, a.radius_mm, b.center, b.radius_mm)


def _on_circle(line, arc):
    d = line.heading(0.0)
    foot = line.start + d * float(((arc.center - line.start) * d).sum())
    half = arc.radius_mm ** 2 - float(((foot - arc.center) ** 2).sum())
    return [foot - d * math.sqrt(half), foot + d * math.sqrt(half)] if half >= 0 else []


def _of_circles(p, r, q, s):
    way = q - p
    away = float(fixed.length(way))
    if away < SNUG_MM:
        return []
    along = (away * away + r * r - s * s) / (2 * away)
    half = r * r - along * along
    if half < 0:
        return []
    d, n = way / away, np.array([-way[1], way[0]]) / away
    return [p + along * d - math.sqrt(half) * n, p + along * d + math.sqrt(half) * n]
