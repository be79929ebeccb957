"""glTF files with animations, written by hand: each array is an accessor of its own."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_TYPES = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}

QUARTER = (0.0, 0.0, float(np.sqrt(0.5)), float(np.sqrt(0.5)))
"""A quarter turn around z: x goes to y."""
STILL = (0.0, 0.0, 0.0, 1.0)


class Writer:
    """Collects arrays; `write` puts them into a file with the rest of the tree."""

    def __init__(self) -> None:
        self.blob = b""
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, rows: Any, dtype: str = "f4", **more: Any) -> int:
        """The number of a new accessor."""
        values: NDArray[Any] = np.ascontiguousarray(rows, dtype)
        width = 1 if values.ndim == 1 else int(np.prod(values.shape[1:]))
        self.views.append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": values.nbytes})
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": _TYPES[dtype],
                "count": len(values),
                "type": _KINDS[width],
                **more,
            }
        )
        self.blob += values.tobytes() + bytes(-values.nbytes % 4)
        return len(self.accessors) - 1

    def mesh(self, positions: Any, indices: Any = None, **attributes: int) -> dict[str, Any]:
        """A mesh of one primitive."""
        primitive: dict[str, Any] = {"attributes": {"POSITION": self.add(positions), **attributes}}
        if indices is not None:
            primitive["indices"] = self.add(indices, "u2")
        return {"primitives": [primitive]}

    def clip(
        self, *channels: tuple[int, str, Any, Any] | tuple[int, str, Any, Any, str], name: str = ""
    ) -> dict[str, Any]:
        """An animation of channels (node, path, times, values[, interpolation])."""
        made: dict[str, Any] = {"name": name, "samplers": [], "channels": []}
        for index, (node, path, times, values, *interpolation) in enumerate(channels):
            sampler = {"input": self.add(times), "output": self.add(values)}
            made["samplers"].append(sampler | ({"interpolation": interpolation[0]} if interpolation else {}))
            made["channels"].append({"sampler": index, "target": {"node": node, "path": path}})
        return made

    def write(self, path: Path, **tree: Any) -> Path:
        """The file; all nodes without a parent are in the scene unless `scenes` says otherwise."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.blob).decode()
        base = {
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": len(self.blob), "uri": uri}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        path.write_text(json.dumps(base | tree))
        return path


TRIANGLE = np.array([[1, 0, 0], [3, 0, 0], [1, 0, 1]], np.float32)


def turning(path: Path, *more: tuple[int, str, Any, Any], **tree: Any) -> Path:
    """A triangle whose node makes a quarter turn around z within two seconds."""
    made = Writer()
    clip = made.clip((0, "rotation", [0, 2], [STILL, QUARTER]), *more, name="turn")
    return made.write(path, **({"meshes": [made.mesh(TRIANGLE)], "nodes": [{"mesh": 0}], "animations": [clip]} | tree))


def arm(path: Path, weights: Any = None, joints: Any = None, **changes: Any) -> Path:
    """A strip along x on two bones: the elbow, at x = 2, makes a quarter turn around z within a second.

    Vertices at x = 0, 2, 4 hang on the first bone, on both alike, and on the second; the one at 9 is in no triangle.
    """
    made = Writer()
    positions = [[0, 0, 0], [0, 1, 0], [9, 9, 9], [2, 0, 0], [2, 1, 0], [4, 0, 0], [4, 1, 0]]
    weights = weights or [[1, 0, 0, 0]] * 3 + [[0.5, 0.5, 0, 0]] * 2 + [[1, 0, 0, 0]] * 2
    joints = joints or [[0, 0, 0, 0]] * 3 + [[0, 1, 0, 0]] * 2 + [[1, 0, 0, 0]] * 2
    mesh = made.mesh(
        positions,
        [0, 3, 1, 3, 4, 1, 3, 5, 4, 5, 6, 4],
        NORMAL=made.add([[0, 0, 1]] * 7),
        JOINTS_0=made.add(joints, "u1"),
        WEIGHTS_0=made.add(weights),
    )
    back = np.eye(4)
    back[0, 3] = -2
    inverse = made.add([np.eye(4).T.ravel(), back.T.ravel()])
    tree: dict[str, Any] = {
        "meshes": [mesh],
        "nodes": [
            {"mesh": 0, "skin": 0, "translation": [50, 50, 50]},
            {"children": [2]},
            {"translation": [2, 0, 0]},
        ],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": inverse}],
        "animations": [made.clip((2, "rotation", [0, 1], [STILL, QUARTER]), name="bend")],
    }
    return made.write(path, **(tree | changes))
