"""Triangles in groups with boxes: which of them a picture may show, and the nearest first.

This is the hierarchical occlusion culling of Stich, Waechter and Keller (2007, section 11.3.3) for the picture itself,
after Bittner, Wimmer, Piringer and Purgathofer (2004). Deviations: a box is asked about by the thread that draws, which
has the answer at once. So there is no waiting that temporal coherence would have to hide, nothing is remembered from
picture to picture, and going from front to back finds what hides. One level of boxes will do: 10 million triangles have
156,250.

Rounding. A vertex in a box is a point of it, and a product with the matrix is off by less than 2^-50 of the sum S of
its summands' magnitudes. So is that of a corner. A quotient x / w of such products is off by less than
2^-49 (S_x + |x / w| S_w) / w, and a distance between those of a triangle's vertices by a few roundings of the largest.
`_SLACK` is more than 16 times all of that.
"""

from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.morton import morton3
from umbrae.parallel import expand, kernel, run
from umbrae.sampling.bands import Geometry, Picture, projected
from umbrae.sampling.coverage import BOX_SLACK, cells
from umbrae.scene import Scene

SIZE = 64
"""Triangles in a group."""
_CHUNK = 1 << 8
_SLACK = 2.0**-44


class Groups(NamedTuple):
    """Triangles of a scene by `SIZE`.

    Attributes
    ----------
    order
        `(t,) int32`: group i has the triangles from `SIZE * i`; those of the last are fewer.
    lower, upper
        `(n, 3) float32`: corners of their boxes.
    """

    order: NDArray[np.int32]
    lower: NDArray[np.float32]
    upper: NDArray[np.float32]


class View(NamedTuple):
    """What a picture may show of the groups.

    Attributes
    ----------
    order
        That of `Groups`.
    chosen
        `(n,) int32`: the groups that are not outside of the picture, the nearest first.
    rows
        `(n, 2) int32`: first and last row of each of `chosen`.
    columns
        `(n, 2) int32`: first and last column.
    least
        `(n,) float64`: no triangle of the group is nearer along the direction of view.
    drawn
        `(n,) bool`: which of them some part of the picture has drawn; all others were hidden.
    """

    order: NDArray[np.int32]
    chosen: NDArray[np.int32]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    least: NDArray[np.float64]
    drawn: NDArray[np.bool_]

    @property
    def triangles(self) -> int:
        """How many triangles have been drawn."""
        last = len(self.order) // SIZE
        whole: NDArray[np.int32] = self.chosen[self.drawn]
        return SIZE * len(whole) - int((whole == last).any()) * (SIZE - len(self.order) % SIZE)

    def nothing_hidden(self) -> "View":
        """The same groups, all of which are to be drawn: for what comes of it to be measured."""
        return self._replace(least=np.zeros(len(self.least)))


_KEPT: WeakKeyDictionary[Scene, Groups] = WeakKeyDictionary()


def groups_of(scene: Scene) -> Groups:
    """A scene's groups: neighbours in its own order, or along a curve in space where that order is none."""
    kept = _KEPT.get(scene)
    if kept is None:
        kept = _KEPT[scene] = _group(scene)
    return kept


def _group(scene: Scene) -> Groups:
    order = np.arange(len(scene.triangles), dtype=np.int32)
    groups, apart = _bound(scene, order)
    if not apart:
        return groups
    corners = scene.positions[scene.triangles]
    along, _ = _bound(
        scene, np.argsort(morton3(corners.mean(axis=1, dtype=np.float64)), kind="stable").astype(np.int32)
    )
    return along


