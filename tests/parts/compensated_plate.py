"""A contour that the control runs beside: sharp, obtuse and rounded corners, an inner corner and an inner arc, no CAD."""

import importlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from known_tools import tool
from positioned_mills import leaning_frame

import cuspline.posts
from cuspline.program.arcs import straightened
from cuspline.program.program import MoveWriter, Operation, Program
from cuspline.shop.machines import machine_from_toml
from cuspline.toolpaths.prismatic.compensated_path import compensated_contour, is_move, with_straight_ways
from cuspline.toolpaths.prismatic.contour_moves import arc_leads, follow
from cuspline.toolpaths.prismatic.plan_elements import PlanChain, PlanElement, offset_chain

FILES = {"linuxcnc": "mill_3axis", "fanuc": "mill_fanuc", "haas": "mill_haas", "siemens": "mill_siemens",
         "heidenhain": "mill_heidenhain", "grbl": "mill_grbl", "pmac": "mill_pmac"}
MACHINES = {post: machine_from_toml(Path(cuspline.posts.__file__).parent / "machines" / f"{name}.toml")
            for post, name in FILES.items()}
RADIUS, LEVEL, WORN = 5.0, 20.0, 0.1
TOOL, OTHER = tool("flat", 2 * RADIUS, number=3), tool("flat", 8.0, number=4)
PLACES = [(0, 0), (0, 40), (20, 40), (26, 36), (60, 36), (60, 20), (78, 20), (50, 0)]       # outline, clockwise; material inside
ROUNDED = {5: 8.0}          # the inner corner at (60, 20) is rounded; (26, 36) is an inner corner of little turn, and sharp


def wall():
    """PlanChain of the outline, the air on its left."""
    p, out, n = [np.array(q, float) for q in PLACES], [], len(PLACES)
    begin = lambda k, to: p[k] + (p[to] - p[k]) / np.hypot(*(p[to] - p[k])) * ROUNDED.get(k, 0.0)
    for k in range(n):
        after, ahead = (k + 1) % n, (k + 2) % n
        out.append(PlanElement(start=begin(k, after), end=begin(after, k)))
        if after in ROUNDED:
            center = p[after] + ROUNDED[after] * np.array([1.0, 1.0])
            out.append(PlanElement(start=begin(after, k), end=begin(after, ahead), center=center, is_left=True))
    return PlanChain(elements=tuple(out), is_closed=True)


@cache
def program(height_mm=-5.0):
    """A Program with one compensated contour round the outline."""
    path = offset_chain(wall(), RADIUS)
    path = path.begun_at(path.starts_mm()[0])
    elements = path.elements
    leads = with_straight_ways(arc_leads((elements[0], 0.0), (elements[-1], elements[-1].length_mm), 4.0, 4.0), RADIUS)
    writer = MoveWriter((*leads.begin, LEVEL))
    writer.feed((*leads.begin, height_mm), 300.0)
    run = (*leads.way_in, *elements, *leads.way_out)
    follow(writer, run, height_mm, 600.0)
    writer.rapid((*writer.here_mm[:2], LEVEL))
    one = compensated_contour(run, RADIUS, height_mm, 1, WORN)
    assert one.end == 1 + sum(is_move(e) for e in run)
    operation = Operation(name="contour", tool=TOOL, spindle_rpm=3000.0, coolant="off", moves=writer.moves(), compensated=(one,))
    return Program(name="plate", setup="setup-1", wcs="G54", wcs_in_words="corner", operations=(operation,), clearance_z_mm=LEVEL,
                   header=("PLATE",))


def turned_contour():
    """Its operation along a leaning axis, as plans hand it over."""
    planned, frame = program().operations[0], leaning_frame()
    moves, first = straightened(planned.moves, 0.002)
    moves = replace(moves, start_mm=frame.out(moves.start_mm[None])[0], end_mm=frame.out(moves.end_mm),
                    axis=np.tile(frame.rotation[:, 2], (len(moves), 1)))
    one, = planned.compensated
    return replace(planned, moves=moves, level_mm=LEVEL,
                   compensated=(one.moved(frame.out).among([*first.tolist(), len(moves)]),))


def posted(post, **operation):
    """Its text; `operation`: fields of its operation that are others."""
    made = program()
    if operation:
        made = replace(made, operations=(replace(made.operations[0], **operation),))
    return importlib.import_module(f"cuspline.posts.writers.{post}").post(made, MACHINES[post]).text


def read(post, text, radius_mm=RADIUS):
    """PostedMoves, a radius in the tool's register; that of T4 is 4 mm."""
    writer = importlib.import_module(f"cuspline.posts.writers.{post}")
    reader = importlib.import_module(f"cuspline.posts.readers.{writer.READER}")
    machine = MACHINES[post]
    return reader.read_program(text, work_offsets={"G54": machine.wcs_origin_mm},
                               tool_lengths={t.number: t.length_mm for t in (TOOL, OTHER)}, tool_radii={3: radius_mm, 4: 4.0})


def away_mm(points):
    """(n,) distance to the outline, by brute force along its straight edges and its one round corner."""
    p, best = np.array(PLACES, float), np.full(len(points), np.inf)
    for k, (a, b) in enumerate(zip(p, np.roll(p, -1, axis=0))):
        d = (b - a) / np.hypot(*(b - a))
        low, high = ROUNDED.get(k, 0.0), np.hypot(*(b - a)) - ROUNDED.get((k + 1) % len(p), 0.0)
        s = np.clip((points - a) @ d, low, high)
        best = np.minimum(best, np.hypot(*(points - a - s[:, None] * d).T))
    for k, r in ROUNDED.items():
        from_middle = points - (p[k] + r)
        inside = (from_middle < 0).all(axis=1)
        best = np.where(inside, np.minimum(best, np.abs(r - np.hypot(*from_middle.T))), best)
    return best
