"""TSlot: T-slots and dovetail slots under a neck, by a cutter of their form."""

from pydantic import Field

from cuspline.design.operations import Operation
from cuspline.planning import undercutting


class TSlot(Operation):
    """Straight T-slots and dovetail slots, open at one end at least, behind a plain slot for the neck: their faces are the floor,
    both sides and, of a T, what faces down on both sides of the neck. The cutter comes in from beside the part at the floor, along
    one side, and goes out along the other."""

    kind = "t_slot"
    picture = r"""
        __|   |__        neck: a plain slot before
       |  _| |_  |       T-slot cutter, as high as the slot or level by level;
       |_|_____|_|       dovetail cutter of the sides' angle"""
    is_mended = False

    tool: int | str | None = Field(default=None, description='a T-slot cutter ("side 16") or dovetail cutter ("dovetail 16") by '
                                   "number or size; left out: the widest that fits")

    def plan(self, work):
        return undercutting.undercut(work)
