"""What may cancel: crossings of the same part of a surface, and of no other.

On its way to the light, a ray close to a contour crosses triangles that count forwards and others that count backwards
(pieces turned the wrong way, bands of contours that bend inwards), which cancel where the smooth surface is not met at
all. On coarse meshes a contour may also fold over what belongs to another part, far from it along the ray: that is
still crossed. So wherever all of the crossings cancel they are looked at once more, one by one: only those whose
triangles are connected, by common vertices, may cancel each other.
"""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.bvh import LEAF, STACK, segment_meets_box
from umbrae.geometry.predicates import SHADOWED, shadows, surface_point
from umbrae.light import Light
from umbrae.methods.smooth.casting import Casting
from umbrae.methods.smooth.silhouette import way_at
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples

MOST = 64
"""Crossings of one ray; where there are more it counts as in shadow."""

_SAMPLES_PER_TASK = 4096


def settle_doubts(
    casting: Casting, light: Light, samples: ViewSamples, doubt: NDArray[np.bool_], in_shadow: NDArray[np.bool_]
) -> None:
    """Set those samples that are in `doubt (n,)` in shadow of which crossings cancel that do not belong together."""
    found = np.flatnonzero(doubt)
    raw = (
        samples.triangle.reshape(-1),
        samples.barycentric.reshape(-1, 2),
        samples.side.reshape(-1),
        samples.position.reshape(-1, 3),
    )
    soup = casting.soup.positions, casting.soup.triangles, light.position.astype(np.float64)
    about = casting.boxes, casting.doubtful, casting.corners, casting.weight, casting.facing, casting.source

    def task(i: int) -> None:
        part = found[i * _SAMPLES_PER_TASK : (i + 1) * _SAMPLES_PER_TASK]
        settle(part, *raw, *soup, *about, *casting.own, in_shadow)

    run(task, -(-len(found) // _SAMPLES_PER_TASK) or 1)  # compiled also where nothing is in doubt


@kernel
def settle(
    chosen, own_of, barycentric, side_of, position, positions, triangles, light, tree, numbers, corners, weight, facing,
    source, chain, turned, values, in_shadow,
):  # fmt: skip
    """`settle_doubts` for the `chosen` samples."""
    crossed, times = np.empty(MOST + 1, np.int64), np.empty(MOST + 1, np.int64)
    point, origin, stack = np.empty(3), np.empty(3), np.empty(STACK, np.int64)
    for index in chosen:
        own, side = own_of[index], np.int64(side_of[index])
        u, v = np.float64(barycentric[index, 0]), np.float64(barycentric[index, 1])
        for axis in range(3):
            origin[axis] = position[index, axis]
        # The filter's bound of a surface point's rounding outweighs what is lost here.
        radius = 2.0**-40 * surface_point(positions, triangles, own, u, v, origin)
        count = 0
        if own >= 0 and side * facing[own] < 0:
            crossed[0], times[0] = own, way_at(own, u, v, triangles, chain, turned, values) * facing[own]
            count = 1
        stack[0], height = 0, 1
        while height > 0 and count <= MOST:
            height -= 1
            node = stack[height]
            if not segment_meets_box(origin, light, tree.lower, tree.upper, node, radius):
                continue
            if node < tree.first_leaf:
                stack[height], stack[height + 1] = 2 * node + 1, 2 * node + 2
                height += 2
                continue
            for place in range(LEAF * (node - tree.first_leaf), LEAF * (node - tree.first_leaf + 1)):
                if tree.order[place] < 0 or count > MOST:
                    continue
                t = numbers[tree.order[place]]
                if source[t] == own:
                    continue
                for axis in range(3):
                    point[axis] = position[index, axis]
                if shadows(positions, triangles, t, facing[t], light, own, u, v, side, point, False) & SHADOWED:
                    crossed[count], times[count] = t, weight[t]
                    count += 1
        in_shadow[index] = count > MOST or not parts_cancel(crossed, times, count, corners)


@kernel
def parts_cancel(crossed, times, count, corners):
    """Whether the counts of each connected part of the crossed triangles add up to zero; overwrites `times`."""
    part = np.arange(count)
    for i in range(count):
        for j in range(i):
            touch = False
            for a in range(3):
                for b in range(3):
                    touch |= corners[crossed[i], a] == corners[crossed[j], b]
            if touch and part[i] != part[j]:
                old, new = max(part[i], part[j]), min(part[i], part[j])
                for k in range(count):
                    if part[k] == old:
                        part[k] = new
    for i in range(count):
        if part[i] != i:
            times[part[i]] += times[i]
    cancel = True
    for i in range(count):
        cancel &= part[i] != i or times[i] == 0
    return cancel
