"""Leaves of the view-sample hierarchy: tiles of samples in light-frame coordinates, cut at gaps."""

import numpy as np

from umbrae.methods.lanes import LANES
from umbrae.methods.light_frame import (
    AXIS_C,
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
from umbrae.parallel import expand, inline, kernel

SPARE = 2
"""Slots per tile beyond one for each light frame: for samples of unsure direction, and for cutting."""

LARGEST_Q = 2.0**60
"""Samples with a larger q (that much nearer to a point light than the scene is wide) count as of unsure direction."""

UNSURE = 6
"""In place of a frame's number: samples so near to the light that their direction is unsure."""

X, Y, Q = 0, LANES, 2 * LANES
OWN, SAMPLE = 0, LANES
XMIN, XMAX, YMIN, YMAX, QMIN, QMAX, SLACK_X, SLACK_Q = range(8)

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
def _cut(place, lanes, far_side):
    """Whether a tile has a wide gap; then `far_side` marks the lanes beyond it, seen from the first.

    A tile across an outline has one part here and another far away in the light's view; a box around both would meet
    all frusta in between. The lanes nearer to the first than to the one farthest from it are a leaf of their own when
    the two boxes together have less than a quarter of the area of the one around all.
    """
    far, distance = 0, np.float32(0.0)
    for lane in range(1, lanes):
        apart = max(abs(place[X + lane] - place[X]), abs(place[Y + lane] - place[Y]))
        if apart > distance:
            far, distance = lane, apart
    near_x0, near_x1, near_y0, near_y1 = place[X], place[X], place[Y], place[Y]
    far_x0, far_x1, far_y0, far_y1 = place[X + far], place[X + far], place[Y + far], place[Y + far]
    for lane in range(lanes):
        x, y = place[X + lane], place[Y + lane]
        apart = max(abs(x - place[X]), abs(y - place[Y]))
        far_side[lane] = apart > max(abs(x - place[X + far]), abs(y - place[Y + far]))
        if far_side[lane]:
            far_x0, far_x1 = min(far_x0, x), max(far_x1, x)
            far_y0, far_y1 = min(far_y0, y), max(far_y1, y)
        else:
            near_x0, near_x1 = min(near_x0, x), max(near_x1, x)
            near_y0, near_y1 = min(near_y0, y), max(near_y1, y)
    parts = (near_x1 - near_x0) * (near_y1 - near_y0) + (far_x1 - far_x0) * (far_y1 - far_y0)
    width, height = max(near_x1, far_x1) - min(near_x0, far_x0), max(near_y1, far_y1) - min(near_y0, far_y0)
    return np.float32(4.0) * parts < width * height


@inline
def _group(x, y, z, frames, error):
    """The frame that a sample at `x, y, z` from a point light lies in; `UNSURE` where it is too near to tell."""
    u, v, w = abs(x), abs(y), abs(z)
    if u >= v and u >= w:
        frame, depth = 0 if x >= 0.0 else 1, u
    elif v >= w:
        frame, depth = 2 if y >= 0.0 else 3, v
    else:
        frame, depth = 4 if z >= 0.0 else 5, w
    if depth <= 1024.0 * (error + 2.0**-50 * depth) or depth * LARGEST_Q <= frames[frame, SCALE_Q]:
        return UNSURE
    return frame


@inline
def _common_group(source, light, frames, error):
    """The frame of a point light that 16 samples surely lie in together, else `UNSURE`."""
    x0, x1 = _bounds(source[0], 0)
    y0, y1 = _bounds(source[1], 0)
    z0, z1 = _bounds(source[2], 0)
    x0, x1, y0, y1, z0, z1 = x0 - light[0], x1 - light[0], y0 - light[1], y1 - light[1], z0 - light[2], z1 - light[2]
    u, v, w = max(-x0, x1), max(-y0, y1), max(-z0, z1)
    x, y, z = max(x0, -x1), max(y0, -y1), max(z0, -z1)
    if x >= max(v, w):
        frame, depth = 0 if x0 > 0.0 else 1, x
    elif y >= max(u, w):
        frame, depth = 2 if y0 > 0.0 else 3, y
    elif z >= max(u, v):
        frame, depth = 4 if z0 > 0.0 else 5, z
    else:
        return UNSURE
    if depth <= 1024.0 * (error + 2.0**-50 * max(u, v, w)) or depth * LARGEST_Q <= frames[frame, SCALE_Q]:
        return UNSURE
    return frame


@expand
def _fill(source, lanes):
    """Give the lanes without a sample the first one's position."""
    for axis in range(3):
        first = source[axis, 0]
        for lane in range(LANES):
            source[axis, lane] = source[axis, lane] if lane < lanes else first


@expand
def _to_frame(source, light, row, place):
    """Window coordinates of 16 positions in a frame."""
    x0, y0, q0 = row[X0], row[Y0], row[Q0]
    scale_x, scale_y, scale_q = row[SCALE_X], row[SCALE_Y], row[SCALE_Q]
    axis = np.int64(row[AXIS_C])
    a, b = (axis + 1) % 3, (axis + 2) % 3
    if light[3] == 0.0:
        slope_a, slope_b, sign = row[SLOPE_A], row[SLOPE_B], row[SIGN]
        for lane in range(LANES):
            z = source[axis, lane]
            place[X + lane] = (source[a, lane] - slope_a * z - x0) * scale_x
            place[Y + lane] = (source[b, lane] - slope_b * z - y0) * scale_y
            place[Q + lane] = (sign * z - q0) * scale_q
    else:
        la, lb, lc = light[a], light[b], light[axis]
        for lane in range(LANES):
            z = abs(source[axis, lane] - lc)
            q = 1.0 / z
            place[X + lane] = ((source[a, lane] - la) * q - x0) * scale_x
            place[Y + lane] = ((source[b, lane] - lb) * q - y0) * scale_y
            place[Q + lane] = (q - q0) * scale_q


@expand
def _bounds(place, at):
    """Smallest and largest of 16 numbers."""
    low, high = place[at], place[at]
    for lane in range(LANES):
        value = place[at + lane]
        low = value if value < low else low
        high = value if value > high else high
    return low, high


@inline
def _slack(source, light, row, error, rounding):
    """How far window coordinates of a tile's samples may be off: x or y, and q."""
    if light[3] == 0.0:
        # Two numbers off by `error` each, and the rounding of that line (float64, slopes at most 1).
        dx, dq = 2.0 * error + rounding, error + rounding
    else:
        axis = np.int64(row[AXIS_C])
        low, high = _bounds(source[axis], 0)
        nearest = min(abs(low - light[axis]), abs(high - light[axis]))
        # Rounding of P' itself, where P is exact: 2**-53 of it, so 2**-50 of P and P' is plenty.
        error += rounding + 2.0**-50 * max(abs(low - light[axis]), abs(high - light[axis]))
        # z is sure to a thousandth: (error + |x| error) / z for the largest x in the window, and error / z**2.
        q = 1.0 / nearest
        reach = max(abs(row[X0]) + 1.0 / row[SCALE_X], abs(row[Y0]) + 1.0 / row[SCALE_Y])
        dx, dq = 1.01 * (1.0 + reach) * error * q, (1.01 * error * q + 2.0**-50) * q
    # 2**-49 covers the rounding of the division and of moving into the window, within which x and y lie.
    dx_window = (dx + 2.0**-49 * abs(row[X0])) * row[SCALE_X]
    dy_window = (dx + 2.0**-49 * abs(row[Y0])) * row[SCALE_Y]
    return max(dx_window, dy_window) + 2.0**-49, (dq + 2.0**-49 * abs(row[Q0])) * row[SCALE_Q]


@expand
def _pad(place, ids, lanes):
    """Give the lanes without a sample the first one's place."""
    x, y, q = place[X], place[Y], place[Q]
    for lane in range(LANES):
        place[X + lane] = place[X + lane] if lane < lanes else x
        place[Y + lane] = place[Y + lane] if lane < lanes else y
        place[Q + lane] = place[Q + lane] if lane < lanes else q
        ids[OWN + lane] = ids[OWN + lane] if lane < lanes else DARK
        ids[SAMPLE + lane] = ids[SAMPLE + lane] if lane < lanes else -1


@inline
def _put_leaf(slot, frame, place, ids, lanes, slack_x, slack_q, leaf_place, leaf_ids, leaf_box, leaf_key):
    """Store up to 16 samples as a leaf."""
    _pad(place, ids, lanes)
    for part in range(3 * LANES):
        leaf_place[slot, part] = place[part]
    for part in range(2 * LANES):
        leaf_ids[slot, part] = ids[part]
    xmin, xmax = _bounds(place, X)
    ymin, ymax = _bounds(place, Y)
    qmin, qmax = _bounds(place, Q)
    # Rounded up to float32, and 2**-24 of the coordinate for its own rounding (q may exceed 1, and below 2**-126 that
    # is up to 2**-150).
    reach_q = max(abs(qmin), abs(qmax))
    slack_x = np.float32(slack_x * 1.000001 + 2.0**-24)
    slack_q = np.float32(slack_q * 1.000001 + 2.0**-24 * 1.000001 * reach_q + 2.0**-149)
    # Boxes are widened a little further, because these differences are rounded as well.
    wide_x = slack_x + np.float32(2.0**-23)
    wide_q = slack_q + np.float32(2.0**-23) * reach_q
    leaf_box[slot, XMIN], leaf_box[slot, XMAX] = xmin - wide_x, xmax + wide_x
    leaf_box[slot, YMIN], leaf_box[slot, YMAX] = ymin - wide_x, ymax + wide_x
    leaf_box[slot, QMIN], leaf_box[slot, QMAX] = qmin - wide_q, qmax + wide_q
    leaf_box[slot, SLACK_X], leaf_box[slot, SLACK_Q] = slack_x, slack_q
    half = np.float32(0.5)
    leaf_key[slot] = frame << 32 | _curve(half * (xmin + xmax), half * (ymin + ymax))


@expand
def _cover_columns(covered, row, stop, width, seen):
    """Which columns of a row of tiles hold any sample."""
    seen[:] = False
    for line in range(row, stop):
        above = covered[line * width : (line + 1) * width]
        for column in range(width):
            seen[column] |= above[column]


@kernel
def cluster_tiles(
    triangle, side, position, covered, facing_of, light, frames, error, rounding, gap,
    height, width, order, start, stop, slot, last, leaf_place, leaf_ids, leaf_box, leaf_key, in_shadow,
):  # fmt: skip
    """Turn tiles `start` to `stop` into leaves, one or more per light frame that a tile's samples lie in.

    Positions are off by at most `error`, and `rounding` is 2**-50 of the largest coordinate. Samples so near a point
    light that their direction is unsure get a leaf with an infinite slack in the first frame: the exact predicate will
    decide them against every triangle. Leaves go into slots from `slot` on; returns the next slot, and the next tile,
    which is not `stop` when the slots before `last` might not have sufficed.
    """
    room = len(frames) + SPARE
    listed = len(order) > 0
    columns = (width + 3) // 4
    source, place, ids = np.zeros((3, LANES)), np.zeros(3 * LANES, np.float32), np.zeros(2 * LANES, np.int32)
    # What waits while another frame's samples are stored, and what is stored while the far side of a gap waits.
    later_source, later_ids = np.empty((3, LANES)), np.empty(2 * LANES, np.int32)
    near_place, near_ids = np.empty(3 * LANES, np.float32), np.empty(2 * LANES, np.int32)
    index, seen = np.empty(LANES + 1, np.int64), np.zeros(width + 3, np.bool_)
    group, far_side = np.empty(LANES, np.int32), np.empty(LANES, np.bool_)
    for tile in range(start, stop):
        if slot + room > last:
            return slot, tile
        end = slot + room
        candidates = 0
        if listed:
            for lane in range(tile * LANES, (tile + 1) * LANES):
                index[candidates] = max(order[lane], 0)
                candidates += order[lane] >= 0 and covered[order[lane]]
        else:
            row, column = tile // columns * 4, tile % columns * 4
            if column == 0 or tile == start:
                _cover_columns(covered, row, min(row + 4, height), width, seen)
            if not (seen[column] | seen[column + 1] | seen[column + 2] | seen[column + 3]):
                continue
            for line in range(row, min(row + 4, height)):
                for at in range(line * width + column, line * width + min(column + 4, width)):
                    index[candidates] = at
                    candidates += covered[at]
        lanes = 0
        for lane in range(candidates):
            at = index[lane]
            own = triangle[at]
            if own >= 0 and side[at] * facing_of[own] < 0:
                in_shadow[at] = True
                continue
            ids[OWN + lanes], ids[SAMPLE + lanes] = own, at
            for axis in range(3):
                source[axis, lanes] = position[at, axis]
            lanes += 1
        if lanes == 0:
            continue
        several = False
        group[0] = 0
        if len(frames) > 1:
            _fill(source, lanes)
            group[0] = _common_group(source, light, frames, error + rounding)
        if group[0] == UNSURE:
            for lane in range(lanes):
                x, y, z = source[0, lane] - light[0], source[1, lane] - light[1], source[2, lane] - light[2]
                group[lane] = _group(x, y, z, frames, error + rounding)
                several = several or group[lane] != group[0]
        waiting = 0
        if several:
            waiting = lanes
            later_source[:], later_ids[:] = source, ids
        while lanes > 0:
            now = group[0]
            if several:
                # Those in the first one's frame; the others wait.
                lanes, left = 0, 0
                for lane in range(waiting):
                    if group[lane] == now:
                        for axis in range(3):
                            source[axis, lanes] = later_source[axis, lane]
                        ids[OWN + lanes], ids[SAMPLE + lanes] = later_ids[OWN + lane], later_ids[SAMPLE + lane]
                        lanes += 1
                    else:
                        for axis in range(3):
                            later_source[axis, left] = later_source[axis, lane]
                        later_ids[OWN + left], later_ids[SAMPLE + left] = (
                            later_ids[OWN + lane],
                            later_ids[SAMPLE + lane],
                        )
                        group[left] = group[lane]
                        left += 1
                waiting = left
            frame = np.int64(now)
            sure = frame != UNSURE
            if sure:
                _fill(source, lanes)
                _to_frame(source, light, frames[frame], place)
                slack_x, slack_q = _slack(source, light, frames[frame], error, rounding)
            else:
                frame, slack_x, slack_q = 0, np.inf, np.inf
                place[:] = np.float32(0.0)
            while sure and slot + len(frames) + 1 < end:
                xmin, xmax = _bounds(place, X)
                ymin, ymax = _bounds(place, Y)
                if (xmax - xmin < gap and ymax - ymin < gap) or not _cut(place, lanes, far_side):
                    break
                near, left = 0, 0
                for lane in range(lanes):
                    if far_side[lane]:
                        for axis in range(0, 3 * LANES, LANES):
                            place[axis + left] = place[axis + lane]
                        ids[OWN + left], ids[SAMPLE + left] = ids[OWN + lane], ids[SAMPLE + lane]
                        left += 1
                    else:
                        for axis in range(0, 3 * LANES, LANES):
                            near_place[axis + near] = place[axis + lane]
                        near_ids[OWN + near], near_ids[SAMPLE + near] = ids[OWN + lane], ids[SAMPLE + lane]
                        near += 1
                lanes = left
                _pad(place, ids, lanes)
                _put_leaf(
                    slot, frame, near_place, near_ids, near, slack_x, slack_q, leaf_place, leaf_ids, leaf_box, leaf_key
                )
                slot += 1
            _put_leaf(slot, frame, place, ids, lanes, slack_x, slack_q, leaf_place, leaf_ids, leaf_box, leaf_key)
            slot += 1
            lanes = waiting
    return slot, stop
