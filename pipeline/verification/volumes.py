"""How much is left and how much is gouged; and both verifiers' volumes held against each other.

What is left or gouged within tolerance is a layer over the faces: area times deviation, summed over the samples, without
bias.  What stands beyond tolerance is a body of its own, taken from the solids.  Booleans of the whole solids would count
facets as cut: every chord of the tessellation is a gouge or an excess to them.

Where the deviation is thin, sums over samples and booleans are compared.

The solids carry two errors of known size: the grid's facets between their exact nodes, and the tessellation's.  Both
are measured at random places, exactly and without bias, and taken out of the net volume (excess less gouge); what then
stays between the verifiers is the scatter of the three samplings and what is stated of path and curvature.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.kernel import solids
from cuspline.stock.swept import signed_distance_mm, stock_height_mm
from cuspline.toolpaths.drop.dropcutter import drop_tips_mm

MOST_PLACES = 20_000        # at which the grid's error is looked at where no cell is quiet
CELLS = 8                 # pitches along the side of a cell in which volumes are compared
MOST_CELLS = 256          # compared, spread over all that could be
THIN_MM = 0.05            # volumes are compared where the deviation is below this
SIGMAS = 4.0              # scatter that a sampling may show
PIN_MM = 1e-9             # radius of the pin that feels the tessellation's height
SEED = 20260102


@dataclass(frozen=True, kw_only=True)
class Amount:
    """A volume and how far it may be off."""

    mm3: float
    bound_mm3: float


def amount(found, sign, tolerance_mm, bodies, *, path_error_mm, surface_error_mm, ball_radius_mm):
    """Volume of all the excess over, or of all the gouges into, the faces sampled and the bodies beyond tolerance.

    Over samples that no body explains it is a layer, w d each.  A body is met with cutters off by the tolerance, so a
    layer of that height is missing between it and the true cut: it is added over the samples beneath, and the bound
    covers it over the body's whole surface.

    Args:
        found: Residuals.   sign: 1.0 excess, -1.0 gouge.
        tolerance_mm: of the bodies.   bodies: SolidBody values of that kind.
        path_error_mm: of the swept paths.   surface_error_mm: of the bodies' own surfaces.
        ball_radius_mm: smallest ball of the shop: a layer over a hollow is smaller than area times height.
    Returns:
        Amount.
    """
    d, weight, points = np.maximum(sign * found.deviation_mm, 0.0), found.samples.weight_mm2, found.samples.points_mm
    in_body = np.zeros(len(d), bool)
    for body in bodies:
        in_body |= ((points > np.array(body.min_mm) - found.spacing_mm)
                    & (points < np.array(body.max_mm) + found.spacing_mm)).all(axis=1)
    in_body &= d > tolerance_mm
    layer, area = weight * np.where(in_body, 0.0, d), float(weight.sum())
    beneath, skin = float(weight[in_body].sum()), sum(b.area_mm2 for b in bodies)
    return Amount(
        mm3=float(layer.sum()) + tolerance_mm * beneath + sum(b.volume_mm3 for b in bodies),
        bound_mm3=SIGMAS * float(np.sqrt((layer * layer).sum())) + float((layer * d).sum()) / ball_radius_mm
        + path_error_mm * area + (tolerance_mm + surface_error_mm) * skin)


@dataclass(frozen=True, eq=False, kw_only=True)
class Volumes:
    """In the cells where the deviation is thin and the surface not steep."""

    area_mm2: float = 0.0
    excess_mm3: tuple[float, float] = (0.0, 0.0)      # residuals, solids as they are
    gouge_mm3: tuple[float, float] = (0.0, 0.0)
    bound_mm3: float = 0.0                            # what these may differ by: every facet off the same way
    net_mm3: tuple[float, float] = (0.0, 0.0)         # excess less gouge: residuals, solids without their facets' errors
    net_bound_mm3: float = 0.0                        # what these may differ by
    zmap_mm: float = 0.0                              # mean height error of the grid there


def volumes(excess_of, gouge_of, field, cut, drops, found, limits):
    """Compare them.

    Args:
        excess_of, gouge_of: functions of a Manifold in the clamping's WCS: how much of the excess, and of what is
            gouged, lies within it, mm3.
        field: stock_solids.Field of the clamping.   cut: its workpiece.Cut.   drops: DropMesh of the design in its WCS.
        found: Residuals of its faces.
        limits: solid_check.Limits: hollows tighter than its ball are not reachable.
    Returns:
        Volumes.
    """
    cell, frame, path_error_mm = CELLS * field.pitch_mm, field.frame, limits.path_error_mm
    points, d = frame.into(found.samples.points_mm), found.deviation_mm
    normal_z = frame.turn_into(found.samples.normals)[:, 2]
    shape = np.maximum(1, np.ceil((field.high - field.low)[:2] / cell).astype(int))
    at = np.clip(((points[:, :2] - field.low[:2]) / cell).astype(int), 0, shape - 1)
    is_good = (np.abs(d) < THIN_MM) & found.is_reachable & found.is_own & (normal_z > 0.5)
    good = _spread(_quiet_cells(at, shape, is_good))
    if not good.any():                              # a narrow part: no volumes to compare, but the grid has its error
        fine = np.flatnonzero(is_good)
        xy = points[fine[::len(fine) // MOST_PLACES + 1], :2]       # of all faces alike
        zmap = _mean_off_mm(field, cut, xy, shape, cell)
        return Volumes(zmap_mm=zmap)
    inside = good[at[:, 0], at[:, 1]] & (normal_z > 0.5)
    weight, d = found.samples.weight_mm2[inside], d[inside]
    prism = solids.prism_over([_square(field.low, cell, *c) for c in np.argwhere(good)], field.low[2] - 1, field.high[2] + 1)
    left, taken = excess_of(prism), gouge_of(prism)
    facets, facet_scatter, zmap = _facets(field, cut, good, cell)
    triangles, triangle_scatter = _triangles(drops, points[inside], weight * normal_z[inside])
    above, below = float((weight * np.maximum(d, 0)).sum()), float((weight * np.maximum(-d, 0)).sum())
    area, scatter = float(weight.sum()), float(np.sqrt(((weight * d) ** 2).sum()))
    bent = float((weight * d * d).sum()) / limits.ball_radius_mm          # a layer over a hollow is smaller than area times height
    return Volumes(
        area_mm2=area, excess_mm3=(above, left), gouge_mm3=(below, taken), zmap_mm=zmap,
        bound_mm3=area * (limits.surface_error_mm + path_error_mm + zmap) + 3 * scatter + 1e-6,
        net_mm3=(above - below, left - taken + facets - triangles),
        net_bound_mm3=area * path_error_mm + bent + SIGMAS * float(np.sqrt(scatter**2 + facet_scatter**2 + triangle_scatter**2))
        + 1e-6)


def _mean_off_mm(field, cut, xy, shape, cell):
    """Mean distance of the grid's facets from the exact stock at places (n, 2); of a hollow one everywhere."""
    if not field.is_height_field:
        return _facets_of_hollow(field, cut, np.ones(shape, bool), cell)[2]
    off = stock_height_mm(cut.paths, xy, field.high[2]) - field.height_at(xy)
    return float(np.abs(off).mean()) if len(off) else 0.0


