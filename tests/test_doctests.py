"""The examples in docstrings are true."""

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {"pipeline": "cuspline", "designs": "cuspline.designs", "posts": "cuspline.posts"}


def modules_with_examples():
    for folder, package in PACKAGES.items():
        for path in sorted((ROOT / folder).rglob("*.py")):
            if ">>> " in path.read_text():
                yield ".".join([package, *path.relative_to(ROOT / folder).with_suffix("").parts])


@pytest.mark.parametrize("name", sorted(modules_with_examples()))
def test_examples_are_true(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0
