"""What the viewer needs to show the machine moving: its chain, its bodies, its tools, and where its joints stand over the program.

Joints are packed as the path is (view_data): integers of a stated step, differences to the pose before.  Between two poses
they run evenly, as a control runs them.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.report.bundle import FaceMesh
from cuspline.report.packing import delta, joined, known, pack_mesh, text_block
from cuspline.shop.kinematics import Chain
from cuspline.shop.machines import Box, Cylinder
from cuspline.values import fixed_math as fixed
from cuspline.values.frames import Frame

JOINT_STEP = 1e-4           # mm and degrees
EVEN = 1e-9                 # steps of one block that differ by less, mm and degrees, are equal but for rounding


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineBody:
    """A body of the machine as it is drawn, machine coordinates with every axis at 0."""

    name: str
    link: str                       # axis that it moves with, or "bed"
    colour: str                     # "#rrggbb"
    shape: Box | Cylinder | FaceMesh


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineTool:
    """Where a tool sits in the spindle."""

    tip_mm: tuple[float, float, float]      # seen from the spindle nose, every axis at 0
    tool: dict                              # as plan.json has it


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Joints of one clamping's program, one row a pose; machine coordinates."""

    setups: tuple[int, ...]         # of the report's setups, in the order in which it cuts them
    place: Frame                    # the part's coordinates seen from the machine, every axis at 0
    joints: np.ndarray              # (n, m) mm and degrees, columns as Chain.letters; NaN: the text has not said it yet
    time_s: np.ndarray              # (n,) since the program began
    own_s: np.ndarray               # (n,) of the setup's own path: it stands still while the machine turns to a position
    setup: np.ndarray               # (n,) of `setups`: the one that it is in, or leads to
    line: np.ndarray                # (n,) of the text, from 1
    tool: np.ndarray                # (n,) in the spindle; 0 none
    operation: np.ndarray           # (n,) of the setup's; -1 none
    feed_mm_per_min: np.ndarray     # (n,) of the tip
    is_rapid: np.ndarray            # (n,) bool


@dataclass(frozen=True, eq=False, kw_only=True)
class MachineView:
    """The machine as the viewer moves it."""

    name: str
    chain: Chain
    order: tuple[str, ...]          # axes and "bed", from the part to the tool
    upward: str                     # letter of the axis along which up is
    bodies: tuple[MachineBody, ...]
    tools: dict                     # number -> MachineTool
    motions: tuple[Motion, ...]     # one a clamping


def machine_scene(view, silhouette):
    """(meta dict for JSON, {block name: base64 text}); silhouette(tool dict): outlines of a tool."""
    links, blocks, bodies, motions = view.chain.links, {}, [], []
    for k, body in enumerate(view.bodies):
        shape, raw = _body(body.shape)
        blocks |= {} if raw is None else {f"body-{k}": text_block(raw)}
        bodies.append({"name": body.name, "link": body.link, "colour": body.colour, **shape})
    for k, motion in enumerate(view.motions):
        meta, raw = pack_motion(motion)
        blocks[f"motion-{k}"] = text_block(raw)
        motions.append(meta)
    return {"name": view.name, "letters": list(view.chain.letters), "order": list(view.order), "upward": view.upward,
            "direction": links.direction.tolist(), "pivot": links.pivot.tolist(), "isRotary": links.is_rotary.tolist(),
            "toolTurn": Frame.along(view.chain.spindle).rotation.ravel().tolist(), "bodies": bodies, "motions": motions,
            "tools": {str(number): {"tip": list(map(float, t.tip_mm)), "silhouette": silhouette(t.tool)}
                      for number, t in sorted(view.tools.items())}}, blocks


def _body(shape):
    """(meta dict, packed mesh or None) of a body's shape."""
    if isinstance(shape, Box):
        return {"box": [list(shape.low_mm), list(shape.high_mm)]}, None
    if isinstance(shape, Cylinder):
        axis = np.array(shape.axis) / fixed.length(np.array(shape.axis))
        return {"outline": [[0.0, 0.0], [shape.diameter_mm / 2, 0.0], [shape.diameter_mm / 2, shape.height_mm],
                            [0.0, shape.height_mm]], "foot": list(shape.foot_mm),
                "turn": Frame.along(axis).rotation.ravel().tolist()}, None
    meta, raw = pack_mesh(shape)
    return {"mesh": meta}, raw


def pack_motion(motion):
    """(meta, bytes) of a program's joints: columns of joints, both times, line, feed, tool, operation, setup, rapid flag."""
    m, kept = motion, needed(motion)
    joints = known(m.joints)[kept]
    raw = joined([*(delta(np.round(column / JOINT_STEP), np.int32) for column in joints.T),
                  *(delta(np.round(s[kept] * 1000), np.int32) for s in (m.time_s, m.own_s)),
                  delta(m.line[kept], np.int32), delta(np.round(np.nan_to_num(m.feed_mm_per_min[kept]) * 10), np.int32),
                  m.tool[kept].astype(np.int32), m.operation[kept].astype(np.int16), m.setup[kept].astype(np.int16),
                  m.is_rapid[kept].astype(np.uint8)])
    return {"poses": len(kept), "step": JOINT_STEP, "setups": list(m.setups), "rotation": m.place.rotation.ravel().tolist(),
            "origin": m.place.origin_mm.tolist()}, raw


def needed(motion):
    """Rows (k,) of a motion that are not half-way between their neighbours: a reader cuts a block into many equal steps."""
    joints = known(motion.joints)
    if len(joints) < 3:
        return np.arange(len(joints))
    same = np.abs(joints[2:] - 2 * joints[1:-1] + joints[:-2]).max(axis=1) < EVEN
    for column in (motion.line, motion.tool, motion.operation, motion.setup, motion.is_rapid):
        same &= column[1:-1] == column[2:]
    return np.flatnonzero(np.concatenate([[True], ~same, [True]]))
