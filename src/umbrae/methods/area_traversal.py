"""Regions of influence against the view-sample hierarchy, one part of it at a time.

Sintorn et al. 2011 (section 5) would have soft shadows from frusta that are expanded to a triangle's region of
influence, and a shadow buffer of one bit per light sample. This is that, with the hierarchy, clusters and batches of
`frustum_traversal`, but turned around: there, a task is a batch of triangles, and threads share the samples. Here a
task is one node of the sample tree, 256 leaves, and finds its triangles in a tree of clusters. Bits are then written by
one thread alone, and what is known of a view sample and its light samples is worked out once for many triangles.

A node of samples is left when it is dark. It is set dark as a whole by a triangle that hides all of the light from all
of it; so is a single sample. All other pairs of sample and triangle are settled by `area_pairs`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.methods.area_pairs import darken, darkened, new_leaf, own_dark
from umbrae.methods.area_setup import (
    REGIONS,
    SLOPE_X,
    SLOPE_Y,
    STRADDLES,
    bound_regions,
    common_bounds,
    meeting,
)
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
    put_planes,
)
from umbrae.methods.lanes import ALL, LANES, choose, count, equal, largest, load, lowest, smallest, splat
from umbrae.methods.sample_clusters import (
    DARK,
    OWN,
    QMAX,
    QMIN,
    SAMPLE,
    SLACK_Q,
    SLACK_X,
    XMAX,
    XMIN,
    YMAX,
    YMIN,
    Q,
    X,
    Y,
)
from umbrae.parallel import expand, inline, kernel

BATCH = 256
"""Clusters that go down together."""

_DEEPEST = 12 * LANES

COUNTERS = (
    "pair_tests",
    "fallbacks",
    "predicate_fallbacks",
    "tile_frustum_tests",
    "sample_frustum_tests",
    "accepts",
    "rejects",
)
"""The first three are those of `area_pairs`."""
(TILE_TESTS, SAMPLE_TESTS, ACCEPTS, REJECTS) = range(3, 7)


class Batch(NamedTuple):
    """Clusters on their way down.

    `regions`, `planes` row by row as in `area_setup` and `frustum_setup`; `outer (n, 7)` the bounds of each as a
    whole; `bounded (n,)` masks of the triangles whose side planes mean something: they have bounds, and all of the
    light is on one side of them; `ready (n,)` whether `planes` have been made; `number (n,)` the clusters' numbers.
    """

    regions: NDArray[np.float32]
    planes: NDArray[np.float32]
    outer: NDArray[np.float32]
    bounded: NDArray[np.int32]
    ready: NDArray[np.bool_]
    number: NDArray[np.int64]


class Lists(NamedTuple):
    """Which clusters of a batch meet each child of a node: `entry`, `mask (16, n)`, `length (16,)`."""

    entry: NDArray[np.int32]
    mask: NDArray[np.int32]
    length: NDArray[np.int32]


@inline
def _new_lists():
    return Lists(np.empty((LANES, BATCH), np.int32), np.empty((LANES, BATCH), np.int32), np.empty(LANES, np.int32))


@expand
def _against_box(batch, k, xmin, xmax, ymin, ymax, qmin, qmax):
    """Masks of the triangles that surely shade nothing in a box, and of those that hide all of the light from it.

    As in `frustum_traversal`, with edges moved by (|a| slope_x + |b| slope_y) (q_V - q_P): out for the first, in for
    the second (see `area_setup`).
    """
    half, two, zero = np.float32(0.5), np.float32(2.0), splat(np.float32(0.0))
    cx, hx = splat(half * (xmin + xmax)), splat(half * (xmax - xmin))
    cy, hy = splat(half * (ymin + ymax)), splat(half * (ymax - ymin))
    limit = load(batch.planes, k, BOUND_SIDES * LANES) * two
    ahead = load(batch.regions, k, RECT_QMAX * LANES) - qmin
    ahead = choose(ahead >= np.float32(0.0), ahead, zero)
    slope_x, slope_y = load(batch.regions, k, SLOPE_X * LANES), load(batch.regions, k, SLOPE_Y * LANES)
    reject, accept = np.int32(0), np.int32(ALL)
    for edge in range(3):
        a, b = load(batch.planes, k, 3 * edge * LANES), load(batch.planes, k, (3 * edge + 1) * LANES)
        middle = a * cx + b * cy + load(batch.planes, k, (3 * edge + 2) * LANES)
        reach = abs(a) * hx + abs(b) * hy + (abs(a) * slope_x + abs(b) * slope_y) * ahead
        reject |= middle + reach < zero - limit
        accept &= middle - reach > limit
    a, b, d = load(batch.planes, k, 9 * LANES), load(batch.planes, k, 10 * LANES), load(batch.planes, k, 12 * LANES)
    reach_q = max(abs(qmin), abs(qmax))
    limit = (load(batch.planes, k, BOUND_PLANE * LANES) + load(batch.planes, k, BOUND_Q * LANES) * reach_q) * two
    middle = a * cx + b * cy + load(batch.planes, k, 11 * LANES) + d * (half * (qmin + qmax))
    reach = abs(a) * hx + abs(b) * hy + abs(d) * (half * (qmax - qmin))
    reject |= middle + reach < zero - limit
    accept &= middle - reach > limit
    return reject & batch.bounded[k], accept & ~reject & batch.bounded[k]


@inline
def _hand_down(listed, masked, entries, outer, box, full, group, below):
    """Give each child of a node those clusters whose regions meet its box; returns the mask of children with any."""
    below.length[:] = 0
    zero = splat(np.float32(0.0))
    open_children = equal(full, group, 0, np.uint8(0))
    xmin, xmax = load(box, group, XMIN * LANES), load(box, group, XMAX * LANES)
    ymin, ymax = load(box, group, YMIN * LANES), load(box, group, YMAX * LANES)
    qmin = load(box, group, QMIN * LANES)
    visited = np.int32(0)
    for entry in range(entries):
        k = listed[entry]
        ahead = splat(outer[k, RECT_QMAX]) - qmin
        ahead = choose(ahead >= np.float32(0.0), ahead, zero)
        wide_x, wide_y = ahead * outer[k, SLOPE_X], ahead * outer[k, SLOPE_Y]
        # A slope of zero has no bounds: infinity times zero must not spoil them.
        wide_x = choose(wide_x >= np.float32(0.0), wide_x, zero)
        wide_y = choose(wide_y >= np.float32(0.0), wide_y, zero)
        hit = (
            open_children
            & (xmin - wide_x <= outer[k, RECT_XMAX])
            & (xmax + wide_x >= outer[k, RECT_XMIN])
            & (ymin - wide_y <= outer[k, RECT_YMAX])
            & (ymax + wide_y >= outer[k, RECT_YMIN])
            & (qmin <= outer[k, RECT_QMAX])
        )
        visited |= hit
        while hit:
            child = lowest(hit)
            hit &= hit - np.int32(1)
            place = below.length[child]
            below.entry[child, place], below.mask[child, place] = k, masked[entry]
            below.length[child] = place + 1
    return visited


@inline
def _keep(lists, child, batch, corners, sides, source, frame, box, group, stats):
    """Keep those of a child's list that may shade something in its box; -1 where one hides all of the light from it."""
    xmin, xmax = box[group, XMIN * LANES + child], box[group, XMAX * LANES + child]
    ymin, ymax = box[group, YMIN * LANES + child], box[group, YMAX * LANES + child]
    qmin, qmax = box[group, QMIN * LANES + child], box[group, QMAX * LANES + child]
    kept = 0
    stats[TILE_TESTS] += lists.length[child]
    for entry in range(lists.length[child]):
        k = np.int64(lists.entry[child, entry])
        mask = lists.mask[child, entry] & meeting(batch.regions, k, xmin, xmax, ymin, ymax, qmin)
        if mask == 0:
            continue
        if mask & batch.bounded[k]:
            if not batch.ready[k]:
                put_planes(corners, batch.number[k], sides, source, frame, batch.planes, k)
                batch.ready[k] = True
            reject, accept = _against_box(batch, k, xmin, xmax, ymin, ymax, qmin, qmax)
            stats[REJECTS] += count(mask & reject)
            if mask & accept:
                stats[ACCEPTS] += 1
                return -1
            mask &= ~reject
            if mask == 0:
                continue
        lists.entry[child, kept], lists.mask[child, kept] = k, mask
        kept += 1
    return kept


