"""A block with a pocket and a shelf, cut in two setups by operations that are listed one by one."""

import cadquery as cq

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.constant_scallop import ConstantScallop
from cuspline.planning.strategies.facing import Facing
from cuspline.planning.strategies.floor import Floor
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.strategies.waterline import Waterline

HALF_X, HALF_Y, HEIGHT, SHELF, POCKET = 18.0, 16.0, 12.0, 8.0, 7.0


class Block(Parameters):
    """It has none."""


def solid():
    """The block: a shelf with a fillet along its back, a round pocket, a slightly domed top."""
    body = cq.Workplane().box(2 * HALF_X, 2 * HALF_Y, HEIGHT, centered=(True, True, False))
    body = body.cut(cq.Workplane().box(40, 11, 10, centered=(True, False, False)).translate((0, 5, SHELF)))
    body = body.edges(cq.selectors.BoxSelector((-20, 4.5, SHELF - 0.5), (20, 5.5, SHELF + 0.5))).fillet(2)
    pocket = (cq.Workplane().workplane(offset=POCKET).center(-2, -5).rect(20, 14).extrude(20).edges("|Z").fillet(4.5)
              .faces("<Z").edges().fillet(4))
    return body.cut(pocket)


def design(p: Block) -> Design:
    plane = lambda name, way, low, high: FacePredicate(name=name, count=1, kinds=("plane",), normal=way, center_min_mm=low,
                                                       center_max_mm=high)
    return Design(
        name="block", description="eight operations", parameters=p, solid=solid(), material="aluminium_6061",
        predicates=(plane("top", (0, 0, 1), (-20, -20, 11.9), (20, 20, 12.1)),
                    plane("shelf", (0, 0, 1), (-20, 5, 7.9), (20, 20, 8.1)),
                    plane("wall", (0, 1, 0), (-20, 4, 8), (20, 6, 12.1)),
                    plane("bottom", (0, 0, -1), (-20, -20, -0.1), (20, 20, 0.1)),
                    FacePredicate(name="fillet", count=1, kinds=("cylinder",), center_min_mm=(-1, 5, 8),
                                  center_max_mm=(1, 7.5, 10)),
                    FacePredicate(name="pocket", at_least=5, center_min_mm=(-12.5, -12.5, 6.9),
                                  center_max_mm=(8.5, 2.5, 11.95))),
        stock=StockBox(min_mm=(-HALF_X, -HALF_Y, -1), max_mm=(HALF_X, HALF_Y, HEIGHT + 1)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.005, gouge_mm=0.008),
        setups=(Setup(name="setup-1", wcs_in_words="middle of the block, Z0 on the finished base",
                      faces=("top", "shelf", "wall", "fillet", "pocket"),
                      operations=(Facing(tool="flat 16", faces=("top",), allowance_mm=0.2),
                                  Rough(tool="flat 10", allowance_mm=0.25),
                                  Floor(tool="bull 10 r1", faces=("shelf",)),
                                  Waterline(tool="bull 10 r1", faces=("wall", "fillet"), steep_deg=5),
                                  Parallel(tool="ball 8", faces=("top",), angle_deg=30),
                                  ConstantScallop(tool="ball 8", faces=("pocket",), scallop_mm=0.04, steep_deg=65),
                                  Rest(tool="ball 6", faces=("pocket",)),
                                  Rest(name="rest fine", tool="ball 4", faces=("pocket",)))),
                Setup(name="setup-2", wcs_in_words="turned over, Z0 on the finished base", faces=("bottom",),
                      wcs_z=(0, 0, -1), operations=(Facing(tool="flat 16"),))))


JOB = """step = "block.step"
description = "eight operations"
material = "aluminium_6061"
stock = { min_mm = [-18, -16, -1], max_mm = [18, 16, 13] }
finish = { scallop_mm = 0.05, profile_tolerance_mm = 0.005, gouge_mm = 0.008 }
faces = [
    { name = "top", count = 1, kinds = ["plane"], normal = [0, 0, 1], center_min_mm = [-20, -20, 11.9], center_max_mm = [20, 20, 12.1] },
    { name = "shelf", count = 1, kinds = ["plane"], normal = [0, 0, 1], center_min_mm = [-20, 5, 7.9], center_max_mm = [20, 20, 8.1] },
    { name = "wall", count = 1, kinds = ["plane"], normal = [0, 1, 0], center_min_mm = [-20, 4, 8], center_max_mm = [20, 6, 12.1] },
    { name = "bottom", count = 1, kinds = ["plane"], normal = [0, 0, -1], center_min_mm = [-20, -20, -0.1], center_max_mm = [20, 20, 0.1] },
    { name = "fillet", count = 1, kinds = ["cylinder"], center_min_mm = [-1, 5, 8], center_max_mm = [1, 7.5, 10] },
    { name = "pocket", at_least = 5, center_min_mm = [-12.5, -12.5, 6.9], center_max_mm = [8.5, 2.5, 11.95] },
]

[[setups]]
name = "setup-1"
wcs_in_words = "middle of the block, Z0 on the finished base"
faces = ["top", "shelf", "wall", "fillet", "pocket"]
operations = [
    { kind = "facing", tool = "flat 16", faces = ["top"], allowance_mm = 0.2 },
    { kind = "rough", tool = "flat 10", allowance_mm = 0.25 },
    { kind = "floor", tool = "bull 10 r1", faces = ["shelf"] },
    { kind = "waterline", tool = "bull 10 r1", faces = ["wall", "fillet"], steep_deg = 5 },
    { kind = "parallel", tool = "ball 8", faces = ["top"], angle_deg = 30 },
    { kind = "constant_scallop", tool = "ball 8", faces = ["pocket"], scallop_mm = 0.04, steep_deg = 65 },
    { kind = "rest", tool = "ball 6", faces = ["pocket"] },
    { kind = "rest", name = "rest fine", tool = "ball 4", faces = ["pocket"] },
]

[[setups]]
name = "setup-2"
wcs_in_words = "turned over, Z0 on the finished base"
faces = ["bottom"]
wcs_z = [0, 0, -1]
operations = [{ kind = "facing", tool = "flat 16" }]
"""
