"""A part as its owner states it: solid, faces by name, finish, stock, setups.  The names here are for users' own designs."""

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
from cuspline.design.stock import StockAllowance, StockBox, StockCylinder, StockMesh, StockSkin, StockSolid
from cuspline.shop.threads import Thread

__all__ = ["ChamferWidth", "Companion", "DEFAULT_MACHINE", "Design", "Diameter", "Distance", "FacePredicate", "Figure",
           "Finish", "FixtureBox", "FixtureCylinder", "FixtureSolid", "Marker", "Parameters", "Position", "Refixturing", "Setup",
           "SolidReport", "StockAllowance", "StockBox", "StockCylinder", "StockMesh", "StockSkin", "StockSolid",
           "Thread"]
