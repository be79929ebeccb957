"""`umbrae bench report`: what stands on the page, and that it is whole; a browser sees it in test_bench_page.py."""

import dataclasses
import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import umbrae as um
from umbrae import cli
from umbrae.bench.report import pictures
from umbrae.bench.report.merge import letter, merged
from umbrae.bench.report.page import page
from umbrae.bench.report.pictures import View, pair, pairs
from umbrae.bench.report.plot import HEIGHT, WIDTH, svg
from umbrae.bench.report.section import Curve, Grid, Plot, Section
from umbrae.bench.report.sections import section
from umbrae.bench.report.sweep_section import sweep_section
from umbrae.bench.results import load_result
from umbrae.bench.sweep import TIME, Cell, PaperRow, Quantity, Sweep, SweepRecord
from umbrae.clock import Clock
from umbrae.errors import GraphicsError
from umbrae.methods import METHODS, make_method

RESULTS = sorted((Path(__file__).parents[1] / "results").glob("*.json"))
TESTS = Quantity("tests", "million", 1e6, ("tests",))
BYTES = Quantity("memory", "MiB", 1 << 20, ("bytes",), comparable=True)
SWEEP = Sweep(
    "milet-test", "Spheres <&>", "Table 0", "spheres, triangles", ("10 1,000", "10 64000", "1 1000"), "fast",
    (
        PaperRow("fast", "card", {"10 1,000": 2.0}), PaperRow("slow", "card", {"10 1,000": 5.0}),
        PaperRow("fast", "card", {"10 1,000": 3.5}, "memory"),
    ),
    size=(8, 6), note="A note.", quantities=(TIME, TESTS, BYTES),
)  # fmt: skip
CELLS = (
    Cell("fast", "10 1,000", "exact", (0.01, 0.03, 0.02), {"tests": 7_000_000, "bytes": 1 << 21}, 1000, 0),
    Cell("slow", "10 1,000", "exact", (0.04, 0.06, 0.05), {}, 1000, 3),
    Cell("fast", "10 64000", "exact", (0.2,), {}, 1000, 0),
    Cell("slow", "10 64000", "exact", not_run="no OpenGL"),
)
RECORD = SweepRecord(SWEEP, {"cpu": "a", "cores": 1, "threads": 1}, "2026-01-01", CELLS)


class Outline(HTMLParser):
    """What a page consists of; fails where elements are not closed in order."""

    VOID = ("meta", "link", "img", "input", "br")

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.texts = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def rows(grid):
    return [tuple(row) for row in grid.rows]


def grid_of(found, caption):
    return next(grid for grid in found.grids if grid.caption == caption)


def test_a_table_of_a_paper_has_values_ratios_and_the_papers():
    found = sweep_section(RECORD, "a machine")
    assert found.title == "Spheres <&> (Table 0), 8 x 6" and found.notes == ["A note."]
    assert rows(grid_of(found, "Time, ms")) == [("fast", "20.0", "200.0", ""), ("slow", "50.0", "", "")]
    ratios = grid_of(found, "Time over that of fast")
    assert rows(ratios) == [("slow", "2.50", "", ""), ("paper: card", "2.50", "", "")] and ratios.dim == {1}
    assert rows(grid_of(found, "Tests, million")) == [("fast", "7.00", "", "")]
    memory = grid_of(found, "Memory, MiB")
    assert rows(memory) == [("fast", "2.00", "", ""), ("paper: card", "3.50", "", "")]
    assert not any(grid.caption == "Memory over that of fast" for grid in found.grids)
    assert rows(grid_of(found, "Wrong samples, % of those checked"))[1] == ("slow", "0.300", "", "")
    assert found.missing == ["slow not run (10 64000): no OpenGL"]
    assert len(found.wrong) == 1 and "slow, 10 1,000: 3 of 1,000 samples" in found.wrong[0]


