"""What a model file refers to: the files beside it and the pictures in them."""

import io
import os
import posixpath
import re
import urllib.parse
import warnings
from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage

from umbrae.errors import InputError, ModelError, OutputError
from umbrae.material import texels


class Folder:
    """The model's folder, the only place that its references may lead to.

    Pictures are decoded once: materials that name the same one share its array. Files that are about to be
    overwritten by the work that the model is read for (`outputs`, real paths) are refused.
    """

    def __init__(self, path: Path, outputs: Collection[Path] = ()) -> None:
        self.path = path
        self.outputs = outputs
        self._textures: dict[str, NDArray[np.uint8]] = {}

    def locate(self, reference: str, what: str) -> Path:
        """Path of a relative reference; refuses absolute paths, web addresses and `..` out of the folder."""
        plain = posixpath.normpath(reference.replace("\\", "/"))
        if re.match(r"[A-Za-z][A-Za-z0-9+.-]*:", plain) or plain.startswith(("/", "../")) or plain == "..":
            raise ModelError(f"{what} {_short(reference)} points outside the model's folder")
        return self.path / plain

    def has(self, reference: str, what: str) -> bool:
        """Whether the referenced file is there."""
        return os.path.isfile(self.locate(reference, what))

    def read(self, reference: str, what: str) -> bytes:
        """Content of the referenced file."""
        if not self.has(reference, what):
            raise ModelError(f"{what} {_short(reference)} is missing")
        if self.locate(reference, what).resolve() in self.outputs:
            raise OutputError(f"{self.locate(reference, what)}: would overwrite the model's {what}")
        try:
            return self.locate(reference, what).read_bytes()
        except OSError as error:
            raise ModelError(f"{what} {_short(reference)} cannot be read: {error.strerror}") from error

    def texture(self, reference: str) -> NDArray[np.uint8]:
        """The referenced picture, `(h, w, 4) uint8`."""
        key = str(self.locate(reference, "texture"))
        if key not in self._textures:
            self._textures[key] = decode_texture(self.read(reference, "texture"), _short(reference))
        return self._textures[key]


def unquote(uri: str) -> str:
    """The path that a percent-encoded URI stands for; a literal `%` that is no escape stays as it is."""
    return urllib.parse.unquote(uri)


def encoded(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear values in [0, 1] as sRGB-encoded ones, the inverse of `linear`."""
    values = np.asarray(linear, np.float64)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * np.maximum(values, 0.0031308) ** (1 / 2.4) - 0.055)


def decode_texture(data: bytes, name: str) -> NDArray[np.uint8]:
    """Picture bytes as `(h, w, 4) uint8`, row 0 at the top."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", PillowImage.DecompressionBombWarning)
            with PillowImage.open(io.BytesIO(data)) as picture:
                return texels(picture, f"texture {name}")
    except (PillowImage.DecompressionBombWarning, PillowImage.DecompressionBombError) as error:
        raise ModelError(f"texture {name} is too large to be decoded safely") from error
    except InputError as error:
        raise ModelError(str(error)) from error
    except Exception as error:
        raise ModelError(f"texture {name} cannot be read as a picture") from error


def linear(encoded: NDArray[np.floating]) -> NDArray[np.float64]:
    """sRGB-encoded values in [0, 1] as linear ones (IEC 61966-2-1)."""
    values = np.asarray(encoded, np.float64)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def decode_text(data: bytes) -> str:
    """Text in UTF-8, UTF-16 with its mark, or else Latin-1."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _short(reference: str) -> str:
    return repr(reference if len(reference) <= 80 else reference[:77] + "...")
