"""The oracle's floating-point half: which triangles surely shadow a sample, surely do not, or are left to rationals.

All vectors start at the sample P: a = A - P, b = B - P, c = C - P and l' = l - w P. With

    t_ab = l' . (a x b),  t_bc,  t_ca,  volume = a . (b x c),  facing = t_ab + t_bc + t_ca - w volume

the side planes of the definition have signs -t, the triangle's plane has -volume, and the triangle shadows the sample
when facing t >= 0 for all three t and facing volume > 0.

Error bound. Each component of a, b, c, l' has an absolute error of at most 2**-53 of its own size for the subtraction
plus 12 * 2**-53 of M, the largest magnitude of the own triangle's coordinates, for P itself. To first order a triple
product of three such vectors is off by at most (12 roundings of the terms + 3 perturbed factors) * 2**-53 times
6 (m + M)**3-like products of the sizes; we take 2**-46 * 6 * (|x| + M)(|y| + M)(|z| + M) with the vectors' largest
components |x|, |y|, |z|: coarse, but the oracle need not be quick, and `facing` sums four of them.
"""

import numpy as np

from umbrae.geometry.bvh import LEAF, STACK, segment_meets_box
from umbrae.geometry.predicates import FILTER, filtered_determinant
from umbrae.geometry.predicates import facing as side_of_light
from umbrae.parallel import inline, kernel
from umbrae.transmission import CLEAR, SOLID

_FILTER = 2.0**-46 * 6.0


@inline
def _place(positions, triangles, triangle, barycentric, free, sample, point):
    """Put the sample's float64 position into `point`; returns M (0 for a free point, which is exact)."""
    own = triangle[sample]
    magnitude = 0.0
    for axis in range(3):
        if own < 0:
            point[axis] = free[sample, axis]
        else:
            a = np.float64(positions[triangles[own, 0], axis])
            b = np.float64(positions[triangles[own, 1], axis])
            c = np.float64(positions[triangles[own, 2], axis])
            u, v = np.float64(barycentric[sample, 0]), np.float64(barycentric[sample, 1])
            point[axis] = a + u * (b - a) + v * (c - a)
            magnitude = max(magnitude, abs(a), abs(b), abs(c))
    return magnitude


@inline
def _triple(x, y, z):
    return x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0])


@inline
def _size(x):
    return max(abs(x[0]), abs(x[1]), abs(x[2]))


@inline
def _own_facing(positions, triangles, own, light, work):
    """(sign or 0, sure) of the light's side of the own plane."""
    e1, e2, toward = work[0], work[1], work[2]
    largest = 0.0
    for axis in range(3):
        a = np.float64(positions[triangles[own, 0], axis])
        b = np.float64(positions[triangles[own, 1], axis])
        c = np.float64(positions[triangles[own, 2], axis])
        e1[axis], e2[axis], toward[axis] = b - a, c - a, light[axis] - light[3] * a
        largest = max(largest, abs(a), abs(b), abs(c))
    value = _triple(toward, e1, e2)
    bound = _FILTER * _size(toward) * _size(e1) * _size(e2)
    if value > bound:
        return 1, True
    if value < -bound:
        return -1, True
    return 0, bound == 0.0


