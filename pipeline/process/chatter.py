"""Depth of cut at which a tool begins to chatter, and cuts that are deeper (docs/formulas.md 12)."""

import numpy as np

from cuspline.values import fixed_math as fixed

FREQUENCIES = 4000        # looked at, from half the lowest mode to twice the highest


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
