"""The only door to manifold3d: watertight solids, their differences and their connected bodies."""

from dataclasses import dataclass

import numpy as np
from manifold3d import CrossSection, Error, FillRule, Manifold, Mesh64, OpType
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cuspline.kernel.stl_files import stl_of_corners
from cuspline.values.errors import SimulationError

POLYGONS_AT_ONCE, SECTIONS_AT_ONCE = 500, 8     # of a union in the plane
HAIR_MM = 1e-6            # below its bottom a height field that is cut through goes on
APART_MM = 1.0            # what is cut off lies beyond it by so much


@dataclass(frozen=True, eq=False, kw_only=True)
class Body:
    """One connected piece of a solid."""

    volume_mm3: float
    area_mm2: float
    min_mm: np.ndarray        # (3,)
    max_mm: np.ndarray        # (3,)
    vertices_mm: np.ndarray   # (n, 3)


def solid_of(vertices_mm, triangles, name="the mesh"):
    """A Manifold of a closed mesh, triangles counter-clockwise from outside.

    Raises:
        SimulationError: it is open, self-connected or inside out.
    """
    solid = _manifold(vertices_mm, triangles)
    if solid.status() != Error.NoError:
        raise SimulationError(f"{name} is not watertight: {solid.status().name}")
    if solid.volume() <= 0:
        raise SimulationError(f"{name} is inside out or has no volume")
    return solid


def fault_of(vertices_mm, triangles):
    """Why a mesh bounds no solid, in words; "" where it does."""
    count = len(triangles)
    sides = np.sort(np.asarray(triangles)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    used = np.unique(sides, axis=0, return_counts=True)[1]
    if (used == 1).any():
        return f"it is open, {int((used == 1).sum())} sides of its {count} triangles have no neighbour: close its holes"
    solid = _manifold(vertices_mm, triangles)
    if solid.status() != Error.NoError:
        return "triangles meet more than two at a side, or are turned against their neighbours: repair the mesh"
    return "it is inside out, or has no volume: turn its triangles round" if solid.volume() <= 0 else ""


def _manifold(vertices_mm, triangles):
    return Manifold(Mesh64(np.array(vertices_mm, dtype=np.float64, order="C"),      # copies: it takes no read-only arrays
                           np.array(triangles, dtype=np.uint64, order="C")))


def mesh_of(solid):
    """Vertices (n, 3) and triangles (m, 3) of a Manifold, each place once."""
    mesh = solid.to_mesh64()
    vertices, triangles = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int64)
    same = np.arange(len(vertices))
    same[np.asarray(mesh.merge_from_vert, np.int64)] = np.asarray(mesh.merge_to_vert, np.int64)
    is_used = np.zeros(len(vertices), bool)
    is_used[same[triangles]] = True
    row = np.cumsum(is_used) - 1
    return vertices[is_used], row[same[triangles]]


def height_field(xs_mm, ys_mm, z_mm, bottom_mm, name="the stock"):
    """A solid between a flat bottom and heights over a rectilinear grid.

    Args:
        xs_mm, ys_mm: (nx,), (ny,) strictly growing.
        z_mm: (ny, nx) heights above bottom_mm; where they are not, the field is thin by 1e-6 mm
            below the bottom and is cut off there.
    """
    return _between(xs_mm, ys_mm, np.maximum(z_mm, bottom_mm - HAIR_MM), bottom_mm - APART_MM, name).trim_by_plane(
        (0.0, 0.0, 1.0), bottom_mm)


def over_field(xs_mm, ys_mm, z_mm, bottom_mm, top_mm):
    """What `height_field` lacks of all that stands over its bottom up to top_mm, and more above and beside that; None: nothing.

    Taken off such a stock it leaves the same as both have in common, in a tenth of the time: it has triangles only about the
    places that lie lower than the top.  Where these reach the grid's border it goes on beyond, so that no side of it lies on the
    stock's.

    Args:
        as for `height_field`; top_mm: no stock stands higher.
    """
    xs, ys = (np.concatenate([[a[0] - APART_MM], a, [a[-1] + APART_MM]]) for a in (xs_mm, ys_mm))
    z = np.pad(np.maximum(z_mm, bottom_mm - HAIR_MM), 1, mode="edge")
    is_low = z < top_mm
    if not is_low.any():
        return None
    rows, columns = (_about(is_low.any(axis=axis)) for axis in (1, 0))
    return _between(xs[columns], ys[rows], z[rows, columns], top_mm + APART_MM, "what was taken off")


def _about(chosen):
    """Slice that holds all of the chosen (n,) bool, and one more on either side where there is one."""
    at = np.flatnonzero(chosen)
    return slice(max(int(at[0]) - 1, 0), int(at[-1]) + 2)


def _between(xs_mm, ys_mm, z_mm, plane_mm, name):
    """A solid between heights (ny, nx) over a rectilinear grid and a level plane, all below or all above them."""
    nx, ny = len(xs_mm), len(ys_mm)
    x, y = np.tile(xs_mm, ny), np.repeat(ys_mm, nx)
    surface = np.column_stack([x, y, z_mm.ravel()])
    ring = _ring(nx, ny)
    base = np.column_stack([x[ring], y[ring], np.full(len(ring), plane_mm)])
    middle = np.array([[xs_mm[0] / 2 + xs_mm[-1] / 2, ys_mm[0] / 2 + ys_mm[-1] / 2, plane_mm]])
    below = len(surface) + np.arange(len(ring))
    nxt, nxt_below, center = np.roll(ring, -1), np.roll(below, -1), len(surface) + len(ring)
    sides = [np.column_stack([ring, below, nxt_below]), np.column_stack([ring, nxt_below, nxt]),
             np.column_stack([np.full(len(ring), center), nxt_below, below])]
    triangles = np.concatenate([_cells(z_mm, nx, ny), *sides])
    return solid_of(np.vstack([surface, base, middle]), triangles if plane_mm < z_mm.flat[0] else triangles[:, ::-1], name)


