"""Tools of plain proportions."""

from cuspline.shop.cutters import Cutter, HeadBox, Holder, HolderSegment, RightAngleHead, Tool

# a cutter that takes whatever a test of geometry asks of it
TAKES_ALL = {"slot_depth_mm": 1000.0, "ramp_deg": 90.0, "plunge_mm_per_tooth": 100.0}


def tool(type_, diameter, corner_radius=None, number=1, flutes=2):
    """A tool 45 mm out of a holder of diameter 40."""
    corner = {"ball": diameter / 2, "flat": 0.0}.get(type_, corner_radius)
    cutter = Cutter(name=f"{type_} {diameter}", type=type_, diameter_mm=diameter, corner_radius_mm=corner, flutes=flutes,
                    flute_length_mm=20, neck_diameter_mm=0.9 * diameter, reach_mm=30, shank_diameter_mm=diameter,
                    overall_length_mm=90, **TAKES_ALL)
    holder = Holder(name="collet", segments=(HolderSegment(height_mm=50, lower_diameter_mm=40, upper_diameter_mm=40),))
    return Tool(number=number, cutter=cutter, holder=holder, stick_out_mm=45)


def on_a_head(low=-14.0):
    """T7, a side cutter of 50 mm with teeth R3 on a right-angle head whose body reaches down to `low` beside it."""
    disc = Cutter(name="side cutter 50 R3", type="side", diameter_mm=50.0, corner_radius_mm=3.0, flutes=12,
                  flute_length_mm=6.0, neck_diameter_mm=16, reach_mm=15, shank_diameter_mm=16, overall_length_mm=30)
    head = RightAngleHead(name="head", cutter_points="-X", offset_mm=-60.0, length_mm=150.0, boxes=(
        HeadBox(min_mm=(12.0, -12.0, low), max_mm=(80.0, 12.0, 120.0)),))
    return Tool(number=7, stick_out_mm=14.0, cutter=disc, head=head, holder=Holder(name="arbor", segments=(
        HolderSegment(height_mm=2, lower_diameter_mm=16, upper_diameter_mm=16),)))
