"""The documentation as a folder of plain files that any browser opens: `make site`.

Its pages are the README, docs/ and bench/RESULTS.md; references, which are the command line's own lists; and a gallery of what
`make` has built.  Links between files of the project become links between pages; a link that leads nowhere stops it.
"""

import contextlib
import html
import io
import json
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from posixpath import normpath, relpath
from urllib.parse import unquote

from jinja2 import Environment
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[1]
TEMPLATE = Path(__file__).with_name("site.html")
GROUPS = {"guides": "Guides", "": "Manual", "reference": "Reference", "decisions": "Why it is so"}
COMMANDS = {"designs": "Designs", "strategies": "Strategies", "machines": "Machines", "cutters": "Tools", "materials": "Materials",
            "posts": "Posts", "shop": "What a shop decides"}
FILES = {"machine": "Keys of a machine's file", "tools": "Keys of a tool library", "job": "Keys of a job file",
         "shop": "Keys of a shop's file"}
PICTURES = ("iso.png", "paths.png", "deviation.png")      # of a part in the gallery
FAR = ("http:", "https:", "mailto:", "#")
LINK = re.compile(r"""(href|src)="([^"]*)\"""")
ID = re.compile(r'id="([^"]+)"')
HEADING = re.compile(r"<h([1-4])>(.*?)</h\1>", re.S)


@dataclass(frozen=True, kw_only=True)
class Page:
    """A page of the site."""

    path: str           # below the site, with slashes
    source: str         # file of the project that it was made of, with slashes; "" a list of the command line's
    group: str
    title: str
    body: str           # HTML; links as the source has them


class DeadLink(Exception):
    """A link that leads nowhere."""


def main(folder, outputs):
    """Write the site.

    Args:
        folder: Path; replaced whole.   outputs: Path of what `make` has built, for the gallery; may be missing.
    Returns:
        number of pages.
    Raises:
        DeadLink: pages or files that are linked to are not there; all of them are named.
    """
    beside = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    pages = [*written_pages(), *reference_pages(), gallery(outputs, beside)]
    places = {p.source: p.path for p in pages if p.source}
    template = Environment(autoescape=False).from_string(TEMPLATE.read_text())
    menu = [(GROUPS[g], [p for p in pages if p.group == g]) for g in GROUPS]
    for page in pages:
        target = beside / page.path
        target.parent.mkdir(parents=True, exist_ok=True)
        to = lambda path, page=page: relpath(path, Path(page.path).parent.as_posix() or ".")
        target.write_text(template.render(page=page, menu=menu, to=to, body=_with_links(page, places, beside)))
    shutil.copytree(ROOT / "docs" / "schemas", beside / "schemas")
    if dead := dead_links(beside):
        raise DeadLink("links that lead nowhere: " + "; ".join(dead))
    shutil.rmtree(folder, ignore_errors=True)
    beside.rename(folder)
    return len(pages)


# pages ------------------------------------------------------------------------------------------


def written_pages():
    """Page of every Markdown file that readers are meant for."""
    docs = ROOT / "docs"
    found = [path for where in ("guides/*.md", "*.md", "decisions/*.md") for path in sorted(docs.glob(where))]
    sources = [ROOT / "README.md", *found, ROOT / "bench" / "RESULTS.md"]
    return [_written(path.relative_to(ROOT).as_posix(), path.read_text()) for path in sources]


def _written(source, text):
    name = source.removeprefix("docs/").removesuffix(".md").lower()
    path = {"readme": "index", "bench/results": "measured"}.get(name, name) + ".html"
    group = name.partition("/")[0] if name.startswith(("guides/", "decisions/")) else ""
    title = re.search(r"^# (.*)$", text, re.M)[1]
    return Page(path=path, source=source, group=group, title=title, body=with_anchors(_markdown(text)))


def _markdown(text):
    return MarkdownIt("commonmark", {"html": False}).enable("table").render(text)


def with_anchors(body):
    """Headings get the names by which links find them: small letters, blanks as hyphens, no other signs.

    >>> with_anchors("<h2>Your own <code>part</code>!</h2>")
    '<h2 id="your-own-part">Your own <code>part</code>!</h2>'
    """
    def named(found):
        words = html.unescape(re.sub(r"<[^>]*>", "", found[2])).lower()
        return f'<h{found[1]} id="{re.sub(r"[^a-z0-9 _-]", "", words).replace(" ", "-")}">{found[2]}</h{found[1]}>'
    return HEADING.sub(named, body)


