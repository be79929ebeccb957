"""By how many pixels a shadow moves when its caster does: the largest such scale, over directions from the light.

Mattausch et al. 2012 (section 3.3) bound the error of a contour in world units alone, "since the size of the shadow
projection is not known". The view samples know it. At a sample q with the normal n, light that travels along d, and the
camera's picture x(q), moving the caster by a small e across the light moves the shadow along the receiver by
e - d (n . e) / (n . d), times the ratio of distances from a point light, and so x by that times its gradient:

    h = g - n (g . d) / (n . d)     for each of the two gradients g of x,

and by at most the larger singular value of both h together. A grid over directions from the light, in which each cell
holds the largest value of its samples, and a pyramid over it, answer for any part of a contour.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbrae.geometry.hermite import Curves
from umbrae.geometry.normals import facet_normals
from umbrae.geometry.vectors import dot, row, scale, subtract
from umbrae.light import Light
from umbrae.parallel import kernel, run, thread_count
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

Rows = NDArray[np.float64]

CELLS = 32
"""Along each axis of the grid."""

GRAZING = 1.0 / 16.0
"""Samples on which light falls at a smaller sine are left out: they are nearly dark, and their scale has no bound."""


@dataclass(frozen=True, eq=False)
class ReceiverScale:
    """`levels` `(n, n, n) float32` each: pixels per radian seen from a point light, or per world unit, at most.

    Cells divide [-1, 1] along each axis: of unit vectors from a point light; of positions across a directional one,
    minus `centre (3,)` and divided by `extent`.
    """

    light: Rows
    centre: Rows
    extent: float
    levels: list[NDArray[np.float32]]

    @classmethod
    def of(cls, scene: Scene, light: Light, samples: ViewSamples) -> "ReceiverScale":
        """Look at all covered samples of a picture."""
        camera = samples.camera
        assert camera is not None
        source = light.position.astype(np.float64)
        centre, extent = np.zeros(3), 1.0
        if light.is_directional:
            source[:3] /= np.linalg.norm(source[:3])
            bounds = scene.bounds.astype(np.float64)
            centre = bounds.mean(axis=0)
            extent = float(np.linalg.norm(bounds[1] - bounds[0])) / 2 or 1.0
        tasks = min(4 * thread_count(), -(-samples.size // 65536)) or 1
        step = -(-samples.size // tasks)
        parts = np.zeros((tasks, CELLS, CELLS, CELLS), np.float32)
        what = samples.triangle.reshape(-1), samples.position.reshape(-1, 3)
        normals = facet_normals(scene.positions, scene.triangles)
        picture = camera.eye, camera.axes, camera.pixel_size

        def task(i: int) -> None:
            stop = min((i + 1) * step, samples.size)
            enter(*what, normals, *picture, source, centre, extent, i * step, stop, parts[i])

        run(task, tasks)
        levels = [parts.max(axis=0)]
        while len(levels[-1]) > 1:
            half = len(levels[-1]) // 2
            levels.append(levels[-1].reshape(half, 2, half, 2, half, 2).max(axis=(1, 3, 5)))
        return cls(source, centre, extent, levels)

    def pixels_per_unit(self, curves: Curves) -> Rows:
        """`(k,)` at most so many pixels a shadow moves for each world unit that these curves do."""
        p0, p1, t0, t1 = curves
        hull = np.stack([p0, p0 + t0 / 3, p1 - t1 / 3, p1])  # control points of Bezier
        middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
        radius = np.linalg.norm(hull - middle, axis=2).max(axis=0)
        if self.light[3] == 0.0:
            offset = middle - self.centre
            at = (offset - np.outer(offset @ self.light[:3], self.light[:3])) / self.extent
            reach, nearest = radius / self.extent, np.ones(len(p0))
        else:
            offset = middle - self.light[:3]
            distance = np.linalg.norm(offset, axis=1)
            nearest = np.maximum(distance - radius, 1e-30)
            at = offset / np.maximum(distance, 1e-30)[:, None]
            reach = radius / nearest
        # On this level the box is no wider than a cell, so it meets two along each axis at most.
        top = len(self.levels) - 1
        wanted = np.ceil(np.log2(np.maximum(reach * CELLS, 1.0)))
        found = np.zeros(len(p0))
        for level, cells in enumerate(self.levels):
            here = np.flatnonzero(np.minimum(wanted, top) == level)
            low = _cell(at[here] - reach[here, None], len(cells))
            high = _cell(at[here] + reach[here, None], len(cells))
            for corner in range(8):
                i, j, k = (np.where(corner >> axis & 1, high[:, axis], low[:, axis]) for axis in range(3))
                found[here] = np.maximum(found[here], cells[i, j, k])
        return found / nearest


def _cell(at: Rows, count: int) -> NDArray[np.int64]:
    """Cells of coordinates in [-1, 1]; those outside count to the outermost."""
    return np.clip(np.floor((at + 1.0) * (count / 2)), 0, count - 1).astype(np.int64)


@kernel
def enter(triangle, position, normals, eye, axes, pixel_size, light, centre, extent, start, stop, cells):
    """Raise the cells of samples `start` to `stop` to their scale."""
    right, up, forward = row(axes, 0), row(axes, 1), row(axes, 2)
    source = light[0], light[1], light[2]
    count = len(cells)
    for index in range(start, stop):
        t = triangle[index]
        if t < 0:
            continue
        point, normal = row(position, index), row(normals, t)
        if light[3] == 0.0:
            along, distance = scale(-1.0, source), 1.0
            offset = subtract(point, row(centre.reshape(1, 3), 0))
            at = scale(1.0 / extent, subtract(offset, scale(dot(offset, along), along)))
        else:
            along = subtract(point, source)
            distance = np.sqrt(dot(along, along))
            if distance == 0.0:
                continue
            along = scale(1.0 / distance, along)
            at = along
        slope = dot(normal, along)
        if abs(slope) < GRAZING:
            continue
        view = subtract(point, (eye[0], eye[1], eye[2]))
        depth = dot(view, forward)
        per_unit = 1.0 / (depth * pixel_size)
        gx = scale(per_unit, subtract(right, scale(dot(view, right) / depth, forward)))
        gy = scale(per_unit, subtract(up, scale(dot(view, up) / depth, forward)))
        hx = subtract(gx, scale(dot(gx, along) / slope, normal))
        hy = subtract(gy, scale(dot(gy, along) / slope, normal))
        xx, xy, yy = dot(hx, hx), dot(hx, hy), dot(hy, hy)
        most = np.sqrt((xx + yy) / 2 + np.sqrt(((xx - yy) / 2) ** 2 + xy * xy)) * distance
        i = min(max(np.int64(np.floor((at[0] + 1.0) * (count / 2))), 0), count - 1)
        j = min(max(np.int64(np.floor((at[1] + 1.0) * (count / 2))), 0), count - 1)
        k = min(max(np.int64(np.floor((at[2] + 1.0) * (count / 2))), 0), count - 1)
        cells[i, j, k] = max(cells[i, j, k], np.float32(most))
