"""The certificate: for every move of a posted program, feeds and rapids, a proven bound of its gouge.

No sampling: the moving cutter is compared with the exact faces and edges of the part (see `toolpaths.move_depths`).
The gouge of a move is the depth of the part's point that comes to lie deepest inside the cutter, its distance
from the cutter's surface in whatever direction is nearest; the cutter counts as closed upward.  Only upper faces
and edges need to be asked: of the points over one another in a solid the topmost lies deepest.  What leans or lies is seen as
certificate_leaning.py and certificate_side.py say.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.kernel import brep
from cuspline.program.program import Kind
from cuspline.shop.cutters import POINTED
from cuspline.toolpaths.drop.exact_drop import ExactPart
from cuspline.toolpaths.gouge.depth_tree import DepthTree
from cuspline.toolpaths.gouge.move_depths import move_depths
from cuspline.values.arrays import frozen
from cuspline.values.checkpoints import NOTHING
from cuspline.values.known import Known
from cuspline.verification.certificate_chords import chords_of
from cuspline.verification.certificate_leaning import LeaningViews
from cuspline.verification.certificate_side import SideViews

PROVABLE = ("ball", "bull_nose", "flat")
ROUNDED = ("lens", "apt")   # held whole against the exact faces, upright or not
SIDE = "side"               # the same while its axis keeps its direction, whichever that is
SAGITTA_SHARE = 0.1         # of the tolerance: what the chords of arcs may take of it
MORE_MM = 1.0               # beyond the cutters' edges: a part's pieces that are looked at
THICKNESS_SHARE = 1.0       # of the tolerance, of pieces of faces: thinner ones cost more to make than they save
UPRIGHT = 1e-9              # an axis that leans by less stands upright


@dataclass(frozen=True, eq=False, kw_only=True)
class Certificate:
    """What is proven of a program, one row a proven move, and what is not; millimetres, WCS."""

    row: np.ndarray             # (k,) rows of PostedMoves that are proven, growing
    kind: np.ndarray            # (k,) program.Kind
    bound_mm: np.ndarray        # (k,) no point of the part comes to lie deeper inside the cutter; >= 0
    share: np.ndarray           # (k,) where along the move the deepest known point is deepest, 0..1
    place_mm: np.ndarray        # (k, 3) that point of the part; the tip at that share where none is known
    uncovered: tuple            # of (row, reason): moves of which nothing is proven
    tolerance_mm: float         # the bound exceeds the true depth by no more, see `certify`
    sagitta_mm: float           # of that, for chords of arcs

    def __post_init__(self):
        k = len(self.row)
        for name, shape, dtype in (("row", (k,), np.int64), ("kind", (k,), np.int8), ("bound_mm", (k,), float),
                                   ("share", (k,), float), ("place_mm", (k, 3), float)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))

    @property
    def proven_mm(self):
        """No proven move gouges deeper; 0 without one."""
        return float(self.bound_mm.max(initial=0.0))

    @property
    def moves_proven(self):
        """{"rapids": number, "feeds": number, "arcs": number}."""
        return {"rapids": int((self.kind == Kind.RAPID).sum()), "feeds": int((self.kind == Kind.FEED).sum()),
                "arcs": int((self.kind >= Kind.ARC_CW).sum())}

    def as_dict(self):
        """For verify.json."""
        reasons = [reason for _, reason in self.uncovered]
        return {"proven_mm": self.proven_mm, "moves": self.moves_proven, "tolerance_mm": self.tolerance_mm,
                "not_covered": {reason: reasons.count(reason) for reason in dict.fromkeys(reasons)}}

    @property
    def is_complete(self):
        """Every move asked for is proven."""
        return not self.uncovered


@dataclass(frozen=True, kw_only=True)
class ProvenGouge:
    """A move that cannot be proven to keep to what is allowed."""

    row: int
    depth_mm: float             # proven bound
    place_mm: tuple             # (x, y, z) WCS
    share: float                # along the move


def gouges_beyond(certificate, allowed_mm):
    """Moves whose bound exceeds what is allowed, deepest first: tuple of ProvenGouge.

    With a certificate's tolerance well below what is allowed, a clean move is never among them.
    """
    deep = np.flatnonzero(certificate.bound_mm > allowed_mm)
    deep = deep[np.argsort(-certificate.bound_mm[deep], kind="stable")]
    return tuple(ProvenGouge(row=int(certificate.row[k]), depth_mm=float(certificate.bound_mm[k]),
                             place_mm=tuple(certificate.place_mm[k].tolist()), share=float(certificate.share[k]))
                 for k in deep)


def solid_in_wcs(solid, frame):
    """A solid as TopoDS_Solid in a setup's WCS.

    Args:
        solid: TopoDS_Solid (or a shape that holds one), part coordinates.
        frame: frames.Frame of the setup.
    """
    return brep.seen_from(brep.the_solid(solid), frame)


def certify(posted, tools, part, *, tolerance_mm, rows=None, skin_mm=0.0, solid=None, kept=NOTHING):
    """Prove how deep the moves of a posted program cut into the part at most.

    The bound of a move is never below its true gouge, and at most the tolerance above it, or a fiftieth of the gouge
    where that is more (a bound of 5 mm says enough); `move_depths` names the exceptions.  Edges and borders of
    faces count where the part has them; the gaps between its faces and edges are not looked at.

    Args:
        posted: PostedMoves.
        tools: dict of tool number -> cutters.Tool.
        part: exact_drop.ExactPart of all faces of the solid, WCS (see `solid_in_wcs`); None: made of the solid, where one is
            needed, as far as the cutters come.
        tolerance_mm: of the bounds, >= 1.2e-4; a tenth of it goes to chords of arcs.
        rows: (k,) rows of interest; all if None.
        skin_mm: of the cutters, that is left out: what is plated on later.
        solid: the part as a TopoDS_Solid, WCS: asked where side-and-face cutters move and where a tool leans, of which
            nothing is proven without it.
        kept: kept.Kept, asked first for each tool's moves; NOTHING keeps nothing.
    Returns:
        Certificate.
    Raises:
        SimulationError: an arc without a radius, or with ends of clearly different radius.
        ToolpathError: a tolerance that is too fine.
    """
    rows = np.arange(len(posted)) if rows is None else np.unique(np.asarray(rows, dtype=np.int64))
    reasons = _reasons(posted, tools, rows, PROVABLE if solid is None else (*PROVABLE, SIDE, *POINTED, *ROUNDED))
    known = rows[np.array([r is None for r in reasons], bool)]
    types = np.array([tools[n].cutter.type for n in posted.tool[known].tolist()], dtype=object)
    leaning = (types != SIDE) & ~_stands_upright(posted)[known] | np.isin(types, (*POINTED, *ROUNDED))  # upright or not
    sagitta_mm = SAGITTA_SHARE * tolerance_mm
    bound, share, place = np.zeros(len(posted)), np.full(len(posted), 0.5), np.full((len(posted), 3), np.nan)
    views = _Views(part, solid, THICKNESS_SHARE * tolerance_mm, _under(posted, tools, known[~leaning]))
    for number in np.unique(posted.tool[known]).tolist():
        own, cutter = known[(posted.tool[known] == number) & ~leaning], tools[number].cutter
        for axis in np.unique(posted.start_axis[own], axis=0) if cutter.type == SIDE else (None,):
            some = own if axis is None else own[(posted.start_axis[own] == axis).all(axis=1)]
            if not len(some):
                continue
            row, *proven = _proven(views.depths_of(cutter, axis, skin_mm, tolerance_mm - sagitta_mm, kept.of(move_depths)),
                                   chords_of(posted, some, sagitta_mm))
            bound[row], share[row], place[row] = proven
        some = known[(posted.tool[known] == number) & leaning]
        if len(some):
            bound[some], share[some], place[some] = views.leaning(tolerance_mm).depths(posted, some, tools[number], skin_mm,
                                                                                       kept.of(move_depths))
    return Certificate(row=known, kind=posted.kind[known], bound_mm=bound[known], share=share[known],
                       place_mm=place[known], tolerance_mm=float(tolerance_mm), sagitta_mm=sagitta_mm,
                       uncovered=tuple((int(row), reason) for row, reason in zip(rows, reasons) if reason is not None))


def _reasons(posted, tools, rows, types):
    """Why nothing can be proven of each row; None where it can."""
    known = np.isfinite(posted.start_mm).all(axis=1) & np.isfinite(posted.end_mm).all(axis=1)
    upright = _stands_upright(posted)
    steady = (posted.start_axis == posted.end_axis).all(axis=1)

    def reason(row):
        number = int(posted.tool[row])
        if not known[row]:
            return "the program does not say where the move begins or ends"
        if number not in tools:
            return f"T{number} is not in the tool table" if number > 0 else "no tool is in the spindle"
        kind = tools[number].cutter.type
        if kind != SIDE and not upright[row]:
            return None if SIDE in types else "the tool axis is tilted"
        if kind not in types:
            return f"T{number} is a {kind} cutter, only {', '.join(types)} can be proven"
        if kind == SIDE:
            return None if steady[row] else "the tool axis turns"
        return None

    return [reason(row) for row in rows.tolist()]


def _stands_upright(posted):
    """(n,) bool: moves whose axis does not lean."""
    return np.abs(np.hstack([posted.start_axis, posted.end_axis]) - (0, 0, 1, 0, 0, 1)).max(axis=1, initial=0.0) < UPRIGHT


def _under(posted, tools, rows):
    """(low x, high x, low y, high y) of all that cutters come over in rows (k,)."""
    radius = max((tools[n].cutter.largest_radius_mm for n in np.unique(posted.tool[rows]).tolist()), default=0.0) + MORE_MM
    arcs = rows[posted.kind[rows] >= Kind.ARC_CW]
    arms = np.nan_to_num(posted.start_mm[arcs] - posted.center_mm[arcs])            # along an arc's axis its centre says nothing
    sides = 2.0 * np.sqrt((arms * arms).sum(axis=1)).max(initial=0.0)
    ends = np.vstack([posted.start_mm[rows, :2], posted.end_mm[rows, :2]])
    (low_x, low_y), (high_x, high_y) = ends.min(axis=0, initial=np.inf), ends.max(axis=0, initial=-np.inf)
    more = radius + sides
    return low_x - more, high_x + more, low_y - more, high_y + more


class _Views:
    """The part as the cutters of a program meet it: each made when it is first asked for."""

    def __init__(self, part, solid, thickness_mm, within_mm):
        self.part, self.solid, self.thickness_mm, self.within_mm = part, solid, thickness_mm, within_mm
        self.made = Known()

    def depths_of(self, cutter, axis, skin_mm, tolerance_mm, ask):
        """Function of tips (n, 3), (n, 3) that answers as `move_depths` for this cutter; `ask` is that, or as it is."""
        if axis is not None:
            view = self.made.once(tuple(axis.tolist()), lambda: SideViews(solid=self.solid, axis=tuple(axis.tolist()),
                                                                          thickness_mm=self.thickness_mm))
            return lambda start, end: view.depths(start, end, cutter, skin_mm, tolerance_mm, ask)
        tree = self.made.once(None, lambda: DepthTree.of_part(
            self.part or ExactPart.of_solid(self.solid, within_mm=self.within_mm), self.thickness_mm, self.within_mm))
        R, lift = cutter.radius_mm, np.array([0.0, 0.0, skin_mm])
        rc = {"ball": R, "flat": 0.0}.get(cutter.type, cutter.corner_radius_mm)
        return lambda start, end: ask(tree, start + lift, end + lift, R - skin_mm, max(rc - skin_mm, 0.0), tolerance_mm)

    def leaning(self, tolerance_mm):
        """LeaningViews of the part."""
        return self.made.once(LeaningViews, lambda: LeaningViews(solid=self.solid, thickness_mm=self.thickness_mm,
                                                                 tolerance_mm=tolerance_mm))


def _proven(depths, chords):
    """(rows of the chords, bound, share, place) as the deepest chord of each row says; `depths` answers as move_depths."""
    depth, along, point = depths(chords.start_mm, chords.end_mm)
    depth = depth + chords.off_mm
    deepest = np.lexsort((depth, chords.row))
    deepest = deepest[np.diff(chords.row[deepest], append=-1) != 0]
    row, along = chords.row[deepest], along[deepest]
    tip = chords.start_mm[deepest] + along[:, None] * (chords.end_mm - chords.start_mm)[deepest]
    share = chords.share[deepest, 0] + along * np.diff(chords.share[deepest], axis=1)[:, 0]
    return row, depth[deepest], share, np.where(np.isfinite(point[deepest]), point[deepest], tip)
