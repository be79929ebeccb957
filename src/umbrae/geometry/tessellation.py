"""Coarse triangles with smooth normals as many small ones on a curved surface (Boubekeur and Alexa 2008).

Phong tessellation moves a point p of a triangle to (1 - a) p + a (the mean of p projected onto the tangent planes of
the three corners, weighted by p's barycentrics b). That is p + sum of b_i b_j e_ij over the sides, where e_ij is four
times what the middle of a side is moved by, and depends on the side's two ends alone. Here all triangles along an edge
share one e, that of `hermite.phong` with its blend: where their normals differ, the tangent of the crease takes the
place of the tangent planes. So no edge opens, whatever meets there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.hermite import phong
from umbrae.geometry.smooth_mesh import SmoothMesh, edge_directions, smooth_mesh
from umbrae.geometry.solids import join_over_edges


class Tessellation(NamedTuple):
    """Small triangles in place of a soup's.

    Attributes
    ----------
    positions
        `(p, 3) float32`: the soup's vertices first. Points that triangles share are equal to the last bit.
    triangles
        `(k, 3) int32`, wound like those that they are parts of.
    source
        `(k,) int32` the soup's triangle that each is a part of, ascending.
    place
        `(k,) int32` the row of `corners` that it takes there.
    corners
        `(level^2 + 1, 3, 2) float64`: barycentrics u, v of each part's corners; last those of a whole triangle.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    source: NDArray[np.int32]
    place: NDArray[np.int32]
    corners: NDArray[np.float64]


def tessellate(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], normals: NDArray[np.float32] | None, level: int
) -> Tessellation:
    """Cut each side into `level` pieces and each triangle into `level^2`, with all corners on the curved surface.

    Parts of the soup, connected over edges, of which no edge is curved stay as they are.
    """
    mesh = smooth_mesh(positions, triangles, normals)
    bulge = _bulges(mesh)
    divided = _curved_parts(mesh, bulge)
    chosen = np.flatnonzero(divided)
    grid, parts = _pattern(level)
    weights = np.column_stack([level - grid.sum(axis=1), grid]) / level
    corners, on_sides = positions[triangles[chosen]].astype(np.float64), bulge[mesh.edge_of[chosen]]
    # On a side all but two or three of these terms are zero, and neither depends on which way the side is run.
    points = np.zeros((len(chosen), len(grid), 3))
    for corner in range(3):
        points += weights[:, corner, None] * corners[:, None, corner]
    for side in range(3):
        points += (weights[:, side] * weights[:, (side + 1) % 3])[:, None] * on_sides[:, None, side]

    source = np.repeat(np.arange(len(triangles), dtype=np.int32), np.where(divided, len(parts), 1))
    small, place = triangles[source], np.full(len(source), len(parts), np.int32)
    first = len(positions) + len(grid) * np.arange(len(chosen))
    small[divided[source]] = (first[:, None, None] + parts).reshape(-1, 3)
    place[divided[source]] = np.tile(np.arange(len(parts)), len(chosen))
    return Tessellation(
        np.concatenate([positions, points.reshape(-1, 3).astype(np.float32)]),
        small,
        source,
        place,
        np.concatenate([grid[parts] / level, [[(0, 0), (1, 0), (0, 1)]]]),
    )


def _bulges(mesh: SmoothMesh) -> NDArray[np.float64]:
    """`(e, 3)` four times what the middle of each edge is moved by; exactly zero where the normals do not turn."""
    first = mesh.topology.offsets[:-1]
    p0, p1 = mesh.positions[mesh.low[first]].astype(np.float64), mesh.positions[mesh.high[first]].astype(np.float64)
    curves = phong(p0, p1, *edge_directions(mesh, np.arange(len(first), dtype=np.int32)))
    return (curves.t0 - curves.t1) / 2


def _curved_parts(mesh: SmoothMesh, bulge: NDArray[np.float64]) -> NDArray[np.bool_]:
    """`(t,)` triangles with an area in connected parts some edge of which is curved."""
    topology = mesh.topology
    part = np.arange(len(mesh.triangles), dtype=np.int32)
    join_over_edges(topology.offsets, topology.triangle, part)
    curved = np.zeros(len(part), bool)
    curved[part[topology.triangle[topology.offsets[:-1][bulge.any(axis=1)]]]] = True
    found: NDArray[np.bool_] = curved[part]
    found[topology.degenerate] = False
    return found


def _pattern(level: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Points `(g, 2)` of a triangle, u and v in steps of 1 / `level`, and the `(level^2, 3)` parts between them."""
    grid = np.array([(u, v) for v in range(level + 1) for u in range(level + 1 - v)])
    number = {(u, v): at for at, (u, v) in enumerate(grid.tolist())}
    upright = [(number[u, v], number[u + 1, v], number[u, v + 1]) for u, v in number if u + v < level]
    turned = [(number[u + 1, v], number[u + 1, v + 1], number[u, v + 1]) for u, v in number if u + v < level - 1]
    return grid, np.array(upright + turned)