@inline
def _touched(batch, k, lane, place, slot, slack_x, slack_q, reach_q):
    """Masks of a leaf's samples that a triangle may shade, and of those from which it hides all of the light.

    Beside `frustum_traversal._touched`, two more roundings of 2**-24, as |a x + b y + c| is at most 1 in the window;
    the difference in q is rounded up by 2**-22 of its parts.
    """
    at = 9 * LANES + lane
    x, y, q = load(place, slot, X), load(place, slot, Y), load(place, slot, Q)
    planes, regions = batch.planes, batch.regions
    sides = planes[k, BOUND_SIDES * LANES + lane] + slack_x + np.float32(2.0**-23)
    plane = planes[k, BOUND_PLANE * LANES + lane] + slack_x
    plane += planes[k, BOUND_Q * LANES + lane] * reach_q + abs(planes[k, at + 3 * LANES]) * slack_q
    if np.isnan(plane):
        plane = np.float32(np.inf)  # 0 times infinity: nothing is known
    value = x * planes[k, at] + y * planes[k, at + LANES] + planes[k, at + 2 * LANES] + q * planes[k, at + 3 * LANES]
    maybe, sure = value >= -plane, value > plane
    top = regions[k, RECT_QMAX * LANES + lane]
    ahead = splat(top + slack_q + np.float32(2.0**-22) * (abs(top) + reach_q)) - q
    for edge in range(3):
        at = 3 * edge * LANES + lane
        a, b = planes[k, at], planes[k, at + LANES]
        wide = ahead * (abs(a) * regions[k, SLOPE_X * LANES + lane] + abs(b) * regions[k, SLOPE_Y * LANES + lane])
        value = x * a + y * b + planes[k, at + 2 * LANES]
        maybe &= value + wide >= -sides
        sure &= value - wide > sides
    return maybe, sure


