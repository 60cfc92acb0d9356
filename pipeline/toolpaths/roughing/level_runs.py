"""The runs that clear one level: where each begins, how the cutter gets there, and the pass steered from there."""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.toolpaths.roughing.clearing_links import nearest_node, pulled_straight, upstream, way_to_nearest
from cuspline.toolpaths.roughing.engagement import clear_stroke, cut_pass
from cuspline.values import fixed_math as fixed

STEP_NODES = 0.8            # one steered step
RIGHT_TURN_SHARE = 0.6      # of the radius: a pass turns right no tighter, left as tight as the least turn
IDLE_SHARE = 0.5            # of the radius: a pass that finds nothing for so long has ended
LONGEST_STEPS = 200_000
ENTRY_RAD = math.radians(60)    # from the direction to the nearest material to the heading of a pass that begins
SAME_MM = 1e-6              # rounding
HELIX_SHARE = 0.8           # of the radius, where there is room: no core is left standing in the middle
FAILURES = 2000             # starts on one level that may come to nothing before the rest is left
BESIDE_NODES = 1.6          # a pass begins no farther than this from touching material
FREE_NODES = 2.0            # and where the cutter comes down from above, this much farther
TABU_NODES = 3              # starts so near to one that failed are not tried
SCRAP_SHARE = 0.05          # of the cutter's disk: no second start is tried for so small a patch
LEAST_NODES = 2             # a pass that clears no more has failed
GRID_WAY = 1.09             # a way over nodes is longer than the straight one by up to this factor


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """One stretch of a level that the cutter makes without lifting."""

    entry: str                  # "down": over free ground; "helix"; "stay": along `way` from where it stands
    way_mm: np.ndarray          # (k, 2) free way to the start of the pass; one point unless "stay"
    path_mm: np.ndarray         # (n, 2) the pass
    helix_mm: tuple | None      # (centre x, centre y, radius)
    top_mm: float               # nothing stands higher where the cutter comes down; the level itself for "stay"


