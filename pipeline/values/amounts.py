"""Amounts as an operator reads them: lengths in millimetres, areas, numbers of things."""

import math

SPOT_MM2 = 0.1          # below that an area is a spot: its breadth says more than square millimetres


def counted(count, noun):
    """A number of things.

    >>> counted(1, "move"), counted(7189, "move"), counted(0, "finding")
    ('1 move', '7,189 moves', '0 findings')
    """
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def length(value_mm):
    """A length, to a tenth of a micrometre where it is small.

    >>> length(0.02134), length(1.2), length(31.4159)
    ('0.0213 mm', '1.200 mm', '31.42 mm')
    """
    size = abs(value_mm)
    return f"{value_mm:.{4 if size < 0.1 else 3 if size < 10 else 2}f} mm"


def over_area(area_mm2):
    """Where something spreads, by its area; "at a point" where it has none.

    >>> over_area(319.69), over_area(2.345), over_area(0.0021), over_area(0.0)
    ('over 320 mm²', 'over 2.3 mm²', 'on a spot about 0.05 mm across', 'at a point')
    """
    if area_mm2 <= 0:
        return "at a point"
    if area_mm2 < SPOT_MM2:
        return f"on a spot about {max(2 * math.sqrt(area_mm2 / math.pi), 0.01):.2f} mm across"
    return f"over {area_mm2:.{0 if area_mm2 >= 10 else 1}f} mm²"
