"""ConstantScallop: finishing passes with the same cusp everywhere: the step follows the curvature."""

from cuspline.planning import freeform_finishing
from cuspline.planning.patterns import Pattern


class ConstantScallop(Pattern):
    """Finishing passes with the same cusp everywhere: the step follows the curvature."""

    kind = "constant_scallop"
    picture = """
         ___________
        ( (   (_)  ) )    lines of even cusp height
         ~~~~~~~~~~~"""

    def curves(self, field, cutter, ridge_mm):
        return freeform_finishing.pattern_curves("constant_scallop", field, cutter, ridge_mm)
