r"""Chamfers as a gauge sees them: how wide the strip is, and how it changes where the stock is left or cut too deep.

    face A ______
           theta \  strip       a strip that lies deeper by d reaches its neighbours farther out, by d / tan(theta) on either side
                  \ theta'
                   | face B     legs: from where both faces would meet to the strip's edges
"""

from dataclasses import dataclass

import numpy as np

from cuspline.surfaces.inner_corners import edge_pairs, edge_sines
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

LEAST_RAD = 0.02            # of a turn that is an edge


@dataclass(frozen=True, kw_only=True)
class ChamferStrip:
    """One chamfer of the design, mm."""

    leg_mm: float               # the longer of both
    per_mm: float               # by which the leg shrinks for each mm left on the strip
    place_mm: tuple[float, float, float]


def chamfer_strip(faces, index, title):
    """ChamferStrip of one of a part's brep.Face values, flat or a cone.

    Raises:
        DesignError: it is no strip between two outer edges.
    """
    sides = [(points, float(np.mean(-fixed.arctan2(sines, cosines)))) for points, sines, cosines in _edges(faces, index)]
    sides = sorted((s for s in sides if s[1] > LEAST_RAD), key=lambda s: -_length(s[0]))[:2]
    if len(sides) < 2 or faces[index].kind not in ("plane", "cone"):
        raise DesignError(f"{title}: a {faces[index].kind} among its faces is no chamfer between two outer edges: choose chamfers "
                          "alone")
    (a, theta), (b, other) = sides
    middle = a[len(a) // 2]
    wide = float(_to_line(b, middle).min())
    together = float(fixed.sin(theta + other))
    share = max(float(fixed.sin(theta)), float(fixed.sin(other))) / together
    grows = 1.0 / float(fixed.tan(theta)) + 1.0 / float(fixed.tan(other))
    return ChamferStrip(leg_mm=wide * share, per_mm=grows * share, place_mm=tuple(np.round(middle, 6).tolist()))


def _edges(faces, index):
    for pair in edge_pairs(faces):
        if index in (pair[0][0], pair[1][0]) and pair[0][0] != pair[1][0]:
            sines, cosines, points, _ = edge_sines(faces, pair)
            yield points, sines, cosines


def _length(points):
    return float(np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum())


def _to_line(points, place):
    """(n - 1,) distance of a place to each chord between points."""
    a, way = points[:-1], np.diff(points, axis=0)
    share = np.clip(((place - a) * way).sum(axis=1) / (way ** 2).sum(axis=1), 0.0, 1.0)
    return np.sqrt(((a + share[:, None] * way - place) ** 2).sum(axis=1))
