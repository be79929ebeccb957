"""Primary visibility on all cores: what does the camera see at each sample?

The picture is cut into bands of rows, triangles are listed by the bands they touch, and each band is one
task: it draws its triangles into a depth buffer of its own, then turns what won into view samples. No two
tasks write to the same place and every list is in order of the index, so the result does not depend on the
number of threads.
"""

import numpy as np

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.parallel import run
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import list_by_band, project
from umbrae.sampling.drawing import draw
from umbrae.sampling.holes import surface_of
from umbrae.sampling.seen import Seen, picture_of, resolve, rows_per_band
from umbrae.scene import Scene


def sample(scene: Scene, camera: Camera, samples_per_pixel: int = 1, clock: Clock | None = None) -> ViewSamples:
    """Find the point of the scene that the camera sees at each sample of its picture.

    Triangles are seen from both sides. Surfaces of alpha mode MASK are seen through where their alpha is
    below the cutoff; BLEND is drawn as opaque, except where its alpha rounds to 0 in 8 bits. Where coincident
    triangles tie, the lowest index wins. Triangles without area are not seen.

    Parameters
    ----------
    samples_per_pixel
        1 samples pixel centres and gives arrays `(h, w, ...)`; more give `(h, w, s, ...)`, at places within
        the pixel that are the same for all. Rows go from the top of the picture downwards.
    clock
        Hears how far the work has come.

    Raises
    ------
    OptionError
        When `samples_per_pixel` is not a whole number from 1.
    CapacityError
        When the result would not fit into memory.
    """
    picture = picture_of(scene, camera, samples_per_pixel)
    geometry, surface = project(scene, camera), surface_of(scene)
    band_rows = rows_per_band(picture)
    begin, listed = list_by_band(geometry, picture, band_rows)
    seen = Seen.of(picture)

    def band(index: int) -> None:
        top, bottom = index * band_rows, min((index + 1) * band_rows, picture.height)
        part = seen.rows(picture, top, bottom)
        nearest = np.full(len(part.depth), np.inf)
        part.triangle[:], part.side[:] = -1, 0
        ids = listed[begin[index] : begin[index + 1]]
        draw(geometry, ids, picture, surface, top, bottom, nearest, part.triangle, part.side)
        resolve(geometry, picture, top, bottom, part.triangle, part.barycentric, part.position)
        part.depth[:] = nearest

    run(band, len(begin) - 1, clock)
    return seen.samples(camera)
