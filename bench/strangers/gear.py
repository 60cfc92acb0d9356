"""What gear.step of gear.toml holds: a plate with ten teeth of module 5, their gaps too narrow for the library's flat cutters."""

import math

import cadquery as cq

MODULE, TEETH, PRESSURE = 5.0, 10, math.radians(20)
PITCH = MODULE * TEETH / 2
TIP, ROOT, BASE = PITCH + MODULE, PITCH - 1.25 * MODULE, PITCH * math.cos(PRESSURE)
HALF = math.pi / 2 / TEETH + math.tan(PRESSURE) - PRESSURE        # half of a tooth at the base circle
POINTS = 9                  # of a flank


def at(radius, angle):
    return radius * math.cos(angle), radius * math.sin(angle)


def flank():
    """(radius, angle from the tooth's middle) from the base circle out."""
    for k in range(POINTS):
        radius = BASE + (TIP - BASE) * k / (POINTS - 1)
        turn = math.acos(min(1.0, BASE / radius))
        yield radius, HALF - math.tan(turn) + turn


def solid():
    pitch, flanks = 2 * math.pi / TEETH, list(flank())
    outline = cq.Workplane().moveTo(*at(ROOT, -HALF))
    for k in range(TEETH):
        left, right = ([at(r, k * pitch + side * a) for r, a in flanks] for side in (-1, 1))
        right.reverse()
        outline = outline.lineTo(*left[0]).spline(left[1:], includeCurrent=True).lineTo(*right[0])
        outline = outline.spline(right[1:], includeCurrent=True).lineTo(*at(ROOT, k * pitch + HALF))
        outline = outline.threePointArc(at(ROOT, (k + 0.5) * pitch), at(ROOT, (k + 1) * pitch - HALF))
    return outline.close().extrude(8).faces(">Z").workplane().hole(12).val()
