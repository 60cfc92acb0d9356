r"""Mould insert: a wavy crown with a boss, a dish and a through hole; every kind of trouble a free-form part brings.

        ____ boss
       /    \
    ‾‾‾      ‾‾\_dish_/‾‾‾|   |‾‾    crown, fillets at the feet
    |                     |   |  |   hole
    └─────────────────────┘   └──┘
"""

import math
from typing import Literal

import build123d as bd
from pydantic import Field, model_validator

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.planning.strategies.auto import Auto
from cuspline.values import fixed_math as fixed

NODES = (9, 7)              # of the crown's interpolated surface along x and y
BOSS, DISH, HOLE = (-18.0, -8.0), (16.0, 11.0), (20.0, -14.0)     # places in plan, mm


class MouldInsert(Parameters):
    """Dimensions of the insert; the block is centred on X0 Y0, its base at Z0."""

    length_mm: float = Field(default=76.0, ge=70, le=120)
    width_mm: float = Field(default=56.0, ge=52, le=100)
    height_mm: float = Field(default=18.0, ge=14, le=60, description="mean height of the crown")
    wave_mm: float = Field(default=1.6, ge=0, le=2.5, description="amplitude of the crown's waves")
    boss_diameter_mm: float = Field(default=15.0, ge=12, le=18)
    boss_height_mm: float = Field(default=8.0, ge=5, le=12, description="above the mean height of the crown")
    foot_radius_mm: float = Field(default=4.0, ge=2, le=4.5, description="concave fillet round the boss")
    rim_radius_mm: float = Field(default=1.5, ge=0.5, le=3, description="convex fillet on the boss")
    dish_radius_mm: float = Field(default=12.0, ge=9, le=14, description="of the spherical dish")
    dish_depth_mm: float = Field(default=3.2, ge=2.5, le=5)
    hole_diameter_mm: float = Field(default=9.0, ge=4, le=12)
    strategy: Literal["parallel", "constant_scallop"] = Field(default="constant_scallop", description="how the passes run")
    pass_angle_deg: float = Field(default=30.0, ge=-90, le=90, description="parallel passes: their direction from +X")
    stock_top_mm: float = Field(default=1.5, ge=0, le=20, description="stock above the boss")
    scallop_mm: float = Field(default=0.020, ge=0.002, le=0.5, description="largest cusp left")
    profile_tolerance_mm: float = Field(default=0.001, ge=0.0002, le=0.05, description="path against true surface")
    gouge_mm: float = Field(default=0.0015, ge=0.0005, le=0.05, description="deepest accepted cut below the surface")
    material: str = Field(default="aluminium_6061", description="work material, a name of `materials`")

    @model_validator(mode="after")
    def _boss_has_room_for_its_fillets(self):
        wall = self.boss_height_mm - self.wave_mm - self.rim_radius_mm - self.foot_radius_mm
        if wall < 0.3:
            raise ValueError(f"{wall:.2f} mm of wall are left between the boss's fillets, 0.3 are needed: "
                             "raise boss_height_mm or lower wave_mm, rim_radius_mm or foot_radius_mm")
        return self


def crown_height_mm(p, x, y):
    """Height of the crown's nodes."""
    return p.height_mm + p.wave_mm * fixed.sin(2 * math.pi * x / 48.0) * fixed.cos(2 * math.pi * y / 60.0)


def solid(p):
    """The insert as a build123d solid."""
    x, y = (p.length_mm / 2 + 2.0, p.width_mm / 2 + 2.0)
    nodes = [[bd.Vector(a, b, crown_height_mm(p, a, b)) for b in _evenly(-y, y, NODES[1])]
             for a in _evenly(-x, x, NODES[0])]
    crown = bd.Face.make_surface_from_array_of_points(nodes)
    under = bd.extrude(crown, 3 * p.height_mm, dir=(0, 0, -1))
    block = bd.Pos(0, 0, p.height_mm) * bd.Box(p.length_mm, p.width_mm, 2 * p.height_mm)
    body = block & under
    top = p.height_mm + p.boss_height_mm
    body += bd.Pos(*BOSS, top / 2) * bd.Cylinder(p.boss_diameter_mm / 2, top)
    body -= bd.Pos(*DISH, _dish_center_z(p)) * bd.Sphere(p.dish_radius_mm)
    body -= bd.Pos(*HOLE, p.height_mm) * bd.Cylinder(p.hole_diameter_mm / 2, 4 * p.height_mm)
    body = bd.fillet(_rings(body)[-1], p.rim_radius_mm)
    return bd.fillet(_rings(body)[0], p.foot_radius_mm)


def _rings(body):
    """The closed edges round the boss, from its foot to its top."""
    def is_round_the_boss(edge):
        middle = edge.bounding_box().center()
        return edge.is_closed and math.hypot(middle.X - BOSS[0], middle.Y - BOSS[1]) < 1.0

    return sorted(body.edges().filter_by(is_round_the_boss), key=lambda edge: edge.bounding_box().center().Z)


def _dish_center_z(p):
    return crown_height_mm(p, *DISH) - p.dish_depth_mm + p.dish_radius_mm


def _evenly(low, high, count):
    return [low + (high - low) * k / (count - 1) for k in range(count)]


def design(p: MouldInsert) -> Design:
    """The insert, ready to be planned: crown, dish, fillets and boss are finished, sides and hole finished before."""
    half = (p.length_mm / 2, p.width_mm / 2)
    inside = (half[0] - 0.5, half[1] - 0.5)
    return Design(
        name="mould_insert", description="Mould insert: wavy crown with boss, dish, fillets and a through hole",
        parameters=p, solid=solid(p),
        predicates=(FacePredicate(name="crown", count=5, normal=(0.0, 0.0, 1.0), normal_within_deg=89.0,
                                  center_min_mm=(-inside[0], -inside[1], 1.0), center_max_mm=(*inside, 200.0)),
                    FacePredicate(name="boss wall", count=1, kinds=("cylinder",), center_max_mm=(0.0, 0.0, 200.0))),
        material=p.material,
        stock=StockBox(min_mm=(-half[0], -half[1], 0.0),
                       max_mm=(*half, p.height_mm + p.boss_height_mm + p.stock_top_mm)),
        finish=Finish(scallop_mm=p.scallop_mm, profile_tolerance_mm=p.profile_tolerance_mm, gouge_mm=p.gouge_mm),
        setups=(Setup(name="setup-1", wcs="G54", operations=(
                          Auto(strategy=p.strategy, pass_angle_deg=p.pass_angle_deg),),
                      faces=("crown", "boss wall"),
                      wcs_in_words="X0 Y0 in the middle of the block, Z0 on its base (parallels)"),))
