"""Plots and pictures: same input, same bytes; a missing renderer is a sentence, not a crash."""

import dataclasses
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from cuspline.report import page, pictures, plots
from cuspline.report.wording import short


def test_plots_are_the_same_twice_and_carry_no_date(sample_bundle):
    first = plots.all_plots(sample_bundle)
    assert first == plots.all_plots(sample_bundle)
    assert [name for name, _, _ in first] == ["deviation", "curvature", "cusp-map", "cusp", "feed-setup-1"]
    for _, _, svg in first:
        ElementTree.fromstring(svg)
        assert "dc:date" not in svg


def test_plots_of_an_inch_machine_are_in_inches(sample_bundle):
    setups = tuple(dataclasses.replace(s, units="inch") for s in sample_bundle.setups)
    inches = {name: svg for name, _, svg in plots.all_plots(dataclasses.replace(sample_bundle, setups=setups))}
    assert not any(word in svg for svg in inches.values() for word in ("[mm", "µm"))
    limit = 1000 * sample_bundle.finish.scallop_mm / 25.4                   # thousandths of an inch
    assert f"cusp {limit:+.4g}" in inches["deviation"] and "deviation [0.001 inch]" in inches["deviation"]
    assert f"requested {limit:.4g}" in inches["cusp"] and f"tightest R {short(8.0 / 25.4)}" in inches["curvature"]
    assert "feed [inch/min]" in inches["feed-setup-1"] and "X [inch]" in inches["cusp-map"]
    along = {"way_m": [0.3048], "operation": [0], "depth_mm": [1.0], "speed_m_per_min": [30.0], "removal_cm3_per_h": [1.0]}
    svg = plots.process_plot(along, plots.UNITS["inch"])
    assert all(label in svg for label in ("depth [inch]", "speed [ft/min]", "removal [inch³/h]", "cutting way [ft]"))


def test_a_user_s_matplotlibrc_changes_nothing(sample_bundle):
    import matplotlib
    wanted = plots.all_plots(sample_bundle)
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 20, "lines.linewidth": 9}):
        assert plots.all_plots(sample_bundle) == wanted


def test_plots_of_nothing_say_so():
    assert "no residual was judged" in plots.deviation_histogram(np.array([np.nan]), 0.01, 0.003)
    assert "nothing concave" in plots.curvature_plot(np.zeros(5), [], None)


def test_histogram_counts_what_lies_beyond_the_band():
    svg = plots.deviation_histogram(np.array([-0.005, 0.0, 0.0, 0.02, 0.03]), 0.01, 0.003)
    assert "n = 5; below the band 1, above 2" in svg


def test_finishing_cutters_are_compared_with_the_hollows(sample_bundle):
    radii, hollow = plots.cutter_radii_mm(sample_bundle)
    assert radii == [("T4 ball ∅6", 3.0, False), ("T3 ball ∅10", 5.0, True), ("T5 ball ∅20", 10.0, False)] and hollow == 8.0


@pytest.fixture(scope="module")
def rendered(sample_bundle, tmp_path_factory):
    found = pictures.render_pictures(sample_bundle, tmp_path_factory.mktemp("pictures"))
    if found.left_out:
        pytest.skip(found.left_out)
    return found


def test_four_pictures_that_show_something(rendered):
    import matplotlib.image
    assert list(rendered.files) == ["iso", "top", "paths", "deviation"]
    for path in rendered.files.values():
        pixels = matplotlib.image.imread(path)
        assert pixels.shape == (900, 1400, 3) and pixels.std() > 0.05


@pytest.mark.parametrize(("code", "said"), [
    ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", pictures.INSTALL),
    ("raise ValueError('broken scene')", "no pictures: the renderer stopped with: ValueError: broken scene")])
def test_a_renderer_that_dies_is_a_sentence(sample_bundle, tmp_path, monkeypatch, code, said):
    run = subprocess.run
    monkeypatch.setattr(pictures.subprocess, "run", lambda command, **kw: run([sys.executable, "-c", code], **kw))
    files, left_out = page.write_report(sample_bundle, tmp_path)
    assert left_out == said and (tmp_path / "report.html").exists() and not list(tmp_path.glob("*.png"))
    assert said in (tmp_path / "report.html").read_text()
    assert all(Path(f).exists() for f in files)


def test_reports_in_two_folders_are_the_same(sample_bundle, tmp_path):
    """Page, sheet, plots and pictures, byte for byte; nothing else is left behind."""
    trees = []
    for name in ("a", "somewhere else/b"):
        folder = tmp_path / name
        folder.mkdir(parents=True)
        page.write_report(sample_bundle, folder)
        trees.append({p.name: p.read_bytes() for p in folder.iterdir()})
    assert trees[0] == trees[1]
    assert {name for name in trees[0] if not name.endswith(".png")} == {
        "report.html", "setup-sheet.html", "plot-deviation.svg", "plot-curvature.svg", "plot-cusp-map.svg", "plot-cusp.svg",
            "plot-feed-setup-1.svg"}
    assert str(tmp_path).encode() not in trees[0]["report.html"]
