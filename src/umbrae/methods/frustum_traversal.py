"""Frusta against the view-sample hierarchy (Sintorn et al. 2011, Algorithms 1 and 2), a batch of clusters at a time.

The paper sends each frustum down the tree by itself, one warp per frustum. Here the frusta of 16 neighbouring triangles
make a cluster, and a batch of clusters goes together, depth first. What is tested changes on the way: a cluster's
common bounds against the 16 children of a node at once, then the bounds of its 16 frusta against one box at once, and
their planes where a frustum is wider than the box. At a leaf, one frustum meets 16 samples at once. A node that is
found full ends its whole list.

Threads share the tree: they only ever store "in shadow", so no atomics are needed, and a node that one thread has
filled is skipped by all (the paper's section 3.5, "maintaining an updated shadow buffer").

Rejection of a box by a frustum's bounds in x and y is what the silhouette planes towards the eye are in the paper:
it removes the false positives that four planes alone let through.
"""

import numpy as np

from umbrae.methods.frustum_leaves import ACCEPTS, REJECTS, TILE_TESTS, darken_leaf
from umbrae.methods.frustum_setup import (
    BOUND_PLANE,
    BOUND_Q,
    BOUND_SIDES,
    PLANES,
    RECT_QMAX,
    RECT_XMAX,
    RECT_XMIN,
    RECT_YMAX,
    RECT_YMIN,
    RECTS,
    bound_frusta,
    put_planes,
)
from umbrae.methods.frustum_transmission import accept_node, dim_leaf
from umbrae.methods.lanes import ALL, LANES, choose, count, equal, largest, load, lowest, prefetch, smallest, splat
from umbrae.methods.sample_clusters import DARK, OWN, QMAX, QMIN, SAMPLE, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import expand, inline, kernel

CLUSTERS = 256
"""Clusters of 16 triangles per task, at most."""

MAX_DEPTH = 12

# Columns of `outer`, after the bounds of a whole cluster: its widest and its highest frustum.
WIDTH, HEIGHT = 5, 6


@expand
def _meeting(rects, cluster, xmin, xmax, ymin, ymax, qmin):
    """Mask of the frusta whose bounds meet a box."""
    return (
        (load(rects, cluster, RECT_XMIN * LANES) <= xmax)
        & (load(rects, cluster, RECT_XMAX * LANES) >= xmin)
        & (load(rects, cluster, RECT_YMIN * LANES) <= ymax)
        & (load(rects, cluster, RECT_YMAX * LANES) >= ymin)
        & (load(rects, cluster, RECT_QMAX * LANES) >= qmin)
    )


@expand
def _against_box(rows, cluster, xmin, xmax, ymin, ymax, qmin, qmax):
    """Masks of the frusta that reject a box and of those that hold it: its corners against the four planes."""
    half, two, zero = np.float32(0.5), np.float32(2.0), splat(np.float32(0.0))
    cx, hx = splat(half * (xmin + xmax)), splat(half * (xmax - xmin))
    cy, hy = splat(half * (ymin + ymax)), splat(half * (ymax - ymin))
    # Twice the bound: centre and half-width of the box are themselves rounded.
    limit = load(rows, cluster, BOUND_SIDES * LANES) * two
    reject, accept = np.int32(0), np.int32(ALL)
    for edge in range(3):
        a, b = load(rows, cluster, 3 * edge * LANES), load(rows, cluster, (3 * edge + 1) * LANES)
        middle = a * cx + b * cy + load(rows, cluster, (3 * edge + 2) * LANES)
        reach = abs(a) * hx + abs(b) * hy
        reject |= middle + reach < zero - limit
        accept &= middle - reach > limit
    a, b, d = load(rows, cluster, 9 * LANES), load(rows, cluster, 10 * LANES), load(rows, cluster, 12 * LANES)
    reach_q = max(abs(qmin), abs(qmax))
    limit = (load(rows, cluster, BOUND_PLANE * LANES) + load(rows, cluster, BOUND_Q * LANES) * reach_q) * two
    middle = a * cx + b * cy + load(rows, cluster, 11 * LANES) + d * (half * (qmin + qmax))
    reach = abs(a) * hx + abs(b) * hy + abs(d) * (half * (qmax - qmin))
    reject |= middle + reach < zero - limit
    accept &= middle - reach > limit
    return reject, accept


@inline
def _common_bounds(rects, cluster, mask, outer):
    """Bounds of a cluster's frusta, and the width and height of its widest and highest."""
    x0, x1 = load(rects, cluster, RECT_XMIN * LANES), load(rects, cluster, RECT_XMAX * LANES)
    y0, y1 = load(rects, cluster, RECT_YMIN * LANES), load(rects, cluster, RECT_YMAX * LANES)
    low, high = splat(np.float32(-np.inf)), splat(np.float32(np.inf))
    outer[cluster, XMIN], outer[cluster, XMAX] = smallest(choose(mask, x0, high)), largest(choose(mask, x1, low))
    outer[cluster, YMIN], outer[cluster, YMAX] = smallest(choose(mask, y0, high)), largest(choose(mask, y1, low))
    outer[cluster, 4] = largest(choose(mask, load(rects, cluster, RECT_QMAX * LANES), low))
    outer[cluster, WIDTH] = largest(choose(mask, x1 - x0, low))
    outer[cluster, HEIGHT] = largest(choose(mask, y1 - y0, low))


