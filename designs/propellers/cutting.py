"""How a propeller is cut by indexed positions, blade after blade: in one setup, or flipped.

Up to 24 in on a rotary table that a turning pallet carries: the shaft lies along the table's axis, on an arbor that stands out of
it. Larger ones lie on the table of a gantry whose head turns, one side up and then the other: posts under the blades, and dimples
in the hub's skin that are cut in the first setup and touched in the second. The casting has a skin on all sides.
Directions from which balls see blade 1 and its fillet are found by `planning.positions`, spindle and tables clear; the other
blades are cut from the same, turned by their angle, and by the same moves.

A position has two balls: the larger is through the blade in fewer passes, the smaller goes where that leaves too much: the fillet.
"""

from dataclasses import dataclass, replace

import numpy as np

from cuspline.app.catalogue import find_library, find_machine
from cuspline.design import FixtureCylinder, Marker, Setup, StockSkin
from cuspline.designs.propellers.blade import about_x
from cuspline.kernel import brep
from cuspline.planning.cutter_choice import FIT_SHARE
from cuspline.planning.positions import UNIT_DECIMALS, Held, axes_along, positions, ways_with_room
from cuspline.planning.strategies.dimples import Dimples
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.shop.cutters import Holder, HolderSegment
from cuspline.surfaces.curvature import sample_faces
from cuspline.values import fixed_math as fixed
from cuspline.values.errors import DesignError
from cuspline.values.frames import Frame

MACHINE = "mill_a_on_b"
GANTRY = "mill_gantry_5axis"   # for those that are flipped
ONE_SETUP_MM = 609.6        # diameter up to which one setup does: 24 in, what the rotary table takes
HELD = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)     # X and Z of the clamping: the shaft, and blade 1 at rest
SIDES = ("back", (-1.0, 0.0, 0.0)), ("face", (1.0, 0.0, 0.0))      # flipped: which is up, and where its Z points
TIP_1 = ("blade 1 tip",)    # what a position of dimples answers for, which finishes nothing: the least that others do
BLADE_1 = (0.0, 0.0, 1.0)   # X of both clampings then
STAND_MM = 240.0            # under the hub when flipped: room for a spindle that lies beside it
POST_AT = 0.7               # of the radius: where a post stands under each blade
POST_SHARE = 0.06           # of the diameter: its own
GAPS = 3                    # between blades, that markers lie in, at most
MARKER_SHARE = 0.32         # of the hub's length: how far from its middle they lie
MARKER_RAD = np.radians(50.0)       # round the shaft from the tool that cuts them, at most
DIMPLE_SHARE = 0.6          # of the skin, that a dimple is deep
EXTENDED = 100              # that the number of a tool in an extension is higher
EXTENSION_WALL_MM = 4.0     # round the shank at its nose
EXTENSION_SLOPE = 0.0524    # of its sides: 3 degrees, as such extensions are sold
SEEN_DEG = 58.0             # between the faces' normals and the tool where positions are chosen
CUT_DEG = 62.0              # and where they are cut: positions overlap
PLACES = 1500               # of a blade, that are looked at
CLOSER = 6000, 60.0         # and for what these positions leave; between normals and tool there
LEFT_SHARE = 0.01           # of a blade, that no direction sees: more is refused, less is for the verdict to find
MESH_MM = 0.02              # of the triangles that are looked at, off the part: a ball counts as touching within more
ARBOR_SHARE = 0.85          # of the hub's diameter
GAP_MM = 0.5                # between hub and arbor, blade and post: the casting's skin as it is
LEAST_DIMPLE_MM = 0.15
LEANS_DEG = tuple(range(0, 65, 5))      # of the tool, up from where a dimple looks
TURNS_DEG = tuple(range(-40, 45, 10))   # and round the shaft from there
BESIDE_MM = 3.0             # before its dimple, that the ball begins
AS_IT_IS = np.eye(3)


@dataclass(frozen=True, eq=False, kw_only=True)
class Clamping:
    """How the propeller is held."""

    side: str                   # begins its setups' names: "back-" where the back is up; "" both are seen at once
    machine: str
    x: tuple                    # of the WCS, part coordinates
    z: tuple
    zero_mm: tuple = (0.0, 0.0, 0.0)    # its zero, part coordinates
    in_words: str
    fixtures: tuple
    markers: tuple = ()         # Marker values that are touched in it
    cuts: tuple = ()            # Marker values that are cut in it for the clamping after
    dimples: tuple = ()         # [(direction (3,) in which they look, their names)] of these

    @property
    def held(self):
        """positions.Held."""
        return Held.on(find_machine(self.machine), Frame.of_axes(self.zero_mm, self.x, self.z), self.fixtures)


