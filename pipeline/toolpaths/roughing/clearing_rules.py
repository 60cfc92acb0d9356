"""What a level-wise clearing is laid out from, and what comes of it."""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.program.program import Moves
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import ToolpathError


@dataclass(frozen=True, eq=False, kw_only=True)
class ClearingRules:
    """What a level-wise clearing is laid out from; lengths in the part frame."""

    mesh: object                    # DropMesh of the part
    radius_mm: float
    corner_radius_mm: float         # 0 (flat) to half the radius
    allowance_mm: float
    stepdown_mm: float
    engagement_rad: float           # largest arc of the cutter in material: acos(1 - a_e / R) on a straight wall
    stock_mm: object                # function (n, 2) places -> (n,) heights of the stock; -inf beside it
    stock_min_mm: np.ndarray        # (3,) corners of a box round the stock
    stock_max_mm: np.ndarray
    ramp_rad: float
    clearance_z_mm: float
    feed_mm_per_min: float
    ramp_feed_mm_per_min: float
    rapid_mm_per_min: float         # decides between a way on the level and a retract
    lift_s: float = 0.0             # what the rapids of a lift take to start and to stop, for the same
    fine_step_mm: float = np.inf    # levels in between, cut from below upward
    ridge_mm: float | None = None   # that cleared ground may keep standing; None: the corner radius
    least_turn_mm: float | None = None      # tightest turn of the tip; None: a sixteenth of the diameter
    threshold_mm: float = 0.0       # remains thinner than this are left (rest roughing)
    lead_mm: float = 2.0            # room beside the stock
    margin_mm: float = 0.04         # kept above the allowance: the mesh's deviation
    keep_out: tuple = ()            # boxes (min_mm, max_mm) that the cutter stays clear of
    keep_clear: tuple = ()          # DropMesh values of other things that it stays clear of
    keep_out_mm: float = 0.0        # how far
    lowest_mm: object = None        # function (n, 2) -> (n,) tips that the holder allows; None: all
    flutes_mm: float = np.inf       # height above which the neck follows, which must meet no remains,
    relief_mm: float = 0.0          # and how much slimmer it is, of the radius

    @property
    def highest_ridge_mm(self):
        return self.corner_radius_mm if self.ridge_mm is None else self.ridge_mm

    @property
    def turn_mm(self):
        return self.radius_mm / 8 if self.least_turn_mm is None else self.least_turn_mm


@dataclass(frozen=True, eq=False, kw_only=True)
class Clearing:
    """Moves from and back to the clearance plane, and what they come to."""

    moves: Moves
    levels_mm: tuple                # in the order in which they are cut; those with nothing to take are left out
    largest_engagement_rad: float   # of the steered steps
    removed_mm3: float              # by a cutter without a corner radius
    lowered_xy_mm: np.ndarray       # (n, 2) nodes at which it takes something
    left_mm3: float                 # within reach, but given up: no start led into it within the bound


def engagement_of_rad(radial_depth_mm, radius_mm):
    """Engaged arc of a straight cut of the given radial depth.

    >>> round(math.degrees(engagement_of_rad(8.0, 8.0)), 6)
    90.0
    """
    return fixed.arccos(max(1.0 - radial_depth_mm / radius_mm, -1.0))


def refuse_bad(rules):
    """Raises ToolpathError where the bounds cannot be used."""
    if not 0.1 <= rules.engagement_rad <= math.pi / 2 + 1e-9:
        raise ToolpathError(f"engagement of {math.degrees(rules.engagement_rad):.1f} degrees: give 6 to 90 degrees")
    if rules.corner_radius_mm > rules.radius_mm / 2:
        raise ToolpathError(f"roughing: corner radius {rules.corner_radius_mm} mm on a cutter of {rules.radius_mm} mm "
                            "radius: levels are cleared by flat and bull-nose cutters with a corner up to half of it")
    if not 0 < rules.ramp_rad < math.radians(45):
        raise ToolpathError(f"ramp of {math.degrees(rules.ramp_rad):.1f} degrees: give more than 0, less than 45")
    if rules.clearance_z_mm <= rules.stock_max_mm[2]:
        raise ToolpathError(f"clearance plane at {rules.clearance_z_mm} mm is not above the stock, which comes up to "
                            f"{rules.stock_max_mm[2]} mm")
