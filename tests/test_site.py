"""The site of the documentation: every link leads somewhere, every part that a guide shows is a design."""

import html
import importlib.util
import json
import re
from pathlib import Path

import pytest

from cuspline.app import catalogue
from cuspline.kernel import brep
from cuspline.shop.cutters import ToolLibrary
from cuspline.shop.machines import Machine

ROOT = Path(__file__).parents[1]
GUIDES = sorted((ROOT / "docs" / "guides").glob("*.md"))
PARTS = [(path.stem, k, text) for path in GUIDES
         for k, text in enumerate(re.findall(r"```python\n(.*?)```", path.read_text(), re.S))]
JOBS = [(path.stem, k, text) for path in GUIDES for k, text in enumerate(re.findall(r"```toml\n(.*?)```", path.read_text(), re.S))]


@pytest.fixture(scope="module")
def site():
    spec = importlib.util.spec_from_file_location("site_of_docs", ROOT / "docs" / "site.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made(site, tmp_path_factory):
    """A site whose gallery has one part that was published, and none that was rejected."""
    base = tmp_path_factory.mktemp("site")
    for name, is_ok in (("good_part", True), ("bad_part-rejected", False)):
        (folder := base / "outputs" / name).mkdir(parents=True)
        (folder / "verify.json").write_text(json.dumps({
            "ok": is_ok, "gouge_max_mm": 0.001, "cusp_max_mm": 0.009, "points_checked": 1200}))
        (folder / "iso.png").write_bytes(b"picture")
        (folder / "report.html").write_text("<p>report")
    site.main(base / "out", base / "outputs")
    return base / "out"


def test_every_list_of_the_command_line_and_every_document_is_a_page(made):
    assert {p.relative_to(made).as_posix() for p in made.glob("guides/*.html")} == {f"guides/{p.stem}.html" for p in GUIDES}
    strategies = (made / "reference" / "strategies.html").read_text()
    assert "constant_scallop" in strategies and "scallop_mm" in strategies
    assert "mill_trunnion_ac" in (made / "reference" / "machines.html").read_text()
    findings = (made / "findings.html").read_text()
    assert 'id="rapid_through_stock"' in findings
    assert json.loads((made / "schemas" / "verify.schema.json").read_text())


def test_every_key_of_a_machine_and_of_a_tool_library_stands_in_a_table_with_what_it_takes(made):
    for name, model in (("machine", Machine), ("tools", ToolLibrary)):
        page = (made / "reference" / f"{name}-files.html").read_text()
        for part, keys in {model.__name__: model.model_json_schema(), **model.model_json_schema()["$defs"]}.items():
            assert all(f"<td><code>{key}</code></td>" in page for key in keys.get("properties", {})), part
    page = (made / "reference" / "machine-files.html").read_text()
    row = lambda key: re.search(rf"<tr><td><code>{key}</code></td><td>(.*?)</td><td>(.*?)</td><td>", page).groups()
    assert row("decimals_deg") == ("integer ≥ 2 ≤ 7", "4") and row("swivel_record")[1] == "null"
    assert row("program_store_bytes") == ("integer > 0", "must be there") and row("control")[0] == '<a href="#control">Control</a>'
    assert '"TRAORI"' in html.unescape(row("tip_control")[0])


def test_the_gallery_shows_what_was_published_alone(made):
    text = (made / "gallery.html").read_text()
    assert "good_part" in text and "bad_part" not in text and "gouge 0.0010 mm, cusp 0.0090 mm, 1,200 points" in text
    assert (made / "gallery" / "good_part" / "iso.png").read_bytes() == b"picture"


@pytest.mark.parametrize("link, is_dead", [
    ("other.html", False), ("other.html#there", False), ("#here", False), ("https://example.org/gone", False),
    ("gone.html", True), ("other.html#gone", True), ("#gone", True), ("pictures/gone.png", True)])
def test_a_dead_link_is_found(site, tmp_path, link, is_dead):
    (tmp_path / "page.html").write_text(f'<h1 id="here">A</h1><a href="{link}">x</a>')
    (tmp_path / "other.html").write_text('<h2 id="there">B</h2>')
    assert site.dead_links(tmp_path) == ([f"page.html: {link}"] if is_dead else [])


def test_a_page_with_a_dead_link_stops_the_site_and_the_old_one_stays(site, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "index.html").write_text("old")
    bad = site.Page(path="index.html", source="README.md", group="", title="t", body='<a href="docs/gone.md">x</a>')
    monkeypatch.setattr(site, "written_pages", lambda: [bad])
    monkeypatch.setattr(site, "reference_pages", lambda: [])
    with pytest.raises(site.DeadLink, match="index.html: files/docs/gone.md"):
        site.main(tmp_path / "out", tmp_path / "outputs")
    assert (tmp_path / "out" / "index.html").read_text() == "old"


@pytest.mark.parametrize("page, k, text", PARTS, ids=[f"{p}-{k}" for p, k, _ in PARTS])
def test_a_part_of_a_guide_is_a_design_whose_predicates_match(page, k, text, tmp_path):
    (tmp_path / "shown.py").write_text(text)
    design = catalogue.make_design(catalogue.find_design(str(tmp_path / "shown.py")), [])
    faces = brep.faces_of(brep.the_solid(design.solid))
    assert design.predicates and all(brep.select_faces(faces, p) for p in design.predicates)


@pytest.mark.parametrize("page, k, text", JOBS, ids=[f"{p}-{k}" for p, k, _ in JOBS])
def test_a_job_file_of_a_guide_is_refused_for_its_missing_step_alone(page, k, text, tmp_path):
    (tmp_path / "shown.toml").write_text(text)
    with pytest.raises(catalogue.InputError, match=r"insert\.step does not exist"):
        catalogue.make_design(catalogue.find_design(str(tmp_path / "shown.toml")), [])
