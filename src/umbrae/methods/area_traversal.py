"""Regions of influence against the view-sample hierarchy, one part of it at a time.

Sintorn et al. 2011 (section 5) would have soft shadows from frusta that are expanded to a triangle's region of
influence, and a shadow buffer of one bit per light sample. This is that, with the hierarchy, clusters and batches of
`frustum_traversal`, but turned around: there, a task is a batch of triangles, and threads share the samples. Here a
task is one node of the sample tree, 256 leaves, and finds its triangles in a tree of clusters. Bits are then written by
one thread alone, and what is known of a view sample and its light samples is worked out once for many triangles.

A node of samples is left when it is dark. It is set dark as a whole by a triangle that hides all of the light from all
of it; so is a single sample. All other pairs of sample and triangle are settled by `area_pairs`.
"""

import numpy as np

from umbrae.methods.area_pairs import MOST, darken, darken_lanes, own_dark, prepare
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
        while hit:
            child = lowest(hit)
            hit &= hit - np.int32(1)
            place = child_count[child]
            child_list[child, place], child_mask[child, place] = k, masked[entry]
            child_count[child] = place + 1
    return visited


@inline
def _keep(
    listed, masked, entries, box, group, child, regions, planes, bounded, ready, number_of, corners, sides, source,
    frame, stats,
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
            if mask & accept & bounded[k]:
                stats[ACCEPTS] += 1
                return -1
            mask &= ~reject
            if mask == 0:
                continue
        listed[kept], masked[kept] = k, mask
        kept += 1
    return kept


@expand
def _touched(planes, regions, k, lane, place, slot, slack_x, slack_q, reach_q):
    """Masks of a leaf's samples that a triangle may shade, and of those from which it hides all of the light.

    Beside `frustum_traversal._touched`, two more roundings of 2**-24, as |a x + b y + c| is at most 1 in the window;
    the difference in q is rounded up by 2**-22 of its parts.
    """
    at = 9 * LANES + lane
    x, y, q = load(place, slot, X), load(place, slot, Y), load(place, slot, Q)
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
        wide = ahead * planes[k, OPENING + edge * LANES + lane]
        value = x * planes[k, at] + y * planes[k, at + LANES] + planes[k, at + 2 * LANES]
        maybe &= value + wide >= -sides
        sure &= value - wide > sides
    return maybe, sure


@kernel
def shade_node(
    positions, triangles, own_side, corners, order, sides, region, cluster_level, disc, frame,
    barycentric, side, position, first, leaf_place, leaf_ids, leaf_box, box, full, level, slots, node, bits, stats,
):  # fmt: skip
    """Set the bits of all view samples below one node: a group of the tree's second level, up to 256 leaves."""
    source, reach = disc.source, disc.reach
    top = level[1] + node
    # What is known of the view samples of one leaf (see `area_pairs`).
    known, place, scaled = np.empty(LANES, np.bool_), np.zeros(4 * LANES), np.empty(14 * LANES, np.float32)
    lights, offsets = np.zeros((3 * LANES, MOST), np.float32), np.zeros((3 * LANES, MOST), np.float32)
    point, light = np.empty(3), np.empty(4)
    for number in range(node * LANES * LANES, min((node + 1) * LANES * LANES, len(slots))):
        slot = np.int64(slots[number])
        known[:] = False
        for lane in range(LANES):
            own, index = np.int64(leaf_ids[slot, OWN + lane]), np.int64(leaf_ids[slot, SAMPLE + lane])
            if own >= 0 and side[index] != 0 and own_side[own] == 0:
                prepare(
                    lane, own, index, positions, triangles, barycentric, position, first, disc, known, place, lights,
                    offsets, point,
                )  # fmt: skip
                bits[index] = own_dark(
                    lane, own, positions, triangles, side[index], disc, lights, offsets, bits[index], light
                )
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
                planes, bounded, ready, number_of, corners, sides, source, frame, stats,
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
                    _darken_leaf(leaf_ids, np.int64(slots[leaf]), bits)
                full[group, child] = 1
            elif kept > 0:
                slot = np.int64(slots[number])
                _shade_leaf(
                    lists[2, child], masks[2, child], kept, slot, regions, planes, bounded, number_of,
                    positions, triangles, order, sides, disc, barycentric, side, position, first, leaf_place,
                    leaf_ids, leaf_box, bits, known, place, scaled, lights, offsets, point, light, stats,
                )  # fmt: skip
                if equal(leaf_ids, slot, OWN, np.int32(DARK)) == ALL:
                    full[group, child] = 1
            kept = 0


@inline
def _darken_leaf(leaf_ids, slot, bits):
    for lane in range(LANES):
        if leaf_ids[slot, OWN + lane] != DARK:
            darken(leaf_ids, slot, lane, bits)


@inline
def _shade_leaf(
    listed, masked, entries, slot, regions, planes, bounded, number_of,
    positions, triangles, order, sides, disc, barycentric, side, position, first, leaf_place,
    leaf_ids, leaf_box, bits, known, place, scaled, lights, offsets, point, light, stats,
):  # fmt: skip
    """The samples of a leaf against what is left of its list.

    Triangles that the light sees from the front come first: of a solid, they alone make dark what lies in its umbra.
    """
    known[:] = False
    lx, ly, lz, w = disc.source[0], disc.source[1], disc.source[2], disc.source[3]
    reach, light_count = disc.reach, len(disc.pattern)
    slack_x, slack_q = leaf_box[slot, SLACK_X], leaf_box[slot, SLACK_Q]
    reach_q = max(abs(leaf_box[slot, QMIN]), abs(leaf_box[slot, QMAX]))
    for turn in range(2 * entries):
        entry = turn if turn < entries else turn - entries
        k = np.int64(listed[entry])
        cluster = number_of[k]
        mask = equal(sides, cluster, 0, np.int8(1))
        mask = masked[entry] & (mask if turn < entries else ~mask)
        stats[SAMPLE_TESTS] += count(mask) * LANES
        while mask:
            lane = np.int64(lowest(mask))
            mask &= mask - np.int32(1)
            t = np.int64(order[cluster * LANES + lane])
            maybe, sure = np.int32(ALL), np.int32(0)
            if bounded[k] >> np.int32(lane) & np.int32(1) and slack_x < np.inf:
                maybe, sure = _touched(planes, regions, k, lane, leaf_place, slot, slack_x, slack_q, reach_q)
            maybe &= ~(equal(leaf_ids, slot, OWN, np.int32(t)) | equal(leaf_ids, slot, OWN, np.int32(DARK)))
            sure &= maybe
            maybe &= ~sure
            while sure:
                darken(leaf_ids, slot, np.int64(lowest(sure)), bits)
                sure &= sure - np.int32(1)
            fresh = maybe
            while fresh:
                other = np.int64(lowest(fresh))
                fresh &= fresh - np.int32(1)
                if not known[other]:
                    own, index = np.int64(leaf_ids[slot, OWN + other]), np.int64(leaf_ids[slot, SAMPLE + other])
                    prepare(
                        other, own, index, positions, triangles, barycentric, position, first, disc, known, place,
                        lights, offsets, point,
                    )  # fmt: skip
            if maybe:
                darken_lanes(
                    maybe, slot, t, np.int64(sides[cluster, lane]), lx, ly, lz, w, reach, light_count, positions,
                    triangles, barycentric, side, position, leaf_ids, place, scaled, lights, offsets, bits, point,
                    light, stats,
                )  # fmt: skip
        if equal(leaf_ids, slot, OWN, np.int32(DARK)) == ALL:
            return


@kernel
def write_shares(start, stop, bits, light_count, in_shadow, shares):
    """What is visible of the light, for samples `start` to `stop`: shares `(n, 3)` of 1, the same for all colours."""
    for index in range(start, stop):
        dark = count(np.int32(bits[index] & 0xFFFFFFFF)) + count(np.int32(bits[index] >> 32))
        lit = np.float32(MOST - dark)
        in_shadow[index] = lit == 0.0
        for channel in range(3):
            shares[index, channel] = lit / np.float32(light_count)
