"""Transverse arcs as pass templates: clockwise and counter-clockwise, general and matching section, rough and finish.

The main program is then data and calls: three numbers a step (Y, Z, C; in the matching section swell and lift too), the
plane's x counts on by itself, and a restart point says it anew every so many steps.

Rough passes cut both ways, from foot to foot.  Finish passes run clockwise seen from +x only, so that with the
uncut side toward +x a spindle that turns right cuts climb; then up, rapid back, down beside the body.
"""

from dataclasses import dataclass

import numpy as np

from cuspline.program.pass_templates import (
    Call,
    Go,
    Let,
    PassTemplate,
    Quantity,
    Register,
    Restart,
    Root,
    TemplatedPasses,
    terms,
)
from cuspline.program.program import Kind, Plane
from cuspline.values import fixed_math as fixed

OVERRUN_MM = 0.1            # passes run so far beyond the body's side
BESIDE_MM = 2.0             # between ball and body while the tool goes down
SECTION = (Quantity("y", meaning="Y of the tangency"), Quantity("z", axis=2, meaning="Z of the tangency"),
           Quantity("c", axis=2, meaning="Z of the arc's centre"))
STEEP = (Quantity("swell", "", meaning="share of the tool offset in the radius"),
         Quantity("lift", "", meaning="share of the tool offset in the centre's height"))
y, z, c, swell, lift, r, ball, half, mid, x, step, clear, beside, feed, slow = terms(
    "y z c swell lift r ball half mid x step clear beside feed slow")
ny, nz, g, h, ty, tz, fy, fz = terms("ny nz g h ty tz fy fz")


def _section(is_matching):
    """Lets of one section's centre path: g, h radius and centre, (ty, tz) tangency, (fy, fz) foot; all for the tip."""
    (radius,) = terms("radius")
    center = [Let("g", radius + r * swell), Let("h", c + r * lift - ball)] if is_matching else \
        [Let("g", radius + r), Let("h", c - ball)]
    return (Let("radius", Root(y * y + (z - c) * (z - c))), *center, Let("ty", g * ny), Let("tz", h + g * nz),
            Let("fy", half + r * ny), Let("fz", tz - (fy - ty) * ny / nz))


def _stroke(side, feed_to_foot):
    """Foot, flank, arc, flank, foot: side 1 clockwise from -y to +y, -1 the other way."""
    here, there = (lambda t: mid - t, lambda t: mid + t) if side > 0 else (lambda t: mid + t, lambda t: mid - t)
    arc = Kind.ARC_CW if side > 0 else Kind.ARC_CCW
    return (Go(Kind.FEED, x=x, y=here(fy), z=fz, feed=feed_to_foot), Go(Kind.FEED, y=here(ty), z=tz, feed=feed),
            Go(arc, y=there(ty), z=tz, center=(mid, h), plane=Plane.YZ, feed=feed),
            Go(Kind.FEED, y=there(fy), z=fz, feed=feed), Let("x", x + step))


def stroke_ends(steps, rows, radius_mm, flank_rad, half_width_mm):
    """(k, 4) Y and (k, 4) Z of the ball's centre at foot, tangency, tangency, foot of some strokes.

    Args:
        steps: ArcSteps.   rows: (k,) of them.
        radius_mm: tool radius register.   flank_rad: of the flanks from the vertical.   half_width_mm: of the body.
    """
    ny, nz = fixed.cos(flank_rad), fixed.sin(flank_rad)
    radius = np.sqrt(steps.y_mm[rows] ** 2 + (steps.z_mm[rows] - steps.c_mm[rows]) ** 2)
    path_radius = radius + radius_mm * steps.swell[rows]
    center_z = steps.c_mm[rows] + radius_mm * steps.lift[rows]
    at_y, at_z = path_radius * ny, center_z + path_radius * nz
    foot_y = np.full(len(at_y), half_width_mm + OVERRUN_MM + radius_mm * ny)
    foot_z = at_z - (foot_y - at_y) * ny / nz
    return np.stack([-foot_y, -at_y, at_y, foot_y], axis=1), np.stack([foot_z, at_z, at_z, foot_z], axis=1)


UP = Go(Kind.RAPID, z=clear)
DOWN = (UP, Go(Kind.RAPID, x=x, y=mid - beside), Go(Kind.RAPID, z=fz))


