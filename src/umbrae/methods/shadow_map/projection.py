"""Where a shadow map looks: one window for parallel light or a scene before the light, or the six faces of a cube."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PROJECTIONS = ("auto", "single", "cube")

AUTO_SLOPE = 1.0
"""`auto` takes a single map up to this |x / z|, |y / z|: 90 degrees, as a cube's face."""

WIDEST_SLOPE = 4.0
"""A single map is refused beyond this: 152 degrees."""

_NEAREST = 2.0**-20
"""The near plane of a cube's faces, of the far plane's distance. Depth is reversed, so it costs no digits."""

_ROOM = 1e-4
"""How much wider than the scene a map is."""

_SHARED = 1 + 2.0**-20
"""Rounding must not leave a sample between two faces to neither: each takes this much of the other's."""


class View(NamedTuple):
    """A map: the matrix to its clip coordinates, the unit vector along which it looks, and which part answers.

    `own` is the largest |x / w|, |y / w| of samples that this map answers; beyond it a filter finds what it needs.
    """

    to_map: Floats
    forward: Floats
    own: float = 1.0

    def nearer(self, distance: float) -> Floats:
        """`(4,)` what moving a point towards the light by that distance adds to its clip coordinates."""
        step: Floats = self.to_map @ np.append(-distance * self.forward, 0.0)
        return step


def views(light: Floats, half: Floats, projection: str, margin: float = 0.0) -> list[View] | None:
    """The maps of a light `(4,)` over a box of casters around 0 with the half-widths `half`.

    A cube's faces are wider than 90 degrees, so that a filter at their border looks at more of the same plane: `margin`
    is the share of a face's width at each side that is such a border.

    None where a single map is wanted and cannot hold the box. Window and depth are formed in float64 from the light's
    own axes, so that a far light costs no digits.
    """
    corners = half * np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    source = light[:3]
    if light[3] == 0.0:
        axes = _axes(-source)
        return [_parallel(axes, corners @ axes.T)]
    single = None
    if projection != "cube" and source.any():
        axes = _axes(-source)
        seen = (corners - source) @ axes.T
        slope = float(np.abs(seen[:, :2] / seen[:, 2:]).max()) if seen[:, 2].min() > 0 else np.inf
        if slope <= (AUTO_SLOPE if projection == "auto" else WIDEST_SLOPE):
            single = _perspective(axes, source, seen)
    if projection == "single" or single is not None:
        return None if single is None else [single]
    # Every face sees as far as the farthest corner does along any axis.
    reach = float(np.abs(corners - source).max()) or 1.0
    square = np.array([[x, y, 1.0] for x in (-1, 1) for y in (-1, 1)]) * reach
    near = np.array([[0.0, 0.0, _NEAREST * reach]])
    seen = np.concatenate([square, near])
    directions = [sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
    own = 1 - 2 * margin
    faces = (_perspective(_axes(direction), source, seen, room=1 / own - 1) for direction in directions)
    return [face._replace(own=own * _SHARED) for face in faces]


def _axes(forward: Floats) -> Floats:
    """Right, up and forward as rows, unit vectors."""
    forward = forward / np.abs(forward).max()
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _parallel(axes: Floats, seen: Floats) -> View:
    """Depth 1 at the nearest of the corners `seen (n, 3)`, in these axes, and 0 at the farthest."""
    (x, width), (y, height), (z, length) = (_window(seen[:, axis]) for axis in range(3))
    matrix = np.zeros((4, 4))
    matrix[0, :3], matrix[0, 3] = axes[0] / width, -x / width
    matrix[1, :3], matrix[1, 3] = axes[1] / height, -y / height
    matrix[2, :3], matrix[2, 3] = -axes[2] / (2 * length), 0.5 + z / (2 * length)
    matrix[3, 3] = 1.0
    return View(matrix, axes[2])


def _perspective(axes: Floats, source: Floats, seen: Floats, room: float = _ROOM) -> View:
    """Depth n (f - z) / (z (f - n)): 1 at the nearest of the corners `seen (n, 3)`, 0 at the farthest."""
    x, width = _window(seen[:, 0] / seen[:, 2], room)
    y, height = _window(seen[:, 1] / seen[:, 2], room)
    near, far = float(seen[:, 2].min()), float(seen[:, 2].max())
    spread = _ROOM * (far - near) or _ROOM * far
    near, far = max(near - spread, 0.5 * near), far + spread
    place = axes @ source
    matrix = np.zeros((4, 4))
    matrix[3, :3], matrix[3, 3] = axes[2], -place[2]
    matrix[0, :3], matrix[0, 3] = axes[0], -place[0]
    matrix[1, :3], matrix[1, 3] = axes[1], -place[1]
    matrix[0] = (matrix[0] - x * matrix[3]) / width
    matrix[1] = (matrix[1] - y * matrix[3]) / height
    matrix[2] = -near / (far - near) * matrix[3]
    matrix[2, 3] = near / (far - near) * (far + place[2])
    return View(matrix, axes[2])


def _window(values: Floats, room: float = _ROOM) -> tuple[float, float]:
    """Centre and half-width of an interval, never empty."""
    low, high = float(values.min()), float(values.max())
    return (low + high) / 2, (1 + room) * (high - low) / 2 or 1.0
