"""The L-shaped test of the drives: a program that cuts a right-angled corner, and the time constant that the corner shows.

The groove is measured under a microscope: from where both straight parts of its middle line would meet to where the line
crosses the bisector.  docs/formulas.md 4.
"""

from cuspline.app.judge import post_module
from cuspline.process.drives import time_constant_s
from cuspline.program.program import MoveWriter, Operation, Program

LEG_MM = 30.0
CLEARANCE_MM, ABOVE_MM = 25.0, 2.0
DEPTH_SHARE = 0.05        # of the diameter: a groove that can be seen
PLUNGE_SHARE = 0.3        # of the feed, going down
RPM_SPEED = 100.0         # m/min


def calibration_text(machine, tool, feed_mm_per_min):
    """Program of an L in the plane Z0: X0 Y0 to the corner at X30 Y0, to X30 Y30; its text, one file.

    Args:
        machine: machines.Machine.   tool: cutters.Tool that cuts the groove.
    """
    depth = DEPTH_SHARE * tool.cutter.diameter_mm
    w = MoveWriter((0, 0, CLEARANCE_MM))
    w.rapid((0, 0, ABOVE_MM))
    w.feed((0, 0, -depth), PLUNGE_SHARE * feed_mm_per_min)
    w.feed((LEG_MM, 0, -depth), feed_mm_per_min)
    w.feed((LEG_MM, LEG_MM, -depth), feed_mm_per_min)
    w.rapid((LEG_MM, LEG_MM, CLEARANCE_MM))
    rpm = min(max(round(RPM_SPEED * 1000 / (3.14159 * tool.cutter.diameter_mm)), machine.spindle.min_rpm), machine.spindle.max_rpm,
              tool.cutter.max_rpm or machine.spindle.max_rpm)
    operation = Operation(name="corner", tool=tool, spindle_rpm=float(rpm), coolant="off", moves=w.moves())
    program = Program(name="calibrate", setup="calibrate", wcs="G54", wcs_in_words="X0 Y0 begin of the L, Z0 top of the stock",
                      clearance_z_mm=CLEARANCE_MM, operations=(operation,), header=(
        "DRIVES: L-SHAPED TEST, NOT VERIFIED AGAINST ANY STOCK",
        f"FLAT STOCK OF {LEG_MM + 10:g} X {LEG_MM + 10:g} MM, Z0 ON ITS TOP",
        f"T{tool.number} {tool.cutter.name}, GROOVE {depth:g} DEEP, FEED {feed_mm_per_min:g} MM/MIN",
        "MEASURE FROM THE CORNER OF THE STRAIGHT PARTS TO THE GROOVE'S MIDDLE LINE, ALONG THE BISECTOR"))
    return "".join(post_module(machine).post(program, machine).texts)


def measured_text(corner_mm, feed_mm_per_min):
    """The time constant of a measured corner, as lines of a machine's file."""
    value = time_constant_s(corner_mm, feed_mm_per_min)
    axes = "".join(f"\n[{axis}]\ntime_constant_s = {value:.4f}\n" for axis in "xyz")
    return f"# corner cut by {corner_mm:g} mm at {feed_mm_per_min:g} mm/min: T = {value:.4f} s{axes}"
