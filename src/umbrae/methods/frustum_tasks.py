"""The frustum method's work in tasks for all threads: clusters down trees, queued nodes, ranges of samples."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.methods.frustum_leaves import COUNTERS, Receivers
from umbrae.methods.frustum_transmission import Dimming, cover_queued
from umbrae.methods.frustum_traversal import CLUSTERS, traverse_batch
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_tree import SampleTree
from umbrae.methods.triangle_clusters import TriangleClusters
from umbrae.parallel import run, thread_count

QUEUE = 4096
"""Nodes that a task may leave for later (see `frustum_transmission`); more are refined."""

_QUEUED_LEAVES = 256
"""Leaves that a queued node is split into, at most, for one thread."""


def traverse(
    clusters: TriangleClusters,
    facing: NDArray[np.int8],
    active: list[tuple[LightFrame, SampleTree]],
    chosen: list[NDArray[np.intp]],
    receivers: Receivers,
    dimming: list[Dimming] | None,
    clock: Clock,
) -> NDArray[np.int64]:
    """Send the clusters `chosen` for each tree down it, all threads.

    `dimming`, one for each tree, for triangles that let light through.
    """
    batches = []
    for place, numbers in enumerate(chosen):
        step = min(CLUSTERS, -(-len(numbers) // (8 * thread_count()))) or 1
        batches += [(place, start, min(start + step, len(numbers))) for start in range(0, len(numbers), step)]

    def task(number: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        place, start, stop = batches[number]
        frame, tree = active[place]
        stats = np.zeros(len(COUNTERS), np.int64)
        queue, queued = empty_queue(0 if dimming is None else QUEUE)
        mine = None if dimming is None else dimming[place]._replace(queue=queue, queued=queued)
        what = clusters.corners, clusters.order, facing, frame, chosen[place], start, stop
        traverse_batch(*what, tree, receivers, stats, mine)
        return stats, queue[: queued[0]].copy()

    done = run(task, len(batches), clock)
    zero = np.zeros(len(COUNTERS), np.int64)
    total: NDArray[np.int64] = np.sum([zero, *(stats for stats, _ in done)], axis=0, dtype=np.int64)
    if dimming is not None:
        for place, (_, tree) in enumerate(active):
            queues = [queue for (of, _, _), (_, queue) in zip(batches, done, strict=True) if of == place]
            if queues:
                total += _cover_queued(np.concatenate(queues), tree, receivers, dimming[place], clock)
    return total


def empty_queue(room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """An empty queue of accepted nodes, and how many there are."""
    return np.empty((room, 3), np.int64), np.zeros(1, np.int64)


def _cover_queued(
    queue: NDArray[np.int64], tree: SampleTree, receivers: Receivers, dimming: Dimming, clock: Clock
) -> NDArray[np.int64]:
    """Look up textures below accepted nodes that were left for later, range of leaves by range."""
    parts = -(-(queue[:, 2] - queue[:, 1]) // _QUEUED_LEAVES)
    split = np.repeat(queue, parts, axis=0)
    split[:, 1] += (np.arange(len(split)) - np.repeat(np.cumsum(parts) - parts, parts)) * _QUEUED_LEAVES
    split[:, 2] = np.minimum(split[:, 2], split[:, 1] + _QUEUED_LEAVES)
    # By place: each thread stays in one part of the picture.
    split = split[np.argsort(split[:, 1], kind="stable")]
    step = -(-len(split) // (16 * thread_count())) or 1

    def task(number: int) -> NDArray[np.int64]:
        stats = np.zeros(len(COUNTERS), np.int64)
        start, stop = number * step, min((number + 1) * step, len(split))
        cover_queued(split, start, stop, tree, receivers, dimming, stats)
        return stats

    zero = np.zeros(len(COUNTERS), np.int64)
    total: NDArray[np.int64] = np.sum([zero, *run(task, -(-len(split) // step), clock)], axis=0, dtype=np.int64)
    return total


def in_parts(count: int, size: int, clock: Clock, kernel: Callable[..., None], *what: Any) -> None:
    """Call `kernel(start, stop, *what)` for `count` things, `size` at a time, from all threads."""
    run(lambda part: kernel(part * size, min((part + 1) * size, count), *what), -(-count // size), clock)
