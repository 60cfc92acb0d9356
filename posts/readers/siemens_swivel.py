"""CYCLE800 of a Sinumerik: the frame that it asks for, and whether the rotary axes stand as it would turn them.

    CYCLE800(FR, "record", ST, MODE, X0, Y0, Z0, A, B, C, X1, Y1, Z1, DIR, FR_I [, DMODE])

The zero goes to X0 Y0 Z0, the axes turn by A, B and C one after the other, each about an axis as turned before, the zero goes on by
X1 Y1 Z1 there.  MODE says about which: two bits each, 1 X, 2 Y, 3 Z, from the lowest; bits above ask for other kinds of angles.
Of two ways to hold the tool, DIR takes the one with the larger (1) or the smaller (-1) angle of the axis that the record refers to,
the last from the part to the tool; where the other is out of its range there is no choice.
"""

from math import isfinite, pi

import numpy as np

from cuspline.posts.readers.rs274_expressions import Complaint
from cuspline.posts.readers.turns import turned_about
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame

LEAST, MOST = 15, 16        # parameters
SAME_RAD = 1e-4             # of the rotary axis that the direction refers to
SLACK_RAD = 1e-9


def swivelled(parameters, unit_mm):
    """The frame that CYCLE800 asks for.

    Args:
        parameters: texts between its brackets.   unit_mm: of the lengths.
    Returns:
        (values.frames.Frame in the WCS, DIR).
    Raises:
        Complaint: it retracts, adds to another frame, follows the tip, turns nothing, or asks for other kinds of angles.
    """
    if not LEAST <= len(parameters) <= MOST:
        raise Complaint(f"CYCLE800 with {len(parameters)} parameters", f"write {LEAST} of them, or none to take the frame back")
    if not parameters[1].startswith('"'):
        raise Complaint("CYCLE800 without the name of a swivel data record", 'write it in "" behind the first comma')
    retract, status, mode, *lengths, direction, by = [_number(p) for p in (parameters[0], *parameters[2:LEAST])]
    if retract or by:
        raise Complaint("CYCLE800 that retracts the tool", "write 0 for FR and FR_I, and retract by SUPA before")
    if status:
        raise Complaint("CYCLE800 that adds to a frame, follows the tip or aligns the tool", "write 0 for ST")
    if direction not in (-1, 1):
        raise Complaint("CYCLE800 that turns nothing, or does not say which way to hold the tool", "write 1 or -1 for DIR")
    about = [(int(mode) >> shift) & 3 for shift in (0, 2, 4)]
    if mode != int(mode) or int(mode) >> 6 or sorted(about) != [1, 2, 3]:
        raise Complaint(f"CYCLE800 in mode {mode:g}", "write angles axis by axis: 39 about Z, X, Y or 57 about X, Y, Z")
    rotation = np.eye(3)
    for axis, degrees in zip(about, lengths[3:6]):
        rotation = fixed.matmul(rotation, turned_about(axis - 1, degrees))
    origin = unit_mm * np.array(lengths[:3]) + fixed.matmul(rotation, unit_mm * np.array(lengths[6:])[:, None])[:, 0]
    return Frame(rotation=rotation, origin_mm=origin), int(direction)


def refuse_other_side(chain, turned_deg, frame, side):
    """Nothing, where the cycle would choose the way that the rotary axes stand.

    Args:
        chain: kinematics.Chain.   turned_deg: of its rotaries, NaN unknown.   frame: asked for.   side: DIR.
    Raises:
        Complaint: it would hold the tool the other way.
    """
    if not isfinite(sum(turned_deg)):
        return                                  # which is refused in any case
    both = chain.branches(frame.rotation[:, 2][None])[0][0]
    off = [abs(float(fixed.sin(0.5 * (angle - np.radians(turned_deg[-1]))))) for angle in both[:, -1].tolist()]
    mine = int(off[1] < off[0])
    there, other = both[mine, -1], both[1 - mine, -1]
    if abs(there - other) > SAME_RAD and _is_within_range(chain, both[1 - mine]) and (there > other) != (side > 0):
        raise Complaint(f"CYCLE800 with {side} for DIR would hold the tool the other way",
                        f"write {-side} for it, or name the other angles of the rotary axes before")


def _is_within_range(chain, angles):
    """Whether each of (r,) angles, whole turns more or less, is one that the rotary axis reaches."""
    low, high = chain.low[3:], chain.high[3:]
    turns = np.array([-2 * pi, 0.0, 2 * pi])[:, None] + angles
    return bool(((turns >= low - SLACK_RAD) & (turns <= high + SLACK_RAD)).any(axis=0).all())


def _number(text):
    try:
        value = float(text or "0")
    except ValueError:
        value = np.nan
    if not isfinite(value):
        raise Complaint(f'"{text}" in CYCLE800', "write numbers")
    return value
