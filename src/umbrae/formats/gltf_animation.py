"""Animations of glTF 2.0 and GLB: nodes that move, and skins that follow them.

Morph targets are refused where an animation asks for them; what only cameras, lights and materials do is ignored.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.animation import Animation, Piece, Skeleton, Skin, Track
from umbrae.errors import ModelError
from umbrae.formats.gltf import attribute, local_matrix, placements_of, read_meshes
from umbrae.formats.gltf_document import Document, Entry
from umbrae.formats.gltf_instances import AT_REST, EXTENSION
from umbrae.formats.part import Part, joined
from umbrae.formats.resources import Folder
from umbrae.geometry.keyframes import CUBIC, LINEAR, STEP, Keyframes

Channels = dict[tuple[int, str], Keyframes]
"""By node and what of its placing they change."""


def read_animation(data: bytes, folder: Folder, name: str | None) -> Animation:
    """The animation of that name, or the first one, of the file's default scene."""
    document = Document(data, folder)
    clip = _chosen(document, name)
    channels = _channels(document, clip)
    skeleton = _skeleton(document, channels)
    world = skeleton.at(0.0)
    parts, pieces = [], []
    placements = placements_of(document)
    meshes = read_meshes(document, placements)
    for object_id, placement in enumerate(placements):
        for primitive, part in meshes[placement.mesh]:
            if not len(part.triangles):
                continue
            skin = _skin(document, placement.node, primitive, part, len(world))
            piece = Piece(part.positions, part.normals, placement.node, placement.within, skin)
            pieces.append(piece)
            # Bones say nothing about windings: a mesh with a skin keeps its own.
            placed = part.placed(np.eye(4) if skin is not None else world[placement.node] @ placement.within, object_id)
            placed.positions, placed.normals = piece.at(world)
            parts.append(placed)
    duration = max(float(keyframes.times[-1]) for keyframes in channels.values())
    return Animation(joined(parts), duration, clip.text("name", ""), skeleton, tuple(pieces))


def animation_names(data: bytes, folder: Folder) -> tuple[str, ...]:
    """Of all animations, in the file's order; empty for those without a name."""
    return tuple(clip.text("name", "") for clip in Document(data, folder).items("animations"))


def _chosen(document: Document, name: str | None) -> Entry:
    clips = document.items("animations")
    if not clips:
        raise ModelError("has no animations")
    if name is None:
        return clips[0]
    names = [clip.text("name", "") for clip in clips]
    if name not in names:
        raise ModelError(f"has no animation {name!r}, wanted one of: {', '.join(names)}")
    return clips[names.index(name)]


def _channels(document: Document, clip: Entry) -> Channels:
    samplers, found, ignored = clip.entries("samplers"), {}, 0
    for channel in clip.entries("channels"):
        target = channel.entry("target")
        path = target.text("path", "")
        if path == "weights":
            raise ModelError(f"{target.where}: animates morph targets, which are not supported")
        if path not in AT_REST or "node" not in target:
            ignored += 1
            continue
        node = document.item("nodes", target.whole("node"), target.path("node"))
        if "matrix" in node:
            raise ModelError(f"{target.where}: {node.where} has a matrix, wanted translation, rotation and scale")
        index = channel.whole("sampler")
        if index >= len(samplers):
            raise ModelError(f"{channel.path('sampler')}: wanted one of {len(samplers)} samplers, got {index}")
        found[target.whole("node"), path] = _keyframes(document, samplers[index], path)
    if not found:
        raise ModelError(f"{clip.where} moves no node")
    if ignored:
        warnings.warn(f"{ignored} channels of the animation move no node: they are ignored", UserWarning, stacklevel=2)
    return found


def _keyframes(document: Document, sampler: Entry, path: str) -> Keyframes:
    interpolation = sampler.text("interpolation", LINEAR)
    if interpolation not in (LINEAR, STEP, CUBIC):
        raise ModelError(f"{sampler.path('interpolation')}: wanted LINEAR, STEP or CUBICSPLINE, got {interpolation!r}")
    times = document.numbers(sampler, "input", 1)[:, 0]
    if not len(times) or times[0] < 0 or (np.diff(times) <= 0).any():
        raise ModelError(f"{sampler.path('input')}: wanted seconds from 0 that increase, at least one")
    width, per_key = len(AT_REST[path]), 3 if interpolation == CUBIC else 1
    values = document.numbers(sampler, "output", width)
    if len(values) != per_key * len(times):
        raise ModelError(f"{sampler.path('output')}: wanted {per_key * len(times)} values, got {len(values)}")
    if interpolation == CUBIC:
        values = values.reshape(len(times), 3, width)
    return Keyframes(times, values, interpolation, path == "rotation")