def cut(design, made, p):
    """The same design with what it is cut from and its setups.

    Args:
        design: Design without setups.   made: solid.PropellerSolid.   p: design.PropellerParameters with `blades_cut`.
    Raises:
        DesignError: the hub reaches the table; a skin too thin for the dimples.
    """
    count = made.blade.table.blades
    order = blade_order(count, p.blade_order) if p.blades_cut == "all" else [0]
    balls = [extended(tool, p.extension_mm) for tool in _balls(p)]
    clampings = _flipped(design, made, p, balls) if is_flipped(made.blade.table, p) else [_on_rotary_table(made, p)]
    solid = brep.the_solid(design.solid, f"design {design.name}")
    mesh, setups = brep.planning_mesh(solid, MESH_MM), []
    for clamping, ways in zip(clampings, _ways(design, solid, mesh, p, balls, clampings)):
        setups += [_position(clamping, f"markers-{j + 1}", TIP_1, way, (Dimples(markers=touched, tool=balls[-1].number),))
                   for j, (way, (_, touched)) in enumerate(zip(_leaning(clamping, mesh, p, balls[-1]), clamping.dimples))]
        setups += [_setup(clamping, k, j, _names(k + 1, p, clamping.side), about_x(k * 2 * np.pi / count), way,
                          _operations(balls, j == 0)) for k in order for j, way in enumerate(ways)]
    with_it = "its fillet" if len(order) == 1 else "their fillets"
    told = (f"{len(order)} of {count} blades cut with {with_it}{' and hub' if p.hub_cut else ''}, all else stays as cast"
            + ("; flipped between its sides" if len(clampings) > 1 else ""))
    return replace(design, description=f"{design.description}; {told}", stock=StockSkin(skin_mm=p.skin_mm), setups=tuple(setups),
                   machine=clampings[0].machine, tools=tuple(balls) if p.extension_mm else ())


def is_flipped(table, p):
    """Whether one side is cut after the other."""
    return table.diameter_mm > ONE_SETUP_MM if p.sides == "auto" else p.sides == "flipped"


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


def _ways(design, solid, mesh, p, balls, clampings):
    """[[(3,)]] directions from which blade 1 is cut in each clamping, those that see most first.

    Args:
        design: Design.   solid: its own.   mesh: of that.   p: PropellerParameters.   balls: Tools.   clampings: Clamping values.
    """
    held = [clamping.held for clamping in clampings]
    found = positions(solid, _of_blade_1(design, solid, p), find_library(None).model_copy(update={"tools": tuple(balls)}),
                      ways=tuple(held), steepest_deg=SEEN_DEG, standing_mm=p.skin_mm, finely=(PLACES, mesh, CLOSER))
    _refuse_unseen(found, balls, p)
    return [[q.direction for q in found.positions if q.held is one] for one in held]


def _refuse_unseen(found, balls, p):
    """
    Raises:
        DesignError: no direction sees some of the blade, and what would.
    """
    if found.left_mm2 <= LEFT_SHARE * found.area_mm2:
        return
    place, sizes = " ".join(f"{axis}{v:.1f}" for axis, v in zip("XYZ", found.left_at_mm)), [b.cutter.diameter_mm for b in balls]
    raise DesignError(
        f"blades_cut: no direction sees {found.left_mm2:.1f} of {found.area_mm2:.0f} mm2 of blade 1, about {place}, with balls of "
        f"{' and '.join(f'{size:g}' for size in sizes)} mm in extensions of {p.extension_mm:g} mm and a skin of {p.skin_mm:g} mm: "
        "another blade, the hub, spindle or table is in the way; change extension_mm or arbor_mm, take larger fillets, a thinner "
        "skin or fewer blades")


def _of_blade_1(design, solid, p):
    """Indices of its faces and its fillet's."""
    faces = brep.faces_of(solid)
    return brep.indices_of(faces, brep.named_faces(faces, design.predicates, _names(1, p)))


