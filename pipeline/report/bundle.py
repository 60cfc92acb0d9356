"""Everything the report shows, gathered once; the report computes nothing about the cut itself."""

from dataclasses import dataclass, field

import numpy as np

from cuspline.design import Finish
from cuspline.values.frames import Frame


@dataclass(frozen=True, eq=False, kw_only=True)
class FaceMesh:
    """Tessellation for pictures: vertices are not shared between faces, normals are the surface's."""

    vertices_mm: np.ndarray         # (n, 3) part coordinates
    normals: np.ndarray             # (n, 3) unit, out of the material
    triangles: np.ndarray           # (m, 3) indices
    deviation_mm: np.ndarray        # (n,) simulated stock against design along the normal; NaN: not judged
    edges_mm: tuple[np.ndarray, ...]    # B-rep edges as polylines (k, 3)


@dataclass(frozen=True, eq=False, kw_only=True)
class PathPoints:
    """The posted tip path as a polyline (arcs already broken down for drawing), part coordinates."""

    points_mm: np.ndarray           # (n, 3)
    is_rapid: np.ndarray            # (n,) bool: the segment that ends here
    feed_mm_per_min: np.ndarray     # (n,)
    operation: np.ndarray           # (n,) index into operations, -1: none
    time_s: np.ndarray              # (n,) since program start, from the feed model
    line: np.ndarray                # (n,) of the posted text, from 1, the files of a set counted on; 0 unknown
    met: dict = field(default_factory=dict)     # name -> (n,) what the edges meet on the segment; NaN: not looked at


@dataclass(frozen=True, eq=False, kw_only=True)
class StockReplay:
    """The verifier's own z-map of the stock and every change of it, in order of time.

    Cell (i, j) is the node x = origin_mm[0] + i*pitch_mm, y = origin_mm[1] + j*pitch_mm;
    cells are numbered j*nx + i.  Part coordinates, turned by the setup's frame.rotation where
    the part lies on another side (x_part = rotation @ x_replay): z is always the tool axis.
    """

    origin_mm: tuple[float, float]
    pitch_mm: float
    nx: int
    ny: int
    bottom_mm: float
    top_mm: float                   # before the first cut
    design_top_mm: np.ndarray       # (ny, nx) height of the design under each node, NaN beside it
    event_move: np.ndarray          # (e,) point row of PathPoints that had been reached
    event_cell: np.ndarray          # (e,)
    event_z_mm: np.ndarray          # (e,) new height, always below the one before


@dataclass(frozen=True, eq=False, kw_only=True)
class SetupBundle:
    """One setup: its program, where its zero is, its posted path and its simulated stock."""

    name: str                       # "setup-1"
    program_file: str               # "setup-1.ngc"
    program_sha256: str
    program_lines: int
    program_bytes: int
    machine: str
    control: str
    units: str
    wcs: str
    wcs_in_words: str
    frame: Frame                    # WCS seen from the part
    markers: tuple                  # (name, (x, y, z) in WCS) of what is touched to find how the part lies
    marked_for_later: tuple = ()    # the same of what a later clamping touches, as it lies here
    markers_elsewhere: dict = field(default_factory=dict)   # name of either -> (setup of another clamping, the place in its WCS)
    zero_height_mm: float | None = None     # of the zero over what the stock lies on, where that was taken for the travels
    rotaries: tuple = ()            # (letter, degrees or None, (2, 3) a point of it and its direction, part coordinates while all
                                    # stand at 0) of the rotary axes that carry the part
    held_frame: Frame | None = None     # of the WCS of what holds the part, where the frame is turned from it
    lies_in_words: str              # how it was found to lie; "" as designed
    is_held_as_before: bool = False     # an indexed position of the same clamping as the setup before it
    turned_in_words: str = ""       # where the rotary axes stand in an indexed position; "" they are not turned
    swings_in_words: str = ""       # how far rotary axes turn over the whole program; "" they do not
    solved_for: str = ""            # machine coordinates of the zero that a program with turned axes holds for; "" it has none
    continued: tuple[tuple[str, str], ...] = ()     # (file, SHA-256) of a set's further files, run in that order
    lines_before: tuple[int, ...] = ()              # lines of the files before each of these
    operation_first_lines: tuple[int, ...]  # program line where each operation begins; 0 unknown
    stock_box_mm: tuple[tuple[float, float, float], tuple[float, float, float]]   # WCS min, max of the box round it
    stock_edges_mm: np.ndarray      # (k, 2, 3) to draw it by, part coordinates
    stock_in_words: str             # what it is where it is no box along the WCS; "" where its box says all
    fixtures: tuple                 # (name, (k, 2, 3) edges in part coordinates) of each
    extents_mm: tuple[tuple[float, float, float], tuple[float, float, float]]     # tip extents, WCS
    path: PathPoints
    replay: StockReplay

    @property
    def as_it_stands(self):
        """Frame of the part as it stands on the machine, the clamping's Z up."""
        return self.held_frame or self.frame

    @property
    def axes_name(self):
        """Whose X, Y and Z the drawing, the stock and the read-out are given in."""
        return f"{self.wcs} turned" if self.turned_in_words else self.wcs


@dataclass(frozen=True, eq=False, kw_only=True)
class ReportBundle:
    """One design, all its setups, what was planned and what the verifiers found."""

    design: str
    description: str
    parameters: dict                # name -> value, units in the names
    material: str
    finish: Finish                  # what the design asks for
    inputs_sha256: str
    revision: str
    step_file: str
    step_sha256: str
    part_box_mm: tuple[tuple[float, float, float], tuple[float, float, float]]
    plan: dict                      # plan.json as written (see pipeline/app/build.py)
    verify: dict                    # verify.json as written (DESIGN.md's contract)
    mesh: FaceMesh
    deviation_samples_mm: np.ndarray    # (n,) all judged residuals, for the histogram
    curvature_per_mm: np.ndarray        # (n,) largest concave curvature at sample points (>0 hollow)
    cusp_place_mm: np.ndarray           # (m, 3) ridges between passes, part coordinates
    cusp_height_mm: np.ndarray          # (m,) measured
    cusp_formula_mm: np.ndarray         # (m,) by the formula for the cutter, the local step and curvature
    setups: tuple[SetupBundle, ...]
    machine: object = None              # machine_view.MachineView; None: three axes and no bodies, only the tool is shown moving