def _skeleton(document: Document, channels: Channels) -> Skeleton:
    nodes = document.items("nodes")
    parent = np.full(len(nodes), -1)
    children = [node.wholes("children") for node in nodes]
    for index, below in enumerate(children):
        for child in below:
            document.item("nodes", child, nodes[index].path("children"))
            if parent[child] >= 0:
                raise ModelError(f"{nodes[child].where} is reached twice: nodes must form a tree")
            parent[child] = index
    order = np.flatnonzero(parent < 0).tolist()
    for index in order:  # grows on the way
        order += children[index]
    if len(order) < len(nodes):
        raise ModelError("nodes hang on each other in a circle: they must form a tree")
    moving = {}
    for index in sorted({node for node, _ in channels}):
        tracks = [
            Track(nodes[index].numbers(path, at_rest), channels.get((index, path))) for path, at_rest in AT_REST.items()
        ]
        moving[index] = tracks[0], tracks[1], tracks[2]
    _note_what_is_not_followed(nodes, parent, order, moving.keys())
    local = np.array([local_matrix(node) for node in nodes])
    return Skeleton(parent, tuple(order), local, moving)


def _note_what_is_not_followed(nodes: list[Entry], parent: NDArray[Any], order: list[int], moving: Any) -> None:
    moved = np.zeros(len(nodes), bool)
    for index in order:
        moved[index] = index in moving or (parent[index] >= 0 and moved[parent[index]])
    for index in np.flatnonzero(moved).tolist():
        if "camera" in nodes[index] or "KHR_lights_punctual" in nodes[index].entry("extensions"):
            warnings.warn(
                "the animation moves cameras or lights of the file: they are ignored", UserWarning, stacklevel=2
            )
            return


def _skin(document: Document, node: int, primitive: Entry, part: Part, nodes: int) -> Skin | None:
    """The bones of one primitive's vertices; None where it hangs on its node."""
    where, names = document.items("nodes")[node], primitive.entry("attributes")
    if "skin" not in where or "JOINTS_0" not in names:
        return None
    if EXTENSION in where.entry("extensions"):
        raise ModelError(f"{where.where}: has a skin and instances, which say different things about where it is")
    entry = document.item("skins", where.whole("skin"), where.path("skin"))
    joints = np.array(entry.wholes("joints"), np.int64)
    if not len(joints) or joints.max() >= nodes:
        raise ModelError(f"{entry.path('joints')}: wanted some of {nodes} nodes, got {joints.tolist()[:8]}")
    inverse = np.tile(np.eye(4), (len(joints), 1, 1))
    if "inverseBindMatrices" in entry:
        rows = document.numbers(entry, "inverseBindMatrices", 16)
        if len(rows) < len(joints):
            raise ModelError(f"{entry.path('inverseBindMatrices')}: wanted {len(joints)} matrices, got {len(rows)}")
        inverse = rows[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    count = document.item("accessors", names.whole("POSITION"), names.path("POSITION")).whole("count")
    bones: list[NDArray[np.float64]] = []
    weights: list[NDArray[np.float64]] = []
    while f"JOINTS_{len(bones)}" in names:
        number = len(bones)
        bones.append(attribute(document, names, f"JOINTS_{number}", (4,), count))
        weights.append(attribute(document, names, f"WEIGHTS_{number}", (4,), count))
    bone, weight = np.hstack(bones).astype(np.int64), np.hstack(weights)
    if part.rows is not None:
        bone, weight = bone[part.rows], weight[part.rows]
    if bone.size and not 0 <= bone.min() <= bone.max() < len(joints):
        raise ModelError(
            f"{names.path('JOINTS_0')}: joint {int(bone.max())} is out of range, the skin has {len(joints)}"
        )
    total = weight.sum(axis=1, keepdims=True)
    if not (np.isfinite(total) & (weight >= 0)).all() or (total <= 0).any():
        raise ModelError(f"{names.path('WEIGHTS_0')}: wanted weights from 0 that are not all zero")
    return Skin(joints, inverse, bone, weight / total)
