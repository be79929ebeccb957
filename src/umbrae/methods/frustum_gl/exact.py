"""What float64 leaves open on the GPU, decided on the CPU."""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import SHADOWED, facing, hit_weights, shadows, surface_point
from umbrae.parallel import kernel
from umbrae.transmission import EVEN, SOLID, Transmission, passing


@kernel
def decide_pairs(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    light: NDArray[np.float64],
    own: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
    side: NDArray[np.int8],
    pairs: NDArray[np.int32],
    closed: NDArray[np.bool_],
    in_shadow: NDArray[np.bool_],
) -> None:
    """Set `in_shadow (p,)` where the triangle of a pair shadows its sample.

    `pairs (p, 2)` hold a sample's index and a triangle's; `own`, `barycentric`, `position`, `side` are the samples'
    arrays, and `closed (p,)` says whether side planes belong to the pair's triangle.
    """
    point = np.empty(3)
    for p in range(len(pairs)):
        s, t = pairs[p, 0], pairs[p, 1]
        point[0], point[1], point[2] = position[s, 0], position[s, 1], position[s, 2]
        u, v = np.float64(barycentric[s, 0]), np.float64(barycentric[s, 1])
        toward = facing(positions, triangles, t, light)
        found = shadows(positions, triangles, t, toward, light, own[s], u, v, side[s], point, closed[p])
        in_shadow[p] = (found & SHADOWED) != 0


@kernel
def shares_of_pairs(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    table: Transmission,
    light: NDArray[np.float64],
    own: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
    pairs: NDArray[np.int32],
    shares: NDArray[np.float64],
) -> None:
    """Fill `shares (p, 3)` with what the triangle of each pair lets through on the way to its sample."""
    point = np.empty(3)
    for p in range(len(pairs)):
        s, t = pairs[p, 0], pairs[p, 1]
        kind = table.kind[t]
        if kind == SOLID:
            shares[p] = 0.0
        elif kind == EVEN:
            shares[p] = table.even[table.material_id[t]]
        else:
            u, v = np.float64(barycentric[s, 0]), np.float64(barycentric[s, 1])
            point[0], point[1], point[2] = position[s, 0], position[s, 1], position[s, 2]
            surface_point(positions, triangles, own[s], u, v, point)
            weights = hit_weights(positions, triangles, t, light, point)
            shares[p, 0], shares[p, 1], shares[p, 2] = passing(triangles, table, t, *weights)
