"""report.html and setup-sheet.html as text: self-contained, repeatable, safe, complete."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from cuspline.report import facts, page, plots, sheet
from cuspline.values.frames import Frame


class Page(HTMLParser):
    """Collects what a browser would fetch, what it would run, and the text a person reads."""

    def __init__(self, html):
        super().__init__(convert_charrefs=True)
        self.addresses, self.tags, self.text, self._inside = [], [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self._inside.append(tag)
        self.addresses += [value for name, value in attributes if name in ("src", "href", "srcset", "data", "poster", "action")]

    def handle_endtag(self, tag):
        self._inside.pop() if self._inside and self._inside[-1] == tag else None

    def handle_data(self, data):
        if not self._inside or self._inside[-1] not in ("script", "style"):
            self.text.append(data)

    @property
    def words(self):
        return " ".join(" ".join(self.text).split())


def both_pages(bundle):
    images = {"iso": page.image_url("image/png", b"picture")}
    return page.report_html(bundle, images, plots.all_plots(bundle), ""), page.sheet_html(bundle, images)


@pytest.fixture(scope="module")
def pages(sample_bundle):
    return both_pages(sample_bundle)


def test_nothing_is_fetched_from_anywhere(pages):
    for html in pages:
        assert all(address.startswith(("data:", "#")) for address in Page(html).addresses)
        visible = re.sub(r"data:[a-z/+]+;base64,[A-Za-z0-9+/=]*", "", html)
        assert not re.search(r"https?:|@import|url\(", visible)
        assert "default-src 'none'" in html


def test_same_bundle_same_bytes(sample_bundle, pages):
    assert both_pages(sample_bundle) == pages


def test_verdict_comes_first(pages, refused_bundle):
    assert Page(pages[0]).words.startswith("groove_block: VERIFIED VERIFIED")
    red = Page(both_pages(refused_bundle)[0]).words
    assert red.index("NOT VERIFIED, 2 findings") < red.index("What to do") < red.index("let T1 stand out 42 mm") < red.index("Part")


def test_a_red_sheet_says_do_not_cut(pages, refused_bundle):
    assert "Do not cut" not in Page(pages[1]).words
    assert "Do not cut" in Page(both_pages(refused_bundle)[1]).words
    assert "Do not cut" in Page(both_pages(replace(refused_bundle, verify={}))[1]).words


def test_an_accepted_finding_stands_on_the_sheet(refused_bundle):
    verify = {**refused_bundle.verify, "ok": True, "accepted": {"gouge": "in the runout", "holder_contact": "by hand"}}
    words = Page(both_pages(replace(refused_bundle, verify=verify))[1]).words
    assert "Accepted by name" in words and "in the runout" in words


def test_names_cannot_break_out(sample_bundle):
    evil = "</script><img src=x onerror=alert(1)>&\"'<b>"
    plan = {"setups": [{"name": "setup-1", "operations": [{"name": evil, "tool": {"name": evil, "type": evil, "diameter_mm": 5},
                                                           "candidates": [{"tool": evil, "reason": evil}]}]}]}
    verify = {"ok": False, "findings": [{"kind": evil, "advice": evil, "place_mm": [1, 2, 3], "operation": evil}]}
    setup = replace(sample_bundle.setups[0], wcs=evil, wcs_in_words=evil, machine=evil, program_file=evil)
    bundle = replace(sample_bundle, design=evil, description=evil, parameters={evil: evil}, plan=plan, verify=verify,
                     setups=(setup,))
    for html in both_pages(bundle):
        found = Page(html)
        assert "x" not in found.addresses
        assert html.count("</script") == found.tags.count("script")
        assert "onerror=alert(1)>" not in html
        assert evil in "".join(found.text)


def test_the_scene_is_one_script_of_json(pages):
    import json
    text = re.search(r'id="scene">(.*?)</script>', pages[0], re.S)[1]
    meta = json.loads(text)
    assert [s["name"] for s in meta["setups"]] == ["setup-1"] and meta["pins"][0]["label"] == "U1"


def test_the_sheet_holds_what_a_machinist_needs(pages):
    words = Page(pages[1]).words
    for part in ("Simulated only", "G54: X0 Y0 at the front left corner of the stock", "60 × 40 × 22 mm", "T3", "ER20",
                 "18000", "540 … 900", "980", "stick-out 35 mm", "Before cycle start", "3f" * 32, "9c" * 32, "−22.000 … 0.000"):
        assert part in words, part


def test_the_sheet_of_an_inch_machine_is_in_inches(sample_bundle):
    """Sizes, heights, feeds, stick-outs: 60 x 40 x 22 mm, a stick-out of 35 mm, feeds of 540 to 900 mm/min."""
    inches = replace(sample_bundle, setups=tuple(replace(s, units="inch") for s in sample_bundle.setups))
    words = Page(page.sheet_html(inches, {})).words
    for part in ("2.3622 × 1.5748 × 0.8661 inch", "21.3 … 35.4", "stick-out 1.378 inch", "−0.8661 … 0.0000", "F inch/min",
                 "sizes in inch"):
        assert part in words, part
    assert ">X 2.3622<" in sheet.wcs_drawing(inches, inches.setups[0])


def test_the_drawing_shows_stock_part_and_zero(sample_bundle):
    drawing = sheet.wcs_drawing(sample_bundle, sample_bundle.setups[0])
    assert drawing.count('class="hidden"') == 3 and drawing.count('class="stock"') == 9
    assert drawing.count('class="part"') == len(sample_bundle.mesh.edges_mm) and ">G54<" in drawing
    places = [float(v) for pair in re.findall(r'points="([^"]+)"', drawing) for v in re.split("[ ,]", pair)]
    assert min(places) >= 0 and max(places) <= sheet.DRAWING_WIDTH


def test_ten_thousands_of_short_edges_are_drawn_once_and_still_hang_together():
    """A fine ellipse, every side there and back, and one long edge: on the raster no more than some 1100, and none farther off."""
    turn = np.linspace(0.0, 2 * np.pi, 20_001)
    round_it = 100 + np.column_stack([80 * np.cos(turn), 60 * np.sin(turn)])
    sides, long = np.stack([round_it[:-1], round_it[1:]], axis=1), np.array([[[0.0, 0.0], [50.0, 1.0]]])
    drawn = sheet.seen_once(np.concatenate([sides, sides[:, ::-1], long]))
    assert np.array_equal(drawn[0], long[0]) and 500 < len(drawn) < 1200
    ends = drawn[1:].reshape(-1, 2)
    off = np.array([np.sqrt(((round_it - end) ** 2).sum(axis=1)).min() for end in ends])
    assert off.max() <= sheet.RASTER / np.sqrt(2) + 1e-9
    assert np.unique(ends, axis=0, return_counts=True)[1].min() >= 2           # no end hangs loose


def test_the_drawing_shows_the_part_as_it_stands_with_what_holds_it_and_its_markers(sample_bundle):
    """Turned over: what is up in the part is down; a post below it and markers, of this clamping or of a later one, are in it."""
    plain = sample_bundle.setups[0]
    post = np.array([[[10.0, 10.0, 40.0], [10.0, 10.0, 120.0]]])
    over = replace(plain, held_frame=Frame.of_axes((0.0, 0.0, 30.0), (1, 0, 0), (0, 0, -1)), fixtures=(("post", post),),
                   markers=(("one", (1.0, 2.0, 3.0)),), marked_for_later=(("two", (4.0, 5.0, 6.0)),),
                   markers_elsewhere={"one": ("back-1", (1.0, -2.0, -3.0))})
    drawing = sheet.wcs_drawing(replace(sample_bundle, setups=(over,)), over)
    post_at, = re.findall(r'class="fixture" points="([^"]+)"', drawing)
    top, foot = (float(pair.split(",")[1]) for pair in post_at.split())
    assert foot > top + 100 and drawing.count('class="marker"') == 2 and ">one<" in drawing and ">two<" in drawing
    rows = dict(sheet.zero_rows(sample_bundle, over))
    assert rows["Marker one"].startswith("X 1") and rows["Marker two, for later"].startswith("X 4")
    assert "; in back-1 X 1.000" in rows["Marker one"] and "; in" not in rows["Marker two, for later"]


def test_the_sheet_shows_the_rotary_axes_that_carry_the_part(sample_bundle):
    """In the picture with their angles, in words by where they run: one through the zero, one 0.05 mm beside it."""
    held = Frame.of_axes((10.0, 20.0, 30.0), (1, 0, 0), (0, 0, 1))
    through, beside = np.array([[10.0, 20, 30], [1, 0, 0]]), np.array([[50.0, 20.05, 30], [-1, 0, 0]])
    setup = replace(sample_bundle.setups[0], held_frame=held, rotaries=(("A", -23.5, through), ("B", None, beside)))
    drawing = sheet.wcs_drawing(replace(sample_bundle, setups=(setup,)), setup)
    assert drawing.count('class="axis"') == 2 and ">A-23.5°<" in drawing and ">B<" in drawing
    rows = dict(sheet.zero_rows(sample_bundle, setup))
    assert rows["Axis A"] == "along X of G54, through the zero; here A-23.5 degrees"
    assert rows["Axis B"].startswith("along -X of G54, through X 0.000   Y 0.05")
    assert 'class="axis"' not in sheet.wcs_drawing(sample_bundle, sample_bundle.setups[0])


def test_missing_keys_become_dashes(sample_bundle):
    html, alone = both_pages(replace(sample_bundle, plan={}, verify={}))
    assert "NOT VERIFIED" in Page(html).words and "–" in Page(html).words and "NOT VERIFIED" in Page(alone).words
    bare = {"setups": [{"name": "setup-1", "operations": [{}, {"tool": None, "candidates": [{}]}]}]}
    assert "NOT VERIFIED" in Page(both_pages(replace(sample_bundle, plan=bare, verify={"findings": [{}]}))[0]).words


def test_two_setups_have_two_sheets_and_two_paths(two_setup_bundle):
    html, alone = both_pages(two_setup_bundle)
    assert alone.count('class="sheet"') == 2 and 'id="block-path-1"' in html and 'id="block-replay-1"' in html
    assert "setup-2, 2 of 2" in Page(alone).words


def test_left_out_pictures_are_named(sample_bundle):
    html = page.report_html(sample_bundle, {}, [], "no pictures: install libegl1 libgl1 libgl1-mesa-dri")
    assert "Left out of this build: no pictures: install libegl1" in Page(html).words


def test_the_sheet_of_an_indexed_position_says_how_it_is_turned_and_what_zero_it_is_solved_for(sample_bundle):
    words = "A-90 C0 degrees, tool along X0 Y-1 Z0 of G54; held as before"
    setup = replace(sample_bundle.setups[0], turned_in_words=words, solved_for="X0 Y0 Z-450")
    rows = sheet.zero_rows(sample_bundle, setup)
    assert ("Rotary axes", words) in rows and "Stock in G54 turned" in dict(rows)       # not what the control shows
    assert "G54 turned</text>" in sheet.wcs_drawing(sample_bundle, setup)
    held = replace(sample_bundle.setups[0], solved_for="X0 Y0 Z-450", swings_in_words="A -90 … 0, C 0 degrees")
    lines = sheet.checklist(replace(sample_bundle, setups=(held,)), held)
    assert any("stands at machine X0 Y0 Z-450" in line for line in lines)
    assert any(line.startswith("Turned by hand over A -90 … 0, C 0 degrees") for line in lines)
    assert "clear of every cut in all positions" in lines[0]
    plain = sample_bundle.setups[0]
    assert "Rotary axes" not in dict(sheet.zero_rows(sample_bundle, plain))
    assert not any("solved" in line for line in sheet.checklist(sample_bundle, plain))


def test_positions_of_one_clamping_are_set_up_once_and_cut_by_one_program(machine_bundle):
    """The second sheet asks for nothing that was done for the first, and says from which line on the machine turns."""
    first, second = sheet.setup_sheets(machine_bundle)
    assert dict(first.job)["Setup"] == "setup-1, position 1 of 2 in one setup"
    assert dict(second.job)["Setup"] == "leaning, position 2 of 2 in one setup"
    assert second.checklist[0] == "Nothing is set up anew: setup-1.ngc goes on from setup-1, the part held as it is"
    assert second.checklist[1].startswith("Before line 24 the program turns to A-90: hand on feed hold")
    assert any("measured, length in the tool table" in line for line in first.checklist)
    html = page.report_html(machine_bundle, {}, [], "")
    assert "While it runs" in html and "2 programs" not in html
    assert [name for name, _ in facts.file_rows(machine_bundle)].count("setup-1.ngc") == 1


def test_the_length_of_a_tool_is_stated_where_the_program_hangs_on_it(sample_bundle):
    solved = replace(sample_bundle, setups=(replace(sample_bundle.setups[0], solved_for="X0 Y0 Z-450"),))
    assert [row["length"] for row in sheet.setup_sheets(solved)[0].tools] == ["70", "65"]       # 40 + 30; 35 + 6 + 24
    assert "Length" in Page(page.sheet_html(solved, {})).words and "Length" not in Page(page.sheet_html(sample_bundle, {})).words
