"""Shader text: `.glsl` files with includes and injected constants, compiled once per context.

A file holds all stages of a program, each between its own `#ifdef VERTEX_SHADER` (`TESS_CONTROL_SHADER`,
`TESS_EVALUATION_SHADER`, `GEOMETRY_SHADER`, `FRAGMENT_SHADER`, `COMPUTE_SHADER`) and `#endif`; what stands outside
belongs to all. `#include "name.glsl"` takes a file of `gl/include`.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

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
_LINE = re.compile(r"^#line (\d+) (\d+)$")
_LOCATION = re.compile(r"\b(\d+)[:(](\d+)\b")  # file and line, as Mesa and as others write them


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


def source(path: Path, stage: str, defines: Mapping[str, int | str]) -> tuple[str, list[Path]]:
    """The text of one stage, and the files that its `#line` directives number."""
    files: list[Path] = []
    lines = _lines(path, files)
    body = "\n".join(lines)
    for name in defines:
        if not re.search(rf"\b{name}\b", body):
            raise GraphicsError(f"{path.name}: nothing asks for the constant {name}")
    _check_conditions(lines, files, {stage, *defines, *_DEFINITION.findall(body)})
    head = ["#version 450 core", f"#define {stage}", *(f"#define {name} {value}" for name, value in defines.items())]
    return "\n".join([*head, body, ""]), files


def _lines(path: Path, files: list[Path], asked: str = "") -> list[str]:
    if path in files:
        return []  # an include counts once
    files.append(path)
    number = len(files) - 1
    lines = [f"#line 1 {number}"]
    for at, line in enumerate(_read(path, asked).splitlines(), 1):
        found = _INCLUDE.match(line)
        if found:
            included = _lines(_INCLUDES / found[1], files, f"{path.name}:{at}: ")
            lines += [*included, f"#line {at + 1} {number}"]
        else:
            lines.append(line)
    return lines


def _read(path: Path, asked: str = "") -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise GraphicsError(f"{asked}shader {path.name} cannot be read: {error.strerror}") from error


def _check_conditions(lines: list[str], files: list[Path], known: set[str]) -> None:
    """Refuse names that nothing defines: the language takes them for 0, so that two of them are equal."""
    file = number = 0
    for line in lines:
        if place := _LINE.match(line):
            number, file = int(place[1]), int(place[2])
            continue
        if condition := _CONDITION.match(line):
            asked = re.sub(r"\bdefined\s*\(?\s*\w+|//.*", "", condition[1])
            for name in re.findall(r"\b[A-Za-z_]\w*", asked):
                if name not in known:
                    raise GraphicsError(f"shader {files[0].name}: {files[file].name}:{number}: {name} is not defined")
        number += 1


def _compile(session: Session, path: Path, defines: Mapping[str, int | str]) -> Any:
    text = _read(path)
    stages = {argument: stage for argument, stage in STAGES.items() if f"#ifdef {stage}" in text}
    files: list[Path] = [path]
    try:
        if COMPUTE in text:
            code, files = source(path, COMPUTE, defines)
            return session.moderngl.compute_shader(code)
        codes = {}
        for argument, stage in stages.items():
            codes[argument], files = source(path, stage, defines)
        return session.moderngl.program(**codes)
    except GraphicsError:
        raise
    except Exception as error:  # moderngl.Error, whose text is the driver's log
        session.messages.clear()
        raise GraphicsError(f"shader {path.name}: {_first_complaint(str(error), files)}") from error


def _first_complaint(log: str, files: list[Path]) -> str:
    """The first line of a driver's log that names a place, with the file's name in place of its number."""
    for line in log.splitlines():
        found = _LOCATION.search(line)
        if found and int(found[1]) < len(files):
            return f"{files[int(found[1])].name}:{found[2]}: {line[found.end() :].lstrip(' ():0123456789')}"
    return " ".join(log.split())


def apply(program: Any, uniforms: Mapping[str, Any]) -> None:
    """Set those uniforms that the program uses."""
    for name, value in uniforms.items():
        if name in program:
            program[name].value = value
