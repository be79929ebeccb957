"""The view-sample hierarchy: clusters of up to 16 samples in light-frame coordinates, and boxes over them.

Sintorn et al. 2011 (section 3.1) build theirs over the camera's depth buffer. This one lives in a light frame (see
`light_frame`) and its leaves are sorted along a space-filling curve there, because that is where frusta are thin: a
triangle meets the few nodes around it instead of a long row of tiles across the screen. It also serves points that
have no camera. Samples whose seen side faces away from the light, and background, are left out (section 3.5).
"""

from itertools import count
from threading import get_ident
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.memory import keep_spare, take_spare
from umbrae.methods.counting_sort import sort_by_key
from umbrae.methods.lanes import LANES, largest, load, smallest
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_clusters import SPARE, cluster_tiles
from umbrae.parallel import kernel, run, thread_count
from umbrae.samples import ViewSamples

_TILES_PER_TASK = 1024

_GROUPS_PER_TASK = 512

_REGION = 4096
"""Slots that a thread takes at a time."""

GAP = 4.0
"""Tiles narrower than this many times the triangles' mean spacing, were they spread over the window, are not cut."""


class Leaves(NamedTuple):
    """Sample clusters, one row per slot.

    `place` `(n, 3 LANES)` x, y, q of the lanes in window units; `ids` `(n, 2 LANES)` own triangle, -1 for a free
    point, `DARK` when decided, and the sample's flat index, -1 for padding; `box` `(n, 8)` bounds of the lanes
    including slack, then the slack itself: how far x or y, and q, may be off; `key` frame number and position on the
    curve.
    """

    place: NDArray[np.float32]
    ids: NDArray[np.int32]
    box: NDArray[np.float32]
    key: NDArray[np.int64]

    def bytes_of(self, used: int) -> int:
        """Bytes of `used` leaves."""
        each: int = sum(part[0].nbytes for part in self)
        return used * each

    def release(self, used: int) -> None:
        """Keep the memory, in which `used` leaves have been stored, for the next call."""
        keep_spare("leaves", self, self.bytes_of(used))


class SampleTree(NamedTuple):
    """Boxes over the leaves of one light frame, 16 children to a node.

    A group is the children of one node. `box` `(groups, 6 LANES)` their xmin, xmax, ymin, ymax, qmin, qmax, for all 16
    each, empty where there is none; `full` `(groups, LANES)` set when everything below lies in shadow, or nothing is:
    the hierarchical shadow buffer; `level` `(levels,)` where the groups of each level start, those of the leaves first,
    the last being the root alone; `slot` `(leaves,)` the row in `Leaves` of each leaf. Node n of a level has its flag
    and box in group n // 16 of that level, and its children in group n of the level below.
    """

    box: NDArray[np.float32]
    full: NDArray[np.uint8]
    level: NDArray[np.int64]
    slot: NDArray[np.int32]


