"""Triangle set-up: bounds, facing and the four planes of a cluster of 16 shadow frusta in a light frame.

Loops over the lanes are written so that LLVM makes vector code of them: no branches, no calls that stay calls, arrays
indexed by whole rows and a constant plus the lane.

A plane that vanishes at the light reads a x + b y + c in the frame, the triangle's own plane a x + b y + c + d q (see
`light_frame`); all are oriented so that a sample in shadow has positive values. Let N = (w V0 - l) x (V1 - V0) be a
side plane's normal and n the triangle's. Then, with P = (x, y, ...) in window units X = x0 + hx x and so on:

    point light:        N . P' / Z = N_a X + N_b Y + g N_c              n . (P - V0) / Z = n_a X + n_b Y + g n_c + F Q
    directional light:  N . (P - V0) = N_a X + N_b Y - N . V0           n . (P - V0) = n_a X + n_b Y - n . V0 + F Q

with F = n . (l - w V0), over |l_c| for a directional light, and N . V0 there also being N_a X(V0) + N_b Y(V0).

Errors. N and n come from float64 differences and products: each component is off by less than 2**-50 of its
permanent m (two products of two factors with one rounding each; hence edges are differences of positions, not of
positions relative to the light, which are rounded already). The value of the plane anywhere in the window is therefore
off by at most 2**-49 (m_a |X| + m_b |Y| + m_c |1| + |Q| m_F) with the magnitudes of V0 added to |X|, |Y| for a
directional light, 2**-49 instead of 2**-50 for the sums. Dividing a plane by |a| + |b| + |c| makes this the `bound`
of the row; `FLOAT_ERROR` covers rounding the coefficients to float32 (2**-24 each) and evaluating up to four terms in
float32 (2**-24 for each product and sum, at most 4 on a path): 5.01 * 2**-24 of |a| + |b| + |c| + |d q|, as |x|,
|y| <= 1. The part that grows with q, which is not bounded by its window near a point light, has a bound per unit of q.
Multiplying by a rounded reciprocal instead of dividing adds 2**-53, which all of these margins hold many times over.

Range. d is kept below `LARGEST_D` by dividing by more than |a| + |b| + |c| where need be, and |q| stays below
`sample_clusters.LARGEST_Q`: their product is a float32 number.
"""

import numpy as np

from umbrae.methods.lanes import LANES
from umbrae.parallel import expand, inline

FLOAT_ERROR = 6.0 * 2.0**-24

ROW = 16
"""Numbers per frustum: 3 x (a, b, c), then a, b, c, d, then three bounds.

Those of the sides, of the triangle's plane where q = 0, and what is added to the latter per unit of |q|.
"""

BOUND_SIDES, BOUND_PLANE, BOUND_Q = 13, 14, 15

PLANES = ROW * LANES
"""Numbers per cluster: one of all lanes, then the next."""

RECT_XMIN, RECT_XMAX, RECT_YMIN, RECT_YMAX, RECT_QMAX = range(5)

RECTS = 5 * LANES

LARGEST_D = 2.0**64


@expand
def _corner(corners, cluster, number, a, b, c, lane):
    """A corner of a lane's triangle, its axes in the order `a, b, c`."""
    return (
        np.float64(corners[cluster, number, a, lane]),
        np.float64(corners[cluster, number, b, lane]),
        np.float64(corners[cluster, number, c, lane]),
    )


@expand
def _least(x, y, z):
    least = x if x < y else y
    return z if z < least else least


@expand
def _largest(x, y, z):
    largest = x if x > y else y
    return z if z > largest else largest


@inline
def side_of_light(corners, cluster, light, side):
    """Write the side of 16 triangles' planes that the light is on, 1.0 or -1.0, into `side`; 0.0 where unsure.

    Edges are off by 2**-53 of themselves and so is the vertex relative to a point light; with the
    roundings of the products and sums that is less than 2**-49 of the sum of all products' magnitudes.
    """
    la, lb, lc, w = light[0], light[1], light[2], light[3]
    for lane in range(LANES):
        a0, b0, c0 = _corner(corners, cluster, 0, 0, 1, 2, lane)
        a1, b1, c1 = _corner(corners, cluster, 1, 0, 1, 2, lane)
        a2, b2, c2 = _corner(corners, cluster, 2, 0, 1, 2, lane)
        ea, eb, ec, fa, fb, fc = a1 - a0, b1 - b0, c1 - c0, a2 - a0, b2 - b0, c2 - c0
        m1, m2, m3, m4, m5, m6 = eb * fc, ec * fb, ec * fa, ea * fc, ea * fb, eb * fa
        ra, rb, rc = la - w * a0, lb - w * b0, lc - w * c0
        value = (m1 - m2) * ra + (m3 - m4) * rb + (m5 - m6) * rc
        bound = (abs(m1) + abs(m2)) * abs(ra) + (abs(m3) + abs(m4)) * abs(rb) + (abs(m5) + abs(m6)) * abs(rc)
        bound = 2.0**-49 * bound
        side[lane] = 1.0 if value > bound else (-1.0 if value < -bound else 0.0)


