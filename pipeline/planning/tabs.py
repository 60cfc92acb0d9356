"""Tabs of a contour: where there is room and stock for them, what the paths rise over, and what is told to be left."""

import numpy as np

from cuspline.design.tabs import Tab
from cuspline.toolpaths.prismatic.tabs import Over, ramp_mm, room_for, tab_lines
from cuspline.values.errors import PlanError

WIDTH_MM, HEIGHT_MM = 4.0, 1.0      # where an operation does not say
RAMP_SHARE = 0.9            # of the steepest way down that a cutter takes
BEYOND_MM = 0.8             # behind the cutter's way there must be stock, for a tab to hold to
STANDS_MM = 0.05
ROUGH_MM = 0.1              # by which roughing stays up longer


def tabs_on(work, tool, path, low_mm):
    """(Over values along the closed path of a finishing cutter's middle, Tab values).

    Raises:
        PlanError: no room, no stock, or a cutter that cannot come down as it is asked to.
    """
    operation, cutter = work.operation, tool.cutter
    if not path.is_closed:
        raise PlanError(f"{operation.title}: tabs are for closed contours: name all walls of the outline, or leave them out")
    width, height = operation.tab_width_mm or WIDTH_MM, operation.tab_height_mm or HEIGHT_MM
    is_square = operation.tab_shape == "square"
    if is_square and not cutter.plunges:
        raise PlanError(f"{operation.title}: behind a square tab the cutter comes straight down, and T{tool.number} {cutter.name} "
                        "does not cut at its centre: leave tab_shape out, or say is_centre_cutting in its file where it does")
    level = width + 2 * cutter.radius_mm
    down = 0.0 if is_square else ramp_mm(height, RAMP_SHARE * cutter.steepest_rad)
    try:
        begins = room_for(path, _wanted(work, path), level, down)
    except PlanError as error:
        raise PlanError(f"{operation.title}: {error}") from None
    overs = tuple(Over(begin_mm=b, level_end_mm=b + level, end_mm=b + level + down, top_mm=low_mm + height) for b in begins)
    return overs, tuple(_tab(work, path, over, cutter.radius_mm, low_mm, width) for over in overs)


def _wanted(work, path):
    """Lengths along the path of the tabs' middles."""
    operation = work.operation
    if operation.tabs is not None:
        return [(k + 0.5) / operation.tabs * path.length_mm for k in range(operation.tabs)]
    places = work.setup.turn.into(np.array([(x, y, 0.0) for x, y in operation.tab_places]))[:, :2]
    return [path.nearest(place) for place in places]


def _tab(work, path, over, radius_mm, low_mm, width_mm):
    """
    Raises:
        PlanError: no stock stands in its place, or none beyond.
    """
    lines = tab_lines(path, over, radius_mm, low_mm)
    core = lines["core_foot"][:, :2]
    near, far = core[:2].mean(axis=0), core[2:].mean(axis=0)
    beyond = far + BEYOND_MM * (far - near) / (2 * radius_mm)
    places = np.array([near + s * (far - near) for s in np.linspace(0.05, 1.0, 6)])
    if (work.stock_mm(places) < over.top_mm - STANDS_MM).any() or work.stock_mm(beyond[None])[0] < low_mm + STANDS_MM:
        x, y, z = work.in_part((*near, low_mm))
        raise PlanError(f"{work.operation.title}: at ({x:.3f}, {y:.3f}, {z:.3f}) no stock stands across the cutter's way "
                        f"of {2 * radius_mm:g} mm and behind it for a tab to hold to: more stock, a smaller cutter, another place")
    out = work.setup.turn.out
    told = {name: tuple(map(tuple, out(points).round(6).tolist())) for name, points in lines.items()}
    return Tab(setup=work.setup.name, operation=work.operation.title, width_mm=width_mm,
               height_mm=round(over.top_mm - low_mm, 6), **told)


def overs_from(overs, path, along_mm):
    """The same from another place along a closed path."""
    moved = [(o.begin_mm - along_mm) % path.length_mm - o.begin_mm for o in overs]
    return tuple(sorted((Over(begin_mm=o.begin_mm + by, level_end_mm=o.level_end_mm + by, end_mm=o.end_mm + by, top_mm=o.top_mm)
                         for o, by in zip(overs, moved)), key=lambda o: o.begin_mm))


def is_clear_of(overs, along_mm, beside_mm):
    """Whether a place along a path is so far from all tabs."""
    return all(along_mm < o.begin_mm - beside_mm or along_mm > o.end_mm + beside_mm for o in overs)


def overs_beside(overs, path, other):
    """(the other closed path, begun between two tabs of a path beside it; where its own are)."""
    ends = [o.end_mm for o in overs]
    begins = [o.begin_mm for o in overs[1:]] + [overs[0].begin_mm + path.length_mm]
    gap, end = max((begin - end, end) for begin, end in zip(begins, ends))
    at = lambda chain, along: chain.nearest(_place(path, along % path.length_mm))
    other = other.begun_at(at(other, end + gap / 2))
    made = [Over(top_mm=o.top_mm, **{name: at(other, getattr(o, name)) for name in ("begin_mm", "level_end_mm", "end_mm")})
            for o in overs]
    return other, tuple(sorted((o.wider(ROUGH_MM) for o in made), key=lambda o: o.begin_mm))


def _place(path, along_mm):
    element, along = path.place(along_mm)
    return element.at(along)
