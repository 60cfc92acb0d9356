"""Drop-cutter on the exact surfaces of a part: where a cutter over (x, y) first touches, to a tenth of a micrometre.

Contacts on trimmed faces (planes, rational and free-form surfaces), on edges and on corners, for ball, bull nose and
flat end mill; nothing is tessellated.  How: `patch_tree` bounds, `patch_contacts` and `rim_contacts` find,
`patch_search` proves that nothing was missed.
"""

import math
from dataclasses import dataclass

import numpy as np

from cuspline.kernel import brep
from cuspline.surfaces.edge_curves import EdgeCurves
from cuspline.surfaces.patches import DEGREE_U, DEGREE_V, DS, DT, IS_RATIONAL, OF_FACE, OFFSET, POINT, PatchSet, derive
from cuspline.surfaces.trims import TrimSet
from cuspline.toolpaths.contact.contacts import checked_radii_mm
from cuspline.toolpaths.contact.leaf_rows import PartArrays
from cuspline.toolpaths.drop.patch_bounds import EDGE, EVERYWHERE, FACE, UPWARD, conversions
from cuspline.toolpaths.drop.patch_search import ON_PATCH, ON_S, ON_T, STACK, drop_one
from cuspline.toolpaths.drop.patch_tree import grow_leaves, grow_tree
from cuspline.values.arrays import for_kernel, frozen
from cuspline.values.compiled import njit
from cuspline.values.errors import ToolpathError
from cuspline.values.known import Known
from cuspline.values.rows import X, Y, Z, put
from cuspline.values.threads import in_blocks

TOLERANCE_MM = 1e-5         # what asks for less than this more than the best contact is not looked for
CHUNK = 256                 # points a thread takes at a time; within it the last contact guides the next search
SERIAL_ROWS = 512


@dataclass(frozen=True, eq=False, kw_only=True)
class ExactPart:
    """The faces and edges of a part as a tree of sub-patches, millimetres, in the part's own frame (tool axis +z)."""

    arrays: PartArrays      # what kernels take

    @classmethod
    def of_solid(cls, solid, upward=UPWARD, within_mm=EVERYWHERE):
        """All faces and edges of a solid (or of a shell, or of a compound of solids)."""
        return cls.of_faces(brep.faces_of(brep.wrapped(solid)), upward=upward, within_mm=within_mm)

    @classmethod
    def of_faces(cls, faces, geometry=None, upward=UPWARD, within_mm=EVERYWHERE):
        """Given `brep.Face` values, indices in this order; `geometry` = (PatchSet, TrimSet) of them if at hand.

        What looks up by no more than `upward`, the normal's z, is left out, and what lies beside a box, (low x, high x, low y,
        high y), where more is there: no cutter comes so far.

        Raises:
            ToolpathError: no face looks upward and no edge is there: nothing could be touched.
        """
        patches, trims = geometry or (PatchSet.of_faces(faces), TrimSet.of_faces(faces))
        edges = EdgeCurves.of_faces(faces)
        pieces = edges.piece + np.array([0, len(patches.coefficients), 0, 0, 0])
        patch = np.vstack([patches.patch, pieces]).astype(np.int64)
        span = np.vstack([patches.span, np.tile([-1.0, 1.0, -1.0, 1.0], (len(pieces), 1))])
        kind = np.repeat([FACE, EDGE], [len(patches.patch), len(pieces)])
        if not len(patch):
            raise ToolpathError("nothing to drop a cutter on: the part has no faces; check the selection")
        sign = patches.sign[patch[:, 0]]
        coefficients = np.concatenate([patches.coefficients, edges.coefficients])
        most = patch[:, 2:4].max() + 1
        matrices = np.zeros((most, most, most))
        for n in range(most):
            matrices[n, :n + 1, :n + 1] = conversions(n)
        grow = lambda box: grow_leaves(coefficients, patch, span, sign, kind, trims.arrays, matrices, upward, np.array(box, float))
        rows, tags, points, firsts = grow(within_mm)
        if not len(rows) and within_mm != EVERYWHERE:
            rows, tags, points, firsts = grow(EVERYWHERE)
        if not len(rows):
            raise ToolpathError("nothing to drop a cutter on: no face of the part looks upward; check the tool axis")
        nodes, first = grow_tree(points, firsts)
        arrays = (coefficients, patch, span, kind, sign, rows, tags, nodes, first)
        for a in arrays:
            a.setflags(write=False)
        return cls(arrays=PartArrays(*arrays, trims.arrays))

    def under(self, xy_mm, radius_mm):
        """What a cutter of a radius may touch at places (n, 2): all of it."""
        return self

    @property
    def memory_bytes(self):
        """Size of everything that kernels read."""
        return sum(a.nbytes for a in (*self.arrays[:-1], *self.arrays.trims))


