"""STEP files as other programs write them: in inches, shaken, all splines, in assemblies, without a solid."""

import math
import random
import re
from pathlib import Path

import cadquery as cq
import numpy as np
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeSolid,
    BRepBuilderAPI_NurbsConvert,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepLib import BRepLib
from OCP.gp import gp_Pnt
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS

from cuspline.kernel import brep, shells

POINT = re.compile(r"(#\d+ ?= ?CARTESIAN_POINT\('[^']*',\()([^()]*)(\)\))")


def plain(solid, path):
    """As cuspline writes it."""
    brep.write_step(brep.wrapped(solid), path, "part")


def in_inches(solid, path):
    """The same part, lengths in inches."""
    exported(solid, path, unit="INCH")


def exported(solid, path, unit="MM"):
    Interface_Static.SetCVal_s("write.step.unit", unit)
    try:
        writer = STEPControl_Writer()
        writer.Transfer(brep.wrapped(solid), STEPControl_AsIs)
        writer.Write(str(path))
    finally:
        Interface_Static.SetCVal_s("write.step.unit", "MM")


def shaken(solid, path, by_mm, seed):
    """Every vertex moved by so much in a random direction."""
    plain(solid, path)
    text, dice = Path(path).read_text(), random.Random(seed)
    vertices = set(re.findall(r"VERTEX_POINT\('[^']*',(#\d+)\)", text))

    def moved(match):
        if match[1].split("=")[0].strip() not in vertices:
            return match[0]
        point = np.array([float(v) for v in match[2].split(",")])
        way = np.array([dice.gauss(0, 1) for _ in range(3)])
        point += by_mm * way / math.sqrt(float((way * way).sum()))
        return match[1] + ",".join(f"{v:.9f}" for v in point) + match[3]

    Path(path).write_text(POINT.sub(moved, text))


def as_splines(solid, path):
    """Every face and edge a B-spline."""
    plain(BRepBuilderAPI_NurbsConvert(brep.wrapped(solid), True).Shape(), path)


def placed_in_an_assembly(solid, path):
    """One body, turned and moved into its place and back by the assembly that holds it."""
    body = cq.Shape.cast(brep.wrapped(solid))
    body = next(iter(body.Solids()))
    place = cq.Location(cq.Vector(100, -50, 20), cq.Vector(0, 0, 1), 90)
    inner = cq.Assembly(name="inner").add(body.moved(place.inverse), name="body", loc=place)
    cq.Assembly(name="outer").add(inner).export(str(path), exportType="STEP")


def with_a_neighbour(solid, path):
    """The body and a screw beside it."""
    body = cq.Shape.cast(brep.wrapped(solid))
    screw = cq.Solid.makeCylinder(2.0, 12.0, cq.Vector(60, 0, 0))
    cq.Assembly(name="outer").add(body, name="body").add(screw, name="screw").export(str(path), exportType="STEP")


def open_shell(solid, path):
    """All faces but one, not closed to a solid."""
    faces = cq.Shape.cast(brep.wrapped(solid)).Faces()
    plain(cq.Shell.makeShell(faces[1:]).wrapped, path)


def ruled_block(grid, low_mm):
    """The solid under one B-spline surface of degree one through a grid of points, with flat walls and floor."""
    points = np.array(grid, float)
    flat = lambda n: np.concatenate([[0.0], np.arange(n), [n - 1.0]])
    top = shells.surface_of_poles(points, np.ones(points.shape[:2]), flat(points.shape[0]), flat(points.shape[1]), 1, 1)
    sewing = BRepBuilderAPI_Sewing(1e-6)
    sewing.Add(BRepBuilderAPI_MakeFace(top, 1e-9).Face())
    rings = [np.vstack([row, row[-1:] * (1, 1, 0) + (0, 0, low_mm), row[:1] * (1, 1, 0) + (0, 0, low_mm)])
             for row in (points[0], points[-1], points[:, 0], points[:, -1])]
    rings.append(points[[0, -1, -1, 0], [0, 0, -1, -1]] * (1, 1, 0) + (0, 0, low_mm))
    for ring in rings:
        polygon = BRepBuilderAPI_MakePolygon()
        for p in ring.tolist():
            polygon.Add(gp_Pnt(*p))
        polygon.Close()
        sewing.Add(BRepBuilderAPI_MakeFace(polygon.Wire(), True).Face())
    sewing.Perform()
    solid = BRepBuilderAPI_MakeSolid(TopoDS.Shell_s(sewing.SewedShape())).Solid()
    BRepLib.OrientClosedSolid_s(solid)
    return solid
