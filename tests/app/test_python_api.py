"""`cuspline.build` and `cuspline.outputs`: what the command line does, with values for answers."""

import json
import subprocess
import sys
import tomllib
import types
from dataclasses import replace
from pathlib import Path

import pytest
from eight_operations import JOB

import cuspline
from cuspline.app import catalogue
from cuspline.app.documents import DOCUMENTS, FILES, Document, schema_of
from cuspline.kernel.stl_files import read_stl
from cuspline.values.errors import InputError

ROOT = Path(__file__).parents[2]
TROUGH = ROOT / "pipeline/app/repository/trough.py"


def test_importing_cuspline_imports_nothing_that_takes_time():
    heavy = ("OCP", "cadquery", "build123d", "numba", "matplotlib", "pydantic", "numpy")
    code = f"import sys, cuspline; cuspline.build; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The small trough, planned from Python, by its file."""
    return cuspline.build(TROUGH, out=tmp_path_factory.mktemp("api") / "trough", stage="plan", depth_mm=1.5)


def test_a_build_from_python_is_that_of_the_command_line(planned):
    manifest = json.loads((planned.folder / "manifest.json").read_text())
    assert planned.manifest.parameters == manifest["parameters"] and planned.manifest.parameters["depth_mm"] == 1.5
    assert [o.name for o in planned.plan.setups[0].operations] == ["rough", "finish"]
    assert planned.time_s == json.loads((planned.folder / "plan.json").read_text())["setups"][0]["time_s"]
    assert (planned.verdict, planned.program, planned.stock, planned.findings, planned.is_verified) == (None, {}, None, (), False)


def test_the_header_of_an_inch_machines_program_is_in_inches(tmp_path):
    """But for parameters, whose names say mm."""
    text = cuspline.build(TROUGH, stage="gcode", machine="mill_3axis_inch", out=tmp_path / "inch").program["setup-1"]
    for line in ("MACHINE mill_3axis_inch, UNITS INCH; LENGTHS IN THIS HEADER IN INCHES, BUT FOR PARAMETERS AND WHAT SAYS MM",
                 "STOCK aluminium_6061: X0.0000 Y0.0000 Z0.0000 TO X0.9449 Y0.3937 Z0.5118", "PARAMETER length_mm = 24.0",
                 "SCALLOP 0.000787 PROFILE TOLERANCE 0.000157 GOUGE 0.000197 PATH TOLERANCE 0.000039",
                 "T5 ball 16 mm, D0.6299 R0.315, STICK-OUT 2.1654, ER25 collet chuck, LENGTH 4.5276"):
        assert f"\n({line})\n" in text, line


def test_a_design_that_was_made_already_is_built_as_it_is(planned, tmp_path):
    made = catalogue.make_design(catalogue.find_design(str(TROUGH)), {"depth_mm": 1.5})
    assert cuspline.build(made, out=tmp_path / "trough", stage="step").step.read_bytes() == planned.step.read_bytes()
    with pytest.raises(InputError, match="made already: give the parameters depth_mm to the function that makes it"):
        cuspline.build(made, out=tmp_path / "trough", stage="step", depth_mm=1.5)


@pytest.mark.parametrize("wrong, words", [
    ({"stage": "all"}, "must be one of step, plan"), ({"machine": "lathe"}, "no machine 'lathe'"), ({"dept_mm": 2}, "depth_mm"),
    ({"accept": ["gauge"]}, "gouge"), ({"depth_mm": 99}, "depth_mm")])
def test_what_is_wrong_is_refused_in_a_sentence_before_anything_is_made(wrong, words, tmp_path):
    with pytest.raises(InputError, match=words):
        cuspline.build(TROUGH, out=tmp_path / "trough", **wrong)
    assert list(tmp_path.iterdir()) == []


