"""A conservative box tree over triangles, for whoever wants candidates and not verdicts."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.morton import morton3
from umbrae.parallel import inline

LEAF = 4
"""Triangles per leaf."""

STACK = 64
"""Deepest traversal stack: the tree is balanced, one entry per level is enough."""


class BoxTree(NamedTuple):
    """A complete binary tree in heap order: node i has children 2 i + 1 and 2 i + 2; padding boxes are empty.

    `lower`, `upper` are `(nodes, 3) float64`; leaf number k (node `first_leaf + k`) holds
    `order[LEAF k : LEAF (k + 1)]`, triangle indices padded with -1.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    order: NDArray[np.int32]
    first_leaf: int


def build(positions: NDArray[np.float32], triangles: NDArray[np.int32]) -> BoxTree:
    """Sort triangles along a space-filling curve and put boxes around every `LEAF` of them, then around pairs."""
    corners = positions[triangles].astype(np.float64)
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(morton3((low + high) / 2), kind="stable").astype(np.int32)
    leaves = 1 << max(0, int(np.ceil(np.log2(max(1, -(-len(order) // LEAF))))))
    padded = np.full(leaves * LEAF, -1, np.int32)
    padded[: len(order)] = order
    lower = np.full((2 * leaves - 1, 3), np.inf)
    upper = np.full((2 * leaves - 1, 3), -np.inf)
    box_low, box_high = np.full((len(padded), 3), np.inf), np.full((len(padded), 3), -np.inf)
    box_low[: len(order)], box_high[: len(order)] = low[order], high[order]
    box_low, box_high = (
        box_low.reshape(leaves, LEAF, 3).min(axis=1),
        box_high.reshape(leaves, LEAF, 3).max(axis=1),
    )
    start = leaves - 1
    while True:
        lower[start : 2 * start + 1], upper[start : 2 * start + 1] = box_low, box_high
        if start == 0:
            return BoxTree(lower, upper, padded, leaves - 1)
        box_low, box_high = box_low.reshape(-1, 2, 3).min(axis=1), box_high.reshape(-1, 2, 3).max(axis=1)
        start = (start - 1) // 2


@inline
def segment_meets_box(point, light, lower, upper, node, radius):
    """Whether the box of a node, grown by `radius`, meets the segment (or ray) from a point to a homogeneous light.

    Conservative: the box is grown by another 1e-12 of all magnitudes involved, some thousand times the rounding error
    of the interval arithmetic below.
    """
    near, far = 0.0, np.inf
    if light[3] != 0.0:
        far = 1.0
    size = 0.0
    for axis in range(3):
        if lower[node, axis] > upper[node, axis]:
            return False
        size = max(size, abs(lower[node, axis]), abs(upper[node, axis]), abs(point[axis]))
    pad = radius + 1e-12 * size
    for axis in range(3):
        direction = light[axis] - light[3] * point[axis]
        low = lower[node, axis] - pad - point[axis]
        high = upper[node, axis] + pad - point[axis]
        if direction == 0.0:
            if low > 0.0 or high < 0.0:
                return False
        else:
            first, last = low / direction, high / direction
            if first > last:
                first, last = last, first
            near = max(near, first)
            far = min(far, last)
    return near <= far * (1.0 + 1e-12)
