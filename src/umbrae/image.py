"""A finished picture."""

import io
import os
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage

from umbrae.checks import instance
from umbrae.errors import InputError
from umbrae.mask import ShadowMask
from umbrae.samples import ViewSamples


@dataclass(frozen=True, eq=False)
class Image:
    """Pixels and what they were made of.

    Attributes
    ----------
    pixels
        `(h, w, 3) uint8`, sRGB.
    samples
        The view samples behind them, if rendered from a scene: the first layer.
    masks
        One `ShadowMask` per light, of the first layer.
    behind
        The layers seen through the first one, front to back.
    masks_behind
        For each of those, one `ShadowMask` per light.
    """

    pixels: NDArray[np.uint8]
    samples: ViewSamples | None = None
    masks: tuple[ShadowMask, ...] = field(default=())
    behind: tuple[ViewSamples, ...] = field(default=())
    masks_behind: tuple[tuple[ShadowMask, ...], ...] = field(default=())

    def __post_init__(self) -> None:
        instance(self.pixels, np.ndarray, "Image.pixels")
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 3 or self.pixels.dtype != np.uint8:
            raise InputError(f"Image.pixels: wanted (h, w, 3) uint8, got {self.pixels.shape} {self.pixels.dtype}")

    @property
    def layers(self) -> tuple[ViewSamples, ...]:
        """All layers, `samples` first; none of a picture that was not rendered from a scene."""
        return () if self.samples is None else (self.samples, *self.behind)

    @property
    def layer_masks(self) -> tuple[tuple[ShadowMask, ...], ...]:
        """For each layer, one `ShadowMask` per light."""
        return () if self.samples is None else (self.masks, *self.masks_behind)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the picture; the extension chooses the format. It is written whole or not at all."""
        from umbrae.files import save_image

        save_image(path, self.pixels)

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        stream = io.BytesIO()
        PillowImage.fromarray(self.pixels).save(stream, "PNG")
        return stream.getvalue()