def test_the_verdict_is_verify_json_in_typed_values(default_part):
    result, said = cuspline.outputs(default_part), json.loads((default_part / "verify.json").read_text())
    assert result.is_verified and result.verdict.ok is said["ok"] is True
    for name in ("gouge_max_mm", "cusp_p99_mm", "error_bound_mm", "points_checked", "excess_proven_mm"):
        assert getattr(result.verdict, name) == said[name]
    assert [s.setup for s in result.verdict.setups] == [s["setup"] for s in said["setups"]]
    assert result.program == {"setup-1": (default_part / "setup-1.ngc").read_text()}
    assert result.stock.path == default_part / said["stock"][-1]["file"]
    assert len(result.stock.mesh()[1]) == len(read_stl(result.stock.path)[1]) > 100


def test_a_folder_without_outputs_is_refused(tmp_path):
    with pytest.raises(InputError, match="it has no manifest.json"):
        cuspline.outputs(tmp_path)


def test_a_spoilt_verdict_is_refused_with_its_key(planned, tmp_path):
    for name, text in (("manifest.json", (planned.folder / "manifest.json").read_text()), ("verify.json", '{"ok": "perhaps"}')):
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="verify.json: .*ok"):
        cuspline.outputs(tmp_path)


# showing ---------------------------------------------------------------------------------------


