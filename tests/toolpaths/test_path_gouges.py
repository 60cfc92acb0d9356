"""Gouges between the points of a path: closed forms, dense sampling, and what must stay clean."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere

from cuspline.errors import ToolpathError
from cuspline.toolpaths.exact_drop import ExactPart, drop_tips_mm, gouge_depths_mm
from cuspline.toolpaths.path_gouges import path_gouges

CUTTERS = pytest.mark.parametrize("R, rc", [(4.0, 4.0), (4.0, 1.0), (3.0, 0.0)], ids=["ball", "bull nose", "flat"])
TOLERANCE_MM = 1e-3


@pytest.fixture(scope="module")
def ball():
    return ExactPart.of_solid(BRepPrimAPI_MakeSphere(10.0).Solid())


def test_a_chord_over_a_sphere_gouges_by_its_sag(ball):
    x = np.array([[-2.0, 2.0], [-1.0, 1.0], [0.5, 1.5]])
    tip = lambda x: np.sqrt(14.0 ** 2 - x ** 2) - 4.0
    start, end = (np.column_stack([x[:, k], np.zeros(3), tip(x[:, k])]) for k in (0, 1))
    t = np.linspace(0, 1, 2001)[:, None]
    sag = (tip(x[:, 0] * (1 - t) + x[:, 1] * t) - tip(x[:, 0]) * (1 - t) - tip(x[:, 1]) * t).max(axis=0)
    bound, worst = path_gouges(ball, start, end, 4.0, 4.0, TOLERANCE_MM)
    assert (bound >= sag).all() and (bound <= sag + TOLERANCE_MM).all()
    np.testing.assert_allclose(worst[:2], 0.5, atol=0.1)


@CUTTERS
def test_no_sample_of_a_move_cuts_deeper_than_its_bound(ball, R, rc):
    rng = np.random.default_rng(4)
    xy = rng.uniform(-7, 7, (12, 2))
    tips = np.column_stack([xy, drop_tips_mm(ball, xy, R, rc) + rng.uniform(-0.1, 0.1, 12)])
    bound, worst = path_gouges(ball, tips[:-1], tips[1:], R, rc, 0.01)
    t = np.linspace(0, 1, 101)[:, None, None]
    along = (tips[:-1] * (1 - t) + tips[1:] * t).reshape(-1, 3)
    sampled = gouge_depths_mm(ball, along, R, rc).reshape(101, -1).max(axis=0)
    assert (bound >= sampled - 1e-9).all() and (bound <= sampled + 0.02).all()


@CUTTERS
def test_a_post_between_two_clean_points_is_found(R, rc):
    post = cq.Workplane("XY").box(40, 40, 2, centered=(True, True, False)).faces(">Z").workplane().circle(0.2).extrude(3)
    bound, worst = path_gouges(ExactPart.of_solid(post.val().wrapped), [[-12.0, 0, 2.001]], [[12.0, 0, 2.001]], R, rc, 0.01)
    assert bound[0] == pytest.approx(2.999, abs=0.011)
    assert worst[0] * 24 - 12 == pytest.approx(0.0, abs=R + 0.3)


@CUTTERS
def test_moves_above_the_part_are_clean(R, rc):
    part = ExactPart.of_solid(BRepPrimAPI_MakeBox(20.0, 16.0, 5.0).Solid())
    bound, _ = path_gouges(part, [[-9.0, -9, 5.01], [3, 3, 9]], [[30.0, 20, 5.01], [3, 3, 5]], R, rc, TOLERANCE_MM)
    assert (bound <= TOLERANCE_MM).all()


@CUTTERS
def test_contouring_a_millionth_of_a_millimetre_beside_upright_walls_is_clean(R, rc):
    block = cq.Workplane("XY").box(20, 16, 5).rotate((0, 0, 0), (0, 0, 1), 31).val().wrapped
    turn = np.array([[np.cos(np.radians(31)), np.sin(np.radians(31))], [-np.sin(np.radians(31)), np.cos(np.radians(31))]])
    aside = R + 1e-6
    corners = np.array([[10, 8 + aside], [-10, 8 + aside], [-10 - aside, 8], [-10 - aside, -8]]) @ turn
    start, end = (np.column_stack([corners[k], np.full(2, -2.0)]) for k in ([0, 2], [1, 3]))
    part = ExactPart.of_solid(block)
    assert (path_gouges(part, start, end, R, rc, TOLERANCE_MM)[0] <= TOLERANCE_MM).all()
    inward = np.array([[0, -1e-4], [1e-4, 0]]) @ turn
    start[:, :2] += inward
    end[:, :2] += inward
    bound, _ = path_gouges(part, start, end, R, rc, TOLERANCE_MM)
    true = 4.5 - (rc - np.sqrt(max(rc ** 2 - (rc - 1e-4 + 1e-6) ** 2, 0)))
    np.testing.assert_allclose(bound, true, rtol=0, atol=1.1 * TOLERANCE_MM)


def test_contouring_beside_a_round_post_is_clean():
    post = cq.Workplane("XY").circle(6).extrude(10).val().wrapped
    a = np.linspace(0, 2 * np.pi, 721)
    for R, rc in ((3.0, 0.0), (3.0, 1.0), (3.0, 3.0)):
        ring = (6 + R + 1e-6) / np.cos((a[1] - a[0]) / 2)
        tips = np.column_stack([ring * np.cos(a), ring * np.sin(a), np.full(721, 2.0)])
        assert (path_gouges(ExactPart.of_solid(post), tips[:-1], tips[1:], R, rc, TOLERANCE_MM)[0] <= TOLERANCE_MM).all()


def test_a_move_up_a_filleted_wall_is_bounded_closely():
    boss = cq.Workplane("XY").box(40, 40, 4, centered=(True, True, False)).faces(">Z").workplane().circle(8).extrude(6)
    part = ExactPart.of_solid(boss.faces(">Z").edges().fillet(2).val().wrapped)
    x = np.array([-13.05, -12.95])
    for R, rc in ((5.0, 5.0), (5.0, 1.0), (5.0, 0.0)):
        tips = np.column_stack([x, [0.0, 0.0], drop_tips_mm(part, np.column_stack([x, [0.0, 0.0]]), R, rc)])
        bound, _ = path_gouges(part, tips[:1], tips[1:], R, rc, TOLERANCE_MM)
        along = tips[0] + np.linspace(0, 1, 20_001)[:, None] * (tips[1] - tips[0])
        deepest = gouge_depths_mm(part, along, R, rc).max()
        assert deepest - 1e-9 <= bound[0] <= deepest + 0.05


def test_a_tolerance_finer_than_the_drop_is_refused(ball):
    with pytest.raises(ToolpathError, match="finer"):
        path_gouges(ball, np.zeros((1, 3)), np.ones((1, 3)), 3.0, 3.0, 1e-6)
