"""Arcs by their radius: no centre in the text, the control's own arc within the bound of the planned one, in every plane."""

import re
from dataclasses import replace

import numpy as np
import pytest
from random_programs import LENGTHS, random_program
from small_program import changed

from cuspline.app import catalogue
from cuspline.posts.writers.words import ARC_RADIUS_MISMATCH_MM
from cuspline.program.arcs import Arc
from cuspline.program.posted import PostedMoves
from cuspline.program.program import Kind, MoveWriter, Plane
from cuspline.values.errors import PostError

NAMES = ("mill_3axis", "mill_fanuc", "mill_haas", "mill_grbl", "mill_siemens", "mill_pmac")
CENTRE = re.compile(r"\b[^(;]*\s[IJK]-?[\d.]")


def by_radius(name, **more):
    return changed(catalogue.find_machine(name), arc_centres="R", sub_programs=False, **more)


def read(texts, machine):
    parts = [catalogue.reader_of(machine)(t, work_offsets={"G55": (-100.0, -150.0, -200.0)}, tool_lengths=LENGTHS) for t in texts]
    return PostedMoves.joined(parts, [t.count("\n") for t in texts])


def off_the_arc_mm(moves, row, arc):
    """How far the middle of an arc that was read is from the planned circle, in its plane."""
    middle, (a, b, _) = Arc.of_posted(moves, row).at(0.5), arc.plane.axes
    return abs(np.hypot(middle[a] - arc.center_mm[a], middle[b] - arc.center_mm[b]) - arc.radius_mm)


@pytest.mark.parametrize("name", NAMES)
def test_random_arcs_come_back_on_their_circles(name):
    machine, seen = by_radius(name), 0
    half_mm = 0.5 * machine.control.resolution_mm
    for seed in range(20):
        told = random_program(seed)
        result = catalogue.find_post(machine.control.post).post(told, machine)
        assert not any(CENTRE.search(line) for t in result.texts for line in t.splitlines()
                       if line.startswith(("G2", "G3", "X", "CIRCLE")))
        moves, at = read(result.texts, machine), 0
        rows = np.flatnonzero(moves.kind != Kind.RAPID)
        for operation in told.operations:
            o = operation.moves
            for k in np.flatnonzero(o.kind != Kind.RAPID):
                arc = None
                if o.kind[k] >= Kind.ARC_CW:
                    arc = Arc(o.starts_mm[k], o.end_mm[k], o.center_mm[k], Plane(o.plane[k]), o.kind[k])
                while True:
                    row, at = rows[at], at + 1
                    if arc is not None and moves.kind[row] > Kind.FEED:
                        assert off_the_arc_mm(moves, row, arc) <= ARC_RADIUS_MISMATCH_MM + 4 * half_mm
                        seen += 1
                    if np.abs(moves.end_mm[row] - o.end_mm[k]).max() <= 2 * half_mm:
                        break
        assert at == len(rows)
    assert seen > 100


def test_a_post_that_writes_centres_alone_refuses_radii():
    machine = by_radius("mill_heidenhain")
    with pytest.raises(PostError, match="leave out arc_centres"):
        catalogue.find_post(machine.control.post).post(random_program(1), machine)


def test_a_half_circle_goes_out_in_two_blocks_and_a_flat_one_in_one():
    machine = by_radius("mill_3axis")
    text = catalogue.find_post("linuxcnc").post(half_and_quarter(), machine).text
    arcs = [line for line in text.splitlines() if " R" in line and not line.startswith("(")]
    assert len(arcs) == 3 and all(re.search(r"R10\b", line) for line in arcs)


def half_and_quarter():
    """A half circle of radius 10, then a quarter."""
    told = random_program(0)
    w = MoveWriter((0.0, 0.0, 60.0))
    w.feed((0.0, 0.0, 0.0), 500.0)
    w.arc((20.0, 0.0, 0.0), (10.0, 0.0, 0.0), Plane.XY, True, 500.0)
    w.arc((30.0, 10.0, 0.0), (20.0, 10.0, 0.0), Plane.XY, False, 500.0)
    w.rapid((30.0, 10.0, 60.0))
    return replace(told, operations=(replace(told.operations[0], moves=w.moves()),))
