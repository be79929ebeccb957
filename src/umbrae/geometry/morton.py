"""Space-filling curves: neighbours in space become neighbours in memory."""

import numpy as np
from numpy.typing import NDArray


def morton3(points: NDArray[np.floating]) -> NDArray[np.int64]:
    """Morton code `(n,)` of points `(n, 3)` on a grid of 2**20 cells along each axis of their bounds."""
    if len(points) == 0:
        return np.zeros(0, np.int64)
    low, high = points.min(axis=0), points.max(axis=0)
    extent = (high - low).max()
    cells = ((points - low) / (extent if extent > 0 else 1.0) * ((1 << 20) - 1)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for axis in range(3):
        code |= _spread(cells[:, axis]) << axis
    return code


def _spread(bits: NDArray[np.int64]) -> NDArray[np.int64]:
    """Move bit i of a 21-bit number to bit 3 i."""
    bits = (bits | bits << 32) & 0x1F00000000FFFF
    bits = (bits | bits << 16) & 0x1F0000FF0000FF
    bits = (bits | bits << 8) & 0x100F00F00F00F00F
    bits = (bits | bits << 4) & 0x10C30C30C30C30C3
    return (bits | bits << 2) & 0x1249249249249249
