"""What float64 leaves open on the GPU, decided on the CPU."""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import SHADOWED, facing, shadows
from umbrae.parallel import kernel


@kernel
def decide_pairs(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    light: NDArray[np.float64],
    own: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    side: NDArray[np.int8],
    pairs: NDArray[np.int32],
    in_shadow: NDArray[np.bool_],
) -> None:
    """Set `in_shadow (p,)` where the triangle of a pair shadows its sample.

    `pairs (p, 2)` hold a sample's index and a triangle's; `own`, `barycentric`, `side` are the samples' arrays.
    """
    point = np.empty(3)
    for p in range(len(pairs)):
        s, t = pairs[p, 0], pairs[p, 1]
        u, v = np.float64(barycentric[s, 0]), np.float64(barycentric[s, 1])
        toward = facing(positions, triangles, t, light)
        found = shadows(positions, triangles, t, toward, light, own[s], u, v, side[s], point, True)
        in_shadow[p] = (found & SHADOWED) != 0
