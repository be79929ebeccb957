"""The view-sample hierarchy: clusters of up to 16 samples in light-frame coordinates, and boxes over them.

Sintorn et al. 2011 (section 3.1) build theirs over the camera's depth buffer. This one lives in a light frame (see
`light_frame`) and its leaves are sorted along a space-filling curve there, because that is where frusta are thin: a
triangle meets the few nodes around it instead of a long row of tiles across the screen. It also serves points that
have no camera. Samples whose seen side faces away from the light, and background, are left out (section 3.5).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.morton import morton3
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_clusters import LANES, SPARE, cluster_tiles
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples

ARITY = 8
"""Children per node."""

_TILES_PER_TASK = 1024

XMIN, XMAX, YMIN, YMAX, QMIN, QMAX = range(6)


class Leaves(NamedTuple):
    """Sample clusters; all arrays have one row per slot, `(n, LANES)` or `(n,)`.

    `x, y, q` light-frame coordinates in window units; `own` own triangle, -1 for a free point, `DARK` when decided;
    `sample` its flat index, -1 for padding; `slack` `(n, 2)` how far x or y, and q, may be off; `box` `(n, 6)` bounds
    of the lanes including slack; `key` frame number and position on the curve.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    q: NDArray[np.float32]
    own: NDArray[np.int32]
    sample: NDArray[np.int32]
    slack: NDArray[np.float32]
    box: NDArray[np.float32]
    key: NDArray[np.int64]


class SampleTree(NamedTuple):
    """Boxes over the leaves of one light frame.

    `box` `(6, nodes) float32`, level after level from the leaves up, each level padded with empty boxes to a multiple
    of `ARITY`; `level` `(levels + 1,)` where each level starts; `slot` `(leaves,)` the row in `Leaves` of each leaf;
    `full` `(nodes,) uint8` set when everything below lies in shadow: the hierarchical shadow buffer.
    """

    box: NDArray[np.float32]
    level: NDArray[np.int64]
    slot: NDArray[np.int32]
    full: NDArray[np.uint8]


def build(
    samples: ViewSamples,
    facing: NDArray[np.int8],
    light: NDArray[np.float64],
    frames: list[LightFrame],
    surface_error: float,
    in_shadow: NDArray[np.bool_],
    clock: Clock | None,
) -> tuple[Leaves, list[SampleTree | None]]:
    """Cluster the samples and build one tree per frame (None where a frame has no samples).

    Samples that their own triangle shades are set in `in_shadow` (flat) and left out. `surface_error` is said in
    `light_frame.surface_error`.
    """
    height, width, order = _layout(samples)
    tiles = len(order) // LANES if len(order) else (-(-height // 4)) * (-(-width // 4))
    room = len(frames) + SPARE
    leaves = Leaves(
        x=np.empty((tiles * room, LANES), np.float32),
        y=np.empty((tiles * room, LANES), np.float32),
        q=np.empty((tiles * room, LANES), np.float32),
        own=np.empty((tiles * room, LANES), np.int32),
        sample=np.empty((tiles * room, LANES), np.int32),
        slack=np.empty((tiles * room, 2), np.float32),
        box=np.empty((tiles * room, 6), np.float32),
        key=np.empty(tiles * room, np.int64),
    )
    table = np.array([frame.row() for frame in frames])
    raw = (
        samples.triangle.reshape(-1),
        samples.side.reshape(-1),
        samples.position.reshape(-1, 3),
        samples.covered.reshape(-1),
    )

    def task(number: int) -> NDArray[np.int64]:
        start, stop = number * _TILES_PER_TASK, min((number + 1) * _TILES_PER_TASK, tiles)
        used = cluster_tiles(
            *raw, facing, light, table, surface_error, height, width, order, start, stop, *leaves, in_shadow
        )
        return np.arange(start * room, start * room + used)

    used = np.concatenate(run(task, -(-tiles // _TILES_PER_TASK), clock))
    keys = leaves.key[used]
    ranked = np.argsort(keys, kind="stable")
    slots, keys = used[ranked].astype(np.int32), keys[ranked]
    ends = np.searchsorted(keys, np.arange(len(frames) + 1) << 40)
    return leaves, [
        _tree(leaves.box, slots[ends[k] : ends[k + 1]]) if ends[k] < ends[k + 1] else None for k in range(len(frames))
    ]


def _layout(samples: ViewSamples) -> tuple[int, int, NDArray[np.int32]]:
    """Rows and columns of an image, or a list's order (padded with -1 to whole clusters) along a curve in space."""
    if len(samples.shape) >= 2 and samples.camera is not None:
        return samples.shape[0], samples.size // max(1, samples.shape[0]), np.zeros(0, np.int32)
    order = np.argsort(morton3(samples.position.reshape(-1, 3).astype(np.float64)), kind="stable")
    padded = np.full(-(-samples.size // LANES) * LANES, -1, np.int32)
    padded[: samples.size] = order
    return 1, samples.size, padded


def _tree(boxes: NDArray[np.float32], slots: NDArray[np.int32]) -> SampleTree:
    sizes = [len(slots)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // ARITY))
    level = np.zeros(len(sizes) + 1, np.int64)
    level[1:] = np.cumsum([-(-size // ARITY) * ARITY for size in sizes])
    box = np.empty((6, level[-1]), np.float32)
    box[:3:2] = np.inf
    box[QMIN] = np.inf
    box[1:4:2] = -np.inf
    box[QMAX] = -np.inf
    pull_up(boxes, slots, level, box)
    return SampleTree(box, level, slots, np.zeros(level[-1], np.uint8))


@kernel
def pull_up(leaf_box, slots, level, box):
    """Fill the boxes of all levels from the leaves' own."""
    for i in range(len(slots)):
        for part in range(6):
            box[part, i] = leaf_box[slots[i], part]
    for depth in range(1, len(level) - 1):
        below, here = level[depth - 1], level[depth]
        for child in range(level[depth] - below):
            node = here + child // ARITY
            for part in range(0, 6, 2):
                box[part, node] = min(box[part, node], box[part, below + child])
                box[part + 1, node] = max(box[part + 1, node], box[part + 1, below + child])
