"""What clamp.step of clamp.toml holds: a clamp bar with a slot, a step and chamfers."""

import cadquery as cq


def solid():
    bar = cq.Workplane("XY").box(60, 20, 10, centered=False).faces(">Z").edges("|Y").chamfer(1.0)
    bar = bar.cut(cq.Workplane("XY", origin=(48, -1, 7)).box(20, 30, 10, centered=False))
    return bar.cut(cq.Workplane("XY", origin=(24, 10, -1)).slot2D(28, 9).extrude(20)).val()
