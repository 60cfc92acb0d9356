"""LinuxCNC's stand-alone interpreter: what it makes of a program, in full precision, or its refusal.

Two front ends of the same library are asked: the `rs274` program for the verdict (it alone notices a
missing feed) and the `gcode` module for the moves (it alone prints every digit and the line).
"""

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

RS274 = "/usr/bin/rs274"
SYSTEM_PYTHON = "/usr/bin/python3"      # the package's modules are built for the distribution's Python
MM_PER_INCH = 25.4
WCS_NAMES = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
PLANES = {1: 0, 2: 2, 3: 1}             # the module's XY, YZ, XZ as program.Plane
LONGEST_RUN_S = 300


@dataclass(frozen=True, eq=False, kw_only=True)
class Interpreted:
    """Moves as LinuxCNC's interpreter makes them, mm; places the text never named count from 0."""

    kind: np.ndarray                # (n,) program.Kind
    end_mm: np.ndarray              # (n, 3) in the active WCS
    machine_end_mm: np.ndarray      # (n, 3)
    center_mm: np.ndarray           # (n, 3) NaN on lines and along the third axis
    plane: np.ndarray               # (n,) program.Plane
    turns: np.ndarray               # (n,) extra turns
    feed_mm_per_min: np.ndarray     # (n,) 0 on rapids
    tool: np.ndarray                # (n,)
    line: np.ndarray                # (n,)
    error: str                      # "" when the program was accepted
    error_line: int
    ended: bool                     # by M2 or M30


def missing():
    """Why the interpreter cannot be asked here; "" when it can."""
    if not os.access(RS274, os.X_OK):
        return "LinuxCNC's interpreter is not installed (run .ci/install_linuxcnc.sh)"
    probe = subprocess.run([SYSTEM_PYTHON, "-I", "-c", "import gcode"], capture_output=True)
    return "" if probe.returncode == 0 else f"{SYSTEM_PYTHON} has no module gcode (run .ci/install_linuxcnc.sh)"


def interpret(program_path, *, tool_lengths, work_offsets, left_over_mm=(0.0, 0.0, 0.0), tool_radii=None):
    """Run a program through LinuxCNC's interpreter.

    Args:
        tool_lengths: {number: mm}.
        work_offsets: {"G54": (x, y, z) mm, ...}.
        tool_radii: {number: mm} of the table's diameters; left out: they are 0.
        left_over_mm: the shift by G92 or G52 that a program before has left in force.
    Raises:
        RuntimeError: the interpreter itself failed; a refused program is no exception.
    """
    with tempfile.TemporaryDirectory(prefix="rs274.") as folder:
        folder, program = Path(folder), Path(program_path).resolve()
        write_parameters(folder / "inch.var", work_offsets, left_over_mm, 1 / MM_PER_INCH)
        write_parameters(folder / "mm.var", work_offsets, left_over_mm)
        error, ended = _verdict(program, folder, tool_lengths, tool_radii or {})
        calls, module_error, line = _calls(program, folder, tool_lengths, tool_radii or {})
    return _Listing(work_offsets).interpreted(calls, error or module_error, line, ended)


def tool_lengths_from_table(path):
    """{number: (x, y, z)} offsets in mm out of a LinuxCNC tool table in mm."""
    lengths = {}
    for line in Path(path).read_text().splitlines():
        words = {w[0].upper(): w[1:] for w in line.split(";")[0].split()}
        if "T" in words:
            lengths[int(words["T"])] = tuple(float(words.get(axis, 0.0)) for axis in "XYZ")
    return lengths


def tool_radii_from_table(path):
    """{number: radius in mm} out of a LinuxCNC tool table in mm."""
    rows = [{w[0].upper(): w[1:] for w in line.split(";")[0].split()} for line in Path(path).read_text().splitlines()]
    return {int(words["T"]): float(words.get("D", 0.0)) / 2 for words in rows if "T" in words}


def write_tool_table(path, tool_lengths, scale=1.0, tool_radii=MappingProxyType({})):
    """A LinuxCNC tool table of lengths, or of offsets (x, y, z); the P word is what gives each tool its pocket."""
    words = lambda mm: " ".join(f"{axis}{v * scale:+.15f}" for axis, v in zip("XYZ", mm) if v)
    rows = enumerate(sorted(_offsets(tool_lengths).items()), 1)
    wide = lambda n: f" D{2 * tool_radii[n] * scale:.15f}" if tool_radii.get(n) else ""
    Path(path).write_text("".join(f"T{n} P{p} {words(mm)}{wide(n)}\n" for p, (n, mm) in rows))


def _offsets(tool_lengths):
    """{number: (x, y, z)} of lengths or offsets."""
    return {n: tuple(mm) if np.ndim(mm) else (0.0, 0.0, mm) for n, mm in tool_lengths.items()}


def write_parameters(path, work_offsets, left_over_mm=(0.0, 0.0, 0.0), scale=1.0):
    """A LinuxCNC parameter file; all that it requires must be there, in rising order."""
    values = dict.fromkeys([*range(5161, 5170), *range(5181, 5190), *range(5210, 5220)], 0.0) | {5220: 1.0}
    values |= {5210: float(any(left_over_mm))} | {5211 + k: mm * scale for k, mm in enumerate(left_over_mm)}
    for index, name in enumerate(WCS_NAMES):
        base = 5221 + 20 * index
        values |= dict.fromkeys(range(base, base + 10), 0.0)
        values |= {base + k: mm * scale for k, mm in enumerate(work_offsets.get(name, ()))}
    Path(path).write_text("".join(f"{number}\t{values[number]:.15f}\n" for number in sorted(values)))


