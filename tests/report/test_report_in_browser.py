"""The finished report in headless Chromium, over file://, asking nobody for anything."""

from dataclasses import replace

import chromium
import numpy as np
import pytest

from cuspline.report.page import report_html, write_report

pytestmark = chromium.MARKS
PICTURE = "document.getElementById('canvas').toDataURL()"
DISTINCT_COLOURS = """(() => {
  const gl = document.getElementById('canvas').getContext('webgl2'), w = gl.drawingBufferWidth, h = gl.drawingBufferHeight;
  const pixels = new Uint8Array(4 * w * h); gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return new Set(new Uint32Array(pixels.buffer)).size; })()"""


@pytest.fixture(scope="module")
def report(two_setup_bundle, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write_report(two_setup_bundle, folder)
    return (folder / "report.html").as_uri()


@pytest.fixture(scope="module")
def browser(report, tmp_path_factory):
    with chromium.viewing(report, tmp_path_factory.mktemp("profile")) as found:
        yield found


def shown(browser, script):
    browser.evaluate(f"{script}; 1")
    return browser.evaluate(PICTURE)


def test_it_asks_nobody_and_complains_of_nothing(browser, report):
    assert [r for r in browser.requests if not r.startswith("data:")] == [report]
    assert browser.errors == []


def test_the_view_shows_something(browser):
    assert browser.evaluate("document.body.className") == ""
    assert browser.evaluate(DISTINCT_COLOURS) > 100


def test_seeking_there_and_back_gives_the_same_picture(browser):
    direct = shown(browser, "__view.seek(0.5)")
    start, end = shown(browser, "__view.seek(0)"), shown(browser, "__view.seek(1)")
    shown(browser, "__view.seek(0)")
    assert shown(browser, "__view.seek(0.5)") == direct
    assert len({direct, start, end}) == 3


@pytest.mark.parametrize("change", ["surface: 'deviation'", "surface: 'design'", "surface: 'rest'", "paths: 'all'",
                                    "paths: 'all', pathColour: 'feed'", "paths: 'all', pathColour: 'depth_mm'",
                                    "paths: 'done', rapids: false", "stockEdges: true", "fixtures: true", "edges: false",
                                    "cutter: false", "yaw: 0.3"])
def test_every_choice_changes_the_picture(browser, change):
    plain = "__view.showView('iso'); __view.set({surface: 'stock', paths: 'none', pathColour: 'operation', rapids: true, " \
            "stockEdges: false, fixtures: false, edges: true, cutter: true}); __view.seek(0.6)"
    before = shown(browser, plain)
    assert shown(browser, f"__view.set({{{change}}})") != before
    assert shown(browser, plain) == before
    assert browser.errors == []


def test_where_nothing_stands_nothing_is_drawn(sample_bundle, tmp_path):
    """All of the map at its bottom from the first move on: stock by its own colour and by material left are one picture."""
    setup = sample_bundle.setups[0]
    cells = np.arange(setup.replay.nx * setup.replay.ny)
    gone = replace(setup.replay, event_move=np.zeros(len(cells), int), event_cell=cells,
                   event_z_mm=np.full(len(cells), setup.replay.bottom_mm))
    write_report(replace(sample_bundle, setups=(replace(setup, replay=gone),)), tmp_path)
    with chromium.viewing((tmp_path / "report.html").as_uri(), tmp_path / "profile") as browser:
        assert len({shown(browser, f"__view.set({{surface: '{name}'}})") for name in ("stock", "rest")}) == 1
        assert browser.errors == []


def test_the_path_is_coloured_by_what_the_edges_meet(browser):
    """Chosen in the list; the scale says up to what."""
    offered = browser.evaluate("[...document.getElementById('path-colour').options].map(o => o.text).join()")
    assert offered == "by operation,by feed,by depth of cut"
    coloured = shown(browser, "__view.set({paths: 'all', pathColour: 'depth_mm'})")
    assert coloured != shown(browser, "__view.set({pathColour: 'feed'})")
    browser.evaluate("const list = document.getElementById('path-colour'); list.value = 'depth_mm'; "
                     "list.onchange({target: list}); 1")
    assert browser.evaluate("document.getElementById('path-high').textContent") == "2.5 mm"
    assert browser.evaluate("document.getElementById('path-grey').hidden") is False
    browser.evaluate("__view.set({paths: 'none', pathColour: 'operation'}); 1")


def test_the_read_out_is_in_the_wcs(browser):
    browser.evaluate("__view.seek(0); 1")
    read = browser.evaluate("document.getElementById('read-tip').textContent")
    assert read.split() == ["G54", "X", "0.000", "Y", "0.000", "Z", "8.000"]


def test_keys_and_chapters_move_time(browser):
    browser.evaluate("__view.seek(0); document.getElementById('view').focus(); 1")
    for event in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=event, key="End", code="End", windowsVirtualKeyCode=35)
    assert browser.evaluate("__view.state.fraction") == 1
    browser.evaluate("document.querySelectorAll('#chapters button')[1].click(); 1")
    assert 0 < browser.evaluate("__view.state.fraction") < 0.5


def test_another_setup_can_be_chosen(browser):
    browser.evaluate("__view.chooseSetup(1).then(() => 1)")
    browser.evaluate("__view.seek(0); 1")
    assert browser.evaluate("document.getElementById('read-tip').textContent").startswith("G55  X  -60.000")
    browser.evaluate("__view.chooseSetup(0).then(() => 1)")
    assert browser.errors == []


FIRST_SCREENS = {"desktop": (1280, 800, 0.45), "phone": (390, 844, 0.40)}      # width, height, share of it for the part


@pytest.mark.parametrize("screen", FIRST_SCREENS)
@pytest.mark.parametrize("findings", [0, 1, 12])
def test_the_first_screen_shows_the_verdict_and_the_part(browser, sample_bundle, refused_bundle, report, tmp_path,
                                                         screen, findings):
    rows = [{**refused_bundle.verify["findings"][k % 2], "line": k, "advice": "retract first, then go on " * 9}
            for k in range(findings)]
    bundle = replace(sample_bundle, verify={**sample_bundle.verify, "ok": not rows, "findings": rows})
    (tmp_path / "report.html").write_text(report_html(bundle, {}, [], ""))
    width, height, share = FIRST_SCREENS[screen]
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
    browser.open((tmp_path / "report.html").as_uri())
    headline, top, bottom = (browser.evaluate(f"document.querySelector('{which}').getBoundingClientRect().{side}")
                             for which, side in (("h1", "bottom"), ("#canvas", "top"), ("#canvas", "bottom")))
    across = browser.evaluate("document.documentElement.scrollWidth")
    browser.call("Emulation.clearDeviceMetricsOverride")
    browser.open(report)
    assert 0 < headline < top and bottom <= height and bottom - top >= share * height and across == width


def test_without_webgl_the_pictures_stand_in(report, tmp_path):
    with chromium.Browser(tmp_path, flags=("--disable-3d-apis",)) as browser:
        browser.open(report)
        assert browser.errors == []
        assert "no-view" in browser.evaluate("document.body.className")
        assert "no WebGL2" in browser.evaluate("document.getElementById('view-message').innerText")
        assert browser.evaluate("document.getElementById('view').offsetHeight") == 0
        picture = "document.querySelector('#pictures img')"
        if browser.evaluate(f"{picture} !== null"):
            browser.wait_for(f"{picture}.complete")
            assert browser.evaluate(f"{picture}.naturalWidth > 1000 && {picture}.offsetWidth > 600")