def _names(blade, p, side=""):
    """Of the faces that are cut with a blade, counted from 1; where it is flipped, those that a side up shows."""
    parts = [s for s in ("face", "back") if side in ("", f"{s}-")] + ["leading edge", "trailing edge", "tip"]
    return (*(f"blade {blade} {part}" for part in parts), f"fillet {blade}", *((f"hub {blade}",) if p.hub_cut else ()))


def _on_rotary_table(made, p):
    """Clamping with the shaft along the rotary table's axis: both sides are seen, nothing is flipped.

    Raises:
        DesignError: the hub reaches the table.
    """
    fore, table = made.hub.ends_mm[0], -p.arbor_mm
    if table >= fore - p.skin_mm - GAP_MM:
        raise DesignError(f"the hub begins {-fore:.1f} mm before the propeller's centre, the table's face stands {p.arbor_mm:g} mm "
                          "before it: enlarge arbor_mm, on a machine whose table stands so far away")
    return Clamping(side="", machine=MACHINE, x=HELD[0], z=HELD[1], fixtures=(_arbor(made.hub, p, table, fore),),
                    in_words="X along the shaft, Z along blade 1, zero in the propeller's centre")


def _flipped(design, made, p, balls):
    """[Clamping]: the back up, then the face; dimples that are cut in the first are touched in the second.

    Raises:
        DesignError: a skin too thin for dimples; a hub that is to be cut, where they are.
    """
    if p.hub_cut:
        raise DesignError("hub_cut: the propeller is flipped, and the dimples that find it again are in the hub's skin: leave the "
                          "hub to be turned, or take sides=together")
    mill, solid = find_machine(GANTRY), brep.the_solid(design.solid, f"design {design.name}")
    under_zero = mill.wcs_origin_mm[2] - mill.table_z_mm
    blade = sample_faces(brep.faces_of(solid), _of_blade_1(design, solid, p), across_axis=2).point_mm
    markers, dimples = _markers(made, p, balls[-1].cutter.radius_mm)
    found = []
    for side, z in SIDES:
        down = -z[0]                                        # along X
        end = made.hub.ends_mm[1 if down > 0 else 0]
        zero = end + down * (p.skin_mm + GAP_MM + STAND_MM)
        table = zero + down * under_zero
        posts = _posts(made.blade.table, p, blade, down, table)
        second = bool(found)
        found.append(Clamping(
            side=f"{side}-", machine=GANTRY, x=BLADE_1, z=z, zero_mm=(float(zero), 0.0, 0.0),
            fixtures=(_arbor(made.hub, p, table, end), *posts), markers=markers if second else (),
            cuts=() if second else markers, dimples=() if second else dimples,
            in_words=f"X along blade 1, Z along the shaft with the {side} of the blades up, zero {abs(zero):.3f} below the "
                     "propeller's centre" + (", found by the dimples in the hub" if second else "")))
    return found


def _arbor(hub, p, table, end):
    """What holds the hub, from the table's face to an end of it, x along the shaft."""
    stop = end + np.sign(table - end) * (p.skin_mm + GAP_MM)
    return FixtureCylinder(name="arbor", from_mm=(float(table), 0, 0), to_mm=(float(stop), 0, 0),
                           diameter_mm=ARBOR_SHARE * 2 * float(hub.profile(np.array([end]))[0]))


def _posts(table, p, blade_mm, down, foot):
    """FixtureCylinder under every blade, on the table.

    Args:
        table: PropellerTable.   blade_mm: (n, 3) places of blade 1.   down: +1, -1 along X.   foot: x of the table's face.
    """
    r, diameter = POST_AT * table.radius_mm, POST_SHARE * table.diameter_mm
    skew = float(np.interp(POST_AT, table.r_R[np.isfinite(table.skew_rad)], table.skew_rad[np.isfinite(table.skew_rad)]))
    place = np.array([0.0, table.hand * r * fixed.sin(skew), r * fixed.cos(skew)])
    over = fixed.hypot(*(blade_mm - place)[:, 1:].T) < diameter / 2
    top = down * float((down * blade_mm[over, 0]).max()) + down * (p.skin_mm + GAP_MM)
    posts = []
    for k in range(table.blades):
        _, y, z = fixed.matmul(about_x(2 * np.pi * k / table.blades), place).round(6).tolist()
        posts.append(FixtureCylinder(name=f"post {k + 1}", from_mm=(float(foot), y, z), to_mm=(top, y, z), diameter_mm=diameter))
    return tuple(posts)


