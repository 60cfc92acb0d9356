"""An outside judge of findings: what really stands or is missing at a finding's place, by brute force on the exact faces.

    python bench/brute_force.py FOLDER...       folders that hold a STEP file, its posted programs, manifest.json, verify.json

Of cuspline only the reader of the posted text is used.  The faces are the CAD kernel's own.  A cutter stands at places every
0.02 mm of its posted moves, and whatever lies above its bottom is gone.  From exact places on the faces round the finding's
place rays go out along the normal, and into the part: how far stock stands on them, and how deep it is missing.
"""

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Compound

from cuspline.posts.readers.rs274_reader import read_program
from cuspline.program.program import Kind, Plane

STEP_MM = 0.02              # between places of a cutter: a bottom of 1 mm radius lies 0.05 µm too high between them
ROUND_MM = 0.12             # faces are looked at so far round a finding's place
RAYS = 9                    # along each side of that square, on every face that is near
LONGEST_MM = 3.0            # of a ray
COARSE = 60                 # places on a ray before halving
HALVINGS = 18
ON_RAY = np.linspace(0.1, 1.0, 10)      # places whose nearest face is looked for
SAME_MM, SAME_SHARE = 0.002, 0.1    # a finding's amount and brute force's may differ by the larger of the two
JUDGED = ("gouge", "excess", "missing_area", "verifiers_disagree")


@dataclass(frozen=True, eq=False)
class Cuts:
    """Places of upright cutters in one setup's work coordinates."""

    tip_mm: np.ndarray          # (n, 3)
    radius_mm: np.ndarray       # (n,)
    corner_mm: np.ndarray       # (n,) of its radius: 0 flat, the radius ball

    def bottom_mm(self, apart_mm):
        """Heights above the tip of the cutters' bottoms so far from their axes; inf beyond their sides."""
        corner = np.maximum(self.corner_mm, 1e-12)
        out = apart_mm - (self.radius_mm - self.corner_mm)
        rise = corner - np.sqrt(np.maximum(corner ** 2 - np.maximum(out, 0.0) ** 2, 0.0))
        return np.where(apart_mm > self.radius_mm, np.inf, rise)

    def near(self, place, by_mm):
        """Those that come into a ball round a place."""
        apart = np.maximum(np.hypot(*(self.tip_mm[:, :2] - place[:2]).T) - by_mm, 0.0)
        rows = self.tip_mm[:, 2] + self.bottom_mm(apart) < place[2] + by_mm
        return Cuts(self.tip_mm[rows], self.radius_mm[rows], self.corner_mm[rows])

    def takes(self, points):
        """(m,) bool: a cutter goes over these points (m, 3)."""
        apart = np.hypot(*(points[:, None, k] - self.tip_mm[:, k] for k in (0, 1)))
        return (self.tip_mm[:, 2] + self.bottom_mm(apart) < points[:, 2:]).any(axis=1)


@dataclass(frozen=True, eq=False)
class Clamping:
    """A setup: its frame and all that it cuts."""

    origin: np.ndarray
    axes: np.ndarray            # (3, 3) rows x, y, z in the part
    cuts: Cuts

    def takes(self, points):
        return self.cuts.takes((points - self.origin) @ self.axes.T)

    def near(self, place, by_mm):
        return Clamping(self.origin, self.axes, self.cuts.near(self.axes @ (place - self.origin), by_mm))


def cuts_of(folder, posted):
    """Cuts of one setup's programs.

    Raises:
        ValueError: a cutter is neither ball, bull nose nor flat end mill.
    """
    tools = {t["number"]: t["cutter"] for t in json.loads((folder / "tools.json").read_text())["tools"]}
    tips, numbers = [], []
    for name in [posted["program"], *posted["continued"]]:
        moves = read_program((folder / name).read_text(), work_offsets={}, tool_lengths=dict.fromkeys(tools, 0.0))
        for k in range(len(moves)):
            if np.isfinite(moves.start_mm[k]).all() and np.isfinite(moves.end_mm[k]).all():
                tips.append(_places(moves, k))
                numbers += [int(moves.tool[k])] * len(tips[-1])
    used = sorted(set(numbers))
    if any(tools[n]["type"] not in ("ball", "bull_nose", "flat") for n in used):
        raise ValueError(f"{folder}: only balls, bull noses and flat end mills are judged here")
    half = np.zeros(max(used) + 1)
    corner = half.copy()
    for n in used:
        half[n], corner[n] = tools[n]["diameter_mm"] / 2, tools[n]["corner_radius_mm"]
    return Cuts(np.vstack(tips), half[numbers], corner[numbers])