@inline
def _beside(boxes, cluster, light, frame, xmin, xmax, ymin, ymax):
    """Whether a cluster's box surely lies behind a point light's frame, or beside the pyramid of the root's box."""
    if xmin == -np.inf:
        return False  # around samples of unsure direction
    a, b, c = frame.axis_a, frame.axis_b, frame.axis_c
    low, high = boxes[cluster, 0, c] - light[c], boxes[cluster, 1, c] - light[c]
    near, far = max(0.0, low if frame.sign > 0.0 else -high), high if frame.sign > 0.0 else -low
    if far <= 0.0:
        return True
    # Linear in depth: what holds at both ends holds between. The margin covers these few roundings many times over.
    for axis, start, half, least, most in ((a, frame.x0, frame.hx, xmin, xmax), (b, frame.y0, frame.hy, ymin, ymax)):
        low, high = boxes[cluster, 0, axis] - light[axis], boxes[cluster, 1, axis] - light[axis]
        least, most = start + half * least, start + half * most
        margin = 1e-9 * (abs(low) + abs(high) + (abs(start) + half) * far)
        if low - most * near > margin and low - most * far > margin:
            return True
        if high - least * near < -margin and high - least * far < -margin:
            return True
    return False


@expand
def append_to(children, k, mask, child_list, child_mask, child_count):
    """Append a cluster, and the mask of what is wanted of it, to the lists of some children of a node."""
    while children:
        child = lowest(children)
        children &= children - np.int32(1)
        place = child_count[child]
        child_list[child, place], child_mask[child, place] = k, mask
        child_count[child] = place + 1


@inline
def _hand_down(listed, masked, entries, outer, box, full, group, child_list, child_mask, child_count):
    """Give each child of a node those clusters whose bounds meet its box; returns the mask of children with any."""
    child_count[:] = 0
    open_children = equal(full, group, 0, np.uint8(0))
    xmin, xmax = load(box, group, XMIN * LANES), load(box, group, XMAX * LANES)
    ymin, ymax = load(box, group, YMIN * LANES), load(box, group, YMAX * LANES)
    qmin = load(box, group, QMIN * LANES)
    visited = np.int32(0)
    for entry in range(entries):
        k = listed[entry]
        hit = (
            open_children
            & (xmin <= outer[k, XMAX])
            & (xmax >= outer[k, XMIN])
            & (ymin <= outer[k, YMAX])
            & (ymax >= outer[k, YMIN])
            & (qmin <= outer[k, 4])
        )
        visited |= hit
        append_to(hit, k, masked[entry], child_list, child_mask, child_count)
    return visited


@inline
def _bring_near(visited, number, slots, leaf_place, leaf_ids, leaf_box):
    """Prefetch the leaves that come next: they lie anywhere in memory."""
    while visited:
        slot = np.int64(slots[number * LANES + lowest(visited)])
        visited &= visited - np.int32(1)
        prefetch(leaf_box, slot, 0)
        for part in range(2):
            prefetch(leaf_ids, slot, part * LANES)
        for part in range(3):
            prefetch(leaf_place, slot, part * LANES)


