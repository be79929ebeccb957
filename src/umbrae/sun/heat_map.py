"""A picture of the hours of sun: every pixel holds its own exact hours, not those of a sensor nearby."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from umbrae.camera import Camera
from umbrae.checks import instance, whole
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.image import Image
from umbrae.memory import require
from umbrae.methods import Method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene
from umbrae.sun.colors import colors
from umbrae.sun.legend import BACKGROUND, legend
from umbrae.sun.sensors import facets
from umbrae.sun.solar import Sky
from umbrae.sun.study import SunStudy, sun_study

_BYTES_PER_SAMPLE = 120
"""Normals, colours and lines, measured."""
_CREASE = math.cos(math.radians(25.0))
_LINE, _SOFT = 0.45, 0.86
"""What is left of a colour on an outline or a crease, and on a face seen at a glancing angle."""
_DARK, _GLOW = np.float32(0.3), np.float32(0.5)
"""Colours below that brightness have lighter lines, the darkest by so much."""


def sun_map(
    scene: Scene,
    camera: Camera,
    sky: Sky,
    samples_per_pixel: int = 4,
    method: str | Method = "frustum",
    clock: Clock | None = None,
) -> tuple[Image, SunStudy]:
    """Draw the hours of direct sun as the camera sees them, with a legend below.

    Parameters
    ----------
    camera
        Of the picture without its legend, which adds `legend_height(width)` rows.
    sky
        When and where, see `Sky.over`.
    samples_per_pixel
        A square number: a finer picture is studied, then scaled down.
    method, clock
        As in `sun_hours`; the clock also hears of "sample" and "draw".

    Returns
    -------
    tuple
        The picture, and the study of the finer picture, by its rows and columns.

    Raises
    ------
    OptionError
        For samples per pixel that are no square number, an unknown method, or when cmap is not installed.
    CapacityError
        When the picture would not fit into memory.
    """
    clock = clock or Clock()
    instance(scene, Scene, "scene")
    finer = finer_camera(camera, samples_per_pixel)
    fine = finer.width // camera.width
    with clock.span("sample"):
        samples = sample(scene, finer, clock=clock)
    study = sun_study(scene, samples, sky, method, clock)
    with clock.span("draw"):
        drawn = _draw(scene, finer, samples, study)
        # Averaged as shown: in linear light the thin lines would fade.
        shown = drawn.reshape(camera.height, fine, camera.width, fine, 3).mean(axis=(1, 3))
        pixels = np.concatenate([np.round(shown * 255).astype(np.uint8), legend(camera.width, sky)])
    return Image(pixels, samples), study


def finer_camera(camera: Camera, samples_per_pixel: int) -> Camera:
    """The camera of the finer picture that `sun_map` studies; raises what `sun_map` would, before any work."""
    instance(camera, Camera, "camera")
    colors(np.zeros(1), 1.0)
    fine = math.isqrt(max(0, whole(samples_per_pixel, "samples_per_pixel")))
    if fine < 1 or fine * fine != samples_per_pixel:
        raise OptionError(f"samples_per_pixel: wanted a square number such as 1, 4 or 9, got {samples_per_pixel}")
    finer = replace(camera, width=camera.width * fine, height=camera.height * fine)
    require(finer.width * finer.height * _BYTES_PER_SAMPLE, f"a sun map of {camera.width} x {camera.height} pixels")
    return finer


def _draw(scene: Scene, camera: Camera, samples: ViewSamples, study: SunStudy) -> NDArray[np.float32]:
    """sRGB `(h, w, 3)` in [0, 1]: colour by hours, a little darker at glancing angles, with outlines and creases."""
    picture = np.empty((*samples.shape, 3), np.float32)
    picture[:] = np.array(BACKGROUND) / 255
    seen = samples.covered
    unit = facets(scene)[0].astype(np.float32)
    normal = np.zeros((*samples.shape, 3), np.float32)
    normal[seen] = unit[samples.triangle[seen]] * samples.side[seen][:, None]
    towards = camera.eye.astype(np.float32) - samples.position
    facing = np.einsum("hwi,hwi->hw", normal, towards) / np.maximum(np.linalg.norm(towards, axis=2), 1e-30)
    tone = _SOFT + (1 - _SOFT) * np.clip(facing, 0, 1)
    picture[seen] = colors(study.hours[seen], study.sky.possible_hours) * tone[seen][:, None]
    line = _lines(camera, samples, normal)
    bright = picture[line].mean(axis=1, keepdims=True)
    # Lines darken what is bright; where the sun never comes they would be lost, and are lighter instead.
    picture[line] = picture[line] * _LINE + _GLOW * np.maximum(0, 1 - bright / _DARK)
    return picture


def _lines(camera: Camera, samples: ViewSamples, normal: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Samples next to the background, and those whose right or lower neighbour is at another depth or angle."""
    assert samples.depth is not None
    line = np.zeros(samples.shape, bool)
    size = np.float32(2 * math.tan(math.radians(camera.fov_y) / 2) / camera.height)
    everything = slice(None)
    for here, there in (
        ((everything, slice(None, -1)), (everything, slice(1, None))),
        ((slice(None, -1), everything), (slice(1, None), everything)),
    ):
        between = samples.position[there] - samples.position[here]
        depth = np.where(samples.covered[here], samples.depth[here], 0)
        # Off the plane of both by more than a pixel: a step, not the next facet of something round.
        off = np.minimum(
            np.abs(np.einsum("hwi,hwi->hw", normal[here], between)),
            np.abs(np.einsum("hwi,hwi->hw", normal[there], between)),
        )
        edge = (off > size * depth) | (np.einsum("hwi,hwi->hw", normal[here], normal[there]) < _CREASE)
        line[here] |= samples.covered[here] & (edge | ~samples.covered[there])
        line[there] |= samples.covered[there] & ~samples.covered[here]
    return line
