"""Reading and writing of models, pictures and arrays: the only place that touches files."""

import os
import secrets
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL.PngImagePlugin import PngInfo

from umbrae.animation import Animation
from umbrae.checks import instance, shown
from umbrae.clock import Clock
from umbrae.errors import CapacityError, InputError, ModelError, OutputError
from umbrae.formats.glb import write_glb
from umbrae.formats.gltf import read_gltf
from umbrae.formats.gltf_animation import animation_names, read_animation
from umbrae.formats.meshes import read_ply, read_stl, scene_from_trimesh, write_ply, write_stl
from umbrae.formats.obj import read_obj, write_obj
from umbrae.formats.resources import Folder
from umbrae.formats.video import write_mp4
from umbrae.scene import Scene

__all__ = [
    "CLIPS",
    "IMAGES",
    "MODELS",
    "SCALAR_MODELS",
    "check_readable",
    "check_writable",
    "load",
    "load_animation",
    "load_image",
    "load_text",
    "names_of_animations",
    "save",
    "save_arrays",
    "save_clip",
    "save_image",
    "save_table",
    "save_text",
    "scene_from_trimesh",
]

AnyPath = str | os.PathLike[str]
_Model = TypeVar("_Model")
_ANIMATED = (".glb", ".gltf")
_MADE_OF = "umbrae"
_ROWS = 1 << 14
"""Rows of a table that are turned into text at a time."""

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
_IMAGES = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}

MODELS = tuple(sorted([*_SCALAR_WRITERS, *_WRITERS]))
"""Extensions of models that `save` writes."""
SCALAR_MODELS = tuple(_SCALAR_WRITERS)
"""Extensions of models that keep numbers per vertex."""
IMAGES = tuple(_IMAGES)
"""Extensions of pictures that `save_image` writes."""
CLIPS = (".mp4",)
"""Extensions of clips that `save_clip` writes."""


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
    file = _path(path)
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
            raise ModelError(f"{file}: malformed ({type(error).__name__}: {_line(error)})") from error


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
    with _whole(path) as stream:
        stream.write(data)


def save_image(path: AnyPath, pixels: NDArray[Any], made_of: str = "") -> None:
    """Write a picture, whole or not at all; the extension chooses the format.

    Parameters
    ----------
    pixels
        `(h, w, 3) uint8`, or one channel: `(h, w) uint8`, or `(h, w) bool` for a mask (white is true).
    made_of
        What the picture was made of, in a few words; kept in PNG files, for `load_image`.

    Raises
    ------
    OutputError
        For an unknown extension or a path that cannot be written.
    """
    check_writable(path, IMAGES)
    values = pixels.astype(np.uint8) * np.uint8(255) if pixels.dtype == bool else pixels
    if values.dtype != np.uint8 or not (values.ndim == 2 or (values.ndim == 3 and values.shape[2] == 3)):
        raise InputError(f"save_image: wanted (h, w, 3) or (h, w) uint8 or bool, got {pixels.shape} {pixels.dtype}")
    kind = _IMAGES[Path(path).suffix.lower()]
    options: dict[str, Any] = {"quality": 95} if kind in ("JPEG", "WEBP") else {}
    if made_of and kind == "PNG":
        options["pnginfo"] = PngInfo()
        options["pnginfo"].add_text(_MADE_OF, made_of)
    with _whole(path) as stream:
        try:
            PillowImage.fromarray(values).save(stream, kind, **options)
        except (ValueError, SystemError) as error:
            raise OutputError(f"{path}: cannot be written as {kind}: {_line(error)}") from error


def load_image(path: AnyPath, made_of: str) -> NDArray[np.uint8] | None:
    """The pixels of a whole PNG file that `save_image` has written, `made_of` the same; None for anything else."""
    try:
        with PillowImage.open(_path(path)) as picture:
            if getattr(picture, "text", {}).get(_MADE_OF) == made_of:
                return np.asarray(picture)
    except Exception:
        pass  # whatever is wrong with it, it is to be made anew
    return None


def save_clip(path: AnyPath, pictures: Iterable[NDArray[np.uint8]], fps: float) -> None:
    """Write pictures `(h, w, 3) uint8` of one even size as a clip (H.264), whole or not at all.

    Raises
    ------
    OutputError
        For another extension than .mp4, or a path that cannot be written.
    OptionError
        Without imageio and PyAV.
    """
    check_writable(path, CLIPS)
    with _whole(path) as stream:
        write_mp4(stream, pictures, fps)