def test_where_nothing_can_be_shown_a_sentence_says_where_the_report_is(planned, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ocp_vscode", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    planned.show()
    assert capsys.readouterr().out == f"trough: no report, files in {planned.folder.resolve()}\n"
    (tmp_path / "report.html").write_text("<p>")
    replace(planned, folder=tmp_path).show()
    assert capsys.readouterr().out == f"report: {(tmp_path / 'report.html').resolve()}\n"


def test_a_notebook_shows_the_report_within_its_page(planned, tmp_path, monkeypatch):
    shell = types.SimpleNamespace(config={"IPKernelApp": {}})
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    assert planned.show()._repr_html_().startswith("<b>trough: no verdict</b><table>")
    (tmp_path / "report.html").write_text('<p class="a">ok</p>')
    assert 'srcdoc="&lt;p class=&quot;a&quot;&gt;ok' in replace(planned, folder=tmp_path).show()._repr_html_()


def test_the_viewer_gets_the_part_as_it_stands_in_step(planned, monkeypatch):
    shown, viewer = [], types.ModuleType("ocp_vscode")
    viewer.show = lambda *shapes, names, colors, alphas: shown.extend(zip(names, shapes, alphas))
    viewer.__spec__ = types.SimpleNamespace()
    monkeypatch.setitem(sys.modules, "ocp_vscode", viewer)
    planned.show()
    (name, shape, alpha), = shown
    assert name == "trough" and shape.Volume() == pytest.approx(24 * 10 * 12 - removed_mm3(24, 1.5) * 10, rel=1e-9)
    assert alpha == 1.0


def test_the_viewer_gets_the_simulated_stock_too(default_part, monkeypatch):
    shown, viewer = {}, types.ModuleType("ocp_vscode")
    viewer.show = lambda *shapes, names, colors, alphas: shown.update(zip(names, zip(shapes, alphas)))
    viewer.__spec__ = types.SimpleNamespace()
    monkeypatch.setitem(sys.modules, "ocp_vscode", viewer)
    outputs = cuspline.outputs(default_part)
    outputs.show()
    stock, alpha = shown[f"stock after {outputs.stock.operation}"]
    vertices, _ = outputs.stock.mesh()
    box = stock.BoundingBox()
    assert alpha < 1 and (box.xlen, box.ylen, box.zlen) == pytest.approx(tuple(vertices.max(0) - vertices.min(0)), abs=1e-3)


def removed_mm3(chord, depth):
    """Area of a circle's segment."""
    import math
    radius = (chord ** 2 / 4 + depth ** 2) / (2 * depth)
    angle = 2 * math.asin(chord / 2 / radius)
    return radius ** 2 / 2 * (angle - math.sin(angle))


# schemas ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*DOCUMENTS, *FILES])
def test_the_published_schema_is_that_of_the_code_and_needs_what_the_contract_promises(name):
    published = ROOT / f"docs/schemas/{name}.schema.json"
    assert published.read_text() == schema_of(name)
    schema = json.loads(published.read_text())
    promised = {"verify": {"ok", "gouge_max_mm", "excess_max_mm", "cusp_max_mm", "cusp_p99_mm", "gouge_volume_mm3",
                           "excess_volume_mm3", "error_bound_mm", "points_checked", "area_required_mm2", "area_reached_mm2",
                           "collisions", "findings", "setups"},
                "plan": {"design", "machine", "setups"}, "manifest": {"design", "parameters", "versions", "files", "inputs_sha256"},
                "machine": {"name", "x", "y", "z", "spindle", "control"}, "tools": {"tools"}, "shop": set(),
                "job": {"step", "material", "finish", "faces", "setups"}}
    assert promised[name] <= set(schema.get("required", ()))


def test_what_builds_write_holds_all_that_the_schemas_require(default_part, planned):
    """Against the schema as text, by no more than its keywords: required and properties, all the way down."""
    for folder, names in ((default_part, DOCUMENTS), (planned.folder, ("plan", "manifest"))):
        for name in names:
            schema = json.loads((ROOT / f"docs/schemas/{name}.schema.json").read_text())
            assert missing(schema, json.loads((folder / f"{name}.json").read_text()),
                           schema.get("$defs", {})) == []


def missing(schema, value, definitions, where=""):
    """Places of a document that lack a required key."""
    if "$ref" in schema:
        return missing(definitions[schema["$ref"].rpartition("/")[2]], value, definitions, where)
    if isinstance(value, list):
        return [m for k, item in enumerate(value) for m in missing(schema.get("items", {}), item, definitions, f"{where}[{k}]")]
    if not isinstance(value, dict):
        return []
    gone = [f"{where}.{key}" for key in schema.get("required", ()) if key not in value]
    return gone + [m for key, inner in schema.get("properties", {}).items() if key in value
                   for m in missing(inner, value[key], definitions, f"{where}.{key}")]


def test_the_files_that_ship_have_what_their_schemas_require_and_no_other_key():
    machine, tools = (json.loads((ROOT / f"docs/schemas/{name}.schema.json").read_text()) for name in ("machine", "tools"))
    files = [(machine, tomllib.loads(p.read_text())) for p in sorted((ROOT / "posts/machines").glob("*.toml"))]
    files.append((tools, json.loads((ROOT / "posts/tools/tools.json").read_text())))
    assert len(files) > 15
    for schema, value in files:
        assert missing(schema, value, schema["$defs"]) == []
        assert value.keys() <= schema["properties"].keys() and schema["additionalProperties"] is False
    assert missing(machine, {k: v for k, v in files[0][1].items() if k != "spindle"}, machine["$defs"]) == [".spindle"]


def test_a_job_file_has_what_its_schema_asks_of_every_strategy_and_tool_axis():
    schema = json.loads((ROOT / "docs/schemas/job.schema.json").read_text())
    parts = schema["$defs"]
    kinds = {parts[row["$ref"].rpartition("/")[2]]["properties"]["kind"]["const"]: parts[row["$ref"].rpartition("/")[2]]
             for name in ("Operation", "ToolAxis") for row in parts[name]["oneOf"]}
    job = tomllib.loads(JOB)
    assert missing(schema, job, parts) == [] and job.keys() <= schema["properties"].keys()
    operations = [o for setup in job["setups"] for o in setup["operations"]]
    assert len(operations) >= 8 and all(o.keys() <= kinds[o["kind"]]["properties"].keys() for o in operations)
    assert {"lead_tilt", "thread_mill", "auto"} <= kinds.keys()
    assert all(part["additionalProperties"] is False for part in kinds.values())


def test_documents_are_frozen():
    assert all(model.model_config["frozen"] for model in (Document, *DOCUMENTS.values()))
