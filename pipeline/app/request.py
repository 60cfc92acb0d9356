"""What a build was asked for, in names and files: the command line, Python and sweeps all make their orders of it."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from cuspline.app import catalogue
from cuspline.app.build import DRAFT, STAGES, Order, build
from cuspline.app.operation_values import PREFIX, with_values
from cuspline.app.outcome import refuse_unknown_kinds
from cuspline.design import Design
from cuspline.design.fixtures import fixtures_beside
from cuspline.kernel import brep
from cuspline.shop.machines import Machine
from cuspline.values.errors import InputError
from cuspline.values.frames import box_corners
from cuspline.values.models import shortened

REVISION = "CUSPLINE_REVISION"      # of the environment: CI states it; it stands in header, manifest and report


@dataclass(frozen=True, kw_only=True)
class Request:
    """A design and what it is to be made with; None: as `cuspline build` chooses without a word."""

    design: object                                  # a name, a file, or a Design
    parameters: Mapping | tuple = ()                # {name: value}, or ("name=value", ...)
    machine: object = None                          # a name, a TOML file, or a Machine
    post: str | None = None
    cutters: object = None                          # a JSON file
    shop: object = None                             # a TOML file
    measured: object = None                         # a CSV file
    out: object = None                              # a folder
    stage: str = "report"
    draft: bool = False                             # a first look into `<out>-draft` instead of the stages behind the program
    accept: tuple = ()

    def order(self):
        """build.Order of it.

        Raises:
            InputError: something that is named is not there, or is wrong; DesignError: the design cannot be made.
        """
        if self.stage not in STAGES:
            raise InputError(f"--stage {self.stage!r}: it must be one of {', '.join(STAGES)}")
        if self.draft and self.stage != STAGES[-1]:
            raise InputError(f"--draft with --stage {self.stage}: a draft ends with its own look at the program: leave one of "
                             "them out")
        refuse_unknown_kinds(self.accept)
        source = None if isinstance(self.design, Design) else catalogue.find_design(str(self.design))
        if self.machine is not None:
            _machine_of(self.machine)               # a wrong name is told before the part is built
        practice, parameters = self._of_the_shop()
        values, parameters = self._of_operations(parameters)
        made = _as_it_stands(self.design, parameters) if source is None else catalogue.make_design(source, parameters)
        made = with_values(made, values)
        if self.measured is not None:
            from cuspline.design.setup_alignment import read_measured, refixtured_setups
            made = replace(made, setups=refixtured_setups(made.setups, read_measured(self.measured), partial(_farthest_of, made)))
        chosen = catalogue.with_post(_machine_of(self.machine if self.machine is not None else made.machine), self.post)
        chosen = catalogue.held_to(chosen, made.finish.gouge_mm)
        library = catalogue.find_library(self.cutters).with_tools(made.tools)
        spare = tuple(catalogue.SMALLER) if self.cutters is None else ()
        out = Path(self.out) if self.out is not None else Path("outputs") / made.name
        if self.draft:
            if not made.setups:
                raise InputError(f"--draft: design {made.name} has no setup, so no program to look at: leave it out")
            out = out.parent / f"{out.name}-{DRAFT}"
        return Order(source=source, design=made, machine=chosen, library=library, spare=spare, shop=practice,
                     accepted=tuple(sorted(set(self.accept))), out=out,
                     last_stage=DRAFT if self.draft else self.stage, revision=_revision())

    def _of_the_shop(self):
        """(ShopFile, the design's own parameters)."""
        if isinstance(self.parameters, Mapping):
            return catalogue.find_shop(self.shop, [])[0], self.parameters
        return catalogue.find_shop(self.shop, self.parameters)

    @staticmethod
    def _of_operations(parameters):
        """([("name", "value"), ...] of operations, the design's own parameters)."""
        if isinstance(parameters, Mapping):
            own = [(n.removeprefix(PREFIX), v) for n, v in parameters.items() if n.startswith(PREFIX)]
            return own, {n: v for n, v in parameters.items() if not n.startswith(PREFIX)}
        return catalogue.assigned_to(PREFIX, parameters)

    def built(self, say=lambda text: None):
        """(Order, outcome.Result): see `build`."""
        order = self.order()
        return order, build(order, say)


def _farthest_of(design, setups):
    """(8 k, 3) corners of the boxes round the faces that some setups cut."""
    faces = brep.faces_of(brep.the_solid(design.solid, f"design {design.name}"))
    names = dict.fromkeys(name for s in setups for name in s.faces)
    boxes = [brep.bounding_box_mm(f.shape) for f in brep.named_faces(faces, design.predicates, tuple(names))]
    return np.vstack([box_corners(low, high) for low, high in boxes])


def _revision():
    """The repository's revision as the environment states it.

    Raises:
        InputError: it is none that a comment of every control can hold.
    """
    stated = os.environ.get(REVISION, "")
    if not re.fullmatch(r"[0-9A-Za-z._+-]{0,64}", stated):
        raise InputError(f"{REVISION} {shortened(stated)}: write up to 64 letters, digits and . _ + - of a revision")
    return stated


def _machine_of(machine):
    return machine if isinstance(machine, Machine) else catalogue.find_machine(str(machine))


def _as_it_stands(design, parameters):
    """A Design that was made already; files of its stock and fixtures are looked for in the folder that is worked in."""
    if parameters:
        raise InputError(f"design {design.name} is made already: give the parameters {', '.join(map(str, parameters))} to the "
                         "function that makes it")
    here = Path.cwd()
    return replace(design, stock=design.stock.beside(here), setups=tuple(fixtures_beside(s, here) for s in design.setups))
