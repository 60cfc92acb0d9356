"""DTMB propeller 4119: three blades without skew and rake, 12 in, a standard of propeller research.

Table and sources: data/propeller_dtmb4119.csv.  Shaft along X, downstream; blade 1 along Z.  One blade
is cut unless told otherwise.
"""

from typing import Literal

from pydantic import Field

from cuspline.design import Design
from cuspline.designs.propellers.design import PropellerParameters, propeller_design
from cuspline.designs.propellers.tables import DTMB_4119_MM, dtmb_4119

HUB_RATIO = 0.2             # hub over propeller diameter, where the published table begins


class Dtmb4119(PropellerParameters):
    """Size of the model, and what the table leaves open: hub, fillet, edges."""

    diameter_mm: float = Field(default=DTMB_4119_MM, ge=50, le=1000, description="12 in as published")
    bore_mm: float = Field(default=25.4, ge=0, description="diameter at the fore end; 0: none")
    blades_cut: Literal["none", "one", "all"] = Field(default="one", description="blades that are finished with their fillets; "
                                                      "one: as many as fit a build's time, the others stay as cast")


def design(p: Dtmb4119) -> Design:
    """The propeller; its solid is checked against the table."""
    return propeller_design("dtmb_4119", "DTMB propeller 4119, three blades", p,
                            dtmb_4119(p.diameter_mm, p.is_right_handed, p.edge), HUB_RATIO)
