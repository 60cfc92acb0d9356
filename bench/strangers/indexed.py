"""Block on a five-axis mill: pocket, holes, a milled thread and chamfers in its front, as an indexed position."""

import build123d as bd

from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox, Thread

RISER = 60.0                # of the vice: the front is cut with the head beside the table


class Indexed(Parameters):
    """Nothing to choose."""


def design(p: Indexed) -> Design:
    part = bd.Box(50, 40, 30, align=(bd.Align.MIN,) * 3)
    front = bd.Plane(origin=(0, 0, 0), x_dir=(1, 0, 0), z_dir=(0, -1, 0))
    part -= bd.extrude(front * bd.Pos(17, 15) * bd.RectangleRounded(22, 18, 5.5), -5)
    part -= bd.extrude(front * bd.Pos(40, 8) * bd.Circle(2.5), -12)
    part -= bd.extrude(front * bd.Pos(40, 21) * bd.Circle(3.4), -14)
    part = bd.chamfer(part.edges().filter_by(bd.GeomType.CIRCLE).filter_by_position(bd.Axis.Y, -0.1, 0.1).filter_by_position(
        bd.Axis.X, 36, 44), 0.8)
    part = bd.Pos(0, 0, RISER) * part
    return Design(
        name="indexed", description="block with features in its front", parameters=p, solid=part,
        predicates=(FacePredicate(name="thread", count=1, kinds=("cylinder",),
                                  center_min_mm=(35, 2, RISER + 18), center_max_mm=(43, 15, RISER + 24)),
                    FacePredicate(name="front", at_least=10, center_min_mm=(2, 0.1, RISER + 2),
                                  center_max_mm=(48, 15, RISER + 28))),
        threads={"thread": Thread(size="M8", depth_mm=8)},
        machine="mill_trunnion_ac",
        material="aluminium_6061", stock=StockBox(min_mm=(0, 0, RISER), max_mm=(50, 40, RISER + 30)),
        finish=Finish(scallop_mm=0.05, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="front", faces=("front",), indexed=True, wcs_z=(0, -1, 0), clamped_x=(1, 0, 0), clamped_z=(0, 0, 1),
                      wcs_in_words="X0 Y0 lower left corner, Z0 on the table"),))
