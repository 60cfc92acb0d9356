"""A part as its owner states it: solid, faces by name, finish, stock, setups.  The names here are for users' own designs."""

from importlib import import_module

from cuspline.design.design import (
    DEFAULT_MACHINE,
    Companion,
    Design,
    FacePredicate,
    Figure,
    Finish,
    Marker,
    Parameters,
    Refixturing,
    Setup,
    SolidReport,
)
from cuspline.design.dimensions import ChamferWidth, Diameter, Distance, Position
from cuspline.design.fixtures import FixtureBox, FixtureCylinder, FixtureSolid
from cuspline.design.operations import registered
from cuspline.design.stock import StockAllowance, StockBox, StockCylinder, StockMesh, StockSkin, StockSolid
from cuspline.shop.threads import Thread

__all__ = ["ChamferWidth", "Companion", "DEFAULT_MACHINE", "Design", "Diameter", "Distance", "FacePredicate", "Figure",
           "Finish", "FixtureBox", "FixtureCylinder", "FixtureSolid", "Marker", "Parameters", "Position", "Refixturing", "Setup",
           "SolidReport", "StockAllowance", "StockBox", "StockCylinder", "StockMesh", "StockSkin", "StockSolid",
           "Thread"]


def __getattr__(name):
    """Operations and tool axes by their names: `from cuspline.design import Contour`."""
    if name[:1].isupper():
        axes = import_module("cuspline.toolpaths.five_axis.tool_axes")
        known = {made.__name__: made for made in (*registered().values(), *axes.ToolAxis.__subclasses__())}
        if name in known:
            return known[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
