"""Propeller by a few parameters of one's own, or by tables on disk.

Outline and thickness of the B-series about a skewed middle line, modified NACA 66 sections on the a = 0.8 mean
line, or on a thickness form and mean line of one's own; or columns over the radius, with section offsets if wanted.
Shaft along X, downstream; generator line of blade 1 along Z.
"""

from pydantic import Field, model_validator

from cuspline.design import Design
from cuspline.designs.propellers.design import PropellerParameters, propeller_design
from cuspline.designs.propellers.tables import BladeForm, MainDimensions, from_files, own_propeller


class Propeller(PropellerParameters):
    """A highly skewed five-bladed propeller unless told otherwise."""

    blades: int = Field(default=5, ge=3, le=9)
    area_ratio: float = Field(default=0.7, ge=0.2, le=1.2,
                              description="expanded blade area over the area of the propeller's circle")
    pitch_ratio: float = Field(default=1.1, ge=0.4, le=2.0, description="pitch over diameter from 0.7 R outward")
    root_pitch_share: float = Field(default=0.9, ge=0.6, le=1.2, description="pitch at the hub over that")
    diameter_mm: float = Field(default=300.0, ge=50, le=1200)
    hub_ratio: float = Field(default=0.2, ge=0.12, le=0.4, description="hub over propeller diameter")
    skew_deg: float = Field(default=36.0, ge=-30, le=90, description="of the tip, towards the trailing edge")
    rake_deg: float = Field(default=0.0, ge=-20, le=30, description="of the generator line, downstream")
    thickness_scale: float = Field(default=1.0, ge=0.5, le=2.0, description="on the thickness of the B-series")
    camber_share: float = Field(default=0.02, ge=0.0, le=0.06, description="greatest camber over chord at 0.7 R")
    radii_csv: str = Field(default="", description="file with columns r_R, c_D, P_D, skew_deg, rake_D, t0_D or t0_c, f0_c, "
                           "in place of the shape's parameters")
    offsets_csv: str = Field(default="", description="file with columns r_R, x_c, face_c, back_c; with radii_csv")

    sections_csv: str = Field(default="", description="file with columns x_c, half_thickness_t0, camber_f0, and camber_slope_f0, "
                              "nose_radius where known: thickness form and mean line, in place of modified NACA 66 on a = 0.8")

    @model_validator(mode="after")
    def _offsets_need_radii(self):
        if self.offsets_csv and self.sections_csv:
            raise ValueError("offsets_csv and sections_csv both say what sections look like: give one of them")
        if self.offsets_csv and not self.radii_csv:
            raise ValueError("offsets_csv needs radii_csv: chord, pitch, skew and rake stand there")
        return self


def design(p: Propeller) -> Design:
    """The propeller; its solid is checked against its tables."""
    if p.radii_csv:
        table = from_files(p.radii_csv, p.diameter_mm, p.blades, p.is_right_handed, p.offsets_csv or None,
                           p.sections_csv or None, p.edge)
    else:
        main = MainDimensions(p.blades, p.area_ratio, p.pitch_ratio, p.diameter_mm, p.is_right_handed)
        form = BladeForm(skew_deg=p.skew_deg, rake_deg=p.rake_deg, root_pitch_share=p.root_pitch_share,
                         thickness_scale=p.thickness_scale, camber_share=p.camber_share,
                         sections_csv=p.sections_csv or None, edge=p.edge)
        table = own_propeller(main, p.hub_ratio, form)
    return propeller_design("propeller", f"Propeller, {table.blades} blades, D {table.diameter_mm:g} mm", p, table,
                            p.hub_ratio)
