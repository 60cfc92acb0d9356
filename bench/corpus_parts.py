"""Seeded parts as strangers draw them: one function a family, in CadQuery or build123d, handed over in code or as STEP.

A family is a function Dice -> Piece.  The same family, number and strategy give the same part on every machine; sizes are
rounded as on a drawing.  `design_of` is the Design of a piece; `job_of` writes its STEP file and the job file that names it.
"""

import json
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import build123d as bd
import cadquery as cq
import corpus_step
import numpy as np

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, StockCylinder, StockSolid
from cuspline.kernel import brep
from cuspline.planning.strategies.auto import Auto
from cuspline.planning.strategies.constant_scallop import ConstantScallop
from cuspline.planning.strategies.facing import Facing
from cuspline.planning.strategies.floor import Floor
from cuspline.planning.strategies.parallel import Parallel
from cuspline.planning.strategies.rest import Rest
from cuspline.planning.strategies.rough import Rough
from cuspline.planning.strategies.waterline import Waterline

FINISHES = ((0.08, 0.006, 0.008), (0.08, 0.006, 0.008), (0.04, 0.006, 0.008), (0.04, 0.005, 0.006), (0.02, 0.004, 0.005),
            (0.01, 0.0024, 0.003))     # scallop, profile tolerance, gouge: the last is the README's
FREE_FORM = ("parallel", "constant_scallop", "boundary", "spiral")
INSIDE_MM = 0.01        # inside the border of the part
FAMILIES = {}           # name -> (function Dice -> Piece, strategies)
WITHOUT_A_SOLID = ("two_solids", "open_shell")      # families with nothing to be cut: the answer is a sentence


@dataclass(frozen=True, eq=False, kw_only=True)
class Piece:
    """A part and how a stranger would have it cut."""

    solid: object                           # of CadQuery, build123d or the kernel
    faces: tuple                            # FacePredicate values
    stock: object = None                    # a value of design.stock; None: left out
    finish: tuple                           # scallop, profile tolerance, gouge, mm
    setups: tuple = ({},)                   # of each clamping what is not the default
    is_step: bool = False                   # handed over as a STEP file with a job file
    spoilt: Callable | None = None          # function (solid, path): writes the STEP file as somebody else's program would
    job: dict = field(default_factory=dict)     # more keys of the job file


class Dice:
    """What a drawing's author chooses, from a seed."""

    def __init__(self, seed):
        self._random = random.Random(seed)

    def mm(self, low, high, step=0.5):
        """A size on a grid."""
        return round(low + step * self._random.randrange(int(round((high - low) / step)) + 1), 4)

    def pick(self, *choices):
        return choices[self._random.randrange(len(choices))]

    def finish(self):
        return self.pick(*FINISHES)


def family(*strategies):
    """Register a family and the strategies that it is cut by, in turn; "" is what a setup does that says nothing."""
    def register(make):
        FAMILIES[make.__name__] = (make, strategies)
        return make
    return register


def piece_of(name, number):
    """The Piece of a family and a number."""
    return FAMILIES[name][0](Dice(f"{name} {number}"))


def operations_of(strategy):
    """The operations that a setup lists for a strategy's name."""
    if strategy == "":
        return ()
    if strategy == "listed":
        return Rough(), Parallel(steep_deg=60), Rest()
    if strategy == "scallop and waterline":
        return Rough(), ConstantScallop(steep_deg=50), Rest(strategy="constant_scallop")
    if strategy == "floor and walls":
        return Rough(), Floor(), Waterline(steep_deg=20)
    if strategy == "faced":
        return Facing(), Auto(strategy="parallel")
    if strategy == "YZ":
        return (Auto(section_plane="YZ"),)
    return (Auto(strategy=strategy),)


def design_of(name, number, strategy):
    """The Design of a case, as its design file returns it."""
    piece = piece_of(name, number)
    scallop, profile, gouge = piece.finish
    given = {} if piece.stock is None else {"stock": piece.stock}
    return Design(
        name=case_name(name, number, strategy), description=f"{name.replace('_', ' ')} {number}", parameters=Parameters(),
        solid=piece.solid, predicates=piece.faces, material="aluminium_6061", **given,
        finish=Finish(scallop_mm=scallop, profile_tolerance_mm=profile, gouge_mm=gouge),
        setups=tuple(_setup(k, piece, more, strategy) for k, more in enumerate(piece.setups, 1)))


def case_name(name, number, strategy):
    return "-".join([name, str(number), *strategy.split()])


def _setup(number, piece, more, strategy):
    given = {"name": f"setup-{number}", "wcs_in_words": "as the part is drawn", "faces": tuple(p.name for p in piece.faces)}
    return Setup(**{**given, **more}, operations=operations_of(strategy))


def write_case(name, number, strategy, folder):
    """Write what a stranger would hand to `cuspline build` into a folder; the file to be built."""
    piece, title = piece_of(name, number), case_name(name, number, strategy)
    if piece.is_step:
        return job_of(piece, title, strategy, Path(folder))
    path = Path(folder) / f"{title}.py"
    path.write_text(f'"""{name.replace("_", " ")} {number}."""\n\nfrom corpus_parts import design_of\n\n'
                    "from cuspline.design import Design, Parameters\n\n\ndef design(p: Parameters) -> Design:\n"
                    f"    return design_of({name!r}, {number}, {strategy!r})\n")
    return path


