"""Frusta of triangles that let light through: textured, translucent, coloured (Sintorn et al. 2011, section 3.2).

They go down the tree after all solid ones, so that what those shadow is skipped: the two passes of section 5, with
the solid triangles as the good blockers. Three things differ from solid ones.

A triangle that lets the same share through everywhere adds its logarithm to the largest nodes that lie in its shadow.
A textured one gives trivial acceptance up: each sample looks the texture up, at its own place. So does any triangle
where chance decides, which rolls for each sample.

Nodes of many samples that lie in such a triangle's shadow go onto a queue, from which all threads then take ranges of
leaves, whose samples need no plane tests. Else a few triangles that shadow much of the picture would leave one thread
alone with all the look-ups, which the paper describes, and names such a queue as the remedy. Smaller nodes are refined
like any other: next to the look-ups, the plane tests of 16 samples at once cost nothing.

Side planes are half-open: a pixel on the diagonal of a pane gets through it once. Only pairs that float32 leaves open
can be affected, and `settle` asks the predicate about those.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import hit_weights, surface_point
from umbrae.methods.frustum_leaves import (
    LOOKUPS,
    QUEUED,
    SAMPLE_TESTS,
    leaf_bounds,
    leaf_slack,
    settle,
    touched,
)
from umbrae.methods.lanes import ALL, LANES, count, equal, lowest
from umbrae.methods.sample_clusters import DARK, OWN, SAMPLE
from umbrae.methods.transmission_buffer import Dice, TransmissionBuffer, deposit, deposit_shares, roll
from umbrae.parallel import expand, kernel
from umbrae.transmission import EVEN, Transmission, passing

LARGE = 2
"""Nodes of 16**2 leaves, or 4096 samples, and larger ones are left for later."""


class Dimming(NamedTuple):
    """What a task needs about triangles that let light through.

    `even (m, 3)` the terms of what materials let through that is the same everywhere; `queue (n, 3)` has room for
    triangle, first leaf and the one after the last; `queued (1,)` how many there are. `source (k,) int32`
    is the triangle whose own samples each does not dim; no rows where that is the triangle itself.
    """

    table: Transmission
    even: NDArray[np.int64]
    buffer: TransmissionBuffer
    dice: Dice
    queue: NDArray[np.int64]
    queued: NDArray[np.int64]
    source: NDArray[np.int32]


@expand
def deposit_even(dimming, row, lane, m):
    """`deposit` for a triangle of material m that lets the same through everywhere."""
    even = dimming.even
    return deposit(dimming.buffer, row, lane, even[m, 0], even[m, 1], even[m, 2])


@expand
def dim_sample(number, slot, lane, t, receivers, dimming, point, stats):
    """Dim the light of a sample in triangle t's shadow; returns whether it is dark now."""
    ids, table, buffer, dice = receivers.ids, dimming.table, dimming.buffer, dimming.dice
    own = ids[slot, OWN + lane]
    if own == DARK:
        return True
    index, row = ids[slot, SAMPLE + lane], buffer.leaves + number
    even, m = table.kind[t] == EVEN, table.material_id[t]
    if even and dice.strata == 0:
        dark = deposit_even(dimming, row, lane, m)
    else:
        if even:
            red, green, blue = table.even[m, 0], table.even[m, 1], table.even[m, 2]
        else:
            stats[LOOKUPS] += 1
            positions, triangles = receivers.positions, receivers.triangles
            if own < 0:
                for axis in range(3):
                    point[axis] = receivers.position[index, axis]
            else:
                u, v = np.float64(receivers.barycentric[index, 0]), np.float64(receivers.barycentric[index, 1])
                surface_point(positions, triangles, own, u, v, point)
            wa, wb, wc = hit_weights(positions, triangles, t, receivers.light, point)
            red, green, blue = passing(triangles, table, t, wa, wb, wc)
        if red == 1.0 and green == 1.0 and blue == 1.0:
            return False
        if dice.strata == 0 or (red == 0.0 and green == 0.0 and blue == 0.0):
            dark = deposit_shares(buffer, row, lane, red, green, blue)
        else:
            dark = roll(buffer, dice, row, lane, index, t, red, green, blue)
    if dark:
        ids[slot, OWN + lane] = DARK
    return dark


