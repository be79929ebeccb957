"""A soup with the normals of the smooth surface that it stands for: topology, orientation, and how its edges bend.

Triangles without normals are *flat*. So are those whose normals are the facet's own, which need no other sign than the
predicate's; and those with a normal that turns more than 60 degrees from the facet: no smooth surface looks like that.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.edges import Edges, edges, first_equal, still_welded, weld
from umbrae.geometry.normals import facet_normals
from umbrae.geometry.vectors import cross, dot, row, scale, subtract, unit
from umbrae.parallel import inline, kernel

_SMOOTH = 0.5
"""Cosine of the angle up to which vertex normals of a smooth surface turn from a facet: 60 degrees."""

_FLAT = 1.0 - 2.0**-20
"""Cosine of the angle from which a normal is the facet's: both are of float32, and rounded a few times."""

_CREASE = 1e-3
"""Sine of the angle from which two normals tell the direction of the crease between them."""


class SmoothMesh(NamedTuple):
    """What the topology and the normals of a soup alone decide.

    Attributes
    ----------
    positions, triangles
        `(v, 3) float32`, `(t, 3) int32` of the soup.
    welded
        `(v,) int32`: one number per exact position.
    normals
        `(v, 3) float64` of length 1, or zero.
    facets
        `(t, 3) float32` the triangles' own.
    turned
        `(t,) int8`: 1 or -1 where winding and normals agree or not; 0 for a flat triangle, and where another triangle
        has the same corners: a sample on one of them must not meet pieces of the other, which lie off it by a rounding.
    same
        `(t,) int32`: the lowest triangle with the same corners.
    topology
        Edges of the welded triangles.
    low, high
        `(n,) int32`, for each adjacency of `topology`, the triangle's vertex at the edge's lower end and at its higher.
    edge_of
        `(t, 3) int32` the edge from each corner to the next; -1 for a collapsed triangle's.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    welded: NDArray[np.int32]
    normals: NDArray[np.float64]
    facets: NDArray[np.float32]
    turned: NDArray[np.int8]
    same: NDArray[np.int32]
    topology: Edges
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    edge_of: NDArray[np.int32]


def smooth_mesh(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], normals: NDArray[np.float32] | None
) -> SmoothMesh:
    """Find the topology; `normals (v, 3)` are None for a soup of flat triangles."""
    welded = weld(positions)
    topology = edges(welded[triangles])
    adjacent = triangles[topology.triangle]
    ends = np.repeat(topology.vertices, topology.count, axis=0)
    corner = [np.argmax(welded[adjacent] == ends[:, end, None], axis=1) for end in range(2)]
    rows = np.arange(len(adjacent))
    edge_of = np.full((len(triangles), 3), -1, np.int32)
    number = np.repeat(np.arange(len(topology.vertices), dtype=np.int32), topology.count)
    edge_of[topology.triangle, np.where(topology.sign > 0, *corner)] = number
    same = first_equal(np.sort(welded[triangles], axis=1))
    return SmoothMesh(
        **_placed(positions, triangles, normals, same),
        triangles=triangles,
        welded=welded,
        same=same,
        topology=topology,
        low=adjacent[rows, corner[0]],
        high=adjacent[rows, corner[1]],
        edge_of=edge_of,
    )


def moved_mesh(
    mesh: SmoothMesh, positions: NDArray[np.float32], normals: NDArray[np.float32] | None
) -> SmoothMesh | None:
    """The mesh with its vertices elsewhere; None where they are not surely welded as before."""
    if not still_welded(mesh.welded, positions):
        return None
    return mesh._replace(**_placed(positions, mesh.triangles, normals, mesh.same))


def _placed(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    normals: NDArray[np.float32] | None,
    same: NDArray[np.int32],
) -> dict[str, Any]:
    """What of a mesh depends on its positions and normals."""
    facets = facet_normals(positions, triangles)
    length = np.zeros(len(positions)) if normals is None else np.linalg.norm(normals.astype(np.float64), axis=1)
    vertex_normals = np.zeros((len(positions), 3))
    if normals is not None:
        np.divide(normals, length[:, None], out=vertex_normals, where=length[:, None] > 0)
    along = np.einsum("tkj,tj->tk", vertex_normals[triangles], facets)
    agrees = along.sum(axis=1) >= 0
    smooth = (np.abs(along) >= _SMOOTH).all(axis=1) & (np.sign(along) == np.sign(along[:, :1])).all(axis=1)
    smooth &= (np.abs(along) < _FLAT).any(axis=1)
    smooth &= np.bincount(same, minlength=len(same))[same] == 1
    turned = np.where(smooth, np.where(agrees, 1, -1), 0).astype(np.int8)
    return {"positions": positions, "normals": vertex_normals, "facets": facets, "turned": turned}


def edge_directions(mesh: SmoothMesh, chosen: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """`(k, 3)` unit directions of the smooth surface along edges, at their lower and at their higher ends.

    Perpendicular to the normals of all triangles there: the chord projected onto the tangent plane, or at a crease the
    direction that is tangent to both sides. Where that turns away from the chord by 60 degrees or more, the chord; and
    at hollow creases, which never bound a shadow: the light has met one of their sides before.
    """
    found = np.empty((2, len(chosen), 3))
    topology = mesh.topology
    for end, vertex in enumerate((mesh.low, mesh.high)):
        fill_directions(
            chosen, mesh.positions, mesh.triangles, mesh.normals, mesh.facets, mesh.turned, topology.offsets,
            topology.triangle, topology.sign, mesh.low, mesh.high, vertex, found[end],
        )  # fmt: skip
    return found[0], found[1]


@inline
def normal_at(t, v, turned, normals, facets):
    """The normal of triangle t at its vertex v."""
    return row(facets, t) if turned[t] == 0 else row(normals, v)


@inline
def hollow(positions, triangles, facets, turned, triangle, sign, first, last):
    """Whether the two triangles of an edge, wound alike, are turned towards each other."""
    if last - first != 2 or sign[first] == sign[first + 1]:
        return False
    s, t = triangle[first], triangle[first + 1]
    outwards = scale(-1.0 if turned[s] < 0 else 1.0, row(facets, s))
    rise = 0.0
    for k in range(3):
        rise += dot(outwards, subtract(row(positions, triangles[t, k]), row(positions, triangles[s, 0])))
    return rise > 0.0


@kernel
def fill_directions(
    chosen, positions, triangles, normals, facets, turned, offsets, triangle, sign, low, high, vertex, out
):
    """`edge_directions` at one end, that of `vertex`."""
    for number in range(len(chosen)):
        first, last = offsets[chosen[number]], offsets[chosen[number] + 1]
        chord = unit(subtract(row(positions, high[first]), row(positions, low[first])))
        one = normal_at(triangle[first], vertex[first], turned, normals, facets)
        found, widest = subtract(chord, scale(dot(one, chord), one)), _CREASE * _CREASE
        for entry in range(first, last):
            one = normal_at(triangle[entry], vertex[entry], turned, normals, facets)
            for other in range(entry + 1, last):
                along = cross(one, normal_at(triangle[other], vertex[other], turned, normals, facets))
                if dot(along, along) > widest:
                    widest = dot(along, along)
                    found = along if dot(along, chord) > 0.0 else scale(-1.0, along)
        found = unit(found)
        if dot(found, chord) < 0.5 or (
            widest > _CREASE * _CREASE and hollow(positions, triangles, facets, turned, triangle, sign, first, last)
        ):
            found = chord
        for axis in range(3):
            out[number, axis] = found[axis]
