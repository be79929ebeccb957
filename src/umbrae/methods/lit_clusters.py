"""Clusters under one light: which side of their triangles it is on, and which of them may shade any sample.

Neither is computed for a cluster before it is asked for.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.predicates import facing
from umbrae.methods.cluster_culling import choose_clusters
from umbrae.methods.frustum_setup import side_of_light
from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_tree import SampleTree
from umbrae.methods.triangle_clusters import TriangleClusters, bring_near
from umbrae.parallel import kernel, run
from umbrae.scene import Scene

_CHUNK = 1024
"""Clusters per task."""

_SAMPLES_PER_TASK = 1 << 17

_MANY = 8
"""Where one cluster in so many is seen, all are faced: one after the other is as fast as here and there."""


class LitClusters:
    """Clusters of triangles of a scene, and a light `(4,)`.

    `sides` `(c, 16)` and `own` `(t,)`, which clusters of one scene share, hold the exact side of each triangle's plane
    that the light is on: 1, -1, 0 edge-on, and 0 where nobody has asked.
    """

    def __init__(
        self, scene: Scene, clusters: TriangleClusters, light: NDArray[np.float64], own: NDArray[np.int8]
    ) -> None:
        self.clusters, self.own = clusters, own
        self.sides = np.zeros((len(clusters.corners), LANES), np.int8)
        self._scene, self._light = scene, light
        self._known, self._chosen = np.zeros((2, len(clusters.corners)), bool)

    @property
    def culled(self) -> int:
        """How many triangles stand in clusters that were never chosen."""
        return self.clusters.triangles_in(~self._chosen)

    def choose(
        self, active: Sequence[tuple[LightFrame, SampleTree]], culling: bool, clock: Clock
    ) -> list[NDArray[np.intp]]:
        """The clusters to send down each tree (see `choose_clusters`); finds their sides."""
        numbers = choose_clusters(self.clusters, self._light, active, culling, self._chosen, clock)
        self.find(self._chosen, clock)
        return numbers

    def find(self, wanted: NDArray[np.bool_], clock: Clock) -> None:
        """Find the sides of the `wanted` clusters `(c,)`."""
        new = np.flatnonzero(wanted & ~self._known)
        corners, order = self.clusters.corners, self.clusters.order

        def task(chunk: int) -> None:
            start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(new))
            face_light(
                self._scene.positions, self._scene.triangles, corners, order, self._light, new, start, stop,
                self.sides, self.own,
            )  # fmt: skip

        run(task, -(-len(new) // _CHUNK), clock)
        self._known[new] = True

    def find_seen(self, triangle: NDArray[np.int32], clock: Clock) -> None:
        """Find the sides of all clusters that samples on `triangle (n,)` lie on, and perhaps more.

        All are found where looking for those takes longer: where there are fewer triangles than samples, and many of
        those, where clusters do not follow the scene's order, and where samples lie on many of them.
        """
        seen = np.zeros(len(self._known), bool)
        if not self.clusters.in_order or len(triangle) > max(len(self.own), _SAMPLES_PER_TASK):
            self.find(~seen, clock)
            return

        def task(number: int) -> None:
            start, stop = number * _SAMPLES_PER_TASK, min((number + 1) * _SAMPLES_PER_TASK, len(triangle))
            mark_seen(start, stop, triangle, seen)

        run(task, -(-len(triangle) // _SAMPLES_PER_TASK), clock)
        self.find(seen if _MANY * seen.sum() < len(seen) else ~self._known, clock)


@kernel
def mark_seen(start, stop, triangle, seen):
    """Mark the clusters that samples `start` to `stop` lie on; most lie on their neighbour's triangle."""
    last = -1
    for sample in range(start, stop):
        own = triangle[sample]
        if own != last and own >= 0:
            last = own
            seen[own // LANES] = True


@kernel
def face_light(positions, triangles, corners, order, light, wanted, start, stop, sides, own):
    """Exact side of the planes of clusters `wanted[start:stop]` that the light is on."""
    side = np.empty(LANES)
    rows = corners.reshape(len(corners), 9 * LANES)
    for place in range(start, stop):
        bring_near(rows, wanted, place, stop)
        cluster = wanted[place]
        side_of_light(corners, cluster, light, side)
        for lane in range(LANES):
            number = cluster * LANES + lane
            if number < len(order):
                t = order[number]
                exact = np.int64(side[lane]) if side[lane] != 0.0 else facing(positions, triangles, t, light)
                sides[cluster, lane] = exact
                own[t] = exact
