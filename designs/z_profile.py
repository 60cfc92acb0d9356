r"""Z-profile mould block: a profile in a vertical plane swept across the block.

    z │  convex arc                 ellipse arc
      │ ◜‾‾‾\ slope               │‾‾‾\ spline
      │      \                wall│    \___
      │       \___ floor _________│        ‾‾── land
      │       concave arc
      └──────────────────────────────────────── x (section plane ZX) or y (YZ)

Source: the profile kind of the Z-axis compensation paper (lines, arcs, ellipse arc, spline,
a vertical step); dimensions our own.
"""

import math
from typing import Literal

import cadquery as cq
from pydantic import Field, model_validator

from cuspline.design import Design, FacePredicate, Finish, FixtureBox, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto
from cuspline.values import fixed_math as fixed


class ZProfile(Parameters):
    """Dimensions of the mould block; the profile runs along `length_mm`, the sweep along `width_mm`."""

    length_mm: float = Field(default=120.0, ge=100, le=300, description="block length along the profile")
    width_mm: float = Field(default=80.0, ge=10, le=300, description="block width along the sweep")
    height_mm: float = Field(default=42.0, ge=36, le=120, description="highest point of the block above its base")
    convex_radius_mm: float = Field(default=34.0, ge=5, le=40, description="convex arc, starts level at the block's end")
    slope_deg: float = Field(default=78.0, ge=20, le=80, description="fall of the straight flank below the convex arc")
    slope_length_mm: float = Field(default=2.0, ge=0.5, le=20, description="length of that flank")
    concave_radius_mm: float = Field(default=6.0, ge=1, le=30, description="concave arc between flank and floor")
    floor_length_mm: float = Field(default=18.0, ge=2, le=60, description="level floor up to the wall")
    step_mm: float = Field(default=24.0, ge=2, le=30, description="height of the vertical wall")
    ellipse_a_mm: float = Field(default=28.0, ge=5, le=60, description="ellipse semi-axis along the profile")
    ellipse_b_mm: float = Field(default=24.0, ge=5, le=40, description="ellipse semi-axis upward")
    ellipse_deg: float = Field(default=50.0, ge=20, le=80,
                               description="eccentric angle that the ellipse arc spans from its top")
    spline_length_mm: float = Field(default=34.0, ge=10, le=120, description="extent of the spline along the profile")
    spline_fall_mm: float = Field(default=14.6, ge=2, le=40, description="fall of the spline to the land")
    sweep_slope_deg: float = Field(default=0.0, ge=-15, le=15, description="rise of the whole profile along the sweep")
    far_scale: float = Field(default=1.0, ge=0.7, le=1.0,
                             description="height of the profile at the far end as a share of the near one (lofted)")
    section_plane: Literal["ZX", "YZ"] = Field(default="ZX", description="vertical plane of the profile")
    passes: Literal["zig-zag", "one-way"] = Field(default="zig-zag", description="finishing passes to and fro, or all one way")
    stock_top_mm: float = Field(default=2.0, ge=0, le=20, description="stock above the highest point")
    grip_mm: float = Field(default=4.0, ge=1, le=30, description="height of the vise jaws above the base of the block")
    scallop_mm: float = Field(default=0.010, ge=0.001, le=0.5, description="largest cusp left")
    profile_tolerance_mm: float = Field(default=0.0024, ge=0.0002, le=0.05, description="path against true curve")
    gouge_mm: float = Field(default=0.003, ge=0.0005, le=0.05, description="deepest accepted cut below the surface")
    material: str = Field(default="aluminium_6061", description="work material, a name of `materials`")

    @model_validator(mode="after")
    def _profile_fits_into_the_block(self):
        if self.far_scale != 1.0 and self.sweep_slope_deg != 0.0:
            raise ValueError("far_scale and sweep_slope_deg exclude each other: set one of them to its default")
        knots = profile_knots(self)
        left = self.length_mm - knots["spline_end"][0]
        if left < 2.0:
            raise ValueError(f"the profile needs {knots['spline_end'][0]:.2f} mm and 2 mm of land, "
                             f"length_mm is {self.length_mm}: lengthen the block or shorten an element")
        if knots["top"][1] > self.height_mm:
            raise ValueError(f"the step comes up to {knots['top'][1]:.2f} mm, above height_mm = {self.height_mm}: "
                             "lower step_mm or steepen slope_deg")
        lowest = min(knots["floor"][1], knots["spline_end"][1]) * self.far_scale
        lowest += min(0.0, self.width_mm * fixed.tan(math.radians(self.sweep_slope_deg)))
        if lowest < 5.0:
            raise ValueError(f"the profile comes down to {lowest:.2f} mm above the base, less than 5 mm: "
                             "raise height_mm or flatten slope_deg, spline_fall_mm or the sweep")
        return self


