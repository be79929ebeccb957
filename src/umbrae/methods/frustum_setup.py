"""Triangle set-up: the four planes and the bounds of a batch of shadow frusta in a light frame.

A plane that vanishes at the light reads a x + b y + c there, the triangle's own plane a x + b y + c + d q (see
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

Range. d is kept below `LARGEST_D` by dividing by more than |a| + |b| + |c| where need be, and |q| stays below
`sample_clusters.LARGEST_Q`: their product is a float32 number.
"""

import numpy as np

from umbrae.methods.sample_tree import QMIN, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import inline

FLOAT_ERROR = 6.0 * 2.0**-24

ROW = 16
"""Numbers per frustum: 3 x (a, b, c), then a, b, c, d, then three bounds.

Those of the sides, of the triangle's plane where q = 0, and what is added to the latter per unit of |q|.
"""

BOUND_SIDES, BOUND_PLANE, BOUND_Q = 13, 14, 15

LARGEST_D = 2.0**64


@inline
def _edge(positions, i, j, axis):
    """One component of the edge from vertex i to j, rounded once."""
    return np.float64(positions[j, axis]) - np.float64(positions[i, axis])


@inline
def _put_side(row, start, frame, na, nb, constant, error, inside):
    """Store a side plane in window units, divided by |a| + |b| + |c|; returns its float64 error bound after that."""
    c = constant + na * frame.x0 + nb * frame.y0
    a, b = na * frame.hx, nb * frame.hy
    size = abs(a) + abs(b) + abs(c)
    factor = 1.0 / size if size > 0.0 else 1.0
    row[start], row[start + 1], row[start + 2] = inside * a * factor, inside * b * factor, inside * c * factor
    return 2.0**-49 * error * factor


@inline
def _point_side(row, start, frame, inside, reach_a, reach_b, ra, rb, rc, ea, eb, ec):
    """Side plane of the edge (ea, eb, ec) from the vertex (ra, rb, rc), both relative to a point light."""
    a1, a2 = rb * ec, rc * eb
    b1, b2 = rc * ea, ra * ec
    c1, c2 = ra * eb, rb * ea
    error = (abs(a1) + abs(a2)) * reach_a + (abs(b1) + abs(b2)) * reach_b + abs(c1) + abs(c2)
    return _put_side(row, start, frame, a1 - a2, b1 - b2, frame.sign * (c1 - c2), error, inside)


@inline
def _parallel_side(row, start, frame, inside, reach_a, reach_b, light_a, light_b, light_c, x, y, ea, eb, ec):
    """Side plane of the edge (ea, eb, ec) from a vertex at x, y, along a directional light."""
    a1, a2 = light_c * eb, light_b * ec
    b1, b2 = light_a * ec, light_c * ea
    na, nb = a1 - a2, b1 - b2
    error = (abs(a1) + abs(a2)) * reach_a + (abs(b1) + abs(b2)) * reach_b
    return _put_side(row, start, frame, na, nb, -(na * x + nb * y), error, inside)


