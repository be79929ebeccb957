"""One triangle against one view sample and all of its light samples.

With a = A - P, b = B - P, c = C - P and D = l' - w P, where l' is a light sample, the side planes of the definition
(`geometry.predicates`) have the signs of -D . (a x b), -D . (b x c), -D . (c x a), the triangle's plane that of
-a . (b x c), and the light that of n . (l' - w A), with n = (B - A) x (C - A). Where the last two agree, the triangle
shadows the sample if the first three agree with them as well.

Only D depends on the light sample: l' = l + d, so each determinant is a number for the light's middle and a product
with d, which float32 lanes work out for 16 light samples at once. A determinant m . (D_0 + d) is divided by
|m . D_0| + r |m|_1 before it is rounded to float32, and d by r (the disc's reach), so that no number exceeds 1:

    float32     rounding of the four numbers, of the products and of three sums: at most 6 * 2**-24 in all, `ROUNDING`
    float64     a component of a, b, c is off by 13 * 2**-53 of its size plus M (1 for the difference, 12 for a surface
                point, see `geometry.predicates`); so one of a x b by 56 * 2**-53 |a| |b| in the largest components,
                and its product with D by less than 512 * 2**-53 |D| |a| |b|, where |D| includes r: `_FILTER`

What these leave open is asked of the exact predicate, light sample by light sample.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import EXACT, SHADOWED, facing, shadows, surface_point
from umbrae.geometry.vectors import cross, dot, row, subtract
from umbrae.methods.area_samples import fill_lights
from umbrae.methods.area_setup import STRADDLES
from umbrae.methods.lanes import LANES, load
from umbrae.methods.sample_clusters import DARK, OWN, SAMPLE
from umbrae.parallel import inline

MOST = 64
"""Light samples to a view sample: one bit each."""

ROUNDING = 2.0**-21
_FILTER = 2.0**-44

(PAIR_TESTS, FALLBACKS, EXACT_TESTS) = range(3)


class Casting(NamedTuple):
    """The scene, and the side of its triangles' planes that the light is on (see `area_setup.disc_sides`)."""

    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    own_side: NDArray[np.int8]


class Asking(NamedTuple):
    """View samples, flat; `first` is the number of those before them in the whole picture."""

    barycentric: NDArray[np.float32]
    side: NDArray[np.int8]
    position: NDArray[np.float32]
    first: int


class Lit(NamedTuple):
    """What is known of the view samples of one leaf, once they are asked about.

    `ready (16,)`; `point (16, 3)` and `magnitude (16,)` their places and M; `light (48, 64)` the light samples, three
    rows to a view sample; `offset (48, 64)` the same as d / r; `scratch (2, 4)`.
    """

    ready: NDArray[np.bool_]
    point: NDArray[np.float64]
    magnitude: NDArray[np.float64]
    light: NDArray[np.float32]
    offset: NDArray[np.float32]
    scratch: NDArray[np.float64]


@inline
def new_leaf():
    """Room for one leaf; offsets of light samples that do not exist stay zero."""
    return Lit(
        np.zeros(LANES, np.bool_),
        np.empty((LANES, 3)),
        np.empty(LANES),
        np.zeros((3 * LANES, MOST), np.float32),
        np.zeros((3 * LANES, MOST), np.float32),
        np.zeros((2, 4)),
    )


@inline
def _prepare(lit, lane, own, index, casting, asking, disc):
    """Place a view sample and its light samples, unless that has been done."""
    if lit.ready[lane]:
        return
    lit.ready[lane] = True
    point = lit.scratch[0]
    for axis in range(3):
        point[axis] = asking.position[index, axis]
    lit.magnitude[lane] = surface_point(
        casting.positions, casting.triangles, own, np.float64(asking.barycentric[index, 0]),
        np.float64(asking.barycentric[index, 1]), point,
    )  # fmt: skip
    lit.point[lane, 0], lit.point[lane, 1], lit.point[lane, 2] = point[0], point[1], point[2]
    x, y, z = asking.position[index, 0], asking.position[index, 1], asking.position[index, 2]
    fill_lights(disc, asking.first + index, x, y, z, lit.light, 3 * lane)
    inverse = 1.0 / disc.reach
    for axis in range(3):
        middle = disc.source[axis]
        for i in range(len(disc.pattern)):
            lit.offset[3 * lane + axis, i] = (lit.light[3 * lane + axis, i] - middle) * inverse