def job_of(piece, title, strategy, folder):
    """Write the STEP file and the job file of a piece; the job file."""
    (piece.spoilt or corpus_step.plain)(piece.solid, folder / f"{title}.step")
    scallop, profile, gouge = piece.finish
    keys = {"step": f"{title}.step", "material": "aluminium_6061",
            "finish": {"scallop_mm": scallop, "profile_tolerance_mm": profile, "gouge_mm": gouge}, **piece.job}
    if piece.stock is not None:
        keys["stock"] = piece.stock.model_dump(mode="json")
    text = "".join(f"{key} = {_toml(value)}\n" for key, value in keys.items())
    for face in piece.faces:
        text += "\n[[faces]]\n" + "".join(f"{k} = {_toml(v)}\n" for k, v in face.model_dump(mode="json").items()
                                          if v is not None)
    for k, more in enumerate(piece.setups, 1):
        setup = _setup(k, piece, more, strategy).model_dump(mode="json", exclude_defaults=True)
        text += "\n[[setups]]\n" + "".join(f"{k} = {_toml(v)}\n" for k, v in setup.items()
                                           if v is not None)
    path = folder / f"{title}.toml"
    path.write_text(text)
    return path


def _toml(value):
    """A value as TOML; JSON but for tables."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_toml(v)}" for k, v in value.items() if v is not None) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value)


# how a stranger says it -------------------------------------------------------------------------


def seen_from_above(shape, *, within_deg=89.5, below_mm=None, name="cut", **more):
    """Faces that look up (or stand upright, within 91 degrees), but for the part's own sides; `below_mm`: under the top."""
    low, high = brep.bounding_box_mm(brep.wrapped(shape))
    top = high[2] + INSIDE_MM if below_mm is None else high[2] - below_mm
    corner = lambda x, y, z: tuple(round(float(v), 4) for v in (x, y, z))
    return FacePredicate(**{"name": name, "at_least": 1, "normal": (0, 0, 1), "normal_within_deg": within_deg,
                            "center_min_mm": corner(*(low + INSIDE_MM)),
                            "center_max_mm": corner(high[0] - INSIDE_MM, high[1] - INSIDE_MM, top), **more})


def by_kind(*kinds, **more):
    """All faces of some kinds."""
    return FacePredicate(**{"name": "cut", "at_least": 1, "kinds": kinds, **more})


def box_stock(shape, above_mm=1.0, round_mm=0.0):
    """The box round the part, higher by so much."""
    low, high = brep.bounding_box_mm(brep.wrapped(shape))
    grown = np.array([round_mm, round_mm, 0.0])
    corner = lambda p: tuple(np.round(p, 4).tolist())
    return StockBox(min_mm=corner(low - grown), max_mm=corner(high + grown + (0, 0, above_mm)))


def from_above(dice, shape, *, above_mm=None, walls=False, top=None, **more):
    """The Piece whose faces seen from above are cut.

    Args:
        above_mm: stock over the part's top; None: 0, or half a millimetre to two.
        walls: whether upright walls inside are cut too.
        top: whether the level top is; None: where stock stands on it.
    """
    above = dice.pick(0.0, 0.5, 1.0, 2.0) if above_mm is None else above_mm
    has_top = above > 0 if top is None else top
    faces = seen_from_above(shape, within_deg=91.0 if walls else 89.5, below_mm=None if has_top else INSIDE_MM)
    return Piece(**{"solid": shape, "faces": (faces,), "stock": box_stock(shape, above), "finish": dice.finish(), **more})


def plate(dice, low=20, high=28, thick=(6, 10)):
    """(Workplane of a plate whose top is z = 0, its length, width, thickness)."""
    length, width, thickness = dice.mm(low, high, 1), dice.mm(low - 4, high - 8, 1), dice.mm(*thick, 1)
    return cq.Workplane().box(length, width, thickness, centered=(True, True, False)).translate((0, 0, -thickness)), (
        length, width, thickness)


def ball(radius_mm, x, y, z):
    return cq.Workplane().sphere(radius_mm).translate((x, y, z))


def rounded(pick, radius_mm):
    """The body of a Workplane's chosen edges with a fillet; smaller where the CAD kernel fails, as its user would try."""
    for share in (1.0, 0.8, 0.6, 0.4):
        try:
            return pick.fillet(share * radius_mm)
        except Exception:       # the kernel raises what it likes
            continue
    return pick.end()


# plates, pockets, holes -----------------------------------------------------------------------