def profile_knots(p):
    """Joints of the profile from left to right as {name: (along, up)}, mm."""
    a = math.radians(p.slope_deg)
    convex_end = (p.convex_radius_mm * fixed.sin(a), p.height_mm - p.convex_radius_mm * (1 - fixed.cos(a)))
    slope_end = (convex_end[0] + p.slope_length_mm * fixed.cos(a), convex_end[1] - p.slope_length_mm * fixed.sin(a))
    concave_end = (slope_end[0] + p.concave_radius_mm * fixed.sin(a),
                   slope_end[1] - p.concave_radius_mm * (1 - fixed.cos(a)))
    foot = (concave_end[0] + p.floor_length_mm, concave_end[1])
    top = (foot[0], foot[1] + p.step_mm)
    e = math.radians(p.ellipse_deg)
    ellipse_end = (top[0] + p.ellipse_a_mm * fixed.sin(e), top[1] - p.ellipse_b_mm * (1 - fixed.cos(e)))
    spline_end = (ellipse_end[0] + p.spline_length_mm, ellipse_end[1] - p.spline_fall_mm)
    return {"start": (0.0, p.height_mm), "convex_end": convex_end, "slope_end": slope_end, "floor": concave_end,
            "foot": foot, "top": top, "ellipse_end": ellipse_end, "spline_end": spline_end,
            "land_end": (p.length_mm, spline_end[1])}


def profile_wire(p, scale=1.0, across_mm=0.0, base_mm=0.0):
    """The closed profile in its vertical plane at `across_mm`: heights scaled, base line at `base_mm`."""
    k = profile_knots(p)
    a, e = math.radians(p.slope_deg), math.radians(p.ellipse_deg)
    r, c = p.convex_radius_mm, p.concave_radius_mm
    slope = p.ellipse_b_mm * fixed.sin(e) / (p.ellipse_a_mm * fixed.cos(e))
    reach = p.spline_length_mm + p.spline_fall_mm

    def at(point):
        along, up = point[0], point[1] * scale
        return cq.Vector(along, across_mm, up) if p.section_plane == "ZX" else cq.Vector(across_mm, along, up)

    def direction(along, up):
        return cq.Vector(along, 0, up) if p.section_plane == "ZX" else cq.Vector(0, along, up)

    on_convex = (r * fixed.sin(a / 2), p.height_mm - r * (1 - fixed.cos(a / 2)))
    on_concave = (k["floor"][0] - c * fixed.sin(a / 2), k["floor"][1] + c * (1 - fixed.cos(a / 2)))
    line = lambda m, n: cq.Edge.makeLine(at(m), at(n))
    base = lambda along: at((along, base_mm / scale))
    if scale == 1.0:
        arcs = (cq.Edge.makeThreePointArc(at(k["start"]), at(on_convex), at(k["convex_end"])),
                cq.Edge.makeThreePointArc(at(k["slope_end"]), at(on_concave), at(k["floor"])))
    else:       # a circle with scaled heights is an ellipse
        arcs = (_ellipse(p, at((0, p.height_mm - r)), r, r * scale, 90 - p.slope_deg, 90),
                _ellipse(p, at((k["floor"][0], k["floor"][1] + c)), c, c * scale, 270 - p.slope_deg, 270))
    ellipse = _ellipse(p, at((k["top"][0], k["top"][1] - p.ellipse_b_mm)),
                       p.ellipse_a_mm, p.ellipse_b_mm * scale, 90 - p.ellipse_deg, 90)
    # the derivatives are given over 0..1, so that a profile of scaled heights has a spline of scaled heights
    tangents = [direction(1.0, -slope * scale) * (reach / (1 + slope)), direction(reach, 0.0)]
    spline = cq.Edge.makeSpline([at(k["ellipse_end"]), at(k["spline_end"])], parameters=[0.0, 1.0], scale=False,
                                tangents=tangents)
    edges = [arcs[0], line(k["convex_end"], k["slope_end"]), arcs[1], line(k["floor"], k["foot"]),
             line(k["foot"], k["top"]), ellipse, spline, line(k["spline_end"], k["land_end"]),
             cq.Edge.makeLine(at(k["land_end"]), base(p.length_mm)),
             cq.Edge.makeLine(base(p.length_mm), base(0.0)), cq.Edge.makeLine(base(0.0), at(k["start"]))]
    return cq.Wire.assembleEdges(edges)