@inline
def bound_frusta(corners, cluster, light, frame, rects, k):
    """Bounds of 16 frusta in the frame, `rects[k]`: infinite where a vertex lies behind it, empty where all do.

    2**-50 of the coordinates and of the window's place covers the float64 roundings, 2**-22 that to float32. Empty
    bounds (inf to -inf) still meet the infinite box around samples of unsure direction, as they must.
    """
    axis_a, axis_b, axis_c = frame.axis_a, frame.axis_b, frame.axis_c
    la, lb, lc = light[axis_a], light[axis_b], light[axis_c]
    sx, sy, sq = 1.0 / frame.hx, 1.0 / frame.hy, 1.0 / frame.hq
    fx, fy, fq = frame.x0, frame.y0, frame.q0
    if light[3] != 0.0:
        g = frame.sign
        for lane in range(LANES):
            a0, b0, c0 = _corner(corners, cluster, 0, axis_a, axis_b, axis_c, lane)
            a1, b1, c1 = _corner(corners, cluster, 1, axis_a, axis_b, axis_c, lane)
            a2, b2, c2 = _corner(corners, cluster, 2, axis_a, axis_b, axis_c, lane)
            a0, b0, z0 = a0 - la, b0 - lb, g * (c0 - lc)
            a1, b1, z1 = a1 - la, b1 - lb, g * (c1 - lc)
            a2, b2, z2 = a2 - la, b2 - lb, g * (c2 - lc)
            reach = (
                _largest(abs(a0), abs(a1), abs(a2))
                + _largest(abs(b0), abs(b1), abs(b2))
                + _largest(abs(z0), abs(z1), abs(z2))
            )
            front = _least(z0, z1, z2) > 2.0**-40 * reach
            behind = _largest(z0, z1, z2) <= 0.0
            q0, q1, q2 = 1.0 / z0, 1.0 / z1, 1.0 / z2
            x0, x1, x2, y0, y1, y2 = a0 * q0, a1 * q1, a2 * q2, b0 * q0, b1 * q1, b2 * q2
            ex = 2.0**-50 * (_largest(abs(x0), abs(x1), abs(x2)) + abs(fx))
            ey = 2.0**-50 * (_largest(abs(y0), abs(y1), abs(y2)) + abs(fy))
            eq = 2.0**-50 * (_largest(q0, q1, q2) + abs(fq))
            xmin, xmax = (_least(x0, x1, x2) - ex - fx) * sx, (_largest(x0, x1, x2) + ex - fx) * sx
            ymin, ymax = (_least(y0, y1, y2) - ey - fy) * sy, (_largest(y0, y1, y2) + ey - fy) * sy
            qmax = (_largest(q0, q1, q2) + eq - fq) * sq
            wide_x = 2.0**-22 * _largest(1.0, -xmin, xmax)
            wide_y = 2.0**-22 * _largest(1.0, -ymin, ymax)
            outside = -np.inf if behind else np.inf
            rects[k, RECT_XMIN * LANES + lane] = xmin - wide_x if front else -outside
            rects[k, RECT_XMAX * LANES + lane] = xmax + wide_x if front else outside
            rects[k, RECT_YMIN * LANES + lane] = ymin - wide_y if front else -outside
            rects[k, RECT_YMAX * LANES + lane] = ymax + wide_y if front else outside
            rects[k, RECT_QMAX * LANES + lane] = qmax + 2.0**-22 * _largest(1.0, qmax, -qmax) if front else outside
    else:
        slope_a, slope_b, g = frame.slope_a, frame.slope_b, frame.sign
        for lane in range(LANES):
            a0, b0, c0 = _corner(corners, cluster, 0, axis_a, axis_b, axis_c, lane)
            a1, b1, c1 = _corner(corners, cluster, 1, axis_a, axis_b, axis_c, lane)
            a2, b2, c2 = _corner(corners, cluster, 2, axis_a, axis_b, axis_c, lane)
            reach = (
                _largest(abs(a0), abs(a1), abs(a2))
                + _largest(abs(b0), abs(b1), abs(b2))
                + _largest(abs(c0), abs(c1), abs(c2))
            )
            x0, x1, x2 = a0 - slope_a * c0, a1 - slope_a * c1, a2 - slope_a * c2
            y0, y1, y2 = b0 - slope_b * c0, b1 - slope_b * c1, b2 - slope_b * c2
            ex, ey, eq = (
                2.0**-50 * (reach + abs(fx)), 2.0**-50 * (reach + abs(fy)), 2.0**-50 * (reach + abs(fq)),
            )  # fmt: skip
            xmin, xmax = (_least(x0, x1, x2) - ex - fx) * sx, (_largest(x0, x1, x2) + ex - fx) * sx
            ymin, ymax = (_least(y0, y1, y2) - ey - fy) * sy, (_largest(y0, y1, y2) + ey - fy) * sy
            qmax = (_largest(g * c0, g * c1, g * c2) + eq - fq) * sq
            wide_x = 2.0**-22 * _largest(1.0, -xmin, xmax)
            wide_y = 2.0**-22 * _largest(1.0, -ymin, ymax)
            rects[k, RECT_XMIN * LANES + lane] = xmin - wide_x
            rects[k, RECT_XMAX * LANES + lane] = xmax + wide_x
            rects[k, RECT_YMIN * LANES + lane] = ymin - wide_y
            rects[k, RECT_YMAX * LANES + lane] = ymax + wide_y
            rects[k, RECT_QMAX * LANES + lane] = qmax + 2.0**-22 * _largest(1.0, qmax, -qmax)