@family("", "parallel", "constant_scallop", "boundary", "listed", "floor and walls", "spiral")
def pocket_in_a_plate(dice):
    """A pocket with round corners and a fillet at its foot, or none."""
    block, (length, width, _) = plate(dice)
    size, depth = (length - dice.mm(6, 8), width - dice.mm(5, 6)), dice.mm(1.5, 4)
    corner = dice.pick(2.5, 3.0, 4.0)
    hole = cq.Workplane().box(*size, depth, centered=(True, True, False)).edges("|Z").fillet(corner)
    foot = dice.pick(0.0, 1.0, 2.0, 2.5)
    hole = rounded(hole.faces("<Z").edges(), foot) if foot else hole
    return from_above(dice, block.cut(hole.translate((0, 0, -depth))), walls=True, above_mm=dice.pick(0.0, 0.0, 1.0))


@family("parallel", "", "constant_scallop", "listed")
def pockets_of_build123d(dice):
    """Two pockets of a plate made in build123d, their feet rounded."""
    length, width, thickness, depth = dice.mm(30, 34, 1), dice.mm(15, 18, 1), dice.mm(6, 8, 1), dice.mm(1.5, 3)
    foot = dice.pick(1.0, 1.5)
    with bd.BuildPart() as part:
        bd.Box(length, width, thickness, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX))
        with bd.BuildSketch():
            with bd.Locations((-length / 4, 0)):
                bd.RectangleRounded(length / 2 - 5, width - 6, dice.pick(3.0, 4.0))
            with bd.Locations((length / 4, 0)):
                bd.Circle(min(length / 4 - 2.5, width / 2 - 3))
        bd.extrude(amount=-depth, mode=bd.Mode.SUBTRACT)
        bd.fillet(part.faces().filter_by(bd.Axis.Z).group_by(bd.Axis.Z)[-2].edges(), foot)
    return from_above(dice, part.part, walls=True)


@family("", "parallel", "constant_scallop", "listed", "scallop and waterline")
def drafted_pocket(dice):
    """A pocket whose walls lean, with a sharp or a round foot."""
    block, (length, width, _) = plate(dice)
    depth, draft = dice.mm(2, 4), dice.pick(3.0, 5.0, 10.0, 15.0)
    tool = (cq.Workplane().rect(length - 6, width - 5).extrude(-depth, taper=draft))
    tool = tool.edges("not #Z").edges("not(|X or |Y)").fillet(dice.pick(3.5, 5.0))
    foot = dice.pick(0.0, 1.5, 2.5)
    tool = rounded(tool.faces("<Z").edges(), foot) if foot else tool
    return from_above(dice, block.cut(tool))


@family("", "parallel", "constant_scallop", "listed")
def holes_in_a_plate(dice):
    """Blind, through and counterbored holes in a plate, milled."""
    block, (length, width, thickness) = plate(dice, thick=(6, 10))
    through, blind = dice.mm(5, 8), dice.mm(6, 9)
    block = block.faces(">Z").workplane().pushPoints([(-length / 4, 0)]).cboreHole(through, through + 4, dice.mm(2, 3))
    block = block.cut(cq.Workplane().center(length / 4, dice.mm(-2, 2)).circle(blind / 2).extrude(-dice.mm(2, 5)))
    return from_above(dice, block, walls=True, above_mm=dice.pick(0.0, 0.0, 1.0))


@family("parallel", "constant_scallop", "", "boundary")
def bosses(dice):
    """Round and square bosses with round feet on a plate."""
    block, (length, width, _) = plate(dice)
    height, foot = dice.mm(2, 5), dice.pick(1.5, 2.5, 3.0)
    stubs = cq.Workplane().center(-length / 4, 0).circle(dice.mm(3, 4.5)).extrude(height, taper=dice.pick(0, 5))
    stubs = stubs.union(cq.Workplane().center(length / 4, 0).rect(dice.mm(6, 8), dice.mm(6, 8)).extrude(height)
                        .edges("|Z").fillet(2.0))
    body = block.union(stubs)
    feet = body.edges(cq.selectors.BoxSelector((-length / 2 + 1, -width / 2 + 1, -0.1), (length / 2 - 1, width / 2 - 1, 0.1)))
    return from_above(dice, rounded(feet, foot), walls=True, above_mm=dice.pick(0.5, 1.0))


@family("parallel", "constant_scallop", "")
def tiny_fillets(dice):
    """A large stepped block whose edges are broken by fillets of tenths."""
    length, width, step, radius = dice.mm(30, 44, 1), dice.mm(14, 20, 1), dice.mm(2, 4), dice.pick(0.2, 0.3, 0.5)
    block = cq.Workplane().box(length, width, 12, centered=(True, True, False)).translate((0, 0, -12))
    block = block.cut(cq.Workplane().box(length / 2, width + 2, step, centered=(False, True, False)).translate((0, 0, -step)))
    block = block.edges("|Y").edges(">Z").fillet(radius)
    return from_above(dice, block, above_mm=1.0)


@family("parallel", "listed", "constant_scallop")
def slots_and_chamfers(dice):
    """A keyway across, a slot with round ends, a chamfer along the top."""
    block, (length, width, _) = plate(dice)
    depth = dice.mm(2, 4)
    block = block.edges("|X and >Z").chamfer(dice.mm(1, 2))
    block = block.cut(cq.Workplane().slot2D(length * 0.55, dice.mm(6, 8)).extrude(-depth))
    return from_above(dice, block, walls=True)


