"""The machine moving in the report's view, in headless Chromium."""

import json

import chromium
import numpy as np
import pytest
from known_machines import FIVE_AXIS, random_joints

from cuspline.app.catalogue import find_machine
from cuspline.report.page import report_html

pytestmark = chromium.MARKS
PICTURE = "document.getElementById('canvas').toDataURL()"
TEXT = "document.getElementById('{}').textContent"


@pytest.fixture(scope="module")
def browser(machine_bundle, tmp_path_factory):
    page = tmp_path_factory.mktemp("report") / "report.html"
    page.write_text(report_html(machine_bundle, {}, [], ""))
    with chromium.viewing(page.as_uri(), tmp_path_factory.mktemp("profile")) as found:
        yield found
        assert found.errors == []


def shown(browser, script):
    browser.evaluate(f"{script}; 1")
    return browser.evaluate(PICTURE)


def read(browser, what):
    return browser.evaluate(TEXT.format(f"read-{what}")).split()


@pytest.mark.parametrize("name", FIVE_AXIS)
def test_links_stand_where_the_kinematics_put_them(browser, name):
    """Tip and axis in the part by the page's own chain, against the one that posts and readers use."""
    machine = find_machine(name)
    chain, length = machine.kinematics, 80.0
    joints = random_joints(chain, 5, seed=8)
    tips, axes = chain.forward(joints, length)
    links = chain.links
    meta = {"letters": chain.letters, "order": machine.chain, "direction": links.direction.tolist(),
            "pivot": links.pivot.tolist(), "isRotary": links.is_rotary.tolist()}
    degrees = np.hstack([joints[:, :3], np.degrees(joints[:, 3:])]).tolist()
    ends = [(-length * chain.spindle).tolist(), ((1 - length) * chain.spindle).tolist()]
    found = np.array(browser.evaluate(
        f"(() => {{ const m = {json.dumps(meta)}; return {json.dumps(degrees)}.map(q => {{ const s = MachineChain.stand(m, q); "
        f"const seen = MachineChain.times(MachineChain.inverse(s.part), s.nose); "
        f"return {json.dumps(ends)}.map(p => MachineChain.apply(seen, p)); }}); }})()"))
    assert np.abs(found[:, 0] - tips).max() < 1e-9
    assert np.abs(found[:, 1] - found[:, 0] - axes).max() < 1e-9


def test_part_or_machine_stands(browser):
    part = shown(browser, "__view.setStands('part'); __view.seek(0.3)")
    machine = shown(browser, "__view.setStands('machine'); __view.seek(0.3)")
    later = shown(browser, "__view.seek(0.9)")
    whole = shown(browser, "__view.setRegion('machine'); __view.showView('iso'); __view.seek(0.9)")
    assert len({part, machine, later, whole}) == 4
    again = "__view.setRegion('work'); __view.set({bodies: false}); __view.setStands('part'); __view.seek(0.3)"
    assert shown(browser, again) == part


def test_time_runs_through_both_positions(browser):
    browser.evaluate("__view.seek(0.25); 1")
    assert read(browser, "joints")[-4:] == ["A", "0.000", "C", "0.000"] and read(browser, "operation")[0] == "setup-1:"
    browser.evaluate("__view.seek(0.75); 1")
    assert read(browser, "joints")[-4:] == ["A", "-90.000", "C", "0.000"] and read(browser, "operation")[0] == "leaning:"
    assert browser.evaluate("document.getElementById('setup').value") == "1"


def test_a_chosen_position_shows_its_end(browser):
    browser.evaluate("__view.chooseSetup(0).then(() => 1)")
    assert 0.4 < browser.evaluate("__view.state.fraction") < 0.5 and read(browser, "joints")[-3] == "0.000"
    browser.evaluate("__view.chooseSetup(1).then(() => 1)")
    assert browser.evaluate("__view.state.fraction") == 1


def test_the_machine_shows_its_joints_and_the_line(browser, machine_bundle):
    """At the end of the line that a finding names, the axes as they stand there."""
    motion = machine_bundle.machine.motions[0]
    row = 700
    finding = json.dumps({"setup": "setup-1", "line": int(motion.line[row]), "file": "", "place": None})
    browser.evaluate(f"__view.goToFinding({finding}).then(() => 1)")
    assert read(browser, "line") == ["line", str(motion.line[row])]
    x, y, z = (float(read(browser, "joints")[k]) for k in (2, 4, 6))
    assert [x, y, z] == pytest.approx(motion.joints[row, :3].tolist(), abs=0.02)      # a millisecond at 900 mm/min


def test_a_finding_in_the_table_leads_to_its_block(browser, machine_bundle):
    browser.evaluate("__view.seek(1); 1")
    buttons = "[...document.querySelectorAll('[data-finding]')]"
    browser.evaluate(f"{buttons}.find(b => JSON.parse(b.dataset.finding).line === 711).click(); 1")
    browser.wait_for(TEXT.format("read-line") + " === 'line 711'")
    assert browser.evaluate("__view.state.setup") == 0


def test_it_fits_a_phone(browser):
    browser.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
    across = browser.evaluate("document.documentElement.scrollWidth")
    stage, bar = (browser.evaluate(f"document.getElementById('{which}').offsetHeight") for which in ("stage", "time"))
    browser.call("Emulation.clearDeviceMetricsOverride")
    assert across == 390 and bar < 0.5 * stage