def _ring(nx, ny):
    """Border nodes counter-clockwise seen from above."""
    row = np.arange(nx)
    column = np.arange(ny)
    return np.concatenate([row[:-1], column[:-1] * nx + nx - 1, (ny - 1) * nx + row[:0:-1], column[:0:-1] * nx])


def is_split_upward(a, b, c, d):
    """Whether the cell with these heights, counter-clockwise from the lowest x and y, is split from its first to its third."""
    return np.abs(a - c) <= np.abs(b - d)


def _cells(z, nx, ny):
    """Two triangles a cell, split along the diagonal whose ends differ less: it follows ridges and walls."""
    a = (np.arange(ny - 1)[:, None] * nx + np.arange(nx - 1)).ravel()
    b, c, d = a + 1, a + nx + 1, a + nx
    flat = z.ravel()
    along = is_split_upward(flat[a], flat[b], flat[c], flat[d])
    first = np.where(along[:, None], np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(along[:, None], np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    return np.concatenate([first, second])


def box(min_mm, max_mm):
    """A box between two corners."""
    size = np.asarray(max_mm, float) - min_mm
    return Manifold.cube(tuple(size.tolist())).translate(tuple(np.asarray(min_mm, float).tolist()))


def moved(solid, frame):
    """A solid given in a frame, seen from outside it."""
    if np.array_equal(frame.rotation, np.eye(3)) and not frame.origin_mm.any():
        return solid
    return solid.transform(np.column_stack([frame.rotation, frame.origin_mm]))


def common(parts):
    """What all of one or more solids have in common."""
    left = parts[0]
    for other in parts[1:]:
        left = left ^ other
    return left


def less(solid, parts):
    """A solid without some others."""
    return Manifold.batch_boolean([solid, *parts], OpType.Subtract)


def made(solid):
    """The same solid, its triangles worked out: what goes on from it several times does not do it again."""
    solid.num_tri()
    return solid


def united(parts):
    """The union of solids, none of them perhaps."""
    return Manifold.batch_boolean(list(parts), OpType.Add) if len(parts) else Manifold()


def simpler(solid, within_mm):
    """The same solid with fewer triangles, its surface off by no more than so much."""
    return solid.simplify(within_mm)


def stl_of(solid):
    """Binary STL (bytes), millimetres."""
    mesh = solid.to_mesh64()
    return stl_of_corners(np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts).astype(np.int64)])


def prism_over(polygons_mm, low_mm, high_mm):
    """What stands over a union of plane polygons (each (k, 2), counter-clockwise) between two heights."""
    section = _united_sections([np.asarray(p, dtype=np.float64) for p in polygons_mm])
    return section.extrude(high_mm - low_mm).translate((0.0, 0.0, low_mm))


def prism_within(loops_mm, low_mm, high_mm):
    """What stands between two heights over the places that closed loops (each (k, 2)) run round, counter-clockwise."""
    section = CrossSection([np.asarray(p, dtype=np.float64) for p in loops_mm], FillRule.NonZero)
    return section.extrude(high_mm - low_mm).translate((0.0, 0.0, low_mm))


def _united_sections(polygons):
    """The union as a CrossSection; neighbours first, since the time for one union grows with the square of its size."""
    middles = np.array([p.mean(axis=0) for p in polygons]).reshape(-1, 2)
    along = middles[:, int(np.argmax(np.ptp(middles, axis=0)))] if len(polygons) else np.zeros(0)
    order = np.argsort(along, kind="stable")
    parts = [CrossSection([polygons[i] for i in order[k:k + POLYGONS_AT_ONCE]], FillRule.NonZero)
             for k in range(0, len(order), POLYGONS_AT_ONCE)] or [CrossSection()]
    while len(parts) > 1:
        parts = [CrossSection.batch_boolean(parts[k:k + SECTIONS_AT_ONCE], OpType.Add)
                 for k in range(0, len(parts), SECTIONS_AT_ONCE)]
    return parts[0]


def bodies_of(solid, least_mm3):
    """Connected pieces above a volume, largest first."""
    vertices, triangles = mesh_of(solid)
    if not len(triangles):
        return []
    a, b, c = (vertices - vertices.mean(axis=0))[triangles].transpose(1, 0, 2)
    share = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    links = coo_array((np.ones(2 * len(triangles), bool), (triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel())),
                      shape=(len(vertices), len(vertices)))
    count, piece = connected_components(links, directed=False)
    of_triangle = piece[triangles[:, 0]]
    volumes, areas = (np.bincount(of_triangle, weights=w, minlength=count) for w in (share, area))
    order = np.argsort(piece, kind="stable")
    rows = np.split(order, np.cumsum(np.bincount(piece, minlength=count))[:-1])
    found = [Body(volume_mm3=float(volumes[k]), area_mm2=float(areas[k]), min_mm=vertices[rows[k]].min(axis=0),
                  max_mm=vertices[rows[k]].max(axis=0), vertices_mm=vertices[rows[k]])
             for k in np.flatnonzero(volumes > least_mm3)]
    return sorted(found, key=lambda b: (-b.volume_mm3, tuple(b.min_mm)))
