"""One triangle against one view sample and all of its light samples.

With a = A - P, b = B - P, c = C - P and D = l' - w P, where l' is a light sample, the side planes of the definition
(`geometry.predicates`) have the signs of -D . (a x b), -D . (b x c), -D . (c x a), the triangle's plane that of
-a . (b x c), and the light that of n . (l' - w A), with n = (B - A) x (C - A). Where the last two differ, the triangle
shadows the sample if none of the first three differs from the plane's.

Only D depends on the light sample: l' = l + d, so each determinant is a number for the light's middle and a product
with d, which float32 lanes work out for 16 light samples at once. A determinant m . (D_0 + d) is divided by
|m . D_0| + r |m|_1 before it is rounded to float32, and d by r (the disc's reach), so that no number exceeds 1:

    float32     rounding of the four numbers, of the products and of three sums: at most 6 * 2**-24 in all, `ROUNDING`
    float64     a component of a, b, c is off by 13 * 2**-53 of its size plus M (1 for the difference, 12 for a surface
                point, see `geometry.predicates`); so one of a x b by 56 * 2**-53 |a| |b| in the largest components,
                and its product with D by less than 512 * 2**-53 |D| |a| |b|, where |D| includes r: `_FILTER`

What these leave open is asked of the exact predicate, light sample by light sample.

Inside the loops no array is sliced, and none taken out of a tuple: counting references would cost more than all else.
"""

import numpy as np

from umbrae.geometry.predicates import EXACT, SHADOWED, facing, shadows, shadows_own, surface_point
from umbrae.geometry.vectors import cross, dot, row, subtract
from umbrae.methods.area_samples import fill_lights
from umbrae.methods.area_setup import STRADDLES
from umbrae.methods.area_transmission import dim_one, dim_pairs, is_closed, row_of
from umbrae.methods.lanes import ALL, LANES, lesser, load, lowest, splat
from umbrae.methods.sample_clusters import DARK, OWN, SAMPLE
from umbrae.methods.transmission_buffer import own_shares
from umbrae.parallel import expand, inline

MOST = 64
"""Light samples to a view sample: one bit each."""

ROUNDING = 2.0**-21
_FILTER = 2.0**-44

(PAIR_TESTS, FALLBACKS, EXACT_TESTS) = range(3)


@inline
def prepare(
    lane, own, index, positions, triangles, barycentric, position, first, disc, ready, place, lights, offsets, point,
):  # fmt: skip
    """Place a view sample and its light samples, unless that has been done.

    `ready (16,)`; `place (64,)` x, y, z and M, lane by lane; `lights (48, 64)` the light samples, three rows to a view
    sample; `offsets (48, 64)` the same as d / r, zero for those that do not exist.
    """
    if ready[lane]:
        return
    ready[lane] = True
    for axis in range(3):
        point[axis] = position[index, axis]
    u, v = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1])
    place[3 * LANES + lane] = surface_point(positions, triangles, own, u, v, point)
    for axis in range(3):
        place[axis * LANES + lane] = point[axis]
    x, y, z = position[index, 0], position[index, 1], position[index, 2]
    fill_lights(disc, first + index, x, y, z, lights, 3 * lane)
    inverse, count = 1.0 / disc.reach, len(disc.pattern)
    for axis in range(3):
        middle, at = disc.source[axis], 3 * lane + axis
        for i in range(count):
            offsets[at, i] = (lights[at, i] - middle) * inverse


@expand
def _scaled(m, toward, bound, reach, sign):
    """A determinant m . (D_0 + d), times a sign, as four numbers for `_values`, and what it may be off by."""
    base = dot(m, toward)
    size = abs(base) + reach * (abs(m[0]) + abs(m[1]) + abs(m[2]))
    factor = 1.0 / (size if size > 0.0 else 1.0)
    bound = bound * factor * 1.000001 + ROUNDING
    factor *= sign
    of_offset = reach * factor
    return base * factor, m[0] * of_offset, m[1] * of_offset, m[2] * of_offset, bound


@expand
def _values(offsets, start, at, base, x, y, z):
    """A determinant for 16 light samples."""
    value = load(offsets, start, at) * x + load(offsets, start + 1, at) * y + load(offsets, start + 2, at) * z
    return value + base


@expand
def _edge_values(offsets, start, at, scaled, k):
    """`_values` of an edge, whose numbers stand in `scaled` from `k` on."""
    return _values(offsets, start, at, scaled[k], scaled[k + LANES], scaled[k + 2 * LANES], scaled[k + 3 * LANES])


@expand
def _largest(a):
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    most = x if x > y else y
    return z if z > most else most