class LevelRuns:
    """Clears the ground of one level run by run; places in nodes unless their names say mm."""

    def __init__(self, ground, grid, rules, writer, level, stock):
        """Nothing cut yet.

        Args:
            ground: LevelGround.
            grid: its PlaneGrid.
            rules: ClearingRules.
            writer: ClearingWriter, asked how far a way may lead.
            level: height of the level, mm.
            stock: (ny, nx) heights that it may still have, and (level, (centre x, centre y, radius)) of helices before, mm.
        """
        self.ground, self.grid, self.rules, self.writer, self.level = ground, grid, rules, writer, level
        self.stock_mm, self.bored = stock
        self.most, self.left_mm2 = 0.0, 0.0

    def made(self):
        """Runs in the order in which they are cut."""
        runs, here, failures = [], None, 0
        while failures < FAILURES and self.ground.is_goal.any():
            begun = self._begin(here)
            if begun is None:
                break
            run = self._cut(*begun)
            if run is None:
                failures += 1
                continue
            runs.append(run)
            here = self._nodes(run.path_mm[-1])
        self.left_mm2 = self.ground.left_nodes * self.grid.pitch_mm ** 2
        return runs

    def _begin(self, here):
        """Entry and way of the next run, which begins nearest to where the cutter is; None: there is no place left."""
        longest = GRID_WAY * self.writer.longest_way_mm(self.level) / self.grid.pitch_mm
        way = None if here is None else self._way(here, longest)
        if way is not None and not self.writer.is_far(self._mm(way), self.level):
            return "stay", way
        ground, corner = self.ground, np.zeros(2)
        roomy = ground.starts(ground.surely, BESIDE_NODES + FREE_NODES)
        x, y = nearest_node(roomy, *(corner if here is None else here))
        if x >= 0:
            return "down", np.array([upstream(roomy, ground.near, x, y)], float)
        way = None if here is None else self._way(here, math.inf)
        if way is not None:
            return "stay", way
        return self._helix_place()

    def _way(self, here, longest):
        """(k, 2) free way on the level to the next start, no longer than this over nodes; None: there is none."""
        ground = self.ground
        wanted = ground.starts(ground.standing, BESIDE_NODES)
        way = way_to_nearest(ground.standing, *here, wanted, longest)
        if len(way) == 0:
            return None
        first = np.zeros(wanted.shape, bool)
        first[upstream(wanted, ground.near, *way[-1])[::-1]] = True
        further = way_to_nearest(ground.standing, *here, first, longest)
        if len(further) == 0 and longest < math.inf:
            return None
        return pulled_straight(ground.standing, np.vstack([here, further if len(further) else way]))

    def _helix_place(self):
        """Entry and centre of a helix into closed ground: where there is most room."""
        ground = self.ground
        room = np.where((ground.apart < ground.radius) & ~ground.is_tabu, ground.permitted, -1.0)
        j, i = np.unravel_index(np.argmax(room), room.shape)
        return ("helix", np.array([[i, j]], float)) if room[j, i] > 0.0 else None

    def _cut(self, entry, way):
        """The run with its pass, the material on the right; None where that clears too little to be made."""
        ground, place, helix, fresh = self.ground, way[-1], None, 0
        covered = np.zeros((0, 2))
        if entry == "helix":
            helix, covered = self._helix(place)
            way, heading = covered[:1], math.pi / 2
            fresh = sum(clear_stroke(ground.material, *a, *b, ground.radius, ground.thin)
                        for a, b in zip(covered, covered[1:]))
        else:
            heading = ground.toward_rad(place) + ENTRY_RAD
        path, more, most = self._steered(way[-1], heading)
        covered = np.vstack([covered, path])
        if fresh + more <= LEAST_NODES:
            ground.refuse(covered, place, TABU_NODES)
            ground.give_up_scrap(place, int(SCRAP_SHARE * math.pi * ground.radius ** 2))
            return None
        ground.accept(covered)
        self.most = max(self.most, most)
        top = self.level if entry == "stay" else self._top_mm(entry, place, 0.0 if helix is None else helix[2])
        if helix is not None:
            top = min([top, *(level for level, before in self.bored if level > self.level and _is_within(helix, before))])
        return Run(entry=entry, way_mm=self._mm(way), path_mm=self._mm(path), helix_mm=helix, top_mm=top)

    def _top_mm(self, entry, place, radius_mm):
        """The highest that may stand under a cutter that comes down at a place, or on a circle round it."""
        reach = self.ground.radius + radius_mm / self.grid.pitch_mm + 2
        rows, columns = self.ground.window(place[None], reach)
        j, i = np.ogrid[rows, columns]
        under = (i - place[0]) ** 2 + (j - place[1]) ** 2 <= reach ** 2
        top = float(max(self.stock_mm[rows, columns][under].max(), self.level))
        return top if entry == "helix" else min(top, self.level + self.rules.highest_ridge_mm)

    def _steered(self, place, heading):
        """Path (n, 2), number of nodes cleared and largest engagement of a pass."""
        ground, rules = self.ground, self.rules
        turn = rules.turn_mm / self.grid.pitch_mm
        return cut_pass(ground.material, ground.permitted, *place, heading, ground.radius, ground.thin,
                        rules.engagement_rad, STEP_NODES, STEP_NODES / (RIGHT_TURN_SHARE * ground.radius),
                        STEP_NODES / turn, IDLE_SHARE * ground.radius, LONGEST_STEPS)

    def _helix(self, center):
        """(x, y, radius) in mm of a helix, and its circle (n, 2) in nodes."""
        ground, (x, y) = self.ground, center
        radius = min(HELIX_SHARE * ground.radius, ground.permitted[int(y), int(x)])
        angle = np.linspace(0.0, 2 * np.pi, 65)
        ring = center + radius * np.column_stack([fixed.cos(angle), fixed.sin(angle)])
        return (*map(float, self._mm(center)), float(radius * self.grid.pitch_mm)), ring

    def _nodes(self, xy_mm):
        return (np.asarray(xy_mm, float) - self.grid.low_mm) / self.grid.pitch_mm

    def _mm(self, nodes):
        return np.asarray(nodes) * self.grid.pitch_mm + self.grid.low_mm


def _is_within(helix, before):
    """Whether a cutter on one helix stays where the same has been on another, both (centre x, centre y, radius) in mm."""
    (x, y, radius), (cx, cy, wide) = helix, before
    return fixed.hypot(x - cx, y - cy) + radius <= wide + SAME_MM
