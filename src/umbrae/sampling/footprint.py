"""The part of its surface that a pixel covers, as view samples (Sintorn et al. 2011, section 3.3)."""

import math

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera, pixel_offsets
from umbrae.checks import instance, number, whole
from umbrae.errors import InputError, OptionError
from umbrae.geometry.vectors import add, cross, dot, row, scale, subtract
from umbrae.parallel import kernel, run
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

_ROWS_PER_TASK = 8
INSIDE = 1.0 - 2.0**-20
"""Most of u + v on a triangle: float64 adds two float32 numbers to within 2**-53 of this."""

LIFT_PX = 0.25
"""How far points beside their triangle are lifted off its plane, in pixels: nothing so small is seen."""


def footprint(
    scene: Scene,
    samples: ViewSamples,
    count: int = 32,
    width: float = 1.0,
    rows: tuple[int, int] | None = None,
) -> ViewSamples:
    """Samples over the area that each pixel of a picture covers, on the plane of the triangle that its middle sees.

    The paper takes one depth and its two derivatives for each pixel, and generates samples from them while it walks
    the shadow buffer's last level, which has a bit for each. These are the same points, made beforehand. What lies
    behind an outline is not known: the plane goes on there.

    Deviations from the paper: derivatives are those of the triangle's plane, not of a depth buffer. Samples on the
    triangle are exact points of it, which need no bias. Those beside it are free points, a quarter of a pixel above
    the plane, so that the next triangle of the same wall does not shade them. Where a pixel sees a surface at so
    grazing an angle that distances in it differ by more than a factor of two, its footprint is made smaller.

    Parameters
    ----------
    samples
        Of a picture with one sample per pixel, `(h, w)`.
    count
        Samples per pixel.
    width
        Side of the footprint in pixels: 1 is the pixel, more blurs beyond it (the paper's section 5).
    rows
        Only these rows of the picture, from the first to the one before the second: many samples take much memory.

    Returns
    -------
    ViewSamples
        `(h, w, count)`, or as many rows as were asked for.

    Raises
    ------
    InputError
        For samples that are not those of a picture with one sample per pixel.
    OptionError
        For a count below 1 or a width that is not positive.
    """
    instance(scene, Scene, "scene")
    instance(samples, ViewSamples, "samples")
    camera = samples.camera
    if camera is None or samples.shape != (camera.height, camera.width):
        raise InputError(
            f"footprint: wanted samples of a picture with one sample per pixel, (h, w), got {samples.shape}"
            f"{' without a camera' * (camera is None)}"
        )
    if whole(count, "footprint: count") < 1:
        raise OptionError(f"footprint: wanted a count of at least 1, got {count}")
    if not number(width, "footprint: width") > 0.0:
        raise OptionError(f"footprint: wanted a width > 0 in pixels, got {width}")
    first, last = (0, camera.height) if rows is None else rows
    shape = (last - first, camera.width, int(count))
    triangle, barycentric = np.empty(shape, np.int32), np.empty((*shape, 2), np.float32)
    position = np.empty((*shape, 3), np.float32)
    across, down = pixel_offsets(int(count))
    offsets = np.stack([across - 0.5, down - 0.5], axis=1) * width
    pinhole = _pinhole(camera)

    def task(index: int) -> None:
        start, stop = index * _ROWS_PER_TASK, min((index + 1) * _ROWS_PER_TASK, shape[0])
        part = slice(first + start, first + stop)
        spread(
            scene.positions, scene.triangles, pinhole, first + start, offsets, samples.triangle[part],
            samples.barycentric[part], samples.side[part], samples.position[part], triangle[start:stop],
            barycentric[start:stop], position[start:stop],
        )  # fmt: skip

    run(task, -(-shape[0] // _ROWS_PER_TASK))

    return ViewSamples(
        triangle=triangle,
        barycentric=barycentric,
        side=np.where(triangle >= 0, samples.side[first:last, :, None], np.int8(0)),
        position=position,
        covered=np.repeat(samples.covered[first:last, :, None], shape[2], axis=2),
        camera=camera,
    )


def _pinhole(camera: Camera) -> NDArray[np.float64]:
    """`(4, 3)`: the eye, the direction through the middle of pixel (0, 0), and its steps to the right and downwards."""
    right, upward, forward = camera.axes
    step = 2.0 * math.tan(math.radians(camera.fov_y) / 2) / camera.height
    corner = forward - (camera.width - 1) / 2 * step * right + (camera.height - 1) / 2 * step * upward
    return np.stack([camera.eye, corner, step * right, -step * upward])


@kernel
def spread(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    pinhole: NDArray[np.float64],
    first: int,
    offsets: NDArray[np.float64],
    own: NDArray[np.int32],
    own_barycentric: NDArray[np.float32],
    side: NDArray[np.int8],
    own_position: NDArray[np.float32],
    triangle: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
) -> None:
    """Fill the samples of some rows of a picture, of which `first` is the number of the first one."""
    eye, corner, right, down = row(pinhole, 0), row(pinhole, 1), row(pinhole, 2), row(pinhole, 3)
    pixel = math.sqrt(dot(right, right))
    widest = 0.0
    for k in range(len(offsets)):
        widest = max(widest, abs(offsets[k, 0]), abs(offsets[k, 1]))
    for y in range(own.shape[0]):
        for x in range(own.shape[1]):
            t = own[y, x]
            triangle[y, x, :] = t
            for k in range(len(offsets)):
                for axis in range(2):
                    barycentric[y, x, k, axis] = own_barycentric[y, x, axis]
                for axis in range(3):
                    position[y, x, k, axis] = own_position[y, x, axis]
            if t < 0:
                continue
            a = row(positions, triangles[t, 0])
            ab, ac = subtract(row(positions, triangles[t, 1]), a), subtract(row(positions, triangles[t, 2]), a)
            normal = cross(ab, ac)
            middle = add(corner, add(scale(float(x), right), scale(float(first + y), down)))
            to_plane, along, area = dot(normal, subtract(a, eye)), dot(normal, middle), dot(normal, normal)
            if to_plane * along <= 0.0 or area == 0.0:
                continue  # edge-on: the pixel's middle is all that is known of it
            # One over the distance along the view direction is linear in the picture.
            distance = to_plane / along
            by_x, by_y = dot(normal, right) / along, dot(normal, down) / along
            reach = (abs(by_x) + abs(by_y)) * widest
            shrink = min(1.0, 0.5 / reach) if reach > 0.0 else 1.0
            lift = scale(side[y, x] * LIFT_PX * pixel * distance / math.sqrt(area), normal)
            for k in range(len(offsets)):
                dx, dy = shrink * offsets[k, 0], shrink * offsets[k, 1]
                ray = add(middle, add(scale(dx, right), scale(dy, down)))
                # From the plane's corner A; the eye may be far away, so that is subtracted first.
                place = add(subtract(eye, a), scale(distance / (1.0 + dx * by_x + dy * by_y), ray))
                u = np.float32(dot(cross(place, ac), normal) / area)
                v = np.float32(dot(cross(ab, place), normal) / area)
                if u >= 0.0 and v >= 0.0 and np.float64(u) + np.float64(v) <= INSIDE:
                    barycentric[y, x, k, 0], barycentric[y, x, k, 1] = u, v
                    for axis in range(3):
                        from_a = np.float64(positions[triangles[t, 0], axis])
                        to_b = positions[triangles[t, 1], axis] - from_a
                        to_c = positions[triangles[t, 2], axis] - from_a
                        position[y, x, k, axis] = from_a + u * to_b + v * to_c
                else:
                    free = add(a, add(place, lift))
                    triangle[y, x, k] = -1
                    for axis in range(2):
                        barycentric[y, x, k, axis] = 0.0
                    position[y, x, k, 0], position[y, x, k, 1], position[y, x, k, 2] = free[0], free[1], free[2]
