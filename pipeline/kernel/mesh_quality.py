"""The only door to pymeshlab: meshes checked, a third comparison of stock and design, the stock coloured by deviation.

pymeshlab is GPL and optional: it is imported inside the functions, and what is left out without it is said
(`LEFT_OUT`).  It works in single precision; meshes are moved about their middle first, so that RESOLUTION of
their size is what a distance is good for.
"""

import errno
import importlib.util
import os

import numpy as np
from scipy.spatial import cKDTree

from cuspline.values import fixed_math as fixed
from cuspline.values.findings import Finding

LEFT_OUT = "pymeshlab is not installed: no check of the meshes, no Hausdorff distance, no coloured mesh of the stock"
RESOLUTION = 1e-6         # of a mesh's diagonal
DEGENERATE_MM2 = 1e-12
QUIET_SPACINGS = 2.0      # no rim, no wall and no place out of reach as near as this
UP = 0.5                  # least part of a normal along the tool axis
THIN_MM = 0.05            # more left than this, and than the finish allows, is no finished place
PLY_BYTES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4, "double": 8}
RAMP = ((-1.0, (33, 102, 199)), (0.0, (232, 237, 227)), (1.0, (217, 41, 31)))      # the report's deviation colours


def is_installed():
    """Whether pymeshlab can be imported."""
    return importlib.util.find_spec("pymeshlab") is not None


def mesh_faults(vertices_mm, triangles):
    """What is wrong with a mesh that should bound a solid.

    Args:
        vertices_mm: (n, 3).   triangles: (m, 3), counter-clockwise from outside.
    Returns:
        dict of counts: open_edges, non_manifold_edges, non_manifold_vertices, self_intersecting, degenerate, flipped
        triangles (whose sides run the same way as their neighbours'); is_inside_out; smallest_angle_deg.
    """
    meshes = _set((vertices_mm, triangles))
    shape = meshes.get_topological_measures()
    meshes.compute_selection_by_self_intersections_per_face()
    crossing = meshes.current_mesh().selected_face_number()
    corners = np.asarray(vertices_mm, float)[triangles]
    area, angle = _areas_and_angles(corners)
    good = area > DEGENERATE_MM2
    volume = np.einsum("nc,nc->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    return {"triangles": len(triangles), "open_edges": int(shape["boundary_edges"]),
            "non_manifold_edges": _crowded_edges(np.asarray(triangles)),
            "non_manifold_vertices": int(shape["non_two_manifold_vertices"]), "self_intersecting": int(crossing),
            "degenerate": int((~good).sum()), "flipped": _flipped(np.asarray(triangles)),
            "is_inside_out": bool(volume < 0),
            "smallest_angle_deg": round(float(np.degrees(angle[good].min(initial=np.pi))), 4)}


def is_sound(faults):
    """Whether `mesh_faults` names none."""
    return not any(faults[k] for k in ("open_edges", "non_manifold_edges", "non_manifold_vertices", "self_intersecting",
                                       "degenerate", "flipped", "is_inside_out"))


def distances(points_mm, vertices_mm, triangles):
    """{"max_mm", "mean_mm", "rms_mm", "points"} of the distances of points (k, 3) to a mesh; zeros without points."""
    if not len(points_mm):
        return {"max_mm": 0.0, "mean_mm": 0.0, "rms_mm": 0.0, "points": 0}
    import pymeshlab
    meshes, far = _set((vertices_mm, triangles), (points_mm, None)), pymeshlab.PureValue(_size_mm(vertices_mm, points_mm))
    found = meshes.get_hausdorff_distance(sampledmesh=1, targetmesh=0, samplevert=True, maxdist=far)
    return {"max_mm": float(found["max"]), "mean_mm": float(found["mean"]), "rms_mm": float(found["RMS"]),
            "points": int(found["n_samples"])}


def signed_distances_mm(points_mm, vertices_mm, triangles):
    """(k,) distances of points to a closed mesh, positive outside."""
    import pymeshlab
    meshes, far = _set((vertices_mm, triangles), (points_mm, None)), pymeshlab.PureValue(_size_mm(vertices_mm, points_mm))
    meshes.compute_scalar_by_distance_from_another_mesh_per_vertex(measuremesh=1, refmesh=0, signeddist=True, maxdist=far)
    return np.asarray(meshes.mesh(1).vertex_scalar_array(), float)