def _markers(made, p, ball_mm):
    """(Markers in the hub's skin half way between blades, [(direction, their names)] from which a ball cuts them).

    Raises:
        DesignError: the skin is too thin.
    """
    deep = DIMPLE_SHARE * p.skin_mm
    if deep < LEAST_DIMPLE_MM:
        raise DesignError(f"a skin of {p.skin_mm:g} mm is too thin for dimples that find the propeller again once it is flipped: "
                          f"take skin_mm {LEAST_DIMPLE_MM / DIMPLE_SHARE:.2g} or more")
    blades, (fore, aft) = made.blade.table.blades, made.hub.ends_mm
    middle = (fore + aft) / 2
    offs = MARKER_SHARE * (aft - fore) * np.linspace(1.0, 0.1, 10)
    turned = np.abs(made.half_way(middle + np.concatenate([-offs, offs])) - made.half_way(middle)).reshape(2, -1).max(axis=0)
    off = float(offs[np.argmax(turned <= MARKER_RAD)])
    markers, dimples = [], []
    for gap in range(min(blades, GAPS)):
        number = gap * blades // min(blades, GAPS)
        angle = lambda x: made.half_way(x) + np.pi / blades + 2 * np.pi * number / blades
        x = np.array([middle - off, middle + off])
        on_hub = made.hub.points(angle(x), x)
        _, _, normals, _ = made.hub.foot(on_hub)
        places = on_hub + (p.skin_mm - deep + ball_mm) * normals
        mine = [Marker(name=f"hub {gap + 1}{'ab'[k]}", at_mm=tuple(place.round(6).tolist())) for k, place in enumerate(places)]
        way = float(angle(middle))
        dimples.append((np.array([0.0, fixed.cos(way), fixed.sin(way)]), tuple(m.name for m in mine)))
        markers += mine
    return tuple(markers), tuple(dimples)


def _leaning(clamping, mesh, p, ball):
    """[(3,)] directions from which the dimples of a Clamping are cut: as they look, or beside that and up as far as tool and head
    need it to have room over the casting; where nothing gives it, as they look.

    Args:
        clamping: Clamping.   mesh: of the solid.   p: PropellerParameters.   ball: Tool.
    """
    at, up, asked = {m.name: np.array(m.at_mm) for m in clamping.cuts}, np.array(clamping.z), []
    for look, names in clamping.dimples:
        places = np.array([at[name] for name in names])
        ways = [fixed.cos(lean) * fixed.matmul(about_x(turn), look) + fixed.sin(lean) * up
                for turn in np.radians(TURNS_DEG).tolist() for lean in np.radians(LEANS_DEG).tolist()]
        nearest_first = np.argsort(-fixed.matmul(np.array(ways), look).round(9), kind="stable")     # as near: in the order tried
        asked.append((np.vstack([places, places + BESIDE_MM * look]), [ways[i] for i in nearest_first]))
    found = ways_with_room(asked, clamping.held, ball, mesh, p.skin_mm) if asked else []
    return [look if way is None else way for way, (look, _) in zip(found, clamping.dimples)]


def _setup(clamping, k, j, names, turn, way, operations):
    """Position j of blade k, both from 0.   turn: (3, 3) from blade 1 to it.   way: (3,) to blade 1."""
    made = _position(clamping, f"blade-{k + 1}-{j + 1}", names, way, operations, turn)
    return made if k == 0 else made.model_copy(update={"planned_as": f"{clamping.side}blade-1-{j + 1}"})


def _position(clamping, name, faces, way, operations, turn=AS_IT_IS):
    """A direction of the tool; where it cuts dimples alone the faces are the other positions'."""
    wcs_x, wcs_z = (tuple((fixed.matmul(turn, v).round(UNIT_DECIMALS) + 0.0).tolist()) for v in axes_along(way))
    return Setup(name=f"{clamping.side}{name}", faces=faces, indexed=True, clamped_x=clamping.x, clamped_z=clamping.z,
                 wcs_origin_mm=clamping.zero_mm, wcs_x=wcs_x, wcs_z=wcs_z, fixtures=clamping.fixtures, markers=clamping.markers,
                 operations=operations, wcs_in_words=clamping.in_words)
