"""A part as its owner states it: solid, faces by name, finish, stock, setups.  The names here are for users' own designs."""

from cuspline.design.design import (
    DEFAULT_MACHINE,
    Companion,
    Design,
    FacePredicate,
    Figure,
    Finish,
    FixtureBox,
    Marker,
    Parameters,
    Refixturing,
    Setup,
    SolidReport,
    StockBox,
)

__all__ = ["DEFAULT_MACHINE", "Companion", "Design", "FacePredicate", "Figure", "Finish", "FixtureBox", "Marker",
           "Parameters", "Refixturing", "Setup", "SolidReport", "StockBox"]
