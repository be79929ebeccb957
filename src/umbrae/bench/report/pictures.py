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
from umbrae.methods import Method, make_method
from umbrae.samples import ViewSamples
from umbrae.sampling import sample
from umbrae.scene import Scene
from umbrae.shade import shade

SIZE = (720, 480)
WRONGLY_DARK, WRONGLY_LIT = (213, 94, 0), (0, 114, 178)
"""Colours of the difference; the page's key has them too."""


@dataclass(frozen=True)
class Pair:
    """Two pictures of the same view as data URIs, and their difference.

    Attributes
    ----------
    wrong
        Share of the covered samples on which `left` differs from the exact `right`.
    missing
        Why there are no pictures; None where there are.
    """

    title: str
    left: str
    right: str
    pictures: tuple[str, str, str] | None = None
    wrong: float = 0.0
    missing: str | None = None


@dataclass(frozen=True)
class _View:
    title: str
    scene: Scene
    camera: Camera
    light: Light


def pairs(clock: Clock) -> Iterator[Pair]:
    """Shadow maps beside exact shadows, close to where they differ."""
    pavilion, spheres = models.pavilion().opaque(), models.spheres(triangles=96_000)
    close = replace(models.pavilion_camera(*SIZE), fov_y=12.0)
    views = (
        _View("Pavilion in the sun", pavilion, close, models.pavilion_light()),
        _View(
            "Spheres under a lamp", spheres,
            Camera.look_at((-4, 4, 8), (0, 0.6, 0), fov_y=32, width=SIZE[0], height=SIZE[1]), models.spheres_light(),
        ),
    )  # fmt: skip
    for view in views:
        with clock.span(view.title):
            samples = sample(view.scene, view.camera)
            exact = make_method("frustum").prepare(view.scene).shadow(view.light, samples)
            for size in (1024, 8192):
                method = make_method("shadow-map", size=size)
                yield _pair(view, samples, exact, method, f"shadow map, {size} x {size}")


def _pair(view: _View, samples: ViewSamples, exact: ShadowMask, method: Method, name: str) -> Pair:
    try:
        mask = method.prepare(view.scene).shadow(view.light, samples)
    except GraphicsError as error:
        return Pair(view.title, name, "exact", missing=str(error))
    images = [shade(view.scene, view.camera, [view.light], samples, [one]) for one in (mask, exact)]
    differs = samples.covered & (mask.in_shadow != exact.in_shadow)
    grey = images[1].astype(np.float64).mean(axis=-1, keepdims=True) * 0.35 + 150
    shown = np.repeat(grey, 3, axis=-1).astype(np.uint8)
    shown[differs & mask.in_shadow] = WRONGLY_DARK
    shown[differs & exact.in_shadow] = WRONGLY_LIT
    share = float(differs.sum() / max(1, samples.covered.sum()))
    left, right, difference = (_uri(image) for image in (*images, shown))
    return Pair(view.title, name, "exact", (left, right, difference), share)


def _uri(pixels: NDArray[np.uint8]) -> str:
    """A picture that a page can hold in itself."""
    stream = io.BytesIO()
    Pillow.fromarray(pixels).save(stream, "WEBP", quality=88)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode()