@family("", "parallel", "listed", "faced")
def terraces(dice):
    """Steps across the whole part with upright or leaning walls and round feet."""
    depth, rise, lean = dice.mm(18, 24, 1), dice.mm(1.5, 3), dice.pick(0.0, 1.0)
    points, x, z = [(0, -10), (0, 0)], 0.0, 0.0
    for _ in range(3):
        x += dice.mm(8, 11)
        points.append((x, z))
        z -= rise
        points.append((x + lean, z))
    points += [(x + 10, z), (x + 10, -10)]
    block = cq.Workplane("XZ").polyline(points).close().extrude(-depth)
    foot = dice.pick(0.0, 2.0, 2.5)
    if foot and not lean:
        feet = block.edges("|Y").edges(cq.selectors.BoxSelector((1, -1, -9), (x + 9, depth + 1, -rise / 2)))
        block = rounded(feet, min(foot, rise / 2))
    return from_above(dice, block, walls=lean == 0.0, above_mm=1.0)


@family("constant_scallop", "parallel", "listed")
def tray(dice):
    """A shelled box open at its top, round inside."""
    length, width, height, wall = dice.mm(24, 28, 1), dice.mm(18, 20, 1), dice.mm(7, 9, 1), dice.pick(2.0, 3.0)
    box = cq.Workplane().box(length, width, height).edges("|Z").fillet(dice.mm(5.5, 7))
    box = box.faces("<Z").edges().fillet(dice.mm(3.5, 4.5))
    return from_above(dice, box.faces(">Z").shell(-wall), walls=True, above_mm=1.0, is_step=dice.pick(True, False))


@family("parallel", "constant_scallop")
def deep_slot(dice):
    """A groove deeper than short cutters reach."""
    block, (length, width, _) = plate(dice, thick=(26, 34))
    slot = cq.Workplane().box(length + 2, dice.mm(7, 9), dice.mm(16, 22), centered=(True, True, False))
    depth = slot.val().BoundingBox().zlen
    slot = slot.edges("|X and <Z").fillet(3.0).translate((0, 0, -depth))
    return from_above(dice, block.cut(slot), walls=True, above_mm=0.0)


# free form ------------------------------------------------------------------------------------


@family("parallel", "constant_scallop", "", "boundary", "spiral")
def loft_of_circles(dice):
    """A post lofted from a circle to an ellipse or a circle, on a plate: a closed polynomial face."""
    block, _ = plate(dice, 24, 28)
    low, high, height = dice.mm(6, 7), dice.mm(3, 4.5), dice.mm(3, 6)
    post = cq.Workplane().circle(low).workplane(offset=height)
    post = post.circle(high).loft() if dice.pick(True, False) else post.ellipse(high, high - 1).loft()
    body = block.union(post)
    return from_above(dice, body, above_mm=dice.pick(0.5, 1.0), is_step=dice.pick(True, True, False))


@family("constant_scallop", "parallel", "")
def loft_of_build123d(dice):
    """A square that becomes a circle, in build123d, out of the full block."""
    low, high, height = dice.mm(14, 18, 1), dice.mm(4, 5), dice.mm(4, 6)
    with bd.BuildPart() as part:
        bd.Box(low + 10, low + 10, 6, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX))
        with bd.BuildSketch():
            bd.RectangleRounded(low, low, 4)
        with bd.BuildSketch(bd.Plane.XY.offset(height)):
            bd.Circle(high)
        bd.loft()
    return from_above(dice, part.part, above_mm=1.0)


@family("constant_scallop", "parallel", "spiral")
def loft_through_ellipses(dice):
    """A smooth bowl or bump lofted through three ellipses."""
    block, _ = plate(dice, 24, 28)
    a, b, depth = dice.mm(9, 10), dice.mm(7, 8), dice.mm(2, 4)
    bowl = (cq.Workplane().ellipse(a, b).workplane(offset=-depth / 2).ellipse(0.8 * a, 0.75 * b)
            .workplane(offset=-depth / 2).ellipse(0.4 * a, 0.4 * b).loft())
    return from_above(dice, block.cut(bowl), is_step=dice.pick(True, False))


@family("spiral", "parallel", "constant_scallop", "", "boundary")
def revolved(dice):
    """A profile of arcs or a spline turned round Z, out of a round blank."""
    radius, height = dice.mm(9, 13), dice.mm(2, 4)
    profile = cq.Workplane("XZ").moveTo(0, -8).lineTo(radius, -8).lineTo(radius, 0)
    if dice.pick(True, False):
        profile = profile.spline([(0.6 * radius, 0.4 * height), (0, height)], tangents=[(-1, 0.4), (-1, 0)], includeCurrent=True)
    else:
        profile = profile.threePointArc((0.7 * radius, 0.55 * height), (0, height))
    body = profile.close().revolve(360, (0, 0), (0, 1))
    return Piece(solid=body, faces=(by_kind("revolution", "sphere", "bspline", "torus"),), finish=dice.finish(),
                 stock=StockCylinder(from_mm=(0, 0, -8), to_mm=(0, 0, round(height + 1, 4)), diameter_mm=2 * radius),
                 is_step=dice.pick(True, False))


