import gc
import os
import sys
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.append(str(Path(__file__).parent / "parts"))       # for known_parts, built_parts

from built_parts import NARROW, built_once, saddle_job  # noqa: E402
from durations import (  # noqa: E402, F401
    pytest_addoption,
    pytest_collection_modifyitems,
    pytest_configure,
    pytest_fixture_setup,
    pytest_runtest_makereport,
    pytest_runtest_setup,
    pytest_sessionfinish,
    pytest_terminal_summary,
)

from cuspline.app.entry import SELDOM  # noqa: E402

# what make and CI tell what they run, and no test is to hear
for outer in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "PARAMS", "ARGS", "CUSPLINE_REVISION"):
    os.environ.pop(outer, None)

gc.set_threshold(SELDOM, 20, 20)        # as the command does


def pytest_collection_finish():
    gc.freeze()             # thousands of tests and all that they import are not looked through for cycles again


settings.register_profile("same", derandomize=True, deadline=None)     # a red run can be repeated
settings.register_profile("search", derandomize=False, deadline=None)  # what it finds goes into the test as an @example
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))


@pytest.fixture(scope="session")
def default_part(tmp_path_factory):
    """Output folder of the default part, but narrow, verified; not to be edited."""
    return built_once(tmp_path_factory, "default", "z_profile", "-p", NARROW, "--stage", "verify")


@pytest.fixture(scope="session")
def wide_default_part(tmp_path_factory):
    """Output folder of the default part wide enough for passes that begin and end apart, posted; not to be edited."""
    return built_once(tmp_path_factory, "whole", "z_profile", "-p", "width_mm=36", "--stage", "gcode")


@pytest.fixture(scope="session")
def default_part_in_inches(tmp_path_factory):
    """The same for the machine set to inches, posted; not to be edited."""
    return built_once(tmp_path_factory, "inch", "z_profile", "-p", NARROW, "--machine", "mill_3axis_inch",
                      "--stage", "gcode")


@pytest.fixture(scope="session")
def saddle(tmp_path_factory):
    """Outputs of a small STEP part with a job file; not to be edited."""
    job = saddle_job(tmp_path_factory.mktemp("saddle"))
    return built_once(tmp_path_factory, "saddle", job, "--stage", "verify")
