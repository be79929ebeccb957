"""glTF 2.0 and GLB, read.

Read here and not through trimesh, which ignores sparse accessors, leaves normalized integers unscaled, rounds
vertex colours to 8 bits, loses the meshes at and below a node with a camera, and drops textures that it
cannot find without a word.

Skins, morph targets and animation are not applied here: meshes stand as they are stored. `gltf_animation` does.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import ModelError
from umbrae.formats.gltf_document import Document, Entry
from umbrae.formats.gltf_instances import AT_REST, instances_of
from umbrae.formats.part import Part, joined
from umbrae.formats.resources import Folder
from umbrae.geometry.transforms import composed
from umbrae.material import AlphaMode, Material
from umbrae.memory import require
from umbrae.scene import Scene

_PLACING = {"matrix", *AT_REST}
_POINTS_AND_LINES, _TRIANGLES, _STRIP, _FAN = range(4), 4, 5, 6


def read_gltf(data: bytes, folder: Folder) -> Scene:
    """The default scene of the file; every node with a mesh, or every instance there, is an object."""
    document = Document(data, folder)
    placements = placements_of(document)
    meshes = read_meshes(document, placements)
    return joined(
        [
            part.placed(placement.matrix, object_id)
            for object_id, placement in enumerate(placements)
            for _, part in meshes[placement.mesh]
        ]
    )


class Placement(NamedTuple):
    """A mesh at a node of the scene; `within` `(4, 4)` is mesh to node, `matrix` mesh to world."""

    node: int
    mesh: int
    within: NDArray[np.float64]
    matrix: NDArray[np.float64]


def placements_of(document: Document) -> list[Placement]:
    """Every node of the scene that has a mesh, as often as it has it."""
    nodes = document.items("nodes")
    children = [node.wholes("children") for node in nodes]
    if document.items("scenes"):
        scene = document.item("scenes", document.root.whole("scene", 0), "scene")
        roots, where = scene.wholes("nodes"), f"{scene.where}.nodes"
    else:
        roots, where = sorted(set(range(len(nodes))).difference(*children)), "nodes"
    found: list[Placement] = []
    seen: set[int] = set()
    queue = [(root, np.eye(4), where) for root in reversed(roots)]
    while queue:
        index, parent, where = queue.pop()
        node = document.item("nodes", index, where)
        if index in seen:
            raise ModelError(f"{node.where} is reached twice: nodes must form a tree")
        seen.add(index)
        world = parent @ local_matrix(node) if _PLACING & node.fields.keys() else parent
        if "mesh" in node:
            mesh = node.whole("mesh")
            document.item("meshes", mesh, node.path("mesh"))
            found += [Placement(index, mesh, each, world @ each) for each in instances_of(document, node)]
        queue += [(child, world, node.path("children")) for child in reversed(children[index])]
    return found


def local_matrix(node: Entry) -> NDArray[np.float64]:
    """Node to parent, in float64."""
    if "matrix" in node:
        return node.numbers("matrix", np.eye(4).ravel().tolist()).reshape(4, 4).T
    return composed(*(node.numbers(name, at_rest) for name, at_rest in AT_REST.items()))


def _check_memory(document: Document, uses: Counter[int]) -> None:
    """Refuse what would not fit: a small file may place a large mesh many times over."""
    vertices = corners = 0
    for index, times in uses.items():
        for primitive in document.items("meshes")[index].entries("primitives"):
            names = primitive.entry("attributes")
            if "POSITION" in names:
                where = names.path("POSITION")
                rows = document.item("accessors", names.whole("POSITION"), where).whole("count")
                turns = rows
                if "indices" in primitive:
                    where = primitive.path("indices")
                    turns = document.item("accessors", primitive.whole("indices"), where).whole("count")
                corners += times * turns
                vertices += times * min(rows, turns)
    # Positions in float64 twice, then float32, and attributes; indices in int64 twice, then int32.
    require(128 * vertices + 24 * corners, f"a model of up to {corners // 3:,} triangles with all its instances")


def read_meshes(document: Document, placements: Sequence[Placement]) -> dict[int, list[tuple[Entry, Part]]]:
    """The primitives with triangles of each mesh that is placed, in its own coordinates."""
    _check_memory(document, Counter(placement.mesh for placement in placements))
    found = {}
    for mesh in {placement.mesh for placement in placements}:
        primitives = document.items("meshes")[mesh].entries("primitives")
        parts = [(primitive, _read_primitive(document, primitive)) for primitive in primitives]
        found[mesh] = [(primitive, part) for primitive, part in parts if part is not None]
    return found


def _read_primitive(document: Document, primitive: Entry) -> Part | None:
    """Triangles in the mesh's own coordinates; None for points, lines, and what has no positions."""
    mode, names = primitive.whole("mode", _TRIANGLES), primitive.entry("attributes")
    if mode in _POINTS_AND_LINES or "POSITION" not in names:
        return None
    if mode > _FAN:
        raise ModelError(f"{primitive.path('mode')}: wanted 0 to 6, got {mode}")
    positions = attribute(document, names, "POSITION", (3,))
    count = len(positions)
    indices = np.arange(count)
    if "indices" in primitive:
        where = primitive.path("indices")
        rows = document.accessor(primitive.whole("indices"), where)
        if rows.dtype.kind != "u" or rows.shape[1] != 1:
            raise ModelError(f"{where}: wanted unsigned whole numbers, got {rows.shape[1]} of {rows.dtype}")
        indices = rows[:, 0].astype(np.int64)
    if indices.size and indices.max() >= count:
        raise ModelError(f"{primitive.where}: index {indices.max()} is out of range, it has {count} vertices")
    material, info = _material(document, primitive)
    part = Part(positions, _triangles(indices, mode, primitive), material)
    if "NORMAL" in names:
        part.normals = attribute(document, names, "NORMAL", (3,), count)
    if "COLOR_0" in names:
        colors = attribute(document, names, "COLOR_0", (3, 4), count)
        part.colors = np.column_stack([colors, np.ones(count)])[:, :4].clip(0, 1)
    part.uv = _uv(document, names, info, count)
    if "index" in info and part.uv is not None:
        part.material = replace(material, texture=document.texture(info.whole("index"), info.path("index")))
    return part.compact()