def save_arrays(path: AnyPath, **arrays: NDArray[Any]) -> None:
    """Write arrays as `.npz`, whole or not at all, not compressed.

    Raises
    ------
    OutputError
        For another extension or a path that cannot be written.
    """
    check_writable(path, (".npz",))
    with _whole(path) as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def save_table(path: AnyPath, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write columns `(n,)` as `.csv` with a line of names, whole or not at all.

    float32 is written to 7 digits, float64 to 12.

    Raises
    ------
    OutputError
        For another extension or a path that cannot be written.
    """
    check_writable(path, (".csv",))
    digits = {"f4": "%.7g", "f8": "%.12g"}
    formats = [digits.get(values.dtype.str[1:], "%d") for values in columns.values()]
    rows = len(next(iter(columns.values())))
    with _whole(path) as stream:
        stream.write((",".join(columns) + "\n").encode())
        # Part by part: a matrix of everything would be a second copy.
        for start in range(0, rows, _ROWS):
            part = [values[start : start + _ROWS].astype(np.float64) for values in columns.values()]
            np.savetxt(stream, np.column_stack(part), fmt=formats, delimiter=",")


def load_text(path: AnyPath) -> str:
    """Read a text file in UTF-8.

    Raises
    ------
    InputError
        For a file that is missing, cannot be read, or is no text.
    """
    file = _path(path)
    try:
        return file.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: is not a text in UTF-8") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or _line(error)}") from error


def save_text(path: AnyPath, text: str) -> None:
    """Write a text in UTF-8, whole or not at all.

    Raises
    ------
    OutputError
        For a path that cannot be written.
    """
    check_writable(path)
    with _whole(path) as stream:
        stream.write(text.encode())


def check_readable(path: AnyPath) -> Callable[[bytes, Folder], Scene]:
    """Refuse what is no model file by its name; returns its reader.

    Raises
    ------
    ModelError
        For a file that is missing or no ordinary file, or another extension.
    """
    file = _path(path)
    # Unlike those of Path, these are also false for a path that cannot be.
    if not os.path.exists(file):
        raise ModelError(f"{file}: no such file")
    if not os.path.isfile(file):
        raise ModelError(f"{file}: is not a file")
    if file.suffix.lower() not in _READERS:
        raise ModelError(f"{file}: unknown extension {file.suffix!r}, wanted one of {' '.join(_READERS)}")
    return _READERS[file.suffix.lower()]


def check_writable(path: AnyPath, extensions: Collection[str] = ()) -> None:
    """Refuse a path that cannot be written, before the work for it starts.

    Parameters
    ----------
    extensions
        Those that are allowed, such as `IMAGES`; any if empty.

    Raises
    ------
    OutputError
        For a folder that is missing or not writable, a path that is no ordinary file, or another extension.
    """
    file = _path(path)
    if extensions and file.suffix.lower() not in extensions:
        raise OutputError(f"{file}: unknown extension {file.suffix!r}, wanted one of {' '.join(extensions)}")
    try:
        folder = Path(os.path.realpath(file)).parent
        if not folder.is_dir():
            raise OutputError(f"{file}: no such folder: {folder}")
        if file.is_dir():
            raise OutputError(f"{file}: is a folder")
        if file.exists() and not (stat.S_ISREG(file.stat().st_mode) and os.access(file, os.W_OK)):
            raise OutputError(f"{file}: cannot be overwritten")
        if not os.access(folder, os.W_OK | os.X_OK):
            raise OutputError(f"{file}: the folder {folder} is not writable")
    except (OSError, ValueError) as error:
        if isinstance(error, OutputError):
            raise
        raise OutputError(f"{file}: cannot be written: {_line(error)}") from error


@contextmanager
def _whole(path: AnyPath) -> Iterator[BinaryIO]:
    """A stream whose content appears at the path when all of it was written, and leaves nothing otherwise."""
    # Through a link to what it points to, as opening the path would.
    file = Path(os.path.realpath(path))
    part = file.with_name(f".{file.name[:100]}.{secrets.token_hex(6)}.part")
    try:
        with open(part, "xb") as stream:
            yield stream
        os.replace(part, file)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or _line(error)}") from error
    finally:
        part.unlink(missing_ok=True)


def _path(path: AnyPath) -> Path:
    if not isinstance(path, str | os.PathLike) or not isinstance(os.fspath(path), str):
        raise InputError(f"wanted a path, got {shown(path)}")
    return Path(path)


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:120]
