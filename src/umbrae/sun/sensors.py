"""Sensors on the faces of a scene: one in each, or a regular grid over them."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import instance, number
from umbrae.errors import InputError
from umbrae.memory import available_bytes, require
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_BYTES_PER_SENSOR, _BYTES_PER_LINE = 240, 400
"""While a grid is made of scan lines and checked, measured."""
_FINEST = 2.0**-50
"""Spacing as a share of the largest coordinate: float64 must tell grid points apart."""
_NORMAL_STEPS = 2.0**20
"""Normals that agree to a millionth share one grid: the triangles of a flat wall do, up to rounding."""


class Grid(NamedTuple):
    """Every face in the grid coordinates of its plane, in units of the spacing: `(f, 3)` x and y of its corners."""

    face: NDArray[np.intp]
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def surface_sensors(scene: Scene, spacing: float | None = None, side: int = 1) -> ViewSamples:
    """Sensors `(n,)` on all faces that have an area, face by face.

    Parameters
    ----------
    spacing
        World units between neighbours of a square grid in the plane of each face; the triangles of a flat wall share
        one. A face that no grid point meets gets one sensor, in its middle. Without a spacing every face does.
    side
        +1: the side that a face's corners turn counter-clockwise to; -1: the other.

    Raises
    ------
    InputError
        For a spacing that is not positive, a side other than +1 and -1, or a scene without a face that has an area.
    CapacityError
        When the sensors would not fit into memory; says which spacing would.
    """
    instance(scene, Scene, "scene")
    if side not in (1, -1):
        raise InputError(f"side: wanted 1 or -1, got {side}")
    if spacing is not None and not number(spacing, "spacing") > 0.0:
        raise InputError(f"spacing: wanted a distance > 0, got {spacing}")
    normal, area = facets(scene)
    face = np.flatnonzero(area > 0.0)
    if len(face) == 0:
        raise InputError("the scene has no face with an area: there is nothing for the sun to shine on")
    middle = np.full((len(face), 2), 1 / 3)
    if spacing is None:
        require(len(face) * _BYTES_PER_SENSOR, f"a sensor on each of {len(face):,} faces")
        return ViewSamples.on_surface(scene, face, middle, side)
    grid = _grid(scene, face, normal[face], float(spacing))
    _require(grid, area[face], float(spacing))
    own, uv = _grid_points(grid)
    bare = np.setdiff1d(face, own)
    own = np.concatenate([own, bare])
    uv = np.concatenate([uv, middle[: len(bare)]])
    order = np.argsort(own, kind="stable")
    return ViewSamples.on_surface(scene, own[order], uv[order], side)


def both_sides(sensors: ViewSamples) -> ViewSamples:
    """Sensors `(2, n)`: the side that each of `(n,)` is on, then the other."""
    return ViewSamples(
        triangle=np.stack([sensors.triangle] * 2),
        barycentric=np.stack([sensors.barycentric] * 2),
        side=np.stack([sensors.side, -sensors.side]),
        position=np.stack([sensors.position] * 2),
        covered=np.stack([sensors.covered] * 2),
    )


def facets(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals `(t, 3)` and areas `(t,)` of all triangles; zero normals for those without an area."""
    corners = scene.positions.astype(np.float64)[scene.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    unit = np.divide(normal, length[:, None], out=np.zeros_like(normal), where=length[:, None] > 0)
    return unit, length / 2


def _require(grid: Grid, area: NDArray[np.float64], spacing: float) -> None:
    # Not a number, when a spacing next to nothing divided by: refused as well.
    if not max(np.abs(grid.x).max(), np.abs(grid.y).max()) <= 1.0 / _FINEST:
        raise InputError(f"spacing: {spacing:g} is too fine for coordinates this far from zero")
    lines = float((grid.y.max(axis=1) - grid.y.min(axis=1)).sum()) * spacing * _BYTES_PER_LINE
    points = float(area.sum()) * _BYTES_PER_SENSOR
    always = len(grid.face) * _BYTES_PER_SENSOR
    size = points / spacing / spacing + lines / spacing + always
    room = 0.9 * (available_bytes() - always)
    # Where points / s**2 + lines / s = room.
    hint = f" ({(lines + math.sqrt(lines**2 + 4 * points * room)) / (2 * room):.2g} would fit)" if room > 0 else ""
    require(int(min(size, 2.0**62)), f"a grid of sensors with a spacing of {spacing:g}{hint}")


def _grid(scene: Scene, face: NDArray[np.intp], normal: NDArray[np.float64], spacing: float) -> Grid:
    """Grid axes from the normal alone: the same for all triangles of a plane."""
    normal = np.round(normal * _NORMAL_STEPS)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # The coordinate axis farthest from the normal spans the plane with it; ties go to the first.
    least = np.argmin(np.round(np.abs(normal), 6), axis=1)
    along = np.cross(np.eye(3)[least], normal)
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normal, along)
    # A spacing next to nothing gives infinities, which `_require` refuses.
    with np.errstate(over="ignore", invalid="ignore"):
        corners = scene.positions.astype(np.float64)[scene.triangles[face]] / spacing
        return Grid(face, np.einsum("fki,fi->fk", corners, along), np.einsum("fki,fi->fk", corners, across))


