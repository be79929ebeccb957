"""Which triangles meet along which edges, by position: the topology of a soup."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SPLIT = 134217729.0
"""2^27 + 1: cuts a float64 into two halves of 26 bits, whose products are exact (Dekker 1971)."""

_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers without a pattern."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Unique undirected edges and the triangles that meet along each of them (compressed rows).

    Attributes
    ----------
    vertices
        `(e, 2) int32` welded vertices, the lower one first, in lexicographic order.
    offsets
        `(e + 1,) int64`: the triangles of edge `i` are `triangle[offsets[i]:offsets[i + 1]]`, ascending.
    triangle
        `(n,) int32` adjacent triangles, edge after edge.
    sign
        `(n,) int8`: +1 when that triangle runs along the edge from its lower to its higher vertex, else -1.
    degenerate
        `(d,) int32` triangles with two equal vertices; they have no part in the edges.
    """

    vertices: NDArray[np.int32]
    offsets: NDArray[np.int64]
    triangle: NDArray[np.int32]
    sign: NDArray[np.int8]
    degenerate: NDArray[np.int32]

    @property
    def count(self) -> NDArray[np.int64]:
        """`(e,)` number of triangles that meet along each edge."""
        return np.diff(self.offsets)

    @property
    def balance(self) -> NDArray[np.int32]:
        """`(e,)` how often an edge is run upwards minus how often downwards; 0 where windings cancel."""
        return self.total(self.sign)

    def total(self, values: NDArray[Any]) -> NDArray[np.int32]:
        """`(e,)` sum of `values (n,)`, one per adjacency, over each edge."""
        if len(self.vertices) == 0:
            return np.zeros(0, np.int32)
        return np.add.reduceat(values, self.offsets[:-1], dtype=np.int32)


def weld(positions: NDArray[np.float32]) -> NDArray[np.int32]:
    """One vertex per exact position: `(v,)` ids of `positions (v, 3)`, in order of x, y, z; -0 equals 0."""
    if len(positions) == 0:
        return np.zeros(0, np.int32)
    x, y, z = (positions + np.float32(0)).T
    order = np.lexsort((z, y, x))
    new = np.zeros(len(order), bool)
    for axis in (x, y, z):
        column = axis[order]
        new[1:] |= column[1:] != column[:-1]
    ids = np.empty(len(order), np.int32)
    ids[order] = np.cumsum(new, dtype=np.int32)
    return ids


def first_vertices(welded: NDArray[np.int32]) -> NDArray[np.int64]:
    """`(w,)` the first vertex of each id in `welded (v,)`."""
    first = np.zeros(int(welded.max(initial=-1)) + 1, np.int64)
    first[welded[::-1]] = np.arange(len(welded))[::-1]
    return first


def still_welded(welded: NDArray[np.int32], positions: NDArray[np.float32]) -> bool:
    """Whether vertices surely share a position where they share an id, and nowhere else; `welded (v,)` as of `weld`.

    Faster than to weld anew. It looks at hashes of positions: those that differ are of positions that differ.
    """
    there = positions + np.float32(0)
    of_ids = there[first_vertices(welded)]
    if not np.array_equal(of_ids[welded], there):
        return False
    x, y, z = of_ids.view(np.uint32).T.astype(np.uint64)
    hashes = np.sort(x * _MIX[0] + y * _MIX[1] + z * _MIX[2])
    return bool((hashes[1:] != hashes[:-1]).all())


