"""The door to pymeshlab finds known defects, and knows the distance of known shapes."""

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("pymeshlab")

from cuspline.kernel import mesh_quality
from cuspline.kernel.mesh_quality import (
    compared,
    distances,
    is_sound,
    mesh_faults,
    signed_distances_mm,
    write_coloured_ply,
)


def box(low=(0, 0, 0), high=(4, 3, 2)):
    """Vertices and outward triangles of a box."""
    v = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for k in (0, 1) for j in (0, 1) for i in (0, 1)], float)
    f = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6),
         (1, 3, 5), (3, 7, 5)]
    return v, np.array(f)


def sphere(radius, rings=40):
    """A ball's surface by latitude and longitude, its poles single vertices."""
    polar, turns = np.linspace(0, np.pi, rings + 1)[1:-1], 2 * rings
    a = 2 * np.pi * np.arange(turns) / turns
    p, q = (g.ravel() for g in np.meshgrid(polar, a, indexing="ij"))
    body = radius * np.column_stack([np.sin(p) * np.cos(q), np.sin(p) * np.sin(q), np.cos(p)])
    v = np.vstack([body, [0, 0, radius], [0, 0, -radius]])
    at = lambda i, j: i * turns + j % turns
    f = [t for i in range(rings - 2) for j in range(turns) for t in
         ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))]
    f += [(len(body), at(0, j), at(0, j + 1)) for j in range(turns)]
    f += [(len(body) + 1, at(rings - 2, j + 1), at(rings - 2, j)) for j in range(turns)]
    return v, np.array(f)


def test_a_box_and_a_ball_are_sound():
    assert is_sound(mesh_faults(*box())) and is_sound(mesh_faults(*sphere(5.0)))
    assert mesh_faults(*box((0, 0, 0), (1, 1, 1)))["smallest_angle_deg"] == pytest.approx(45, abs=1e-3)


def spoilt():
    v, f = box()
    other, g = box((2, 1, 1), (6, 5, 5))
    yield "open_edges", 3, v, f[1:]
    yield "flipped", 1, v, np.vstack([f[:1, ::-1], f[1:]])
    yield "is_inside_out", True, v, f[:, ::-1]
    yield "non_manifold_edges", 1, np.vstack([v, [[9, 9, 9]]]), np.vstack([f, [(0, 1, 8)]])
    yield "degenerate", 1, np.vstack([v, [[2, 0, 0]]]), np.vstack([f, [(0, 8, 1)]])
    yield "self_intersecting", None, np.vstack([v, other]), np.vstack([f, g + 8])


@pytest.mark.parametrize("what,count,vertices,triangles", list(spoilt()), ids=lambda x: x if isinstance(x, str) else "")
def test_a_defect_is_counted(what, count, vertices, triangles):
    faults = mesh_faults(vertices, triangles)
    assert not is_sound(faults) and (faults[what] == count if count is not None else faults[what] > 0)


def test_distance_of_two_balls_is_the_difference_of_their_radii():
    v, f = sphere(10.0, 120)
    found = distances(sphere(10.25)[0], v, f)
    sagitta = 10 * (1 - np.cos(np.pi / 120))
    for name in ("max_mm", "mean_mm", "rms_mm"):
        assert 0.25 - 1e-5 < found[name] < 0.25 + 2 * sagitta
    assert found["points"] == len(sphere(10.25)[0])


@pytest.mark.parametrize("shift", [-0.01, 0.003])
def test_distance_of_shifted_planes_is_the_shift(shift):
    v, f = box((0, 0, 0), (100, 80, 40))
    x, y = np.meshgrid(np.linspace(5, 95, 31), np.linspace(5, 75, 21))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 40 + shift)])
    found = distances(points, v, f)
    assert all(abs(found[k] - abs(shift)) < 2e-5 for k in ("max_mm", "mean_mm", "rms_mm"))
    assert np.abs(signed_distances_mm(points, v, f) - shift).max() < 2e-5


def test_no_points_have_no_distance():
    assert distances(np.zeros((0, 3)), *box())["points"] == 0


def view(largest, mean):
    return {"max_on_stock_mm": largest, "design_to_stock": {"mean_mm": mean}, "max_residual_mm": 0.010,
            "mean_residual_mm": 0.003}


@pytest.mark.parametrize("largest,mean,count", [(0.0105, 0.0031, 0), (0.0125, 0.003, 1), (0.010, 0.006, 1), (0.02, 0.0, 2)])
def test_figures_beyond_the_bounds_are_a_finding(largest, mean, count):
    _, findings = compared(view(largest, mean), "setup-1", tessellation_mm=0.001, path_mm=1e-5, zmap_mm=0.001, size_mm=100)
    assert len(findings) == count and all(f.kind == "verifiers_disagree" for f in findings)


