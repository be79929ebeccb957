"""The shadow buffer where casters let light through: a sum of logarithms per node and sample, or a bit per sample.

Sintorn et al. 2011 (section 3.2) add log(1 - alpha) atomically, for each colour channel, to the largest nodes of the
hierarchy that lie in a caster's shadow, and to single samples elsewhere; the merge adds parents to their children.

Sums. Floating-point sums depend on the order of their terms, and threads come in any order. So -log of what a caster
lets through is rounded to whole steps of 2**-32 and summed up in int64: the result is the same for any number of
threads. A term is at most 64 (what is less than e**-64 of the light counts as that much), so 2**25 casters per sample
cannot overflow. A term is off by 2**-33 at most, and so is the result, relative to itself, for each caster: under 1e-5
for up to 80,000 casters of one sample. What lets nothing through has no logarithm: that is a flag beside the sum,
which threads only ever set.

Stochastic (section 3.2): each sample holds one bit per channel, set with the probability that the caster stops light of
that channel. All channels of a sample compare with the same random number, so a grey caster stays grey; each caster
has another one, so the probabilities multiply. The paper proposes, but did not implement, to stratify them over
the samples of a pixel as Enderton et al. 2010 do: `geometry.chance` does.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from umbrae.geometry.chance import chance
from umbrae.geometry.predicates import shadows_own
from umbrae.memory import keep_spare, take_spare
from umbrae.methods.lanes import LANES
from umbrae.methods.sample_clusters import DARK, OWN, SAMPLE
from umbrae.methods.sample_tree import SampleTree
from umbrae.parallel import expand, kernel
from umbrae.transmission import EVEN, SOLID, passing

CHANNELS = 3

STEPS = 2.0**32
"""Of the sums, per unit of the logarithm."""

MOST = 64.0
"""The largest term of a sum."""

BLOCKED = -1
"""In place of a term: nothing gets through."""

TOLERANCE = 1e-5
"""What a share of light may be off, where up to 80,000 casters let some through."""

LEAST = 2.0**-126
"""What arrives at least where anything does: 0 is kept for where nothing does."""


class Dice(NamedTuple):
    """What chance depends on: samples per pixel (0: there is none), a seed's key, and the index of the first sample."""

    strata: int
    key: np.uint64
    first: int


class TransmissionBuffer(NamedTuple):
    """What is known of the light at the nodes of one `SampleTree` and at its samples.

    A row each for the groups of the tree, then one for each leaf, from `leaves` on, with its samples; in a row one
    number for each child or sample and channel, channel after channel. `sums (rows, 48) int64` as above (no rows
    where chance decides), `blocked (rows, 48) uint8` set where nothing of that channel gets through.
    """

    sums: NDArray[np.int64]
    blocked: NDArray[np.uint8]
    leaves: int

    @property
    def bytes(self) -> int:
        """Of all rows."""
        return self.sums.nbytes + self.blocked.nbytes

    def release(self) -> None:
        """Keep the memory for the next call."""
        keep_spare("transmission", self, self.bytes)


def reserve(trees: list[SampleTree], dice: Dice) -> tuple[TransmissionBuffer, list[TransmissionBuffer]]:
    """A buffer full of light for each tree; and one that holds them all, to be released in the end."""
    ends = np.cumsum([len(tree.full) + len(tree.slot) for tree in trees]).tolist()
    rows = ends[-1] if ends else 0
    summed = 0 if dice.strata else rows
    whole: TransmissionBuffer | None = take_spare("transmission")
    if whole is None or len(whole.blocked) < rows or len(whole.sums) < summed:
        width = CHANNELS * LANES
        whole = TransmissionBuffer(np.zeros((summed, width), np.int64), np.zeros((rows, width), np.uint8), 0)
    else:
        whole.sums[:summed] = 0
        whole.blocked[:rows] = 0
    parts = [
        TransmissionBuffer(whole.sums[:summed][start:end], whole.blocked[start:end], len(tree.full))
        for tree, start, end in zip(trees, [0, *ends], ends, strict=False)
    ]
    return whole, parts


@intrinsic
def _add(typing_context, array, row, column, number):
    """`array[row, column] += number`, int64 and atomic."""

    def build(context, builder, signature, args):
        values = context.make_array(signature.args[0])(context, builder, args[0])
        columns = builder.extract_value(values.shape, 1)
        place = builder.gep(values.data, [builder.add(builder.mul(args[1], columns), args[2])])
        # Threads read the sums only after all have ended, so no order among them is needed.
        builder.atomic_rmw("add", place, args[3], "monotonic")
        return context.get_constant(types.int64, 0)

    return types.int64(array, types.intp, types.intp, types.int64), build


@expand
def term(share):
    """What a caster that lets this share through adds to a sum."""
    if share <= 0.0:
        return np.int64(BLOCKED)
    return np.int64(np.rint(min(max(-np.log(share), 0.0), MOST) * STEPS))


@kernel
def terms(shares):
    """`term` of each number of a `(m, 3)` array."""
    out = np.empty(shares.shape, np.int64)
    for row in range(len(shares)):
        for channel in range(CHANNELS):
            out[row, channel] = term(shares[row, channel])
    return out


@expand
def deposit(buffer, row, lane, red, green, blue):
    """Add a caster's three terms to a node or sample; returns whether light of no channel gets there any more."""
    sums, blocked = buffer.sums, buffer.blocked
    for channel, number in ((0, red), (1, green), (2, blue)):
        at = channel * LANES + lane
        if number == BLOCKED:
            blocked[row, at] = 1
        elif number > 0:
            _add(sums, row, at, number)
    if red != BLOCKED and green != BLOCKED and blue != BLOCKED:
        return False
    return bool(blocked[row, lane] & blocked[row, lane + LANES] & blocked[row, lane + 2 * LANES])