@expand
def dim_leaf(
    group, child, number, slot, listed, masked, entries, number_of, order, rows, receivers, dimming, point, stats
):
    """Dim the samples of a leaf that the listed frusta hold; returns the mask of all dark lanes."""
    ids, table = receivers.ids, dimming.table
    slack_x, slack_q, reach_q = leaf_slack(receivers.box, slot)
    dark = equal(ids, slot, OWN, np.int32(DARK))
    for entry in range(entries):
        k = np.int64(listed[entry])
        mask = masked[entry]
        stats[SAMPLE_TESTS] += count(mask) * LANES
        while mask and dark != ALL:
            lane = np.int64(lowest(mask))
            mask &= mask - np.int32(1)
            t = order[number_of[k] * LANES + lane]
            m = table.material_id[t]
            sides, plane = leaf_bounds(rows, k, lane, slack_x, slack_q, reach_q)
            exempt = dimming.source[t] if len(dimming.source) else np.int32(t)
            maybe, sure = touched(receivers.place, ids, slot, exempt, rows, k, lane, sides, plane)
            unsure = maybe & ~sure
            while unsure:
                other = lowest(unsure)
                unsure &= unsure - np.int32(1)
                if settle(slot, other, t, table.closed[m], receivers, point, stats):
                    sure |= np.int32(1) << other
            if (sure | dark) == ALL and table.kind[t] == EVEN and dimming.dice.strata == 0:
                deposit_even(dimming, group, child, m)  # what the dark ones get does not matter
                continue
            while sure:
                other = np.int64(lowest(sure))
                sure &= sure - np.int32(1)
                if dim_sample(number, slot, other, t, receivers, dimming, point, stats):
                    dark |= np.int32(1) << other
    return dark


@expand
def accept_node(group, child, number, below, order, cluster, accepted, leaves, dimming, stats):
    """Let triangles of a cluster dim the samples below a node that lies in their shadow, now or later.

    The node is child `child` of `group`, and number `number` of those that hold 16**below of the `leaves` each. Returns
    the mask of those in `accepted` that are done with it; it must be refined for the others.
    """
    done = np.int32(0)
    while accepted:
        lane = np.int64(lowest(accepted))
        accepted &= accepted - np.int32(1)
        t = order[cluster * LANES + lane]
        waiting = dimming.queued[0]
        if dimming.table.kind[t] == EVEN and dimming.dice.strata == 0:
            deposit_even(dimming, group, child, dimming.table.material_id[t])
        elif below >= LARGE and waiting < len(dimming.queue):
            dimming.queue[waiting, 0] = t
            dimming.queue[waiting, 1] = number << (4 * below)
            dimming.queue[waiting, 2] = min((number + 1) << (4 * below), leaves)
            dimming.queued[0] = waiting + 1
            stats[QUEUED] += 1
        else:
            continue
        done |= np.int32(1) << lane
    return done


@kernel
def cover_queued(queue, start, stop, tree, receivers, dimming, stats):
    """Let triangles dim all samples of leaves that lie in their shadow: entries `start` to `stop` of a queue."""
    full, slots, point = tree.full, tree.slot, np.empty(3)
    for entry in range(start, stop):
        t = queue[entry, 0]
        for number in range(queue[entry, 1], queue[entry, 2]):
            if full[number // LANES, number % LANES]:
                continue
            slot, all_dark = slots[number], True
            for lane in range(LANES):
                all_dark &= dim_sample(number, slot, lane, t, receivers, dimming, point, stats)
            if all_dark:
                full[number // LANES, number % LANES] = 1
