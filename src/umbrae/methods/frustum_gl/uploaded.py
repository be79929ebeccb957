"""Samples on the GPU, and verdicts about them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from umbrae.camera import Camera
from umbrae.clock import Clock
from umbrae.errors import GraphicsError, InputError
from umbrae.gl.context import Session
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.frustum_gl.tiles import Tiles
from umbrae.methods.method import Caster
from umbrae.samples import ViewSamples

BLOCK = 1 << 23
"""Samples in a band: a 3840 x 2160 picture is one; larger ones go band by band to bound the memory."""
PLACE_BYTES = 16
TOLERANCE = 1e-4
"""Of shares of light. Each of n casters adds -log of its share in steps of 2**-26 to a sum, off by half a step, and so
2**-27 n of the product; that is less up to 13,000 casters over one sample. Shares below e**-16 count as that."""


@dataclass(frozen=True, eq=False)
class Band:
    """Some rows of a picture in OpenGL buffers, in the order of their arrays but for `places`, which stand by tiles.

    `samples` are the same on the CPU, `first` is the number of the first of them in the picture.
    """

    samples: ViewSamples
    first: int
    tiles: Tiles
    own: Any
    barycentrics: Any
    sides: Any
    places: Any


@dataclass(frozen=True, eq=False)
class UploadedSamples:
    """A picture's samples on the GPU, made by `FrustumGlCaster.upload` for that caster and any number of lights."""

    caster: Caster
    samples: ViewSamples
    camera: Camera
    bands: tuple[Band, ...]


@dataclass(frozen=True, eq=False)
class GpuShadow:
    """Verdicts on the GPU.

    Attributes
    ----------
    verdicts
        For each band of the uploaded samples a `moderngl.Buffer` with a byte for each sample: 1 in shadow, 0 lit.
        Buffers are filled up to a multiple of 4 bytes.
    partial
        For each band a buffer with three float32 for each sample, the shares of light that arrive; none where all
        casters are solid.
    stats
        As in `ShadowMask`.
    """

    session: Session
    uploaded: UploadedSamples
    verdicts: tuple[Any, ...]
    partial: tuple[Any, ...]
    stats: Mapping[str, int]

    def mask(self, clock: Clock | None = None) -> ShadowMask:
        """The verdicts as numpy arrays."""
        samples = self.uploaded.samples
        in_shadow = np.zeros(samples.size, bool)
        partial = np.ones((samples.size, 3), np.float32) if self.partial else None
        with (clock or Clock()).span("read"), self.session.current():
            for band, verdict in zip(self.uploaded.bands, self.verdicts, strict=True):
                count = band.samples.size
                in_shadow[band.first : band.first + count] = np.frombuffer(verdict.read(count), bool)
            if partial is not None:
                for band, shares in zip(self.uploaded.bands, self.partial, strict=True):
                    part = partial[band.first : band.first + band.samples.size]
                    part[:] = np.frombuffer(shares.read(), np.float32).reshape(-1, 3)
        shape = samples.shape
        if partial is None:
            return ShadowMask(in_shadow.reshape(shape), Guarantee.EXACT, stats=self.stats)
        return ShadowMask(
            in_shadow.reshape(shape), Guarantee.EXACT, stats=self.stats, partial=partial.reshape(*shape, 3),
            tolerance=TOLERANCE,
        )  # fmt: skip


def camera_of(samples: ViewSamples) -> Camera:
    """The camera of a whole picture whose samples lie on triangles.

    Raises
    ------
    InputError
        For anything else.
    """
    camera, shape = samples.camera, samples.shape
    if camera is None or len(shape) not in (2, 3) or shape[:2] != (camera.height, camera.width):
        raise InputError(
            f"frustum-gl: wanted the samples of a whole picture, got {'x'.join(map(str, shape))} points "
            "without one; the method `frustum` takes points"
        )
    free = np.flatnonzero(samples.covered & (samples.triangle < 0))
    if len(free):
        raise InputError(f"frustum-gl: sample {free[0]} lies on no triangle; the method `frustum` takes free points")
    return camera


def rows_of_band(camera: Camera, per_pixel: int, most_bytes: int) -> int:
    """How many rows of a picture one band may hold, where a buffer may have `most_bytes`.

    Raises
    ------
    GraphicsError
        When not even one.
    """
    # Tiles are 8 x 4 samples: up to 7 columns and 3 rows more than there are.
    most = min(BLOCK, most_bytes // PLACE_BYTES) // (camera.width * per_pixel + 7)
    rows = (most - 3) // per_pixel if per_pixel > 1 else most - 3
    if rows < 1:
        raise GraphicsError(
            f"frustum-gl: a row of {camera.width} pixels with {per_pixel} samples each has no room in one buffer of "
            f"this OpenGL driver, {most_bytes} bytes; the method `frustum` takes it"
        )
    return min(rows, camera.height)
