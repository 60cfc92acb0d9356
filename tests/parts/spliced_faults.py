"""Faults spliced between two clear poses of a leaning program: each of a seed, its truth known beforehand, and what is said of it.

Truths are closed forms of the dome, or poses and places sampled; what is asked is the part of the verdict that must find
the fault, over the spliced blocks alone.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import tilted_dome as dome
from known_programs import feed, program, tool

from cuspline.kernel.tessellation import tessellate
from cuspline.program.program import Kind
from cuspline.replay.clearance import ClearanceTree
from cuspline.replay.replay import replay
from cuspline.replay.scene import FinishedDesign, Fixture, FoundStock, Surroundings
from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.verification.certificate import certify

LEAD_RAD = np.radians(45.0)             # so far over that a short tool's holder comes near to the block
BALL = tool("ball", 6, number=7, flute=6.5, neck=5.6, stick_out=8.2)
BALL = BALL.model_copy(update={"cutter": BALL.cutter.model_copy(update={"reach_mm": 7.0})})
LONGER = BALL.model_copy(update={"stick_out_mm": 6.2, "holder": Holder(name="longer", segments=(
    HolderSegment(height_mm=52.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0),))})
RADIUS_MM = BALL.cutter.radius_mm
AWAY = FoundStock(min_mm=(-1, -1, -200), max_mm=(1, 1, -199), pitch_mm=1.0)         # stock that nothing here can meet
HOLDER_MM = 3.5             # that the holder is to keep from the design: the good one keeps 4.2, the longer one may not
TOLERANCE_MM = 0.004        # of the proof of gouges
SAMPLED_MM = 0.03           # what truths that are sampled may be off by
BODY_MM = 0.6               # half the side of a body in the way
KINDS = ("deeper", "turned", "longer", "body")
CLOSED_FORMS = KINDS[:2]


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault, and what is said of the blocks with and without it."""

    kind: str
    seed: int
    truth_mm: float             # gouge, clearance that is missing, or how deep the body stands in the tool
    told_mm: float              # 0: it is not found
    told_of_good_mm: float      # of the same blocks without the fault

    @property
    def is_found(self):
        """By no less than it is, sampled truths less what they may be off by; and the good blocks are clear."""
        off_mm = 0.0 if self.kind in CLOSED_FORMS else SAMPLED_MM
        return self.told_of_good_mm == 0.0 and self.told_mm > 0 and self.told_mm >= self.truth_mm - off_mm


def faults(kind, seeds):
    """Fault of a kind (KINDS) and of each seed."""
    made = globals()[f"_{kind}"]([np.random.default_rng([KINDS.index(kind), seed]) for seed in seeds])
    return [Fault(kind=kind, seed=seed, truth_mm=float(truth), told_mm=float(told), told_of_good_mm=float(good))
            for seed, (truth, told, good) in zip(seeds, made)]


@cache
def poses():
    """(n, 3) tips and axes where cutting blocks of the good program end, as they are read back."""
    mill = dome.trunnion()
    text = dome.text_of(mill, dome.finishing(lead_rad=LEAD_RAD), BALL)
    posted = dome.read(mill, text, {**dome.TOOLS, 7: BALL})
    rows = np.flatnonzero((posted.tool == 7) & (posted.kind != Kind.RAPID) & ~posted.is_upright)
    inside = (np.abs(posted.end_mm[rows, :2]) < dome.HALF_MM - 1.0).all(axis=1)
    return posted.end_mm[rows[inside]], posted.end_axis[rows[inside]]


@cache
def part():
    """(ExactPart, solid, FinishedDesign, (n, 3) places on it)."""
    solid = dome.solid()
    mesh = tessellate(solid, 0.005)
    rng = np.random.default_rng(1)
    corners = mesh.vertices_mm[mesh.triangles[rng.integers(len(mesh.triangles), size=6000)]]
    share = rng.dirichlet((1, 1, 1), len(corners))
    places = np.vstack([mesh.vertices_mm, (share[:, :, None] * corners).sum(axis=1)])
    design = FinishedDesign(tree=ClearanceTree.of_triangles(mesh.vertices_mm, mesh.triangles), error_mm=0.015)
    return ExactPart.of_solid(solid), solid, design, places


