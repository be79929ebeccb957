"""A picture's samples, and a scene's triangles in its coordinates."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.parallel import expand, inline
from umbrae.sampling.coverage import Vertex
from umbrae.scene import Scene


class Picture(NamedTuple):
    """Where samples lie: pixel (row, column) has its sample k at (column + x[k], row + y[k])."""

    width: int
    height: int
    near: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]


class Geometry(NamedTuple):
    """Triangles in the scene, and the `(3, 4)` matrix that takes them to homogeneous pixel coordinates."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    matrix: NDArray[np.float64]


def project(scene: Scene, camera: Camera) -> Geometry:
    """The triangles of a scene as a camera sees them."""
    width, height = camera.width, camera.height
    pixels_from_clip = np.array([[width / 2, 0, width / 2], [0, -height / 2, height / 2], [0, 0, 1]])
    return Geometry(scene.positions, scene.triangles, pixels_from_clip @ camera.world_to_clip)


@expand
def projected(matrix: NDArray[np.float64], x: float, y: float, z: float) -> Vertex:
    """Homogeneous pixel coordinates of a point, see coverage.py."""
    return (
        matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3],
        matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3],
        matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3],
    )


@inline
def corners(geometry: Geometry, t: int) -> tuple[Vertex, Vertex, Vertex]:
    """Homogeneous pixel coordinates of a triangle's vertices.

    Found anew wherever they are asked for: that takes less time than to fetch them from a table of all vertices.
    """
    p, m = geometry.positions, geometry.matrix
    i, j, k = geometry.triangles[t, 0], geometry.triangles[t, 1], geometry.triangles[t, 2]
    return (
        projected(m, np.float64(p[i, 0]), np.float64(p[i, 1]), np.float64(p[i, 2])),
        projected(m, np.float64(p[j, 0]), np.float64(p[j, 1]), np.float64(p[j, 2])),
        projected(m, np.float64(p[k, 0]), np.float64(p[k, 1]), np.float64(p[k, 2])),
    )


@inline
def has_area(positions: NDArray[np.float32], triangles: NDArray[np.int32], t: int) -> bool:
    """Whether the corners of a triangle, in the scene, do not lie on a line."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    for axis in range(3):
        y, z = (axis + 1) % 3, (axis + 2) % 3
        by, bz = np.float64(positions[j, y]) - positions[i, y], np.float64(positions[j, z]) - positions[i, z]
        cy, cz = np.float64(positions[k, y]) - positions[i, y], np.float64(positions[k, z]) - positions[i, z]
        if by * cz != bz * cy:
            return True
    return False