@family("parallel", "constant_scallop", "spiral", "")
def turned_ring(dice):
    """A ring groove and a hub in a disc: tori, cones and cylinders, all closed."""
    radius, deep = dice.mm(12, 14), dice.mm(2, 3)
    disc = cq.Workplane().circle(radius).extrude(-8)
    groove = cq.Workplane("XZ").center(radius * 0.6, 0.5).circle(deep + 1).revolve(360, (-radius * 0.6, 0), (-radius * 0.6, 1))
    body = disc.cut(groove)
    faces = FacePredicate(name="cut", at_least=1, kinds=("torus",))
    return Piece(solid=body, faces=(faces,), finish=dice.finish(), is_step=dice.pick(True, False),
                 stock=StockCylinder(from_mm=(0, 0, -8), to_mm=(0, 0, dice.pick(0.0, 1.0)), diameter_mm=2 * radius))


def hilly(dice, length, width, count, height):
    """Points (m, n, 3) of a hilly surface over a rectangle."""
    m, n = count
    waves = [(dice.mm(0.5, 1.5, 0.1), dice.mm(0.5, 1.5, 0.1), dice.mm(0, 6, 0.1)) for _ in range(3)]
    x, y = np.linspace(-length / 2, length / 2, m), np.linspace(-width / 2, width / 2, n)
    high = lambda a, b: sum(math.sin(fx * a * 6.3 / length + p) * math.cos(fy * b * 6.3 / width) for fx, fy, p in waves) / 3
    return [[(a, b, height * high(a, b)) for b in y] for a in x]


def block_under(points, low_mm):
    """The solid between an interpolated surface and a level floor."""
    rows = [[cq.Vector(*p) for p in row] for row in points]
    patch = cq.Face.makeSplineApprox(rows, tol=1e-4, minDeg=3, maxDeg=5)
    (x0, y0, _), (x1, y1, _) = points[0][0], points[-1][-1]
    column = cq.Workplane().box(x1 - x0, y1 - y0, 60, centered=(True, True, False)).translate((0, 0, low_mm))
    return column.split(cq.Workplane(patch)).solids("<Z")


@family("parallel", "constant_scallop", "spiral", "boundary", "listed", "")
def sculptured(dice):
    """A hilly surface over a block."""
    points = hilly(dice, dice.mm(20, 26, 1), dice.mm(14, 18, 1), (14, 11), dice.mm(1, 2.5))
    body = block_under(points, -10)
    return Piece(solid=body, faces=(by_kind("bspline"),), stock=box_stock(body, 1.0), finish=dice.finish(),
                 is_step=dice.pick(True, False))


@family("parallel", "constant_scallop", "listed")
def sculptured_with_features(dice):
    """A hilly surface with a round boss and a hole through it."""
    length, width = dice.mm(24, 28, 1), dice.mm(16, 18, 1)
    body = block_under(hilly(dice, length, width, (12, 10), dice.mm(1, 2)), -10)
    boss = cq.Workplane().center(-length / 4, 0).circle(dice.mm(3, 4)).extrude(dice.mm(4, 5), taper=8)
    body = body.union(boss.translate((0, 0, -1)))
    body = body.cut(cq.Workplane().center(length / 4, 1).circle(dice.mm(2.5, 4)).extrude(30).translate((0, 0, -15)))
    return from_above(dice, body, above_mm=1.0, is_step=dice.pick(True, False))


@family("parallel", "constant_scallop")
def surface_of_build123d(dice):
    """A surface through points, in build123d, as the top of a block."""
    length, width = dice.mm(18, 22, 1), dice.mm(14, 16, 1)
    points = hilly(dice, length + 4, width + 4, (9, 8), dice.mm(1, 2))
    top = bd.Face.make_surface_from_array_of_points([[bd.Vector(*p) for p in row] for row in points])
    box = bd.Box(length, width, 20)
    body = bd.split(box, bisect_by=top, keep=bd.Keep.BOTH)
    body = min(body.solids(), key=lambda s: s.center().Z)
    return Piece(solid=body, faces=(by_kind("bspline"),), stock=box_stock(body, 1.0), finish=dice.finish())


@family("parallel", "constant_scallop", "")
def dome_and_cone(dice):
    """A spherical cap with its pole on top and a pointed cone on a plate."""
    block, (length, width, _) = plate(dice, 24, 28)
    cap, sunk = dice.mm(5, 8), dice.mm(1, 4)
    dome = ball(cap, -length / 4, 0, -sunk).intersect(cq.Workplane().box(99, 99, 40, centered=(True, True, False)))
    cone = cq.Workplane(cq.Solid.makeCone(dice.mm(4, 6), dice.pick(0.0, 0.0, 1.0), dice.mm(3, 5), pnt=(length / 4, 0, 0)))
    return from_above(dice, block.union(dome).union(cone), above_mm=dice.pick(0.5, 1.0), is_step=dice.pick(True, False))


