"""Bodies of the machine on the tool's side against part, stock, fixtures and all that carries the part, over a whole program.

Seen from an obstacle's link a body goes along with every joint that stands between the two.  It is proven clear of the
obstacle over whole blocks of joints, between their ends too; where it is not, the worst of some poses on the way says by how much.
The blank as it comes stands for the stock: what has been cut is inside it.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.design.fixtures import placed_fixtures
from cuspline.program.arcs import Arc
from cuspline.program.positions import led_to
from cuspline.program.program import Kind, Plane
from cuspline.replay.clearance import tool_segments
from cuspline.replay.machine_bodies import STEP_MM, mesh_of, rotary_links
from cuspline.replay.replay_checks import Reporter
from cuspline.replay.scene import HOLDER_CLEARANCE_MM
from cuspline.shop.kinematics import LINEARS
from cuspline.shop.machines import BED, StepBody
from cuspline.stock.shapes import BoxShape, CylinderShape
from cuspline.stock.tree import morton_order
from cuspline.values import fixed_math as fixed
from cuspline.values.arrays import for_kernel
from cuspline.values.frames import Frame
from cuspline.verification import body_kernels as kernels
from cuspline.verification.turning import at_end_of_move

PART = "part"                   # link of what is clamped
TOOL = "tool"
CHORD_MM = 0.01                 # arcs are judged by chords that stay so close
UNDECIDED_MM = 1e-3             # a body that keeps its distance by less counts as too near
CAP_MM = 100.0                  # distances beyond are not told apart
POSES = 33                      # looked at in a block that is too near, for how near
FEW_POSES = 5                   # where the obstacle is of very many pieces
MOST_NEAR = 8                   # such blocks of a position that are looked at there, evenly out of all: it is a collision anyway
SECTORS = 24                    # of what turns with the tool, round it
CONVEX_MM = 1e-6
MOST_CORNERS = 20_000           # of a mesh that is asked whether it is convex
SIDES = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)], float) - 1.0
OUTWARD = SIDES / np.sqrt((SIDES ** 2).sum(axis=1))[:, None]        # to a cube's faces, edges and corners


@dataclass(frozen=True, eq=False, kw_only=True)
class Solid:
    """Something in the coordinates of its link, machine coordinates with every axis at 0."""

    name: str
    link: str                   # axis that it moves with, "bed" or "part"
    pieces: kernels.Pieces
    error_mm: float             # how far it may stand out of them
    kind: str                   # of the finding of a machine's body that comes too near


def body_findings(moves, position, setups, job, tools):
    """Findings of machine bodies that come too near over a clamping's whole program.

    Args:
        moves: PostedMoves of all of it, in the WCS of the clamping.
        position: (n,) indexed position of each move; -1: it leads to the next.
        setups: design.Setup of each.   job: Job.   tools: {number: Tool}.
    Returns:
        [tuple of Finding] a position: of every body and obstacle the one where they come nearest.
    """
    found, machine, held = [[] for _ in setups], job.machine, setups[0]
    bodies = [_solid_of(b, "fixture_contact") for b in machine.bodies if b.link in machine.chain[machine.chain.index(BED) + 1:]]
    ahead = [_solid_of(b, "fixture_contact") for b in machine.bodies if b.link in machine.chain[:machine.chain.index(BED) + 1]]
    if not bodies and not ahead:
        return [() for _ in setups]
    blocks, report = Blocks.of(moves, position), Reporter(moves, held.name, held.frame)
    clamped = _clamped(held, job)
    pairs = [(b, o, None) for b in bodies for o in (*clamped, *ahead)]
    pairs += [(tool, o, n) for n, tool in _tools_of(tools, machine).items() for o in ahead if o.link not in rotary_links(machine)]
    for body, obstacle, number in pairs:
        for finding, k in _near(body, obstacle, blocks.with_tool(number), report, machine):
            found[k].append(finding)
    return [tuple(f) for f in found]


@dataclass(frozen=True, eq=False, kw_only=True)
class Blocks:
    """Blocks in which joints run evenly, rows of the moves that they belong to."""

    row: np.ndarray             # (n,) of the moves
    starts: np.ndarray          # (n, m) joints, mm and rad
    ends: np.ndarray
    position: np.ndarray        # (n,) in which it is, or to which it leads
    tool: np.ndarray            # (n,)

    @classmethod
    def of(cls, moves, position):
        """Of PostedMoves; left out: what begins or ends at an unknown place.  Arcs as chords."""
        joints = np.column_stack([moves.machine_end_mm, np.radians(moves.rotary_deg)])
        starts = np.vstack([np.full((1, joints.shape[1]), np.nan), joints])[:-1]
        rows = np.flatnonzero(np.isfinite(joints).all(axis=1) & np.isfinite(starts).all(axis=1))
        ways = {k: _chords(moves, k, joints[k]) for k in rows[moves.kind[rows] >= Kind.ARC_CW].tolist()}
        counts = np.ones(len(moves), np.int64)
        counts[list(ways)] = [len(way) for way in ways.values()]
        row = np.repeat(rows, counts[rows])
        starts, ends = starts[row], joints[row]
        for k, way in ways.items():
            first = np.searchsorted(row, k)
            ends[first:first + len(way)] = way
            starts[first + 1:first + len(way)] = way[:-1]
        return cls(row=row, starts=for_kernel(starts), ends=for_kernel(ends), position=led_to(position)[row], tool=moves.tool[row])

    def with_tool(self, number):
        """Those with one tool in the spindle; None: all."""
        if number is None:
            return self
        mine = self.tool == number
        return Blocks(row=self.row[mine], starts=for_kernel(self.starts[mine]), ends=for_kernel(self.ends[mine]),
                      position=self.position[mine], tool=self.tool[mine])


def _chords(moves, k, end):
    """(p, m) joints at the ends of the chords of an arc, whose own end is the last."""
    arc = Arc(moves.start_mm[k], moves.end_mm[k], moves.center_mm[k], Plane(moves.plane[k]), moves.kind[k])
    arc.sweep_rad += 2 * np.pi * moves.turns[k]
    noses = np.array(arc.chords(CHORD_MM)) + (end[:LINEARS] - moves.end_mm[k])
    return np.column_stack([noses, np.tile(end[LINEARS:], (len(noses), 1))])


def _near(body, obstacle, blocks, report, machine):
    """(Finding, position) of each position in which a body comes too near to an obstacle."""
    between = _between(machine, body.link, obstacle.link)
    margin = HOLDER_CLEARANCE_MM + CHORD_MM + body.error_mm + obstacle.error_mm
    is_clear = np.ones(len(blocks.row), np.bool_)
    kernels.over_blocks(body.pieces, obstacle.pieces, between, blocks.starts, blocks.ends, margin, margin + CAP_MM, UNDECIDED_MM,
                        is_clear)
    near = np.flatnonzero(~is_clear)
    is_fine = len(obstacle.pieces.first) > kernels.MOST_PIECES
    looked, poses = (_some_of(near, blocks.position[near]), FEW_POSES) if is_fine else (near, POSES)
    gaps = np.empty(len(looked))
    kernels.gaps(body.pieces, obstacle.pieces, between, blocks.starts[looked], blocks.ends[looked], poses, OUTWARD, margin, gaps)
    gaps -= body.error_mm + obstacle.error_mm
    for position in np.unique(blocks.position[looked]).tolist():
        mine = np.flatnonzero(blocks.position[looked] == position)
        worst = mine[gaps[mine].argmin()]
        found = _finding(body, obstacle, float(gaps[worst]), report, int(blocks.row[looked[worst]]))
        yield replace(found, is_at_least=is_fine), position


def _some_of(near, position):
    """MOST_NEAR of the rows (n,) of every position (n,), or all where there are no more."""
    each = [near[position == k] for k in np.unique(position)]
    return np.concatenate([rows[::max(1, -(-len(rows) // MOST_NEAR))] for rows in each] or [near])


def _finding(body, obstacle, gap_mm, report, row):
    """Finding of two that are so near to each other in a move; its place is where the tip stands at its end."""
    kind = obstacle.kind if obstacle.link == PART else body.kind
    how = (f"are {gap_mm:.3f} mm from each other there, {HOLDER_CLEARANCE_MM:g} mm are wanted" if gap_mm > 0 else
           "are in each other there")
    advice = (f"the machine's {body.name} and {obstacle.name} {how}: retract farther, raise the part on the table, take a longer "
              "tool, or turn the other way round")
    found = report.finding(kind, row, max(HOLDER_CLEARANCE_MM - gap_mm, UNDECIDED_MM), report.posted.end_mm[row], advice)
    return at_end_of_move(found, report.posted)


def _between(machine, link, obstacle):
    """kernels.Between: joints from an obstacle's link to a body's."""
    chain, order = machine.kinematics, machine.chain
    first = 0 if obstacle == PART else order.index(obstacle)
    last = len(order) if link == TOOL else order.index(link) + 1
    columns = np.array([chain.letters.index(letter) for letter in order[first:last] if letter != BED], np.int64)
    links = chain.links
    return kernels.Between(columns, *(for_kernel(getattr(links, name)[columns], dtype) for name, dtype in (
        ("is_rotary", np.bool_), ("direction", np.float64), ("pivot", np.float64))))


# what there is ---------------------------------------------------------------------------------


def _solid_of(body, kind):
    """Solid of a machines.Body."""
    error = STEP_MM if isinstance(body.shape, StepBody) else 0.0
    pieces = pieces_of(*mesh_of(body), is_convex=not isinstance(body.shape, StepBody))
    return Solid(name=body.name, link=body.link, pieces=pieces, error_mm=error, kind=kind)


def _clamped(held, job):
    """[Solid] of the blank and the fixtures."""
    zero = np.array(job.machine.zero_mm(held.zero_height_mm))
    vertices, triangles = job.stock.shape.mesh
    seen = [("the blank", job.stock.shape, held.clamped_frame.into(vertices), triangles, "holder_contact")]
    seen += [(f.name, f.shape, *f.mesh, "fixture_contact") for f in placed_fixtures(held, held.clamped_frame)]
    return [Solid(name=name, link=PART, kind=kind, error_mm=shape.error_mm, pieces=pieces_of(
        vertices + zero, triangles, is_convex=isinstance(shape, (BoxShape, CylinderShape))))
        for name, shape, vertices, triangles, kind in seen]


def _tools_of(tools, machine):
    """{number: Solid} of tools in their holders, with what stands round the spindle's nose."""
    found, along = {}, Frame.along(machine.kinematics.spindle)
    for number, tool in tools.items():
        if tool.head is None:
            pieces = [_frustum(row) - (0.0, 0.0, tool.length_mm) for row in tool_segments(tool, machine.spindle_head)]
            tree = _tree(along.out(np.vstack(pieces)), 2 * SECTORS * np.arange(len(pieces) + 1))
            found[number] = Solid(name=f"tool T{number}", link=TOOL, pieces=tree, error_mm=0.0, kind="fixture_contact")
    return found


