"""What flutes too short for a wall leave beside their neck: closed forms, and the same moves as sub-steps of a posed cutter."""

import numpy as np
import pytest
from known_programs import feed, program, random_moves, rapid, tool

from cuspline.shop.cutters import Cutter, Tool
from cuspline.stock.swept import deviation_mm, deviations_and_moves, swept_paths, upright_paths
from cuspline.stock.tilted import posed_path

BOX = (-50, -50, -30), (50, 50, 0)
LEFT, FLUTES, DEEP = 0.08, 6.0, 15.0


def slim(number, type_="flat", diameter=10.0, flutes=FLUTES, corner=0.0):
    """A cutter whose neck is 0.2 mm thinner all round."""
    cutter = Cutter(name=f"slim {number}", type=type_, diameter_mm=diameter, corner_radius_mm=corner, flutes=2,
                    flute_length_mm=flutes, neck_diameter_mm=diameter - 0.4, reach_mm=40.0, shank_diameter_mm=diameter,
                    overall_length_mm=90.0)
    return Tool(number=number, cutter=cutter, holder=tool("ball", 6).holder, stick_out_mm=50.0)


def wall_program(levels):
    """A slot roughed by long flutes in one go, `LEFT` short of the wall y = 5; then the short ones along the wall."""
    moves = [feed(20, -LEFT, -DEEP), rapid(20, -LEFT, 5), rapid(-20, 0, 5)]
    for z in levels:
        moves += [rapid(-20, 0, z), feed(20, 0, z), rapid(20, 0, 5), rapid(-20, 0, 5)]
    return program((-20, -LEFT, -DEEP), moves, tool=[1, 1, 1] + [2] * 4 * len(levels))


def on_the_wall(heights):
    heights = np.asarray(heights, float)
    zero = np.zeros(len(heights))
    return np.column_stack([zero, zero + 5.0, heights]), np.column_stack([zero, zero - 1.0, zero])


@pytest.mark.parametrize("type_, corner", [("flat", 0.0), ("bull_nose", 1.0), ("ball", 5.0)])
def test_a_wall_higher_than_the_flutes_stands_beside_the_neck(type_, corner):
    tools = {1: slim(1, flutes=20.0), 2: slim(2, type_, corner=corner)}
    heights = np.arange(-DEEP + 5.01, -0.5, 0.5)
    points, normals = on_the_wall(heights)
    left, row = deviations_and_moves(swept_paths(wall_program([-DEEP]), tools), *BOX, points, normals, 1.0)
    above = heights > FLUTES - DEEP
    assert 5 < above.sum() < len(above)
    assert np.abs(left - np.where(above, LEFT, 0.0)).max() < 1e-7
    assert set(row[heights > FLUTES - DEEP + LEFT]) == {0} and set(row[~above]) == {4}


def test_a_wall_cut_level_by_level_is_done():
    points, normals = on_the_wall(np.arange(-DEEP + 0.01, -0.5, 0.25))
    tools = {1: slim(1, flutes=20.0), 2: slim(2)}
    for levels, most in (([-5, -10, -DEEP], 0.0), ([-4, -DEEP], LEFT), ([-DEEP, -9, -3], 0.0)):
        left = deviation_mm(swept_paths(wall_program(levels), tools), *BOX, points, normals, 1.0)
        assert abs(left.max() - most) < 1e-7 and left.min() > -1e-7


def test_two_short_cutters_do_not_hide_each_other():
    """Both have their flutes' end below the same places; only what a third has cut there counts."""
    tools = {1: slim(1, flutes=20.0), 2: slim(2), 3: slim(3, "bull_nose", corner=1.0)}
    moves = [feed(20, -LEFT, -DEEP), rapid(20, 0, 5), feed(20, 0, -DEEP), feed(-20, 0, -DEEP), rapid(-20, 0, 5),
             feed(-20, 0, -DEEP), feed(20, 0, -DEEP)]
    posted = program((-20, -LEFT, -DEEP), moves, tool=[1, 2, 2, 2, 3, 3, 3])
    points, normals = on_the_wall([-8.9, -5.0, -1.0])
    assert np.abs(deviation_mm(swept_paths(posted, tools), *BOX, points, normals, 1.0) - LEFT).max() < 1e-7


@pytest.mark.parametrize("type_, corner", [("flat", 0.0), ("bull_nose", 1.0), ("ball", 5.0)])
@pytest.mark.parametrize("by", [0.0, 0.05])
def test_ended_moves_are_those_of_a_posed_cutter(type_, corner, by):
    """Random lines and arcs, also of a grown cutter: the same deviations along rays in all directions."""
    rng = np.random.default_rng(7)
    start, moves = random_moves(rng, 14, (-6, -6, -12), (6, 6, -1), arcs=True)
    posted, cutter = program(start, moves), slim(1, type_, corner=corner)
    upright, = upright_paths(swept_paths(posted, {1: cutter}))
    known = posed_path(posted, np.arange(len(posted)), cutter).grown(by)
    upright = upright.grown(by)
    points = rng.uniform((-15, -12, -16), (15, 12, 2), (400, 3))
    normals = rng.normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ask = lambda path: deviation_mm((path,), *BOX, points, normals, 3.0)
    open_above, ended, posed = ask(upright), ask(upright.ended), ask(known)
    assert np.abs(ended - posed).max() < 2e-4 and np.median(np.abs(ended - posed)) < 1e-7
    assert (open_above < ended - 0.01).any() and (open_above < ended + 2e-4).all()
