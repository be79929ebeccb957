"""What is seen: checked questions, the arrays that answer them, and the points on the triangles that won."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera, pixel_offsets
from umbrae.checks import instance, is_whole
from umbrae.errors import OptionError
from umbrae.memory import require
from umbrae.parallel import inline, kernel
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Geometry, Picture, corners
from umbrae.sampling.coverage import barycentric as barycentric_at
from umbrae.scene import Scene
from umbrae.transmission import transmission_of

_BAND_ROWS = 16
_BAND_SAMPLES = 1 << 18
"""A band's depth buffer has at most about this many samples (2 MiB)."""
BYTES_PER_SAMPLE = 4 + 2 * 4 + 1 + 3 * 4 + 1 + 4


def picture_of(scene: Scene, camera: Camera, samples_per_pixel: int) -> Picture:
    """Where samples lie, once the arguments are known to be good and the result to fit into memory."""
    instance(scene, Scene, "scene")
    instance(camera, Camera, "camera")
    if not is_whole(samples_per_pixel) or samples_per_pixel < 1:
        raise OptionError(f"samples_per_pixel: wanted a whole number from 1, got {samples_per_pixel!r}")
    per_pixel, width, height = int(samples_per_pixel), camera.width, camera.height
    require(
        width * height * per_pixel * BYTES_PER_SAMPLE + len(scene.triangles) * 8,
        f"a picture of {width} x {height} pixels with {per_pixel} samples each",
    )
    return Picture(width, height, camera.near, *pixel_offsets(per_pixel))


class Seen(NamedTuple):
    """One entry per sample, row by row from the top of the picture; not initialized."""

    triangle: NDArray[np.int32]
    side: NDArray[np.int8]
    barycentric: NDArray[np.float32]
    position: NDArray[np.float32]
    depth: NDArray[np.float32]

    @classmethod
    def of(cls, picture: Picture) -> "Seen":
        """Room for a whole picture."""
        total = picture.width * picture.height * len(picture.x)
        return cls(
            np.empty(total, np.int32),
            np.empty(total, np.int8),
            np.empty((total, 2), np.float32),
            np.empty((total, 3), np.float32),
            np.empty(total, np.float32),
        )

    @classmethod
    def background(cls, total: int) -> "Seen":
        """So many samples that see nothing."""
        return cls(
            np.full(total, -1, np.int32),
            np.zeros(total, np.int8),
            np.zeros((total, 2), np.float32),
            np.zeros((total, 3), np.float32),
            np.full(total, np.inf, np.float32),
        )

    def rows(self, picture: Picture, top: int, bottom: int) -> "Seen":
        """Rows `top` to `bottom` (excluded)."""
        row = picture.width * len(picture.x)
        part = slice(top * row, bottom * row)
        return Seen(self.triangle[part], self.side[part], self.barycentric[part], self.position[part], self.depth[part])

    def put(self, other: "Seen", where: NDArray[np.bool_] | slice) -> None:
        """Take over another one's entries at some places."""
        self.triangle[where], self.side[where] = other.triangle[where], other.side[where]
        self.barycentric[where], self.position[where] = other.barycentric[where], other.position[where]
        self.depth[where] = other.depth[where]

    def samples(self, scene: Scene, camera: Camera, throughput: NDArray[np.float32] | None = None) -> ViewSamples:
        """The picture that the camera sees."""
        per_pixel = len(self.triangle) // (camera.width * camera.height)
        shape = (camera.height, camera.width) if per_pixel == 1 else (camera.height, camera.width, per_pixel)
        return ViewSamples(
            triangle=self.triangle.reshape(shape),
            barycentric=self.barycentric.reshape(*shape, 2),
            side=self.side.reshape(shape),
            position=self.position.reshape(*shape, 3),
            covered=(self.triangle >= 0).reshape(shape),
            depth=self.depth.reshape(shape),
            camera=camera,
            throughput=None if throughput is None else throughput.reshape(*shape, 3),
            looks_through=transmission_of(scene) is not None,
        )


def rows_per_band(picture: Picture) -> int:
    """How many rows make a task."""
    return max(1, min(_BAND_ROWS, _BAND_SAMPLES // (picture.width * len(picture.x))))


@kernel
def resolve(
    geometry: Geometry,
    picture: Picture,
    top: int,
    bottom: int,
    triangle: NDArray[np.int32],
    barycentric: NDArray[np.float32],
    position: NDArray[np.float32],
) -> None:
    """Turn the triangles that won in a band into points on them; zeros for background."""
    positions, triangles = geometry.positions, geometry.triangles
    at, last = 0, -1
    a = b = c = (0.0, 0.0, 0.0)
    for row in range(top, bottom):
        for column in range(picture.width):
            for k in range(len(picture.x)):
                u, v = 0.0, 0.0
                t = triangle[at]
                if t >= 0:
                    if t != last:
                        a, b, c = corners(geometry, t)
                        last = t
                    u, v = barycentric_at(a, b, c, column + picture.x[k], row + picture.y[k])
                    put_point(positions, triangles, t, u, v, position, at)
                else:
                    position[at, 0], position[at, 1], position[at, 2] = 0.0, 0.0, 0.0
                barycentric[at, 0], barycentric[at, 1] = u, v
                at += 1


@inline
def put_point(
    positions: NDArray[np.float32],
    triangles: NDArray[np.int32],
    t: int,
    u: float,
    v: float,
    position: NDArray[np.float32],
    at: int,
) -> None:
    """Write the point of a triangle at barycentrics u and v, as `samples.surface_positions` has it."""
    for axis in range(3):
        from_a = np.float64(positions[triangles[t, 0], axis])
        to_b = positions[triangles[t, 1], axis] - from_a
        to_c = positions[triangles[t, 2], axis] - from_a
        position[at, axis] = from_a + u * to_b + v * to_c
