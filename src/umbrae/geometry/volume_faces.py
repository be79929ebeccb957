"""How near the faces of the shadow volumes are: where a count of crossings can go wrong.

The faces
---------
- Light caps: every triangle that is not edge-on to the light and has an area.
- Side faces: every edge whose multiplicity is not zero, swept away from the light to infinity. That is the planar
  region between the edge AB and the rays from A and B along w A - l and w B - l, for a homogeneous light (l, w).

An edge in line with the light would have no plane. It never gets that far: the light then lies in the planes of all its
triangles, which are edge-on, so its multiplicity is zero. A light on a vertex takes that vertex's edges with it in the
same way. Signs are exact, so this holds however close a call it is.

Distance
--------
Each face is a flat convex region with a frame of its own: the origin in A, x along the edge AB, z along the normal
N = d x (B - A), where d is C - A for a cap and w A - l for a side face, and y = x x z, the way d lies. Then

    A = (0, 0),  B = (length, 0),  sides left(t) = A + t (d . x, height),  right(t) = B + t (d' . x, height),
    height = |N| / length,  t in [0, reach],

with d' = C - B and reach = 1 for a cap, d' = w B - l and reach = infinity for a side face. Moving a point into the
frame is a rotation and keeps distances. N is summed without rounding (`expansion.rounded_sum`), so that neither a
sliver nor an edge almost in line with the light has its plane, or its side of the edge, from rounding errors.

Rounding
--------
Let eps = 2**-53, and r the distance of the point to A. Counting roundings: x is off by 6 eps, z by 12 eps (each
component of N 4 eps, its length 3 more, the division 1), y by 22 eps. A point's coordinates in the frame are then off
by 10, 26 and 16 eps r, together 32 eps r. The directions of left and right are off by 16 eps, B by 4 eps length. The
nearest point Q of a face has |Q - A| <= 2 r, as A itself is at r: that shifts the boundary near Q by at most
32 eps r + 20 eps length. Feet of perpendiculars, residues and square roots add 19 eps (r + length). Whether the point
is inside is asked along a line parallel to x, and a wrong answer means that it lies within 10 eps (r + length) of the
boundary. The sum is at most 93 eps r + 49 eps length, and so below `ROUNDING` (r + length), which is subtracted.

No scaling is needed: with coordinates from 1e-45 to 1e18, N has components from 1e-90 to 1e37 (or zero), `height` is
at least 1e-109, and the squares of all these are float64 numbers.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry import predicates
from umbrae.geometry.edges import Edges, edges, first_equal, weld
from umbrae.geometry.expansion import rounded_sum
from umbrae.geometry.morton import morton3
from umbrae.geometry.vectors import cross, dot, row, scale, subtract
from umbrae.parallel import inline, kernel, run

ROUNDING = 2.0**-46
"""Of a point's distance to A and the length of AB: what a distance may be off by."""

_NO_CAP = -2  # not -1, which is a point without a triangle
_POINTS = 64  # per task: they stay in the cache while all faces pass by
_ROWS = 1 << 14  # triangles or faces per task


class Faces(NamedTuple):
    """Flat convex regions in frames of their own.

    `origin`, `along`, `normal` are `(f, 3) float64`: A, and the unit vectors x and z. `shape (f, 6) float64` holds
    length, left's x, right's x, height, reach and the radius around A that holds the face. `cap (f,) int32` is the
    triangle of a light cap, -2 for a side face.
    """

    origin: NDArray[np.float64]
    along: NDArray[np.float64]
    normal: NDArray[np.float64]
    shape: NDArray[np.float64]
    cap: NDArray[np.int32]