@inline
def set_up_frustum(positions, i, j, k, light, facing, frame, box, root, rect, row):
    """Bounds and planes of the frustum of the triangle (i, j, k), which the light sees from side `facing` (+1 or -1).

    Writes `rect` (xmin, xmax, ymin, ymax, qmax; infinite where a vertex lies behind a point light's frame) and `row`.
    Returns False, with `row` untouched, when the frustum holds no sample in the box of `root`: all vertices behind
    the frame (which says nothing about samples of unsure direction, for which the box is infinite), or the bounds
    outside the box.
    """
    w = light[3]
    a, b, c = frame.axis_a, frame.axis_b, frame.axis_c
    light_a, light_b, light_c = light[a], light[b], light[c]
    a0, b0, c0 = positions[i, a] - w * light_a, positions[i, b] - w * light_b, positions[i, c] - w * light_c
    a1, b1, c1 = positions[j, a] - w * light_a, positions[j, b] - w * light_b, positions[j, c] - w * light_c
    a2, b2, c2 = positions[k, a] - w * light_a, positions[k, b] - w * light_b, positions[k, c] - w * light_c
    reach = max(abs(a0), abs(a1), abs(a2)) + max(abs(b0), abs(b1), abs(b2)) + max(abs(c0), abs(c1), abs(c2))
    if w != 0.0:
        z0, z1, z2 = frame.sign * c0, frame.sign * c1, frame.sign * c2
        if max(z0, z1, z2) <= 0.0 and box[XMIN, root] > -np.inf:
            return False
        in_front = min(z0, z1, z2) > 2.0**-40 * reach
        if in_front:
            q0, q1, q2 = 1.0 / z0, 1.0 / z1, 1.0 / z2
            x0, y0, x1, y1, x2, y2 = a0 * q0, b0 * q0, a1 * q1, b1 * q1, a2 * q2, b2 * q2
            error_x = 2.0**-50 * max(abs(x0), abs(x1), abs(x2))
            error_y = 2.0**-50 * max(abs(y0), abs(y1), abs(y2))
            error_q = 2.0**-50 * max(q0, q1, q2)
        else:
            x0 = x1 = x2 = y0 = y1 = y2 = q0 = q1 = q2 = error_x = error_y = error_q = 0.0
    else:
        in_front = True
        x0, y0, q0 = a0 - frame.slope_a * c0, b0 - frame.slope_b * c0, frame.sign * c0
        x1, y1, q1 = a1 - frame.slope_a * c1, b1 - frame.slope_b * c1, frame.sign * c1
        x2, y2, q2 = a2 - frame.slope_a * c2, b2 - frame.slope_b * c2, frame.sign * c2
        error_x = error_y = error_q = 2.0**-50 * reach
    if in_front:
        # 2**-50 of the window's place covers moving into the window, 2**-22 the rounding to float32.
        error_x, error_y = error_x + 2.0**-50 * abs(frame.x0), error_y + 2.0**-50 * abs(frame.y0)
        error_q = error_q + 2.0**-50 * abs(frame.q0)
        xmin, xmax = (
            (min(x0, x1, x2) - error_x - frame.x0) / frame.hx,
            (max(x0, x1, x2) + error_x - frame.x0) / frame.hx,
        )
        ymin, ymax = (
            (min(y0, y1, y2) - error_y - frame.y0) / frame.hy,
            (max(y0, y1, y2) + error_y - frame.y0) / frame.hy,
        )
        qmax = (max(q0, q1, q2) + error_q - frame.q0) / frame.hq
        wide_x = 2.0**-22 * max(1.0, -xmin, xmax)
        wide_y = 2.0**-22 * max(1.0, -ymin, ymax)
        rect[0], rect[1] = xmin - wide_x, xmax + wide_x
        rect[2], rect[3] = ymin - wide_y, ymax + wide_y
        rect[4] = qmax + 2.0**-22 * max(1.0, abs(qmax))
    else:
        rect[0], rect[2] = -np.inf, -np.inf
        rect[1], rect[3], rect[4] = np.inf, np.inf, np.inf
    if (
        rect[0] > box[XMAX, root]
        or rect[1] < box[XMIN, root]
        or rect[2] > box[YMAX, root]
        or rect[3] < box[YMIN, root]
        or rect[4] < box[QMIN, root]
    ):
        return False
    inside = -1.0 if facing > 0 else 1.0
    reach_a, reach_b = abs(frame.x0) + frame.hx, abs(frame.y0) + frame.hy
    ea, eb, ec = _edge(positions, i, j, a), _edge(positions, i, j, b), _edge(positions, i, j, c)
    fa, fb, fc = _edge(positions, i, k, a), _edge(positions, i, k, b), _edge(positions, i, k, c)
    ga, gb, gc = _edge(positions, j, k, a), _edge(positions, j, k, b), _edge(positions, j, k, c)
    m1, m2, m3, m4, m5, m6 = eb * fc, ec * fb, ec * fa, ea * fc, ea * fb, eb * fa
    na, nb, nc = m1 - m2, m3 - m4, m5 - m6
    ma, mb, mc = abs(m1) + abs(m2), abs(m3) + abs(m4), abs(m5) + abs(m6)
    if w != 0.0:
        bound = max(
            _point_side(row, 0, frame, inside, reach_a, reach_b, a0, b0, c0, ea, eb, ec),
            _point_side(row, 3, frame, inside, reach_a, reach_b, a1, b1, c1, ga, gb, gc),
            _point_side(row, 6, frame, inside, reach_a, reach_b, a2, b2, c2, -fa, -fb, -fc),
        )
        towards = -(na * a0 + nb * b0 + nc * c0)
        constant = frame.sign * nc
        error = ma * reach_a + mb * reach_b + mc
        error_q = ma * abs(a0) + mb * abs(b0) + mc * abs(c0)
    else:
        reach_a, reach_b = reach_a + reach, reach_b + reach
        bound = max(
            _parallel_side(row, 0, frame, inside, reach_a, reach_b, light_a, light_b, light_c, x0, y0, ea, eb, ec),
            _parallel_side(row, 3, frame, inside, reach_a, reach_b, light_a, light_b, light_c, x1, y1, ga, gb, gc),
            _parallel_side(row, 6, frame, inside, reach_a, reach_b, light_a, light_b, light_c, x2, y2, -fa, -fb, -fc),
        )
        towards = (na * light_a + nb * light_b + nc * light_c) / abs(light_c)
        constant = -(na * a0 + nb * b0 + nc * c0)
        error = ma * reach_a + mb * reach_b + mc * reach
        error_q = ma + mb + mc
    row[BOUND_SIDES] = bound * 1.000001 + FLOAT_ERROR
    constant = constant + na * frame.x0 + nb * frame.y0 + towards * frame.q0
    na, nb, towards = na * frame.hx, nb * frame.hy, towards * frame.hq
    size = max(abs(na) + abs(nb) + abs(constant), abs(towards) / LARGEST_D)
    factor = 1.0 / size if size > 0.0 else 1.0
    error = 2.0**-49 * factor * (error + error_q * abs(frame.q0))
    error_q = 2.0**-49 * factor * error_q * frame.hq
    row[BOUND_PLANE] = error * 1.000001 + FLOAT_ERROR
    row[BOUND_Q] = error_q * 1.000001 + FLOAT_ERROR * abs(towards) * factor
    factor = inside * factor
    row[9], row[10], row[11], row[12] = na * factor, nb * factor, constant * factor, towards * factor
    return True
