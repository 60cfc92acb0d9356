"""A small part, roughed and finished on a z-map: a realistic bundle without the rest of the pipeline."""

from dataclasses import replace

import numpy as np
import pytest

from cuspline.app.catalogue import find_machine
from cuspline.design import Finish
from cuspline.report.bundle import FaceMesh, PathPoints, ReportBundle, SetupBundle, StockReplay
from cuspline.report.machine_view import MachineBody, MachineTool, MachineView, Motion
from cuspline.stock.shapes import BoxShape
from cuspline.values.frames import Frame

LENGTH, WIDTH, TOP, STOCK_TOP, PITCH = 60.0, 40.0, 20.0, 22.0, 0.5
GROOVE_X, GROOVE_R, STEP_X, STEP_Z = 20.0, 8.0, 42.0, 14.0
BALL_R, FLAT_R, ALLOWANCE = 5.0, 6.0, 0.3
CHORD = 0.003           # lifts the finishing pass by what its chords cut off a rolled corner
CLEARANCE = 30.0
FLAT = {"number": 1, "name": "flat 12", "type": "flat", "diameter_mm": 12.0, "corner_radius_mm": 0.0,
        "flute_length_mm": 26.0, "stick_out_mm": 40.0,
        "holder": {"name": "ER32", "segments": [
            {"height_mm": 30.0, "lower_diameter_mm": 40.0, "upper_diameter_mm": 50.0}]}}
BALL = {"number": 3, "name": "ball 10", "type": "ball", "diameter_mm": 10.0, "corner_radius_mm": 5.0,
        "flute_length_mm": 22.0, "stick_out_mm": 35.0,
        "holder": {"name": "ER20", "segments": [
            {"height_mm": 6.0, "lower_diameter_mm": 20.0, "upper_diameter_mm": 28.0},
            {"height_mm": 24.0, "lower_diameter_mm": 34.0, "upper_diameter_mm": 34.0}]}}


def design_height_mm(x_mm):
    """Profile of the part, swept along Y: a flat with a round groove, then a step down."""
    groove = np.sqrt(np.maximum(GROOVE_R**2 - (x_mm - GROOVE_X) ** 2, 0.0))
    return np.where(x_mm > STEP_X, STEP_Z, TOP - groove)


