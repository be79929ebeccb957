"""Which parts of a soup are solids: closed, and wound outwards as seen from their middle.

A closed part has a winding number at every point off it: what a ray from there to infinity sums up when it adds 1
where it leaves through a triangle's front and subtracts 1 where it enters. Where every triangle turns its back to one
and the same point, walking towards that point can only raise the number, from 0 at infinity: it is nowhere negative,
whatever the part looks like. Being closed and of positive volume is not enough: a part that crosses itself may have
a lobe that is inside out, and so may two boxes that share an edge.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import edges, weld
from umbrae.geometry.predicates import facing
from umbrae.parallel import kernel


class Solids(NamedTuple):
    """`of` `(t,) int32`: the solid each triangle belongs to, or -1; `lower`, `upper` `(s, 3) float64` their bounds."""

    of: NDArray[np.int32]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


def find_solids(positions: NDArray[np.float32], triangles: NDArray[np.int32], allowed: NDArray[np.bool_]) -> Solids:
    """Connected parts (over edges, by position) whose winding number is surely nowhere negative.

    A part is a solid when every edge is run as often in one direction as in the other, no triangle faces the middle of
    its box, and all its triangles are `allowed (t,)`.
    """
    count = len(triangles)
    joined = np.arange(count, dtype=np.int32)
    topology = edges(weld(positions)[triangles])
    join_over_edges(topology.offsets, topology.triangle, joined)
    _, part = np.unique(joined, return_inverse=True)
    parts = int(part.max(initial=-1)) + 1
    solid = np.ones(parts, bool)
    solid[part[~allowed]] = False
    solid[part[topology.degenerate]] = False
    owner = topology.triangle[topology.offsets[:-1]]
    solid[part[owner[topology.balance != 0]]] = False

    corners = positions.astype(np.float64)[triangles]
    low, high = np.full((parts, 3), np.inf), np.full((parts, 3), -np.inf)
    for corner in range(3):
        np.minimum.at(low, part, corners[:, corner])
        np.maximum.at(high, part, corners[:, corner])
    middle = np.ones((parts, 4))
    middle[:, :3] = ((low + high) / 2).astype(np.float32)
    drop_facing(positions, triangles, part, middle, solid)
    number = np.where(solid, np.cumsum(solid) - 1, -1).astype(np.int32)
    return Solids(number[part], low[solid], high[solid])


@kernel
def drop_facing(positions, triangles, part, middle, solid):
    """Clear `solid[p]` where a triangle of part p faces its `middle (p, 4)`, homogeneous and of float32 values."""
    for t in range(len(part)):
        if solid[part[t]] and facing(positions, triangles, t, middle[part[t]]) > 0:
            solid[part[t]] = False


@kernel
def join_over_edges(offsets, triangle, part):
    """Union-find: `part[t]` becomes the lowest triangle connected to t over edges."""
    for edge in range(len(offsets) - 1):
        first = triangle[offsets[edge]]
        while part[first] != first:
            part[first] = part[part[first]]
            first = part[first]
        for entry in range(offsets[edge] + 1, offsets[edge + 1]):
            other = triangle[entry]
            while part[other] != other:
                part[other] = part[part[other]]
                other = part[other]
            if other < first:
                part[first] = other
                first = other
            else:
                part[other] = first
    for t in range(len(part)):
        root = part[t]
        while part[root] != root:
            root = part[root]
        part[t] = root
