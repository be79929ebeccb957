"""Triangles in clusters of 16 neighbours: the order in which they are visited, their bounds and facing."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.predicates import facing
from umbrae.methods.counting_sort import sort_by_key
from umbrae.methods.frustum_setup import side_of_light
from umbrae.methods.lanes import LANES
from umbrae.parallel import expand, kernel, run
from umbrae.scene import Scene

_CHUNK = 1024
"""Clusters per task."""


class TriangleClusters(NamedTuple):
    """Neighbouring triangles by sixteens.

    `corners` `(c, 3, 3, 16)` the three corners, axis by axis, of the triangles in each cluster (the last one is filled
    up with copies of the last triangle); `boxes` `(c, 2, 3)` the bounds of each; `order` `(t,)` the triangles' numbers
    in the scene; `bounds` `(2, 3)` of all.
    """

    corners: NDArray[np.float32]
    boxes: NDArray[np.float32]
    order: NDArray[np.int32]
    bounds: NDArray[np.float64]


def cluster_triangles(scene: Scene, clock: Clock | None, chosen: NDArray[np.intp] | None = None) -> TriangleClusters:
    """Cluster the `chosen` triangles, or all, in the scene's order, or along a curve in space.

    The latter where 16 consecutive triangles mostly lie farther apart than side by side.
    """
    order = np.arange(len(scene.triangles), dtype=np.int32) if chosen is None else chosen.astype(np.int32)
    count = len(order)
    clusters = -(-count // LANES)
    corners = np.empty((clusters, 3, 3, LANES), np.float32)
    boxes = np.empty((clusters, 2, 3), np.float32)
    if count == 0:
        return TriangleClusters(corners, boxes, order, np.zeros((2, 3)))
    bounds, apart = _gather(scene, order, corners, boxes, clock)
    if apart:
        keys = np.empty(count, np.int64)
        scale = 1023.0 / (float((bounds[1] - bounds[0]).max()) or 1.0)

        def place(chunk: int) -> None:
            curve_keys(corners, count, bounds[0], scale, chunk * _CHUNK, min((chunk + 1) * _CHUNK, clusters), keys)

        run(place, -(-clusters // _CHUNK), clock)
        bits = min(30, count.bit_length() + 1)
        along = np.empty(count, np.int32)
        rank = np.arange(count, dtype=np.int32)
        sort_by_key(rank, keys, 30 - bits, along, np.zeros((1 << bits) + 1, np.int32))
        order = order[along]
        _gather(scene, order, corners, boxes, clock)
    return TriangleClusters(corners, boxes, order, bounds)


def moved_clusters(clusters: TriangleClusters, scene: Scene, clock: Clock | None) -> TriangleClusters:
    """The same clusters of the same triangles, where `scene` has them."""
    corners, boxes, bounds = np.empty_like(clusters.corners), np.empty_like(clusters.boxes), clusters.bounds
    if len(clusters.order):
        bounds, _ = _gather(scene, clusters.order, corners, boxes, clock)
    return TriangleClusters(corners, boxes, clusters.order, bounds)


def _gather(
    scene: Scene,
    order: NDArray[np.int32],
    corners: NDArray[np.float32],
    boxes: NDArray[np.float32],
    clock: Clock | None,
) -> tuple[NDArray[np.float64], bool]:
    """Fill `corners` and `boxes`; returns the bounds of all, and whether clusters are mostly wider than triangles."""
    clusters = len(corners)
    chunks = -(-clusters // _CHUNK)
    extents = np.empty((chunks, 2))

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, clusters)
        gather(scene.positions, scene.triangles, order, start, stop, corners, boxes, extents[chunk])

    run(task, chunks, clock)
    of_clusters, of_triangles = extents.sum(axis=0)
    bounds = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)]).astype(np.float64)
    return bounds, bool(of_clusters > of_triangles)


def light_sides(
    scene: Scene,
    clusters: TriangleClusters,
    light: NDArray[np.float64],
    of_scene: NDArray[np.int8],
    clock: Clock | None,
) -> NDArray[np.int8]:
    """Exact side of each triangle's plane that the light is on, 0 edge-on: `(c, 16)`, and into `of_scene (t,)`."""
    corners, order = clusters.corners, clusters.order
    count = len(corners)
    of_clusters = np.empty((count, LANES), np.int8)

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, count)
        face_light(scene.positions, scene.triangles, corners, order, light, start, stop, of_clusters, of_scene)

    run(task, -(-count // _CHUNK), clock)
    return of_clusters


@kernel
def gather(positions, triangles, order, start, stop, corners, boxes, extents):
    """Copy the corners of clusters `start` to `stop`, bound them, and sum up extents: of clusters, of triangles."""
    extents[:] = 0.0
    last = len(order) - 1
    for cluster in range(start, stop):
        for lane in range(LANES):
            t = order[min(cluster * LANES + lane, last)]
            for number in range(3):
                vertex = triangles[t, number]
                for axis in range(3):
                    corners[cluster, number, axis, lane] = positions[vertex, axis]
        for axis in range(3):
            low, high, total = extents_along(corners, cluster, axis)
            boxes[cluster, 0, axis], boxes[cluster, 1, axis] = low, high
            extents[0] += high - low
            extents[1] += total


@expand
def extents_along(corners, cluster, axis):
    """Smallest and largest coordinate of a cluster, and the sum of its triangles' extents."""
    low, high, total = corners[cluster, 0, axis, 0], corners[cluster, 0, axis, 0], np.float32(0.0)
    for lane in range(LANES):
        a, b, c = corners[cluster, 0, axis, lane], corners[cluster, 1, axis, lane], corners[cluster, 2, axis, lane]
        least, most = (a if a < b else b), (a if a > b else b)
        least, most = (c if c < least else least), (c if c > most else most)
        low, high = (least if least < low else low), (most if most > high else high)
        total += most - least
    return low, high, total


@kernel
def curve_keys(corners, count, origin, scale, start, stop, keys):
    """Place of each clustered triangle's first corner along a Morton curve over 1024 cells each way."""
    for t in range(start * LANES, min(stop * LANES, count)):
        key = np.int64(0)
        for axis in range(3):
            cell = np.int64((corners[t // LANES, 0, axis, t % LANES] - origin[axis]) * scale)
            cell = (cell | cell << 16) & 0x030000FF
            cell = (cell | cell << 8) & 0x0300F00F
            cell = (cell | cell << 4) & 0x030C30C3
            key |= ((cell | cell << 2) & 0x09249249) << axis
        keys[t] = key


@kernel
def face_light(positions, triangles, corners, order, light, start, stop, of_clusters, of_scene):
    """Exact side of the planes of clusters `start` to `stop` that the light is on."""
    side = np.empty(LANES)
    for cluster in range(start, stop):
        side_of_light(corners, cluster, light, side)
        for lane in range(LANES):
            number = cluster * LANES + lane
            of_clusters[cluster, lane] = 0
            if number < len(order):
                t = order[number]
                exact = np.int64(side[lane]) if side[lane] != 0.0 else facing(positions, triangles, t, light)
                of_clusters[cluster, lane] = exact
                of_scene[t] = exact