@inline
def _ask(positions, triangles, t, light, point, magnitude, work):
    """+1 surely shadows, -1 surely does not, 0 unsure."""
    a, b, c, toward = work[0], work[1], work[2], work[3]
    for axis in range(3):
        a[axis] = np.float64(positions[triangles[t, 0], axis]) - point[axis]
        b[axis] = np.float64(positions[triangles[t, 1], axis]) - point[axis]
        c[axis] = np.float64(positions[triangles[t, 2], axis]) - point[axis]
        toward[axis] = light[axis] - light[3] * point[axis]
    size_a, size_b, size_c = _size(a) + magnitude, _size(b) + magnitude, _size(c) + magnitude
    size_l = _size(toward) + light[3] * magnitude
    ab, bc, ca, volume = _triple(toward, a, b), _triple(toward, b, c), _triple(toward, c, a), _triple(a, b, c)
    e_ab, e_bc = _FILTER * size_l * size_a * size_b, _FILTER * size_l * size_b * size_c
    e_ca, e_volume = _FILTER * size_l * size_c * size_a, _FILTER * size_a * size_b * size_c
    facing = ab + bc + ca - light[3] * volume
    e_facing = 2.0 * (e_ab + e_bc + e_ca + light[3] * e_volume)
    if abs(facing) <= e_facing:
        # Whatever the facing is, two side planes with sure and opposite signs leave the sample outside.
        outside = (ab > e_ab and bc < -e_bc) or (ab < -e_ab and bc > e_bc) or (ab > e_ab and ca < -e_ca)
        outside = outside or (ab < -e_ab and ca > e_ca) or (bc > e_bc and ca < -e_ca) or (bc < -e_bc and ca > e_ca)
        return -1 if outside else 0
    if facing < 0.0:
        ab, bc, ca, volume = -ab, -bc, -ca, -volume
    if ab < -e_ab or bc < -e_bc or ca < -e_ca or volume < -e_volume:
        return -1
    if ab > e_ab and bc > e_bc and ca > e_ca and volume > e_volume:
        return 1
    return 0


@kernel
def decide_chunk(
    positions, triangles, lower, upper, order, first_leaf, kind, lights,
    triangle, barycentric, side, free, start, stop, verdict, pairs,
):  # fmt: skip
    """Set `verdict` to 1 where a solid triangle surely shadows; else list in `pairs` what else there is to know.

    `lights (n, 4)` has one for each sample.

    Rows of `pairs` are (sample, triangle, sure): triangles left open (0), and others than solid ones that surely shadow
    (1). With a row for each triangle `pairs` has room for any sample; where there is none for the next one, the work
    stops.

    Returns how many rows there are, and the sample to go on with.
    """
    stack = np.empty(STACK, np.int64)
    work = np.empty((4, 3))
    point, light = np.empty(3), np.empty(4)
    count = 0
    for sample in range(start, stop):
        for part in range(4):
            light[part] = lights[sample, part]
        own = triangle[sample]
        verdict[sample] = 0
        begin = count
        if own >= 0 and side[sample] != 0 and kind[own] != CLEAR:
            facing, sure = _own_facing(positions, triangles, own, light, work)
            if sure and facing * side[sample] < 0 and kind[own] == SOLID:
                verdict[sample] = 1
                continue
            if not sure or facing * side[sample] < 0:
                # On an edge it may belong to the neighbour.
                u, v = np.float64(barycentric[sample, 0]), np.float64(barycentric[sample, 1])
                sure = sure and u > 0.0 and v > 0.0 and u + v < 1.0
                if count == len(pairs):
                    return begin, sample
                pairs[count, 0], pairs[count, 1], pairs[count, 2] = sample, own, sure
                count += 1
        magnitude = _place(positions, triangles, triangle, barycentric, free, sample, point)
        depth = 1
        stack[0] = 0
        while depth > 0 and verdict[sample] == 0:
            depth -= 1
            node = stack[depth]
            if not segment_meets_box(point, light, lower, upper, node, 4.0 * 2.0**-50 * magnitude):
                continue
            if node < first_leaf:
                stack[depth], stack[depth + 1] = 2 * node + 2, 2 * node + 1
                depth += 2
                continue
            for slot in range((node - first_leaf) * LEAF, (node - first_leaf + 1) * LEAF):
                t = order[slot]
                if t < 0 or t == own or kind[t] == CLEAR:
                    continue
                answer = _ask(positions, triangles, t, light, point, magnitude, work)
                if answer > 0 and kind[t] == SOLID:
                    verdict[sample] = 1
                    count = begin
                    break
                if answer >= 0:
                    if count == len(pairs):
                        return begin, sample
                    pairs[count, 0], pairs[count, 1], pairs[count, 2] = sample, t, answer
                    count += 1
    return count, stop


