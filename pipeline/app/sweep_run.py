"""A sweep from its axes to its table: what stands is taken over, the rest is built, rows are written as they come."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from cuspline.app import sweep, sweep_page, sweep_workers
from cuspline.app.catalogue import find_design
from cuspline.app.operation_values import PREFIX
from cuspline.app.outcome import refuse_unknown_kinds
from cuspline.values.amounts import counted
from cuspline.values.errors import InputError

CUSP, TIME = sweep_page.CUSP, sweep_page.TIME
TABLES = ("sweep.csv", "sweep.parquet", "index.html")


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What is to be built."""

    request: object                 # request.Request: what all variants share
    texts: tuple                    # axes, as of -p
    sample: int | None
    out: Path

    def run(self, workers, scheduler, say):
        """Build what does not stand, write sweep.csv, sweep.parquet (where pyarrow is) and index.html.

        Args:
            workers: processes; None: one a core.   scheduler: address; None: processes here.   say: called with lines.
        Returns:
            exit status: 0 all verified or made, 1 something rejected, refused or at fault.
        Raises:
            InputError: an axis is wrong, or is no parameter of the design.
        """
        variants = self._checked()
        self._prepared()
        rows = {v.number: row for v in variants if (row := v.row()) is not None}
        missing = [v for v in variants if v.number not in rows]
        if rows:
            say(f"{counted(len(rows), 'variant')} of {len(variants)} stand already")
        try:
            for variant, row in self._built(missing, workers, scheduler):
                rows[variant.number] = row
                say(f"{len(rows)}/{len(variants)} {_in_words(row)}")
        finally:
            self._tidied()
        done = [rows[v.number] for v in variants]
        self._write(done, say)
        return 0 if all(r["verdict"] in (sweep.VERIFIED, sweep.MADE) for r in done) else 1

    def _checked(self):
        """The variants, once it is known that the design has the parameters."""
        refuse_unknown_kinds(self.request.accept)
        if self.request.out is not None:
            raise InputError("--out is given twice: it names the folder of the whole sweep")
        known = find_design(str(self.request.design)).parameters.model_fields
        variants = sweep.variants(self.request, self.texts, self.sample, self.out)
        for name, _ in variants[0].values:
            if name not in known and not name.startswith(("shop.", PREFIX)):
                raise InputError(f"-p {name}: the design has no such parameter; it has {', '.join(known) or 'none'}")
        return variants

    def _prepared(self):
        """The folder, where it is a sweep's or nothing is in it."""
        if self.out.exists() and (not self.out.is_dir() or any(self.out.iterdir()) and not (self.out / "rows").is_dir()):
            raise InputError(f"--out {self.out} exists and is no earlier sweep (it has no folder rows): name another folder")
        (self.out / "rows").mkdir(parents=True, exist_ok=True)

    def _tidied(self):
        """What builds that were ended have left goes; their rows are not there, so they are built again."""
        for half in (*self.out.glob("variants/.*.part"), *self.out.glob("rows/*.part")):
            shutil.rmtree(half, ignore_errors=True) if half.is_dir() else half.unlink(missing_ok=True)

    @staticmethod
    def _built(missing, workers, scheduler):
        if not missing:
            return ()
        if scheduler is not None:
            return sweep_workers.on_cluster(missing, scheduler)
        return sweep_workers.in_processes(missing, *sweep_workers.shares(workers))

    def _write(self, rows, say):
        """The tables and the page."""
        self._put("sweep.csv", sweep.csv_text(rows))
        self._put("index.html", sweep_page.page(self.out.name, rows, self.out))
        try:
            sweep.write_parquet(rows, self.out / "sweep.parquet")
            without = ""
        except ImportError:
            without = "; no sweep.parquet, which needs pyarrow: pip install pyarrow"
        say(f"{self.out}: sweep.csv, index.html{without}")

    def _put(self, name, text):
        """A file, whole or not at all."""
        beside = self.out / f".{name}.part"
        beside.write_text(text, encoding="utf-8")
        beside.replace(self.out / name)


def _in_words(row):
    """One row in a line."""
    values = " ".join(f"{n}={v}" for n, v in row["values"].items())
    figures = [f"{label} {row['figures'][key]:{form}}" for key, label, form in ((TIME, "s", ".1f"), (CUSP, "cusp", ".4f"))
               if key in row["figures"]]
    return ", ".join([f"{values}: {row['verdict']}", *figures]) + (f": {row['why']}" if row["why"] else "")