def _bound(scene: Scene, order: NDArray[np.int32]) -> tuple[Groups, bool]:
    """Box the groups; and say whether they are wider than strips of as many triangles."""
    count = -(-len(order) // SIZE)
    groups = Groups(order, np.empty((count, 3), np.float32), np.empty((count, 3), np.float32))
    extents = np.zeros((-(-count // _CHUNK), 2))

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, count)
        _bound_groups(scene.positions, scene.triangles, groups, start, stop, extents[chunk])

    run(task, len(extents))
    of_groups, of_triangles = extents.sum(axis=0)
    return groups, bool(2.0 * of_groups > of_triangles)


@kernel
def _bound_groups(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    groups: Groups,
    start: int,
    stop: int,
    extents: NDArray[np.float64],
) -> None:
    for group in range(start, stop):
        for axis in range(3):
            low, high = np.float32(np.inf), np.float32(-np.inf)
            for i in range(group * SIZE, min((group + 1) * SIZE, len(groups.order))):
                t = groups.order[i]
                a, b, c = (
                    positions[triangles[t, 0], axis],
                    positions[triangles[t, 1], axis],
                    positions[triangles[t, 2], axis],
                )
                least, most = min(a, b, c), max(a, b, c)
                low, high = min(low, least), max(high, most)
                extents[1] += np.float64(most) - np.float64(least)
            groups.lower[group, axis], groups.upper[group, axis] = low, high
            extents[0] += np.float64(high) - np.float64(low)


def view(groups: Groups, geometry: Geometry, picture: Picture, wanted: NDArray[np.bool_] | None = None) -> View:
    """The groups that lie in a picture, from front to back; of triangles `wanted (t,)` alone, where that is given."""
    count = len(groups.lower)
    asked = np.ones(count, bool)
    if wanted is not None:
        asked = np.logical_or.reduceat(wanted[groups.order], np.arange(0, len(wanted), SIZE)) if count else asked
    rows, columns, least = np.empty((count, 2), np.int32), np.empty((count, 2), np.int32), np.empty(count)

    def task(chunk: int) -> None:
        start, stop = chunk * _CHUNK, min((chunk + 1) * _CHUNK, count)
        _place(groups, geometry.matrix, picture, asked, start, stop, rows, columns, least)

    run(task, -(-count // _CHUNK))
    inside = np.flatnonzero(rows[:, 0] <= rows[:, 1])
    chosen = inside[np.argsort(least[inside], kind="stable")].astype(np.int32)
    return View(groups.order, chosen, rows[chosen], columns[chosen], least[chosen], np.zeros(len(chosen), bool))


@kernel
def _place(
    groups: Groups,
    matrix: NDArray[np.float64],
    picture: Picture,
    asked: NDArray[np.bool_],
    start: int,
    stop: int,
    rows: NDArray[np.int32],
    columns: NDArray[np.int32],
    least: NDArray[np.float64],
) -> None:
    """Where the boxes lie; the last row is before the first where they are not `asked` about, or not in the picture."""
    left, right, top, bottom = picture.x.min(), picture.x.max(), picture.y.min(), picture.y.max()
    corner, size = np.empty((8, 3)), np.empty(3)
    for group in range(start, stop):
        rows[group, 0], rows[group, 1] = 0, -1
        columns[group, 0], columns[group, 1] = 0, -1
        least[group] = np.inf
        if not asked[group]:
            continue
        lower, upper = groups.lower[group], groups.upper[group]
        for i in range(8):
            x = np.float64(upper[0] if i & 1 else lower[0])
            y = np.float64(upper[1] if i & 2 else lower[1])
            z = np.float64(upper[2] if i & 4 else lower[2])
            corner[i, 0], corner[i, 1], corner[i, 2] = projected(matrix, x, y, z)
        for row in range(3):
            size[row] = abs(matrix[row, 3])
            for axis in range(3):
                size[row] += abs(matrix[row, axis]) * max(abs(np.float64(lower[axis])), abs(np.float64(upper[axis])))
        off = _SLACK * size[2]
        near = picture.near - off
        nearest, farthest = corner[:, 2].min(), corner[:, 2].max()
        if farthest < near:
            continue
        if not near > 0.5 * picture.near:  # rounding leaves nothing of the near plane; not a number comes here too
            rows[group, 1], columns[group, 1] = picture.height - 1, picture.width - 1
            least[group] = 0.0
            continue
        least[group] = max(nearest - off, near)
        low, high = _extent(corner, size, near, 1)
        rows[group, 0], rows[group, 1] = cells(low, high, top, bottom, picture.height)
        low, high = _extent(corner, size, near, 0)
        columns[group, 0], columns[group, 1] = cells(low, high, left, right, picture.width)
        if columns[group, 0] > columns[group, 1]:
            rows[group, 1] = rows[group, 0] - 1


@expand
def _extent(corner: NDArray[np.float64], size: NDArray[np.float64], near: float, axis: int) -> tuple[float, float]:
    """Lowest and highest pixel coordinate of a box's part behind the near plane: of corners there, and of edges cut."""
    low, high = np.inf, -np.inf
    for i in range(8):
        w = corner[i, 2]
        if w >= near:
            at = corner[i, axis] / w
            slack = 2.0 * BOX_SLACK + _SLACK * (size[axis] + abs(at) * size[2]) / w
            low, high = min(low, at - slack), max(high, at + slack)
        for bit in (1, 2, 4):
            j = i | bit
            if (w >= near) != (corner[j, 2] >= near):
                share = (near - w) / (corner[j, 2] - w)
                at = (corner[i, axis] + share * (corner[j, axis] - corner[i, axis])) / near
                slack = 2.0 * BOX_SLACK + _SLACK * (size[axis] + abs(at) * size[2]) / near
                low, high = min(low, at - slack), max(high, at + slack)
    return low, high
