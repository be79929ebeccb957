"""What z-pass must know of the eye: where its counter starts, and which caps a view ray may cross.

The counter starts at the number of volumes that hold the eye. Every view ray starts there, so one number serves the
whole picture. It is right as long as the eye that OpenGL computes with, rounded to float32, lies in the same volumes:
that is, farther from all their faces than the rounding.

A light cap is a triangle of the scene, so no ray crosses one on its way to what it sees: caps need not be drawn. Two
kinds are exceptions: what lies nearer than the near plane, and triangles at a contour. The latter because the
rasterizer moves vertices to its subpixel grid, so a volume may reach over a pixel's centre that the ray of the exact
sample misses; the ray then enters through a side and leaves through the cap. Away from contours, where as many
triangles lie on one side of each edge as on the other, the ray meets the neighbour instead.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.predicates import facing, filtered_determinant
from umbrae.parallel import inline, kernel, run

_CHUNK = 1 << 14


class EyeCount(NamedTuple):
    """`volumes`: how many hold the eye; `clear`: whether it keeps its distance from every face of every volume."""

    volumes: int
    clear: bool


def count_at_eye(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    light: NDArray[np.float32],
    eye: NDArray[np.float64],
    distance: float,
) -> EyeCount:
    """Count the triangles whose shadow volume holds `eye (3,)`; `distance` in world units is what faces must keep."""
    chunks = _chunks(len(triangles))
    source = light.astype(np.float64)

    def task(index: int) -> tuple[int, int]:
        held, near = _count(positions, triangles, source, eye, distance, *chunks[index])
        return held, near

    found = run(task, len(chunks))
    return EyeCount(sum(held for held, _ in found), not any(near for _, near in found))


@inline
def _normal_length(rx, ry, rz, ex, ey, ez):
    x, y, z = ry * ez - rz * ey, rz * ex - rx * ez, rx * ey - ry * ex
    return np.sqrt(x * x + y * y + z * z)


@inline
def _signed_distance(rx, ry, rz, ex, ey, ez, dx, dy, dz):
    """Of the point at `d` from the plane spanned by r and e, in float64; 0 where they span none."""
    value, _ = filtered_determinant(rx, ry, rz, ex, ey, ez, dx, dy, dz, 0.0)
    length = _normal_length(rx, ry, rz, ex, ey, ez)
    return value / length if length > 0.0 else 0.0


@kernel
def _count(positions, triangles, light, eye, distance, start, stop):
    held, near = 0, 0
    corner = np.empty((3, 3))
    for t in range(start, stop):
        for k in range(3):
            for axis in range(3):
                corner[k, axis] = positions[triangles[t, k], axis]
        toward = facing(positions, triangles, t, light)
        if toward == 0:
            continue
        a = corner[0]
        least = -toward * _signed_distance(
            corner[1, 0] - a[0], corner[1, 1] - a[1], corner[1, 2] - a[2],
            corner[2, 0] - a[0], corner[2, 1] - a[1], corner[2, 2] - a[2],
            eye[0] - a[0], eye[1] - a[1], eye[2] - a[2],
        )  # fmt: skip
        for k in range(3):
            if least < -distance:
                break
            p, q = corner[k], corner[(k + 1) % 3]
            least = min(least, -toward * _signed_distance(
                light[3] * p[0] - light[0], light[3] * p[1] - light[1], light[3] * p[2] - light[2],
                q[0] - p[0], q[1] - p[1], q[2] - p[2],
                eye[0] - p[0], eye[1] - p[1], eye[2] - p[2],
            ))  # fmt: skip
        if least > distance:
            held += 1
        elif least >= -distance:
            near += 1
    return held, near


def contour_vertices(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    offsets: NDArray[np.int64],
    edge_triangle: NDArray[np.int32],
    edge_sign: NDArray[np.int8],
    edge_vertices: NDArray[np.int32],
    eye: NDArray[np.float64],
    wanted: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """`(v,)` the vertices of edges with more triangles on one side than on the other, seen from `eye (3,)`.

    Right for the vertices `wanted (v,)`; what is far from them is not looked at.
    """
    side = np.empty(len(triangles), np.int8)
    marked = np.zeros(len(positions), bool)
    triangle_chunks, edge_chunks = _chunks(len(triangles)), _chunks(len(edge_vertices))
    run(lambda i: _sides(positions, triangles, eye, wanted, *triangle_chunks[i], side), len(triangle_chunks))
    run(
        lambda i: _mark(offsets, edge_triangle, edge_sign, edge_vertices, side, wanted, *edge_chunks[i], marked),
        len(edge_chunks),
    )
    return marked


def crossed_caps(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    at_contour: NDArray[np.bool_],
    casting: NDArray[np.bool_],
    world_to_clip: NDArray[np.float64],
    near: float,
    slack: float,
) -> NDArray[np.bool_]:
    """`(t,)` the triangles whose caps a view ray may cross.

    Those `casting (t,)` that touch a vertex `at_contour (v,)`, or reach before the `near` plane; unless they lie out of
    the picture, by more than `slack` as a share of it.
    """
    crossed = np.zeros(len(triangles), bool)
    chunks = _chunks(len(triangles))
    arrays = positions, triangles, at_contour, casting, world_to_clip
    run(lambda i: _crossed(*arrays, near, slack, *chunks[i], crossed), len(chunks))
    return crossed


def _chunks(count: int) -> list[tuple[int, int]]:
    return [(start, min(start + _CHUNK, count)) for start in range(0, count, _CHUNK)]


@kernel
def _sides(positions, triangles, eye, wanted, start, stop, side):
    """The side of each triangle that the eye sees, in float64; 0 where rounding leaves it open."""
    for t in range(start, stop):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if not (wanted[i] or wanted[j] or wanted[k]):
            continue
        ax, ay, az = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
        value, bound = filtered_determinant(
            positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az,
            positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az,
            eye[0] - ax, eye[1] - ay, eye[2] - az, 0.0,
        )  # fmt: skip
        side[t] = 1 if value > bound else (-1 if value < -bound else 0)


@kernel
def _mark(offsets, edge_triangle, edge_sign, edge_vertices, side, wanted, start, stop, marked):
    for edge in range(start, stop):
        if not (wanted[edge_vertices[edge, 0]] or wanted[edge_vertices[edge, 1]]):
            continue
        total = 0
        open_case = False
        for entry in range(offsets[edge], offsets[edge + 1]):
            seen = side[edge_triangle[entry]]
            total += edge_sign[entry] * seen
            open_case = open_case or seen == 0
        if total != 0 or open_case:
            marked[edge_vertices[edge, 0]] = True
            marked[edge_vertices[edge, 1]] = True


@kernel
def _crossed(positions, triangles, at_contour, casting, world_to_clip, near, slack, start, stop, crossed):
    for t in range(start, stop):
        if not casting[t]:
            continue
        chosen = False
        left, right, below, above, behind = True, True, True, True, True
        for k in range(3):
            v = triangles[t, k]
            px, py, pz = np.float64(positions[v, 0]), np.float64(positions[v, 1]), np.float64(positions[v, 2])
            m = world_to_clip
            x = m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]
            y = m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]
            w = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
            chosen = chosen or at_contour[v] or w < near
            room = slack * (abs(x) + abs(y) + abs(w))
            left = left and x + w < -room
            right = right and w - x < -room
            below = below and y + w < -room
            above = above and w - y < -room
            behind = behind and w < -room
        crossed[t] = chosen and not (left or right or below or above or behind)


def light_spread(positions: NDArray[np.float32], edge_vertices: NDArray[np.int32], light: NDArray[np.float32]) -> float:
    """How much wider an edge is than its distance from the point light, at most: (|A - L| + |B - L|) / distance.

    Seen from a light close by, the two ends lie in nearly opposite directions. What is between them, far behind the
    edge, is the small difference of the two, and has their roundings. Edges through the light are left out: their
    triangles are edge-on and cast nothing. At least 2.
    """
    source = light.astype(np.float64)
    chunks = _chunks(len(edge_vertices))
    return max(run(lambda i: _spread(positions, edge_vertices, source, *chunks[i]), len(chunks)), default=2.0)


@kernel
def _spread(positions, edge_vertices, light, start, stop):
    most = 2.0
    for edge in range(start, stop):
        i, j = edge_vertices[edge, 0], edge_vertices[edge, 1]
        ax, ay, az = positions[i, 0] - light[0], positions[i, 1] - light[1], positions[i, 2] - light[2]
        bx, by, bz = positions[j, 0] - light[0], positions[j, 1] - light[1], positions[j, 2] - light[2]
        ex, ey, ez = bx - ax, by - ay, bz - az
        # Only where the foot of the perpendicular lies on the edge do the ends lie on both sides of it.
        if ax * ex + ay * ey + az * ez < 0.0 and bx * ex + by * ey + bz * ez > 0.0:
            area = _normal_length(ax, ay, az, bx, by, bz)
            length = np.sqrt(ex * ex + ey * ey + ez * ez)
            if area > 2.0**-40 * length * length:
                ends = np.sqrt(ax * ax + ay * ay + az * az) + np.sqrt(bx * bx + by * by + bz * bz)
                most = max(most, ends * length / area)
    return most
