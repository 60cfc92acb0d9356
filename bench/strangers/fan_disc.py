"""Fan-like disc: six raised, curved ridges on a dished plate round a hub with a bore, from a turned blank."""


import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, StockCylinder


class FanDisc(Parameters):
    """Nothing to choose."""


def design(p: FanDisc) -> Design:
    with bd.BuildSketch() as ridge:
        with bd.BuildLine():
            bd.ThreePointArc((8.6, 0), (17, 4), (26, 3))
            bd.ThreePointArc((26, 3), (26.9, 1.9), (26, 0.6))
            bd.ThreePointArc((26, 0.6), (17, 1.2), (8.6, -2.4))
            bd.Line((8.6, -2.4), (8.6, 0))
        bd.make_face()
    with bd.BuildPart() as part:
        with bd.BuildSketch(bd.Plane.XZ):
            with bd.BuildLine():
                bd.Polyline((4, 0), (30, 0), (30, 6))
                bd.ThreePointArc((30, 6), (18, 6.8), (9, 11))
                bd.Polyline((9, 11), (9, 16), (4, 16), (4, 0))
            bd.make_face()
        bd.revolve(axis=bd.Axis.Z)
        with bd.BuildSketch(bd.Plane.XY.offset(5)):
            with bd.PolarLocations(0, 6):
                bd.add(ridge.sketch)
        bd.extrude(amount=7.5)
    above = [f for f in part.faces() if f.center().Z > 0.1
             and not (f.geom_type == bd.GeomType.CYLINDER and f.radius > 29)]
    return Design(
        name="fan_disc", description="disc with curved ridges", parameters=p, solid=part.part, predicates={"above": above},
        material="aluminium_6061", machine="mill_heidenhain",
        stock=StockCylinder(from_mm=(0, 0, 0), to_mm=(0, 0, 16.5), diameter_mm=60),
        finish=Finish(scallop_mm=0.04, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("above",), wcs_in_words="X0 Y0 in the bore, Z0 below"),))
