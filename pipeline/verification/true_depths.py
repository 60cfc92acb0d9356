"""How deep a cut really goes into the part, and how high stock really stands over it: along the nearest way.

A deviation is measured along the normal of a sample.  Near an edge the ray runs beside another face for long: a cut 1.16 mm
deep into a corner shows 1.81 mm along one of its normals.  Here every place of the ray counts with its distance to the
nearest surface of the exact part, rays that had reached their longest are followed to their end, and from the best place
a search goes on through what was cut, or left, for one that lies deeper still.
"""

import numpy as np

from cuspline.verification.residuals import LIMIT_MM

AT_CAP_MM = 1e-6          # a deviation so near to the longest that is measured is capped
PLACES = 33               # on a ray, and again between the neighbours of the best one
STRIDES = (8, 4, 2, 1)    # every so many of them are looked at first
NOISE_MM = 1e-6           # of a distance
ZOOMS = 3                 # 2 mm are then looked at every 0.5 um
BATCH = 512               # samples asked at a time, the largest deviations first
MOST = 4096               # samples asked of one finding: the true amount is then only known to be no less
STARTS = 6                # rays from whose best places the search goes on
FAR_PROUD_MM = 0.5        # of stock that stands higher along a ray nobody asks the last micrometre, and it may be a bore that was
FEW = 48                  # left out: next to its axis all its wall is as near.  So few samples are asked then, no search goes on;
SEARCHED = 2 * MOST       # nor where so many samples of one program have been searched from: it is no matter of micrometres then
SIDES = (-1.0, -0.5, 0.0, 0.5, 1.0)
AROUND = np.array([(x, y, z) for x in SIDES for y in SIDES for z in SIDES if max(abs(x), abs(y), abs(z)) == 1.0])
LAST_MM = 1e-5            # step at which the search ends
MOST_STEPS = 100


def largest_true_mm(samples, deviation_mm, rows, followed, closest, belongs, step_mm):
    """The true amount of a group of samples that are all proud, or all gouged.

    Args:
        samples: samples.Samples.   deviation_mm: (n,) of all, capped at LIMIT_MM.   rows: (k,) of the group, k > 0.
        followed: function of points and normals (m, 3) to deviations (m,) that are not capped.
        closest: ClosestTree of the whole part.
        belongs: function of places (m, 3) to (m,) bool: cut away, where the samples are gouged; stock, where they are proud.
        step_mm: distance of the samples.
    Returns:
        (amount in mm > 0 outside the part for proud samples, inside it for gouged ones; row of `samples`; whether it may
        be more because not all samples were asked).
    """
    sign = 1.0 if deviation_mm[rows[0]] > 0 else -1.0
    size = np.abs(deviation_mm[rows])
    is_capped = size >= LIMIT_MM - AT_CAP_MM
    if sign > 0 and size.max() > FAR_PROUD_MM:
        return roughly_true_mm(samples, deviation_mm, rows, followed, closest)
    order = np.concatenate([_spread(rows[is_capped]), rows[~is_capped][np.argsort(-size[~is_capped], kind="stable")]])
    found, best = [], -np.inf
    for first in range(0, min(len(order), MOST), BATCH):
        some = order[first:first + BATCH]
        length = np.abs(deviation_mm[some])
        capped = length >= LIMIT_MM - AT_CAP_MM
        if not capped.any() and length.max() <= best:
            order = order[:MOST]
            break
        points, normals = samples.points_mm[some], samples.normals[some]
        if capped.any():
            length[capped] = np.maximum(length[capped], np.abs(followed(points[capped], normals[capped])))
        true, t = _along(points, sign * normals, length, sign, closest, [f[0] for f in found])
        found += [(float(true[k]), int(some[k]), points[k] + t[k] * sign * normals[k])
                  for k in np.argsort(-true, kind="stable")[:STARTS]]
        best = max(best, float(true.max()))
    found = sorted(found, key=lambda f: -f[0])[:STARTS]
    at = found[0][1]
    best = max(best, _climbed(found, step_mm, lambda p: sign * closest.signed_distances_mm(p), belongs))
    rest = order[MOST:]
    return best, at, bool(len(rest)) and bool(is_capped.sum() > MOST or np.abs(deviation_mm[rest]).max() > best)