@expand
def _side(rows, k, at, hx, hy, x0, y0, na, nb, constant, error, inside):
    """Store a side plane in window units, divided by |a| + |b| + |c|; returns its float64 error bound after that."""
    c = constant + na * x0 + nb * y0
    a, b = na * hx, nb * hy
    size = abs(a) + abs(b) + abs(c)
    factor = 1.0 / (size if size > 0.0 else 1.0)
    signed = inside * factor
    rows[k, at], rows[k, at + LANES], rows[k, at + 2 * LANES] = a * signed, b * signed, c * signed
    return 2.0**-49 * error * factor


@expand
def _point_side(rows, k, at, frame, inside, reach_a, reach_b, ra, rb, rc, ea, eb, ec):
    """Side plane of the edge (ea, eb, ec) from the vertex (ra, rb, rc), both relative to a point light."""
    a1, a2 = rb * ec, rc * eb
    b1, b2 = rc * ea, ra * ec
    c1, c2 = ra * eb, rb * ea
    error = (abs(a1) + abs(a2)) * reach_a + (abs(b1) + abs(b2)) * reach_b + abs(c1) + abs(c2)
    return _side(
        rows, k, at, frame.hx, frame.hy, frame.x0, frame.y0, a1 - a2, b1 - b2, frame.sign * (c1 - c2), error, inside
    )


@expand
def _parallel_side(rows, k, at, frame, inside, reach_a, reach_b, light_a, light_b, light_c, x, y, ea, eb, ec):
    """Side plane of the edge (ea, eb, ec) from a vertex at x, y, along a directional light."""
    a1, a2 = light_c * eb, light_b * ec
    b1, b2 = light_a * ec, light_c * ea
    na, nb = a1 - a2, b1 - b2
    error = (abs(a1) + abs(a2)) * reach_a + (abs(b1) + abs(b2)) * reach_b
    return _side(rows, k, at, frame.hx, frame.hy, frame.x0, frame.y0, na, nb, -(na * x + nb * y), error, inside)


@expand
def _own_plane(rows, k, at, frame, inside, na, nb, constant, towards, error, error_q):
    """Store the triangle's own plane in window units with its bounds."""
    constant = constant + na * frame.x0 + nb * frame.y0 + towards * frame.q0
    na, nb, towards = na * frame.hx, nb * frame.hy, towards * frame.hq
    size = _largest(abs(na) + abs(nb) + abs(constant), abs(towards) * (1.0 / LARGEST_D), 0.0)
    factor = 1.0 / (size if size > 0.0 else 1.0)
    error = 2.0**-49 * factor * (error + error_q * abs(frame.q0))
    error_q = 2.0**-49 * factor * error_q * frame.hq
    rows[k, at + 5 * LANES] = error * 1.000001 + FLOAT_ERROR
    rows[k, at + 6 * LANES] = error_q * 1.000001 + FLOAT_ERROR * abs(towards) * factor
    signed = inside * factor
    rows[k, at], rows[k, at + LANES], rows[k, at + 2 * LANES] = na * signed, nb * signed, constant * signed
    rows[k, at + 3 * LANES] = towards * signed


