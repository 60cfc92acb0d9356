r"""The free-form surface of Lopes de Andrade et al. on a base plate: a test piece that others have cut too.

    z │  ___            ___
      │ /   \___    ___/   \__     the surface, 301 x 115 mm in plan
      │/        \__/          |
      ├──────────────────────────┤ base_mm: top of the plate
      └──────────────────────────┘
"""

from typing import Literal

from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakePrism
from OCP.gp import gp_Pnt, gp_Vec
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.designs._freeform_surface import freeform_face
from cuspline.planning.strategies.auto import Auto

PLAN_MIN_MM, PLAN_MAX_MM, TOP_MM = (-10.0, -67.0), (310.0, 67.0), 48.4   # round the surface in plan; its highest point


class LopesSurface(Parameters):
    """How the test piece is cut; its shape is the published one."""

    base_mm: float = Field(default=-3.0, ge=-40, le=-2, description="top of the plate; the surface comes down to 0")
    plate_mm: float = Field(default=15.0, ge=5, le=60, description="thickness of the plate")
    strategy: Literal["parallel", "constant_scallop"] = Field(default="parallel", description="how the finishing passes run")
    pass_angle_deg: float = Field(default=0.0, ge=-90, le=90, description="parallel passes: their direction from +X")
    stock_top_mm: float = Field(default=1.6, ge=0, le=20, description="stock above the highest point")
    scallop_mm: float = Field(default=0.020, ge=0.002, le=0.5, description="largest cusp left")
    profile_tolerance_mm: float = Field(default=0.001, ge=0.0002, le=0.05, description="path against true surface")
    gouge_mm: float = Field(default=0.0015, ge=0.0005, le=0.05, description="deepest accepted cut below the surface")
    material: str = Field(default="aluminium_6061", description="work material, a name of `materials`")


def solid(p):
    """Plate and the body below the surface, as one TopoDS solid."""
    low, high = (*PLAN_MIN_MM, p.base_mm - p.plate_mm), (*PLAN_MAX_MM, p.base_mm)
    plate = BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Solid()
    below = BRepPrimAPI_MakePrism(freeform_face(), gp_Vec(0, 0, -2 * TOP_MM)).Shape()
    room = BRepPrimAPI_MakeBox(gp_Pnt(*PLAN_MIN_MM, p.base_mm - p.plate_mm / 2),
                               gp_Pnt(*PLAN_MAX_MM, 2 * TOP_MM)).Solid()
    return BRepAlgoAPI_Fuse(plate, BRepAlgoAPI_Common(below, room).Shape()).Shape()


def design(p: LopesSurface) -> Design:
    """The test piece: the surface is finished, plate and walls are left as roughed."""
    return Design(
        name="lopes_surface", description="Free-form surface of Lopes de Andrade et al. on a base plate",
        parameters=p, solid=solid(p),
        predicates=(FacePredicate(name="surface", count=1, kinds=("bezier", "bspline")),),
        material=p.material,
        stock=StockBox(min_mm=(*PLAN_MIN_MM, p.base_mm - p.plate_mm), max_mm=(*PLAN_MAX_MM, TOP_MM + p.stock_top_mm)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.profile_tolerance_mm, gouge_mm=p.gouge_mm),
        setups=(Setup(name="setup-1", wcs="G54", operations=(
                          Auto(strategy=p.strategy, pass_angle_deg=p.pass_angle_deg),),
                      faces=("surface",),
                      wcs_origin_mm=(150.0, 0.0, p.base_mm - p.plate_mm),
                      wcs_in_words="X0 Y0 in the middle of the plate, Z0 on its base (parallels)"),))
