"""Spiral: one continuous finishing pass over a region without islands."""

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class Spiral(Pattern):
    """One continuous finishing pass over a region without islands."""

    kind = "spiral"
    picture = """
         _________
        |  _____  |       one pass from the border
        | |___  | |       to the middle
        |_______| |"""

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves("spiral", field, cutter, ridge_mm)