@inline
def _scaled(m, toward, bound, reach, sign):
    """A determinant m . (D_0 + d), times a sign, as float32 numbers for `_values`, and what it may be off by."""
    base = dot(m, toward)
    size = abs(base) + reach * (abs(m[0]) + abs(m[1]) + abs(m[2]))
    factor = 1.0 / size if size > 0.0 else 0.0
    bound = np.float32(bound * factor * 1.000001 + ROUNDING)
    factor *= sign
    of_offset = reach * factor
    return (
        np.float32(base * factor),
        np.float32(m[0] * of_offset),
        np.float32(m[1] * of_offset),
        np.float32(m[2] * of_offset),
        bound,
    )


@inline
def _values(offset, start, at, scaled):
    """A determinant for 16 light samples."""
    x, y, z = load(offset, start, at), load(offset, start + 1, at), load(offset, start + 2, at)
    return x * scaled[1] + y * scaled[2] + z * scaled[3] + scaled[0]


@inline
def _largest(a):
    return max(abs(a[0]), abs(a[1]), abs(a[2]))


@inline
def _toward_light(positions, a, b, c, source, reach):
    """n . (l' - w A) of a triangle, scaled."""
    corner = row(positions, a)
    e, f = subtract(row(positions, b), corner), subtract(row(positions, c), corner)
    w = source[3]
    toward = source[0] - w * corner[0], source[1] - w * corner[1], source[2] - w * corner[2]
    n = cross(e, f)
    bound = _FILTER * (_largest(toward) + reach) * _largest(e) * _largest(f)
    return _scaled(n, toward, bound, reach, 1.0)


