"""Regions of influence against the view-sample hierarchy, one part of it at a time.

Sintorn et al. 2011 (section 5) would have soft shadows from frusta that are expanded to a triangle's region of
influence, and a shadow buffer of one bit per light sample. This is that, with the hierarchy, clusters and batches of
`frustum_traversal`, but turned around: there, a task is a batch of triangles, and threads share the samples. Here a
task is one node of the sample tree, 256 leaves, and finds its triangles in a tree of clusters. Bits are then written by
one thread alone, and what is known of a view sample and its light samples is worked out once for many triangles.

A node of samples is left when it is dark. It is set dark as a whole by a triangle that hides all of the light from all
of it; so is a single sample (see `area_leaves`). All other pairs of sample and triangle are settled by `area_pairs`.
Triangles that let light through make a second pass, in which nothing is set as a whole (see `area_transmission`).
"""

import numpy as np

from umbrae.methods.area_leaves import ACCEPTS, REJECTS, TILE_TESTS, darken_leaf, shade_leaf
from umbrae.methods.area_pairs import MOST, darken, own_dark, own_dim, prepare
from umbrae.methods.area_setup import (
    EDGED_PLANES,
    OPENING,
    REGIONS,
    SLOPE_X,
    SLOPE_Y,
    STRADDLES,
    bound_regions,
    common_bounds,
    meeting,
    put_openings,
)
from umbrae.methods.area_transmission import may_dim_itself, row_of
from umbrae.methods.frustum_setup import (
    BOUND_PLANE,
    BOUND_Q,
    BOUND_SIDES,
    RECT_QMAX,
    RECT_XMAX,
    RECT_XMIN,
    RECT_YMAX,
    RECT_YMIN,
    put_planes,
)
from umbrae.methods.frustum_traversal import append_to
from umbrae.methods.lanes import ALL, LANES, choose, count, equal, largest, load, lowest, smallest, splat
from umbrae.methods.sample_clusters import DARK, OWN, QMAX, QMIN, SAMPLE, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import expand, inline, kernel

BATCH = 256
"""Clusters that go down together."""

_DEEPEST = 12 * LANES


@expand
def _against_box(planes, regions, k, xmin, xmax, ymin, ymax, qmin, qmax):
    """Masks of the triangles that surely shade nothing in a box, and of those that hide all of the light from it.

    As in `frustum_traversal`, with edges moved by their opening times q_V - q_P: out for the first, in for the second
    (see `area_setup`).
    """
    half, two, zero = np.float32(0.5), np.float32(2.0), splat(np.float32(0.0))
    cx, hx = splat(half * (xmin + xmax)), splat(half * (xmax - xmin))
    cy, hy = splat(half * (ymin + ymax)), splat(half * (ymax - ymin))
    limit = load(planes, k, BOUND_SIDES * LANES) * two
    ahead = load(regions, k, RECT_QMAX * LANES) - qmin
    ahead = choose(ahead >= np.float32(0.0), ahead, zero)
    reject, accept = np.int32(0), np.int32(ALL)
    for edge in range(3):
        a, b = load(planes, k, 3 * edge * LANES), load(planes, k, (3 * edge + 1) * LANES)
        middle = a * cx + b * cy + load(planes, k, (3 * edge + 2) * LANES)
        reach = abs(a) * hx + abs(b) * hy + load(planes, k, OPENING + edge * LANES) * ahead
        reject |= middle + reach < zero - limit
        accept &= middle - reach > limit
    a, b, d = load(planes, k, 9 * LANES), load(planes, k, 10 * LANES), load(planes, k, 12 * LANES)
    reach_q = max(abs(qmin), abs(qmax))
    limit = (load(planes, k, BOUND_PLANE * LANES) + load(planes, k, BOUND_Q * LANES) * reach_q) * two
    middle = a * cx + b * cy + load(planes, k, 11 * LANES) + d * (half * (qmin + qmax))
    reach = abs(a) * hx + abs(b) * hy + abs(d) * (half * (qmax - qmin))
    reject |= middle + reach < zero - limit
    accept &= middle - reach > limit
    return reject, accept & ~reject


