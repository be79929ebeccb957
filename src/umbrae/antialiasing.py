"""Shadows with smooth edges from one view sample per pixel (Sintorn et al. 2011, section 3.3)."""

import numpy as np
from numpy.typing import NDArray

from umbrae.checks import whole
from umbrae.clock import Clock
from umbrae.errors import OptionError
from umbrae.geometry.volume_faces import facing_of_all
from umbrae.light import Light
from umbrae.mask import Guarantee, ShadowMask, add_stats
from umbrae.memory import require
from umbrae.methods import Caster, Method, cast_shadow
from umbrae.samples import ViewSamples
from umbrae.sampling.footprint import footprint

_SAMPLES_AT_ONCE = 1 << 22
_BYTES_PER_SAMPLE = 140


def filtered_shadow(
    method: Method,
    caster: Caster,
    light: Light,
    samples: ViewSamples,
    count: int = 32,
    width: float = 1.0,
    clock: Clock | None = None,
) -> ShadowMask:
    """The share of light that arrives over each pixel's footprint, for a picture with one sample per pixel.

    Equal to percentage-closer filtering on a shadow map of infinite resolution, and like it occasionally wrong: a
    footprint goes on in the plane of what the pixel's middle sees, past outlines and corners. Each of its points gets
    its exact verdict.

    Deviations from the paper: see `umbrae.sampling.footprint`. Its 32 bits per pixel are samples here, a band of the
    picture at a time.

    Parameters
    ----------
    method, caster
        A method that takes points, and what it prepared.
    samples, count, width
        As for `footprint`.

    Returns
    -------
    ShadowMask
        `partial` is the mean, and nothing is guaranteed about it.
    """
    clock, scene = clock or Clock(), caster.scene
    height, across = samples.shape[0], samples.size // max(1, samples.shape[0])
    if whole(count, "footprint: count") < 1:
        raise OptionError(f"footprint: wanted a count of at least 1, got {count}")
    step = max(1, _SAMPLES_AT_ONCE // max(1, across * count))
    require(
        min(step, height) * across * count * _BYTES_PER_SAMPLE + samples.size * 13,
        f"filtering {count} samples for each of {across} x {height} pixels",
    )
    partial = np.empty((*samples.shape, 3), np.float32)
    # Points beside a triangle that is turned away do not know it: there the pixel's own verdict holds.
    facing = facing_of_all(scene.positions, scene.triangles, light.position)
    turned_away = np.append(facing, np.int8(0))[samples.triangle] * samples.side < 0
    stats: dict[str, int] = {}
    with clock.span("footprints"):
        for start in range(0, height, step):
            stop = min(start + step, height)
            spread = footprint(scene, samples, count, width, (start, stop))
            mask = cast_shadow(method, caster, light, spread)
            partial[start:stop] = _mean(mask)
            shaded = turned_away[start:stop]
            if shaded.any():
                alone = samples.rows(start, stop).take(np.flatnonzero(shaded))
                own = cast_shadow(method, caster, light, alone)
                partial[start:stop][shaded] = own.transmittance
            add_stats(stats, mask.stats)
            clock.advance(stop, height)
    return ShadowMask((partial == 0).all(axis=-1), Guarantee.NONE, stats=stats, partial=partial)


def _mean(mask: ShadowMask) -> NDArray[np.float32]:
    """What arrives at each pixel, `(rows, w, 3)`."""
    if mask.partial is None:
        lit: NDArray[np.float32] = 1 - mask.in_shadow.mean(axis=-1, dtype=np.float32)
        return np.repeat(lit[..., None], 3, axis=-1)
    mean: NDArray[np.float32] = mask.partial.mean(axis=2, dtype=np.float32)
    return mean