@family("spiral", "constant_scallop", "parallel", "")
def cavity(dice):
    """A ball's or an ellipsoid's hollow in a plate, its pole at the bottom."""
    block, (length, width, thickness) = plate(dice, 24, 28, (8, 10))
    radius, depth = dice.mm(9, 14), dice.mm(2, 5)
    if dice.pick(True, False):
        hollow = ball(radius, 0, 0, radius - depth)
    else:
        half = cq.Workplane("XZ").moveTo(0, -radius).threePointArc((radius * 0.9, 0), (0, radius)).close()
        hollow = half.revolve(360, (0, 0), (0, 1)).translate((0, 0, radius - depth))
    return from_above(dice, block.cut(hollow), is_step=dice.pick(True, False))


@family("parallel", "", "constant_scallop")
def lying_tubes(dice):
    """A half-buried cylinder with round ends and a groove beside it."""
    block, (length, width, _) = plate(dice, 24, 28)
    radius = dice.mm(3, 5)
    tube = cq.Workplane("YZ").circle(radius).extrude(length / 4, both=True)
    tube = tube.union(ball(radius, -length / 4, 0, 0)).union(ball(radius, length / 4, 0, 0))
    groove = cq.Workplane("YZ").center(width / 2, 0).circle(dice.mm(3, 4)).extrude(length, both=True)
    return from_above(dice, block.union(tube.translate((0, -1, 0))).cut(groove), above_mm=1.0)


@family("", "YZ", "parallel", "constant_scallop")
def profile(dice):
    """Lines, arcs and a spline swept along Y (or X): tangent and creased."""
    length, depth = dice.mm(26, 32, 1), dice.mm(10, 14, 1)
    shape = (cq.Workplane("XZ").moveTo(0, -10).lineTo(0, 0).lineTo(length * 0.2, 0)
             .tangentArcPoint((length * 0.35, dice.pick(2.0, 3.0, -2.0)), relative=False))
    shape = shape.lineTo(length * 0.5, dice.pick(1.0, 2.0)).threePointArc((length * 0.65, dice.pick(-2.0, 3.0)), (length * 0.8, 0))
    shape = shape.lineTo(length, dice.pick(0.0, 1.0)).lineTo(length, -10).close().extrude(-depth)
    return from_above(dice, shape, above_mm=1.0, is_step=dice.pick(True, False))


@family("parallel", "constant_scallop", "")
def swept_groove(dice):
    """A round groove swept along a curve across a plate, in build123d."""
    length, width, radius = dice.mm(24, 28, 1), dice.mm(16, 20, 1), dice.mm(3, 4.5)
    with bd.BuildPart() as part:
        bd.Box(length, width, 10, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX))
        with bd.BuildLine() as line:
            bd.Spline((-length, -2, 0), (-length / 4, dice.mm(-3, 3), 0), (length / 4, dice.mm(-3, 3), 0), (length, 2, 0))
        with bd.BuildSketch(bd.Plane(origin=line.line @ 0, z_dir=line.line % 0)):
            bd.Circle(radius)
        bd.sweep(path=line.line, mode=bd.Mode.SUBTRACT)
    return from_above(dice, part.part, above_mm=dice.pick(0.0, 1.0))


@family("parallel", "constant_scallop")
def ribs(dice):
    """Drafted ribs with round tops and feet on a plate."""
    block, (length, width, _) = plate(dice, 24, 28)
    count, height, thick = dice.pick(2, 3), dice.mm(3, 5), dice.mm(3, 4)
    pitch, body = length / (count + 1), block
    for k in range(count):
        rib = cq.Workplane().center((k - (count - 1) / 2) * pitch, 0).rect(thick, width + 4).extrude(height, taper=5)
        body = body.union(rib.intersect(cq.Workplane().box(99, width, 40)))
    feet = body.edges("|Y").edges(cq.selectors.BoxSelector((-length / 2 + 0.5, -99, -0.1), (length / 2 - 0.5, 99, 0.1)))
    body = feet.fillet(dice.pick(1.0, 1.5))
    tops = body.edges("|Y").edges(">Z")
    body = tops.fillet(0.6) if dice.pick(True, False) else body
    return from_above(dice, body, above_mm=1.0, is_step=dice.pick(True, False))


@family("parallel", "constant_scallop")
def text(dice):
    """Letters standing on a plate, or sunk into it."""
    words, size = dice.pick("OK", "H2", "T1", "7"), dice.mm(9, 12, 1)
    block, _ = plate(dice, 26, 32)
    is_raised, deep = dice.pick(True, False), dice.mm(0.5, 1.5)
    letters = cq.Workplane().text(words, size, deep if is_raised else -deep)
    body = block.union(letters) if is_raised else block.cut(letters)
    return from_above(dice, body, walls=True, above_mm=0.5 if is_raised else dice.pick(0.0, 0.5))


@family("parallel", "constant_scallop", "boundary")
def facets(dice):
    """A hilly ground of flat triangles, some two hundred, as a scan or a low-polygon model has."""
    length, width = dice.mm(18, 24, 1), dice.mm(14, 16, 1)
    grid = hilly(dice, length, width, (dice.pick(7, 9, 11), dice.pick(6, 8, 11)), dice.mm(1, 2.5))
    body = polyhedron_under(grid, -8)
    return Piece(solid=body, faces=(FacePredicate(name="cut", at_least=2, normal=(0, 0, 1), normal_within_deg=80),),
                 stock=box_stock(body, 1.0), finish=dice.finish(), is_step=dice.pick(True, False))


