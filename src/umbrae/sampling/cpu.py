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
from umbrae.sampling.bands import Geometry, Picture, project
from umbrae.sampling.drawing import ALL, Floor, draw
from umbrae.sampling.groups import View, groups_of, view
from umbrae.sampling.holes import Surface, surface_of
from umbrae.sampling.seen import Seen, picture_of, resolve, rows_per_band
from umbrae.scene import Scene


class Bands(NamedTuple):
    """A picture cut into bands, and what of a scene may be seen in it."""

    picture: Picture
    geometry: Geometry
    surface: Surface
    view: View

    @classmethod
    def of(cls, scene: Scene, camera: Camera, picture: Picture, culling: bool = True) -> "Bands":
        """Look at a scene; `culling` leaves out what is hidden, and changes nothing."""
        geometry = project(scene, camera)
        seen = view(groups_of(scene), geometry, picture)
        return cls(picture, geometry, surface_of(scene), seen if culling else seen.nothing_hidden())

    @property
    def tasks(self) -> int:
        """How many bands there are."""
        return -(-self.picture.height // rows_per_band(self.picture))

    def rows(self, index: int) -> tuple[int, int]:
        """First row of a band, and the one after its last."""
        band_rows = rows_per_band(self.picture)
        return index * band_rows, min((index + 1) * band_rows, self.picture.height)

    def draw(self, index: int, floor: Floor, part: Seen) -> NDArray[np.float64]:
        """Find what is seen behind a floor and write it to the band's `part`; returns the depths in float64."""
        top, bottom = self.rows(index)
        nearest = np.full(len(part.depth), np.inf)
        part.triangle[:], part.side[:] = -1, 0
        geometry, picture = self.geometry, self.picture
        draw(geometry, self.view, ALL, picture, self.surface, top, bottom, floor, nearest, part.triangle, part.side)
        resolve(geometry, picture, top, bottom, part.triangle, part.barycentric, part.position)
        part.depth[:] = nearest
        return nearest

    def nearest(self, clock: Clock | None = None) -> Seen:
        """What is seen of the whole picture."""
        seen, floor = Seen.of(self.picture), Floor.before_all(self.picture)
        run(lambda index: self.draw(index, floor, seen.rows(self.picture, *self.rows(index))), self.tasks, clock)
        return seen


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
    return Bands.of(scene, camera, picture).nearest(clock).samples(scene, camera)
