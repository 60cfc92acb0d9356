"""Stretches that a larger ball leaves to a smaller one."""

import numpy as np
import pytest

from cuspline.designs.z_profile import ZProfile, design
from cuspline.kernel import brep
from cuspline.surfaces.sections import SectionPlane
from cuspline.toolpaths.sections.profile_passes import ProfilePlanner
from cuspline.toolpaths.sections.rest_passes import SAMPLE_MM, _sampled, left_stretches
from cuspline.toolpaths.sections.section_pieces import ArcPiece

LARGE_MM, SMALL_MM, ACROSS_MM = 5.0, 2.0, 10.0


def stretches_of(**parameters):
    made = design(ZProfile(width_mm=20.0, **parameters))
    solid = brep.the_solid(made.solid)
    faces = brep.faces_of(solid)
    chosen = brep.select_faces(faces, made.predicates[0])
    wanted = {i for i, f in enumerate(faces) if any(f is c for c in chosen)}
    small, large = (ProfilePlanner(solid, SectionPlane.named("ZX"), r, 0.0, 0.002, 1e4) for r in (SMALL_MM, LARGE_MM))
    return left_stretches(small, large, wanted, brep.bounding_box_mm(solid), ACROSS_MM)


def test_a_valley_narrower_than_the_large_ball_is_left_in_one_stretch_without_gaps():
    """The ball of 5 mm sits between flank and wall: flank, hollow, floor and wall below are one stretch."""
    (stretch,) = stretches_of(floor_length_mm=3.0)
    assert len(stretch.chain) == 5
    assert np.linalg.norm(np.diff(stretch.centers, axis=0), axis=1).max() < 2 * SAMPLE_MM


def test_only_the_foot_of_the_wall_is_left_where_the_large_ball_fits_the_hollow():
    (stretch,) = stretches_of()
    foot = np.array([stretch.centers[:, 0].max() + SMALL_MM, stretch.centers[:, 1].min() - SMALL_MM])
    assert np.abs(stretch.contacts - foot).max() < LARGE_MM + 0.5


@pytest.mark.parametrize("is_over", [True, False])
def test_an_arc_is_sampled_evenly_up_to_its_level_ends(is_over):
    center, radius, up = np.array([3.0, 7.0]), 5.0, 1.0 if is_over else -1.0
    piece = ArcPiece(center=center, radius=radius, start=center - (radius, 0), end=center + (radius, 0),
                     is_over=is_over, owner=0)
    centers, normals = _sampled(piece)
    assert np.abs(np.linalg.norm(centers - center, axis=1) - radius).max() < 1e-12
    assert np.linalg.norm(np.diff(centers, axis=0), axis=1).max() <= SAMPLE_MM
    assert (up * (centers[1:-1, 1] - center[1]) > 0).all() and centers[0, 0] < centers[-1, 0]
    assert np.abs(normals - up * (centers - center) / radius).max() < 1e-12
