"""Parts as small as makes sense that are cut from turned blanks, castings and tilted blocks, in setups of any direction."""

from dataclasses import replace

import cadquery as cq
import numpy as np

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.design import (
    Design,
    FacePredicate,
    Finish,
    Parameters,
    Setup,
    StockBox,
    StockCylinder,
    StockSolid,
)
from cuspline.kernel import brep
from cuspline.planning.strategies.auto import Auto
from cuspline.verification.verdict import Options

FINISH = Finish(scallop_mm=0.06, profile_tolerance_mm=0.006, gouge_mm=0.008)
COARSE = Options(spacing_mm=0.4, solid_pitch_mm=0.2, replay_pitch_mm=0.4, tessellation_mm=0.008)
LONG, WIDE, HIGH = 12.0, 9.0, 7.0


class Nothing(Parameters):
    """These parts are what they are."""


def made(name, solid, stock, predicate, setup):
    """A Design of one setup."""
    return Design(name=name, description=name, parameters=Nothing(), solid=solid, predicates=(predicate,),
                  material="aluminium_6061", stock=stock, finish=FINISH, setups=(setup,))


def crowned(along=LONG, wide=WIDE, high=HIGH, sag=0.8):
    """A block whose top is hollow along x."""
    return (cq.Workplane("XZ").lineTo(along, 0).lineTo(along, high).threePointArc((along / 2, high - sag), (0, high))
            .close().extrude(-wide))


def turned_blank():
    """A bar with a round end, out of a bar that is longer."""
    bar = cq.Workplane("XY").circle(6).extrude(12)
    body = bar.intersect(cq.Workplane("XY").sphere(16).translate((0, 0, -8.0)))
    return made("turned", body.val(), StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, 8.7), diameter_mm=12.0),
                FacePredicate(name="end", count=1, kinds=("sphere",)),
                Setup(name="setup-1", faces=("end",), wcs_in_words="middle of the bar, Z0 on its base",
                      operations=(Auto(strategy="parallel"),)))


def cast():
    """(part, casting) a block with a round cave in its side, under what is cut, and a foot left as cast."""
    cave = cq.Workplane("XZ").center(LONG, 2.8).circle(1.8).extrude(-WIDE)
    foot = cq.Workplane("XY").box(LONG + 4, WIDE, 1.0, centered=False).translate((-4.0, 0, 0))
    part = crowned().union(foot).cut(cave)
    return part, crowned(high=HIGH + 0.9, sag=0.6).union(foot).cut(cave)


def casting(stock=None):
    """The crown of a casting."""
    part, raw = cast()
    return made("casting", part.val(), stock or StockSolid(solid=raw),
                FacePredicate(name="crown", count=1, kinds=("cylinder",), center_min_mm=(0, 0, 5.5)),
                Setup(name="setup-1", faces=("crown",), wcs_in_words="corner of the foot, Z0 on the base"))


def lying_turned(design):
    """The same part turned, its stock as a solid, in a setup along the axes; what a tilted setup must equal."""
    setup = design.setups[0]
    straight = setup.model_copy(update={"wcs_x": (1.0, 0.0, 0.0), "wcs_z": (0.0, 0.0, 1.0)})
    low, high = design.stock.shape.box_in(recipe.PART)
    raw = cq.Workplane("XY").box(*(high - low), centered=False).translate(tuple(low))
    part, stock = (brep.seen_from(brep.the_solid(s), setup.turn) for s in (design.solid, raw))
    return replace(design, solid=part, stock=StockSolid(solid=stock), setups=(straight,))


def about_z():
    """A crowned block in a setup turned 45 degrees about Z."""
    half = float(np.sqrt(0.5))
    return made("about_z", crowned().val(), StockBox(min_mm=(0, 0, 0), max_mm=(LONG, WIDE, HIGH + 0.8)),
                FacePredicate(name="crown", count=1, kinds=("cylinder",)),
                Setup(name="setup-1", faces=("crown",), wcs_in_words="corner, Z0 on the base",
                      operations=(Auto(strategy="parallel"),), wcs_x=(half, half, 0.0)))


def on_its_side():
    """A block with a hollow slope, its setup tilted 37 degrees about X, square to the slope."""
    angle = np.radians(37.0)
    slope = cq.Workplane("XZ").circle(20.0).extrude(-40.0).translate((LONG / 2, -20.0, 19.3))
    body = cq.Workplane("XY").box(LONG, WIDE, HIGH, centered=False)
    tool = slope.rotate((0, 0, 0), (1, 0, 0), 37.0).translate((0, WIDE / 2, HIGH - 2.2))
    return made("on_its_side", body.cut(tool).val(), StockBox(min_mm=(0, 0, 0), max_mm=(LONG, WIDE, HIGH + 0.3)),
                FacePredicate(name="slope", count=1, kinds=("cylinder",)),
                Setup(name="setup-1", faces=("slope",), wcs_in_words="corner, Z0 in the corner",
                      wcs_z=(0.0, -float(np.sin(angle)), float(np.cos(angle)))))


def order(design, folder, stage="gcode"):
    """What `cuspline build` would be asked."""
    return recipe.Order(source=None, design=design, machine=catalogue.find_machine("mill_3axis"),
                        library=catalogue.find_library(None), accepted=(), out=folder, last_stage=stage)