@inline
def _hand_down(listed, masked, entries, outer, box, full, group, child_list, child_mask, child_count):
    """Give each child of a node those clusters whose regions meet its box; returns the mask of children with any."""
    child_count[:] = 0
    zero = splat(np.float32(0.0))
    open_children = equal(full, group, 0, np.uint8(0))
    xmin, xmax = load(box, group, XMIN * LANES), load(box, group, XMAX * LANES)
    ymin, ymax = load(box, group, YMIN * LANES), load(box, group, YMAX * LANES)
    qmin = load(box, group, QMIN * LANES)
    visited = np.int32(0)
    for entry in range(entries):
        k = listed[entry]
        ahead = splat(outer[k, RECT_QMAX]) - qmin
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
        append_to(hit, k, masked[entry], child_list, child_mask, child_count)
    return visited


@inline
def _keep(
    listed, masked, entries, box, group, child, regions, planes, bounded, ready, number_of, corners, sides, source,
    frame, dimming, stats,
):  # fmt: skip
    """Keep those of a child's list that may shade something in its box; -1 where one hides all of the light from it."""
    xmin, xmax = box[group, XMIN * LANES + child], box[group, XMAX * LANES + child]
    ymin, ymax = box[group, YMIN * LANES + child], box[group, YMAX * LANES + child]
    qmin, qmax = box[group, QMIN * LANES + child], box[group, QMAX * LANES + child]
    kept = 0
    stats[TILE_TESTS] += entries
    for entry in range(entries):
        k = np.int64(listed[entry])
        mask = masked[entry] & meeting(regions, k, xmin, xmax, ymin, ymax, qmin)
        if mask == 0:
            continue
        if mask & bounded[k]:
            if not ready[k]:
                put_planes(corners, number_of[k], sides, source, frame, planes, k)
                put_openings(regions, planes, k, source[3] == 0.0, frame)
                ready[k] = True
            reject, accept = _against_box(planes, regions, k, xmin, xmax, ymin, ymax, qmin, qmax)
            reject &= bounded[k]
            stats[REJECTS] += count(mask & reject)
            if dimming is None and mask & accept & bounded[k]:
                stats[ACCEPTS] += 1
                return -1
            mask &= ~reject
            if mask == 0:
                continue
        listed[kept], masked[kept] = k, mask
        kept += 1
    return kept


