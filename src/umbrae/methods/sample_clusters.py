"""Leaves of the view-sample hierarchy: tiles of samples in light-frame coordinates, cut at gaps."""

import numpy as np

from umbrae.methods.light_frame import (
    AXIS_C,
    POSITION_ERROR,
    Q0,
    SCALE_Q,
    SCALE_X,
    SCALE_Y,
    SIGN,
    SLOPE_A,
    SLOPE_B,
    X0,
    Y0,
)
from umbrae.parallel import inline, kernel

LANES = 16
"""Samples per leaf: a tile of 4 x 4 pixels, or 16 neighbours of a list."""

SPARE = 2
"""Slots per tile beyond one for each light frame: for samples of unsure direction, and for splitting."""

LARGEST_Q = 2.0**60
"""Samples with a larger q (that much nearer to a point light than the scene is wide) count as of unsure direction."""

DARK = -2
"""In `Leaves.own`: this lane needs no more tests (in shadow, or padding)."""


@inline
def _interleave(value):
    """Move bit i of a 16-bit number to bit 2 i."""
    value = (value | value << 8) & 0x00FF00FF
    value = (value | value << 4) & 0x0F0F0F0F
    value = (value | value << 2) & 0x33333333
    return (value | value << 1) & 0x55555555


@inline
def _curve(x, y):
    """Position of window coordinates along a Morton curve over a grid of 65536 x 65536."""
    i = min(max(np.int64((x + 1.0) * 32768.0), 0), 65535)
    j = min(max(np.int64((y + 1.0) * 32768.0), 0), 65535)
    return _interleave(i) | _interleave(j) << 1


@inline
def _choose(x, y, dx, frame, lanes, may_split, chosen):
    """Mark the lanes that go into one leaf with the first: same frame, and on the same side of any wide gap.

    A tile across an outline has one part here and another far away in the light's view; a box around both would meet
    all frusta in between. The lanes nearer to the first than to the one farthest from it are a leaf of their own when
    the two boxes together have less than a quarter of the area of the one around all.
    """
    unsure = dx[0] == np.inf
    for lane in range(lanes):
        chosen[lane] = frame[lane] == frame[0] and (dx[lane] == np.inf) == unsure
    while may_split and not unsure:
        farthest, distance = 0, 0.0
        for lane in range(1, lanes):
            apart = max(abs(x[lane] - x[0]), abs(y[lane] - y[0]))
            if chosen[lane] and apart > distance:
                farthest, distance = lane, apart
        near_x0, near_x1, near_y0, near_y1 = x[0], x[0], y[0], y[0]
        far_x0, far_x1, far_y0, far_y1 = x[farthest], x[farthest], y[farthest], y[farthest]
        for lane in range(1, lanes):
            if chosen[lane]:
                apart = max(abs(x[lane] - x[0]), abs(y[lane] - y[0]))
                if apart <= max(abs(x[lane] - x[farthest]), abs(y[lane] - y[farthest])):
                    near_x0, near_x1 = min(near_x0, x[lane]), max(near_x1, x[lane])
                    near_y0, near_y1 = min(near_y0, y[lane]), max(near_y1, y[lane])
                else:
                    far_x0, far_x1 = min(far_x0, x[lane]), max(far_x1, x[lane])
                    far_y0, far_y1 = min(far_y0, y[lane]), max(far_y1, y[lane])
        parts = (near_x1 - near_x0) * (near_y1 - near_y0) + (far_x1 - far_x0) * (far_y1 - far_y0)
        width, height = (
            max(near_x1, far_x1) - min(near_x0, far_x0),
            max(near_y1, far_y1) - min(near_y0, far_y0),
        )
        if not 4.0 * parts < width * height:
            return
        for lane in range(1, lanes):
            apart = max(abs(x[lane] - x[0]), abs(y[lane] - y[0]))
            if apart > max(abs(x[lane] - x[farthest]), abs(y[lane] - y[farthest])):
                chosen[lane] = False


