"""Clusters of triangles that surely shade no view sample: found before anything is computed about their triangles.

Stich, Waechter and Keller 2007 (section 11.3.3) ask a graphics card whether the shadow volume of an object's box is
seen anywhere. Here a box in space is bounded in the light frame like a frustum (see `frustum_setup.bound_frusta`): in
x, y and towards the light. What lies below, down to infinity, is what it may shade, and goes down the view-sample
hierarchy until some sample that is not dark is met, or none can be. Boxes of 16 clusters go first, and where they meet
anything, the 16 of the clusters.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.methods.frustum_setup import RECT_QMAX, RECT_XMAX, RECT_XMIN, RECT_YMAX, RECT_YMIN, RECTS
from umbrae.methods.lanes import LANES, equal, load, lowest
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.sample_clusters import QMIN, XMAX, XMIN, YMAX, YMIN
from umbrae.methods.sample_tree import SampleTree
from umbrae.methods.triangle_clusters import TriangleClusters
from umbrae.parallel import expand, inline, kernel, run

_ROWS_PER_TASK = 8
"""Each of up to 4096 triangles."""

_PROBES, _ROW_PROBES = 8, 4
"""Of 16 clusters each such one is tested before the others, and so is a cluster of each such group in a row.

Where all of them meet samples, the others count as if they did: testing a cluster takes half the time that is saved
where it meets none.
"""

_DEPTH = 12


def choose_clusters(
    clusters: TriangleClusters,
    light: NDArray[np.float64],
    active: Sequence[tuple[LightFrame, SampleTree]],
    culling: bool,
    chosen: NDArray[np.bool_],
    clock: Clock,
) -> list[NDArray[np.intp]]:
    """Numbers of the clusters that may shade any sample which is not dark yet, for each frame's tree; else of all.

    Marks them in `chosen (c,)`.
    """
    if not culling:
        chosen[:] = True
        return [np.arange(len(chosen))] * len(active)
    met = [clusters_that_meet(clusters, light, frame, tree, clock) for frame, tree in active]
    for one in met:
        chosen |= one
    return [np.flatnonzero(one) for one in met]


def clusters_that_meet(
    clusters: TriangleClusters, light: NDArray[np.float64], frame: LightFrame, tree: SampleTree, clock: Clock
) -> NDArray[np.bool_]:
    """`(c,)` whether clusters may shade any sample of a tree that is not dark yet."""
    met = np.zeros(len(clusters.corners), bool)
    rows, groups = len(clusters.boxes), clusters.groups

    def task(number: int) -> None:
        start = groups + number * _ROWS_PER_TASK
        mark_meeting(clusters.boxes, groups, light, frame, *tree[:3], start, min(start + _ROWS_PER_TASK, rows), met)

    run(task, -(-(rows - groups) // _ROWS_PER_TASK), clock)
    return met


@inline
def bound_boxes(boxes, row, light, frame, rects):
    """Bounds of what 16 boxes may hold of frusta, `rects[0]`: empty where a box lies behind the frame.

    Of a box that a point light's plane cuts, only the part before it counts: there x, y and q grow without bound on
    the way to the plane, but not beyond what the box's far end has on the sides that do not turn away. Errors are
    those of `bound_frusta`, each relative to its own number: x is a quotient of differences of float32 numbers.
    """
    axis_a, axis_b, axis_c = 2 * frame.axis_a * LANES, 2 * frame.axis_b * LANES, 2 * frame.axis_c * LANES
    la, lb, lc = light[frame.axis_a], light[frame.axis_b], light[frame.axis_c]
    sx, sy, sq = 1.0 / frame.hx, 1.0 / frame.hy, 1.0 / frame.hq
    fx, fy, fq = frame.x0, frame.y0, frame.q0
    slope_a, slope_b, g = frame.slope_a, frame.slope_b, frame.sign
    for lane in range(LANES):
        a0, a1 = np.float64(boxes[row, axis_a + lane]), np.float64(boxes[row, axis_a + LANES + lane])
        b0, b1 = np.float64(boxes[row, axis_b + lane]), np.float64(boxes[row, axis_b + LANES + lane])
        c0, c1 = np.float64(boxes[row, axis_c + lane]), np.float64(boxes[row, axis_c + LANES + lane])
        if light[3] != 0.0:
            a0, a1, b0, b1 = a0 - la, a1 - la, b0 - lb, b1 - lb
            near, far = _ordered(g * (c0 - lc), g * (c1 - lc))
            reach = max(abs(a0), abs(a1)) + max(abs(b0), abs(b1)) + max(abs(near), abs(far))
            most = 1.0 / near if near > 2.0**-40 * reach else np.inf
            least = 1.0 / far if far > 0.0 else np.inf
            x0, x1 = a0 * (most if a0 < 0.0 else least), a1 * (most if a1 > 0.0 else least)
            y0, y1 = b0 * (most if b0 < 0.0 else least), b1 * (most if b1 > 0.0 else least)
            ex0, ex1 = 2.0**-50 * (abs(x0) + abs(fx)), 2.0**-50 * (abs(x1) + abs(fx))
            ey0, ey1 = 2.0**-50 * (abs(y0) + abs(fy)), 2.0**-50 * (abs(y1) + abs(fy))
            q, eq = most, 2.0**-50 * (most + abs(fq))
            behind = far <= 0.0
        else:
            reach = max(abs(a0), abs(a1)) + max(abs(b0), abs(b1)) + max(abs(c0), abs(c1))
            sheared0, sheared1 = _ordered(slope_a * c0, slope_a * c1)
            x0, x1 = a0 - sheared1, a1 - sheared0
            sheared0, sheared1 = _ordered(slope_b * c0, slope_b * c1)
            y0, y1 = b0 - sheared1, b1 - sheared0
            ex0 = ex1 = 2.0**-50 * (reach + abs(fx))
            ey0 = ey1 = 2.0**-50 * (reach + abs(fy))
            q, eq = max(g * c0, g * c1), 2.0**-50 * (reach + abs(fq))
            behind = False
        xmin, xmax = _widened((x0 - ex0 - fx) * sx, (x1 + ex1 - fx) * sx)
        ymin, ymax = _widened((y0 - ey0 - fy) * sy, (y1 + ey1 - fy) * sy)
        qmax = (q + eq - fq) * sq
        rects[0, RECT_XMIN * LANES + lane] = np.inf if behind else xmin
        rects[0, RECT_XMAX * LANES + lane] = -np.inf if behind else xmax
        rects[0, RECT_YMIN * LANES + lane] = np.inf if behind else ymin
        rects[0, RECT_YMAX * LANES + lane] = -np.inf if behind else ymax
        rects[0, RECT_QMAX * LANES + lane] = -np.inf if behind else qmax + 2.0**-22 * max(1.0, abs(qmax))


@expand
def _ordered(one, other):
    return (one, other) if one < other else (other, one)


@expand
def _widened(low, high):
    """Ends of an interval in the window moved apart, by what rounding them to float32 can do."""
    return low - 2.0**-22 * max(1.0, abs(low)), high + 2.0**-22 * max(1.0, abs(high))


@expand
def _meeting(box, full, group, xmin, xmax, ymin, ymax, qmax):
    """Mask of the children in a group, of those that are not dark, whose boxes a rectangle meets."""
    return (
        equal(full, group, 0, np.uint8(0))
        & (load(box, group, XMIN * LANES) <= xmax)
        & (load(box, group, XMAX * LANES) >= xmin)
        & (load(box, group, YMIN * LANES) <= ymax)
        & (load(box, group, YMAX * LANES) >= ymin)
        & (load(box, group, QMIN * LANES) <= qmax)
    )


@inline
def _meets(box, full, level, rects, lane, masks, numbers):
    """Whether what a box may shade meets any leaf, or a node that is no wider than it."""
    xmin, xmax = rects[0, RECT_XMIN * LANES + lane], rects[0, RECT_XMAX * LANES + lane]
    ymin, ymax = rects[0, RECT_YMIN * LANES + lane], rects[0, RECT_YMAX * LANES + lane]
    qmax = rects[0, RECT_QMAX * LANES + lane]
    width, height = xmax - xmin, ymax - ymin
    top = len(level) - 1
    depth = top
    numbers[top] = 0
    masks[top] = _meeting(box, full, level[top], xmin, xmax, ymin, ymax, qmax)
    while depth <= top:
        if masks[depth] == 0:
            depth += 1
            continue
        child = np.int64(lowest(masks[depth]))
        masks[depth] &= masks[depth] - np.int32(1)
        group = level[depth] + numbers[depth]
        if depth == 0 or (
            box[group, XMAX * LANES + child] - box[group, XMIN * LANES + child] <= width
            and box[group, YMAX * LANES + child] - box[group, YMIN * LANES + child] <= height
        ):
            return True
        number = numbers[depth] * LANES + child
        depth -= 1
        numbers[depth] = number
        masks[depth] = _meeting(box, full, level[depth] + number, xmin, xmax, ymin, ymax, qmax)
    return False


@kernel
def mark_meeting(boxes, groups, light, frame, box, full, level, start, stop, met):
    """Mark clusters that may shade a sample, below rows `start` to `stop` of the boxes around 16 groups each."""
    rects, inner = np.empty((1, RECTS), np.float32), np.empty((1, RECTS), np.float32)
    masks, numbers = np.empty(_DEPTH, np.int32), np.empty(_DEPTH, np.int64)
    for row in range(start, stop):
        first, last = (row - groups) * LANES, min((row - groups + 1) * LANES, groups)
        likely = True
        for group in range(first, last, _ROW_PROBES):
            if likely:
                bound_boxes(boxes, group, light, frame, inner)
                likely = _meets(box, full, level, inner, 0, masks, numbers)
        if likely:
            met[first * LANES : last * LANES] = True
            continue
        bound_boxes(boxes, row, light, frame, rects)
        for group in range(first, last):
            if not _meets(box, full, level, rects, group - first, masks, numbers):
                continue
            bound_boxes(boxes, group, light, frame, inner)
            begin, end = group * LANES, min((group + 1) * LANES, len(met))
            likely = True
            for cluster in range(begin, end, _PROBES):
                likely = likely and _meets(box, full, level, inner, cluster - begin, masks, numbers)
            for cluster in range(begin, end):
                met[cluster] = likely or _meets(box, full, level, inner, cluster - begin, masks, numbers)
