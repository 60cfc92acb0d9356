"""What cannot be checked of a job's process since nobody has stated the figures: said before it is judged, in plan and header."""

from cuspline.process.drives import Drives
from cuspline.shop.cutting_forces import force_of
from cuspline.shop.tool_lives import life_of


def not_checked(machine, tools, material, shop):
    """What is not known, in words: () where everything is.

    Args:
        machine: machines.Machine.   tools: Tool values that are used.   material: its name.   shop: practice.ShopFile.
    """
    silent = sorted({t.number for t in tools if t.chatter is None})
    force = force_of(material, shop.forces)
    chatter = "chatter" if force is None else f"chatter of {', '.join(f'T{n}' for n in silent)}" if silent else ""
    known = {chatter: not chatter, "forces": force is not None, "drives": Drives.of(machine) is not None,
             "edge life": life_of(material, shop.lives) is not None}
    return tuple(words for words, is_known in known.items() if not is_known)
