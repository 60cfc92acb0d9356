"""A propeller's triangles on the parameters of its own faces: watertight because neighbours share their nodes.

The kernel's mesher needs minutes for what these grids give in a second, and its triangles cannot be halved in
step.  Nodes lie on the exact surfaces; how far the surfaces bulge out between them is measured.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.designs.propellers.blade import about_x
from cuspline.values import fixed_math as fixed

SPREAD = 1.05               # on a density, when a bulge is too large
SHARE = 0.5                 # of the deviation, that one direction may use
ROUNDS = 5
DENSITY = {"along": 1, "up": 10, "across": 3, "tip": 4, "hub": 16}        # for volumes, times 2, 4 and 8
COARSEST = {"along": 1, "up": 12, "across": 4, "tip": 4, "hub": 4}


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh:
    """Closed triangles, counter-clockwise seen from outside."""

    vertices_mm: np.ndarray     # (n, 3)
    triangles: np.ndarray       # (m, 3)
    face: np.ndarray            # (m,) index into names
    names: tuple[str, ...]      # of the faces, as in the solid
    deviation_mm: float         # measured: exact points over triangles' middles and sides

    @property
    def volume_mm3(self):
        a, b, c = np.moveaxis(self.vertices_mm[self.triangles], 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def propeller_mesh(made, deviation_mm):
    """Mesh of a PropellerSolid without what is cut out of its hub.

    Args:
        made: PropellerSolid.
        deviation_mm: largest deviation wanted.
    Returns:
        Mesh; its own `deviation_mm` tells what was reached within ROUNDS rounds of refinement.
    """
    density, allowed = dict(COARSEST), SHARE * deviation_mm
    for _ in range(ROUNDS):
        mesh, bulge = _meshed(made, density)
        if mesh.deviation_mm <= deviation_mm:
            return mesh
        most = max(bulge.values())
        if most <= allowed:                     # each is small enough, and in the middle of a cell their sum is not
            allowed = most * deviation_mm / mesh.deviation_mm / SPREAD
        for name, value in bulge.items():
            if value > allowed:
                more = density[name] * SPREAD * np.sqrt(value / allowed)
                density[name] = int(np.ceil(max(more, density[name] + 1)))
    return mesh


def extrapolated_volume_mm3(made):
    """Volume without the hub's cuts, by meshes of three densities in step: errors of second and fourth order cancel."""
    first, second, third = (_meshed(made, {name: n * value for name,
                                           value in DENSITY.items()})[0].volume_mm3 for n in (2, 4, 8))
    better = (4 * second - first) / 3, (4 * third - second) / 3
    return (16 * better[1] - better[0]) / 15


class _Weld:
    """Vertices and triangles of blocks that share their borders."""

    def __init__(self):
        self.points, self.triangles, self.faces, self.count = [], [], [], 0

    def add(self, points):
        """Ids of new vertices (n, 3)."""
        self.points.append(points)
        self.count += len(points)
        return np.arange(self.count - len(points), self.count)

    def block(self, points, face, is_flipped, **given):
        """Add a grid of points (n, m, 3); borders that are there already come as ids.

        Args:
            given: first, last: ids of the first and last row; left, right: of the first and last column.
        Returns:
            (n, m) ids.
        """
        n, m = points.shape[:2]
        ids = np.full((n, m), -1)
        for name, where in (("first", np.s_[0]), ("last", np.s_[-1]), ("left", np.s_[:, 0]), ("right", np.s_[:, -1])):
            if given.get(name) is not None:
                ids[where] = given[name]
        fresh = ids < 0
        ids[fresh] = self.add(points[fresh])
        self.quads(ids[:-1, :-1].ravel(), ids[1:, :-1].ravel(), ids[1:, 1:].ravel(), ids[:-1, 1:].ravel(), face,
                   is_flipped)
        return ids

    def quads(self, a, b, c, d, face, is_flipped):
        """Add cells by the ids (n,) of their corners in turn, cut from a to c; sides of no length are left out."""
        rows = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
        rows = rows[(rows[:, 0] != rows[:, 1]) & (rows[:, 1] != rows[:, 2]) & (rows[:, 2] != rows[:, 0])]
        self.triangles.append(rows[:, ::-1] if is_flipped else rows)
        self.faces.append(np.full(len(rows), face))


def _meshed(made, density):
    """(Mesh, {direction: largest bulge mm})."""
    weld, names, bulge, worst = _Weld(), [], dict.fromkeys(density, 0.0), 0.0
    blade_grids, hub_grids = _blade_grids(made, density), _hub_grids(made, density)
    for kind, fine in [*blade_grids, *(("hub", g) for g in hub_grids)]:
        across = {"blade": "up", "fillet": "across", "tip": "tip", "hub": "hub"}[kind]
        bulge["along"] = max(bulge["along"], _bulge_mm(fine[:, ::2]))
        bulge[across] = max(bulge[across], _bulge_mm(fine[::2].transpose(1, 0, 2)))
        worst = max(worst, _middle_bulge_mm(fine))
    blades, is_flipped = made.blade.table.blades, made.blade.outward < 0
    turns = [about_x(2 * np.pi * k / blades).T for k in range(blades)]          # to be multiplied from the right
    columns = [name for name, _, _ in made.blade.columns]
    feet = [_weld_blade(weld, names, k, columns, blade_grids, turn, is_flipped) for k, turn in enumerate(turns)]
    _weld_hub(weld, names, made, hub_grids, turns, feet, is_flipped)
    return Mesh(vertices_mm=np.concatenate(weld.points), triangles=np.concatenate(weld.triangles),
                face=np.concatenate(weld.faces), names=tuple(names), deviation_mm=max(worst, *bulge.values())), bulge