def build(
    samples: ViewSamples,
    covered: NDArray[np.bool_],
    facing: NDArray[np.int8],
    light: NDArray[np.float64],
    frames: list[LightFrame],
    limits: tuple[float, float],
    in_shadow: NDArray[np.bool_],
    clock: Clock | None,
) -> tuple[Leaves, list[SampleTree | None]]:
    """Cluster the `covered` samples `(n,)` and build one tree per frame (None where a frame has no samples).

    Samples that their own triangle shades are set in `in_shadow` (flat) and left out. `facing` `(t,)` is the side of
    each triangle that the light is on, 0 for one that does not shade its own samples; `limits` are `error` and
    `rounding` of `cluster_tiles`.
    """
    height, width, order = _layout(samples)
    tiles = len(order) // LANES if len(order) else (-(-height // 4)) * (-(-width // 4))
    room = len(frames) + SPARE
    # A region is left with up to `room` slots unused, and each thread's last one with any number.
    tasks = -(-tiles // _TILES_PER_TASK)
    leaves = _reserve((-(-tiles * room // (_REGION - room)) + min(thread_count(), tasks)) * _REGION)
    table = np.array([frame.row() for frame in frames])
    gap = np.float32(GAP / np.sqrt(len(facing)))
    raw = (
        samples.triangle.reshape(-1),
        samples.side.reshape(-1),
        samples.position.reshape(-1, 3),
        covered,
    )
    regions = count(0, _REGION)
    own: dict[int, tuple[int, int]] = {}

    def task(number: int) -> list[NDArray[np.int32]]:
        tile, stop = number * _TILES_PER_TASK, min((number + 1) * _TILES_PER_TASK, tiles)
        used = []
        slot, last = own.get(get_ident(), (0, 0))
        while tile < stop:
            first = slot
            slot, tile = cluster_tiles(
                *raw, facing, light, table, *limits, gap, height, width, order, tile, stop, slot, last, *leaves,
                in_shadow,
            )  # fmt: skip
            used.append(np.arange(first, slot, dtype=np.int32))
            if tile < stop:
                slot = next(regions)
                last = slot + _REGION
        own[get_ident()] = slot, last
        return used

    used = np.concatenate([part for parts in run(task, tasks, clock) for part in parts])
    bits = max(2, (len(used) // len(frames)).bit_length() // 2 * 2)
    sorted_slots, ends = np.empty(len(used), np.int32), np.zeros((len(frames) << bits) + 1, np.int32)
    sort_by_key(used, leaves.key, 32 - bits, sorted_slots, ends)
    of_frames = np.split(sorted_slots, ends[1 << bits : -1 : 1 << bits])
    return leaves, [_tree(leaves.box, slots) if len(slots) else None for slots in of_frames]


def hierarchy_bytes(leaves: Leaves, trees: list[SampleTree]) -> int:
    """Bytes of the trees' leaves and of the boxes above them; what is reserved beyond does not count."""
    return sum(leaves.bytes_of(len(tree.slot)) + tree.slot.nbytes + tree.box.nbytes for tree in trees)


def bounds_with(bounds: NDArray[np.float64], samples: ViewSamples) -> NDArray[np.float64]:
    """The scene's bounds `(2, 3)`, widened to the samples where some are free points."""
    if samples.depth is not None or (samples.triangle >= 0).all():
        return bounds
    points = samples.position[samples.covered]
    if len(points) == 0:
        return bounds
    return np.stack([np.minimum(bounds[0], points.min(axis=0)), np.maximum(bounds[1], points.max(axis=0))])


def _reserve(slots: int) -> Leaves:
    """Address space for the worst case: slots are handed out from the front, so only what is used takes memory."""
    leaves: Leaves | None = take_spare("leaves")
    if leaves is not None and len(leaves.key) >= slots:
        return leaves
    return Leaves(
        place=np.empty((slots, 3 * LANES), np.float32),
        ids=np.empty((slots, 2 * LANES), np.int32),
        box=np.empty((slots, 8), np.float32),
        key=np.empty(slots, np.int64),
    )


def _layout(samples: ViewSamples) -> tuple[int, int, NDArray[np.int32]]:
    """Rows and columns of an image, or a list's order (padded with -1 to whole clusters) along a curve in space."""
    if len(samples.shape) >= 2 and samples.camera is not None:
        return samples.shape[0], samples.size // max(1, samples.shape[0]), np.zeros(0, np.int32)
    padded = np.full(-(-samples.size // LANES) * LANES, -1, np.int32)
    padded[: samples.size] = samples.along_curve
    return 1, samples.size, padded


def _tree(boxes: NDArray[np.float32], slots: NDArray[np.int32]) -> SampleTree:
    """The boxes above the leaves in `slots`, whose own are rows of `boxes`."""
    sizes = [-(-len(slots) // LANES)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // LANES))
    level = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    box = np.empty((level[-1] + 1, 6 * LANES), np.float32)
    full = np.empty((level[-1] + 1, LANES), np.uint8)

    def task(number: int) -> None:
        pull_up(
            boxes, slots, level, 0, number * _GROUPS_PER_TASK, min((number + 1) * _GROUPS_PER_TASK, sizes[0]), box, full
        )

    run(task, -(-sizes[0] // _GROUPS_PER_TASK))
    for depth, size in enumerate([*sizes[1:], 1], 1):
        pull_up(boxes, slots, level, depth, 0, size, box, full)
    return SampleTree(box, full, level, slots)


@kernel
def pull_up(leaf_box, slots, level, depth, start, stop, box, full):
    """Fill the boxes of groups `start` to `stop` of a level from what is below: the leaves' own, or another level's."""
    below = len(slots) if depth == 0 else level[depth] - level[depth - 1]
    for group in range(level[depth] + start, level[depth] + stop):
        for child in range(LANES):
            number = (group - level[depth]) * LANES + child
            full[group, child] = number >= below
            for part in range(0, 6, 2):
                least, most = np.float32(np.inf), np.float32(-np.inf)
                if number < below and depth == 0:
                    least, most = leaf_box[slots[number], part], leaf_box[slots[number], part + 1]
                elif number < below:
                    node = level[depth - 1] + number
                    least, most = smallest(load(box, node, part * LANES)), largest(load(box, node, (part + 1) * LANES))
                box[group, part * LANES + child] = least
                box[group, (part + 1) * LANES + child] = most
