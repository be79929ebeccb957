"""Every example runs, and so does every line of Python in the README and on two pages."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from animated import turning

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SAYS = {
    "hello_shadow": r"pavilion\.png: \d+% of what is seen lies in shadow, guarantee: exact\n",
    "moving_cloth": r"(frame \d: \d\d\.\d% of the floor in shadow\n){4}",
    "overdraw": r"updates or tests( +\d+ x +\d+){2}\n((z-pass|z-fail|frustum) +[\d,]+ +[\d,]+\n){3}",
    "sensors": r"(#{8}\n){4}(\.{8}\n){8}on the wall: 33% in shadow\nin front of it: 17% in shadow\n",
    "smooth_shadows": r"((discrete|accurate): \d{4} samples of the floor are not as under a fine mesh\n){2}"
    r"smooth: \d{3} samples of the floor are not as under a fine mesh\n"
    r"of 512000 samples \d{4} are wrong without bands, \d with them\n"
    r"discrete: \d{3} samples change with the mesh, \d\d by more than a pixel\n"
    r"smooth: \d\d samples change with the mesh, 0 by more than a pixel\n",
    "stained_glass": r"(layer \d: +\d+\.\d\d% of the picture\n){5,8}",
    "sun_hours": r"(2026-\d\d-2\d: +\d+\.\d h of day, north \d\.\d h, south \d\.\d h\n){3}",
    "town_walk": r"(walk \d: [789]\d% of the triangles left out\n){4}(flight \d: \d+% of the triangles left out\n){4}",
    "tree_shadows": r"([a-z ]{10}( \d\d\.\d%){3} of red, green, blue reaches the floor\n){5}",
    "two_lights": r"no sun:  +\d+\.\d%\nno lamp: +\d+\.\d%\nneither: +\d+\.\d%\n",
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(path, capsys, request):
    if path.stem in ("overdraw", "smooth_shadows"):
        request.getfixturevalue("opengl")
    runpy.run_path(str(path), run_name="__main__")
    assert re.fullmatch(SAYS[path.stem], capsys.readouterr().out)
    for picture in Path().iterdir():
        with Image.open(picture) as image:
            assert len(np.unique(np.asarray(image))) > 20


def run_python_in(page):
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)


def test_readme(capsys):
    run_python_in("README.md")
    assert Path("model.png").exists()


@pytest.mark.parametrize("page", ["docs/light.md", "docs/smooth.md"])
def test_page(page):
    run_python_in(page)


def test_page_on_animation():
    turning(Path("fox.glb"))
    run_python_in("docs/animation.md")


def test_readme_names_every_command_and_method():
    from umbrae import METHODS, cli

    text = (ROOT / "README.md").read_text()
    commands = [command.name or command.callback.__name__ for command in cli.app.registered_commands]
    assert all(f"umbrae {name}" in text for name in commands)
    assert all(f"`{name}`" in text for name in METHODS)


def test_what_the_readme_shows_is_there():
    text = (ROOT / "README.md").read_text() + (ROOT / "CONTRIBUTING.md").read_text()
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    assert links and [link for link in links if not (ROOT / link).exists()] == []