def _two_poses(rng):
    """Tips (2, 3) and axes (2, 3) of two poses that follow each other within a pass, nearly."""
    tips, axes = poses()
    near = np.flatnonzero(np.abs(np.diff(tips[:, 1])) < 1e-3)
    k = int(rng.choice(near))
    return tips[k:k + 2], axes[k:k + 2]


def _blocks(tips, axes):
    """PostedMoves through poses, one feed block from each to the next."""
    return program(tips[0], [feed(*t) for t in tips[1:]], start_axis=axes[:-1], end_axis=axes[1:],
                   tool=np.full(len(tips) - 1, BALL.number))


def _gouges(ways):
    """(n,) proven gouge of blocks through poses [(tips, axes)], each way by itself; 0 within the finish's."""
    column = lambda k, part: np.concatenate([way[k][part] for way in ways])
    ends, first = column(0, slice(1, None)), slice(None, -1)
    posted = program(ends[0], [feed(*t) for t in ends], start_mm=column(0, first), start_axis=column(1, first),
                     end_axis=column(1, slice(1, None)), tool=np.full(len(ends), BALL.number))
    exact, solid, _, _ = part()
    proven = certify(posted, {BALL.number: BALL}, exact, solid=solid, tolerance_mm=TOLERANCE_MM)
    assert len(proven.bound_mm) == len(ends)
    deepest = np.maximum.reduceat(proven.bound_mm, np.r_[0, np.cumsum([len(way[0]) - 1 for way in ways])[:-1]])
    return np.where(deepest > dome.FINISH.gouge_mm, deepest, 0.0)


def _is_fault(tip, axis):
    """Whether the ball gouges at a pose, and deepest where the part has its dome: beside the block its sphere goes on."""
    deepest = dome.RADIUS_MM * _unit(tip + RADIUS_MM * axis - dome.CENTER)
    return _depth(tip, axis) > 0.03 and np.abs(deepest[:2]).max() < dome.HALF_MM


def _depth(tip, axis):
    """How deep the ball stands in the dome at a pose, in closed form."""
    return RADIUS_MM + dome.RADIUS_MM - np.linalg.norm(tip + RADIUS_MM * axis - dome.CENTER)


def _spliced(draws, change):
    """[(truth, told, told of the good blocks)] of what `change(rng, tip, axis)` makes of poses between."""
    good, middle = [], []
    for rng in draws:
        pose = None
        while pose is None:             # other poses, where no change of these is a fault
            tips, axes = _two_poses(rng)
            pose = change(rng, *_between(tips, axes, rng.uniform(0.2, 0.8)))
            pose = pose if _is_fault(*pose) else None
        good.append((tips, axes))
        middle.append(pose)
    bad = [(np.array([tips[0], tip, tips[1]]), np.array([axes[0], axis, axes[1]]))
           for (tips, axes), (tip, axis) in zip(good, middle)]
    told = _gouges(bad + good)
    return zip([_depth(*pose) for pose in middle], told[:len(bad)], told[len(bad):])


def _deeper(draws):
    """The tip is 0.05 mm deeper somewhere in a block."""
    return _spliced(draws, lambda _, tip, axis: (tip - 0.05 * _unit(tip + RADIUS_MM * axis - dome.CENTER), axis))


def _turned(draws):
    """The axis is turned by 20 degrees about the tip somewhere in a block, some way that makes the ball gouge."""
    def change(rng, tip, axis):
        turned = np.cos(np.radians(20)) * axis + np.sin(np.radians(20)) * _unit(np.cross(axis, rng.normal(size=3)))
        return tip, turned

    return _spliced(draws, change)


def _replayed(posted, a_tool, **around):
    """{kind: amount} of the replay of a few blocks away from all stock."""
    found = replay(posted, {7: a_tool}, AWAY, design=part()[2], around=Surroundings(holder_clearance_mm=HOLDER_MM, **around))
    return {f.kind: f.amount_mm for f in found.findings}