def roughly_true_mm(samples, deviation_mm, rows, followed, closest, few=FEW):
    """(amount, row, True) of the highest, or deepest, of a few of the farthest samples, on their own rays; nothing is searched.

    Args: as `largest_true_mm`.
    """
    sign = 1.0 if deviation_mm[rows[0]] > 0 else -1.0
    size = np.abs(deviation_mm[rows])
    capped = np.flatnonzero(size >= LIMIT_MM - AT_CAP_MM)
    some = capped[::max(1, -(-len(capped) // few))] if len(capped) else np.argsort(-size, kind="stable")[:few]
    points, normals = samples.points_mm[rows[some]], samples.normals[rows[some]]
    length = np.maximum(size[some], np.abs(followed(points, normals)))
    share = np.arange(1, PLACES + 1) / PLACES
    places = points[:, None] + sign * (length[:, None] * share)[:, :, None] * normals[:, None]
    off = (sign * closest.signed_distances_mm(places.reshape(-1, 3))).reshape(len(points), -1).max(axis=1)
    k = int(off.argmax())
    return float(off[k]), int(rows[some[k]]), True


def _spread(rows):
    """The same rows, at most MOST of them first, evenly out of all."""
    step = max(1, -(-len(rows) // MOST))
    return np.concatenate([rows[k::step] for k in range(step)]) if len(rows) else rows


def _along(points, directions, length_mm, sign, closest, known):
    """Greatest distance from the part's surface along rays, to the side that counts, and where on the ray: (n,) each.

    A distance changes by no more than the way along the ray.  A ray that cannot come up to the STARTS best, of `known`
    and of the others, is not looked at more closely: -inf.
    """
    low, high = np.zeros(len(points)), length_mm.copy()
    best, at = np.full(len(points), -np.inf), np.zeros(len(points))
    going, share = np.arange(len(points)), np.linspace(0.0, 1.0, PLACES)
    for _ in range(ZOOMS):
        t = low[going, None] + share * (high - low)[going, None]
        d, seen = np.full(t.shape, np.nan), np.zeros(PLACES, bool)
        for stride in STRIDES:
            columns = np.flatnonzero(~seen & (np.arange(PLACES) % stride == 0))
            seen[columns] = True
            places = points[going, None] + t[:, columns, None] * directions[going, None]
            d[:, columns] = sign * closest.signed_distances_mm(places.reshape(-1, 3)).reshape(-1, len(columns))
            top = np.maximum(best[going], d[:, seen].max(axis=1))
            between = 0.5 * stride * (t[:, 1] - t[:, 0]) + NOISE_MM
            is_in_play = np.abs(d[:, seen]).max(axis=1) + between >= _least_of_best(known, top)
            best[going[~is_in_play]] = -np.inf
            going, t, d = going[is_in_play], t[is_in_play], d[is_in_play]
        k, rows = d.argmax(axis=1), np.arange(len(going))
        here = d[rows, k]
        at[going] = np.where(here > best[going], t[rows, k], at[going])
        best[going] = np.maximum(best[going], here)
        low[going], high[going] = t[rows, np.maximum(k - 1, 0)], t[rows, np.minimum(k + 1, PLACES - 1)]
    return best, at


def _least_of_best(known, top):
    """The STARTS-th largest of two lists; -inf where there are fewer."""
    both = np.sort(np.concatenate([known, top]))
    return both[-STARTS] if len(both) >= STARTS else -np.inf


def _climbed(found, step_mm, height, belongs):
    """The greatest distance reached by steps in all directions from several places, through what belongs.

    Args:
        found: list of (distance, row, place (3,)).   height, belongs: functions of places (m, 3).
    """
    place, best = np.array([f[2] for f in found]), np.array([f[0] for f in found])
    step = np.full(len(best), step_mm)
    for _ in range(MOST_STEPS):
        going = np.flatnonzero(step >= LAST_MM)
        if not len(going):
            break
        places = place[going, None] + step[going, None, None] * AROUND
        flat = places.reshape(-1, 3)
        values = np.where(belongs(flat), height(flat), -np.inf).reshape(len(going), -1)
        k = values.argmax(axis=1)
        top, at = values[np.arange(len(going)), k], places[np.arange(len(going)), k]
        is_better = top > best[going]
        place[going[is_better]], best[going[is_better]] = at[is_better], top[is_better]
        step[going[~is_better]] /= 2
    return float(best.max())
