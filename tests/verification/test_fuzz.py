"""Random programs in two clampings: the verdict's deviations against points classified by brute force.

The other side shares nothing with the simulation: tips at steps of every move, the cutter's body written down anew,
ever finer steps round the nearest ones.  Its distance is never below the true one.
"""

from functools import cache

import cadquery as cq
import numpy as np
import pytest
from known_programs import program, random_moves, tool

from cuspline.design import Setup
from cuspline.kernel import brep
from cuspline.kernel.tessellation import tessellate
from cuspline.program.program import Kind, Plane
from cuspline.stock.shapes import BoxShape
from cuspline.stock.swept import swept_paths
from cuspline.stock.workpiece import Workpiece
from cuspline.verification.climbing import Ground
from cuspline.verification.reach import drop_mesh
from cuspline.verification.residuals import LIMIT_MM, SampledFaces, residuals
from cuspline.verification.samples import sample_faces

CORPUS = (3, 8, 21, 34, 55, 89)        # seeds; one that ever failed stays
SIZE_MM, ALLOWANCE_MM = np.array((20.0, 16.0, 10.0)), 1.0
BLOCK = brep.the_solid(cq.Workplane().box(*SIZE_MM, centered=False))
SPACING_MM = 4.0
CUTTERS = {1: tool("ball", 6.0), 2: tool("bull_nose", 8.0, 1.5, number=2), 3: tool("flat", 5.0, number=3)}
SETUPS = (Setup(name="setup-1", wcs_in_words="", faces=("top",)),
          Setup(name="setup-2", wcs_in_words="", faces=("bottom",), wcs_origin_mm=(0, 16, 0), wcs_z=(0, 0, -1)))
CLOSE_MM = 1e-4           # brute force to its last step, chords of arcs and traced rays
GRAZE = 0.01              # of a ray: where it only grazes the swept volume it may be taken to miss it
STEPS, SPREAD, BEST = 24, 6, 6


def random_clamping(rng, setup):
    """A program of ten random moves with two tools, mostly over and in the upper side."""
    top = SIZE_MM[2] if setup is SETUPS[0] else 0.0
    low, high = np.array((-3.0, -3.0, top - 1.5)), np.array((23.0, 19.0, top + 4.0))
    start, moves = random_moves(rng, 10, low, high, arcs=True)
    tools = np.repeat(rng.choice([1, 2, 3], 2, replace=False), 5)
    return program(start, moves, tool=tools)


@cache
def cut(seed):
    """(programs, Residuals after both clampings of the faces of each) of a seed."""
    rng = np.random.default_rng(seed)
    up = [f.shape for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] > -0.5]
    down = [f.shape for f in brep.faces_of(BLOCK) if f.middle.normal[0, 2] < -0.5]
    programs = [(random_clamping(rng, s), s.frame) for s in SETUPS]
    piece = Workpiece(blank=BoxShape(min_mm=(-ALLOWANCE_MM,) * 3, max_mm=SIZE_MM + ALLOWANCE_MM))
    for posted, frame in programs:
        piece = piece.after(frame, swept_paths(posted, CUTTERS))
    mesh, exact = tessellate(BLOCK, 0.01), brep.faces_of(BLOCK)
    grounds = [Ground.of_faces([f for f in exact if any(f.shape.IsSame(s) for s in shapes)]) for shapes in (up, down)]
    sampled = [SampledFaces(samples=sample_faces(shapes, SPACING_MM), ground=ground, spacing_mm=SPACING_MM,
                            feeds=frame.turn_out(posted.end_mm - posted.start_mm),
                            drops=drop_mesh(frame.into(mesh.vertices_mm), mesh.triangles))
               for shapes, ground, (posted, frame) in zip((up, down), grounds, programs)]
    found = residuals(piece, sampled, None, 3.0, 0.01, 0.003)
    return programs, [after_all for after_all, _ in found]


# brute force ------------------------------------------------------------------------------------------


def body_mm(cutter, beside, above):
    """Signed distance of points to a cutter that goes on upward from its tip: ball, or disc with a rounded corner."""
    r = {"ball": cutter.diameter_mm / 2, "flat": 0.0}.get(cutter.type, cutter.corner_radius_mm)
    out, below = beside - (cutter.diameter_mm / 2 - r), r - above
    both = (out > 0) & (below > 0)
    return np.where(both, np.hypot(out, below), np.maximum(out, below)) - r


