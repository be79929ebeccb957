"""Three numbers as a tuple, inside kernels.

Rows are read into tuples by index: a slice of an array would count references, which costs more than the
arithmetic.
"""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.parallel import inline

Vec3 = tuple[float, float, float]


@inline
def row(array: NDArray[np.floating], index: int) -> Vec3:
    """Row `index` of an `(n, 3)` array, in float64; to Numba, `float` of a float32 is a float32."""
    return np.float64(array[index, 0]), np.float64(array[index, 1]), np.float64(array[index, 2])


@inline
def add(a: Vec3, b: Vec3) -> Vec3:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def subtract(a: Vec3, b: Vec3) -> Vec3:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def scale(factor: float, a: Vec3) -> Vec3:
    """Factor times a."""
    return factor * a[0], factor * a[1], factor * a[2]


@inline
def times(a: Vec3, b: Vec3) -> Vec3:
    """Component by component, as a colour filters light."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@inline
def mix(a: Vec3, b: Vec3, share: float) -> Vec3:
    """From a (share 0) to b (share 1)."""
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


@inline
def dot(a: Vec3, b: Vec3) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def unit(a: Vec3) -> Vec3:
    """The vector at length 1; zero stays zero."""
    length = math.sqrt(dot(a, a))
    if length == 0.0:
        return a
    return a[0] / length, a[1] / length, a[2] / length


@inline
def interpolate(array: NDArray[np.floating], a: int, b: int, c: int, v: float, w: float) -> Vec3:
    """Rows `a`, `b`, `c` of an `(n, 3)` array at barycentrics `(1 - v - w, v, w)`."""
    start = row(array, a)
    along_v, along_w = subtract(row(array, b), start), subtract(row(array, c), start)
    point: Vec3 = add(start, add(scale(v, along_v), scale(w, along_w)))
    return point
