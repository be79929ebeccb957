"""PLY and STL through trimesh, and trimesh's own objects."""

import io
import logging
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from umbrae.errors import InputError, ModelError
from umbrae.formats.part import Part, joined
from umbrae.formats.resources import Folder, encoded, linear
from umbrae.material import AlphaMode, Material, texels
from umbrae.scene import Scene


def read_ply(data: bytes, folder: Folder) -> Scene:
    """Polygons as trimesh triangulates them; 8-bit colours are sRGB."""
    header, end, body = data.partition(b"end_header")
    if not data.startswith(b"ply") or not end:
        raise ModelError("is no PLY file, or its header is truncated")
    if re.search(rb"(?m)^format\s+ascii", header):
        _check_rows(header.decode("utf-8", "replace"), body.decode("utf-8", "replace"))
    model = _parse(data, "ply")
    for geometry in model.geometry.values():
        _check_lists(geometry.metadata.get("_ply_raw", {}).get("face", {}).get("data"))
    parts = _parts(model)
    if named := re.search(rb"(?im)^comment\s+texturefile\s+(.+?)\s*$", header):
        texture = folder.texture(named[1].decode("utf-8", "replace"))
        for part in parts:
            if part.uv is not None:
                part.material = Material((1, 1, 1, 1), texture=texture)
    return joined(parts)


def read_stl(data: bytes, folder: Folder) -> Scene:
    """Binary or text; every solid of a text is an object."""
    announced = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * announced:
        return joined(_parts(_parse(data, "stl")))
    if b"facet" not in data.lower():
        if re.match(rb"\s*solid", data, re.IGNORECASE):
            raise ModelError("has no triangles")
        wanted = (
            f"{announced} triangles of its header take {84 + 50 * announced}"
            if len(data) >= 84
            else "a header takes 84"
        )
        raise ModelError(f"is truncated or malformed: {len(data)} bytes, {wanted}")
    parts = _parts(_parse(data, "stl"))
    read, there = sum(len(part.positions) for part in parts), len(re.findall(rb"(?im)^\s*vertex\s", data))
    if read != there:
        raise ModelError(f"is truncated or malformed: {read} of {there} vertices belong to a complete solid")
    return joined(parts)


def scene_from_trimesh(mesh: Any) -> Scene:
    """Make a scene of a `trimesh.Trimesh` or `trimesh.Scene`.

    Vertex normals are taken when the mesh holds them: given by its file or maker, or asked for before. 8-bit
    colours of vertices and faces are sRGB. Every node is an object.

    Raises
    ------
    InputError
        For anything else, or a mesh without triangles.
    """
    if not isinstance(mesh, trimesh.Trimesh | trimesh.Scene):
        raise InputError(f"Scene.from_trimesh: wanted a trimesh.Trimesh or trimesh.Scene, got {type(mesh).__name__}")
    try:
        return joined(_parts(mesh))
    except ModelError as error:
        raise ModelError(f"Scene.from_trimesh: the mesh {error}") from error


def write_ply(scene: Scene, scalars: Mapping[str, NDArray[np.float32]]) -> bytes:
    """Positions, triangles and vertex colours (as 8-bit sRGB), and a property for each of `scalars` per vertex."""
    mesh = trimesh.Trimesh(scene.positions, scene.triangles, process=False)
    if scene.colors is not None:
        coded = np.column_stack([encoded(scene.colors[:, :3]), scene.colors[:, 3]])
        mesh.visual.vertex_colors = np.round(coded * 255).astype(np.uint8)
    mesh.vertex_attributes |= scalars
    with _quiet():
        data: bytes = mesh.export(file_type="ply")
    return data


def write_stl(scene: Scene) -> bytes:
    """Positions and triangles as binary STL."""
    mesh = trimesh.Trimesh(scene.positions, scene.triangles, process=False)
    with _quiet():
        data: bytes = mesh.export(file_type="stl")
    return data


def _parse(data: bytes, kind: str) -> trimesh.Scene:
    try:
        with _quiet():
            return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
    except MemoryError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise ModelError(f"is truncated or malformed ({reason})") from error


@contextmanager
def _quiet() -> Iterator[None]:
    """Neither warnings nor log lines of trimesh, except that numbers it could not read are an error."""
    log = logging.getLogger("trimesh")
    before = log.level
    log.setLevel(logging.CRITICAL + 1)  # and so its children, one per module
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message=".*could not be read to its end")
            yield
    finally:
        log.setLevel(before)


