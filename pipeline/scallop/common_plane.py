r"""Cusp between two passes on the common plane of two neighbouring contacts, from real positions and a turning axis.

      O_n        \   trace of    /           O_t joins the two contacts, O_m is the sum of their normals, O_n lies in the
       |    \     \ next pass   /            plane of both, square to O_t.  A pass' trace is the lowest O_n to which any point
       |     \ pass \         _/             of the cutter comes over all its positions; two passes leave the lower of their
       |      \______\_______/               traces, and the cusp is its highest place over the design between the contacts.
       P1 ------------------- P2   O_t
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import PlanError
from cuspline.values.rows import X, Y, Z

PLACES = 2001               # along O_t at which the traces are compared
OUTLINE_MM = 1e-5           # sagitta of the cutter's outline
STRAIGHT_MM = 0.2           # pieces of it longer than this are taken in parts: a level bottom meets the plane anywhere
STRAIGHT_PARTS = 200
RADIUS, HEIGHT = range(2)   # columns of the outline
ALONG, UP, ACROSS = range(3)                    # rows of a plane's frame: O_t, O_n, square to both
LEFT_T, LEFT_N, RIGHT_T, RIGHT_N = range(4)     # of where a circle crosses the plane


@dataclass(frozen=True, eq=False, kw_only=True)
class CommonPlane:
    """Of two contacts and their normals."""

    origin_mm: np.ndarray       # (3,) the first contact
    along: np.ndarray           # (3,) unit, O_t, toward the second
    up: np.ndarray              # (3,) unit, O_n
    width_mm: float

    @classmethod
    def of(cls, contacts_mm, normals):
        """
        Args:
            contacts_mm: (2, 3).   normals: (2, 3) unit, out of the material.
        Raises:
            PlanError: the contacts coincide, or the normals cancel out or point along the line between them.
        """
        contacts, normals = frozen(contacts_mm, (2, 3), "contacts_mm"), frozen(normals, (2, 3), "normals")
        way = contacts[1] - contacts[0]
        width = float(np.sqrt((way * way).sum()))
        middle = normals.sum(axis=0)
        up = middle - (middle * way).sum() / max(width * width, 1e-300) * way
        size = float(np.sqrt((up * up).sum()))
        if width < 1e-9 or size < 1e-6:
            raise PlanError(f"contacts {contacts[0].tolist()} and {contacts[1].tolist()} with these normals span no common plane: "
                            "take neighbouring passes of one surface")
        return cls(origin_mm=contacts[0], along=way / width, up=up / size, width_mm=width)

    @property
    def across(self):
        """(3,) unit, square to the plane."""
        return np.cross(self.along, self.up)


def trace_mm(plane, outline_mm, tips_mm, axes):
    """The lowest O_n of a cutter over its positions, at PLACES from the first contact to the second.

    Args:
        plane: CommonPlane.   outline_mm: (k, 2) of the cutter, see `close_outline_mm`.
        tips_mm, axes: (k, 3) positions close together, from where the cutter enters the plane to where it leaves it.
    Returns:
        (PLACES,) mm; inf where it never comes.
    """
    found = np.full(PLACES, np.inf)
    _lowest(for_kernel(outline_mm), for_kernel(np.asarray(tips_mm) - plane.origin_mm), for_kernel(axes),
            np.stack([plane.along, plane.up, plane.across]), plane.width_mm / (PLACES - 1), found)
    return found


def common_plane_cusp_mm(plane, traces_mm, curvature_per_mm=0.0):
    """The cusp that two passes leave.

    Args:
        traces_mm: two of `trace_mm`.
        curvature_per_mm: of the design between the contacts: positive on a ridge, negative in a hollow.
    Returns:
        mm; inf where neither pass comes everywhere between the contacts.
    """
    return float((np.minimum(*traces_mm) - _design_mm(plane.width_mm, curvature_per_mm)).max())


def _design_mm(width_mm, curvature):
    """(PLACES,) O_n of an arc through both contacts, in a form that keeps its digits where it is nearly straight."""
    t = np.linspace(-0.5, 0.5, PLACES) * width_mm
    root = lambda x: np.sqrt(np.maximum(1.0 - (curvature * x) ** 2, 0.0))
    half = width_mm / 2
    return curvature * (half * half - t * t) / (root(t) + root(half))


def close_outline_mm(profile):
    """(k, 2) r, z of a shop.cutter_profile.CutterProfile from the tip upward, straight pieces in parts, for all traces."""
    points = profile.points(OUTLINE_MM)
    pieces = [points[:1]]
    for a, b in zip(points[:-1], points[1:]):
        parts = STRAIGHT_PARTS if np.abs(b - a).max() > STRAIGHT_MM else 1
        pieces.append(a + np.linspace(0.0, 1.0, parts + 1)[1:, None] * (b - a))
    return np.vstack(pieces)


@njit
def _draw(t0, n0, t1, n1, step, found):
    """Lower `found` to a straight piece of a section."""
    if t1 < t0:
        t0, n0, t1, n1 = t1, n1, t0, n0
    first, last = max(int(math.ceil(t0 / step - 1e-9)), 0), min(int(math.floor(t1 / step + 1e-9)), len(found) - 1)
    for i in range(first, last + 1):
        share = 0.0 if t1 <= t0 else min(max((i * step - t0) / (t1 - t0), 0.0), 1.0)
        found[i] = min(found[i], n0 + share * (n1 - n0))


@njit
def _lowest(outline, tips, axes, frame, step, found):
    """Every position's section with the plane: where each circle of the outline crosses it, joined up on either side, and to
    where it crosses it at the next position.

    frame: rows O_t, O_n and the plane's normal; tips count from the first contact.
    """
    last = np.full((len(outline), 4), math.nan)             # crossings of the position before: left t, n and right t, n
    for k in range(len(tips)):
        a = axes[k]
        lean = a[X] * frame[ACROSS, X] + a[Y] * frame[ACROSS, Y] + a[Z] * frame[ACROSS, Z]
        off = tips[k, X] * frame[ACROSS, X] + tips[k, Y] * frame[ACROSS, Y] + tips[k, Z] * frame[ACROSS, Z]
        level = math.sqrt(max(1.0 - lean * lean, 0.0))      # of the plane's normal, across the axis
        if level < 1e-9:
            last[:] = math.nan
            continue
        was = False
        for j in range(len(outline)):
            r, z = outline[j, RADIUS], outline[j, HEIGHT]
            away = -(off + z * lean) / level                # of the circle's chord in the plane from its middle
            if r * r < away * away:
                was = False
                last[j, LEFT_T] = math.nan
                continue
            half = math.sqrt(r * r - away * away)
            tm = nm = tc = nc = 0.0
            for c in range(3):
                beside = (frame[ACROSS, c] - lean * a[c]) / level
                d, e = (c + 1) % 3, (c + 2) % 3
                chord = (a[d] * (frame[ACROSS, e] - lean * a[e]) - a[e] * (frame[ACROSS, d] - lean * a[d])) / level
                place = tips[k, c] + z * a[c] + away * beside
                tm, nm = tm + place * frame[ALONG, c], nm + place * frame[UP, c]
                tc, nc = tc + chord * frame[ALONG, c], nc + chord * frame[UP, c]
            t0, n0, t1, n1 = tm - half * tc, nm - half * nc, tm + half * tc, nm + half * nc
            if was:
                _draw(last[j - 1, LEFT_T], last[j - 1, LEFT_N], t0, n0, step, found)
                _draw(last[j - 1, RIGHT_T], last[j - 1, RIGHT_N], t1, n1, step, found)
            else:
                _draw(t0, n0, t1, n1, step, found)
            if not math.isnan(last[j, LEFT_T]):
                _draw(last[j, LEFT_T], last[j, LEFT_N], t0, n0, step, found)
                _draw(last[j, RIGHT_T], last[j, RIGHT_N], t1, n1, step, found)
            was = True
            last[j, LEFT_T], last[j, LEFT_N], last[j, RIGHT_T], last[j, RIGHT_N] = t0, n0, t1, n1
