"""Triangles drawn into a depth buffer, sample by sample, with the signs of exact arithmetic."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.parallel import expand, inline, kernel
from umbrae.sampling.bands import Geometry, Picture, corners, has_area
from umbrae.sampling.coverage import FILTER, Vertex, barycentric, cells, covers, extent, orientation
from umbrae.sampling.groups import SIZE, View
from umbrae.sampling.holes import EVERYWHERE, NOTHING, NOWHERE, Surface
from umbrae.transmission import surface_at

_WIDE = 8
"""A row's span is narrowed before its pixels are tested when the triangle's box is wider than this."""


ALL = np.zeros(0, bool)
"""For `draw`: every triangle is wanted."""


class Floor(NamedTuple):
    """What has been peeled off: only what lies behind it, in order of (distance, triangle), is drawn.

    Attributes
    ----------
    depth
        Per sample of a band, distance in float64; infinite where nothing more is to be drawn. No entries before the
        first layer.
    triangle
        Per sample, the triangle at that distance.
    box
        `(4,)` first and last row, first and last column, outside of which nothing is to be drawn.
    """

    depth: NDArray[np.float64]
    triangle: NDArray[np.int32]
    box: NDArray[np.int32]

    @classmethod
    def before_all(cls, picture: Picture) -> "Floor":
        """Nothing has been peeled off."""
        return cls(
            np.empty(0), np.empty(0, np.int32), np.array([0, picture.height - 1, 0, picture.width - 1], np.int32)
        )

    @classmethod
    def of(cls, samples: int) -> "Floor":
        """Room for a band; not initialized."""
        return cls(np.empty(samples), np.empty(samples, np.int32), np.empty(4, np.int32))


class Drawn(NamedTuple):
    """A triangle on its way into the picture.

    Vertices are in order of their place: coincident triangles of any winding get bitwise equal depths. `s` is the
    orientation in that order, 0 if nothing is to be seen, `side` the side that is seen. Edge functionals `a x + b y +
    c` are positive inside; `e0` is opposite to `p`.
    """

    p: Vertex
    q: Vertex
    r: Vertex
    s: int
    side: int
    e0: Vertex
    e1: Vertex
    e2: Vertex


@expand
def drawn(p: Vertex, q: Vertex, r: Vertex) -> Drawn:
    """A triangle by its corners in the picture."""
    s = orientation(p, q, r)
    side = -s
    if q < p:
        p, q, s = q, p, -s
    if r < q:
        q, r, s = r, q, -s
    if q < p:
        p, q, s = q, p, -s
    return Drawn(p, q, r, s, side, _functional(q, r, s), _functional(r, p, s), _functional(p, q, s))


@expand
def _functional(p: Vertex, q: Vertex, s: int) -> Vertex:
    return s * (p[1] * q[2] - p[2] * q[1]), s * (p[2] * q[0] - p[0] * q[2]), s * (p[0] * q[1] - p[1] * q[0])


@expand
def _distance(p: Vertex, q: Vertex, r: Vertex, e0: float, e1: float, e2: float) -> float:
    """Along the view direction, by the values of the edge functionals, none of them negative."""
    w = p[2]
    if e1 + e2 > 0.0:
        w += (e1 * (q[2] - p[2]) + e2 * (r[2] - p[2])) / (e0 + e1 + e2)
    return w


@inline
def _narrow(a: float, rest: float, bound: float, offset: float, first: int, last: int) -> tuple[int, int]:
    """Drop columns where `a x + rest` is certainly below `-bound`.

    Twice the bound leaves room for the rounding of the numerator, a thousandth of a pixel for that of the
    quotient (2**-36 for quotients below 2**17; those beyond lie outside of the picture either way).
    """
    if a > 0.0:
        at = (-2.0 * bound - rest) / a - offset - 1e-3
        if at > first:
            first = math.ceil(min(at, last + 1.0))
    elif a < 0.0:
        at = (-2.0 * bound - rest) / a - offset + 1e-3
        if at < last:
            last = math.floor(max(at, first - 1.0))
    elif rest < -bound:
        last = first - 1
    return first, last


@expand
def _beyond(a: Vertex, b: Vertex, c: Vertex, near: float, first: float, last: float) -> bool:
    """Whether a triangle lies behind the near plane, and above row `first` or below row `last`."""
    if min(a[2], b[2], c[2]) < near:
        return False
    above = a[1] < first * a[2] and b[1] < first * b[2] and c[1] < first * c[2]
    return above or (a[1] > last * a[2] and b[1] > last * b[2] and c[1] > last * c[2])


@expand
def _next_group(
    rows: NDArray[np.int32],
    columns: NDArray[np.int32],
    least: NDArray[np.float64],
    group: int,
    first_row: int,
    last_row: int,
    first_column: int,
    last_column: int,
    nearest: NDArray[np.float64],
    top: int,
    width: int,
    per_pixel: int,
) -> int:
    """The first group from `group` on that may show in a part of the picture; how many there are, if none does."""
    while group < len(rows):
        left, right = max(columns[group, 0], first_column), min(columns[group, 1], last_column)
        for row in range(max(rows[group, 0], first_row), min(rows[group, 1], last_row) + 1):
            begin = (row - top) * width
            for at in range((begin + left) * per_pixel, (begin + right + 1) * per_pixel):
                if not nearest[at] < least[group]:
                    return group
        group += 1
    return group


@kernel
def draw(
    geometry: Geometry,
    view: View,
    wanted: NDArray[np.bool_],
    picture: Picture,
    surface: Surface,
    top: int,
    bottom: int,
    floor: Floor,
    nearest: NDArray[np.float64],
    triangle: NDArray[np.int32],
    side: NDArray[np.int8],
) -> None:
    """Draw triangles into the depth buffer of rows `top` to `bottom` (excluded).

    Of a view's groups those are left out whose box lies behind all that is there already. The picture is the same in
    any order: where a triangle ties with what is there, the lower index wins. `wanted (t,)` has no entries where all
    triangles are.
    """
    width, height, per_pixel = picture.width, picture.height, len(picture.x)
    holes, table = surface
    material_id, _, _, base, _, cutoff, mode, uv, colors, texels, offset, size = table[1:]
    triangles, order = geometry.triangles, view.order
    floor_depth, floor_triangle, box = floor
    peeling = len(floor_depth) > 0
    left_most, right_most, top_most, bottom_most = picture.x.min(), picture.x.max(), picture.y.min(), picture.y.max()
    first_row, last_row = max(top, box[0]), min(bottom - 1, box[1])
    group, at_triangle, stop = 0, 0, 0
    while True:
        if at_triangle == stop:
            group = _next_group(
                view.rows, view.columns, view.least, group, first_row, last_row, box[2], box[3],
                nearest, top, width, per_pixel,
            )  # fmt: skip
            if group == len(view.chosen):
                return
            at_triangle = view.chosen[group] * SIZE
            stop = min(at_triangle + SIZE, len(order))
            view.drawn[group] = True
            group += 1
        t = order[at_triangle]
        at_triangle += 1
        if holes[t] == EVERYWHERE or (len(wanted) > 0 and not wanted[t]):
            continue
        a, b, c = corners(geometry, t)
        if _beyond(a, b, c, picture.near, first_row - 0.01, last_row + 1.01):
            continue
        low, high = extent(a, b, c, picture.near, 1)
        upper, lower = cells(low, high, top_most, bottom_most, height)
        upper, lower = max(upper, first_row), min(lower, last_row)
        if upper > lower:
            continue
        low, high = extent(a, b, c, picture.near, 0)
        left, right = cells(low, high, left_most, right_most, width)
        left, right = max(left, box[2]), min(right, box[3])
        if left > right or not has_area(geometry.positions, triangles, t):
            continue
        p, q, r, s, seen_side, f0, f1, f2 = drawn(a, b, c)
        if s == 0:
            continue
        most_x = max(abs(p[0]), abs(q[0]), abs(r[0]))
        most_y = max(abs(p[1]), abs(q[1]), abs(r[1]))
        most_w = max(abs(p[2]), abs(q[2]), abs(r[2]))
        bound = FILTER * 2.0 * (most_w * (most_y * width + most_x * height) + most_x * most_y)
        has_holes = holes[t] != NOWHERE
        wide = right - left >= _WIDE
        for row in range(upper, lower + 1):
            for k in range(per_pixel):
                y = row + picture.y[k]
                rest0, rest1, rest2 = f0[1] * y + f0[2], f1[1] * y + f1[2], f2[1] * y + f2[2]
                first, last = left, right
                if wide:
                    first, last = _narrow(f0[0], rest0, bound, picture.x[k], first, last)
                    first, last = _narrow(f1[0], rest1, bound, picture.x[k], first, last)
                    first, last = _narrow(f2[0], rest2, bound, picture.x[k], first, last)
                for column in range(first, last + 1):
                    x = column + picture.x[k]
                    e0, e1, e2 = f0[0] * x + rest0, f1[0] * x + rest1, f2[0] * x + rest2
                    least = min(e0, e1, e2)
                    if least < -bound:
                        continue
                    if not least > bound:
                        if not covers(p, q, r, s, (x, y, 1.0)):
                            continue
                        e0, e1, e2 = max(e0, 0.0), max(e1, 0.0), max(e2, 0.0)
                    w = _distance(p, q, r, e0, e1, e2)
                    at = ((row - top) * width + column) * per_pixel + k
                    if w <= nearest[at] and w >= picture.near:
                        if w == nearest[at] and triangle[at] < t:
                            continue
                        if peeling and (w < floor_depth[at] or (w == floor_depth[at] and t <= floor_triangle[at])):
                            continue
                        if has_holes:
                            u, v = barycentric(a, b, c, x, y)
                            _, _, _, opacity = surface_at(
                                triangles, material_id, base, cutoff, mode, uv, colors, texels, offset, size,
                                t, 1.0 - u - v, u, v,
                            )  # fmt: skip
                            if opacity < NOTHING:
                                continue
                        nearest[at] = w
                        triangle[at] = t
                        side[at] = seen_side


@kernel
def place(
    geometry: Geometry,
    picture: Picture,
    top: int,
    bottom: int,
    tolerance: float,
    nearest: NDArray[np.float64],
    triangle: NDArray[np.int32],
    side: NDArray[np.int8],
    refused: NDArray[np.bool_],
) -> None:
    """Find distance and side for triangles that were chosen elsewhere, by the arithmetic of `draw`.

    A sample that a triangle does not hold exactly gets the distance at the edge beside it. Triangles that should not
    have been chosen are marked in `refused (t,)`: those without area, seen edge-on, before the near plane, or farther
    than `tolerance` in pixels from the sample.
    """
    at = 0
    for row in range(top, bottom):
        for column in range(picture.width):
            for k in range(len(picture.x)):
                nearest[at], side[at] = np.inf, 0
                t = triangle[at]
                if t >= 0:
                    a, b, c = corners(geometry, t)
                    p, q, r, s, seen_side, f0, f1, f2 = drawn(a, b, c)
                    x, y = column + picture.x[k], row + picture.y[k]
                    e0, e1, e2 = _value(f0, x, y), _value(f1, x, y), _value(f2, x, y)
                    w = _distance(p, q, r, max(e0, 0.0), max(e1, 0.0), max(e2, 0.0))
                    beside = _beside(f0, e0, tolerance) or _beside(f1, e1, tolerance) or _beside(f2, e2, tolerance)
                    if s == 0 or beside or w < picture.near or not has_area(geometry.positions, geometry.triangles, t):
                        refused[t] = True
                    nearest[at], side[at] = w, seen_side
                at += 1


@inline
def _value(functional: Vertex, x: float, y: float) -> float:
    """Of an edge functional at a sample."""
    return functional[0] * x + (functional[1] * y + functional[2])


@inline
def _beside(functional: Vertex, value: float, tolerance: float) -> bool:
    """Whether a sample lies farther outside of an edge than `tolerance` in pixels."""
    return value < -tolerance * math.hypot(functional[0], functional[1])