def third_view(stock, mesh, found, axis, allowed_mm, nearest_mm, is_met=False):
    """Hausdorff distances between the simulated stock and the design over the required faces' quiet places.

    Quiet: away from rims, walls and what no cutter reaches, by QUIET_SPACINGS of the samples.

    Args:
        stock: mesh of it, vertices (n, 3) and triangles (m, 3), part coordinates.
        mesh: tessellation.Tessellation of the design.
        found: residuals.Residuals of the required faces.   axis: (3,) tool axis.
        allowed_mm: what the finish allows to be left: places that leave less are finished, so that the highest of all
            tops is among them.
        nearest_mm: function points (k, 3) -> (k,) signed distances to everything cut away.  On the flank of a ridge the
            stock is nearer than along the normal: by per cents, where ridges are high beside the ball.
        is_met: the stock is what several setups leave: some vertices lie where their fields meet, off the exact stock.
    Returns:
        dict: stock_to_design and design_to_stock as `distances` says; first verifier's figures at the same samples;
        mean_residual_mm, max_residual_mm; max_on_stock_mm: the largest of stock_to_design, see `_farthest_on_stock_mm`.
    """
    (stock_mm, stock_triangles), s, d = stock, found.samples, found.deviation_mm
    calm = found.is_for_balls & (np.abs(d) < max(THIN_MM, allowed_mm)) & ~s.is_border & (fixed.matmul(s.normals, axis) > UP)
    chosen = np.flatnonzero((s.weight_mm2 > 0) & calm)
    far_mm = QUIET_SPACINGS * found.spacing_mm
    vertices = stock_mm[_nearest_mm(stock_mm, s.points_mm[chosen], found.spacing_mm) < np.inf]
    vertices = vertices[_nearest_mm(vertices, s.points_mm[~calm], far_mm) == np.inf]
    chosen = chosen[_nearest_mm(s.points_mm[chosen], s.points_mm[~calm], far_mm) == np.inf]
    residual = np.minimum(np.abs(d[chosen]), np.abs(nearest_mm(s.points_mm[chosen])))
    largest, there = float(np.abs(d[calm]).max(initial=0.0)), distances(vertices, mesh.vertices_mm, mesh.triangles)
    return {"stock_to_design": there, "design_to_stock": distances(s.points_mm[chosen], stock_mm, stock_triangles),
            "mean_residual_mm": float(residual.mean()) if len(chosen) else 0.0, "max_residual_mm": largest,
            "max_on_stock_mm": _farthest_on_stock_mm(vertices, mesh, largest, nearest_mm)
            if is_met and there["max_mm"] > largest else there["max_mm"]}


def _farthest_on_stock_mm(vertices_mm, mesh, over_mm, nearest_mm):
    """The largest distance of vertices from the design, those beyond `over_mm` less what they lie off the exact stock.

    Where what two setups leave meets, a vertex lies on the chords of both: by so much no place of the stock is as far.
    """
    off = np.abs(signed_distances_mm(vertices_mm, mesh.vertices_mm, mesh.triangles))
    beyond = np.flatnonzero(off > over_mm)
    off[beyond] -= np.minimum(np.abs(nearest_mm(vertices_mm[beyond])), THIN_MM)
    return float(off.max())


def _nearest_mm(points_mm, others_mm, limit_mm):
    """(n,) distance to the nearest of other points; inf where none is within the limit."""
    if not len(points_mm) or not len(others_mm):
        return np.full(len(points_mm), np.inf)
    return cKDTree(others_mm).query(points_mm, distance_upper_bound=limit_mm)[0]


