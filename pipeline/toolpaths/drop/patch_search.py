"""Branch and bound over the tree of sub-patches: the highest tip that any contact asks for, none missed.

A leaf is settled when its bound is met, when no normal on it can meet the cutter there, when it is a plane
(closed form), or when it provably holds at most one contact and the local search has found it; else it is halved.
Contacts outside a face's trim are none: there the face's edges rule, and they are leaves of their own.
"""

import math

from cuspline.surfaces.patches import derive, scale_derivatives
from cuspline.surfaces.trims import is_inside
from cuspline.toolpaths.contact.contact_maps import HAIR, map_proof, map_step
from cuspline.toolpaths.contact.rim_contacts import climb_flat, flat_proof
from cuspline.toolpaths.drop.patch_bounds import BORDER, EDGE, FACE, OUTSIDE, cone_box, part_state
from cuspline.toolpaths.drop.patch_contacts import bottom, box_proof, climb, node_bound
from cuspline.toolpaths.drop.patch_tree import CURVED
from cuspline.toolpaths.drop.plane_contacts import plane_contact
from cuspline.values.compiled import njit

STACK = 1024
SMALLEST_MM = 1e-6          # halvings end here: at an upright tangent the tip is that of a cutter this far aside


@njit(inline="always")
def in_trim(tree, patch, s, t):
    """Is (s, t) of a patch inside the face's trim?"""
    span = tree[2][patch]
    u = 0.5 * (span[0] + span[1] + s * (span[1] - span[0]))
    v = 0.5 * (span[2] + span[3] + t * (span[3] - span[2]))
    return is_inside(tree[9], tree[1][patch, 0], u, v)


@njit(error_model="numpy", inline="always")
def can_meet(normals, xl, xh, yl, yh, x, y, R, rc):
    """Can a surface within this box with these normals touch the cutter at (x, y)?  Offsets of the box must hold it."""
    c = R - rc
    return (xl + rc * normals[0] + c * normals[4] <= x <= xh + rc * normals[1] + c * normals[5]
            and yl + rc * normals[2] + c * normals[6] <= y <= yh + rc * normals[3] + c * normals[7])


