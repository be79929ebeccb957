"""The sphere scene of Milet et al.: a grid of spheres over a ground plane, in any number and detail."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import Vector
from umbrae.errors import InputError
from umbrae.light import Light
from umbrae.material import Material
from umbrae.models.builder import lathe_mesh
from umbrae.scene import Scene

SPACING = 3.0
"""Distance between the centres of neighbouring spheres, whose radius is 1."""
HEIGHT = 1.5
"""Height of the centres over the ground, which is y = 0."""
MAX_TRIANGLES = 100_000_000

_COLORS = ((0.72, 0.33, 0.22), (0.80, 0.62, 0.36), (0.42, 0.52, 0.36), (0.28, 0.42, 0.52), (0.82, 0.78, 0.70))


def sphere(center: Vector = (0.0, 0.0, 0.0), radius: float = 1.0, segments: int = 32, rings: int = 16) -> Scene:
    """A closed sphere of `2 * segments * (rings - 1)` triangles, wound outward, with smooth normals.

    Parameters
    ----------
    segments, rings
        Number of divisions around the y axis (at least 3) and from pole to pole (at least 2).
    """
    if segments < 3 or rings < 2:
        raise InputError(f"sphere: wanted at least 3 segments and 2 rings, got {segments} and {rings}")
    normals, triangles = _unit_sphere(segments, rings)
    return Scene((normals * radius + np.asarray(center)).astype(np.float32), triangles, normals=normals)


def spheres(grid: tuple[int, int] = (10, 10), triangles: int = 100_000) -> Scene:
    """Spheres in a grid over a ground plane of two triangles.

    Parameters
    ----------
    grid
        Number of spheres along x and z.
    triangles
        Number of triangles wanted in all; every sphere gets the same number, as near as a well-shaped grid of
        meridians and parallels allows. On the default grid 96,002 is met exactly.

    Raises
    ------
    InputError
        For a grid without spheres, or fewer than 8 triangles a sphere.
    """
    columns, rows = grid
    count = columns * rows
    if columns < 1 or rows < 1 or 8 * count + 2 > MAX_TRIANGLES:
        raise InputError(f"spheres: wanted a grid of 1 to {MAX_TRIANGLES // 8 - 1} spheres, got {columns}x{rows}")
    if not 8 * count + 2 <= triangles <= MAX_TRIANGLES:
        raise InputError(
            f"spheres: wanted {8 * count + 2} to {MAX_TRIANGLES} triangles for a grid of {columns}x{rows}, "
            f"got {triangles}"
        )
    normals, indices = _unit_sphere(*_divisions((triangles - 2) / count))
    each = np.arange(count)
    centers = SPACING * np.stack(
        [
            each % columns - (columns - 1) / 2,
            np.full(count, HEIGHT / SPACING),
            each // columns - (rows - 1) / 2,
        ],
        axis=1,
    )
    x, z = SPACING * (columns / 2 + 1.0), SPACING * (rows / 2 + 1.0)
    ground = np.array([(-x, 0.0, z), (x, 0.0, z), (x, 0.0, -z), (-x, 0.0, -z)])
    vertices, faces = len(normals), len(indices)
    kind = 1 + (2 * (each % columns) + each // columns + each // len(_COLORS) ** 2) % len(_COLORS)
    return Scene(
        np.concatenate([ground, (centers[:, None] + normals).reshape(-1, 3)]).astype(np.float32),
        np.concatenate([[(0, 1, 2), (0, 2, 3)], (4 + each[:, None, None] * vertices + indices).reshape(-1, 3)]),
        materials=[Material((0.62, 0.60, 0.57, 1.0), name="ground")]
        + [Material((*color, 1.0), name=f"sphere {i}") for i, color in enumerate(_COLORS)],
        material_id=np.concatenate([[0, 0], np.repeat(kind, faces)]),
        normals=np.concatenate([np.tile((0.0, 1.0, 0.0), (4, 1)), np.tile(normals, (count, 1))]),
        object_id=np.concatenate([[0, 0], np.repeat(1 + each, faces)]),
    )


def spheres_light(grid: tuple[int, int] = (10, 10)) -> Light:
    """The point light above the spheres, off the middle."""
    x, z = SPACING * grid[0] / 2, SPACING * grid[1] / 2
    return Light.point((-0.45 * x, 4.0 + 0.8 * max(x, z), 0.3 * z))


def _divisions(wanted: float) -> tuple[int, int]:
    """Segments and rings of a sphere with about `wanted` triangles, about twice as many segments as rings."""
    best = (4, 2)
    middle = max(2, round(math.sqrt(wanted) / 2))
    for rings in range(max(2, middle * 3 // 4), middle * 5 // 4 + 2):
        segments = max(4, round(wanted / (2 * (rings - 1))))
        miss = abs(2 * segments * (rings - 1) - wanted)
        best_miss = abs(2 * best[0] * (best[1] - 1) - wanted)
        if (miss, abs(segments - 2 * rings)) < (best_miss, abs(best[0] - 2 * best[1])):
            best = (segments, rings)
    return best


def _unit_sphere(segments: int, rings: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    angle = np.linspace(-math.pi / 2, math.pi / 2, rings + 1)
    radius = np.cos(angle)
    radius[[0, -1]] = 0.0
    positions, triangles, _ = lathe_mesh(list(zip(radius, np.sin(angle), strict=True)), segments)
    return positions, triangles