def _bulge_mm(fine):
    """How far every second row's places stray from the chords between the others along the first axis."""
    chord, off = fine[2::2] - fine[:-1:2], fine[1::2] - (fine[2::2] + fine[:-1:2]) / 2
    size = np.maximum(np.einsum("ijk,ijk->ij", chord, chord), 1e-300)
    off = off - chord * (np.einsum("ijk,ijk->ij", off, chord) / size)[..., None]
    return float(np.linalg.norm(off, axis=-1).max())


def _middle_bulge_mm(fine):
    """How far the middles of the cells stray from the diagonals that cut them, square to the two triangles."""
    a, b, c, d = fine[:-1:2, :-1:2], fine[2::2, :-1:2], fine[2::2, 2::2], fine[:-1:2, 2::2]
    off, worst = fine[1::2, 1::2] - (a + c) / 2, 0.0
    for third in (b, d):
        normal = np.cross(c - a, third - a)
        length = np.linalg.norm(normal, axis=-1)
        keep = length > 1e-9
        worst = max(worst, float(np.abs(np.einsum("ik,ik->i", off[keep],
                                                  normal[keep]) / length[keep]).max(initial=0.0)))
    return worst


def _index(names, name):
    if name not in names:
        names.append(name)
    return names.index(name)


def _round_the_loop(blade, low, high, density):
    """Loop angles of a column's nodes at twice the density: every interval between its knots cut alike."""
    knots, count = np.unique(blade.surface.knots_u), 2 * density["along"]
    nodes = np.r_[low, knots[(knots > low + 1e-9) & (knots < high - 1e-9)], high]
    return np.interp(np.arange(count * (len(nodes) - 1) + 1) / count, np.arange(len(nodes)), nodes)


def _blade_grids(made, density):
    """[(kind, points at twice the density (2n+1, 2m+1, 3))], columns in turn; every second row and column is a node."""
    blade, fillet, top, grids = made.blade, made.fillet, made.blade.v_of_tip, []
    for _, low, high in blade.columns:
        u = _round_the_loop(blade, low, high, density)
        floor = fillet.on_blade(u)[:, 0]
        share = np.linspace(0.0, 1.0, 2 * density["up"] + 1)
        at = lambda v: blade.surface.derivatives(np.repeat(u, v.shape[1]), v.ravel())[:, 0].reshape(*v.shape, 3)
        grids.append(("blade", at(floor[:, None] + share * (top - floor[:, None]))))
        across = np.linspace(0.0, 1.0, 2 * density["across"] + 1)
        ball = fillet.surface.derivatives(np.repeat(u, len(across)), np.tile(across, len(u)))[:, 0]
        grids.append(("fillet", ball.reshape(len(u), len(across), 3)))
        if blade.table.has_round_tip:
            up = np.linspace(top, 1.0, 2 * density["tip"] + 1)
            grids.append(("tip", at(np.broadcast_to(up, (len(u), len(up))))))
    return grids


def _hub_grids(made, density):
    """Four blocks between a root and its sector's border, one a column, from the root out; points at twice the density.

    In x and the angle from the line half way between the roots a sector is a rectangle: face and back look at its
    long sides, the edges at the hub's ends.
    """
    hub, half = made.hub, np.pi / made.blade.table.blades
    loops = {}
    for name, low, high in made.blade.columns:
        angle, x = made.fillet.on_hub(_round_the_loop(made.blade, low, high, density)).T
        loops[name] = np.stack([angle - made.half_way(x), x], axis=1)
    nose, tail = _ends(made, loops)
    face_side = _side_of_face(loops)
    t = loops["face"][:, 1]
    t = np.maximum.accumulate(np.clip((t - t[0]) / (t[-1] - t[0]), 0.0, 1.0))
    t = (t + np.linspace(0.0, 1.0, len(t))) / 2                 # never two nodes in one place
    along = tail + (nose - tail) * t
    across = half * face_side * (1 - 2 * np.linspace(0.0, 1.0, len(loops["leading edge"])))
    outer = {"face": np.stack([np.full(len(t), half * face_side), along], axis=1),
             "leading edge": np.stack([across, np.full(len(across), nose)], axis=1),
             "back": np.stack([np.full(len(t), -half * face_side), along[::-1]], axis=1)}
    across = -half * face_side * (1 - 2 * np.linspace(0.0, 1.0, len(loops["trailing edge"])))
    outer["trailing edge"] = np.stack([across, np.full(len(across), tail)], axis=1)
    out, grids = np.linspace(0.0, 1.0, 2 * density["hub"] + 1)[:, None], []
    for name, loop in loops.items():
        flat = loop[:, None] + out * (outer[name] - loop)[:, None]
        angle, x = flat[..., 0] + made.half_way(flat[..., 1]), flat[..., 1]
        grids.append(hub.points(angle.ravel(), x.ravel()).reshape(*angle.shape, 3))
    return grids