def design_solid():
    """The same part as an OCP solid."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
    block = BRepPrimAPI_MakeBox(LENGTH, WIDTH, TOP).Shape()
    groove = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(GROOVE_X, 0, TOP), gp_Dir(0, 1, 0)), GROOVE_R, WIDTH).Shape()
    step = BRepPrimAPI_MakeBox(gp_Pnt(STEP_X, 0, STEP_Z), LENGTH, WIDTH, TOP).Shape()
    return BRepAlgoAPI_Cut(BRepAlgoAPI_Cut(block, groove).Shape(), step).Shape()


class ZMap:
    """The dumbest simulator there is: lowers nodes under a cutter, and writes down when."""

    def __init__(self):
        self.x, self.y = np.arange(0, LENGTH + 1e-9, PITCH), np.arange(0, WIDTH + 1e-9, PITCH)
        self.height = np.full((len(self.y), len(self.x)), STOCK_TOP)
        self.points, self.rows, self.events = [np.array([0.0, 0.0, CLEARANCE])], [(True, 0.0, -1)], []

    def move(self, end_mm, feed, operation, radius, is_ball):
        """One straight move; the cut is sampled at half the pitch."""
        start, end = self.points[-1], np.array(end_mm, dtype=float)
        self.points.append(end)
        self.rows.append((feed is None, feed or 0.0, operation))
        if feed is not None:
            before = self.height.copy()
            for share in np.linspace(0, 1, max(2, int(np.linalg.norm(end - start) / PITCH * 2))):
                self._lower(start + (end - start) * share, radius, is_ball)
            cell = np.flatnonzero(self.height.ravel() < before.ravel() - 1e-9)
            self.events.append((np.full(len(cell), len(self.points) - 1), cell, self.height.ravel()[cell]))

    def _lower(self, tip, radius, is_ball):
        near = lambda nodes, at: slice(*np.searchsorted(nodes, (at - radius, at + radius)))
        rows, columns = near(self.y, tip[1]), near(self.x, tip[0])
        across = (self.x[None, columns] - tip[0]) ** 2 + (self.y[rows, None] - tip[1]) ** 2
        cut = tip[2] + (radius - np.sqrt(np.maximum(radius**2 - across, 0)) if is_ball else 0.0)
        window = self.height[rows, columns]
        np.minimum(window, np.where(across <= radius**2, cut, np.inf), out=window)


def cut_sample(zmap):
    """Roughs with the flat cutter, finishes with the ball, both along X."""
    fine = np.linspace(-10, LENGTH + 10, 2801)
    height = np.where((fine < 0) | (fine > LENGTH), 0.0, design_height_mm(fine))
    for y in np.arange(0, WIDTH + 1, 8.0):
        _pass(zmap, y, np.linspace(-7, LENGTH + 7, 149), fine, height + ALLOWANCE, FLAT_R, False, 0, 1200.0)
    for y in np.arange(0, WIDTH + 1e-9, 0.8):
        _pass(zmap, y, np.linspace(-5.5, LENGTH + 5.5, 285), fine, height + CHORD, BALL_R, True, 1, 900.0)


def _pass(zmap, y, xs, fine, height, radius, is_ball, operation, feed):
    shape = lambda d: radius - np.sqrt(np.maximum(radius**2 - d**2, 0)) if is_ball else 0.0 * d
    tips = [np.max(np.where(np.abs(fine - x) <= radius, height - shape(fine - x), 0.0)) for x in xs]
    cutter = (operation, radius, is_ball)
    zmap.move((xs[0], y, CLEARANCE), None, *cutter)
    zmap.move((xs[0], y, tips[0]), feed / 2, *cutter)
    for k, (x, z) in enumerate(zip(xs[1:], tips[1:])):
        zmap.move((x, y, z), feed * (0.6 if 40 < k < 70 else 1.0), *cutter)
    zmap.move((xs[-1], y, CLEARANCE), None, *cutter)


def sample_mesh(zmap):
    """Tessellation with the deviation of the simulated stock; walls and sides are not judged."""
    from scipy.interpolate import RegularGridInterpolator

    from cuspline.report.view_mesh import tessellate_for_view
    mesh = tessellate_for_view(design_solid(), 0.01, longest_edge_mm=1.2)
    left = zmap.height - design_height_mm(zmap.x)[None, :]
    at = RegularGridInterpolator((zmap.y, zmap.x), left, bounds_error=False)
    normal_z = mesh.normals[:, 2]
    deviation = at(mesh.vertices_mm[:, [1, 0]]) * normal_z
    return FaceMesh(vertices_mm=mesh.vertices_mm, normals=mesh.normals, triangles=mesh.triangles,
                    deviation_mm=np.where(normal_z > 0.3, deviation, np.nan), edges_mm=mesh.edges_mm)


def sample_setup(zmap):
    """The cut as one setup; WCS zero at the stock's top corner."""
    is_rapid, feed, operation = map(np.array, zip(*zmap.rows))
    points = np.array(zmap.points)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    minutes = np.r_[0.0, np.cumsum(length / np.where(is_rapid, 6000.0, np.maximum(feed, 1.0))[1:])]
    move, cell, z = map(np.concatenate, zip(*zmap.events))
    low, high = points.min(axis=0), points.max(axis=0)
    lift = np.array([0.0, 0.0, STOCK_TOP])
    return SetupBundle(
        markers=(("dowel", (5.0, 5.0, -STOCK_TOP)),), lies_in_words="", name="setup-1", program_file="setup-1.ngc",
        program_sha256="3f" * 32, program_lines=6412, program_bytes=183_204,
        machine="router-3x", control="LinuxCNC 2.9", units="mm", wcs="G54",
        wcs_in_words="X0 Y0 at the front left corner of the stock, Z0 on its top", frame=Frame.shift((0, 0, STOCK_TOP)),
        operation_first_lines=(24, 980), stock_box_mm=((0.0, 0.0, -STOCK_TOP), (LENGTH, WIDTH, 0.0)),
        stock_edges_mm=np.array(BoxShape(min_mm=(0, 0, 0), max_mm=(LENGTH, WIDTH, STOCK_TOP)).edges_mm), stock_in_words="",
        fixtures=(("jaw", np.array(BoxShape(min_mm=(0, -5, 0), max_mm=(LENGTH, 0, 3)).edges_mm)),),
        extents_mm=(tuple(low - lift), tuple(high - lift)),
        path=PathPoints(points_mm=points, is_rapid=is_rapid.astype(bool), feed_mm_per_min=feed, operation=operation,
                        time_s=minutes * 60, line=24 + np.arange(len(points)),
                        met={"depth_mm": np.where(is_rapid.astype(bool), np.nan, np.linspace(0.0, 2.5, len(points)))}),
        replay=StockReplay(origin_mm=(0.0, 0.0), pitch_mm=PITCH, nx=len(zmap.x), ny=len(zmap.y), bottom_mm=0.0,
                           top_mm=STOCK_TOP, design_top_mm=np.tile(design_height_mm(zmap.x), (len(zmap.y), 1)),
                           event_move=move, event_cell=cell, event_z_mm=z))