@njit(error_model="numpy")
def drop_one(tree, x, y, R, rc, tolerance, best, hint, scratch, contact):
    """Highest tip over (x, y).

    Args:
        tree: (coefficients, patch, span, kind, sign, rows, tags, nodes, first, trims).
        best: tip to begin with: only what asks for more than that plus the tolerance is looked for.
        hint: (4,) patch (< 0: none), s, t of a likely contact.
        scratch: (box stack (STACK, 5), leaf stack (STACK,), o (6, 3), w (4,), normals (8,), a plane (1, 12)).
        contact: (3,) patch, s, t of the contact, filled; patch -1 where none asked for more than `best`.
    Returns:
        the tip.
    """
    coefficients, patches, rows, tags, nodes, first = tree[0], tree[1], tree[5], tree[6], tree[7], tree[8]
    boxes, ids, o, w, normals, plane = scratch
    contact[0] = -1.0
    is_maximum = False
    if hint[0] >= 0.0:
        p = int(hint[0])
        if rc > 0.0:
            tip = climb(coefficients, patches[p], hint[1], hint[2], -1.0, 1.0, -1.0, 1.0, x, y, R, rc, best, o, w)
        else:
            tip = climb_flat(coefficients, patches[p], hint[1], hint[2], -1.0, 1.0, -1.0, 1.0, x, y, R, o, w)
        if tip > best and (tree[3][p] == EDGE or in_trim(tree, p, w[0], w[1])):
            best = tip
            contact[0], contact[1], contact[2] = p, w[0], w[1]
            is_maximum = w[2] > 1.0
    ids[0], boxes[0, 0] = 0, node_bound(nodes, 0, x, y, R, rc)
    top = 1
    while top > 0:
        top -= 1
        bound = boxes[top, 0]
        if bound <= best + tolerance:
            continue
        k = ids[top]
        if k >= 0 and first[k] >= 0:
            a = first[k]
            b = a + 1
            ba, bb = node_bound(nodes, a, x, y, R, rc), node_bound(nodes, b, x, y, R, rc)
            if ba > bb:
                a, b, ba, bb = b, a, bb, ba
            if ba > best + tolerance:
                ids[top], boxes[top, 0] = a, ba
                top += 1
            if bb > best + tolerance:
                ids[top], boxes[top, 0] = b, bb
                top += 1
            continue
        whole = k >= 0
        leaf = -1 - first[k] if whole else -1 - k
        row, tag = rows[leaf], tags[leaf]
        patch = tag[0]
        kind, state = tag[1], tag[2]
        si, ti, alpha, beta = 0.0, 0.0, 1.0, 1.0
        if whole:
            if kind == FACE:
                if not can_meet(row[14:22], nodes[k, 0], nodes[k, 1], nodes[k, 2], nodes[k, 3], x, y, R, rc):
                    continue
                if tag[3] != CURVED:
                    tip = plane_contact(tree, leaf, x, y, R, rc, o, w)
                    if tip > best and (state != BORDER or in_trim(tree, patch, w[0], w[1])):
                        best = tip
                        contact[0], contact[1], contact[2] = patch, w[0], w[1]
                        is_maximum = False
                    continue
        else:
            si, ti, alpha, beta = boxes[top, 1], boxes[top, 2], boxes[top, 3], boxes[top, 4]
        s, t, hs, ht = row[0] + row[1] * si, row[2] + row[3] * ti, row[1] * alpha, row[3] * beta
        if kind == FACE and state == BORDER and not whole:
            if part_state(tree[9], patches[patch, 0], tree[2][patch], s, hs, t, ht) == OUTSIDE:
                continue
        prow = patches[patch]
        derive(coefficients, prow[1], prow[2], prow[3], prow[4] != 0, s, t, o)
        scale_derivatives(o, hs, ht)
        nx = ny = nz = n = sign = 0.0
        sine = 2.0
        bend = 0.5 * (row[6] * alpha * alpha + 2.0 * row[7] * alpha * beta + row[8] * beta * beta)
        if kind == FACE:
            sign = tree[4][patch]
            nx, ny, nz, n, sine = box_normal(row, o, alpha, beta, sign)
        if not whole:
            ex = abs(o[1, 0]) + abs(o[2, 0]) + bend
            ey = abs(o[1, 1]) + abs(o[2, 1]) + bend
            if kind == FACE and sine < 1.0:
                cone_box(nx, ny, nz, sine, 1.0, normals)
                if nz + sine <= 0.0:
                    continue
                if not can_meet(normals, o[0, 0] - ex, o[0, 0] + ex, o[0, 1] - ey, o[0, 1] + ey, x, y, R, rc):
                    continue
            fill_plane(o, row, alpha, beta, nx, ny, nz if sine < 1.0 else 0.0, kind, ex, ey, bend, plane)
            dx, dy = o[0, 0] - x, o[0, 1] - y
            near = math.sqrt(dx * dx + dy * dy)
            if near > 0.0:                      # no nearer to the axis than this, seen from the middle
                near -= (abs(dx * o[1, 0] + dy * o[1, 1]) + abs(dx * o[2, 0] + dy * o[2, 1])) / near + bend + 1e-9
            if near > R:
                continue
            bound = min(bound, node_bound(plane, 0, x, y, R, rc), plane[0, 4] - bottom(max(near, 0.0), R, rc))
            if bound <= best + tolerance:
                continue
        proof, middle_z = 0, o[0, 2]
        w[0] = w[1] = 0.0
        if kind == FACE:
            proof = map_proof(row, o, alpha, beta, sign, nx, ny, nz, n, sine, x, y, R, rc, w)
        by_map = proof == 1
        if proof == 0:
            if rc > 0.0:
                proof = box_proof(row, kind, o, alpha, beta, x, y, R, rc, best, bound, tolerance, nz, sine)
            else:
                proof = flat_proof(row, kind, o, alpha, beta, x, y, R, nz, sine)
        if proof == 2:
            continue
        known = (is_maximum and contact[0] == patch and abs(contact[1] - s) <= hs * 1.000001
                 and abs(contact[2] - t) <= ht * 1.000001)
        if proof == 1 and known:
            continue
        if by_map and not map_step(coefficients, prow, s, t, hs, ht, sign, x, y, R, rc, o, w):
            continue
        settled = False
        if proof == 1 or (whole and not known):
            hair = HAIR if by_map else 0.0
            sl, sh = max(s - hs * (1.0 + hair), -1.0), min(s + hs * (1.0 + hair), 1.0)
            tl, th = max(t - ht * (1.0 + hair), -1.0), min(t + ht * (1.0 + hair), 1.0)
            fs, ft = min(max(s + hs * w[0], sl), sh), min(max(t + ht * w[1], tl), th)
            if rc > 0.0:
                tip = climb(coefficients, prow, fs, ft, sl, sh, tl, th, x, y, R, rc, min(bound, middle_z), o, w)
            else:
                tip = climb_flat(coefficients, prow, fs, ft, sl, sh, tl, th, x, y, R, o, w)
            settled = proof == 1 and (w[2] > 1.0 or (w[2] > 0.0 and not by_map))
            if tip > best and (kind == EDGE or state != BORDER or in_trim(tree, patch, w[0], w[1])):
                best = tip
                contact[0], contact[1], contact[2] = patch, w[0], w[1]
                is_maximum = w[2] > 1.0
        else:
            d = math.sqrt((o[0, 0] - x) ** 2 + (o[0, 1] - y) ** 2)
            if d <= R:
                tip = o[0, 2] - bottom(d, R, rc)
                if tip > best and (kind == EDGE or state != BORDER or in_trim(tree, patch, s, t)):
                    best = tip
                    contact[0], contact[1], contact[2] = patch, s, t
                    is_maximum = False
        if settled or bound <= best + tolerance or row[4] * alpha + row[5] * beta < SMALLEST_MM or top + 2 > STACK:
            continue
        split_t = kind == FACE and row[5] * beta > row[4] * alpha
        for side in (-1.0, 1.0):
            ids[top] = -1 - leaf
            boxes[top, 0] = bound
            boxes[top, 1], boxes[top, 2], boxes[top, 3], boxes[top, 4] = si, ti, alpha, beta
            if split_t:
                boxes[top, 2], boxes[top, 4] = ti + side * 0.5 * beta, 0.5 * beta
            else:
                boxes[top, 1], boxes[top, 3] = si + side * 0.5 * alpha, 0.5 * alpha
            top += 1
    return best


