"""Camera mount: a plate with two adjusting slots, a recess for the camera, four M3 taps and a 1/4-20 UNC hole, on LinuxCNC."""

import build123d as bd

from cuspline.design import Design, Finish, Parameters, Setup, Thread


class CameraMount(Parameters):
    """Nothing to choose."""


def design(p: CameraMount) -> Design:
    with bd.BuildPart() as part:
        with bd.BuildSketch():
            bd.RectangleRounded(60, 44, 5)
        bd.extrude(amount=8)
        with bd.BuildSketch(bd.Plane.XY.offset(8)):
            bd.RectangleRounded(32, 26, 4)
        bd.extrude(amount=-3, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(8)):
            with bd.Locations((-23, 0), (23, 0)):
                bd.SlotOverall(22, 4.4, rotation=90)
        bd.extrude(amount=-8, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(5)):
            with bd.GridLocations(20, 16, 2, 2):
                bd.Circle(1.25)
        bd.extrude(amount=-5, mode=bd.Mode.SUBTRACT)
        with bd.BuildSketch(bd.Plane.XY.offset(5)):
            bd.Circle(2.55)
        bd.extrude(amount=-5, mode=bd.Mode.SUBTRACT)
    faces = part.faces().filter_by(bd.GeomType.CYLINDER)
    m3 = [f for f in faces if abs(f.radius - 1.25) < 1e-6]
    unc = [f for f in faces if abs(f.radius - 2.55) < 1e-6]
    rest = [f for f in part.faces() if f not in m3 and f not in unc and f.center().Z > 0.1]
    return Design(
        name="camera_mount", description="camera mount with slots and taps", parameters=p, solid=part.part,
        predicates={"m3": m3, "quarter": unc, "rest": rest},
        threads={"m3": "M3", "quarter": Thread(size="1/4-20 UNC")},
        material="aluminium_6061", machine="mill_3axis",
        finish=Finish(scallop_mm=0.03, profile_tolerance_mm=0.01, gouge_mm=0.012),
        setups=(Setup(name="setup-1", faces=("m3", "quarter", "rest"), wcs_in_words="X0 Y0 middle, Z0 on the base"),))
