"""A boss with steep sides, finished by waterlines: by a barrel whose large arc lies along the wall, or by a ball."""

import cadquery as cq

from cuspline.app.catalogue import find_library
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.strategies.waterline import Waterline
from cuspline.shop.cutters import Cutter
from cuspline.toolpaths.five_axis.tool_axes import LeadTilt

BARREL, ARC_MM = 97, 30.0
TALL_MM = 20.0


class Boss(Parameters):
    ball: bool = False          # of 8 mm, upright, in place of the barrel
    lead_deg: float = 75.0      # of the barrel, from the wall's normal upward
    scallop_mm: float = 0.02


def barrel():
    """Tool: 10 mm thick, its side an arc of ARC_MM, held like the library's ball of 10 mm."""
    ball = next(t for t in find_library(None).of_type("ball") if t.cutter.diameter_mm == 10.0)
    cutter = Cutter(name=f"barrel 10 R{ARC_MM:g}", type="apt", diameter_mm=10, corner_radius_mm=ARC_MM, tip_angle_deg=20.0,
                    taper_deg=0.0, corner_center_radius_mm=5.0 - ARC_MM, corner_center_height_mm=16.0, flutes=4,
                    flute_length_mm=24.0, neck_diameter_mm=8.0, reach_mm=40.0, shank_diameter_mm=10.0, overall_length_mm=90.0)
    return ball.model_copy(update={"number": BARREL, "stick_out_mm": 46.0, "cutter": cutter})


def design(p: Boss) -> Design:
    """Its foot stands on nothing: the barrel's tip goes below it, so hold the stock high."""
    solid = cq.Workplane().ellipse(20, 14).workplane(offset=TALL_MM).ellipse(16.5, 10.5).loft().val()
    finish = Waterline(tool="ball 8", name="finish") if p.ball else Waterline(
        tool=BARREL, name="finish", tool_axis=LeadTilt(lead_deg=p.lead_deg, toward=(0, 0, 1)))
    return Design(
        name="steep_boss", description="a wall finished by a barrel", parameters=p, tools=() if p.ball else (barrel(),),
        solid=solid, predicates=(FacePredicate(name="side", count=1, area_min_mm2=1500),), material="aluminium_6061",
        machine="mill_trunnion_ac", stock=StockBox(min_mm=(-22, -16, 0), max_mm=(22, 16, TALL_MM)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=0.01, gouge_mm=0.01),
        setups=(Setup(name="setup-1", faces=("side",), wcs_in_words="middle of the base",
                      operations=(Rough(tool="flat 10"), finish)),))