@njit(error_model="numpy")
def box_normal(row, o, alpha, beta, sign):
    """Unit normal in the middle of a box of a leaf, the length of S_s x S_t there, and the sine of how far it turns.

    Args:
        row: the leaf's row (see patch_tree); alpha, beta: half sizes of the box within the leaf.
        o: (6, 3) position and derivatives in the middle, per alpha, beta.
        sign: of the face's normal.
    Returns:
        nx, ny, nz, length, sine; the sine is 2 where there is no normal.
    """
    nx = sign * (o[1, 1] * o[2, 2] - o[1, 2] * o[2, 1])
    ny = sign * (o[1, 2] * o[2, 0] - o[1, 0] * o[2, 2])
    nz = sign * (o[1, 0] * o[2, 1] - o[1, 1] * o[2, 0])
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not n > 0.0:
        return nx, ny, nz, n, 2.0
    turn = (row[6] * row[5] + row[4] * row[7]) * alpha + (row[7] * row[5] + row[4] * row[8]) * beta
    return nx / n, ny / n, nz / n, n, turn * alpha * beta / n


@njit(error_model="numpy")
def fill_plane(o, row, alpha, beta, nx, ny, nz, kind, ex, ey, bend, plane):
    """Upper plane of a box from the derivatives in its middle, as a tree node (see patch_tree)."""
    a = b = 0.0
    cubic = (row[9] * alpha ** 3 + 3.0 * row[10] * alpha * alpha * beta + 3.0 * row[11] * alpha * beta * beta
             + row[12] * beta ** 3) / 6.0
    if kind == EDGE:
        h2 = o[1, 0] * o[1, 0] + o[1, 1] * o[1, 1]
        if h2 > 0.04 * o[1, 2] * o[1, 2]:
            a, b = o[1, 0] * o[1, 2] / h2, o[1, 1] * o[1, 2] / h2
    elif nz > 0.05:
        a, b = -nx / nz, -ny / nz
    # z - a x - b y: value, slopes and second derivatives in the middle, the rest by the third derivatives
    f = o[0, 2] - a * o[0, 0] - b * o[0, 1]
    fs, ft = o[1, 2] - a * o[1, 0] - b * o[1, 1], o[2, 2] - a * o[2, 0] - b * o[2, 1]
    fss = o[3, 2] - a * o[3, 0] - b * o[3, 1]
    fst = o[4, 2] - a * o[4, 0] - b * o[4, 1]
    ftt = o[5, 2] - a * o[5, 0] - b * o[5, 1]
    g2 = a * a + b * b
    rise = abs(fs) + abs(ft) + 0.5 * max(fss, 0.0) + abs(fst) + 0.5 * max(ftt, 0.0) + cubic * math.sqrt(1.0 + g2)
    plane[0, 0], plane[0, 1] = o[0, 0] - ex - 1e-9, o[0, 0] + ex + 1e-9
    plane[0, 2], plane[0, 3] = o[0, 1] - ey - 1e-9, o[0, 1] + ey + 1e-9
    plane[0, 4] = o[0, 2] + abs(o[1, 2]) + abs(o[2, 2]) + 0.5 * max(o[3, 2], 0.0) + abs(o[4, 2]) \
        + 0.5 * max(o[5, 2], 0.0) + cubic + 1e-9
    plane[0, 5], plane[0, 6], plane[0, 7] = a, b, f + rise + 1e-9
    s = 1.0 / math.sqrt(1.0 + g2)
    plane[0, 8], plane[0, 9] = a * s, b * s
    g = math.sqrt(g2)
    plane[0, 10], plane[0, 11] = (a / g, b / g) if g > 1e-12 else (0.0, 0.0)