def _places(moves, k):
    """(n, 3) places along a posted move, both ends among them."""
    start, end = moves.start_mm[k], moves.end_mm[k]
    if moves.kind[k] in (Kind.RAPID, Kind.FEED):
        share = np.linspace(0.0, 1.0, max(2, math.ceil(np.linalg.norm(end - start) / STEP_MM) + 1))
        return start + share[:, None] * (end - start)
    a, b, c = Plane(moves.plane[k]).axes
    center, left = moves.center_mm[k], moves.kind[k] == Kind.ARC_CCW
    first, last = (math.atan2(p[b] - center[b], p[a] - center[a]) for p in (start, end))
    radii = [math.hypot(p[a] - center[a], p[b] - center[b]) for p in (start, end)]
    sweep = (last - first if left else first - last) % (2 * math.pi)
    sweep = (2 * math.pi if sweep < 1e-9 else sweep) + 2 * math.pi * int(moves.turns[k])
    length = math.hypot(radii[0] * sweep, end[c] - start[c])
    share = np.linspace(0.0, 1.0, max(2, math.ceil(length / STEP_MM) + 1))
    angle, radius = first + (1 if left else -1) * share * sweep, radii[0] + share * (radii[1] - radii[0])
    out = np.empty((len(share), 3))
    out[:, a], out[:, b] = center[a] + radius * np.cos(angle), center[b] + radius * np.sin(angle)
    out[:, c] = start[c] + share * (end[c] - start[c])
    return out


def clampings_of(folder, job):
    """Clamping values of all setups."""
    out = []
    for posted in job["posted"]:
        setup = posted["setup"]
        x, z = np.array(setup["wcs_x"], float), np.array(setup["wcs_z"], float)
        z = z / np.linalg.norm(z)
        x = x - (x @ z) * z
        x = x / np.linalg.norm(x)
        out.append(Clamping(np.array(setup["wcs_origin_mm"], float), np.stack([x, np.cross(z, x), z]), cuts_of(folder, posted)))
    return out


@dataclass(frozen=True, eq=False)
class Exact:
    """The part as the CAD kernel has it."""

    faces: list
    together: object            # all faces as one shape
    solid: object               # its classifier

    def holds(self, points):
        """(m,) bool: points (m, 3) lie inside the part."""
        inside = np.zeros(len(points), bool)
        for k, p in enumerate(points):
            self.solid.Perform(gp_Pnt(*map(float, p)), 1e-7)
            inside[k] = self.solid.State() == TopAbs_IN
        return inside


def exact_of(path):
    """Exact of a STEP file of one solid."""
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    solid = _parts_of(reader.OneShape(), TopAbs_SOLID)[0]
    faces = [TopoDS.Face_s(f) for f in _parts_of(solid, TopAbs_FACE)]
    build, together = BRep_Builder(), TopoDS_Compound()
    build.MakeCompound(together)
    for face in faces:
        build.Add(together, face)
    return Exact(faces, together, BRepClass3d_SolidClassifier(solid))


def _parts_of(shape, kind):
    walk, parts = TopExp_Explorer(shape, kind), []
    while walk.More():
        parts.append(walk.Current())
        walk.Next()
    return parts


def apart_mm(shape, place):
    """Nearest distance of a place from a shape."""
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*map(float, place))).Vertex()
    return BRepExtrema_DistShapeShape(vertex, shape).Value()


def exact_places(faces, place):
    """[(point, outward normal)] on the faces round a place, whichever of them come within ROUND_MM."""
    out = []
    for face in faces:
        if apart_mm(face, place) > ROUND_MM:
            continue
        surface = BRepAdaptor_Surface(face)
        foot = GeomAPI_ProjectPointOnSurf(gp_Pnt(*map(float, place)), BRep_Tool.Surface_s(face))
        if foot.NbPoints() == 0:
            continue
        u, v = foot.LowerDistanceParameters()
        _, du, dv = _derivatives(surface, u, v)
        span_u, span_v = (ROUND_MM / max(np.linalg.norm(d), 1e-6) for d in (du, dv))
        inside = BRepTopAdaptor_FClass2d(face, 1e-7)
        for a in np.linspace(-1, 1, RAYS):
            for b in np.linspace(-1, 1, RAYS):
                uu, vv = u + a * span_u, v + b * span_v
                if inside.Perform(gp_Pnt2d(uu, vv)) not in (TopAbs_IN, TopAbs_ON):
                    continue
                point, du, dv = _derivatives(surface, uu, vv)
                normal = np.cross(du, dv)
                length = np.linalg.norm(normal)
                if length > 1e-9 and np.linalg.norm(point - place) < 2 * ROUND_MM:
                    out.append((point, normal / length * (-1 if face.Orientation() == TopAbs_REVERSED else 1)))
    return out


def _derivatives(surface, u, v):
    """Point and both first derivatives, (3,) each."""
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    surface.D1(u, v, point, du, dv)
    return tuple(np.array([w.X(), w.Y(), w.Z()]) for w in (point, du, dv))


