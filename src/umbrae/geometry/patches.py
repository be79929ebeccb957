"""Edges with the vertices opposite to them, as OpenGL's primitives want them: a row of so many numbers each."""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import Edges
from umbrae.parallel import kernel

Parts = dict[int, tuple[NDArray[np.int64], NDArray[np.int64]]]


def split_edges(topology: Edges, most: int) -> Parts:
    """Edges with at most `most` triangles each, those of more split into parts that add up to them.

    By the number of triangles: `(n,)` which edge, and `(n,)` where its part of `topology.triangle` begins.
    """
    parts = -(-topology.count // most)
    edge = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)
    begin = topology.offsets[edge] + part * most
    count = np.minimum(topology.offsets[edge + 1] - begin, most)
    return {int(size): (edge[count == size], begin[count == size]) for size in np.unique(count)}


def edge_patches(
    topology: Edges, opposite: NDArray[np.int32], parts: Parts, kept: NDArray[np.bool_] | None
) -> dict[int, NDArray[np.int32]]:
    """By the number of triangles of a part: `(n, 2 + number)` its edge, lower end first, and the `opposite` vertices.

    Only parts with some triangle that is `kept (t,)`. The others' opposite vertices are replaced by the lower end,
    which lies in every plane through the edge, and so counts for nothing.
    """
    made = {}
    for size, (edge, begin) in parts.items():
        rows = np.empty((len(edge), 2 + size), np.int32)
        every = np.ones(0, bool) if kept is None else kept
        count = fill_patches(topology.vertices, topology.triangle, opposite, edge, begin, every, rows)
        made[size] = rows[:count]
    return made


@kernel
def fill_patches(vertices, triangle, opposite, edge, begin, kept, rows):
    """Fill the first rows, and return how many; no `kept` at all keeps everything."""
    count = 0
    for i in range(len(edge)):
        some = False
        for k in range(rows.shape[1] - 2):
            here = len(kept) == 0 or kept[triangle[begin[i] + k]]
            rows[count, 2 + k] = opposite[begin[i] + k] if here else vertices[edge[i], 0]
            some = some or here
        if some:
            rows[count, 0], rows[count, 1] = vertices[edge[i], 0], vertices[edge[i], 1]
            count += 1
    return count