def _longer(draws):
    """In one block the holder is 2 mm longer than in the others."""
    return [_with_longer_holder(rng) for rng in draws]


def _with_longer_holder(rng):
    """(truth, told, told of the good blocks) of one block."""
    missing = -1.0
    while missing < 0.1:
        tips, axes = _two_poses(rng)
        near = [_to_frusta(part()[3], t, a, _holder(LONGER)).min() for t, a in zip(tips, axes)]
        missing = HOLDER_MM - min(near) - part()[2].error_mm
    posted = _blocks(tips, axes)
    told, good = (_replayed(posted, t).get("holder_contact", 0.0) for t in (LONGER, BALL))
    return missing, told, good


def _body(draws):
    """A body stands where the holder comes by between two blocks' ends, and nowhere near it there."""
    return [_with_body(rng) for rng in draws]


def _with_body(rng):
    """(truth, told, told of the good blocks) of one block."""
    frusta, share, depth = _holder(BALL), np.linspace(0.0, 1.0, 41), np.ones(41)
    while depth[[0, -1]].min() < 0.3 or depth[20] > -0.2:
        turn, tilt = rng.uniform(0, 2 * np.pi) + np.array([0.0, rng.uniform(1.0, 2.0)]), rng.uniform(0.3, 0.8)
        axes = np.column_stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), [np.cos(tilt)] * 2])
        tips = rng.uniform((-5, -5, 40), (5, 5, 60)) + np.array([[0.0, 0, 0], rng.uniform(-8, 8, 3)])
        middle, tip = _unit(axes.sum(axis=0)), tips.mean(axis=0)
        out = _unit(np.cross(middle, rng.normal(size=3)))
        body = tip + rng.uniform(BALL.stick_out_mm + 5, BALL.stick_out_mm + 40) * middle + frusta[0, 1] * out
        corners = body + BODY_MM * np.stack(np.meshgrid(*3 * [[-1, 0, 1]]), axis=-1).reshape(-1, 3)
        depth = np.array([_to_frusta(corners, *_between(tips, axes, s), frusta).min() for s in share])
    box = Fixture(name="body", min_mm=tuple(body - BODY_MM), max_mm=tuple(body + BODY_MM))
    posted = _blocks(tips, axes)
    told, good = (_replayed(posted, BALL, fixtures=f).get("fixture_contact", 0.0) for f in ((box,), ()))
    return float(-depth.min()), told, good


def _holder(a_tool):
    """(k, 4) frusta of a tool's holder."""
    frusta = a_tool.non_cutting_frusta()
    return frusta[frusta[:, 0] >= a_tool.stick_out_mm - 1e-9]


def _to_frusta(points, tip, axis, frusta):
    """(n,) signed distances of points to frusta (k, 4) over a pose, in the half plane, from the corners of the outline."""
    up = (points - tip) @ axis
    r = np.linalg.norm(points - tip - up[:, None] * axis, axis=1)
    least = np.full(len(points), np.inf)
    for z0, r0, z1, r1 in frusta:
        corners, at = np.array([(0.0, z0), (r0, z0), (r1, z1), (0.0, z1)]), np.column_stack([r, up])
        worst, near = np.full(len(r), -np.inf), np.full(len(r), np.inf)
        for a, b in zip(corners[:-1], corners[1:]):
            e = b - a
            t = np.clip((at - a) @ e / (e @ e), 0, 1)
            near = np.minimum(near, np.linalg.norm(at - a - t[:, None] * e, axis=1))
            worst = np.maximum(worst, (at - a) @ (e[1], -e[0]) / np.linalg.norm(e))
        least = np.minimum(least, np.where(worst > 0, near, worst))
    return least


def _between(tips, axes, share):
    """Tip on the straight way and axis on the great circle between two poses."""
    angle = np.arccos(np.clip(axes[0] @ axes[1], -1, 1))
    axis = (np.sin((1 - share) * angle) * axes[0] + np.sin(share * angle) * axes[1]) / np.sin(angle)
    return tips[0] + share * (tips[1] - tips[0]), axis


def _unit(v):
    return v / np.linalg.norm(v)