def _ends(made, loops):
    """x of the hub's end that the leading edge looks at, and of the other."""
    fore, aft = made.hub.ends_mm
    is_fore = loops["leading edge"][:, 1].mean() < loops["trailing edge"][:, 1].mean()
    return (fore, aft) if is_fore else (aft, fore)


def _side_of_face(loops):
    """+1 where the face looks towards growing polar angle."""
    return 1.0 if loops["face"][:, 0].mean() > loops["back"][:, 0].mean() else -1.0


def _weld_blade(weld, names, k, columns, grids, turn, is_flipped):
    """Blade k with its fillet; returns the ids of its border on the hub, one row a column."""
    bodies, balls, tips = ([fixed.matmul(g[::2, ::2], turn) for kind, g in grids if kind == wanted]
                           for wanted in ("blade", "fillet", "tip"))
    pole = weld.add(tips[0][:1, -1])[0] if tips else None
    made, rows = [], {name: _index(names, name) for name in
                      [f"blade {k + 1} {c}" for c in columns] + [f"fillet {k + 1}", f"blade {k + 1} tip"]}
    for c, column in enumerate(columns):
        beside = lambda part: {"first": made[c - 1][part][-1] if c else None,
                               "last": made[0][part][0] if c == 3 else None}
        body = weld.block(bodies[c], rows[f"blade {k + 1} {column}"], is_flipped, **beside(0))
        ball = weld.block(balls[c], rows[f"fillet {k + 1}"], not is_flipped, **beside(1), left=body[:, 0])
        tip = None
        if tips:
            tip = weld.block(tips[c], rows[f"blade {k + 1} tip"], is_flipped, **beside(2), left=body[:, -1],
                             right=np.full(len(tips[c]), pole))
        made.append((body, ball, tip))
    if not tips:
        _weld_flat_tip(weld, rows[f"blade {k + 1} tip"], [body[:, -1] for body, _, _ in made], is_flipped)
    return [ball[:, -1] for _, ball, _ in made]


def _weld_flat_tip(weld, name, rims, is_flipped):
    """A tip with a chord: face against back, from the middle of one edge to that of the other."""
    face, nose, back, tail = rims
    low = np.concatenate([tail[len(tail) // 2:-1], face, nose[1:len(nose) // 2 + 1]])
    high = np.concatenate([tail[1:len(tail) // 2 + 1][::-1], back[::-1], nose[len(nose) // 2:-1][::-1]])
    weld.quads(low[:-1], low[1:], high[1:], high[:-1], name, is_flipped)


def _weld_hub(weld, names, made, grids, turns, feet, is_flipped):
    """All sectors and the two end faces."""
    face, nose, back, tail = (g[::2, ::2] for g in grids)
    blades, ends = len(turns), {}
    # the face's border of one sector is the back's of a neighbour, with the same nodes the other way round
    borders = [weld.add(fixed.matmul(face[:, -1], turn)) for turn in turns]
    angle = lambda p: fixed.arctan2(p[2], p[1])
    ahead = np.remainder(angle(face[0, -1]) - angle(back[-1, -1]) + np.pi, 2 * np.pi) - np.pi > 0
    index = _index(names, "hub")
    for k, turn in enumerate(turns):
        own, other = borders[k], borders[k - 1 if ahead else (k + 1) % blades][::-1]
        rim_nose = np.r_[own[-1], weld.add(fixed.matmul(nose[1:-1, -1], turn)), other[0]]
        rim_tail = np.r_[other[-1], weld.add(fixed.matmul(tail[1:-1, -1], turn)), own[0]]
        got = []
        for c, (grid, rim) in enumerate(zip((face, nose, back, tail), (own, rim_nose, other, rim_tail))):
            got.append(weld.block(fixed.matmul(grid, turn), index, not is_flipped, left=feet[k][c], right=rim,
                                  first=got[c - 1][-1] if c else None, last=got[0][0] if c == 3 else None))
        ends[k] = (rim_nose, rim_tail)
    fore, _ = made.hub.ends_mm
    for row, grid in ((0, nose), (1, tail)):
        x = float(grid[0, -1, 0])
        middle = int(weld.add(np.array([[x, 0.0, 0.0]]))[0])
        rim = np.concatenate([np.column_stack([ends[k][row][:-1], ends[k][row][1:]]) for k in range(blades)])
        p = np.concatenate(weld.points)[rim[0]]
        rises = p[0, 1] * p[1, 2] - p[0, 2] * p[1, 1] > 0       # from Y towards Z
        is_fore = abs(x - fore) < 1e-9
        rows = np.column_stack([np.full(len(rim), middle), rim if rises != is_fore else rim[:, ::-1]])
        weld.triangles.append(rows)
        weld.faces.append(np.full(len(rows), _index(names, "hub fore end" if is_fore else "hub aft end")))
