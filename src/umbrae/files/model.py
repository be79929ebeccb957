"""Models and animations, by the extension of their files."""

import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from umbrae.animation import Animation
from umbrae.checks import instance
from umbrae.clock import Clock
from umbrae.errors import CapacityError, InputError, ModelError, OutputError
from umbrae.files.paths import AnyPath, as_path, check_writable, in_a_line, written_whole
from umbrae.formats.glb import write_glb
from umbrae.formats.gltf import read_gltf
from umbrae.formats.gltf_animation import animation_names, read_animation
from umbrae.formats.meshes import read_ply, read_stl, write_ply, write_stl
from umbrae.formats.obj import read_obj, write_obj
from umbrae.formats.resources import Folder
from umbrae.scene import Scene

_Model = TypeVar("_Model")
_ANIMATED = (".glb", ".gltf")

_READERS: dict[str, Callable[[bytes, Folder], Scene]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
}
_Scalars = Mapping[str, NDArray[np.float32]]
_SCALAR_WRITERS: dict[str, Callable[[Scene, _Scalars], bytes]] = {
    ".glb": write_glb,
    ".ply": write_ply,
}
_WRITERS: dict[str, Callable[[Scene], bytes]] = {
    ".obj": write_obj,
    ".stl": write_stl,
}

MODELS = tuple(sorted([*_SCALAR_WRITERS, *_WRITERS]))
"""Extensions of models that `save` writes."""
SCALAR_MODELS = tuple(_SCALAR_WRITERS)
"""Extensions of models that keep numbers per vertex."""


def load(path: AnyPath, clock: Clock | None = None, outputs: Collection[AnyPath] = ()) -> Scene:
    """Read a model: glTF, GLB, OBJ, PLY or STL.

    Parameters
    ----------
    path
        The file. Buffers, pictures and material libraries it names must lie in its folder or below.
    clock
        Hears the span "load".
    outputs
        Files that the caller is going to write: a model that reads one of them, say as a texture, is refused.

    Raises
    ------
    ModelError
        For a file that is missing, unreadable, malformed, or without triangles.
    OutputError
        When one of `outputs` belongs to the model.
    CapacityError
        For a model that would not fit into memory.

    Warns
    -----
    RecentredWarning
        When coordinates far from zero were moved to the scene's own origin.
    UserWarning
        When a material library of an OBJ file is missing; its materials are then grey.
    """
    return _read(path, check_readable(path), clock, outputs)


def load_animation(
    path: AnyPath, name: str | None = None, clock: Clock | None = None, outputs: Collection[AnyPath] = ()
) -> Animation:
    """Read an animation of a glTF or GLB file: nodes that move, and skins that follow them.

    Parameters
    ----------
    path, clock, outputs
        As for `load`.
    name
        Which animation; the file's first one by default.

    Raises
    ------
    ModelError, OutputError, CapacityError
        As for `load`; also for a file without animations, without one of that name, or that moves morph targets.

    Warns
    -----
    UserWarning
        When the file moves cameras, lights or materials, which are not followed.
    """
    check_readable(path)
    if Path(path).suffix.lower() not in _ANIMATED:
        raise ModelError(f"{path}: has no animations: wanted one of {' '.join(_ANIMATED)}")
    return _read(path, lambda data, folder: read_animation(data, folder, name), clock, outputs)


def names_of_animations(path: AnyPath) -> tuple[str, ...]:
    """What the animations of a model are called, in the file's order; none for a model that stands still.

    Raises
    ------
    ModelError, CapacityError
        As for `load`.
    """
    check_readable(path)
    return _read(path, animation_names, None, ()) if Path(path).suffix.lower() in _ANIMATED else ()


def _read(
    path: AnyPath, reader: Callable[[bytes, Folder], _Model], clock: Clock | None, outputs: Collection[AnyPath]
) -> _Model:
    """What a reader makes of a file; whatever goes wrong is one of the errors of `load`."""
    file = as_path(path)
    with (clock or Clock()).span("load"), np.errstate(all="ignore"):
        try:
            data = file.read_bytes()
        except OSError as error:
            raise ModelError(f"{file}: cannot be read: {error.strerror}") from error
        if not data:
            raise ModelError(f"{file}: is empty")
        try:
            return reader(data, Folder(file.parent, {Path(os.path.realpath(output)) for output in outputs}))
        except (UserWarning, OutputError):
            # One of the two warnings above, made an error by the caller; or what must not be overwritten.
            raise
        except InputError as error:
            raise ModelError(f"{file}: {error}") from error
        except CapacityError as error:
            raise CapacityError(f"{file}: {error}") from error
        except MemoryError as error:
            raise CapacityError(f"{file}: does not fit into memory") from error
        except Exception as error:
            raise ModelError(f"{file}: malformed ({type(error).__name__}: {in_a_line(error)})") from error


def save(scene: Scene, path: AnyPath, scalars: _Scalars | None = None) -> None:
    """Write a model, whole or not at all; the extension chooses among GLB, OBJ, PLY and STL.

    GLB keeps everything, triangles sorted by object and material, in world coordinates. OBJ, PLY and STL hold
    positions and triangles only (PLY also the vertex colours), in the scene's own coordinates.

    Parameters
    ----------
    scalars
        `(v,)` float32 numbers per vertex by lower-case name, for GLB (`hours` as the attribute `_HOURS`) and PLY.

    Raises
    ------
    InputError
        For scalars of another shape or type.
    OutputError
        For an unknown extension, one that keeps no scalars, or a path that cannot be written.
    """
    instance(scene, Scene, "save: scene")
    named = scalars or {}
    check_writable(path, SCALAR_MODELS if named else MODELS)
    for name, values in named.items():
        instance(values, np.ndarray, f"save: {name}")
        if values.shape != (len(scene.positions),) or values.dtype != np.float32:
            wanted = f"({len(scene.positions)},) float32"
            raise InputError(f"save: {name}: wanted {wanted}, got {values.shape} {values.dtype}")
    kind = Path(path).suffix.lower()
    data = _SCALAR_WRITERS[kind](scene, named) if kind in _SCALAR_WRITERS else _WRITERS[kind](scene)
    with written_whole(path) as stream:
        stream.write(data)


def check_readable(path: AnyPath) -> Callable[[bytes, Folder], Scene]:
    """Refuse what is no model file by its name; returns its reader.

    Raises
    ------
    ModelError
        For a file that is missing or no ordinary file, or another extension.
    """
    file = as_path(path)
    # Unlike those of Path, these are also false for a path that cannot be.
    if not os.path.exists(file):
        raise ModelError(f"{file}: no such file")
    if not os.path.isfile(file):
        raise ModelError(f"{file}: is not a file")
    if file.suffix.lower() not in _READERS:
        raise ModelError(f"{file}: unknown extension {file.suffix!r}, wanted one of {' '.join(_READERS)}")
    return _READERS[file.suffix.lower()]
