"""Facet and smooth normals, and the terminator between them."""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.vectors import Vec3, add, cross, dot, interpolate, row, scale, subtract, unit
from umbrae.parallel import inline, kernel

_SMOOTH_COSINE = 0.7
"""A facet that turns more than 45 degrees away from a vertex normal is an edge there, not a rounding."""


def facet_normals(positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    """`(t, 3) float32` unit normals of the triangles; zero without area."""
    corners = positions.astype(np.float64)[triangles]
    sides = corners[:, 1:] - corners[:, :1]
    sides /= np.abs(sides).max(axis=(1, 2), keepdims=True, initial=1e-300)
    normals = np.cross(sides[:, 0], sides[:, 1])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit_length = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    single: NDArray[np.float32] = unit_length.astype(np.float32)
    return single


@inline
def facet_normal(positions: NDArray[np.float32], a: int, b: int, c: int) -> Vec3:
    """Unit normal of triangle `a b c` by its winding; zero when it has no area."""
    start = row(positions, a)
    ab, ac = subtract(row(positions, b), start), subtract(row(positions, c), start)
    normal: Vec3 = unit(cross(ab, ac))
    return normal


@inline
def smooth_normal(
    normals: NDArray[np.float32], a: int, b: int, c: int, v: float, w: float, facet: Vec3
) -> tuple[Vec3, float]:
    """Vertex normals interpolated at barycentrics `(1 - v - w, v, w)`, and their agreement with the facet's.

    +1 when the vertex normals lie on its side, -1 on the other (some models wind their triangles against
    their normals), 0 when one of them is missing: then there is no smooth normal.
    """
    at_a, at_b, at_c = row(normals, a), row(normals, b), row(normals, c)
    normal = unit(interpolate(normals, a, b, c, v, w))
    if not (dot(at_a, at_a) > 0.0 and dot(at_b, at_b) > 0.0 and dot(at_c, at_c) > 0.0 and dot(normal, normal) > 0.0):
        return normal, 0.0
    return normal, 1.0 if dot(add(at_a, add(at_b, at_c)), facet) >= 0.0 else -1.0


@inline
def towards_light(lights: NDArray[np.float64], k: int, point: Vec3) -> Vec3:
    """Unit vector from a point to the k-th of homogeneous lights `(n, 4)`."""
    direction: Vec3 = unit(subtract(row(lights, k), scale(lights[k, 3], point)))
    return direction


@kernel
def first_alike(positions: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.int32]:
    """Per vertex, the first one with the same position and normal: files repeat vertices along texture seams.

    A hash table with open addressing, at most half full.
    """
    count = positions.shape[0]
    size = 2
    while size < 2 * count:
        size *= 2
    table = np.full(size, -1, np.int32)
    first = np.empty(count, np.int32)
    for v in range(count):
        key = 0
        for axis in range(3):
            key = (key * 31 + hash(positions[v, axis])) * 31 + hash(normals[v, axis])
        slot = (key ^ (key >> 29) ^ (key >> 47)) & (size - 1)
        while table[slot] >= 0 and not _alike(positions, normals, v, table[slot]):
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = v
        first[v] = table[slot]
    return first


@inline
def _alike(positions: NDArray[np.float32], normals: NDArray[np.float32], a: int, b: int) -> bool:
    for axis in range(3):
        if positions[a, axis] != positions[b, axis] or normals[a, axis] != normals[b, axis]:
            return False
    return True


@kernel
def terminator_fade(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    normals: NDArray[np.float32],
    first: NDArray[np.int32],
    lights: NDArray[np.float64],
    k: int,
    fade: NDArray[np.float32],
) -> None:
    """Per vertex, the factor that ends smooth shading where the first facet around turns from the light.

    Facets fall into shadow one by one while smooth normals still face the light, which leaves a jagged edge
    of half-lit facets. Chiang, Li and Burley ("Taming the Shadow Terminator", 2019) fade by the ratio G of
    the facet's cosine to the smooth one, as -G^3 + G^2 + G. Deviation: G is taken per vertex, from the
    smallest cosine among the facets around it, and interpolated. So the fade is continuous across facets and
    exactly 0 along the edges they share with facets that face away.

    Parameters
    ----------
    first
        `(v,)` of `first_alike`: facets around a vertex are those around all its copies.
    lights, k
        `(n, 4)` homogeneous, and the index of the one in question.
    fade
        `(n, v, 2)`, of which `fade[k]` is written: for the side the vertex normal points to, then for the
        other.
    """
    fade[k, :, 0] = np.inf
    fade[k, :, 1] = np.inf
    for t in range(triangles.shape[0]):
        facet = facet_normal(positions, triangles[t, 0], triangles[t, 1], triangles[t, 2])
        for i in range(3):
            v = first[triangles[t, i]]
            agreement = dot(facet, unit(row(normals, v)))
            if abs(agreement) < _SMOOTH_COSINE:
                continue
            facing = dot(facet, towards_light(lights, k, row(positions, v)))
            if agreement < 0.0:
                facing = -facing
            fade[k, v, 0] = min(fade[k, v, 0], facing)
            fade[k, v, 1] = min(fade[k, v, 1], -facing)
    for v in range(positions.shape[0]):
        if first[v] < v:
            fade[k, v, 0], fade[k, v, 1] = fade[k, first[v], 0], fade[k, first[v], 1]
            continue
        facing = dot(unit(row(normals, v)), towards_light(lights, k, row(positions, v)))
        fade[k, v, 0] = _eased(fade[k, v, 0], facing)
        fade[k, v, 1] = _eased(fade[k, v, 1], -facing)


@inline
def _eased(facet: float, smooth: float) -> float:
    """Chiang, Li and Burley's curve over the ratio of the facet's cosine to the smooth one."""
    if facet <= 0.0 or smooth <= 0.0:
        return 0.0
    ratio = min(1.0, facet / smooth)
    return ratio * (1.0 + ratio - ratio * ratio)
