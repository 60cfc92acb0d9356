"""Dimples: seats for a measuring ball, cut into what stands on the part, so that a later setup finds it again."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import dimpling


class Dimples(Operation):
    """Seats of markers in the skin that a casting still has there: a ball is fed square to the face until its middle is in the
    marker's place, and back. A measuring ball of the same size then rests with its middle there, in this setup and in those
    after it. Nothing of the part is cut."""

    kind = "dimples"
    picture = r"""
           ( )            the marker: the middle of the ball
        ___\_/______      what the casting has more
        ____________      the part, which stays whole"""
    is_mended = False
    why_not_mended = "dimples finish no face, and no other position touches the place"

    markers: tuple[str, ...] = Field(min_length=1, description="names of markers of any setup of the design")

    def plan(self, work):
        return dimpling.dimples(work)
