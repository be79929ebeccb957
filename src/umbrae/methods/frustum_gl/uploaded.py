"""Samples on the GPU, and verdicts about them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from umbrae.clock import Clock
from umbrae.gl.context import Session
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.frustum_gl.layout import Part, View
from umbrae.methods.method import Caster
from umbrae.samples import ViewSamples
from umbrae.scene import Scene

TOLERANCE = 1e-4
"""Of shares of light. Each of n casters adds -log of its share in steps of 2**-26 to a sum, off by half a step, and so
2**-27 n of the product; that is less up to 13,000 casters over one sample. Shares below e**-16 count as that."""


@dataclass(frozen=True, eq=False)
class Band:
    """Samples of one tree in OpenGL buffers: `given` in their order, `places` by tiles.

    `part` is the same on the CPU. `numbers` holds their numbers among all samples, where chance needs them; else None.
    """

    part: Part
    given: Any
    places: Any
    numbers: Any


@dataclass(frozen=True, eq=False)
class UploadedSamples:
    """Samples on the GPU, made by `FrustumGlCaster.upload` for that caster, its scene, and any number of lights."""

    caster: Caster
    scene: Scene
    samples: ViewSamples
    view: View
    bands: tuple[Band, ...]


@dataclass(frozen=True, eq=False)
class GpuShadow:
    """Verdicts on the GPU.

    Attributes
    ----------
    verdicts
        For each band of the uploaded samples a `moderngl.Buffer` with a byte for each sample, in the band's order: 1 in
        shadow, 0 lit. Buffers are filled up to a multiple of 4 bytes.
    partial
        For each band a buffer with three float32 for each sample, the shares of light that arrive; none where all
        casters are solid.
    by_chance
        Whether these shares are 0 or 1 by chance.
    stats
        As in `ShadowMask`.
    """

    session: Session
    uploaded: UploadedSamples
    verdicts: tuple[Any, ...]
    partial: tuple[Any, ...]
    by_chance: bool
    stats: Mapping[str, int]

    def mask(self, clock: Clock | None = None) -> ShadowMask:
        """The verdicts as numpy arrays."""
        samples = self.uploaded.samples
        in_shadow = np.zeros(samples.size, bool)
        partial = np.ones((samples.size, 3), np.float32) if self.partial else None
        with (clock or Clock()).span("read"), self.session.current():
            for band, verdict in zip(self.uploaded.bands, self.verdicts, strict=True):
                in_shadow[band.part.where] = np.frombuffer(verdict.read(band.part.samples.size), bool)
            if partial is not None:
                for band, shares in zip(self.uploaded.bands, self.partial, strict=True):
                    partial[band.part.where] = np.frombuffer(shares.read(), np.float32).reshape(-1, 3)
        in_shadow = in_shadow.reshape(samples.shape)
        if partial is None:
            return ShadowMask(in_shadow, Guarantee.EXACT, stats=self.stats)
        partial = partial.reshape(*samples.shape, 3)
        if self.by_chance:
            return ShadowMask(in_shadow, Guarantee.NONE, stats=self.stats, partial=partial)
        return ShadowMask(in_shadow, Guarantee.EXACT, stats=self.stats, partial=partial, tolerance=TOLERANCE)
