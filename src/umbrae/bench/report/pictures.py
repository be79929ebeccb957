"""Pictures of two methods to slide between, and where the one is wrong, made when the page is."""

import base64
import io
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from umbrae import models
from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import GraphicsError
from umbrae.light import Light
from umbrae.mask import ShadowMask
from umbrae.methods import make_method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene
from umbrae.shade import shade

SIZE = (720, 480)
MAP_SIZES = (1024, 8192)
WITHOUT_OPENGL = "alias-free-map"
"""Stands in where shadow maps cannot be drawn."""
WRONGLY_DARK, WRONGLY_LIT = (213, 94, 0), (0, 114, 178)
"""Colours of the difference, as far apart for colour-blind eyes as for others; the page's key has them too."""


@dataclass(frozen=True)
class Pair:
    """Two pictures of the same view as data URIs, and their difference.

    Attributes
    ----------
    title
        What is seen.
    left, right
        The methods; `right` is exact.
    pictures
        Of `left`, of `right`, and of where `left` is wrong.
    wrong_dark, wrong_lit
        Shares of the covered samples that are dark in `left` and lit in truth, and the other way round.
    missing
        Why `left` is not the method that was meant; None where it is.
    """

    title: str
    left: str
    right: str
    pictures: tuple[str, str, str]
    wrong_dark: float
    wrong_lit: float
    missing: str | None = None


@dataclass(frozen=True)
class View:
    """What to look at, from where, in which light."""

    title: str
    scene: Scene
    camera: Camera
    light: Light


def views() -> Iterator[View]:
    """Close to outlines, where shadow maps show their texels."""
    camera = Camera.look_at((7, 7.4, 25), (2.0, 2.2, 1.7), fov_y=5, width=SIZE[0], height=SIZE[1])
    yield View("Pavilion in the sun", models.pavilion().opaque(), camera, models.pavilion_light())
    camera = Camera.look_at((-4, 4, 8), (-1.7, 0.3, 1.6), fov_y=10, width=SIZE[0], height=SIZE[1])
    yield View("Spheres under a lamp", models.spheres(triangles=96_000), camera, models.spheres_light())


def pairs(clock: Clock) -> Iterator[Pair]:
    """Shadow maps beside exact shadows; without OpenGL, two exact methods beside each other."""
    for view in views():
        with clock.span(view.title):
            samples = sample(view.scene, view.camera)
            exact = make_method("frustum").prepare(view.scene).shadow(view.light, samples)
            try:
                for size in MAP_SIZES:
                    mask = make_method("shadow-map", size=size).prepare(view.scene).shadow(view.light, samples)
                    yield pair(view, samples, mask, exact, f"shadow map, {size:,} x {size:,}")
            except GraphicsError as error:
                mask = make_method(WITHOUT_OPENGL).prepare(view.scene).shadow(view.light, samples)
                made = pair(view, samples, mask, exact, WITHOUT_OPENGL)
                yield replace(made, missing=f"no shadow map: {error}")


def pair(view: View, samples: ViewSamples, mask: ShadowMask, exact: ShadowMask, name: str) -> Pair:
    """Both masks shaded, and the samples at which the first one differs in colour on a pale picture."""
    images = [shade(view.scene, view.camera, [view.light], samples, [one]) for one in (mask, exact)]
    differs = samples.covered & (mask.in_shadow != exact.in_shadow)
    grey = images[1].astype(np.float64).mean(axis=-1, keepdims=True) * 0.35 + 150
    shown = np.repeat(grey, 3, axis=-1).astype(np.uint8)
    shown[differs & mask.in_shadow] = WRONGLY_DARK
    shown[differs & exact.in_shadow] = WRONGLY_LIT
    covered = max(1, int(samples.covered.sum()))
    dark, lit = (float((differs & one.in_shadow).sum()) / covered for one in (mask, exact))
    return Pair(view.title, name, "exact", (_uri(images[0]), _uri(images[1]), _uri(shown)), dark, lit)


def _uri(pixels: NDArray[np.uint8]) -> str:
    """A picture that a page can hold in itself."""
    stream = io.BytesIO()
    Pillow.fromarray(pixels).save(stream, "WEBP", quality=90)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode()
