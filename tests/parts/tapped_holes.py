"""Three tapped holes, posted for a machine that taps rigidly."""

import importlib
from pathlib import Path

import cuspline.posts
from cuspline.program.drilling import DrillCycle, drilled
from cuspline.program.program import Operation, Program
from cuspline.shop.cutters import Cutter, Holder, HolderSegment, Tool
from cuspline.shop.machines import machine_from_toml

MACHINES = Path(cuspline.posts.__file__).parent / "machines"
LEVEL, RPM = 20.0, 500
TAPS = {1: "right", -1: "left"}


def tap(sign=1, pitch=1.0):
    """T3, a tap M6."""
    cutter = Cutter(name="tap M6", type="tap", diameter_mm=6, corner_radius_mm=0, flutes=3, flute_length_mm=17,
                    neck_diameter_mm=4.5, reach_mm=30, shank_diameter_mm=6, overall_length_mm=80, pitch_mm=pitch,
                    hand=TAPS[sign], chamfer_threads=3)
    holder = Holder(name="collet", segments=(HolderSegment(height_mm=50, lower_diameter_mm=40, upper_diameter_mm=40),))
    return Tool(number=3, cutter=cutter, holder=holder, stick_out_mm=45)


def tapped(machine, sign=1, pitch=1.0, **control):
    """(text, PostedMoves, Operation) of three holes, the last deeper."""
    machine = machine_from_toml(MACHINES / f"{machine}.toml")
    machine = machine.model_copy(update={"spindle": machine.spindle.model_copy(update={"min_rpm": 100.0}),
                                         "control": machine.control.model_copy(update=control)})
    writer = importlib.import_module(f"cuspline.posts.writers.{machine.control.post}")
    holes = [DrillCycle(kind="tap", xy_mm=(x, y), bottom_z_mm=z, retract_z_mm=3.0, pitch_mm=sign * pitch, first=0, end=0,
                        feed_mm_per_min=RPM * pitch) for x, y, z in ((10, 10, -9), (30, 10, -9), (30, 25, -11.5))]
    moves, cycles = drilled(holes, LEVEL, RPM * pitch)
    operation = Operation(name="tap", tool=tap(sign, pitch), spindle_rpm=RPM, coolant="flood", moves=moves, cycles=cycles)
    program = Program(name="plate", setup="setup-1", wcs="G54", wcs_in_words="corner", operations=(operation,),
                      clearance_z_mm=LEVEL, header=("PLATE",))
    text = writer.post(program, machine).text
    reader = importlib.import_module(f"cuspline.posts.readers.{writer.READER}")
    return text, lambda t=text: reader.read_program(t, work_offsets={"G54": machine.wcs_origin_mm}, tool_lengths={
        3: operation.tool.length_mm}), operation
