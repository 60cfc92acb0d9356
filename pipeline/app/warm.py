"""Compiles the kernels of every build once, in several processes, so that the first one does not wait for it.

What few builds need (tilted cutters, transverse arcs) is compiled by the first of those.  The compiled code is kept
beside the sources (values/compiled.py): what has not changed is not compiled again.  So is Python's byte code of all that
a command imports, also where the environment forbids Python to keep it as it goes: it is half the time of a start.
"""

import importlib
import importlib.util
import pkgutil
import py_compile
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

import numpy as np

LATE = ("cadquery", "build123d", "matplotlib.backends.backend_svg", "pymeshlab")      # what functions import, or users' parts


def compiled(processes):
    """Compile, and give what has been compiled so far: an iterator of (how many of how many, what)."""
    made = _steps()
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(_run, number): what for number, (what, _) in enumerate(made)}
        for count, done in enumerate(as_completed(waiting), 1):
            done.result()
            yield count, len(made), waiting[done]


def _run(number):
    _steps()[number][1]()


def _steps():
    """(what, function) pairs, those that take longest first; each function makes its kernels compile."""
    return (("byte code", _byte_code), ("simulation and comparison", _simulation), ("drop-cutter on exact surfaces", _exact_drop),
            ("planning of a small part", _planning),
            ("certificate", _certificate), ("closest points", _closest_points), ("clearance", _clearance),
            ("drop-cutter on triangles", _drop_cutter), ("arc fitting", _arcs), ("arithmetic", _arithmetic),
            ("solids that cross themselves", _self_crossing), ("stock of any form", _shapes),
            ("surface evaluation", _surfaces), ("feeds", _feeds))


def _byte_code():
    """Keep the byte code of every module of ours and of what they import, where it is missing or older than its source."""
    import cuspline
    ours = [found.name for found in pkgutil.walk_packages(cuspline.__path__, "cuspline.") if not found.name.endswith("__main__")]
    for name in (*ours, *LATE):
        with suppress(ImportError):         # what is optional may be missing
            importlib.import_module(name)
    for module in list(sys.modules.values()):
        source, kept = getattr(module, "__file__", None), getattr(module, "__cached__", None)
        if source and kept and source.endswith(".py") and not _is_newer(kept, source):
            with suppress(py_compile.PyCompileError, OSError):      # it still runs from its source
                py_compile.compile(source, kept, doraise=True)


def _is_newer(kept, source):
    return Path(kept).exists() and Path(kept).stat().st_mtime >= Path(source).stat().st_mtime


def _arithmetic():
    from scipy import sparse

    from cuspline.toolpaths.freeform.grid_cholesky import Factors
    from cuspline.values import fixed_math as fixed
    matrix = np.diag([2.0, 3.0, 4.0])
    fixed.solve(matrix, np.ones(3))
    fixed.least_squares(matrix, np.ones((3, 1)))
    fixed.null_space_and_particular(matrix[:2], np.ones((2, 1)))
    fixed.singular_values(matrix)
    fixed.solve_banded(np.arange(3), np.ones((3, 1)), np.ones((3, 1)))
    Factors.of(sparse.csr_matrix(matrix), np.array([(0, 0), (0, 1), (0, 2)])).solve(np.ones(3))


def _surfaces():
    from cuspline.splines.nurbs import NurbsSurface
    poles = np.array([[[0, 0, 0, 1], [0, 1, 0, 1]], [[1, 0, 0, 1], [1, 1, 0, 1]]], float)
    plane = NurbsSurface(degree_u=1, degree_v=1, knots_u=[0, 0, 1, 1], knots_v=[0, 0, 1, 1], poles=poles)
    plane.derivatives(np.linspace(0, 1, 4), np.linspace(0, 1, 4))


def _small_part():
    """A plate with a dome and a round wall."""
    import cadquery as cq

    from cuspline.kernel import brep
    body = cq.Workplane().box(14, 12, 4, centered=(True, True, False)).union(cq.Workplane().circle(3).extrude(5.5))
    return brep.the_solid(body.union(cq.Workplane().sphere(3).translate((0, 0, 4))))


def _closest_points():
    from cuspline.kernel import brep
    from cuspline.surfaces.curvature import tightest_hollow
    from cuspline.surfaces.projection import ClosestTree
    faces = brep.faces_of(_small_part())
    tree = ClosestTree.of_faces(faces)
    tree.closest_points(np.linspace((-9, -9, 9), (9, 9, 5), 3))
    tree.patches.derivatives(0, np.zeros(3), np.zeros(3))
    tree.trims.is_inside(0, np.zeros(3), np.zeros(3))
    tightest_hollow(faces, range(len(faces)))