def reference_pages():
    """Page of every list of the command line, and of the JSON schemas."""
    lists = [Page(path=f"reference/{name}.html", source="", group="reference", title=title, body=_list(name, title))
             for name, title in COMMANDS.items()]
    rows = "".join(f'<li><a href="../schemas/{p.name}">{p.name}</a></li>' for p in sorted((ROOT / "docs/schemas").glob("*.json")))
    files = [Page(path=f"reference/{name}-files.html", source="", group="reference", title=title, body=_keys_of_a_file(name, title))
             for name, title in FILES.items()]
    return [*lists, *files, Page(path="reference/schemas.html", source="docs/schemas", group="reference", title="JSON schemas",
                         body=f"<h1>JSON schemas</h1><p>What other programs may rely on.</p><ul>{rows}</ul>")]


def _list(name, title):
    """What `cuspline NAME --json` lists."""
    from cuspline.app import cli
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = cli.run([name, "--json"])
    if code:
        raise RuntimeError(f"cuspline {name} --json ended with {code}")
    rows = json.loads(said.getvalue())
    body = f"<h1>{title}</h1><p>As <code>cuspline {name}</code> lists them.</p>"
    return body + (_table(rows) if name in ("shop", "posts") else "".join(_entry(row) for row in rows))


def _entry(row):
    """One thing of a list: heading, what it says of itself, its parameters or its values."""
    cutter = row.get("cutter", {})
    name = row.get("name") or row.get("kind") or f"T{row['number']} {cutter['name']}"
    body = f"<h2>{html.escape(name)}</h2>" + "".join(
        f"<p>{html.escape(row[key])}</p>" for key in ("description", "source") if row.get(key))
    if row.get("picture"):
        body += f"<pre>{html.escape(row['picture'])}</pre>"
    if "parameters" in row:
        return with_anchors(body + _table(row["parameters"]))
    values = {k: v for k, v in {**cutter, **row}.items() if k not in ("name", "kind", "description", "source", "picture", "cutter")}
    rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(_in_words(v))}</td></tr>" for k, v in values.items()
                   if v is not None and k not in ("bodies", "holder"))
    return with_anchors(f"{body}<table>{rows}</table>")


def _keys_of_a_file(name, title):
    """Every key that a file may have, table by table, as its JSON schema has it: what it takes, what it is without it."""
    from cuspline.app.documents import schema_of
    schema = json.loads(schema_of(name))
    parts = {schema["title"]: schema, **schema.get("$defs", {})}
    body = (f'<h1>{html.escape(title)}</h1><p>As <code>cuspline schema {name}</code> has it for editors: '
            f'<a href="../schemas/{name}.schema.json">{name}.schema.json</a>.</p>')
    for part, model in parts.items():
        if "oneOf" in model:
            body += f"<h2>{part}</h2><p>One of {_taken(model).replace(' or ', ', ')}, by its <code>kind</code>.</p>"
        if "properties" not in model:
            continue
        rows = "".join(_key(key, value, key in model.get("required", ())) for key, value in model["properties"].items())
        body += (f'<h2>{part}</h2><p>{html.escape(model.get("description", ""))}</p><table><tr><th>key</th><th>takes</th>'
                 f'<th>without it</th><th></th></tr>{rows}</table>')
    return with_anchors(body)


def _key(key, value, is_required):
    without = "must be there" if is_required else html.escape(json.dumps(value["default"])) if "default" in value else ""
    return (f"<tr><td><code>{key}</code></td><td>{_taken(value)}</td><td>{without}</td>"
            f"<td>{html.escape(value.get('description', ''))}</td></tr>")


def _taken(value):
    """What a key takes, as HTML: a link to the table of another one, its values, its range."""
    if "$ref" in value:
        part = value["$ref"].rpartition("/")[2]
        return f'<a href="#{part.lower()}">{part}</a>'
    if several := value.get("anyOf") or value.get("oneOf"):
        return " or ".join(dict.fromkeys(_taken(v) for v in several if v.get("type") != "null"))
    if "enum" in value or "const" in value:
        return html.escape(", ".join(json.dumps(v) for v in value.get("enum", [value.get("const")])))
    if value.get("type") == "array":
        inner = [_taken(v) for v in value.get("prefixItems", [value.get("items", {})])]
        return f"list of {' and '.join(dict.fromkeys(inner))}"
    signs = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<", "pattern": "like"}
    limits = [f"{sign} {html.escape(str(value[name]))}" for name, sign in signs.items() if name in value]
    return " ".join([value.get("type", "any"), *limits])