def edges(triangles: NDArray[np.int32]) -> Edges:
    """The edges of welded `triangles (t, 3)`, that is, of `weld(positions)[triangles]`."""
    collapsed = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    proper = np.flatnonzero(~collapsed).astype(np.int32)
    start = triangles[proper].astype(np.int64)
    end = np.roll(start, -1, axis=1)
    low, high = np.minimum(start, end).reshape(-1), np.maximum(start, end).reshape(-1)
    key = low << 32 | high
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    return Edges(
        vertices=np.stack([key[first] >> 32, key[first] & 0xFFFFFFFF], axis=1).astype(np.int32),
        offsets=np.append(first, len(key)),
        triangle=proper[order // 3],
        sign=np.where(start.reshape(-1) == low, 1, -1).astype(np.int8)[order],
        degenerate=np.flatnonzero(collapsed).astype(np.int32),
    )


def first_equal(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """`(t,)` the lowest index of a triangle with the same corners; `triangles (t, 3)` welded, corners ascending."""
    order = np.lexsort((triangles[:, 2], triangles[:, 1], triangles[:, 0]))
    in_order = triangles[order]
    new = np.ones(len(order), bool)
    new[1:] = (in_order[1:] != in_order[:-1]).any(axis=1)
    first = np.empty(len(order), np.int32)
    first[order] = order[new][np.cumsum(new) - 1] if len(order) else 0
    return first


def zero_area(positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Whether each of `triangles (t, 3)` has exactly no area: `(t,)`, decided without rounding.

    The cross product of two sides is zero when its three differences of two products are. Each product is
    formed as a float64 and its rounding error, a pair that is unique, so two products are equal when both
    parts are. (The sides are exact in float64 unless their digits lie more than 53 bits apart; those few
    are done in rationals.)
    """
    a, b, c = (positions.astype(np.float64)[triangles[:, corner]] for corner in range(3))
    side, other = b - a, c - a
    zero = np.ones(len(triangles), bool)
    for i, j in ((1, 2), (2, 0), (0, 1)):
        first, first_error = _product(side[:, i], other[:, j])
        second, second_error = _product(side[:, j], other[:, i])
        zero &= (first == second) & (first_error == second_error)
    rounded = _difference_error(b, a).any(axis=1) | _difference_error(c, a).any(axis=1)
    for index in np.flatnonzero(rounded):
        zero[index] = _zero_area_rational(a[index], b[index], c[index])
    return zero


def silhouette_share(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], topology: Edges, lights: NDArray[np.float64]
) -> float:
    """Share of the edges that are silhouettes, averaged over homogeneous `lights (n, 4)`.

    An edge is a silhouette when its multiplicity (Kim et al. 2008; Milet et al., Algorithm 3) is not zero,
    that is, unless as many adjacent triangles lie on one side of the plane through edge and light as on the
    other. A triangle's side is its direction along the edge times the way it faces the light; flipping its
    winding changes both. This is a statistic: facing is computed in float64.
    """
    if len(topology.vertices) == 0 or len(lights) == 0:
        return 0.0
    a, b, c = (positions.astype(np.float64)[triangles[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    offset = np.einsum("ij,ij->i", normal, a)
    found = 0
    for light in lights:
        facing = np.sign(normal @ light[:3] - offset * light[3]).astype(np.int8)
        found += int(np.count_nonzero(topology.total(facing[topology.triangle] * topology.sign)))
    return found / (len(lights) * len(topology.vertices))


def _product(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`x * y` rounded, and the error of rounding (Dekker 1971); exact for coordinates up to 1e18."""
    product = x * y
    x_high, y_high = _SPLIT * x, _SPLIT * y
    x_high, y_high = x_high - (x_high - x), y_high - (y_high - y)
    x_low, y_low = x - x_high, y - y_high
    error = x_low * y_low - (((product - x_high * y_high) - x_low * y_high) - x_high * y_low)
    return product, error


def _difference_error(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """What rounding took from `x - y` (Knuth's two-sum)."""
    difference = x - y
    part = difference - x
    return (x - (difference - part)) - (y + part)


def _zero_area_rational(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> bool:
    side = [Fraction(float(q)) - Fraction(float(p)) for p, q in zip(a, b, strict=True)]
    other = [Fraction(float(q)) - Fraction(float(p)) for p, q in zip(a, c, strict=True)]
    return all(side[i] * other[j] == side[j] * other[i] for i, j in ((1, 2), (2, 0), (0, 1)))
