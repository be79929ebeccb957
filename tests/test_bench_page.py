"""The page of `umbrae bench report` in headless Chromium: it opens, its sliders move, it asks for nothing."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest

import umbrae as um
from browser import Page
from umbrae import models
from umbrae.bench.report.merge import merged
from umbrae.bench.report.page import page
from umbrae.bench.report.pictures import View, pair
from umbrae.bench.report.sections import section
from umbrae.bench.results import load_result
from umbrae.methods import make_method

RESULTS = sorted((Path(__file__).parents[1] / "results").glob("*.json"))
CLIP = "getComputedStyle(document.querySelectorAll('.over')[{}]).clipPath"
EDGE = "document.querySelectorAll('.edge')[{}].offsetLeft / document.querySelectorAll('.both')[{}].clientWidth"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of all results of the project, one of them on two machines, and two pairs of pictures."""
    scene = models.spheres((2, 2), 200)
    view = View("Spheres", scene, um.Camera.frame(scene, width=60, height=40), models.spheres_light())
    samples = um.sample(view.scene, view.camera)
    exact = make_method("frustum").prepare(scene).shadow(view.light, samples)
    wrong = dataclasses.replace(exact, in_shadow=~exact.in_shadow)
    shown = [pair(view, samples, mask, exact, name) for mask, name in ((wrong, "wrong"), (exact, "right"))]
    sections = [section(load_result(path)) for path in (*RESULTS, RESULTS[0])]
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page(merged(sections), shown), "utf-8")
    return path


@pytest.fixture(params=[(1280, 900, False), (390, 844, True)], ids=["desktop", "phone in the dark"])
def shown(file: Path, browser: str, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Page]:
    """The page, open."""
    with Page(browser, tmp_path, *request.param) as opened:
        opened.open(file)
        yield opened


def test_nothing_on_the_console_and_nothing_fetched(shown, file):
    assert shown.evaluate("document.title") == "Umbrae, measured"
    assert shown.evaluate("[...document.images].every(one => one.complete && one.naturalWidth == 60)")
    assert shown.console == []
    assert [url for url in shown.requests if not url.startswith("data:")] == [file.as_uri()]


def test_the_page_itself_would_not_be_let_out(shown):
    """That nothing is fetched is the browser's doing too."""
    shown.evaluate("document.body.append(Object.assign(new Image(), {src: 'http://127.0.0.1:9/a.png'}))")
    shown.evaluate("new Promise(done => setTimeout(done, 200))")
    assert any("Content Security Policy" in text for text in shown.console)


def test_sliders_move_the_border_of_their_own_pictures(shown):
    shown.evaluate("document.querySelectorAll('input[type=range]')[1].focus()")
    assert shown.evaluate(CLIP.format(1)) == "inset(0px 0px 0px 50%)"
    for _ in range(3):
        shown.press("ArrowRight", 39)
    assert shown.evaluate(CLIP.format(1)) == "inset(0px 0px 0px 51.5%)"
    shown.press("End", 35)
    assert shown.evaluate(CLIP.format(1)) == "inset(0px 0px 0px 100%)"
    assert shown.evaluate(CLIP.format(0)) == "inset(0px 0px 0px 50%)"
    shown.press("Home", 36)
    assert shown.evaluate(EDGE.format(1, 1)) == 0
    assert shown.evaluate("document.querySelectorAll('.over')[1].getBoundingClientRect().width > 300")


def test_the_page_is_no_wider_than_its_window(shown):
    """Tables scroll in their own boxes."""
    assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert shown.evaluate(
        "[...document.querySelectorAll('.table, figure, p, li, .pair')].every(one => "
        "one.getBoundingClientRect().right <= innerWidth + 1)"
    )
    assert shown.evaluate(
        "[...document.querySelectorAll('.scroll')].every(one => one.scrollWidth <= one.clientWidth + 1 || "
        "getComputedStyle(one).overflowX == 'auto')"
    )


def test_letters_in_plots_can_be_read(shown):
    """At least 10 pixels high, within the plot, none across another on the same axis."""
    script = """[...document.querySelectorAll('.plot')].every(plot => {
        const all = [...plot.querySelectorAll('text')].map(text => text.getBoundingClientRect())
        const box = plot.getBoundingClientRect()
        const apart = (a, b) => a.right <= b.left || b.right <= a.left || a.bottom <= b.top + 4 || b.bottom <= a.top + 4
        return all.every((one, place) => Math.min(one.height, one.width) >= 6 && one.left >= box.left - 1
            && one.right <= box.right + 1 && one.bottom <= box.bottom + 1
            && all.every((other, at) => at <= place || apart(one, other)))
    })"""
    assert shown.evaluate("document.querySelectorAll('.plot').length") > 5
    assert shown.evaluate(script)
    assert shown.evaluate(
        "[...document.querySelectorAll('.plot')].every(plot => parseFloat(getComputedStyle(plot.querySelector('text'))"
        ".fontSize) * plot.getBoundingClientRect().width / 640 >= 10)"
    )


def test_letters_stand_out_from_the_paper_in_light_and_in_the_dark(shown):
    """A contrast of 4.5 for text, 3 for lines, as WCAG 2 asks."""
    script = """(() => {
        const light = colour => {
            const parts = colour.match(/[\\d.]+/g).slice(0, 3).map(one => one / 255)
                .map(one => one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4)
            return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]
        }
        const contrast = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05)
        const paper = getComputedStyle(document.body).backgroundColor
        const box = getComputedStyle(document.querySelector('.plot')).backgroundColor
        const texts = [...document.querySelectorAll('h1, p, th, td, a, figcaption, li')]
            .map(one => contrast(getComputedStyle(one).color, paper))
        const probe = document.body.appendChild(document.createElement('span'))
        const lines = [...Array(10).keys()].map(number => {
            probe.className = 'c' + number
            return contrast(getComputedStyle(probe).color, box)
        })
        probe.className = 'wrong'
        return [Math.min(...texts, contrast(getComputedStyle(probe).color, paper)), Math.min(...lines), light(paper)]
    })()"""
    text, line, paper = shown.evaluate(script)
    assert text >= 4.5 and line >= 3
    dark = shown.evaluate("matchMedia('(prefers-color-scheme: dark)').matches")
    assert (paper < 0.05) if dark else (paper > 0.9)
