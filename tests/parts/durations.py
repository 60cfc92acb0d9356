"""How long tests take: recorded in tests/durations.json, so that the longest begin first and a fast run leaves them out.

A whole `make test ARGS=--record-durations` writes the file anew: tests without what they share, and the fixtures that they
share.  A module takes as long as its tests and every fixture of theirs once; a fast run weighs a test alone, with all of its.
A run that must end in time, `--until`, begins with the shortest, says how many it did not come to, and fails where these are many.
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
NO_TIME = "not begun: the time was up"
MOST_LEFT = 0.4         # of the tests: a run that leaves more of them has failed


def pytest_addoption(parser):
    parser.addoption("--fast", action="store_true", help=f"leave out tests that take longer than {FAST_S} s")
    parser.addoption("--record-durations", action="store_true", help=f"write tests/{FILE.name} anew")
    parser.addoption("--until", type=float, metavar="SECONDS", help="since 1970: tests that would begin later are left out")


def pytest_configure(config):
    if config.getoption("--record-durations") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Record())


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    until = item.config.getoption("--until")
    if until is not None and time.time() > until:
        pytest.skip(NO_TIME)


def pytest_sessionfinish(session):
    told = session.config.pluginmanager.get_plugin("terminalreporter")
    told_of = sum(len(told.stats.get(what, ())) for what in ("passed", "failed", "skipped")) if told is not None else 0
    if told_of and len(_left_out(told)) > MOST_LEFT * told_of:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter):
    if left := _left_out(terminalreporter):
        terminalreporter.write_line(f"{len(left)} tests were {NO_TIME}; without --until all are run")


def _left_out(told):
    return [r for r in told.stats.get("skipped", ()) if NO_TIME in str(r.longrepr)]


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    begin = time.perf_counter()
    try:
        return (yield)
    finally:
        made = request.config.stash.setdefault(_MADE, [])
        made.append((_key(fixturedef, request.param_index), fixturedef.scope, time.perf_counter() - begin))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    report = yield
    if report.when == "call":
        made = item.config.stash.get(_MADE, [])
        report.duration += sum(s for _, scope, s in made if scope == "function")
        report.user_properties.append((FIXTURES, {key: s for key, scope, s in made if scope != "function"}))
        made.clear()
    return report


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Modules that take longest first, with --until last; with --fast no test that takes long."""
    known = Durations(**json.loads(FILE.read_text())) if FILE.exists() else Durations()
    needs = {item.nodeid: _shared(item) for item in items}
    if config.getoption("--fast"):
        is_fast = {name: known.alone_s(name, needs[name]) <= FAST_S for name in needs}
        config.hook.pytest_deselected(items=[i for i in items if not is_fast[i.nodeid]])
        items[:] = [i for i in items if is_fast[i.nodeid]]
    took = known.modules_s({item.nodeid: needs[item.nodeid] for item in items})
    items.sort(key=lambda item: took[_module(item.nodeid)], reverse=config.getoption("--until") is None)


class Durations:
    """Seconds that tests take by themselves, and what they share."""

    def __init__(self, tests=None, fixtures=None):
        self.tests, self.fixtures = tests or {}, fixtures or {}

    def alone_s(self, name, shared):
        """A test run alone; `shared`: the fixtures that it needs."""
        return self.tests.get(name, 0.0) + self._made_s(shared)

    def modules_s(self, needs):
        """{module: s} of tests {name: fixtures that it needs}, each fixture made once a module."""
        took, shared = defaultdict(float), defaultdict(set)
        for name, fixtures in needs.items():
            took[_module(name)] += self.tests.get(name, 0.0)
            shared[_module(name)].update(fixtures)
        return {module: s + self._made_s(shared[module]) for module, s in took.items()}

    def _made_s(self, fixtures):
        return sum(self.fixtures.get(key, 0.0) for key in fixtures)


def _module(name):
    return name.partition("::")[0]


def _key(fixturedef, param_index):
    """One name for a fixture, and for each of its parameters."""
    return f"{fixturedef.baseid}::{fixturedef.argname}" + (f"[{param_index}]" if fixturedef.params else "")


def _shared(item):
    """Keys of all fixtures of an item that outlive a test."""
    indices = item.callspec.indices if hasattr(item, "callspec") else {}
    found = getattr(item, "_fixtureinfo", None)         # a doctest has none
    return {_key(definitions[-1], indices.get(name, 0)) for name, definitions in found.name2fixturedefs.items()
            if definitions[-1].scope != "function"} if found else set()


_MADE = pytest.StashKey()


class _Record:
    """Of the process that gets all reports."""

    def __init__(self):
        self.tests, self.fixtures = {}, defaultdict(float)

    def pytest_runtest_logreport(self, report):
        if report.when == "call":
            self.tests[report.nodeid] = report.duration
            for key, s in dict(report.user_properties).get(FIXTURES, {}).items():
                self.fixtures[key] = max(self.fixtures[key], s)

    def pytest_sessionfinish(self):
        long = lambda took: {name: round(s, 1) for name, s in sorted(took.items()) if s >= KEPT_S}
        FILE.write_text(json.dumps({"fixtures": long(self.fixtures), "tests": long(self.tests)}, indent=0) + "\n")
