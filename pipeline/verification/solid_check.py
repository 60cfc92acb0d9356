"""Second verifier: the stock as a closed solid against the B-rep's solid, one boolean a side.

It shares no formula with the first: heights over a grid instead of distances, a tessellation
instead of sample points, volumes instead of lengths.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cuspline.kernel import solids
from cuspline.stock.swept import is_height_field, signed_distance_mm, stock_height_mm
from cuspline.values import fixed_math as fixed
from cuspline.verification.volumes import Amount, Volumes, amount, volumes

LAYERS = 12               # of the faces' height: what lies under a face by more than a layer is not theirs
BELOW_MM = 0.01           # what is looked at begins so far below a face: deeper, under an overhang, no cutter comes
LEAST_MM3 = 1e-6          # smaller bodies are rounding
SOME = 16                  # places of a body by which it is told on which side of a face it stands
FEW, MORE = 64, 2          # places whose distance to the faces is asked first, and how many times as many then
SURE_MM = 1e-4            # a body counts when the exact height confirms it by more than this
EXACT_MM = 1e-9


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidBody:
    """A connected body of excess or gouge beyond tolerance."""

    kind: str                 # "excess" or "gouge"
    volume_mm3: float
    area_mm2: float           # of its whole surface
    depth_mm: float           # deepest deviation, the tolerance included
    place_mm: tuple[float, float, float]      # of that depth, part coordinates
    min_mm: tuple[float, float, float]
    max_mm: tuple[float, float, float]
    samples: np.ndarray       # indices of the samples next to it


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidComparison:
    """Volumes and bodies of one setup."""

    excess: Amount                    # stock left on the required faces
    gouge: Amount                     # taken away: of any sampled face, and bodies beyond tolerance anywhere
    bodies: tuple[SolidBody, ...]     # beyond tolerance
    artefacts: int                    # bodies that the grid made and the exact height denies, or that stand on faces left alone
    volumes: Volumes                  # held against those of the residuals
    tessellation_mm: float
    pitch_mm: float                   # of the grid


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What is allowed, and how far what is held against each other may be off."""

    excess_mm: float                  # tolerances of the bodies
    gouge_mm: float
    path_error_mm: float              # of the swept paths
    surface_error_mm: float           # of the design's triangles
    ball_radius_mm: float             # smallest ball of the shop


def compare(made, k, part, drops, required, residuals, limits):
    """Stock solid against design solid, as one clamping sees it.

    Excess is what all clampings together leave above its faces; gouges are its own, on any face.

    Args:
        made: stock_solids.StockSolids of the workpiece after all clampings.   k: the clamping's number.
        part: of the whole design its `mesh`, a Tessellation, and its `surface`, a ClosestTree; part coordinates.
        drops: DropMesh of it in the clamping's WCS.
        required: indices of the faces that this clamping cuts.
        residuals: Residuals of these faces after all clampings, and of all faces after this one alone.
        limits: Limits.
    """
    field, (found, own), excess_mm, gouge_mm = made.field(k), residuals, limits.excess_mm, limits.gouge_mm
    tessellation = part.mesh
    frame, low, high = field.frame, field.low, field.high
    vertices, triangles = frame.into(tessellation.vertices_mm), tessellation.triangles
    design = solids.solid_of(vertices, triangles, "the design's tessellation")
    region = _region(vertices, triangles[np.isin(tessellation.face, required)], low, high)
    surface_mm = limits.surface_error_mm
    # one large solid stands at a time
    bodies, artefacts = _bodies("excess", (made.stock(frame, excess_mm) - design) ^ region, _beyond_excess(
        made, k, high[2], excess_mm), excess_mm, _Seen(found, frame, part, required), surface_mm)
    more, others = _bodies("gouge", design - made.field(k, -gouge_mm).solid, _beyond_gouge(made, k, high[2], gouge_mm), gouge_mm,
                           _Seen(own, frame, part), surface_mm)
    held = volumes(lambda prism: _above_mm3(((made.stock(frame) ^ prism) - design) ^ region, _Seen(found, frame, part)),
                   lambda prism: ((design ^ prism) - field.solid).volume(), field,
                   made.piece.cuts[k], drops, found, limits)
    errors = {"path_error_mm": limits.path_error_mm, "surface_error_mm": surface_mm + held.zmap_mm,
              "ball_radius_mm": limits.ball_radius_mm}
    return SolidComparison(
        excess=amount(found, 1.0, excess_mm, bodies, **errors), gouge=amount(own, -1.0, gouge_mm, more, **errors),
        bodies=tuple(bodies + more), artefacts=artefacts + others,
        tessellation_mm=surface_mm, pitch_mm=field.pitch_mm, volumes=held)


