"""A scene put together from parts: boxes, beams, lathed solids, open quads."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from umbrae.material import Material
from umbrae.scene import Scene

Floats = NDArray[np.float64]
Point = Sequence[float] | Floats

TEXTURE_SIZE = 2.0
"""World units after which a texture repeats on flat parts."""

# Corners of a box by the bits of their index: 1 is x, 2 is y, 4 is z. Counter-clockwise seen from outside.
_BOX = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]


class Builder:
    """Collects parts, every one an object of its own, and makes a `Scene` of them."""

    def __init__(self, materials: Sequence[Material]) -> None:
        self._materials = tuple(materials)
        self._index = {material.name: index for index, material in enumerate(materials)}
        self._parts: list[tuple[Floats, NDArray[np.int64], Floats, Floats]] = []
        self._material_id: list[int] = []
        self._object_id: list[int] = []
        self._objects = 0

    def smooth(
        self, positions: ArrayLike, triangles: ArrayLike, material: str, normals: ArrayLike | None = None
    ) -> None:
        """Add triangles with normals `(v, 3)`; by default the mean of the facets around each vertex."""
        points, indices = np.asarray(positions, np.float64), np.asarray(triangles, np.int64)
        directions = np.zeros_like(points) if normals is None else np.asarray(normals, np.float64)
        if normals is None:
            np.add.at(directions, indices.reshape(-1), np.repeat(_facet_normals(points[indices]), 3, axis=0))
            directions = _unit(directions)
        self._append(points, indices, directions, np.zeros((len(points), 2)), material)

    def flat(self, positions: ArrayLike, triangles: ArrayLike, material: str, uv: ArrayLike | None = None) -> None:
        """Add facets with vertices of their own; `uv` per corner `(t, 3, 2)`, by default in world units."""
        corners = np.asarray(positions, np.float64)[np.asarray(triangles, np.int64)]
        normals = _unit(_facet_normals(corners))
        if uv is None:
            across = np.abs(normals).argmax(axis=1)
            axes = np.array([(2, 1), (0, 2), (0, 1)])[across]
            uv = np.take_along_axis(corners, axes[:, None, :], axis=2) * (1.0, -1.0) / TEXTURE_SIZE
        points, count = corners.reshape(-1, 3), len(corners)
        indices = np.arange(3 * count).reshape(count, 3)
        self._append(points, indices, np.repeat(normals, 3, axis=0), np.asarray(uv).reshape(-1, 2), material)

    def quad(self, corners: Sequence[Point], material: str, uv: Sequence[Sequence[float]] | None = None) -> None:
        """Add one open sheet of two triangles; corners counter-clockwise."""
        self.quads([corners], material, None if uv is None else [uv])

    def quads(
        self,
        quads: Sequence[Sequence[Point]] | Floats,
        material: str,
        uv: Sequence[Sequence[Sequence[float]]] | Floats | None = None,
    ) -> None:
        """Add open sheets `(n, 4, 3)` as one object; `uv` is `(n, 4, 2)`."""
        corners = np.asarray(quads, np.float64)
        triangles = np.array([(0, 1, 2), (0, 2, 3)])
        indices = (4 * np.arange(len(corners))[:, None, None] + triangles).reshape(-1, 3)
        laid = None if uv is None else np.asarray(uv, np.float64)[:, triangles].reshape(-1, 3, 2)
        self.flat(corners.reshape(-1, 3), indices, material, laid)

    def box(self, low: Point, high: Point, material: str) -> None:
        """Add a closed box between two opposite corners."""
        self._hexahedron(
            np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]), material
        )

    def beam(self, start: Point, end: Point, width: float, depth: float, material: str) -> None:
        """Add a closed box along a line; `width` is horizontal, `depth` across it."""
        a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
        side, other, _ = _frame(b - a)
        across = [sx * side * width / 2 + sy * other * depth / 2 for sy in (-1, 1) for sx in (-1, 1)]
        self._hexahedron(np.array([(a, b)[k >> 2] + across[k & 3] for k in range(8)]), material)

    def stairs(self, low: Point, high: Point, steps: int, material: str) -> None:
        """Add stairs that fill a box and rise towards -z, one closed box a step."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        for step in range(steps):
            near = z1 - (z1 - z0) * step / steps
            far = z1 - (z1 - z0) * (step + 1) / steps
            self.box((x0, y0, far), (x1, y0 + (y1 - y0) * (step + 1) / steps, near), material)

    def lathe(
        self,
        profile: Sequence[tuple[float, float]],
        base: Point,
        material: str,
        segments: int = 24,
        axis: Point = (0.0, 1.0, 0.0),
        flutes: int = 0,
    ) -> None:
        """Add a closed solid of revolution.

        Parameters
        ----------
        profile
            `(radius, height)` pairs along `axis` from `base`, upwards. A radius of zero at an end is a single
            vertex; any other end is closed by a disc.
        flutes
            Number of vertical grooves.
        """
        positions, triangles, rings = lathe_mesh(profile, segments, flutes)
        side, other, along = _frame(np.asarray(axis, np.float64))
        points = np.asarray(base, np.float64) + positions @ np.stack([side, along, -other])
        self.smooth(points, triangles, material)
        for ring, order in zip(rings, (-1, 1), strict=True):
            if len(ring) > 1:
                rim = points[ring][::order]
                centre = rim.mean(axis=0, keepdims=True)
                corner = np.arange(len(rim))
                fan = np.stack([np.full_like(corner, len(rim)), corner, np.roll(corner, -1)], axis=1)
                self._objects -= 1  # the disc belongs to the solid it closes
                self.flat(np.concatenate([rim, centre]), fan, material)

    def scene(self) -> Scene:
        """Everything added so far."""
        starts = np.cumsum([0] + [len(part[0]) for part in self._parts])
        return Scene(
            np.concatenate([part[0] for part in self._parts]).astype(np.float32),
            np.concatenate([part[1] + start for part, start in zip(self._parts, starts, strict=False)]),
            materials=self._materials,
            material_id=np.repeat(self._material_id, [len(part[1]) for part in self._parts]),
            normals=np.concatenate([part[2] for part in self._parts]),
            uv=np.concatenate([part[3] for part in self._parts]),
            object_id=np.repeat(self._object_id, [len(part[1]) for part in self._parts]),
        )

    def _hexahedron(self, corners: Floats, material: str) -> None:
        self.flat(corners, [(q[0], q[i], q[i + 1]) for q in _BOX for i in (1, 2)], material)

    def _append(self, points: Floats, indices: NDArray[np.int64], normals: Floats, uv: Floats, material: str) -> None:
        self._parts.append((points, indices, normals, uv))
        self._material_id.append(self._index[material])
        self._object_id.append(self._objects)
        self._objects += 1