def sample_plan(setup):
    """plan.json as DESIGN.md says it."""
    ball_candidates = [
        {"tool": {"number": 5, "type": "ball", "diameter_mm": 20.0}, "diameter_mm": 20.0, "chosen": False,
         "reason": "radius 10.000 mm is above the minimum concave radius, 8.000 mm at X 20.000 Y 0.000 Z 12.000"},
        {"tool": BALL, "diameter_mm": 10.0, "chosen": True, "reason": "largest that fits with a margin of 1.2"},
        {"tool": {"number": 4, "type": "ball", "diameter_mm": 6.0}, "diameter_mm": 6.0, "chosen": False,
         "reason": "fits, but a larger one does too"}]
    rough = {"name": "rough", "tool": FLAT, "stepover_mm": 8.0, "scallop_mm": None, "segment_tolerance_mm": 0.05,
             "spindle_rpm": 8000, "feed_mm_per_min": 1200.0, "time_s": 41.0, "length_mm": 912.0, "blocks": 956,
             "allowance_mm": 0.3, "candidates": [
                 {"tool": FLAT, "diameter_mm": 12.0, "chosen": True, "reason": "largest flat cutter that fits"}]}
    finish = {"name": "finish", "tool": BALL, "min_concave_radius_mm": 8.0, "min_concave_radius_place_mm": [20, 0, 12],
              "stepover_mm": 0.8, "scallop_mm": 0.020, "segment_tolerance_mm": 0.0025, "spindle_rpm": 18000,
              "feed_mm_per_min": [540.0, 900.0], "time_s": float(setup.path.time_s[-1]) - 41, "length_mm": 3210.0,
              "blocks": 5432, "allowance_mm": 0.0, "candidates": ball_candidates}
    return {"design": "groove_block", "units": "mm", "min_concave_radius_mm": 8.0,
            "min_concave_radius_place_mm": [20.0, 0.0, 12.0],
            "setups": [{"name": "setup-1", "operations": [rough, finish], "time_s": float(setup.path.time_s[-1]),
                        "time_assumptions": "rapids 6000 mm/min, acceleration 500 mm/s², tool change 15 s"}]}


