"""Shader text: `.glsl` files with includes and injected constants, compiled once per context.

A file holds all stages of a program, each between its own `#ifdef VERTEX_SHADER` (`TESS_CONTROL_SHADER`,
`TESS_EVALUATION_SHADER`, `GEOMETRY_SHADER`, `FRAGMENT_SHADER`, `COMPUTE_SHADER`) and `#endif`; what stands outside
belongs to all. `#include "name.glsl"` takes a file of `gl/include`, which may bring a stage.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from umbrae.errors import GraphicsError
from umbrae.gl.context import Session

STAGES = {
    "vertex_shader": "VERTEX_SHADER",
    "tess_control_shader": "TESS_CONTROL_SHADER",
    "tess_evaluation_shader": "TESS_EVALUATION_SHADER",
    "geometry_shader": "GEOMETRY_SHADER",
    "fragment_shader": "FRAGMENT_SHADER",
}
COMPUTE = "COMPUTE_SHADER"
_INCLUDES = Path(__file__).parent / "include"
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
_CONDITION = re.compile(r"^\s*#\s*(?:el)?if\b(.*)")
_DEFINITION = re.compile(r"^\s*#\s*define\s+(\w+)", re.MULTILINE)
_LOCATION = re.compile(r"\b0[:(](\d+)\b")  # a line of text 0, as Mesa and as others write it


def program(session: Session, path: Path, defines: Mapping[str, int | str] | None = None) -> Any:
    """The compiled program (`moderngl.Program`, or `ComputeShader`) of a file with some constants defined.

    Raises
    ------
    GraphicsError
        When a file or an include is missing, a constant is not one that the file asks for, a condition asks for one
        that is not defined, or a shader does not compile: names the shader's file and line.
    """
    constants = dict(defines or {})
    key = ("program", path, tuple(sorted(constants.items())))
    if key not in session.kept:
        session.kept[key] = _compile(session, path, constants)
    return session.kept[key]


class Line(NamedTuple):
    """One line of a program's text, and where it comes from."""

    text: str
    path: Path
    number: int


def source(path: Path, stage: str, defines: Mapping[str, int | str]) -> list[Line]:
    """The lines of one stage."""
    lines = _lines(path, [])
    body = "\n".join(line.text for line in lines)
    for name in defines:
        if not re.search(rf"\b{name}\b", body):
            raise GraphicsError(f"{path.name}: nothing asks for the constant {name}")
    _check_conditions(path, lines, {stage, *defines, *_DEFINITION.findall(body)})
    head = ["#version 450 core", f"#define {stage}", *(f"#define {name} {value}" for name, value in defines.items())]
    return [*(Line(text, path, 0) for text in head), *lines]


def _lines(path: Path, taken: list[Path], asked: str = "") -> list[Line]:
    if path in taken:
        return []  # an include counts once
    taken.append(path)
    lines: list[Line] = []
    for number, text in enumerate(_read(path, asked).splitlines(), 1):
        if found := _INCLUDE.match(text):
            lines += _lines(_INCLUDES / found[1], taken, f"{path.name}:{number}: ")
        else:
            lines.append(Line(text, path, number))
    return lines


def _read(path: Path, asked: str = "") -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise GraphicsError(f"{asked}shader {path.name} cannot be read: {error.strerror}") from error


def _check_conditions(path: Path, lines: list[Line], known: set[str]) -> None:
    """Refuse names that nothing defines: the language takes them for 0, so that two of them are equal."""
    for line in lines:
        if condition := _CONDITION.match(line.text):
            asked = re.sub(r"\bdefined\s*\(?\s*\w+|//.*", "", condition[1])
            for name in re.findall(r"\b[A-Za-z_]\w*", asked):
                if name not in known:
                    raise GraphicsError(f"shader {path.name}: {line.path.name}:{line.number}: {name} is not defined")


def _compile(session: Session, path: Path, defines: Mapping[str, int | str]) -> Any:
    text = "\n".join(line.text for line in _lines(path, []))  # an include may bring a whole stage
    present = {argument: stage for argument, stage in STAGES.items() if f"#ifdef {stage}" in text}
    if COMPUTE in text:
        present = {"source": COMPUTE}
    stages = {argument: source(path, stage, defines) for argument, stage in present.items()}
    codes = {argument: "\n".join([*(line.text for line in lines), ""]) for argument, lines in stages.items()}
    context = session.moderngl
    try:
        return context.compute_shader(**codes) if "source" in codes else context.program(**codes)
    except session.failure as error:
        session.messages.clear()  # which say the same once more
        raise GraphicsError(f"shader {path.name}: {_first_complaint(str(error), stages)}") from error


def _first_complaint(log: str, stages: Mapping[str, list[Line]]) -> str:
    """The first line of a driver's log that names a place, in terms of files.

    Mesa forgets which file of several it is in, so drivers are given one text: stages begin alike, and differ in
    nothing that moves a line.
    """
    lines = next(iter(stages.values()), [])
    for complaint in log.splitlines():
        found = _LOCATION.search(complaint)
        if found and 0 < int(found[1]) <= len(lines):
            line = lines[int(found[1]) - 1]
            return f"{line.path.name}:{line.number}: {complaint[found.end() :].lstrip(' ():0123456789')}"
    return " ".join(log.split())


def apply(program: Any, uniforms: Mapping[str, Any]) -> None:
    """Set those uniforms that the program uses."""
    for name, value in uniforms.items():
        if name in program:
            program[name].value = value
