"""A soup as shadow volumes want it: welded by position, ordered, with the vertices opposite to each edge."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import Edges, edges, first_equal, first_vertices
from umbrae.projection import unit_scale
from umbrae.scene import Scene


@dataclass(frozen=True, eq=False)
class VolumeMesh:
    """Vertices in an order that all triangles agree on, so that comparing positions is comparing indices.

    It is the lexicographic one of positions, until those are moved: the order itself decides nothing.

    Attributes
    ----------
    positions
        `(v, 3) float32`, one per exact position, multiplied by `scale`.
    scale
        A power of two that brings the largest coordinate near 1: shaders compute in float32, whose range products of
        world coordinates would leave.
    triangles
        `(t, 3) int32`, corners in ascending order, of all triangles with three different positions; the others cast
        nothing, and would count an edge twice with the sign of rounding noise (Milet et al., Algorithm 3).
    winding
        `(t, 3) int32`, the same corners in the scene's order.
    source
        `(t,) int32` the scene's triangle that each of them is.
    cap_of
        `(all of the scene's triangles,) int32`: the first of `triangles` with the same corners; -1 for collapsed ones.
        Equal triangles are one surface to a sample that lies on either.
    """

    positions: NDArray[np.float32]
    scale: float
    triangles: NDArray[np.int32]
    winding: NDArray[np.int32]
    source: NDArray[np.int32]
    cap_of: NDArray[np.int32]

    @cached_property
    def edges(self) -> Edges:
        """Edges with the triangles (of `triangles`) that meet along each."""
        return edges(self.triangles)

    @cached_property
    def opposite(self) -> NDArray[np.int32]:
        """`(n,)` the vertex opposite to the edge, for each adjacency of `edges`."""
        topology = self.edges
        ends = np.repeat(topology.vertices.sum(axis=1, dtype=np.int64), topology.count)
        corners = self.triangles[topology.triangle].sum(axis=1, dtype=np.int64)
        opposite: NDArray[np.int32] = (corners - ends).astype(np.int32)
        return opposite

    @cached_property
    def sign(self) -> NDArray[np.int8]:
        """`(n,)` which way the ordered triangle's boundary runs along the edge: down only from first to last."""
        return np.where(self.opposite == self.triangles[self.edges.triangle, 1], -1, 1).astype(np.int8)

    def moved(self, scene: Scene, welded: NDArray[np.int32]) -> "VolumeMesh":
        """The same triangles where `scene` has them, if it is still `welded (v,)` as before (`edges.still_welded`)."""
        made = dataclasses.replace(self, **_placed(scene, welded))
        made.__dict__.update(
            {name: self.__dict__[name] for name in ("edges", "opposite", "sign") if name in self.__dict__}
        )
        return made

    def opposite_of(self, kept: NDArray[np.bool_] | None) -> NDArray[np.int32]:
        """`opposite`, but for triangles not `kept (t,)`: their edge's lower end, which counts for nothing."""
        if kept is None:
            return self.opposite
        lower = np.repeat(self.edges.vertices[:, 0], self.edges.count)
        return np.where(kept[self.edges.triangle], self.opposite, lower)


def volume_mesh(scene: Scene, welded: NDArray[np.int32]) -> VolumeMesh:
    """Order the corners of a scene's triangles; `welded (v,)` as of `edges.weld`."""
    winding = welded[scene.triangles]
    ordered = np.sort(winding, axis=1)
    proper = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    triangles = np.ascontiguousarray(ordered[proper])
    cap_of = np.full(len(ordered), -1, np.int32)
    cap_of[proper] = first_equal(triangles)
    return VolumeMesh(
        **_placed(scene, welded),
        triangles=triangles,
        winding=np.ascontiguousarray(winding[proper]),
        source=np.flatnonzero(proper).astype(np.int32),
        cap_of=cap_of,
    )


def _placed(scene: Scene, welded: NDArray[np.int32]) -> dict[str, Any]:
    """`positions` and `scale` of a mesh."""
    scale, there = unit_scale(scene), scene.positions[first_vertices(welded)] + np.float32(0)
    return {"positions": (there.astype(np.float64) * scale).astype(np.float32), "scale": scale}
