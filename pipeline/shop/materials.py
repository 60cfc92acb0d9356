"""Cutting data of work materials for solid-carbide end mills.

Figures are starting values collected from makers' public pages (sources beside each row); they do
not replace the tool maker's own.  Feed per tooth is a share of the cutter diameter.
"""

from pydantic import Field

from cuspline.values.errors import InputError
from cuspline.values.models import Model


class Material(Model):
    """How fast a material is cut."""

    name: str
    description: str
    rough_speed_m_per_min: float = Field(gt=0)
    finish_speed_m_per_min: float = Field(gt=0)
    feed_per_tooth_share: float = Field(gt=0, description="feed per tooth / cutter diameter")
    stepdown_share: float = Field(gt=0, le=1, description="roughing stepdown / cutter diameter")
    coolant: str
    source: str


MATERIALS = {m.name: m for m in (
    Material(name="aluminium_6061", description="Al 6061-T6, ISO N", rough_speed_m_per_min=270,
             finish_speed_m_per_min=450, feed_per_tooth_share=0.008, stepdown_share=0.15, coolant="flood",
             source="270 m/min roughing: FreeCAD material card (Tabellenbuch Zerspantechnik 5th ed. p. 274); "
                    "200-700: Tungaloy solid end mills; 0.07-0.12 mm per tooth at 10 mm: Tungaloy"),
    Material(name="brass_c360", description="free-cutting brass, ISO N", rough_speed_m_per_min=250,
             finish_speed_m_per_min=300, feed_per_tooth_share=0.006, stepdown_share=0.15, coolant="off",
             source="250: FreeCAD material card; 0.06 mm per tooth at 10 mm: Torbide"),
    Material(name="copper_ofhc", description="OFHC copper C101, ISO N", rough_speed_m_per_min=150,
             finish_speed_m_per_min=220, feed_per_tooth_share=0.006, stepdown_share=0.10, coolant="flood",
             source="150 roughing: FreeCAD material card; 213-305: Torbide; 0.06 mm per tooth at 10 mm: Torbide"),
    Material(name="bronze_nial", description="nickel-aluminium bronze C95800", rough_speed_m_per_min=120,
             finish_speed_m_per_min=180, feed_per_tooth_share=0.006, stepdown_share=0.08, coolant="flood",
             source="61-152 for HSS x 2, 244-305 aluminium bronze (Torbide): taken low, one source each"),
    Material(name="steel_h13_48hrc", description="H13 tool steel, 47-49 HRC", rough_speed_m_per_min=50,
             finish_speed_m_per_min=70, feed_per_tooth_share=0.0064, stepdown_share=0.05, coolant="mist",
             source="40-80: Tungaloy; 0.064 mm per tooth at 10 mm: Osawa"),
    Material(name="steel_17_4ph", description="17-4PH H1025, 35-38 HRC", rough_speed_m_per_min=80,
             finish_speed_m_per_min=110, feed_per_tooth_share=0.004, stepdown_share=0.06, coolant="flood",
             source="60-165, 0.002-0.007 x D: ISCAR group 13; 60-120: Tungaloy"),
    Material(name="titanium_6al4v", description="Ti-6Al-4V", rough_speed_m_per_min=60,
             finish_speed_m_per_min=80, feed_per_tooth_share=0.003, stepdown_share=0.06, coolant="flood",
             source="60-90, 0.002-0.004 x D: ISCAR group 37; 40-80: Tungaloy"),
    Material(name="inconel_718", description="Inconel 718 aged", rough_speed_m_per_min=25,
             finish_speed_m_per_min=30, feed_per_tooth_share=0.003, stepdown_share=0.04, coolant="flood",
             source="20-35, 0.003 x D: ISCAR group 34; 20-40: Tungaloy"),
)}


def material_named(name):
    """The Material of that name.

    Raises:
        InputError: unknown; the message lists what there is.
    """
    if name not in MATERIALS:
        raise InputError(f"material {name!r} is not known; there are {', '.join(sorted(MATERIALS))}")
    return MATERIALS[name]
