"""A binary tree of boxes over objects: what culling walks through (Stich, Waechter, Keller 2007, section 11.3.3).

The tree is complete, over objects in the order of a space-filling curve, and every step of building it is one pass over
arrays: it may be built anew for each frame of an animation, and refitted where objects keep their order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.morton import morton3
from umbrae.parallel import kernel

Boxes = NDArray[np.float32]


class ObjectTree(NamedTuple):
    """A complete binary tree in heap order: node i has children 2 i + 1 and 2 i + 2, and parent (i - 1) // 2.

    Attributes
    ----------
    lower, upper
        `(nodes, 3) float32`: boxes; empty ones (lower above upper) where there is nothing below.
    order
        `(leaves,) int32`: the object in leaf node `first_leaf + k`; -1 where there is none.
    first_leaf
        Number of inner nodes.
    """

    lower: Boxes
    upper: Boxes
    order: NDArray[np.int32]
    first_leaf: int


def object_boxes(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], object_id: NDArray[np.int32], count: int
) -> tuple[Boxes, Boxes]:
    """`(count, 3)` lower and upper corners around each object's triangles; an object without any has an empty box."""
    lower, upper = np.full((count, 3), np.inf, np.float32), np.full((count, 3), -np.inf, np.float32)
    widen_boxes(positions, triangles, object_id, lower, upper)
    return lower, upper


def object_tree(lower: Boxes, upper: Boxes) -> ObjectTree:
    """A tree over boxes `(n, 3)`; empty boxes come last."""
    count = len(lower)
    full: NDArray[np.bool_] = np.all(lower <= upper, axis=1)
    middle = np.zeros((count, 3))
    middle[full] = lower[full].astype(np.float64) / 2 + upper[full].astype(np.float64) / 2
    along = np.flatnonzero(full)
    along = along[np.argsort(morton3(middle[along]), kind="stable")]
    leaves = 1 << max(0, int(np.ceil(np.log2(max(1, count)))))
    order = np.full(leaves, -1, np.int32)
    order[: len(along)] = along
    order[len(along) : count] = np.flatnonzero(~full)
    nodes = 2 * leaves - 1
    tree = ObjectTree(np.empty((nodes, 3), np.float32), np.empty((nodes, 3), np.float32), order, leaves - 1)
    refit(tree, lower, upper)
    return tree


def refit(tree: ObjectTree, lower: Boxes, upper: Boxes) -> None:
    """Put the boxes `(n, 3)` of moved objects into a tree that was built over as many."""
    held = tree.order >= 0
    low, high = np.full((len(tree.order), 3), np.inf, np.float32), np.full((len(tree.order), 3), -np.inf, np.float32)
    low[held], high[held] = lower[tree.order[held]], upper[tree.order[held]]
    start = tree.first_leaf
    while True:
        tree.lower[start : 2 * start + 1], tree.upper[start : 2 * start + 1] = low, high
        if start == 0:
            return
        low, high = low.reshape(-1, 2, 3).min(axis=1), high.reshape(-1, 2, 3).max(axis=1)
        start = (start - 1) // 2


def compact_objects(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], object_id: NDArray[np.int32], most: int
) -> NDArray[np.int32]:
    """`(t,)` objects of at most `most` triangles each: every given one as it is, or cut along a space-filling curve."""
    if len(triangles) == 0:
        return np.zeros(0, np.int32)
    corners = positions.astype(np.float64)[triangles]
    order = np.lexsort((morton3(corners.mean(axis=1)), object_id))
    ids = object_id[order]
    starts = np.flatnonzero(np.append(True, ids[1:] != ids[:-1]))
    rank = np.arange(len(ids)) - np.repeat(starts, np.diff(np.append(starts, len(ids))))
    begins = (rank % most) == 0
    compact = np.empty(len(ids), np.int32)
    compact[order] = np.cumsum(begins, dtype=np.int32) - 1
    return compact


@kernel
def widen_boxes(positions, triangles, object_id, lower, upper):
    """Widen each object's box to its triangles."""
    for t in range(len(triangles)):
        number = object_id[t]
        for corner in range(3):
            for axis in range(3):
                x = positions[triangles[t, corner], axis]
                lower[number, axis] = min(lower[number, axis], x)
                upper[number, axis] = max(upper[number, axis], x)