def facing_of_all(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], light: NDArray[np.float32]
) -> NDArray[np.int8]:
    """`(t,) int8` the side of each triangle's plane that the light is on, exact: +1, -1; 0 edge-on or without area."""
    facing = np.empty(len(triangles), np.int8)
    source = light.astype(np.float64)

    def task(chunk: int) -> None:
        start, stop = chunk * _ROWS, min((chunk + 1) * _ROWS, len(triangles))
        facing_chunk(positions, triangles, source, start, stop, facing)

    run(task, -(-len(triangles) // _ROWS))
    return facing


def multiplicity(topology: Edges, facing: NDArray[np.int8]) -> NDArray[np.int32]:
    """`(e,) int32` how often each edge is swept into a side face, signed (Kim et al. 2008; Milet et al., Algorithm 3).

    The sum of `facing (t,)` times direction along the edge over the triangles that meet there. Flipping a triangle's
    winding changes both and leaves the sum alone.
    """
    return topology.total(facing[topology.triangle] * topology.sign)


def volume_faces(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], light: NDArray[np.float32], inner: bool = False
) -> Faces:
    """Light caps, then side faces, of `positions (v, 3)` and `triangles (t, 3)` under a homogeneous `light (4,)`.

    With `inner`, sides between neighbours count as well: over every edge of a triangle that casts.
    """
    facing = facing_of_all(positions, triangles, light)
    caps = np.flatnonzero(facing).astype(np.int32)
    vertex = weld(positions)
    topology = edges(vertex[triangles])
    one = np.empty(len(positions), np.int32)  # some vertex at each welded position
    one[vertex] = np.arange(len(positions), dtype=np.int32)
    drawn = topology.total(np.abs(facing)[topology.triangle]) if inner else multiplicity(topology, facing)
    swept = one[topology.vertices[drawn != 0]]
    count = len(caps) + len(swept)
    cap = np.full(count, _NO_CAP, np.int32)
    cap[: len(caps)] = caps
    faces = Faces(np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 6)), cap)
    corners, source = positions.astype(np.float64), light.astype(np.float64)

    def task(chunk: int) -> None:
        start, stop = chunk * _ROWS, min((chunk + 1) * _ROWS, count)
        faces_chunk(corners, triangles, source, swept, len(caps), start, stop, *faces)

    run(task, -(-count // _ROWS))
    return faces


def face_distance(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    light: NDArray[np.float32],
    points: NDArray[np.float64],
    own: NDArray[np.int32] | None = None,
    inner: bool = False,
) -> NDArray[np.float64]:
    """A lower bound, short by float64's rounding only, of the distance to the nearest face of any shadow volume.

    Parameters
    ----------
    positions, triangles
        `(v, 3) float32` world units, `(t, 3) int32`.
    light
        `(4,) float32`, homogeneous with w exactly 0 (towards the light) or 1.
    points
        `(n, 3) float64` world units.
    own
        `(n,) int32` the triangle each point lies on, whose cap is left out for it: that distance is always zero
        and says nothing; those of equal triangles as well. -1, or None for all, leaves nothing out.
    inner
        Whether sides between neighbouring triangles are faces as well.

    Returns
    -------
    `(n,) float64` world units; infinite where there is no face.
    """
    distance = np.full(len(points), np.inf)
    if len(points) == 0:
        return distance
    faces = volume_faces(positions, triangles, light, inner)
    # Equal triangles are one surface: the caps of all of them are left out, under the number of the first.
    surface = np.append(first_equal(np.sort(weld(positions)[triangles], axis=1)), np.int32(-1))
    caps = faces.cap != _NO_CAP
    faces.cap[caps] = surface[faces.cap[caps]]
    mine = surface[np.full(len(points), -1, np.int32) if own is None else own]
    order = np.argsort(morton3(points), kind="stable")
    sorted_points, sorted_own, sorted_distance = points[order], mine[order], np.full(len(points), np.inf)

    def task(chunk: int) -> None:
        start, stop = chunk * _POINTS, min((chunk + 1) * _POINTS, len(points))
        distance_chunk(*faces, sorted_points, sorted_own, start, stop, sorted_distance)

    run(task, -(-len(points) // _POINTS))
    distance[order] = np.maximum(sorted_distance, 0.0)
    return distance


@kernel
def facing_chunk(positions, triangles, light, start, stop, facing):
    """Fill `facing[start:stop]`."""
    for t in range(start, stop):
        facing[t] = predicates.facing(positions, triangles, t, light)


@kernel
def faces_chunk(positions, triangles, light, swept, caps, start, stop, origin, along, normal, shape, cap):
    """Fill rows `start` to `stop` of the faces: `caps` caps first, then one face for each edge of `swept (s, 2)`.

    `positions (v, 3)` are float64 here, holding float32 values.
    """
    source, w = (light[0], light[1], light[2]), light[3]
    for f in range(start, stop):
        if f < caps:
            i, j, k = triangles[cap[f], 0], triangles[cap[f], 1], triangles[cap[f], 2]
            a, b, c = row(positions, i), row(positions, j), row(positions, k)
            left, right, reach = subtract(c, a), subtract(c, b), 1.0
            terms = predicates.plane_normal_terms(
                predicates.vertex(positions, i), predicates.vertex(positions, k), predicates.vertex(positions, j)
            )
        else:
            i, j = swept[f - caps, 0], swept[f - caps, 1]
            a, b = row(positions, i), row(positions, j)
            left, right, reach = subtract(scale(w, a), source), subtract(scale(w, b), source), np.inf
            terms = predicates.side_normal_terms(
                predicates.vertex(positions, i), predicates.vertex(positions, j), light
            )
        n = rounded_sum(terms, 0, 6), rounded_sum(terms, 1, 6), rounded_sum(terms, 2, 6)
        edge = subtract(b, a)
        length, area = np.sqrt(dot(edge, edge)), np.sqrt(dot(n, n))
        for axis in range(3):
            origin[f, axis] = a[axis]
            along[f, axis] = edge[axis] / length
            normal[f, axis] = n[axis] / area
        x = row(along, f)
        shape[f, 0], shape[f, 1], shape[f, 2] = length, dot(left, x), dot(right, x)
        shape[f, 3], shape[f, 4] = area / length, reach
        shape[f, 5] = max(length, np.sqrt(dot(left, left))) if f < caps else np.inf


@kernel
def distance_chunk(origin, along, normal, shape, cap, points, own, start, stop, distance):
    """Lower `distance[start:stop]` to the bound for each point: face by face, so that each is read once for all.

    Most caps are too far as a whole, most side faces as planes, and that for all points, which lie in a ball.
    """
    center = row(points, (start + stop) // 2)
    spread = 0.0
    for i in range(start, stop):
        p = subtract(row(points, i), center)
        spread = max(spread, np.sqrt(dot(p, p)))
    farthest = np.inf
    for f in range(len(origin)):
        a, x, z = row(origin, f), row(along, f), row(normal, f)
        length, radius = shape[f, 0], shape[f, 5]
        if too_far(subtract(center, a), z, length, radius, spread, farthest):
            continue
        y = cross(x, z)
        lowered = False
        for i in range(start, stop):
            p = subtract(row(points, i), a)
            if own[i] == cap[f] or too_far(p, z, length, radius, 0.0, distance[i]):
                continue
            off_plane = dot(p, z)
            in_plane = region_distance_squared(
                dot(p, x), dot(p, y), length, shape[f, 1], shape[f, 2], shape[f, 3], shape[f, 4]
            )
            bound = np.sqrt(in_plane + off_plane * off_plane) - ROUNDING * (np.sqrt(dot(p, p)) + length)
            if bound < distance[i]:
                distance[i] = bound
                lowered = True
        if lowered:
            farthest = distance[start:stop].max()


@inline
def too_far(p, normal, length, radius, spread, limit):
    """Whether no point in a ball of radius `spread` around A + p has a face nearer than `limit`.

    That is, whether ball and face lie apart in space or along the normal; 2**-40 of it all outweighs any rounding.
    """
    near = limit + radius + spread
    if dot(p, p) > near * near * (1.0 + 2.0**-40):
        return True
    slack = 2.0**-40 * (abs(p[0]) + abs(p[1]) + abs(p[2]) + length + spread)
    return abs(dot(p, normal)) - slack > limit + spread


@inline
def region_distance_squared(x, y, length, left, right, height, reach):
    """Squared distance in its plane from (x, y) to a face; 0 inside."""
    t = y / height
    if 0.0 <= t <= reach and t * left <= x <= length + t * right:
        return 0.0
    beside = x - min(max(x, 0.0), length)
    return min(
        beside * beside + y * y,
        side_distance_squared(x, y, left, height, reach),
        side_distance_squared(x - length, y, right, height, reach),
    )


@inline
def side_distance_squared(x, y, dx, dy, reach):
    """Squared distance from (x, y) to the points t (dx, dy) with t from 0 to `reach`."""
    t = min(max((x * dx + y * dy) / (dx * dx + dy * dy), 0.0), reach)
    x, y = x - t * dx, y - t * dy
    return x * x + y * y
