"""`cuspline sweep`: variants of a design built side by side; what stands is not built again, figures go into one table.

A variant's outputs are in <out>/variants/<values>/, its row in <out>/rows/<values>.json: written by whoever has built it, as the
last thing, so that a sweep that is ended at any moment goes on where it was.  The table hangs on the rows alone, not on who has
built them or in which order.
"""

import csv
import hashlib
import io
import json
import os
import random
import re
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from cuspline.values.errors import CamError, InputError
from cuspline.values.models import shortened

MOST_VARIANTS = 100_000
LONGEST_NAME = 60               # characters of a folder's name that say the values; a checksum stands for longer ones
RANGE = re.compile(r"^([^:]+):([^:]+):(\d+)$")
NEARLY_A_RANGE = re.compile(r"^[-+.\d]+(:[-+.\d]+){1,2}$")
FILES_OF_DESIGNS = (".py", ".csv", ".toml", ".json", ".step", ".stp", ".stl")
VERIFIED, REJECTED, MADE, REFUSED, FAULT = "verified", "rejected", "made", "refused", "fault"
STANDS = (VERIFIED, REJECTED, MADE, REFUSED)        # of rows that need no other try
NAMES = ("name", "what", "setup", "operation", "kind")      # of rows in a document, that are better than their numbers
LEFT_OUT = {"candidates", "findings", "collisions", "holder", "head", "advice", "text", "block", "sha256", "inputs_sha256"}


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One build of a sweep; it goes to a process of its own."""

    number: int                             # from 0, in the order of the grid
    values: tuple[tuple[str, str], ...]     # (parameter, value as text)
    request: object                         # request.Request, its folder absolute
    row_file: Path
    inputs_sha256: str                      # of all that decides the row, but what the design's functions look up elsewhere

    @property
    def name(self):
        return self.row_file.stem

    def row(self):
        """The row that stands; None: it has to be built."""
        try:
            document = json.loads(self.row_file.read_text())
        except (OSError, ValueError):
            return None
        row = document["row"]
        stands = document["inputs_sha256"] == self.inputs_sha256 and row["verdict"] in STANDS
        is_there = row["folder"] is None or (self.row_file.parents[1] / row["folder"] / "manifest.json").is_file()
        return row if stands and is_there else None

    def failed(self, verdict, why):
        """Write the row of a variant that has no outputs."""
        return self.written({"values": dict(self.values), "verdict": verdict, "why": why, "folder": None, "figures": {}})

    def written(self, row):
        """Write the row; the last thing that is done."""
        self.row_file.parent.mkdir(parents=True, exist_ok=True)
        beside = self.row_file.with_suffix(f".{os.getpid()}.part")
        beside.write_text(json.dumps({"inputs_sha256": self.inputs_sha256, "row": row}, indent=1) + "\n")
        os.replace(beside, self.row_file)
        return row


# the grid --------------------------------------------------------------------------------------


def axis_of(text):
    """(name, values as texts) of a=1:5:9 (nine values from 1 to 5), b=2,4 or c=3.

    >>> axis_of("a=1:2:5"), axis_of("way=parallel,spiral")
    (('a', ('1', '1.25', '1.5', '1.75', '2')), ('way', ('parallel', 'spiral')))

    Raises:
        InputError: it is of no such form.
    """
    name, equals, values = text.partition("=")
    if not equals or not name.strip() or not values.strip():
        raise InputError(f"-p {shortened(text)} is not of the form name=value, name=value,value or name=from:to:count")
    if found := RANGE.match(values.strip()):
        return name.strip(), _spaced(text, *found.groups())
    if NEARLY_A_RANGE.match(values.strip()):
        raise InputError(f"-p {shortened(text)}: a range is name=from:to:count, with a whole count of 2 or more")
    several = tuple(v.strip() for v in values.split(","))
    if "" in several or len(set(several)) < len(several):
        raise InputError(f"-p {shortened(text)}: a value is empty or stands twice; write each once, between commas")
    return name.strip(), several


def _spaced(text, first, last, count):
    try:
        low, high, count = float(first), float(last), int(count)
    except ValueError:
        raise InputError(f"-p {shortened(text)}: from and to must be numbers: name=from:to:count") from None
    if not 2 <= count <= MOST_VARIANTS or low == high:
        raise InputError(f"-p {shortened(text)}: name=from:to:count needs two ends that differ and a count of 2 to "
                         f"{MOST_VARIANTS:,}")
    return tuple(f"{low + (high - low) * k / (count - 1):.12g}" for k in range(count))


def grid(texts, sample=None):
    """All combinations of the axes, each a tuple of (name, value); a sample: so many of them, always the same ones.

    Raises:
        InputError: an axis stands twice, or there are too many.
    """
    axes = [axis_of(text) for text in texts]
    names = [name for name, _ in axes]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise InputError(f"-p {twice[0]} is given twice; write all its values in one")
    count = 1
    for _, values in axes:
        count *= len(values)
    if sample is None and count > MOST_VARIANTS:
        raise InputError(f"{count:,} variants: at most {MOST_VARIANTS:,} are built; take fewer values, or --sample some of them")
    chosen = range(count) if sample is None or sample >= count else sorted(random.Random(0).sample(range(count), sample))
    return [_combination(axes, k) for k in chosen]


def _combination(axes, number):
    """One of all combinations, the last axis changing first."""
    values = []
    for name, several in reversed(axes):
        number, k = divmod(number, len(several))
        values.append((name, several[k]))
    return tuple(reversed(values))


def variants(request, texts, sample, out):
    """Variant values of a sweep.

    Args:
        request: request.Request of what stays the same.   texts: of -p.   sample: see `grid`.   out: folder of the sweep.
    """
    out, common, request = Path(out).resolve(), _inputs(request), _anywhere(request)
    made = []
    for number, values in enumerate(grid(texts, sample)):
        name = folder_name(values)
        own = replace(request, parameters=(*request.parameters, *(f"{n}={v}" for n, v in values)), out=out / "variants" / name)
        digest = hashlib.sha256(f"{common}\n{values}".encode()).hexdigest()
        made.append(Variant(number=number, values=values, request=own, inputs_sha256=digest,
                            row_file=out / "rows" / f"{name}.json"))
    return made


def _anywhere(request):
    """The same, its files found from any folder."""
    paths = {name: getattr(request, name) for name in ("design", "machine", "cutters", "shop", "measured")}
    return replace(request, **{name: Path(path).resolve() for name, path in paths.items()
                               if path is not None and Path(path).is_file()})


def folder_name(values):
    """A folder's name that says the values.

    >>> folder_name((("depth_mm", "1.5"), ("way", "spiral"))), folder_name((("table", "a/b.csv"),))
    ('depth_mm=1.5+way=spiral', 'table=a_b.csv+15ce51')
    """
    text = "+".join(f"{name}={value}" for name, value in values) or "default"
    plain = re.sub(r"[^A-Za-z0-9_.=+-]", "_", text)[:LONGEST_NAME]
    return plain if plain == text else f"{plain}+{hashlib.sha256(text.encode()).hexdigest()[:6]}"


def _inputs(request):
    """SHA-256 of what all variants share: the code, the design's folder, machine, tools, shop, stage."""
    from cuspline.app import catalogue
    from cuspline.values.checkpoints import code_sha256
    source = catalogue.find_design(str(request.design))
    beside = [p for p in sorted(source.path.parent.rglob("*"))
              if p.suffix.lower() in FILES_OF_DESIGNS and p.is_file() and not {"outputs", ".venv", ".git"} & set(p.parts)]
    files = [Path(f) for f in (request.machine, request.post, request.cutters, request.shop, request.measured)
             if f is not None and Path(f).is_file()]
    digest = hashlib.sha256(f"{code_sha256()} {source.name} {request.parameters} {request.machine} {request.post} {request.stage} "
                            f"{sorted(request.accept)}".encode())
    if request.cutters is not None and not Path(request.cutters).is_file():
        digest.update(f"library {request.cutters}".encode())
    for path in (*beside, *files):
        digest.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