@inline
def own_dark(lit, lane, own, index, casting, asking, disc, bits):
    """The bits of a view sample, with those of light samples on the other side of its own triangle's plane."""
    _prepare(lit, lane, own, index, casting, asking, disc)
    a, b, c = casting.triangles[own, 0], casting.triangles[own, 1], casting.triangles[own, 2]
    towards = _toward_light(casting.positions, a, b, c, disc.source, disc.reach)
    for group in range(-(-len(disc.pattern) // LANES)):
        value = _values(lit.offset, 3 * lane, LANES * group, towards)
        before, behind = value > towards[4], value < -towards[4]
        bits |= np.int64(behind if asking.side[index] > 0 else before) << (LANES * group)
        unsure = np.int64(~(before | behind)) << (LANES * group)
        for i in range(LANES * group, min(LANES * (group + 1), len(disc.pattern))):
            if unsure >> i & 1:
                light = _light(lit, lane, i, disc)
                if asking.side[index] * facing(casting.positions, casting.triangles, own, light) < 0:
                    bits |= np.int64(1) << i
    return bits


@inline
def _light(lit, lane, i, disc):
    """One light sample as a homogeneous light."""
    light = lit.scratch[1]
    for axis in range(3):
        light[axis] = lit.light[3 * lane + axis, i]
    light[3] = disc.source[3]
    return light


@inline
def darkened(lit, lane, own, index, t, side, casting, asking, disc, bits, stats):
    """The bits of a view sample, with those of light samples that triangle t hides from it.

    `side` is that of t's plane which the light is on, or `STRADDLES`. Bits that are set already are not asked again.
    """
    _prepare(lit, lane, own, index, casting, asking, disc)
    stats[PAIR_TESTS] += 1
    positions, reach, source, w = casting.positions, disc.reach, disc.source, disc.source[3]
    i, j, k = casting.triangles[t, 0], casting.triangles[t, 1], casting.triangles[t, 2]
    point, magnitude = row(lit.point, lane), lit.magnitude[lane]
    a, b, c = subtract(row(positions, i), point), subtract(row(positions, j), point), subtract(row(positions, k), point)
    ab, bc, ca = cross(a, b), cross(b, c), cross(c, a)
    largest_a, largest_b, largest_c = _largest(a) + magnitude, _largest(b) + magnitude, _largest(c) + magnitude
    volume, bound = dot(a, bc), _FILTER * largest_a * largest_b * largest_c
    beyond = 1 if volume > bound else (-1 if volume < -bound else 0)
    if side != STRADDLES and beyond == -side:
        return bits
    # Which sign says "inside": that of the light's side, or of the sample's, one of which must be known.
    sign = side if side != STRADDLES else beyond
    flip = -1.0 if sign < 0 else 1.0
    toward = source[0] - w * point[0], source[1] - w * point[1], source[2] - w * point[2]
    error = _FILTER * (_largest(toward) + w * magnitude + reach)
    first = _scaled(ab, toward, error * largest_a * largest_b, reach, flip)
    second = _scaled(bc, toward, error * largest_b * largest_c, reach, flip)
    third = _scaled(ca, toward, error * largest_c * largest_a, reach, flip)
    towards = first
    if side == STRADDLES:
        towards = _toward_light(positions, i, j, k, source, reach)
    for group in range(-(-len(disc.pattern) // LANES)):
        at = LANES * group
        todo = np.int32(~(bits >> at) & 0xFFFF)
        if todo == 0:
            continue
        u = _values(lit.offset, 3 * lane, at, first)
        v = _values(lit.offset, 3 * lane, at, second)
        x = _values(lit.offset, 3 * lane, at, third)
        outside = (u < -first[4]) | (v < -second[4]) | (x < -third[4])
        inside = (u > first[4]) & (v > second[4]) & (x > third[4])
        if sign == 0:
            outside &= (u > first[4]) | (v > second[4]) | (x > third[4])
        elif side == STRADDLES:
            value = _values(lit.offset, 3 * lane, at, towards)
            before, behind = value > towards[4], value < -towards[4]
            outside |= behind if sign > 0 else before
            inside &= before if sign > 0 else behind
        if beyond == 0:
            inside = np.int32(0)
        bits |= np.int64(inside & todo) << at
        unsure = todo & ~inside & ~outside
        if unsure:
            bits |= _settle(lit, lane, own, index, t, np.int64(unsure) << at, at, casting, asking, disc, stats)
    return bits


@inline
def _settle(lit, lane, own, index, t, unsure, start, casting, asking, disc, stats):
    """The bits of those light samples of `unsure` that triangle t hides, by the predicate."""
    found = np.int64(0)
    point = lit.scratch[0]
    for i in range(start, min(start + LANES, len(disc.pattern))):
        if unsure >> i & 1:
            light = _light(lit, lane, i, disc)
            stats[FALLBACKS] += 1
            towards = facing(casting.positions, casting.triangles, t, light)
            if towards == 0:
                continue
            for axis in range(3):
                point[axis] = asking.position[index, axis]
            answer = shadows(
                casting.positions, casting.triangles, t, towards, light, own,
                np.float64(asking.barycentric[index, 0]), np.float64(asking.barycentric[index, 1]),
                np.int64(asking.side[index]), point, True,
            )  # fmt: skip
            if answer & EXACT:
                stats[EXACT_TESTS] += 1
            if answer & SHADOWED:
                found |= np.int64(1) << i
    return found


@inline
def darken(leaf_ids, slot, lane, bits):
    """Put a view sample that sees nothing of the light out of the way."""
    bits[leaf_ids[slot, SAMPLE + lane]] = -1
    leaf_ids[slot, OWN + lane] = DARK