@kernel
def cluster_tiles(
    triangle, side, position, covered, facing, light, frames, surface_error, height, width, order, start, stop,
    leaf_x, leaf_y, leaf_q, leaf_own, leaf_sample, leaf_slack, leaf_box, leaf_key, in_shadow,
):  # fmt: skip
    """Turn tiles `start` to `stop` into leaves, one or more per light frame that a tile's samples lie in.

    Positions on surfaces are off by at most `surface_error` and `POSITION_ERROR` of their largest coordinate. Samples
    so near a point light that their direction is unsure get a leaf with an infinite slack in the first frame: the
    exact predicate will decide them against every triangle. Returns how many slots were filled, from the first that
    belongs to tile `start`.
    """
    directional = light[3] == 0.0
    count = len(frames)
    room = count + SPARE
    listed = len(order) > 0
    columns = (width + 3) // 4
    tile_x, tile_y, tile_q = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    tile_dx, tile_dq = np.empty(LANES), np.empty(LANES)
    tile_frame, tile_sample = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    chosen = np.empty(LANES, np.bool_)
    slot = start * room
    for tile in range(start, stop):
        lanes = 0
        first_row, first_column = tile // columns * 4, tile % columns * 4
        for lane in range(LANES):
            if listed:
                index = np.int64(order[tile * LANES + lane])
                if index < 0:
                    continue
            else:
                row, column = first_row + (lane >> 2), first_column + (lane & 3)
                if row >= height or column >= width:
                    continue
                index = row * width + column
            if not covered[index]:
                continue
            own = triangle[index]
            if own >= 0 and side[index] * facing[own] < 0:
                in_shadow[index] = True
                continue
            x, y, z = np.float64(position[index, 0]), np.float64(position[index, 1]), np.float64(position[index, 2])
            largest = max(abs(x), abs(y), abs(z))
            error = POSITION_ERROR * largest + surface_error if own >= 0 else 0.0
            frame = 0
            if not directional:
                x, y, z = x - light[0], y - light[1], z - light[2]
                if abs(x) >= abs(y) and abs(x) >= abs(z):
                    frame = 0 if x >= 0.0 else 1
                elif abs(y) >= abs(z):
                    frame = 2 if y >= 0.0 else 3
                else:
                    frame = 4 if z >= 0.0 else 5
            axis = np.int64(frames[frame, AXIS_C])
            if axis == 0:
                x, y, z = y, z, x
            elif axis == 1:
                x, y, z = z, x, y
            x0, y0, q0 = frames[frame, X0], frames[frame, Y0], frames[frame, Q0]
            scale_x, scale_y, scale_q = frames[frame, SCALE_X], frames[frame, SCALE_Y], frames[frame, SCALE_Q]
            if directional:
                x, y, q = x - frames[0, SLOPE_A] * z, y - frames[0, SLOPE_B] * z, frames[0, SIGN] * z
                # Two numbers off by `error` each, and the rounding of this line (float64, slopes at most 1).
                dx = 2.0 * error + 2.0**-50 * largest
                dq = error
            else:
                z = abs(z)
                # Rounding of P' itself, where P is exact: 2**-53 of it, so 2**-50 of P and P' is plenty.
                error += 2.0**-50 * (largest + z)
                if z <= 1024.0 * error or z * LARGEST_Q <= scale_q:
                    frame = 0
                    x, y, q, dx, dq = x0, y0, q0, np.inf, np.inf
                else:
                    q = 1.0 / z
                    x, y = x * q, y * q
                    # |x| <= 1, and z is sure to a thousandth: (error + |x| error) / z, and error / z**2.
                    dx = 2.01 * error * q
                    dq = 1.01 * error * q * q
            # 2**-50 covers the rounding of the division and of moving into the window.
            tile_dx[lanes] = max(
                (dx + 2.0**-50 * (abs(x0) + abs(x))) * scale_x, (dx + 2.0**-50 * (abs(y0) + abs(y))) * scale_y
            )
            tile_dq[lanes] = (dq + 2.0**-50 * (abs(q0) + abs(q))) * scale_q
            tile_x[lanes], tile_y[lanes], tile_q[lanes] = (x - x0) * scale_x, (y - y0) * scale_y, (q - q0) * scale_q
            tile_frame[lanes], tile_sample[lanes] = frame, index
            lanes += 1
        while lanes > 0:
            _choose(tile_x, tile_y, tile_dx, tile_frame, lanes, slot + count + 1 < (tile + 1) * room, chosen)
            frame = tile_frame[0]
            filled = 0
            left = 0
            slack_x, slack_q = np.float32(0.0), np.float32(0.0)
            xmin, xmax = np.float32(np.inf), np.float32(-np.inf)
            ymin, ymax = np.float32(np.inf), np.float32(-np.inf)
            qmin, qmax = np.float32(np.inf), np.float32(-np.inf)
            for lane in range(lanes):
                x, y, q = np.float32(tile_x[lane]), np.float32(tile_y[lane]), np.float32(tile_q[lane])
                if chosen[lane]:
                    leaf_x[slot, filled], leaf_y[slot, filled], leaf_q[slot, filled] = x, y, q
                    leaf_sample[slot, filled] = tile_sample[lane]
                    leaf_own[slot, filled] = triangle[tile_sample[lane]]
                    # Rounded up to float32, and 2**-24 of the coordinate for its own rounding (q may exceed 1, and
                    # below 2**-126 that is up to 2**-150).
                    slack_x = max(slack_x, np.float32(tile_dx[lane] * 1.000001 + 2.0**-24))
                    rounding = 2.0**-24 * abs(tile_q[lane]) + 2.0**-149
                    slack_q = max(slack_q, np.float32(tile_dq[lane] * 1.000001 + rounding))
                    xmin, xmax = min(xmin, x), max(xmax, x)
                    ymin, ymax = min(ymin, y), max(ymax, y)
                    qmin, qmax = min(qmin, q), max(qmax, q)
                    filled += 1
                else:
                    tile_x[left], tile_y[left], tile_q[left] = tile_x[lane], tile_y[lane], tile_q[lane]
                    tile_dx[left], tile_dq[left] = tile_dx[lane], tile_dq[lane]
                    tile_frame[left], tile_sample[left] = tile_frame[lane], tile_sample[lane]
                    left += 1
            for lane in range(filled, LANES):
                leaf_x[slot, lane], leaf_y[slot, lane], leaf_q[slot, lane] = (
                    leaf_x[slot, 0], leaf_y[slot, 0], leaf_q[slot, 0],
                )  # fmt: skip
                leaf_sample[slot, lane] = -1
                leaf_own[slot, lane] = DARK
            leaf_slack[slot, 0], leaf_slack[slot, 1] = slack_x, slack_q
            # Boxes are widened a little further, because these differences are rounded as well.
            wide_x = slack_x + np.float32(2.0**-23)
            wide_q = slack_q + np.float32(2.0**-23) * max(abs(qmin), abs(qmax))
            leaf_box[slot, 0], leaf_box[slot, 1] = xmin - wide_x, xmax + wide_x
            leaf_box[slot, 2], leaf_box[slot, 3] = ymin - wide_x, ymax + wide_x
            leaf_box[slot, 4], leaf_box[slot, 5] = qmin - wide_q, qmax + wide_q
            leaf_key[slot] = frame << 40 | _curve(0.5 * (xmin + xmax), 0.5 * (ymin + ymax))
            slot += 1
            lanes = left
    return slot - start * room
