"""Numbers packed for the viewer: integers of a stated step, gzip with no date, base64.

A block is a row of little-endian arrays, each padded to four bytes; the viewer takes them off in
the same order.  "delta" arrays hold differences to the entry before, wrapping round in their own
integer type: neighbours differ little, so gzip makes them small.
"""

import base64
import gzip

import numpy as np

DEVIATION_STEP_MM = 1e-4    # int16: judged up to ±3.27 mm, beyond that clipped
NOT_JUDGED = -32768
LEVEL = 6                   # of gzip: 9 takes three times as long for one part in a hundred


def text_block(raw):
    """bytes → gzip → base64; the same text for the same bytes."""
    return base64.b64encode(gzip.compress(raw, LEVEL, mtime=0)).decode("ascii")


def joined(arrays):
    """Arrays one after the other, each padded to four bytes."""
    parts = [np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")).tobytes() for a in arrays]
    return b"".join(part + bytes(-len(part) % 4) for part in parts)


def delta(values, dtype):
    """Differences to the entry before, in dtype's own wrap-around; the first is kept."""
    whole = np.asarray(values, dtype=np.int64)
    return np.diff(whole, prepend=0).astype(dtype)


def quantised(values, low, size):
    """(n,) values in [low, low + size] as 0..65535."""
    return np.round((values - low) / (size or 1.0) * 65535).clip(0, 65535)


def octahedral(normals):
    """(n, 3) unit vectors folded onto a square, (n, 2) int16."""
    n = np.asarray(normals, dtype=float)
    n = n / np.maximum(np.abs(n).sum(axis=1, keepdims=True), 1e-12)
    sign = np.where(n[:, :2] >= 0, 1.0, -1.0)
    folded = np.where(n[:, 2:] < 0, (1 - np.abs(n[:, 1::-1])) * sign, n[:, :2])
    return np.round(folded * 32767).astype(np.int16)


def pack_mesh(mesh):
    """(meta, bytes) of the design: vertices, normals, deviation, triangles, then its edges.

    Edges come as one list of points and the number of points of each.
    """
    edge_points = np.vstack(mesh.edges_mm) if mesh.edges_mm else np.zeros((0, 3))
    low, size = _range(np.vstack([mesh.vertices_mm, edge_points]))
    columns = lambda points: [delta(quantised(points[:, k], low[k], size[k]), np.uint16) for k in range(3)]
    normal = octahedral(mesh.normals)
    deviation = np.asarray(mesh.deviation_mm, dtype=float)
    steps = np.where(np.isnan(deviation), NOT_JUDGED,
                     np.round(np.nan_to_num(deviation) / DEVIATION_STEP_MM).clip(-32767, 32767))
    raw = joined([*columns(mesh.vertices_mm), delta(normal[:, 0], np.int16), delta(normal[:, 1], np.int16),
                  steps.astype(np.int16), delta(np.ravel(mesh.triangles), np.int32), *columns(edge_points),
                  np.array([len(edge) for edge in mesh.edges_mm], dtype=np.int32)])
    return {"vertices": len(mesh.vertices_mm), "triangles": len(mesh.triangles), "edgePoints": len(edge_points),
            "edges": len(mesh.edges_mm), "low": low.tolist(), "size": size.tolist(),
            "deviationStepUm": DEVIATION_STEP_MM * 1000, "notJudged": NOT_JUDGED}, raw


def _range(points):
    low = points.min(axis=0)
    return low, points.max(axis=0) - low


def known(points_mm):
    """Unknown (NaN) coordinates filled with the next known one, at the end with the last, else 0."""
    filled = points_mm.copy()
    for column in filled.T:
        known = np.flatnonzero(~np.isnan(column))
        if len(known) < len(column):
            after = np.searchsorted(known, np.arange(len(column))).clip(max=max(len(known) - 1, 0))
            column[:] = column[known[after]] if len(known) else 0.0
    return filled
