"""A grid over directions from the light: which samples lie behind some of a few triangles, perhaps.

Cells divide [-1, 1] along each axis: of unit vectors away from a point light; of positions across a directional one,
from the middle of the triangles and in units of their extent.
"""

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.vectors import dot, row, scale, subtract
from umbrae.light import Light
from umbrae.parallel import inline, kernel, run
from umbrae.samples import ViewSamples

CELLS = 128
"""Along each axis."""

_SAMPLES_PER_TASK = 65536


def behind(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    light: Light,
    samples: ViewSamples,
    asked: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """`(n,)`: those of the samples `asked (n,)` that may lie in the shadow of `triangles (t, 3)`, and a few others."""
    found = np.zeros(samples.size, bool)
    if len(triangles) == 0:
        return found
    corners = positions[np.unique(triangles)].astype(np.float64)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    extent = float(np.linalg.norm(corners.max(axis=0) - middle)) or 1.0
    source = light.position.astype(np.float64)
    if light.is_directional:
        source[:3] /= np.linalg.norm(source[:3])
    cells = np.zeros((CELLS, CELLS, CELLS), bool)
    frame = source, middle.reshape(1, 3), extent
    mark(positions, triangles, *frame, cells)
    places = samples.position.reshape(-1, 3)

    def task(i: int) -> None:
        look(places, asked, *frame, cells, i * _SAMPLES_PER_TASK, min((i + 1) * _SAMPLES_PER_TASK, samples.size), found)

    run(task, -(-samples.size // _SAMPLES_PER_TASK))
    return found


@inline
def direction(point, light, middle, extent):
    """Where a point stands in the light's view, as three numbers."""
    source = light[0], light[1], light[2]
    if light[3] == 0.0:
        offset = subtract(point, row(middle, 0))
        return scale(1.0 / extent, subtract(offset, scale(dot(offset, source), source)))
    offset = subtract(point, source)
    length = np.sqrt(dot(offset, offset))
    return offset if length == 0.0 else scale(1.0 / length, offset)


@inline
def cell(value):
    """The cell of a coordinate; what lies outside belongs to the outermost."""
    return min(max(np.int64(np.floor((value + 1.0) * (CELLS / 2))), 0), CELLS - 1)


@kernel
def mark(positions, triangles, light, middle, extent, cells):
    """Mark the cells that triangles may fill: the box of their corners, and how far an arc may bulge beyond it.

    Directions of a triangle's points lie on arcs between those of its corners, at most a quarter of the squared chord
    off it; a thousandth of a cell has room for rounding, also of samples' positions.
    """
    for t in range(len(triangles)):
        a = direction(row(positions, triangles[t, 0]), light, middle, extent)
        b = direction(row(positions, triangles[t, 1]), light, middle, extent)
        c = direction(row(positions, triangles[t, 2]), light, middle, extent)
        wide = 0.0
        for side in (subtract(b, a), subtract(c, a), subtract(c, b)):
            wide = max(wide, dot(side, side))
        room = 1e-3 * 2.0 / CELLS + (wide / 4 if light[3] != 0.0 else 0.0)
        i0, i1 = cell(min(a[0], b[0], c[0]) - room), cell(max(a[0], b[0], c[0]) + room)
        j0, j1 = cell(min(a[1], b[1], c[1]) - room), cell(max(a[1], b[1], c[1]) + room)
        k0, k1 = cell(min(a[2], b[2], c[2]) - room), cell(max(a[2], b[2], c[2]) + room)
        for i in range(i0, i1 + 1):
            for j in range(j0, j1 + 1):
                for k in range(k0, k1 + 1):
                    cells[i, j, k] = True


@kernel
def look(position, asked, light, middle, extent, cells, start, stop, found):
    """Find the samples `asked` among `start` to `stop` that lie in marked cells."""
    for index in range(start, stop):
        if asked[index]:
            x, y, z = direction(row(position, index), light, middle, extent)
            found[index] = cells[cell(x), cell(y), cell(z)]
