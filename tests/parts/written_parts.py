"""Small parts with programs written by hand, as a folder that `cuspline verify` takes: no planner, short to judge."""

import json

import cadquery as cq
import numpy as np
from known_tools import TAKES_ALL, tool

from cuspline.app import catalogue
from cuspline.app.build import UNVERIFIED
from cuspline.design import Design, FacePredicate, Finish, Parameters, Setup, StockBox
from cuspline.design.job import Job, PostedFile
from cuspline.kernel import brep
from cuspline.shop.cutters import Cutter, Tool

FINISH = Finish(scallop_mm=0.010, profile_tolerance_mm=0.002, gouge_mm=0.003)
CLEAR = "G0 Z30"


def operation(number, name, tool_number, blocks, spindle="S8000 M3"):
    """Blocks of one operation, between a tool change and a retract."""
    return [f"(OPERATION {number}: {name}, T{tool_number})", "M5", "G53 G0 Z0", f"T{tool_number} M6", f"G43 H{tool_number}",
            spindle, *blocks, CLEAR]


def program_text(*operations):
    """A whole program of operations."""
    return "\n".join(["(WRITTEN BY HAND)", f"({UNVERIFIED})", "G21", "G17 G90 G91.1 G94 G40 G49 G80 G92.1",
                      "G64 P0.0005 Q0", "G54", *(line for o in operations for line in o), "M5", "G53 G0 Z0", "M2"]) + "\n"


def written(folder, design, text, tools, ball_radius_mm):
    """Write STEP, program, tools and manifest of a design in one clamping; returns the folder."""
    folder.mkdir()
    brep.write_step(design.solid, folder / f"{design.name}.step", design.name)
    (folder / "setup-1.ngc").write_text(text)
    write_tools(folder, [t.model_dump(mode="json") for t in tools])
    job = Job(design=design.name, step=f"{design.name}.step", material=design.material, predicates=design.predicates,
              stock=design.stock, finish=design.finish, machine=catalogue.find_machine("mill_3axis"),
              posted=(PostedFile(setup=design.setups[0], program="setup-1.ngc"),), smallest_ball_radius_mm=ball_radius_mm)
    (folder / "manifest.json").write_text(json.dumps({"job": job.model_dump(mode="json")}))
    return folder


def write_tools(folder, tools, control=catalogue.find_machine("mill_3axis").control):
    """Put tools (as dicts) into tools.json and the control's table of a folder."""
    post = catalogue.find_post(control.post)
    (folder / "tools.json").write_text(json.dumps({"tools": tools}))
    (folder / post.TOOL_TABLE).write_text(post.tool_table(map(Tool.model_validate, tools), control))


def _design(name, solid, predicates, high):
    return Design(name=name, description=name, parameters=Parameters(), solid=brep.the_solid(solid.val(), name),
                  predicates=predicates, material="aluminium_6061", stock=StockBox(min_mm=(0, 0, 0), max_mm=high), finish=FINISH,
                  setups=(Setup(name="setup-1", wcs_in_words="corner", faces=tuple(p.name for p in predicates)),))


# a boss on a plate -----------------------------------------------------------------------------------

FLOOR_MM, TOP_MM = 6.0, 12.0
BOSS_MM = np.array([(27.0, 12.0), (35.0, 20.0)])         # beside the middle both ways: no mirror, no turn maps it on itself
STRIP_YS_MM = np.round(np.arange(-0.3, 6.4, 0.4), 3)     # of the ball's passes, beside the boss
STRIP_XS_MM = (-4.0, 64.0)                               # a holder of radius 20 there is clear of the boss
MILL = tool("flat", 6.0, number=1)
BALL = tool("ball", 6.0, number=2)
BALL = BALL.model_copy(update={"cutter": BALL.cutter.model_copy(update={"flute_length_mm": 5.0})})


def boss():
    """A plate 60 x 24 x 6 with a boss 8 x 8 x 6 on it, out of a billet 14 high."""
    (x0, y0), (x1, y1) = BOSS_MM
    solid = cq.Workplane().box(60, 24, FLOOR_MM, centered=False).union(
        cq.Workplane().box(x1 - x0, y1 - y0, TOP_MM, centered=False).translate((x0, y0, 0)))
    floor = FacePredicate(name="floor", count=1, center_min_mm=(0, 0, 5.9), center_max_mm=(60, 24, 6.1))
    sides = FacePredicate(name="boss", count=5, center_min_mm=(26, 11, 6.5), center_max_mm=(36, 21, 12.1))
    return _design("boss", solid, (floor, sides), (60, 24, 14))


