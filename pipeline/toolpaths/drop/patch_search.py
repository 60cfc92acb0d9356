"""Branch and bound over the tree of sub-patches: the highest tip that any contact asks for, none missed.

A leaf is settled when its bound is met, when no normal on it can meet the cutter there, when it is a plane
(closed form), or when it provably holds at most one contact and the local search has found it; else it is halved.
Contacts outside a face's trim are none: there the face's edges rule, and they are leaves of their own.
"""

import math

from cuspline.surfaces.patches import (
    DEGREE_U,
    DEGREE_V,
    DS,
    DSS,
    DST,
    DT,
    DTT,
    IS_RATIONAL,
    OF_FACE,
    OFFSET,
    POINT,
    U_HIGH,
    U_LOW,
    V_HIGH,
    V_LOW,
    derive,
    scale_derivatives,
)
from cuspline.surfaces.trims import is_inside
from cuspline.toolpaths.contact.contact_maps import HAIR, map_proof, map_step
from cuspline.toolpaths.contact.leaf_rows import (
    AT_S,
    AT_T,
    CERTAINTY,
    HALF_S,
    HALF_T,
    KIND,
    MIDDLE_S,
    MIDDLE_T,
    NORMALS,
    PATCH,
    REACH_S,
    REACH_SS,
    REACH_SSS,
    REACH_SST,
    REACH_ST,
    REACH_STT,
    REACH_T,
    REACH_TT,
    REACH_TTT,
    SHAPE,
    STATE,
    TOP_NZ,
)
from cuspline.toolpaths.contact.rim_contacts import climb_flat, flat_proof
from cuspline.toolpaths.drop.drop_kernels import LEAN_X, LEAN_Y, PLANE_A, PLANE_B, PLANE_C, TOP, UPHILL_X, UPHILL_Y
from cuspline.toolpaths.drop.patch_bounds import (
    BORDER,
    EDGE,
    FACE,
    HX_HIGH,
    HX_LOW,
    HY_HIGH,
    HY_LOW,
    NX_HIGH,
    NX_LOW,
    NY_HIGH,
    NY_LOW,
    OUTSIDE,
    cone_box,
    part_state,
)
from cuspline.toolpaths.drop.patch_contacts import bottom, box_proof, climb, node_bound
from cuspline.toolpaths.drop.patch_tree import CURVED
from cuspline.toolpaths.drop.plane_contacts import plane_contact
from cuspline.values.compiled import njit
from cuspline.values.rows import X_HIGH, X_LOW, Y_HIGH, Y_LOW, X, Y, Z

STACK = 1024
ON_PATCH, ON_S, ON_T = range(3)                             # of a contact
BOUND, BOX_S, BOX_T, BOX_ALPHA, BOX_BETA = range(5)         # of a box that waits
SMALLEST_MM = 1e-6          # halvings end here: at an upright tangent the tip is that of a cutter this far aside


@njit(inline="always")
def in_trim(tree, patch, s, t):
    """Is (s, t) of a patch inside the face's trim?"""
    span = tree.span[patch]
    u = 0.5 * (span[U_LOW] + span[U_HIGH] + s * (span[U_HIGH] - span[U_LOW]))
    v = 0.5 * (span[V_LOW] + span[V_HIGH] + t * (span[V_HIGH] - span[V_LOW]))
    return is_inside(tree.trims, tree.patch[patch, OF_FACE], u, v)


@njit(error_model="numpy", inline="always")
def can_meet(normals, xl, xh, yl, yh, x, y, R, rc):
    """Can a surface within this box with these normals touch the cutter at (x, y)?  Offsets of the box must hold it."""
    c = R - rc
    return (xl + rc * normals[NX_LOW] + c * normals[HX_LOW] <= x <= xh + rc * normals[NX_HIGH] + c * normals[HX_HIGH]
            and yl + rc * normals[NY_LOW] + c * normals[HY_LOW] <= y <= yh + rc * normals[NY_HIGH] + c * normals[HY_HIGH])


