"""Lights with a size for any method: the mean over light samples that are the same for all view samples."""

import numpy as np

from umbrae.clock import Clock
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask, add_stats
from umbrae.methods.area_samples import fixed_samples
from umbrae.methods.method import Caster, Method
from umbrae.samples import ViewSamples

AREA_LIGHTS = "area lights"
"""What methods that take a light with a size by themselves have in `accepts`."""


def cast_shadow(
    method: Method, caster: Caster, light: Light, samples: ViewSamples, clock: Clock | None = None
) -> ShadowMask:
    """The shadow of any light by any method; `caster` is what the method prepared.

    Where the light has a size and the method does not take such lights, the mean over `method.light_samples` lights
    without one.
    """
    if light.is_area and AREA_LIGHTS not in method.accepts:
        return average_over_light(caster, light, samples, method.light_samples, clock)
    return caster.shadow(light, samples, clock)


def average_over_light(
    caster: Caster, light: Light, samples: ViewSamples, count: int, clock: Clock | None = None
) -> ShadowMask:
    """The mean of the masks of `count` lights without a size, on the disc that faces the middle of the view samples.

    All view samples see the same light samples, so that a soft edge consists of `count` hard ones. Nothing is promised
    of the mask as a whole, whatever the method promises of each of its parts.
    """
    seen = samples.position[samples.covered]
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2 if len(seen) else np.zeros(3, np.float32)
    total, stats = np.zeros((*samples.shape, 3)), dict[str, int]()
    tolerance = 0.0
    for position in fixed_samples(light, middle, count):
        mask = caster.shadow(Light(position, light.color, light.intensity), samples, clock)
        total += mask.transmittance
        tolerance += mask.tolerance
        add_stats(stats, mask.stats)
    partial = (total / count).astype(np.float32)
    return ShadowMask(
        (partial == 0).all(axis=-1),
        Guarantee.NONE,
        stats={**stats, "light_samples": count},
        partial=partial,
        tolerance=tolerance / count,
    )
