"""Sections: arcs and lines along the part's profile, plane by plane."""

from typing import Literal

from pydantic import Field

from cuspline.design.operations import Finishing
from cuspline.planning import section_finishing
from cuspline.planning.context import FinishingStage
from cuspline.planning.cutter_choice import choose_ball


class Sections(Finishing):
    """Finishing in vertical planes with a ball, in arcs and lines: for profiles swept along x or y."""

    kind = "sections"
    picture = """
         __
        /  \\__/\\       exact arcs and lines of the
       /         \\      ball's centre, plane by plane"""

    section_plane: Literal["ZX", "YZ"] = Field(default="ZX", description="plane in which the passes run")

    def plan(self, work):
        ball, candidates, reach = choose_ball(work.finishing_library, work.samples, work.hollow.radius_mm, work.mesh,
                                              work.practice.rough_allowance_mm, work.finishing_work())
        stage = FinishingStage(name=self.title, allowance_mm=self.allowance_mm, scallop_mm=work.finish.scallop_mm)
        made = section_finishing.finish(work, stage, ball, candidates, reach)
        return [made], reach.is_reached
