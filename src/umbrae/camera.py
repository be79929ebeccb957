"""The eye that looks at a scene."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import Vector, instance, number, vector, whole
from umbrae.errors import InputError
from umbrae.geometry.transforms import turning
from umbrae.scene import Scene

MAX_SIDE_PX = 1 << 16


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera; made by `Camera.look_at` or `Camera.frame`.

    Attributes
    ----------
    eye
        `(3,)` float64 position in the scene's coordinates.
    axes
        `(3, 3)` float64 orthonormal rows: right, up, forward.
    fov_y
        Vertical field of view in degrees.
    width, height
        Picture size in pixels.
    near
        Distance of the near plane in world units: nothing closer is seen. There is no far plane.
    """

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    fov_y: float
    width: int
    height: int
    near: float

    @classmethod
    def look_at(
        cls,
        eye: Vector,
        target: Vector,
        up: Vector = (0.0, 1.0, 0.0),
        fov_y: float = 50.0,
        width: int = 1920,
        height: int = 1080,
        near: float | None = None,
    ) -> "Camera":
        """A camera at `eye` that looks at `target`.

        `near` defaults to a thousandth of the distance between the two. When the view direction is parallel to `up`,
        another axis takes its place.
        """
        eye_position, target_position = vector(eye, "Camera.eye"), vector(target, "Camera.target")
        forward = target_position - eye_position
        distance = float(np.linalg.norm(forward))
        if distance == 0.0:
            raise InputError(f"Camera: eye and target are the same point {eye_position.tolist()}")
        if not 0.0 < number(fov_y, "Camera.fov_y") < 180.0:
            raise InputError(f"Camera.fov_y: wanted degrees between 0 and 180, got {fov_y}")
        for name, size in (("width", width), ("height", height)):
            if not 1 <= whole(size, f"Camera.{name}") <= MAX_SIDE_PX:
                raise InputError(f"Camera.{name}: wanted 1 to {MAX_SIDE_PX} pixels, got {size}")
        if near is None:
            near = distance / 1000.0
        if not number(near, "Camera.near") > 0.0:
            raise InputError(f"Camera.near: wanted a distance > 0, got {near}")
        forward = forward / distance
        up_axis = _unit(up)
        right = np.cross(forward, up_axis)
        if np.linalg.norm(right) < 1e-6:
            right = np.cross(forward, np.roll(np.eye(3)[int(np.argmax(np.abs(up_axis)))], 1))
        right = right / np.linalg.norm(right)
        axes = np.stack([right, np.cross(right, forward), forward])
        return cls(eye_position, axes, float(fov_y), int(width), int(height), float(near))

    @classmethod
    def frame(
        cls,
        scene: Scene,
        up: Vector = (0.0, 1.0, 0.0),
        fov_y: float = 50.0,
        width: int = 1920,
        height: int = 1080,
    ) -> "Camera":
        """A camera that sees the whole scene from a raised corner, filling the picture."""
        instance(scene, Scene, "scene")
        low, high = scene.bounds.astype(np.float64)
        center = (low + high) / 2
        radius = float(np.linalg.norm(high - low)) / 2 or 1.0
        up_axis = _unit(up)
        side = np.roll(np.eye(3)[int(np.argmax(np.abs(up_axis)))], 1)
        side = side - up_axis * float(side @ up_axis)
        side = side / np.linalg.norm(side)
        other = np.cross(up_axis, side)
        toward = 0.75 * side + 0.55 * other + 0.45 * up_axis
        toward = toward / np.linalg.norm(toward)
        axes = cls.look_at(center + toward * radius, center, up_axis, fov_y, width, height).axes
        used = np.unique(scene.triangles)
        points = scene.positions[used] - center if len(used) else np.zeros((1, 3))
        right, upward, depth = axes @ points.T
        tan_y = math.tan(math.radians(fov_y) / 2)
        tan_x = tan_y * width / height
        # Inside the picture: |right - x| <= tan_x (depth + distance), and the same upwards, for an eye shifted by
        # (x, y). The smallest distance with any such shift lets two opposite sides of the picture touch the scene.
        spread_x = (right - tan_x * depth).max() + (-right - tan_x * depth).max()
        spread_y = (upward - tan_y * depth).max() + (-upward - tan_y * depth).max()
        distance = max(1.06 * float(max(spread_x / tan_x, spread_y / tan_y)) / 2, 1e-3 * radius)
        x, y = _middle(right, depth + distance), _middle(upward, depth + distance)
        target = center + x * axes[0] + y * axes[1]
        eye = target + toward * distance
        return cls.look_at(eye, target, up_axis, fov_y, width, height, near=1e-3 * distance)

    def turned(self, about: Vector, axis: Vector, degrees: float) -> "Camera":
        """The camera carried around an axis through a point, counter-clockwise where the axis comes towards one."""
        center = vector(about, "Camera.turned: about")
        turn = turning(_unit(axis), number(degrees, "Camera.turned: degrees"))
        return replace(self, eye=center + turn @ (self.eye - center), axes=self.axes @ turn.T)

    @property
    def pixel_size(self) -> float:
        """Height of a pixel's picture at distance 1 along the view direction, in world units."""
        return 2.0 * math.tan(math.radians(self.fov_y) / 2) / self.height

    @property
    def world_to_clip(self) -> NDArray[np.float64]:
        """`(3, 4)` float64: maps `(x, y, z, 1)` to `(X, Y, W)`, with `X / W`, `Y / W` in [-1, 1] across the picture.

        x grows to the right and y upwards; `W` is the distance along the view direction in world units.
        """
        tan_y = math.tan(math.radians(self.fov_y) / 2)
        rows = self.axes * np.array([[self.height / (tan_y * self.width)], [1.0 / tan_y], [1.0]])
        return np.concatenate([rows, -(rows @ self.eye)[:, None]], axis=1)


def pixel_offsets(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a picture's samples lie within each pixel, `(count,)` x and `(count,)` y from its top left corner.

    The R2 sequence (Roberts 2018) about the centre; one sample is at the centre.
    """
    steps = np.arange(count, dtype=np.float64) - (count - 1) / 2
    plastic = 1.3247179572447460  # the real root of x**3 = x + 1
    return (0.5 + steps / plastic) % 1.0, (0.5 + steps / plastic**2) % 1.0


def _middle(offset: NDArray[np.float64], depth: NDArray[np.float64]) -> float:
    """The shift that brings points at sideways `offset` and `depth` into the middle of the picture.

    It balances the outermost points on both sides; which ones those are depends on the shift, so a few rounds.
    """
    shift = 0.0
    for _ in range(4):
        seen = (offset - shift) / depth
        low, high = int(np.argmin(seen)), int(np.argmax(seen))
        weight_low, weight_high = 1.0 / depth[low], 1.0 / depth[high]
        shift = float((offset[low] * weight_low + offset[high] * weight_high) / (weight_low + weight_high))
    return shift


def _unit(up: Vector) -> NDArray[np.float64]:
    axis = vector(up, "Camera.up")
    if not axis.any():
        raise InputError("Camera.up: wanted a vector that is not zero")
    # Scaled first: squares of very large or small numbers leave the range of float64.
    axis = axis / np.abs(axis).max()
    unit: NDArray[np.float64] = axis / np.linalg.norm(axis)
    return unit
