"""What `cuspline positions` tells of a part: directions of the tool from which its faces are seen, ready to be pasted."""

from pathlib import Path

import numpy as np

from cuspline.app import catalogue
from cuspline.app.face_list import STEP_FILES, solid_of
from cuspline.design.design import DEFAULT_MACHINE
from cuspline.kernel import brep
from cuspline.planning.positions import Held, directions, positions, turnable
from cuspline.shop.practice import ShopFile
from cuspline.values.errors import InputError

DECIMALS = 3


def position_rows(part, assignments, names, machine=None, cutters=None, steepest_deg=60.0):
    """One dict a position, and last one of what none of them sees.

    Args:
        part: a STEP file, or a design by name, Python file or job file.   assignments: ["name=value", ...] of a design.
        names: of a design's faces; none: those that its setups cut, or all that have a name; of a STEP file all faces.
        machine: by name or file; None: the design's.   cutters: tool library file; None: ours.
        steepest_deg: between a face's normal and the tool, at the most.
    Raises:
        InputError, DesignError, CutterDoesNotFit: what cannot be used, and why.
    """
    library, clamped = catalogue.find_library(cutters), None
    if Path(part).suffix.lower() in STEP_FILES:
        if names:
            raise InputError(f"--faces {names[0]}: the faces of a STEP file have no predicates; leave it out, or give a job file")
        solid, machine = solid_of(part, assignments), machine or DEFAULT_MACHINE
        indices = list(range(len(brep.faces_of(solid))))
    else:
        design = catalogue.make_design(catalogue.find_design(part), assignments)
        solid, machine = brep.the_solid(design.solid, f"design {design.name}"), machine or design.machine
        library = library.with_tools(design.tools)
        clamped = design.setups[0].clamped_frame if design.setups else None
        indices = _indices_of(design, brep.faces_of(solid), names)
    mill = catalogue.find_machine(machine)
    chain = mill.kinematics if mill.rotaries else None
    ways = turnable(directions(), chain, clamped) if clamped is None or chain is None else Held.on(mill, clamped)
    found = positions(solid, indices, library, ways=ways, steepest_deg=steepest_deg,
                      standing_mm=ShopFile().practice.rough_allowance_mm)
    return [_row(k, p, found) for k, p in enumerate(found.positions, 1)] + [_left(found)]


def _indices_of(design, faces, names):
    """Positions in the solid's own order of faces by the names of their predicates."""
    known = {p.name for p in design.predicates}
    if missing := [n for n in names if n not in known]:
        raise InputError(f"--faces {missing[0]}: design {design.name} has no faces of that name; there are "
                         f"{', '.join(sorted(known))}")
    wanted = names or {f for s in design.setups for f in s.faces} or known
    return brep.indices_of(faces, brep.named_faces(faces, design.predicates, wanted))


def _row(number, position, found):
    wcs_x, wcs_z = position.axes
    return {"number": number, "wcs_z": list(wcs_z), "wcs_x": list(wcs_x),
            "tool": position.tool.number, "name": position.tool.cutter.name,
            "sees_mm2": round(position.sees_mm2, DECIMALS), "adds_mm2": round(position.adds_mm2, DECIMALS),
            "adds_share": round(position.adds_mm2 / found.area_mm2, 6)}


def _left(found):
    at = None if np.isnan(found.left_at_mm).any() else (np.round(found.left_at_mm, DECIMALS) + 0.0).tolist()
    return {"left_mm2": round(found.left_mm2, DECIMALS), "of_mm2": round(found.area_mm2, DECIMALS), "at_mm": at}


def in_words(row):
    """Lines for people."""
    if "left_mm2" in row:
        where = "" if row["at_mm"] is None else f", about {' '.join(f'{v:g}' for v in row['at_mm'])}"
        return [f"left: {row['left_mm2']:g} of {row['of_mm2']:g} mm²{where}"]
    return [f"{row['number']}  {row['name']} (T{row['tool']}) adds {row['adds_mm2']:g} mm², {100 * row['adds_share']:.1f} %, "
            f"of {row['sees_mm2']:g} that it sees",
            f"  wcs_z={tuple(row['wcs_z'])}, wcs_x={tuple(row['wcs_x'])}"]