def test_columns_with_the_same_word_and_several_numbers_are_a_plot():
    plots = {plot.title: plot for plot in sweep_section(RECORD, "").plots}
    assert list(plots) == ["Time over triangles, 10", "Wrong samples beside time"]  # of the others, one point each
    fast, slow = plots["Time over triangles, 10"].curves
    assert fast.points == [(1000.0, 20.0), (64000.0, 200.0)] and slow.points == [(1000.0, 50.0)]
    wrong = plots["Wrong samples beside time"]
    assert not wrong.joined and wrong.curves[1].points == [(50.0, 0.3)]


@pytest.mark.parametrize(("size", "axis"), [(None, "pixels"), ((8, 6), "grids")])
def test_sizes_stand_for_their_pixels_and_grids_for_what_they_hold(size, axis):
    columns = ("20x10", "40x20")
    sweep = dataclasses.replace(SWEEP, axis="grids", columns=columns, size=size, paper=(), quantities=(TIME,))
    cells = [Cell("fast", name, "exact", (0.1,)) for name in sweep.columns]
    (plot,) = sweep_section(dataclasses.replace(RECORD, sweep=sweep, cells=tuple(cells)), "").plots
    assert plot.x == axis and [x for x, _ in plot.curves[0].points] == [200.0, 800.0]


def test_one_point_of_each_row_is_no_plot():
    sweep = dataclasses.replace(SWEEP, columns=("1", "2"), paper=(), quantities=(TIME,))
    cells = (Cell("fast", "1", "exact", (0.1,)), Cell("slow", "2", "exact", (0.1,)))
    assert sweep_section(dataclasses.replace(RECORD, sweep=sweep, cells=cells), "").plots == []


def test_columns_without_numbers_are_no_plot():
    sweep = dataclasses.replace(SWEEP, columns=("sponza", "city"), paper=(), quantities=(TIME,))
    cells = tuple(Cell("fast", name, "exact", (0.1,)) for name in sweep.columns)
    assert sweep_section(dataclasses.replace(RECORD, sweep=sweep, cells=cells), "").plots == []


def test_rays_are_told_in_multiples_of_embrees_time():
    path = next(path for path in RESULTS if path.name == "rays.json")
    found, document = section(load_result(path)), json.loads(path.read_text())
    first = {runner["name"]: runner["seconds"] for runner in document["cases"][0]["runners"]}
    ours, theirs = (first[name]["cold"]["median"] for name in ("frustum", "mitsuba"))
    gains = grid_of(found, "Times as fast as Embree (mitsuba)")
    assert tuple(gains.head)[:3] == ("case", "frustum, cold", "frustum, warm")
    assert len(gains.rows) == len(document["cases"])
    assert gains.rows[0][:2] == ("spheres-96k, point, 1920x1080", f"{theirs / ours:.2f}")
    assert grid_of(found, "Cold, ms").rows[0][1] == f"{1e3 * ours:.1f}"


def one(machine, time, *, extra=(), missing=()):
    grid = Grid("Time", ("", "few", *extra), [("fast", time, *extra), ("paper: card", "1")][: 2 - len(extra)],
                frozenset() if extra else frozenset({1}))  # fmt: skip
    plot = Plot("Time", "x", "y", [Curve("fast", [(1.0, float(time))])])
    return Section("sun", "Suns", [machine], [grid], [plot], ["note"], missing)


def test_results_of_two_machines_stand_beside_each_other():
    other = Section("sun", "Other suns", ["one"])
    found, alone = merged([one("one", "3"), other, one("two", "4", extra=("more",), missing=["x not run"])])
    assert alone == other and found.machines == ["one", "two"] and found.notes == ["note"]
    (grid,) = found.grids
    assert tuple(grid.head) == ("", "on", "few", "more")
    assert rows(grid) == [("fast", "A", "3", ""), ("fast", "B", "4", "more"), ("paper: card", "", "1", "")]
    assert grid.dim == {2} and found.missing == ["B: x not run"]
    first, second = found.plots[0].curves
    assert (first.name, second.name) == ("fast, A", "fast, B") and first.number == second.number
    assert second.hollow and not first.hollow