def _table(rows):
    columns = [c for c in rows[0] if any(row.get(c) not in (None, "") for row in rows)]
    head = "".join(f"<th>{c}</th>" for c in columns)
    cells = lambda row: "".join(f"<td>{html.escape(_in_words(row.get(c)))}</td>" for c in columns)
    return f"<table><tr>{head}</tr>{''.join(f'<tr>{cells(row)}</tr>' for row in rows)}</table>"


def _in_words(value):
    if isinstance(value, dict):
        return ", ".join(f"{k} {_in_words(v)}" for k, v in value.items() if v is not None)
    if isinstance(value, list):
        return " ".join(_in_words(v) for v in value)
    return "" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def gallery(outputs, folder):
    """Page of the parts that were built, their pictures and reports copied into the site."""
    parts = []
    for verify in sorted(outputs.glob("*/verify.json")) if outputs.is_dir() else ():
        name, found = verify.parent.name, json.loads(verify.read_text())
        if not found["ok"]:
            continue
        target = folder / "gallery" / name
        target.mkdir(parents=True)
        kept = [p for p in (*PICTURES, "report.html") if (verify.parent / p).is_file()]
        for file in kept:
            shutil.copy(verify.parent / file, target)
        pictures = "".join(f'<img src="gallery/{name}/{p}" alt="{name}, {p}">' for p in kept if p in PICTURES)
        report = f' <a href="gallery/{name}/report.html">report</a>' if "report.html" in kept else ""
        parts.append(f"<h2>{name}</h2><p>gouge {found['gouge_max_mm']:.4f} mm, cusp {found['cusp_max_mm']:.4f} mm, "
                     f"{found['points_checked']:,} points checked.{report}</p>{pictures}")
    body = "".join(parts) or "<p>Nothing is built yet: <code>make</code>, then <code>make site</code>.</p>"
    return Page(path="gallery.html", source="outputs", group="guides", title="Gallery", body=f"<h1>Gallery</h1>{body}")


# links ------------------------------------------------------------------------------------------


def _with_links(page, places, folder):
    """The page's HTML, links of its source as links of the site; files that are no pages are copied."""
    def changed(found):
        kind, link = found[1], html.unescape(found[2])
        if not page.source.endswith(".md") or link.startswith(FAR):
            return found[0]
        file, mark, anchor = link.partition("#")
        source = normpath(f"{Path(page.source).parent.as_posix()}/{unquote(file)}")
        if source not in places and (ROOT / source).is_dir():
            target = "index.html"               # what a folder holds stands in the menu
        else:
            target = places.get(source) or _copied(source, folder)
        return f'{kind}="{relpath(target, Path(page.path).parent.as_posix() or ".")}{mark}{anchor}"'
    return LINK.sub(changed, page.body)


def _copied(source, folder):
    """Path in the site of a file that is no page; what is not there is found by `dead_links`."""
    target = folder / "files" / source
    if (ROOT / source).is_file() and not target.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / source, target)
    return f"files/{source}"


def dead_links(folder):
    """["page: link"] of links in a site that lead to no file of it, or to no heading."""
    texts = {p: p.read_text() for p in sorted(folder.rglob("*.html")) if "gallery" not in p.relative_to(folder).parts[:-1]}
    anchors = {p: set(ID.findall(text)) for p, text in texts.items()}
    dead = []
    for page, text in texts.items():
        for _, link in LINK.findall(text):
            file, _, anchor = html.unescape(link).partition("#")
            target = (page.parent / unquote(file)).resolve() if file else page
            if not link.startswith(FAR[:3]) and (not target.is_file() or anchor and anchor not in anchors.get(target, {anchor})):
                dead.append(f"{page.relative_to(folder)}: {link}")
    return dead


if __name__ == "__main__":
    made = main(Path(sys.argv[1]).resolve(), ROOT / "outputs")
    print(f"{made} pages: {Path(sys.argv[1]) / 'index.html'}")
