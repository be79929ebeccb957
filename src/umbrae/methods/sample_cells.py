"""Which cell of a grid over a light frame samples and leaves lie in."""

import numpy as np

from umbrae.methods.light_frame import AXIS_C, SCALE_X, SCALE_Y, SIGN, SLOPE_A, SLOPE_B, X0, Y0
from umbrae.methods.sample_clusters import QMIN, XMAX, XMIN, YMAX, YMIN
from umbrae.parallel import expand, kernel

FIRST, CELLS, LEFT, TOP, PER_X, PER_Y = range(6)
"""Columns of a table of grids: see `sample_lists.Grid`."""

NOT_ASKED = -1
"""In place of a frame's number."""

FARTHEST = 0.5
"""Cells that a leaf may reach out of its own."""


@kernel
def place_samples(
    triangle, side, position, covered, facing, light, frames, start, stop, place, frame_of, bounds, in_shadow
):
    """Where samples `start` to `stop` lie, nearly: frame and window coordinates, or `NOT_ASKED`.

    `bounds (frames, 4)` are lowered to x, -x, y and -y of each frame's samples.
    """
    for at in range(start, stop):
        own = triangle[at]
        frame_of[at] = NOT_ASKED
        if not covered[at]:
            continue
        if own >= 0 and side[at] * facing[own] < 0:
            in_shadow[at] = True
            continue
        frame = np.int64(0)
        if len(frames) > 1:
            reach = -1.0
            for axis in range(3):
                along = np.float64(position[at, axis]) - light[axis]
                if abs(along) > reach:
                    frame, reach = 2 * axis + (0 if along >= 0.0 else 1), abs(along)
        axis = np.int64(frames[frame, AXIS_C])
        a, b = (axis + 1) % 3, (axis + 2) % 3
        pa, pb, pc = np.float64(position[at, a]), np.float64(position[at, b]), np.float64(position[at, axis])
        if light[3] == 0.0:
            x, y = pa - frames[frame, SLOPE_A] * pc, pb - frames[frame, SLOPE_B] * pc
        else:
            z = max(frames[frame, SIGN] * (pc - light[axis]), 1e-300)
            x, y = (pa - light[a]) / z, (pb - light[b]) / z
        x = min(max((x - frames[frame, X0]) * frames[frame, SCALE_X], -2.0), 2.0)
        y = min(max((y - frames[frame, Y0]) * frames[frame, SCALE_Y], -2.0), 2.0)
        frame_of[at] = frame
        place[at, 0], place[at, 1] = x, y
        bounds[frame, 0], bounds[frame, 1] = min(bounds[frame, 0], x), min(bounds[frame, 1], -x)
        bounds[frame, 2], bounds[frame, 3] = min(bounds[frame, 2], y), min(bounds[frame, 3], -y)


@expand
def _cell(value, cells):
    """The cell along one axis; the outermost ones go on for ever."""
    return np.int64(min(max(value, 0.0), cells - 1.0))


@kernel
def find_cells(frame_of, place, grids, start, stop, keys):
    """The list of each sample's cell."""
    for at in range(start, stop):
        frame = frame_of[at]
        if frame >= 0:
            cells = grids[frame, CELLS]
            i = _cell((np.float64(place[at, 0]) - grids[frame, LEFT]) * grids[frame, PER_X], cells)
            j = _cell((np.float64(place[at, 1]) - grids[frame, TOP]) * grids[frame, PER_Y], cells)
            keys[at] = np.int64(grids[frame, FIRST]) + j * np.int64(cells) + i


@kernel
def file_leaves(used, box, leaf_key, grids, key, margins, nearest):
    """The list of each leaf, how far leaves reach out of their cells, and the least q in each list."""
    for slot in used:
        frame = leaf_key[slot] >> 32
        first, cells = np.int64(grids[frame, FIRST]), grids[frame, CELLS]
        x0 = (np.float64(box[slot, XMIN]) - grids[frame, LEFT]) * grids[frame, PER_X]
        x1 = (np.float64(box[slot, XMAX]) - grids[frame, LEFT]) * grids[frame, PER_X]
        y0 = (np.float64(box[slot, YMIN]) - grids[frame, TOP]) * grids[frame, PER_Y]
        y1 = (np.float64(box[slot, YMAX]) - grids[frame, TOP]) * grids[frame, PER_Y]
        which = first + np.int64(cells) * np.int64(cells)
        i, j = _cell(0.5 * (x0 + x1), cells), _cell(0.5 * (y0 + y1), cells)
        out = max(max(i - x0, x1 - i - 1.0), max(j - y0, y1 - j - 1.0))
        if out <= FARTHEST:  # not for NaN, nor for a grid without cells
            which = first + j * np.int64(cells) + i
            margins[frame] = max(margins[frame], out)
        key[slot] = which
        nearest[which] = min(nearest[which], box[slot, QMIN])
