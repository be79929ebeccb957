"""Primary visibility on all cores: what does the camera see at each sample?

The picture is cut into bands of rows, triangles are listed by the bands they touch, and each band is one
task: it draws its triangles into a depth buffer of its own, then turns what won into view samples. No two
tasks write to the same place and every list is in order of the index, so the result does not depend on the
number of threads.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Geometry, Picture, list_by_band, project
from umbrae.sampling.drawing import Floor, draw
from umbrae.sampling.holes import Surface, surface_of
from umbrae.sampling.seen import Seen, picture_of, resolve, rows_per_band
from umbrae.scene import Scene


class Bands(NamedTuple):
    """A picture cut into bands, and the triangles of each: band i has `listed[begin[i]:begin[i + 1]]`."""

    picture: Picture
    geometry: Geometry
    surface: Surface
    band_rows: int
    begin: NDArray[np.int64]
    listed: NDArray[np.int32]

    @classmethod
    def of(cls, scene: Scene, camera: Camera, picture: Picture) -> "Bands":
        """Project a scene and list its triangles."""
        geometry, surface, band_rows = project(scene, camera), surface_of(scene), rows_per_band(picture)
        return cls(picture, geometry, surface, band_rows, *list_by_band(geometry, picture, band_rows))

    @property
    def tasks(self) -> int:
        """How many bands there are."""
        return len(self.begin) - 1

    def rows(self, index: int) -> tuple[int, int]:
        """First row of a band, and the one after its last."""
        return index * self.band_rows, min((index + 1) * self.band_rows, self.picture.height)

    def draw(self, index: int, floor: Floor, part: Seen) -> NDArray[np.float64]:
        """Find what is seen behind a floor and write it to the band's `part`; returns the depths in float64."""
        top, bottom = self.rows(index)
        nearest = np.full(len(part.depth), np.inf)
        part.triangle[:], part.side[:] = -1, 0
        ids = self.listed[self.begin[index] : self.begin[index + 1]]
        draw(self.geometry, ids, self.picture, self.surface, top, bottom, floor, nearest, part.triangle, part.side)
        resolve(self.geometry, self.picture, top, bottom, part.triangle, part.barycentric, part.position)
        part.depth[:] = nearest
        return nearest


def sample(scene: Scene, camera: Camera, samples_per_pixel: int = 1, clock: Clock | None = None) -> ViewSamples:
    """Find the point of the scene that the camera sees at each sample of its picture.

    Triangles are seen from both sides. Surfaces of alpha mode MASK are seen through where their alpha is
    below the cutoff, those of BLEND where it rounds to 0 in 8 bits; all others are seen, however much passes them:
    `sample_layers` finds what lies behind. Where coincident triangles tie, the lowest index wins. Triangles without
    area are not seen.

    Parameters
    ----------
    samples_per_pixel
        1 samples pixel centres and gives arrays `(h, w, ...)`; more give `(h, w, s, ...)`, at places within
        the pixel that are the same for all. Rows go from the top of the picture downwards.
    clock
        Hears how far the work has come.

    Raises
    ------
    InputError
        When a texture decides where holes are, and the scene has no texture coordinates.
    OptionError
        When `samples_per_pixel` is not a whole number from 1.
    CapacityError
        When the result would not fit into memory.
    """
    picture = picture_of(scene, camera, samples_per_pixel)
    bands = Bands.of(scene, camera, picture)
    seen, floor = Seen.of(picture), Floor.before_all(picture)
    run(lambda index: bands.draw(index, floor, seen.rows(picture, *bands.rows(index))), bands.tasks, clock)
    return seen.samples(scene, camera)
