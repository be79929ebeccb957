"""How samples lie in tiles, and where they are seen from: a picture as its camera sees it, a list along a curve."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.errors import GraphicsError, InputError
from umbrae.geometry.chance import MOST_STRATA
from umbrae.methods.frustum_gl.tiles import Tiles, tiles_of, tiles_of_list
from umbrae.samples import ViewSamples

BLOCK = 1 << 23
"""Samples in a band: a 3840 x 2160 picture is one; larger ones go band by band to bound the memory."""
PLACE_BYTES = 16


class View(NamedTuple):
    """`eye (3,)`, and `rows (3, 3)` that take P - eye to X, Y, W: W is the distance along the view direction.

    It sees X / W and Y / W in [-1, 1]. Samples far outside of that are tested one by one.
    """

    eye: NDArray[np.float64]
    rows: NDArray[np.float64]

    def uniforms(self, reach: float) -> dict[str, Any]:
        """For `place.glsl` and `setup.glsl`; q is 1 at a distance that nothing exceeds by much."""
        farthest = float(np.abs(self.eye).max()) + reach
        return {
            "eye": tuple(self.eye.tolist()),
            "rows": [tuple(row) for row in self.rows.tolist()],
            "columns": [tuple(column) for column in np.linalg.inv(self.rows).T.tolist()],
            "unit": 2.0 ** math.frexp(farthest)[1],
        }


class Part(NamedTuple):
    """Samples that one tree holds, the `where` of all in flat order, and their tiles."""

    samples: ViewSamples
    where: slice | NDArray[np.intp]
    tiles: Tiles

    def numbers(self, index: NDArray[np.int32]) -> NDArray[np.int64]:
        """The flat numbers among all samples of some of the part's."""
        given = index.astype(np.int64)
        numbers: NDArray[np.int64] = self.where.start + given if isinstance(self.where, slice) else self.where[given]
        return numbers


def is_picture(samples: ViewSamples) -> bool:
    """Whether neighbours in the first two axes are neighbours for a camera: a picture, or some rows of one."""
    return samples.camera is not None and len(samples.shape) in (2, 3)


def view_of(samples: ViewSamples, reach: float) -> View:
    """A picture's camera; for lists an eye beside all samples, as far off as they are wide.

    It looks along the axis in which the samples differ least: on a ground or a wall, straight at that. `reach` is the
    largest coordinate of the scene.
    """
    if samples.camera is not None and is_picture(samples):
        return View(samples.camera.eye, samples.camera.world_to_clip[:, :3])
    points = samples.position[samples.covered]
    bounds = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.zeros(3))
    low, high = bounds[0].astype(np.float64), bounds[1].astype(np.float64)
    middle, half = (low + high) / 2, (high - low) / 2
    # Not nearer than some float32 steps of what it is compared with.
    radius = max(float(half.max()), 2.0**-20 * max(float(np.abs(middle).max()), reach)) or 1.0
    ahead = int(np.argmin(half))
    axes = np.roll(np.eye(3), 2 - ahead, axis=0)  # the last one is `ahead`
    # W is from 2 to 4 radii, X and Y up to 2.
    return View(middle - 3.0 * radius * axes[2], axes * np.array([[2.0], [2.0], [1.0]]))


def parts_of(samples: ViewSamples, most_bytes: int) -> Iterator[Part]:
    """Bands of a picture, or of a list along a curve in space, that fit into buffers of `most_bytes`.

    Raises
    ------
    InputError
        For more samples in a pixel than chances can tell apart.
    GraphicsError
        For a picture of which the driver has no room for a row.
    """
    if samples.size == 0:
        return
    if not is_picture(samples):
        order, step = samples.along_curve, min(BLOCK, most_bytes // PLACE_BYTES) // 32 * 32
        for start in range(0, samples.size, step):
            where = order[start : start + step]
            yield Part(samples.take(where), where, tiles_of_list(len(where)))
        return
    height, width = samples.shape[:2]
    per_pixel = samples.size // (height * width)
    if per_pixel > MOST_STRATA:
        raise InputError(f"frustum-gl: wanted up to {MOST_STRATA} samples per pixel, got {per_pixel}")
    step = rows_of_band(width, height, per_pixel, most_bytes)
    for top in range(0, height, step):
        rows = samples.rows(top, top + step)
        first = top * width * per_pixel
        yield Part(rows, slice(first, first + rows.size), tiles_of(width, rows.shape[0], per_pixel))


def rows_of_band(width: int, height: int, per_pixel: int, most_bytes: int) -> int:
    """How many rows of a picture one band may hold, where a buffer may have `most_bytes`.

    Raises
    ------
    GraphicsError
        When not even one.
    """
    # Tiles are 8 x 4 samples: up to 7 columns and 3 rows more than there are.
    most = min(BLOCK, most_bytes // PLACE_BYTES) // (width * per_pixel + 7)
    rows = (most - 3) // per_pixel if per_pixel > 1 else most - 3
    if rows < 1:
        raise GraphicsError(
            f"frustum-gl: a row of {width} pixels with {per_pixel} samples each has no room in one buffer of "
            f"this OpenGL driver, {most_bytes} bytes; the method `frustum` takes it"
        )
    return min(rows, height)
