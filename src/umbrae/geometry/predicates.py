"""The one predicate: does triangle t shadow this sample from this light?

Definition
----------
The light is homogeneous, L = (l, w) with w = 1 (a point) or w = 0 (a direction). For an edge from V0 to V1, the *side
plane* through the light and the edge has the normal

    N = (w V0 - l) x (V1 - V0)        and P lies on the side sign(N . (P - V0)),

which is the determinant of L, V0, V1, P whatever w is. With n = (B - A) x (C - A) the normal of t's own plane, the
light is on the side `facing` = sign(n . (l - w A)). A triangle with `facing` = 0 is edge-on or has no area; it casts
nothing. Otherwise t shadows the sample when, with s = -facing,

    s sign(side plane) >= 0 for all three edges (closed: a shared edge leaks nothing), and
    s sign(n . (P - A)) > 0 (strictly beyond the plane).

A sample on a surface lies infinitesimally off its own triangle, at P + e side n_own with e -> 0. Where a sign is zero
at P, the sign of (plane normal . side n_own) takes its place; where that is zero too, or the point is free, it is zero.

Filter
------
Signs are first computed in float64. Write r = w V0 - l, e = V1 - V0, d = P - V0 and c = r x e. Each component of r and
e carries one rounding, 2**-53 relative. Counting roundings along c . d (differences 1 each, product 1, difference 1,
product 1, two sums: at most 8 on any path) bounds the error by 8.1 * 2**-53 times the permanent
sum |r_y e_z| + |r_z e_y| over the components, each times |d|. A surface point P = A + u (B - A) + v (C - A) has itself
at most 12 roundings of numbers no larger than M = max |A|, |B|, |C|, which shifts d by at most 12 * 2**-53 M. Both are
covered, with room for the roundings of the bound itself, by

    |error| <= 2**-49 * sum over components of (|r_y e_z| + |r_z e_y|) (|d_x| + M).

A value below its bound is decided by `expansion.dot_sign`, exactly. Float64 neither overflows nor underflows here:
coordinates are at most 1e18 and at least 1e-45 in magnitude, or zero.

Counting
--------
Where what triangles let through is multiplied up, or volumes are counted, a shared edge must belong to exactly one of
its two triangles, so side planes are half-open (`closed` is False): a sign that is zero after all of the above becomes
that of the first component of N, x before y before z, that is not zero. It is the side of a point that is off by
(e, e**2, e**3), so that also of a fan of triangles around a vertex exactly one gets the sample.

Vertices that span a side plane are taken in lexicographic order of their positions (Sintorn et al. 2011, section 3;
Milet et al., Algorithm 2), so that two triangles which share an edge compute bitwise the same plane.
"""

import numpy as np

from umbrae.geometry.expansion import MAX_TERMS, dot_sign
from umbrae.parallel import expand, inline

FILTER = 2.0**-49


@inline
def after(positions, i, j):
    """Whether vertex i comes after vertex j in lexicographic order of position."""
    for axis in range(3):
        if positions[i, axis] != positions[j, axis]:
            return positions[i, axis] > positions[j, axis]
    return False


@inline
def filtered_determinant(rx, ry, rz, ex, ey, ez, dx, dy, dz, shift):
    """(r x e) . d in float64 and a bound of its error, where d may be off by 2**-49 `shift` per component."""
    x1, x2 = ry * ez, rz * ey
    y1, y2 = rz * ex, rx * ez
    z1, z2 = rx * ey, ry * ex
    value = (x1 - x2) * dx + (y1 - y2) * dy + (z1 - z2) * dz
    bound = FILTER * (
        (abs(x1) + abs(x2)) * (abs(dx) + shift)
        + (abs(y1) + abs(y2)) * (abs(dy) + shift)
        + (abs(z1) + abs(z2)) * (abs(dz) + shift)
    )
    return value, bound


@inline
def cross_terms(terms, start, sign, a, b):
    """Write a x b, two exact products per component, into `terms[:, start:start + 2]`."""
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        terms[axis, start] = sign * a[j] * b[k]
        terms[axis, start + 1] = -sign * a[k] * b[j]


@inline
def side_normal_terms(v0, v1, light):
    """N = w V0 x V1 + l x V0 - l x V1 as 6 exact summands per component."""
    terms = np.empty((3, MAX_TERMS))
    cross_terms(terms, 0, light[3], v0, v1)
    cross_terms(terms, 2, 1.0, light, v0)
    cross_terms(terms, 4, -1.0, light, v1)
    return terms


@inline
def plane_normal_terms(a, b, c):
    """n = (B - A) x (C - A) = A x B + B x C + C x A as 6 exact summands per component."""
    terms = np.empty((3, MAX_TERMS))
    cross_terms(terms, 0, 1.0, a, b)
    cross_terms(terms, 2, 1.0, b, c)
    cross_terms(terms, 4, 1.0, c, a)
    return terms


@inline
def vertex(positions, i):
    """A vertex as three float64."""
    point = np.empty(3)
    for axis in range(3):
        point[axis] = positions[i, axis]
    return point