def sample_verify():
    """verify.json as DESIGN.md says it, all well."""
    total = {"gouge_max_mm": 0.0008, "excess_max_mm": 0.0212, "cusp_max_mm": 0.0191, "cusp_p99_mm": 0.0188,
             "gouge_volume_mm3": 0.0, "excess_volume_mm3": 9.1, "error_bound_mm": 0.0009, "points_checked": 412_345,
             "area_required_mm2": 2893.2, "area_reached_mm2": 2871.9, "collisions": [], "findings": []}
    return {"ok": True, **total, "area_unreachable_mm2": 21.3,
            "unreachable": [{"area_mm2": 21.3, "largest_deviation_mm": 0.85, "place_mm": [42.0, 20.0, 14.0],
                             "reason": "foot of the step: no ball cutter reaches a sharp inner corner"}],
            "cusps": [{"face": 4, "operation": "finish", "ridges": 800, "wanted_mm": 0.020, "share_within_10_percent": 0.62,
                       **{k: {"p50": v, "p90": v, "p99": 1.1 * v, "max": 1.2 * v}
                          for k, v in (("measured_mm", 0.0161), ("formula_mm", 0.016), ("step_mm", 0.8))},
                       "differs_most": {"place_mm": [14.0, 3.0, 20.0], "by_mm": 0.003, "measured_mm": 0.019, "formula_mm": 0.016}}],
            "error_bounds_mm": {"tessellation_mm": 0.0002, "sweep_mm": 0.0003, "arc_fit_mm": 0.0003, "post_rounding_mm": 0.0001},
            "setups": [{"name": "setup-1", "ok": True, **total}]}


def sample_cusps():
    """Ridges over the whole top, most of them a little below what was asked."""
    random = np.random.default_rng(11)
    place = np.column_stack([random.uniform(0, (LENGTH, WIDTH), (800, 2)), np.full(800, TOP)])
    height = 0.016 + 0.003 * np.sin(place[:, 0] / 9)
    return {"cusp_place_mm": place, "cusp_height_mm": height, "cusp_formula_mm": np.full(800, 0.016)}


def make_bundle():
    """The whole sample."""
    zmap = ZMap()
    cut_sample(zmap)
    setup, mesh = sample_setup(zmap), sample_mesh(zmap)
    random = np.random.default_rng(7)
    samples = np.clip(random.gamma(1.2, 0.005, 30_000) - 0.0006, -0.0008, 0.0191)
    hollow = np.concatenate([np.full(900, 1 / GROOVE_R), np.zeros(2100), 1 / random.uniform(60, 400, 300)])
    return ReportBundle(
        design="groove_block", description="Block with a round groove and a step, for the report's own tests",
        parameters={"length_mm": LENGTH, "width_mm": WIDTH, "groove_radius_mm": GROOVE_R}, material="aluminium 6061-T6",
        finish=Finish(scallop_mm=0.020, profile_tolerance_mm=0.005, gouge_mm=0.003), revision="", inputs_sha256="ab" * 32,
        step_file="groove_block.step", step_sha256="9c" * 32, part_box_mm=((0, 0, 0), (LENGTH, WIDTH, TOP)),
        plan=sample_plan(setup), verify=sample_verify(), mesh=mesh, deviation_samples_mm=samples,
        curvature_per_mm=hollow, setups=(setup,), **sample_cusps())


FINDINGS = [
    {"kind": "gouge", "amount_mm": 0.041, "place_mm": [31.5, 12.0, 20.0], "operation": "finish", "line": 3120,
     "setup": "setup-1", "machine_mm": [131.5, 112.0, -80.0], "block": "N3120 G1 X31.5 Y12.0 Z-2.0",
     "advice": "the pass enters the surface: check the tool length of T3, then post again"},
    {"kind": "holder_contact", "amount_mm": 1.2, "place_mm": [42.0, 20.0, 20.0], "operation": "rough", "line": 711,
     "setup": "setup-1", "advice": "let T1 stand out 42 mm or more"}]


def with_findings(bundle):
    """The same cut, with a verdict that must be red."""
    return replace(bundle, verify={**bundle.verify, "ok": False, "gouge_max_mm": 0.041, "findings": FINDINGS})


