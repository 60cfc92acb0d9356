"""plan.json, verify.json and manifest.json as typed values; what other programs rely on, published as JSON schemas.

More may stand in a file than is named here; what is named here stands in it.  Lengths in mm, times in s.
"""

import json
from importlib import import_module

from pydantic import BaseModel, ConfigDict, Field

SCHEMA = "https://json-schema.org/draft/2020-12/schema"
Place = tuple[float, float, float]


class Document(BaseModel):
    """Frozen; unknown keys are passed over, so that a file of a later version can be read."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class FindingRow(Document):
    """One thing wrong with a program."""

    kind: str = Field(description="one of `cuspline findings`")
    amount_mm: float = Field(description="how much; 0 where a length makes no sense")
    place_mm: Place | None = Field(description="part coordinates")
    operation: str = Field(description="empty where it belongs to none")
    line: int = Field(description="of the posted text; 0 unknown")
    setup: str
    advice: str = Field(description="how to fix it")
    accepted: bool = Field(default=False, description="whether the program was published in spite of it")


class Figures(Document):
    """What a setup, or all together, came to."""

    ok: bool = Field(description="no finding that was not accepted by name")
    gouge_max_mm: float = Field(description="deepest cut below the design, measured")
    gouge_proven_mm: float | None = Field(description="no move cuts deeper, proven; null: not proven")
    excess_max_mm: float = Field(description="highest material left where a cutter reaches, measured")
    excess_proven_mm: float | None = Field(description="nothing stands higher, proven; null: not proven")
    cusp_max_mm: float = Field(description="highest cusp")
    cusp_p99_mm: float = Field(description="99 % of the cusps are no higher")
    error_bound_mm: float | None = Field(description="of the amounts measured; null: unknown")
    gouge_volume_mm3: float
    gouge_volume_bound_mm3: float
    excess_volume_mm3: float
    excess_volume_bound_mm3: float
    points_checked: int
    area_required_mm2: float
    area_reached_mm2: float
    area_unreachable_mm2: float
    collisions: tuple[FindingRow, ...]
    findings: tuple[FindingRow, ...]


class SetupFigures(Figures):
    """The same of one setup, or of one indexed position."""

    setup: str


class StockRow(Document):
    """The stock after an operation, as the posted text leaves it."""

    setup: str
    operation: str
    file: str = Field(description="STL file beside this one")
    volume_mm3: float
    sha256: str


class DimensionRow(Document):
    """One dimension of one feature, as measured on the simulated stock."""

    name: str
    kind: str = Field(description="diameter, distance, position or chamfer")
    place_mm: Place = Field(description="part coordinates")
    nominal_mm: float
    lower_mm: float = Field(description="limits")
    upper_mm: float
    least_mm: float = Field(description="of all points that were probed")
    most_mm: float
    fitted_mm: float = Field(description="of the circle, axis or plane through them")
    points: int
    ok: bool


class RegionRow(Document):
    """The faces of one name, after all setups."""

    name: str
    area_required_mm2: float
    area_reached_mm2: float
    area_unreachable_mm2: float
    why: str = Field(description="some of it cannot be reached; empty: all can")
    cusp_max_mm: float
    cusp_p99_mm: float
    gouge_max_mm: float


class TabRow(Document):
    """A tab that a contour was to leave, as it stands after its setup."""

    setup: str
    operation: str
    place_mm: Place = Field(description="the middle of its foot, part coordinates")
    width_mm: float
    height_mm: float
    standing_mm: float = Field(description="least height that stands in its narrowest part")
    ok: bool


class EdgeBreakRow(Document):
    """Edges that an operation was to break, as its posted moves break them."""

    setup: str
    operation: str
    width_mm: float = Field(description="stated: the longer leg")
    least_mm: float = Field(description="narrowest place that is broken")
    most_mm: float
    places: int = Field(description="along the edges, that were looked at")
    ok: bool


class CompensationRow(Document):
    """The walls again, cut by worn cutters whose radii, as measured, stand in their registers."""

    radii_mm: dict[str, float] = Field(description="by the names of the registers, the smallest that their operations allow")
    gouge_max_mm: float
    excess_max_mm: float


class VerifyDocument(Figures):
    """verify.json: the verdict in numbers."""

    tabs: tuple[TabRow, ...] = Field(default=(), description="wanted left, no excess")
    edge_breaks: tuple[EdgeBreakRow, ...] = Field(default=(), description="of edges that the solid has sharp")
    compensation: CompensationRow | None = Field(default=None, description="where the control shifts contours (G41)")
    dimensions: tuple[DimensionRow, ...] = Field(default=(), description="that the design states with limits")

    setups: tuple[SetupFigures, ...]
    accepted: tuple[str, ...] = Field(description="kinds of findings that were accepted by name")
    stock: tuple[StockRow, ...] = Field(description="in the order of cutting")
    regions: tuple[RegionRow, ...] = Field(default=(), description="of the names of faces that setups cut")


class ToolRow(Document):
    """A tool as an operation uses it."""

    number: int
    name: str
    type: str
    diameter_mm: float
    corner_radius_mm: float = 0.0
    stick_out_mm: float


class CandidateRow(Document):
    """A cutter that was looked at."""

    tool: int
    name: str
    chosen: bool
    reason: str


class OperationRow(Document):
    """One operation of a plan."""

    name: str
    tool: ToolRow
    spindle_rpm: float
    feed_mm_per_min: tuple[float, float] = Field(description="slowest and fastest in the cut")
    blocks: int
    time_s: float
    length_mm: float
    stepover_mm: float | None = None
    candidates: tuple[CandidateRow, ...] = ()


class SetupPlanRow(Document):
    """One setup of a plan."""

    name: str
    operations: tuple[OperationRow, ...]
    time_s: float = Field(description="tool changes with it")
    tool_changes: int | None = Field(default=None, description="that the program posts: none for a tool that is in already")
    clearance_z_mm: float
    area_required_mm2: float
    area_reached_mm2: float


class PlanDocument(Document):
    """plan.json: per operation the cutter, why it was chosen, stepover, feeds and time."""

    design: str
    machine: str
    material: str
    min_concave_radius_mm: float | None = Field(description="null: nothing is concave")
    setups: tuple[SetupPlanRow, ...]
    not_needed: tuple[str, ...] = Field(default=(), description="indexed positions of the design whose faces others have cut")


class ManifestDocument(Document):
    """manifest.json: what the outputs were made of, and a SHA-256 of every file."""

    design: str
    stage: str
    inputs_sha256: str
    revision: str | None = Field(default=None, description="of the repository, where the environment stated it")
    parameters: dict[str, object]
    machine: str
    accepted: tuple[str, ...]
    left_out: str
    versions: dict[str, str]
    files: dict[str, str] = Field(description="file name: SHA-256")


DOCUMENTS = {"plan": PlanDocument, "verify": VerifyDocument, "manifest": ManifestDocument}


# files that users write: where their models are, which reading outputs needs none of
FILES = {"machine": ("cuspline.shop.machines", "Machine"), "tools": ("cuspline.shop.cutters", "ToolLibrary"),
         "job": ("cuspline.app.catalogue", "JobFile"), "shop": ("cuspline.shop.practice", "ShopFile")}


def schema_of(name):
    """The JSON schema of one of DOCUMENTS or FILES, as text."""
    model = DOCUMENTS[name] if name in DOCUMENTS else getattr(import_module(FILES[name][0]), FILES[name][1])
    schema = model.model_json_schema(mode="validation")
    return json.dumps({"$schema": SCHEMA, **(_with_strategies(schema) if name == "job" else schema)}, indent=1) + "\n"


def _with_strategies(schema):
    """A schema whose operations are one of the strategies each, by its `kind`, and their tool axes one of those."""
    from cuspline.design.operations import registered
    from cuspline.toolpaths.five_axis.tool_axes import REGISTERED as AXES
    return _one_of(_one_of(schema, "Operation", registered()), "ToolAxis", AXES)


def _one_of(schema, name, registered):
    """A schema whose part of that name is one of the models in {kind: model}, the `kind` beside its own keys."""
    parts, kinds = dict(schema["$defs"]), []
    for kind, model in sorted(registered.items()):
        own = model.model_json_schema(mode="validation")
        parts = {**own.pop("$defs", {}), **parts, model.__name__: {
            **own, "properties": {"kind": {"const": kind}, **own["properties"]}, "required": ["kind", *own.get("required", ())]}}
        kinds.append({"$ref": f"#/$defs/{model.__name__}"})
    return {**schema, "$defs": {**parts, name: {"title": name, "oneOf": kinds}}}