def test_three_machines_have_three_looks():
    found = merged([one(name, "3") for name in "abc"])[0].plots[0].curves
    assert len({(curve.number, curve.hollow) for curve in found}) == 3
    assert [letter(number) for number in (0, 25, 26)] == ["A", "Z", "A1"]


@pytest.mark.parametrize(
    ("points", "ends"),
    [
        # A decade or more: logarithmic, so equal factors are equal ways. Less: from 0.
        ([(1.0, 1.0), (10.0, 10.0), (100.0, 100.0)], "even"),
        ([(2.0, 2.0), (4.0, 4.0), (6.0, 6.0)], "even"),
        ([(0.0, 0.0), (50.0, 50.0), (100.0, 100.0)], "even"),
        ([(1.0, 1.0), (2.0, 2.0), (100.0, 100.0)], "uneven"),
    ],
)
def test_curves_lie_where_the_axes_say(points, ends):
    drawn = svg(Plot("T", "x", "y", [Curve("c", points)]))
    line, _ = re.findall(r'class="line" points="([^"]+)"', drawn)  # the other one is the legend's
    (x0, y0), (x1, y1), (x2, y2) = [tuple(map(float, pair.split(","))) for pair in line.split()]
    assert x0 < x1 < x2 and y0 > y1 > y2 and x0 >= 0 and x2 <= WIDTH and y2 >= 0 and y0 <= HEIGHT
    assert (abs((x1 - x0) - (x2 - x1)) < 0.2) == (ends == "even")
    assert (abs((y1 - y0) - (y2 - y1)) < 0.2) == (ends == "even")


def test_a_tick_stands_beside_its_value():
    drawn = svg(Plot("T", "x", "y", [Curve("c", [(10.0, 1.0), (1000.0, 100.0)])]))
    line, _ = re.findall(r'class="line" points="([^"]+)"', drawn)  # the other one is the legend's
    (x, y), _ = [tuple(map(float, pair.split(","))) for pair in line.split()]
    assert f'<text x="{x:.1f}" y="{HEIGHT - 40}" text-anchor="middle">10</text>' in drawn
    assert re.search(rf'y="{y + 5:.1f}" text-anchor="end">1</text>', drawn)
    assert ">1k</text>" in drawn and ">100</text>" in drawn


def test_no_two_curves_look_the_same_even_in_grey():
    curves = [Curve(f"c{number}", [(1.0, number + 1.0), (2.0, 3.0)]) for number in range(20)]
    groups = re.findall(r'<g class="[^"]+">(.*?)</g>', svg(Plot("T", "x", "y", curves)))
    looks = {re.sub(r'points="[^"]*"|d="M[-\d. ]+', "", group) for group in groups[20:]}
    assert len(groups) == 40 and len(looks) == 20  # the legend's


@pytest.mark.parametrize("points", [[], [(math.nan, 1.0)], [(1.0, math.inf)]])
def test_a_plot_of_nothing_is_nothing(points):
    assert svg(Plot("T", "x", "y", [Curve("c", points)])) == ""


@pytest.mark.parametrize("points", [[(5.0, 5.0)], [(0.0, 0.0)], [(1e-9, 1e12)], [(1.0, 0.0), (1e7, 0.0)]])
def test_single_points_and_zeros_are_drawn(points):
    drawn = svg(Plot("T", "x", "y", [Curve("c", points)], joined=False))
    numbers = [float(number) for number in re.findall(r'class="mark" d="M([-\d.]+) ', drawn)]
    assert "nan" not in drawn and all(0 <= number <= WIDTH for number in numbers)