@kernel
def shade_node(
    positions, triangles, own_side, corners, order, sides, region, cluster_level, disc, frame,
    barycentric, side, position, first, leaf_place, leaf_ids, leaf_box, box, full, level, slots, node, bits, dimming,
    stats,
):  # fmt: skip
    """Set the bits of all view samples below one node: a group of the tree's second level, up to 256 leaves.

    `dimming` is None for solid triangles, for others an `AreaDimming`: they dim light samples, and set the bits of
    those that end up dark. A sample's own triangle takes part; of solid ones only where the light is on both of its
    sides, by `own_side (t,)`: where all of it is on the other side, the sample is not in the tree.
    """
    source, reach = disc.source, disc.reach
    first_leaf = node * LANES * LANES
    top = level[1] + node
    # What is known of the view samples of one leaf (see `area_pairs`).
    known, place, scaled = np.empty(LANES, np.bool_), np.zeros(4 * LANES), np.empty(14 * LANES, np.float32)
    lights, offsets = np.zeros((3 * LANES, MOST), np.float32), np.zeros((3 * LANES, MOST), np.float32)
    point, light = np.empty(3), np.empty(4)
    for number in range(first_leaf, min(first_leaf + LANES * LANES, len(slots))):
        slot = np.int64(slots[number])
        known[:] = False
        for lane in range(LANES):
            own, index = np.int64(leaf_ids[slot, OWN + lane]), np.int64(leaf_ids[slot, SAMPLE + lane])
            if own < 0 or side[index] == 0 or side[index] * own_side[own] > 0:
                continue
            if dimming is None:
                if own_side[own] != 0:
                    continue
            elif not may_dim_itself(dimming, own):
                continue
            prepare(
                lane, own, index, positions, triangles, barycentric, position, first, disc, known, place, lights,
                offsets, point,
            )  # fmt: skip
            if dimming is None:
                bits[index] = own_dark(
                    lane, own, positions, triangles, side[index], disc, lights, offsets, bits[index], light
                )
            else:
                bits[index] = own_dim(
                    lane, own, index, own_side[own], positions, triangles, barycentric, np.int64(side[index]), disc,
                    dimming, row_of(number - first_leaf, lane), lights, offsets, bits[index], point, light,
                )  # fmt: skip
            if bits[index] == -1:
                darken(leaf_ids, slot, lane, bits)

    xmin, xmax = smallest(load(box, top, XMIN * LANES)), largest(load(box, top, XMAX * LANES))
    ymin, ymax = smallest(load(box, top, YMIN * LANES)), largest(load(box, top, YMAX * LANES))
    qmin = smallest(load(box, top, QMIN * LANES))
    # Clusters on their way down: bounds of the triangles' regions and their planes, bounds of all in one, masks of the
    # triangles whose side planes mean something (they have bounds, and all of the light is on one side of them).
    regions, planes = np.empty((BATCH, REGIONS), np.float32), np.empty((BATCH, EDGED_PLANES), np.float32)
    outer, bounded = np.empty((BATCH, 7), np.float32), np.empty(BATCH, np.int32)
    ready, number_of = np.empty(BATCH, np.bool_), np.empty(BATCH, np.int64)
    # Which of them meet each child of a group: of the one above the node, of the node, and of one of its children.
    lists, masks = np.empty((3, LANES, BATCH), np.int32), np.empty((3, LANES, BATCH), np.int32)
    counts, visited = np.empty((3, LANES), np.int64), np.empty(3, np.int32)
    # Depth first through the tree of clusters: what waits, and how high it stands.
    waiting, height = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.int64)
    waiting[0], height[0] = 0, len(cluster_level) - 2
    depth = 1
    while depth > 0:
        entries = 0
        while depth > 0 and entries <= BATCH - LANES:
            depth -= 1
            group, above = waiting[depth], height[depth]
            below = len(corners) if above == 0 else cluster_level[above] - cluster_level[above - 1]
            hit = meeting(region, cluster_level[above] + group, xmin, xmax, ymin, ymax, qmin)
            while hit:
                child = group * LANES + np.int64(lowest(hit))
                hit &= hit - np.int32(1)
                if child >= below:
                    break
                if above > 0:
                    waiting[depth], height[depth] = child, above - 1
                    depth += 1
                    continue
                sure = bound_regions(corners, child, source, reach, frame, regions, entries)
                mask = meeting(regions, entries, xmin, xmax, ymin, ymax, qmin)
                mask &= ~equal(sides, child, 0, np.int8(0))
                if mask == 0:
                    continue
                common_bounds(regions, entries, mask, outer, entries, 0, 1)
                bounded[entries] = sure & ~equal(sides, child, 0, np.int8(STRADDLES))
                ready[entries], number_of[entries] = False, child
                lists[0, 0, entries], masks[0, 0, entries] = entries, mask
                entries += 1
        level_of, group, child, kept = 1, top, 0, entries
        visited[1] = visited[2] = 0
        while level_of > 0:
            if kept > 0:
                # Into a child of the level above.
                visited[level_of] = _hand_down(
                    lists[level_of - 1, child], masks[level_of - 1, child], kept, outer, box, full, group,
                    lists[level_of], masks[level_of], counts[level_of],
                )  # fmt: skip
                kept = 0
            if visited[level_of] == 0:
                level_of -= 1
                if equal(full, group, 0, np.uint8(0)) == 0:
                    if level_of == 0:
                        return
                    full[top, group - level[0] - node * LANES] = 1
                group = top
                continue
            child = np.int64(lowest(visited[level_of]))
            visited[level_of] &= visited[level_of] - np.int32(1)
            kept = _keep(
                lists[level_of, child], masks[level_of, child], counts[level_of, child], box, group, child, regions,
                planes, bounded, ready, number_of, corners, sides, source, frame, dimming, stats,
            )  # fmt: skip
            if level_of == 1:
                number, stop = (node * LANES + child) * LANES, min((node * LANES + child + 1) * LANES, len(slots))
                if kept > 0:
                    group, level_of = level[0] + node * LANES + child, 2
                    continue
            else:
                number = (group - level[0]) * LANES + child
                stop = number + 1
            if kept < 0:
                for leaf in range(number, stop):
                    darken_leaf(leaf_ids, np.int64(slots[leaf]), bits)
                full[group, child] = 1
            elif kept > 0:
                slot = np.int64(slots[number])
                shade_leaf(
                    lists[2, child], masks[2, child], kept, slot, regions, planes, bounded, number_of,
                    positions, triangles, order, sides, disc, barycentric, side, position, first, leaf_place,
                    leaf_ids, leaf_box, bits, dimming, number - first_leaf, known, place, scaled, lights,
                    offsets, point, light, stats,
                )  # fmt: skip
                if equal(leaf_ids, slot, OWN, np.int32(DARK)) == ALL:
                    full[group, child] = 1
            kept = 0