@kernel
def shade_node(
    casting, corners, order, sides, clusters, disc, frame, asking, leaves, tree, node, bits, stats,
):  # fmt: skip
    """Set the bits of all view samples below one node: a group of the tree's second level, up to 256 leaves."""
    top = tree.level[1] + node
    box = tree.box
    lit = new_leaf()
    _own_planes(casting, disc, asking, leaves, tree, node, lit, bits)
    xmin, xmax = smallest(load(box, top, XMIN * LANES)), largest(load(box, top, XMAX * LANES))
    ymin, ymax = smallest(load(box, top, YMIN * LANES)), largest(load(box, top, YMAX * LANES))
    qmin = smallest(load(box, top, QMIN * LANES))
    batch = Batch(
        np.empty((BATCH, REGIONS), np.float32), np.empty((BATCH, PLANES), np.float32),
        np.empty((BATCH, 7), np.float32), np.empty(BATCH, np.int32), np.empty(BATCH, np.bool_),
        np.empty(BATCH, np.int64),
    )  # fmt: skip
    whole, masks = np.arange(BATCH).astype(np.int32), np.empty(BATCH, np.int32)
    lists = _new_lists(), _new_lists()
    # Depth first through the tree of clusters: what waits, and how high it stands.
    waiting, height = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.int64)
    waiting[0], height[0] = 0, len(clusters.level) - 2
    depth, entries = 1, 0
    while depth > 0:
        depth -= 1
        group, above = waiting[depth], height[depth]
        below = len(corners) if above == 0 else clusters.level[above] - clusters.level[above - 1]
        hit = meeting(clusters.region, clusters.level[above] + group, xmin, xmax, ymin, ymax, qmin)
        while hit:
            child = group * LANES + lowest(hit)
            hit &= hit - np.int32(1)
            if child >= below:
                break
            if above > 0:
                waiting[depth], height[depth] = child, above - 1
                depth += 1
                continue
            bounded = bound_regions(corners, child, disc.source, disc.reach, frame, batch.regions, entries)
            mask = meeting(batch.regions, entries, xmin, xmax, ymin, ymax, qmin)
            mask &= ~equal(sides, child, 0, np.int8(0))
            if mask == 0:
                continue
            common_bounds(batch.regions, entries, mask, batch.outer, entries, 0, 1)
            batch.bounded[entries] = bounded & ~equal(sides, child, 0, np.int8(STRADDLES))
            batch.ready[entries], batch.number[entries], masks[entries] = False, child, mask
            entries += 1
            if entries == BATCH:
                if _descend(
                    casting, corners, order, sides, disc, frame, asking, leaves, tree, node, batch, whole, masks,
                    entries, lists, lit, bits, stats,
                ):  # fmt: skip
                    return
                entries = 0
    _descend(
        casting, corners, order, sides, disc, frame, asking, leaves, tree, node, batch, whole, masks, entries, lists,
        lit, bits, stats,
    )  # fmt: skip


