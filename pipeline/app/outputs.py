"""A folder of outputs as a value: the verdict in numbers, plan, programs, stock; shown in a notebook or a viewer."""

from __future__ import annotations

import html
import importlib.util
import os
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from cuspline.app.documents import FindingRow, ManifestDocument, PlanDocument, VerifyDocument
from cuspline.values.errors import InputError
from cuspline.values.input_files import checked, json_of

if TYPE_CHECKING:
    import numpy as np

REPORT, HEIGHT_PX = "report.html", 720
PART_COLOUR, STOCK_COLOUR, SEEN_THROUGH = "#8d99ae", "#c9a66b", 0.5     # in a viewer
SHOWN = (("gouge", "gouge_max_mm", "mm"), ("cusp", "cusp_max_mm", "mm"), ("error bound", "error_bound_mm", "mm"),
         ("area reached", "area_reached_mm2", "mm²"), ("of required", "area_required_mm2", "mm²"))


@dataclass(frozen=True, kw_only=True)
class StockFile:
    """The stock after an operation."""

    path: Path                  # STL, part coordinates
    setup: str
    operation: str
    volume_mm3: float

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """(vertices (v, 3) in mm, triangles (t, 3))."""
        from cuspline.kernel.stl_files import read_stl
        return read_stl(self.path)


@dataclass(frozen=True)
class Outputs:
    """What a build has left in a folder; its files are read when they are looked at."""

    folder: Path

    @cached_property
    def manifest(self) -> ManifestDocument:
        """documents.ManifestDocument."""
        return self._document("manifest.json", ManifestDocument)

    @cached_property
    def verdict(self) -> VerifyDocument | None:
        """documents.VerifyDocument: verify.json; None where the build ended before."""
        return self._document("verify.json", VerifyDocument)

    @cached_property
    def plan(self) -> PlanDocument | None:
        """documents.PlanDocument: plan.json; None where there is none."""
        return self._document("plan.json", PlanDocument)

    @property
    def design(self) -> str:
        """The design's name."""
        return self.manifest.design

    @property
    def is_verified(self) -> bool:
        """Whether there is a verdict, and it is good."""
        return self.verdict is not None and self.verdict.ok

    @property
    def findings(self) -> tuple[FindingRow, ...]:
        """Of the verdict, those that were accepted too; none where there is no verdict."""
        return () if self.verdict is None else self.verdict.findings

    @cached_property
    def program(self) -> dict[str, str]:
        """{setup: text of its program}; the files of a set stand one after the other."""
        return {setup: "".join(self.texts[name] for name in names) for setup, names in self.programs.items()}

    @cached_property
    def programs(self) -> dict[str, tuple[str, ...]]:
        """{setup: names of its files}; positions of a setup are in the program of their setup."""
        found: dict[str, tuple[str, ...]] = {}
        for posted in (self._job or {"posted": ()})["posted"]:
            names = (posted["program"], *posted["continued"])
            if names not in found.values():
                found[posted["setup"]["name"]] = names
        return found

    @cached_property
    def texts(self) -> dict[str, str]:
        """{file name: text} of every program."""
        return {name: (self.folder / name).read_text() for names in self.programs.values() for name in names}

    @cached_property
    def stocks(self) -> tuple[StockFile, ...]:
        """StockFile after every operation, in the order of cutting."""
        return () if self.verdict is None else tuple(
            StockFile(path=self.folder / s.file, setup=s.setup, operation=s.operation, volume_mm3=s.volume_mm3)
            for s in self.verdict.stock)

    @property
    def stock(self) -> StockFile | None:
        """StockFile after the last operation; None where nothing was simulated."""
        return self.stocks[-1] if self.stocks else None

    @property
    def time_s(self) -> float | None:
        """At the machine, tool changes with it, by the feed model; None without a plan."""
        return None if self.plan is None else round(sum(s.time_s for s in self.plan.setups), 1)

    @property
    def step(self) -> Path:
        """Path of the part's STEP file."""
        return self.folder / f"{self.design}.step"

    @property
    def report(self) -> Path | None:
        """Path of the report; None where the build ended before."""
        return path if (path := self.folder / REPORT).is_file() else None

    def show(self) -> object:
        """The report in a notebook; the part in the OCP viewer, where it is installed; else a sentence that says where
        the report is.

        Returns:
            what a notebook displays; None elsewhere.
        """
        if _is_notebook():
            return _Html(self._repr_html_() if self.report is None else _frame(self.report))
        if importlib.util.find_spec("ocp_vscode") is not None:
            return self._in_viewer()
        print(f"report: {self.report.resolve()}" if self.report else f"{self.design}: no report, files in {self.folder.resolve()}")
        return None

    def _in_viewer(self):
        """The part in grey, the stock after the last operation beside it, see-through, where it was simulated."""
        import cadquery
        import ocp_vscode

        from cuspline.kernel import brep
        from cuspline.kernel.stl_files import face_of_stl
        shown = [(self.design, brep.the_solid(brep.read_step(self.step)), PART_COLOUR, 1.0)]
        if self.stock is not None:
            shown.append((f"stock after {self.stock.operation}", face_of_stl(self.stock.path), STOCK_COLOUR, SEEN_THROUGH))
        names, shapes, colours, alphas = zip(*shown)
        ocp_vscode.show(*map(cadquery.Shape.cast, shapes), names=list(names), colors=list(colours), alphas=list(alphas))

    def _repr_html_(self):
        """The verdict as a table."""
        word = "no verdict" if self.verdict is None else "VERIFIED" if self.verdict.ok else "REJECTED"
        rows = [] if self.verdict is None else [(name, _number(getattr(self.verdict, key)), unit) for name, key, unit in SHOWN]
        if self.time_s is not None:
            rows.append(("time", f"{self.time_s / 60:.1f}", "min"))
        rows += [(f.kind, f"{f.amount_mm:.4f}", f.advice) for f in self.findings]
        cells = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
        return f"<b>{html.escape(self.design)}: {word}</b><table>{cells}</table>"

    @cached_property
    def _job(self):
        return json_of(self.folder / "manifest.json", "manifest").get("job")

    def _document(self, name, model):
        path = self.folder / name
        return checked(model, json_of(path, name), str(path)) if path.is_file() else None


class _Html(str):
    """Text that a notebook shows as HTML."""

    def _repr_html_(self):
        return str(self)


def read_outputs(folder: str | os.PathLike[str]) -> Outputs:
    """Outputs of a folder that `cuspline build` has made.

    Raises:
        InputError: it is none.
    """
    folder = Path(folder)
    if not (folder / "manifest.json").is_file():
        raise InputError(f"{folder} is no folder of outputs: it has no manifest.json; name one that `cuspline build` has made")
    found = Outputs(folder)
    found.manifest, found.verdict, found.plan      # read now: a spoilt file is refused here
    return found


def _is_notebook():
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and "IPKernelApp" in shell.config


def _frame(report):
    """A page within a page; it holds all that it needs."""
    return (f'<iframe srcdoc="{html.escape(report.read_text(), quote=True)}" width="100%" height="{HEIGHT_PX}" '
            'style="border:0"></iframe>')


def _number(value):
    return "unknown" if value is None else f"{value:.4f}"