def _beyond_excess(made, k, top, by):
    """Function of points (n, 3) in clamping k's WCS: how far stock, no higher than `top`, reaches above them though all cutters
    are grown."""
    cuts = made.piece.cuts
    paths = tuple(p.grown(by) for p in cuts[k].paths)
    others = [(c.frame, tuple(p.grown(by) for p in c.paths)) for j, c in enumerate(cuts) if j != k]

    def beyond_mm(points):
        above = (stock_height_mm(paths, points[:, :2], top) - points[:, 2] if is_height_field(paths)
                 else signed_distance_mm(paths, points))
        far = [signed_distance_mm(grown, frame.into(cuts[k].frame.out(points))) for frame, grown in others]
        return np.min([above, *far], axis=0)

    return beyond_mm


def _beyond_gouge(made, k, top, by):
    """Function of points (n, 3): how far below them clamping k's shrunk cutters have gone; stock is no higher than `top`."""
    paths = tuple(p.grown(-by) for p in made.piece.cuts[k].paths)
    if not is_height_field(paths):
        return lambda points: -signed_distance_mm(paths, points)
    return lambda points: points[:, 2] - stock_height_mm(paths, points[:, :2], top)


def _above_mm3(solid, seen):
    """Volume of what stands on faces that look up; under a thin blade the region holds its other side too."""
    pieces = solids.bodies_of(solid, LEAST_MM3)
    if not pieces:
        return solid.volume()
    some = [p.vertices_mm[::len(p.vertices_mm) // SOME + 1] for p in pieces]
    up = seen.looks_up(np.concatenate(some))
    ends = np.cumsum([0] + [len(v) for v in some])
    return solid.volume() - sum(p.volume_mm3 for p, i, j in zip(pieces, ends, ends[1:]) if up[i:j].mean() < 0.0)


def _region(vertices, triangles, low, high):
    """What stands above the required faces: prisms from just below their triangles up, in layers of like height."""
    corners = vertices[triangles]
    e, f = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    triangles = triangles[e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0] > 1e-12]
    bottom = vertices[triangles, 2].min(axis=1)
    layers = np.linspace(bottom.min(initial=np.inf), bottom.max(initial=-np.inf), LAYERS + 1)[:-1] if len(bottom) else []
    layer = np.searchsorted(layers, bottom, side="right") - 1
    span = lambda at: (max(bottom[at].min() - BELOW_MM, low[2] - 1.0), high[2] + 1.0)
    prisms = [solids.prism_within([vertices[loop, :2] for loop in outlines(triangles[layer == k])], *span(layer == k))
              for k in np.unique(layer)]
    return solids.united(prisms)


def outlines(triangles):
    """Closed loops of vertices round triangles (m, 3), the triangles on the left: sides that two of them share cancel."""
    sides = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    count = int(sides.max(initial=-1)) + 1
    one_way, times = np.unique(sides[:, 0] * count + sides[:, 1], return_counts=True)
    back = one_way % count * count + one_way // count
    at = np.searchsorted(one_way, back).clip(max=max(len(one_way) - 1, 0))
    left = np.maximum(times - np.where(one_way[at] == back, times[at], 0), 0)
    begin, end = np.repeat(one_way // count, left), np.repeat(one_way % count, left)
    follows = np.empty(len(begin), np.int64)
    follows[np.argsort(end, kind="stable")] = np.argsort(begin, kind="stable")      # as many end at a vertex as begin there
    loops, is_open = [], np.ones(len(begin), bool)
    for first in range(len(begin)):
        side, loop = first, []
        while is_open[side]:
            is_open[side] = False
            loop.append(begin[side])
            side = follows[side]
        loops += [np.array(loop)] if loop else []
    return loops


@dataclass(frozen=True, eq=False)
class _Seen:
    """What samples and exact faces say of places in a clamping's WCS."""

    found: object             # Residuals
    frame: object             # the WCS seen from the part
    part: object              # see `compare`
    faces: object = None      # indices of the faces whose places count; None: all.  What leans over them may stand on others

    def at_most(self, places):
        """Nearest sample (n,), and how far places (n, 3) lie off the design (n,), mm, along that sample's normal: the most that
        counts.  Beside a wall, where the normal is another face's, the design is nearer."""
        samples = self.found.samples
        points, normals = self.frame.into(samples.points_mm), self.frame.turn_into(samples.normals)
        near = cKDTree(points).query(places)[1]
        return near, np.abs(np.einsum("nc,nc->n", places - points[near], normals[near]))

    def deepest(self, places, at_most):
        """(largest depth in mm, its row) of places (n, 3) in the WCS; the depth of one is `at_most` (n,) or its distance to
        the nearest face, whichever is less; -1 where that face does not count.  Without places: -1 and row 0.

        Faces are asked from the deepest place on, a few at a time, until no other can be deeper: on a hole's axis, where
        all its wall is as near, an answer takes long.
        """
        order = np.argsort(-at_most, kind="stable")
        best, row, first, few = -1.0, 0, 0, FEW
        while first < len(order) and at_most[order[first]] > best:
            rows = order[first:first + few]
            first, few = first + few, MORE * few
            depth = at_most[rows].copy()
            deep = depth > SURE_MM
            if deep.any():
                depth[deep] = np.minimum(depth[deep], self._off_mm(places[rows[deep]]))
            k = int(depth.argmax())
            if depth[k] > best:
                best, row = float(depth[k]), int(rows[k])
        return best, row

    def any_counts(self, places):
        """Whether some of places (n, 3) in the WCS lie at a face that counts."""
        return bool(len(places)) and (self.faces is None or bool((self._off_mm(places) >= 0.0).any()))

    def looks_up(self, places):
        """(n,) height of the normal of the face that is nearest to each of places (n, 3) in the WCS."""
        return np.nan_to_num(self.frame.turn_into(self.part.surface.closest_points(self.frame.out(places)).normal)[:, 2])

    def _off_mm(self, places):
        """(n,) distances of places (n, 3) from the nearest face; -1 where that is one that does not count."""
        own = self.frame.out(places)
        near = self.part.surface.closest_points(own)
        if self.faces is None:
            return near.distance_mm
        counts = np.isin(near.face, self.faces)
        edge = np.flatnonzero(near.is_edge & ~counts)
        for face in self.faces:             # an edge belongs to both
            counts[edge] |= self.part.surface.closest_points(own[edge], face).distance_mm <= near.distance_mm[edge] + EXACT_MM
        return np.where(counts, near.distance_mm, -1.0)


def _bodies(kind, solid, beyond_mm, tolerance, seen, tessellation_mm):
    """Real bodies, and how many are none.

    One is real where the exact stock reaches beyond the design at one of its vertices: either the exact height passes a
    vertex of the design, or a vertex of the grid, where its height is exact, lies off the design.
    """
    pieces = solids.bodies_of(solid, LEAST_MM3)
    if not pieces:
        return [], 0
    vertices = np.concatenate([p.vertices_mm for p in pieces])
    near, at_most = seen.at_most(vertices)
    beyond = beyond_mm(vertices)
    ends = np.cumsum([0] + [len(p.vertices_mm) for p in pieces])
    real = []
    for piece, i, j in zip(pieces, ends, ends[1:]):
        depth_of = lambda rows: seen.deepest(vertices[i:j][rows], at_most[i:j][rows])
        sure = max(2 * tessellation_mm, SURE_MM)
        is_crossed = seen.any_counts(vertices[i:j][beyond[i:j] > sure])
        if (is_crossed or depth_of(np.abs(beyond[i:j]) < EXACT_MM)[0] > sure) and not _is_hair(piece, tessellation_mm):
            depth, worst = depth_of(slice(None))
            real.append(_described(kind, piece, tolerance + depth, vertices[i + worst], np.unique(near[i:j]), seen.frame))
    return real, len(pieces) - len(real)


def _described(kind, piece, depth, place, samples, frame):
    corners = frame.out(np.array([piece.min_mm, piece.max_mm, place])).round(6)
    low, high = corners[:2].min(axis=0), corners[:2].max(axis=0)
    return SolidBody(kind=kind, volume_mm3=piece.volume_mm3, area_mm2=piece.area_mm2, depth_mm=depth,
                     place_mm=tuple(corners[2].tolist()),
                     min_mm=tuple(low.tolist()), max_mm=tuple(high.tolist()), samples=samples)


def _is_hair(piece, tessellation_mm):
    """A body that stands upright and is thinner than the tessellation: what facets leave along a wall beside the faces."""
    size = np.asarray(piece.max_mm) - np.asarray(piece.min_mm)
    return bool(piece.volume_mm3 < tessellation_mm * size[2] * fixed.hypot(*size[:2]))
