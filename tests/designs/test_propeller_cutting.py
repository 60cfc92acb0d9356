"""How a propeller is laid out to be cut: every blade from the same directions, turned with it, none of them towards the table."""

import numpy as np
import pytest

from cuspline.app.catalogue import find_design, make_design
from cuspline.designs.propellers import cutting
from cuspline.designs.propellers.blade import about_x
from cuspline.kernel import brep
from cuspline.surfaces.curvature import sample_faces
from cuspline.values.errors import DesignError

SMALL = ["diameter_mm=100", "bore_mm=8",
         *(f"fillet_{part}_mm={r}" for part, r in (("leading_edge", 2), ("trailing_edge", 2), ("face", 3), ("back", 3)))]
FEW = np.array([(0.612, 0.612, 0.5), (-0.612, -0.612, 0.5), (0.0, 0.0, 1.0), (-0.9, 0.3, 0.3)])
FEW = FEW / np.linalg.norm(FEW, axis=1)[:, None]


@pytest.fixture(scope="module")
def whole():
    """The 4119 of 100 mm with all blades to be cut; a few directions to choose from."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cutting, "directions", lambda: FEW)
        patch.setattr(cutting, "PLACES", 300)
        return make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=all"])


def test_blades_are_cut_from_directions_turned_with_them(whole):
    ways = np.array([s.wcs_z for s in whole.setups]).reshape(3, -1, 3)
    assert ways.shape[1] >= 2
    for k in (1, 2):
        assert ways[k] == pytest.approx(ways[0] @ about_x(2 * np.pi * k / 3).T, abs=1e-11)
    assert [s.name for s in whole.setups[:2]] == ["blade-1-1", "blade-1-2"] and whole.setups[-1].name.startswith("blade-3-")
    assert all(f"blade {s.name[6]} face" in s.faces and f"fillet {s.name[6]}" in s.faces for s in whole.setups)
    assert whole.description.endswith("; 3 of 3 blades cut with their fillets, all else stays as cast")
    assert all(s.indexed and s.clamped_x == (1, 0, 0) and s.clamped_z == (0, 0, 1) for s in whole.setups)


def test_no_direction_points_the_spindle_at_the_table_and_the_first_two_see_both_sides(whole):
    ways = np.array([s.wcs_z for s in whole.setups])
    assert (ways[:, 0] >= -np.sin(np.radians(cutting.TOWARDS_TABLE_DEG)) - 1e-9).all()
    faces = brep.faces_of(brep.the_solid(whole.solid))
    for side in ("face", "back"):
        mine = brep.indices_of(faces, brep.named_faces(faces, whole.predicates, (f"blade 1 {side}",)))
        normals = sample_faces(faces, mine, across_axis=2).normal
        best = (normals @ ways[:2].T).max(axis=1)
        assert np.percentile(best, 5) > np.cos(np.radians(cutting.CUT_DEG))


def test_a_hub_that_reaches_the_table_is_refused():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cutting, "_ways", lambda design, p: FEW[:2])
        with pytest.raises(DesignError, match="the hub begins 20.0 mm before the propeller's centre, .* enlarge arbor_mm"):
            make_design(find_design("dtmb_4119"), [*SMALL, "blades_cut=one", "arbor_mm=15"])