def _facets(field, cut, good, cell):
    """What the exact stock holds more than the grid's facets, mm3; its standard error; their mean distance, mm.

    One random place in every square of about a pitch: the mean is unbiased whatever ridges run between the nodes.
    """
    if not field.is_height_field:
        return _facets_of_hollow(field, cut, good, cell)
    corner = np.argwhere(good)[:, None] * cell + field.low[:2]
    i = np.arange(CELLS)
    step = np.stack(np.meshgrid(i, i, indexing="ij"), axis=-1).reshape(-1, 2)[None] * field.pitch_mm
    xy = (corner + step).reshape(-1, 2)
    xy = xy + np.random.default_rng(SEED).random(xy.shape) * field.pitch_mm
    xy = xy[((xy > field.low[:2]) & (xy < field.high[:2])).all(axis=1)]
    off = stock_height_mm(cut.paths, xy, field.high[2]) - field.height_at(xy)
    each = field.pitch_mm**2
    return each * float(off.sum()), each * float(np.sqrt((off**2).sum())), float(np.abs(off).mean())


def _facets_of_hollow(field, cut, good, cell):
    """The same of a solid with undercuts: a random place on every facet that looks up."""
    vertices, triangles = solids.mesh_of(field.solid)
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    size = np.linalg.norm(normal, axis=1)
    share = np.random.default_rng(SEED).random((len(corners), 2, 1))
    share = np.where(share.sum(axis=1, keepdims=True) > 1.0, 1.0 - share, share)       # even over the triangle
    points = corners[:, 0] + (share * (corners[:, 1:] - corners[:, :1])).sum(axis=1)
    at = np.clip(((points[:, :2] - field.low[:2]) / cell).astype(int), 0, np.array(good.shape) - 1)
    keep = good[at[:, 0], at[:, 1]] & (normal[:, 2] > 0.5 * size)
    off, size = signed_distance_mm(cut.paths, points[keep]), size[keep]
    part = off * size
    return float(part.sum()), float(np.sqrt((part ** 2).sum())), float(np.abs(part).sum() / max(size.sum(), 1e-300))


def _triangles(drops, points, area_mm2):
    """What the exact design holds more than its tessellation, mm3, and its standard error: `area_mm2` seen from above."""
    off = points[:, 2] - drop_tips_mm(drops, points[:, :2], PIN_MM, 0.0)
    off = np.where(np.isfinite(off), off, 0.0) * area_mm2
    return float(off.sum()), float(np.sqrt((off**2).sum()))


def _quiet_cells(at, shape, is_good):
    """Cells all of whose samples are good and whose neighbours all hold samples and are good too."""
    count, bad = np.zeros(shape, int), np.zeros(shape, int)
    np.add.at(count, tuple(at.T), 1)
    np.add.at(bad, tuple(at[~is_good].T), 1)
    fine = np.pad((count > 0) & (bad == 0), 1)
    quiet = np.ones(shape, bool)
    for i in range(3):
        for j in range(3):
            quiet &= fine[i:i + shape[0], j:j + shape[1]]
    return quiet


def _spread(good):
    """At most MOST_CELLS of the cells, drawn evenly."""
    cells = np.flatnonzero(good)
    chosen = np.zeros(good.size, bool)
    chosen[np.random.default_rng(SEED).permutation(cells)[:MOST_CELLS]] = True
    return chosen.reshape(good.shape)


def _square(low, cell, i, j):
    x, y = low[0] + i * cell, low[1] + j * cell
    return np.array([(x, y), (x + cell, y), (x + cell, y + cell), (x, y + cell)])