def attribute(
    document: Document, names: Entry, name: str, widths: tuple[int, ...], count: int | None = None
) -> NDArray[np.float64]:
    rows = document.accessor(names.whole(name), names.path(name))
    if rows.shape[1] not in widths or len(rows) != (len(rows) if count is None else count):
        wanted = f"{count} rows (as POSITION has) of {widths[0]} numbers"
        raise ModelError(f"{names.path(name)}: wanted {wanted}, got {rows.shape}")
    return rows.astype(np.float64)


def _triangles(indices: NDArray[np.int64], mode: int, primitive: Entry) -> NDArray[np.int64]:
    """Indices of a list, strip or fan as `(t, 3)`."""
    if mode == _TRIANGLES:
        if len(indices) % 3:
            raise ModelError(f"{primitive.where}: {len(indices)} corners are no whole number of triangles")
        return indices.reshape(-1, 3)
    first, second, third = indices[:-2].copy(), indices[1:-1].copy(), indices[2:]
    if mode == _FAN:
        first[:] = indices[:1]
    else:
        # Every other triangle of a strip is wound the other way round.
        first[1::2], second[1::2] = indices[2:-1:2], indices[1:-2:2]
    return np.stack([first, second, third], axis=1)


def _uv(document: Document, names: Entry, info: Entry, count: int) -> NDArray[np.float64] | None:
    """Coordinates that a texture takes, moved as KHR_texture_transform says; without texture the first."""
    moved = info.entry("extensions").entry("KHR_texture_transform")
    name = f"TEXCOORD_{moved.whole('texCoord', info.whole('texCoord', 0))}"
    if name not in names:
        return None
    angle = moved.number("rotation", 0.0)
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    to_picture = turn * moved.numbers("scale", [1.0, 1.0])
    rows = attribute(document, names, name, (2,), count)
    uv: NDArray[np.float64] = rows @ to_picture.T + moved.numbers("offset", [0.0, 0.0])
    return uv


def _material(document: Document, primitive: Entry) -> tuple[Material, Entry]:
    """The primitive's material without its picture, and the entry that names the picture; empty if none."""
    if "material" not in primitive:
        # Vertex colours would be dimmed by the neutral grey.
        bright = "COLOR_0" in primitive.entry("attributes")
        return Material((1, 1, 1, 1)) if bright else Material(), Entry({}, primitive.where)
    entry = document.item("materials", primitive.whole("material"), primitive.path("material"))
    extensions = entry.entry("extensions")
    look, color, texture = entry.entry("pbrMetallicRoughness"), "baseColorFactor", "baseColorTexture"
    if "KHR_materials_pbrSpecularGlossiness" in extensions and not look.fields:
        look = extensions.entry("KHR_materials_pbrSpecularGlossiness")
        color, texture = "diffuseFactor", "diffuseTexture"
    red, green, blue, alpha = look.numbers(color, [1.0, 1.0, 1.0, 1.0]).clip(0, 1).tolist()
    mode = entry.text("alphaMode", "OPAQUE")
    if mode not in ("OPAQUE", "MASK", "BLEND"):
        raise ModelError(f"{entry.path('alphaMode')}: wanted OPAQUE, MASK or BLEND, got {mode[:40]!r}")
    transmission = extensions.entry("KHR_materials_transmission").number("transmissionFactor", 0.0)
    material = Material(
        base_color=(red, green, blue, alpha),
        alpha_mode=cast(AlphaMode, mode),
        alpha_cutoff=max(entry.number("alphaCutoff", 0.5), 0.0),
        transmission=min(max(transmission, 0.0), 1.0),
        double_sided=entry.fields.get("doubleSided") is True,
        name=entry.text("name", ""),
    )
    return material, look.entry(texture)