@kernel
def traverse_batch(corners, boxes, order, facing_of, frame, start, stop, tree, receivers, stats, dimming):
    """Rasterize the frusta of clusters `start` to `stop` over one sample tree; where `facing_of` is 0, none is cast.

    `dimming` is None for solid triangles, for others what `frustum_transmission` needs: what is accepted then dims
    the samples below instead of ending the search.
    """
    box, full, level, slots = tree
    light, place, ids, leaf_box = receivers.light, receivers.place, receivers.ids, receivers.box
    top = len(level) - 1
    if full[top_group(level), 0]:
        return
    rects = np.empty((CLUSTERS, RECTS), np.float32)
    rows = np.empty((CLUSTERS, PLANES), np.float32)
    outer = np.empty((CLUSTERS, 8), np.float32)
    ready, number_of = np.empty(CLUSTERS, np.bool_), np.empty(CLUSTERS, np.int64)
    lists = np.empty((MAX_DEPTH, LANES, CLUSTERS), np.int32)
    masks = np.empty((MAX_DEPTH, LANES, CLUSTERS), np.int32)
    counts = np.empty((MAX_DEPTH, LANES), np.int32)
    groups, numbers = np.empty(MAX_DEPTH, np.int64), np.empty(MAX_DEPTH, np.int64)
    visited, children = np.empty(MAX_DEPTH, np.int32), np.empty(MAX_DEPTH, np.int64)
    point = np.empty(3)

    depth = 0
    group = top_group(level)
    xmin, xmax, ymin, ymax = box[group, 0], box[group, XMAX * LANES], box[group, YMIN * LANES], box[group, YMAX * LANES]
    qmin = box[group, QMIN * LANES]
    clusters = 0
    for cluster in range(start, stop):
        if light[3] != 0.0 and _beside(boxes, cluster, light, frame, xmin, xmax, ymin, ymax):
            continue
        bound_frusta(corners, cluster, light, frame, rects, clusters)
        mask = _meeting(rects, clusters, xmin, xmax, ymin, ymax, qmin)
        mask &= ~equal(facing_of, cluster, 0, np.int8(0))
        if mask == 0:
            continue
        _common_bounds(rects, clusters, mask, outer)
        lists[0, 0, clusters], masks[0, 0, clusters] = clusters, mask
        ready[clusters] = False
        number_of[clusters] = cluster
        clusters += 1
    if clusters == 0:
        return
    # The root is the only child of a group above it.
    counts[0, 0], groups[0], numbers[0], visited[0] = clusters, group, 0, 1
    while depth >= 0:
        group = groups[depth]
        if visited[depth] == 0:
            if depth > 0 and equal(full, group, 0, np.uint8(0)) == 0:
                full[groups[depth - 1], children[depth - 1]] = 1
            depth -= 1
            continue
        child = np.int64(lowest(visited[depth]))
        visited[depth] &= visited[depth] - np.int32(1)
        if full[group, child]:
            continue
        below = top - depth  # level of this group
        number = numbers[depth] * LANES + child
        xmin, xmax = box[group, XMIN * LANES + child], box[group, XMAX * LANES + child]
        ymin, ymax = box[group, YMIN * LANES + child], box[group, YMAX * LANES + child]
        qmin, qmax = box[group, QMIN * LANES + child], box[group, QMAX * LANES + child]
        width, height = xmax - xmin, ymax - ymin
        listed, masked = lists[depth, child], masks[depth, child]
        kept = 0
        accepted = False
        stats[TILE_TESTS] += counts[depth, child]
        for entry in range(counts[depth, child]):
            k = listed[entry]
            mask = masked[entry]
            # The frusta's own bounds, and planes, say more than the cluster's only where they are wider than the box.
            wide = outer[k, WIDTH] > width or outer[k, HEIGHT] > height
            mask &= _meeting(rects, k, xmin, xmax, ymin, ymax, qmin)
            if mask == 0:
                continue
            if wide or below == 0:
                if not ready[k]:
                    put_planes(corners, number_of[k], facing_of, light, frame, rows, k)
                    ready[k] = True
                if wide:
                    reject, accept = _against_box(rows, k, xmin, xmax, ymin, ymax, qmin, qmax)
                    stats[REJECTS] += count(mask & reject)
                    accept &= mask & ~reject
                    if dimming is None:
                        if accept:
                            accepted = True
                            break
                    elif accept:
                        stats[ACCEPTS] += count(accept)
                        mask &= ~accept_node(
                            group, child, number, below, order, number_of[k], accept, len(slots), dimming, stats
                        )
                    mask &= ~reject
                    if mask == 0:
                        continue
            listed[kept], masked[kept] = k, mask
            kept += 1
        if accepted:
            stats[ACCEPTS] += 1
            full[group, child] = 1
            continue
        if kept == 0:
            continue
        if below > 0:
            children[depth] = child
            depth += 1
            groups[depth], numbers[depth] = level[below - 1] + number, number
            visited[depth] = _hand_down(
                listed, masked, kept, outer, box, full, groups[depth], lists[depth], masks[depth], counts[depth]
            )
            if below == 1:
                _bring_near(visited[depth], number, slots, place, ids, leaf_box)
            continue
        # A leaf: its samples against what is left of the list.
        slot = np.int64(slots[number])
        if dimming is None:
            dark = darken_leaf(slot, listed, masked, kept, number_of, order, rows, receivers, point, stats)
        else:
            dark = dim_leaf(
                group, child, number, slot, listed, masked, kept, number_of, order, rows, receivers, dimming, point,
                stats,
            )  # fmt: skip
        if dark == ALL:
            full[group, child] = 1


@inline
def top_group(level):
    """The group above the root."""
    return level[len(level) - 1]


@kernel
def merge(level, full):
    """Hand every full node's verdict down to the leaves (the paper's merge, section 3.1)."""
    for depth in range(len(level) - 1, 0, -1):
        last = level[depth] if depth == len(level) - 1 else level[depth + 1] - 1
        for group in range(level[depth], last + 1):
            for child in range(LANES):
                below = level[depth - 1] + (group - level[depth]) * LANES + child
                if full[group, child] and below < level[depth]:
                    full[below] = 1


@kernel
def write_out(start, stop, slots, full, leaf_ids, in_shadow):
    """Write the verdicts of leaves `start` to `stop`."""
    for number in range(start, stop):
        slot = slots[number]
        whole = full[number // LANES, number % LANES]
        for lane in range(LANES):
            index = leaf_ids[slot, SAMPLE + lane]
            if index >= 0 and (whole or leaf_ids[slot, OWN + lane] == DARK):
                in_shadow[index] = True
