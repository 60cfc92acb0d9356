"""Tests that ask a program of somebody else are skipped, with one message, where it cannot be had."""

import functools

import pytest

from .linuxcnc import controller, interpreter, kinematics

REASONS = {"linuxcnc": functools.cache(interpreter.missing), "controller": functools.cache(controller.missing),
           "kinematics": functools.cache(kinematics.missing)}


def pytest_runtest_setup(item):
    for marker, reason in REASONS.items():
        if item.get_closest_marker(marker) and reason():
            pytest.skip(reason())
