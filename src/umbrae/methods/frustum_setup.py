"""Triangle set-up: the four planes and the bounds of a batch of shadow frusta in a light frame.

A plane that vanishes at the light reads a x + b y + c there, the triangle's own plane a x + b y + c + d q (see
`light_frame`); all are oriented so that a sample in shadow has positive values. Let N = (w V0 - l) x (V1 - V0) be a
side plane's normal and n the triangle's. Then, with P = (x, y, ...) in window units X = x0 + hx x and so on:

    point light:        N . P' / Z = N_a X + N_b Y + g N_c              n . (P - V0) / Z = n_a X + n_b Y + g n_c + F Q
    directional light:  N . (P - V0) = N_a X + N_b Y - N . V0           n . (P - V0) = n_a X + n_b Y - n . V0 + F Q

with F = n . (l - w V0), over |l_c| for a directional light, and N . V0 there also being N_a X(V0) + N_b Y(V0).

Errors. N and n come from float64 differences and products: each component is off by less than 2**-50 of its
permanent m (two products of two rounded factors). The value of the plane anywhere in the window is therefore off by
at most 2**-49 (m_a |X| + m_b |Y| + m_c |1| + |Q| m_F) with the magnitudes of V0 added to |X|, |Y| for a directional
light, 2**-49 instead of 2**-50 for the sums. Dividing a plane by |a| + |b| + |c| makes this the `bound` of the row;
`FLOAT_ERROR` covers rounding the coefficients to float32 (2**-24 each) and evaluating up to four terms in float32
(2**-24 for each product and sum, at most 4 on a path): 5.01 * 2**-24 of |a| + |b| + |c| + |d q|, as |x|, |y| <= 1.
"""

import numpy as np

from umbrae.parallel import inline

FLOAT_ERROR = 6.0 * 2.0**-24

ROW = 16
"""Numbers per frustum: 3 x (a, b, c), then a, b, c, d, then the bounds of the sides and of the triangle's plane."""

BOUND_SIDES, BOUND_PLANE = 13, 14


@inline
def _put_plane(row, start, a, b, c, d, error, frame, scale):
    """Store a plane in window units, divided by |a| + |b| + |c|; returns its float64 error bound after that."""
    c = c + a * frame[6] + b * frame[7] + d * frame[8]
    a, b, d = a * frame[9], b * frame[10], d * frame[11]
    size = abs(a) + abs(b) + abs(c)
    if size <= 0.0:
        size = abs(d)
    if size <= 0.0:
        size = 1.0
    factor = scale / size
    row[start], row[start + 1], row[start + 2] = a * factor, b * factor, c * factor
    if d != 0.0:
        row[start + 3] = d * factor
    return error * abs(factor)


@inline
def project(point, light, frame, out):
    """Window coordinates of a vertex (relative to the light when that is a point) into `out`; False when not in front.

    `out` holds x, y, q and a bound of the error of each.
    """
    a, b, c = np.int64(frame[0]), np.int64(frame[1]), np.int64(frame[2])
    pa, pb, pc = point[a], point[b], point[c]
    if light[3] == 0.0:
        x, y, q = pa - frame[4] * pc, pb - frame[5] * pc, frame[3] * pc
        error = 2.0**-50 * (abs(pa) + abs(pb) + abs(pc))
        error_q = 0.0
    else:
        z = frame[3] * pc
        if z <= 2.0**-40 * (abs(pa) + abs(pb)):
            return False
        x, y, q = pa / z, pb / z, 1.0 / z
        error = 2.0**-50 * max(abs(x), abs(y))
        error_q = 2.0**-50 * q
    out[0], out[1], out[2] = (x - frame[6]) / frame[9], (y - frame[7]) / frame[10], (q - frame[8]) / frame[11]
    # 2**-22 leaves room for rounding the bounds to float32.
    out[3] = (error + 2.0**-50 * abs(frame[6])) / frame[9] + 2.0**-22 * max(1.0, abs(out[0]))
    out[4] = (error + 2.0**-50 * abs(frame[7])) / frame[10] + 2.0**-22 * max(1.0, abs(out[1]))
    out[5] = (error_q + 2.0**-50 * abs(frame[8])) / frame[11] + 2.0**-22 * max(1.0, abs(out[2]))
    return True