def tips(posted, row, share):
    """(k, 3) tips of moves at shares of their way, straight from what G1, G2 and G3 mean."""
    s, e, c = posted.start_mm[row], posted.end_mm[row], posted.center_mm[row]
    out = s + share[:, None] * (e - s)
    for plane in Plane:
        i, j, _ = plane.axes
        a = np.flatnonzero((posted.kind[row] >= Kind.ARC_CW) & (posted.plane[row] == plane))
        a0, a1 = (np.arctan2(p[a, j] - c[a, j], p[a, i] - c[a, i]) for p in (s, e))
        left = posted.kind[row[a]] == Kind.ARC_CCW
        turn = np.where(left, (a1 - a0) % (2 * np.pi), -((a0 - a1) % (2 * np.pi)))
        at, radius = a0 + share[a] * turn, np.hypot(s[a, i] - c[a, i], s[a, j] - c[a, j])
        out[a, i], out[a, j] = c[a, i] + radius * np.cos(at), c[a, j] + radius * np.sin(at)
    return out


def swept_mm(posted, points):
    """(n,) least distance of points (WCS) to the moving cutter; never below the true one."""
    n = len(points)
    row = np.tile(np.repeat(np.arange(len(posted)), STEPS + 1), (n, 1))
    share, width = np.tile(np.tile(np.linspace(0, 1, STEPS + 1), len(posted)), (n, 1)), 1.0 / STEPS
    for _ in range(6):
        way = points[:, None] - tips(posted, row.ravel(), share.ravel()).reshape(*row.shape, 3)
        beside, d = np.hypot(way[..., 0], way[..., 1]), np.empty(row.shape)
        for number in np.unique(posted.tool):
            mine = posted.tool[row] == number
            d[mine] = body_mm(CUTTERS[int(number)].cutter, beside[mine], way[..., 2][mine])
        best = np.argpartition(d, BEST, axis=1)[:, :BEST]
        row = np.repeat(np.take_along_axis(row, best, axis=1), 2 * SPREAD + 1, axis=1)
        share = np.repeat(np.take_along_axis(share, best, axis=1), 2 * SPREAD + 1, axis=1)
        share = np.clip(share + width * np.tile(np.linspace(-1, 1, 2 * SPREAD + 1), BEST), 0, 1)
        width /= SPREAD
    return d.min(axis=1)


def left_mm(programs, points):
    """(n,) how far points lie in what both clampings leave, by brute force: positive in stock, negative in air."""
    in_wcs = (points, np.column_stack([points[:, 0], 16 - points[:, 1], -points[:, 2]]))
    billet = np.minimum(points + ALLOWANCE_MM, SIZE_MM + ALLOWANCE_MM - points).min(axis=1)
    return np.min([billet, *(swept_mm(posted, q) for (posted, _), q in zip(programs, in_wcs))], axis=0)


@pytest.mark.parametrize("seed", CORPUS)
def test_deviations_are_what_brute_force_finds_along_the_normals(seed):
    programs, verdicts = cut(seed)
    for found in verdicts:
        inner = np.flatnonzero(~found.samples.is_border)
        chosen = inner[np.linspace(0, len(inner) - 1, 24).astype(int)]
        p, n, d = found.samples.points_mm[chosen], found.samples.normals[chosen], found.deviation_mm[chosen]
        is_cut = np.abs(d) < LIMIT_MM - 1e-6
        ends = left_mm(programs, p + d[:, None] * n)
        assert np.abs(ends[is_cut]).max(initial=0.0) < CLOSE_MM            # a surface is just there
        for share in (0.31, 0.93):
            between = left_mm(programs, p + (share * d)[:, None] * n) * np.sign(d)
            assert (between > -CLOSE_MM - GRAZE * np.abs(d)).all()          # and none before it


def test_brute_force_knows_a_wrong_deviation():
    """A tenth of a millimetre more or less is seen at once."""
    programs, (found, _) = cut(CORPUS[0])
    size = np.abs(found.deviation_mm)
    chosen = np.flatnonzero(~found.samples.is_border & (size > 0.3) & (size < 1.7))[:10]
    p, n, d = found.samples.points_mm[chosen], found.samples.normals[chosen], found.deviation_mm[chosen]
    for off in (-0.1, 0.1):
        ends = left_mm(programs, p + (d + off)[:, None] * n)
        assert len(chosen) > 5 and (np.abs(ends) > 10 * CLOSE_MM).all()