# one variant -----------------------------------------------------------------------------------


def built(variant):
    """Build a variant and write its row; whatever goes wrong stands in it."""
    try:
        _, result = variant.request.built()
    except CamError as error:
        return variant.failed(REFUSED, str(error))
    except Exception as error:          # of a user's own functions, of the CAD kernel
        return variant.failed(FAULT, f"{type(error).__name__}: {error}")
    other = result.folder.with_name(result.folder.name.removesuffix("-rejected")
                                    if result.folder.name.endswith("-rejected") else f"{result.folder.name}-rejected")
    shutil.rmtree(other, ignore_errors=True)        # of an earlier sweep, with other inputs
    is_judged = (result.folder / "verify.json").is_file()
    verdict = REJECTED if not result.is_ok else VERIFIED if is_judged else MADE
    why = "; ".join(dict.fromkeys(f.kind for f in result.findings))
    return variant.written({"values": dict(variant.values), "verdict": verdict, "why": why,
                            "folder": result.folder.relative_to(variant.row_file.parents[1]).as_posix(),
                            "figures": figures_of(result.folder)})


def figures_of(folder):
    """{name: figure} of plan.json, verify.json and solid.json: every number, text and truth, by where it stands."""
    found = {}
    for name in ("plan", "verify", "solid"):
        path = Path(folder) / f"{name}.json"
        if path.is_file():
            document = json.loads(path.read_text())
            found |= dict(_leaves(document, name))
            if name == "verify":
                found["verify.findings"] = len(document["findings"])
            if name == "plan":
                found["plan.time_s"] = round(sum(s["time_s"] for s in document["setups"]), 1)
    return found


