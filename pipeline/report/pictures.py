"""PNG pictures of the part: iso, top, paths, deviation.

Rendered in a child process: without a GL driver VTK does not raise, it ends its process.  A build
without pictures goes on, and says so.
"""

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cuspline.report.view_data import OPERATION_COLOURS
from cuspline.values import fixed_math as fixed

CAPTIONS = {"iso": "The design", "top": "The design from above",
            "paths": "Posted paths, coloured by operation; rapids red",
            "deviation": "Simulated stock against the design: the worst within 1 mm"}
INSTALL = "no pictures: install libegl1 libgl1 libgl1-mesa-dri"
RAPID_COLOUR = (240, 170, 170)
PATH_ROOM = 0.2         # of the part's diagonal: paths higher above it are not drawn
LABEL_LIFT = 0.012      # of the part's diagonal: labels stand so far off their faces
PALE = np.array([(0.99, 0.80, 0.75), (0.78, 0.90, 0.76), (0.75, 0.85, 0.97), (0.98, 0.92, 0.70), (0.87, 0.80, 0.95),
                 (0.74, 0.93, 0.91), (0.96, 0.83, 0.91), (0.88, 0.88, 0.82)])
TIMEOUT_S = 300         # a software renderer needs about 10 s; only a hung driver needs more


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """What was rendered, and what was left out."""

    files: dict             # name ("iso", "top", "paths", "deviation") -> Path of the PNG
    left_out: str           # "" or one sentence for the build's log and the report


def render_pictures(bundle, out_dir):
    """PNG pictures of a bundle in out_dir, without a display.

    Returns:
        Pictures; never raises because of the renderer.
    """
    out_dir = Path(out_dir)
    with tempfile.TemporaryDirectory(dir=out_dir, prefix=".pictures-") as scratch:
        job = Path(scratch) / "scene.npz"
        np.savez(job, **picture_scene(bundle))
        failure = _run_child(job, Path(scratch))
        if failure:
            return Pictures(files={}, left_out=failure)
        files = {}
        for name in CAPTIONS:
            rendered = Path(scratch) / f"{name}.png"
            if _is_whole(rendered):
                files[name] = out_dir / rendered.name
                os.replace(rendered, files[name])
    missing = [name for name in CAPTIONS if name not in files]
    return Pictures(files=files, left_out=f"no picture of: {', '.join(missing)}" if missing else "")


def render_faces(view, out_dir):
    """PNG pictures faces-above and faces-below of a part, its faces numbered from 1 in their own order.

    Args:
        view: view_mesh.ViewMesh.
    Returns:
        "" or why there are none; never raises because of the renderer.
    """
    face = view.face_index[view.triangles[:, 0]]
    corners = view.vertices_mm[view.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    size = fixed.length(np.ptp(view.vertices_mm, axis=0))
    widest = [int(np.flatnonzero(face == k)[area[face == k].argmax()]) for k in np.unique(face)]
    places = corners[widest].mean(axis=1) + LABEL_LIFT * size * view.normals[view.triangles[widest, 0]]
    edges = view.edges_mm or (np.zeros((0, 3)),)
    return _rendered({"vertices": view.vertices_mm, "normals": view.normals, "triangles": view.triangles,
                      "face_colours": PALE[face % len(PALE)], "labels": np.array([str(k + 1) for k in np.unique(face)]),
                      "label_places": places, "edge_points": np.vstack(edges),
                      "edge_lengths": np.array([len(e) for e in edges])}, out_dir)


def render_shape(view, out_dir):
    """PNG pictures of a bare part from four sides: iso, front, side, back.

    Args:
        view: view_mesh.ViewMesh.
    Returns:
        "" or why there are none; never raises because of the renderer.
    """
    return _rendered({"vertices": view.vertices_mm, "normals": view.normals, "triangles": view.triangles}, out_dir)


def _rendered(scene, out_dir):
    """Draws a scene of plain arrays into a folder; "" or why there are no pictures."""
    with tempfile.TemporaryDirectory(dir=out_dir, prefix=".pictures-") as scratch:
        job = Path(scratch) / "scene.npz"
        np.savez(job, **scene)
        failure = _run_child(job, Path(scratch))
        for rendered in filter(_is_whole, sorted(Path(scratch).glob("*.png"))):
            os.replace(rendered, Path(out_dir) / rendered.name)
    return failure


def _is_whole(path):
    """Whether a PNG is there down to its last chunk: on a full disk the renderer cuts it off without a word."""
    return path.exists() and path.read_bytes()[-8:-4] == b"IEND"


def _run_child(job, out_dir):
    """Runs the renderer; "" or the reason why there are no pictures."""
    environment = dict(os.environ)
    if not environment.get("DISPLAY"):
        environment["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkEGLRenderWindow"
    command = [sys.executable, "-m", "cuspline.report.render", str(job), str(out_dir)]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace",
                              timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return f"no pictures: the renderer did not finish within {TIMEOUT_S} s"
    if done.returncode < 0 or "EGL" in done.stderr and done.returncode:
        return INSTALL
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"no pictures: the renderer stopped with: {last}"
    return ""


def picture_scene(bundle):
    """Plain arrays for the renderer: mesh, edges, path of all setups, deviation scale."""
    mesh = bundle.mesh
    edges = mesh.edges_mm or (np.zeros((0, 3)),)
    points, links, colours = [], [], []
    low, high = np.array(bundle.part_box_mm)
    room = PATH_ROOM * fixed.length(high - low)
    for setup in bundle.setups:
        first = sum(map(len, points))
        path_points, link, colour = _path_segments(setup.path, low - room, high + room)
        points.append(path_points)
        links.append(link + first)
        colours.append(colour)
    limit = max(bundle.finish.scallop_mm, bundle.finish.gouge_mm)
    return {"vertices": mesh.vertices_mm, "normals": mesh.normals, "triangles": mesh.triangles,
            "deviation_um": np.asarray(mesh.deviation_mm) * 1000, "scale_um": 1500 * limit,
            "edge_points": np.vstack(edges), "edge_lengths": np.array([len(e) for e in edges]),
            "path_points": np.vstack(points), "path_links": np.vstack(links), "path_colours": np.vstack(colours)}


def _path_segments(path, low_mm, high_mm):
    """(points, (m, 2) rows joined by a segment, (m, 3) its colour).

    Segments at unknown places are left out, and retracts to the tool change, which would make the part small.
    """
    points = np.asarray(path.points_mm, dtype=float)
    known = ((points > low_mm) & (points < high_mm)).all(axis=1)
    links = np.column_stack([np.arange(len(points) - 1), np.arange(1, len(points))])
    links = links[known[:-1] & known[1:]]
    palette = np.array([[int(c[i:i + 2], 16) for i in (1, 3, 5)] for c in OPERATION_COLOURS], dtype=np.uint8)
    ends = links[:, 1]
    colours = palette[np.asarray(path.operation)[ends] % len(palette)]
    colours[np.asarray(path.is_rapid, dtype=bool)[ends]] = RAPID_COLOUR
    return np.nan_to_num(points), links, colours
