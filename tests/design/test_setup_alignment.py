"""Markers measured in a new clamping tell where the part lies, or are refused for what is wrong with them."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from troublesome_parts import two_sided

from cuspline.app import build as recipe
from cuspline.app import catalogue
from cuspline.app.judge import judge
from cuspline.design import Finish, Marker, Setup
from cuspline.design.job import read_job
from cuspline.design.setup_alignment import (
    far_errors_mm,
    fitted_frame,
    read_measured,
    refixtured,
    refixtured_setups,
    refixturing_in_words,
)
from cuspline.values.errors import InputError
from cuspline.verification.verdict import Options

PLACES = {"a": (0.0, 0.0, 0.0), "b": (120.0, 0.0, 5.0), "c": (0.0, 40.0, 0.0), "d": (110.0, 35.0, -8.0)}


def setup(**changes):
    return Setup(**{"name": "setup-2", "wcs_in_words": "end of the vane", "faces": ("tip",),
                    "wcs_origin_mm": (30.0, 2.0, 9.0), "wcs_z": (0.0, 0.0, -1.0),
                    "markers": tuple(Marker(name=n, at_mm=at) for n, at in PLACES.items()), **changes})


def lying(shift_mm=(0.4, -0.2, 0.1), turn_deg=(0.02, -0.05, 0.3), noise_mm=0.0, of=None):
    """Markers of a part that lies shifted and turned from its clamping as designed."""
    of = of or setup()
    turned = Rotation.from_euler("xyz", turn_deg, degrees=True)
    seen = of.frame.into(np.array([m.at_mm for m in of.markers]))
    noise = noise_mm * np.random.default_rng(5).normal(size=seen.shape)
    return {m.name: tuple(p) for m, p in zip(of.markers, turned.inv().apply(seen - np.array(shift_mm)) + noise)}


def test_a_fit_finds_the_motion_that_was_made():
    rng = np.random.default_rng(1)
    for _ in range(20):
        points, shift = rng.normal(size=(5, 3)) * 50, rng.normal(size=3) * 100
        turned = Rotation.random(random_state=rng)
        fit = fitted_frame(points, turned.inv().apply(points - shift))
        assert np.allclose(fit.frame.rotation, turned.as_matrix(), atol=1e-12)
        assert np.allclose(fit.frame.origin_mm, shift, atol=1e-11)
        assert fit.residual_mm.max() < 1e-11


def test_no_other_rigid_motion_comes_closer():
    rng = np.random.default_rng(2)
    nominal = rng.normal(size=(6, 3)) * 30
    measured = Rotation.random(random_state=rng).apply(nominal) + rng.normal(size=(6, 3)) * 0.5
    fit = fitted_frame(nominal, measured)
    for _ in range(200):
        beside = Rotation.from_rotvec(rng.normal(size=3) * 1e-3).as_matrix() @ fit.frame.rotation
        off = measured @ beside.T + fit.frame.origin_mm + rng.normal(size=3) * 1e-2 - nominal
        assert (off ** 2).sum() >= (fit.residual_mm ** 2).sum()


def test_a_setup_lies_as_its_markers_say():
    found = refixtured(setup(), lying())
    assert np.allclose(found.frame.out(np.array(list(lying().values()))), list(PLACES.values()), atol=1e-9)
    assert found.refixturing.turn_deg == pytest.approx((0.02, -0.05, 0.3), abs=1e-9)
    assert found.refixturing.shift_mm == pytest.approx((0.4, -0.2, 0.1), abs=1e-9)
    assert max(found.refixturing.residual_mm.values()) < 1e-9


def test_as_designed_nothing_moves():
    found = refixtured(setup(), lying((0, 0, 0), (0, 0, 0)))
    assert np.allclose(found.frame.rotation, setup().frame.rotation, atol=1e-12)
    assert np.allclose(found.wcs_origin_mm, setup().wcs_origin_mm, atol=1e-12)


def test_residuals_are_told_and_bounded():
    off = lying(noise_mm=0.003)
    assert 0.0005 < max(refixtured(setup(), off).refixturing.residual_mm.values()) < 0.01
    with pytest.raises(InputError, match="setup-2: marker . is 0.00.* more than 0.001 mm.*measure it again"):
        refixtured(setup(marker_limit_mm=0.001), off)


def mirrored(axis):
    return {n: tuple(-x if k == axis else x for k, x in enumerate(p)) for n, p in lying().items()}


@pytest.mark.parametrize("measured, words", [
    ({n: p for n, p in lying().items() if n != "c"}, "c is not measured; its markers are a, b, c, d"),
    ({**lying(), "e": (0, 0, 0)}, "e is no marker of it"),
    (mirrored(1), "with the sign of Y changed all would fit"),
    ({n: tuple(x / 25.4 for x in p) for n, p in lying().items()}, "look like inches"),
    ({n: tuple(x / 10 for x in p) for n, p in lying().items()}, "look like centimetres"),
    (lying(turn_deg=(0, 0, 8)), "8.000 degrees off"),
    (dict(zip("abcd", [lying()[n] for n in "bacd"])), "with a and b changed over all would fit: they are swapped"),
    (dict(zip("abcd", [lying()[n] for n in "bcda"])), "whether the right markers were touched"),
])
def test_markers_that_cannot_be_right_are_refused(measured, words):
    with pytest.raises(InputError, match=words):
        refixtured(setup(), measured)


@pytest.mark.parametrize("name", PLACES)
@pytest.mark.parametrize("axis", range(3))
def test_a_marker_mistyped_by_a_millimetre_is_refused_by_its_name(name, axis):
    """Least squares share the millimetre out among all four; what the others agree on says whose it is."""
    wrong = {n: tuple(x + (n == name and k == axis) for k, x in enumerate(p)) for n, p in lying(noise_mm=0.001).items()}
    with pytest.raises(InputError, match=rf"setup-2: marker {name} is (0.9|1.0).*mm from where .* all others fit"):
        refixtured(setup(), wrong)


def test_three_noisy_markers_are_refused_where_the_part_is_too_uncertain():
    """No fourth shows which is wrong; what three leave open far away is stated with the place, or which to add."""
    three = setup(markers=tuple(Marker(name=n, at_mm=PLACES[n]) for n in "abc"), marker_limit_mm=0.05)
    noisy = lying(noise_mm=0.02, of=three)
    with pytest.raises(InputError, match=r"leave the part at X381.0 Y0.0 Z0.0 uncertain by 0.0\d+ mm, more than 0.01 mm: touch"):
        refixtured(three, noisy, FAR)
    with pytest.raises(InputError, match="of three markers nobody can say which is wrong: measure all again"):
        refixtured(three, {**noisy, "b": tuple(x + 1.0 for x in noisy["b"])}, FAR)


def test_too_few_markers_and_markers_in_a_line_are_refused():
    two, line = setup().markers[:2], tuple(Marker(name=n, at_mm=(x, 0, 0)) for n, x in (("p", 0), ("q", 50), ("r", 90)))
    with pytest.raises(InputError, match="it has 2 markers; a fit needs 3"):
        refixtured(setup(markers=two), lying(of=setup(markers=two)))
    with pytest.raises(InputError, match="are in one line within 0.000 mm"):
        refixtured(setup(markers=line), lying(of=setup(markers=line)))
    with pytest.raises(InputError, match="no such setup; there are setup-2"):
        refixtured_setups([setup()], {"setup-9": {}})


SQUARE = np.array([[100.0, 100, 0], [-100, 100, 0], [-100, -100, 0], [100, -100, 0]])
FAR = np.array([[381.0, 0, 0]])


def test_what_lies_far_from_the_markers_is_as_uncertain_as_many_fits_show():
    """Four markers at +-100 mm, 2 um a coordinate, 381 mm away: 4.98 um, by formula and by a thousand measured parts."""
    assert far_errors_mm(SQUARE, FAR, 0.002) == pytest.approx([0.00498], abs=5e-6)
    rng, off2 = np.random.default_rng(7), []
    for _ in range(1000):
        fit = fitted_frame(SQUARE, SQUARE + rng.normal(size=SQUARE.shape) * 0.002)
        off2.append(((fit.frame.out(FAR) - FAR) ** 2).sum())
    assert np.sqrt(np.mean(off2)) == pytest.approx(0.00498, rel=0.05)


def on_a_square(**changes):
    markers = tuple(Marker(name=n, at_mm=tuple(p)) for n, p in zip("abcd", SQUARE.tolist()))
    return setup(**{"markers": markers, **changes})


def test_a_part_too_uncertain_far_from_its_markers_is_refused_and_what_is_kept_is_told():
    exact = lying(of=on_a_square())
    found = refixtured(on_a_square(), exact, FAR).refixturing
    assert found.far_error_mm == pytest.approx(0.00498, abs=5e-6)
    assert "FARTHEST PLACE KNOWN TO 0.0050 MM" in refixturing_in_words(found)
    with pytest.raises(InputError, match="leave the part at X381.0 Y0.0 Z0.0 uncertain by 0.0050 mm, more than 0.004 mm"):
        refixtured(on_a_square(far_limit_mm=0.004), exact, FAR)
    noisy = lying(noise_mm=0.005, of=on_a_square())
    with pytest.raises(InputError, match="uncertain by 0.01"):          # the residuals show more than is stated
        refixtured(on_a_square(), noisy, FAR)


def test_what_a_setup_says_as_ever_is_not_written():
    assert not {"far_limit_mm", "marker_error_mm"} & set(setup().model_dump(mode="json"))
    assert setup(far_limit_mm=0.02).model_dump(mode="json")["far_limit_mm"] == 0.02


def positions():
    """A clamping that begins with an indexed position, and another in it."""
    held = {"indexed": True, "clamped_x": (1.0, 0.0, 0.0), "clamped_z": (0.0, 0.0, 1.0)}
    return (on_a_square(wcs_z=(0.0, 0.0, 1.0), **held),
            on_a_square(name="setup-3", wcs_x=(0.0, 1.0, 0.0), wcs_z=(1.0, 0.0, 0.0), **held))


def test_indexed_positions_follow_their_clamping_and_look_at_the_part_as_before():
    measured = lying(of=positions()[0])
    held, turned = found = refixtured_setups(positions(), {"setup-2": measured})
    for before, after in zip(positions(), found):
        assert (after.wcs_x, after.wcs_z) == (before.wcs_x, before.wcs_z)
        assert np.allclose(after.clamped_frame.out(np.array(list(measured.values()))), SQUARE, atol=1e-9)
        assert after.refixturing.turn_deg == pytest.approx((0.02, -0.05, 0.3), abs=1e-9)
    assert turned.is_held_as(held)
    with pytest.raises(InputError, match="setup-3, an indexed position held as setup-2 is: measure them once"):
        refixtured_setups(positions(), {"setup-3": measured})


@pytest.mark.parametrize("text, words", [
    ("", "first line must name the columns setup,marker,x_mm,y_mm,z_mm"),
    ("setup,marker,x_in,y_in,z_in\n", "first line must name the columns"),
    ("setup,marker,x_mm,y_mm,z_mm\ns,a,1,2\n", "line 2: 's,a,1,2' is not"),
    ("# probe\nsetup,marker,x_mm,y_mm,z_mm\ns,a,1,2,nan\n", "line 3"),
    ("setup,marker,x_mm,y_mm,z_mm\ns,a,1,2,3\ns,a,1,2,4\n", "line 3: a of s is there twice"),
])
def test_a_file_of_measured_markers_that_is_wrong_says_where(tmp_path, text, words):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_measured(tmp_path / "m.csv")


def test_a_part_that_lies_askew_is_cut_as_designed(tmp_path):
    """Posted for the part as measured, the programs cut it; posted as designed, they would not, and that is told."""
    part = replace(two_sided(), finish=Finish(scallop_mm=0.12, profile_tolerance_mm=0.01, gouge_mm=0.02))
    measured = {"setup-2": lying((0.05, 0.08, -0.03), (0.04, -0.06, 0.4), of=part.setups[1])}
    file = tmp_path / "measured.csv"
    file.write_text("setup,marker,x_mm,y_mm,z_mm\n" + "".join(
        f"setup-2,{name},{x:.6f},{y:.6f},{z:.6f}\n" for name, (x, y, z) in measured["setup-2"].items()))
    made = {}
    anew = refixtured_setups(part.setups, read_measured(file))
    for name, setups in (("posted anew", anew), ("as designed", part.setups)):
        result = recipe.build(recipe.Order(
            source=None, design=replace(part, setups=setups), machine=catalogue.find_machine("mill_3axis"),
            library=catalogue.find_library(None), accepted=(), out=tmp_path / name, last_stage="gcode"))
        made[name] = result.folder
    job, coarse = read_job(made["posted anew"]), Options(spacing_mm=1.0, solid_pitch_mm=0.5, replay_pitch_mm=1.0)
    assert judge(made["posted anew"], job, options=coarse).findings == ()
    text = (made["posted anew"] / "setup-2.ngc").read_text()
    assert "ZERO SHIFTED" in text and "MARKER left" in text
    assert "ZERO SHIFTED" not in (made["posted anew"] / "setup-1.ngc").read_text()
    plan = json.loads((made["posted anew"] / "plan.json").read_text())
    assert plan["setups"][1]["refixturing"]["turn_deg"] == pytest.approx([0.04, -0.06, 0.4], abs=1e-4)
    wrong = judge(made["as designed"], read_job(made["as designed"]).placed(read_measured(file)),
                  options=coarse)
    assert {f.kind for f in wrong.findings} & {"gouge", "excess"}
    assert all(f.setup == "setup-2" for f in wrong.findings if f.kind == "gouge")
