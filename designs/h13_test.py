r"""The source's test of hardened steel: a plane and two slopes of 25 degrees, each under a layer of even thickness.

                plane: passes across the drawing
               ______________________
    step-up:  /  layer               \   inclined:
    passes   /  ____________________  \  passes up
    across  /  /                    \  \ the slope
           /  /                      \  \
          z │_________________________      x to the right, y into the drawing

AISI H13 of 48 HRC, a ball of 10.82 mm with two inserts, 5000 rpm, 1270 mm/min, stepover 0.5 mm, layers of 0.25 to 1.25 mm.  On the
step-up slope passes run level, the lowest first; up the inclined one the axis leans by the slope against the way, as an inclined
ball's does.  verify.json's "process" has what every operation meets, its mean axial force among it.

Source: L. Xu, University of Florida 1996, chapter 3, figures 3.7 to 3.10; the lengths of the faces are our own.
"""

import math

import cadquery as cq
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockSolid
from cuspline.planning.strategies.parallel import Parallel
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.values import fixed_math as fixed

BALL = Tool(number=99, stick_out_mm=40.0, cutter=Cutter(
    name="ball 10.82, 2 inserts", type="ball", diameter_mm=10.82, corner_radius_mm=5.41, flutes=2, flute_length_mm=10.0,
    neck_diameter_mm=10.0, reach_mm=30.0, shank_diameter_mm=12.0, overall_length_mm=90.0, slot_depth_mm=1.5),
    holder=Holder(name="collet chuck", segments=(HolderSegment(height_mm=50.0, lower_diameter_mm=40.0, upper_diameter_mm=40.0),)))
BASE_MM = 8.0               # under the foot of the slopes


class H13Test(Parameters):
    """The layer, the slopes, and how the ball runs."""

    layer_mm: float = Field(default=1.0, ge=0.1, le=1.25, description="thickness of the layer that is cut")
    slope_deg: float = Field(default=25.0, ge=5, le=40, description="of both slopes")
    face_mm: float = Field(default=10.0, ge=8, le=60, description="length of each face along the drawing, and its width")
    stepover_mm: float = Field(default=0.5, ge=0.2, le=1.0, description="along the surface")
    spindle_rpm: float = Field(default=5000.0, ge=500, le=12000)
    feed_mm_per_min: float = Field(default=1270.0, ge=100, le=3000)


def solid(p, layer_mm=0.0):
    """The block, its three upper faces so much farther out, as a CadQuery solid; base at z = 0."""
    a = math.radians(p.slope_deg)
    aside, along = layer_mm * fixed.tan(a / 2), p.face_mm * fixed.cos(a)
    rise, out = p.face_mm * fixed.sin(a), layer_mm / fixed.cos(a)           # of a slope; of the layer, upright over it
    foot, top = BASE_MM + out, BASE_MM + rise + layer_mm
    first, last = along - aside, along + p.face_mm + aside
    outline = [(0.0, 0.0), (0.0, foot), (first, top), (last, top), (2 * along + p.face_mm, foot), (2 * along + p.face_mm, 0.0)]
    wire = cq.Wire.makePolygon([cq.Vector(x, 0.0, z) for x, z in outline], close=True)
    return cq.Solid.extrudeLinear(wire, [], cq.Vector(0.0, p.face_mm, 0.0))


def design(p: H13Test) -> Design:
    """The block with its layer; each face one operation."""
    a = math.radians(p.slope_deg)
    sine, cosine = float(fixed.sin(a)), float(fixed.cos(a))
    scallop = 5.41 - math.sqrt(5.41 ** 2 - (p.stepover_mm / 2) ** 2)
    plain = Parallel(tool=BALL.number, spindle_rpm=p.spindle_rpm, feed_mm_per_min=p.feed_mm_per_min, stepover_mm=p.stepover_mm,
                     coolant="off", angle_deg=90.0, bearing="nearest")
    over = lambda name, faces, **more: plain.model_copy(update={"name": name, "faces": (faces,), **more})
    return Design(
        name="h13_test", description="hardened steel, the source's test: a plane, and slopes cut step-up and inclined",
        parameters=p, solid=solid(p), material="steel_h13_48hrc", stock=StockSolid(solid=solid(p, p.layer_mm)), tools=(BALL,),
        predicates=(FacePredicate(name="plane", count=1, normal=(0, 0, 1)),
                    FacePredicate(name="step-up slope", count=1, normal=(-sine, 0, cosine)),
                    FacePredicate(name="inclined slope", count=1, normal=(sine, 0, cosine))),
        finish=Finish(scallop_mm=scallop + 0.004, profile_tolerance_mm=0.002, gouge_mm=0.003),
        setups=(Setup(name="setup-1", faces=("plane", "step-up slope", "inclined slope"),
                      wcs_in_words="X0 Y0 at the corner, Z0 on the base",
                      operations=(over("plane", "plane"), over("step-up", "step-up slope", bearing="step-up"),
                                  over("inclined", "inclined slope", angle_deg=0.0, bearing="uphill"))),))
