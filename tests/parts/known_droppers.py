"""Balls on surfaces z = f(x, y) that are nowhere more hollow than the ball: contacts by Newton, to 1e-12 mm."""

from dataclasses import dataclass

import numpy as np

from cuspline.toolpaths.contact.contacts import NO_FACE, TipContacts
from cuspline.toolpaths.drop.droppers import Dropper


@dataclass(frozen=True)
class Graph:
    """A surface over the plane with its first derivatives."""

    height: object      # (x, y) -> z
    slopes: object      # (x, y) -> (dz/dx, dz/dy)

    def normal(self, xy):
        p, q = self.slopes(*xy.T)
        return np.column_stack([-p, -q, np.ones(len(xy))]) / np.sqrt(1 + p * p + q * q)[:, None]


PLANE = Graph(lambda x, y: 0.3 * x + 0.7 * y, lambda x, y: (0.3 + 0 * x, 0.7 + 0 * x))
DOME = Graph(lambda x, y: np.sqrt(400 - x * x - y * y),
             lambda x, y: (-x / np.sqrt(400 - x * x - y * y), -y / np.sqrt(400 - x * x - y * y)))
BOWL = Graph(lambda x, y: -np.sqrt(400 - x * x - y * y),
             lambda x, y: (x / np.sqrt(400 - x * x - y * y), y / np.sqrt(400 - x * x - y * y)))
SADDLE = Graph(lambda x, y: (x * x - y * y) / 30, lambda x, y: (x / 15, -y / 15))
WAVES = Graph(lambda x, y: 0.4 * np.sin(0.5 * x + 0.2 * y) + 0.3 * np.cos(0.3 * x - 0.5 * y),
              lambda x, y: (0.2 * np.cos(0.5 * x + 0.2 * y) - 0.09 * np.sin(0.3 * x - 0.5 * y),
                            0.08 * np.cos(0.5 * x + 0.2 * y) + 0.15 * np.sin(0.3 * x - 0.5 * y)))
GRAPHS = {"plane": PLANE, "dome": DOME, "bowl": BOWL, "saddle": SADDLE, "waves": WAVES}


class GraphDropper(Dropper):
    """A ball over a graph; face 0 within a distance of the middle, face 1 beyond, no edges."""

    def __init__(self, graph, radius_mm, within_mm):
        self.graph, self.radius_mm, self.corner_radius_mm = graph, radius_mm, radius_mm
        self.allowance_mm, self.within_mm = 0.0, within_mm

    def tips_mm(self, xy_mm):
        return self.contacts(xy_mm).tip_z_mm

    def contacts(self, xy_mm):
        xy = np.array(xy_mm, float)
        s, r, h = xy.copy(), self.radius_mm, 1e-6
        residual = lambda at: at + r * self.graph.normal(at)[:, :2] - xy
        for _ in range(60):
            f = residual(s)
            if np.abs(f).max(initial=0.0) < 1e-13:
                break
            fx, fy = ((residual(s + d) - residual(s - d)) / (2 * h) for d in (np.array([h, 0]), np.array([0, h])))
            det = fx[:, 0] * fy[:, 1] - fx[:, 1] * fy[:, 0]
            s = s - np.column_stack([fy[:, 1] * f[:, 0] - fy[:, 0] * f[:, 1],
                                     fx[:, 0] * f[:, 1] - fx[:, 1] * f[:, 0]]) / det[:, None]
        normal, z = self.graph.normal(s), self.graph.height(*s.T)
        inside = (np.abs(s) <= self.within_mm).all(axis=1)
        return TipContacts(tip_z_mm=z + r * normal[:, 2] - r, contact_mm=np.column_stack([s, z]), normal=normal,
                           face=np.where(inside, 0, 1), beside=np.full(len(xy), NO_FACE),
                           is_edge=np.zeros(len(xy), bool))