def polyhedron_under(grid, low_mm):
    """The solid of triangles over a grid of points, upright walls and a level floor."""
    m, n = len(grid), len(grid[0])
    corner = {(i, j): cq.Vector(*grid[i][j]) for i in range(m) for j in range(n)}
    polygons = []
    for i in range(m - 1):
        for j in range(n - 1):
            a, b, c, d = (corner[k] for k in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
            polygons += [[a, b, c], [a, c, d]]
    under = lambda p: cq.Vector(p.x, p.y, low_mm)
    for border in ([(i, 0) for i in range(m)], [(m - 1, j) for j in range(n)], [(i, n - 1) for i in range(m)][::-1],
                   [(0, j) for j in range(n)][::-1]):
        ring = [corner[k] for k in border]
        polygons.append(ring + [under(ring[-1]), under(ring[0])])
    polygons.append([under(corner[k]) for k in ((0, 0), (0, n - 1), (m - 1, n - 1), (m - 1, 0))])
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon(p, close=True)) for p in polygons]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


@family("parallel", "constant_scallop")
def many_small_faces(dice):
    """A field of little pyramids and dimples: many faces smaller than a cutter."""
    block, (length, width, _) = plate(dice, 26, 30)
    nx, ny, pitch = dice.pick(4, 5), dice.pick(3, 4), 4.0
    for i in range(nx):
        for j in range(ny):
            x, y = (i - (nx - 1) / 2) * pitch, (j - (ny - 1) / 2) * pitch
            if (i + j) % 2:
                block = block.union(cq.Workplane().center(x, y).rect(3, 3).extrude(0.8, taper=40))
            else:
                block = block.cut(ball(6, x, y, 5.7))
    return from_above(dice, block, above_mm=0.5)


@family("parallel", "constant_scallop")
def fan(dice):
    """Blades round a hub, rising from a disc: fifty faces and more."""
    count, radius, height = dice.pick(6, 8), dice.mm(14, 16, 1), dice.mm(2, 3)
    body = cq.Workplane().circle(radius).extrude(-6).union(cq.Workplane().circle(5).extrude(height))
    for k in range(count):
        blade = cq.Workplane().center(radius / 2 + 1, 0).rect(radius - 5, 2.0).extrude(height - 0.5, taper=8)
        body = body.union(blade.rotate((0, 0, 0), (0, 0, 1), 360 * k / count))
    faces = FacePredicate(name="cut", at_least=count, normal=(0, 0, 1), normal_within_deg=89.0, center_min_mm=(-99, -99, -1))
    return Piece(solid=body, faces=(faces,), finish=dice.finish(), is_step=True,
                 stock=StockCylinder(from_mm=(0, 0, -6), to_mm=(0, 0, height + 1), diameter_mm=2 * radius))


# other blanks, other clampings ----------------------------------------------------------------


@family("parallel", "constant_scallop")
def from_both_sides(dice):
    """A dish in the top and another in the bottom, cut in two clampings."""
    length, width = dice.mm(22, 26, 1), dice.mm(16, 18, 1)
    block = cq.Workplane().box(length, width, 10)
    above, under = dice.mm(14, 20), dice.mm(12, 16)
    block = block.cut(ball(above, dice.mm(-2, 2), 0, above + 3)).cut(ball(under, dice.mm(-2, 2), 0, -under - 3))
    top, bottom = (FacePredicate(name=name, count=2, normal=(0, 0, z), normal_within_deg=70)
                   for name, z in (("top", 1), ("bottom", -1)))
    return Piece(solid=block, faces=(top, bottom), finish=dice.finish(), setups=(
        {"faces": ("top",), "wcs_origin_mm": (0, 0, 5)},
        {"faces": ("bottom",), "wcs": "G55", "wcs_origin_mm": (0, 0, -5), "wcs_z": (0, 0, -1)}),
        stock=StockBox(min_mm=(-length / 2, -width / 2, -5.5), max_mm=(length / 2, width / 2, 5.5)))


@family("parallel", "constant_scallop", "")
def pre_machined(dice):
    """A dish finished from a blank that is near the part already: half a millimetre on its faces."""
    block, (length, width, thickness) = plate(dice, 24, 28, (8, 10))
    radius, deep, skin = dice.mm(14, 20), dice.mm(2, 4), dice.pick(0.3, 0.5, 1.0)
    body = block.cut(ball(radius, 0, 0, radius - deep))
    blank = block.cut(ball(radius - skin, 0, 0, radius - deep))
    faces = by_kind("sphere")
    return Piece(solid=body, faces=(faces,), finish=dice.finish(), stock=StockSolid(solid=blank.val().wrapped))


