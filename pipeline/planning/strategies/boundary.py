"""Boundary: finishing passes along the border of the faces and their islands, inward."""

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class Boundary(Pattern):
    """Finishing passes along the border of the faces and their islands, inward."""

    kind = "boundary"
    picture = """
         ___________
        |  _______  |     along the border,
        | |_______| |     then inward
        |___________|"""

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves("boundary", field, cutter, ridge_mm)