def _verdict(program, folder, tool_lengths, tool_radii):
    """(error, ended) by the rs274 program, which takes its tables in inches always."""
    write_tool_table(folder / "inch.tbl", tool_lengths, 1 / MM_PER_INCH, tool_radii)
    run = _run([RS274, "-g", "-n", "2", "-t", "inch.tbl", "-v", "inch.var", str(program), "listing.txt"], folder)
    if run.returncode not in (0, 1):
        raise RuntimeError(f"rs274 died with status {run.returncode}: {run.stderr[-400:]}")
    said = [line for line in run.stderr.splitlines() if line.strip() not in ("", "executing")]
    ended = "PROGRAM_END()" in (folder / "listing.txt").read_text(errors="replace")
    return ((said or ["refused without a word"])[0] if run.returncode else ""), ended


def _calls(program, folder, tool_lengths, tool_radii):
    """(canonical calls, error, line) by the gcode module."""
    shutil.rmtree(folder / "home", ignore_errors=True)
    (folder / "home").mkdir()
    write_tool_table(folder / "mm.tbl", tool_lengths, tool_radii=tool_radii)
    job = {"program": str(program), "tools": sorted(_offsets(tool_lengths).items()),
           "diameters": [[n, 2 * r] for n, r in tool_radii.items()],
           "tool_table": str(folder / "mm.tbl"),
           "parameters": str(folder / "mm.var"), "home": str(folder / "home"),
           "calls": str(folder / "calls"), "verdict": str(folder / "verdict")}
    (folder / "job").write_text(json.dumps(job))
    child = Path(__file__).with_name("interpreter_child.py")
    run = _run([SYSTEM_PYTHON, "-I", str(child), str(folder / "job")], folder)
    if run.returncode:
        raise RuntimeError(f"the gcode module died with status {run.returncode}: {run.stderr[-400:]}")
    verdict = json.loads((folder / "verdict").read_text())
    with open(folder / "calls") as file:
        return [json.loads(line) for line in file], verdict["error"], verdict["line"]


def _run(command, folder):
    environment = {"HOME": str(folder), "PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}
    return subprocess.run(command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, errors="replace", timeout=LONGEST_RUN_S)


class _Listing:
    """Follows the canonical calls and collects moves."""

    def __init__(self, work_offsets):
        self.offset_mm, self.length_mm = np.array(work_offsets.get("G54", (0.0,) * 3)), np.zeros(3)
        self.shift_mm = np.zeros(3)
        self.plane, self.feed, self.tool = 0, 0.0, 0
        self.end_mm, self.rows = np.zeros(3), []

    def interpreted(self, calls, error, line, ended):
        """All calls as one value."""
        for name, at, *values in calls:
            getattr(self, name)(at, values)
        table = np.array(self.rows, dtype=float).reshape(len(self.rows), 15)
        return Interpreted(
            kind=table[:, 0].astype(int), end_mm=table[:, 1:4], machine_end_mm=table[:, 4:7],
            center_mm=table[:, 7:10], plane=table[:, 10].astype(int), turns=table[:, 11].astype(int),
            feed_mm_per_min=table[:, 12], tool=table[:, 13].astype(int), line=table[:, 14].astype(int),
            error=error, error_line=line, ended=ended)

    def _add(self, kind, line, end_mm, center_mm=(np.nan,) * 3, turns=0):
        self.end_mm = np.array(end_mm)
        plane = self.plane if kind > 1 else 0
        self.rows.append((kind, *end_mm, *(self.end_mm + self.offset_mm + self.shift_mm + self.length_mm), *center_mm, plane,
                          turns, self.feed if kind else 0.0, self.tool, line))

    def straight_traverse(self, line, values):
        self._add(0, line, [v * MM_PER_INCH for v in values[:3]])

    def straight_feed(self, line, values):
        self._add(1, line, [v * MM_PER_INCH for v in values[:3]])

    def rigid_tap(self, line, values):
        """Down and back; how fast, the module does not say."""
        above, feed = self.end_mm, self.feed
        self.feed = np.nan
        self._add(1, line, [v * MM_PER_INCH for v in values[:3]])
        self._add(1, line, above)
        self.feed = feed

    def arc_feed(self, line, values):
        first, second, third = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[self.plane]
        a, b, center_a, center_b, rotation, along = (v * MM_PER_INCH for v in values[:6])
        rotation = int(values[4])
        end, center = [0.0] * 3, [np.nan] * 3
        end[first], end[second], end[third] = a, b, along
        center[first], center[second] = center_a, center_b
        self._add(3 if rotation > 0 else 2, line, end, center, abs(rotation) - 1)

    def set_feed_rate(self, line, values):
        self.feed = values[0] * MM_PER_INCH

    def set_plane(self, line, values):
        self.plane = PLANES[values[0]]

    def set_g5x_offset(self, line, values):
        self.offset_mm = np.array(values[1:4]) * MM_PER_INCH

    def tool_offset(self, line, values):
        self.length_mm = np.array(values[:3]) * MM_PER_INCH

    def tool_changed(self, line, values):
        self.tool = values[0]

    def set_g92_offset(self, line, values):
        self.shift_mm = np.array(values[:3]) * MM_PER_INCH

    def set_xy_rotation(self, line, values):
        if any(values[:3]):
            raise RuntimeError(f"line {line}: a rotation, which the comparison does not know")
