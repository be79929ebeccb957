"""The few of many points that all others lie between."""

import numpy as np
from numpy.typing import NDArray

_COUNT = 128


def outermost(points: NDArray[np.floating]) -> NDArray[np.float64]:
    """Those of `points (n, 3)` that lie farthest in each of 128 directions; what lies beyond them is little.

    No direction is 14 degrees or more from all of these: of a ball, 3 percent of the radius may lie beyond.
    """
    chosen = {int(np.argmax(points @ direction.astype(points.dtype))) for direction in directions(_COUNT)}
    return points[sorted(chosen)].astype(np.float64)


def directions(count: int) -> NDArray[np.float64]:
    """`(count, 3)` of length 1, evenly spread: a spiral by the golden angle."""
    step = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * step / count, np.pi * (1.0 + 5.0**0.5) * step
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
