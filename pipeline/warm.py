"""Compiles every kernel once, so that the first real build does not wait for it.

The compiled code is kept beside the sources (numba's cache) and made anew when they change.
"""

import numpy as np


def steps():
    """(what, function) pairs; each function makes its kernels compile."""
    return (("surface evaluation", _surfaces), ("drop-cutter", _drop_cutter), ("arc fitting", _arcs),
            ("feeds", _feeds), ("simulation and comparison", _simulation))


def _surfaces():
    from cuspline.surfaces.nurbs import SERIAL_ROWS, NurbsSurface
    poles = np.array([[[0, 0, 0, 1], [0, 1, 0, 1]], [[1, 0, 0, 1], [1, 1, 0, 1]]], float)
    plane = NurbsSurface(degree_u=1, degree_v=1, knots_u=[0, 0, 1, 1], knots_v=[0, 0, 1, 1], poles=poles)
    for count in (4, SERIAL_ROWS + 1):
        plane.derivatives(np.linspace(0, 1, count), np.linspace(0, 1, count))


def _drop_cutter():
    from cuspline.toolpaths.dropcutter import DropMesh, drop_tips_mm
    mesh = DropMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    drop_tips_mm(mesh, np.zeros((1, 2)), 1.0, 0.5)


def _arcs():
    from cuspline.toolpaths.arcfit import fit_arcs
    t = np.linspace(0.2, 1.0, 200)
    fit_arcs(np.column_stack([t, t ** 3]) * 10, np.arctan(3 * t ** 2), 0.01, 1e4)


def _feeds():
    from cuspline.planning.feeds import _ramped
    _ramped(np.ones(2), np.ones(2), np.zeros(3), 1.0)


def _simulation():
    """A whole little program against a little block, through both verifiers."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt
    from cuspline import brep
    from cuspline.catalogue import DEFAULT_MACHINE, find_library, find_machine
    from cuspline.design import Finish, Setup, StockBox
    from cuspline.posts.rs274_reader import read_program
    from cuspline.verification.verdict import verify_setup
    solid = brep.the_solid(BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(6, 6, 5)).Solid())
    top = [f for f in brep.faces_of(solid) if f.middle.normal[0, 2] > 0.9]
    machine, tools = find_machine(DEFAULT_MACHINE), {t.number: t for t in find_library(None).tools}
    kinds = {t.cutter.type: t.number for t in tools.values()}
    text = ["G21", "G17 G90 G94", "G64 P0.001", "G54"]
    for kind in ("flat", "bull_nose", "ball"):
        text += [f"T{kinds[kind]} M6", f"G43 H{kinds[kind]}", "S1000 M3", "G0 X-12 Y0", "G0 Z12", "G1 Z5 F500"]
        text += [f"G1 Y{y} F500\nG1 X{18 if y % 2 == 0 else -12}" for y in range(7)]
        text += ["G18 G2 X6 Z6 R40" if kind == "ball" else "G1 Z6", "G0 Z12"]
    moves = read_program("\n".join([*text, "G53 G0 Z0", "M2"]) + "\n", work_offsets={"G54": machine.wcs_origin_mm},
                         tool_lengths={n: t.length_mm for n, t in tools.items()})
    verify_setup(moves, tools, solid, top, setup=Setup(name="warm", wcs_in_words="", faces=("top",)),
                 stock=StockBox(min_mm=(0, 0, 0), max_mm=(6, 6, 6)), ball_radius_mm=2.0, machine=machine,
                 finish=Finish(scallop_mm=0.1, profile_tolerance_mm=0.01, gouge_mm=0.01))