def compared(view, setup, *, tessellation_mm, path_mm, zmap_mm, size_mm):
    """(bounds, findings): the third view against the first verifier.

    The stock's vertices lie on the exact stock, or as far off as is known, so none may be farther from the design than the
    largest residual, but for the design's triangles and the path's own error.  The mean the other way may differ by what the
    grid's chords cut off on average, `zmap_mm`, both ways.
    """
    noise = RESOLUTION * size_mm
    bounds = {"max_mm": tessellation_mm + path_mm + noise, "mean_mm": 2 * zmap_mm + path_mm + noise}
    largest = view["max_on_stock_mm"] - view["max_residual_mm"]
    mean = abs(view["design_to_stock"]["mean_mm"] - view["mean_residual_mm"])
    figures = (("largest", largest, bounds["max_mm"]), ("mean", mean, bounds["mean_mm"]))
    findings = [Finding(kind="verifiers_disagree", amount_mm=round(off, 6), place_mm=None, operation="", line=0,
                        setup=setup, advice=f"the {what} distance between the meshes of stock and design is {off:.6f} mm "
                        f"off the residuals', more than {bound:.6f} mm: report this as a fault of cuspline")
                for what, off, bound in figures if off > bound]
    return bounds, tuple(findings)


def write_coloured_ply(path, vertices_mm, triangles, deviation_mm, scale_mm):
    """Binary PLY of a mesh, blue at a deviation of -scale, red at +scale; the same bytes for the same numbers."""
    share = np.asarray(deviation_mm) / scale_mm
    colour = np.column_stack([np.interp(share, [s for s, _ in RAMP], [c[k] for _, c in RAMP]) for k in range(3)]) / 255
    meshes = _set((vertices_mm, triangles), about=np.zeros(3),
                  v_color_matrix=np.column_stack([colour, np.ones(len(colour))]), v_scalar_array=np.asarray(deviation_mm, float))
    beside = path.with_name(f"{path.stem}.part.ply")
    meshes.save_current_mesh(str(beside), binary=True, save_vertex_quality=True, save_vertex_color=True)
    if beside.stat().st_size != _ply_bytes(beside):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))       # the library does not tell
    os.replace(beside, path)


def _ply_bytes(path):
    """How long a binary PLY of triangles must be by its header; -1 where the header itself is cut off."""
    with open(path, "rb") as file:
        header, end, _ = file.read(10_000).partition(b"end_header\n")
    size = len(header) + len(end) if end else -1
    count = 0
    for words in (line.split() for line in header.decode("latin-1").splitlines()):
        if words[:1] == ["element"]:
            count = int(words[2])
        elif words[:2] == ["property", "list"]:
            size += count * (PLY_BYTES[words[2]] + 3 * PLY_BYTES[words[3]])
        elif words[:1] == ["property"]:
            size += count * PLY_BYTES[words[1]]
    return size if end else -1


def _size_mm(*points_mm):
    return float(fixed.length(np.ptp(np.vstack(points_mm), axis=0)))


def _set(*meshes, about=None, **columns):
    """MeshSet of (vertices, triangles or None), moved about their common middle."""
    import pymeshlab
    middle = np.vstack([v for v, _ in meshes]).mean(axis=0) if about is None else about
    found = pymeshlab.MeshSet(verbose=False)
    for vertices, triangles in meshes:
        rows = {"face_matrix": np.array(triangles, np.int32, order="C")} if triangles is not None else {}
        found.add_mesh(pymeshlab.Mesh(vertex_matrix=np.array(vertices - middle, float, order="C"), **rows, **columns))
    return found


def _areas_and_angles(corners):
    """(m,) areas and smallest angles of triangles (m, 3, 3)."""
    sides = np.roll(corners, -1, axis=1) - corners
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    length = np.linalg.norm(sides, axis=2)
    both = np.maximum(length * np.roll(length, 1, axis=1), 1e-300)
    cosine = -np.einsum("mkc,mkc->mk", sides, np.roll(sides, 1, axis=1)) / both
    return area, fixed.arccos(np.clip(cosine, -1, 1)).min(axis=1)


def _crowded_edges(triangles):
    """Edges where more than two triangles meet."""
    sides = np.sort(np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    return int((np.unique(sides, axis=0, return_counts=True)[1] > 2).sum())


def _flipped(triangles):
    """Triangles whose sides run the way that their neighbours' do, the fewer of both taken for wrong."""
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    owner = np.tile(np.arange(len(triangles)), 3)
    _, back, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    twice = np.bincount(owner[count[back.ravel()] > 1], minlength=len(triangles))
    return int((twice >= 2).sum())
