"""How long tests take: recorded in tests/durations.json, so that the longest begin first and a fast run leaves them out.

A whole `make test ARGS=--record-durations` writes the file anew.  A fixture's time counts for every test that needs it.
"""

import json
import time
from collections import defaultdict
from pathlib import Path

import pytest

FILE = Path(__file__).parents[1] / "durations.json"
KEPT_S = 0.05           # shorter ones are not written down
FAST_S = 0.4            # a fast run takes tests up to this, their fixtures included
FIXTURES = "fixtures_s"


def pytest_addoption(parser):
    parser.addoption("--fast", action="store_true", help=f"leave out tests that take longer than {FAST_S} s")
    parser.addoption("--record-durations", action="store_true", help=f"write tests/{FILE.name} anew")


def pytest_configure(config):
    if config.getoption("--record-durations") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Record())


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    begin = time.perf_counter()
    try:
        return (yield)
    finally:
        known = request.config.stash.setdefault(_TOOK, {})
        known[fixturedef.argname] = max(known.get(fixturedef.argname, 0.0), time.perf_counter() - begin)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    report = yield
    if report.when == "call":
        known = item.config.stash.get(_TOOK, {})
        report.user_properties.append((FIXTURES, sum(known.get(name, 0.0) for name in item.fixturenames)))
    return report


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Modules that take longest first; with --fast no test that takes long."""
    took = json.loads(FILE.read_text()) if FILE.exists() else {}
    if config.getoption("--fast"):
        slow = [i for i in items if took.get(i.nodeid, 0.0) > FAST_S]
        config.hook.pytest_deselected(items=slow)
        items[:] = [i for i in items if took.get(i.nodeid, 0.0) <= FAST_S]
    modules = defaultdict(float)
    for item in items:
        modules[item.nodeid.partition("::")[0]] += took.get(item.nodeid, 0.0)
    items.sort(key=lambda item: -modules[item.nodeid.partition("::")[0]])


_TOOK = pytest.StashKey()


class _Record:
    """Of the process that gets all reports."""

    def __init__(self):
        self.took = {}

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            self.took[report.nodeid] = report.duration + dict(report.user_properties).get(FIXTURES, 0.0)

    def pytest_sessionfinish(self):
        rounded = {name: round(s, 1) for name, s in sorted(self.took.items()) if s >= KEPT_S}
        FILE.write_text(json.dumps(rounded, indent=0) + "\n")