@expand
def _toward_light(positions, a, b, c, lx, ly, lz, w, reach):
    """n . (l' - w A) of a triangle, scaled, in float32."""
    corner = row(positions, a)
    e, f = subtract(row(positions, b), corner), subtract(row(positions, c), corner)
    toward = lx - w * corner[0], ly - w * corner[1], lz - w * corner[2]
    bound = _FILTER * (_largest(toward) + reach) * _largest(e) * _largest(f)
    base, x, y, z, bound = _scaled(cross(e, f), toward, bound, reach, 1.0)
    return np.float32(base), np.float32(x), np.float32(y), np.float32(z), np.float32(bound)


@expand
def _put(scaled, start, lane, base, x, y, z):
    scaled[start * LANES + lane], scaled[(start + 1) * LANES + lane] = base, x
    scaled[(start + 2) * LANES + lane], scaled[(start + 3) * LANES + lane] = y, z


BOUND, BEYOND = 12, 13


@inline
def _put_edges(va, vb, vc, side, lx, ly, lz, w, reach, place, scaled):
    """The three side planes of a triangle for 16 view samples at once: `scaled` `(14 * 16,) float32`.

    Four numbers each, then what they may be off by, then the side of the triangle's plane, as the light's: 1, -1, or 0
    where unsure. "Inside" is positive, as seen from a light on `side`, or (`side` = 0) across from the sample.
    """
    for lane in range(LANES):
        p, magnitude = (place[lane], place[LANES + lane], place[2 * LANES + lane]), place[3 * LANES + lane]
        a, b, c = subtract(va, p), subtract(vb, p), subtract(vc, p)
        ab, bc, ca = cross(a, b), cross(b, c), cross(c, a)
        size_a, size_b, size_c = _largest(a) + magnitude, _largest(b) + magnitude, _largest(c) + magnitude
        volume, bound = dot(a, bc), _FILTER * size_a * size_b * size_c
        beyond = 1.0 if volume > bound else (-1.0 if volume < -bound else 0.0)
        sign = side if side != 0.0 else (-1.0 if volume < 0.0 else 1.0)
        toward = lx - w * p[0], ly - w * p[1], lz - w * p[2]
        error = _FILTER * (_largest(toward) + w * magnitude + reach)
        base, x, y, z, bound_ab = _scaled(ab, toward, error * size_a * size_b, reach, sign)
        _put(scaled, 0, lane, base, x, y, z)
        base, x, y, z, bound_bc = _scaled(bc, toward, error * size_b * size_c, reach, sign)
        _put(scaled, 4, lane, base, x, y, z)
        base, x, y, z, bound_ca = _scaled(ca, toward, error * size_c * size_a, reach, sign)
        _put(scaled, 8, lane, base, x, y, z)
        scaled[BOUND * LANES + lane] = _largest((bound_ab, bound_bc, bound_ca))
        scaled[BEYOND * LANES + lane] = beyond


@inline
def own_dark(lane, own, positions, triangles, side, disc, lights, offsets, bits, light):
    """The bits of a view sample, with those of light samples on the other side of its own triangle's plane."""
    a, b, c = triangles[own, 0], triangles[own, 1], triangles[own, 2]
    lx, ly, lz, w = disc.source[0], disc.source[1], disc.source[2], disc.source[3]
    base, x, y, z, bound = _toward_light(positions, a, b, c, lx, ly, lz, w, disc.reach)
    count = len(disc.pattern)
    for at in range(0, count, LANES):
        value = _values(offsets, 3 * lane, at, base, x, y, z)
        before, behind = value > bound, value < -bound
        bits |= np.int64(behind if side > 0 else before) << at
        unsure = ~(before | behind) & ALL
        while unsure:
            i = at + np.int64(lowest(unsure))
            unsure &= unsure - np.int32(1)
            if i < count:
                light[0], light[1], light[2] = lights[3 * lane, i], lights[3 * lane + 1, i], lights[3 * lane + 2, i]
                light[3] = w
                if side * facing(positions, triangles, own, light) < 0:
                    bits |= np.int64(1) << i
    return bits


@inline
def own_dim(
    lane, own, index, own_side, positions, triangles, barycentric, side, disc, dimming, row, lights, offsets, dark,
    point, light,
):  # fmt: skip
    """Dim light samples on the other side of a view sample's own triangle; returns its bits with those that go dark."""
    hit = ~dark
    if own_side == 0:
        hit &= own_dark(lane, own, positions, triangles, side, disc, lights, offsets, np.int64(0), light)
    red, green, blue = own_shares(triangles, barycentric, dimming.table, index, own)
    u, v, closed = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1]), is_closed(dimming, own)
    light[3] = disc.source[3]
    for number in range(len(disc.pattern)):
        if hit >> number & 1 == 0:
            continue
        for axis in range(3):
            light[axis] = lights[3 * lane + axis, number]
        # `hit` says already that this light sample is on the other side.
        if not shadows_own(positions, triangles, own, -side, light, u, v, side, point, closed):
            continue
        if dim_one(dimming, row, index, number, own, red, green, blue):
            dark |= np.int64(1) << number
    return dark


