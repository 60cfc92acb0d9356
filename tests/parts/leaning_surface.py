"""A block with a dome, a saddle or a twisted blade-like surface on top, roughed upright, finished with a leaning cutter."""

from typing import Literal

import cadquery as cq
import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BezierSurface
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from pydantic import Field

from cuspline.app.catalogue import find_library
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rough import Rough
from cuspline.shop.cutters import Cutter
from cuspline.toolpaths.five_axis.tool_axes import LeadTilt

HALF_MM = np.array([16.0, 12.0])
MIDDLE_MM, TOP_MM = 10.0, 16.0
POLES = {"1": (1, 1, 1), "s": (-1, 0, 1), "ss": (1, -1, 1)}      # Bézier poles of 1, s and s^2 over -1 .. 1
# heights in mm as {power of s along x, of t along y: factor}
FORMS = {"dome": {("ss", "1"): -4, ("1", "ss"): -3}, "saddle": {("ss", "1"): 3, ("1", "ss"): -3},
         "blade": {("s", "s"): 4, ("1", "ss"): -3, ("ss", "s"): 1}}
OWN = {"lens": 97, "tapered ball": 98}          # cutters that the part brings, and their numbers


class Surface(Parameters):
    form: Literal["dome", "saddle", "blade"] = "dome"
    lead_deg: float = Field(default=12.0, ge=-60, le=60, description="of the finishing ball")
    tilt_deg: float = Field(default=-15.0, ge=-60, le=60, description="of the finishing ball")
    machine: str = "mill_trunnion_ac"
    tool: str = Field(default="ball 8", description="that finishes; what is no ball touches with its corner")
    passes: Literal["zig-zag", "one-way"] = "zig-zag"
    scallop_mm: float = Field(default=0.3, gt=0, le=1)
    tolerance_mm: float = Field(default=0.02, gt=0, le=0.1, description="of the profile and of gouges")
    wide: float = Field(default=1.0, ge=1, le=4, description="times as wide and as long")


def poles_mm(form, wide=1.0):
    """(3, 3, 3) of the patch; `wide`: times as wide and as long."""
    s, t = np.meshgrid(POLES["s"], POLES["s"], indexing="ij")
    z = MIDDLE_MM + sum(f * np.outer(POLES[a], POLES[b]) for (a, b), f in FORMS[form].items())
    return np.stack([wide * HALF_MM[0] * s, wide * HALF_MM[1] * t, z], axis=2)


def solid(form, wide=1.0):
    at, poles = poles_mm(form, wide), TColgp_Array2OfPnt(1, 3, 1, 3)
    for i, j in np.ndindex(3, 3):
        poles.SetValue(i + 1, j + 1, gp_Pnt(*map(float, at[i, j])))
    top = cq.Face(BRepBuilderAPI_MakeFace(Geom_BezierSurface(poles), 1e-7).Face())
    below = cq.Solid.extrudeLinear(top, cq.Vector(0, 0, -40))
    return below.intersect(cq.Workplane().box(80 * wide, 80 * wide, 40, centered=(True, True, False)).val())


def own_tools():
    """A lens of 10 mm, its bottom an arc of R30, and a tapered ball of 6 mm, held like the library's ball of 10 mm."""
    held = next(t for t in find_library(None).of_type("ball") if t.cutter.diameter_mm == 10.0)
    long = {"flutes": 4, "flute_length_mm": 24.0, "neck_diameter_mm": 9.0, "reach_mm": 40.0, "shank_diameter_mm": 10.0,
            "overall_length_mm": 90.0}
    lens = Cutter(name="lens 10 R30 r1", type="lens", diameter_mm=10, corner_radius_mm=1, tip_radius_mm=30.0, **long)
    taper = Cutter(name="tapered ball 6", type="tapered_ball", diameter_mm=6, corner_radius_mm=3, taper_deg=5.0, **long)
    return tuple(held.model_copy(update={"number": n, "cutter": cutter}) for n, cutter in zip(OWN.values(), (lens, taper)))


def design(p: Surface) -> Design:
    x, y = (p.wide * HALF_MM).tolist()
    return Design(
        name="leaning_surface", description="free form finished by a leaning cutter", parameters=p, solid=solid(p.form, p.wide),
        tools=own_tools() if p.tool in OWN else (),
        predicates=(FacePredicate(name="top", count=1, normal=(0, 0, 1), normal_within_deg=50),),
        material="aluminium_6061", machine=p.machine, stock=StockBox(min_mm=(-x, -y, 0), max_mm=(x, y, TOP_MM)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.tolerance_mm, gouge_mm=p.tolerance_mm),
        setups=(Setup(name="setup-1", faces=("top",), wcs_in_words="middle of the base", operations=(
            Rough(tool="flat 10"), Parallel(tool=OWN.get(p.tool, p.tool), name="finish", passes=p.passes, tool_axis=LeadTilt(
                lead_deg=p.lead_deg, tilt_deg=p.tilt_deg)))),))
