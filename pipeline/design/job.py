"""The job: everything that verification needs beside the files themselves, as it stands in manifest.json.

`cuspline verify` reads it back, so a folder of outputs can be judged again anywhere.
"""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydantic import Field, model_serializer

from cuspline.design import FacePredicate, Finish, Setup
from cuspline.design.dimensions import Dimension
from cuspline.design.edge_breaks import EdgeBreak
from cuspline.design.engravings import Engraving
from cuspline.design.fixtures import fixtures_beside
from cuspline.design.setup_alignment import refixtured_setups
from cuspline.design.stock import Stock
from cuspline.design.tabs import Tab
from cuspline.shop.cutters import ToolLibrary
from cuspline.shop.cutting_forces import CuttingForce
from cuspline.shop.hole_forces import HoleForce
from cuspline.shop.machines import Machine
from cuspline.shop.materials import Material
from cuspline.shop.threads import Thread
from cuspline.shop.tool_lives import ToolLife
from cuspline.values.errors import InputError
from cuspline.values.input_files import checked, json_of
from cuspline.values.models import FileName, Model, WrittenName

OPTIONAL = ("threads", "dimensions", "tabs", "engravings", "edge_breaks", "worn_mm", "force", "life", "hole_force")
HEADER_DIGITS = 20          # of a job's SHA-256 in a program's header: a line of 40 characters holds it


class PostedFile(Model):
    """One setup's program on disk: a file, or a numbered set that is run file after file."""

    setup: Setup
    program: WrittenName = Field(description="file name, of a set the first")
    continued: tuple[WrittenName, ...] = Field(default=(), description="files of the set that follow, in order")

    @property
    def files(self):
        """All file names in the order in which they are run."""
        return (self.program, *self.continued)


class Job(Model):
    """What the posted programs of one design are judged against."""

    design: FileName
    step: WrittenName
    material: str
    cutting_data: Material | None = Field(default=None, description="of the material; None: what cuspline knows of it")
    predicates: tuple[FacePredicate, ...]
    stock: Stock
    finish: Finish
    machine: Machine
    posted: tuple[PostedFile, ...]
    smallest_ball_radius_mm: float = Field(gt=0)
    accepted: tuple[str, ...] = ()
    threads: dict[str, Thread] = Field(default={}, description="of holes, by the names of their faces")
    dimensions: tuple[Dimension, ...] = Field(default=(), description="with tolerances, judged on the simulated stock")
    tabs: tuple[Tab, ...] = Field(default=(), description="that contours leave")
    engravings: tuple[Engraving, ...] = Field(default=(), description="grooves that the solid does not have")
    edge_breaks: tuple[EdgeBreak, ...] = Field(default=(), description="edges broken that the solid has sharp")
    worn_mm: dict[str, float] = Field(default={}, description="by which radii in D registers may be smaller than the cutters', by "
                                      "the names of operations whose contours the control shifts")
    force: CuttingForce | None = Field(default=None, description="the shop's own of the material; None: what cuspline knows of it")
    life: ToolLife | None = Field(default=None, description="the same of tool life")
    hole_force: HoleForce | None = Field(default=None, description="the same of drills and taps")

    @model_serializer(mode="wrap")
    def _without_what_it_has_not(self, dump):
        return {k: v for k, v in dump(self).items() if k not in OPTIONAL or v}

    @property
    def program_names(self):
        """File names of all programs, each once, in the order in which they are run."""
        return tuple(dict.fromkeys(name for item in self.posted for name in item.files))

    def beside(self, folder):
        """The same, the files of its stock and fixtures found in a folder."""
        return self.model_copy(update={"stock": self.stock.beside(folder), "posted": tuple(
            p.model_copy(update={"setup": fixtures_beside(p.setup, folder)}) for p in self.posted)})

    def placed(self, measured):
        """The same programs on a part that lies as its measured markers say (`setup_alignment.read_measured`).

        In an indexed position the rotary axes stand as posted: a part that lies turned is seen from so much beside.
        """
        setups = refixtured_setups([p.setup for p in self.posted], measured)
        return self.model_copy(update={"posted": tuple(
            p.model_copy(update={"setup": _turned_as_posted(p.setup, s)}) for p, s in zip(self.posted, setups))})


def _turned_as_posted(posted, lies):
    """A Setup that lies otherwise than it was posted for; of an indexed position the axes as the machine still turns to them."""
    if not lies.indexed or lies.clamped_x is None:
        return lies
    axis = lambda v: tuple(lies.clamped_frame.turn_out(posted.clamped_frame.turn_into(np.array([v])))[0].tolist())
    return lies.model_copy(update={"wcs_x": axis(posted.wcs_x), "wcs_z": axis(posted.wcs_z)})


def read_job(folder):
    """The Job in a folder's manifest.

    Raises:
        InputError: no manifest, or one without a job that can be used.
    """
    path = Path(folder) / "manifest.json"
    if not path.exists():
        raise InputError(f"{path} does not exist: verify a folder that `cuspline build` has made")
    document = json_of(path, "manifest")
    job = document.get("job") if isinstance(document, dict) else None
    if job is None:
        raise InputError(f"{path}: no usable job: the folder holds no program; build it to --stage gcode or further")
    return checked(Job, job, f"{path}: no usable job")


@dataclass(frozen=True, kw_only=True)
class Published:
    """What a manifest says of the files beside it, and of its own job; empty where it does not say."""

    files: dict = field(default_factory=dict)           # file name -> SHA-256
    job: dict = field(default_factory=dict)             # as it stands in the manifest
    job_fields: dict = field(default_factory=dict)      # field of the job -> SHA-256

    def of_programs(self, names, job, table):
        """The same for some of a Job's programs and what they need; `table`: the control's tool table, None: it has none."""
        needed = {job.step, "tools.json", table, *names}
        return Published(files={name: digest for name, digest in self.files.items() if name in needed}, job=self.job,
                         job_fields=self.job_fields)


def read_published(folder):
    """Published, out of a folder's manifest."""
    path = Path(folder) / "manifest.json"
    document = json_of(path, "manifest") if path.exists() else {}
    part = lambda name: found if isinstance(document, dict) and isinstance(found := document.get(name), dict) else {}
    return Published(files=part("files"), job=part("job"), job_fields=part("job_sha256"))


def digest_of(document):
    """SHA-256 of a job, or of one field of it, as it stands in a manifest; the order of keys does not count.

    >>> digest_of({"a": 1.0, "b": [2]}) == digest_of({"b": [2], "a": 1.0})
    True
    """
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def job_line(digest):
    """The comment line of a program that says which job it was posted for; of "" one of the same length.

    >>> job_line("")
    'JOB SHA-256 00000000000000000000'
    """
    return f"JOB SHA-256 {digest[:HEADER_DIGITS] or '0' * HEADER_DIGITS}"


def read_tools(folder):
    """{number: Tool} from tools.json.

    Raises:
        InputError: missing or broken.
    """
    path = Path(folder) / "tools.json"
    if not path.exists():
        raise InputError(f"{path} does not exist: without the tools a program cannot be judged")
    return {t.number: t for t in checked(ToolLibrary, json_of(path, "tools"), str(path)).tools}
