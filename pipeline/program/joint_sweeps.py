"""What a tool really sweeps while a control runs from block to block: short straight moves with turning axes.

The simulation knows moves whose tip runs straight and whose axis turns on a great circle.  A block of joints that run evenly is cut
into as many of them as it takes to stay within SWEEP_MM and SWEEP_RAD of what the machine does, by the bound of joint_paths.
Under tool-centre-point control the tip runs straight by itself and the rotaries evenly: only the axis asks for pieces.
"""

from dataclasses import dataclass, fields

import numpy as np

from cuspline.program.joint_paths import AXIS_BOUND, TIP_BOUND, block_deviations
from cuspline.program.program import UPRIGHT
from cuspline.values.arrays import frozen

SWEEP_MM = 1e-4         # a tenth of what the finest paths are posted within
SWEEP_RAD = 1e-6        # the same 100 mm above the tip
AT_A_TIME = 50_000      # blocks: what is in work takes twenty times the room of what comes of it


@dataclass(frozen=True, eq=False, kw_only=True)
class JointBlocks:
    """Blocks as a reader finds them, one row each; rotaries in degrees, in the order of Chain.rotaries."""

    start_mm: np.ndarray        # (n, 3) spindle nose in machine coordinates; NaN: unknown
    end_mm: np.ndarray          # (n, 3)
    start_deg: np.ndarray       # (n, r) NaN: unknown
    end_deg: np.ndarray         # (n, r)
    length_mm: np.ndarray       # (n,) of the tool in the spindle
    origin_mm: np.ndarray       # (n, 3) of the WCS, machine coordinates
    minutes: np.ndarray         # (n,) that a cutting block takes
    tip_length_mm: np.ndarray   # (n,) under tool-centre-point control the tool length that the control counts with, and start_mm,
                                # end_mm are the tip of such a tool, seen from the part; NaN: it runs joints

    def __post_init__(self):
        for name, shape in (("start_mm", (None, 3)), ("end_mm", (None, 3)), ("start_deg", (None, None)),
                            ("end_deg", (None, None)), ("length_mm", (None,)), ("origin_mm", (None, 3)), ("minutes", (None,)),
                            ("tip_length_mm", (None,))):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name))


@dataclass(frozen=True, eq=False, kw_only=True)
class Sweeps:
    """Moves in the WCS, in order; the rows that replace a block follow each other."""

    row: np.ndarray             # (k,) block
    start_mm: np.ndarray        # (k, 3) tip; NaN: unknown
    end_mm: np.ndarray          # (k, 3)
    start_axis: np.ndarray      # (k, 3)
    end_axis: np.ndarray        # (k, 3)
    machine_end_mm: np.ndarray  # (k, 3)
    rotary_deg: np.ndarray      # (k, r) at the end
    is_upright: np.ndarray      # (k,) rotaries at 0 from end to end: the reader's own columns hold
    feed_mm_per_min: np.ndarray     # (k,) of the tip


def sweeps_of(chain, blocks):
    """Moves of the tip that blocks of joints come to.

    Args:
        chain: kinematics.Chain.   blocks: JointBlocks.
    Returns:
        Sweeps.  Where a place is unknown its tip is too; where a rotary is, the axis is put upright, and the tip is unknown.
    """
    firsts = range(0, max(len(blocks.minutes), 1), AT_A_TIME)
    made = [_sweeps_of(chain, _some(blocks, first), first) for first in firsts]
    return made[0] if len(made) == 1 else Sweeps(**{f.name: _taken_together(made, f.name) for f in fields(Sweeps)})


def _some(blocks, first):
    return JointBlocks(**{f.name: getattr(blocks, f.name)[first:first + AT_A_TIME] for f in fields(JointBlocks)})


def _taken_together(made, name):
    """One column of all parts, which give it up."""
    columns = [vars(part).pop(name) for part in made]
    return np.concatenate(columns)