@inline
def frustum_bounds(vertices, light, frame, scratch, rect):
    """Bounds (xmin, xmax, ymin, ymax, qmax) in window units; infinite where a vertex is not in front of the light."""
    rect[0], rect[2] = np.inf, np.inf
    rect[1], rect[3], rect[4] = -np.inf, -np.inf, -np.inf
    for corner in range(3):
        if not project(vertices[corner], light, frame, scratch):
            rect[0], rect[2] = -np.inf, -np.inf
            rect[1], rect[3], rect[4] = np.inf, np.inf, np.inf
            return
        rect[0] = min(rect[0], scratch[0] - scratch[3])
        rect[1] = max(rect[1], scratch[0] + scratch[3])
        rect[2] = min(rect[2], scratch[1] - scratch[4])
        rect[3] = max(rect[3], scratch[1] + scratch[4])
        rect[4] = max(rect[4], scratch[2] + scratch[5])


@inline
def frustum_planes(vertices, light, facing, frame, row):
    """The four planes of a triangle's frustum; `vertices` (3, 3) float64 minus w l, `facing` +1 or -1."""
    w = light[3]
    a, b, c = np.int64(frame[0]), np.int64(frame[1]), np.int64(frame[2])
    g = frame[3]
    inside = -1.0 if facing > 0 else 1.0
    reach_a, reach_b = abs(frame[6]) + frame[9], abs(frame[7]) + frame[10]
    reach_c = 1.0
    if w == 0.0:
        for corner in range(3):
            far = abs(vertices[corner, a]) + abs(vertices[corner, b]) + abs(vertices[corner, c])
            reach_c = max(reach_c, far)
        reach_a, reach_b = reach_a + reach_c, reach_b + reach_c
    bound = 0.0
    for edge in range(3):
        v0, v1 = edge, (edge + 1) % 3
        # w V0 - l is the vertex itself when that is given relative to a point light.
        ra = vertices[v0, a] if w != 0.0 else -light[a]
        rb = vertices[v0, b] if w != 0.0 else -light[b]
        rc = vertices[v0, c] if w != 0.0 else -light[c]
        ea, eb, ec = vertices[v1, a] - vertices[v0, a], vertices[v1, b] - vertices[v0, b], vertices[v1, c] - vertices[v0, c]
        na, nb, nc = rb * ec - rc * eb, rc * ea - ra * ec, ra * eb - rb * ea
        ma, mb, mc = abs(rb * ec) + abs(rc * eb), abs(rc * ea) + abs(ra * ec), abs(ra * eb) + abs(rb * ea)
        if w != 0.0:
            constant = g * nc
            error = ma * reach_a + mb * reach_b + mc
        else:
            xa = vertices[v0, a] - frame[4] * vertices[v0, c]
            xb = vertices[v0, b] - frame[5] * vertices[v0, c]
            constant = -(na * xa + nb * xb)
            error = ma * reach_a + mb * reach_b
        error = _put_plane(row, 3 * edge, na, nb, constant, 0.0, 2.0**-49 * error, frame, inside)
        bound = max(bound, error)
    row[BOUND_SIDES] = bound * 1.000001 + FLOAT_ERROR
    e1a, e1b, e1c = vertices[1, a] - vertices[0, a], vertices[1, b] - vertices[0, b], vertices[1, c] - vertices[0, c]
    e2a, e2b, e2c = vertices[2, a] - vertices[0, a], vertices[2, b] - vertices[0, b], vertices[2, c] - vertices[0, c]
    na, nb, nc = e1b * e2c - e1c * e2b, e1c * e2a - e1a * e2c, e1a * e2b - e1b * e2a
    ma, mb, mc = abs(e1b * e2c) + abs(e1c * e2b), abs(e1c * e2a) + abs(e1a * e2c), abs(e1a * e2b) + abs(e1b * e2a)
    va, vb, vc = vertices[0, a], vertices[0, b], vertices[0, c]
    reach_q = abs(frame[8]) + frame[11]
    if w != 0.0:
        towards = -(na * va + nb * vb + nc * vc)
        constant = g * nc
        error = ma * reach_a + mb * reach_b + mc
        error_q = ma * abs(va) + mb * abs(vb) + mc * abs(vc)
    else:
        scale = 1.0 / abs(light[c])
        towards = (na * light[a] + nb * light[b] + nc * light[c]) * scale
        constant = -(na * va + nb * vb + nc * vc)
        error = ma * reach_a + mb * reach_b + mc * reach_c
        error_q = (ma + mb + mc) * 1.000001
    row[12] = 0.0
    error = _put_plane(row, 9, na, nb, constant, towards, 2.0**-49 * (error + error_q * reach_q), frame, inside)
    row[BOUND_PLANE] = error * 1.000001 + FLOAT_ERROR
