"""Vertex normals for meshes that come without: smoothing groups by the angle between facets."""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import edges, weld
from umbrae.geometry.normals import facet_normals
from umbrae.parallel import kernel


def smoothing_groups(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], cosine: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Corners that share a normal, and the normals.

    An edge of two triangles that run along it in opposite directions is smooth where their facets turn by an angle with
    at least this cosine. Around a vertex, triangles that are joined over smooth edges are a group, whose normal is the
    mean of theirs weighted by their angles there (Thürmer and Wüthrich 1998), so that both ends of a smooth edge have
    one normal each, and an edge that is not smooth is a crease.

    Parameters
    ----------
    positions, triangles
        `(v, 3) float32`, `(t, 3) int32`.

    Returns
    -------
    `(t, 3)` the group of each corner, and `(g, 3)` their unit normals; zero where triangles have no area.
    """
    welded = weld(positions)[triangles]
    topology = edges(welded)
    facets = facet_normals(positions, triangles).astype(np.float64)
    joined = np.arange(3 * len(triangles))
    join_corners(welded, topology.vertices, topology.offsets, topology.triangle, topology.sign, facets, cosine, joined)
    _, group = np.unique(joined, return_inverse=True)
    corners = positions.astype(np.float64)[triangles]
    normals = np.zeros((int(group.max(initial=-1)) + 1, 3))
    for k in range(3):
        a, b = (corners[:, (k + step) % 3] - corners[:, k] for step in (1, 2))
        length = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        cosines = np.divide(np.einsum("ij,ij->i", a, b), length, out=np.ones(len(a)), where=length > 0)
        weighted = np.arccos(np.clip(cosines, -1.0, 1.0))[:, None] * facets
        np.add.at(normals, group.reshape(-1, 3)[:, k], weighted)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return group.reshape(-1, 3), np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)


@kernel
def join_corners(welded, vertices, offsets, triangle, sign, facets, cosine, joined):
    """Union-find over corners: `joined[3 t + k]` becomes the lowest corner of the same group."""
    for edge in range(len(vertices)):
        first = offsets[edge]
        if offsets[edge + 1] - first != 2 or sign[first] == sign[first + 1]:
            continue
        s, t = triangle[first], triangle[first + 1]
        turn = 0.0
        for axis in range(3):
            turn += facets[s, axis] * facets[t, axis]
        if turn < cosine:
            continue
        for end in range(2):
            a, b = np.int64(0), np.int64(0)
            for k in range(3):
                a = 3 * s + k if welded[s, k] == vertices[edge, end] else a
                b = 3 * t + k if welded[t, k] == vertices[edge, end] else b
            while joined[a] != a:
                joined[a] = joined[joined[a]]
                a = joined[a]
            while joined[b] != b:
                joined[b] = joined[joined[b]]
                b = joined[b]
            joined[max(a, b)] = min(a, b)
    for corner in range(len(joined)):
        root = joined[corner]
        while joined[root] != root:
            root = joined[root]
        joined[corner] = root
