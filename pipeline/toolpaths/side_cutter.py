r"""Transverse arcs with a circular side cutter: a disc with radiused teeth on a right-angle head, axis along the vane.

        ┌────────┐ head, hangs from the spindle            the disc turns in the transverse plane: seen from +x it is a
        │        ├──┐                                      circle of radius W + rt that rolls over the tip like the
        │        │ ▐│▌ disc: teeth of radius rt about a    ball's centre circle, grown by W all round
        └────────┘ ▐│▌ circle of radius W
    ──────────────────────────── x ►

A ball of radius rt whose centre is spread round a circle of radius W in the plane: with rt in place of the ball's
radius contacts, interval, Y, Z, C and the register stay as they are, and W is added to the arc's radius alone.  Teeth
so small leave room in valleys no ball of the disc's size would enter, at the disc's cutting speed.
What the head and the disc may not meet is the holding fixture: that is asked over the whole of every move.

Source: the motive and the trouble, Crandall and Stovall ("interference with holding fixtures has been a problem").
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.errors import PlanError
from cuspline.pass_templates import Let, Quantity, Register, terms
from cuspline.program import Kind, Plane

LOOKED_MM = 0.25            # moves are asked at points no farther apart; half of it is kept back
CLEARANCE_MM = 1.0          # head and disc keep that from fixtures


@dataclass(frozen=True, kw_only=True)
class SideCutter:
    """The disc and its head; places from the disc's middle, in the machine's directions."""

    disc_radius_mm: float                   # over the teeth
    tooth_radius_mm: float
    width_mm: float                         # of the disc, along x
    head_boxes_mm: tuple                    # ((min x, y, z), (max x, y, z)) of the head's parts

    def __post_init__(self):
        if not 0 < 2 * self.tooth_radius_mm <= self.width_mm or not self.tooth_radius_mm < self.disc_radius_mm:
            raise PlanError(f"side cutter: teeth of radius {self.tooth_radius_mm:g} mm do not go on a disc of radius "
                            f"{self.disc_radius_mm:g} mm and width {self.width_mm:g} mm: 0 < 2 tooth radius <= width, "
                            "and tooth radius < disc radius")
        if abs(self.width_mm - 2 * self.tooth_radius_mm) > 1e-9:
            raise PlanError(f"side cutter: a width of {self.width_mm:g} mm leaves a flat between teeth of radius "
                            f"{self.tooth_radius_mm:g} mm, and a flat gouges wherever the tip line slopes: full teeth "
                            "have half the width as their radius")

    @property
    def wheel_mm(self):
        """W, radius of the circle of the teeth's centres."""
        return self.disc_radius_mm - self.tooth_radius_mm


def with_wheel(passes, cutter):
    """Templated passes of a ball of the teeth's radius, for the disc: W is one more register, in every arc's radius.

    Rapids across run higher by the disc's radius, for the program drives its middle.

    Args:
        passes: TemplatedPasses whose register `ball` is 0.
        cutter: SideCutter.
    Returns:
        TemplatedPasses.
    """
    if passes.register("ball").value != 0:
        raise PlanError("side cutter: the program drives the disc's middle, so its passes are told with "
                        "ball_radius_mm 0")
    g, fy, beside, wheel, ny = terms("g fy beside wheel ny")
    grown = {"g": lambda t: t + wheel, "fy": lambda t: t + wheel * ny}
    templates = tuple(replace(t, body=tuple(
        Let(s.name, grown[s.name](s.value)) if isinstance(s, Let) and s.name in grown else s for s in t.body))
        for t in passes.templates)
    more = {"beside": cutter.wheel_mm, "clear": cutter.disc_radius_mm}
    registers = tuple(replace(r, value=r.value + more.get(r.name, 0.0)) for r in passes.registers)
    x, y, z = passes.start_mm
    return replace(passes, templates=templates, start_mm=(x, y - more["beside"], z + more["clear"]), registers=(
        *registers, Register(Quantity("wheel", meaning="circle of the teeth's centres"), cutter.wheel_mm)))


@dataclass(frozen=True, kw_only=True)
class Nearest:
    """How near a part of the tool comes to a fixture."""

    part: str                   # "disc", "head part 1"
    fixture: str
    clearance_mm: float         # proven lower bound; negative: they meet
    center_mm: tuple            # of the disc, where it is nearest


