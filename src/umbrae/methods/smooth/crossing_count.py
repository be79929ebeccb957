"""Signed counts of the triangles that a sample's ray to the light crosses, over the view-sample hierarchy.

A triangle adds its weight to each sample in its shadow, or to the largest nodes that lie in it, by the sums of the
transmission buffer: positive weights in one channel, negative ones in another, so that the order of threads does not
matter. Side planes are half-open: where two triangles share an edge, a ray through it crosses one.
"""

import numpy as np
from numpy.typing import NDArray

from umbrae.methods.frustum_transmission import Dimming
from umbrae.methods.lanes import LANES
from umbrae.methods.sample_clusters import DARK, OWN, SAMPLE
from umbrae.methods.smooth.silhouette import way_at
from umbrae.methods.transmission_buffer import Dice, TransmissionBuffer
from umbrae.parallel import kernel
from umbrae.transmission import EVEN, Transmission

CERTAIN = Dice(0, np.uint64(0), 0)
"""Nothing is left to chance."""


def counting(weight: NDArray[np.int32], source: NDArray[np.int32], buffer: TransmissionBuffer) -> Dimming:
    """What the traversal needs to add `weight (k,)` for each triangle, but not to samples on its `source (k,)`."""
    found, number = np.unique(weight, return_inverse=True)
    none = np.zeros(len(found))
    table = Transmission(
        kind=np.full(len(weight), EVEN, np.uint8),
        material_id=number.astype(np.int32),
        closed=np.zeros(len(found), bool),
        even=np.zeros((len(found), 3)),
        base=np.zeros((len(found), 4)),
        transmitted=none,
        cutoff=none,
        mode=np.zeros(len(found), np.int8),
        uv=np.zeros((0, 2), np.float32),
        colors=np.zeros((0, 4), np.float32),
        texels=np.zeros(0, np.uint8),
        offset=np.zeros(len(found), np.int64),
        size=np.zeros((len(found), 2), np.int64),
    )
    terms = np.stack([np.maximum(found, 0), np.maximum(-found, 0), np.zeros_like(found)], axis=1).astype(np.int64)
    return Dimming(
        table, terms, buffer, CERTAIN, np.empty((0, 3), np.int64), np.zeros(1, np.int64), source.astype(np.int32)
    )


@kernel
def write_counts(start, stop, tree, receivers, buffer, facing, chain, turned, values, in_shadow):
    """Write the verdicts of leaves `start` to `stop`: in shadow where solid parts shade, or the count is not zero.

    A sample whose own triangle is turned away from the light, by `facing (t,)`, crosses that as well.
    """
    sums, ids, triangles = buffer.sums, receivers.ids, receivers.triangles
    for number in range(start, stop):
        slot = tree.slot[number]
        group, child = number // LANES, number % LANES
        whole, row = tree.full[group, child], buffer.leaves + number
        for lane in range(LANES):
            index = ids[slot, SAMPLE + lane]
            if index < 0:
                continue
            own = ids[slot, OWN + lane]
            dark = whole or own == DARK
            if not dark:
                total = sums[row, lane] + sums[group, child] - sums[row, LANES + lane] - sums[group, LANES + child]
                if own >= 0 and receivers.side[index] * facing[own] < 0:
                    u, v = np.float64(receivers.barycentric[index, 0]), np.float64(receivers.barycentric[index, 1])
                    total += way_at(own, u, v, triangles, chain, turned, values) * facing[own]
                dark = total != 0
            in_shadow[index] = dark
