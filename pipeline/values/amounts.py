"""Amounts as an operator reads them: lengths in millimetres, areas, numbers of things."""

import math

SPOT_MM2 = 0.1          # below that an area is a spot: its breadth says more than square millimetres
LEAST_SAID_MM2 = 0.05       # out of reach, that is told of


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


def left_in_words(unreachable):
    """What no cutter reaches, of the rows of verify.json; nothing where that is next to none.

    >>> left_in_words([{"area_mm2": 677.0, "largest_deviation_mm": 2.0}, {"area_mm2": 9.0, "stays_radius_mm": 1.5}])
    ['677.0 mm2 out of reach with up to 2.000 mm left', '9.0 mm2 in inner corners that stay R1.500']
    """
    corners, others = ([row for row in unreachable if ("stays_radius_mm" in row) is is_round] for is_round in (True, False))
    most = lambda rows, name: max((row[name] for row in rows), default=0.0)
    said = [(others, f"out of reach with up to {most(others, 'largest_deviation_mm'):.3f} mm left"),
            (corners, f"in inner corners that stay R{most(corners, 'stays_radius_mm'):.3f}")]
    areas = [(sum(row["area_mm2"] for row in rows), words) for rows, words in said]
    return [f"{area:,.1f} mm2 {words}" for area, words in areas if area >= LEAST_SAID_MM2]