@expand
def deposit_shares(buffer, row, lane, red, green, blue):
    """`deposit` for the shares that a caster lets through."""
    first = term(red)
    return deposit(
        buffer, row, lane, first, first if green == red else term(green), first if blue == red else term(blue)
    )


@expand
def _drawn(dice, index, t):
    """The number between 0 and 1 that decides for sample `index` of a block whether triangle t stops its light."""
    return chance(dice.key, np.int64(t), np.int64(dice.first + index), np.int64(dice.strata))


@expand
def roll(buffer, dice, row, lane, index, t, red, green, blue):
    """Let chance stop each channel's light at a sample; returns whether light of no channel gets there any more."""
    blocked = buffer.blocked
    drawn = _drawn(dice, index, t)
    for channel, share in ((0, red), (1, green), (2, blue)):
        if drawn < 1.0 - share:
            blocked[row, channel * LANES + lane] = 1
    return bool(blocked[row, lane] & blocked[row, lane + LANES] & blocked[row, lane + 2 * LANES])


@kernel
def light_or_dark(start, stop, in_shadow, partial):
    """Let all light arrive at samples `start` to `stop`, or none where they are already in shadow."""
    for index in range(start, stop):
        for channel in range(CHANNELS):
            partial[index, channel] = 0.0 if in_shadow[index] else 1.0


@kernel
def merge_sums(level, buffer):
    """Add what stands at each node to its children, down to the groups of leaves (the paper's merge, section 3.2)."""
    sums, blocked = buffer.sums, buffer.blocked
    for depth in range(len(level) - 1, 0, -1):
        last = level[depth] if depth == len(level) - 1 else level[depth + 1] - 1
        for group in range(level[depth], last + 1):
            for child in range(LANES):
                below = level[depth - 1] + (group - level[depth]) * LANES + child
                if below >= level[depth]:
                    break
                for channel in range(CHANNELS):
                    at = channel * LANES
                    number, stopped = sums[group, at + child], blocked[group, at + child]
                    if number == 0 and stopped == 0:
                        continue
                    for lane in range(at, at + LANES):
                        sums[below, lane] += number
                        blocked[below, lane] |= stopped


@kernel
def write_shares(start, stop, tree, receivers, facing_of, table, buffer, dice, in_shadow, partial):
    """Write what arrives at the samples of leaves `start` to `stop`.

    A sample whose own triangle is turned away from the light, by `facing_of (t,)`, gets through that one as well.
    """
    sums, blocked, ids = buffer.sums, buffer.blocked, receivers.ids
    positions, triangles, light_of = receivers.positions, receivers.triangles, receivers.light
    arriving, point = np.empty(CHANNELS), np.empty(3)
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
                before, light = 0, 1.0
                for channel in range(CHANNELS):
                    at = channel * LANES
                    stopped = blocked[row, at + lane] != 0
                    if dice.strata == 0:
                        stopped |= blocked[group, at + child] != 0
                        total = sums[row, at + lane] + sums[group, at + child]
                        if total != before:
                            # Never 0 by rounding: that means dark.
                            before, light = total, max(np.exp(total * (-1.0 / STEPS)), 2.0**-500)
                    arriving[channel] = 0.0 if stopped else light
                if own >= 0 and table.kind[own] != SOLID:
                    u, v = np.float64(receivers.barycentric[index, 0]), np.float64(receivers.barycentric[index, 1])
                    faces, side = np.int64(facing_of[own]), np.int64(receivers.side[index])
                    closed = table.closed[table.material_id[own]]
                    if shadows_own(positions, triangles, own, faces, light_of, u, v, side, point, closed):
                        _through_own(receivers, table, dice, index, own, arriving)
                dark = arriving[0] == 0.0 and arriving[1] == 0.0 and arriving[2] == 0.0
            in_shadow[index] = dark
            for channel in range(CHANNELS):
                little = not dark and 0.0 < arriving[channel] < LEAST
                partial[index, channel] = LEAST if little else 0.0 if dark else arriving[channel]


@expand
def own_shares(triangles, barycentric, table, index, own):
    """What a sample's own triangle lets through where the sample lies."""
    if table.kind[own] == EVEN:
        m = table.material_id[own]
        return table.even[m, 0], table.even[m, 1], table.even[m, 2]
    u, v = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1])
    return passing(triangles, table, own, 1.0 - u - v, u, v)


@kernel
def leave_out(
    start, stop, positions, triangles, light, triangle, barycentric, side, facing_of, table, covered, in_shadow
):
    """Set samples `start` to `stop` in shadow where the own triangle is turned away and opaque; clears `covered`."""
    point = np.empty(3)
    for index in range(start, stop):
        own = triangle[index]
        if covered[index] and own >= 0 and side[index] * facing_of[own] < 0 and table.kind[own] != SOLID:
            red, green, blue = own_shares(triangles, barycentric, table, index, own)
            if red <= 0.0 and green <= 0.0 and blue <= 0.0:
                u, v = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1])
                faces, of_sample = np.int64(facing_of[own]), np.int64(side[index])
                closed = table.closed[table.material_id[own]]
                if shadows_own(positions, triangles, own, faces, light, u, v, of_sample, point, closed):
                    covered[index] = False
                    in_shadow[index] = True


@expand
def _through_own(receivers, table, dice, index, own, arriving):
    """Dim a sample's light by what its own triangle lets through."""
    red, green, blue = own_shares(receivers.triangles, receivers.barycentric, table, index, own)
    drawn = 0.0 if dice.strata == 0 else _drawn(dice, index, own)
    for channel, share in ((0, red), (1, green), (2, blue)):
        if dice.strata == 0:
            arriving[channel] *= share
        elif drawn < 1.0 - share:
            arriving[channel] = 0.0
