"""Depth peeling: the surfaces behind one another that a sample sees through (Everitt 2001).

Sintorn et al. (2011, section 3.2) propose it for transparent receivers of shadows. Deviations: each sample's surfaces
are in order of (distance, triangle), in float64, so that coincident ones are peeled one by one; peeling ends sample by
sample, where a surface lets nothing through.
"""

from dataclasses import replace
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import is_whole, shown
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.memory import available_bytes, require
from umbrae.parallel import inline, kernel, run
from umbrae.samples import ViewSamples
from umbrae.sampling.bands import Picture
from umbrae.sampling.cpu import Bands
from umbrae.sampling.drawing import Floor
from umbrae.sampling.seen import BYTES_PER_SAMPLE, Seen, picture_of
from umbrae.scene import Scene
from umbrae.transmission import SOLID, VARYING, Transmission, surface_at, transmission_of

_SMALL = 128
"""Pixels along the longer side of the picture in which layers are counted before there is room for them."""


def sample_layers(
    scene: Scene, camera: Camera, layers: int = 8, samples_per_pixel: int = 1, clock: Clock | None = None
) -> tuple[ViewSamples, ...]:
    """Find the points of the scene that the camera sees behind one another at each sample of its picture.

    The first layer is what `sample` gives. Each further one has, where the surface before lets anything through
    (`umbrae.transmission`), the next surface in order of (distance, triangle), and background elsewhere. Holes are no
    surfaces.

    Parameters
    ----------
    layers
        How many to find at most. There are fewer when no sample has a further surface: one of a solid scene.
    samples_per_pixel, clock
        As for `sample`.

    Raises
    ------
    InputError
        When a texture decides how much light passes, and the scene has no texture coordinates.
    OptionError
        When `layers` or `samples_per_pixel` is not a whole number from 1.
    CapacityError
        When the layers would not fit into memory.
    """
    check_layers(layers)
    picture, table = picture_of(scene, camera, samples_per_pixel), transmission_of(scene)
    if table is not None and layers > 1:
        _require(scene, camera, layers, samples_per_pixel)
    bands = Bands.of(scene, camera, picture)
    found, lock = [Seen.of(picture)], Lock()

    def layer(number: int) -> Seen:
        with lock:
            if len(found) == number:
                found.append(_another(picture, number))
            return found[number]

    def band(index: int) -> None:
        top, bottom = bands.rows(index)
        part = found[0].rows(picture, top, bottom)
        nearest = bands.draw(index, Floor.before_all(picture), part)
        if table is None:
            return
        floor = Floor.of(len(nearest))
        for number in range(1, layers):
            if not _peel(bands.geometry.triangles, table, part, nearest, picture, top, floor):
                return
            part = Seen.background(len(nearest))
            nearest = bands.draw(index, floor, part)
            if (part.triangle < 0).all():
                return
            layer(number).rows(picture, top, bottom).put(part, slice(None))

    run(band, bands.tasks, clock)
    return tuple(seen.samples(scene, camera) for seen in found)


def check_layers(layers: int) -> None:
    """Refuse anything but a whole number from 1."""
    if not is_whole(layers) or layers < 1:
        raise OptionError(f"layers: wanted a whole number from 1, got {shown(layers)}")


def _require(scene: Scene, camera: Camera, layers: int, per_pixel: int) -> None:
    """Refuse layers that will not fit into memory; where all of them would not, a small picture tells how many come."""
    one = camera.width * camera.height * per_pixel * BYTES_PER_SAMPLE
    shrink = max(camera.width, camera.height) / _SMALL
    if layers * one <= available_bytes() or shrink <= 1.0:
        return
    width, height = (max(1, round(side / shrink)) for side in (camera.width, camera.height))
    count = len(sample_layers(scene, replace(camera, width=width, height=height), layers))
    require(
        count * one,
        f"a picture of {camera.width} x {camera.height} pixels with {per_pixel} samples each in {count} layers "
        "(fewer need less)",
    )


def _another(picture: Picture, number: int) -> Seen:
    """Room for a further layer, which may be one more than `_require` has seen."""
    total = picture.width * picture.height * len(picture.x)
    require(
        total * BYTES_PER_SAMPLE,
        f"layer {number + 1} of a picture of {picture.width} x {picture.height} pixels with {len(picture.x)} samples "
        "each (fewer layers need less)",
    )
    return Seen.background(total)


@kernel
def _peel(
    triangles: NDArray[np.int32],
    table: Transmission,
    part: Seen,
    nearest: NDArray[np.float64],
    picture: Picture,
    top: int,
    floor: Floor,
) -> bool:
    """Make a layer of a band the floor, where it lets anything through; returns whether it does anywhere."""
    kind, material_id, _, _, base, transmitted, cutoff, mode, uv, colors, texels, offset, size = table
    triangle, barycentric = part.triangle, part.barycentric
    depth, before, box = floor
    width, per_pixel = picture.width, len(picture.x)
    box[0], box[1], box[2], box[3] = picture.height, -1, width, -1
    for at in range(len(triangle)):
        depth[at], before[at] = np.inf, -1
        t = triangle[at]
        if t < 0 or kind[t] == SOLID:
            continue
        if kind[t] == VARYING:
            u, v = np.float64(barycentric[at, 0]), np.float64(barycentric[at, 1])
            red, green, blue, opacity = surface_at(
                triangles, material_id, base, cutoff, mode, uv, colors, texels, offset, size, t, 1.0 - u - v, u, v
            )
            if opacity == 1.0 and transmitted[material_id[t]] * max(red, green, blue) == 0.0:
                continue
        depth[at], before[at] = nearest[at], t
        widen(box, top, at, width, per_pixel)
    return bool(box[0] <= box[1])


@inline
def widen(box: NDArray[np.int32], top: int, at: int, width: int, per_pixel: int) -> None:
    """Let the box of a floor hold the sample `at` of a band that begins with row `top`."""
    row, column = top + at // (width * per_pixel), at // per_pixel % width
    box[0], box[1] = min(box[0], row), max(box[1], row)
    box[2], box[3] = min(box[2], column), max(box[3], column)
