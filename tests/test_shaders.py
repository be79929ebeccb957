"""Shader text: errors are named with file and line, and every shader of the package is compiled."""

import dataclasses
import itertools
import re
from pathlib import Path

import pytest

from test_gl import DRAWN, LIGHT, picture, soup
from umbrae import METHODS, GraphicsError, Light, Scene
from umbrae.errors import OptionError
from umbrae.gl import context, program
from umbrae.material import Material
from umbrae.sampling import sample_gl

PACKAGE = Path(context.__file__).parents[1]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder that includes are taken from."""
    monkeypatch.setattr(program, "_INCLUDES", tmp_path)
    return tmp_path


VERTEX = "#ifdef VERTEX_SHADER\nvoid main() { gl_Position = vec4(0.0); }\n#endif\n"
FRAGMENT = "#ifdef FRAGMENT_SHADER\nout vec4 color;\nvoid main() {\n    color = vec4(COLOR);\n}\n#endif\n"


def complaint(session, path: Path, **constants: int) -> str:
    """The one line that a faulty shader ends in."""
    with pytest.raises(GraphicsError) as caught, session.current():
        program.program(session, path, constants)
    with session.current():
        pass  # and the context is as it was
    line = str(caught.value)
    assert "\n" not in line
    return line


def test_a_program_is_compiled_once(opengl, folder):
    (folder / "good.glsl").write_text(VERTEX + FRAGMENT)
    with opengl.current():
        first = program.program(opengl, folder / "good.glsl", {"COLOR": 1})
        assert program.program(opengl, folder / "good.glsl", {"COLOR": 1}) is first
        assert program.program(opengl, folder / "good.glsl", {"COLOR": 0}) is not first


def test_an_undefined_name_is_an_error_at_its_line(opengl, folder):
    (folder / "bad.glsl").write_text(VERTEX + FRAGMENT)
    assert re.match(r"shader bad.glsl: bad.glsl:7: .*COLOR", complaint(opengl, folder / "bad.glsl"))


def test_an_error_inside_an_include_is_named_with_its_file_and_line(opengl, folder):
    (folder / "fine.glsl").write_text("// nothing to see\n")
    (folder / "part.glsl").write_text('#include "fine.glsl"\n\nfloat f() { return missing; }\n')
    (folder / "whole.glsl").write_text('#include "fine.glsl"\n#include "part.glsl"\n' + VERTEX + FRAGMENT)
    assert re.match(r"shader whole.glsl: part.glsl:3: .*missing", complaint(opengl, folder / "whole.glsl", COLOR=1))


def test_an_error_after_an_include_is_named_with_its_own_line(opengl, folder):
    (folder / "part.glsl").write_text("float f() { return 1.0; }\n")
    (folder / "whole.glsl").write_text('// one\n#include "part.glsl"\nint x = missing;\n' + VERTEX + FRAGMENT)
    assert re.match(r"shader whole.glsl: whole.glsl:3: .*missing", complaint(opengl, folder / "whole.glsl", COLOR=1))


def test_stages_that_do_not_fit_together_are_refused(opengl, folder):
    vertex = VERTEX.replace("void", "out vec2 across;\nvoid")
    fragment = FRAGMENT.replace("out vec4", "in vec3 across;\nout vec4").replace("vec4(COLOR)", "vec4(across, COLOR)")
    (folder / "apart.glsl").write_text(vertex + fragment)
    assert re.match("shader apart.glsl: .*across", complaint(opengl, folder / "apart.glsl", COLOR=1))


def test_a_constant_that_nothing_asks_for_is_refused(opengl, folder):
    (folder / "good.glsl").write_text(VERTEX + FRAGMENT)
    line = complaint(opengl, folder / "good.glsl", COLOR=1, COLOUR=1)
    assert line == "good.glsl: nothing asks for the constant COLOUR"


@pytest.mark.parametrize(
    "condition", ["#if CASE == FIRST", "#if 0\n#elif CASE == FIRST", "#if !defined(CASE) && FIRST"]
)
def test_a_condition_on_a_name_that_nothing_defines_is_refused(opengl, folder, condition):
    text = f"// defined(FIRST)\n{condition}\n#endif\n"
    (folder / "part.glsl").write_text(text)
    (folder / "whole.glsl").write_text('#include "part.glsl"\n' + VERTEX + FRAGMENT)
    at = 3 if "elif" in condition else 2
    line = complaint(opengl, folder / "whole.glsl", COLOR=1)
    missing = "FIRST" if "!" in condition else "CASE"
    assert line == f"shader whole.glsl: part.glsl:{at}: {missing} is not defined"
    (folder / "defined.glsl").write_text('#define FIRST 1\n#include "part.glsl"\n' + VERTEX + FRAGMENT)
    with opengl.current():
        program.program(
            opengl, folder / "defined.glsl", {"COLOR": 1, "CASE": 2} if "!" not in condition else {"COLOR": 1}
        )


def test_missing_files_are_named_with_the_line_that_asks(opengl, folder):
    assert complaint(opengl, folder / "no.glsl") == "shader no.glsl cannot be read: No such file or directory"
    (folder / "whole.glsl").write_text('\n#include "no.glsl"\n' + VERTEX)
    assert complaint(opengl, folder / "whole.glsl").startswith("whole.glsl:2: shader no.glsl cannot be read: ")


def choices(method: str, option: str) -> tuple[str, ...]:
    """The values that an option takes by name, as its refusal lists them."""
    with pytest.raises(OptionError) as caught:
        METHODS[method](**{option: "no such value"})
    found = re.search("wanted one of (.*), got", str(caught.value))
    assert found, f"{method}: {option} does not say what it takes"
    return tuple(found[1].split(", "))


def every_option(method: str):
    """All combinations of a method's options that are chosen by name or switched."""
    fields = dataclasses.fields(METHODS[method])
    values = {
        field.name: (False, True) if isinstance(field.default, bool) else choices(method, field.name)
        for field in fields
        if isinstance(field.default, (bool, str))
    }
    for combination in itertools.product(*values.values()):
        yield METHODS[method](**dict(zip(values, combination, strict=True)))


def overlapping_panes() -> Scene:
    """Glass and glass in one plane: seen from the side that the light is not on, exact arithmetic says both count."""
    corners = [(0, 0, 0), (4, 0, 0), (0, 0, 4), (1, 0, 1), (5, 0, 1), (1, 0, 5)]
    return Scene(corners, [(0, 2, 1), (3, 5, 4)], Material(transmission=0.5))


def shader_files(session) -> set[Path]:
    """The package's files, includes among them, of all programs that were compiled."""
    compiled = {key[1:] for key in session.kept if key[0] == "program" and PACKAGE in key[1].parents}
    return {
        line.path for path, constants in compiled for line in program.source(path, "VERTEX_SHADER", dict(constants))
    }


def test_every_shader_of_the_package_is_compiled_by_someone_with_some_option(opengl):
    context.close()  # whatever other tests have compiled
    scene = soup()
    samples = picture(scene)
    for name in DRAWN:
        for method in every_option(name):
            method.prepare(scene).shadow(LIGHT, samples)
            method.prepare(scene).shadow(Light.directional((-1, -2, -1)), samples)
    panes = overlapping_panes()
    for name in DRAWN:
        if "transparency" in METHODS[name].accepts:
            METHODS[name]().prepare(panes).shadow(Light.point((1, -4, 1)), picture(panes))
    sample_gl(scene, samples.camera)
    missing = {path.name for path in set(PACKAGE.rglob("*.glsl")) - shader_files(context.session())}
    assert not missing, f"nobody draws with {sorted(missing)}"
