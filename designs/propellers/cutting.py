"""How a propeller is cut on a rotary table that a turning pallet carries: indexed positions, blade after blade.

The shaft lies along the rotary table's axis, on an arbor that stands out of it; the casting has a skin on all sides.
Directions from which balls see blade 1 and its fillet are found by `planning.positions`, spindle and tables clear; the other
blades are cut from the same, turned by their angle, and by the same moves.

A position has two balls: the larger is through the blade in fewer passes, the smaller goes where that leaves too much: the fillet.
"""

from dataclasses import replace

import numpy as np

from cuspline.app.catalogue import find_library, find_machine
from cuspline.design import FixtureCylinder, Setup, StockSkin
from cuspline.designs.propellers.blade import about_x
from cuspline.kernel import brep
from cuspline.planning.cutter_choice import FIT_SHARE
from cuspline.planning.positions import UNIT_DECIMALS, Held, axes_along, positions
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.frames import Frame

MACHINE = "mill_a_on_b"
HELD = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)     # X and Z of the clamping: the shaft, and blade 1 at rest
EXTENDED = 100              # that the number of a tool in an extension is higher
EXTENSION_WALL_MM = 4.0     # round the shank at its nose
EXTENSION_SLOPE = 0.0524    # of its sides: 3 degrees, as such extensions are sold
SEEN_DEG = 58.0             # between the faces' normals and the tool where positions are chosen
CUT_DEG = 62.0              # and where they are cut: positions overlap
PLACES = 1500               # of a blade, that are looked at
MESH_MM = 0.02              # of the triangles that are looked at, off the part: a ball counts as touching within more
ARBOR_SHARE = 0.85          # of the hub's diameter
GAP_MM = 0.5                # between hub and arbor: the casting's skin, faced before


def cut(design, made, p):
    """The same design with what it is cut from and its setups.

    Args:
        design: Design without setups.   made: solid.PropellerSolid.   p: design.PropellerParameters with `blades_cut`.
    Raises:
        DesignError: the hub reaches the table.
    """
    count, arbor = made.blade.table.blades, _arbor(made.hub, p)
    order = blade_order(count, p.blade_order) if p.blades_cut == "all" else [0]
    balls = [extended(tool, p.extension_mm) for tool in _balls(p)]
    ways, turn = _ways(design, p, balls), 2 * np.pi / count
    setups = [_setup(k, j, about_x(k * turn), way, arbor, _operations(balls, j == 0)) for k in order for j, way in enumerate(ways)]
    told = (f"{len(order)} of {count} blades cut with {'its fillet' if len(order) == 1 else 'their fillets'}, all else stays as "
            "cast")
    return replace(design, description=f"{design.description}; {told}", stock=StockSkin(skin_mm=p.skin_mm), setups=tuple(setups),
                   machine=MACHINE, tools=tuple(balls) if p.extension_mm else ())


def blade_order(count, order):
    """Blades, from 0, one after the other.

    Args:
        count: of blades.   order: "around", or "apart": no two neighbours one after the other, where there are five or more, so
            that what is cut next still has the whole casting on both sides.

    >>> blade_order(4, "around"), blade_order(4, "apart"), blade_order(7, "apart")
    ([0, 1, 2, 3], [0, 2, 1, 3], [0, 2, 4, 6, 1, 3, 5])
    """
    return list(range(count)) if order == "around" or count == 3 else [*range(0, count, 2), *range(1, count, 2)]


def _balls(p):
    """[Tool]: the shop's largest ball that is no larger than the middle of the fillet, and the largest that rolls round its
    tightest place; one where both are the same; the shop's smallest where it has none so small."""
    balls, laws = find_library(None).of_type("ball"), (p.fillet_face_mm, p.fillet_back_mm)
    tightest = min(*laws, p.fillet_leading_edge_mm, p.fillet_trailing_edge_mm)
    largest = lambda radius_mm: next((t for t in balls if t.cutter.radius_mm <= radius_mm), balls[-1])
    return list({t.number: t for t in (largest(min(laws)), largest(FIT_SHARE * tightest))}.values())


def extended(tool, by_mm):
    """A Tool in a slim shrink-fit extension, which its holder takes in the tool's place; no longer: as it is."""
    if by_mm == 0:
        return tool
    nose = tool.cutter.shank_diameter_mm + 2 * EXTENSION_WALL_MM
    slim = HolderSegment(height_mm=by_mm, lower_diameter_mm=nose, upper_diameter_mm=nose + 2 * by_mm * EXTENSION_SLOPE)
    holder = Holder(name=f"shrink-fit extension {by_mm:g} mm, {tool.holder.name}", segments=(slim, *tool.holder.segments))
    return tool.model_copy(update={"number": tool.number + EXTENDED, "holder": holder})


def _operations(balls, is_first):
    """Of a position: the larger ball on what it sees well and no position before has finished, then one that fits the fillet
    where that leaves too much."""
    same = {"leave_steep": True, "steep_deg": CUT_DEG}
    rest = [Rest(tool=ball.number, **same) for ball in balls]
    return (Parallel(tool=balls[0].number, **same), *rest[1:]) if is_first else tuple(rest)


def _ways(design, p, balls):
    """(n, 3) directions from which blade 1 is cut, the one that sees most first.   balls: Tools."""
    solid = brep.the_solid(design.solid, f"design {design.name}")
    faces = brep.faces_of(solid)
    indices = brep.indices_of(faces, brep.named_faces(faces, design.predicates, _names(1)))
    ways = Held.on(find_machine(MACHINE), Frame.of_axes(np.zeros(3), *HELD))
    found = positions(solid, indices, find_library(None).model_copy(update={"tools": tuple(balls)}), ways=ways,
                      steepest_deg=SEEN_DEG, standing_mm=p.skin_mm, finely=(PLACES, MESH_MM))
    return [q.direction for q in found.positions]


def _names(blade):
    """Of the faces of a blade, counted from 1."""
    return (*(f"blade {blade} {part}" for part in ("face", "back", "leading edge", "trailing edge", "tip")), f"fillet {blade}")


def _arbor(hub, p):
    """What holds the hub, from the table's face on."""
    fore, table = hub.ends_mm[0], -p.arbor_mm
    if table >= fore - p.skin_mm - GAP_MM:
        raise DesignError(f"the hub begins {-fore:.1f} mm before the propeller's centre, the table's face stands {p.arbor_mm:g} mm "
                          "before it: enlarge arbor_mm, on a machine whose table stands so far away")
    return FixtureCylinder(name="arbor", from_mm=(table, 0, 0), to_mm=(fore - p.skin_mm - GAP_MM, 0, 0),
                           diameter_mm=ARBOR_SHARE * 2 * float(hub.profile(np.array([fore]))[0]))


def _setup(k, j, turn, way, arbor, operations):
    """Position j of blade k, both from 0.   turn: (3, 3) from blade 1 to it.   way: (3,) to blade 1."""
    wcs_x, wcs_z = (tuple((fixed.matmul(turn, v).round(UNIT_DECIMALS) + 0.0).tolist()) for v in axes_along(way))
    return Setup(name=f"blade-{k + 1}-{j + 1}", faces=_names(k + 1), indexed=True, clamped_x=HELD[0], clamped_z=HELD[1],
                 wcs_x=wcs_x, wcs_z=wcs_z, fixtures=(arbor,), operations=operations,
                 planned_as=None if k == 0 else f"blade-1-{j + 1}",
                 wcs_in_words="X along the shaft, Z along blade 1, zero in the propeller's centre")
