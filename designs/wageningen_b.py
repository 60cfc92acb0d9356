"""Wageningen B-screw by number of blades, area ratio and pitch ratio (Oosterveld and van Oossanen 1975).

Tables and sources: data/propeller_bseries_*.csv.  Shaft along X, downstream; generator line of blade 1 along Z.
"""

from pydantic import Field

from cuspline.design import Design
from cuspline.designs.propellers.design import PropellerParameters, propeller_design
from cuspline.designs.propellers.tables import B_SERIES_HUB, OTHER_HUB, MainDimensions, b_series


class WageningenB(PropellerParameters):
    """The series' parameters, and what it leaves open."""

    blades: int = Field(default=4, ge=3, le=7)
    area_ratio: float = Field(default=0.55, ge=0.3, le=1.1,
                              description="expanded blade area over the area of the propeller's circle")
    pitch_ratio: float = Field(default=1.0, ge=0.4, le=1.6, description="nominal pitch over diameter")
    diameter_mm: float = Field(default=250.0, ge=50, le=1200)
    rake_deg: float = Field(default=15.0, ge=-20, le=30, description="of the generator line, downstream")
    edge_share: float = Field(default=0.08, ge=0.02, le=0.3,
                              description="thickness of the edges over the greatest of the section")
    hub_forward_share: float = Field(default=0.55, ge=0.2, le=0.8,
                                     description="of the hub's length is before the generator line")
    fillet_leading_edge_mm: float = Field(default=3.0, gt=0, le=200,
                                          description="radius of the fillet's ball at the leading edge; where none of the four is "
                                          "stated, a smaller one is taken if this does not fit")
    fillet_face_mm: float = Field(default=5.0, gt=0, le=200, description="at the middle of the face")
    fillet_trailing_edge_mm: float = Field(default=3.0, gt=0, le=200, description="at the trailing edge")
    fillet_back_mm: float = Field(default=5.0, gt=0, le=200, description="at the middle of the back")


def design(p: WageningenB) -> Design:
    """The screw; its solid is checked against the tables."""
    main = MainDimensions(p.blades, p.area_ratio, p.pitch_ratio, p.diameter_mm, p.is_right_handed)
    table = b_series(main, p.rake_deg, p.edge_share, p.edge)
    return propeller_design("wageningen_b", f"Wageningen {table.name}, P/D {p.pitch_ratio:g}", p, table,
                            B_SERIES_HUB.get(p.blades, OTHER_HUB))
