"""Runs under the system's Python: one program through LinuxCNC's `gcode` module, every call one JSON line.

Argument: a JSON file {program, tools: [[number, [x, y, z]], ...], diameters: [[number, mm], ...], tool_table, parameters, home,
calls, verdict}.  Lengths in the calls are inches, whatever the program says: the module works so.
"""

import ctypes
import json
import os
import sys

with open(sys.argv[1]) as file:
    job = json.load(file)
os.environ["HOME"] = job["home"]         # the module keeps the tools in $HOME/.tool.mmap

tool_data = ctypes.CDLL("libtooldata.so.0", ctypes.RTLD_GLOBAL)
tool_data._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, 0)
tool_data._Z13tooldata_loadPKcPPc(job["tool_table"].encode(), None)

import gcode  # noqa: E402  it looks for the tool data above


class Canon:
    """Takes the interpreter's canonical calls."""

    def __init__(self, file):
        self.file, self.line, self.in_spindle = file, 0, -1
        self.parameter_file = job["parameters"]
        # the module asks with the pocket, 0 meaning the spindle
        self.pockets = dict(enumerate(job["tools"], 1))

    def put(self, name, *values):
        self.file.write(json.dumps([name, self.line, *values]) + "\n")

    def next_line(self, state):
        self.line = state.sequence_number

    def change_tool(self, pocket):
        self.in_spindle = pocket
        self.put("tool_changed", self.pockets[pocket][0] if pocket in self.pockets else 0)

    def get_tool(self, pocket):
        number, offset = self.pockets.get(pocket or self.in_spindle, (-1, (0.0, 0.0, 0.0)))
        return (number, *offset) + (0.0,) * 6 + (dict(job["diameters"]).get(number, 0.0), 0.0, 0.0, 0)

    def get_block_delete(self):
        return False

    def get_axis_mask(self):
        return 0b111

    def get_external_length_units(self):
        return 1.0

    get_external_angular_units = get_external_length_units

    def check_abort(self):
        return False

    def ignore(self, *values):
        pass

    set_traverse_rate = comment = message = dwell = user_defined_function = ignore


def recording(name):
    return lambda self, *values: self.put(name, *values)


for name in ("straight_feed", "straight_traverse", "arc_feed", "straight_probe", "rigid_tap", "set_feed_rate",
             "set_plane", "set_g5x_offset", "set_g92_offset", "set_xy_rotation", "tool_offset"):
    setattr(Canon, name, recording(name))

with open(job["calls"], "w") as file:
    status, line = gcode.parse(job["program"], Canon(file), "G21", "")
refused = status > gcode.MIN_ERROR
with open(job["verdict"], "w") as file:
    json.dump({"error": gcode.strerror(status) if refused else "", "line": line if refused else 0}, file)
