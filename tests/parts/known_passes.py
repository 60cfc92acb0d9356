"""Templated passes over arches, small enough to be looked at, and the machines that they are posted for."""

from pathlib import Path

import numpy as np
from known_tools import tool

import cuspline.posts
from cuspline.program.pass_templates import (
    Call,
    Go,
    Let,
    Named,
    PassTemplate,
    Quantity,
    Register,
    Restart,
    Root,
    TemplatedPasses,
    terms,
)
from cuspline.program.program import Kind, Operation, Plane, Program
from cuspline.shop.machines import machine_from_toml

MILL = machine_from_toml(Path(cuspline.posts.__file__).parent / "machines" / "mill_3axis.toml")
BALL, OTHER = tool("ball", 6, number=7), tool("ball", 8, number=3)
CLEARANCE_MM = 40.0
ZERO = {"G54": (0, 0, 0), "G55": (-300.0, -200.0, -400.0)}
LENGTHS = {3: 100.0, 7: 120.0}
PER_RESTART = 4


def arch():
    """Over an arc of radius r + sqrt(y² + (z-c)²) about (mid, c), from one side to the other; x counts on."""
    y, z, c, r, mid, x, step, clear, feed, ny, nz, ty, tz = terms("y z c r mid x step clear feed ny nz ty tz")
    return PassTemplate(
        name="arch", arguments=(Quantity("y"), Quantity("z", axis=2), Quantity("c", axis=2, meaning="arc centre")),
        body=(Let("radius", Root(y * y + (z - c) * (z - c))), Let("ny", y / Named("radius")),
              Let("nz", (z - c) / Named("radius")), Let("ty", y + r * ny), Let("tz", z + r * nz),
              Go(Kind.RAPID, z=clear), Go(Kind.RAPID, x=x, y=mid - ty), Go(Kind.FEED, z=tz, feed=feed),
              Go(Kind.ARC_CW, y=mid + ty, z=tz, center=(mid, c), plane=Plane.YZ, feed=feed),
              Go(Kind.RAPID, z=clear), Let("x", x + step)))


def passes(count=12, radius=3.0, start=(0.0, -20.0, CLEARANCE_MM), feed=600.0):
    rng = np.random.default_rng(5)
    registers = (Register(Quantity("r", meaning="tool radius register"), radius),
                 Register(Quantity("mid", axis=1), 1.25), Register(Quantity("x", axis=0), 0.0),
                 Register(Quantity("step"), 0.35), Register(Quantity("clear", axis=2), CLEARANCE_MM),
                 Register(Quantity("feed", "mm/min"), feed))
    items = []
    for k in range(count):
        if k % PER_RESTART == 0:
            items.append(Restart(k // PER_RESTART + 1, (("x", 2.0 + 0.35 * k),)))
        c, turn, big = 10 + rng.uniform(-1, 1), rng.uniform(0, 0.3), rng.uniform(3, 5)
        items.append(Call("arch", (big * np.cos(turn), c + big * np.sin(turn), c)))
    return TemplatedPasses(start_mm=start, registers=registers, templates=(arch(),), items=tuple(items))


def program(*operations):
    operations = operations or (("rough", OTHER, passes(radius=4.254)), ("finish", BALL, passes(feed=450.5)))
    return Program(name="arches", setup="setup-2", wcs="G55", wcs_in_words="corner", clearance_z_mm=CLEARANCE_MM,
                   header=("ARCHES",), operations=tuple(
                       Operation(name=n, tool=t, spindle_rpm=8000.0, coolant="flood", moves=p.moves(), passes=p)
                       for n, t, p in operations))


def machine(post="linuxcnc", units="mm", **control):
    control = {"post": post, "units": units, **control}
    return MILL.model_copy(update={"control": MILL.control.model_copy(update=control)})
