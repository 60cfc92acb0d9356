r"""The ground of one level while passes clear it: where material is left and where the cutter stands free of it.

Every field is worked out once over the whole level and then again only round what each pass has
cleared.  Distances matter up to a little more than the cutter's radius (the reach), so a pass
changes nothing farther away:

    · · · · · · · · ·   · looked at: two reaches round what is cleared
    · + + + + + + + ·   + worked out anew: one reach round it
    · + ▒▒▒▒▒▒▒▒▒ + ·   ▒ cleared
    · + + + + + + + ·   all in square tiles
"""

import math

import numpy as np
from scipy import ndimage

from cuspline.toolpaths.roughing.level_fields import inner_distance, nearest_seed
from cuspline.values import fixed_math as fixed
from cuspline.values.compiled import njit
from cuspline.values.rows import X, Y

FARTHEST_NODES = 4.0    # free room beyond this is cut off, so that it does not matter when it was worked out
STROKE_NODES = 3        # a stroke changes the material no farther outside the cutter
TILE_NODES = 8
INSIDE_NODES = 3.0      # distances are not wanted deeper in material than this


class LevelGround:
    """Plane fields (ny, nx) of one level, lengths in nodes; x to the columns, y to the rows."""

    def __init__(self, material, permitted, radius, thin, hidden, shallow):
        """Fields of a level on which nothing has been cut.

        Args:
            material: (ny, nx) distance to what is cleared, positive in material.
            permitted: (ny, nx) >= 0 where the tip may be.
            radius, thin: cutter, thinnest material that counts.
            hidden: how far from the node that shows it a fin may lie.
            shallow: material that the cutter would enter by less than this is left.
        """
        self.material, self.permitted = material.copy(), permitted
        self.radius, self.thin, self._hidden = radius, thin, hidden
        self._in_reach = permitted > shallow - radius
        self._scraps = np.zeros(material.shape, bool)       # goals that have been given up
        self.is_tabu = np.zeros(material.shape, bool)       # starts that came to nothing
        self.is_goal = np.zeros(material.shape, bool)       # material that the cutter can get at
        self.standing = np.empty(material.shape)            # >= 0: permitted and free of material
        self.surely = np.empty(material.shape)              # the same for fins that nodes show only in part
        self.apart = np.empty(material.shape)               # to the nearest goal; large where that is far
        self.near = np.empty((*material.shape, 2))          # its x, y
        self._kept = material.copy()
        self._refresh(self._tiles_of(*map(np.ravel, np.indices(material.shape))))

    @property
    def left_nodes(self):
        """Number of nodes within reach that still stand, scraps counted."""
        return int(((self.material > self.thin) & self._in_reach).sum())

    def accept(self, path):
        """Take over what a pass along (n, 2) places has cleared."""
        window = self.window(path, self.radius + STROKE_NODES)
        new, old = self.material[window], self._kept[window]
        changed = (new < old) & (old > -self._hidden - 2)   # farther out no line passes
        j, i = np.nonzero(changed)
        self._kept[window] = new
        self._refresh(self._tiles_of(j + window[0].start, i + window[1].start))

    def refuse(self, path, place, tabu_nodes):
        """Put back what a pass has cleared and begin no other one so near to a place."""
        window = self.window(path, self.radius + STROKE_NODES)
        self.material[window] = self._kept[window]
        rows, columns = self.window(place[None], tabu_nodes)
        j, i = np.ogrid[rows, columns]
        self.is_tabu[rows, columns] |= (i - place[0]) ** 2 + (j - place[1]) ** 2 <= tabu_nodes ** 2

    def give_up_scrap(self, place, largest_nodes):
        """The patch of goals nearest to a place is left from now on if it has no more nodes than this."""
        x, y = self.near[int(place[1]), int(place[0])].astype(int)
        patch = _patch(self.is_goal, x, y, largest_nodes + 1)
        if len(patch) > largest_nodes:
            return
        self._scraps[patch[:, 1], patch[:, 0]] = True
        self._refresh(self._tiles_of(patch[:, 1], patch[:, 0]))

    def starts(self, field, beside):
        """(ny, nx) bool: the field is not negative and the cutter stands no farther than this from a goal."""
        return (field >= 0) & (self.apart <= self.radius + beside) & ~self.is_tabu

    def toward_rad(self, node):
        """Direction from a node to its nearest goal."""
        x, y = self.near[int(round(node[1])), int(round(node[0]))] - node
        return fixed.arctan2(y, x)

    def window(self, path, by):
        """Slices (rows, columns) round (n, 2) places."""
        low = np.maximum(np.floor(path.min(axis=0) - by), 0).astype(int)
        high = np.minimum(np.ceil(path.max(axis=0) + by) + 1, self.material.shape[::-1]).astype(int)
        return slice(low[1], high[1]), slice(low[0], high[0])

    def _tiles_of(self, rows, columns):
        """(ky, kx) bool tiles that hold one of these nodes."""
        tiles = np.zeros([math.ceil(n / TILE_NODES) for n in self.material.shape], bool)
        tiles[rows // TILE_NODES, columns // TILE_NODES] = True
        return tiles

    def _refresh(self, tiles):
        """Work out everything that depends on the material of the marked tiles."""
        farthest = self.radius + FARTHEST_NODES + self._hidden
        side = 2 * math.ceil(farthest / TILE_NODES) + 1
        anew = ndimage.maximum_filter(tiles, side)
        looked_at = ndimage.maximum_filter(anew, side)
        if not tiles.any():
            return
        j, i = np.nonzero(looked_at.any(axis=1))[0], np.nonzero(looked_at.any(axis=0))[0]
        window = tuple(slice(k[0] * TILE_NODES, (k[-1] + 1) * TILE_NODES) for k in (j, i))
        material = self.material[window]
        is_far, is_anew = (~_nodes(looked_at, j, i, material.shape)), _nodes(anew, j, i, material.shape)
        is_deep = is_far | (material > self.thin + INSIDE_NODES)
        free = inner_distance(-material, -self.thin, is_deep, farthest) - self.radius
        sure = inner_distance(-material, self._hidden, is_deep, farthest) - self.radius - self._hidden
        goal = (material > self.thin) & self._in_reach[window] & ~self._scraps[window]
        near, apart = nearest_seed(goal, is_deep, farthest)
        permitted = self.permitted[window]
        for field, value in ((self.standing, np.minimum(np.minimum(free, FARTHEST_NODES), permitted)),
                             (self.surely, np.minimum(np.minimum(sure, FARTHEST_NODES), permitted)),
                             (self.is_goal, goal), (self.apart, apart)):
            np.copyto(field[window], value, where=is_anew)
        np.copyto(self.near[window], near + (window[1].start, window[0].start), where=is_anew[..., None])


def _nodes(tiles, rows, columns, shape):
    """Marks of the nodes of a window that begins and ends with these rows and columns of tiles."""
    part = tiles[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
    return np.repeat(np.repeat(part, TILE_NODES, axis=0), TILE_NODES, axis=1)[:shape[0], :shape[1]]


@njit
def _patch(is_goal, x, y, most):
    """(k, 2) x, y of marked nodes that hang together with one of them, no more than `most`."""
    ny, nx = is_goal.shape
    out = np.empty((most, 2), np.int64)
    if not is_goal[y, x]:
        return out[:0]
    out[0, X], out[0, Y], count, at = x, y, 1, 0
    while at < count and count < most:
        for j in range(max(out[at, Y] - 1, 0), min(out[at, Y] + 2, ny)):
            for i in range(max(out[at, X] - 1, 0), min(out[at, X] + 2, nx)):
                if not is_goal[j, i] or count >= most:
                    continue
                seen = False
                for k in range(count):
                    seen = seen or (out[k, X] == i and out[k, Y] == j)
                if not seen:
                    out[count, X], out[count, Y] = i, j
                    count += 1
        at += 1
    return out[:count]