@inline
def shade_lanes(
    maybe, slot, t, side_of_light, lx, ly, lz, w, reach, count, positions, triangles, barycentric, side, position,
    leaf_ids, place, scaled, lights, offsets, bits, dimming, leaf, point, light, stats,
):  # fmt: skip
    """Set the bits of those view samples in `maybe` whose light samples triangle t hides, or dim these light samples.

    `side_of_light` is that of t's plane which the light is on, or `STRADDLES`. Bits that are set already are not asked
    again. `dimming` is None for solid triangles, for others an `AreaDimming`, and `leaf` the number of the leaf in it.
    """
    closed = True if dimming is None else is_closed(dimming, t)
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    straddles = side_of_light == STRADDLES
    known_side = 0.0 if straddles else np.float64(side_of_light)
    _put_edges(row(positions, i), row(positions, j), row(positions, k), known_side, lx, ly, lz, w, reach, place, scaled)
    base, tx, ty, tz, limit = _toward_light(positions, i, j, k, lx, ly, lz, w, reach)
    while maybe:
        lane = np.int64(lowest(maybe))
        maybe &= maybe - np.int32(1)
        stats[PAIR_TESTS] += 1
        bound, beyond = scaled[BOUND * LANES + lane], scaled[BEYOND * LANES + lane]
        if beyond == -known_side and not straddles:
            continue
        index = np.int64(leaf_ids[slot, SAMPLE + lane])
        dark, start = bits[index], 3 * lane
        for at in range(0, count, LANES):
            todo = np.int32(~(dark >> at) & ALL)
            if todo == 0:
                continue
            u = _edge_values(offsets, start, at, scaled, 0 * LANES + lane)
            v = _edge_values(offsets, start, at, scaled, 4 * LANES + lane)
            x = _edge_values(offsets, start, at, scaled, 8 * LANES + lane)
            least = lesser(lesser(u, v), x)
            outside, inside = least < -bound, least > bound
            if beyond == 0:
                inside = np.int32(0)
                if straddles:
                    # Which sign says "inside" is unknown; but it is the same for all three.
                    zero = splat(np.float32(0.0))
                    outside &= lesser(lesser(zero - u, zero - v), zero - x) < -bound
            elif straddles:
                value = _values(offsets, start, at, base, tx, ty, tz)
                before, behind = value > limit, value < -limit
                outside |= behind if beyond > 0 else before
                inside &= before if beyond > 0 else behind
            hit, unsure = inside & todo, todo & ~inside & ~outside
            while unsure:
                bit = lowest(unsure)
                unsure &= unsure - np.int32(1)
                number = at + np.int64(bit)
                for axis in range(3):
                    light[axis], point[axis] = lights[start + axis, number], position[index, axis]
                light[3] = w
                if _settle(
                    positions, triangles, t, light, np.int64(leaf_ids[slot, OWN + lane]), barycentric[index, 0],
                    barycentric[index, 1], side[index], point, closed, stats,
                ):  # fmt: skip
                    hit |= np.int32(1) << bit
            if dimming is not None:
                light[3] = w
                hit = dim_pairs(
                    dimming, hit, at, row_of(leaf, lane), lane, index, t, positions, triangles, lights, place, light,
                    point,
                )  # fmt: skip
            dark |= np.int64(hit) << at
        bits[index] = dark
        if dark == -1:
            leaf_ids[slot, OWN + lane] = DARK


@inline
def _settle(positions, triangles, t, light, own, u, v, side, point, closed, stats):
    """Whether triangle t stands before one light sample, by the predicate."""
    stats[FALLBACKS] += 1
    towards = facing(positions, triangles, t, light)
    if towards == 0:
        return 0
    answer = shadows(
        positions, triangles, t, towards, light, own, np.float64(u), np.float64(v), np.int64(side), point, closed
    )
    if answer & EXACT:
        stats[EXACT_TESTS] += 1
    return answer & SHADOWED


@expand
def darken(leaf_ids, slot, lane, bits):
    """Put a view sample that sees nothing of the light out of the way."""
    bits[leaf_ids[slot, SAMPLE + lane]] = -1
    leaf_ids[slot, OWN + lane] = DARK
