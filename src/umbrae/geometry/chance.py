"""Chances of samples at triangles: hashes, hence the same for any number of threads and any order of the work.

Whatever is stopped with some probability at a triangle compares that with a number in [0, 1) that depends on a seed,
the triangle and the sample alone. The numbers of a pixel's n samples lie one in each n-th of [0, 1), as Enderton et al.
2010 stratify them, in an order that differs from pixel to pixel and from triangle to triangle: what is stopped with
probability p by a triangle over the whole pixel is so at n p of them, rounded up or down.

`gl/include/chance.glsl` is the same in shaders.
"""

import numpy as np
from numpy.typing import NDArray

from umbrae.parallel import inline, kernel

VIEW, LIGHT = 0, 1
"""What chances are for: a triangle must not stop the same samples on their way to the light as on that to the eye."""

MOST_STRATA = 1 << 16
"""Samples per pixel up to which the order of the strata needs 32 bits in shaders."""

_STRIDES = np.array(
    [
        539132281, 567308789, 604631369, 637651891, 663485161, 681143423, 762308179, 810749237,
        944479709, 955424933, 1001551027, 1015101827, 1019508271, 1043940379, 1060703011, 1068840287,
    ]
)  # fmt: skip
"""Primes, none of which divides a number of samples per pixel: a pixel's samples in so many different orders."""


def key_of(seed: int, purpose: int, light: NDArray[np.float32] | None = None) -> np.uint64:
    """The 64 bits that `chance` takes, of a seed of 63 bits, for `VIEW` or `LIGHT`.

    Each `light (4,)` has chances of its own: of several, and of the points of one with a size, noise averages out.
    """
    key = np.uint64(_mixed(np.uint64(int(seed) | purpose << 63)))
    for word in () if light is None else light.view(np.uint32):
        key = np.uint64(_mixed(key ^ np.uint64(word)))
    return key


@inline
def chance(key: np.uint64, t: int, index: int, strata: int) -> float:
    """A number in [0, 1) at triangle t for sample `index` of a picture with `strata` samples in each pixel."""
    drawn = _mixed(_mixed(key ^ np.uint64(t)) ^ np.uint64(index // strata))
    number, offset = index % strata, np.int64(drawn >> np.uint64(33))
    stratum = (number * _STRIDES[np.int64(drawn & np.uint64(15))] + offset) % strata
    within = np.float64(_mixed(drawn ^ np.uint64(number)) >> np.uint64(11)) * 2.0**-53
    # Below 1 also when rounded: what is opaque always stops everything.
    found: float = min((np.float64(stratum) + within) / np.float64(strata), 1.0 - 2.0**-53)
    return found


@kernel
def chances(
    key: np.uint64, triangles: NDArray[np.int32], samples: NDArray[np.int64], strata: int
) -> NDArray[np.float64]:
    """`chance` for each pair of a triangle and a sample, `(p,)` both."""
    found = np.empty(len(triangles))
    for p in range(len(triangles)):
        found[p] = chance(key, np.int64(triangles[p]), samples[p], strata)
    return found


@inline
def _mixed(key: np.uint64) -> np.uint64:
    """A 64-bit number with each bit depending on all of the key's (splitmix64, Steele et al. 2014)."""
    key += np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))
