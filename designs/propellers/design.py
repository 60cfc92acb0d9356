"""What all propeller designs share: hub, fillet, edges and finish as parameters; from a table to a Design."""

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from cuspline.design import Design, FacePredicate, Finish, Parameters, StockBox
from cuspline.designs.propellers.blade import blade_of
from cuspline.designs.propellers.checks import solid_report
from cuspline.designs.propellers.root import curved_hub, fitting, radius_round_root, straight_hub
from cuspline.designs.propellers.sections import TrailingEdge
from cuspline.designs.propellers.sections import table as read_table
from cuspline.designs.propellers.solid import HubCuts, propeller_solid
from cuspline.kernel import brep
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError

UNDER_HUB = 0.97            # the blade begins at this share of the hub's least radius under it
STOCK_MM = 2.0              # billet round the propeller
FILLETS = ("fillet_trailing_edge_mm", "fillet_face_mm", "fillet_leading_edge_mm", "fillet_back_mm")     # as in a RadiusLaw
SECTOR_MM = 1.0             # round the middle of a sector of the hub: others are farther away


class PropellerParameters(Parameters):
    """Hub, fillet, trailing edge, material and finish of any propeller; its blades come from the design."""

    hand: Literal["right", "left"] = Field(default="right", description="turning direction seen from aft, going ahead")
    hub_length_share: float = Field(default=0.40, ge=0.1, le=1.5, description="of the diameter")
    hub_forward_share: float = Field(default=0.5, ge=0.2, le=0.8,
                                     description="of the hub's length is before the generator line")
    hub_taper_deg: float = Field(default=0.0, ge=-20, le=20, description="half angle; the hub grows downstream when positive")
    hub_profile_csv: str = Field(default="", description="file with columns x_D, r_D in place of length, taper and ratio")
    bore_mm: float = Field(default=0.0, ge=0, description="diameter at the fore end; 0: none")
    bore_taper_deg: float = Field(default=0.0, ge=-10, le=10, description="half angle; the bore grows downstream when positive")
    key_width_mm: float = Field(default=0.0, ge=0, description="keyway; 0: none")
    key_depth_mm: float = Field(default=0.0, ge=0, description="keyway above the bore")
    bolts: int = Field(default=0, ge=0, le=24, description="holes of the bolt circle; 0: none")
    bolt_mm: float = Field(default=0.0, ge=0, description="diameter of the bolt holes")
    bolt_circle_mm: float = Field(default=0.0, ge=0, description="diameter of the bolt circle")
    fillet_leading_edge_mm: float = Field(default=4.0, gt=0, le=200,
                                          description="radius of the fillet's ball at the leading edge; where none of the four is "
                                          "stated, a smaller one is taken if this does not fit")
    fillet_face_mm: float = Field(default=8.0, gt=0, le=200, description="at the middle of the face")
    fillet_trailing_edge_mm: float = Field(default=4.0, gt=0, le=200, description="at the trailing edge")
    fillet_back_mm: float = Field(default=8.0, gt=0, le=200, description="at the middle of the back")
    trailing_edge: Literal["round", "square", "anti-singing"] = Field(default="round", description="how the trailing edge ends")
    trailing_edge_share: float = Field(default=0.0, ge=0, le=0.5, description="its thickness over the section's greatest; "
                                       "0: as the section table has it")
    bevel_chord_share: float = Field(default=0.06, ge=0.02, le=0.2, description="length of the anti-singing bevel over chord")
    bevel_leaves: float = Field(default=0.5, ge=0.2, le=0.9, description="share of the edge's thickness that the bevel leaves")
    density_g_per_cm3: float = Field(default=7.6, gt=0, le=25, description="for the mass")
    blades_cut: Literal["none", "one", "all"] = Field(default="none", description="blades that are finished with their fillets, "
                                                      "on a rotary table that a turning pallet carries; none: the solid alone")
    blade_order: Literal["apart", "around"] = Field(default="apart", description="of all blades: no two neighbours in turn where "
                                                    "that can be, or one after the other round the hub")
    hub_cut: bool = Field(default=False, description="the hub's sectors round the blades that are cut are finished too; not where "
                          "the propeller is flipped: dimples in their skin find it again")
    sides: Literal["auto", "together", "flipped"] = Field(
        default="auto", description="where blades are cut: face and back in one setup on a rotary table, or one side up and then "
        "the other, found again by dimples; auto: together up to 24 in")
    arbor_mm: float = Field(default=280.0, gt=0, le=1000, description="from the face of the rotary table to the propeller's "
                            "centre, where blades are cut: as the machine stands")
    extension_mm: float = Field(default=80.0, ge=0, le=300, description="of the slim shrink-fit extensions that the balls are held "
                                "in, where blades are cut; 0: as the library holds them")
    skin_mm: float = Field(default=0.6, ge=0.2, le=20, description="of the casting on all sides, where blades are cut")
    material: str = Field(default="bronze_nial", description="work material, a name of `materials`")
    scallop_mm: float = Field(default=0.010, ge=0.002, le=0.5, description="largest cusp left")
    profile_tolerance_mm: float = Field(default=0.0005, ge=0.0002, le=0.05, description="path against true surface")
    gouge_mm: float = Field(default=0.003, ge=0.0005, le=0.05, description="deepest accepted cut below the surface")

    @property
    def edge(self):
        return TrailingEdge(kind=self.trailing_edge, thickness_share=self.trailing_edge_share or None,
                            bevel_chord_share=self.bevel_chord_share, bevel_leaves=self.bevel_leaves)

    @property
    def is_right_handed(self):
        return self.hand == "right"


