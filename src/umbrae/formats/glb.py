"""GLB, written.

Written here and not through trimesh, which stores vertex colours in 8 bits, rounds texture coordinates by
turning v round twice, and knows nothing of transmission: what is read back must be what was saved.
"""

import io
import json
import struct
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage

from umbrae.material import Material
from umbrae.scene import Scene

_FLOAT, _UNSIGNED, _ARRAY, _INDEX = 5126, 5125, 34962, 34963


def write_glb(scene: Scene, scalars: Mapping[str, NDArray[np.float32]]) -> bytes:
    """A node and mesh per object, a primitive per material; `scene.origin` as the nodes' translation.

    `scalars` holds more numbers per vertex; `hours` becomes the attribute `_HOURS`.
    """
    blob = _Blob()
    tree: dict[str, Any] = {"asset": {"version": "2.0", "generator": "umbrae"}, "scene": 0}
    used, material_id = np.unique(scene.material_id, return_inverse=True)
    tree |= _materials([scene.materials[index] for index in used], blob)
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    objects, object_id = np.unique(scene.object_id, return_inverse=True)
    # Sorted once: picking the triangles of each object out of all of them takes long for many objects.
    order = np.lexsort((material_id, object_id))
    edges = np.searchsorted(object_id[order], np.arange(len(objects) + 1))
    for index, (start, end) in enumerate(pairwise(edges)):
        rows = order[start:end]
        primitives = [
            _primitive(scene, scalars, np.sort(rows[material_id[rows] == material]), int(material), blob)
            for material in np.unique(material_id[rows])
        ]
        meshes.append({"primitives": primitives})
        nodes.append({"mesh": index})
        if scene.origin.any():
            nodes[-1]["translation"] = scene.origin.tolist()
    tree["scenes"] = [{"nodes": list(range(len(nodes)))}] if nodes else [{}]
    # Empty arrays are not allowed.
    lists = {"nodes": nodes, "meshes": meshes, "bufferViews": blob.views, "accessors": blob.accessors}
    tree |= {name: entries for name, entries in lists.items() if entries}
    body = blob.data.getvalue()
    if body:
        tree["buffers"] = [{"byteLength": len(body)}]
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False).encode()
    chunks = _chunk(b"JSON", text + b" " * (-len(text) % 4)) + (_chunk(b"BIN\0", body) if body else b"")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


class _Blob:
    """The binary chunk as it grows, with the views and accessors into it."""

    def __init__(self) -> None:
        self.data = io.BytesIO()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def view(self, data: bytes, **more: int) -> int:
        self.views.append({"buffer": 0, "byteOffset": self.data.tell(), "byteLength": len(data), **more})
        self.data.write(data + b"\0" * (-len(data) % 4))
        return len(self.views) - 1

    def rows(self, rows: NDArray[Any], kind: str, **more: Any) -> int:
        component, target = (_FLOAT, _ARRAY) if rows.dtype == np.float32 else (_UNSIGNED, _INDEX)
        view = self.view(rows.tobytes(), target=target)
        entry = {"bufferView": view, "componentType": component, "count": len(rows), "type": kind}
        self.accessors.append(entry | more)
        return len(self.accessors) - 1


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack("<I4s", len(data), kind) + data


def _primitive(
    scene: Scene, scalars: Mapping[str, NDArray[np.float32]], rows: NDArray[np.intp], material: int, blob: _Blob
) -> dict[str, Any]:
    used, corners = np.unique(scene.triangles[rows], return_inverse=True)
    points = scene.positions[used]
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    attributes = {"POSITION": blob.rows(points, "VEC3", **bounds)}
    for name, kind, values in (
        ("NORMAL", "VEC3", scene.normals),
        ("TEXCOORD_0", "VEC2", scene.uv),
        ("COLOR_0", "VEC4", scene.colors),
        *((f"_{name.upper()}", "SCALAR", values) for name, values in scalars.items()),
    ):
        if values is not None:
            attributes[name] = blob.rows(values[used], kind)
    indices = blob.rows(corners.ravel().astype("<u4"), "SCALAR")
    return {"attributes": attributes, "indices": indices, "material": material}


def _materials(materials: list[Material], blob: _Blob) -> dict[str, Any]:
    """The top-level arrays that materials need; pictures that several share are stored once."""
    entries = []
    images: dict[int, int] = {}
    for material in materials:
        look: dict[str, Any] = {"baseColorFactor": list(material.base_color), "metallicFactor": 0.0}
        entry: dict[str, Any] = {"pbrMetallicRoughness": look, "alphaMode": material.alpha_mode}
        if material.texture is not None:
            key = id(material.texture)
            if key not in images:
                images[key] = blob.view(_png(material.texture))
            look["baseColorTexture"] = {"index": list(images).index(key)}
        if material.alpha_mode == "MASK":
            entry["alphaCutoff"] = material.alpha_cutoff
        if material.double_sided:
            entry["doubleSided"] = True
        if material.name:
            entry["name"] = material.name
        if material.transmission:
            entry["extensions"] = {"KHR_materials_transmission": {"transmissionFactor": material.transmission}}
        entries.append(entry)
    tree: dict[str, Any] = {"materials": entries} if entries else {}
    if images:
        tree["images"] = [{"bufferView": view, "mimeType": "image/png"} for view in images.values()]
        tree["textures"] = [{"source": source} for source in range(len(images))]
    if any("extensions" in entry for entry in entries):
        tree["extensionsUsed"] = ["KHR_materials_transmission"]
    return tree


def _png(pixels: NDArray[np.uint8]) -> bytes:
    stream = io.BytesIO()
    PillowImage.fromarray(pixels).save(stream, "PNG", compress_level=3)
    return stream.getvalue()
