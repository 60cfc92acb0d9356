"""What no plan could mend, told before planning: a stock that does not hold the part, places out of the machine's travel.

Only what is certain is refused; whether every move stays within the travels is judged on the posted text.
"""

import numpy as np

from cuspline.kernel import brep
from cuspline.values.errors import PlanError

HELD_MM = 1e-3              # the part may stand out of its stock by the kernel's own tolerance


def refuse_impossible_setups(design, solid, machine, library):
    """
    Args:
        design: Design with setups.   solid: its TopoDS solid.   machine: Machine.   library: ToolLibrary.
    Raises:
        PlanError: all that is wrong, with the setup, both values, and how to mend it.
    """
    faults = list(_stock_faults(design.stock, brep.bounding_box_mm(solid)))
    faces = brep.faces_of(solid)
    for k, setup in enumerate(design.setups):
        boxes = [(f"face {f!r}", _box_of_faces(faces, design, f)) for f in setup.faces]
        if k == 0:
            boxes.insert(0, ("stock", (np.array(design.stock.min_mm), np.array(design.stock.max_mm))))
        for what, box in boxes:
            faults += _travel_faults(what, _within_reach(box, setup), setup, machine, library)
    if faults:
        raise PlanError(f"design {design.name}: " + "; ".join(faults))


def _stock_faults(stock, part_mm):
    """The part must lie within the billet that it is cut from."""
    for k, axis in enumerate("XYZ"):
        low, high = float(part_mm[0][k]), float(part_mm[1][k])
        if low < stock.min_mm[k] - HELD_MM or high > stock.max_mm[k] + HELD_MM:
            yield (f"the part reaches {axis} {low:.3f} .. {high:.3f} mm, its stock only {stock.min_mm[k]:g} .. "
                   f"{stock.max_mm[k]:g} mm: enlarge the stock's min_mm and max_mm in {axis}")


def _box_of_faces(faces, design, name):
    """(low, high) (3,) of the faces of a predicate."""
    chosen = [f for p in design.predicates if p.name == name for f in brep.select_faces(faces, p)]
    boxes = np.array([brep.bounding_box_mm(f.shape) for f in chosen])
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _within_reach(box, setup):
    """(low, high) (3,) of a box in the WCS, as far along X as the setup's tools go."""
    low, high = setup.turn.box_into(*box)
    if setup.reach_x_mm is not None:
        low[0], high[0] = max(low[0], setup.reach_x_mm[0]), min(high[0], setup.reach_x_mm[1])
    zero = setup.turn.into(np.array([setup.wcs_origin_mm]))[0]
    return low - zero, high - zero


def _travel_faults(what, box, setup, machine, library):
    """Where no tool of the library can come; its middle may stay beside a place by its radius."""
    beside = max(t.cutter.largest_radius_mm for t in library.tools)
    lengths = [t.length_mm for t in library.tools]
    for k, (name, axis) in enumerate(zip("XYZ", machine.axes)):
        low, high = (float(c[k]) + machine.wcs_origin_mm[k] for c in box)
        if name == "Z":
            low, high = low + max(lengths), high + min(lengths)
        slack = 0.0 if name == "Z" else beside
        if low < axis.min_mm - slack or high > axis.max_mm + slack:
            yield (f"{setup.name}: the {what} reaches {name} {box[0][k]:.1f} .. {box[1][k]:.1f} mm in {setup.wcs}, "
                   f"{'with its tool ' if name == 'Z' else ''}{low:.1f} .. {high:.1f} mm on {machine.name}, whose "
                   f"travel is {axis.min_mm:g} .. {axis.max_mm:g} mm: move the part by wcs_origin_mm, correct the "
                   "stock, or take a larger machine")