@njit(error_model="numpy")
def drop_one(tree, x, y, R, rc, tolerance, best, hint, scratch, contact):
    """Highest tip over (x, y).

    Args:
        tree: leaf_rows.PartArrays.
        best: tip to begin with: only what asks for more than that plus the tolerance is looked for.
        hint: (4,) patch (< 0: none), s, t of a likely contact.
        scratch: (box stack (STACK, 5), leaf stack (STACK,), o (6, 3), w (4,), normals (8,), a plane (1, 12)).
        contact: (3,) patch, s, t of the contact, filled; patch -1 where none asked for more than `best`.
    Returns:
        the tip.
    """
    coefficients, patches, rows = tree.coefficients, tree.patch, tree.rows
    tags, nodes, first = tree.tags, tree.nodes, tree.first
    boxes, ids, o, w, normals, plane = scratch
    contact[ON_PATCH] = -1.0
    is_maximum = False
    if hint[ON_PATCH] >= 0.0:
        p = int(hint[ON_PATCH])
        if rc > 0.0:
            tip = climb(coefficients, patches[p], hint[ON_S], hint[ON_T], -1.0, 1.0, -1.0, 1.0, x, y, R, rc, best, o, w)
        else:
            tip = climb_flat(coefficients, patches[p], hint[ON_S], hint[ON_T], -1.0, 1.0, -1.0, 1.0, x, y, R, o, w)
        if tip > best and (tree.kind[p] == EDGE or in_trim(tree, p, w[AT_S], w[AT_T])):
            best = tip
            contact[ON_PATCH], contact[ON_S], contact[ON_T] = p, w[AT_S], w[AT_T]
            is_maximum = w[CERTAINTY] > 1.0
    ids[0], boxes[0, BOUND] = 0, node_bound(nodes, 0, x, y, R, rc)
    top = 1
    while top > 0:
        top -= 1
        bound = boxes[top, BOUND]
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
                ids[top], boxes[top, BOUND] = a, ba
                top += 1
            if bb > best + tolerance:
                ids[top], boxes[top, BOUND] = b, bb
                top += 1
            continue
        whole = k >= 0
        leaf = -1 - first[k] if whole else -1 - k
        row, tag = rows[leaf], tags[leaf]
        patch = tag[PATCH]
        kind, state = tag[KIND], tag[STATE]
        si, ti, alpha, beta = 0.0, 0.0, 1.0, 1.0
        if whole:
            if kind == FACE:
                if not can_meet(row[NORMALS:TOP_NZ], nodes[k, X_LOW], nodes[k, X_HIGH], nodes[k, Y_LOW],
                                nodes[k, Y_HIGH], x, y, R, rc):
                    continue
                if tag[SHAPE] != CURVED:
                    tip = plane_contact(tree, leaf, x, y, R, rc, o, w)
                    if tip > best and (state != BORDER or in_trim(tree, patch, w[AT_S], w[AT_T])):
                        best = tip
                        contact[ON_PATCH], contact[ON_S], contact[ON_T] = patch, w[AT_S], w[AT_T]
                        is_maximum = False
                    continue
        else:
            si, ti, alpha, beta = boxes[top, BOX_S], boxes[top, BOX_T], boxes[top, BOX_ALPHA], boxes[top, BOX_BETA]
        s, t, hs, ht = (row[MIDDLE_S] + row[HALF_S] * si, row[MIDDLE_T] + row[HALF_T] * ti, row[HALF_S] * alpha,
                        row[HALF_T] * beta)
        if kind == FACE and state == BORDER and not whole:
            if part_state(tree.trims, patches[patch, OF_FACE], tree.span[patch], s, hs, t, ht) == OUTSIDE:
                continue
        prow = patches[patch]
        derive(coefficients, prow[OFFSET], prow[DEGREE_U], prow[DEGREE_V], prow[IS_RATIONAL] != 0, s, t, o)
        scale_derivatives(o, hs, ht)
        nx = ny = nz = n = sign = 0.0
        sine = 2.0
        bend = 0.5 * (row[REACH_SS] * alpha * alpha + 2.0 * row[REACH_ST] * alpha * beta + row[REACH_TT] * beta * beta)
        if kind == FACE:
            sign = tree.sign[patch]
            nx, ny, nz, n, sine = box_normal(row, o, alpha, beta, sign)
        if not whole:
            ex = abs(o[DS, X]) + abs(o[DT, X]) + bend
            ey = abs(o[DS, Y]) + abs(o[DT, Y]) + bend
            if kind == FACE and sine < 1.0:
                cone_box(nx, ny, nz, sine, 1.0, normals)
                if nz + sine <= 0.0:
                    continue
                if not can_meet(normals, o[POINT, X] - ex, o[POINT, X] + ex, o[POINT, Y] - ey, o[POINT, Y] + ey, x, y,
                                R, rc):
                    continue
            fill_plane(o, row, alpha, beta, nx, ny, nz if sine < 1.0 else 0.0, kind, ex, ey, bend, plane)
            dx, dy = o[POINT, X] - x, o[POINT, Y] - y
            near = math.sqrt(dx * dx + dy * dy)
            if near > 0.0:                      # no nearer to the axis than this, seen from the middle
                near -= (abs(dx * o[DS, X] + dy * o[DS, Y]) + abs(dx * o[DT, X] + dy * o[DT, Y])) / near + bend + 1e-9
            if near > R:
                continue
            bound = min(bound, node_bound(plane, 0, x, y, R, rc), plane[0, TOP] - bottom(max(near, 0.0), R, rc))
            if bound <= best + tolerance:
                continue
        proof, middle_z = 0, o[POINT, Z]
        w[AT_S] = w[AT_T] = 0.0
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
        known = (is_maximum and contact[ON_PATCH] == patch and abs(contact[ON_S] - s) <= hs * 1.000001
                 and abs(contact[ON_T] - t) <= ht * 1.000001)
        if proof == 1 and known:
            continue
        if by_map and not map_step(coefficients, prow, s, t, hs, ht, sign, x, y, R, rc, o, w):
            continue
        settled = False
        if proof == 1 or (whole and not known):
            hair = HAIR if by_map else 0.0
            sl, sh = max(s - hs * (1.0 + hair), -1.0), min(s + hs * (1.0 + hair), 1.0)
            tl, th = max(t - ht * (1.0 + hair), -1.0), min(t + ht * (1.0 + hair), 1.0)
            fs, ft = min(max(s + hs * w[AT_S], sl), sh), min(max(t + ht * w[AT_T], tl), th)
            if rc > 0.0:
                tip = climb(coefficients, prow, fs, ft, sl, sh, tl, th, x, y, R, rc, min(bound, middle_z), o, w)
            else:
                tip = climb_flat(coefficients, prow, fs, ft, sl, sh, tl, th, x, y, R, o, w)
            settled = proof == 1 and (w[CERTAINTY] > 1.0 or (w[CERTAINTY] > 0.0 and not by_map))
            if tip > best and (kind == EDGE or state != BORDER or in_trim(tree, patch, w[AT_S], w[AT_T])):
                best = tip
                contact[ON_PATCH], contact[ON_S], contact[ON_T] = patch, w[AT_S], w[AT_T]
                is_maximum = w[CERTAINTY] > 1.0
        else:
            d = math.sqrt((o[POINT, X] - x) ** 2 + (o[POINT, Y] - y) ** 2)
            if d <= R:
                tip = o[POINT, Z] - bottom(d, R, rc)
                if tip > best and (kind == EDGE or state != BORDER or in_trim(tree, patch, s, t)):
                    best = tip
                    contact[ON_PATCH], contact[ON_S], contact[ON_T] = patch, s, t
                    is_maximum = False
        if (settled or bound <= best + tolerance or row[REACH_S] * alpha + row[REACH_T] * beta < SMALLEST_MM
                or top + 2 > STACK):
            continue
        split_t = kind == FACE and row[REACH_T] * beta > row[REACH_S] * alpha
        for side in (-1.0, 1.0):
            ids[top] = -1 - leaf
            boxes[top, BOUND] = bound
            boxes[top, BOX_S], boxes[top, BOX_T], boxes[top, BOX_ALPHA], boxes[top, BOX_BETA] = si, ti, alpha, beta
            if split_t:
                boxes[top, BOX_T], boxes[top, BOX_BETA] = ti + side * 0.5 * beta, 0.5 * beta
            else:
                boxes[top, BOX_S], boxes[top, BOX_ALPHA] = si + side * 0.5 * alpha, 0.5 * alpha
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
    nx = sign * (o[DS, Y] * o[DT, Z] - o[DS, Z] * o[DT, Y])
    ny = sign * (o[DS, Z] * o[DT, X] - o[DS, X] * o[DT, Z])
    nz = sign * (o[DS, X] * o[DT, Y] - o[DS, Y] * o[DT, X])
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not n > 0.0:
        return nx, ny, nz, n, 2.0
    turn = ((row[REACH_SS] * row[REACH_T] + row[REACH_S] * row[REACH_ST]) * alpha
            + (row[REACH_ST] * row[REACH_T] + row[REACH_S] * row[REACH_TT]) * beta)
    return nx / n, ny / n, nz / n, n, turn * alpha * beta / n


