"""Exact signs of sums of products of float32 numbers (Shewchuk 1997, "Adaptive Precision Floating-Point Arithmetic").

The shadow predicate needs nothing but signs of

    dot = sum over x, y, z of (a_1 + a_2 + ...) (b_1 + b_2 + ...)

where every a and b is one float32 number or a product of two. A product of two float32 numbers (24 bits each) is an
exact float64 (53 bits), and a product of any two float64 numbers is exactly a pair of them (`two_product`). So the sum
is a sum of float64 numbers without any rounding, collected in an expansion: numbers that do not overlap, ordered by
magnitude, of which the last one has the sign of the whole.

Range: with coordinates up to 1e18 the products stay below 1e80. A product of two float32 numbers is a multiple of
2**-298, so are all parts of a sum of them, and what these are multiplied to has parts that are multiples of 2**-596.
Neither end of float64's range is ever near.
"""

import numpy as np

from umbrae.parallel import inline

_SPLITTER = 134217729.0  # 2**27 + 1: splits 53 bits into two halves of 26 (Dekker 1971)

MAX_TERMS = 8
"""Room for the summands of one component (a surface point relative to a vertex has 6, a plane's normal 6)."""

_MAX_PARTS = 2 * 3 * MAX_TERMS * MAX_TERMS


@inline
def two_sum(a, b):
    """a + b as rounded sum and exact error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@inline
def two_product(a, b):
    """a * b as rounded product and exact error (Dekker, Veltkamp); no fused operation needed."""
    product = a * b
    scaled = _SPLITTER * a
    a_high = scaled - (scaled - a)
    a_low = a - a_high
    scaled = _SPLITTER * b
    b_high = scaled - (scaled - b)
    b_low = b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@inline
def grow(parts, count, value):
    """Add one number to an expansion in place; returns its new length (Shewchuk's GROW-EXPANSION, zeros dropped)."""
    kept = 0
    for i in range(count):
        value, error = two_sum(value, parts[i])
        if error != 0.0:
            parts[kept] = error
            kept += 1
    if value != 0.0:
        parts[kept] = value
        kept += 1
    return kept


@inline
def dot_sign(a, a_count, b, b_count):
    """Sign (-1, 0, +1) of the dot product of two vectors whose components are sums.

    `a` and `b` are `(3, MAX_TERMS)` float64; `a_count` and `b_count` say how many summands each component has. Each
    summand must be a float32 number or a product of two. Each component is summed up before it is multiplied: of six
    summands one to three parts are left as a rule, and so a tenth of the products.
    """
    parts, a_parts, b_parts = np.empty(_MAX_PARTS), np.empty(MAX_TERMS), np.empty(MAX_TERMS)
    count = 0
    for axis in range(3):
        a_length = b_length = 0
        for i in range(a_count):
            a_length = grow(a_parts, a_length, a[axis, i])
        for j in range(b_count):
            b_length = grow(b_parts, b_length, b[axis, j])
        for i in range(a_length):
            for j in range(b_length):
                product, error = two_product(a_parts[i], b_parts[j])
                if error != 0.0:
                    count = grow(parts, count, error)
                count = grow(parts, count, product)
    if count == 0:
        return 0
    return 1 if parts[count - 1] > 0.0 else -1


@inline
def rounded_sum(terms, axis, count):
    """The sum of `terms[axis, :count]`, off by at most 4 * 2**-53 of itself, whatever cancels.

    With ties rounded to even, `grow` leaves no two parts with adjacent bits (Shewchuk, theorem 10): the last one is at
    most twice the sum, and adding the parts from the smallest up rounds no more than that.
    """
    parts = np.empty(MAX_TERMS)
    length = 0
    for i in range(count):
        length = grow(parts, length, terms[axis, i])
    total = 0.0
    for i in range(length):
        total += parts[i]
    return total
