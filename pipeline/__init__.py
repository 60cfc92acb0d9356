"""cuspline: from a parametric design to a posted and verified program.

    import cuspline
    result = cuspline.build("trough.py", depth_mm=8)
    result.verdict.gouge_max_mm, result.program["setup-1"], result.stock.path, result.findings
    result.show()
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cuspline.app.outputs import Outputs
    from cuspline.design import Design
    from cuspline.shop.machines import Machine

__version__ = "0.1.0"
__all__ = ["build", "outputs"]


def build(design: Design | str | os.PathLike[str], *, out: str | os.PathLike[str] | None = None, stage: str = "report",
          machine: Machine | str | os.PathLike[str] | None = None, cutters: str | os.PathLike[str] | None = None,
          shop: str | os.PathLike[str] | None = None, accept: Iterable[str] = (), **parameters: object) -> Outputs:
    """Build a design as `cuspline build` does: STEP, plan, program, simulation, verdict, report.

    CAD and kernels are imported by the first call, not by `import cuspline`.

    Args:
        design: a name of `cuspline designs`, a .py file, a .toml job file, or a Design.
        out: folder for the outputs; left out: outputs/<design>.  It is replaced whole.
        stage: the last one: step, plan, gcode, verify or report.
        machine: a name of `cuspline machines`, its TOML file, or a Machine; left out: the design's own.
        cutters: tool library (JSON).   shop: the shop's own values (TOML).
        accept: kinds of findings to publish with.
        parameters: of the design, by name; those left out keep their defaults.
    Returns:
        Outputs: .verdict (verify.json as typed values; None before that stage), .plan, .program {setup: text}, .stock (STL after
        the last operation), .findings, .folder, .time_s, .show().  A program with a finding is not published: .folder is then
        <out>-rejected, and .is_verified False.
    Raises:
        cuspline.values.errors.CamError: the input or the plan is wrong; nothing is left half-written.
    """
    from cuspline.app.outputs import read_outputs
    from cuspline.app.request import Request
    _, result = Request(design=design, out=out, stage=stage, machine=machine, cutters=cutters, shop=shop, accept=tuple(accept),
                        parameters=parameters).built()
    return read_outputs(result.folder)


def outputs(folder: str | os.PathLike[str]) -> Outputs:
    """What an earlier build has left in a folder, as `build` returns it.

    Raises:
        cuspline.values.errors.InputError: it is no folder of outputs.
    """
    from cuspline.app.outputs import read_outputs
    return read_outputs(folder)
