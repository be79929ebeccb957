"""One frustum against the 16 samples of a leaf: in float32, and by the predicate where that leaves a pair open."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import EXACT, SHADOWED, facing, shadows
from umbrae.methods.frustum_setup import BOUND_PLANE, BOUND_Q, BOUND_SIDES
from umbrae.methods.lanes import ALL, LANES, count, equal, load, lowest
from umbrae.methods.sample_clusters import DARK, OWN, QMAX, QMIN, SAMPLE, SLACK_Q, SLACK_X, Q, X, Y
from umbrae.parallel import expand, inline

(TILE_TESTS, SAMPLE_TESTS, ACCEPTS, REJECTS, FALLBACKS, EXACT_TESTS, LOOKUPS, QUEUED) = range(8)
COUNTERS = (
    "tile_frustum_tests",
    "sample_frustum_tests",
    "accepts",
    "rejects",
    "fallbacks",
    "predicate_fallbacks",
    "texture_lookups",
    "queued_tiles",
)


class Receivers(NamedTuple):
    """What is asked about: samples in leaves (see `sample_tree.Leaves`), the scene they lie on, and the light.

    `barycentric (n, 2)`, `side (n,)` and `position (n, 3)` are those of all samples, in their order.
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    light: NDArray[np.float64]
    place: NDArray[np.float32]
    ids: NDArray[np.int32]
    box: NDArray[np.float32]
    barycentric: NDArray[np.float32]
    side: NDArray[np.int8]
    position: NDArray[np.float32]


@expand
def leaf_slack(box, slot):
    """How far x or y, and q, of a leaf's samples may be off, and their largest |q|."""
    return box[slot, SLACK_X], box[slot, SLACK_Q], max(abs(box[slot, QMIN]), abs(box[slot, QMAX]))


@expand
def leaf_bounds(rows, k, lane, slack_x, slack_q, reach_q):
    """How far from 0 the values of a frustum's sides, and of its plane, must be to be sure at a leaf's samples."""
    sides = rows[k, BOUND_SIDES * LANES + lane] + slack_x
    slope_q = abs(rows[k, 12 * LANES + lane])
    plane = rows[k, BOUND_PLANE * LANES + lane] + slack_x
    plane += rows[k, BOUND_Q * LANES + lane] * reach_q + slope_q * slack_q
    if np.isnan(plane):
        plane = np.float32(np.inf)  # 0 times infinity: nothing is known
    return sides, plane


@expand
def touched(leaf_place, leaf_ids, slot, t, rows, cluster, lane, sides, plane):
    """Masks of a leaf's lanes that a frustum may shadow, and of those that it surely does."""
    x, y, q = load(leaf_place, slot, X), load(leaf_place, slot, Y), load(leaf_place, slot, Q)
    maybe = ~(equal(leaf_ids, slot, OWN, t) | equal(leaf_ids, slot, OWN, DARK))
    sure = maybe
    for edge in range(3):
        at = 3 * edge * LANES + lane
        value = x * rows[cluster, at] + y * rows[cluster, at + LANES] + rows[cluster, at + 2 * LANES]
        maybe &= value >= -sides
        sure &= value > sides
    at = 9 * LANES + lane
    value = x * rows[cluster, at] + y * rows[cluster, at + LANES] + rows[cluster, at + 2 * LANES]
    value = value + q * rows[cluster, at + 3 * LANES]
    maybe &= value >= -plane
    sure &= value > plane
    return maybe, sure


@inline
def settle(slot, lane, t, closed, receivers, point, stats):
    """Ask the predicate about a pair that float32 left open."""
    # Another thread may have darkened the lane meanwhile: then whatever comes out, it stays in shadow.
    own = receivers.ids[slot, OWN + lane]
    index = receivers.ids[slot, SAMPLE + lane]
    for axis in range(3):
        point[axis] = receivers.position[index, axis]
    positions, triangles, light = receivers.positions, receivers.triangles, receivers.light
    u, v = np.float64(receivers.barycentric[index, 0]), np.float64(receivers.barycentric[index, 1])
    facing_t = facing(positions, triangles, t, light)
    side = np.int64(receivers.side[index])
    answer = shadows(positions, triangles, t, facing_t, light, own, u, v, side, point, closed)
    stats[FALLBACKS] += 1
    if answer & EXACT:
        stats[EXACT_TESTS] += 1
    return answer & SHADOWED


@expand
def darken_leaf(slot, listed, masked, entries, number_of, order, rows, receivers, point, stats):
    """Set the samples of a leaf in shadow that frusta of solid triangles hold; returns the mask of all dark lanes."""
    ids = receivers.ids
    slack_x, slack_q, reach_q = leaf_slack(receivers.box, slot)
    dark = equal(ids, slot, OWN, np.int32(DARK))
    for entry in range(entries):
        if dark == ALL:
            break
        k = np.int64(listed[entry])
        mask = masked[entry]
        stats[SAMPLE_TESTS] += count(mask) * LANES
        while mask:
            lane = np.int64(lowest(mask))
            mask &= mask - np.int32(1)
            t = order[number_of[k] * LANES + lane]
            sides, plane = leaf_bounds(rows, k, lane, slack_x, slack_q, reach_q)
            maybe, sure = touched(receivers.place, ids, slot, t, rows, k, lane, sides, plane)
            unsure = maybe & ~sure
            dark |= sure
            while sure:
                ids[slot, OWN + lowest(sure)] = DARK
                sure &= sure - np.int32(1)
            while unsure:
                other = lowest(unsure)
                unsure &= unsure - np.int32(1)
                if settle(slot, other, t, True, receivers, point, stats):
                    ids[slot, OWN + other] = DARK
                    dark |= np.int32(1) << other
    return dark
