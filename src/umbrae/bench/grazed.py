"""The bad case of lists over the light's view: a ground that the light grazes, so that it sees all samples in line."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae import models
from umbrae.camera import Camera
from umbrae.light import Light
from umbrae.scene import Scene

ANGLE = 0.2
"""Degrees between the light and the ground."""
_WIDER, _BEYOND, _ABOVE, _FAR = 4.0, 32.0, 14.0, 150.0
"""How many times as wide the ground is, and where the camera and the point light are, in radii of a sphere."""


def _axes(towards: NDArray[np.float64], moving: NDArray[np.float64]) -> NDArray[np.float64]:
    """World axes in columns: x along the light, y up from a plane that it grazes wherever it moves."""
    edge_on = np.cross(towards, moving) / np.linalg.norm(np.cross(towards, moving))
    angle = math.radians(ANGLE)
    up = math.cos(angle) * edge_on - math.sin(angle) * towards
    along = math.cos(angle) * towards + math.sin(angle) * edge_on
    return np.stack([along, up, np.cross(along, up)], axis=1)


class Grazed:
    """Spheres half in a wide ground, turned so that a light that travels `towards`, and moves `moving`, grazes it."""

    def __init__(self, towards: tuple[float, float, float], moving: tuple[float, float, float]) -> None:
        self.towards = np.array(towards) / np.linalg.norm(towards)
        self.axes = _axes(self.towards, np.array(moving))

    def scene(self) -> Scene:
        """As many triangles as `spheres-96k` has."""
        upright = models.spheres(triangles=96_000)
        positions = upright.positions.astype(np.float64)
        ground = positions[:, 1] == 0.0
        positions[ground] *= _WIDER
        positions[~ground, 1] -= positions[~ground, 1].mean()
        normals = None if upright.normals is None else upright.normals @ self.axes.T
        return upright.moved(positions @ self.axes.T, normals)

    def camera(self, width: int, height: int) -> Camera:
        """Down on the ground behind the spheres, with shadows all over it."""
        eye, target = self.axes @ (_BEYOND, _ABOVE, 0.0), self.axes @ (_BEYOND, 0.0, 0.0)
        return Camera.look_at(eye, target, up=self.axes[:, 0], width=width, height=height)

    def light(self) -> Light:
        """Far away on the side that the light comes from."""
        return Light.point(-_FAR * self.towards)
