"""Vector code in kernels against NumPy."""

import numpy as np

from umbrae.methods.lanes import ALL, LANES, choose, count, equal, largest, lesser, load, lowest, smallest, splat
from umbrae.parallel import kernel


@kernel
def compute(numbers, whole, out, masks):
    a, b = load(numbers, 1, 3), load(numbers, 0, 0)
    two = np.float32(2.0)
    out[0], out[1] = smallest(abs(a) * two - b), largest(a + splat(two))
    masks[0], masks[1], masks[2], masks[3] = a < b, a <= two, a > b, a >= two
    masks[4], masks[5] = equal(whole, 1, 2, np.int8(5)), count(masks[0])
    masks[6] = lowest(masks[2])
    out[2] = largest(choose(np.int32(masks[0]), a, b))
    out[3] = largest(lesser(a, b))


def bits(verdicts):
    return int((verdicts.astype(int) << np.arange(LANES)).sum())


def test_lanes_compute_compare_and_choose_like_numpy():
    rng = np.random.default_rng(0)
    numbers = rng.normal(size=(2, 40)).astype(np.float32)
    numbers[1, 5], numbers[1, 9] = 2.0, np.nan  # equal to the bound; and a comparison that never holds
    whole = rng.integers(4, 7, (2, 30)).astype(np.int8)
    out, masks = np.zeros(4, np.float32), np.zeros(7, np.int64)
    compute(numbers, whole, out, masks)
    a, b = numbers[1, 3:19], numbers[0, :16]
    assert list(masks[:5]) == [bits(a < b), bits(a <= 2), bits(a > b), bits(a >= 2), bits(whole[1, 2:18] == 5)]
    assert masks[5] == (a < b).sum()
    assert masks[6] == np.argmax(a > b)
    assert out[0] == np.nanmin(abs(a) * np.float32(2) - b)
    assert out[1] == np.nanmax(a + np.float32(2))
    assert out[2] == np.nanmax(np.where(a < b, a, b))
    assert out[3] == np.nanmax(np.where(a < b, a, b))
    assert bits(np.ones(LANES, bool)) == ALL