def boss_operations(line_mm=68.0, repeats=1):
    """[clearing with the flat mill, finishing the strip with the ball in lines of some length, again and again]."""
    clear = ["G0 X-4 Y-1", "G0 Z16", "G1 Z12 F900"]
    for k, y in enumerate(range(-1, 25, 5)):
        clear += [f"Y{y}", f"X{(64, -4)[k % 2]}"]
    clear += [CLEAR, "G0 X-4 Y-1", "G1 Z6.3", "X64", "Y4", "X-4", CLEAR, "G0 X-4 Y9", "G1 Z6", "X64", CLEAR, "G0 X-4 Y23", "G1 Z6",
              "X64", CLEAR, "G0 X24 Y4", "G0 Z14", "G1 Z6.3", "Y9", "Z6", "X38", "Y23", "X24", "Y9", CLEAR]
    for x in (19, 14, 9, 4, -1, 43, 48, 53, 58, 62):
        clear += [f"G0 X{x} Y9", "G1 Z6", "Y25", CLEAR]
    counts = int(round((STRIP_XS_MM[1] - STRIP_XS_MM[0]) / line_mm))
    along = np.round(np.linspace(*STRIP_XS_MM, counts + 1), 4)
    strip = [f"G0 X{STRIP_XS_MM[0]:g} Y{STRIP_YS_MM[0]:g}", "G0 Z16", "G1 Z6 F900"]
    for _ in range(repeats):
        strip += [block for k, y in enumerate(STRIP_YS_MM)
                  for block in (f"Y{y:g}", *(f"X{x:g}" for x in (along[1:] if k % 2 == 0 else along[-2::-1])))]
        if len(STRIP_YS_MM) % 2:
            strip.append(f"X{STRIP_XS_MM[0]:g}")
    return [operation(1, "CLEAR", 1, clear), operation(2, "FINISH", 2, strip)]



# a drafted wall --------------------------------------------------------------------------------------

DRAFT_DEG = 5.0


def drafted():
    """A floor and a wall that leans by the draft, up to the billet's corner."""
    lean = 6 * np.tan(np.radians(DRAFT_DEG))
    solid = cq.Workplane("YZ").polyline([(0, 0), (8 + lean, 0), (8 + lean, 10), (8, 4), (0, 4)]).close().extrude(20)
    floor = FacePredicate(name="floor", count=1, center_min_mm=(0, 0, 3.9), center_max_mm=(20, 9, 4.1))
    wall = FacePredicate(name="wall", count=1, normal=(0, -1, 0), normal_within_deg=20, center_min_mm=(0, 7, 5),
                         center_max_mm=(20, 9, 9))
    return _design("drafted", solid, (floor, wall), (20, 8 + lean, 10))


def drafted_text():
    """Passes over the floor with a tapered ball of the wall's draft, the last one along the wall."""
    lean = np.radians(DRAFT_DEG)
    last = 8 + 2 * np.tan(lean) - 2 / np.cos(lean)          # of a ball of radius 2 that touches floor and wall
    blocks = ["G0 X-4 Y-0.2", "G0 Z14", "G1 Z4 F900"]
    for k, y in enumerate([*np.arange(-0.2, last, 0.35), last]):
        blocks += [f"Y{y:.4f}", f"X{(24, -4)[k % 2]}"]
    return program_text(operation(1, "FINISH", 3, blocks))


def tapered(taper_deg):
    """A tapered ball of radius 2."""
    cutter = Cutter(name="tapered ball", type="tapered_ball", diameter_mm=4.0, corner_radius_mm=2.0, flutes=2,
                    flute_length_mm=10.0, neck_diameter_mm=3.0, reach_mm=30.0, shank_diameter_mm=6.0,
                    overall_length_mm=90.0, taper_deg=taper_deg, **TAKES_ALL)
    return Tool(number=3, cutter=cutter, holder=MILL.holder, stick_out_mm=45.0)
