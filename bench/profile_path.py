"""Figures of the posted finishing path: share of arcs over arc faces, blocks against chords.

Usage: python bench/profile_path.py outputs/z_profile
"""

import sys
from pathlib import Path

import numpy as np

from cuspline.design.job import read_job, read_tools
from cuspline.kernel import brep
from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind, Plane

CHORD_MM = 0.0025
FINISHING = ("finish", "rest finish")


def arc_figures(posted, row):
    """(radius, sweep) of a posted arc."""
    a, b, _ = Plane(posted.plane[row]).axes
    start, end, center = posted.start_mm[row], posted.end_mm[row], posted.center_mm[row]
    x0, y0, x1, y1 = start[a] - center[a], start[b] - center[b], end[a] - center[a], end[b] - center[b]
    turn = (np.arctan2(y1, x1) - np.arctan2(y0, x0)) % (2 * np.pi)
    return np.hypot(x0, y0), turn if posted.kind[row] == Kind.ARC_CCW else 2 * np.pi - turn


def chords_of(posted, rows):
    """Straight blocks that the same path needs at CHORD_MM."""
    count = 0
    for row in rows:
        if posted.kind[row] < Kind.ARC_CW:
            count += 1
        else:
            radius, sweep = arc_figures(posted, row)
            count += int(np.ceil(sweep / (2 * np.arccos(1 - CHORD_MM / radius))))
    return count


def share_of_arcs(posted, rows, faces, ball_radius_mm, plane_axis):
    """Share of the cut length over the part's cylinders across the section planes that runs as G2/G3."""
    total = as_arc = 0.0
    cylinders = [(c, f) for f in faces if f.kind == "cylinder" for c in [f.adaptor.Cylinder()]
                 if abs((c.Axis().Direction().X(), c.Axis().Direction().Y())[plane_axis]) > 0.999]
    for row in rows:
        middle = 0.5 * (posted.start_mm[row] + posted.end_mm[row])
        if posted.kind[row] >= Kind.ARC_CW:
            radius, sweep = arc_figures(posted, row)
            a, b, _ = Plane(posted.plane[row]).axes
            arm = posted.start_mm[row] - posted.center_mm[row]
            turn = (sweep if posted.kind[row] == Kind.ARC_CCW else -sweep) / 2
            middle = posted.start_mm[row].copy()
            middle[a] = posted.center_mm[row, a] + arm[a] * np.cos(turn) - arm[b] * np.sin(turn)
            middle[b] = posted.center_mm[row, b] + arm[a] * np.sin(turn) + arm[b] * np.cos(turn)
        ball = middle + (0, 0, ball_radius_mm)
        for cylinder, face in cylinders:
            p = cylinder.Axis().Location()
            d = np.delete(ball - (p.X(), p.Y(), p.Z()), plane_axis)
            hollow = face.middle.curvature_low_per_mm[0] < -1e-9
            path_radius = cylinder.Radius() + (-1 if hollow else 1) * ball_radius_mm
            out = np.delete(face.middle.normal[0], plane_axis)
            if abs(np.hypot(*d) - path_radius) < 0.01 and (d @ out) * (-1 if hollow else 1) > 0:
                length = radius * sweep if posted.kind[row] >= Kind.ARC_CW else np.linalg.norm(
                    posted.end_mm[row] - posted.start_mm[row])
                total += length
                as_arc += length if posted.kind[row] >= Kind.ARC_CW else 0.0
                break
    return as_arc / total if total else float("nan")


def main(folder):
    job, tools = read_job(folder), read_tools(folder)
    item = job.posted[0]
    posted = read_program((folder / item.program).read_text(), work_offsets={item.setup.wcs: job.machine.wcs_origin_mm},
                          tool_lengths={n: t.length_mm for n, t in tools.items()})
    faces = brep.faces_of(brep.the_solid(brep.read_step(folder / job.step)))
    names = np.array([posted.operation_name(k) for k in range(len(posted))])
    rows = np.flatnonzero(np.isin(names, FINISHING) & (posted.kind != Kind.RAPID))
    finish = rows[names[rows] == "finish"]
    ball = tools[int(posted.tool[finish[0]])].cutter.radius_mm
    axis = {"ZX": 1, "YZ": 0}[item.setup.section_plane]
    blocks, chords = len(rows), chords_of(posted, rows)
    print(f"finishing blocks {blocks}, chords of {CHORD_MM} mm {chords}, ratio {chords / blocks:.2f}")
    print(f"of these, finish alone: {len(finish)} blocks, ratio {chords_of(posted, finish) / len(finish):.2f}")
    print(f"share of the cut length over arc faces that is G2/G3: {share_of_arcs(posted, finish, faces, ball, axis):.4f}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