def _template(name, is_matching, body):
    return PassTemplate(name=f"{name}, {'matching' if is_matching else 'general'} section",
                        arguments=SECTION + STEEP if is_matching else SECTION, body=(*_section(is_matching), *body))


ENTER = {m: _template("enter", m, DOWN) for m in (False, True)}
ROUGH = {(m, side): _template(f"rough {word}", m, _stroke(side, slow)) for m in (False, True)
         for side, word in ((1, "clockwise"), (-1, "counter-clockwise"))}
FINISH = {m: _template("finish clockwise", m, (*DOWN, *_stroke(1, slow))) for m in (False, True)}
LEAVE = PassTemplate("leave", (), (UP,))


@dataclass(frozen=True, kw_only=True)
class RegisterValues:
    """What the registers of an operation are set to before its first pass."""

    flank_rad: float            # of the flanks from the vertical; not reckoned from Y, Z, C, whose rounding would turn the flanks
    tool_radius_mm: float       # true radius, and the allowance more or the plating less
    ball_radius_mm: float       # of the tool: how far the tip lies below its centre
    half_width_mm: float        # of the body
    clearance_z_mm: float       # of rapids across
    feed_mm_per_min: float      # along the passes
    slow_mm_per_min: float      # into the cut and from pass to pass

    @property
    def beside_mm(self):
        """From the mid-plane to where the tool goes down."""
        return self.half_width_mm + max(self.tool_radius_mm, self.ball_radius_mm) + BESIDE_MM


def templated_passes(stretches, steps, values, *, restart_steps, is_rough):
    """All passes of one operation.

    Args:
        stretches: Stretch values.   steps: ArcSteps of their planes, in the same order.
        values: RegisterValues.
        restart_steps: a restart point at least every so many steps.
        is_rough: both ways; False: clockwise only.
    Returns:
        TemplatedPasses in the tip's frame.
    """
    items, used, row, number = [], {}, 0, 0
    for stretch in stretches:
        for k in range(len(stretch.planes)):
            if k % restart_steps == 0:
                number += 1
                items.append(Restart(number, (("x", stretch.planes[k]), ("step", stretch.interval_mm))))
                if is_rough:
                    _call(items, used, ENTER[bool(steps.is_matching[row])], steps, row)
            is_steep = bool(steps.is_matching[row])
            side = 1 if k % restart_steps % 2 == 0 else -1
            _call(items, used, ROUGH[is_steep, side] if is_rough else FINISH[is_steep], steps, row)
            row += 1
    items.append(Call(LEAVE.name, ()))
    registers = (
        Register(Quantity("r", meaning="tool radius offset"), values.tool_radius_mm),
        Register(Quantity("ball", meaning="tip below the ball's centre"), values.ball_radius_mm),
        Register(Quantity("ny", "", meaning="flank's normal, across"), fixed.cos(values.flank_rad)),
        Register(Quantity("nz", "", meaning="flank's normal, up"), fixed.sin(values.flank_rad)),
        Register(Quantity("half", meaning="half width of the body"), values.half_width_mm + OVERRUN_MM),
        Register(Quantity("mid", axis=1, meaning="mid-plane"), 0.0),
        Register(Quantity("x", axis=0, meaning="plane, counts on"), stretches[0].first_mm),
        Register(Quantity("step", meaning="interval of the planes"), stretches[0].interval_mm),
        Register(Quantity("clear", axis=2, meaning="clearance height"), values.clearance_z_mm),
        Register(Quantity("beside", meaning="way down beside the body"), values.beside_mm),
        Register(Quantity("feed", "mm/min", meaning="feed of the passes"), values.feed_mm_per_min),
        Register(Quantity("slow", "mm/min", meaning="feed into the cut"), values.slow_mm_per_min))
    return TemplatedPasses(start_mm=(stretches[0].first_mm, -values.beside_mm, values.clearance_z_mm),
                           registers=registers, templates=(*used.values(), LEAVE), items=tuple(items))


def _call(items, used, template, steps, row):
    used[template.name] = template
    section = (steps.y_mm[row], steps.z_mm[row], steps.c_mm[row])
    steep = (steps.swell[row], steps.lift[row]) if len(template.arguments) > len(SECTION) else ()
    items.append(Call(template.name, tuple(float(v) for v in (*section, *steep))))