@njit(error_model="numpy")
def fill_plane(o, row, alpha, beta, nx, ny, nz, kind, ex, ey, bend, plane):
    """Upper plane of a box from the derivatives in its middle, as a tree node (see patch_tree)."""
    a = b = 0.0
    cubic = (row[REACH_SSS] * alpha ** 3 + 3.0 * row[REACH_SST] * alpha * alpha * beta
             + 3.0 * row[REACH_STT] * alpha * beta * beta + row[REACH_TTT] * beta ** 3) / 6.0
    if kind == EDGE:
        h2 = o[DS, X] * o[DS, X] + o[DS, Y] * o[DS, Y]
        if h2 > 0.04 * o[DS, Z] * o[DS, Z]:
            a, b = o[DS, X] * o[DS, Z] / h2, o[DS, Y] * o[DS, Z] / h2
    elif nz > 0.05:
        a, b = -nx / nz, -ny / nz
    # z - a x - b y: value, slopes and second derivatives in the middle, the rest by the third derivatives
    f = o[POINT, Z] - a * o[POINT, X] - b * o[POINT, Y]
    fs, ft = o[DS, Z] - a * o[DS, X] - b * o[DS, Y], o[DT, Z] - a * o[DT, X] - b * o[DT, Y]
    fss = o[DSS, Z] - a * o[DSS, X] - b * o[DSS, Y]
    fst = o[DST, Z] - a * o[DST, X] - b * o[DST, Y]
    ftt = o[DTT, Z] - a * o[DTT, X] - b * o[DTT, Y]
    g2 = a * a + b * b
    rise = abs(fs) + abs(ft) + 0.5 * max(fss, 0.0) + abs(fst) + 0.5 * max(ftt, 0.0) + cubic * math.sqrt(1.0 + g2)
    plane[0, X_LOW], plane[0, X_HIGH] = o[POINT, X] - ex - 1e-9, o[POINT, X] + ex + 1e-9
    plane[0, Y_LOW], plane[0, Y_HIGH] = o[POINT, Y] - ey - 1e-9, o[POINT, Y] + ey + 1e-9
    plane[0, TOP] = o[POINT, Z] + abs(o[DS, Z]) + abs(o[DT, Z]) + 0.5 * max(o[DSS, Z], 0.0) + abs(o[DST, Z]) \
        + 0.5 * max(o[DTT, Z], 0.0) + cubic + 1e-9
    plane[0, PLANE_A], plane[0, PLANE_B], plane[0, PLANE_C] = a, b, f + rise + 1e-9
    s = 1.0 / math.sqrt(1.0 + g2)
    plane[0, LEAN_X], plane[0, LEAN_Y] = a * s, b * s
    g = math.sqrt(g2)
    plane[0, UPHILL_X], plane[0, UPHILL_Y] = (a / g, b / g) if g > 1e-12 else (0.0, 0.0)