class PartNear:
    """ExactPart of what lies near, where nobody asks for more."""

    def __init__(self, make, within_mm):
        """
        Args:
            make: function of a box, as `within_mm`, to the ExactPart of what reaches into it.
            within_mm: (low x, high x, low y, high y).
        """
        self.make, self.within_mm, self.made = make, within_mm, Known()

    def under(self, xy_mm, radius_mm):
        """ExactPart of what a cutter of a radius may touch at places (n, 2)."""
        low_x, high_x, low_y, high_y = self.within_mm
        low, high = (low_x + radius_mm, low_y + radius_mm), (high_x - radius_mm, high_y - radius_mm)
        box = self.within_mm if ((xy_mm >= low) & (xy_mm <= high)).all() else EVERYWHERE
        return self.made.once(box, lambda: self.make(box))


@dataclass(frozen=True, eq=False, kw_only=True)
class SurfaceContacts:
    """Where the cutter rests, one row a point; tip -inf, face -1 and zeros where nothing lies beneath."""

    tip_z_mm: np.ndarray        # (n,)
    contact_mm: np.ndarray      # (n, 3)
    normal: np.ndarray          # (n, 3) unit, from the contact into the cutter
    face: np.ndarray            # (n,) index of the touched face; for an edge one that it borders
    is_edge: np.ndarray         # (n,) bool

    def __post_init__(self):
        for name, shape, dtype in (("tip_z_mm", (None,), float), ("contact_mm", (None, 3), float),
                                   ("normal", (None, 3), float), ("face", (None,), np.int64),
                                   ("is_edge", (None,), bool)):
            object.__setattr__(self, name, frozen(getattr(self, name), shape, name, dtype))


def drop_tips_mm(part, xy_mm, radius_mm, corner_radius_mm, *, tolerance_mm=TOLERANCE_MM):
    """Lowest safe tip heights.

    Args:
        part: ExactPart.
        xy_mm: (n, 2) where the cutter stands; neighbours in the array should be neighbours in space.
        radius_mm: cutter radius R > 0.
        corner_radius_mm: rc, 0 (flat) to R (ball).
        tolerance_mm: the true height is at most this much higher; 5e-9 is the finest that makes sense.
    Returns:
        (n,) tip z; -inf where nothing lies beneath the cutter.
    Raises:
        ToolpathError: radii that are no cutter's.
    """
    return _dropped(part, xy_mm, None, radius_mm, corner_radius_mm, tolerance_mm)[0]


def drop_contacts(part, xy_mm, radius_mm, corner_radius_mm, *, tolerance_mm=TOLERANCE_MM):
    """As `drop_tips_mm`, with the contacts: SurfaceContacts."""
    tips, at = _dropped(part, xy_mm, None, radius_mm, corner_radius_mm, tolerance_mm)
    contact, normal = np.zeros((len(tips), 3)), np.zeros((len(tips), 3))
    xy = for_kernel(xy_mm)
    _describe(part.arrays, xy, at, float(radius_mm), float(corner_radius_mm), contact, normal)
    patch = at[:, 0].astype(np.int64)
    found = patch >= 0
    face = np.where(found, part.arrays.patch[patch, OF_FACE], -1)
    return SurfaceContacts(tip_z_mm=tips, contact_mm=contact, normal=normal, face=face,
                           is_edge=found & (part.arrays.kind[patch] == EDGE))


