"""Pictures, clips, arrays, tables and texts."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage
from PIL.PngImagePlugin import PngInfo

from umbrae.errors import InputError, OutputError
from umbrae.files.paths import AnyPath, as_path, check_writable, in_a_line, written_whole
from umbrae.formats.video import write_mp4

_IMAGES = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".bmp": "BMP",
}

IMAGES = tuple(_IMAGES)
"""Extensions of pictures that `save_image` writes."""
CLIPS = (".mp4",)
"""Extensions of clips that `save_clip` writes."""

_MADE_OF = "umbrae"
_ROWS = 1 << 14
"""Rows of a table that are turned into text at a time."""


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
    with written_whole(path) as stream:
        try:
            PillowImage.fromarray(values).save(stream, kind, **options)
        except (ValueError, SystemError) as error:
            raise OutputError(f"{path}: cannot be written as {kind}: {in_a_line(error)}") from error


def load_image(path: AnyPath, made_of: str) -> NDArray[np.uint8] | None:
    """The pixels of a whole PNG file that `save_image` has written, `made_of` the same; None for anything else."""
    try:
        with PillowImage.open(as_path(path)) as picture:
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
    with written_whole(path) as stream:
        write_mp4(stream, pictures, fps)


def save_arrays(path: AnyPath, **arrays: NDArray[Any]) -> None:
    """Write arrays as `.npz`, whole or not at all, not compressed.

    Raises
    ------
    OutputError
        For another extension or a path that cannot be written.
    """
    check_writable(path, (".npz",))
    with written_whole(path) as stream:
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
    with written_whole(path) as stream:
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
    file = as_path(path)
    try:
        return file.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: is not a text in UTF-8") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read: {getattr(error, 'strerror', None) or in_a_line(error)}") from error


def save_text(path: AnyPath, text: str) -> None:
    """Write a text in UTF-8, whole or not at all.

    Raises
    ------
    OutputError
        For a path that cannot be written.
    """
    check_writable(path)
    with written_whole(path) as stream:
        stream.write(text.encode())
