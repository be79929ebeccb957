"""The JSON, buffers, accessors and pictures of a glTF 2.0 or GLB file.

Every number of the file is checked before it is used: a count larger than the file can hold, an index out of
range, a string where a number belongs.
"""

import base64
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import ModelError
from umbrae.formats.resources import Folder, decode_texture, unquote

_EXTENSIONS = (
    "KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights_punctual", "EXT_texture_webp",
    "EXT_mesh_gpu_instancing",
)  # fmt: skip
"""What a file may require, besides `KHR_materials_*`, which change the look and never the shape."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_INDICES = "<u1", "<u2", "<u4"


class Entry:
    """A JSON object that knows where in the file it stands, and gives out values of the type asked for."""

    def __init__(self, fields: Any, where: str) -> None:
        if not isinstance(fields, dict):
            raise _wrong(where, "an object", fields)
        self.fields: dict[str, Any] = fields
        self.where = where

    def __contains__(self, name: str) -> bool:
        return name in self.fields

    def path(self, name: str) -> str:
        """Where a member stands, for messages."""
        return f"{self.where}.{name}" if self.where else name

    def whole(self, name: str, default: int | None = None) -> int:
        """A whole number, zero or more; required if there is no default."""
        return _whole(self.fields.get(name, default), self.path(name))

    def number(self, name: str, default: float) -> float:
        """A finite number."""
        return float(_number(self.fields.get(name, default), self.path(name)))

    def numbers(self, name: str, default: list[float]) -> NDArray[np.float64]:
        """As many finite numbers as the default has."""
        value = self.array(name) or default
        if len(value) != len(default):
            raise _wrong(self.path(name), f"{len(default)} numbers", value)
        return np.array([_number(item, self.path(name)) for item in value], np.float64)

    def text(self, name: str, default: str) -> str:
        """A string."""
        value = self.fields.get(name, default)
        if not isinstance(value, str):
            raise _wrong(self.path(name), "a string", value)
        return value

    def array(self, name: str) -> list[Any]:
        """An array of anything; empty if absent."""
        value = self.fields.get(name, [])
        if not isinstance(value, list):
            raise _wrong(self.path(name), "an array", value)
        return value

    def wholes(self, name: str) -> list[int]:
        """An array of whole numbers; empty if absent."""
        return [_whole(value, f"{self.path(name)}[{i}]") for i, value in enumerate(self.array(name))]

    def entry(self, name: str) -> "Entry":
        """An object; empty if absent."""
        return Entry(self.fields.get(name, {}), self.path(name))

    def entries(self, name: str) -> "list[Entry]":
        """An array of objects; empty if absent."""
        return [Entry(value, f"{self.path(name)}[{i}]") for i, value in enumerate(self.array(name))]


class Document:
    """A glTF file taken apart; `root` is its JSON."""

    def __init__(self, data: bytes, folder: Folder) -> None:
        self.folder = folder
        self._chunk: bytes | None = None
        if data.startswith(b"glTF"):
            data, self._chunk = _chunks(data)
        try:
            tree = json.loads(data.decode("utf-8-sig"))
        except (ValueError, RecursionError) as error:
            raise ModelError(f"is not valid JSON ({error})") from error
        self.root = Entry(tree, "")
        version = self.root.entry("asset").text("version", "2.0")
        if not version.startswith("2."):
            raise ModelError(f"is glTF {version[:20]!r}, wanted 2.0")
        for name in self.root.array("extensionsRequired"):
            if name not in _EXTENSIONS and not str(name).startswith("KHR_materials_"):
                raise ModelError(f"requires the extension {str(name)[:60]}, which is not supported")
        self._lists: dict[str, list[Entry]] = {}
        self._buffers: dict[int, bytes] = {}
        self._accessors: dict[int, NDArray[Any]] = {}
        self._textures: dict[int, NDArray[np.uint8]] = {}
        for entry in [*self.items("buffers"), *self.items("images")]:
            uri = entry.text("uri", "data:")
            if not uri.startswith("data:"):
                folder.locate(unquote(uri), entry.where)

    def items(self, name: str) -> list[Entry]:
        """All entries of a top-level array."""
        if name not in self._lists:
            self._lists[name] = self.root.entries(name)
        return self._lists[name]

    def item(self, name: str, index: int, where: str) -> Entry:
        """One entry of a top-level array, named by `where`."""
        items = self.items(name)
        if index >= len(items):
            raise ModelError(f"{where}: wanted one of {len(items)} {name}, got {index}")
        return items[index]

    def accessor(self, index: int, where: str) -> NDArray[Any]:
        """The accessor's `(count, width)` numbers; normalized integers as float64 in [0, 1] or [-1, 1]."""
        entry = self.item("accessors", index, where)
        if index not in self._accessors:
            self._accessors[index] = self._read_accessor(entry)
        return self._accessors[index]

    def numbers(self, entry: Entry, name: str, width: int) -> NDArray[np.float64]:
        """The accessor that a member of an entry names, as rows of so many finite numbers."""
        rows = self.accessor(entry.whole(name), entry.path(name)).astype(np.float64)
        if rows.shape[1] != width or not np.isfinite(rows).all():
            raise ModelError(f"{entry.path(name)}: wanted rows of {width} finite numbers, got {rows.shape}")
        return rows

    def texture(self, index: int, where: str) -> NDArray[np.uint8]:
        """The picture of a texture, `(h, w, 4) uint8`, the same array for the same picture."""
        texture = self.item("textures", index, where)
        webp = texture.entry("extensions").entry("EXT_texture_webp")
        if "source" not in texture and "source" not in webp:
            raise ModelError(f"{texture.where}: its picture is missing or in a format that is not supported")
        source = (webp if "source" in webp else texture).whole("source")
        image = self.item("images", source, f"{texture.where}.source")
        if source not in self._textures:
            uri = image.text("uri", "")
            if "bufferView" in image:
                data = bytes(self._view(image.whole("bufferView"), image.where)[0])
                self._textures[source] = decode_texture(data, image.where)
            elif uri.startswith("data:"):
                self._textures[source] = decode_texture(_inline(uri, image.where), image.where)
            else:
                self._textures[source] = self.folder.texture(unquote(uri))
        return self._textures[source]

    def _read_accessor(self, entry: Entry) -> NDArray[Any]:
        kind, component = entry.text("type", ""), entry.whole("componentType")
        dtype = _COMPONENTS.get(component)
        if kind not in _WIDTHS or dtype is None:
            raise ModelError(f"{entry.where}: {kind!r} of component type {component} is nothing for meshes or bones")
        count, width = entry.whole("count"), _WIDTHS[kind]
        sparse = entry.entry("sparse")
        if "bufferView" in entry:
            rows = self._rows(entry, entry.whole("bufferView"), dtype, count, width)
        elif "sparse" in entry:
            # Zeros take no room in the file, but no sane file has more of them than bytes.
            if count > sum(buffer.whole("byteLength") for buffer in self.items("buffers")):
                raise ModelError(f"{entry.where}: count {count} is more than the file can hold")
            rows = np.zeros((count, width), dtype)
        else:
            raise ModelError(f"{entry.where} has no bufferView (compressed by an extension?)")
        if "sparse" in entry:
            where, values, changed = sparse.entry("indices"), sparse.entry("values"), sparse.whole("count")
            index_type = _COMPONENTS.get(where.whole("componentType"))
            if index_type not in _INDICES:
                raise ModelError(f"{where.where}.componentType: wanted unsigned integers")
            index = self._rows(where, where.whole("bufferView"), index_type, changed, 1)[:, 0]
            if changed and index.max() >= count:
                raise ModelError(f"{where.where}: index {index.max()} of {count}")
            rows[index] = self._rows(values, values.whole("bufferView"), dtype, changed, width)
        if entry.fields.get("normalized") is True and dtype != "<f4":
            return np.maximum(rows / np.float64(np.iinfo(dtype).max), -1.0)
        return rows

    def _rows(self, entry: Entry, view: int, dtype: str, count: int, width: int) -> NDArray[Any]:
        """A copy of `count` rows of `width` numbers in a buffer view, from `entry.byteOffset` on."""
        data, stride = self._view(view, entry.path("bufferView"))
        start, size = entry.whole("byteOffset", 0), np.dtype(dtype).itemsize * width
        stride = stride or size
        if stride < size:
            raise ModelError(f"{entry.where}: rows of {size} bytes do not fit a stride of {stride}")
        if count and start + stride * (count - 1) + size > len(data):
            raise ModelError(
                f"{entry.where}: {count} rows of {size} bytes overrun bufferView {view} ({len(data)} bytes)"
            )
        strides = (stride, np.dtype(dtype).itemsize)
        return np.ndarray((count, width), dtype, data, start if count else 0, strides).copy()

    def _view(self, index: int, where: str) -> tuple[memoryview, int]:
        """The bytes of a buffer view and its stride, 0 if tight."""
        view = self.item("bufferViews", index, where)
        data = self._buffer(view.whole("buffer"), view.where)
        start, length = view.whole("byteOffset", 0), view.whole("byteLength")
        if start + length > len(data):
            raise ModelError(f"{view.where} ends at byte {start + length} of a buffer of {len(data)}")
        return memoryview(data)[start : start + length], view.whole("byteStride", 0)

    def _buffer(self, index: int, where: str) -> bytes:
        entry = self.item("buffers", index, where)
        if index not in self._buffers:
            uri, length = entry.text("uri", ""), entry.whole("byteLength")
            if "uri" not in entry:
                data = (self._chunk if index == 0 else None) or b""
            elif uri.startswith("data:"):
                data = _inline(uri, entry.where)
            else:
                data = self.folder.read(unquote(uri), entry.where)
            if len(data) < length:
                raise ModelError(f"{entry.where} holds {len(data)} bytes, wanted {length}")
            self._buffers[index] = data
        return self._buffers[index]


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a GLB container."""
    if len(data) < 20:
        raise ModelError(f"is truncated: {len(data)} bytes are less than a GLB header")
    version, length, json_length, json_type = struct.unpack_from("<4xIII4s", data)
    if version != 2:
        raise ModelError(f"is GLB version {version}, wanted 2")
    if length > len(data):
        raise ModelError(f"is truncated: {len(data)} of {length} bytes")
    if json_type != b"JSON" or 20 + json_length > length:
        raise ModelError("is malformed: no JSON chunk at the start of the GLB")
    text, start = data[20 : 20 + json_length], 20 + json_length
    while start + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, start)
        if start + 8 + size > length:
            raise ModelError(f"is malformed: a GLB chunk of {size} bytes overruns the file")
        if kind == b"BIN\0":
            return text, data[start + 8 : start + 8 + size]
        start += 8 + size
    return text, None


def _inline(uri: str, where: str) -> bytes:
    head, _, body = uri.partition(",")
    if not head.endswith(";base64"):
        raise ModelError(f"{where}.uri: wanted base64 data, got {head[:40]!r}")
    try:
        return base64.b64decode(unquote(body), validate=True)
    except ValueError as error:
        raise ModelError(f"{where}.uri: {error}") from error


def _whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < 1e18 or value % 1:
        raise _wrong(where, "a whole number", value)
    return int(value)


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
        raise _wrong(where, "a finite number", value)
    return float(value)


def _wrong(where: str, wanted: str, got: Any) -> ModelError:
    shown = "nothing" if got is None else json.dumps(got)
    return ModelError(
        f"{where or 'top level'}: wanted {wanted}, got {shown if len(shown) <= 40 else shown[:37] + '...'}"
    )