def test_a_page_of_all_results_is_well_formed_and_fetches_nothing():
    sections = merged([section(load_result(path)) for path in RESULTS])
    found = Outline(text := page(sections, []))
    assert found.all("html")[0]["lang"] == "en" and len(found.all("h1")) == 1
    names = {attributes["id"] for _, attributes in found.tags if "id" in attributes}
    assert len(names) == len(re.findall(r' id="', text))  # no name twice
    for attributes in found.all("a"):
        assert attributes["href"][0] == "#" and attributes["href"][1:] in names
    assert len(found.all("h2")) == len(found.all("a")) == len(sections)
    assert len({one.benchmark for one in sections}) == len({load_result(path).benchmark for path in RESULTS})
    assert sum(len(one.machines) for one in sections) == len(RESULTS)
    for _, attributes in found.tags:
        assert attributes.get("src", "data:").startswith("data:") and "srcset" not in attributes
        assert attributes.get("aria-labelledby", next(iter(names))) in names
    assert found.all("script") == [] and [one["href"] for one in found.all("link")] == ["data:,"]
    assert not re.search(r"url\(|@import|http://|https://", text)


def test_text_from_results_is_text():
    sweep = dataclasses.replace(SWEEP, note='<script>alert("x")</script>')
    shown = page([sweep_section(dataclasses.replace(RECORD, sweep=sweep), '<img src="http://x">')], [])
    found = Outline(shown)
    assert found.all("script") == [] and found.all("img") == []
    assert ("p", '<script>alert("x")</script>') in found.texts and ("h2", "Spheres <&> (Table 0), 8 x 6") in found.texts
    assert any(tag == "p" and text.startswith("WRONG: slow") for tag, text in found.texts)


def seen():
    scene = um.models.spheres((2, 2), 200)
    return View("Spheres", scene, um.Camera.frame(scene, width=40, height=30), um.models.spheres_light())


def test_the_difference_counts_what_is_wrong_in_both_directions():
    view = seen()
    samples = um.sample(view.scene, view.camera)
    exact = make_method("frustum").prepare(view.scene).shadow(view.light, samples)
    verdicts = exact.in_shadow.copy()
    lit = np.argwhere(samples.covered & ~verdicts)[:3]
    dark = np.argwhere(samples.covered & verdicts)[:2]
    for place in (*lit, *dark):
        verdicts[tuple(place)] ^= True
    wrong = dataclasses.replace(exact, in_shadow=verdicts)
    found = pair(view, samples, wrong, exact, "wrong")
    covered = int(samples.covered.sum())
    assert (found.wrong_dark, found.wrong_lit) == (3 / covered, 2 / covered)
    assert all(uri.startswith("data:image/webp;base64,") for uri in found.pictures)


def test_without_opengl_exact_methods_stand_in_and_say_why(monkeypatch):
    def refuse(*_):
        raise GraphicsError("no OpenGL 4.5")

    monkeypatch.setattr(pictures, "views", lambda: iter([seen()]))
    monkeypatch.setattr(METHODS["shadow-map"], "prepare", refuse)
    (found,) = pairs(Clock())
    assert found.left == "alias-free-map" and (found.wrong_dark, found.wrong_lit) == (0, 0)
    text = page([], [found])
    assert "no shadow map: no OpenGL 4.5" in text and len(Outline(text).all("img")) == 3


def test_the_command_writes_one_page(tmp_path, capsys):
    target = tmp_path / "report.html"
    assert cli.run(["bench", "report", *map(str, RESULTS), "-o", str(target), "--no-pictures", "--quiet"]) == 0
    text = target.read_text("utf-8")
    assert capsys.readouterr() == ("", "") and text.startswith("<!doctype html>")
    titles = [title for tag, title in Outline(text).texts if tag == "h2"]
    assert titles[0] == "Exact shadows beside rays" and titles[1].startswith("Sensors and suns")
    assert cli.run(["bench", "report", str(RESULTS[0]), "-o", str(tmp_path / "page.json")]) == 2
    assert "wanted one of .html" in capsys.readouterr().err
