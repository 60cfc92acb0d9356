"""report.html and setup-sheet.html: one file each, everything inside, no request to anywhere."""

import base64
import json
import os
from importlib import resources
from pathlib import Path

import jinja2
from markupsafe import Markup

from cuspline.report import facts, sheet, wording
from cuspline.report.pictures import CAPTIONS, render_pictures
from cuspline.report.plots import all_plots
from cuspline.report.view_data import scene

FIRST_FINDINGS = 3       # of them stand beside the verdict, on a phone one; all stand in the table


def write_report(bundle, out_dir):
    """Writes report.html, setup-sheet.html, plots and pictures; same bundle, same bytes.

    Args:
        bundle: ReportBundle.
        out_dir: an existing folder.
    Returns:
        (files, left_out): the written Paths, and "" or one sentence on what could not be made.
    """
    out_dir = Path(out_dir)
    pictures = render_pictures(bundle, out_dir)
    plots = all_plots(bundle)
    images = {name: image_url("image/png", path.read_bytes()) for name, path in pictures.files.items()}
    texts = {"report.html": report_html(bundle, images, plots, pictures.left_out),
             "setup-sheet.html": sheet_html(bundle, images)}
    texts |= {f"plot-{name}.svg": svg for name, _, svg in plots}
    written = [_write(out_dir / name, text) for name, text in texts.items()]
    return [*written, *pictures.files.values()], pictures.left_out


def report_html(bundle, images, plots, left_out):
    """The page as text.

    Args:
        bundle: ReportBundle.
        images: {"iso" | "top" | "paths" | "deviation": data URL}; may be empty.
        plots: [(name, caption, SVG text)].
        left_out: what could not be made, "" if nothing.
    """
    meta, blocks = scene(bundle)
    return _template("page.html").render(
        **_common(bundle, images), left_out=left_out, limits=facts.limits(bundle),
        not_reached=facts.not_reached(bundle), facts=facts.one_minute(bundle),
        first_findings=FIRST_FINDINGS,
        operations=facts.operation_rows(bundle), edge_rows=facts.edge_rows(bundle.verify),
        hole_rows=facts.hole_rows(bundle.verify),
        edges_not_checked=[*facts.edge_sets(bundle.verify), *facts.edges_not_checked(bundle.verify)],
        candidates=facts.candidate_rows(bundle),
        unreachable=facts.unreachable(bundle), bounds=facts.error_bound_rows(bundle.verify),
        measures=facts.measure_rows(bundle), stock=facts.stock_rows(bundle.verify), files=facts.file_rows(bundle),
        dimensions=facts.dimension_rows(bundle.verify), regions=facts.region_rows(bundle.verify),
        cusps=facts.cusp_rows(bundle.verify), meshes=facts.mesh_rows(bundle.verify),
        captions=[(name, text) for name, text in CAPTIONS.items() if name in images],
        plots=[(caption, image_url("image/svg+xml", svg.encode())) for _, caption, svg in plots],
        parameters=[(str(k), wording.short(v) if isinstance(v, float) else str(v)) for k, v in bundle.parameters.items()],
        scene=script_safe_json(meta), blocks=blocks, viewer=script_safe(_resource("machine.js") + _resource("viewer.js")))


def sheet_html(bundle, images):
    """The setup sheet alone, as text."""
    return _template("setup_sheet.html").render(**_common(bundle, images))


def _common(bundle, images):
    """What both pages need."""
    verdict, accepted, open_findings, numbers = sheet.sheet_verdict(bundle)
    return {"bundle": bundle, "images": images, "style": Markup(_resource("style.css")), "verdict": verdict,
            "findings": facts.findings(bundle.verify), "accepted": accepted, "open_findings": open_findings,
            "numbers": numbers, "sheets": [(s, image_url("image/svg+xml", s.drawing.encode()))
                                           for s in sheet.setup_sheets(bundle)], "notice": sheet.NOTICE}


def image_url(kind, content):
    """Bytes as a data URL.  SVGs go in this way too: inlined twice, their ids would collide."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def script_safe_json(value):
    """JSON that cannot end its script element, whatever names hold."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def script_safe(script):
    """JavaScript that cannot end its own element."""
    return Markup(script.replace("</", "<\\/").replace("<!--", "<\\!--"))


def _template(name):
    loader = jinja2.PackageLoader("cuspline.report", ".")
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True,
                                     undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    environment.filters["json"] = script_safe_json_attribute
    return environment.get_template(name)


def script_safe_json_attribute(value):
    """JSON for an HTML attribute; the template escapes it."""
    return json.dumps(value)


def _resource(name):
    return resources.files("cuspline.report").joinpath(name).read_text(encoding="utf-8")


def _write(path, text):
    """Writes beside and renames: a killed build leaves the old file or the new one."""
    beside = path.with_name(f".{path.name}.part")
    beside.write_text(text, encoding="utf-8", newline="\n")
    os.replace(beside, path)
    return path