@inline
def _frustum_distance(positions, triangles, t, light, point, magnitude, work):
    """Signed distance bound of a point to a triangle's shadow frustum: > 0 at least so far outside, < 0 so deep inside.

    The largest of the four signed plane distances, outside positive. nan for a triangle seen edge-on.
    """
    s = -side_of_light(positions, triangles, t, light)
    if s == 0:
        return np.nan
    a, b, c = work[0], work[1], work[2]
    for axis in range(3):
        a[axis] = np.float64(positions[triangles[t, 0], axis])
        b[axis] = np.float64(positions[triangles[t, 1], axis])
        c[axis] = np.float64(positions[triangles[t, 2], axis])
    w = light[3]
    result = -s * _plane_distance(b[0] - a[0], b[1] - a[1], b[2] - a[2], a, c, point, magnitude)
    for edge in range(3):
        v0, v1 = work[edge], work[(edge + 1) % 3]
        x, y, z = w * v0[0] - light[0], w * v0[1] - light[1], w * v0[2] - light[2]
        result = max(result, -s * _plane_distance(x, y, z, v0, v1, point, magnitude))
    return result


@inline
def _plane_distance(x, y, z, v0, v1, point, magnitude):
    """Signed distance of the point to the plane through v0 with normal (x, y, z) x (v1 - v0), never too large.

    The determinant less the bound of its error, over the length of the normal plus what its components may be off by
    (4 roundings of each product, see `geometry.predicates`).
    """
    ex, ey, ez = v1[0] - v0[0], v1[1] - v0[1], v1[2] - v0[2]
    value, bound = filtered_determinant(
        x, y, z, ex, ey, ez, point[0] - v0[0], point[1] - v0[1], point[2] - v0[2], magnitude
    )
    length = np.sqrt((y * ez - z * ey) ** 2 + (z * ex - x * ez) ** 2 + (x * ey - y * ex) ** 2)
    length += FILTER * (abs(y * ez) + abs(z * ey) + abs(z * ex) + abs(x * ez) + abs(x * ey) + abs(y * ex))
    if abs(value) <= bound:
        return 0.0
    return (value - bound if value > 0.0 else value + bound) / length


@kernel
def margin_chunk(
    positions, triangles, lower, upper, order, first_leaf, kind, lights,
    triangle, barycentric, side, free, start, stop, covered, in_shadow, margins,
):  # fmt: skip
    """Lower the entries of `margins` (a cap on entry) to each sample's margin; `lights (n, 4)` has a light for each."""
    stack = np.empty(STACK, np.int64)
    work = np.empty((4, 3))
    point, light = np.empty(3), np.empty(4)
    for sample in range(start, stop):
        if not covered[sample]:
            continue
        for part in range(4):
            light[part] = lights[sample, part]
        own = triangle[sample]
        if own >= 0 and side[sample] != 0:
            facing, _ = _own_facing(positions, triangles, own, light, work)
            if facing * side[sample] < 0 and kind[own] == SOLID:
                continue
        magnitude = _place(positions, triangles, triangle, barycentric, free, sample, point)
        cap = margins[sample]
        nearest, deepest = cap, 0.0
        depth = 1
        stack[0] = 0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            # A deeper one holds the sample as well.
            reach = 0.0 if deepest > 0.0 else nearest
            if not segment_meets_box(point, light, lower, upper, node, reach + 1e-12 * magnitude):
                continue
            if node < first_leaf:
                stack[depth], stack[depth + 1] = 2 * node + 2, 2 * node + 1
                depth += 2
                continue
            for slot in range((node - first_leaf) * LEAF, (node - first_leaf + 1) * LEAF):
                t = order[slot]
                if t < 0 or t == own or kind[t] == CLEAR:
                    continue
                distance = _frustum_distance(positions, triangles, t, light, point, magnitude, work)
                if distance < -deepest and in_shadow[sample] and kind[t] == SOLID:
                    deepest = -distance
                if abs(distance) < nearest:
                    nearest = abs(distance)
        margins[sample] = min(deepest, cap) if deepest > 0.0 else nearest