@inline
def _own_planes(casting, disc, asking, leaves, tree, node, lit, bits):
    """Set the bits of light samples behind the view samples' own triangles, where these go through the light."""
    for number in range(node * LANES * LANES, min((node + 1) * LANES * LANES, len(tree.slot))):
        slot = np.int64(tree.slot[number])
        lit.ready[:] = False
        for lane in range(LANES):
            own, index = np.int64(leaves.ids[slot, OWN + lane]), np.int64(leaves.ids[slot, SAMPLE + lane])
            if own >= 0 and asking.side[index] != 0 and casting.own_side[own] == 0:
                bits[index] = own_dark(lit, lane, own, index, casting, asking, disc, bits[index])
                if bits[index] == -1:
                    darken(leaves.ids, slot, lane, bits)


@inline
def _descend(
    casting, corners, order, sides, disc, frame, asking, leaves, tree, node, batch, whole, masks, entries, lists,
    lit, bits, stats,
):  # fmt: skip
    """Take a batch down one node; returns whether all below it is dark."""
    top = tree.level[1] + node
    box, full = tree.box, tree.full
    upper, lower = lists
    visited = _hand_down(whole, masks, entries, batch.outer, box, full, top, upper)
    while visited:
        child = np.int64(lowest(visited))
        visited &= visited - np.int32(1)
        kept = _keep(upper, child, batch, corners, sides, disc.source, frame, box, top, stats)
        group = tree.level[0] + node * LANES + child
        first = (node * LANES + child) * LANES
        if kept < 0:
            for number in range(first, min(first + LANES, len(tree.slot))):
                _darken_leaf(leaves.ids, np.int64(tree.slot[number]), bits)
            full[top, child] = 1
            continue
        seen = _hand_down(upper.entry[child], upper.mask[child], kept, batch.outer, box, full, group, lower)
        while seen:
            leaf = np.int64(lowest(seen))
            seen &= seen - np.int32(1)
            slot = np.int64(tree.slot[first + leaf])
            kept = _keep(lower, leaf, batch, corners, sides, disc.source, frame, box, group, stats)
            if kept < 0:
                _darken_leaf(leaves.ids, slot, bits)
            elif kept > 0:
                _shade_leaf(
                    casting, order, sides, disc, asking, leaves, slot, batch, lower, leaf, kept, lit, bits, stats
                )
            if equal(leaves.ids, slot, OWN, np.int32(DARK)) == ALL:
                full[group, leaf] = 1
        if equal(full, group, 0, np.uint8(0)) == 0:
            full[top, child] = 1
    return equal(full, top, 0, np.uint8(0)) == 0


@inline
def _darken_leaf(ids, slot, bits):
    for lane in range(LANES):
        if ids[slot, OWN + lane] != DARK:
            darken(ids, slot, lane, bits)


@inline
def _shade_leaf(casting, order, sides, disc, asking, leaves, slot, batch, lists, leaf, kept, lit, bits, stats):
    """The samples of a leaf against what is left of its list."""
    ids = leaves.ids
    lit.ready[:] = False
    slack_x, slack_q = leaves.box[slot, SLACK_X], leaves.box[slot, SLACK_Q]
    reach_q = max(abs(leaves.box[slot, QMIN]), abs(leaves.box[slot, QMAX]))
    for entry in range(kept):
        k = np.int64(lists.entry[leaf, entry])
        mask = lists.mask[leaf, entry]
        cluster = batch.number[k]
        stats[SAMPLE_TESTS] += count(mask) * LANES
        while mask:
            lane = np.int64(lowest(mask))
            mask &= mask - np.int32(1)
            t = np.int64(order[cluster * LANES + lane])
            maybe, sure = np.int32(ALL), np.int32(0)
            if batch.bounded[k] >> np.int32(lane) & np.int32(1) and slack_x < np.inf:
                maybe, sure = _touched(batch, k, lane, leaves.place, slot, slack_x, slack_q, reach_q)
            maybe &= ~(equal(ids, slot, OWN, np.int32(t)) | equal(ids, slot, OWN, np.int32(DARK)))
            while maybe:
                other = np.int64(lowest(maybe))
                maybe &= maybe - np.int32(1)
                if sure >> np.int32(other) & np.int32(1):
                    darken(ids, slot, other, bits)
                    continue
                own, index = np.int64(ids[slot, OWN + other]), np.int64(ids[slot, SAMPLE + other])
                found = darkened(
                    lit, other, own, index, t, np.int64(sides[cluster, lane]), casting, asking, disc, bits[index], stats
                )
                bits[index] = found
                if found == -1:
                    darken(ids, slot, other, bits)
        if equal(ids, slot, OWN, np.int32(DARK)) == ALL:
            return
