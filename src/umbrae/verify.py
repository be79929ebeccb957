"""A mask held against the truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import instance, whole
from umbrae.clock import Clock
from umbrae.errors import InputError
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask
from umbrae.methods.oracle import Oracle
from umbrae.samples import ViewSamples
from umbrae.scene import Scene


@dataclass(frozen=True, eq=False)
class Verdict:
    """How a mask compares with the oracle.

    Attributes
    ----------
    checked
        Number of samples compared.
    mismatches
        How many differ, inside the band or outside.
    outside_band, inside_band
        The two parts of `mismatches`. A mask whose guarantee is not `BANDED` has all of them outside.
    wrong
        `(n,)` flat indices of the mismatches.
    margin
        `(n,)` float32 world units: how far each of them lies at least from a change of verdict.
    """

    checked: int
    mismatches: int
    outside_band: int
    inside_band: int
    wrong: NDArray[np.intp]
    margin: NDArray[np.float32]

    @property
    def ok(self) -> bool:
        """Whether nothing differs outside the band."""
        return self.outside_band == 0

    @property
    def worst_margin(self) -> float:
        """The largest margin of a mismatch in world units; 0 without any."""
        return float(self.margin.max(initial=0.0))


def verify(
    scene: Scene,
    light: Light,
    samples: ViewSamples,
    mask: ShadowMask,
    count: int | None = None,
    seed: int = 0,
    clock: Clock | None = None,
) -> Verdict:
    """Compare a mask with the oracle.

    Parameters
    ----------
    count
        How many covered samples to draw at random (without repetition); all of them when None or too large.
    seed
        Of the draw.

    Raises
    ------
    InputError
        If mask and samples differ in shape, the samples were made for another scene, or `count` is not positive.
    """
    for value, kind, name in (
        (scene, Scene, "scene"),
        (light, Light, "light"),
        (samples, ViewSamples, "samples"),
        (mask, ShadowMask, "mask"),
    ):
        instance(value, kind, f"verify: {name}")
    samples.check(scene)
    if mask.in_shadow.shape != samples.shape:
        raise InputError(f"verify: mask has shape {mask.in_shadow.shape}, samples have {samples.shape}")
    if whole(seed, "verify: seed") < 0:
        raise InputError(f"verify: wanted a seed of at least 0, got {seed}")
    if count is not None and whole(count, "verify: count") < 1:
        raise InputError(f"verify: wanted a count of at least 1, got {count}")
    chosen = np.flatnonzero(samples.covered.reshape(-1))
    if count is not None and count < len(chosen):
        chosen = np.sort(np.random.default_rng(seed).choice(chosen, count, replace=False))
    drawn = samples.take(chosen)
    caster = Oracle().prepare(scene)
    truth = caster.shadow(light, drawn, clock).in_shadow
    differ = np.flatnonzero(truth != mask.in_shadow.reshape(-1)[chosen])
    margin = caster.margin(light, drawn.take(differ), truth[differ])
    wrong = chosen[differ]
    inside = np.zeros(len(wrong), bool)
    if mask.guarantee is Guarantee.BANDED and mask.band is not None:
        inside = margin <= mask.band.reshape(-1)[wrong]
    return Verdict(len(chosen), len(wrong), int((~inside).sum()), int(inside.sum()), wrong, margin)
