"""Imports point down only: the house plan as a table, checked against the source text."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "umbrae"

# Top to bottom. A room imports from itself and from rows below its own; rooms side by side do not know each
# other.
LAYERS = [
    {"__main__"},
    {"cli"},
    {"bench", "commands"},
    {"options", "doctor"},
    {"arguments", "outputs", "info", "show", "warmup"},
    {"console"},
    {"render", "models", "sun"},
    {"methods", "shade", "verify", "antialiasing"},
    {"sampling"},
    {"files"},
    {"formats"},
    {"animation", "image", "mask", "samples", "projection", "camera", "light", "scene", "material", "transmission"},
    {"gl", "geometry"},
    {"memory", "parallel", "clock", "checks"},
    {"errors"},
]
LEVEL = {room: level for level, rooms in enumerate(LAYERS) for room in rooms}
NOUNS = LAYERS[11]
STRANGERS = {
    "methods": {"sampling", "shade"},
    "shade": {"sampling", "methods"},
    "sampling": {"methods", "shade"},
}
SIDEWAYS = {
    ("verify", "methods"),
    ("antialiasing", "methods"),
    ("parallel", "clock"),
    *((noun, other) for noun in NOUNS for other in NOUNS),
}
LAZY = {("scene", "files"), ("image", "files")}  # Scene.from_trimesh and Image.save, inside the function only


def room_of(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def imports(tree: ast.AST) -> set[str]:
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "umbrae":
            found |= {f"umbrae.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            found.add(str(node.module))
    return {name for name in found if name.split(".")[0] == "umbrae"}


@pytest.mark.parametrize("path", sorted(SOURCE.rglob("*.py")), ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_point_down(path):
    relative = path.relative_to(SOURCE)
    if relative.name == "__init__.py" and len(relative.parts) == 1:
        return  # the public names: from everywhere
    room = relative.parts[0].removesuffix(".py")
    assert room in LEVEL, f"{room} has no place in the table"
    tree = ast.parse(path.read_text())
    eager = imports(
        ast.Module([node for node in tree.body if not isinstance(node, (ast.FunctionDef, ast.ClassDef))], [])
    )
    for module in imports(tree):
        other = room_of(module)
        if other == room or (other == "" and room in ("cli", "commands")):
            continue
        down = other in LEVEL and LEVEL[room] < LEVEL[other] and other not in STRANGERS.get(room, ())
        lazy = (room, other) in LAZY and module not in eager
        assert down or lazy or (room, other) in SIDEWAYS, f"{relative} imports {module}"


def test_importing_the_package_brings_no_optional_part():
    # Not embreex: trimesh imports it by itself where it is installed.
    optional = ("OpenGL", "moderngl", "mitsuba", "pvlib", "pandas", "cmap", "typer", "rich", "imageio", "av", "warp")
    code = f"import sys, umbrae; print([name for name in {optional} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
