"""Solids of revolution at any resolution, with the normals of the smooth surfaces that they stand for."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae import Scene

Floats = NDArray[np.float64]
GROUND = 2
"""Triangles of the ground, which come first."""


class Shape(NamedTuple):
    """`positions (v, 3)`, `triangles (t, 3)` wound outwards, `normals (v, 3)`."""

    positions: Floats
    triangles: NDArray[np.int64]
    normals: Floats


def revolve(profile: Sequence[tuple[float, float, float, float]], segments: int, closed: bool = False) -> Shape:
    """Turn a line of (radius, height) with normals about the y axis; a place with two normals makes a crease."""
    angle = 2 * np.pi * np.arange(segments) / segments
    cos, sin, one = np.cos(angle), np.sin(angle), np.ones(segments)
    positions = np.concatenate([np.stack([r * cos, y * one, r * sin], 1) for r, y, _, _ in profile])
    normals = np.concatenate([np.stack([r * cos, y * one, r * sin], 1) for _, _, r, y in profile])
    triangles = []
    for i in range(len(profile) if closed else len(profile) - 1):
        j = (i + 1) % len(profile)
        if profile[i][:2] == profile[j][:2]:
            continue
        for k in range(segments):
            a, b = i * segments + k, i * segments + (k + 1) % segments
            c, d = j * segments + k, j * segments + (k + 1) % segments
            triangles += [(a, c, b)] if profile[i][0] > 0 else []
            triangles += [(b, c, d)] if profile[j][0] > 0 else []
    return Shape(positions, np.array(triangles), normals)


def sphere(segments: int) -> Shape:
    """Of radius 1."""
    half = segments // 2
    angles = [math.pi * (i / half - 0.5) for i in range(half + 1)]
    radii = [0.0 if i in (0, half) else math.cos(a) for i, a in enumerate(angles)]
    return revolve([(r, math.sin(a), r, math.sin(a)) for r, a in zip(radii, angles, strict=True)], segments)


def torus(segments: int, around: int, thin: float = 0.4) -> Shape:
    """Of radius 1 about the y axis, and `thin` across."""
    angles = [2 * math.pi * i / around for i in range(around)]
    return revolve(
        [(1 + thin * math.cos(a), thin * math.sin(a), math.cos(a), math.sin(a)) for a in angles], segments, True
    )


def cylinder(segments: int) -> Shape:
    """With creases between its side and its ends."""
    r, h = 0.8, 0.9
    rows = [(0, -h, 0, -1), (r, -h, 0, -1), (r, -h, 1, 0), (r, h, 1, 0), (r, h, 0, 1), (0, h, 0, 1)]
    return revolve([tuple(map(float, row)) for row in rows], segments)


def cone(segments: int) -> Shape:
    """With a crease at its foot."""
    r, h = 0.9, 1.0
    slant = math.hypot(2 * h, r)
    x, y = 2 * h / slant, r / slant
    return revolve([(0.0, -h, 0.0, -1.0), (r, -h, 0.0, -1.0), (r, -h, x, y), (1e-6, h, x, y)], segments)


def turned(shape: Shape) -> Shape:
    """The same, turned so that it lies askew to all axes."""
    c, s = math.cos(0.7), math.sin(0.7)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    c, s = math.cos(0.4), math.sin(0.4)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ about_x
    return Shape(shape.positions @ turn.T, shape.triangles, shape.normals @ turn.T)


def above_ground(shape: Shape, height: float = 1.6) -> Scene:
    """A scene with the shape over a ground."""
    ground = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], float)
    return Scene(
        np.concatenate([ground, shape.positions + np.array([0, height, 0])]),
        np.concatenate([[(0, 2, 1), (0, 3, 2)], shape.triangles + 4]),
        normals=np.concatenate([np.tile([0.0, 1.0, 0.0], (4, 1)), shape.normals]),
    )
