"""Depth of cut at which a tool begins to chatter, and cuts that are deeper (docs/formulas.md 12)."""

import numpy as np

from cuspline.values import fixed_math as fixed

FREQUENCIES = 4000        # looked at, from half the lowest mode to twice the highest
LOBES = 30                # whole waves between two teeth that are looked at
SPEEDS = 800              # spindle speeds that are looked at
CLOSE = 1.05              # speeds nearer to each other than that count as one


def limit_depth_mm(least_real_mm_per_n, force_n_per_mm2, direction, teeth_in_cut):
    """b_lim: the depth of cut up to which every spindle speed is stable.

    Args:
        least_real_mm_per_n: min Re G of the tool in its holder and spindle, < 0.
        direction: mu, cosine between the cutting force and the surface's normal.
        teeth_in_cut: n_a, mean number; a groove has half of the teeth.

    >>> round(limit_depth_mm(-9.127e-5, 4000, 0.342, 0.5), 3), round(limit_depth_mm(-9.037e-3, 4000, 0.342, 1.0), 5)
    (8.009, 0.04044)
    """
    return -1.0 / (2 * teeth_in_cut * force_n_per_mm2 * direction * least_real_mm_per_n)


def least_real_mm_per_n(modes):
    """min Re G of modes [(frequency_hz, stiffness_n_per_mm, damping ratio), ...] added up.

    >>> abs(least_real_mm_per_n([(800.0, 2e4, 0.03)]) / (-1 / (4 * 2e4 * 0.03 * 1.03)) - 1) < 1e-3
    True
    """
    first, last = min(m[0] for m in modes), max(m[0] for m in modes)
    frequency = np.linspace(first / 2, 2 * last, FREQUENCIES)
    near = [f * (1 + np.linspace(0, 4 * z, 200)) for f, _, z in modes]
    ratio = np.sort(np.concatenate([frequency, *near]))
    total = np.zeros(len(ratio))
    for own, stiffness, damping in modes:
        r = ratio / own
        free = 1 - r * r
        total += free / (free * free + 4 * damping * damping * r * r) / stiffness
    return float(total.min())


def limits_mm(tools, material):
    """{tool number: b_lim} of the tools whose dynamics are stated; in a groove, which is the worst.

    Args:
        tools: {number: cutters.Tool}.   material: shop.cutting_forces.CuttingForce, or None: no limit is known.
    """
    if material is None:
        return {}
    direction = float(fixed.cos(np.radians(material.force_angle_deg)))
    least = {n: t.chatter.least_real_mm_per_n if t.chatter.modes is None else least_real_mm_per_n(t.chatter.modes)
             for n, t in tools.items() if t.chatter is not None}
    return {n: limit_depth_mm(value, material.force_n_per_mm2, direction, tools[n].cutter.flutes / 2)
            for n, value in least.items()}


def stability_lobes(modes, teeth, b_of_real):
    """(LOBES, n, 2) spindle speed, rpm, and depth at which chatter begins, along each lobe; NaN where there is none.

    Args:
        modes: [(frequency_hz, stiffness_n_per_mm, damping ratio), ...].   teeth: of the cutter.
        b_of_real: function of Re G (n,), mm/N, < 0, to depths (n,).
    Source: docs/formulas.md 12: teeth leave waves that the next ones meet k waves and a phase later.
    """
    first, last = min(m[0] for m in modes), max(m[0] for m in modes)
    frequency = np.sort(np.concatenate([np.linspace(first / 2, 2 * last, 400),
                                        *(f * (1 + np.linspace(0, 6 * z, 200)) for f, _, z in modes)]))
    real, imaginary = np.zeros(len(frequency)), np.zeros(len(frequency))
    for own, stiffness, damping in modes:
        r = frequency / own
        free, damped = 1 - r * r, 2 * damping * r
        real += free / (free * free + damped * damped) / stiffness
        imaginary -= damped / (free * free + damped * damped) / stiffness
    unstable = real < 0
    phase = 1.0 - fixed.arctan2(-real, -imaginary) / np.pi                  # of a wave
    rpm = 60 * frequency / (teeth * (np.arange(LOBES)[:, None] + phase))
    depth = np.where(unstable, b_of_real(np.where(unstable, real, -1.0)), np.nan)
    return np.stack([rpm, np.broadcast_to(depth, rpm.shape)], axis=-1)


def depths_at(lobes, rpm):
    """(n,) depth at which chatter begins at spindle speeds (n,): the lowest lobe; inf beyond all of them."""
    out = np.full(len(rpm), np.inf)
    for lobe in lobes:
        known = np.flatnonzero(np.isfinite(lobe[:-1, 1]) & np.isfinite(lobe[1:, 1]))
        for a, b in zip(lobe[known], lobe[known + 1]):
            low, high = min(a[0], b[0]), max(a[0], b[0])
            first, last = np.searchsorted(rpm, [low, high])
            if last > first:
                share = (rpm[first:last] - a[0]) / (b[0] - a[0])
                out[first:last] = np.minimum(out[first:last], a[1] + share * (b[1] - a[1]))
    return out


def best_speeds(tool, material, spindle, count=5):
    """[(rpm, depth)] at which a tool cuts deepest in a groove, within what spindle and cutter turn, best first.

    Args:
        tool: cutters.Tool with modes.   material: shop.cutting_forces.CuttingForce.   spindle: machines.Spindle.
    """
    direction, teeth = float(fixed.cos(np.radians(material.force_angle_deg))), tool.cutter.flutes
    lobes = stability_lobes(tool.chatter.modes, teeth,
                            lambda real: limit_depth_mm(real, material.force_n_per_mm2, direction, teeth / 2))
    rpm = np.linspace(spindle.min_rpm, min(spindle.max_rpm, tool.cutter.max_rpm or np.inf), SPEEDS)
    depth, found = depths_at(lobes, rpm), []
    for k in np.argsort(-np.where(np.isfinite(depth), depth, -1.0), kind="stable").tolist():
        if np.isfinite(depth[k]) and all(max(rpm[k], n) > CLOSE * min(rpm[k], n) for n, _ in found):
            found.append((float(rpm[k]), float(depth[k])))
        if len(found) == count:
            break
    return found