def along_mm(holds_at, point, direction, longest_mm):
    """How far from a point along a direction something holds that holds at places (m, 3), up to where it first does not."""
    reach = np.linspace(0.0, longest_mm, COARSE)[1:]
    ends = np.flatnonzero(~holds_at(point + reach[:, None] * direction))
    if len(ends) == 0:
        return longest_mm
    low, high = (reach[ends[0] - 1] if ends[0] else 0.0), reach[ends[0]]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if holds_at((point + middle * direction)[None])[0]:
            low = middle
        else:
            high = middle
    return low


@dataclass(frozen=True)
class Found:
    """What brute force finds round a place, mm: along the normal, and from the same rays to the nearest face."""

    left_mm: float
    left_nearest_mm: float
    missing_mm: float
    missing_nearest_mm: float


def found_at(place, amount_mm, clampings, exact, stands_before):
    """Found round a place in the part."""
    longest = float(np.clip(4 * amount_mm, 0.2, LONGEST_MM))
    beside = [c.near(place, 2 * ROUND_MM + longest) for c in clampings]

    def gone(points):
        away = ~stands_before(points)
        for c in beside:
            away |= c.takes(points)
        return away

    best = dict.fromkeys(("left", "missing"), (0.0, 0.0))

    def holds_at(points, is_gone):
        """Gone and inside the part, or standing and outside."""
        found = gone(points) == is_gone
        found[found] = exact.holds(points[found]) == is_gone
        return found

    wanted = {"left": lambda points: holds_at(points, False), "missing": lambda points: holds_at(points, True)}
    for point, normal in exact_places(exact.faces, place):
        for name, sign in (("left", 1), ("missing", -1)):
            far = along_mm(wanted[name], point, sign * normal, longest)
            if far > best[name][1]:                 # no place on a ray is farther from the faces than from where it begins
                nearest = max(apart_mm(exact.together, point + share * sign * far * normal) for share in ON_RAY)
                best[name] = max(far, best[name][0]), max(nearest, best[name][1])
    return Found(*best["left"], *best["missing"])


def stock_of(stock):
    """Function (m, 3) -> (m,) bool: within the stock as given; of other forms than boxes, everywhere."""
    if "min_mm" not in stock:
        return lambda points: np.ones(len(points), bool)
    low, high = np.array(stock["min_mm"]), np.array(stock["max_mm"])
    return lambda points: ((points >= low) & (points <= high)).all(axis=1)


def word_of(finding, found, finish):
    """`true`, `false` (nothing there beyond what the finish allows), or `true, other amount`."""
    allowed = {"left": finish["scallop_mm"] + finish["profile_tolerance_mm"], "missing": finish["gouge_mm"]}
    left, missing = max(found.left_mm, found.left_nearest_mm), max(found.missing_mm, found.missing_nearest_mm)
    kind = finding["kind"]
    if kind == "verifiers_disagree":
        return "true" if left > allowed["left"] or missing > allowed["missing"] else "false"
    name, most = ("missing", missing) if kind == "gouge" else ("left", left)
    if most <= allowed[name]:
        return "false"
    amounts = (found.left_mm, found.left_nearest_mm) if name == "left" else (found.missing_mm, found.missing_nearest_mm)
    apart = min(abs(a - finding["amount_mm"]) for a in amounts)
    is_same = kind == "missing_area" or apart <= max(SAME_MM, SAME_SHARE * finding["amount_mm"])
    return "true" if is_same else "true, other amount"


def judged(folder):
    """(finding, Found, word) of all findings of a folder that are judged here."""
    folder = Path(folder)
    manifest, verdict = (json.loads((folder / name).read_text()) for name in ("manifest.json", "verify.json"))
    job = manifest["job"]
    findings = [f for f in verdict["findings"] if f["kind"] in JUDGED and f["place_mm"] is not None]
    if not findings:
        return []
    clampings, exact = clampings_of(folder, job), exact_of(folder / job["step"])
    rows = []
    for finding in findings:
        found = found_at(np.array(finding["place_mm"]), finding["amount_mm"], clampings, exact, stock_of(job["stock"]))
        rows.append((finding, found, word_of(finding, found, job["finish"])))
    return rows


def main(folders):
    for folder in folders:
        for finding, found, word in judged(folder):
            print(f"{folder}: {finding['kind']} {finding['amount_mm']:.4f} at {finding['place_mm']}: "
                  f"left {found.left_mm:.4f} (nearest {found.left_nearest_mm:.4f}), "
                  f"missing {found.missing_mm:.4f} (nearest {found.missing_nearest_mm:.4f}): {word}")


if __name__ == "__main__":
    main(sys.argv[1:])
