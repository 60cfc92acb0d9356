"""A build that takes no time, for the bookkeeping of sweeps: figures that follow from the parameters, in the files of a build."""

import json
import os
import signal
from dataclasses import dataclass
from pathlib import Path

from cuspline.app.outcome import Result
from cuspline.values.errors import InputError


@dataclass(frozen=True, kw_only=True)
class StubRequest:
    """As request.Request is used by a variant."""

    parameters: tuple = ()
    out: Path | None = None
    deadly: tuple = ()          # (parameter, value, folder): the process that builds this kills itself, as often as files are there

    def built(self):
        values = dict(text.split("=") for text in self.parameters)
        self._die(values)
        a, b = float(values["a"]), float(values["b"])
        if a == 3.0:
            raise InputError("a cannot be 3")
        folder = self.out.with_name(f"{self.out.name}-rejected") if b == 4.0 and a == 2.0 else self.out
        folder.mkdir(parents=True, exist_ok=True)
        plan = {"setups": [{"name": "setup-1", "time_s": 60 / a, "operations": [
            {"name": "finish", "stepover_mm": a / 3, "candidates": [{"tool": 1}]}]}]}
        verify = {"ok": folder == self.out, "cusp_max_mm": a * b / 1000, "error_bound_mm": None, "findings": []}
        for name, document in (("plan", plan), ("verify", verify), ("manifest", {})):
            (folder / f"{name}.json").write_text(json.dumps(document))
        return None, Result(folder=folder, is_ok=verify["ok"], findings=())

    def _die(self, values):
        if self.deadly and values[self.deadly[0]] == self.deadly[1]:
            for file in sorted(Path(self.deadly[2]).iterdir())[:1]:
                file.unlink()
                os.kill(os.getpid(), signal.SIGKILL)


def stub_solid(request, send):
    """What a part's file says, in no time."""
    text = request.design.read_text()
    if "wrong" in text:
        raise InputError(f"{request.design.name} cannot be loaded")
    return {"words": text, "svg": f"<svg>{text}</svg>"}


def stub_build(request, send):
    """A build that takes long, unless the part's file says quick; a crash where it says so."""
    text = request.design.read_text()
    send("stage", "plan setup-1")
    send("draft", {"words": f"draft of {text}"})
    if "crash" in text:
        os.kill(os.getpid(), signal.SIGKILL)
    if "quick" not in text:
        signal.pause()
    folder = request.design.parent / "outputs"
    folder.mkdir(exist_ok=True)
    (folder / "report.html").write_text(f"<p>{text}")
    return {"words": f"VERIFIED {text}", "folder": str(folder)}
