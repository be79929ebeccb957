"""The view-sample hierarchy: clusters of up to 16 samples in light-frame coordinates, and boxes over them.

Sintorn et al. 2011 (section 3.1) build theirs over the camera's depth buffer. This one lives in a light frame (see
`light_frame`) and its leaves are sorted along a space-filling curve there, because that is where frusta are thin: a
triangle meets the few nodes around it instead of a long row of tiles across the screen. It also serves points that
have no camera. Samples whose seen side faces away from the light, and background, are left out (section 3.5).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.morton import morton3
from umbrae.methods.light_frame import POSITION_ERROR, LightFrame
from umbrae.parallel import inline, kernel, run
from umbrae.samples import ViewSamples

LANES = 16
"""Samples per leaf: a tile of 4 x 4 pixels, or 16 neighbours of a list."""

ARITY = 8
"""Children per node."""

SPARE = 2
"""Slots per tile beyond one for each light frame: for samples of unsure direction, and for splitting."""

DARK = -2
"""In `Leaves.own`: this lane needs no more tests (in shadow, or padding)."""

_TILES_PER_TASK = 1024

XMIN, XMAX, YMIN, YMAX, QMIN, QMAX = range(6)


class Leaves(NamedTuple):
    """Sample clusters; all arrays have one row per slot, `(n, LANES)` or `(n,)`.

    `x, y, q` light-frame coordinates in window units; `own` own triangle, -1 for a free point, `DARK` when decided;
    `index` the sample's flat index, -1 for padding; `slack` `(n, 2)` how far x or y, and q, may be off; `box` `(n, 6)` bounds of the
    lanes including slack; `key` frame number and position on the curve, -1 for an unused slot.
    """

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    q: NDArray[np.float32]
    own: NDArray[np.int32]
    index: NDArray[np.int32]
    slack: NDArray[np.float32]
    box: NDArray[np.float32]
    key: NDArray[np.int64]


class SampleTree(NamedTuple):
    """Boxes over the leaves of one light frame.

    `box` `(6, nodes) float32`, level after level from the leaves up, each level padded with empty boxes to a multiple
    of `ARITY`; `level` `(levels + 1,)` where each level starts; `slot` `(leaves,)` the row in `Leaves` of each leaf;
    `full` `(nodes,) uint8` set when everything below lies in shadow: the hierarchical shadow buffer.
    """

    box: NDArray[np.float32]
    level: NDArray[np.int64]
    slot: NDArray[np.int32]
    full: NDArray[np.uint8]


def build(
    samples: ViewSamples,
    facing: NDArray[np.int8],
    light: NDArray[np.float64],
    frames: list[LightFrame],
    in_shadow: NDArray[np.bool_],
    clock: Clock | None,
) -> tuple[Leaves, list[SampleTree | None]]:
    """Cluster the samples and build one tree per frame (None where a frame has no samples).

    Samples that their own triangle shades are set in `in_shadow` (flat) and left out.
    """
    height, width, order = _layout(samples)
    tiles = len(order) // LANES if len(order) else (-(-height // 4)) * (-(-width // 4))
    room = tiles * (len(frames) + SPARE)
    leaves = Leaves(
        *(np.empty((room, LANES), np.float32) for _ in range(3)),
        *(np.empty((room, LANES), np.int32) for _ in range(2)),
        np.empty((room, 2), np.float32),
        np.empty((room, 6), np.float32),
        np.empty(room, np.int64),
    )
    table = np.array([tuple(frame) for frame in frames])
    raw = (
        samples.triangle.reshape(-1),
        samples.side.reshape(-1),
        samples.position.reshape(-1, 3),
        samples.covered.reshape(-1),
    )

    def task(number: int) -> None:
        start, stop = number * _TILES_PER_TASK, min((number + 1) * _TILES_PER_TASK, tiles)
        cluster_tiles(*raw, facing, light, table, height, width, order, start, stop, *leaves, in_shadow)

    run(task, -(-tiles // _TILES_PER_TASK), clock)
    used = np.flatnonzero(leaves.key >= 0)
    keys = leaves.key[used]
    ranked = np.argsort(keys, kind="stable")
    slots, keys = used[ranked].astype(np.int32), keys[ranked]
    ends = np.searchsorted(keys, np.arange(len(frames) + 1) << 40)
    return leaves, [
        _tree(leaves.box, slots[ends[k] : ends[k + 1]]) if ends[k] < ends[k + 1] else None
        for k in range(len(frames))
    ]


def _layout(samples: ViewSamples) -> tuple[int, int, NDArray[np.int32]]:
    """Rows and columns of an image, or a list's order (padded with -1 to whole clusters) along a curve in space."""
    if len(samples.shape) >= 2 and samples.camera is not None:
        return samples.shape[0], samples.size // max(1, samples.shape[0]), np.zeros(0, np.int32)
    order = np.argsort(morton3(samples.position.reshape(-1, 3).astype(np.float64)), kind="stable")
    padded = np.full(-(-samples.size // LANES) * LANES, -1, np.int32)
    padded[: samples.size] = order
    return 1, samples.size, padded


def _tree(boxes: NDArray[np.float32], slots: NDArray[np.int32]) -> SampleTree:
    sizes = [len(slots)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // ARITY))
    level = np.zeros(len(sizes) + 1, np.int64)
    level[1:] = np.cumsum([-(-size // ARITY) * ARITY for size in sizes])
    box = np.empty((6, level[-1]), np.float32)
    box[:3:2] = np.inf
    box[QMIN] = np.inf
    box[1:4:2] = -np.inf
    box[QMAX] = -np.inf
    pull_up(boxes, slots, level, box)
    return SampleTree(box, level, slots, np.zeros(level[-1], np.uint8))


@kernel
def pull_up(leaf_box, slots, level, box):
    """Fill the boxes of all levels from the leaves' own."""
    for i in range(len(slots)):
        for part in range(6):
            box[part, i] = leaf_box[slots[i], part]
    for depth in range(1, len(level) - 1):
        below, here = level[depth - 1], level[depth]
        for child in range(level[depth] - below):
            node = here + child // ARITY
            for part in range(0, 6, 2):
                box[part, node] = min(box[part, node], box[part, below + child])
                box[part + 1, node] = max(box[part + 1, node], box[part + 1, below + child])


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
    triangle, side, position, covered, facing, light, frames, height, width, order, start, stop,
    leaf_x, leaf_y, leaf_q, leaf_own, leaf_index, leaf_slack, leaf_box, leaf_key, in_shadow,
):  # fmt: skip
    """Turn tiles `start` to `stop` into leaves, one or more per light frame that a tile's samples lie in.

    Samples so near a point light that their direction is unsure get a leaf with an infinite slack: the exact
    predicate will decide them against every triangle.
    """
    directional = light[3] == 0.0
    count = len(frames)
    columns = (width + 3) // 4
    tile_x, tile_y, tile_q = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    tile_dx, tile_dq = np.empty(LANES), np.empty(LANES)
    tile_frame, tile_index = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    chosen = np.empty(LANES, np.bool_)
    room = count + SPARE
    slot = start * room
    for tile in range(start, stop):
        lanes = 0
        for lane in range(LANES):
            if len(order) > 0:
                index = np.int64(order[tile * LANES + lane])
                if index < 0:
                    continue
            else:
                row = tile // columns * 4 + lane // 4
                column = tile % columns * 4 + lane % 4
                if row >= height or column >= width:
                    continue
                index = row * width + column
            if not covered[index]:
                continue
            own = triangle[index]
            if own >= 0 and side[index] * facing[own] < 0:
                in_shadow[index] = True
                continue
            largest = np.float64(
                max(abs(position[index, 0]), abs(position[index, 1]), abs(position[index, 2]))
            )
            error = POSITION_ERROR * largest if own >= 0 else 0.0
            px = np.float64(position[index, 0]) - light[3] * light[0]
            py = np.float64(position[index, 1]) - light[3] * light[1]
            pz = np.float64(position[index, 2]) - light[3] * light[2]
            frame = 0
            if not directional:
                if abs(px) >= abs(py) and abs(px) >= abs(pz):
                    frame = 0 if px >= 0.0 else 1
                elif abs(py) >= abs(pz):
                    frame = 2 if py >= 0.0 else 3
                else:
                    frame = 4 if pz >= 0.0 else 5
            axis_a, axis_b, axis_c = (
                np.int64(frames[frame, 0]),
                np.int64(frames[frame, 1]),
                np.int64(frames[frame, 2]),
            )
            pa = px if axis_a == 0 else py if axis_a == 1 else pz
            pb = px if axis_b == 0 else py if axis_b == 1 else pz
            pc = px if axis_c == 0 else py if axis_c == 1 else pz
            x0, y0, q0 = frames[frame, 6], frames[frame, 7], frames[frame, 8]
            hx, hy, hq = frames[frame, 9], frames[frame, 10], frames[frame, 11]
            if directional:
                x, y, q = pa - frames[0, 4] * pc, pb - frames[0, 5] * pc, frames[0, 3] * pc
                # Two numbers off by `error` each, and the rounding of this line (float64, slopes at most 1).
                dx = 2.0 * error + 2.0**-50 * largest
                dq = error
            else:
                z = frames[frame, 3] * pc
                # Rounding of P' itself is covered by doubling `error` where there is one, else by 2**-50.
                error += 2.0**-50 * (largest + z)
                if z <= 1024.0 * error:
                    # The direction is unsure.
                    x, y, q, dx, dq = x0, y0, q0, np.inf, np.inf
                else:
                    x, y, q = pa / z, pb / z, 1.0 / z
                    # |x| <= 1, and z loses at most a thousandth: (error + |x| error) / z, and error / z**2.
                    dx = 2.01 * error / z
                    dq = 1.01 * error * q * q
            tile_x[lanes], tile_y[lanes], tile_q[lanes] = (x - x0) / hx, (y - y0) / hy, (q - q0) / hq
            # 2**-50 covers the rounding of the division and of the window.
            tile_dx[lanes] = max(
                (dx + 2.0**-50 * (abs(x0) + abs(x))) / hx, (dx + 2.0**-50 * (abs(y0) + abs(y))) / hy
            )
            tile_dq[lanes] = (dq + 2.0**-50 * (abs(q0) + abs(q))) / hq
            tile_frame[lanes], tile_index[lanes] = frame, index
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
                    leaf_index[slot, filled] = tile_index[lane]
                    leaf_own[slot, filled] = triangle[tile_index[lane]]
                    # Rounded up to float32, and 2**-24 of the coordinate for its own rounding (q may exceed 1).
                    slack_x = max(slack_x, np.float32(tile_dx[lane] * 1.000001 + 2.0**-24))
                    slack_q = max(
                        slack_q, np.float32(tile_dq[lane] * 1.000001 + 2.0**-24 * abs(tile_q[lane]))
                    )
                    xmin, xmax = min(xmin, x), max(xmax, x)
                    ymin, ymax = min(ymin, y), max(ymax, y)
                    qmin, qmax = min(qmin, q), max(qmax, q)
                    filled += 1
                else:
                    tile_x[left], tile_y[left], tile_q[left] = tile_x[lane], tile_y[lane], tile_q[lane]
                    tile_dx[left], tile_dq[left] = tile_dx[lane], tile_dq[lane]
                    tile_frame[left], tile_index[left] = tile_frame[lane], tile_index[lane]
                    left += 1
            for lane in range(filled, LANES):
                leaf_x[slot, lane], leaf_y[slot, lane], leaf_q[slot, lane] = (
                    leaf_x[slot, 0], leaf_y[slot, 0], leaf_q[slot, 0],
                )  # fmt: skip
                leaf_index[slot, lane] = -1
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
    for unused in range(slot, stop * room):
        leaf_key[unused] = -1