def _frustum(segment):
    """(p, 3) corners round a segment of a tool, which they hold."""
    z0, r0, z1, r1, grow = segment
    angle = np.arange(SECTORS) * (2 * np.pi / SECTORS)
    wide = 1.0 / fixed.cos(np.pi / SECTORS)
    ring = lambda r, z: np.column_stack([wide * r * fixed.cos(angle), wide * r * fixed.sin(angle), np.full(SECTORS, z)])
    return np.vstack([ring(r0 + grow, z0 - grow), ring(r1 + grow, z1 + grow)])


def pieces_of(vertices, triangles, is_convex=False):
    """kernels.Pieces of a closed mesh: itself where it is convex, else its triangles.

    Args:
        vertices: (v, 3).   triangles: (t, 3) rows, counter-clockwise seen from outside.   is_convex: False: it is looked at.
    """
    vertices, triangles = np.asarray(vertices, float), np.asarray(triangles)
    mesh = for_kernel(vertices), for_kernel(triangles, np.int64)
    if is_convex or len(vertices) <= MOST_CORNERS and kernels.is_convex(*mesh, CONVEX_MM):
        corners = vertices[np.unique(triangles)]
        return _tree(corners, np.array([0, len(corners)]))
    return _tree(vertices[triangles].reshape(-1, 3), 3 * np.arange(len(triangles) + 1))


def _tree(corners, first):
    """kernels.Pieces of convex pieces: their corners (p, 3), piece after piece, and the row at which each begins (k + 1,)."""
    spheres = kernels.spheres(for_kernel(corners), for_kernel(first, np.int64))
    order = morton_order(spheres[:, :3])
    counts = np.diff(first)[order]
    begins = np.concatenate([[0], np.cumsum(counts)])
    rows = np.arange(begins[-1]) + np.repeat(first[:-1][order] - begins[:-1], counts)
    leaves = 1
    while leaves < len(order):
        leaves *= 2
    return kernels.Pieces(for_kernel(corners[rows]), for_kernel(begins, np.int64),
                          kernels.tree_of(for_kernel(spheres[order]), leaves), leaves)
