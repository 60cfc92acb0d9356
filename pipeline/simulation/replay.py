"""One program replayed in its true order: the stock's history, and everything that went wrong on the way."""

from dataclasses import dataclass

import numpy as np

from cuspline.arrays import frozen
from cuspline.errors import SimulationError
from cuspline.frames import Frame
from cuspline.program import Kind
from cuspline.simulation import replay_checks, replay_kernel
from cuspline.simulation.pieces import pieces_of
from cuspline.simulation.swept import cutting_rows
from cuspline.verification.findings import Finding

TOUCH_MM = 1e-4           # a rapid may touch by this: rounding of the post, pieces of arcs
CONE_SLICES = 4           # cylinders for a holder segment that widens upward
HOLDER_CLEARANCE_MM = 1.0
SHANK_CLEARANCE_MM = 0.0  # the neck follows the flutes into the slot they cut


@dataclass(frozen=True, eq=False, kw_only=True)
class ZMap:
    """Nodes of the replay's z-map: x = origin + i pitch, y = origin + j pitch, cell j * nx + i."""

    origin_mm: tuple[float, float]
    pitch_mm: float
    nx: int
    ny: int

    @classmethod
    def over(cls, stock_min, stock_max, pitch_mm):
        """Nodes at the given pitch from the stock's lower corner on, none beyond the stock."""
        count = [int(np.floor((b - a) / pitch_mm + 1e-9)) + 1 for a, b in zip(stock_min[:2], stock_max[:2])]
        return cls(origin_mm=(float(stock_min[0]), float(stock_min[1])), pitch_mm=float(pitch_mm),
                   nx=count[0], ny=count[1])

    @property
    def xy_mm(self):
        """(ny * nx, 2) nodes in order of their cell number."""
        x = self.origin_mm[0] + self.pitch_mm * np.arange(self.nx)
        y = self.origin_mm[1] + self.pitch_mm * np.arange(self.ny)
        return np.column_stack([np.tile(x, self.ny), np.repeat(y, self.nx)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Fixture:
    """A box that no part of the tool may enter; WCS.  What lies below it counts as part of it."""

    name: str
    min_mm: tuple[float, float, float]
    max_mm: tuple[float, float, float]


@dataclass(frozen=True, eq=False, kw_only=True)
class Replay:
    """The stock's history and what was found on the way."""

    zmap: ZMap
    bottom_mm: float
    top_mm: float                   # before the first cut
    design_top_mm: np.ndarray       # (ny, nx) as given; NaN where there is no design
    event_row: np.ndarray           # (e,) row of PostedMoves
    event_cell: np.ndarray          # (e,)
    event_z_mm: np.ndarray          # (e,) new height, below the one before
    final_z_mm: np.ndarray          # (ny, nx) stock after all moves
    findings: tuple[Finding, ...]
    holder_clearance_mm: float      # least distance of any holder to stock or design; inf: beyond 50 mm
    holder_place_mm: tuple[float, float, float] | None      # part coordinates

    def __post_init__(self):
        shape, e = (self.zmap.ny, self.zmap.nx), len(self.event_row)
        for name, form, dtype in (("design_top_mm", shape, float), ("event_row", (e,), np.int64),
                                  ("event_cell", (e,), np.int64), ("event_z_mm", (e,), float),
                                  ("final_z_mm", shape, float)):
            object.__setattr__(self, name, frozen(getattr(self, name), form, name, dtype))


def replay(posted, tools, *, stock_min, stock_max, pitch_mm, stock_top_mm=None, design_top_mm=None, fixtures=(), machine=None,
           frame=Frame.shift((0.0, 0.0, 0.0)), setup="setup-1",
           holder_clearance_mm=HOLDER_CLEARANCE_MM, shank_clearance_mm=SHANK_CLEARANCE_MM):
    """Replays a posted program move by move on a z-map of the stock.

    Contacts are judged at the nodes: what is thinner than the pitch can slip between them.

    Args:
        posted: PostedMoves.   tools: dict of tool number -> cutters.Tool.
        stock_min, stock_max: (3,) corners of the billet, WCS.
        pitch_mm: distance of the nodes.
        stock_top_mm: (ny, nx) height of the stock at the nodes before the first move; None: the whole billet.
        design_top_mm: (ny, nx) height of the finished design at the nodes of
            `ZMap.over(stock_min, stock_max, pitch_mm)`, NaN beside it; None: not known.
        fixtures: Fixture values, WCS.   machine: machines.Machine, or None: travel is not checked.
        frame: the WCS seen from the part, for the places of findings.
        holder_clearance_mm, shank_clearance_mm: distance wanted to stock and design.
    Raises:
        SimulationError: a feed move with a tool that is not given.
    """
    zmap = ZMap.over(stock_min, stock_max, pitch_mm)
    shape, top = (zmap.ny, zmap.nx), float(stock_max[2])
    design = np.full(shape, np.nan) if design_top_mm is None else frozen(design_top_mm, shape, "design_top_mm")
    z = np.full(shape, top) if stock_top_mm is None else np.array(frozen(stock_top_mm, shape, "stock_top_mm"))
    clearance = np.array([shank_clearance_mm, holder_clearance_mm], dtype=float)
    boxes = np.array([(*f.min_mm, *f.max_mm) for f in fixtures], dtype=float).reshape(-1, 6)
    events, worst, least = replay_kernel.run(
        *_script(posted, tools, shank_clearance_mm), clearance, TOUCH_MM, boxes, z,
        np.where(np.isnan(design), -np.inf, design), *zmap.origin_mm, zmap.pitch_mm, len(posted))
    events = np.concatenate([_cut_before(stock_top_mm, top), events])
    report = replay_checks.Reporter(posted, setup, frame)
    found = (*report.contacts(worst), *report.states(top), *report.unknown_starts(_highest(top, boxes)),
             *report.travel(machine), *report.end())
    place = None if np.isnan(least[1]) else report.place(least[1:])
    return Replay(zmap=zmap, bottom_mm=float(stock_min[2]), top_mm=top, design_top_mm=design,
                  event_row=events[:, 0], event_cell=events[:, 1], event_z_mm=events[:, 2], final_z_mm=z,
                  findings=found, holder_clearance_mm=np.inf if place is None else float(least[0]),
                  holder_place_mm=place)


def _cut_before(stock_top_mm, top):
    """(e, 3) events of row 0: cells that earlier clampings have lowered."""
    if stock_top_mm is None:
        return np.zeros((0, 3))
    flat = np.ravel(stock_top_mm)
    cells = np.flatnonzero(flat < top)
    return np.column_stack([np.zeros(len(cells)), cells, flat[cells]])


def _highest(top, boxes):
    return max([top, *boxes[:, 5]])


def _script(posted, tools, shank_clearance_mm):
    """Pieces of all known moves in order, with their cutters and the cylinders above these."""
    known = cutting_rows(posted) & np.isin(posted.tool, list(tools))
    lost = (posted.kind != Kind.RAPID) & ~known
    if lost.any():
        k = int(np.flatnonzero(lost)[0])
        raise SimulationError(f"line {posted.line[k]}: feed move with T{posted.tool[k]} from "
                              f"{posted.start_mm[k]}; the tool is not in the library or the start is unknown",
                              rows=np.flatnonzero(lost))
    numbers = sorted({int(n) for n in posted.tool[known]})
    parts = [_pieces(posted, np.flatnonzero(known & (posted.tool == n)), tools[n]) for n in numbers]
    stack = lambda arrays, empty: np.concatenate([empty, *arrays])
    geometry = stack([p.geometry for p in parts], np.zeros((0, 12)))
    row = stack([p.row for p in parts], np.zeros(0, np.int64))
    cutter = stack([np.full(len(p), k) for k, p in enumerate(parts)], np.zeros(0, np.int64))
    order = np.argsort(row, kind="stable")
    cutters = np.array([(tools[n].cutter.radius_mm - tools[n].cutter.corner_radius_mm,
                         tools[n].cutter.corner_radius_mm) for n in numbers]).reshape(-1, 2)
    cylinders = np.array([(k, *c) for k, n in enumerate(numbers) for c in upright_cylinders(tools[n])]).reshape(-1, 4)
    return (geometry[order], row[order], cutter[order], posted.kind[row[order]] == Kind.RAPID, cutters, cylinders)


def _pieces(posted, rows, tool):
    """A plunge is cut in steps of half a flute length: the neck enters what the flutes have cut before."""
    return pieces_of(posted, rows, tool.cutter.type == "ball", deepest_mm=tool.cutter.flute_length_mm / 2)


def upright_cylinders(tool):
    """(lift_mm, radius_mm, is_holder) of cylinders without upper end that cover neck, shank and holder."""
    rows = []
    for z0, r0, z1, r1 in tool.non_cutting_frusta():
        is_holder = float(z0 >= tool.stick_out_mm - 1e-9)
        rows.append((z0, r0, is_holder))
        for k in range(CONE_SLICES if r1 > r0 else 0):
            rows.append((z0 + (z1 - z0) * k / CONE_SLICES, r0 + (r1 - r0) * (k + 1) / CONE_SLICES, is_holder))
    return rows