@inline
def put_planes(corners, cluster, facing_of, light, frame, rows, k):
    """The planes of 16 frusta: `rows[k]`; `facing_of` `(clusters, 16)` are the sides that the light is on."""
    axis_a, axis_b, axis_c = frame.axis_a, frame.axis_b, frame.axis_c
    la, lb, lc = light[axis_a], light[axis_b], light[axis_c]
    reach_a, reach_b = abs(frame.x0) + frame.hx, abs(frame.y0) + frame.hy
    g, slope_a, slope_b = frame.sign, frame.slope_a, frame.slope_b
    if light[3] != 0.0:
        for lane in range(LANES):
            a0, b0, c0 = _corner(corners, cluster, 0, axis_a, axis_b, axis_c, lane)
            a1, b1, c1 = _corner(corners, cluster, 1, axis_a, axis_b, axis_c, lane)
            a2, b2, c2 = _corner(corners, cluster, 2, axis_a, axis_b, axis_c, lane)
            ea, eb, ec, fa, fb, fc = a1 - a0, b1 - b0, c1 - c0, a2 - a0, b2 - b0, c2 - c0
            ga, gb, gc = a2 - a1, b2 - b1, c2 - c1
            m1, m2, m3, m4, m5, m6 = eb * fc, ec * fb, ec * fa, ea * fc, ea * fb, eb * fa
            na, nb, nc = m1 - m2, m3 - m4, m5 - m6
            ma, mb, mc = abs(m1) + abs(m2), abs(m3) + abs(m4), abs(m5) + abs(m6)
            a0, b0, c0, a1, b1, c1 = a0 - la, b0 - lb, c0 - lc, a1 - la, b1 - lb, c1 - lc
            a2, b2, c2 = a2 - la, b2 - lb, c2 - lc
            towards = -(na * a0 + nb * b0 + nc * c0)
            error_q = ma * abs(a0) + mb * abs(b0) + mc * abs(c0)
            inside = -1.0 if facing_of[cluster, lane] > 0 else 1.0
            at = lane
            bound = _largest(
                _point_side(rows, k, at, frame, inside, reach_a, reach_b, a0, b0, c0, ea, eb, ec),
                _point_side(rows, k, at + 3 * LANES, frame, inside, reach_a, reach_b, a1, b1, c1, ga, gb, gc),
                _point_side(rows, k, at + 6 * LANES, frame, inside, reach_a, reach_b, a2, b2, c2, -fa, -fb, -fc),
            )
            rows[k, at + BOUND_SIDES * LANES] = bound * 1.000001 + FLOAT_ERROR
            error = ma * reach_a + mb * reach_b + mc
            _own_plane(rows, k, at + 9 * LANES, frame, inside, na, nb, g * nc, towards, error, error_q)
    else:
        for lane in range(LANES):
            a0, b0, c0 = _corner(corners, cluster, 0, axis_a, axis_b, axis_c, lane)
            a1, b1, c1 = _corner(corners, cluster, 1, axis_a, axis_b, axis_c, lane)
            a2, b2, c2 = _corner(corners, cluster, 2, axis_a, axis_b, axis_c, lane)
            reach = (
                _largest(abs(a0), abs(a1), abs(a2))
                + _largest(abs(b0), abs(b1), abs(b2))
                + _largest(abs(c0), abs(c1), abs(c2))
            )
            ea, eb, ec, fa, fb, fc = a1 - a0, b1 - b0, c1 - c0, a2 - a0, b2 - b0, c2 - c0
            ga, gb, gc = a2 - a1, b2 - b1, c2 - c1
            m1, m2, m3, m4, m5, m6 = eb * fc, ec * fb, ec * fa, ea * fc, ea * fb, eb * fa
            na, nb, nc = m1 - m2, m3 - m4, m5 - m6
            ma, mb, mc = abs(m1) + abs(m2), abs(m3) + abs(m4), abs(m5) + abs(m6)
            towards = na * la + nb * lb + nc * lc
            inside = -1.0 if facing_of[cluster, lane] > 0 else 1.0
            at = lane
            ra, rb = reach_a + reach, reach_b + reach
            x0, x1, x2 = a0 - slope_a * c0, a1 - slope_a * c1, a2 - slope_a * c2
            y0, y1, y2 = b0 - slope_b * c0, b1 - slope_b * c1, b2 - slope_b * c2
            bound = _largest(
                _parallel_side(rows, k, at, frame, inside, ra, rb, la, lb, lc, x0, y0, ea, eb, ec),
                _parallel_side(rows, k, at + 3 * LANES, frame, inside, ra, rb, la, lb, lc, x1, y1, ga, gb, gc),
                _parallel_side(rows, k, at + 6 * LANES, frame, inside, ra, rb, la, lb, lc, x2, y2, -fa, -fb, -fc),
            )
            rows[k, at + BOUND_SIDES * LANES] = bound * 1.000001 + FLOAT_ERROR
            constant = -(na * a0 + nb * b0 + nc * c0)
            error = ma * ra + mb * rb + mc * reach
            scale = 1.0 / abs(lc)
            _own_plane(rows, k, at + 9 * LANES, frame, inside, na, nb, constant, towards * scale, error, ma + mb + mc)
