"""Regions of influence: what a triangle may shade of a light with a size, bounded in the frame of the light's middle.

Let every light sample be l + d with |d| <= r, the disc's reach. A view sample P that a place V of a triangle hides
from one of them lies beyond V, on the line from l + d through V. In the light frame (see `light_frame`; Z is the depth
along its axis, x = P'_a / Z, q = 1 / Z) it is not where V is, but not far away:

    point light      V - l = s (P - l) + (1 - s) d, so that  x_P - x_V = (1 - s) (x_V d_c - d_a) / (s Z_P)
                     and, with (1 - s) / s = (Z_P - Z_V) / (Z_V - d_c), for any direction (u, v) in the frame,
                     |u (x_P - x_V) + v (y_P - y_V)| <= slope sqrt(u**2 + v**2 + (u x_V + v y_V)**2) (q_V - q_P)
                     slope = r / (1 - r q_V)
    directional      V - P = t (l + d), q_V - q_P = t (|l_c| +- d_c), so that x_P - x_V = t ((l_a / l_c) d_c - d_a):
                     the same with l_a / l_c, l_b / l_c in place of x_V, y_V, and slope = r / (|l_c| - r)

while q_P <= q_V in both. So a triangle's shadow frustum is widened by a slope times the difference in q: the region of
influence is a frustum that opens downward, and next to its own surface it is no wider than the triangle. This needs the
triangle to be farther from the light's plane than r (|l_c| > r for a directional light); a triangle that comes closer
meets everything, one that lies wholly on the other side of the light nothing.

Two more things follow. An edge's side plane, a x + b y + c >= 0 for V in the triangle, holds for P but for its
*opening*, slope sqrt(a**2 + b**2 + (a x + b y)**2) for the largest |a x + b y|, times q_V - q_P. And where P is on the
inner side of all three by more than that, and beyond the triangle's plane while all of the light is before it, the
triangle hides the whole light: move d from 0 outward; V starts inside the triangle and could leave it only across an
edge, which the bound, valid there, rules out.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.clock import Clock
from umbrae.geometry.predicates import leading_sign, plane_normal_terms, vertex
from umbrae.methods.area_samples import LightDisc
from umbrae.methods.frustum_setup import (
    PLANES,
    RECT_QMAX,
    RECT_XMAX,
    RECT_XMIN,
    RECT_YMAX,
    RECT_YMIN,
    bound_frusta,
)
from umbrae.methods.lanes import LANES, choose, equal, largest, load, smallest, splat
from umbrae.methods.light_frame import LightFrame
from umbrae.methods.triangle_clusters import TriangleClusters
from umbrae.parallel import expand, inline, kernel, run
from umbrae.scene import Scene

STRADDLES = 2
"""In place of a side: the triangle's plane goes through the light."""

SLOPE_X, SLOPE_Y, SLOPE = 5, 6, 7
"""After the bounds of a frustum: how much wider it gets in x and y for each unit of q, and the slope; window units."""

OPENING = PLANES
"""After the planes of 16 frusta: the openings of their three edges."""

EDGED_PLANES = PLANES + 3 * LANES

COLUMNS = 8
REGIONS = COLUMNS * LANES

CLEAR_OF = 1.001
"""How many times the reach a triangle must be away from the light's plane: beyond, all quotients are safe."""

STEEPEST = 1e30
"""Regions that open faster than this count as without bounds."""

_CHUNK = 1024
"""Clusters per task."""


class ClusterTree(NamedTuple):
    """Regions of influence of clusters in one light frame, and over them, 16 to a node.

    `region` `(groups, REGIONS) float32` the bounds of the children of a node, lane by lane, those of the clusters
    first; `level` where the groups of each level start, the last one being a single group.
    """

    region: NDArray[np.float32]
    level: NDArray[np.int64]