def propeller_design(name, description, p, table, hub_ratio):
    """The Design of a propeller.

    Args:
        name, description: of the design.
        p: PropellerParameters.
        table: PropellerTable.
        hub_ratio: hub diameter over propeller diameter at the generator line.
    """
    hub = hub_of(p, table.diameter_mm, hub_ratio)
    blade = blade_over(table, hub)
    law = radius_round_root(**{name.removeprefix("fillet_"): getattr(p, name) for name in FILLETS})
    if p.model_fields_set.isdisjoint(FILLETS):
        law = fitting(blade, hub, law)
        p = p.model_copy(update=dict(zip(FILLETS, law.radius_mm.tolist())))
    made = propeller_solid(blade, hub, law, HubCuts(
        bore_mm=p.bore_mm, bore_half_angle_rad=float(np.radians(p.bore_taper_deg)), key_width_mm=p.key_width_mm,
        key_depth_mm=p.key_depth_mm, bolts=p.bolts, bolt_mm=p.bolt_mm, bolt_circle_mm=p.bolt_circle_mm))
    low, high = brep.bounding_box_mm(made.solid)
    whole = Design(
        name=name, description=description, parameters=p, solid=made.solid, predicates=_predicates(made),
        material=p.material, stock=StockBox(min_mm=tuple((low - STOCK_MM).tolist()),
                                            max_mm=tuple((high + STOCK_MM).tolist())),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.profile_tolerance_mm, gouge_mm=p.gouge_mm),
        setups=(), measure=lambda solid: solid_report(made, solid, p.density_g_per_cm3),
        draw=lambda folder: _drawn(made, Path(folder)))
    return whole if p.blades_cut == "none" else _cut(whole, made, p)


def _cut(design, made, p):
    from cuspline.designs.propellers.cutting import cut  # planning: not to list the designs by
    return cut(design, made, p)


def _drawn(made, folder):
    from cuspline.designs.propellers.drawings import draw_propeller  # matplotlib: not to list the designs by
    draw_propeller(made, folder)


def hub_of(p, diameter_mm, hub_ratio):
    """Revolved by the parameters."""
    if p.hub_profile_csv:
        columns = read_table(p.hub_profile_csv)
        missing = [c for c in ("x_D", "r_D") if c not in columns]
        if missing:
            raise DesignError(f"hub profile {p.hub_profile_csv} has no column {', '.join(missing)}")
        return curved_hub(columns["x_D"] * diameter_mm, columns["r_D"] * diameter_mm)
    length = p.hub_length_share * diameter_mm
    fore = -p.hub_forward_share * length
    half_angle, radius = float(np.radians(p.hub_taper_deg)), hub_ratio * diameter_mm / 2
    least = radius + fixed.tan(half_angle) * (fore if half_angle > 0 else fore + length)
    if least <= 0:
        raise DesignError(f"the hub tapers to nothing: {radius:.2f} mm at the generator line, "
                          f"{p.hub_taper_deg:g} deg over {length:.1f} mm; taper it less")
    return straight_hub(fore, fore + length, radius, half_angle)


def blade_over(table, hub):
    """Blade of a table that begins under the hub's surface."""
    profile = hub.profile(np.linspace(*hub.ends_mm, 200))
    innermost = UNDER_HUB * float(profile.min()) / table.radius_mm
    if profile.max() / table.radius_mm >= 0.9:
        raise DesignError(f"propeller {table.name}: the hub's radius {profile.max():.2f} mm leaves no blade of "
                          f"{table.radius_mm:.2f} mm")
    return blade_of(table, innermost)


def _predicates(made):
    """The faces by their names; what a blade's tip is made of depends on the table.  A sector of the hub is told by its middle."""
    blades, middle = made.blade.table.blades, sum(made.hub.ends_mm) / 2
    turns = float(made.half_way(middle)) + 2 * np.pi * np.arange(blades) / blades
    middles = made.hub.points(turns, np.full(blades, middle))
    sectors = [FacePredicate(name=f"hub {k}", face_name="hub", count=1, center_min_mm=tuple((at - SECTOR_MM).round(6).tolist()),
                             center_max_mm=tuple((at + SECTOR_MM).round(6).tolist())) for k, at in enumerate(middles, 1)]
    each = [FacePredicate(name=f"blade {k} {part}", face_name=f"blade {k} {part}", at_least=1)
            for k in range(1, blades + 1) for part in ("face", "back", "leading edge", "trailing edge", "tip")]
    fillets = [FacePredicate(name=f"fillet {k}", face_name=f"fillet {k}", count=4) for k in range(1, blades + 1)]
    return (*each, *fillets, *sectors, FacePredicate(name="hub", face_name="hub", count=blades))
