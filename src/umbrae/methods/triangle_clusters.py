"""Triangles in clusters of 16 neighbours: the order in which they are visited, and boxes around them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.methods.counting_sort import sort_by_key
from umbrae.methods.lanes import LANES, largest, load, prefetch, smallest
from umbrae.parallel import expand, kernel, run
from umbrae.scene import Scene

_CHUNK = 1024
"""Clusters per task: whole rows of both levels of boxes."""


class TriangleClusters(NamedTuple):
    """Neighbouring triangles by sixteens.

    `corners` `(c, 3, 3, 16)` the three corners, axis by axis, of the triangles in each cluster (the last one is filled
    up with copies of the last triangle); `boxes` `(g, 6 LANES)` in each of the first `groups` rows the xmin, xmax, ymin
    ... of 16 clusters, for all 16 each, and in each row after them those of 16 such rows, empty where there is
    none; `order` `(t,)` the triangles' numbers in the scene; `bounds` `(2, 3)` of all; `in_order` whether these are all
    triangles of the scene in its own order.
    """

    corners: NDArray[np.float32]
    boxes: NDArray[np.float32]
    order: NDArray[np.int32]
    bounds: NDArray[np.float64]
    in_order: bool

    @property
    def groups(self) -> int:
        """How many rows of `boxes` are those of clusters."""
        return -(-len(self.corners) // LANES)

    def triangles_in(self, chosen: NDArray[np.bool_]) -> int:
        """How many triangles the `chosen (c,)` clusters hold."""
        last = len(self.order) - LANES * (len(chosen) - 1)
        return int(LANES * chosen[:-1].sum() + last * chosen[-1:].sum())


def cluster_triangles(scene: Scene, clock: Clock | None, chosen: NDArray[np.intp] | None = None) -> TriangleClusters:
    """Cluster the `chosen` triangles, or all, in the scene's order, or along a curve in space.

    The latter where 16 consecutive triangles mostly lie farther apart than side by side.
    """
    order = np.arange(len(scene.triangles), dtype=np.int32) if chosen is None else chosen.astype(np.int32)
    count = len(order)
    clusters = -(-count // LANES)
    corners = np.empty((clusters, 3, 3, LANES), np.float32)
    groups = -(-clusters // LANES)
    boxes = np.empty((groups + -(-groups // LANES), 6 * LANES), np.float32)
    if count == 0:
        return TriangleClusters(corners, boxes, order, np.zeros((2, 3)), False)
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
    return TriangleClusters(corners, boxes, order, bounds, chosen is None and not apart)


def moved_clusters(clusters: TriangleClusters, scene: Scene, clock: Clock | None) -> TriangleClusters:
    """The same clusters of the same triangles, where `scene` has them."""
    corners, boxes, bounds = np.empty_like(clusters.corners), np.empty_like(clusters.boxes), clusters.bounds
    if len(clusters.order):
        bounds, _ = _gather(scene, clusters.order, corners, boxes, clock)
    return clusters._replace(corners=corners, boxes=boxes, bounds=bounds)


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
    around = boxes[-(-clusters // LANES) :].reshape(-1, 3, 2, LANES)
    bounds = np.stack([around[:, :, 0].min(axis=(0, 2)), around[:, :, 1].max(axis=(0, 2))]).astype(np.float64)
    return bounds, bool(of_clusters > of_triangles)


@kernel
def gather(positions, triangles, order, start, stop, corners, boxes, extents):
    """Copy the corners of clusters `start` to `stop`, bound them, and sum up extents: of clusters, of triangles."""
    extents[:] = 0.0
    last = len(order) - 1
    first, end = start // LANES, -(-stop // LANES)
    groups = -(-len(corners) // LANES)
    above, top = groups + first // LANES, groups + -(-end // LANES)
    for axis in range(3):
        for part, nothing in ((2 * axis, np.inf), (2 * axis + 1, -np.inf)):
            boxes[end - 1, part * LANES : (part + 1) * LANES] = nothing
            boxes[top - 1, part * LANES : (part + 1) * LANES] = nothing
    for cluster in range(start, stop):
        for lane in range(LANES):
            t = order[min(cluster * LANES + lane, last)]
            for number in range(3):
                vertex = triangles[t, number]
                for axis in range(3):
                    corners[cluster, number, axis, lane] = positions[vertex, axis]
        for axis in range(3):
            low, high, total = extents_along(corners, cluster, axis)
            at = 2 * axis * LANES + cluster % LANES
            boxes[cluster // LANES, at], boxes[cluster // LANES, at + LANES] = low, high
            extents[0] += high - low
            extents[1] += total
    for group in range(first, end):
        for axis in range(3):
            at = 2 * axis * LANES
            around = above + (group - first) // LANES
            boxes[around, at + group % LANES] = smallest(load(boxes, group, at))
            boxes[around, at + LANES + group % LANES] = largest(load(boxes, group, at + LANES))


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


@expand
def bring_near(rows, chosen, place, stop):
    """Prefetch the cluster that comes three after `chosen[place]`, from `corners` as `(c, 9 LANES)`.

    It lies anywhere in memory; in order, too, its nine cache lines are more than the processor sees coming.
    """
    ahead = chosen[min(place + 3, stop - 1)]
    for part in range(9):
        prefetch(rows, ahead, part * LANES)
