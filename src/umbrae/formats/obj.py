"""Wavefront OBJ with MTL.

Read here and not through trimesh, which counts relative indices from the end of the whole file even where
faces and vertices alternate, takes index 0 for 1, and drops textures and material libraries that it cannot
find without a word.
"""

import posixpath
import warnings
from dataclasses import dataclass
from itertools import pairwise, takewhile

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import ModelError
from umbrae.formats.resources import Folder, decode_text, linear
from umbrae.material import Material
from umbrae.scene import Scene

Rows = dict[str, list[list[float]]]
"""The numbers of all `v`, `vt` and `vn` lines, in this order: that of the indices of a corner."""

_NAMES = {"v": "positions", "vt": "texture coordinates", "vn": "normals"}


@dataclass
class _Look:
    """What an MTL library says about one material."""

    color: tuple[float, ...] | None = None
    opacity: float = 1.0
    texture: str | None = None


def read_obj(data: bytes, folder: Folder) -> Scene:
    """Polygons as fans of triangles; every `o` and `g` starts an object."""
    text = decode_text(data).replace("\\\r\n", " ").replace("\\\n", " ")
    rows: Rows = {key: [] for key in _NAMES}
    looks: dict[str, _Look] = {}
    corner_of: dict[str, int] = {}
    # Flat, three numbers each: a million small tuples keep the garbage collector busy.
    corners: list[int] = []
    triangles: list[int] = []
    used: dict[str, int] = {}
    # A run of triangles of one object and material: its first triangle, its material, its object.
    runs: list[tuple[int, int, int]] = []
    name, group, begun = "", 0, False
    for number, line in enumerate(text.split("\n"), 1):
        key, *words = line.split() or [""]
        if "#" in line:
            words = list(takewhile(lambda word: word[0] != "#", words))
        try:
            if key in rows:
                rows[key].append(list(map(float, words)))
            elif key == "f":
                if not begun:
                    runs.append((len(triangles) // 3, used.setdefault(name, len(used)), group))
                    begun = True
                face = []
                for word in words:
                    corner = corner_of.get(word)
                    if corner is None:
                        corner = len(corners) // 3
                        corners += _corner(word, rows)
                        # A relative index means something else on every line.
                        if "-" not in word:
                            corner_of[word] = corner
                    face.append(corner)
                for second, third in pairwise(face[1:]):
                    triangles += face[0], second, third
            elif key == "usemtl":
                name, begun = " ".join(line.split()[1:]), False
            elif key in ("o", "g"):
                group, begun = group + 1, False
            elif key == "mtllib":
                _read_libraries(line.split(None, 1)[1:], folder, looks)
        except ModelError as error:
            raise ModelError(f"line {number}: {error}") from error
        except ValueError as error:
            raise ModelError(f"line {number} cannot be read: {line.strip()[:60]!r}") from error
    if not triangles:
        raise ModelError("has no triangles")
    start, material_id, object_id = np.array(runs).T
    counts = np.diff(start, append=len(triangles) // 3)
    return Scene(
        triangles=np.array(triangles).reshape(-1, 3),
        materials=[_material(name, looks.get(name, _Look()), folder) for name in used],
        material_id=np.repeat(material_id, counts),
        object_id=np.unique(np.repeat(object_id, counts), return_inverse=True)[1],
        **_vertices(rows, np.array(corners).reshape(-1, 3)),
    )


def write_obj(scene: Scene) -> bytes:
    """Positions and triangles; nine digits bring every float32 back."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in scene.positions.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (scene.triangles + 1).tolist()]
    return "\n".join([*lines, ""]).encode()


def _corner(word: str, rows: Rows) -> list[int]:
    """Indices from 0 of a corner's position, texture coordinate and normal; -1 for none."""
    found = [-1, -1, -1]
    for slot, (text, key) in enumerate(zip(word.split("/"), rows, strict=False)):
        if text or slot == 0:
            index = int(text)
            found[slot] = index - 1 if index > 0 else len(rows[key]) + index
            if index == 0 or found[slot] < 0:
                raise ModelError(f"a face names number {index} of {len(rows[key])} {_NAMES[key]} so far")
    return found


def _vertices(rows: Rows, corners: NDArray[np.int64]) -> dict[str, NDArray[np.float64]]:
    """One vertex per different corner, as the arguments of a scene."""
    for slot, (key, name) in enumerate(_NAMES.items()):
        if corners[:, slot].max() >= len(rows[key]):
            raise ModelError(f"a face names number {corners[:, slot].max() + 1} of {len(rows[key])} {name}")
    own, uv, normal = corners.T
    vertices = {"positions": _table(rows["v"], 0, 3, "positions")[own]}
    if any(len(row) >= 6 for row in rows["v"]):
        color = _table([row if len(row) >= 6 else [1.0] * 6 for row in rows["v"]], 3, 6, "colours")
        # Whole numbers to 255 are as common as fractions of 1.
        scale = 255 if color.max(where=np.isfinite(color), initial=0) > 1 else 1
        color = linear(np.clip(np.nan_to_num(color / scale, nan=1.0), 0, 1))
        vertices["colors"] = np.column_stack([color, np.ones(len(color))])[own]
    # The row of zeros at the end is what -1, for none, picks.
    if (uv >= 0).any():
        table = _table([[*row, 0.0][:2] for row in rows["vt"]], 0, 2, "texture coordinates")
        vertices["uv"] = np.vstack([np.nan_to_num(table) * [1, -1] + [0, 1], np.zeros(2)])[uv]
    if (normal >= 0).any():
        table = _table(rows["vn"], 0, 3, "normals")
        vertices["normals"] = np.vstack([np.nan_to_num(table), np.zeros(3)])[normal]
    return vertices


def _table(rows: list[list[float]], start: int, end: int, name: str) -> NDArray[np.float64]:
    if short := [index for index, row in enumerate(rows, 1) if len(row) < end]:
        raise ModelError(f"number {short[0]} of the {name} has {len(rows[short[0] - 1])} numbers, wanted {end}")
    return np.array([row[start:end] for row in rows], np.float64)


def _read_libraries(names: list[str], folder: Folder, looks: dict[str, _Look]) -> None:
    """Add the materials of the library that a line names: one, perhaps with spaces, or else several."""
    names = [name.strip() for name in names]
    whole = all(folder.has(name, "material library") for name in names)
    for library in names if whole else names[0].split():
        if not folder.has(library, "material library"):
            warnings.warn(f"material library {library!r} is missing: its materials are grey", stacklevel=4)
            continue
        look = _Look()
        for line in decode_text(folder.read(library, "material library")).splitlines():
            words = line.split()
            try:
                match [word.lower() for word in words[:1]] + words[1:]:
                    case ["newmtl", *rest]:
                        look = looks[" ".join(rest)] = _Look()
                    case ["kd", *rest]:
                        look.color = tuple(float(word) for word in rest)
                    case ["d", *_, last]:
                        look.opacity = float(last)
                    case ["tr", *_, last]:
                        look.opacity = 1.0 - float(last)
                    case ["map_kd", first, *_]:
                        # Options such as "-bm 0.5" stand before the name, which may hold spaces otherwise.
                        reference = words[-1] if first.startswith("-") else line.split(None, 1)[1].strip()
                        beside = posixpath.join(posixpath.dirname(library), reference)
                        found = folder.has(beside, "texture")
                        look.texture = beside if found else reference
            except ModelError:
                raise
            except ValueError as error:
                raise ModelError(f"material library {library!r}: cannot read {line.strip()[:60]!r}") from error


def _material(name: str, look: _Look, folder: Folder) -> Material:
    texture = None if look.texture is None else folder.texture(look.texture)
    color = look.color or ((0.8,) if texture is None else (1.0,))
    if len(color) not in (1, 3):
        raise ModelError(f"material {name!r}: wanted 3 numbers for Kd, got {len(color)}")
    red, green, blue, opacity = np.clip([*np.resize(color, 3), look.opacity], 0, 1).tolist()
    return Material(
        base_color=(red, green, blue, opacity),
        alpha_mode="BLEND" if opacity < 1 else "OPAQUE",
        texture=texture,
        name=name,
    )
