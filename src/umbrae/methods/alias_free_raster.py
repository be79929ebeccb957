"""Triangles drawn conservatively into a grid of sample lists, and each sample of those lists asked."""

import numpy as np

from umbrae.methods.frustum_leaves import TILE_TESTS, darken_leaf
from umbrae.methods.frustum_setup import (
    BOUND_SIDES,
    PLANES,
    RECT_QMAX,
    RECT_XMAX,
    RECT_XMIN,
    RECT_YMAX,
    RECT_YMIN,
    RECTS,
    bound_frusta,
    put_planes,
)
from umbrae.methods.lanes import ALL, LANES
from umbrae.methods.sample_clusters import DARK, OWN, QMIN, SAMPLE, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import expand, kernel

ROUNDING = 2.0**-20
"""Cells, and window units: far more than the float64 roundings of what is computed here from numbers up to 2**12."""


@kernel
def rasterize(corners, order, facing_of, frame, grid, start, stop, lists, receivers, stats):
    """Draw the frusta of clusters `start` to `stop`; where `facing_of` is 0, none is cast."""
    light, box = receivers.light, receivers.box
    slots, ends, nearest, full, dark = lists
    rects, rows = np.empty((1, RECTS), np.float32), np.empty((1, PLANES), np.float32)
    listed, masked = np.zeros(1, np.int32), np.empty(1, np.int32)
    number_of, point = np.empty(1, np.int64), np.empty(3)
    cells, out = grid.cells, grid.margin + ROUNDING
    for cluster in range(start, stop):
        bound_frusta(corners, cluster, light, frame, rects, 0)
        number_of[0] = cluster
        ready = False
        for lane in range(LANES):
            if facing_of[cluster, lane] == 0:
                continue
            # Infinite where a vertex lies behind the frame, inf to -inf where all do.
            xmin, xmax = rects[0, RECT_XMIN * LANES + lane], rects[0, RECT_XMAX * LANES + lane]
            ymin, ymax = rects[0, RECT_YMIN * LANES + lane], rects[0, RECT_YMAX * LANES + lane]
            qmax = rects[0, RECT_QMAX * LANES + lane]
            x0 = (np.float64(xmin) - grid.x0) * grid.scale_x - out
            x1 = (np.float64(xmax) - grid.x0) * grid.scale_x + out
            y0 = (np.float64(ymin) - grid.y0) * grid.scale_y - out
            y1 = (np.float64(ymax) - grid.y0) * grid.scale_y + out
            if x0 > x1 or x1 < 0.0 or x0 > cells or y1 < 0.0 or y0 > cells:
                continue
            masked[0] = np.int32(1) << np.int32(lane)
            for j in range(lower(y0), upper(y1, cells) + 1):
                left, right = lower(x0), upper(x1, cells)
                if right - left > 1:
                    if not ready:
                        put_planes(corners, cluster, facing_of, light, frame, rows, 0)
                        ready = True
                    left, right = narrow(rows, lane, grid, j, left, right)
                for which in range(grid.first + j * cells + left, grid.first + j * cells + right + 1):
                    if ends[which] == ends[which + 1] or full[which] or not nearest[which] <= qmax:
                        continue
                    stats[TILE_TESTS] += 1
                    whole = True
                    for place in range(ends[which], ends[which + 1]):
                        slot = np.int64(slots[place])
                        if dark[slot]:
                            continue
                        whole = False
                        if (
                            (xmin <= box[slot, XMAX])
                            & (xmax >= box[slot, XMIN])
                            & (ymin <= box[slot, YMAX])
                            & (ymax >= box[slot, YMIN])
                            & (qmax >= box[slot, QMIN])
                        ):
                            if not ready:
                                put_planes(corners, cluster, facing_of, light, frame, rows, 0)
                                ready = True
                            found = darken_leaf(
                                slot, listed, masked, 1, number_of, order, rows, receivers, point, stats
                            )
                            if found == ALL:
                                dark[slot] = 1
                    if whole:
                        full[which] = 1


@expand
def lower(value):
    """The first cell from `value` on; 0 for NaN."""
    return np.int64(value) if value > 0.0 else np.int64(0)


@expand
def upper(value, cells):
    """The last cell up to `value`; the very last for NaN."""
    return np.int64(value) if value < cells - 1.0 else np.int64(cells - 1)


@expand
def narrow(rows, lane, grid, j, left, right):
    """The cells of row j, between two, that no side plane has on its outer side as a whole."""
    limit = 2.0 * np.float64(rows[0, BOUND_SIDES * LANES + lane]) + ROUNDING
    if grid.scale_x == 0.0 or not limit < 1.0:
        return left, right
    out = grid.margin + ROUNDING
    y0, y1 = grid.y0 + (j - out) / grid.scale_y, grid.y0 + (j + 1.0 + out) / grid.scale_y
    for edge in range(3):
        at = 3 * edge * LANES + lane
        a, b = np.float64(rows[0, at]), np.float64(rows[0, at + LANES])
        # Some point of the row must have a x >= -most.
        most = max(b * y0, b * y1) + np.float64(rows[0, at + 2 * LANES]) + limit
        if abs(a) * 4.0 <= abs(most) * ROUNDING or a == 0.0:
            if most < -abs(a) * 4.0:
                return left, left - 1
            continue
        at_edge = (-most / a - grid.x0) * grid.scale_x
        if a > 0.0:
            left = max(left, lower(at_edge - out)) if at_edge < grid.cells + 2.0 else right + 1
        else:
            right = min(right, upper(at_edge + out, grid.cells)) if at_edge > -2.0 else left - 1
    return left, right


@kernel
def write_out(slots, start, stop, ids, in_shadow):
    """Write the verdicts of the leaves in `slots`, places `start` to `stop`."""
    for place in range(start, stop):
        slot = slots[place]
        for lane in range(LANES):
            index = ids[slot, SAMPLE + lane]
            if index >= 0 and ids[slot, OWN + lane] == DARK:
                in_shadow[index] = True
