"""The gallery of a sweep: one page with every variant's picture and figures, and time against cusp with its Pareto front."""

import html
from urllib.parse import quote

TIME, CUSP = "plan.time_s", "verify.cusp_max_mm"
SHOWN = ((TIME, "time", "{:.1f} s"), (CUSP, "cusp", "{:.4f} mm"), ("verify.gouge_max_mm", "gouge", "{:.4f} mm"),
         ("plan.min_concave_radius_mm", "smallest concave radius", "{:.4g} mm"))
PICTURES = ("deviation.png", "iso.png")             # the first that is there
LINKED = ("report.html", "verify.json", "plan.json", "solid.json")
WIDTH, HEIGHT, LEFT, BELOW = 720, 420, 70, 50       # of the plot, px
STYLE = """body{font:15px sans-serif;margin:24px;color:#1f2328}main{display:flex;flex-wrap:wrap;gap:16px}
article{width:260px;border:1px solid #d0d7de;border-radius:8px;padding:10px}article img{width:100%}
.verified,.made{color:#1a7f37}.rejected,.refused,.fault{color:#b3261e}dl{display:grid;grid-template-columns:auto auto;margin:6px 0}
dd{margin:0;text-align:right}"""


def page(title, rows, out):
    """HTML (text) of all rows, pictures beside it.

    Args:
        title: of the page.   rows: as sweep.built gives them.   out: folder of the sweep.
    """
    counts = {}
    for row in rows:
        counts[row["verdict"]] = counts.get(row["verdict"], 0) + 1
    said = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
    return (f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
            f'</head><body><h1>{html.escape(title)}</h1><p>{len(rows)} variants: {said}. <a href="sweep.csv">sweep.csv</a></p>'
            f'{pareto(rows)}<main>{"".join(_card(row, out) for row in rows)}</main></body></html>\n')


def _card(row, out):
    """One variant."""
    name = ", ".join(f"{n} {v}" for n, v in row["values"].items()) or "default"
    lines = "".join(f"<dt>{label}</dt><dd>{form.format(row['figures'][key])}</dd>" for key, label, form in SHOWN
                    if isinstance(row["figures"].get(key), (int, float)))
    picture, links = "", ""
    if row["folder"] is not None:
        folder, at = out / row["folder"], quote(row["folder"])
        there = next((p for p in PICTURES if (folder / p).is_file()), None)
        picture = f'<img src="{at}/{there}" alt="{html.escape(name)}">' if there else ""
        links = " ".join(f'<a href="{at}/{f}">{f}</a>' for f in LINKED if (folder / f).is_file())
    return (f'<article>{picture}<b>{html.escape(name)}</b> <span class="{row["verdict"]}">{row["verdict"]}</span>'
            f'<dl>{lines}</dl>{html.escape(row["why"])} {links}</article>')


def front(points):
    """Rows of points (time, cusp) that no other one beats in both; the first of equals.

    >>> front([(1, 5), (2, 3), (3, 3), (4, 1), (5, 2)])
    [0, 1, 3]
    """
    chosen, least = [], float("inf")
    for k in sorted(range(len(points)), key=lambda k: (*points[k], k)):
        if points[k][1] < least:
            chosen.append(k)
            least = points[k][1]
    return chosen


def pareto(rows):
    """SVG: a point a verified variant, those that no other beats in both time and cusp joined; a sentence where there are none."""
    there = [row for row in rows if row["verdict"] == "verified" and TIME in row["figures"] and CUSP in row["figures"]]
    if not there:
        return "<p>No variant was verified: there is no time against cusp to draw.</p>"
    points = [(row["figures"][TIME] / 60, row["figures"][CUSP]) for row in there]
    best = front(points)
    place = _places(points)
    line = " ".join("{:.1f},{:.1f}".format(*place(points[k])) for k in best)
    dots = "".join(_dot(row, place(p), k in best) for k, (row, p) in enumerate(zip(there, points)))
    (x0, x1), (y0, y1) = _spans(points)
    return (f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" font-size="13">'
            f'<rect x="{LEFT}" y="10" width="{WIDTH - LEFT - 10}" height="{HEIGHT - BELOW - 10}" fill="none" stroke="#8c959f"/>'
            f'<polyline points="{line}" fill="none" stroke="#0969da"/>{dots}'
            f'<text x="{WIDTH / 2}" y="{HEIGHT - 8}">time, min: {x0:.3g} to {x1:.3g}</text>'
            f'<text transform="translate(18 {HEIGHT / 2 + 60}) rotate(-90)">cusp, mm: {y0:.3g} to {y1:.3g}</text></svg>')


def _dot(row, at, is_best):
    name = html.escape(", ".join(f"{n} {v}" for n, v in row["values"].items()))
    return (f'<circle cx="{at[0]:.1f}" cy="{at[1]:.1f}" r="5" fill="{"#0969da" if is_best else "#afb8c1"}">'
            f'<title>{name}</title></circle>')


def _spans(points):
    """((from, to) of time, of cusp), a little more than the points span."""
    spans = []
    for values in zip(*points):
        low, high = min(values), max(values)
        room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        spans.append((low - room, high + room))
    return spans


def _places(points):
    """The function from (time, cusp) to pixels."""
    (x0, x1), (y0, y1) = _spans(points)
    return lambda p: (LEFT + (p[0] - x0) / (x1 - x0) * (WIDTH - LEFT - 10),
                      HEIGHT - BELOW - (p[1] - y0) / (y1 - y0) * (HEIGHT - BELOW - 10))