def _sweeps_of(chain, blocks, first):
    """`sweeps_of` some of the blocks, the one with number `first` and those behind it."""
    ends = [np.hstack([p, np.radians(q)]) for p, q in ((blocks.start_mm, blocks.start_deg), (blocks.end_mm, blocks.end_deg))]
    known = np.isfinite(ends[0]).all(axis=1) & np.isfinite(ends[1]).all(axis=1)
    upright = (blocks.start_deg == 0).all(axis=1) & (blocks.end_deg == 0).all(axis=1)
    way = _Way(chain, *ends, blocks.tip_length_mm)
    count = np.ones(len(known), np.int64)
    bent = np.flatnonzero(known & ~upright)
    count[bent] = _counts(way.of(bent), blocks.length_mm[bent])
    row = np.repeat(np.arange(len(known)), count)
    step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    joints = [way.of(row).joints((step + k) / count[row]) for k in range(2)]
    tips, axes = zip(*(_poses(chain, q, blocks.length_mm[row], blocks.origin_mm[row]) for q in joints))
    run = np.sqrt(((tips[1] - tips[0]) ** 2).sum(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        feed = run * count[row] / blocks.minutes[row]
    return Sweeps(row=first + row, start_mm=tips[0], end_mm=tips[1], start_axis=axes[0], end_axis=axes[1],
                  machine_end_mm=joints[1][:, :3], rotary_deg=np.degrees(joints[1][:, 3:]), is_upright=upright[row],
                  feed_mm_per_min=np.where(np.isfinite(feed), feed, 0.0))


@dataclass(frozen=True, eq=False)
class _Way:
    """What the control interpolates evenly: joints, or tips and rotaries."""

    chain: object
    before: np.ndarray          # (n, m)
    after: np.ndarray           # (n, m)
    tip_length: np.ndarray      # (n,) NaN: joints

    def of(self, rows):
        """Some of the rows, as often as they are named."""
        return _Way(self.chain, self.before[rows], self.after[rows], self.tip_length[rows])

    def joints(self, share):
        """(n, m) after shares (n,) of the blocks; the ends exactly."""
        share = share[:, None]
        found = np.where(share == 1.0, self.after, self.before + share * (self.after - self.before))
        tip = np.isfinite(self.tip_length) & np.isfinite(found).all(axis=1)
        found[tip] = self.chain.placed(found[tip, :3], found[tip, 3:], self.tip_length[tip])
        return found


def _counts(way, length_mm):
    """(n,) moves that each block takes."""
    n = len(length_mm)
    count, open_, is_tip = np.ones(n, np.int64), np.arange(n), np.isfinite(way.tip_length)
    while len(open_):
        # the first part of a block is not its worst: every part is looked at
        row = np.repeat(open_, count[open_])
        step = np.arange(len(row)) - np.repeat(np.cumsum(count[open_]) - count[open_], count[open_])
        parts = [way.of(row).joints((step + k) / count[row]) for k in range(2)]
        off = block_deviations(way.chain, *parts, length_mm[row])
        of_tip = np.where(is_tip[row], 0.0, off[:, TIP_BOUND] / SWEEP_MM)
        worst = np.zeros(n)
        np.maximum.at(worst, row, np.maximum(of_tip, off[:, AXIS_BOUND] / SWEEP_RAD))
        open_ = open_[worst[open_] > 1.0]
        count[open_] = np.ceil(count[open_] * np.maximum(np.sqrt(worst[open_]), 1.0) * 1.01).astype(np.int64)
    return count


def _poses(chain, joints, length_mm, origin_mm):
    """Tips in the WCS and axes; NaN and upright where the rotaries are not known."""
    turned = np.isfinite(joints[:, 3:]).all(axis=1)
    axes = np.tile(UPRIGHT, (len(joints), 1))
    tips = np.full((len(joints), 3), np.nan)
    found, leaning = chain.forward(np.nan_to_num(joints[turned]), length_mm[turned])
    axes[turned] = leaning
    known = np.isfinite(joints[turned]).all(axis=1)
    tips[turned] = np.where(known[:, None], found - origin_mm[turned], np.nan)
    return tips, axes
