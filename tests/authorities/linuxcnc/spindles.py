"""Where LinuxCNC's kinematics modules put the tool of a machine, joint by joint: its tip and its axis, seen from the part.

A module of a preset that LinuxCNC names otherwise (cradle A that carries B, fork A that carries B) is asked in coordinates and
letters of its own, turned by whole quarters.  The axis comes from the module too: as where a tool 100 mm longer ends.
"""

from dataclasses import dataclass
from typing import Callable

import numpy as np

from . import kinematics
from .kinematics import A, B, C

LONGER_MM = 100.0
AS_IS = np.eye(3)
ONWARD = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])       # X to Y, Y to Z, Z to X


@dataclass(frozen=True, kw_only=True)
class Spindle:
    """One of LinuxCNC's modules as this machine's."""

    module: str
    turned: np.ndarray                      # (3, 3) the machine's coordinates to the module's
    angles: Callable                        # of degrees by letter: {column of a pose: (n,)}
    joints: dict                            # {column of a pose: of joints}
    pins: Callable                          # of the tool's length: pins, and what is added to the module's joints (3,)
    by_inverse: bool = False                # its forward is not the way back of its inverse, which moves the machine
    length_pin: str = "tool-offset"
    first: str = " sparm=identityfirst"     # behind the module's name, so that it begins with joints alone

    @property
    def is_native(self):
        """Whether the machine's words are the module's as they stand."""
        counted = self.angles(dict.fromkeys("ABC", 1.0))
        return self.turned is AS_IS and not self.by_inverse and set(counted.values()) == {1.0}


def _table(machine, turned, near):
    """A table-table module: the part turns about one point, the spindle nose less its length is the tip."""
    point = turned @ np.array(getattr(machine, near).pivot_mm)
    pins = dict(zip(("x-rot-point", "y-rot-point", "z-rot-point"), point.tolist()))
    return lambda length: (pins, turned @ [0, 0, -length])


def _head(above, turned):
    """The tool's pivot stands above the nose, which the module counts from where the tip is upright."""
    return lambda length: ({"pivot-length": above[2] + length}, turned @ np.array(above) - [0, 0, above[2] + length])


def spindle_of(machine):
    """The module that has this machine's rotaries in its order; None where LinuxCNC has none."""
    axes = [getattr(machine, c.lower()) for c in machine.rotaries]
    if any(abs(v) not in (0, 1) for axis in axes for v in axis.direction):
        return None
    on_head = sum(machine.chain.index(c) > machine.chain.index("bed") for c in machine.rotaries)
    made = KNOWN.get(("".join(machine.rotaries), on_head))
    return made and made(machine)


def _angles(machine, columns):
    """Degrees by letter as the module's; columns: {column: (letter, way, first)}."""
    sense = {c: round(sum(getattr(machine, c.lower()).direction)) for c in machine.rotaries}
    return lambda d: {column: first + way * sense[letter] * d[letter] for column, (letter, way, first) in columns.items()}


def _trunnion(module, columns, turned, near):
    return lambda machine: Spindle(module=module, turned=turned, angles=_angles(machine, columns),
                                   joints={column: 3 + k for k, column in enumerate(columns)}, pins=_table(machine, turned, near))


def _a_on_b(machine):
    table = _table(machine, AS_IS, "a")
    return Spindle(module="xyzab_tdr_kins", turned=AS_IS, angles=_angles(machine, {A: ("A", -1, 0), B: ("B", -1, 0)}),
                   joints={A: 3, B: 4}, length_pin="tool-offset-z", first="",
                   pins=lambda length: (table(length)[0] | {"switch": 1}, table(length)[1]))


def _a_carries_b(machine):
    return Spindle(module="5axiskins", turned=ONWARD.T, angles=_angles(machine, {B: ("B", -1, 90), C: ("A", 1, -90)}),
                   joints={B: 3, C: 4}, pins=_head(machine.a.pivot_mm, ONWARD.T))


def _b_over_c(machine):
    return Spindle(module="maxkins", turned=AS_IS, angles=_angles(machine, {B: ("B", -1, 0), C: ("C", -1, 0)}),
                   joints={B: 4, C: 5}, pins=_head(machine.b.pivot_mm, AS_IS), by_inverse=True)


KNOWN = {("CA", 0): _trunnion("xyzac-trt-kins", {A: ("A", 1, 0), C: ("C", 1, 0)}, AS_IS, "c"),
         ("CB", 0): _trunnion("xyzbc-trt-kins", {B: ("B", 1, 0), C: ("C", 1, 0)}, AS_IS, "c"),
         ("BA", 0): _trunnion("xyzbc-trt-kins", {B: ("A", 1, 0), C: ("B", 1, 0)}, ONWARD, "b"),
         ("AB", 0): _a_on_b, ("AB", 2): _a_carries_b, ("CB", 1): _b_over_c}


def tool_in_part(host, machine, joints_mm, degrees, length_mm):
    """Tip and axis by LinuxCNC's module.

    Args:
        joints_mm: (n, 3) spindle nose, machine coordinates.   degrees: {letter: (n,)}.
    Returns:
        (n, 3) tips in the part's frame, (n, 3) unit axes.
    """
    ends = [_end(host, machine, np.asarray(joints_mm), degrees, length) for length in (length_mm, length_mm + LONGER_MM)]
    return ends[0], (ends[0] - ends[1]) / LONGER_MM


def _end(host, machine, joints_mm, degrees, length_mm):
    spindle = spindle_of(machine)
    pins, more = spindle.pins(length_mm)
    rows = np.zeros((len(joints_mm), 9))
    rows[:, :3] = joints_mm @ spindle.turned.T + more
    for column, values in spindle.angles(degrees).items():
        rows[:, column if spindle.by_inverse else spindle.joints[column]] = values
    place = _undone if spindle.by_inverse else kinematics.poses_of
    return place(host, spindle.module, pins, rows)[:, :3] @ spindle.turned


def _undone(host, module, pins, rows):
    """Tips that the module's inverse sends to the joints X Y Z of rows (n, 9): it moves space as a whole, three points say how."""
    def sent(place):
        return kinematics.joints_of(host, module, pins, np.hstack([np.broadcast_to(place, (len(rows), 3)), rows[:, 3:]]))[:, :3]

    origin = sent(np.zeros(3))
    moved = np.stack([sent(axis) - origin for axis in np.eye(3)], axis=2)        # (n, 3, 3)
    return np.linalg.solve(moved, (rows[:, :3] - origin)[:, :, None])[:, :, 0]
