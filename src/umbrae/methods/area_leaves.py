"""One leaf of the view-sample hierarchy against the triangles whose regions of influence meet it."""

import numpy as np

from umbrae.methods.area_pairs import MOST, darken, prepare, shade_lanes
from umbrae.methods.area_setup import OPENING
from umbrae.methods.frustum_setup import BOUND_PLANE, BOUND_Q, BOUND_SIDES, RECT_QMAX
from umbrae.methods.lanes import ALL, LANES, count, equal, load, lowest, splat
from umbrae.methods.sample_clusters import DARK, OWN, QMAX, QMIN, SAMPLE, SLACK_Q, SLACK_X, Q, X, Y
from umbrae.parallel import expand, inline, kernel

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


@inline
def darken_leaf(leaf_ids, slot, bits):
    for lane in range(LANES):
        if leaf_ids[slot, OWN + lane] != DARK:
            darken(leaf_ids, slot, lane, bits)


@inline
def shade_leaf(
    listed, masked, entries, slot, regions, planes, bounded, number_of,
    positions, triangles, order, sides, disc, barycentric, side, position, first, leaf_place,
    leaf_ids, leaf_box, bits, dimming, leaf, known, place, scaled, lights, offsets, point, light, stats,
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
            # Who lets light through must be asked about each light sample.
            sure = sure & maybe if dimming is None else np.int32(0)
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
                shade_lanes(
                    maybe, slot, t, np.int64(sides[cluster, lane]), lx, ly, lz, w, reach, light_count, positions,
                    triangles, barycentric, side, position, leaf_ids, place, scaled, lights, offsets, bits,
                    dimming, leaf, point, light, stats,
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