def test_ridges_that_a_coarse_finish_allows_are_finished_places():
    """Beside ridges of 0.14 mm lie some of 0.058 whose tops no sample hits: the highest top of all is the bound."""
    height = lambda x: np.where(x < 10, 0.058, 0.14) * np.sin(np.pi * x / 0.6) ** 2
    x, y = np.meshgrid(np.arange(2.0, 20.0, 0.1), np.arange(1.0, 7.0, 0.5), indexing="ij")
    stock = np.column_stack([x.ravel(), y.ravel(), 2 + height(x).ravel()])
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (g.ravel() for g in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    seen = np.concatenate([2.2 + 0.3 * np.arange(26), 10.2 + 0.1 * np.arange(96)])
    points = np.array([(at_x, at_y, 2.0) for at_x in seen for at_y in np.arange(1.0, 7.0, 0.5)])
    residual = height(points[:, 0])
    samples = SimpleNamespace(points_mm=points, normals=np.tile([0, 0, 1.0], (len(points), 1)),
                              weight_mm2=np.ones(len(points)), is_border=np.zeros(len(points), bool))
    found = SimpleNamespace(samples=samples, deviation_mm=residual, is_for_balls=np.ones(len(points), bool), spacing_mm=0.3)
    design = SimpleNamespace(**dict(zip(("vertices_mm", "triangles"), box((0, 0, 0), (22, 8, 2)))))
    off = lambda allowed_mm: len(compared(mesh_quality.third_view(
        (stock, triangles), design, found, np.array([0, 0, 1.0]), allowed_mm, lambda p: height(p[:, 0])), "setup-1",
        tessellation_mm=0.001, path_mm=1e-5, zmap_mm=0.02, size_mm=22)[1])
    assert residual[points[:, 0] < 10].max() < mesh_quality.THIN_MM < 0.058 and residual.max() > 0.139
    assert (off(allowed_mm=0.02), off(allowed_mm=0.33)) == (1, 0)


def test_high_ridges_are_nearer_than_they_are_high():
    """Valleys of a ball of 2 mm, 1.1 mm apart: the stock beside a ridge is 1.3 % nearer on average than along the normal."""
    radius, pitch = 2.0, 1.1
    beside = lambda x: (x + pitch / 2) % pitch - pitch / 2
    height = lambda x: radius - np.sqrt(radius ** 2 - beside(x) ** 2)
    x, y = np.meshgrid(np.arange(2.0, 20.0, 0.011), np.arange(1.0, 7.0, 0.5), indexing="ij")
    stock = np.column_stack([x.ravel(), y.ravel(), 2 + height(x).ravel()])
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (g.ravel() for g in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    points = np.array([(at_x, at_y, 2.0) for at_x in np.arange(4.0, 18.0, 0.05) for at_y in np.arange(2.0, 6.0, 0.5)])
    samples = SimpleNamespace(points_mm=points, normals=np.tile([0, 0, 1.0], (len(points), 1)),
                              weight_mm2=np.ones(len(points)), is_border=np.zeros(len(points), bool))
    found = SimpleNamespace(samples=samples, deviation_mm=height(points[:, 0]), is_for_balls=np.ones(len(points), bool),
                            spacing_mm=0.3)
    design = SimpleNamespace(**dict(zip(("vertices_mm", "triangles"), box((0, 0, 0), (22, 8, 2)))))
    off = lambda nearest: len(compared(mesh_quality.third_view(
        (stock, triangles), design, found, np.array([0, 0, 1.0]), 0.086, nearest), "setup-1", tessellation_mm=0.001,
        path_mm=0.0, zmap_mm=2e-5, size_mm=22)[1])
    assert off(lambda p: np.sqrt(radius ** 2 + beside(p[:, 0]) ** 2) - radius) == 0
    assert off(lambda p: np.full(len(p), np.inf)) == 1


def test_a_vertex_where_two_setups_meet_is_no_place_of_the_stock():
    """One vertex 0.02 above a plane finish of 0.01: a chord's end 0.015 off the exact stock, or stock that no sample sees."""
    x, y = np.meshgrid(np.linspace(2, 20, 19), np.linspace(1, 7, 13), indexing="ij")
    stock = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.01)])
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    high = int(np.flatnonzero((stock[:, 0] == 10) & (stock[:, 1] == 4))[0])
    stock[high, 2] += 0.01
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (g.ravel() for g in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([b, d, c])])
    samples = SimpleNamespace(points_mm=points, normals=np.tile([0, 0, 1.0], (len(points), 1)),
                              weight_mm2=np.ones(len(points)), is_border=np.zeros(len(points), bool))
    found = SimpleNamespace(samples=samples, deviation_mm=np.full(len(points), 0.01), is_for_balls=np.ones(len(points), bool),
                            spacing_mm=1.0)
    design = SimpleNamespace(**dict(zip(("vertices_mm", "triangles"), box((0, 0, 0), (22, 8, 2)))))

    def findings(high_lies_off_mm, is_met=True):
        nearest = lambda p: np.where(p[:, 2] > 2.015, high_lies_off_mm, p[:, 2] - 2.01)
        seen = mesh_quality.third_view((stock, triangles), design, found, np.array([0, 0, 1.0]), 0.011, nearest, is_met)
        return len(compared(seen, "setup-1", tessellation_mm=0.001, path_mm=1e-5, zmap_mm=0.001, size_mm=22)[1])

    assert (findings(0.0), findings(0.015), findings(0.015, is_met=False)) == (1, 0, 1)      # of one setup it is a fault


def test_the_coloured_mesh_is_the_same_every_time(tmp_path):
    v, f = sphere(5.0)
    deviation = 0.01 * v[:, 2] / 5
    for name in ("one.ply", "two.ply"):
        write_coloured_ply(tmp_path / name, v, f, deviation, 0.01)
    one = (tmp_path / "one.ply").read_bytes()
    assert one == (tmp_path / "two.ply").read_bytes() and one.startswith(b"ply") and b"red" in one[:600]


def test_without_pymeshlab_it_is_said(monkeypatch):
    monkeypatch.setattr(mesh_quality.importlib.util, "find_spec", lambda name: None)
    assert not mesh_quality.is_installed() and "not installed" in mesh_quality.LEFT_OUT
