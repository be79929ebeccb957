"""Triangles that let light through, under a light with a size: a share of light for each light sample and channel.

Such a triangle does not hide a light sample, it dims it; so beside the bits of `area_pairs` a view sample has a number
for each light sample and colour channel, at most 192. They live only while a task works on its node of the sample tree,
256 leaves, and their mean is what arrives: memory does not grow with the picture. Solid triangles go down the tree
first; what they hide is not asked again, nor are light samples from which no colour comes any more.

Each triangle must dim each pair once. So nothing is accepted as a whole, side planes are half-open (see
`geometry.predicates`), and textures are looked up where the ray to that very light sample meets the triangle.

By chance (Sintorn et al. 2011, section 5: a bit for each light sample, set stochastically) a number becomes 0 or stays,
with the probability that the triangle stops light of that channel. The chances of a view sample and a triangle are
stratified over the light samples, as those of a pixel's samples are (see `geometry.chance`): of n light samples, a
triangle of opacity alpha before all of them stops alpha n, rounded up or down. It takes no less time or memory here
than the exact product.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.chance import chance
from umbrae.geometry.predicates import hit_weights
from umbrae.methods.lanes import LANES, lowest
from umbrae.methods.sample_clusters import SAMPLE
from umbrae.methods.transmission_buffer import CHANNELS, LEAST, Dice
from umbrae.parallel import expand, kernel
from umbrae.transmission import CLEAR, EVEN, SOLID, Transmission, passing

FAINTEST = 2.0**-500
"""What is left of a light sample at least where anything is: products never become 0 by rounding."""


class AreaDimming(NamedTuple):
    """What a task needs about triangles that let light through.

    `dice` counts all light samples of all view samples, one after the other, with as many strata as a view sample has
    light samples (none: shares are multiplied up). `left (rows, count) float64` what is left of each light sample:
    three rows, for the channels, to each view sample of each leaf below the node.
    """

    table: Transmission
    dice: Dice
    left: NDArray[np.float64]


def full_light(leaves: int, count: int) -> NDArray[np.float64]:
    """`AreaDimming.left` before anything stands in the way, for so many leaves and light samples."""
    return np.ones((leaves * LANES * CHANNELS, count))


@expand
def row_of(leaf, lane):
    """The first row of a view sample in `AreaDimming.left`; `leaf` is counted from the node's first."""
    return (leaf * LANES + lane) * CHANNELS


@expand
def is_closed(dimming, t):
    """Whether side planes belong to triangle t: it is opaque wherever it is there at all."""
    return dimming.table.closed[dimming.table.material_id[t]]


@expand
def may_dim_itself(dimming, own):
    """Whether a sample's own triangle lets a part of the light through."""
    return dimming.table.kind[own] != SOLID and dimming.table.kind[own] != CLEAR


@expand
def dim_one(dimming, row, index, number, t, red, green, blue):
    """Dim one light sample of a view sample by the shares that triangle t lets through; returns whether it is dark."""
    dice, left, dark = dimming.dice, dimming.left, True
    drawn = 0.0
    if dice.strata > 0:
        drawn = chance(dice.key, t, dice.first + index * dice.strata + number, dice.strata)
    for channel, share in ((0, red), (1, green), (2, blue)):
        before = left[row + channel, number]
        if dice.strata > 0:
            after = 0.0 if drawn < 1.0 - share else before
        else:
            after = max(before * min(share, 1.0), FAINTEST) if share > 0.0 and before > 0.0 else 0.0
        left[row + channel, number] = after
        dark &= after == 0.0
    return dark


@expand
def dim_pairs(dimming, hit, at, row, lane, index, t, positions, triangles, lights, place, light, point):
    """Dim those of 16 light samples, from `at` on, that triangle t stands before; returns the mask of dark ones."""
    table, dark = dimming.table, np.int32(0)
    m = table.material_id[t]
    red, green, blue = table.even[m, 0], table.even[m, 1], table.even[m, 2]
    for axis in range(3):
        point[axis] = place[axis * LANES + lane]
    while hit:
        bit = lowest(hit)
        hit &= hit - np.int32(1)
        number = at + np.int64(bit)
        if table.kind[t] != EVEN:
            for axis in range(3):
                light[axis] = lights[3 * lane + axis, number]
            wa, wb, wc = hit_weights(positions, triangles, t, light, point)
            red, green, blue = passing(triangles, table, t, wa, wb, wc)
        if dim_one(dimming, row, index, number, t, red, green, blue):
            dark |= np.int32(1) << bit
    return dark


@kernel
def write_arriving(node, slots, leaf_ids, bits, left, in_shadow, shares):
    """Write the mean of what is left of all light samples, for the view samples below a node."""
    first, count = node * LANES * LANES, left.shape[1]
    for number in range(first, min(first + LANES * LANES, len(slots))):
        for lane in range(LANES):
            index = leaf_ids[slots[number], SAMPLE + lane]
            if index < 0:
                continue
            row, dark = row_of(number - first, lane), True
            for channel in range(CHANNELS):
                total = 0.0
                for i in range(count):
                    if not bits[index] >> i & 1:
                        total += left[row + channel, i]
                dark &= total == 0.0
                shares[index, channel] = max(total / count, LEAST) if total > 0.0 else 0.0
            in_shadow[index] = dark
