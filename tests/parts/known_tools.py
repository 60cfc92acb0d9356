"""Tools of plain proportions."""

from cuspline.cutters import Cutter, Holder, HolderSegment, Tool


def tool(type_, diameter, corner_radius=None, number=1, flutes=2):
    """A tool 45 mm out of a holder of diameter 40."""
    corner = {"ball": diameter / 2, "flat": 0.0}.get(type_, corner_radius)
    cutter = Cutter(name=f"{type_} {diameter}", type=type_, diameter_mm=diameter, corner_radius_mm=corner, flutes=flutes,
                    flute_length_mm=20, neck_diameter_mm=0.9 * diameter, reach_mm=30, shank_diameter_mm=diameter,
                    overall_length_mm=90)
    holder = Holder(name="collet", segments=(HolderSegment(height_mm=50, lower_diameter_mm=40, upper_diameter_mm=40),))
    return Tool(number=number, cutter=cutter, holder=holder, stick_out_mm=45)