def with_two_setups(bundle):
    """The same cut twice, the second clamped with its zero elsewhere."""
    second = replace(bundle.setups[0], name="setup-2", program_file="setup-2.ngc", wcs="G55",
                     frame=Frame.shift((LENGTH, 0, STOCK_TOP)),
                     stock_box_mm=((-LENGTH, 0.0, -STOCK_TOP), (0.0, WIDTH, 0.0)))
    plan = {**bundle.plan, "setups": [bundle.plan["setups"][0], {**bundle.plan["setups"][0], "name": "setup-2"}]}
    return replace(bundle, setups=(*bundle.setups, second), plan=plan)


@pytest.fixture(scope="session")
def sample_bundle():
    """A verified part."""
    return make_bundle()


@pytest.fixture(scope="session")
def refused_bundle(sample_bundle):
    """The same part with a gouge and a holder contact."""
    return with_findings(sample_bundle)


@pytest.fixture(scope="session")
def two_setup_bundle(sample_bundle):
    """The same part in two setups."""
    return with_two_setups(sample_bundle)


TRUNNION_TOOL_MM = 75.0     # from the nose to the tip of each tool on the machine below


def with_machine(bundle, name="mill_trunnion_ac"):
    """The same cut in two indexed positions of one clamping on a five-axis machine; the table leans at once between them."""
    machine = find_machine(name)
    first, chain = bundle.setups[0], machine.kinematics
    second = replace(first, name="leaning", turned_in_words="A-90", is_held_as_before=True)
    nose = first.frame.into(first.path.points_mm) + machine.wcs_origin_mm + TRUNNION_TOOL_MM * chain.spindle
    n, seconds = len(nose), first.path.time_s
    at_top = np.tile((0.0, 0.0, 50.0), (5, 1))
    leaning = np.column_stack([np.zeros(5), np.linspace(0, -90, 5)])
    joints = np.vstack([np.column_stack([nose, np.zeros((n, 2))]), np.column_stack([at_top, leaning]),
                        np.column_stack([nose, np.tile((0.0, -90.0), (n, 1))])])
    each = lambda a, between, b: np.concatenate([a, np.full(5, between), b])
    path = first.path
    motion = Motion(
        setups=(0, 1), place=Frame.shift(np.array(machine.wcs_origin_mm) - first.frame.origin_mm), joints=joints,
        time_s=np.concatenate([seconds, seconds[-1] + np.arange(1, 6) / 5, seconds[-1] + 1 + seconds]),
        own_s=np.concatenate([seconds, np.zeros(5), seconds]), setup=each(np.zeros(n), 1, np.ones(n)),
        line=each(path.line, 9000, path.line + 10_000), tool=each(path.operation + 1, 2, path.operation + 1),
        operation=each(path.operation, -1, path.operation), is_rapid=each(path.is_rapid, True, path.is_rapid),
        feed_mm_per_min=each(path.feed_mm_per_min, 0, path.feed_mm_per_min))
    second = replace(second, path=replace(path, line=path.line + 10_000))
    step = FaceMesh(vertices_mm=bundle.mesh.vertices_mm, normals=bundle.mesh.normals, triangles=bundle.mesh.triangles,
                    deviation_mm=np.full(len(bundle.mesh.vertices_mm), np.nan), edges_mm=())
    bodies = [MachineBody(name=b.name, link=b.link, colour=b.colour, shape=b.shape) for b in machine.bodies]
    view = MachineView(name=machine.name, chain=chain, order=machine.chain, upward=machine.upward, motions=(motion,),
                       bodies=(*bodies, MachineBody(name="rock", link="bed", colour="#336633", shape=step)),
                       tools={k + 1: MachineTool(tip_mm=tuple(-TRUNNION_TOOL_MM * chain.spindle), tool=tool)
                              for k, tool in enumerate((FLAT, BALL))})
    plan = {**bundle.plan, "setups": [bundle.plan["setups"][0], {**bundle.plan["setups"][0], "name": "leaning"}]}
    return replace(bundle, setups=(first, second), plan=plan, machine=view)


@pytest.fixture(scope="session")
def machine_bundle(refused_bundle):
    """The same part, refused, on a machine whose table turns."""
    return with_machine(refused_bundle)