@family("parallel", "constant_scallop", "")
def lying_on_its_side(dice):
    """The part is drawn with its dish on a side: the setup turns it."""
    length, width = dice.mm(20, 24, 1), dice.mm(16, 18, 1)
    radius, deep = dice.mm(14, 20), dice.mm(2, 4)
    body = cq.Workplane().box(length, 10, width).cut(ball(radius, 0, -5 - radius + deep, dice.mm(-2, 2)))
    low, high = brep.bounding_box_mm(brep.wrapped(body))
    return Piece(solid=body, faces=(by_kind("sphere"),), finish=dice.finish(), is_step=dice.pick(True, False),
                 setups=({"wcs_origin_mm": (0, -5, 0), "wcs_z": (0, -1, 0), "wcs_x": (1, 0, 0)},),
                 stock=StockBox(min_mm=tuple((low - (0, 1, 0)).round(4).tolist()), max_mm=tuple(high.round(4).tolist())))


@family("parallel", "", "constant_scallop")
def no_stock_given(dice):
    """A wavy top; the job says nothing of the stock."""
    length, width = dice.mm(20, 24, 1), dice.mm(12, 15, 1)
    body = (cq.Workplane("XZ").moveTo(0, -8).lineTo(0, 0).spline([(length / 3, 2), (2 * length / 3, -1), (length, 1)],
                                                                includeCurrent=True).lineTo(length, -8).close().extrude(-width))
    return Piece(solid=body, faces=(by_kind("bspline", "extrusion"),), finish=dice.finish(), is_step=dice.pick(True, False))


# files of others ------------------------------------------------------------------------------


def dished_block(dice):
    """(Workplane of a small block with a dish and a rounded step, its Piece's faces)."""
    block, (length, width, _) = plate(dice, 20, 24)
    body = block.cut(ball(dice.mm(10, 14), -length / 5, 0, dice.mm(8, 10)))
    return body, seen_from_above(body)


def spoilt_piece(dice, spoilt, **more):
    body, faces = dished_block(dice)
    return Piece(**{"solid": body, "faces": (faces,), "stock": box_stock(body, 1.0), "finish": dice.finish(), "is_step": True,
                    "spoilt": spoilt, **more})


@family("parallel", "constant_scallop")
def step_in_inches(dice):
    """A STEP file written in inches."""
    return spoilt_piece(dice, corpus_step.in_inches)


@family("parallel", "constant_scallop")
def step_closed_within_a_micrometre(dice):
    """Vertices that lie a micrometre or two beside their faces, as fuse and fillet leave them."""
    return spoilt_piece(dice, partial(corpus_step.shaken, by_mm=dice.pick(0.0007, 0.0014, 0.002), seed=dice.mm(0, 99, 1)))


@family("parallel", "constant_scallop")
def step_closed_within_hundredths(dice):
    """Vertices and edges off by some hundredths of a millimetre."""
    return spoilt_piece(dice, partial(corpus_step.shaken, by_mm=dice.pick(0.01, 0.028), seed=dice.mm(0, 99, 1)))


@family("parallel", "constant_scallop")
def fused_and_filleted(dice):
    """Two bodies fused and their seam rounded in build123d, then through a STEP file."""
    length, width, radius = dice.mm(20, 24, 1), dice.mm(16, 18, 1), dice.mm(5, 6)
    with bd.BuildPart() as part:
        bd.Box(length, width, 8, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MAX))
        with bd.Locations((dice.mm(-2, 2), 0, -1)):
            bd.Sphere(radius)
        seam = part.edges().filter_by(bd.GeomType.CIRCLE).filter_by(lambda e: abs(e.center().Z) < 0.01)
        bd.fillet(seam, dice.pick(1.5, 2.5, 3.0))
        bd.split(bisect_by=bd.Plane.XY.offset(-7), keep=bd.Keep.TOP)
    return from_above(dice, part.part, above_mm=1.0, is_step=True)


@family("parallel", "constant_scallop")
def step_of_splines(dice):
    """All faces as B-splines, as some programs export them."""
    return spoilt_piece(dice, corpus_step.as_splines)


@family("parallel", "constant_scallop")
def step_of_degree_one(dice):
    """A top of one B-spline of degree one: creased along its knots."""
    length, width = dice.mm(22, 28, 1), dice.mm(14, 18, 1)
    body = corpus_step.ruled_block(hilly(dice, length, width, (dice.pick(4, 6), dice.pick(3, 5)), dice.mm(1, 2)), -8)
    return Piece(solid=body, faces=(by_kind("bspline", normal=(0, 0, 1), normal_within_deg=70),), stock=box_stock(body, 1.0),
                 finish=dice.finish(), is_step=True)


@family("parallel", "constant_scallop")
def step_of_an_assembly(dice):
    """A body with a place of its own inside an assembly."""
    return spoilt_piece(dice, corpus_step.placed_in_an_assembly)


@family("parallel", "constant_scallop")
def one_solid_of_two(dice):
    """A part and its screw in one file; the job names the part."""
    return spoilt_piece(dice, corpus_step.with_a_neighbour, job={"solid": 1})


@family("parallel")
def two_solids(dice):
    """A part and its screw in one file; nothing says which is cut."""
    return spoilt_piece(dice, corpus_step.with_a_neighbour)


@family("parallel")
def open_shell(dice):
    """Surfaces without a solid."""
    return spoilt_piece(dice, corpus_step.open_shell)
