"""Which pixels a projected triangle covers: boxes that miss nothing and signs that are never wrong.

A vertex is `(x, y, w)` in homogeneous pixel coordinates, float64: its picture is at column `x / w`, row `y /
w`, and `w` is its distance along the view direction, negative behind the eye. A pixel is the vector p =
(column, row, 1). The edge functional of P and Q is e(p) = det(P, Q, p), linear in p (Olano and Greer 1997,
"Triangle Scan Conversion using 2D Homogeneous Coordinates"). With s = sign(det(A, B, C)), the ray through p
meets the triangle in front of the eye exactly when s e(p) >= 0 for all three edges, whether the triangle
crosses the plane w = 0 or not.

Exactness is what makes neighbours watertight. The signs used are those of exact arithmetic on the float64
vertices, for the pixel moved by an infinitesimal (epsilon, epsilon squared): then no sign is zero unless the
triangle has no area, and of the triangles around a shared edge or vertex exactly one covers a pixel that lies
on it. This is the top-left rule: a pixel on a left edge, or on a level top edge, belongs to the triangle.

Filter. With e(p) = a x + b y + c, each of a = P_y Q_w - P_w Q_y, b and c carries two roundings relative to
the sum of its two products, and the evaluation adds at most three more on any path. With M the largest
magnitudes of the triangle's vertices and u = 2**-53, the error in a picture of width x height is at most 5 u
S + O(u**2), where

    S = 2 M_y M_w width + 2 M_w M_x height + 2 M_x M_y,

and that of the triangle's determinant likewise with S = 6 M_x M_y M_w. Both are below FILTER S = 8 u S, with
room for the roundings of S itself.
"""

import math

import numpy as np

from umbrae.geometry.expansion import grow, two_product
from umbrae.parallel import inline

FILTER = 2.0**-50

BOX_SLACK = 2.0**-20
"""Pixels added around a box: a quotient x / w below 2**17 is off by less than 2**-36."""

CLIP_SLACK = 2.0**-48
"""A vertex made by clipping is off by less than 8 u (|x_0| + |x_1|) before its division by `near`."""

QUANTA = float(1 << 24)
"""Barycentrics are multiples of 2**-24: float32 holds them, their sum and their complement exactly."""


Vertex = tuple[float, float, float]


@inline
def determinant_sign(p: Vertex, q: Vertex, r: Vertex) -> int:
    """Exact sign (-1, 0, 1) of the determinant with rows P, Q, R."""
    parts = np.empty(24)
    count = 0
    for a, b, c in (
        (p[1], q[2], r[0]),
        (-p[2], q[1], r[0]),
        (p[2], q[0], r[1]),
        (-p[0], q[2], r[1]),
        (p[0], q[1], r[2]),
        (-p[1], q[0], r[2]),
    ):
        product, rest = two_product(a, b)
        for factor in (rest, product):
            high, low = two_product(factor, c)
            if low != 0.0:
                count = grow(parts, count, low)
            if high != 0.0:
                count = grow(parts, count, high)
    if count == 0:
        return 0
    if parts[count - 1] > 0.0:
        return 1
    return -1 if parts[count - 1] < 0.0 else 0


@inline
def orientation(p: Vertex, q: Vertex, r: Vertex) -> int:
    """Exact sign of det(P, Q, R): 1 clockwise in the picture (rows grow downwards), -1 counter-clockwise."""
    a, b, c = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    value = a * r[0] + b * r[1] + c * r[2]
    x = max(abs(p[0]), abs(q[0]), abs(r[0]))
    y = max(abs(p[1]), abs(q[1]), abs(r[1]))
    w = max(abs(p[2]), abs(q[2]), abs(r[2]))
    bound = FILTER * 6.0 * x * y * w
    if value > bound:
        return 1
    if value < -bound:
        return -1
    sign: int = determinant_sign(p, q, r)
    return sign


@inline
def edge_sign(p: Vertex, q: Vertex, pixel: Vertex) -> int:
    """Exact sign of the edge functional at the pixel, moved infinitesimally; 0 only if P and Q coincide."""
    sign: int = determinant_sign(p, q, pixel)
    if sign == 0:
        sign = determinant_sign(p, q, (1.0, 0.0, 0.0))
    if sign == 0:
        sign = determinant_sign(p, q, (0.0, 1.0, 0.0))
    return sign


@inline
def covers(p: Vertex, q: Vertex, r: Vertex, s: int, pixel: Vertex) -> bool:
    """Whether the triangle of orientation `s` covers the pixel, in exact arithmetic."""
    least: int = min(s * edge_sign(p, q, pixel), s * edge_sign(q, r, pixel), s * edge_sign(r, p, pixel))
    return least > 0


@inline
def extent(p: Vertex, q: Vertex, r: Vertex, near: float, axis: int) -> tuple[float, float]:
    """Lowest and highest pixel coordinate (axis 0: column, 1: row) of the part with w >= near.

    Never too tight by a rounding; (inf, -inf) when nothing is left.
    """
    low, high = np.inf, -np.inf
    for a, b in ((p, q), (q, r), (r, p)):
        if a[2] >= near:
            at = a[axis] / a[2]
            low, high = min(low, at - BOX_SLACK), max(high, at + BOX_SLACK)
        if (a[2] >= near) != (b[2] >= near):
            share = (near - a[2]) / (b[2] - a[2])
            at = (a[axis] + share * (b[axis] - a[axis])) / near
            slack = BOX_SLACK + CLIP_SLACK * (abs(a[axis]) + abs(b[axis])) / near
            low, high = min(low, at - slack), max(high, at + slack)
    return low, high


@inline
def cells(low: float, high: float, first: float, last: float, count: int) -> tuple[int, int]:
    """First and last of `count` unit cells that may have a sample in [low, high]; last before first if none.

    Samples lie between `first` and `last` within a cell.
    """
    if not (low <= high) or high < 0.0 or low > count:
        return 0, -1
    return math.ceil(max(low - last, 0.0)), math.floor(min(high - first, count - 1.0))


@inline
def weights(a: Vertex, b: Vertex, c: Vertex, x: float, y: float) -> tuple[float, float]:
    """Perspective-correct shares of B and C in the point of the triangle that pixel (x, y) sees.

    The pixel is made the origin before the products are formed: what remains of the error is relative to the
    triangle's size in the picture, not to the picture's. Never negative; a third each where rounding leaves
    nothing of a sliver.
    """
    ax, ay = a[0] - x * a[2], a[1] - y * a[2]
    bx, by = b[0] - x * b[2], b[1] - y * b[2]
    cx, cy = c[0] - x * c[2], c[1] - y * c[2]
    wa, wb, wc = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
    if wa + wb + wc < 0.0:
        wa, wb, wc = -wa, -wb, -wc
    wa, wb, wc = max(wa, 0.0), max(wb, 0.0), max(wc, 0.0)
    total = wa + wb + wc
    if not 0.0 < total < np.inf:
        return 1.0 / 3.0, 1.0 / 3.0
    return wb / total, wc / total


@inline
def barycentric(a: Vertex, b: Vertex, c: Vertex, x: float, y: float) -> tuple[float, float]:
    """`weights` rounded to what a view sample holds: it is this point of the triangle, not the one beside it."""
    u, v = weights(a, b, c, x, y)
    held: tuple[float, float] = held_by_sample(u, v)
    return held


@inline
def held_by_sample(u: float, v: float) -> tuple[float, float]:
    """Barycentrics rounded to multiples of 2^-24 whose sum is at most 1."""
    u = np.rint(u * QUANTA) / QUANTA
    return u, min(np.rint(v * QUANTA) / QUANTA, 1.0 - u)