def nearest_to_fixtures(moves, cutter, fixtures):
    """The nearest that disc and head come to each fixture, over the whole of all moves.

    Moves are asked at points LOOKED_MM apart; between them nothing comes nearer by more than half of that.

    Args:
        moves: program.Moves of the disc's middle.   cutter: SideCutter.
        fixtures: [(name, min (3,), max (3,))] boxes in the same frame; what lies below one counts as part of it.
    Returns:
        list of Nearest, every part against every fixture.
    """
    points = _along(moves)
    found = []
    for name, low, high in fixtures:
        box = (np.array([low[0], low[1], -np.inf]), np.asarray(high, float))
        parts = [("disc", _disc_mm(points, cutter, *box))]
        parts += [(f"head part {k}", _box_mm(points, *np.array(part, float), *box))
                  for k, part in enumerate(cutter.head_boxes_mm, 1)]
        for part, clear in parts:
            k = int(clear.argmin())
            found.append(Nearest(part=part, fixture=name, clearance_mm=float(clear[k] - LOOKED_MM / 2),
                                 center_mm=tuple(points[k].round(3).tolist())))
    return found


def refuse_interference(moves, cutter, fixtures):
    """Complain where disc or head come too near to a fixture.

    Raises:
        PlanError: names part, fixture, amount and place.
    """
    worst = min(nearest_to_fixtures(moves, cutter, fixtures), key=lambda n: n.clearance_mm, default=None)
    if worst is not None and worst.clearance_mm < CLEARANCE_MM:
        place = " ".join(f"{a}{v:.3f}" for a, v in zip("XYZ", worst.center_mm))
        raise PlanError(f"side cutter: its {worst.part} comes within {worst.clearance_mm:.2f} mm of the "
                        f"{worst.fixture} with the disc's middle at {place}, {CLEARANCE_MM:g} mm are wanted: clamp "
                        "lower, raise the vane, or take a smaller disc or head")


def _disc_mm(centers, cutter, low, high):
    """(n,) distance of the disc, a cylinder along x round its middle, from a box."""
    aside = np.maximum(np.maximum(low[0] - centers[:, 0], centers[:, 0] - high[0]) - cutter.width_mm / 2, 0.0)
    over = np.maximum(np.maximum(low[1:] - centers[:, 1:], centers[:, 1:] - high[1:]), 0.0)
    inside = np.maximum(low[1:] - centers[:, 1:], centers[:, 1:] - high[1:]).max(axis=1)
    radial = np.where((over > 0).any(axis=1), np.linalg.norm(over, axis=1), inside) - cutter.disc_radius_mm
    return np.where(aside > 0, np.hypot(aside, np.maximum(radial, 0.0)), radial)


def _box_mm(centers, part_low, part_high, low, high):
    """(n,) distance of a box that goes along, from a fixed one; negative: the least way out."""
    gaps = np.maximum(low - (centers + part_high), centers + part_low - high)
    outside = np.linalg.norm(np.maximum(gaps, 0.0), axis=1)
    return np.where((gaps > 0).any(axis=1), outside, gaps.max(axis=1))


def _along(moves):
    """(n, 3) points of the moves, no farther apart than LOOKED_MM."""
    rows = [moves.start_mm[None]]
    for k, start in enumerate(moves.starts_mm):
        end = moves.end_mm[k]
        if moves.kind[k] < Kind.ARC_CW:
            count = max(int(np.ceil(np.linalg.norm(end - start) / LOOKED_MM)), 1)
            rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
            continue
        a, b, third = Plane(moves.plane[k]).axes
        center, side = moves.center_mm[k], -1.0 if moves.kind[k] == Kind.ARC_CW else 1.0
        first, last = (np.arctan2(p[b] - center[b], p[a] - center[a]) for p in (start, end))
        sweep = (side * (last - first)) % (2 * np.pi)
        radius = np.hypot(start[a] - center[a], start[b] - center[b])
        count = max(int(np.ceil(radius * sweep / LOOKED_MM)), 1)
        share = np.arange(1, count + 1) / count
        points = np.empty((count, 3))
        points[:, a] = center[a] + radius * np.cos(first + side * share * sweep)
        points[:, b] = center[b] + radius * np.sin(first + side * share * sweep)
        points[:, third] = start[third] + share * (end[third] - start[third])
        rows.append(points)
    return np.concatenate(rows)