def _self_crossing():
    from cuspline.report.view_mesh import tessellate_for_view
    from cuspline.surfaces.rolling_ball import deepest_inside
    from cuspline.verification.self_crossing import self_crossings
    solid = _small_part()
    self_crossings(solid, tessellate_for_view(solid, 0.1))
    deepest_inside(np.zeros((1, 3)), np.ones((1, 3)), np.ones(1))


def _drop_cutter():
    from cuspline.toolpaths.drop.dropcutter import DropMesh, drop_contacts, drop_tips_mm, is_held_above
    mesh = DropMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    drop_tips_mm(mesh, np.zeros((1, 2)), 1.0, 0.5)
    drop_contacts(mesh, np.zeros((1, 2)), 1.0, 0.5)
    is_held_above(mesh, np.zeros((1, 2)), 1.0, 0.5, 0.0)


def _exact_drop():
    from cuspline.toolpaths.drop.exact_drop import ExactPart, drop_contacts
    part = ExactPart.of_solid(_small_part())
    drop_contacts(part, np.linspace((-8, -8), (8, 8), 4), 2.0, 2.0)


def _certificate():
    from cuspline.stock.outlines import frustum_outline
    from cuspline.toolpaths.drop.exact_drop import ExactPart
    from cuspline.toolpaths.gouge.depth_tree import DepthTree
    from cuspline.toolpaths.gouge.leaning_depths import FaceBoxes
    from cuspline.toolpaths.gouge.move_depths import move_depths
    tree = DepthTree.of_part(ExactPart.of_solid(_small_part()), 0.01)
    tips = np.linspace((-8, -8, 4), (8, 8, 4), 3)
    move_depths(tree, tips[:-1], tips[1:], 2.0, 2.0, 0.01)
    substep = np.array([[0.0, 0, 20, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0]])
    FaceBoxes.of_solid(_small_part(), 0.05).depths(substep, frustum_outline(0.0, 1.0, 2.0, 1.0), 0.01)


def _planning():
    """Rough, semi-finish, even scallops, parallel passes, waterlines."""
    from cuspline.app.catalogue import find_library, find_machine
    from cuspline.design import DEFAULT_MACHINE, Design, FacePredicate, Finish, Parameters, Setup, StockBox
    from cuspline.planning.plan import plan_setup
    from cuspline.planning.strategies.auto import Auto
    up = FacePredicate(name="dome", count=1, kinds=("sphere",))
    wall = FacePredicate(name="wall", count=1, kinds=("cylinder",))
    setup = Setup(name="warm", wcs_in_words="", faces=("dome", "wall"))
    design = Design(name="warm", description="", parameters=Parameters(), solid=_small_part(), predicates=(up, wall),
                    material="aluminium_6061", stock=StockBox(min_mm=(-7, -6, 0), max_mm=(7, 6, 8)), setups=(setup,),
                    finish=Finish(scallop_mm=0.04, profile_tolerance_mm=0.01, gouge_mm=0.01))
    for way in ("constant_scallop", "parallel"):
        plan_setup(design, setup.model_copy(update={"operations": (Auto(strategy=way),)}), find_machine(DEFAULT_MACHINE),
                   find_library(None))


def _arcs():
    from cuspline.toolpaths.sections.arcfit import fit_arcs
    from cuspline.values import fixed_math as fixed
    t = np.linspace(0.2, 1.0, 200)
    fit_arcs(np.column_stack([t, t * t * t]) * 10, fixed.arctan(3 * t ** 2), 0.01, 1e4)


def _feeds():
    from cuspline.planning.feeds import _ramped
    _ramped(np.ones(2), np.ones(2), np.zeros(3), 1.0)


def _clearance():
    from cuspline.replay.clearance import ClearanceTree, ToolMoves
    tree = ClearanceTree.of_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    tool, tips, axes = [[1.0, 1.0, 9.0, 2.0, 0.0]], [[0, 0, 5.0]], [[0, 0, 1.0]]
    tree.distances_mm(tool, tips, axes, 0.1)
    tree.certified_clearance(tool, ToolMoves(start_tips_mm=tips, end_tips_mm=[[0, 9.0, 5]], start_axes=axes,
                                             end_axes=[[0.6, 0, 0.8]]), 0.1)


def _shapes():
    from cuspline.stock.shapes import HERE, BoxShape, closed_mesh
    mesh = closed_mesh(*BoxShape(min_mm=(0, 0, 0), max_mm=(1, 1, 1)).mesh, 0.0, "the warm-up", "MESH")
    mesh.columns(HERE, np.zeros((1, 2)))
    mesh.tops_within_mm(HERE, np.zeros((1, 2)), 0.1)


def _simulation():
    """A whole little program against a little block, through both verifiers."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt

    from cuspline.app.catalogue import find_library, find_machine
    from cuspline.design import DEFAULT_MACHINE, Finish, Setup, StockBox
    from cuspline.kernel import brep
    from cuspline.posts.readers.rs274_reader import read_program
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
