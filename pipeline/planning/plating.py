r"""Metal that is plated later lies below the design's faces by the plating, everywhere along their normals.

             design      ─────╮            a cutter less a skin of the plating's thickness p touches the design where the
             metal       ───╮ │ p          whole one, its centre in the same place, touches the metal: so everything is
          (__)         R-p  │ │            planned with the smaller cutter, and cut with the whole one, whose tip is
         (____)        R      ▼            lower by p

Offset surfaces share their normals, so this is exact for balls, corners, flats and cones alike.  The verdict goes the
same way: what cutters less that skin leave is held against the design.
"""

from dataclasses import replace

import numpy as np

from cuspline.values.errors import PlanError

TYPES = ("ball", "bull_nose", "flat", "tapered_ball", "side")      # whose skin leaves a cutter of a known type


def within_skin(tool, skin_mm):
    """The tool less a skin: all heights from its own tip, which stands higher by the skin's thickness.

    Args:
        tool: cutters.Tool of one of TYPES.   skin_mm: below its radius.
    """
    cutter, d = tool.cutter, tool.cutter.diameter_mm - 2 * skin_mm
    corner = max(cutter.corner_radius_mm - skin_mm, 0.0)
    heights = {name: getattr(cutter, name) - skin_mm for name in ("flute_length_mm", "reach_mm", "overall_length_mm")}
    if cutter.type == "side":           # the disc's middle stays where it is: its other face loses a skin too
        heights = {name: height - skin_mm for name, height in heights.items()}
    smaller = cutter.model_copy(update={
        **heights, "diameter_mm": d, "corner_radius_mm": d / 2 if cutter.type == "ball" else corner,
        "type": "flat" if cutter.type == "bull_nose" and corner == 0.0 else cutter.type})
    return tool.model_copy(update={"cutter": smaller, "stick_out_mm": tool.stick_out_mm - skin_mm})


def library_within_skin(library, skin_mm):
    """The library that a plated part is planned with: what has a skin to lose, each tool less of it.

    Raises:
        PlanError: no cutter is so large.
    """
    tools = tuple(within_skin(t, skin_mm) for t in library.tools
                  if t.cutter.type in TYPES and t.cutter.radius_mm > 2 * skin_mm)
    if not tools:
        raise PlanError(f"plating_mm {skin_mm:g}: no cutter of the library is more than twice as wide: correct the plating")
    return library.model_copy(update={"tools": tools})


def in_metal(operation, library, skin_mm):
    """A PlannedOperation of tools less their skin as it is cut: with the whole tools of the library.

    Args:
        operation: PlannedOperation.   library: ToolLibrary.   skin_mm: the plating.
    """
    whole = {t.number: t for t in library.tools}
    facts = {**operation.facts, "plating_mm": skin_mm, "candidates": [
        {**c, "diameter_mm": whole[c["tool"]].cutter.diameter_mm} for c in operation.facts.get("candidates", ())]}
    tool = whole[operation.tool.number]
    lower = 0.0 if tool.head else -skin_mm      # a head is driven by its disc's middle
    moves = operation.moves
    moves = replace(moves, start_mm=moves.start_mm + lower * moves.axis[0], end_mm=moves.end_mm + lower * moves.axis,
                    center_mm=moves.center_mm + lower * moves.axis)
    passes = operation.passes and operation.passes.shifted(np.array([0.0, 0.0, lower]))
    return replace(operation, tool=tool, moves=moves, passes=passes, facts=facts)