@inline
def facing(positions, triangles, t, light):
    """Side of triangle t's plane the light is on: sign(n . (l - w A)); 0 edge-on or without area."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    w = light[3]
    ax, ay, az = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
    value, bound = filtered_determinant(
        np.float64(positions[j, 0]) - ax,
        np.float64(positions[j, 1]) - ay,
        np.float64(positions[j, 2]) - az,
        np.float64(positions[k, 0]) - ax,
        np.float64(positions[k, 1]) - ay,
        np.float64(positions[k, 2]) - az,
        light[0] - w * ax,
        light[1] - w * ay,
        light[2] - w * az,
        0.0,
    )
    if value > bound:
        return 1
    if value < -bound:
        return -1
    return exact_facing(positions, i, j, k, light)


@inline
def exact_facing(positions, i, j, k, light):
    """`facing` without the filter."""
    a, b, c = vertex(positions, i), vertex(positions, j), vertex(positions, k)
    toward = np.empty((3, MAX_TERMS))
    for axis in range(3):
        toward[axis, 0] = light[axis]
        toward[axis, 1] = -light[3] * a[axis]
    return dot_sign(toward, 2, plane_normal_terms(a, b, c), 6)


@expand
def surface_point(positions, triangles, own, u, v, point):
    """Put a sample's position in float64 into `point` and return M, the magnitude that bounds its rounding.

    A free point (`own` < 0) keeps the position `point` already has, and M is 0.
    """
    if own < 0:
        return 0.0
    magnitude = 0.0
    a, b, c = triangles[own, 0], triangles[own, 1], triangles[own, 2]
    for axis in range(3):
        xa = np.float64(positions[a, axis])
        xb = np.float64(positions[b, axis])
        xc = np.float64(positions[c, axis])
        point[axis] = xa + u * (xb - xa) + v * (xc - xa)
        magnitude = max(magnitude, abs(xa), abs(xb), abs(xc))
    return magnitude


@inline
def relative_point_terms(positions, triangles, own, u, v, point, base):
    """P - base as exact summands: A - u A + u B - v A + v C - base for a surface sample; returns (terms, count)."""
    terms = np.empty((3, MAX_TERMS))
    if own < 0:
        for axis in range(3):
            terms[axis, 0] = point[axis]
            terms[axis, 1] = -base[axis]
        return terms, 2
    a, b, c = triangles[own, 0], triangles[own, 1], triangles[own, 2]
    for axis in range(3):
        xa = np.float64(positions[a, axis])
        terms[axis, 0] = xa
        terms[axis, 1] = -u * xa
        terms[axis, 2] = u * positions[b, axis]
        terms[axis, 3] = -v * xa
        terms[axis, 4] = v * positions[c, axis]
        terms[axis, 5] = -base[axis]
    return terms, 6


@inline
def exact_sign(positions, triangles, own, u, v, side, point, base, normal):
    """Side of the plane through `base` with the exact `normal` (6 summands) that the sample is on."""
    terms, count = relative_point_terms(positions, triangles, own, u, v, point, base)
    sign = dot_sign(terms, count, normal, 6)
    if sign == 0 and side != 0 and own >= 0:
        a, b, c = triangles[own, 0], triangles[own, 1], triangles[own, 2]
        own_normal = plane_normal_terms(vertex(positions, a), vertex(positions, b), vertex(positions, c))
        sign = side * dot_sign(own_normal, 6, normal, 6)
    return sign


@inline
def side_value(positions, i, j, light, point, magnitude):
    """Filtered side-plane determinant of the edge from vertex i to j: (value, error bound)."""
    sign = 1.0
    if after(positions, i, j):
        i, j = j, i
        sign = -1.0
    w = light[3]
    x, y, z = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
    value, bound = filtered_determinant(
        w * x - light[0],
        w * y - light[1],
        w * z - light[2],
        np.float64(positions[j, 0]) - x,
        np.float64(positions[j, 1]) - y,
        np.float64(positions[j, 2]) - z,
        point[0] - x,
        point[1] - y,
        point[2] - z,
        magnitude,
    )
    return sign * value, bound


@inline
def plane_value(positions, i, j, k, point, magnitude):
    """Filtered determinant of the plane of vertices i, j, k at the point: (value, error bound)."""
    x, y, z = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
    return filtered_determinant(
        np.float64(positions[j, 0]) - x,
        np.float64(positions[j, 1]) - y,
        np.float64(positions[j, 2]) - z,
        np.float64(positions[k, 0]) - x,
        np.float64(positions[k, 1]) - y,
        np.float64(positions[k, 2]) - z,
        point[0] - x,
        point[1] - y,
        point[2] - z,
        magnitude,
    )


@inline
def exact_side(positions, triangles, i, j, light, own, u, v, side, point, closed):
    """Exact side of the side plane through the light and the edge from vertex i to j; 0 on it only if `closed`."""
    sign = 1
    if after(positions, i, j):
        i, j = j, i
        sign = -1
    v0 = vertex(positions, i)
    normal = side_normal_terms(v0, vertex(positions, j), light)
    found = exact_sign(positions, triangles, own, u, v, side, point, v0, normal)
    if found == 0 and not closed:
        found = leading_sign(normal)
    return sign * found


@inline
def leading_sign(normal):
    """Sign of the first component, of 6 exact summands each, that is not zero."""
    axis = np.zeros((3, MAX_TERMS))
    for along in range(3):
        axis[:, 0] = 0.0
        axis[along, 0] = 1.0
        found = dot_sign(axis, 1, normal, 6)
        if found != 0:
            return found
    return 0


SHADOWED = 1
EXACT = 2


@inline
def shadows(positions, triangles, t, facing_t, light, own, u, v, side, point, closed):
    """Whether triangle t (with nonzero `facing_t`) shadows the sample; its own triangle asks `shadows_own`.

    Parameters
    ----------
    positions, triangles
        `(v, 3) float32`, `(t, 3) int32`.
    light
        `(4,) float64` holding float32 values.
    own, u, v, side
        The sample's triangle (-1 for a free point), barycentrics (float64 holding float32 values) and side.
    point
        `(3,) float64`; a free point's position on entry, scratch space for others.
    closed
        Whether the side planes belong to the triangle, or one of each to the neighbour.

    Returns
    -------
    Flags: `SHADOWED` when shadowed, `EXACT` when the filter was unsure and exact arithmetic decided.
    """
    magnitude = surface_point(positions, triangles, own, u, v, point)
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    s = -facing_t
    s01, b01 = side_value(positions, i, j, light, point, magnitude)
    s12, b12 = side_value(positions, j, k, light, point, magnitude)
    s20, b20 = side_value(positions, k, i, light, point, magnitude)
    beyond, bound = plane_value(positions, i, j, k, point, magnitude)
    s01, s12, s20, beyond = s * s01, s * s12, s * s20, s * beyond
    if s01 < -b01 or s12 < -b12 or s20 < -b20 or beyond < -bound:
        return 0
    if s01 > b01 and s12 > b12 and s20 > b20 and beyond > bound:
        return SHADOWED
    if (
        own >= 0
        and same_triangle(positions, triangles, own, t)
        and side * facing(positions, triangles, own, light) >= 0
    ):
        return 0
    if s01 <= b01 and s * exact_side(positions, triangles, i, j, light, own, u, v, side, point, closed) < 0:
        return EXACT
    if s12 <= b12 and s * exact_side(positions, triangles, j, k, light, own, u, v, side, point, closed) < 0:
        return EXACT
    if s20 <= b20 and s * exact_side(positions, triangles, k, i, light, own, u, v, side, point, closed) < 0:
        return EXACT
    if beyond <= bound:
        a = vertex(positions, i)
        normal = plane_normal_terms(a, vertex(positions, j), vertex(positions, k))
        if s * exact_sign(positions, triangles, own, u, v, side, point, a, normal) <= 0:
            return EXACT
    return EXACT | SHADOWED


@inline
def shadows_own(positions, triangles, own, facing_own, light, u, v, side, point, closed):
    """Whether a sample's own triangle shadows it; parameters are those of `shadows`.

    It does where it is turned away from the light, but for a sample on an edge when it is not `closed`: there, as
    anywhere, only one of two neighbours counts, and that may be the other one.
    """
    if side * facing_own >= 0:
        return False
    if closed or (u > 0.0 and v > 0.0 and u + v < 1.0):
        return True
    return shadows(positions, triangles, own, facing_own, light, own, u, v, side, point, closed) & SHADOWED != 0


@expand
def hit_weights(positions, triangles, t, light, point):
    """Barycentrics of the place where the ray from a sample to the light meets triangle t, which shadows it.

    They are the sample's distances from the three side planes, scaled to add up to 1 (Sintorn et al. 2011, section
    3.2); `point` is its float64 position.
    """
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    c = abs(side_value(positions, i, j, light, point, 0.0)[0])
    a = abs(side_value(positions, j, k, light, point, 0.0)[0])
    b = abs(side_value(positions, k, i, light, point, 0.0)[0])
    total = a + b + c
    if total == 0.0:
        return 1.0, 0.0, 0.0
    return a / total, b / total, c / total


@inline
def same_triangle(positions, triangles, a, b):
    """Whether two triangles have the same three positions, in any order.

    Such a triangle lies in the plane of the sample. A sample whose own triangle is not turned away from the light is
    not strictly beyond that plane, so its duplicates cast nothing on it either.
    """
    for first in range(3):
        equal = True
        flipped = True
        for corner in range(3):
            i = triangles[a, corner]
            j = triangles[b, (first + corner) % 3]
            k = triangles[b, (first + 3 - corner) % 3]
            for axis in range(3):
                equal = equal and positions[i, axis] == positions[j, axis]
                flipped = flipped and positions[i, axis] == positions[k, axis]
        if equal or flipped:
            return True
    return False
