"""Triangles projected and listed by the bands of rows that they touch."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.memory import require
from umbrae.parallel import inline, kernel, run
from umbrae.sampling.coverage import Vertex, cells, extent
from umbrae.scene import Scene

_CHUNK = 1 << 14
"""Vertices or triangles per task, at least."""
_MAX_CHUNKS = 64


class Picture(NamedTuple):
    """Where samples lie: pixel (row, column) has its sample k at (column + x[k], row + y[k])."""

    width: int
    height: int
    near: float
    x: NDArray[np.float64]
    y: NDArray[np.float64]


class Geometry(NamedTuple):
    """Triangles in the scene and in the picture."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    vertices: NDArray[np.float64]  # (v, 3), see coverage.py
    boxes: NDArray[np.int32]  # (t, 4) first and last row, first and last column; last row before first: unseen


def _chunks(count: int) -> list[tuple[int, int]]:
    size = max(_CHUNK, -(-count // _MAX_CHUNKS))
    return [(start, min(start + size, count)) for start in range(0, count, size)]


def project(scene: Scene, camera: Camera) -> Geometry:
    """Homogeneous pixel coordinates of all vertices; boxes are still to be found."""
    width, height = camera.width, camera.height
    pixels_from_clip = np.array([[width / 2, 0, width / 2], [0, -height / 2, height / 2], [0, 0, 1]])
    matrix = pixels_from_clip @ camera.world_to_clip
    vertices = np.empty((len(scene.positions), 3))
    chunks = _chunks(len(vertices))
    run(lambda index: _transform(scene.positions, matrix, *chunks[index], vertices), len(chunks))
    return Geometry(scene.positions, scene.triangles, vertices, np.empty((len(scene.triangles), 4), np.int32))


def list_by_band(
    geometry: Geometry, picture: Picture, band_rows: int, wanted: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Find the triangles' boxes and list the triangles by the bands they touch, in order of their index.

    Parameters
    ----------
    wanted
        `(t,)` which triangles to list; None for all.

    Returns
    -------
    `(bands + 1,)` begins and the `(n,)` triangles: band i has those from `begin[i]` to `begin[i + 1]`.
    """
    if wanted is None:
        wanted = np.ones(len(geometry.triangles), bool)
    chunks = _chunks(len(geometry.triangles))
    counts = np.zeros((len(chunks), -(-picture.height // band_rows)), np.int64)
    run(lambda index: _find_boxes(geometry, picture, band_rows, wanted, *chunks[index], counts[index]), len(chunks))
    begin = np.concatenate([[0], np.cumsum(counts.sum(axis=0))])
    require(4 * int(begin[-1]), f"listing {len(geometry.triangles)} triangles by the rows they touch")
    listed = np.empty(begin[-1], np.int32)
    cursors = begin[:-1] + np.cumsum(counts, axis=0) - counts
    run(
        lambda index: _fill_lists(geometry.boxes, band_rows, *chunks[index], cursors[index], listed),
        len(chunks),
    )
    return begin, listed


@kernel
def _transform(
    positions: NDArray[np.float32],
    matrix: NDArray[np.float64],
    start: int,
    stop: int,
    vertices: NDArray[np.float64],
) -> None:
    for i in range(start, stop):
        x, y, z = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
        for row in range(3):
            vertices[i, row] = matrix[row, 0] * x + matrix[row, 1] * y + matrix[row, 2] * z + matrix[row, 3]


@inline
def corners(geometry: Geometry, t: int) -> tuple[Vertex, Vertex, Vertex]:
    """Homogeneous pixel coordinates of a triangle's vertices."""
    v = geometry.vertices
    i, j, k = geometry.triangles[t, 0], geometry.triangles[t, 1], geometry.triangles[t, 2]
    return (v[i, 0], v[i, 1], v[i, 2]), (v[j, 0], v[j, 1], v[j, 2]), (v[k, 0], v[k, 1], v[k, 2])


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


@kernel
def _find_boxes(
    geometry: Geometry,
    picture: Picture,
    band_rows: int,
    wanted: NDArray[np.bool_],
    start: int,
    stop: int,
    counts: NDArray[np.int64],
) -> None:
    left, right, top, bottom = picture.x.min(), picture.x.max(), picture.y.min(), picture.y.max()
    boxes = geometry.boxes
    for t in range(start, stop):
        boxes[t, 0], boxes[t, 1] = 0, -1
        if not wanted[t]:
            continue
        p, q, r = corners(geometry, t)
        low, high = extent(p, q, r, picture.near, 1)
        first_row, last_row = cells(low, high, top, bottom, picture.height)
        low, high = extent(p, q, r, picture.near, 0)
        first_column, last_column = cells(low, high, left, right, picture.width)
        if first_column > last_column or not has_area(geometry.positions, geometry.triangles, t):
            last_row = first_row - 1
        boxes[t, 0], boxes[t, 1], boxes[t, 2], boxes[t, 3] = first_row, last_row, first_column, last_column
        if first_row <= last_row:
            for band in range(first_row // band_rows, last_row // band_rows + 1):
                counts[band] += 1


@kernel
def _fill_lists(
    boxes: NDArray[np.int32],
    band_rows: int,
    start: int,
    stop: int,
    cursors: NDArray[np.int64],
    listed: NDArray[np.int32],
) -> None:
    for t in range(start, stop):
        if boxes[t, 0] <= boxes[t, 1]:
            for band in range(boxes[t, 0] // band_rows, boxes[t, 1] // band_rows + 1):
                listed[cursors[band]] = t
                cursors[band] += 1