def gouge_depths_mm(part, tips_mm, radius_mm, corner_radius_mm, *, tolerance_mm=TOLERANCE_MM):
    """How far the cutter would have to be lifted at each tip.

    Args:
        tips_mm: (n, 3), finite.
    Returns:
        (n,) mm, 0 where it cuts into nothing (to the tolerance).
    """
    tips = for_kernel(tips_mm)
    own = for_kernel(tips[:, 2])
    return _dropped(part, tips[:, :2], own, radius_mm, corner_radius_mm, tolerance_mm)[0] - own


def _dropped(part, xy_mm, start_mm, radius_mm, corner_radius_mm, tolerance_mm):
    """(n,) tips and (n, 3) patch, s, t of the contacts."""
    R, rc = checked_radii_mm(radius_mm, corner_radius_mm)
    xy = for_kernel(xy_mm)
    start = np.full(len(xy), -np.inf) if start_mm is None else start_mm
    tips, at = np.empty(len(xy)), np.empty((len(xy), 3))
    in_blocks(_drop_rows, len(xy), CHUNK, part.arrays, xy, start, R, rc, float(tolerance_mm), tips, at,
              serial_rows=SERIAL_ROWS)
    return tips, at


@njit
def scratch_space():
    """What one thread needs for `drop_one`."""
    return (np.empty((STACK, 5)), np.empty(STACK, np.int64), np.empty((6, 3)), np.zeros(12), np.empty(8),
            np.zeros((1, 12)))


@njit(error_model="numpy")
def _drop_rows(tree, xy, start, R, rc, tolerance, tips, at, low, high):
    """Drop rows low..high-1; the contact runs on along them as the next one's hint."""
    scratch = scratch_space()
    hint, last = np.full(3, -1.0), np.full(3, -1.0)
    for i in range(low, high):
        tips[i] = drop_one(tree, xy[i, X], xy[i, Y], R, rc, tolerance, start[i], hint, scratch, at[i])
        hint[ON_PATCH] = at[i, ON_PATCH]
        if at[i, ON_PATCH] >= 0.0:
            hint[ON_S], hint[ON_T] = at[i, ON_S], at[i, ON_T]
            if last[ON_PATCH] == at[i, ON_PATCH]:
                hint[ON_S] = min(max(2.0 * at[i, ON_S] - last[ON_S], -1.0), 1.0)
                hint[ON_T] = min(max(2.0 * at[i, ON_T] - last[ON_T], -1.0), 1.0)
        put(last, at[i])


@njit(error_model="numpy")
def _describe(tree, xy, at, R, rc, contact, normal):
    """Contact points, and normals into the cutter: the face's, on an edge the cutter's."""
    o = np.empty((6, 3))
    for i in range(len(xy)):
        if at[i, ON_PATCH] < 0.0:
            continue
        p = int(at[i, ON_PATCH])
        row = tree.patch[p]
        derive(tree.coefficients, row[OFFSET], row[DEGREE_U], row[DEGREE_V], row[IS_RATIONAL] != 0, at[i, ON_S],
               at[i, ON_T], o)
        contact[i] = o[POINT]
        n = np.zeros(3)
        if tree.kind[p] == FACE:
            n = tree.sign[p] * np.cross(o[DS], o[DT])
        size = math.sqrt(n[X] * n[X] + n[Y] * n[Y] + n[Z] * n[Z])
        if not size > 0.0:
            n = np.array([0.0, 0.0, 1.0])
            dx, dy = o[POINT, X] - xy[i, X], o[POINT, Y] - xy[i, Y]
            d = np.sqrt(dx * dx + dy * dy)
            e = d - (R - rc)
            if rc > 0.0 and e > 0.0:
                n = np.array([-e * dx / d, -e * dy / d, np.sqrt(max(rc * rc - e * e, 0.0))])
        normal[i] = n / math.sqrt(n[X] * n[X] + n[Y] * n[Y] + n[Z] * n[Z])