def _grid_points(grid: Grid) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Faces and barycentrics of the grid points (halves of odd numbers) inside each face.

    Scan lines with half-open spans, each edge crossed from its lower to its upper end: a point on an edge that two
    triangles of a plane share belongs to one of them.
    """
    first = np.ceil(grid.y.min(axis=1) - 0.5).astype(np.int64)
    lines = np.ceil(grid.y.max(axis=1) - 0.5).astype(np.int64) - first
    of_line, line = _ranges(first, lines)
    left, right = _span(grid.x[of_line], grid.y[of_line], line + np.float64(0.5))
    start = np.ceil(left - 0.5).astype(np.int64)
    of_point, column = _ranges(start, np.maximum(np.ceil(right - 0.5).astype(np.int64) - start, 0))
    own = of_line[of_point]
    x, y = grid.x[own], grid.y[own]
    px, py = column + 0.5 - x[:, 0], line[of_point] + 0.5 - y[:, 0]
    bx, by, cx, cy = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0], x[:, 2] - x[:, 0], y[:, 2] - y[:, 0]
    doubled = bx * cy - by * cx
    u = np.clip((px * cy - py * cx) / doubled, 0.0, 1.0)
    v = np.clip((bx * py - by * px) / doubled, 0.0, 1.0 - u)
    return grid.face[own], np.stack([u, v], axis=1)


def _span(
    x: NDArray[np.float64], y: NDArray[np.float64], height: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a horizontal line at `height` (l,) enters and leaves triangles with corners x, y (l, 3)."""
    left, right = np.full(len(height), np.inf), np.full(len(height), -np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        swap = (y[:, a] > y[:, b]) | ((y[:, a] == y[:, b]) & (x[:, a] > x[:, b]))
        x0, y0 = np.where(swap, x[:, b], x[:, a]), np.where(swap, y[:, b], y[:, a])
        x1, y1 = np.where(swap, x[:, a], x[:, b]), np.where(swap, y[:, a], y[:, b])
        meets = (y0 <= height) & (height < y1)
        share = np.divide(height - y0, y1 - y0, out=np.zeros_like(height), where=meets)
        crossing = x0 + share * (x1 - x0)
        left = np.where(meets, np.minimum(left, crossing), left)
        right = np.where(meets, np.maximum(right, crossing), right)
    missed = left > right
    return np.where(missed, 0.0, left), np.where(missed, 0.0, right)


def _ranges(start: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
    """`start[i], start[i] + 1, ...` (`count[i]` of them) for every i, one after another: which i, and the numbers."""
    which = np.repeat(np.arange(len(count)), count)
    before = np.cumsum(count) - count
    return which, start[which] + np.arange(len(which)) - before[which]
