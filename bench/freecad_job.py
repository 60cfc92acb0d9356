"""FreeCAD's path simulator on a folder of arrays, in FreeCAD's own Python: freecadcmd freecad_job.py, started there.

Needs nothing of cuspline.  job.json holds radius, grid and billet; tips.npy the path of a ball.  FreeCAD hands no
arguments on to a script, so the folder is the one it is started in.  Only ApplyCommand() counts.
"""

import json
import pathlib
import time

import FreeCAD
import numpy as np
import Part
import PathSimulator
from Path import Command

TOOL_MM = 60.0          # length


def ball_cutter(radius_mm):
    """A solid ball cutter, tip at the origin."""
    ball = Part.makeSphere(radius_mm, FreeCAD.Vector(0, 0, radius_mm))
    return ball.fuse(Part.makeCylinder(radius_mm, TOOL_MM, FreeCAD.Vector(0, 0, radius_mm)))


def main(folder):
    job, tips = json.loads((folder / "job.json").read_text()), np.load(folder / "tips.npy").tolist()
    low, high = FreeCAD.Vector(*job["low_mm"]), FreeCAD.Vector(*job["high_mm"])
    size = high - low
    simulator = PathSimulator.PathSim()
    simulator.BeginSimulation(Part.makeBox(size.x, size.y, size.z, low), job["pitch_mm"])
    simulator.SetToolShape(ball_cutter(job["radius_mm"]), job["pitch_mm"])
    at = FreeCAD.Placement(FreeCAD.Vector(*tips[0]), FreeCAD.Rotation())
    moves = [Command("G1", {"X": x, "Y": y, "Z": z}) for x, y, z in tips[1:]]
    begin = time.process_time()
    for move in moves:
        at = simulator.ApplyCommand(at, move)
    seconds = time.process_time() - begin
    points = [(p.x, p.y, p.z) for mesh in simulator.GetResultMesh() for p in mesh.Points]
    np.save(folder / "freecad.npy", np.array(points))
    told = {"version": ".".join(FreeCAD.Version()[:3]), "cpu_s": seconds}
    (folder / "results freecad.json").write_text(json.dumps(told))


main(pathlib.Path.cwd())        # FreeCAD puts a Path of its own here