def _check_rows(header: str, body: str) -> None:
    """trimesh reads the rows of a text that are there, and of each row the numbers that are there."""
    lines = iter(body.splitlines()[1:])
    for element in re.split(r"(?m)^element\s+", header)[1:]:
        name, count = element.split(None, 2)[:2]
        lists = [kind == "list" for kind in re.findall(r"(?m)^property\s+(\w+)", element)]
        for row in range(int(count)):
            words = next(lines, "").split()
            wanted = 0
            for is_list in lists:
                wanted += 1 + (int(float(words[wanted])) if is_list and wanted < len(words) else 0)
            if len(words) < wanted:
                raise ModelError(f"is truncated or malformed: {name} {row} of {count} has {len(words)} numbers")


def _check_lists(faces: Any) -> None:
    """trimesh reads binary faces as if all had as many corners as the first, others as garbage."""
    for name in getattr(faces, "dtype", np.dtype("u1")).names or ():
        field = faces[name]
        if field.dtype.names == ("f0", "f1") and (field["f0"] != field["f1"][0].size).any():
            raise ModelError("has faces with different numbers of corners, which is not supported in binary PLY")


def _parts(model: trimesh.Trimesh | trimesh.Scene) -> list[Part]:
    if isinstance(model, trimesh.Trimesh):
        return [_part(model, {})]
    textures: dict[int, NDArray[np.uint8]] = {}
    parts: dict[str, Part] = {}
    placed = []
    for object_id, node in enumerate(model.graph.nodes_geometry):
        matrix, name = model.graph[node]
        if isinstance(model.geometry[name], trimesh.Trimesh):
            if name not in parts:
                parts[name] = _part(model.geometry[name], textures)
            placed.append(parts[name].placed(np.asarray(matrix, np.float64), object_id))
    return placed


def _part(mesh: trimesh.Trimesh, textures: dict[int, NDArray[np.uint8]]) -> Part:
    """One mesh in its own coordinates; `textures` holds the pictures that were met before."""
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    count = len(mesh.vertices)
    if faces.size and not 0 <= faces.min() <= faces.max() < count:
        raise ModelError(f"has vertex indices {faces.min()} to {faces.max()}, wanted 0 to {count - 1}")
    part = Part(np.asarray(mesh.vertices, np.float64), faces, Material())
    # trimesh computes normals when asked for them; those of the file are in its cache from the start.
    if "vertex_normals" in mesh._cache:
        part.normals = np.asarray(mesh.vertex_normals, np.float64)
    visual = mesh.visual
    if visual.kind == "texture":
        part.material = _material(visual.material, textures)
        if np.shape(visual.uv) == (count, 2):
            part.uv = np.asarray(visual.uv, np.float64) * [1, -1] + [0, 1]
        colors = np.asarray(visual.vertex_attributes.get("color", ()))
        if colors.shape in ((count, 3), (count, 4)):
            scale = 1 if colors.dtype.kind == "f" else np.iinfo(colors.dtype).max
            part.colors = np.column_stack([colors / scale, np.ones(count)])[:, :4].clip(0, 1)
    elif visual.kind in ("vertex", "face"):
        part.material = Material((1, 1, 1, 1))
        rgba = visual.vertex_colors if visual.kind == "vertex" else np.repeat(visual.face_colors, 3, axis=0)
        if visual.kind == "face":
            corners = faces.ravel()
            normals = None if part.normals is None else part.normals[corners]
            part = Part(part.positions[corners], np.arange(faces.size).reshape(-1, 3), part.material, normals=normals)
        colors = np.asarray(rgba) / 255
        part.colors = np.column_stack([linear(colors[:, :3]), colors[:, 3]])
    return part


def _material(material: Any, textures: dict[int, NDArray[np.uint8]]) -> Material:
    """A trimesh material; physically based ones and plain ones name the same things differently."""
    pbr = isinstance(material, trimesh.visual.material.PBRMaterial)
    picture = material.baseColorTexture if pbr else getattr(material, "image", None)
    color = material.baseColorFactor if pbr else material.main_color
    if picture is not None and id(picture) not in textures:
        textures[id(picture)] = texels(picture, "Scene.from_trimesh: the mesh's texture")
    red, green, blue, alpha = (1, 1, 1, 1) if color is None else (np.asarray(color) / 255).tolist()
    mode: AlphaMode = (material.alphaMode if pbr else None) or ("BLEND" if not pbr and alpha < 1 else "OPAQUE")
    cutoff = material.alphaCutoff if pbr else None
    return Material(
        base_color=(red, green, blue, alpha),
        alpha_mode=mode,
        alpha_cutoff=0.5 if cutoff is None else float(cutoff),
        texture=None if picture is None else textures[id(picture)],
        double_sided=bool(material.doubleSided) if pbr else True,
        name=material.name or "",
    )
