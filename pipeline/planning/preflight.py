"""What no plan could mend, told before planning: a stock that does not hold the part, places out of the machine's travel.

Only what is certain is refused; whether every move stays within the travels is judged on the posted text.
"""

import numpy as np

from cuspline.design.stock import StockBox
from cuspline.kernel import brep
from cuspline.kernel.solids import bodies_of, solid_of
from cuspline.kernel.tessellation import tessellate
from cuspline.replay.clearance import ClearanceTree
from cuspline.stock.workpiece import HELD_MM
from cuspline.values.errors import DesignError, PlanError, PostError

GAP_SHARE = 0.25            # of what the finish lets stand: so far may two faces be apart along their edge
PART_MM = 0.01              # of the part's triangles, where its solid is held against the stock's
LEAST_MM3 = 1e-6            # smaller bodies are rounding
EXACT_MM = 1e-5             # of how far it stands out
POINT = np.zeros((1, 5))    # a tool that is a point: its clearance is a distance


def refuse_impossible_setups(design, solid, machine, library):
    """
    Args:
        design: Design with setups.   solid: its TopoDS solid.   machine: Machine.   library: ToolLibrary.
    Raises:
        PlanError: all that is wrong, with the setup, both values, and how to mend it.
    """
    faults = list(_stock_faults(design.stock, solid))
    faces = brep.faces_of(solid)
    for k, setup in enumerate(design.setups):
        if setup.indexed:                   # where its axes stand is judged on the posted text
            faults += _turning_faults(setup, machine)
            continue
        boxes = [(f"face {f!r}", _box_of_faces(faces, design, f)) for f in setup.faces]
        if k == 0:
            faults += _travel_faults("stock", _within_reach(design.stock.shape.box_in(setup.turn), setup), setup, machine,
                                     library)
        for what, box in boxes:
            faults += _travel_faults(what, _within_reach(setup.turn.box_into(*box), setup), setup, machine, library)
    if faults:
        raise PlanError(f"design {design.name}: " + "; ".join(faults))


def _turning_faults(setup, machine):
    """An indexed position that the rotary axes cannot take."""
    axis = setup.clamped_frame.turn_into(np.array([setup.wcs_z]))
    if not machine.rotaries:
        yield (f"{setup.name} is an indexed position, and {machine.name} has no rotary axes: take a machine that has (`cuspline "
               "machines`), or make it a setup of its own, without indexed")
        return
    try:
        machine.kinematics.branches(axis)
    except PostError as error:
        yield f"{setup.name}: {str(error).removeprefix('row 0: ')}"


def refuse_gaps(design, solid):
    """
    Args:
        design: Design with a finish.   solid: as every stage sees it.
    Raises:
        DesignError: two faces lie farther apart along their edge than a share of what the finish lets stand.
    """
    gap, place = brep.widest_gap(solid)
    allowed = GAP_SHARE * (design.finish.scallop_mm + design.finish.profile_tolerance_mm)
    if gap > allowed:
        raise DesignError(
            f"design {design.name}: two faces are {gap:.2g} mm apart along their edge at ({', '.join(f'{x:.3f}' for x in place)}), "
            f"a quarter of what the finish lets stand is {allowed:.2g} mm: close the edge in the CAD program, or state a "
            f"scallop_mm of at least {gap / GAP_SHARE - design.finish.profile_tolerance_mm:.2g}")


def _stock_faults(stock, solid):
    """The part must lie within what it is cut from; a skin is laid round the part itself."""
    if getattr(stock, "thickest_mm", None) is not None:
        return
    if not isinstance(stock, StockBox):
        yield from _standing_out(stock, solid)
        return
    part_mm = brep.bounding_box_mm(solid)
    for k, axis in enumerate("XYZ"):
        low, high = float(part_mm[0][k]), float(part_mm[1][k])
        if low < stock.min_mm[k] - HELD_MM or high > stock.max_mm[k] + HELD_MM:
            yield (f"the part reaches {axis} {low:.3f} .. {high:.3f} mm, its stock only {stock.min_mm[k]:g} .. "
                   f"{stock.max_mm[k]:g} mm: enlarge the stock's min_mm and max_mm in {axis}")


def _standing_out(stock, solid):
    """Where the part stands out of a stock that is no box: of their solids, what the part has and the stock has not."""
    mesh, shape = tessellate(solid, PART_MM), stock.shape
    allowed = HELD_MM + mesh.deviation_mm + shape.error_mm
    around = ClearanceTree.of_triangles(*shape.mesh)
    worst, place = 0.0, None
    for body in bodies_of(solid_of(mesh.vertices_mm, mesh.triangles, "the part's mesh") - shape.solid, LEAST_MM3):
        away = around.distances_mm(POINT, body.vertices_mm, np.tile((0.0, 0.0, 1.0), (len(body.vertices_mm), 1)), EXACT_MM)
        thick = max(float(away.max()), 2.0 * body.volume_mm3 / body.area_mm2)       # all its corners may be in the walls
        if thick > worst:
            worst, place = thick, body.vertices_mm[away.argmax()]
    if worst > allowed:
        yield (f"the part stands {worst:.3f} mm out of its stock ({shape.in_words().lower()}) at X{place[0]:.3f} "
               f"Y{place[1]:.3f} Z{place[2]:.3f}: enlarge the stock, or lay it round the part")


def _box_of_faces(faces, design, name):
    """(low, high) (3,) of the faces of a predicate."""
    chosen = brep.named_faces(faces, design.predicates, (name,))
    boxes = np.array([brep.bounding_box_mm(f.shape) for f in chosen])
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)


def _within_reach(box, setup):
    """(low, high) (3,) in the WCS of a box in its directions, as far along X as the setup's tools go."""
    low, high = (np.array(corner) for corner in box)
    if setup.reach_x_mm is not None:
        low[0], high[0] = max(low[0], setup.reach_x_mm[0]), min(high[0], setup.reach_x_mm[1])
    zero = setup.turn.into(np.array([setup.wcs_origin_mm]))[0]
    return low - zero, high - zero


def _travel_faults(what, box, setup, machine, library):
    """Where no tool of the library can come; its middle may stay beside a place by its radius."""
    beside = max(t.cutter.largest_radius_mm for t in library.tools)
    lengths = [t.length_mm for t in library.tools]
    zero = machine.zero_mm(setup.zero_height_mm)
    for k, (name, axis) in enumerate(zip("XYZ", machine.axes)):
        low, high = (float(c[k]) + zero[k] for c in box)
        if name == "Z":
            low, high = low + max(lengths), high + min(lengths)
        slack = 0.0 if name == "Z" else beside
        if low < axis.min_mm - slack or high > axis.max_mm + slack:
            yield (f"{setup.name}: the {what} reaches {name} {box[0][k]:.1f} .. {box[1][k]:.1f} mm in {setup.wcs}, "
                   f"{'with its tool ' if name == 'Z' else ''}{low:.1f} .. {high:.1f} mm on {machine.name}, whose "
                   f"travel is {axis.min_mm:g} .. {axis.max_mm:g} mm: move the part by wcs_origin_mm, correct the "
                   "stock, or take a larger machine")