def _leaves(value, path):
    """(path, value) of everything in a document that is no list or record."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in LEFT_OUT:
                yield from _leaves(inner, f"{path}.{key}")
    elif isinstance(value, list):
        names = [_name(item, k) for k, item in enumerate(value)]
        for k, item in enumerate(value):
            yield from _leaves(item, f"{path}.{names[k]}" if names.count(names[k]) == 1 else f"{path}.{names[k]}.{k}")
    elif value is not None:
        yield path, value


def _name(item, number):
    """What an item of a list is called."""
    return next((str(item[key]) for key in NAMES if isinstance(item, dict) and key in item), str(number))


# the table -------------------------------------------------------------------------------------


def table(rows):
    """(columns, lists of cells) of all rows, in their order; columns as they first turn up."""
    values = dict.fromkeys(name for row in rows for name in row["values"])
    figures = dict.fromkeys(name for row in rows for name in row["figures"])
    columns = [*values, "verdict", "why", "folder", *figures]
    cells = [[*(row["values"].get(n) for n in values), row["verdict"], row["why"], row["folder"],
              *(row["figures"].get(n) for n in figures)] for row in rows]
    return columns, cells


def csv_text(rows):
    """The table as CSV: empty where a variant has no such figure."""
    columns, cells = table(rows)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([["" if c is None else json.dumps(c) if isinstance(c, bool) else c for c in line] for line in cells])
    return text.getvalue()


def write_parquet(rows, path):
    """The table as Parquet, numbers as numbers.

    Raises:
        ImportError: pyarrow is not installed.
    """
    import pyarrow
    from pyarrow import parquet
    columns, cells = table(rows)
    arrays = [_column(list(column)) for column in zip(*cells)]
    parquet.write_table(pyarrow.table([pyarrow.array(a) for a in arrays], names=columns), path)


def _column(values):
    """The same of one type: all numbers, all truths, else texts; numbers written as texts count as numbers."""
    there = [v for v in values if v is not None]
    for kinds, turn in ((bool, bool), ((int, float), float)):
        if there and all(isinstance(v, kinds) and (kinds is bool or not isinstance(v, bool)) for v in there):
            return [None if v is None else turn(v) for v in values]
    try:
        return [None if v is None else float(v) for v in values] if not any(isinstance(v, bool) for v in there) else [
            None if v is None else str(v) for v in values]
    except ValueError:
        return [None if v is None else str(v) for v in values]