def disc_sides(
    scene: Scene, clusters: TriangleClusters, disc: LightDisc, of_scene: NDArray[np.int8], clock: Clock | None
) -> NDArray[np.int8]:
    """The side of each triangle's plane that all of the light is on.

    `(c, 16)`, `STRADDLES` where it is on both, and 0 where nothing is cast; and into `of_scene (t,)`, 0 where it is on
    both.
    """
    corners, order = clusters.corners, clusters.order
    of_clusters = np.empty((len(corners), LANES), np.int8)

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(corners))
        face_disc(
            scene.positions,
            scene.triangles,
            corners,
            order,
            disc.source,
            disc.reach,
            start,
            stop,
            of_clusters,
            of_scene,
        )

    run(task, -(-len(corners) // _CHUNK), clock)
    return of_clusters


def cluster_tree(
    corners: NDArray[np.float32], sides: NDArray[np.int8], disc: LightDisc, frame: LightFrame, clock: Clock | None
) -> ClusterTree:
    """Bound all clusters in a frame."""
    sizes = [-(-len(corners) // LANES)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // LANES))
    level = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    region = np.empty((level[-1], REGIONS), np.float32)
    # Of children that do not exist, bounds that meet nothing.
    region[:] = np.repeat(np.array([np.inf, -np.inf, np.inf, -np.inf, -np.inf, 0, 0, 0], np.float32), LANES)

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, len(corners))
        bound_clusters(corners, sides, disc.source, disc.reach, frame, start, stop, region)

    run(task, -(-len(corners) // _CHUNK), clock)
    for depth in range(1, len(sizes)):
        bound_nodes(region, level, depth, sizes[depth - 1])
    return ClusterTree(region, level)


@kernel
def face_disc(positions, triangles, corners, order, source, reach, start, stop, of_clusters, of_scene):
    """`disc_sides` of clusters `start` to `stop`."""
    value, limit, flat = np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for cluster in range(start, stop):
        _distances(corners, cluster, source, reach, value, limit, flat)
        for lane in range(LANES):
            number = cluster * LANES + lane
            of_clusters[cluster, lane] = 0
            if number < len(order):
                t = order[number]
                side = 1 if value[lane] > limit[lane] else (-1 if value[lane] < -limit[lane] else 0)
                of_scene[t] = side
                if side == 0 and not (flat[lane] > 0.0 and _without_area(positions, triangles, t)):
                    side = STRADDLES
                of_clusters[cluster, lane] = side


@inline
def _distances(corners, cluster, source, reach, value, limit, flat):
    """n . (l - w A) of 16 triangles, what it must exceed for n . d not to change its sign, and 1.0 where n may be 0.

    Rounding is bounded as in `frustum_setup.side_of_light`; components of n are off by less than 2**-50 of their
    permanents, so |n . d| <= r (|n| + 2**-49 of all permanents).
    """
    la, lb, lc, w = source[0], source[1], source[2], source[3]
    for lane in range(LANES):
        a0, b0, c0 = _corner(corners, cluster, 0, lane)
        a1, b1, c1 = _corner(corners, cluster, 1, lane)
        a2, b2, c2 = _corner(corners, cluster, 2, lane)
        ea, eb, ec, fa, fb, fc = a1 - a0, b1 - b0, c1 - c0, a2 - a0, b2 - b0, c2 - c0
        m1, m2, m3, m4, m5, m6 = eb * fc, ec * fb, ec * fa, ea * fc, ea * fb, eb * fa
        ra, rb, rc = la - w * a0, lb - w * b0, lc - w * c0
        na, nb, nc = m1 - m2, m3 - m4, m5 - m6
        pa, pb, pc = abs(m1) + abs(m2), abs(m3) + abs(m4), abs(m5) + abs(m6)
        length = np.sqrt(na * na + nb * nb + nc * nc) * (1.0 + 2.0**-40)
        value[lane] = na * ra + nb * rb + nc * rc
        limit[lane] = 2.0**-49 * (pa * abs(ra) + pb * abs(rb) + pc * abs(rc) + reach * (pa + pb + pc)) + reach * length
        flat[lane] = 1.0 if abs(na) + abs(nb) + abs(nc) <= 2.0**-49 * (pa + pb + pc) else 0.0


@inline
def _corner(corners, cluster, number, lane):
    return (
        np.float64(corners[cluster, number, 0, lane]),
        np.float64(corners[cluster, number, 1, lane]),
        np.float64(corners[cluster, number, 2, lane]),
    )


@inline
def _without_area(positions, triangles, t):
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    return leading_sign(plane_normal_terms(vertex(positions, a), vertex(positions, b), vertex(positions, c))) == 0


@inline
def bound_regions(corners, cluster, source, reach, frame, regions, k):
    """Bounds of 16 regions of influence, `regions[k]`; returns the mask of those that have bounds at all.

    Those of the triangles' frusta, and the slopes, which hold 2**-20 for their own roundings and for those of the
    comparisons in float32 that they are made for.
    """
    bound_frusta(corners, cluster, source, frame, regions, k)
    axis = frame.axis_c
    bounded = np.int32(0)
    for lane in range(LANES):
        x0, x1, y0, y1 = _extent(regions, k, lane, frame)
        x, y, slope = max(-x0, x1), max(-y0, y1), 0.0
        if source[3] != 0.0:
            z0 = frame.sign * (np.float64(corners[cluster, 0, axis, lane]) - source[axis])
            z1 = frame.sign * (np.float64(corners[cluster, 1, axis, lane]) - source[axis])
            z2 = frame.sign * (np.float64(corners[cluster, 2, axis, lane]) - source[axis])
            nearest, farthest = min(z0, z1, z2), max(z0, z1, z2)
            clear = nearest > CLEAR_OF * reach and x < np.inf
            nothing = farthest < -CLEAR_OF * reach
            if clear:
                slope = reach / (1.0 - reach / nearest)
        else:
            x, y = abs(frame.slope_a), abs(frame.slope_b)
            room = abs(source[axis]) - reach
            clear, nothing = room > (CLEAR_OF - 1.0) * reach, False
            if clear:
                slope = reach / room
        slope *= (1.0 + 2.0**-20) * frame.hq
        slope_x, slope_y = slope * np.sqrt(1.0 + x * x) / frame.hx, slope * np.sqrt(1.0 + y * y) / frame.hy
        if clear and max(slope_x, slope_y) < STEEPEST:
            bounded |= np.int32(1) << np.int32(lane)
        else:
            far = np.float32(-np.inf if nothing else np.inf)
            regions[k, RECT_XMIN * LANES + lane], regions[k, RECT_XMAX * LANES + lane] = -far, far
            regions[k, RECT_YMIN * LANES + lane], regions[k, RECT_YMAX * LANES + lane] = -far, far
            regions[k, RECT_QMAX * LANES + lane] = far
            slope, slope_x, slope_y = 0.0, 0.0, 0.0
        regions[k, SLOPE_X * LANES + lane], regions[k, SLOPE_Y * LANES + lane] = slope_x, slope_y
        regions[k, SLOPE * LANES + lane] = slope
    return bounded


@expand
def _extent(regions, k, lane, frame):
    """A frustum's bounds in x and y, not in window units."""
    return (
        frame.x0 + frame.hx * np.float64(regions[k, RECT_XMIN * LANES + lane]),
        frame.x0 + frame.hx * np.float64(regions[k, RECT_XMAX * LANES + lane]),
        frame.y0 + frame.hy * np.float64(regions[k, RECT_YMIN * LANES + lane]),
        frame.y0 + frame.hy * np.float64(regions[k, RECT_YMAX * LANES + lane]),
    )


@inline
def put_openings(regions, planes, k, directional, frame):
    """The openings of three edges of 16 triangles, in window units. The factor covers the roundings, as above."""
    for edge in range(3):
        at, out = 3 * edge * LANES, OPENING + edge * LANES
        for lane in range(LANES):
            x0, x1, y0, y1 = _extent(regions, k, lane, frame)
            x0, x1 = (frame.slope_a, frame.slope_a) if directional else (x0, x1)
            y0, y1 = (frame.slope_b, frame.slope_b) if directional else (y0, y1)
            a, b = np.float64(planes[k, at + lane]) / frame.hx, np.float64(planes[k, at + LANES + lane]) / frame.hy
            middle = abs(a * (x0 + x1) + b * (y0 + y1)) + abs(a) * (x1 - x0) + abs(b) * (y1 - y0)
            size = np.sqrt(a * a + b * b + 0.25 * middle * middle) * (1.0 + 2.0**-20)
            planes[k, out + lane] = np.float64(regions[k, SLOPE * LANES + lane]) * size


@inline
def common_bounds(regions, k, mask, outer, at, lane, stride):
    """Write the bounds of the regions in `mask` into `outer[at]`, column by column `stride` apart from `lane` on."""
    low, high, zero = splat(np.float32(-np.inf)), splat(np.float32(np.inf)), splat(np.float32(0.0))
    for column in range(0, 4, 2):
        least = smallest(choose(mask, load(regions, k, column * LANES), high))
        most = largest(choose(mask, load(regions, k, (column + 1) * LANES), low))
        outer[at, column * stride + lane], outer[at, (column + 1) * stride + lane] = least, most
    outer[at, RECT_QMAX * stride + lane] = largest(choose(mask, load(regions, k, RECT_QMAX * LANES), low))
    outer[at, SLOPE_X * stride + lane] = largest(choose(mask, load(regions, k, SLOPE_X * LANES), zero))
    outer[at, SLOPE_Y * stride + lane] = largest(choose(mask, load(regions, k, SLOPE_Y * LANES), zero))


@kernel
def bound_clusters(corners, sides, source, reach, frame, start, stop, region):
    """Bounds of clusters `start` to `stop`, but for the triangles that cast nothing."""
    regions = np.empty((1, REGIONS), np.float32)
    for cluster in range(start, stop):
        mask = ~equal(sides, cluster, 0, np.int8(0))
        bound_regions(corners, cluster, source, reach, frame, regions, 0)
        common_bounds(regions, 0, mask, region, cluster // LANES, cluster % LANES, LANES)


@kernel
def bound_nodes(region, level, depth, below):
    """Bounds of the nodes of a level, of which there are `below`, from those of the one below."""
    for number in range(below):
        common_bounds(
            region,
            level[depth - 1] + number,
            np.int32(-1),
            region,
            level[depth] + number // LANES,
            number % LANES,
            LANES,
        )


@inline
def meeting(regions, k, xmin, xmax, ymin, ymax, qmin):
    """Mask of the 16 regions that meet a box.

    A slope of zero times infinity says nothing about the width: such regions have no bounds, or the box has none.
    """
    zero = splat(np.float32(0.0))
    ahead = load(regions, k, RECT_QMAX * LANES) - qmin
    wide_x, wide_y = load(regions, k, SLOPE_X * LANES) * ahead, load(regions, k, SLOPE_Y * LANES) * ahead
    wide_x = choose(wide_x >= np.float32(0.0), wide_x, zero)
    wide_y = choose(wide_y >= np.float32(0.0), wide_y, zero)
    return (
        (load(regions, k, RECT_XMIN * LANES) - wide_x <= xmax)
        & (load(regions, k, RECT_XMAX * LANES) + wide_x >= xmin)
        & (load(regions, k, RECT_YMIN * LANES) - wide_y <= ymax)
        & (load(regions, k, RECT_YMAX * LANES) + wide_y >= ymin)
        & (load(regions, k, RECT_QMAX * LANES) >= qmin)
    )