def lathe_mesh(
    profile: Sequence[tuple[float, float]], segments: int, flutes: int = 0
) -> tuple[Floats, NDArray[np.int64], tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Surface of revolution about y, wound outward: positions, triangles, the lowest and the highest ring."""
    angle = 2.0 * math.pi * np.arange(segments) / segments
    groove = 1.0 - 0.11 * np.abs(np.sin(flutes * angle / 2.0)) if flutes else np.ones(segments)
    circle = np.stack([np.cos(angle) * groove, np.sin(angle) * groove], axis=1)
    points: list[Floats] = []
    rings: list[NDArray[np.int64]] = []
    for radius, height in profile:
        around = circle * radius if radius > 0.0 else np.zeros((1, 2))
        rings.append(sum(map(len, points)) + np.arange(len(around)))
        points.append(np.stack([around[:, 0], np.full(len(around), height), -around[:, 1]], axis=1))
    triangles = []
    for low, high in pairwise(rings):
        a, b = np.resize(low, segments), np.resize(high, segments)
        c, d = np.roll(b, -1), np.roll(a, -1)
        if len(low) > 1:
            triangles.append(np.stack([a, d, b], axis=1))
        if len(high) > 1:
            triangles.append(np.stack([d, c, b], axis=1))
    return np.concatenate(points), np.concatenate(triangles), (rings[0], rings[-1])


def _frame(direction: Floats) -> tuple[Floats, Floats, Floats]:
    """Right-handed unit vectors: a horizontal one, the one across both, the direction."""
    along = direction / np.linalg.norm(direction)
    side = np.cross((0.0, 1.0, 0.0), along)
    side = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(side) < 1e-6 else _unit(side)
    return side, np.cross(along, side), along


def _facet_normals(corners: Floats) -> Floats:
    """`(t, 3)` normals of triangles `(t, 3, 3)`, as long as twice their area."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _unit(vectors: Floats) -> Floats:
    unit: Floats = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
