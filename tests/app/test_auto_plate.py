"""A whole plate by `Auto`: drilled, bored, contoured and chamfered, verified as posted; what its program must not do is found."""

import math
import shutil
from pathlib import Path

import pytest
from built_parts import built_once

from cuspline.app.judge import begun, judge
from cuspline.design import ChamferWidth, FacePredicate
from cuspline.design.job import read_job
from cuspline.values.errors import DesignError
from cuspline.verification.measuring import measured, refuse_unmeasurable, tolerance_findings
from cuspline.verification.verdict import Options

PART = Path(__file__).parent.parent / "parts" / "auto_plate.py"
COARSE = Options(spacing_mm=1.0, solid_pitch_mm=1.0, replay_pitch_mm=0.5, tessellation_mm=0.01)


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Output folder of the plate, posted; not to be edited."""
    return built_once(tmp_path_factory, "auto_plate", PART, "--stage", "gcode")


def test_a_plate_is_made_whole_at_the_first_try(plate):
    text = (plate / "setup-1.ngc").read_text()
    made = [line.split(": ")[1].split(",")[0] for line in text.splitlines() if line.startswith("(OPERATION")]
    assert made == ["DRILL", "BORE ROUGH", "BORE", "ROUGH", "CONTOUR", "CHAMFER"]
    assert judge(plate, read_job(plate), options=COARSE).findings == ()


SPOILT = (("G1 X0\nG2 X-8 Y0 I0 J8\nG1 Y24\n", "G1 X0\nG2 X-8 Y0 I0 J8\n"
           "G1 Z5.6\nX8\nY24\nX-8\nZ0\nY0\nY24\n"),                                                     # wrong side, shallow
          ("G2 X37.4725 Y19 I0 J-6.4725\nG1 Y5\n", "G2 X37.4725 Y19 I0 J-6.4725\nG1 Z4.2275\nY5\nZ4.4275\n"),   # a chamfer
          ("X26 Y12 I2 J0\nX24 Y14 I-2 J0\nX23", "X26 Y12 I2 J0\nG1 X26.05\nG3 X21.95 I-2.05 J0\nX26.05 I2.05 J0\nG1 X26\n"
           "G3 X24 Y14 I-2 J0\nX23"))                                                                       # a bore, 0.1 mm wider
FOUND = (("bored too wide", lambda x, y, z: abs(math.hypot(x - 24, y - 12) - 7) < 0.2, 0.047, 0.053),
         ("on the wrong side", lambda x, y, z: x < 9, 0.25, 0.45),
         ("chamfer too deep", lambda x, y, z: x > 33, 0.2 * 0.5 ** 0.5 - 0.02, 0.2 * 0.5 ** 0.5 + 0.01))


def test_a_wrong_side_a_chamfer_too_deep_and_a_bore_too_wide_are_found(plate, tmp_path):
    folder = shutil.copytree(plate, tmp_path / "spoilt")
    text = (folder / "setup-1.ngc").read_text()
    for old, new in SPOILT:
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "setup-1.ngc").write_text(text)
    gouges = [f for f in judge(folder, read_job(folder), options=COARSE).findings if f.kind == "gouge"]
    for what, is_there, least, most in FOUND:
        here = [f.amount_mm for f in gouges if is_there(*f.place_mm)]
        assert here and least < max(here) < most, (what, gouges)


CHAMFERS = FacePredicate(name="chamfers", at_least=1, center_min_mm=(-1, -1, 5.5), center_max_mm=(37, 25, 5.95))
WIDTHS = (ChamferWidth(faces="chamfers", lower_mm=-0.05, upper_mm=0.05),)


def chamfer_rows(folder):
    """Measured chamfers of a folder's programs."""
    job = read_job(folder)
    job = job.model_copy(update={"predicates": (*job.predicates, CHAMFERS), "dimensions": WIDTHS})
    read = begun(folder, job, options=COARSE)
    return measured(job.dimensions, read.first.part.piece, read.solid, job.predicates, 5e-5)


def test_chamfers_are_as_wide_as_they_are_drawn_and_one_too_deep_is_out_of_its_limits(plate, tmp_path):
    rows = chamfer_rows(plate)
    assert len(rows) == 8 and tolerance_findings(rows, "setup-1") == ()
    assert all(m.nominal_mm == pytest.approx(0.6, abs=2e-3) and abs(m.fitted_mm - 0.6) < 2e-3 for m in rows)
    folder = shutil.copytree(plate, tmp_path / "deeper")
    old, new = SPOILT[1]
    text = (folder / "setup-1.ngc").read_text()
    (folder / "setup-1.ngc").write_text(text.replace(old, new))
    wide = [m for m in chamfer_rows(folder) if m.beyond_mm]
    assert max(m.most_mm for m in wide) == pytest.approx(0.8, abs=0.01) and all(m.place_mm[0] > 30 for m in wide)


def test_a_wall_is_no_chamfer(plate):
    job, solid = read_job(plate), begun(plate, read_job(plate), options=COARSE).solid
    with pytest.raises(DesignError, match="is no chamfer"):
        refuse_unmeasurable((ChamferWidth(faces=job.predicates[0].name, lower_mm=-0.1, upper_mm=0.1),), solid, job.predicates)
