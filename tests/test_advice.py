"""What errors and findings advise to change is something that their reader can set."""

import ast
import re
from pathlib import Path

import cuspline
from cuspline.design import Design, Finish, Setup
from cuspline.design.operations import registered
from cuspline.planning.strategies.auto import Auto
from cuspline.shop.cutters import Cutter, Holder, Tool
from cuspline.shop.machines import Machine
from cuspline.shop.practice import Practice

CODE = Path(cuspline.__file__).parent
ADVISED = re.compile(r"\b(?:reduce|lower|raise|increase|enlarge|correct|refine) (?:the )?`?([a-z]\w*_(?:mm|deg|rad|share))\b")


def _strings(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _names(model):
    """Keys of a model, and of the models within it."""
    fields = getattr(model, "model_fields", None) or getattr(model, "__dataclass_fields__", {})
    for name, field in fields.items():
        yield name
        inner = getattr(field, "annotation", None)
        if hasattr(inner, "model_fields"):
            yield from _names(inner)


def test_what_is_to_be_changed_can_be_set():
    settable = {n for m in (Design, Finish, Setup, Auto, *registered().values(), Cutter, Holder, Tool, Machine, Practice)
                for n in _names(m)} | {"min_mm", "max_mm"}                  # of a stock and of an axis
    advised = {(name, path.name) for path in sorted(CODE.glob("**/*.py")) for text in _strings(path)
               for name in ADVISED.findall(text)}
    assert len(advised) >= 2
    assert {(name, where) for name, where in advised if name not in settable} == set()