def _ellipse(p, center, along_mm, up_mm, from_deg, to_deg):
    """Arc of an ellipse in the section plane; eccentric angles counted from `along` toward `up`."""
    if p.section_plane == "ZX":         # seen from -y, x to the right, z up
        plane = cq.Plane(center, xDir=(1, 0, 0), normal=(0, -1, 0))
    else:                               # seen from +x, y to the right, z up
        plane = cq.Plane(center, xDir=(0, 1, 0), normal=(1, 0, 0))
    return (cq.Edge.makeEllipse(along_mm, up_mm, plane.origin, plane.zDir, plane.xDir,
                                from_deg, to_deg) if along_mm >= up_mm
            else cq.Edge.makeEllipse(up_mm, along_mm, plane.origin, plane.zDir, plane.yDir,
                                     from_deg - 90, to_deg - 90))


def solid(p):
    """The block as a CadQuery solid, base at z = 0."""
    if p.far_scale != 1.0:
        return cq.Solid.makeLoft([profile_wire(p), profile_wire(p, p.far_scale, p.width_mm)], True)
    rise = p.width_mm * fixed.tan(math.radians(p.sweep_slope_deg))
    across = (0, p.width_mm, rise) if p.section_plane == "ZX" else (p.width_mm, 0, rise)
    if rise == 0.0:
        return cq.Solid.extrudeLinear(profile_wire(p), [], cq.Vector(*across))
    deep = abs(rise) + 1.0      # the swept base slopes too: start below and cut it level
    body = cq.Solid.extrudeLinear(profile_wire(p, base_mm=-deep), [], cq.Vector(*across))
    size = p.length_mm + p.width_mm
    below = cq.Solid.makeBox(2 * size, 2 * size, 2 * deep, cq.Vector(-size / 2, -size / 2, -2 * deep))
    return body.cut(below).Solids()[0]


def design(p: ZProfile) -> Design:
    """The mould block, ready to be planned: profile faces cut in one clamping, sides and base finished before."""
    body = solid(p)
    top = p.height_mm + max(0.0, p.width_mm * fixed.tan(math.radians(p.sweep_slope_deg)))
    size = (p.length_mm, p.width_mm) if p.section_plane == "ZX" else (p.width_mm, p.length_mm)
    across = 1 if p.section_plane == "ZX" else 0
    return Design(
        name="z_profile",
        description="Z-profile mould block: lines, arcs, ellipse arc, spline and a vertical step",
        parameters=p,
        solid=body,
        predicates=(FacePredicate(name="profile", count=8, center_min_mm=(1e-3, 1e-3, 1e-3),
                                  center_max_mm=(size[0] - 1e-3, size[1] - 1e-3, top + 1.0)),),
        material=p.material,
        stock=StockBox(min_mm=(0.0, 0.0, 0.0), max_mm=(*size, top + p.stock_top_mm)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.profile_tolerance_mm, gouge_mm=p.gouge_mm),
        setups=(Setup(name="setup-1", wcs="G54", faces=("profile",),
                      operations=(Auto(strategy="sections", section_plane=p.section_plane, passes=p.passes),),
                      wcs_in_words="X0 Y0 at the lower left corner of the block, Z0 on its base (parallels)",
                      fixtures=_jaws(p, across)),),
    )


def _jaws(p, across):
    """The vise grips the two sides that the profile runs out of."""
    jaws = []
    for name, low, high in (("fixed jaw", -40.0, 0.0), ("moving jaw", p.width_mm, p.width_mm + 40.0)):
        corners = [[0.0, 0.0, -30.0], [p.length_mm, p.length_mm, p.grip_mm]]
        corners[0][across], corners[1][across] = low, high
        jaws.append(FixtureBox(name=name, min_mm=tuple(corners[0]), max_mm=tuple(corners[1])))
    return tuple(jaws)
